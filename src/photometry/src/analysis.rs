//! Figures of a luminous intensity distribution for lighting designers: flux codes, zones, detected symmetry.

use glam::DVec3;

use super::{LuminousIntensityDistribution, Symmetry};
use crate::units::Lumen;

/// Cones of CIE 52-1982 about the nadir that hold pi/2, pi, 3 pi/2 and 2 pi steradians, in degrees from the nadir.
const FLUX_CODE_CONES_DEG: [f64; 4] = [41.409_622_109_270_86, 60.0, 75.522_487_814_070_08, 90.0];

impl LuminousIntensityDistribution {
    /// CIE flux code N1 to N5 in percent (CIE 52-1982): shares of the downward flux within cones of pi/2, pi and
    /// 3 pi/2 steradians, downward share of the luminaire's flux, and the luminaire's flux over that of its lamps.
    ///
    /// `lamp_lumens` is the luminaire's own flux for absolute photometry. `None` without downward flux.
    pub fn cie_flux_code(&self, lamp_lumens: Lumen) -> Option<[f64; 5]> {
        let [a, b, c, down] = FLUX_CODE_CONES_DEG.map(|cone| self.flux_between(0.0, cone));
        let flux = self.flux();
        (down.value() > 0.0 && lamp_lumens.value() > 0.0)
            .then(|| [a / down, b / down, c / down, down / flux, flux / lamp_lumens].map(|ratio| 100.0 * ratio))
    }

    /// Flux in each of the zones between rising gamma angles in degrees.
    pub fn zonal_flux(&self, limits_deg: &[f64]) -> Vec<Lumen> {
        limits_deg.windows(2).map(|zone| self.flux_between(zone[0], zone[1])).collect()
    }

    /// The symmetry of the values, independent of the planes that store them.
    ///
    /// It is the smallest part of the circle from which the rest follows within `tolerance` (a fraction of the largest
    /// intensity).
    pub fn detected_symmetry(&self, tolerance: f64) -> Symmetry {
        let allowed = tolerance * self.max_intensity().value();
        if self.is_native() {
            return self.detected_at_nodes(allowed);
        }
        let full = self.full_circle();
        let planes = full.c_deg();
        if planes.iter().all(|&c| self.are_planes_equal(0.0, c, self.gamma_deg(), allowed)) {
            return Symmetry::Axial;
        }
        // Both sides of a mirror are linear between the nodes and their images: the nodes are enough.
        let about_c0 = planes.iter().all(|&c| self.are_planes_equal(c, 360.0 - c, full.gamma_deg(), allowed));
        let about_c90 = planes.iter().all(|&c| self.are_planes_equal(c, 180.0 - c, full.gamma_deg(), allowed));
        Symmetry::from_mirrors(about_c0, about_c90)
    }

    /// Whether two planes have the same intensities at some gamma angles, within `allowed` candela.
    fn are_planes_equal(&self, a_c_deg: f64, b_c_deg: f64, gamma_deg: &[f64], allowed: f64) -> bool {
        gamma_deg.iter().all(|&g| (self.intensity(a_c_deg, g) - self.intensity(b_c_deg, g)).value().abs() <= allowed)
    }

    /// The symmetry of the values of a type A or B table, from its nodes and their mirror images.
    fn detected_at_nodes(&self, allowed: f64) -> Symmetry {
        let nodes: Vec<DVec3> = self.node_directions().collect();
        let most = self.max_intensity().value();
        let is_even = nodes.iter().all(|d| most - self.intensity_towards(*d).value() <= allowed);
        if is_even && self.edge_intensity().value() <= allowed {
            return Symmetry::Axial;
        }
        let about_c0 = self.has_mirror(&nodes, DVec3::new(1.0, -1.0, 1.0), allowed);
        let about_c90 = self.has_mirror(&nodes, DVec3::new(-1.0, 1.0, 1.0), allowed);
        Symmetry::from_mirrors(about_c0, about_c90)
    }

    /// Whether a mirror of the axes maps every node to an equal intensity, within `allowed` candela.
    fn has_mirror(&self, nodes: &[DVec3], mirror: DVec3, allowed: f64) -> bool {
        nodes
            .iter()
            .all(|d| (self.intensity_towards(*d) - self.intensity_towards(mirror * *d)).value().abs() <= allowed)
    }
}

impl Symmetry {
    /// The symmetry with mirrors in the planes of C 0 and C 90.
    const fn from_mirrors(about_c0: bool, about_c90: bool) -> Self {
        match (about_c0, about_c90) {
            (true, true) => Self::Quadrant,
            (true, false) => Self::BilateralC0,
            (false, true) => Self::BilateralC90,
            (false, false) => Self::None,
        }
    }
}

/// The first angle from 0 outwards at which a function, linear between its nodes, falls below `least`.
///
/// It is 180 where the function never does, `None` where it starts below.
pub(super) fn first_below(mut nodes: Vec<f64>, least: f64, at: impl Fn(f64) -> f64) -> Option<f64> {
    nodes.push(0.0);
    nodes.sort_by(f64::total_cmp);
    nodes.dedup();
    if at(0.0) < least {
        return None;
    }
    let mut before = (0.0, at(0.0));
    for theta in nodes {
        let value = at(theta);
        if value < least {
            let (from, above) = before;
            return Some(from + (theta - from) * (above - least) / (above - value));
        }
        before = (theta, value);
    }
    // A table that ends before the pole is dark beyond its last node.
    Some(if before.0 < 180.0 && at(f64::midpoint(before.0, 180.0)) < least { before.0 } else { 180.0 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::BeamPlane;
    use approx::assert_relative_eq;

    /// Intensity cos^n of gamma, in tenths of a degree.
    fn cosine(power: i32) -> LuminousIntensityDistribution {
        let gamma: Vec<f64> = (0..=900).map(|k| f64::from(k) / 10.0).collect();
        let candela = gamma.iter().map(|g| g.to_radians().cos().max(0.0).powi(power)).collect();
        LuminousIntensityDistribution::axial(gamma, candela).unwrap()
    }

    /// The full width of the beam to a fraction of the peak, in the vertical plane.
    fn width_deg(table: &LuminousIntensityDistribution, fraction: f64) -> f64 {
        table.beam_width(&table.beam().unwrap(), BeamPlane::Vertical, fraction).unwrap().full_deg()
    }

    #[test]
    fn beam_and_field_of_a_cosine_are_where_it_reaches_a_half_and_a_tenth() {
        for (fraction, expected) in [(0.5, 120.0), (0.1, 2.0 * 0.1f64.acos().to_degrees())] {
            assert_relative_eq!(width_deg(&cosine(1), fraction), expected, max_relative = 1e-6);
        }
    }

    #[test]
    fn an_uplight_has_its_beam_about_the_zenith() {
        let up = LuminousIntensityDistribution::axial(vec![90.0, 170.0, 180.0], vec![0.0, 100.0, 100.0]).unwrap();
        assert_relative_eq!(width_deg(&up, 0.5), 100.0, max_relative = 1e-6);
    }

    #[test]
    fn flux_code_of_a_lambertian_source_is_sin_squared() {
        let code = cosine(1).cie_flux_code(Lumen(2.0 * std::f64::consts::PI)).unwrap();
        for (found, cone) in code.into_iter().zip(FLUX_CODE_CONES_DEG) {
            if cone < 90.0 {
                assert_relative_eq!(found, 100.0 * cone.to_radians().sin().powi(2), max_relative = 1e-5);
            }
        }
        assert_relative_eq!(code[3], 100.0, max_relative = 1e-12);
        assert_relative_eq!(code[4], 50.0, max_relative = 1e-5);
        for (cone, steradians) in FLUX_CODE_CONES_DEG.into_iter().zip([0.5, 1.0, 1.5, 2.0]) {
            assert_relative_eq!(2.0 * (1.0 - cone.to_radians().cos()), steradians, max_relative = 1e-14);
        }
    }

    #[test]
    fn zones_add_up_to_the_flux() {
        let table = cosine(3);
        let zones = table.zonal_flux(&(0..=18).map(|k| 10.0 * f64::from(k)).collect::<Vec<_>>());
        assert_relative_eq!(zones.into_iter().sum::<Lumen>().value(), table.flux().value(), max_relative = 1e-13);
    }

    /// A table of these planes, each with a different intensity at gamma 45.
    fn table(c: Vec<f64>) -> LuminousIntensityDistribution {
        let candela = c.iter().flat_map(|c| [100.0, 100.0 + c, 100.0]).collect();
        LuminousIntensityDistribution::new(c, vec![0.0, 45.0, 180.0], candela).unwrap()
    }

    #[test]
    fn symmetry_is_detected_in_the_planes_of_a_full_circle() {
        for planes in
            [vec![0.0, 40.0, 90.0], vec![0.0, 40.0, 180.0], vec![90.0, 100.0, 270.0], vec![0.0, 90.0, 200.0, 360.0]]
        {
            let stored = table(planes);
            let expected = stored.symmetry();
            assert_eq!(stored.full_circle().detected_symmetry(1e-12), expected);
            assert_eq!(stored.detected_symmetry(1e-12), expected);
        }
        assert_eq!(cosine(2).full_circle().detected_symmetry(1e-12), Symmetry::Axial);
    }
}
