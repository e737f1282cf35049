//! What a set of meters says as a whole, and how it agrees with what the same set says by the reference: mean, minimum, uniformity
//! (minimum over mean, EN 12464-1) and diversity (minimum over maximum, CIBSE Code for Lighting), each with its uncertainty.

use std::collections::HashMap;

use itertools::Itertools;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::extreme::{greatest, least};
use super::uncertainty::{Component, ErrorBudget, Shape, Source, upper_tail_of_normal};
use super::{
    Basis, Comparison, Judge, Tolerance, Verdict, family, is_heavy_tailed, judge, of_reading, share_of_reading,
};
use crate::record::{Estimate, ProcedureId, Quantity, ReadingKey, Recording, Uncertainty};

/// Of one set of meters, as one engine read it. Errors of meters add up, since they may share what makes them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Statistics {
    #[serde(flatten)]
    pub key: ReadingKey,
    /// The set of meters.
    pub set: String,
    pub meters: usize,
    /// In lux, of luminances in cd/m².
    pub mean: Estimate,
    /// In lux, of luminances in cd/m². Its uncertainty is that of the least of all meters, whichever it may be: the lowest of noisy readings is too low.
    pub minimum: Estimate,
    /// Likewise; null in reports of before it was told.
    #[serde(default)]
    pub maximum: Option<Estimate>,
    /// Minimum over mean; null where the mean is none.
    pub uniformity: Option<Estimate>,
    /// Minimum over maximum; null where the maximum is none, and in reports of before it was told.
    #[serde(default)]
    pub diversity: Option<Estimate>,
    /// How they agree with those of the reference that the meters are judged by; left out where that is none, or of several kinds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub agreement: Option<StatisticsAgreement>,
}

/// The figures of an engine against those of its reference at the same meters. They follow from meters that are judged by themselves: they
/// count in no summary and no exit code.
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
    /// The figure less that of the reference.
    pub deviation: f64,
    /// Half width of the interval of the deviation, from both sides, at the coverage of verdicts.
    pub expanded: f64,
    /// What the procedure's tolerance allows.
    pub allowed: f64,
    /// Whether the interval lies within (`pass`), outside (`fail`) or across (`inconclusive`), as of a meter.
    pub verdict: Verdict,
    /// How probable a deviation this large would be, were the engine just within the tolerance.
    pub p_value: f64,
}

impl FigureAgreement {
    /// The deviation over the reference; `None` of nothing.
    pub fn relative(&self) -> Option<f64> {
        Some(self.deviation / self.reference.value).filter(|d| d.is_finite())
    }
}

impl Judge<'_> {
    /// Of every set of two meters and more of illuminances or luminances, in the order of recordings; `comparisons` are all of theirs.
    pub fn statistics(&self, comparisons: &[Comparison], recordings: &[Recording]) -> Vec<Statistics> {
        let mut judged: HashMap<(&ReadingKey, &str), Vec<&Comparison>> = HashMap::new();
        for c in comparisons {
            judged.entry((&c.key, set(&c.meter.0))).or_default().push(c);
        }
        let asked = recordings.iter().filter(|r| !r.key.procedure.is_known());
        let of = |recording| self.of_recording(recording, &judged);
        asked.flat_map(of).collect()
    }

    fn of_recording(
        &self,
        recording: &Recording,
        judged: &HashMap<(&ReadingKey, &str), Vec<&Comparison>>,
    ) -> Vec<Statistics> {
        let tail = upper_tail_of_normal(self.tolerances.coverage_factor());
        let lit = recording.readings.iter().enumerate();
        let lit = lit.filter(|(_, r)| is_of_places(recording.key.procedure, r.quantity) && r.value.is_finite());
        let mut found = vec![];
        for (set, readings) in &lit.chunk_by(|(_, r)| set(&r.meter.0)) {
            let (places, readings): (Vec<usize>, Vec<_>) = readings.unzip();
            let estimates = readings.iter().map(|r| Estimate { value: r.value, uncertainty: r.uncertainty });
            let Some(figures) = Figures::of(&estimates.collect_vec(), tail) else { continue };
            let mine = judged.get(&(&recording.key, set)).map_or(&[][..], Vec::as_slice);
            let share = places.iter().map(|k| share_of_reading(recording, *k)).fold(1.0, f64::min);
            let agreement = (mine.len() == readings.len()).then(|| self.agreement(recording, mine, share)).flatten();
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
        // Figures of all sets together.
        let agreements = found.iter_mut().filter_map(|s| s.agreement.as_mut());
        self.decide_together(agreements.flat_map(StatisticsAgreement::figures_mut));
        found
    }

    /// What is claimed of one engine in one procedure fails together, as its meters do.
    pub(super) fn decide_together<'f>(&self, figures: impl Iterator<Item = &'f mut FigureAgreement>) {
        let mut figures = figures.collect_vec();
        let p_values = figures.iter().map(|f| f.p_value).collect_vec();
        let rejected = family::rejected(&p_values, self.tolerances.family_wise_error());
        for (figure, rejected) in figures.iter_mut().zip(rejected) {
            if figure.verdict == Verdict::Fail && !rejected {
                figure.verdict = Verdict::Inconclusive;
            }
        }
    }

    /// What all meters of an engine are held against, each once; `None` where some are not, or not by the same, or where that is in doubt or
    /// the engine claims nothing of single meters.
    pub(super) fn common_basis(&self, mine: &[&Comparison]) -> Option<Basis> {
        let first = mine.first()?;
        let basis = first.basis()?;
        let is_held = |c: &&Comparison| {
            let is_sound = c.reference.as_ref().is_some_and(|r| r.basis == basis && r.doubt.is_none());
            is_sound && c.verdict != Verdict::Missing && c.deviation.is_some()
        };
        let ReadingKey { procedure, engine, .. } = &first.key;
        let is_claimed = self.tolerances.not_claimed(*procedure, basis, engine).is_none();
        let is_once = mine.iter().map(|c| &c.meter).all_unique();
        (is_claimed && is_once && mine.iter().all(is_held)).then_some(basis)
    }

    /// `mine` has one comparison a meter; `share` is what of its error a decision may spend.
    fn agreement(&self, recording: &Recording, mine: &[&Comparison], share: f64) -> Option<StatisticsAgreement> {
        let basis = self.common_basis(mine)?;
        let tolerance = mine.first()?.tolerance;
        let tail = upper_tail_of_normal(self.tolerances.coverage_factor());
        let read = mine.iter().filter_map(|c| Some(Estimate { value: c.value?, uncertainty: c.uncertainty }));
        let (read, held) = (read.collect_vec(), mine.iter().filter_map(|c| reference(c)).collect_vec());
        let (own, theirs) = (Figures::of(&read, tail)?, Figures::of(&held, tail)?);
        let test = Test { tail, share, limit: limit(recording, mine) };
        let of_light = |r: &Estimate| tolerance.around(r.value);
        // What is allowed of the lowest meter is as much of the quotient, lux or per cent.
        let of_quotient = |over: f64| {
            move |r: &Estimate| Tolerance { absolute: tolerance.absolute / over, ..tolerance }.around(r.value)
        };
        let pair = |own: Option<Estimate>, theirs: Option<Estimate>| Some((own?, theirs?));
        let quotient = |(own, theirs), over| test.of(&own, &theirs, of_quotient(over));
        Some(StatisticsAgreement {
            basis,
            mean: test.of(&own.mean, &theirs.mean, of_light)?,
            minimum: test.of(&own.minimum, &theirs.minimum, of_light)?,
            uniformity: pair(own.uniformity, theirs.uniformity).and_then(|p| quotient(p, theirs.mean.value)),
            diversity: pair(own.diversity, theirs.diversity).and_then(|p| quotient(p, theirs.maximum.value)),
        })
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

    fn figures_mut(&mut self) -> impl Iterator<Item = &mut FigureAgreement> {
        let quotients = [self.uniformity.as_mut(), self.diversity.as_mut()];
        [&mut self.mean, &mut self.minimum].into_iter().chain(quotients.into_iter().flatten())
    }
}

/// Whether it is proportional to light.
pub(super) const fn is_light(quantity: Quantity) -> bool {
    matches!(quantity, Quantity::Illuminance | Quantity::Luminance)
}

/// Whether a reading is proportional to light and tells of the meter's place, not of what is seen from there.
fn is_of_places(procedure: ProcedureId, quantity: Quantity) -> bool {
    is_light(quantity) && procedure != ProcedureId::OpeningLuminance
}

/// The set of a meter.
pub(super) fn set(meter: &str) -> &str {
    meter.rsplit_once('[').map_or(meter, |(set, _)| set)
}

/// What values of a set come to.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Figures {
    mean: Estimate,
    minimum: Estimate,
    maximum: Estimate,
    uniformity: Option<Estimate>,
    diversity: Option<Estimate>,
}

impl Figures {
    /// `None` of a single value, and where they are no numbers.
    fn of(values: &[Estimate], tail: f64) -> Option<Self> {
        let count = values.len() as f64;
        let mean = Estimate {
            value: values.iter().map(|e| e.value).sum::<f64>() / count,
            uncertainty: Uncertainty::of_dependent_sum(values.iter().map(|e| (1.0 / count, e.uncertainty))),
        };
        let (minimum, maximum) = (least(values, tail).filter(|_| count > 1.0)?, greatest(values, tail)?);
        let is_number = |e: &Estimate| e.value.is_finite() && e.uncertainty.standard().is_finite();
        let over = |whole: &Estimate| quotient(&minimum, whole).filter(is_number);
        let (uniformity, diversity) = (over(&mean), over(&maximum));
        [mean, minimum, maximum].iter().all(is_number).then_some(Self { mean, minimum, maximum, uniformity, diversity })
    }
}

/// A part of a whole, whose errors may be one and go either way: to first order; `None` of a whole that is none.
fn quotient(part: &Estimate, whole: &Estimate) -> Option<Estimate> {
    (whole.value > 0.0).then(|| Estimate {
        value: part.value / whole.value,
        uncertainty: Uncertainty::of_dependent_sum([
            (1.0 / whole.value, part.uncertainty),
            (part.value / whole.value.powi(2), whole.uncertainty),
        ]),
    })
}

/// What a meter is held against, with all that is uncertain of it.
pub(super) fn reference(c: &Comparison) -> Option<Estimate> {
    let (mut chance, mut bound, mut freedom) = (0.0_f64, 0.0, None);
    let of_reference = |part: &&Component| !matches!(part.source, Source::MonteCarlo | Source::Discretisation);
    for part in c.budget.iter().flat_map(|b| &b.components).filter(of_reference) {
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

/// What figures of meters can be at most decided to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Limit {
    /// Anything.
    None,
    /// Some meter's interval is not one at a distance: nothing fails yet.
    NoFailure,
    /// Some meter has no interval at all.
    Open,
}

/// What fails no meter, or has no error there, fails no figure of its set.
pub(super) fn limit(recording: &Recording, mine: &[&Comparison]) -> Limit {
    let waits = |c: &&Comparison| {
        let is_heavy = || is_heavy_tailed(recording, c, c.deviation.unwrap_or(0.0), c.p_value.unwrap_or(1.0));
        c.p_value.is_none() || is_heavy()
    };
    match mine {
        _ if mine.iter().any(|c| c.uncertainty == Uncertainty::NotSeen) => Limit::Open,
        _ if mine.iter().any(waits) => Limit::NoFailure,
        _ => Limit::None,
    }
}

/// The equivalence test that meters have, of a figure.
#[derive(Clone, Copy, Debug)]
pub(super) struct Test {
    pub(super) tail: f64,
    pub(super) share: f64,
    pub(super) limit: Limit,
}

impl Test {
    pub(super) fn of(
        &self,
        own: &Estimate,
        theirs: &Estimate,
        allowed: impl Fn(&Estimate) -> f64,
    ) -> Option<FigureAgreement> {
        let (deviation, allowed) = (own.value - theirs.value, allowed(theirs));
        let of_reference = of_reading(&theirs.uncertainty).into_iter();
        let of_reference = of_reference.map(|part| Component { source: Source::Reference, ..part });
        let components = of_reading(&own.uncertainty).into_iter().chain(of_reference).collect();
        let budget = ErrorBudget::spending(components, self.tail, self.share);
        let verdict = match (judge(deviation, budget.expanded, allowed), self.limit) {
            (Verdict::Missing, _) => return None,
            (_, Limit::Open) | (Verdict::Fail, Limit::NoFailure) => Verdict::Inconclusive,
            (verdict, _) => verdict,
        };
        // What is no number cannot be written.
        let p_value = Some(budget.p_value(deviation, allowed)).filter(|p| p.is_finite())?;
        Some(FigureAgreement { reference: *theirs, deviation, expanded: budget.expanded, allowed, verdict, p_value })
    }
}

#[cfg(test)]
mod tests;
