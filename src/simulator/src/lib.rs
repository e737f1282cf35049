//! Solutions of a scene, each value with an error bound or a standard error.
//!
//! The dispatcher takes the solver that can treat the scene, and refines it until its own error meets what was asked. [`Solution::solver`] says which one it was, at which effort, and why.

#![warn(missing_docs)]

mod box_room;
mod direct;
mod emission;
mod gmres;
mod limits;
mod path_tracing;
mod prepared;
pub mod quadrature;
mod sampled;
mod sampler;
mod stop;
#[cfg(test)]
mod stop_tests;
mod validate;
mod visibility;

pub use emission::sight::Sight;
use luxproof_photometry::units::Lux;
use luxproof_scene::{Meter, Scene, Transport};
pub use prepared::{Prepared, SolverKind};
pub use sampled::REPLICATES;
use sampled::mean_and_error;
pub use stop::Stop;

/// Illuminance at every meter, by the cheapest solver that meets `accuracy`.
///
/// A solver that cannot go as far as asked returns what it has with its true bound; judge by the bound, not by the
/// wish. For many calls on one scene, keep a [`Prepared`].
pub fn illuminance(
    scene: &Scene,
    meters: &[Meter],
    transport: Transport,
    accuracy: &Accuracy,
) -> Result<Solution, SimulatorError> {
    Prepared::new(scene, transport, accuracy)?.illuminance(meters)
}

/// Illuminance at every meter by path tracing, which shares no kernel with the other solvers: their certifier.
pub fn certified(
    scene: &Scene,
    meters: &[Meter],
    transport: Transport,
    accuracy: &Accuracy,
) -> Result<Solution, SimulatorError> {
    certified_until(scene, meters, transport, accuracy, &Stop::NEVER)
}

/// As [`certified`], until it is stopped: what is known by then comes with its larger standard error.
pub fn certified_until(
    scene: &Scene,
    meters: &[Meter],
    transport: Transport,
    accuracy: &Accuracy,
    stop: &Stop,
) -> Result<Solution, SimulatorError> {
    validate::scene(scene)?;
    validate::meters(scene, meters)?;
    path_tracing::illuminance(scene, meters, transport, accuracy, stop)
}

/// A value and how far off it may be.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Bounded {
    value: f64,
    bound: f64,
}

impl Bounded {
    /// No light.
    const NONE: Self = Self { value: 0.0, bound: 0.0 };
    /// What a stopped solver has not come to.
    const UNREAD: Self = Self { value: 0.0, bound: f64::INFINITY };

    fn is_read(&self) -> bool {
        self.bound.is_finite()
    }

    /// Whether the bound is a part of the value at most.
    fn is_within(&self, relative_error: f64) -> bool {
        self.bound <= relative_error * self.value.abs()
    }
}

impl std::ops::Add for Bounded {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self { value: self.value + other.value, bound: self.bound + other.bound }
    }
}

/// How well and how reproducibly to solve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Accuracy {
    /// Relative error asked for: the solver refines until its own bound, or the standard error of what is sampled, meets it.
    pub relative_error: f64,
    /// Seed of the Monte Carlo solvers.
    pub seed: u64,
}

/// What a solver found, one estimate a meter, in the meters' order.
#[derive(Clone, Debug)]
pub struct Solution {
    /// Illuminances with their uncertainty.
    pub estimates: Vec<Estimate>,
    /// Of what was sampled the value of each independent randomisation, one array a meter; nothing where nothing was sampled.
    /// The same randomisation goes through all meters, so that sets of meters have their covariance.
    pub replicates: Vec<[f64; REPLICATES]>,
    /// Which solver gave them, at which effort, and why that one.
    pub solver: String,
    /// What ended sampling before the accuracy asked for, if anything did.
    pub limit: Option<Limit>,
}

/// What ends sampling early.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Limit {
    /// A deadline or a flag: another run may read otherwise.
    Time,
    /// The rays that were granted, the same on any machine.
    Rays,
}

impl Solution {
    /// A weighted sum of meters, such as their mean, with the uncertainty that their covariance gives it.
    ///
    /// Bounds of one method may err alike and add up.
    pub fn weighted_sum(&self, weights: &[f64]) -> Estimate {
        let pairs = || self.estimates.iter().zip(weights);
        let illuminance = Lux(pairs().map(|(e, w)| w * e.illuminance.value()).sum());
        let bound = pairs().map(|(e, w)| match e.uncertainty {
            Uncertainty::Bound(bound) => w.abs() * bound,
            Uncertainty::StandardError { .. } => 0.0,
        });
        let bound: f64 = bound.sum();
        if self.replicates.is_empty() {
            return Estimate { illuminance, uncertainty: Uncertainty::Bound(bound) };
        }
        let sums =
            std::array::from_fn(|r| self.replicates.iter().zip(weights).map(|(of_meter, w)| w * of_meter[r]).sum());
        let (_, sampled) = mean_and_error(&sums);
        if sampled == 0.0 {
            return Estimate { illuminance, uncertainty: Uncertainty::Bound(bound) };
        }
        let value = sampled.hypot(bound / 3_f64.sqrt());
        let uncertainty = Uncertainty::StandardError { value, degrees_of_freedom: REPLICATES as u32 - 1 };
        Estimate { illuminance, uncertainty }
    }
}

/// One illuminance with its uncertainty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The value.
    pub illuminance: Lux,
    /// How far off it may be.
    pub uncertainty: Uncertainty,
}

impl Estimate {
    fn dimmed(self, factor: f64) -> Self {
        let uncertainty = match self.uncertainty {
            Uncertainty::Bound(bound) => Uncertainty::Bound(bound * factor),
            Uncertainty::StandardError { value, degrees_of_freedom } => {
                Uncertainty::StandardError { value: value * factor, degrees_of_freedom }
            }
        };
        Self { illuminance: self.illuminance * factor, uncertainty }
    }
}

/// How far off a value may be, in lux.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Uncertainty {
    /// The true value lies within this distance.
    Bound(f64),
    /// Standard error of a mean of `degrees_of_freedom + 1` independent estimates.
    StandardError {
        /// One standard error.
        value: f64,
        /// For the t-interval.
        degrees_of_freedom: u32,
    },
}

/// Why a scene could not be solved.
#[derive(Clone, Debug, thiserror::Error)]
pub enum SimulatorError {
    /// The scene holds something that no solver can treat.
    #[error("the simulator cannot treat {what}; {instead}")]
    Unsupported {
        /// What it is.
        what: String,
        /// What to do instead.
        instead: String,
    },
    /// It was stopped before anything was known.
    #[error("the simulator was stopped before it knew anything; give it more seconds")]
    Stopped,
    /// Something has a place, a size or a value that makes no sense.
    #[error("{what} {problem}; {remedy}")]
    Invalid {
        /// Which part of the scene.
        what: String,
        /// What is wrong with it.
        problem: String,
        /// What to do.
        remedy: &'static str,
    },
}

/// A fresh seed where `LUXPROOF_NIGHTLY` is a number, as `ci/nightly` sets it, and a fixed one by day.
#[cfg(test)]
fn seed_of_night(day: u64) -> u64 {
    std::env::var("LUXPROOF_NIGHTLY").ok().and_then(|night| night.parse().ok()).unwrap_or(day)
}

/// What a study that takes long takes in every test run, and what it takes where `LUXPROOF_NIGHTLY` is set, as `ci/nightly` does.
#[cfg(test)]
fn by_night<T>(night: T, day: T) -> T {
    if std::env::var_os("LUXPROOF_NIGHTLY").is_some() { night } else { day }
}
