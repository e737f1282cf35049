//! Why comparisons are undecided, and what the user can do.
//!
//! No number of samples is named. The interval crosses the edge of the tolerance, so the distance to the edge is less certain than
//! the distance itself, and so is every number that follows from it.

use crate::sequential::{sampling_factor, variance};
use std::collections::BTreeSet;

use luxproof_model::{Bias, Comparison, ReadingKey, Recording, Source, Verdict};
use luxproof_spec::Budget;

/// A standard error of this part of the requested one has reached it: errors of few blocks are that uncertain.
const REACHED: f64 = 1.25;
/// A recording that took this part of the budget's seconds had no time for more: engines plan with three fifths of them.
const SPENT_SHARE: f64 = 0.4;
/// Standard errors that should fit into a tolerance.
const ERRORS_IN_TOLERANCE: f64 = 4.0;
/// With many samples the coverage factor stays below this in any family of up to a thousand points.
const LARGE_COVERAGE_FACTOR: f64 = 6.0;

/// What keeps a comparison undecided.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Obstacle {
    /// The engine reached the standard error that the spec requests.
    Noise,
    /// It did not reach it.
    TimeLimit,
    /// A bound that no sample reduces.
    Discretisation,
    Reference,
}

/// Adds to each undecided comparison why it is undecided and what to do.
pub(crate) fn explain_undecided(
    comparisons: &mut [Comparison],
    biases: &[Bias],
    recordings: &[Recording],
    budget: Budget,
) {
    let cut: Vec<&Recording> = recordings.iter().filter(|r| r.cut_to.is_some()).collect();
    let limited = limited_by_time(comparisons, recordings, budget);
    for comparison in comparisons.iter_mut().filter(|c| c.verdict == Verdict::Undecided) {
        let failing = biases.iter().find(|b| b.fails && b.key == comparison.key && Some(b.basis) == comparison.basis());
        if let Some(bias) = failing {
            let text = format!("undecided by itself; the procedure fails by its bias of {bias}");
            comparison.diagnosis = Some(text);
        } else if comparison.diagnosis.is_none() {
            let obstacle = match find_obstacle(comparison, budget) {
                // More samples come only with more time: one advice for all points of a recording.
                Some(Obstacle::Noise) if limited.contains(&comparison.key) => Some(Obstacle::TimeLimit),
                obstacle => obstacle,
            };
            let recording = cut.iter().find(|r| r.key == comparison.key);
            comparison.diagnosis = obstacle.map(|obstacle| describe(comparison, obstacle, recording.copied(), budget));
        }
    }
}

/// The recordings that had too little time: where the clock cut one, where a point is short of the requested error, or
/// where one is about there and no time was left.
fn limited_by_time(comparisons: &[Comparison], recordings: &[Recording], budget: Budget) -> BTreeSet<ReadingKey> {
    let spent = recordings.iter().filter(|r| r.work_s() >= SPENT_SHARE * budget.seconds);
    let spent: BTreeSet<&ReadingKey> = spent.map(|r| &r.key).collect();
    let undecided = comparisons.iter().filter(|c| c.verdict == Verdict::Undecided);
    let short = undecided.filter(|c| match find_obstacle(c, budget) {
        Some(Obstacle::TimeLimit) => true,
        Some(Obstacle::Noise) => spent.contains(&c.key) && is_above_requested(c, budget),
        _ => false,
    });
    let cut = recordings.iter().filter(|r| r.cut_to.is_some()).map(|r| &r.key);
    short.map(|c| &c.key).chain(cut).cloned().collect()
}

/// Whether the standard error of a point is above the requested one at all.
fn is_above_requested(c: &Comparison, budget: Budget) -> bool {
    let error = c.budget.as_ref().map_or(0.0, |parts| variance(parts, is_chance).sqrt());
    error > budget.relative_error * c.value.unwrap_or(0.0).abs()
}

/// The advice on `relative_error`, where the requested one is too wide for the tolerance.
fn advise_error(c: &Comparison, budget: Budget) -> Option<String> {
    let reference = c.reference.as_ref().filter(|r| c.quantity.has_zero() && r.value > 0.0)?;
    let wanted = c.tolerance.relative.max(c.tolerance.absolute / reference.value) / ERRORS_IN_TOLERANCE;
    // The first digit is enough, and one in a million is rounding. No error is small enough for a tolerance of zero.
    let digit = 10f64.powf(wanted.log10().floor());
    let advised = format!("{:.0e}", (wanted / digit + 1e-6).floor() * digit).parse::<f64>().ok()?;
    (wanted > 0.0 && budget.relative_error > wanted).then(|| format!("lower `relative_error` to {advised}"))
}

/// Describes the obstacle with its size and the remedy; `cut` is the recording where the clock cut that.
fn describe(c: &Comparison, obstacle: Obstacle, cut: Option<&Recording>, budget: Budget) -> String {
    let engine = &c.key.engine;
    let size = |is_chosen: fn(Source) -> bool| {
        c.budget.as_ref().map_or_else(String::new, |budget| amount(c, variance(budget, is_chosen).sqrt()))
    };
    let asked = format!("{} %", trimmed_percent(budget.relative_error));
    let further = advise_error(c, budget).map(|advice| format!(" and {advice}")).unwrap_or_default();
    match (obstacle, cut) {
        (Obstacle::Noise, _) => format!(
            "undecided by noise: the standard error of {engine} is {} where the spec asks for {asked}; {}, or use \
             `--sampling accurate`",
            size(is_chance),
            advise_error(c, budget).unwrap_or_else(|| "lower `relative_error`".to_owned())
        ),
        (Obstacle::TimeLimit, Some(cut)) => format!(
            "undecided by the time limit: the machine was busy, {}, so the standard error of {engine} is {} {}; \
             run the same command again when the machine is idle, or raise `seconds` above {}{further}",
            describe_work(cut),
            size(is_chance),
            coverage(c),
            budget.seconds
        ),
        (Obstacle::TimeLimit, None) => format!(
            "undecided by the time limit: the standard error of {engine} is {}{} where the spec asks for {asked}; raise `seconds` above {}{further}",
            size(is_chance),
            coverage(c),
            budget.seconds
        ),
        (Obstacle::Discretisation, _) => format!(
            "undecided by discretisation: {engine} states an error of {} that no sample reduces; choose a finer setting, if it has one",
            size(is_discretisation)
        ),
        (Obstacle::Reference, _) => format!(
            "undecided by the reference, which is uncertain by {}; raise `seconds` above {}, for the reference too",
            size(is_of_reference),
            budget.seconds
        ),
    }
}

/// How much work an engine did in how much time.
fn describe_work(recording: &Recording) -> String {
    match recording.work_s {
        Some(work_s) => format!("{work_s:.1} s of work took {:.0} s", recording.wall_s),
        None => format!("sampling stopped after {:.0} s", recording.wall_s),
    }
}

/// The coverage factor, where few samples make it large.
fn coverage(c: &Comparison) -> String {
    let factor = c.budget.as_ref().map_or(0.0, |budget| budget.coverage_factor);
    if factor > LARGE_COVERAGE_FACTOR { format!(" (few samples: coverage factor {factor:.1})") } else { String::new() }
}

/// A share in percent, without the noise of its binary form.
fn trimmed_percent(share: f64) -> f64 {
    (1e6 * share).round() / 1e4
}

/// Finds the component that keeps a comparison undecided: the largest one, or the largest that samples do not reduce.
fn find_obstacle(c: &Comparison, budget: Budget) -> Option<Obstacle> {
    let parts = c.budget.as_ref()?;
    let [chance, discretisation, reference] =
        [is_chance as fn(Source) -> bool, is_discretisation, is_of_reference].map(|chosen| variance(parts, chosen));
    let is_fixed = sampling_factor(c).is_none_or(f64::is_infinite);
    Some(if !is_fixed && chance >= discretisation.max(reference) {
        let requested = REACHED * budget.relative_error * c.value?.abs();
        if c.quantity.has_zero() && chance.sqrt() > requested { Obstacle::TimeLimit } else { Obstacle::Noise }
    } else if discretisation >= reference {
        Obstacle::Discretisation
    } else {
        Obstacle::Reference
    })
}

const fn is_chance(source: Source) -> bool {
    matches!(source, Source::MonteCarlo)
}

const fn is_discretisation(source: Source) -> bool {
    matches!(source, Source::Discretisation)
}

const fn is_of_reference(source: Source) -> bool {
    matches!(source, Source::Reference | Source::Rounding | Source::Input)
}

/// An uncertainty relative to the reference, or in the unit of a rating.
fn amount(c: &Comparison, uncertainty: f64) -> String {
    let scale = c.reference.as_ref().map_or(0.0, |r| r.value.abs());
    if c.quantity.has_zero() && scale > 0.0 {
        format!("{:.2} %", 100.0 * uncertainty / scale)
    } else {
        format!("{uncertainty:.3} {}", c.quantity.unit())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use luxproof_model::{Estimate, Recording, Uncertainty};
    use luxproof_verdict::fixtures::{built_in, recording, task};

    const BUDGET: Budget = Budget { relative_error: 0.004, seconds: 60.0 };

    /// Why a reading 1.9 % off, at a tolerance of 2 %, is undecided.
    fn reason(uncertainty: Uncertainty, reference_bound: f64) -> String {
        let exact = Estimate { value: 1.0, uncertainty: Uncertainty::Bound(reference_bound) };
        let all: [Recording; 2] =
            [recording("simulator", &[exact]), recording("radiance", &[Estimate { value: 1.019, uncertainty }])];
        let mut compared = built_in().compare(&task(1), &[&all[0], &all[1]]);
        explain_undecided(&mut compared, &[], &[], BUDGET);
        compared.into_iter().find(|c| c.key.engine == "radiance").and_then(|c| c.diagnosis).unwrap_or_default()
    }

    #[test]
    fn each_obstacle_is_named_with_its_size_and_a_remedy() {
        for (uncertainty, reference_bound, said) in [
            (
                Uncertainty::sampled(0.004, None),
                0.0,
                ["by noise", "0.40 % where the spec asks for 0.4 %; lower `relative_error`"],
            ),
            (
                Uncertainty::sampled(0.02, None),
                0.0,
                ["by the time limit", "2.00 % where the spec asks for 0.4 %; raise `seconds` above 60"],
            ),
            (Uncertainty::Bound(0.008), 0.0, ["by discretisation", "choose a finer setting"]),
            (Uncertainty::sampled(0.0002, None), 0.008, ["by the reference", "for the reference too"]),
            (Uncertainty::Exact, 0.008, ["by the reference", "raise `seconds` above 60"]),
        ] {
            let reason = reason(uncertainty, reference_bound);
            assert!(said.iter().all(|part| reason.contains(part)), "{uncertainty:?}: {reason}");
        }
        assert_eq!(reason(Uncertainty::Exact, 0.0), "", "what is decided needs no reason");
    }

    #[test]
    fn what_took_all_its_time_is_short_of_time_and_a_wide_request_is_told_with_it() {
        let exact = recording("simulator", &[Estimate::exact(1.0)]);
        let near = Estimate { value: 1.015, uncertainty: Uncertainty::sampled(0.0115, None) };
        let wide = Budget { relative_error: 0.01, seconds: 30.0 };
        for (work_s, cause) in [(18.0, "by the time limit"), (2.0, "by noise")] {
            let subject = Recording { work_s: Some(work_s), ..recording("radiance", &[near]) };
            let mut compared = built_in().compare(&task(1), &[&exact, &subject]);
            explain_undecided(&mut compared, &[], &[subject], wide);
            let reason = compared.iter().find(|c| c.key.engine == "radiance").and_then(|c| c.diagnosis.clone());
            let reason = reason.unwrap_or_default();
            assert!(reason.contains(cause) && reason.contains("lower `relative_error` to 0.005"), "{reason}");
            assert!(reason.contains("1.15 % where the spec asks for 1 %"), "{reason}");
        }
    }

    #[test]
    fn the_advised_error_is_a_round_number_and_there_is_none_for_a_tolerance_of_zero() {
        let exact = recording("simulator", &[Estimate::exact(1.0)]);
        let subject = recording("radiance", &[Estimate { value: 1.0, uncertainty: Uncertainty::sampled(0.1, None) }]);
        let mut compared = built_in().compare(&task(1), &[&exact, &subject]);
        let c = compared.iter_mut().find(|c| c.key.engine == "radiance").unwrap();
        for (relative, advice) in [(0.02, Some("0.005")), (0.028, Some("0.007")), (0.01, Some("0.002")), (0.0, None)] {
            c.tolerance = luxproof_model::Tolerance { relative, absolute: 0.0 };
            let expected = advice.map(|advice| format!("lower `relative_error` to {advice}"));
            assert_eq!(advise_error(c, Budget { relative_error: 0.01, seconds: 30.0 }), expected, "{relative}");
        }
    }

    #[test]
    fn few_samples_are_the_obstacle_where_many_would_decide() {
        let reference = Estimate { value: 1.0, uncertainty: Uncertainty::Bound(0.0104) };
        let subject = Estimate { value: 1.01, uncertainty: Uncertainty::sampled(0.008, Some(3.0)) };
        let all = [recording("simulator", &[reference]), recording("radiance", &[subject])];
        let mut compared = built_in().compare(&task(1), &[&all[0], &all[1]]);
        explain_undecided(&mut compared, &[], &[], BUDGET);
        let reason = compared.iter().find(|c| c.key.engine == "radiance").and_then(|c| c.diagnosis.clone());
        assert!(reason.as_deref().is_some_and(|text| text.contains("by the time limit")), "{reason:?}");
    }

    /// The reasons of a reading near the edge that reached the requested error and of one that did not.
    fn reasons_of_two(cut_to: Option<f64>) -> Vec<String> {
        let exact = recording("simulator", &[Estimate::exact(1.0); 2]);
        let noisy = |error| Estimate { value: 1.019, uncertainty: Uncertainty::sampled(error, None) };
        let subject = recording("radiance", &[noisy(0.004), noisy(0.03)]);
        let subject = Recording { cut_to, wall_s: 240.0, work_s: Some(3.0), ..subject };
        let mut compared = built_in().compare(&task(2), &[&exact, &subject]);
        explain_undecided(&mut compared, &[], &[subject], BUDGET);
        compared.into_iter().filter(|c| c.key.engine == "radiance").filter_map(|c| c.diagnosis).collect()
    }

    #[test]
    fn all_points_of_a_recording_have_one_cause_and_one_remedy() {
        for reason in reasons_of_two(None) {
            assert!(reason.contains("by the time limit") && reason.contains("raise `seconds` above 60"), "{reason}");
        }
        let cut = reasons_of_two(Some(0.1));
        assert_eq!(cut.len(), 2);
        for reason in cut {
            assert!(reason.contains("the machine was busy, 3.0 s of work took 240 s"), "{reason}");
            assert!(reason.contains("when the machine is idle"), "{reason}");
        }
    }
}
