//! Rooms with bodies or with luminaires of any extent: light sampled with honest standard errors.
//!
//! Two estimators of reflected light, both without bias:
//! - **Paths**: from each meter along random paths, with light straight from the luminaires at each reflection.
//! - **Shared points**: surface points that all meters share. Each carries the light of one path. A meter connects to them, and
//!   casts some rays for what is near. Each sample is weighed by the density of both (balance heuristic).
//!
//! A pilot estimates what either costs and takes the cheaper. Everything is sampled in [`REPLICATES`] independently scrambled
//! Sobol sequences. A value is their mean, its standard uncertainty their scatter over the root of their number (A. Owen, "On
//! the Warnock-Halton quasi-standard error", 2006, says why few replicates of many points serve best).

mod brightness;
mod direct;
mod lamps;
mod replicates;
mod surroundings;
#[cfg(test)]
mod tests;
mod transport;

use glam::DVec3;
use rayon::prelude::*;

use self::brightness::BrightnessMap;
use self::lamps::Lamps;
pub use self::replicates::REPLICATES;
use self::replicates::Replicates;
pub(super) use self::replicates::{Reading, mean_and_error};
use self::surroundings::Surroundings;
use self::transport::{Transporter, cosine_direction, kernel_per_m2};
use super::emission::Emitter;
use super::sampler::{Sampler, mix};
use super::stop::Stop;
use super::{Accuracy, Bounded, Limit, SimulatorError};
use luxproof_scene::{Bounces, Meter, Scene};

/// Points for each ray of a meter in the balance heuristic, of which the pilot takes the cheapest.
const POINTS_PER_RAY: [u32; 3] = [8, 32, 128];
/// Rays and points of each replicate at first and at most, as powers of two.
const RAYS_LOG2: std::ops::RangeInclusive<u32> = 5..=17;
const PATHS_LOG2: std::ops::RangeInclusive<u32> = 5..=19;
const POINTS_LOG2: std::ops::RangeInclusive<u32> = 7..=18;
/// The pilot: meters, and paths, rays and points of each replicate.
const PILOT_METERS: usize = 8;
const PILOT_PATHS_LOG2: u32 = 6;
const PILOT_RAYS_LOG2: u32 = 5;
const PILOT_POINTS_LOG2: u32 = 8;
/// The power of the number of samples with which a variance falls: between 1, at random, and 2 to 3, of smooth integrands.
const VARIANCE_RATE: f64 = 1.3;
/// What connecting a point to a meter costs in rays: the kernel alone, and with a shadow ray.
const PAIR_RAYS: f64 = 0.06;
const PAIR_SHADOW_RAYS: f64 = 0.35;
/// Values below this part of the mean of all meters need not be known better than that part.
const DIM_PART: f64 = 0.02;
/// Light so much more uneven than evenly spread makes paths ask bright places.
const PEAKED: f64 = 4.0;
/// Where no more than this part of meters needs more points, those go over to paths.
const FEW_PART: f64 = 0.1;
/// Points of each replicate, as a power of two, before meters go over to paths.
const ENOUGH_POINTS_LOG2: u32 = 10;
/// Paths of each replicate, as a power of two, before a meter is believed to be dark.
const DARK_LOG2: u32 = 12;
/// Samples after which one looks whether it is time to stop.
const SAMPLES_PER_LOOK: u32 = 64;
/// The part of the allowed variance that rays, or points, may have before they are doubled.
const HALF: f64 = 0.5;

/// Reflections of a path in a room where all count: roulette ends it long before.
const ENDLESS: u32 = 1_000_000;

/// A scene made ready for sampling.
#[derive(Debug)]
pub(super) struct SampledRoom {
    surroundings: Surroundings,
    lamps: Lamps,
    /// All luminaires that shine, for light straight from them.
    emitters: Vec<Emitter>,
    /// All flux over the area of all surfaces: the illuminance of a surface if light were spread evenly.
    mean_lux: f64,
}

/// How reflected light is sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Method {
    Paths,
    SharedPoints { points_per_ray: u32 },
}

impl Method {
    /// Points for each ray in the balance heuristic; 0 where there are none.
    fn points_per_ray(self) -> u32 {
        match self {
            Self::Paths => 0,
            Self::SharedPoints { points_per_ray } => points_per_ray,
        }
    }
}

/// Sums of one meter so far.
#[derive(Clone, Debug)]
struct Sums {
    method: Method,
    rays: Replicates,
    points: Replicates,
    /// Numbers of each replicate, as powers of two; nothing yet where `None`.
    rays_log2: Option<u32>,
    points_log2: Option<u32>,
    /// Variances of the mean of rays and of points before the last doubling of each.
    variances_before: [f64; 2],
    is_done: bool,
    /// Light that surfaces reflect in the mean over the room.
    reflected_lux: f64,
}

/// What one stage samples anew.
struct Stage {
    /// Meters whose rays or paths are doubled, with the range of their indices.
    rays: Vec<(usize, std::ops::Range<u32>)>,
    /// Meters that connect to new points.
    points: Vec<usize>,
    point_range: std::ops::Range<u32>,
}

/// Everything that stages need.
struct Sampling<'a> {
    transporter: Transporter<'a>,
    map: Option<&'a BrightnessMap>,
    meters: &'a [Meter],
    starts_m: Vec<DVec3>,
    /// Light that surfaces reflect in the mean over the room.
    reflected_lux: f64,
    seed: u64,
    stop: &'a Stop,
}

impl SampledRoom {
    pub(super) fn new(scene: &Scene) -> Result<Self, SimulatorError> {
        let reach_m = scene.luminaires.iter().map(|l| l.position_m.abs().max_element()).fold(0.0, f64::max);
        let surroundings = Surroundings::new(scene.room, &scene.obstacles, reach_m)
            .map_err(|e| SimulatorError::Unsupported { what: "a mesh of the scene".into(), instead: e.to_string() })?;
        let emitters = scene.luminaires.iter().map(Emitter::new).filter(Emitter::shines).collect();
        let flux_lm: f64 =
            scene.luminaires.iter().map(|l| l.photometry.distribution.flux().value() * l.flux_scale).sum();
        let area_m2: f64 = surroundings.surfaces.iter().map(|s| s.area_m2).sum();
        let mean_lux = if area_m2 > 0.0 { flux_lm / area_m2 } else { 0.0 };
        let lamps = Lamps::new(&scene.luminaires, surroundings.bounds_m());
        Ok(Self { surroundings, lamps, emitters, mean_lux })
    }

    fn lifted_m(&self, meter: &Meter) -> DVec3 {
        meter.position_m + meter.normal * self.surroundings.lift_m()
    }

    /// Reflected light at the meters, and how it was found, to a standard error relative to it and the `direct` light together.
    pub(super) fn indirect(
        &self,
        meters: &[Meter],
        bounces: Bounces,
        direct: &[f64],
        accuracy: &Accuracy,
        stop: &Stop,
    ) -> Result<(Vec<Reading>, String, Option<Limit>), SimulatorError> {
        let reflections = match bounces {
            Bounces::AtMost(count) => count.min(ENDLESS),
            Bounces::Converged => ENDLESS,
        };
        if reflections == 0 || self.lamps.is_empty() {
            let readings = vec![Bounded::NONE.into(); meters.len()];
            return Ok((readings, "nothing is reflected".into(), None));
        }
        let plain = Transporter { surroundings: &self.surroundings, lamps: &self.lamps, reflections, bright: None };
        let seed = mix(accuracy.seed ^ 0x5eed);
        let map = BrightnessMap::new(&plain, mix(seed ^ 1));
        let bright = map.as_ref().filter(|map| map.peak > PEAKED);
        let for_meters = map.as_ref().and_then(|map| map.for_meters(&self.surroundings, meters));
        let sampling = Sampling {
            transporter: Transporter { bright, ..plain },
            map: for_meters.as_ref(),
            meters,
            starts_m: meters.iter().map(|m| self.lifted_m(m)).collect(),
            reflected_lux: self.surroundings.mean_reflectance() * self.mean_lux,
            seed,
            stop,
        };
        let (method, reason) = sampling.choose_method(direct, accuracy.relative_error);
        let (sums, work, limit) = sampling.run(method, direct, accuracy.relative_error)?;
        let readings = sums.iter().map(|s| s.reading(self.mean_lux)).collect();
        let points = sums.iter().filter_map(|s| s.points_log2).max();
        let points = points.map_or(String::new(), |p| format!(" and 2^{p} shared surface points"));
        let rays = sums.iter().filter_map(|s| s.rays_log2).max().unwrap_or(0);
        let bright = if bright.is_some() { ", paths ask bright places" } else { "" };
        let text = format!(
            "sampled: {REPLICATES} Owen-scrambled Sobol sequences of up to 2^{rays} paths a meter{points}{bright} \
             ({reason}; {work:.1e} rays)"
        );
        Ok((readings, text, limit))
    }
}

impl Sampling<'_> {
    /// The cheaper method by a pilot, and why.
    fn choose_method(&self, direct: &[f64], relative_error: f64) -> (Method, String) {
        if self.map.is_none() {
            return (Method::Paths, "paths: no light was found on surfaces".into());
        }
        let count = self.meters.len().min(PILOT_METERS);
        let some: Vec<usize> = (0..count).map(|k| (2 * k + 1) * self.meters.len() / (2 * count)).collect();
        let Some((paths, work)) = self.sample_pilot(&some, Method::Paths, PILOT_PATHS_LOG2, None) else {
            return (Method::Paths, "paths: no time for a pilot".into());
        };
        let values: Vec<f64> = paths.iter().zip(&some).map(|(s, k)| s.value() + direct[*k]).collect();
        let floor = DIM_PART * values.iter().sum::<f64>() / values.len() as f64;
        let allowed: Vec<f64> = values.iter().map(|value| (relative_error * value.max(floor)).powi(2)).collect();
        let meters_per_pilot = self.meters.len() as f64 / count as f64;
        let path_work = meters_per_pilot * work.rays as f64 / count as f64;
        let first = times_as_many(*PATHS_LOG2.start(), PILOT_PATHS_LOG2);
        let variances = paths.iter().map(|sums| sums.variances().0);
        let of_paths: f64 =
            variances.zip(&allowed).map(|(v, most)| path_work * needed_times(v, *most).max(first)).sum();
        let (mut method, mut least, mut of_shared) = (Method::Paths, of_paths, f64::INFINITY);
        for points_per_ray in POINTS_PER_RAY {
            let shared = Method::SharedPoints { points_per_ray };
            let Some((sums, work)) = self.sample_pilot(&some, shared, PILOT_RAYS_LOG2, Some(PILOT_POINTS_LOG2)) else {
                break;
            };
            let cost = self.shared_points_cost(&sums, &work, &allowed);
            of_shared = of_shared.min(cost);
            if cost < least {
                (method, least) = (shared, cost);
            }
        }
        (method, format!("by a pilot {of_paths:.0e} rays by paths, {of_shared:.0e} with shared points"))
    }

    /// A few samples of some meters, and the work for them; `None` where it was stopped.
    fn sample_pilot(
        &self,
        some: &[usize],
        method: Method,
        rays_log2: u32,
        points_log2: Option<u32>,
    ) -> Option<(Vec<Sums>, Work)> {
        let stage = Stage {
            rays: some.iter().map(|k| (*k, 0..1 << rays_log2)).collect(),
            points: if points_log2.is_some() { some.to_vec() } else { vec![] },
            point_range: 0..1 << points_log2.unwrap_or(0),
        };
        let mut sums = vec![Sums::new(method, self.reflected_lux); self.meters.len()];
        let pilot = Sampling { seed: mix(self.seed ^ 0x9170 ^ u64::from(rays_log2)), ..self.borrowed() };
        let work = pilot.add_stage(&stage, &mut sums)?;
        Some((some.iter().map(|k| sums[*k].clone()).collect(), work))
    }

    /// The rays that shared points cost for all meters, by a pilot of some that are allowed these variances.
    fn shared_points_cost(&self, pilot: &[Sums], work: &Work, allowed: &[f64]) -> f64 {
        let count = pilot.len() as f64;
        let pair = if self.transporter.surroundings.has_shadows() { PAIR_SHADOW_RAYS } else { PAIR_RAYS };
        let points = REPLICATES as f64 * 2_f64.powi(PILOT_POINTS_LOG2 as i32);
        let ray_work = self.meters.len() as f64 / count * work.rays as f64 / count;
        let point_work = work.point_rays as f64 + points * pair * self.meters.len() as f64;
        let mut ray_times = 0.0;
        let mut point_times = times_as_many(*POINTS_LOG2.start(), PILOT_POINTS_LOG2);
        for (sums, most) in pilot.iter().zip(allowed) {
            let (rays, points) = sums.variances();
            ray_times += needed_times(rays, HALF * most).max(times_as_many(*RAYS_LOG2.start(), PILOT_RAYS_LOG2));
            point_times = point_times.max(needed_times(points, HALF * most));
        }
        ray_work * ray_times + point_work * point_times
    }

    fn borrowed(&self) -> Sampling<'_> {
        let Transporter { surroundings, lamps, reflections, bright } = self.transporter;
        Sampling {
            transporter: Transporter { surroundings, lamps, reflections, bright },
            map: self.map,
            meters: self.meters,
            starts_m: self.starts_m.clone(),
            reflected_lux: self.reflected_lux,
            seed: self.seed,
            stop: self.stop,
        }
    }

    /// Doubles samples until every meter has the error asked for, the rays granted are used up, or it is stopped.
    fn run(
        &self,
        method: Method,
        direct: &[f64],
        relative_error: f64,
    ) -> Result<(Vec<Sums>, f64, Option<Limit>), SimulatorError> {
        let mut sums = vec![Sums::new(method, self.reflected_lux); self.meters.len()];
        let granted = self.stop.rays.unwrap_or(u64::MAX);
        let mut work = Work::default();
        let mut limit = None;
        loop {
            let stage = plan_stage(&mut sums, direct, relative_error);
            if stage.rays.is_empty() && stage.points.is_empty() {
                break;
            }
            let is_first = work.rays == 0;
            if !is_first && work.total() + Self::expected_work(&stage, &work) > granted as f64 {
                limit = Some(Limit::Rays);
                break;
            }
            for (k, _) in &stage.rays {
                sums[*k].variances_before[0] = sums[*k].variances().0;
            }
            for k in &stage.points {
                sums[*k].variances_before[1] = sums[*k].variances().1;
            }
            let Some(more) = self.add_stage(&stage, &mut sums) else {
                limit = Some(Limit::Time);
                break;
            };
            work.add(&more);
        }
        if sums.iter().any(|s| s.rays_log2.is_none()) {
            return Err(SimulatorError::Stopped);
        }
        Ok((sums, work.total(), limit))
    }

    /// What a stage costs, by what stages cost so far.
    fn expected_work(stage: &Stage, so_far: &Work) -> f64 {
        let rays: f64 = stage.rays.iter().map(|(_, range)| f64::from(range.end - range.start)).sum();
        let points = f64::from(stage.point_range.end - stage.point_range.start);
        let of_ray = so_far.rays as f64 / so_far.ray_count.max(1) as f64;
        let of_point = so_far.point_rays as f64 / so_far.point_count.max(1) as f64;
        let replicates = REPLICATES as f64;
        let points = if stage.points.is_empty() { 0.0 } else { points };
        replicates * (rays * of_ray + points * (of_point + PAIR_SHADOW_RAYS * stage.points.len() as f64))
    }

    /// Samples a stage and adds it; `None` where it was stopped, and nothing is added.
    fn add_stage(&self, stage: &Stage, sums: &mut [Sums]) -> Option<Work> {
        let jobs: Vec<(usize, &(usize, std::ops::Range<u32>))> =
            (0..REPLICATES).flat_map(|r| stage.rays.iter().map(move |ray| (r, ray))).collect();
        let rays: Vec<(f64, u64)> =
            jobs.par_iter().map(|(r, (k, range))| self.sample_rays(*k, *r, range.clone(), sums[*k].method)).collect();
        let methods: Vec<Method> = sums.iter().map(|s| s.method).collect();
        let points: Vec<(Vec<f64>, u64)> = if stage.points.is_empty() {
            vec![]
        } else {
            (0..REPLICATES).into_par_iter().map(|r| self.sample_points(stage, &methods, r)).collect()
        };
        if self.stop.is_due() {
            return None;
        }
        let mut work = Work::default();
        for ((r, (k, range)), (lux, cast)) in jobs.iter().zip(rays) {
            sums[*k].rays[*r] += lux;
            sums[*k].rays_log2 = Some(range.end.ilog2());
            work.rays += cast;
            work.ray_count += u64::from(range.end - range.start);
        }
        for (r, (lux, cast)) in points.into_iter().enumerate() {
            for (k, lux) in stage.points.iter().zip(lux) {
                sums[*k].points[r] += lux;
                sums[*k].points_log2 = Some(stage.point_range.end.ilog2());
            }
            work.point_rays += cast;
            let count = u64::from(stage.point_range.end - stage.point_range.start);
            work.point_count += count;
            work.pairs += count * stage.points.len() as u64;
        }
        Some(work)
    }

    /// Sum of what some rays of one replicate bring to a meter, and the rays that it took.
    fn sample_rays(&self, meter: usize, replicate: usize, range: std::ops::Range<u32>, method: Method) -> (f64, u64) {
        let stream = u64::from(method == Method::Paths);
        let seed = mix(self.seed ^ mix(((meter as u64) << 8 | replicate as u64) + 1) ^ stream);
        let (start_m, normal) = (self.starts_m[meter], self.meters[meter].normal);
        let (mut lux, mut rays) = (0.0, 0);
        for index in range {
            if index % SAMPLES_PER_LOOK == 0 && self.stop.is_due() {
                break;
            }
            let mut sampler = Sampler::new(seed, index);
            lux += match (method, self.map) {
                (Method::SharedPoints { points_per_ray }, Some(map)) => {
                    self.near_light(map, points_per_ray, start_m, normal, &mut sampler, &mut rays)
                }
                _ => self.transporter.irradiance(start_m, normal, &mut sampler, &mut rays),
            };
        }
        (lux, rays)
    }

    /// What a ray of a meter brings, in its part of the balance heuristic: roulette ends those of a small part.
    fn near_light(
        &self,
        map: &BrightnessMap,
        points_per_ray: u32,
        start_m: DVec3,
        normal: DVec3,
        sampler: &mut Sampler,
        rays: &mut u64,
    ) -> f64 {
        *rays += 1;
        let surroundings = self.transporter.surroundings;
        let direction = cosine_direction(normal, sampler.next_pair());
        let Some(place) = surroundings.closest(start_m, direction) else { return 0.0 };
        let kernel = kernel_per_m2(start_m, normal, &place);
        let part = ray_part(kernel, points_per_ray, map.density_per_m2(surroundings, &place));
        let survival = part.sqrt().max(MIN_SURVIVAL);
        if place.reflectance == 0.0 || sampler.next() >= survival {
            return 0.0;
        }
        part / survival * self.transporter.exitance(&place, sampler, rays)
    }

    /// Sums of what some points of one replicate bring to the meters of a stage, and the rays that it took.
    fn sample_points(&self, stage: &Stage, methods: &[Method], replicate: usize) -> (Vec<f64>, u64) {
        let mut lux = vec![0.0; stage.points.len()];
        let mut rays = 0;
        let Some(map) = self.map else { return (lux, rays) };
        let surroundings = self.transporter.surroundings;
        let seed = mix(self.seed ^ mix(0x0f01_4757 + replicate as u64));
        let seen: Vec<(DVec3, DVec3, u32)> = stage
            .points
            .iter()
            .map(|k| (self.starts_m[*k], self.meters[*k].normal, methods[*k].points_per_ray()))
            .collect();
        for index in stage.point_range.clone() {
            if index % SAMPLES_PER_LOOK == 0 && self.stop.is_due() {
                break;
            }
            let mut sampler = Sampler::new(seed, index);
            let (x, at) = (sampler.next(), sampler.next_pair());
            rays += 1;
            let Some((place, density)) = map.draw_at(surroundings, x, at) else { continue };
            let sent = self.transporter.exitance(&place, &mut sampler, &mut rays);
            if sent == 0.0 {
                continue;
            }
            for (lux, (start_m, normal, points_per_ray)) in lux.iter_mut().zip(&seen) {
                let kernel = kernel_per_m2(*start_m, *normal, &place);
                if kernel > 0.0 && !surroundings.is_hidden(*start_m, place.point_m) {
                    *lux += (1.0 - ray_part(kernel, *points_per_ray, density)) * kernel / density * sent;
                }
            }
        }
        (lux, rays)
    }
}

/// How many times as many samples bring a variance down to what is allowed.
fn needed_times(variance: f64, allowed: f64) -> f64 {
    (variance / allowed).powf(1.0 / VARIANCE_RATE)
}

/// How many times as many samples one power of two is as another.
fn times_as_many(log2: u32, pilot_log2: u32) -> f64 {
    2_f64.powi(log2 as i32 - pilot_log2 as i32)
}

/// Rays of a small part go on this often at least. They go on as often as the root of their part: if it were the part, a meter's
/// near light would be a few whole hits, whose scatter says little.
const MIN_SURVIVAL: f64 = 0.05;

/// The part of a place's light that rays bring, by the density of rays and points there.
fn ray_part(kernel_per_m2: f64, points_per_ray: u32, density_per_m2: f64) -> f64 {
    kernel_per_m2 / (kernel_per_m2 + f64::from(points_per_ray) * density_per_m2)
}

/// Rays cast so far.
#[derive(Clone, Copy, Debug, Default)]
struct Work {
    rays: u64,
    ray_count: u64,
    point_rays: u64,
    point_count: u64,
    pairs: u64,
}

impl Work {
    fn add(&mut self, more: &Self) {
        self.rays += more.rays;
        self.ray_count += more.ray_count;
        self.point_rays += more.point_rays;
        self.point_count += more.point_count;
        self.pairs += more.pairs;
    }

    fn total(&self) -> f64 {
        self.rays as f64 + self.point_rays as f64 + PAIR_SHADOW_RAYS * self.pairs as f64
    }
}

impl Sums {
    fn new(method: Method, reflected_lux: f64) -> Self {
        Self {
            method,
            reflected_lux,
            rays: [0.0; REPLICATES],
            points: [0.0; REPLICATES],
            rays_log2: None,
            points_log2: None,
            variances_before: [0.0; 2],
            is_done: false,
        }
    }

    fn parts(&self) -> [Replicates; 2] {
        [(&self.rays, self.rays_log2), (&self.points, self.points_log2)]
            .map(|(sums, log2)| log2.map_or([0.0; REPLICATES], |log2| sums.map(|s| s / f64::from(1_u32 << log2))))
    }

    fn replicates(&self) -> Replicates {
        let [rays, points] = self.parts();
        std::array::from_fn(|r| rays[r] + points[r])
    }

    fn value(&self) -> f64 {
        mean_and_error(&self.replicates()).0
    }

    /// Standard error: the quadratic mean of what the scatter is now, and of what it promised before the last doubling.
    ///
    /// Stopping as soon as a noisy error is small prefers errors that are too small by chance. What was known before does not
    /// share that chance. It promises half the variance, the least that a doubling gains.
    fn error(&self) -> f64 {
        let variance = mean_and_error(&self.replicates()).1.powi(2);
        let promised = HALF * (self.variances_before[0] + self.variances_before[1]);
        let scatter = if promised > 0.0 { HALF * (variance + promised) } else { variance };
        (scatter + self.unseen_lux().powi(2)).sqrt()
    }

    /// Standard uncertainty of light that no path has met: one path in as many as were cast may be the first to meet a surface of
    /// the room's mean brightness.
    ///
    /// Only where it is dim does that exceed the scatter: in a slit between a body and a wall, say, where few paths find the way out.
    fn unseen_lux(&self) -> f64 {
        if self.value() < DIM_PART * self.reflected_lux { self.reflected_lux / self.count() } else { 0.0 }
    }

    /// The number of rays or paths in all replicates.
    fn count(&self) -> f64 {
        f64::from(1_u32 << self.rays_log2.unwrap_or(0)) * REPLICATES as f64
    }

    /// Variances of the mean that rays and points make.
    fn variances(&self) -> (f64, f64) {
        let [rays, points] = self.parts().map(|part| mean_and_error(&part).1.powi(2));
        (rays, points)
    }

    /// Whether the error is as small as allowed after at least one doubling.
    fn is_known(&self, allowed: f64) -> bool {
        let first = if self.method == Method::Paths { *PATHS_LOG2.start() } else { *RAYS_LOG2.start() };
        let Some(rays_log2) = self.rays_log2 else { return false };
        let is_dark = self.value() == 0.0 && rays_log2 < DARK_LOG2;
        let is_doubled = rays_log2 > first && self.points_log2.is_none_or(|p| p > *POINTS_LOG2.start());
        is_doubled && !is_dark && self.error() <= allowed
    }

    /// Whether it needs more rays, and more points.
    fn needs(&self, allowed: f64) -> (bool, bool) {
        if self.is_done {
            return (false, false);
        }
        if self.method == Method::Paths {
            return (true, false);
        }
        if self.points_log2.is_none() {
            return (true, true);
        }
        let (rays, points) = self.variances();
        let most = HALF * allowed * allowed;
        let more_rays = rays + self.unseen_lux().powi(2) > most || self.rays_log2 == Some(*RAYS_LOG2.start());
        let more_points = points > most || self.points_log2 == Some(*POINTS_LOG2.start());
        if more_rays || more_points { (more_rays, more_points) } else { (rays >= points, points > rays) }
    }

    /// The indices of the rays or paths to come; `None` where there are as many as there may be.
    fn next_rays(&self) -> Option<std::ops::Range<u32>> {
        let range = if self.method == Method::Paths { PATHS_LOG2 } else { RAYS_LOG2 };
        match self.rays_log2 {
            None => Some(0..1 << range.start()),
            Some(log2) if log2 < *range.end() => Some(1 << log2..1 << (log2 + 1)),
            Some(_) => None,
        }
    }

    fn reading(&self, mean_lux: f64) -> Reading {
        let mut sampled = self.replicates();
        let (mean, scatter) = mean_and_error(&sampled);
        if scatter > 0.0 {
            // Replicates that scatter as the stated error says, so that sets of meters have it too.
            let wider = self.error() / scatter;
            sampled = sampled.map(|s| mean + wider * (s - mean));
        }
        // What no path met has a probability below three in so many (95 %), and about the light of a mean surface.
        let unseen = if sampled.iter().all(|s| *s == 0.0) { 3.0 * mean_lux / self.count() } else { 0.0 };
        Reading { known: Bounded { value: 0.0, bound: unseen }, sampled }
    }
}

/// Which samples are doubled next: none where every meter has the error asked for, or as many as there may be.
fn plan_stage(sums: &mut [Sums], direct: &[f64], relative_error: f64) -> Stage {
    let totals: Vec<f64> = sums.iter().zip(direct).map(|(s, d)| s.value() + d).collect();
    let floor = DIM_PART * totals.iter().sum::<f64>() / totals.len().max(1) as f64;
    let mut stage = Stage { rays: vec![], points: vec![], point_range: 0..0 };
    let points_log2 = sums.iter().filter_map(|s| s.points_log2).max();
    for (sums, total) in sums.iter_mut().zip(&totals) {
        let allowed = relative_error * total.max(floor);
        sums.is_done |= sums.is_known(allowed);
    }
    let needs: Vec<(bool, bool)> =
        sums.iter().zip(&totals).map(|(s, total)| s.needs(relative_error * total.max(floor))).collect();
    let wanting: Vec<usize> = (0..sums.len()).filter(|k| needs[*k].1).collect();
    let are_few = (wanting.len() as f64) < FEW_PART * sums.len() as f64;
    let goes_over = points_log2.is_some_and(|p| p >= *POINTS_LOG2.end() || are_few && p >= ENOUGH_POINTS_LOG2);
    for (k, (rays, points)) in needs.into_iter().enumerate() {
        if points && goes_over {
            sums[k] = Sums::new(Method::Paths, sums[k].reflected_lux);
        }
        let sums = &sums[k];
        if rays || points && goes_over {
            stage.rays.extend(sums.next_rays().map(|range| (k, range)));
        }
    }
    if !wanting.is_empty() && !goes_over {
        stage.point_range = match points_log2 {
            None => 0..1 << POINTS_LOG2.start(),
            Some(log2) => 1 << log2..1 << (log2 + 1),
        };
        // All that are not known yet gain by more points, and those that had all so far can take them.
        stage.points = (0..sums.len())
            .filter(|k| !sums[*k].is_done && sums[*k].method != Method::Paths && sums[*k].points_log2 == points_log2)
            .collect();
    }
    stage
}
