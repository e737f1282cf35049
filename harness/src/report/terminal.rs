//! The terminal report: a verdict matrix, the readings side by side, the worst deviations, what was skipped, where the files are.

use std::fmt::Write;
use std::ops::Range;

use comfy_table::{Attribute, Cell as TableCell, CellAlignment, Color, ContentArrangement, Row, Table, presets};
use itertools::Itertools;

use super::matrix::{Cell, matrix, worst};
use super::notes::{self, Kind, Note, biases, decision_rules, departures, diagnoses, notes, policies, splits};
use super::words::{mark, percent, plural, significant, value};
use super::{ReadingRecord, Report, papers};
use crate::judge::{Comparison, Verdict};
use crate::record::{EngineStatus, ProcedureId, Status};

/// More meters than this are summarised instead of listed.
const LISTED_METERS: usize = 8;
/// Lines of each kind, and letters of a line, that a brief report spends.
const BRIEF: usize = 4;
const BRIEF_WIDTH: usize = 156;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Style {
    Plain,
    Colour,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Detail {
    /// What fits a screen: verdicts, the worst, what was skipped, where the files are.
    Brief,
    /// Every table and note besides.
    All,
}

const fn colour(verdict: Verdict) -> Color {
    match verdict {
        Verdict::Pass => Color::Green,
        Verdict::KnownDeviation | Verdict::NotJudged => Color::Cyan,
        Verdict::Inconclusive => Color::Yellow,
        Verdict::Fail | Verdict::UnexpectedPass | Verdict::Missing => Color::Red,
    }
}

pub fn terminal(report: &Report, style: Style, detail: Detail, folder: Option<&str>) -> String {
    let mut text = String::new();
    writeln!(text, "\nluxproof {}: {}", report.tool_version, report.spec.title).ok();
    writeln!(text, "{}", engines_line(report)).ok();
    for line in policies(report).iter().map(String::as_str).chain(decision_rules(report)) {
        writeln!(text, "{line}").ok();
    }
    writeln!(text).ok();
    writeln!(text, "{}\n", verdicts(report, style)).ok();
    if detail == Detail::All || !report.is_suite() {
        tables(report, style, &mut text);
    }
    for procedure in report.procedures().into_iter().filter(|_| detail == Detail::All) {
        let heading = format!("Bias of {procedure}: mean deviation, its interval, p of none");
        section(&mut text, &heading, biases(report, procedure).into_iter());
    }
    let most = if detail == Detail::All { usize::MAX } else { BRIEF };
    // In full: without who is independent of whom a claim says nothing.
    let departures = departures(report).into_iter().take(most);
    section(&mut text, "Who departs from the other witnesses, the reference included", departures);
    let diagnoses = diagnoses(report).into_iter().take(most).map(|line| shortened(&line, detail));
    section(&mut text, "What explains failures", diagnoses);
    let line = |c: &Comparison| format!("{}{}", report.of_suite(&c.key.case, ": "), deviation_line(c));
    let worst = worst(report, 5).into_iter().map(|c| shortened(&line(c), detail));
    section(&mut text, "Worst deviations (by verdict, then deviation over tolerance)", worst);
    section(&mut text, "What does not fit in published tables", notes::tables(report).into_iter());
    baseline(report, detail, &mut text);
    told(report, detail, &mut text);
    writeln!(text, "{} in {:.1} s", report.summary, report.wall_s).ok();
    if let Some(folder) = folder {
        writeln!(text, "files: {folder}/report.json, readings/, scenes/<engine>/, logs/").ok();
    }
    text
}

/// Lines under a heading; nothing where there are none.
fn section(text: &mut String, heading: &str, lines: impl Iterator<Item = String>) {
    let lines: Vec<String> = lines.map(|line| format!("  {line}\n")).collect();
    if !lines.is_empty() {
        writeln!(text, "{heading}\n{}", lines.concat()).ok();
    }
}

/// How the run compares with its baseline; what departs from it is told in full.
fn baseline(report: &Report, detail: Detail, text: &mut String) {
    let Some(check) = &report.baseline else { return };
    writeln!(text, "Baseline {}: {}", check.file, check.counts()).ok();
    for entry in check.departures() {
        writeln!(text, "  {:<9} {} {} {}", entry.state, entry.key.case, entry.key.procedure, entry.key.engine).ok();
        for line in &entry.details {
            writeln!(text, "            {}", shortened(line, detail)).ok();
        }
    }
    writeln!(text).ok();
}

fn tables(report: &Report, style: Style, text: &mut String) {
    for grid in papers::grids(report) {
        let places = 1..grid.head.len() - 1;
        writeln!(text, "{}\n{}\n", grid.title, drawn(grid.head, grid.rows, places, style)).ok();
    }
    // In a suite the readings of a procedure are those of many rooms: they stay in the files.
    let in_paper = |p: &ProcedureId| report.published.iter().any(|t| t.procedure == *p);
    for procedure in report.procedures().into_iter().filter(|p| !report.is_suite() && !in_paper(p) && !p.is_known()) {
        if let Some(table) = readings(report, procedure, style) {
            writeln!(text, "{table}\n").ok();
        }
    }
    let splits = splits(report).into_iter().map(|(place, split)| format!("{place}: {split}"));
    section(text, "Methods apart from renderers (where they differ most)", splits);
}

fn engines_line(report: &Report) -> String {
    let of = |e: &EngineStatus| match (e.status, &e.version) {
        (Status::Ran, Some(version)) => format!("{} {version} ({:.1} s)", e.id, e.wall_s),
        (Status::Failed, Some(version)) => format!("{} {version} FAILED", e.id),
        (Status::Absent, _) => format!("{} absent", e.id),
        _ => format!("{} skipped", e.id),
    };
    report.engines.iter().map(of).collect::<Vec<_>>().join(" · ")
}

/// A table without lines, the columns of `right` flush right. Colours are decided by the caller, not guessed from the stream.
pub(super) fn drawn<R: Into<Row>>(
    head: impl IntoIterator<Item = impl ToString>,
    rows: impl IntoIterator<Item = R>,
    right: Range<usize>,
    style: Style,
) -> String {
    let mut table = Table::new();
    table.load_style(presets::NOTHING).set_content_arrangement(ContentArrangement::Disabled);
    table.set_header(head.into_iter().map(|word| TableCell::new(word).add_attribute(Attribute::Bold)));
    table.add_rows(rows);
    for (_, column) in table.column_iter_mut().enumerate().filter(|(k, _)| right.contains(k)) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    match style {
        Style::Plain => table.force_no_tty(),
        Style::Colour => table.enforce_styling(),
    };
    table.to_string().lines().map(str::trim_end).collect::<Vec<_>>().join("\n")
}

fn verdicts(report: &Report, style: Style) -> String {
    let heads = if report.is_suite() { &["Verdicts", "procedure", "against"][..] } else { &["Verdicts", "against"] };
    let mut case = String::new();
    let rows = matrix(report).into_iter().map(|row| {
        // A case is named once, in front of its first row.
        let name = if row.case == case { "" } else { row.case.as_str() };
        let name = report.is_suite().then(|| TableCell::new(name).add_attribute(Attribute::Bold));
        let cells = row.cells.iter().map(|cell| match cell {
            Cell::Judged { verdict, .. } => TableCell::new(cell.text()).fg(colour(*verdict)),
            _ => TableCell::new(cell.text()),
        });
        let heads = [TableCell::new(row.label), TableCell::new(row.basis)];
        let cells: Vec<TableCell> = name.into_iter().chain(heads).chain(cells).collect();
        case = row.case;
        cells
    });
    drawn(heads.iter().copied().chain(report.engines.iter().map(|e| e.id.as_str())), rows, 0..0, style)
}

/// The readings of one procedure, engines side by side; `None` where the meters are too many to list.
fn readings(report: &Report, procedure: ProcedureId, style: Style) -> Option<String> {
    let records: Vec<&ReadingRecord> = report.readings.iter().filter(|r| r.key.procedure == procedure).collect();
    let unit = records.first()?.reading.quantity.unit();
    let meters = records.iter().map(|r| &r.reading.meter).unique().collect_vec();
    if meters.len() > LISTED_METERS {
        return None;
    }
    let engines: Vec<&str> =
        report.engines.iter().map(|e| e.id.as_str()).filter(|e| records.iter().any(|r| r.key.engine == *e)).collect();
    let rows = meters.into_iter().map(|meter| {
        let of = |engine: &&str| records.iter().find(|r| r.reading.meter == *meter && r.key.engine == **engine);
        let values = engines.iter().map(|e| of(e).map_or("-".to_owned(), |r| value(&r.reading)));
        [place(report, procedure, &meter.0)].into_iter().chain(values).collect::<Vec<String>>()
    });
    let heads = [format!("{procedure} [{unit}]")].into_iter().chain(engines.iter().map(ToString::to_string));
    Some(drawn(heads, rows, 1..usize::MAX, style))
}

fn place(report: &Report, procedure: ProcedureId, meter: &str) -> String {
    let c = report.comparisons.iter().find(|c| c.key.procedure == procedure && c.meter.0 == meter);
    match c.and_then(|c| c.gamma_deg.zip(c.c_deg)) {
        Some((gamma, plane)) => format!("  C {plane} gamma {gamma}"),
        None => c.map_or(format!("  {meter}"), |c| format!("  {meter} ({}, {}, {})", c.at_m[0], c.at_m[1], c.at_m[2])),
    }
}

fn deviation_line(c: &Comparison) -> String {
    let number = |v: Option<f64>| v.map_or("nothing".to_owned(), significant);
    let against = c.reference.as_ref().map_or("no reference".to_owned(), |r| {
        format!("{} {} ({})", significant(r.value), c.quantity.unit(), r.basis.name())
    });
    let deviation = c.relative_deviation.map(|d| format!(" {}", percent(d))).unwrap_or_default();
    let why = c.diagnosis.as_ref().map(|d| format!(": {d}")).unwrap_or_default();
    format!(
        "{:<15} {} {} {} {} against {against}{deviation}{why}",
        mark(c.verdict),
        c.key.engine,
        c.key.procedure,
        c.meter,
        number(c.value)
    )
}

/// A line of a brief report ends at the screen's edge.
fn shortened(line: &str, detail: Detail) -> String {
    if detail == Detail::All || line.chars().count() <= BRIEF_WIDTH {
        return line.to_owned();
    }
    line.chars().take(BRIEF_WIDTH - 1).chain(['…']).collect()
}

/// What failed, was skipped or is a shortcut; in a brief report the first of it, and how much more there is.
fn told(report: &Report, detail: Detail, text: &mut String) {
    let notes = notes(report);
    let is_brief = |n: &&Note<'_>| n.kind <= Kind::Shortcut;
    let shown = match detail {
        Detail::All => notes.len(),
        Detail::Brief => notes.iter().take_while(is_brief).count().min(2 * BRIEF),
    };
    for note in &notes[..shown] {
        writeln!(text, "  {}", shortened(&note.line(report), detail)).ok();
    }
    let of = |kind: Kind| notes[shown..].iter().filter(|n| n.kind == kind).count();
    let mut left: Vec<String> = [Kind::Failed, Kind::Finding, Kind::Record, Kind::Skipped, Kind::Shortcut]
        .into_iter()
        .filter(|kind| of(*kind) > 0)
        .map(|kind| format!("{} more {}", of(kind), kind))
        .collect();
    left.extend(Some(of(Kind::Approximate) + of(Kind::Note)).filter(|n| *n > 0).map(|n| plural(n, "note")));
    let papers = if detail == Detail::Brief && report.is_suite() { report.published.len() } else { 0 };
    left.extend(Some(papers).filter(|n| *n > 0).map(|n| plural(n, "published table")));
    if !left.is_empty() {
        writeln!(text, "  {}: --all", left.join(", ")).ok();
    }
    writeln!(text).ok();
}
