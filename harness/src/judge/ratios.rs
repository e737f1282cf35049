//! One case over another, engine by engine: what a change of a design makes of the light, held against what it makes of the reference's.
//!
//! Of the errors of two readings only those cancel that are shown to be one: where nothing parts two scenes but one factor of all flux, and the
//! readings, errors and all, are in that very ratio. Light is linear in flux, so that one is the other, whatever is wrong with it. Everything else is
//! taken as it is stated: standard errors of two runs are independent, bounds add up, although an engine's bias may well be common. Equal
//! readings alone show nothing: a change that no sample met makes none.

use std::collections::HashMap;

use itertools::Itertools;
use luminaire::scene::Meter;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::spending::SHARE_OF_A_LOOK;
use super::statistics::{FigureAgreement, Limit, Test, is_light, limit, reference, set};
use super::uncertainty::upper_tail_of_normal;
use super::{Basis, Comparison, Judge, MAX_RELATIVE_ERROR, Tolerance};
use crate::procedures::{Target, Task};
use crate::record::{EngineName, Estimate, MeterId, ProcedureId, Reading, ReadingKey, Recording, Uncertainty};
use crate::spec::content;

/// Readings are in a ratio where they are so to this, relative: rounding of sums, and no chance of samples.
const SAME: f64 = 1e-9;

/// What one engine reads of one set of meters in a case, over what it reads in the case before.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Ratios {
    pub before: String,
    pub after: String,
    pub procedure: ProcedureId,
    pub engine: EngineName,
    /// The set of meters.
    pub set: String,
    /// What it is held against, where that is of one kind.
    pub basis: Option<Basis>,
    /// Of the mean over the meters.
    pub mean: Ratio,
    /// Of each meter that is at the same place in both cases.
    pub meters: Vec<MeterRatio>,
}

/// A value over the value before.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Ratio {
    /// Null where there was no light before, or none that is known.
    pub ratio: Option<Estimate>,
    /// How it agrees with the ratio of the references; null where one is missing.
    pub agreement: Option<FigureAgreement>,
    /// Whether errors of both are one and cancel: nothing but one factor of all flux was changed.
    pub cancels: bool,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MeterRatio {
    pub meter: MeterId,
    #[serde(flatten)]
    pub of: Ratio,
}

/// A case as it was read and judged.
#[derive(Clone, Debug)]
pub struct Measured<'a> {
    pub case: &'a str,
    pub tasks: &'a [Task],
    pub readings: Vec<(&'a ReadingKey, &'a Reading)>,
    pub comparisons: &'a [Comparison],
    /// Their readings are not looked at.
    pub recordings: &'a [Recording],
}

impl Judge<'_> {
    /// Of each engine, procedure and set that two cases have in common; the tolerances are those of the case after.
    pub fn ratios(&self, before: &Measured<'_>, after: &Measured<'_>) -> Vec<Ratios> {
        let (before, after) = (Indexed::of(before), Indexed::of(after));
        let mut found = vec![];
        for task in after.of.tasks.iter().filter(|t| is_light(t.quantity)) {
            let Some(earlier) = before.of.tasks.iter().find(|t| t.procedure == task.procedure) else { continue };
            let places: HashMap<&MeterId, &Meter> = earlier.targets.iter().map(|t| (&t.id, &t.meter)).collect();
            let here = |t: &&Target| places.get(&t.id).is_some_and(|m| is_same(m, &t.meter));
            let meters = task.targets.iter().filter(here).map(|t| &t.id).collect_vec();
            let pair = Pair { judge: self, before: &before, after: &after, flux: flux_factor(earlier, task) };
            for recording in after.of.recordings.iter().filter(|r| r.key.procedure == task.procedure) {
                found.extend(pair.of_engine(recording, &meters));
            }
        }
        found
    }
}

fn is_same(a: &Meter, b: &Meter) -> bool {
    a.position_m == b.position_m && a.normal == b.normal
}

/// How many times the flux of one task that of another is, where nothing else parts them.
fn flux_factor(before: &Task, after: &Task) -> Option<f64> {
    let scale = |task: &Task| task.scene.luminaires.first().map(|l| l.flux_scale).filter(|s| s.is_normal() && *s > 0.0);
    let at_unit = |task: &Task, scale: f64| {
        let mut unit = task.clone();
        unit.scene.luminaires.iter_mut().for_each(|l| l.flux_scale /= scale);
        content(&unit)
    };
    let (earlier, later) = (scale(before)?, scale(after)?);
    (at_unit(before, earlier) == at_unit(after, later)).then_some(later / earlier)
}

/// A case whose readings and comparisons are found by engine and meter.
struct Indexed<'a> {
    of: &'a Measured<'a>,
    readings: HashMap<(ProcedureId, &'a EngineName, &'a MeterId), &'a Reading>,
    /// All that a meter is held against.
    comparisons: HashMap<(ProcedureId, &'a EngineName, &'a MeterId), Vec<&'a Comparison>>,
}

impl<'a> Indexed<'a> {
    fn of(of: &'a Measured<'a>) -> Self {
        let name = |key: &'a ReadingKey, meter| (key.procedure, &key.engine, meter);
        let readings = of.readings.iter().filter(|(_, r)| r.value.is_finite());
        let readings = readings.map(|(key, r)| (name(key, &r.meter), *r)).collect();
        let comparisons = of.comparisons.iter().map(|c| (name(&c.key, &c.meter), c)).into_group_map();
        Self { of, readings, comparisons }
    }

    fn recording(&self, key: &ReadingKey) -> Option<&'a Recording> {
        let is = |r: &&Recording| r.key.procedure == key.procedure && r.key.engine == key.engine;
        self.of.recordings.iter().find(is)
    }
}

/// Both values of one meter: as they were read, as they are believed and as they should be.
struct Both<'a> {
    meter: &'a MeterId,
    read: [Estimate; 2],
    /// Where each is held against one reference.
    held: Option<[&'a Comparison; 2]>,
}

struct Pair<'j, 'a> {
    judge: &'j Judge<'j>,
    before: &'j Indexed<'a>,
    after: &'j Indexed<'a>,
    /// One factor of all flux, where nothing else was changed.
    flux: Option<f64>,
}

impl<'a> Pair<'_, 'a> {
    /// What an engine read of sets of these meters.
    fn of_engine(&self, recording: &'a Recording, meters: &[&'a MeterId]) -> Vec<Ratios> {
        let Some(earlier) = self.before.recording(&recording.key) else { return vec![] };
        let both = meters.iter().filter_map(|meter| self.both(recording, meter));
        let mut found = vec![];
        for (set, both) in &both.chunk_by(|both| set(&both.meter.0)) {
            found.push(self.of_set(set, [earlier, recording], &both.collect_vec()));
        }
        let figures = found.iter_mut().flat_map(|r: &mut Ratios| {
            let of_meters = r.meters.iter_mut().filter_map(|m| m.of.agreement.as_mut());
            r.mean.agreement.iter_mut().chain(of_meters)
        });
        self.judge.decide_together(figures);
        found
    }

    fn both(&self, recording: &'a Recording, meter: &'a MeterId) -> Option<Both<'a>> {
        let name = (recording.key.procedure, &recording.key.engine, meter);
        let of = |case: &Indexed<'a>| {
            case.readings.get(&name).map(|r| Estimate { value: r.value, uncertainty: r.uncertainty })
        };
        let held = |case: &Indexed<'a>| match case.comparisons.get(&name).map(Vec::as_slice) {
            Some([one]) => Some(*one),
            _ => None,
        };
        let (before, after) = (of(self.before)?, of(self.after)?);
        let held = held(self.before).zip(held(self.after)).map(|(before, after)| [before, after]);
        Some(Both { meter, read: [before, after], held })
    }

    fn of_set(&self, set: &str, recordings: [&Recording; 2], both: &[Both<'_>]) -> Ratios {
        let held: Option<Vec<[&Comparison; 2]>> = both.iter().map(|b| b.held).collect();
        let basis = held.as_ref().and_then(|held| {
            let side = |k: usize| held.iter().map(|pair| pair[k]).collect_vec();
            let bases = [0, 1].map(|k| self.judge.common_basis(&side(k)));
            bases[1].filter(|_| bases[0] == bases[1])
        });
        let one = |b: &Both<'_>| MeterRatio {
            meter: b.meter.clone(),
            of: self.of(recordings, &[b.read], &basis.and(b.held).into_iter().collect_vec()),
        };
        let meters = both.iter().map(one).collect();
        let read = both.iter().map(|b| b.read).collect_vec();
        let ReadingKey { procedure, engine, .. } = recordings[1].key.clone();
        Ratios {
            before: self.before.of.case.to_owned(),
            after: self.after.of.case.to_owned(),
            procedure,
            engine,
            set: set.to_owned(),
            basis,
            mean: self.of(recordings, &read, &held.filter(|_| basis.is_some()).unwrap_or_default()),
            meters,
        }
    }

    /// The ratio of means over some meters, of which each is held where any is.
    fn of(&self, recordings: [&Recording; 2], read: &[[Estimate; 2]], held: &[[&Comparison; 2]]) -> Ratio {
        let (ratio, cancels) = self.over(read).unzip();
        let judged = || {
            let believed = |c: &Comparison| Some(Estimate { value: c.value?, uncertainty: c.uncertainty });
            let pair = |pair: &[&Comparison; 2], of: &dyn Fn(&Comparison) -> Option<Estimate>| {
                Some([of(pair[0])?, of(pair[1])?])
            };
            let own: Option<Vec<_>> = held.iter().map(|p| pair(p, &believed)).collect();
            let theirs: Option<Vec<_>> = held.iter().map(|p| pair(p, &|c| reference(c))).collect();
            let (own, theirs) = (own?, theirs?);
            let tolerance = held.first()?[1].tolerance;
            let light_before = theirs.iter().map(|[before, _]| before.value).sum::<f64>() / theirs.len() as f64;
            let allowed = |ratio: &Estimate| {
                Tolerance { absolute: tolerance.absolute / light_before, ..tolerance }.around(ratio.value)
            };
            self.test(recordings, held).of(&self.over(&own)?.0, &self.over(&theirs)?.0, allowed)
        };
        let agreement = (!held.is_empty()).then(judged).flatten();
        Ratio { ratio, agreement, cancels: cancels.unwrap_or(false) }
    }

    fn test(&self, recordings: [&Recording; 2], held: &[[&Comparison; 2]]) -> Test {
        let limits = [0, 1].map(|k| limit(recordings[k], &held.iter().map(|pair| pair[k]).collect_vec()));
        let share = |r: &&Recording| if r.looks.is_empty() { 1.0 } else { SHARE_OF_A_LOOK };
        Test {
            tail: upper_tail_of_normal(self.judge.tolerances.coverage_factor()),
            share: recordings.iter().map(share).fold(1.0, f64::min),
            limit: limits.into_iter().max().unwrap_or(Limit::None),
        }
    }

    /// The mean after over the mean before, and whether their errors cancel at all meters; `None` of no light before.
    ///
    /// The error of a ratio R of sums A and B is (sum of dA - R dB) / B, in which dA is the flux times dB where both are one. Errors of one
    /// case add up, since its meters may share what makes them.
    fn over(&self, values: &[[Estimate; 2]]) -> Option<(Estimate, bool)> {
        let [before, after] = [0, 1].map(|k| values.iter().map(|v| v[k].value).sum::<f64>());
        let value = after / before;
        let own = values.iter().map(|[b, _]| (1.0 / before, b.uncertainty));
        // A quotient of what is hardly known has no interval about it.
        let is_known = before > 0.0 && Uncertainty::of_dependent_sum(own).standard() <= MAX_RELATIVE_ERROR;
        if !is_known || !value.is_finite() {
            return None;
        }
        let factors = values.iter().map(|[b, a]| self.flux.filter(|flux| is_one(b, a, *flux))).collect_vec();
        let pairs = || values.iter().zip(&factors);
        let of_before = pairs().map(|([b, _], one)| ((one.unwrap_or(0.0) - value) / before, b.uncertainty));
        let of_after = pairs().filter(|(_, one)| one.is_none()).map(|([_, a], _)| (1.0 / before, a.uncertainty));
        let (of_before, of_after) = (Uncertainty::of_dependent_sum(of_before), Uncertainty::of_dependent_sum(of_after));
        let rounding = factors.iter().any(Option::is_some).then_some((1.0, Uncertainty::Bound(SAME * value)));
        let is_unseen = |of: &Estimate| of.uncertainty == Uncertainty::NotSeen;
        let uncertainty = if values.iter().flatten().any(is_unseen) {
            Uncertainty::NotSeen
        } else {
            Uncertainty::of_sum([(1.0, of_before), (1.0, of_after)].into_iter().chain(rounding))
        };
        let ratio = Estimate { value, uncertainty };
        ratio.uncertainty.is_finite().then(|| (ratio, factors.iter().all(Option::is_some)))
    }
}

/// Whether a reading is the one before times this factor, so that what is wrong with one is wrong with the other.
fn is_one(before: &Estimate, after: &Estimate, factor: f64) -> bool {
    let is_factor = |x: f64| (x / factor - 1.0).abs() <= SAME;
    let error = |of: &Estimate| of.uncertainty.standard_error().filter(|e| *e > 0.0);
    let are_alike = match (error(before), error(after)) {
        (Some(before), Some(after)) => is_factor(after / before),
        (None, None) => true,
        _ => false,
    };
    are_alike && is_factor(after.value / before.value)
}

#[cfg(test)]
mod tests;
