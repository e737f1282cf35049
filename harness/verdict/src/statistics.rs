//! Figures of a set of meters, and how they agree with those of the reference.
//!
//! They are the mean, the minimum, uniformity (minimum over mean, EN 12464-1) and diversity (minimum over maximum,
//! CIBSE Code for Lighting), each with its uncertainty.

use luxproof_model::FigureAgreement;
use luxproof_model::Statistics;
use luxproof_model::StatisticsAgreement;
use luxproof_statistics::error_budget;
use luxproof_statistics::rejected;
use std::collections::HashMap;

use itertools::Itertools;

use super::{Judge, is_heavy_tailed, judge, share_of_reading, uncertainty_components};
use luxproof_model::{Basis, Comparison, Tolerance, Verdict};
use luxproof_model::{Component, Shape, Source};
use luxproof_model::{EngineName, Estimate, ProcedureId, Quantity, ReadingKey, Recording, Uncertainty};
use luxproof_statistics::upper_tail_of_normal;
use luxproof_statistics::{greatest, least};

/// Comparisons by reading key and set.
type ComparisonsBySet<'a> = HashMap<(&'a ReadingKey, &'a str), Vec<&'a Comparison>>;

impl Judge<'_> {
    /// Statistics of every set of at least two meters of light, in the order of recordings.
    ///
    /// `comparisons` are all comparisons of these recordings.
    pub fn statistics(&self, comparisons: &[Comparison], recordings: &[Recording]) -> Vec<Statistics> {
        let mut by_set = ComparisonsBySet::new();
        for c in comparisons {
            by_set.entry((&c.key, c.meter.set_name())).or_default().push(c);
        }
        let mut all = vec![];
        for recording in recordings.iter().filter(|r| !r.key.procedure.is_calibration()) {
            let mut same_task = recordings.iter().filter(|r| r.key.is_of(&recording.key.case, recording.key.procedure));
            let witness = same_task.find(|r| r.key.engine == EngineName::SIMULATOR);
            all.extend(self.statistics_of_recording(recording, witness, &by_set));
        }
        all
    }

    /// The statistics of a recording; `witness` is that of the simulator, of all references the only one that is sampled.
    fn statistics_of_recording(
        &self,
        recording: &Recording,
        witness: Option<&Recording>,
        by_set: &ComparisonsBySet<'_>,
    ) -> Vec<Statistics> {
        let tail = upper_tail_of_normal(self.tolerances.coverage_factor());
        let readings = recording.readings.iter().enumerate();
        let readings =
            readings.filter(|(_, r)| is_light_at_meter(recording.key.procedure, r.quantity) && r.value.is_finite());
        let mut found = vec![];
        for (set, readings) in &readings.chunk_by(|(_, r)| r.meter.set_name()) {
            let (places, readings): (Vec<usize>, Vec<_>) = readings.unzip();
            let estimates = readings.iter().map(|r| Estimate { value: r.value, uncertainty: r.uncertainty });
            let correlation = correlation(Some(recording), set);
            let Some(figures) = Figures::from_estimates(&estimates.collect_vec(), correlation, tail) else { continue };
            let comparisons = by_set.get(&(&recording.key, set)).map_or(&[][..], Vec::as_slice);
            let share = places.iter().map(|k| share_of_reading(recording, *k)).fold(1.0, f64::min);
            let has_one_each = comparisons.len() == readings.len();
            let correlations = [correlation, self::correlation(witness, set)];
            let agreement = has_one_each.then(|| self.agreement(recording, comparisons, correlations, share)).flatten();
            let Figures { mean, minimum, maximum, uniformity, diversity } = figures;
            found.push(Statistics {
                key: recording.key.clone(),
                set: set.to_owned(),
                meters: readings.len(),
                mean,
                minimum,
                maximum: Some(maximum),
                uniformity,
                diversity,
                agreement,
            });
        }
        // The figures of all sets are one family of tests.
        let agreements = found.iter_mut().filter_map(|s| s.agreement.as_mut());
        self.decide_together(agreements.flat_map(StatisticsAgreement::figures_mut));
        found
    }

    /// Decides the figures of one engine in one procedure as a family of tests, as its meters are.
    pub(super) fn decide_together<'f>(&self, figures: impl Iterator<Item = &'f mut FigureAgreement>) {
        let mut figures = figures.collect_vec();
        let p_values = figures.iter().map(|f| f.p_value).collect_vec();
        let rejected = rejected(&p_values, self.tolerances.family_wise_error());
        for (figure, rejected) in figures.iter_mut().zip(rejected) {
            if figure.verdict == Verdict::Fail && !rejected {
                figure.verdict = Verdict::Undecided;
            }
        }
    }

    /// The basis of all comparisons, one a meter.
    ///
    /// `None` where a meter has none, another or a doubtful one, or where the engine claims nothing of single meters.
    pub(super) fn common_basis(&self, comparisons: &[&Comparison]) -> Option<Basis> {
        let first = comparisons.first()?;
        let basis = first.basis()?;
        let ReadingKey { procedure, engine, .. } = &first.key;
        let is_claimed = self.tolerances.not_claimed(*procedure, basis, engine).is_none();
        let is_once = comparisons.iter().map(|c| &c.meter).all_unique();
        (is_claimed && is_once && comparisons.iter().all(|c| is_judged_by(c, basis))).then_some(basis)
    }

    /// Tests the figures of a set; `comparisons` has one a meter, `correlations` are those of readings and of references, and `share` is
    /// the part of the error to spend.
    fn agreement(
        &self,
        recording: &Recording,
        comparisons: &[&Comparison],
        [of_readings, of_references]: [f64; 2],
        share: f64,
    ) -> Option<StatisticsAgreement> {
        let basis = self.common_basis(comparisons)?;
        let tolerance = comparisons.first()?.tolerance;
        let tail = upper_tail_of_normal(self.tolerances.coverage_factor());
        let readings =
            comparisons.iter().filter_map(|c| Some(Estimate { value: c.value?, uncertainty: c.uncertainty }));
        let readings = Figures::from_estimates(&readings.collect_vec(), of_readings, tail)?;
        let references = comparisons.iter().filter_map(|c| reference_estimate(c)).collect_vec();
        let references = Figures::from_estimates(&references, of_references, tail)?;
        let test = EquivalenceTest { tail, share, limit: verdict_limit(recording, comparisons) };
        Some(StatisticsAgreement {
            basis,
            mean: test.assess(&readings.mean, &references.mean, tolerance)?,
            minimum: test.assess(&readings.minimum, &references.minimum, tolerance)?,
            uniformity: test.assess_quotient(
                readings.uniformity,
                references.uniformity,
                tolerance,
                references.mean.value,
            ),
            diversity: test.assess_quotient(
                readings.diversity,
                references.diversity,
                tolerance,
                references.maximum.value,
            ),
        })
    }
}

/// Whether a comparison is made with a sound reference of this basis.
fn is_judged_by(comparison: &Comparison, basis: Basis) -> bool {
    let is_sound = comparison.reference.as_ref().is_some_and(|r| r.basis == basis && r.caveat.is_none());
    is_sound && comparison.verdict != Verdict::Missing && comparison.deviation.is_some()
}

/// Whether it is proportional to light.
pub(super) const fn is_light(quantity: Quantity) -> bool {
    matches!(quantity, Quantity::Illuminance | Quantity::Luminance)
}

/// Whether a reading is proportional to the light at the meter's place, and not to what is seen from there.
fn is_light_at_meter(procedure: ProcedureId, quantity: Quantity) -> bool {
    is_light(quantity) && procedure != ProcedureId::OpeningLuminance
}

/// The mean correlation of the noise of a set's meters: 1, the most that it can be, where it is not known.
fn correlation(recording: Option<&Recording>, set: &str) -> f64 {
    recording.and_then(|r| r.correlations.get(set)).copied().unwrap_or(1.0)
}

/// The figures of a set.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Figures {
    mean: Estimate,
    minimum: Estimate,
    maximum: Estimate,
    uniformity: Option<Estimate>,
    diversity: Option<Estimate>,
}

impl Figures {
    /// `None` for a single value, and where figures are not finite. The values' noise has this mean correlation.
    fn from_estimates(values: &[Estimate], correlation: f64, tail: f64) -> Option<Self> {
        let count = values.len() as f64;
        let mean = Estimate {
            value: values.iter().map(|e| e.value).sum::<f64>() / count,
            uncertainty: Uncertainty::of_correlated_sum(
                values.iter().map(|e| (1.0 / count, e.uncertainty)),
                correlation,
            ),
        };
        let (minimum, maximum) = (least(values, tail).filter(|_| count > 1.0)?, greatest(values, tail)?);
        if ![mean, minimum, maximum].iter().all(is_finite) {
            return None;
        }
        let uniformity = quotient(&minimum, &mean).filter(is_finite);
        let diversity = quotient(&minimum, &maximum).filter(is_finite);
        Some(Self { mean, minimum, maximum, uniformity, diversity })
    }
}

fn is_finite(estimate: &Estimate) -> bool {
    estimate.value.is_finite() && estimate.uncertainty.standard().is_finite()
}

/// The part of a whole, to first order in errors of any correlation; `None` where the whole is not positive.
fn quotient(part: &Estimate, whole: &Estimate) -> Option<Estimate> {
    (whole.value > 0.0).then(|| Estimate {
        value: part.value / whole.value,
        uncertainty: Uncertainty::of_dependent_sum([
            (1.0 / whole.value, part.uncertainty),
            (part.value / whole.value.powi(2), whole.uncertainty),
        ]),
    })
}

/// The reference of a comparison, with all its uncertainty.
pub(super) fn reference_estimate(c: &Comparison) -> Option<Estimate> {
    let (mut chance, mut bound, mut freedom) = (0.0_f64, 0.0, None);
    for part in c.budget.iter().flat_map(|b| &b.components) {
        // These two sources belong to the reading.
        if matches!(part.source, Source::MonteCarlo | Source::Discretisation) {
            continue;
        }
        match part.shape {
            Shape::Normal => {
                chance = chance.hypot(part.uncertainty);
                freedom = [freedom, part.degrees_of_freedom].into_iter().flatten().reduce(f64::min);
            }
            Shape::Rectangular => bound += part.uncertainty * 3f64.sqrt(),
        }
    }
    let uncertainty = if chance > 0.0 {
        Uncertainty::StandardError { value: chance, degrees_of_freedom: freedom, bound }
    } else {
        Uncertainty::Bound(bound)
    };
    Some(Estimate { value: c.reference.as_ref()?.value, uncertainty })
}

/// The verdicts that figures of meters can get, the widest first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum VerdictLimit {
    /// Any verdict.
    None,
    /// Some meter's interval is not reliable far off: nothing fails yet.
    NoFailure,
    /// Some meter has no interval at all.
    Open,
}

/// The verdicts that a set's figures can get: a meter that cannot fail lets no figure of its set fail.
pub(super) fn verdict_limit(recording: &Recording, comparisons: &[&Comparison]) -> VerdictLimit {
    if comparisons.iter().any(|c| c.uncertainty == Uncertainty::NotSeen) {
        VerdictLimit::Open
    } else if comparisons.iter().any(|c| cannot_fail(recording, c)) {
        VerdictLimit::NoFailure
    } else {
        VerdictLimit::None
    }
}

fn cannot_fail(recording: &Recording, c: &Comparison) -> bool {
    c.p_value.is_none_or(|p_value| is_heavy_tailed(recording, c, c.deviation.unwrap_or(0.0), p_value))
}

/// The equivalence test of a figure, the same as that of meters.
#[derive(Clone, Copy, Debug)]
pub(super) struct EquivalenceTest {
    pub(super) tail: f64,
    /// The part of its error that the decision may spend.
    pub(super) share: f64,
    pub(super) limit: VerdictLimit,
}

impl EquivalenceTest {
    /// Assesses a figure of readings against that of the references.
    pub(super) fn assess(
        &self,
        read: &Estimate,
        reference: &Estimate,
        tolerance: Tolerance,
    ) -> Option<FigureAgreement> {
        let (deviation, allowed) = (read.value - reference.value, tolerance.around(reference.value));
        let mut components = uncertainty_components(&read.uncertainty);
        for part in uncertainty_components(&reference.uncertainty) {
            components.push(Component { source: Source::Reference, ..part });
        }
        let budget = error_budget::budget_of_stage(components, self.tail, self.share);
        let verdict = match (judge(deviation, budget.expanded, allowed), self.limit) {
            (Verdict::Missing, _) => return None,
            (_, VerdictLimit::Open) | (Verdict::Fail, VerdictLimit::NoFailure) => Verdict::Undecided,
            (verdict, _) => verdict,
        };
        // JSON has no infinity.
        let p_value = Some(error_budget::p_value(&budget, deviation, allowed)).filter(|p| p.is_finite())?;
        Some(FigureAgreement { reference: *reference, deviation, expanded: budget.expanded, allowed, verdict, p_value })
    }

    /// Assesses a quotient; its tolerance is that of the numerator over the denominator `whole`.
    fn assess_quotient(
        &self,
        read: Option<Estimate>,
        reference: Option<Estimate>,
        tolerance: Tolerance,
        whole: f64,
    ) -> Option<FigureAgreement> {
        let tolerance = Tolerance { absolute: tolerance.absolute / whole, ..tolerance };
        self.assess(&read?, &reference?, tolerance)
    }
}

#[cfg(test)]
mod step_tests;
#[cfg(test)]
mod tests;
