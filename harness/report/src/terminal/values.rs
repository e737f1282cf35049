//! Tables of values: single points of small sets, and the figures of large sets.

use std::ops::Range;

use itertools::Itertools;

use super::screen::{Screen, Style, draw_table};
use crate::notes::{LISTED_METERS, agreement, large_sets};
use crate::words::{estimate, estimate_with_unit, plural, trimmed, value, value_with_unit, wrapped};
use luxproof_model::{Estimate, MeterId, ProcedureId, Quantity, ReadingRecord, Report, Statistics};

/// Draws the values of a procedure: its points where they are few, else the figures of its sets.
pub(super) fn value_tables(report: &Report, procedure: ProcedureId, screen: Screen) -> Vec<String> {
    let tables = [readings_table(report, procedure, screen), set_tables(report, procedure, screen)];
    tables.into_iter().flatten().collect()
}

/// Draws a table of values, with units where they fit the screen and with the unit in its head otherwise.
fn draw_values(screen: Screen, engines: usize, draw: impl Fn(Range<usize>, Style, bool) -> String) -> String {
    let has_units = screen.has_room_for(&draw(0..engines, Style::Plain, true));
    screen.draw_in_blocks(engines, |range, style| draw(range, style, has_units))
}

/// A figure of a set of points: its name, and its value.
struct Figure {
    name: &'static str,
    has_unit: bool,
    of: fn(&Statistics) -> Option<Estimate>,
}

const FIGURES: [Figure; 5] = [
    Figure { name: "mean", has_unit: true, of: |s| Some(s.mean) },
    Figure { name: "minimum", has_unit: true, of: |s| Some(s.minimum) },
    Figure { name: "uniformity", has_unit: false, of: |s| s.uniformity },
    Figure { name: "maximum", has_unit: true, of: |s| s.maximum },
    Figure { name: "diversity", has_unit: false, of: |s| s.diversity },
];
/// Decimals of a coordinate in metres.
const COORDINATE_DECIMALS: usize = 4;
/// How many figures a brief report shows.
const BRIEF_FIGURES: usize = 3;

/// Draws the figures of large sets of points, engines side by side; `None` where there is no large set.
fn set_tables(report: &Report, procedure: ProcedureId, screen: Screen) -> Option<String> {
    let statistics: Vec<&Statistics> = large_sets(report, procedure).collect();
    let sets = statistics.iter().map(|s| (s.set.as_str(), s.meters)).unique().collect_vec();
    let engines = report.engines.iter().map(|e| e.id.as_str());
    let engines = engines.filter(|id| statistics.iter().any(|s| s.key.engine == **id)).collect_vec();
    let mut tables = vec![];
    for (set, meters) in sets {
        let of_set: Vec<&Statistics> = statistics.iter().copied().filter(|s| s.set == set).collect();
        let title = format!("{procedure}, {set} ({meters} points)");
        let draw = |title: &str, range: Range<usize>, style: Style, has_units: bool| {
            draw_figures(title, procedure.quantity(), &of_set, &engines[range], (screen, style, has_units))
        };
        let is_below_title = screen.has_room_for(&draw(&title, 0..engines.len(), Style::Plain, false));
        let table = if is_below_title {
            draw_values(screen, engines.len(), |range, style, has_units| draw(&title, range, style, has_units))
        } else {
            let below = draw_values(screen, engines.len(), |range, style, has_units| draw("", range, style, has_units));
            format!(" {}\n{below}", wrapped(&title, screen.width() - 1, "  "))
        };
        let agreements = of_set.iter().filter(|_| screen.is_full()).filter_map(|s| agreement(s));
        let agreements = agreements.map(|line| format!("\n   {}", wrapped(&line, screen.width() - 3, "       ")));
        tables.push(table + &agreements.collect::<String>());
    }
    (!tables.is_empty()).then(|| tables.join("\n"))
}

/// Draws the figures of one set for some of the engines.
fn draw_figures(
    title: &str,
    quantity: Quantity,
    of_set: &[&Statistics],
    engines: &[&str],
    (screen, style, has_units): (Screen, Style, bool),
) -> String {
    let figures = if screen.is_full() { FIGURES.len() } else { BRIEF_FIGURES };
    let mut rows = vec![];
    for figure in &FIGURES[..figures] {
        let unit = if figure.has_unit { quantity.unit() } else { "" };
        let mut row = vec![format!("  {}{}", figure.name, unit_in_head(unit, has_units))];
        for engine in engines {
            let value = of_set.iter().find(|s| s.key.engine == **engine).and_then(|s| (figure.of)(s));
            let text = value.map_or("-".to_owned(), |value| {
                if has_units { estimate_with_unit(&value, unit) } else { estimate(&value) }
            });
            row.push(screen.spell(&text));
        }
        rows.push(row);
    }
    let heads = std::iter::once(title).chain(engines.iter().copied());
    draw_table(heads, rows, 1..usize::MAX, style)
}

/// The unit behind a name where the values do not show it.
fn unit_in_head(unit: &str, has_units: bool) -> String {
    if has_units || unit.is_empty() { String::new() } else { format!(" [{unit}]") }
}

/// Draws the values at the points of a procedure's small sets, engines side by side; `None` where there are none.
///
/// A brief report lists only so many of them, and says how many more there are.
fn readings_table(report: &Report, procedure: ProcedureId, screen: Screen) -> Option<String> {
    let records: Vec<&ReadingRecord> = report.readings.iter().filter(|r| r.key.procedure == procedure).collect();
    let unit = records.first()?.reading.quantity.unit();
    let all: Vec<&MeterId> = records.iter().map(|r| &r.reading.meter).unique().collect();
    let sizes = all.iter().counts_by(|meter| meter.set_name());
    let mut meters = all;
    meters.retain(|meter| sizes.get(meter.set_name()).is_some_and(|size| *size <= LISTED_METERS));
    let omitted = if screen.is_full() { 0 } else { meters.len().saturating_sub(LISTED_METERS) };
    meters.truncate(meters.len() - omitted);
    if meters.is_empty() {
        return None;
    }
    let engines: Vec<&str> =
        report.engines.iter().map(|e| e.id.as_str()).filter(|e| records.iter().any(|r| r.key.engine == *e)).collect();
    Some(draw_values(screen, engines.len(), |range, style, has_units| {
        let shown = &engines[range];
        let mut rows: Vec<Vec<String>> = vec![];
        for meter in &meters {
            let mut row = vec![place(report, procedure, &meter.0, screen)];
            row.extend(shown.iter().map(|engine| screen.spell(&reading_cell(&records, meter, engine, has_units))));
            rows.push(row);
        }
        if omitted > 0 {
            rows.push(vec![format!("  {} more: --all", plural(omitted, "point"))]);
        }
        let title = format!("{procedure}{}", unit_in_head(unit, has_units));
        draw_table(std::iter::once(title.as_str()).chain(shown.iter().copied()), rows, 1..usize::MAX, style)
    }))
}

/// The value of an engine at a point; `-` where there is none.
fn reading_cell(records: &[&ReadingRecord], meter: &MeterId, engine: &str, has_units: bool) -> String {
    let record = records.iter().find(|r| r.reading.meter == *meter && r.key.engine == *engine);
    record.map_or("-".to_owned(), |r| if has_units { value_with_unit(&r.reading) } else { value(&r.reading) })
}

/// A point's direction, or its name and coordinates.
fn place(report: &Report, procedure: ProcedureId, meter: &str, screen: Screen) -> String {
    let comparison = report.comparisons.iter().find(|c| c.key.procedure == procedure && c.meter.0 == meter);
    if let Some((gamma, plane)) = comparison.and_then(|c| c.gamma_deg.zip(c.c_deg)) {
        return format!("  C {plane} gamma {gamma}");
    }
    let name = screen.abridge_name(meter);
    comparison.map_or(format!("  {name}"), |c| {
        let [x, y, z] = c.at_m.map(|length_m| trimmed(length_m, COORDINATE_DECIMALS));
        format!("  {name} ({x}, {y}, {z})")
    })
}
