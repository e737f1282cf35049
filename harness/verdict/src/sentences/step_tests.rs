//! The steps of a sentence, each by examples that were worked out by hand.

use serde_json::json;

use super::*;
use luxproof_model::{ErrorBudget, MeterId, Quantity, ReadingKey, Recording, Scope, Skip, Tolerance, Uncertainty};

const DIRECT: ProcedureId = ProcedureId::DirectIlluminance;

/// A comparison of Radiance with 100 lx that deviates so far, relative.
fn comparison(case: &str, k: usize, deviation: f64, verdict: Verdict) -> Comparison {
    Comparison {
        key: ReadingKey::new(case, DIRECT, EngineName::new("radiance")),
        model: "point".into(),
        meter: MeterId::new("desk", k),
        at_m: [0.0; 3],
        normal: [0.0, 0.0, 1.0],
        gamma_deg: None,
        c_deg: None,
        quantity: Quantity::Illuminance,
        value: Some(100.0 * (1.0 + deviation)),
        uncertainty: Uncertainty::Exact,
        reference: serde_json::from_value(
            json!({"value": 100.0, "uncertainty": 0.0, "basis": "simulator", "source": ""}),
        )
        .unwrap(),
        deviation: Some(100.0 * deviation),
        relative_deviation: Some(deviation),
        tolerance: Tolerance { relative: 0.01, absolute: 0.0 },
        tolerance_source: None,
        verdict,
        diagnosis: None,
        budget: None,
        p_value: None,
    }
}

/// A deviation of a rating.
fn rating(deviation: Option<f64>) -> Comparison {
    let plain = comparison("a", 0, 0.0, Verdict::Fail);
    Comparison { quantity: Quantity::GlareRating, deviation, relative_deviation: None, ..plain }
}

fn are_close(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-9 * b.abs()
}

fn bias(case: &str, mean: f64, p_value: Option<f64>) -> Bias {
    Bias {
        key: ReadingKey::new(case, DIRECT, EngineName::new("radiance")),
        basis: Basis::Simulator,
        readings: 2,
        mean,
        low: mean - 0.001,
        high: mean + 0.001,
        p_value,
        fails: false,
        scatter: None,
    }
}

#[test]
fn a_bias_is_significant_below_one_in_a_thousand_and_on_one_side_of_zero() {
    for (mean, p_value, is_one) in [
        (0.01, Some(9e-4), true),
        (-0.01, Some(9e-4), true),
        (0.01, Some(1e-3), false),
        (0.0005, Some(1e-6), false),
        (0.01, None, false),
    ] {
        assert_eq!(is_significant(&bias("a", mean, p_value)), is_one, "{mean} {p_value:?}");
    }
}

#[test]
fn the_largest_bias_is_that_of_an_engines_cases_that_pass() {
    const P: Option<f64> = Some(1e-6);
    let all = [
        comparison("a", 0, 0.01, Verdict::Pass),
        comparison("b", 0, 0.01, Verdict::Pass),
        comparison("c", 0, 0.01, Verdict::Pass),
        comparison("c", 1, 0.01, Verdict::Undecided),
    ];
    let best = all.iter().collect_vec();
    let largest = |bias: Vec<Bias>| {
        let report = Report { bias, ..Report::default() };
        largest_bias(&report, &EngineName::new("radiance"), DIRECT, &best)
    };
    assert_eq!(largest(vec![bias("a", 0.004, P), bias("b", -0.006, P), bias("c", 0.009, P)]), Some(-0.006));
    assert_eq!(largest(vec![bias("a", 0.004, Some(0.01))]), None);
    for key in
        [ReadingKey::new("a", DIRECT, "mitsuba"), ReadingKey::new("a", ProcedureId::IndirectIlluminance, "radiance")]
    {
        assert_eq!(largest(vec![Bias { key, ..bias("a", 0.004, P) }]), None);
    }
    assert_eq!(largest(vec![Bias { basis: Basis::Published, ..bias("a", 0.004, P) }]), None);
}

#[test]
fn printed_cells_are_the_best_where_there_is_nothing_else() {
    let simulated = comparison("a", 0, 0.01, Verdict::Pass);
    let mut printed = simulated.clone();
    printed.reference.as_mut().unwrap().basis = Basis::Published;
    let bases = |all: &[&Comparison]| best_comparisons(all).into_iter().map(basis).collect_vec();
    assert_eq!(bases(&[&printed, &simulated]), [Some(Basis::Simulator)]);
    assert_eq!(bases(&[&printed]), [Some(Basis::Published)]);
    assert_eq!(bases(&[]), []);
}

/// A budget of this half width.
fn budget(expanded: f64) -> ErrorBudget {
    let (components, counted) = (vec![], vec![]);
    ErrorBudget { components, combined: 0.0, degrees_of_freedom: None, coverage_factor: 2.0, expanded, counted }
}

fn tolerance(relative: f64, absolute: f64) -> Tolerance {
    Tolerance { relative, absolute }
}

#[test]
fn a_reach_is_a_deviation_with_its_interval_relative_to_the_reference_or_the_least_light() {
    let plain = comparison("a", 0, -0.03, Verdict::Pass);
    for (expanded, tolerance, expected) in [
        (None, tolerance(0.01, 0.0), 0.03),
        (Some(2.0), tolerance(0.01, 0.0), 0.05),
        // An absolute tolerance of 5 lx equals 1 % at 500 lx, and that of .5 lx at 50 lx.
        (Some(2.0), tolerance(0.01, 5.0), 0.01),
        (Some(2.0), tolerance(0.01, 0.5), 0.05),
        (Some(2.0), tolerance(0.0, 5.0), 0.05),
    ] {
        let found = Comparison { budget: expanded.map(budget), tolerance, ..plain.clone() };
        assert!(are_close(reach(&found).unwrap(), expected), "{expanded:?} {tolerance:?} {:?}", reach(&found));
    }
    let of_rating = Comparison { budget: Some(budget(2.0)), ..rating(Some(-1.5)) };
    assert_eq!(reach(&of_rating), Some(3.5));
    let mut dark = Comparison { tolerance: tolerance(0.01, 0.0), ..plain.clone() };
    dark.reference.as_mut().unwrap().value = 0.0;
    assert_eq!(reach(&dark), None);
    assert_eq!(reach(&Comparison { deviation: None, ..plain.clone() }), None);
    assert_eq!(reach(&Comparison { reference: None, ..plain }), None);
}

#[test]
fn a_claim_counts_each_verdict_and_reaches_as_far_as_what_passes() {
    use Verdict::{Fail, KnownDeviation, Missing, NotJudged, Pass, Undecided};
    let mut all = vec![];
    for (verdict, count) in [(Pass, 1), (Fail, 2), (Undecided, 3), (KnownDeviation, 4), (NotJudged, 5), (Missing, 6)] {
        all.extend((0..count).map(|k| comparison("a", k, 0.02, verdict)));
    }
    all.push(comparison("a", 9, -0.005, Pass));
    let engine = EngineName::new("radiance");
    let found = claim(&Report::default(), &engine, DIRECT, &all.iter().collect_vec());
    assert_eq!((found.readings, found.failed, found.undecided), (22, 2, 3));
    assert_eq!((found.known_deviations, found.missing, found.bias), (9, 6, None));
    assert!(are_close(found.within.unwrap(), 0.02));
    let found = claim(&Report::default(), &engine, DIRECT, &[&comparison("a", 0, 0.02, Fail)]);
    assert_eq!((found.within, found.failed), (None, 1));
}

#[test]
fn ratings_deviate_low_high_or_both_in_their_own_unit() {
    for (deviations, text) in [
        (&[-1.25, -0.5][..], "reads 0.50 to 1.25 UGR low"),
        (&[0.5, 1.25], "reads 0.50 to 1.25 UGR high"),
        (&[0.0, 1.25], "reads 0.00 to 1.25 UGR high"),
        (&[-1.25, 0.5], "reads 1.25 low to 0.50 UGR high"),
        (&[1.251, 1.252], "reads 1.25 UGR high"),
    ] {
        let all = deviations.iter().map(|d| rating(Some(*d))).collect_vec();
        assert_eq!(describe_deviations(&all.iter().collect_vec()), text);
    }
    assert_eq!(describe_deviations(&[&rating(None)]), "is wrong");
}

#[test]
fn what_fails_is_described_by_the_range_of_all_failing_readings() {
    let all = [-0.02, 0.05, 0.01].map(|d| comparison("a", 0, d, Verdict::Fail));
    assert_eq!(describe_deviations(&all.iter().collect_vec()), "reads 2 % low to 5 % high");
}

/// A report of these cases, of which some have bodies.
fn report_of(cases: &[(&str, bool)]) -> Report {
    let spec = json!({"path": "", "sha256": "", "title": ""});
    let mut all = vec![];
    for (name, has_bodies) in cases {
        let case = json!({"name": name, "spec": spec, "has_bodies": has_bodies});
        all.push(serde_json::from_value(case).unwrap());
    }
    Report { cases: all, ..Report::default() }
}

/// A comparison of a luminaire model.
fn of(case: &str, k: usize, model: &str, verdict: Verdict) -> Comparison {
    Comparison { model: model.to_owned(), ..comparison(case, k, 0.02, verdict) }
}

#[test]
fn a_place_is_what_failing_readings_have_and_passing_ones_lack() {
    let [fail, pass] = [Verdict::Fail, Verdict::Pass];
    let report = report_of(&[("bare", false), ("desk", true), ("hall", true)]);
    for (failing, passing, place) in [
        (vec![of("desk", 0, "area", fail), of("desk", 1, "area", fail)], vec![], " in desk"),
        (
            vec![of("desk", 0, "area", fail), of("hall", 1, "area", fail)],
            vec![of("bare", 0, "area", pass)],
            " in rooms with bodies",
        ),
        // One fails without bodies, or one passes with them.
        (
            vec![of("desk", 0, "area", fail), of("bare", 1, "area", fail)],
            vec![of("bare", 0, "area", pass)],
            " in 2 cases",
        ),
        (vec![of("desk", 0, "area", fail), of("desk", 1, "area", fail)], vec![of("hall", 0, "area", pass)], " in desk"),
        (
            vec![of("bare", 0, "area", fail), of("bare", 1, "area", fail)],
            vec![of("bare", 2, "point", pass)],
            " with area luminaires",
        ),
        // Two models fail, or the same passes.
        (
            vec![of("bare", 0, "area", fail), of("bare", 1, "impostor", fail)],
            vec![of("bare", 2, "point", pass)],
            " in bare",
        ),
        (vec![of("bare", 0, "area", fail)], vec![of("bare", 2, "area", pass)], " in bare, at desk[0]"),
    ] {
        let all = failing.iter().chain(&passing).collect_vec();
        let found = describe_place(&report, &failing.iter().collect_vec(), &all);
        assert_eq!(found, place);
    }
}

#[test]
fn what_is_unsound_is_described_with_its_counts() {
    use Verdict::{Fail, Missing, Pass, Undecided};
    let report = report_of(&[("a", false)]);
    let text = |verdicts: &[Verdict]| {
        let all = verdicts.iter().enumerate().map(|(k, verdict)| comparison("a", k, 0.02, *verdict)).collect_vec();
        let all = all.iter().collect_vec();
        let claim = claim(&report, &EngineName::new("radiance"), DIRECT, &all);
        describe_unsound(&claim, &report, &all)
    };
    for (verdicts, expected) in [
        (&[Fail, Fail][..], "direct: reads 2 % high at all of 2 readings"),
        (
            &[Fail, Fail, Undecided, Pass],
            "direct: reads 2 % high at 2 of 4 readings, undecided at 1 of 4 readings, the rest within 2 %",
        ),
        (&[Undecided, Missing, Missing], "direct: undecided at 1 of 3 readings, not read at 2 of 3 readings"),
    ] {
        assert_eq!(text(verdicts), expected);
    }
}

const FURNACE: ProcedureId = ProcedureId::Furnace;

/// A skip of an engine in a procedure.
fn skip(engine: &str, procedure: ProcedureId, scope: Scope) -> Skip {
    Skip::new(ReadingKey::new("c", procedure, engine), scope, "unsupported")
}

/// A recording of an engine without readings.
fn recording(engine: &str, procedure: ProcedureId) -> Recording {
    let light = luxproof_model::Light(luxproof_scene::Transport::Direct);
    Recording::of(ReadingKey::new("c", procedure, engine), light)
}

#[test]
fn a_users_program_declines_the_calibration_where_it_skips_it_and_reads_none_of_it() {
    for (engine, skipped, read, declines) in [
        ("mine", skip("mine", FURNACE, Scope::Procedure), None, true),
        ("mine", skip("mine", FURNACE, Scope::Meter), None, Scope::Meter.leaves_no_reading()),
        ("mine", skip("mine", DIRECT, Scope::Procedure), None, false),
        ("mine", skip("theirs", FURNACE, Scope::Procedure), None, false),
        ("radiance", skip("radiance", FURNACE, Scope::Procedure), None, false),
        ("mine", skip("mine", FURNACE, Scope::Procedure), Some(("mine", FURNACE)), false),
        ("mine", skip("mine", FURNACE, Scope::Procedure), Some(("mine", DIRECT)), true),
        ("mine", skip("mine", FURNACE, Scope::Procedure), Some(("theirs", FURNACE)), true),
    ] {
        let what = format!("{engine} {skipped:?} {read:?}");
        let recordings = read.map(|(engine, procedure)| recording(engine, procedure)).into_iter().collect();
        let report = Report { skips: vec![skipped], recordings, ..Report::default() };
        assert_eq!(declines_calibration(&report, &EngineName::from(engine)), declines, "{what}");
    }
}
