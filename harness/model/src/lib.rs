//! The data of reports: readings with their uncertainties, comparisons, verdicts and everything else in `report.json`.

mod baseline_check;
mod basis;
mod bias;
mod comparison;
mod consensus;
mod curve;
mod day;
mod error_budget;
mod exit;
#[cfg(test)]
mod fixtures;
mod floor_plan;
mod foreign_path;
mod hidden_variant;
mod key;
mod known_deviation;
mod light;
mod luminaire_model;
mod method;
pub mod numbers;
mod policy;
mod procedure;
mod published;
mod ratios;
mod release;
mod report;
mod request;
mod sentence;
pub mod shapes;
mod skip;
mod split;
mod stated_errors;
mod statistics;
mod status;
mod tolerance;
mod tool;
mod uncertainty;
mod verdict;

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use baseline_check::{BaselineCheck, BaselineLine};
pub use basis::Basis;
pub use bias::{Bias, Scatter};
pub use comparison::{Comparison, Reference};
pub use consensus::{Consensus, Group, Witness};
pub use curve::Curve;
pub use day::{Day, NoDay};
pub use error_budget::{Component, ErrorBudget, Shape, Source};
pub use exit::{Exit, Summary};
pub use floor_plan::{FloorPlan, MAX_DRAWN, PlanLuminaire};
pub use foreign_path::ForeignPath;
pub use hidden_variant::HiddenVariant;
pub use key::{EngineName, MeterId, ProcedureId, ReadingKey, UnknownProcedure, family};
pub use known_deviation::{DeviationKind, Glob, KnownDeviation, KnownDeviationOutcome, LawBreach, State};
pub use light::{Light, UnknownLight};
pub use luminaire_model::{FIVE_TIMES, LuminaireModelChoice, NearestPlace};
pub use method::{Effort, Method};
pub use policy::{PolicyRecord, Sampling};
pub use published::{
    Misfit, PublishedColumn, PublishedFlux, PublishedRow, PublishedTable, decimals_of, printed_cell, published_column,
};
pub use ratios::{MeterRatio, Ratio, Ratios};
pub use release::{NoRelease, Release};
pub use report::{
    CaseRecord, LintRecord, MAX_ON_ONE_PAGE, REPORT_FILE, REPORT_VERSION, ReadingRecord, Report, SpecRecord,
};
pub use request::Request;
pub use sentence::{ProcedureClaim, Sentence};
pub use skip::{EVERYONE, Scope, Skip, SkipCause};
pub use split::{PaperSplit, Share, Split};
pub use stated_errors::{ErrorFinding, StatedErrors};
pub use statistics::{FigureAgreement, Statistics, StatisticsAgreement};
pub use status::{EngineStatus, FailureKind, Role, Status};
pub use tolerance::{Tolerance, ToleranceClass};
pub use tool::Tool;
pub use uncertainty::Uncertainty;
pub use verdict::Verdict;

/// The physical quantity of a reading and its unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
pub enum Quantity {
    /// Illuminance in lux.
    #[serde(rename = "illuminance_lx")]
    Illuminance,
    /// Luminous intensity in candela.
    #[serde(rename = "luminous_intensity_cd")]
    LuminousIntensity,
    /// Luminance in candela per square metre.
    #[serde(rename = "luminance_cd_m2")]
    Luminance,
    /// Unified glare rating, a logarithm.
    #[serde(rename = "unified_glare_rating")]
    GlareRating,
}

impl Quantity {
    /// The unit's symbol.
    pub const fn unit(self) -> &'static str {
        match self {
            Self::Illuminance => "lx",
            Self::LuminousIntensity => "cd",
            Self::Luminance => "cd/m²",
            Self::GlareRating => "UGR",
        }
    }

    /// Whether it has a true zero, so that relative deviations make sense. A rating is a logarithm and has none.
    pub const fn has_zero(self) -> bool {
        !matches!(self, Self::GlareRating)
    }
}

/// The relative scatter of rounding.
pub const ROUNDING: f64 = 1e-6;

/// A value with its stated error, both in the same unit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Estimate {
    pub value: f64,
    #[serde(flatten)]
    pub uncertainty: Uncertainty,
}

impl Estimate {
    /// Exactly no light.
    pub const DARK: Self = Self { value: 0.0, uncertainty: Uncertainty::Bound(0.0) };

    /// The mean of independent samples; a single sample states no error.
    pub fn of_samples(samples: &[f64]) -> Self {
        let n = samples.len() as f64;
        let value = samples.iter().sum::<f64>() / n;
        if samples.len() < 2 {
            return Self { value, uncertainty: Uncertainty::Unstated };
        }
        let sum_of_squares: f64 = samples.iter().map(|s| (s - value).powi(2)).sum();
        let std_error = (sum_of_squares / (n - 1.0) / n).sqrt();
        Self { value, uncertainty: Uncertainty::sampled(std_error, Some(n - 1.0)) }
    }

    /// Marks the estimates that no sample met, if samples met others: no hits do not mean a standard error of zero.
    pub fn mark_unseen(all: &mut [Self]) {
        if !all.iter().any(|e| e.uncertainty.standard_error().is_some() && e.value > 0.0) {
            return;
        }
        for estimate in all {
            if estimate.value == 0.0 && estimate.uncertainty.standard_error() == Some(0.0) {
                estimate.uncertainty = Uncertainty::NotSeen;
            }
        }
    }

    /// Marks the estimates with samples that agree except for rounding, if the samples of others do not.
    ///
    /// What the samples of others met may still be missing there.
    pub fn mark_agreeing(all: &mut [Self]) {
        if !all.iter().any(|e| e.scatters() == Some(true)) {
            return;
        }
        for estimate in all {
            if estimate.scatters() == Some(false) && estimate.uncertainty.bound() == 0.0 {
                estimate.uncertainty = Uncertainty::NotSeen;
            }
        }
    }

    /// Whether the samples differ by more than rounding; `None` without a valid standard error, such as NaN.
    fn scatters(&self) -> Option<bool> {
        let error = self.uncertainty.standard_error().filter(|_| self.uncertainty.is_sound())?;
        Some(error > ROUNDING * self.value.abs())
    }

    /// A value without error.
    pub const fn exact(value: f64) -> Self {
        Self { value, uncertainty: Uncertainty::Exact }
    }

    /// The weighted sum of estimates of one run. Their errors may have the same cause, so they add up.
    pub fn of_one_run(weights: &[f64], estimates: &[Self]) -> Self {
        let pairs = weights.iter().zip(estimates);
        let uncertainty = Uncertainty::of_dependent_sum(pairs.clone().map(|(w, e)| (*w, e.uncertainty)));
        Self { value: pairs.map(|(w, e)| w * e.value).sum(), uncertainty }
    }

    /// The sum with an independent estimate.
    #[must_use]
    pub fn plus(&self, other: &Self) -> Self {
        let uncertainty = Uncertainty::of_sum([(1.0, self.uncertainty), (1.0, other.uncertainty)]);
        Self { value: self.value + other.value, uncertainty }
    }

    /// The estimate times a factor.
    #[must_use]
    pub fn times(&self, factor: f64) -> Self {
        Self { value: factor * self.value, uncertainty: self.uncertainty.times(factor) }
    }
}

/// One value at one meter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Reading {
    pub meter: MeterId,
    pub quantity: Quantity,
    /// In the quantity's unit.
    pub value: f64,
    /// The uncertainty of the planes that are added up.
    #[serde(flatten)]
    pub uncertainty: Uncertainty,
    /// The largest error of that sum as the quantity, in its unit: 0 unless finitely many planes stand for a curved surface.
    ///
    /// Engines that read the same planes have the same error, so a comparison between them does not contain it.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub quadrature: f64,
}

/// Whether a field is left out.
#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes references")]
fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

impl Reading {
    /// A reading of the quantity itself, not of planes that stand for it.
    pub const fn new(meter: MeterId, quantity: Quantity, estimate: Estimate) -> Self {
        Self { meter, quantity, value: estimate.value, uncertainty: estimate.uncertainty, quadrature: 0.0 }
    }

    /// The value with its whole uncertainty.
    pub fn estimate(&self) -> Estimate {
        let uncertainty =
            if self.quadrature > 0.0 { self.uncertainty.within(self.quadrature) } else { self.uncertainty };
        Estimate { value: self.value, uncertainty }
    }
}

/// The run of one engine in one procedure of one case, with everything that repeats it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Recording {
    #[serde(flatten)]
    pub key: ReadingKey,
    /// The engine's version, as the engine reports it.
    pub version: String,
    /// Whether the engine is judged or a reference.
    #[serde(default)]
    pub role: Role,
    /// The luminaire model: point, area, impostor, or mixed.
    #[serde(default)]
    pub model: String,
    /// The light that counts.
    pub light: Light,
    /// SHA-256 of the spec and of every file that it names.
    pub input_sha256: String,
    /// SHA-256 of the measured content, independent of file names. Known deviations may refer to it.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub content_sha256: String,
    /// Seed of every random choice.
    pub seed: u64,
    /// Solver, preset and options. Older files have method and effort together under `settings`.
    #[serde(alias = "settings")]
    pub method: Method,
    /// Blocks, samples, seeds and commands.
    #[serde(default)]
    pub effort: Effort,
    /// Whether its own parser read the photometric files; otherwise it got the tables that luxproof parsed.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub reads_files: bool,
    /// How the engine only approximates the request.
    pub approximation: Option<String>,
    /// The engine's declared error by that approximation, relative to the reading.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub declared_error: Option<f64>,
    /// Notes for the reader of a report.
    pub notes: Vec<String>,
    /// Wall-clock seconds.
    pub wall_s: f64,
    /// Seconds of sampling at the engine's nominal rate, on any machine; null for an engine that uses the clock.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub work_s: Option<f64>,
    /// The part of the planned samples that the time limit left, in the stage that it cut most; null where the limit was not met.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cut_to: Option<f64>,
    /// Components that other engines also use: engines that share one count once among the witnesses.
    #[serde(default)]
    pub components: Vec<String>,
    /// The stage in which each reading was last sampled, counted from 1; empty where one stage was planned.
    #[serde(default)]
    pub stages: Vec<u32>,
    /// The skewness of its sample blocks, in standard deviations of that of normal blocks. It indicates a heavy tail.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub skewness: Option<f64>,
    /// The design effect: the variance of the meters' mean over that of independent meters; null where it is unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub design_effect: Option<f64>,
    /// By set, the mean correlation of its meters' noise; a set without one counts as fully correlated.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub correlations: BTreeMap<String, f64>,
    /// How its stated errors agree with the scatter over seeds, where that was checked. There is a finding for sampled readings, and one
    /// for readings that are claimed to be exact.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub stated_errors: Vec<StatedErrors>,
    /// The command that repeats it in the folder that `luxproof export` writes, where there is one.
    #[serde(default)]
    pub command: Option<String>,
    /// Why there are no readings, where there are none.
    pub failure: Option<String>,
    /// The kind of failure; older files have the text alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failure_kind: Option<FailureKind>,
    /// The readings, one for each meter; a report lists them separately.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub readings: Vec<Reading>,
}

impl Recording {
    /// The approximation that the engine declares, where its declared error explains a failed comparison.
    pub fn declared(&self, comparison: &Comparison) -> Option<&str> {
        let (reference, budget) = (comparison.reference.as_ref()?.value, comparison.budget.as_ref()?);
        let margin = comparison.tolerance.around(reference) + budget.expanded;
        let is_within = comparison.deviation?.abs() <= self.declared_error? * reference.abs() + margin;
        self.approximation.as_deref().filter(|_| is_within)
    }

    /// Whether its standard errors show a heavy tail.
    pub fn states_heavy_tail(&self) -> bool {
        self.stated_errors.iter().any(|s| s.finding == Some(ErrorFinding::HeavyTail))
    }

    /// A recording without readings.
    pub fn of(key: ReadingKey, light: Light) -> Self {
        Self {
            key,
            version: String::new(),
            role: Role::Renderer,
            model: String::new(),
            light,
            input_sha256: String::new(),
            content_sha256: String::new(),
            seed: 1,
            method: Method::default(),
            effort: Effort::default(),
            reads_files: false,
            approximation: None,
            declared_error: None,
            notes: vec![],
            wall_s: 0.0,
            work_s: None,
            cut_to: None,
            components: vec![],
            stages: vec![],
            skewness: None,
            design_effect: None,
            correlations: BTreeMap::new(),
            stated_errors: vec![],
            command: None,
            failure: None,
            failure_kind: None,
            readings: vec![],
        }
    }

    /// The reading at the `k`-th meter, which has this name. Where readings are missing, it stands further ahead.
    pub fn reading(&self, k: usize, meter: &MeterId) -> Option<&Reading> {
        let known = &self.readings[..self.readings.len().min(k + 1)];
        known.iter().rev().find(|reading| reading.meter == *meter)
    }

    /// The part of the budget that sampling used, in seconds: nominal where the engine counts, by the clock otherwise.
    pub fn work_s(&self) -> f64 {
        self.work_s.unwrap_or(self.wall_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{comparison, recording};

    #[test]
    fn standard_error_is_that_of_the_mean() {
        let estimate = |value, uncertainty| Estimate { value, uncertainty };
        assert_eq!(Estimate::of_samples(&[1.0, 3.0]), estimate(2.0, Uncertainty::sampled(1.0, Some(1.0))));
        assert_eq!(Estimate::of_samples(&[5.0]), estimate(5.0, Uncertainty::Unstated));
    }

    #[test]
    fn repeated_observations_have_the_means_and_errors_of_the_gum() {
        // JCGM 100:2008, table H.2: five observations of a voltage (V), a current (mA) and a phase (rad).
        let observed = [
            ([5.007, 4.994, 5.005, 4.990, 4.999], 4.9990, 0.0032, 4),
            ([19.663, 19.639, 19.640, 19.685, 19.678], 19.6610, 0.0095, 4),
            ([1.0456, 1.0438, 1.0468, 1.0428, 1.0433], 1.04446, 0.00075, 5),
        ];
        for (samples, mean, error, digits) in observed {
            let found = Estimate::of_samples(&samples);
            let rounded = |x: f64| (x * 10f64.powi(digits)).round() / 10f64.powi(digits);
            assert!((found.value - mean).abs() < 1e-9, "{found:?}");
            assert_eq!(rounded(found.uncertainty.standard_error().unwrap()), error);
            assert_eq!(found.uncertainty.degrees_of_freedom(), Some(4.0));
        }
    }

    #[test]
    fn every_quantity_has_its_unit_and_a_rating_has_no_zero() {
        let all = [
            (Quantity::Illuminance, "lx", true),
            (Quantity::LuminousIntensity, "cd", true),
            (Quantity::Luminance, "cd/m²", true),
            (Quantity::GlareRating, "UGR", false),
        ];
        for (quantity, unit, has_zero) in all {
            assert_eq!((quantity.unit(), quantity.has_zero()), (unit, has_zero));
        }
    }

    fn sampled(value: f64, error: f64) -> Estimate {
        Estimate { value, uncertainty: Uncertainty::sampled(error, Some(7.0)) }
    }

    /// Which of the estimates are marked as not seen.
    fn unseen(all: &[Estimate]) -> Vec<bool> {
        all.iter().map(|e| e.uncertainty == Uncertainty::NotSeen).collect()
    }

    #[test]
    fn what_no_sample_met_is_not_seen_where_samples_met_others() {
        let mut all = [sampled(5.0, 0.1), sampled(0.0, 0.0), sampled(3.0, 0.0), sampled(0.0, 0.1), Estimate::DARK];
        Estimate::mark_unseen(&mut all);
        assert_eq!(unseen(&all), [false, true, false, false, false]);
        // Where nothing is lit, or what is lit is not sampled, darkness may be true.
        for first in [sampled(0.0, 0.1), sampled(-1.0, 0.1), Estimate::exact(5.0)] {
            let mut all = [first, sampled(0.0, 0.0)];
            Estimate::mark_unseen(&mut all);
            assert_eq!(unseen(&all), [false, false], "{first:?}");
        }
    }

    #[test]
    fn samples_that_agree_where_those_of_others_do_not_are_not_seen() {
        // Rounding is up to a millionth of the value.
        let bounded = Estimate {
            value: 5.0,
            uncertainty: Uncertainty::StandardError { value: 0.0, degrees_of_freedom: None, bound: 0.1 },
        };
        let same = [sampled(5.0, 4e-6), sampled(-5.0, 4e-6), sampled(5.0, 0.0), bounded, Estimate::exact(5.0)];
        let mut all = [&[sampled(5.0, 6e-6)][..], &same].concat();
        Estimate::mark_agreeing(&mut all);
        assert_eq!(unseen(&all), [false, true, true, true, false, false]);
        let mut all = same;
        Estimate::mark_agreeing(&mut all);
        assert_eq!(unseen(&all), [false; 5]);
        // An error that is no number shows no scatter.
        let mut all = [sampled(5.0, f64::NAN), sampled(5.0, 0.0)];
        Estimate::mark_agreeing(&mut all);
        assert_eq!(unseen(&all), [false; 2]);
    }

    #[test]
    fn errors_of_one_run_add_up_and_those_of_two_add_in_quadrature() {
        let (three, four) = (sampled(10.0, 3.0), sampled(20.0, 4.0));
        let together = Estimate::of_one_run(&[2.0, -1.0], &[three, four]);
        assert_eq!((together.value, together.uncertainty.standard_error()), (0.0, Some(10.0)));
        let apart = three.plus(&four);
        assert_eq!((apart.value, apart.uncertainty.standard_error()), (30.0, Some(5.0)));
        let halved = four.times(-0.5);
        assert_eq!((halved.value, halved.uncertainty.standard_error()), (-10.0, Some(2.0)));
        assert_eq!(Estimate::exact(2.0), Estimate { value: 2.0, uncertainty: Uncertainty::Exact });
    }

    #[test]
    fn a_declared_error_explains_a_deviation_within_it_and_the_margin_of_the_verdict() {
        let budget = ErrorBudget {
            components: vec![],
            combined: 0.25,
            degrees_of_freedom: None,
            coverage_factor: 2.0,
            expanded: 0.5,
            counted: vec![],
        };
        let c = Comparison { budget: Some(budget), ..comparison() };
        let coarse =
            Recording { approximation: Some("takes points".to_owned()), declared_error: Some(0.03), ..recording() };
        // 3 % of 100 lx, the tolerance of 1 lx and the half width of .5 lx.
        for (deviation, is_explained) in [(4.49, true), (-4.49, true), (4.5, true), (4.51, false), (-4.51, false)] {
            let c = Comparison { deviation: Some(deviation), ..c.clone() };
            assert_eq!(coarse.declared(&c).is_some(), is_explained, "{deviation}");
            let report = Report { recordings: vec![coarse.clone()], ..Report::default() };
            assert_eq!(report.declared(&c), coarse.declared(&c));
        }
        assert_eq!(coarse.declared(&c), Some("takes points"));
        assert_eq!(Recording { declared_error: None, ..coarse.clone() }.declared(&c), None);
        let other = Comparison { key: ReadingKey::new("other", c.key.procedure, "radiance"), ..c };
        assert_eq!(Report { recordings: vec![coarse], ..Report::default() }.declared(&other), None);
    }

    #[test]
    fn a_recording_gives_its_readings_by_meter_also_where_some_are_missing() {
        let mut found = recording();
        for (k, value) in [(0, 1.0), (2, 3.0), (3, 4.0)] {
            let meter = MeterId::new("desk", k);
            found.readings.push(Reading::new(meter, Quantity::Illuminance, Estimate::exact(value)));
        }
        let values: Vec<Option<f64>> =
            (0..5).map(|k| found.reading(k, &MeterId::new("desk", k)).map(|r| r.value)).collect();
        assert_eq!(values, [Some(1.0), None, Some(3.0), Some(4.0), None]);
        // A meter stands at its place or further ahead, never behind it.
        assert!(found.reading(0, &MeterId::new("desk", 2)).is_none());
        assert!(found.reading(2, &MeterId::new("desk", 3)).is_some());
        assert_eq!(Recording { wall_s: 9.0, ..recording() }.work_s(), 9.0);
        assert_eq!(Recording { wall_s: 9.0, work_s: Some(7.0), ..recording() }.work_s(), 7.0);
    }

    #[test]
    fn a_recording_states_a_heavy_tail_by_its_findings() {
        let [heavy, small] = [ErrorFinding::HeavyTail, ErrorFinding::TooSmall].map(StatedErrors::from_finding);
        assert!(!recording().states_heavy_tail());
        assert!(!Recording { stated_errors: vec![small.clone()], ..recording() }.states_heavy_tail());
        assert!(Recording { stated_errors: vec![small, heavy], ..recording() }.states_heavy_tail());
    }
}
