//! Lints and refusals as a SARIF 2.1.0 log (OASIS), which code-review tools show at the line.

use std::collections::BTreeSet;
use std::path::Path;

use luxproof_photometry::Severity;
use luxproof_spec::SpecError;
use miette::Report as Diagnostic;
use serde_json::{Value, json};

use super::Reading;

/// The log of all files.
pub(super) fn format_log(readings: &[Reading]) -> Result<String, Diagnostic> {
    let results: Vec<Value> = readings.iter().flat_map(reading_results).collect();
    let rules: BTreeSet<&str> = results.iter().filter_map(|result| result["ruleId"].as_str()).collect();
    let rules: Vec<Value> = rules.iter().map(|id| json!({"id": id})).collect();
    let driver = json!({"name": "luxproof photometry", "version": env!("CARGO_PKG_VERSION"), "rules": rules});
    let log = json!({
        "$schema": "https://json.schemastore.org/sarif-2.1.0.json",
        "version": "2.1.0",
        "runs": [{"tool": {"driver": driver}, "results": results}],
    });
    luxproof_console::json(&log)
}

/// The results of one file: its lints, or its refusal.
fn reading_results(reading: &Reading) -> Vec<Value> {
    match &reading.result {
        Ok(photometry) => {
            let mut results = vec![];
            for lint in &photometry.lints {
                let level = if lint.severity == Severity::Warning { "warning" } else { "note" };
                results.push(result(lint.code, level, &lint.message, &reading.file, lint.line, 0));
            }
            results
        }
        Err(error) => {
            let SpecError { line, column, message, help, .. } = error;
            let message = format!("{message}; {}", help.as_deref().unwrap_or_default());
            vec![result("refused", "error", &message, &reading.file, line.unwrap_or(0), column.unwrap_or(0))]
        }
    }
}

/// One result. Lines and columns count from 1; 0 is none.
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
