//! Tables of experiments: aligned for a terminal, or as Markdown in which text of users and
//! programs is escaped.

use comfy_table::{ContentArrangement, Table, presets};

use luxproof_process::printable;

/// An aligned table for a terminal.
pub(super) fn format_terminal(head: Vec<String>, rows: Vec<Vec<String>>) -> String {
    let mut table = Table::new();
    table.load_style(presets::NOTHING).set_content_arrangement(ContentArrangement::Disabled);
    table.set_header(head).add_rows(rows);
    format!("{table}\n")
}

/// A Markdown table with escaped cells.
#[allow(clippy::needless_pass_by_value, reason = "views take either this function or `format_terminal`")]
pub(super) fn format_escaped_markdown(head: Vec<String>, rows: Vec<Vec<String>>) -> String {
    format_markdown(escape_cells(&head), rows.iter().map(|row| escape_cells(row)).collect())
}

/// A Markdown table of cells that are Markdown already.
#[allow(clippy::needless_pass_by_value, reason = "takes the same arguments as the other functions")]
pub(super) fn format_markdown(head: Vec<String>, rows: Vec<Vec<String>>) -> String {
    let rule = vec!["---".to_owned(); head.len()];
    let lines: Vec<String> =
        [head, rule].iter().chain(&rows).map(|cells| format!("| {} |", cells.join(" | "))).collect();
    lines.join("\n") + "\n"
}

/// Escapes cells, so that text of users and programs is not read as Markdown.
fn escape_cells(cells: &[String]) -> Vec<String> {
    cells.iter().map(|cell| printable::markdown(cell)).collect()
}
