//! Radiance (Ward 1994): its own rtrace, ambient cache off, driven through stdin and read in 64-bit floats.

mod export;
mod float_error;
mod options;
mod sampling;
mod settings;
#[cfg(test)]
mod tests;
mod tools;

use std::time::Instant;

use luminaire::scene::{LuminaireModel, Transport};

use self::options::Options;
use self::sampling::Sampler;
use self::settings::{Preset, Settings};
use self::tools::Tools;
use super::{
    Absent, Engine, EngineError, EngineId, Estimate, Job, Measurement, SceneFile, Site, Station, Support, Version,
    Workbench, checked,
};

const ID: EngineId = EngineId("radiance");

/// Radiance keeps colours and candela tables in 32-bit floats; measured against the inverse-square law.
const FLOAT_READ_OUT: f64 = 5e-7;

const NOT_REPEATABLE: &str = "rtrace seeds its random numbers from the clock, so reflected light repeats within its \
                              standard error only; its fixed sequence (-u-) is biased by .3 %";

/// The engine.
pub(super) struct Radiance;

impl Engine for Radiance {
    fn id(&self) -> EngineId {
        ID
    }

    fn probe(&self, site: &Site) -> Result<Version, Absent> {
        Tools::find(site)?.version(site)
    }

    fn supports(&self, job: &Job) -> Support {
        if job.scene.luminaires.iter().any(|l| l.model != LuminaireModel::Point) {
            return Support::No("only point luminaires are exported to Radiance".into());
        }
        let remainder = options::remainder(job);
        if remainder > 1e-6 {
            let why = format!("light after {} bounces is left out", options::bounces(job));
            return Support::Approximate { why, size: Some(remainder) };
        }
        Support::Yes
    }

    fn export(&self, job: &Job) -> Result<Vec<SceneFile>, EngineError> {
        let settings = Settings::of(job)?;
        Ok(export::files(job, &settings, &printed_options(job, &settings)))
    }

    fn read(&self, job: &Job, workbench: &Workbench) -> Result<Measurement, EngineError> {
        read_files(&self.export(job)?, job, workbench)
    }
}

/// What a person who runs the scene by hand gets: one block of audit size.
fn printed_options(job: &Job, settings: &Settings) -> Options {
    let divisions = match settings.preset {
        Preset::Audit => options::AUDIT_DIVISIONS,
        Preset::Fast | Preset::Default => options::FAST_DIVISIONS,
    };
    Options::of(job, settings, settings.ambient_divisions.unwrap_or(divisions))
}

fn read_files(files: &[SceneFile], job: &Job, workbench: &Workbench) -> Result<Measurement, EngineError> {
    let started = Instant::now();
    let settings = Settings::of(job)?;
    let tools = Tools::find(&workbench.site).map_err(|absent| output(absent.to_string()))?;
    workbench.write(files)?;
    tools.compile(workbench)?;
    let rows = export::rows(job, export::scale(job, settings.scaling));
    let options = printed_options(job, &settings);
    let direct_lx = tools.rtrace(workbench, &options.direct, &rows)?;
    let mut measurement = Measurement::default();
    measurement.settings.insert("seed".into(), job.seed.to_string());
    if job.transport == Transport::Direct {
        measurement.settings.insert("rtrace".into(), options.direct.join(" "));
        let pairs = direct_lx.into_iter().zip(&job.stations);
        measurement.estimates = pairs.map(|(value_lx, station)| deterministic(job, value_lx, station)).collect();
        return checked(ID, job, measurement);
    }
    let subtract_lx = match job.transport {
        Transport::Indirect(_) => direct_lx,
        _ => vec![0.0; rows.len()],
    };
    let sampler = Sampler { job, settings: &settings, tools: &tools, workbench, rows, subtract_lx, started };
    let blocks = sampler.blocks()?;
    measurement.settings.insert("rtrace".into(), blocks.options.total.join(" "));
    measurement.settings.insert("blocks".into(), blocks.count().to_string());
    measurement.settings.insert("ambient_divisions".into(), blocks.divisions.to_string());
    measurement.notes.push(NOT_REPEATABLE.into());
    let pairs = blocks.estimates().into_iter().zip(&sampler.subtract_lx);
    measurement.estimates = pairs.map(|((mean, error), subtract)| sampled(mean, error, *subtract)).collect();
    checked(ID, job, measurement)
}

fn deterministic(job: &Job, value_lx: f64, station: &Station) -> Estimate {
    let bound = FLOAT_READ_OUT * value_lx + float_error::of_tables_lx(&job.scene, &station.meter);
    Estimate { value_lx, std_error_lx: None, error_bound_lx: Some(bound) }
}

/// The mean less the direct light; the read-out of both adds to the standard error.
fn sampled(mean_lx: f64, error_lx: Option<f64>, subtract_lx: f64) -> Estimate {
    let read_out = FLOAT_READ_OUT * mean_lx;
    let value_lx = mean_lx - subtract_lx;
    // Below the read-out a difference has no sign.
    let value_lx = if value_lx < 0.0 && value_lx > -read_out { 0.0 } else { value_lx };
    Estimate { value_lx, std_error_lx: error_lx.map(|e| e.hypot(read_out)), error_bound_lx: None }
}

fn output(what: String) -> EngineError {
    EngineError::Output { engine: ID, what }
}
