//! What sets of meters come to, engine by engine, and how far that is off the same of the reference.

use itertools::Itertools;
use maud::{Markup, html};

use super::super::Report;
use super::super::words::{estimate, interval_in_percent, significant};
use super::palette::Palette;
use super::{Pages, class, glyph, minus, rest, shown};
use crate::judge::{FigureAgreement, Statistics, StatisticsAgreement};
use crate::record::{Estimate, ProcedureId};

/// Of every set that a procedure asks for; `None` where none has two meters.
pub(super) fn table(
    report: &Report,
    procedure: ProcedureId,
    palette: &Palette,
    pages: Option<&Pages<'_>>,
) -> Option<Markup> {
    let mine = report.statistics.iter().filter(|s| s.key.procedure == procedure).collect_vec();
    let suite = report.is_suite();
    let unit = procedure.row().quantity.unit();
    let names = [format!("mean [{unit}]"), format!("minimum [{unit}]"), "uniformity".into(), "diversity".into()];
    let numbers = names.each_ref().map(|name| format!("number {name}"));
    let heads = ["set of meters", "engine"].into_iter().chain(numbers.iter().map(String::as_str)).collect_vec();
    let rows = html! { @for s in shown(&mine, pages) { tr {
        td { @if suite { (s.key.case) " " } (s.set) " " span.place { "(" (s.meters) " meters)" } }
        td { (palette.label(&s.key.engine)) }
        @for (name, figure) in names.iter().zip(figures(s)) { (cell(name, figure)) }
    } } };
    (!mine.is_empty()).then(|| {
        html! {
            h3 { "Sets of meters" }
            p.quiet { "Uniformity is minimum over mean, diversity minimum over maximum. Below each figure: how far it is off that of the reference, with its interval, and whether that is within the tolerance." }
            @let label = format!("Sets of meters, {}", procedure.row().title);
            div.figures { (super::table(&label, &heads, &rows)) }
            (rest(&mine, pages, "statistics"))
        }
    })
}

/// A figure and how it agrees.
type Figure<'a> = (Option<Estimate>, Option<&'a FigureAgreement>);

fn figures(s: &Statistics) -> [Figure<'_>; 4] {
    let of = |figure: fn(&StatisticsAgreement) -> Option<&FigureAgreement>| s.agreement.as_ref().and_then(figure);
    [
        (Some(s.mean), of(|a| Some(&a.mean))),
        (Some(s.minimum), of(|a| Some(&a.minimum))),
        (s.uniformity, of(|a| a.uniformity.as_ref())),
        (s.diversity, of(|a| a.diversity.as_ref())),
    ]
}

/// `name` is told beside it where a screen is too narrow for a heading.
fn cell(name: &str, (figure, agreement): Figure<'_>) -> Markup {
    html! {
        td.number data-head=(name) {
            (figure.as_ref().map_or("–".to_owned(), estimate))
            @if let Some(agreement) = agreement { (agreed(agreement)) }
        }
    }
}

/// How far a figure is off, and what that comes to.
pub(super) fn agreed(a: &FigureAgreement) -> Markup {
    let relative = a.relative().map(|d| interval_in_percent(d, a.expanded / a.reference.value.abs()));
    let off = minus(&relative.unwrap_or_else(|| significant(a.deviation)));
    html! {
        div class={ "most v-" (class(a.verdict)) } { (off) " " span.glyph aria-hidden="true" { (glyph(a.verdict)) } " " span.word { (a.verdict.name()) } }
    }
}
