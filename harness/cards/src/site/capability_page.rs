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
                li { "A point passes if its deviation with its expanded uncertainty stays within the " strong { "tolerance" } ". The first page states it for each capability, and the page of each cell for its cases." }
                li { "One wrong point in one case makes the cell " strong { "wrong" } ". No mean hides it. The cell says by how much it is off." }
                li { "A run that its time limit cut short decides nothing: values that would be wrong count as " strong { "no answer in time" } "." }
                li { "A renderer that declines cases and has no values is " strong { "not supported" } ". If it has values too, the cell is " strong { "limited" } "." }
                li { "Fewer cases than the minimum that were run make it " strong { "not tested" } ". A capability that no release was tested for has no row." }
                li { "Known limits, undecided points and declined cases make it " strong { "limited" } "." }
                li { "Otherwise it is " strong { "within x %" } ": x is the largest deviation plus its expanded uncertainty (about 95 %). "
                    "That includes the uncertainty of the reference, so no cell is better than it." }
                li { "Hidden variants count like their public case, but not towards the minimum." }
            }
        }
        section aria-labelledby="words-title" {
            h2 id="words-title" { "Words" }
            dl.words { @for (word, meaning) in WORDS { dt { (word) } dd { (meaning) } } }
        }
        section aria-labelledby="all-title" {
            h2 id="all-title" { "Capabilities" }
            @for capability in &cards.capabilities.capabilities { (entry(capability)) }
        }
    };
    frame(cards, "What is tested, and how", "", &[], &content, None)
}

/// What names of cases and terms on the site mean.
const WORDS: [(&str, &str); 12] = [
    (
        "calibration",
        "scenes with a known result that every run has. The word in parentheses names the scene. They have no hidden variants.",
    ),
    (
        "furnace",
        "a closed room of even light, so that every point has the same known light. Lost or added light shows at once.",
    ),
    (
        "5.2 to 5.14",
        "test cases of CIE 171:2006, by the number of their section. A part such as 1m-sky-16 names the size of the opening and the sky.",
    ),
    ("rho-10, rho-50, rho-90", "all surfaces of the room reflect 10, 50 or 90 % of the light."),
    ("s1, s2", "s1 is a luminaire that shines up in a 20 m cube; s2 is an office with furniture."),
    (
        "readers",
        "one small photometric file per case. Each has one feature that readers of such files treat differently.",
    ),
    ("hidden variant", "the same case with another room, other positions and another table, drawn from a seed."),
    (
        "tolerance",
        "the largest deviation from the right value with which a point passes: a part of that value, or a fixed amount near zero.",
    ),
    ("expanded uncertainty", "twice the standard uncertainty. The right value lies within it in about 95 % of cases."),
    (
        "hand method",
        "a formula of handbooks that luxproof computes, such as the zonal cavity method (iesna). It is judged by the accuracy that it claims.",
    ),
    ("simulator", "luxproof's own calculation, which states its error. It judges what has no closed form."),
    ("UGR", "unified glare rating. Its deviations are differences, not parts."),
];

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
