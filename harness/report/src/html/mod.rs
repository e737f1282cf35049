//! The HTML report: one self-contained file that loads nothing, for light and dark screens, paper and keyboards.
//!
//! Plots are drawn here as SVG, so that the same report gives the same bytes. The script only filters, sorts and opens.

mod attachments;
mod baseline;
mod matrix;
mod notes;
mod page_files;
mod pages;
mod palette;
mod plot;
mod procedure;
mod provenance;
mod ratios;
mod rows;
mod statistics;

use itertools::Itertools;
use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::words::HEADING;
use super::words::{self, plural};
use luxproof_model::Report;
use luxproof_model::Verdict;
use pages::{Layout, Pages, rest, shown};
use palette::Palette;
use plot::Marks;
use rows::Rows;

pub use page_files::keep;

pub use attachments::{AttachedReport, AttachedReportError};

/// What pages of other views share with the report: colours, type, tables.
pub const BASE_STYLE: &str = include_str!("base.css");
const STYLE: &str = concat!(include_str!("base.css"), include_str!("page.css"));
const SCRIPT: &str = include_str!("page.js");
/// The browser refuses to load anything.
const POLICY: &str =
    "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; base-uri 'none'; form-action 'none'";

/// The report as one HTML file; `attachments` are further measurements to show with it.
///
/// The file of a long report links to further pages in a folder.
pub fn page(report: &Report, attachments: &[AttachedReport]) -> String {
    render(report, attachments, Pages::of(report, Layout::USUAL).as_ref())
}

/// Metadata of every page: encoding, layout, content policy and generator.
fn metadata(report: &Report, policy: &str) -> Markup {
    html! {
        meta charset="utf-8";
        meta name="viewport" content="width=device-width, initial-scale=1";
        meta http-equiv="Content-Security-Policy" content=(policy);
        meta name="generator" content=(format!("luxproof {}", report.tool_version));
    }
}

/// Renders the page; `pages` are the further pages of a long report.
fn render(report: &Report, attachments: &[AttachedReport], pages: Option<&Pages<'_>>) -> String {
    let palette = Palette::of(report);
    let mut rows = Rows::default();
    let sections = sections(report, attachments, &palette, &mut rows, pages);
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
                        ul { @for (id, name) in navigation_entries(&sections) { li { a href={ "#" (id) } { (name) } } } }
                        button.theme type="button" { "Dark" }
                    }
                }
                main id="main" {
                    (head(report))
                    @for Section { id, content, .. } in &sections { section id=(id) aria-labelledby={ (id) "-title" } { (content) } }
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

/// Causes that the first screen lists; the others are in the notes.
const MAX_CAUSES: usize = 4;

/// A section of the page.
struct Section {
    id: String,
    /// Its name in the navigation.
    name: String,
    content: Markup,
}

impl Section {
    fn new(id: &str, name: &str, content: Markup) -> Self {
        Self { id: id.to_owned(), name: name.to_owned(), content }
    }

    /// Its kind: `Calibration` of `Calibration: point`.
    fn kind(&self) -> &str {
        self.name.split(": ").next().unwrap_or(&self.name)
    }
}

/// The id and name of each entry in the navigation; sections of one kind share the entry of the first.
fn navigation_entries(sections: &[Section]) -> impl Iterator<Item = (&str, &str)> {
    sections.iter().map(|section| (&*section.id, section.kind())).unique_by(|(_, kind)| *kind)
}

/// Every section in the order of the page.
fn sections(
    report: &Report,
    attachments: &[AttachedReport],
    palette: &Palette,
    rows: &mut Rows,
    pages: Option<&Pages<'_>>,
) -> Vec<Section> {
    let marks = Marks::for_pages(pages);
    let mut sections = vec![Section::new("matrix", "Verdicts", matrix::section(report, palette, pages))];
    if let Some(check) = &report.baseline {
        sections.push(Section::new("baseline", "Baseline", baseline::section(check, pages)));
    }
    let plans = plot::plan::panels(report, plot::MAX_CASES);
    if !plans.is_empty() {
        sections.push(Section::new("plan", "Plan", plan_section(&plans)));
    }
    for procedure in report.procedures() {
        let content = procedure::section(report, procedure, palette, rows, pages);
        sections.push(Section::new(&procedure.to_string(), procedure.short(), content));
    }
    if let Some(ratios) = ratios::section(report, palette, pages) {
        sections.push(Section::new("ratios", "Before and after", ratios));
    }
    if let Some(pages) = pages {
        sections.push(Section::new("pages", "All readings", pages.section()));
    }
    sections.push(Section::new("time", "Run time", plot::times::section(report, attachments, palette, marks)));
    if let Some(stress) = attachments::stress_section(attachments, palette) {
        sections.push(Section::new("stress", "Stress", stress));
    }
    sections.push(Section::new("notes", "Notes", notes::section(report, pages)));
    sections.push(Section::new("provenance", "Provenance", provenance::section(report, palette, pages)));
    sections
}

/// The floor plans of the cases.
fn plan_section(plans: &[Markup]) -> Markup {
    html! {
        h2 id="plan-title" { "Room, luminaires and points" }
        div.panels { @for plan in plans { (plan) } }
    }
}

/// The title, the trust statements and the counts of verdicts.
fn head(report: &Report) -> Markup {
    let s = &report.summary;
    let counts = [
        (Verdict::Pass, s.pass),
        (Verdict::NotJudged, s.not_judged),
        (Verdict::KnownDeviation, s.known_deviation),
        (Verdict::Undecided, s.undecided),
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
            @for line in super::notes::time_limits(report) { p.ruled { (line) } }
            @for line in super::notes::luminaire_models(report) { p.ruled { "model: " (line) } }
            @for line in super::notes::lints(report) { p.ruled { "lint: " (line) } }
            @let sentences = &report.sentences;
            @if !sentences.is_empty() {
                h2.trust { (HEADING) }
                ul.trust { @for sentence in sentences { li { (minus(&sentence.text)) } } }
            }
            @let causes = super::notes::diagnoses(report);
            @if !causes.is_empty() {
                h2.trust { "Why readings fail" }
                ul.trust { @for cause in causes.iter().take(MAX_CAUSES) { li { (minus(cause)) } } }
            }
            @let undecided = super::notes::undecided(report);
            @if !undecided.is_empty() {
                h2.trust { "Undecided" }
                ul.trust { @for line in &undecided { li { (minus(line)) } } }
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

/// A table that scrolls alone where the page is too narrow. A heading may have a class, as in `number run time`.
pub fn table(label: &str, heads: &[&str], rows: &Markup) -> Markup {
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
        Verdict::Undecided => "undecided",
        Verdict::Fail | Verdict::UnexpectedPass | Verdict::Missing => "fail",
    }
}

/// The verdict's sign, for readers who do not see its colour.
fn glyph(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Pass => "✓",
        Verdict::NotJudged => "–",
        Verdict::KnownDeviation => "≈",
        Verdict::Undecided => "?",
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

/// A signed relative deviation with a real minus sign and raised powers of ten.
fn percent(deviation: f64) -> String {
    let text = words::percent(deviation);
    match text.trim_end_matches(" %").split_once('e').map(|(m, e)| (m, e.parse())) {
        Some((mantissa, Ok(exponent))) => minus(&format!("{mantissa}·{} %", power(exponent))),
        _ => minus(&text),
    }
}

/// Real minus signs before numbers; hyphens within words stay.
pub fn minus(text: &str) -> String {
    let mut result = String::with_capacity(text.len());
    let mut letters = text.chars().peekable();
    while let Some(letter) = letters.next() {
        let before_digit = letters.peek().is_some_and(char::is_ascii_digit);
        let within_word = result.chars().next_back().is_some_and(char::is_alphanumeric);
        result.push(if letter == '-' && before_digit && !within_word { '−' } else { letter });
    }
    result
}

/// A power of ten with a raised exponent: `10⁻⁵`.
fn power(exponent: i32) -> String {
    let digits = ["⁰", "¹", "²", "³", "⁴", "⁵", "⁶", "⁷", "⁸", "⁹"];
    let raised: String = exponent.abs().to_string().bytes().map(|b| digits[usize::from(b - b'0')]).collect();
    format!("10{}{raised}", if exponent < 0 { "⁻" } else { "" })
}

#[cfg(test)]
pub(super) mod tests;
