//! `reference/cie171`: every value of cases 5.9 to 5.14 derived over the solid angle of the sky, in place of the area of
//! the opening. The two derivations share no code.

use glam::DVec3;
use luxproof_scene::Meter;

use super::daylight::{Sky, clear, of_facade, of_roof, roof, through_each, upright};
use super::{reference, vector};

/// Both derivations agree to this part of every value.
const AGREEMENT: f64 = 1e-6;
/// Values below this, in lx, are zero in both derivations.
const ZERO_LX: f64 = 1e-9;

/// The points of a case, each with its cells by column.
fn tabulated(case: &str) -> Vec<(Meter, Vec<(String, f64)>)> {
    let text = std::fs::read_to_string(reference("cie171/values").join(format!("{case}.yaml"))).unwrap();
    let rows = text.lines().filter_map(|line| line.trim().strip_prefix("- {at_m: "));
    rows.map(|row| {
        let mut vectors = row.split('[').skip(1).map(|part| vector(part.split(']').next().unwrap()));
        let meter = Meter { position_m: vectors.next().unwrap(), normal: vectors.next().unwrap() };
        let cells = row.split_once("cells: {").unwrap().1.trim_end_matches('}');
        let cells = cells.split(", ").map(|cell| {
            let (column, value) = cell.split_once(": ").unwrap();
            (column.to_owned(), value.trim_matches('"').parse().unwrap())
        });
        (meter, cells.collect())
    })
    .collect()
}

/// Compares every cell of a case in the columns of one size; `frames` bound what shows of the sky.
fn check(case: &str, size: &str, sun_deg: f64, frames: &[[DVec3; 4]], passed: fn(DVec3) -> f64) {
    let skies: Vec<Sky> = (1..=16).map(|number| Sky::numbered(number, sun_deg, 30.0)).collect();
    let mut count = 0;
    for (meter, cells) in tabulated(case) {
        let illuminances = through_each(&meter, frames, &skies, passed);
        for (column, value) in cells {
            let Some(number) = column.strip_prefix(size).and_then(|rest| rest.strip_prefix("-sky-")) else { continue };
            let derived = illuminances[number.parse::<usize>().unwrap() - 1];
            let allowed = (AGREEMENT * value).max(ZERO_LX);
            assert!((derived - value).abs() <= allowed, "{case} {column} {meter:?}: {derived} against {value}");
            count += 1;
        }
    }
    assert_eq!(count % 16, 0, "{case} {size}");
    assert!(count >= 14 * 16, "{case} {size}: {count}");
}

#[test]
fn both_derivations_agree_under_roof_openings() {
    for (size, side_m) in [("1m", 1.0), ("4m", 4.0)] {
        check("5.9", size, 90.0, &[roof(side_m, 0.0)], clear);
        check("5.10", size, 90.0, &[roof(side_m, 0.0)], of_roof);
    }
}

#[test]
fn both_derivations_agree_behind_facade_openings() {
    let small = upright(8.0, [3.0, 5.0], [1.5, 2.5]);
    let large = upright(8.0, [2.0, 6.0], [0.5, 3.5]);
    for (size, opening) in [("2x1m", small), ("4x3m", large)] {
        check("5.11", size, 0.0, &[opening], clear);
        check("5.12", size, 0.0, &[opening], of_facade);
    }
}

#[test]
fn both_derivations_agree_behind_masks() {
    let wall = |y: f64, z: f64| [6.0, 6.2].map(|x| upright(x, [y - 1.0, y + 1.0], [z, z + 1.0]));
    let [inner, outer] = wall(4.0, 6.5);
    // No point sees past the sides of the luminaires that stand at the masks' edges.
    check("5.13", "2x1m", 0.0, &[inner, outer, upright(7.2, [-90.0, 99.0], [-90.0, 7.5])], clear);
    let [inner, outer] = wall(15.0, 2.5);
    check("5.14", "2x1m", 0.0, &[inner, outer, upright(12.2, [-90.0, 99.0], [4.5, 99.0])], clear);
}
