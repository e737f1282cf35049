//! The scenes of the path tracer's tests, with converged values that two independent methods agreed upon.

use std::sync::Arc;

use glam::{DMat3, DVec3};

use luxproof_photometry::{LuminousIntensityDistribution, LuminousOpening, Photometry};
use luxproof_scene::geometry::{Reflectances, Room};
use luxproof_scene::{Luminaire, LuminaireModel, Meter, Obstacle, Scene, Shape};

pub(crate) fn luminaire(
    distribution: LuminousIntensityDistribution,
    opening: LuminousOpening,
    at_m: DVec3,
) -> Luminaire {
    Luminaire {
        id: "lamp".into(),
        photometry: Arc::new(Photometry { opening, ..Photometry::of(distribution) }),
        position_m: at_m,
        orientation: DMat3::IDENTITY,
        flux_scale: 1.0,
        model: if opening == LuminousOpening::Point { LuminaireModel::Point } else { LuminaireModel::Area },
    }
}

/// Case S1's axial uplight.
pub(crate) fn uplight() -> LuminousIntensityDistribution {
    let gamma = vec![0.0, 89.0, 90.0, 95.0, 115.0, 135.0, 155.0, 175.0, 180.0];
    let candela = vec![0.0, 0.0, 4.5, 35.7, 218.3, 421.6, 576.4, 662.3, 664.4];
    LuminousIntensityDistribution::axial(gamma, candela).unwrap()
}

/// Case S1: a 20 m cube with an axial uplight in its centre.
pub(crate) fn s1() -> Scene {
    Scene {
        room: Some(Room { size_m: DVec3::splat(20.0), reflectance: Reflectances::with_equal_walls(0.2, 0.5, 0.8) }),
        obstacles: vec![],
        luminaires: vec![luminaire(uplight(), LuminousOpening::Point, DVec3::splat(10.0))],
    }
}

pub(crate) const S1_METERS: [[f64; 2]; 4] = [[2.0, 2.0], [2.0, 10.0], [10.0, 2.0], [10.0, 10.0]];
pub(crate) const S1_INDIRECT: [f64; 4] = [0.94314714, 1.15551735, 1.15551735, 1.42062868];

pub(crate) fn up(x: f64, y: f64, z: f64) -> Meter {
    Meter { position_m: DVec3::new(x, y, z), normal: DVec3::Z }
}

pub(crate) fn s1_meters() -> Vec<Meter> {
    S1_METERS.iter().map(|[x, y]| up(*x, *y, 2.0)).collect()
}

/// A flat Lambertian downlight of 0.6 x 0.6 m and 1000 cd along its normal, tabulated every half degree.
pub(crate) fn panel(at_m: DVec3) -> Luminaire {
    let gamma: Vec<f64> = (0..=180).map(|k| 0.5 * f64::from(k)).collect();
    let candela = gamma.iter().map(|g| 1000.0 * g.to_radians().cos().max(0.0)).collect();
    let opening = LuminousOpening::Box { x_m: 0.6, y_m: 0.6, height_m: 0.0 };
    luminaire(LuminousIntensityDistribution::axial(gamma, candela).unwrap(), opening, at_m)
}

/// The black back of a ceiling panel, which keeps the ceiling behind it dark.
pub(crate) fn back(at_m: DVec3) -> Obstacle {
    let corner = |x: f64, y: f64| at_m + DVec3::new(0.3 * x, 0.3 * y, 0.0);
    let vertices_m = vec![corner(-1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0)];
    Obstacle { shape: Shape::Mesh { vertices_m, triangles: vec![[0, 1, 2], [0, 2, 3]] }, reflectance: 0.0 }
}

/// Case S2: a furnished room with four black-backed ceiling panels.
pub(crate) fn s2() -> Scene {
    let panels = [[2.0, 1.5], [6.0, 1.5], [2.0, 4.5], [6.0, 4.5]].map(|[x, y]| DVec3::new(x, y, 3.0));
    let cabinet = |min: [f64; 3], max: [f64; 3]| Obstacle {
        shape: Shape::Box { min_m: DVec3::from(min), max_m: DVec3::from(max) },
        reflectance: 0.5,
    };
    Scene {
        room: Some(Room {
            size_m: DVec3::new(8.0, 6.0, 3.0),
            reflectance: Reflectances::with_equal_walls(0.2, 0.5, 0.8),
        }),
        obstacles: [
            cabinet([1.0, 1.0, 0.0], [2.6, 1.8, 0.75]),
            cabinet([4.5, 3.5, 0.0], [6.1, 4.3, 0.75]),
            cabinet([5.5, 0.5, 0.0], [7.5, 1.5, 2.2]),
        ]
        .into_iter()
        .chain(panels.map(back))
        .collect(),
        luminaires: panels.map(panel).to_vec(),
    }
}

/// x, y, direct, indirect and its standard error.
pub(crate) const S2_VALUES: [[f64; 5]; 6] = [
    [0.25, 0.25, 66.24407, 51.0232, 0.0046],
    [1.75, 1.25, 226.03927, 53.0644, 0.0127],
    [3.75, 2.75, 161.02976, 48.966, 0.020],
    [4.25, 0.75, 123.15923, 53.512, 0.014],
    [5.25, 3.75, 210.12365, 50.245, 0.024],
    [7.25, 0.25, 0.0, 18.788, 0.007],
];

pub(crate) fn s2_meters() -> Vec<Meter> {
    S2_VALUES.iter().map(|v| up(v[0], v[1], 0.8)).collect()
}
