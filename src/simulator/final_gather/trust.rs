//! How much of what nodes may be off they are off: measured, since two solutions are there, one of smaller rectangles.
//!
//! What polynomials leave out is of either sign and nearly without a mean; what it does to the nodes of all others is added up as
//! if it were all of one. Light at the nodes of the coarser solution tells, where the finer one has it, how far off it was; held against
//! what it might have been off, that is a part that goes down from solution to solution, since what is left out cancels the better,
//! the smaller rectangles are.

use super::bicubic::{Bicubic, NODES};
use super::patches::Patch;

/// Times what was found that is counted on.
const SAFETY: f64 = 3.0;
/// A finer solution that may be off by more than this part of what the coarser one may be tells nothing of that.
const FINER: f64 = 0.75;

/// How far off light at the nodes of each rectangle may be: some more, some less; and on the mean.
#[derive(Clone, Debug, Default)]
pub(super) struct Off {
    pub(super) uneven_lux: Vec<f64>,
    pub(super) mean_lux: Vec<f64>,
}

/// A solution, as it is held against another.
pub(super) struct Solved<'a> {
    pub(super) patches: &'a [Patch],
    pub(super) lux: &'a [[f64; NODES]],
    /// Because of what polynomials leave out.
    pub(super) off: &'a Off,
}

/// The part of [`Off`] that counts of each rectangle.
#[derive(Clone, Debug, Default)]
pub(super) struct Trust {
    pub(super) uneven: Vec<f64>,
    pub(super) mean: Vec<f64>,
}

impl Trust {
    /// All of it, where nothing is measured.
    pub(super) fn none(count: usize) -> Self {
        Self { uneven: vec![1.0; count], mean: vec![1.0; count] }
    }

    /// What a finer solution says, each of whose rectangles is a part of one of the coarser solution, or that itself.
    pub(super) fn measured(
        bicubic: &Bicubic,
        coarse: &Solved,
        fine: &Solved,
        parents: &[usize],
        before: &Self,
    ) -> Self {
        let count = coarse.patches.len();
        let mut parts: Vec<Vec<usize>> = vec![vec![]; count];
        for (k, parent) in parents.iter().enumerate() {
            parts[*parent].push(k);
        }
        let found: Vec<[f64; 2]> = (0..count).map(|p| off(bicubic, coarse, fine, p, &parts[p])).collect();
        let areas: Vec<f64> = coarse.patches.iter().map(Patch::area_m2).collect();
        let trust = |of: usize, coarse_lux: &[f64], fine_lux: &[f64], before: &[f64]| -> Vec<f64> {
            // What the finer solution may be off as well tells nothing.
            let told = |p: usize| {
                let sum: f64 = parts[p].iter().map(|k| fine.patches[*k].area_m2() * fine_lux[*k]).sum();
                coarse_lux[p] - sum / areas[p]
            };
            let told: Vec<f64> = (0..count).map(told).collect();
            let mean = |values: &dyn Fn(usize) -> f64| {
                (0..count).map(|p| areas[p] * values(p)).sum::<f64>() / areas.iter().sum::<f64>()
            };
            let all = mean(&|p| found[p][of].powi(2)).sqrt() / mean(&|p| told[p].max(0.0)).max(f64::MIN_POSITIVE);
            let one = |k: usize| {
                let p = parents[k];
                let least = (1.0 - FINER) * coarse_lux[p];
                let own = SAFETY * (found[p][of] / told[p].max(least).max(f64::MIN_POSITIVE)).max(all);
                // Where nothing became finer, what was known before holds, unless it is seen not to.
                if told[p] >= least { own.min(1.0) } else { own.max(before[p]).min(1.0) }
            };
            (0..parents.len()).map(one).collect()
        };
        Self {
            uneven: trust(0, &coarse.off.uneven_lux, &fine.off.uneven_lux, &before.uneven),
            mean: trust(1, &coarse.off.mean_lux, &fine.off.mean_lux, &before.mean),
        }
    }
}

/// How far off the nodes of a rectangle of the coarser solution are by the finer one, unevenly and on the mean.
fn off(bicubic: &Bicubic, coarse: &Solved, fine: &Solved, p: usize, parts: &[usize]) -> [f64; 2] {
    let patch = &coarse.patches[p];
    let change = |node: usize| {
        let at_m = patch.corner_m + bicubic.node(node) * patch.size_m;
        let within = |k: &&usize| {
            let Patch { corner_m, size_m, .. } = fine.patches[**k];
            at_m.cmpge(corner_m).all() && at_m.cmple(corner_m + size_m).all()
        };
        let lux = parts.iter().find(within).map(|k| {
            let Patch { corner_m, size_m, .. } = fine.patches[*k];
            bicubic.at(&fine.lux[*k], (at_m - corner_m) / size_m)
        });
        lux.map_or(0.0, |lux| lux - coarse.lux[p][node])
    };
    let changes: [f64; NODES] = std::array::from_fn(change);
    let weighed = |of: &dyn Fn(f64) -> f64| -> f64 { (0..NODES).map(|k| bicubic.weight(k) * of(changes[k])).sum() };
    let mean = weighed(&|change| change);
    [weighed(&|change| (change - mean).powi(2)).sqrt(), mean.abs()]
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;
    use glam::DVec2;

    use super::*;

    /// Two rectangles, the second of which is halved: what their nodes are off by the finer solution counts three times.
    #[test]
    fn what_the_coarser_solution_was_off_is_counted_on_in_the_finer_one() {
        let bicubic = Bicubic::new();
        let patch =
            |x: f64, width: f64| Patch { face: 0, corner_m: DVec2::new(x, 0.0), size_m: DVec2::new(width, 1.0) };
        let (coarse, fine) = (vec![patch(0.0, 1.0), patch(1.0, 1.0)], [(0.0, 1.0), (1.0, 0.5), (1.5, 0.5)]);
        let fine: Vec<Patch> = fine.iter().map(|(x, width)| patch(*x, *width)).collect();
        let off = |lux: f64, count: usize| Off { uneven_lux: vec![lux; count], mean_lux: vec![lux; count] };
        let trust = |change: [f64; 2], fine_off: f64| {
            let (coarse_off, fine_off) = (off(1.0, 2), off(fine_off, 3));
            let lux = [[50.0; NODES]; 2];
            let moved = [change[0], change[1], change[1]].map(|change| [50.0 + change; NODES]);
            let coarse = Solved { patches: &coarse, lux: &lux, off: &coarse_off };
            let fine = Solved { patches: &fine, lux: &moved, off: &fine_off };
            Trust::measured(&bicubic, &coarse, &fine, &[0, 1, 1], &Trust::none(2))
        };
        // Off by .1 of the .5 that the finer one may be off less, and less than all are in the root mean square.
        let found = trust([0.1, -0.05], 0.5);
        assert_relative_eq!(found.mean[0], 0.6, max_relative = 1e-12);
        let all = (0.5 * (0.1_f64.powi(2) + 0.05_f64.powi(2))).sqrt() / 0.5;
        assert_relative_eq!(found.mean[2], 3.0 * all, max_relative = 1e-12);
        assert!(found.uneven.iter().all(|part| *part < 1e-9), "{found:?}");
        // No more than all of it; and all of it where nothing became finer.
        assert_eq!(trust([0.4, 0.0], 0.5).mean[0], 1.0);
        assert!(trust([0.01, 0.01], 0.9).mean.iter().all(|part| *part == 1.0));
    }
}
