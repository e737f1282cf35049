//! The verdict matrix: case, procedure and basis by engine; each cell opens its readings.

use itertools::Itertools;
use maud::{Markup, html};

use super::super::matrix::{Cell, Row, matrix};
use super::super::symmetry::symmetry_lines;
use super::palette::Palette;
use super::{Pages, class, glyph, minus, percent};
use luxproof_model::Report;
use luxproof_model::Verdict;

pub(super) fn section(report: &Report, palette: &Palette, pages: Option<&Pages<'_>>) -> Markup {
    let rows = matrix(report);
    let shown = pages.map_or_else(|| rows.iter().collect(), |pages| pages.worst(&rows));
    html! {
        h2 id="matrix-title" { "Verdicts" }
        p.lead {
            "Each cell is the worst verdict of its readings, how many of them it holds for, and the largest deviation of all its readings. "
            @if pages.is_some() { "A cell leads to the first of these on the pages of all readings." } @else { "A cell opens its readings." }
        }
        (table(report, &shown, palette, &|cell| match pages {
            Some(pages) => link_cell(cell, &pages.link_to(cell.first)),
            None => button_cell(cell),
        }))
        @if let Some(pages) = pages { (pages.other_rows(shown.len(), rows.len())) }
        @for line in symmetry_lines(report) { p.quiet { (line) } }
        ul.legend {
            @for verdict in [Verdict::Pass, Verdict::NotJudged, Verdict::KnownDeviation, Verdict::Undecided, Verdict::Fail, Verdict::UnexpectedPass, Verdict::Missing] {
                li class={ "v-" (class(verdict)) } { span.glyph aria-hidden="true" { (glyph(verdict)) } " " (verdict.name()) }
            }
        }
    }
}

/// The rows as a table; `draw_judged` draws a cell with a way to its readings.
pub(super) fn table(
    report: &Report,
    rows: &[&Row],
    palette: &Palette,
    draw_judged: &dyn Fn(&JudgedCell<'_>) -> Markup,
) -> Markup {
    let by_case = rows.iter().chunk_by(|row| &*row.case);
    let cases = by_case.into_iter().map(|(case, rows)| (case, rows.collect_vec())).collect_vec();
    html! {
        div.scroll tabindex="0" role="region" aria-label="Verdict matrix" {
            table.matrix {
                thead { tr {
                    th scope="col" { "procedure" } th scope="col" { "against" }
                    @for engine in &report.engines { th scope="col" { (palette.label(&engine.id)) } }
                } }
                @for (case, rows) in cases {
                    tbody {
                        @if report.is_suite() {
                            tr.case { th scope="rowgroup" colspan=(report.engines.len() + 2) { (case) } }
                        }
                        @for row in rows {
                            tr {
                                th scope="row" { (row.procedure.title()) }
                                td.basis { (row.basis) }
                                @for (engine, cell) in report.engines.iter().zip(&row.cells) {
                                    (draw_cell(cell, row, &engine.id, draw_judged))
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

/// A cell with readings.
pub(super) struct JudgedCell<'a> {
    /// The index in the report of the first comparison with the cell's verdict.
    pub(super) first: usize,
    row: &'a Row,
    engine: &'a str,
    verdict: Verdict,
    words: Markup,
}

fn draw_cell(cell: &Cell, row: &Row, engine: &str, draw_judged: &dyn Fn(&JudgedCell<'_>) -> Markup) -> Markup {
    match cell {
        Cell::IsReference => html! { td.quiet data-engine=(engine) { "reference" } },
        Cell::Skipped => html! { td.quiet data-engine=(engine) { a href="#notes" { "skipped" } } },
        Cell::Empty => html! { td.quiet.empty { "–" } },
        Cell::Judged { verdict, having, of, deviation, absolute, first } => {
            let words = html! {
                span.unseen { (engine) ", " (row.procedure.title()) " against " (row.basis) ": " (verdict.name()) " " }
                span.glyph aria-hidden="true" { (glyph(*verdict)) } " "
                span.count { @if having == of { (of) } @else { (having) "/" (of) } }
                @if let Some(deviation) = deviation { span.most { (percent(*deviation)) } }
                @if let Some(absolute) = absolute { span.most { (minus(absolute)) } }
            };
            draw_judged(&JudgedCell { first: *first, row, engine, verdict: *verdict, words })
        }
    }
}

/// A cell that opens its readings on this page.
fn button_cell(cell: &JudgedCell<'_>) -> Markup {
    let Row { case, procedure, basis, .. } = cell.row;
    html! {
        td class={ "v-" (class(cell.verdict)) } data-engine=(cell.engine) {
            button.open type="button" data-case=(case) data-procedure=(procedure) data-basis=(basis) data-engine=(cell.engine){ (cell.words) }
        }
    }
}

/// A cell that leads to its readings on another page.
pub(super) fn link_cell(cell: &JudgedCell<'_>, to: &str) -> Markup {
    html! { td class={ "v-" (class(cell.verdict)) } data-engine=(cell.engine) { a.to href=(to) { (cell.words) } } }
}
