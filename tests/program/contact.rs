//! Luminaires on surfaces of every kind: one scene for all engines, whatever the notation of its angles.

use serde_json::Value;

use crate::support::{Folder, OWN, among, is_night};

/// A Lambertian table in steps of 5 degrees behind an opening of so many metres.
fn lamp(opening: &str) -> String {
    let gammas: Vec<String> = (0..=18).map(|k| (5 * k).to_string()).collect();
    let candela = |k: i32| if k == 18 { 0.0 } else { 1000.0 * f64::from(5 * k).to_radians().cos() };
    let candela: Vec<String> = (0..=18).map(|k| format!("{:.4}", candela(k))).collect();
    format!(
        "IESNA:LM-63-2002\n[TEST] x\n[TESTLAB] x\n[ISSUEDATE] 1-1-2026\n[MANUFAC] x\nTILT=NONE\n1 -1 1 19 1 1 2 {opening}\n1 1 10\n{}\n0\n{}\n",
        gammas.join(" "),
        candela.join(" ")
    )
}

const L_ROOM: &str = "{floor_m: [[0, 0], [6, 0], [6, 2], [3, 2], [3, 5], [0, 5]], height_m: 3, \
                      reflectance: {floor: 0.25, ceiling: 0.65, walls: 0.5}}";
/// The inner walls are sheets.
const UNLIKE: &str = "{floor_m: [[0, 0], [6, 0], [6, 2], [3, 2], [3, 5], [0, 5]], height_m: 3, \
                      reflectance: {floor: 0.25, ceiling: 0.65, walls: [0.5, 0.5, 0.3, 0.6, 0.5, 0.5]}}";
const SLANTED: &str = "{floor_m: [[0, 0], [6, 0], [6, 3], [4, 5], [0, 5]], height_m: 3, \
                       reflectance: {floor: 0.25, ceiling: 0.65, walls: 0.5}}";
const BOX_ROOM: &str = "{size_m: [5, 4, 3], reflectance: {floor: 0.2, walls: 0.5, ceiling: 0.7}}";
const BOX: &str = "[{box: {min_m: [0.1, 1, 0], max_m: [1, 3, 1.8], reflectance: 0.5}}]";

fn spec(room: &str, obstacles: &str, luminaire: &str, points: &str) -> String {
    format!(
        "luxproof: 1\nroom: {room}\nobstacles: {obstacles}\nluminaires:\n  - {{id: a, photometry: lamp.ies, {luminaire}}}\nmeters:\n  \
         m: {{points_m: {points}, normal: [0, 0, 1]}}\nprocedures:\n  direct_illuminance: {{meters: m}}\n  \
         indirect_illuminance: {{meters: m, bounces: converged}}\nbudget: {{relative_error: 0.01, seconds: 10}}\n"
    )
}

fn readings(report: &Value, engine: &str, procedure: &str) -> Vec<f64> {
    let found = among(report, "readings", &[("procedure", procedure), ("engine", engine)]);
    found.iter().map(|r| r["value"].as_f64().unwrap()).collect()
}

/// Asserts that two engines, or two runs, read the same but for chance (four standard errors) and so much of the light.
#[track_caller]
fn assert_alike(found: &[(f64, f64)], expected: &[(f64, f64)], relative: f64, what: &str) {
    assert!(!found.is_empty() && found.len() == expected.len(), "{what}: {found:?}");
    for ((a, of_a), (b, of_b)) in found.iter().zip(expected) {
        assert!((a - b).abs() <= 4.0 * of_a.hypot(*of_b) + relative * b.abs(), "{what}: {found:?} for {expected:?}");
    }
}

/// Values with their standard errors; a bound counts as one.
fn estimates(report: &Value, engine: &str, procedure: &str) -> Vec<(f64, f64)> {
    let found = among(report, "readings", &[("procedure", procedure), ("engine", engine)]);
    let error = |r: &Value| r["std_error"].as_f64().or(r["error_bound"].as_f64()).unwrap_or(0.0);
    found.iter().map(|r| (r["value"].as_f64().unwrap(), error(r))).collect()
}

fn read(spec: &str, opening: &str, engines: &str) -> Value {
    let folder = Folder::for_renderers(&[("spec.yaml", spec), ("lamp.ies", &lamp(opening))]);
    folder.run(&["--engines", engines, "--format", "json"]).json()
}

const RENDERERS: [&str; 2] = ["radiance", "mitsuba"];

#[test]
fn panels_on_inner_walls_and_boxes_are_read_as_renderers_do() {
    let on_wall = "at_m: [4.5, 2, 1.5], model: area, rotate_deg: {azimuth: 90, tilt: 90}";
    let on_box = "at_m: [0.5, 2, 1.8], model: area, rotate_deg: {tilt: 180}";
    for (text, opening, expected) in [
        (spec(L_ROOM, "[]", on_wall, "[[4.5, 0.8, 0.8]]"), "0.6 0.4 0", 76.4),
        (spec(BOX_ROOM, BOX, on_box, "[[2, 2, 0.8], [4, 1.2, 0.8]]"), "0.6 0.6 0", f64::NAN),
    ] {
        let report = read(&text, opening, "simulator,radiance,mitsuba");
        let own = readings(&report, "simulator", "indirect_illuminance");
        assert!(expected.is_nan() || (own[0] / expected - 1.0).abs() < 0.015, "{own:?} for {expected}");
        for renderer in RENDERERS {
            let found = readings(&report, renderer, "indirect_illuminance");
            assert_eq!(found.len(), own.len(), "{}", report["skips"]);
            let off = found.iter().zip(&own).map(|(a, b)| (a / b - 1.0).abs()).fold(0.0, f64::max);
            assert!(off < 0.03, "{renderer}: {found:?} for {own:?}");
        }
    }
}

#[test]
fn the_notation_of_angles_and_a_micrometre_change_nothing() {
    let points = "[[4.5, 0.8, 0.8], [1.5, 1, 1], [1, 4, 0.5]]";
    let on_wall = |rest: &str| {
        let text = spec(L_ROOM, "[]", &format!("model: area, {rest}"), points);
        let report = read(&text, "0.6 0.4 0", OWN);
        estimates(&report, "simulator", "indirect_illuminance")
    };
    let first = on_wall("at_m: [3, 3.5, 1.5], rotate_deg: {azimuth: 0, tilt: 90, roll: 0}");
    assert_eq!(first.len(), 3);
    for other in [
        "at_m: [3, 3.5, 1.5], rotate_deg: {azimuth: 180, tilt: -90, roll: 0}",
        "at_m: [3.000001, 3.5, 1.5], rotate_deg: {azimuth: 360, tilt: 90, roll: 180}",
        "at_m: [2.999999, 3.5, 1.5], rotate_deg: {azimuth: -180, tilt: 270, roll: 0}",
    ] {
        assert_alike(&on_wall(other), &first, 0.0, other);
    }
}

#[test]
fn a_panel_that_shines_into_a_body_or_overlaps_another_on_it_is_refused() {
    let points = "[[2, 2, 0.8]]";
    let check = |luminaires: &str| {
        let text = spec(BOX_ROOM, BOX, luminaires, points);
        let folder = Folder::new(&[("spec.yaml", &text), ("lamp.ies", &lamp("0.6 0.6 0"))]);
        folder.luxproof(&["check", "spec.yaml"])
    };
    let said = check("at_m: [0.5, 2, 1.8], model: area").exits(2).message();
    assert!(said.contains("sends all its light into that") && said.contains("tilt: 180"), "{said}");
    let two = |y: f64| {
        format!(
            "at_m: [0.5, 1.4, 1.8], model: area, rotate_deg: {{tilt: 180}}}}\n  - {{id: b, photometry: lamp.ies, at_m: [0.5, {y}, 1.8], model: area, \
             rotate_deg: {{tilt: 180}}"
        )
    };
    check(&two(1.9)).exits(2).complains("overlaps that of");
    check(&two(2.0)).exits(0);
}

#[test]
fn povray_reads_a_point_on_a_face_as_the_simulator_does() {
    let on_wall = "at_m: [4.5, 2, 1.5], rotate_deg: {azimuth: 90, tilt: 90}";
    let text = spec(L_ROOM, "[]", on_wall, "[[4.5, 1, 0.8], [1.5, 1, 0.8]]");
    let report = read(&text, "0 0 0", "simulator,povray");
    let [own, found] = ["simulator", "povray"].map(|engine| estimates(&report, engine, "indirect_illuminance"));
    assert_alike(&found, &own, 0.03, "povray");
}

/// A place on a surface, where that faces, and the room and bodies around it.
fn contact(random: &mut fastrand::Rng) -> String {
    let mut between = |low: f64, high: f64| low + (high - low) * random.f64();
    let (along, up) = (between(-0.3, 0.3), between(1.0, 1.6));
    let r = 0.2 * along;
    let raised = "[{box: {min_m: [0.1, 1, 1], max_m: [1, 3, 1.8], reflectance: 0.5}}]";
    let kind = random.u32(0..7);
    let (room, obstacles, [x, y, z], azimuth, tilt) = match kind {
        0 => (L_ROOM, "[]", [4.5 + along, 2.0, up], 90.0, 90.0),
        1 => (UNLIKE, "[]", [4.5 + along, 2.0, up], 90.0, 90.0),
        2 => (UNLIKE, "[]", [3.0, 3.5 + along, up], 0.0, 90.0),
        3 => (SLANTED, "[]", [5.0 + r, 4.0 - r, up], 45.0, 90.0),
        4 => (BOX_ROOM, BOX, [0.55, 2.0 + along, 1.8], 0.0, 180.0),
        5 => (BOX_ROOM, BOX, [1.0, 2.0 + along, up - 0.2], 180.0, 90.0),
        _ => (BOX_ROOM, raised, [0.55, 2.0 + along, 1.0], 0.0, 0.0),
    };
    // The same directions in another notation.
    let (azimuth, tilt) = match random.u32(0..3) {
        0 => (azimuth, tilt),
        1 => (azimuth + 180.0, -tilt),
        _ => (azimuth - 360.0, tilt + 360.0),
    };
    let off = 1e-6 * (random.f64() - 0.5);
    let at_m = if tilt % 180.0 == 0.0 { [x, y, z + off] } else { [x, y, z] };
    let luminaire = format!("at_m: {at_m:?}, model: area, rotate_deg: {{azimuth: {azimuth}, tilt: {tilt}}}");
    spec(room, obstacles, &luminaire, "[[2.3, 1.4, 0.8], [2.5, 0.6, 1.2]]")
}

/// Failing comparisons of renderers, but for what a renderer's own declaration explains.
fn failures(report: &Value) -> Vec<String> {
    let all = report["comparisons"].as_array().unwrap();
    let is_unexplained = |c: &Value| {
        c["verdict"] == "fail" && !c["diagnosis"].as_str().unwrap_or_default().starts_with("as it declares")
    };
    let is_failure = |c: &&Value| is_unexplained(c) && RENDERERS.iter().any(|r| c["engine"] == *r);
    all.iter().filter(is_failure).map(Value::to_string).collect()
}

#[test]
fn renderers_read_luminaires_on_surfaces_at_random_as_the_simulator_does() {
    let mut random = fastrand::Rng::with_seed(65);
    for k in 0..if is_night() { 200 } else { 3 } {
        let text = contact(&mut random);
        let opening = ["0.5 0.3 0", "-0.4 -0.4 0"][random.usize(0..2)];
        let report = read(&text, opening, "simulator,radiance,mitsuba");
        for renderer in RENDERERS {
            let found = readings(&report, renderer, "indirect_illuminance");
            assert_eq!(found.len(), 2, "{k}: {text} {}", report["skips"]);
        }
        assert_eq!(failures(&report), Vec::<String>::new(), "{k}: {text}");
    }
}

/// Values of a path tracer that shares no code with luxproof (150 lines of C, 15 million paths a point): the box of this room,
/// a table in steps of 15 degrees between which intensities are linear, and a face that reflects nothing or as the box does.
#[test]
fn a_panel_on_a_box_reads_what_an_independent_path_tracer_reads() {
    let table = "IESNA:LM-63-2002\n[TEST] x\n[TESTLAB] x\n[ISSUEDATE] 1-1-2026\n[MANUFAC] x\nTILT=NONE\n\
                 1 -1 1 7 1 1 2 0.6 0.4 0\n1 1 10\n0 15 30 45 60 75 90\n0\n1000 965.926 866.025 707.107 500 258.819 0\n";
    for (face, expected) in [("0", [(70.044, 0.029), (28.975, 0.017)]), ("0.5", [(70.723, 0.029), (29.279, 0.017)])] {
        let luminaire =
            format!("at_m: [0.5, 2, 1.8], model: area, rotate_deg: {{tilt: 180}}, face_reflectance: {face}");
        let spec = spec(BOX_ROOM, BOX, &luminaire, "[[2, 2, 0.8], [4, 1.2, 0.8]]");
        let folder = Folder::new(&[("spec.yaml", &spec), ("lamp.ies", table)]);
        let report = folder.run(&["--engines", "simulator", "--format", "json"]).json();
        assert_alike(&estimates(&report, "simulator", "indirect_illuminance"), &expected, 0.0, face);
    }
}
