//! The first page: renderers by capabilities, each at its newest release.

use itertools::Itertools;
use luxproof_model::numbers::plural;
use maud::{Markup, PreEscaped, html};

use super::releases::release_data;
use super::{STATES, frame, hidden_page, legend, not_published, published, shortened, sign};
use crate::cards::anchor;
use crate::stated_tolerance::{summary, widest};
use crate::{Capability, Cards, CardsError, CellCard, RendererCard, Since, Standing, StatedTolerance};

const SCRIPT: &str = include_str!("index.js");
/// Letters of a fault that the matrix shows.
const SHOWN_LETTERS: usize = 58;
/// Letters of the name of a case that the matrix shows.
const CASE_LETTERS: usize = 30;
/// Changes that the first page lists.
const LISTED_CHANGES: usize = 12;

pub(super) fn page(cards: &Cards) -> Result<Markup, CardsError> {
    let data = release_data(cards)?;
    let judged: Vec<&RendererCard> = cards.renderers.iter().filter(|renderer| !renderer.is_own).collect();
    let releases: usize = judged.iter().map(|renderer| renderer.releases.len()).sum();
    let content = html! {
        header {
            h1 { "What each renderer can be trusted for" }
            p.lead {
                "Does it read the photometric file, and is the light right? "
                (plural(judged.len(), "renderer")) " in " (plural(releases, "release")) ", judged by closed forms and by an "
                "independent calculation that states its own error. The worst point of the worst case counts. Each cell leads to its evidence."
            }
            p.lead {
                "Each row has its " strong { "tolerance" } ": a point passes if its error, with its expanded uncertainty (about 95 %), "
                "stays within that part of the right value. "
                a href="capabilities.html#rule-title" { "The rule" } " and " a href="capabilities.html#words-title" { "the words" } "."
            }
            (legend())
        }
        section aria-labelledby="matrix-title" {
            h2 id="matrix-title" { "Newest releases" }
            (filters())
            (matrix(cards))
            (not_published(cards, ""))
            // Data, and no script: the browser runs nothing of it.
            script id="releases" type="application/json" { (PreEscaped(data)) }
        }
        (hidden_variants(cards))
        (latest_changes(cards))
    };
    Ok(frame(cards, "What each renderer can be trusted for", "", &[], &content, Some(SCRIPT)))
}

/// Search and filters, which work with the script only; the page does not need them. The script fills the list of releases.
fn filters() -> Markup {
    html! {
        div.filters role="search" {
            label { "Search " input id="search" type="search" placeholder="renderer or capability" autocomplete="off"; }
            label {
                "Show " select id="state" {
                    option value="" { "every state" }
                    @for (key, _, word, _) in STATES { option value=(key) { (word) } }
                }
            }
            label { "Releases " select id="release" { option value="" { "the newest of each" } } }
            output id="shown" for="search state release" {}
        }
    }
}

fn matrix(cards: &Cards) -> Markup {
    html! {
        div.scroll tabindex="0" role="region" aria-label="Renderers by capabilities" {
            table.cards id="matrix" {
                thead {
                    tr {
                        th scope="col" { "Capability" }
                        @for renderer in &cards.renderers { th scope="col" data-name=(renderer.name.to_lowercase()) { (column_head(renderer)) } }
                    }
                }
                @for (group, capabilities) in &published(cards).into_iter().chunk_by(|c| c.group.as_str()) {
                    tbody {
                        tr.group { th scope="rowgroup" colspan=(cards.renderers.len() + 1) { (group) } }
                        @for capability in capabilities { (row(cards, capability)) }
                    }
                }
            }
        }
    }
}

/// The renderer, its newest release, and the button that unfolds the others.
fn column_head(renderer: &RendererCard) -> Markup {
    let newest = renderer.releases.first();
    let label = newest.map(|release| release.release.as_str()).unwrap_or_default();
    let package = newest.and_then(|release| release.packages.iter().next());
    html! {
        a href={ "renderers/" (renderer.slug) "/index.html" } { (renderer.name) }
        span.release { (shortened(label, 16)) }
        // The number of a package is not that of the program in it.
        @if let Some(package) = package.filter(|package| !package.starts_with(&renderer.name)) {
            span.release { (shortened(package, 24)) }
        }
        @if renderer.is_own { span.release { "luxproof's own" } }
        @if newest.is_some_and(|release| release.is_recorded) { span.release { "recorded values" } }
        @if renderer.releases.len() > 1 {
            button.unfold type="button" aria-expanded="false" { (renderer.releases.len()) " releases" }
        }
    }
}

fn row(cards: &Cards, capability: &Capability) -> Markup {
    let text = format!("{} {} {}", capability.group, capability.title, capability.question).to_lowercase();
    let tolerances = row_tolerances(cards, capability);
    html! {
        tr data-text=(text) {
            th scope="row" {
                a href={ "capabilities.html#" (capability.id) } { (capability.title) }
                @if let Some(tolerance) = summary(&tolerances) { span.since { "tolerance " (tolerance.replace(" %", "\u{a0}%")) } }
            }
            @for renderer in &cards.renderers {
                @match renderer.releases.first().and_then(|release| release.cell(&capability.id)) {
                    Some(cell) => (matrix_cell(renderer, cell, &tolerances)),
                    None => td {},
                }
            }
        }
    }
}

/// The tolerances of a capability: those of the renderers, or of luxproof's own solvers where no renderer has values.
fn row_tolerances(cards: &Cards, capability: &Capability) -> Vec<StatedTolerance> {
    let [of_renderers, own] = [false, true].map(|is_own| {
        let releases = cards.renderers.iter().filter(|of| of.is_own == is_own).flat_map(|of| &of.releases);
        let cells = releases.filter_map(|release| release.cell(&capability.id));
        StatedTolerance::all_of(cells.flat_map(|cell| cell.cell.tolerances.iter().cloned()))
    });
    if of_renderers.is_empty() { own } else { of_renderers }
}

fn matrix_cell(renderer: &RendererCard, cell: &CellCard, of_row: &[StatedTolerance]) -> Markup {
    let standing = &cell.cell.standing;
    // Only hand methods have wider tolerances than renderers.
    let is_wider = widest(&cell.cell.tolerances) > widest(of_row);
    let own_tolerance = summary(&cell.cell.tolerances).filter(|_| renderer.is_own && is_wider);
    html! {
        td class={ "s-" (standing.key()) } data-renderer=(renderer.name) {
            a.cell href=(cell.page) {
                (sign(standing)) " " (cell.headline.replace(" %", "\u{a0}%"))
                @match standing {
                    Standing::Wrong { fault: text, .. } | Standing::Limited { what: text, .. } => span.why { (shortened(first_clause(text), SHOWN_LETTERS)) },
                    Standing::Failed { reason, .. } | Standing::NotSupported { reason } => span.why { (shortened(reason, SHOWN_LETTERS)) },
                    Standing::Accurate { .. } | Standing::NotTested { .. } => {},
                }
                @if let Some(tolerance) = own_tolerance { span.why { "a hand method, judged by the accuracy that it claims: " (tolerance.replace(" %", "\u{a0}%")) } }
                @if let Some(place) = standing.place() { span.since { "worst: " (shortened(&place.case_text(), CASE_LETTERS)) } }
                @if let Some(since) = renderer.since(&cell.capability) { (since_line(since)) }
            }
        }
    }
}

/// Since when a cell is what it is.
fn since_line(since: Since<'_>) -> Markup {
    html! {
        span.since {
            @match since {
                Since::All { releases } => { "in all " (releases) " releases" }
                Since::Release { since, before } => { "since " strong { (shortened(since.as_str(), 16)) } ", before: " (before.headline.replace(" %", "\u{a0}%")) }
            }
        }
    }
}

/// A text up to its evidence: diagnoses have it behind a colon.
pub(super) fn first_clause(text: &str) -> &str {
    /// A shorter clause says only that a cause follows.
    const SHORTEST: usize = 14;
    let clause = text.split_once(": ").map_or(text, |(clause, _)| clause);
    if clause.len() < SHORTEST { text } else { clause }
}

/// What hidden variants are, what they show, and their seeds.
fn hidden_variants(cards: &Cards) -> Markup {
    html! {
        @if !cards.seeds.is_empty() {
            section aria-labelledby="hidden-title" {
                h2 id="hidden-title" { "Hidden variants" }
                p.lead {
                    "A renderer could be tuned to cases that everyone knows. So each case was also run in a variant that a seed draws anew: "
                    "another room, other positions, another table. The worst of both counts. "
                    (if cards.seeds.len() == 1 { "Seed: " } else { "Seeds: " }) (cards.seeds.iter().join(", ")) "."
                }
                (hidden_page::tuned(cards))
                p { a href=(hidden_page::FILE) { "Public cases against hidden variants, renderer by renderer" } }
            }
        }
    }
}

fn latest_changes(cards: &Cards) -> Markup {
    let newest = cards.renderers.iter().flat_map(|renderer| {
        let release = renderer.releases.iter().find(|release| !release.changes.is_empty());
        release
            .into_iter()
            .flat_map(move |release| release.changes.iter().map(move |change| (renderer, release, change)))
    });
    let newest: Vec<_> = newest.collect();
    html! {
        @if !newest.is_empty() {
            section aria-labelledby="changes-title" {
                h2 id="changes-title" { "Latest changes" }
                ul.changes {
                    @for (renderer, release, change) in newest.iter().take(LISTED_CHANGES) {
                        li {
                            a href={ "renderers/" (renderer.slug) "/" (change.capability) ".html#" (anchor(&release.release)) } {
                                (renderer.name) " " (release.release) ", " (title(cards, change.capability.as_str()))
                            }
                            ": " (change.from) " in " (change.before) ", " strong { (change.to) } " now"
                        }
                    }
                }
                @if newest.len() > LISTED_CHANGES {
                    p { (newest.len() - LISTED_CHANGES) " more are on the pages of the renderers." }
                }
            }
        }
    }
}

/// The title of a capability.
pub(super) fn title<'a>(cards: &'a Cards, id: &'a str) -> &'a str {
    let mut all = cards.capabilities.capabilities.iter();
    all.find(|capability| capability.id.as_str() == id).map_or(id, |capability| &capability.title)
}
