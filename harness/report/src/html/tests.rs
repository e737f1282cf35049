//! The laws of the page for any report: it is complete, small, the same every time, and no text becomes markup.

use std::collections::BTreeMap;
use std::path::Path;

use serde_json::{Value, json};

use super::*;
use crate::{Detail, Letters, Screen, Style};
use luxproof_model::CaseRecord;
use luxproof_model::Comparison;
use luxproof_model::{Estimate, MeterId, ProcedureId, Quantity, Reading, ReadingKey, ReadingRecord};

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
        "reference": {"value": value, "uncertainty": 0.001, "basis": "simulator", "source": "luxproof_simulator: hp collocation"},
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
        "luxproof": 2, "tool_version": "0.1.0", "started": "2026-01-01T00:00:00Z", "wall_s": 12.0, "spec": spec,
        "engines": ENGINES.map(engine), "comparisons": comparisons, "readings": [], "skips": [],
        "recordings": procedures.iter().flat_map(|p| ENGINES.map(|e| json!({
            "case": case, "procedure": p, "engine": e, "light": "direct", "version": "1.0", "input_sha256": "ab", "seed": 1, "settings": {},
            "approximation": null, "notes": [], "failure": null, "wall_s": 1.5}))).collect::<Vec<_>>(),
        "cases": [{"name": case, "spec": spec}],
        "summary": {"pass": 0, "fail": 0, "undecided": 0, "known_deviation": 0, "unexpected_pass": 0, "missing": 0, "skipped": 0}
    }))
    .unwrap()
}

/// A report of so many comparisons.
fn long(comparisons: usize) -> Report {
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
fn glare_ratings_are_drawn_and_told_in_their_unit() {
    let mut report = report(&[ProcedureId::UnifiedGlareRating], "room", "a room");
    for c in &mut report.comparisons {
        c.quantity = Quantity::GlareRating;
        c.relative_deviation = None;
        (c.deviation, c.tolerance) = (Some(0.02), luxproof_model::Tolerance { relative: 0.0, absolute: 0.1 });
    }
    let page = page(&report, &[]);
    assert!(page.contains("deviation from the reference [UGR]") && page.contains("+0.020 UGR"), "{}", page.len());
    let drawing = page.split("deviation from the reference [UGR]").nth(1).and_then(|rest| rest.split("</svg>").next());
    assert!(drawing.is_some_and(|drawing| drawing.contains("class=\"band\"")), "no tolerance band");
}

/// A report in which the time limit cut an engine: one point is undecided, another passes with the largest error.
fn cut_report() -> Report {
    let mut report = report(&[ProcedureId::IndirectIlluminance], "room", "a room");
    let engine = report.engines[2].id.clone();
    report.engines.retain(|status| status.id == engine);
    report.comparisons.retain(|c| c.key.engine == engine);
    report.recordings.retain(|r| r.key.engine == engine);
    for (k, c) in report.comparisons.iter_mut().enumerate() {
        c.relative_deviation = Some(if k == 7 { -0.0177 } else { 0.003 });
        if k == 3 {
            c.verdict = Verdict::Undecided;
            c.diagnosis = Some("undecided by the time limit: the machine was busy".to_owned());
        }
    }
    (report.recordings[0].cut_to, report.recordings[0].work_s) = (Some(0.1), Some(3.0));
    report
}

#[test]
fn every_view_has_the_time_limit_the_next_step_and_one_largest_error() {
    let report = cut_report();
    let screen = Screen::new(Style::Plain, Detail::Brief, Letters::Unicode, Some(200));
    let terminal = crate::terminal(&report, screen, None);
    let first_lines: Vec<&str> = terminal.lines().take(2).collect();
    assert!(first_lines[1].starts_with("time limit: "), "{first_lines:?}");
    for text in [terminal.clone(), crate::markdown(&report, None), page(&report, &[]).replace('\u{2212}', "-")] {
        for part in ["time limit: ", "3 s of work took 2 s", "the machine was busy", "the machine is idle", "-1.8 %"] {
            assert!(text.contains(part), "{part}: {text}");
        }
    }
}

/// An exact reading at a point.
fn reading_at(key: &ReadingKey, meter: MeterId) -> ReadingRecord {
    let reading = Reading::new(meter, Quantity::Illuminance, Estimate::exact(100.0));
    ReadingRecord { key: key.clone(), model: "point".to_owned(), reading }
}

#[test]
fn small_sets_are_listed_beside_large_ones() {
    let mut report = report(&[ProcedureId::IndirectIlluminance], "room", "a room");
    let key = report.comparisons[0].key.clone();
    let places = (0..9).map(|k| MeterId::new("desk", k)).chain((0..2).map(|k| MeterId::new("board", k)));
    report.readings = places.map(|meter| reading_at(&key, meter)).collect();
    for detail in [Detail::Brief, Detail::All] {
        let screen = Screen::new(Style::Plain, detail, Letters::Unicode, Some(200));
        let terminal = crate::terminal(&report, screen, None);
        assert!(terminal.contains("  board[1]") && !terminal.contains("  desk[1]"), "{terminal}");
    }
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

/// Small pages of 1920 comparisons.
const SMALL: Layout = Layout { least: 100, comparisons: 64, rows: 3 };

/// The values of an attribute, such as `href`, in a page.
fn attributes<'a>(html: &'a str, name: &str) -> Vec<&'a str> {
    html.split(&format!(" {name}=\"")).skip(1).map(|rest| rest.split('"').next().unwrap()).collect()
}

/// The pages in a run's folder below `report-pages`, by their names.
fn written_pages(run: &Path) -> BTreeMap<String, String> {
    let folders = std::fs::read_dir(run.join("report-pages")).into_iter().flatten().map(|e| e.unwrap().path());
    let files = folders.flat_map(|folder| std::fs::read_dir(folder).unwrap()).map(|e| e.unwrap().path());
    files
        .map(|path| {
            let name = path.strip_prefix(run).unwrap().display().to_string();
            (name, std::fs::read_to_string(&path).unwrap())
        })
        .collect()
}

#[test]
fn the_pages_of_a_long_report_hold_every_comparison_once_and_every_link_leads_there() {
    let run = tempfile::tempdir().unwrap();
    let mut long = long(1920);
    luxproof_report_file::keep_anew(&mut long, run.path()).unwrap();
    let page = render(&long, &[], Pages::of(&long, SMALL).as_ref());
    page_files::keep_as(&long, &page, run.path(), SMALL).unwrap();
    let files = written_pages(run.path());
    let readings = files.iter().filter(|(name, _)| name.contains("readings"));
    let rows: Vec<&str> = readings.flat_map(|(_, html)| html.split("<tr id=\"r").skip(1)).collect();
    assert_eq!(rows.len(), 1920);
    for (k, (row, c)) in rows.iter().zip(&long.comparisons).enumerate() {
        let expected = [format!("{}\">", k + 1), format!("<td>{}</td><td>{} ", c.key.engine, c.meter)];
        assert!(row.starts_with(&expected[0]) && row.contains(&expected[1]), "{k}: {row}");
    }
    // Every link leads to a file and to a name in it, even after the folder was moved.
    for (from, html) in std::iter::once(("report.html", &page)).chain(files.iter().map(|(name, html)| (&**name, html)))
    {
        for link in attributes(html, "href").into_iter().filter(|link| !link.starts_with('#')) {
            let (file, name) = link.split_once('#').unwrap_or((link, ""));
            let to = run.path().join(from).parent().unwrap().join(file);
            let text = std::fs::read_to_string(&to).unwrap_or_else(|e| panic!("{from} leads to {link}: {e}"));
            assert!(name.is_empty() || text.contains(&format!(" id=\"{name}\"")), "{from} leads to {link}");
        }
    }
    // 30 pages, and two rows of the matrix on one.
    assert_eq!(files.len(), 31);
    let worst: Vec<&str> = attributes(&page, "href").into_iter().filter(|link| link.contains("#r")).collect();
    assert_eq!(worst.len(), 2 * 5 + 2 * 5 * 100, "every cell of the matrix, and the worst of each engine");
}

#[test]
fn rows_that_a_long_report_omits_are_counted() {
    let mut long = long(1920);
    long.cases = (0..7).map(|k| CaseRecord { name: format!("case {k}"), ..long.cases[0].clone() }).collect();
    for (k, c) in long.comparisons.iter_mut().enumerate() {
        c.key.case = format!("case {}", k % 7);
    }
    let failing = &mut long.comparisons[300];
    failing.verdict = Verdict::Fail;
    let place = failing.key.case.clone();
    let page = render(&long, &[], Pages::of(&long, SMALL).as_ref());
    assert!(page.contains("The worst 3 of 14 rows; all are on 5 pages, from"));
    assert!(page.contains("The worst 100 of each engine, 500 of 960 readings;"));
    assert!(page.contains("Every one of 1920 comparisons, in the order of report.json, on 30 pages of 64 at most."));
    // Its cell leads to the failure, not to an earlier pass.
    assert!(page.contains("/readings-0005.html#r301\"><span class=\"unseen\">"));
    let matrix = page.split("id=\"matrix-title\"").nth(1).unwrap().split("</section>").next().unwrap();
    assert!(matrix.contains(&format!(">{place}</th>")), "the failing case is shown");
}

#[test]
fn no_name_becomes_markup_on_a_page_either() {
    let evil = "\"><script>alert(1)</script><img src=x onerror=alert(2)>'&";
    let run = tempfile::tempdir().unwrap();
    let mut long = report(&[ProcedureId::DirectIlluminance], evil, evil);
    for c in &mut long.comparisons {
        c.key.engine = evil.into();
        c.meter.0 = evil.into();
        c.diagnosis = Some(evil.into());
        c.verdict = Verdict::Fail;
    }
    // A report of another version may contain any checksum.
    long.checksum = "../../\"><script>".into();
    let page = render(&long, &[], Pages::of(&long, SMALL).as_ref());
    assert_eq!(page.matches("</script>").count(), 2, "only the page's own two scripts end");
    page_files::keep_as(&long, &page, run.path(), SMALL).unwrap();
    let files = written_pages(run.path());
    assert!(files.len() > 10);
    for (name, html) in &files {
        assert!(!html.contains("<script") && !html.contains("<img"), "markup on {name}");
        assert!(html.contains("default-src 'none'"), "{name} may load");
    }
}

/// Writes a report of so many comparisons with small pages, and counts its pages.
fn write_report(run: &Path, comparisons: usize) -> usize {
    let mut report = long(comparisons);
    luxproof_report_file::keep_anew(&mut report, run).unwrap();
    let page = render(&report, &[], Pages::of(&report, SMALL).as_ref());
    page_files::keep_as(&report, &page, run, SMALL).unwrap();
    written_pages(run).len()
}

#[test]
fn pages_of_an_earlier_report_are_removed_and_other_files_stay() {
    let run = tempfile::tempdir().unwrap();
    assert_eq!([1920, 640, 640, 3].map(|comparisons| write_report(run.path(), comparisons)), [31, 11, 11, 0]);
    assert!(!run.path().join("report-pages").exists());
    write_report(run.path(), 640);
    let theirs = run.path().join("report-pages/mine");
    std::fs::create_dir(&theirs).unwrap();
    std::fs::write(theirs.join("readings-0001.html"), "").unwrap();
    assert_eq!(write_report(run.path(), 3), 1);
}

#[test]
fn a_grid_of_many_meters_is_drawn_in_blocks_that_show_their_worst_meter() {
    let mut long = report(&[ProcedureId::DirectIlluminance], "room", "a room");
    let first = long.comparisons[0].clone();
    long.comparisons = (0..20_000)
        .map(|k| {
            let at_m = [(k % 200) as f64, (k / 200) as f64, 0.8];
            let relative_deviation = Some(if k == 7777 { -0.0456 } else { 0.001 });
            Comparison { meter: MeterId::new("plane", k), at_m, relative_deviation, ..first.clone() }
        })
        .collect();
    let page = page(&long, &[]);
    assert!(page.contains("Each cell is the worst of 3 × 3 meters."));
    assert_eq!(page.matches("plane[7777]: −4.").count(), 1);
    assert!(page.len() < 3_000_000, "{} bytes", page.len());
}

#[test]
fn a_report_of_nothing_is_still_a_page() {
    let mut empty = report(&[], "room", "nothing");
    empty.engines.clear();
    assert!(page(&empty, &[]).contains("Nothing was skipped"));
}

#[test]
fn stress_and_bench_are_shown_with_the_report_and_anything_else_is_refused() {
    let stress = r#"{"laws": [{"engine": "mitsuba", "law": "scale", "worst_deviation": 0.02, "breaks_at": {"0.001": 1e5, "0.1": null}, "how": "drift"},
        {"engine": "povray", "law": "scale", "worst_deviation": 1.0, "breaks_at": {"0.1": 1e6}, "how": "silent_loss", "known": ["32-bit floats"]},
        {"engine": "radiance", "law": "scale", "refused_at": 1e4}]}"#;
    let bench = r#"{"curves": [{"engine": "radiance", "procedure": "direct_illuminance", "solver": null, "preset": "fast",
        "points": [{"effort": 1, "wall_s": 0.1, "relative_error": 0.01}, {"effort": 2, "wall_s": 1.0, "relative_error": 0.003}], "time_to": {}}]}"#;
    let attachments: Vec<AttachedReport> = [stress, bench].map(|text| AttachedReport::from_json(text).unwrap()).into();
    let page = page(&report(&[ProcedureId::DirectIlluminance], "room", "a room"), &attachments);
    assert!(page.contains("id=\"stress\"") && page.contains("0.1 % at 1e5"));
    assert!(
        page.contains("<dd>32-bit floats</dd>") && page.contains(">refuses<"),
        "known deviations and refusals are shown"
    );
    assert!(page.contains("the ladder of luxproof bench"));
    assert!(matches!(AttachedReport::from_json("{}"), Err(AttachedReportError::Unknown)));
}

#[test]
fn minus_signs_stand_before_numbers_only() {
    assert_eq!(minus("IP-ED differs by -3.0 %, ± 0.2 %"), "IP-ED differs by −3.0 %, ± 0.2 %");
    assert_eq!(percent(-7e-7), "−7·10⁻⁵ %");
}
