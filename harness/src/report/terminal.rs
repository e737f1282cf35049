//! The terminal report: a verdict matrix, the readings side by side, the worst deviations, what was skipped, where the files are.

use std::collections::BTreeMap;
use std::fmt::Write;

use comfy_table::{Attribute, Cell as TableCell, CellAlignment, Color, ContentArrangement, Table, presets};

use super::{ReadingRecord, Report, consensus, paper, paper_split, split};
use crate::judge::{Basis, Comparison, Verdict};
use crate::record::{ProcedureId, ReadingKey, Role, Status};

/// More meters than this are summarised instead of listed.
const LISTED_METERS: usize = 8;
/// Lines of each kind, and letters of a line, that a brief report spends.
const BRIEF: usize = 4;
const BRIEF_WIDTH: usize = 156;

/// How the report is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Style {
    /// Plain text.
    Plain,
    /// With ANSI colours.
    Colour,
}

/// How much the report tells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Detail {
    /// What fits a screen: verdicts, the worst, what was skipped, where the files are.
    Brief,
    /// Every table and note besides.
    All,
}

/// One row of the verdict matrix.
pub(super) struct Row {
    pub(super) case: String,
    pub(super) procedure: ProcedureId,
    /// What its references rest on.
    pub(super) basis: String,
    /// One an engine, in the report's order.
    pub(super) cells: Vec<Cell>,
}

/// One cell of the verdict matrix: the worst verdict of its comparisons.
pub(super) enum Cell {
    /// The engine is what others are judged by here.
    IsReference,
    /// Not run.
    Skipped,
    /// Nothing to compare.
    Empty,
    /// Compared.
    Judged {
        /// The worst verdict.
        verdict: Verdict,
        /// How many comparisons have it.
        having: usize,
        /// How many there are.
        of: usize,
        /// The largest relative deviation, signed.
        deviation: Option<f64>,
    },
}

impl Cell {
    pub(super) fn text(&self) -> String {
        match self {
            Self::IsReference => "reference".to_owned(),
            Self::Skipped => "skipped".to_owned(),
            Self::Empty => "-".to_owned(),
            Self::Judged { verdict, having, of, deviation } => {
                let percent = deviation.map(|d| format!(" {}", percent(d))).unwrap_or_default();
                let count = if having == of { format!("{of}") } else { format!("{having}/{of}") };
                format!("{} {count}{percent}", mark(*verdict))
            }
        }
    }

    fn colour(&self) -> Option<Color> {
        match self {
            Self::Judged { verdict, .. } => Some(match verdict {
                Verdict::Pass => Color::Green,
                Verdict::KnownDeviation => Color::Cyan,
                Verdict::Inconclusive => Color::Yellow,
                Verdict::Fail | Verdict::UnexpectedPass | Verdict::Missing => Color::Red,
            }),
            _ => None,
        }
    }
}

const fn mark(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Pass => "ok",
        Verdict::KnownDeviation => "known",
        Verdict::Inconclusive => "undecided",
        Verdict::Fail => "FAIL",
        Verdict::UnexpectedPass => "UNEXPECTED PASS",
        Verdict::Missing => "MISSING",
    }
}

/// The verdict matrix: procedure and basis by engine.
pub(super) fn matrix(report: &Report) -> Vec<Row> {
    let cases = || report.cases.iter().map(|c| c.name.as_str());
    let of_case = |case| report.procedures().into_iter().map(move |procedure| (case, procedure));
    let mut rows = vec![];
    for (case, procedure) in cases().flat_map(of_case) {
        let is_mine = |c: &&Comparison| c.key.case == case && c.key.procedure == procedure;
        let comparisons: Vec<&Comparison> = report.comparisons.iter().filter(is_mine).collect();
        let mut bases: Vec<Option<Basis>> = comparisons.iter().map(|c| c.reference.as_ref().map(|r| r.basis)).collect();
        bases.sort_unstable();
        bases.dedup();
        for basis in bases {
            let of_row: Vec<&Comparison> =
                comparisons.iter().copied().filter(|c| c.reference.as_ref().map(|r| r.basis) == basis).collect();
            rows.push(Row {
                case: case.to_owned(),
                procedure,
                basis: basis.map_or("none", Basis::name).to_owned(),
                cells: report.engines.iter().map(|e| cell(report, case, procedure, &e.id, &of_row)).collect(),
            });
        }
    }
    rows
}

fn cell(report: &Report, case: &str, procedure: ProcedureId, engine: &str, of_row: &[&Comparison]) -> Cell {
    let mine: Vec<&&Comparison> = of_row.iter().filter(|c| c.key.engine == engine).collect();
    let Some(verdict) = mine.iter().map(|c| c.verdict).max() else {
        let is = |key: &ReadingKey| key.is_of(case, procedure) && key.engine == *engine;
        return if report.recordings.iter().any(|r| is(&r.key) && r.role == Role::Witness) {
            Cell::IsReference
        } else if report.skips.iter().any(|s| is(&s.key)) {
            Cell::Skipped
        } else {
            Cell::Empty
        };
    };
    let deviations = mine.iter().filter_map(|c| c.relative_deviation);
    Cell::Judged {
        verdict,
        having: mine.iter().filter(|c| c.verdict == verdict).count(),
        of: mine.len(),
        deviation: deviations.max_by(|a, b| a.abs().total_cmp(&b.abs())),
    }
}

/// The worst comparison of each engine, procedure and basis, worst first: by verdict, then by deviation over tolerance.
pub(super) fn worst(report: &Report, count: usize) -> Vec<&Comparison> {
    let strain = |c: &Comparison| {
        let allowed = c.reference.as_ref().map_or(0.0, |r| c.tolerance.around(r.value));
        c.deviation.map_or(f64::INFINITY, |d| d.abs() / allowed.max(f64::MIN_POSITIVE))
    };
    let mut all: Vec<&Comparison> = report.comparisons.iter().filter(|c| c.deviation != Some(0.0)).collect();
    all.sort_by(|a, b| b.verdict.cmp(&a.verdict).then(strain(b).total_cmp(&strain(a))));
    // One of each kind: twenty meters that fail alike are one finding.
    let kind = |c: &Comparison| {
        (c.key.procedure.clone(), c.key.engine.clone(), c.reference.as_ref().map(|r| r.basis), c.verdict)
    };
    let mut seen = std::collections::BTreeSet::new();
    all.retain(|c| seen.insert(kind(c)));
    all.truncate(count);
    all
}

/// The report as text for a terminal.
pub fn terminal(report: &Report, style: Style, detail: Detail, folder: Option<&str>) -> String {
    let mut text = String::new();
    let s = &report.summary;
    writeln!(text, "\nluxproof {}: {}", report.tool_version, report.spec.title).ok();
    writeln!(text, "{}\n", engines_line(report)).ok();
    writeln!(text, "{}\n", verdicts(report, style)).ok();
    if detail == Detail::All || !report.is_suite() {
        tables(report, style, &mut text);
    }
    let departures = consensus::lines(report);
    if !departures.is_empty() {
        writeln!(text, "Who departs from the other witnesses, the reference included").ok();
        let most = if detail == Detail::All { usize::MAX } else { BRIEF };
        departures
            .iter()
            .take(most)
            .map(|l| shortened(l, detail))
            .for_each(|line| writeln!(text, "  {line}").unwrap_or_default());
        writeln!(text).ok();
    }
    let worst = worst(report, 5);
    if !worst.is_empty() {
        writeln!(text, "Worst deviations (by verdict, then deviation over tolerance)").ok();
        for c in worst {
            let case = if report.is_suite() { format!("{}: ", c.key.case) } else { String::new() };
            writeln!(text, "  {}", shortened(&format!("{case}{}", deviation_line(c)), detail)).ok();
        }
        writeln!(text).ok();
    }
    baseline(report, detail, &mut text);
    match detail {
        Detail::All => notes(report, &mut text),
        Detail::Brief => brief_notes(report, &mut text),
    }
    writeln!(
        text,
        "{} passed, {} failed, {} undecided, {} known deviations, {} unexpected passes, {} missing, {} skipped in {:.1} s",
        s.pass, s.fail, s.inconclusive, s.known_deviation, s.unexpected_pass, s.missing, s.skipped, report.wall_s
    )
    .ok();
    if let Some(folder) = folder {
        writeln!(text, "files: {folder}/report.json, readings/, scenes/<engine>/, logs/").ok();
    }
    text
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

/// Papers' tables, readings side by side, methods apart from renderers.
fn tables(report: &Report, style: Style, text: &mut String) {
    for grid in paper::grids(report).into_iter().chain(paper_split::grid(report)) {
        writeln!(text, "{}\n", drawn(&grid, style)).ok();
    }
    // In a suite the readings of a procedure are those of many rooms: they stay in the files.
    let in_paper = |p: &ProcedureId| report.published.iter().any(|t| t.procedure == *p);
    for procedure in report.procedures().into_iter().filter(|p| !report.is_suite() && !in_paper(p)) {
        if let Some(table) = readings(report, procedure, style) {
            writeln!(text, "{table}\n").ok();
        }
    }
    let splits = split::widest(report);
    if !splits.is_empty() {
        writeln!(text, "Methods apart from renderers (where they differ most)").ok();
        for split in splits {
            writeln!(text, "  {}: {}", split::place(report, split), split.text).ok();
        }
        writeln!(text).ok();
    }
}

fn engines_line(report: &Report) -> String {
    let of = |e: &crate::record::EngineStatus| match (e.status, &e.version) {
        (Status::Ran, Some(version)) => format!("{} {version} ({:.1} s)", e.id, e.wall_s),
        (Status::Failed, Some(version)) => format!("{} {version} FAILED", e.id),
        (Status::Absent, _) => format!("{} absent", e.id),
        _ => format!("{} skipped", e.id),
    };
    report.engines.iter().map(of).collect::<Vec<_>>().join(" · ")
}

fn table() -> Table {
    let mut table = Table::new();
    table.load_style(presets::NOTHING).set_content_arrangement(ContentArrangement::Disabled);
    table
}

/// Colours are decided by the caller, not guessed from the stream.
fn finish(mut table: Table, style: Style) -> String {
    match style {
        Style::Plain => table.force_no_tty(),
        Style::Colour => table.enforce_styling(),
    };
    let text = table.to_string();
    text.lines().map(str::trim_end).collect::<Vec<_>>().join("\n")
}

fn header(words: impl IntoIterator<Item = String>) -> Vec<TableCell> {
    words.into_iter().map(|w| TableCell::new(w).add_attribute(Attribute::Bold)).collect()
}

fn verdicts(report: &Report, style: Style) -> String {
    let mut table = table();
    let engines = report.engines.iter().map(|e| e.id.to_string());
    let heads = if report.is_suite() { &["Verdicts", "procedure", "against"][..] } else { &["Verdicts", "against"] };
    table.set_header(header(heads.iter().map(|h| (*h).to_owned()).chain(engines)));
    let mut case = String::new();
    for row in matrix(report) {
        let first = row.case != case;
        case.clone_from(&row.case);
        let cells = row.cells.iter().map(|cell| {
            let text = TableCell::new(cell.text());
            cell.colour().map_or(text.clone(), |colour| text.fg(colour))
        });
        // A case is named once, in front of its first row.
        let case = TableCell::new(if first { row.case.as_str() } else { "" }).add_attribute(Attribute::Bold);
        let case = report.is_suite().then_some(case);
        let heads = [TableCell::new(row.procedure), TableCell::new(row.basis)];
        table.add_row(case.into_iter().chain(heads).chain(cells));
    }
    finish(table, style)
}

/// The readings of one procedure, engines side by side.
fn readings(report: &Report, procedure: ProcedureId, style: Style) -> Option<String> {
    let records: Vec<&ReadingRecord> = report.readings.iter().filter(|r| r.key.procedure == procedure).collect();
    let unit = records.first()?.reading.quantity.unit();
    let mut meters: Vec<_> = vec![];
    for record in &records {
        if !meters.contains(&&record.reading.meter) {
            meters.push(&record.reading.meter);
        }
    }
    if meters.len() > LISTED_METERS {
        return None;
    }
    let engines: Vec<&str> =
        report.engines.iter().map(|e| e.id.as_str()).filter(|e| records.iter().any(|r| r.key.engine == *e)).collect();
    let mut table = table();
    let heads = [format!("{procedure} [{unit}]")].into_iter().chain(engines.iter().map(|e| (*e).to_owned()));
    table.set_header(header(heads));
    for meter in meters {
        let of = |engine: &&str| records.iter().find(|r| r.reading.meter == *meter && r.key.engine == **engine);
        let values = engines.iter().map(|e| of(e).map_or("-".to_owned(), |r| value(r)));
        table.add_row([place(report, procedure, &meter.0)].into_iter().chain(values));
    }
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    Some(finish(table, style))
}

/// A table of a paper with ours beside it.
fn drawn(grid: &paper::Grid, style: Style) -> String {
    let mut table = table();
    table.set_header(header(grid.head.iter().cloned()));
    for row in &grid.rows {
        table.add_row(row.iter().map(TableCell::new));
    }
    let places = 1..grid.head.len() - 1;
    for (_, column) in table.column_iter_mut().enumerate().filter(|(k, _)| places.contains(k)) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    format!("{}\n{}", grid.title, finish(table, style))
}

/// The column's name within a published source, "TITLE, TABLE, COLUMN: MEANING"; titles may hold colons.
pub(super) fn published_column(source: &str) -> &str {
    let (head, _) = source.rsplit_once(": ").unwrap_or((source, ""));
    head.rsplit(", ").next().unwrap_or(head)
}

fn place(report: &Report, procedure: ProcedureId, meter: &str) -> String {
    let c = report.comparisons.iter().find(|c| c.key.procedure == procedure && c.meter.0 == meter);
    match c.and_then(|c| c.gamma_deg.zip(c.c_deg)) {
        Some((gamma, plane)) => format!("  C {plane} gamma {gamma}"),
        None => c.map_or(format!("  {meter}"), |c| format!("  {meter} ({}, {}, {})", c.at_m[0], c.at_m[1], c.at_m[2])),
    }
}

/// Six significant digits, and the standard error in the last two digits that it reaches: `0.9431(12)`.
pub(super) fn value(record: &ReadingRecord) -> String {
    match record.reading.uncertainty.standard_error() {
        Some(e) if e > 0.0 && record.reading.value > 0.0 => {
            let decimals = (1.0 - e.log10().floor()).clamp(0.0, 9.0) as usize;
            let in_units = (e * 10f64.powf(decimals as f64)).round();
            format!("{:.decimals$}({in_units})", record.reading.value)
        }
        _ => significant(record.reading.value),
    }
}

/// Six significant digits.
pub(super) fn significant(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let decimals = (5.0 - value.abs().log10().floor()).clamp(0.0, 9.0) as usize;
    format!("{value:.decimals$}")
}

/// A relative deviation with a sign and two significant digits; rounding noise is shown as zero.
pub(super) fn percent(deviation: f64) -> String {
    let percent = 100.0 * deviation;
    match percent.abs() {
        p if p < 5e-8 => "0 %".to_owned(),
        p if p < 0.001 => format!("{percent:+.0e} %"),
        p if p < 1.0 => format!("{percent:+.3} %"),
        _ => format!("{percent:+.1} %"),
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
        "{:<9} {} {} {} {} against {against}{deviation}{why}",
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

/// Failures and skips, those of a kind on one line, and how much more there is.
fn brief_notes(report: &Report, text: &mut String) {
    let mut groups: BTreeMap<(String, String), std::collections::BTreeSet<(&str, ProcedureId)>> = BTreeMap::new();
    for r in &report.recordings {
        if let Some(failure) = &r.failure {
            let what = format!(": {}", failure.lines().next().unwrap_or_default());
            groups
                .entry((format!("{} failed", r.key.engine), what))
                .or_default()
                .insert((&r.key.case, r.key.procedure));
        }
    }
    for skip in &report.skips {
        let saved = skip.saved.as_ref().map(|s| format!(" (saves {s})")).unwrap_or_default();
        let key = (skipped(&skip.key.engine), format!(": {}{saved}", skip.reason));
        groups.entry(key).or_default().insert((&skip.key.case, skip.key.procedure));
    }
    for ((head, what), jobs) in groups.iter().take(2 * BRIEF) {
        let place = match jobs.iter().collect::<Vec<_>>()[..] {
            [(case, procedure)] if report.is_suite() => format!("{procedure} of {case}"),
            [(_, procedure)] => procedure.to_string(),
            _ => format!("{} jobs", jobs.len()),
        };
        writeln!(text, "  {}", shortened(&format!("{head} in {place}{what}"), Detail::Brief)).ok();
    }
    let more = groups.len().saturating_sub(2 * BRIEF);
    let notes: usize = report.recordings.iter().map(|r| r.notes.len() + usize::from(r.approximation.is_some())).sum();
    let counts =
        [(more, "more skips"), (notes, "notes and approximations"), (report.published.len(), "published tables")];
    let counts: Vec<String> = counts.iter().filter(|(n, _)| *n > 0).map(|(n, what)| format!("{n} {what}")).collect();
    if !counts.is_empty() {
        writeln!(text, "  {}: --all", counts.join(", ")).ok();
    }
    writeln!(text).ok();
}

/// Who is skipped: what concerns every engine alike names none.
fn skipped(engine: &str) -> String {
    if crate::plan::EVERYONE == *engine { "skipped".to_owned() } else { format!("skipped {engine}") }
}

fn notes(report: &Report, text: &mut String) {
    // The cases that each line is about: what holds for one alone is told with its name.
    let mut lines: BTreeMap<String, Vec<&str>> = BTreeMap::new();
    for recording in &report.recordings {
        let of = format!("{} {}", recording.key.engine, recording.key.procedure);
        let mut note = |line: String| lines.entry(line).or_default().push(&recording.key.case);
        if let Some(approximation) = &recording.approximation {
            note(format!("{of}: approximate, {approximation}"));
        }
        // What the approximation says already need not be said again.
        let said = |note: &&String| recording.approximation.as_ref().is_some_and(|a| a.contains(note.as_str()));
        recording.notes.iter().filter(|n| !said(n)).for_each(|n| note(format!("{}: {n}", recording.key.engine)));
        if let Some(failure) = &recording.failure {
            note(format!("{of} failed: {}", failure.lines().next().unwrap_or_default()));
        }
    }
    for skip in &report.skips {
        let saved = skip.saved.as_ref().map(|s| format!(" (saves {s})")).unwrap_or_default();
        let line = format!("{} in {}: {}{saved}", skipped(&skip.key.engine), skip.key.procedure, skip.reason);
        lines.entry(line).or_default().push(&skip.key.case);
    }
    for (line, cases) in &mut lines {
        cases.dedup();
        let place = match cases[..] {
            [one] if report.is_suite() => format!("{one}: "),
            [_] => String::new(),
            _ => format!("{} cases: ", cases.len()),
        };
        writeln!(text, "  {place}{line}").ok();
    }
    if !lines.is_empty() {
        writeln!(text).ok();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::{MeterId, Quantity};
    use crate::record::{Reading, Uncertainty};

    fn reading(value: f64, std_error: Option<f64>) -> ReadingRecord {
        ReadingRecord {
            key: ReadingKey::new("c", ProcedureId::DirectIlluminance, "e"),
            model: "point".into(),
            reading: Reading {
                meter: MeterId::new("m", 0),
                quantity: Quantity::Illuminance,
                value,
                uncertainty: std_error.map_or(Uncertainty::Exact, |e| Uncertainty::sampled(e, None)),
            },
        }
    }

    #[test]
    fn values_show_the_digits_they_deserve() {
        assert_eq!(value(&reading(0.943_147, Some(0.001_2))), "0.9431(12)");
        assert_eq!(value(&reading(1234.5678, Some(0.0))), "1234.57");
        assert_eq!(value(&reading(0.0, None)), "0");
    }

    #[test]
    fn the_published_column_is_found_behind_a_title_with_a_colon() {
        let source = "Simulation of Luminaires in Radiance: Verification Method, Table 2, lum1: Flat polygon, of light";
        assert_eq!(published_column(source), "lum1");
    }
}
