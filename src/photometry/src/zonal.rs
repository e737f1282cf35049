//! Zonal lumens by zonal constants, the method of laboratories.
//!
//! IES LM-41-14 section 9 and the IES Lighting Handbook (9th ed., chapter 2): the flux of a zone is the mean intensity at
//! its middle times its zonal constant 2 pi (cos a - cos b). The method uses tabulated angles only.

use super::{Goniometer, LuminousIntensityDistribution};
use crate::units::Lumen;

/// An angle of the table within this distance in degrees counts as the middle of a zone.
const MIDDLE_TOLERANCE_DEG: f64 = 1e-6;

/// Flux of zones of equal width from the nadir to the zenith, by zonal constants.
#[derive(Clone, Debug, PartialEq)]
pub struct MidZoneFlux {
    /// Width of each zone in degrees: 5 where the table has the middle of every such zone, else 10.
    pub width_deg: f64,
    lumens: Vec<f64>,
}

/// Why a table has no zonal lumens by zonal constants.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("the table has no angle at gamma {missing_deg}, the middle of a zone of 10 degrees")]
pub struct NoMidZones {
    /// The first missing middle.
    pub missing_deg: f64,
}

impl MidZoneFlux {
    /// Flux between two multiples of 10 degrees.
    pub fn between(&self, from_deg: f64, to_deg: f64) -> Lumen {
        let from = self.zone_index(from_deg);
        let to = self.zone_index(to_deg).max(from);
        Lumen(self.lumens[from..to].iter().sum())
    }

    /// The index of the zone that begins at an angle.
    fn zone_index(&self, deg: f64) -> usize {
        ((deg / self.width_deg).round().max(0.0) as usize).min(self.lumens.len())
    }
}

impl LuminousIntensityDistribution {
    /// Zonal flux by the zonal constants of LM-41. It reproduces the printed figures of laboratories and is not exact.
    ///
    /// The table must have the middle of every zone with light.
    pub fn mid_zone_flux(&self) -> Result<MidZoneFlux, NoMidZones> {
        self.flux_in_zones(5.0).or_else(|_| self.flux_in_zones(10.0))
    }

    /// Zonal flux in zones of this width.
    fn flux_in_zones(&self, width_deg: f64) -> Result<MidZoneFlux, NoMidZones> {
        // Type B has no rows of constant gamma.
        if self.goniometer() == Goniometer::B {
            return Err(NoMidZones { missing_deg: 0.5 * width_deg });
        }
        let average = self.azimuth_average();
        let mut lumens = vec![];
        for zone in 0..(180.0 / width_deg) as u32 {
            let limits_deg = [zone, zone + 1].map(|k| width_deg * f64::from(k));
            lumens.push(self.flux_of_mid_zone(&average, limits_deg)?);
        }
        Ok(MidZoneFlux { width_deg, lumens })
    }

    /// Flux of one zone in lumens from the mean intensities over C.
    fn flux_of_mid_zone(&self, average: &[f64], [low, high]: [f64; 2]) -> Result<f64, NoMidZones> {
        let gamma_deg = self.gamma_deg();
        let (first, last) = (gamma_deg[0], gamma_deg[gamma_deg.len() - 1]);
        let middle = f64::midpoint(low, high);
        let is_outside = middle < first - MIDDLE_TOLERANCE_DEG || middle > last + MIDDLE_TOLERANCE_DEG;
        // A zone without light needs no tabulated angle.
        if is_outside || self.flux_between(low, high).value() == 0.0 {
            return Ok(0.0);
        }
        let near = gamma_deg.partition_point(|g| *g < middle - MIDDLE_TOLERANCE_DEG);
        let is_tabulated = gamma_deg.get(near).is_some_and(|g| (g - middle).abs() <= MIDDLE_TOLERANCE_DEG);
        let constant = std::f64::consts::TAU * (low.to_radians().cos() - high.to_radians().cos());
        is_tabulated.then(|| average[near] * constant).ok_or(NoMidZones { missing_deg: middle })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn cosine(step: f64, last: f64) -> LuminousIntensityDistribution {
        let gamma: Vec<f64> = (0..=(last / step) as u32).map(|k| step * f64::from(k)).collect();
        let candela = gamma.iter().map(|g| 1000.0 * g.to_radians().cos().max(0.0)).collect();
        LuminousIntensityDistribution::axial(gamma, candela).unwrap()
    }

    #[test]
    fn the_zonal_constants_are_those_of_the_handbook() {
        // IES Lighting Handbook, zonal constants for 10 degree zones: .095, .283, .463, .628, .774, .897, .993, 1.058, 1.091.
        let even = LuminousIntensityDistribution::axial(
            vec![0.0, 5.0, 15.0, 25.0, 35.0, 45.0, 55.0, 65.0, 75.0, 85.0, 90.0],
            vec![1.0; 11],
        )
        .unwrap();
        let flux = even.mid_zone_flux().unwrap();
        for (zone, printed) in [0.095, 0.283, 0.463, 0.628, 0.774, 0.897, 0.993, 1.058, 1.091].into_iter().enumerate() {
            let from = 10.0 * zone as f64;
            let found = flux.between(from, from + 10.0).value();
            assert!((found - printed).abs() < 5.1e-4, "{from}: {found}");
        }
        assert_eq!(flux.between(90.0, 180.0), Lumen(0.0));
    }

    #[test]
    fn a_cosine_gains_what_mid_zones_gain() {
        // Exact: 1000 pi sin^2. By mid zones each zone has cos m 2 (sin m sin w): 1000 pi sin 2m sin w, w half a zone.
        let flux = cosine(5.0, 90.0).mid_zone_flux().unwrap();
        assert_eq!(flux.width_deg, 10.0);
        let expected: f64 = [5f64, 15.0, 25.0]
            .map(|m| {
                2000.0
                    * std::f64::consts::PI
                    * m.to_radians().cos()
                    * 2.0
                    * m.to_radians().sin()
                    * 5f64.to_radians().sin()
            })
            .into_iter()
            .sum();
        assert_relative_eq!(flux.between(0.0, 30.0).value(), expected, max_relative = 1e-12);
        let exact = 250.0 * std::f64::consts::PI;
        assert!(flux.between(0.0, 30.0).value() > 1.001 * exact);
        assert_eq!(cosine(2.5, 90.0).mid_zone_flux().unwrap().width_deg, 5.0);
    }

    #[test]
    fn a_table_without_the_middles_says_which_is_missing() {
        let dark_above = LuminousIntensityDistribution::axial(
            vec![0.0, 5.0, 15.0, 20.0, 90.0, 180.0],
            vec![9.0, 9.0, 9.0, 0.0, 0.0, 0.0],
        );
        assert!(dark_above.unwrap().mid_zone_flux().is_ok());
        assert_eq!(cosine(10.0, 90.0).mid_zone_flux(), Err(NoMidZones { missing_deg: 5.0 }));
        let gamma = vec![0.0, 5.0, 15.0, 30.0];
        let odd = LuminousIntensityDistribution::axial(gamma, vec![1.0; 4]).unwrap();
        assert_eq!(odd.mid_zone_flux(), Err(NoMidZones { missing_deg: 25.0 }));
    }
}
