//! The dispatcher: which solver treats a scene, kept together with what it has solved so far.

use super::box_room::EmptyRoom;
use super::final_gather::Enclosure;
use super::limits::Limits;
use super::once_reflected::OnceReflected;
use super::stop::Stop;
use super::{Accuracy, Bounded, Estimate, SimulatorError, Solution, Uncertainty, direct, validate};
use crate::scene::{Bounces, LuminaireModel, Meter, Scene, Transport};
use crate::units::Lux;

/// Meters that are read together where bodies or openings make each of them dear.
const AT_ONCE: usize = 1024;
/// Errors from which on a first look comes before, and that of this look.
const FINE: f64 = 1e-3;
const FIRST_LOOK: f64 = 2e-2;

/// Bounds beyond this part of light reflected once tell that two rules have not come to agree, as where a surface is very near: what they
/// differ by is no bound there.
const UNAGREED: f64 = 1e-3;

/// A scene whose light field is solved once and then answers for any number of meters.
#[derive(Debug)]
pub struct Prepared {
    scene: Scene,
    transport: Transport,
    accuracy: Accuracy,
    factor: f64,
    solver: Solver,
}

/// How a scene's light is reckoned, known before anything is solved: what it takes depends on it first of all.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// Light straight from the luminaires: laws, or integrals over what shows of them.
    Direct,
    /// Collocation in an empty box, by point luminaires.
    Collocation,
    /// Light reflected once, integrated over what is both lit and seen.
    Once,
    /// Light balanced between rectangles; rays where that leaves something open.
    Balance,
    /// A final gather by rays.
    Rays,
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

    /// What takes long of a scene and depends neither on meters nor on how often light is reflected, as numbers; nothing where that is little,
    /// not known yet or not known as well as asked.
    pub fn groundwork(&self) -> Option<Vec<f64>> {
        match &self.solver {
            Solver::Enclosed(enclosure, _) => enclosure.groundwork(),
            Solver::Empty(_) => None,
        }
    }

    /// Takes the numbers that [`Self::groundwork`] gave of the same scene and relative error, and is as good as if it had found them itself.
    /// Numbers that cannot be those are left alone.
    pub fn lay(&mut self, groundwork: &[f64]) -> bool {
        match &mut self.solver {
            Solver::Enclosed(enclosure, _) => enclosure.lay(groundwork, self.accuracy.relative_error),
            Solver::Empty(_) => false,
        }
    }

    /// Which solver serves.
    pub fn way(&self) -> Way {
        match (&self.solver, self.transport) {
            (_, Transport::Direct) => Way::Direct,
            (Solver::Empty(_), _) => Way::Collocation,
            (Solver::Enclosed(_, Some(_)), Transport::Indirect(Bounces::AtMost(1))) => Way::Once,
            (Solver::Enclosed(enclosure, _), _) if enclosure.is_balanced() => Way::Balance,
            (Solver::Enclosed(..), _) => Way::Rays,
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

    /// As [`Self::illuminance`], until it is stopped: what is known by then comes with its larger bound.
    pub fn illuminance_until(&mut self, meters: &[Meter], stop: &Stop) -> Result<Solution, SimulatorError> {
        validate::meters(&self.scene, meters)?;
        let (values, text) = self.solve(meters, stop)?;
        let mut solution = bounded(&values, &text);
        for estimate in &mut solution.estimates {
            *estimate = estimate.dimmed(self.factor);
        }
        Ok(solution)
    }

    /// Light at meters; where each of them is dear so many at a time, lest all be begun and none known when time is up.
    fn solve(&mut self, meters: &[Meter], stop: &Stop) -> Result<(Vec<Bounded>, String), SimulatorError> {
        let first = self.first_look(meters, stop)?;
        let at_once = match self.solver {
            Solver::Empty(_) => meters.len(),
            Solver::Enclosed(..) => AT_ONCE,
        };
        let (mut found, mut text) = (Vec::with_capacity(meters.len()), String::new());
        for some in meters.chunks(at_once.max(1)) {
            if !found.is_empty() && stop.is_due() {
                break;
            }
            let (parts, how) = self.read(some, stop)?;
            found.extend(parts);
            text = how;
        }
        found.resize(meters.len(), self.unread());
        let mut values: Vec<Bounded> = found.iter().map(|[direct, indirect]| *direct + *indirect).collect();
        if stop.is_due() {
            let stopped = self.stand_in(meters, &found, &first, &mut values)?;
            text = if text.is_empty() { stopped } else { format!("{text}; {stopped}") };
        }
        Ok((values, text))
    }

    /// Where what is asked so finely may be stopped, a first look at it, which takes a small part of the time.
    fn first_look(&self, meters: &[Meter], stop: &Stop) -> Result<Vec<Bounded>, SimulatorError> {
        let Accuracy { relative_error, seed } = self.accuracy;
        let is_long = matches!(self.solver, Solver::Enclosed(..)) && self.transport != Transport::Direct;
        if !is_long || relative_error > FINE || !stop.may_come() {
            return Ok(vec![]);
        }
        let coarse = Accuracy { relative_error: FIRST_LOOK, seed };
        let mut first = Self::new(&self.scene, self.transport, &coarse)?;
        if let (Solver::Enclosed(first, _), Solver::Enclosed(enclosure, _)) = (&mut first.solver, &self.solver) {
            first.share_light(enclosure);
        }
        match first.solve(meters, stop) {
            Err(SimulatorError::Stopped) => Ok(vec![]),
            found => Ok(found?.0),
        }
    }

    /// What is not known of a meter before anything is.
    const fn unread(&self) -> [Bounded; 2] {
        match self.transport {
            Transport::Direct => [Bounded::UNREAD, Bounded::NONE],
            Transport::Indirect(_) => [Bounded::NONE, Bounded::UNREAD],
            Transport::Total(_) => [Bounded::UNREAD; 2],
        }
    }

    /// What is not known becomes what a first look found, or what the luminaires can give at most; in words how often that is.
    fn stand_in(
        &self,
        meters: &[Meter],
        found: &[[Bounded; 2]],
        first: &[Bounded],
        values: &mut [Bounded],
    ) -> Result<String, SimulatorError> {
        let limits = Limits::new(&self.scene);
        let reflected = match self.transport {
            Transport::Direct => Bounded::NONE,
            Transport::Indirect(bounces) | Transport::Total(bounces) => limits.indirect(bounces),
        };
        let mut count = 0;
        for (k, (value, [direct, indirect])) in values.iter_mut().zip(found).enumerate() {
            if !value.is_read() {
                let direct = if direct.is_read() { *direct } else { limits.direct(&meters[k]) };
                *value = direct + if indirect.is_read() { *indirect } else { reflected };
                count += 1;
            }
            if let Some(first) = first.get(k).filter(|first| first.bound < value.bound) {
                *value = *first;
            }
        }
        if !values.iter().all(Bounded::is_read) {
            return Err(SimulatorError::Stopped);
        }
        let all = values.len();
        Ok(match count {
            0 => "stopped, with what was known by then".to_owned(),
            _ => format!(
                "stopped: of {count} of {all} meters there is a first look, or what luminaires can give at most"
            ),
        })
    }

    /// Light at some meters, direct and reflected.
    fn read(&mut self, meters: &[Meter], stop: &Stop) -> Result<(Vec<[Bounded; 2]>, String), SimulatorError> {
        let (direct, text) = match self.transport {
            Transport::Indirect(_) => (vec![Bounded::NONE; meters.len()], None),
            Transport::Direct | Transport::Total(_) => {
                let (values, text) = self.direct(meters, stop);
                (values, Some(text))
            }
        };
        let (indirect, how) = match self.transport {
            Transport::Direct => (vec![Bounded::NONE; meters.len()], None),
            Transport::Indirect(bounces) | Transport::Total(bounces) => {
                match self.indirect(meters, bounces, &direct, stop) {
                    Err(SimulatorError::Stopped) => (vec![Bounded::UNREAD; meters.len()], None),
                    found => found.map(|(values, how)| (values, Some(how)))?,
                }
            }
        };
        let texts: Vec<String> = text.map(str::to_owned).into_iter().chain(how).collect();
        Ok((direct.into_iter().zip(indirect).map(|(d, i)| [d, i]).collect(), texts.join("; ")))
    }

    fn direct(&self, meters: &[Meter], stop: &Stop) -> (Vec<Bounded>, &'static str) {
        match &self.solver {
            Solver::Enclosed(enclosure, _) => {
                let Accuracy { relative_error, seed } = self.accuracy;
                let text = "luminaires integrated over what shows of them";
                (enclosure.direct(meters, relative_error, seed, stop), text)
            }
            Solver::Empty(_) => {
                let values = meters.iter().map(|m| direct::illuminance(&self.scene, m)).collect();
                (values, "inverse square: point luminaires, nothing in between")
            }
        }
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
            (Solver::Enclosed(enclosure, Some(once)), _) if bounces == Bounces::AtMost(1) => {
                let mut text = "light reflected once, integrated over what is both lit and seen".to_owned();
                let mut found = once.illuminance(meters, relative_error, stop);
                let is_rough = |k: &usize| found[*k].bound > UNAGREED * found[*k].value;
                let rough: Vec<usize> = (0..meters.len()).filter(is_rough).collect();
                if !rough.is_empty() && !stop.is_due() {
                    let some: Vec<Meter> = rough.iter().map(|k| meters[*k]).collect();
                    let direct: Vec<Bounded> = rough.iter().map(|k| direct[*k]).collect();
                    let (gathered, how) = enclosure.indirect(&some, bounces, &direct, &self.accuracy, stop)?;
                    for (k, gathered) in rough.into_iter().zip(gathered) {
                        if gathered.bound < found[k].bound {
                            found[k] = gathered;
                        }
                    }
                    text = format!("{text}; {how}");
                }
                Ok((found, text))
            }
            (Solver::Enclosed(enclosure, _), _) => enclosure.indirect(meters, bounces, direct, &self.accuracy, stop),
        }
    }
}

fn bounded(values: &[Bounded], solver: &str) -> Solution {
    let estimate = |v: &Bounded| Estimate { illuminance: Lux(v.value), uncertainty: Uncertainty::Bound(v.bound) };
    Solution { estimates: values.iter().map(estimate).collect(), solver: solver.to_owned() }
}
