//! Contact of luminaires and surfaces: which luminaire lies on which surface, decided once, before any solver or exporter.
//!
//! A face of a luminous opening that lies in the plane of a surface covers that piece of it. The surface may be a wall of the room,
//! an inner wall of a polygon room, a face of a box or a triangle of a mesh. What is covered is an [`Obstacle`], a black plate of no
//! thickness, and what the opening sends into its surface is lost there.
//!
//! On a surface of the room's box the plate lies in the surface's plane, since nothing is behind it. On other surfaces the plate
//! comes [`GAP_M`] before the surface, and the opening comes as far before the plate: no two surfaces of a scene are in one place,
//! so that no solver has to tell them apart.

use glam::{DMat3, DQuat, DVec2, DVec3};

use super::{Luminaire, LuminaireModel, Obstacle, Shape, flush};
use crate::geometry::{Mesh, Room, Surface};

/// A luminaire that is no farther from a surface than this lies on it, in metres.
pub const SNAP_M: f64 = 1e-6;
/// How far a plate lies before the face of a body, in metres; its opening lies twice as far before that face.
pub const GAP_M: f64 = 1e-6;

/// `SNAP_M` with the rounding of coordinates of some hundred metres.
const NEAR_M: f64 = SNAP_M + 1e-9;
/// How far sheets stand before the walls of a room of faces, in parts of its extent: twice what `enclosure` takes.
const SHEETS: f64 = 2e-6;
/// Areas below this part of an opening's are rounding.
const SLIVER: f64 = 1e-9;
/// The cosine of the angle from which on a face is not parallel to another, however small it is.
const ASKEW: f64 = 0.999;
/// The sine of the angle between edges up to which they are one.
const STRAIGHT: f64 = 1e-8;
/// One less the cosine of the angle to an axis up to which a normal runs along it.
const ALONG_AXIS: f64 = 1e-12;
/// Triangles that are looked at together.
const CHUNK: usize = 64;

/// A luminaire in its place, and what it covers there.
#[derive(Clone, Debug)]
pub struct Placed {
    /// On the surfaces that it is near.
    pub luminaire: Luminaire,
    /// What it covers of them.
    pub plates: Vec<Obstacle>,
    /// Where the surfaces of bodies that it lies on face, as unit vectors.
    pub normals: Vec<DVec3>,
}

/// The surfaces of a scene that a luminaire may lie on.
pub struct Surfaces<'a> {
    room: Option<Room>,
    groups: Vec<Group<'a>>,
    /// How far a luminaire in the plane of a wall may lie behind a sheet before that.
    behind_m: f64,
}

/// Some faces of a body and a box around them.
struct Group<'a> {
    low_m: DVec3,
    high_m: DVec3,
    faces: Faces<'a>,
}

enum Faces<'a> {
    Box(DVec3, DVec3),
    Triangles(&'a [DVec3], &'a [[u32; 3]]),
}

/// A flat convex face of a body.
struct Facet {
    corners_m: Vec<DVec3>,
    normal: DVec3,
}

/// What an opening's face lies on.
struct Contact {
    normal: DVec3,
    /// How far the frontmost surface lies along the normal.
    plane_m: f64,
    /// The pieces that are covered; of what is covered as a whole its outline.
    pieces_m: Vec<Vec<DVec3>>,
    /// The surface of the room where there is no other.
    of_room: Option<Surface>,
}

impl<'a> Surfaces<'a> {
    /// Those of a room's box and of all bodies in it, inner walls among them.
    pub fn new(room: Option<Room>, bodies: impl IntoIterator<Item = &'a Obstacle>) -> Self {
        let groups = bodies.into_iter().flat_map(|body| groups_of(&body.shape)).collect();
        let sheets_m = room.map_or(0.0, |room| SHEETS * room.size_m.max_element());
        Self { room, groups, behind_m: NEAR_M + sheets_m }
    }

    /// Puts a luminaire onto the surfaces that it is nearly on, parallel to them, and finds what it covers.
    pub fn place(&self, luminaire: &Luminaire) -> Placed {
        let mut luminaire = luminaire.clone();
        if let Some(room) = &self.room {
            luminaire.position_m = flush::snapped(room, luminaire.position_m);
        }
        let mut placed = Placed { luminaire, plates: vec![], normals: vec![] };
        if placed.luminaire.model == LuminaireModel::Point {
            placed.luminaire.position_m = self.snapped(placed.luminaire.position_m);
            return placed;
        }
        let faces = placed.luminaire.photometry.opening.flat_faces_m(flush::CORNERS);
        if let [outline] = &faces[..] {
            // A flat opening may lie on what is behind it or before it.
            let own = own_normal(outline);
            let contacts = [-own, own].map(|side| Some((side, self.contact(&placed.luminaire, outline, side)?)));
            let found = match contacts {
                [Some(front), Some(back)]
                    if shines(&placed.luminaire, front.0) || !shines(&placed.luminaire, back.0) =>
                {
                    Some(front)
                }
                [Some(_), Some(back)] => Some(back),
                [front, back] => front.or(back),
            };
            if let Some((side, contact)) = found {
                placed.settle(outline, side, contact);
            }
        } else {
            for outline in &faces {
                let side = -own_normal(outline);
                if let Some(contact) = self.contact(&placed.luminaire, outline, side) {
                    placed.settle(outline, side, contact);
                }
            }
        }
        placed
    }

    /// Where the faces of bodies that a point is on let its light go, as unit vectors.
    pub fn normals_at(&self, luminaire: &Luminaire) -> Vec<DVec3> {
        let at_m = luminaire.position_m;
        let mut normals: Vec<DVec3> = vec![];
        for facet in self.facets(at_m - NEAR_M, at_m + NEAR_M) {
            if (at_m - facet.corners_m[0]).dot(facet.normal).abs() > NEAR_M || !facet.is_over(at_m) {
                continue;
            }
            // Either side of a triangle may be lit.
            let is_back = facet.corners_m.len() == 3 && !flush::shines_along(facet.normal, luminaire);
            let normal = if is_back { -facet.normal } else { facet.normal };
            if normals.iter().all(|other| other.dot(normal) < ASKEW) {
                normals.push(normal);
            }
        }
        normals
    }

    /// A point on the face that it is nearly on.
    fn snapped(&self, point_m: DVec3) -> DVec3 {
        let near = self.facets(point_m - NEAR_M, point_m + NEAR_M).filter_map(|facet| facet.snapped(point_m));
        near.min_by(|a, b| a.0.total_cmp(&b.0)).map_or(point_m, |(_, on_m)| on_m)
    }

    /// The faces of bodies that reach into a box.
    fn facets(&self, low_m: DVec3, high_m: DVec3) -> impl Iterator<Item = Facet> + '_ {
        self.groups.iter().filter(move |group| group.reaches(low_m, high_m)).flat_map(|group| group.faces.all())
    }

    /// What a face of an opening lies on that faces along one of its normals, in the luminaire's own frame.
    fn contact(&self, luminaire: &Luminaire, outline: &[DVec3], side: DVec3) -> Option<Contact> {
        let corners_m: Vec<DVec3> = outline.iter().map(|p| luminaire.position_m + luminaire.orientation * *p).collect();
        let side = luminaire.orientation * side;
        let low_m = corners_m.iter().copied().fold(DVec3::INFINITY, DVec3::min) - self.behind_m;
        let high_m = corners_m.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max) + self.behind_m;
        let of_room = self.room.iter().flat_map(|room| {
            Surface::ALL.map(|s| (Some(s), Facet { corners_m: room.corners(s).to_vec(), normal: s.inward_normal() }))
        });
        let of_room = of_room.filter(|(_, f)| is_on(&corners_m, side, f.corners_m[0], f.normal, NEAR_M));
        let mut all: Vec<(Option<Surface>, Facet)> = of_room.collect();
        // Before a wall there may be a sheet that is a part of it.
        let behind_m = if all.is_empty() { NEAR_M } else { self.behind_m };
        let of_bodies = self.facets(low_m, high_m).filter_map(|facet| {
            let is_sheet = facet.corners_m.len() == 3;
            let normal = if is_sheet && facet.normal.dot(side) < 0.0 { -facet.normal } else { facet.normal };
            let is_found = is_on(&corners_m, side, facet.corners_m[0], normal, behind_m);
            is_found.then_some((None, Facet { normal, ..facet }))
        });
        all.extend(of_bodies);
        let first = all.first()?.1.normal;
        let plane = Plane::new(first, corners_m[0]);
        let flat: Vec<DVec2> = corners_m.iter().map(|p| plane.on(*p)).collect();
        let whole = area(&flat).abs();
        all.retain(|(_, facet)| !is_sliver(&cut(&flat, &plane.polygon(facet)).0, whole));
        let (front_of_room, front) = all.iter().max_by(|a, b| a.1.along_m(first).total_cmp(&b.1.along_m(first)))?;
        let (normal, plane_m) = (front.normal, front.along_m(front.normal));
        let of_room = front_of_room.filter(|_| all.iter().all(|(surface, _)| surface.is_some()));
        let (mut open, mut covered) = (vec![flat.clone()], vec![]);
        for (_, facet) in &all {
            let polygon = plane.polygon(facet);
            for piece in std::mem::take(&mut open) {
                let (inside, outside) = cut(&piece, &polygon);
                covered.extend(Some(inside).filter(|p| !is_sliver(p, whole)));
                open.extend(outside.into_iter().filter(|p| !is_sliver(p, whole)));
            }
        }
        let is_whole = open.iter().map(|p| area(p).abs()).sum::<f64>() <= all.len() as f64 * SLIVER * whole;
        let pieces = if is_whole || of_room.is_some() { vec![flat] } else { covered };
        let pieces_m = pieces.iter().map(|piece| piece.iter().map(|p| plane.off(*p)).collect()).collect();
        Some(Contact { normal, plane_m, pieces_m, of_room })
    }
}

/// Whether all corners of a face that looks along `side` lie in a plane, or so far behind it at most.
fn is_on(corners_m: &[DVec3], side: DVec3, at_m: DVec3, normal: DVec3, behind_m: f64) -> bool {
    normal.dot(side) > ASKEW && corners_m.iter().all(|p| (-behind_m..=NEAR_M).contains(&(*p - at_m).dot(normal)))
}

impl Placed {
    /// Moves and turns the luminaire so that a face of it lies on its surface, and covers what it lies on.
    fn settle(&mut self, outline: &[DVec3], side: DVec3, contact: Contact) {
        let Contact { normal, plane_m, pieces_m, of_room } = contact;
        let it = &mut self.luminaire;
        let turn = DMat3::from_quat(DQuat::from_rotation_arc(it.orientation * side, normal));
        it.orientation = turn * it.orientation;
        let centre_m = outline.iter().sum::<DVec3>() / outline.len() as f64;
        let at_m = it.position_m + it.orientation * centre_m;
        let (plate_m, opening_m) = if of_room.is_some() { (0.0, 0.0) } else { (GAP_M, 2.0 * GAP_M) };
        it.position_m += (plane_m + opening_m - at_m.dot(normal)) * normal;
        let flat = it.photometry.opening.flat_outline_m(flush::CORNERS).is_some();
        if let (Some(surface), true) = (of_room, flat) {
            // Exactly, as solvers of rooms want it.
            it.position_m[surface.axis()] = plane_m.abs();
        }
        self.plates.extend(pieces_m.into_iter().filter_map(|piece| plate(piece, normal, plane_m + plate_m)));
        if of_room.is_none() {
            self.normals.push(normal);
        }
    }
}

/// A black plate whose front faces along a normal; `None` where it has too few corners.
fn plate(mut corners_m: Vec<DVec3>, normal: DVec3, plane_m: f64) -> Option<Obstacle> {
    for corner in &mut corners_m {
        *corner += (plane_m - corner.dot(normal)) * normal;
        for axis in 0..3 {
            if normal[axis].abs() == 1.0 {
                corner[axis] = plane_m * normal[axis];
            }
        }
    }
    let size_m = corners_m.iter().map(|p| p.abs().max_element()).fold(0.0, f64::max);
    flush::straighten(&mut corners_m, size_m);
    // Corners where an edge was cut lie on a line, which is no corner of a plate.
    while let Some(k) = (0..corners_m.len()).find(|k| is_straight(&corners_m, *k)) {
        corners_m.remove((k + 1) % corners_m.len());
        if corners_m.len() < 3 {
            return None;
        }
    }
    if corners_m.len() < 3 {
        return None;
    }
    if crate::geometry::polygon::newell(&corners_m).dot(normal) < 0.0 {
        corners_m.reverse();
    }
    let triangles = flush::fan(corners_m.len()).collect();
    Some(Obstacle { shape: Shape::Mesh { vertices_m: corners_m, triangles }, reflectance: 0.0 })
}

/// Whether the edges from a corner on lie on a line up to the next but one.
fn is_straight(corners_m: &[DVec3], k: usize) -> bool {
    let [a, b] = flush::edges_from(corners_m, k);
    a.cross(b).length() <= STRAIGHT * a.length() * b.length()
}

/// Whether a luminaire sends light to a side of its own frame.
fn shines(luminaire: &Luminaire, side: DVec3) -> bool {
    flush::shines_along(luminaire.orientation * side, luminaire)
}

/// The normal of an outline in its own frame, by the turn of its corners.
fn own_normal(outline: &[DVec3]) -> DVec3 {
    crate::geometry::polygon::newell(outline).normalize_or_zero()
}

fn groups_of(shape: &Shape) -> Vec<Group<'_>> {
    match shape {
        Shape::Box { min_m, max_m } => {
            vec![Group { low_m: *min_m, high_m: *max_m, faces: Faces::Box(*min_m, *max_m) }]
        }
        Shape::Mesh { vertices_m, triangles } => {
            triangles.chunks(CHUNK).map(|some| Group::of_triangles(vertices_m, some)).collect()
        }
    }
}

impl<'a> Group<'a> {
    fn of_triangles(vertices_m: &'a [DVec3], triangles: &'a [[u32; 3]]) -> Self {
        let corners = triangles.iter().flatten().filter_map(|k| vertices_m.get(*k as usize));
        let start = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (low_m, high_m) = corners.fold(start, |(low, high), p| (low.min(*p), high.max(*p)));
        Self { low_m, high_m, faces: Faces::Triangles(vertices_m, triangles) }
    }

    /// Whether the box around it and another have a point in common.
    fn reaches(&self, low_m: DVec3, high_m: DVec3) -> bool {
        self.low_m.cmple(high_m).all() && self.high_m.cmpge(low_m).all()
    }
}

impl Faces<'_> {
    fn all(&self) -> Vec<Facet> {
        match self {
            Self::Box(min_m, max_m) => box_facets(*min_m, *max_m),
            Self::Triangles(vertices_m, triangles) => {
                triangles.iter().filter_map(|t| triangle_facet(vertices_m, t)).collect()
            }
        }
    }
}

/// The six faces of a box, each with its outward normal.
fn box_facets(min_m: DVec3, max_m: DVec3) -> Vec<Facet> {
    let vertices_m = Mesh::cuboid(min_m, max_m).vertices_m;
    let facets = (0..3).flat_map(|axis| {
        let normal = DVec3::AXES[axis];
        [box_facet(&vertices_m, -normal, min_m[axis]), box_facet(&vertices_m, normal, max_m[axis])]
    });
    facets.collect()
}

/// The face of a box that looks along or against an axis, at `plane_m` on that axis.
fn box_facet(vertices_m: &[DVec3], normal: DVec3, plane_m: f64) -> Facet {
    let axis = normal.abs().max_position();
    let mut corners_m: Vec<DVec3> = vertices_m.iter().copied().filter(|p| p[axis] == plane_m).collect();
    let centre_m = corners_m.iter().sum::<DVec3>() / corners_m.len() as f64;
    let (u, v) = (DVec3::AXES[(axis + 1) % 3], DVec3::AXES[(axis + 2) % 3]);
    let angle = |p: &DVec3| (*p - centre_m).dot(v).atan2((*p - centre_m).dot(u));
    corners_m.sort_by(|a, b| angle(a).total_cmp(&angle(b)));
    Facet { corners_m, normal }
}

fn triangle_facet(vertices_m: &[DVec3], triangle: &[u32; 3]) -> Option<Facet> {
    let corners = triangle.iter().map(|k| vertices_m.get(*k as usize).copied());
    let corners_m: Vec<DVec3> = corners.collect::<Option<_>>()?;
    let normal = (corners_m[1] - corners_m[0]).cross(corners_m[2] - corners_m[0]).try_normalize()?;
    Some(Facet { corners_m, normal })
}

impl Facet {
    /// How far its plane lies along an axis, measured at its first corner.
    fn along_m(&self, axis: DVec3) -> f64 {
        self.corners_m[0].dot(axis)
    }

    /// The foot on it of a point that is nearly on it, after the distance; `None` where it is on it or far off.
    fn snapped(&self, point_m: DVec3) -> Option<(f64, DVec3)> {
        let off_m = (point_m - self.corners_m[0]).dot(self.normal);
        let on_m = point_m - off_m * self.normal;
        (off_m != 0.0 && off_m.abs() <= NEAR_M && self.is_over(on_m)).then_some((off_m.abs(), on_m))
    }

    /// Whether a point of its plane lies in it, or as near to it as snapping reaches.
    fn is_over(&self, point_m: DVec3) -> bool {
        let turn = newell_sign(&self.corners_m, self.normal);
        (0..self.corners_m.len()).all(|k| {
            let (a, b) = (self.corners_m[k], self.corners_m[(k + 1) % self.corners_m.len()]);
            let inward = turn * self.normal.cross(b - a).normalize_or_zero();
            (point_m - a).dot(inward) >= -NEAR_M
        })
    }
}

/// 1 where corners turn counter-clockwise as seen from the side of a normal, else -1.
fn newell_sign(corners_m: &[DVec3], normal: DVec3) -> f64 {
    if crate::geometry::polygon::newell(corners_m).dot(normal) < 0.0 { -1.0 } else { 1.0 }
}

/// A plane with two axes in it; those of the world where it faces along one.
struct Plane {
    at_m: DVec3,
    axes: [DVec3; 2],
}

impl Plane {
    fn new(normal: DVec3, at_m: DVec3) -> Self {
        let axis = (0..3).find(|k| normal[*k].abs() == 1.0);
        let (at_m, axes) = match axis {
            Some(k) => (DVec3::AXES[k] * at_m[k], [DVec3::AXES[(k + 1) % 3], DVec3::AXES[(k + 2) % 3]]),
            None => (at_m, <[DVec3; 2]>::from(normal.any_orthonormal_pair())),
        };
        Self { at_m, axes }
    }

    fn on(&self, point_m: DVec3) -> DVec2 {
        let [u, v] = self.axes.map(|axis| (point_m - self.at_m).dot(axis));
        DVec2::new(u, v)
    }

    fn off(&self, at: DVec2) -> DVec3 {
        self.at_m + at.x * self.axes[0] + at.y * self.axes[1]
    }

    fn polygon(&self, facet: &Facet) -> Vec<DVec2> {
        facet.corners_m.iter().map(|p| self.on(*p)).collect()
    }
}

/// The area of a polygon, positive where it turns to the left.
fn area(corners: &[DVec2]) -> f64 {
    if corners.len() < 3 { 0.0 } else { crate::geometry::polygon::area(corners) }
}

/// Whether a piece of a polygon of area `whole` is rounding.
fn is_sliver(piece: &[DVec2], whole: f64) -> bool {
    area(piece).abs() <= SLIVER * whole
}

/// Parts a convex polygon into what lies in another and convex pieces of the rest.
fn cut(polygon: &[DVec2], by: &[DVec2]) -> (Vec<DVec2>, Vec<Vec<DVec2>>) {
    let sign = if area(by) < 0.0 { -1.0 } else { 1.0 };
    let (mut inside, mut outside) = (polygon.to_vec(), vec![]);
    for (k, a) in by.iter().enumerate() {
        let inward = sign * (by[(k + 1) % by.len()] - *a).perp();
        outside.push(half(&inside, *a, -inward));
        inside = half(&inside, *a, inward);
    }
    outside.retain(|piece| piece.len() > 2);
    (inside, outside)
}

/// The part of a convex polygon on one side of a line through a point.
fn half(polygon: &[DVec2], at: DVec2, inward: DVec2) -> Vec<DVec2> {
    let mut part = Vec::with_capacity(polygon.len() + 1);
    for (k, p) in polygon.iter().enumerate() {
        let q = polygon[(k + 1) % polygon.len()];
        let (a, b) = ((*p - at).dot(inward), (q - at).dot(inward));
        if a >= 0.0 {
            part.push(*p);
        }
        if (a < 0.0 && b > 0.0) || (a > 0.0 && b < 0.0) {
            part.push(p.lerp(q, a / (a - b)));
        }
    }
    part
}

/// Where the black plate that a luminaire's opening lies before faces: the surface that it is in contact with.
pub fn normal_of(obstacles: &[Obstacle], luminaire: &Luminaire) -> Option<DVec3> {
    obstacles.iter().find_map(|obstacle| contact_normal(obstacle, luminaire))
}

/// The plates that a luminaire's opening lies before, by their places.
pub fn plates_of(obstacles: &[Obstacle], luminaire: &Luminaire) -> Vec<(usize, DVec3)> {
    let all = obstacles.iter().enumerate();
    all.filter_map(|(k, obstacle)| Some((k, contact_normal(obstacle, luminaire)?))).collect()
}

/// The normal of a black plate that a luminaire's opening lies before.
fn contact_normal(obstacle: &Obstacle, luminaire: &Luminaire) -> Option<DVec3> {
    plate_normal(obstacle).filter(|normal| lies_before(luminaire, obstacle, *normal))
}

/// The unit normal of a black plate's front.
fn plate_normal(obstacle: &Obstacle) -> Option<DVec3> {
    if !flush::is_plate(obstacle) {
        return None;
    }
    let Shape::Mesh { vertices_m: p, .. } = &obstacle.shape else { return None };
    let normal = (p[1] - p[0]).cross(p[2] - p[1]).try_normalize()?;
    let axis = normal.abs().max_position();
    let is_rounded = normal[axis].abs() > 1.0 - ALONG_AXIS;
    Some(if is_rounded { normal[axis].signum() * DVec3::AXES[axis] } else { normal })
}

/// Whether an opening lies upon a plate that is no larger than it.
fn lies_before(luminaire: &Luminaire, plate: &Obstacle, normal: DVec3) -> bool {
    let Shape::Mesh { vertices_m, .. } = &plate.shape else { return false };
    if luminaire.model == LuminaireModel::Point {
        return false;
    }
    let to_own = luminaire.orientation.transpose();
    let opening = luminaire.photometry.opening;
    let off_m = (luminaire.position_m - vertices_m[0]).dot(normal) - opening.reach_m(to_own * normal);
    let [width, length, height] = opening.bounding_box_m();
    // The polygon of a round opening reaches beyond its circle.
    let half_m = 0.505 * DVec3::new(length, width, height) + 3.0 * GAP_M;
    (-0.1 * GAP_M..=1.1 * GAP_M).contains(&off_m)
        && vertices_m.iter().all(|p| (to_own * (*p - luminaire.position_m)).abs().cmple(half_m).all())
}

#[cfg(test)]
#[path = "contact_tests.rs"]
mod tests;
