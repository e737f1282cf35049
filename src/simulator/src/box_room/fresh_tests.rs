//! Bounds against finer solutions in rooms that nothing was taken from: other ones every night.

use std::f64::consts::FRAC_PI_2;

use glam::DVec3;

use super::tests::{Random, bounded, downlight, point, random_scene, solve};
use super::{EFFORTS, Effort, EmptyRoom};
use crate::path_tracing::test_scenes::uplight;
use crate::stop::Stop;
use luxproof_photometry::LuminousIntensityDistribution;
use luxproof_scene::geometry::{Reflectances, Room};
use luxproof_scene::{Luminaire, Meter, Scene, orientation};

/// What a luminaire shines.
#[derive(Clone, Copy, Debug)]
enum Light {
    /// A power of the cosine, downwards.
    Down,
    /// S1's upwards.
    Up,
    /// A few degrees wide, somewhere.
    Narrow,
    /// All within a cone that ends in light.
    CutOff,
    /// A power of the cosine that differs with C, upwards too, measured with some noise.
    Measured,
}

/// Sizes, reflectances and where luminaires hang.
#[derive(Clone, Copy, Debug)]
enum Kind {
    /// Six reflectances, a table that starts and ends with a step, turned anyhow.
    Steps,
    Ordinary(Light),
    Corridor(Light),
    Hall(Light),
    /// Hardly any light is absorbed.
    Bright(Light),
    /// Five centimetres off the ceiling and two walls.
    InACorner(Light),
}

const KINDS: [Kind; 12] = [
    Kind::Steps,
    Kind::Ordinary(Light::Down),
    Kind::Ordinary(Light::Up),
    Kind::Ordinary(Light::Narrow),
    Kind::Ordinary(Light::CutOff),
    Kind::Ordinary(Light::Measured),
    Kind::Corridor(Light::Down),
    Kind::Corridor(Light::Measured),
    Kind::Hall(Light::Down),
    Kind::Bright(Light::Down),
    Kind::Bright(Light::Up),
    Kind::InACorner(Light::Measured),
];

fn between(random: &mut Random, low: f64, high: f64) -> f64 {
    low + (high - low) * random.next()
}

fn table(light: Light, random: &mut Random) -> LuminousIntensityDistribution {
    let axial = |gamma: Vec<f64>, cd: Vec<f64>| LuminousIntensityDistribution::axial(gamma, cd).unwrap();
    match light {
        Light::Down => downlight(between(random, 1.0, 4.0)),
        Light::Up => uplight(),
        Light::Narrow => {
            let width = between(random, 5.0, 15.0);
            let gamma: Vec<f64> = (0..=180).map(f64::from).collect();
            let cd = gamma.iter().map(|g| 1.0 + 1e4 * (-(g / width).powi(2)).exp()).collect();
            axial(gamma, cd)
        }
        Light::CutOff => {
            let end = between(random, 35.0, 75.0).round();
            axial(vec![0.0, 0.5 * end, end, end + 0.1, 180.0], vec![800.0, 700.0, 500.0, 0.0, 0.0])
        }
        Light::Measured => {
            let gamma: Vec<f64> = (0..=36).map(|k| 5.0 * f64::from(k)).collect();
            let [along, across] = [(); 2].map(|()| between(random, 1.0, 3.0));
            let (mut cd, mut first) = (vec![], vec![]);
            for c in 0..8 {
                let share = (FRAC_PI_2 * 0.5 * f64::from(c)).sin().powi(2);
                let of = |g: &f64| {
                    let cosine = g.to_radians().cos();
                    let strength = if cosine > 0.0 { 1e3 } else { 1e2 };
                    strength * cosine.abs().powf(along + share * (across - along)) * between(random, 0.97, 1.03)
                };
                let row: Vec<f64> = gamma.iter().map(of).collect();
                if c == 0 {
                    first.clone_from(&row);
                }
                cd.extend(row);
            }
            cd.extend(first);
            LuminousIntensityDistribution::new((0..=8).map(|c| 45.0 * f64::from(c)).collect(), gamma, cd).unwrap()
        }
    }
}

fn fresh_scene(kind: Kind, random: &mut Random) -> Scene {
    let light = match kind {
        Kind::Steps => return random_scene(random).0,
        Kind::Ordinary(l) | Kind::Corridor(l) | Kind::Hall(l) | Kind::Bright(l) | Kind::InACorner(l) => l,
    };
    let mut r = |low, high| between(random, low, high);
    let size_m = match kind {
        Kind::Corridor(_) => DVec3::new(r(1.5, 2.0), r(4.5, 6.5), r(2.3, 2.8)),
        Kind::Hall(_) => DVec3::new(r(7.0, 9.0), r(6.0, 8.0), r(2.8, 3.5)),
        _ => DVec3::new(r(2.5, 8.0), r(2.5, 8.0), r(2.3, 5.0)),
    };
    let reflectance = match kind {
        Kind::Bright(_) => Reflectances::with_equal_walls(r(0.8, 0.97), r(0.9, 0.97), r(0.9, 0.97)),
        _ => Reflectances::with_equal_walls(r(0.1, 0.4), r(0.3, 0.75), r(0.5, 0.9)),
    };
    let count = match kind {
        Kind::Hall(_) => 3,
        Kind::InACorner(_) => 1,
        _ => 1 + (r(0.0, 1.99) as usize),
    };
    let luminaire = |_| -> Luminaire {
        let table = table(light, random);
        let mut r = |low, high| between(random, low, high);
        let height = if matches!(light, Light::Up) { r(0.35, 0.7) } else { r(0.7, 0.985) };
        let position_m = match kind {
            Kind::InACorner(_) => DVec3::new(0.05, size_m.y - 0.05, size_m.z - 0.05),
            _ => size_m * DVec3::new(r(0.1, 0.9), r(0.1, 0.9), height),
        };
        let tilt_deg = if matches!(light, Light::Narrow | Light::Measured) { r(0.0, 60.0) } else { 0.0 };
        let orientation = orientation(r(0.0, 360.0), tilt_deg, 0.0);
        Luminaire { orientation, ..point(position_m, table) }
    };
    let luminaires = (0..count).map(luminaire).collect();
    Scene { room: Some(Room { size_m, reflectance }), obstacles: vec![], luminaires }
}

/// At a desk's height, anywhere, upon surfaces and before them, at edges and in corners.
fn meters(size_m: DVec3, random: &mut Random) -> Vec<(&'static str, Meter)> {
    let mut within = |low: f64, high: f64| DVec3::from_array([(); 3].map(|()| between(random, low, high)));
    let at = |kind, position_m, normal: DVec3| (kind, Meter { position_m, normal: normal.normalize() });
    let mut all = vec![];
    for k in 0..3 {
        let place = size_m * within(0.05, 0.95);
        all.push(at("at a desk's height", DVec3 { z: 0.28 * size_m.z, ..place }, DVec3::Z));
        all.push(at("anywhere", size_m * within(0.02, 0.98), within(-1.0, 1.0) + DVec3::splat(1e-3)));
        all.push(at("upon a surface", DVec3 { z: 1e-3, ..size_m * within(0.02, 0.98) }, DVec3::Z));
        let off_m = [1e-3, 1e-2, 0.2][k];
        all.push(at("before a wall", DVec3 { x: off_m, ..size_m * within(0.03, 0.97) }, DVec3::NEG_X));
        all.push(at("before a ceiling", DVec3 { z: size_m.z - off_m, ..size_m * within(0.03, 0.97) }, DVec3::Z));
        let off_m = [1e-3, 1e-2, 0.05][k];
        let normal = within(-1.0, 1.0) + DVec3::splat(1e-3);
        all.push(at("at an edge", DVec3 { x: off_m, z: 1.5 * off_m, ..size_m * within(0.03, 0.97) }, normal));
        all.push(at(
            "in a corner",
            size_m - off_m * DVec3::new(1.0, 2.0, 1.5),
            [DVec3::NEG_X, DVec3::NEG_Z, normal][k],
        ));
    }
    all
}

/// What the finest there is makes of each meter, and how far that may be from the truth: by a solution of fewer orders.
fn truths(scene: &Scene, meters: &[Meter]) -> Vec<(f64, f64)> {
    let coarser = Effort { order: 10, ..EFFORTS[7] };
    let [fine, coarse] = [&EFFORTS[7], &coarser].map(|e| solve(scene, e).illuminance(meters, &Stop::NEVER).unwrap());
    fine.into_iter().zip(coarse).map(|(fine, coarse)| (fine, (fine - coarse).abs())).collect()
}

#[test]
fn bounds_hold_in_rooms_of_fresh_seeds() {
    let seed = std::env::var("LUXPROOF_NIGHTLY").ok().and_then(|night| night.parse::<u64>().ok());
    let rooms = if seed.is_some() { 2 * KINDS.len() } else { 2 };
    let (mut beyond, mut readings) = (vec![], 0);
    for number in 0..rooms {
        let kind = KINDS[number % KINDS.len()];
        let mut random = Random(seed.unwrap_or(3) * 1009 + number as u64);
        let scene = fresh_scene(kind, &mut random);
        let (kinds, meters): (Vec<_>, Vec<_>) = meters(scene.room.unwrap().size_m, &mut random).into_iter().unzip();
        let truths = truths(&scene, &meters);
        let mut solved = EmptyRoom::default();
        for asked in [1e-1, 1e-2, 1e-3, 1e-4] {
            let found = bounded(&mut solved, &scene, &meters, asked);
            for ((found, (truth, unsure)), of) in found.iter().zip(&truths).zip(&kinds) {
                let part = ((found.value - truth).abs() - unsure) / found.bound;
                readings += 1;
                println!("{number} {kind:?} {asked:.0e} {of}: {part:.2} {:.1e}", found.bound / truth);
                if part > 1.0 {
                    beyond.push(format!("room {number}, {kind:?}, {of}, {asked:.0e} asked: {found:?} of {truth}"));
                }
            }
        }
    }
    assert!(beyond.is_empty(), "{} of {readings} beyond their bounds:\n{}", beyond.len(), beyond.join("\n"));
}
