//! Markdown for a pull request or a step summary: verdict matrix, worst deviations, skips.

use itertools::Itertools;

use super::matrix::{Cell, matrix, worst};
use super::notes::{
    Kind, agreements, biases, decision_rules, departures, diagnoses, lacking, lints, luminaire_models, notes, policies,
    ratios, splits, tables, time_limits, undecided,
};
use super::papers;
use super::symmetry::symmetry_lines;
use super::words::{HEADING, LARGEST_ERROR_RULE};
use super::words::{mark, off, percent, significant};
use luxproof_model::{BaselineCheck, Report};
use luxproof_process::printable::markdown as inert;

/// Worst deviations that are listed.
const WORST_LINES: usize = 10;

/// A Markdown document that grows line by line.
#[derive(Default)]
struct Document(String);

impl Document {
    fn push(&mut self, line: &str) {
        self.0.push_str(line);
        self.0.push('\n');
    }

    /// Appends a list item.
    fn push_item(&mut self, text: &str) {
        self.push(&format!("- {text}"));
    }

    /// Appends a list under a summary that opens it; nothing where the list is empty.
    fn push_details(&mut self, summary: &str, items: &[String]) {
        if !items.is_empty() {
            self.push(&format!("\n<details><summary>{summary}</summary>\n\n{}\n\n</details>", items.join("\n")));
        }
    }
}

/// Renders a report as Markdown; `link` leads to the published report.
pub fn markdown(report: &Report, link: Option<&str>) -> String {
    let mut document = Document::default();
    push_head(report, &mut document);
    push_causes(report, &mut document);
    push_undecided(report, &mut document);
    push_matrix(report, &mut document);
    push_papers(report, &mut document);
    push_figures(report, &mut document);
    push_findings(report, &mut document);
    push_worst_deviations(report, &mut document);
    if let Some(check) = &report.baseline {
        push_baseline(check, &mut document);
    }
    for (k, note) in notes(report).iter().filter(|n| n.kind <= Kind::Shortcut).enumerate() {
        // An empty line begins the list.
        if k == 0 {
            document.push("");
        }
        document.push_item(&inert(&note.line(report)));
    }
    if let Some(link) = link {
        document.push(&format!("\n[The whole report]({link})"));
    }
    document.0
}

/// Appends the title, the trust statements, the summary and the rules.
fn push_head(report: &Report, document: &mut Document) {
    document.push(&format!("## luxproof: {}", inert(&report.spec.title)));
    document.push("");
    for line in time_limits(report) {
        document.push_item(&inert(&line));
    }
    for model in luminaire_models(report) {
        document.push_item(&format!("model: {}", inert(&model)));
    }
    for lint in lints(report) {
        document.push_item(&format!("lint: {}", inert(&lint)));
    }
    if !report.sentences.is_empty() {
        document.push(&format!("\n{HEADING}:\n"));
    }
    for sentence in &report.sentences {
        document.push_item(&inert(&sentence.text));
    }
    document.push(&format!("\n{} in {:.1} s\n", report.summary, report.wall_s));
    for rule in decision_rules(report) {
        document.push(&format!("{}\n", inert(rule)));
    }
    for policy in policies(report).into_iter().chain(lacking(report)) {
        document.push(&format!("{}\n", inert(&policy)));
    }
}

/// Appends why readings fail, each cause once.
fn push_causes(report: &Report, document: &mut Document) {
    let causes = diagnoses(report);
    if causes.is_empty() {
        return;
    }
    document.push("Why readings fail:\n");
    for cause in &causes {
        document.push_item(&inert(cause));
    }
    document.push("");
}

/// Appends what is undecided, why, and what to do next.
fn push_undecided(report: &Report, document: &mut Document) {
    let undecided = undecided(report);
    if undecided.is_empty() {
        return;
    }
    document.push("Undecided:\n");
    for line in &undecided {
        document.push_item(&inert(line));
    }
    document.push("");
}

fn push_matrix(report: &Report, document: &mut Document) {
    let engines: Vec<String> = report.engines.iter().map(|e| inert(e.id.as_str())).collect();
    document.push(&format!("| {}procedure | against | {} |", report.of_suite("case", " | "), engines.join(" | ")));
    document.push(&format!("|---|---|{}", "---|".repeat(engines.len() + usize::from(report.is_suite()))));
    for row in matrix(report) {
        let cells: Vec<String> = row.cells.iter().map(Cell::text).collect();
        let case = report.of_suite(&inert(&row.case), " | ");
        document.push(&format!("| {case}{} | {} | {} |", inert(&row.label), row.basis, cells.join(" | ")));
    }
    document.push(&format!("\nIn each cell, {LARGEST_ERROR_RULE}."));
    for (k, line) in symmetry_lines(report).iter().enumerate() {
        // An empty line ends the table.
        if k == 0 {
            document.push("");
        }
        document.push_item(&inert(line));
    }
}

/// Appends published tables with our readings.
fn push_papers(report: &Report, document: &mut Document) {
    for grid in papers::grids(report) {
        let (title, head, rule) = (inert(&grid.title), joined(&grid.head), "---|".repeat(grid.head.len()));
        document.push(&format!("\n<details><summary>{title}</summary>\n\n| {head} |\n|{rule}"));
        for row in grid.rows {
            document.push(&format!("| {} |", joined(&row)));
        }
        document.push("\n</details>");
    }
}

/// Appends biases, agreements of sets of meters, and ratios of compared cases.
fn push_figures(report: &Report, document: &mut Document) {
    let (mut bias_items, mut agreement_items) = (vec![], vec![]);
    for procedure in report.procedures() {
        bias_items.extend(biases(report, procedure).iter().map(|line| format!("- {procedure}, {}", inert(line))));
        let agreements = agreements(report, procedure);
        agreement_items.extend(agreements.iter().map(|line| format!("- {procedure}, {}", inert(line))));
    }
    let ratio_items: Vec<String> = ratios(report).iter().map(|ratio| format!("- {}", inert(ratio))).collect();
    document.push_details("Mean error per engine (with interval and p-value)", &bias_items);
    document.push_details("Sets of meters: their figures against the reference", &agreement_items);
    document.push_details("Means of sets of meters, after over before", &ratio_items);
}

/// Appends splits, departures and misfits of published tables.
fn push_findings(report: &Report, document: &mut Document) {
    let splits = splits(report);
    if !splits.is_empty() {
        document.push("");
    }
    for (place, split) in splits {
        document.push_item(&format!("{}: {}", inert(&place), inert(split)));
    }
    let departures = departures(report);
    if !departures.is_empty() {
        document.push("\nWhich engine disagrees with the others:\n");
    }
    for departure in &departures {
        document.push_item(&inert(departure));
    }
    let misfits = tables(report);
    if !misfits.is_empty() {
        document.push("\nWhat does not fit in published tables:\n");
    }
    for misfit in &misfits {
        document.push_item(&inert(misfit));
    }
}

fn push_baseline(check: &BaselineCheck, document: &mut Document) {
    document.push(&format!("\nBaseline {}: {}", inert(&check.file), check.counts()));
    for difference in check.differences_within_noise() {
        document.push(&format!("\nWithin noise: {}", inert(&difference)));
    }
    for (k, entry) in check.differences().enumerate() {
        // An empty line begins the list.
        if k == 0 {
            document.push("");
        }
        let place = format!("{} {} {}", entry.key.case, entry.key.procedure, entry.key.engine);
        let details = inert(&entry.lines().join("; "));
        document.push_item(&format!("**{}** {}: {details}", entry.state.to_lowercase(), inert(&place)));
    }
}

fn push_worst_deviations(report: &Report, document: &mut Document) {
    let worst = worst(report, WORST_LINES);
    if worst.is_empty() {
        return;
    }
    document
        .push("\n| worst deviations | meter | value | reference | deviation | verdict |\n|---|---|---|---|---|---|");
    for c in worst {
        document.push(&format!(
            "| {}{} {} | {} | {} | {} | {} | {} |",
            report.of_suite(&inert(&c.key.case), " "),
            inert(&c.key.engine),
            c.key.procedure,
            inert(&c.meter.0),
            c.value.map_or("-".to_owned(), significant),
            c.reference.as_ref().map_or("-".to_owned(), |r| significant(r.value)),
            off(c, percent).unwrap_or("-".to_owned()),
            mark(c.verdict)
        ));
    }
}

/// The cells of a row, joined.
fn joined(cells: &[String]) -> String {
    cells.iter().map(|cell| inert(cell)).collect::<Vec<_>>().join(" | ")
}
