//! Tables of experiments, aligned for a terminal or as Markdown, where what people and programs wrote is no markup.

use comfy_table::{ContentArrangement, Table, presets};

use crate::system::printable;

pub(super) fn terminal(head: Vec<String>, rows: Vec<Vec<String>>) -> String {
    let mut table = Table::new();
    table.load_style(presets::NOTHING).set_content_arrangement(ContentArrangement::Disabled);
    table.set_header(head).add_rows(rows);
    format!("{table}\n")
}

#[allow(clippy::needless_pass_by_value, reason = "called as the other form is")]
pub(super) fn markdown(head: Vec<String>, rows: Vec<Vec<String>>) -> String {
    let inert = |row: &Vec<String>| row.iter().map(|cell| printable::markdown(cell)).collect();
    joined(inert(&head), rows.iter().map(inert).collect())
}

/// The same of cells that are Markdown already.
#[allow(clippy::needless_pass_by_value, reason = "called as the other forms are")]
pub(super) fn joined(head: Vec<String>, rows: Vec<Vec<String>>) -> String {
    let rule = vec!["---".to_owned(); head.len()];
    let line = |cells: &Vec<String>| format!("| {} |", cells.join(" | "));
    let lines: Vec<String> = [head, rule].iter().chain(&rows).map(line).collect();
    lines.join("\n") + "\n"
}
