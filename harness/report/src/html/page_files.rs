//! The pages of a long report as files: every comparison and every row of the verdict matrix once.
//!
//! A page loads nothing and has no script, so that it opens from a folder and from a server. Plain links connect the pages.
//! Their folder is named after the report's checksum. So no page links to pages of another run, even after a killed process.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::super::PAGE;
use super::super::matrix::{Row, matrix};
use super::super::words::{off, significant};
use super::pages::{DIGITS, FOLDER, Layout, Pages, STYLE, matrices, readings};
use super::palette::Palette;
use super::rows::place;
use super::{class, glyph, matrix as verdicts, metadata, minus, percent};
use luxproof_model::Comparison;
use luxproof_model::Report;
use luxproof_process::files::{self, FileError};

const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'";

/// Writes the page of a report and its further pages into a run's folder, and removes those of an earlier report.
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
    remove_other_pages(run, pages.as_ref());
    Ok(file)
}

/// Removes the pages of other reports; other files stay.
fn remove_other_pages(run: &Path, pages: Option<&Pages<'_>>) {
    let root = run.join(FOLDER);
    files::sweep(&root);
    for folder in paths_in(&root).filter(|folder| is_page_folder(folder)) {
        if pages.is_some_and(|pages| folder == run.join(pages.folder())) {
            continue;
        }
        for file in paths_in(&folder).filter(|file| is_page(file)) {
            std::fs::remove_file(file).ok();
        }
        // This fails, as it should, while other files are in the folder.
        std::fs::remove_dir(&folder).ok();
    }
    std::fs::remove_dir(&root).ok();
}

/// The paths in a folder; none where it cannot be read.
fn paths_in(folder: &Path) -> impl Iterator<Item = PathBuf> {
    std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path())
}

fn file_name(path: &Path) -> &str {
    path.file_name().and_then(|name| name.to_str()).unwrap_or_default()
}

/// Whether a folder is named like a folder of pages: after a checksum.
fn is_page_folder(folder: &Path) -> bool {
    let name = file_name(folder);
    name.len() == DIGITS && name.bytes().all(|digit| digit.is_ascii_hexdigit())
}

fn is_page(file: &Path) -> bool {
    let name = file_name(file);
    let is_named_so = name.starts_with("readings-") || name.starts_with("verdicts-");
    is_named_so && file.extension().is_some_and(|e| e == "html")
}

impl Pages<'_> {
    /// Writes all pages into a run's folder at once: all of them are there, or none.
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
            let table = verdicts::table(self.report, rows, &palette, &|cell| {
                verdicts::link_cell(cell, &self.place(cell.first))
            });
            let from = page * self.layout.rows;
            let title = format!("Verdicts: rows {} to {} of {all}", from + 1, from + rows.len());
            self.write_page(folder, &title, (page, last, matrices), &html! { (Palette::marks()) (table) })?;
        }
        let (chunks, all) = (self.report.comparisons.chunks(self.layout.comparisons), self.report.comparisons.len());
        let last = chunks.len();
        for (page, chunk) in chunks.enumerate() {
            let from = page * self.layout.comparisons;
            let title = format!("Readings {} to {} of {all}", from + 1, from + chunk.len());
            self.write_page(folder, &title, (page, last, readings), &self.readings_table(from, chunk))?;
        }
        Ok(())
    }

    /// Writes one page with links to its neighbours; `name` gives the file name of each page.
    fn write_page(
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

    /// A table of comparisons from the index `from` in the report.
    fn readings_table(&self, from: usize, chunk: &[Comparison]) -> Markup {
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
    html! {
        tr id={ "r" (number) } {
            td { (number) } @if suite { td { (c.key.case) } } td { (c.key.procedure.short()) } td { (c.key.engine) }
            td { (c.meter) " " span.place { (place(c)) } }
            td.number { (value_with_unit(c.value, c)) } td.number { (value_with_unit(c.reference.as_ref().map(|r| r.value), c)) } td { (c.basis_name()) }
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

/// A value with the unit of its comparison; a dash for none.
fn value_with_unit(value: Option<f64>, c: &Comparison) -> String {
    value.map_or("–".to_owned(), |v| format!("{} {}", significant(v), c.quantity.unit()))
}

/// The expanded uncertainty with its components: `0.24 lx: Monte Carlo 0.12, reference 0.001`.
fn uncertainty(expanded: f64, c: &Comparison) -> String {
    let parts = c.budget.iter().flat_map(|b| &b.components);
    let parts: Vec<String> =
        parts.map(|part| format!("{} {}", part.source.into_str(), significant(part.uncertainty))).collect();
    format!("{} {}: {}", significant(expanded), c.quantity.unit(), parts.join(", "))
}
