//! Luminaire spacing criteria along both axes and on the diagonal.
//!
//! IES Lighting Handbook (9th ed., chapter 9, luminaire spacing criterion): the criterion is a spacing over mounting
//! height. Along an axis, the horizontal illuminance midway between two luminaires equals that below one of them alone.
//! On the diagonal, the same holds in the middle of four luminaires. Only direct light counts.

use super::LuminousIntensityDistribution;
use super::analysis::first_below;

/// Spacing over mounting height, or why it does not apply.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpacingCriteria {
    /// Luminaires in a row along C 0 - C 180.
    pub along_c0: f64,
    /// Luminaires in a row along C 90 - C 270.
    pub along_c90: f64,
    /// Luminaires in a square, between the four of a cell.
    pub diagonal: f64,
}

/// Why no spacing criterion applies.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum NoSpacing {
    /// No light at all.
    #[error("every intensity is zero")]
    Dark,
    /// More light goes up than down.
    #[error("{up_percent:.0} % of the flux goes up, and the criterion is of direct light from above")]
    Uplight {
        /// Share of the flux above the horizon in percent.
        up_percent: f64,
    },
    /// No light at the nadir to compare with.
    #[error("there is no light straight down, with which the criterion compares")]
    DarkNadir,
}

impl LuminousIntensityDistribution {
    /// The three criteria. A point between luminaires gets light from opposite sides: their intensities are averaged.
    pub fn spacing_criteria(&self) -> Result<SpacingCriteria, NoSpacing> {
        let (flux, up) = (self.flux().value(), self.flux_between(90.0, 180.0).value());
        if flux <= 0.0 {
            return Err(NoSpacing::Dark);
        }
        if up > 0.5 * flux {
            return Err(NoSpacing::Uplight { up_percent: 100.0 * up / flux });
        }
        Ok(SpacingCriteria {
            along_c0: self.spacing_between(&[0.0, 180.0], 2.0)?,
            along_c90: self.spacing_between(&[90.0, 270.0], 2.0)?,
            diagonal: self.spacing_between(&[45.0, 135.0, 225.0, 315.0], 2f64.sqrt())?,
        })
    }

    /// The criterion for one luminaire in each of these planes; `side` is the spacing over the distance to the middle.
    fn spacing_between(&self, c_deg: &[f64], side: f64) -> Result<f64, NoSpacing> {
        let nadir = self.mean_intensity(c_deg, 0.0);
        if nadir <= 0.0 {
            return Err(NoSpacing::DarkNadir);
        }
        // cos^3 is curved between nodes of the table: a tenth of a degree is finer than any table.
        let nodes = (0..=900).map(|k| 0.1 * f64::from(k)).collect();
        let reach = first_below(nodes, nadir / c_deg.len() as f64, |g| {
            self.mean_intensity(c_deg, g) * g.to_radians().cos().powi(3)
        });
        reach.map(|g| side * g.to_radians().tan()).ok_or(NoSpacing::DarkNadir)
    }

    /// The mean intensity in candela over some planes.
    fn mean_intensity(&self, c_deg: &[f64], gamma_deg: f64) -> f64 {
        c_deg.iter().map(|c| self.intensity(*c, gamma_deg).value()).sum::<f64>() / c_deg.len() as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn a_lambertian_luminaire_has_the_criteria_that_reports_print() {
        let gamma: Vec<f64> = (0..=900).map(|k| f64::from(k) / 10.0).collect();
        let candela = gamma.iter().map(|g| g.to_radians().cos().max(0.0)).collect();
        let table = LuminousIntensityDistribution::axial(gamma, candela).unwrap();
        let found = table.spacing_criteria().unwrap();
        let row = 2.0 * 0.5f64.powf(0.25).acos().tan();
        assert_relative_eq!(found.along_c0, row, max_relative = 1e-5);
        assert_relative_eq!(found.along_c90, row, max_relative = 1e-5);
        assert_relative_eq!(found.diagonal, 2f64.sqrt(), max_relative = 1e-5);
        assert_eq!([found.along_c0, found.diagonal].map(|s| format!("{s:.2}")), ["1.29", "1.41"]);
    }

    #[test]
    fn spacing_criterion_of_cosine_powers_has_a_closed_form() {
        let gamma: Vec<f64> = (0..=900).map(|k| f64::from(k) / 10.0).collect();
        for power in [0, 1, 4] {
            let candela = gamma.iter().map(|g| g.to_radians().cos().max(0.0).powi(power)).collect();
            let table = LuminousIntensityDistribution::axial(gamma.clone(), candela).unwrap();
            let reach = 0.5f64.powf(1.0 / f64::from(power + 3)).acos();
            assert_relative_eq!(table.spacing_criteria().unwrap().along_c0, 2.0 * reach.tan(), max_relative = 1e-4);
        }
    }

    /// Illuminance of a luminaire at height 1 at a point of the floor.
    fn lux(table: &LuminousIntensityDistribution, x: f64, y: f64) -> f64 {
        let square = x * x + y * y + 1.0;
        let gamma = (x * x + y * y).sqrt().atan().to_degrees();
        table.intensity(y.atan2(x).to_degrees(), gamma).value() / square.powf(1.5)
    }

    #[test]
    fn four_luminaires_at_the_diagonal_spacing_give_in_their_middle_what_one_gives_below() {
        // A table of two planes: its diagonal lies between them.
        let gamma: Vec<f64> = (0..=90).map(f64::from).collect();
        let planes = [1, 3].map(|power| gamma.iter().map(move |g| g.to_radians().cos().max(0.0).powi(power)));
        let candela = planes.into_iter().flatten().collect();
        let table = LuminousIntensityDistribution::new(vec![0.0, 90.0], gamma.clone(), candela).unwrap();
        let half = 0.5 * table.spacing_criteria().unwrap().diagonal;
        let corners = [(half, half), (-half, half), (half, -half), (-half, -half)];
        let middle: f64 = corners.map(|(x, y)| lux(&table, x, y)).iter().sum();
        assert_relative_eq!(middle, lux(&table, 0.0, 0.0), max_relative = 1e-4);
    }

    #[test]
    fn uplights_and_luminaires_dark_below_have_none_and_say_why() {
        let up = LuminousIntensityDistribution::axial(vec![0.0, 90.0, 180.0], vec![1.0, 1.0, 3.0]).unwrap();
        assert!(matches!(up.spacing_criteria(), Err(NoSpacing::Uplight { up_percent }) if up_percent > 60.0));
        let ring = LuminousIntensityDistribution::axial(vec![0.0, 45.0, 90.0], vec![0.0, 5.0, 0.0]).unwrap();
        assert_eq!(ring.spacing_criteria(), Err(NoSpacing::DarkNadir));
        let dark = LuminousIntensityDistribution::axial(vec![0.0, 90.0], vec![0.0; 2]).unwrap();
        assert_eq!(dark.spacing_criteria(), Err(NoSpacing::Dark));
    }
}
