//! Prints the computed tables of reference/cachet.md: `cargo run --release --example cachet_audit`.
//!
//! A test keeps the document equal to what this prints.

use std::fmt::Write;
use std::path::Path;
use std::sync::Arc;

use glam::DVec3;
use luxproof_calculators::exitance_difference::{self, Layers};
use luxproof_calculators::{inverse_square, uniform_surfaces};
use luxproof_photometry::read_file;
use luxproof_photometry::units::Lux;
use luxproof_scene::geometry::{Reflectances, Room};
use luxproof_scene::{Bounces, Luminaire, LuminaireModel, Meter, Scene, Transport, orientation};
use luxproof_simulator::Accuracy;

/// What can go wrong: files and scenes.
type Failure = Box<dyn std::error::Error>;

fn main() -> Result<(), Failure> {
    print!("{}", report()?);
    Ok(())
}

/// All computed tables, in the document's order.
pub(crate) fn report() -> Result<String, Failure> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../reference");
    let rows = published(&std::fs::read_to_string(folder.join("published/cachet.yaml"))?)?;
    let photometry = read_file(&folder.join("luminaires/cachet-reconstructed.ies"))?;
    let room = Room { size_m: DVec3::splat(20.0), reflectance: Reflectances::with_equal_walls(0.2, 0.5, 0.8) };
    let luminaire = Luminaire {
        id: "cachet".into(),
        photometry: Arc::new(photometry),
        position_m: DVec3::splat(10.0),
        orientation: orientation(0.0, 0.0, 0.0),
        flux_scale: 1.0,
        model: LuminaireModel::Point,
    };
    let scene = Scene { room: Some(room), obstacles: vec![], luminaires: vec![luminaire] };
    let mut text = String::new();
    claims(&mut text, &rows)?;
    direct(&mut text, &rows, &scene)?;
    indirect(&mut text, &rows, &scene)?;
    needed_flux(&mut text, &rows, &scene)?;
    Ok(text)
}

/// A printed cell and half the width of its interval: one unit of its last digit.
#[derive(Clone)]
struct Cell {
    printed: String,
    value: f64,
    unit: f64,
}

/// One row of a published table.
struct Row {
    table: String,
    place: String,
    position_m: Option<DVec3>,
    cells: Vec<(String, Cell)>,
}

impl Row {
    fn cell(&self, column: &str) -> Result<&Cell, Failure> {
        let found = self.cells.iter().find(|(name, _)| name == column);
        Ok(&found.ok_or_else(|| format!("{} {} has no column {column}", self.table, self.place))?.1)
    }
}

/// The rows of the published tables; the file writes one a line.
fn published(text: &str) -> Result<Vec<Row>, Failure> {
    let mut rows = vec![];
    let mut table = String::new();
    for line in text.lines().map(str::trim) {
        if let Some(name) = line.strip_prefix("name: ") {
            table = name.into();
        }
        let Some((place, cells)) = line.strip_prefix("- {").and_then(|row| row.split_once(", cells: {")) else {
            continue;
        };
        let cells = cells.split('}').next().unwrap_or_default().split(", ").map(|cell| {
            let (name, printed) = cell.split_once(": ").ok_or("a cell without a value")?;
            let printed = printed.trim_matches('"');
            let decimals = printed.split_once('.').map_or(0, |(_, fraction)| fraction.len());
            let unit = 10f64.powi(-i32::try_from(decimals)?);
            Ok((name.to_owned(), Cell { printed: printed.into(), value: printed.parse()?, unit }))
        });
        let at = place.split_once("at_m: [").and_then(|(_, rest)| rest.split_once(']'));
        let position_m = match at {
            Some((numbers, _)) => {
                let numbers: Result<Vec<f64>, _> = numbers.split(", ").map(str::parse).collect();
                Some(DVec3::from_slice(&numbers?))
            }
            None => None,
        };
        let place = position_m.map_or_else(
            || place.split(',').next().unwrap_or_default().replace("gamma_deg: ", "gamma "),
            |p| format!("({}, {}, {})", p.x, p.y, p.z),
        );
        rows.push(Row { table: table.clone(), place, position_m, cells: cells.collect::<Result<_, Failure>>()? });
    }
    Ok(rows)
}

/// The claims of the paper's text that its own tables can be held against, in percent.
const CLAIMS: [(&str, &str, &str, f64, f64, &str); 5] = [
    ("Table 1", "lum2", "ies_file", -3.0, 3.0, "at most 3 %"),
    ("Table 2", "lum1", "inverse_square", -1.0, 1.0, "below 1 %"),
    ("Table 2", "lum2", "inverse_square", -1.0, 1.0, "below 1 %"),
    ("Table 3", "lum1", "ip_ed", -12.0, -7.0, "7 to 12 % lower"),
    ("Table 3", "lum2", "ip_ed", -12.0, -7.0, "7 to 12 % lower"),
];

/// Each claim against each cell, with what rounding leaves open.
fn claims(text: &mut String, rows: &[Row]) -> Result<(), Failure> {
    writeln!(text, "| table, column | place | printed | against | deviation | within rounding | claim | verdict |")?;
    writeln!(text, "|---|---|---|---|---|---|---|---|")?;
    for (table, column, against, low, high, claim) in CLAIMS {
        for row in rows.iter().filter(|row| row.table == table) {
            let (cell, reference) = (row.cell(column)?, row.cell(against)?);
            let percent = |a: f64, b: f64| 100.0 * (a / b - 1.0);
            let least = percent(cell.value - cell.unit, reference.value + reference.unit);
            let most = percent(cell.value + cell.unit, reference.value - reference.unit);
            let verdict = if least >= low && most <= high {
                "holds"
            } else if most < low || least > high {
                "fails"
            } else {
                "open: rounding decides"
            };
            writeln!(
                text,
                "| {table}, {column} | {} | {} | {} | {:+.2} % | {least:+.2} .. {most:+.2} % | {claim} | {verdict} |",
                row.place,
                cell.printed,
                reference.printed,
                percent(cell.value, reference.value)
            )?;
        }
    }
    writeln!(text)?;
    Ok(())
}

fn meter(row: &Row, normal: DVec3) -> Result<Meter, Failure> {
    let position_m = row.position_m.ok_or("a row without a place")?;
    Ok(Meter { position_m, normal })
}

/// Table 2 beside the inverse-square method on our luminaire.
fn direct(text: &mut String, rows: &[Row], scene: &Scene) -> Result<(), Failure> {
    writeln!(text, "| direct, lx | paper: inverse square | lum1 | lum2 | ours: inverse square |")?;
    writeln!(text, "|---|---|---|---|---|")?;
    for row in rows.iter().filter(|row| row.table == "Table 2") {
        let ours = inverse_square::direct_illuminance(scene, &meter(row, DVec3::NEG_Z)?)?.illuminance.value();
        let (square, lum1, lum2) = (row.cell("inverse_square")?, row.cell("lum1")?, row.cell("lum2")?);
        writeln!(text, "| {} | {} | {} | {} | {ours:.4} |", row.place, square.printed, lum1.printed, lum2.printed)?;
    }
    writeln!(text)?;
    Ok(())
}

/// Table 3 beside IP-ED, its twin of uniform surfaces and the exact solution on our luminaire.
fn indirect(text: &mut String, rows: &[Row], scene: &Scene) -> Result<(), Failure> {
    let rows: Vec<&Row> = rows.iter().filter(|row| row.table == "Table 3").collect();
    let meters = rows.iter().map(|row| meter(row, DVec3::Z)).collect::<Result<Vec<_>, _>>()?;
    let accuracy = Accuracy { relative_error: 1e-5, seed: 1 };
    let solve = |bounces| luxproof_simulator::illuminance(scene, &meters, Transport::Indirect(bounces), &accuracy);
    let (seven, all) = (solve(Bounces::AtMost(7))?, solve(Bounces::Converged)?);
    let twin = uniform_surfaces::solve(scene)?;
    writeln!(
        text,
        "| indirect, lx | paper: IP-ED | lum1 | lum2 | ours: IP-ED | uniform surfaces | exact, 7 bounces | exact | \
         IP-ED over exact |"
    )?;
    writeln!(text, "|---|---|---|---|---|---|---|---|---|")?;
    for (k, row) in rows.iter().enumerate() {
        let ours = exitance_difference::indirect_illuminance(scene, &meters[k])?.illuminance;
        let uniform = twin.indirect_illuminance(&meters[k]).value();
        let (seven, all) = (seven.estimates[k].illuminance, all.estimates[k].illuminance);
        writeln!(
            text,
            "| {} | {} | {} | {} | {:.3} | {uniform:.3} | {:.3} | {:.3} | {:+.1} % |",
            row.place,
            row.cell("ip_ed")?.printed,
            row.cell("lum1")?.printed,
            row.cell("lum2")?.printed,
            ours.value(),
            seven.value(),
            all.value(),
            100.0 * (ours / all - 1.0)
        )?;
    }
    writeln!(text)?;
    Ok(())
}

/// The flux with which IP-ED prints each cell of the paper's own column: IP-ED is linear in upward flux alone.
fn needed_flux(text: &mut String, rows: &[Row], scene: &Scene) -> Result<(), Failure> {
    let flux: f64 = Layers::of(scene)?.exitances(2.0)?.iter().map(|layer| layer.flux.value()).sum();
    writeln!(text, "| IP-ED, lx | printed | flux that gives it, lm | within rounding, lm |")?;
    writeln!(text, "|---|---|---|---|")?;
    for row in rows.iter().filter(|row| row.table == "Table 3") {
        let ours: Lux = exitance_difference::indirect_illuminance(scene, &meter(row, DVec3::Z)?)?.illuminance;
        let cell = row.cell("ip_ed")?;
        let needed = |lux: f64| flux * lux / ours.value();
        writeln!(
            text,
            "| {} | {} | {:.0} | {:.0} .. {:.0} |",
            row.place,
            cell.printed,
            needed(cell.value),
            needed(cell.value - cell.unit),
            needed(cell.value + cell.unit)
        )?;
    }
    Ok(())
}
