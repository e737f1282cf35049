//! Tables of experiments, aligned for a terminal or as Markdown.

use comfy_table::{ContentArrangement, Table, presets};

pub(super) fn terminal(head: Vec<String>, rows: Vec<Vec<String>>) -> String {
    let mut table = Table::new();
    table.load_style(presets::NOTHING).set_content_arrangement(ContentArrangement::Disabled);
    table.set_header(head).add_rows(rows);
    format!("{table}\n")
}

pub(super) fn markdown(head: Vec<String>, rows: Vec<Vec<String>>) -> String {
    let rule = vec!["---".to_owned(); head.len()];
    [head, rule].iter().chain(&rows).map(|cells| format!("| {} |\n", cells.join(" | "))).collect()
}
