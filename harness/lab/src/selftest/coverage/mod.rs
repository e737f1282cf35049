//! Checks that the simulator's stated errors are honest in random rooms. The certifier is path
//! tracing, which shares no ray caster and no light source with the simulator's other solvers.
//!
//! A bound must hold for every reading. A standard uncertainty is judged by the readings of each
//! kind of meter together: by the root mean square of error over standard uncertainty, and by how
//! many errors are beyond the 99.7 % point of Student's t.

mod room;

use std::collections::BTreeMap;
use std::fmt;

use luxproof_scene::{Bounces, Meter, Scene, Transport};
use luxproof_simulator::{Accuracy, Estimate, Prepared, SimulatorError, Solution, Stop, Uncertainty, certified_until};
use serde::Serialize;
use statrs::distribution::{ContinuousCDF, DiscreteCDF, Poisson, StudentsT};
use strum::IntoStaticStr;

use super::super::tables;
use luxproof_process::process::{interrupt_flag, is_interrupted};

/// The number of meters in a room.
const METERS: usize = 30;
/// The relative error asked of the simulator over that asked of the certifier. The certifier's
/// standard error is then about a third of the simulator's, since it is asked for an interval of
/// 95 %.
const CERTIFIER_FINENESS: f64 = 1.5;
/// Student's t with seven degrees of freedom that is exceeded by chance once in a thousand times.
const MAX_CERTIFIER_STD_ERRORS: f64 = 5.4;
/// The degrees of freedom of the certifier's standard error.
const CERTIFIER_FREEDOM: f64 = 7.0;
/// How often an apparent miss is certified again. The tail of path tracing is heavier than the
/// blocks of one seed show, so that some of thousands of readings are certified wrongly.
const RECERTIFICATIONS: u64 = 3;
/// The probability of Student's t beyond which an error counts as far.
const FAR_P: f64 = 0.003;
/// The probability of Student's t beyond which one error alone is a fault.
const IMPOSSIBLE_P: f64 = 1e-5;
/// The largest part of errors that may be far: stated errors are skewed where light comes along
/// rare paths.
const MAX_FAR_PART: f64 = 0.005;
/// The probability by which chance alone may bring more far errors than a few readings may have.
const CHANCE_P: f64 = 1e-3;
/// The limits of the root mean square of error over standard uncertainty.
const RMS_LIMITS: [f64; 2] = [0.85, 1.2];
/// The readings from which on a root mean square is judged. Fewer scatter too much: readings of a
/// room share their noise.
const MIN_READINGS_FOR_RMS: usize = 400;

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

/// The result of the check.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Coverage {
    pub rooms: usize,
    pub readings: usize,
    /// The readings beyond their bound by more than the certifier's error, and those so many
    /// standard uncertainties off that no chance explains it, also with other seeds.
    pub beyond: Vec<Miss>,
    /// The number of readings that seemed to be far off until they were certified with other seeds.
    pub cleared: usize,
    pub kinds: BTreeMap<Kind, KindErrors>,
    /// The number of rooms that each solver answered; the last named solver may have answered some
    /// meters only.
    pub rooms_by_solver: BTreeMap<String, usize>,
    /// The rooms that could not be solved, with the reason.
    pub refused: Vec<String>,
}

/// The errors of the readings of one kind of meter.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct KindErrors {
    /// The number of readings with a bound.
    pub bounded: usize,
    /// The number of readings with a standard uncertainty.
    pub sampled: usize,
    /// The number of these that are beyond the 99.7 % point of Student's t with the stated degrees
    /// of freedom.
    pub far: usize,
    /// The root mean square of error over standard uncertainty, the certifier's included.
    pub root_mean_square: Option<f64>,
}

impl KindErrors {
    /// Adds a sampled reading's error over its standard uncertainty.
    fn add_sampled(&mut self, deviation: &Deviation) {
        let squares = self.root_mean_square.map_or(0.0, |rms| rms * rms * self.sampled as f64);
        self.sampled += 1;
        self.root_mean_square = Some(((squares + deviation.std_errors.powi(2)) / self.sampled as f64).sqrt());
        self.far += usize::from(deviation.p < FAR_P);
    }

    /// The number of far errors that honest statements may have.
    fn max_far(&self) -> usize {
        let expected = FAR_P * self.sampled as f64;
        let by_chance = Poisson::new(expected).map_or(0, |poisson| poisson.inverse_cdf(1.0 - CHANCE_P));
        by_chance.max((MAX_FAR_PART * self.sampled as f64) as u64) as usize
    }

    /// Whether the stated errors are neither too small nor too large.
    fn is_honest(&self) -> bool {
        let [low, high] = RMS_LIMITS;
        let is_rms_good = self.root_mean_square.is_none_or(|rms| (low..=high).contains(&rms));
        self.far <= self.max_far() && (is_rms_good || self.sampled < MIN_READINGS_FOR_RMS)
    }

    /// The errors of two kinds together.
    fn joined(self, other: Self) -> Self {
        let squares = |e: Self| e.root_mean_square.map_or(0.0, |rms| rms * rms * e.sampled as f64);
        let sampled = self.sampled + other.sampled;
        let mean_square = (squares(self) + squares(other)) / sampled as f64;
        Self {
            bounded: self.bounded + other.bounded,
            sampled,
            far: self.far + other.far,
            root_mean_square: (sampled > 0).then_some(mean_square.sqrt()),
        }
    }

    /// The row of the table.
    fn row(&self, name: &str) -> Vec<String> {
        let far_percent = 100.0 * self.far as f64 / self.sampled.max(1) as f64;
        vec![
            name.to_owned(),
            self.bounded.to_string(),
            self.sampled.to_string(),
            self.root_mean_square.map_or_else(String::new, |rms| format!("{rms:.2}")),
            format!("{} ({far_percent:.2} %)", self.far),
        ]
    }
}

/// How far a sampled reading is off.
#[derive(Clone, Copy, Debug)]
struct Deviation {
    /// The error over the standard uncertainty, the certifier's included.
    std_errors: f64,
    /// The probability that chance brings at least as much.
    p: f64,
}

/// A reading that is further off than its stated error explains.
#[derive(Clone, Debug, Serialize)]
pub struct Miss {
    pub seed: u64,
    pub light: String,
    pub kind: Kind,
    pub at_m: [f64; 3],
    pub normal: [f64; 3],
    pub value_lx: f64,
    pub stated_error_lx: f64,
    pub certified_lx: f64,
    pub certified_std_error_lx: f64,
}

impl Coverage {
    /// Whether every bound holds, every kind of meter has honest standard uncertainties, and every
    /// room was solved.
    pub fn is_good(&self) -> bool {
        self.beyond.is_empty() && self.refused.is_empty() && self.kinds.values().all(KindErrors::is_honest)
    }
}

/// Checks a number of random rooms at a relative error.
pub fn coverage(rooms: usize, relative_error: f64, seed: u64) -> Coverage {
    let mut coverage = Coverage::default();
    for index in 0..rooms as u64 {
        let room_seed = fastrand::Rng::with_seed(seed ^ (index << 32)).u64(..);
        match SolvedRoom::solve(room_seed, index, relative_error).and_then(|room| coverage.add_room(&room)) {
            Ok(()) => {}
            Err(_) if is_interrupted() => break,
            Err(why) => coverage.refused.push(format!("room {room_seed}: {why}")),
        }
    }
    coverage
}

/// A room with the simulator's readings and the certified ones.
struct SolvedRoom {
    seed: u64,
    scene: Scene,
    meters: Vec<(Kind, Meter)>,
    transport: Transport,
    relative_error: f64,
    found: Solution,
    truth: Vec<CertifiedReading>,
}

/// A reading by path tracing.
#[derive(Clone, Copy)]
struct CertifiedReading {
    lux: f64,
    std_error_lx: f64,
    degrees_of_freedom: f64,
    /// The largest error that is explained by chance.
    allowed_lx: f64,
}

impl CertifiedReading {
    fn from_estimate(estimate: &Estimate) -> Self {
        let lux = estimate.illuminance.value();
        match estimate.uncertainty {
            Uncertainty::Bound(bound) => {
                Self { lux, std_error_lx: bound, degrees_of_freedom: f64::INFINITY, allowed_lx: bound }
            }
            Uncertainty::StandardError { value, degrees_of_freedom } => {
                Self::sampled(lux, value, f64::from(degrees_of_freedom))
            }
        }
    }

    /// A reading with a standard error.
    fn sampled(lux: f64, std_error_lx: f64, degrees_of_freedom: f64) -> Self {
        Self { lux, std_error_lx, degrees_of_freedom, allowed_lx: MAX_CERTIFIER_STD_ERRORS * std_error_lx }
    }

    /// The mean over several seeds; its uncertainty is the stated one or their scatter, whichever
    /// is larger.
    fn mean_of(seeds: &[Self]) -> Self {
        let count = seeds.len() as f64;
        let mean = seeds.iter().map(|c| c.lux).sum::<f64>() / count;
        let stated: f64 = seeds.iter().map(|c| c.std_error_lx.powi(2)).sum::<f64>().sqrt() / count;
        let scatter = seeds.iter().map(|c| (c.lux - mean).powi(2)).sum::<f64>() / (count - 1.0);
        Self::sampled(mean, stated.max((scatter / count).sqrt()), CERTIFIER_FREEDOM * count)
    }
}

impl SolvedRoom {
    /// Draws a room and reads all of its meters twice: by the simulator and by the certifier.
    fn solve(seed: u64, index: u64, relative_error: f64) -> Result<Self, SimulatorError> {
        let (scene, meters) = room::draw_scene(seed, METERS);
        let lights = [
            Transport::Total(Bounces::Converged),
            Transport::Indirect(Bounces::Converged),
            Transport::Indirect(Bounces::AtMost(2)),
            Transport::Direct,
        ];
        let transport = lights[index as usize % lights.len()];
        let positions: Vec<Meter> = meters.iter().map(|(_, meter)| *meter).collect();
        let accuracy = Accuracy { relative_error, seed };
        let found = Prepared::new(&scene, transport, &accuracy)?.illuminance_until(&positions, &stop_on_interrupt())?;
        let mut room = Self { seed, scene, meters, transport, relative_error, found, truth: vec![] };
        room.truth = room.certify(&positions, seed.rotate_left(17))?;
        Ok(room)
    }

    /// Reads meters by path tracing.
    fn certify(&self, meters: &[Meter], seed: u64) -> Result<Vec<CertifiedReading>, SimulatorError> {
        let fine = Accuracy { relative_error: self.relative_error / CERTIFIER_FINENESS, seed };
        let found = certified_until(&self.scene, meters, self.transport, &fine, &stop_on_interrupt())?;
        Ok(found.estimates.iter().map(CertifiedReading::from_estimate).collect())
    }

    /// Reads meters again with seeds that were not used yet.
    fn certify_again(&self, meters: &[usize]) -> Result<Vec<CertifiedReading>, SimulatorError> {
        let positions: Vec<Meter> = meters.iter().map(|k| self.meters[*k].1).collect();
        let mut random = fastrand::Rng::with_seed(self.seed.rotate_left(31));
        let mut by_meter = vec![vec![]; meters.len()];
        for _ in 0..RECERTIFICATIONS {
            for (readings, reading) in by_meter.iter_mut().zip(self.certify(&positions, random.u64(..))?) {
                readings.push(reading);
            }
        }
        Ok(by_meter.iter().map(|readings| CertifiedReading::mean_of(readings)).collect())
    }

    /// How far a sampled reading is off; `None` for a reading with a bound.
    fn deviation(&self, meter: usize, truth: &CertifiedReading) -> Option<Deviation> {
        let reading = &self.found.estimates[meter];
        let Uncertainty::StandardError { value: own_lx, degrees_of_freedom } = reading.uncertainty else { return None };
        let combined_lx = own_lx.hypot(truth.std_error_lx);
        let std_errors = (reading.illuminance.value() - truth.lux).abs() / combined_lx;
        // The formula of Welch and Satterthwaite (JCGM 100:2008, G.4.1).
        let [own, certifiers] = [own_lx, truth.std_error_lx].map(|lx| (lx / combined_lx).powi(4));
        let freedom = 1.0 / (own / f64::from(degrees_of_freedom) + certifiers / truth.degrees_of_freedom);
        let p = StudentsT::new(0.0, 1.0, freedom).map_or(0.0, |t| 2.0 * t.sf(std_errors));
        Some(Deviation { std_errors, p })
    }

    /// Whether a reading is further off than its stated error and the certifier's explain: beyond
    /// its bound, or beyond a quantile of Student's t.
    fn is_beyond(&self, meter: usize, truth: &CertifiedReading, quantile_p: f64) -> bool {
        let reading = &self.found.estimates[meter];
        let error_lx = (reading.illuminance.value() - truth.lux).abs();
        match (reading.uncertainty, self.deviation(meter, truth)) {
            (_, Some(deviation)) => deviation.p < quantile_p || error_lx.is_nan(),
            // The slack covers the rounding of the bound itself.
            (Uncertainty::Bound(bound), None) => {
                error_lx - truth.allowed_lx > bound * (1.0 + 1e-9) || error_lx.is_nan()
            }
            (Uncertainty::StandardError { .. }, None) => true,
        }
    }

    /// The record of a reading that is too far off.
    fn make_miss(&self, meter: usize, truth: &CertifiedReading) -> Miss {
        let ((kind, place), reading) = (&self.meters[meter], &self.found.estimates[meter]);
        Miss {
            seed: self.seed,
            light: format!("{:?}", self.transport),
            kind: *kind,
            at_m: place.position_m.to_array(),
            normal: place.normal.to_array(),
            value_lx: reading.illuminance.value(),
            stated_error_lx: match reading.uncertainty {
                Uncertainty::Bound(value) | Uncertainty::StandardError { value, .. } => value,
            },
            certified_lx: truth.lux,
            certified_std_error_lx: truth.std_error_lx,
        }
    }
}

/// Stops where the user interrupts.
fn stop_on_interrupt() -> Stop {
    Stop { flag: Some(interrupt_flag()), ..Stop::NEVER }
}

impl Coverage {
    /// Counts the readings of a room. Those that are far off are certified again with other seeds
    /// first.
    fn add_room(&mut self, room: &SolvedRoom) -> Result<(), SimulatorError> {
        let mut truth = room.truth.clone();
        let apparent: Vec<usize> = (0..truth.len()).filter(|k| room.is_beyond(*k, &truth[*k], FAR_P)).collect();
        if !apparent.is_empty() {
            for (k, again) in apparent.iter().zip(room.certify_again(&apparent)?) {
                truth[*k] = again;
            }
        }
        self.rooms += 1;
        *self.rooms_by_solver.entry(without_numbers(&room.found.solver)).or_default() += 1;
        for (k, truth) in truth.iter().enumerate() {
            self.readings += 1;
            let errors = self.kinds.entry(room.meters[k].0).or_default();
            match room.deviation(k, truth) {
                Some(deviation) => errors.add_sampled(&deviation),
                None => errors.bounded += 1,
            }
        }
        let is_still_far = |k: &&usize| room.is_beyond(**k, &truth[**k], FAR_P);
        self.cleared += apparent.len() - apparent.iter().filter(is_still_far).count();
        let misses = apparent.iter().filter(|k| room.is_beyond(**k, &truth[**k], IMPOSSIBLE_P));
        self.beyond.extend(misses.map(|k| room.make_miss(*k, &truth[*k])));
        Ok(())
    }
}

/// The description of a solver without its numbers, so that rooms can be counted by it.
fn without_numbers(solver: &str) -> String {
    let parts = solver.split("; ").map(|part| {
        let head = part.split([',', ':']).next().unwrap_or(part).trim();
        head.split(' ').filter(|word| !word.contains(|c: char| c.is_ascii_digit())).collect::<Vec<_>>().join(" ")
    });
    parts.collect::<Vec<_>>().join("; ")
}

impl fmt::Display for Coverage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let head = ["meters", "with bounds", "sampled", "rms of error over uncertainty", "beyond 99.7 % of t"];
        let mut rows: Vec<Vec<String>> = self.kinds.iter().map(|(kind, errors)| errors.row(kind.into())).collect();
        let all = self.kinds.values().copied().fold(KindErrors::default(), KindErrors::joined);
        rows.push(all.row("all"));
        writeln!(f, "{}", tables::format_terminal(head.map(str::to_owned).into(), rows))?;
        for (kind, errors) in self.kinds.iter().filter(|(_, errors)| !errors.is_honest()) {
            let (name, [low, high]): (&str, _) = (kind.into(), RMS_LIMITS);
            let most = errors.max_far();
            writeln!(f, "NOT HONEST: {name}; the rms must be {low} to {high}, at most {most} beyond 99.7 % of t")?;
        }
        for (solver, rooms) in &self.rooms_by_solver {
            writeln!(f, "{rooms} rooms: {solver}")?;
        }
        for miss in &self.beyond {
            writeln!(
                f,
                "BEYOND: room {}, {}, {:?} at {:?} facing {:?}: {} ± {} lx, certified {} ± {} lx",
                miss.seed,
                miss.light,
                miss.kind,
                miss.at_m,
                miss.normal,
                miss.value_lx,
                miss.stated_error_lx,
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
                "{cleared} readings seemed to be far off, but are not to {RECERTIFICATIONS} other seeds of the certifier"
            )?;
        }
        writeln!(
            f,
            "{} readings in {} rooms, {} beyond what their stated error explains",
            self.readings,
            self.rooms,
            self.beyond.len()
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stated_errors_are_honest_in_random_rooms() {
        let night = std::env::var("LUXPROOF_NIGHTLY").ok();
        let seed = night.as_ref().and_then(|night| night.parse().ok()).unwrap_or(20);
        let (rooms, relative_error) = if night.is_some() { (200, 0.03) } else { (4, 0.1) };
        let found = coverage(rooms, relative_error, seed);
        assert!(found.is_good() && found.readings == rooms * METERS, "{found}");
        let sampled: usize = found.kinds.values().map(|errors| errors.sampled).sum();
        assert!(2 * sampled > found.readings, "{found}");
    }

    #[test]
    fn no_luminaire_crosses_the_ceiling() {
        for seed in 0..500 {
            let (scene, _) = room::draw_scene(seed, 1);
            let ceiling_m = scene.room.map_or(0.0, |room| room.size_m.z);
            for luminaire in &scene.luminaires {
                let top_m = luminaire.position_m.z + luminaire.photometry.opening.reach_m(glam::DVec3::Z);
                assert!(top_m <= ceiling_m, "{seed}: {top_m} m under {ceiling_m} m");
            }
        }
    }

    #[test]
    fn a_wrong_reading_is_reported_and_one_that_is_certified_wrongly_is_cleared() {
        let mut room = SolvedRoom::solve(7, 1, 0.1).unwrap();
        room.truth[5] = CertifiedReading::sampled(2.0 * room.truth[5].lux, 1e-9, CERTIFIER_FREEDOM);
        let wrong = &mut room.found.estimates[3];
        wrong.illuminance = wrong.illuminance * 3.0;
        let mut found = Coverage::default();
        found.add_room(&room).unwrap();
        assert_eq!((found.beyond.len(), found.cleared), (1, 1), "{found}");
        assert_eq!(found.beyond[0].at_m, room.meters[3].1.position_m.to_array());
        assert!(!found.is_good() && found.to_string().contains("BEYOND: room 7"), "{found}");
    }

    #[test]
    fn stated_errors_that_are_too_small_or_too_large_are_not_honest() {
        // Standard normal deviations at evenly spread probabilities.
        let normal = StudentsT::new(0.0, 1.0, 1e6).unwrap();
        let all: Vec<f64> = (0..1000).map(|k| normal.inverse_cdf((f64::from(k) + 0.5) / 1000.0)).collect();
        for (scale, is_honest) in [(1.0, true), (1.15, true), (0.9, true), (1.3, false), (0.8, false)] {
            let mut errors = KindErrors::default();
            for deviation in &all {
                let std_errors = (scale * deviation).abs();
                errors.add_sampled(&Deviation { std_errors, p: 2.0 * normal.sf(std_errors) });
            }
            assert_eq!(errors.is_honest(), is_honest, "{scale}: {errors:?}");
        }
    }
}
