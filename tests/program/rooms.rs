//! Rooms that are no boxes, rows of luminaires, grids over surfaces: what a spec says in a line, every engine has.

use serde_json::Value;

use crate::support::{Folder, LAMP, among};

const L: &str = "luxproof: 1\n\
    room: {floor_m: [[0, 0], [6, 0], [6, 2], [3, 2], [3, 5], [0, 5]], height_m: 3, reflectance: {floor: 0.2, walls: 0.5, ceiling: 0.7}}\n";
const AS_BOXES: &str = "luxproof: 1\n\
    room: {size_m: [6, 5, 3], reflectance: {floor: 0.2, walls: 0.5, ceiling: 0.7}}\n\
    obstacles: [{box: {min_m: [3, 2, 0], max_m: [6, 5, 3], reflectance: 0.5}}]\n";
const REST: &str = "luminaires:\n  - {id: bay, photometry: lamp.ies, array: {counts: [2, 2], origin_m: [0.8, 0.7, 2.9], step_m: [1.4, 0.9]}}\n\
    meters:\n  arm: {line: {from_m: [2, 4.8, 0.8], to_m: [2.8, 2.5, 1.5], count: 3}, normal: [1, 0, 0.5]}\n  \
    foot: {line: {from_m: [2.2, 1, 1], to_m: [5, 1.5, 1], count: 3}, normal: [0, 0, 1]}\n\
    procedures:\n  direct_illuminance: {meters: [arm, foot]}\n  indirect_illuminance: {meters: [arm, foot]}\n\
    budget: {relative_error: 0.01, seconds: 20}\n";
/// A room with a slanting wall and a low niche, which is no prism; two reflectances in the plane of a wall.
const NO_PRISM: &str = "v 0 0 0\nv 5 0 0\nv 4 4 0\nv 0 4 0\nv 0 0 2\nv 5 0 3\nv 4 4 3\nv 0 4 2\nv 2 0 0\nv 2 0 2.4\n\
    g floor\nf 1 9 2 3 4\ng ceiling\nf 5 8 7\nf 5 7 10\nf 10 7 6\ng walls\nf 2 6 7 3\nf 3 7 8 4\nf 4 8 5 1\nf 1 5 10 9\ng door\nf 9 10 6 2\n";

fn values(report: &Value, engine: &str, procedure: &str) -> Vec<[f64; 2]> {
    let mine = among(report, "readings", &[("engine", engine), ("procedure", procedure)]);
    let number = |v: &Value| v.as_f64().unwrap_or(0.0);
    mine.iter().map(|r| [number(&r["value"]), number(&r["uncertainty"]["value"])]).collect()
}

#[test]
fn an_l_shaped_floor_is_a_box_with_a_box_in_its_corner() {
    let (l, boxes) = ([L, REST].concat(), [AS_BOXES, REST].concat());
    let folder = Folder::new(&[("l.yaml", &l), ("boxes.yaml", &boxes), ("lamp.ies", LAMP)]);
    let read = |spec: &str| {
        let out = format!("out-{spec}");
        folder.luxproof(&["run", spec, "--engines", "simulator", "--format", "json", "--out", &out]).report().0
    };
    let (l, boxes) = (read("l.yaml"), read("boxes.yaml"));
    for procedure in ["direct_illuminance", "indirect_illuminance"] {
        let [a, b] = [&l, &boxes].map(|report| values(report, "simulator", procedure));
        assert!(a.len() == 6 && a.iter().all(|[lx, _]| *lx > 1.0), "{a:?}");
        assert_eq!(a, b, "{procedure}");
    }
}

#[test]
fn every_engine_has_the_direct_light_of_rooms_that_are_no_boxes() {
    let mesh = "luxproof: 1\nroom: {mesh: room.obj, groups: {floor: 0.2, walls: 0.5, ceiling: 0.7, door: 0.1}}\n"
        .to_owned()
        + REST;
    let mesh = mesh.replace("2, 4.8, 0.8", "1, 3.8, 0.8").replace("5, 1.5, 1]", "4, 1.5, 1]");
    let mesh = mesh.replace("0.7, 2.9]", "0.7, 1.9]");
    let slanting = [&L.replace("[3, 2], [3, 5]", "[3.5, 2.5], [2.9, 5]"), REST].concat();
    let files = [("mesh.yaml", &mesh[..]), ("slanting.yaml", &slanting), ("lamp.ies", LAMP), ("room.obj", NO_PRISM)];
    let folder = Folder::for_renderers(&files);
    for spec in ["mesh.yaml", "slanting.yaml"] {
        let engines = "simulator,radiance,mitsuba,povray,cycles,luxcore";
        let args = ["run", spec, "--engines", engines, "--procedures", "direct_illuminance", "--format", "json"];
        let (report, code) = folder.luxproof(&[&args[..], &["--no-cache", "--no-calibration"]].concat()).report();
        assert_eq!(code, Some(0), "{spec}: {}", report["summary"]);
        let right = values(&report, "simulator", "direct_illuminance");
        for engine in engines.split(',') {
            let read = values(&report, engine, "direct_illuminance");
            assert_eq!(read.len(), 6, "{spec}: {engine}");
            for ([lx, _], [right, _]) in read.iter().zip(&right) {
                assert!((lx - right).abs() <= 1e-4 * right, "{spec}: {engine} {lx} for {right}");
            }
        }
    }
}

#[test]
fn luminaires_may_hang_on_the_walls_of_any_room() {
    let lamps = "luminaires:\n  - {id: a, photometry: lamp.ies, at_m: [6, 1, 2]}\n  - {id: b, photometry: lamp.ies, at_m: [1, 1, 3]}\n  \
        - {id: c, photometry: lamp.ies, at_m: [3, 4, 2]}\n";
    let spec = [L, lamps, &REST[REST.find("meters:").unwrap()..]].concat();
    let folder = Folder::new(&[("spec.yaml", &spec), ("lamp.ies", LAMP)]);
    folder.luxproof(&["check", "spec.yaml"]).exits(0);
    folder.edit("spec.yaml", "at_m: [3, 4, 2]", "at_m: [3.01, 4, 2]");
    let answer = folder.luxproof(&["check", "spec.yaml"]).exits(2);
    assert_eq!(answer.stderr.matches("outside the room").count(), 1, "{}", answer.stderr);
}

/// Boxes are solved without chance, sheets by sampling: the same room either way.
#[test]
fn sheets_reflect_as_boxes_do() {
    let sheets = [&L.replace("walls: 0.5", "walls: [0.5, 0.5, 0.5, 0.5000000001, 0.5, 0.5]"), REST].concat();
    let boxes = [L, REST].concat();
    let folder = Folder::new(&[("sheets.yaml", &sheets), ("boxes.yaml", &boxes), ("lamp.ies", LAMP)]);
    let read = |spec: &str| {
        let args = ["run", spec, "--engines", "simulator", "--procedures", "indirect_illuminance", "--format", "json"];
        values(&folder.luxproof(&args).report().0, "simulator", "indirect_illuminance")
    };
    let (sheets, boxes) = (read("sheets.yaml"), read("boxes.yaml"));
    assert_eq!(sheets.len(), 6);
    for ([a, error_a], [b, error_b]) in sheets.iter().zip(&boxes) {
        assert!((a - b).abs() < error_a + error_b && *error_a < 0.05 * a, "{a} +- {error_a}, {b} +- {error_b}");
    }
}

#[test]
fn a_hall_of_two_hundred_luminaires_is_a_few_lines() {
    let hall = "luxproof: 1\nroom: {size_m: [60, 30, 9], reflectance: {floor: 0.2, walls: 0.5, ceiling: 0.7}}\nluminaires:\n  \
        - {id: bay, photometry: lamp.ies, array: {counts: [20, 10], origin_m: [1.5, 1.5, 8], step_m: [3, 3]}}\n\
        meters:\n  floor: {surface: {of: floor, distance_m: 0.75, margin_m: 0.5}}\n  wall: {surface: {of: x+, distance_m: 0.02, counts: [3, 2]}}\n  \
        eye: {points_m: [[30, 15, 1.2]], around: {count: 4}}\n\
        procedures:\n  direct_illuminance: {meters: [floor, wall, eye]}\n";
    assert!(hall.lines().count() <= 15);
    let folder = Folder::new(&[("hall.yaml", hall), ("lamp.ies", LAMP)]);
    let (report, _) = folder.luxproof(&["run", "hall.yaml", "--engines", "simulator", "--format", "json"]).report();
    let comparisons = among(&report, "comparisons", &[("engine", "simulator"), ("procedure", "direct_illuminance")]);
    let of = |set: &str| comparisons.iter().filter(|c| c["meter"].as_str().unwrap().starts_with(set)).count();
    // 59 by 29 m: d = 29, since 59 is twice that; p = .2 x 5^log10(29) = 2.1 m; 29 and 14 cells.
    assert_eq!([of("floor"), of("wall"), of("eye")], [29 * 14, 6, 4]);
    let wall = comparisons.iter().find(|c| c["meter"] == "wall[0]").unwrap();
    assert_eq!((&wall["normal"], &wall["at_m"][0]), (&serde_json::json!([-1.0, 0.0, 0.0]), &serde_json::json!(59.98)));
    assert!(comparisons.iter().all(|c| c["verdict"] == "pass"), "{}", report["summary"]);
    let intensity =
        hall.replace("procedures:\n", "procedures:\n  luminous_intensity: {luminaire: \"bay[19,9]\", distance_m: 5}\n");
    let folder = Folder::new(&[("hall.yaml", &intensity), ("lamp.ies", LAMP)]);
    let args = ["run", "hall.yaml", "--engines", "simulator", "--procedures", "luminous_intensity"];
    assert_eq!(folder.luxproof(&args).code, Some(0));
}

#[test]
fn invalid_rooms_rows_and_grids_are_reported_with_their_place() {
    let spec = |room: &str, array: &str, desk: &str| {
        format!(
            "luxproof: 1\nroom: {{{room}, reflectance: {{floor: 0.2, walls: 0.5, ceiling: 0.7}}}}\n\
             luminaires:\n  - {{id: a, photometry: lamp.ies, {array}}}\nmeters:\n  desk: {{{desk}}}\nprocedures:\n  direct_illuminance: {{meters: desk}}\n"
        )
    };
    let (room, array, desk) = (
        "floor_m: [[0, 0], [6, 0], [6, 2], [3, 2], [3, 5], [0, 5]], height_m: 3",
        "at_m: [1, 1, 2]",
        "points_m: [[1, 1, 1]], normal: [0, 0, 1]",
    );
    for (spec, reported) in [
        (spec("floor_m: [[0, 0], [6, 0], [3, 0]], height_m: 3", array, desk), "it holds nothing"),
        (
            spec("floor_m: [[0, 0], [6, 6], [6, 0], [0, 6]], height_m: 3", array, desk),
            "wall 0 crosses or touches wall 2",
        ),
        (spec("floor_m: [[0, 0], [6, 0], [6, 2]]", array, desk), "missing field `height_m`"),
        (
            spec("size_m: [3, 3, 3], floor_m: [[0, 0], [6, 0], [6, 2]], height_m: 3", array, desk),
            "a room has one shape",
        ),
        (spec("size_m: [6, 5, 3], height_m: 3", array, desk), "`height_m` does not go with this shape"),
        (spec(room, "at_m: [5, 4, 2]", desk), "lies outside the room's walls"),
        // That before it hangs on a wall.
        (spec(room, "array: {counts: [4, 1], origin_m: [1, 3, 2], step_m: [1, 1]}", desk), "`a[3,0]`"),
        (spec(room, "array: {counts: [2, 0], origin_m: [1, 1, 2], step_m: [1, 1]}", desk), "2 x 0 luminaires"),
        (spec(room, "array: {counts: [2, 2], origin_m: [1, 1, 2], step_m: [1, 0]}", desk), "no step"),
        (spec(room, "rotate_deg: {tilt: 3}", desk), "missing field `at_m`"),
        (spec(room, array, "points_m: [[5, 4, 1]], normal: [0, 0, 1]"), "lies outside the room's walls"),
        (spec(room, array, "points_m: [[1, 1, 1]]"), "missing field `normal`"),
        (
            spec(room, array, "points_m: [[1, 1, 1]], normal: [0, 0, 1], around: {count: 4}"),
            "exactly one of `normal` and `around`",
        ),
        (spec(room, array, "surface: {of: floor, distance_m: 0.75, margin_m: 4}"), "leaves nothing of the floor"),
        (spec(room, array, "surface: {of: floor, distance_m: 3}"), "3 m from the floor is not in the room"),
        (spec(room, array, "line: {from_m: [1, 1, 1], to_m: [1, 1, 1], count: 3}, normal: [0, 0, 1]"), "no length"),
    ] {
        let folder = Folder::new(&[("spec.yaml", &spec), ("lamp.ies", LAMP)]);
        let done = folder.luxproof(&["check", "spec.yaml"]);
        let said = done.message();
        assert!(done.code == Some(2) && said.contains(reported), "{reported}: {said}");
        assert!(said.contains("spec.yaml:"), "{said}");
    }
    let open = NO_PRISM.replace("f 4 8 5 1\n", "");
    let spec = "luxproof: 1\nroom: {mesh: room.obj, groups: {floor: 0.2, walls: 0.5, ceiling: 0.7, window: 0.1}}\n"
        .to_owned()
        + REST;
    let folder = Folder::new(&[("spec.yaml", &spec), ("lamp.ies", LAMP), ("room.obj", NO_PRISM)]);
    let said = folder.luxproof(&["check", "spec.yaml"]).stderr;
    assert!(said.contains("group `door`") && said.contains("no group `window`"), "{said}");
    let spec = spec.replace("window", "door");
    let folder = Folder::new(&[("spec.yaml", &spec), ("lamp.ies", LAMP), ("room.obj", &open)]);
    assert!(folder.luxproof(&["check", "spec.yaml"]).stderr.contains("outside the room's walls"));
}
