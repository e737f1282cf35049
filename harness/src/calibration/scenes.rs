//! The four calibration scenes with the illuminance that is right at each meter, all closed forms.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{DMat3, DVec3};
use luminaire::geometry::{Reflectances, Room};
use luminaire::photometry::{LuminousIntensityDistribution, Photometry, direction};
use luminaire::scene::{Bounces, Luminaire, LuminaireModel, Meter, Obstacle, Scene, Shape, Transport, orientation};

use crate::engines::{Budget, Job, Station};
use crate::record::{MeterId, ProcedureId};

/// A standard error that is far below the tolerances of reflected light, and a few seconds for engines that cannot meet it.
pub(super) const BUDGET: Budget = Budget { relative_error: 2e-3, seconds: 5.0 };

#[derive(Clone, Debug)]
pub(super) struct KnownScene {
    pub(super) name: &'static str,
    pub(super) job: Job,
    /// One a station.
    pub(super) known: Vec<Known>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Known {
    pub(super) exact_lx: f64,
    /// What a deviation is relative to: the illuminance, or in a shadow that without it.
    pub(super) scale_lx: f64,
}

impl KnownScene {
    pub(super) fn is_reflected(&self) -> bool {
        self.job.transport != Transport::Direct
    }
}

pub(super) fn all(settings: &BTreeMap<String, serde_json::Value>) -> Vec<KnownScene> {
    let mut scenes = vec![point(), asymmetric(), shadow(), furnace()];
    for scene in &mut scenes {
        scene.job.settings.clone_from(settings);
    }
    scenes
}

fn point() -> KnownScene {
    let lamp = luminaire(table(&[0.0], &[0.0, 90.0, 180.0], |_, _| 100.0), DVec3::ZERO);
    let at = |(distance_m, c, gamma): (f64, f64, f64)| {
        let outward = direction(c, gamma);
        // Half of the meters look past the luminaire, by 30 degrees.
        let aside = if distance_m > 1.5 { outward.any_orthonormal_vector() * 0.5 } else { DVec3::ZERO };
        (outward * distance_m, (aside - outward * (1.0 - aside.length_squared()).sqrt()).normalize())
    };
    let meters = [(0.5, 20.0, 10.0), (1.0, 200.0, 70.0), (2.0, 110.0, 120.0), (10.0, 290.0, 170.0)].map(at);
    direct("point", Scene { luminaires: vec![lamp], ..Scene::default() }, &meters)
}

/// No symmetry in C, uneven angles, and the same value in every plane at the poles.
fn asymmetric() -> KnownScene {
    let intensity = |c: f64, gamma: f64| {
        let (c, gamma) = (c.to_radians(), gamma.to_radians());
        500.0 + 300.0 * gamma.cos() + gamma.sin() * (150.0 * c.cos() + 75.0 * (2.0 * c).sin())
    };
    let planes = [0.0, 20.0, 90.0, 135.0, 250.0, 360.0];
    let mut lamp = luminaire(table(&planes, &[0.0, 15.0, 40.0, 70.0, 90.0, 130.0, 180.0], intensity), DVec3::ONE);
    lamp.orientation = orientation(30.0, 20.0, 10.0);
    lamp.flux_scale = 0.8;
    let on_sphere = |(c, gamma): (f64, f64)| {
        let outward = lamp.orientation * direction(c, gamma);
        (lamp.position_m + 5.0 * outward, -outward)
    };
    let gammas = [0.0, 0.5, 15.0, 55.0, 90.0, 130.0, 155.0, 179.5, 180.0];
    let angles = [0.0, 10.0, 90.0, 180.0, 250.0, 359.0].into_iter().flat_map(|c| gammas.map(|gamma| (c, gamma)));
    let meters: Vec<(DVec3, DVec3)> = angles.map(on_sphere).collect();
    direct("asymmetric", Scene { luminaires: vec![lamp], ..Scene::default() }, &meters)
}

fn shadow() -> KnownScene {
    let lamp = luminaire(table(&[0.0], &[0.0, 90.0, 180.0], |_, _| 100.0), DVec3::new(2.0, 2.0, 2.5));
    let (min_m, max_m) = (DVec3::new(1.5, 1.5, 1.0), DVec3::new(2.5, 2.5, 1.2));
    let size_m = DVec3::new(4.0, 4.0, 3.0);
    let room = Some(Room { size_m, reflectance: Reflectances::with_equal_walls(0.0, 0.0, 0.0) });
    let obstacles = vec![Obstacle { shape: Shape::Box { min_m, max_m }, reflectance: 0.0 }];
    let scene = Scene { room, obstacles, luminaires: vec![lamp] };
    // From 2.5 m through the edge of the table's top at 1.2 m the shadow at .5 m reaches .77 m from the axis.
    let meters =
        [[2.0, 2.0, 0.5], [2.5, 1.6, 0.5], [3.2, 2.0, 0.5], [2.0, 0.6, 0.5]].map(|p| (DVec3::from(p), DVec3::Z));
    let mut known = direct("shadow", scene, &meters);
    known.known[0].exact_lx = 0.0;
    known.known[1].exact_lx = 0.0;
    known
}

const RHO: f64 = 0.5;

fn furnace() -> KnownScene {
    let half_m = 1.0;
    // Even illuminance E0 on a face at distance a: I cos / d^2 = E0 with d = a / cos and cos = m, the direction's largest
    // component, so that I = E0 a^2 / m^3.
    let intensity = |c: f64, gamma: f64| 100.0 * half_m * half_m / direction(c, gamma).abs().max_element().powi(3);
    let (planes, gammas): (Vec<f64>, Vec<f64>) =
        ((0..=30).map(|k| 3.0 * f64::from(k)).collect(), (0..=60).map(|k| 3.0 * f64::from(k)).collect());
    let lamp = luminaire(table(&planes, &gammas, intensity), DVec3::splat(half_m));
    let room = Room { size_m: DVec3::splat(2.0 * half_m), reflectance: Reflectances::with_equal_walls(RHO, RHO, RHO) };
    let area_m2 = 24.0 * half_m * half_m;
    let exact_lx = RHO / (1.0 - RHO) * lamp.photometry.distribution.flux().value() / area_m2;
    let meters = [
        ([0.5, 0.6, 0.7], DVec3::Z),
        ([1.4, 0.5, 1.5], DVec3::NEG_Z),
        ([0.3, 1.5, 1.2], DVec3::X),
        ([1.6, 1.3, 0.4], DVec3::new(0.36, -0.48, 0.8)),
    ]
    .map(|(p, n)| (DVec3::from(p), n));
    let transport = Transport::Indirect(Bounces::Converged);
    let scene = Scene { room: Some(room), obstacles: vec![], luminaires: vec![lamp] };
    let known = vec![Known { exact_lx, scale_lx: exact_lx }; meters.len()];
    KnownScene { name: "furnace", job: job(ProcedureId::IndirectIlluminance, scene, &meters, transport), known }
}

/// Direct light by the inverse-square law, obstacles not looked at.
fn direct(name: &'static str, scene: Scene, meters: &[(DVec3, DVec3)]) -> KnownScene {
    let lamp = &scene.luminaires[0];
    let known = |&(position_m, normal): &(DVec3, DVec3)| {
        let ray = position_m - lamp.position_m;
        let cosine = -ray.normalize().dot(normal);
        let exact_lx = lamp.intensity_towards(ray).value() * cosine / ray.length_squared();
        Known { exact_lx, scale_lx: exact_lx }
    };
    let known = meters.iter().map(known).collect();
    KnownScene { name, job: job(ProcedureId::DirectIlluminance, scene, meters, Transport::Direct), known }
}

fn job(procedure: ProcedureId, scene: Scene, meters: &[(DVec3, DVec3)], transport: Transport) -> Job {
    let station = |(k, &(position_m, normal)): (usize, &(DVec3, DVec3))| Station {
        id: MeterId::new("calibration", k),
        meter: Meter { position_m, normal },
    };
    Job {
        case: "calibration".into(),
        procedure,
        scene,
        stations: meters.iter().enumerate().map(station).collect(),
        transport,
        budget: BUDGET,
        seed: 1,
        settings: BTreeMap::new(),
    }
}

fn luminaire(photometry: Photometry, position_m: DVec3) -> Luminaire {
    Luminaire {
        id: "calibration".into(),
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
