//! Exact solutions of a scene, each value with an error bound or a standard error.
//!
//! The dispatcher takes the cheapest solver that can treat the scene, and refines it until its own error bound meets
//! what was asked. [`Solution::solver`] says which one it was, at which effort, and why.

mod box_room;
mod direct;
mod emission;
mod final_gather;
mod gmres;
mod limits;
mod once_reflected;
mod path_tracing;
mod prepared;
pub mod quadrature;
mod sampler;
mod stop;
#[cfg(test)]
mod stop_tests;
mod validate;
mod visibility;

use crate::scene::{Meter, Scene, Transport};
use crate::units::Lux;
pub use emission::sight::Sight;
pub use prepared::{Prepared, Way};
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
    /// Relative error asked for; the solver refines until its own bound meets it.
    pub relative_error: f64,
    /// Seed of the Monte Carlo solvers.
    pub seed: u64,
}

/// What a solver found, one estimate a meter, in the meters' order.
#[derive(Clone, Debug)]
pub struct Solution {
    /// Illuminances with their uncertainty.
    pub estimates: Vec<Estimate>,
    /// Which solver gave them, at which effort, and why that one.
    pub solver: String,
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
