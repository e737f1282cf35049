//! A body from a Wavefront file in a whole run: it reads what the same body reads as a `box:`, by other solvers.

use std::collections::BTreeMap;

use crate::support::{Folder, LAMP, ROOM, among};

/// After the room and its obstacles.
const MEASURED: &str = "meters:
  desk: {points_m: [[1, 1, 0.8], [4.2, 2, 0.1], [5, 2, 0.5]], normal: [0, 0, 1]}
procedures:
  direct_illuminance: {meters: desk}
  indirect_illuminance: {meters: desk, bounces: converged}
budget: {relative_error: 0.02, seconds: 30}
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

/// Value in lux and half width of its interval.
struct Reading {
    lux: f64,
    within_lux: f64,
}

/// What the simulator reads with such an obstacle, by procedure and meter.
fn read(folder: &Folder, obstacle: &str) -> BTreeMap<String, Reading> {
    folder.write("spec.yaml", &format!("{ROOM}obstacles: [{obstacle}]\n{MEASURED}"));
    folder.run(&["--engines", "simulator"]).exits(0);
    let report = folder.report();
    let readings = among(&report, "readings", &[("engine", "simulator")]).into_iter();
    let named = readings.map(|r| {
        let error = r["std_error"].as_f64();
        let within_lux = error.map_or_else(|| r["error_bound"].as_f64().unwrap(), |e| STUDENT_T * e);
        let reading = Reading { lux: r["value"].as_f64().unwrap(), within_lux };
        (format!("{} {}", r["procedure"].as_str().unwrap(), r["meter"].as_str().unwrap()), reading)
    });
    named.collect()
}

#[test]
fn a_crate_from_a_file_reads_what_the_same_box_reads() {
    let folder = Folder::new(&[("lamp.ies", LAMP), ("crate.obj", CRATE)]);
    let mesh = read(&folder, "{mesh: {file: crate.obj, at_m: [3.5, 1.5, 0.4], reflectance: 0.6}}");
    let cuboid = read(&folder, "{box: {min_m: [3.5, 1.5, 0.4], max_m: [4.5, 2.5, 0.9], reflectance: 0.6}}");
    let empty = read(&folder, "");
    assert_eq!((mesh.len(), cuboid.len(), empty.len()), (6, 6, 6));
    for (name, at) in &mesh {
        let exact = &cuboid[name];
        let allowed = at.within_lux + exact.within_lux;
        assert!(allowed <= 0.03 * exact.lux + 1e-9, "{name}: {allowed}");
        assert!((at.lux - exact.lux).abs() <= allowed, "{name}: {} for {} within {allowed}", at.lux, exact.lux);
    }
    // Below the crate it is dark, and would not be without it.
    let below = "direct_illuminance desk[1]";
    assert_eq!((mesh[below].lux, mesh[below].lux.is_sign_positive()), (0.0, true));
    assert!(empty[below].lux > 5.0);
    let reflected = "indirect_illuminance desk[1]";
    assert!(empty[reflected].lux > 1.3 * mesh[reflected].lux);
}

#[test]
fn points_inside_a_closed_mesh_are_reported_and_those_inside_an_open_one_are_not() {
    let folder = Folder::new(&[("lamp.ies", LAMP), ("crate.obj", CRATE)]);
    let crate_around = "obstacles: [{mesh: {file: crate.obj, at_m: [3.7, 1.5, 0], reflectance: 0.6}}]\n";
    folder.write("spec.yaml", &format!("{ROOM}{crate_around}{MEASURED}"));
    let answer = folder.luxproof(&["check", "spec.yaml"]);
    answer.exits(0).complains("desk[1] lies inside obstacles[0]");
    // A crate without its lid lets light in.
    folder.write("crate.obj", &CRATE.replace("f -4 -3 -2 -1\n", ""));
    let answer = folder.luxproof(&["check", "spec.yaml"]).exits(0);
    assert!(!answer.stderr.contains("lies inside"), "{}", answer.stderr);
}
