//! Triangles joined at their edges: corners that are nearly in one place are one, and where corners lie on an edge that
//! is open, it is cut there.

use std::collections::HashMap;

use glam::{DVec3, I64Vec3};

use super::raw::MAX_TRIANGLES;
use super::triangle_soup::Soup;

/// Corners nearer than this are one, relative to the extent: five decimals of a metre, in a room of 6 m.
const NEAR: f64 = 3e-6;

/// So often a corner is held against an open edge.
const MAX_LOOKS: usize = 30_000_000;

/// A triangle of the soup, or a part of one.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    /// Indices into the net's corners, turned as in the scene.
    pub(super) corners: [u32; 3],
    /// The index of the triangle in the soup.
    pub(super) facet: u32,
}

#[derive(Debug)]
pub(super) struct Net {
    /// In metres, in the scene.
    pub(super) places: Vec<DVec3>,
    /// The corner that each vertex of the soup is.
    pub(super) corner_of: Vec<u32>,
    pub(super) pieces: Vec<Piece>,
    pub(super) edges: Edges,
    /// What is nearer is in one place, in metres.
    pub(super) near_m: f64,
}

impl Net {
    /// Of a soup of some extent, less its triangles that are no higher than what is near; or why there is none.
    pub(super) fn of(soup: &Soup, extent_m: f64) -> Result<Self, String> {
        let near_m = NEAR * extent_m + 2.0 * soup.step_m;
        let (places, corner_of) = joined(&soup.vertices, near_m);
        let mut pieces: Vec<Piece> = vec![];
        for (facet, of) in soup.facets.iter().enumerate() {
            let corners = of.vertices.map(|v| corner_of[v as usize]);
            if height(corners.map(|c| places[c as usize])) > near_m {
                pieces.push(Piece { corners, facet: facet as u32 });
            }
        }
        let edges = Edges::of(&pieces);
        let mut net = Self { places, corner_of, pieces, edges, near_m };
        net.cut()?;
        Ok(net)
    }

    pub(super) fn corners(&self, piece: u32) -> [DVec3; 3] {
        self.pieces[piece as usize].corners.map(|c| self.places[c as usize])
    }

    /// From where to where a side of a piece runs.
    pub(super) fn ends(&self, side: Side) -> [DVec3; 2] {
        self.pieces[side.piece()].ends(side.k()).map(|c| self.places[c as usize])
    }

    /// Twice its area in square metres, along the normal of the side that the scene has for its front.
    pub(super) fn normal(&self, piece: u32) -> DVec3 {
        let [a, b, c] = self.corners(piece);
        (b - a).cross(c - a)
    }

    /// Cuts edges that not exactly two triangles have where corners of such edges lie on them.
    fn cut(&mut self) -> Result<(), String> {
        let odd: Vec<Side> = self.edges.all().filter(|sides| sides.len() != 2).map(|sides| sides[0]).collect();
        let mut corners: Vec<u32> = odd.iter().flat_map(|side| self.pieces[side.piece()].ends(side.k())).collect();
        corners.sort_unstable();
        corners.dedup();
        let sorted = [0, 1, 2].map(|axis| {
            let mut along: Vec<(f64, u32)> = corners.iter().map(|c| (self.places[*c as usize][axis], *c)).collect();
            along.sort_by(|a, b| a.0.total_cmp(&b.0));
            along
        });
        let (mut looks, mut cuts) = (0, 0);
        let mut on: HashMap<Side, Vec<u32>> = HashMap::new();
        for side in &odd {
            let [a, b] = self.ends(*side);
            let (low, high) = (a.min(b) - self.near_m, a.max(b) + self.near_m);
            let ranges = [0, 1, 2].map(|axis| {
                let from = sorted[axis].partition_point(|(at, _)| *at < low[axis]);
                &sorted[axis][from..from + sorted[axis][from..].partition_point(|(at, _)| *at <= high[axis])]
            });
            let fewest = ranges.into_iter().min_by_key(|range| range.len()).unwrap_or_default();
            looks += fewest.len();
            if looks > MAX_LOOKS || cuts > MAX_TRIANGLES {
                let count = odd.len();
                return Err(format!(
                    "{count} edges of triangles have not exactly one other beside them: too many to look at"
                ));
            }
            let near = fewest.iter().map(|(_, c)| *c).filter(|c| {
                let p = self.places[*c as usize];
                p.cmpge(low).all() && p.cmple(high).all()
            });
            let mut met: Vec<(f64, u32)> = near.filter_map(|c| Some((self.along(a, b, c)?, c))).collect();
            if met.is_empty() {
                continue;
            }
            met.sort_by(|a, b| a.0.total_cmp(&b.0));
            for other in self.edges.sides_of_edge(*side) {
                cuts += met.len();
                let turned = self.ends(*other)[0] != a;
                let corners: Vec<u32> = met.iter().map(|(_, c)| *c).collect();
                on.insert(*other, if turned { corners.into_iter().rev().collect() } else { corners });
            }
        }
        if !on.is_empty() {
            let pieces = self.pieces.iter().enumerate().flat_map(|(k, piece)| {
                let corners_on_sides = [0, 1, 2].map(|side| on.remove(&Side::new(k, side)).unwrap_or_default());
                piece.cut(corners_on_sides)
            });
            self.pieces = pieces.collect();
            self.edges = Edges::of(&self.pieces);
        }
        Ok(())
    }

    /// How far along an edge a corner lies, if it lies on it and at neither end.
    fn along(&self, a: DVec3, b: DVec3, corner: u32) -> Option<f64> {
        let p = self.places[corner as usize];
        let length = a.distance(b);
        let along = (p - a).dot(b - a) / length;
        let is_on = along > self.near_m
            && along < length - self.near_m
            && p.distance(a + (b - a) * (along / length)) <= self.near_m;
        is_on.then_some(along)
    }
}

impl Piece {
    pub(super) fn ends(&self, k: usize) -> [u32; 2] {
        [self.corners[k], self.corners[(k + 1) % 3]]
    }

    /// Triangles that have corners on each of its sides for corners, in their order along the side.
    fn cut(self, on: [Vec<u32>; 3]) -> Vec<Self> {
        let mut left = vec![(self.corners, on)];
        let mut done = vec![];
        while let Some((corners, mut on)) = left.pop() {
            let [a, b, c] = corners;
            if a == b || b == c || c == a {
                continue;
            }
            let Some(k) = on.iter().position(|side| !side.is_empty()) else {
                done.push(Self { corners, facet: self.facet });
                continue;
            };
            let (first, second, apex) = (corners[k], corners[(k + 1) % 3], corners[(k + 2) % 3]);
            let at = on[k].remove(0);
            let [along, right, last] = [k, (k + 1) % 3, (k + 2) % 3].map(|k| std::mem::take(&mut on[k]));
            // At the tip of a needle a corner lies on both of its sides.
            let [right, last] = [right, last].map(|side| side.into_iter().filter(|c| *c != at).collect());
            left.push(([first, at, apex], [vec![], vec![], last]));
            left.push(([at, second, apex], [along, right, vec![]]));
        }
        done
    }
}

/// The least height of a triangle.
fn height([a, b, c]: [DVec3; 3]) -> f64 {
    let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
    if longest > 0.0 { (b - a).cross(c - a).length() / longest } else { 0.0 }
}

/// Joins points that are near each other: the places that remain, and the place of each point.
fn joined(points: &[DVec3], near_m: f64) -> (Vec<DVec3>, Vec<u32>) {
    let mut grid = PlaceGrid { near_m, cells: HashMap::new(), places: vec![] };
    let corner_of = points.iter().map(|p| grid.join(*p)).collect();
    (grid.places, corner_of)
}

/// Places no two of which are near, sorted into cells so that near ones are found fast.
struct PlaceGrid {
    near_m: f64,
    cells: HashMap<I64Vec3, Vec<u32>>,
    places: Vec<DVec3>,
}

impl PlaceGrid {
    /// The cell of a point.
    fn cell(&self, p: DVec3) -> I64Vec3 {
        // Cells are much larger than `near_m`, so that most points are near no face of a cell.
        (p / (8.0 * self.near_m)).floor().as_i64vec3()
    }

    /// The place that is near a point, which becomes one if none is.
    fn join(&mut self, p: DVec3) -> u32 {
        let (low, high) = (self.cell(p - self.near_m), self.cell(p + self.near_m));
        for x in low.x..=high.x {
            for y in low.y..=high.y {
                for z in low.z..=high.z {
                    let known = self.cells.get(&I64Vec3::new(x, y, z)).into_iter().flatten();
                    let near = known.copied().find(|k| self.places[*k as usize].distance(p) <= self.near_m);
                    if let Some(corner) = near {
                        return corner;
                    }
                }
            }
        }
        let corner = self.places.len() as u32;
        self.places.push(p);
        self.cells.entry(self.cell(p)).or_default().push(corner);
        corner
    }
}

/// A side of a piece.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(super) struct Side(u32);

impl Side {
    pub(super) fn new(piece: usize, k: usize) -> Self {
        Self((3 * piece + k) as u32)
    }

    pub(super) fn piece(self) -> usize {
        self.0 as usize / 3
    }

    /// From corner `k` to the next.
    pub(super) fn k(self) -> usize {
        self.0 as usize % 3
    }
}

/// Which sides of pieces are one edge.
#[derive(Debug)]
pub(super) struct Edges {
    /// The edge of each side.
    edge_of: Vec<u32>,
    /// Where the sides of each edge begin, and where the last ends.
    starts: Vec<u32>,
    sides: Vec<Side>,
}

impl Edges {
    fn of(pieces: &[Piece]) -> Self {
        let sides = pieces.iter().enumerate().flat_map(|(piece, of)| {
            [0, 1, 2].map(|k| {
                let [a, b] = of.ends(k);
                ([a.min(b), a.max(b)], Side::new(piece, k))
            })
        });
        let mut all: Vec<([u32; 2], Side)> = sides.collect();
        all.sort_unstable();
        let (mut edge_of, mut starts) = (vec![0; all.len()], vec![]);
        for (k, (ends, side)) in all.iter().enumerate() {
            if k == 0 || all[k - 1].0 != *ends {
                starts.push(k as u32);
            }
            edge_of[side.0 as usize] = starts.len() as u32 - 1;
        }
        starts.push(all.len() as u32);
        Self { edge_of, starts, sides: all.into_iter().map(|(_, side)| side).collect() }
    }

    pub(super) fn len(&self) -> usize {
        self.starts.len() - 1
    }

    pub(super) fn edge_of(&self, side: Side) -> usize {
        self.edge_of[side.0 as usize] as usize
    }

    /// All sides of an edge, in the order of pieces.
    pub(super) fn sides(&self, edge: usize) -> &[Side] {
        &self.sides[self.starts[edge] as usize..self.starts[edge + 1] as usize]
    }

    /// All sides of a side's edge, itself among them.
    pub(super) fn sides_of_edge(&self, side: Side) -> &[Side] {
        self.sides(self.edge_of(side))
    }

    pub(super) fn all(&self) -> impl Iterator<Item = &[Side]> {
        (0..self.len()).map(|edge| self.sides(edge))
    }
}

/// Sets of things that are joined one by one.
#[derive(Debug)]
pub(super) struct Sets(Vec<u32>);

impl Sets {
    pub(super) fn new(count: usize) -> Self {
        Self((0..count as u32).collect())
    }

    /// The thing that stands for the set of another.
    pub(super) fn of(&mut self, thing: usize) -> usize {
        let mut at = thing as u32;
        while self.0[at as usize] != at {
            let above = self.0[self.0[at as usize] as usize];
            self.0[at as usize] = above;
            at = above;
        }
        at as usize
    }

    pub(super) fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.of(a), self.of(b));
        self.0[a.max(b)] = a.min(b) as u32;
    }
}
