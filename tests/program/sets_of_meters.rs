//! What sets of meters come to, engine by engine, held against the reference: mean, minimum, uniformity and diversity of a small office.

use serde_json::Value;

use crate::support::{Folder, LAMP, ROOM, among};

const GRID: &str = "meters:
  desk: {surface: {of: floor, distance_m: 0.75, margin_m: 0.5, counts: [4, 3]}}
procedures:
  total_illuminance: {meters: desk, bounces: converged}
budget: {relative_error: 0.002, seconds: 30}
";

fn number(of: &Value) -> f64 {
    of.as_f64().unwrap_or_else(|| panic!("no number: {of}"))
}

#[test]
fn mean_and_uniformity_of_a_room_agree_over_engines_within_their_uncertainty() {
    let folder = Folder::for_renderers(&[("spec.yaml", &format!("{ROOM}{GRID}")), ("lamp.ies", LAMP)]);
    // As accurate as the spec asks, whatever decides: a minimum is as uncertain as the meters that may be the lowest.
    let answer = folder.run(&["--engines", "simulator,radiance", "--sampling", "accurate"]).exits(0);
    answer.prints("  uniformity");
    folder.luxproof(&["report", "out", "--all"]).exits(0).prints("radiance against simulator: mean ");
    let report = folder.report();
    let of = |engine: &str| {
        let found = among(&report, "statistics", &[("engine", engine), ("set", "desk")]);
        assert_eq!(found.len(), 1, "{engine}");
        found[0].clone()
    };
    let (exact, radiance) = (of("simulator"), of("radiance"));
    assert!(exact["agreement"].is_null(), "a reference is not held against itself: {exact}");
    assert_eq!(radiance["agreement"]["basis"], "simulator");
    for figure in ["mean", "minimum", "uniformity", "diversity"] {
        let (of, agreement) = (number(&radiance[figure]["value"]), &radiance["agreement"][figure]);
        let (deviation, expanded) = (number(&agreement["deviation"]), number(&agreement["expanded"]));
        assert!((of - number(&exact[figure]["value"]) - deviation).abs() < 1e-12 * of, "{figure}: {agreement}");
        assert!(expanded > 0.0 && deviation.abs() <= expanded, "{figure}: {agreement}");
        assert!(expanded < 0.03 * of && agreement["verdict"] != "fail", "{figure}: {agreement}");
    }
    assert_eq!(radiance["agreement"]["mean"]["verdict"], "pass");
    // They count in nothing.
    let verdicts = ["pass", "not_judged", "known_deviation", "undecided", "fail", "unexpected_pass", "missing"];
    let counted: f64 = verdicts.iter().map(|verdict| number(&report["summary"][verdict])).sum();
    assert_eq!(counted as usize, report["comparisons"].as_array().unwrap().len());
    for (format, shows) in
        [("markdown", "desk (12 meters), radiance against simulator: mean"), ("html", "Sets of meters")]
    {
        folder.luxproof(&["report", "out/report.json", "--format", format]).exits(0).prints(shows);
    }
}
