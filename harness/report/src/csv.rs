//! CSV (RFC 4180): one line for each comparison, with all digits, for spreadsheets and statistics.

use luxproof_model::Report;
use luxproof_model::{Basis, Comparison};
use luxproof_process::printable::csv as inert;

pub fn csv(report: &Report) -> String {
    let mut writer = csv::Writer::from_writer(vec![]);
    // Writing to memory does not fail on any report, and a file without lines would be noticed at once.
    writer.write_record(COLUMNS.map(|(name, _)| name)).ok();
    for c in &report.comparisons {
        writer.write_record(COLUMNS.map(|(_, content)| inert(content(c)))).ok();
    }
    writer.into_inner().ok().and_then(|bytes| String::from_utf8(bytes).ok()).unwrap_or_default()
}

/// A column: its name and its content.
type Column = (&'static str, fn(&Comparison) -> String);

const COLUMNS: [Column; 25] = [
    ("case", |c| c.key.case.clone()),
    ("procedure", |c| c.key.procedure.to_string()),
    ("engine", |c| c.key.engine.to_string()),
    ("model", |c| c.model.clone()),
    ("meter", |c| c.meter.0.clone()),
    ("x_m", |c| c.at_m[0].to_string()),
    ("y_m", |c| c.at_m[1].to_string()),
    ("z_m", |c| c.at_m[2].to_string()),
    ("normal_x", |c| c.normal[0].to_string()),
    ("normal_y", |c| c.normal[1].to_string()),
    ("normal_z", |c| c.normal[2].to_string()),
    ("gamma_deg", |c| number(c.gamma_deg)),
    ("c_deg", |c| number(c.c_deg)),
    ("quantity", |c| c.quantity.unit().to_owned()),
    ("value", |c| number(c.value)),
    ("std_error", |c| number(c.uncertainty.standard_error())),
    ("reference", |c| number(c.reference.as_ref().map(|r| r.value))),
    ("reference_uncertainty", |c| number(c.reference.as_ref().map(|r| r.uncertainty))),
    ("basis", |c| c.basis().map_or("", Basis::name).to_owned()),
    ("source", |c| c.reference.as_ref().map_or("", |r| r.source.as_str()).to_owned()),
    ("deviation", |c| number(c.deviation)),
    ("relative_deviation", |c| number(c.relative_deviation)),
    ("allowed", |c| number(c.reference.as_ref().map(|_| c.allowed()))),
    ("verdict", |c| c.verdict.name().to_owned()),
    ("diagnosis", |c| c.diagnosis.clone().unwrap_or_default()),
];

fn number(value: Option<f64>) -> String {
    value.map(|v| v.to_string()).unwrap_or_default()
}
