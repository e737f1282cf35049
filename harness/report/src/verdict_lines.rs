//! One verdict for each engine and procedure, over all cases of a run.

use std::collections::BTreeSet;

use itertools::Itertools as _;

use super::words::{percent, trimmed};
use luxproof_model::{Comparison, EngineName, Exit, MeterId, ProcedureId, Report, Role, Verdict};

/// The verdict of an engine in a procedure.
pub(super) struct VerdictLine<'a> {
    pub(super) engine: &'a EngineName,
    pub(super) procedure: ProcedureId,
    /// The worst verdict of its comparisons.
    pub(super) verdict: Verdict,
    /// How many points have this verdict.
    pub(super) having: usize,
    /// How many points there are.
    pub(super) points: usize,
    /// The comparison with the largest error of all points; `None` where no value has a reference.
    pub(super) worst: Option<&'a Comparison>,
}

/// The lines of renderers, and of our own solvers where they decide the exit code or where no renderer was requested.
pub(super) fn verdict_lines(report: &Report) -> Vec<VerdictLine<'_>> {
    let has_renderer = report.engines.iter().any(|engine| engine.role == Role::Renderer);
    let mut lines = vec![];
    for engine in &report.engines {
        let mine =
            report.comparisons.iter().filter(|c| c.key.engine == engine.id).into_group_map_by(|c| c.key.procedure);
        for (procedure, comparisons) in mine.into_iter().sorted_by_key(|(procedure, _)| *procedure) {
            let line = VerdictLine::from_comparisons(&engine.id, procedure, &comparisons);
            let is_decisive = Exit::of(line.verdict) != Exit::Passed;
            if engine.role == Role::Renderer || !has_renderer || is_decisive {
                lines.push(line);
            }
        }
    }
    lines
}

impl<'a> VerdictLine<'a> {
    fn from_comparisons(engine: &'a EngineName, procedure: ProcedureId, comparisons: &[&'a Comparison]) -> Self {
        let verdict = comparisons.iter().map(|c| c.verdict).max().unwrap_or(Verdict::Missing);
        let deciding = comparisons.iter().copied().filter(|c| c.verdict == verdict).collect_vec();
        Self {
            engine,
            procedure,
            verdict,
            having: count_points(&deciding),
            points: count_points(comparisons),
            worst: largest_error(comparisons),
        }
    }
}

/// The comparison with the largest error by size, whatever its verdict.
///
/// Relative errors come first: they are those that a relative tolerance judges. What is not judged counts only where nothing is.
pub(super) fn largest_error<'a>(comparisons: &[&'a Comparison]) -> Option<&'a Comparison> {
    let with_error = comparisons.iter().copied().filter(|c| c.deviation.is_some()).collect_vec();
    let judged = with_error.iter().copied().filter(|c| c.verdict != Verdict::NotJudged).collect_vec();
    largest_of(if judged.is_empty() { &with_error } else { &judged })
}

/// The comparison with the largest error, judged or not.
pub(super) fn largest_of<'a>(all: &[&'a Comparison]) -> Option<&'a Comparison> {
    let relative = all.iter().copied().filter(|c| is_relative(c) && c.relative_deviation.is_some());
    let largest = relative.max_by(|a, b| size(a.relative_deviation).total_cmp(&size(b.relative_deviation)));
    largest.or_else(|| {
        all.iter()
            .copied()
            .filter(|c| c.deviation.is_some())
            .max_by(|a, b| size(a.deviation).total_cmp(&size(b.deviation)))
    })
}

fn size(deviation: Option<f64>) -> f64 {
    deviation.map_or(0.0, f64::abs)
}

/// The number of different points: each may have several references.
fn count_points(comparisons: &[&Comparison]) -> usize {
    let points: BTreeSet<(&str, &MeterId)> = comparisons.iter().map(|c| (c.key.case.as_str(), &c.meter)).collect();
    points.len()
}

/// The deviation and the tolerance of a comparison, both relative, or both in the unit where an absolute tolerance applies.
pub(super) fn error_and_tolerance(c: &Comparison) -> (String, String) {
    let unit = c.quantity.unit();
    match c.relative_deviation {
        Some(deviation) if is_relative(c) => {
            (readable_percent(deviation), format!("±{} %", trimmed(100.0 * c.tolerance.relative, 4)))
        }
        _ => (
            c.deviation.map_or("-".to_owned(), |deviation| signed(deviation, unit)),
            format!("±{} {unit}", trimmed(c.allowed(), 6)),
        ),
    }
}

/// Whether the relative part of the tolerance applies. Relative deviations from nearly dark points are huge and mean nothing.
pub(super) fn is_relative(c: &Comparison) -> bool {
    c.reference.as_ref().is_some_and(|r| c.tolerance.relative * r.value.abs() >= c.tolerance.absolute)
}

/// A relative deviation; what no reader needs to tell from zero is only bounded.
fn readable_percent(deviation: f64) -> String {
    match deviation.abs() {
        d if d > 0.0 && d < 1e-5 => "<0.001 %".to_owned(),
        _ => percent(deviation),
    }
}

/// A deviation with its sign and unit, in two or three digits.
fn signed(deviation: f64, unit: &str) -> String {
    match deviation.abs() {
        d if d < 5e-7 => format!("0 {unit}"),
        d if d < 0.001 => format!("{deviation:+.0e} {unit}"),
        d if d < 10.0 => format!("{deviation:+.3} {unit}"),
        _ => format!("{deviation:+.1} {unit}"),
    }
}
