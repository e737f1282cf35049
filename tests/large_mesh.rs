//! A mesh of a million triangles fits into a gibibyte and agrees with the smooth body that it approximates.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use glam::{DMat3, DVec3};
use luxproof_photometry::{LuminousIntensityDistribution, Photometry};
use luxproof_scene::{Bounces, Luminaire, LuminaireModel, Meter, Obstacle, Scene, Shape, Transport};
use luxproof_simulator::{Accuracy, Uncertainty, illuminance};

/// A ball of `2 rings around` triangles.
fn ball(radius_m: f64, rings: u32, around: u32) -> Shape {
    let mut vertices_m = vec![];
    for ring in 0..=rings {
        for a in 0..around {
            let (sin_g, cos_g) = (PI * f64::from(ring) / f64::from(rings)).sin_cos();
            let (sin_c, cos_c) = (TAU * f64::from(a) / f64::from(around)).sin_cos();
            vertices_m.push(radius_m * DVec3::new(sin_g * cos_c, sin_g * sin_c, cos_g));
        }
    }
    let at = |ring: u32, a: u32| ring * around + a % around;
    let quads = (0..rings).flat_map(|r| (0..around).map(move |a| (r, a)));
    let halves = |(r, a)| [[at(r, a), at(r + 1, a), at(r + 1, a + 1)], [at(r, a), at(r + 1, a + 1), at(r, a + 1)]];
    Shape::Mesh { vertices_m, triangles: quads.flat_map(halves).collect() }
}

/// The most memory that this process has had, in MiB, where the system tells.
fn peak_mib() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmHWM:"))?;
    Some(line.split_whitespace().nth(1)?.parse::<f64>().ok()? / 1024.0)
}

#[test]
fn an_integrating_sphere_of_a_million_triangles_stays_within_a_gibibyte() {
    let (radius_m, rho, candela) = (2.0, 0.8, 100.0);
    let isotropic = LuminousIntensityDistribution::axial(vec![0.0, 180.0], vec![candela; 2]).unwrap();
    let scene = Scene {
        room: None,
        obstacles: vec![Obstacle { shape: ball(radius_m, 500, 1000), reflectance: rho }],
        luminaires: vec![Luminaire {
            id: "lamp".into(),
            photometry: Arc::new(Photometry::of(isotropic)),
            position_m: DVec3::new(0.5, -0.3, 0.2),
            orientation: DMat3::IDENTITY,
            flux_scale: 1.0,
            model: LuminaireModel::Point,
        }],
    };
    // On the wall every reflected ray adds the same, wherever the lamp stands.
    let inwards = DVec3::new(-0.6, 0.64, -0.48);
    let meter = Meter { position_m: -1.9999 * inwards, normal: inwards };
    let accuracy = Accuracy { relative_error: 5e-3, seed: 1 };
    let found = illuminance(&scene, &[meter], Transport::Indirect(Bounces::Converged), &accuracy).unwrap();
    let exact = 4.0 * PI * candela * rho / (4.0 * PI * radius_m * radius_m * (1.0 - rho));
    let [estimate] = found.estimates[..] else { panic!("{found:?}") };
    let Uncertainty::StandardError { value: u, .. } = estimate.uncertainty else { panic!("{estimate:?}") };
    // The mesh has 1e-5 less area than the sphere, the meter lies 1e-4 m inside it.
    let deviation = (estimate.illuminance.value() - exact).abs();
    assert!(deviation < 4.0 * u + 2e-4 * exact && u <= 5e-3 * exact, "{estimate:?}, exact {exact}");
    if let Some(peak) = peak_mib() {
        println!("peak {peak:.0} MiB");
        assert!(peak < 1024.0, "{peak} MiB");
    }
}
