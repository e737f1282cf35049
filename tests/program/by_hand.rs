//! Exported scenes, run by hand: the printed command, typed into a shell, reads case S1 without this program's help.

#![allow(clippy::unwrap_used, missing_docs, reason = "a test that cannot go on has failed")]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

const S1_DIRECT_LX: [f64; 4] = [0.852757462813, 2.230931614869, 2.230931614869, 13.559183673469];
const S1_INDIRECT_LX: [f64; 4] = [0.94314714, 1.15551735, 1.15551735, 1.42062868];

const SPEC: &str = "luxproof: 1
room: {size_m: [20, 20, 20], reflectance: {floor: 0.2, walls: 0.5, ceiling: 0.8}}
luminaires: [{id: axial, photometry: axial.ies, at_m: [10, 10, 10]}]
meters:
  ceiling: {points_m: [[2, 2, 17], [2, 10, 17], [10, 2, 17], [10, 10, 17]], normal: [0, 0, -1]}
  workplane: {points_m: [[2, 2, 2], [2, 10, 2], [10, 2, 2], [10, 10, 2]], normal: [0, 0, 1]}
procedures:
  direct_illuminance: {meters: ceiling}
  indirect_illuminance: {meters: workplane}
engines: {mitsuba: {preset: fast}, radiance: {preset: fast}, povray: {preset: fast}}
";

/// A procedure's folder and what its printed command gives on standard output.
struct ByHand {
    _kept: tempfile::TempDir,
    folder: PathBuf,
    stdout: String,
}

fn by_hand(engine: &str, procedure: &str) -> ByHand {
    let kept = tempfile::tempdir().unwrap();
    let axial = Path::new(env!("CARGO_MANIFEST_DIR")).join("../reference/luminaires/axial.ies");
    fs::copy(axial, kept.path().join("axial.ies")).unwrap();
    fs::write(kept.path().join("spec.yaml"), SPEC).unwrap();
    let export = Command::new(env!("CARGO_BIN_EXE_luxproof"))
        .args(["export", "spec.yaml", "--engine", engine, "--procedures", procedure, "--out", "scenes"])
        .current_dir(kept.path())
        .output()
        .unwrap();
    let printed = String::from_utf8(export.stdout).unwrap();
    let command = printed.lines().find(|l| l.trim_start().starts_with("cd ")).unwrap_or_else(|| panic!("{printed}"));
    let run = Command::new("sh").args(["-c", command]).current_dir(kept.path()).output().unwrap();
    let messages = String::from_utf8_lossy(&run.stderr);
    assert!(run.status.success(), "`{command}`: {messages}; run `luxproof engines install`?");
    let folder = kept.path().join("scenes").join(procedure);
    ByHand { folder, stdout: String::from_utf8(run.stdout).unwrap(), _kept: kept }
}

#[track_caller]
fn agree(found: &[f64], known: &[f64], tolerance: f64) {
    assert_eq!(found.len(), known.len(), "{found:?}");
    for (found, known) in found.iter().zip(known) {
        assert!((found / known - 1.0).abs() < tolerance, "{found} for {known}");
    }
}

fn numbers(text: &str) -> Vec<f64> {
    text.split_whitespace().map(|w| w.parse().unwrap_or_else(|e| panic!("`{w}`: {e}"))).collect()
}

#[test]
fn radiance_prints_the_illuminance_of_each_meter() {
    // rcalc prints six digits.
    agree(&numbers(&by_hand("radiance", "direct_illuminance").stdout), &S1_DIRECT_LX, 2e-6);
    agree(&numbers(&by_hand("radiance", "indirect_illuminance").stdout), &S1_INDIRECT_LX, 0.05);
}

#[test]
fn mitsuba_prints_readings_with_their_standard_errors() {
    for (procedure, known, tolerance) in
        [("direct_illuminance", S1_DIRECT_LX, 1e-5), ("indirect_illuminance", S1_INDIRECT_LX, 0.05)]
    {
        let answer: Value = serde_json::from_str(&by_hand("mitsuba", procedure).stdout).unwrap();
        let readings = answer["readings"].as_array().unwrap();
        agree(&readings.iter().map(|r| r["value"].as_f64().unwrap()).collect::<Vec<_>>(), &known, tolerance);
        assert!(readings.iter().all(|r| r["std_error"].is_number()), "{answer}");
    }
}

/// The scales that a scene tells of, in lux: those of direct light are the last.
fn scales(scene: &str) -> Vec<f64> {
    let block = scene.split("#declare Readout = array").last().unwrap();
    let block = block.split("};").next().unwrap();
    block.split('<').skip(1).map(|c| c.split(',').next().unwrap().parse().unwrap()).collect()
}

#[test]
fn povray_renders_an_image_that_its_scene_tells_how_to_read() {
    let done = by_hand("povray", "direct_illuminance");
    let image = fs::read(done.folder.join("direct.ppm")).unwrap();
    let scale = scales(&fs::read_to_string(done.folder.join("scene.pov")).unwrap());
    // A binary PPM of 16 bits; "With x = E / scale of the meter: red .25 + x/2, green 16 x, blue 256 x".
    let pixels = &image[image.len() - 4 * 6..];
    let red = |k: usize| f64::from(u16::from_be_bytes([pixels[6 * k], pixels[6 * k + 1]])) / 65535.0;
    let found: Vec<f64> = (0..4).map(|k| 2.0 * (red(k) - 0.25) * scale[k]).collect();
    let step = |k: usize| scale[k] / 65535.0 / S1_DIRECT_LX[k];
    let coarsest = (0..4).map(step).fold(0.0, f64::max);
    agree(&found, &S1_DIRECT_LX, 1.1 * coarsest);
    assert!(by_hand("povray", "indirect_illuminance").folder.join("indirect.ppm").exists());
}
