//! What failed, was skipped, follows by a shortcut, is approximate or was noted; methods apart from renderers; who departs.

use std::collections::BTreeSet;

use maud::{Markup, html};

use super::super::Report;
use super::super::notes::{Kind, Note, departures, notes, splits, tables};
use super::super::words::plural;
use super::{Pages, minus, rest, shown, table};

pub(super) fn section(report: &Report, pages: Option<&Pages<'_>>) -> Markup {
    let (notes, splits, departures, tables) = (notes(report), splits(report), departures(report), tables(report));
    html! {
        h2 id="notes-title" { "Skipped, approximated, noted" }
        @if report.summary.skipped == 0 {
            p.lead { "Nothing was skipped: every engine ran every procedure of every case." }
        }
        @if !notes.is_empty() {
            p.lead { "A shortcut is a reading with less work: meters that follow from others, light paths that carry nothing." }
            (table("Notes", &["what", "engine", "procedures", "cases", "why"], &html! { @for note in shown(&notes, pages) { (row(note)) } }))
            (rest(&notes, pages, "recordings"))
        }
        @if !departures.is_empty() {
            h3 { "Who departs from the other witnesses, the reference included" }
            ul.notes { @for line in shown(&departures, pages) { li { (minus(line)) } } }
            (rest(&departures, pages, "consensus"))
        }
        @if !tables.is_empty() {
            h3 { "What does not fit in published tables" }
            ul.notes { @for line in &tables { li { (line) } } }
        }
        @if !splits.is_empty() {
            h3 { "Methods apart from renderers" }
            p.lead { "Where an approximate method differs from a renderer, what of it is the method's and what the renderer's; the widest of each." }
            ul.notes { @for (place, split) in shown(&splits, pages) { li { span.where { (place) } " " (minus(split)) } } }
            (rest(&splits, pages, "splits"))
        }
    }
}

fn row(note: &Note<'_>) -> Markup {
    let cases: BTreeSet<&str> = note.jobs.iter().map(|(case, _)| *case).collect();
    let procedures: BTreeSet<&str> = note.jobs.iter().map(|(_, procedure)| procedure.row().title).collect();
    let class = if note.kind <= Kind::Finding { "v-fail" } else { "" };
    html! {
        tr { td class=(class) { (note.kind) } th scope="row" { (note.engine) }
            td { (Vec::from_iter(procedures).join(", ")) }
            td { @if cases.len() > 3 { (plural(cases.len(), "case")) } @else { (Vec::from_iter(cases).join(", ")) } }
            td.wide { (note.text) } }
    }
}
