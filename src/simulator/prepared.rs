//! The dispatcher: which solver treats a scene, kept together with what it has solved so far.

use super::box_room::EmptyRoom;
use super::final_gather::Enclosure;
use super::once_reflected::OnceReflected;
use super::stop::Stop;
use super::{Accuracy, Bounded, Estimate, SimulatorError, Solution, Uncertainty, direct, validate};
use crate::scene::{Bounces, LuminaireModel, Meter, Scene, Transport};
use crate::units::Lux;

/// A scene whose light field is solved once and then answers for any number of meters.
#[derive(Debug)]
pub struct Prepared {
    scene: Scene,
    transport: Transport,
    accuracy: Accuracy,
    factor: f64,
    solver: Solver,
}

#[derive(Debug)]
enum Solver {
    /// Point luminaires with nothing in between, in a room or in free field.
    Empty(EmptyRoom),
    /// Bodies, or luminaires of any extent; the first reflection apart where it can be integrated.
    Enclosed(Box<Enclosure>, Option<OnceReflected>),
}

impl Prepared {
    /// Checks a scene and picks its solver; solving waits for the first meters.
    pub fn new(scene: &Scene, transport: Transport, accuracy: &Accuracy) -> Result<Self, SimulatorError> {
        validate::scene(scene)?;
        validate::accuracy(accuracy)?;
        let solver = if Self::is_sampled(scene) {
            Solver::Enclosed(Box::new(Enclosure::new(scene)?), OnceReflected::new(scene))
        } else {
            Solver::Empty(EmptyRoom::default())
        };
        let (scene, accuracy) = (scene.clone(), *accuracy);
        Ok(Self { scene, transport, accuracy, factor: 1.0, solver })
    }

    /// Whether a scene has bodies or luminaires of any extent, whose light is sampled: the finer, the longer it takes.
    pub fn is_sampled(scene: &Scene) -> bool {
        !scene.obstacles.is_empty() || scene.luminaires.iter().any(|l| l.model != LuminaireModel::Point)
    }

    /// The same light field with every luminaire dimmed by one more factor, not negative: nothing is solved again.
    #[must_use]
    pub fn dimmed(mut self, factor: f64) -> Self {
        self.factor *= factor;
        self
    }

    /// Illuminance at every meter; what is solved on the way stays for the next call.
    pub fn illuminance(&mut self, meters: &[Meter]) -> Result<Solution, SimulatorError> {
        self.illuminance_until(meters, &Stop::NEVER)
    }

    /// As [`Self::illuminance`], until it is stopped: what is known by then comes with its larger bound.
    pub fn illuminance_until(&mut self, meters: &[Meter], stop: &Stop) -> Result<Solution, SimulatorError> {
        validate::meters(&self.scene, meters)?;
        let mut solution = self.solve(meters, stop)?;
        for estimate in &mut solution.estimates {
            *estimate = estimate.dimmed(self.factor);
        }
        Ok(solution)
    }

    fn solve(&mut self, meters: &[Meter], stop: &Stop) -> Result<Solution, SimulatorError> {
        let (direct, text) = match self.transport {
            Transport::Indirect(_) => (vec![Bounded::default(); meters.len()], None),
            Transport::Direct | Transport::Total(_) => {
                let (values, text) = self.direct(meters, stop)?;
                (values, Some(text))
            }
        };
        let (Transport::Indirect(bounces) | Transport::Total(bounces)) = self.transport else {
            return Ok(bounded(&direct, text.unwrap_or_default()));
        };
        let (indirect, how) = self.indirect(meters, bounces, &direct, stop)?;
        let sum: Vec<Bounded> = direct.iter().zip(&indirect).map(|(d, i)| *d + *i).collect();
        Ok(bounded(&sum, &text.map_or(how.clone(), |text| format!("{text}; {how}"))))
    }

    fn direct(&self, meters: &[Meter], stop: &Stop) -> Result<(Vec<Bounded>, &'static str), SimulatorError> {
        Ok(match &self.solver {
            Solver::Enclosed(enclosure, _) => {
                let Accuracy { relative_error, seed } = self.accuracy;
                let text = "luminaires integrated over what shows of them";
                (enclosure.direct(meters, relative_error, seed, stop)?, text)
            }
            Solver::Empty(_) => {
                let values = meters.iter().map(|m| direct::illuminance(&self.scene, m)).collect();
                (values, "inverse square: point luminaires, nothing in between")
            }
        })
    }

    fn indirect(
        &mut self,
        meters: &[Meter],
        bounces: Bounces,
        direct: &[Bounded],
        stop: &Stop,
    ) -> Result<(Vec<Bounded>, String), SimulatorError> {
        let relative_error = self.accuracy.relative_error;
        match (&mut self.solver, self.scene.room) {
            (Solver::Empty(_), None) => {
                Ok((vec![Bounded::default(); meters.len()], "free field: nothing reflects".into()))
            }
            (Solver::Empty(empty), Some(room)) => {
                empty.indirect(&room, &self.scene.luminaires, bounces, meters, relative_error, stop)
            }
            (Solver::Enclosed(_, Some(once)), _) if bounces == Bounces::AtMost(1) => {
                let text = "light reflected once, integrated over what is both lit and seen";
                Ok((once.illuminance(meters, relative_error, stop)?, text.into()))
            }
            (Solver::Enclosed(enclosure, _), _) => enclosure.indirect(meters, bounces, direct, &self.accuracy, stop),
        }
    }
}

fn bounded(values: &[Bounded], solver: &str) -> Solution {
    let estimate = |v: &Bounded| Estimate { illuminance: Lux(v.value), uncertainty: Uncertainty::Bound(v.bound) };
    Solution { estimates: values.iter().map(estimate).collect(), solver: solver.to_owned() }
}
