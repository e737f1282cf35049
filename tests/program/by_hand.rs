//! Exported scenes, run by hand: the printed command, typed into a shell, reads case S1 without this program's help.

use std::fs;
use std::path::Path;
use std::process::Command;

use serde_json::Value;

use crate::support::{Answer, Folder, S1_DIRECT_LX, S1_INDIRECT_LX, root};

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

/// What a procedure's printed command gives on standard output, and its folder.
fn by_hand(engine: &str, procedure: &str) -> (String, Folder) {
    let axial = fs::read_to_string(root().join("reference/luminaires/axial.ies")).unwrap();
    by_hand_of(&[("spec.yaml", SPEC), ("axial.ies", &axial)], engine, procedure)
}

fn by_hand_of(files: &[(&str, &str)], engine: &str, procedure: &str) -> (String, Folder) {
    let folder = Folder::for_renderers(files);
    let export = ["export", "spec.yaml", "--engine", engine, "--procedures", procedure, "--out", "scenes"];
    let printed = folder.luxproof(&export).stdout;
    let command = printed.lines().find(|l| l.trim_start().starts_with("cd ")).unwrap_or_else(|| panic!("{printed}"));
    let run = Answer::of(Command::new("sh").args(["-c", command]).current_dir(folder.path("")));
    assert_eq!(run.code, Some(0), "`{command}`: {}; run `luxproof engines install`?", run.stderr);
    (run.stdout, folder)
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

/// Files in shared memory that are named after a process, and its number.
fn of_processes() -> Vec<(String, String)> {
    let names = fs::read_dir("/dev/shm").unwrap().map(|file| file.unwrap().file_name().into_string().unwrap());
    let number = |name: &String| name.rsplit('_').next().filter(|n| n.parse::<u32>().is_ok()).map(str::to_owned);
    names.filter_map(|name| number(&name).map(|number| (name, number))).collect()
}

#[test]
fn radiance_by_hand_leaves_nothing_in_shared_memory() {
    let before = of_processes();
    by_hand("radiance", "indirect_illuminance");
    // What others that run beside this use goes before they do.
    let is_left = |(name, number): &(String, String)| {
        !before.iter().any(|(known, _)| known == name)
            && !Path::new("/proc").join(number).exists()
            && Path::new("/dev/shm").join(name).exists()
    };
    let left: Vec<_> = of_processes().into_iter().filter(is_left).collect();
    assert!(left.is_empty(), "{left:?}");
}

#[test]
fn radiance_prints_the_illuminance_of_each_meter() {
    // rcalc prints six digits.
    agree(&numbers(&by_hand("radiance", "direct_illuminance").0), &S1_DIRECT_LX, 2e-6);
    agree(&numbers(&by_hand("radiance", "indirect_illuminance").0), &S1_INDIRECT_LX, 0.05);
}

#[test]
fn radiance_adds_up_luminaires_that_hide_one_another() {
    let panel = "IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 2 1 1 2 0.6 0.6 0\n1 1 50\n0 90\n0\n100 100\n";
    let read = |lamps: &[&str], procedure: &str| {
        let lamps: Vec<String> = lamps.iter().map(|l| format!("{{photometry: panel.ies, model: area, {l}}}")).collect();
        let spec = format!(
            "luxproof: 1\nroom: {{size_m: [4, 4, 3], reflectance: {{floor: 0.5, walls: 0.5, ceiling: 0.5}}}}\nluminaires: [{}]\n\
             meters: {{floor: {{points_m: [[2, 2, 0.1], [2.4, 1.8, 0.5]], normal: [0, 0, 1]}}}}\nprocedures:\n  \
             direct_illuminance: {{meters: floor}}\n  indirect_illuminance: {{meters: floor, bounces: 1}}\n\
             engines: {{radiance: {{preset: fast}}}}\n",
            lamps.join(", ")
        );
        numbers(&by_hand_of(&[("spec.yaml", &spec), ("panel.ies", panel)], "radiance", procedure).0)
    };
    let (below, above) = ("id: below, at_m: [2, 2, 2]", "id: above, at_m: [2, 2, 2.8]");
    // A block of direct light is a sample of each panel's parts.
    for (procedure, tolerance) in [("direct_illuminance", 0.02), ("indirect_illuminance", 0.1)] {
        let alone = [below, above].map(|lamp| read(&[lamp], procedure));
        let sum: Vec<f64> = alone[0].iter().zip(&alone[1]).map(|(a, b)| a + b).collect();
        assert!(alone[1].iter().zip(&sum).all(|(above, sum)| above > &(0.2 * sum)), "{alone:?}");
        agree(&read(&[below, above], procedure), &sum, tolerance);
    }
}

#[test]
fn mitsuba_prints_readings_with_their_standard_errors() {
    for (procedure, known, tolerance) in
        [("direct_illuminance", S1_DIRECT_LX, 1e-5), ("indirect_illuminance", S1_INDIRECT_LX, 0.05)]
    {
        let answer: Value = serde_json::from_str(&by_hand("mitsuba", procedure).0).unwrap();
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
    let (_, folder) = by_hand("povray", "direct_illuminance");
    let image = fs::read(folder.path("scenes/direct_illuminance/direct.ppm")).unwrap();
    let scale = scales(&folder.read("scenes/direct_illuminance/scene.pov"));
    drop(folder);
    // A binary PPM of 16 bits; "With x = E / scale of the meter: red .25 + x/2, green 16 x, blue 256 x".
    let pixels = &image[image.len() - 4 * 6..];
    let red = |k: usize| f64::from(u16::from_be_bytes([pixels[6 * k], pixels[6 * k + 1]])) / 65535.0;
    let found: Vec<f64> = (0..4).map(|k| 2.0 * (red(k) - 0.25) * scale[k]).collect();
    let step = |k: usize| scale[k] / 65535.0 / S1_DIRECT_LX[k];
    let coarsest = (0..4).map(step).fold(0.0, f64::max);
    agree(&found, &S1_DIRECT_LX, 1.1 * coarsest);
    let (_, folder) = by_hand("povray", "indirect_illuminance");
    assert!(folder.path("scenes/indirect_illuminance/indirect.ppm").exists());
}
