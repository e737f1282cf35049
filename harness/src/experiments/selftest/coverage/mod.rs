//! Do the simulator's bounds hold in rooms that nobody has seen? Random rooms and meters against path tracing, which shares no
//! ray caster and no light source with it.

mod room;

use std::collections::BTreeMap;
use std::fmt;

use luminaire::scene::{Bounces, Meter, Scene, Transport};
use luminaire::simulator::{
    Accuracy, Estimate, Prepared, SimulatorError, Solution, Stop, Uncertainty, certified_until,
};
use serde::Serialize;
use strum::IntoStaticStr;

use super::super::{median, tables};
use crate::system::process::{interrupt_flag, is_interrupted};

/// Meters of a room.
const METERS: usize = 30;
/// How much finer the certifier works.
const FINER: f64 = 3.0;
/// Standard errors of the certifier, seven degrees of freedom, that it is off by once in a thousand times.
const CERTIFIED_WITHIN: f64 = 5.4;
/// How often what seems to be a miss is certified again: the tail of path tracing is heavier than the blocks of one seed tell, so
/// that among thousands of readings some are certified wrongly.
const AGAIN: u64 = 3;
/// Boundaries of the histogram: error over bound and the certifier's own error together.
const BINS: [f64; 5] = [0.03, 0.1, 0.3, 1.0, f64::INFINITY];

/// Where a meter is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, IntoStaticStr)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum Kind {
    Open,
    Wall,
    Edge,
    Corner,
    Body,
    Luminaire,
}

#[derive(Clone, Debug, Default, Serialize)]
pub struct Coverage {
    pub rooms: usize,
    pub readings: usize,
    /// Readings beyond their bound by more than the certifier may be off, whatever it says again with other seeds.
    pub beyond: Vec<Miss>,
    /// How many seemed to be, until they were certified with other seeds.
    pub cleared: usize,
    /// How often an error lies within .03, .1, .3 and 1 of the bound and the certifier's error together, and beyond, by kind of meter.
    pub histogram: BTreeMap<Kind, [usize; BINS.len()]>,
    /// Bound over error in the median; errors have the certifier's own in them, so that it is more rather than less.
    pub bound_over_error: Option<f64>,
    /// The same as if readings were exact, and the certifier alone were off.
    pub bound_over_certifiers_error: Option<f64>,
    /// Error and the certifier's own, as likely exceeded as not, over bound.
    #[serde(skip)]
    errors_over_bound: Vec<[f64; 2]>,
    /// How many rooms each solver answered, some meters perhaps by the last that is named.
    pub rooms_by_solver: BTreeMap<String, usize>,
    /// What could not be solved, with its reason.
    pub refused: Vec<String>,
}

/// A reading beyond its bound.
#[derive(Clone, Debug, Serialize)]
pub struct Miss {
    pub seed: u64,
    pub light: String,
    pub kind: Kind,
    pub at_m: [f64; 3],
    pub normal: [f64; 3],
    pub value_lx: f64,
    pub bound_lx: f64,
    pub certified_lx: f64,
    pub certified_std_error_lx: f64,
}

impl Coverage {
    pub fn is_good(&self) -> bool {
        self.beyond.is_empty() && self.refused.is_empty()
    }
}

/// So many rooms, each of a seed of its own, to a relative error.
pub fn coverage(rooms: usize, relative_error: f64, seed: u64) -> Coverage {
    let mut coverage = Coverage::default();
    for index in 0..rooms as u64 {
        let own = fastrand::Rng::with_seed(seed ^ (index << 32)).u64(..);
        match Room::of(own, index, relative_error).and_then(|room| coverage.add(&room)) {
            Ok(()) => {}
            Err(_) if is_interrupted() => break,
            Err(why) => coverage.refused.push(format!("room {own}: {why}")),
        }
    }
    coverage
}

/// What a normal error of this standard deviation is below as often as above.
const PROBABLE_ERROR: f64 = 0.6745;

/// A room, what the simulator reads in it and what is certified.
struct Room {
    seed: u64,
    scene: Scene,
    meters: Vec<(Kind, Meter)>,
    transport: Transport,
    relative_error: f64,
    found: Solution,
    truth: Vec<Certified>,
}

/// What path tracing says of a reading.
#[derive(Clone, Copy)]
struct Certified {
    lux: f64,
    std_error_lx: f64,
    /// How far off it may be.
    allowed_lx: f64,
}

impl Certified {
    fn of(estimate: &Estimate) -> Self {
        let lux = estimate.illuminance.value();
        match estimate.uncertainty {
            Uncertainty::Bound(bound) => Self { lux, std_error_lx: bound, allowed_lx: bound },
            Uncertainty::StandardError { value, .. } => Self::sampled(lux, value),
        }
    }

    fn sampled(lux: f64, std_error_lx: f64) -> Self {
        Self { lux, std_error_lx, allowed_lx: CERTIFIED_WITHIN * std_error_lx }
    }

    /// The mean of several seeds', as uncertain as they say or as they scatter, whichever is more.
    fn together(seeds: &[Self]) -> Self {
        let count = seeds.len() as f64;
        let mean = seeds.iter().map(|c| c.lux).sum::<f64>() / count;
        let said: f64 = seeds.iter().map(|c| c.std_error_lx.powi(2)).sum::<f64>().sqrt() / count;
        let scatter = seeds.iter().map(|c| (c.lux - mean).powi(2)).sum::<f64>() / (count - 1.0);
        Self::sampled(mean, said.max((scatter / count).sqrt()))
    }
}

impl Room {
    fn of(seed: u64, index: u64, relative_error: f64) -> Result<Self, SimulatorError> {
        let (scene, meters) = room::room(seed, METERS);
        let lights = [
            Transport::Total(Bounces::Converged),
            Transport::Indirect(Bounces::Converged),
            Transport::Indirect(Bounces::AtMost(2)),
            Transport::Direct,
        ];
        let transport = lights[index as usize % lights.len()];
        let places: Vec<Meter> = meters.iter().map(|(_, meter)| *meter).collect();
        let accuracy = Accuracy { relative_error, seed };
        let found = Prepared::new(&scene, transport, &accuracy)?.illuminance_until(&places, &stop())?;
        let mut room = Self { seed, scene, meters, transport, relative_error, found, truth: vec![] };
        room.truth = room.certified(&places, seed.rotate_left(17))?;
        Ok(room)
    }

    fn certified(&self, places: &[Meter], seed: u64) -> Result<Vec<Certified>, SimulatorError> {
        let fine = Accuracy { relative_error: self.relative_error / FINER, seed };
        let found = certified_until(&self.scene, places, self.transport, &fine, &stop())?;
        Ok(found.estimates.iter().map(Certified::of).collect())
    }

    /// What seeds that have not been looked at say of some meters.
    fn certified_again(&self, meters: &[usize]) -> Result<Vec<Certified>, SimulatorError> {
        let places: Vec<Meter> = meters.iter().map(|k| self.meters[*k].1).collect();
        let mut random = fastrand::Rng::with_seed(self.seed.rotate_left(31));
        let seeds: Vec<_> = (0..AGAIN).map(|_| self.certified(&places, random.u64(..))).collect::<Result<_, _>>()?;
        let of = |k: usize| Certified::together(&seeds.iter().map(|seed| seed[k]).collect::<Vec<_>>());
        Ok((0..meters.len()).map(of).collect())
    }

    /// The reading of a meter and its bound.
    fn reading_lx(&self, meter: usize) -> (f64, f64) {
        let own = &self.found.estimates[meter];
        let bound_lx = match own.uncertainty {
            Uncertainty::Bound(bound) => bound,
            Uncertainty::StandardError { value, .. } => CERTIFIED_WITHIN * value,
        };
        (own.illuminance.value(), bound_lx)
    }

    /// Whether a reading is beyond its bound; what the certifier itself may be off says nothing of that.
    fn is_beyond(&self, meter: usize, truth: &Certified) -> bool {
        let (value_lx, bound_lx) = self.reading_lx(meter);
        let beyond = ((value_lx - truth.lux).abs() - truth.allowed_lx).max(0.0);
        beyond > bound_lx * (1.0 + 1e-9) || value_lx.is_nan()
    }

    fn miss(&self, meter: usize, truth: &Certified) -> Miss {
        let ((kind, place), (value_lx, bound_lx)) = (&self.meters[meter], self.reading_lx(meter));
        Miss {
            seed: self.seed,
            light: format!("{:?}", self.transport),
            kind: *kind,
            at_m: place.position_m.to_array(),
            normal: place.normal.to_array(),
            value_lx,
            bound_lx,
            certified_lx: truth.lux,
            certified_std_error_lx: truth.std_error_lx,
        }
    }
}

fn stop() -> Stop {
    Stop { flag: Some(interrupt_flag()), ..Stop::NEVER }
}

impl Coverage {
    fn add(&mut self, room: &Room) -> Result<(), SimulatorError> {
        let mut truth = room.truth.clone();
        let seeming: Vec<usize> = (0..truth.len()).filter(|k| room.is_beyond(*k, &truth[*k])).collect();
        if !seeming.is_empty() {
            for (k, again) in seeming.iter().zip(room.certified_again(&seeming)?) {
                truth[*k] = again;
            }
        }
        self.rooms += 1;
        *self.rooms_by_solver.entry(words(&room.found.solver)).or_default() += 1;
        for (k, truth) in truth.iter().enumerate() {
            self.readings += 1;
            let (value_lx, bound_lx) = room.reading_lx(k);
            if bound_lx > 0.0 {
                let errors_lx = [(value_lx - truth.lux).abs(), PROBABLE_ERROR * truth.std_error_lx];
                self.errors_over_bound.push(errors_lx.map(|error_lx| error_lx / bound_lx));
            }
            // Nothing is off where nothing is lit, though its bound is nothing, too.
            let may_be = (bound_lx + truth.allowed_lx).max(f64::MIN_POSITIVE);
            let error = (value_lx - truth.lux).abs() / may_be;
            let bin = BINS.iter().position(|b| error.min(f64::MAX) <= *b).unwrap_or(BINS.len() - 1);
            self.histogram.entry(room.meters[k].0).or_default()[bin] += 1;
        }
        let misses = seeming.iter().filter(|k| room.is_beyond(**k, &truth[**k]));
        let misses: Vec<Miss> = misses.map(|k| room.miss(*k, &truth[*k])).collect();
        let over_bound = |k: usize| median(self.errors_over_bound.iter().map(|e| e[k])).map(f64::recip);
        (self.bound_over_error, self.bound_over_certifiers_error) = (over_bound(0), over_bound(1));
        self.cleared += seeming.len() - misses.len();
        self.beyond.extend(misses);
        Ok(())
    }
}

/// What a solver says of itself, without its numbers.
fn words(solver: &str) -> String {
    let head = |part: &str| part.split([',', ':']).next().unwrap_or(part).trim().to_owned();
    let is_word = |word: &&str| !word.contains(|c: char| c.is_ascii_digit());
    let parts = solver.split("; ").map(|part| head(part).split(' ').filter(is_word).collect::<Vec<_>>().join(" "));
    parts.collect::<Vec<_>>().join("; ")
}

impl fmt::Display for Coverage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let head = ["meters", "readings", "within .03", ".1", ".3", "1", "beyond bound and the certifier's error"];
        let row = |(kind, bins): (&Kind, &[usize; BINS.len()])| {
            let name: &str = kind.into();
            let total: usize = bins.iter().sum();
            [name.to_owned(), total.to_string()].into_iter().chain(bins.iter().map(usize::to_string)).collect()
        };
        writeln!(f, "{}", tables::terminal(head.map(str::to_owned).into(), self.histogram.iter().map(row).collect()))?;
        for (solver, rooms) in &self.rooms_by_solver {
            writeln!(f, "{rooms} rooms: {solver}")?;
        }
        if let (Some(own), Some(certifiers)) = (self.bound_over_error, self.bound_over_certifiers_error) {
            writeln!(f, "bound over error: {own:.1} in the median, {certifiers:.1} if the certifier alone were off")?;
        }
        for miss in &self.beyond {
            writeln!(
                f,
                "BEYOND: room {}, {}, {:?} at {:?} facing {:?}: {} +- {} lx, certified {} +- {} lx",
                miss.seed,
                miss.light,
                miss.kind,
                miss.at_m,
                miss.normal,
                miss.value_lx,
                miss.bound_lx,
                miss.certified_lx,
                miss.certified_std_error_lx
            )?;
        }
        for refused in &self.refused {
            writeln!(f, "not solved: {refused}")?;
        }
        if self.cleared > 0 {
            let cleared = self.cleared;
            writeln!(
                f,
                "{cleared} readings seemed to be beyond their bound, but are not to {AGAIN} other seeds of the certifier"
            )?;
        }
        writeln!(f, "{} readings in {} rooms, {} beyond their bound", self.readings, self.rooms, self.beyond.len())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_hold_in_a_few_random_rooms_and_a_miss_would_be_told() {
        // The nightly has more of them.
        let mut found = coverage(1, 0.1, 20);
        let mut room = Room::of(7, 1, 0.1).unwrap();
        found.add(&room).unwrap();
        assert!(found.is_good() && found.readings == 2 * METERS, "{found}");
        let (own, certifiers) = (found.bound_over_error.unwrap(), found.bound_over_certifiers_error.unwrap());
        assert!(1.0 < own && own < certifiers && found.to_string().contains("bound over error: "), "{found}");
        // What is certified wrongly is cleared; a wrong reading is not.
        room.truth[5] = Certified::sampled(2.0 * room.truth[5].lux, 1e-9);
        let wrong = &mut room.found.estimates[3];
        wrong.illuminance = wrong.illuminance * 1.5;
        found.add(&room).unwrap();
        assert_eq!((found.beyond.len(), found.cleared), (1, 1), "{found}");
        assert_eq!(found.beyond[0].at_m, room.meters[3].1.position_m.to_array());
    }
}
