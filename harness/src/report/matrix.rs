//! The verdict matrix, the worst deviations and the order of the worst, for every view.

use std::collections::BTreeSet;

use super::Report;
use super::words::{largest, mark, percent};
use crate::judge::{Basis, Comparison, Verdict};
use crate::record::{EngineName, ProcedureId, ReadingKey, Recording, Role};

/// One row: a procedure of a case against what its references rest on.
pub(super) struct Row {
    pub(super) case: String,
    pub(super) procedure: ProcedureId,
    /// Its name, and where no column of cases says so, that it is of the calibration.
    pub(super) label: String,
    pub(super) basis: &'static str,
    /// One an engine, in the report's order.
    pub(super) cells: Vec<Cell>,
}

/// One cell: the worst verdict of its comparisons.
pub(super) enum Cell {
    /// The engine is what others are judged by here.
    IsReference,
    Skipped,
    Empty,
    Judged {
        verdict: Verdict,
        /// How many comparisons have it.
        having: usize,
        of: usize,
        /// The largest relative deviation, signed.
        deviation: Option<f64>,
    },
}

impl Cell {
    /// Without counts, where there is little room.
    pub(super) fn brief(&self) -> String {
        match self {
            Self::Judged { verdict, deviation, .. } => {
                let percent = deviation.map(|d| format!(" {}", percent(d))).unwrap_or_default();
                format!("{}{percent}", mark(*verdict))
            }
            _ => self.text(),
        }
    }

    pub(super) fn text(&self) -> String {
        match self {
            Self::IsReference => "reference".to_owned(),
            Self::Skipped => "skipped".to_owned(),
            Self::Empty => "-".to_owned(),
            Self::Judged { verdict, having, of, deviation } => {
                let percent = deviation.map(|d| format!(" {}", percent(d))).unwrap_or_default();
                let count = if having == of { format!("{of}") } else { format!("{having}/{of}") };
                format!("{} {count}{percent}", mark(*verdict))
            }
        }
    }
}

pub(super) fn matrix(report: &Report) -> Vec<Row> {
    let of_case = |case| report.procedures().into_iter().map(move |procedure| (case, procedure));
    let mut rows = vec![];
    for (case, procedure) in report.cases.iter().map(|c| c.name.as_str()).flat_map(of_case) {
        let comparisons: Vec<&Comparison> =
            report.comparisons.iter().filter(|c| c.key.is_of(case, procedure)).collect();
        for basis in comparisons.iter().map(|c| c.basis()).collect::<BTreeSet<Option<Basis>>>() {
            let of_row: Vec<&Comparison> = comparisons.iter().copied().filter(|c| c.basis() == basis).collect();
            let key = |engine: &EngineName| ReadingKey::new(case, procedure, engine.clone());
            rows.push(Row {
                case: case.to_owned(),
                procedure,
                label: if procedure.is_known() && !report.is_suite() {
                    format!("{case}: {procedure}")
                } else {
                    procedure.to_string()
                },
                basis: of_row[0].basis_name(),
                cells: report.engines.iter().map(|e| cell(report, &key(&e.id), &of_row)).collect(),
            });
        }
    }
    rows
}

fn cell(report: &Report, key: &ReadingKey, of_row: &[&Comparison]) -> Cell {
    let mine = || of_row.iter().filter(|c| c.key == *key);
    let Some(verdict) = mine().map(|c| c.verdict).max() else {
        // Older reports do not say who was a witness.
        let is_ours = [EngineName::SIMULATOR, EngineName::IESNA].contains(&key.engine);
        let is_witness = |r: &Recording| r.key == *key && (r.role == Role::Witness || is_ours);
        return if report.recordings.iter().any(is_witness) {
            Cell::IsReference
        } else if report.skips.iter().any(|s| s.key == *key && s.scope.leaves_no_reading()) {
            Cell::Skipped
        } else {
            Cell::Empty
        };
    };
    Cell::Judged {
        verdict,
        having: mine().filter(|c| c.verdict == verdict).count(),
        of: mine().count(),
        deviation: largest(mine().filter_map(|c| c.relative_deviation)),
    }
}

/// Worst first: by verdict, then by deviation over tolerance.
pub(super) fn sort_worst_first(comparisons: &mut [&Comparison]) {
    let severity = |c: &Comparison| c.normalized_error().map_or(f64::INFINITY, f64::abs);
    comparisons.sort_by(|a, b| b.verdict.cmp(&a.verdict).then(severity(b).total_cmp(&severity(a))));
}

/// The worst comparison of each engine, procedure, basis and verdict: twenty meters that fail alike are one finding.
pub(super) fn worst(report: &Report, count: usize) -> Vec<&Comparison> {
    let mut all: Vec<&Comparison> = report.comparisons.iter().filter(|c| c.deviation != Some(0.0)).collect();
    sort_worst_first(&mut all);
    let mut seen = BTreeSet::new();
    all.retain(|c| seen.insert((c.key.procedure, &c.key.engine, c.basis(), c.verdict)));
    all.truncate(count);
    all
}
