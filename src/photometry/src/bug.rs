//! BUG ratings of outdoor luminaires: backlight, uplight and glare from 0 to 5.
//!
//! IES TM-15-11, addendum A, tables: a rating is the lowest one with limits that hold in all of its zones.

use super::{ClassificationZones, Goniometer, LuminousIntensityDistribution, Symmetry};
use crate::units::Lumen;

/// Largest flux in lumens for ratings 0 to 4; beyond the last limit the rating is 5.
type Limits = [f64; 5];

/// Table A-1: back light of 0-30 and 60-80 degrees.
const BACK_LOW_AND_HIGH: Limits = [110.0, 500.0, 1000.0, 2500.0, 5000.0];
/// Table A-1: back light of 30-60 degrees.
const BACK_MEDIUM: Limits = [220.0, 1000.0, 2500.0, 5000.0, 8500.0];
/// Table A-2: light of 90-100 and of 100-180 degrees.
const UP: Limits = [0.0, 10.0, 50.0, 500.0, 1000.0];
/// Table A-3: forward and back light of 80-90 degrees.
const VERY_HIGH: Limits = [10.0, 100.0, 225.0, 500.0, 750.0];
/// Table A-3: forward light of 60-80 degrees, and back light there of quadrilaterally symmetric luminaires.
const FORWARD_HIGH: Limits = [660.0, 1800.0, 5000.0, 7500.0, 12000.0];

/// A smaller fraction of the flux or of the largest intensity is rounding and counts as dark.
const DARK_FRACTION: f64 = 1e-9;
/// The allowed difference within a symmetric luminaire, as a fraction of the largest intensity.
const SYMMETRY_TOLERANCE: f64 = 0.05;

/// The rating of a luminaire.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BugRating {
    /// The zonal flux that decides on the rating.
    pub zones: ClassificationZones,
    /// B.
    pub backlight: u8,
    /// U.
    pub uplight: u8,
    /// G by the columns of asymmetric luminaires, types I to IV.
    pub glare_asymmetric: u8,
    /// G by the columns of quadrilaterally symmetric ones, types V and VS.
    pub glare_symmetric: u8,
    /// Whether the luminaire is the same every 90 degrees of C, within 5 % of the largest intensity: it selects the columns.
    pub is_symmetric: bool,
}

impl BugRating {
    /// G.
    pub fn glare(&self) -> u8 {
        if self.is_symmetric { self.glare_symmetric } else { self.glare_asymmetric }
    }
}

/// Why a luminaire has no BUG rating.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum NoBug {
    /// No light.
    #[error("every intensity is zero")]
    Dark,
    /// The table ends with light before the zenith, so that the uplight is unknown.
    #[error("the table ends at gamma {gamma_deg} with light there, so that it does not say what goes up")]
    CutShort {
        /// The table's last angle.
        gamma_deg: f64,
    },
}

impl LuminousIntensityDistribution {
    /// The BUG rating; `forward_c_deg` as for [`classification_zones`](Self::classification_zones).
    pub fn bug_rating(&self, forward_c_deg: f64) -> Result<BugRating, NoBug> {
        let largest = self.max_intensity().value();
        if largest <= 0.0 {
            return Err(NoBug::Dark);
        }
        if self.goniometer() == Goniometer::B && self.edge_intensity().value() > DARK_FRACTION * largest {
            let nodes = self.nodes_deg().into_iter();
            let lit = nodes.filter(|(c, g)| self.intensity(*c, *g).value() > DARK_FRACTION * largest);
            let highest = lit.map(|(_, gamma)| gamma).fold(0.0, f64::max);
            return Err(NoBug::CutShort { gamma_deg: (100.0 * highest).round() / 100.0 });
        }
        let gamma_deg = self.gamma_deg()[self.gamma_deg().len() - 1];
        // The table of type B is not cut at a gamma: its edge is checked above.
        if self.goniometer() != Goniometer::B
            && gamma_deg < 180.0
            && self.c_deg().iter().any(|c| self.intensity(*c, gamma_deg).value() > DARK_FRACTION * largest)
        {
            return Err(NoBug::CutShort { gamma_deg });
        }
        let zones = self.classification_zones(forward_c_deg);
        let dark = DARK_FRACTION * self.flux();
        let [low, medium, high, _] = zones.back;
        let backlight = [(low, BACK_LOW_AND_HIGH), (medium, BACK_MEDIUM), (high, BACK_LOW_AND_HIGH)];
        Ok(BugRating {
            zones,
            backlight: highest_rating(&backlight, dark),
            uplight: highest_rating(&zones.up.map(|flux| (flux, UP)), dark),
            glare_asymmetric: glare_rating(&zones, BACK_LOW_AND_HIGH, dark),
            glare_symmetric: glare_rating(&zones, FORWARD_HIGH, dark),
            is_symmetric: self.is_equal_each_quarter(),
        })
    }

    /// Whether the intensities repeat every 90 degrees of C, within the tolerance.
    fn is_equal_each_quarter(&self) -> bool {
        if self.symmetry() == Symmetry::Axial {
            return true;
        }
        let allowed = SYMMETRY_TOLERANCE * self.max_intensity().value();
        let full = self.full_circle();
        let mut nodes = full.c_deg().iter().flat_map(|c| full.gamma_deg().iter().map(move |g| (*c, *g)));
        nodes.all(|(c, g)| (full.intensity(c, g) - full.intensity(c + 90.0, g)).value().abs() <= allowed)
    }
}

/// The glare rating, with the limits of back light of 60-80 degrees, which depend on the symmetry.
fn glare_rating(zones: &ClassificationZones, back_high: Limits, dark: Lumen) -> u8 {
    let ([_, _, forward_high, forward_very_high], [_, _, high, very_high]) = (zones.forward, zones.back);
    let very_high = [(forward_very_high, VERY_HIGH), (very_high, VERY_HIGH)];
    highest_rating(&[very_high[0], very_high[1], (forward_high, FORWARD_HIGH), (high, back_high)], dark)
}

/// The highest rating of several zones; `dark` is the flux that counts as none.
fn highest_rating(zones: &[(Lumen, Limits)], dark: Lumen) -> u8 {
    let mut highest = 0;
    for (flux, limits) in zones {
        let rating = limits.iter().filter(|limit| *flux > Lumen(**limit) + dark).count() as u8;
        highest = highest.max(rating);
    }
    highest
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Even light all around between two angles, of a given flux in lumens.
    fn band(from: f64, to: f64, lumens: f64) -> LuminousIntensityDistribution {
        let (from, to) = (from.max(1e-3), to.min(179.0));
        let gamma = vec![0.0, from, from + 1e-6, to - 1e-6, to, 180.0];
        let even = LuminousIntensityDistribution::axial(gamma, vec![0.0, 0.0, 1.0, 1.0, 0.0, 0.0]).unwrap();
        even.scaled(lumens / even.flux().value())
    }

    fn letters(table: &LuminousIntensityDistribution) -> [u8; 3] {
        let rating = table.bug_rating(0.0).unwrap();
        [rating.backlight, rating.uplight, rating.glare()]
    }

    #[test]
    fn each_zone_decides_at_its_own_limits() {
        // Half of an even band is back light, half forward.
        for (from, to, total, expected) in [
            (0.0, 30.0, 2.0 * 109.0, [0, 0, 0]),
            (0.0, 30.0, 2.0 * 111.0, [1, 0, 0]),
            (30.0, 60.0, 2.0 * 219.0, [0, 0, 0]),
            (30.0, 60.0, 2.0 * 8400.0, [4, 0, 0]),
            (30.0, 60.0, 2.0 * 8600.0, [5, 0, 0]),
            (60.0, 80.0, 2.0 * 659.0, [2, 0, 0]),
            (60.0, 80.0, 2.0 * 661.0, [2, 0, 1]),
            (60.0, 80.0, 2.0 * 12100.0, [5, 0, 5]),
            (80.0, 90.0, 2.0 * 9.0, [0, 0, 0]),
            (80.0, 90.0, 2.0 * 230.0, [0, 0, 3]),
            (90.0, 100.0, 9.0, [0, 1, 0]),
            (100.0, 180.0, 51.0, [0, 3, 0]),
            (100.0, 180.0, 1001.0, [0, 5, 0]),
        ] {
            assert_eq!(letters(&band(from, to, total)), expected, "{from}-{to}: {total} lm");
        }
    }

    #[test]
    fn back_light_glares_sooner_where_the_luminaire_has_a_front() {
        let round = band(60.0, 80.0, 2.0 * 600.0).bug_rating(0.0).unwrap();
        assert_eq!((round.glare_symmetric, round.glare_asymmetric, round.is_symmetric), (0, 2, true));
        let one_sided = LuminousIntensityDistribution::new(
            vec![0.0, 90.0, 180.0],
            vec![0.0, 70.0, 90.0, 180.0],
            vec![100.0, 900.0, 0.0, 0.0, 100.0, 500.0, 0.0, 0.0, 100.0, 100.0, 0.0, 0.0],
        )
        .unwrap();
        let rating = one_sided.bug_rating(0.0).unwrap();
        assert!(!rating.is_symmetric && rating.glare() == rating.glare_asymmetric);
        let turned = one_sided.bug_rating(180.0).unwrap();
        assert!(turned.backlight > rating.backlight, "{rating:?} {turned:?}");
    }

    #[test]
    fn a_table_that_ends_in_light_has_no_rating() {
        let cut = LuminousIntensityDistribution::axial(vec![0.0, 90.0], vec![5.0, 1.0]).unwrap();
        assert_eq!(cut.bug_rating(0.0), Err(NoBug::CutShort { gamma_deg: 90.0 }));
        let dark = LuminousIntensityDistribution::axial(vec![0.0, 90.0], vec![0.0; 2]).unwrap();
        assert_eq!(dark.bug_rating(0.0), Err(NoBug::Dark));
    }
}
