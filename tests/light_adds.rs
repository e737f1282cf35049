//! Light adds: all luminaires together give what each gives alone, in mixtures of points and openings of every form.

// A test may panic.
#![allow(clippy::unwrap_used)]

mod scenes;

use std::sync::Arc;

use glam::DVec3;
use luxproof_photometry::{LuminousIntensityDistribution, LuminousOpening, Photometry};
use luxproof_scene::geometry::{Reflectances, Room};
use luxproof_scene::{Bounces, Luminaire, LuminaireModel, Meter, Scene, Transport, orientation};
use luxproof_simulator::{Accuracy, SimulatorError, Solution, certified, illuminance};
use scenes::{Random, by_night, lamp, margin_lx, meters, opening, room};

type Solve = fn(&Scene, &[Meter], Transport, &Accuracy) -> Result<Solution, SimulatorError>;

/// Whether all together give what each gives alone, within what is stated of both; what does not, in words.
fn unequal(solve: Solve, scene: &Scene, meters: &[Meter], transport: Transport, accuracy: &Accuracy) -> Option<String> {
    let read = |luminaires: Vec<Luminaire>, seed: u64| {
        let scene = Scene { luminaires, ..scene.clone() };
        let accuracy = Accuracy { seed: accuracy.seed + seed, ..*accuracy };
        solve(&scene, meters, transport, &accuracy).unwrap().estimates
    };
    let all = read(scene.luminaires.clone(), 0);
    let alone: Vec<_> = (1..).zip(&scene.luminaires).map(|(k, l)| read(vec![l.clone()], 1000 * k)).collect();
    (0..meters.len()).find_map(|k| {
        let sum_lx: f64 = alone.iter().map(|found| found[k].illuminance.value()).sum();
        let allowed_lx = margin_lx(&all[k]) + alone.iter().map(|found| margin_lx(&found[k])).sum::<f64>();
        let off_lx = (all[k].illuminance.value() - sum_lx).abs();
        let is_off = off_lx > allowed_lx + 1e-9 * sum_lx;
        is_off.then(|| format!("{:?} for {sum_lx} +- {allowed_lx} at {:?}", all[k], meters[k]))
    })
}

/// A point or an opening anywhere in a room, turned anyhow, of a wide or a narrow beam.
fn any_luminaire(random: &mut Random, size_m: DVec3) -> Luminaire {
    let place = DVec3::new(random.within(0.2, 0.8), random.within(0.2, 0.8), random.within(0.4, 0.8));
    let opening = opening(random);
    let mut it = lamp(opening, place * size_m);
    let power = [0.5, 2.0, 8.0, 60.0][random.below(4)];
    let up = random.below(2) == 0;
    let gamma_deg: Vec<f64> = (0..=180).map(f64::from).collect();
    let candela = |gamma: &f64| {
        let cosine = if up { -gamma.to_radians().cos() } else { gamma.to_radians().cos() };
        1000.0 * cosine.max(0.0).powf(power)
    };
    let table = LuminousIntensityDistribution::axial(gamma_deg.clone(), gamma_deg.iter().map(candela).collect());
    it.photometry = Arc::new(Photometry { opening, ..Photometry::of(table.unwrap()) });
    it.orientation = orientation(random.within(0.0, 360.0), random.within(-40.0, 40.0), 0.0);
    if random.below(3) == 0 {
        it.model = LuminaireModel::Point;
    }
    it
}

fn mixture(seed: u64) -> (Scene, Vec<Meter>) {
    let mut random = Random(seed);
    let room = room(DVec3::new(random.within(3.0, 7.0), random.within(5.0, 7.0), random.within(2.8, 4.0)));
    let count = 2 + random.below(3);
    let luminaires = (0..count).map(|_| any_luminaire(&mut random, room.size_m)).collect();
    let scene = Scene { room: Some(room), obstacles: vec![], luminaires };
    let meters = meters(&mut random, &scene, 2);
    (scene, meters)
}

#[test]
fn light_of_paths_adds() {
    for seed in 0..by_night(100, 6) {
        let (scene, meters) = mixture(seed);
        for transport in [Transport::Direct, Transport::Indirect(Bounces::Converged)] {
            let accuracy = Accuracy { relative_error: 1e-2, seed };
            assert_eq!(unequal(certified, &scene, &meters, transport, &accuracy), None, "{seed} {transport:?}");
        }
    }
}

#[test]
fn light_of_the_simulator_adds() {
    for seed in 0..by_night(100, 3) {
        let (scene, meters) = mixture(seed);
        for transport in [Transport::Direct, Transport::Indirect(Bounces::Converged)] {
            let accuracy = Accuracy { relative_error: 5e-2, seed };
            assert_eq!(unequal(illuminance, &scene, &meters, transport, &accuracy), None, "{seed} {transport:?}");
        }
    }
}

/// A narrow uplight a hand below the ceiling and a drum: the scene in which the light of the one was lost for the other.
fn uplight_and_drum() -> (Scene, [Meter; 3]) {
    let reflectance =
        Reflectances { floor: 0.0, ceiling: 0.7, wall_x_min: 0.3, wall_x_max: 0.7, wall_y_min: 0.1, wall_y_max: 0.7 };
    let gamma_deg = vec![90.0, 105.0, 120.0, 135.0, 150.0, 165.0, 180.0];
    let candela = vec![20.0, 20.008, 21.195, 77.208, 897.821, 4344.868, 6877.692];
    let up = LuminousIntensityDistribution::axial(gamma_deg, candela).unwrap();
    let gamma_deg: Vec<f64> = (0..=9).map(|k| 10.0 * f64::from(k)).collect();
    let planes = [
        [1503.667, 1626.067, 1665.475, 1609.889, 1459.408, 1227.785, 942.152, 641.354, 374.832, 218.715],
        [1503.667, 1472.635, 1381.893, 1238.376, 1053.213, 841.164, 619.994, 410.121, 235.613, 136.697],
        [1503.667, 1319.203, 1098.312, 866.863, 647.018, 454.542, 297.836, 178.888, 96.393, 54.679],
    ];
    let drum = LuminousIntensityDistribution::new(vec![0.0, 90.0, 180.0], gamma_deg, planes.concat()).unwrap();
    let form = LuminousOpening::Ellipse { x_m: 0.2404, y_m: 0.1404, height_m: 0.2021 };
    let place = |id: &str, at_m: [f64; 3], table, model, opening, flux_scale, tilt| Luminaire {
        id: id.into(),
        photometry: Arc::new(Photometry { opening, ..Photometry::of(table) }),
        position_m: DVec3::from(at_m),
        orientation: orientation(0.0, tilt, 0.0),
        flux_scale,
        model,
    };
    let luminaires = vec![
        place("drum", [4.92433, 2.50418, 1.26572], drum, LuminaireModel::Area, form, 0.7, 0.0),
        place("up", [5.02994, 0.54874, 1.72386], up, LuminaireModel::Point, LuminousOpening::Point, 1.3, -15.01),
    ];
    let room = Room { size_m: DVec3::new(5.7063, 5.1948, 2.0607), reflectance };
    let meters = [[2.4478, 2.48989, 0.94195], [3.5537, 0.25758, 0.35459], [2.36805, 1.16164, 1.10602]]
        .map(|at_m| Meter { position_m: DVec3::from(at_m), normal: DVec3::Z });
    (Scene { room: Some(room), obstacles: vec![], luminaires }, meters)
}

/// The solvers that are compared with the expected values.
const ASKED: [Solve; 2] = [certified, illuminance];

#[test]
fn an_uplight_beside_a_drum_is_not_lost() {
    let (scene, meters) = uplight_and_drum();
    let accuracy = Accuracy { relative_error: 1e-2, seed: 1 };
    for solve in ASKED {
        let found = solve(&scene, &meters, Transport::Indirect(Bounces::Converged), &accuracy).unwrap().estimates;
        for (estimate, expected_lx) in found.iter().zip([19.4, 134.5, 22.8]) {
            let off_lx = (estimate.illuminance.value() - expected_lx).abs();
            assert!(off_lx <= margin_lx(estimate) + 5e-3 * expected_lx, "{estimate:?} for {expected_lx}");
            assert!(margin_lx(estimate) < 0.1 * expected_lx, "{estimate:?}");
        }
    }
}
