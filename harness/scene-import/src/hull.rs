//! The surface that is seen from outside: from the first triangle that a ray meets over each edge to the next through
//! what lies outside.

use std::cmp::Ordering;
use std::f64::consts::TAU;

use glam::DVec3;

use super::half_edges::{Net, Sets, Side};

/// Triangles that are turned about their edge by less than this, in radians, lie in one another.
const TOGETHER: f64 = 1e-4;

/// Each triangle at an edge is held against each.
const MAX_FAN: usize = 100;

/// Rays that pass an edge or a corner by less than this, of a triangle's own, are not taken.
const BESIDE: f64 = 1e-6;

/// What was walked over.
#[derive(Debug)]
pub(super) struct Walk {
    /// Pieces, and whether the outside is at the side that the scene has for their back.
    pub(super) shell: Vec<(u32, bool)>,
    /// Sides beyond which there is no other piece, one an edge.
    pub(super) open: Vec<Side>,
    /// A piece that has the outside at both sides.
    pub(super) single: Option<u32>,
}

/// A net with pieces left out.
#[derive(Debug)]
pub(super) struct Hull<'a> {
    net: &'a Net,
    is_in: Vec<bool>,
    /// In square metres, of all that is joined over edges of two triangles.
    patch_m2: Vec<f64>,
}

impl<'a> Hull<'a> {
    pub(super) fn whole(net: &'a Net) -> Self {
        Self::of(net, vec![true; net.pieces.len()])
    }

    /// Less all pieces with an open edge, and those that have one then, and so on: no closed surface has them.
    pub(super) fn peeled(net: &'a Net) -> Self {
        let mut is_in = vec![true; net.pieces.len()];
        let mut counts: Vec<usize> = net.edges.all().map(<[Side]>::len).collect();
        let mut left: Vec<usize> = (0..counts.len()).filter(|edge| counts[*edge] == 1).collect();
        while let Some(edge) = left.pop() {
            let Some(piece) = net.edges.sides(edge).iter().map(|side| side.piece()).find(|piece| is_in[*piece]) else {
                continue;
            };
            is_in[piece] = false;
            for edge in [0, 1, 2].map(|k| net.edges.edge_of(Side::new(piece, k))) {
                counts[edge] -= 1;
                if counts[edge] == 1 {
                    left.push(edge);
                }
            }
        }
        Self::of(net, is_in)
    }

    fn of(net: &'a Net, is_in: Vec<bool>) -> Self {
        let mut sets = Sets::new(is_in.len());
        for sides in net.edges.all() {
            let mut here = sides.iter().map(|side| side.piece()).filter(|piece| is_in[*piece]);
            if let (Some(a), Some(b), None) = (here.next(), here.next(), here.next()) {
                sets.join(a, b);
            }
        }
        let mut sums = vec![0.0; is_in.len()];
        for piece in (0..is_in.len()).filter(|piece| is_in[*piece]) {
            sums[sets.of(piece)] += 0.5 * net.normal(piece as u32).length();
        }
        let patch_m2 = (0..is_in.len()).map(|piece| sums[sets.of(piece)]).collect();
        Self { net, is_in, patch_m2 }
    }

    fn pieces(&self) -> impl Iterator<Item = u32> + '_ {
        (0..self.is_in.len() as u32).filter(|piece| self.is_in[*piece as usize])
    }

    /// All that is seen from outside and joined to what is seen first; `None` where nothing is.
    pub(super) fn walk(&self) -> Result<Option<Walk>, String> {
        let Some(first) = self.first() else { return Ok(None) };
        let mut seen = vec![[false; 2]; self.is_in.len()];
        let mut walk = Walk { shell: vec![], open: vec![], single: None };
        let mut left = vec![first];
        while let Some((piece, turned)) = left.pop() {
            let here = &mut seen[piece as usize];
            if here[usize::from(turned)] {
                continue;
            }
            here[usize::from(turned)] = true;
            if here[usize::from(!turned)] {
                walk.single = walk.single.or(Some(piece));
                continue;
            }
            walk.shell.push((piece, turned));
            for k in 0..3 {
                let side = Side::new(piece as usize, k);
                match self.next(side, turned)? {
                    Some(next) => left.push(next),
                    None => walk.open.push(side),
                }
            }
        }
        walk.shell.sort_unstable();
        walk.open.sort_unstable();
        Ok(Some(walk))
    }

    /// What is met first on the way about an edge through the outside.
    fn next(&self, side: Side, turned: bool) -> Result<Option<(u32, bool)>, String> {
        let sides = self.net.edges.sides_of_edge(side);
        if sides.len() > MAX_FAN {
            let [a, b] = self.net.ends(side);
            return Err(format!("more than {MAX_FAN} triangles meet in the edge from {a} to {b} m"));
        }
        let (out, into) = self.frame(side);
        let out = if turned { -out } else { out };
        // It runs the other way along the edge, seen from outside.
        let own = self.runs_up(side) != turned;
        let others = sides.iter().filter(|other| **other != side && self.is_in[other.piece()]);
        let met = others.map(|other| {
            let (_, way) = self.frame(*other);
            let angle = way.dot(out).atan2(way.dot(into)).rem_euclid(TAU);
            let angle = if angle < TOGETHER { angle + TAU } else { angle };
            (angle, other.piece() as u32, self.runs_up(*other) == own)
        });
        let met: Vec<(f64, u32, bool)> = met.collect();
        let least = met.iter().map(|(angle, ..)| *angle).fold(f64::INFINITY, f64::min);
        let together =
            met.iter().filter(|(angle, ..)| *angle <= least + TOGETHER).map(|(_, piece, turned)| (*piece, *turned));
        Ok(together.min_by(|a, b| self.rather(*a, *b)))
    }

    /// Whether a side runs from the lower corner to the higher.
    fn runs_up(&self, side: Side) -> bool {
        let [a, b] = self.net.pieces[side.piece()].ends(side.k());
        a < b
    }

    /// Of triangles in one place those of more area come first, and then those that look inwards.
    fn rather(&self, a: (u32, bool), b: (u32, bool)) -> Ordering {
        let [one, other] = [a.0, b.0].map(|piece| self.patch_m2[piece as usize]);
        let by_area =
            if (one - other).abs() <= 1e-9 * one.max(other) { Ordering::Equal } else { other.total_cmp(&one) };
        by_area.then(b.1.cmp(&a.1)).then(a.0.cmp(&b.0))
    }

    /// Unit vectors: a piece's normal, and from its side into it.
    fn frame(&self, side: Side) -> (DVec3, DVec3) {
        let normal = self.net.normal(side.piece() as u32).normalize_or_zero();
        let [a, b] = self.net.ends(side);
        (normal, normal.cross(b - a).normalize_or_zero())
    }

    /// The first piece on the way to one that reaches farthest out, and whether it is seen from the back.
    fn first(&self) -> Option<(u32, bool)> {
        let corners = self.pieces().flat_map(|piece| self.net.corners(piece));
        let (low, high) =
            corners.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
        let outermost = self
            .pieces()
            .filter(|piece| self.net.corners(*piece).iter().any(|p| p.cmpeq(low).any() || p.cmpeq(high).any()));
        let with_area = outermost.map(|piece| (self.net.normal(piece).length_squared(), piece));
        let (_, target) = with_area.max_by(|a, b| a.0.total_cmp(&b.0))?;
        let at = self.net.corners(target).iter().sum::<DVec3>() / 3.0;
        let normal = self.net.normal(target).normalize_or_zero();
        let normal = if normal.dot(at - 0.5 * (low + high)) < 0.0 { -normal } else { normal };
        // Off the normal, since what is built of right angles has edges there.
        let tilts = (1..9).map(|k| 0.07 * f64::from(k) * DVec3::new(0.36, 0.48, 0.8));
        let mut ways = tilts.map(|tilt| (normal + tilt).normalize());
        ways.find_map(|away| self.met(at + 4.0 * (high - low).length() * away, -away))
    }

    /// What a ray meets first, and whether from its back; `None` where it meets nothing, or passes beside an edge.
    fn met(&self, from: DVec3, way: DVec3) -> Option<(u32, bool)> {
        let mut met: Vec<(f64, f64, (u32, bool))> = vec![];
        let mut nearest = f64::INFINITY;
        for piece in self.pieces() {
            let [a, b, c] = self.net.corners(piece);
            let normal = (b - a).cross(c - a);
            let facing = normal.dot(way);
            let at = (a - from).dot(normal) / facing;
            if !at.is_finite() || at > nearest + self.net.near_m {
                continue;
            }
            let p = from + at * way;
            // The least barycentric coordinate: negative outside the triangle.
            let parts =
                [[a, b], [b, c], [c, a]].map(|[u, v]| (v - u).cross(p - u).dot(normal) / normal.length_squared());
            let inside = parts[0].min(parts[1]).min(parts[2]);
            if inside > -BESIDE {
                nearest = nearest.min(at);
                met.push((at, inside, (piece, facing > 0.0)));
            }
        }
        met.retain(|(at, ..)| *at <= nearest + self.net.near_m);
        if met.iter().any(|(_, inside, _)| *inside < BESIDE) {
            return None;
        }
        met.into_iter().map(|(.., piece)| piece).min_by(|a, b| self.rather(*a, *b))
    }
}
