//! What the nodes of rectangles see of all rectangles, and what of that is left of what their polynomials leave out.

use rayon::prelude::*;

use super::bicubic::{Bicubic, NODES};
use super::face::Face;
use super::given::Given;
use super::patches::Patch;
use super::view::{Before, Shown};
use crate::scene::Meter;

/// Steps of a weight, of the largest: 16 of them off by half a step each are off by 1e-5 of what they add up to.
const STEPS: f64 = i16::MAX as f64;

/// What a node sees of a rectangle: its weights in steps, since there are many of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Seen {
    pub(super) patch: u32,
    step: f32,
    missed: f32,
    weights: [i16; NODES],
}

impl Seen {
    fn new(patch: usize, weights: &[f64; NODES], missed: f64) -> Self {
        let most = weights.iter().fold(f64::MIN_POSITIVE, |most, w| most.max(w.abs()));
        // To the nearest step: `round` is a call of the C library for each weight.
        let steps = weights.map(|w| (w / most * STEPS + 0.5_f64.copysign(w)) as i16);
        Self { patch: patch as u32, step: (most / STEPS) as f32, missed: missed as f32, weights: steps }
    }

    fn weights(&self) -> [f64; NODES] {
        self.weights.map(|w| f64::from(w) * f64::from(self.step))
    }

    /// The sum of values at the rectangle's nodes, weighed.
    pub(super) fn of(&self, values: &[f64; NODES]) -> f64 {
        f64::from(self.step) * self.weights.iter().zip(values).map(|(w, v)| f64::from(*w) * v).sum::<f64>()
    }
}

/// Goes through what a meter sees of all rectangles.
pub(super) fn for_all_shown(given: &Given, patches: &[Patch], meter: &Meter, each: impl FnMut(usize, &Face, &Shown)) {
    for_some_shown(given, patches, meter, |_| true, each);
}

/// The same of some rectangles.
fn for_some_shown(
    given: &Given,
    patches: &[Patch],
    meter: &Meter,
    is_wanted: impl Fn(usize) -> bool,
    mut each: impl FnMut(usize, &Face, &Shown),
) {
    let view = given.view(meter);
    let before: Vec<Option<Before>> = given.faces().iter().map(|face| view.before(face)).collect();
    for (k, patch) in patches.iter().enumerate().filter(|(k, _)| is_wanted(*k)) {
        let shown = before[patch.face].as_ref().and_then(|before| before.of(patch.corner_m, patch.size_m));
        if let Some(shown) = shown {
            each(k, &given.faces()[patch.face], &shown);
        }
    }
}

/// What every node of some rectangles sees of them all.
#[derive(Debug, Default)]
pub(super) struct Rows {
    patches: Vec<Patch>,
    /// For each node in turn what it sees, in the order of rectangles.
    pub(super) of_nodes: Vec<Vec<Seen>>,
}

impl Rows {
    /// Of these rectangles: what those of before see of each other, in the same places, is not looked at again. `None` where it was stopped.
    pub(super) fn of(given: &Given, patches: &[Patch], before: Self) -> Option<Self> {
        let is_same: Vec<bool> = (0..patches.len()).map(|k| before.patches.get(k) == Some(&patches[k])).collect();
        let row = |meter: &Meter, known: Option<Vec<Seen>>| -> Vec<Seen> {
            if given.stop.is_due() {
                return vec![];
            }
            let is_new = |k: usize| known.is_none() || !is_same[k];
            let mut new = Vec::with_capacity(patches.len());
            for_some_shown(given, patches, meter, is_new, |k, _, shown| {
                let weights = shown.weights();
                new.push(Seen::new(k, &weights.of_nodes, weights.error));
            });
            if let Some(known) = known {
                new.extend(known.into_iter().filter(|seen| is_same[seen.patch as usize]));
                new.sort_by_key(|seen| seen.patch);
            }
            new
        };
        let mut before: Vec<Option<Vec<Seen>>> = before.of_nodes.into_iter().map(Some).collect();
        before.resize(patches.len() * NODES, None);
        let of_patch = |(k, before): (usize, &mut [Option<Vec<Seen>>])| -> Vec<Vec<Seen>> {
            let nodes = patches[k].nodes(given.faces(), given.bicubic);
            nodes.iter().zip(before).map(|(node, before)| row(node, before.take().filter(|_| is_same[k]))).collect()
        };
        let rows: Vec<Vec<Vec<Seen>>> = before.par_chunks_mut(NODES).enumerate().map(of_patch).collect();
        let of_nodes = rows.into_iter().flatten().collect();
        (!given.stop.is_due()).then(|| Self { patches: patches.to_vec(), of_nodes })
    }
}

/// What the nodes of a rectangle see of another.
#[derive(Clone, Copy, Debug)]
pub(super) struct Together {
    pub(super) patch: u32,
    /// On the mean: its factor, and what is left of what has no terms up to degree 3, and of what has no mean.
    pub(super) factor: f64,
    pub(super) left: f64,
    pub(super) uneven: f64,
    pub(super) missed: f64,
    /// The same in the root mean square of all nodes.
    pub(super) worst_left: f64,
    pub(super) worst_uneven: f64,
}

pub(super) fn together(bicubic: &Bicubic, rows: &[Vec<Seen>; NODES]) -> Vec<Together> {
    let part = 1.0 / NODES as f64;
    let mut rows = rows.each_ref().map(|row| row.iter().peekable());
    let mut all = vec![];
    // Each row sees rectangles in their order.
    while let Some(patch) = rows.iter_mut().filter_map(|row| row.peek().map(|seen| seen.patch)).min() {
        let mut weights = [0.0; NODES];
        let (mut missed, mut squares) = (0.0, [0.0; 2]);
        for seen in rows.iter_mut().filter_map(|row| row.next_if(|seen| seen.patch == patch)) {
            let own = seen.weights();
            for (sum, own) in weights.iter_mut().zip(own) {
                *sum += part * own;
            }
            missed += part * f64::from(seen.missed);
            for (square, left) in squares.iter_mut().zip(bicubic.left_of(&own)) {
                *square += part * left * left;
            }
        }
        let [left, uneven] = bicubic.left_of(&weights);
        let [worst_left, worst_uneven] = squares.map(f64::sqrt);
        let factor = weights.iter().sum();
        all.push(Together { patch, factor, left, uneven, missed, worst_left, worst_uneven });
    }
    all
}
