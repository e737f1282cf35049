//! Bias: the common deviation of an engine's readings from their references, also below the tolerance.
//!
//! It is the weighted mean of the relative deviations (weights 1/u²), with the probability of such a mean without bias.
//! The Birge ratio widens its uncertainty where deviations scatter more than stated (Birge, Phys. Rev. 40 (1932) 207).
//! So do weights that are themselves estimated (Meier, Biometrics 9 (1953) 59).
//!
//! If all true deviations were within their tolerances, so would be their mean. A mean that is beyond the mean tolerance, and
//! beyond all errors that meters share, therefore fails the procedure even where no single reading does.

use luxproof_statistics::SINGLE_PRECISION;
use luxproof_statistics::error_budget;
use std::collections::BTreeMap;

use super::{Judge, MAX_RELATIVE_ERROR, MAX_SKEWNESS_SIGMAS};
use luxproof_model::{
    Basis, Bias, Comparison, Component, ErrorBudget, ReadingKey, Recording, Scatter, Shape, Source, Uncertainty,
    Verdict,
};
use luxproof_statistics::{WeightedMean, two_sided, upper_tail_of_normal};

impl Judge<'_> {
    /// The bias of every engine of a task, against each kind of reference.
    ///
    /// Comparisons without a relative deviation have no part in it.
    pub fn bias(&self, comparisons: &[Comparison], recordings: &[Recording]) -> Vec<Bias> {
        let mut groups: BTreeMap<(&ReadingKey, Basis), Vec<Deviation>> = BTreeMap::new();
        for c in comparisons.iter().filter(|c| c.uncertainty != Uncertainty::NotSeen) {
            let (Some(reference), Some(budget)) = (&c.reference, &c.budget) else { continue };
            let Some(relative) = c.relative_deviation else { continue };
            let scale = reference.value.abs();
            groups.entry((&c.key, reference.basis)).or_default().push(Deviation {
                relative,
                uncertainty: budget.combined / scale,
                degrees_of_freedom: budget.degrees_of_freedom,
                explained: (c.tolerance.around(reference.value) + shared_error(budget)) / scale,
                is_judged: matches!(c.verdict, Verdict::Pass | Verdict::Undecided | Verdict::Fail),
            });
        }
        let tail = upper_tail_of_normal(self.tolerances.coverage_factor());
        let mut all = vec![];
        for ((key, basis), deviations) in groups {
            let recording = recordings.iter().find(|r| r.key == *key);
            let design_effect = recording.and_then(|r| r.design_effect);
            let bias = bias_of_group(key, basis, &deviations, design_effect.unwrap_or(1.0), tail);
            let may_fail = basis != Basis::Published && recording.is_some_and(is_about_normal);
            let p_value = recording.filter(|_| may_fail).and_then(|r| probability_within(&deviations, r));
            let fails = p_value.is_some_and(|p| p < BIAS_SHARE * self.tolerances.family_wise_error());
            all.extend(bias.map(|bias| Bias { fails, ..bias }));
        }
        all
    }
}

/// The share of the family-wise error that a failure by bias may add to that of single readings.
const BIAS_SHARE: f64 = 0.1;
/// Standard uncertainties that contain nearly all of an error that is not rectangular.
const NEARLY_ALL_SIGMAS: f64 = 3.0;

/// The error that readings may share, so that a mean does not reduce it: all but the chance of each, in the quantity's unit.
fn shared_error(budget: &ErrorBudget) -> f64 {
    let shared = budget.components.iter().filter(|part| part.source != Source::MonteCarlo);
    shared
        .map(|part| {
            let reach = if part.shape == Shape::Rectangular { 3f64.sqrt() } else { NEARLY_ALL_SIGMAS };
            reach * part.uncertainty
        })
        .sum()
}

/// Whether the mean of many readings of a recording is about normal.
fn is_about_normal(recording: &Recording) -> bool {
    !recording.states_heavy_tail() && recording.skewness.is_none_or(|s| s <= MAX_SKEWNESS_SIGMAS)
}

/// The probability of so large a mean deviation if all true deviations were within what the tolerances and shared errors explain.
///
/// `None` where a reading is not judged, or where the mean is no normal one. Readings share all their noise where it is not known
/// how much they share.
fn probability_within(deviations: &[Deviation], recording: &Recording) -> Option<f64> {
    let is_small = |d: &Deviation| d.uncertainty > SINGLE_PRECISION && d.uncertainty < MAX_RELATIVE_ERROR;
    if !deviations.iter().all(|d| d.is_judged && is_small(d)) {
        return None;
    }
    let repeated = recording.stated_errors.iter().filter(|s| s.ratio.is_some()).map(|s| s.design_effect);
    let shared = recording.design_effect.into_iter().chain(repeated).reduce(f64::max);
    let mean = weighted(deviations, shared.unwrap_or(deviations.len() as f64))?;
    let weights: f64 = deviations.iter().map(|d| d.uncertainty.powi(-2)).sum();
    let explained = deviations.iter().map(|d| d.explained * d.uncertainty.powi(-2)).sum::<f64>() / weights;
    let beyond = mean.value.abs() - explained;
    (beyond > 0.0).then(|| two_sided(beyond / mean.uncertainty, mean.degrees_of_freedom))
}

/// The deviation of a reading from its reference, relative to it.
struct Deviation {
    relative: f64,
    /// Standard uncertainty.
    uncertainty: f64,
    degrees_of_freedom: Option<f64>,
    /// What the tolerance and shared errors explain, relative to the reference.
    explained: f64,
    /// Whether the verdict follows from the tolerance alone.
    is_judged: bool,
}

/// A mean with its interval, and its probability and scatter where all uncertainties are stated.
struct MeanDeviation {
    value: f64,
    low: f64,
    high: f64,
    p_value: Option<f64>,
    scatter: Option<Scatter>,
}

/// The bias of one engine against one kind of reference; `None` where it is not finite.
fn bias_of_group(
    key: &ReadingKey,
    basis: Basis,
    deviations: &[Deviation],
    design_effect: f64,
    tail: f64,
) -> Option<Bias> {
    let mean = weighted_mean(deviations, design_effect, tail).unwrap_or_else(|| unweighted_mean(deviations));
    let MeanDeviation { value, low, high, p_value, scatter } = mean;
    if ![value, low, high].iter().all(|v| v.is_finite()) {
        return None;
    }
    let readings = deviations.len();
    Some(Bias { key: key.clone(), basis, readings, mean: value, low, high, p_value, fails: false, scatter })
}

/// The mean with weights; `None` where a reading states no uncertainty, because it would outweigh all others.
fn weighted_mean(deviations: &[Deviation], design_effect: f64, tail: f64) -> Option<MeanDeviation> {
    if !deviations.iter().all(|d| d.uncertainty > SINGLE_PRECISION) {
        return None;
    }
    let mean = weighted(deviations, design_effect)?;
    let spread = Component::normal(Source::MonteCarlo, mean.uncertainty, mean.degrees_of_freedom);
    let expanded = error_budget::budget(vec![spread], tail).expanded;
    Some(MeanDeviation {
        value: mean.value,
        low: mean.value - expanded,
        high: mean.value + expanded,
        p_value: Some(mean.p_value()),
        scatter: Some(mean.scatter),
    })
}

/// The mean weighted by 1/u², of readings that share noise.
fn weighted(deviations: &[Deviation], design_effect: f64) -> Option<WeightedMean> {
    let stated: Vec<_> = deviations.iter().map(|d| (d.relative, d.uncertainty, d.degrees_of_freedom)).collect();
    let fewest = deviations.iter().filter_map(|d| d.degrees_of_freedom).reduce(f64::min);
    Some(WeightedMean::of(&stated)?.sharing(design_effect, fewest))
}

/// The plain mean with the range of all deviations.
fn unweighted_mean(deviations: &[Deviation]) -> MeanDeviation {
    let (mut sum, mut low, mut high) = (0.0, f64::INFINITY, f64::NEG_INFINITY);
    for Deviation { relative, .. } in deviations {
        sum += relative;
        low = low.min(*relative);
        high = high.max(*relative);
    }
    MeanDeviation { value: sum / deviations.len() as f64, low, high, p_value: None, scatter: None }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{built_in, recording, task};
    use luxproof_model::{ErrorFinding, Estimate, StatedErrors};
    use luxproof_process::random::normal;

    fn bias(readings: &[Estimate]) -> Bias {
        let exact = recording("simulator", &vec![Estimate::exact(1.0); readings.len()]);
        let (judge, task) = (built_in(), task(readings.len()));
        let comparisons = judge.compare(&task, &[&exact, &recording("radiance", readings)]);
        judge.bias(&comparisons, &[]).into_iter().find(|b| b.key.engine == "radiance").unwrap()
    }

    fn noisy(deviation: f64, stated: f64, seed: u64) -> Vec<Estimate> {
        let mut random = fastrand::Rng::with_seed(seed);
        let uncertainty = Uncertainty::sampled(stated, None);
        (0..50).map(|_| Estimate { value: 1.0 + deviation + 0.004 * normal(&mut random), uncertainty }).collect()
    }

    #[test]
    fn a_bias_below_the_tolerance_is_found_and_none_is_not() {
        let found = bias(&noisy(0.003, 0.004, 1));
        assert!(found.low > 0.0 && found.low < 0.003 && found.high > 0.003, "{found}");
        assert!(found.p_value.unwrap() < 1e-4 && found.readings == 50, "{found}");
        let p_values: Vec<f64> = (0..200).map(|seed| bias(&noisy(0.0, 0.004, seed)).p_value.unwrap()).collect();
        let small = p_values.iter().filter(|p| **p < 0.05).count();
        assert!((2..=20).contains(&small), "{small} of 200 below .05, of which 10 are expected");
    }

    /// Whether the procedure fails by the bias of fifty readings with 5 % of independent noise, against a tolerance of 2 %.
    fn fails_by_bias(deviation: f64, seed: u64, share: f64) -> bool {
        let mut random = fastrand::Rng::with_seed(seed);
        let common = normal(&mut random);
        let mut readings = vec![];
        for _ in 0..50 {
            let noise = share.sqrt() * common + (1.0 - share).sqrt() * normal(&mut random);
            let uncertainty = Uncertainty::sampled(0.05, None);
            readings.push(Estimate { value: 1.0 + deviation + 0.05 * noise, uncertainty });
        }
        let design_effect = Some(1.0 + share * 49.0);
        let subject = Recording { design_effect, ..recording("radiance", &readings) };
        let exact = recording("simulator", &[Estimate::exact(1.0); 50]);
        let (judge, task) = (built_in(), task(50));
        let comparisons = judge.compare(&task, &[&exact, &subject]);
        judge.bias(&comparisons, &[exact, subject]).into_iter().any(|b| b.key.engine == "radiance" && b.fails)
    }

    #[test]
    fn a_bias_beyond_the_tolerance_fails_and_one_at_its_edge_does_not() {
        let count = |deviation, share| (0..2000).filter(|seed| fails_by_bias(deviation, *seed, share)).count();
        assert_eq!(count(0.08, 0.0), 2000);
        assert_eq!(count(-0.08, 0.0), 2000);
        for (edge, share) in [(0.02, 0.0), (-0.02, 0.0), (0.02, 0.5)] {
            let wrong = count(edge, share);
            assert!(wrong <= 2, "{wrong} of 2000 at {edge}, of which none is expected");
        }
    }

    #[test]
    fn scatter_beyond_what_is_stated_widens_the_interval() {
        let (honest, bold) = (bias(&noisy(0.003, 0.004, 1)), bias(&noisy(0.003, 0.0004, 1)));
        let widths = [&honest, &bold].map(|b| b.high - b.low);
        assert!((widths[1] / widths[0] - 1.0).abs() < 0.3, "{honest} {bold}");
    }

    /// The probability of the scatter of so many right readings.
    fn scatter_probability(readings: usize, blocks: usize, random: &mut fastrand::Rng) -> Option<f64> {
        let mut values = vec![];
        for _ in 0..readings {
            let samples: Vec<f64> = (0..blocks).map(|_| 1.0 + 0.02 * normal(random)).collect();
            let reading = Estimate::of_samples(&samples);
            let error = reading.uncertainty.standard_error();
            values.extend(error.map(|error| (reading.value, error, reading.uncertainty.degrees_of_freedom())));
        }
        WeightedMean::of(&values)?.scatter.p_value
    }

    /// How often, of 2,000 times, the scatter of so many right readings is called this improbable.
    fn count_alarms(readings: usize, blocks: usize, below: f64) -> usize {
        let mut random = fastrand::Rng::with_seed(3);
        (0..2000).filter(|_| scatter_probability(readings, blocks, &mut random).is_some_and(|p| p < below)).count()
    }

    #[test]
    fn scatter_over_meters_is_improbable_as_rarely_as_it_says_and_too_small_errors_show() {
        for (readings, blocks) in [(4, 8), (14, 8), (77, 8), (4, 16), (14, 16), (77, 16), (14, 200)] {
            let found = [0.05, 0.01, 0.001].map(|below| count_alarms(readings, blocks, below));
            eprintln!("{readings} {blocks} {found:?}");
            assert!(found[0] <= 150 && found[1] <= 40, "{readings} readings of {blocks} blocks: {found:?}");
        }
        let [honest, bold] = [0.004, 0.004 / 3.0].map(|stated| bias(&noisy(0.003, stated, 1)).scatter.unwrap());
        assert!((honest.ratio - 1.0).abs() < 0.2 && honest.p_value.unwrap() > 0.01, "{honest:?}");
        assert!((bold.ratio - 3.0).abs() < 0.6 && bold.p_value.unwrap() < 1e-6, "{bold:?}");
    }

    /// The probability of the bias of 24 meters that share all their noise.
    fn shared_noise_probability(seed: u64, design_effect: Option<f64>) -> f64 {
        let common = 0.004 * normal(&mut fastrand::Rng::with_seed(seed));
        let one = Estimate { value: 1.0 + common, uncertainty: Uncertainty::sampled(0.004, None) };
        let exact = recording("simulator", &[Estimate::exact(1.0); 24]);
        let (judge, subject) = (built_in(), Recording { design_effect, ..recording("radiance", &[one; 24]) });
        let comparisons = judge.compare(&task(24), &[&exact, &subject]);
        let found = judge.bias(&comparisons, &[subject]);
        found.into_iter().find(|b| b.key.engine == "radiance").and_then(|b| b.p_value).unwrap()
    }

    /// The probability of the mean of 24 meters that share eight blocks.
    fn shared_blocks_probability(seed: u64) -> f64 {
        let mut random = fastrand::Rng::with_seed(seed);
        let one = Estimate::of_samples(&(0..8).map(|_| 1.0 + 0.01 * normal(&mut random)).collect::<Vec<f64>>());
        let error = one.uncertainty.standard_error().unwrap();
        let deviation = (one.value - 1.0, error, one.uncertainty.degrees_of_freedom());
        WeightedMean::of(&[deviation; 24]).unwrap().sharing(24.0, Some(7.0)).p_value()
    }

    #[test]
    fn noise_that_meters_share_is_no_bias() {
        let [shared, ignored] = [Some(24.0), None]
            .map(|design_effect| (0..200).filter(|seed| shared_noise_probability(*seed, design_effect) < 0.05).count());
        assert!((2..=20).contains(&shared), "{shared}");
        assert!(ignored > 100, "the negative control: {ignored}");
        // Eight blocks that all meters share are no more than eight.
        let small = (0..2000).filter(|seed| shared_blocks_probability(*seed) < 0.001).count();
        assert!(small <= 4, "{small} of 2000");
    }

    #[test]
    fn readings_without_uncertainty_have_mean_and_range_and_no_probability() {
        let found = bias(&[Estimate::exact(1.01), Estimate::exact(0.99), Estimate::exact(1.03)]);
        assert!((found.mean - 0.01).abs() < 1e-12 && (found.low + 0.01).abs() < 1e-12, "{found}");
        assert_eq!((found.p_value, found.to_string()), (None, "+1.000 % [-1.000, +3.000], range of 3".to_owned()));
    }

    fn deviation(relative: f64, uncertainty: f64, explained: f64) -> Deviation {
        Deviation { relative, uncertainty, degrees_of_freedom: None, explained, is_judged: true }
    }

    fn are_close(a: f64, b: f64) -> bool {
        (a - b).abs() <= 1e-6 * b.abs()
    }

    #[test]
    fn readings_share_all_errors_but_chance_as_far_as_these_reach() {
        let components = vec![
            Component::normal(Source::MonteCarlo, 5.0, None),
            Component::within(Source::Discretisation, 0.6),
            Component::normal(Source::Reference, 0.2, Some(7.0)),
            Component::within(Source::Input, 0.3),
        ];
        // A bound reaches to itself, an error of .2 to three times as far.
        assert!(are_close(shared_error(&error_budget::budget(components, 0.02)), 0.6 + 0.6 + 0.3));
    }

    #[test]
    fn a_mean_is_about_normal_without_skewed_blocks_and_heavy_tails() {
        let is_normal =
            |skewness| is_about_normal(&Recording { skewness, ..recording("radiance", &[Estimate::exact(1.0)]) });
        assert_eq!([None, Some(2.33), Some(2.34)].map(is_normal), [true, true, false]);
        let found = StatedErrors::from_finding(ErrorFinding::HeavyTail);
        assert!(!is_about_normal(&Recording { stated_errors: vec![found], ..recording("radiance", &[]) }));
    }

    /// The probability within what is explained, where meters have this design effect by blocks and by repeated readings.
    fn probability(deviations: &[Deviation], by_blocks: Option<f64>, by_seeds: Option<f64>) -> Option<f64> {
        let of_seeds = |design_effect| {
            let found = StatedErrors::from_finding(ErrorFinding::TooSmall);
            StatedErrors { ratio: Some(1.0), design_effect, ..found }
        };
        // What states no ratio says nothing of what meters share.
        let without_ratio = StatedErrors { design_effect: 50.0, ..StatedErrors::from_finding(ErrorFinding::Scatters) };
        let stated_errors = by_seeds.map(of_seeds).into_iter().chain([without_ratio]).collect();
        let recording = Recording { design_effect: by_blocks, stated_errors, ..recording("radiance", &[]) };
        probability_within(deviations, &recording)
    }

    #[test]
    fn a_bias_is_as_probable_as_its_excess_over_what_is_explained() {
        // Two readings of .05, of which .02 and .03 are explained: the excess is .025, with an error of .01 / 2^(1/2) where they are
        // independent, and of .01 where they share all noise. Normal probabilities beyond 3.5355 and 2.5 on both sides.
        let [independent, shared] = [4.069_520_2e-4, 1.241_933_1e-2];
        for side in [1.0, -1.0] {
            let two = [deviation(side * 0.05, 0.01, 0.02), deviation(side * 0.05, 0.01, 0.03)];
            for (by_blocks, by_seeds, expected) in [
                (Some(1.0), None, independent),
                (Some(2.0), None, shared),
                (None, None, shared),
                (None, Some(1.0), independent),
                (Some(1.0), Some(2.0), shared),
                (Some(2.0), Some(1.0), shared),
            ] {
                let found = probability(&two, by_blocks, by_seeds).unwrap();
                assert!(are_close(found, expected), "{side} {by_blocks:?} {by_seeds:?}: {found}");
            }
        }
        // Weights of 1 and 1/4: (.02 + .07 / 4) / 1.25 = .03 is explained. The excess of .02 is 5^(1/2) errors of .02 / 5^(1/2).
        let two = [deviation(0.05, 0.01, 0.02), deviation(0.05, 0.02, 0.07)];
        let found = probability(&two, Some(1.0), None).unwrap();
        assert!(are_close(found, 2.534_731_9e-2), "{found}");
        // A weighted mean of (.04 + .09 / 4) / 1.25 = .05, about which readings scatter by 5^(1/2) errors: 5^(1/2) * .02 / 5^(1/2). The
        // excess of .02 is one error.
        let two = [deviation(0.04, 0.01, 0.03), deviation(0.09, 0.02, 0.03)];
        let found = probability(&two, Some(1.0), None).unwrap();
        assert!(are_close(found, 0.317_310_508), "{found}");
    }

    #[test]
    fn no_bias_fails_where_it_is_explained_or_where_its_probability_is_not_known() {
        let two = |first: Deviation| probability(&[first, deviation(0.05, 0.01, 0.02)], Some(1.0), None);
        assert!(two(deviation(0.05, 0.01, 0.02)).is_some());
        // A mean of .05 with as much explained.
        assert_eq!(two(deviation(0.05, 0.01, 0.08)), None);
        assert_eq!(two(Deviation { is_judged: false, ..deviation(0.05, 0.01, 0.02) }), None);
        for (uncertainty, is_known) in [(1e-6, false), (1.1e-6, true), (0.249, true), (0.25, false)] {
            assert_eq!(two(deviation(0.05, uncertainty, 0.02)).is_some(), is_known, "{uncertainty}");
        }
        assert_eq!(probability(&[deviation(0.05, 0.01, 0.02)], Some(1.0), None), None);
    }

    #[test]
    fn a_mean_has_the_interval_of_its_error_or_else_the_range_of_readings() {
        let tail = upper_tail_of_normal(2.0);
        let two = [deviation(0.04, 0.01, 0.0), deviation(0.04, 0.01, 0.0)];
        let found = weighted_mean(&two, 1.0, tail).unwrap();
        let half = 0.02 / 2f64.sqrt();
        assert!(
            are_close(found.low, 0.04 - half) && are_close(found.high, 0.04 + half) && are_close(found.value, 0.04)
        );
        assert!(found.scatter.is_some() && found.p_value.is_some_and(|p| p < 1e-6));
        let shared = weighted_mean(&two, 2.0, tail).unwrap();
        assert!(are_close(shared.high, 0.06), "{}", shared.high);
        for (uncertainty, is_weighted) in [(1e-6, false), (1.1e-6, true)] {
            let two = [deviation(0.05, uncertainty, 0.0), deviation(0.03, 0.01, 0.0)];
            assert_eq!(weighted_mean(&two, 1.0, tail).is_some(), is_weighted, "{uncertainty}");
        }
        let key = ReadingKey::new("c", luxproof_model::ProcedureId::IndirectIlluminance, "radiance");
        let infinite = [deviation(f64::INFINITY, 0.0, 0.0)];
        assert_eq!(bias_of_group(&key, Basis::Simulator, &infinite, 1.0, tail), None);
    }

    /// Whether two meters of 200 lx fail by a common deviation: with errors of 2 lx, and a reference within a bound in lux.
    fn do_two_fail(deviation: f64, bound: f64, lists_recording: bool) -> bool {
        let uncertainty = Uncertainty::sampled(2.0, None);
        let one = Estimate { value: 200.0 * (1.0 + deviation), uncertainty };
        let exact = Estimate { value: 200.0, uncertainty: Uncertainty::Bound(bound) };
        let subject = Recording { design_effect: Some(1.0), ..recording("radiance", &[one; 2]) };
        let all = [recording("simulator", &[exact; 2]), subject];
        let (judge, task) = (built_in(), task(2));
        let comparisons = judge.compare(&task, &[&all[0], &all[1]]);
        let listed = if lists_recording { &all[..] } else { &all[..1] };
        let found = judge.bias(&comparisons, listed);
        assert_eq!((found.len(), found[0].readings), (1, 2));
        found[0].fails
    }

    #[test]
    fn a_bias_fails_below_a_tenth_of_the_family_wise_error() {
        // Beyond 3.8906 standard deviations lie 1e-4 on both sides. The error of the mean is .01 / 2^(1/2), and .02 is allowed.
        let limit = 0.02 + 3.8906 * 0.01 / 2f64.sqrt();
        assert!(do_two_fail(limit + 1e-4, 0.0, true) && do_two_fail(-limit - 1e-4, 0.0, true));
        assert!(!do_two_fail(limit - 1e-4, 0.0, true) && !do_two_fail(-limit + 1e-4, 0.0, true));
        assert!(!do_two_fail(limit + 1e-4, 0.0, false), "a recording that is not there");
        // A bound of 3 lx is .015 more that meters share, and 3 of 7 parts of the variance.
        let limit = 0.035 + 3.8906 * 7f64.sqrt() / 200.0 / 2f64.sqrt();
        assert!(do_two_fail(limit + 1e-4, 3.0, true) && !do_two_fail(limit - 1e-4, 3.0, true));
    }

    #[test]
    fn meters_that_no_sample_met_have_no_part_in_a_bias() {
        let exact = recording("simulator", &[Estimate::exact(1.0); 3]);
        let unseen = Estimate { value: 0.0, uncertainty: Uncertainty::NotSeen };
        let read = Estimate { value: 1.01, uncertainty: Uncertainty::sampled(0.1, None) };
        let subject = recording("radiance", &[read, unseen, read]);
        let comparisons = built_in().compare(&task(3), &[&exact, &subject]);
        let found = built_in().bias(&comparisons, &[]);
        assert_eq!((found[0].readings, found.len()), (2, 1));
        assert!(are_close(found[0].mean, 0.01), "{}", found[0]);
    }
}
