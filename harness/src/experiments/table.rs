//! A table of text, for a terminal or as Markdown.

pub(super) type Render = fn(&[String], &[Vec<String>]) -> String;

pub(super) fn terminal(head: &[String], rows: &[Vec<String>]) -> String {
    let mut table = comfy_table::Table::new();
    table.load_style(comfy_table::presets::NOTHING);
    table.set_content_arrangement(comfy_table::ContentArrangement::Disabled);
    table.set_header(head);
    table.add_rows(rows);
    format!("{table}\n")
}

pub(super) fn markdown(head: &[String], rows: &[Vec<String>]) -> String {
    let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
    let rule = vec!["---".to_owned(); head.len()];
    [head, &rule].into_iter().chain(rows.iter().map(Vec::as_slice)).map(line).collect()
}
