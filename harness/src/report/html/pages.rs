//! The pages of a long report: every comparison and every row of the verdict matrix once, beside a page that shows what is worst of them.
//!
//! Each page is a file that loads nothing and has no script, so that it opens from a folder as from a server; links alone lead from one to another.
//! Their folder is named after what the report says: a page never leads to those of another run, whenever its writer was killed.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::super::matrix::{Row, matrix};
use super::super::words::{plural, significant};
use super::super::{LONG, PAGE, Report};
use super::palette::Palette;
use super::rows::place;
use super::{class, glyph, matrix as verdicts, minus, percent};
use crate::judge::Comparison;
use crate::system::files::{self, FileError};

/// Where pages lie in the folder of a run, a folder for each report; another run's are taken away.
const FOLDER: &str = "report-pages";
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'";
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
    report: &'a Report,
    layout: Layout,
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

    /// Puts all pages into a run's folder: all of them are there, or none.
    fn keep(&self, run: &Path) -> Result<(), FileError> {
        let path = run.join(&self.folder);
        files::replace_folder(&path, |folder| self.write(folder)).map_err(|source| FileError::of(&path, source))
    }

    fn write(&self, folder: &Path) -> io::Result<()> {
        let palette = Palette::of(self.report);
        let rows = matrix(self.report);
        let rows: Vec<&Row> = rows.iter().collect();
        let (pages, all) = (rows.chunks(self.layout.rows), rows.len());
        let last = pages.len();
        for (page, rows) in pages.enumerate() {
            let table = verdicts::table(self.report, rows, &palette, &|cell, key| {
                verdicts::linked(cell, key, &self.place(cell.first))
            });
            let from = page * self.layout.rows;
            let title = format!("Verdicts: rows {} to {} of {all}", from + 1, from + rows.len());
            self.page(folder, &title, (page, last, matrices), &html! { (Palette::marks()) (table) })?;
        }
        let (chunks, all) = (self.report.comparisons.chunks(self.layout.comparisons), self.report.comparisons.len());
        let last = chunks.len();
        for (page, chunk) in chunks.enumerate() {
            let from = page * self.layout.comparisons;
            let title = format!("Readings {} to {} of {all}", from + 1, from + chunk.len());
            self.page(folder, &title, (page, last, readings), &self.table(from, chunk))?;
        }
        Ok(())
    }

    fn page(
        &self,
        folder: &Path,
        title: &str,
        (page, pages, name): (usize, usize, fn(usize) -> String),
        content: &Markup,
    ) -> io::Result<()> {
        let turn = html! {
            p.turn {
                a href={ "../../" (PAGE) } { "The report" }
                @if page > 0 { a href=(name(0)) { "First" } a href=(name(page - 1)) rel="prev" { "Previous" } }
                span.quiet { "page " (page + 1) " of " (pages) }
                @if page + 1 < pages { a href=(name(page + 1)) rel="next" { "Next" } a href=(name(pages - 1)) { "Last" } }
            }
        };
        let html = html! {
            (DOCTYPE)
            html lang="en" {
                head {
                    meta charset="utf-8";
                    meta name="viewport" content="width=device-width, initial-scale=1";
                    meta http-equiv="Content-Security-Policy" content=(POLICY);
                    meta name="generator" content=(format!("luxproof {}", self.report.tool_version));
                    title { (title) " · " (self.report.spec.title) " · luxproof" }
                    style { (PreEscaped(super::STYLE)) (PreEscaped(Palette::style())) (PreEscaped(STYLE)) }
                }
                body { main id="main" { (turn) h1 { (title) } p.spec { (self.report.spec.title) } (content) (turn) } }
            }
        };
        std::fs::File::create(folder.join(name(page)))?.write_all(html.into_string().as_bytes())
    }

    fn table(&self, from: usize, chunk: &[Comparison]) -> Markup {
        let suite = self.report.is_suite();
        html! {
            div.scroll tabindex="0" role="region" aria-label="Readings" {
                table {
                    thead { tr {
                        th scope="col" { "number" } @if suite { th scope="col" { "case" } } th scope="col" { "procedure" } th scope="col" { "engine" }
                        th scope="col" { "meter" } th.number scope="col" { "reading" } th.number scope="col" { "reference" } th scope="col" { "against" }
                        th.number scope="col" { "deviation" } th.number scope="col" { "of tolerance" } th scope="col" { "verdict" }
                        th scope="col" { "expanded uncertainty" }
                    } }
                    tbody { @for (k, c) in chunk.iter().enumerate() { (row(c, from + k + 1, suite)) } }
                }
            }
        }
    }
}

/// Digits of a report's checksum that tell it from others.
const DIGITS: usize = 12;

fn row(c: &Comparison, number: usize, suite: bool) -> Markup {
    let value = |v: Option<f64>| v.map_or("–".to_owned(), |v| format!("{} {}", significant(v), c.quantity.unit()));
    html! {
        tr id={ "r" (number) } {
            td { (number) } @if suite { td { (c.key.case) } } td { (c.key.procedure.row().short) } td { (c.key.engine) }
            td { (c.meter) " " span.place { (place(c)) } }
            td.number { (value(c.value)) } td.number { (value(c.reference.as_ref().map(|r| r.value))) } td { (c.basis_name()) }
            td.number { (c.relative_deviation.map_or("–".to_owned(), percent)) }
            td.number { (c.normalized_error().map_or("–".to_owned(), |e| minus(&format!("{:.0} %", 100.0 * e)))) }
            td class={ "v-" (class(c.verdict)) } {
                span.glyph aria-hidden="true" { (glyph(c.verdict)) } " " (c.verdict.name())
                @if let Some(why) = &c.diagnosis { ": " (why) }
            }
            td { @if let Some(budget) = &c.budget { (uncertainty(budget.expanded, c)) } }
        }
    }
}

/// `0.24 lx: Monte Carlo 0.12, reference 0.001`.
fn uncertainty(expanded: f64, c: &Comparison) -> String {
    let parts = c.budget.iter().flat_map(|b| &b.components);
    let parts: Vec<String> =
        parts.map(|part| format!("{} {}", part.source.into_str(), significant(part.uncertainty))).collect();
    format!("{} {}: {}", significant(expanded), c.quantity.unit(), parts.join(", "))
}

fn readings(page: usize) -> String {
    format!("readings-{:04}.html", page + 1)
}

fn matrices(page: usize) -> String {
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

/// Keeps the page of a report in a run's folder, with all that it leads to; what an earlier report left there goes.
pub fn keep(report: &Report, page: &str, run: &Path) -> Result<PathBuf, FileError> {
    keep_as(report, page, run, Layout::USUAL)
}

fn keep_as(report: &Report, page: &str, run: &Path, layout: Layout) -> Result<PathBuf, FileError> {
    let file = run.join(PAGE);
    let pages = Pages::of(report, layout);
    if let Some(pages) = &pages {
        pages.keep(run)?;
    }
    files::keep_shared(&file, page.as_bytes())?;
    sweep(run, pages.as_ref());
    Ok(file)
}

/// Takes away the pages of other reports; whatever else lies there stays.
fn sweep(run: &Path, pages: Option<&Pages<'_>>) {
    let root = run.join(FOLDER);
    files::sweep(&root);
    let folders = std::fs::read_dir(&root).into_iter().flatten().flatten().map(|entry| entry.path());
    let is_ours = |name: &str| name.len() == DIGITS && name.bytes().all(|digit| digit.is_ascii_hexdigit());
    let is_current = |folder: &Path| pages.is_some_and(|pages| folder == run.join(&pages.folder));
    for folder in folders.filter(|folder| folder.file_name().and_then(|n| n.to_str()).is_some_and(is_ours)) {
        if is_current(&folder) {
            continue;
        }
        let files = std::fs::read_dir(&folder).into_iter().flatten().flatten().map(|entry| entry.path());
        let is_page = |file: &PathBuf| {
            let name = file.file_name().and_then(|n| n.to_str()).unwrap_or_default();
            let begins = name.starts_with("readings-") || name.starts_with("verdicts-");
            begins && Path::new(name).extension().is_some_and(|e| e == "html")
        };
        for file in files.filter(is_page) {
            std::fs::remove_file(file).ok();
        }
        // It stays where anything else lies in it.
        std::fs::remove_dir(&folder).ok();
    }
    std::fs::remove_dir(&root).ok();
}
