//! One random light path and what it adds: the integrand of the path tracer as a function of uniform numbers.
//!
//! J. T. Kajiya, "The rendering equation", SIGGRAPH 1986: from the meter a cosine-distributed ray, at each surface that
//! it meets the light straight from the luminaires (next-event estimation) times the reflectances so far, and on.
//! Roulette ends a path with the probability of its absorption, so that the mean stays exact. Where a luminaire stands
//! close to a surface, the peak of light upon it is sampled from the luminaire as well, and the two estimates share the
//! work by the power heuristic (E. Veach, L. Guibas, SIGGRAPH 1995), which keeps the variance finite.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::emitter::Emitter;
use super::world::{Hit, World};
use crate::sampler::Sampler;
use luxproof_scene::Meter;

/// Reflections after which roulette sets in; before, weighting by the reflectance keeps the integrand smooth.
const ROULETTE_FROM: u32 = 3;
/// So many luminaires are all asked at every surface, which case S2 shows to be worth twice its cost.
const ALL_EMITTERS: usize = 8;
/// Of more than that, all are asked up to this reflection; beyond, one is picked by its flux.
const ALL_EMITTERS_UNTIL: u32 = 1;

/// Reflections that no path survives in a scene that absorbs anything to speak of.
pub(super) const ENDLESS: u32 = 2_000_000;

/// What a path is asked for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wanted {
    /// Whether light straight from the luminaires counts.
    pub(super) direct: bool,
    /// The most reflections that count.
    pub(super) reflections: u32,
}

/// A scene made ready for paths.
pub(super) struct Integrand<'a> {
    world: &'a World,
    emitters: &'a [Emitter<'a>],
    /// Whether each emitter is sampled from its own side as well.
    close: Vec<bool>,
    /// Flux of all emitters up to and including each, as a part of the whole.
    cumulative: Vec<f64>,
    any_extent: bool,
    /// Reflections up to which all emitters are asked.
    all_until: u32,
    wanted: Wanted,
}

/// A place from which rays start.
#[derive(Clone, Copy)]
struct Vertex {
    point_m: DVec3,
    normal: DVec3,
}

impl<'a> Integrand<'a> {
    pub(super) fn new(world: &'a World, emitters: &'a [Emitter<'a>], close: Vec<bool>, wanted: Wanted) -> Self {
        let total: f64 = emitters.iter().map(Emitter::flux_lm).sum();
        let cumulative = emitters.iter().scan(0.0, |sum, e| {
            *sum += e.flux_lm() / total;
            Some(*sum)
        });
        Self {
            world,
            emitters,
            close,
            cumulative: cumulative.collect(),
            any_extent: emitters.iter().any(Emitter::has_extent),
            all_until: if emitters.len() <= ALL_EMITTERS { u32::MAX } else { ALL_EMITTERS_UNTIL },
            wanted,
        }
    }

    /// Illuminance in lux that one path from a meter finds; its mean over all paths is the meter's.
    ///
    /// Not a number where the path comes to no end, since cutting it would be a silent loss.
    pub(super) fn path(&self, meter: &Meter, sampler: &mut Sampler) -> f64 {
        let mut lux = 0.0;
        if self.wanted.direct {
            let parts = self.opening_pair(sampler);
            lux += self.direct(meter, sampler.moved(parts));
        }
        let lifted_m = meter.position_m + meter.normal * self.world.lift_m();
        let mut at = Vertex { point_m: lifted_m, normal: meter.normal };
        // Product of reflectances over survival probabilities: the weight of what the next surface receives.
        let mut weight = 1.0;
        for reflection in 1..=self.wanted.reflections {
            let toward = sampler.next_pair();
            let pick = if reflection > self.all_until { self.pick(sampler) } else { Pick::All };
            let parts = self.opening_pair(sampler);
            lux += weight * self.emitted(&at, &pick, sampler);
            let Some(hit) = self.world.closest(at.point_m, cosine_direction(at.normal, toward)) else { break };
            if hit.reflectance == 0.0 {
                break;
            }
            weight *= hit.reflectance;
            let next = Vertex { point_m: hit.point_m, normal: hit.normal };
            lux += weight * self.at_surface(&at, &next, &hit, &pick, parts);
            at = next;
            if reflection >= ROULETTE_FROM {
                if sampler.next() >= hit.reflectance {
                    break;
                }
                weight /= hit.reflectance;
            }
            if reflection == ENDLESS {
                return f64::NAN;
            }
        }
        lux
    }

    /// Light straight from the parts of the luminaires that `parts` picks; exact where they have no extent.
    pub(super) fn direct(&self, meter: &Meter, parts: [f64; 2]) -> f64 {
        let start_m = meter.position_m + meter.normal * self.world.lift_m();
        let light = |e: &Emitter| {
            let arrival = e.arrival(meter.position_m, meter.normal, parts)?;
            let open = self.world.contains(arrival.from_m) && self.world.visible(start_m, arrival.from_m);
            open.then_some(arrival.lux)
        };
        // The sum of nothing would be -0.
        self.emitters.iter().filter_map(light).fold(0.0, |sum, lux| sum + lux)
    }

    /// Whether [`Self::path`] adds nothing to an exact [`Self::direct`].
    pub(super) fn is_exact(&self) -> bool {
        self.wanted.reflections == 0 && !self.any_extent
    }

    /// Light straight from the picked luminaires on a surface that a path from `before` has met.
    fn at_surface(&self, before: &Vertex, at: &Vertex, hit: &Hit, pick: &Pick, parts: [f64; 2]) -> f64 {
        let path = before.point_m - at.point_m;
        let cosines = before.normal.dot(-path) * at.normal.dot(path);
        let density = cosines / (PI * hit.distance_m.powi(4));
        pick.of(self.emitters.len())
            .map(|(k, factor)| {
                let shared = self.close[k].then_some(density);
                factor * self.arriving(&self.emitters[k], at, parts, shared)
            })
            .sum()
    }

    /// Light of one luminaire on a surface; where paths sample it at a `density` and its own rays do too, their share.
    fn arriving(&self, emitter: &Emitter, at: &Vertex, parts: [f64; 2], density: Option<f64>) -> f64 {
        let Some(arrival) = emitter.arrival(at.point_m, at.normal, parts) else { return 0.0 };
        let share = density.map_or(1.0, |paths| power_share(paths, emitter.density_per_m2(&arrival)));
        if share == 0.0 || !self.world.contains(arrival.from_m) || !self.world.visible(at.point_m, arrival.from_m) {
            return 0.0;
        }
        share * arrival.lux
    }

    /// Light that leaves the close luminaires along rays of their own, meets a surface and is reflected to `at`.
    fn emitted(&self, at: &Vertex, pick: &Pick, sampler: &mut Sampler) -> f64 {
        if !self.close.contains(&true) {
            return 0.0;
        }
        let (parts, along) = (self.opening_pair(sampler), sampler.next_pair());
        let one = |(k, factor): (usize, f64)| {
            let light = if self.close[k] { self.reflected(&self.emitters[k], at, parts, along) } else { None };
            factor * light.unwrap_or(0.0)
        };
        pick.of(self.emitters.len()).map(one).sum()
    }

    fn reflected(&self, emitter: &Emitter, at: &Vertex, parts: [f64; 2], along: [f64; 2]) -> Option<f64> {
        let ray = emitter.emit(parts, along);
        let start_m = ray.from_m + self.world.lift_m() * ray.direction;
        // What an opening in the plane of a surface sends into that is lost.
        if ray.candela == 0.0 || !self.world.contains(ray.from_m) || !self.world.holds(start_m) {
            return None;
        }
        let hit = self.world.closest(start_m, ray.direction)?;
        let path = at.point_m - hit.point_m;
        let square = path.length_squared();
        let cosines = hit.normal.dot(path) * at.normal.dot(-path);
        let facing = hit.normal.dot(path) > 0.0 && at.normal.dot(-path) > 0.0;
        if !facing || hit.reflectance == 0.0 || !self.world.visible(at.point_m, hit.point_m) {
            return None;
        }
        let paths = cosines / (PI * square * square);
        let cosine = -hit.normal.dot(ray.direction);
        let own = ray.density_per_sr * cosine / (hit.distance_m * hit.distance_m);
        // Per steradian, over the density of the ray.
        Some(power_share(own, paths) * hit.reflectance * ray.candela * paths / ray.density_per_sr)
    }

    fn opening_pair(&self, sampler: &mut Sampler) -> [f64; 2] {
        if self.any_extent { sampler.next_pair() } else { [0.5, 0.5] }
    }

    fn pick(&self, sampler: &mut Sampler) -> Pick {
        let u = sampler.next();
        let k = self.cumulative.partition_point(|c| *c <= u).min(self.emitters.len() - 1);
        let below = if k == 0 { 0.0 } else { self.cumulative[k - 1] };
        Pick::One(k, 1.0 / (self.cumulative[k] - below))
    }
}

/// The part of a sample's weight where another way would have found it at density `other`: the power heuristic.
fn power_share(density: f64, other: f64) -> f64 {
    let ratio = other / density;
    1.0 / (1.0 + ratio * ratio)
}

/// Which luminaires are asked, and the inverse probability of that.
enum Pick {
    All,
    One(usize, f64),
}

impl Pick {
    fn of(&self, emitters: usize) -> impl Iterator<Item = (usize, f64)> {
        let (range, factor) = match *self {
            Self::All => (0..emitters, 1.0),
            Self::One(k, factor) => (k..k + 1, factor),
        };
        range.map(move |k| (k, factor))
    }
}

/// A direction about `normal` with the density cos / pi: Malley's disc, lifted.
fn cosine_direction(normal: DVec3, [u, v]: [f64; 2]) -> DVec3 {
    let (x, y) = normal.any_orthonormal_pair();
    let r = u.sqrt();
    let (sin, cos) = (TAU * v).sin_cos();
    x * (r * cos) + y * (r * sin) + normal * (1.0 - u).sqrt()
}
