//! One seed, the same bytes: of every renderer, on an idle machine and on a busy one, with as many processes as it likes.

use std::sync::atomic::{AtomicBool, Ordering};

use serde_json::Value;

use crate::support::{Folder, SKEW_LAMP};

/// A room whose reflected light all three renderers sample, and an opening whose direct light Mitsuba and Radiance sample.
const SPEC: &str = "luxproof: 1
title: a room that is sampled
room: {size_m: [4, 5, 3], reflectance: {floor: 0.2, walls: 0.5, ceiling: 0.7}}
luminaires:
  - {id: point, photometry: lamp.ies, at_m: [1.4, 2.2, 2.6]}
  - {id: opening, photometry: lamp.ies, at_m: [2.9, 3.1, 2.5], model: area}
meters:
  plane: {points_m: [[1, 1, 0.8], [2, 3, 0.8], [3, 4, 0.8]], normal: [0, 0, 1]}
procedures:
  direct_illuminance: {meters: plane}
  indirect_illuminance: {meters: plane, bounces: 3}
budget: {relative_error: 0.02, seconds: 60}
";

/// The report of a run without the times that it has of its own.
fn report_of(folder: &Folder, seed: &str, more: &[&str]) -> Value {
    let engines = ["--engines", "radiance,mitsuba,povray,simulator"];
    let fixed = ["run", "spec.yaml", "--no-cache", "--no-calibration", "--seed", seed, "--out", "out"];
    folder.luxproof(&[&fixed[..], &engines, more].concat()).exits(0);
    let mut report = folder.report();
    timeless(&mut report);
    report
}

fn timeless(value: &mut Value) {
    match value {
        Value::Object(fields) => {
            fields.retain(|key, _| key != "started" && key != "wall_s");
            fields.values_mut().for_each(timeless);
        }
        Value::Array(items) => items.iter_mut().for_each(timeless),
        _ => {}
    }
}

/// As many threads as there are processors and more, which do nothing but keep them busy.
fn under_load<T>(run: impl FnOnce() -> T) -> T {
    let done = AtomicBool::new(false);
    std::thread::scope(|scope| {
        for _ in 0..2 * std::thread::available_parallelism().unwrap().get() {
            scope.spawn(|| {
                while !done.load(Ordering::Relaxed) {
                    std::hint::spin_loop();
                }
            });
        }
        let result = run();
        done.store(true, Ordering::Relaxed);
        result
    })
}

#[test]
fn one_seed_says_the_same_to_the_byte_on_a_busy_machine_and_with_other_numbers_of_processes() {
    let folder = Folder::for_renderers(&[("spec.yaml", SPEC), ("lamp.ies", SKEW_LAMP)]);
    let idle = report_of(&folder, "2", &[]);
    for engine in ["radiance", "mitsuba", "povray"] {
        let sampled = idle["recordings"]
            .as_array()
            .unwrap()
            .iter()
            .any(|r| r["engine"] == engine && r["work_s"].as_f64() > Some(0.0));
        assert!(sampled, "{engine} sampled nothing: {idle}");
    }
    let busy = under_load(|| report_of(&folder, "2", &[]));
    assert_eq!(idle, busy, "a busy machine reads otherwise");
    // Commands name how many threads they run on.
    assert_eq!(
        idle["readings"],
        report_of(&folder, "2", &["--jobs", "1"])["readings"],
        "one process at a time reads otherwise"
    );
    let other = report_of(&folder, "3", &[]);
    assert_ne!(idle["readings"], other["readings"], "another seed reads the same");
}
