//! Calibration: scenes whose answers are known beforehand, which every engine reads besides those of a spec and is judged by alike.
//!
//! - **Point**: one candle power at .5, 1, 2 and 10 m: inverse-square law; shows the bias of a falloff or of a read-out.
//! - **Asymmetric**: a table without symmetry, turned, over nodes, mid-nodes and both poles; shows mirrored or wrapped tables.
//! - **Luminaires**: three that differ in table, rotation and flux; shows one that is lost, or takes another's table, and light from behind.
//! - **Shadow**: a box between luminaire and meters in a black room; shows light that leaks or meters that are missed.
//! - **Furnace**: a cube that its luminaire lights evenly, so that reflected light is the same everywhere in every direction,
//!   E = rho / (1 - rho) x flux / area, to 7e-4 but in corners, where the table is straight across a bend; in its middle it shows
//!   what a method of reflected light loses or gains, 5 mm from surfaces and an edge what caches and offsets blur.
//! - **Reflectances**: floor, walls and ceiling that differ, against the simulator; shows surfaces that are exchanged or lost.

use std::sync::Arc;

use glam::{DMat3, DVec3};
use luxproof_calculators::inverse_square::direct_illuminance;
use luxproof_photometry::{LuminousIntensityDistribution, Photometry, direction};
use luxproof_scene::geometry::{Reflectances, Room, Surface};
use luxproof_scene::{Bounces, Luminaire, LuminaireModel, Meter, Obstacle, Scene, Shape, Transport, orientation};

use super::task::{Target, Task};
use luxproof_model::{MeterId, ProcedureId, Quantity};

/// The case that its readings are of.
pub const CASE: &str = "calibration";

/// Every scene of known answer, in the order of reports.
pub fn tasks() -> Vec<Task> {
    vec![point(), asymmetric(), luminaires(), shadow(), furnace(), reflectances()]
}

/// The inverse-square law, straight light that a box may hide.
pub(super) fn straight(scene: &Scene, target: &Target) -> f64 {
    direct_illuminance(scene, &target.meter).map_or(f64::NAN, |found| found.illuminance.value())
}

/// The reflected light of a room of one reflectance that is lit evenly.
pub(super) fn even(scene: &Scene, _: &Target) -> f64 {
    let Some(room) = scene.room else { return 0.0 };
    let flux: f64 = scene.luminaires.iter().map(|l| l.photometry.distribution.flux().value() * l.flux_scale).sum();
    let (rho, area_m2) = (room.reflectance.floor, Surface::ALL.iter().map(|s| room.area_m2(*s)).sum::<f64>());
    rho / (1.0 - rho) * flux / area_m2
}

fn point() -> Task {
    let lamp = luminaire(table(&[0.0], &[0.0, 90.0, 180.0], |_, _| 100.0), DVec3::ZERO);
    let places = [(0.5, 20.0, 10.0), (1.0, 200.0, 70.0), (2.0, 110.0, 120.0), (10.0, 290.0, 170.0)];
    let meters = places.map(|(distance_m, c, gamma)| {
        let outward = direction(c, gamma);
        // Half of the meters look past the luminaire, by 30 degrees.
        let aside = if distance_m > 1.5 { outward.any_orthonormal_vector() * 0.5 } else { DVec3::ZERO };
        (outward * distance_m, (aside - outward * (1.0 - aside.length_squared()).sqrt()).normalize())
    });
    task(ProcedureId::Point, free_field(vec![lamp]), &meters, Transport::Direct)
}

/// No symmetry in C, uneven angles, and the same value in every plane at the poles.
fn lopsided() -> Photometry {
    let (planes, gammas) = ([0.0, 20.0, 90.0, 135.0, 250.0, 360.0], [0.0, 15.0, 40.0, 70.0, 90.0, 130.0, 180.0]);
    table(&planes, &gammas, |c: f64, gamma: f64| {
        let (c, gamma) = (c.to_radians(), gamma.to_radians());
        500.0 + 300.0 * gamma.cos() + gamma.sin() * (150.0 * c.cos() + 75.0 * (2.0 * c).sin())
    })
}

fn asymmetric() -> Task {
    let mut lamp = luminaire(lopsided(), DVec3::ONE);
    lamp.orientation = orientation(30.0, 20.0, 10.0);
    lamp.flux_scale = 0.8;
    let gammas = [0.0, 0.5, 15.0, 55.0, 90.0, 130.0, 155.0, 179.5, 180.0];
    let angles = [0.0, 10.0, 90.0, 180.0, 250.0, 359.0].into_iter().flat_map(|c| gammas.map(|gamma| (c, gamma)));
    // On a sphere of 5 m around the luminaire, facing it.
    let outwards = angles.map(|(c, gamma)| lamp.orientation * direction(c, gamma));
    let meters: Vec<(DVec3, DVec3)> = outwards.map(|outward| (lamp.position_m + 5.0 * outward, -outward)).collect();
    task(ProcedureId::Asymmetric, free_field(vec![lamp]), &meters, Transport::Direct)
}

fn luminaires() -> Task {
    let mut turned = luminaire(lopsided(), DVec3::new(3.0, 0.5, 2.0));
    (turned.id, turned.orientation, turned.flux_scale) = ("turned".into(), orientation(200.0, 75.0, -30.0), 0.5);
    let narrow = table(&[0.0], &[0.0, 20.0, 60.0, 90.0], |_, gamma| 900.0 * gamma.to_radians().cos().powi(3));
    let narrow = Luminaire { id: "narrow".into(), ..luminaire(narrow, DVec3::new(-2.0, 1.0, 2.5)) };
    let even = Luminaire {
        id: "even".into(),
        ..luminaire(table(&[0.0], &[0.0, 180.0], |_, _| 80.0), DVec3::new(0.0, -3.0, 1.5))
    };
    let meters =
        [[-2.0, 1.0, 0.0], [0.0, 0.0, 0.0], [3.0, 1.0, 0.0], [0.5, -3.0, 0.2], [1.5, 1.5, 0.7], [-3.0, -3.0, 0.0]];
    // The last two have all of them behind.
    let above = [[1.0, -1.0, 4.0], [-0.5, 0.8, 4.3]];
    let meters: Vec<(DVec3, DVec3)> =
        meters.iter().chain(&above).map(|p| (DVec3::from(*p), DVec3::new(0.1, -0.2, 1.0).normalize())).collect();
    task(ProcedureId::Luminaires, free_field(vec![turned, narrow, even]), &meters, Transport::Direct)
}

fn shadow() -> Task {
    let lamp = luminaire(table(&[0.0], &[0.0, 90.0, 180.0], |_, _| 100.0), DVec3::new(2.0, 2.0, 2.5));
    let (min_m, max_m) = (DVec3::new(1.5, 1.5, 1.0), DVec3::new(2.5, 2.5, 1.2));
    let obstacles = vec![Obstacle { shape: Shape::Box { min_m, max_m }, reflectance: 0.0 }];
    let scene = Scene { obstacles, ..room(DVec3::new(4.0, 4.0, 3.0), [0.0; 3], lamp) };
    // From 2.5 m through the edge of the table's top at 1.2 m the shadow at .5 m reaches .77 m from the axis.
    let meters =
        [[2.0, 2.0, 0.5], [2.5, 1.6, 0.5], [3.2, 2.0, 0.5], [2.0, 0.6, 0.5]].map(|p| (DVec3::from(p), DVec3::Z));
    task(ProcedureId::Shadow, scene, &meters, Transport::Direct)
}

const REFLECTED: Transport = Transport::Indirect(Bounces::Converged);

/// A cube of 2 m whose reflected light is the same everywhere.
fn evenly_lit() -> Scene {
    let half_m = 1.0;
    // Even illuminance E0 on a face at distance a: I cos / d^2 = E0 with d = a / cos and cos = m, the direction's largest
    // component, so that I = E0 a^2 / m^3.
    let intensity = |c: f64, gamma: f64| 100.0 * half_m * half_m / direction(c, gamma).abs().max_element().powi(3);
    let (planes, gammas): (Vec<f64>, Vec<f64>) =
        ((0..=30).map(|k| 3.0 * f64::from(k)).collect(), (0..=60).map(|k| 3.0 * f64::from(k)).collect());
    room(DVec3::splat(2.0 * half_m), [0.5; 3], luminaire(table(&planes, &gammas, intensity), DVec3::splat(half_m)))
}

fn furnace() -> Task {
    let meters = [
        ([0.5, 0.6, 0.7], DVec3::Z),
        ([1.4, 0.5, 1.5], DVec3::NEG_Z),
        ([0.3, 1.5, 1.2], DVec3::X),
        ([1.6, 1.3, 0.4], DVec3::new(0.36, -0.48, 0.8)),
        ([0.005, 0.6, 0.7], DVec3::X),
        ([1.2, 1.0, 1.995], DVec3::NEG_Z),
        ([0.005, 0.005, 1.2], DVec3::new(0.6, 0.8, 0.0)),
    ]
    .map(|(p, n)| (DVec3::from(p), n));
    task(ProcedureId::Furnace, evenly_lit(), &meters, REFLECTED)
}

fn reflectances() -> Task {
    let lamp = luminaire(table(&[0.0], &[0.0, 45.0, 90.0], |_, gamma| 300.0 - 2.0 * gamma), DVec3::new(1.5, 2.5, 2.2));
    let meters = [
        ([1.0, 1.0, 0.8], DVec3::Z),
        ([4.0, 3.0, 0.8], DVec3::Z),
        ([2.5, 2.0, 2.0], DVec3::NEG_Z),
        ([4.5, 2.0, 1.2], DVec3::NEG_X),
    ];
    let meters = meters.map(|(p, n)| (DVec3::from(p), n));
    task(ProcedureId::Reflectances, room(DVec3::new(5.0, 4.0, 3.0), [0.2, 0.5, 0.8], lamp), &meters, REFLECTED)
}

fn free_field(luminaires: Vec<Luminaire>) -> Scene {
    Scene { luminaires, ..Scene::default() }
}

fn room(size_m: DVec3, [floor, walls, ceiling]: [f64; 3], lamp: Luminaire) -> Scene {
    let reflectance = Reflectances::with_equal_walls(floor, walls, ceiling);
    Scene { room: Some(Room { size_m, reflectance }), obstacles: vec![], luminaires: vec![lamp] }
}

fn task(procedure: ProcedureId, scene: Scene, meters: &[(DVec3, DVec3)], transport: Transport) -> Task {
    let targets = meters
        .iter()
        .enumerate()
        .map(|(k, &(position_m, normal))| Target::of_one(MeterId::new(CASE, k), Meter { position_m, normal }, 1.0));
    Task { procedure, scene, transport, quantity: Quantity::Illuminance, targets: targets.collect() }
}

fn luminaire(photometry: Photometry, position_m: DVec3) -> Luminaire {
    Luminaire {
        id: "lamp".into(),
        photometry: Arc::new(photometry),
        position_m,
        orientation: DMat3::IDENTITY,
        flux_scale: 1.0,
        model: LuminaireModel::Point,
    }
}

fn table(c_deg: &[f64], gamma_deg: &[f64], intensity: impl Fn(f64, f64) -> f64) -> Photometry {
    let intensity = &intensity;
    let candela = c_deg.iter().flat_map(|&c| gamma_deg.iter().map(move |&gamma| intensity(c, gamma))).collect();
    let table = LuminousIntensityDistribution::new(c_deg.to_vec(), gamma_deg.to_vec(), candela);
    Photometry::of(table.unwrap_or_else(|e| unreachable!("tables written down here are sound: {e}")))
}

#[cfg(test)]
mod tests {
    use luxproof_simulator::{self, Accuracy};

    use super::*;
    use crate::procedures::Reference;

    #[test]
    fn the_closed_forms_are_what_the_simulator_has() {
        for task in tasks() {
            let Reference::Formula { of, .. } = task.reference() else { continue };
            let meters: Vec<Meter> = task.targets.iter().map(|t| t.meter).collect();
            let found = luxproof_simulator::illuminance(
                &task.scene,
                &meters,
                task.transport,
                &Accuracy { relative_error: 1e-4, seed: 1 },
            )
            .unwrap();
            // The furnace's table is linear between nodes 3 degrees apart, so that its light is even to 7e-4 only.
            let limit = if task.transport == Transport::Direct { 1e-12 } else { 7e-4 };
            for (target, estimate) in task.targets.iter().zip(found.estimates) {
                let (found, right) = (estimate.illuminance.value(), of(&task.scene, target));
                assert!(
                    (found - right).abs() <= limit * right,
                    "{} {}: {found} lx, {right} lx",
                    task.procedure,
                    target.id
                );
            }
        }
    }
}
