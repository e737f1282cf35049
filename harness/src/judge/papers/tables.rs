//! Published tables as references: printed cells with the interval that their rounding leaves.
//!
//! The format is described at the top of `reference/published/cachet.yaml`.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use glam::DVec3;
use itertools::Itertools;
use luminaire::scene::{Bounces, Luminaire, Transport};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::fit::{Misfit, Printed, misfits};
use crate::judge::{Basis, Reference};
use crate::procedures::{Target, Task};
use crate::record::{Estimate, MeterId, ProcedureId, Quantity, Uncertainty};
use crate::spec::Source;
use crate::system::files::{MAX_BYTES, read_bounded};

/// Places within so many metres, and directions within so many degrees, are the same, as the format says.
const SAME: f64 = 1e-6;
/// The engine of a column that a paper takes from the photometric file itself.
pub const PHOTOMETRY: &str = "photometry";
/// Sums of printed decimals differ by less than this, relative to their total or 1.
const ROUNDING_OF_SUMS: f64 = 1e-9;

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Published {
    #[serde(rename = "luxproof_published")]
    version: u32,
    citation: Citation,
    /// The spec that has the geometry, relative to the file.
    spec: Option<PathBuf>,
    rounding: Rounding,
    /// What is known of the luminaire's flux beyond our file.
    flux: Option<PublishedFlux>,
    pub(super) tables: BTreeMap<ProcedureId, Table>,
    /// Where it stands.
    #[serde(skip)]
    source: Source,
}

/// The flux of a paper's luminaire, as far as its tables tell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PublishedFlux {
    pub value_lm: f64,
    /// Half the width of the interval that holds it.
    pub half_width_lm: f64,
    pub source: String,
}

#[derive(Clone, Debug, Deserialize)]
struct Citation {
    title: String,
    /// What the values are, where they are not a paper's.
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
    /// Further luminaire models that the column may be held against.
    #[serde(default)]
    also: Vec<String>,
    #[serde(rename = "distance_m")]
    _distance_m: Option<f64>,
    bounces: Option<u32>,
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

/// A published table as it is printed, with the meters that its rows belong to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PublishedTable {
    pub title: String,
    pub name: String,
    pub procedure: ProcedureId,
    pub quantity: Quantity,
    /// The cases that are held against it.
    pub cases: Vec<String>,
    /// Diffuse reflections that its renderings include, where that matters.
    pub bounces: Option<u32>,
    /// Units of the last printed digit that a cell is uncertain by.
    #[serde(default)]
    pub units_in_last_digit: f64,
    pub flux: Option<PublishedFlux>,
    pub columns: Vec<PublishedColumn>,
    /// Its rows, in the order of the meters.
    pub rows: Vec<PublishedRow>,
    /// Cells that do not fit the rest of it.
    #[serde(default)]
    pub misfits: Vec<Misfit>,
}

impl PublishedTable {
    /// Whether both are the same table of the same paper.
    pub fn is_the_same(&self, other: &Self) -> bool {
        (&self.title, &self.name, &self.procedure) == (&other.title, &other.name, &other.procedure)
    }

    /// What a column prints in a row, with the interval of its digits.
    pub fn printed(&self, row: &PublishedRow, column: &str) -> Option<Estimate> {
        cell(row.cells.get(column)?, 0, self.units_in_last_digit)
    }
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct PublishedColumn {
    pub name: String,
    /// Whether it is what the paper judges its other columns by.
    pub reference: bool,
    pub meaning: String,
    /// The engine whose readings stand beside it.
    #[serde(default)]
    pub engine: String,
    #[serde(default)]
    pub model: String,
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct PublishedRow {
    pub meter: MeterId,
    /// The place: gamma in degrees, or the position in metres.
    pub place: String,
    /// Which of the paper's rows it is, counted from 0.
    #[serde(default)]
    pub row: usize,
    pub cells: BTreeMap<String, String>,
}

#[derive(Debug, thiserror::Error)]
#[error("{file}: {message}")]
pub struct PublishedError {
    pub file: String,
    pub message: String,
}

impl Published {
    pub fn read(path: &Path) -> Result<Self, PublishedError> {
        let fail = |message: String| PublishedError { file: path.display().to_string(), message };
        let bytes = read_bounded(path, MAX_BYTES).map_err(|e| fail(e.to_string()))?;
        let text = String::from_utf8(bytes).map_err(|e| fail(format!("is not UTF-8: {e}")))?;
        let mut published: Self = crate::spec::from_yaml(&text).map_err(fail)?;
        published.source = Source::new(path.to_owned(), text);
        if published.version != 1 {
            return Err(fail(format!("format version {} is not known; this program reads 1", published.version)));
        }
        let of_row = |r: &'_ Row| r.cells.values().chain(&r.total).cloned().collect::<Vec<String>>();
        let of_table = |t: &'_ Table| t.rows.iter().flat_map(of_row).chain(t.totals.values().cloned()).collect_vec();
        if let Some(bad) = published.tables.values().flat_map(of_table).find(|c| published.cell(c, 0).is_none()) {
            return Err(fail(format!("the cell \"{bad}\" is no number")));
        }
        Ok(published)
    }

    /// The spec that makes its tables again.
    pub fn spec(&self) -> Option<PathBuf> {
        let folder = self.source.path.parent().unwrap_or(Path::new(""));
        self.spec.as_ref().map(|spec| folder.join(spec))
    }

    /// The engines whose readings stand beside its columns; what it takes from the photometric file is none's.
    pub fn engines(&self) -> BTreeSet<&str> {
        let columns = self.tables.values().flat_map(|table| table.columns.values());
        columns.map(|column| column.engine.as_str()).filter(|engine| *engine != PHOTOMETRY).collect()
    }

    /// What of its tables stands for nothing in the tasks that are held against it, or not for what was copied: rows at no meter,
    /// control totals that their cells do not add up to. Each with its place in the file.
    pub fn findings(&self, tasks: &[&Task]) -> Vec<String> {
        let mut found = vec![];
        for (procedure, table) in &self.tables {
            let is_its = |task: &&&Task| task.procedure == *procedure && task.quantity == table.quantity;
            let targets: Vec<&Target> = tasks.iter().filter(is_its).flat_map(|task| &task.targets).collect();
            if targets.is_empty() {
                continue;
            }
            let told = |place: &str, what: String, help: &str| {
                let place = format!("tables.{procedure}.{place}");
                self.source.error_at(&place, format!("{}: {what}", table.name), help).to_string()
            };
            let used: BTreeSet<usize> =
                targets.iter().filter_map(|target| table.rows.iter().position(|row| row.is_at(target))).collect();
            for k in (0..table.rows.len()).filter(|k| !used.contains(k)) {
                let help = "a row is held against readings at its own place, to 1e-6 m or degrees, and the first of its place alone";
                found.push(told(&format!("rows[{k}]"), "the row belongs to no meter and is not used".to_owned(), help));
            }
            let (changed, (rows, columns)) = (table.changed(), table.lacking());
            let off = |total: &str, missing: f64| {
                let sum = total.trim().parse::<f64>().unwrap_or(f64::NAN) - missing;
                format!("the control total {total} is of cells that add up to {}", (sum * 1e6).round() / 1e6)
            };
            let help = "a total or a cell was changed since they were copied";
            for (k, missing) in rows.into_iter().filter(|(k, _)| changed.iter().all(|c| c.0 != *k)) {
                let total = table.rows[k].total.as_deref().unwrap_or_default();
                found.push(told(&format!("rows[{k}].total"), off(total, missing), help));
            }
            for (name, missing) in columns.into_iter().filter(|(name, _)| changed.iter().all(|c| c.1 != *name)) {
                found.push(told(&format!("totals.{name}"), off(&table.totals[name], missing), help));
            }
        }
        found
    }

    /// The references that the paper holds for a reading of `engine` at one target.
    ///
    /// The paper's own reference columns of a closed form judge every engine; every other column stands beside the
    /// readings of the engine that it names; both of the same luminaire model. A column at a fixed number of bounces is compared with readings at that number.
    /// What misfits cells of the task's table have is [`Self::misfits`].
    pub(in crate::judge) fn references(
        &self,
        task: &Task,
        target: &Target,
        engine: &str,
        misfits: &[Misfit],
    ) -> Vec<Reference> {
        let Some(table) = self.tables.get(&task.procedure).filter(|t| t.quantity == task.quantity) else {
            return vec![];
        };
        let Some((k, row)) = table.rows.iter().find_position(|r| r.is_at(target)) else { return vec![] };
        let model = task.model();
        // Derived values judge every engine, whatever they are of; a paper's those of the same luminaire model.
        let derived = self.citation.basis != Basis::Published;
        let closed_form = matches!(task.transport, Transport::Direct);
        let compared = |column: &Column| {
            let same_bounces = match (column.bounces.filter(|_| table.bounces.is_some()), task.transport) {
                (Some(n), Transport::Indirect(b) | Transport::Total(b)) => b == Bounces::AtMost(n),
                _ => true,
            };
            let same_model = column.model == model || column.also.contains(&model);
            same_bounces && (derived || (same_model && (column.engine == engine || (column.reference && closed_form))))
        };
        let reference = |(name, column): (&String, &Column)| {
            let cell = self.cell(row.cells.get(name)?, table.decimals(name))?;
            let source = format!("{}, {}, {name}: {}", self.citation.title, table.name, column.meaning);
            let doubt =
                misfits.iter().find(|m| m.row == k && m.column == *name).map(|m| format!("{}: {m}", table.name));
            Some(Reference { doubt, ..Reference::of(cell.value, &cell.uncertainty, self.citation.basis, source) })
        };
        table.columns.iter().filter(|(_, column)| compared(column)).filter_map(reference).collect()
    }

    /// The table of a task as printed, rows at its targets alone; `None` where the paper has none, or these are derived
    /// values and no paper's.
    pub fn table(&self, task: &Task, case: &str) -> Option<PublishedTable> {
        if self.citation.basis != Basis::Published {
            return None;
        }
        let table = self.tables.get(&task.procedure).filter(|t| t.quantity == task.quantity)?;
        let row = |target: &Target| {
            let (k, row) = table.rows.iter().find_position(|r| r.is_at(target))?;
            let place = match target.direction {
                Some(d) => format!("{}", d.gamma_deg),
                None => format!("({})", target.meter.position_m.to_array().map(|x| x.to_string()).join(", ")),
            };
            Some(PublishedRow { meter: target.id.clone(), place, row: k, cells: row.cells.clone() })
        };
        let rows: Vec<PublishedRow> = task.targets.iter().filter_map(row).collect();
        let column = |(name, column): (&String, &Column)| PublishedColumn {
            name: name.clone(),
            reference: column.reference,
            meaning: column.meaning.clone(),
            engine: column.engine.clone(),
            model: column.model.clone(),
        };
        (!rows.is_empty()).then(|| PublishedTable {
            title: self.citation.title.clone(),
            name: table.name.clone(),
            procedure: task.procedure,
            quantity: table.quantity,
            cases: vec![case.to_owned()],
            bounces: table.bounces,
            units_in_last_digit: self.rounding.units_in_last_digit,
            flux: self.flux.clone(),
            columns: table.columns.iter().map(column).collect(),
            misfits: self.misfits(task),
            rows,
        })
    }

    /// Cells of a task's table that do not fit; derived values rest on formulas, and not on one another.
    pub(in crate::judge) fn misfits(&self, task: &Task) -> Vec<Misfit> {
        let Some(table) = self.tables.get(&task.procedure).filter(|_| self.citation.basis == Basis::Published) else {
            return vec![];
        };
        let all_changed = table.changed();
        let columns: Vec<Printed<'_>> = table
            .columns
            .keys()
            .map(|column| {
                let rows = table.rows.iter().enumerate();
                let cells = rows.map(|(k, row)| {
                    Some((row.cells.get(column)?.as_str(), self.copied(table, &all_changed, k, column)?))
                });
                (column.as_str(), cells.collect())
            })
            .collect();
        let lawful = match &task.scene.luminaires[..] {
            [luminaire] if task.procedure == ProcedureId::DirectIlluminance => self.by_the_law(table, luminaire),
            _ => vec![],
        };
        let changed = all_changed.iter().map(|&(row, column, expected)| Misfit {
            row,
            column: column.to_owned(),
            printed: table.rows[row].cells[column].clone(),
            expected,
            half_width: 0.0,
            by: vec!["the control totals of its row and its column".to_owned()],
        });
        changed.chain(misfits(&columns, &lawful)).unique_by(|m| (m.row, m.column.clone())).collect()
    }

    /// What the reference column of direct light must print by the intensity in the same direction, where that is printed.
    fn by_the_law<'t>(&'t self, table: &'t Table, luminaire: &Luminaire) -> Vec<(usize, &'t str, Estimate)> {
        let Some(intensities) = self.tables.get(&ProcedureId::LuminousIntensity) else { return vec![] };
        let reference =
            |table: &'t Table| table.columns.iter().find(|(_, c)| c.reference).map(|(name, _)| name.as_str());
        let Some((column, of_intensity)) = reference(table).zip(reference(intensities)) else { return vec![] };
        let changed = intensities.changed();
        let expected = |(k, row): (usize, &Row)| {
            let from = DVec3::from(row.at_m?) - luminaire.position_m;
            let local = luminaire.orientation.transpose() * from;
            let gamma_deg = local.angle_between(DVec3::NEG_Z).to_degrees();
            let c_deg = local.y.atan2(local.x).to_degrees().rem_euclid(360.0);
            // Every plane of the table meets at the poles.
            let is_pole = local.x.hypot(local.y) <= SAME;
            let same = |a: Option<f64>, b: f64| a.is_some_and(|a| (a - b).abs() <= SAME);
            let is_there = |row: &&Row| same(row.gamma_deg, gamma_deg) && (is_pole || same(row.c_deg, c_deg));
            let intensity =
                self.copied(intensities, &changed, intensities.rows.iter().position(|r| is_there(&r))?, of_intensity)?;
            let cosine = -DVec3::from(row.normal?).normalize().dot(from.normalize());
            Some((k, column, intensity.times(luminaire.flux_scale * cosine / from.length_squared())))
        };
        table.rows.iter().enumerate().filter_map(expected).collect()
    }

    /// A cell of a table, with the interval that its rounding leaves, as it was when it was copied; `changed` are [`Table::changed`].
    fn copied(&self, table: &Table, changed: &[Changed<'_>], row: usize, column: &str) -> Option<Estimate> {
        let now = self.cell(table.rows[row].cells.get(column)?, table.decimals(column))?;
        let was = changed.iter().find(|changed| (changed.0, changed.1) == (row, column));
        Some(was.map_or(now, |&(_, _, value)| Estimate { value, ..now }))
    }

    fn cell(&self, printed: &str, decimals: usize) -> Option<Estimate> {
        cell(printed, decimals, self.rounding.units_in_last_digit)
    }
}

/// A printed cell with the interval that its rounding leaves; one without decimals stands for that of a column that prints
/// `decimals`.
fn cell(printed: &str, decimals: usize, units_in_last_digit: f64) -> Option<Estimate> {
    let value: f64 = printed.trim().parse().ok().filter(|v: &f64| v.is_finite())?;
    let unit = 10f64.powi(-i32::try_from(decimals_of(printed).max(decimals)).ok()?);
    Some(Estimate { value, uncertainty: Uncertainty::Bound(unit * units_in_last_digit) })
}

fn decimals_of(printed: &str) -> usize {
    printed.split_once('.').map_or(0, |(_, fraction)| fraction.trim().len())
}

impl Table {
    /// The decimals of a column: those of its longest cell, since a bare 0 among them is as exact as they are.
    fn decimals(&self, column: &str) -> usize {
        self.rows.iter().filter_map(|r| r.cells.get(column)).map(|c| decimals_of(c)).max().unwrap_or(0)
    }
}

/// A cell that was changed, by row and column, and what it was.
type Changed<'t> = (usize, &'t str, f64);

/// A row or a column, and what its control total says beyond the sum of its cells.
type Lack<Of> = (Of, f64);

/// What a total says beyond the sum of the cells that it is of; `None` where they agree.
fn missing<'a>(total: Option<&String>, cells: impl Iterator<Item = &'a String>) -> Option<f64> {
    let number = |cell: &String| cell.trim().parse::<f64>().ok();
    let total = number(total?)?;
    let missing = total - cells.filter_map(number).sum::<f64>();
    (missing.abs() > ROUNDING_OF_SUMS * total.abs().max(1.0)).then_some(missing)
}

impl Table {
    /// The rows and columns whose control totals are not the sums of their cells, and what the totals say beyond.
    fn lacking(&self) -> (Vec<Lack<usize>>, Vec<Lack<&str>>) {
        let of_row = |(k, row): (usize, &Row)| Some((k, missing(row.total.as_ref(), row.cells.values())?));
        let of_column = |(name, total): (&'_ String, &String)| {
            missing(Some(total), self.rows.iter().filter_map(|row| row.cells.get(name)))
        };
        let columns = self.totals.iter().filter_map(|column| Some((column.0.as_str(), of_column(column)?)));
        (self.rows.iter().enumerate().filter_map(of_row).collect(), columns.collect())
    }

    /// The cells that are not what they were when its control totals were added up, and what they were: where a row and a column lack as
    /// much, or else all that lacks is in one of either.
    fn changed(&self) -> Vec<Changed<'_>> {
        let (rows, columns) = self.lacking();
        let is_one =
            |of_row: f64, of_column: f64| (of_row - of_column).abs() <= ROUNDING_OF_SUMS * of_row.abs().max(1.0);
        let any_is_one = rows.iter().cartesian_product(&columns).any(|(row, column)| is_one(row.1, column.1));
        let place = |(&(row, of_row), &(column, of_column)): (&(usize, f64), &(&str, f64))| {
            let (column, cell) = self.rows[row].cells.get_key_value(column)?;
            let lacks = match (rows.len(), columns.len()) {
                _ if is_one(of_row, of_column) => of_row,
                (1, _) if !any_is_one => of_column,
                (_, 1) if !any_is_one => of_row,
                _ => return None,
            };
            Some((row, column.as_str(), cell.trim().parse::<f64>().ok()? + lacks))
        };
        rows.iter().cartesian_product(&columns).filter_map(place).collect()
    }
}

impl Row {
    fn is_at(&self, target: &Target) -> bool {
        match (target.direction, self.gamma_deg.zip(self.c_deg), self.at_m.zip(self.normal)) {
            (Some(d), Some((gamma, c)), _) => (gamma - d.gamma_deg).abs() <= SAME && (c - d.c_deg).abs() <= SAME,
            (None, _, Some((at, normal))) => {
                DVec3::from(at).distance(target.meter.position_m) <= SAME
                    && DVec3::from(normal).normalize_or_zero().distance(target.meter.normal) <= SAME
            }
            _ => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use luminaire::scene::Meter;

    use super::*;

    #[test]
    fn derived_values_say_what_they_rest_on() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../reference/analytic/values");
        for (name, basis) in [("cie-5.6", Basis::ClosedForm), ("s2", Basis::Exact)] {
            let published = Published::read(&folder.join(format!("{name}.yaml"))).unwrap();
            assert_eq!(published.citation.basis, basis, "{name}");
        }
    }

    #[test]
    fn places_and_totals_that_were_edited_are_told_with_their_lines() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../reference/published/cachet.yaml");
        let text = std::fs::read_to_string(&path).unwrap();
        let procedure = ProcedureId::DirectIlluminance;
        let place = |(k, row): (usize, &Row)| {
            let meter = Meter { position_m: row.at_m.unwrap().into(), normal: row.normal.unwrap().into() };
            Target::of_one(MeterId::new("ceiling", k), meter, 1.0)
        };
        let rows = Published::read(&path).unwrap().tables[&procedure].rows.clone();
        let targets = rows.iter().enumerate().map(place).collect();
        let task = Task { procedure, targets, ..crate::judge::tests::task(1) };
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
            let (told, place) = found(old, new);
            let [one] = &told[..] else { panic!("{new}: {told:?}") };
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
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../reference/published/cachet.yaml");
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
