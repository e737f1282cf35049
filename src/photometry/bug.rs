//! BUG ratings of outdoor luminaires: backlight, uplight and glare from 0 to 5.
//!
//! IES TM-15-11, addendum A, tables: a rating is the lowest whose limits hold in every zone that it looks at.

use super::{ClassificationZones, Goniometer, LuminousIntensityDistribution, Symmetry};
use crate::units::Lumen;

/// Largest flux in lumens for ratings 0 to 4; beyond the last it is 5.
type Limits = [f64; 5];

/// Table A-1: back light of 0-30 and 60-80 degrees.
const BACK_LOW_AND_HIGH: Limits = [110.0, 500.0, 1000.0, 2500.0, 5000.0];
/// Table A-1: back light of 30-60 degrees.
const BACK_MEDIUM: Limits = [220.0, 1000.0, 2500.0, 5000.0, 8500.0];
/// Table A-2: light of 90-100 and of 100-180 degrees.
const UP: Limits = [0.0, 10.0, 50.0, 500.0, 1000.0];
/// Table A-3: forward and back light of 80-90 degrees.
const VERY_HIGH: Limits = [10.0, 100.0, 225.0, 500.0, 750.0];
/// Table A-3: forward light of 60-80 degrees and, of quadrilaterally symmetric luminaires, back light there.
const FORWARD_HIGH: Limits = [660.0, 1800.0, 5000.0, 7500.0, 12000.0];

/// Less than this fraction of the luminaire's flux, or of its largest intensity, is rounding and no light.
const NOTHING: f64 = 1e-9;
/// How far values may differ, as a fraction of the largest, in a luminaire that is called symmetric.
const ALIKE: f64 = 0.05;

/// The rating of a luminaire.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BugRating {
    /// What it follows from.
    pub zones: ClassificationZones,
    /// B.
    pub backlight: u8,
    /// U.
    pub uplight: u8,
    /// G by the columns of asymmetric luminaires, types I to IV.
    pub glare_asymmetric: u8,
    /// G by the columns of quadrilaterally symmetric ones, types V and VS.
    pub glare_symmetric: u8,
    /// Which columns hold for this one: whether it is the same every 90 degrees of C, within 5 % of the largest intensity.
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
    /// The table ends with light where uplight would begin or before.
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
        if self.goniometer() == Goniometer::B {
            let lit = |(c, g): &(f64, f64)| self.intensity(*c, *g).value() > NOTHING * largest;
            let highest = self.nodes_deg().into_iter().filter(lit).map(|(_, gamma)| gamma).fold(0.0, f64::max);
            if self.edge_intensity().value() > NOTHING * largest {
                return Err(NoBug::CutShort { gamma_deg: (100.0 * highest).round() / 100.0 });
            }
        }
        let gamma_deg = self.gamma_deg()[self.gamma_deg().len() - 1];
        let is_of_gamma = self.goniometer() != Goniometer::B;
        if is_of_gamma
            && gamma_deg < 180.0
            && self.c_deg().iter().any(|c| self.intensity(*c, gamma_deg).value() > NOTHING * largest)
        {
            return Err(NoBug::CutShort { gamma_deg });
        }
        let zones = self.classification_zones(forward_c_deg);
        let nothing = NOTHING * self.flux();
        let highest = |zones: &[(Lumen, Limits)]| highest(zones, nothing);
        let ([_, _, forward_high, forward_very_high], [low, medium, high, very_high]) = (zones.forward, zones.back);
        let backlight = highest(&[(low, BACK_LOW_AND_HIGH), (medium, BACK_MEDIUM), (high, BACK_LOW_AND_HIGH)]);
        let glare = |back_high: Limits| {
            let very = [(forward_very_high, VERY_HIGH), (very_high, VERY_HIGH)];
            highest(&[very[0], very[1], (forward_high, FORWARD_HIGH), (high, back_high)])
        };
        Ok(BugRating {
            zones,
            backlight,
            uplight: highest(&zones.up.map(|flux| (flux, UP))),
            glare_asymmetric: glare(BACK_LOW_AND_HIGH),
            glare_symmetric: glare(FORWARD_HIGH),
            is_symmetric: self.is_alike_each_quarter(),
        })
    }

    fn is_alike_each_quarter(&self) -> bool {
        if self.symmetry() == Symmetry::Axial {
            return true;
        }
        let allowed = ALIKE * self.max_intensity().value();
        let full = self.full_circle();
        let same = |c: f64, g: f64| (full.intensity(c, g) - full.intensity(c + 90.0, g)).value().abs() <= allowed;
        full.c_deg().iter().all(|&c| full.gamma_deg().iter().all(|&g| same(c, g)))
    }
}

/// The highest rating of several zones.
fn highest(zones: &[(Lumen, Limits)], nothing: Lumen) -> u8 {
    let rating =
        |(flux, limits): &(Lumen, Limits)| limits.iter().filter(|most| *flux > Lumen(**most) + nothing).count() as u8;
    zones.iter().map(rating).max().unwrap_or(0)
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
