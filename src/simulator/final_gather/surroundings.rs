//! What rays of the final gather meet: the room's walls, boxes by formula, triangles through the tree; all in `f64`.
//!
//! It shares nothing with the path tracer but the tree of triangles, so that each can be held against the other.

use glam::{DVec2, DVec3};

use super::face::{Face, mean_wall_m2};
use crate::geometry::bvh::{BvhError, Ray, TriangleBvh};
use crate::geometry::{Mesh, Room};
use crate::scene::{Obstacle, Shape};
use crate::simulator::visibility::Occluder;

/// Boxes beyond which the tree is faster than trying each in turn.
const MOST_BOXES: usize = 32;
/// Boxes up to which all their faces are known; rays go on from those of more that are smaller than a part of the room's mean wall.
const FEW_BOXES: usize = 12;
const SMALL: f64 = 0.01;
/// How far rays start off a triangle, of the scene's extent.
const LIFT: f64 = 1e-10;
/// The part of the way to a luminaire beyond which nothing hides it: it may lie upon what holds it.
const FAR_END: f64 = 1.0 - 1e-10;

/// Everything that blocks or reflects.
#[derive(Debug)]
pub(super) struct Surroundings {
    pub(super) room: Option<Room>,
    /// The room's walls and larger faces of boxes; none in free field.
    pub(super) faces: Vec<Face>,
    boxes: Vec<Body>,
    tree: Tree,
    reflectances: Vec<f64>,
    /// Boxes round all bodies, flat ones on the walls left out.
    bounds: Vec<[DVec3; 2]>,
    /// Those of them that are boxes.
    solid: Vec<[DVec3; 2]>,
    /// Whether there are no others, meshes that lie flat on a wall apart.
    pub(super) cuts_exactly: bool,
    extent_m: f64,
    /// What hides a face from a place where everything that reflects is a face; `None` where something else does, too.
    hiding: Option<Vec<Occluder>>,
}

struct Tree(TriangleBvh);

impl std::fmt::Debug for Tree {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Tree")
    }
}

#[derive(Clone, Copy, Debug)]
struct Body {
    min_m: DVec3,
    max_m: DVec3,
    reflectance: f64,
    /// Its faces among all, at twice the axis and one more at its far end.
    faces: [Option<usize>; 6],
}

/// A place on a diffuse surface, seen from one side.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub(super) point_m: DVec3,
    /// Towards the side that is seen.
    pub(super) normal: DVec3,
    pub(super) reflectance: f64,
    /// The face, where it is on one.
    pub(super) face: Option<usize>,
    pub(super) distance_m: f64,
}

impl Surroundings {
    pub(super) fn new(room: Option<Room>, obstacles: &[Obstacle], reach_m: f64) -> Result<Self, BvhError> {
        let count = obstacles.iter().filter(|o| Occluder::aligned(&o.shape).is_some()).count();
        let least = if count <= FEW_BOXES { 0.0 } else { SMALL };
        let mut faces: Vec<Face> = room.iter().flat_map(Face::walls).collect();
        let (mut boxes, mut bounds, mut solid, mut reflectances) = (vec![], vec![], vec![], vec![]);
        let (mut vertices, mut triangles): (Vec<DVec3>, Vec<[u32; 3]>) = (vec![], vec![]);
        for Obstacle { shape, reflectance } in obstacles {
            let mut add = |v: &[DVec3], t: &[[u32; 3]]| {
                let first = vertices.len() as u32;
                vertices.extend(v);
                triangles.extend(t.iter().map(|f| f.map(|k| first + k)));
            };
            match (Occluder::aligned(shape), shape) {
                (Some(Occluder { min_m, max_m }), _) if count <= MOST_BOXES => {
                    let mut add = |k: usize| {
                        let room = room?;
                        let face = Face::of_box(&room, [min_m, max_m], k / 2, k % 2 == 1, *reflectance)?;
                        let is_known = face.area_m2() >= least * mean_wall_m2(room.size_m);
                        is_known.then(|| faces.push(face)).map(|()| faces.len() - 1)
                    };
                    let own = std::array::from_fn(&mut add);
                    boxes.push(Body { min_m, max_m, reflectance: *reflectance, faces: own });
                    solid.push([min_m, max_m]);
                }
                (_, Shape::Box { min_m, max_m }) => {
                    let mesh = Mesh::cuboid(*min_m, *max_m);
                    add(&mesh.vertices_m, &mesh.triangles);
                    solid.push([*min_m, *max_m]);
                }
                (_, Shape::Mesh { vertices_m, triangles }) => {
                    add(vertices_m, triangles);
                    let low = vertices_m.iter().fold(DVec3::INFINITY, |a, b| a.min(*b));
                    let high = vertices_m.iter().fold(DVec3::NEG_INFINITY, |a, b| a.max(*b));
                    bounds.extend((!vertices_m.is_empty()).then_some([low, high]));
                }
            }
            reflectances.resize(triangles.len(), *reflectance);
        }
        let stands = |b: &[DVec3; 2]| !room.is_some_and(|room| lies_on_a_wall(&room, *b));
        solid.retain(stands);
        bounds.retain(stands);
        let cuts_exactly = bounds.is_empty();
        bounds.extend(&solid);
        let reach_m = bounds.iter().flatten().map(|p| p.abs().max_element()).fold(reach_m, f64::max);
        let extent_m = reach_m.max(room.map_or(0.0, |r| r.size_m.max_element()));
        let hiding = room.filter(|_| triangles.is_empty()).and_then(|room| what_hides(&room, &boxes));
        for face in &mut faces[..6 * usize::from(room.is_some())] {
            face.holes = boxes.iter().filter_map(|body| face.under([body.min_m, body.max_m])).collect();
        }
        Ok(Self {
            hiding,
            room,
            faces,
            boxes,
            tree: Tree(TriangleBvh::new(&vertices, &triangles)?),
            reflectances,
            bounds,
            solid,
            cuts_exactly,
            extent_m,
        })
    }

    /// What hides faces from a place, where everything that reflects is a face.
    pub(super) fn hiding(&self) -> Option<&[Occluder]> {
        self.hiding.as_deref()
    }

    /// How far rays start off what may be a triangle.
    pub(super) fn lift_m(&self) -> f64 {
        LIFT * self.extent_m
    }

    /// The first surface that a ray along a unit vector meets.
    pub(super) fn closest(&self, from_m: DVec3, direction: DVec3) -> Option<Place> {
        let mut nearest = self.room.map(|room| self.wall(&room, from_m, direction));
        // What lies flat on a wall is what one sees of the two.
        let mut reach = nearest.map_or(f64::INFINITY, |place| place.distance_m + 0.1 * self.lift_m());
        for body in &self.boxes {
            if let Some(place) = body.meet(from_m, direction, reach) {
                reach = place.distance_m;
                nearest = Some(place);
            }
        }
        if self.reflectances.is_empty() {
            return nearest;
        }
        match self.tree.0.closest(&Ray { origin_m: from_m, direction }, reach) {
            None => nearest,
            Some(hit) => {
                let normal = if hit.normal.dot(direction) > 0.0 { -hit.normal } else { hit.normal };
                let point_m = from_m + hit.distance * direction + normal * self.lift_m();
                let reflectance = self.reflectances[hit.triangle as usize];
                let point_m = self.room.map_or(point_m, |room| point_m.clamp(DVec3::ZERO, room.size_m));
                Some(Place { point_m, normal, reflectance, face: None, distance_m: hit.distance })
            }
        }
    }

    /// Where a ray from inside leaves the room, exactly upon the wall, so that no ray leaks.
    fn wall(&self, room: &Room, from_m: DVec3, direction: DVec3) -> Place {
        let (mut distance_m, mut axis) = (f64::INFINITY, 0);
        for k in 0..3 {
            let end = if direction[k] > 0.0 { room.size_m[k] } else { 0.0 };
            let t = (end - from_m[k]) / direction[k];
            if direction[k] != 0.0 && t < distance_m {
                (distance_m, axis) = (t, k);
            }
        }
        let distance_m = distance_m.max(0.0);
        let far = direction[axis] > 0.0;
        let mut point_m = (from_m + distance_m * direction).clamp(DVec3::ZERO, room.size_m);
        point_m[axis] = if far { room.size_m[axis] } else { 0.0 };
        let index = 2 * axis + usize::from(far);
        let Face { normal, reflectance, .. } = self.faces[index];
        Place { point_m, normal, reflectance, face: Some(index), distance_m }
    }

    /// Boxes, flat ones on the walls left out, as their lower and upper corners.
    pub(super) fn bodies(&self) -> impl Iterator<Item = &[DVec3; 2]> {
        self.solid.iter()
    }

    /// Where bodies stand on a face.
    pub(super) fn covers(&self, face: &Face) -> Vec<[DVec2; 2]> {
        self.bodies().filter_map(|body| face.covered_by(*body)).collect()
    }

    /// Whether a body stands between two points.
    pub(super) fn is_hidden(&self, from_m: DVec3, to_m: DVec3) -> bool {
        let direction = to_m - from_m;
        self.boxes.iter().any(|b| b.blocks(from_m, direction))
            || !self.reflectances.is_empty() && self.tree.0.occluded(&Ray { origin_m: from_m, direction }, FAR_END)
    }

    /// Whether a body may stand between any two points of two boxes.
    pub(super) fn may_hide(&self, from: [DVec3; 2], to: [DVec3; 2]) -> bool {
        self.bounds.iter().any(|bounds| is_between(*bounds, from, to))
    }
}

/// Whether a box may meet the hull of two others: not if it is beyond both along an axis, nor where it is away from
/// a sphere that moves from one to the other, a distance that is convex.
fn is_between([min_m, max_m]: [DVec3; 2], from: [DVec3; 2], to: [DVec3; 2]) -> bool {
    let (low, high) = (from[0].min(to[0]), from[1].max(to[1]));
    if max_m.cmple(low).any() || min_m.cmpge(high).any() {
        return false;
    }
    let sphere = |[a, b]: [DVec3; 2]| (0.5 * (a + b), 0.5 * (b - a).length());
    let ((a_m, a_radius), (b_m, b_radius)) = (sphere(from), sphere(to));
    let gap = |t: f64| {
        let centre = a_m.lerp(b_m, t);
        (min_m - centre).max(centre - max_m).max(DVec3::ZERO).length() - (a_radius + t * (b_radius - a_radius))
    };
    let (mut near, mut far) = (0.0, 1.0);
    for _ in 0..24 {
        let (p, q) = (near + (far - near) / 3.0, far - (far - near) / 3.0);
        let (at_p, at_q) = (gap(p), gap(q));
        if at_p <= 0.0 || at_q <= 0.0 {
            return true;
        }
        if at_p < at_q { far = q } else { near = p }
    }
    gap(0.5 * (near + far)) <= 1e-6 * (b_m - a_m).length()
}

/// Whether a box without thickness lies on a wall: it covers that and hides nothing.
fn lies_on_a_wall(room: &Room, [min_m, max_m]: [DVec3; 2]) -> bool {
    (0..3).any(|k| min_m[k] == max_m[k] && (min_m[k] == 0.0 || max_m[k] == room.size_m[k]))
}

/// What hides faces from a place, where everything that reflects is a face; what lies flat on a wall replaces that and hides nothing.
fn what_hides(room: &Room, boxes: &[Body]) -> Option<Vec<Occluder>> {
    let is_apart =
        |(k, body): (usize, &Body)| boxes.iter().enumerate().all(|(j, other)| j == k || !body.lies_upon(other));
    let is_known = boxes.iter().all(|body| body.is_known(room)) && boxes.iter().enumerate().all(is_apart);
    let solid = boxes.iter().map(|body| [body.min_m, body.max_m]).filter(|b| !lies_on_a_wall(room, *b));
    is_known.then(|| solid.map(|[min_m, max_m]| Occluder { min_m, max_m }).collect())
}

impl Body {
    /// Whether all of it that reflects is a face.
    fn is_known(&self, room: &Room) -> bool {
        let corners_m = [self.min_m, self.max_m];
        let is_known = |k: usize| self.faces[k].is_some() || !Face::is_seen(room, corners_m, k / 2, k % 2 == 1);
        self.reflectance == 0.0 || (0..6).all(is_known)
    }

    /// Whether it is a plate in the plane of one of another's faces, so that one cannot tell them apart.
    fn lies_upon(&self, other: &Self) -> bool {
        (0..3).any(|k| {
            let (b, c) = ((k + 1) % 3, (k + 2) % 3);
            let over = |axis: usize| self.min_m[axis] < other.max_m[axis] && self.max_m[axis] > other.min_m[axis];
            let plane_m = self.min_m[k];
            plane_m == self.max_m[k] && (plane_m == other.min_m[k] || plane_m == other.max_m[k]) && over(b) && over(c)
        })
    }

    fn slabs(&self, from_m: DVec3, direction: DVec3) -> (DVec3, DVec3) {
        let (a, b) = ((self.min_m - from_m) / direction, (self.max_m - from_m) / direction);
        (a.min(b), a.max(b))
    }

    fn meet(&self, from_m: DVec3, direction: DVec3, reach: f64) -> Option<Place> {
        let (near, far) = self.slabs(from_m, direction);
        let (enter, exit) = (near.max_element(), far.min_element());
        // What starts on a face and leaves has its exit at 0, since places lie exactly upon their face.
        if !(enter <= exit && exit > 0.0 && enter >= 0.0 && enter < reach) {
            return None;
        }
        let axis = near.max_position();
        let ahead = direction[axis] > 0.0;
        let mut point_m = (from_m + enter * direction).clamp(self.min_m, self.max_m);
        point_m[axis] = if ahead { self.min_m[axis] } else { self.max_m[axis] };
        let normal = DVec3::AXES[axis] * if ahead { -1.0 } else { 1.0 };
        let face = self.faces[2 * axis + usize::from(!ahead)];
        Some(Place { point_m, normal, reflectance: self.reflectance, face, distance_m: enter })
    }

    fn blocks(&self, from_m: DVec3, direction: DVec3) -> bool {
        let (near, far) = self.slabs(from_m, direction);
        let (enter, exit) = (near.max_element(), far.min_element());
        enter <= exit && exit > 0.0 && enter < FAR_END
    }
}
