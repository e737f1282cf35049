//! Finds jobs that an earlier case also has: equal ones are rendered once, and those that differ in flux are rescaled.

use std::collections::BTreeMap;

use luxproof_scene::Transport;

use super::Shortcut;
use luxproof_engines::{Engine, ExternalJob, Job};
use luxproof_model::Scope;

/// Fluxes are equal if they agree in this number of significant digits.
const FLUX_DIGITS: usize = 12;

/// The jobs of all plans so far.
#[derive(Default)]
pub(in crate::plan) struct PlannedJobs {
    /// By engine and job at unit flux: the job that is rendered, the flux scale of its first luminaire, and its name.
    earlier: BTreeMap<Vec<u8>, (Job, f64, String)>,
}

impl PlannedJobs {
    /// Replaces the job of a shortcut by an equal one of an earlier case.
    pub(in crate::plan) fn shorten(&mut self, shortcut: &mut Shortcut, engine: &dyn Engine) {
        let job = &shortcut.job;
        let flux = job.scene.luminaires.first().map_or(1.0, |l| l.flux_scale);
        if job.sensors.is_empty() || !(flux > 0.0 && flux.is_finite()) {
            return;
        }
        let Some(name) = name_at_unit_flux(engine, job, flux) else { return };
        let here = format!("{} {}", job.case, job.procedure);
        let (earlier, earlier_flux, there) =
            self.earlier.entry(name).or_insert_with(|| (job.clone(), flux, here.clone()));
        if *there == here {
            return;
        }
        let factor = flux / *earlier_flux;
        // Rounding does not make two equal fluxes different.
        shortcut.factor = if (factor - 1.0).abs() < 1e-12 { 1.0 } else { factor };
        let reason = if shortcut.factor == 1.0 {
            format!("the same job as that of {there}")
        } else {
            format!("the same job as that of {there} but for the flux: rescaled by {:.6}", shortcut.factor)
        };
        shortcut.job = earlier.clone();
        shortcut.omit(Scope::Meter, 1.0, reason);
    }
}

/// The name of a job at unit flux, by which equal jobs are found.
///
/// `None` where the flux or the settings cannot be written exactly.
fn name_at_unit_flux(engine: &dyn Engine, job: &Job, flux: f64) -> Option<Vec<u8>> {
    let mut job = engine.cache_identity(job);
    for luminaire in &mut job.scene.luminaires {
        luminaire.flux_scale = format!("{:.*e}", FLUX_DIGITS - 1, luminaire.flux_scale / flux).parse().ok()?;
    }
    if matches!(job.transport, Transport::Total(luxproof_scene::Bounces::AtMost(0))) {
        job.transport = Transport::Direct;
    }
    let mut name = engine.name().as_bytes().to_vec();
    name.push(0);
    name.extend(serde_json::to_vec(&job.settings).ok()?);
    name.extend(ExternalJob::of(&job).to_json().ok()?);
    Some(name)
}
