//! The dispatcher: which solver treats a scene, kept together with what it has solved so far.

use super::box_room::EmptyRoom;
use super::radiosity::Furnished;
use super::{Accuracy, Bounded, Estimate, SimulatorError, Solution, Uncertainty, direct, path_tracing, validate};
use crate::scene::{Bounces, LuminaireModel, Meter, Scene, Transport};
use crate::units::Lux;

/// Below this relative error radiosity is not tried: its finest mesh does not get there.
const RADIOSITY_REACHES: f64 = 2e-3;
/// Below this relative error paths are not tried where another solver has got as far.
const PATHS_REACH: f64 = 1e-4;
/// Half width of a 95 % t-interval with seven degrees of freedom, in standard errors.
const STUDENT_T: f64 = 2.365;

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
    /// Boxes, plates and rectangular openings.
    Furnished(Box<Furnished>),
    /// Meshes, round openings, bodies outside a room, more bodies than radiosity can mesh.
    PathsOnly,
}

impl Prepared {
    /// Checks a scene and picks its solver; solving waits for the first meters.
    pub fn new(scene: &Scene, transport: Transport, accuracy: &Accuracy) -> Result<Self, SimulatorError> {
        validate::scene(scene)?;
        validate::accuracy(accuracy)?;
        let points_only = scene.luminaires.iter().all(|l| l.model == LuminaireModel::Point);
        let solver = if points_only && scene.obstacles.is_empty() {
            Solver::Empty(EmptyRoom::default())
        } else {
            Furnished::new(scene).map_or(Solver::PathsOnly, |f| Solver::Furnished(Box::new(f)))
        };
        let (scene, accuracy) = (scene.clone(), *accuracy);
        Ok(Self { scene, transport, accuracy, factor: 1.0, solver })
    }

    /// The same light field with every luminaire dimmed by one more factor, not negative: nothing is solved again.
    #[must_use]
    pub fn dimmed(mut self, factor: f64) -> Self {
        self.factor *= factor;
        self
    }

    /// Illuminance at every meter; what is solved on the way stays for the next call.
    pub fn illuminance(&mut self, meters: &[Meter]) -> Result<Solution, SimulatorError> {
        validate::meters(&self.scene, meters)?;
        let mut solution = self.solve(meters)?;
        for estimate in &mut solution.estimates {
            *estimate = estimate.dimmed(self.factor);
        }
        Ok(solution)
    }

    fn solve(&mut self, meters: &[Meter]) -> Result<Solution, SimulatorError> {
        if matches!(self.solver, Solver::PathsOnly) {
            let mut solution = path_tracing::illuminance(&self.scene, meters, self.transport, &self.accuracy)?;
            solution.solver += ": meshes, round openings, bodies without a room or too many of them";
            return Ok(solution);
        }
        match self.transport {
            Transport::Direct => Ok(self.direct(meters)),
            Transport::Indirect(bounces) => self.indirect(meters, bounces),
            Transport::Total(bounces) => Ok(total(&self.direct(meters), &self.indirect(meters, bounces)?)),
        }
    }

    fn direct(&self, meters: &[Meter]) -> Solution {
        match &self.solver {
            Solver::Furnished(furnished) => {
                let values = furnished.direct(meters, self.accuracy.relative_error);
                bounded(&values, "openings clipped exactly by bodies")
            }
            Solver::Empty(_) | Solver::PathsOnly => {
                let values: Vec<_> = meters.iter().map(|m| direct::illuminance(&self.scene, m)).collect();
                bounded(&values, "inverse square: point luminaires, nothing in between")
            }
        }
    }

    fn indirect(&mut self, meters: &[Meter], bounces: Bounces) -> Result<Solution, SimulatorError> {
        let error = self.accuracy.relative_error;
        let Some(room) = self.scene.room else {
            let text = "free field: nothing reflects";
            return Ok(bounded(&vec![Bounded::default(); meters.len()], text));
        };
        match &mut self.solver {
            Solver::Empty(empty) => {
                let (values, text) = empty.indirect(&room, &self.scene.luminaires, bounces, meters, error);
                Ok(bounded(&values, &text))
            }
            Solver::Furnished(furnished) if error >= RADIOSITY_REACHES || furnished.is_integrable(bounces) => {
                let (values, text) = furnished.indirect(meters, bounces, error);
                let radiosity = bounded(&values, &text);
                let wide = error.max(PATHS_REACH);
                let open: Vec<usize> =
                    (0..values.len()).filter(|k| values[*k].bound > wide * values[*k].value).collect();
                if open.is_empty() {
                    return Ok(radiosity);
                }
                let asked: Vec<Meter> = open.iter().map(|k| meters[*k]).collect();
                Ok(narrower(radiosity, &open, self.paths(&asked, bounces).ok()))
            }
            Solver::Furnished(furnished) => {
                let transport = Transport::Indirect(bounces);
                if let Ok(mut paths) = path_tracing::illuminance(&self.scene, meters, transport, &self.accuracy) {
                    paths.solver += ": finer than radiosity reaches";
                    return Ok(paths);
                }
                let (values, text) = furnished.indirect(meters, bounces, error);
                Ok(bounded(&values, &text))
            }
            Solver::PathsOnly => self.paths(meters, bounces),
        }
    }

    fn paths(&self, meters: &[Meter], bounces: Bounces) -> Result<Solution, SimulatorError> {
        path_tracing::illuminance(&self.scene, meters, Transport::Indirect(bounces), &self.accuracy)
    }
}

fn bounded(values: &[Bounded], solver: &str) -> Solution {
    let estimate = |v: &Bounded| Estimate { illuminance: Lux(v.value), uncertainty: Uncertainty::Bound(v.bound) };
    Solution { estimates: values.iter().map(estimate).collect(), solver: solver.to_owned() }
}

/// Direct light with its bound, and indirect light with whatever it has.
fn total(direct: &Solution, indirect: &Solution) -> Solution {
    let add = |(d, i): (&Estimate, &Estimate)| {
        let bound = match d.uncertainty {
            Uncertainty::Bound(bound) => bound,
            Uncertainty::StandardError { value, .. } => value,
        };
        let uncertainty = match i.uncertainty {
            Uncertainty::Bound(other) => Uncertainty::Bound(bound + other),
            // A bound is counted as a standard error, which it is at most.
            Uncertainty::StandardError { value, degrees_of_freedom } => {
                Uncertainty::StandardError { value: value.hypot(bound), degrees_of_freedom }
            }
        };
        Estimate { illuminance: d.illuminance + i.illuminance, uncertainty }
    };
    let estimates = direct.estimates.iter().zip(&indirect.estimates).map(add).collect();
    Solution { estimates, solver: format!("{}; {}", direct.solver, indirect.solver) }
}

/// Path tracing at the open meters, where it knows them better.
fn narrower(mut radiosity: Solution, open: &[usize], paths: Option<Solution>) -> Solution {
    let Some(paths) = paths else { return radiosity };
    let width = |e: &Estimate| match e.uncertainty {
        Uncertainty::Bound(bound) => bound,
        Uncertainty::StandardError { value, .. } => STUDENT_T * value,
    };
    for (k, path) in open.iter().zip(&paths.estimates) {
        let estimate = &mut radiosity.estimates[*k];
        if width(path) < width(estimate) {
            *estimate = *path;
        }
    }
    radiosity.solver += &format!(", or {} where that is narrower", paths.solver);
    radiosity
}
