//! Luminaires in the plane of a room surface: a recessed opening replaces the piece of surface that it covers.
//!
//! Its face absorbs what it receives, as most openings do nearly; what it would send into its own surface is lost. In a scene that
//! piece is an [`Obstacle`], a plate of no thickness and of reflectance 0 in the surface's plane: of the two it is what one sees.

use glam::DVec3;

use super::contact::SNAP_M;
use super::{Luminaire, LuminaireModel, Obstacle, Scene, Shape};
use crate::geometry::{Room, Surface};

/// Nearer to a surface than this, in parts of the room's largest extent, is in its plane: decimals are rounded.
pub const IN_PLANE: f64 = 1e-9;

/// Corners of the plate of a round opening: a polygon of its area, whose edge is off the circle by 8e-4 of the radius at most. The
/// light comes from the opening itself, so that a thousandth of a narrow ring's absorption is all that is off.
pub(super) const CORNERS: u32 = 64;

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
    let near_m = SNAP_M.max(in_plane_m(room)) + in_plane_m(room);
    let (p, s) = (point_m, room.size_m);
    DVec3::new(snap(p.x, s.x, near_m), snap(p.y, s.y, near_m), snap(p.z, s.z, near_m))
}

/// A coordinate, on an end of `0..size` that is no farther than `near_m`.
pub(super) fn snap(x: f64, size: f64, near_m: f64) -> f64 {
    if x.abs() <= near_m {
        0.0
    } else if (size - x).abs() <= near_m {
        size
    } else {
        x
    }
}

/// The surface in whose plane a luminaire lies with all its opening.
pub fn surface_of(room: &Room, luminaire: &Luminaire) -> Option<Surface> {
    let near_m = in_plane_m(room);
    let mut near = Surface::ALL.into_iter().filter(|s| depth_m(room, *s, luminaire.position_m).abs() <= near_m);
    near.find(|s| reach_m(luminaire, s.inward_normal()) <= near_m)
}

/// How far a luminaire's opening reaches from its photometric centre along a unit vector of the room.
fn reach_m(luminaire: &Luminaire, normal: DVec3) -> f64 {
    match luminaire.model {
        LuminaireModel::Point => 0.0,
        LuminaireModel::Area | LuminaireModel::Impostor => {
            luminaire.photometry.opening.reach_m(luminaire.orientation.transpose() * normal)
        }
    }
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
pub(super) fn fan(corners: usize) -> impl Iterator<Item = [u32; 3]> {
    (2..corners as u32).map(|k| [0, k - 1, k])
}

/// Whether it is one polygon that turns the same way at all of its corners, as [`plate`] makes them.
pub fn is_plate(obstacle: &Obstacle) -> bool {
    let Shape::Mesh { vertices_m: p, triangles } = &obstacle.shape else { return false };
    triangles.iter().copied().eq(fan(p.len()))
        && !triangles.is_empty()
        && (0..p.len()).all(|k| turn_after(p, k).dot(turn_after(p, 0)) > 0.0)
}

/// The cross product of the edges before and after the corner that follows the `k`-th.
fn turn_after(corners_m: &[DVec3], k: usize) -> DVec3 {
    let [before, after] = edges_from(corners_m, k);
    before.cross(after)
}

/// The edge of a polygon that starts at the `k`-th corner, and the next.
pub(super) fn edges_from(corners_m: &[DVec3], k: usize) -> [DVec3; 2] {
    let [a, b, c] = [k, k + 1, k + 2].map(|k| corners_m[k % corners_m.len()]);
    [b - a, c - b]
}

/// Gives corners whose coordinates differ by the rounding of a quarter turn's cosine the same ones.
pub(super) fn straighten(corners_m: &mut [DVec3], size_m: f64) {
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
    if vertices_m.is_empty() {
        return None;
    }
    Surface::ALL.into_iter().find(|s| vertices_m.iter().all(|p| depth_m(room, *s, *p).abs() <= near_m))
}

/// The surface that a luminaire is let into: one in whose plane it lies, behind a black plate.
pub fn recess_of(scene: &Scene, luminaire: &Luminaire) -> Option<Surface> {
    let room = scene.room.as_ref()?;
    let surface = surface_of(room, luminaire).filter(|_| luminaire.model != LuminaireModel::Point)?;
    let mut plates = scene.obstacles.iter().filter(|o| is_plate(o) && lies_on(room, o) == Some(surface));
    plates.any(|plate| holds(plate, luminaire.position_m, in_plane_m(room))).then_some(surface)
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
    shines_along(surface.inward_normal(), luminaire)
}

/// Whether any light of a luminaire goes to the side of its plane to which a unit vector points, if it has any.
pub fn shines_along(normal: DVec3, luminaire: &Luminaire) -> bool {
    let table = &luminaire.photometry.distribution;
    if !luminaire.is_on() {
        return true;
    }
    if table.is_native() && table.node_directions().any(|own| lights_side(luminaire, own, normal)) {
        return true;
    }
    let mut gammas = table.gamma_deg().iter().copied().chain(angles_up_to(180.0));
    gammas.any(|gamma| {
        angles_up_to(355.0).any(|c| lights_side(luminaire, luxproof_photometry::direction(c, gamma), normal))
    })
}

/// Angles from 0 in steps of [`STEP_DEG`], in degrees.
fn angles_up_to(end_deg: f64) -> impl Iterator<Item = f64> {
    (0..=(end_deg / STEP_DEG) as u32).map(|k| STEP_DEG * f64::from(k))
}

/// Whether a direction of a luminaire's own frame points to the side of a normal and has light.
fn lights_side(luminaire: &Luminaire, own: DVec3, normal: DVec3) -> bool {
    (luminaire.orientation * own).dot(normal) > IN_PLANE
        && luminaire.photometry.distribution.intensity_towards(own).value() > 0.0
}

/// Whether two plates cover a common piece of one surface; touching is no overlap. Both are convex: some edge parts them if not.
pub fn overlap(a: &Obstacle, b: &Obstacle) -> bool {
    let (Shape::Mesh { vertices_m: p, .. }, Shape::Mesh { vertices_m: q, .. }) = (&a.shape, &b.shape) else {
        return false;
    };
    let (Some(normal), Some(other)) = (normal(p), normal(q)) else { return false };
    let near_m = IN_PLANE * p.iter().chain(q).map(|p| p.abs().max_element()).fold(0.0, f64::max);
    if other.dot(normal) < 1.0 - IN_PLANE || q.iter().any(|q| (*q - p[0]).dot(normal).abs() > near_m) {
        return false;
    }
    !(has_parting_edge(p, q, normal, near_m) || has_parting_edge(q, p, normal, near_m))
}

/// Whether all points lie beyond one edge of a convex polygon, or on it; `normal` is the polygon's.
fn has_parting_edge(polygon_m: &[DVec3], points_m: &[DVec3], normal: DVec3, near_m: f64) -> bool {
    (0..polygon_m.len()).any(|k| {
        let (at, next) = (polygon_m[k], polygon_m[(k + 1) % polygon_m.len()]);
        let inward = normal.cross(next - at).normalize_or_zero();
        points_m.iter().all(|o| (*o - at).dot(inward) <= near_m)
    })
}

/// The unit normal of a plate's front.
fn normal(corners_m: &[DVec3]) -> Option<DVec3> {
    let [a, b, c, ..] = corners_m else { return None };
    (*b - *a).cross(*c - *b).try_normalize()
}

#[cfg(test)]
#[path = "flush_tests.rs"]
pub(crate) mod tests;
