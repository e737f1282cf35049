//! Ray casting against triangles: an `f32` tree proposes candidates, an `f64` watertight test decides.
//!
//! Tree: compressed wide bounding volume hierarchy, H. Ylitie, T. Karras, S. Laine, "Efficient incoherent ray
//! traversal on GPUs through compressed wide BVHs", HPG 2017. Hit: S. Woop, C. Benthin, I. Wald, "Watertight
//! ray/triangle intersection", JCGT 2(1), 2013. This is the only file that knows `obvhs` and `f32`.
//!
//! The tree may propose too much but never too little: it lives in a frame where the scene spans
//! `FRAME_EXTENT` units (its node test holds an absolute 1e-4), every box is padded by `PADDING` units, which
//! exceeds the sum of all `f32` roundings of origin, direction, box and slab test (about 4e-3 units), rays enter the
//! tree at its bounds instead of far outside, and no `f32` distance ever rejects a hit.

use glam::{DVec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::bvh2_to_cwbvh::bvh2_to_cwbvh;
use obvhs::ploc::PlocBuilder;
use obvhs::ray::RayHit;

/// Extent of the scene in the tree's own frame.
const FRAME_EXTENT: f64 = 1e4;
/// How far each box is grown in the tree's own frame.
const PADDING: f64 = 2e-2;
/// Levels that the traversal's fixed stack of 32 holds; beyond, it loses nodes in silence.
const MAX_DEPTH: usize = 31;
/// Levels of the binary tree beyond which turning it into a wide one, which recurses, could exhaust the stack.
const MAX_BINARY_DEPTH: usize = 1000;
/// Primitives a leaf, the most that the wide node can hold.
const LEAF_SIZE: u32 = 3;
/// More triangles than this would need more than about 16 GiB to build.
const MAX_TRIANGLES: usize = 1 << 26;

/// Triangles that rays can be cast against.
pub struct TriangleBvh {
    tree: CwBvh,
    /// In the order of the tree's leaves.
    triangles: Vec<[[f64; 3]; 3]>,
    /// Index of each of them in the input.
    indices: Vec<u32>,
    frame: Frame,
}

/// A half-line.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// Where it starts, in metres.
    pub origin_m: DVec3,
    /// Where it goes; distances come out in metres when this is a unit vector.
    pub direction: DVec3,
}

/// Where a ray meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance along the ray, in lengths of its direction.
    pub distance: f64,
    /// Index of the triangle in the input; the lowest where several lie at the same distance.
    pub triangle: u32,
    /// Unit normal of the triangle, on the side from which its vertices turn counter-clockwise.
    pub normal: DVec3,
}

/// Why no tree could be built.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BvhError {
    /// A coordinate that is no number.
    #[error("vertex {vertex} of the mesh is not finite; repair the mesh")]
    NotFinite {
        /// Index of the vertex.
        vertex: usize,
    },
    /// A triangle that refers to a vertex that is not there.
    #[error("triangle {triangle} refers to vertex {vertex}, but there are only {vertices}; repair the mesh")]
    NoSuchVertex {
        /// Index of the triangle.
        triangle: usize,
        /// The vertex it wants.
        vertex: u32,
        /// How many there are.
        vertices: usize,
    },
    /// More than memory can be expected to hold.
    #[error("{triangles} triangles are more than {limit}; simplify the mesh")]
    TooManyTriangles {
        /// How many there are.
        triangles: usize,
        /// How many there may be.
        limit: usize,
    },
    /// Triangles piled so that no tree of bounded depth holds them.
    #[error("the triangles pile up so that the search tree is {depth} levels deep, {limit} at most; remove duplicates")]
    TooDeep {
        /// Depth reached.
        depth: usize,
        /// Depth allowed.
        limit: usize,
    },
}

impl TriangleBvh {
    /// Builds the tree.
    ///
    /// Triangles that no ray can find are left out: those without area and those that lie exactly upon an earlier one.
    pub fn new(vertices_m: &[DVec3], triangles: &[[u32; 3]]) -> Result<Self, BvhError> {
        check(vertices_m, triangles)?;
        let corners = |k: u32| triangles[k as usize].map(|v| vertices_m[v as usize]);
        let mut kept: Vec<u32> = (0..triangles.len() as u32).filter(|k| has_area(corners(*k))).collect();
        distinct(&mut kept, corners);
        let corners: Vec<_> = kept.iter().map(|k| corners(*k)).collect();
        let frame = Frame::around(corners.as_flattened());
        let mut tree = build(corners.iter().map(|c| frame.padded_box(*c)).collect())?;
        let order = std::mem::take(&mut tree.primitive_indices);
        let triangles = order.iter().map(|&k| corners[k as usize].map(|v| v.to_array())).collect();
        let indices = order.iter().map(|&k| kept[k as usize]).collect();
        Ok(Self { tree, triangles, indices, frame })
    }

    /// The nearest hit at a distance in `0..t_max`.
    pub fn closest(&self, ray: &Ray, t_max: f64) -> Option<Hit> {
        let (narrow, entry) = self.frame.narrow(ray, t_max)?;
        let shear = Shear::along(ray);
        let mut best = (t_max, u32::MAX, usize::MAX);
        self.tree.ray_traverse(narrow, &mut RayHit::none(), |_, slot| match shear.distance(&self.triangles[slot]) {
            Some(t) if t < best.0 || (t == best.0 && self.indices[slot] < best.1 && best.2 != usize::MAX) => {
                best = (t, self.indices[slot], slot);
                entry.widen(t)
            }
            _ => f32::INFINITY,
        });
        let (distance, triangle, slot) = best;
        (slot != usize::MAX).then(|| Hit { distance, triangle, normal: normal(&self.triangles[slot]) })
    }

    /// Whether anything lies at a distance in `0..t_max`.
    pub fn occluded(&self, ray: &Ray, t_max: f64) -> bool {
        let Some((narrow, _)) = self.frame.narrow(ray, t_max) else { return false };
        let shear = Shear::along(ray);
        !self.tree.ray_traverse_miss(narrow, |_, slot| match shear.distance(&self.triangles[slot]) {
            Some(t) if t < t_max => 0.0,
            _ => f32::INFINITY,
        })
    }

    /// How many triangles can be hit.
    pub fn len(&self) -> usize {
        self.triangles.len()
    }

    /// Whether there is nothing to hit.
    pub fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }
}

/// The frame of the tree: centred on the scene and scaled so that it spans `FRAME_EXTENT`.
struct Frame {
    centre_m: DVec3,
    /// Units of the frame to the metre.
    scale: f64,
    /// Half extent of the padded scene, in units of the frame.
    half: DVec3,
}

/// Where a ray enters the tree, to turn its `f64` distances into those of the tree.
struct Entry {
    t: f64,
    units_per_t: f64,
}

impl Frame {
    fn around(points: &[DVec3]) -> Self {
        let low = points.iter().copied().reduce(DVec3::min).unwrap_or_default();
        let high = points.iter().copied().reduce(DVec3::max).unwrap_or_default();
        let extent = (high - low).max_element();
        let scale = if extent > 0.0 { FRAME_EXTENT / extent } else { 1.0 };
        Self { centre_m: 0.5 * low + 0.5 * high, scale, half: 0.5 * scale * (high - low) + 2.0 * PADDING }
    }

    fn padded_box(&self, corners: [DVec3; 3]) -> Aabb {
        let [a, b, c] = corners.map(|v| (v - self.centre_m) * self.scale);
        Aabb { min: single(a.min(b).min(c) - PADDING), max: single(a.max(b).max(c) + PADDING) }
    }

    /// The part of the ray that lies within the scene's bounds, in single precision; `None` where there is none.
    fn narrow(&self, ray: &Ray, t_max: f64) -> Option<(obvhs::ray::Ray, Entry)> {
        let origin = (ray.origin_m - self.centre_m) * self.scale;
        let units_per_t = ray.direction.length() * self.scale;
        let direction = ray.direction / ray.direction.length();
        // A zero component divides to an infinity, or to a NaN on the very bound, which `min` and `max` pass over.
        let (low, high) = ((-self.half - origin) / direction, (self.half - origin) / direction);
        let pairs = [(low.x, high.x), (low.y, high.y), (low.z, high.z)];
        let near = pairs.iter().fold(0.0_f64, |t, (a, b)| t.max(a.min(*b)));
        let far = pairs.iter().fold(t_max * units_per_t, |t, (a, b)| t.min(a.max(*b)));
        if near > far + PADDING {
            return None;
        }
        let entry = Entry { t: near / units_per_t, units_per_t };
        let start = single(origin + near * direction);
        let ray = obvhs::ray::Ray::new(start, single(direction), 0.0, entry.widen(far / units_per_t));
        Some((ray, entry))
    }
}

impl Entry {
    /// A tree distance that surely lies beyond `t`, and beyond the tree's own epsilon.
    fn widen(&self, t: f64) -> f32 {
        (((t - self.t) * self.units_per_t).max(0.0) * (1.0 + 1e-6) + PADDING) as f32
    }
}

/// A ray's shear, which turns it onto the axis where it is steepest.
struct Shear {
    origin: [f64; 3],
    axes: [usize; 3],
    by: [f64; 3],
}

impl Shear {
    fn along(ray: &Ray) -> Self {
        let d = ray.direction.to_array();
        let z = ray.direction.abs().max_position();
        let (mut x, mut y) = ((z + 1) % 3, (z + 2) % 3);
        if d[z] < 0.0 {
            std::mem::swap(&mut x, &mut y);
        }
        Self { origin: ray.origin_m.to_array(), axes: [x, y, z], by: [d[x] / d[z], d[y] / d[z], 1.0 / d[z]] }
    }

    /// The distance at which the ray meets the triangle, on either side, edges and corners included.
    ///
    /// Two triangles that share an edge compute its edge function from the same products, so that no ray slips between.
    fn distance(&self, triangle: &[[f64; 3]; 3]) -> Option<f64> {
        let [x, y, z] = self.axes;
        let [a, b, c] = triangle.map(|v| {
            let z_to = v[z] - self.origin[z];
            [v[x] - self.origin[x] - self.by[0] * z_to, v[y] - self.origin[y] - self.by[1] * z_to, self.by[2] * z_to]
        });
        let u = c[0] * b[1] - c[1] * b[0];
        let v = a[0] * c[1] - a[1] * c[0];
        let w = b[0] * a[1] - b[1] * a[0];
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return None;
        }
        let determinant = u + v + w;
        let t = (u * a[2] + v * b[2] + w * c[2]) / determinant;
        // Edge-on triangles give 0 / 0, which is not >= 0.
        (t >= 0.0).then_some(t)
    }
}

fn normal(triangle: &[[f64; 3]; 3]) -> DVec3 {
    let [a, b, c] = triangle.map(DVec3::from);
    (b - a).cross(c - a).normalize()
}

fn has_area([a, b, c]: [DVec3; 3]) -> bool {
    (b - a).cross(c - a).length_squared() > 0.0
}

fn single(v: DVec3) -> Vec3A {
    v.as_vec3a()
}

fn check(vertices_m: &[DVec3], triangles: &[[u32; 3]]) -> Result<(), BvhError> {
    if triangles.len() > MAX_TRIANGLES {
        return Err(BvhError::TooManyTriangles { triangles: triangles.len(), limit: MAX_TRIANGLES });
    }
    if let Some(vertex) = vertices_m.iter().position(|v| !v.is_finite()) {
        return Err(BvhError::NotFinite { vertex });
    }
    let vertices = vertices_m.len();
    for (triangle, corners) in triangles.iter().enumerate() {
        if let Some(&vertex) = corners.iter().find(|v| **v as usize >= vertices) {
            return Err(BvhError::NoSuchVertex { triangle, vertex, vertices });
        }
    }
    Ok(())
}

/// Drops every triangle that has the same corners, in whatever order, as one before it.
///
/// Coincident boxes have nothing to tell them apart, so that a pile of them makes a tree as deep as the pile.
fn distinct(kept: &mut Vec<u32>, corners: impl Fn(u32) -> [DVec3; 3]) {
    let bits = |v: DVec3| (v + 0.0).to_array().map(f64::to_bits);
    let sorted = |k: u32| {
        let mut corners = corners(k).map(bits);
        corners.sort_unstable();
        corners
    };
    let hash = |k: u32| {
        sorted(k).iter().flatten().fold(0_u64, |h, b| (h.rotate_left(5) ^ b).wrapping_mul(0x9e37_79b9_7f4a_7c15))
    };
    let mut keyed: Vec<(u64, u32)> = kept.iter().map(|&k| (hash(k), k)).collect();
    keyed.sort_unstable();
    keyed.dedup_by(|later, earlier| later.0 == earlier.0 && sorted(later.1) == sorted(earlier.1));
    keyed.sort_unstable_by_key(|(_, k)| *k);
    kept.clear();
    kept.extend(keyed.into_iter().map(|(_, k)| k));
}

/// As `obvhs`'s own builder does, but checking the depth between the steps, since the later ones rely on it.
fn build(boxes: Vec<Aabb>) -> Result<CwBvh, BvhError> {
    if boxes.is_empty() {
        return Ok(CwBvh::default());
    }
    let params = BvhBuildParams::medium_build();
    let (distance, threshold) = (params.ploc_search_distance, params.search_depth_threshold);
    let indices = (0..boxes.len() as u32).collect();
    let mut binary =
        PlocBuilder::with_capacity(boxes.len()).build(distance, &boxes, indices, params.sort_precision, threshold);
    drop(boxes);
    if binary.max_depth > MAX_BINARY_DEPTH {
        return Err(BvhError::TooDeep { depth: binary.max_depth, limit: MAX_BINARY_DEPTH });
    }
    ReinsertionOptimizer::default().run(&mut binary, params.reinsertion_batch_ratio, None);
    let tree = bvh2_to_cwbvh(&binary, LEAF_SIZE, true, false);
    let depth = depth(&tree);
    if depth > MAX_DEPTH {
        return Err(BvhError::TooDeep { depth, limit: MAX_DEPTH });
    }
    Ok(tree)
}

fn depth(tree: &CwBvh) -> usize {
    let mut deepest = 0;
    let mut open: Vec<(usize, usize)> = if tree.nodes.is_empty() { vec![] } else { vec![(0, 1)] };
    while let Some((index, depth)) = open.pop() {
        deepest = deepest.max(depth);
        let node = &tree.nodes[index];
        let first = node.child_base_idx as usize;
        open.extend((0..node.imask.count_ones() as usize).map(|k| (first + k, depth + 1)));
    }
    deepest
}

#[cfg(test)]
#[path = "bvh_tests.rs"]
mod tests;
