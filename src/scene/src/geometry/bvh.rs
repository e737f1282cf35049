//! Ray casting against triangles: an `f32` tree proposes candidates, an `f64` watertight test decides.
//!
//! `obvhs` builds the tree: D. Meister, J. Bittner, "Parallel locally-ordered clustering for bounding volume hierarchy
//! construction", TVCG 24(3), 2018, and "Parallel reinsertion for bounding volume hierarchy optimization", CGF 37(2), 2018. We
//! walk it four boxes at a time, since what `obvhs` walks is slower (`benchmarks/bvh.md`): H. Dammertz, J. Hanika, A. Keller,
//! "Shallow bounding volume hierarchies for fast SIMD ray tracing of incoherent rays", CGF 27(4), 2008. Hit: S. Woop,
//! C. Benthin, I. Wald, "Watertight ray/triangle intersection", JCGT 2(1), 2013. This is the only file that knows `obvhs` and `f32`.
//!
//! The tree may propose too much but never too little: it lives in a frame where the scene spans
//! `FRAME_EXTENT` units, every box is padded by `PADDING` units, which exceeds the sum of all `f32` roundings of origin,
//! direction, box and slab test (about 8e-3 units), rays from far outside enter the tree at its bounds, and no `f32`
//! distance ever rejects a hit.

// A ray takes some 100 ns: a call in its innermost loops is a tenth of that.
#![allow(clippy::inline_always)]

use glam::{DVec3, Vec3A, Vec4};
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::leaf_collapser::collapse;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::fast_stack;
use obvhs::faststack::FastStack;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};

/// Extent of the scene in the tree's own frame.
const FRAME_EXTENT: f64 = 1e4;
/// How far each box is grown in the tree's own frame.
const PADDING: f64 = 2e-2;
/// Children of a node: what a register of the least x86-64 holds.
const WIDTH: usize = 4;
/// Triangles of a leaf at most.
const LEAF_SIZE: u32 = 4;
/// What a node's test costs, in tests of a triangle.
const NODE_COST: f32 = 2.0;
/// Of all nodes these are looked at for a better place in the tree; ten times as many win nothing.
const REINSERTED: f32 = 0.05;
/// Marks a child that is a leaf; its count and its first triangle follow.
const LEAF: u32 = 1 << 31;
/// Where in a leaf its count stands.
const COUNT_BIT: u32 = 26;
/// More triangles than this would need more than about 16 GiB to build, and their number would not fit a leaf.
const MAX_TRIANGLES: usize = 1 << COUNT_BIT;

/// Triangles that rays can be cast against.
pub struct TriangleBvh {
    tree: Tree,
    /// In the order of the tree's leaves.
    triangles: Vec<[[f64; 3]; 3]>,
    normals: Vec<DVec3>,
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
        let (tree, order) = build(&corners.iter().map(|c| frame.padded_box(*c)).collect::<Vec<_>>());
        let triangles: Vec<_> = order.iter().map(|&k| corners[k as usize].map(|v| v.to_array())).collect();
        let normals = order.iter().map(|&k| normal(corners[k as usize])).collect();
        let indices = order.iter().map(|&k| kept[k as usize]).collect();
        Ok(Self { tree, triangles, normals, indices, frame })
    }

    /// The nearest hit at a distance in `0..t_max`.
    pub fn closest(&self, ray: &Ray, t_max: f64) -> Option<Hit> {
        let (narrow, entry) = self.frame.narrow(ray, t_max)?;
        let shear = Shear::along(ray);
        let mut best = (t_max, u32::MAX, usize::MAX);
        self.tree.walk(&narrow, |slot| {
            let t = shear.distance(&self.triangles[slot])?;
            (t < best.0 || (t == best.0 && self.indices[slot] < best.1 && best.2 != usize::MAX)).then(|| {
                best = (t, self.indices[slot], slot);
                entry.widen(t)
            })
        });
        let (distance, triangle, slot) = best;
        (slot != usize::MAX).then(|| Hit { distance, triangle, normal: self.normals[slot] })
    }

    /// Whether anything lies at a distance in `0..t_max`.
    pub fn occluded(&self, ray: &Ray, t_max: f64) -> bool {
        let Some((narrow, _)) = self.frame.narrow(ray, t_max) else { return false };
        let shear = Shear::along(ray);
        let mut found = false;
        self.tree.walk(&narrow, |slot| {
            found = shear.distance(&self.triangles[slot]).is_some_and(|t| t < t_max);
            found.then_some(f32::NEG_INFINITY)
        });
        found
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

    /// The ray in single precision, from near the scene's bounds or within; `None` where it passes them by.
    fn narrow(&self, ray: &Ray, t_max: f64) -> Option<(Narrow, Entry)> {
        let origin = (ray.origin_m - self.centre_m) * self.scale;
        let steepest = ray.direction.abs().max_element();
        let (direction, units_per_t) = (ray.direction / steepest, steepest * self.scale);
        let (mut near, mut far) = (0.0_f64, t_max * units_per_t);
        if origin.abs().cmpgt(self.half + FRAME_EXTENT).any() {
            // A zero component divides to an infinity, or to a NaN on the very bound, which `min` and `max` pass over.
            let (low, high) = ((-self.half - origin) / direction, (self.half - origin) / direction);
            for (a, b) in [(low.x, high.x), (low.y, high.y), (low.z, high.z)] {
                near = near.max(a.min(b));
                far = far.min(a.max(b));
            }
            if near > far + PADDING {
                return None;
            }
        }
        let entry = Entry { t: near / units_per_t, units_per_t };
        let reach = entry.widen(far / units_per_t);
        let origin = single(origin + near * direction).to_array();
        // Finite, so that no product with zero is NaN: a ray that is steeper stays beside a plane all along.
        let inverse = single(direction).recip().clamp(Vec3A::splat(-1e30), Vec3A::splat(1e30)).to_array();
        let [x, y, z] = [0, 1, 2].map(|k| Along {
            origin: Vec4::splat(origin[k]),
            inverse: Vec4::splat(inverse[k]),
            backward: usize::from(inverse[k] < 0.0),
        });
        Some((Narrow { along: [x, y, z], reach }, entry))
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
    #[inline(always)]
    fn distance(&self, triangle: &[[f64; 3]; 3]) -> Option<f64> {
        // One by one: `map` is a call that costs as much as the test.
        let (a, b, c) = (self.sheared(&triangle[0]), self.sheared(&triangle[1]), self.sheared(&triangle[2]));
        let u = c.0 * b.1 - c.1 * b.0;
        let v = a.0 * c.1 - a.1 * c.0;
        let w = b.0 * a.1 - b.1 * a.0;
        let (least, most) = (lesser(lesser(u, v), w), -lesser(lesser(-u, -v), -w));
        if least < 0.0 && most > 0.0 {
            return None;
        }
        let determinant = u + v + w;
        let t = (u * a.2 + v * b.2 + w * c.2) / determinant;
        // Edge-on triangles give 0 / 0, which is not >= 0.
        (t >= 0.0).then_some(t)
    }

    /// A corner in the frame that has the ray as its third axis.
    #[inline(always)]
    fn sheared(&self, v: &[f64; 3]) -> (f64, f64, f64) {
        let [x, y, z] = self.axes;
        let z_to = v[z] - self.origin[z];
        (v[x] - self.origin[x] - self.by[0] * z_to, v[y] - self.origin[y] - self.by[1] * z_to, self.by[2] * z_to)
    }
}

/// One instruction, other than `f64::min`, which has a NaN give way.
fn lesser(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

fn normal([a, b, c]: [DVec3; 3]) -> DVec3 {
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
    let mut keyed: Vec<(u64, u32)> = kept.iter().map(|&k| (hash(&sorted_bits(corners(k))), k)).collect();
    keyed.sort_unstable();
    keyed.dedup_by(|(later_hash, later), (hash, earlier)| {
        later_hash == hash && sorted_bits(corners(*later)) == sorted_bits(corners(*earlier))
    });
    keyed.sort_unstable_by_key(|(_, k)| *k);
    kept.clear();
    kept.extend(keyed.into_iter().map(|(_, k)| k));
}

/// The same for triangles of the same corners; adding 0 makes both zeros one.
fn sorted_bits(corners: [DVec3; 3]) -> [[u64; 3]; 3] {
    let mut bits = corners.map(|v| (v + 0.0).to_array().map(f64::to_bits));
    bits.sort_unstable();
    bits
}

fn hash(bits: &[[u64; 3]; 3]) -> u64 {
    bits.iter().flatten().fold(0, |h, b| (h.rotate_left(5) ^ b).wrapping_mul(0x9e37_79b9_7f4a_7c15))
}

fn build(boxes: &[Aabb]) -> (Tree, Vec<u32>) {
    if boxes.is_empty() {
        return (Tree { nodes: vec![], stack: 0 }, vec![]);
    }
    let indices = (0..boxes.len() as u32).collect();
    let (distance, precision) = (PlocSearchDistance::Medium, SortPrecision::U64);
    let mut binary = PlocBuilder::with_capacity(boxes.len()).build(distance, boxes, indices, precision, 3);
    ReinsertionOptimizer::default().run(&mut binary, REINSERTED, None);
    collapse(&mut binary, LEAF_SIZE, NODE_COST);
    Tree::of(&binary)
}

/// A ray in the tree's frame, its direction 1 where it is steepest.
struct Narrow {
    along: [Along; 3],
    reach: f32,
}

/// A ray along an axis.
struct Along {
    origin: Vec4,
    inverse: Vec4,
    /// 1 where it meets the upper planes first.
    backward: usize,
}

struct Tree {
    nodes: Vec<Node>,
    /// How much may lie on a walk's stack.
    stack: usize,
}

/// The boxes of `WIDTH` children, in two lines of the cache.
#[repr(align(64))]
struct Node {
    /// Lower and upper planes along each axis; of no child an empty box.
    planes: [[Vec4; 3]; 2],
    /// Indices of nodes, or leaves.
    children: [u32; WIDTH],
}

impl Tree {
    /// Opens the largest child of each node until it has `WIDTH`.
    ///
    /// Triangles go where their nodes do, so that what a ray meets one after the other lies close together.
    fn of(binary: &Bvh2) -> (Self, Vec<u32>) {
        let mut order = vec![];
        let mut nodes: Vec<Node> = vec![];
        let mut deepest = 0;
        // What is to become a node, the child that it is, and how deep it lies.
        let mut open = vec![(0, None, 1)];
        while let Some((root, child_of, depth)) = open.pop() {
            deepest = deepest.max(depth);
            let index = nodes.len();
            if let Some((parent, lane)) = child_of {
                let parent: &mut Node = &mut nodes[parent];
                parent.children[lane] = index as u32;
            }
            let mut children = vec![root];
            while children.len() < WIDTH {
                let area = |k: &usize| binary.nodes[children[*k] as usize].aabb().half_area();
                let inner = (0..children.len()).filter(|k| !binary.nodes[children[*k] as usize].is_leaf());
                let Some(largest) = inner.max_by(|a, b| area(a).total_cmp(&area(b))) else { break };
                let first = binary.nodes[children[largest] as usize].first_index;
                children[largest] = first;
                children.push(first + 1);
            }
            let mut node = Node { planes: [[Vec4::INFINITY; 3], [Vec4::NEG_INFINITY; 3]], children: [0; WIDTH] };
            for (lane, child) in children.into_iter().enumerate() {
                let it = &binary.nodes[child as usize];
                for axis in 0..3 {
                    node.planes[0][axis][lane] = it.aabb().min[axis];
                    node.planes[1][axis][lane] = it.aabb().max[axis];
                }
                if it.is_leaf() {
                    node.children[lane] = LEAF | it.prim_count << COUNT_BIT | order.len() as u32;
                    let first = it.first_index as usize;
                    order.extend_from_slice(&binary.primitive_indices[first..first + it.prim_count as usize]);
                } else {
                    open.push((child, Some((index, lane)), depth + 1));
                }
            }
            nodes.push(node);
        }
        (Self { nodes, stack: (WIDTH - 1) * deepest }, order)
    }

    /// Asks `meets` of every triangle that the ray may meet, near ones first; it answers with how far hits are of interest from then on.
    #[inline(always)]
    fn walk(&self, ray: &Narrow, meets: impl FnMut(usize) -> Option<f32>) {
        // Trees of 32 levels need no allocation; deeper ones are of piles of triangles.
        fast_stack!(u64, (96), self.stack.max(1), stack, { self.walk_with(&mut stack, ray, meets) });
    }

    #[inline(always)]
    fn walk_with(&self, stack: &mut impl FastStack<u64>, ray: &Narrow, mut meets: impl FnMut(usize) -> Option<f32>) {
        let mut reach = ray.reach;
        let mut next = 0;
        if self.nodes.is_empty() {
            return;
        }
        loop {
            if next & LEAF == 0 {
                let node = &self.nodes[next as usize];
                if let Some(nearest) = node.children_before(reach, ray, stack) {
                    next = nearest;
                    continue;
                }
            } else {
                let first = (next & ((1 << COUNT_BIT) - 1)) as usize;
                for slot in first..first + (next >> COUNT_BIT & 31) as usize {
                    if let Some(nearer) = meets(slot) {
                        reach = nearer;
                        if reach < 0.0 {
                            return;
                        }
                    }
                }
            }
            // What lies beyond a hit that was found since is passed over.
            next = loop {
                match stack.pop() {
                    None => return,
                    Some(child) if f32::from_bits((child >> 32) as u32) <= reach => break child as u32,
                    Some(_) => {}
                }
            };
        }
    }
}

impl Node {
    /// The nearest child that the ray may meet; the others go onto the stack, the farthest first.
    #[inline(always)]
    fn children_before(&self, reach: f32, ray: &Narrow, stack: &mut impl FastStack<u64>) -> Option<u32> {
        let mut near = Vec4::ZERO;
        let mut far = Vec4::splat(reach);
        for (axis, along) in ray.along.iter().enumerate() {
            near = near.max((self.planes[along.backward & 1][axis] - along.origin) * along.inverse);
            far = far.min((self.planes[1 - (along.backward & 1)][axis] - along.origin) * along.inverse);
        }
        let mut met = near.cmple(far).bitmask();
        let near = near.to_array();
        let mut nearest = self.next_child(&mut met, &near)?;
        if let Some(mut second) = self.next_child(&mut met, &near) {
            (nearest, second) = (nearest.min(second), nearest.max(second));
            if let Some(mut third) = self.next_child(&mut met, &near) {
                (second, third) = (second.min(third), second.max(third));
                (nearest, second) = (nearest.min(second), nearest.max(second));
                if let Some(mut fourth) = self.next_child(&mut met, &near) {
                    (third, fourth) = (third.min(fourth), third.max(fourth));
                    (second, third) = (second.min(third), second.max(third));
                    (nearest, second) = (nearest.min(second), nearest.max(second));
                    stack.push(fourth);
                }
                stack.push(third);
            }
            stack.push(second);
        }
        Some(nearest as u32)
    }

    /// The child of the lowest lane in `met`, under the bits of its distance; takes the lane out of `met`.
    ///
    /// Distances are not negative, so that their bits sort as they do.
    #[inline(always)]
    fn next_child(&self, met: &mut u32, near: &[f32; WIDTH]) -> Option<u64> {
        if *met == 0 {
            return None;
        }
        let lane = met.trailing_zeros() as usize % WIDTH;
        *met &= *met - 1;
        Some(u64::from(near[lane].to_bits()) << 32 | u64::from(self.children[lane]))
    }
}

#[cfg(test)]
#[path = "bvh_tests.rs"]
mod tests;
