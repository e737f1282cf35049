//! The page on hidden variants: the bound of each public case against that of its variant, renderer by renderer.

use itertools::Itertools;
use luxproof_model::numbers::trimmed;
use maud::{Markup, html};

use super::index::title;
use super::{frame, not_published, published, shortened};
use crate::cards::anchor;
use crate::{Capability, Cards, CellCard, RendererCard, Spread, WorstPoint};

pub(super) const FILE: &str = "hidden.html";
/// A bound of hidden variants that is more than this factor larger than the public one stands out.
const WIDER_FACTOR: f64 = 2.0;
/// Letters of the name of a case.
const CASE_LETTERS: usize = 30;

/// What the variants of a cell show.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Finding {
    /// No public case shows a fault, and a variant of one that is right does.
    PublicOnly,
    Wider,
    Similar,
}

impl Finding {
    fn of(spread: &Spread) -> Self {
        let [public, hidden] = [&spread.public, &spread.hidden].map(|worst| bound(worst.as_ref()));
        if spread.is_public_only {
            Self::PublicOnly
        } else if public > 0.0 && hidden > WIDER_FACTOR * public {
            Self::Wider
        } else {
            Self::Similar
        }
    }

    const fn class(self) -> &'static str {
        match self {
            Self::PublicOnly => "s-wrong",
            Self::Wider => "s-limited",
            Self::Similar => "s-unsupported",
        }
    }

    const fn sign(self) -> &'static str {
        match self {
            Self::PublicOnly => "✕",
            Self::Wider => "↑",
            Self::Similar => "=",
        }
    }
}

/// The bound of a deviation; zero without one.
fn bound(worst: Option<&WorstPoint>) -> f64 {
    worst.map_or(0.0, |worst| worst.deviation.bound())
}

pub(super) fn page(cards: &Cards) -> Markup {
    let content = html! {
        header {
            h1 { "Public cases against hidden variants" }
            p.lead {
                "Everybody knows the public cases. A seed draws a variant of each: another room, other positions, another table. "
                "A renderer that is tuned to the public cases is right there and wrong in the variants."
            }
            (tuned(cards))
            dl.legend {
                div { dt.s-wrong { (mark(Finding::PublicOnly)) " right in public only" } dd { "no fault in the public cases, and one in the variant of a case that is right" } }
                div { dt.s-limited { (mark(Finding::Wider)) " wider" } dd { "the bound of the variants is more than twice that of the same public cases" } }
                div { dt.s-unsupported { (mark(Finding::Similar)) " similar" } dd { "public and hidden cases give the same picture, right or wrong" } }
            }
        }
        section aria-labelledby="seeds-title" {
            h2 id="seeds-title" { "Seeds" }
            p {
                (if cards.seeds.len() == 1 { "Seed: " } else { "Seeds: " }) (cards.seeds.iter().join(", "))
                ". The same seed gives the same variants, to the byte: " code { "luxproof cards vary SPECS --seed " (cards.seeds.first().copied().unwrap_or_default()) " --out hidden" }
            }
        }
        section aria-labelledby="spread-title" {
            h2 id="spread-title" { "Newest releases" }
            p {
                "Each cell has the largest error, uncertainty included, of the public cases that have variants, and that of the variants. It leads to its evidence. "
                "The scenes with known results (" code { "calibration" } ") have no variants: where one of them is worse, the cell says so."
            }
            (matrix(cards))
            (not_published(cards, ""))
        }
    };
    frame(cards, "Public cases against hidden variants", "", &[], &content, None)
}

/// The cells of all releases that are right in the public cases only.
pub(super) fn tuned(cards: &Cards) -> Markup {
    let releases = cards.renderers.iter().flat_map(|renderer| renderer.releases.iter().map(move |r| (renderer, r)));
    let cells =
        releases.flat_map(|(renderer, release)| release.cells.iter().map(move |cell| (renderer, release, cell)));
    let exposed = cells.filter(|(_, _, cell)| cell.cell.spread.as_ref().is_some_and(|spread| spread.is_public_only));
    let exposed = exposed.collect_vec();
    html! {
        @if exposed.is_empty() {
            p { strong { "No renderer is right in the public cases only." } " None looks tuned to them." }
        } @else {
            p { strong { "Right in the public cases only, and so perhaps tuned to them:" } }
            ul.changes {
                @for (renderer, release, cell) in exposed {
                    li {
                        a href=(cell.page) { (renderer.name) " " (release.release) ", " (title(cards, cell.capability.as_str())) }
                        ": " (cell.headline)
                    }
                }
            }
        }
    }
}

fn mark(finding: Finding) -> Markup {
    html! { span.sign aria-hidden="true" { (finding.sign()) } }
}

fn matrix(cards: &Cards) -> Markup {
    html! {
        div.scroll tabindex="0" role="region" aria-label="Public cases against hidden variants" {
            table.cards {
                thead {
                    tr {
                        th scope="col" { "Capability" }
                        @for renderer in &cards.renderers { th scope="col" { a href={ "renderers/" (renderer.slug) "/index.html" } { (renderer.name) } (newest(renderer)) } }
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

/// The newest release in the head of a column.
fn newest(renderer: &RendererCard) -> Markup {
    html! { @if let Some(release) = renderer.releases.first() { span.release { (shortened(release.release.as_str(), 16)) } } }
}

fn row(cards: &Cards, capability: &Capability) -> Markup {
    html! {
        tr {
            th scope="row" { a href={ "capabilities.html#" (capability.id) } { (capability.title) } }
            @for renderer in &cards.renderers {
                @match renderer.releases.first().and_then(|release| Some((release, release.cell(&capability.id)?))) {
                    Some((release, cell)) => (spread_cell(renderer, cell, &anchor(&release.release))),
                    None => td {},
                }
            }
        }
    }
}

fn spread_cell(renderer: &RendererCard, cell: &CellCard, anchor: &str) -> Markup {
    let measured = cell.cell.spread.as_ref().filter(|spread| spread.hidden.is_some() || spread.is_public_only);
    html! {
        @match measured {
            None => td.s-untested data-renderer=(renderer.name) { span.cell { "no hidden values" } },
            Some(spread) => {
                @let finding = Finding::of(spread);
                td class=(finding.class()) data-renderer=(renderer.name) {
                    a.cell href={ "renderers/" (renderer.slug) "/" (cell.capability) ".html#" (anchor) } {
                        (mark(finding)) " " (ratio_text(spread, finding))
                        (side("public", spread.public.as_ref()))
                        (side("hidden", spread.hidden.as_ref()))
                        @if let Some(worst) = cell.cell.worst_without_variant() { span.since { "worst of all " strong { (worst.deviation.bound_text().replace(" %", "\u{a0}%")) } ", " (shortened(&worst.at.case_text(), CASE_LETTERS)) ", which has no variant" } }
                    }
                }
            }
        }
    }
}

/// The finding in a few words, with the ratio of the bounds where one is wider.
fn ratio_text(spread: &Spread, finding: Finding) -> String {
    match finding {
        Finding::PublicOnly => "right in public only".to_owned(),
        Finding::Wider => {
            let [public, hidden] = [&spread.public, &spread.hidden].map(|worst| bound(worst.as_ref()));
            format!("{} times wider", trimmed(hidden / public, 1))
        }
        Finding::Similar => "similar".to_owned(),
    }
}

/// The bound of one side and its worst case.
fn side(name: &str, worst: Option<&WorstPoint>) -> Markup {
    html! {
        span.since {
            (name) " "
            @match worst {
                Some(worst) => { strong { (worst.deviation.bound_text().replace(" %", "\u{a0}%")) } ", " (shortened(&worst.at.case, CASE_LETTERS)) }
                None => "no values",
            }
        }
    }
}
