//! Exact solutions of a scene, each value with an error bound or a standard error.
//!
//! The dispatcher takes the cheapest solver that can treat the scene, and refines it until its own error bound meets
//! what was asked. [`Solution::solver`] says which one it was, at which effort, and why.

mod box_room;
mod direct;
mod gmres;
mod path_tracing;
mod quadrature;
mod sampler;
mod validate;

use crate::scene::{Bounces, LuminaireModel, Meter, Scene, Transport};
use crate::units::Lux;
use box_room::BoxField;

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

/// A scene whose light field is solved once and then answers for any number of meters.
#[derive(Debug)]
pub struct Prepared {
    scene: Scene,
    transport: Transport,
    accuracy: Accuracy,
    factor: f64,
    fields: Vec<(usize, BoxField)>,
}

impl Prepared {
    /// Checks a scene; solving waits for the first meters.
    pub fn new(scene: &Scene, transport: Transport, accuracy: &Accuracy) -> Result<Self, SimulatorError> {
        validate::scene(scene)?;
        validate::accuracy(accuracy)?;
        let (scene, accuracy) = (scene.clone(), *accuracy);
        Ok(Self { scene, transport, accuracy, factor: 1.0, fields: vec![] })
    }

    /// The same light field with every luminaire dimmed by one more common factor, not negative: light adds up, nothing is solved.
    #[must_use]
    pub fn dimmed(mut self, factor: f64) -> Self {
        self.factor *= factor;
        self
    }

    /// Illuminance at every meter; what is solved on the way stays for the next call.
    pub fn illuminance(&mut self, meters: &[Meter]) -> Result<Solution, SimulatorError> {
        validate::meters(&self.scene, meters)?;
        let points_only = self.scene.luminaires.iter().all(|l| l.model == LuminaireModel::Point);
        if !points_only || !self.scene.obstacles.is_empty() {
            let mut solution = path_tracing::illuminance(&self.scene, meters, self.transport, &self.accuracy)?;
            for estimate in &mut solution.estimates {
                *estimate = estimate.dimmed(self.factor);
            }
            return Ok(solution);
        }
        let (direct, indirect) = match self.transport {
            Transport::Direct => (true, None),
            Transport::Indirect(bounces) => (false, Some(bounces)),
            Transport::Total(bounces) => (true, Some(bounces)),
        };
        let mut values = vec![Bounded::default(); meters.len()];
        let mut solver = vec![];
        if direct {
            for (value, meter) in values.iter_mut().zip(meters) {
                *value = direct::illuminance(&self.scene, meter);
            }
            solver.push("inverse square: point luminaires, nothing in between".to_owned());
        }
        if let Some(bounces) = indirect {
            let (indirect, text) = self.indirect(meters, bounces);
            for (value, more) in values.iter_mut().zip(indirect) {
                *value = Bounded { value: value.value + more.value, bound: value.bound + more.bound };
            }
            solver.push(text);
        }
        let estimates = values.iter().map(|v| {
            let uncertainty = Uncertainty::Bound(v.bound);
            Estimate { illuminance: Lux(v.value), uncertainty }.dimmed(self.factor)
        });
        Ok(Solution { estimates: estimates.collect(), solver: solver.join("; ") })
    }

    fn indirect(&mut self, meters: &[Meter], bounces: Bounces) -> (Vec<Bounded>, String) {
        let Some(room) = self.scene.room else {
            return (vec![Bounded::default(); meters.len()], "free field: nothing reflects".into());
        };
        box_room::refine(&mut self.fields, &room, &self.scene.luminaires, bounces, meters, self.accuracy.relative_error)
    }
}

/// A value and how far off it may be.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Bounded {
    value: f64,
    bound: f64,
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
