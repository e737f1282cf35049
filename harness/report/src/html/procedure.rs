//! One procedure: its meaning, plots, and every reading in a table that can be filtered.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use itertools::Itertools;
use maud::{Markup, html};

use super::super::matrix::sort_worst_first;
use super::super::notes::biases;
use super::super::papers;
use super::super::symmetry;
use super::super::words::{off, plural, significant};
use super::palette::Palette;
use super::plot::{self, Marks};
use super::rows::{Rows, place};
use super::{Pages, class, glyph, minus, percent, rest, shown, statistics};
use luxproof_model::Comparison;
use luxproof_model::Report;
use luxproof_model::{EngineName, Exit, ProcedureId, ReadingKey};
use luxproof_process::process::quoted;

/// Rows that are shown at first.
const FIRST_ROWS: usize = 12;
/// Further rows of a procedure are only in report.json, because the file must open on a telephone.
const MAX_ROWS: usize = 3000;
/// Rows of each engine in a long report, which has all readings on further pages.
const MAX_ROWS_OF_ENGINE: usize = 100;

pub(super) fn section(
    report: &Report,
    procedure: ProcedureId,
    palette: &Palette,
    rows: &mut Rows,
    pages: Option<&Pages<'_>>,
) -> Markup {
    let numbered = report.comparisons.iter().enumerate();
    let mut mine: Vec<(usize, &Comparison)> = numbered.filter(|(_, c)| c.key.procedure == procedure).collect();
    let plots = plot::panels(report, &plot::groups(report, procedure), palette, Marks::for_pages(pages));
    sort_worst_first(&mut mine, |(_, c)| *c);
    let all = mine.len();
    if pages.is_some() {
        let mut of_engine: BTreeMap<&EngineName, usize> = BTreeMap::new();
        mine.retain(|(_, c)| {
            let count = of_engine.entry(&c.key.engine).or_default();
            *count += 1;
            *count <= MAX_ROWS_OF_ENGINE
        });
    }
    mine.truncate(MAX_ROWS);
    let count = plural(all, "comparison");
    let is_folded = procedure.is_calibration() && mine.iter().all(|(_, c)| Exit::of(c.verdict) == Exit::Passed);
    let body = html! {
        p.lead { (procedure.meaning()) }
        @if !plots.is_empty() { div.panels { @for panel in plots { (panel) } } }
        @for table in report.published.iter().filter(|t| t.procedure == procedure) { (printed_table(&papers::grid(report, table))) }
        @let biases = biases(report, procedure);
        @if !biases.is_empty() {
            details { summary { "Mean error per engine (with interval and p-value)" }
                ul.notes { @for line in shown(&biases, pages) { li { (minus(line)) } } }
                (rest(&biases, pages, "bias"))
            }
        }
        @if let Some(sets) = statistics::table(report, procedure, palette, pages) { (sets) }
        @if all == 0 {
            p { "Nothing was compared." }
        } @else {
            (table(report, procedure, &mine, palette, rows, pages))
            @if pages.is_some() {
                p.quiet { "The worst " (MAX_ROWS_OF_ENGINE) " of each engine, " (mine.len()) " of " (all) " readings; every reading is on the " a href="#pages" { "pages" } "." }
            } @else if all > MAX_ROWS { p.quiet { "The worst " (MAX_ROWS) " of " (all) " readings; all are in report.json." } }
        }
    };
    let title = html! { h2 id={ (procedure) "-title" } { (procedure.title()) } };
    html! {
        @if is_folded {
            details.fold { summary { (title) span.quiet { "passed, " (count) } } (body) }
        } @else { (title) (body) }
    }
}

/// The points of each job that follow by symmetry, with the rendered points that they mirror.
type MirroredPoints<'a> = HashMap<&'a ReadingKey, BTreeMap<&'a str, &'a str>>;

fn mirrored_points(report: &Report, procedure: ProcedureId) -> MirroredPoints<'_> {
    let recordings = report.recordings.iter().filter(|r| r.key.procedure == procedure);
    recordings.map(|r| (&r.key, symmetry::mirrored_points(&r.effort))).collect()
}

/// The readings with their filters.
fn table(
    report: &Report,
    procedure: ProcedureId,
    mine: &[(usize, &Comparison)],
    palette: &Palette,
    rows: &mut Rows,
    pages: Option<&Pages<'_>>,
) -> Markup {
    let suite = report.is_suite();
    let mirrored = mirrored_points(report, procedure);
    html! {
        h3 { "Readings" }
        div.readings data-procedure=(procedure) data-first=(FIRST_ROWS) {
            (filters(report, procedure, &mine.iter().map(|(_, c)| *c).collect_vec(), palette))
            div.scroll tabindex="0" role="region" aria-label={ "Readings of " (procedure.title()) } {
                table {
                    thead { tr {
                        (head("engine", "e", "")) @if suite { (head("case", "c", "")) } (head("meter", "m", "")) (head("reading", "v", "number")) (head("reference", "r", "number"))
                        (head("against", "b", "")) (head("deviation", "d", "number")) (head("of tolerance", "s", "")) (head("verdict", "x", ""))
                        th scope="col" { span.unseen { "error budget" } }
                    } }
                    tbody {
                        @for (k, (place, c)) in mine.iter().enumerate() {
                            @let link = pages.map(|pages| pages.link_to(*place));
                            @let source = mirrored.get(&c.key).and_then(|points| points.get(c.meter.0.as_str())).copied();
                            (row(report, c, rows.add(c, palette), k >= FIRST_ROWS, palette, (link.as_deref(), source)))
                        }
                    }
                }
            }
            p.shown aria-live="polite" { (mine.len().min(FIRST_ROWS)) " of " (mine.len()) " readings, the worst first" }
            @if mine.len() > FIRST_ROWS { button.all type="button" aria-pressed="false" { "Show all" } }
        }
    }
}

/// A heading that sorts the table.
fn head(name: &str, key: &str, class: &str) -> Markup {
    html! { th scope="col" class={ "c-" (key) " " (class) } { button.sort type="button" data-key=(key) { (name) } } }
}

/// A row of the table; `source` is the rendered point from which the value follows by symmetry.
fn row(
    report: &Report,
    c: &Comparison,
    number: usize,
    hidden: bool,
    palette: &Palette,
    (link, source): (Option<&str>, Option<&str>),
) -> Markup {
    let suite = report.is_suite();
    let unit = c.quantity.unit();
    html! {
        tr data-row=(number) hidden[hidden] {
            td { (palette.label(&c.key.engine)) }
            @if suite { td.c-c { (c.key.case) } }
            td {
                @if let Some(link) = link { a href=(link) { (c.meter) } } @else { (c.meter) }
                " " span.place { (place(c)) }
                @if let Some(source) = source { " " span.symmetry { "= " (source) " by symmetry" } }
            }
            td.number.c-v { (number_or_dash(c.value)) " " span.unit { (unit) } }
            td.number.c-r { (number_or_dash(c.reference.as_ref().map(|r| r.value))) " " span.unit { (unit) } }
            td.c-b { (c.basis_name()) }
            td.number { (off(c, percent).unwrap_or("–".to_owned())) }
            td.c-s { (tolerance_bar(c)) }
            td class={ "v-" (class(c.verdict)) } { span.glyph aria-hidden="true" { (glyph(c.verdict)) } " " span.word { (c.verdict.name()) }
                @if c.verdict.is_bad() { details.repeat { summary { "repeat" } code { (repeat_command(report, c)) } } }
            }
            td { button.more type="button" aria-label={ "Error budget of " (c.key.engine) " at " (c.meter) } { "budget" } }
        }
    }
}

fn number_or_dash(value: Option<f64>) -> String {
    value.map_or("–".to_owned(), significant)
}

/// The command that repeats a reading.
fn repeat_command(report: &Report, c: &Comparison) -> String {
    if c.key.procedure.is_calibration() {
        return format!("luxproof engines doctor {}", quoted(&c.key.engine));
    }
    let case = report.cases.iter().find(|case| case.name == c.key.case);
    let spec = case.map_or(report.spec.path.as_str(), |case| case.spec.path.as_str());
    let filter = if c.key.case.contains('/') { format!(" --filter {}", quoted(&c.key.case)) } else { String::new() };
    let (spec, engine) = (quoted(spec), quoted(&c.key.engine));
    format!("luxproof run {spec}{filter} --engines {engine} --procedures {} --no-cache --out again", c.key.procedure)
}

/// A bar: how much of the tolerance a deviation takes, to either side.
fn tolerance_bar(c: &Comparison) -> Markup {
    let Some(error) = c.normalized_error() else { return html! { "–" } };
    let width = error.abs().min(1.0) * 50.0;
    let left = if error < 0.0 { 50.0 - width } else { 50.0 };
    let over = if error.abs() > 1.0 { "over" } else { "" };
    html! { span.of-tolerance role="img" aria-label={ (format!("{:.0}", 100.0 * error)) " % of the tolerance" } { i class=(over) style=(format!("left:{left:.1}%;width:{width:.1}%")) {} } }
}

/// The form that filters the readings of a procedure.
fn filters(report: &Report, procedure: ProcedureId, mine: &[&Comparison], palette: &Palette) -> Markup {
    // In the order of the report.
    let mut cases: Vec<&str> = mine.iter().map(|c| c.key.case.as_str()).collect();
    cases.sort_by_key(|case| report.cases.iter().position(|c| c.name == *case));
    cases.dedup();
    let bases: BTreeSet<&str> = mine.iter().map(|c| c.basis_name()).collect();
    let verdicts = mine.iter().map(|c| c.verdict).counts();
    let verdicts = verdicts.into_iter().sorted().map(|(v, count)| (v.name(), format!("{} ({count})", v.name())));
    html! {
        form.filters aria-label={ "Filter the readings of " (procedure.title()) } {
            fieldset { legend { "Engines" }
                @for engine in report.engines.iter().filter(|e| mine.iter().any(|c| c.key.engine == e.id)) {
                    label.chip { input type="checkbox" checked value=(engine.id) data-filter="engine"; (palette.label(&engine.id)) }
                }
            }
            @if cases.len() > 1 { (choice("case", "Case", cases.into_iter().map(|case| (case, case.to_owned())))) }
            @if bases.len() > 1 { (choice("basis", "Against", bases.into_iter().map(|basis| (basis, basis.to_owned())))) }
            (choice("verdict", "Verdict", verdicts))
            label { "Meter " input type="search" data-filter="meter" placeholder="name or place" size="14"; }
            button.reset type="reset" { "Reset" }
        }
    }
}

/// A choice among values, given with their text.
fn choice<'a>(name: &str, label: &str, options: impl Iterator<Item = (&'a str, String)>) -> Markup {
    html! { label { (label) " " select data-filter=(name) {
        option value="" { "all" }
        @for (value, text) in options { option value=(value) { (text) } }
    } } }
}

/// A published table with our readings below it.
fn printed_table(grid: &papers::Grid) -> Markup {
    html! {
        details.printed { summary { (grid.head[0]) " of “" (grid.title) "”, with our readings" }
            div.scroll tabindex="0" role="region" aria-label=(grid.head[0]) {
                table {
                    thead { tr { @for (k, word) in grid.head.iter().enumerate() { th scope="col" class=(if k == 0 || k + 1 == grid.head.len() { "" } else { "number" }) { (word) } } } }
                    tbody { @for cells in &grid.rows { tr {
                        @for (k, cell) in cells.iter().enumerate() {
                            @if k == 0 { th scope="row" { (cell) } } @else if k + 1 == cells.len() { td { (minus(cell)) } } @else { td.number { (cell) } }
                        }
                    } } }
                }
            }
        }
    }
}
