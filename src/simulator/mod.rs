//! Exact solutions of a scene, each value with an error bound or a standard error.

mod path_tracing;
mod sampler;

use crate::scene::{Meter, Scene, Transport};
use crate::units::Lux;

/// Illuminance at every meter, by the cheapest solver that meets `accuracy`.
pub fn illuminance(
    scene: &Scene,
    meters: &[Meter],
    transport: Transport,
    accuracy: &Accuracy,
) -> Result<Solution, SimulatorError> {
    path_tracing::illuminance(scene, meters, transport, accuracy)
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
}
