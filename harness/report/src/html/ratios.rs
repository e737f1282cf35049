//! Compared cases: maps of their references on one colour scale, and the ratio of each engine with that of its reference.

use itertools::Itertools;
use maud::{Markup, html};

use super::super::words::estimate;
use super::palette::Palette;
use super::plot::{Group, Marks, grid};
use super::statistics::describe_agreement;
use super::{Pages, rest, shown};
use luxproof_model::ProcedureId;
use luxproof_model::Report;
use luxproof_model::{Ratio, Ratios};

/// At most so many pairs of maps are drawn; the table has all of them.
const MAX_MAPS: usize = 9;

/// The section; `None` where nothing is compared.
pub(super) fn section(report: &Report, palette: &Palette, pages: Option<&Pages<'_>>) -> Option<Markup> {
    if report.ratios.is_empty() {
        return None;
    }
    let maps = maps(report, palette, Marks::for_pages(pages));
    let heads = [
        "after over before",
        "procedure",
        "set of meters",
        "engine",
        "number ratio of means",
        "number lowest",
        "number highest",
    ];
    let rows = html! { @for r in shown(&report.ratios, pages) { tr {
        td { (r.after) " / " (r.before) }
        td { (r.procedure.short()) }
        td { (r.set) " " span.place { "(" (r.meters.len()) " meters)" } }
        td { (palette.label(&r.engine)) }
        (cell("ratio of means", &r.mean))
        @for (name, end) in ["lowest", "highest"].into_iter().zip(ends(r)) {
            @if let Some(end) = end { (cell(name, end)) } @else { td.number data-head=(name) { "–" } }
        }
    } } };
    Some(html! {
        h2 id="ratios-title" { "Before and after" }
        p.lead { "Illuminance of one case over that of another at the same meters. Below each ratio: how far it is off that of the references, with its interval, and whether that is within the tolerance." }
        @if !maps.is_empty() { div.panels { @for map in maps { (map) } } }
        div.figures { (super::table("Before and after", &heads, &rows)) }
        (rest(&report.ratios, pages, "ratios"))
    })
}

/// Maps of the references of each compared pair, each pair once.
fn maps(report: &Report, palette: &Palette, marks: Marks) -> Vec<Markup> {
    let pairs = report.ratios.iter().filter_map(|r| Some((r, r.basis?)));
    let pairs = pairs.unique_by(|(r, basis)| (&r.before, &r.after, r.procedure, &r.set, *basis)).take(MAX_MAPS);
    let mut maps = vec![];
    for (r, basis) in pairs {
        let cases = [&r.before, &r.after].map(|case| group(report, r.procedure, case));
        maps.extend(grid::side_by_side(&cases, (basis, &r.set), palette, marks));
    }
    maps
}

fn group<'a>(report: &'a Report, procedure: ProcedureId, case: &'a str) -> Group<'a> {
    let mine = report.comparisons.iter().filter(|c| c.key.is_of(case, procedure));
    Group { case, procedure, comparisons: mine.collect() }
}

/// The meters of the lowest and the highest ratio.
fn ends(r: &Ratios) -> [Option<&Ratio>; 2] {
    let known = r.meters.iter().filter_map(|m| Some((&m.of, m.of.ratio?.value)));
    let ends = known.minmax_by(|(_, a), (_, b)| a.total_cmp(b)).into_option();
    [ends.map(|((low, _), _)| low), ends.map(|(_, (high, _))| high)]
}

fn cell(name: &str, of: &Ratio) -> Markup {
    html! {
        td.number data-head=(name) {
            (of.ratio.as_ref().map_or("–".to_owned(), estimate))
            @if let Some(agreement) = &of.agreement { (describe_agreement(agreement)) }
        }
    }
}
