//! Lints and refusals as a SARIF 2.1.0 log (OASIS), which code-review tools show beside the line.

use std::collections::BTreeSet;
use std::path::Path;

use luminaire::photometry::Severity;
use miette::Report as Diagnostic;
use serde_json::{Value, json};

use super::Reading;

pub(super) fn log(readings: &[Reading]) -> Result<String, Diagnostic> {
    let results: Vec<Value> = readings.iter().flat_map(results).collect();
    let rules: BTreeSet<&str> = results.iter().filter_map(|result| result["ruleId"].as_str()).collect();
    let rules: Vec<Value> = rules.iter().map(|id| json!({"id": id})).collect();
    let driver = json!({"name": "luxproof photometry", "version": env!("CARGO_PKG_VERSION"), "rules": rules});
    let log = json!({
        "$schema": "https://json.schemastore.org/sarif-2.1.0.json",
        "version": "2.1.0",
        "runs": [{"tool": {"driver": driver}, "results": results}],
    });
    crate::cli::json(&log)
}

fn results(reading: &Reading) -> Vec<Value> {
    match &reading.read {
        Ok(photometry) => {
            let level = |severity| if severity == Severity::Warning { "warning" } else { "note" };
            let lints = photometry.lints.iter();
            lints.map(|l| result(l.code, level(l.severity), &l.message, &reading.file, l.line, 0)).collect()
        }
        Err(error) => {
            let message = format!("{}; {}", error.message(), error.help());
            vec![result("refused", "error", &message, &reading.file, error.line, error.column)]
        }
    }
}

/// One result; lines and columns count from 1, and 0 means none.
fn result(rule: &str, level: &str, message: &str, file: &Path, line: usize, column: usize) -> Value {
    let uri = file.display().to_string().replace('\\', "/").replace(' ', "%20");
    let mut location = json!({"artifactLocation": {"uri": uri}});
    if line > 0 {
        location["region"] = json!({"startLine": line});
        if column > 0 {
            location["region"]["startColumn"] = json!(column);
        }
    }
    json!({"ruleId": rule, "level": level, "message": {"text": message}, "locations": [{"physicalLocation": location}]})
}
