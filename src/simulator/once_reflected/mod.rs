//! Light of luminaires without extent, reflected once between axis-aligned boxes and plates: integrated over what is both
//! lit and seen, as convex pieces, so that no edge of a shadow is within.

mod faces;
#[cfg(test)]
mod tests;

use rayon::prelude::*;

use super::Bounded;
use super::emission::{Emitter, Precision};
use super::stop::Stop;
use super::visibility::Occluder;
use crate::scene::{Meter, Scene};
use faces::Face;

/// Bodies beyond which pieces are too many.
const MOST_BODIES: usize = 40;

/// A scene of which that can be told.
#[derive(Debug)]
pub(super) struct OnceReflected {
    faces: Vec<Face>,
    occluders: Vec<Occluder>,
    emitters: Vec<Emitter>,
}

impl OnceReflected {
    /// `None` without a room, where a body is no axis-aligned box or plate, or a luminaire has an extent.
    pub(super) fn new(scene: &Scene) -> Option<Self> {
        let room = scene.room?;
        let bodies = faces::bodies(&room, &scene.obstacles)?;
        let emitters: Vec<Emitter> = scene.luminaires.iter().map(Emitter::new).collect();
        if bodies.len() > MOST_BODIES || !emitters.iter().all(Emitter::is_point) {
            return None;
        }
        // What lies flat on a surface of the room covers it and hides nothing else.
        let stands = |b: &&faces::Body| !faces::lies_flat(&room, &b.shape);
        let occluders = bodies.iter().filter(stands).map(|b| b.shape).collect();
        Some(Self { faces: faces::faces(&room, &bodies), occluders, emitters })
    }

    /// Illuminance at the meters, as far as it comes before it is stopped.
    pub(super) fn illuminance(&self, meters: &[Meter], relative_error: f64, stop: &Stop) -> Vec<Bounded> {
        let precision = Precision::relative(relative_error.clamp(1e-9, 1e-3));
        let at = |meter: &Meter| {
            let mut sum = Bounded::default();
            for face in &self.faces {
                for emitter in &self.emitters {
                    if stop.is_due() {
                        return Bounded::UNREAD;
                    }
                    let Bounded { value, bound } =
                        emitter.reflected(meter, &face.corners_m, face.normal, &self.occluders, precision);
                    sum = sum + Bounded { value: face.reflectance * value, bound: face.reflectance * bound };
                }
            }
            // Clipping and the angles round.
            Bounded { bound: sum.bound + 1e-11 * sum.value, ..sum }
        };
        meters.par_iter().map(at).collect()
    }
}
