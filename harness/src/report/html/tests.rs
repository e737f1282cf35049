//! What must hold of the page whatever the report says: it is whole, small, the same every time, and no text becomes markup.

use serde_json::{Value, json};

use super::*;
use crate::record::ProcedureId;

const ENGINES: [&str; 5] = ["simulator", "iesna", "mitsuba", "radiance", "povray"];

/// One reading on a grid of 16 by 12 meters.
fn comparison(procedure: ProcedureId, engine: &str, case: &str, k: usize) -> Value {
    let (x, y) = (0.5 + (k % 16) as f64, 0.5 + (k / 16) as f64);
    let value = 300.0 + 7.3 * x - 3.1 * (y - 6.0).powi(2);
    let deviation = value * 0.0123456789 * (k as f64).sin();
    json!({
        "case": case, "procedure": procedure, "engine": engine, "model": "point", "meter": format!("workplane[{k}]"),
        "at_m": [x, y, 0.8], "normal": [0, 0, 1], "gamma_deg": null, "c_deg": null, "quantity": "illuminance_lx",
        "value": value + deviation, "std_error": 0.1234567,
        "reference": {"value": value, "uncertainty": 0.001, "basis": "exact", "source": "luminaire::simulator: hp collocation"},
        "deviation": deviation, "relative_deviation": deviation / value, "tolerance": {"relative": 0.02, "absolute": 0.01},
        "verdict": "pass", "diagnosis": null,
        "budget": {"components": [
            {"source": "monte_carlo", "uncertainty": 0.1234567, "shape": "normal"},
            {"source": "instrument", "uncertainty": 0.0456789, "shape": "normal"},
            {"source": "reference", "uncertainty": 0.00123456, "shape": "normal"}],
            "combined": 0.1317, "degrees_of_freedom": null, "coverage_factor": 2.0, "expanded": 0.2634},
        "p_value": 0.000123
    })
}

fn report(procedures: &[ProcedureId], case: &str, title: &str) -> Report {
    let mut comparisons = vec![];
    for procedure in procedures {
        for engine in ENGINES {
            comparisons.extend((0..192).map(|k| comparison(*procedure, engine, case, k)));
        }
    }
    let spec = json!({"path": "specs/room.yaml", "sha256": "ab", "title": title});
    let engine = |id| json!({"id": id, "version": "1.0", "status": "ran", "reason": null, "wall_s": 1.5});
    serde_json::from_value(json!({
        "luxproof": 1, "tool_version": "0.1.0", "started": "2026-01-01T00:00:00Z", "wall_s": 12.0, "spec": spec,
        "engines": ENGINES.map(engine), "comparisons": comparisons, "readings": [], "skips": [],
        "recordings": procedures.iter().flat_map(|p| ENGINES.map(|e| json!({
            "case": case, "procedure": p, "engine": e, "light": "direct", "version": "1.0", "input_sha256": "ab", "seed": 1, "settings": {},
            "approximation": null, "notes": [], "failure": null, "wall_s": 1.5}))).collect::<Vec<_>>(),
        "cases": [{"name": case, "spec": spec}],
        "summary": {"pass": 0, "fail": 0, "inconclusive": 0, "known_deviation": 0, "unexpected_pass": 0, "missing": 0, "skipped": 0}
    }))
    .unwrap()
}

/// Of so many comparisons.
pub(crate) fn long(comparisons: usize) -> Report {
    let mut report = report(&[ProcedureId::DirectIlluminance, ProcedureId::IndirectIlluminance], "room", "a room");
    report.comparisons = report.comparisons.into_iter().cycle().take(comparisons).collect();
    report
}

#[test]
fn two_procedures_of_192_meters_and_five_engines_stay_below_three_megabytes() {
    let page =
        page(&report(&[ProcedureId::DirectIlluminance, ProcedureId::IndirectIlluminance], "room", "a room"), &[]);
    assert!(page.len() < 3_000_000, "{} bytes", page.len());
    assert_eq!(page.matches("<tr data-row=").count(), 2 * 5 * 192, "every reading has its row");
}

#[test]
fn a_grid_is_drawn_as_isolux_lines_and_one_map_an_engine() {
    let page = page(&report(&[ProcedureId::IndirectIlluminance], "room", "a room"), &[]);
    assert!(page.contains("class=\"isolux\""));
    for engine in ENGINES {
        assert!(page.contains(&format!("workplane, {engine}")), "no map of {engine}");
    }
}

#[test]
fn no_text_becomes_markup() {
    let evil = "</script><script>alert(1)</script><img src=x onerror=alert(2)>\"'";
    let page = page(&report(&[ProcedureId::DirectIlluminance], evil, evil), &[]);
    assert!(!page.contains("<img"), "markup from a title");
    assert_eq!(page.matches("</script>").count(), 2, "only the page's own two scripts end");
}

#[test]
fn the_page_names_no_other_place_and_is_the_same_every_time() {
    let report = report(&[ProcedureId::DirectIlluminance], "room", "a room");
    let page = page(&report, &[]);
    assert_eq!(page, super::page(&report, &[]));
    let own = page.replace("http://www.w3.org/2000/svg", "");
    assert!(!own.contains("http:") && !own.contains("https:"), "a page that loads nothing names no address");
}

#[test]
fn a_report_of_nothing_is_still_a_page() {
    let mut empty = report(&[], "room", "nothing");
    empty.engines.clear();
    assert!(page(&empty, &[]).contains("Nothing was skipped"));
}

#[test]
fn stress_and_bench_show_beside_the_report_and_anything_else_is_refused() {
    let stress = r#"{"laws": [{"engine": "mitsuba", "law": "scale", "worst_deviation": 0.02, "breaks_at": {"0.001": 1e5, "0.1": null}, "how": "drift"},
        {"engine": "povray", "law": "scale", "worst_deviation": 1.0, "breaks_at": {"0.1": 1e6}, "how": "silent_loss", "known": ["32-bit floats"]},
        {"engine": "radiance", "law": "scale", "refused_at": 1e4}]}"#;
    let bench = r#"{"curves": [{"engine": "radiance", "procedure": "direct_illuminance", "solver": null, "preset": "fast",
        "points": [{"effort": 1, "wall_s": 0.1, "relative_error": 0.01}, {"effort": 2, "wall_s": 1.0, "relative_error": 0.003}], "time_to": {}}]}"#;
    let beside: Vec<Beside> = [stress, bench].map(|text| Beside::from_json(text).unwrap()).into();
    let page = page(&report(&[ProcedureId::DirectIlluminance], "room", "a room"), &beside);
    assert!(page.contains("id=\"stress\"") && page.contains("0.1 % at 1e5"));
    assert!(page.contains("<dd>32-bit floats</dd>") && page.contains(">refuses<"), "known and refused are told");
    assert!(page.contains("the ladder of luxproof bench"));
    assert!(matches!(Beside::from_json("{}"), Err(BesideError::Unknown)));
}

#[test]
fn minus_signs_stand_before_numbers_only() {
    assert_eq!(minus("IP-ED differs by -3.0 %, +-0.2 %"), "IP-ED differs by −3.0 %, ± 0.2 %");
    assert_eq!(percent(-7e-7), "−7·10⁻⁵ %");
}
