//! Furnished box rooms and luminous openings: collocation radiosity with exactly clipped configuration factors.
//!
//! Patches of uniform exitance, indirect irradiance collocated at their centres, exact direct light, exact final
//! gather; halved everywhere and extrapolated after Richardson. Cohen and Wallace, *Radiosity and Realistic Image
//! Synthesis* (1993), chapters 4 and 5; clipping replaces their hemicube.

mod exitance;
mod factor;
mod patches;
#[cfg(test)]
mod tests;

use glam::DVec3;
use rayon::prelude::*;

use super::emission::Emitter;
use super::visibility::Occluder;
use super::{Bounded, gmres};
use crate::geometry::Room;
use crate::scene::{Bounces, Meter, Scene};
use exitance::{Exitance, Nine, RULE};
use factor::factor;
use patches::{Body, Patch};

/// Patches at most: their matrix then takes 100 MiB.
const MOST_PATCHES: usize = 3600;
/// Patches of the first mesh, before outlines are cut into it.
const FIRST_PATCHES: f64 = 60.0;
/// How much finer the meshes are than the first one.
const MULTIPLES: [usize; 6] = [1, 2, 3, 4, 6, 8];

/// Exitance is projected on biquadratics to this fraction of the room's mean.
const ROUGHNESS: f64 = 5e-4;

/// What far rules and the projection of exitance may err together, relative.
const FLOOR: f64 = 2e-4;

/// A scene that radiosity can treat, with the meshes solved so far.
#[derive(Debug)]
pub(super) struct Furnished {
    room: Option<Room>,
    bodies: Vec<Body>,
    occluders: Vec<Occluder>,
    emitters: Vec<Emitter>,
    fields: Vec<Field>,
}

/// One mesh with its solved exitance in lm/m².
#[derive(Debug)]
struct Field {
    patches: Vec<Patch>,
    /// After one reflection, as the nodes of a nine-point rule see it.
    first: Vec<Exitance>,
    /// After two and more.
    further: Vec<f64>,
}

impl Furnished {
    /// `None` where a body is no axis-aligned box or plate, or an opening is round.
    pub(super) fn new(scene: &Scene) -> Option<Self> {
        let emitters = scene.luminaires.iter().map(Emitter::new).collect::<Option<Vec<_>>>()?;
        let bodies = match &scene.room {
            Some(room) => patches::bodies(room, &scene.obstacles)?,
            None if scene.obstacles.is_empty() => vec![],
            None => return None,
        };
        let occluders = bodies.iter().map(|b| b.shape).collect();
        Some(Self { room: scene.room, bodies, occluders, emitters, fields: vec![] })
    }

    /// Direct illuminance at the meters.
    pub(super) fn direct(&self, meters: &[Meter], relative_error: f64) -> Vec<Bounded> {
        let error = relative_error.clamp(1e-10, 1e-4);
        let at = |meter: &Meter| {
            let lux = self.emitters.iter().map(|e| e.illuminance(meter, &self.occluders, error));
            lux.fold(Bounded::default(), |a, b| a + b)
        };
        meters.par_iter().map(at).collect()
    }

    /// Indirect illuminance at the meters, halving the patches until the bound meets `relative_error` or they are too
    /// many.
    pub(super) fn indirect(
        &mut self,
        meters: &[Meter],
        bounces: Bounces,
        relative_error: f64,
    ) -> (Vec<Bounded>, String) {
        let Some(room) = self.room else {
            return (vec![Bounded::default(); meters.len()], "free field: nothing reflects".into());
        };
        if bounces == Bounces::AtMost(0) {
            return (vec![Bounded::default(); meters.len()], "no reflection asked for".into());
        }
        let mut readings: Vec<Vec<f64>> = vec![];
        loop {
            let level = readings.len();
            if self.fields.len() == level {
                self.fields.push(self.solve(&room, bounces, level));
            }
            let field = &self.fields[level];
            readings.push(meters.par_iter().map(|m| self.gather(field, m)).collect());
            if let [.., a, b, c] = readings.as_slice() {
                let values = extrapolate([a, b, c], level);
                let met = values.iter().all(|v| v.bound <= relative_error * v.value.abs());
                let next = MULTIPLES.get(level + 1).map(|m| (m * m * field.patches.len()) / MULTIPLES[level].pow(2));
                if met || next.is_none_or(|count| count > MOST_PATCHES) {
                    let count = field.patches.len();
                    let why = if met { "the bound is met" } else { "finer meshes would not fit" };
                    let text = format!("collocation radiosity, {count} patches: bodies or openings; {why}");
                    return (values, text);
                }
            }
        }
    }

    fn solve(&self, room: &Room, bounces: Bounces, level: usize) -> Field {
        let s = room.size_m;
        let area_m2 = 2.0 * (s.x * s.y + s.y * s.z + s.z * s.x);
        let patches = patches::patches(room, &self.bodies, (area_m2 / FIRST_PATCHES).sqrt(), MULTIPLES[level]);
        let mean = patches.iter().map(|p| p.area_m2 * self.first_at(p, &p.corners_m)[4]).sum::<f64>() / area_m2;
        let first: Vec<Exitance> =
            patches.par_iter().map(|patch| self.first_exitance(patch, ROUGHNESS * mean)).collect();
        if bounces == Bounces::AtMost(1) {
            return Field { further: vec![0.0; patches.len()], first, patches };
        }
        let seen = |p: &Patch| self.seen_from(p.centre_m, p.normal, &patches, &first);
        let (known, matrix): (Vec<f64>, Vec<Vec<f64>>) = patches.par_iter().map(seen).unzip();
        let apply = |u: &[f64]| -> Vec<f64> {
            let exitance = exitance(u, &patches);
            matrix.par_iter().map(|row| gmres::dot(row, &exitance)).collect()
        };
        let indirect = match bounces {
            Bounces::Converged => gmres::solve(apply, &known, 1e-12),
            Bounces::AtMost(count) => (2..count).fold(known.clone(), |u, _| {
                let again = apply(&u);
                known.iter().zip(&again).map(|(g, k)| g + k).collect()
            }),
        };
        Field { further: exitance(&indirect, &patches), first, patches }
    }

    fn gather(&self, field: &Field, meter: &Meter) -> f64 {
        let (once, row) = self.seen_from(meter.position_m, meter.normal, &field.patches, &field.first);
        once + gmres::dot(&row, &field.further)
    }

    /// Exitance of a patch after one reflection.
    fn first_exitance(&self, patch: &Patch, tolerance: f64) -> Exitance {
        Exitance::project(&|a, b, half| self.first_at(patch, &patch.part_m(a, b, half)), tolerance)
    }

    /// Exitance of a part of a patch after one reflection, at the nodes of the nine-point rule.
    fn first_at(&self, patch: &Patch, corners_m: &[DVec3; 4]) -> Nine {
        let [origin, p, _, q] = *corners_m;
        let node = |k: usize| 0.5 + 0.5 * RULE[k].0;
        let nodes_m = std::array::from_fn(|k| origin + node(k / 3) * (p - origin) + node(k % 3) * (q - origin));
        let mut nine = [0.0; 9];
        for emitter in &self.emitters {
            let lux = emitter.illuminance_at_nodes(nodes_m, corners_m, patch.normal, &self.occluders);
            for (sum, lux) in nine.iter_mut().zip(lux) {
                *sum += patch.reflectance * lux;
            }
        }
        nine
    }

    /// Irradiance at an element after one reflection, and for exitance 1 of each patch.
    ///
    /// Exitance after one reflection varies like a parabola across a patch, further exitance linearly, as its own and its
    /// neighbours' centres say.
    fn seen_from(&self, position_m: DVec3, normal: DVec3, patches: &[Patch], first: &[Exitance]) -> (f64, Vec<f64>) {
        let mut row = vec![0.0; patches.len()];
        let mut once = 0.0;
        for (k, (patch, first)) in patches.iter().zip(first).enumerate() {
            let seen = factor(position_m, normal, patch, first, &self.occluders);
            once += seen.weighted;
            row[k] += seen.whole;
            for (slope, moment) in patch.slopes.iter().zip(seen.moments_m) {
                for (neighbour, weight) in slope.patches.iter().zip(slope.weights) {
                    row[*neighbour as usize] += weight * moment;
                }
            }
        }
        (once, row)
    }
}

fn exitance(irradiance: &[f64], patches: &[Patch]) -> Vec<f64> {
    irradiance.iter().zip(patches).map(|(u, p)| u * p.reflectance).collect()
}

/// The limit of three successive meshes at every meter, and how far off it may be.
///
/// The error of collocation at the centres falls with the square of the patches. The bound is the last step itself,
/// though extrapolation removes most of it, or the change of the extrapolated value where that is larger; a step that
/// is small by chance counts as a third of the median step of all meters.
fn extrapolate(readings: [&[f64]; 3], level: usize) -> Vec<Bounded> {
    let gain = |level: usize| 1.0 / ((MULTIPLES[level] as f64 / MULTIPLES[level - 1] as f64).powi(2) - 1.0);
    let steps = readings[1].iter().zip(readings[2]).filter(|(_, c)| **c != 0.0);
    let mut steps: Vec<f64> = steps.map(|(b, c)| ((c - b) / c).abs()).collect();
    steps.sort_by(f64::total_cmp);
    let median = steps.get(steps.len() / 2).copied().unwrap_or(0.0);
    let at = |k: usize| {
        let [a, b, c] = readings.map(|r| r[k]);
        let (before, value) = (b + (b - a) * gain(level - 1), c + (c - b) * gain(level));
        let step = (c - b).abs().max(median / 3.0 * c.abs());
        Bounded { value, bound: step.max((value - before).abs()) + FLOOR * value.abs() }
    };
    (0..readings[2].len()).map(at).collect()
}
