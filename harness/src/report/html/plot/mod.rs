//! Plots as SVG panels of one width, so that they read alike on a telephone and on paper.

mod axis;
mod colours;
mod contour;
pub(super) mod grid;
mod polar;
mod strip;
pub(super) mod times;

use std::collections::HashMap;

use maud::{Markup, html};

use super::super::Report;
use super::super::svg::number;
use super::palette::Palette;
use crate::judge::{Basis, Comparison};
use crate::record::ProcedureId;

/// Width of every panel in user units; a telephone shows one at about its natural size.
pub(super) const WIDTH: f64 = 350.0;
/// More cases than this a procedure are left to the table.
const MAX_CASES: usize = 9;

/// How much of what is read has a mark of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Marks {
    Every,
    /// Of those that would lie upon one another one is drawn: nobody sees more, and a page of a million opens.
    Seen,
}

pub(super) struct Group<'a> {
    pub(super) case: &'a str,
    pub(super) procedure: ProcedureId,
    pub(super) comparisons: Vec<&'a Comparison>,
}

/// One group a case, in the cases' order, those without comparisons left out.
pub(super) fn groups<'a>(report: &'a Report, procedure: ProcedureId) -> Vec<Group<'a>> {
    let mut of_case: HashMap<&str, Vec<&Comparison>> = HashMap::new();
    for c in report.comparisons.iter().filter(|c| c.key.procedure == procedure) {
        of_case.entry(&c.key.case).or_default().push(c);
    }
    let group = |case: &'a str| Some(Group { case, procedure, comparisons: of_case.remove(case)? });
    report.cases.iter().map(|c| &*c.name).filter_map(group).collect()
}

pub(super) fn panels(report: &Report, groups: &[Group<'_>], palette: &Palette, marks: Marks) -> Vec<Markup> {
    let mut shown: Vec<&Group<'_>> = groups.iter().collect();
    if shown.len() > MAX_CASES {
        // Of many cases those are drawn that ask for attention most.
        shown.sort_by_key(|g| std::cmp::Reverse(g.comparisons.iter().map(|c| c.verdict).max()));
        shown.truncate(MAX_CASES);
    }
    let mut panels: Vec<Markup> = vec![];
    // Panels of a kind side by side, so that cases compare along a row.
    panels.extend(shown.iter().filter_map(|group| polar::panel(report, group, palette)));
    panels.extend(shown.iter().flat_map(|group| grid::panels(report, group, palette, marks)));
    panels.extend(shown.iter().map(|group| strip::panel(report, group, palette, marks)));
    if shown.len() < groups.len() {
        panels.push(html! { p.quiet { "Drawn: " (shown.len()) " of " (groups.len()) " cases, those that ask for attention most." } });
    }
    panels
}

impl Group<'_> {
    fn engines(&self, palette: &Palette) -> Vec<&str> {
        palette.sorted(self.comparisons.iter().map(|c| c.key.engine.as_str()))
    }

    /// The firmest basis: what the group is drawn against.
    fn basis(&self) -> Option<Basis> {
        self.comparisons.iter().filter_map(|c| c.basis()).min()
    }

    /// The panel's title: the case where there are several.
    fn title(&self, report: &Report, what: &str) -> String {
        format!("{}{what}", report.of_suite(self.case, ": "))
    }
}

fn figure(title: &str, height: f64, drawing: &Markup, caption: &Markup) -> Markup {
    html! {
        figure {
            figcaption { strong { (title) } }
            svg viewBox={ "0 0 " (WIDTH) " " (number(height)) } role="img" aria-label=(title) { (drawing) }
            div.caption { (caption) }
        }
    }
}

fn legend(engines: &[&str], palette: &Palette) -> Markup {
    html! { span.keys { @for engine in engines { (palette.label(engine)) " " } } }
}
