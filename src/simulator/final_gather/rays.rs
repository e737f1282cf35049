//! Rays from a place: light that was reflected once where they end, and where light reflected more often is asked for.
//!
//! A ray ends on a wall where reflected light is known. From bodies, and from places on walls where it is not known
//! well enough, it goes on, by roulette after the second time, so that nothing is lost on the mean. Where much light
//! falls, places are drawn from the light itself, too; both ways share the work by the balance heuristic (E. Veach,
//! L. Guibas, SIGGRAPH 1995), so that a small bright place is neither missed nor counted twice.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::grid::{Grid, Spot};
use super::lit::{Known, Lights, Lit};
use super::surroundings::{Place, WALLS, off_wall};
use crate::scene::Meter;
use crate::simulator::sampler::Sampler;

/// Reflections from which roulette may end a ray.
const ROULETTE_FROM: u32 = 3;
/// The likeliest that a ray survives roulette, so that it ends even where everything reflects all light.
const SURVIVAL: f64 = 0.95;

/// All that rays need.
pub(super) struct Rays<'a> {
    pub(super) lights: Lights<'a>,
    pub(super) lit: &'a Lit,
    /// Where reflected light is known, and how far off it may be there by rectangle; `None` in free field.
    pub(super) grid: Option<(&'a Grid, &'a [Known])>,
    /// Whether bright places are drawn, too.
    pub(super) draws: bool,
}

/// What one ray found.
#[derive(Debug, Default)]
pub(super) struct Found {
    /// Light reflected once and more often, in lux, by the number of reflections.
    pub(super) lux: Vec<(u32, f64)>,
    /// How far off that may be besides chance.
    pub(super) error_lux: f64,
    /// Where it ended on a wall, if it did.
    pub(super) end: Option<End>,
}

/// A place whose light reflected more often is asked for.
#[derive(Clone, Copy, Debug)]
pub(super) struct End {
    pub(super) spot: Spot,
    /// Product of the reflectances on the way, that of the place itself included.
    pub(super) weight: f64,
    /// Reflections on the way, that of the place itself included.
    pub(super) reflections: u32,
}

impl Rays<'_> {
    /// One ray from a place, cosine-distributed about its normal, that goes on from where more than a limit may be left out.
    pub(super) fn follow(&self, meter: &Meter, sampler: &mut Sampler, most: u32, limit_lux: f64) -> Found {
        let mut found = Found::default();
        if self.draws {
            self.draw(meter, sampler, &mut found);
        }
        let around = self.lights.surroundings;
        let mut at = *meter;
        let mut weight = 1.0;
        for reflection in 1..=most {
            let (toward, parts, chance) = (sampler.next_pair(), sampler.next_pair(), sampler.next());
            let start_m = if reflection == 1 { at.position_m + at.normal * around.lift_m() } else { at.position_m };
            let Some(place) = around.closest(start_m, cosine_direction(at.normal, toward)) else { break };
            weight *= place.reflectance;
            if weight == 0.0 {
                break;
            }
            let share = if reflection == 1 { self.share(meter, &place) } else { 1.0 };
            self.light(&place, parts, weight * share, reflection, &mut found);
            if let (Some(wall), Some((grid, known))) = (place.wall, self.grid) {
                let spot = grid.spot(wall, place.point_m);
                let known = &known[spot.rectangle as usize];
                if known.is_enough(place.distance_m, limit_lux) {
                    found.error_lux += weight * known.left_lux(place.distance_m);
                    found.end = Some(End { spot, weight, reflections: reflection });
                    break;
                }
            }
            if reflection >= ROULETTE_FROM {
                let survival = place.reflectance.min(SURVIVAL);
                if chance >= survival {
                    break;
                }
                weight /= survival;
            }
            at = Meter { position_m: place.point_m, normal: place.normal };
        }
        found
    }

    /// Adds light straight from the luminaires at a place, with a weight.
    fn light(&self, place: &Place, parts: [f64; 2], weight: f64, reflection: u32, found: &mut Found) {
        let meter = Meter { position_m: place.point_m, normal: place.normal };
        let lux = if let Some(wall) = place.wall {
            let light = self.lit.at(&self.lights, wall, &meter, parts);
            found.error_lux += weight * light.known.left_lux(place.distance_m);
            light.lux
        } else {
            (0..self.lights.emitters.len()).map(|k| self.lights.sample(k, &meter, place.point_m, parts)).sum()
        };
        found.lux.push((reflection, weight * lux));
    }

    /// The part of a place's light that a ray counts where the place may be drawn, too.
    fn share(&self, meter: &Meter, place: &Place) -> f64 {
        let Some(wall) = place.wall.filter(|_| self.draws) else { return 1.0 };
        let Some(own) = ray_density(meter, place.point_m, place.normal) else { return 1.0 };
        own / (own + self.lit.density(wall, place.point_m))
    }

    /// Light reflected once by a place that is drawn from what the walls reflect.
    fn draw(&self, meter: &Meter, sampler: &mut Sampler, found: &mut Found) {
        let (at, parts) = (sampler.next_pair(), sampler.next_pair());
        let around = self.lights.surroundings;
        let Some(room) = around.room else { return };
        let Some((wall, at_m, density)) = self.lit.draw(at) else { return };
        let (point_m, normal) = (off_wall(&room, wall, at_m), WALLS[wall].inward_normal());
        let Some(own) = ray_density(meter, point_m, normal) else { return };
        let way = point_m - meter.position_m;
        let start_m = meter.position_m + meter.normal * around.lift_m();
        // What lies flat on the wall covers it: the ray itself tells what it meets.
        let Some(place) = around.closest(start_m, way.normalize()) else { return };
        if place.wall != Some(wall) || (place.point_m - point_m).length() > 1e-6 * way.length() {
            return;
        }
        let place = Place { point_m, normal, ..place };
        // The density of rays is cos cos / (pi r²), the very kernel of irradiance.
        let weight = place.reflectance * own / (own + density);
        self.light(&place, parts, weight, 1, found);
    }
}

/// The density of cosine-distributed rays at a place, per square metre; nothing where it cannot be seen.
fn ray_density(meter: &Meter, point_m: DVec3, normal: DVec3) -> Option<f64> {
    let way = point_m - meter.position_m;
    let square = way.length_squared();
    let (out, back) = (way.dot(meter.normal), -way.dot(normal));
    (out > 0.0 && back > 0.0).then(|| out * back / (PI * square * square))
}

/// A direction about `normal` with the density cos / pi: Malley's disc, lifted.
fn cosine_direction(normal: DVec3, [u, v]: [f64; 2]) -> DVec3 {
    let (x, y) = normal.any_orthonormal_pair();
    let r = u.sqrt();
    let (sin, cos) = (TAU * v).sin_cos();
    x * (r * cos) + y * (r * sin) + normal * (1.0 - u).sqrt()
}
