//! The figures of sets of meters for each engine, and their deviation from those of the reference.

use itertools::Itertools;
use maud::{Markup, html};

use super::super::words::{estimate, interval_in_percent, significant};
use super::palette::Palette;
use super::{Pages, class, glyph, minus, rest, shown};
use luxproof_model::Report;
use luxproof_model::{Estimate, ProcedureId};
use luxproof_model::{FigureAgreement, Statistics};

/// A table of every set of a procedure; `None` where no set has two meters.
pub(super) fn table(
    report: &Report,
    procedure: ProcedureId,
    palette: &Palette,
    pages: Option<&Pages<'_>>,
) -> Option<Markup> {
    let mine = report.statistics.iter().filter(|s| s.key.procedure == procedure).collect_vec();
    let suite = report.is_suite();
    let unit = procedure.quantity().unit();
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
            @let label = format!("Sets of meters, {}", procedure.title());
            div.figures { (super::table(&label, &heads, &rows)) }
            (rest(&mine, pages, "statistics"))
        }
    })
}

/// A figure and its agreement with the reference.
type Figure<'a> = (Option<Estimate>, Option<&'a FigureAgreement>);

fn figures(s: &Statistics) -> [Figure<'_>; 4] {
    let agreement = s.agreement.as_ref();
    [
        (Some(s.mean), agreement.map(|a| &a.mean)),
        (Some(s.minimum), agreement.map(|a| &a.minimum)),
        (s.uniformity, agreement.and_then(|a| a.uniformity.as_ref())),
        (s.diversity, agreement.and_then(|a| a.diversity.as_ref())),
    ]
}

/// A cell; on narrow screens, which have no headings, it shows `name`.
fn cell(name: &str, (figure, agreement): Figure<'_>) -> Markup {
    html! {
        td.number data-head=(name) {
            (figure.as_ref().map_or("–".to_owned(), estimate))
            @if let Some(agreement) = agreement { (describe_agreement(agreement)) }
        }
    }
}

/// A figure's deviation and its verdict.
pub(super) fn describe_agreement(a: &FigureAgreement) -> Markup {
    let relative = a.relative().map(|d| interval_in_percent(d, a.expanded / a.reference.value.abs()));
    let off = minus(&relative.unwrap_or_else(|| significant(a.deviation)));
    html! {
        div class={ "most v-" (class(a.verdict)) } { (off) " " span.glyph aria-hidden="true" { (glyph(a.verdict)) } " " span.word { (a.verdict.name()) } }
    }
}
