//! POV-Ray 3.7: meters as discs seen by a mesh camera, radiosity in independent blocks of a turned scene.
//!
//! Direct light is exact to its float colours. Radiosity interpolates a cache of irradiance (Ward, Rubinstein & Clear,
//! SIGGRAPH 1988), deterministically: each block turns the whole scene by another rotation and starts elsewhere in the
//! sequence of sample directions, which gives it other directions and other cache points, so that the blocks' spread is
//! an honest standard error of their mean. The first reflection is read without the cache, which takes nine tenths of the
//! variance away. What all blocks share, the bias of interpolating the later ones, is named beside the readings.

mod bench;
mod direct_error;
mod export;
mod frame;
mod opening;
mod pigment;
mod pixels;
mod settings;

#[cfg(test)]
pub(super) mod tests;

use std::path::PathBuf;

use luminaire::scene::{Bounces, Luminaire, LuminaireModel, Transport};

use super::effort;
use super::settings::{Coordinates, Preset};
use super::workbench::by_hand;
use super::{
    Absent, Component, Engine, EngineError, Entry, Job, Knob, Measurement, SceneFile, Site, Support, Version,
    Workbench, checked,
};
use crate::record::{EngineName, Estimate};
use crate::system::process;
use export::Light;
use settings::Settings;

const ID: EngineName = EngineName::new("povray");

pub(super) static ENTRY: Entry = Entry {
    name: ID,
    display_name: "POV-Ray",
    colour: ("#007a5a", "#3fc79d"),
    installs: &[Component::PythonPackages, Component::PovRay],
    is_on_request: false,
    models: &[LuminaireModel::Point, LuminaireModel::Area],
    fits_coordinates: Some("recentre"),
    make: || Box::new(PovRay),
};

pub(super) struct PovRay;

impl Engine for PovRay {
    fn name(&self) -> EngineName {
        ID
    }

    fn probe(&self, site: &Site) -> Result<Version, Absent> {
        let remedy = || "run `luxproof engines install`, or install the Debian package povray".to_owned();
        let absent = |reason| Absent { reason, remedy: remedy() };
        let reader = site.python_package("OpenImageIO");
        let reader = reader.ok_or_else(|| absent("OpenImageIO, which reads its images, is not there".to_owned()))?;
        let program = bench::program(site).map_err(|e| absent(e.to_string()))?;
        let done = process::ask(program.clone(), "--version", |asked| bench::hermetic(asked, site));
        let done = done.map_err(|e| absent(e.to_string()))?;
        let said = format!("{}\n{}", String::from_utf8_lossy(&done.stdout), done.stderr);
        let version = said.lines().find_map(|l| l.trim().strip_prefix("POV-Ray "));
        let version = version.and_then(|v| v.split_whitespace().next());
        let version = version.ok_or_else(|| absent("povray does not tell its version".to_owned()))?;
        // Unpacked with it; the system's own libraries are not asked, nor Mitsuba's.
        let (unpacked, llvm) = (site.debian(), site.libraries("libLLVM"));
        let is_its = |l: &PathBuf| program.starts_with(&unpacked) && l.starts_with(&unpacked) && !llvm.contains(l);
        let libraries = site.libraries("lib").into_iter().filter(is_its);
        Ok(Version::of(&ID, version, site, libraries.chain([program.clone(), reader])))
    }

    fn supports(&self, job: &Job) -> Support {
        support(job)
    }

    fn export(&self, job: &Job) -> Result<Vec<SceneFile>, EngineError> {
        Ok(files(job, &Settings::of(job)?, direct_error::points(job)))
    }

    fn command_by_hand(&self, job: &Job, site: &Site) -> Option<String> {
        Settings::of(job).ok()?;
        let program = bench::program(site).unwrap_or_else(|_| "povray".into());
        let command = |light, image: &str| {
            let arguments = export::arguments(job, light, 0, 0, image);
            bench::hermetic(by_hand(&program), site).args(arguments).command_line_with_env()
        };
        Some(match job.transport {
            Transport::Direct => command(Light::Direct, "direct.ppm"),
            Transport::Indirect(_) => command(Light::Indirect, "indirect.ppm"),
            Transport::Total(_) => {
                [command(Light::Direct, "direct.ppm"), command(Light::Indirect, "indirect.ppm")].join("; ")
            }
        })
    }

    fn knobs(&self) -> &'static [Knob] {
        settings::KNOBS
    }

    fn check_settings(&self, job: &Job) -> Result<(), EngineError> {
        Settings::of(job).map(drop)
    }

    fn read(&self, job: &Job, workbench: &Workbench) -> Result<Measurement, EngineError> {
        let (settings, points) = (Settings::of(job)?, direct_error::points(job));
        workbench.write(&files(job, &settings, points))?;
        let bench = bench::Bench::new(job, workbench, &settings, points)?;
        let measurement = match job.transport {
            Transport::Direct | Transport::Total(Bounces::AtMost(0)) => bench.direct()?,
            Transport::Indirect(Bounces::AtMost(0)) => darkness(job),
            Transport::Indirect(_) => bench.indirect()?,
            Transport::Total(_) => sum(&bench.direct()?, bench.indirect()?),
        };
        checked(&ID, job, measurement)
    }
}

fn files(job: &Job, settings: &Settings, points: usize) -> Vec<SceneFile> {
    let ini = "; POV-Ray takes this file for the user's and the system's povray.ini, which could change settings.\n";
    vec![export::scene(job, settings, points), SceneFile::text("povray.ini", ini)]
}

fn darkness(job: &Job) -> Measurement {
    let notes = vec!["nothing that was never reflected is indirect: not rendered".to_owned()];
    Measurement { estimates: vec![Estimate::DARK; job.stations.len()], notes, ..Measurement::default() }
}

fn sum(direct: &Measurement, mut indirect: Measurement) -> Measurement {
    for (total, part) in indirect.estimates.iter_mut().zip(&direct.estimates) {
        *total = total.plus(part);
    }
    for (key, value) in direct.effort.iter() {
        indirect.effort.entry(key.clone()).or_insert_with(|| value.clone());
    }
    indirect
}

fn support(job: &Job) -> Support {
    let unsupported = || job.scene.luminaires.iter().find_map(unsupported_luminaire);
    let objection = ENTRY.objection(job).or_else(unsupported);
    if let Some(why) =
        objection.or_else(|| filters_in_the_way(job)).or_else(|| too_near(job)).or_else(|| frame::narrow(job))
    {
        return Support::No(why);
    }
    let Some(bounces) = job.reflections() else { return Support::Yes };
    let Some(room) = job.scene.room else {
        return Support::No("in free field nothing reflects: there is no room to gather light from".to_owned());
    };
    let preset = Settings::of(job).map_or(Preset::Audit, |s| s.preset);
    cache_error(effort::mean_reflectance(&room), bounces, preset)
}

/// The bias of radiosity's cache, as measured against exact values, and what twenty reflections leave out.
fn cache_error(mean_reflectance: f64, bounces: Bounces, preset: Preset) -> Support {
    let interpolation = match preset {
        Preset::Audit => audit_bias(mean_reflectance),
        Preset::Default => 0.26,
        Preset::Fast => 0.05,
    };
    let cut = match bounces {
        Bounces::AtMost(n) if n <= settings::MAX_RECURSION => 0.0,
        _ => mean_reflectance.powi(settings::MAX_RECURSION as i32),
    };
    let mut why =
        "radiosity interpolates a cache of irradiance (Ward et al. 1988), whose bias all blocks share".to_owned();
    if cut > 1e-3 {
        why.push_str("; POV-Ray follows 20 reflections at most");
    }
    Support::Approximate { why, size: Some(interpolation + cut) }
}

/// Bias of the audit preset by mean reflectance, linear between what was measured: case S1 at .5; a closed 6 m room of .7
/// everywhere, +1.0 to +3.0 % within .2 %, most where it is darkest (8 blocks of 102 rays); rooms of .9, up to +9 %.
fn audit_bias(mean_reflectance: f64) -> f64 {
    let between = |(x, y): (f64, f64), (a, b): (f64, f64)| y + (b - y) * (mean_reflectance - x) / (a - x);
    let (usual, bright, white) = ((0.5, AUDIT_BIAS), (0.7, 0.03), (0.9, 0.09));
    if mean_reflectance <= usual.0 {
        usual.1
    } else if mean_reflectance <= bright.0 {
        between(usual, bright)
    } else {
        between(bright, white).min(white.1)
    }
}

/// Bias of the audit preset, relative: in S1, 12 blocks of 200 rays a sample read -.04 to +.07 % off the exact values, each
/// within .1 to .2 %, 30 blocks of 100 rays -.01 to +.13 % within .1 to .2 %, and 40 blocks of 50 rays -.02 to +.36 %.
const AUDIT_BIAS: f64 = 0.005;

fn unsupported_luminaire(luminaire: &Luminaire) -> Option<String> {
    let id = &luminaire.id;
    let planes = luminaire.photometry.distribution.full_circle().c_deg().len();
    if planes > pigment::MAX_ENTRIES {
        return Some(format!("{id} has {planes} C planes; a map of POV-Ray holds {}", pigment::MAX_ENTRIES));
    }
    match luminaire.model {
        LuminaireModel::Area if opening::parts(luminaire.photometry.opening, 1).is_none() => {
            Some(format!("{id}: only flat luminous openings are modelled in POV-Ray"))
        }
        _ => None,
    }
}

/// A luminaire's filter dims whatever passes through it: another luminaire's light towards a meter must not.
fn filters_in_the_way(job: &Job) -> Option<String> {
    let coordinates = Settings::of(job).map_or(Coordinates::Fitted, |s| s.coordinates);
    let radius_m = 1.5 * opening::FILTER_RADIUS / frame::Frame::of(job, coordinates).scale;
    let lit: Vec<&Luminaire> = job.scene.luminaires.iter().filter(|l| frame::candela(l) > 0.0).collect();
    for (k, a) in lit.iter().enumerate() {
        for (_, b) in lit.iter().enumerate().filter(|(j, _)| *j != k) {
            if a.position_m.distance(b.position_m) < 2.0 * radius_m {
                return Some(format!(
                    "{} and {} are at the same point, where POV-Ray would filter both by either",
                    a.id, b.id
                ));
            }
            let passes = |p: glam::DVec3| distance_to_segment(b.position_m, a.position_m, p) < radius_m;
            if let Some(station) = job.stations.iter().find(|s| passes(s.meter.position_m)) {
                return Some(format!("{} lies between {} and {}, and would filter its light", b.id, a.id, station.id));
            }
        }
        let near = job.stations.iter().find(|s| a.position_m.distance(s.meter.position_m) < 2.0 * radius_m);
        if let Some(station) = near {
            return Some(format!("{} is inside the filter of {}", station.id, a.id));
        }
    }
    None
}

/// A meter so near an opening that it tells the opening's point lights apart.
fn too_near(job: &Job) -> Option<String> {
    let is_read = !matches!(job.transport, Transport::Indirect(_));
    is_read.then(|| opening::too_near(job, opening::MOST_POINTS)).flatten()
}

fn distance_to_segment(point: glam::DVec3, from: glam::DVec3, to: glam::DVec3) -> f64 {
    let along = to - from;
    let t = ((point - from).dot(along) / along.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    point.distance(from + t * along)
}
