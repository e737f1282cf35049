//! Luminaires in the plane of the ceiling: what they light is the limit of what they light from just below it.

// A test may panic.
#![allow(clippy::unwrap_used)]

use std::sync::Arc;

use glam::DVec3;
use luxproof_calculators::{exitance_difference, inverse_square};
use luxproof_photometry::{LuminousIntensityDistribution, LuminousOpening, Photometry};
use luxproof_scene::geometry::{Reflectances, Room};
use luxproof_scene::{
    Bounces, Luminaire, LuminaireModel, Meter, Obstacle, Scene, Shape, Transport, flush, orientation,
};
use luxproof_simulator::{Accuracy, Estimate, Uncertainty, illuminance};

const CONVERGED: Transport = Transport::Indirect(Bounces::Converged);

fn lamp(model: LuminaireModel, opening: LuminousOpening, position_m: DVec3) -> Luminaire {
    let gamma: Vec<f64> = (0..=180).map(|k| 0.5 * f64::from(k)).collect();
    let candela = gamma.iter().map(|g| 1000.0 * g.to_radians().cos().max(0.0)).collect();
    let table = LuminousIntensityDistribution::axial(gamma, candela).unwrap();
    Luminaire {
        id: "panel".into(),
        photometry: Arc::new(Photometry { opening, ..Photometry::of(table) }),
        position_m,
        orientation: orientation(0.0, 0.0, 0.0),
        flux_scale: 1.0,
        model,
    }
}

fn room(height_m: f64) -> Room {
    let reflectance = Reflectances::with_equal_walls(0.2, 0.5, 0.8);
    Room { size_m: DVec3::new(6.0, 4.0, height_m), reflectance }
}

const PLACES: [[f64; 2]; 4] = [[1.5, 1.0], [4.5, 1.0], [1.5, 3.0], [4.5, 3.0]];
const PANEL: LuminousOpening = LuminousOpening::Box { x_m: 0.6, y_m: 0.6, height_m: 0.0 };

/// Four panels at 3 m in a room as high, which replace their pieces of the ceiling or not.
fn office(recessed: bool) -> Scene {
    let panel = |[x, y]: [f64; 2]| lamp(LuminaireModel::Area, PANEL, DVec3::new(x, y, 3.0));
    let luminaires: Vec<Luminaire> = PLACES.map(panel).to_vec();
    let plates = luminaires.iter().filter_map(|l| flush::plate(&room(3.0), l));
    let obstacles = if recessed { plates.collect() } else { vec![] };
    Scene { room: Some(room(3.0)), obstacles, luminaires }
}

/// The same as renderers had it before: in a room higher by twice the gap, under black boxes that fill the upper half of it.
fn hung(gap_m: f64) -> Scene {
    let height_m = 3.0 + 2.0 * gap_m;
    let back = |[x, y]: [f64; 2]| {
        let min_m = DVec3::new(x - 0.3, y - 0.3, 3.0 + gap_m);
        Obstacle { shape: Shape::Box { min_m, max_m: DVec3::new(x + 0.3, y + 0.3, height_m) }, reflectance: 0.0 }
    };
    Scene { room: Some(room(height_m)), obstacles: PLACES.map(back).to_vec(), ..office(false) }
}

fn meters() -> Vec<Meter> {
    let up = |x: f64, y: f64| Meter { position_m: DVec3::new(x, y, 0.8), normal: DVec3::Z };
    let wall = Meter { position_m: DVec3::new(0.05, 2.2, 1.6), normal: DVec3::X };
    vec![up(0.4, 0.4), up(1.5, 1.0), up(3.0, 2.0), up(5.2, 2.6), wall]
}

fn read(scene: &Scene, transport: Transport, relative_error: f64) -> Vec<(f64, f64)> {
    let solution = illuminance(scene, &meters(), transport, &Accuracy { relative_error, seed: 1 }).unwrap();
    let pair = |e: &Estimate| match e.uncertainty {
        Uncertainty::Bound(bound) => (e.illuminance.value(), bound),
        Uncertainty::StandardError { value, .. } => (e.illuminance.value(), 3.0 * value),
    };
    solution.estimates.iter().map(pair).collect()
}

/// Whether readings differ by no more than both allow (a bound, or three standard errors each) and a relative rest.
fn agree(a: &[(f64, f64)], b: &[(f64, f64)], rest: f64) -> bool {
    a.iter().zip(b).all(|(a, b)| (a.0 - b.0).abs() <= a.1 + b.1 + rest * b.0)
}

/// The largest relative deviation of one reading from another.
fn largest_difference(a: &[(f64, f64)], b: &[(f64, f64)]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a.0 / b.0 - 1.0).abs()).fold(0.0, f64::max)
}

#[test]
fn recessed_panels_light_as_panels_a_hairs_breadth_below_do() {
    let (flush, hung) = (office(true), hung(5e-4));
    let direct = [&flush, &hung].map(|s| read(s, Transport::Direct, 1e-6));
    assert!(largest_difference(&direct[0], &direct[1]) < 1e-6, "{direct:?}");
    let indirect = [&flush, &hung].map(|s| read(s, CONVERGED, 1e-3));
    assert!(agree(&indirect[0], &indirect[1], 5e-4), "{indirect:?}");
    // The control: a ceiling that still reflects under its panels is plainly another.
    let bright = read(&office(false), CONVERGED, 2e-3);
    let least = bright.iter().zip(&indirect[0]).map(|(b, f)| b.0 / f.0 - 1.0).fold(f64::INFINITY, f64::min);
    assert!(least > 0.02, "{bright:?} {indirect:?}");
}

#[test]
fn a_point_in_the_plane_of_the_ceiling_lights_as_one_just_below_it_does() {
    let scene = |z: f64| Scene {
        room: Some(room(3.0)),
        obstacles: vec![],
        luminaires: vec![lamp(LuminaireModel::Point, LuminousOpening::Point, DVec3::new(2.5, 1.75, z))],
    };
    for (transport, allowed) in [(Transport::Direct, 1e-6), (CONVERGED, 1e-4)] {
        let [on, below] = [3.0, 3.0 - 1e-7].map(|z| read(&scene(z), transport, 1e-5));
        assert!(largest_difference(&on, &below) < allowed, "{on:?} {below:?}");
        assert!(on.iter().all(|(lux, _)| *lux > 1.0), "{on:?}");
    }
    // A body in the room changes the solver, and behind it nothing.
    let mut furnished = scene(3.0);
    let (min_m, max_m) = (DVec3::new(5.0, 3.0, 0.0), DVec3::new(5.02, 3.02, 0.02));
    furnished.obstacles.push(Obstacle { shape: Shape::Box { min_m, max_m }, reflectance: 0.5 });
    for transport in [Transport::Direct, CONVERGED] {
        let [empty, furnished] = [&scene(3.0), &furnished].map(|s| read(s, transport, 2e-3));
        assert!(agree(&empty, &furnished, 1e-3), "{empty:?} {furnished:?}");
    }
}

#[test]
fn light_from_a_point_into_its_own_surface_is_lost() {
    let mut scene = Scene {
        luminaires: vec![lamp(LuminaireModel::Point, LuminousOpening::Point, DVec3::new(3.0, 2.0, 3.0))],
        ..Scene { room: Some(room(3.0)), ..Scene::default() }
    };
    let down = read(&scene, CONVERGED, 1e-4);
    let mut both = scene.luminaires[0].clone();
    both.orientation = orientation(0.0, 180.0, 0.0);
    scene.luminaires.push(both);
    let with_light_behind = read(&scene, CONVERGED, 1e-4);
    assert!(largest_difference(&down, &with_light_behind) < 1e-4, "{down:?} {with_light_behind:?}");
}

#[test]
fn a_recessed_disc_lights_as_the_square_of_its_area_far_away() {
    let disc = LuminousOpening::Ellipse { x_m: 0.3, y_m: 0.3, height_m: 0.0 };
    let side = 0.15 * std::f64::consts::PI.sqrt();
    let square = LuminousOpening::Box { x_m: side, y_m: side, height_m: 0.0 };
    let scene = |opening| {
        let panel = lamp(LuminaireModel::Area, opening, DVec3::new(2.5, 1.75, 3.0));
        let plate = flush::plate(&room(3.0), &panel).unwrap();
        Scene { room: Some(room(3.0)), obstacles: vec![plate], luminaires: vec![panel] }
    };
    for transport in [Transport::Direct, CONVERGED] {
        let [round, straight] = [disc, square].map(|o| read(&scene(o), transport, 4e-3));
        for (a, b) in round.iter().zip(&straight) {
            assert!((a.0 - b.0).abs() <= a.1 + b.1 + 2e-3 * b.0, "{round:?} {straight:?}");
        }
    }
}

#[test]
fn the_calculators_read_luminaires_in_the_ceiling() {
    let (scene, meter) = (office(true), meters()[2]);
    let mut as_points = scene.clone();
    as_points.luminaires.iter_mut().for_each(|l| l.model = LuminaireModel::Point);
    let points = inverse_square::direct_illuminance(&as_points, &meter).unwrap();
    let exact = read(&scene, Transport::Direct, 1e-4)[2].0;
    assert!((points.illuminance.value() / exact - 1.0).abs() < 0.02, "{points:?} for {exact}");
    let even = exitance_difference::indirect_illuminance(&scene, &meter).unwrap();
    let exact = read(&scene, CONVERGED, 1e-2)[2].0;
    assert!((even.illuminance.value() / exact - 1.0).abs() < 0.35, "{even:?} for {exact}");
}
