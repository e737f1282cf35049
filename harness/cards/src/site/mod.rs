//! The pages of the site: plain HTML that loads nothing, for any static host and for `file://`.
//!
//! The first page is the matrix of renderers by capabilities. A renderer's page has its releases, and a page of a renderer and a
//! capability has the evidence. Every text is escaped, and every path is made of slugs.

mod capability_page;
mod evidence_page;
mod hidden_page;
mod index;
mod plot;
mod releases;
mod renderer_page;
#[cfg(test)]
mod tests;

use std::collections::HashSet;

use itertools::Itertools;
use luxproof_report::{BASE_STYLE, minus};
use maud::{DOCTYPE, Markup, PreEscaped, html};

use crate::{Capability, CapabilityId, Cards, CardsError, CellCard, CellEvidence, ReleaseCard, Standing};

/// The file with every cell, in the root of the site.
pub const CARDS_FILE: &str = "cards.json";

const STYLE: &str = include_str!("cards.css");
/// The browser refuses to load anything.
const POLICY: &str =
    "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; base-uri 'none'; form-action 'none'";

/// A file of the site.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SiteFile {
    /// Relative to the root of the site, with `/` between its parts.
    pub path: String,
    pub content: String,
}

/// All pages with the JSON behind them; reports and bundles of runs are the caller's.
pub fn files(cards: &Cards, evidence: &[CellEvidence]) -> Result<Vec<SiteFile>, CardsError> {
    let mut files = vec![
        page("index.html", index::page(cards)?),
        page("capabilities.html", capability_page::page(cards)),
        SiteFile { path: CARDS_FILE.to_owned(), content: serde_json::to_string(cards)? },
    ];
    if !cards.seeds.is_empty() {
        files.push(page(hidden_page::FILE, hidden_page::page(cards)));
    }
    for renderer in &cards.renderers {
        files.push(page(&format!("renderers/{}/index.html", renderer.slug), renderer_page::page(cards, renderer)));
    }
    for of in evidence {
        let Some(capability) = cards.capabilities.capabilities.iter().find(|c| c.id == of.capability) else { continue };
        let stem = format!("renderers/{}/{}", of.renderer_slug, of.capability);
        files.push(page(&format!("{stem}.html"), evidence_page::page(cards, capability, of)));
        files.push(SiteFile { path: format!("{stem}.json"), content: serde_json::to_string(of)? });
    }
    Ok(files)
}

fn page(path: &str, markup: Markup) -> SiteFile {
    SiteFile { path: path.to_owned(), content: markup.into_string() }
}

/// A link from a page to one above it.
struct Crumb<'a> {
    link: &'a str,
    name: &'a str,
}

/// The frame of every page. `root` leads from its folder to the root of the site, as `../../`.
fn frame(
    cards: &Cards,
    title: &str,
    root: &str,
    crumbs: &[Crumb<'_>],
    content: &Markup,
    script: Option<&'static str>,
) -> Markup {
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta http-equiv="Content-Security-Policy" content=(POLICY);
                meta name="generator" content=(format!("luxproof {}", cards.tool));
                title { (title) " · luxproof score cards" }
                style { (PreEscaped(BASE_STYLE)) (PreEscaped(STYLE)) }
                noscript { style { ".filters,.unfold{display:none}" } }
            }
            body {
                a.skip href="#main" { "Skip to the content" }
                nav aria-label="Site" {
                    div.bar {
                        a.brand href={ (root) "index.html" } { "luxproof score cards" }
                        @for crumb in crumbs { span aria-hidden="true" { "›" } a href={ (root) (crumb.link) } { (crumb.name) } }
                        span.about {
                            @if !cards.seeds.is_empty() { a href={ (root) (hidden_page::FILE) } { "Hidden variants" } " " }
                            a href={ (root) "capabilities.html" } { "What is tested, and how" }
                        }
                    }
                }
                main id="main" { (content) }
                footer {
                    "Made by luxproof " (cards.tool) ". Every number is in " a href={ (root) (CARDS_FILE) } { code { (CARDS_FILE) } }
                    "; each page with evidence has a JSON file of the same name. This site loads nothing from elsewhere."
                }
                @if let Some(script) = script { script { (PreEscaped(script)) } }
            }
        }
    }
}

/// The capabilities that some release was tested for, in their order: a row without any says nothing about a renderer.
fn published(cards: &Cards) -> Vec<&Capability> {
    let releases = cards.renderers.iter().flat_map(|renderer| &renderer.releases).collect_vec();
    let capabilities = cards.capabilities.capabilities.iter();
    capabilities.filter(|capability| releases.iter().any(|release| is_tested(release, capability))).collect()
}

/// Whether a release was tested for a capability. One that declines what is there was, where enough cases are there.
fn is_tested(release: &ReleaseCard, capability: &Capability) -> bool {
    let Some(CellCard { cell, .. }) = release.cell(&capability.id) else { return false };
    match cell.standing {
        Standing::NotTested { .. } => false,
        Standing::NotSupported { .. } => cell.all_cases.saturating_sub(cell.missing.len()) >= capability.minimum_cases,
        _ => true,
    }
}

/// The capabilities without a row, as a paragraph below a table.
fn not_published(cards: &Cards, root: &str) -> Markup {
    let rows: HashSet<&CapabilityId> = published(cards).into_iter().map(|capability| &capability.id).collect();
    let missing = cards.capabilities.capabilities.iter().filter(|capability| !rows.contains(&capability.id));
    let missing = missing.collect_vec();
    html! {
        @if !missing.is_empty() {
            p.where {
                "Without a row, because the runs of this publication have too few of their cases: "
                @for (k, capability) in missing.iter().enumerate() {
                    @if k > 0 { ", " }
                    a href={ (root) "capabilities.html#" (capability.id) } { (capability.title) }
                }
                "."
            }
        }
    }
}

/// The sign of a state with its word for readers who only hear it.
fn sign(standing: &Standing) -> Markup {
    html! { span.sign aria-hidden="true" { (standing.sign()) } }
}

/// Key, sign, word and meaning of every state.
const STATES: [(&str, &str, &str, &str); 6] = [
    (
        "accurate",
        "✓",
        "within x %",
        "every point of every case is within its tolerance; no error is larger than x, uncertainty included",
    ),
    ("limited", "≈", "limited", "right within limits that are known, or not decided yet"),
    (
        "wrong",
        "✕",
        "wrong",
        "at least one value is beyond its tolerance; the cell says by how much, its page names the fault",
    ),
    ("failed", "!", "fails", "it crashes, gives no answer in time or an unreadable one"),
    ("unsupported", "–", "not supported", "it has no values: the renderer declines the cases and says why"),
    ("untested", "·", "not tested", "too few cases were run, for reasons that are not the renderer's"),
];

/// What the signs mean.
fn legend() -> Markup {
    html! {
        dl.legend {
            @for (key, sign, word, meaning) in STATES {
                div { dt class={ "s-" (key) } { span.sign aria-hidden="true" { (sign) } " " (word) } dd { (meaning) } }
            }
        }
    }
}

/// A text with real minus signs, cut at so many letters.
fn shortened(text: &str, letters: usize) -> String {
    let text = minus(text);
    if text.chars().count() <= letters {
        return text;
    }
    let cut: String = text.chars().take(letters).collect();
    // Not within a word, where one ends before.
    let end = cut.rfind(' ').filter(|end| 2 * end > cut.len()).unwrap_or(cut.len());
    format!("{}…", &cut[..end])
}
