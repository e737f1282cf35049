//! Finds the mistakes and variants that give the answers of a reader to one file.

use itertools::Itertools as _;
use serde::Serialize;

use crate::expected::Flux;
use crate::mistake::{Mistake, Variant};
use crate::model_reader::{ModelReader, Prediction};
use crate::pack_file::{PackFile, Place};
use crate::submission::Scale;

/// Candela per watt per steradian, and Radiance's.
const LUMENS_PER_WATT: [(Variant, f64); 2] = [(Variant::RadiantBy683, 683.0), (Variant::RadiantBy179, 179.0)];
/// How exactly a normalisation must be met.
const FACTOR_TOLERANCE: f64 = 2e-3;
/// The most mistakes of one file that are searched for.
const MAX_MISTAKES: usize = 3;
/// With fewer answers than this a mistake that fits proves little.
const MIN_ANSWERS: usize = 3;

/// What gives the answers to a file.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Explanation {
    /// None: the answers are right, or follow a variant.
    pub(crate) mistakes: Vec<Mistake>,
    /// The choice of the reader in this file.
    pub(crate) variant: Option<Variant>,
    /// The normalisation of the reader.
    pub(crate) normalisation: Option<Variant>,
    /// A factor of all answers that has no name.
    pub(crate) factor: Option<f64>,
    /// The factor of all answers, named or not.
    pub(crate) scale: f64,
}

/// Mistakes that give most answers to a file, and not all.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PartialExplanation {
    /// The mistakes; none where most answers are right.
    pub mistakes: Vec<Mistake>,
    /// The choice of the reader in this file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub variant: Option<Variant>,
    /// The number of answers that they give.
    pub explained: usize,
    /// The number of answers.
    pub answered: usize,
    /// The factor of all answers.
    pub scale: f64,
}

/// The part of the answers that an explanation gives at least, to be worth saying.
const MIN_EXPLAINED_SHARE: f64 = 0.75;

/// The answers to a file and how far they may be off.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Answers<'a> {
    pub(crate) file: &'a PackFile,
    pub(crate) candela: &'a [Option<f64>],
    pub(crate) relative_uncertainty: f64,
    pub(crate) scale: Scale,
}

/// Which factors of all answers are accepted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Factors {
    /// None: answers are candela.
    One,
    /// Those with a name.
    Named,
    /// Any: the unit is the user's.
    Users,
    /// Any, and it is stated.
    Any,
}

impl Answers<'_> {
    /// The explanations with the fewest assumptions; none where nothing explains the answers.
    ///
    /// `shown` are the mistakes that change an answer of the file.
    pub(crate) fn explain(&self, shown: &[Mistake]) -> Vec<Explanation> {
        let steps: &[(usize, Factors)] = match self.scale {
            Scale::Relative => &[(0, Factors::Users), (1, Factors::Users), (2, Factors::Users), (3, Factors::Users)],
            Scale::Candela => &[
                (0, Factors::One),
                (0, Factors::Named),
                (1, Factors::One),
                (2, Factors::One),
                (1, Factors::Named),
                (3, Factors::One),
                (0, Factors::Any),
                (2, Factors::Named),
                (1, Factors::Any),
            ],
        };
        for (count, factors) in steps {
            let found = self.explain_by(shown, (*count).min(MAX_MISTAKES), *factors);
            if !found.is_empty() {
                return found;
            }
        }
        vec![]
    }

    /// The explanations with this number of mistakes.
    fn explain_by(&self, shown: &[Mistake], count: usize, factors: Factors) -> Vec<Explanation> {
        let mut found: Vec<Explanation> = vec![];
        for mistakes in shown.iter().copied().combinations(count) {
            // A variant that changes nothing comes first, so that it is named.
            let variants = self.file.variants.iter().copied().map(Some);
            for variant in variants.chain([None]) {
                let already = found.iter().any(|other| other.mistakes == mistakes);
                if already && variant.is_none() {
                    continue;
                }
                let reader = ModelReader { mistakes: &mistakes, variant };
                if factors == Factors::One && !self.agree_with(&reader) {
                    continue;
                }
                let predictions = reader.predict(self.file);
                found.extend(self.fit(&predictions, factors).map(|(scale, normalisation)| Explanation {
                    mistakes: mistakes.clone(),
                    variant,
                    normalisation,
                    factor: (factors == Factors::Any).then_some(scale),
                    scale,
                }));
            }
        }
        found
    }

    /// The fewest mistakes that give the most answers, where none gives all.
    pub(crate) fn explain_most(&self, shown: &[Mistake]) -> Option<PartialExplanation> {
        let mut best: Option<PartialExplanation> = None;
        for mistakes in (0..=MAX_MISTAKES).flat_map(|count| shown.iter().copied().combinations(count)) {
            for variant in self.file.variants.iter().copied().map(Some).chain([None]) {
                let pairs = self.pairs(&ModelReader { mistakes: &mistakes, variant }.predict(self.file));
                let scale = if self.scale == Scale::Candela { Some(1.0) } else { middle_ratio(&pairs) };
                let Some(scale) = scale else { continue };
                let is_met = |(prediction, answer): &&(Prediction, f64)| {
                    prediction.most.is_finite() && self.is_met(*prediction, *answer, scale)
                };
                let explained = pairs.iter().filter(is_met).count();
                if explained > best.as_ref().map_or(0, |best| best.explained) {
                    let mistakes = mistakes.clone();
                    best = Some(PartialExplanation { mistakes, variant, explained, answered: pairs.len(), scale });
                }
            }
        }
        best.filter(|best| best.explained as f64 >= MIN_EXPLAINED_SHARE * best.answered as f64)
    }

    /// Whether the answers are those of a reader, up to the first that is not: most sets of mistakes fail soon.
    fn agree_with(&self, reader: &ModelReader) -> bool {
        let asked = self.file.directions.iter().zip(reader.predictions(self.file)).zip(self.candela);
        asked
            .filter(|((asked, _), _)| asked.place == Place::Exact)
            .all(|((_, prediction), answer)| answer.is_none_or(|answer| self.is_met(prediction, answer, 1.0)))
    }

    /// The factor by which predictions give the answers, and its name.
    fn fit(&self, predictions: &[Prediction], factors: Factors) -> Option<(f64, Option<Variant>)> {
        let pairs = self.pairs(predictions);
        let exact = pairs.iter().filter_map(|(prediction, answer)| Some((prediction.exact()?, *answer)));
        let (mut products, mut squares, mut count) = (0.0, 0.0, 0);
        for (expected, answer) in exact {
            products += expected * answer;
            squares += expected * expected;
            count += 1;
        }
        if count < MIN_ANSWERS.min(pairs.len()) || pairs.is_empty() {
            return None;
        }
        // Answers in another unit may be small against the tolerance: a dark prediction explains dark answers alone.
        let brightest = pairs.iter().map(|(_, answer)| answer.abs()).fold(0.0, f64::max);
        if squares == 0.0 && brightest > 0.0 {
            return None;
        }
        let scale = match factors {
            Factors::One => 1.0,
            Factors::Named | Factors::Users | Factors::Any => products / squares,
        };
        // A reader of the users' brightness has no other sign, and no light is no factor.
        if !scale.is_finite() || (factors != Factors::One && scale <= 0.0) {
            return None;
        }
        let normalisation = if factors == Factors::Named { Some(name_factor(self.file, scale)?) } else { None };
        let is_met = |(prediction, answer): &(Prediction, f64)| self.is_met(*prediction, *answer, scale);
        pairs.iter().all(is_met).then_some((scale, normalisation))
    }

    /// Predictions and answers on nodes and beyond the end of the table.
    fn pairs(&self, predictions: &[Prediction]) -> Vec<(Prediction, f64)> {
        let asked = self.file.directions.iter().zip_eq(predictions).zip_eq(self.candela);
        let exact = asked.filter(|((asked, _), _)| asked.place == Place::Exact);
        exact.filter_map(|((_, prediction), answer)| answer.map(|answer| (*prediction, answer))).collect()
    }

    /// Whether an answer is a prediction times a factor.
    fn is_met(&self, Prediction { least, most, .. }: Prediction, answer: f64, scale: f64) -> bool {
        let bound = |candela: f64, side: f64| {
            if candela.is_finite() { candela + side * self.allowed_cd(candela) } else { candela }
        };
        let (low, high) = (scale * bound(least, -1.0), scale * bound(most, 1.0));
        (low.min(high)..=low.max(high)).contains(&answer)
    }

    /// How far an answer may be from an intensity.
    pub(crate) fn allowed_cd(&self, candela: f64) -> f64 {
        self.file.tolerance_cd() + 2.0 * self.relative_uncertainty * candela.abs()
    }
}

/// The middle ratio of answers and predictions: some wrong answers do not move it.
fn middle_ratio(pairs: &[(Prediction, f64)]) -> Option<f64> {
    let mut ratios: Vec<f64> = vec![];
    for (prediction, answer) in pairs {
        ratios.extend(prediction.exact().filter(|expected| *expected > 0.0).map(|expected| answer / expected));
    }
    ratios.sort_by(f64::total_cmp);
    ratios.get(ratios.len() / 2).copied()
}

/// Whether a product is one but for rounding.
fn is_one(product: f64) -> bool {
    (product - 1.0).abs() <= FACTOR_TOLERANCE
}

/// The normalisation that multiplies all intensities of a file by this factor.
fn name_factor(file: &PackFile, factor: f64) -> Option<Variant> {
    if is_one(factor * file.peak_cd()) {
        return Some(Variant::NormalisedToPeak);
    }
    if let Some((variant, _)) = LUMENS_PER_WATT.into_iter().find(|(_, efficacy)| is_one(factor * efficacy)) {
        return Some(variant);
    }
    // Rules of integration differ.
    let Flux { least, most, .. } = Flux::of(file);
    let fluxes = [(Variant::NormalisedToFlux, 1.0), (Variant::NormalisedToMean, 4.0 * std::f64::consts::PI)];
    fluxes.into_iter().find(|(_, numerator)| (least..=most).contains(&(numerator / factor))).map(|(variant, _)| variant)
}
