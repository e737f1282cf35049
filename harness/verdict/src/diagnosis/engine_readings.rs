//! The readings of one engine in one procedure of one case, and how well a prediction agrees with them.

use super::faulty_task::Model;
use luxproof_model::Uncertainty;
use luxproof_model::{Comparison, Verdict};

/// Relative error of a prediction that no uncertainty of a reading covers: small biases of engines.
const SLACK: f64 = 5e-4;
/// The same error of rough predictions.
const ROUGH_SLACK: f64 = 1e-2;
/// Error of rough predictions as a part of the change that they predict.
const ROUGH_SHARE_OF_CHANGE: f64 = 0.25;
/// Error as a part of the largest reading, or of the largest right reading where that is less.
const FLOOR_SHARE: f64 = 1e-6;
/// The part of the tolerance that a lenient sheet leaves to residuals.
const LENIENT_SHARE: f64 = 0.5;
/// Standard deviations within which a reading scatters.
const SCATTER_SIGMAS: f64 = 3.0;

#[derive(Clone, Debug)]
pub struct EngineReadings {
    pub model: usize,
    pub case: usize,
    pub is_cheap: bool,
    pub read: Vec<f64>,
    pub right: Vec<f64>,
    /// Combined standard uncertainty of each pair; infinite where a reading has no information.
    pub uncertainty: Vec<f64>,
    /// How far each reading may deviate, in its unit.
    pub allowed: Vec<f64>,
    /// Whether any reading fails.
    pub fails: bool,
    /// How much noise the readings share: the variance of their mean over that of independent readings.
    pub design_effect: f64,
    slack: f64,
    /// Part of every standard deviation, in the readings' unit.
    floor: f64,
    is_rough: bool,
}

/// How a prediction agrees with readings, with the chi-squared that it leaves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Agreement {
    /// The residuals are chance.
    Explained(f64),
    /// The residuals are within the tolerance.
    Tolerated(f64),
    Contradicted(f64),
}

impl EngineReadings {
    /// A sheet of comparisons; `None` where a reading is missing, because nothing explains a missing reading.
    pub fn of(model: usize, of: &Model, members: &[&Comparison], fails: bool) -> Option<Self> {
        let mut sheet = Self {
            model,
            case: of.case,
            is_cheap: of.is_cheap(),
            read: vec![],
            right: vec![],
            uncertainty: vec![],
            allowed: vec![],
            fails,
            design_effect: 1.0,
            slack: SLACK,
            floor: 0.0,
            is_rough: false,
        };
        for comparison in members {
            let reference = comparison.reference.as_ref()?;
            sheet.read.push(comparison.value.filter(|v| v.is_finite())?);
            sheet.right.push(reference.value);
            sheet.allowed.push(comparison.allowed());
            sheet.uncertainty.push(standard_deviation(comparison).hypot(reference.uncertainty));
        }
        // The smaller maximum counts: readings of a millionth of the right light are no rounding error.
        sheet.floor = FLOOR_SHARE * maximum(&sheet.right).min(maximum(&sheet.read));
        Some(sheet)
    }

    /// The readings that have information about a prediction: it is blank where it does not know the value.
    fn informative<'a>(&'a self, predicted: &'a [f64]) -> impl Iterator<Item = usize> + 'a {
        (0..self.read.len()).filter(|k| self.uncertainty[*k].is_finite() && !predicted[*k].is_nan())
    }

    /// The number of readings that have information.
    pub fn count(&self) -> usize {
        self.informative(&self.right).count()
    }

    /// The same readings for rough predictions.
    #[must_use]
    pub fn with_rough_slack(&self) -> Self {
        Self { slack: ROUGH_SLACK, is_rough: true, ..self.clone() }
    }

    /// The same readings of reflected light, where an engine is only right within half of the tolerance.
    #[must_use]
    pub fn with_lenient_slack(self) -> Self {
        let relative = self.allowed.iter().zip(&self.right).map(|(allowed, right)| LENIENT_SHARE * allowed / right);
        let slack = relative.fold(f64::INFINITY, f64::min);
        if self.is_cheap || !slack.is_finite() { self } else { Self { slack: slack.max(self.slack), ..self } }
    }

    /// Selects some of the readings, for another model.
    #[must_use]
    pub fn select(&self, places: &[usize], model: usize) -> Self {
        Self {
            model,
            read: select(&self.read, places),
            right: select(&self.right, places),
            uncertainty: select(&self.uncertainty, places),
            allowed: select(&self.allowed, places),
            ..self.clone()
        }
    }

    /// Standard deviation of a reading from a right prediction.
    pub fn sigma(&self, k: usize, predicted: f64) -> f64 {
        let change = if self.is_rough { ROUGH_SHARE_OF_CHANGE * (predicted - self.right[k]) } else { 0.0 };
        self.uncertainty[k].hypot(self.slack * predicted).hypot(self.floor).hypot(change).max(f64::MIN_POSITIVE)
    }

    /// The tolerance of a reading at a prediction, scaled from that at the right value.
    fn allowed(&self, k: usize, predicted: f64) -> f64 {
        if self.right[k] > 0.0 { self.allowed[k] * predicted / self.right[k] } else { self.allowed[k] }
    }

    /// Whether a right reading times a factor exceeds its tolerance anywhere.
    pub fn would_fail(&self, factor: f64) -> bool {
        self.right.iter().zip(&self.allowed).any(|(right, allowed)| ((factor - 1.0) * right).abs() > *allowed)
    }

    pub fn chi_squared(&self, predicted: &[f64]) -> f64 {
        let squares = self.informative(predicted).map(|k| {
            let residual = (self.read[k] - predicted[k]) / self.sigma(k, predicted[k]);
            residual * residual
        });
        let (sum, compared) = squares.fold((0.0, 0), |(sum, compared), square| (sum + square, compared + 1));
        // A blank counts as much as a right prediction does on average.
        sum + (self.count() - compared) as f64
    }

    /// Assesses how a prediction agrees with the readings.
    pub fn assess(&self, predicted: &[f64]) -> Agreement {
        let chi_squared = self.chi_squared(predicted);
        if is_chance(chi_squared, self.count()) {
            return Agreement::Explained(chi_squared);
        }
        let mut tolerated_chi_squared = 0.0;
        for k in self.informative(predicted) {
            let residual = self.read[k] - predicted[k];
            let (allowed, sigma) = (self.allowed(k, predicted[k]), self.sigma(k, predicted[k]));
            if residual.abs() > allowed + SCATTER_SIGMAS * sigma {
                return Agreement::Contradicted(chi_squared);
            }
            tolerated_chi_squared += (residual / sigma.hypot(allowed)).powi(2);
        }
        // The limit is added so that a tolerated prediction never scores better than an explained one.
        Agreement::Tolerated(chi_squared_limit(self.count()) + tolerated_chi_squared)
    }

    /// Residuals in widths, by which a fit weights them.
    pub fn residuals<'a>(&'a self, predicted: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
        self.informative(&self.right).map(|k| {
            let residual = (self.read[k] - predicted[k]) / self.width(k);
            if residual.is_nan() { 1.0 } else { residual }
        })
    }

    /// The width by which a fit weights a reading, whatever the prediction; passing readings get their tolerance.
    pub fn width(&self, k: usize) -> f64 {
        let sigma = self.sigma(k, self.read[k]);
        if self.fails { sigma } else { sigma.hypot(self.allowed[k]) }
    }

    /// The same readings, with the noise that they share.
    #[must_use]
    pub fn with_design_effect(self, design_effect: Option<f64>) -> Self {
        Self { design_effect: design_effect.unwrap_or(1.0).max(1.0), ..self }
    }

    /// Sums of products that give the best factor of a prediction: with itself, and with the readings.
    pub fn products(&self, predicted: &[f64]) -> (f64, f64) {
        let (mut square, mut product) = (0.0, 0.0);
        for k in self.informative(predicted) {
            let width = self.design_effect.sqrt() * self.width(k);
            let (p, r) = (predicted[k] / width, self.read[k] / width);
            square += p * p;
            product += p * r;
        }
        (square, product)
    }

    /// Counts the readings that distinguish a prediction from the right values.
    pub fn count_telling(&self, predicted: &[f64]) -> usize {
        self.informative(predicted)
            .filter(|k| (predicted[*k] - self.right[*k]).abs() > SCATTER_SIGMAS * self.sigma(*k, predicted[*k]))
            .count()
    }

    /// The largest relative distance from a prediction, in percent.
    pub fn worst_percent(&self, predicted: &[f64]) -> f64 {
        let floor = FLOOR_SHARE * maximum(predicted);
        let distances =
            self.informative(predicted).map(|k| (self.read[k] - predicted[k]).abs() / predicted[k].max(floor));
        100.0 * distances.filter(|x| x.is_finite()).fold(0.0, f64::max)
    }
}

impl Agreement {
    pub const fn chi_squared(self) -> f64 {
        match self {
            Self::Explained(x) | Self::Tolerated(x) | Self::Contradicted(x) => x,
        }
    }
}

/// The standard deviation of a reading; infinite where it has no information or where no verdict rests on it.
fn standard_deviation(comparison: &Comparison) -> f64 {
    match (comparison.uncertainty, comparison.verdict) {
        (Uncertainty::NotSeen, _) | (_, Verdict::KnownDeviation | Verdict::NotJudged) => f64::INFINITY,
        // The variance of Student's t; up to two degrees of freedom it does not exist.
        (uncertainty, _) => match uncertainty.degrees_of_freedom() {
            Some(freedom) if freedom <= 2.0 => f64::INFINITY,
            Some(freedom) => uncertainty.standard() * (freedom / (freedom - 2.0)).sqrt(),
            None => uncertainty.standard(),
        },
    }
}

fn maximum(values: &[f64]) -> f64 {
    values.iter().copied().fold(0.0, f64::max)
}

fn select(values: &[f64], places: &[usize]) -> Vec<f64> {
    places.iter().map(|k| values[*k]).collect()
}

/// Whether chance makes a chi-squared this large, more often than about once in a thousand times.
pub(super) fn is_chance(chi_squared: f64, freedom: usize) -> bool {
    chi_squared <= chi_squared_limit(freedom)
}

fn chi_squared_limit(freedom: usize) -> f64 {
    let freedom = freedom as f64;
    freedom + 3.1 * (2.0 * freedom).sqrt() + 6.0
}

#[cfg(test)]
mod tests;
