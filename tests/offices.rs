//! Offices with ten kinds of measured-like luminaires and random furniture: the simulator reads them to the uncertainty asked for within
//! counted rays, and its stated errors are honest against the certifier.

// A test may panic.
#![allow(clippy::unwrap_used)]

mod scenes;

use std::sync::Arc;

use glam::DVec3;
use luxproof_photometry::{LuminousIntensityDistribution, LuminousOpening, Photometry, lm63};
use luxproof_scene::contact::Surfaces;
use luxproof_scene::geometry::{Mesh, Reflectances, Room};
use luxproof_scene::{Bounces, Luminaire, LuminaireModel, Meter, Obstacle, Scene, Shape, Transport, orientation};
use luxproof_simulator::{Accuracy, Prepared, Stop, Uncertainty, certified};
use scenes::Random;

/// Ten processor seconds of one core, at the rate at which the simulator's budget counts rays.
const RAYS: u64 = 50_000_000;
/// Differences that Student's t with the stated degrees of freedom exceeds once in 2,000 times.
const FAR: f64 = 4.4;

/// Kinds of luminaires that offices have.
#[derive(Clone, Copy, Debug)]
enum Kind {
    Linear,
    Square,
    Round,
    WallWasher,
    Downlight,
    Spot,
    Uplight,
    Pendant,
    Flood,
    Globe,
}

const KINDS: [Kind; 10] = [
    Kind::Linear,
    Kind::Square,
    Kind::Round,
    Kind::WallWasher,
    Kind::Downlight,
    Kind::Spot,
    Kind::Uplight,
    Kind::Pendant,
    Kind::Flood,
    Kind::Globe,
];

impl Kind {
    /// Candela towards C and gamma in degrees, as a smooth curve.
    fn candela(self, c_deg: f64, gamma_deg: f64) -> f64 {
        let (c, gamma) = (c_deg.to_radians(), gamma_deg.to_radians());
        let down = gamma.cos().max(0.0);
        let up = (-gamma.cos()).max(0.0);
        match self {
            // A wing across the lamp, a cosine along it.
            Self::Linear => 900.0 * down * (1.0 + 1.2 * c.cos().powi(2) * (2.0 * gamma).sin().powi(2)),
            Self::Square => 1100.0 * down.powf(1.4),
            Self::Round => 500.0 * down + 60.0 * gamma.sin(),
            Self::WallWasher => {
                let towards = DVec3::new(gamma.sin() * c.cos(), gamma.sin() * c.sin(), -gamma.cos());
                3000.0 * towards.dot(DVec3::new(0.75, 0.0, -0.66)).max(0.0).powi(6) * f64::from(down > 0.0)
            }
            Self::Downlight => 9000.0 * (-(gamma_deg / 9.0).powi(2)).exp(),
            Self::Spot => 4000.0 * (-(gamma_deg / 22.0).powi(2)).exp() + 5.0 * down,
            Self::Uplight => 1500.0 * up.powf(1.2),
            Self::Pendant => 500.0 * down.powi(2) + 800.0 * up * (1.0 + 0.5 * c.cos().powi(2)),
            Self::Flood => unreachable!("its table is of type B"),
            Self::Globe => 180.0 - 120.0 * up.powi(4),
        }
    }

    /// The opening, and the height of the luminaire's centre below the ceiling in metres.
    fn opening(self) -> (LuminousOpening, f64) {
        match self {
            Self::Linear => (LuminousOpening::Box { x_m: 0.1, y_m: 1.2, height_m: 0.0 }, 0.0),
            Self::Square => (LuminousOpening::Box { x_m: 0.6, y_m: 0.6, height_m: 0.0 }, 0.0),
            Self::Round => (LuminousOpening::Ellipse { x_m: 0.4, y_m: 0.4, height_m: 0.08 }, 0.05),
            Self::WallWasher => (LuminousOpening::Box { x_m: 0.12, y_m: 0.6, height_m: 0.0 }, 0.0),
            Self::Downlight => (LuminousOpening::Ellipse { x_m: 0.1, y_m: 0.1, height_m: 0.0 }, 0.0),
            Self::Spot => (LuminousOpening::Ellipse { x_m: 0.08, y_m: 0.08, height_m: 0.0 }, 0.15),
            Self::Uplight => (LuminousOpening::Box { x_m: 0.15, y_m: 1.2, height_m: 0.0 }, 0.6),
            Self::Pendant => (LuminousOpening::Box { x_m: 0.2, y_m: 1.5, height_m: 0.05 }, 0.7),
            Self::Flood => (LuminousOpening::Box { x_m: 0.25, y_m: 0.35, height_m: 0.0 }, 0.3),
            Self::Globe => (LuminousOpening::Ellipsoid { x_m: 0.3, y_m: 0.3, z_m: 0.3 }, 0.5),
        }
    }

    /// A table every 15 and 5 degrees, with the scatter of a measurement.
    fn photometry(self, random: &mut Random) -> Photometry {
        let (opening, _) = self.opening();
        if matches!(self, Self::Flood) {
            return Photometry { opening, ..flood(random) };
        }
        let c_deg: Vec<f64> = (0..=24).map(|k| 15.0 * f64::from(k)).collect();
        let gamma_deg: Vec<f64> = (0..=36).map(|k| 5.0 * f64::from(k)).collect();
        let poles = [random.within(0.98, 1.02), random.within(0.98, 1.02)];
        let mut candela = vec![];
        for c in &c_deg[..24] {
            for gamma in &gamma_deg {
                let scatter = match *gamma {
                    0.0 => poles[0],
                    180.0 => poles[1],
                    _ => random.within(0.98, 1.02),
                };
                candela.push(scatter * self.candela(*c, *gamma));
            }
        }
        candela.extend_from_within(..gamma_deg.len());
        let table = LuminousIntensityDistribution::new(c_deg, gamma_deg, candela).unwrap();
        Photometry { opening, ..Photometry::of(table) }
    }
}

/// A floodlight of type B, without symmetry.
fn flood(random: &mut Random) -> Photometry {
    let h_deg: Vec<f64> = (-12..=12).map(|k| 5.0 * f64::from(k)).collect();
    let v_deg: Vec<f64> = (-10..=14).map(|k| 5.0 * f64::from(k)).collect();
    let mut rows = vec![];
    for h in &h_deg {
        let row = v_deg.iter().map(|v| {
            let beam = (1.0 - (h / 60.0).powi(2)).max(0.0) * (1.0 - ((v - 10.0) / 60.0).powi(2)).max(0.0);
            (3000.0 * beam * beam * random.within(0.98, 1.02)).to_string()
        });
        rows.push(row.collect::<Vec<_>>().join(" "));
    }
    let [v, h] = [&v_deg, &h_deg].map(|all| all.iter().map(f64::to_string).collect::<Vec<_>>().join(" "));
    let (nv, nh, rows) = (v_deg.len(), h_deg.len(), rows.join("\n"));
    let text = format!("IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 {nv} {nh} 2 2 0 0 0\n1 1 0\n{v}\n{h}\n{rows}\n");
    lm63::parse(text.as_bytes()).unwrap()
}

/// Tables, cupboards and chairs that stand apart.
fn furniture(random: &mut Random, size_m: DVec3) -> Vec<Obstacle> {
    let mut all: Vec<Obstacle> = vec![];
    let mut taken: Vec<[DVec3; 2]> = vec![];
    for _ in 0..12 {
        let kind = random.below(3);
        let extent_m = match kind {
            0 => DVec3::new(1.6, 0.8, 0.72),
            1 => DVec3::new(0.4, 1.2, 1.9),
            _ => DVec3::new(0.5, 0.5, 0.9),
        };
        let room_m = size_m - extent_m;
        let low = DVec3::new(random.within(0.05, room_m.x - 0.05), random.within(0.05, room_m.y - 0.05), 0.0);
        let high = low + extent_m;
        if taken.iter().any(|[a, b]| low.cmplt(*b + 0.05).all() && high.cmpgt(*a - 0.05).all()) {
            continue;
        }
        taken.push([low, high]);
        let reflectance = random.within(0.2, 0.6);
        let shapes = match kind {
            // A top, and one panel for legs.
            0 => vec![
                Shape::Box { min_m: low.with_z(0.69), max_m: high },
                Shape::Box { min_m: low, max_m: high.with_x(low.x + 0.03).with_z(0.69) },
            ],
            1 => vec![Shape::Box { min_m: low, max_m: high }],
            // A seat and a back.
            _ => [[low.with_z(0.42), high.with_z(0.46)], [low.with_z(0.46), high.with_y(low.y + 0.03)]]
                .map(|[min_m, max_m]| {
                    let Mesh { vertices_m, triangles } = Mesh::cuboid(min_m, max_m);
                    Shape::Mesh { vertices_m, triangles }
                })
                .to_vec(),
        };
        all.extend(shapes.into_iter().map(|shape| Obstacle { shape, reflectance }));
    }
    all
}

/// An office of 6 x 4 x 3 m with four luminaires of a kind, and its meters at a height of 1 m, clear of furniture.
fn office(kind: Kind, random: &mut Random) -> (Scene, Vec<Meter>) {
    let size_m = DVec3::new(6.0, 4.0, 3.0);
    let room = Room { size_m, reflectance: Reflectances::with_equal_walls(0.2, 0.5, 0.7) };
    let bodies = furniture(random, size_m);
    let photometry = Arc::new(kind.photometry(random));
    let (_, below_m) = kind.opening();
    let (mut luminaires, mut plates) = (vec![], vec![]);
    let surfaces = Surfaces::new(Some(room), &bodies);
    for (k, [x, y]) in [[1.5, 1.0], [4.5, 1.0], [1.5, 3.0], [4.5, 3.0]].into_iter().enumerate() {
        let tilt_deg = if matches!(kind, Kind::Spot | Kind::Flood) { random.within(0.0, 30.0) } else { 0.0 };
        let placed = surfaces.place(&Luminaire {
            id: format!("l{k}"),
            photometry: photometry.clone(),
            position_m: DVec3::new(x, y, size_m.z - below_m),
            orientation: orientation(90.0 * random.below(4) as f64, tilt_deg, 0.0),
            flux_scale: 1.0,
            model: LuminaireModel::Area,
        });
        plates.extend(placed.plates);
        luminaires.push(placed.luminaire);
    }
    let is_clear = |p: &DVec3| bodies.iter().all(|body| distance_m(body, *p) > 0.05);
    let places = (0..77).map(|k| DVec3::new(0.5 + 0.5 * f64::from(k % 11), 0.5 + 0.5 * f64::from(k / 11), 1.0));
    let meters = places.filter(is_clear).map(|position_m| Meter { position_m, normal: DVec3::Z }).collect();
    let obstacles = plates.into_iter().chain(bodies.iter().cloned()).collect();
    (Scene { room: Some(room), obstacles, luminaires }, meters)
}

/// The distance of a point from the bounding box of a body.
fn distance_m(body: &Obstacle, point_m: DVec3) -> f64 {
    let [low, high] = match &body.shape {
        Shape::Box { min_m, max_m } => [*min_m, *max_m],
        Shape::Mesh { vertices_m, .. } => {
            let all = vertices_m.iter().copied();
            [all.clone().fold(DVec3::INFINITY, DVec3::min), all.fold(DVec3::NEG_INFINITY, DVec3::max)]
        }
    };
    point_m.distance(point_m.clamp(low, high))
}

#[test]
fn ten_offices_are_read_to_half_a_percent_within_ten_counted_seconds() {
    let night = std::env::var("LUXPROOF_NIGHTLY").ok().and_then(|night| night.parse().ok());
    // By day three kinds more roughly, at a fixed seed.
    let (kinds, relative_error) = if night.is_some() { (&KINDS[..], 5e-3) } else { (&KINDS[6..9], 2e-2) };
    let (mut all, mut fine, mut squares, mut checked) = (0, 0, 0.0, 0);
    for kind in kinds {
        let mut random = Random(night.unwrap_or(65) + *kind as u64);
        let (scene, meters) = office(*kind, &mut random);
        let transport = Transport::Total(Bounces::Converged);
        let accuracy = Accuracy { relative_error, seed: night.unwrap_or(1) };
        let stop = Stop { rays: Some(RAYS), ..Stop::NEVER };
        let mut prepared = Prepared::new(&scene, transport, &accuracy).unwrap();
        let found = prepared.illuminance_until(&meters, &stop).unwrap();
        let readings = found.estimates.iter().map(|e| (e.illuminance.value(), standard_lx(e.uncertainty)));
        let readings: Vec<(f64, f64)> = readings.collect();
        all += readings.len();
        fine += readings.iter().filter(|(value, error)| *error <= relative_error * value).count();
        let some: Vec<usize> = (0..meters.len()).step_by(16).collect();
        let some_meters: Vec<Meter> = some.iter().map(|k| meters[*k]).collect();
        let truth = certified(&scene, &some_meters, transport, &accuracy).unwrap();
        for (k, estimate) in some.iter().zip(&truth.estimates) {
            let (value, error) = readings[*k];
            let exact = estimate.illuminance.value();
            let deviation = (value - exact) / error.hypot(standard_lx(estimate.uncertainty));
            assert!(deviation.abs() < FAR, "{kind:?} {}: {value} +- {error}, {estimate:?}", meters[*k].position_m);
            squares += deviation * deviation;
            checked += 1;
        }
    }
    assert!(fine as f64 >= 0.95 * all as f64, "{fine} of {all} are as certain as was asked");
    let rms = (squares / f64::from(checked)).sqrt();
    assert!(rms < 1.2 + 3.0 / (2.0 * f64::from(checked)).sqrt(), "{rms} of {checked}");
}

/// The standard uncertainty; a bound counts as a rectangular distribution.
fn standard_lx(uncertainty: Uncertainty) -> f64 {
    match uncertainty {
        Uncertainty::Bound(bound) => bound / 3_f64.sqrt(),
        Uncertainty::StandardError { value, .. } => value,
    }
}
