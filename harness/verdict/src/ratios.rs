//! Ratios of one case to another, engine by engine: how a change of a design changes the light.
//!
//! The errors of two readings cancel only where they are provably one. One factor of all flux must then be the only
//! difference between two scenes, and the readings with their errors must have that ratio. Light is linear in flux, so one
//! reading then determines the other, whatever is wrong with it. All other errors count as stated: standard errors of
//! two runs are independent, and bounds add up, although an engine's bias may well be common. Equal readings alone
//! prove nothing: a change that no sample met changes none.

use luxproof_model::FigureAgreement;
use luxproof_model::MeterRatio;
use luxproof_model::Ratio;
use luxproof_model::Ratios;
use std::collections::HashMap;

use itertools::Itertools;
use luxproof_scene::Meter;

use super::spending::ERROR_SHARE_PER_STAGE;
use super::statistics::{EquivalenceTest, VerdictLimit, is_light, reference_estimate, verdict_limit};
use super::{Judge, MAX_RELATIVE_ERROR};
use luxproof_model::{Basis, Comparison, Tolerance};
use luxproof_model::{EngineName, Estimate, MeterId, ProcedureId, Reading, ReadingKey, Recording, Uncertainty};
use luxproof_spec::content;
use luxproof_spec::procedures::Task;
use luxproof_statistics::upper_tail_of_normal;

/// Readings have a ratio where they do to this relative distance: that of rounding, not of sampling.
const MAX_RATIO_ROUNDING: f64 = 1e-9;

/// The readings and comparisons of a case.
#[derive(Clone, Debug)]
pub struct Measured<'a> {
    pub case: &'a str,
    pub tasks: &'a [Task],
    pub readings: Vec<(&'a ReadingKey, &'a Reading)>,
    pub comparisons: &'a [Comparison],
    /// Recordings without their readings.
    pub recordings: &'a [Recording],
}

impl Judge<'_> {
    /// Ratios of each engine, procedure and set of two cases, with the tolerances of the case after.
    pub fn ratios(&self, before: &Measured<'_>, after: &Measured<'_>) -> Vec<Ratios> {
        let (before, after) = (IndexedCase::new(before), IndexedCase::new(after));
        let mut found = vec![];
        for task in after.case.tasks.iter().filter(|t| is_light(t.quantity)) {
            let Some(earlier) = before.case.tasks.iter().find(|t| t.procedure == task.procedure) else { continue };
            let places: HashMap<&MeterId, &Meter> = earlier.targets.iter().map(|t| (&t.id, &t.meter)).collect();
            let mut meters = vec![];
            for target in &task.targets {
                if places.get(&target.id).is_some_and(|m| has_same_place(m, &target.meter)) {
                    meters.push(&target.id);
                }
            }
            let pair = CasePair { judge: self, before: &before, after: &after, flux: flux_factor(earlier, task) };
            for recording in after.case.recordings.iter().filter(|r| r.key.procedure == task.procedure) {
                found.extend(pair.compare_engine(recording, &meters));
            }
        }
        found
    }
}

fn has_same_place(a: &Meter, b: &Meter) -> bool {
    a.position_m == b.position_m && a.normal == b.normal
}

/// The factor of all flux from one task to another; `None` where anything else differs.
fn flux_factor(before: &Task, after: &Task) -> Option<f64> {
    let (earlier, later) = (first_flux_scale(before)?, first_flux_scale(after)?);
    (content_at_unit_flux(before, earlier) == content_at_unit_flux(after, later)).then_some(later / earlier)
}

fn first_flux_scale(task: &Task) -> Option<f64> {
    task.scene.luminaires.first().map(|l| l.flux_scale).filter(|s| s.is_normal() && *s > 0.0)
}

/// The content of a task with its flux scales divided by `scale`.
fn content_at_unit_flux(task: &Task, scale: f64) -> String {
    let mut unit = task.clone();
    unit.scene.luminaires.iter_mut().for_each(|l| l.flux_scale /= scale);
    content(&unit)
}

type MeterKey<'a> = (ProcedureId, &'a EngineName, &'a MeterId);

/// A case with its readings and comparisons by engine and meter.
struct IndexedCase<'a> {
    case: &'a Measured<'a>,
    readings: HashMap<MeterKey<'a>, &'a Reading>,
    comparisons: HashMap<MeterKey<'a>, Vec<&'a Comparison>>,
}

impl<'a> IndexedCase<'a> {
    fn new(case: &'a Measured<'a>) -> Self {
        let readings = case.readings.iter().filter(|(_, r)| r.value.is_finite());
        let readings = readings.map(|(key, r)| ((key.procedure, &key.engine, &r.meter), *r)).collect();
        let comparisons = case.comparisons.iter().map(|c| ((c.key.procedure, &c.key.engine, &c.meter), c));
        Self { case, readings, comparisons: comparisons.into_group_map() }
    }

    fn recording(&self, key: &ReadingKey) -> Option<&'a Recording> {
        self.case.recordings.iter().find(|r| r.key.procedure == key.procedure && r.key.engine == key.engine)
    }

    fn estimate(&self, key: &MeterKey<'a>) -> Option<Estimate> {
        self.readings.get(key).map(|r| Estimate { value: r.value, uncertainty: r.uncertainty })
    }

    /// The comparison of a meter; `None` where there are several.
    fn single_comparison(&self, key: &MeterKey<'a>) -> Option<&'a Comparison> {
        match self.comparisons.get(key)?[..] {
            [one] => Some(one),
            _ => None,
        }
    }
}

/// The values of one meter in both cases.
struct MeterPair<'a> {
    meter: &'a MeterId,
    read: [Estimate; 2],
    /// The comparisons, where each case has exactly one.
    comparisons: Option<[&'a Comparison; 2]>,
}

struct CasePair<'j, 'a> {
    judge: &'j Judge<'j>,
    before: &'j IndexedCase<'a>,
    after: &'j IndexedCase<'a>,
    /// The factor of all flux, where nothing else differs.
    flux: Option<f64>,
}

impl<'a> CasePair<'_, 'a> {
    /// Compares what an engine read at these meters, set by set.
    fn compare_engine(&self, recording: &'a Recording, meters: &[&'a MeterId]) -> Vec<Ratios> {
        let Some(earlier) = self.before.recording(&recording.key) else { return vec![] };
        let pairs = meters.iter().filter_map(|meter| self.meter_pair(recording, meter));
        let mut found = vec![];
        for (set, pairs) in &pairs.chunk_by(|pair| pair.meter.set_name()) {
            found.push(self.compare_set(set, [earlier, recording], &pairs.collect_vec()));
        }
        self.judge.decide_together(found.iter_mut().flat_map(agreements_mut));
        found
    }

    fn meter_pair(&self, recording: &'a Recording, meter: &'a MeterId) -> Option<MeterPair<'a>> {
        let key = (recording.key.procedure, &recording.key.engine, meter);
        let read = [self.before.estimate(&key)?, self.after.estimate(&key)?];
        let comparisons = self.before.single_comparison(&key).zip(self.after.single_comparison(&key));
        Some(MeterPair { meter, read, comparisons: comparisons.map(|(before, after)| [before, after]) })
    }

    fn compare_set(&self, set: &str, recordings: [&Recording; 2], pairs: &[MeterPair<'_>]) -> Ratios {
        let comparisons: Option<Vec<[&Comparison; 2]>> = pairs.iter().map(|pair| pair.comparisons).collect();
        let basis = comparisons.as_ref().and_then(|comparisons| self.shared_basis(comparisons));
        let mut meters = vec![];
        for pair in pairs {
            let comparisons = basis.and(pair.comparisons).into_iter().collect_vec();
            meters.push(MeterRatio {
                meter: pair.meter.clone(),
                of: self.mean_ratio(recordings, &[pair.read], &comparisons),
            });
        }
        let read = pairs.iter().map(|pair| pair.read).collect_vec();
        let comparisons = comparisons.filter(|_| basis.is_some()).unwrap_or_default();
        let ReadingKey { procedure, engine, .. } = recordings[1].key.clone();
        Ratios {
            before: self.before.case.case.to_owned(),
            after: self.after.case.case.to_owned(),
            procedure,
            engine,
            set: set.to_owned(),
            basis,
            mean: self.mean_ratio(recordings, &read, &comparisons),
            meters,
        }
    }

    /// The basis of all comparisons of both cases, where it is one.
    fn shared_basis(&self, comparisons: &[[&Comparison; 2]]) -> Option<Basis> {
        let [before, after] = [0, 1].map(|k| self.judge.common_basis(&side(comparisons, k)));
        after.filter(|_| before == after)
    }

    /// The ratio of means over some meters, with its agreement where there are comparisons.
    fn mean_ratio(
        &self,
        recordings: [&Recording; 2],
        read: &[[Estimate; 2]],
        comparisons: &[[&Comparison; 2]],
    ) -> Ratio {
        let (ratio, cancels) = self.quotient(read).unzip();
        let agreement = self.agreement(recordings, comparisons);
        Ratio { ratio, agreement, errors_cancel: cancels.unwrap_or(false) }
    }

    /// Tests the ratio of readings against that of their references.
    fn agreement(&self, recordings: [&Recording; 2], comparisons: &[[&Comparison; 2]]) -> Option<FigureAgreement> {
        let tolerance = comparisons.first()?[1].tolerance;
        let (mut readings, mut references) = (vec![], vec![]);
        for [before, after] in comparisons {
            readings.push([reading_estimate(before)?, reading_estimate(after)?]);
            references.push([reference_estimate(before)?, reference_estimate(after)?]);
        }
        let light_before = references.iter().map(|[before, _]| before.value).sum::<f64>() / references.len() as f64;
        let tolerance = Tolerance { absolute: tolerance.absolute / light_before, ..tolerance };
        let (ratio, reference) = (self.quotient(&readings)?.0, self.quotient(&references)?.0);
        self.test(recordings, comparisons).assess(&ratio, &reference, tolerance)
    }

    fn test(&self, recordings: [&Recording; 2], comparisons: &[[&Comparison; 2]]) -> EquivalenceTest {
        let limits = [0, 1].map(|k| verdict_limit(recordings[k], &side(comparisons, k)));
        let has_stages = recordings.iter().any(|r| !r.stages.is_empty());
        EquivalenceTest {
            tail: upper_tail_of_normal(self.judge.tolerances.coverage_factor()),
            share: if has_stages { ERROR_SHARE_PER_STAGE } else { 1.0 },
            limit: limits.into_iter().max().unwrap_or(VerdictLimit::None),
        }
    }

    /// The mean after over the mean before, and whether the errors cancel at all meters; `None` without light before.
    ///
    /// The error of a ratio R of sums A and B is (sum of dA - R dB) / B. Where both errors are one, dA is the flux times
    /// dB. The errors of one case add up, because its meters may share their causes.
    fn quotient(&self, values: &[[Estimate; 2]]) -> Option<(Estimate, bool)> {
        let [before, after] = [0, 1].map(|k| values.iter().map(|v| v[k].value).sum::<f64>());
        let value = after / before;
        let relative_error = Uncertainty::of_dependent_sum(values.iter().map(|[b, _]| (1.0 / before, b.uncertainty)));
        // A quotient by an uncertain number has no interval.
        let is_known = before > 0.0 && relative_error.standard() <= MAX_RELATIVE_ERROR;
        if !is_known || !value.is_finite() {
            return None;
        }
        let (mut terms_before, mut terms_after) = (vec![], vec![]);
        let mut cancelling = 0;
        for [b, a] in values {
            let factor = self.flux.filter(|flux| has_ratio(b, a, *flux));
            terms_before.push(((factor.unwrap_or(0.0) - value) / before, b.uncertainty));
            if factor.is_some() {
                cancelling += 1;
            } else {
                terms_after.push((1.0 / before, a.uncertainty));
            }
        }
        let uncertainty = if values.iter().flatten().any(|of| of.uncertainty == Uncertainty::NotSeen) {
            Uncertainty::NotSeen
        } else {
            let rounding = Uncertainty::Bound(MAX_RATIO_ROUNDING * value);
            let mut sums = vec![
                (1.0, Uncertainty::of_dependent_sum(terms_before)),
                (1.0, Uncertainty::of_dependent_sum(terms_after)),
            ];
            sums.extend((cancelling > 0).then_some((1.0, rounding)));
            Uncertainty::of_sum(sums)
        };
        uncertainty.is_finite().then_some((Estimate { value, uncertainty }, cancelling == values.len()))
    }
}

/// The comparisons of one of the two cases.
fn side<'c>(comparisons: &[[&'c Comparison; 2]], k: usize) -> Vec<&'c Comparison> {
    comparisons.iter().map(|pair| pair[k]).collect()
}

/// A reading with the uncertainty by which it is judged.
fn reading_estimate(comparison: &Comparison) -> Option<Estimate> {
    Some(Estimate { value: comparison.value?, uncertainty: comparison.uncertainty })
}

/// All agreements of a set: of the mean, and of single meters.
fn agreements_mut(ratios: &mut Ratios) -> impl Iterator<Item = &mut FigureAgreement> {
    let of_meters = ratios.meters.iter_mut().filter_map(|m| m.of.agreement.as_mut());
    ratios.mean.agreement.iter_mut().chain(of_meters)
}

/// Whether a reading and its error are those before times a factor, so that the two errors are one.
fn has_ratio(before: &Estimate, after: &Estimate, factor: f64) -> bool {
    let have_errors_ratio = match (positive_error(before), positive_error(after)) {
        (Some(before), Some(after)) => is_factor(after / before, factor),
        (None, None) => true,
        _ => false,
    };
    have_errors_ratio && is_factor(after.value / before.value, factor)
}

fn positive_error(estimate: &Estimate) -> Option<f64> {
    estimate.uncertainty.standard_error().filter(|e| *e > 0.0)
}

fn is_factor(quotient: f64, factor: f64) -> bool {
    (quotient / factor - 1.0).abs() <= MAX_RATIO_ROUNDING
}

#[cfg(test)]
mod step_tests;
#[cfg(test)]
mod tests;
