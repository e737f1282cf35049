//! Do the simulator's bounds hold in rooms that nobody has seen? Random rooms and meters against path tracing, which shares no
//! ray caster and no light source with it.

mod room;

use std::collections::BTreeMap;
use std::fmt;

use luminaire::scene::{Bounces, Meter, Transport};
use luminaire::simulator::{Accuracy, Prepared, Solution, Stop, Uncertainty, certified_until};
use serde::Serialize;
use strum::IntoStaticStr;

use super::super::tables;
use crate::system::process::{interrupt_flag, is_interrupted};

/// Meters of a room.
const METERS: usize = 30;
/// How much finer the certifier works.
const FINER: f64 = 3.0;
/// Standard errors of the certifier, seven degrees of freedom, that it is off by once in a thousand times.
const CERTIFIED_WITHIN: f64 = 5.4;
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
    /// Readings beyond their bound by more than the certifier may be off.
    pub beyond: Vec<Miss>,
    /// How often an error lies within .03, .1, .3 and 1 of the bound and the certifier's error together, and beyond, by kind of meter.
    pub histogram: BTreeMap<Kind, [usize; BINS.len()]>,
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
        match solved(own, index, relative_error) {
            Ok((meters, transport, found, truth)) => coverage.add(own, &meters, transport, &found, &truth),
            Err(_) if is_interrupted() => break,
            Err(why) => coverage.refused.push(format!("room {own}: {why}")),
        }
    }
    coverage
}

type Solved = (Vec<(Kind, Meter)>, Transport, Solution, Solution);

fn solved(seed: u64, index: u64, relative_error: f64) -> Result<Solved, luminaire::simulator::SimulatorError> {
    let (scene, meters) = room::room(seed, METERS);
    let lights = [
        Transport::Total(Bounces::Converged),
        Transport::Indirect(Bounces::Converged),
        Transport::Indirect(Bounces::AtMost(2)),
        Transport::Direct,
    ];
    let transport = lights[index as usize % lights.len()];
    let places: Vec<Meter> = meters.iter().map(|(_, meter)| *meter).collect();
    let stop = Stop { flag: Some(interrupt_flag()), ..Stop::NEVER };
    let accuracy = Accuracy { relative_error, seed };
    let found = Prepared::new(&scene, transport, &accuracy)?.illuminance_until(&places, &stop)?;
    let fine = Accuracy { relative_error: relative_error / FINER, seed: seed.rotate_left(17) };
    let truth = certified_until(&scene, &places, transport, &fine, &stop)?;
    Ok((meters, transport, found, truth))
}

impl Coverage {
    fn add(&mut self, seed: u64, meters: &[(Kind, Meter)], light: Transport, found: &Solution, truth: &Solution) {
        self.rooms += 1;
        *self.rooms_by_solver.entry(words(&found.solver)).or_default() += 1;
        for (((kind, meter), own), truth) in meters.iter().zip(&found.estimates).zip(&truth.estimates) {
            self.readings += 1;
            let bound_lx = match own.uncertainty {
                Uncertainty::Bound(bound) => bound,
                Uncertainty::StandardError { value, .. } => CERTIFIED_WITHIN * value,
            };
            let (allowed, certified_std_error_lx) = match truth.uncertainty {
                Uncertainty::Bound(bound) => (bound, bound),
                Uncertainty::StandardError { value, .. } => (CERTIFIED_WITHIN * value, value),
            };
            let (value_lx, certified_lx) = (own.illuminance.value(), truth.illuminance.value());
            // What the certifier itself may be off says nothing of the bound.
            let beyond = ((value_lx - certified_lx).abs() - allowed).max(0.0);
            let ratio = if beyond == 0.0 { 0.0 } else { beyond / bound_lx };
            // Nothing is off where nothing is lit, though its bound is nothing, too.
            let error = (value_lx - certified_lx).abs() / (bound_lx + allowed).max(f64::MIN_POSITIVE);
            let bin = BINS.iter().position(|b| error.min(f64::MAX) <= *b).unwrap_or(BINS.len() - 1);
            self.histogram.entry(*kind).or_default()[bin] += 1;
            if ratio > 1.0 + 1e-9 || value_lx.is_nan() {
                let (at_m, normal) = (meter.position_m.to_array(), meter.normal.to_array());
                let light = format!("{light:?}");
                self.beyond.push(Miss {
                    seed,
                    light,
                    kind: *kind,
                    at_m,
                    normal,
                    value_lx,
                    bound_lx,
                    certified_lx,
                    certified_std_error_lx,
                });
            }
        }
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
        writeln!(f, "{} readings in {} rooms, {} beyond their bound", self.readings, self.rooms, self.beyond.len())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_hold_in_a_few_random_rooms_and_a_miss_would_be_told() {
        let mut found = coverage(4, 0.05, 20);
        assert!(found.is_good() && found.readings == 4 * METERS, "{found}");
        let (meters, light, mut wrong, truth) = solved(7, 1, 0.05).unwrap();
        wrong.estimates[3].illuminance = wrong.estimates[3].illuminance * 1.5;
        found.add(7, &meters, light, &wrong, &truth);
        assert_eq!(found.beyond.len(), 1, "{found}");
    }
}
