//! Light that a place sends out, estimated along one random path with next-event estimation.
//!
//! J. T. Kajiya, "The rendering equation", SIGGRAPH 1986. Where few places hold most of the light, each place of a path also asks one
//! of them. A bright place that the path itself meets counts in part: each of the two ways is weighed by the density of both (balance
//! heuristic: E. Veach, L. Guibas, SIGGRAPH 1995), so that no rare path is very bright.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::brightness::BrightnessMap;
use super::lamps::Lamps;
use super::surroundings::{Place, Surroundings};
use crate::sampler::Sampler;

/// Reflections after which roulette may end a path.
const ROULETTE_FROM: u32 = 3;
/// The highest probability that a path goes on.
const MAX_SURVIVAL: f64 = 0.95;

/// A scene as paths go through it.
#[derive(Debug)]
pub(super) struct Transporter<'a> {
    pub(super) surroundings: &'a Surroundings,
    pub(super) lamps: &'a Lamps,
    /// Reflections that count, from the luminaire to a meter.
    pub(super) reflections: u32,
    /// Bright places, of which paths ask one at each reflection.
    pub(super) bright: Option<&'a BrightnessMap>,
}

impl Transporter<'_> {
    /// Light in lm/m² that a place sends out: a random number whose mean is right. Adds the rays that it cast to `rays`.
    pub(super) fn exitance(&self, place: &Place, sampler: &mut Sampler, rays: &mut u64) -> f64 {
        self.path(place, 1.0, sampler, rays)
    }

    /// Light in lux that a place receives from surfaces, along one path.
    pub(super) fn irradiance(&self, point_m: DVec3, normal: DVec3, sampler: &mut Sampler, rays: &mut u64) -> f64 {
        *rays += 1;
        let toward = sampler.next_pair();
        let bright = self.bright_light(point_m, normal, sampler, rays);
        let place = self.surroundings.closest(point_m, cosine_direction(normal, toward));
        bright + place.map_or(0.0, |p| self.path(&p, self.part_of_rays(point_m, normal, &p), sampler, rays))
    }

    /// Light in lm/m² that a place sends out, of which light straight from the luminaires counts in this part.
    fn path(&self, place: &Place, part: f64, sampler: &mut Sampler, rays: &mut u64) -> f64 {
        let (mut at, mut part, mut weight, mut lux) = (*place, part, place.reflectance, 0.0);
        for reflection in 1..=self.reflections {
            if weight == 0.0 {
                break;
            }
            *rays += 1;
            lux += weight * part * self.lamps.illuminance(self.surroundings, at.point_m, at.normal, sampler, rays);
            if reflection == self.reflections {
                break;
            }
            if reflection > ROULETTE_FROM {
                let survival = at.reflectance.min(MAX_SURVIVAL);
                if sampler.next() >= survival {
                    break;
                }
                weight /= survival;
            }
            let toward = sampler.next_pair();
            lux += weight * self.bright_light(at.point_m, at.normal, sampler, rays);
            let Some(next) = self.surroundings.closest(at.point_m, cosine_direction(at.normal, toward)) else { break };
            part = self.part_of_rays(at.point_m, at.normal, &next);
            weight *= next.reflectance;
            at = next;
        }
        lux
    }

    /// Light in lux that a place receives from one bright place, where that has it straight from the luminaires; in its part.
    fn bright_light(&self, point_m: DVec3, normal: DVec3, sampler: &mut Sampler, rays: &mut u64) -> f64 {
        let Some(map) = self.bright else { return 0.0 };
        let (x, at) = (sampler.next(), sampler.next_pair());
        *rays += 1;
        let Some((place, density)) = map.draw_at(self.surroundings, x, at) else { return 0.0 };
        let kernel = kernel_per_m2(point_m, normal, &place);
        if kernel == 0.0 || self.surroundings.is_hidden(point_m, place.point_m) {
            return 0.0;
        }
        let lux = self.lamps.illuminance(self.surroundings, place.point_m, place.normal, sampler, rays);
        place.reflectance * kernel / (density + kernel) * lux
    }

    /// The part of the light straight from the luminaires that counts where a ray from a point meets a place.
    fn part_of_rays(&self, point_m: DVec3, normal: DVec3, place: &Place) -> f64 {
        let Some(map) = self.bright else { return 1.0 };
        let kernel = kernel_per_m2(point_m, normal, place);
        let density = map.density_per_m2(self.surroundings, place);
        if density == 0.0 { 1.0 } else { kernel / (kernel + density) }
    }
}

/// The part of a place's light that reaches another, for each square metre: cos cos / (pi r²), the density of cosine-distributed
/// rays per square metre.
pub(super) fn kernel_per_m2(point_m: DVec3, normal: DVec3, place: &Place) -> f64 {
    let away = place.point_m - point_m;
    let (a, b) = (away.dot(normal), -away.dot(place.normal));
    if a <= 0.0 || b <= 0.0 {
        return 0.0;
    }
    let square = away.length_squared();
    a * b / (PI * square * square)
}

/// A direction about `normal` with the density cos / pi.
pub(super) fn cosine_direction(normal: DVec3, [u, v]: [f64; 2]) -> DVec3 {
    let (x, y) = normal.any_orthonormal_pair();
    let r = u.sqrt();
    let (sin, cos) = (TAU * v).sin_cos();
    x * (r * cos) + y * (r * sin) + normal * (1.0 - u).sqrt()
}
