//! Markdown for a pull request or a step summary: verdict matrix, worst deviations, skips.

use std::fmt::Write;

use super::matrix::{Cell, matrix, worst};
use super::notes::{
    Kind, agreements, biases, decision_rules, departures, lacking, notes, policies, ratios, splits, tables,
};
use super::sentences::{HEADING, sentences};
use super::words::{mark, off, percent, significant};
use super::{Report, papers};
use crate::record::ProcedureId;
use crate::system::printable::markdown as inert;

/// `link` leads to the whole report, where it is published.
pub fn markdown(report: &Report, link: Option<&str>) -> String {
    let mut text = String::new();
    let mut line = |l: String| {
        text.push_str(&l);
        text.push('\n');
    };
    line(format!("## luxproof: {}", inert(&report.spec.title)));
    let sentences = sentences(report);
    if !sentences.is_empty() {
        line(format!("\n{HEADING}:\n"));
    }
    for sentence in &sentences {
        line(format!("- {}", inert(&sentence.text)));
    }
    line(format!("\n{} in {:.1} s\n", report.summary, report.wall_s));
    for rule in decision_rules(report) {
        line(format!("{}\n", inert(rule)));
    }
    for policy in policies(report).into_iter().chain(lacking(report)) {
        line(format!("{}\n", inert(&policy)));
    }
    let engines: Vec<String> = report.engines.iter().map(|e| inert(e.id.as_str())).collect();
    line(format!("| {}procedure | against | {} |", report.of_suite("case", " | "), engines.join(" | ")));
    line(format!("|---|---|{}", "---|".repeat(engines.len() + usize::from(report.is_suite()))));
    for row in matrix(report) {
        let cells: Vec<String> = row.cells.iter().map(Cell::text).collect();
        let case = report.of_suite(&inert(&row.case), " | ");
        line(format!("| {case}{} | {} | {} |", inert(&row.label), row.basis, cells.join(" | ")));
    }
    for grid in papers::grids(report) {
        line(format!(
            "\n<details><summary>{}</summary>\n\n| {} |\n|{}",
            inert(&grid.title),
            joined(&grid.head),
            "---|".repeat(grid.head.len())
        ));
        for row in grid.rows {
            line(format!("| {} |", joined(&row)));
        }
        line("\n</details>".to_owned());
    }
    let bias = |p: ProcedureId| biases(report, p).into_iter().map(move |line| format!("- {p}, {}", inert(&line)));
    let biases: Vec<String> = report.procedures().into_iter().flat_map(bias).collect();
    if !biases.is_empty() {
        let summary = "Bias: mean deviation, its interval, p of none";
        line(format!("\n<details><summary>{summary}</summary>\n\n{}\n\n</details>", biases.join("\n")));
    }
    let agreement =
        |p: ProcedureId| agreements(report, p).into_iter().map(move |line| format!("- {p}, {}", inert(&line)));
    let agreements: Vec<String> = report.procedures().into_iter().flat_map(agreement).collect();
    if !agreements.is_empty() {
        let summary = "Sets of meters: what they come to, against the reference";
        line(format!("\n<details><summary>{summary}</summary>\n\n{}\n\n</details>", agreements.join("\n")));
    }
    let ratios = ratios(report);
    if !ratios.is_empty() {
        let summary = "Means of sets of meters, after over before";
        let lines = ratios.iter().map(|ratio| format!("- {}", inert(ratio))).collect::<Vec<_>>().join("\n");
        line(format!("\n<details><summary>{summary}</summary>\n\n{lines}\n\n</details>"));
    }
    let splits = splits(report);
    if !splits.is_empty() {
        line(String::new());
        for (place, split) in splits {
            line(format!("- {}: {}", inert(&place), inert(split)));
        }
    }
    let departures = departures(report);
    if !departures.is_empty() {
        line("\nWho departs from the other witnesses, the reference included:\n".into());
        for departure in &departures {
            line(format!("- {}", inert(departure)));
        }
    }
    for (k, told) in tables(report).iter().enumerate() {
        line(format!(
            "{}- {told}",
            if k == 0 { "\nWhat does not fit in published tables:\n\n" } else { "" },
            told = inert(told)
        ));
    }
    worst_deviations(report, &mut line);
    if let Some(check) = &report.baseline {
        line(format!("\nBaseline {}: {}", inert(&check.file), check.counts()));
        for (k, entry) in check.departures().enumerate() {
            let gap = if k == 0 { "\n" } else { "" };
            let place = format!("{} {} {}", entry.key.case, entry.key.procedure, entry.key.engine);
            let details = inert(&entry.details.join("; "));
            line(format!("{gap}- **{}** {}: {details}", entry.state.to_lowercase(), inert(&place)));
        }
    }
    for (k, note) in notes(report).iter().filter(|n| n.kind <= Kind::Shortcut).enumerate() {
        line(format!("{}- {}", if k == 0 { "\n" } else { "" }, inert(&note.line(report))));
    }
    if let Some(link) = link {
        writeln!(text, "\n[The whole report]({link})").ok();
    }
    text
}

fn worst_deviations(report: &Report, line: &mut impl FnMut(String)) {
    let worst = worst(report, 10);
    if !worst.is_empty() {
        line(
            "\n| worst deviations | meter | value | reference | deviation | verdict |\n|---|---|---|---|---|---|"
                .into(),
        );
        for c in worst {
            let number = |v: Option<f64>| v.map_or("-".to_owned(), significant);
            line(format!(
                "| {}{} {} | {} | {} | {} | {} | {} |",
                report.of_suite(&inert(&c.key.case), " "),
                inert(&c.key.engine),
                c.key.procedure,
                inert(&c.meter.0),
                number(c.value),
                number(c.reference.as_ref().map(|r| r.value)),
                off(c, percent).unwrap_or("-".to_owned()),
                mark(c.verdict)
            ));
        }
    }
}

/// Cells of a row.
fn joined(cells: &[String]) -> String {
    cells.iter().map(|cell| inert(cell)).collect::<Vec<_>>().join(" | ")
}
