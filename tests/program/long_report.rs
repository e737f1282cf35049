//! Reports of more comparisons than a page shows: what lies beside report.json and report.html, and what becomes of it.

use std::collections::BTreeSet;
use std::fs;

use serde_json::Value;

use crate::support::{Folder, LAMP};

const SPEC: &str = "luxproof: 1
room: {size_m: [50, 20, 5], reflectance: {floor: 0.2, walls: 0.5, ceiling: 0.7}}
luminaires:
  - {id: lamp, photometry: lamp.ies, at_m: [24.3, 9.1, 4.5]}
meters:
  plane: {grid: {origin_m: [0.05, 0.05, 0.8], u_m: [0.45, 0, 0], v_m: [0, 0.19, 0], counts: [110, 100]}, normal: [0, 0, 1]}
procedures:
  direct_illuminance: {meters: plane}
";

#[test]
fn every_comparison_is_on_a_page_and_in_a_line_until_a_shorter_report_takes_their_place() {
    let folder = Folder::new(&[("lamp.ies", LAMP), ("spec.yaml", SPEC)]);
    let run = ["run", "spec.yaml", "--engines", "simulator,iesna", "--no-calibration", "--out", "out"];
    folder.luxproof(&run).exits(0);
    // Links are within the folder, wherever it lies.
    fs::rename(folder.path("out"), folder.path("moved")).unwrap();
    let report: Value = serde_json::from_str(&folder.read("moved/report.json")).unwrap();
    let comparisons = report["comparisons"].as_array().unwrap();
    assert_eq!(comparisons.len(), 11_000);
    let lines = folder.read("moved/comparisons.jsonl");
    let (head, lines) = lines.split_once('\n').unwrap();
    let head: Value = serde_json::from_str(head).unwrap();
    assert_eq!((&head["report"], &head["comparisons"]), (&report["checksum"], &11_000.into()));
    let lines: Vec<Value> = lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert!(lines == *comparisons, "the lines say what report.json says");

    let page = folder.read("moved/report.html");
    let linked: BTreeSet<&str> =
        page.split("href=\"report-pages/").skip(1).filter_map(|l| l.split(['"', '#']).next()).collect();
    let pages: Vec<String> = linked.iter().map(|name| folder.read(&format!("moved/report-pages/{name}"))).collect();
    let numbers: Vec<usize> = pages
        .iter()
        .flat_map(|p| p.split("<tr id=\"r").skip(1))
        .map(|row| row.split('"').next().unwrap().parse().unwrap())
        .collect();
    assert_eq!(numbers, (1..=11_000).collect::<Vec<_>>(), "every comparison once, in its order");

    // The same views of what was read back.
    fs::remove_dir_all(folder.path("moved/report-pages")).unwrap();
    let again = folder.luxproof(&["report", "moved", "--format", "html"]).exits(0);
    assert_eq!(again.stdout.trim_end(), page.trim_end());
    assert_eq!(fs::read_dir(folder.path("moved/report-pages")).unwrap().count(), 1);

    fs::rename(folder.path("moved"), folder.path("out")).unwrap();
    folder.edit("spec.yaml", "[110, 100]", "[11, 10]");
    folder.luxproof(&run).exits(0);
    for gone in ["out/report-pages", "out/comparisons.jsonl"] {
        assert!(!folder.path(gone).exists(), "{gone}");
    }
    assert!(!folder.read("out/report.html").contains("report-pages"));
}
