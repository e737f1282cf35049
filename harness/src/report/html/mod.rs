//! The HTML report: one self-contained file that loads nothing, for screens light and dark, for paper and for keyboards.
//!
//! Plots are drawn here as SVG, so that the same report gives the same bytes; the script only filters, sorts and opens.

mod accepted;
mod beside;
mod matrix;
mod notes;
mod pages;
mod palette;
mod plot;
mod procedure;
mod provenance;
mod ratios;
mod rows;
mod sheets;
mod statistics;

use itertools::Itertools;
use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::Report;
use super::sentences::{HEADING, sentences};
use super::words::{self, plural};
use crate::judge::Verdict;
use pages::{Layout, Pages, rest, shown};
use palette::Palette;
use plot::Marks;
use rows::Rows;

pub use sheets::keep;

pub use beside::{Beside, BesideError};

const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");
/// Nothing is loaded from anywhere: the browser itself is told to refuse it.
const POLICY: &str =
    "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; base-uri 'none'; form-action 'none'";

/// The report as one HTML file; `beside` are further measurements to show with it. That of a long report leads to pages beside it.
pub fn page(report: &Report, beside: &[Beside]) -> String {
    written(report, beside, Pages::of(report, Layout::USUAL).as_ref())
}

/// How every page is read, what it may load, and who wrote it.
fn metadata(report: &Report, policy: &str) -> Markup {
    html! {
        meta charset="utf-8";
        meta name="viewport" content="width=device-width, initial-scale=1";
        meta http-equiv="Content-Security-Policy" content=(policy);
        meta name="generator" content=(format!("luxproof {}", report.tool_version));
    }
}

fn written(report: &Report, beside: &[Beside], pages: Option<&Pages<'_>>) -> String {
    let palette = Palette::of(report);
    let mut rows = Rows::default();
    let sections: Vec<(String, String, Markup)> = sections(report, beside, &palette, &mut rows, pages);
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                (metadata(report, POLICY))
                title { (report.spec.title) " · luxproof" }
                style { (PreEscaped(STYLE)) (PreEscaped(Palette::style())) @if pages.is_some() { (PreEscaped(pages::STYLE)) } }
                noscript { style { "tr[hidden]{display:table-row}.filters,.theme,.all,.more{display:none}" } }
            }
            body {
                (Palette::marks())
                a.skip href="#main" { "Skip to the report" }
                nav aria-label="Sections" {
                    div.bar {
                        a.brand href="#top" { "luxproof" }
                        ul { @for (id, name) in in_navigation(&sections) { li { a href={ "#" (id) } { (name) } } } }
                        button.theme type="button" { "Dark" }
                    }
                }
                main id="main" {
                    (head(report))
                    @for (id, _, section) in &sections { section id=(id) aria-labelledby={ (id) "-title" } { (section) } }
                }
                footer {
                    "Written by luxproof " (report.tool_version) ". Everything here is a view of report.json, which holds all digits."
                    @if let Some(pages) = pages { " The folder " code { (pages.folder()) } " belongs to this file: move them together." }
                }
                dialog id="budget" aria-labelledby="budget-title" {
                    form method="dialog" { button.close aria-label="Close" { "×" } }
                    h2 id="budget-title" {}
                    div.content {}
                }
                script type="application/json" id="data" { (PreEscaped(rows.json())) }
                script { (PreEscaped(SCRIPT)) }
            }
        }
    };
    page.into_string()
}

/// Sections of one kind, as `Calibration: point`, have one entry: the first's.
fn in_navigation(sections: &[(String, String, Markup)]) -> impl Iterator<Item = (&str, &str)> {
    let kinds = sections.iter().map(|(id, name, _)| (&**id, name.split(": ").next().unwrap_or(name)));
    kinds.unique_by(|(_, kind)| *kind)
}

/// Every section with its id and its name in the navigation.
fn sections(
    report: &Report,
    beside: &[Beside],
    palette: &Palette,
    rows: &mut Rows,
    pages: Option<&Pages<'_>>,
) -> Vec<(String, String, Markup)> {
    let marks = if pages.is_some() { Marks::Seen } else { Marks::Every };
    let mut sections = vec![("matrix".to_owned(), "Verdicts".to_owned(), matrix::section(report, palette, pages))];
    if let Some(check) = &report.baseline {
        sections.push(("baseline".to_owned(), "Baseline".to_owned(), accepted::section(check, pages)));
    }
    for name in report.procedures() {
        let section = procedure::section(report, name, palette, rows, pages);
        sections.push((name.to_string(), name.row().short.to_owned(), section));
    }
    if let Some(section) = ratios::section(report, palette, pages) {
        sections.push(("ratios".to_owned(), "Before and after".to_owned(), section));
    }
    if let Some(pages) = pages {
        sections.push(("pages".to_owned(), "All readings".to_owned(), pages.section()));
    }
    sections.push(("time".to_owned(), "Run time".to_owned(), plot::times::section(report, beside, palette, marks)));
    if let Some(stress) = beside::stress_section(beside, palette) {
        sections.push(("stress".to_owned(), "Stress".to_owned(), stress));
    }
    sections.push(("notes".to_owned(), "Notes".to_owned(), notes::section(report, pages)));
    sections.push(("provenance".to_owned(), "Provenance".to_owned(), provenance::section(report, palette, pages)));
    sections
}

fn head(report: &Report) -> Markup {
    let s = &report.summary;
    let counts = [
        (Verdict::Pass, s.pass),
        (Verdict::NotJudged, s.not_judged),
        (Verdict::KnownDeviation, s.known_deviation),
        (Verdict::Inconclusive, s.inconclusive),
        (Verdict::Fail, s.fail),
        (Verdict::UnexpectedPass, s.unexpected_pass),
        (Verdict::Missing, s.missing),
    ];
    html! {
        header id="top" {
            p.overline {
                "luxproof " (report.tool_version) " · " (report.started.replace('T', " ").replace('Z', " UTC")) " · "
                (plural(report.asked(), "case")) " · " (plural(report.engines.len(), "engine")) " · " (duration(report.wall_s))
            }
            h1 { (report.spec.title) }
            p.spec { code { (report.spec.path) } }
            @let sentences = sentences(report);
            @if !sentences.is_empty() {
                h2.trust { (HEADING) }
                ul.trust { @for sentence in &sentences { li { (minus(&sentence.text)) } } }
            }
            @if !report.comparisons.is_empty() {
                div.share aria-hidden="true" {
                    @for (verdict, count) in counts { @if count > 0 {
                        span class={ "v-" (class(verdict)) } style={ "flex-grow:" (count) } {}
                    } }
                }
            }
            dl.counts {
                @for (verdict, count) in counts { @if count > 0 || verdict == Verdict::Pass || verdict == Verdict::Fail {
                    div class={ "v-" (class(verdict)) } { dt { span.glyph aria-hidden="true" { (glyph(verdict)) } " " (verdict.name()) } dd { (count) } }
                } }
                div { dt { "skipped" } dd { (s.skipped) } }
            }
            @for line in super::notes::decision_rules(report) { p.ruled { (line) } }
            @for line in super::notes::policies(report).into_iter().chain(super::notes::lacking(report)) { p.ruled { (line) } }
        }
    }
}

/// A table that scrolls by itself where the page is too narrow; a heading may have a class, as in `number run time`.
pub(crate) fn table(label: &str, heads: &[&str], rows: &Markup) -> Markup {
    html! {
        div.scroll tabindex="0" role="region" aria-label=(label) {
            table {
                thead { tr { @for head in heads {
                    @if let Some(head) = head.strip_prefix("number ") { th.number scope="col" { (head) } } @else { th scope="col" { (head) } }
                } } }
                tbody { (rows) }
            }
        }
    }
}

/// The verdict's class in the style sheet.
fn class(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Pass => "pass",
        Verdict::KnownDeviation | Verdict::NotJudged => "known",
        Verdict::Inconclusive => "undecided",
        Verdict::Fail | Verdict::UnexpectedPass | Verdict::Missing => "fail",
    }
}

/// The verdict's sign, so that colour is never needed.
fn glyph(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Pass => "✓",
        Verdict::NotJudged => "–",
        Verdict::KnownDeviation => "≈",
        Verdict::Inconclusive => "?",
        Verdict::Fail => "✕",
        Verdict::UnexpectedPass => "!",
        Verdict::Missing => "∅",
    }
}

fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 0.01 => "< 0.01 s".to_owned(),
        s if s < 1.0 => format!("{s:.2} s"),
        s if s < 120.0 => format!("{s:.1} s"),
        s => format!("{:.0} min {:02.0} s", (s / 60.0).floor(), s % 60.0),
    }
}

/// A signed relative deviation with a real minus sign and powers of ten as people write them.
fn percent(deviation: f64) -> String {
    let text = words::percent(deviation);
    match text.trim_end_matches(" %").split_once('e').map(|(m, e)| (m, e.parse())) {
        Some((mantissa, Ok(exponent))) => minus(&format!("{mantissa}·{} %", power(exponent))),
        _ => minus(&text),
    }
}

/// Real minus signs before numbers, and a real plus-minus; hyphens within words stay.
fn minus(text: &str) -> String {
    let mut result = String::with_capacity(text.len());
    let text = text.replace("+-", "± ");
    let mut letters = text.chars().peekable();
    while let Some(letter) = letters.next() {
        let before_digit = letters.peek().is_some_and(char::is_ascii_digit);
        let within_word = result.chars().next_back().is_some_and(char::is_alphanumeric);
        result.push(if letter == '-' && before_digit && !within_word { '−' } else { letter });
    }
    result
}

fn power(exponent: i32) -> String {
    let digits = ["⁰", "¹", "²", "³", "⁴", "⁵", "⁶", "⁷", "⁸", "⁹"];
    let raised: String = exponent.abs().to_string().bytes().map(|b| digits[usize::from(b - b'0')]).collect();
    format!("10{}{raised}", if exponent < 0 { "⁻" } else { "" })
}

#[cfg(test)]
pub(super) mod tests;
