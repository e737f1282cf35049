//! The comparison of the run with its baseline.

use maud::{Markup, html};

use super::{Pages, minus, rest, shown, table};
use luxproof_model::{BaselineCheck, BaselineLine};

pub(super) fn section(check: &BaselineCheck, pages: Option<&Pages<'_>>) -> Markup {
    let mut entries: Vec<&BaselineLine> = check.entries.iter().collect();
    if pages.is_some() {
        // Departures come first, since a long report shows only the beginning of the list.
        entries.sort_by_key(|entry| entry.is_as_accepted);
    }
    html! {
        h2 id="baseline-title" { "Baseline" }
        p.lead { "Against the readings accepted in " code { (check.file) } ": " (check.counts()) "." }
        (table("Against the baseline", &["case", "procedure", "engine", "state", "what moved"], &html! {
            @for entry in shown(&entries, pages) {
                @let (class, glyph) = if entry.is_as_accepted { ("v-pass", "✓") } else { ("v-fail", "✕") };
                tr {
                    th scope="row" { (entry.key.case) } td { (entry.key.procedure.title()) } td { (entry.key.engine) }
                    td class=(class) { span.glyph aria-hidden="true" { (glyph) } " " (entry.state.to_lowercase()) }
                    td.wide { @for (k, detail) in entry.lines().enumerate() { @if k > 0 { br; } (minus(detail)) } }
                }
            }
        }))
        (rest(&entries, pages, "baseline"))
    }
}
