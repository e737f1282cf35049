//! The terminal report: what each renderer can be trusted for, a verdict matrix, lux side by side, the worst deviations, what was left
//! out, by whom, where the files are.

use std::fmt::Write;
use std::ops::Range;

use comfy_table::{Attribute, Cell as TableCell, CellAlignment, Color, ContentArrangement, Row, Table, presets};
use itertools::Itertools;
use unicode_width::UnicodeWidthStr as _;

use super::matrix::{Cell, Row as MatrixRow, matrix, worst};
use super::notes::{
    self, Kind, LISTED_METERS, Note, agreement, agreements, biases, decision_rules, departures, diagnoses, lacking,
    large_sets, notes, policies, ratios, splits,
};
use super::sentences::{HEADING, sentences};
use super::words::{abridged, cut, estimate, mark, off, percent, plural, significant, value, wrapped};
use super::{ReadingRecord, Report, papers};
use crate::judge::{Comparison, Statistics, Verdict};
use crate::record::{EngineStatus, Estimate, MeterId, ProcedureId, Status};

/// Lines of each kind that a brief report spends.
const BRIEF: usize = 4;
/// The narrowest and the widest screen that is laid out for, in letters.
const WIDTHS: std::ops::RangeInclusive<usize> = 80..=200;

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

/// What a report is printed on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Screen {
    pub style: Style,
    pub detail: Detail,
    /// Letters to a line.
    width: usize,
}

impl Screen {
    /// One of about so many letters to a line; where nobody knows, as wide as a log.
    pub fn new(style: Style, detail: Detail, width: Option<usize>) -> Self {
        Self { style, detail, width: width.unwrap_or(160).clamp(*WIDTHS.start(), *WIDTHS.end()) }
    }

    /// A line of a brief report ends at the screen's edge.
    fn shortened(self, line: &str) -> String {
        // Headings indent what is below them.
        if self.detail == Detail::All { wrapped(line, self.width - 2, "    ") } else { cut(line, self.width - 2) }
    }

    /// A name that leaves room for what is said of it.
    fn name(self, name: &str) -> String {
        abridged(name, self.width / 3)
    }

    /// A line on as many as it takes.
    fn whole(self, line: &str) -> String {
        wrapped(line, self.width, "  ")
    }

    /// A table whose columns of engines stand side by side as far as there is room, and below one another beyond.
    fn fitted(self, engines: usize, draw: impl Fn(Range<usize>, Style) -> String) -> String {
        let fits = |range| draw(range, Style::Plain).lines().all(|line| line.width() <= self.width);
        let (mut blocks, mut from) = (vec![], 0);
        while from < engines || blocks.is_empty() {
            let to = (from + 1..=engines).rev().find(|to| fits(from..*to)).unwrap_or((from + 1).min(engines));
            blocks.push(draw(from..to, self.style));
            from = to.max(from + 1);
        }
        blocks.join("\n\n")
    }
}

const fn colour(verdict: Verdict) -> Color {
    match verdict {
        Verdict::Pass => Color::Green,
        Verdict::KnownDeviation | Verdict::NotJudged => Color::Cyan,
        Verdict::Inconclusive => Color::Yellow,
        Verdict::Fail | Verdict::UnexpectedPass | Verdict::Missing => Color::Red,
    }
}

pub fn terminal(report: &Report, screen: Screen, folder: Option<&str>) -> String {
    let mut text = String::new();
    let tool = if report.tool.version.is_empty() { report.tool_version.clone() } else { report.tool.to_string() };
    writeln!(text, "\n{}\n", screen.whole(&format!("luxproof {tool}: {}", report.spec.title))).ok();
    let indented = |line: String| wrapped(&line, screen.width - 2, "    ");
    section(&mut text, HEADING, sentences(report).into_iter().map(|s| indented(s.text)));
    for line in lacking(report) {
        writeln!(text, "{line}\n").ok();
    }
    writeln!(text, "{}\n", verdicts(report, screen)).ok();
    if screen.detail == Detail::All || !report.is_suite() {
        tables(report, screen, &mut text);
    }
    for procedure in report.procedures().into_iter().filter(|_| screen.detail == Detail::All) {
        let heading = format!("Bias of {procedure}: mean deviation, its interval, p of none");
        section(&mut text, &heading, biases(report, procedure).into_iter().map(indented));
    }
    // A single case has them below its tables.
    for procedure in report.procedures().into_iter().filter(|_| screen.detail == Detail::All && report.is_suite()) {
        let heading = format!("What sets of meters come to in {procedure}");
        section(&mut text, &heading, agreements(report, procedure).into_iter().map(indented));
    }
    let most = if screen.detail == Detail::All { usize::MAX } else { BRIEF };
    let compared = ratios(report);
    let left = compared.len().saturating_sub(most.saturating_mul(2));
    let more = (left > 0).then(|| format!("{left} more: --all"));
    let compared = compared.into_iter().take(most.saturating_mul(2)).chain(more);
    section(&mut text, "Means of sets of meters, after over before", compared.map(indented));
    // In full: without who is independent of whom a claim says nothing.
    let departures = departures(report).into_iter().take(most);
    section(&mut text, "Who departs from the other witnesses, the reference included", departures.map(indented));
    let diagnoses = diagnoses(report).into_iter().take(most).map(|line| screen.shortened(&line));
    section(&mut text, "What explains failures", diagnoses);
    let line =
        |c: &Comparison| format!("{}{}", report.of_suite(&screen.name(&c.key.case), ": "), deviation_line(c, screen));
    let worst = worst(report, 5).into_iter().map(|c| screen.shortened(&line(c)));
    section(&mut text, "Worst deviations (by verdict, then deviation over tolerance)", worst);
    section(&mut text, "What does not fit in published tables", notes::tables(report).into_iter().map(indented));
    baseline(report, screen, &mut text);
    told(report, screen, &mut text);
    let engines = std::iter::once(engines_line(report)).chain(policies(report));
    for line in engines.chain(decision_rules(report).into_iter().map(str::to_owned)) {
        writeln!(text, "{}", screen.whole(&line)).ok();
    }
    writeln!(text, "\n{}", screen.whole(&format!("{} in {:.1} s", report.summary, report.wall_s))).ok();
    if let Some(folder) = folder {
        let more = if report.is_long() { ", comparisons.jsonl, report-pages/" } else { "" };
        let of_case = report.of_suite("<case>", "/");
        let files = format!(
            "files: {folder}/report.html, report.json{more}, {of_case}readings/, {of_case}scenes/<engine>/, {of_case}logs/"
        );
        writeln!(text, "{}", screen.whole(&files)).ok();
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
fn baseline(report: &Report, screen: Screen, text: &mut String) {
    let Some(check) = &report.baseline else { return };
    writeln!(text, "Baseline {}: {}", check.file, check.counts()).ok();
    for entry in check.departures() {
        writeln!(text, "  {:<9} {} {} {}", entry.state, entry.key.case, entry.key.procedure, entry.key.engine).ok();
        for line in &entry.details {
            writeln!(text, "            {}", screen.shortened(line)).ok();
        }
    }
    writeln!(text).ok();
}

fn tables(report: &Report, screen: Screen, text: &mut String) {
    for grid in papers::grids(report) {
        let places = 1..grid.head.len() - 1;
        writeln!(text, "{}\n{}\n", grid.title, drawn(grid.head, grid.rows, places, screen.style)).ok();
    }
    // In a suite the readings of a procedure are those of many rooms: they stay in the files.
    let in_paper = |p: &ProcedureId| report.published.iter().any(|t| t.procedure == *p);
    for procedure in report.procedures().into_iter().filter(|p| !report.is_suite() && !in_paper(p) && !p.is_known()) {
        if let Some(table) = readings(report, procedure, screen) {
            writeln!(text, "{table}\n").ok();
        }
        if let Some(table) = of_sets(report, procedure, screen) {
            writeln!(text, "{table}\n").ok();
        }
    }
    let split = |(place, split)| wrapped(&format!("{place}: {split}"), screen.width - 2, "    ");
    let splits = splits(report).into_iter().map(split);
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

/// What a cell says, at length or in brief.
type Said = fn(&Cell) -> String;

/// Where the name of a case stands.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Named {
    InFront,
    Above,
}

fn verdicts(report: &Report, screen: Screen) -> String {
    let (all, rows) = (0..report.engines.len(), matrix(report));
    let fits = |named, text: Said| {
        let lines = verdicts_of(report, &rows, &all, (named, text), (Style::Plain, screen.width));
        lines.lines().all(|line| line.width() <= screen.width)
    };
    let ways: [(Named, Said); 2] = [(Named::InFront, Cell::text), (Named::InFront, Cell::brief)];
    let (named, text) = ways.into_iter().find(|(n, t)| fits(*n, *t)).unwrap_or((Named::Above, Cell::brief));
    screen.fitted(all.len(), |range, style| verdicts_of(report, &rows, &range, (named, text), (style, screen.width)))
}

/// The verdicts of some of the engines.
fn verdicts_of(
    report: &Report,
    rows: &[MatrixRow],
    engines: &Range<usize>,
    (named, text): (Named, Said),
    (style, width): (Style, usize),
) -> String {
    let is_in_front = report.is_suite() && named == Named::InFront;
    let heads = if is_in_front { &["Verdicts", "procedure", "against"][..] } else { &["Verdicts", "against"] };
    // A case is named once, at its first row.
    let first_of = |k: usize| (k == 0 || rows[k - 1].case != rows[k].case).then_some(rows[k].case.as_str());
    let cells = rows.iter().enumerate().map(|(k, row)| {
        let cells = row.cells[engines.clone()].iter().map(|cell| match cell {
            Cell::Judged { verdict, .. } => TableCell::new(text(cell)).fg(colour(*verdict)),
            _ => TableCell::new(text(cell)),
        });
        let name = || TableCell::new(first_of(k).unwrap_or_default()).add_attribute(Attribute::Bold);
        let heads = [TableCell::new(&row.label), TableCell::new(row.basis)];
        is_in_front.then(name).into_iter().chain(heads).chain(cells).collect::<Vec<TableCell>>()
    });
    let names = report.engines[engines.clone()].iter().map(|e| e.id.as_str());
    let table = drawn(heads.iter().copied().chain(names), cells, 0..0, style);
    if is_in_front || !report.is_suite() {
        return table;
    }
    let mut lines = vec![];
    for (k, line) in table.lines().enumerate() {
        let case = k.checked_sub(1).and_then(first_of);
        let name = |case: &str| drawn([abridged(case, width - 1)], Vec::<Vec<TableCell>>::new(), 0..0, style);
        lines.extend(case.map(name));
        lines.push(format!(" {line}"));
    }
    lines.join("\n")
}

/// One figure of a set of meters.
type Figure = fn(&Statistics) -> Option<Estimate>;

/// What large sets of meters come to, engines side by side; `None` where none is.
fn of_sets(report: &Report, procedure: ProcedureId, screen: Screen) -> Option<String> {
    let mine: Vec<&Statistics> = large_sets(report, procedure).collect();
    let sets = mine.iter().map(|s| (s.set.as_str(), s.meters)).unique().collect_vec();
    let has = |e: &&str| mine.iter().any(|s| s.key.engine == **e);
    let engines: Vec<&str> = report.engines.iter().map(|e| e.id.as_str()).filter(has).collect();
    if mine.is_empty() {
        return None;
    }
    let unit = procedure.row().quantity.unit();
    let figures: [(String, Figure); 4] = [
        (format!("mean [{unit}]"), |s| Some(s.mean)),
        (format!("minimum [{unit}]"), |s| Some(s.minimum)),
        ("uniformity".to_owned(), |s| s.uniformity),
        ("diversity".to_owned(), |s| s.diversity),
    ];
    let of_set = |(set, meters): &(&str, usize)| {
        let rows = |range: &Range<usize>| {
            figures.each_ref().map(|(name, figure)| {
                let of = |engine: &&str| mine.iter().find(|s| s.set == *set && s.key.engine == **engine);
                let cell = |e| of(e).and_then(|s| figure(s)).map_or("-".to_owned(), |x| estimate(&x));
                let head = format!("  {name}");
                std::iter::once(head).chain(engines[range.clone()].iter().map(cell)).collect::<Vec<String>>()
            })
        };
        let table = screen.fitted(engines.len(), |range, style| {
            let heads = std::iter::once("").chain(engines[range.clone()].iter().copied());
            drawn(heads, rows(&range), 1..usize::MAX, style)
        });
        let agreements = mine.iter().filter(|s| s.set == *set).filter_map(|s| agreement(s));
        let agreements =
            agreements.map(|line| format!("\n   {}", wrapped(&line, screen.width - 3, "       "))).join("");
        let heading = wrapped(&format!("{procedure}, {set} ({meters} meters)"), screen.width - 1, "  ");
        format!(" {heading}\n{table}{agreements}")
    };
    Some(sets.iter().map(of_set).join("\n\n"))
}

/// The readings of one procedure, engines side by side; `None` where the meters are too many to list.
fn readings(report: &Report, procedure: ProcedureId, screen: Screen) -> Option<String> {
    let records: Vec<&ReadingRecord> = report.readings.iter().filter(|r| r.key.procedure == procedure).collect();
    let unit = records.first()?.reading.quantity.unit();
    let meters = records.iter().map(|r| &r.reading.meter).unique().collect_vec();
    if meters.len() > LISTED_METERS {
        return None;
    }
    let engines: Vec<&str> =
        report.engines.iter().map(|e| e.id.as_str()).filter(|e| records.iter().any(|r| r.key.engine == *e)).collect();
    let rows = |range: &Range<usize>| {
        let row = |meter: &&MeterId| {
            let of = |engine: &&str| records.iter().find(|r| r.reading.meter == **meter && r.key.engine == **engine);
            let values = engines[range.clone()].iter().map(|e| of(e).map_or("-".to_owned(), |r| value(&r.reading)));
            [place(report, procedure, &meter.0, screen)].into_iter().chain(values).collect::<Vec<String>>()
        };
        meters.iter().map(row).collect::<Vec<_>>()
    };
    Some(screen.fitted(engines.len(), |range, style| {
        let engines = engines[range.clone()].iter().map(ToString::to_string);
        drawn(std::iter::once(format!("{procedure} [{unit}]")).chain(engines), rows(&range), 1..usize::MAX, style)
    }))
}

fn place(report: &Report, procedure: ProcedureId, meter: &str, screen: Screen) -> String {
    let c = report.comparisons.iter().find(|c| c.key.procedure == procedure && c.meter.0 == meter);
    if let Some((gamma, plane)) = c.and_then(|c| c.gamma_deg.zip(c.c_deg)) {
        return format!("  C {plane} gamma {gamma}");
    }
    let name = screen.name(meter);
    c.map_or(format!("  {name}"), |c| format!("  {name} ({}, {}, {})", c.at_m[0], c.at_m[1], c.at_m[2]))
}

fn deviation_line(c: &Comparison, screen: Screen) -> String {
    let number = |v: Option<f64>| v.map_or("nothing".to_owned(), significant);
    let against = c.reference.as_ref().map_or("no reference".to_owned(), |r| {
        format!("{} {} ({})", significant(r.value), c.quantity.unit(), r.basis.name())
    });
    let deviation = off(c, percent).map(|d| format!(" {d}")).unwrap_or_default();
    let why = c.diagnosis.as_ref().map(|d| format!(": {d}")).unwrap_or_default();
    format!(
        "{:<15} {} {} {} {} against {against}{deviation}{why}",
        mark(c.verdict),
        c.key.engine,
        c.key.procedure,
        screen.name(&c.meter.0),
        number(c.value)
    )
}

/// What failed, was skipped or is a shortcut; in a brief report the first of it, and how much more there is.
fn told(report: &Report, screen: Screen, text: &mut String) {
    let notes = notes(report);
    let is_brief = |n: &&Note<'_>| n.kind <= Kind::Shortcut;
    let shown = match screen.detail {
        Detail::All => notes.len(),
        Detail::Brief => notes.iter().take_while(is_brief).count().min(2 * BRIEF),
    };
    for note in &notes[..shown] {
        writeln!(text, "  {}", screen.shortened(&note.line(report))).ok();
    }
    let of = |kind: Kind| notes[shown..].iter().filter(|n| n.kind == kind).count();
    let mut left: Vec<String> = [Kind::Failed, Kind::Finding, Kind::Record, Kind::Skipped, Kind::Shortcut]
        .into_iter()
        .filter(|kind| of(*kind) > 0)
        .map(|kind| format!("{} more {}", of(kind), kind))
        .collect();
    left.extend(Some(of(Kind::Approximate) + of(Kind::Note)).filter(|n| *n > 0).map(|n| plural(n, "note")));
    let papers = if screen.detail == Detail::Brief && report.is_suite() { report.published.len() } else { 0 };
    left.extend(Some(papers).filter(|n| *n > 0).map(|n| plural(n, "published table")));
    if !left.is_empty() {
        writeln!(text, "  {}: --all", left.join(", ")).ok();
    }
    writeln!(text).ok();
}
