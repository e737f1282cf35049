//! Laws of ratios: what cancels, what does not, and how often an interval holds.

use glam::DVec3;
use luxproof_model::Basis;
use luxproof_photometry::LuminousIntensityDistribution;

use super::*;
use crate::fixtures::{built_in, recording, task};
use luxproof_engines::fixtures::luminaire;
use luxproof_model::Estimate;
use luxproof_model::Verdict;
use luxproof_process::random::normal;

/// One case: its task, the reference's readings and an engine's.
struct Side {
    tasks: Vec<Task>,
    recordings: Vec<Recording>,
    comparisons: Vec<Comparison>,
}

impl Side {
    fn of(task: Task, exact: &[Estimate], read: &[Estimate]) -> Self {
        let recordings = vec![recording("simulator", exact), recording("radiance", read)];
        let comparisons = built_in().compare(&task, &recordings.iter().collect_vec());
        Self { tasks: vec![task], recordings, comparisons }
    }

    fn measured<'a>(&'a self, case: &'a str) -> Measured<'a> {
        let readings = self.recordings.iter().flat_map(|r| r.readings.iter().map(move |reading| (&r.key, reading)));
        let Self { tasks, recordings, comparisons } = self;
        Measured { case, tasks, readings: readings.collect(), comparisons, recordings }
    }

    fn over(&self, before: &Self) -> Ratios {
        let found = built_in().ratios(&before.measured("before"), &self.measured("after"));
        assert_eq!(found.iter().map(|r| r.engine.as_str()).collect_vec(), ["simulator", "radiance"]);
        assert!(found[0].mean.agreement.is_none(), "a reference is not held against itself");
        found.into_iter().next_back().unwrap()
    }
}

fn sampled(value: f64, error: f64) -> Estimate {
    Estimate { value, uncertainty: Uncertainty::sampled(error, None) }
}

fn bounded(value: f64, bound: f64) -> Estimate {
    Estimate { value, uncertainty: Uncertainty::Bound(bound) }
}

fn plain(exact: &[Estimate], read: &[Estimate]) -> Side {
    Side::of(task(exact.len()), exact, read)
}

/// The same meters under a lamp of so much flux.
fn lit(flux: f64, exact: &[Estimate], read: &[Estimate]) -> Side {
    let mut task = task(exact.len());
    let mut lamp =
        luminaire("lamp", DVec3::Z, LuminousIntensityDistribution::axial(vec![0.0, 90.0], vec![100.0, 0.0]).unwrap());
    lamp.flux_scale = flux;
    task.scene.luminaires = vec![lamp];
    Side::of(task, exact, read)
}

#[test]
fn standard_errors_are_independent_and_bounds_add_up() {
    let exact = [Estimate::exact(100.0), Estimate::exact(200.0)];
    let twice = exact.map(|e| e.times(2.0));
    let found = plain(&twice, &twice.map(|e| sampled(e.value, 0.04 * e.value)))
        .over(&plain(&exact, &exact.map(|e| sampled(e.value, 0.03 * e.value))));
    let ratio = found.meters[0].of.ratio.unwrap();
    assert!(
        (ratio.value - 2.0).abs() < 1e-12 && (ratio.uncertainty.standard() - 2.0 * 0.05).abs() < 1e-12,
        "{ratio:?}"
    );
    let found = plain(&twice, &twice.map(|e| bounded(e.value, 0.04 * e.value)))
        .over(&plain(&exact, &exact.map(|e| bounded(e.value, 0.03 * e.value))));
    let (ratio, mean) = (found.meters[1].of.ratio.unwrap(), found.mean.ratio.unwrap());
    assert!((ratio.uncertainty.bound() - 2.0 * 0.07).abs() < 1e-12 && (mean.uncertainty.bound() - 0.14).abs() < 1e-12);
    assert!(!found.mean.errors_cancel && found.basis == Some(Basis::Simulator));
}

#[test]
fn errors_cancel_where_flux_alone_was_changed_and_readings_say_so() {
    let exact = [Estimate::exact(100.0), Estimate::exact(200.0)];
    let off = exact.map(|e| bounded(1.01 * e.value, 0.02 * e.value));
    let of = |flux: f64, factor: f64| {
        let after = lit(flux, &exact.map(|e| e.times(flux)), &off.map(|e| e.times(factor)));
        after.over(&lit(1.0, &exact, &off)).mean
    };
    let one = of(0.7, 0.7);
    assert!(one.errors_cancel && one.ratio.unwrap().uncertainty.standard() < 1e-8, "{one:?}");
    let agreement = one.agreement.unwrap();
    assert!(agreement.verdict == Verdict::Pass && agreement.expanded < 1e-8, "{agreement:?}");
    // Readings that are not in the ratio of the flux are two.
    for other in [of(0.7, 0.71), of(0.7, 0.700_001)] {
        assert!(!other.errors_cancel && other.ratio.unwrap().uncertainty.standard() > 0.01, "{other:?}");
    }
    // One meter that was read anew, as a spot check is, is by itself.
    let mut anew = off.map(|e| e.times(0.7));
    anew[0].value *= 1.001;
    let after = lit(0.7, &exact.map(|e| e.times(0.7)), &anew);
    let found = after.over(&lit(1.0, &exact, &off));
    assert_eq!(found.meters.iter().map(|m| m.of.errors_cancel).collect_vec(), [false, true]);
    // Both bounds of its, of .7 * 1.01 * 300 lx, and next to nothing of the other's.
    let (mean, alone) = (found.mean.ratio.unwrap(), 2.0 * 0.02 * 0.7 * 100.0 / (1.01 * 300.0));
    assert!((mean.uncertainty.bound() / alone - 1.0).abs() < 2e-2 && !found.mean.errors_cancel, "{mean:?} {alone}");
    // Equal readings of scenes that differ otherwise show nothing.
    let same = lit(1.0, &exact, &off);
    assert!(lit(1.0, &exact, &off).over(&same).mean.errors_cancel);
    let mut elsewhere = lit(1.0, &exact, &off);
    elsewhere.tasks[0].scene.luminaires[0].position_m.z = 2.0;
    assert!(!elsewhere.over(&same).mean.errors_cancel);
}

#[test]
fn a_ratio_passes_fails_and_waits_as_a_reading_does() {
    let exact = [Estimate::exact(100.0); 5];
    for (factor, error, verdict) in
        [(1.0, 1e-3, Verdict::Pass), (1.04, 1e-3, Verdict::Fail), (1.015, 5e-3, Verdict::Undecided)]
    {
        let [before, after] = [100.0, 150.0 * factor].map(|value| [sampled(value, error * value); 5]);
        let found = plain(&exact.map(|e| e.times(1.5)), &after).over(&plain(&exact, &before));
        let ratios = found.meters.iter().map(|m| &m.of).chain([&found.mean]);
        let verdicts = ratios.map(|r| r.agreement.as_ref().unwrap().verdict).dedup().collect_vec();
        assert_eq!(verdicts, [verdict], "{factor} {error}");
    }
}

/// A case whose meters read the truth with a relative error.
fn noisy_side(truth: impl Iterator<Item = f64>, error: f64, random: &mut fastrand::Rng) -> Side {
    let (mut exact, mut read) = (vec![], vec![]);
    for value in truth {
        exact.push(Estimate::exact(value));
        read.push(sampled(value * (1.0 + error * normal(random)), error * value));
    }
    plain(&exact, &read)
}

#[test]
fn intervals_of_ratios_hold_the_truth() {
    let mut random = fastrand::Rng::with_seed(5);
    for (before_error, after_error) in [(0.005, 0.005), (0.1, 0.01), (0.05, 0.1)] {
        let (mut within, mut all) = (0, 0);
        for _ in 0..150 {
            let truth: Vec<[f64; 2]> =
                (0..4).map(|_| [100.0 + 100.0 * random.f64(), 50.0 + 200.0 * random.f64()]).collect();
            let before = noisy_side(truth.iter().map(|t| t[0]), before_error, &mut random);
            let after = noisy_side(truth.iter().map(|t| t[1]), after_error, &mut random);
            let found = after.over(&before);
            for ratio in found.meters.iter().map(|m| &m.of).chain([&found.mean]) {
                let agreement = ratio.agreement.as_ref().unwrap();
                within += i32::from(agreement.deviation.abs() <= agreement.expanded);
                all += 1;
            }
        }
        // Three standard deviations below 95.45 %.
        assert!(
            f64::from(within) > (0.9545 - 0.023) * f64::from(all),
            "{before_error} {after_error}: {within} of {all}"
        );
    }
}

#[test]
fn what_is_elsewhere_dark_or_not_seen_has_no_ratio() {
    let exact = [Estimate::exact(100.0); 3];
    let before = plain(&exact, &[sampled(100.0, 1.0), Estimate::DARK, sampled(100.0, 40.0)]);
    let mut after = plain(&exact, &[sampled(100.0, 1.0); 3]);
    let found = after.over(&before);
    assert_eq!(found.meters.iter().map(|m| m.of.ratio.is_some()).collect_vec(), [true, false, false]);
    after.tasks[0].targets[1].meter.position_m.x = 1.0;
    assert_eq!(after.over(&before).meters.len(), 2);
    let unseen = [sampled(100.0, 1.0), Estimate { value: 0.0, uncertainty: Uncertainty::NotSeen }, sampled(100.0, 1.0)];
    let found = plain(&exact, &unseen).over(&plain(&exact, &[sampled(100.0, 1.0); 3]));
    assert_eq!(found.meters[1].of.ratio.unwrap().uncertainty, Uncertainty::NotSeen);
    assert_eq!(found.mean.ratio.unwrap().uncertainty, Uncertainty::NotSeen);
}
