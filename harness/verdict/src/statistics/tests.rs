//! Whether intervals of mean, minimum, uniformity and diversity hold, by grids of known truth.

use super::*;
use crate::fixtures::{built_in, recording, task};
use luxproof_model::MeterId;
use luxproof_process::random::normal;
use luxproof_statistics::{error_budget, mean_correlation};

const TAIL: f64 = 0.022_750_131_948;

fn sampled(value: f64, error: f64) -> Estimate {
    Estimate { value, uncertainty: Uncertainty::sampled(error, Some(31.0)) }
}

fn statistics(exact: &Recording, subject: Recording) -> Statistics {
    let comparisons = built_in().compare(&task(exact.readings.len()), &[exact, &subject]);
    let mut found = built_in().statistics(&comparisons, &[subject]);
    assert_eq!(found.len(), 1);
    found.remove(0)
}

fn agreement(exact: &[Estimate], read: &[Estimate]) -> StatisticsAgreement {
    statistics(&recording("simulator", exact), recording("radiance", read)).agreement.unwrap()
}

fn bounded(value: f64, bound: f64) -> Estimate {
    Estimate { value, uncertainty: Uncertainty::Bound(bound) }
}

#[test]
fn mean_minimum_and_quotients_carry_the_errors_of_their_meters() {
    let subject = recording("radiance", &[bounded(100.0, 1.0), bounded(300.0, 3.0)]);
    let [s] = &built_in().statistics(&[], &[subject])[..] else { panic!("one set") };
    assert_eq!((s.meters, s.mean.value, s.minimum.value, s.agreement.is_none()), (2, 200.0, 100.0, true));
    assert_eq!((s.mean.uncertainty, s.minimum.uncertainty), (Uncertainty::Bound(2.0), Uncertainty::Bound(1.0)));
    assert_eq!(s.maximum, Some(bounded(300.0, 3.0)));
    let (uniformity, diversity) = (s.uniformity.unwrap(), s.diversity.unwrap());
    assert_eq!((uniformity.value, diversity.value), (0.5, 100.0 / 300.0));
    // 1 / 200 + 100 * 2 / 200^2, and 1 / 300 + 100 * 3 / 300^2.
    assert!((uniformity.uncertainty.bound() - 0.01).abs() < 1e-12, "{uniformity:?}");
    assert!((diversity.uncertainty.bound() - 2.0 / 300.0).abs() < 1e-12, "{diversity:?}");
    assert!(built_in().statistics(&[], &[recording("radiance", &[bounded(1.0, 0.0)])]).is_empty());
}

#[test]
fn the_minimum_is_no_surer_than_the_meters_that_may_be_it() {
    // The second may be as low as 95, and the least is no higher than 101 whatever the second is.
    let found = least(&[bounded(100.0, 1.0), bounded(105.0, 10.0)], TAIL).unwrap();
    assert_eq!(found, bounded(100.0, 5.0));
    // Far from all others the lowest meter is by itself; among equals it is not.
    let alone = least(&[sampled(100.0, 1.0), sampled(200.0, 1.0), sampled(201.0, 1.0)], TAIL).unwrap();
    assert!((alone.uncertainty.standard() - 1.0).abs() < 1e-9, "{alone:?}");
    let equals = least(&[sampled(100.0, 1.0); 20], TAIL).unwrap();
    assert!(equals.uncertainty.standard() > 1.4, "{equals:?}");
    let unseen = Estimate { value: 0.0, uncertainty: Uncertainty::NotSeen };
    assert_eq!(least(&[sampled(100.0, 1.0), unseen], TAIL).unwrap(), unseen);
    assert_eq!(least(&[Estimate::exact(2.0), Estimate::exact(1.0)], TAIL), Some(Estimate::exact(1.0)));
}

/// How noise comes to meters.
#[derive(Clone, Copy, Debug)]
enum Noise {
    Independent,
    Common,
    /// Some meters are a tenth as noisy as others.
    Uneven,
    /// Half of it common, and a bound besides that all meters are at a random place of, each by itself.
    MixedAndBounded,
}

/// How light lies over a grid.
#[derive(Clone, Copy, Debug)]
enum Light {
    Even,
    /// As in an office: the corners equal, the middle brighter.
    Office,
    Random,
    /// One meter lowest, by two of their errors.
    OneLow,
}

impl Light {
    fn truth(self, meters: usize, random: &mut fastrand::Rng) -> Vec<f64> {
        let side = (meters as f64).sqrt().ceil();
        let place =
            |k: usize| [(k as f64 % side).floor(), (k as f64 / side).floor()].map(|i| (i / (side - 1.0) - 0.5).abs());
        (0..meters)
            .map(|k| match self {
                Self::Even => 500.0,
                Self::Office => 500.0 - 300.0 * (place(k)[0].powi(2) + place(k)[1].powi(2)),
                Self::Random => 300.0 + 400.0 * random.f64(),
                Self::OneLow => {
                    if k == 2 {
                        490.0
                    } else {
                        500.0
                    }
                }
            })
            .collect()
    }
}

impl Noise {
    /// What is read of a truth in so many blocks, with errors of about this size, relative; and the mean correlation of its noise.
    fn read(self, truth: &[f64], (blocks, error): (usize, f64), random: &mut fastrand::Rng) -> (Vec<Estimate>, f64) {
        let of_block = error * (blocks as f64).sqrt();
        let common: Vec<f64> = (0..blocks).map(|_| normal(random)).collect();
        let share: f64 = match self {
            Self::Independent | Self::Uneven => 0.0,
            Self::Common => 1.0,
            Self::MixedAndBounded => 0.5,
        };
        let (mut readings, mut draws) = (vec![], vec![vec![]; blocks]);
        for (k, truth) in truth.iter().enumerate() {
            let of_block = if matches!(self, Self::Uneven) && k % 3 > 0 { 0.1 * of_block } else { of_block };
            let mut samples = vec![];
            for c in &common {
                let noise = share.sqrt() * c + (1.0 - share).sqrt() * normal(random);
                samples.push(truth * (1.0 + of_block * noise));
            }
            draws.iter_mut().zip(&samples).for_each(|(draw, sample)| draw.push(*sample));
            let mut read = Estimate::of_samples(&samples);
            if matches!(self, Self::MixedAndBounded) {
                let bound = error * truth;
                read.value += bound * (2.0 * random.f64() - 1.0);
                read.uncertainty = read.uncertainty.within(bound);
            }
            readings.push(read);
        }
        (readings, mean_correlation(&[draws]).unwrap())
    }
}

fn covers(of: &Estimate, truth: f64) -> bool {
    (of.value - truth).abs() <= error_budget::budget(uncertainty_components(&of.uncertainty), TAIL).expanded
}

/// The share of runs in which the interval of each figure holds its truth, and that of the lowest meter by itself.
fn coverage(
    light: Light,
    noise: Noise,
    (meters, blocks): (usize, usize),
    is_correlation_known: bool,
    runs: u32,
) -> [f64; 5] {
    let mut random = fastrand::Rng::with_seed(meters as u64 + 7 * blocks as u64);
    let mut covered = [0_u32; 5];
    for _ in 0..runs {
        let truth = light.truth(meters, &mut random);
        let (read, correlation) = noise.read(&truth, (blocks, 0.01), &mut random);
        let correlation = if is_correlation_known { correlation } else { 1.0 };
        let found = Figures::from_estimates(&read, correlation, TAIL).unwrap();
        let lowest = truth.iter().copied().fold(f64::INFINITY, f64::min);
        let highest = truth.iter().copied().fold(0.0, f64::max);
        let mean = truth.iter().sum::<f64>() / meters as f64;
        let own = read.iter().min_by(|a, b| a.value.total_cmp(&b.value)).unwrap();
        let all = [
            covers(&found.mean, mean),
            covers(&found.minimum, lowest),
            covers(&found.uniformity.unwrap(), lowest / mean),
            covers(&found.diversity.unwrap(), lowest / highest),
            covers(own, lowest),
        ];
        covered.iter_mut().zip(all).for_each(|(count, holds)| *count += u32::from(holds));
    }
    covered.map(|count| f64::from(count) / f64::from(runs))
}

#[test]
fn intervals_of_figures_hold_the_truth_whatever_meters_share() {
    const RUNS: u32 = 400;
    // Three standard deviations of a share of 95.45 % over so many runs.
    let least = 0.9545 - 3.0 * (0.9545_f64 * 0.0455 / f64::from(RUNS)).sqrt();
    let mut naive = 1.0_f64;
    for light in [Light::Even, Light::Office, Light::Random, Light::OneLow] {
        for noise in [Noise::Independent, Noise::Common, Noise::Uneven, Noise::MixedAndBounded] {
            for (meters, blocks) in [(4, 8), (15, 32), (100, 16)] {
                for is_known in [false, true] {
                    let [figures @ .., own] = coverage(light, noise, (meters, blocks), is_known, RUNS);
                    let what = format!("{light:?} {noise:?} {meters} meters, {blocks} blocks, known: {is_known}");
                    assert!(figures.iter().all(|share| *share >= least), "{what}: {figures:?}");
                    naive = naive.min(own);
                }
            }
        }
    }
    // The negative control: the lowest of a hundred equal meters is not as sure as it says of itself.
    assert!(naive < 0.5, "{naive}");
}

#[test]
fn the_uniformity_of_an_office_is_decided_when_its_meters_are() {
    // Meters with independent noise of .5 % against exact values, at a tolerance of 2 %.
    let mut random = fastrand::Rng::with_seed(65);
    let truth = Light::Office.truth(77, &mut random);
    let exact = recording("simulator", &truth.iter().map(|lux| Estimate::exact(*lux)).collect_vec());
    let (read, correlation) = Noise::Independent.read(&truth, (16, 0.005), &mut random);
    assert!(correlation < 0.1, "{correlation}");
    let mut subject = recording("radiance", &read);
    let unknown = statistics(&exact, subject.clone()).agreement.unwrap();
    subject.correlations = [("grid".to_owned(), correlation)].into();
    let known = statistics(&exact, subject).agreement.unwrap();
    let verdicts = known.figures().map(|(_, f)| f.verdict).collect_vec();
    assert_eq!((verdicts[0], verdicts[2]), (Verdict::Pass, Verdict::Pass), "{known:?}");
    let [before, after] = [unknown, known].map(|found| (found.mean.expanded, found.uniformity.unwrap().expanded));
    assert!(after.0 < 0.4 * before.0 && after.1 < 0.9 * before.1, "{before:?} {after:?}");
}

#[test]
fn figures_pass_fail_and_wait_as_meters_do() {
    let exact: Vec<Estimate> = (0..15).map(|k| Estimate::exact(400.0 + 10.0 * f64::from(k))).collect();
    let verdicts = |factor: f64, error: f64| {
        let read: Vec<Estimate> = exact.iter().map(|e| sampled(factor * e.value, error * e.value)).collect();
        agreement(&exact, &read).figures().map(|(_, f)| f.verdict).collect_vec()
    };
    // The tolerance is 2 %: a factor is none of a quotient.
    assert_eq!(verdicts(1.001, 1e-3), [Verdict::Pass; 4]);
    assert_eq!(verdicts(1.05, 1e-3), [Verdict::Fail, Verdict::Fail, Verdict::Pass, Verdict::Pass]);
    assert_eq!(verdicts(1.001, 0.05), [Verdict::Undecided; 4]);
    let read: Vec<Estimate> = exact.iter().map(|e| sampled(1.01 * e.value, 1e-3 * e.value)).collect();
    let found = agreement(&exact, &read);
    assert_eq!((found.basis, found.mean.reference.value, found.mean.allowed), (Basis::Simulator, 470.0, 9.4));
    assert!((found.minimum.deviation - 4.0).abs() < 1e-9 && (found.mean.relative().unwrap() - 0.01).abs() < 1e-9);
    assert!((found.uniformity.unwrap().allowed - 0.02 * 400.0 / 470.0).abs() < 1e-12);
}

#[test]
fn an_interval_of_a_figure_is_of_both_sides() {
    let expanded = |theirs, own| agreement(&[bounded(100.0, theirs); 3], &[bounded(100.0, own); 3]).mean.expanded;
    let (one, both) = (expanded(0.0, 0.3), expanded(0.3, 0.3));
    assert!((one - 0.9545 * 0.3).abs() < 1e-4 && both > 1.2 * one && both < 2.0 * one, "{one} {both}");
}

#[test]
fn figures_of_right_engines_lie_within_the_intervals_of_their_deviations() {
    let mut random = fastrand::Rng::with_seed(11);
    let (mut beyond, mut all) = ([0; 4], 0);
    for light in [Light::Even, Light::Office] {
        for _ in 0..100 {
            let truth = light.truth(15, &mut random);
            let mut read = |error| Noise::Independent.read(&truth, (16, error), &mut random).0;
            let found = agreement(&read(0.002), &read(0.004));
            let far = found.figures().map(|(_, f)| f.deviation.abs() > f.expanded);
            beyond.iter_mut().zip(far).for_each(|(count, is_far)| *count += i32::from(is_far));
            all += 1;
        }
    }
    assert!(beyond.iter().all(|count| *count <= all / 20 + 9), "{beyond:?} of {all}");
}

#[test]
fn what_has_no_reference_or_several_is_not_judged() {
    let read = vec![sampled(1.0, 1e-3); 4];
    let none = statistics(&recording("mitsuba", &read), recording("radiance", &read));
    assert!(none.agreement.is_none(), "{none:?}");
    let exact = recording("simulator", &[Estimate::exact(1.0); 4]);
    let subject = recording("radiance", &read);
    let mut comparisons = built_in().compare(&task(4), &[&exact, &subject]);
    let of = |comparisons: &[Comparison]| {
        built_in().statistics(comparisons, std::slice::from_ref(&subject)).remove(0).agreement
    };
    assert!(of(&comparisons).is_some());
    let mut printed = comparisons.last().unwrap().clone();
    printed.reference.as_mut().unwrap().basis = Basis::Published;
    comparisons.push(printed);
    assert!(of(&comparisons).is_none(), "a meter twice");
    comparisons.truncate(comparisons.len() - 2);
    assert!(of(&comparisons).is_none(), "a meter without");
    // A method that claims nothing of single points has no figures of them either.
    assert!(statistics(&exact, recording("iesna", &read)).agreement.is_none());
}

#[test]
fn a_meter_that_fails_nothing_lets_no_figure_fail() {
    let exact = [Estimate::exact(1.0); 6];
    let verdicts = |read: &[Estimate]| agreement(&exact, read).figures().map(|(_, f)| f.verdict).collect_vec();
    let mut read = vec![sampled(1.1, 1e-4); 6];
    assert_eq!(verdicts(&read)[..2], [Verdict::Fail; 2]);
    // One whose mean of few samples is not normal.
    read[2] = sampled(1.5, 0.45);
    assert!(verdicts(&read).iter().all(|v| *v != Verdict::Fail));
    // One that was not seen, of which nothing is known.
    let mut read = vec![sampled(1.0, 0.05); 6];
    read[2] = Estimate { value: 0.0, uncertainty: Uncertainty::NotSeen };
    assert_eq!(verdicts(&read), [Verdict::Undecided; 4]);
}

#[test]
fn reports_of_before_maximum_and_agreement_are_read() {
    let old = r#"{"case": "c", "procedure": "total_illuminance", "engine": "radiance", "set": "plane", "meters": 2,
        "mean": {"value": 2.0, "error_bound": 0.1}, "minimum": {"value": 1.0, "std_error": 0.1}, "uniformity": null}"#;
    let read: Statistics = serde_json::from_str(old).unwrap();
    assert_eq!((read.maximum, read.diversity, read.agreement), (None, None, None));
    assert_eq!(MeterId::new(&read.set, 0).0, "plane[0]");
    let exact = [Estimate::exact(1.0), Estimate::exact(2.0)];
    let new = statistics(&recording("simulator", &exact), recording("radiance", &exact.map(|e| e.times(1.01))));
    let again: Statistics = serde_json::from_str(&serde_json::to_string(&new).unwrap()).unwrap();
    assert_eq!(again, new);
}
