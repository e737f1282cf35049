//! Radiance (Ward 1994): its own rtrace, ambient cache off, driven through stdin and read in 64-bit floats.

mod export;
#[cfg(test)]
mod failure_tests;
mod float_error;
mod grazing;
#[cfg(test)]
mod opening_tests;
mod options;
mod route;
mod sampling;
mod settings;
mod superposition;
#[cfg(test)]
mod superposition_tests;
#[cfg(test)]
pub(super) mod tests;
mod tools;

use luxproof_scene::{LuminaireModel, Transport};

use self::export::Light;
use self::options::{Ambient, Options, Sources};
use self::sampling::Sampler;
use self::settings::{Photometrist, Settings};
use self::tools::Tools;
use super::cost::DirectCost;
use super::settings::Preset;
use super::{
    Absent, Component, Engine, EngineError, EngineRoot, Entry, Job, JobDir, Measurement, SceneFile, Sensor, Setting,
    Support, Version, checked,
};
use luxproof_model::{EngineName, Estimate, Uncertainty};
use luxproof_process::random::seed;

const ID: EngineName = EngineName::new("radiance");

pub(super) static ENTRY: Entry = Entry {
    name: ID,
    display_name: "Radiance",
    installs: &[Component::PythonPackages, Component::LibFaketime],
    is_on_request: false,
    models: &[LuminaireModel::Point, LuminaireModel::Area, LuminaireModel::Impostor],
    fits_coordinates: Some("rescale"),
    make: || Box::new(Radiance),
};

/// Radiance keeps colours and candela tables in 32-bit floats; measured against the inverse-square law.
const FLOAT_READ_OUT: f64 = 5e-7;

pub(super) struct Radiance;

impl Engine for Radiance {
    fn name(&self) -> EngineName {
        ID
    }

    fn reads_files(&self, job: &Job) -> bool {
        Settings::of(job).is_ok_and(|settings| settings.is_native())
    }

    fn reads_meters_independently(&self) -> bool {
        true
    }

    fn probe(&self, site: &EngineRoot) -> Result<Version, Absent> {
        Tools::find(site)?.version(site)
    }

    fn supports(&self, job: &Job) -> Support {
        // `export` and `read` report settings that make no sense as errors.
        let Ok(settings) = Settings::of(job) else { return Support::Yes };
        if let Some(why) = job.scene.luminaires.iter().find_map(|l| export::unsupported(l, &settings)) {
            return Support::No(why);
        }
        let left_out = Some(options::remainder(job)).filter(|r| *r > 1e-6);
        let known = [
            (left_out, format!("light after {} bounces is left out", options::bounces(job))),
            (out_of_the_box(job, &settings), "rtrace's defaults cut reflections short and interpolate a cache".into()),
            (
                export::disc_error(job, &settings),
                "parts of a round opening count alike and are not as dense everywhere".into(),
            ),
            (
                export::swallowed(job, &settings),
                "sources of ies2rad swallow the reflected light that meets them".into(),
            ),
        ];
        let known: Vec<_> = known.into_iter().filter_map(|(size, why)| Some((size?, why))).collect();
        if known.is_empty() {
            return Support::Yes;
        }
        let size = known.iter().map(|(size, _)| size).sum();
        let why: Vec<_> = known.into_iter().map(|(_, why)| why).collect();
        Support::Approximate { why: why.join("; "), size: Some(size) }
    }

    fn components(&self, job: &Job) -> Vec<String> {
        match Settings::of(job).map(|s| s.photometrist) {
            // It reads the file as our reader and writer pass it on, expanded to the whole sphere.
            // Of the file it reads all but which way the luminaire hangs.
            Ok(Photometrist::Native) => vec!["ies2rad".to_owned()],
            Ok(Photometrist::Ies2rad) => vec![super::FILE_READER.to_owned(), "ies2rad".to_owned()],
            _ => vec![super::FILE_READER.to_owned()],
        }
    }

    fn export(&self, job: &Job) -> Result<Vec<SceneFile>, EngineError> {
        let settings = Settings::of(job)?;
        Ok(export::files(job, &settings, &printed_options(job, &settings)))
    }

    fn command_by_hand(&self, job: &Job, site: &EngineRoot) -> Option<String> {
        Some(
            Tools::find(site).map_or_else(|_| "sh run.sh".to_owned(), |tools| tools.command_by_hand(seed(&[job.seed]))),
        )
    }

    fn expected_s(&self, job: &Job) -> Option<f64> {
        DirectCost { start: 0.01, a_point: 2e-5, an_opening: Some(6e-4) }.of(job)
    }

    fn settings(&self) -> &'static [Setting] {
        settings::SETTINGS
    }

    fn check_settings(&self, job: &Job) -> Result<(), EngineError> {
        Settings::of(job).map(drop)
    }

    fn read(&self, job: &Job, workbench: &JobDir) -> Result<Measurement, EngineError> {
        read_files(&self.export(job)?, job, workbench)
    }
}

/// How far rtrace's own ambient settings were off, relative: up to a third in case S1.
fn out_of_the_box(job: &Job, settings: &Settings) -> Option<f64> {
    (settings.preset == Preset::Default && job.transport != Transport::Direct).then_some(0.35)
}

/// What a person who runs the scene by hand gets: one block of audit size.
fn printed_options(job: &Job, settings: &Settings) -> Options {
    let divisions = match settings.preset {
        Preset::Audit => options::AUDIT_DIVISIONS,
        Preset::Fast | Preset::Default => options::FAST_DIVISIONS,
    };
    let divisions = settings.ambient_divisions.unwrap_or(divisions);
    Options::of(job, settings, Ambient { divisions, risk: Ambient::LOW_RISK })
}

fn read_files(files: &[SceneFile], job: &Job, workbench: &JobDir) -> Result<Measurement, EngineError> {
    let settings = Settings::of(job)?;
    let tools = Tools::find(&workbench.site).map_err(|absent| EngineError::output(ID, absent.to_string()))?;
    workbench.write(files)?;
    for (k, luminaire) in job.scene.luminaires.iter().enumerate() {
        tools.ies2rad(workbench, k, luminaire, &settings)?;
    }
    let scenes = superposition::scenes(job, &settings).len();
    let lights = Light::of(job, &settings);
    tools.compile(workbench, &lights, scenes)?;
    let rows = export::rows(job, export::scale(job, settings.coordinates));
    let until = workbench.until();
    let light = if lights.contains(&Light::Reflected) { Light::Reflected } else { Light::All };
    let sampler = Sampler { job, settings: &settings, tools: &tools, workbench, rows, scenes, light, until };
    let options = printed_options(job, &settings);
    let mut measurement = Measurement::default();
    measurement.effort.insert("seed".into(), job.seed.to_string());
    if scenes > 1 {
        measurement.effort.insert("scenes".into(), scenes.to_string());
    }

    let direct = match job.transport {
        Transport::Indirect(_) => vec![],
        _ => direct(&sampler, &options, &mut measurement)?,
    };
    if job.transport == Transport::Direct {
        measurement.effort.insert("rtrace".into(), options.direct.join(" "));
        measurement.estimates = direct;
        return checked(&ID, job, measurement);
    }
    let part_lx = options.part_of_total.as_ref().map(|part| sampler.determined(part)).transpose()?;
    let is_total = matches!(job.transport, Transport::Total(_));
    // Where all light is asked for, its error is, whatever of it the blocks hold.
    let known_lx = match &part_lx {
        Some(part_lx) if !is_total => part_lx.clone(),
        None if is_total => direct.iter().map(|direct| -direct.value).collect(),
        _ => vec![],
    };
    let (total, ambient) = sampler.total(&known_lx)?;
    let part_lx = part_lx.unwrap_or_else(|| vec![0.0; job.sensors.len()]);
    let options = sampler.options(ambient);
    let (count, divisions) = (total.blocks.count().to_string(), ambient.divisions.to_string());
    let settings = [("rtrace", options.join(" ")), ("blocks", count), ("ambient_divisions", divisions)];
    measurement.effort.extend(settings.map(|(key, value)| (key.to_owned(), value)));
    let total = measurement.take(total);
    let reflected = total.into_iter().zip(part_lx).map(|(total, part_lx)| reflected(total, part_lx));
    measurement.estimates = if is_total {
        reflected.zip(&direct).map(|(reflected, direct)| reflected.plus(direct)).collect()
    } else {
        reflected.collect()
    };
    checked(&ID, job, measurement)
}

/// Direct light at every sensor: read once where rtrace's answer is determined, in blocks where it is sampled.
fn direct(
    sampler: &Sampler<'_>,
    options: &Options,
    measurement: &mut Measurement,
) -> Result<Vec<Estimate>, EngineError> {
    let Sampler { job, settings, .. } = *sampler;
    if Sources::of(job, settings) == Sources::Openings && settings.preset != Preset::Default {
        let ratios: Vec<f64> = job.sensors.iter().map(|s| grazing::ratio(job, settings, &s.meter)).collect();
        let means = measurement.take(sampler.direct(&ratios)?).into_iter().zip(&job.sensors);
        let whole = means.zip(&ratios).map(|((mean, sensor), ratio)| {
            let (all, lost_lx) = (sampled(mean), grazing::lost_lx(job, &sensor.meter, *ratio));
            let uncertainty = match all.uncertainty {
                // No sample met light where rtrace leaves all of it out.
                Uncertainty::NotSeen if lost_lx > 0.0 => Uncertainty::Bound(lost_lx),
                other => other.within(lost_lx),
            };
            Estimate { uncertainty, ..all }
        });
        return Ok(whole.collect());
    }
    let direct_lx = sampler.determined(&options.direct)?;
    let pairs = direct_lx.into_iter().zip(&job.sensors);
    Ok(pairs.map(|(value_lx, sensor)| determined(job, value_lx, sensor)).collect())
}

fn determined(job: &Job, value: f64, sensor: &Sensor) -> Estimate {
    let bound = FLOAT_READ_OUT * value + float_error::of_tables_lx(&job.scene, &sensor.meter);
    Estimate { value, uncertainty: Uncertainty::Bound(bound) }
}

/// A mean of blocks; the read-out adds to its error.
fn sampled(mean: Estimate) -> Estimate {
    Estimate { uncertainty: mean.uncertainty.within(FLOAT_READ_OUT * mean.value), ..mean }
}

/// All light less the direct part of it, which rtrace finds anew each time to the last digit.
fn reflected(total: Estimate, part_lx: f64) -> Estimate {
    let all = sampled(total);
    let value = all.value - part_lx;
    // Below its error a difference has no sign.
    let lost =
        value < 0.0 && all.uncertainty.standard_error().is_some_and(|e| value > -4.0 * e - all.uncertainty.bound());
    Estimate { value: if lost { 0.0 } else { value }, ..all }
}
