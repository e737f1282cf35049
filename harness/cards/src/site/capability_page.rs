//! The page on the capabilities: what each asks, which cases show it, and the rule of the cells.

use itertools::Itertools;
use luxproof_model::numbers::plural;
use maud::{Markup, html};

use super::{frame, legend};
use crate::{Capability, Cards};

pub(super) fn page(cards: &Cards) -> Markup {
    let content = html! {
        header {
            h1 { "What is tested, and how" }
            p.lead {
                "Each capability has cases with a known answer: closed forms, or an independent calculation that states its own error. "
                "luxproof runs every renderer on them and compares every point."
            }
            (legend())
        }
        section aria-labelledby="rule-title" {
            h2 id="rule-title" { "The rule" }
            ol.rule {
                li { "One wrong point in one case makes the cell " strong { "wrong" } ". No mean hides it." }
                li { "Fewer cases than the minimum make it " strong { "not tested" } ", or " strong { "not supported" } " if the renderer declines all." }
                li { "Known limits, undecided points and declined cases make it " strong { "limited" } "." }
                li { "Otherwise it is " strong { "within x %" } ": x is the largest deviation plus its expanded uncertainty (about 95 %). "
                    "That includes the uncertainty of the reference, so no cell is better than it." }
                li { "Hidden variants count like their public case, but not towards the minimum." }
            }
        }
        section aria-labelledby="all-title" {
            h2 id="all-title" { "Capabilities" }
            @for capability in &cards.capabilities.capabilities { (entry(capability)) }
        }
    };
    frame(cards, "What is tested, and how", "", &[], &content, None)
}

fn entry(capability: &Capability) -> Markup {
    html! {
        section.release id=(capability.id) {
            h3 { (capability.title) }
            p { (capability.question) }
            p.where { "At least " (plural(capability.minimum_cases, "case")) " of " (capability.case_count()) ":" }
            ul.cases {
                @for selector in &capability.cases {
                    li { code { (selector.case) } ", " (selector.procedures.iter().map(|p| p.title().to_lowercase()).join(", ")) }
                }
            }
        }
    }
}
