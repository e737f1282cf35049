//! The error budgets of a run as text: where the uncertainty of each deviation comes from.

use std::fmt::Write;

use itertools::Itertools;
use strum::VariantArray;

use super::Report;
use super::terminal::{Style, drawn};
use crate::judge::{Comparison, ErrorBudget, Source};

/// More comparisons of a kind than this are not all listed: those with the widest interval for their tolerance are.
const LISTED: usize = 8;

/// A table of budgets for each case, procedure, engine and basis; all figures relative to the reference, in percent.
pub fn budgets(report: &Report) -> String {
    let mut text =
        "Error budgets: standard uncertainties in percent of the reference (GUM); interval = k u\n".to_owned();
    let kind = |c: &Comparison| (c.key.case.clone(), c.key.procedure, c.key.engine.clone(), c.basis_name());
    for found in report.comparisons.iter().filter(|c| c.budget.is_some()).map(kind).unique() {
        let of_kind = report.comparisons.iter().filter(|c| kind(c) == found);
        let of_tolerance =
            |(c, budget): &(&Comparison, &ErrorBudget)| budget.expanded / c.allowed().max(f64::MIN_POSITIVE);
        let mine = of_kind.filter_map(|c| Some((c, c.budget.as_ref()?)));
        let mine = mine.sorted_by(|a, b| of_tolerance(b).total_cmp(&of_tolerance(a))).collect_vec();
        let all = mine.len();
        let (case, procedure, engine, basis) = found;
        let more = if all > LISTED { format!(", the {LISTED} widest of {all}") } else { String::new() };
        writeln!(text, "\n{case}: {procedure}, {engine} against {basis}{more}\n{}", table(&mine[..all.min(LISTED)]))
            .ok();
        if let Some(source) = mine.first().and_then(|(c, _)| c.tolerance_source.as_ref()) {
            writeln!(text, "  tolerance by {source}").ok();
        }
    }
    text
}

fn table(rows: &[(&Comparison, &ErrorBudget)]) -> String {
    let is_there = |source: &Source| rows.iter().any(|(_, b)| b.components.iter().any(|c| c.source == *source));
    let sources: Vec<Source> = Source::VARIANTS.iter().copied().filter(is_there).collect();
    let head = ["  meter", "deviation", "tolerance"].into_iter().chain(sources.iter().map(Source::into_str));
    let head = head.chain(["u", "freedom", "k", "interval", "p", "verdict"]);
    let rows = rows.iter().map(|(comparison, budget)| {
        let scale = comparison.reference.as_ref().map_or(1.0, |r| r.value.abs());
        let percent = |x: f64| if scale > 0.0 { format!("{:.2e}", 100.0 * x / scale) } else { "-".to_owned() };
        let of = |source: &Source| {
            let squares = budget.components.iter().filter(|c| c.source == *source).map(|c| c.uncertainty.powi(2));
            let sum = squares.sum::<f64>();
            if sum > 0.0 { percent(sum.sqrt()) } else { "0".to_owned() }
        };
        let mut cells = vec![
            format!("  {}", comparison.meter),
            comparison.deviation.map_or("-".to_owned(), percent),
            percent(comparison.allowed()),
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
        cells
    });
    drawn(head, rows, 1..usize::MAX, Style::Plain)
}
