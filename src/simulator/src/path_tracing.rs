//! Unbiased path tracing with next-event estimation: the certifier of the deterministic solvers, and the solver for meshes.
//!
//! Eight independently scrambled Sobol sequences give eight independent means; their number of points doubles until the
//! t-interval of their mean is narrow enough (A. Owen, "On the Warnock-Halton quasi-standard error", 2006, says why
//! few replicates of many points serve best). Each sample depends on its index alone and sums run over fixed blocks in
//! fixed order, so that every bit of the result is the same on any number of threads.

mod emitter;
mod path;
mod world;

use rayon::prelude::*;

use self::emitter::Emitter;
use self::path::{ENDLESS, Integrand, Wanted};
use self::world::World;
use super::sampler::{Sampler, mix};
use super::stop::Stop;
use super::{Accuracy, Estimate, SimulatorError, Solution, Uncertainty};
use luxproof_photometry::units::Lux;
use luxproof_scene::geometry::{Room, Surface};
use luxproof_scene::{Bounces, Meter, Scene, Transport};

/// Independent scrambles.
const REPLICATES: u32 = 8;
/// The 97.5 % quantile of Student's t with `REPLICATES - 1` degrees of freedom.
const STUDENT_T: f64 = 2.364_624;
/// Points of each scramble at first, as a power of two; enough that a rare light path is met before a zero is believed.
const FIRST_LOG2: u32 = 9;
/// Points of each scramble at most, as a power of two: about 4 million paths a meter.
const LAST_LOG2: u32 = 19;
/// Points summed one after the other, as a power of two.
const BLOCK_LOG2: u32 = 8;
/// Points of each scramble, as a power of two, before zero is believed of a meter that no light has reached.
const DARK_LOG2: u32 = 13;
/// Rooms in which paths are longer than this on average, 1 / (1 - reflectance), are refused.
const MAX_MEAN_REFLECTIONS: f64 = 1e4;
/// A luminaire whose light peaks this much on what it lights is sampled from its own side too, which costs 4 times as much.
const PEAKED: f64 = 20.0;
/// Rays that find that out.
const PEAK_RAYS: u32 = 512;

/// Illuminance at every meter by path tracing, until `accuracy` is met with 95 % confidence or the samples run out.
///
/// Light straight from luminaires without extent is exact, by the inverse square law, and counts as such.
pub(crate) fn illuminance(
    scene: &Scene,
    meters: &[Meter],
    transport: Transport,
    accuracy: &Accuracy,
    stop: &Stop,
) -> Result<Solution, SimulatorError> {
    PathTracer::new(scene)?.solve(meters, transport, accuracy, FIRST_LOG2..=LAST_LOG2, stop)
}

/// A scene made ready for path tracing.
struct PathTracer<'a> {
    world: World,
    emitters: Vec<Emitter<'a>>,
    close: Vec<bool>,
    /// Mean over the room by area; 0 in free field.
    mean_reflectance: f64,
}

/// Sums of one meter over the points so far, one a scramble.
#[derive(Clone)]
struct Sums {
    lux: [f64; REPLICATES as usize],
    points_log2: u32,
    /// Standard error at half as many points, where there was such a stage.
    half_way: Option<f64>,
}

impl<'a> PathTracer<'a> {
    fn new(scene: &'a Scene) -> Result<Self, SimulatorError> {
        let reach_m = scene.luminaires.iter().map(|l| l.position_m.abs().max_element()).fold(0.0, f64::max);
        if !reach_m.is_finite() {
            return Err(unsupported("a luminaire whose position is not finite", "correct it"));
        }
        let world = World::new(scene.room, &scene.obstacles, reach_m)
            .map_err(|e| unsupported("a mesh of the scene", &e.to_string()))?;
        if let Some(reflectance) = world.reflectances().find(|r| !(0.0..=1.0).contains(r)) {
            return Err(unsupported(&format!("a reflectance of {reflectance}"), "it must lie within 0..=1"));
        }
        let emitters: Vec<_> = scene.luminaires.iter().filter_map(Emitter::new).collect();
        let close = emitters.iter().map(|e| peak(e, &world) > PEAKED).collect();
        let mean_reflectance = scene.room.map_or(0.0, |room| room_mean(&room));
        Ok(Self { world, emitters, close, mean_reflectance })
    }

    fn solve(
        &self,
        meters: &[Meter],
        transport: Transport,
        accuracy: &Accuracy,
        points_log2: std::ops::RangeInclusive<u32>,
        stop: &Stop,
    ) -> Result<Solution, SimulatorError> {
        let wanted = self.wanted(transport)?;
        let meters = (0..).zip(meters).map(|(k, m)| self.check(k, m)).collect::<Result<Vec<_>, _>>()?;
        let integrand = Integrand::new(&self.world, &self.emitters, self.close.clone(), wanted);
        if integrand.is_exact() {
            return Ok(self.exact(&integrand, &meters));
        }
        let mut sums = vec![Sums { lux: [0.0; REPLICATES as usize], points_log2: 0, half_way: None }; meters.len()];
        for log2 in points_log2.clone() {
            let open: Vec<usize> = (0..meters.len())
                .filter(|&m| log2 == *points_log2.start() || !sums[m].narrow_enough(accuracy.relative_error))
                .collect();
            let from = if log2 == *points_log2.start() { 0 } else { 1 << (log2 - 1) };
            let blocks = block_sums(&integrand, &meters, &open, accuracy.seed, from..1 << log2, stop);
            if stop.is_due() {
                break;
            }
            for (&m, blocks) in open.iter().zip(&blocks) {
                sums[m].half_way = (from > 0).then(|| sums[m].mean_and_error().1);
                sums[m].points_log2 = log2;
                for (sum, blocks) in sums[m].lux.iter_mut().zip(blocks) {
                    *sum += blocks.iter().sum::<f64>();
                }
                if sums[m].lux.iter().any(|lux| !lux.is_finite()) {
                    let what = format!("the light at meter {m}, where a path is endless or an illuminance infinite");
                    return Err(unsupported(&what, "lower the reflectances, or move the meter off the luminaire"));
                }
            }
        }
        if sums.iter().any(|s| s.points_log2 == 0) {
            return Err(SimulatorError::Stopped);
        }
        let most = sums.iter().map(|s| s.points_log2).max().unwrap_or(0);
        Ok(Solution {
            estimates: sums.iter().map(Sums::estimate).collect(),
            replicates: vec![],
            limit: None,
            solver: format!(
                "path tracing, {REPLICATES} Owen-scrambled Sobol sequences of up to 2^{most} paths a meter"
            ),
        })
    }

    /// Shadow rays to luminaires without extent: one a luminaire tells all.
    fn exact(&self, integrand: &Integrand, meters: &[Meter]) -> Solution {
        let estimate = |meter: &Meter| {
            let illuminance = Lux(integrand.direct(meter, [0.5; 2]));
            let rounding = self.emitters.iter().map(|e| e.rounding_lux(meter.position_m)).sum();
            Estimate { illuminance, uncertainty: Uncertainty::Bound(rounding) }
        };
        let solver = "inverse square with shadow rays: point luminaires, nothing reflected".into();
        Solution { estimates: meters.par_iter().map(estimate).collect(), replicates: vec![], solver, limit: None }
    }

    fn wanted(&self, transport: Transport) -> Result<Wanted, SimulatorError> {
        let (direct, bounces) = match transport {
            Transport::Direct => (true, Bounces::AtMost(0)),
            Transport::Indirect(bounces) => (false, bounces),
            Transport::Total(bounces) => (true, bounces),
        };
        let reflections = match bounces {
            Bounces::AtMost(n) => n,
            Bounces::Converged if 1.0 - self.mean_reflectance < 1.0 / MAX_MEAN_REFLECTIONS => {
                let what = format!("a mean reflectance of {} with all reflections", self.mean_reflectance);
                return Err(unsupported(&what, "cut the reflections, or use the radiosity solver"));
            }
            Bounces::Converged => ENDLESS,
        };
        Ok(Wanted { direct, reflections })
    }

    /// The meter, where light can fall upon it.
    fn check(&self, index: usize, meter: &Meter) -> Result<Meter, SimulatorError> {
        let Meter { position_m, normal } = *meter;
        let lift_m = self.world.lift_m();
        let point_m = position_m + normal * lift_m;
        let trouble = if !position_m.is_finite() || !normal.is_normalized() {
            Some("has no finite position or no unit normal")
        } else if !self.world.contains(position_m) {
            Some("lies outside the room")
        } else if self.world.clearance_m(point_m) < 0.5 * lift_m {
            Some("lies on a surface that its normal does not leave at a right angle")
        } else if self.emitters.iter().any(|e| e.position_m() == position_m) {
            Some("lies in the centre of a luminaire")
        } else {
            None
        };
        match trouble {
            None => Ok(*meter),
            Some(trouble) => {
                Err(unsupported(&format!("meter {index} at {position_m} m, which {trouble}"), "move or turn it"))
            }
        }
    }
}

/// Mean over a luminaire's light of the illuminance where it falls, in units of what its flux gives when spread evenly.
///
/// It is the variance, relative to the squared mean, of next-event estimation at a random place.
fn peak(emitter: &Emitter, world: &World) -> f64 {
    let ray = |index| {
        let mut sampler = Sampler::new(0, index);
        let ray = emitter.emit(sampler.next_pair(), sampler.next_pair());
        let hit = world.closest(ray.from_m + world.lift_m() * ray.direction, ray.direction)?;
        let lux = -ray.candela * hit.normal.dot(ray.direction) / (hit.distance_m * hit.distance_m);
        Some(lux * ray.candela / ray.density_per_sr)
    };
    let square: f64 = (0..PEAK_RAYS).filter_map(ray).sum::<f64>() / f64::from(PEAK_RAYS);
    square * world.area_m2() / emitter.flux_lm().powi(2)
}

/// Sums over blocks of points, by open meter and scramble.
fn block_sums(
    integrand: &Integrand,
    meters: &[Meter],
    open: &[usize],
    seed: u64,
    points: std::ops::Range<u32>,
    stop: &Stop,
) -> Vec<Vec<Vec<f64>>> {
    let block = 1 << BLOCK_LOG2;
    let starts: Vec<u32> = points.clone().step_by(block as usize).collect();
    let jobs: Vec<(usize, u32)> = open.iter().flat_map(|&m| (0..REPLICATES).map(move |r| (m, r))).collect();
    let sums: Vec<Vec<f64>> = jobs
        .par_iter()
        .map(|&(meter, replicate)| {
            let scramble = mix(mix(seed).wrapping_add(((meter as u64) << 8) | u64::from(replicate)));
            let meter = &meters[meter];
            let sum = |start: &u32| {
                // What is stopped halfway is thrown away.
                if stop.is_due() {
                    return 0.0;
                }
                let end = (start + block).min(points.end);
                (*start..end).map(|index| integrand.path(meter, &mut Sampler::new(scramble, index))).sum()
            };
            starts.par_iter().map(sum).collect()
        })
        .collect();
    sums.chunks(REPLICATES as usize).map(<[_]>::to_vec).collect()
}

impl Sums {
    /// Mean and standard error of the scrambles' means, in lux.
    fn mean_and_error(&self) -> (f64, f64) {
        let n = f64::from(REPLICATES);
        let points = f64::from(1_u32 << self.points_log2);
        let mean = self.lux.iter().sum::<f64>() / n / points;
        let square = self.lux.iter().map(|s| (s / points - mean).powi(2)).sum::<f64>();
        (mean, (square / (n * (n - 1.0))).sqrt())
    }

    /// Mean and the standard error that one may stop by: the quadratic mean of the last and of what the one before it
    /// promised. Stopping as soon as a noisy error is small prefers errors that are too small by chance.
    fn mean_and_prudent_error(&self) -> (f64, f64) {
        let (mean, error) = self.mean_and_error();
        let promised = self.half_way.map(|half| half * std::f64::consts::FRAC_1_SQRT_2);
        (mean, promised.map_or(error, |p| (0.5 * (error * error + p * p)).sqrt()))
    }

    fn narrow_enough(&self, relative_error: f64) -> bool {
        let (mean, error) = self.mean_and_prudent_error();
        STUDENT_T * error <= relative_error * mean && (mean > 0.0 || self.points_log2 >= DARK_LOG2)
    }

    fn estimate(&self) -> Estimate {
        let (mean, value) = self.mean_and_prudent_error();
        let uncertainty = Uncertainty::StandardError { value, degrees_of_freedom: REPLICATES - 1 };
        Estimate { illuminance: Lux(mean), uncertainty }
    }
}

fn room_mean(room: &Room) -> f64 {
    let [area, reflecting] = Surface::ALL.iter().fold([0.0, 0.0], |[area, reflecting], s| {
        [area + room.area_m2(*s), reflecting + room.area_m2(*s) * room.reflectance.of(*s)]
    });
    reflecting / area
}

fn unsupported(what: &str, instead: &str) -> SimulatorError {
    SimulatorError::Unsupported { what: what.into(), instead: instead.into() }
}

#[cfg(test)]
mod agreement_tests;
#[cfg(test)]
pub(super) mod test_scenes;
#[cfg(test)]
mod tests;
