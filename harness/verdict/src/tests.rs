//! Laws of the verdict: how often noise alone fails, and what a budget is made of.

use glam::DVec3;
use luxproof_model::MeterId;
use luxproof_photometry::LuminousIntensityDistribution;
use luxproof_scene::{Meter, Transport};

use super::*;
use crate::fixtures::{built_in, recording, task};
use luxproof_engines::fixtures::luminaire;
use luxproof_model::Estimate;
use luxproof_process::random::normal;

fn sampled(value: f64, error: f64, degrees_of_freedom: f64) -> Estimate {
    Estimate { value, uncertainty: Uncertainty::sampled(error, Some(degrees_of_freedom)) }
}

/// The share of runs in which any of 192 noisy meters fails that truly lie `deviation` off a reference of 1.
fn false_failures(deviation: f64, blocks: usize, seed: u64) -> f64 {
    const METERS: usize = 192;
    const RUNS: usize = 400;
    let (task, exact) = (task(METERS), recording("simulator", &[Estimate::exact(1.0); METERS]));
    let mut random = fastrand::Rng::with_seed(seed);
    let mut failed = 0;
    for _ in 0..RUNS {
        let mut readings = vec![];
        for _ in 0..METERS {
            let values: Vec<f64> = (0..blocks).map(|_| 1.0 + deviation + 0.004 * normal(&mut random)).collect();
            readings.push(Estimate::of_samples(&values));
        }
        let subject = recording("radiance", &readings);
        let comparisons = built_in().compare(&task, &[&exact, &subject]);
        failed += usize::from(comparisons.iter().any(|c| c.verdict == Verdict::Fail));
    }
    failed as f64 / RUNS as f64
}

#[test]
fn a_grid_of_192_meters_at_the_edge_of_its_tolerance_falsely_fails_in_one_run_of_a_thousand_at_most() {
    // The tolerance is 2 %; eight blocks a meter, so that the standard error itself is a guess. Three standard deviations of
    // the share over 400 runs are .005.
    for (deviation, seed) in [(0.02, 1), (-0.02, 2)] {
        let share = false_failures(deviation, 8, seed);
        assert!(share <= 0.001 + 0.005, "{share}");
    }
    // A test that never rejects shows nothing.
    let far_beyond = false_failures(0.05, 8, 4);
    assert!(far_beyond > 0.9, "{far_beyond}");
    let well_inside = false_failures(0.01, 8, 3);
    assert!(well_inside <= 0.003, "{well_inside}");
}

/// Whether one meter at the edge of its tolerance fails a test by itself.
fn does_single_test_fail(random: &mut fastrand::Rng) -> bool {
    let values: Vec<f64> = (0..8).map(|_| 0.02 + 0.004 * normal(random)).collect();
    let Estimate { value, uncertainty } = Estimate::of_samples(&values);
    judge(value, 2.0 * uncertainty.standard_error().unwrap(), 0.02) == Verdict::Fail
}

#[test]
fn the_same_grid_without_correction_fails_nearly_always() {
    // The negative control of the test above: 192 single tests at 2.3 %.
    let mut random = fastrand::Rng::with_seed(4);
    let runs = (0..100).filter(|_| (0..192).any(|_| does_single_test_fail(&mut random))).count();
    assert!(runs > 90, "{runs}");
}

#[test]
fn a_real_failure_at_one_meter_of_192_still_fails() {
    let mut readings = vec![sampled(1.0, 0.001, 15.0); 192];
    readings[100].value = 1.03;
    let exact = recording("simulator", &[Estimate::exact(1.0); 192]);
    let comparisons = built_in().compare(&task(192), &[&exact, &recording("radiance", &readings)]);
    let failed: Vec<&Comparison> = comparisons.iter().filter(|c| c.verdict == Verdict::Fail).collect();
    assert_eq!(failed.len(), 1);
    assert_eq!(failed[0].meter, MeterId::new("grid", 100));
}

#[test]
fn what_is_never_seen_fails_where_samples_are_many_and_waits_where_they_are_few() {
    for (error, verdict) in [(1e-4, Verdict::Fail), (0.01, Verdict::Fail), (0.05, Verdict::Undecided)] {
        let exact = recording("simulator", &[Estimate::exact(1.0); 4]);
        let mut readings = vec![sampled(1.0, error, 15.0); 4];
        readings[2] = Estimate { value: 0.0, uncertainty: Uncertainty::NotSeen };
        let comparisons = built_in().compare(&task(4), &[&exact, &recording("radiance", &readings)]);
        let mut unseen =
            comparisons.iter().filter(|c| c.meter == MeterId::new("grid", 2) && c.key.engine == "radiance");
        assert_eq!(unseen.next().unwrap().verdict, verdict, "{error}");
    }
}

#[test]
fn a_budget_names_what_it_is_made_of() {
    let mut exact = recording("simulator", &[Estimate::exact(2.0)]);
    exact.readings[0].uncertainty = Uncertainty::Bound(0.0003);
    let mut subject = recording("radiance", &[sampled(2.01, 0.004, 8.0)]);
    subject.readings[0].uncertainty = subject.readings[0].uncertainty.within(0.002);
    let comparisons = built_in().compare(&task(1), &[&exact, &subject]);
    let budget = comparisons[0].budget.as_ref().unwrap();
    let of = |source| budget.components.iter().find(|c| c.source == source).unwrap();
    assert_eq!(of(Source::MonteCarlo).degrees_of_freedom, Some(8.0));
    assert!((of(Source::Discretisation).uncertainty - 0.002 / 3f64.sqrt()).abs() < 1e-15);
    assert!((of(Source::Reference).uncertainty - 0.0003 / 3f64.sqrt()).abs() < 1e-15);
    assert!(budget.components.iter().all(|c| !matches!(c.source, Source::Rounding | Source::Input)));
    assert!((budget.combined - 0.004_f64.hypot(0.002 / 3f64.sqrt()).hypot(0.0003 / 3f64.sqrt())).abs() < 1e-12);
}

#[test]
fn at_the_edge_of_a_jump_both_values_stand_and_nothing_between_fails() {
    let ends_bright = LuminousIntensityDistribution::axial(vec![0.0, 90.0], vec![400.0, 400.0]).unwrap();
    let mut lamp = luminaire("lamp", DVec3::new(1.0, 1.0, 1.0), ends_bright);
    lamp.flux_scale = 0.5;
    let mut task = task(2);
    task.transport = Transport::Direct;
    task.scene.luminaires = vec![lamp];
    // Level with the luminaire, and a hair lower.
    for (target, z) in task.targets.iter_mut().zip([1.0, 1.0 - 1e-6]) {
        let meter = Meter { position_m: DVec3::new(3.0, 1.0, z), normal: DVec3::NEG_X };
        *target = Target::of_one(target.id.clone(), meter, 1.0);
    }
    let exact = recording("simulator", &[Estimate::exact(50.0); 2]);
    for (lx, verdicts) in [
        (50.0, [Verdict::Pass, Verdict::Pass]),
        (0.0, [Verdict::Undecided, Verdict::Fail]),
        (25.0, [Verdict::Undecided, Verdict::Fail]),
        (110.0, [Verdict::Fail, Verdict::Fail]),
    ] {
        let subject = recording("radiance", &[Estimate::exact(lx); 2]);
        let comparisons = built_in().compare(&task, &[&exact, &subject]);
        let of_subject = comparisons.iter().filter(|c| c.key.engine == EngineName::new("radiance"));
        assert_eq!(of_subject.map(|c| c.verdict).collect::<Vec<_>>(), verdicts, "{lx}");
    }
}

#[test]
fn one_recording_alone_comes_to_what_it_comes_to_among_all() {
    let (task, judge) = (task(3), built_in());
    let estimates = |off: f64| [1.0, 2.0, 3.0].map(|lx| sampled(lx + off, 0.01, 7.0));
    let all = [("simulator", 0.0), ("radiance", 0.001), ("mitsuba", 0.3)].map(|(e, off)| recording(e, &estimates(off)));
    let all: Vec<&Recording> = all.iter().collect();
    let one_by_one: Vec<Comparison> = all.iter().flat_map(|one| judge.compare_one(&task, one, &all)).collect();
    assert_eq!(one_by_one, judge.compare(&task, &all));
    assert!(one_by_one.iter().any(|c| c.verdict == Verdict::Fail));
    // Without the reference engine there is no reference.
    assert!(judge.compare_one(&task, all[1], &all[1..]).iter().all(|c| c.reference.is_none()));
}

/// The verdict of an engine that reads so much of the right direct light of a panel.
fn verdict_below_a_panel(engine: &str, factor: f64) -> Verdict {
    let mut lamp = luminaire("panel", DVec3::new(1.0, 1.0, 3.0), luxproof_engines::fixtures::lambertian());
    lamp.model = luxproof_scene::LuminaireModel::Area;
    let mut task = task(1);
    (task.procedure, task.transport) = (ProcedureId::DirectIlluminance, Transport::Direct);
    task.scene.luminaires = vec![lamp];
    let [exact, subject] = [("simulator", 1.0), (engine, factor)].map(|(name, factor)| {
        let mut recording = recording(name, &[Estimate::exact(100.0 * factor)]);
        recording.key.procedure = ProcedureId::DirectIlluminance;
        recording
    });
    built_in().compare(&task, &[&exact, &subject]).into_iter().find(|c| c.key.engine == engine).unwrap().verdict
}

#[test]
fn a_hand_method_is_compared_with_what_it_claims_and_decides_no_run() {
    // The five-times rule promises one to two per cent, a renderer one.
    for (engine, factor, verdict) in [
        ("iesna", 0.983, Verdict::Pass),
        ("iesna", 0.97, Verdict::NotJudged),
        ("radiance", 0.983, Verdict::Fail),
        ("radiance", 0.993, Verdict::Pass),
    ] {
        assert_eq!(verdict_below_a_panel(engine, factor), verdict, "{engine} {factor}");
    }
    for (factor, verdict) in [(1.09, Verdict::Pass), (1.12, Verdict::NotJudged)] {
        let all = [recording("simulator", &[Estimate::exact(1.0)]), recording("iesna", &[Estimate::exact(factor)])];
        let compared = built_in().compare(&task(1), &[&all[0], &all[1]]);
        assert_eq!(compared.iter().find(|c| c.key.engine == "iesna").unwrap().verdict, verdict, "{factor}");
    }
}

/// The verdict on a dark reading beside a bright one, where a spec gives only a relative tolerance.
fn verdict_on_darkness(value: f64, bound: f64) -> Verdict {
    let relative_only = luxproof_spec::ToleranceOverride { relative: 0.01, ..Default::default() };
    let overrides =
        std::collections::BTreeMap::from([(luxproof_model::ProcedureId::IndirectIlluminance, relative_only)]);
    let judge = Judge { overrides: &overrides, ..built_in() };
    let exact = recording("simulator", &[Estimate::exact(100.0), Estimate::exact(0.0)]);
    let read = Estimate { value, uncertainty: Uncertainty::Bound(bound) };
    let subject = recording("radiance", &[Estimate::exact(100.0), read]);
    let comparisons = judge.compare_one(&task(2), &subject, &[&exact, &subject]);
    assert_eq!(comparisons[0].verdict, Verdict::Pass);
    comparisons[1].verdict
}

#[test]
fn the_error_of_the_same_sum_of_planes_is_in_no_comparison() {
    for (of_reading, of_reference, expected) in [(0.47, 0.47, 0.0), (0.47, 0.0, 0.47), (0.0, 0.47, 0.47)] {
        let mut exact = recording("simulator", &[Estimate::exact(100.0)]);
        let mut subject = recording("radiance", &[Estimate::exact(100.6)]);
        (exact.readings[0].quadrature, subject.readings[0].quadrature) = (of_reference, of_reading);
        let comparison = &built_in().compare_one(&task(1), &subject, &[&exact, &subject])[0];
        let budget = comparison.budget.as_ref().unwrap();
        // The standard uncertainty of a rectangular distribution, JCGM 100:2008, 4.3.7.
        assert!((budget.combined - expected / 3f64.sqrt()).abs() < 1e-12, "{budget:?}");
    }
}

#[test]
fn a_missing_reading_of_darkness_keeps_its_reason_without_a_tolerance() {
    let none = luxproof_spec::ToleranceOverride::default();
    let overrides = std::collections::BTreeMap::from([(luxproof_model::ProcedureId::IndirectIlluminance, none)]);
    let judge = Judge { overrides: &overrides, ..built_in() };
    let exact = recording("simulator", &[Estimate::exact(100.0), Estimate::exact(0.0)]);
    let subject = recording("radiance", &[Estimate::exact(100.0)]);
    let missing = &judge.compare_one(&task(2), &subject, &[&exact, &subject])[1];
    assert_eq!((missing.verdict, missing.diagnosis.as_deref()), (Verdict::Missing, Some("no reading")));
}

#[test]
fn darkness_passes_up_to_rounding_where_a_spec_gives_no_absolute_tolerance() {
    assert_eq!(verdict_on_darkness(0.0, 7e-12), Verdict::Pass);
    assert_eq!(verdict_on_darkness(1e-9, 0.0), Verdict::Fail);
    assert_eq!(verdict_on_darkness(0.0, 0.1), Verdict::Undecided);
}
