//! The error budgets of a run as text: where the uncertainty of each deviation comes from.

use std::fmt::Write;

use comfy_table::{CellAlignment, ContentArrangement, Table, presets};

use super::Report;
use crate::judge::{Basis, Comparison, ErrorBudget, Source};

/// More comparisons of a kind than this are not all listed: those with the widest interval for their tolerance are.
const LISTED: usize = 8;

/// A table of budgets for each case, procedure, engine and basis; all figures relative to the reference, in percent.
pub fn budgets(report: &Report) -> String {
    let mut text =
        "Error budgets: standard uncertainties in percent of the reference (GUM); interval = k u\n".to_owned();
    let kind = |c: &Comparison| (c.key.case.clone(), c.key.procedure.clone(), c.key.engine.clone(), basis(c));
    let mut kinds: Vec<_> = vec![];
    for comparison in report.comparisons.iter().filter(|c| c.budget.is_some()) {
        if !kinds.contains(&kind(comparison)) {
            kinds.push(kind(comparison));
        }
    }
    for found in kinds {
        let mut mine: Vec<(&Comparison, &ErrorBudget)> = report
            .comparisons
            .iter()
            .filter(|c| kind(c) == found)
            .filter_map(|c| c.budget.as_ref().map(|b| (c, b)))
            .collect();
        let all = mine.len();
        mine.sort_by(|a, b| strain(b).total_cmp(&strain(a)));
        mine.truncate(LISTED);
        let (case, procedure, engine, basis) = found;
        let against = basis.map_or("nothing", Basis::name);
        let more = if all > LISTED { format!(", the {LISTED} widest of {all}") } else { String::new() };
        writeln!(text, "\n{case}: {procedure}, {engine} against {against}{more}\n{}", table(&mine)).ok();
    }
    text
}

fn basis(comparison: &Comparison) -> Option<Basis> {
    comparison.reference.as_ref().map(|r| r.basis)
}

/// How much of its tolerance an interval takes.
fn strain((comparison, budget): &(&Comparison, &ErrorBudget)) -> f64 {
    let allowed = comparison.reference.as_ref().map_or(0.0, |r| comparison.tolerance.around(r.value));
    budget.expanded / allowed.max(f64::MIN_POSITIVE)
}

fn table(rows: &[(&Comparison, &ErrorBudget)]) -> String {
    let is_there = |source: &Source| rows.iter().any(|(_, b)| b.components.iter().any(|c| c.source == *source));
    let sources: Vec<Source> = Source::ALL.into_iter().filter(is_there).collect();
    let mut table = Table::new();
    table.load_style(presets::NOTHING).set_content_arrangement(ContentArrangement::Disabled);
    let names = sources.iter().map(|s| s.name());
    let head = ["  meter", "deviation", "tolerance"]
        .into_iter()
        .chain(names)
        .chain(["u", "freedom", "k", "interval", "p", "verdict"]);
    table.set_header(head);
    for (comparison, budget) in rows {
        let scale = comparison.reference.as_ref().map_or(1.0, |r| r.value.abs());
        let percent = |x: f64| if scale > 0.0 { format!("{:.2e}", 100.0 * x / scale) } else { "-".to_owned() };
        let of = |source: &Source| {
            let squares = budget.components.iter().filter(|c| c.source == *source).map(|c| c.uncertainty.powi(2));
            let sum = squares.sum::<f64>();
            if sum > 0.0 { percent(sum.sqrt()) } else { "0".to_owned() }
        };
        let allowed = comparison.reference.as_ref().map_or(0.0, |r| comparison.tolerance.around(r.value));
        let mut cells = vec![
            format!("  {}", comparison.meter),
            comparison.deviation.map_or("-".to_owned(), percent),
            percent(allowed),
        ];
        cells.extend(sources.iter().map(of));
        cells.extend([
            percent(budget.combined),
            budget.degrees_of_freedom.map_or("many".to_owned(), |f| format!("{f:.0}")),
            format!("{:.2}", budget.coverage_factor),
            percent(budget.expanded),
            comparison.p_value.map_or("-".to_owned(), |p| format!("{p:.2}")),
            comparison.verdict.name().to_owned(),
        ]);
        table.add_row(cells);
    }
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table.force_no_tty();
    table.to_string().lines().map(str::trim_end).collect::<Vec<_>>().join("\n")
}
