//! Reflected light on the faces, solved once: nodes gather along rays, and what the rays end on is the unknown itself.
//!
//! Irradiance by reflected light u obeys u = T (D + u), D the light straight from the luminaires, T reflection and
//! transport. Every replicate has rays of its own at every node and solves its own system, so that the scatter of the
//! replicates holds all chance there is: of the nodes, of the reflections between them and of the meter itself.

use glam::DVec2;
use rayon::prelude::*;

use super::REPLICATES;
use super::bicubic::NODES;
use super::face::Cover;
use super::grid::Grid;
use super::lit::Limit;
use super::rays::{End, Rays};
use crate::scene::{Bounces, Meter};
use crate::simulator::sampler::{Sampler, mix};
use crate::simulator::stop::Stop;
use crate::simulator::{Accuracy, gmres};

/// Reflections that are kept apart where only so many count; what goes further has no share to speak of.
const KEPT_APART: usize = 24;
/// What another reflection adds that is not worth one.
const CONVERGED: f64 = 1e-9;

/// What is left of a system's residual, of the error asked for.
const RESIDUAL: f64 = 1e-3;
/// How many times fewer rays nodes of small rectangles have at most, as a power of two, and how few.
const LESS_LOG2: f64 = 3.0;
const FEWEST: u32 = 8;

/// Irradiance by reflected light at the nodes of all faces, by replicate.
#[derive(Debug)]
pub(super) struct Field {
    /// By number of reflections: all of them at index 0; where only so many count, one fewer at each index.
    orders: Vec<Vec<Vec<[f64; NODES]>>>,
    /// The means of all replicates.
    means: Vec<Vec<[f64; NODES]>>,
    /// Reflections that count at index 0 where only so many do, or after which nothing changed any more.
    reflections: u32,
    /// How far off each rectangle's polynomial may be, in lux.
    pub(super) error_lux: Vec<f64>,
    /// Standard error of each rectangle's mean.
    pub(super) noise_lux: Vec<f64>,
    /// Mean over the nodes.
    pub(super) mean_lux: f64,
}

/// What a node's rays found.
struct Node {
    /// Light by number of reflections.
    lux: Vec<f64>,
    ends: Vec<End>,
}

impl Field {
    /// Solves by so many rays a node and replicate. `None` where it was stopped.
    pub(super) fn solve(
        grid: &Grid,
        rays: &Rays,
        bounces: Bounces,
        count: u32,
        Accuracy { relative_error, seed }: Accuracy,
        stop: &Stop,
    ) -> Option<Self> {
        let most = match bounces {
            Bounces::Converged => u32::MAX,
            Bounces::AtMost(n) => n.saturating_sub(1),
        };
        let mut replicates: Vec<(u32, Vec<Vec<[f64; NODES]>>)> = vec![];
        for replicate in 0..REPLICATES as u64 {
            let scramble = mix(mix(seed).wrapping_add(0xf1e1d << 20 | replicate));
            let nodes = gather(grid, rays, most, count, scramble, stop)?;
            let guess = replicates.last().map(|(_, solutions)| solutions[0].as_slice());
            replicates.push(solved(grid, &nodes, bounces, most, guess, RESIDUAL * relative_error, stop));
        }
        if stop.is_due() {
            return None;
        }
        let reflections = replicates.iter().map(|(reflections, _)| *reflections).min().unwrap_or(0);
        let depth = replicates.iter().map(|(_, solutions)| solutions.len()).min().unwrap_or(0);
        let orders: Vec<Vec<Vec<[f64; NODES]>>> = (0..depth)
            .map(|order| replicates.iter().map(|(_, solutions)| solutions[order].clone()).collect())
            .collect();
        let finest: Vec<Vec<[f64; NODES]>> =
            (0..grid.len()).map(|k| orders.first().into_iter().flatten().map(|r| r[k]).collect()).collect();
        let noise = |values: &Vec<[f64; NODES]>| {
            let means: Vec<f64> = values.iter().map(|v| v.iter().sum::<f64>() / NODES as f64).collect();
            let mean = means.iter().sum::<f64>() / REPLICATES as f64;
            let square: f64 = means.iter().map(|m| (m - mean).powi(2)).sum();
            (square / (REPLICATES * (REPLICATES - 1)) as f64).sqrt()
        };
        let all = || finest.iter().flatten().flatten();
        let mean_lux = all().sum::<f64>() / all().count().max(1) as f64;
        let (error_lux, noise_lux) = (grid.bicubic.tails(&finest), finest.iter().map(noise).collect());
        let means = orders.iter().map(|order| (0..grid.len()).map(|k| mean(order, k)).collect()).collect();
        Some(Self { orders, means, reflections, error_lux, noise_lux, mean_lux })
    }

    /// Reflected light where a ray ended, of those that count, and how much of it is this replicate's chance.
    pub(super) fn at(&self, grid: &Grid, end: &End, replicate: usize, bounces: Bounces) -> (f64, f64) {
        let order = match bounces {
            Bounces::Converged => 0,
            Bounces::AtMost(most) if end.reflections >= most => return (0.0, 0.0),
            // Beyond what is kept apart there is no share to speak of.
            Bounces::AtMost(most) => {
                let fewer = self.reflections.saturating_sub(most - end.reflections);
                (fewer as usize).min(self.orders.len() - 1)
            }
        };
        let rectangle = end.spot.rectangle as usize;
        let [lux, mean] = [&self.orders[order][replicate], &self.means[order]]
            .map(|values| end.weight * grid.bicubic.at(&values[rectangle], at(end)));
        (lux, lux - mean)
    }
}

/// The mean of all replicates at a rectangle's nodes.
fn mean(replicates: &[Vec<[f64; NODES]>], rectangle: usize) -> [f64; NODES] {
    std::array::from_fn(|node| replicates.iter().map(|r| r[rectangle][node]).sum::<f64>() / replicates.len() as f64)
}

fn at(end: &End) -> DVec2 {
    DVec2::new(f64::from(end.spot.t[0]), f64::from(end.spot.t[1]))
}

/// The rays of all nodes of one replicate; nodes under bodies have none.
fn gather(grid: &Grid, rays: &Rays, most: u32, count: u32, scramble: u64, stop: &Stop) -> Option<Vec<Node>> {
    let one = |index: usize| -> Option<[Node; NODES]> {
        let covered = grid.cover(index) == Cover::Whole;
        let (face, nodes) = grid.nodes(index);
        if stop.is_due() {
            return None;
        }
        // Small rectangles matter less.
        let less = (1.0 / grid.part(index)).log2().floor().clamp(0.0, LESS_LOG2) as u32;
        let count = (count >> less).max(FEWEST.min(count));
        let part = 1.0 / f64::from(count);
        Some(std::array::from_fn(|k| {
            let mut node = Node { lux: vec![], ends: vec![] };
            if covered || face.reflectance == 0.0 || most == 0 {
                return node;
            }
            let meter = Meter { position_m: nodes[k], normal: face.normal };
            let own = mix(scramble ^ ((index * NODES + k) as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15));
            for ray in 0..count {
                let found = rays.follow(&meter, &mut Sampler::new(own, ray), most, Limit::NONE);
                for (reflections, lux) in found.lux {
                    let slot = (reflections as usize).min(KEPT_APART);
                    if node.lux.len() <= slot {
                        node.lux.resize(slot + 1, 0.0);
                    }
                    node.lux[slot] += part * lux;
                }
                node.ends.extend(found.end.map(|end| End { weight: part * end.weight, ..end }));
            }
            node
        }))
    };
    let nodes: Option<Vec<[Node; NODES]>> = (0..grid.len()).into_par_iter().map(one).collect();
    Some(nodes?.into_iter().flatten().collect())
}

/// Irradiance at the nodes, by number of reflections that count, most first; from a guess, where all count.
fn solved(
    grid: &Grid,
    nodes: &[Node],
    bounces: Bounces,
    most: u32,
    guess: Option<&[[f64; NODES]]>,
    tolerance: f64,
    stop: &Stop,
) -> (u32, Vec<Vec<[f64; NODES]>>) {
    let asked = |u: &[[f64; NODES]], end: &End| end.weight * grid.bicubic.at(&u[end.spot.rectangle as usize], at(end));
    if bounces == Bounces::Converged {
        let known: Vec<f64> = nodes.iter().map(|node| node.lux.iter().sum()).collect();
        let apply = |u: &[f64]| -> Vec<f64> {
            if stop.is_due() {
                return vec![0.0; u.len()];
            }
            let (u, _) = u.as_chunks::<NODES>();
            nodes.par_iter().map(|node| node.ends.iter().map(|end| asked(u, end)).sum()).collect()
        };
        let first = guess.map_or_else(|| known.clone(), |guess| guess.as_flattened().to_vec());
        let found = gmres::solve(apply, &known, first, tolerance);
        return (0, vec![found.as_chunks::<NODES>().0.to_vec()]);
    }
    // Light reflected at most k times before it arrives, for k up to one less than what counts at a meter.
    let mut solutions: Vec<Vec<[f64; NODES]>> = vec![vec![[0.0; NODES]; grid.len()]];
    let mut reflections = 0;
    for k in 1..=most {
        let one = |node: &Node| {
            let lux: f64 = node.lux.iter().take(k as usize + 1).sum();
            let further = node.ends.iter().filter(|end| end.reflections <= k);
            lux + further
                .map(|e| asked(&solutions[solutions.len().saturating_sub(e.reflections as usize)], e))
                .sum::<f64>()
        };
        let next: Vec<f64> = nodes.par_iter().map(one).collect();
        let next = next.as_chunks::<NODES>().0.to_vec();
        let before = solutions[solutions.len() - 1].as_flattened();
        let change = next.as_flattened().iter().zip(before).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let scale = next.as_flattened().iter().copied().fold(0.0, f64::max);
        solutions.push(next);
        reflections = k;
        if change <= CONVERGED * scale && k > 1 || stop.is_due() {
            break;
        }
        if solutions.len() > KEPT_APART {
            solutions.remove(0);
        }
    }
    solutions.reverse();
    (reflections, solutions)
}
