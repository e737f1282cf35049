//! The verdict matrix, the worst deviations and the order of the worst, for every view.

use std::collections::{BTreeSet, HashMap, HashSet};

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
        /// The place of the first that has it among all comparisons of the report.
        first: usize,
    },
}

impl Row {
    /// How much it asks for attention: the worst verdict of its cells, then the largest deviation.
    pub(super) fn severity(&self) -> (Option<Verdict>, f64) {
        let judged = self.cells.iter().filter_map(|cell| match cell {
            Cell::Judged { verdict, deviation, .. } => Some((*verdict, deviation.map_or(0.0, f64::abs))),
            _ => None,
        });
        judged.fold((None, 0.0), |(worst, most), (verdict, deviation)| (worst.max(Some(verdict)), most.max(deviation)))
    }
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
            Self::Judged { verdict, having, of, deviation, .. } => {
                let percent = deviation.map(|d| format!(" {}", percent(d))).unwrap_or_default();
                let count = if having == of { format!("{of}") } else { format!("{having}/{of}") };
                format!("{} {count}{percent}", mark(*verdict))
            }
        }
    }
}

pub(super) fn matrix(report: &Report) -> Vec<Row> {
    let mut of_job: HashMap<(&str, ProcedureId), Vec<(usize, &Comparison)>> = HashMap::new();
    for (k, c) in report.comparisons.iter().enumerate() {
        of_job.entry((&c.key.case, c.key.procedure)).or_default().push((k, c));
    }
    let unread = Unread::of(report);
    let procedures = report.procedures();
    let of_case = |case| procedures.iter().map(move |procedure| (case, *procedure));
    let mut rows = vec![];
    for (case, procedure) in report.cases.iter().map(|c| c.name.as_str()).flat_map(of_case) {
        let Some(comparisons) = of_job.get(&(case, procedure)) else { continue };
        for basis in comparisons.iter().map(|(_, c)| c.basis()).collect::<BTreeSet<Option<Basis>>>() {
            let of_row: Vec<(usize, &Comparison)> =
                comparisons.iter().copied().filter(|(_, c)| c.basis() == basis).collect();
            let key = |engine: &EngineName| ReadingKey::new(case, procedure, engine.clone());
            rows.push(Row {
                case: case.to_owned(),
                procedure,
                label: if procedure.is_known() && !report.is_suite() {
                    format!("{case}: {procedure}")
                } else {
                    procedure.to_string()
                },
                basis: of_row[0].1.basis_name(),
                cells: report.engines.iter().map(|e| cell(&unread, &key(&e.id), &of_row)).collect(),
            });
        }
    }
    rows
}

/// Why there may be no comparison of an engine.
struct Unread<'a> {
    references: HashSet<&'a ReadingKey>,
    skipped: HashSet<&'a ReadingKey>,
}

impl<'a> Unread<'a> {
    fn of(report: &'a Report) -> Self {
        // Older reports do not say who was a witness.
        let is_ours = |r: &Recording| [EngineName::SIMULATOR, EngineName::IESNA].contains(&r.key.engine);
        let is_witness = |r: &&Recording| r.role == Role::Witness || is_ours(r);
        let skips = report.skips.iter().filter(|s| s.scope.leaves_no_reading());
        Self {
            references: report.recordings.iter().filter(is_witness).map(|r| &r.key).collect(),
            skipped: skips.map(|s| &s.key).collect(),
        }
    }
}

fn cell(unread: &Unread<'_>, key: &ReadingKey, of_row: &[(usize, &Comparison)]) -> Cell {
    let mine = || of_row.iter().filter(|(_, c)| c.key == *key);
    let Some(verdict) = mine().map(|(_, c)| c.verdict).max() else {
        return if unread.references.contains(key) {
            Cell::IsReference
        } else if unread.skipped.contains(key) {
            Cell::Skipped
        } else {
            Cell::Empty
        };
    };
    Cell::Judged {
        verdict,
        having: mine().filter(|(_, c)| c.verdict == verdict).count(),
        of: mine().count(),
        deviation: largest(mine().filter_map(|(_, c)| c.relative_deviation)),
        first: mine().find(|(_, c)| c.verdict == verdict).map_or(0, |(k, _)| *k),
    }
}

/// Worst first: by verdict, then by deviation over tolerance.
pub(super) fn sort_worst_first<'c, T>(all: &mut [T], comparison: impl Fn(&T) -> &'c Comparison) {
    let severity = |c: &Comparison| c.normalized_error().map_or(f64::INFINITY, f64::abs);
    all.sort_by(|a, b| {
        let (a, b) = (comparison(a), comparison(b));
        b.verdict.cmp(&a.verdict).then(severity(b).total_cmp(&severity(a)))
    });
}

/// The worst comparison of each engine, procedure, basis and verdict: twenty meters that fail alike are one finding.
pub(super) fn worst(report: &Report, count: usize) -> Vec<&Comparison> {
    let mut all: Vec<&Comparison> = report.comparisons.iter().filter(|c| c.deviation != Some(0.0)).collect();
    sort_worst_first(&mut all, |c| *c);
    let mut seen = BTreeSet::new();
    all.retain(|c| seen.insert((c.key.procedure, &c.key.engine, c.basis(), c.verdict)));
    all.truncate(count);
    all
}
