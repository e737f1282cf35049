//! Rooms that are no boxes: a box around them, and bodies or sheets where their walls stand within it. What lies beyond the walls is dark,
//! and nobody looks at it.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3};

use super::flush::snap;
use super::{Obstacle, Shape};
use crate::geometry::polygon::area;
use crate::geometry::{Mesh, Reflectances, Room, Surface, solid_angle_sr};

/// Nearer to a plane of the box around it than this, in parts of its largest extent, a wall lies in it.
const IN_PLANE: f64 = 1e-9;
/// Of faces in one plane of that box those of the largest reflectance's area are the box's own; others come so far before it, in the same parts.
const BEFORE: f64 = 1e-6;
/// The winding number of a closed surface about a point within it is one, as exactly as angles add up.
const CLOSED: f64 = 1e-6;

/// A closed room of any shape: the box around it and what stands in that.
#[derive(Clone, Debug)]
pub struct Enclosure {
    /// From the origin to the farthest corner.
    pub room: Room,
    /// Walls that are not the box's own.
    pub walls: Vec<Obstacle>,
    outline: Outline,
}

#[derive(Clone, Debug)]
enum Outline {
    Box,
    /// Upright walls over a simple polygon, counter-clockwise seen from above.
    Prism(Vec<DVec2>),
    /// Triangles whose front is the inside, or all of them the outside.
    Mesh(Vec<[DVec3; 3]>),
}

/// Why there is no room in what was given.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NoRoom {
    /// Fewer corners than a triangle has.
    #[error("a floor has three corners at least")]
    TooFewCorners,
    /// As many reflectances as walls are wanted.
    #[error("{given} reflectances for {walls} walls")]
    Reflectances {
        /// How many there are.
        given: usize,
        /// How many it has.
        walls: usize,
    },
    /// The box around it begins at the origin.
    #[error("it reaches to {at}, below the origin; move it so that no coordinate is negative")]
    Negative {
        /// The lowest corner.
        at: DVec3,
    },
    /// A corner that is no number, or nothing between its corners.
    #[error("it holds nothing")]
    Empty,
    /// Two walls meet elsewhere than at a common corner.
    #[error("wall {0} crosses or touches wall {1} (counted from 0)")]
    Crossing(usize, usize),
}

/// A face of a room of any shape.
#[derive(Clone, Debug)]
pub struct Face {
    /// In metres.
    pub corners_m: [DVec3; 3],
    /// Diffuse.
    pub reflectance: f64,
}

impl Enclosure {
    /// A room that is its own box.
    pub fn cuboid(room: Room) -> Self {
        Self { room, walls: vec![], outline: Outline::Box }
    }

    /// Upright walls over a polygon, whose `k`-th wall runs from corner `k` to the next; turned either way.
    ///
    /// Where all walls run along x and y, and those within the box around them are alike, boxes stand beyond them; else sheets of no thickness.
    pub fn prism(floor_m: &[DVec2], height_m: f64, [floor, ceiling]: [f64; 2], walls: &[f64]) -> Result<Self, NoRoom> {
        if floor_m.len() < 3 {
            return Err(NoRoom::TooFewCorners);
        }
        if walls.len() != floor_m.len() {
            return Err(NoRoom::Reflectances { given: walls.len(), walls: floor_m.len() });
        }
        let high = floor_m.iter().copied().fold(DVec2::NEG_INFINITY, DVec2::max).extend(height_m);
        let low = floor_m.iter().copied().fold(DVec2::INFINITY, DVec2::min).extend(0.0);
        check_extent(low, high)?;
        let near_m = IN_PLANE * high.max_element();
        let corners: Vec<DVec2> =
            floor_m.iter().map(|p| DVec2::new(snap(p.x, high.x, near_m), snap(p.y, high.y, near_m))).collect();
        crossing(&corners).map_or(Ok(()), Err)?;
        let turned = area(&corners) < 0.0;
        let (outline, walls) = if turned { reversed(&corners, walls) } else { (corners, walls.to_vec()) };
        let mut faces = vec![];
        let edges: Vec<Edge> = edges(&outline).zip(&walls).map(|((a, b), rho)| Edge { a, b, rho: *rho }).collect();
        let size = high.truncate();
        let reflectances = Reflectances::with_equal_walls(floor, 0.0, ceiling);
        let mut room = Room { size_m: high, reflectance: reflectances };
        let (within, bounding): (Vec<&Edge>, Vec<&Edge>) = edges.iter().partition(|e| e.plane(size).is_none());
        let alike = within.windows(2).all(|w| w[0].rho == w[1].rho);
        let is_straight = edges.iter().all(|e| e.a.x == e.b.x || e.a.y == e.b.y);
        let mut solid = vec![];
        if let Some(first) = within.first().filter(|_| alike && is_straight) {
            solid = beyond(&outline, size, height_m, first.rho);
        } else {
            faces.extend(within.iter().flat_map(|e| e.faces(height_m)));
        }
        faces.extend(bounding.iter().flat_map(|e| e.faces(height_m)));
        let mut walls = solid;
        walls.extend(sheets(faces, &mut room));
        Ok(Self { room, walls, outline: Outline::Prism(outline) })
    }

    /// A room of faces that close it, all turned to the same side.
    pub fn of_faces(faces: Vec<Face>) -> Result<Self, NoRoom> {
        let corners = faces.iter().flat_map(|f| f.corners_m);
        let low = corners.clone().fold(DVec3::INFINITY, DVec3::min);
        let high = corners.fold(DVec3::NEG_INFINITY, DVec3::max);
        check_extent(low, high)?;
        let outline = Outline::Mesh(faces.iter().map(|f| f.corners_m).collect());
        let mut room = Room { size_m: high, reflectance: Reflectances::with_equal_walls(0.0, 0.0, 0.0) };
        let walls = sheets(faces, &mut room);
        Ok(Self { room, walls, outline })
    }

    /// Whether a point of the box around it lies within its walls, at least `margin_m` from each that is not the box's own.
    ///
    /// Of a mesh the margin is none: only whether it closes about the point is reported.
    pub fn contains(&self, point_m: DVec3, margin_m: f64) -> bool {
        self.contains_with(point_m, margin_m, None)
    }

    /// The same for a point next to a surface of the box around it: its margin is to walls that are not in that surface.
    pub fn contains_beside(&self, point_m: DVec3, margin_m: f64, surface: Surface) -> bool {
        self.contains_with(point_m, margin_m, Some(surface))
    }

    fn contains_with(&self, point_m: DVec3, margin_m: f64, beside: Option<Surface>) -> bool {
        match &self.outline {
            Outline::Box => true,
            Outline::Prism(corners) => {
                let (p, size) = (point_m.truncate(), self.room.size_m.truncate());
                let mut others = edges(corners).filter(|(a, b)| beside.is_none() || plane(*a, *b, size) != beside);
                is_within(corners, p) && others.all(|(a, b)| distance_m(p, a, b) >= margin_m)
            }
            Outline::Mesh(faces) => (winding(faces, point_m).abs() - 1.0).abs() < CLOSED,
        }
    }

    /// Whether a point lies within its walls or on one, as far as rounding tells.
    pub fn reaches(&self, point_m: DVec3) -> bool {
        let step_m = BEFORE * self.room.size_m.max_element();
        let around = (0..27).map(|k| DVec3::new(f64::from(k % 3), f64::from(k / 3 % 3), f64::from(k / 9)) - 1.0);
        self.contains(point_m, 0.0) || around.map(|way| point_m + step_m * way).any(|near| self.contains(near, 0.0))
    }

    /// Whether a mesh gave its walls.
    pub const fn is_of_faces(&self) -> bool {
        matches!(self.outline, Outline::Mesh(_))
    }

    /// Triangles that each look at what [`Self::contains`] goes through.
    pub fn faces(&self) -> usize {
        match &self.outline {
            Outline::Box => 0,
            Outline::Prism(corners) => corners.len(),
            Outline::Mesh(faces) => faces.len(),
        }
    }
}

fn check_extent(low: DVec3, high: DVec3) -> Result<(), NoRoom> {
    if !low.is_finite() || !high.is_finite() {
        return Err(NoRoom::Empty);
    }
    if low.min_element() < -IN_PLANE * high.abs().max_element() {
        return Err(NoRoom::Negative { at: low });
    }
    if (high - low).min_element() > 0.0 { Ok(()) } else { Err(NoRoom::Empty) }
}

/// A wall over the floor, the room at its left.
struct Edge {
    a: DVec2,
    b: DVec2,
    rho: f64,
}

impl Edge {
    /// The surface of the box in whose plane it stands.
    fn plane(&self, size: DVec2) -> Option<Surface> {
        plane(self.a, self.b, size)
    }

    /// Its front faces the room.
    fn faces(&self, height_m: f64) -> [Face; 2] {
        let [a, b, c, d] = [self.b.extend(0.0), self.a.extend(0.0), self.a.extend(height_m), self.b.extend(height_m)];
        [[a, b, c], [a, c, d]].map(|corners_m| Face { corners_m, reflectance: self.rho })
    }
}

/// The surface of a box of this size that a wall from `a` to `b` stands in.
fn plane(a: DVec2, b: DVec2, size: DVec2) -> Option<Surface> {
    let planes = [
        (0, 0.0, Surface::WallXMin),
        (0, size.x, Surface::WallXMax),
        (1, 0.0, Surface::WallYMin),
        (1, size.y, Surface::WallYMax),
    ];
    let found = planes.into_iter().find(|(axis, at, _)| a[*axis] == *at && b[*axis] == *at);
    found.map(|(_, _, surface)| surface)
}

fn edges(corners: &[DVec2]) -> impl Iterator<Item = (DVec2, DVec2)> + '_ {
    corners.iter().copied().zip(corners.iter().copied().cycle().skip(1))
}

/// The same polygon the other way round, with its walls.
fn reversed(corners: &[DVec2], walls: &[f64]) -> (Vec<DVec2>, Vec<f64>) {
    let corners = corners.iter().rev().copied().collect();
    // The wall from corner n - 2 to n - 1 comes first now, that from n - 1 to 0 last.
    let mut walls: Vec<f64> = walls.iter().rev().copied().collect();
    walls.rotate_left(1);
    (corners, walls)
}

/// The first two walls that meet but at a corner which they share.
fn crossing(corners: &[DVec2]) -> Option<NoRoom> {
    let all: Vec<(DVec2, DVec2)> = edges(corners).collect();
    let n = all.len();
    if let Some(k) = all.iter().position(|(a, b)| a == b) {
        return Some(NoRoom::Crossing(k, (k + 1) % n));
    }
    for j in 0..n {
        for k in j + 1..n {
            let ((a, b), (c, d)) = (all[j], all[k]);
            let follows = k == j + 1 || (j == 0 && k == n - 1);
            let meet = if follows {
                // They share a corner; more than that is a wall folded back on itself.
                let (shared, one, other) = if k == j + 1 { (b, a, d) } else { (a, b, c) };
                side(one, shared, other) == 0.0 && (one - shared).dot(other - shared) > 0.0
            } else {
                do_walls_meet([a, b], [c, d])
            };
            if meet {
                return Some(NoRoom::Crossing(j, k));
            }
        }
    }
    None
}

/// Whether two walls that share no corner cross or touch.
fn do_walls_meet([a, b]: [DVec2; 2], [c, d]: [DVec2; 2]) -> bool {
    let is_crossing = side(a, b, c) * side(a, b, d) < 0.0 && side(c, d, a) * side(c, d, b) < 0.0;
    is_crossing || is_on(a, b, c) || is_on(a, b, d) || is_on(c, d, a) || is_on(c, d, b)
}

/// Positive where a point lies at the left of a line from `a` to `b`, 0 on the line.
fn side(a: DVec2, b: DVec2, p: DVec2) -> f64 {
    (b - a).perp_dot(p - a)
}

/// Whether a point lies on the segment from `a` to `b`, ends included.
fn is_on(a: DVec2, b: DVec2, p: DVec2) -> bool {
    side(a, b, p) == 0.0 && (p - a).dot(p - b) <= 0.0
}

/// Whether a point lies within a polygon, by how often a ray leaves it.
fn is_within(corners: &[DVec2], p: DVec2) -> bool {
    let level = edges(corners).filter(|(a, b)| (a.y > p.y) != (b.y > p.y));
    level.filter(|(a, b)| p.x < a.x + (b.x - a.x) * (p.y - a.y) / (b.y - a.y)).count() % 2 == 1
}

fn distance_m(p: DVec2, a: DVec2, b: DVec2) -> f64 {
    let along = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
    p.distance(a.lerp(b, along))
}

/// How often faces go round a point: their solid angles over that of a sphere.
fn winding(faces: &[[DVec3; 3]], point_m: DVec3) -> f64 {
    faces.iter().map(|corners| solid_angle_sr(corners.map(|p| p - point_m))).sum::<f64>() / (4.0 * std::f64::consts::PI)
}

/// Boxes over all of a rectangle that a polygon of edges along x and y leaves out.
fn beyond(outline: &[DVec2], size: DVec2, height_m: f64, reflectance: f64) -> Vec<Obstacle> {
    let (xs, ys) = (stops(outline.iter().map(|p| p.x), size.x), stops(outline.iter().map(|p| p.y), size.y));
    // Runs of cells along x, each grown over the rows above that have the same.
    let mut open: Vec<[f64; 4]> = vec![];
    let mut done: Vec<[f64; 4]> = vec![];
    for y in ys.windows(2) {
        let mut row: Vec<[f64; 2]> = vec![];
        for x in xs.windows(2) {
            if is_within(outline, DVec2::new(0.5 * (x[0] + x[1]), 0.5 * (y[0] + y[1]))) {
                continue;
            }
            match row.last_mut().filter(|run| run[1] == x[0]) {
                Some(run) => run[1] = x[1],
                None => row.push([x[0], x[1]]),
            }
        }
        let mut next = vec![];
        for run in row {
            let below = open.iter().position(|o| o[0] == run[0] && o[1] == run[1]).map(|k| open.swap_remove(k));
            next.push([run[0], run[1], below.map_or(y[0], |o| o[2]), y[1]]);
        }
        done.append(&mut open);
        open = next;
    }
    done.append(&mut open);
    let shapes = done
        .into_iter()
        .map(|[x0, x1, y0, y1]| Shape::Box { min_m: DVec3::new(x0, y0, 0.0), max_m: DVec3::new(x1, y1, height_m) });
    shapes.map(|shape| Obstacle { shape, reflectance }).collect()
}

/// Coordinates and the ends of `0..=size` in ascending order, each once.
fn stops(coordinates: impl Iterator<Item = f64>, size: f64) -> Vec<f64> {
    let mut all: Vec<f64> = coordinates.chain([0.0, size]).collect();
    all.sort_by(f64::total_cmp);
    all.dedup();
    all
}

/// Faces as sheets, one of each reflectance, but for those in a plane of the box around them, whose surface takes the reflectance of most.
fn sheets(faces: Vec<Face>, room: &mut Room) -> Vec<Obstacle> {
    let near_m = IN_PLANE * room.size_m.max_element();
    let before_m = BEFORE * room.size_m.max_element();
    let mut left = faces;
    let mut sheets: Vec<Face> = vec![];
    for surface in Surface::ALL {
        let plane_m = if surface.is_far() { room.size_m[surface.axis()] } else { 0.0 };
        let (within, others): (Vec<Face>, Vec<Face>) =
            left.into_iter().partition(|f| f.corners_m.iter().all(|p| (p[surface.axis()] - plane_m).abs() <= near_m));
        left = others;
        let Some(own) = most_of(&within) else { continue };
        *room.reflectance.of_mut(surface) = own;
        let offset = before_m * surface.inward_normal();
        let others = within.into_iter().filter(|f| f.reflectance != own);
        sheets.extend(others.map(|f| Face { corners_m: f.corners_m.map(|p| p + offset), ..f }));
    }
    sheets.extend(left);
    let mut obstacles: Vec<(f64, Mesh)> = vec![];
    for face in sheets {
        let known = obstacles.iter().position(|(rho, _)| *rho == face.reflectance);
        let k = known.unwrap_or(obstacles.len());
        if known.is_none() {
            obstacles.push((face.reflectance, Mesh::default()));
        }
        obstacles[k].1.push(face.corners_m);
    }
    obstacles.into_iter().map(|(reflectance, mesh)| Obstacle { shape: mesh.into(), reflectance }).collect()
}

/// The reflectance that most of the area has.
fn most_of(faces: &[Face]) -> Option<f64> {
    let mut areas: BTreeMap<u64, f64> = BTreeMap::new();
    for face in faces {
        let [a, b, c] = face.corners_m;
        *areas.entry(face.reflectance.to_bits()).or_default() += (b - a).cross(c - a).length();
    }
    faces.iter().map(|f| f.reflectance).max_by(|a, b| areas[&a.to_bits()].total_cmp(&areas[&b.to_bits()]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn corners(all: &[[f64; 2]]) -> Vec<DVec2> {
        all.iter().map(|p| DVec2::from(*p)).collect()
    }

    const L: [[f64; 2]; 6] = [[0.0, 0.0], [6.0, 0.0], [6.0, 2.0], [3.0, 2.0], [3.0, 5.0], [0.0, 5.0]];

    #[test]
    fn an_l_is_a_box_with_a_box_in_its_corner_whichever_way_round() {
        let mut walls = [0.5; 6];
        walls[0] = 0.4;
        let one = Enclosure::prism(&corners(&L), 3.0, [0.2, 0.7], &walls).unwrap();
        let [Obstacle { shape: Shape::Box { min_m, max_m }, reflectance }] = &one.walls[..] else { panic!("{one:?}") };
        assert_eq!((*min_m, *max_m), (DVec3::new(3.0, 2.0, 0.0), DVec3::new(6.0, 5.0, 3.0)));
        assert_eq!((*reflectance, one.room.size_m), (0.5, DVec3::new(6.0, 5.0, 3.0)));
        assert_eq!((one.room.reflectance.wall_y_min, one.room.reflectance.wall_x_max), (0.4, 0.5));
        let mut back = corners(&L);
        back.reverse();
        walls = [0.5; 6];
        walls[4] = 0.4;
        let other = Enclosure::prism(&back, 3.0, [0.2, 0.7], &walls).unwrap();
        assert_eq!(other.room, one.room);
        for (point, is_in) in [([1.0, 1.0, 1.0], true), ([5.0, 4.0, 1.0], false), ([2.999, 4.0, 1.0], true)] {
            assert_eq!(one.contains(DVec3::from(point), 1e-6), is_in, "{point:?}");
        }
        assert!(!one.contains(DVec3::new(2.999, 4.0, 1.0), 0.01));
        // On its walls, those of the box and those within it.
        for point in
            [[6.0, 1.0, 2.0], [0.0, 1.0, 2.0], [5.0, 2.0, 2.0], [3.0, 4.0, 2.0], [1.0, 5.0, 2.0], [1.0, 1.0, 3.0]]
        {
            assert!(one.reaches(DVec3::from(point)), "{point:?}");
        }
        assert!(!one.reaches(DVec3::new(5.0, 2.001, 2.0)) && !one.reaches(DVec3::new(6.0, 5.0, 2.0)));
    }

    #[test]
    fn a_floor_is_covered_but_for_the_room_whatever_its_shape() {
        // A corridor with niches, a plus, a spiral.
        let niches = [
            [0., 0.],
            [9., 0.],
            [9., 1.],
            [7., 1.],
            [7., 3.],
            [6., 3.],
            [6., 1.],
            [3., 1.],
            [3., 2.],
            [1., 2.],
            [1., 1.],
            [0., 1.],
        ];
        let plus = [
            [2., 0.],
            [4., 0.],
            [4., 2.],
            [6., 2.],
            [6., 4.],
            [4., 4.],
            [4., 6.],
            [2., 6.],
            [2., 4.],
            [0., 4.],
            [0., 2.],
            [2., 2.],
        ];
        let spiral = [
            [0., 0.],
            [6., 0.],
            [6., 6.],
            [1., 6.],
            [1., 2.],
            [4., 2.],
            [4., 4.],
            [3., 4.],
            [3., 3.],
            [2., 3.],
            [2., 5.],
            [5., 5.],
            [5., 1.],
            [0., 1.],
        ];
        for floor in [&niches[..], &plus, &spiral] {
            let floor = corners(floor);
            let room = Enclosure::prism(&floor, 2.0, [0.2, 0.7], &vec![0.5; floor.len()]).unwrap();
            let boxes = room.walls.iter().map(|o| match o.shape {
                Shape::Box { min_m, max_m } => max_m - min_m,
                Shape::Mesh { .. } => panic!("no sheets"),
            });
            let out: f64 = boxes.map(DVec3::element_product).sum();
            let whole = room.room.size_m.element_product();
            assert!((whole - out - 2.0 * area(&floor).abs()).abs() < 1e-9, "{out} of {whole}");
        }
    }

    #[test]
    fn walls_that_are_not_alike_or_not_straight_are_sheets_that_face_the_room() {
        let triangle = corners(&[[0.0, 0.0], [4.0, 0.0], [0.0, 3.0]]);
        let room = Enclosure::prism(&triangle, 2.0, [0.2, 0.7], &[0.1, 0.2, 0.3]).unwrap();
        let [Obstacle { shape: Shape::Mesh { vertices_m, triangles }, reflectance: 0.2 }] = &room.walls[..] else {
            panic!("{room:?}")
        };
        let [a, b, c] = triangles[0].map(|k| vertices_m[k as usize]);
        assert!((b - a).cross(c - a).dot(DVec3::new(-1.0, -1.0, 0.0)) > 0.0);
        let r = room.room.reflectance;
        assert_eq!((r.wall_y_min, r.wall_x_min, r.wall_x_max), (0.1, 0.3, 0.0));
    }

    #[test]
    fn faces_that_close_a_room_tell_what_is_in_it() {
        let mesh = Mesh::cuboid(DVec3::ZERO, DVec3::new(4.0, 3.0, 2.0));
        let mut faces: Vec<Face> = mesh
            .triangles
            .iter()
            .map(|t| Face { corners_m: t.map(|k| mesh.vertices_m[k as usize]), reflectance: 0.5 })
            .collect();
        faces[0].reflectance = 0.25;
        let room = Enclosure::of_faces(faces.clone()).unwrap();
        assert!(room.contains(DVec3::ONE, 0.0) && !room.contains(DVec3::splat(2.5), 0.0));
        for on in [DVec3::new(2.0, 1.5, 2.0), DVec3::new(0.0, 1.0, 1.0), DVec3::new(4.0, 3.0, 2.0)] {
            assert!(room.reaches(on), "{on}");
        }
        // Half of one of its faces is a sheet before the box's.
        assert_eq!((room.walls.len(), room.room.reflectance.ceiling), (1, 0.5));
        faces.pop();
        assert!(!Enclosure::of_faces(faces).unwrap().contains(DVec3::ONE, 0.0), "it is open");
    }

    /// Why a floor of these corners gives no room.
    fn refused(all: &[[f64; 2]]) -> NoRoom {
        Enclosure::prism(&corners(all), 2.0, [0.5, 0.5], &vec![0.5; all.len()]).unwrap_err()
    }

    #[test]
    fn what_is_no_room_is_refused() {
        assert_eq!(refused(&[[0.0, 0.0], [1.0, 0.0]]), NoRoom::TooFewCorners);
        assert_eq!(refused(&[[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]]), NoRoom::Crossing(0, 2));
        assert_eq!(refused(&[[0.0, 0.0], [2.0, 0.0], [1.0, 0.0], [1.0, 1.0]]), NoRoom::Crossing(0, 1));
        assert_eq!(refused(&[[0.0, 0.0], [0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]), NoRoom::Crossing(0, 1));
        assert!(matches!(refused(&[[-1.0, 0.0], [1.0, 0.0], [1.0, 1.0]]), NoRoom::Negative { .. }));
        assert_eq!(refused(&[[0.0, 0.0], [f64::NAN, 0.0], [1.0, 1.0]]), NoRoom::Empty);
        assert_eq!(refused(&[[0.0, 0.0], [2.0, 0.0], [1.0, 0.0]]), NoRoom::Empty);
        let few = Enclosure::prism(&corners(&L), 2.0, [0.5, 0.5], &[0.5]).unwrap_err();
        assert_eq!(few, NoRoom::Reflectances { given: 1, walls: 6 });
    }
}
