//! Plots as SVG panels of one width, legible on a telephone and on paper.

mod axis;
mod colours;
mod contour;
pub(super) mod grid;
pub(super) mod plan;
mod polar;
mod strip;
pub(super) mod times;

use std::collections::HashMap;

use maud::{Markup, html};

use super::super::svg::number;
use super::pages::Pages;
use super::palette::Palette;
use luxproof_model::ProcedureId;
use luxproof_model::Report;
use luxproof_model::{Basis, Comparison};

/// Width of every panel in user units: about the width of a telephone's screen.
pub(super) const WIDTH: f64 = 350.0;
/// At most so many cases of a procedure are drawn; the table has all of them.
pub(super) const MAX_CASES: usize = 9;

/// Which readings have a mark.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Marks {
    Every,
    /// One of those at the same place. That looks the same, and a page of a million readings stays small.
    Seen,
}

impl Marks {
    /// A report with further pages is long, and draws only what is seen.
    pub(super) fn for_pages(pages: Option<&Pages<'_>>) -> Self {
        if pages.is_some() { Self::Seen } else { Self::Every }
    }
}

/// The comparisons of one case and procedure.
pub(super) struct Group<'a> {
    pub(super) case: &'a str,
    pub(super) procedure: ProcedureId,
    pub(super) comparisons: Vec<&'a Comparison>,
}

/// One group for each case with comparisons, in the order of the cases.
pub(super) fn groups(report: &Report, procedure: ProcedureId) -> Vec<Group<'_>> {
    let mut by_case: HashMap<&str, Vec<&Comparison>> = HashMap::new();
    for c in report.comparisons.iter().filter(|c| c.key.procedure == procedure) {
        by_case.entry(&c.key.case).or_default().push(c);
    }
    let mut groups = vec![];
    for case in &report.cases {
        if let Some(comparisons) = by_case.remove(&*case.name) {
            groups.push(Group { case: &case.name, procedure, comparisons });
        }
    }
    groups
}

pub(super) fn panels(report: &Report, groups: &[Group<'_>], palette: &Palette, marks: Marks) -> Vec<Markup> {
    let mut shown: Vec<&Group<'_>> = groups.iter().collect();
    if shown.len() > MAX_CASES {
        // The cases with the worst verdicts are drawn.
        shown.sort_by_key(|g| std::cmp::Reverse(g.comparisons.iter().map(|c| c.verdict).max()));
        shown.truncate(MAX_CASES);
    }
    let mut panels: Vec<Markup> = vec![];
    // Panels of a kind follow one another, so that cases compare along a row.
    panels.extend(shown.iter().filter_map(|group| polar::panel(report, group, palette)));
    panels.extend(shown.iter().flat_map(|group| grid::panels(report, group, palette, marks)));
    panels.extend(shown.iter().map(|group| strip::panel(report, group, palette, marks)));
    if shown.len() < groups.len() {
        panels.push(html! { p.quiet { "Drawn: " (shown.len()) " of " (groups.len()) " cases, those with the worst verdicts." } });
    }
    panels
}

impl Group<'_> {
    fn engines(&self, palette: &Palette) -> Vec<&str> {
        palette.sorted(self.comparisons.iter().map(|c| c.key.engine.as_str()))
    }

    /// The firmest basis, which the group is drawn against.
    fn basis(&self) -> Option<Basis> {
        self.comparisons.iter().filter_map(|c| c.basis()).min()
    }

    /// The panel's title, with the case where there are several.
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
