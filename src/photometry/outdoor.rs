//! Zonal flux of outdoor luminaires: the solid angles of the Luminaire Classification System, inputs of BUG ratings.
//!
//! ANSI/IES TM-15-20: forward and back light in four zones of gamma each, uplight in two. C = 0 is taken to point across
//! the street, away from the house side, as LM-63 has it for roadway luminaires.

use super::{Goniometer, LuminousIntensityDistribution};
use crate::units::Lumen;

/// Limits of the four zones below the horizontal and the two above it, in degrees of gamma.
const DOWNWARD_DEG: [f64; 5] = [0.0, 30.0, 60.0, 80.0, 90.0];
const UPWARD_DEG: [f64; 3] = [90.0, 100.0, 180.0];

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
        let half = |from_c_deg: f64| {
            if let Some([c, gamma]) = self.half_space(from_c_deg) {
                return std::array::from_fn(|k| {
                    Lumen(self.flux_of_zone([DOWNWARD_DEG[k], DOWNWARD_DEG[k + 1]], c, gamma))
                });
            }
            let half = self.sector_average(from_c_deg, from_c_deg + 180.0);
            std::array::from_fn(|k| 0.5 * half.flux_between(DOWNWARD_DEG[k], DOWNWARD_DEG[k + 1]))
        };
        ClassificationZones {
            forward: half(forward_c_deg - 90.0),
            back: half(forward_c_deg + 90.0),
            up: std::array::from_fn(|k| self.flux_between(UPWARD_DEG[k], UPWARD_DEG[k + 1])),
        }
    }

    /// Flux in the half of all directions around a plane, from 90 degrees before it to 90 after.
    pub(super) fn flux_of_half(&self, c_deg: f64) -> Lumen {
        if let Some([c, gamma]) = self.half_space(c_deg - 90.0) {
            return Lumen(self.flux_of_zone([0.0, 180.0], c, gamma));
        }
        0.5 * self.sector_average(c_deg - 90.0, c_deg + 90.0).flux()
    }

    /// The table's own angles, of type B, of half of all directions from a plane of C on that is a multiple of 90 degrees.
    fn half_space(&self, from_c_deg: f64) -> Option<[[f64; 2]; 2]> {
        let (all_c, all_gamma) = ([-180.0, 180.0], [0.0, 180.0]);
        if self.goniometer() != Goniometer::B {
            return None;
        }
        // Along x lie positive V, along y negative H.
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
        let turns = |c: &f64| [-360.0, 0.0, 360.0].map(|turn| c + turn);
        let mut limits: Vec<f64> = full.c_deg().iter().flat_map(turns).collect();
        limits.retain(|c| *c > from_c_deg && *c < to_c_deg);
        limits.extend([from_c_deg, to_c_deg]);
        limits.sort_by(f64::total_cmp);
        limits.dedup();
        let mean = |g: &f64| {
            // Linear between limits: the trapezoid rule is exact.
            let parts = limits.windows(2).map(|c| {
                let ends = full.intensity(c[0], *g).value() + full.intensity(c[1], *g).value();
                0.5 * (c[1] - c[0]) * ends
            });
            parts.sum::<f64>() / (to_c_deg - from_c_deg)
        };
        let candela = full.gamma_deg().iter().map(mean).collect();
        Self::of_average(full.gamma_deg().to_vec(), candela)
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

    /// A table without symmetry, whose planes miss 90 and 270 degrees.
    fn lopsided() -> LuminousIntensityDistribution {
        let c_deg = vec![0.0, 70.0, 130.0, 200.0, 310.0, 360.0];
        let row = |k: usize| [50.0 + 7.0 * (k % 5) as f64, 80.0 - 9.0 * (k % 5) as f64, 20.0, 5.0];
        let candela = (0..6).flat_map(row).collect();
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
        for (k, limits) in DOWNWARD_DEG.windows(2).enumerate() {
            let exact = std::f64::consts::PI * (limits[0].to_radians().cos() - limits[1].to_radians().cos());
            assert_relative_eq!(zones.forward[k].value(), exact, max_relative = 1e-13);
            assert_relative_eq!(zones.back[k].value(), exact, max_relative = 1e-13);
        }
    }

    #[test]
    fn light_thrown_across_the_street_is_forward_light() {
        let c_deg: Vec<f64> = (0..=36).map(|k| 10.0 * f64::from(k)).collect();
        let across = |c: &f64| c.to_radians().cos().max(0.0);
        let candela = c_deg.iter().flat_map(|c| [across(c), across(c), 0.0]).collect();
        let table = LuminousIntensityDistribution::new(c_deg, vec![0.0, 89.0, 90.0], candela).unwrap();
        let zones = table.classification_zones(0.0);
        assert_relative_eq!(zones_sum(&zones), zones.forward.iter().map(|f| f.value()).sum(), max_relative = 1e-13);
        let turned = table.classification_zones(180.0);
        assert_relative_eq!(turned.back[1].value(), zones.forward[1].value(), max_relative = 1e-13);
    }
}
