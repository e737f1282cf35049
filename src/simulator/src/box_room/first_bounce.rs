//! The first bounce: irradiance from what the point luminaires light directly, integrated over their own directions.
//!
//! Cells of (C, gamma) are split at the table's angles, at the room's edges and, for a meter, at its horizon, all of
//! them exact in the luminaire's own frame, so that the kinks of a piecewise bilinear table cost nothing whatever the
//! luminaire's rotation. An edge or a horizon is a great circle there: `tan gamma = m_z / (m_x cos C + m_y sin C)` for
//! the normal m of its plane.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};

use glam::DVec3;
use rayon::prelude::*;

use super::Effort;
use super::cells::{Cell, LuminaireFrame};
use super::grid::{Face, Grid};
use super::kernel::{Receiver, View};
use super::patch::{Ground, Patch, Points, Rules};
use super::symmetry::reflectance;
use crate::stop::Stop;
use luxproof_scene::Luminaire;
use luxproof_scene::geometry::Room;

/// Cells are not halved below this fraction of the room.
const SMALLEST: f64 = 1e-12;
/// How long a patch may be, against elements, that crosses their border: polynomials on either side are nearly the same.
const ACROSS: f64 = 1.0 / 16.0;
/// Receivers that walk the patches together: what is not kept is made once for all of them.
const TOGETHER: usize = 32;
/// Bytes of halved patches and of points that are kept for the next receivers; beyond that they are made anew.
///
/// A dozen luminaires with fine tables would keep gigabytes otherwise.
const MAX_KEPT: usize = 48 << 20;

/// Everything that the luminaires light, as patches that halve themselves near a receiver.
#[derive(Debug)]
pub(super) struct FirstBounce {
    room: Room,
    sources: Vec<Source>,
    rules: Rules,
    /// Bytes kept so far.
    kept: AtomicUsize,
}

#[derive(Debug)]
struct Source {
    frame: LuminaireFrame,
    /// The patches on each face, by piece of the table.
    faces: [Vec<Patch>; 6],
}

impl FirstBounce {
    pub(super) fn new(room: &Room, luminaires: &[Luminaire], effort: &Effort) -> Self {
        let rules = Rules::new(effort.source_points, 1.0123 * effort.source_reach, effort.source_tolerance);
        let source = |luminaire| {
            let frame = LuminaireFrame::new(luminaire);
            let faces = Face::ALL.map(|face| {
                let ground = Ground { frame: &frame, room, face, rules: &rules };
                let dark = reflectance(room, face) == 0.0 || is_flush(&ground);
                if dark { vec![] } else { patches(ground, frame.cells(&corners(room, face), &frame.lit_pieces())) }
            });
            Source { frame, faces }
        };
        let sources = luminaires.par_iter().map(source).collect();
        Self { room: *room, sources, rules, kept: AtomicUsize::new(0) }
    }

    /// Irradiance at receivers, in lux, of light reflected once.
    pub(super) fn irradiance(&self, receivers: &[Receiver], stop: &Stop) -> Vec<f64> {
        if receivers.len() <= TOGETHER {
            return self.irradiance_together(receivers, stop);
        }
        receivers.par_chunks(TOGETHER).flat_map_iter(|together| self.irradiance_together(together, stop)).collect()
    }

    /// Of what was done before it was stopped.
    fn irradiance_together(&self, receivers: &[Receiver], stop: &Stop) -> Vec<f64> {
        let mut sums = vec![0.0; receivers.len()];
        for face in Face::ALL {
            let rho = reflectance(&self.room, face);
            if rho == 0.0 || stop.is_due() {
                continue;
            }
            let mut on_face = vec![0.0; receivers.len()];
            let polygon = corners(&self.room, face);
            let views: Vec<_> = receivers.iter().map(|r| View::new(self.room.size_m, r, face)).collect();
            let mut in_view = Numbers { numbers: vec![], start: 0 };
            for (k, receiver) in receivers.iter().enumerate().filter(|(_, r)| r.face != Some(face)) {
                match above_horizon(receiver, &polygon, self.room.size_m.max_element()) {
                    Visible::All => in_view.numbers.push(k as u32),
                    Visible::Part(lit) => on_face[k] += self.partly_seen(face, &lit, receiver),
                    Visible::Nothing => {}
                }
            }
            for source in self.sources.iter().take_while(|_| !stop.is_due()) {
                let ground = self.ground(source, face);
                for patch in &source.faces[face.0] {
                    self.walk(patch, ground, (receivers, &views), &mut in_view, &mut on_face);
                }
            }
            for (sum, on_face) in sums.iter_mut().zip(on_face) {
                *sum += rho * on_face;
            }
        }
        sums
    }

    /// Flux in lumens that falls on the surfaces, shared out among the nodes of a grid: its moments with their polynomials.
    pub(super) fn at_nodes(&self, grid: &Grid) -> Vec<f64> {
        let mut at_nodes = vec![0.0; grid.len()];
        for face in Face::ALL {
            for source in &self.sources {
                let ground = self.ground(source, face);
                for patch in &source.faces[face.0] {
                    self.deposit(patch, ground, grid, &mut at_nodes);
                }
            }
        }
        at_nodes
    }

    fn deposit(&self, patch: &Patch, ground: Ground, grid: &Grid, at_nodes: &mut [f64]) {
        let smallest = SMALLEST * self.room.size_m.max_element();
        let (extent, is_within) = grid.extent(ground.face, patch.centre_m, patch.half_m);
        let serves = !patch.is_uneven() && (is_within || extent <= ACROSS);
        if serves || patch.half_length_m <= smallest {
            // Polynomials of an element vary little over a small part of it.
            let rule = match extent {
                ..0.25 => Patch::FAR,
                ..0.5 => Patch::MIDDLING,
                _ => Patch::NEAR,
            };
            for (point_m, flux) in patch.sample(rule, ground).each() {
                grid.deposit(ground.face, point_m, flux, at_nodes);
            }
        } else {
            for half in patch.halve(ground).iter() {
                self.deposit(half, ground, grid, at_nodes);
            }
        }
    }

    /// The flux in lumens that the surfaces reflect at the first bounce; a closed room loses none of it.
    pub(super) fn reflected_flux(&self) -> f64 {
        let mut sum = 0.0;
        for face in Face::ALL {
            for source in &self.sources {
                let ground = self.ground(source, face);
                let on_face: f64 = source.faces[face.0].iter().map(|patch| self.flux(patch, ground)).sum();
                sum += reflectance(&self.room, face) * on_face;
            }
        }
        sum
    }

    fn flux(&self, patch: &Patch, ground: Ground) -> f64 {
        if patch.is_uneven() {
            return self.halves(patch, ground, &mut None).iter().map(|half| self.flux(half, ground)).sum();
        }
        self.points(patch, Patch::FAR, ground, &mut None).flux()
    }

    fn ground<'a>(&'a self, source: &'a Source, face: Face) -> Ground<'a> {
        Ground { frame: &source.frame, room: &self.room, face, rules: &self.rules }
    }

    /// Light from a face that the horizon of a receiver crosses: pieces of a table that it crosses are cut along it.
    fn partly_seen(&self, face: Face, lit: &[DVec3], receiver: &Receiver) -> f64 {
        let mut sum = [0.0];
        let view = View::new(self.room.size_m, receiver, face);
        let (seen, mut only) =
            ((std::slice::from_ref(receiver), std::slice::from_ref(&view)), Numbers { numbers: vec![0], start: 0 });
        let rounding = 1e-14 * self.room.size_m.max_element();
        for source in &self.sources {
            let ground = self.ground(source, face);
            let mut crossed = vec![];
            for piece in source.faces[face.0].chunk_by(|a, b| a.piece() == b.piece()) {
                let heights = piece.iter().map(|patch| heights(patch, receiver));
                let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |a, b| (a.0.min(b.0), a.1.max(b.1)));
                if low >= -rounding {
                    for patch in piece {
                        self.walk(patch, ground, seen, &mut only, &mut sum);
                    }
                } else if high > rounding {
                    crossed.push(piece[0].piece());
                }
            }
            if !crossed.is_empty() {
                for patch in patches(ground, source.frame.cells(lit, &crossed)) {
                    self.walk(&patch, ground, seen, &mut only, &mut sum);
                }
            }
        }
        sum[0]
    }

    /// Adds what a patch gives the receivers whose numbers `list` holds from `start` on; leaves the list as it was.
    fn walk(&self, patch: &Patch, ground: Ground, seen: (&[Receiver], &[View]), list: &mut Numbers, sums: &mut [f64]) {
        let smallest = SMALLEST * self.room.size_m.max_element();
        let (start, end) = (list.start, list.numbers.len());
        let mut own = [const { None }; Patch::RULES];
        for k in start..end {
            let number = list.numbers[k];
            let (receiver, view) = (&seen.0[number as usize], &seen.1[number as usize]);
            let gap = (receiver.position_m - patch.centre_m).abs() - patch.half_m;
            let rule = match patch.rule_at(gap.max(DVec3::ZERO).length_squared(), &self.rules) {
                _ if patch.half_length_m <= smallest => Patch::NEAR,
                Some(rule) if !patch.is_uneven() => rule,
                _ => {
                    list.numbers.push(number);
                    continue;
                }
            };
            let points = self.points(patch, rule, ground, &mut own[rule]);
            sums[number as usize] += points.irradiance(view);
        }
        if list.numbers.len() > end {
            let mut own = None;
            list.start = end;
            for half in self.halves(patch, ground, &mut own) {
                self.walk(half, ground, seen, list, sums);
            }
            list.start = start;
            list.numbers.truncate(end);
        }
    }

    /// A patch's points, which are kept as long as there is room, or made here: the result is the same.
    fn points<'a>(&self, patch: &'a Patch, rule: usize, ground: Ground, own: &'a mut Option<Points>) -> &'a Points {
        self.cached(patch.kept_points(rule), 24 * patch.count(rule), || patch.sample(rule, ground), own)
    }

    fn halves<'a>(&self, patch: &'a Patch, ground: Ground, own: &'a mut Option<Box<[Patch; 2]>>) -> &'a [Patch; 2] {
        self.cached(patch.kept_halves(), 2 * size_of::<Patch>(), || patch.halve(ground), own).as_ref()
    }

    fn cached<'a, V>(
        &self,
        place: &'a OnceLock<V>,
        bytes: usize,
        make: impl Fn() -> V,
        own: &'a mut Option<V>,
    ) -> &'a V {
        if let Some(value) = place.get() {
            return value;
        }
        if own.is_none() && self.kept.fetch_add(bytes, Ordering::Relaxed) < MAX_KEPT {
            return place.get_or_init(make);
        }
        own.get_or_insert_with(make)
    }
}

/// Numbers of receivers in a stack, of which the top belongs to the patch that is being walked.
struct Numbers {
    numbers: Vec<u32>,
    start: usize,
}

/// The least and the greatest height of a patch above the horizon of a receiver, in metres, or somewhat more.
fn heights(patch: &Patch, receiver: &Receiver) -> (f64, f64) {
    let middle = (patch.centre_m - receiver.position_m).dot(receiver.normal);
    let half = patch.half_m.dot(receiver.normal.abs());
    (middle - half, middle + half)
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

/// What a flush luminaire sends into its own surface is lost in it.
fn is_flush(ground: &Ground) -> bool {
    let normal = ground.face.axes().0;
    ground.face.plane(ground.room.size_m) == ground.frame.position_m[normal]
}

fn patches(ground: Ground, cells: Vec<Cell>) -> Vec<Patch> {
    cells.into_iter().map(|cell| Patch::new(cell, ground)).collect()
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
