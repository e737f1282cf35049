//! Metamorphic laws: what a change of a scene must do to its readings, whatever the scene; one entry a law.
//!
//! A law needs no second opinion: the same engine reads the scene before and after, or a closed form holds for any room.

mod furnace;
mod light;
mod meters;
mod similarity;
mod surfaces;
#[cfg(test)]
mod tests;

pub use furnace::error_of_mean;
use luminaire::scene::Transport;
use serde::{Deserialize, Serialize};

use crate::engines::Job;

/// Every law, in the order of reports.
pub fn all() -> impl Iterator<Item = &'static Law> + Clone {
    [similarity::LAWS, light::LAWS, surfaces::LAWS, meters::LAWS].into_iter().flatten()
}

pub struct Law {
    pub id: &'static str,
    pub what: &'static str,
    /// What the magnitude is, with its unit.
    pub unit: &'static str,
    /// From mild to extreme.
    pub magnitudes: &'static [f64],
    pub light: Light,
    /// The changed job and what it must read; `None` where the law says nothing of such a job.
    pub variant: fn(&Job, f64) -> Option<Variant>,
}

impl Law {
    /// The mildest magnitude that changes anything, as its place among all.
    pub fn mild(&self) -> usize {
        self.magnitudes.iter().position(|m| *m != 0.0).unwrap_or(0)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Light {
    Direct,
    Reflected,
    Either,
}

impl Light {
    pub const fn concerns(self, transport: Transport) -> bool {
        match transport {
            Transport::Direct => matches!(self, Self::Direct | Self::Either),
            Transport::Indirect(_) => matches!(self, Self::Reflected | Self::Either),
            // Both parts are tried apart.
            Transport::Total(_) => false,
        }
    }
}

#[derive(Clone, Debug)]
pub struct Variant {
    pub job: Job,
    pub against: Against,
}

#[derive(Clone, Debug)]
pub enum Against {
    /// At each station what the unchanged job reads there, times this.
    Base(f64),
    /// At each station the sum of what these jobs read there.
    Sum(Vec<Job>),
    /// At each station a closed form, in lux.
    Known(Vec<f64>),
    /// A closed form for the weighted mean over all stations, which is off by its quadrature besides: [`error_of_mean`].
    Mean {
        /// One a station; they add up to 1.
        weights: Vec<f64>,
        value_lx: f64,
    },
    /// At each station what the exact simulation reads at a finer accuracy; to itself that is a test of its own bounds.
    Witness,
}

/// One job of a law, so that another process finds it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Place {
    pub law: String,
    pub magnitude: f64,
    /// 0 for the changed job, from 1 for those whose readings it must add up to.
    pub part: usize,
}

pub fn find(id: &str) -> Option<&'static Law> {
    all().find(|law| law.id == id)
}

pub fn job(base: &Job, place: &Place) -> Option<Job> {
    let variant = (find(&place.law)?.variant)(base, place.magnitude)?;
    match (place.part, variant.against) {
        (0, _) => Some(variant.job),
        (k, Against::Sum(mut parts)) if k <= parts.len() => Some(parts.swap_remove(k - 1)),
        _ => None,
    }
}
