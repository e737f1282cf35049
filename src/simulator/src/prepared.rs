//! The dispatcher: which solver treats a scene, kept together with what it has solved so far.

use super::box_room::{EmptyRoom, Request};
use super::limits::Limits;
use super::sampled::{REPLICATES, Reading, SampledRoom};
use super::stop::Stop;
use super::{Accuracy, Bounded, Estimate, Limit, SimulatorError, Solution, Uncertainty, direct, validate};
use luxproof_photometry::units::Lux;
use luxproof_scene::{Bounces, LuminaireModel, Meter, Scene, Transport};

/// A scene made ready for any number of meters.
#[derive(Debug)]
pub struct Prepared {
    scene: Scene,
    transport: Transport,
    accuracy: Accuracy,
    factor: f64,
    solver: Solver,
}

/// How a scene's light is computed. The cost depends on it first of all.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SolverKind {
    /// Light straight from the luminaires: laws, or integrals over what shows of them.
    Direct,
    /// Collocation in an empty box, by point luminaires.
    Collocation,
    /// Paths or shared surface points, sampled.
    Sampled,
}

#[derive(Debug)]
enum Solver {
    /// Point luminaires with nothing in between, in a room or in free field.
    Empty(EmptyRoom),
    /// Bodies, or luminaires of any extent.
    Sampled(Box<SampledRoom>),
}

impl Prepared {
    /// Checks a scene and picks its solver; solving waits for the first meters.
    pub fn new(scene: &Scene, transport: Transport, accuracy: &Accuracy) -> Result<Self, SimulatorError> {
        validate::scene(scene)?;
        validate::accuracy(accuracy)?;
        let solver = if Self::is_sampled(scene) {
            Solver::Sampled(Box::new(SampledRoom::new(scene)?))
        } else {
            Solver::Empty(EmptyRoom::default())
        };
        let (scene, accuracy) = (scene.clone(), *accuracy);
        Ok(Self { scene, transport, accuracy, factor: 1.0, solver })
    }

    /// Whether a scene has bodies or luminaires of any extent. Their light is sampled: the finer, the longer it takes.
    pub fn is_sampled(scene: &Scene) -> bool {
        !scene.obstacles.is_empty() || scene.luminaires.iter().any(|l| l.model != LuminaireModel::Point)
    }

    /// Which solver serves a scene.
    pub fn solver_kind(scene: &Scene, transport: Transport) -> SolverKind {
        match transport {
            Transport::Direct => SolverKind::Direct,
            Transport::Indirect(_) | Transport::Total(_) if Self::is_sampled(scene) => SolverKind::Sampled,
            Transport::Indirect(_) | Transport::Total(_) => SolverKind::Collocation,
        }
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

    /// As [`Self::illuminance`], until it is stopped: what is known by then comes with its larger uncertainty.
    pub fn illuminance_until(&mut self, meters: &[Meter], stop: &Stop) -> Result<Solution, SimulatorError> {
        validate::meters(&self.scene, meters)?;
        let (direct, indirect, mut solver, mut limit) = self.read(meters, stop)?;
        let mut readings: Vec<Reading> = direct.iter().zip(&indirect).map(|(d, i)| *d + *i).collect();
        if stop.is_due() {
            limit = Some(Limit::Time);
            let stopped = self.substitute_unread(meters, &direct, &indirect, &mut readings)?;
            solver = if solver.is_empty() { stopped } else { format!("{solver}; {stopped}") };
        }
        let estimates = readings.iter().map(|r| estimate(r).dimmed(self.factor)).collect();
        let replicates = match &self.solver {
            Solver::Empty(_) => vec![],
            Solver::Sampled(_) => {
                let of_meter = |r: &Reading| r.sampled.map(|s| self.factor * (r.known.value + s));
                readings.iter().map(of_meter).collect()
            }
        };
        Ok(Solution { estimates, replicates, solver, limit })
    }

    /// Replaces what is not known by an interval up to the most that luminaires can give; reports how often.
    fn substitute_unread(
        &self,
        meters: &[Meter],
        direct: &[Reading],
        indirect: &[Reading],
        readings: &mut [Reading],
    ) -> Result<String, SimulatorError> {
        let limits = Limits::new(&self.scene);
        let reflected = match self.transport {
            Transport::Direct => Bounded::NONE,
            Transport::Indirect(bounces) | Transport::Total(bounces) => limits.indirect(bounces),
        };
        let mut count = 0;
        for (k, reading) in readings.iter_mut().enumerate() {
            if reading.known.is_read() {
                continue;
            }
            let direct = if direct[k].known.is_read() { direct[k] } else { limits.direct(&meters[k]).into() };
            *reading = direct + if indirect[k].known.is_read() { indirect[k] } else { reflected.into() };
            count += 1;
        }
        if !readings.iter().all(|r| r.known.is_read()) {
            return Err(SimulatorError::Stopped);
        }
        let all = readings.len();
        Ok(match count {
            0 => "stopped, with what was known by then".to_owned(),
            _ => format!("stopped: of {count} of {all} meters there is what luminaires can give at most"),
        })
    }

    /// Direct and reflected light at meters, how it was found, and what ended it early.
    #[allow(clippy::type_complexity)]
    fn read(
        &mut self,
        meters: &[Meter],
        stop: &Stop,
    ) -> Result<(Vec<Reading>, Vec<Reading>, String, Option<Limit>), SimulatorError> {
        let none = || vec![Reading::from(Bounded::NONE); meters.len()];
        let (direct, text) = match self.transport {
            Transport::Indirect(_) => (none(), None),
            Transport::Direct | Transport::Total(_) => {
                let (values, text) = self.direct(meters, stop);
                (values, Some(text.to_owned()))
            }
        };
        let (indirect, how, limit) = match self.transport {
            Transport::Direct => (none(), None, None),
            Transport::Indirect(bounces) | Transport::Total(bounces) => {
                match self.indirect(meters, bounces, &direct, stop) {
                    Err(SimulatorError::Stopped) => (vec![Bounded::UNREAD.into(); meters.len()], None, None),
                    found => found.map(|(values, how, limit)| (values, Some(how), limit))?,
                }
            }
        };
        let texts: Vec<String> = text.into_iter().chain(how).collect();
        Ok((direct, indirect, texts.join("; "), limit))
    }

    fn direct(&self, meters: &[Meter], stop: &Stop) -> (Vec<Reading>, &'static str) {
        match &self.solver {
            Solver::Sampled(room) => {
                let Accuracy { relative_error, seed } = self.accuracy;
                let text = "luminaires integrated over what shows of them";
                (room.direct(meters, relative_error, seed, stop), text)
            }
            Solver::Empty(_) => {
                let values = meters.iter().map(|m| direct::illuminance(&self.scene, m).into()).collect();
                (values, "inverse square: point luminaires, nothing in between")
            }
        }
    }

    fn indirect(
        &mut self,
        meters: &[Meter],
        bounces: Bounces,
        direct: &[Reading],
        stop: &Stop,
    ) -> Result<(Vec<Reading>, String, Option<Limit>), SimulatorError> {
        let relative_error = self.accuracy.relative_error;
        match (&mut self.solver, self.scene.room) {
            (Solver::Empty(_), None) => {
                Ok((vec![Bounded::NONE.into(); meters.len()], "free field: nothing reflects".into(), None))
            }
            (Solver::Empty(empty), Some(room)) => {
                let luminaires = &self.scene.luminaires;
                let request = Request { room: &room, luminaires, bounces, meters, relative_error, stop };
                let (values, text) = empty.indirect(&request)?;
                Ok((values.into_iter().map(Reading::from).collect(), text, None))
            }
            (Solver::Sampled(room), _) => {
                let direct: Vec<f64> = direct.iter().map(|d| if d.known.is_read() { d.value() } else { 0.0 }).collect();
                room.indirect(meters, bounces, &direct, &self.accuracy, stop)
            }
        }
    }
}

/// A standard error where anything was sampled; a bound of what was integrated counts as a rectangular distribution in it
/// (JCGM 100:2008, 4.3.7).
fn estimate(reading: &Reading) -> Estimate {
    let (sampled, bound) = (reading.standard_error(), reading.known.bound);
    let uncertainty = if sampled == 0.0 {
        Uncertainty::Bound(bound)
    } else {
        let value = sampled.hypot(bound / 3_f64.sqrt());
        Uncertainty::StandardError { value, degrees_of_freedom: REPLICATES as u32 - 1 }
    };
    Estimate { illuminance: Lux(reading.value()), uncertainty }
}
