//! What of a flat polygon a point sees between boxes: shadows are cut away exactly, as convex pieces.
//!
//! From a point, a box hides what lies behind those of its faces that look towards the point. Each such face spans a
//! cone of planes; what is outside of one plane and inside those before it is a convex visible piece.

use glam::DVec3;

use luxproof_scene::Shape;

/// Lengths below this fraction of the scene count as zero.
const ROUNDING: f64 = 1e-12;
/// Distances below this fraction of a body count as contact.
const CONTACT: f64 = 1e-9;

/// A convex flat polygon.
pub(super) type Polygon = Vec<DVec3>;

/// An opaque axis-aligned box, or a plate where one extent is zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Occluder {
    pub(super) min_m: DVec3,
    pub(super) max_m: DVec3,
}

impl Occluder {
    /// A box, or a mesh of two triangles that is an axis-aligned plate.
    pub(super) fn aligned(shape: &Shape) -> Option<Self> {
        match shape {
            Shape::Box { min_m, max_m } => Some(Self { min_m: *min_m, max_m: *max_m }),
            Shape::Mesh { vertices_m, triangles } => {
                let [a, b] = triangles.as_slice() else { return None };
                let corner = |i: &u32| vertices_m[*i as usize];
                let all: Vec<DVec3> = a.iter().chain(b).map(corner).collect();
                let min_m = all.iter().fold(DVec3::INFINITY, |m, p| m.min(*p));
                let max_m = all.iter().fold(DVec3::NEG_INFINITY, |m, p| m.max(*p));
                let extent = max_m - min_m;
                let area =
                    |t: &[u32; 3]| 0.5 * (corner(&t[1]) - corner(&t[0])).cross(corner(&t[2]) - corner(&t[0])).length();
                let whole = extent.x * extent.y + extent.y * extent.z + extent.z * extent.x;
                let at_corner = |p: &DVec3| p.cmpeq(min_m) | p.cmpeq(max_m);
                let shared = a.iter().filter(|i| b.contains(i)).map(corner).collect::<Vec<_>>();
                let [p, q] = shared.as_slice() else { return None };
                let diagonal = (*p - *q).length() >= (1.0 - CONTACT) * extent.length();
                let flat = extent.min_element() == 0.0 && all.iter().all(|p| at_corner(p).all());
                let halves = [a, b].iter().all(|t| (area(t) - 0.5 * whole).abs() <= CONTACT * whole);
                (flat && diagonal && halves && whole > 0.0).then_some(Self { min_m, max_m })
            }
        }
    }

    /// The corners of the face at one end of an axis.
    pub(super) fn face(&self, axis: usize, far: bool) -> [DVec3; 4] {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let ends = [self.min_m, self.max_m];
        [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(i, j): (usize, usize)| {
            let mut p = DVec3::ZERO;
            p[axis] = ends[usize::from(far)][axis];
            p[u] = ends[i][u];
            p[v] = ends[j][v];
            p
        })
    }

    /// Whether it stops light on the straight way between two points; touching is no stop.
    pub(super) fn blocks(&self, from: DVec3, to: DVec3) -> bool {
        let along = to - from;
        let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
        for axis in 0..3 {
            let (a, b) = (self.min_m[axis] - from[axis], self.max_m[axis] - from[axis]);
            if along[axis] == 0.0 {
                if a >= 0.0 || b <= 0.0 {
                    return false;
                }
                continue;
            }
            let (near, far) = if along[axis] > 0.0 { (a, b) } else { (b, a) };
            enter = enter.max(near / along[axis]);
            leave = leave.min(far / along[axis]);
        }
        // A plate is crossed in a single point.
        let plate = (self.max_m - self.min_m).min_element() == 0.0;
        if plate { enter <= leave && enter > ROUNDING && leave < 1.0 - ROUNDING } else { leave - enter > ROUNDING }
    }

    /// Whether it could hide any of the polygon: not if a plane parts it from the pyramid of point and polygon.
    pub(super) fn may_hide(&self, from: DVec3, polygon: &[DVec3], centre: DVec3) -> bool {
        let (low, high) = polygon.iter().fold((from, from), |(low, high), p| (low.min(*p), high.max(*p)));
        let slack = DVec3::splat(ROUNDING * (high - low).max_element());
        if (self.max_m - low).cmple(slack).any() && (self.max_m - self.min_m).cmpgt(DVec3::ZERO).all()
            || (high - self.min_m).cmplt(-slack).any()
            || (self.max_m - low).cmplt(-slack).any()
        {
            return false;
        }
        let (middle, half) = (0.5 * (self.min_m + self.max_m) - from, 0.5 * (self.max_m - self.min_m));
        let view = centre - from;
        let edges = (0..polygon.len()).map(|k| [polygon[k] - from, polygon[(k + 1) % polygon.len()] - from]);
        edges.filter_map(through).all(|m| {
            let m = if m.dot(view) < 0.0 { -m } else { m };
            m.dot(middle) + m.abs().dot(half) > 0.0
        })
    }
}

/// The boxes that may hide a polygon from a point.
pub(super) fn candidates<'a>(from: DVec3, polygon: &[DVec3], occluders: &'a [Occluder]) -> Vec<&'a Occluder> {
    let centre = polygon.iter().sum::<DVec3>() / polygon.len() as f64;
    occluders.iter().filter(|occluder| occluder.may_hide(from, polygon, centre)).collect()
}

/// The visible part of a convex polygon from a point off its plane, as convex pieces.
pub(super) fn visible_pieces(from: DVec3, polygon: &[DVec3], hiding: &[&Occluder]) -> Vec<Polygon> {
    let mut pieces = vec![polygon.to_vec()];
    let Some(plane) = Plane::of(polygon, from) else { return pieces };
    for occluder in hiding {
        for axis in 0..3 {
            for far in [false, true] {
                let face = occluder.face(axis, far);
                let height = from[axis] - face[0][axis];
                if (if far { height } else { -height }) <= 0.0 {
                    continue;
                }
                // Only what stands between the point and the polygon's plane hides any of it.
                let between = clip(&face, plane.normal, plane.point);
                let deepest = between.iter().map(|p| (p - plane.point).dot(plane.normal)).fold(0.0, f64::max);
                if between.len() >= 3 && deepest > ROUNDING * plane.distance {
                    pieces = pieces.into_iter().flat_map(|piece| outside_cone(from, piece, &between)).collect();
                }
            }
        }
    }
    pieces
}

struct Plane {
    point: DVec3,
    /// Towards the point that looks at it.
    normal: DVec3,
    distance: f64,
}

impl Plane {
    fn of(polygon: &[DVec3], from: DVec3) -> Option<Self> {
        // Of all corners: three of what was cut before may lie on a line.
        let triangle = |k: usize| (polygon[k - 1] - polygon[0]).cross(polygon[k] - polygon[0]);
        let normal = (2..polygon.len()).map(triangle).sum::<DVec3>().try_normalize()?;
        let height = (from - polygon[0]).dot(normal);
        (height != 0.0).then(|| Self {
            point: polygon[0],
            normal: normal * height.signum(),
            distance: (from - polygon[0]).length(),
        })
    }
}

/// The unit normal of the plane through the origin and an edge; none where that has no length to speak of, as what is cut at a corner.
fn through([a, b]: [DVec3; 2]) -> Option<DVec3> {
    let normal = a.cross(b);
    let is_long = normal.length_squared() > (ROUNDING * ROUNDING) * a.length_squared() * b.length_squared();
    normal.try_normalize().filter(|_| is_long)
}

/// The pieces of a convex polygon that lie outside the cone from a point through a convex face.
fn outside_cone(from: DVec3, piece: Polygon, face: &[DVec3]) -> Vec<Polygon> {
    let centre = face.iter().sum::<DVec3>() / face.len() as f64 - from;
    let mut planes = vec![];
    for (k, a) in face.iter().enumerate() {
        let b = face[(k + 1) % face.len()];
        let Some(m) = through([a - from, b - from]) else { continue };
        let m = if m.dot(centre) < 0.0 { -m } else { m };
        let reach = piece.iter().map(|p| m.dot(p - from)).fold(f64::NEG_INFINITY, f64::max);
        if reach <= ROUNDING * centre.length() {
            return vec![piece];
        }
        planes.push(m);
    }
    let (mut outside, mut inside) = (vec![], piece);
    for m in planes {
        let part = clip(&inside, -m, from);
        if is_solid(&part) {
            outside.push(part);
        }
        inside = clip(&inside, m, from);
        if !is_solid(&inside) {
            break;
        }
    }
    outside
}

/// Whether a polygon has an area to speak of.
fn is_solid(polygon: &[DVec3]) -> bool {
    polygon.len() >= 3
        && (2..polygon.len()).any(|k| {
            let (a, b) = (polygon[k - 1] - polygon[0], polygon[k] - polygon[0]);
            a.cross(b).length() > ROUNDING * ROUNDING * (a.length_squared() + b.length_squared())
        })
}

/// The part of a convex polygon on the side of a plane that its normal points to.
pub(super) fn clip(polygon: &[DVec3], normal: DVec3, point: DVec3) -> Polygon {
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (k, &p) in polygon.iter().enumerate() {
        let q = polygon[(k + 1) % polygon.len()];
        let (a, b) = ((p - point).dot(normal), (q - point).dot(normal));
        if a >= 0.0 {
            kept.push(p);
        }
        if (a < 0.0 && b > 0.0) || (a > 0.0 && b < 0.0) {
            kept.push(p.lerp(q, a / (a - b)));
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use luxproof_scene::geometry::configuration_factor::element_to_polygon;

    fn seen(from: DVec3, normal: DVec3, polygon: &[DVec3], occluders: &[Occluder]) -> f64 {
        let hiding = candidates(from, polygon, occluders);
        visible_pieces(from, polygon, &hiding).iter().map(|piece| element_to_polygon(from, normal, piece)).sum()
    }

    const CEILING: [DVec3; 4] = [
        DVec3::new(-2.0, -2.0, 3.0),
        DVec3::new(2.0, -2.0, 3.0),
        DVec3::new(2.0, 2.0, 3.0),
        DVec3::new(-2.0, 2.0, 3.0),
    ];

    #[test]
    fn a_plate_hides_exactly_its_own_configuration_factor() {
        let plate = Occluder { min_m: DVec3::new(-0.3, -0.1, 1.0), max_m: DVec3::new(0.2, 0.4, 1.0) };
        let whole = element_to_polygon(DVec3::ZERO, DVec3::Z, &CEILING);
        let hidden = element_to_polygon(DVec3::ZERO, DVec3::Z, &plate.face(2, false));
        assert_relative_eq!(seen(DVec3::ZERO, DVec3::Z, &CEILING, &[plate]), whole - hidden, max_relative = 1e-13);
    }

    #[test]
    fn boxes_hide_what_a_dense_count_of_rays_says() {
        let boxes = [
            Occluder { min_m: DVec3::new(-0.5, 0.2, 1.0), max_m: DVec3::new(0.4, 0.9, 2.5) },
            Occluder { min_m: DVec3::new(0.1, -1.5, 0.0), max_m: DVec3::new(0.7, 0.6, 3.5) },
        ];
        let from = DVec3::new(-0.4, 0.1, 0.2);
        let (n, mut open) = (400, 0.0);
        for i in 0..n {
            for j in 0..n {
                let at = |k: i32| -2.0 + 4.0 * (f64::from(k) + 0.5) / f64::from(n);
                let p = DVec3::new(at(i), at(j), 3.0);
                let d = p - from;
                if boxes.iter().all(|b| !b.blocks(from, p)) {
                    open += d.z * d.z / (d.length_squared().powi(2) * std::f64::consts::PI);
                }
            }
        }
        open *= (4.0 / f64::from(n)).powi(2);
        assert_relative_eq!(seen(from, DVec3::Z, &CEILING, &boxes), open, max_relative = 2e-3);
    }

    #[test]
    fn what_lies_behind_beside_or_flush_hides_nothing() {
        let whole = element_to_polygon(DVec3::ZERO, DVec3::Z, &CEILING);
        let corners = [[-1.0, -1.0, 3.0], [-1.0, -1.0, -2.0], [5.0, 5.0, 0.0], [-1.0, -1.0, 3.0]];
        let extents = [[1.0, 1.0, 4.0], [1.0, 1.0, 0.0], [6.0, 6.0, 3.0], [1.0, 1.0, 3.0]];
        for (min, max) in corners.into_iter().zip(extents) {
            let occluder = Occluder { min_m: DVec3::from(min), max_m: DVec3::from(max) };
            assert_relative_eq!(seen(DVec3::ZERO, DVec3::Z, &CEILING, &[occluder]), whole, max_relative = 1e-14);
        }
    }

    /// A polygon that was cut at a corner has an edge without length, which parts nothing from anything.
    #[test]
    fn an_edge_without_length_hides_as_much_as_none() {
        let plate = Occluder { min_m: DVec3::new(-0.3, -0.1, 1.0), max_m: DVec3::new(0.2, 0.4, 1.3) };
        let whole = seen(DVec3::ZERO, DVec3::Z, &CEILING, &[plate]);
        for (k, corner) in CEILING.iter().enumerate() {
            for off_m in [0.0, 1e-16, -3e-16] {
                let mut twice = CEILING.to_vec();
                twice.insert(k + 1, *corner + DVec3::new(off_m, -off_m, 0.0));
                assert_relative_eq!(seen(DVec3::ZERO, DVec3::Z, &twice, &[plate]), whole, max_relative = 1e-13);
            }
        }
    }
}
