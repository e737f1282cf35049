//! Laws of the luminaire samplers: every opening sends out the table's intensity, no more and no less.

use std::sync::Arc;

use approx::assert_relative_eq;

use super::*;
use luxproof_photometry::{HorizontalAxis, LuminousOpening, Photometry, direction};
use luxproof_scene::{LuminaireModel, orientation};

const OPENINGS: [LuminousOpening; 8] = [
    LuminousOpening::Point,
    LuminousOpening::Box { x_m: 0.6, y_m: 0.3, height_m: 0.0 },
    LuminousOpening::Box { x_m: 0.6, y_m: 0.3, height_m: 0.2 },
    LuminousOpening::Box { x_m: 0.0, y_m: 1.2, height_m: 0.0 },
    LuminousOpening::Ellipse { x_m: 0.4, y_m: 0.7, height_m: 0.0 },
    LuminousOpening::Ellipse { x_m: 0.4, y_m: 0.7, height_m: 0.3 },
    LuminousOpening::Ellipsoid { x_m: 0.4, y_m: 0.4, z_m: 0.9 },
    LuminousOpening::LyingCylinder { axis: HorizontalAxis::Y, length_m: 1.2, diameter_m: 0.1 },
];

fn lamp(opening: LuminousOpening) -> Luminaire {
    let candela = (0..12).map(|k| f64::from(10 + k * k % 7)).collect();
    let distribution =
        LuminousIntensityDistribution::new(vec![0.0, 50.0, 90.0], vec![0.0, 40.0, 95.0, 170.0], candela).unwrap();
    Luminaire {
        id: "lamp".into(),
        photometry: Arc::new(Photometry { opening, ..Photometry::of(distribution) }),
        position_m: DVec3::new(1.0, 2.0, 3.0),
        orientation: orientation(40.0, 25.0, 10.0),
        flux_scale: 0.7,
        model: LuminaireModel::Area,
    }
}

/// The mean over a grid of mid-points of the unit square.
fn mean(n: u32, f: impl Fn([f64; 2]) -> f64) -> f64 {
    let at = |k: u32| (f64::from(k) + 0.5) / f64::from(n);
    (0..n * n).map(|k| f([at(k % n), at(k / n)])).sum::<f64>() / f64::from(n * n)
}

#[test]
fn the_parts_of_every_opening_share_the_intensity_in_every_direction() {
    for opening in OPENINGS {
        let opening = Opening::from(opening);
        for (c, gamma) in [(0.0, 0.0), (20.0, 40.0), (130.0, 90.0), (250.0, 125.0), (0.0, 180.0)] {
            let own = direction(c, gamma);
            let share = mean(600, |u| share(&opening, &pick_part(&opening, u), own));
            assert_relative_eq!(share, 1.0, max_relative = 5e-3);
        }
    }
}

#[test]
fn far_away_every_opening_is_a_point() {
    for opening in OPENINGS {
        let lamp = lamp(opening);
        let emitter = Emitter::new(&lamp).unwrap();
        let away = lamp.orientation * direction(70.0, 60.0);
        let far = lamp.position_m + 1e4 * away;
        let lux = mean(200, |u| emitter.arrival(far, -away, u).map_or(0.0, |a| a.lux));
        assert_relative_eq!(lux, lamp.intensity_towards(away).value() / 1e8, max_relative = 1e-2);
    }
}

#[test]
fn rays_carry_the_flux_of_the_table_with_the_density_that_they_claim() {
    for opening in OPENINGS {
        let lamp = lamp(opening);
        let emitter = Emitter::new(&lamp).unwrap();
        let flux = mean(150, |along| {
            let at = [(along[0] * 97.0).fract(), (along[1] * 89.0).fract()];
            let ray = emitter.emit(at, along);
            let gamma_deg = emitter.bands.lit_gamma_deg(emitter.to_own * ray.direction).unwrap();
            assert_relative_eq!(emitter.bands.density_per_sr(gamma_deg), ray.density_per_sr, max_relative = 1e-9);
            ray.candela / ray.density_per_sr
        });
        assert_relative_eq!(flux, emitter.flux_lm(), max_relative = 3e-2);
    }
}

#[test]
fn a_lambertian_disc_lights_the_point_below_it_by_its_closed_form() {
    // E = pi L r^2 / (r^2 + h^2), with L = I0 / (pi r^2).
    let gamma: Vec<f64> = (0..=900).map(|k| 0.1 * f64::from(k)).collect();
    let candela = gamma.iter().map(|g| 100.0 * g.to_radians().cos()).collect();
    let distribution = LuminousIntensityDistribution::axial(gamma, candela).unwrap();
    let opening = LuminousOpening::Ellipse { x_m: 1.0, y_m: 1.0, height_m: 0.0 };
    let lamp = Luminaire {
        photometry: Arc::new(Photometry { opening, ..Photometry::of(distribution) }),
        orientation: DMat3::IDENTITY,
        flux_scale: 1.0,
        ..lamp(opening)
    };
    let emitter = Emitter::new(&lamp).unwrap();
    for h in [0.2, 1.0, 5.0] {
        let below = lamp.position_m - DVec3::Z * h;
        let lux = mean(300, |u| emitter.arrival(below, DVec3::Z, u).map_or(0.0, |a| a.lux));
        assert_relative_eq!(lux, 100.0 / (0.25 + h * h), max_relative = 1e-3);
    }
}
