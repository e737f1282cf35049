//! Luminaires whose files are of type A or B, in the simulator: direct light is the file's own, and reflected light that of the same
//! table turned so that it is one of type C.

// A test may panic.
#![allow(clippy::unwrap_used)]

use std::sync::Arc;

use glam::{DMat3, DVec3};
use luxproof_photometry::{Goniometer, LuminousOpening, Photometry, TypeCLimits, lm63};
use luxproof_scene::geometry::{Reflectances, Room};
use luxproof_scene::{Bounces, Luminaire, LuminaireModel, Meter, Scene, Transport, orientation};
use luxproof_simulator::{Accuracy, Uncertainty, certified, illuminance};

fn file(kind: Goniometer, h: &[f64], v: &[f64], of: impl Fn(f64, f64) -> f64) -> Photometry {
    let words = |all: Vec<f64>| all.iter().map(f64::to_string).collect::<Vec<_>>().join(" ");
    let number = if kind == Goniometer::A { 3 } else { 2 };
    let rows: Vec<String> = h.iter().map(|h| words(v.iter().map(|v| of(*h, *v)).collect())).collect();
    let text = format!(
        "IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 {} {} {number} 2 0 0 0\n1 1 0\n{}\n{}\n{}\n",
        v.len(),
        h.len(),
        words(v.to_vec()),
        words(h.to_vec()),
        rows.join("\n")
    );
    lm63::parse(text.as_bytes()).unwrap()
}

fn lamp(photometry: &Photometry, position_m: DVec3, turn: DMat3, model: LuminaireModel) -> Luminaire {
    let photometry = Arc::new(photometry.clone());
    Luminaire { id: "l".into(), photometry, position_m, orientation: turn, flux_scale: 1.0, model }
}

fn every(step: f64, first: f64, last: f64) -> Vec<f64> {
    (0..=((last - first) / step).round() as i32).map(|k| first + step * f64::from(k)).collect()
}

/// A floodlight without symmetry whose table ends in the dark.
fn flood(h: f64, v: f64) -> f64 {
    let fade = |x: f64, end: f64| (1.0 - (x / end).powi(2)).max(0.0);
    (1000.0 + 6.0 * h - 4.0 * v) * fade(h, 60.0) * fade(v - 10.0, 70.0)
}

/// Every meter and its reading with the bound.
fn read(scene: &Scene, meters: &[Meter], transport: Transport, relative_error: f64) -> Vec<(f64, f64)> {
    let solution = illuminance(scene, meters, transport, &Accuracy { relative_error, seed: 1 }).unwrap();
    let bound = |u: Uncertainty| match u {
        Uncertainty::Bound(bound) => bound,
        Uncertainty::StandardError { value, .. } => 4.0 * value,
    };
    solution.estimates.iter().map(|e| (e.illuminance.value(), bound(e.uncertainty))).collect()
}

#[test]
fn direct_light_is_the_files_own_intensity_by_the_inverse_square_law() {
    // Knuth's linear congruential generator, from -1 to 1.
    let mut state = 3_u64;
    let mut unit = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / f64::from(1_u32 << 31) / f64::from(1_u32 << 21) - 1.0
    };
    for kind in [Goniometer::A, Goniometer::B] {
        let (h, v) = (vec![-71.3, -33.0, -12.7, 0.0, 5.5, 21.0, 48.2], every(7.5, -60.0, 75.0));
        let photometry = file(kind, &h, &v, |h, v| 800.0 + 3.0 * h + 5.0 * v + 0.1 * h * v);
        let peak = photometry.distribution.max_intensity().value();
        let mut lit = 0;
        for _ in 0..2_000 {
            let turn = orientation(180.0 * unit(), 180.0 * unit(), 180.0 * unit());
            let own = DVec3::new(unit(), unit(), unit()).normalize();
            let (at_m, distance) = (DVec3::new(unit(), unit(), unit()), 1.0 + 3.0 * unit().abs());
            let meter = Meter {
                position_m: at_m + distance * (turn * own),
                normal: DVec3::new(unit(), unit(), unit()).normalize(),
            };
            let scene =
                Scene { luminaires: vec![lamp(&photometry, at_m, turn, LuminaireModel::Point)], ..Scene::default() };
            let found = read(&scene, &[meter], Transport::Direct, 1e-6)[0].0;
            // The definition of LM-63-02, from the direction to the file's angles.
            let (x, y) = match kind {
                Goniometer::B => (-(own.y.asin().to_degrees()), own.x.atan2(-own.z).to_degrees()),
                _ => ((-own.y).atan2(own.x).to_degrees(), own.z.asin().to_degrees()),
            };
            let place = |all: &[f64], x: f64| (1..all.len()).find(|k| all[k - 1] <= x && x <= all[*k]);
            let candela = place(&h, x).zip(place(&v, y)).map_or(0.0, |(i, j)| {
                let (s, t) = ((x - h[i - 1]) / (h[i] - h[i - 1]), (y - v[j - 1]) / (v[j] - v[j - 1]));
                let of = |i: usize, j: usize| 800.0 + 3.0 * h[i] + 5.0 * v[j] + 0.1 * h[i] * v[j];
                (1.0 - s) * ((1.0 - t) * of(i - 1, j - 1) + t * of(i - 1, j))
                    + s * ((1.0 - t) * of(i, j - 1) + t * of(i, j))
            });
            let cosine = (-(turn * own).dot(meter.normal)).max(0.0);
            let right = candela * cosine / (distance * distance);
            assert!((found - right).abs() <= 1e-12 * peak, "{kind:?} {own}: {found} {right}");
            lit += i32::from(right > 0.0);
        }
        assert!(lit > 200, "{lit}");
    }
}

#[test]
fn reflected_light_is_that_of_the_table_turned_into_type_c() {
    let photometry = file(Goniometer::B, &every(15.0, -60.0, 60.0), &every(20.0, -60.0, 80.0), flood);
    let turn = orientation(25.0, 35.0, 10.0);
    let room = Room { size_m: DVec3::new(4.0, 3.0, 2.5), reflectance: Reflectances::with_equal_walls(0.2, 0.5, 0.7) };
    let own = lamp(&photometry, DVec3::new(1.1, 1.3, 2.0), turn, LuminaireModel::Point);
    let turned = own.in_type_c(TypeCLimits::default());
    assert_eq!(turned.photometry.distribution.goniometer(), Goniometer::C);
    let meters: Vec<Meter> = [(0.7, 0.5), (2.0, 1.5), (3.3, 2.2)]
        .map(|(x, y)| Meter { position_m: DVec3::new(x, y, 0.8), normal: DVec3::Z })
        .to_vec();
    let scene = |l: &Luminaire| Scene { room: Some(room), luminaires: vec![l.clone()], ..Scene::default() };
    let transport = Transport::Total(Bounces::Converged);
    let pair = [&own, &turned].map(|l| read(&scene(l), &meters, transport, 1e-5));
    for ((a, bound), (b, other)) in pair[0].iter().zip(&pair[1]) {
        assert!((a - b).abs() <= bound + other + 1e-9 * a, "{a} {b} within {bound} and {other}");
        assert!(*bound < 1e-3 * a, "{bound} of {a}");
    }
    let traced = certified(&scene(&own), &meters, transport, &Accuracy { relative_error: 3e-3, seed: 5 }).unwrap();
    for (estimate, (a, _)) in traced.estimates.iter().zip(&pair[0]) {
        let Uncertainty::StandardError { value, .. } = estimate.uncertainty else { continue };
        let off = (estimate.illuminance.value() - a).abs();
        assert!(off <= 4.5 * value, "{} +- {value}, {a}", estimate.illuminance.value());
    }
}

#[test]
fn rooms_lit_by_tables_that_end_in_light_keep_their_mean_flux() {
    // Of type B, and of type A whose sector passes over half a turn; all of it is swallowed.
    for (kind, h, v) in [
        (Goniometer::B, vec![-20.0, 15.0], vec![-10.0, 40.0]),
        (Goniometer::B, vec![-90.0, 90.0], vec![-180.0, 180.0]),
        (Goniometer::A, vec![-170.0, 160.0], vec![-80.0, 60.0]),
    ] {
        let photometry = file(kind, &h, &v, |h, v| 500.0 + h + v);
        let size_m = DVec3::new(4.0, 3.0, 2.5);
        let room = Room { size_m, reflectance: Reflectances::with_equal_walls(0.5, 0.5, 0.5) };
        let lamp = lamp(&photometry, DVec3::new(1.1, 1.3, 1.4), orientation(40.0, 20.0, 5.0), LuminaireModel::Point);
        let scene = Scene { room: Some(room), luminaires: vec![lamp], ..Scene::default() };
        let n = 6;
        let mut flux = 0.0;
        for axis in 0..3 {
            for (far, normal) in [(1e-6, 1.0), (size_m[axis] - 1e-6, -1.0)] {
                let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
                let mut meters = vec![];
                for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
                    let mut position_m = DVec3::ZERO;
                    position_m[axis] = far;
                    position_m[a] = size_m[a] * (f64::from(i) + 0.5) / f64::from(n);
                    position_m[b] = size_m[b] * (f64::from(j) + 0.5) / f64::from(n);
                    let mut facing = DVec3::ZERO;
                    facing[axis] = normal;
                    meters.push(Meter { position_m, normal: facing });
                }
                let all = read(&scene, &meters, Transport::Indirect(Bounces::Converged), 1e-3);
                let area = size_m[a] * size_m[b];
                flux += area * all.iter().map(|e| e.0).sum::<f64>() / f64::from(n * n);
            }
        }
        // Of what is emitted one half is reflected, and of what is reflected one half again.
        let emitted = photometry.distribution.flux().value();
        assert!((flux / emitted - 1.0).abs() < 2e-2, "{kind:?}: {flux} of {emitted}");
    }
}

#[test]
fn an_opening_shines_by_its_own_table_however_it_is_turned() {
    let plain = file(Goniometer::B, &every(15.0, -60.0, 60.0), &every(20.0, -60.0, 80.0), flood);
    let own = Photometry { opening: LuminousOpening::Box { x_m: 0.3, y_m: 0.2, height_m: 0.1 }, ..plain.clone() };
    // The same body in the frame of the table, whose axes are those along -z, x and -y.
    let upright = plain.distribution.upright();
    let limits = TypeCLimits::default();
    let turned = Photometry {
        opening: LuminousOpening::Box { x_m: 0.1, y_m: 0.3, height_m: 0.2 },
        ..Photometry::of(upright.in_type_c_within(limits).distribution)
    };
    let (at_m, turn) = (DVec3::new(0.0, 0.0, 2.0), orientation(25.0, 35.0, 10.0));
    let frame = plain.distribution.own_frame();
    let towards = |c_deg: f64, gamma_deg: f64| turn * plain.distribution.own_direction(c_deg, gamma_deg);
    let meters: Vec<Meter> = [(10.0, 90.0), (-30.0, 100.0), (45.0, 60.0), (20.0, 125.0)]
        .map(|(c, gamma)| Meter { position_m: at_m + 1.2 * towards(c, gamma), normal: -towards(c, gamma) })
        .to_vec();
    let pair = [(&own, turn), (&turned, turn * frame)].map(|(photometry, turn)| {
        let luminaires = vec![lamp(photometry, at_m, turn, LuminaireModel::Area)];
        read(&Scene { luminaires, ..Scene::default() }, &meters, Transport::Direct, 1e-6)
    });
    for ((a, bound), (b, other)) in pair[0].iter().zip(&pair[1]) {
        assert!(*a > 0.0 && (a - b).abs() <= bound + other + 1e-9 * a, "{a} {b} within {bound} and {other}");
    }
}
