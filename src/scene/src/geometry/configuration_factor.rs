//! Configuration factors: how much of what a receiving element sees a uniformly diffuse rectangle or polygon fills.
//!
//! A surface of exitance M that fills the configuration factor c of an element gives it E = c M. Lambert,
//! *Photometria* (1760); Moon, *The Scientific Basis of Illuminating Engineering* (1936); Howell, *A Catalog of
//! Radiation Heat Transfer Configuration Factors*, B-3, B-4, C-11 and C-14.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::DVec3;

/// A polygon with corners that rise above an element's plane by less than this part of their distance lies in it.
const IN_PLANE: f64 = 1e-12;

/// Factor from an element at `point_m` of unit `normal` to a flat polygon, either winding, clipped at the horizon.
///
/// A polygon in the element's own plane is not seen, although Lambert's formula gives 1 inside of it.
///
/// Lambert's formula, c = 1/2π Σ θ (Γ · n): θ is the angle that an edge subtends and Γ the unit normal of the plane
/// through the edge and the element. Angles come from `atan2`: `acos` loses ten digits on small patches.
pub fn element_to_polygon(point_m: DVec3, normal: DVec3, polygon_m: &[DVec3]) -> f64 {
    let mut offsets = polygon_m.iter().map(|corner| *corner - point_m);
    if offsets.any(|offset| offset.dot(normal) > IN_PLANE * offset.length()) {
        signed_element_to_polygon(point_m, normal, polygon_m).abs()
    } else {
        0.0
    }
}

/// As [`element_to_polygon`], positive where the polygon turns clockwise as the element sees it.
pub(crate) fn signed_element_to_polygon(point_m: DVec3, normal: DVec3, polygon_m: &[DVec3]) -> f64 {
    let count = polygon_m.len();
    let height = |k: usize| (polygon_m[k] - point_m).dot(normal);
    let mut contour = Contour { normal, sum: 0.0, ends: None };
    for k in 0..count {
        let next = (k + 1) % count;
        let (h, h_next) = (height(k), height(next));
        if h >= 0.0 {
            contour.push(polygon_m[k] - point_m);
        }
        if (h < 0.0) != (h_next < 0.0) {
            let q = polygon_m[k].lerp(polygon_m[next], h / (h - h_next)) - point_m;
            contour.push(q - normal * q.dot(normal));
        }
    }
    contour.close() / TAU
}

/// The sum over the edges of a polygon that is given corner by corner, relative to the element.
struct Contour {
    normal: DVec3,
    sum: f64,
    /// The first corner and the last.
    ends: Option<[DVec3; 2]>,
}

impl Contour {
    #[inline]
    fn push(&mut self, corner: DVec3) {
        if let Some([_, last]) = self.ends {
            self.sum += edge(last, corner, self.normal);
        }
        let first = self.ends.map_or(corner, |[first, _]| first);
        self.ends = Some([first, corner]);
    }

    /// The sum with the edge from the last corner to the first.
    #[inline]
    fn close(self) -> f64 {
        self.ends.map_or(self.sum, |[first, last]| self.sum + edge(last, first, self.normal))
    }
}

/// The subtended angle times the projected edge normal, for edge ends relative to the element.
pub fn edge(a: DVec3, b: DVec3, normal: DVec3) -> f64 {
    let cross = a.cross(b);
    let length = cross.length();
    if length == 0.0 {
        return 0.0;
    }
    angle(length, a.dot(b)) * cross.dot(normal) / length
}

/// `sine.atan2(cosine)` of no negative sine, in half of the time: the quotient is at most 1.
fn angle(sine: f64, cosine: f64) -> f64 {
    if sine < cosine {
        (sine / cosine).atan()
    } else if sine < -cosine {
        PI + (sine / cosine).atan()
    } else {
        FRAC_PI_2 - (cosine / sine).atan()
    }
}

/// Factor from an element to a parallel rectangle `a_m` by `b_m` with one corner straight above it at `height_m`.
///
/// Howell B-3. Other placings follow by signed sums of up to four of these.
pub fn element_to_parallel_rectangle(a_m: f64, b_m: f64, height_m: f64) -> f64 {
    let (ra, rb) = (a_m.hypot(height_m), b_m.hypot(height_m));
    if ra == 0.0 || rb == 0.0 {
        return 0.0;
    }
    (a_m / ra * (b_m / ra).atan() + b_m / rb * (a_m / rb).atan()) / TAU
}

/// Factor from an element to a perpendicular rectangle whose lower edge, `a_m` long, lies in the element's plane.
///
/// Howell B-4: one end of that edge is `distance_m` away in the direction of the rectangle's normal; `height_m` is the
/// rectangle's extent away from the element's plane.
pub fn element_to_perpendicular_rectangle(a_m: f64, height_m: f64, distance_m: f64) -> f64 {
    let slant = height_m.hypot(distance_m);
    if slant == 0.0 {
        return 0.0;
    }
    (a_m.atan2(distance_m) - distance_m / slant * a_m.atan2(slant)) / TAU
}

/// Form factor between equal, directly opposed rectangles `width_m` by `length_m` at `distance_m` (Howell C-11).
pub fn opposed_rectangles(width_m: f64, length_m: f64, distance_m: f64) -> f64 {
    let (x, y) = (width_m / distance_m, length_m / distance_m);
    let (x2, y2) = (1.0 + x * x, 1.0 + y * y);
    let logarithm = 0.5 * (x * x * y * y / (x2 + y2 - 1.0)).ln_1p();
    let angles = x * y2.sqrt() * (x / y2.sqrt()).atan() + y * x2.sqrt() * (y / x2.sqrt()).atan();
    2.0 / (PI * x * y) * (logarithm + angles - x * x.atan() - y * y.atan())
}

/// Form factor from a rectangle to one perpendicular to it along a common edge (Howell C-14).
///
/// The emitting rectangle is `common_m` by `from_depth_m`, the receiving one `common_m` by `to_height_m`.
pub fn adjacent_rectangles(common_m: f64, from_depth_m: f64, to_height_m: f64) -> f64 {
    let (w, h) = (from_depth_m / common_m, to_height_m / common_m);
    let (w2, h2) = (w * w, h * h);
    let s2 = w2 + h2;
    let s = s2.sqrt();
    let logarithms = ((1.0 + w2) * (1.0 + h2) / (1.0 + s2)).ln()
        + w2 * (w2 * (1.0 + s2) / ((1.0 + w2) * s2)).ln()
        + h2 * (h2 * (1.0 + s2) / ((1.0 + h2) * s2)).ln();
    (w * (1.0 / w).atan() + h * (1.0 / h).atan() - s * (1.0 / s).atan() + 0.25 * logarithms) / (PI * w)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn angles_are_those_of_atan2() {
        for k in 0..=3600 {
            let (sine, cosine) = (PI * f64::from(k) / 3600.0).sin_cos();
            for scale in [1e-12, 1.0, 1e9] {
                let (sine, cosine) = (scale * sine.abs(), scale * cosine);
                assert!((angle(sine, cosine) - sine.atan2(cosine)).abs() <= 1e-15, "{sine} {cosine}");
            }
        }
        // Of small angles all digits are kept.
        assert_relative_eq!(angle(3e-200, 2.0), 1.5e-200, max_relative = 1e-15);
    }

    #[test]
    fn polygon_formula_equals_both_rectangle_forms() {
        for (a, b, d) in [(1.0, 2.0, 3.0), (0.1, 5.0, 0.2), (30.0, 40.0, 1.0), (1e-3, 1e-3, 1.0)] {
            let over = [(0.0, 0.0), (a, 0.0), (a, b), (0.0, b)].map(|(x, y)| DVec3::new(x, y, d));
            let polygon = element_to_polygon(DVec3::ZERO, DVec3::Z, &over);
            assert_relative_eq!(polygon, element_to_parallel_rectangle(a, b, d), max_relative = 1e-12);
            let beside = [(0.0, 0.0), (a, 0.0), (a, b), (0.0, b)].map(|(x, z)| DVec3::new(x, d, z));
            let polygon = element_to_polygon(DVec3::ZERO, DVec3::Z, &beside);
            assert_relative_eq!(polygon, element_to_perpendicular_rectangle(a, b, d), max_relative = 1e-9);
        }
    }

    #[test]
    fn a_polygon_in_the_plane_of_the_element_is_not_seen() {
        let flat = |z: f64| [(-1.0, -2.0), (1.0, -2.0), (1.0, 3.0), (-1.0, 3.0)].map(|(x, y)| DVec3::new(x, y, z));
        for inside in [DVec3::ZERO, DVec3::new(0.9, 2.0, 0.0), DVec3::new(5.0, 0.0, 0.0)] {
            assert_eq!(element_to_polygon(inside, DVec3::Z, &flat(0.0)), 0.0);
            assert_eq!(element_to_polygon(inside, DVec3::Z, &flat(-1e-9)), 0.0);
        }
        // A nanometre above the element it fills all that the element sees.
        assert_relative_eq!(element_to_polygon(DVec3::ZERO, DVec3::Z, &flat(1e-9)), 1.0, max_relative = 1e-8);
        // In a tilted plane, to rounding.
        let turn = glam::DMat3::from_rotation_x(0.7);
        let tilted = flat(0.0).map(|corner| turn * corner + DVec3::splat(7.3));
        assert_eq!(element_to_polygon(DVec3::splat(7.3), turn * DVec3::Z, &tilted), 0.0);
    }

    #[test]
    fn a_polygon_that_dips_below_the_horizon_counts_only_above_it() {
        let whole = [(-1.0, -2.0), (1.0, -2.0), (1.0, 3.0), (-1.0, 3.0)].map(|(x, z)| DVec3::new(x, 1.0, z));
        let above = [(-1.0, 0.0), (1.0, 0.0), (1.0, 3.0), (-1.0, 3.0)].map(|(x, z)| DVec3::new(x, 1.0, z));
        let (whole, above) =
            (element_to_polygon(DVec3::ZERO, DVec3::Z, &whole), element_to_polygon(DVec3::ZERO, DVec3::Z, &above));
        assert_relative_eq!(whole, above, max_relative = 1e-14);
        assert!(element_to_polygon(DVec3::ZERO, DVec3::NEG_Z, &[DVec3::Z, DVec3::X + DVec3::Z, DVec3::ONE]) == 0.0);
    }

    #[test]
    fn the_rows_of_a_box_sum_to_one() {
        assert_relative_eq!(opposed_rectangles(1.0, 1.0, 1.0), 0.199825, epsilon = 5e-7);
        assert_relative_eq!(adjacent_rectangles(1.0, 1.0, 1.0), 0.200044, epsilon = 5e-7);
        for (x, y, z) in [(1.0, 1.0, 1.0), (3.0, 4.0, 2.5), (10.0, 1.0, 2.0)] {
            let row =
                opposed_rectangles(x, y, z) + 2.0 * adjacent_rectangles(x, y, z) + 2.0 * adjacent_rectangles(y, x, z);
            assert_relative_eq!(row, 1.0, epsilon = 1e-14);
        }
    }
}
