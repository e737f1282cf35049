//! Changed tables by hand: what each fault reads at some angles of tables with a few nodes.

use glam::DVec3;
use luxproof_engines::fixtures;
use luxproof_photometry::LuminousIntensityDistribution as Table;
use luxproof_scene::Luminaire;

use super::tables::*;

/// A luminaire with the same light in every plane.
fn axial(gamma_deg: &[f64], candela: &[f64]) -> Luminaire {
    fixtures::luminaire("lamp", DVec3::ZERO, Table::axial(gamma_deg.to_vec(), candela.to_vec()).unwrap())
}

/// A luminaire with these planes, one list of candela a plane.
fn of_planes(c_deg: &[f64], gamma_deg: &[f64], candela: &[&[f64]]) -> Luminaire {
    let table = Table::new(c_deg.to_vec(), gamma_deg.to_vec(), candela.concat()).unwrap();
    fixtures::luminaire("lamp", DVec3::ZERO, table)
}

/// Candela that fall evenly from 100 at the nadir to 0 at the horizon.
fn falling() -> Luminaire {
    axial(&[0.0, 90.0], &[100.0, 0.0])
}

/// Four planes that differ, the same candela at each gamma up to the zenith.
fn four_planes() -> Luminaire {
    let rows: [&[f64]; 5] = [&[10.0; 3], &[20.0; 3], &[30.0; 3], &[40.0; 3], &[10.0; 3]];
    of_planes(&[0.0, 90.0, 180.0, 270.0, 360.0], &[0.0, 90.0, 180.0], &rows)
}

#[track_caller]
fn assert_reads(luminaire: &Luminaire, expected: &[(f64, f64, f64)]) {
    for (c_deg, gamma_deg, candela) in expected {
        let found = luminaire.photometry.distribution.intensity(*c_deg, *gamma_deg).value();
        let is_near = (found - candela).abs() < 1e-6 * candela.abs().max(1.0);
        assert!(is_near, "C {c_deg}, gamma {gamma_deg}: {found} for {candela}");
    }
}

#[test]
fn other_angles_are_read_where_a_map_leads() {
    let mut mirrored = four_planes();
    assert!(remap(&mut mirrored, |c, g| ((-c).rem_euclid(360.0), g)));
    assert_reads(&mirrored, &[(0.0, 50.0, 10.0), (90.0, 50.0, 40.0), (180.0, 50.0, 30.0), (225.0, 50.0, 25.0)]);
    let mut turned_over = axial(&[0.0, 60.0, 180.0], &[100.0, 40.0, 0.0]);
    assert!(remap(&mut turned_over, |c, g| (c, 180.0 - g)));
    assert_reads(&turned_over, &[(0.0, 0.0, 0.0), (0.0, 120.0, 40.0), (0.0, 150.0, 70.0), (0.0, 180.0, 100.0)]);
}

#[test]
fn an_even_table_has_the_flux_of_the_first() {
    let mut even = falling();
    let flux = even.photometry.distribution.flux().value();
    assert!(make_isotropic(&mut even));
    let mean = flux / (4.0 * std::f64::consts::PI);
    assert_reads(&even, &[(0.0, 0.0, mean), (77.0, 90.0, mean), (0.0, 180.0, mean)]);
    assert!((even.photometry.distribution.flux().value() / flux - 1.0).abs() < 1e-9);
}

#[test]
fn planes_are_averaged_by_their_angles_or_by_their_number() {
    let quadrant = of_planes(&[0.0, 30.0, 90.0], &[0.0, 90.0], &[&[100.0; 2], &[60.0; 2], &[30.0; 2]]);
    // (80 * 30 + 45 * 60) / 90; of three planes (100 + 60 + 30) / 3; of nine on the full circle 600 / 9.
    let mut by_angle = quadrant.clone();
    assert!(average_over_c(&mut by_angle));
    assert_reads(&by_angle, &[(0.0, 45.0, 5100.0 / 90.0), (123.0, 45.0, 5100.0 / 90.0)]);
    for (is_full_circle, mean) in [(false, 190.0 / 3.0), (true, 600.0 / 9.0)] {
        let mut by_number = quadrant.clone();
        assert!(average_planes(&mut by_number, is_full_circle) && is_axial(&by_number));
        assert_reads(&by_number, &[(0.0, 45.0, mean), (200.0, 90.0, mean)]);
    }
    assert!(!average_planes(&mut falling(), true) && is_axial(&falling()) && !is_axial(&quadrant));
}

#[test]
fn a_table_continues_beyond_its_ends() {
    let mut short = axial(&[10.0, 90.0], &[50.0, 30.0]);
    assert!(extrapolate(&mut short));
    assert_reads(&short, &[(0.0, 0.0, 50.0), (0.0, 50.0, 40.0), (0.0, 130.0, 30.0), (0.0, 180.0, 30.0)]);
    let mut upper = axial(&[0.0, 90.0], &[50.0, 30.0]);
    assert!(extrapolate(&mut upper));
    assert_reads(&upper, &[(0.0, 0.0, 50.0), (0.0, 170.0, 30.0)]);
    assert!(!extrapolate(&mut axial(&[0.0, 180.0], &[50.0, 30.0])));
}

#[test]
fn one_plane_counts_for_all() {
    let mut one = four_planes();
    assert!(keep_first_plane(&mut one));
    assert_reads(&one, &[(0.0, 50.0, 10.0), (180.0, 50.0, 10.0)]);
    assert!(!keep_first_plane(&mut falling()));
}

#[test]
fn candela_are_raised_as_parts_of_the_largest_or_squared_as_they_are() {
    let mut raised = axial(&[0.0, 45.0, 90.0], &[100.0, 50.0, 0.0]);
    assert!(raise_candela(&mut raised, 2.0));
    assert_reads(&raised, &[(0.0, 0.0, 100.0), (0.0, 45.0, 25.0), (0.0, 90.0, 0.0)]);
    assert!(!raise_candela(&mut axial(&[0.0, 90.0], &[70.0, 70.0]), 2.0));
    let mut squared = axial(&[0.0, 45.0, 90.0], &[10.0, 5.0, 0.0]);
    squared.flux_scale = 0.5;
    assert!(square_candela(&mut squared));
    assert_reads(&squared, &[(0.0, 0.0, 100.0), (0.0, 45.0, 25.0), (0.0, 90.0, 0.0)]);
    assert!((squared.flux_scale - 0.25).abs() < 1e-15);
}

#[test]
fn a_shift_of_gamma_ends_twice_as_far_before_the_table() {
    // 100 (1 - g / 90), ten degrees on: what belongs at 0 stays at 0 to 10, and the last is that of 70.
    let mut later = falling();
    assert!(shift_gamma(&mut later, 10.0));
    let at = |g: f64| 100.0 * (1.0 - g / 90.0);
    assert_reads(&later, &[(0.0, 0.0, 100.0), (0.0, 10.0, 100.0), (0.0, 50.0, at(40.0)), (0.0, 90.0, at(70.0))]);
    let mut earlier = falling();
    assert!(shift_gamma(&mut earlier, -10.0));
    assert_reads(&earlier, &[(0.0, 0.0, at(20.0)), (0.0, 50.0, at(60.0)), (0.0, 80.0, 0.0), (0.0, 90.0, 0.0)]);
    assert!(!shift_gamma(&mut falling(), 45.0) && !shift_gamma(&mut falling(), -45.0));
}

#[test]
fn behind_the_luminaire_planes_may_be_those_of_the_other_side() {
    let mut turned = four_planes();
    assert!(turn_behind(&mut turned));
    assert_reads(&turned, &[(0.0, 80.0, 10.0), (90.0, 90.0, 20.0), (0.0, 100.0, 30.0), (90.0, 180.0, 40.0)]);
    assert!(!turn_behind(&mut axial(&[0.0, 180.0], &[1.0, 1.0])));
    let mut downwards = of_planes(&[0.0, 180.0], &[0.0, 90.0], &[&[1.0; 2], &[2.0; 2]]);
    assert!(!turn_behind(&mut downwards));
}

#[test]
fn angles_may_be_taken_as_even() {
    let uneven =
        of_planes(&[0.0, 30.0, 90.0], &[0.0, 10.0, 90.0], &[&[1.0, 2.0, 3.0], &[4.0, 5.0, 6.0], &[7.0, 8.0, 9.0]]);
    let mut in_gamma = uneven.clone();
    assert!(space_angles_evenly(&mut in_gamma, false, true));
    assert_reads(&in_gamma, &[(0.0, 0.0, 1.0), (0.0, 45.0, 2.0), (30.0, 45.0, 5.0), (90.0, 90.0, 9.0)]);
    // On the full circle there are nine planes, 45 degrees from each other.
    let mut in_c = uneven;
    assert!(space_angles_evenly(&mut in_c, true, false));
    assert_reads(&in_c, &[(0.0, 10.0, 2.0), (45.0, 10.0, 5.0), (90.0, 10.0, 8.0), (135.0, 10.0, 5.0)]);
    assert!(!space_angles_evenly(&mut falling(), true, true));
}

#[test]
fn a_curve_between_two_nodes_takes_the_place_of_a_straight_line() {
    let mut curved = falling();
    assert!(draw_curve(&mut curved, [false, true], |v| v * v));
    assert_reads(&curved, &[(0.0, 0.0, 100.0), (0.0, 45.0, 75.0), (0.0, 67.5, 43.75), (0.0, 90.0, 0.0)]);
    let mut in_c = four_planes();
    assert!(draw_curve(&mut in_c, [true, false], |v| v * v));
    assert_reads(&in_c, &[(0.0, 50.0, 10.0), (45.0, 50.0, 12.5), (315.0, 50.0, 32.5)]);
}

#[test]
fn cubics_pass_through_four_neighbours() {
    // At the middle Catmull and Rom's cubic is (9 (b + c) - a - d) / 16.
    for (beyond, first, last) in [
        (Beyond::Nearest, (9.0 * 150.0 - 100.0 - 20.0) / 16.0, (9.0 * 70.0 - 100.0 - 20.0) / 16.0),
        (Beyond::Dark, (9.0 * 150.0 - 20.0) / 16.0, (9.0 * 70.0 - 100.0) / 16.0),
        // The nadir mirrors the row; nothing follows on 90 degrees.
        (Beyond::Closed, (9.0 * 150.0 - 50.0 - 20.0) / 16.0, (9.0 * 70.0 - 100.0) / 16.0),
    ] {
        let mut bent = axial(&[0.0, 40.0, 90.0], &[100.0, 50.0, 20.0]);
        assert!(draw_cubics(&mut bent, false, beyond));
        assert_reads(
            &bent,
            &[(0.0, 0.0, 100.0), (0.0, 20.0, first), (0.0, 40.0, 50.0), (0.0, 65.0, last), (0.0, 90.0, 20.0)],
        );
    }
    // A quarter of the way: (-9 a + 111 b + 29 c - 3 d) / 128, and no light below zero.
    let mut steep = axial(&[0.0, 80.0, 160.0, 180.0], &[100.0, 0.0, 0.0, 90.0]);
    assert!(draw_cubics(&mut steep, false, Beyond::Closed));
    assert_reads(&steep, &[(0.0, 20.0, 111.0 / 128.0 * 100.0), (0.0, 120.0, 0.0)]);
    // At the zenith the row is mirrored, too: -(0 + 0) + 9 (0 + 90).
    assert_reads(&steep, &[(0.0, 170.0, 9.0 * 90.0 / 16.0)]);
    // Round the circle planes continue with those behind the start.
    let mut round = four_planes();
    assert!(draw_cubics(&mut round, true, Beyond::Closed));
    assert_reads(
        &round,
        &[(45.0, 50.0, (9.0 * 30.0 - 40.0 - 30.0) / 16.0), (315.0, 50.0, (9.0 * 50.0 - 30.0 - 20.0) / 16.0)],
    );
}

#[test]
fn the_last_gamma_may_be_dark() {
    let mut dark = axial(&[0.0, 90.0], &[100.0, 40.0]);
    assert!(darken_last_gamma(&mut dark));
    assert_reads(&dark, &[(0.0, 0.0, 100.0), (0.0, 45.0, 70.0), (0.0, 90.0, 0.0)]);
    let just_before = dark.photometry.distribution.intensity(0.0, 90.0 * (1.0 - 2e-6)).value();
    assert!((just_before - 40.0).abs() < 1e-3, "{just_before}");
}

#[test]
fn radians_may_be_looked_up_as_degrees() {
    let mut radians = axial(&[0.0, 180.0], &[180.0, 0.0]);
    assert!(look_up_radians(&mut radians));
    let pi = std::f64::consts::PI;
    assert_reads(&radians, &[(0.0, 0.0, 180.0), (0.0, 90.0, 180.0 - 0.5 * pi), (0.0, 180.0, 180.0 - pi)]);
    let mut planes = four_planes();
    assert!(look_up_radians(&mut planes));
    // Plane 180 is at 3.1416 degrees, on the way from 10 to 20 cd at 90; plane 360 is plane 0.
    assert_reads(&planes, &[(0.0, 50.0, 10.0), (180.0, 50.0, 10.0 + 10.0 * pi / 90.0), (360.0, 50.0, 10.0)]);
}

#[test]
fn a_neighbour_may_count_for_all_directions_about_it() {
    let table = axial(&[0.0, 40.0, 90.0], &[100.0, 60.0, 20.0]);
    for (neighbour, expected) in [
        (Neighbour::Nearest, [100.0, 60.0, 60.0, 20.0]),
        (Neighbour::Lower, [100.0, 100.0, 60.0, 60.0]),
        (Neighbour::Higher, [60.0, 60.0, 20.0, 20.0]),
    ] {
        let mut stepped = table.clone();
        assert!(take_neighbours(&mut stepped, [false, true], neighbour));
        let places = [19.0, 21.0, 64.0, 66.0].into_iter().zip(expected);
        assert_reads(&stepped, &places.map(|(g, candela)| (0.0, g, candela)).collect::<Vec<_>>());
        // The last node is its own.
        assert_reads(&stepped, &[(0.0, 90.0, 20.0), (0.0, 0.0, 100.0)]);
    }
    let mut in_c = four_planes();
    assert!(take_neighbours(&mut in_c, [true, false], Neighbour::Lower));
    assert_reads(&in_c, &[(89.0, 50.0, 10.0), (91.0, 50.0, 20.0), (359.0, 50.0, 40.0)]);
}

#[test]
fn nodes_may_be_moved_by_whole_and_half_steps() {
    let table = axial(&[0.0, 30.0, 90.0], &[100.0, 60.0, 0.0]);
    let mut by_one = table.clone();
    assert!(move_nodes(&mut by_one, [false, true], 1.0));
    assert_reads(&by_one, &[(0.0, 0.0, 60.0), (0.0, 15.0, 30.0), (0.0, 30.0, 0.0), (0.0, 90.0, 0.0)]);
    let mut by_half = table.clone();
    assert!(move_nodes(&mut by_half, [false, true], 0.5));
    assert_reads(&by_half, &[(0.0, 0.0, 80.0), (0.0, 15.0, 60.0), (0.0, 30.0, 30.0), (0.0, 90.0, 0.0)]);
    let mut back = table.clone();
    assert!(move_nodes(&mut back, [false, true], -1.0));
    assert_reads(&back, &[(0.0, 0.0, 100.0), (0.0, 30.0, 100.0), (0.0, 60.0, 80.0), (0.0, 90.0, 60.0)]);
    assert!(!move_nodes(&mut table.clone(), [true, false], 1.0));
    let mut in_c = four_planes();
    assert!(move_nodes(&mut in_c, [true, false], 1.0));
    assert_reads(&in_c, &[(0.0, 50.0, 20.0), (90.0, 50.0, 30.0), (270.0, 50.0, 10.0)]);
}

#[test]
fn candela_may_be_interpolated_by_logarithms_or_by_cosines() {
    let mut logarithmic = axial(&[0.0, 40.0, 80.0], &[100.0, 1.0, 0.0]);
    assert!(interpolate_by_logarithm(&mut logarithmic));
    let quarter = 100_f64.powf(0.75);
    assert_reads(
        &logarithmic,
        &[(0.0, 0.0, 100.0), (0.0, 10.0, quarter), (0.0, 20.0, 10.0), (0.0, 40.0, 1.0), (0.0, 60.0, 0.0)],
    );
    let mut cosine = falling();
    assert!(interpolate_by_cosine(&mut cosine));
    let at_45 = 100.0 * 0.5_f64.sqrt();
    assert_reads(&cosine, &[(0.0, 0.0, 100.0), (0.0, 45.0, at_45), (0.0, 90.0, 0.0)]);
}

#[test]
fn another_gamma_may_be_looked_up_and_lie_beyond_the_table() {
    let table = axial(&[0.0, 90.0], &[100.0, 10.0]);
    for (end, at_50) in [(EndOfGamma::Dark, 0.0), (EndOfGamma::WithinSphere, 0.0), (EndOfGamma::WithinTable, 10.0)] {
        let mut twice = table.clone();
        assert!(read_other_gamma(&mut twice, 2.0, 10.0, end));
        assert_reads(&twice, &[(0.0, 0.0, 90.0), (0.0, 30.0, 30.0), (0.0, 40.0, 10.0), (0.0, 50.0, at_50)]);
    }
    let whole = axial(&[0.0, 180.0], &[200.0, 20.0]);
    for (end, at_0, at_100) in
        [(EndOfGamma::Dark, 0.0, 40.0), (EndOfGamma::WithinSphere, 200.0, 40.0), (EndOfGamma::WithinTable, 200.0, 40.0)]
    {
        let mut off = whole.clone();
        assert!(read_other_gamma(&mut off, 2.0, -40.0, end));
        assert_reads(&off, &[(0.0, 0.0, at_0), (0.0, 20.0, 200.0), (0.0, 100.0, at_100)]);
    }
}

#[test]
fn rounding_does_not_lead_out_of_a_table() {
    // 85 / 1.2 * 1.2 is a bit more than 85.
    let mut wide = axial(&[0.0, 85.0], &[100.0, 15.0]);
    assert!(read_other_gamma(&mut wide, 1.2, 0.0, EndOfGamma::Dark));
    assert_reads(&wide, &[(0.0, 0.0, 100.0), (0.0, 85.0 / 1.2, 15.0), (0.0, 71.0, 0.0)]);
}

#[test]
fn a_power_of_the_cosine_may_be_a_factor() {
    let even = axial(&[0.0, 60.0, 120.0, 180.0], &[10.0; 4]);
    for (is_dark_behind, at_120) in [(false, 2.5), (true, 0.0)] {
        let mut squared = even.clone();
        assert!(multiply_by_cosine(&mut squared, 2.0, is_dark_behind));
        assert_reads(&squared, &[(0.0, 0.0, 10.0), (0.0, 60.0, 2.5), (0.0, 120.0, at_120)]);
    }
    let mut divided = even;
    assert!(multiply_by_cosine(&mut divided, -1.0, false));
    // A cosine of a thousandth at least.
    assert_reads(&divided, &[(0.0, 60.0, 20.0), (0.0, 90.0, 10_000.0), (0.0, 120.0, 20.0)]);
}

#[test]
fn planes_beyond_the_last_may_be_dark_the_last_or_repeated() {
    let quadrant = of_planes(&[0.0, 90.0], &[0.0, 90.0], &[&[100.0; 2], &[50.0; 2]]);
    for (end, at_135, at_200) in [
        (EndOfPlanes::Dark, 0.0, 0.0),
        (EndOfPlanes::Last, 50.0, 50.0),
        (EndOfPlanes::Repeated, 75.0, 100.0 - 50.0 * 20.0 / 90.0),
    ] {
        let mut continued = quadrant.clone();
        assert!(continue_planes(&mut continued, end));
        let found =
            [0.0, 45.0, 90.0, 135.0, 200.0].map(|c| continued.photometry.distribution.intensity(c, 45.0).value());
        let expected = [100.0, 75.0, 50.0, at_135, at_200];
        assert!(found.iter().zip(expected).all(|(f, e)| (f - e).abs() < 1e-3), "{end:?}: {found:?}");
    }
    assert!(
        !continue_planes(&mut falling(), EndOfPlanes::Dark) && !continue_planes(&mut four_planes(), EndOfPlanes::Dark)
    );
}
