//! Random rooms: luminaires of every form, boxes and meshes, and meters where light is hardest to
//! sample.
//!
//! Every second room is plain, as most offices are: all bodies are boxes with large faces, and all
//! openings have flat sides, half of them flush with the ceiling.

use std::sync::Arc;

use fastrand::Rng;
use glam::{DMat3, DVec3};
use luxproof_photometry::{HorizontalAxis, LuminousIntensityDistribution, LuminousOpening, Photometry};
use luxproof_scene::geometry::{Mesh, Reflectances, Room};
use luxproof_scene::{Luminaire, LuminaireModel, Meter, Obstacle, Scene, Shape, flush};

use super::Kind;
use crate::draw::Draw;

/// The least gap between a luminaire and the ceiling that it hangs from, in metres.
const MIN_GAP_M: f64 = 0.005;

/// What a room contains.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Style {
    /// Boxes with large faces, openings with flat sides.
    Plain,
    /// Any body and any opening.
    Mixed,
}

/// Draws a scene and its meters, each with the kind of its position.
pub(super) fn draw_scene(seed: u64, meters: usize) -> (Scene, Vec<(Kind, Meter)>) {
    let mut draw = Draw(Rng::with_seed(seed));
    let style = draw.one_of(&[Style::Plain, Style::Mixed]);
    let size_m = DVec3::new(draw.within(3.0, 10.0), draw.within(3.0, 8.0), draw.within(2.4, 4.5));
    let [floor, ceiling, wall_x_min, wall_x_max, wall_y_min, wall_y_max] = [(); 6].map(|()| draw.within(0.05, 0.85));
    let reflectance = Reflectances { floor, ceiling, wall_x_min, wall_x_max, wall_y_min, wall_y_max };
    let room = Room { size_m, reflectance };
    let (mut luminaires, mut plates): (Vec<Luminaire>, Vec<Obstacle>) = (vec![], vec![]);
    for k in 0..draw.0.usize(1..5) {
        let luminaire = draw_luminaire(&mut draw, k, size_m, style);
        let plate = flush::plate(&room, &luminaire);
        // Two recessed luminaires cannot be in one place.
        if plate.iter().all(|new| !plates.iter().any(|other| flush::overlap(other, new))) {
            luminaires.push(luminaire);
            plates.extend(plate);
        }
    }
    let bodies = draw_bodies(&mut draw, size_m, style);
    let obstacles: Vec<Obstacle> = bodies.iter().map(|body| draw_obstacle(&mut draw, *body, style)).collect();
    let obstacles = obstacles.into_iter().chain(plates).collect();
    let scene = Scene { room: Some(room), obstacles, luminaires };
    let mut found = vec![];
    while found.len() < meters {
        let (kind, meter) = draw_meter(&mut draw, size_m, &bodies, &scene.luminaires);
        let p = meter.position_m;
        let is_inside = p.cmpgt(DVec3::ZERO).all() && p.cmplt(size_m).all();
        if is_inside && !bodies.iter().any(|body| contains(*body, p)) {
            found.push((kind, meter));
        }
    }
    (scene, found)
}

/// Whether a point is within a box or nearer to it than a micrometre.
fn contains([low, high]: [DVec3; 2], point_m: DVec3) -> bool {
    point_m.cmpge(low - 1e-6).all() && point_m.cmple(high + 1e-6).all()
}

/// Draws the reflectance of a body; in a mixed room every third body is a mesh.
fn draw_obstacle(draw: &mut Draw, [min_m, max_m]: [DVec3; 2], style: Style) -> Obstacle {
    let shape = if style == Style::Mixed && draw.one_in(3) {
        let mesh = Mesh::cuboid(min_m, max_m);
        mesh.into()
    } else {
        Shape::Box { min_m, max_m }
    };
    Obstacle { shape, reflectance: draw.within(0.1, 0.8) }
}

/// Draws a luminaire at or below the ceiling.
fn draw_luminaire(draw: &mut Draw, index: usize, size_m: DVec3, style: Style) -> Luminaire {
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
    let hung_m = if is_flush {
        0.0
    } else if draw.one_in(3) {
        draw.within(0.2, 0.3)
    } else {
        draw.within(0.4, 1.2)
    };
    // A luminaire that crosses the ceiling is no scene: a spec with one is refused.
    let below_m = if is_flush { hung_m } else { hung_m.max(opening.reach_m(DVec3::Z) + MIN_GAP_M) };
    let (x, y) = (draw.within(0.8, size_m.x - 0.8), draw.within(0.8, size_m.y - 0.8));
    let photometry = Photometry { opening, ..Photometry::of(draw_distribution(draw)) };
    Luminaire {
        id: format!("luminaire {index}"),
        photometry: Arc::new(photometry),
        position_m: DVec3::new(x, y, size_m.z - below_m),
        orientation: DMat3::IDENTITY,
        flux_scale: 1.0,
        model: if opening == LuminousOpening::Point { LuminaireModel::Point } else { LuminaireModel::Area },
    }
}

/// Draws an axially symmetric table.
fn draw_distribution(draw: &mut Draw) -> LuminousIntensityDistribution {
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

/// Draws boxes that keep a distance of a centimetre from each other.
fn draw_bodies(draw: &mut Draw, size_m: DVec3, style: Style) -> Vec<[DVec3; 2]> {
    let least_m = if style == Style::Plain { 0.6 } else { 0.3 };
    let mut bodies: Vec<[DVec3; 2]> = vec![];
    for _ in 0..draw.0.usize(0..5) {
        let extent_m = DVec3::new(draw.within(least_m, 1.8), draw.within(least_m, 1.2), draw.within(least_m, 1.2));
        let x = match draw.0.usize(0..5) {
            0 => 0.0,
            // A narrow gap, which few rays enter.
            1 => draw_gap_m(draw),
            _ => draw.within(0.05, size_m.x - extent_m.x - 0.05),
        };
        let y = draw.within(0.05, size_m.y - extent_m.y - 0.05);
        let low = DVec3::new(x, y, if draw.one_in(3) { draw.within(0.1, 0.4) } else { 0.0 });
        let high = low + extent_m;
        let meets = bodies.iter().any(|[a, b]| low.cmplt(*b + 0.01).all() && high.cmpgt(*a - 0.01).all());
        if !meets {
            bodies.push([low, high]);
        }
    }
    bodies
}

/// Draws a distance from a surface as small as meters may have; every second one is a millimetre.
fn draw_gap_m(draw: &mut Draw) -> f64 {
    if draw.one_in(2) { 1e-3 } else { draw.close_m() }
}

/// Draws a point close to a face of a body; every third one is also close to an edge.
fn draw_point_at(draw: &mut Draw, [low, high]: [DVec3; 2]) -> DVec3 {
    let axis = draw.0.usize(0..3);
    let mut position_m = DVec3::from_array([0, 1, 2].map(|k| draw.within(low[k], high[k])));
    let ends = [low, high].map(|p| p[axis]);
    position_m[axis] = if draw.one_in(2) { ends[0] - draw_gap_m(draw) } else { ends[1] + draw_gap_m(draw) };
    if draw.one_in(3) {
        let along = (axis + 1) % 3;
        position_m[along] = if draw.one_in(2) { low[along] + draw_gap_m(draw) } else { high[along] - draw_gap_m(draw) };
    }
    position_m
}

/// Draws a meter: close to walls, edges, corners, bodies or luminaires, or anywhere in the room.
fn draw_meter(draw: &mut Draw, size_m: DVec3, bodies: &[[DVec3; 2]], luminaires: &[Luminaire]) -> (Kind, Meter) {
    let axis = DVec3::AXES[draw.0.usize(0..3)];
    let any = if draw.one_in(2) { axis } else { -axis };
    let inner = DVec3::new(
        draw.within(0.1, size_m.x - 0.1),
        draw.within(0.1, size_m.y - 0.1),
        draw.within(0.1, size_m.z - 0.1),
    );
    let (a, b, c) = (draw_gap_m(draw), draw_gap_m(draw), draw_gap_m(draw));
    let (kind, mut position_m, normal) = match draw.0.usize(0..8) {
        0 => (Kind::Wall, DVec3::new(a, inner.y, inner.z), any),
        1 => (Kind::Edge, DVec3::new(a, b, inner.z), any),
        2 => (Kind::Corner, DVec3::new(a, b, c), any),
        3 if !bodies.is_empty() => {
            let body = bodies[draw.0.usize(0..bodies.len())];
            (Kind::Body, draw_point_at(draw, body), any)
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
