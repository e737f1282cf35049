//! CSV: one line a comparison, all digits, for spreadsheets and statistics.

use super::Report;
use crate::judge::Comparison;

const HEAD: [&str; 25] = [
    "case",
    "procedure",
    "engine",
    "model",
    "meter",
    "x_m",
    "y_m",
    "z_m",
    "normal_x",
    "normal_y",
    "normal_z",
    "gamma_deg",
    "c_deg",
    "quantity",
    "value",
    "std_error",
    "reference",
    "reference_uncertainty",
    "basis",
    "source",
    "deviation",
    "relative_deviation",
    "allowed",
    "verdict",
    "diagnosis",
];

/// The comparisons as CSV (RFC 4180).
pub fn csv(report: &Report) -> String {
    let mut writer = csv::Writer::from_writer(vec![]);
    // Writing to memory fails on no condition that a report can meet; a file without lines would be noticed at once.
    writer.write_record(HEAD).ok();
    for c in &report.comparisons {
        writer.write_record(record(c)).ok();
    }
    writer.into_inner().ok().and_then(|bytes| String::from_utf8(bytes).ok()).unwrap_or_default()
}

fn record(c: &Comparison) -> [String; 25] {
    let number = |v: Option<f64>| v.map(|v| v.to_string()).unwrap_or_default();
    let reference = c.reference.as_ref();
    [
        c.key.case.clone(),
        c.key.procedure.to_string(),
        c.key.engine.to_string(),
        c.model.clone(),
        c.meter.0.clone(),
        c.at_m[0].to_string(),
        c.at_m[1].to_string(),
        c.at_m[2].to_string(),
        c.normal[0].to_string(),
        c.normal[1].to_string(),
        c.normal[2].to_string(),
        number(c.gamma_deg),
        number(c.c_deg),
        c.quantity.unit().to_owned(),
        number(c.value),
        number(c.uncertainty.standard_error()),
        number(reference.map(|r| r.value)),
        number(reference.map(|r| r.uncertainty)),
        reference.map_or("", |r| r.basis.name()).to_owned(),
        reference.map_or("", |r| r.source.as_str()).to_owned(),
        number(c.deviation),
        number(c.relative_deviation),
        number(reference.map(|r| c.tolerance.around(r.value))),
        c.verdict.name().to_owned(),
        c.diagnosis.clone().unwrap_or_default(),
    ]
}
