//! What lighting designers ask of a luminous intensity distribution: angles, flux codes, spacing, hidden symmetry.

use glam::DVec3;

use super::{LuminousIntensityDistribution, Symmetry};
use crate::units::{Candela, Lumen};

/// Cones of CIE 52-1982 about the nadir that hold pi/2, pi, 3 pi/2 and 2 pi steradians, in degrees from the nadir.
const FLUX_CODE_CONES_DEG: [f64; 4] = [41.409_622_109_270_86, 60.0, 75.522_487_814_070_08, 90.0];

impl LuminousIntensityDistribution {
    /// Full angle, in degrees, within which the plane C and its opposite reach `fraction` of `reference`.
    ///
    /// Counted outwards from the nadir, or from the zenith for a luminaire that shines upward more than down, to the
    /// first angle at which the intensity falls below on each side. CIE 121: fraction 0.5 is the beam angle; IES: 0.1
    /// is the field angle; both of the largest intensity. `None` where the pole itself is darker than that.
    pub fn angle_within(&self, c_deg: f64, fraction: f64, reference: Candela) -> Option<f64> {
        let up = self.flux_between(90.0, 180.0) > self.flux_between(0.0, 90.0);
        let least = fraction * reference.value();
        let side = |c: f64| {
            let at = |theta: f64| self.intensity(c, if up { 180.0 - theta } else { theta }).value();
            let nodes = self.gammas_of_half_planes().into_iter().map(|g| if up { 180.0 - g } else { g });
            first_below(nodes.collect(), least, at)
        };
        Some(side(c_deg)? + side(c_deg + 180.0)?)
    }

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

    /// Spacing criterion in plane C: the spacing over mounting height at which the illuminance midway between two
    /// luminaires equals that below one of them alone (IES Lighting Handbook): I(g) cos^3 g = I(0) / 2, 2 tan g.
    ///
    /// `None` where there is no light at the nadir.
    pub fn spacing_criterion(&self, c_deg: f64) -> Option<f64> {
        let nadir = self.intensity(c_deg, 0.0).value();
        if nadir <= 0.0 {
            return None;
        }
        let at = |g: f64| self.intensity(c_deg, g).value() * g.to_radians().cos().powi(3);
        // cos^3 bends between nodes of the table: half a degree is finer than any table.
        let nodes = (0..=180).map(|k| 0.5 * f64::from(k)).collect();
        first_below(nodes, 0.5 * nadir, at).map(|g| 2.0 * g.to_radians().tan())
    }

    /// The symmetry that the values have, whatever the planes that store them: the smallest part of the circle from
    /// which the rest follows to within `tolerance` (a fraction of the largest intensity).
    pub fn detected_symmetry(&self, tolerance: f64) -> Symmetry {
        let allowed = tolerance * self.max_intensity().value();
        if self.is_native() {
            return self.detected_at_nodes(allowed);
        }
        let full = self.full_circle();
        let holds = |image: &dyn Fn(f64) -> f64| {
            let same = |c: f64, g: f64| (self.intensity(c, g) - self.intensity(image(c), g)).value().abs() <= allowed;
            // Both sides of the mirror are linear between the nodes and their images.
            full.c_deg().iter().all(|&c| full.gamma_deg().iter().all(|&g| same(c, g)))
        };
        let (about_c0, about_c90) = (holds(&|c| 360.0 - c), holds(&|c| 180.0 - c));
        if full.c_deg().iter().all(|&plane| {
            let first = self.gamma_deg().iter().map(|&g| self.intensity(0.0, g).value());
            first.zip(self.gamma_deg()).all(|(i, &g)| (self.intensity(plane, g).value() - i).abs() <= allowed)
        }) {
            return Symmetry::Axial;
        }
        Symmetry::of_mirrors(about_c0, about_c90)
    }
}

impl LuminousIntensityDistribution {
    /// The same of a table of type A or B, whose nodes are the images of one another.
    fn detected_at_nodes(&self, allowed: f64) -> Symmetry {
        let nodes: Vec<DVec3> = self.node_directions().collect();
        let most = self.max_intensity().value();
        let off = |d: DVec3, other: DVec3| (self.intensity_towards(d) - self.intensity_towards(other)).value().abs();
        let holds = |image: DVec3| nodes.iter().all(|d| off(*d, image * *d) <= allowed);
        let (about_c0, about_c90) = (holds(DVec3::new(1.0, -1.0, 1.0)), holds(DVec3::new(-1.0, 1.0, 1.0)));
        let is_even = nodes.iter().all(|d| most - self.intensity_towards(*d).value() <= allowed);
        if is_even && self.edge_intensity().value() <= allowed {
            return Symmetry::Axial;
        }
        Symmetry::of_mirrors(about_c0, about_c90)
    }
}

impl Symmetry {
    const fn of_mirrors(about_c0: bool, about_c90: bool) -> Self {
        match (about_c0, about_c90) {
            (true, true) => Self::Quadrant,
            (true, false) => Self::BilateralC0,
            (false, true) => Self::BilateralC90,
            (false, false) => Self::None,
        }
    }
}

/// The first angle, from 0 outwards, at which a function falls below `least`; linear between its nodes.
///
/// 180 where it never does, `None` where it starts below.
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
    // Beyond the last node a table that ends short of the pole is dark.
    Some(if before.0 < 180.0 && at(f64::midpoint(before.0, 180.0)) < least { before.0 } else { 180.0 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    /// Intensity cos^n of gamma, in tenths of a degree.
    fn cosine(power: i32) -> LuminousIntensityDistribution {
        let gamma: Vec<f64> = (0..=900).map(|k| f64::from(k) / 10.0).collect();
        let candela = gamma.iter().map(|g| g.to_radians().cos().max(0.0).powi(power)).collect();
        LuminousIntensityDistribution::axial(gamma, candela).unwrap()
    }

    #[test]
    fn beam_and_field_of_a_cosine_are_where_it_reaches_a_half_and_a_tenth() {
        let lambert = cosine(1);
        let within = |fraction| lambert.angle_within(0.0, fraction, Candela(1.0)).unwrap();
        assert_relative_eq!(within(0.5), 120.0, max_relative = 1e-6);
        assert_relative_eq!(within(0.1), 2.0 * 0.1f64.acos().to_degrees(), max_relative = 1e-6);
        assert_eq!(lambert.angle_within(0.0, 1.5, Candela(1.0)), None);
    }

    #[test]
    fn an_uplight_has_its_beam_about_the_zenith() {
        let up = LuminousIntensityDistribution::axial(vec![90.0, 170.0, 180.0], vec![0.0, 100.0, 100.0]).unwrap();
        assert_relative_eq!(up.angle_within(0.0, 0.5, Candela(100.0)).unwrap(), 100.0, max_relative = 1e-12);
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

    #[test]
    fn spacing_criterion_of_cosine_powers_has_a_closed_form() {
        for power in [0, 1, 4] {
            let gamma = 0.5f64.powf(1.0 / f64::from(power + 3)).acos();
            let found = cosine(power).spacing_criterion(0.0).unwrap();
            assert_relative_eq!(found, 2.0 * gamma.tan(), max_relative = 1e-4);
        }
    }

    #[test]
    fn symmetry_is_seen_in_planes_written_out() {
        let table = |c: Vec<f64>| {
            let candela = c.iter().flat_map(|c| [100.0, 100.0 + c, 100.0]).collect();
            LuminousIntensityDistribution::new(c, vec![0.0, 45.0, 180.0], candela).unwrap()
        };
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
