//! The analytic cases: every tabulated value derived a second time, the made-up luminaires measured, the laws of cases
//! without a table kept by the simulator.

// A test may panic.
#![allow(clippy::unwrap_used)]

use std::f64::consts::PI;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::DVec3;
use luxproof_calculators::ugr::observer;
use luxproof_calculators::{closed_form, inverse_square};
use luxproof_photometry::units::{Candela, Lumen, Lux};
use luxproof_photometry::{Photometry, read_file};
use luxproof_scene::geometry::configuration_factor::element_to_polygon;
use luxproof_scene::geometry::{Reflectances, Room};
use luxproof_scene::{Bounces, Luminaire, LuminaireModel, Meter, Scene, Transport, orientation};
use luxproof_simulator::{Accuracy, Sight, Uncertainty};

#[path = "analytic_values/cie171.rs"]
mod cie171;
#[path = "analytic_values/daylight.rs"]
mod daylight;

fn reference(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../reference").join(path)
}

fn photometry(name: &str) -> Photometry {
    read_file(&reference("luminaires").join(name)).unwrap()
}

/// A row of a table: where, what procedure, the printed value and one unit of its last digit.
struct Row {
    procedure: String,
    meter: Meter,
    value: f64,
    unit: f64,
}

/// The rows of a file of values below `reference`, which writes one a line.
fn rows(path: &str) -> Vec<Row> {
    let text = std::fs::read_to_string(reference(path)).unwrap();
    let mut procedure = String::new();
    let mut rows = vec![];
    for line in text.lines() {
        if let Some(key) = line.strip_prefix("  ").and_then(|l| l.strip_suffix("_illuminance:")) {
            procedure = key.to_string();
        }
        let Some(row) = line.trim().strip_prefix("- {at_m: ") else { continue };
        let printed = row.split('"').nth(1).unwrap();
        let decimals = printed.split_once('.').map_or(0, |(_, fraction)| fraction.len());
        let mut vectors = row.split('[').skip(1).map(|part| vector(part.split(']').next().unwrap()));
        let (position_m, normal) = (vectors.next().unwrap(), vectors.next().unwrap());
        let meter = Meter { position_m, normal };
        let unit = 10f64.powi(-i32::try_from(decimals).unwrap());
        rows.push(Row { procedure: procedure.clone(), meter, value: printed.parse().unwrap(), unit });
    }
    rows
}

fn vector(text: &str) -> DVec3 {
    let numbers: Vec<f64> = text.split(',').map(|n| n.trim().parse().unwrap()).collect();
    DVec3::from_slice(&numbers)
}

/// Compares every row of a table with a second derivation, to one unit of its last digit.
fn check(path: &str, count: usize, derive: impl Fn(&Meter) -> f64) {
    check_rows(path, &rows(path), count, derive);
}

fn check_rows(path: &str, rows: &[Row], count: usize, derive: impl Fn(&Meter) -> f64) {
    assert_eq!(rows.len(), count, "{path}");
    for row in rows {
        let derived = derive(&row.meter);
        assert!((derived - row.value).abs() <= row.unit, "{path} {:?}: {derived} against {}", row.meter, row.value);
    }
}

fn square(centre: DVec3, u: DVec3, v: DVec3) -> [DVec3; 4] {
    [centre - u - v, centre + u - v, centre + u + v, centre - u + v]
}

#[test]
fn point_and_area_sources_follow_lambert() {
    check("cie171/values/5.2.yaml", 10, |meter| {
        let offset = meter.position_m - DVec3::new(4.0, 4.0, 3.5);
        closed_form::lambertian_point(Candela(1000.0), -offset.z, offset.x.hypot(offset.y)).value()
    });
    let source = square(DVec3::new(4.0, 4.0, 3.5), DVec3::X * 0.5, DVec3::Y * 0.5);
    let exitance = closed_form::lambertian_exitance(1000.0).value();
    check("cie171/values/5.3.yaml", 10, |meter| exitance * element_to_polygon(meter.position_m, meter.normal, &source));
}

#[test]
fn an_evenly_lit_disc_reflects_by_its_closed_factors() {
    let path = "cie171/values/5.6.yaml";
    let (direct, indirect): (Vec<Row>, Vec<Row>) = rows(path).into_iter().partition(|row| row.procedure == "direct");
    check_rows(path, &indirect, 10, |meter| {
        let offset = (meter.position_m.x - 2.0).hypot(meter.position_m.y - 2.0);
        let height = meter.position_m.z;
        let horizontal = meter.normal == DVec3::NEG_Z;
        let factor = if horizontal { closed_form::disc_parallel } else { closed_form::disc_perpendicular };
        800.0 * factor(1.5, height, offset)
    });
    // The direct light is even: 1000 lx on the floor, 2.5 m below the spot, and by the square of the distance elsewhere.
    check_rows(path, &direct, 4, |meter| 1000.0 * 6.25 / (2.5 - meter.position_m.z).powi(2));
    // So the spot's own file sends it.
    let scene = scene(DVec3::new(4.0, 4.0, 3.0), 0.0, "even-spot-15dm.ies", DVec3::new(2.0, 2.0, 2.5));
    for row in direct {
        let read = inverse_square::direct_illuminance(&scene, &row.meter).unwrap().illuminance.value();
        assert!((read / row.value - 1.0).abs() < 5e-4, "{:?}: {read} against {}", row.meter, row.value);
    }
}

#[test]
fn a_screen_leaves_the_contour_integral_of_what_shows() {
    let at_edge = |shift: f64| {
        move |meter: &Meter| {
            let (x, z) = (meter.position_m.x, meter.position_m.z);
            let beyond = if z > 1.0 { x - (x - 2.41) * z / (z - 1.0) } else { f64::NEG_INFINITY };
            let element = meter.position_m - DVec3::new(1.2, 2.0, 0.0);
            800.0 * closed_form::disc_segment(1.0, beyond + shift - 1.2, element, meter.normal)
        }
    };
    check("cie171/values/5.7.yaml", 14, at_edge(0.0));
    // Without the screen, or with its lower edge seen 1 cm elsewhere, the table does not fit.
    for shift in [f64::NEG_INFINITY, 0.01] {
        let misses = rows("cie171/values/5.7.yaml")
            .iter()
            .filter(|r| (at_edge(shift)(&r.meter) - r.value).abs() > r.unit)
            .count();
        assert!(misses >= 5, "{shift}: {misses}");
    }
}

#[test]
fn within_a_closed_cube_of_panels_every_meter_reads_their_exitance() {
    let exitance = closed_form::lambertian_exitance(1000.0 / 4.0).value();
    let axes = [(DVec3::X, DVec3::Y), (DVec3::Y, DVec3::Z), (DVec3::Z, DVec3::X)];
    check("analytic/values/furnace.yaml", 16, |meter| {
        let sides = axes.iter().flat_map(|&(u, v)| {
            let out = u.cross(v);
            [out, -out].map(|out| square(DVec3::splat(2.0) + out, u, v))
        });
        exitance * sides.map(|side| element_to_polygon(meter.position_m, meter.normal, &side)).sum::<f64>()
    });
}

#[test]
fn a_body_in_a_furnace_is_as_bright_all_over_as_it_reflects() {
    let exitance = closed_form::lambertian_exitance(1000.0 / 4.0).value();
    let axes = [(DVec3::X, DVec3::Y), (DVec3::Y, DVec3::Z), (DVec3::Z, DVec3::X)];
    check("analytic/values/lit-body.yaml", 7, |meter| {
        let sides = axes.iter().flat_map(|&(u, v)| {
            let out = u.cross(v);
            [out, -out].map(|out| square(DVec3::splat(2.0) + out, u, v))
        });
        let factor: f64 = sides.map(|side| element_to_polygon(meter.position_m, meter.normal, &side)).sum();
        0.3 * exitance * factor / PI
    });
}

#[test]
fn an_opening_before_an_evenly_lit_disc_glares_by_the_formula() {
    let glare = Luminaire {
        orientation: orientation(180.0, 90.0, 0.0),
        ..scene(DVec3::ONE, 0.0, "glare-10cm.ies", DVec3::new(0.9, 2.0, 2.15)).luminaires.remove(0)
    };
    let scene = Scene { luminaires: vec![glare], ..Scene::default() };
    check("analytic/values/glare.yaml", 2, |eye| {
        let background = 800.0 * closed_form::disc_perpendicular(1.5, eye.position_m.z, eye.position_m.x - 2.0);
        observer::rating(observer::Glare::seen(&scene, eye).unwrap().sum, Lux(background))
    });
}

#[test]
fn a_lambertian_panel_has_one_luminance_from_wherever_it_is_seen() {
    let panel = Luminaire {
        orientation: orientation(0.0, 25.0, 0.0),
        model: LuminaireModel::Area,
        ..scene(DVec3::ONE, 0.0, "lambertian-06m.ies", DVec3::new(2.0, 2.0, 2.7)).luminaires.remove(0)
    };
    // What it gives an eye, by its corners, over the solid angle that it fills there.
    let side = square(DVec3::ZERO, 0.3 * DVec3::X, 0.3 * DVec3::Y).map(|p| panel.position_m + panel.orientation * p);
    check("analytic/values/opening.yaml", 4, |eye| {
        let exitance = closed_form::lambertian_exitance(1000.0 / 0.36).value();
        let lux = exitance * element_to_polygon(eye.position_m, eye.normal, &side);
        lux / Sight::of(&panel, eye).unwrap().projected_sr
    });
}

fn scene(room_m: DVec3, rho: f64, name: &str, position_m: DVec3) -> Scene {
    let luminaire = Luminaire {
        id: name.into(),
        photometry: Arc::new(photometry(name)),
        position_m,
        orientation: orientation(0.0, 0.0, 0.0),
        flux_scale: 1.0,
        model: LuminaireModel::Point,
    };
    let reflectance = Reflectances::with_equal_walls(rho, rho, rho);
    Scene { room: Some(Room { size_m: room_m, reflectance }), obstacles: vec![], luminaires: vec![luminaire] }
}

#[test]
fn the_made_up_luminaires_have_the_flux_of_their_laws() {
    let flux = |name: &str| photometry(name).distribution.flux().value();
    assert!((flux("axial.ies") - 1817.2814559).abs() < 1e-6);
    assert!((flux("isotropic.ies") - 10_000.0).abs() < 1e-4);
    for name in ["lambertian-point.ies", "lambertian-06m.ies", "lambertian-1m.ies", "lambertian-2m.ies"] {
        assert!((flux(name) / (1000.0 * PI) - 1.0).abs() < 3e-5, "{name} {}", flux(name));
    }
    for (name, radius) in [("even-spot-1m.ies", 1.0_f64), ("even-spot-15dm.ies", 1.5)] {
        let law = closed_form::even_spot_flux(Lux(1000.0), 2.5, (radius / 2.5).atan()).value();
        assert!((flux(name) / law - 1.0).abs() < 3e-5, "{name} {} {law}", flux(name));
    }
}

#[test]
fn the_reconstructed_pendant_meets_the_values_it_was_made_from() {
    let pendant = photometry("cachet-reconstructed.ies").distribution;
    let printed =
        [(90.0, 4.5), (95.0, 35.7), (115.0, 218.3), (135.0, 421.6), (155.0, 576.4), (175.0, 662.3), (180.0, 664.4)];
    for (gamma, candela) in printed {
        assert_eq!(pendant.intensity(0.0, gamma).value(), candela);
    }
    assert_eq!(pendant.flux_between(0.0, 89.9).value(), 0.0);
    assert!((pendant.flux().value() - 4496.2).abs() < 0.05, "{}", pendant.flux());
    let scene = scene(DVec3::splat(20.0), 0.5, "cachet-reconstructed.ies", DVec3::splat(10.0));
    for (x, y, printed) in [(2.0, 2.0, 2.70), (2.0, 10.0, 2.24), (10.0, 2.0, 6.91), (10.0, 10.0, 13.56)] {
        let meter = Meter { position_m: DVec3::new(x, y, 17.0), normal: DVec3::NEG_Z };
        let read = inverse_square::direct_illuminance(&scene, &meter).unwrap().illuminance.value();
        assert!((read - printed).abs() < 0.005, "({x}, {y}): {read}");
    }
}

/// Nodes and weights of four-point Gauss-Legendre quadrature on 0..1.
const GAUSS: [(f64, f64); 4] = [
    (0.06943184420297371, 0.17392742256872692),
    (0.33000947820757187, 0.3260725774312731),
    (0.6699905217924281, 0.3260725774312731),
    (0.9305681557970263, 0.17392742256872692),
];

#[test]
fn an_isotropic_point_follows_the_inverse_square_law() {
    // Independently of the table's square and cosine: from the luminaire's own file, by the calculator.
    let scene = scene(DVec3::new(5.0, 5.0, 4.0), 0.0, "isotropic.ies", DVec3::new(2.5, 2.5, 2.0));
    check("cie171/values/5.4.yaml", 96, |meter| {
        inverse_square::direct_illuminance(&scene, meter).unwrap().illuminance.value()
    });
}

#[test]
fn a_box_collects_the_flux_that_is_emitted_in_it() {
    // The meters of 5.4-flux.yaml, read from the file: 16 a set, six sets in the file's order.
    let text = std::fs::read_to_string(reference("cie171/5.4-flux.yaml")).unwrap();
    let scene = scene(DVec3::new(5.0, 5.0, 4.0), 0.0, "isotropic.ies", DVec3::new(2.5, 2.5, 2.0));
    let mut normal = DVec3::ZERO;
    let (mut collected, mut count) = (0.0, 0);
    for line in text.lines() {
        if let Some(rest) = line.trim().strip_prefix("normal: [") {
            normal = vector(rest.trim_end_matches(']'));
        } else if let Some(rest) = line.trim().strip_prefix("- [") {
            let meter = Meter { position_m: vector(rest.trim_end_matches(']')), normal };
            let area = if normal.z == 0.0 { 12.0 } else { 16.0 };
            let weight = GAUSS[count % 16 / 4].1 * GAUSS[count % 4].1 * area;
            collected += weight * inverse_square::direct_illuminance(&scene, &meter).unwrap().illuminance.value();
            count += 1;
        }
    }
    assert_eq!(count, 96);
    assert!((collected - 10_000.0).abs() < 0.3, "{collected}");
}

#[test]
fn the_simulator_keeps_the_mean_of_a_closed_room() {
    for rho in [0.05, 0.1, 0.3, 0.5, 0.7, 0.9, 0.95] {
        let scene = scene(DVec3::splat(4.0), rho, "isotropic.ies", DVec3::splat(2.0));
        let mut meters = vec![];
        let mut weights = vec![];
        for (i, (u, wu)) in GAUSS.iter().enumerate() {
            for (j, (v, wv)) in GAUSS.iter().enumerate().skip(i) {
                meters.push(Meter { position_m: DVec3::new(2.0 * u, 2.0 * v, 1e-4), normal: DVec3::Z });
                weights.push(if i == j { wu * wv } else { 2.0 * wu * wv });
            }
        }
        let accuracy = Accuracy { relative_error: 4e-3, seed: 1 };
        let transport = Transport::Indirect(Bounces::Converged);
        let solution = luxproof_simulator::illuminance(&scene, &meters, transport, &accuracy).unwrap();
        let mean: f64 = solution.estimates.iter().zip(&weights).map(|(e, w)| e.illuminance.value() * w).sum();
        // Bounds of one method err alike, so that they add up.
        let doubts: f64 = solution.estimates.iter().zip(&weights).map(|(e, w)| w * doubt(e.uncertainty)).sum();
        let law = closed_form::closed_room_mean_indirect(Lumen(10_000.0), 96.0, rho).value();
        // And what four Gauss points make of x ln x at the edges: 5.3e-4, at orders 6 to 10 of the simulator alike.
        let allowed = doubts + 6e-4 * law;
        assert!((mean - law).abs() < allowed, "rho {rho}: {mean} against {law}, allowed {allowed}");
        assert!(allowed < 0.01 * law, "rho {rho}: the check is blunt, {allowed} of {law}");
    }
}

#[test]
fn a_box_of_any_shape_keeps_its_mean_wherever_the_light_hangs() {
    // The meters of integrating-box.yaml, read from the file: 9 a set, six sets in the file's order.
    let text = std::fs::read_to_string(reference("analytic/integrating-box.yaml")).unwrap();
    let scene = scene(DVec3::new(6.0, 4.0, 3.0), 0.7, "isotropic.ies", DVec3::new(2.0, 1.5, 1.2));
    let mut normal = DVec3::ZERO;
    let (mut meters, mut areas) = (vec![], vec![]);
    for line in text.lines() {
        if let Some(rest) = line.trim().strip_prefix("normal: [") {
            normal = vector(rest.trim_end_matches(']'));
        } else if let Some(rest) = line.trim().strip_prefix("- [") {
            let (weights, k) = ([5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0], meters.len() % 9);
            areas.push(normal.abs().dot(DVec3::new(12.0, 18.0, 24.0)) * weights[k / 3] * weights[k % 3]);
            meters.push(Meter { position_m: vector(rest.trim_end_matches(']')), normal });
        }
    }
    assert_eq!(meters.len(), 54);
    assert!((areas.iter().sum::<f64>() - 108.0).abs() < 1e-9);
    let accuracy = Accuracy { relative_error: 1e-3, seed: 1 };
    let solution =
        luxproof_simulator::illuminance(&scene, &meters, Transport::Indirect(Bounces::Converged), &accuracy).unwrap();
    let flux: f64 = solution.estimates.iter().zip(&areas).map(|(e, area)| e.illuminance.value() * area).sum();
    let law = closed_form::closed_room_mean_indirect(Lumen(10_000.0), 108.0, 0.7).value();
    assert!((law - 216.049).abs() < 5e-4, "{law}");
    assert!((flux / 108.0 / law - 1.0).abs() < 5e-3, "{} for {law}", flux / 108.0);
}

fn doubt(uncertainty: Uncertainty) -> f64 {
    match uncertainty {
        Uncertainty::Bound(bound) => bound,
        Uncertainty::StandardError { value, .. } => value,
    }
}

#[test]
fn case_s1_agrees_with_the_calculators_and_the_simulator() {
    let mut scene = scene(DVec3::splat(20.0), 0.5, "axial.ies", DVec3::splat(10.0));
    scene.room = Some(Room { size_m: DVec3::splat(20.0), reflectance: Reflectances::with_equal_walls(0.2, 0.5, 0.8) });
    let rows = rows("analytic/values/s1.yaml");
    let (direct, indirect): (Vec<Row>, Vec<Row>) = rows.into_iter().partition(|row| row.procedure == "direct");
    assert_eq!((direct.len(), indirect.len()), (4, 4));
    for row in direct {
        let read = inverse_square::direct_illuminance(&scene, &row.meter).unwrap().illuminance.value();
        assert!((read - row.value).abs() <= row.unit, "{:?}: {read}", row.meter);
    }
    let meters: Vec<Meter> = indirect.iter().map(|row| row.meter).collect();
    let accuracy = Accuracy { relative_error: 2e-3, seed: 1 };
    let transport = Transport::Indirect(Bounces::Converged);
    let solution = luxproof_simulator::illuminance(&scene, &meters, transport, &accuracy).unwrap();
    for (row, estimate) in indirect.iter().zip(&solution.estimates) {
        let allowed = 4.0 * doubt(estimate.uncertainty) + 1e-6;
        let deviation = (estimate.illuminance.value() - row.value).abs();
        assert!(deviation < allowed && allowed < 0.02 * row.value, "{:?}: {estimate:?}", row.meter);
    }
}
