//! The printed tables of CIE 171:2006 in a user's own copy, judged cell by cell against derived values.
//!
//! The project ships no printed table: `reference/cie171/printed-template.yaml` is filled in by the owner of a copy.

use std::collections::BTreeMap;
use std::path::Path;

use luxproof_spec::{Source, SpecError, Trust, from_yaml};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The template, without values.
pub const TEMPLATE: &str = include_str!("../data/printed-template.yaml");
/// Derived values of the cases with printed tables, in lx under 10 000 lx outside.
const DERIVED: [(&str, &str); 2] =
    [("roof", include_str!("../data/5.9.yaml")), ("facade", include_str!("../data/5.11.yaml"))];
/// The derivations agree to this part of every value.
const DERIVATION_ERROR: f64 = 1e-6;
/// A cell that is left out.
const LEFT_OUT: &str = "_";
/// Lux per percent of the illuminance outside.
const LUX_PER_PERCENT: f64 = 100.0;

/// The filled-in tables.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct PrintedFile {
    luxproof_printed: u32,
    #[serde(default)]
    source: String,
    /// By table, then by row; a row is the text of its cells.
    tables: BTreeMap<String, BTreeMap<String, String>>,
}

/// The part of a file of derived values that is used here.
#[derive(Debug, Deserialize)]
struct DerivedFile {
    tables: BTreeMap<String, DerivedTable>,
}

#[derive(Debug, Deserialize)]
struct DerivedTable {
    rows: Vec<DerivedRow>,
}

#[derive(Debug, Deserialize)]
struct DerivedRow {
    cells: BTreeMap<String, String>,
}

/// A printed cell that disagrees with the derived value.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct WrongCell {
    pub table: String,
    /// The row: `sky-5`.
    pub sky: String,
    /// The column: a letter.
    pub point: String,
    pub printed: String,
    /// In percent of the illuminance outside, as printed.
    pub derived: f64,
    /// Of the derived value.
    pub deviation_percent: f64,
    /// Which neighbours contradict the cell, or what the row is instead.
    pub contradicted_by: String,
}

/// The judgement of a copy.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct CopyJudgement {
    /// The copy, in the words of its owner.
    pub source: String,
    /// Cells that agree within half a unit of their last printed digit.
    pub agree: usize,
    pub wrong: Vec<WrongCell>,
    /// Cells that were left out.
    pub left_out: usize,
}

/// A row of a printed table: its cells, where filled in, and what they should be.
struct Row {
    sky: String,
    cells: Vec<Option<Cell>>,
}

struct Cell {
    printed: String,
    value: f64,
    half_unit: f64,
    derived: f64,
}

impl Cell {
    fn agrees(&self) -> bool {
        self.is_rounding_of(self.derived)
    }

    fn is_rounding_of(&self, value: f64) -> bool {
        (self.value - value).abs() <= self.half_unit * (1.0 + 1e-9) + DERIVATION_ERROR * value
    }
}

/// Judges the tables in a file. One that is not trusted is no link, and none of its words is shown.
///
/// # Errors
/// If the file is unreadable, lacks a table, a row or a cell of the template, or has a cell that is no number.
pub fn judge_copy(path: &Path, trust: Trust) -> Result<CopyJudgement, SpecError> {
    let judged = Source::read(path, trust).and_then(|source| {
        let file: PrintedFile = from_yaml(&source.text).map_err(|error| source.error_at("", error, HELP))?;
        judge(&file, &source)
    });
    judged.map_err(|error| error.withheld(trust))
}

const HELP: &str = "start from the template: `luxproof reproduce cie171 > my-copy.yaml`";

fn judge(file: &PrintedFile, source: &Source) -> Result<CopyJudgement, SpecError> {
    if file.luxproof_printed != 1 {
        let message = format!("version {} is not known", file.luxproof_printed);
        return Err(source.error_at("luxproof_printed", message, "this program reads 1"));
    }
    let internal = |error: String| source.error_at("", error, "the program's own data is broken: report this");
    let template: PrintedFile = from_yaml(TEMPLATE).map_err(internal)?;
    if let Some(unknown) = file.tables.keys().find(|name| !template.tables.contains_key(*name)) {
        let known: Vec<&str> = template.tables.keys().map(String::as_str).collect();
        let help = format!("the tables are {}", known.join(", "));
        return Err(source.error_at(&format!("tables.{unknown}"), "the template has no such table", help));
    }
    let mut judgement = CopyJudgement { source: file.source.clone(), agree: 0, wrong: vec![], left_out: 0 };
    for (name, expected) in &template.tables {
        let Some(printed) = file.tables.get(name) else {
            return Err(source.error_at("tables", format!("the table `{name}` is missing"), HELP));
        };
        let rows = read_table(name, expected, printed, source)?;
        let cells = rows.iter().flat_map(|row| &row.cells);
        judgement.left_out += cells.clone().filter(|cell| cell.is_none()).count();
        judgement.agree += cells.flatten().filter(|cell| cell.agrees()).count();
        judgement.wrong.extend(wrong_cells(name, expected, &rows));
    }
    if judgement.agree + judgement.wrong.len() == 0 {
        return Err(source.error_at(
            "tables",
            "no cell is filled in",
            "replace `_` by the printed values of your copy",
        ));
    }
    Ok(judgement)
}

/// The rows of a table in the order of the skies, each with its derived values.
fn read_table(
    name: &str,
    expected: &BTreeMap<String, String>,
    printed: &BTreeMap<String, String>,
    source: &Source,
) -> Result<Vec<Row>, SpecError> {
    let place = |row: &str| format!("tables.{name}.{row}");
    if let Some(unknown) = printed.keys().find(|row| !expected.contains_key(*row)) {
        return Err(source.error_at(&place(unknown), "the template has no such row", "rows are `sky-1` to `sky-16`"));
    }
    let points = expected.get("points").map_or("", String::as_str);
    if let Some(other) = printed.get("points").filter(|other| other.split_whitespace().ne(points.split_whitespace())) {
        let message = format!("the points are `{other}`, those of the template `{points}`");
        return Err(source.error_at(&place("points"), message, "give the values in the order of the template"));
    }
    let mut rows = vec![];
    for number in 1..=16 {
        let sky = format!("sky-{number}");
        let Some(text) = printed.get(&sky) else {
            return Err(source.error_at(&format!("tables.{name}"), format!("the row `{sky}` is missing"), HELP));
        };
        let derived = derived_row(name, points, &sky).ok_or_else(|| {
            source.error_at(&place(&sky), "no value is derived for this row", "the program's own data is broken")
        })?;
        let cells: Vec<&str> = text.split_whitespace().collect();
        if cells.len() != derived.len() {
            let message = format!("{} cells for the {} points {points}", cells.len(), derived.len());
            return Err(source.error_at(&place(&sky), message, "write `_` for a cell that you leave out"));
        }
        let cells = cells.into_iter().zip(derived).map(|(cell, derived)| read_cell(cell, derived));
        let cells = cells.collect::<Result<Vec<_>, String>>().map_err(|message| {
            source.error_at(&place(&sky), message, "write digits with a point, such as 46.74, or `_`")
        })?;
        rows.push(Row { sky, cells });
    }
    Ok(rows)
}

fn read_cell(text: &str, derived: f64) -> Result<Option<Cell>, String> {
    if text == LEFT_OUT {
        return Ok(None);
    }
    let is_plain = text.chars().all(|c| c.is_ascii_digit() || c == '.') && text.len() <= 12;
    let value = text.parse::<f64>().ok().filter(|_| is_plain);
    let value = value.ok_or_else(|| format!("`{text}` is no printed number"))?;
    let decimals = text.split_once('.').map_or(0, |(_, fraction)| fraction.len());
    let half_unit = 0.5 * 0.1_f64.powi(i32::try_from(decimals).unwrap_or(0));
    Ok(Some(Cell { printed: text.to_owned(), value, half_unit, derived }))
}

/// The derived values of a row, in percent; `name` is that of its table, such as `roof-4m-wall`.
fn derived_row(name: &str, points: &str, sky: &str) -> Option<Vec<f64>> {
    let (shape, rest) = name.split_once('-')?;
    let (size, _part) = rest.split_once('-')?;
    let (_, text) = DERIVED.iter().find(|(of, _)| *of == shape)?;
    let file: DerivedFile = from_yaml(text).ok()?;
    let rows = &file.tables.values().next()?.rows;
    let column = format!("{size}-{sky}");
    let cells = points.split_whitespace().map(|letter| {
        let place = usize::from(*letter.as_bytes().first()?).checked_sub(usize::from(b'A'))?;
        Some(rows.get(place)?.cells.get(&column)?.parse::<f64>().ok()? / LUX_PER_PERCENT)
    });
    cells.collect()
}

/// The cells of a table that disagree, each with what contradicts it.
fn wrong_cells(name: &str, expected: &BTreeMap<String, String>, rows: &[Row]) -> Vec<WrongCell> {
    let points: Vec<&str> = expected.get("points").map_or("", String::as_str).split_whitespace().collect();
    let mut wrong = vec![];
    for (r, row) in rows.iter().enumerate() {
        for (c, cell) in row.cells.iter().enumerate() {
            let Some(cell) = cell.as_ref().filter(|cell| !cell.agrees()) else { continue };
            wrong.push(WrongCell {
                table: name.to_owned(),
                sky: row.sky.clone(),
                point: points.get(c).map_or_else(String::new, |point| (*point).to_owned()),
                printed: cell.printed.clone(),
                derived: cell.derived,
                deviation_percent: 100.0 * (cell.value / cell.derived - 1.0),
                contradicted_by: other_row(rows, r).unwrap_or_else(|| describe_neighbours(rows, r, c)),
            });
        }
    }
    wrong
}

/// Says that a row holds the values of another sky, or its own in reverse, where it does.
fn other_row(rows: &[Row], r: usize) -> Option<String> {
    let cells: Vec<&Cell> = rows[r].cells.iter().flatten().collect();
    // A row of a few cells resembles another by chance.
    if cells.len() < rows[r].cells.len() || cells.iter().filter(|cell| !cell.agrees()).count() < 3 {
        return None;
    }
    let reversed = cells.iter().zip(cells.iter().rev()).all(|(cell, other)| cell.is_rounding_of(other.derived));
    if reversed {
        return Some("the row has the values of its sky in reverse".to_owned());
    }
    let others = rows.iter().enumerate().filter(|(other, _)| *other != r);
    others
        .filter(|(_, other)| other.cells.iter().all(Option::is_some))
        .find(|(_, other)| cells.iter().zip(other.cells.iter().flatten()).all(|(a, b)| a.is_rounding_of(b.derived)))
        .map(|(_, other)| format!("the row has the values of {}", other.sky))
}

/// How many cells of the same row and of the same column follow the derivation.
fn describe_neighbours(rows: &[Row], r: usize, c: usize) -> String {
    let in_row =
        rows[r].cells.iter().enumerate().filter(|(other, _)| *other != c).filter_map(|(_, cell)| cell.as_ref());
    let in_column = rows.iter().enumerate().filter(|(other, _)| *other != r);
    let in_column = in_column.filter_map(|(_, row)| row.cells.get(c).and_then(Option::as_ref));
    let (row_agree, row_count) = count_agreeing(in_row);
    let (column_agree, column_count) = count_agreeing(in_column);
    format!(
        "{row_agree} of {row_count} other points under this sky and {column_agree} of {column_count} other skies at this \
         point follow the derivation"
    )
}

fn count_agreeing<'a>(cells: impl Iterator<Item = &'a Cell>) -> (usize, usize) {
    cells.fold((0, 0), |(agree, all), cell| (agree + usize::from(cell.agrees()), all + 1))
}

/// A template that is filled in with the derived values, rounded to some decimals.
#[doc(hidden)]
#[must_use]
pub fn filled_template(decimals: usize) -> String {
    let (mut name, mut points, mut text) = (String::new(), String::new(), String::new());
    for line in TEMPLATE.lines() {
        if let Some(table) = line.strip_prefix("  ").filter(|l| !l.starts_with(' ')).and_then(|l| l.strip_suffix(':')) {
            table.clone_into(&mut name);
        }
        if let Some(letters) = line.trim().strip_prefix("points: ") {
            letters.clone_into(&mut points);
        }
        let row = line.trim().split_once(':').filter(|(key, _)| key.starts_with("sky-"));
        match row.and_then(|(sky, _)| Some((sky, derived_row(&name, &points, sky)?))) {
            Some((sky, derived)) => {
                let cells: Vec<String> = derived.iter().map(|value| format!("{value:.decimals$}")).collect();
                text += &format!("    {sky}: {}\n", cells.join(" "));
            }
            None => text += &format!("{line}\n"),
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn judged(text: &str) -> Result<CopyJudgement, SpecError> {
        let source = Source::new("copy.yaml".into(), text.to_owned());
        judge(&from_yaml(text).unwrap(), &source)
    }

    /// Changes a cell by some units of its last digit; all in text.
    fn change(text: &str, table: &str, sky: &str, column: usize, units: i64) -> (String, String) {
        let start = text.find(&format!("  {table}:\n")).unwrap();
        let at = start + text[start..].find(&format!(" {sky}: ")).unwrap() + sky.len() + 3;
        let end = at + text[at..].find('\n').unwrap();
        let mut cells: Vec<String> = text[at..end].split(' ').map(str::to_owned).collect();
        let digits: i64 = cells[column].replace('.', "").parse().unwrap();
        let changed = format!("{:05}", digits + units);
        let point = changed.len() - 3;
        cells[column] = format!("{}.{}", &changed[..point], &changed[point..]);
        (format!("{}{}{}", &text[..at], cells.join(" "), &text[end..]), cells[column].clone())
    }

    #[test]
    fn ten_changed_cells_are_found_and_no_other_is_blamed() {
        let template: PrintedFile = from_yaml(TEMPLATE).unwrap();
        let names: Vec<&String> = template.tables.keys().collect();
        for seed in 0..5 {
            let mut random = fastrand::Rng::with_seed(seed);
            let mut text = filled_template(3);
            assert_eq!(judged(&text).unwrap().wrong, []);
            assert_eq!(judged(&text).unwrap().agree, 16 * (14 + 14 + 22 + 22));
            let mut changed = std::collections::BTreeSet::new();
            while changed.len() < 10 {
                let table = names[random.usize(..names.len())];
                let points: Vec<&str> = template.tables[table]["points"].split(' ').collect();
                let (column, sky) = (random.usize(..points.len()), format!("sky-{}", random.u32(1..=16)));
                if changed.insert((table.clone(), sky.clone(), points[column].to_owned())) {
                    text = change(&text, table, &sky, column, if random.bool() { 3 } else { -3 }).0;
                }
            }
            let found = judged(&text).unwrap().wrong;
            let found = found.into_iter().map(|cell| (cell.table, cell.sky, cell.point)).collect();
            assert_eq!(changed, found, "seed {seed}");
        }
    }

    #[test]
    fn a_row_of_another_sky_and_a_reversed_row_are_recognised() {
        let text = filled_template(2);
        let table = text.split("  facade-4x3m-floor:\n").nth(1).unwrap();
        let row = |sky: &str| table.lines().find(|l| l.contains(&format!("{sky}:"))).unwrap().to_owned();
        let (right, other) = (row("sky-14"), row("sky-15"));
        let found = judged(&text.replace(&right, &other.replace("sky-15", "sky-14"))).unwrap().wrong;
        assert!(found.len() >= 3 && found.iter().all(|cell| cell.contradicted_by.ends_with("of sky-15")), "{found:?}");
        let cells: Vec<&str> = right.split_once(": ").unwrap().1.split(' ').rev().collect();
        let found = judged(&text.replace(&right, &format!("    sky-14: {}", cells.join(" ")))).unwrap().wrong;
        assert!(found.iter().all(|cell| cell.contradicted_by.contains("in reverse")), "{found:?}");
    }

    #[test]
    fn bad_input_is_refused_with_its_place() {
        let right = filled_template(2);
        let one_left = |text: &str| text.replacen("    sky-3: ", "    sky-3: _ ", 1);
        for (text, says) in [
            (TEMPLATE.to_owned(), "no cell is filled in"),
            (one_left(&right), "7 cells for the 6 points A B C D E F"),
            (right.replacen("    sky-3: ", "    sky-33: ", 1), "no such row"),
            (right.replacen("  roof-1m-wall:", "  roof-2m-wall:", 1), "no such table"),
            (right.replacen("points: A B C", "points: A C B", 1), "those of the template"),
            (right.replacen("luxproof_printed: 1", "luxproof_printed: 2", 1), "version 2 is not known"),
            (right.replacen("    sky-3: ", "    sky-3: about", 1), "is no printed number"),
            (
                right.replacen("    sky-3: 2", "    sky-3: -2", 1).replacen("    sky-3: 0", "    sky-3: -0", 1),
                "no printed number",
            ),
        ] {
            let error = judged(&text).unwrap_err().to_string();
            assert!(error.contains(says) && error.contains("copy.yaml"), "{says}: {error}");
        }
        let start = right.find("    sky-3:").unwrap();
        let end = start + right[start..].find('\n').unwrap() + 1;
        let error = judged(&format!("{}{}", &right[..start], &right[end..])).unwrap_err().to_string();
        assert!(error.contains("the row `sky-3` is missing"), "{error}");
    }
}
