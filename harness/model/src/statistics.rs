//! Statistics of sets of meters.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{Basis, Estimate, ReadingKey, Verdict};

/// The statistics of one set of meters, as one engine read it. Errors of meters add up, because they may have the same cause.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Statistics {
    #[serde(flatten)]
    pub key: ReadingKey,
    /// The set of meters.
    pub set: String,
    pub meters: usize,
    /// In lux; for luminances in cd/m².
    pub mean: Estimate,
    /// Likewise. Its uncertainty covers the true minimum of all meters, because the lowest of noisy readings is too low.
    pub minimum: Estimate,
    /// Likewise; null in older reports.
    #[serde(default)]
    pub maximum: Option<Estimate>,
    /// Minimum over mean; null where the mean is zero.
    pub uniformity: Option<Estimate>,
    /// Minimum over maximum; null where the maximum is zero, and in older reports.
    #[serde(default)]
    pub diversity: Option<Estimate>,
    /// The agreement with the figures of the reference; missing where there is none, or where meters have different ones.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub agreement: Option<StatisticsAgreement>,
}

/// The figures of an engine against those of its reference at the same meters.
///
/// The summary and the exit code ignore them, because the meters are judged individually.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StatisticsAgreement {
    pub basis: Basis,
    pub mean: FigureAgreement,
    pub minimum: FigureAgreement,
    #[serde(default)]
    pub uniformity: Option<FigureAgreement>,
    #[serde(default)]
    pub diversity: Option<FigureAgreement>,
}

/// One figure against that of the reference, all in its unit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FigureAgreement {
    /// The figure of the reference.
    pub reference: Estimate,
    /// The figure minus that of the reference.
    pub deviation: f64,
    /// Half width of the deviation's interval at the coverage of verdicts, with the uncertainties of both.
    pub expanded: f64,
    /// The deviation that the procedure's tolerance allows.
    pub allowed: f64,
    /// Whether the interval lies within (`pass`), outside (`fail`) or across (`undecided`) the tolerance.
    pub verdict: Verdict,
    /// The probability of a deviation this large if the engine is just within the tolerance.
    pub p_value: f64,
}

impl FigureAgreement {
    /// The deviation over the reference; `None` where the reference is zero.
    pub fn relative(&self) -> Option<f64> {
        Some(self.deviation / self.reference.value).filter(|d| d.is_finite())
    }
}

impl StatisticsAgreement {
    /// Mean, minimum, uniformity and diversity, with their names.
    pub fn figures(&self) -> impl Iterator<Item = (&'static str, &FigureAgreement)> {
        let all = [
            ("mean", Some(&self.mean)),
            ("minimum", Some(&self.minimum)),
            ("uniformity", self.uniformity.as_ref()),
            ("diversity", self.diversity.as_ref()),
        ];
        all.into_iter().filter_map(|(name, figure)| Some((name, figure?)))
    }

    pub fn figures_mut(&mut self) -> impl Iterator<Item = &mut FigureAgreement> {
        let quotients = [self.uniformity.as_mut(), self.diversity.as_mut()];
        [&mut self.mean, &mut self.minimum].into_iter().chain(quotients.into_iter().flatten())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Uncertainty;

    fn figure(value: f64, deviation: f64) -> FigureAgreement {
        let reference = Estimate { value, uncertainty: Uncertainty::Exact };
        FigureAgreement { reference, deviation, expanded: 0.0, allowed: 1.0, verdict: Verdict::Pass, p_value: 1.0 }
    }

    #[test]
    fn a_figure_has_a_relative_deviation_unless_the_reference_is_zero() {
        assert_eq!(figure(50.0, -2.0).relative(), Some(-0.04));
        assert_eq!([figure(0.0, 2.0).relative(), figure(0.0, 0.0).relative()], [None, None]);
    }

    #[test]
    fn figures_are_listed_with_their_names_and_quotients_where_there_are_any() {
        let mut all = StatisticsAgreement {
            basis: Basis::Simulator,
            mean: figure(1.0, 0.1),
            minimum: figure(2.0, 0.2),
            uniformity: Some(figure(3.0, 0.3)),
            diversity: Some(figure(4.0, 0.4)),
        };
        let found: Vec<(&str, f64)> = all.figures().map(|(name, figure)| (name, figure.deviation)).collect();
        assert_eq!(found, [("mean", 0.1), ("minimum", 0.2), ("uniformity", 0.3), ("diversity", 0.4)]);
        all.figures_mut().for_each(|figure| figure.deviation *= 2.0);
        let found: Vec<f64> = all.figures().map(|(_, figure)| figure.deviation).collect();
        assert_eq!(found, [0.2, 0.4, 0.6, 0.8]);
        all.uniformity = None;
        assert_eq!(all.figures().map(|(name, _)| name).collect::<Vec<_>>(), ["mean", "minimum", "diversity"]);
    }
}
