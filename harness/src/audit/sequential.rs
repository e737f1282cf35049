//! Sequential sampling: an undecided comparison asks its engine for more, decided ones stop.
//!
//! The first look is the plan's own job. Each further look is one job for the stations that are still undecided, with a seed and a
//! slice of the budget of its own, a few times as long as all before it: engines take seconds to start, so looks are few. Looks are
//! combined with weights that are fixed before they are taken, in proportion to the effort granted, so that what was read
//! does not choose its own weight; one that the clock cut short weighs as much less as it has fewer blocks. Seconds are those that engines count, so that no clock has a say; a user's program has none. Deciding early keeps its error rate by alpha spending over the planned looks
//! ([`crate::judge::SHARE_OF_A_LOOK`]).

use std::collections::BTreeSet;
use std::time::Duration;

use crate::engines::Measurement;
use crate::judge::{Basis, Comparison, Judge, LOOKS, Source, Verdict};
use crate::measure::Cost;
use crate::procedures::Task;
use crate::record::{Estimate, MeterId, Reading, Recording, Uncertainty};
use crate::report::words::rounded;
use crate::spec::Budget;

/// All looks together take so many times the effort of the first, where that is as accurate as the spec asks; where it is coarser, so many
/// times what the spec asks.
const BEYOND_FIRST: f64 = 27.0;
const BEYOND_SPEC: f64 = 2.0;
/// The effort of all looks so far grows by the logarithm as this power of their number: little at first, since most of what the first look leaves
/// open lies within the tolerance by its standard error, and most at last, for what is near the edge.
const GROWTH: f64 = 1.25;
/// A look that could be granted less than this share of the first one's effort is not worth an engine's start.
const MIN_WEIGHT: f64 = 0.5;
/// A first look counts as this long at least, in seconds: one that was mirrored or read off another case took none.
const SHORTEST_S: f64 = 1.0;
/// Standard errors of the first look within a tolerance, where sampling stops as soon as it is decided: it then decides
/// whatever deviates by up to a third of the tolerance; what deviates by more is worth a further look.
const FIRST_LOOK: f64 = 3.75;
/// The part of the seconds that the first look is granted, likewise.
const FIRST_SHARE: f64 = 0.5;

/// An engine whose standard errors fall with effort by less than this part of what they should samples as much whatever it is granted: then
/// its looks count alike.
const DEAF: f64 = 0.5;

/// What a further look asks of an engine.
#[derive(Clone, Debug, PartialEq)]
pub struct Ask {
    /// Which look it is, counted from 1.
    pub look: u32,
    /// The task's targets that are still undecided.
    pub targets: Vec<usize>,
    /// The slice of the budget.
    pub budget: Budget,
    /// What the budget has left by the clock.
    pub patience: Duration,
}

/// One estimate for each station of the targets asked for, and what it took; the error says why there is none.
pub type Look = Result<(Measurement, Cost), String>;

/// The first look's budget where sampling stops as soon as comparisons are decided.
pub fn first_look(budget: Budget, tolerance_relative: f64) -> Budget {
    Budget {
        relative_error: budget.relative_error.max(tolerance_relative / FIRST_LOOK),
        seconds: FIRST_SHARE * budget.seconds,
    }
}

/// Takes further looks at a recording until its comparisons are decided or the budget is spent.
///
/// `witnesses` are the other recordings of the task; `first` is the budget that the recording was taken with, `budget` the whole.
pub fn refine(
    judge: &Judge<'_>,
    task: &Task,
    witnesses: &[&Recording],
    subject: &mut Recording,
    (first, budget): (Budget, Budget),
    sample: &mut dyn FnMut(&Ask) -> Look,
) {
    if subject.failure.is_some() || !subject.readings.iter().any(|r| r.uncertainty.is_sampled()) {
        return;
    }
    subject.looks = vec![1; subject.readings.len()];
    let (first_s, mut total_weight) = (subject.work_s().max(SHORTEST_S), 1.0);
    let falls = subject.stated_errors.iter().filter_map(|s| s.falls_with_effort).reduce(f64::min);
    let is_deaf = falls.is_some_and(|falls| falls < DEAF);
    for look in 2..=LOOKS {
        let targets = undecided(judge, task, witnesses, subject);
        if targets.is_empty() {
            break;
        }
        let left_s = budget.seconds - subject.work_s();
        let patience = patience_left(subject, budget);
        if left_s <= 0.0 || patience.is_zero() {
            break;
        }
        let mut affordable = left_s / first_s;
        if subject.work_s.is_none() {
            // In powers of two, so that a clock, where there is no other count, hardly ever has a say.
            affordable = affordable.log2().floor().exp2();
        }
        let weight = weight(look, first.relative_error / budget.relative_error).min(affordable);
        if weight < MIN_WEIGHT {
            break;
        }
        let relative_error = first.relative_error / weight.sqrt();
        let ask =
            Ask { look, targets, budget: Budget { relative_error, seconds: (weight * first_s).min(left_s) }, patience };
        let (measurement, cost) = match sample(&ask) {
            Ok(taken) => taken,
            Err(why) => {
                subject.notes.push(format!("look {look} at {} meters gave nothing: {why}", ask.targets.len()));
                break;
            }
        };
        subject.notes.push(format!("look {look}: {} undecided meters were asked for more", ask.targets.len()));
        subject.wall_s += cost.wall_s;
        subject.work_s = measurement.work_s.map(|work_s| work_s + subject.work_s());
        subject.skewness = measurement.skewness().or(subject.skewness);
        subject.effort.extend(measurement.effort.iter().map(|(k, v)| (format!("look{look}_{k}"), v.clone())));
        let estimates = measurement.readings(ask.targets.iter().map(|k| &task.targets[*k]));
        let counts = if is_deaf { 1.0 } else { weight * measurement.cut_to.unwrap_or(1.0) };
        for (&k, estimate) in ask.targets.iter().zip(&estimates) {
            combine(&mut subject.readings[k], total_weight, estimate, counts);
            subject.looks[k] = look;
        }
        total_weight += counts;
    }
}

/// What a recording leaves of its budget by the clock.
pub fn patience_left(recording: &Recording, budget: Budget) -> Duration {
    budget.patience().saturating_sub(Duration::try_from_secs_f64(recording.wall_s).unwrap_or_default())
}

/// The effort of a look against the first, whose error is so many times what is asked for.
fn weight(look: u32, coarser: f64) -> f64 {
    let all = (BEYOND_SPEC * coarser * coarser).max(BEYOND_FIRST);
    let total = |look: u32| all.powf((f64::from(look - 1) / f64::from(LOOKS - 1)).powf(GROWTH));
    total(look) - total(look - 1)
}

/// Adds a look to a reading, with weights that were fixed before.
fn combine(reading: &mut Reading, before: f64, look: &Estimate, weight: f64) {
    reading.value = (before * reading.value + weight * look.value) / (before + weight);
    reading.uncertainty = Uncertainty::of_looks([(before, reading.uncertainty), (weight, look.uncertainty)]);
}

/// The targets at which more samples would decide something.
fn undecided(judge: &Judge<'_>, task: &Task, witnesses: &[&Recording], subject: &Recording) -> Vec<usize> {
    let compared = judge.compare_one(task, subject, witnesses);
    targets_of(task, compared.iter().filter(|c| effort(c).is_some_and(f64::is_finite)))
}

/// The places in a task of the targets that comparisons are of.
fn targets_of<'a>(task: &Task, comparisons: impl Iterator<Item = &'a Comparison>) -> Vec<usize> {
    let meters: BTreeSet<&MeterId> = comparisons.map(|c| &c.meter).collect();
    (0..task.targets.len()).filter(|k| meters.contains(&task.targets[*k].id)).collect()
}

/// The targets at which a comparison is undecided and its reference's own error takes more than half of the way from the
/// deviation to the tolerance.
pub fn undecided_by_reference(judge: &Judge<'_>, task: &Task, recordings: &[&Recording]) -> Vec<usize> {
    let is_blurred = |c: &Comparison| -> Option<bool> {
        let (reference, budget) = (c.reference.as_ref()?, c.budget.as_ref()?);
        let of_reference = budget.components.iter().filter(|part| part.source == Source::Reference);
        let square: f64 = of_reference.map(|part| part.uncertainty.powi(2)).sum();
        let way = (c.tolerance.around(reference.value) - c.deviation?.abs()).abs();
        Some(reference.basis == Basis::Exact && budget.coverage_factor * square.sqrt() > 0.5 * way)
    };
    let compared = judge.compare(task, recordings);
    let is_open = |c: &&Comparison| c.verdict == Verdict::Inconclusive && is_blurred(c).unwrap_or(false);
    targets_of(task, compared.iter().filter(is_open))
}

/// How many times the samples an undecided comparison needs, at its present deviation or, where none would do there, at the nearest one that
/// its samples allow, too; infinite where no number would do, and `None` where it is decided or not sampled.
fn effort(comparison: &Comparison) -> Option<f64> {
    if comparison.verdict != Verdict::Inconclusive {
        return None;
    }
    if comparison.uncertainty == Uncertainty::NotSeen {
        return Some(1.0);
    }
    let (budget, deviation) = (comparison.budget.as_ref()?, comparison.deviation?);
    let square = |sampled: bool| -> f64 {
        let chosen = budget.components.iter().filter(|c| (c.source == Source::MonteCarlo) == sampled);
        chosen.map(|c| c.uncertainty.powi(2)).sum()
    };
    let (sampled, fixed) = (square(true), square(false));
    if sampled == 0.0 {
        return None;
    }
    let allowed = comparison.tolerance.around(comparison.reference.as_ref()?.value);
    let needed = |way: f64| (way / budget.coverage_factor).powi(2) - fixed;
    let (now, reach) = (allowed - deviation.abs(), budget.coverage_factor * sampled.sqrt());
    // The deviation moves with further samples, as far as its own error reaches, and to no less than none.
    let ways = [now.abs(), (now + reach).min(allowed), reach - now];
    let needed = ways.into_iter().filter(|way| *way > 0.0).map(needed).find(|needed| *needed > 0.0);
    Some(needed.map_or(f64::INFINITY, |needed| (sampled / needed).max(1.0)))
}

/// Tells of each undecided comparison what would decide it.
pub fn estimate_remaining_cost(comparisons: &mut [Comparison]) {
    for comparison in comparisons {
        let Some(times) = effort(comparison) else { continue };
        let engine = &comparison.key.engine;
        let text = if times.is_infinite() {
            let others = "its other uncertainties alone straddle the tolerance";
            format!("undecided, and more samples of {engine} would not help: {others}")
        } else {
            let times = rounded(times.max(1.1), 2).unwrap_or(times);
            format!("undecided: needs about {times} times the samples of {engine}")
        };
        comparison.diagnosis.get_or_insert(text);
    }
}

/// What stopping at a decision saved, against sampling on to the spec's own error; `None` where nothing.
pub fn saved(subject: &Recording, budget: Budget) -> Option<String> {
    let relative = |r: &Reading| r.uncertainty.standard_error().filter(|_| r.value > 0.0).map(|e| e / r.value);
    let worst = subject.readings.iter().filter_map(relative).fold(0.0, f64::max);
    // The whole budget's seconds may not get it as far as that.
    let affordable = budget.seconds / subject.work_s().max(SHORTEST_S);
    let times = (worst / budget.relative_error).powi(2).min(affordable);
    let looks = subject.looks.iter().copied().max().filter(|_| times > 1.5)?;
    Some(format!(
        "decided at look {looks} of {LOOKS}, at a standard error of {:.2} %: sampling stopped, where {times:.1} times the samples \
         would have been taken on the way to {:.2} %",
        100.0 * worst,
        100.0 * budget.relative_error
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::judge::tests::{built_in, task};
    use crate::system::random::normal;

    /// An engine that is off by so much at each meter, with normal noise that shrinks with the seconds granted.
    struct Synthetic {
        truth: Vec<f64>,
        noise: f64,
        blocks: usize,
        random: fastrand::Rng,
    }

    impl Synthetic {
        fn measurement(&mut self, targets: &[usize], effort: f64) -> Measurement {
            let sigma = self.noise / effort.sqrt() * (self.blocks as f64).sqrt();
            let mut block = |k: usize| self.truth[k] + sigma * normal(&mut self.random);
            let mut samples = |k: &usize| (0..self.blocks).map(|_| block(*k)).collect::<Vec<f64>>();
            let estimates = targets.iter().map(|k| Estimate::of_samples(&samples(k))).collect();
            Measurement { estimates, ..Measurement::default() }
        }
    }

    fn recording(engine: &str, estimates: &[Estimate]) -> Recording {
        Recording { wall_s: 1.0, ..crate::judge::tests::recording(engine, estimates) }
    }

    /// One run: what becomes of meters that are truly so far from a reference of 1, with a tolerance of 2 %, of an engine that
    /// comes to a relative error of `noise` in one second.
    fn run_within(
        deviations: &[f64],
        (first, whole): (Budget, Budget),
        (noise, blocks): (f64, usize),
        seed: u64,
    ) -> (Vec<Verdict>, Vec<Ask>, Recording) {
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
        let mut sample = |ask: &Ask| {
            asked.push(ask.clone());
            let work_s = effort(ask.budget.relative_error);
            let measurement = engine.measurement(&ask.targets, work_s);
            Ok((Measurement { work_s: Some(work_s), ..measurement }, Cost::default()))
        };
        refine(&judge, &task, &[&exact], &mut subject, (first, whole), &mut sample);
        let mut compared = judge.compare(&task, &[&exact, &subject]);
        compared.retain(|c| c.key.engine == "radiance");
        estimate_remaining_cost(&mut compared);
        for c in &compared {
            assert_eq!(c.verdict == Verdict::Inconclusive, c.diagnosis.is_some(), "{c:?}");
        }
        (compared.iter().map(|c| c.verdict).collect(), asked, subject)
    }

    fn run(deviations: &[f64], seconds: f64, blocks: usize, seed: u64) -> (Vec<Verdict>, Vec<Ask>, Recording) {
        let budget = |seconds| Budget { relative_error: 0.004, seconds };
        run_within(deviations, (budget(1.0), budget(seconds)), (0.004, blocks), seed)
    }

    #[test]
    fn sampling_until_decided_decides_as_accurate_sampling_does_in_a_thousand_pairs() {
        let whole = |seconds| Budget { relative_error: 0.0005, seconds };
        // Where the last look is cut short the rest is left open, and where none is it costs more.
        let (cost, _) = in_pairs(whole(100.0), 0.004);
        assert!(cost[1] < 0.6 * cost[0], "{cost:?}");
        let (cost, [both, contrary, only_accurate, only_decided]) = in_pairs(whole(600.0), 0.01);
        let told = format!(
            "{both} decided by both, {contrary} contrary, {only_accurate} and {only_decided} by one; {cost:?} s"
        );
        // Each leaves open now and then what lies at the very edge, and neither more often than the other.
        assert!(contrary <= 6 && cost[1] < cost[0], "{told}");
        assert!(only_accurate + only_decided < both / 25 && only_accurate <= only_decided + both / 100, "{told}");
    }

    /// Seconds that accurate sampling takes and sampling until decided, in a thousand pairs of runs, and how many comparisons both decide, both
    /// contrarily, the one alone and the other alone.
    fn in_pairs(whole: Budget, noise: f64) -> ([f64; 2], [usize; 4]) {
        let decided = first_look(whole, 0.02);
        let (mut both, mut contrary, mut only_accurate, mut only_decided, mut cost) = (0, 0, 0, 0, [0.0; 2]);
        for seed in 0..1000 {
            let mut random = fastrand::Rng::with_seed(seed);
            let deviations: Vec<f64> = (0..6).map(|_| 0.015 * normal(&mut random)).collect();
            let pair = [whole, decided].map(|first| run_within(&deviations, (first, whole), (noise, 16), 7000 + seed));
            for (total, one) in cost.iter_mut().zip(&pair) {
                *total += one.2.work_s();
            }
            let open = |verdict| verdict == Verdict::Inconclusive;
            for (accurate, decided) in pair[0].0.iter().zip(&pair[1].0) {
                match (open(*accurate), open(*decided)) {
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
        // At the very edge of the tolerance every failure is wrong from within and every pass from without. Two standard
        // deviations of a share of .05 over 2000 runs are .01, but the share itself must keep to .05.
        for (deviations, wrong) in [
            ([0.01999; 4], Verdict::Fail),
            ([-0.01999; 4], Verdict::Fail),
            ([0.02001; 4], Verdict::Pass),
            ([0.019, 0.005, 0.0, -0.018], Verdict::Fail),
        ] {
            let is_wrong = |verdicts: &[Verdict]| match wrong {
                // The family fails where any of it does.
                Verdict::Fail => verdicts.contains(&Verdict::Fail),
                // It passes where all of it does; one meter alone is the harder case.
                _ => verdicts[0] == Verdict::Pass,
            };
            let count = (0..RUNS).filter(|seed| is_wrong(&run(&deviations, 1e3, 8, *seed).0)).count();
            let share = count as f64 / RUNS as f64;
            assert!(share <= 0.05, "{deviations:?}: {share} wrong");
        }
    }

    #[test]
    fn without_spending_the_same_looks_would_decide_wrongly_too_often() {
        // The negative control: at each look the whole error, until one decides.
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
        let mut sample = |ask: &Ask| panic!("{ask:?}");
        refine(&built_in(), &task(1), &[&exact], &mut subject, (whole, whole), &mut sample);
    }

    #[test]
    fn what_is_decided_is_not_asked_again_and_what_is_not_is_decided_in_the_end() {
        let (verdicts, asked, subject) = run(&[0.0, 0.0, 0.013, 0.06], 1e3, 16, 5);
        assert_eq!(verdicts, [Verdict::Pass, Verdict::Pass, Verdict::Pass, Verdict::Fail]);
        assert!(!asked.is_empty() && asked.iter().all(|a| a.targets == [2]), "{asked:?}");
        assert_eq!((subject.looks[0], subject.looks[3]), (1, 1));
        assert!(subject.looks[2] > 1);
    }

    #[test]
    fn without_budget_nothing_is_asked_and_the_price_is_told() {
        let (verdicts, asked, _) = run(&[0.0185, 0.0], 1.2, 16, 6);
        assert_eq!(verdicts, [Verdict::Inconclusive, Verdict::Pass]);
        assert!(asked.is_empty());
    }

    #[test]
    fn what_chance_may_have_put_near_the_tolerance_is_asked_for_more_and_what_is_there_for_good_is_not() {
        let wanted = |deviation: f64, error: f64, of_reference: f64| {
            let reference = Estimate { value: 1.0, uncertainty: Uncertainty::Bound(of_reference) };
            let all =
                [recording("simulator", &[reference]), recording("radiance", &[estimate(1.0 + deviation, error)])];
            let compared = built_in().compare(&task(1), &all.iter().collect::<Vec<_>>());
            compared.iter().find(|c| c.key.engine == "radiance").and_then(effort)
        };
        // .1 % are left to the tolerance, and the reference takes .3.
        assert!(wanted(0.019, 0.006, 0.003).is_some_and(f64::is_finite), "{:?}", wanted(0.019, 0.006, 0.003));
        assert_eq!(wanted(0.019, 0.0002, 0.003), Some(f64::INFINITY));
    }

    #[test]
    fn looks_are_weighted_by_what_they_were_granted_not_by_what_they_read() {
        let mut reading = recording("e", &[estimate(1.0, 0.3)]).readings.remove(0);
        combine(&mut reading, 1.0, &estimate(2.0, 0.1), 3.0);
        assert!((reading.value - 1.75).abs() < 1e-15);
        assert!((reading.uncertainty.standard_error().unwrap() - 0.3_f64.hypot(0.3) / 4.0).abs() < 1e-15);
    }

    #[test]
    fn a_look_that_the_clock_cut_short_weighs_as_much_less() {
        let exact = recording("simulator", &[Estimate::exact(1.0)]);
        let budget = |seconds| Budget { relative_error: 0.004, seconds };
        let value = |cut_to: Option<f64>| {
            let mut subject = recording("radiance", &[estimate(1.019, 0.004)]);
            subject.work_s = Some(1.0);
            let mut sample = |ask: &Ask| {
                let of_look = |look| if look == 2 { 1.5 } else { 1.0 };
                let estimates = vec![estimate(of_look(ask.look), 0.004); ask.targets.len()];
                Ok((Measurement { estimates, cut_to, work_s: Some(1e9), ..Measurement::default() }, Cost::default()))
            };
            refine(&built_in(), &task(1), &[&exact], &mut subject, (budget(1.0), budget(9.0)), &mut sample);
            subject.readings[0].value
        };
        let weight = weight(2, 1.0);
        let expected = |counts: f64| (1.019 + 1.5 * counts) / (1.0 + counts);
        assert!((value(None) - expected(weight)).abs() < 1e-12, "{}", value(None));
        assert!((value(Some(0.25)) - expected(0.25 * weight)).abs() < 1e-12, "{}", value(Some(0.25)));
    }

    fn estimate(value: f64, error: f64) -> Estimate {
        Estimate { value, uncertainty: Uncertainty::sampled(error, None) }
    }

    #[test]
    fn a_first_look_that_only_decides_is_coarser_than_the_spec_asks() {
        let whole = Budget { relative_error: 0.0005, seconds: 60.0 };
        assert_eq!(first_look(whole, 0.0375), Budget { relative_error: 0.01, seconds: 30.0 });
        assert_eq!(first_look(whole, 0.0).relative_error, 0.0005);
    }
}
