//! The terminal report.
//!
//! A brief report is one screen: verdicts, values, what is undecided or failed, the files and the reason of the exit code.
//! A full report adds the verdict matrix, trust statements, published tables, biases and every note.

mod matrix;
mod screen;
mod values;
mod verdicts;

use std::fmt::Write;

use super::exit_reason::exit_reason;
use super::matrix::worst;
use super::notes::{
    self, Kind, Note, agreements, biases, decision_rules, departures, diagnoses, lacking, lints, luminaire_models,
    notes, policies, ratios, splits, time_limits, undecided,
};
use super::papers;
use super::verdict_lines::error_and_tolerance;
use super::words::{HEADING, LARGEST_ERROR_RULE};
use super::words::{mark, plural, significant};
use luxproof_model::{Comparison, EngineStatus, Report, Status, Verdict};
use matrix::verdict_matrix;
use values::value_tables;
use verdicts::{append_calibration, verdict_table};

pub(super) use screen::draw_table;
pub use screen::{Detail, Letters, Screen, Style};

/// Lines of each kind in a brief report.
const BRIEF_LINES: usize = 4;
/// Worst deviations that are listed.
const WORST_LINES: usize = 5;

/// Renders a report as text for a terminal; `folder` is where its files are. Without a folder it is a part of a longer output, so it
/// does not end with the reason of the exit code.
pub fn terminal(report: &Report, screen: Screen, folder: Option<&str>) -> String {
    let mut text = String::new();
    let tool = if report.tool.version.is_empty() { report.tool_version.clone() } else { report.tool.to_string() };
    writeln!(text, "{}", screen.wrap(&format!("luxproof {tool}: {}", report.spec.title))).ok();
    append_input(report, screen, &mut text);
    append_verdicts(report, screen, &mut text);
    if !report.is_suite() {
        append_values(report, screen, &mut text);
    }
    append_findings(report, screen, &mut text);
    append_baseline(report, screen, &mut text);
    if screen.is_full() {
        append_details(report, screen, &mut text);
    }
    append_notes(report, screen, &mut text);
    append_footer(report, screen, folder, &mut text);
    screen.spell(&text)
}

/// Appends the models of the luminaires with their reasons, and the lints of the specs.
fn append_input(report: &Report, screen: Screen, text: &mut String) {
    let most = if screen.is_full() { usize::MAX } else { BRIEF_LINES };
    for line in time_limits(report) {
        writeln!(text, "{}", screen.wrap(&line)).ok();
    }
    for line in luminaire_models(report).into_iter().take(most) {
        writeln!(text, "{}", screen.wrap(&format!("model: {line}"))).ok();
    }
    for line in lints(report).into_iter().take(most) {
        writeln!(text, "{}", screen.wrap(&format!("lint: {line}"))).ok();
    }
    writeln!(text).ok();
}

/// Appends a verdict for each renderer and procedure, the calibration scenes in a line, and engines without values.
fn append_verdicts(report: &Report, screen: Screen, text: &mut String) {
    let table = verdict_table(report, screen);
    if !table.is_empty() {
        writeln!(text, "{table}").ok();
    }
    append_calibration(report, screen, text);
    for line in lacking(report) {
        writeln!(text, "{}", screen.wrap(&line)).ok();
    }
    for engine in report.engines.iter().filter(|engine| is_engine_problem(engine)) {
        writeln!(text, "{}", screen.wrap(&describe_engine_problem(engine))).ok();
    }
    writeln!(text).ok();
}

fn is_engine_problem(engine: &EngineStatus) -> bool {
    engine.status == Status::Failed || (engine.status == Status::Absent && engine.is_required)
}

/// `FAILED radiance: why`, `NOT INSTALLED radiance: how to install it`.
fn describe_engine_problem(engine: &EngineStatus) -> String {
    let what = if engine.status == Status::Failed { "FAILED" } else { "NOT INSTALLED" };
    let why = engine.reason.as_deref().map(|reason| format!(": {}", last_line(reason))).unwrap_or_default();
    format!("{what} {}{why}", engine.id)
}

/// The last line of a reason, which names the cause; where the messages are is in the notes.
fn last_line(reason: &str) -> &str {
    let mut lines = reason.lines().filter(|line| !line.starts_with("all its messages are in "));
    lines.next_back().unwrap_or_default().trim()
}

/// Appends the values of every procedure: points of small sets, figures of large ones.
fn append_values(report: &Report, screen: Screen, text: &mut String) {
    let mut tables = vec![];
    for procedure in report.procedures() {
        let is_published = report.published.iter().any(|table| table.procedure == procedure);
        if !procedure.is_calibration() && !is_published {
            tables.extend(value_tables(report, procedure, screen));
        }
    }
    if !tables.is_empty() {
        writeln!(text, "{}\n", tables.join("\n")).ok();
    }
}

/// Appends what a reader has to act on: undecided comparisons, causes of failures, outliers, the worst deviations.
fn append_findings(report: &Report, screen: Screen, text: &mut String) {
    let most = if screen.is_full() { usize::MAX } else { BRIEF_LINES };
    append_ratios(report, screen, most.saturating_mul(2), text);
    append_section(text, "Undecided", undecided(report).into_iter().take(most).map(|line| screen.indent(&line)));
    let diagnoses = diagnoses(report).into_iter().take(most);
    append_section(text, "Cause of failures", diagnoses.map(|line| screen.shorten(&line)));
    // These lines are not cut, because a departure means nothing without the independent engines.
    let departures = departures(report).into_iter().take(most);
    append_section(text, "Which engine disagrees with the others", departures.map(|line| screen.indent(&line)));
    let worst = worst(report, WORST_LINES).into_iter().filter(|c| screen.is_full() || c.verdict != Verdict::Pass);
    let worst = worst.filter(|c| screen.is_full() || c.verdict != Verdict::NotJudged);
    let worst = worst.map(|c| screen.shorten(&deviation_line(report, c, screen)));
    append_section(text, "Worst deviations (by verdict, then deviation over tolerance)", worst);
}

/// Appends everything that a brief report omits, except notes.
fn append_details(report: &Report, screen: Screen, text: &mut String) {
    append_section(text, HEADING, report.sentences.iter().map(|sentence| screen.indent(&sentence.text)));
    writeln!(text, "{}\n", verdict_matrix(report, screen)).ok();
    for grid in papers::grids(report) {
        let places = 1..grid.head.len() - 1;
        writeln!(text, "{}\n{}\n", grid.title, draw_table(grid.head, grid.rows, places, screen.style)).ok();
    }
    let misfits = notes::tables(report).into_iter().map(|line| screen.indent(&line));
    append_section(text, "What does not fit in published tables", misfits);
    let splits = splits(report).into_iter().map(|(place, split)| screen.indent(&format!("{place}: {split}")));
    append_section(text, "How much of the difference is due to the hand-calculation method", splits);
    for procedure in report.procedures() {
        let heading = format!("Mean error in {procedure} (with interval and p-value)");
        append_section(text, &heading, biases(report, procedure).into_iter().map(|line| screen.indent(&line)));
    }
    // A single case has them below its tables.
    for procedure in report.procedures().into_iter().filter(|_| report.is_suite()) {
        let heading = format!("Figures of sets of points in {procedure}");
        append_section(text, &heading, agreements(report, procedure).into_iter().map(|line| screen.indent(&line)));
    }
}

/// Appends the first ratios of compared cases, and the number of further ones.
fn append_ratios(report: &Report, screen: Screen, most: usize, text: &mut String) {
    let ratios = ratios(report);
    let omitted = ratios.len().saturating_sub(most);
    let more = (omitted > 0).then(|| format!("{omitted} more: --all"));
    let lines = ratios.into_iter().take(most).chain(more).map(|line| screen.indent(&line));
    append_section(text, "Means of sets of points, after over before", lines);
}

/// Appends the rules of the verdicts, the paths of the files and, as the last line, the reason of the exit code.
fn append_footer(report: &Report, screen: Screen, folder: Option<&str>, text: &mut String) {
    let engines = screen.is_full().then(|| engines_line(report));
    let rules = decision_rules(report).into_iter().map(str::to_owned);
    for line in engines.into_iter().chain(policies(report)).chain(rules) {
        writeln!(text, "{}", screen.wrap(&line)).ok();
    }
    if screen.is_full() {
        writeln!(text, "{}", screen.wrap("± is two standard errors, or the bound of the error")).ok();
        writeln!(text, "{}", screen.wrap(LARGEST_ERROR_RULE)).ok();
        writeln!(text, "{}", screen.wrap(&format!("{} in {:.1} s", report.summary, report.wall_s))).ok();
    }
    if let Some(folder) = folder {
        let more = if report.is_long() { ", comparisons.jsonl, report-pages/" } else { "" };
        let case = report.of_suite("<case>", "/");
        let files =
            format!("files: {folder}/report.html, report.json{more}, {case}readings/, {case}scenes/, {case}logs/");
        writeln!(text, "{}", screen.wrap(&files)).ok();
        writeln!(text, "{}", screen.wrap(&exit_reason(report))).ok();
    }
}

/// Appends a heading and its lines; nothing where there are no lines.
fn append_section(text: &mut String, heading: &str, lines: impl Iterator<Item = String>) {
    let lines: Vec<String> = lines.map(|line| format!("  {line}\n")).collect();
    if !lines.is_empty() {
        writeln!(text, "{heading}\n{}", lines.concat()).ok();
    }
}

/// Appends the comparison with the baseline, with every departure in full.
fn append_baseline(report: &Report, screen: Screen, text: &mut String) {
    let Some(check) = &report.baseline else { return };
    writeln!(text, "Baseline {}: {}", check.file, check.counts()).ok();
    for difference in check.differences_within_noise() {
        writeln!(text, "  {}", screen.shorten(&format!("within noise: {difference}"))).ok();
    }
    for entry in check.differences() {
        writeln!(text, "  {:<9} {} {} {}", entry.state, entry.key.case, entry.key.procedure, entry.key.engine).ok();
        for line in entry.lines() {
            writeln!(text, "            {}", screen.shorten(line)).ok();
        }
    }
    writeln!(text).ok();
}

fn engines_line(report: &Report) -> String {
    report.engines.iter().map(engine_status).collect::<Vec<_>>().join(" · ")
}

/// An engine with its version and status: `radiance 5.4 (1.2 s)`.
fn engine_status(engine: &EngineStatus) -> String {
    match (engine.status, &engine.version) {
        (Status::Ran, Some(version)) => format!("{} {version} ({:.1} s)", engine.id, engine.wall_s),
        (Status::Failed, Some(version)) => format!("{} {version} FAILED", engine.id),
        (Status::Absent, _) => format!("{} absent", engine.id),
        _ => format!("{} skipped", engine.id),
    }
}

/// One comparison in a line: verdict, engine, place, value, reference, deviation and diagnosis.
fn deviation_line(report: &Report, c: &Comparison, screen: Screen) -> String {
    let case = report.of_suite(&screen.abridge_name(&c.key.case), ": ");
    let value = c.value.map_or("nothing".to_owned(), significant);
    let unit = c.quantity.unit();
    let against = c
        .reference
        .as_ref()
        .map_or("no reference".to_owned(), |r| format!("{} {unit} ({})", significant(r.value), r.basis.name()));
    let deviation = c.deviation.map(|_| format!(", {}", error_and_tolerance(c).0)).unwrap_or_default();
    // A brief report has the cause once, above these lines.
    let why = c.diagnosis.as_ref().filter(|_| screen.is_full()).map(|d| format!(": {d}")).unwrap_or_default();
    format!(
        "{case}{} {} {} {}: {value} {unit}, expected {against}{deviation}{why}",
        mark(c.verdict),
        c.key.engine,
        c.key.procedure,
        screen.abridge_name(&c.meter.0),
    )
}

/// Appends failures, skips and shortcuts; a brief report has failures and findings, and counts the rest.
fn append_notes(report: &Report, screen: Screen, text: &mut String) {
    let notes = notes(report);
    let shown = if screen.is_full() {
        notes.len()
    } else {
        notes.iter().take_while(|n| n.kind <= Kind::Record).count().min(2 * BRIEF_LINES)
    };
    for note in &notes[..shown] {
        writeln!(text, "  {}", screen.shorten(&note.line(report))).ok();
    }
    let omitted = &notes[shown..];
    let mut counts: Vec<String> = vec![];
    for kind in [Kind::Failed, Kind::Finding, Kind::Record, Kind::Skipped, Kind::Shortcut] {
        let count = count_kind(omitted, kind);
        if count > 0 {
            counts.push(plural(count, kind.noun()));
        }
    }
    let minor = count_kind(omitted, Kind::Approximate) + count_kind(omitted, Kind::Note);
    if minor > 0 {
        counts.push(plural(minor, "note"));
    }
    let papers = if screen.is_full() { 0 } else { report.published.len() };
    if papers > 0 {
        counts.push(plural(papers, "published table"));
    }
    if !counts.is_empty() {
        writeln!(text, "Not shown: {}; `--all` prints everything", counts.join(", ")).ok();
    }
    if screen.is_full() && !notes.is_empty() {
        writeln!(text).ok();
    }
}

fn count_kind(notes: &[Note<'_>], kind: Kind) -> usize {
    notes.iter().filter(|note| note.kind == kind).count()
}
