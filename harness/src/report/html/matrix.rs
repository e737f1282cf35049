//! The verdict matrix: case, procedure and basis by engine; each cell opens the readings that it stands for.

use itertools::Itertools;
use maud::{Markup, html};

use super::super::Report;
use super::super::matrix::{Cell, Row, matrix};
use super::palette::Palette;
use super::{Pages, class, glyph, percent};
use crate::judge::Verdict;
use crate::record::ProcedureId;

pub(super) fn section(report: &Report, palette: &Palette, pages: Option<&Pages<'_>>) -> Markup {
    let rows = matrix(report);
    let drawn = pages.map_or_else(|| rows.iter().collect(), |pages| pages.worst(&rows));
    html! {
        h2 id="matrix-title" { "Verdicts" }
        p.lead {
            "Each cell is the worst verdict of its readings, how many of them it holds for, and the largest deviation. "
            @if pages.is_some() { "A cell leads to the first of these on the pages of all readings." } @else { "A cell opens its readings." }
        }
        (table(report, &drawn, palette, &|cell, key| match pages {
            Some(pages) => linked(cell, key, &pages.link_to(cell.first)),
            None => opening(cell, key),
        }))
        @if let Some(pages) = pages { (pages.other_rows(drawn.len(), rows.len())) }
        ul.legend {
            @for verdict in [Verdict::Pass, Verdict::NotJudged, Verdict::KnownDeviation, Verdict::Inconclusive, Verdict::Fail, Verdict::UnexpectedPass, Verdict::Missing] {
                li class={ "v-" (class(verdict)) } { span.glyph aria-hidden="true" { (glyph(verdict)) } " " (verdict.name()) }
            }
        }
    }
}

/// The rows as a table; `judged` draws what leads from a cell to its readings.
pub(super) fn table(
    report: &Report,
    rows: &[&Row],
    palette: &Palette,
    judged: &dyn Fn(&Judged<'_>, [&str; 3]) -> Markup,
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
                                th scope="row" { (row.procedure.row().title) }
                                td.basis { (row.basis) }
                                @for (engine, cell) in report.engines.iter().zip(&row.cells) {
                                    (drawn(cell, row.procedure, [case, row.basis, &engine.id], judged))
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

/// A cell that has readings.
pub(super) struct Judged<'a> {
    pub(super) first: usize,
    procedure: ProcedureId,
    verdict: Verdict,
    words: &'a Markup,
}

fn drawn(
    cell: &Cell,
    procedure: ProcedureId,
    key: [&str; 3],
    judged: &dyn Fn(&Judged<'_>, [&str; 3]) -> Markup,
) -> Markup {
    match cell {
        Cell::IsReference => html! { td.quiet data-engine=(key[2]) { "reference" } },
        Cell::Skipped => html! { td.quiet data-engine=(key[2]) { a href="#notes" { "skipped" } } },
        Cell::Empty => html! { td.quiet.empty { "–" } },
        Cell::Judged { verdict, having, of, deviation, first } => {
            let [_, basis, engine] = key;
            let words = &html! {
                span.unseen { (engine) ", " (procedure.row().title) " against " (basis) ": " (verdict.name()) " " }
                span.glyph aria-hidden="true" { (glyph(*verdict)) } " "
                span.count { @if having == of { (of) } @else { (having) "/" (of) } }
                @if let Some(deviation) = deviation { span.most { (percent(*deviation)) } }
            };
            judged(&Judged { first: *first, procedure, verdict: *verdict, words }, key)
        }
    }
}

fn opening(cell: &Judged<'_>, [case, basis, engine]: [&str; 3]) -> Markup {
    html! {
        td class={ "v-" (class(cell.verdict)) } data-engine=(engine) {
            button.open type="button" data-case=(case) data-procedure=(cell.procedure) data-basis=(basis) data-engine=(engine){ (cell.words) }
        }
    }
}

pub(super) fn linked(cell: &Judged<'_>, [.., engine]: [&str; 3], to: &str) -> Markup {
    html! { td class={ "v-" (class(cell.verdict)) } data-engine=(engine) { a.to href=(to) { (cell.words) } } }
}
