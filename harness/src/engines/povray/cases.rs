//! Jobs that several tests of this engine need, with their exact values.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{DMat3, DVec3};
use luminaire::geometry::{Reflectances, Room};
use luminaire::photometry::{LuminousIntensityDistribution, Photometry};
use luminaire::scene::{Bounces, Luminaire, LuminaireModel, Meter, Scene, Transport};

use crate::engines::{Budget, Job, Station};
use crate::reading::MeterId;

/// All reflected light.
pub(super) const INDIRECT: Transport = Transport::Indirect(Bounces::Converged);

/// Direct illuminance of case S1 at z = 17 facing down, from the closed form.
pub(super) const S1_DIRECT_LX: [f64; 4] = [0.852757462813, 2.230931614869, 2.230931614869, 13.559183673469];
/// Indirect illuminance of case S1 at z = 2 facing up, from hp collocation, each within 5e-8.
pub(super) const S1_INDIRECT_LX: [f64; 4] = [0.94314714, 1.15551735, 1.15551735, 1.42062868];

/// Case S1: a 20 m cube with an axial uplight in its middle; meters at z = 17 for direct light, at z = 2 for the rest.
pub(super) fn s1(transport: Transport) -> Job {
    let reflectance = Reflectances::with_equal_walls(0.2, 0.5, 0.8);
    let room = Some(Room { size_m: DVec3::splat(20.0), reflectance });
    let scene = Scene { room, obstacles: vec![], luminaires: vec![luminaire("s1", uplight(), DVec3::splat(10.0))] };
    let (z, normal) = if transport == Transport::Direct { (17.0, DVec3::NEG_Z) } else { (2.0, DVec3::Z) };
    let points = [(2.0, 2.0), (2.0, 10.0), (10.0, 2.0), (10.0, 10.0)];
    let meters: Vec<(DVec3, DVec3)> = points.iter().map(|&(x, y)| (DVec3::new(x, y, z), normal)).collect();
    job(scene, &meters, transport)
}

/// A job with a small budget.
pub(super) fn job(scene: Scene, meters: &[(DVec3, DVec3)], transport: Transport) -> Job {
    let station = |(k, &(position_m, normal))| Station {
        id: MeterId::new("meters", k),
        meter: Meter { position_m, normal },
        expected_lx: None,
    };
    Job {
        case: "test".into(),
        procedure: "illuminance".into(),
        scene,
        stations: meters.iter().enumerate().map(station).collect(),
        transport,
        budget: Budget { relative_error: 0.004, seconds: 20.0 },
        seed: 1,
        settings: BTreeMap::new(),
    }
}

/// A point luminaire, not turned.
pub(super) fn luminaire(id: &str, distribution: LuminousIntensityDistribution, position_m: DVec3) -> Luminaire {
    Luminaire {
        id: id.into(),
        photometry: Arc::new(Photometry::of(distribution)),
        position_m,
        orientation: DMat3::IDENTITY,
        flux_scale: 1.0,
        model: LuminaireModel::Point,
    }
}

/// The uplight of case S1.
pub(super) fn uplight() -> LuminousIntensityDistribution {
    let gamma = vec![0.0, 89.0, 90.0, 95.0, 115.0, 135.0, 155.0, 175.0, 180.0];
    let candela = vec![0.0, 0.0, 4.5, 35.7, 218.3, 421.6, 576.4, 662.3, 664.4];
    LuminousIntensityDistribution::axial(gamma, candela).unwrap()
}

/// A distribution without any symmetry, every value different.
pub(super) fn lopsided() -> LuminousIntensityDistribution {
    let c_deg = vec![0.0, 45.0, 90.0, 150.0, 180.0, 240.0, 300.0, 360.0];
    let gamma_deg = vec![0.0, 20.0, 45.0, 70.0, 90.0, 120.0, 180.0];
    let value = |c: f64, g: f64| {
        let bulge = 1.0 + 0.6 * (c.to_radians() - 0.7).cos() * g.to_radians().sin();
        100.0 + 400.0 * bulge * (0.6 + 0.4 * g.to_radians().cos())
    };
    let candela = c_deg.iter().flat_map(|&c| gamma_deg.iter().map(move |&g| value(c, g))).collect();
    LuminousIntensityDistribution::new(c_deg, gamma_deg, candela).unwrap()
}
