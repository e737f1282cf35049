//! The first bounce: irradiance from what the point luminaires light directly, integrated over their own directions.
//!
//! Cells of (C, gamma) are split at the table's angles, at the room's edges and, for a meter, at its horizon, all of
//! them exact in the luminaire's own frame, so that the kinks of a piecewise bilinear table cost nothing whatever the
//! luminaire's rotation. An edge or a horizon is a great circle there: `tan gamma = m_z / (m_x cos C + m_y sin C)` for
//! the normal m of its plane.

use std::f64::consts::PI;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};

use glam::DVec3;

use super::Effort;
use super::cells::{Cell, LuminaireFrame};
use super::grid::Face;
use super::kernel::Receiver;
use super::symmetry::reflectance;
use crate::geometry::Room;
use crate::scene::Luminaire;
use crate::simulator::quadrature::Gauss;

/// Cells are not halved below this fraction of the room.
const SMALLEST: f64 = 1e-12;
/// A cell whose halves differ more than this in length is halved: its map is too uneven for a product rule.
const UNEVEN: f64 = 3.0123;
/// Which of two lengths is longer: no 1, because equal ones are frequent and rounding would decide.
const TIE: f64 = 1.000_123;

/// Points that are kept for the next receiver, 32 bytes each; beyond that they are made anew every time.
///
/// A dozen luminaires with fine tables would keep gigabytes otherwise.
const MOST_KEPT: usize = 4_000_000;

/// Everything that the luminaires light, as patches that halve themselves near a receiver.
#[derive(Debug)]
pub(super) struct FirstBounce {
    room: Room,
    sources: Vec<Source>,
    rule: Gauss,
    /// Points kept so far.
    kept: AtomicUsize,
    /// Patches are halved until they lie at least this many half-lengths away.
    reach: f64,
}

#[derive(Debug)]
struct Source {
    frame: LuminaireFrame,
    /// The patches on each face.
    faces: [Vec<Patch>; 6],
}

/// A part of a cell, on its face.
#[derive(Debug)]
struct Patch {
    cell: Cell,
    /// Parameter ranges within the cell.
    s: (f64, f64),
    t: (f64, f64),
    centre_m: DVec3,
    half_m: DVec3,
    half_length_m: f64,
    split: Split,
    halves: OnceLock<Box<[Patch; 2]>>,
    points: OnceLock<Points>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Split {
    AlongS,
    AlongT,
    /// Needed for the map's own sake, at any distance.
    UnevenS,
    UnevenT,
}

/// Points on a face and the flux that each reflects, over π.
#[derive(Debug)]
struct Points {
    x: Vec<f64>,
    y: Vec<f64>,
    z: Vec<f64>,
    flux: Vec<f64>,
}

impl FirstBounce {
    pub(super) fn new(room: &Room, luminaires: &[Luminaire], effort: &Effort) -> Self {
        let sources = luminaires
            .iter()
            .map(|luminaire| {
                let frame = LuminaireFrame::new(luminaire);
                let faces = Face::ALL.map(|face| {
                    if reflectance(room, face) == 0.0 {
                        return vec![];
                    }
                    patches(&frame, room, face, &corners(room, face))
                });
                Source { frame, faces }
            })
            .collect();
        let (rule, kept) = (Gauss::new(effort.source_points), AtomicUsize::new(0));
        Self { room: *room, sources, rule, kept, reach: 1.0123 * effort.source_reach }
    }

    /// Irradiance at a receiver, in lux, of light reflected once.
    pub(super) fn irradiance(&self, receiver: &Receiver) -> f64 {
        let mut sum = 0.0;
        for face in Face::ALL {
            let rho = reflectance(&self.room, face);
            if receiver.face == Some(face) || rho == 0.0 {
                continue;
            }
            let polygon = corners(&self.room, face);
            let lit = above_horizon(receiver, &polygon, self.room.size_m.max_element());
            let mut on_face = 0.0;
            for source in &self.sources {
                on_face += match &lit {
                    Visible::All => self.walk(source, &source.faces[face.0], face, receiver),
                    Visible::Part(lit) => {
                        let patches = patches(&source.frame, &self.room, face, lit);
                        self.walk(source, &patches, face, receiver)
                    }
                    Visible::Nothing => 0.0,
                };
            }
            sum += rho / PI * on_face;
        }
        sum
    }

    /// The flux in lumens that the surfaces reflect at the first bounce; a closed room loses none of it.
    pub(super) fn reflected_flux(&self) -> f64 {
        let mut sum = 0.0;
        for face in Face::ALL {
            let rho = reflectance(&self.room, face);
            for source in &self.sources {
                let mut stack: Vec<&Patch> = source.faces[face.0].iter().collect();
                while let Some(patch) = stack.pop() {
                    if patch.is_uneven() {
                        stack.extend(patch.halves(source, &self.room, face));
                    } else {
                        sum += rho * self.at_points(patch, source, face, |points| points.flux.iter().sum());
                    }
                }
            }
        }
        sum
    }

    fn walk(&self, source: &Source, patches: &[Patch], face: Face, receiver: &Receiver) -> f64 {
        let mut stack: Vec<&Patch> = patches.iter().collect();
        let smallest = SMALLEST * self.room.size_m.max_element();
        let mut sum = 0.0;
        while let Some(patch) = stack.pop() {
            let gap = ((receiver.position_m - patch.centre_m).abs() - patch.half_m).max(DVec3::ZERO);
            let reach = self.reach * patch.half_length_m;
            if (patch.is_uneven() || reach * reach > gap.length_squared()) && patch.half_length_m > smallest {
                stack.extend(patch.halves(source, &self.room, face));
            } else {
                sum += self.at_points(patch, source, face, |points| points.irradiance(receiver, face));
            }
        }
        sum
    }

    /// Evaluates something at a patch's points, which are kept as long as there is room: the result is the same.
    fn at_points(&self, patch: &Patch, source: &Source, face: Face, f: impl Fn(&Points) -> f64) -> f64 {
        if let Some(points) = patch.points.get() {
            return f(points);
        }
        let points = patch.sample(&source.frame, &self.room, face, &self.rule);
        let value = f(&points);
        if self.kept.fetch_add(points.flux.len(), Ordering::Relaxed) < MOST_KEPT {
            patch.points.set(points).ok();
        }
        value
    }
}

impl Patch {
    fn new(cell: Cell, s: (f64, f64), t: (f64, f64), frame: &LuminaireFrame, room: &Room, face: Face) -> Self {
        let at = |i: usize, j: usize| {
            let (fi, fj) = (0.5 * i as f64, 0.5 * j as f64);
            let direction = frame.direction(&cell, s.0 + fi * (s.1 - s.0), t.0 + fj * (t.1 - t.0)).0;
            hit(frame.position_m, direction, room, face)
        };
        let p: [[DVec3; 3]; 3] = [0, 1, 2].map(|i| [0, 1, 2].map(|j| at(i, j)));
        let all = || p.iter().flatten();
        let low = all().fold(DVec3::INFINITY, |m, q| m.min(*q));
        let high = all().fold(DVec3::NEG_INFINITY, |m, q| m.max(*q));
        let along_s = [0, 1, 2].map(|j| (p[0][j].distance(p[1][j]), p[1][j].distance(p[2][j])));
        let along_t = [0, 1, 2].map(|i| (p[i][0].distance(p[i][1]), p[i][1].distance(p[i][2])));
        let length = |rows: &[(f64, f64)]| rows.iter().map(|(a, b)| a + b).fold(0.0, f64::max);
        let (length_s, length_t) = (length(&along_s), length(&along_t));
        let longest = length_s.max(length_t);
        let uneven =
            |rows: &[(f64, f64)]| rows.iter().any(|(a, b)| a.max(*b) > UNEVEN * a.min(*b) && a + b > 0.05 * longest);
        let split = match (uneven(&along_s), uneven(&along_t)) {
            (_, true) => Split::UnevenT,
            (true, false) => Split::UnevenS,
            _ if length_s > TIE * length_t => Split::AlongS,
            _ => Split::AlongT,
        };
        let (centre_m, half_m) = (0.5 * (low + high), 0.52 * (high - low));
        let half_length_m = 0.5 * longest;
        Self { cell, s, t, centre_m, half_m, half_length_m, split, halves: OnceLock::new(), points: OnceLock::new() }
    }

    fn is_uneven(&self) -> bool {
        matches!(self.split, Split::UnevenS | Split::UnevenT)
    }

    fn halves(&self, source: &Source, room: &Room, face: Face) -> &[Self; 2] {
        self.halves.get_or_init(|| self.halve(&source.frame, room, face))
    }

    fn halve(&self, frame: &LuminaireFrame, room: &Room, face: Face) -> Box<[Self; 2]> {
        let middle = |(a, b): (f64, f64)| 0.5 * (a + b);
        let part = |s, t| Self::new(self.cell, s, t, frame, room, face);
        Box::new(match self.split {
            Split::AlongS | Split::UnevenS => {
                let m = middle(self.s);
                [part((self.s.0, m), self.t), part((m, self.s.1), self.t)]
            }
            Split::AlongT | Split::UnevenT => {
                let m = middle(self.t);
                [part(self.s, (self.t.0, m)), part(self.s, (m, self.t.1))]
            }
        })
    }

    fn sample(&self, frame: &LuminaireFrame, room: &Room, face: Face, rule: &Gauss) -> Points {
        let count = rule.nodes.len() * rule.nodes.len();
        let mut points = Points {
            x: Vec::with_capacity(count),
            y: Vec::with_capacity(count),
            z: Vec::with_capacity(count),
            flux: Vec::with_capacity(count),
        };
        let (ds, dt) = (self.s.1 - self.s.0, self.t.1 - self.t.0);
        for (a, wa) in rule.nodes.iter().zip(&rule.weights) {
            for (b, wb) in rule.nodes.iter().zip(&rule.weights) {
                let (direction, flux) = frame.direction(&self.cell, self.s.0 + ds * a, self.t.0 + dt * b);
                let p = hit(frame.position_m, direction, room, face);
                points.x.push(p.x);
                points.y.push(p.y);
                points.z.push(p.z);
                points.flux.push(flux * wa * wb * ds * dt);
            }
        }
        points
    }
}

impl Points {
    fn irradiance(&self, receiver: &Receiver, face: Face) -> f64 {
        let (p, n, m) = (receiver.position_m, receiver.normal, face.inward_normal());
        let mut lanes = [0.0; 4];
        let term = |x: f64, y: f64, z: f64, flux: f64| {
            let d = DVec3::new(x - p.x, y - p.y, z - p.z);
            let r2 = d.length_squared();
            flux * d.dot(n).max(0.0) * -d.dot(m) / (r2 * r2)
        };
        let quads = self.x.chunks_exact(4).zip(self.y.chunks_exact(4));
        let quads = quads.zip(self.z.chunks_exact(4)).zip(self.flux.chunks_exact(4));
        for (((x, y), z), flux) in quads {
            for k in 0..4 {
                lanes[k] += term(x[k], y[k], z[k], flux[k]);
            }
        }
        let rest = self.x.len() / 4 * 4;
        let tail: f64 = (rest..self.x.len()).map(|k| term(self.x[k], self.y[k], self.z[k], self.flux[k])).sum();
        lanes[0] + lanes[1] + (lanes[2] + lanes[3]) + tail
    }
}

/// How much of a face a receiver can see.
enum Visible {
    All,
    Part(Vec<DVec3>),
    Nothing,
}

fn above_horizon(receiver: &Receiver, polygon: &[DVec3], scale_m: f64) -> Visible {
    let rounding = 1e-14 * scale_m;
    let height = |p: DVec3| (p - receiver.position_m).dot(receiver.normal);
    if polygon.iter().all(|p| height(*p) >= -rounding) {
        return Visible::All;
    }
    if polygon.iter().all(|p| height(*p) <= rounding) {
        return Visible::Nothing;
    }
    let mut lit = vec![];
    for (k, &p) in polygon.iter().enumerate() {
        let q = polygon[(k + 1) % polygon.len()];
        let (a, b) = (height(p), height(q));
        if a >= 0.0 {
            lit.push(p);
        }
        if (a < 0.0) != (b < 0.0) {
            lit.push(p.lerp(q, a / (a - b)));
        }
    }
    Visible::Part(lit)
}

fn patches(frame: &LuminaireFrame, room: &Room, face: Face, polygon: &[DVec3]) -> Vec<Patch> {
    let depth = (face.plane(room.size_m) - frame.position_m[face.axes().0]).abs();
    if depth == 0.0 {
        // What a flush luminaire sends into its own surface is lost in it.
        return vec![];
    }
    let cells = frame.cells(polygon);
    cells.into_iter().map(|cell| Patch::new(cell, (0.0, 1.0), (0.0, 1.0), frame, room, face)).collect()
}

/// The corners of a face.
fn corners(room: &Room, face: Face) -> Vec<DVec3> {
    let (n, u, v) = face.axes();
    let at = |i: f64, j: f64| {
        let mut p = DVec3::ZERO;
        p[n] = face.plane(room.size_m);
        p[u] = i * room.size_m[u];
        p[v] = j * room.size_m[v];
        p
    };
    vec![at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0), at(0.0, 1.0)]
}

/// Where a direction from a luminaire meets a face, kept within the face against rounding.
fn hit(from_m: DVec3, direction: DVec3, room: &Room, face: Face) -> DVec3 {
    let n = face.axes().0;
    let plane = face.plane(room.size_m);
    let mut p = from_m + direction * ((plane - from_m[n]) / direction[n]).abs();
    p[n] = plane;
    p.clamp(DVec3::ZERO, room.size_m)
}
