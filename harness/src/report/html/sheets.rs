//! The pages of a long report as files: every comparison and every row of the verdict matrix once.
//!
//! Each loads nothing and has no script, so that it opens from a folder as from a server; links alone lead from one to another.
//! Their folder is named after what the report says: a page never leads to those of another run, whenever its writer was killed.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::super::matrix::{Row, matrix};
use super::super::words::{off, significant};
use super::super::{PAGE, Report};
use super::pages::{DIGITS, FOLDER, Layout, Pages, STYLE, matrices, readings};
use super::palette::Palette;
use super::rows::place;
use super::{class, glyph, matrix as verdicts, metadata, minus, percent};
use crate::judge::Comparison;
use crate::system::files::{self, FileError};

const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'";

/// Keeps the page of a report in a run's folder, with all that it leads to; what an earlier report left there goes.
pub fn keep(report: &Report, page: &str, run: &Path) -> Result<PathBuf, FileError> {
    keep_as(report, page, run, Layout::USUAL)
}

pub(super) fn keep_as(report: &Report, page: &str, run: &Path, layout: Layout) -> Result<PathBuf, FileError> {
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
    let is_current = |folder: &Path| pages.is_some_and(|pages| folder == run.join(pages.folder()));
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

impl Pages<'_> {
    /// Puts all pages into a run's folder: all of them are there, or none.
    fn keep(&self, run: &Path) -> Result<(), FileError> {
        let path = run.join(self.folder());
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
                    (metadata(self.report, POLICY))
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

fn row(c: &Comparison, number: usize, suite: bool) -> Markup {
    let value = |v: Option<f64>| v.map_or("–".to_owned(), |v| format!("{} {}", significant(v), c.quantity.unit()));
    html! {
        tr id={ "r" (number) } {
            td { (number) } @if suite { td { (c.key.case) } } td { (c.key.procedure.row().short) } td { (c.key.engine) }
            td { (c.meter) " " span.place { (place(c)) } }
            td.number { (value(c.value)) } td.number { (value(c.reference.as_ref().map(|r| r.value))) } td { (c.basis_name()) }
            td.number { (off(c, percent).unwrap_or("–".to_owned())) }
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
