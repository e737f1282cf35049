//! The error budgets of a run as text: where the uncertainty of each deviation comes from.

use std::fmt::Write;

use itertools::Itertools;
use strum::VariantArray;

use super::terminal::{Style, draw_table};
use luxproof_model::Report;
use luxproof_model::{Comparison, EngineName, ErrorBudget, ProcedureId, Source};

/// At most so many comparisons of a kind are listed: those with the widest interval relative to their tolerance.
const LISTED_COMPARISONS: usize = 8;

/// A comparison with its error budget.
type BudgetRow<'a> = (&'a Comparison, &'a ErrorBudget);

/// A table of budgets for each case, procedure, engine and basis; all figures relative to the reference, in percent.
pub fn budgets(report: &Report) -> String {
    let mut text =
        "Error budgets: standard uncertainties in percent of the reference (GUM); interval = k u\n".to_owned();
    for found in report.comparisons.iter().filter(|c| c.budget.is_some()).map(kind).unique() {
        let rows: Vec<BudgetRow<'_>> = report
            .comparisons
            .iter()
            .filter(|c| kind(c) == found)
            .filter_map(|c| Some((c, c.budget.as_ref()?)))
            .sorted_by(|a, b| part_of_tolerance(b).total_cmp(&part_of_tolerance(a)))
            .collect();
        let all = rows.len();
        let shown = &rows[..all.min(LISTED_COMPARISONS)];
        let (case, procedure, engine, basis) = found;
        let more = if all > LISTED_COMPARISONS {
            format!(", the {LISTED_COMPARISONS} widest of {all}")
        } else {
            String::new()
        };
        writeln!(text, "\n{case}: {procedure}, {engine} against {basis}{more}\n{}", budget_table(shown)).ok();
        if let Some(source) = rows.first().and_then(|(c, _)| c.tolerance_source.as_ref()) {
            writeln!(text, "  tolerance by {source}").ok();
        }
    }
    text
}

/// What one table is about: case, procedure, engine and basis.
fn kind(c: &Comparison) -> (String, ProcedureId, EngineName, &'static str) {
    (c.key.case.clone(), c.key.procedure, c.key.engine.clone(), c.basis_name())
}

/// The half width of the interval over the tolerance.
fn part_of_tolerance((c, budget): &BudgetRow<'_>) -> f64 {
    budget.expanded / c.allowed().max(f64::MIN_POSITIVE)
}

/// Draws the budgets of comparisons of one kind, with a column for each source that occurs.
fn budget_table(rows: &[BudgetRow<'_>]) -> String {
    let mut sources: Vec<Source> = Source::VARIANTS.to_vec();
    sources.retain(|source| rows.iter().any(|(_, b)| b.components.iter().any(|c| c.source == *source)));
    let head = ["  meter", "deviation", "tolerance"].into_iter().chain(sources.iter().map(Source::into_str));
    let head = head.chain(["u", "freedom", "k", "interval", "p", "verdict"]);
    let rows = rows.iter().map(|row| budget_cells(row, &sources));
    draw_table(head, rows, 1..usize::MAX, Style::Plain)
}

/// The cells of one comparison.
fn budget_cells((c, budget): &BudgetRow<'_>, sources: &[Source]) -> Vec<String> {
    let scale = c.reference.as_ref().map_or(1.0, |r| r.value.abs());
    let mut cells = vec![
        format!("  {}", c.meter),
        c.deviation.map_or("-".to_owned(), |deviation| relative(deviation, scale)),
        relative(c.allowed(), scale),
    ];
    cells.extend(sources.iter().map(|source| match uncertainty_of_source(budget, *source) {
        u if u > 0.0 => relative(u, scale),
        _ => "0".to_owned(),
    }));
    cells.extend([
        relative(budget.combined, scale),
        budget.degrees_of_freedom.map_or("many".to_owned(), |f| format!("{f:.0}")),
        format!("{:.2}", budget.coverage_factor),
        relative(budget.expanded, scale),
        c.p_value.map_or("-".to_owned(), |p| format!("{p:.2}")),
        c.verdict.name().to_owned(),
    ]);
    cells
}

/// A figure in percent of the reference; `-` where the reference is zero.
fn relative(figure: f64, reference: f64) -> String {
    if reference > 0.0 { format!("{:.2e}", 100.0 * figure / reference) } else { "-".to_owned() }
}

/// The combined uncertainty of the components from one source.
fn uncertainty_of_source(budget: &ErrorBudget, source: Source) -> f64 {
    let squares = budget.components.iter().filter(|c| c.source == source).map(|c| c.uncertainty.powi(2));
    squares.sum::<f64>().sqrt()
}
