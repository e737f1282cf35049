//! Flat luminous openings as sets of weighted point lights: Gauss-Legendre points over a rectangle or an ellipse.
//!
//! A flat opening of uniform luminance at every direction emits I(C, gamma) dA / A from each of its elements, so that the
//! illuminance is the mean of point luminaires over the opening; the quadrature is exact for polynomials of order 2n - 1
//! (Abramowitz & Stegun, Handbook of Mathematical Functions, 25.4.30).

use std::f64::consts::PI;

use glam::DVec3;
use luminaire::photometry::LuminousOpening;
use luminaire::scene::{Luminaire, LuminaireModel};
use luminaire::simulator::quadrature::Gauss;

use crate::engines::Job;

/// A part of a luminaire: where it is in the luminaire's frame and its share of the intensity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Part {
    pub(super) offset_m: DVec3,
    /// Share of the intensity; all shares together make 1.
    pub(super) share: f64,
}

/// Radius of the filter round a light, in scene units; POV-Ray silently ignores one of 1e-3.
pub(super) const FILTER_RADIUS: f64 = 0.002;

/// Points along each side of a luminous opening for direct light, at most.
pub(super) const MOST_POINTS: usize = 48;

/// The parts that stand for a luminaire, so many along each side of its opening.
pub(super) fn parts_of(luminaire: &Luminaire, points: usize) -> Vec<Part> {
    let whole = vec![Part { offset_m: DVec3::ZERO, share: 1.0 }];
    match luminaire.model {
        LuminaireModel::Point => whole,
        _ => parts(luminaire.photometry.opening, points).unwrap_or(whole),
    }
}

/// The parts of an opening, `n` by `n`; `None` where the opening is not flat.
pub(super) fn parts(opening: LuminousOpening, n: usize) -> Option<Vec<Part>> {
    let rule = Gauss::new(n);
    match opening {
        LuminousOpening::Point => Some(vec![Part { offset_m: DVec3::ZERO, share: 1.0 }]),
        LuminousOpening::Box { x_m, y_m, height_m: 0.0 } => {
            let part = |(u, wu): (f64, f64), (v, wv): (f64, f64)| Part {
                offset_m: DVec3::new((u - 0.5) * x_m, (v - 0.5) * y_m, 0.0),
                share: wu * wv,
            };
            Some(rule.points().flat_map(|a| rule.points().map(move |b| part(a, b))).collect())
        }
        LuminousOpening::Ellipse { x_m, y_m, height_m: 0.0 } => {
            let turns = 2 * n;
            let part = |(u, w): (f64, f64), k: usize| {
                // Uniform in the square of the radius, evenly spaced in angle.
                let radius = u.sqrt() / 2.0;
                let (sin, cos) = (2.0 * PI * (k as f64 + 0.5) / turns as f64).sin_cos();
                Part { offset_m: DVec3::new(x_m * cos, y_m * sin, 0.0) * radius, share: w / turns as f64 }
            };
            Some(rule.points().flat_map(|a| (0..turns).map(move |k| part(a, k))).collect())
        }
        _ => None,
    }
}

/// Which meter, the first of all, would tell the `n` by `n` point lights of an opening apart.
///
/// Measured in a cube of luminous panels of 2 m: 3 % at one gap's distance, below .5 % at two. Gauss-Legendre points are
/// furthest apart in the middle, pi / 2 times the mean.
pub(super) fn too_near(job: &Job, n: usize) -> Option<String> {
    let of = |l: &Luminaire| {
        let [along_y, along_x, along_z] = l.photometry.opening.bounding_box_m();
        let half_m = 0.5 * DVec3::new(along_x, along_y, along_z);
        let spacing_m = PI * half_m.max_element() / n as f64;
        let distance_m = |p: DVec3| {
            let own = l.orientation.transpose() * (p - l.position_m);
            own.distance(own.clamp(-half_m, half_m))
        };
        let near = job.stations.iter().find(|s| distance_m(s.meter.position_m) < 2.0 * spacing_m)?;
        let (station, distance_m) = (&near.id, distance_m(near.meter.position_m));
        let lights = format!("whose point lights are up to {spacing_m:.2} m apart");
        Some(format!("{station} is {distance_m:.2} m from the opening of {}, {lights}", l.id))
    };
    job.scene.luminaires.iter().filter(|l| l.model == LuminaireModel::Area).find_map(of)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn shares_make_one_and_second_moments_are_those_of_the_shape() {
        let (x_m, y_m) = (0.6, 1.2);
        let rectangle = LuminousOpening::Box { x_m, y_m, height_m: 0.0 };
        let ellipse = LuminousOpening::Ellipse { x_m, y_m, height_m: 0.0 };
        for (opening, moment) in [(rectangle, 12.0), (ellipse, 16.0)] {
            for n in [2, 4, 16] {
                let parts = parts(opening, n).unwrap();
                let sum = |f: fn(DVec3) -> f64| parts.iter().map(|p| p.share * f(p.offset_m)).sum::<f64>();
                assert_relative_eq!(sum(|_| 1.0), 1.0, max_relative = 1e-13);
                assert_relative_eq!(sum(|p| p.x * p.x), x_m * x_m / moment, max_relative = 1e-13);
                assert_relative_eq!(sum(|p| p.y * p.y), y_m * y_m / moment, max_relative = 1e-13);
                assert_relative_eq!(sum(|p| p.x * p.y), 0.0, epsilon = 1e-15);
            }
        }
    }

    #[test]
    fn openings_with_a_height_are_not_flat() {
        assert_eq!(parts(LuminousOpening::Box { x_m: 1.0, y_m: 1.0, height_m: 0.1 }, 4), None);
    }
}
