//! Tables of types A and B: their angles, flux, sampling and type C approximation.

use std::f64::consts::PI;

use glam::DVec3;

use super::*;
use crate::choose_by_run;
use crate::{DirectionSampler, Photometry, TypeCLimits, lm63};

/// Whole angles in steps between two limits.
fn every(step: i32, first: i32, last: i32) -> Vec<f64> {
    (0..=(last - first) / step).map(|k| f64::from(first + step * k)).collect()
}

/// The direction of the angles of a file, by the definition of LM-63-02.
fn direction_of(kind: Goniometer, h: f64, v: f64) -> DVec3 {
    let ((sh, ch), (sv, cv)) = (h.to_radians().sin_cos(), v.to_radians().sin_cos());
    match kind {
        Goniometer::B => DVec3::new(ch * sv, -sh, -ch * cv),
        _ => DVec3::new(cv * ch, -cv * sh, sv),
    }
}

/// Numbers separated by blanks.
fn join(numbers: &[f64]) -> String {
    numbers.iter().map(f64::to_string).collect::<Vec<_>>().join(" ")
}

/// A file of type A or B, and its photometry.
fn file(kind: Goniometer, h: &[f64], v: &[f64], of: impl Fn(f64, f64) -> f64) -> (String, Photometry) {
    let number = if kind == Goniometer::A { 3 } else { 2 };
    let mut text = format!("IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 {} {} {number} 2 0 0 0\n1 1 0\n", v.len(), h.len());
    text += &format!("{}\n{}\n", join(v), join(h));
    for &h in h {
        text += &format!("{}\n", join(&v.iter().map(|v| of(h, *v)).collect::<Vec<_>>()));
    }
    let read = lm63::parse(text.as_bytes()).unwrap();
    (text, read)
}

/// The end of the interval that contains an angle.
fn interval_end(angles: &[f64], x: f64) -> Option<usize> {
    (1..angles.len()).find(|k| x <= angles[*k] && x >= angles[k - 1])
}

/// Plain bilinear interpolation in the angles of a file, mirrored where the horizontal angles begin at 0.
fn by_hand(h: &[f64], v: &[f64], of: &impl Fn(f64, f64) -> f64, at: [f64; 2]) -> f64 {
    let [x, y] = [if h[0] == 0.0 { at[0].abs() } else { at[0] }, at[1]];
    let (Some(i), Some(j)) = (interval_end(h, x), interval_end(v, y)) else { return 0.0 };
    let (s, t) = ((x - h[i - 1]) / (h[i] - h[i - 1]), (y - v[j - 1]) / (v[j] - v[j - 1]));
    let [before, after] = [h[i - 1], h[i]].map(|h| (1.0 - t) * of(h, v[j - 1]) + t * of(h, v[j]));
    (1.0 - s) * before + s * after
}

/// The middle and width of equal parts of every interval.
fn middles_of_parts(angles: &[f64], parts: usize) -> Vec<(f64, f64)> {
    let mut middles = vec![];
    for w in angles.windows(2) {
        let (from, step) = (w[0], (w[1] - w[0]) / parts as f64);
        middles.extend((0..parts).map(|k| (from + step * (k as f64 + 0.5), step)));
    }
    middles
}

/// Flux by midpoints of many small parts of every cell, in lumens, within a zone of gamma.
fn by_parts(
    kind: Goniometer,
    table: &LuminousIntensityDistribution,
    parts: usize,
    within: impl Fn(DVec3) -> bool,
) -> f64 {
    let mut sum = 0.0;
    for (c, dc) in middles_of_parts(table.c_deg(), parts) {
        for (g, dg) in middles_of_parts(table.gamma_deg(), parts) {
            let (h, v) = if kind == Goniometer::A { (-c, g - 90.0) } else { (g - 90.0, c) };
            let d = direction_of(kind, h, v);
            if within(d) {
                let half = 0.5 * dg;
                let solid = ((g - half).to_radians().cos() - (g + half).to_radians().cos()) * dc.to_radians();
                sum += table.intensity_towards(d).value() * solid;
            }
        }
    }
    sum
}

type Angles = (Vec<f64>, Vec<f64>);

type Values = Box<dyn Fn(f64, f64) -> f64>;

/// Light without symmetry.
fn lopsided(h: f64, v: f64) -> f64 {
    500.0 + 3.0 * h + 2.0 * v + 0.01 * h * v
}

/// A narrow beam at V 20.
fn beam(h: f64, v: f64) -> f64 {
    1e5 * (-(h * h + (v - 20.0) * (v - 20.0)) / 8.0).exp()
}

/// A wide symmetric beam.
fn smooth(h: f64, v: f64) -> f64 {
    1000.0 * (h.to_radians().cos() * v.to_radians().cos()).max(0.0).powi(3)
}

/// Floodlights of many kinds: lopsided, fine, of few angles, narrow, ending in light, halves.
fn tables() -> Vec<(Angles, Values)> {
    let uneven = vec![-81.5, -40.25, -13.1, -2.7, 0.0, 1.3, 22.9, 63.7];
    vec![
        ((uneven.clone(), every(10, -60, 70)), Box::new(lopsided)),
        ((every(4, -88, 88), every(4, -88, 88)), Box::new(smooth)),
        ((every(2, -90, 90), every(2, -90, 90)), Box::new(smooth)),
        ((vec![0.0, 90.0], vec![0.0, 90.0]), Box::new(|h, v| 100.0 + h - 0.5 * v)),
        ((vec![-20.0, 15.0], vec![-10.0, 40.0]), Box::new(lopsided)),
        ((every(1, -12, 12), every(1, 0, 40)), Box::new(beam)),
        ((every(5, 0, 80), uneven), Box::new(lopsided)),
    ]
}

/// The angles, and a point within each interval.
fn with_inner_points(angles: &[f64]) -> Vec<f64> {
    let starts = angles.windows(2).flat_map(|w| [w[0], w[0] + 0.3 * (w[1] - w[0])]);
    starts.chain(angles.last().copied()).collect()
}

#[test]
fn the_distribution_is_bilinear_in_the_angles_of_the_file() {
    for kind in [Goniometer::A, Goniometer::B] {
        for ((h, v), of) in tables() {
            let (_, read) = file(kind, &h, &v, &of);
            let table = &read.distribution;
            let peak = table.max_intensity().value();
            let mut off = 0.0_f64;
            for &x in &with_inner_points(&h) {
                for &y in &with_inner_points(&v) {
                    for x in if h[0] == 0.0 { vec![x, -x] } else { vec![x] } {
                        let found = table.intensity_towards(direction_of(kind, x, y)).value();
                        let is_pole = if kind == Goniometer::A { y.abs() == 90.0 } else { x.abs() == 90.0 };
                        if !is_pole {
                            off = off.max((found - by_hand(&h, &v, &of, [x, y])).abs());
                        }
                    }
                }
            }
            assert!(off <= 1e-12 * peak, "{kind:?} {off:e} of {peak}");
            let beyond = direction_of(kind, h[h.len() - 1] + 0.01, v[0]);
            if h[h.len() - 1] < 89.0 {
                assert_eq!(table.intensity_towards(beyond).value(), 0.0);
            }
        }
    }
}

#[test]
fn flux_is_exact_whole_and_in_zones_of_gamma() {
    for kind in [Goniometer::A, Goniometer::B] {
        for (k, ((h, v), of)) in tables().into_iter().enumerate() {
            let (_, read) = file(kind, &h, &v, &of);
            let table = &read.distribution;
            // Romberg: the error of midpoints is a series of even powers of the step.
            let least = if h.len() * v.len() > 1000 { 4 } else { 16 };
            let [a, b, c] = [1, 2, 4].map(|n| by_parts(kind, table, n * least, |_| true));
            let [ab, bc] = [b + (b - a) / 3.0, c + (c - b) / 3.0];
            let exact = bc + (bc - ab) / 15.0;
            let flux = table.flux().value();
            assert!((flux / exact - 1.0).abs() < 1e-9, "{kind:?} {k}: {flux} {exact}");
            let zones: f64 = every(10, 0, 180).windows(2).map(|z| table.flux_between(z[0], z[1]).value()).sum();
            assert!((zones / flux - 1.0).abs() < 1e-11, "{kind:?} {k}: {zones} {flux}");
            let cells = ((table.c_deg().len() - 1) * (table.gamma_deg().len() - 1)) as f64;
            let least = (400.0 / cells.sqrt()).ceil() as usize;
            for cone in [7.3, 33.0, 88.0, 90.0, 117.0] {
                let found = table.flux_between(0.0, cone).value();
                let within = by_parts(kind, table, least, |d| -d.z >= cone.to_radians().cos());
                assert!((found - within).abs() < 4e-3 * flux, "{kind:?} {k} {cone}: {found} {within}");
            }
        }
    }
}

#[test]
fn zones_of_gamma_of_even_light_are_caps_and_halves_of_them() {
    let (_, read) = file(Goniometer::B, &[-90.0, 10.0, 90.0], &[-180.0, -31.0, 5.0, 77.0, 180.0], |_, _| 100.0);
    let even = &read.distribution;
    for cone in [1e-3_f64, 5.0, 60.0, 89.999, 90.0, 120.0, 179.0, 180.0] {
        let cap = 2.0 * PI * 100.0 * 2.0 * (0.5 * cone.to_radians()).sin().powi(2);
        let found = even.flux_between(0.0, cone).value();
        assert!((found - cap).abs() < 1e-12 * 4.0 * PI * 100.0, "{cone}: {found} {cap}");
    }
    for forward in [0.0, 90.0, 180.0, 270.0] {
        let zones = even.classification_zones(forward);
        for (a, b) in zones.forward.iter().zip(&zones.back) {
            assert!((a.value() / b.value() - 1.0).abs() < 1e-10);
        }
    }
    let (_, read) = file(Goniometer::B, &[-90.0, 90.0], &[-90.0, 0.0, 90.0], |h, v| 150.0 + v + 0.5 * h);
    let [forward, side] = [0.0, 90.0].map(|c| {
        let zones = read.distribution.classification_zones(c);
        let [forward, back] =
            [zones.forward, zones.back].map(|zones| zones.map(crate::units::Lumen::value).iter().sum::<f64>());
        (forward, back)
    });
    assert!(forward.0 > 1.5 * forward.1 && side.0 < side.1, "{forward:?} {side:?}");
    let flux = read.distribution.flux().value();
    assert!(((forward.0 + forward.1) / flux - 1.0).abs() < 1e-11 && ((side.0 + side.1) / flux - 1.0).abs() < 1e-11);
}

#[test]
fn sampled_directions_have_the_density_of_the_light() {
    for kind in [Goniometer::A, Goniometer::B] {
        for (k, ((h, v), of)) in tables().into_iter().enumerate() {
            let table = file(kind, &h, &v, &of).1.distribution;
            let sampler = DirectionSampler::new(&table).unwrap();
            let flux = table.flux().value();
            assert!((sampler.flux().value() / flux - 1.0).abs() < 1e-12);
            let (count, mut inside) = (20_000, 0);
            for k in 0..count {
                let u = (f64::from(k) + 0.5) / f64::from(count);
                let drawn = sampler.sample([u, (f64::from(k) * 0.754_877_666).fract()]);
                let density = table.intensity_towards(drawn.direction).value() / flux;
                assert!((density - drawn.density).abs() <= 1e-9 * table.max_intensity().value() / flux);
                inside += i32::from(drawn.direction.dot(DVec3::new(0.3, -0.5, -0.81)) > 0.9);
            }
            let share = by_parts(kind, &table, 12, |d| d.dot(DVec3::new(0.3, -0.5, -0.81)) > 0.9) / flux;
            assert!((f64::from(inside) / f64::from(count) - share).abs() < 0.01, "{kind:?} {k}");
        }
    }
}

/// Light that is symmetric in H and V.
fn even(h: f64, v: f64) -> f64 {
    300.0 - h.abs() - v.abs()
}

/// Light that is symmetric in H alone.
fn tilted(h: f64, v: f64) -> f64 {
    300.0 - h.abs() + v
}

/// Light without a mirror.
fn skew(h: f64, v: f64) -> f64 {
    300.0 + h + v
}

#[test]
fn mirrors_are_exact_and_detected_in_the_values() {
    let (whole, half) = (every(10, -80, 80), every(10, 0, 80));
    for (kind, h, of, expected) in [
        (Goniometer::B, &half, &even as &dyn Fn(f64, f64) -> f64, Symmetry::Quadrant),
        (Goniometer::B, &whole, &even, Symmetry::Quadrant),
        (Goniometer::B, &half, &tilted, Symmetry::BilateralC0),
        (Goniometer::B, &whole, &|h, v| tilted(v, h), Symmetry::BilateralC90),
        (Goniometer::B, &whole, &skew, Symmetry::None),
        (Goniometer::A, &half, &even, Symmetry::BilateralC0),
        (Goniometer::A, &whole, &skew, Symmetry::None),
    ] {
        let table = file(kind, h, &whole, of).1.distribution;
        assert_eq!(table.symmetry(), expected, "{kind:?}");
        assert_eq!(table.detected_symmetry(1e-12), expected, "{kind:?}");
        let image = table.mirrored();
        for d in table.node_directions() {
            let there = d * DVec3::new(-1.0, 1.0, 1.0);
            let (a, b) = (table.intensity_towards(d).value(), image.intensity_towards(there).value());
            assert!((a - b).abs() < 1e-9, "{kind:?} {d}: {a} {b}");
        }
    }
}

#[test]
fn a_single_horizontal_angle_applies_to_all_from_minus_90_to_90() {
    let (_, a) = file(Goniometer::A, &[30.0], &[-90.0, 0.0, 45.0], |_, v| 100.0 + v);
    // The range of LM-63 is -90 to 90; behind it is dark.
    for (h, expected) in [(-85.0, 100.0), (0.0, 100.0), (30.0, 100.0), (149.0, 0.0)] {
        let found = a.distribution.intensity_towards(direction_of(Goniometer::A, h, 0.0)).value();
        assert!((found - expected).abs() < 1e-9, "{h}: {found}");
    }
    let (_, b) = file(Goniometer::B, &[30.0], &[-60.0, 0.0, 45.0], |_, v| 100.0 + v);
    for h in [-85.0, 0.0, 30.0] {
        let found = b.distribution.intensity_towards(direction_of(Goniometer::B, h, 20.0)).value();
        assert!((found - 120.0).abs() < 1e-9, "{h}: {found}");
    }
    for read in [a, b] {
        assert!(read.lints.iter().any(|l| l.code == "planes/single"));
    }
}

/// The jump of a type B table at angles of the file.
fn jump(table: &LuminousIntensityDistribution, h: f64, v: f64) -> f64 {
    table.jump_towards(direction_of(Goniometer::B, h, v)).value()
}

#[test]
fn a_table_that_ends_in_light_jumps_where_rounding_decides() {
    let table = file(Goniometer::B, &[-20.0, 15.0], &[-10.0, 40.0], |_, _| 100.0).1.distribution;
    assert_eq!(table.edge_intensity().value(), 100.0);

    for (h, v) in [(-20.0, 3.0), (15.0, 3.0), (0.0, -10.0), (0.0, 40.0), (15.0, 40.0)] {
        assert_eq!(jump(&table, h, v), 100.0, "{h} {v}");
        assert_eq!(table.intensity_towards(direction_of(Goniometer::B, h, v)).value(), 100.0);
    }
    for (h, v) in [(0.0, 0.0), (-20.1, 3.0), (0.0, 50.0), (60.0, -10.0), (14.9, 39.9)] {
        assert_eq!(jump(&table, h, v), 0.0, "{h} {v}");
    }
    for (d, is_there) in [((0.0, 0.0), true), ((-20.1, 0.0), false), ((0.0, 40.1), false), ((0.0, 179.0), false)] {
        assert_eq!(table.covers(direction_of(Goniometer::B, d.0, d.1)), is_there);
    }
    assert!(table.is_dark_above(crate::units::Candela(0.0)));
}

#[test]
fn a_turned_luminaire_shines_as_its_upright_table() {
    for ((h, v), of) in tables() {
        let table = file(Goniometer::B, &h, &v, &of).1.distribution;
        let upright = table.upright();
        let stand_in = upright.in_type_c();
        assert_eq!((stand_in.largest_error_cd, stand_in.misled_share), (0.0, 0.0));
        assert_eq!(stand_in.distribution.goniometer(), Goniometer::C);
        let frame = table.own_frame();
        // Skip the directions at which the planes disagree.
        for d in table.node_directions().filter(|d| table.jump_towards(*d).value() == 0.0) {
            let (own, found) = (table.intensity_towards(d).value(), upright.intensity_towards(frame.transpose() * d));
            assert!((own - found.value()).abs() <= 1e-9 * table.max_intensity().value());
            // A point inside the table, away from the edges of the approximation.
            let inside = d.lerp(table.own_direction(0.5 * (v[0] + v[1]), 90.0 + h[h.len() - 2]), 0.01).normalize();
            let near = table.intensity_towards(inside).value();
            let made = stand_in.distribution.intensity_towards(frame.transpose() * inside).value();
            if near > 0.0 && table.covers(inside) {
                assert!((near - made).abs() <= 1e-9 * table.max_intensity().value(), "{near} {made}");
            }
        }
    }
}

#[test]
fn a_sector_that_begins_at_c_0_is_dark_there_once_it_is_turned() {
    // The planes of type A are horizontal angles, those of type B vertical ones.
    for (kind, h, v) in [
        (Goniometer::A, [-90.0, -30.0, 0.0], [-20.0, 0.0, 60.0]),
        (Goniometer::B, [-60.0, 0.0, 90.0], [0.0, 30.0, 90.0]),
    ] {
        let table = file(kind, &h, &v, |h, v| 300.0 + h + 2.0 * v).1.distribution;
        let (turned, frame) = table.about_the_vertical();
        let made = turned.in_type_c().distribution;
        assert_eq!(made.intensity(0.0, 90.0).value(), 0.0);
        for d in [(-1.0, 3.0), (-44.0, 50.0), (-25.0, 0.5), (3.0, 20.0), (-80.0, -10.0), (80.0, 85.0)] {
            let d = direction_of(kind, d.0, d.1);
            let (own, found) =
                (table.intensity_towards(d).value(), made.intensity_towards(frame.transpose() * d).value());
            assert!((own - found).abs() < 1e-9, "{kind:?} {d}: {own} {found}");
        }
    }
}

#[test]
fn an_approximation_by_type_c_meets_its_limits_and_states_its_errors() {
    for (k, ((h, v), of)) in tables().into_iter().enumerate() {
        let table = file(Goniometer::B, &h, &v, &of).1.distribution;
        let mut before = f64::INFINITY;
        for most_values in [300, 3_000, 30_000] {
            let limits = TypeCLimits { most_planes: 250, most_values, ..TypeCLimits::default() };
            let made = table.in_type_c_within(limits);
            let values = made.distribution.c_deg().len() * made.distribution.gamma_deg().len();
            let planes = made.distribution.full_circle().c_deg().len();
            assert!(planes <= 250 && values <= most_values.max(700), "{k}: {planes} planes, {values} values");
            let flux = (made.distribution.flux() / table.flux() - 1.0).abs();
            assert!(flux <= 1.5 * made.misled_share + 1e-12, "{k}: {flux} {}", made.misled_share);
            assert!(made.misled_share < before, "{k}: {} {before}", made.misled_share);
            before = made.misled_share;
        }
        assert!(before < 0.02, "{k}: {before}");
    }
}

#[test]
fn a_table_of_type_b_that_type_c_can_hold_is_met_to_the_error_asked_for() {
    let (h, v) = (every(1, -90, 90), every(1, -180, 180));
    let (_, read) = file(Goniometer::B, &h, &v, |h, v| 100.0 + 10.0 * (h.to_radians().cos() * v.to_radians().cos()));
    let table = read.distribution;
    let limits = TypeCLimits { relative_error: 1e-3, ..TypeCLimits::default() };
    let made = table.in_type_c_within(limits);
    assert!(made.largest_error_cd <= 1.5e-3 * 110.0, "{}", made.largest_error_cd);
    assert!(made.distribution.c_deg().len() * made.distribution.gamma_deg().len() < 5_000);
}

#[test]
fn lm63_and_tm33_lose_nothing_and_eulumdat_is_at_most_twenty_times_as_long() {
    for kind in [Goniometer::A, Goniometer::B] {
        // Of two tables that differ in fineness alone, the coarser.
        for (k, ((h, v), of)) in tables().into_iter().enumerate().filter(|(k, _)| *k != choose_by_run(usize::MAX, 2)) {
            let (text, read) = file(kind, &h, &v, &of);
            let written = lm63::write_2002(&read);
            assert_eq!(written.losses, Vec::<String>::new(), "{kind:?} {k}");
            assert!(written.text.len() <= 2 * text.len());
            let written = super::tm33::write(&Photometry { details: super::Details::None, ..read.clone() });
            assert_eq!(written.losses, Vec::<String>::new(), "{kind:?} {k}");
            let again = super::tm33::parse(written.text.as_bytes()).unwrap();
            assert_eq!(again.distribution, read.distribution);
            let source = vec![super::SourceFile { name: "a.ies".into(), bytes: text.as_bytes().into() }];
            let written = super::eulumdat::write(&Photometry { source, ..read.clone() });
            assert!(
                written.text.len() <= 20 * text.len().max(200),
                "{kind:?} {k}: {} of {}",
                written.text.len(),
                text.len()
            );
            assert!(
                written.losses.iter().any(|l| l.contains("became") && l.contains("of the flux")),
                "{:?}",
                written.losses
            );
            let again = super::eulumdat::parse(written.text.as_bytes()).unwrap();
            let off = (again.distribution.flux() / read.distribution.flux() - 1.0).abs();
            let (_, share) = read.distribution.difference_from(&again.distribution);
            assert!(off <= 1.2 * share + 1e-5 && share < 0.3, "{kind:?} {k}: {off} {share}");
        }
    }
}

#[test]
fn at_the_pole_of_a_sector_rounding_decides_between_its_light_and_darkness() {
    let (_, read) = file(Goniometer::A, &[0.0, 90.0], &[-90.0, 90.0], |_, _| 100.0);
    for pole in [DVec3::NEG_Z, DVec3::Z] {
        assert_eq!(read.distribution.jump_towards(pole).value(), 100.0, "{pole}");
    }
    assert_eq!(read.distribution.jump_towards(DVec3::X).value(), 0.0);
}
