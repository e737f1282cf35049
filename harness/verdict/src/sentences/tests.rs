use super::*;
use serde_json::json;

use luxproof_model::Tolerance;
use luxproof_model::{MeterId, Quantity, ReadingKey, Uncertainty};

fn comparison(
    procedure: ProcedureId,
    case: &str,
    model: &str,
    k: usize,
    deviation: f64,
    verdict: Verdict,
) -> Comparison {
    Comparison {
        key: ReadingKey::new(case, procedure, EngineName::new("radiance")),
        model: model.into(),
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

fn sentence_text(comparisons: Vec<Comparison>, bodies: &[&str], bias: Vec<Bias>) -> String {
    let names: BTreeSet<String> = comparisons.iter().map(|c| c.key.case.clone()).collect();
    let spec = json!({"path": "", "sha256": "", "title": ""});
    let case = |name: String| {
        let has_bodies = bodies.contains(&name.as_str());
        serde_json::from_value(json!({"name": name, "spec": spec, "has_bodies": has_bodies})).unwrap()
    };
    let engine =
        json!({"id": "radiance", "version": "1", "role": "renderer", "status": "ran", "reason": null, "wall_s": 1.0});
    let skips = comparisons.iter().map(|c| luxproof_model::Skip {
        key: c.key.clone(),
        scope: luxproof_model::Scope::Meter,
        reason: String::new(),
        saved: None,
        cause: luxproof_model::SkipCause::Unsupported,
    });
    let skips = skips.collect();
    let cases = names.into_iter().map(case).collect();
    let engines = vec![serde_json::from_value(engine).unwrap()];
    let report = Report { engines, comparisons, skips, bias, cases, ..Report::default() };
    sentences(&report).remove(0).text
}

use ProcedureId::{DirectIlluminance as Direct, IndirectIlluminance as Indirect};
use Verdict::{Fail, KnownDeviation, Pass, Undecided};

#[test]
fn what_passes_is_trusted_within_its_farthest_reading_rounded_up() {
    let all = vec![
        comparison(Direct, "office", "point", 0, 1.01e-4, Pass),
        comparison(Direct, "office", "point", 1, -2e-5, Pass),
        comparison(Indirect, "office", "point", 0, -0.0029, Pass),
    ];
    assert_eq!(sentence_text(all, &[], vec![]), "radiance: direct within 0.011 %, reflected within 0.29 %");
}

#[test]
fn what_fails_is_reported_with_its_size_its_side_and_what_parts_it_from_what_passes() {
    let all = |model| {
        vec![
            comparison(Direct, "bare", "point", 0, 1e-4, Pass),
            comparison(Direct, "desk", model, 0, -0.02, Fail),
            comparison(Direct, "desk", model, 1, -0.031, Fail),
        ]
    };
    let text = sentence_text(all("area"), &["desk"], vec![]);
    assert_eq!(
        text,
        "radiance: direct: reads 2 to 3.1 % low at 2 of 3 readings in rooms with bodies with area luminaires, the rest within 0.01 %"
    );
    let text = sentence_text(all("point"), &[], vec![]);
    assert_eq!(text, "radiance: direct: reads 2 to 3.1 % low at 2 of 3 readings in desk, the rest within 0.01 %");
    // What passes there as well is no reason.
    let mut some = all("area");
    some.push(comparison(Direct, "desk", "area", 2, 0.0, Pass));
    assert!(!sentence_text(some, &["desk"], vec![]).contains("bodies"));
}

#[test]
fn doubt_is_no_trust_and_what_is_on_record_is_reported() {
    let all = vec![
        comparison(Direct, "a", "point", 0, 0.009, Undecided),
        comparison(Direct, "a", "point", 1, 0.001, Pass),
        comparison(Indirect, "a", "point", 0, -0.05, KnownDeviation),
        comparison(Indirect, "a", "point", 1, -0.001, Pass),
    ];
    assert_eq!(
        sentence_text(all, &[], vec![]),
        "radiance: reflected within 0.1 % but for 1 of 2 known to deviate; direct: undecided at 1 of 2 readings, the rest within 0.1 %"
    );
}

#[test]
fn a_bias_that_chance_does_not_make_is_reported_even_where_everything_passes() {
    let all = vec![comparison(Direct, "a", "point", 0, 0.004, Pass), comparison(Direct, "a", "point", 1, 0.0041, Pass)];
    let bias = |p| Bias {
        key: all[0].key.clone(),
        basis: Basis::Simulator,
        readings: 2,
        mean: 0.00406,
        low: 0.004,
        high: 0.0041,
        p_value: Some(p),
        fails: false,
        scatter: None,
    };
    let text = |p| sentence_text(all.clone(), &[], vec![bias(p)]);
    assert_eq!(text(1e-6), "radiance: direct within 0.41 % (0.41 % high on the whole)");
    assert_eq!(text(0.2), "radiance: direct within 0.41 %");
}

#[test]
fn printed_cells_and_what_is_on_record_blur_nothing_that_is_known_better() {
    let mut printed = comparison(Direct, "a", "point", 0, 0.004, Pass);
    printed.reference.as_mut().unwrap().basis = Basis::Published;
    let exact = comparison(Direct, "a", "point", 0, 1e-4, Pass);
    let known = comparison(Direct, "b", "point", 0, -0.05, KnownDeviation);
    let bias = Bias {
        key: known.key.clone(),
        basis: Basis::Simulator,
        readings: 2,
        mean: -0.03,
        low: -0.04,
        high: -0.02,
        p_value: Some(1e-9),
        fails: false,
        scatter: None,
    };
    assert_eq!(sentence_text(vec![printed.clone()], &[], vec![]), "radiance: direct within 0.4 %");
    assert_eq!(
        sentence_text(vec![printed, exact, known], &[], vec![bias]),
        "radiance: direct within 0.01 % but for 1 of 3 known to deviate"
    );
}

#[test]
fn of_a_program_that_failed_its_last_words_are_reported() {
    let trace = "python failed (exit code 1): Traceback:\n  line 89\nRuntimeError: invalid file\nall its messages are in /tmp/log";
    assert_eq!(shorten_reason(trace), "python failed (exit code 1): RuntimeError: invalid file");
    assert_eq!(shorten_reason("rtrace failed (exit code 2): no octree"), "rtrace failed (exit code 2): no octree");
    assert_eq!(shorten_reason("no such setting\nhelp: name one"), "no such setting");
}

#[test]
fn ratings_have_sizes_in_their_own_unit() {
    let mut all = vec![];
    for (k, deviation) in [-3.98, -3.97].into_iter().enumerate() {
        let one = comparison(ProcedureId::UnifiedGlareRating, "a", "point", k, 0.0, Fail);
        all.push(Comparison {
            quantity: Quantity::GlareRating,
            deviation: Some(deviation),
            relative_deviation: None,
            ..one
        });
    }
    let text = sentence_text(all, &[], vec![]);
    assert!(text.contains("reads 3.97 to 3.98 UGR low at all of 2 readings"), "{text}");
}

#[test]
fn a_bias_that_fails_is_reported_where_no_single_reading_does() {
    let all = vec![comparison(Direct, "a", "point", 0, 0.06, Undecided)];
    let bias = Bias {
        key: all[0].key.clone(),
        basis: Basis::Simulator,
        readings: 1,
        mean: 0.059,
        low: 0.049,
        high: 0.07,
        p_value: Some(1e-9),
        fails: true,
        scatter: None,
    };
    let text = sentence_text(all, &[], vec![bias]);
    assert_eq!(text, "radiance: direct: undecided at 1 of 1 reading; direct: fails as a whole, 5.9 % high");
}
