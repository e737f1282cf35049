//! Zonal flux of outdoor luminaires in the solid angles of the Luminaire Classification System, the input of BUG ratings.
//!
//! ANSI/IES TM-15-20: forward and back light in four zones of gamma each, uplight in two. In LM-63, C = 0 of a roadway
//! luminaire points across the street, away from the houses.

use super::{Goniometer, LuminousIntensityDistribution};
use crate::units::Lumen;

/// Limits of the four zones below the horizontal in degrees of gamma.
const DOWNWARD_LIMITS_DEG: [f64; 5] = [0.0, 30.0, 60.0, 80.0, 90.0];
/// Limits of the two zones above the horizontal in degrees of gamma.
const UPWARD_LIMITS_DEG: [f64; 3] = [90.0, 100.0, 180.0];

/// Flux in the solid angles of the Luminaire Classification System.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClassificationZones {
    /// Forward light: low (0-30 degrees), medium (30-60), high (60-80) and very high (80-90).
    pub forward: [Lumen; 4],
    /// Back light in the same zones.
    pub back: [Lumen; 4],
    /// Uplight: low (90-100 degrees) and high (100-180).
    pub up: [Lumen; 2],
}

impl LuminousIntensityDistribution {
    /// Zonal flux by the Luminaire Classification System; `forward_c_deg` is the plane that points across the street:
    /// 0 in LM-63, 90 in EULUMDAT, where C = 0 runs along it.
    pub fn classification_zones(&self, forward_c_deg: f64) -> ClassificationZones {
        ClassificationZones {
            forward: self.downward_zones_of_half(forward_c_deg - 90.0),
            back: self.downward_zones_of_half(forward_c_deg + 90.0),
            up: std::array::from_fn(|k| self.flux_between(UPWARD_LIMITS_DEG[k], UPWARD_LIMITS_DEG[k + 1])),
        }
    }

    /// Flux in the zones below the horizontal, in the half of all directions that begins at a plane.
    fn downward_zones_of_half(&self, from_c_deg: f64) -> [Lumen; 4] {
        let zone_deg = |k: usize| [DOWNWARD_LIMITS_DEG[k], DOWNWARD_LIMITS_DEG[k + 1]];
        if let Some([c, gamma]) = self.half_space(from_c_deg) {
            return std::array::from_fn(|k| Lumen(self.flux_of_zone(zone_deg(k), c, gamma)));
        }
        let half = self.sector_average(from_c_deg, from_c_deg + 180.0);
        std::array::from_fn(|k| 0.5 * half.flux_between(zone_deg(k)[0], zone_deg(k)[1]))
    }

    /// Flux in the half of all directions around a plane, from 90 degrees before it to 90 after.
    pub(super) fn flux_of_half(&self, c_deg: f64) -> Lumen {
        if let Some([c, gamma]) = self.half_space(c_deg - 90.0) {
            return Lumen(self.flux_of_zone([0.0, 180.0], c, gamma));
        }
        0.5 * self.sector_average(c_deg - 90.0, c_deg + 90.0).flux()
    }

    /// The native angles of half of all directions from a C plane on; `None` except for type B and multiples of 90 degrees.
    fn half_space(&self, from_c_deg: f64) -> Option<[[f64; 2]; 2]> {
        let (all_c, all_gamma) = ([-180.0, 180.0], [0.0, 180.0]);
        if self.goniometer() != Goniometer::B {
            return None;
        }
        // Positive V lies along x, negative H along y.
        match from_c_deg.rem_euclid(360.0) {
            270.0 => Some([[0.0, 180.0], all_gamma]),
            90.0 => Some([[-180.0, 0.0], all_gamma]),
            0.0 => Some([all_c, [0.0, 90.0]]),
            180.0 => Some([all_c, [90.0, 180.0]]),
            _ => None,
        }
    }

    /// The axial distribution of the mean intensity between two C angles, exact for the bilinear interpolation.
    fn sector_average(&self, from_c_deg: f64, to_c_deg: f64) -> Self {
        let full = self.full_circle();
        let planes = full.c_deg().iter();
        let mut limits: Vec<f64> = planes.flat_map(|c| [-360.0, 0.0, 360.0].map(|turn| c + turn)).collect();
        limits.retain(|c| *c > from_c_deg && *c < to_c_deg);
        limits.extend([from_c_deg, to_c_deg]);
        limits.sort_by(f64::total_cmp);
        limits.dedup();
        let integrals = full.gamma_deg().iter().map(|g| full.integral_over_c(&limits, *g));
        let candela = integrals.map(|integral| integral / (to_c_deg - from_c_deg)).collect();
        Self::from_average(full.gamma_deg().to_vec(), candela)
    }

    /// Integral of the intensity over C at a gamma, between limits that contain all planes in between.
    fn integral_over_c(&self, limits_deg: &[f64], gamma_deg: f64) -> f64 {
        // The intensity is linear between the limits: the trapezoid rule is exact.
        let parts = limits_deg.windows(2).map(|c| {
            let ends = self.intensity(c[0], gamma_deg).value() + self.intensity(c[1], gamma_deg).value();
            0.5 * (c[1] - c[0]) * ends
        });
        parts.sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn zones_sum(zones: &ClassificationZones) -> f64 {
        let all = zones.forward.iter().chain(&zones.back).chain(&zones.up);
        all.map(|flux| flux.value()).sum()
    }

    /// A table without symmetry and without planes at 90 and 270 degrees.
    fn lopsided() -> LuminousIntensityDistribution {
        let c_deg = vec![0.0, 70.0, 130.0, 200.0, 310.0, 360.0];
        let planes = (0..6).map(|k| f64::from(k % 5));
        let candela = planes.flat_map(|k| [50.0 + 7.0 * k, 80.0 - 9.0 * k, 20.0, 5.0]).collect();
        LuminousIntensityDistribution::new(c_deg, vec![0.0, 45.0, 95.0, 180.0], candela).unwrap()
    }

    #[test]
    fn zones_add_up_to_the_flux_whichever_way_forward_is() {
        let table = lopsided();
        for forward_c_deg in [0.0, 90.0, 123.0] {
            let sum = zones_sum(&table.classification_zones(forward_c_deg));
            assert_relative_eq!(sum, table.flux().value(), max_relative = 1e-13);
        }
    }

    #[test]
    fn an_even_source_has_half_of_each_zone_forward() {
        let even = LuminousIntensityDistribution::axial(vec![0.0, 180.0], vec![1.0; 2]).unwrap();
        let zones = even.classification_zones(0.0);
        for (k, limits) in DOWNWARD_LIMITS_DEG.windows(2).enumerate() {
            let exact = std::f64::consts::PI * (limits[0].to_radians().cos() - limits[1].to_radians().cos());
            assert_relative_eq!(zones.forward[k].value(), exact, max_relative = 1e-13);
            assert_relative_eq!(zones.back[k].value(), exact, max_relative = 1e-13);
        }
    }

    #[test]
    fn light_thrown_across_the_street_is_forward_light() {
        let c_deg: Vec<f64> = (0..=36).map(|k| 10.0 * f64::from(k)).collect();
        let across = c_deg.iter().map(|c| c.to_radians().cos().max(0.0));
        let candela = across.flat_map(|candela| [candela, candela, 0.0]).collect();
        let table = LuminousIntensityDistribution::new(c_deg, vec![0.0, 89.0, 90.0], candela).unwrap();
        let zones = table.classification_zones(0.0);
        assert_relative_eq!(zones_sum(&zones), zones.forward.iter().map(|f| f.value()).sum(), max_relative = 1e-13);
        let turned = table.classification_zones(180.0);
        assert_relative_eq!(turned.back[1].value(), zones.forward[1].value(), max_relative = 1e-13);
    }
}
