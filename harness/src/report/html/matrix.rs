//! The verdict matrix: case, procedure and basis by engine; each cell opens the readings that it stands for.

use itertools::Itertools;
use maud::{Markup, html};

use super::super::Report;
use super::super::matrix::{Cell, matrix};
use super::palette::Palette;
use super::{class, glyph, percent};
use crate::judge::Verdict;
use crate::record::ProcedureId;

pub(super) fn section(report: &Report, palette: &Palette) -> Markup {
    let rows = matrix(report);
    let cases: Vec<&str> = rows.iter().map(|r| r.case.as_str()).dedup().collect();
    html! {
        h2 id="matrix-title" { "Verdicts" }
        p.lead {
            "Each cell is the worst verdict of its readings, how many of them it holds for, and the largest deviation. "
            "A cell opens its readings."
        }
        div.scroll tabindex="0" role="region" aria-label="Verdict matrix" {
            table.matrix {
                thead { tr {
                    th scope="col" { "procedure" } th scope="col" { "against" }
                    @for engine in &report.engines { th scope="col" { (palette.label(&engine.id)) } }
                } }
                @for case in cases {
                    tbody {
                        @if report.is_suite() {
                            tr.case { th scope="rowgroup" colspan=(report.engines.len() + 2) { (case) } }
                        }
                        @for row in rows.iter().filter(|r| r.case == case) {
                            tr {
                                th scope="row" { (row.procedure.row().title) }
                                td.basis { (row.basis) }
                                @for (engine, cell) in report.engines.iter().zip(&row.cells) {
                                    (drawn(cell, row.procedure, [case, row.basis, &engine.id]))
                                }
                            }
                        }
                    }
                }
            }
        }
        ul.legend {
            @for verdict in [Verdict::Pass, Verdict::NotJudged, Verdict::KnownDeviation, Verdict::Inconclusive, Verdict::Fail, Verdict::UnexpectedPass, Verdict::Missing] {
                li class={ "v-" (class(verdict)) } { span.glyph aria-hidden="true" { (glyph(verdict)) } " " (verdict.name()) }
            }
        }
    }
}

fn drawn(cell: &Cell, procedure: ProcedureId, [case, basis, engine]: [&str; 3]) -> Markup {
    match cell {
        Cell::IsReference => html! { td.quiet { "reference" } },
        Cell::Skipped => html! { td.quiet { a href="#notes" { "skipped" } } },
        Cell::Empty => html! { td.quiet { "–" } },
        Cell::Judged { verdict, having, of, deviation } => html! {
            td class={ "v-" (class(*verdict)) } {
                button.open type="button" data-case=(case) data-procedure=(procedure) data-basis=(basis) data-engine=(engine){
                    span.unseen { (engine) ", " (procedure.row().title) " against " (basis) ": " (verdict.name()) " " }
                    span.glyph aria-hidden="true" { (glyph(*verdict)) } " "
                    span.count { @if having == of { (of) } @else { (having) "/" (of) } }
                    @if let Some(deviation) = deviation { span.most { (percent(*deviation)) } }
                }
            }
        },
    }
}
