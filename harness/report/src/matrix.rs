//! The verdict matrix, the worst deviations and their order, for every view.

use std::collections::{BTreeSet, HashMap, HashSet};

use super::verdict_lines::{error_and_tolerance, is_relative, largest_error, largest_of};
use super::words::{mark, percent};
use luxproof_model::Report;
use luxproof_model::{Basis, Comparison, Verdict};
use luxproof_model::{EngineName, ProcedureId, ReadingKey, Recording, Role};

/// One row: a procedure of a case against references of one basis.
pub(super) struct Row {
    pub(super) case: String,
    pub(super) procedure: ProcedureId,
    /// The procedure's name. A calibration without a column of cases has its case in front.
    pub(super) label: String,
    pub(super) basis: &'static str,
    /// One cell for each engine, in the report's order.
    pub(super) cells: Vec<Cell>,
}

/// One cell: the worst verdict of its comparisons.
pub(super) enum Cell {
    /// The engine is the reference here.
    IsReference,
    Skipped,
    Empty,
    Judged {
        verdict: Verdict,
        /// How many comparisons have this verdict.
        having: usize,
        /// How many comparisons there are.
        of: usize,
        /// The largest relative deviation, signed.
        deviation: Option<f64>,
        /// The largest deviation with its unit, where it is not judged as a relative one.
        absolute: Option<String>,
        /// The index in the report of the first comparison with this verdict.
        first: usize,
    },
}

/// A comparison with its index in the report.
type IndexedComparison<'a> = (usize, &'a Comparison);

impl Row {
    /// How urgent the row is: the worst verdict of its cells, then the largest deviation.
    pub(super) fn severity(&self) -> (Option<Verdict>, f64) {
        let (mut worst, mut largest) = (None, 0.0_f64);
        for cell in &self.cells {
            if let Cell::Judged { verdict, deviation, .. } = cell {
                worst = worst.max(Some(*verdict));
                largest = largest.max(deviation.map_or(0.0, f64::abs));
            }
        }
        (worst, largest)
    }
}

impl Cell {
    /// The cell without counts, for narrow screens.
    pub(super) fn brief(&self) -> String {
        match self {
            Self::Judged { verdict, .. } => format!("{}{}", mark(*verdict), self.largest()),
            _ => self.text(),
        }
    }

    pub(super) fn text(&self) -> String {
        match self {
            Self::IsReference => "reference".to_owned(),
            Self::Skipped => "skipped".to_owned(),
            Self::Empty => "-".to_owned(),
            Self::Judged { verdict, having, of, .. } => {
                let count = if having == of { format!("{of}") } else { format!("{having}/{of}") };
                format!("{} {count}{}", mark(*verdict), self.largest())
            }
        }
    }

    /// The largest deviation after a blank, where there is one.
    fn largest(&self) -> String {
        let Self::Judged { deviation, absolute, .. } = self else { return String::new() };
        let largest = deviation.map(percent).or_else(|| absolute.clone());
        largest.map(|text| format!(" {text}")).unwrap_or_default()
    }
}

/// The rows of the matrix, by case, procedure and basis.
pub(super) fn matrix(report: &Report) -> Vec<Row> {
    let mut by_job: HashMap<(&str, ProcedureId), Vec<IndexedComparison<'_>>> = HashMap::new();
    for (k, c) in report.comparisons.iter().enumerate() {
        by_job.entry((&c.key.case, c.key.procedure)).or_default().push((k, c));
    }
    let unread = UnreadJobs::from_report(report);
    let procedures = report.procedures();
    let mut rows = vec![];
    for case in &report.cases {
        for procedure in &procedures {
            if let Some(comparisons) = by_job.get(&(&*case.name, *procedure)) {
                rows.extend(job_rows(report, &unread, &case.name, *procedure, comparisons));
            }
        }
    }
    rows
}

/// The rows of one case and procedure, one for each basis.
fn job_rows(
    report: &Report,
    unread: &UnreadJobs<'_>,
    case: &str,
    procedure: ProcedureId,
    comparisons: &[IndexedComparison<'_>],
) -> Vec<Row> {
    let is_labelled = procedure.is_calibration() && !report.is_suite();
    let label = if is_labelled { format!("{case}: {procedure}") } else { procedure.to_string() };
    let mut rows = vec![];
    for basis in comparisons.iter().map(|(_, c)| c.basis()).collect::<BTreeSet<Option<Basis>>>() {
        let of_row: Vec<IndexedComparison<'_>> =
            comparisons.iter().copied().filter(|(_, c)| c.basis() == basis).collect();
        let keys = report.engines.iter().map(|e| ReadingKey::new(case, procedure, e.id.clone()));
        rows.push(Row {
            case: case.to_owned(),
            procedure,
            label: label.clone(),
            basis: of_row[0].1.basis_name(),
            cells: keys.map(|key| cell(unread, &key, &of_row)).collect(),
        });
    }
    rows
}

/// Why an engine may have no comparison.
struct UnreadJobs<'a> {
    references: HashSet<&'a ReadingKey>,
    skipped: HashSet<&'a ReadingKey>,
}

impl<'a> UnreadJobs<'a> {
    fn from_report(report: &'a Report) -> Self {
        let skips = report.skips.iter().filter(|s| s.scope.leaves_no_reading());
        Self {
            references: report.recordings.iter().filter(|r| is_reference(r)).map(|r| &r.key).collect(),
            skipped: skips.map(|s| &s.key).collect(),
        }
    }
}

/// Whether a recording may be a reference. Older reports do not record that, so our solvers always count.
fn is_reference(recording: &Recording) -> bool {
    let is_ours = [EngineName::SIMULATOR, EngineName::IESNA].contains(&recording.key.engine);
    recording.role == Role::Reference || is_ours
}

fn cell(unread: &UnreadJobs<'_>, key: &ReadingKey, of_row: &[IndexedComparison<'_>]) -> Cell {
    let of_engine: Vec<&IndexedComparison<'_>> = of_row.iter().filter(|(_, c)| c.key == *key).collect();
    let Some(verdict) = of_engine.iter().map(|(_, c)| c.verdict).max() else {
        return if unread.references.contains(key) {
            Cell::IsReference
        } else if unread.skipped.contains(key) {
            Cell::Skipped
        } else {
            Cell::Empty
        };
    };
    let all: Vec<&Comparison> = of_engine.iter().map(|(_, c)| *c).collect();
    // A cell that is not judged shows what is not judged.
    let largest = if verdict == Verdict::NotJudged { largest_of(&all) } else { largest_error(&all) };
    Cell::Judged {
        verdict,
        having: of_engine.iter().filter(|(_, c)| c.verdict == verdict).count(),
        of: of_engine.len(),
        deviation: largest.filter(|c| is_relative(c)).and_then(|c| c.relative_deviation),
        absolute: largest.filter(|c| !is_relative(c)).map(|c| error_and_tolerance(c).0),
        first: of_engine.iter().find(|(_, c)| c.verdict == verdict).map_or(0, |(k, _)| *k),
    }
}

/// Sorts the worst first: by verdict, then by deviation over tolerance.
pub(super) fn sort_worst_first<'c, T>(all: &mut [T], comparison: impl Fn(&T) -> &'c Comparison) {
    all.sort_by(|a, b| {
        let (a, b) = (comparison(a), comparison(b));
        b.verdict.cmp(&a.verdict).then(part_of_tolerance(b).total_cmp(&part_of_tolerance(a)))
    });
}

/// The size of a deviation over its tolerance; infinite where there is none.
fn part_of_tolerance(c: &Comparison) -> f64 {
    c.normalized_error().map_or(f64::INFINITY, f64::abs)
}

/// The worst comparison of each engine, procedure, basis and verdict: many meters with the same fault are one finding.
pub(super) fn worst(report: &Report, count: usize) -> Vec<&Comparison> {
    let mut all: Vec<&Comparison> = report.comparisons.iter().filter(|c| c.deviation != Some(0.0)).collect();
    sort_worst_first(&mut all, |c| *c);
    let mut kinds = BTreeSet::new();
    all.retain(|c| kinds.insert((c.key.procedure, &c.key.engine, c.basis(), c.verdict)));
    all.truncate(count);
    all
}
