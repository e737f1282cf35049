//! The readings of one engine in one procedure of one case, and how well a prediction stands up to them.

use super::wrong::Model;
use crate::judge::{Comparison, Verdict};
use crate::record::Uncertainty;

/// Error of a prediction that no uncertainty of a reading covers, relative: engines' own small biases.
const SLACK: f64 = 5e-4;
/// The same where predictions rest on thinned tables.
const THINNED: f64 = 2e-3;
/// The same of rough predictions, and as a share of the change that they predict.
const ROUGH: (f64, f64) = (1e-2, 0.25);
/// Likewise, as a share of the largest reading, or of the largest that is right where that is less.
const FLOOR: f64 = 1e-6;
/// The part of what is allowed that may be left.
const LENIENT: f64 = 0.5;
/// Standard deviations that count as a reading's own scatter.
const SCATTER: f64 = 3.0;

#[derive(Clone, Debug)]
pub struct Sheet {
    pub model: usize,
    pub case: usize,
    pub is_cheap: bool,
    pub read: Vec<f64>,
    pub right: Vec<f64>,
    /// Combined standard uncertainty of each pair; infinite where a reading says nothing.
    pub uncertainty: Vec<f64>,
    /// How far readings may be off, in their unit.
    pub allowed: Vec<f64>,
    /// Whether any of it fails.
    pub fails: bool,
    /// How much of their noise the readings share: the variance of their mean over that of independent readings.
    pub design_effect: f64,
    slack: f64,
    /// Part of every standard deviation, in the readings' unit.
    floor: f64,
    is_rough: bool,
}

/// How a prediction stands up to readings, with the chi-squared that it leaves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Stand {
    /// What is left is chance.
    Explained(f64),
    /// What is left is no more than an engine may be off.
    Borne(f64),
    Contradicted(f64),
}

impl Sheet {
    /// `None` where a reading is missing: what is not there cannot be explained.
    pub fn of(model: usize, of: &Model, members: &[&Comparison]) -> Option<Self> {
        let mut sheet = Self {
            model,
            case: of.case,
            is_cheap: of.is_cheap(),
            read: vec![],
            right: vec![],
            uncertainty: vec![],
            allowed: vec![],
            fails: members.iter().any(|c| c.verdict == Verdict::Fail),
            design_effect: 1.0,
            slack: if of.is_thinned() { THINNED } else { SLACK },
            floor: 0.0,
            is_rough: false,
        };
        for comparison in members {
            let reference = comparison.reference.as_ref()?;
            sheet.read.push(comparison.value.filter(|v| v.is_finite())?);
            sheet.right.push(reference.value);
            sheet.allowed.push(comparison.allowed());
            let told = match (comparison.uncertainty, comparison.verdict) {
                // They bear out anything.
                (Uncertainty::NotSeen, _) | (_, Verdict::KnownDeviation | Verdict::NotJudged) => f64::INFINITY,
                // The variance of Student's t; there is none for two degrees of freedom.
                (other, _) => match other.degrees_of_freedom() {
                    Some(few) if few <= 2.0 => f64::INFINITY,
                    Some(few) => other.standard() * (few / (few - 2.0)).sqrt(),
                    None => other.standard(),
                },
            };
            sheet.uncertainty.push(told.hypot(reference.uncertainty));
        }
        // Light that is a millionth of what it should be is no rounding.
        let brightest = |of: &[f64]| of.iter().copied().fold(0.0, f64::max);
        sheet.floor = FLOOR * brightest(&sheet.right).min(brightest(&sheet.read));
        Some(sheet)
    }

    /// The readings that say something.
    fn told(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.read.len()).filter(|k| self.uncertainty[*k].is_finite())
    }

    pub fn count(&self) -> usize {
        self.told().count()
    }

    /// The same readings where predictions are rough.
    #[must_use]
    pub fn roughly(&self) -> Self {
        Self { slack: ROUGH.0, is_rough: true, ..self.clone() }
    }

    /// The same readings of reflected light as one reads them who is right within half of what is allowed.
    #[must_use]
    pub fn leniently(self) -> Self {
        let relative = self.allowed.iter().zip(&self.right).map(|(allowed, right)| LENIENT * allowed / right);
        let slack = relative.fold(f64::INFINITY, f64::min);
        if self.is_cheap || !slack.is_finite() { self } else { Self { slack: slack.max(self.slack), ..self } }
    }

    /// Some of the readings, of another model.
    #[must_use]
    pub fn at(&self, places: &[usize], model: usize) -> Self {
        let of = |values: &[f64]| places.iter().map(|k| values[*k]).collect();
        let (read, right) = (of(&self.read), of(&self.right));
        Self { model, read, right, uncertainty: of(&self.uncertainty), allowed: of(&self.allowed), ..self.clone() }
    }

    /// Standard deviation of a reading from a prediction that is right.
    pub fn sigma(&self, k: usize, predicted: f64) -> f64 {
        let change = if self.is_rough { ROUGH.1 * (predicted - self.right[k]) } else { 0.0 };
        self.uncertainty[k].hypot(self.slack * predicted).hypot(self.floor).hypot(change).max(f64::MIN_POSITIVE)
    }

    /// What a right reading may be off where this is predicted.
    fn allowed(&self, k: usize, predicted: f64) -> f64 {
        if self.right[k] > 0.0 { self.allowed[k] * predicted / self.right[k] } else { self.allowed[k] }
    }

    /// Whether what is right but for this factor would be further off than it may.
    pub fn would_fail(&self, factor: f64) -> bool {
        self.right.iter().zip(&self.allowed).any(|(right, allowed)| ((factor - 1.0) * right).abs() > *allowed)
    }

    pub fn chi_squared(&self, predicted: &[f64]) -> f64 {
        self.told().map(|k| ((self.read[k] - predicted[k]) / self.sigma(k, predicted[k])).powi(2)).sum()
    }

    pub fn stand(&self, predicted: &[f64]) -> Stand {
        let chi_squared = self.chi_squared(predicted);
        if is_chance(chi_squared, self.count()) {
            return Stand::Explained(chi_squared);
        }
        let beyond = |k: usize| {
            let (off, sigma) = ((self.read[k] - predicted[k]).abs(), self.sigma(k, predicted[k]));
            off > self.allowed(k, predicted[k]) + SCATTER * sigma
        };
        if self.told().any(beyond) {
            return Stand::Contradicted(chi_squared);
        }
        let loose = |k: usize| {
            let wide = self.sigma(k, predicted[k]).hypot(self.allowed(k, predicted[k]));
            ((self.read[k] - predicted[k]) / wide).powi(2)
        };
        Stand::Borne(limit(self.count()) + self.told().map(loose).sum::<f64>())
    }

    /// Residuals in standard deviations, those of readings that pass by what they may be off.
    pub fn residuals<'a>(&'a self, predicted: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
        self.told().map(|k| (self.read[k] - predicted[k]) / self.width(k))
    }

    /// What a fit weighs a reading by, whatever is predicted.
    pub fn width(&self, k: usize) -> f64 {
        let sigma = self.sigma(k, self.read[k]);
        if self.fails { sigma } else { sigma.hypot(self.allowed[k]) }
    }

    /// The same readings, which share so much of their noise.
    #[must_use]
    pub fn sharing(self, design_effect: Option<f64>) -> Self {
        Self { design_effect: design_effect.unwrap_or(1.0).max(1.0), ..self }
    }

    /// Sums of products for the factor that makes a prediction fit best: with itself and with what was read.
    pub fn products(&self, predicted: &[f64]) -> (f64, f64) {
        let width = |k: usize| self.design_effect.sqrt() * self.width(k);
        let term = |k: usize| (predicted[k] / width(k), self.read[k] / width(k));
        self.told().map(term).fold((0.0, 0.0), |(square, product), (p, r)| (square + p * p, product + p * r))
    }

    /// How many readings would tell a prediction from what is right.
    pub fn telling(&self, predicted: &[f64]) -> usize {
        let tells = |k: &usize| (predicted[*k] - self.right[*k]).abs() > SCATTER * self.sigma(*k, predicted[*k]);
        self.told().filter(tells).count()
    }

    /// The largest relative distance from a prediction, in percent.
    pub fn worst_percent(&self, predicted: &[f64]) -> f64 {
        let largest = predicted.iter().copied().fold(0.0, f64::max);
        let off = self.told().map(|k| (self.read[k] - predicted[k]).abs() / predicted[k].max(FLOOR * largest));
        100.0 * off.filter(|x| x.is_finite()).fold(0.0, f64::max)
    }
}

impl Stand {
    pub const fn chi_squared(self) -> f64 {
        match self {
            Self::Explained(x) | Self::Borne(x) | Self::Contradicted(x) => x,
        }
    }
}

/// Whether chi-squared is no larger than chance makes it, but for one time in a thousand or so.
pub(super) fn is_chance(chi_squared: f64, freedom: usize) -> bool {
    chi_squared <= limit(freedom)
}

fn limit(freedom: usize) -> f64 {
    let freedom = freedom as f64;
    freedom + 3.1 * (2.0 * freedom).sqrt() + 6.0
}
