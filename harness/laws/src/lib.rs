//! Metamorphic laws: how a change of any scene must change its readings.
//!
//! A law needs no reference engine: the same engine reads the scene before and after the change, or a closed form
//! holds.

mod furnace;
mod light;
mod meters;
mod similarity;
mod surfaces;
#[cfg(test)]
mod tests;

pub use furnace::error_of_mean;
use luxproof_scene::Transport;
use serde::{Deserialize, Serialize};

use luxproof_engines::Job;

/// Every law, in the order of reports.
pub fn all() -> impl Iterator<Item = &'static Law> + Clone {
    [similarity::LAWS, light::LAWS, surfaces::LAWS, meters::LAWS].into_iter().flatten()
}

/// A law, and the magnitudes at which it is tried.
pub struct Law {
    pub id: &'static str,
    pub what: &'static str,
    /// The quantity and unit of the magnitude.
    pub unit: &'static str,
    /// The magnitudes, from mild to extreme.
    pub magnitudes: &'static [f64],
    pub light: Light,
    /// The changed job and what it must read; `None` where the law does not apply to a job.
    pub variant: fn(&Job, f64) -> Option<Variant>,
}

impl Law {
    /// The index of the mildest magnitude that changes the scene.
    pub fn mild(&self) -> usize {
        self.magnitudes.iter().position(|m| *m != 0.0).unwrap_or(0)
    }
}

/// The light that a law is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Light {
    Direct,
    Reflected,
    Either,
}

impl Light {
    /// Whether a law of this light applies to a job of this transport.
    pub const fn concerns(self, transport: Transport) -> bool {
        match transport {
            Transport::Direct => matches!(self, Self::Direct | Self::Either),
            Transport::Indirect(_) => matches!(self, Self::Reflected | Self::Either),
            // Direct and reflected light are tried separately.
            Transport::Total(_) => false,
        }
    }
}

/// A changed job and what it must read.
#[derive(Clone, Debug)]
pub struct Variant {
    pub job: Job,
    pub against: Against,
}

/// What the readings of a changed job are compared with.
#[derive(Clone, Debug)]
pub enum Against {
    /// At each sensor the reading of the unchanged job, times this factor.
    Base(f64),
    /// At each sensor the sum of the readings of these jobs.
    Sum(Vec<Job>),
    /// At each sensor a closed form, in lux.
    Known(Vec<f64>),
    /// A closed form for the weighted mean over all sensors, within the quadrature's error: [`error_of_mean`].
    Mean {
        /// The weight of each sensor; their sum is 1.
        weights: Vec<f64>,
        value_lx: f64,
    },
    /// At each sensor the exact simulation at a finer accuracy. For the simulator this tests its bounds.
    Witness,
}

/// The place of a job among the laws, by which another process finds it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Place {
    pub law: String,
    pub magnitude: f64,
    /// 0 for the changed job; from 1 for the jobs of the sum that it must read.
    pub part: usize,
}

/// The law of an id.
pub fn find(id: &str) -> Option<&'static Law> {
    all().find(|law| law.id == id)
}

/// The job at a place.
pub fn job(base: &Job, place: &Place) -> Option<Job> {
    let variant = (find(&place.law)?.variant)(base, place.magnitude)?;
    match (place.part, variant.against) {
        (0, _) => Some(variant.job),
        (k, Against::Sum(mut parts)) if k <= parts.len() => Some(parts.swap_remove(k - 1)),
        _ => None,
    }
}
