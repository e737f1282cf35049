//! Keeps the computed tables of reference/cachet.md equal to what the program computes.

// A test may panic.
#![allow(clippy::unwrap_used, dead_code)]

use std::path::Path;

#[path = "../reference/cachet_audit.rs"]
mod cachet_audit;

#[test]
fn the_document_holds_what_the_program_computes() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../reference/cachet.md");
    let document = std::fs::read_to_string(path).unwrap();
    let report = cachet_audit::report().unwrap();
    let tables: Vec<&str> = report.trim_end().split("\n\n").collect();
    assert_eq!(tables.len(), 4);
    for table in tables {
        assert!(document.contains(table), "reference/cachet.md lacks:\n{table}");
    }
}
