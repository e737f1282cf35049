//! What rays of the sampled solvers meet: the room's walls, boxes by formula, triangles through the tree. All in `f64`.
//!
//! It shares nothing with the certifier but the tree of triangles.

use glam::DVec3;

use crate::visibility::Occluder;
use luxproof_scene::geometry::bvh::{BvhError, Ray, TriangleBvh};
use luxproof_scene::geometry::{Mesh, Room, Surface};
use luxproof_scene::{Obstacle, Shape};

/// With more boxes than this the tree is faster than trying each in turn.
const MAX_FORMULA_BOXES: usize = 32;
/// How far rays start off a surface, as a part of the scene's extent.
const LIFT: f64 = 1e-10;
/// The part of a shadow ray that is tested. What a luminaire lies on must not hide it.
const FAR_END: f64 = 1.0 - 1e-10;

/// Everything that blocks or reflects.
pub(super) struct Surroundings {
    pub(super) room: Option<Room>,
    boxes: Vec<FormulaBox>,
    /// Boxes that can hide something from something: plates flat on a wall cannot.
    blockers: Vec<FormulaBox>,
    tree: TriangleBvh,
    /// The triangles that can hide something. A recessed luminaire's plate hides nothing.
    blocking_tree: TriangleBvh,
    /// All surfaces, in the order of their index: six walls, six faces for each box, two sides for each triangle.
    pub(super) surfaces: Vec<ReflectingSurface>,
    /// Index of the first triangle side.
    first_side: usize,
    /// Boxes around all bodies that can hide something.
    bounds: Vec<[DVec3; 2]>,
    /// Boxes that cut exact shadows; `None` where a mesh casts a shadow too.
    pub(super) occluders: Option<Vec<Occluder>>,
    extent_m: f64,
}

impl std::fmt::Debug for Surroundings {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Surroundings").field("surfaces", &self.surfaces.len()).finish_non_exhaustive()
    }
}

/// One side of a flat piece of surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct ReflectingSurface {
    pub(super) corner_m: DVec3,
    pub(super) edges_m: [DVec3; 2],
    /// A triangle between the edges; a parallelogram otherwise.
    pub(super) is_triangle: bool,
    /// Unit normal, towards the side that is seen.
    pub(super) normal: DVec3,
    pub(super) area_m2: f64,
    /// Diffuse.
    pub(super) reflectance: f64,
    /// Index of the body that it belongs to, if it is a triangle of a mesh.
    pub(super) mesh: Option<usize>,
}

/// An axis-aligned box, or a plate where one extent is zero.
#[derive(Clone, Copy, Debug)]
struct FormulaBox {
    min_m: DVec3,
    max_m: DVec3,
    reflectance: f64,
    /// Index of its first face among all surfaces: at twice the axis, and one more at the far end.
    first_face: usize,
}

/// A place on a diffuse surface, seen from one side.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    /// Just off the surface, so that rays can start here.
    pub(super) point_m: DVec3,
    /// Unit normal, towards the side that is seen.
    pub(super) normal: DVec3,
    pub(super) reflectance: f64,
    /// Index of the surface.
    pub(super) surface: usize,
}

impl ReflectingSurface {
    fn new(corner_m: DVec3, edges_m: [DVec3; 2], is_triangle: bool, reflectance: f64, mesh: Option<usize>) -> Self {
        let cross = edges_m[0].cross(edges_m[1]);
        let area_m2 = cross.length() * if is_triangle { 0.5 } else { 1.0 };
        Self { corner_m, edges_m, is_triangle, normal: cross.normalize_or_zero(), area_m2, reflectance, mesh }
    }

    fn faces_of_box(min_m: DVec3, max_m: DVec3, reflectance: f64, is_inward: bool) -> [Self; 6] {
        std::array::from_fn(|k| {
            let (axis, is_far) = (k / 2, k % 2 == 1);
            let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
            let size_m = max_m - min_m;
            let (mut e, mut f) = (size_m[a] * DVec3::AXES[a], size_m[b] * DVec3::AXES[b]);
            if is_far == is_inward {
                std::mem::swap(&mut e, &mut f);
            }
            let mut corner_m = min_m;
            corner_m[axis] = if is_far { max_m[axis] } else { min_m[axis] };
            Self::new(corner_m, [e, f], false, reflectance, None)
        })
    }

    /// The place at coordinates of the unit square, which map to equal areas.
    pub(super) fn point_at(&self, [s, t]: [f64; 2]) -> DVec3 {
        let [u, v] = if self.is_triangle {
            let r = s.sqrt();
            [r * (1.0 - t), r * t]
        } else {
            [s, t]
        };
        self.corner_m + u * self.edges_m[0] + v * self.edges_m[1]
    }

    /// The coordinates of a place, within the unit square.
    pub(super) fn coordinates_of(&self, point_m: DVec3) -> [f64; 2] {
        let [e, f] = self.edges_m;
        let away = point_m - self.corner_m;
        let (ee, ef, ff) = (e.dot(e), e.dot(f), f.dot(f));
        let (ae, af) = (away.dot(e), away.dot(f));
        let determinant = ee * ff - ef * ef;
        let (u, v) = ((ae * ff - af * ef) / determinant, (af * ee - ae * ef) / determinant);
        let [s, t] = if self.is_triangle { [(u + v) * (u + v), v / (u + v)] } else { [u, v] };
        // Not a number at the first corner of a triangle, where any `t` will do.
        [s, t].map(|x| if x.is_nan() { 0.0 } else { x.clamp(0.0, 1.0) })
    }
}

impl Surroundings {
    pub(super) fn new(room: Option<Room>, obstacles: &[Obstacle], reach_m: f64) -> Result<Self, BvhError> {
        let box_count = obstacles.iter().filter(|o| Occluder::aligned(&o.shape).is_some()).count();
        let mut surfaces: Vec<ReflectingSurface> = room.iter().flat_map(wall_surfaces).collect();
        let (mut boxes, mut bounds, mut occluders, mut has_mesh_shadow) = (vec![], vec![], vec![], false);
        let mut meshes: Vec<(usize, f64, Mesh, bool)> = vec![];
        for (index, Obstacle { shape, reflectance }) in obstacles.iter().enumerate() {
            let aligned = Occluder::aligned(shape);
            if let Some(occluder) = aligned.filter(|o| !lies_on_wall(room.as_ref(), [o.min_m, o.max_m])) {
                occluders.push(occluder);
            }
            match (aligned, shape) {
                (Some(Occluder { min_m, max_m }), _) if box_count <= MAX_FORMULA_BOXES => {
                    boxes.push(FormulaBox { min_m, max_m, reflectance: *reflectance, first_face: surfaces.len() });
                    surfaces.extend(ReflectingSurface::faces_of_box(min_m, max_m, *reflectance, false));
                }
                (_, Shape::Box { min_m, max_m }) => {
                    meshes.push((index, *reflectance, Mesh::cuboid(*min_m, *max_m), true));
                }
                (_, Shape::Mesh { vertices_m, triangles }) => {
                    let mesh = Mesh { vertices_m: vertices_m.clone(), triangles: triangles.clone() };
                    let is_shadow = extent(vertices_m).is_some_and(|e| !lies_on_wall(room.as_ref(), e));
                    has_mesh_shadow |= is_shadow && aligned.is_none();
                    meshes.push((index, *reflectance, mesh, is_shadow));
                }
            }
        }
        let first_side = surfaces.len();
        let (mut all, mut blocking) = (Mesh::default(), Mesh::default());
        for (index, reflectance, mesh, is_shadow) in meshes {
            for triangle in &mesh.triangles {
                let [a, b, c] = triangle.map(|k| mesh.vertices_m.get(k as usize).copied().unwrap_or_default());
                for edges_m in [[b - a, c - a], [c - a, b - a]] {
                    surfaces.push(ReflectingSurface::new(a, edges_m, true, reflectance, Some(index)));
                }
            }
            if is_shadow {
                bounds.extend(extent(&mesh.vertices_m));
                append(&mut blocking, &mesh);
            }
            append(&mut all, &mesh);
        }
        let blockers: Vec<FormulaBox> =
            boxes.iter().copied().filter(|b| !lies_on_wall(room.as_ref(), [b.min_m, b.max_m])).collect();
        bounds.extend(blockers.iter().map(|b| [b.min_m, b.max_m]));
        let reach_m = bounds.iter().flatten().map(|p| p.abs().max_element()).fold(reach_m, f64::max);
        let extent_m = reach_m.max(room.map_or(0.0, |r| r.size_m.max_element()));
        Ok(Self {
            room,
            boxes,
            blockers,
            tree: TriangleBvh::new(&all.vertices_m, &all.triangles)?,
            blocking_tree: TriangleBvh::new(&blocking.vertices_m, &blocking.triangles)?,
            surfaces,
            first_side,
            bounds,
            occluders: (!has_mesh_shadow).then_some(occluders),
            extent_m,
        })
    }

    /// Lower and upper corner of a box around everything.
    pub(super) fn bounds_m(&self) -> [DVec3; 2] {
        let room = self.room.map(|room| [DVec3::ZERO, room.size_m]);
        let all = room.into_iter().chain(self.bounds.iter().copied());
        let joined = all.reduce(|[low, high], [from, to]| [low.min(from), high.max(to)]);
        joined.unwrap_or([DVec3::ZERO, DVec3::ONE])
    }

    /// The mean reflectance of all surfaces by area.
    pub(super) fn mean_reflectance(&self) -> f64 {
        let area_m2: f64 = self.surfaces.iter().map(|s| s.area_m2).sum();
        let reflected_m2: f64 = self.surfaces.iter().map(|s| s.reflectance * s.area_m2).sum();
        if area_m2 > 0.0 { reflected_m2 / area_m2 } else { 0.0 }
    }

    /// How far rays start off a surface, in metres.
    pub(super) fn lift_m(&self) -> f64 {
        LIFT * self.extent_m
    }

    /// The first surface that a ray along a unit vector meets.
    pub(super) fn closest(&self, from_m: DVec3, direction: DVec3) -> Option<Place> {
        let mut reach = f64::INFINITY;
        let mut nearest = None;
        if let Some(room) = &self.room {
            let (place, distance_m) = self.wall(room, from_m, direction);
            nearest = Some(place);
            // Of a plate on a wall and the wall, the plate is what one sees.
            reach = distance_m + 0.1 * self.lift_m();
        }
        for body in &self.boxes {
            if let Some((place, distance_m)) = body.meet(from_m, direction, reach) {
                (nearest, reach) = (Some(place), distance_m);
            }
        }
        if self.tree.is_empty() {
            return nearest;
        }
        let Some(hit) = self.tree.closest(&Ray { origin_m: from_m, direction }, reach) else { return nearest };
        let is_back = hit.normal.dot(direction) > 0.0;
        let normal = if is_back { -hit.normal } else { hit.normal };
        let point_m = from_m + hit.distance * direction + normal * self.lift_m();
        let point_m = self.room.map_or(point_m, |room| point_m.clamp(DVec3::ZERO, room.size_m));
        let surface = self.first_side + 2 * hit.triangle as usize + usize::from(is_back);
        Some(Place { point_m, normal, reflectance: self.surfaces[surface].reflectance, surface })
    }

    /// Where a ray from inside leaves the room, exactly on the wall, so that no ray leaks.
    fn wall(&self, room: &Room, from_m: DVec3, direction: DVec3) -> (Place, f64) {
        let (mut distance_m, mut axis) = (f64::INFINITY, 0);
        for k in 0..3 {
            let end = if direction[k] > 0.0 { room.size_m[k] } else { 0.0 };
            let t = (end - from_m[k]) / direction[k];
            if direction[k] != 0.0 && t < distance_m {
                (distance_m, axis) = (t, k);
            }
        }
        let distance_m = distance_m.max(0.0);
        let is_far = direction[axis] > 0.0;
        let mut point_m = (from_m + distance_m * direction).clamp(DVec3::ZERO, room.size_m);
        point_m[axis] = if is_far { room.size_m[axis] } else { 0.0 };
        let surface = 2 * axis + usize::from(is_far);
        let ReflectingSurface { normal, reflectance, .. } = self.surfaces[surface];
        (Place { point_m, normal, reflectance, surface }, distance_m)
    }

    /// The place on a surface at coordinates of the unit square; `None` where something covers it.
    pub(super) fn uncovered_place(&self, surface: usize, at: [f64; 2]) -> Option<Place> {
        let ReflectingSurface { normal, .. } = self.surfaces[surface];
        let on_m = self.surfaces[surface].point_at(at);
        let lifted_m = on_m + normal * self.lift_m();
        let is_within_room = self.room.is_none_or(|room| room.contains(lifted_m, 0.0));
        if !is_within_room || self.boxes.iter().any(|b| b.contains(lifted_m)) {
            return None;
        }
        let found = self.closest(lifted_m, -normal)?;
        (found.surface == surface).then_some(found)
    }

    /// Whether a body stands between two points.
    pub(super) fn is_hidden(&self, from_m: DVec3, to_m: DVec3) -> bool {
        let direction = to_m - from_m;
        self.blockers.iter().any(|b| b.blocks(from_m, direction))
            || !self.blocking_tree.is_empty()
                && self.blocking_tree.occluded(&Ray { origin_m: from_m, direction }, FAR_END)
    }

    /// Whether a body may stand between a point and any point of a box.
    pub(super) fn may_hide(&self, from_m: DVec3, [low, high]: [DVec3; 2]) -> bool {
        self.bounds.iter().any(|[min_m, max_m]| {
            let beyond = |k: usize| max_m[k] < from_m[k].min(low[k]) || min_m[k] > from_m[k].max(high[k]);
            !(0..3).any(beyond)
        })
    }

    /// Whether anything can hide anything.
    pub(super) fn has_shadows(&self) -> bool {
        !self.blockers.is_empty() || !self.blocking_tree.is_empty()
    }

    /// Whether a surface is a wall or a face of a box, not a side of a triangle.
    pub(super) fn is_large_piece(&self, surface: usize) -> bool {
        surface < self.first_side
    }
}

fn wall_surfaces(room: &Room) -> [ReflectingSurface; 6] {
    const WALLS: [Surface; 6] =
        [Surface::WallXMin, Surface::WallXMax, Surface::WallYMin, Surface::WallYMax, Surface::Floor, Surface::Ceiling];
    let mut faces = ReflectingSurface::faces_of_box(DVec3::ZERO, room.size_m, 0.0, true);
    for (face, wall) in faces.iter_mut().zip(WALLS) {
        face.reflectance = room.reflectance.of(wall);
    }
    faces
}

fn extent(vertices_m: &[DVec3]) -> Option<[DVec3; 2]> {
    let low = vertices_m.iter().copied().reduce(DVec3::min)?;
    Some([low, vertices_m.iter().copied().reduce(DVec3::max)?])
}

fn append(all: &mut Mesh, more: &Mesh) {
    let first = all.vertices_m.len() as u32;
    all.vertices_m.extend(&more.vertices_m);
    all.triangles.extend(more.triangles.iter().map(|t| t.map(|k| first + k)));
}

/// Whether a box without thickness lies on a wall: it covers that and hides nothing.
fn lies_on_wall(room: Option<&Room>, [min_m, max_m]: [DVec3; 2]) -> bool {
    let lies_at = |room: &Room, k: usize| min_m[k] == max_m[k] && (min_m[k] == 0.0 || max_m[k] == room.size_m[k]);
    room.is_some_and(|room| (0..3).any(|k| lies_at(room, k)))
}

impl FormulaBox {
    fn slabs(&self, from_m: DVec3, direction: DVec3) -> (f64, f64, DVec3) {
        let (a, b) = ((self.min_m - from_m) / direction, (self.max_m - from_m) / direction);
        let near = a.min(b);
        (near.max_element(), a.max(b).min_element(), near)
    }

    fn meet(&self, from_m: DVec3, direction: DVec3, reach: f64) -> Option<(Place, f64)> {
        let (enter, exit, near) = self.slabs(from_m, direction);
        // A ray that starts on a face and leaves has its exit at 0, since places lie exactly on their face.
        if !(enter <= exit && exit > 0.0 && enter >= 0.0 && enter < reach) {
            return None;
        }
        let axis = near.max_position();
        let is_ahead = direction[axis] > 0.0;
        let mut point_m = (from_m + enter * direction).clamp(self.min_m, self.max_m);
        point_m[axis] = if is_ahead { self.min_m[axis] } else { self.max_m[axis] };
        let normal = DVec3::AXES[axis] * if is_ahead { -1.0 } else { 1.0 };
        let surface = self.first_face + 2 * axis + usize::from(!is_ahead);
        Some((Place { point_m, normal, reflectance: self.reflectance, surface }, enter))
    }

    fn blocks(&self, from_m: DVec3, direction: DVec3) -> bool {
        let (enter, exit, _) = self.slabs(from_m, direction);
        enter <= exit && exit > 0.0 && enter < FAR_END
    }

    fn contains(&self, point_m: DVec3) -> bool {
        point_m.cmpgt(self.min_m).all() && point_m.cmplt(self.max_m).all()
    }
}
