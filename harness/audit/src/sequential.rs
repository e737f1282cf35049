//! Group sequential sampling: an engine renders only the undecided points again, in at most [`MAX_STAGES`] stages.
//!
//! The first stage is the plan's own job. Each further stage is one job for the sensors that are still undecided.
//! It has another seed and another slice of the budget, a few times as long as all earlier stages together.
//! Engines take seconds to start, so there are few stages.
//!
//! Stages are combined with weights that are fixed in advance, in proportion to the granted effort. A reading thus
//! cannot choose its own weight. A stage that the time limit cut short weighs less, by its share of finished blocks.
//! It counts only where it makes the interval narrower than it was, whatever the values are. So a reading never becomes
//! worse by a stage that was cut, and is not chosen by its value.
//! An engine that meets no light stops at its fewest samples, because nothing varies. Such a stage weighs as much less
//! as it did less than it was granted.
//! Seconds are those that engines count, so that results do not depend on the clock; user programs count none.
//! Alpha spending over the planned stages keeps the error rate ([`luxproof_verdict::ERROR_SHARE_PER_STAGE`]).

use std::collections::BTreeSet;
use std::time::Duration;

use crate::measure::Cost;
use luxproof_engines::Measurement;
use luxproof_model::{Basis, Comparison, Component, ErrorBudget, Source, Verdict};
use luxproof_model::{Estimate, MeterId, Reading, Recording, Uncertainty};
use luxproof_spec::Budget;
use luxproof_spec::procedures::Task;
use luxproof_statistics::error_budget;
use luxproof_verdict::{Judge, MAX_STAGES};

/// The effort of all stages together, as a multiple of the first stage, where that is as accurate as the spec requests.
const TOTAL_EFFORT_OF_FIRST: f64 = 27.0;
/// The effort of all stages together, as a multiple of what the spec requests, where the first stage is coarser.
const TOTAL_EFFORT_OF_SPEC: f64 = 2.0;
/// The logarithm of the total effort grows as this power of the number of stages.
///
/// It grows slowly at first: most points that the first stage leaves open lie within the tolerance by one standard
/// error. It grows fast at last, for points close to the tolerance.
const EFFORT_GROWTH_EXPONENT: f64 = 1.25;
/// A stage below this share of the first one's effort is not worth the start of an engine.
const MIN_STAGE_WEIGHT: f64 = 0.5;
/// The least duration of a first stage, in seconds: one that was mirrored or read from another case took no time.
const MIN_FIRST_STAGE_S: f64 = 1.0;
/// Standard errors of the first stage within a tolerance, where sampling stops as soon as it is decided.
///
/// Such a stage decides every deviation up to a third of the tolerance. Larger deviations are worth a further stage.
const FIRST_STAGE_ERRORS_IN_TOLERANCE: f64 = 3.75;
/// The share of the budget's seconds that the first stage gets, likewise.
const FIRST_STAGE_SHARE: f64 = 0.5;

/// The probability on either side of the intervals that are compared where the time limit cut a stage.
const INTERVAL_TAIL: f64 = 0.005;

/// Below this exponent an engine ignores its budget; weight its stages equally.
///
/// The exponent is that of the standard error over the effort, relative to the ideal square root.
const MIN_EFFORT_EXPONENT: f64 = 0.5;

/// What a further stage requests of an engine.
#[derive(Clone, Debug, PartialEq)]
pub struct StageRequest {
    /// The number of the stage, counted from 1.
    pub stage: u32,
    /// The task's targets that are still undecided.
    pub targets: Vec<usize>,
    /// The slice of the budget.
    pub budget: Budget,
    /// The time limit of the stage, by the clock.
    pub patience: Duration,
}

/// One estimate for each sensor of the requested targets, and their cost; the error says why there is none.
pub type StageResult = Result<(Measurement, Cost), String>;

/// The first stage's budget where sampling stops as soon as comparisons are decided.
pub fn first_stage_budget(budget: Budget, tolerance_relative: f64) -> Budget {
    Budget {
        relative_error: budget.relative_error.max(tolerance_relative / FIRST_STAGE_ERRORS_IN_TOLERANCE),
        seconds: FIRST_STAGE_SHARE * budget.seconds,
    }
}

/// Samples a recording in further stages until its comparisons are decided or the budget is spent.
///
/// `witnesses` are the other recordings of the task. `first` is the budget of the recording so far, `budget` the whole
/// one.
pub fn sample_until_decided(
    judge: &Judge<'_>,
    task: &Task,
    witnesses: &[&Recording],
    subject: &mut Recording,
    (first, budget): (Budget, Budget),
    sample: &mut dyn FnMut(&StageRequest) -> StageResult,
) {
    if subject.failure.is_some() || !subject.readings.iter().any(|r| r.uncertainty.is_sampled()) {
        return;
    }
    subject.stages = vec![1; subject.readings.len()];
    let ignores_budget = ignores_budget(subject);
    let first_cut = subject.cut_to.unwrap_or(1.0);
    let first_s = (subject.work_s() / first_cut).clamp(MIN_FIRST_STAGE_S, first.seconds.max(MIN_FIRST_STAGE_S));
    let mut spent_s = seconds_of_stage(subject.work_s(), subject.cut_to, first);
    // The weight of all stages behind each reading.
    let mut weights = vec![if ignores_budget { 1.0 } else { first_cut }; subject.readings.len()];
    for stage in 2..=MAX_STAGES {
        let targets = undecided_targets(judge, task, witnesses, subject);
        if targets.is_empty() {
            break;
        }
        let left_s = budget.seconds - spent_s;
        if left_s <= 0.0 {
            break;
        }
        let mut affordable = left_s / first_s;
        if subject.work_s.is_none() {
            // Without a count of work only the clock is left; powers of two make the result nearly independent of it.
            affordable = affordable.log2().floor().exp2();
        }
        let weight = stage_weight(stage, first.relative_error / budget.relative_error).min(affordable);
        if weight < MIN_STAGE_WEIGHT {
            break;
        }
        let relative_error = first.relative_error / weight.sqrt();
        let budget = Budget { relative_error, seconds: (weight * first_s).min(left_s) };
        let request = StageRequest { stage, targets, budget, patience: budget.patience() };
        let (measurement, cost) = match sample(&request) {
            Ok(taken) => taken,
            Err(why) => {
                subject.notes.push(format!("stage {stage} at {} meters gave nothing: {why}", request.targets.len()));
                break;
            }
        };
        subject.notes.push(format!("stage {stage}: {} undecided meters were asked for more", request.targets.len()));
        subject.wall_s += cost.wall_s;
        spent_s += seconds_of_stage(measurement.work_s.unwrap_or(cost.wall_s), measurement.cut_to, request.budget);
        subject.work_s = measurement.work_s.map(|work_s| work_s + subject.work_s());
        subject.cut_to = [subject.cut_to, measurement.cut_to].into_iter().flatten().reduce(f64::min);
        subject.skewness = measurement.skewness().or(subject.skewness);
        subject.effort.extend(measurement.effort.iter().map(|(k, v)| (format!("stage{stage}_{k}"), v.clone())));
        let estimates = measurement.readings(request.targets.iter().map(|k| &task.targets[*k]));
        let full_weight = if ignores_budget { 1.0 } else { weight * measurement.cut_to.unwrap_or(1.0) };
        let done = (measurement.work_s.unwrap_or(cost.wall_s) / request.budget.seconds).min(1.0);
        let mut left_out = 0;
        for (&k, estimate) in request.targets.iter().zip(&estimates) {
            let reading = &mut subject.readings[k];
            let is_stopped_early = !ignores_budget && met_nothing(estimate);
            let effective_weight = if is_stopped_early { full_weight.min(weight * done) } else { full_weight };
            if measurement.cut_to.is_some()
                && widens(reading.uncertainty, weights[k], estimate.uncertainty, effective_weight)
            {
                left_out += 1;
                continue;
            }
            add_stage(reading, weights[k], estimate, effective_weight);
            weights[k] += effective_weight;
            subject.stages[k] = stage;
        }
        if left_out > 0 {
            subject.notes.push(format!(
                "time limit: stage {stage} was cut too short to count at {left_out} meters, which keep their earlier readings"
            ));
        }
    }
}

/// The seconds of the budget that a stage used: what the engine counts, or all that it was granted where the time limit cut it.
fn seconds_of_stage(work_s: f64, cut_to: Option<f64>, granted: Budget) -> f64 {
    if cut_to.is_some() { work_s.max(granted.seconds) } else { work_s }
}

/// Whether a stage of this weight makes the interval of a reading wider.
///
/// The values do not count, so the choice does not favour any of them.
fn widens(reading: Uncertainty, weight_before: f64, stage: Uncertainty, weight: f64) -> bool {
    let both = Uncertainty::of_stages([(weight_before, reading), (weight, stage)]);
    match (half_width(reading), half_width(both)) {
        (Some(before), Some(after)) => after > before,
        _ => false,
    }
}

/// The half width of the 99 % interval of a standard error; `None` where there is none.
fn half_width(uncertainty: Uncertainty) -> Option<f64> {
    let error = uncertainty.standard_error()?;
    let component = Component::normal(Source::MonteCarlo, error, uncertainty.degrees_of_freedom());
    Some(error_budget::budget(vec![component], INTERVAL_TAIL).expanded)
}

/// Whether every comparison of a recording is decided.
pub fn is_decided(judge: &Judge<'_>, task: &Task, witnesses: &[&Recording], subject: &Recording) -> bool {
    judge.compare_one(task, subject, witnesses).iter().all(|c| c.verdict != Verdict::Undecided)
}

/// Whether an engine samples as much whatever effort it is granted, as its repeated readings show.
fn ignores_budget(subject: &Recording) -> bool {
    let exponents = subject.stated_errors.iter().filter_map(|s| s.effort_exponent);
    exponents.reduce(f64::min).is_some_and(|exponent| exponent < MIN_EFFORT_EXPONENT)
}

/// What a recording leaves of its budget by the clock.
pub fn patience_left(recording: &Recording, budget: Budget) -> Duration {
    budget.patience().saturating_sub(Duration::try_from_secs_f64(recording.wall_s).unwrap_or_default())
}

/// The effort of a stage relative to the first one; `coarser` is the first one's error relative to the requested error.
fn stage_weight(stage: u32, coarser: f64) -> f64 {
    let total = (TOTAL_EFFORT_OF_SPEC * coarser * coarser).max(TOTAL_EFFORT_OF_FIRST);
    cumulative_effort(stage, total) - cumulative_effort(stage - 1, total)
}

/// The effort of all stages up to this one, where all planned stages take `total`.
fn cumulative_effort(stage: u32, total: f64) -> f64 {
    total.powf((f64::from(stage - 1) / f64::from(MAX_STAGES - 1)).powf(EFFORT_GROWTH_EXPONENT))
}

/// Whether no sample met any light, so that nothing varied.
fn met_nothing(estimate: &Estimate) -> bool {
    let is_sampled = estimate.uncertainty == Uncertainty::NotSeen || estimate.uncertainty.standard_error() == Some(0.0);
    estimate.value == 0.0 && is_sampled
}

/// Adds the estimate of a stage to a reading, with weights that were fixed in advance.
fn add_stage(reading: &mut Reading, weight_before: f64, stage: &Estimate, weight: f64) {
    reading.value = (weight_before * reading.value + weight * stage.value) / (weight_before + weight);
    reading.uncertainty = Uncertainty::of_stages([(weight_before, reading.uncertainty), (weight, stage.uncertainty)]);
}

/// The targets at which more samples would decide a comparison.
fn undecided_targets(judge: &Judge<'_>, task: &Task, witnesses: &[&Recording], subject: &Recording) -> Vec<usize> {
    let compared = judge.compare_one(task, subject, witnesses);
    targets_of(task, compared.iter().filter(|c| sampling_factor(c).is_some_and(f64::is_finite)))
}

/// The indices of the task's targets that the comparisons are about.
fn targets_of<'a>(task: &Task, comparisons: impl Iterator<Item = &'a Comparison>) -> Vec<usize> {
    let meters: BTreeSet<&MeterId> = comparisons.map(|c| &c.meter).collect();
    (0..task.targets.len()).filter(|k| meters.contains(&task.targets[*k].id)).collect()
}

/// The targets at which a comparison is undecided because of its reference.
pub fn undecided_by_reference(judge: &Judge<'_>, task: &Task, recordings: &[&Recording]) -> Vec<usize> {
    let compared = judge.compare(task, recordings);
    let undecided = compared.iter().filter(|c| c.verdict == Verdict::Undecided);
    targets_of(task, undecided.filter(|c| is_blurred_by_reference(c).unwrap_or(false)))
}

/// Whether an exact reference's own error takes more than half of the way from the deviation to the tolerance.
fn is_blurred_by_reference(c: &Comparison) -> Option<bool> {
    let (reference, budget) = (c.reference.as_ref()?, c.budget.as_ref()?);
    let variance = variance(budget, |source| source == Source::Reference);
    let way = (c.tolerance.around(reference.value) - c.deviation?.abs()).abs();
    Some(reference.basis == Basis::Simulator && budget.coverage_factor * variance.sqrt() > 0.5 * way)
}

/// The sum of the squared uncertainties of the chosen sources.
pub(super) fn variance(budget: &ErrorBudget, is_chosen: impl Fn(Source) -> bool) -> f64 {
    budget.components.iter().filter(|part| is_chosen(part.source)).map(|part| part.uncertainty.powi(2)).sum()
}

/// Few samples make a coverage factor large; further ones bring it down to this.
const COVERAGE_FACTOR_OF_MANY_SAMPLES: f64 = 2.1;

/// How many times its samples an undecided comparison may need; `None` where it is decided or not sampled.
///
/// It serves to choose points, and is too uncertain to be shown. The deviation is the present one. Where no number of samples would decide that, it is the nearest deviation that the
/// samples allow. The result is infinite where no number of samples decides either of them.
pub(super) fn sampling_factor(comparison: &Comparison) -> Option<f64> {
    if comparison.verdict != Verdict::Undecided {
        return None;
    }
    if comparison.uncertainty == Uncertainty::NotSeen {
        return Some(1.0);
    }
    let (budget, deviation) = (comparison.budget.as_ref()?, comparison.deviation?);
    let sampled = variance(budget, |source| source == Source::MonteCarlo);
    let fixed = variance(budget, |source| source != Source::MonteCarlo);
    if sampled == 0.0 {
        return None;
    }
    let allowed = comparison.tolerance.around(comparison.reference.as_ref()?.value);
    let coverage_factor = budget.coverage_factor.min(COVERAGE_FACTOR_OF_MANY_SAMPLES);
    let (now, reach) = (allowed - deviation.abs(), budget.coverage_factor * sampled.sqrt());
    // With further samples the deviation moves, at most by its own error and at most to zero.
    let ways = [now.abs(), (now + reach).min(allowed), reach - now];
    let variances = ways.into_iter().filter(|way| *way > 0.0).map(|way| (way / coverage_factor).powi(2) - fixed);
    let needed = variances.into_iter().find(|needed| *needed > 0.0);
    Some(needed.map_or(f64::INFINITY, |needed| (sampled / needed).max(1.0)))
}

/// What stopping at a decision saved, relative to sampling on to the spec's own error; `None` where it saved nothing.
///
/// The caller makes sure that everything is decided.
pub fn describe_savings(subject: &Recording, budget: Budget) -> Option<String> {
    let worst = subject.readings.iter().filter_map(relative_error).fold(0.0, f64::max);
    // The seconds of the whole budget may not suffice for the requested error.
    let affordable = budget.seconds / subject.work_s().max(MIN_FIRST_STAGE_S);
    let times = (worst / budget.relative_error).powi(2).min(affordable);
    let stages = subject.stages.iter().copied().max().filter(|_| times > 1.5)?;
    Some(format!(
        "decided at stage {stages} of {MAX_STAGES}, at a standard error of {:.2} %: sampling stopped, where {times:.1} times the samples \
         would have been taken on the way to {:.2} %",
        100.0 * worst,
        100.0 * budget.relative_error
    ))
}

/// The relative standard error of a reading that is sampled and not dark.
fn relative_error(reading: &Reading) -> Option<f64> {
    reading.uncertainty.standard_error().filter(|_| reading.value > 0.0).map(|error| error / reading.value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::undecided::explain_undecided;
    use luxproof_model::Tolerance;
    use luxproof_process::random::normal;
    use luxproof_verdict::fixtures::{built_in, task};

    /// An engine with given true values and normal noise that falls with the granted seconds.
    struct Synthetic {
        truth: Vec<f64>,
        noise: f64,
        blocks: usize,
        random: fastrand::Rng,
    }

    impl Synthetic {
        fn measurement(&mut self, targets: &[usize], effort: f64) -> Measurement {
            let sigma = self.noise / effort.sqrt() * (self.blocks as f64).sqrt();
            let mut estimates = vec![];
            for &k in targets {
                let blocks = (0..self.blocks).map(|_| self.truth[k] + sigma * normal(&mut self.random));
                estimates.push(Estimate::of_samples(&blocks.collect::<Vec<f64>>()));
            }
            Measurement { estimates, ..Measurement::default() }
        }
    }

    fn budget_of(seconds: f64) -> Budget {
        Budget { relative_error: 0.004, seconds }
    }

    fn recording(engine: &str, estimates: &[Estimate]) -> Recording {
        Recording { wall_s: 1.0, ..luxproof_verdict::fixtures::recording(engine, estimates) }
    }

    /// One run of an engine that reaches a relative error of `noise` in one second.
    ///
    /// Its meters deviate by `deviations` from a reference of 1, with a tolerance of 2 %.
    fn run_within(
        deviations: &[f64],
        (first, whole): (Budget, Budget),
        (noise, blocks): (f64, usize),
        seed: u64,
    ) -> (Vec<Verdict>, Vec<StageRequest>, Recording) {
        let effort = |relative_error: f64| (noise / relative_error).powi(2);
        let truth = deviations.iter().map(|d| 1.0 + d).collect();
        let random = fastrand::Rng::with_seed(seed);
        let mut engine = Synthetic { truth, noise, blocks, random };
        let targets: Vec<usize> = (0..deviations.len()).collect();
        let first_s = effort(first.relative_error);
        let mut subject = recording("radiance", &engine.measurement(&targets, first_s).estimates);
        subject.work_s = Some(first_s);
        let exact = recording("simulator", &vec![Estimate::exact(1.0); deviations.len()]);
        let (judge, task) = (built_in(), task(deviations.len()));
        let mut asked = vec![];
        sample_until_decided(&judge, &task, &[&exact], &mut subject, (first, whole), &mut |request| {
            asked.push(request.clone());
            let work_s = effort(request.budget.relative_error);
            let measurement = engine.measurement(&request.targets, work_s);
            Ok((Measurement { work_s: Some(work_s), ..measurement }, Cost::default()))
        });
        let mut compared = judge.compare(&task, &[&exact, &subject]);
        compared.retain(|c| c.key.engine == "radiance");
        explain_undecided(&mut compared, &[], &[], whole);
        for c in &compared {
            assert_eq!(c.verdict == Verdict::Undecided, c.diagnosis.is_some(), "{c:?}");
        }
        (compared.iter().map(|c| c.verdict).collect(), asked, subject)
    }

    fn run(deviations: &[f64], seconds: f64, blocks: usize, seed: u64) -> (Vec<Verdict>, Vec<StageRequest>, Recording) {
        run_within(deviations, (budget_of(1.0), budget_of(seconds)), (0.004, blocks), seed)
    }

    #[test]
    fn a_reference_blurs_where_its_interval_takes_more_than_half_of_the_way_to_the_tolerance() {
        let exact = recording("simulator", &[Estimate::exact(1.0)]);
        let subject = recording("radiance", &[Estimate::exact(1.01)]);
        let compared = built_in().compare_one(&task(1), &subject, &[&exact, &subject]).remove(0);
        // Tolerances of .03: .02 of the way is left on either side of it. Half of that is two standard uncertainties of .005.
        for (deviation, uncertainty, is_blurred) in
            [(0.01, 0.0051, true), (0.01, 0.0049, false), (-0.05, 0.0051, true), (-0.05, 0.0049, false)]
        {
            let parts = vec![Component::normal(Source::Reference, uncertainty, None)];
            let budget = ErrorBudget { coverage_factor: 2.0, ..error_budget::budget(parts, INTERVAL_TAIL) };
            let tolerance = Tolerance { relative: 0.03, absolute: 0.0 };
            let (budget, deviation) = (Some(budget), Some(deviation));
            let comparison = Comparison { budget, deviation, tolerance, ..compared.clone() };
            assert_eq!(is_blurred_by_reference(&comparison), Some(is_blurred), "{deviation:?} {uncertainty}");
        }
    }

    #[test]
    fn savings_grow_with_the_square_of_the_error() {
        // An error of 2 % where 1 % is asked for: four times the samples, unless the seconds allow fewer.
        let estimate = Estimate { value: 100.0, uncertainty: Uncertainty::sampled(2.0, None) };
        let subject = Recording { stages: vec![2], work_s: Some(10.0), ..recording("radiance", &[estimate]) };
        for (seconds, times) in [(600.0, "where 4.0 times"), (30.0, "where 3.0 times")] {
            let text = describe_savings(&subject, Budget { relative_error: 0.01, seconds }).unwrap();
            assert!(text.contains(times) && text.contains("stage 2 of 4"), "{text}");
        }
        assert_eq!(describe_savings(&subject, Budget { relative_error: 0.01, seconds: 14.0 }), None);
    }

    #[test]
    fn sampling_until_decided_decides_as_accurate_sampling_does_in_a_thousand_pairs() {
        // A budget that cuts the last stage short leaves some points open; a larger one costs more.
        let (cost, _) = in_pairs(Budget { relative_error: 0.0005, seconds: 100.0 }, 0.004);
        assert!(cost[1] < 0.6 * cost[0], "{cost:?}");
        let whole = Budget { relative_error: 0.0005, seconds: 600.0 };
        let (cost, [both, contrary, only_accurate, only_decided]) = in_pairs(whole, 0.01);
        let summary = format!(
            "{both} decided by both, {contrary} contrary, {only_accurate} and {only_decided} by one; {cost:?} s"
        );
        // Both leave a few points at the edge undecided, and neither more of them than the other.
        assert!(contrary <= 6 && cost[1] < cost[0], "{summary}");
        assert!(only_accurate + only_decided < both / 25 && only_accurate <= only_decided + both / 100, "{summary}");
    }

    /// Compares accurate sampling with sampling until decided, in a thousand pairs of runs.
    ///
    /// Returns the seconds of each, and the numbers of comparisons that both decide, that both decide contrarily, and
    /// that only the first or only the second decides.
    fn in_pairs(whole: Budget, noise: f64) -> ([f64; 2], [usize; 4]) {
        let decided = first_stage_budget(whole, 0.02);
        let (mut both, mut contrary, mut only_accurate, mut only_decided, mut cost) = (0, 0, 0, 0, [0.0; 2]);
        for seed in 0..1000 {
            let mut random = fastrand::Rng::with_seed(seed);
            let deviations: Vec<f64> = (0..6).map(|_| 0.015 * normal(&mut random)).collect();
            let pair = [whole, decided].map(|first| run_within(&deviations, (first, whole), (noise, 16), 7000 + seed));
            for (total, one) in cost.iter_mut().zip(&pair) {
                *total += one.2.work_s();
            }
            for (accurate, decided) in pair[0].0.iter().zip(&pair[1].0) {
                match (*accurate == Verdict::Undecided, *decided == Verdict::Undecided) {
                    (false, false) => {
                        both += 1;
                        contrary += usize::from(accurate != decided);
                    }
                    (false, true) => only_accurate += 1,
                    (true, false) => only_decided += 1,
                    (true, true) => {}
                }
            }
        }
        (cost, [both, contrary, only_accurate, only_decided])
    }

    #[test]
    fn stopping_early_decides_wrongly_in_five_percent_of_2000_runs_at_most() {
        const RUNS: u64 = 2000;
        // At the very edge of the tolerance every failure is wrong from within and every pass from without. Two
        // standard deviations of a share of .05 over 2000 runs are .01, but the share itself must keep to .05.
        for (deviations, wrong) in [
            ([0.01999; 4], Verdict::Fail),
            ([-0.01999; 4], Verdict::Fail),
            ([0.02001; 4], Verdict::Pass),
            ([0.019, 0.005, 0.0, -0.018], Verdict::Fail),
        ] {
            let verdicts = (0..RUNS).map(|seed| run(&deviations, 1e3, 8, seed).0);
            let count = verdicts.filter(|verdicts| is_wrong(verdicts, wrong)).count();
            let share = count as f64 / RUNS as f64;
            assert!(share <= 0.05, "{deviations:?}: {share} wrong");
        }
    }

    /// Whether a family of meters has the wrong verdict.
    fn is_wrong(verdicts: &[Verdict], wrong: Verdict) -> bool {
        match wrong {
            // The family fails where any meter does.
            Verdict::Fail => verdicts.contains(&Verdict::Fail),
            // The family passes where all meters do; a single meter is the harder case.
            _ => verdicts[0] == Verdict::Pass,
        }
    }

    #[test]
    fn without_spending_the_same_stages_would_decide_wrongly_too_often() {
        // The negative control: at each stage the whole error, until one decides.
        let wrong = (0..2000).filter(|seed| {
            let mut random = fastrand::Rng::with_seed(*seed);
            let (mut sum, mut weight) = (0.0, 0.0);
            [1.0, 2.0, 6.0, 18.0].iter().any(|w: &f64| {
                sum += w.sqrt() * normal(&mut random);
                weight += w;
                // One-sided at 5 %: z = 1.645.
                sum / f64::sqrt(weight) > 1.645
            })
        });
        let share = wrong.count() as f64 / 2000.0;
        assert!(share > 0.08, "{share}");
    }

    #[test]
    fn a_program_that_took_longer_than_it_was_given_is_asked_for_no_more() {
        let exact = recording("simulator", &[Estimate::exact(1.0)]);
        let edge = Estimate { value: 1.02, uncertainty: Uncertainty::sampled(0.004, None) };
        let (mut subject, whole) = (recording("mine", &[edge]), Budget { relative_error: 0.004, seconds: 0.5 });
        assert!(subject.work_s.is_none() && subject.wall_s > whole.seconds);
        sample_until_decided(&built_in(), &task(1), &[&exact], &mut subject, (whole, whole), &mut |r| panic!("{r:?}"));
    }

    #[test]
    fn what_is_decided_is_not_asked_again_and_what_is_not_is_decided_in_the_end() {
        let (verdicts, asked, subject) = run(&[0.0, 0.0, 0.013, 0.06], 1e3, 16, 5);
        assert_eq!(verdicts, [Verdict::Pass, Verdict::Pass, Verdict::Pass, Verdict::Fail]);
        assert!(!asked.is_empty() && asked.iter().all(|a| a.targets == [2]), "{asked:?}");
        assert_eq!((subject.stages[0], subject.stages[3]), (1, 1));
        assert!(subject.stages[2] > 1);
    }

    #[test]
    fn without_budget_nothing_is_asked_and_the_price_is_reported() {
        let (verdicts, asked, _) = run(&[0.0185, 0.0], 1.2, 16, 6);
        assert_eq!(verdicts, [Verdict::Undecided, Verdict::Pass]);
        assert!(asked.is_empty());
    }

    #[test]
    fn what_chance_may_have_put_near_the_tolerance_is_asked_for_more_and_what_is_there_for_good_is_not() {
        // The deviation leaves .1 % to the tolerance, and the reference takes .3 %.
        let factor = factor_at(0.019, 0.006, 0.003);
        assert!(factor.is_some_and(f64::is_finite), "{factor:?}");
        assert_eq!(factor_at(0.019, 0.0002, 0.003), Some(f64::INFINITY));
    }

    /// The sampling factor of a meter with this deviation and error, against a reference within a bound.
    fn factor_at(deviation: f64, error: f64, reference_bound: f64) -> Option<f64> {
        let reference = Estimate { value: 1.0, uncertainty: Uncertainty::Bound(reference_bound) };
        let all = [recording("simulator", &[reference]), recording("radiance", &[estimate(1.0 + deviation, error)])];
        let compared = built_in().compare(&task(1), &all.iter().collect::<Vec<_>>());
        compared.iter().find(|c| c.key.engine == "radiance").and_then(sampling_factor)
    }

    #[test]
    fn looks_are_weighted_by_what_they_were_granted_not_by_what_they_read() {
        let mut reading = recording("e", &[estimate(1.0, 0.3)]).readings.remove(0);
        add_stage(&mut reading, 1.0, &estimate(2.0, 0.1), 3.0);
        assert!((reading.value - 1.75).abs() < 1e-15);
        assert!((reading.uncertainty.standard_error().unwrap() - 0.3_f64.hypot(0.3) / 4.0).abs() < 1e-15);
    }

    #[test]
    fn a_stage_that_the_clock_cut_short_weighs_as_much_less() {
        for (cut_to, share) in [(None, 1.0), (Some(0.25), 0.25)] {
            let weight = share * stage_weight(2, 1.0);
            let value = reading_after_stage(estimate(1.019, 0.004), None, estimate(1.5, 0.004), cut_to).value;
            assert!((value - (1.019 + 1.5 * weight) / (1.0 + weight)).abs() < 1e-12, "{value}");
        }
    }

    #[test]
    fn a_first_stage_that_the_clock_cut_short_weighs_as_much_less() {
        let weight = stage_weight(2, 1.0);
        let value = reading_after_stage(estimate(1.019, 0.004), Some(0.1), estimate(1.5, 0.004), None).value;
        assert!((value - (0.1 * 1.019 + 1.5 * weight) / (0.1 + weight)).abs() < 1e-12, "{value}");
    }

    #[test]
    fn a_cut_stage_of_few_blocks_never_widens_a_good_reading() {
        let sampled =
            |value, error, freedom| Estimate { value, uncertainty: Uncertainty::sampled(error, Some(freedom)) };
        // As a busy machine did: 24 blocks first, and then four of what would have been hundreds.
        let good = sampled(1.019, 0.005, 21.0);
        for cut_to in [0.5, 0.1, 0.005] {
            let reading = reading_after_stage(good, None, sampled(1.1, 0.07, 1.8), Some(cut_to));
            assert!(half_width(reading.uncertainty) <= half_width(good.uncertainty), "{cut_to}: {reading:?}");
        }
        // Equally many blocks of the same noise count.
        let reading = reading_after_stage(good, None, sampled(1.02, 0.005, 21.0), Some(0.5));
        assert!(reading.uncertainty.standard() < 0.004, "{reading:?}");
    }

    #[test]
    fn leaving_out_stages_that_widen_the_interval_keeps_its_error_rate() {
        const RUNS: usize = 20_000;
        let mut random = fastrand::Rng::with_seed(9);
        let (mut missed, mut left_out) = (0, 0);
        for _ in 0..RUNS {
            // Four blocks of the same size after 12: a quarter of all samples.
            let [before, stage] = [12, 4].map(|blocks| {
                let samples: Vec<f64> = (0..blocks).map(|_| normal(&mut random)).collect();
                Estimate::of_samples(&samples)
            });
            let mut reading = recording("e", &[before]).readings.remove(0);
            if widens(reading.uncertainty, 12.0, stage.uncertainty, 4.0) {
                left_out += 1;
            } else {
                add_stage(&mut reading, 12.0, &stage, 4.0);
            }
            missed += usize::from(half_width(reading.uncertainty).is_none_or(|width| reading.value.abs() > width));
        }
        // 1 % is allowed; its standard deviation over so many runs is 0.07 %.
        assert!((RUNS / 20..19 * RUNS / 20).contains(&left_out), "{left_out}");
        assert!(missed as f64 / (RUNS as f64) < 0.012, "{missed}");
    }

    #[test]
    fn a_stage_that_met_no_light_weighs_what_it_did_of_its_grant() {
        // A point sees a sliver of a large luminaire: one sample in forty meets it. Eight samples meet nothing.
        let first = Estimate { value: 1.0, uncertainty: Uncertainty::sampled(0.03, Some(20_000.0)) };
        for nothing in [Uncertainty::sampled(0.0, Some(3.7)), Uncertainty::NotSeen] {
            let dark = Estimate { value: 0.0, uncertainty: nothing };
            let stopped = reading_after_stages(first, dark, |_| 1e-4);
            assert!((stopped.value - 1.0).abs() < 1e-3, "{stopped:?}");
            assert!((stopped.uncertainty.standard() - 0.03).abs() < 1e-3, "{stopped:?}");
            // Who takes all that was granted and meets nothing counts in full.
            let searched = reading_after_stages(first, dark, |granted_s| granted_s);
            assert!(searched.value < 0.5, "{searched:?}");
        }
    }

    /// The reading of a meter after a first stage and further equal ones, which use `work_s` of the granted seconds.
    fn reading_after_stages(first: Estimate, further: Estimate, work_s: fn(f64) -> f64) -> Reading {
        let exact = recording("simulator", &[Estimate::exact(1.0)]);
        let mut subject = recording("radiance", &[first]);
        subject.work_s = Some(1.0);
        let budgets = (budget_of(1.0), budget_of(100.0));
        sample_until_decided(&built_in(), &task(1), &[&exact], &mut subject, budgets, &mut |request| {
            let (estimates, work_s) = (vec![further], Some(work_s(request.budget.seconds)));
            Ok((Measurement { estimates, work_s, ..Measurement::default() }, Cost::default()))
        });
        assert!(subject.stages[0] > 1, "{subject:?}");
        subject.readings.remove(0)
    }

    /// The reading of a meter after a first and a second stage, each with the part that the time limit left of it.
    fn reading_after_stage(first: Estimate, first_cut: Option<f64>, second: Estimate, cut_to: Option<f64>) -> Reading {
        let exact = recording("simulator", &[Estimate::exact(1.0)]);
        let mut subject = recording("radiance", &[first]);
        (subject.work_s, subject.cut_to) = (Some(1.0), first_cut);
        let budgets = (budget_of(1.0), budget_of(9.0));
        sample_until_decided(&built_in(), &task(1), &[&exact], &mut subject, budgets, &mut |request| {
            if request.stage > 2 {
                return Err("no further stage".to_owned());
            }
            let estimates = vec![second; request.targets.len()];
            Ok((Measurement { estimates, cut_to, work_s: Some(1e9), ..Measurement::default() }, Cost::default()))
        });
        assert_eq!(subject.cut_to, [first_cut, cut_to].into_iter().flatten().reduce(f64::min));
        subject.readings.remove(0)
    }

    #[test]
    fn a_stage_that_the_clock_cut_has_used_the_seconds_that_it_was_granted() {
        let exact = recording("simulator", &[Estimate::exact(1.0)]);
        let mut subject = recording("radiance", &[estimate(1.019, 0.1)]);
        (subject.work_s, subject.cut_to) = (Some(0.1), Some(0.1));
        let (first, whole) = (Budget { seconds: 10.0, ..budget_of(1.0) }, Budget { seconds: 20.0, ..budget_of(1.0) });
        let mut granted_s = 10.0;
        sample_until_decided(&built_in(), &task(1), &[&exact], &mut subject, (first, whole), &mut |request| {
            granted_s += request.budget.seconds;
            assert_eq!(request.patience, request.budget.patience());
            let estimates = vec![estimate(1.019, 0.1)];
            let cut = Measurement { estimates, cut_to: Some(0.1), work_s: Some(0.1), ..Measurement::default() };
            Ok((cut, Cost { wall_s: 4.0 * request.budget.seconds, ..Cost::default() }))
        });
        assert!(granted_s > 10.0 && granted_s <= 20.0 + 1e-9, "{granted_s}");
    }

    fn estimate(value: f64, error: f64) -> Estimate {
        Estimate { value, uncertainty: Uncertainty::sampled(error, None) }
    }

    #[test]
    fn a_first_stage_that_only_decides_is_coarser_than_the_spec_asks() {
        let whole = Budget { relative_error: 0.0005, seconds: 60.0 };
        assert_eq!(first_stage_budget(whole, 0.0375), Budget { relative_error: 0.01, seconds: 30.0 });
        assert_eq!(first_stage_budget(whole, 0.0).relative_error, 0.0005);
    }
}
