//! Luminaires on surfaces at random: the simulator reads them as the path tracer does, which shares no kernel with it, and as black
//! boxes behind luminaires a little off their surfaces have it.

// A test may panic.
#![allow(clippy::unwrap_used)]

mod scenes;

use glam::DVec3;
use luxproof_scene::contact::Surfaces;
use luxproof_scene::{Bounces, Obstacle, Scene, Shape, Transport, orientation};
use luxproof_simulator::{Accuracy, Estimate, Uncertainty, certified, illuminance};
use scenes::{Random, by_night, contact, lamp, margin_lx, meters};

const LIGHT: [Transport; 2] = [Transport::Direct, Transport::Indirect(Bounces::Converged)];

#[test]
fn random_contacts_read_as_paths_say() {
    let (mut compared, mut decided) = (0, 0);
    for seed in 0..by_night(200, 5) {
        let mut random = Random(seed);
        let scene = contact(&mut random);
        let meters = meters(&mut random, &scene, 2);
        for transport in LIGHT {
            let accuracy = Accuracy { relative_error: 1e-2, seed };
            let paths = certified(&scene, &meters, transport, &accuracy).unwrap();
            let rough = Accuracy { relative_error: 5e-2, seed };
            let found = illuminance(&scene, &meters, transport, &rough).unwrap();
            for ((a, b), meter) in found.estimates.iter().zip(&paths.estimates).zip(&meters) {
                let off_lx = (a.illuminance.value() - b.illuminance.value()).abs();
                let allowed_lx = margin_lx(a) + margin_lx(b);
                let (value, at) = (b.illuminance.value(), meter.position_m);
                assert!(off_lx <= allowed_lx + 1e-9, "{seed} {transport:?} {at}: {a:?} for {b:?} by {}", found.solver);
                compared += 1;
                decided += usize::from(allowed_lx <= 0.2 * value || value < 1e-3);
            }
        }
    }
    assert!(2 * decided > compared, "{decided} of {compared} say anything");
}

/// The upper face of a box, covered, against a black box a millimetre high upon it and the panel upon that.
#[test]
fn what_is_covered_is_black() {
    let room = scenes::room(DVec3::new(5.0, 4.0, 3.0));
    let (min_m, max_m) = (DVec3::new(0.1, 1.0, 0.0), DVec3::new(1.0, 3.0, 1.8));
    let body = Obstacle { shape: Shape::Box { min_m, max_m }, reflectance: 0.8 };
    let up = |z: f64| {
        let mut panel = lamp(scenes::PANEL, DVec3::new(0.5, 2.0, z));
        panel.orientation = orientation(0.0, 180.0, 0.0);
        panel
    };
    let placed = Surfaces::new(Some(room), [&body]).place(&up(1.8));
    let obstacles = placed.plates.into_iter().chain([body.clone()]).collect();
    let covered = Scene { room: Some(room), obstacles, luminaires: vec![placed.luminaire] };
    let (low, high) = (DVec3::new(0.2, 1.7, 1.8), DVec3::new(0.8, 2.3, 1.801));
    let black = Obstacle { shape: Shape::Box { min_m: low, max_m: high }, reflectance: 0.0 };
    let mut on_it = up(1.801);
    on_it.position_m.z += 1e-6;
    let backed = Scene { room: Some(room), obstacles: vec![black, body], luminaires: vec![on_it] };
    let meters = [DVec3::new(2.0, 2.0, 0.8), DVec3::new(4.0, 1.2, 0.8), DVec3::new(0.5, 2.0, 2.9)]
        .map(|position_m| luxproof_scene::Meter { position_m, normal: DVec3::Z });
    let accuracy = Accuracy { relative_error: 4e-3, seed: 1 };
    let read = |scene: &Scene| certified(scene, &meters, LIGHT[1], &accuracy).unwrap().estimates;
    for (a, b) in read(&covered).iter().zip(&read(&backed)) {
        let off_lx = (a.illuminance.value() - b.illuminance.value()).abs();
        assert!(off_lx <= margin_lx(a) + margin_lx(b) + 2e-3 * b.illuminance.value(), "{a:?} for {b:?}");
        assert!(margin_lx(a) < 0.02 * a.illuminance.value(), "{a:?}");
    }
}

/// A flat panel whose plane is that of the top of a box, and which reaches beyond it, gives light past the edge alone.
#[test]
fn a_luminaire_on_a_surface_lights_nothing_behind_that() {
    let room = scenes::room(DVec3::new(5.0, 4.0, 3.0));
    let shape = Shape::Box { min_m: DVec3::new(1.0, 1.0, 0.0), max_m: DVec3::new(3.0, 3.0, 1.0) };
    let body = Obstacle { shape, reflectance: 0.8 };
    let both = lamp(scenes::EVEN_PANEL, DVec3::new(2.0, 2.0, 1.0));
    let placed = Surfaces::new(Some(room), [&body]).place(&both);
    let obstacles = placed.plates.into_iter().chain([body]).collect();
    let scene = Scene { room: Some(room), obstacles, luminaires: vec![placed.luminaire] };
    let accuracy = Accuracy { relative_error: 1e-2, seed: 1 };
    let low = luxproof_scene::Meter { position_m: DVec3::new(4.0, 2.0, 0.5), normal: DVec3::NEG_X };
    let lit = luxproof_scene::Meter { position_m: DVec3::new(2.0, 2.0, 2.0), normal: DVec3::NEG_Z };
    for solve in [illuminance, certified] {
        let found: Vec<Estimate> = solve(&scene, &[low, lit], Transport::Direct, &accuracy).unwrap().estimates;
        let [below, above] = &found[..] else { panic!("a reading is lost") };
        let is_dark = match below.uncertainty {
            Uncertainty::Bound(bound) => below.illuminance.value() <= bound,
            Uncertainty::StandardError { .. } => below.illuminance.value() == 0.0,
        };
        assert!(is_dark && above.illuminance.value() > 1.0, "{below:?} {above:?}");
    }
}
