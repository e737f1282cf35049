//! Shortcuts against no shortcuts over random scenes, read by our own solvers.
//!
//! Scenes have mirrored luminaires and meters, and many are almost symmetric: one luminaire is a millimetre off, a
//! thousandth brighter or turned. So a shortcut that looks at too little gives a wrong reading.

use std::collections::BTreeMap;

use fastrand::Rng;
use glam::DVec3;
use luxproof_photometry::{LuminousIntensityDistribution, LuminousOpening, lm63};
use luxproof_scene::geometry::{Reflectances, Room};
use luxproof_scene::{Bounces, Luminaire, LuminaireModel, Meter, Scene, Transport, orientation};
use luxproof_simulator::{Accuracy, illuminance};

use super::*;
use luxproof_engines::fixtures::{self, by_night};
use luxproof_engines::{Blocks, Sensor};
use luxproof_model::{MeterId, Uncertainty};

fn one_of<T: Copy>(random: &mut Rng, choices: &[T]) -> T {
    choices[random.usize(..choices.len())]
}

/// A table of type B that is brighter to one side of its axis and dark behind.
fn type_b() -> LuminousIntensityDistribution {
    let rows = "90 60 10 0\n400 300 50 0\n500 350 60 0\n200 100 20 0\n150 90 15 0";
    let text =
        format!("IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 4 5 2 2 0 0 0\n1 1 0\n0 20 50 90\n-90 -30 0 40 90\n{rows}\n");
    lm63::parse(text.as_bytes()).unwrap().distribution
}

fn spot() -> LuminousIntensityDistribution {
    LuminousIntensityDistribution::axial(vec![0.0, 20.0, 40.0, 180.0], vec![900.0, 500.0, 0.0, 0.0]).unwrap()
}

fn even() -> LuminousIntensityDistribution {
    LuminousIntensityDistribution::axial(vec![0.0, 180.0], vec![100.0, 100.0]).unwrap()
}

fn random_room(random: &mut Rng) -> Room {
    let sizes = [[6.0, 4.0, 3.0], [5.0, 5.0, 3.0], [4.0, 4.0, 4.0], [6.0, 3.0, 3.0]];
    let floor = one_of(random, &[0.0, 0.2, 0.6]);
    let ceiling = one_of(random, &[floor, floor, 0.7]);
    let mut reflectance = Reflectances::with_equal_walls(floor, one_of(random, &[0.0, 0.5]), ceiling);
    if random.u8(..4) == 0 {
        reflectance.wall_x_max = 0.3;
    }
    Room { size_m: one_of(random, &sizes).into(), reflectance }
}

/// The images of a point in a box that is mirrored along these axes, itself first.
fn mirror_images(point_m: DVec3, size_m: DVec3, axes: u8) -> Vec<(DVec3, u8)> {
    let images = (0..8).filter(|image| image & !axes == 0);
    images.map(|image| (size_m * 0.5 + (point_m - size_m * 0.5) * signs(image), image)).collect()
}

/// -1 along the axes whose bit is set.
fn signs(bits: u8) -> DVec3 {
    DVec3::from_array([0, 1, 2].map(|axis| if bits >> axis & 1 == 1 { -1.0 } else { 1.0 }))
}

fn random_point(random: &mut Rng, size_m: DVec3) -> DVec3 {
    size_m * DVec3::from_array([0; 3].map(|_| 0.1 + 0.8 * random.f64()))
}

/// One to four luminaires in mirrored places, of which one may be a little different.
fn random_luminaires(random: &mut Rng, size_m: DVec3) -> Vec<Luminaire> {
    let table = one_of(random, &[even, spot, fixtures::quadrant, fixtures::lopsided, fixtures::axial_uplight, type_b]);
    let table = table();
    let mut at_m = random_point(random, size_m);
    if random.bool() {
        at_m = one_of(random, &[size_m * 0.5, size_m * DVec3::new(0.5, 0.5, 0.8)]);
    }
    let opening = LuminousOpening::Box { x_m: 0.6, y_m: 0.3, height_m: 0.0 };
    let is_area = random.u8(..3) == 0;
    let mut luminaires = vec![];
    for (place_m, _) in mirror_images(at_m, size_m, one_of(random, &[0, 1, 2, 3, 4, 4])) {
        let lamp = fixtures::luminaire(&format!("l{}", luminaires.len()), place_m, table.clone());
        if luminaires.iter().all(|l: &Luminaire| l.position_m.distance(place_m) > 1e-3) {
            luminaires.push(if is_area { fixtures::with_opening(lamp, opening) } else { lamp });
        }
    }
    let turn =
        one_of(random, &[[0.0; 3], [0.0; 3], [90.0, 0.0, 0.0], [20.0, 0.0, 0.0], [0.0, 90.0, 0.0], [30.0, 50.0, 0.0]]);
    for luminaire in &mut luminaires {
        luminaire.orientation = orientation(turn[0], turn[1], turn[2]);
    }
    let last = luminaires.last_mut().unwrap();
    match random.u8(..8) {
        0 => last.position_m += 1e-3,
        1 => last.flux_scale = 1.001,
        2 => last.orientation = orientation(1.0, 0.0, 0.0),
        3 => last.flux_scale = 0.0,
        4 => last.model = LuminaireModel::Point,
        _ => {}
    }
    luminaires
}

/// Meters in mirrored places that face a mirrored way; some lie in the plane of a luminaire, which cuts its opening.
fn random_sensors(random: &mut Rng, size_m: DVec3, luminaires: &[Luminaire]) -> Vec<Sensor> {
    let normals = [DVec3::Z, DVec3::NEG_Z, DVec3::X, DVec3::Y, DVec3::new(0.6, 0.0, 0.8)];
    let axes = one_of(random, &[1, 2, 3, 4, 4, 7]);
    let mut sensors = vec![];
    for _ in 0..3 {
        let (mut place_m, normal) = (random_point(random, size_m), one_of(random, &normals));
        if random.u8(..3) == 0 {
            // The opening reaches .3 m along x and .15 m along y.
            place_m[one_of(random, &[0, 1, 2])] = luminaires[0].position_m.x.min(place_m.x) + 0.07;
            place_m = place_m.min(size_m * 0.95);
        }
        for (at_m, image) in mirror_images(place_m, size_m, axes) {
            let meter = Meter { position_m: at_m, normal: normal * signs(image) };
            sensors.push(Sensor { id: MeterId::new("m", sensors.len()), meter });
        }
    }
    sensors
}

fn random_job(random: &mut Rng) -> Job {
    let room = random_room(random);
    let luminaires = random_luminaires(random, room.size_m);
    let sensors = random_sensors(random, room.size_m, &luminaires);
    let is_point =
        luminaires.iter().all(|l| l.model == LuminaireModel::Point && !l.photometry.distribution.is_native());
    let transports = [Transport::Direct, Transport::Indirect(Bounces::AtMost(1)), Transport::Total(Bounces::AtMost(1))];
    let transport = if is_point && random.bool() { one_of(random, &transports) } else { Transport::Direct };
    fixtures::job(Scene { room: Some(room), obstacles: vec![], luminaires }, sensors, transport)
}

fn read(job: &Job) -> Measurement {
    if job.sensors.is_empty() {
        return Measurement::default();
    }
    let meters: Vec<_> = job.sensors.iter().map(|s| s.meter).collect();
    let accuracy = Accuracy { relative_error: 1e-4, seed: 1 };
    let solution = illuminance(&job.scene, &meters, job.transport, &accuracy).unwrap();
    let values = solution.estimates.iter().map(|e| e.illuminance.value());
    let estimates = values.map(|value| Estimate { value, uncertainty: Uncertainty::Unstated }).collect();
    Measurement { estimates, ..Measurement::default() }
}

#[test]
fn shortcuts_change_no_reading_of_a_random_scene() {
    let mut kinds: BTreeMap<&str, usize> = BTreeMap::new();
    for seed in 0..by_night(3000, 250) {
        let mut random = Rng::with_seed(seed);
        let job = random_job(&mut random);
        let (shortcut, whole) = (Shortcut::of(&job), read(&job));
        let completed = shortcut.complete(read(&shortcut.job), &job);
        let brightest = whole.estimates.iter().map(|e| e.value).fold(0.0, f64::max);
        for (((found, whole), sensor), fill) in
            completed.estimates.iter().zip(&whole.estimates).zip(&job.sensors).zip(&shortcut.fill)
        {
            assert!(
                (found.value - whole.value).abs() <= 3e-4 * brightest,
                "seed {seed}, {} ({fill:?}): {} for {}\n{:?}\n{:#?}",
                sensor.id,
                found.value,
                whole.value,
                sensor.meter,
                job.scene
            );
            let kind = match fill {
                Fill::Rendered(_) => "rendered",
                Fill::Dark => "dark",
                Fill::Mirrors { by, .. } if by.contains('z') => "mirrored along z",
                Fill::Mirrors { .. } => "mirrored",
            };
            *kinds.entry(kind).or_default() += 1;
        }
    }
    println!("{kinds:?}");
    // Every kind is tried often enough to mean something.
    assert!(kinds.len() == 4 && kinds.values().all(|count| *count >= 20), "{kinds:?}");
}

#[test]
fn a_body_that_reflects_light_leaves_every_reflection_to_the_renderer() {
    let mut job = fixtures::s1(Transport::Indirect(Bounces::Converged));
    job.scene.room = Some(fixtures::room(DVec3::splat(20.0), 0.0, 0.0, 0.0));
    assert!(Shortcut::of(&job).job.sensors.is_empty());
    // A reflecting body lights meters in a black room, and is lit by a floor that reflects alone.
    for (floor, body) in [(0.0, 0.5), (0.5, 0.5)] {
        let mut furnished = job.clone();
        furnished.scene.room = Some(fixtures::room(DVec3::splat(20.0), floor, 0.0, 0.0));
        furnished.scene.obstacles = vec![fixtures::cuboid([4.0, 4.0, 12.0], [9.0, 9.0, 14.0], body)];
        let shortcut = Shortcut::of(&furnished);
        assert_eq!(shortcut.job.transport, furnished.transport, "{floor} {body}");
        assert!(!shortcut.job.sensors.is_empty() && !shortcut.fill.contains(&Fill::Dark), "{floor} {body}");
    }
    // A black one does neither.
    let mut black = job.clone();
    black.scene.obstacles = vec![fixtures::cuboid([4.0, 4.0, 12.0], [9.0, 9.0, 14.0], 0.0)];
    assert!(Shortcut::of(&black).job.sensors.is_empty());
}

#[test]
fn a_meter_that_cuts_an_opening_sees_a_part_of_it() {
    let opening = LuminousOpening::Box { x_m: 0.6, y_m: 0.6, height_m: 0.0 };
    let mut job = fixtures::s1(Transport::Direct);
    let lamp = fixtures::luminaire("panel", DVec3::new(10.0, 10.0, 10.0), even());
    job.scene.luminaires = vec![fixtures::with_opening(lamp, opening)];
    // A plane that faces +x sees what lies beyond it: the opening reaches from 9.7 m to 10.3 m.
    job.sensors = fixtures::sensors(&[[10.29, 10.0, 9.0], [10.31, 10.0, 9.0], [9.7, 10.0, 9.0]], DVec3::X);
    let fill = Shortcut::of(&job).fill;
    assert_eq!(fill.iter().map(|f| *f == Fill::Dark).collect::<Vec<_>>(), [false, true, false]);
}

#[test]
fn rescaled_readings_have_rescaled_errors_and_samples() {
    let job = fixtures::s1(Transport::Direct);
    let sensors = job.sensors.len();
    let mirrored = Fill::Mirrors { sensor: 1, by: "a mirror".to_owned() };
    let fill = vec![Fill::Rendered(0), mirrored, Fill::Dark, Fill::Rendered(1)];
    assert_eq!(fill.len(), sensors);
    let shortcut = Shortcut { fill, factor: 0.5, ..Shortcut::none(&job) };
    let estimates = [8.0, 6.0].map(|value| Estimate { value, uncertainty: Uncertainty::sampled(0.2, Some(7.0)) });
    let samples = vec![Blocks::new(vec![vec![7.0, 5.0], vec![9.0, 7.0]])];
    let rendered = Measurement { estimates: estimates.to_vec(), samples, ..Measurement::default() };
    let completed = shortcut.complete(rendered, &job);
    assert_eq!(completed.estimates.iter().map(|e| e.value).collect::<Vec<_>>(), [4.0, 3.0, 0.0, 3.0]);
    let half = Uncertainty::sampled(0.1, Some(7.0));
    assert_eq!([0, 1, 3].map(|k| completed.estimates[k].uncertainty), [half; 3]);
    assert_eq!(completed.estimates[2], Estimate::DARK);
    assert_eq!(completed.samples, [Blocks::new(vec![vec![3.5, 2.5, 0.0, 2.5], vec![4.5, 3.5, 0.0, 3.5]])]);
    assert_eq!(completed.effort["rescaled_by"], "0.5");
}
