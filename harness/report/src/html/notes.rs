//! Notes, departures, misfits of published tables, and methods compared with renderers.

use std::collections::BTreeSet;

use maud::{Markup, html};

use super::super::notes::{Kind, Note, departures, notes, splits, tables};
use super::super::words::plural;
use super::{Pages, minus, rest, shown, table};
use luxproof_model::Report;

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
            h3 { "Which engine disagrees with the others" }
            ul.notes { @for line in shown(&departures, pages) { li { (minus(line)) } } }
            (rest(&departures, pages, "consensus"))
        }
        @if !tables.is_empty() {
            h3 { "What does not fit in published tables" }
            ul.notes { @for line in &tables { li { (line) } } }
        }
        @if !splits.is_empty() {
            h3 { "How much of the difference is due to the hand-calculation method" }
            p.lead { "Where an approximate method differs from a renderer: the share of the method and that of the renderer; the widest of each." }
            ul.notes { @for (place, split) in shown(&splits, pages) { li { span.where { (place) } " " (minus(split)) } } }
            (rest(&splits, pages, "splits"))
        }
    }
}

/// A row of the table of notes.
fn row(note: &Note<'_>) -> Markup {
    let cases: BTreeSet<&str> = note.jobs.iter().map(|(case, _)| *case).collect();
    let procedures: BTreeSet<&str> = note.jobs.iter().map(|(_, procedure)| procedure.title()).collect();
    let class = if note.kind <= Kind::Finding { "v-fail" } else { "" };
    html! {
        tr { td class=(class) { (note.kind) } th scope="row" { (note.engine) }
            td { (Vec::from_iter(procedures).join(", ")) }
            td { @if cases.len() > 3 { (plural(cases.len(), "case")) } @else { (Vec::from_iter(cases).join(", ")) } }
            td.wide { (note.text) } }
    }
}
