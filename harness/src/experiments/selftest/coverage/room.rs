//! A room at random: luminaires of every form, boxes and meshes, and meters where bounds are hardest to keep.
//!
//! Every second room is a plain one, as most offices are: bodies are boxes, all of whose faces are large, and openings have flat sides,
//! half of them in the plane of the ceiling. There light is balanced between rectangles; elsewhere it is gathered by rays.

use std::sync::Arc;

use fastrand::Rng;
use glam::{DMat3, DVec3};
use luminaire::geometry::{Mesh, Reflectances, Room};
use luminaire::photometry::{HorizontalAxis, LuminousIntensityDistribution, LuminousOpening, Photometry};
use luminaire::scene::{Luminaire, LuminaireModel, Meter, Obstacle, Scene, Shape, flush};

use super::Kind;
use crate::experiments::draw::Draw;

/// What a room is furnished with.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Style {
    /// Boxes with large faces, openings with flat sides.
    Plain,
    /// Anything.
    Mixed,
}

/// A scene and its meters, each with where it is.
pub(super) fn room(seed: u64, meters: usize) -> (Scene, Vec<(Kind, Meter)>) {
    let mut draw = Draw(Rng::with_seed(seed));
    let style = draw.one_of(&[Style::Plain, Style::Mixed]);
    let size_m = DVec3::new(draw.within(3.0, 10.0), draw.within(3.0, 8.0), draw.within(2.4, 4.5));
    let mut rho = || draw.within(0.05, 0.85);
    let reflectance = Reflectances {
        floor: rho(),
        ceiling: rho(),
        wall_x_min: rho(),
        wall_x_max: rho(),
        wall_y_min: rho(),
        wall_y_max: rho(),
    };
    let room = Room { size_m, reflectance };
    let (mut luminaires, mut plates): (Vec<Luminaire>, Vec<Obstacle>) = (vec![], vec![]);
    for k in 0..draw.0.usize(1..5) {
        let luminaire = luminaire(&mut draw, k, size_m, style);
        let plate = flush::plate(&room, &luminaire);
        if plate.iter().all(|own| !plates.iter().any(|other| flush::overlap(&room, other, own))) {
            luminaires.push(luminaire);
            plates.extend(plate);
        }
    }
    let bodies = bodies(&mut draw, size_m, style);
    let obstacle = |[min_m, max_m]: &[DVec3; 2]| {
        let mesh = Mesh::cuboid(*min_m, *max_m);
        let shape = if style == Style::Mixed && draw.one_in(3) {
            Shape::Mesh { vertices_m: mesh.vertices_m, triangles: mesh.triangles }
        } else {
            Shape::Box { min_m: *min_m, max_m: *max_m }
        };
        Obstacle { shape, reflectance: draw.within(0.1, 0.8) }
    };
    let obstacles = bodies.iter().map(obstacle).chain(plates).collect();
    let scene = Scene { room: Some(room), obstacles, luminaires };
    let mut found = vec![];
    while found.len() < meters {
        let (kind, meter) = meter(&mut draw, size_m, &bodies, &scene.luminaires);
        let p = meter.position_m;
        let inside = p.cmpgt(DVec3::ZERO).all() && p.cmplt(size_m).all();
        let holds = |[low, high]: &[DVec3; 2]| p.cmpge(*low - 1e-6).all() && p.cmple(*high + 1e-6).all();
        if inside && !bodies.iter().any(holds) {
            found.push((kind, meter));
        }
    }
    (scene, found)
}

fn luminaire(draw: &mut Draw, index: usize, size_m: DVec3, style: Style) -> Luminaire {
    let kind = match style {
        Style::Plain => draw.0.usize(1..3),
        Style::Mixed => draw.0.usize(0..6),
    };
    let opening = match kind {
        0 => LuminousOpening::Point,
        1 => LuminousOpening::Box { x_m: draw.within(0.1, 0.8), y_m: draw.within(0.1, 0.8), height_m: 0.0 },
        2 => LuminousOpening::Box {
            x_m: draw.within(0.1, 0.6),
            y_m: draw.within(0.1, 0.6),
            height_m: draw.within(0.05, 0.3),
        },
        3 => {
            let diameter_m = draw.within(0.1, 0.5);
            LuminousOpening::Ellipsoid { x_m: diameter_m, y_m: diameter_m, z_m: diameter_m }
        }
        4 => LuminousOpening::Ellipse {
            x_m: draw.within(0.1, 0.5),
            y_m: draw.within(0.1, 0.5),
            height_m: if draw.one_in(2) { 0.0 } else { 0.2 },
        },
        _ => LuminousOpening::LyingCylinder {
            axis: HorizontalAxis::X,
            length_m: draw.within(0.3, 1.2),
            diameter_m: 0.08,
        },
    };
    let is_flush = style == Style::Plain && kind == 1 && draw.one_in(2);
    let below_m = if is_flush {
        0.0
    } else if draw.one_in(3) {
        draw.within(0.2, 0.3)
    } else {
        draw.within(0.4, 1.2)
    };
    let (x, y) = (draw.within(0.8, size_m.x - 0.8), draw.within(0.8, size_m.y - 0.8));
    let photometry = Photometry { opening, ..Photometry::of(distribution(draw)) };
    Luminaire {
        id: format!("luminaire {index}"),
        photometry: Arc::new(photometry),
        position_m: DVec3::new(x, y, size_m.z - below_m),
        orientation: DMat3::IDENTITY,
        flux_scale: 1.0,
        model: if opening == LuminousOpening::Point { LuminaireModel::Point } else { LuminaireModel::Area },
    }
}

fn distribution(draw: &mut Draw) -> LuminousIntensityDistribution {
    let step_deg = [1, 5, 10][draw.0.usize(0..3)];
    let gamma_deg: Vec<f64> = (0..=180).step_by(step_deg).map(f64::from).collect();
    let (peak, power) = (draw.within(100.0, 1000.0), draw.0.i32(1..9));
    let form = draw.0.usize(0..3);
    let candela = gamma_deg.iter().map(|g| {
        let (sin, cos) = g.to_radians().sin_cos();
        match form {
            0 => peak * cos.max(0.0).powi(power),
            1 => peak,
            _ => peak * (0.3 + sin * sin + if cos < 0.0 { 0.7 } else { 0.0 }),
        }
    });
    let candela = candela.collect();
    LuminousIntensityDistribution::axial(gamma_deg, candela)
        .unwrap_or_else(|e| unreachable!("tables made here are sound: {e}"))
}

fn bodies(draw: &mut Draw, size_m: DVec3, style: Style) -> Vec<[DVec3; 2]> {
    let least_m = if style == Style::Plain { 0.6 } else { 0.3 };
    let mut bodies: Vec<[DVec3; 2]> = vec![];
    for _ in 0..draw.0.usize(0..5) {
        let extent_m = DVec3::new(draw.within(least_m, 1.8), draw.within(least_m, 1.2), draw.within(least_m, 1.2));
        let x = match draw.0.usize(0..5) {
            0 => 0.0,
            // A gap that light hardly finds.
            1 => close_m(draw),
            _ => draw.within(0.05, size_m.x - extent_m.x - 0.05),
        };
        let y = draw.within(0.05, size_m.y - extent_m.y - 0.05);
        let low = DVec3::new(x, y, if draw.one_in(3) { draw.within(0.1, 0.4) } else { 0.0 });
        let high = low + extent_m;
        let meets = |[a, b]: &[DVec3; 2]| low.cmplt(*b + 0.01).all() && high.cmpgt(*a - 0.01).all();
        if !bodies.iter().any(meets) {
            bodies.push([low, high]);
        }
    }
    bodies
}

/// As close to a surface as meters come, every other time a millimetre.
fn close_m(draw: &mut Draw) -> f64 {
    if draw.one_in(2) { 1e-3 } else { draw.close_m() }
}

/// Beside one of a body's faces, every third time at one of its edges.
fn beside(draw: &mut Draw, [low, high]: [DVec3; 2]) -> DVec3 {
    let axis = draw.0.usize(0..3);
    let mut position_m = DVec3::from_array([0, 1, 2].map(|k| draw.within(low[k], high[k])));
    let ends = [low, high].map(|p| p[axis]);
    position_m[axis] = if draw.one_in(2) { ends[0] - close_m(draw) } else { ends[1] + close_m(draw) };
    if draw.one_in(3) {
        let along = (axis + 1) % 3;
        position_m[along] = if draw.one_in(2) { low[along] + close_m(draw) } else { high[along] - close_m(draw) };
    }
    position_m
}

fn meter(draw: &mut Draw, size_m: DVec3, bodies: &[[DVec3; 2]], luminaires: &[Luminaire]) -> (Kind, Meter) {
    let axis = DVec3::AXES[draw.0.usize(0..3)];
    let any = if draw.one_in(2) { axis } else { -axis };
    let inner = DVec3::new(
        draw.within(0.1, size_m.x - 0.1),
        draw.within(0.1, size_m.y - 0.1),
        draw.within(0.1, size_m.z - 0.1),
    );
    let (a, b, c) = (close_m(draw), close_m(draw), close_m(draw));
    let (kind, mut position_m, normal) = match draw.0.usize(0..8) {
        0 => (Kind::Wall, DVec3::new(a, inner.y, inner.z), any),
        1 => (Kind::Edge, DVec3::new(a, b, inner.z), any),
        2 => (Kind::Corner, DVec3::new(a, b, c), any),
        3 if !bodies.is_empty() => {
            let body = bodies[draw.0.usize(0..bodies.len())];
            (Kind::Body, beside(draw, body), any)
        }
        4 => {
            let above = luminaires[draw.0.usize(0..luminaires.len())].position_m;
            (Kind::Luminaire, above - DVec3::Z * draw.within(0.25, 1.0), DVec3::Z)
        }
        _ => (Kind::Open, inner, DVec3::Z),
    };
    if draw.one_in(3) && kind != Kind::Body {
        position_m.x = size_m.x - position_m.x;
    }
    (kind, Meter { position_m, normal })
}
