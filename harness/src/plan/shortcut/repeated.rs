//! Jobs that another case has already: equal ones are rendered once, those that differ in flux alone are rescaled; pure.

use std::collections::BTreeMap;

use luminaire::scene::Transport;

use super::Shortcut;
use crate::engines::{Engine, ExternalJob, Job};
use crate::plan::Scope;

/// Significant digits of flux that make a difference.
const DIGITS: usize = 12;

/// The jobs that were planned so far.
#[derive(Default)]
pub(in crate::plan) struct Repeated {
    /// By engine and job at unit flux: the job that is rendered and the flux scale of its first luminaire.
    seen: BTreeMap<Vec<u8>, (Job, f64, String)>,
}

impl Repeated {
    /// Replaces the job of a shortcut by one of an earlier case, where that tells the same.
    pub(in crate::plan) fn shorten(&mut self, shortcut: &mut Shortcut, engine: &dyn Engine) {
        let job = &shortcut.job;
        let flux = job.scene.luminaires.first().map_or(1.0, |l| l.flux_scale);
        if job.stations.is_empty() || !(flux > 0.0 && flux.is_finite()) {
            return;
        }
        let Some(name) = at_unit_flux(engine, job, flux) else { return };
        let here = format!("{} {}", job.case, job.procedure);
        let (earlier, earlier_flux, there) = self.seen.entry(name).or_insert_with(|| (job.clone(), flux, here.clone()));
        if *there == here {
            return;
        }
        let factor = flux / *earlier_flux;
        // What rounding leaves of an equal flux is no other flux.
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

/// What names a job at unit flux; `None` where the engine may see more in it than its light.
fn at_unit_flux(engine: &dyn Engine, job: &Job, flux: f64) -> Option<Vec<u8>> {
    let mut job = engine.cache_identity(job);
    for luminaire in &mut job.scene.luminaires {
        luminaire.flux_scale = format!("{:.*e}", DIGITS - 1, luminaire.flux_scale / flux).parse().ok()?;
    }
    if matches!(job.transport, Transport::Total(luminaire::scene::Bounces::AtMost(0))) {
        job.transport = Transport::Direct;
    }
    let mut name = engine.name().as_bytes().to_vec();
    name.push(0);
    name.extend(serde_json::to_vec(&job.settings).ok()?);
    name.extend(ExternalJob::of(&job).to_json().ok()?);
    Some(name)
}
