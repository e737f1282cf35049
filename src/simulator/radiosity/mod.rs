//! Furnished box rooms and luminous openings: collocation radiosity with exactly clipped configuration factors.
//!
//! Patches of biquadratic exitance, indirect irradiance collocated at three by three Gauss points, exact direct
//! light, exact final gather. Cohen and Wallace, *Radiosity and Realistic Image Synthesis* (1993), chapters 4 and 5;
//! clipping replaces their hemicube. At Gauss points collocation converges faster than its polynomials interpolate:
//! Atkinson, *The Numerical Solution of Integral Equations of the Second Kind* (1997), section 3.4.

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
use patches::{Body, Fineness, Patch};

/// Patches at most: the matrix of their nodes then takes 130 MB.
const MAX_PATCHES: usize = 450;
/// Bodies at most: every one cuts what it comes close to, and patches multiply.
const MAX_BODIES: usize = 40;
/// Nodes of a patch.
const NODES: usize = 9;
/// Patches of an empty room whose sides are as long as the rule of thumb says.
const FIRST_PATCHES: f64 = 60.0;
/// How much shorter the patches of each mesh are than that.
const DIVISORS: [f64; 5] = [0.35, 0.5, 0.7, 1.0, 1.4];
/// Meshes that are solved one after the other, the second with half the sides of the first: where errors as large as
/// [`COARSE`] are allowed, and otherwise.
const COARSE_MESHES: [usize; 4] = [0, 2, 3, 4];
const FINE_MESHES: [usize; 3] = [1, 3, 4];
const COARSE: f64 = 0.02;

/// Exitance is projected on biquadratics to this fraction of the room's mean.
const ROUGHNESS: f64 = 5e-4;

/// What finer meshes do not show, relative: energy gained in rooms where all surfaces reflect alike is below 2e-4.
const FLOOR: f64 = 2e-4;

/// Bounds are so many times what the law of convergence says.
const SAFETY: f64 = 4.5;

/// A scene that radiosity can treat, with the meshes solved so far.
#[derive(Debug)]
pub(super) struct Furnished {
    room: Option<Room>,
    bodies: Vec<Body>,
    occluders: Vec<Occluder>,
    emitters: Vec<Emitter>,
    /// By number of the mesh.
    fields: Vec<(usize, Field)>,
}

/// One mesh with its solved exitance in lm/m².
#[derive(Debug)]
struct Field {
    patches: Vec<Patch>,
    /// After one reflection, as the nodes of a nine-point rule see it.
    first: Vec<Exitance>,
    /// After two and more, at the nine nodes of each patch.
    further: Vec<f64>,
}

impl Furnished {
    /// `None` where a body is no axis-aligned box or plate, an opening is round, or patches would be too many.
    pub(super) fn new(scene: &Scene) -> Option<Self> {
        let emitters = scene.luminaires.iter().map(Emitter::new).collect::<Option<Vec<_>>>()?;
        let bodies = match &scene.room {
            Some(room) => patches::bodies(room, &scene.obstacles)?,
            None if scene.obstacles.is_empty() => vec![],
            None => return None,
        };
        // What lies flat on a surface of the room covers it and hides nothing else.
        let stands = |b: &&Body| !scene.room.is_some_and(|room| patches::lies_flat(&room, &b.shape));
        let occluders: Vec<Occluder> = bodies.iter().filter(stands).map(|b| b.shape).collect();
        let furnished = Self { room: scene.room, bodies, occluders, emitters, fields: vec![] };
        let fits = |room: &Room| furnished.fits(room, COARSE_MESHES[1]);
        (furnished.bodies.len() <= MAX_BODIES && furnished.room.as_ref().is_none_or(fits)).then_some(furnished)
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

    /// Indirect illuminance at the meters, on finer and finer meshes until the bound meets `relative_error` or the
    /// patches are too many.
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
        if self.is_integrable(bounces) {
            let text = "light reflected once, integrated over what is both lit and seen".into();
            return (self.once_reflected(&room, meters, relative_error), text);
        }
        let levels: &[usize] =
            if relative_error < COARSE && self.fits(&room, FINE_MESHES[1]) { &FINE_MESHES } else { &COARSE_MESHES };
        let mut readings: Vec<Reading> = vec![];
        let mut why = "the bound meets what was asked";
        for level in levels.iter().copied() {
            if self.fields.iter().all(|(at, _)| *at != level) {
                let patches = self.mesh(&room, level);
                if patches.len() > MAX_PATCHES {
                    why = "finer meshes have too many patches";
                    break;
                }
                self.fields.push((level, self.solve(patches, bounces)));
            }
            let field = self.fields.iter().find(|(at, _)| *at == level);
            readings.extend(field.map(|(_, f)| Reading {
                divisor: DIVISORS[level],
                lux: meters.par_iter().map(|m| self.gather(f, m)).collect(),
            }));
            if readings.len() >= 2 && bounded(&readings).iter().all(|v| v.bound <= relative_error * v.value.abs()) {
                break;
            }
            if level == levels[levels.len() - 1] {
                why = "there is no finer mesh";
            }
        }
        let count = self.fields.last().map_or(0, |(_, field)| field.patches.len());
        let text = format!("collocation radiosity, up to {count} biquadratic patches: bodies or openings; {why}");
        (bounded(&readings), text)
    }

    /// Whether no mesh is needed: one reflection of light from luminaires without extent.
    pub(super) fn is_integrable(&self, bounces: Bounces) -> bool {
        bounces == Bounces::AtMost(1) && self.emitters.iter().all(Emitter::is_point)
    }

    fn once_reflected(&self, room: &Room, meters: &[Meter], relative_error: f64) -> Vec<Bounded> {
        let surfaces = self.mesh(room, 0);
        let error = relative_error.clamp(1e-9, 1e-3);
        let at = |meter: &Meter| {
            let mut sum = Bounded::default();
            for surface in surfaces.iter().filter(|s| s.reflectance > 0.0) {
                for emitter in &self.emitters {
                    let Bounded { value, bound } =
                        emitter.reflected(meter, &surface.corners_m, surface.normal, &self.occluders, error);
                    sum = sum + Bounded { value: surface.reflectance * value, bound: surface.reflectance * bound };
                }
            }
            // Clipping and the angles round.
            Bounded { bound: sum.bound + 1e-11 * sum.value, ..sum }
        };
        meters.par_iter().map(at).collect()
    }

    fn fits(&self, room: &Room, level: usize) -> bool {
        self.mesh(room, level).len() <= MAX_PATCHES
    }

    /// The patches of a level, each finer than the one before.
    fn mesh(&self, room: &Room, level: usize) -> Vec<Patch> {
        let fineness = Fineness { side_m: (area_m2(room) / FIRST_PATCHES).sqrt(), divisor: DIVISORS[level] };
        patches::patches(room, &self.bodies, fineness)
    }

    fn solve(&self, patches: Vec<Patch>, bounces: Bounces) -> Field {
        let sum = |f: &dyn Fn(&Patch) -> f64| patches.iter().map(f).sum::<f64>();
        let mean = sum(&|p| p.area_m2 * self.first_at(p, &p.corners_m)[4]) / sum(&|p| p.area_m2);
        let first: Vec<Exitance> =
            patches.par_iter().map(|patch| self.first_exitance(patch, ROUGHNESS * mean)).collect();
        if bounces == Bounces::AtMost(1) {
            return Field { further: vec![0.0; NODES * patches.len()], first, patches };
        }
        let nodes: Vec<(DVec3, DVec3)> =
            patches.iter().flat_map(|p| p.nodes_m().map(|node| (node, p.normal))).collect();
        let seen = |(node, normal): &(DVec3, DVec3)| self.seen_from(*node, *normal, &patches, &first);
        let (known, matrix): (Vec<f64>, Vec<Vec<f64>>) = nodes.par_iter().map(seen).unzip();
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

    /// Irradiance at an element after one reflection, and for exitance 1 of each patch's nine nodes.
    ///
    /// Exitance after one reflection is a parabola across each part of a patch, further exitance across the patch.
    fn seen_from(&self, position_m: DVec3, normal: DVec3, patches: &[Patch], first: &[Exitance]) -> (f64, Vec<f64>) {
        let mut row = Vec::with_capacity(NODES * patches.len());
        let mut once = 0.0;
        for (patch, first) in patches.iter().zip(first) {
            let seen = factor(position_m, normal, patch, first, &self.occluders);
            once += seen.weighted;
            row.extend(seen.by_node);
        }
        (once, row)
    }
}

fn area_m2(room: &Room) -> f64 {
    let s = room.size_m;
    2.0 * (s.x * s.y + s.y * s.z + s.z * s.x)
}

fn exitance(irradiance: &[f64], patches: &[Patch]) -> Vec<f64> {
    irradiance.iter().enumerate().map(|(k, u)| u * patches[k / NODES].reflectance).collect()
}

/// What a mesh gives at every meter.
struct Reading {
    divisor: f64,
    lux: Vec<f64>,
}

/// The finest mesh at every meter, and how far off it may be.
///
/// Errors fall at least like the square of the patches' sides, so that a mesh with sides shorter by r is off by at most
/// 1 / (r^2 - 1) of its distance from the one before; [`SAFETY`] times that is the bound, and not less than half of what the step before gave.
/// What is small by chance counts as more than what nine in ten meters have.
fn bounded(readings: &[Reading]) -> Vec<Bounded> {
    let [.., coarse, fine] = readings else { return vec![] };
    let step = |k: usize, fine: &Reading, coarse: &Reading| {
        let ratio = fine.divisor / coarse.divisor;
        SAFETY * (fine.lux[k] - coarse.lux[k]).abs() / (ratio * ratio - 1.0)
    };
    let before = |k: usize| match readings {
        [.., first, coarse, _] => 0.5 * step(k, coarse, first),
        _ => 0.0,
    };
    let lux = &fine.lux;
    let widest: Vec<f64> = (0..lux.len()).map(|k| step(k, fine, coarse).max(before(k))).collect();
    let mut relative: Vec<f64> = (0..lux.len()).filter(|k| lux[*k] != 0.0).map(|k| widest[k] / lux[k].abs()).collect();
    relative.sort_by(f64::total_cmp);
    let usual = relative.get(relative.len() * 9 / 10).copied().unwrap_or(0.0);
    let bound = |k: usize| widest[k].max(usual * lux[k].abs()) + FLOOR * lux[k].abs();
    (0..lux.len()).map(|k| Bounded { value: lux[k], bound: bound(k) }).collect()
}
