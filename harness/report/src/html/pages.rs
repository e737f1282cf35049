//! The further pages of a long report: each comparison and each row of the verdict matrix is on one of them.

use maud::{Markup, html};

use super::super::matrix::Row;
use super::super::words::plural;
use luxproof_model::Comparison;
use luxproof_model::MAX_ON_ONE_PAGE;
use luxproof_model::Report;

/// The folder of all pages in the folder of a run; each report has a folder in it.
pub(super) const FOLDER: &str = "report-pages";
/// Styles that only a long report needs.
pub(super) const STYLE: &str = ".to{display:flex;align-items:baseline;gap:.4em;padding:.36rem .6rem;color:inherit;text-decoration:none}\
    .to:hover{text-decoration:underline}.ranges{columns:22em;font-size:13px;padding-left:1.2em}\
    .turn{display:flex;flex-wrap:wrap;gap:.3rem 1.2rem;margin:1rem 0}tr:target{background:var(--wash);outline:2px solid var(--accent)}";
/// Lines of a list or a table on the first page of a long report.
const MAX_LINES: usize = 300;

/// The length from which a report has pages, and the length of a page.
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
    /// A page is then at most 1 MB and opens in half a second.
    pub(super) const USUAL: Self = Self { least: MAX_ON_ONE_PAGE, comparisons: 2000, rows: MAX_LINES };
}

/// The pages of a long report.
pub(super) struct Pages<'a> {
    pub(super) report: &'a Report,
    pub(super) layout: Layout,
    folder: String,
}

impl<'a> Pages<'a> {
    /// The pages of a report; `None` where one page is enough.
    pub(super) fn of(report: &'a Report, layout: Layout) -> Option<Self> {
        // The checksum in a report of another version may be any text.
        let name: String = report.checksum.chars().filter(char::is_ascii_hexdigit).take(DIGITS).collect();
        let folder = format!("{FOLDER}/{name:0>DIGITS$}");
        (report.comparisons.len() > layout.least).then_some(Self { report, layout, folder })
    }

    /// Their folder, relative to the report's first page.
    pub(super) fn folder(&self) -> &str {
        &self.folder
    }

    /// The link from another page to a comparison, given its index in the report.
    pub(super) fn place(&self, k: usize) -> String {
        format!("{}#r{}", readings(k / self.layout.comparisons), k + 1)
    }

    /// The same link from the report's first page.
    pub(super) fn link_to(&self, k: usize) -> String {
        format!("{}/{}", self.folder, self.place(k))
    }

    /// The most severe rows of the matrix, in their order.
    pub(super) fn worst<'r>(&self, rows: &'r [Row]) -> Vec<&'r Row> {
        let mut numbers: Vec<usize> = (0..rows.len()).collect();
        numbers.sort_by(|a, b| {
            let (a, b) = (rows[*a].severity(), rows[*b].severity());
            b.0.cmp(&a.0).then(b.1.total_cmp(&a.1))
        });
        numbers.truncate(self.layout.rows);
        numbers.sort_unstable();
        numbers.into_iter().map(|k| &rows[k]).collect()
    }

    /// A link to the rows that are not shown.
    pub(super) fn other_rows(&self, shown: usize, all: usize) -> Markup {
        html! { @if shown < all {
            p.quiet { "The worst " (shown) " of " (all) " rows; all are on " (plural(all.div_ceil(self.layout.rows), "page")) ", from "
                a href={ (self.folder) "/" (matrices(0)) } { "the first" } " on." }
        } }
    }

    /// The list of all pages of readings.
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

/// Digits of a report's checksum that identify it.
pub(super) const DIGITS: usize = 12;

pub(super) fn readings(page: usize) -> String {
    format!("readings-{:04}.html", page + 1)
}

pub(super) fn matrices(page: usize) -> String {
    format!("verdicts-{:04}.html", page + 1)
}

/// The first and the last of the comparisons on a page.
fn range(chunk: &[Comparison]) -> String {
    match chunk {
        [first, .., last] => format!("{} to {}", comparison_name(first), comparison_name(last)),
        [single] => comparison_name(single),
        [] => String::new(),
    }
}

fn comparison_name(c: &Comparison) -> String {
    format!("{} {} {} {}", c.key.case, c.key.procedure.short(), c.key.engine, c.meter)
}

/// The part of a list that the first page shows: of a long report the beginning.
pub(super) fn shown<'l, T>(all: &'l [T], pages: Option<&Pages<'_>>) -> &'l [T] {
    if pages.is_some() { &all[..all.len().min(MAX_LINES)] } else { all }
}

/// A remark about the part that is not shown; `key` is the list's name in report.json.
pub(super) fn rest<T>(all: &[T], pages: Option<&Pages<'_>>, key: &str) -> Markup {
    let shown = shown(all, pages).len();
    html! { @if shown < all.len() { p.quiet { "The first " (shown) " of " (all.len()) "; all are in report.json, in " code { (key) } "." } } }
}
