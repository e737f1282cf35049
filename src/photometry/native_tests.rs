//! Tables of types A and B: read in their own angles, exact at every node, in their flux and in what stands for them.

use std::f64::consts::PI;

use glam::DVec3;

use super::*;
use crate::by_night;
use crate::photometry::{DirectionSampler, Photometry, TypeCLimits, lm63};

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

/// A file of type A or B, and it read.
fn file(kind: Goniometer, h: &[f64], v: &[f64], of: impl Fn(f64, f64) -> f64) -> (String, Photometry) {
    let words = |all: &[f64]| all.iter().map(f64::to_string).collect::<Vec<_>>().join(" ");
    let number = if kind == Goniometer::A { 3 } else { 2 };
    let mut text = format!("IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 {} {} {number} 2 0 0 0\n1 1 0\n", v.len(), h.len());
    text += &format!("{}\n{}\n", words(v), words(h));
    for &h in h {
        text += &format!("{}\n", words(&v.iter().map(|v| of(h, *v)).collect::<Vec<_>>()));
    }
    let read = lm63::parse(text.as_bytes()).unwrap();
    (text, read)
}

/// Bilinear in a file's angles as one would write it down, mirrored where the horizontal angles begin at 0.
fn by_hand(h: &[f64], v: &[f64], of: &impl Fn(f64, f64) -> f64, at: [f64; 2]) -> f64 {
    let [x, y] = [if h[0] == 0.0 { at[0].abs() } else { at[0] }, at[1]];
    let place = |all: &[f64], x: f64| (1..all.len()).find(|k| x <= all[*k] && x >= all[k - 1]);
    let (Some(i), Some(j)) = (place(h, x), place(v, y)) else { return 0.0 };
    let (s, t) = ((x - h[i - 1]) / (h[i] - h[i - 1]), (y - v[j - 1]) / (v[j] - v[j - 1]));
    let row = |i: usize| (1.0 - t) * of(h[i], v[j - 1]) + t * of(h[i], v[j]);
    (1.0 - s) * row(i - 1) + s * row(i)
}

/// Flux by midpoints of many small parts of every cell, in lumens, within a zone of gamma.
fn by_parts(
    kind: Goniometer,
    table: &LuminousIntensityDistribution,
    parts: usize,
    within: impl Fn(DVec3) -> bool,
) -> f64 {
    let fine = |angles: &[f64]| -> Vec<(f64, f64)> {
        let of_cell = |w: &[f64]| {
            let (from, step) = (w[0], (w[1] - w[0]) / parts as f64);
            (0..parts).map(move |k| (from + step * (k as f64 + 0.5), step)).collect::<Vec<_>>()
        };
        angles.windows(2).flat_map(of_cell).collect()
    };
    let mut sum = 0.0;
    for (c, dc) in fine(table.c_deg()) {
        for (g, dg) in fine(table.gamma_deg()) {
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

/// Floodlights of many kinds: lopsided, fine, of few angles, narrow, ending in light, halves.
fn tables() -> Vec<(Angles, Values)> {
    let uneven = vec![-81.5, -40.25, -13.1, -2.7, 0.0, 1.3, 22.9, 63.7];
    let lopsided = |h: f64, v: f64| 500.0 + 3.0 * h + 2.0 * v + 0.01 * h * v;
    let beam = |h: f64, v: f64| 1e5 * (-(h * h + (v - 20.0) * (v - 20.0)) / 8.0).exp();
    let smooth = |h: f64, v: f64| 1000.0 * (h.to_radians().cos() * v.to_radians().cos()).max(0.0).powi(3);
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

#[test]
fn what_is_read_is_bilinear_in_the_angles_of_the_file() {
    for kind in [Goniometer::A, Goniometer::B] {
        for ((h, v), of) in tables() {
            let (_, read) = file(kind, &h, &v, &of);
            let table = &read.distribution;
            let peak = table.max_intensity().value();
            let mut off = 0.0_f64;
            let middles = |all: &[f64]| {
                all.windows(2)
                    .flat_map(|w| [w[0], w[0] + 0.3 * (w[1] - w[0])])
                    .chain(all.last().copied())
                    .collect::<Vec<_>>()
            };
            for &x in &middles(&h) {
                for &y in &middles(&v) {
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
            // Romberg: the error of midpoints goes with even powers of the step.
            let parts = |n: usize| by_parts(kind, table, n, |_| true);
            let least = if h.len() * v.len() > 1000 { 4 } else { 16 };
            let [a, b, c] = [1, 2, 4].map(|n| parts(n * least));
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
        let sum = |of: &[crate::units::Lumen; 4]| of.iter().map(|f| f.value()).sum::<f64>();
        (sum(&zones.forward), sum(&zones.back))
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

#[test]
fn mirrors_are_told_exactly_and_seen_in_the_values() {
    let (whole, half) = (every(10, -80, 80), every(10, 0, 80));
    let even = |h: f64, v: f64| 300.0 - h.abs() - v.abs();
    let tilted = |h: f64, v: f64| 300.0 - h.abs() + v;
    let skew = |h: f64, v: f64| 300.0 + h + v;
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
fn a_single_horizontal_angle_stands_for_all() {
    let (_, a) = file(Goniometer::A, &[30.0], &[-90.0, 0.0, 45.0], |_, v| 100.0 + v);
    assert_eq!(a.distribution.symmetry(), Symmetry::Axial);
    assert!((a.distribution.intensity(211.0, 90.0).value() - 100.0).abs() < 1e-12);
    let (_, b) = file(Goniometer::B, &[30.0], &[-60.0, 0.0, 45.0], |_, v| 100.0 + v);
    for h in [-85.0, 0.0, 30.0] {
        let found = b.distribution.intensity_towards(direction_of(Goniometer::B, h, 20.0)).value();
        assert!((found - 120.0).abs() < 1e-9, "{h}: {found}");
    }
    for read in [a, b] {
        assert!(read.lints.iter().any(|l| l.code == "planes/single"));
    }
}

#[test]
fn a_table_that_ends_in_light_says_where_rounding_decides() {
    let table = file(Goniometer::B, &[-20.0, 15.0], &[-10.0, 40.0], |_, _| 100.0).1.distribution;
    assert_eq!(table.edge_intensity().value(), 100.0);
    let jump = |h: f64, v: f64| table.jump_towards(direction_of(Goniometer::B, h, v)).value();
    for (h, v) in [(-20.0, 3.0), (15.0, 3.0), (0.0, -10.0), (0.0, 40.0), (15.0, 40.0)] {
        assert_eq!(jump(h, v), 100.0, "{h} {v}");
        assert_eq!(table.intensity_towards(direction_of(Goniometer::B, h, v)).value(), 100.0);
    }
    for (h, v) in [(0.0, 0.0), (-20.1, 3.0), (0.0, 50.0), (60.0, -10.0), (14.9, 39.9)] {
        assert_eq!(jump(h, v), 0.0, "{h} {v}");
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
        // Where planes meet, this one says one thing in each of them.
        for d in table.node_directions().filter(|d| table.jump_towards(*d).value() == 0.0) {
            let (own, found) = (table.intensity_towards(d).value(), upright.intensity_towards(frame.transpose() * d));
            assert!((own - found.value()).abs() <= 1e-9 * table.max_intensity().value());
            // Inside, off the ramps that stand for its ends.
            let inside = d.lerp(table.own_direction(0.5 * (v[0] + v[1]), 90.0 + h[h.len() - 2]), 0.01).normalize();
            let near = table.intensity_towards(inside).value();
            let told = stand_in.distribution.intensity_towards(frame.transpose() * inside).value();
            if near > 0.0 && table.covers(inside) {
                assert!((near - told).abs() <= 1e-9 * table.max_intensity().value(), "{near} {told}");
            }
        }
    }
}

#[test]
fn a_sector_that_begins_at_c_0_is_dark_there_once_it_is_turned() {
    let of = |h: f64, v: f64| 300.0 + h + 2.0 * v;
    // Planes are those of a horizontal angle in type A, of a vertical one in type B.
    for (kind, h, v) in [
        (Goniometer::A, [-90.0, -30.0, 0.0], [-20.0, 0.0, 60.0]),
        (Goniometer::B, [-60.0, 0.0, 90.0], [0.0, 30.0, 90.0]),
    ] {
        let table = file(kind, &h, &v, of).1.distribution;
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
fn a_stand_in_of_type_c_keeps_to_its_limits_and_says_how_far_it_is_off() {
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
    let of = |h: f64, v: f64| 100.0 + 10.0 * (h.to_radians().cos() * v.to_radians().cos());
    let table = file(Goniometer::B, &every(1, -90, 90), &every(1, -180, 180), of).1.distribution;
    let limits = TypeCLimits { relative_error: 1e-3, ..TypeCLimits::default() };
    let made = table.in_type_c_within(limits);
    assert!(made.largest_error_cd <= 1.5e-3 * 110.0, "{}", made.largest_error_cd);
    assert!(made.distribution.c_deg().len() * made.distribution.gamma_deg().len() < 5_000);
}

#[test]
fn what_is_written_as_lm63_is_read_back_whole_and_eulumdat_keeps_to_twenty_times() {
    for kind in [Goniometer::A, Goniometer::B] {
        // Of two tables that differ in fineness alone, the coarser.
        for (k, ((h, v), of)) in tables().into_iter().enumerate().filter(|(k, _)| *k != by_night(usize::MAX, 2)) {
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
            let (_, told) = read.distribution.difference_from(&again.distribution);
            assert!(off <= 1.2 * told + 1e-5 && told < 0.3, "{kind:?} {k}: {off} {told}");
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
