//! Cases that a spec compares: the references' illuminance on one colour scale, and the ratio of each engine beside that of its reference.

use itertools::Itertools;
use maud::{Markup, html};

use super::super::Report;
use super::super::words::estimate;
use super::palette::Palette;
use super::plot::{Group, Marks, grid};
use super::statistics::agreed;
use super::{Pages, rest, shown};
use crate::judge::{Basis, Ratio, Ratios};
use crate::record::ProcedureId;

/// More pairs of maps than this are left to the table.
const MOST_MAPS: usize = 9;

/// `None` where nothing is compared.
pub(super) fn section(report: &Report, palette: &Palette, pages: Option<&Pages<'_>>) -> Option<Markup> {
    if report.ratios.is_empty() {
        return None;
    }
    let marks = if pages.is_some() { Marks::Seen } else { Marks::Every };
    let maps = report.ratios.iter().filter_map(|r| Some((r, r.basis?)));
    let maps = maps.unique_by(|(r, basis)| (&r.before, &r.after, r.procedure, &r.set, *basis)).take(MOST_MAPS);
    let draw = |(r, basis): (&Ratios, Basis)| {
        let cases = [&r.before, &r.after].map(|case| group(report, r.procedure, case));
        grid::side_by_side(&cases, (basis, &r.set), palette, marks)
    };
    let maps: Vec<Markup> = maps.flat_map(draw).collect();
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
        td { (r.procedure.row().short) }
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

fn group<'a>(report: &'a Report, procedure: ProcedureId, case: &'a str) -> Group<'a> {
    let mine = report.comparisons.iter().filter(|c| c.key.is_of(case, procedure));
    Group { case, procedure, comparisons: mine.collect() }
}

/// The meters of the lowest and the highest ratio.
fn ends(r: &Ratios) -> [Option<&Ratio>; 2] {
    let value = |of: &&Ratio| of.ratio.map_or(f64::NAN, |ratio| ratio.value);
    let known = || r.meters.iter().map(|m| &m.of).filter(|of| of.ratio.is_some());
    let (low, high) = known().minmax_by(|a, b| value(a).total_cmp(&value(b))).into_option().unzip();
    [low, high]
}

fn cell(name: &str, of: &Ratio) -> Markup {
    html! {
        td.number data-head=(name) {
            (of.ratio.as_ref().map_or("–".to_owned(), estimate))
            @if let Some(agreement) = &of.agreement { (agreed(agreement)) }
        }
    }
}
