//! Mean luminance of a luminaire towards a direction: its intensity over its projected luminous area.
//!
//! EN 13032-2:2004 (5.4) and CIE 117-1995 (equation 4.3) define the luminous area as seen from afar. A rectangle with
//! luminous sides counts with its base and the sides that face the direction. EULUMDAT states the height of each side.

use std::f64::consts::PI;

use glam::DVec3;

use super::{Details, HorizontalAxis, LuminousOpening, Photometry, direction};

/// Why a luminaire has no luminance towards a direction.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum NoLuminance {
    /// The opening is a point.
    #[error("the file gives no luminous area: its opening is a point")]
    Point,
    /// The luminous area is seen edge on.
    #[error("the luminous area is seen edge on")]
    EdgeOn,
}

/// A projected area below this fraction of the surface of the bounding box is seen edge on.
const EDGE_ON_FRACTION: f64 = 1e-9;

impl LuminousOpening {
    /// The projected area in m2 as seen from afar in a unit direction of the luminaire's frame.
    pub fn projected_area_m2(&self, towards: DVec3) -> f64 {
        let d = towards.abs();
        match *self {
            Self::Point => 0.0,
            Self::Box { x_m, y_m, height_m } => d.z * x_m * y_m + height_m * (d.x * y_m + d.y * x_m),
            Self::Ellipse { x_m, y_m, height_m } => {
                // The side of a cylinder projects to its width across the line of sight times its height.
                let width = (d.x * y_m).hypot(d.y * x_m);
                0.25 * PI * x_m * y_m * d.z + height_m * width
            }
            Self::Ellipsoid { x_m, y_m, z_m } => {
                0.25 * PI * DVec3::new(d.x * y_m * z_m, d.y * x_m * z_m, d.z * x_m * y_m).length()
            }
            Self::LyingCylinder { axis, length_m, diameter_m } => {
                let along = if axis == HorizontalAxis::X { d.x } else { d.y };
                let ends = 0.25 * PI * diameter_m * diameter_m * along;
                ends + length_m * diameter_m * (1.0 - along * along).max(0.0).sqrt()
            }
        }
    }
}

impl Photometry {
    /// The luminous area in m2 as seen from afar at (C, gamma) in degrees.
    pub fn projected_area_m2(&self, c_deg: f64, gamma_deg: f64) -> f64 {
        let d = direction(c_deg, gamma_deg);
        if let (Details::Eulumdat(details), LuminousOpening::Box { x_m, y_m, .. }) = (&self.details, self.opening) {
            let [c0, c90, c180, c270] = details.luminous_heights_mm.map(|mm| mm / 1000.0);
            let (facing_x, facing_y) = (if d.x >= 0.0 { c0 } else { c180 }, if d.y >= 0.0 { c90 } else { c270 });
            return d.z.abs() * x_m * y_m + d.x.abs() * y_m * facing_x + d.y.abs() * x_m * facing_y;
        }
        self.opening.projected_area_m2(d)
    }

    /// Mean luminance in cd/m2 towards (C, gamma) in degrees.
    pub fn luminance_cd_per_m2(&self, c_deg: f64, gamma_deg: f64) -> Result<f64, NoLuminance> {
        let [width, length, height] = self.opening.bounding_box_m();
        let largest = width * length + height * (width + length);
        if largest <= 0.0 {
            return Err(NoLuminance::Point);
        }
        let area = self.projected_area_m2(c_deg, gamma_deg);
        if area <= EDGE_ON_FRACTION * largest {
            return Err(NoLuminance::EdgeOn);
        }
        Ok(self.distribution.intensity(c_deg, gamma_deg).value() / area)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::LuminousIntensityDistribution;
    use approx::assert_relative_eq;

    /// Twice the area of a triangle, positive counter-clockwise.
    fn cross(o: [f64; 2], a: [f64; 2], b: [f64; 2]) -> f64 {
        (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0])
    }

    /// One half of the convex hull of sorted points, without its last point (Andrew's monotone chain).
    fn half_hull(points: impl Iterator<Item = [f64; 2]>) -> Vec<[f64; 2]> {
        let mut hull: Vec<[f64; 2]> = vec![];
        for p in points {
            while hull.len() > 1 && cross(hull[hull.len() - 2], hull[hull.len() - 1], p) <= 0.0 {
                hull.pop();
            }
            hull.push(p);
        }
        hull.pop();
        hull
    }

    /// Area of the shadow of a convex body along a direction, given points of its surface.
    fn shadow_m2(points: &[DVec3], along: DVec3) -> f64 {
        let u = along.any_orthonormal_vector();
        let v = along.cross(u);
        // The shadow of a convex body is the convex hull of the projected points.
        let mut flat: Vec<[f64; 2]> = points.iter().map(|p| [p.dot(u), p.dot(v)]).collect();
        flat.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
        let mut hull = half_hull(flat.iter().copied());
        hull.extend(half_hull(flat.iter().rev().copied()));
        let doubled: f64 = (0..hull.len())
            .map(|k| {
                let (a, b) = (hull[k], hull[(k + 1) % hull.len()]);
                a[0] * b[1] - a[1] * b[0]
            })
            .sum();
        0.5 * doubled
    }

    fn ring(count: u32) -> impl Iterator<Item = (f64, f64)> {
        (0..count).map(move |k| (f64::from(k) * std::f64::consts::TAU / f64::from(count)).sin_cos())
    }

    #[test]
    fn projected_areas_are_those_of_shadows() {
        let (x, y, z) = (0.6, 0.25, 0.1);
        let boxes: Vec<DVec3> = [-0.5, 0.5]
            .iter()
            .flat_map(|a| {
                [-0.5, 0.5].iter().flat_map(move |b| [-0.5, 0.5].map(move |c| DVec3::new(a * x, b * y, c * z)))
            })
            .collect();
        let upright: Vec<DVec3> =
            ring(2000).flat_map(|(s, c)| [-0.5, 0.5].map(|h| DVec3::new(0.5 * x * c, 0.5 * y * s, h * z))).collect();
        let lying: Vec<DVec3> =
            ring(2000).flat_map(|(s, c)| [-0.5, 0.5].map(|h| DVec3::new(0.5 * z * c, h * x, 0.5 * z * s))).collect();
        let ball: Vec<DVec3> = ring(600)
            .flat_map(|(s, c)| ring(600).map(move |(t, u)| DVec3::new(0.5 * x * s * u, 0.5 * y * s * t, 0.5 * z * c)))
            .collect();
        for (opening, points) in [
            (LuminousOpening::Box { x_m: x, y_m: y, height_m: z }, boxes),
            (LuminousOpening::Ellipse { x_m: x, y_m: y, height_m: z }, upright),
            (LuminousOpening::LyingCylinder { axis: HorizontalAxis::Y, length_m: x, diameter_m: z }, lying),
            (LuminousOpening::Ellipsoid { x_m: x, y_m: y, z_m: z }, ball),
        ] {
            for (c, g) in [(0.0, 0.0), (0.0, 65.0), (30.0, 45.0), (90.0, 85.0), (200.0, 90.0)] {
                let towards = direction(c, g);
                let found = opening.projected_area_m2(towards);
                assert_relative_eq!(found, shadow_m2(&points, towards), max_relative = 2e-4);
            }
        }
    }

    #[test]
    fn a_lambertian_panel_is_as_bright_from_everywhere() {
        let gamma: Vec<f64> = (0..=90).map(f64::from).collect();
        let candela = gamma.iter().map(|g| 400.0 * g.to_radians().cos()).collect();
        let table = LuminousIntensityDistribution::axial(gamma, candela).unwrap();
        let opening = LuminousOpening::Box { x_m: 0.6, y_m: 0.5, height_m: 0.0 };
        let panel = Photometry { opening, ..Photometry::of(table.clone()) };
        for (c, g) in [(0.0, 45.0), (45.0, 65.0), (90.0, 85.0)] {
            assert_relative_eq!(panel.luminance_cd_per_m2(c, g).unwrap(), 400.0 / 0.3, max_relative = 1e-9);
        }
        assert_eq!(panel.luminance_cd_per_m2(0.0, 90.0), Err(NoLuminance::EdgeOn));
        assert_eq!(Photometry::of(table).luminance_cd_per_m2(0.0, 45.0), Err(NoLuminance::Point));
    }
}
