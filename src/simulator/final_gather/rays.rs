//! Rays from a place: light that was reflected once where they end, and where light reflected more often is asked for.
//!
//! A ray ends on a face where reflected light is known. From other bodies, and from places where it is not known well
//! enough, it goes on, by roulette after the second time, so that nothing is lost on the mean. Where much light
//! falls, places are drawn from the light itself, too; both ways share the work by the balance heuristic (E. Veach,
//! L. Guibas, SIGGRAPH 1995), so that a small bright place is neither missed nor counted twice.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::face::Face;
use super::grid::{Grid, Spot};
use super::lit::{Known, Lights, Limit, Lit};
use super::surroundings::Place;
use crate::scene::Meter;
use crate::simulator::sampler::Sampler;

/// Reflections from which roulette may end a ray.
const ROULETTE_FROM: u32 = 3;
/// The likeliest that a ray survives roulette, so that it ends even where everything reflects all light.
const SURVIVAL: f64 = 0.95;

/// Coordinates of a ray's sample before those of its reflections, and of each reflection: its direction, the parts of
/// luminaires, and roulette.
const DRAWN: usize = 4;
const PER_REFLECTION: usize = 5;

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
    /// Where it ended on a face, if it did.
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
    pub(super) fn follow(&self, meter: &Meter, sampler: &mut Sampler, most: u32, limit: Limit) -> Found {
        let mut found = Found::default();
        if self.draws {
            self.draw(meter, sampler, &mut found);
        }
        let around = self.lights.surroundings;
        let mut at = *meter;
        let mut weight = 1.0;
        for reflection in 1..=most {
            let dimension = DRAWN + PER_REFLECTION * (reflection - 1) as usize;
            let toward = sampler.from(dimension).next_pair();
            let start_m = if reflection == 1 { at.position_m + at.normal * around.lift_m() } else { at.position_m };
            let Some(place) = around.closest(start_m, cosine_direction(at.normal, toward)) else { break };
            weight *= place.reflectance;
            if weight == 0.0 {
                break;
            }
            let share = if reflection == 1 { self.share(meter, &place) } else { 1.0 };
            self.light(&place, || sampler.from(dimension + 2).next_pair(), weight * share, reflection, &mut found);
            if let (Some(face), Some((grid, known))) = (place.face, self.grid) {
                let spot = grid.spot(face, place.point_m);
                let known = &known[spot.rectangle as usize];
                if known.is_enough(place.distance_m, limit) {
                    found.error_lux += weight * known.left_lux(place.distance_m);
                    found.end = Some(End { spot, weight, reflections: reflection });
                    break;
                }
            }
            if reflection >= ROULETTE_FROM {
                let survival = place.reflectance.min(SURVIVAL);
                if sampler.from(dimension + 4).next() >= survival {
                    break;
                }
                weight /= survival;
            }
            at = Meter { position_m: place.point_m, normal: place.normal };
        }
        found
    }

    /// Adds light straight from the luminaires at a place, with a weight.
    fn light(&self, place: &Place, parts: impl FnOnce() -> [f64; 2], weight: f64, reflection: u32, found: &mut Found) {
        let meter = Meter { position_m: place.point_m, normal: place.normal };
        let lux = if let Some(face) = place.face {
            let light = self.lit.at(&self.lights, face, &meter, parts);
            found.error_lux += weight * light.known.left_lux(place.distance_m);
            light.lux
        } else {
            let parts = parts();
            (0..self.lights.emitters.len()).map(|k| self.lights.sample(k, &meter, place.point_m, parts)).sum()
        };
        found.lux.push((reflection, weight * lux));
    }

    /// The part of a place's light that a ray counts where the place may be drawn, too.
    fn share(&self, meter: &Meter, place: &Place) -> f64 {
        let Some(face) = place.face.filter(|_| self.draws) else { return 1.0 };
        let Some(own) = ray_density(meter, place.point_m, place.normal) else { return 1.0 };
        own / (own + self.lit.density(&self.lights, face, place.point_m))
    }

    /// Light reflected once by a place that is drawn from what the walls reflect.
    fn draw(&self, meter: &Meter, sampler: &mut Sampler, found: &mut Found) {
        let at = sampler.next_pair();
        let around = self.lights.surroundings;
        let Some((face, at_m, density)) = self.lit.draw(at) else { return };
        let Face { normal, .. } = around.faces[face];
        let point_m = around.faces[face].off(at_m);
        let Some(own) = ray_density(meter, point_m, normal) else { return };
        let way = point_m - meter.position_m;
        let start_m = meter.position_m + meter.normal * around.lift_m();
        // What lies flat on a wall covers it: the ray itself tells what it meets.
        let Some(place) = around.closest(start_m, way.normalize()) else { return };
        if place.face != Some(face) || (place.point_m - point_m).length() > 1e-6 * way.length() {
            return;
        }
        let place = Place { point_m, normal, ..place };
        // The density of rays is cos cos / (pi r²), the very kernel of irradiance.
        let weight = place.reflectance * own / (own + density);
        self.light(&place, || sampler.from(2).next_pair(), weight, 1, found);
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
