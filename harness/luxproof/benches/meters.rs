//! How long direct light of many meters takes our own solvers from spec to report, and what reads such a report: all in proportion to the meters.
//!
//! `cargo bench -p luxproof --bench meters`

#![allow(clippy::unwrap_used, missing_docs, reason = "a benchmark that cannot go on has failed")]

use std::fs;
use std::path::Path;

use divan::Bencher;
use luxproof_audit::plan::Selection;
use luxproof_audit::{Calibration, Options};
use luxproof_engines::EngineRoot;
use luxproof_model::Report;
use luxproof_report::{Detail, Letters, Screen, Style, csv, markdown, terminal};
use luxproof_trend::baseline::{Baseline, References, compare};

/// Meters along the two sides of a grid.
const GRIDS: [[usize; 2]; 3] = [[50, 20], [158, 63], [500, 200]];

const LAMP: &str = "IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 3 1 1 2 0 0 0\n1 1 0\n0 60 90\n0\n100 80 0\n";

fn main() {
    divan::main();
}

fn audited(folder: &Path, [nu, nv]: [usize; 2]) -> Report {
    let (du, dv) = (49.9 / nu as f64, 19.9 / nv as f64);
    let spec = format!(
        "luxproof: 1
room: {{size_m: [50, 20, 5], reflectance: {{floor: 0.2, walls: 0.5, ceiling: 0.7}}}}
luminaires:
  - {{id: lamp, photometry: lamp.ies, at_m: [24.3, 9.1, 4.5]}}
meters:
  plane: {{grid: {{origin_m: [0.05, 0.05, 0.8], u_m: [{du}, 0, 0], v_m: [0, {dv}, 0], counts: [{nu}, {nv}]}}, normal: [0, 0, 1]}}
procedures:
  direct_illuminance: {{meters: plane}}
"
    );
    fs::write(folder.join("lamp.ies"), LAMP).unwrap();
    fs::write(folder.join("spec.yaml"), spec).unwrap();
    let own = Selection { engines: vec!["simulator".into(), "iesna".into()], seed: 1, ..Selection::default() };
    let options = Options {
        selection: own,
        calibration: Calibration::LeftOut,
        ..Options::new(EngineRoot::of_user().unwrap(), folder.join("out"))
    };
    luxproof_audit::run(&[folder.join("spec.yaml")], &options).unwrap()
}

#[divan::bench(args = GRIDS, sample_count = 3, sample_size = 1)]
fn spec_to_report(bencher: Bencher, grid: [usize; 2]) {
    let folder = tempfile::tempdir().unwrap();
    bencher.bench(|| audited(folder.path(), grid));
}

#[divan::bench(args = GRIDS, sample_count = 3, sample_size = 1)]
fn views(bencher: Bencher, grid: [usize; 2]) {
    let folder = tempfile::tempdir().unwrap();
    let report = audited(folder.path(), grid);
    bencher.bench(|| {
        (
            terminal(&report, Screen::new(Style::Plain, Detail::All, Letters::Unicode, None), None),
            markdown(&report, None),
            csv(&report),
        )
    });
}

#[divan::bench(args = GRIDS, sample_count = 3, sample_size = 1)]
fn what_changed_between_two_runs(bencher: Bencher, grid: [usize; 2]) {
    let folder = tempfile::tempdir().unwrap();
    let run = Baseline::candidate(&audited(folder.path(), grid));
    bencher.bench(|| compare(&run.entries, &run.entries, &References::default()));
}
