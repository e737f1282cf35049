//! The page of a renderer: its releases by capabilities, and what changed between them.

use itertools::Itertools;
use luxproof_model::numbers::plural;
use maud::{Markup, html};

use super::index::title;
use super::{Crumb, frame, legend, not_published, published, shortened, sign};
use crate::cards::anchor;
use crate::{Capability, Cards, ReleaseCard, RendererCard, Standing};

const ROOT: &str = "../../";

pub(super) fn page(cards: &Cards, renderer: &RendererCard) -> Markup {
    let content = html! {
        header {
            h1 { (renderer.name) }
            p.lead {
                (plural(renderer.releases.len(), "release")) ", the newest first. "
                "A bar at the left of a cell marks a change from the release before. Each cell leads to its evidence."
                @if renderer.is_own { " This is a solver of luxproof itself, judged by closed forms." }
            }
            (legend())
        }
        section aria-labelledby="releases-title" {
            h2 id="releases-title" { "Releases" }
            div.scroll tabindex="0" role="region" aria-label="Releases by capabilities" {
                table.cards.releases {
                    thead {
                        tr {
                            th scope="col" { "Capability" }
                            @for release in &renderer.releases { th scope="col" { a href={ "#" (anchor(&release.release)) } { (shortened(release.release.as_str(), 24)) } } }
                        }
                    }
                    @for (group, capabilities) in &published(cards).into_iter().chunk_by(|c| c.group.as_str()) {
                        tbody {
                            tr.group { th scope="rowgroup" colspan=(renderer.releases.len() + 1) { (group) } }
                            @for capability in capabilities { (row(renderer, capability)) }
                        }
                    }
                }
            }
            (not_published(cards, ROOT))
        }
        section aria-labelledby="changes-title" {
            h2 id="changes-title" { "What changed" }
            @for release in &renderer.releases { (release_changes(cards, renderer, release)) }
        }
    };
    frame(cards, &renderer.name, ROOT, &[], &content, None)
}

fn row(renderer: &RendererCard, capability: &Capability) -> Markup {
    html! {
        tr {
            th scope="row" { a href={ (ROOT) "capabilities.html#" (capability.id) } { (capability.title) } }
            @for release in &renderer.releases {
                @match release.cell(&capability.id) {
                    Some(cell) => {
                        @let standing = &cell.cell.standing;
                        @let is_changed = release.changes.iter().any(|change| change.capability == capability.id);
                        td class={ "s-" (standing.key()) @if is_changed { " changed" } } data-renderer=(release.release) {
                            a.cell href={ (capability.id) ".html#" (anchor(&release.release)) } { (sign(standing)) " " (short(standing)) }
                        }
                    }
                    None => td {},
                }
            }
        }
    }
}

/// A cell of a release: its bound, or its state.
fn short(standing: &Standing) -> String {
    match standing {
        Standing::Accurate { worst: Some(worst) } => worst.deviation.bound_text(),
        Standing::Limited { worst: Some(worst), .. } => format!("limited, {}", worst.deviation.bound_text()),
        Standing::Wrong { worst: Some(worst), .. } => format!("off by {}", worst.deviation.bound_text()),
        other => other.headline(),
    }
}

fn release_changes(cards: &Cards, renderer: &RendererCard, release: &ReleaseCard) -> Markup {
    let is_first = renderer.releases.last().is_some_and(|last| last.release == release.release);
    html! {
        section.release id=(anchor(&release.release)) {
            h3 { (renderer.name) " " (release.release) }
            @if release.is_recorded { p { "Recorded values: this release cannot be run again here." } }
            @if is_first {
                p { "The first release here." }
            } @else if release.changes.is_empty() {
                p { "Nothing changed." }
            } @else {
                ul.changes {
                    @for change in &release.changes {
                        li {
                            a href={ (change.capability) ".html#" (anchor(&release.release)) } { (title(cards, change.capability.as_str())) }
                            ": " (change.from) " in " (change.before) ", " strong { (change.to) } " now"
                        }
                    }
                }
            }
            p.where {
                @let version = release.version_text();
                @if !version.is_empty() { "Version: " (version) ". " }
                @let runs = cards.runs.iter().filter(|run| release.runs.contains(&run.id)).collect_vec();
                @for run in &runs {
                    @if let Some(report) = &run.report { a href={ (ROOT) (report) } { "Report of " (run.started.split('T').next().unwrap_or_default()) } " " }
                }
            }
        }
    }
}

/// The crumb to this page.
pub(super) fn crumb_link(slug: &str) -> String {
    format!("renderers/{slug}/index.html")
}

/// The crumb of a renderer.
pub(super) const fn crumb<'a>(link: &'a str, name: &'a str) -> Crumb<'a> {
    Crumb { link, name }
}
