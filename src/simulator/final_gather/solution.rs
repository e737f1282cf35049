//! Light balanced between rectangles, and how far off that may be.

use rayon::prelude::*;

use super::bicubic::NODES;
use super::given::{Given, Once};
use super::patches::Patch;
use super::seen::{Rows, Seen, Together, together};
use super::trust::{Off, Trust};
use super::view::Left;
use crate::scene::Bounces;
use crate::simulator::gmres;

/// Residual of the system, of the error asked for.
const RESIDUAL: f64 = 1e-3;
/// Reflections after which nothing changes any more.
const MOST_REFLECTIONS: u32 = 4096;
const CONVERGED: f64 = 1e-10;
/// What light at nodes is off comes from what it is off elsewhere: steps of that, which converge like the reflectances' powers.
const STEPS: usize = 200;
const SETTLED: f64 = 1e-3;

/// Light that was reflected at the nodes of all rectangles, before the reflection to the meter.
#[derive(Debug, Default)]
pub(super) struct Solution {
    pub(super) lux: Vec<[f64; NODES]>,
    /// What it comes from, reflected once more: the same, or light of one reflection less.
    pub(super) from: Vec<[f64; NODES]>,
    /// How far off the polynomials between the nodes may be.
    pub(super) error_lux: Vec<f64>,
    /// How far off the nodes may be because of light reflected once and of what rules miss; and because of what polynomials leave out,
    /// and the part of that which counts.
    pub(super) given: Off,
    pub(super) left: Off,
    pub(super) trust: Trust,
    /// What the nodes of each rectangle see of others, and the part of a sum that is left of it by chance.
    pub(super) seen: Vec<Vec<Together>>,
    pub(super) by_chance: Vec<[f64; 2]>,
}

impl Solution {
    /// How far off a rectangle's nodes may be unevenly and on the mean.
    pub(super) fn off_lux(&self, k: usize) -> [f64; 2] {
        [
            self.given.uneven_lux[k] + self.trust.uneven[k] * self.left.uneven_lux[k],
            self.given.mean_lux[k] + self.trust.mean[k] * self.left.mean_lux[k],
        ]
    }

    /// Between rectangles with light reflected once at their nodes; `None` where it was stopped.
    pub(super) fn new(given: &Given, patches: &[Patch], once: &[Once], rows: &Rows) -> Option<Self> {
        let rows = &rows.of_nodes;
        let reflectance: Vec<f64> = patches.iter().map(|patch| given.faces()[patch.face].reflectance).collect();
        let known: Vec<f64> = once.iter().flat_map(|once| once.lux).collect();
        let apply = |u: &[f64]| -> Vec<f64> {
            if given.stop.is_due() {
                return vec![0.0; u.len()];
            }
            let (u, _) = u.as_chunks::<NODES>();
            let of = |seen: &Seen| reflectance[seen.patch as usize] * seen.of(&u[seen.patch as usize]);
            rows.par_iter().map(|row| row.iter().map(of).sum()).collect()
        };
        let (lux, from) = match given.bounces {
            Bounces::Converged => {
                let residual = RESIDUAL * given.accuracy.relative_error;
                let lux = gmres::solve(apply, &known, known.clone(), residual);
                (lux.clone(), lux)
            }
            Bounces::AtMost(0 | 1) => (vec![0.0; known.len()], vec![0.0; known.len()]),
            Bounces::AtMost(most) => {
                let (mut lux, mut from) = (known.clone(), vec![0.0; known.len()]);
                for _ in 2..most.min(MOST_REFLECTIONS) {
                    let next: Vec<f64> = known.iter().zip(apply(&lux)).map(|(known, more)| known + more).collect();
                    let change = next.iter().zip(&lux).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                    let scale = next.iter().copied().fold(0.0, f64::max);
                    from = std::mem::replace(&mut lux, next);
                    if change <= CONVERGED * scale || given.stop.is_due() {
                        break;
                    }
                }
                (lux, from)
            }
        };
        if given.stop.is_due() {
            return None;
        }
        let [lux, from] = [lux, from].map(|lux| lux.as_chunks::<NODES>().0.to_vec());
        let error_lux: Vec<f64> = lux.iter().map(|lux| given.bicubic.left_out(lux).element_sum()).collect();
        let most: Vec<f64> = lux.iter().map(|lux| lux.iter().fold(0.0_f64, |most, v| most.max(v.abs()))).collect();
        let (by_patch, _) = rows.as_chunks::<NODES>();
        let seen: Vec<Vec<Together>> = by_patch.par_iter().map(|rows| together(given.bicubic, rows)).collect();
        let own_lux: Vec<f64> = {
            let residual_lux = RESIDUAL * given.accuracy.relative_error * given.mean_lux();
            once.iter().map(|once| once.off_lux + residual_lux).collect()
        };
        let missed_lux = |seen: &Together| reflectance[seen.patch as usize] * seen.missed * most[seen.patch as usize];
        let most_lux = most.iter().copied().fold(0.0, f64::max);
        let (given_off, _) = settled(given, &seen, &reflectance, most_lux, |i, seen| match seen {
            None => [own_lux[i]; 2],
            Some(seen) => [0.0, missed_lux(seen)],
        })?;
        let (left, by_chance) = settled(given, &seen, &reflectance, most_lux, |_, seen| match seen {
            None => [0.0; 2],
            Some(seen) => [seen.worst_left, seen.left]
                .map(|left| left * reflectance[seen.patch as usize] * error_lux[seen.patch as usize]),
        })?;
        let trust = Trust::none(patches.len());
        Some(Self { lux, from, error_lux, given: given_off, left, trust, seen, by_chance })
    }
}

/// How far off light at nodes is, what comes from each rectangle unevenly and on the mean added to what is off there: to some nodes it
/// comes more, to others less. No more than all light, where rectangles are too large to tell. And the parts of both sums that are left by chance.
fn settled(
    given: &Given,
    all: &[Vec<Together>],
    reflectance: &[f64],
    most_lux: f64,
    comes: impl Fn(usize, Option<&Together>) -> [f64; 2] + Sync,
) -> Option<(Off, Vec<[f64; 2]>)> {
    let mut off = Off { uneven_lux: vec![0.0; all.len()], mean_lux: vec![0.0; all.len()] };
    let mut by_chance = vec![[1.0; 2]; all.len()];
    for _ in 0..STEPS {
        if given.stop.is_due() {
            return None;
        }
        let of = |(i, seen): (usize, &Vec<Together>)| {
            let (mut even, mut uneven, mut mean) = (Left::default(), Left::default(), 0.0);
            for seen in seen {
                let k = seen.patch as usize;
                let [own_uneven, own_even] = comes(i, Some(seen));
                even.add(own_even + reflectance[k] * seen.uneven * off.uneven_lux[k]);
                uneven.add(own_uneven + reflectance[k] * seen.worst_uneven * off.uneven_lux[k]);
                mean += reflectance[k] * seen.factor * off.mean_lux[k];
            }
            let [own_uneven, own_even] = comes(i, None);
            let parts = [even, uneven].map(|left| left.by_chance() / left.sum.max(f64::MIN_POSITIVE));
            let [uneven_lux, mean_lux] = [own_uneven + uneven.by_chance(), own_even + even.by_chance() + mean];
            (uneven_lux.min(most_lux), mean_lux.min(most_lux), parts)
        };
        let next: Vec<(f64, f64, [f64; 2])> = all.par_iter().enumerate().map(of).collect();
        let change = next.iter().zip(&off.mean_lux).map(|((_, a, _), b)| (a - b).abs()).fold(0.0, f64::max);
        let scale = next.iter().map(|(_, off, _)| *off).fold(0.0, f64::max);
        for (k, next) in next.into_iter().enumerate() {
            (off.uneven_lux[k], off.mean_lux[k], by_chance[k]) = next;
        }
        if change <= SETTLED * scale {
            break;
        }
    }
    Some((off, by_chance))
}
