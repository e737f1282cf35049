//! What of a long report is on which of its pages, as its own page leads there: every comparison and every row of the verdict matrix is on one.

use maud::{Markup, html};

use super::super::matrix::Row;
use super::super::words::plural;
use super::super::{LONG, Report};
use crate::judge::Comparison;

/// Where pages lie in the folder of a run, a folder for each report.
pub(super) const FOLDER: &str = "report-pages";
/// What the style sheet of a short report lacks.
pub(super) const STYLE: &str = ".to{display:flex;align-items:baseline;gap:.4em;padding:.36rem .6rem;color:inherit;text-decoration:none}\
    .to:hover{text-decoration:underline}.ranges{columns:22em;font-size:13px;padding-left:1.2em}\
    .turn{display:flex;flex-wrap:wrap;gap:.3rem 1.2rem;margin:1rem 0}tr:target{background:var(--wash);outline:2px solid var(--accent)}";
/// Lines of a list or a table that the page of a long report has room for.
const LINES: usize = 300;

/// From when on a report has pages, and how large they are.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layout {
    /// A report of more comparisons has pages.
    pub(super) least: usize,
    /// Comparisons to a page.
    pub(super) comparisons: usize,
    /// Rows of the matrix to a page, and on the first.
    pub(super) rows: usize,
}

impl Layout {
    /// A page is 1 MB at most then, and half a second in a browser.
    pub(super) const USUAL: Self = Self { least: LONG, comparisons: 2000, rows: LINES };
}

/// Where everything of a long report lies.
pub(super) struct Pages<'a> {
    pub(super) report: &'a Report,
    pub(super) layout: Layout,
    folder: String,
}

impl<'a> Pages<'a> {
    /// Those of a report, if it is so long that it has any.
    pub(super) fn of(report: &'a Report, layout: Layout) -> Option<Self> {
        // That of another version's report may be any text.
        let name: String = report.checksum.chars().filter(char::is_ascii_hexdigit).take(DIGITS).collect();
        let folder = format!("{FOLDER}/{name:0>DIGITS$}");
        (report.comparisons.len() > layout.least).then_some(Self { report, layout, folder })
    }

    /// Seen from the report's own page.
    pub(super) fn folder(&self) -> &str {
        &self.folder
    }

    /// Where a comparison lies, by its place in the report, seen from a page.
    pub(super) fn place(&self, k: usize) -> String {
        format!("{}#r{}", readings(k / self.layout.comparisons), k + 1)
    }

    /// The same seen from the report's own page.
    pub(super) fn link_to(&self, k: usize) -> String {
        format!("{}/{}", self.folder, self.place(k))
    }

    /// The rows of the matrix that ask for attention most, in their order.
    pub(super) fn worst<'r>(&self, rows: &'r [Row]) -> Vec<&'r Row> {
        let mut numbers: Vec<usize> = (0..rows.len()).collect();
        let severity = |k: &usize| rows[*k].severity();
        numbers.sort_by(|a, b| {
            let (a, b) = (severity(a), severity(b));
            b.0.cmp(&a.0).then(b.1.total_cmp(&a.1))
        });
        numbers.truncate(self.layout.rows);
        numbers.sort_unstable();
        numbers.into_iter().map(|k| &rows[k]).collect()
    }

    /// Where the rows are that are not shown.
    pub(super) fn other_rows(&self, shown: usize, all: usize) -> Markup {
        html! { @if shown < all {
            p.quiet { "The worst " (shown) " of " (all) " rows; all are on " (plural(all.div_ceil(self.layout.rows), "page")) ", from "
                a href={ (self.folder) "/" (matrices(0)) } { "the first" } " on." }
        } }
    }

    /// What is on which page.
    pub(super) fn section(&self) -> Markup {
        let all = &self.report.comparisons;
        let chunks = all.chunks(self.layout.comparisons);
        html! {
            h2 id="pages-title" { "All readings" }
            p.lead { "Every one of " (all.len()) " comparisons, in the order of report.json, on " (plural(chunks.len(), "page")) " of "
                (self.layout.comparisons) " at most." }
            ol.ranges { @for (page, chunk) in chunks.enumerate() {
                li { a href={ (self.folder) "/" (readings(page)) } { (range(chunk)) } }
            } }
        }
    }
}

/// Digits of a report's checksum that tell it from others.
pub(super) const DIGITS: usize = 12;

pub(super) fn readings(page: usize) -> String {
    format!("readings-{:04}.html", page + 1)
}

pub(super) fn matrices(page: usize) -> String {
    format!("verdicts-{:04}.html", page + 1)
}

/// The first and the last of some comparisons.
fn range(chunk: &[Comparison]) -> String {
    let name = |c: &Comparison| format!("{} {} {} {}", c.key.case, c.key.procedure.row().short, c.key.engine, c.meter);
    match chunk {
        [first, .., last] => format!("{} to {}", name(first), name(last)),
        [one] => name(one),
        [] => String::new(),
    }
}

/// What of a list the page of a report shows: of a long report its beginning.
pub(super) fn shown<'l, T>(all: &'l [T], pages: Option<&Pages<'_>>) -> &'l [T] {
    if pages.is_some() { &all[..all.len().min(LINES)] } else { all }
}

/// Where the rest of it is.
pub(super) fn rest<T>(all: &[T], pages: Option<&Pages<'_>>, key: &str) -> Markup {
    let shown = shown(all, pages).len();
    html! { @if shown < all.len() { p.quiet { "The first " (shown) " of " (all.len()) "; all are in report.json, in " code { (key) } "." } } }
}
