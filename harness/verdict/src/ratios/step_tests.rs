//! The steps of a ratio, each by examples that were worked out by hand.

use glam::DVec3;
use luxproof_model::Verdict;

use super::*;
use crate::fixtures::{built_in, recording, task};
use luxproof_engines::fixtures::{lambertian, luminaire};

fn sampled(value: f64, error: f64) -> Estimate {
    Estimate { value, uncertainty: Uncertainty::sampled(error, None) }
}

fn bounded(value: f64, bound: f64) -> Estimate {
    Estimate { value, uncertainty: Uncertainty::Bound(bound) }
}

fn are_close(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-9 * b.abs()
}

#[test]
fn a_place_is_the_same_with_its_position_and_its_normal() {
    let meter = Meter { position_m: DVec3::ZERO, normal: DVec3::Z };
    assert!(has_same_place(&meter, &meter));
    assert!(!has_same_place(&meter, &Meter { position_m: DVec3::X, ..meter }));
    assert!(!has_same_place(&meter, &Meter { normal: DVec3::X, ..meter }));
}

/// A task under lamps of so much flux.
fn lit(fluxes: &[f64]) -> Task {
    let mut task = task(1);
    for flux in fluxes {
        let mut lamp = luminaire("lamp", DVec3::Z, lambertian());
        lamp.flux_scale = *flux;
        task.scene.luminaires.push(lamp);
    }
    task
}

#[test]
fn one_factor_of_all_flux_is_the_only_difference() {
    for (before, after, factor) in [
        (&[2.0][..], &[3.0][..], Some(1.5)),
        (&[2.0, 4.0], &[1.0, 2.0], Some(0.5)),
        (&[2.0, 4.0], &[1.0, 4.0], None),
        (&[2.0], &[2.0, 2.0], None),
        (&[0.0], &[1.0], None),
        (&[1.0], &[0.0], None),
        (&[-1.0], &[-2.0], None),
        (&[], &[], None),
    ] {
        assert_eq!(flux_factor(&lit(before), &lit(after)), factor, "{before:?} {after:?}");
    }
    let mut moved = lit(&[3.0]);
    moved.scene.luminaires[0].position_m.x = 1.0;
    assert_eq!(flux_factor(&lit(&[2.0]), &moved), None);
}

#[test]
fn a_quotient_is_a_factor_up_to_rounding() {
    for (quotient, is_same) in
        [(1.5, true), (1.5 * (1.0 + 0.9e-9), true), (1.5 * (1.0 + 1.1e-9), false), (1.5 * (1.0 - 1.1e-9), false)]
    {
        assert_eq!(is_factor(quotient, 1.5), is_same, "{quotient}");
    }
}

#[test]
fn readings_have_a_ratio_with_their_errors_or_without_any() {
    for (before, after, have_it) in [
        (sampled(10.0, 1.0), sampled(20.0, 2.0), true),
        (sampled(10.0, 1.0), sampled(20.0, 2.1), false),
        (sampled(10.0, 1.0), sampled(20.1, 2.0), false),
        (sampled(10.0, 1.0), sampled(20.0, 0.0), false),
        (sampled(10.0, 0.0), sampled(20.0, 2.0), false),
        (sampled(10.0, 0.0), sampled(20.0, 0.0), true),
        (bounded(10.0, 1.0), bounded(20.0, 5.0), true),
        (bounded(10.0, 1.0), bounded(20.1, 2.0), false),
    ] {
        assert_eq!(has_ratio(&before, &after, 2.0), have_it, "{before:?} {after:?}");
    }
}

/// The quotient of the mean after over that before, where all flux changed by a factor.
fn quotient(values: &[[Estimate; 2]], flux: Option<f64>) -> Option<(Estimate, bool)> {
    let judge = built_in();
    let measured = Measured { case: "c", tasks: &[], readings: vec![], comparisons: &[], recordings: &[] };
    let case = IndexedCase::new(&measured);
    CasePair { judge: &judge, before: &case, after: &case, flux }.quotient(values)
}

#[test]
fn a_quotient_has_the_error_of_both_sums_where_none_cancels() {
    // 300 over 150. Errors before add up to 4, and after to 6: (2 * 4)^2 + 6^2 = 10^2, over 150.
    let values = [[sampled(100.0, 1.0), sampled(200.0, 2.0)], [sampled(50.0, 3.0), sampled(100.0, 4.0)]];
    let (ratio, cancels) = quotient(&values, None).unwrap();
    assert!(are_close(ratio.value, 2.0) && are_close(ratio.uncertainty.standard(), 10.0 / 150.0), "{ratio:?}");
    assert!(!cancels && ratio.uncertainty.bound() == 0.0);
}

#[test]
fn errors_of_meters_in_the_ratio_of_the_flux_leave_their_distance_from_the_mean_ratio() {
    // The first doubles with the flux, the second trebles: 350 over 150 is 7/3. Of the first error 2 - 7/3 remains, of the second both.
    let values = [[bounded(100.0, 3.0), bounded(200.0, 6.0)], [bounded(50.0, 1.0), bounded(150.0, 2.0)]];
    let (ratio, cancels) = quotient(&values, Some(2.0)).unwrap();
    let bound = (3.0 / 3.0 + 7.0 / 3.0 + 2.0) / 150.0 + 1e-9 * 7.0 / 3.0;
    assert!(are_close(ratio.value, 7.0 / 3.0) && are_close(ratio.uncertainty.bound(), bound), "{ratio:?} {bound}");
    assert!(!cancels);
    let (ratio, cancels) = quotient(&values[..1], Some(2.0)).unwrap();
    assert!(cancels && are_close(ratio.uncertainty.bound(), 2e-9), "{ratio:?}");
}

#[test]
fn there_is_no_quotient_by_darkness_or_by_a_number_of_more_than_a_quarter_of_error() {
    let after = sampled(10.0, 1.0);
    for (before, is_known) in [
        (sampled(100.0, 25.0), true),
        (sampled(100.0, 26.0), false),
        (Estimate::DARK, false),
        (sampled(-100.0, 1.0), false),
    ] {
        assert_eq!(quotient(&[[before, after]], None).is_some(), is_known, "{before:?}");
    }
    assert!(quotient(&[[sampled(100.0, 1.0), sampled(f64::INFINITY, 1.0)]], None).is_none());
    assert!(quotient(&[[sampled(100.0, 1.0), sampled(10.0, f64::INFINITY)]], None).is_none());
    let unseen = Estimate { value: 0.0, uncertainty: Uncertainty::NotSeen };
    let (ratio, _) = quotient(&[[sampled(100.0, 1.0), unseen], [sampled(100.0, 1.0), after]], None).unwrap();
    assert_eq!(ratio.uncertainty, Uncertainty::NotSeen);
}

/// The comparisons of Radiance at meters of an exact reference.
fn comparisons(exact: f64, read: &[Estimate]) -> Vec<Comparison> {
    let exact = recording("simulator", &vec![Estimate::exact(exact); read.len()]);
    let subject = recording("radiance", read);
    built_in().compare_one(&task(read.len()), &subject, &[&exact, &subject])
}

#[test]
fn the_tolerance_of_a_ratio_is_that_after_relative_to_the_light_before() {
    let (judge, before, after) =
        (built_in(), comparisons(0.01, &[sampled(0.01, 1e-5); 2]), comparisons(0.02, &[sampled(0.021, 1e-4); 2]));
    let measured = Measured { case: "c", tasks: &[], readings: vec![], comparisons: &[], recordings: &[] };
    let case = IndexedCase::new(&measured);
    let pair = CasePair { judge: &judge, before: &case, after: &case, flux: None };
    let pairs = before.iter().zip(&after).map(|(before, after)| [before, after]).collect_vec();
    let plain = recording("radiance", &[]);
    let found = pair.agreement([&plain, &plain], &pairs).unwrap();
    // A reading may deviate by 1e-3 lx, which is a tenth of the light before and more than 2 % of the ratio.
    assert!(are_close(found.allowed, 0.1) && are_close(found.deviation, 0.1), "{found:?}");
    assert!(are_close(found.reference.value, 2.0));
    assert_eq!(pair.agreement([&plain, &plain], &[]), None);
    // What is planned in stages spends a share of its error, in either case.
    let staged = Recording { stages: vec![1], ..plain.clone() };
    let share = |recordings| pair.test(recordings, &pairs).share;
    assert_eq!(share([&plain, &plain]), 1.0);
    assert_eq!((share([&plain, &staged]), share([&staged, &plain])), (0.25, 0.25));
    // The narrower limit of both cases counts.
    let skewed = Recording { skewness: Some(9.0), ..plain.clone() };
    let limit = |recordings| pair.test(recordings, &pairs).limit;
    assert_eq!(limit([&plain, &plain]), VerdictLimit::None);
    assert_eq!(
        (limit([&plain, &skewed]), limit([&skewed, &plain])),
        (VerdictLimit::NoFailure, VerdictLimit::NoFailure)
    );
}

#[test]
fn a_basis_is_shared_where_it_is_that_of_both_cases() {
    let judge = built_in();
    let measured = Measured { case: "c", tasks: &[], readings: vec![], comparisons: &[], recordings: &[] };
    let case = IndexedCase::new(&measured);
    let pair = CasePair { judge: &judge, before: &case, after: &case, flux: None };
    let simulated = comparisons(1.0, &[sampled(1.0, 0.01)]).remove(0);
    let mut printed = simulated.clone();
    printed.reference.as_mut().unwrap().basis = Basis::Published;
    assert_eq!(pair.shared_basis(&[[&simulated, &simulated]]), Some(Basis::Simulator));
    assert_eq!(pair.shared_basis(&[[&printed, &printed]]), Some(Basis::Published));
    assert_eq!(pair.shared_basis(&[[&printed, &simulated]]), None);
}

#[test]
fn a_case_finds_readings_that_are_numbers_and_comparisons_that_are_alone() {
    let subject = recording("radiance", &[sampled(1.0, 0.01), sampled(f64::NAN, 0.01), sampled(2.0, 0.01)]);
    let mut compared = comparisons(1.0, &[sampled(1.0, 0.01); 2]);
    compared.push(compared[1].clone());
    let recordings = [subject.clone()];
    let readings = subject.readings.iter().map(|reading| (&subject.key, reading)).collect_vec();
    let measured = Measured { case: "c", tasks: &[], readings, comparisons: &compared, recordings: &recordings };
    let case = IndexedCase::new(&measured);
    let meters = [0, 1, 2].map(|k| MeterId::new("grid", k));
    let key = |k: usize| (ProcedureId::IndirectIlluminance, &subject.key.engine, &meters[k]);
    assert_eq!([0, 1, 2].map(|k| case.estimate(&key(k)).map(|e| e.value)), [Some(1.0), None, Some(2.0)]);
    assert_eq!([0, 1, 2].map(|k| case.single_comparison(&key(k)).is_some()), [true, false, false]);
    assert!(case.recording(&subject.key).is_some());
    for (procedure, engine) in
        [(ProcedureId::IndirectIlluminance, "mitsuba"), (ProcedureId::DirectIlluminance, "radiance")]
    {
        assert!(case.recording(&ReadingKey::new("c", procedure, engine)).is_none());
    }
}

/// A ratio with an agreement of this verdict.
fn ratio_of(verdict: Option<Verdict>) -> Ratio {
    let agreement = verdict.map(|verdict| FigureAgreement {
        reference: Estimate::exact(1.0),
        deviation: 0.0,
        expanded: 0.0,
        allowed: 0.0,
        verdict,
        p_value: 1.0,
    });
    Ratio { ratio: None, agreement, errors_cancel: false }
}

fn meter_ratio(k: usize, verdict: Option<Verdict>) -> MeterRatio {
    MeterRatio { meter: MeterId::new("grid", k), of: ratio_of(verdict) }
}

#[test]
fn agreements_of_a_set_are_those_of_its_mean_and_of_its_meters() {
    let mut ratios = Ratios {
        before: "a".to_owned(),
        after: "b".to_owned(),
        procedure: ProcedureId::IndirectIlluminance,
        engine: "radiance".into(),
        set: "grid".to_owned(),
        basis: None,
        mean: ratio_of(Some(Verdict::Pass)),
        meters: vec![
            meter_ratio(0, Some(Verdict::Fail)),
            meter_ratio(1, None),
            meter_ratio(2, Some(Verdict::Undecided)),
        ],
    };
    let verdicts = agreements_mut(&mut ratios).map(|a| a.verdict).collect_vec();
    assert_eq!(verdicts, [Verdict::Pass, Verdict::Fail, Verdict::Undecided]);
}
