//! The steps of statistics and their agreement, each by examples that were worked out by hand.

use super::*;
use crate::fixtures::{built_in, recording, task};
use luxproof_model::{ErrorBudget, Reading};

fn sampled(value: f64, error: f64) -> Estimate {
    Estimate { value, uncertainty: Uncertainty::sampled(error, None) }
}

fn are_close(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-9 * b.abs()
}

/// The comparisons of Radiance with an exact simulator.
fn comparisons(exact: &[f64], read: &[Estimate]) -> Vec<Comparison> {
    let exact = exact.iter().map(|value| Estimate::exact(*value)).collect_vec();
    let (exact, subject) = (recording("simulator", &exact), recording("radiance", read));
    built_in().compare_one(&task(read.len()), &subject, &[&exact, &subject])
}

#[test]
fn illuminance_and_luminance_are_light_but_what_is_seen_in_an_opening_is_elsewhere() {
    let all = [Quantity::Illuminance, Quantity::Luminance, Quantity::LuminousIntensity, Quantity::GlareRating];
    assert_eq!(all.map(is_light), [true, true, false, false]);
    for (procedure, quantity, is_at_meter) in [
        (ProcedureId::DirectIlluminance, Quantity::Illuminance, true),
        (ProcedureId::OpeningLuminance, Quantity::Luminance, false),
        (ProcedureId::DirectIlluminance, Quantity::GlareRating, false),
    ] {
        assert_eq!(is_light_at_meter(procedure, quantity), is_at_meter, "{procedure} {quantity:?}");
    }
}

#[test]
fn noise_that_is_not_known_to_be_independent_is_common() {
    let known = Recording { correlations: [("grid".to_owned(), 0.3)].into(), ..recording("radiance", &[]) };
    assert_eq!(correlation(Some(&known), "grid"), 0.3);
    assert_eq!((correlation(Some(&known), "desk"), correlation(None, "grid")), (1.0, 1.0));
}

#[test]
fn figures_are_of_two_finite_values_at_least() {
    const TAIL: f64 = 0.02;
    let figures = |values: &[Estimate], correlation| Figures::from_estimates(values, correlation, TAIL);
    let two = [sampled(100.0, 3.0), sampled(300.0, 4.0)];
    // The errors of a half of each: 3.5 where they are common, 2.5 where they are independent.
    for (correlation, error) in [(1.0, 3.5), (0.0, 2.5)] {
        let found = figures(&two, correlation).unwrap();
        assert!(found.mean.value == 200.0 && are_close(found.mean.uncertainty.standard(), error), "{found:?}");
        assert_eq!((found.minimum.value, found.maximum.value), (100.0, 300.0));
    }
    assert_eq!(figures(&two[..1], 1.0), None);
    assert_eq!(figures(&[], 1.0), None);
    for one in [sampled(f64::INFINITY, 1.0), sampled(100.0, f64::INFINITY), sampled(f64::NAN, 1.0)] {
        assert_eq!(figures(&[two[0], one], 1.0), None, "{one:?}");
        assert!(!is_finite(&one));
    }
    // Without light there is no uniformity.
    let dark = figures(&[Estimate::DARK; 2], 1.0).unwrap();
    assert_eq!((dark.uniformity, dark.diversity), (None, None));
}

fn component(source: Source, shape: Shape, uncertainty: f64, degrees_of_freedom: Option<f64>) -> Component {
    Component { source, uncertainty, shape, degrees_of_freedom }
}

#[test]
fn the_error_of_a_reference_is_all_that_is_not_the_readings() {
    let mut compared = comparisons(&[100.0], &[sampled(100.0, 1.0)]).remove(0);
    let mut estimate = |components: Vec<Component>| {
        let budget = ErrorBudget { components, ..compared.budget.clone().unwrap() };
        compared.budget = Some(budget);
        reference_estimate(&compared).unwrap()
    };
    let of_reading = [
        component(Source::MonteCarlo, Shape::Normal, 7.0, Some(2.0)),
        component(Source::Discretisation, Shape::Rectangular, 8.0, None),
    ];
    let bounds = [
        component(Source::Rounding, Shape::Rectangular, 0.1, None),
        component(Source::Input, Shape::Rectangular, 0.2, None),
    ];
    let chance = [
        component(Source::Reference, Shape::Normal, 3.0, Some(9.0)),
        component(Source::Reference, Shape::Normal, 4.0, Some(5.0)),
        component(Source::Reference, Shape::Normal, 0.0, None),
    ];
    // A bound is the root of three times its standard uncertainty. Bounds add up, chance in quadrature.
    let found = estimate([&of_reading[..], &bounds, &chance].concat());
    assert_eq!((found.value, found.uncertainty.standard_error()), (100.0, Some(5.0)));
    assert_eq!(found.uncertainty.degrees_of_freedom(), Some(5.0));
    assert!(are_close(found.uncertainty.bound(), 0.3 * 3f64.sqrt()));
    let found = estimate([&of_reading[..], &bounds].concat());
    assert_eq!(found.uncertainty.standard_error(), None);
    assert!(are_close(found.uncertainty.bound(), 0.3 * 3f64.sqrt()));
    compared.reference = None;
    assert_eq!(reference_estimate(&compared), None);
}

#[test]
fn one_meter_that_cannot_fail_limits_the_verdicts_of_its_set() {
    let mut all = comparisons(&[100.0; 2], &[sampled(100.0, 1.0), sampled(100.0, 1.0)]);
    let plain = recording("radiance", &[]);
    let skewed = Recording { skewness: Some(9.0), ..plain.clone() };
    let limit = |recording, all: &[Comparison]| verdict_limit(recording, &all.iter().collect_vec());
    assert_eq!((limit(&plain, &all), limit(&skewed, &all)), (VerdictLimit::None, VerdictLimit::NoFailure));
    all[1].p_value = None;
    assert_eq!(limit(&plain, &all), VerdictLimit::NoFailure);
    all[0].uncertainty = Uncertainty::NotSeen;
    assert_eq!(limit(&plain, &all), VerdictLimit::Open);
    assert!(VerdictLimit::None < VerdictLimit::NoFailure && VerdictLimit::NoFailure < VerdictLimit::Open);
}

#[test]
fn a_figure_is_assessed_with_the_errors_of_both_sides_and_what_they_may_spend() {
    const TOLERANCE: Tolerance = Tolerance { relative: 0.02, absolute: 0.5 };
    let test = EquivalenceTest { tail: upper_tail_of_normal(2.0), share: 1.0, limit: VerdictLimit::None };
    // Errors of 3 and 4 combine to 5, of which the interval has two. Allowed are 20.
    for (read, limit, verdict) in [
        (1009.9, VerdictLimit::None, Verdict::Pass),
        (1010.1, VerdictLimit::None, Verdict::Undecided),
        (970.1, VerdictLimit::None, Verdict::Undecided),
        (969.9, VerdictLimit::None, Verdict::Fail),
        (969.9, VerdictLimit::NoFailure, Verdict::Undecided),
        (1009.9, VerdictLimit::NoFailure, Verdict::Pass),
        (1009.9, VerdictLimit::Open, Verdict::Undecided),
    ] {
        let test = EquivalenceTest { limit, ..test };
        let found = test.assess(&sampled(read, 3.0), &sampled(1000.0, 4.0), TOLERANCE).unwrap();
        assert!(are_close(found.deviation, read - 1000.0) && are_close(found.expanded, 10.0), "{found:?}");
        assert_eq!((found.allowed, found.verdict), (20.0, verdict), "{read} {limit:?}");
    }
    // Beyond two standard deviations at the edge lie 2.275 %.
    let found = test.assess(&sampled(970.0, 3.0), &sampled(1000.0, 4.0), TOLERANCE).unwrap();
    assert!((found.p_value - 0.022_750_13).abs() < 1e-7, "{found:?}");
    // A stage may spend a quarter of the error of chance in the reading: 5.6875e-3 lie beyond 2.53096 standard deviations.
    let staged = EquivalenceTest { share: 0.25, ..test };
    let found = staged.assess(&sampled(970.0, 3.0), &Estimate::exact(1000.0), TOLERANCE).unwrap();
    assert!((found.expanded - 3.0 * 2.530_96).abs() < 1e-4, "{found:?}");
    let found = staged.assess(&Estimate::exact(970.0), &sampled(1000.0, 3.0), TOLERANCE).unwrap();
    assert!(are_close(found.expanded, 6.0), "{found:?}");
    for read in [f64::NAN, f64::INFINITY] {
        assert_eq!(test.assess(&sampled(read, 3.0), &sampled(1000.0, 4.0), TOLERANCE), None);
    }
    // The absolute tolerance of a quotient is relative to its whole: .5 of 10.
    let quotient = |read, reference| test.assess_quotient(read, reference, TOLERANCE, 10.0);
    let found = quotient(Some(Estimate::exact(0.6)), Some(Estimate::exact(0.7))).unwrap();
    assert!(are_close(found.allowed, 0.05) && are_close(found.deviation, -0.1), "{found:?}");
    assert_eq!(quotient(None, Some(Estimate::exact(0.7))), None);
    assert_eq!(quotient(Some(Estimate::exact(0.6)), None), None);
}

#[test]
fn a_set_has_a_basis_where_each_meter_has_one_sound_reference_of_it() {
    let all = comparisons(&[100.0; 2], &[sampled(100.0, 1.0); 2]);
    let basis = |edit: fn(&mut Vec<Comparison>)| {
        let mut edited = all.clone();
        edit(&mut edited);
        built_in().common_basis(&edited.iter().collect_vec())
    };
    assert_eq!(basis(|_| ()), Some(Basis::Simulator));
    assert_eq!(basis(Vec::clear), None);
    for edit in [
        (|all| all[1].reference = None) as fn(&mut Vec<Comparison>),
        |all| all[1].reference.as_mut().unwrap().basis = Basis::Published,
        |all| all[1].reference.as_mut().unwrap().caveat = Some("a misprint".to_owned()),
        |all| all[1].verdict = Verdict::Missing,
        |all| all[1].deviation = None,
        |all| all[1].meter = all[0].meter.clone(),
        |all| all[0].key.engine = "iesna".into(),
    ] {
        assert_eq!(basis(edit), None);
    }
}

/// A figure that does not agree, as probable as this.
fn figure(verdict: Verdict, p_value: f64) -> FigureAgreement {
    let reference = Estimate::exact(1.0);
    FigureAgreement { reference, deviation: 1.0, expanded: 0.1, allowed: 0.1, verdict, p_value }
}

#[test]
fn figures_are_decided_as_one_family() {
    // By Holm's method at .001: of two, the smallest may be .0005 and the next .001.
    for (p_values, verdicts) in [
        ([4e-4, 9e-4], [Verdict::Fail, Verdict::Fail]),
        ([4e-4, 1.1e-3], [Verdict::Fail, Verdict::Undecided]),
        ([6e-4, 9e-4], [Verdict::Undecided, Verdict::Undecided]),
    ] {
        let mut figures = p_values.map(|p_value| figure(Verdict::Fail, p_value));
        built_in().decide_together(figures.iter_mut());
        assert_eq!(figures.map(|f| f.verdict), verdicts, "{p_values:?}");
    }
    let mut passing = [figure(Verdict::Pass, 0.9)];
    built_in().decide_together(passing.iter_mut());
    assert_eq!(passing[0].verdict, Verdict::Pass);
}

/// A reading of a set of meters.
fn reading(set: &str, k: usize, value: f64) -> Reading {
    Reading::new(luxproof_model::MeterId::new(set, k), Quantity::Illuminance, Estimate::exact(value))
}

#[test]
fn each_set_of_a_recording_has_its_own_figures_and_the_calibration_has_none() {
    let mut subject = recording("radiance", &[]);
    subject.readings = vec![
        reading("desk", 0, 100.0),
        reading("desk", 1, 300.0),
        reading("desk", 2, f64::NAN),
        reading("wall", 0, 10.0),
        reading("floor", 0, 20.0),
        reading("floor", 1, 40.0),
    ];
    let found = built_in().statistics(&[], &[subject.clone()]);
    let figures = found.iter().map(|s| (s.set.as_str(), s.meters, s.mean.value)).collect_vec();
    assert_eq!(figures, [("desk", 2, 200.0), ("floor", 2, 30.0)]);
    subject.key.procedure = ProcedureId::Furnace;
    assert_eq!(built_in().statistics(&[], &[subject]), []);
}

#[test]
fn figures_of_a_set_spend_the_share_of_a_sampled_meter() {
    // The mean of a sampled and of an exact meter has half of the error. Of four stages each may spend a quarter of 2.275 % on
    // either side, which a normal distribution has beyond 2.5310 standard deviations; one stage may spend it all, beyond 2.
    let exact = recording("simulator", &[Estimate::exact(100.0); 2]);
    for (stages, standard_errors) in [(vec![1, 1], 2.530_960_494), (vec![], 2.0)] {
        let read = [sampled(100.0, 1.0), Estimate::exact(100.0)];
        let subject = Recording { stages, ..recording("radiance", &read) };
        let comparisons = built_in().compare(&task(2), &[&exact, &subject]);
        let found = built_in().statistics(&comparisons, &[subject]);
        let mean = &found[0].agreement.as_ref().unwrap().mean;
        assert!((mean.expanded - 0.5 * standard_errors).abs() < 1e-6, "{mean:?}");
    }
}
