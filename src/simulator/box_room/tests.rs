//! Laws that an empty box must obey.

use std::sync::Arc;

use glam::{DMat3, DVec3};

use crate::geometry::{Reflectances, Room};
use crate::photometry::{LuminousIntensityDistribution, Photometry};
use crate::scene::{Bounces, Luminaire, LuminaireModel, Meter, Scene, Transport};
use crate::simulator::{Accuracy, Uncertainty, illuminance};

pub(super) fn point(position_m: DVec3, distribution: LuminousIntensityDistribution) -> Luminaire {
    let photometry = Photometry::of(distribution);
    Luminaire {
        id: "a".into(),
        photometry: Arc::new(photometry),
        position_m,
        orientation: DMat3::IDENTITY,
        flux_scale: 1.0,
        model: LuminaireModel::Point,
    }
}

/// Case S1: a 20 m cube with an axial uplight in its centre.
fn s1() -> (Scene, Vec<Meter>) {
    let gamma = vec![0.0, 89.0, 90.0, 95.0, 115.0, 135.0, 155.0, 175.0, 180.0];
    let candela = vec![0.0, 0.0, 4.5, 35.7, 218.3, 421.6, 576.4, 662.3, 664.4];
    let distribution = LuminousIntensityDistribution::axial(gamma, candela).unwrap();
    let room = Room { size_m: DVec3::splat(20.0), reflectance: Reflectances::with_equal_walls(0.2, 0.5, 0.8) };
    let luminaires = vec![point(DVec3::splat(10.0), distribution)];
    let at = |(x, y)| Meter { position_m: DVec3::new(x, y, 2.0), normal: DVec3::Z };
    let meters = [(2.0, 2.0), (2.0, 10.0), (10.0, 2.0), (10.0, 10.0)].map(at).to_vec();
    (Scene { room: Some(room), obstacles: vec![], luminaires }, meters)
}

#[test]
fn s1_lies_within_its_bound_at_every_accuracy_and_bounce_count() {
    let (scene, meters) = s1();
    let converged = [0.94314714, 1.15551735, 1.15551735, 1.42062868];
    let first = [0.4827964416, 0.6295558520, 0.6295558520, 0.8360829517];
    let seven = [0.93537, 1.14730, 1.14730, 1.41182];
    let five = [0.91170, 1.12222, 1.12222, 1.38492];
    for (bounces, published, rounding) in [
        (Bounces::Converged, converged, 5e-8),
        (Bounces::AtMost(1), first, 1e-10),
        (Bounces::AtMost(7), seven, 1e-5),
        (Bounces::AtMost(5), five, 1e-5),
        (Bounces::AtMost(0), [0.0; 4], 0.0),
    ] {
        for relative_error in [1e-2, 1e-3, 1e-4, 1e-5] {
            let accuracy = Accuracy { relative_error, seed: 1 };
            let solution = illuminance(&scene, &meters, Transport::Indirect(bounces), &accuracy).unwrap();
            for (estimate, truth) in solution.estimates.iter().zip(published) {
                let Uncertainty::Bound(bound) = estimate.uncertainty else { panic!("no bound") };
                let error = (estimate.illuminance.value() - truth).abs();
                assert!(error <= bound + rounding, "{bounces:?} {relative_error}: {error} beyond {bound}");
                assert!(bound <= relative_error * truth, "{bounces:?} {relative_error}: {bound}");
            }
        }
    }
}
