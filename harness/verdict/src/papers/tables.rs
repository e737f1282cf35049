//! Published tables as references: printed cells with the interval that their rounding leaves.
//!
//! The format is described at the top of `reference/published/cachet.yaml`.

use luxproof_model::ForeignPath;
use luxproof_model::PublishedColumn;
use luxproof_model::PublishedFlux;
use luxproof_model::PublishedRow;
use luxproof_model::PublishedTable;
use luxproof_model::decimals_of;
use luxproof_model::printed_cell;
use luxproof_spec::Resolve;
use luxproof_spec::SpecError;
use luxproof_spec::Trust;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use glam::DVec3;
use itertools::Itertools;
use luxproof_scene::{Bounces, Luminaire, Transport};
use serde::Deserialize;

use super::fit::{Printed, misfits};
use luxproof_model::Misfit;
use luxproof_model::{Basis, Reference};
use luxproof_model::{Estimate, ProcedureId, Quantity};
use luxproof_process::files::{MAX_BYTES, read_bounded};
use luxproof_spec::Source;
use luxproof_spec::procedures::{Target, Task};

/// Places within so many meters, and directions within so many degrees, are the same, by the format's definition.
const SAME_PLACE: f64 = 1e-6;
/// The engine of a column that a paper takes from the photometric file itself.
pub const PHOTOMETRY: &str = "photometry";
/// Rounding of sums of printed decimals, relative to their total or 1.
const SUM_ROUNDING: f64 = 1e-9;

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Published {
    #[serde(rename = "luxproof_published")]
    version: u32,
    citation: Citation,
    /// The spec that has the geometry, relative to the file.
    spec: Option<ForeignPath>,
    rounding: Rounding,
    /// The luminaire's flux, where the paper knows it beyond our file.
    flux: Option<PublishedFlux>,
    pub(super) tables: BTreeMap<ProcedureId, Table>,
    /// The file and its text, for error messages.
    #[serde(skip)]
    source: Source,
}

#[derive(Clone, Debug, Deserialize)]
struct Citation {
    title: String,
    /// The basis of the values, where they are not a paper's.
    #[serde(default = "published")]
    basis: Basis,
}

const fn published() -> Basis {
    Basis::Published
}

#[derive(Clone, Debug, Deserialize)]
struct Rounding {
    units_in_last_digit: f64,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Table {
    name: String,
    quantity: Quantity,
    bounces: Option<u32>,
    columns: BTreeMap<String, Column>,
    /// Control totals of its columns.
    #[serde(default)]
    pub(super) totals: BTreeMap<String, String>,
    pub(super) rows: Vec<Row>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Column {
    reference: bool,
    engine: String,
    model: String,
    /// Further luminaire models that the column may be compared with.
    #[serde(default)]
    also: Vec<String>,
    #[serde(rename = "distance_m")]
    _distance_m: Option<f64>,
    bounces: Option<u32>,
    /// The case of the spec that the column belongs to, without the spec's name; every case if absent.
    case: Option<String>,
    meaning: String,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Row {
    gamma_deg: Option<f64>,
    c_deg: Option<f64>,
    at_m: Option<[f64; 3]>,
    normal: Option<[f64; 3]>,
    pub(super) cells: BTreeMap<String, String>,
    /// Control total of its cells.
    pub(super) total: Option<String>,
}

#[derive(Debug, thiserror::Error)]
#[error("{file}: {message}")]
pub struct PublishedError {
    pub file: String,
    pub message: String,
}

impl PublishedError {
    /// The same with its place in the file. The reader's messages begin with keys of the file, which a stranger does not see.
    pub fn fault(self, path: &Path, trust: Trust) -> SpecError {
        // The YAML reader ends its message with the place.
        let place = self.message.rsplit_once(" at line ").and_then(|(message, place)| {
            let (line, column) = place.split_once(" column ")?;
            Some((message.to_owned(), line.parse().ok(), column.parse().ok()))
        });
        let (message, line, column) = place.unwrap_or((self.message, None, None));
        let message = if trust == Trust::Own { message } else { "it is no file of published tables".to_owned() };
        let fault = SpecError::of(path, message, "correct the table, or leave `published` out");
        SpecError { line, column, ..fault }.withheld(trust)
    }
}

impl Published {
    pub fn read(path: &Path) -> Result<Self, PublishedError> {
        let fail = |message: String| PublishedError { file: path.display().to_string(), message };
        let bytes = read_bounded(path, MAX_BYTES).map_err(|e| fail(e.to_string()))?;
        Self::parse(path, bytes)
    }

    /// Reads tables that the user names. Those of a stranger are bounded in size, lie where they seem to, and are not quoted.
    pub fn read_named(path: &Path, trust: Trust) -> Result<Self, SpecError> {
        let withheld = |error: PublishedError| error.fault(path, trust);
        if trust == Trust::Own {
            return Self::read(path).map_err(withheld);
        }
        let bytes = trust.read_spec(path);
        let bytes = bytes.map_err(|error| SpecError::of(path, format!("cannot be read: {error}"), "check the path"))?;
        Self::parse(path, bytes).map_err(withheld)
    }

    /// How many cells its tables have.
    pub fn count_cells(&self) -> usize {
        self.tables.values().flat_map(|table| &table.rows).map(|row| row.cells.len().max(1)).sum()
    }

    fn parse(path: &Path, bytes: Vec<u8>) -> Result<Self, PublishedError> {
        let fail = |message: String| PublishedError { file: path.display().to_string(), message };
        let text = String::from_utf8(bytes).map_err(|e| fail(format!("is not UTF-8: {e}")))?;
        let mut published: Self = luxproof_spec::from_yaml(&text).map_err(fail)?;
        published.source = Source::new(path.to_owned(), text);
        if published.version != 1 {
            return Err(fail(format!("format version {} is not known; this program reads 1", published.version)));
        }
        if let Some(bad) = published.printed_numbers().find(|cell| published.cell(cell, 0).is_none()) {
            return Err(fail(format!("the cell \"{bad}\" is no number")));
        }
        Ok(published)
    }

    /// Leaves out the columns of other cases; `case` is the spec's name, a slash, and the case's.
    #[must_use]
    pub fn for_case(mut self, case: &str) -> Self {
        let own = case.split_once('/').map(|(_, name)| name);
        for table in self.tables.values_mut() {
            table.columns.retain(|_, column| column.case.is_none() || column.case.as_deref() == own);
        }
        self
    }

    /// All cells and control totals as printed.
    fn printed_numbers(&self) -> impl Iterator<Item = &String> {
        self.tables.values().flat_map(|table| {
            let rows = table.rows.iter().flat_map(|row| row.cells.values().chain(&row.total));
            rows.chain(table.totals.values())
        })
    }

    /// The spec that reproduces its tables; without trust it lies below the current folder.
    pub fn spec(&self, trust: Trust) -> Option<Result<PathBuf, SpecError>> {
        let folder = self.source.path.parent().unwrap_or(Path::new(""));
        self.spec.as_ref().map(|spec| spec.in_folder(folder).resolve(trust, Path::new("")))
    }

    /// The engines that its columns name; the photometric file is no engine.
    pub fn engines(&self) -> BTreeSet<&str> {
        let columns = self.tables.values().flat_map(|table| table.columns.values());
        columns.map(|column| column.engine.as_str()).filter(|engine| *engine != PHOTOMETRY).collect()
    }

    /// Finds rows at no meter of the tasks, and control totals that their cells do not add up to.
    ///
    /// Each finding names its place in the file.
    pub fn findings(&self, tasks: &[&Task]) -> Vec<String> {
        let mut found = vec![];
        for (procedure, table) in &self.tables {
            let targets: Vec<&Target> = tasks
                .iter()
                .filter(|task| task.procedure == *procedure && task.quantity == table.quantity)
                .flat_map(|task| &task.targets)
                .collect();
            if targets.is_empty() {
                continue;
            }
            let used: BTreeSet<usize> =
                targets.iter().filter_map(|target| table.rows.iter().position(|row| row.is_at(target))).collect();
            for k in (0..table.rows.len()).filter(|k| !used.contains(k)) {
                let what = "the row belongs to no meter and is not used";
                let help = "a row is held against readings at its own place, to 1e-6 m or degrees, and the first of its place alone";
                found.push(self.finding(*procedure, &format!("rows[{k}]"), what, help));
            }
            found.extend(self.total_findings(*procedure, table));
        }
        found
    }

    /// Finds control totals that no single changed cell explains.
    fn total_findings(&self, procedure: ProcedureId, table: &Table) -> Vec<String> {
        const HELP: &str = "a total or a cell was changed since they were copied";
        let mut found = vec![];
        let (changed, mismatches) = (table.changed(), table.total_mismatches());
        for (k, missing) in mismatches.rows.into_iter().filter(|(k, _)| changed.iter().all(|c| c.0 != *k)) {
            let what = describe_mismatch(table.rows[k].total.as_deref().unwrap_or_default(), missing);
            found.push(self.finding(procedure, &format!("rows[{k}].total"), &what, HELP));
        }
        for (name, missing) in mismatches.columns.into_iter().filter(|(name, _)| changed.iter().all(|c| c.1 != *name)) {
            let what = describe_mismatch(&table.totals[name], missing);
            found.push(self.finding(procedure, &format!("totals.{name}"), &what, HELP));
        }
        found
    }

    /// A finding at a place of a table, as text.
    fn finding(&self, procedure: ProcedureId, place: &str, what: &str, help: &str) -> String {
        let place = format!("tables.{procedure}.{place}");
        let table = &self.tables[&procedure].name;
        self.source.error_at(&place, format!("{table}: {what}"), help).to_string()
    }

    /// The paper's references for a reading of `engine` at one target.
    ///
    /// The paper's reference columns of a closed form judge every engine. Every other column judges the engine that it
    /// names. Both need the same luminaire model, and the same number of bounces where a column has one. `misfits` are
    /// those of the task's table, see [`Self::misfits`].
    pub(crate) fn references(&self, task: &Task, target: &Target, engine: &str, misfits: &[Misfit]) -> Vec<Reference> {
        let Some(table) = self.tables.get(&task.procedure).filter(|t| t.quantity == task.quantity) else {
            return vec![];
        };
        let Some((k, row)) = table.rows.iter().find_position(|r| r.is_at(target)) else { return vec![] };
        let mut references = vec![];
        for (name, column) in &table.columns {
            if !self.does_judge(table, column, task, engine) {
                continue;
            }
            let Some(cell) = row.cells.get(name).and_then(|cell| self.cell(cell, table.decimals(name))) else {
                continue;
            };
            let source = format!("{}, {}, {name}: {}", self.citation.title, table.name, column.meaning);
            let misfit = misfits.iter().find(|m| m.row == k && m.column == *name);
            let caveat = misfit.map(|m| format!("{}: {m}", table.name));
            let reference = Reference::of(cell.value, &cell.uncertainty, self.citation.basis, source);
            references.push(Reference { caveat, ..reference });
        }
        references
    }

    /// Whether a column judges readings of an engine in a task.
    fn does_judge(&self, table: &Table, column: &Column, task: &Task, engine: &str) -> bool {
        let has_same_bounces = match (column.bounces.filter(|_| table.bounces.is_some()), task.transport) {
            (Some(n), Transport::Indirect(b) | Transport::Total(b)) => b == Bounces::AtMost(n),
            _ => true,
        };
        // Derived values judge every engine with any luminaire model.
        let is_derived = self.citation.basis != Basis::Published;
        let model = task.model();
        let has_same_model = column.model == model || column.also.contains(&model);
        let is_closed_form = column.reference && matches!(task.transport, Transport::Direct);
        has_same_bounces && (is_derived || (has_same_model && (column.engine == engine || is_closed_form)))
    }

    /// The table of a task as printed, with the rows at its targets.
    ///
    /// `None` where the paper has none, or where the values are derived and come from no paper.
    pub fn table(&self, task: &Task, case: &str) -> Option<PublishedTable> {
        if self.citation.basis != Basis::Published {
            return None;
        }
        let table = self.tables.get(&task.procedure).filter(|t| t.quantity == task.quantity)?;
        let rows: Vec<PublishedRow> = task.targets.iter().filter_map(|target| table.published_row(target)).collect();
        (!rows.is_empty()).then(|| PublishedTable {
            title: self.citation.title.clone(),
            name: table.name.clone(),
            procedure: task.procedure,
            quantity: table.quantity,
            cases: vec![case.to_owned()],
            bounces: table.bounces,
            units_in_last_digit: self.rounding.units_in_last_digit,
            flux: self.flux.clone(),
            columns: table.columns.iter().map(|(name, column)| column.published(name)).collect(),
            misfits: self.misfits(task),
            rows,
        })
    }

    /// Finds cells of a task's table that do not fit. Derived values rest on formulas, so they cannot contradict each other.
    pub(crate) fn misfits(&self, task: &Task) -> Vec<Misfit> {
        let Some(table) = self.tables.get(&task.procedure).filter(|_| self.citation.basis == Basis::Published) else {
            return vec![];
        };
        let changed = table.changed();
        let mut columns: Vec<Printed<'_>> = vec![];
        for column in table.columns.keys() {
            let decimals = table.decimals(column);
            let cells = table.rows.iter().enumerate().map(|(k, row)| {
                Some((row.cells.get(column)?.as_str(), self.original_cell(table, &changed, k, (column, decimals))?))
            });
            columns.push((column.as_str(), cells.collect()));
        }
        let lawful = match &task.scene.luminaires[..] {
            [luminaire] if task.procedure == ProcedureId::DirectIlluminance => {
                self.inverse_square_cells(table, luminaire)
            }
            _ => vec![],
        };
        let by_totals = changed.iter().map(|&(row, column, expected)| Misfit {
            row,
            column: column.to_owned(),
            printed: table.rows[row].cells[column].clone(),
            expected,
            half_width: 0.0,
            by: vec!["the control totals of its row and its column".to_owned()],
        });
        by_totals.chain(misfits(&columns, &lawful)).unique_by(|m| (m.row, m.column.clone())).collect()
    }

    /// What the reference column of direct light must print, by the printed intensity in the same direction.
    fn inverse_square_cells<'t>(&'t self, table: &'t Table, luminaire: &Luminaire) -> Vec<(usize, &'t str, Estimate)> {
        let Some(intensities) = self.tables.get(&ProcedureId::LuminousIntensity) else { return vec![] };
        let columns = table.reference_column().zip(intensities.reference_column());
        let Some((column, intensity_column)) = columns else { return vec![] };
        let changed = intensities.changed();
        let decimals = intensities.decimals(intensity_column);
        let mut cells = vec![];
        for (k, row) in table.rows.iter().enumerate() {
            let Some((at, normal)) = row.at_m.zip(row.normal) else { continue };
            let from = DVec3::from(at) - luminaire.position_m;
            let local = luminaire.orientation.transpose() * from;
            let source = intensities.rows.iter().position(|r| r.is_in_direction(local));
            let intensity =
                source.and_then(|r| self.original_cell(intensities, &changed, r, (intensity_column, decimals)));
            let Some(intensity) = intensity else { continue };
            let cosine = -DVec3::from(normal).normalize().dot(from.normalize());
            cells.push((k, column, intensity.times(luminaire.flux_scale * cosine / from.length_squared())));
        }
        cells
    }

    /// A cell of a column and its decimals, with the interval of its rounding, as it was when it was copied; `changed` are
    /// [`Table::changed`].
    fn original_cell(
        &self,
        table: &Table,
        changed: &[Changed<'_>],
        row: usize,
        (column, decimals): (&str, usize),
    ) -> Option<Estimate> {
        let current = self.cell(table.rows[row].cells.get(column)?, decimals)?;
        let original = changed.iter().find(|changed| (changed.0, changed.1) == (row, column));
        Some(original.map_or(current, |&(_, _, value)| Estimate { value, ..current }))
    }

    fn cell(&self, printed: &str, decimals: usize) -> Option<Estimate> {
        printed_cell(printed, decimals, self.rounding.units_in_last_digit)
    }
}

impl Column {
    fn published(&self, name: &str) -> PublishedColumn {
        PublishedColumn {
            name: name.to_owned(),
            reference: self.reference,
            meaning: self.meaning.clone(),
            engine: self.engine.clone(),
            model: self.model.clone(),
        }
    }
}

/// A changed cell, by row and column, with its original value.
type Changed<'t> = (usize, &'t str, f64);

/// Rows and columns whose control totals are not the sums of their cells, with the totals' excess over the sums.
struct TotalMismatches<'t> {
    rows: Vec<(usize, f64)>,
    columns: Vec<(&'t str, f64)>,
}

/// The excess of a total over the sum of its cells; `None` where they agree.
fn total_excess<'a>(total: Option<&String>, cells: impl Iterator<Item = &'a String>) -> Option<f64> {
    let total = parse_number(total?)?;
    let excess = total - cells.filter_map(|cell| parse_number(cell)).sum::<f64>();
    (excess.abs() > SUM_ROUNDING * total.abs().max(1.0)).then_some(excess)
}

fn parse_number(cell: &str) -> Option<f64> {
    cell.trim().parse::<f64>().ok()
}

fn describe_mismatch(total: &str, excess: f64) -> String {
    let sum = total.trim().parse::<f64>().unwrap_or(f64::NAN) - excess;
    format!("the control total {total} is of cells that add up to {}", (sum * 1e6).round() / 1e6)
}

/// Whether a row and a column have the same excess.
fn have_same_excess(of_row: f64, of_column: f64) -> bool {
    (of_row - of_column).abs() <= SUM_ROUNDING * of_row.abs().max(1.0)
}

impl Table {
    /// The decimals of a column: those of its longest cell, because a bare 0 is as exact as the other cells.
    fn decimals(&self, column: &str) -> usize {
        self.rows.iter().filter_map(|r| r.cells.get(column)).map(|c| decimals_of(c)).max().unwrap_or(0)
    }

    fn reference_column(&self) -> Option<&str> {
        self.columns.iter().find(|(_, c)| c.reference).map(|(name, _)| name.as_str())
    }

    fn published_row(&self, target: &Target) -> Option<PublishedRow> {
        let (k, row) = self.rows.iter().find_position(|r| r.is_at(target))?;
        let place = match target.direction {
            Some(d) => format!("{}", d.gamma_deg),
            None => format!("({})", target.meter.position_m.to_array().map(|x| x.to_string()).join(", ")),
        };
        Some(PublishedRow { meter: target.id.clone(), place, row: k, cells: row.cells.clone() })
    }

    fn total_mismatches(&self) -> TotalMismatches<'_> {
        let (mut rows, mut columns) = (vec![], vec![]);
        for (k, row) in self.rows.iter().enumerate() {
            rows.extend(total_excess(row.total.as_ref(), row.cells.values()).map(|excess| (k, excess)));
        }
        for (name, total) in &self.totals {
            let cells = self.rows.iter().filter_map(|row| row.cells.get(name));
            columns.extend(total_excess(Some(total), cells).map(|excess| (name.as_str(), excess)));
        }
        TotalMismatches { rows, columns }
    }

    /// Finds cells that differ from what they were when the control totals were added up, with their original values.
    ///
    /// A cell has changed where its row and its column have the same excess, or where all excess is in one of either.
    fn changed(&self) -> Vec<Changed<'_>> {
        let TotalMismatches { rows, columns } = self.total_mismatches();
        let any_match = rows.iter().cartesian_product(&columns).any(|(row, column)| have_same_excess(row.1, column.1));
        let mut changed = vec![];
        for (&(row, of_row), &(column, of_column)) in rows.iter().cartesian_product(&columns) {
            let excess = match (rows.len(), columns.len()) {
                _ if have_same_excess(of_row, of_column) => of_row,
                (1, _) if !any_match => of_column,
                (_, 1) if !any_match => of_row,
                _ => continue,
            };
            let Some((column, cell)) = self.rows[row].cells.get_key_value(column) else { continue };
            changed.extend(parse_number(cell).map(|value| (row, column.as_str(), value + excess)));
        }
        changed
    }
}

impl Row {
    /// Whether the row is in a direction of the luminaire's frame.
    fn is_in_direction(&self, local: DVec3) -> bool {
        let gamma_deg = local.angle_between(DVec3::NEG_Z).to_degrees();
        let c_deg = local.y.atan2(local.x).to_degrees().rem_euclid(360.0);
        // Every plane of the table meets at the poles.
        let is_pole = local.x.hypot(local.y) <= SAME_PLACE;
        is_same(self.gamma_deg, gamma_deg) && (is_pole || is_same(self.c_deg, c_deg))
    }

    fn is_at(&self, target: &Target) -> bool {
        match (target.direction, self.gamma_deg.zip(self.c_deg), self.at_m.zip(self.normal)) {
            (Some(d), Some((gamma, c)), _) => {
                (gamma - d.gamma_deg).abs() <= SAME_PLACE && (c - d.c_deg).abs() <= SAME_PLACE
            }
            (None, _, Some((at, normal))) => {
                DVec3::from(at).distance(target.meter.position_m) <= SAME_PLACE
                    && DVec3::from(normal).normalize_or_zero().distance(target.meter.normal) <= SAME_PLACE
            }
            _ => false,
        }
    }
}

/// Whether a row has this angle.
fn is_same(angle_deg: Option<f64>, other_deg: f64) -> bool {
    angle_deg.is_some_and(|angle| (angle - other_deg).abs() <= SAME_PLACE)
}

#[cfg(test)]
mod step_tests;

#[cfg(test)]
mod tests {
    use luxproof_model::MeterId;
    use luxproof_model::Uncertainty;
    use luxproof_scene::Meter;

    use super::*;

    #[test]
    fn derived_values_say_what_they_rest_on() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../reference");
        for (name, basis) in [("cie171/values/5.6", Basis::ClosedForm), ("analytic/values/s2", Basis::Simulator)] {
            let published = Published::read(&folder.join(format!("{name}.yaml"))).unwrap();
            assert_eq!(published.citation.basis, basis, "{name}");
        }
    }

    #[test]
    fn a_column_of_a_case_judges_that_case_alone() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../reference/cie171/values/5.9.yaml");
        let columns = |case: &str| {
            let published = Published::read(&path).unwrap().for_case(case);
            published.tables[&ProcedureId::DirectIlluminance].columns.keys().cloned().collect::<Vec<String>>()
        };
        assert_eq!(columns("5.9-roof/4m-sky-12"), ["4m-sky-12"]);
        assert!(columns("5.9-roof").is_empty());
        assert!(columns("4m-sky-12").is_empty());
    }

    #[test]
    fn places_and_totals_that_were_edited_are_reported_with_their_lines() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../reference/published/cachet.yaml");
        let text = std::fs::read_to_string(&path).unwrap();
        let procedure = ProcedureId::DirectIlluminance;
        let mut targets = vec![];
        for (k, row) in Published::read(&path).unwrap().tables[&procedure].rows.iter().enumerate() {
            let meter = Meter { position_m: row.at_m.unwrap().into(), normal: row.normal.unwrap().into() };
            targets.push(Target::of_one(MeterId::new("ceiling", k), meter, 1.0));
        }
        let task = Task { procedure, targets, ..crate::fixtures::task(1) };
        let folder = tempfile::tempdir().unwrap();
        let found = |old: &str, new: &str| {
            let (file, edited) = (folder.path().join("t.yaml"), text.replacen(old, new, 1));
            std::fs::write(&file, &edited).unwrap();
            let line = text.find(old).map_or(0, |at| text[..at].lines().count());
            (Published::read(&file).unwrap().findings(&[&task]), format!("t.yaml:{line}:"))
        };
        assert!(found("", "").0.is_empty());
        for (old, new, says) in [
            ("[2, 10, 17], normal", "[2, 10, 77], normal", "no meter"),
            ("[2, 10, 17], normal: [0, 0, -1]", "[2, 10, 17], normal: [0, 0, 1]", "no meter"),
            ("[2, 10, 17], normal", "[2, 2, 17], normal", "no meter"),
            ("total: \"6.75\"", "total: \"9.75\"", "the control total 9.75 is of cells that add up to 6.75"),
            ("totals: {inverse_square: \"25.40\"", "totals: {inverse_square: \"25.90\"", "add up to 25.4"),
        ] {
            let (findings, place) = found(old, new);
            let [one] = &findings[..] else { panic!("{new}: {findings:?}") };
            assert!(one.contains(&place) && one.contains(says), "{place} {one}");
        }
        // A cell is named by itself, whatever other total was edited besides.
        assert!(found("inverse_square: \"2.24\"", "inverse_square: \"2.84\"").0.is_empty());
        let both = text.replacen("inverse_square: \"2.24\"", "inverse_square: \"2.84\"", 1).replacen(
            "\"25.33\"",
            "\"25.83\"",
            1,
        );
        let file = folder.path().join("both.yaml");
        std::fs::write(&file, both).unwrap();
        let published = Published::read(&file).unwrap();
        let changed = published.tables[&procedure].changed();
        assert_eq!((changed.len(), published.findings(&[&task]).len()), (1, 1), "{changed:?}");
    }

    #[test]
    fn a_cell_stands_for_the_interval_of_its_printed_digits() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../reference/published/cachet.yaml");
        let published = Published::read(&path).unwrap();
        let within = |value, half| Some(Estimate { value, uncertainty: Uncertainty::Bound(half) });
        assert_eq!(published.cell("2.70", 0), within(2.70, 0.01));
        assert_eq!(published.cell("35.7", 1), within(35.7, 0.1));
        assert_eq!(published.cell("0", 0), within(0.0, 1.0));
        assert_eq!(published.cell("n/a", 0), None);
        // The zero of lum1 stands in a column of two decimals.
        let table = &published.tables[&ProcedureId::LuminousIntensity];
        assert_eq!((table.decimals("lum1"), table.decimals("ies_file")), (2, 1));
        assert_eq!(published.cell("0", 2), within(0.0, 0.01));
    }
}
