//! What light is balanced with: faces, what is known of light straight from the luminaires, and how well light is to be known.

use rayon::prelude::*;

use super::bicubic::{Bicubic, NODES};
use super::face::{Face, mean_wall_m2};
use super::lit::{Lights, Lit};
use super::patches::Patch;
use super::view::{Left, View};
use crate::scene::{Bounces, Meter};
use crate::simulator::Accuracy;
use crate::simulator::stop::Stop;
use crate::simulator::visibility::Occluder;

/// Where less is asked for, rays take longer than rectangles.
pub(super) const FINE: f64 = 5e-3;
/// What large rectangles may be off of light reflected once at one node of many, each, of the error asked for.
const OF_LIT_AT_NODES: f64 = 3e-2;
/// Rectangles at most where no less than [`FINE`] is asked for, the power of the error by which they may be more, and at most in any case:
/// what nodes see takes 44 bytes for each node and each rectangle that it sees, 130 MiB and 1.2 GiB together.
const MOST: f64 = 512.0;
const MORE: f64 = 0.36;
const MOST_OF_ALL: f64 = 1650.0;
/// Of all light so much is reflected at most, for a guess.
const MOST_REFLECTED: f64 = 0.95;

/// Light reflected once at a rectangle's nodes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Once {
    pub(super) lux: [f64; NODES],
    pub(super) off_lux: f64,
}

/// What it takes.
#[derive(Clone, Copy)]
pub(super) struct Given<'a> {
    pub(super) lights: Lights<'a>,
    pub(super) lit: &'a Lit,
    pub(super) occluders: &'a [Occluder],
    pub(super) bounces: Bounces,
    pub(super) accuracy: Accuracy,
    pub(super) stop: &'a Stop,
    pub(super) bicubic: &'a Bicubic,
}

impl<'a> Given<'a> {
    pub(super) fn view<'b>(&'b self, meter: &'b Meter) -> View<'b> {
        View { meter, occluders: self.occluders, bicubic: self.bicubic }
    }

    /// The mean over all faces of light reflected once, in lm/m².
    pub(super) fn mean_lux(&self) -> f64 {
        self.lit.mean_exitance(self.faces())
    }

    /// Rectangles at most: each of their nodes looks at each, which takes as long as a ray.
    pub(super) fn most(&self) -> usize {
        let affordable = self.stop.rays.map_or(f64::INFINITY, |rays| (rays as f64 / (3 * NODES) as f64).sqrt());
        let finer = (FINE / self.accuracy.relative_error).max(1.0);
        (MOST * finer.powf(MORE)).min(MOST_OF_ALL).min(affordable) as usize
    }

    /// Times more that light is which is reflected at all than light reflected once.
    pub(super) fn amplification(&self) -> f64 {
        let faces = self.faces();
        let reflected: f64 = faces.iter().map(|face| face.reflectance * face.area_m2()).sum();
        1.0 / (1.0 - (reflected / faces.iter().map(Face::area_m2).sum::<f64>()).min(MOST_REFLECTED))
    }

    /// Light reflected once at the nodes of rectangles.
    pub(super) fn once(&self, patches: &[Patch]) -> Option<Vec<Once>> {
        let one = |patch: &Patch| {
            let mut once = Once { lux: [0.0; NODES], off_lux: 0.0 };
            for (lux, meter) in once.lux.iter_mut().zip(patch.nodes(self.faces(), self.bicubic)) {
                if self.stop.is_due() {
                    return once;
                }
                let (value, left) = self.once_at(&meter);
                *lux = value;
                // At one node of many: none of their errors is any other's.
                once.off_lux += left.by_chance() / NODES as f64;
            }
            once
        };
        let all = patches.par_iter().map(one).collect();
        (!self.stop.is_due()).then_some(all)
    }

    /// Light reflected once at one place of many, and what it may be off.
    pub(super) fn once_at(&self, meter: &Meter) -> (f64, Left) {
        let tolerance_lux = OF_LIT_AT_NODES * self.accuracy.relative_error * self.mean_lux();
        self.lit.shown_of_all(&self.view(meter), self.faces(), tolerance_lux)
    }

    pub(super) fn faces(&self) -> &'a [Face] {
        &self.lights.surroundings.faces
    }

    pub(super) fn wall_m2(&self) -> f64 {
        self.lights.surroundings.room.map_or(1.0, |room| mean_wall_m2(room.size_m))
    }
}
