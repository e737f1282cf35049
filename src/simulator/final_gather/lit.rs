//! Light straight from the luminaires on the walls: polynomials on rectangles that are quartered until they agree with
//! it, for the luminaires that nothing can hide from there; the others are asked at every place anew.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::grid::{NODES, ORDER, polynomial};
use super::surroundings::{Surroundings, WALLS, off_wall, on_wall};
use crate::scene::Meter;
use crate::simulator::emission::Emitter;
use crate::simulator::quadrature::Gauss;
use crate::simulator::sampler::mix;
use crate::simulator::stop::Stop;

/// Where a rectangle's polynomial is held against the light, besides its nodes.
const CHECKS: [[f64; 2]; 6] = [[0.5, 0.5], [0.02, 0.02], [0.98, 0.98], [0.02, 0.98], [0.98, 0.02], [0.5, 0.02]];
/// Quarterings at most.
const DEEPEST: u32 = 9;
/// Quarterings at most that only part what bodies may hide from what they cannot.
const DEEPEST_FOR_SHADOW: u32 = 4;
/// Random places that tell how bright the walls are on the mean.
const PLACES: u64 = 64;
/// Dim places need be known to this part of the wall's mean only.
const DIM: f64 = 0.1;

/// Direct illuminance on the walls of a room.
#[derive(Debug)]
pub(super) struct Lit {
    walls: Vec<Vec<Part>>,
    rule: Gauss,
    /// Leaves of all walls by what they reflect, for drawing places where much light falls.
    bright: Vec<Bright>,
    /// All that is reflected, in lumens.
    reflected_lm: f64,
    /// Whether some place is so much brighter than the mean that rays would find it too seldom.
    pub(super) is_peaked: bool,
    /// Exitance of the brightest place in lm/m².
    pub(super) peak: f64,
}

#[derive(Debug)]
struct Part {
    corner_m: DVec2,
    size_m: DVec2,
    kind: Kind,
}

#[derive(Debug)]
enum Kind {
    /// Index of the first of four quarters.
    Quartered(usize),
    Leaf(Box<Leaf>),
}

#[derive(Debug)]
struct Leaf {
    /// Illuminance at the nodes by the luminaires that nothing hides.
    lux: [f64; NODES],
    /// How far off that is.
    error_lux: f64,
    /// Luminaires that may be hidden, or whose light is no polynomial here.
    asked: Vec<u32>,
    /// Mean exitance after one reflection in lm/m², as far as it is known beforehand.
    exitance: f64,
}

#[derive(Debug)]
struct Bright {
    up_to_lm: f64,
    wall: usize,
    corner_m: DVec2,
    size_m: DVec2,
}

/// How well light is known on a rectangle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Known {
    /// How far off it may be; infinite where bodies cover a part.
    pub(super) error_lux: f64,
    /// Standard error of its mean, which the replicates show in their scatter.
    pub(super) noise_lux: f64,
    pub(super) side_m: f64,
}

impl Known {
    /// The part of a polynomial's error that is left in what a place sees of its rectangle: what it leaves out is as often
    /// too bright as too dim, and from afar one cannot tell the one from the other.
    pub(super) fn left_lux(&self, distance_m: f64) -> f64 {
        self.error_lux * (self.side_m / distance_m).min(1.0)
    }

    /// Whether a ray may end on it: what is left out and its noise are below a limit.
    pub(super) fn is_enough(&self, distance_m: f64, limit_lux: f64) -> bool {
        (self.error_lux + 2.0 * self.noise_lux) * (self.side_m / distance_m).min(1.0) <= limit_lux
    }
}

/// Direct illuminance at a place, and how far off it may be besides chance.
#[derive(Clone, Copy, Debug)]
pub(super) struct Light {
    pub(super) lux: f64,
    pub(super) known: Known,
}

/// What it takes to light a place.
#[derive(Clone, Copy)]
pub(super) struct Lights<'a> {
    pub(super) surroundings: &'a Surroundings,
    pub(super) emitters: &'a [Emitter],
}

impl Lights<'_> {
    /// Light of one luminaire at a place, by one of its parts where it has any extent.
    pub(super) fn sample(&self, k: usize, meter: &Meter, start_m: DVec3, u: [f64; 2]) -> f64 {
        let (lux, from_m) = self.emitters[k].sample(meter, u);
        if lux > 0.0 && !self.surroundings.is_hidden(start_m, from_m) { lux } else { 0.0 }
    }

    fn may_be_hidden(&self, k: usize, from: [DVec3; 2]) -> bool {
        self.surroundings.may_hide(from, self.emitters[k].bounds_m())
    }
}

impl Lit {
    /// To a relative error at each place, dim ones apart.
    pub(super) fn new(lights: &Lights, relative_error: f64, stop: &Stop) -> Self {
        let rule = Gauss::new(ORDER);
        let Some(room) = lights.surroundings.room else {
            return Self { walls: vec![], rule, bright: vec![], reflected_lm: 0.0, is_peaked: false, peak: 0.0 };
        };
        let mean: f64 = mean_lux(lights, relative_error);
        let wall = |wall: usize| {
            let size_m = on_wall(wall, room.size_m);
            let build = Build { lights, rule: &rule, wall, relative_error, floor_lux: DIM * mean, stop };
            let mut parts = vec![];
            if room.reflectance.of(WALLS[wall]) > 0.0 {
                let first = build.leaf(DVec2::ZERO, size_m);
                parts.push(Part { corner_m: DVec2::ZERO, size_m, kind: Kind::Quartered(0) });
                build.grow(&mut parts, 0, first, 0);
            }
            parts
        };
        let walls: Vec<Vec<Part>> = (0..WALLS.len()).into_par_iter().map(wall).collect();
        let (mut bright, mut reflected_lm, mut peak, mut area) = (vec![], 0.0, 0.0_f64, 0.0);
        for (wall, parts) in walls.iter().enumerate() {
            for part in parts {
                let Kind::Leaf(leaf) = &part.kind else { continue };
                let area_m2 = part.size_m.x * part.size_m.y;
                reflected_lm += leaf.exitance * area_m2;
                peak = peak.max(leaf.exitance);
                bright.push(Bright { up_to_lm: reflected_lm, wall, corner_m: part.corner_m, size_m: part.size_m });
            }
            let size_m = on_wall(wall, room.size_m);
            area += size_m.x * size_m.y;
        }
        let is_peaked = peak * area > super::PEAKED * reflected_lm;
        Self { walls, rule, bright, reflected_lm, is_peaked, peak }
    }

    /// Direct illuminance at a place on a wall; `u` draws the parts of luminaires that must be asked.
    pub(super) fn at(&self, lights: &Lights, wall: usize, meter: &Meter, u: [f64; 2]) -> Light {
        let at_m = on_wall(wall, meter.position_m);
        let Some((part, leaf)) = self.leaf(wall, at_m) else {
            return Light { lux: 0.0, known: Known { error_lux: 0.0, noise_lux: 0.0, side_m: 0.0 } };
        };
        let t = (at_m - part.corner_m) / part.size_m;
        let side_m = part.size_m.max_element();
        let mut light = Light {
            lux: polynomial(&self.rule, &leaf.lux, t),
            known: Known { error_lux: leaf.error_lux, noise_lux: 0.0, side_m },
        };
        for k in &leaf.asked {
            light.lux += lights.sample(*k as usize, meter, meter.position_m, u);
        }
        light
    }

    /// A place drawn in proportion to what is reflected, and its density per square metre.
    pub(super) fn draw(&self, [u, v]: [f64; 2]) -> Option<(usize, DVec2, f64)> {
        let at = u * self.reflected_lm;
        let k = self.bright.partition_point(|b| b.up_to_lm <= at).min(self.bright.len().checked_sub(1)?);
        let below = if k == 0 { 0.0 } else { self.bright[k - 1].up_to_lm };
        let bright = &self.bright[k];
        let lumens = bright.up_to_lm - below;
        let across = ((at - below) / lumens).clamp(0.0, 1.0);
        let place = bright.corner_m + bright.size_m * DVec2::new(across, v);
        Some((bright.wall, place, lumens / self.reflected_lm / (bright.size_m.x * bright.size_m.y)))
    }

    /// The density of [`Self::draw`] at a place, per square metre.
    pub(super) fn density(&self, wall: usize, point_m: DVec3) -> f64 {
        self.leaf(wall, on_wall(wall, point_m)).map_or(0.0, |(_, leaf)| leaf.exitance / self.reflected_lm)
    }

    fn leaf(&self, wall: usize, at_m: DVec2) -> Option<(&Part, &Leaf)> {
        let parts = &self.walls[wall];
        let mut part = parts.first()?;
        loop {
            match &part.kind {
                Kind::Leaf(leaf) => return Some((part, leaf)),
                Kind::Quartered(first) => {
                    let far = (at_m - part.corner_m).cmpge(0.5 * part.size_m);
                    part = &parts[first + usize::from(far.x) + 2 * usize::from(far.y)];
                }
            }
        }
    }
}

/// The mean over random places on all walls, bodies left out.
fn mean_lux(lights: &Lights, relative_error: f64) -> f64 {
    let Some(room) = lights.surroundings.room else { return 0.0 };
    let unit = |k: u64| (mix(k) >> 11) as f64 / (1_u64 << 53) as f64;
    let one = |k: u64| {
        let wall = (k % 6) as usize;
        let at_m = on_wall(wall, room.size_m) * DVec2::new(unit(2 * k + 1), unit(2 * k + 2));
        let meter = Meter { position_m: off_wall(&room, wall, at_m), normal: WALLS[wall].inward_normal() };
        lights.emitters.iter().map(|e| e.illuminance(&meter, &[], relative_error.max(1e-3)).value).sum::<f64>()
    };
    (0..PLACES).map(one).sum::<f64>() / PLACES as f64
}

struct Build<'a> {
    lights: &'a Lights<'a>,
    rule: &'a Gauss,
    wall: usize,
    relative_error: f64,
    floor_lux: f64,
    stop: &'a Stop,
}

impl Build<'_> {
    /// Puts a leaf in its place, or its quarters where it is not good enough.
    fn grow(&self, parts: &mut Vec<Part>, index: usize, leaf: Leaf, depth: u32) {
        let mean = leaf.lux.iter().map(|l| l.abs()).sum::<f64>() / NODES as f64;
        let is_good = leaf.error_lux <= self.relative_error * mean.max(self.floor_lux);
        let is_clear = leaf.asked.is_empty() || depth >= DEEPEST_FOR_SHADOW;
        if is_good && is_clear || depth >= DEEPEST || self.stop.is_due() {
            parts[index].kind = Kind::Leaf(Box::new(leaf));
            return;
        }
        let (corner_m, half_m) = (parts[index].corner_m, 0.5 * parts[index].size_m);
        let first = parts.len();
        parts[index].kind = Kind::Quartered(first);
        let quarters: Vec<(DVec2, Leaf)> = [DVec2::ZERO, DVec2::X, DVec2::Y, DVec2::ONE]
            .into_par_iter()
            .map(|q| {
                let at_m = corner_m + q * half_m;
                (at_m, self.leaf(at_m, half_m))
            })
            .collect();
        let leaves: Vec<Leaf> = quarters
            .into_iter()
            .map(|(corner_m, leaf)| {
                parts.push(Part { corner_m, size_m: half_m, kind: Kind::Quartered(0) });
                leaf
            })
            .collect();
        for (k, leaf) in leaves.into_iter().enumerate() {
            self.grow(parts, first + k, leaf, depth + 1);
        }
    }

    /// A rectangle with the luminaires that may be hidden from it told apart.
    fn leaf(&self, corner_m: DVec2, size_m: DVec2) -> Leaf {
        let room = self.lights.surroundings.room;
        let meter = |t: DVec2| Meter {
            position_m: room.map_or(DVec3::ZERO, |room| off_wall(&room, self.wall, corner_m + t * size_m)),
            normal: WALLS[self.wall].inward_normal(),
        };
        let corners_m = [meter(DVec2::ZERO).position_m, meter(DVec2::ONE).position_m];
        let all = 0..self.lights.emitters.len();
        let (asked, clear): (Vec<usize>, Vec<usize>) = all.partition(|k| self.lights.may_be_hidden(*k, corners_m));
        let error = (0.2 * self.relative_error).min(1e-3);
        let lux_at = |t: DVec2, which: &[usize]| -> f64 {
            let meter = meter(t);
            which.iter().map(|k| self.lights.emitters[*k].illuminance(&meter, &[], error).value).sum()
        };
        let n = &self.rule.nodes;
        let node = |k: usize| DVec2::new(n[k / ORDER], n[k % ORDER]);
        let lux = std::array::from_fn(|k| lux_at(node(k), &clear));
        let off = |t: &[f64; 2]| {
            let t = DVec2::from_array(*t);
            (polynomial(self.rule, &lux, t) - lux_at(t, &clear)).abs()
        };
        let error_lux = CHECKS.iter().map(off).fold(0.0, f64::max);
        let by_area: f64 = (0..NODES).map(|k| self.weight(k) * lux[k]).sum();
        // What may be hidden counts by half, so that no place that is lit is drawn never.
        let hidden: f64 = (0..NODES).map(|k| self.weight(k) * lux_at(node(k), &asked)).sum();
        let rho = room.map_or(0.0, |room| room.reflectance.of(WALLS[self.wall]));
        let exitance = rho * (by_area.max(0.0) + 0.5 * hidden).max(0.02 * self.floor_lux);
        Leaf { lux, error_lux, asked: asked.iter().map(|k| *k as u32).collect(), exitance }
    }

    fn weight(&self, node: usize) -> f64 {
        self.rule.weights[node / ORDER] * self.rule.weights[node % ORDER]
    }
}
