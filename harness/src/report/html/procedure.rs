//! One procedure: what it asks, plots where people would rather look, and every reading in a table that can be filtered.

use std::collections::{BTreeMap, BTreeSet};

use itertools::Itertools;
use maud::{Markup, html};

use super::super::matrix::sort_worst_first;
use super::super::notes::biases;
use super::super::words::{off, significant};
use super::super::{Report, papers};
use super::palette::Palette;
use super::plot::{self, Marks};
use super::rows::{Rows, place};
use super::{Pages, class, glyph, minus, percent, rest, shown, statistics};
use crate::judge::{Comparison, Verdict};
use crate::record::{EngineName, ProcedureId};
use crate::system::process::quoted;

/// Rows shown until all are asked for.
const FIRST: usize = 12;
/// More rows than this a procedure stay in report.json: the file must open on a telephone.
const MOST: usize = 3000;
/// So many of each engine where the others have pages of their own.
const MOST_OF_ENGINE: usize = 100;

pub(super) fn section(
    report: &Report,
    procedure: ProcedureId,
    palette: &Palette,
    rows: &mut Rows,
    pages: Option<&Pages<'_>>,
) -> Markup {
    let numbered = report.comparisons.iter().enumerate();
    let mut mine: Vec<(usize, &Comparison)> = numbered.filter(|(_, c)| c.key.procedure == procedure).collect();
    let marks = if pages.is_some() { Marks::Seen } else { Marks::Every };
    let plots = plot::panels(report, &plot::groups(report, procedure), palette, marks);
    sort_worst_first(&mut mine, |(_, c)| *c);
    let all = mine.len();
    if pages.is_some() {
        let mut of_engine: BTreeMap<&EngineName, usize> = BTreeMap::new();
        mine.retain(|(_, c)| {
            let count = of_engine.entry(&c.key.engine).or_default();
            *count += 1;
            *count <= MOST_OF_ENGINE
        });
    }
    mine.truncate(MOST);
    html! {
        h2 id={ (procedure) "-title" } { (procedure.row().title) }
        p.lead { (procedure.row().meaning) }
        @if !plots.is_empty() { div.panels { @for panel in plots { (panel) } } }
        @for table in report.published.iter().filter(|t| t.procedure == procedure) { (printed(&papers::grid(report, table))) }
        @let biases = biases(report, procedure);
        @if !biases.is_empty() {
            details { summary { "Bias: mean deviation, its interval, p of none" }
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
                p.quiet { "The worst " (MOST_OF_ENGINE) " of each engine, " (mine.len()) " of " (all) " readings; every reading is on the " a href="#pages" { "pages" } "." }
            } @else if all > MOST { p.quiet { "The worst " (MOST) " of " (all) " readings; all are in report.json." } }
        }
    }
}

fn table(
    report: &Report,
    procedure: ProcedureId,
    mine: &[(usize, &Comparison)],
    palette: &Palette,
    rows: &mut Rows,
    pages: Option<&Pages<'_>>,
) -> Markup {
    let suite = report.is_suite();
    html! {
        h3 { "Readings" }
        div.readings data-procedure=(procedure) data-first=(FIRST) {
            (filters(report, procedure, &mine.iter().map(|(_, c)| *c).collect_vec(), palette))
            div.scroll tabindex="0" role="region" aria-label={ "Readings of " (procedure.row().title) } {
                table {
                    thead { tr {
                        (head("engine", "e", "")) @if suite { (head("case", "c", "")) } (head("meter", "m", "")) (head("reading", "v", "number")) (head("reference", "r", "number"))
                        (head("against", "b", "")) (head("deviation", "d", "number")) (head("of tolerance", "s", "")) (head("verdict", "x", ""))
                        th scope="col" { span.unseen { "error budget" } }
                    } }
                    tbody {
                        @for (k, (place, c)) in mine.iter().enumerate() {
                            @let link = pages.map(|pages| pages.link_to(*place));
                            (row(report, c, rows.add(c, palette), k >= FIRST, palette, link.as_deref()))
                        }
                    }
                }
            }
            p.shown aria-live="polite" { (mine.len().min(FIRST)) " of " (mine.len()) " readings, the worst first" }
            @if mine.len() > FIRST { button.all type="button" aria-pressed="false" { "Show all" } }
        }
    }
}

fn head(name: &str, key: &str, class: &str) -> Markup {
    html! { th scope="col" class={ "c-" (key) " " (class) } { button.sort type="button" data-key=(key) { (name) } } }
}

fn row(report: &Report, c: &Comparison, number: usize, hidden: bool, palette: &Palette, link: Option<&str>) -> Markup {
    let suite = report.is_suite();
    let unit = c.quantity.unit();
    let value = |v: Option<f64>| v.map_or("–".to_owned(), significant);
    html! {
        tr data-row=(number) hidden[hidden] {
            td { (palette.label(&c.key.engine)) }
            @if suite { td.c-c { (c.key.case) } }
            td {
                @if let Some(link) = link { a href=(link) { (c.meter) } } @else { (c.meter) }
                " " span.place { (place(c)) }
            }
            td.number.c-v { (value(c.value)) " " span.unit { (unit) } }
            td.number.c-r { (value(c.reference.as_ref().map(|r| r.value))) " " span.unit { (unit) } }
            td.c-b { (c.basis_name()) }
            td.number { (off(c, percent).unwrap_or("–".to_owned())) }
            td.c-s { (bar(c)) }
            td class={ "v-" (class(c.verdict)) } { span.glyph aria-hidden="true" { (glyph(c.verdict)) } " " span.word { (c.verdict.name()) }
                @if c.verdict.is_bad() { details.repeat { summary { "repeat" } code { (repeat(report, c)) } } }
            }
            td { button.more type="button" aria-label={ "Error budget of " (c.key.engine) " at " (c.meter) } { "budget" } }
        }
    }
}

/// The command that reads a reading again.
fn repeat(report: &Report, c: &Comparison) -> String {
    if c.key.procedure.is_known() {
        return format!("luxproof engines doctor {}", quoted(&c.key.engine));
    }
    let case = report.cases.iter().find(|case| case.name == c.key.case);
    let spec = case.map_or(report.spec.path.as_str(), |case| case.spec.path.as_str());
    let filter = if c.key.case.contains('/') { format!(" --filter {}", quoted(&c.key.case)) } else { String::new() };
    let (spec, engine) = (quoted(spec), quoted(&c.key.engine));
    format!("luxproof run {spec}{filter} --engines {engine} --procedures {} --no-cache --out again", c.key.procedure)
}

/// How much of the tolerance a deviation takes, to either side.
fn bar(c: &Comparison) -> Markup {
    let Some(error) = c.normalized_error() else { return html! { "–" } };
    let width = error.abs().min(1.0) * 50.0;
    let left = if error < 0.0 { 50.0 - width } else { 50.0 };
    let over = if error.abs() > 1.0 { "over" } else { "" };
    html! { span.of-tolerance role="img" aria-label={ (format!("{:.0}", 100.0 * error)) " % of the tolerance" } { i class=(over) style=(format!("left:{left:.1}%;width:{width:.1}%")) {} } }
}

fn filters(report: &Report, procedure: ProcedureId, mine: &[&Comparison], palette: &Palette) -> Markup {
    let place = |case: &&str| report.cases.iter().position(|c| c.name == *case);
    let cases: Vec<&str> = mine.iter().map(|c| c.key.case.as_str()).sorted_by_key(place).dedup().collect();
    let bases: BTreeSet<&str> = mine.iter().map(|c| c.basis_name()).collect();
    let verdicts: BTreeSet<Verdict> = mine.iter().map(|c| c.verdict).collect();
    let count = |v: Verdict| mine.iter().filter(|c| c.verdict == v).count();
    let choice = |name: &str, label: &str, options: Vec<(String, String)>| {
        html! { label { (label) " " select data-filter=(name) { option value="" { "all" } @for (value, text) in options { option value=(value) { (text) } } } } }
    };
    let plain = |words: Vec<&str>| words.into_iter().map(|w| (w.to_owned(), w.to_owned())).collect::<Vec<_>>();
    html! {
        form.filters aria-label={ "Filter the readings of " (procedure.row().title) } {
            fieldset { legend { "Engines" }
                @for engine in report.engines.iter().filter(|e| mine.iter().any(|c| c.key.engine == e.id)) {
                    label.chip { input type="checkbox" checked value=(engine.id) data-filter="engine"; (palette.label(&engine.id)) }
                }
            }
            @if cases.len() > 1 { (choice("case", "Case", plain(cases))) }
            @if bases.len() > 1 { (choice("basis", "Against", plain(bases.into_iter().collect()))) }
            (choice("verdict", "Verdict", verdicts.into_iter().map(|v| (v.name().to_owned(), format!("{} ({})", v.name(), count(v)))).collect()))
            label { "Meter " input type="search" data-filter="meter" placeholder="name or place" size="14"; }
            button.reset type="reset" { "Reset" }
        }
    }
}

fn printed(grid: &papers::Grid) -> Markup {
    html! {
        details.printed { summary { (grid.head[0]) " of “" (grid.title) "”, with ours beside it" }
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
