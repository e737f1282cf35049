//! Area luminaires that go to USD and come back.

use std::sync::Arc;

use luxproof_photometry::{LuminousIntensityDistribution, LuminousOpening, Photometry, lm63};
use luxproof_scene::{Luminaire, LuminaireModel, Scene, orientation};
use luxproof_scene_export::{ExportedScene, SceneFormat, export_scene};

use super::tests::{random_scene, read};
use super::*;

/// The scene as USD, and its luminaires read from that again.
fn through_usd(scene: &Scene) -> (ExportedScene, Vec<Luminaire>, Imported) {
    let exported = export_scene(scene, "areas", SceneFormat::Usd);
    let mut files: Vec<(&str, &[u8])> = exported.files.iter().map(|f| (f.name.as_str(), f.bytes.as_slice())).collect();
    // The scene is the last of the files, and the first is read.
    files.rotate_right(1);
    let imported = read(&files).unwrap();
    let again = imported.luminaires.iter().map(|found| {
        let [azimuth, tilt, roll] = found.rotate_deg;
        Luminaire {
            id: found.id.clone(),
            photometry: Arc::new(lm63::parse(&found.bytes).unwrap()),
            position_m: found.at_m,
            orientation: orientation(azimuth, tilt, roll),
            flux_scale: found.flux_scale,
            model: found.model.unwrap(),
        }
    });
    let again = again.collect();
    (exported, again, imported)
}

/// A table with such planes and light between two angles, dark at the horizon or not.
fn random_table(random: &mut fastrand::Rng, planes_deg: &[f64], gamma_deg: &[f64]) -> LuminousIntensityDistribution {
    let mut candela: Vec<f64> = planes_deg
        .iter()
        .flat_map(|_| gamma_deg.iter().map(|g| if *g == 90.0 { 0.0 } else { 1.0 }).collect::<Vec<f64>>())
        .map(|share| share * (1.0 + 899.0 * random.f64()))
        .collect();
    // Planes meet at the poles, and 360 is 0.
    let count = gamma_deg.len();
    for (g, gamma) in gamma_deg.iter().enumerate().filter(|(_, gamma)| **gamma == 0.0 || **gamma == 180.0) {
        (0..planes_deg.len()).for_each(|c| candela[count * c + g] = 300.0 + gamma);
    }
    if planes_deg.last() == Some(&360.0) {
        candela.copy_within(0..count, count * (planes_deg.len() - 1));
    }
    LuminousIntensityDistribution::new(planes_deg.to_vec(), gamma_deg.to_vec(), candela).unwrap()
}

/// Candela towards a direction of all luminaires that stand for one.
fn candela(luminaires: &[Luminaire], direction: DVec3) -> f64 {
    luminaires.iter().map(|lamp| lamp.intensity_towards(direction).value()).sum()
}

fn random_direction(random: &mut fastrand::Rng) -> DVec3 {
    let z = 2.0 * random.f64() - 1.0;
    let around = std::f64::consts::TAU * random.f64();
    let across = (1.0 - z * z).sqrt();
    DVec3::new(across * around.cos(), across * around.sin(), z)
}

const OPENINGS: [LuminousOpening; 2] = [
    LuminousOpening::Box { x_m: 1.2, y_m: 0.3, height_m: 0.0 },
    LuminousOpening::Ellipse { x_m: 0.4, y_m: 0.4, height_m: 0.0 },
];

/// Scenes of three area luminaires: down, down and up with all kinds of symmetry, and up alone.
#[test]
fn ten_random_scenes_of_areas_come_back_from_usd_with_their_candela() {
    let mut random = fastrand::Rng::with_seed(7100);
    let planes: [&[f64]; 5] =
        [&[0.0], &[0.0, 30.0, 90.0], &[0.0, 77.0, 180.0], &[90.0, 120.0, 270.0], &[0.0, 90.0, 200.0, 360.0]];
    let gammas: [&[f64]; 4] = [
        &[0.0, 33.3, 60.0, 90.0],
        &[0.0, 45.5, 90.0, 120.0, 180.0],
        &[90.0, 150.0, 180.0],
        // Dark at once beyond its ends.
        &[10.0, 40.25, 71.5],
    ];
    for k in 0..10 {
        let mut scene = random_scene(&mut random);
        for (j, lamp) in scene.luminaires.iter_mut().enumerate() {
            let table = random_table(&mut random, planes[(k + j) % planes.len()], gammas[(k + 2 * j) % gammas.len()]);
            let opening = OPENINGS[(k + j) % 2];
            *lamp = Luminaire {
                photometry: Arc::new(Photometry { opening, ..Photometry::of(table) }),
                model: LuminaireModel::Area,
                ..lamp.clone()
            };
        }
        let (exported, again, imported) = through_usd(&scene);
        assert_eq!(exported.losses, ["points and procedures are no part of the scene"]);
        let notes = imported.summary.notes.join("\n");
        assert!(notes.contains("of flat lights the cosine of gamma"), "{notes}");
        for lamp in &scene.luminaires {
            let name = lamp.id.replace(' ', "_");
            let parts: Vec<Luminaire> =
                again.iter().filter(|a| a.id == name || a.id == format!("{name}_up")).cloned().collect();
            for part in &parts {
                assert_eq!(part.model, LuminaireModel::Area);
                let sizes_m = [part, lamp].map(|l| DVec3::from(l.photometry.opening.bounding_box_m()));
                assert!(sizes_m[0].distance(sizes_m[1]) < 1e-9, "{sizes_m:?}");
                assert!(part.position_m.distance(lamp.position_m) < 1e-9);
            }
            let largest = lamp.flux_scale * lamp.photometry.distribution.max_intensity().value();
            for _ in 0..500 {
                let direction = random_direction(&mut random);
                let (found, expected) = (candela(&parts, direction), candela(std::slice::from_ref(lamp), direction));
                assert!((found - expected).abs() < 1e-6 * largest, "{} {direction}: {found} {expected}", lamp.id);
            }
            // Next to the horizon, too, where the profile is largest.
            for degrees in [89.5, 89.89, 89.95, 90.0, 90.05, 90.5_f64] {
                let gamma = degrees.to_radians();
                let direction = lamp.orientation * DVec3::new(0.6 * gamma.sin(), 0.8 * gamma.sin(), -gamma.cos());
                let (found, expected) = (candela(&parts, direction), candela(std::slice::from_ref(lamp), direction));
                assert!((found - expected).abs() < 1e-6 * largest, "{} {degrees}: {found} {expected}", lamp.id);
            }
        }
        let names = scene.luminaires.iter().map(|lamp| lamp.id.replace(' ', "_"));
        assert!(names.into_iter().all(|name| again.iter().any(|a| a.id.starts_with(&name))));
    }
}

/// The number before a unit in a sentence.
fn figure(text: &str, unit: &str) -> f64 {
    text.rsplit_once(unit).and_then(|(head, _)| head.split_whitespace().last()).unwrap().parse().unwrap()
}

#[test]
fn light_at_the_horizon_is_lost_by_as_much_as_the_export_says() {
    let mut random = fastrand::Rng::with_seed(3);
    let mut scene = random_scene(&mut random);
    scene.luminaires.truncate(1);
    // A table that ends with light at 90 degrees, and one that crosses it.
    let lit_ends = LuminousIntensityDistribution::axial(vec![0.0, 90.0], vec![100.0, 40.0]).unwrap();
    let crossing = LuminousIntensityDistribution::axial(vec![0.0, 180.0], vec![70.0, 10.0]).unwrap();
    for (table, at_90_cd, lights) in [(lit_ends, 40.0, 1), (crossing, 40.0, 2)] {
        let before = table.flux().value();
        let photometry = Photometry { opening: OPENINGS[0], ..Photometry::of(table.clone()) };
        scene.luminaires[0].photometry = Arc::new(photometry);
        scene.luminaires[0].model = LuminaireModel::Area;
        let (exported, again, _) = through_usd(&scene);
        assert_eq!(again.len(), lights);
        let [_, loss] = exported.losses.as_slice() else { panic!("{:?}", exported.losses) };
        assert_eq!(figure(loss, " cd, becomes 0"), at_90_cd);
        let after: f64 = again.iter().map(|lamp| lamp.photometry.distribution.flux().value()).sum();
        let stated_lm = figure(loss, " of ");
        assert!(((before - after) / stated_lm - 1.0).abs() < 1e-3, "{loss}: {before} {after}");
        // Half of the intensity over a tenth of a degree, on each side that shines.
        let expected_lm = lights as f64 * std::f64::consts::TAU * 20.0 * 0.1_f64.to_radians();
        assert!((stated_lm / expected_lm - 1.0).abs() < 2e-3, "{loss}: {expected_lm}");
        // Up to 89.9 degrees nothing is lost.
        for degrees in [0.0_f64, 45.0, 89.0, 89.9] {
            let gamma = degrees.to_radians();
            let direction = scene.luminaires[0].orientation * DVec3::new(gamma.sin(), 0.0, -gamma.cos());
            let (found, expected) = (candela(&again, direction), candela(&scene.luminaires, direction));
            assert!((found / expected - 1.0).abs() < 1e-9, "{degrees}: {found} {expected}");
        }
    }
}

#[test]
fn tables_of_type_b_and_openings_that_are_not_flat_are_listed_as_losses() {
    let mut random = fastrand::Rng::with_seed(4);
    let mut scene = random_scene(&mut random);
    scene.luminaires.truncate(1);
    let type_b =
        b"IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 3 3 2 2 .3 .3 0\n1 1 0\n-90 0 90\n-90 0 90\n0 0 0\n0 500 0\n0 0 0\n";
    let photometry = lm63::parse(type_b).unwrap();
    assert!(photometry.distribution.is_native());
    let largest_cd = photometry.distribution.max_intensity().value();
    scene.luminaires[0].photometry = Arc::new(photometry);
    scene.luminaires[0].model = LuminaireModel::Impostor;
    let (exported, again, _) = through_usd(&scene);
    let losses = exported.losses.join("\n");
    assert!(losses.contains("UsdLux has no impostor: it becomes an area"), "{losses}");
    let stated_cd = figure(&losses, " cd, and ");
    for _ in 0..2000 {
        let direction = random_direction(&mut random);
        let difference = candela(&again, direction) - candela(&scene.luminaires, direction);
        // Printed with three decimals, and steps of the cosine between them.
        let allowed_cd = scene.luminaires[0].flux_scale * (stated_cd + 1e-3 + 1e-4 * largest_cd);
        assert!(difference.abs() <= allowed_cd, "{difference} {losses}");
    }
    let opening = LuminousOpening::Box { x_m: 1.2, y_m: 0.3, height_m: 0.1 };
    let table = LuminousIntensityDistribution::axial(vec![0.0, 180.0], vec![70.0, 10.0]).unwrap();
    scene.luminaires[0].photometry = Arc::new(Photometry { opening, ..Photometry::of(table) });
    let (exported, again, _) = through_usd(&scene);
    assert!(exported.losses[1].contains("its opening of 1.2 x 0.3 x 0.1 m"), "{:?}", exported.losses);
    assert_eq!(again[0].model, LuminaireModel::Point);
}
