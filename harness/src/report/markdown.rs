//! Markdown for a pull request or a step summary: verdict matrix, worst deviations, skips.

use std::fmt::Write;

use super::Report;
use super::terminal::{Cell, matrix, worst};
use super::{consensus, paper, paper_split, split};

/// The report as Markdown.
///
/// `link` leads to the whole report, where it is published.
pub fn markdown(report: &Report, link: Option<&str>) -> String {
    let mut text = String::new();
    let s = &report.summary;
    let mut line = |l: String| {
        text.push_str(&l);
        text.push('\n');
    };
    line(format!("## luxproof: {}", report.spec.title));
    line(format!(
        "\n{} passed, {} failed, {} undecided, {} known, {} unexpectedly passed, {} missing, {} skipped in {:.1} s\n",
        s.pass, s.fail, s.inconclusive, s.known_deviation, s.unexpected_pass, s.missing, s.skipped, report.wall_s
    ));
    let engines: Vec<&str> = report.engines.iter().map(|e| e.id.as_str()).collect();
    line(format!(
        "| {}procedure | reference | {} |",
        if report.is_suite() { "case | " } else { "" },
        engines.join(" | ")
    ));
    line(format!("|---|---|{}", "---|".repeat(engines.len() + usize::from(report.is_suite()))));
    for row in matrix(report) {
        let cells: Vec<String> = row.cells.iter().map(Cell::text).collect();
        let case = if report.is_suite() { format!("{} | ", row.case) } else { String::new() };
        line(format!("| {case}{} | {} | {} |", row.procedure, row.basis, cells.join(" | ")));
    }
    for grid in paper::grids(report).into_iter().chain(paper_split::grid(report)) {
        line(format!(
            "\n<details><summary>{}</summary>\n\n| {} |\n|{}",
            grid.title,
            grid.head.join(" | "),
            "---|".repeat(grid.head.len())
        ));
        for row in grid.rows {
            line(format!("| {} |", row.iter().map(|c| cell(c)).collect::<Vec<_>>().join(" | ")));
        }
        line("\n</details>".to_owned());
    }
    let splits = split::widest(report);
    if !splits.is_empty() {
        line(String::new());
        for split in splits {
            line(format!("- {}: {}", split::place(report, split), split.text));
        }
    }
    let departures = consensus::lines(report);
    if !departures.is_empty() {
        line("\nWho departs from the other witnesses, the reference included:\n".into());
        for departure in &departures {
            line(format!("- {departure}"));
        }
    }
    let worst = worst(report, 10);
    if !worst.is_empty() {
        line(
            "\n| worst deviations | meter | value | reference | deviation | verdict |\n|---|---|---|---|---|---|"
                .into(),
        );
        for c in worst {
            let number = |v: Option<f64>| v.map_or("-".to_owned(), |v| format!("{v:.5}"));
            let case = if report.is_suite() { format!("{} ", c.key.case) } else { String::new() };
            line(format!(
                "| {case}{} {} | {} | {} | {} | {} | {} |",
                c.key.engine,
                c.key.procedure,
                c.meter,
                number(c.value),
                number(c.reference.as_ref().map(|r| r.value)),
                c.relative_deviation.map_or("-".to_owned(), |d| format!("{:+.3} %", 100.0 * d)),
                c.verdict.name()
            ));
        }
    }
    if let Some(check) = &report.baseline {
        line(format!("\nBaseline `{}`: {}", check.file, check.counts()));
        for (k, entry) in check.departures().enumerate() {
            let gap = if k == 0 { "\n" } else { "" };
            let place = format!("{} {} {}", entry.key.case, entry.key.procedure, entry.key.engine);
            line(format!("{gap}- **{}** {place}: {}", entry.state.to_lowercase(), entry.details.join("; ")));
        }
    }
    for skip in &report.skips {
        let case = if report.is_suite() { format!("{} ", skip.key.case) } else { String::new() };
        writeln!(text, "\n- skipped: {case}{} {}: {}", skip.key.engine, skip.key.procedure, skip.reason).ok();
    }
    if let Some(link) = link {
        writeln!(text, "\n[The whole report]({link})").ok();
    }
    text
}

/// Text that cannot end a cell of a table.
fn cell(text: &str) -> String {
    text.replace('|', "\\|").replace('\n', " ")
}
