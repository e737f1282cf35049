//! `reference/cie171`: every value of cases 5.9 to 5.14 derived over the solid angle of the sky, in place of the area of
//! the opening. The two derivations share no code.

use glam::DVec3;
use luxproof_scene::Meter;
use luxproof_scene::geometry::configuration_factor::element_to_polygon;

use super::daylight::{HORIZONTAL_LX, Sky, clear, of_facade, of_roof, roof, through, through_each, upright};
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
    let skies: Vec<Sky> = (1..=16).map(|number| Sky::new(number, sun_deg)).collect();
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

/// Compares every value of a case with one sky; returns how many there are and how many differ.
fn differences(case: &str, derive: impl Fn(&Meter) -> f64) -> (usize, usize) {
    differences_in(case, "value", derive)
}

/// Compares a column of a case.
fn differences_in(case: &str, column: &str, derive: impl Fn(&Meter) -> f64) -> (usize, usize) {
    let mut count = (0, 0);
    for (meter, cells) in tabulated(case) {
        let (_, value) = cells.iter().find(|(name, _)| name == column).unwrap();
        let (derived, allowed) = (derive(&meter), (AGREEMENT * value).max(ZERO_LX));
        count.0 += 1;
        count.1 += usize::from((derived - value).abs() > allowed);
    }
    count
}

#[test]
fn both_derivations_agree_where_openings_and_the_sun_are_turned() {
    let (opening, sky) = (roof(1.0, 30.0), Sky::new(12, 30.0));
    assert_eq!(differences("5.9-aside", |m| through(m, &[opening], &sky, clear)), (8, 0));
    assert_eq!(differences("5.10-aside", |m| through(m, &[opening], &sky, of_roof)), (8, 0));
    let (opening, sky) = (upright(8.0, [3.0, 5.0], [1.5, 2.5]), Sky::new(12, 45.0));
    assert_eq!(differences("5.11-aside", |m| through(m, &[opening], &sky, clear)), (8, 0));
    assert_eq!(differences("5.12-aside", |m| through(m, &[opening], &sky, of_facade)), (8, 0));
    // A sun on the other side, or one degree off, is another table.
    for sun_deg in [-45.0, 46.0] {
        let other = Sky::new(12, sun_deg);
        let (_, misses) = differences("5.11-aside", |m| through(m, &[opening], &other, clear));
        assert!(misses >= 6, "{sun_deg}: {misses}");
    }
}

#[test]
fn both_derivations_agree_at_points_aside_behind_masks() {
    let overcast = Sky::new(16, 0.0);
    let wall = |y: f64, z: f64| [6.0, 6.2].map(|x| upright(x, [y - 1.0, y + 1.0], [z, z + 1.0]));
    // The luminaire's own sides, and then none: no point sees past them.
    for (y, z) in [([1.0, 7.0], [4.5, 7.5]), ([-90.0, 99.0], [-90.0, 7.5])] {
        let [inner, outer] = wall(4.0, 6.5);
        let frames = [inner, outer, upright(7.2, y, z)];
        assert_eq!(differences("5.13-aside", |m| through(m, &frames, &overcast, clear)), (8, 0));
    }
    for (y, z) in [([9.0, 21.0], [4.5, 9.0]), ([-90.0, 99.0], [4.5, 99.0])] {
        let [inner, outer] = wall(15.0, 2.5);
        let frames = [inner, outer, upright(12.2, y, z)];
        assert_eq!(differences("5.14-aside", |m| through(m, &frames, &overcast, clear)), (6, 0));
    }
}

#[test]
fn both_derivations_agree_far_from_large_openings() {
    let (opening, gradual) = (roof(4.0, 0.0), Sky::new(1, 0.0));
    assert_eq!(differences_in("5.9-far", "sky-1", |m| through(m, &[opening], &gradual, clear)), (8, 0));
    let by_factor = |m: &Meter| HORIZONTAL_LX * element_to_polygon(m.position_m, m.normal, &opening);
    assert_eq!(differences_in("5.9-far", "sky-5", by_factor), (8, 0));
    let (opening, uniform) = (upright(8.0, [2.0, 6.0], [0.5, 3.5]), Sky::new(5, 0.0));
    assert_eq!(differences("5.11-far", |m| through(m, &[opening], &uniform, clear)), (9, 0));
    assert_eq!(differences("5.12-far", |m| through(m, &[opening], &gradual, of_facade)), (9, 0));
}

/// Compares the column of a case under the uniform sky with a closed form.
fn check_uniform(case: &str, column: &str, count: usize, derive: impl Fn(&Meter) -> f64) {
    let points = tabulated(case);
    assert_eq!(points.len(), count);
    for (meter, cells) in points {
        let (_, value) = cells.iter().find(|(name, _)| name == column).unwrap();
        let derived = derive(&meter);
        assert!((derived / value - 1.0).abs() < AGREEMENT, "{case} {column} {meter:?}: {derived} against {value}");
    }
}

#[test]
fn under_the_uniform_sky_values_follow_configuration_factors() {
    for (column, side_m) in [("1m-sky-5", 1.0), ("4m-sky-5", 4.0)] {
        let opening = roof(side_m, 0.0);
        check_uniform("5.9", column, 14, |m| HORIZONTAL_LX * element_to_polygon(m.position_m, m.normal, &opening));
    }
    for (column, sides, [sill, head]) in
        [("2x1m-sky-5", [3.0, 5.0], [1.5, 2.5]), ("4x3m-sky-5", [2.0, 6.0], [0.5, 3.5])]
    {
        check_uniform("5.11", column, 22, |m| {
            let horizon = m.position_m.z.clamp(sill, head);
            let factor = |z: [f64; 2]| element_to_polygon(m.position_m, m.normal, &upright(8.0, sides, z));
            HORIZONTAL_LX * (factor([horizon, head]) + 0.3 * factor([sill, horizon]))
        });
    }
}
