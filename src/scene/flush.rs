//! Luminaires in the plane of a room surface: a recessed opening replaces the piece of surface that it covers.
//!
//! Its face absorbs what it receives, as most openings do nearly; what it would send into its own surface is lost. In a scene that
//! piece is an [`Obstacle`], a plate of no thickness and of reflectance 0 in the surface's plane: of the two it is what one sees.

use glam::DVec3;

use super::{Luminaire, LuminaireModel, Obstacle, Scene, Shape};
use crate::geometry::{Room, Surface};

/// Nearer to a surface than this, in parts of the room's largest extent, is in its plane: decimals are rounded.
pub const IN_PLANE: f64 = 1e-9;

/// Corners of the plate of a round opening: a polygon of its area, whose edge is off the circle by 8e-4 of the radius at most. The
/// light comes from the opening itself, so that a thousandth of a narrow ring's absorption is all that is off.
const CORNERS: u32 = 64;

/// Straighter than this, in parts of the room's size, an edge runs along an axis: a cosine of 90 degrees is not quite zero.
const STRAIGHT: f64 = 1e-12;

/// Steps of a degree between directions that are tried for light, beside the table's own.
const STEP_DEG: f64 = 5.0;

fn in_plane_m(room: &Room) -> f64 {
    IN_PLANE * room.size_m.max_element()
}

/// How far inside a surface's plane a point is, in metres.
fn depth_m(room: &Room, surface: Surface, point_m: DVec3) -> f64 {
    let along = point_m[surface.axis()];
    if surface.is_far() { room.size_m[surface.axis()] - along } else { along }
}

/// The point, on the surfaces that it is nearly on.
pub fn snapped(room: &Room, point_m: DVec3) -> DVec3 {
    let near_m = in_plane_m(room);
    let on = |x: f64, size: f64| {
        if x.abs() <= near_m {
            0.0
        } else if (size - x).abs() <= near_m {
            size
        } else {
            x
        }
    };
    let (p, s) = (point_m, room.size_m);
    DVec3::new(on(p.x, s.x), on(p.y, s.y), on(p.z, s.z))
}

/// The surface in whose plane a luminaire lies with all its opening.
pub fn surface_of(room: &Room, luminaire: &Luminaire) -> Option<Surface> {
    let near_m = in_plane_m(room);
    let reach_m = |surface: Surface| match luminaire.model {
        LuminaireModel::Point => 0.0,
        LuminaireModel::Area | LuminaireModel::Impostor => {
            luminaire.photometry.opening.reach_m(luminaire.orientation.transpose() * surface.inward_normal())
        }
    };
    let lies_in = |s: &Surface| depth_m(room, *s, luminaire.position_m).abs() <= near_m && reach_m(*s) <= near_m;
    Surface::ALL.into_iter().find(lies_in)
}

/// The black plate that a flush opening puts in the place of its piece of surface; `None` where it is not flush or has no area.
pub fn plate(room: &Room, luminaire: &Luminaire) -> Option<Obstacle> {
    if luminaire.model == LuminaireModel::Point {
        return None;
    }
    let surface = surface_of(room, luminaire)?;
    let own = luminaire.photometry.opening.flat_outline_m(CORNERS)?;
    let mut vertices_m: Vec<DVec3> =
        own.into_iter().map(|p| luminaire.position_m + luminaire.orientation * p).collect();
    straighten(&mut vertices_m, room.size_m.max_element());
    let plane_m = if surface.is_far() { room.size_m[surface.axis()] } else { 0.0 };
    for corner in &mut vertices_m {
        corner[surface.axis()] = plane_m;
    }
    let normal = (vertices_m[1] - vertices_m[0]).cross(vertices_m[2] - vertices_m[1]);
    if normal.dot(surface.inward_normal()) < 0.0 {
        vertices_m.reverse();
    }
    let triangles = fan(vertices_m.len()).collect();
    Some(Obstacle { shape: Shape::Mesh { vertices_m, triangles }, reflectance: 0.0 })
}

/// The triangles of a convex polygon.
fn fan(corners: usize) -> impl Iterator<Item = [u32; 3]> {
    (2..corners as u32).map(|k| [0, k - 1, k])
}

/// Whether it is one polygon that turns the same way at all of its corners, as [`plate`] makes them.
pub fn is_plate(obstacle: &Obstacle) -> bool {
    let Shape::Mesh { vertices_m: p, triangles } = &obstacle.shape else { return false };
    let at = |k: usize| p[k % p.len()];
    let turn = |k: usize| (at(k + 1) - at(k)).cross(at(k + 2) - at(k + 1));
    triangles.iter().copied().eq(fan(p.len()))
        && !triangles.is_empty()
        && (0..p.len()).all(|k| turn(k).dot(turn(0)) > 0.0)
}

/// Gives corners whose coordinates differ by the rounding of a quarter turn's cosine the same ones.
fn straighten(corners_m: &mut [DVec3], size_m: f64) {
    for k in 1..corners_m.len() {
        for axis in 0..3 {
            let own = corners_m[k][axis];
            let same = corners_m[..k].iter().map(|p| p[axis]).find(|x| (x - own).abs() <= STRAIGHT * size_m);
            corners_m[k][axis] = same.unwrap_or(own);
        }
    }
}

/// The surface of the room that a plate of no thickness lies on.
pub fn lies_on(room: &Room, obstacle: &Obstacle) -> Option<Surface> {
    let Shape::Mesh { vertices_m, .. } = &obstacle.shape else { return None };
    let near_m = in_plane_m(room);
    let on = |s: &Surface| vertices_m.iter().all(|p| depth_m(room, *s, *p).abs() <= near_m);
    Surface::ALL.into_iter().find(|s| !vertices_m.is_empty() && on(s))
}

/// The surface that a luminaire is let into: one in whose plane it lies, behind a black plate.
pub fn recess_of(scene: &Scene, luminaire: &Luminaire) -> Option<Surface> {
    let room = scene.room.as_ref()?;
    let surface = surface_of(room, luminaire).filter(|_| luminaire.model != LuminaireModel::Point)?;
    let covers = |o: &Obstacle| {
        o.reflectance == 0.0 && lies_on(room, o) == Some(surface) && holds(o, luminaire.position_m, in_plane_m(room))
    };
    scene.obstacles.iter().any(covers).then_some(surface)
}

fn holds(plate: &Obstacle, point_m: DVec3, near_m: f64) -> bool {
    let Shape::Mesh { vertices_m, .. } = &plate.shape else { return false };
    let [low, high] = extent(vertices_m);
    point_m.cmpge(low - near_m).all() && point_m.cmple(high + near_m).all()
}

fn extent(vertices_m: &[DVec3]) -> [DVec3; 2] {
    let low = vertices_m.iter().fold(DVec3::INFINITY, |low, p| low.min(*p));
    [low, vertices_m.iter().fold(DVec3::NEG_INFINITY, |high, p| high.max(*p))]
}

/// Whether any light of a luminaire on a surface goes into the room, if it has any.
pub fn shines_from(surface: Surface, luminaire: &Luminaire) -> bool {
    let table = &luminaire.photometry.distribution;
    if !luminaire.is_on() {
        return true;
    }
    let grid = |end: f64| (0..=(end / STEP_DEG) as u32).map(|k| STEP_DEG * f64::from(k));
    let (gammas, planes): (Vec<f64>, Vec<f64>) =
        (table.gamma_deg().iter().copied().chain(grid(180.0)).collect(), grid(355.0).collect());
    let lit_towards = |own: DVec3| {
        (luminaire.orientation * own).dot(surface.inward_normal()) > IN_PLANE
            && table.intensity_towards(own).value() > 0.0
    };
    if table.is_native() && table.node_directions().any(lit_towards) {
        return true;
    }
    let lit = |c: f64, gamma: f64| lit_towards(crate::photometry::direction(c, gamma));
    gammas.iter().any(|gamma| planes.iter().any(|c| lit(*c, *gamma)))
}

/// Whether two plates cover a common piece of one surface; touching is no overlap. Both are convex: some edge parts them if not.
pub fn overlap(room: &Room, a: &Obstacle, b: &Obstacle) -> bool {
    let (Shape::Mesh { vertices_m: p, .. }, Shape::Mesh { vertices_m: q, .. }) = (&a.shape, &b.shape) else {
        return false;
    };
    let (Some(surface), near_m) = (lies_on(room, a), in_plane_m(room)) else { return false };
    if lies_on(room, b) != Some(surface) {
        return false;
    }
    let ([low, high], [from, to]) = (extent(p), extent(q));
    let apart = (0..3).any(|k| k != surface.axis() && high[k].min(to[k]) - low[k].max(from[k]) <= near_m);
    let normal = surface.inward_normal();
    let parts = |edges: &[DVec3], others: &[DVec3]| {
        (0..edges.len()).any(|k| {
            let (at, next) = (edges[k], edges[(k + 1) % edges.len()]);
            let inward = normal.cross(next - at).normalize_or_zero();
            others.iter().all(|o| (o - at).dot(inward) <= near_m)
        })
    };
    !(apart || parts(p, q) || parts(q, p))
}

#[cfg(test)]
#[path = "flush_tests.rs"]
mod tests;
