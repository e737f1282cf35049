//! A body from a Wavefront file in a whole run: it reads what the same body reads as a `box:`, by other solvers.

#![allow(clippy::unwrap_used, missing_docs, reason = "a test that cannot go on has failed")]

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::Command;

use serde_json::Value;

const SPEC: &str = "luxproof: 1
room:
  size_m: [6, 4, 3]
  reflectance: {floor: 0.2, walls: 0.5, ceiling: 0.7}
obstacles: [BODY]
luminaires:
  - {id: lamp, photometry: lamp.ies, at_m: [3, 2, 2.5]}
meters:
  desk: {points_m: [[1, 1, 0.8], [4.2, 2, 0.1], [5, 2, 0.5]], normal: [0, 0, 1]}
procedures:
  direct_illuminance: {meters: desk}
  indirect_illuminance: {meters: desk, bounces: converged}
budget: {relative_error: 0.05, seconds: 30}
";

const LAMP: &str = "IESNA:LM-63-2002
TILT=NONE
1 -1 1 3 1 1 2 0 0 0
1 1 0
0 60 90
0
100 80 0
";

/// Four-sided faces and half metres, as drawing programs write them; one face counts its corners from the end.
const CRATE: &str = "# a crate
o crate
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
v 0 0 .5
v 1 0 .5
v 1 1 .5
v 0 1 .5
f 4 3 2 1
f -4 -3 -2 -1
f 1 2 6 5
f 2 3 7 6
f 3 4 8 7
f 4 1 5 8
";

/// 97.5 % quantile of Student's t with the simulator's seven degrees of freedom.
const STUDENT_T: f64 = 2.365;

/// Value in lux and half width of its interval, whether the simulator proves or estimates that.
struct Reading {
    lux: f64,
    within_lux: f64,
    estimated: bool,
}

/// What the simulator reads, by procedure and meter.
fn read(folder: &Path, name: &str, body: &str) -> BTreeMap<String, Reading> {
    let spec = format!("{name}.yaml");
    fs::write(folder.join(&spec), SPEC.replace("BODY", body)).unwrap();
    let mut program = Command::new(env!("CARGO_BIN_EXE_luxproof"));
    program.args(["run", &spec, "--engines", "simulator", "--out", name]).current_dir(folder).env("NO_COLOR", "1");
    program.env("LUXPROOF_ENGINES", folder.join("engines")).env("LUXPROOF_CACHE", folder.join("cache"));
    let output = program.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report = fs::read_to_string(folder.join(name).join("report.json")).unwrap();
    let report: Value = serde_json::from_str(&report).unwrap();
    let readings = report["readings"].as_array().unwrap().iter().filter(|r| r["engine"] == "simulator");
    let named = readings.map(|r| {
        let error = r["std_error"].as_f64();
        let within_lux = error.map_or_else(|| r["error_bound"].as_f64().unwrap(), |e| STUDENT_T * e);
        let reading = Reading { lux: r["value"].as_f64().unwrap(), within_lux, estimated: error.is_some() };
        (format!("{} {}", r["procedure"].as_str().unwrap(), r["meter"].as_str().unwrap()), reading)
    });
    named.collect()
}

#[test]
fn a_crate_from_a_file_reads_what_the_same_box_reads() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("lamp.ies"), LAMP).unwrap();
    fs::write(folder.path().join("crate.obj"), CRATE).unwrap();
    let mesh = read(folder.path(), "mesh", "{mesh: {file: crate.obj, at_m: [3.5, 1.5, 0.4], reflectance: 0.6}}");
    let cuboid =
        read(folder.path(), "cuboid", "{box: {min_m: [3.5, 1.5, 0.4], max_m: [4.5, 2.5, 0.9], reflectance: 0.6}}");
    let empty = read(folder.path(), "empty", "");
    assert_eq!((mesh.len(), cuboid.len(), empty.len()), (6, 6, 6));
    for (name, at) in &mesh {
        let exact = &cuboid[name];
        let reflected = name.starts_with("indirect");
        assert_eq!((at.estimated, exact.estimated), (reflected, false), "{name}");
        let allowed = at.within_lux + exact.within_lux;
        assert!(allowed <= 0.02 * exact.lux + 1e-9, "{name}: {allowed}");
        assert!((at.lux - exact.lux).abs() <= allowed, "{name}: {} for {} within {allowed}", at.lux, exact.lux);
    }
    // Below the crate it is dark, and would not be without it.
    let below = "direct_illuminance desk[1]";
    assert_eq!((mesh[below].lux, mesh[below].lux.is_sign_positive()), (0.0, true));
    assert!(empty[below].lux > 5.0);
    let reflected = "indirect_illuminance desk[1]";
    assert!(empty[reflected].lux > 1.3 * mesh[reflected].lux);
}
