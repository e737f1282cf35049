//! What rectangles leave out that a meter is close to, which is measured: light of the solution comes there once more.

use glam::DVec2;

use super::given::Given;
use super::patches::Patch;
use super::seen::for_all_shown;
use super::solution::Solution;
use crate::scene::{Bounces, Meter};

/// A meter is close to a rectangle within this part of its longer side, about as far as the nodes are from its edge.
const CLOSE: f64 = 0.1;
/// Places where what it leaves out is measured: that part of it inside its edges, and so many times as far about the nearest as the meter is off.
const INSIDE: f64 = 0.005;
const ABOUT: f64 = 2.0;
/// Times the most that is found that counts: places between may leave out more.
const OF_CLOSE: f64 = 2.0;

impl Solution {
    /// What rectangles leave out that a meter is close to, each with what that may bring to it: between a rectangle's outer nodes and its edge one
    /// sees it as it is, and what is left out across an edge is found on both sides.
    pub(super) fn close(&self, given: &Given, patches: &[Patch], meter: &Meter) -> Vec<(usize, f64)> {
        let (mut close, mut most_lux) = (vec![], 0.0_f64);
        if matches!(given.bounces, Bounces::AtMost(0 | 1)) {
            return close;
        }
        for_all_shown(given, patches, meter, |k, face, shown| {
            let Patch { corner_m, size_m, .. } = patches[k];
            let foot_m = face.on(meter.position_m);
            let nearest_m = foot_m.clamp(corner_m, corner_m + size_m);
            let distance_m = face.is_before_m(meter.position_m).hypot(foot_m.distance(nearest_m));
            if distance_m >= CLOSE * size_m.max_element() {
                return;
            }
            let about_m = ABOUT * distance_m;
            let steps_m = [[0.0, 0.0], [about_m, 0.0], [-about_m, 0.0], [0.0, about_m], [0.0, -about_m]];
            let [low, high] = [INSIDE, 1.0 - INSIDE].map(|t| corner_m + t * size_m);
            let at = |step: [f64; 2]| (nearest_m + DVec2::from_array(step)).clamp(low, high);
            let left_out =
                steps_m.iter().map(|step| self.left_out_lux(given, patches, k, at(*step)).abs()).fold(0.0, f64::max);
            most_lux = most_lux.max(left_out);
            close.push((k, OF_CLOSE * face.reflectance * shown.factor));
        });
        close.into_iter().map(|(k, part)| (k, part * most_lux)).collect()
    }

    /// What a rectangle's polynomial leaves out at a place of it: light comes there from all others.
    fn left_out_lux(&self, given: &Given, patches: &[Patch], k: usize, at_m: DVec2) -> f64 {
        let Patch { face, corner_m, size_m } = patches[k];
        let face = &given.faces()[face];
        let meter = Meter { position_m: face.off(at_m), normal: face.normal };
        let (mut lux, _) = given.once_at(&meter);
        for_all_shown(given, patches, &meter, |j, face, shown| {
            let of_nodes = shown.weights().of_nodes;
            lux += face.reflectance * of_nodes.iter().zip(&self.from[j]).map(|(w, v)| w * v).sum::<f64>();
        });
        lux - given.bicubic.at(&self.lux[k], (at_m - corner_m) / size_m)
    }
}
