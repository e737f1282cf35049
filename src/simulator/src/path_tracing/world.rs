//! What light meets in a scene: room planes and boxes by formula, triangles through the tree; all in `f64`.

use glam::DVec3;

use luxproof_scene::geometry::bvh::{BvhError, Ray, TriangleBvh};
use luxproof_scene::geometry::{Mesh, Room, Surface};
use luxproof_scene::{Obstacle, Shape};

/// Boxes beyond which the tree is faster than trying each in turn.
const MAX_ANALYTIC_BOXES: usize = 48;
/// How far, of the scene's extent, a starting point is lifted off a triangle or a meter off its place; a thousand
/// times the rounding of a hit, and far below any error that is asked for.
const LIFT: f64 = 1e-10;
/// The part of a shadow ray at the luminaire's end that is not tested, so that what a luminaire lies on cannot hide it.
const FAR_END: f64 = 1.0 - 1e-10;

/// Everything that blocks or reflects.
pub(super) struct World {
    room: Option<Room>,
    boxes: Vec<AxisBox>,
    triangles: TriangleBvh,
    /// Reflectance of each triangle.
    triangle_reflectance: Vec<f64>,
    /// Largest coordinate or extent, in metres.
    extent_m: f64,
}

struct AxisBox {
    min_m: DVec3,
    max_m: DVec3,
    reflectance: f64,
}

/// A point of a diffuse surface, seen from one side.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hit {
    /// A point just off the surface, on the side that is seen, from which rays can start.
    pub(super) point_m: DVec3,
    /// Unit normal towards the side that is seen.
    pub(super) normal: DVec3,
    /// Diffuse reflectance.
    pub(super) reflectance: f64,
    /// Distance that the ray has gone, in metres.
    pub(super) distance_m: f64,
}

impl World {
    /// Puts a room and its obstacles in order; many boxes become triangles, which the tree finds faster.
    pub(super) fn new(room: Option<Room>, obstacles: &[Obstacle], reach_m: f64) -> Result<Self, BvhError> {
        let boxes = obstacles.iter().filter(|o| matches!(o.shape, Shape::Box { .. })).count();
        let mut world = Self {
            room,
            boxes: vec![],
            triangles: TriangleBvh::new(&[], &[])?,
            triangle_reflectance: vec![],
            extent_m: reach_m.max(room.map_or(0.0, |r| r.size_m.max_element())),
        };
        let (mut vertices, mut triangles) = (vec![], vec![]);
        for Obstacle { shape, reflectance } in obstacles {
            let reflectance = *reflectance;
            match shape {
                Shape::Box { min_m, max_m } if boxes <= MAX_ANALYTIC_BOXES => {
                    world.boxes.push(AxisBox { min_m: *min_m, max_m: *max_m, reflectance });
                    world.extent_m = world.extent_m.max(min_m.abs().max(max_m.abs()).max_element());
                }
                Shape::Box { min_m, max_m } => {
                    let mesh = Mesh::cuboid(*min_m, *max_m);
                    append(&mut vertices, &mut triangles, &mesh.vertices_m, &mesh.triangles);
                }
                Shape::Mesh { vertices_m, triangles: faces } => {
                    append(&mut vertices, &mut triangles, vertices_m, faces);
                }
            }
            world.triangle_reflectance.resize(triangles.len(), reflectance);
        }
        world.triangles = TriangleBvh::new(&vertices, &triangles)?;
        let reach_m = vertices.iter().map(|v| v.abs().max_element()).fold(0.0, f64::max);
        world.extent_m = world.extent_m.max(reach_m);
        Ok(world)
    }

    /// The first surface that a ray along a unit vector meets.
    pub(super) fn closest(&self, origin_m: DVec3, direction: DVec3) -> Option<Hit> {
        let mut nearest = self.room.map(|room| room_exit(&room, origin_m, direction));
        // An obstacle that lies flush on a room surface is what one sees of the two.
        let slack_m = 0.1 * LIFT * self.extent_m;
        let mut t_max = nearest.map_or(f64::INFINITY, |hit| hit.distance_m + slack_m);
        for obstacle in &self.boxes {
            if let Some(hit) = obstacle.hit(origin_m, direction, t_max) {
                t_max = hit.distance_m;
                nearest = Some(hit);
            }
        }
        if self.triangles.is_empty() {
            return nearest;
        }
        match self.triangles.closest(&Ray { origin_m, direction }, t_max) {
            Some(hit) => Some(self.triangle_hit(origin_m, direction, hit)),
            None => nearest,
        }
    }

    fn triangle_hit(&self, origin_m: DVec3, direction: DVec3, hit: luxproof_scene::geometry::bvh::Hit) -> Hit {
        let normal = if hit.normal.dot(direction) > 0.0 { -hit.normal } else { hit.normal };
        Hit {
            point_m: self.inside(origin_m + hit.distance * direction + normal * self.lift_m()),
            normal,
            reflectance: self.triangle_reflectance[hit.triangle as usize],
            distance_m: hit.distance,
        }
    }

    /// Whether nothing lies between two points, the room's own surfaces left out, since a box hides nothing from within.
    pub(super) fn visible(&self, from_m: DVec3, to_m: DVec3) -> bool {
        let direction = to_m - from_m;
        !self.boxes.iter().any(|b| b.blocks(from_m, direction))
            && (self.triangles.is_empty() || !self.triangles.occluded(&Ray { origin_m: from_m, direction }, FAR_END))
    }

    /// Whether a point lies within the room, its surfaces included; everywhere in free field.
    pub(super) fn contains(&self, point_m: DVec3) -> bool {
        self.room.is_none_or(|room| room.contains(point_m, -self.lift_m()))
    }

    /// Whether a point lies on this side of every room surface.
    pub(super) fn holds(&self, point_m: DVec3) -> bool {
        self.room.is_none_or(|room| room.contains(point_m, 0.0))
    }

    /// The least distance in metres to a room surface or a box; infinite in free field.
    pub(super) fn clearance_m(&self, point_m: DVec3) -> f64 {
        let room = self.room.map_or(f64::INFINITY, |r| point_m.min(r.size_m - point_m).min_element().abs());
        self.boxes.iter().map(|b| b.clearance_m(point_m)).fold(room, f64::min)
    }

    /// Area of the room's surfaces or, in free field, of a cube that holds everything, in square metres.
    pub(super) fn area_m2(&self) -> f64 {
        let cube = 6.0 * self.extent_m * self.extent_m;
        self.room.map_or(cube, |room| room.whole_area_m2())
    }

    /// How far points are lifted off surfaces, in metres.
    pub(super) fn lift_m(&self) -> f64 {
        LIFT * self.extent_m
    }

    /// The reflectance of every surface.
    pub(super) fn reflectances(&self) -> impl Iterator<Item = f64> {
        let room = self.room.iter().flat_map(|r| Surface::ALL.map(|s| r.reflectance.of(s)));
        room.chain(self.boxes.iter().map(|b| b.reflectance)).chain(self.triangle_reflectance.iter().copied())
    }

    fn inside(&self, point_m: DVec3) -> DVec3 {
        self.room.map_or(point_m, |room| point_m.clamp(DVec3::ZERO, room.size_m))
    }
}

/// Where a ray from inside leaves the room; the point lies exactly on the surface, so that no ray can leak.
fn room_exit(room: &Room, origin_m: DVec3, direction: DVec3) -> Hit {
    let mut exit = (f64::INFINITY, 0);
    for axis in 0..3 {
        let end = if direction[axis] > 0.0 { room.size_m[axis] } else { 0.0 };
        let t = (end - origin_m[axis]) / direction[axis];
        if direction[axis] != 0.0 && t < exit.0 {
            exit = (t, axis);
        }
    }
    let (t, axis) = exit;
    let distance_m = t.max(0.0);
    let far = direction[axis] > 0.0;
    let mut point_m = (origin_m + distance_m * direction).clamp(DVec3::ZERO, room.size_m);
    point_m[axis] = if far { room.size_m[axis] } else { 0.0 };
    let surface = SURFACES[axis][usize::from(far)];
    Hit { point_m, normal: surface.inward_normal(), reflectance: room.reflectance.of(surface), distance_m }
}

/// The surfaces by axis, near and far.
const SURFACES: [[Surface; 2]; 3] = [
    [Surface::WallXMin, Surface::WallXMax],
    [Surface::WallYMin, Surface::WallYMax],
    [Surface::Floor, Surface::Ceiling],
];

impl AxisBox {
    /// Entry and exit along a ray: S. Kay and J. Kajiya's slabs, SIGGRAPH 1986.
    fn slabs(&self, origin_m: DVec3, direction: DVec3) -> (DVec3, DVec3) {
        let (a, b) = ((self.min_m - origin_m) / direction, (self.max_m - origin_m) / direction);
        (a.min(b), a.max(b))
    }

    fn hit(&self, origin_m: DVec3, direction: DVec3, t_max: f64) -> Option<Hit> {
        let (near, far) = self.slabs(origin_m, direction);
        let (enter, exit) = (near.max_element(), far.min_element());
        // A ray that starts on a face and leaves has its exit at exactly 0, since hits are snapped onto their face.
        if !(enter < exit && exit > 0.0) {
            return None;
        }
        let (t, axis) = if enter >= 0.0 { (enter, near.max_position()) } else { (exit, far.min_position()) };
        if t >= t_max {
            return None;
        }
        let at_max = (direction[axis] > 0.0) == (enter < 0.0);
        let mut point_m = (origin_m + t * direction).clamp(self.min_m, self.max_m);
        point_m[axis] = if at_max { self.max_m[axis] } else { self.min_m[axis] };
        let mut normal = DVec3::ZERO;
        normal[axis] = -direction[axis].signum();
        Some(Hit { point_m, normal, reflectance: self.reflectance, distance_m: t })
    }

    fn blocks(&self, from_m: DVec3, direction: DVec3) -> bool {
        let (near, far) = self.slabs(from_m, direction);
        let (enter, exit) = (near.max_element(), far.min_element());
        enter < exit && exit > 0.0 && enter < FAR_END
    }

    /// Distance to the surface, from either side.
    fn clearance_m(&self, point_m: DVec3) -> f64 {
        let outside = (self.min_m - point_m).max(point_m - self.max_m);
        if outside.max_element() > 0.0 { outside.max(DVec3::ZERO).length() } else { -outside.max_element() }
    }
}

fn append(vertices: &mut Vec<DVec3>, triangles: &mut Vec<[u32; 3]>, more: &[DVec3], faces: &[[u32; 3]]) {
    let first = vertices.len() as u32;
    vertices.extend(more);
    // An index beyond its own mesh must not become one into the next.
    let shift = |v: u32| if (v as usize) < more.len() { first + v } else { u32::MAX };
    triangles.extend(faces.iter().map(|f| f.map(shift)));
}
