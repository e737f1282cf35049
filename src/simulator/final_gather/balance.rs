//! Reflected light where all that reflects is a known face, without chance: light comes to the nodes of rectangles from what they
//! see of all others, exactly cut, and the rectangles are halved until what their polynomials leave out is little at the meters.
//!
//! Irradiance by reflected light u obeys u = T (D + u), D the light straight from the luminaires, T reflection and transport.
//! Collocation at Gauss's nodes solves that for a u of polynomials; what they leave out comes back to all other nodes, and is solved
//! for with the same kernel, so that a bound holds of all of it.

use glam::DVec2;
use rayon::prelude::*;

use super::bicubic::{Bicubic, NODES};
use super::face::{Face, mean_wall_m2};
use super::lit::{Lights, Lit};
use super::patches::{Cover, Patch};
use super::view::{Before, Left, Shown, View};
use crate::scene::{Bounces, Meter};
use crate::simulator::stop::Stop;
use crate::simulator::visibility::Occluder;
use crate::simulator::{Accuracy, Bounded, gmres};

/// What large rectangles may be off of light reflected once, each, of the error asked for: at a meter, and at one node of many.
const OF_LIT: f64 = 3e-3;
const OF_LIT_AT_NODES: f64 = 3e-2;
/// What a rectangle of a wall's size may leave out at first, of the error asked for or of a coarse one.
const ANYWHERE: f64 = 0.05;
const COARSE: f64 = 4e-3;
/// What is left of what is wanted, since rectangles once halved leave out less than their share; what is left at most each time; and how often rectangles are made smaller for it.
const WANTED: f64 = 1.2;
const PROGRESS: f64 = 0.6;
const ROUNDS: usize = 5;
/// Halvings of a rectangle before anyone looks again.
const AT_ONCE: u32 = 4;
/// Steps by which what nodes are off is followed back, and of a bisection.
const ADJOINT_STEPS: usize = 12;
const HALVINGS: usize = 40;
/// Rectangles at most: their factors take 80 bytes for each node and each rectangle that it sees, some 300 MiB together.
const MOST: usize = 512;
/// The sides of rectangles at first, of the mean wall.
const SIDE: f64 = 0.6;
/// Residual of the system, of the error asked for.
const RESIDUAL: f64 = 1e-3;
/// Reflections after which nothing changes any more.
const MOST_REFLECTIONS: u32 = 4096;
const CONVERGED: f64 = 1e-10;
/// What light at nodes is off comes from what it is off elsewhere: steps of that, which converge like the reflectances' powers.
const STEPS: usize = 200;
const SETTLED: f64 = 1e-3;
/// Of all light so much is reflected at most, for a guess.
const MOST_REFLECTED: f64 = 0.95;
/// Meters that tell where rectangles matter.
const LOOKED_AT: usize = 64;

/// Reflected light on rectangles.
#[derive(Debug)]
pub(super) struct Balance {
    cover: Cover,
    patches: Vec<Patch>,
    once: Vec<Once>,
    /// What each rectangle's polynomial leaves out along both sides, about.
    tails: Vec<DVec2>,
    /// How often shares were made smaller.
    grown: usize,
    solution: Solution,
}

/// Light that was reflected at the nodes of all rectangles, before the reflection to the meter.
#[derive(Debug, Default)]
struct Solution {
    lux: Vec<[f64; NODES]>,
    /// How far off the polynomials between the nodes may be; the nodes themselves, some more, some less; and on the mean.
    error_lux: Vec<f64>,
    uneven_lux: Vec<f64>,
    off_lux: Vec<f64>,
    /// What the nodes of each rectangle see of others, and the part of a sum that is left of it by chance.
    seen: Vec<Vec<Together>>,
    by_chance: Vec<[f64; 2]>,
}

/// What a node sees of a rectangle.
#[derive(Clone, Copy, Debug)]
struct Seen {
    patch: u32,
    weights: [f32; NODES],
    factor: f32,
    missed: f32,
}

/// Light reflected once at a rectangle's nodes.
#[derive(Clone, Copy, Debug)]
struct Once {
    lux: [f64; NODES],
    off_lux: f64,
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
    fn view<'b>(&'b self, meter: &'b Meter) -> View<'b> {
        View { meter, occluders: self.occluders, bicubic: self.bicubic }
    }

    /// The mean over all faces of light reflected once, in lm/m².
    fn mean_lux(&self) -> f64 {
        self.lit.mean_exitance(self.faces())
    }

    /// Rectangles at most: each of their nodes looks at each, which takes as long as a ray.
    fn most(&self) -> usize {
        let affordable = self.stop.rays.map_or(f64::INFINITY, |rays| (rays as f64 / (3 * NODES) as f64).sqrt());
        MOST.min(affordable as usize)
    }

    /// Times more that light is which is reflected at all than light reflected once.
    fn amplification(&self) -> f64 {
        let faces = self.faces();
        let reflected: f64 = faces.iter().map(|face| face.reflectance * face.area_m2()).sum();
        1.0 / (1.0 - (reflected / faces.iter().map(Face::area_m2).sum::<f64>()).min(MOST_REFLECTED))
    }

    /// Light reflected once at the nodes of rectangles.
    fn once(&self, patches: &[Patch]) -> Option<Vec<Once>> {
        let tolerance_lux = OF_LIT_AT_NODES * self.accuracy.relative_error * self.mean_lux();
        let one = |patch: &Patch| {
            let mut once = Once { lux: [0.0; NODES], off_lux: 0.0 };
            for (lux, meter) in once.lux.iter_mut().zip(patch.nodes(self.faces(), self.bicubic)) {
                if self.stop.is_due() {
                    return once;
                }
                let (value, left) = self.lit.shown_of_all(&self.view(&meter), self.faces(), tolerance_lux);
                *lux = value;
                // At one node of many: none of their errors is any other's.
                once.off_lux += left.by_chance() / NODES as f64;
            }
            once
        };
        let all = patches.par_iter().map(one).collect();
        (!self.stop.is_due()).then_some(all)
    }

    fn faces(&self) -> &'a [Face] {
        &self.lights.surroundings.faces
    }

    fn wall_m2(&self) -> f64 {
        self.lights.surroundings.room.map_or(1.0, |room| mean_wall_m2(room.size_m))
    }
}

/// A meter with what it has of light reflected once.
#[derive(Clone, Copy, Debug)]
pub(super) struct Asked<'a> {
    meter: &'a Meter,
    direct: Bounded,
    once: Bounded,
}

impl<'a> Asked<'a> {
    pub(super) fn new(given: &Given, meter: &'a Meter, direct: Bounded) -> Self {
        let tolerance_lux = OF_LIT * given.accuracy.relative_error * (given.mean_lux() + direct.value);
        if given.stop.is_due() {
            return Self { meter, direct, once: Bounded::UNREAD };
        }
        let (value, left) = given.lit.shown_of_all(&given.view(meter), given.faces(), tolerance_lux);
        Self { meter, direct, once: Bounded { value, bound: left.sum } }
    }

    /// Whether light is known as well as was asked.
    pub(super) fn meets(&self, given: &Given, found: &Bounded) -> bool {
        found.bound + self.direct.bound <= given.accuracy.relative_error * (found.value + self.direct.value)
    }
}

impl Balance {
    /// Rectangles as they are at first, with light reflected once; `None` where it was stopped.
    pub(super) fn new(given: &Given) -> Option<Self> {
        let cover = Cover::new(given.lights.surroundings);
        let side_m = SIDE * given.wall_m2().sqrt();
        let mut open = cover.patches(given.lights.surroundings);
        let mut patches = vec![];
        while let Some(patch) = open.pop() {
            let axis = patch.size_m.max_position();
            if patch.size_m[axis] > side_m { open.extend(cover.halves(&patch, axis)) } else { patches.push(patch) }
        }
        if 2 * patches.len() > given.most() {
            return None;
        }
        let once = given.once(&patches)?;
        let tails = once.iter().map(|once| given.bicubic.left_out(&once.lux)).collect();
        let solution = Solution::default();
        Some(Self { cover, patches, once, tails, grown: 0, solution })
    }

    /// Halves rectangles that leave out too much, and solves: at first where it is too much for any meter, then where it is for
    /// those that were asked and found like this.
    pub(super) fn grow(&mut self, given: &Given, asked: &[(Asked, Bounded)]) -> Option<()> {
        let limits = if self.is_solved() { self.shares(given, asked) } else { self.even_shares(given) };
        let count = self.patches.len();
        self.divide(given, limits)?;
        if self.is_solved() && self.patches.len() == count {
            self.grown = ROUNDS;
            return Some(());
        }
        self.grown += 1;
        self.solution = self.solve(given)?;
        self.tails = self.solution.lux.iter().map(|lux| given.bicubic.left_out(lux)).collect();
        Some(())
    }

    /// What rectangles may leave out where nobody has looked yet: the more, the smaller they are.
    fn even_shares(&self, given: &Given) -> Vec<f64> {
        let error = given.accuracy.relative_error.max(COARSE);
        let of = |patch: &Patch| {
            let part = (patch.area_m2() / given.wall_m2()).sqrt();
            ANYWHERE * error * given.mean_lux() * given.amplification() / (given.faces()[patch.face].reflectance * part)
        };
        self.patches.iter().map(of).collect()
    }

    /// What rectangles may leave out lest it be too much at some meters: what each adds to their bounds, by itself and by what all
    /// nodes are off because of it, becomes the same for all.
    fn shares(&self, given: &Given, asked: &[(Asked, Bounded)]) -> Vec<f64> {
        let Solution { error_lux, seen, by_chance, .. } = &self.solution;
        let count = self.patches.len();
        let reflectance: Vec<f64> = self.patches.iter().map(|patch| given.faces()[patch.face].reflectance).collect();
        let step = asked.len().div_ceil(LOOKED_AT).max(1);
        let looking: Vec<&(Asked, Bounded)> = asked.iter().step_by(step).collect();
        let (mut less, mut own, mut uneven, mut off) = (1.0_f64, vec![0.0; count], vec![0.0; count], vec![0.0; count]);
        for (asked, found) in looking.iter().take_while(|_| !given.stop.is_due()) {
            let error = given.accuracy.relative_error;
            let most_lux = error * (found.value + asked.direct.value) - asked.direct.bound - asked.once.bound;
            let here_lux = found.bound - asked.once.bound;
            if most_lux <= 0.0 || here_lux <= most_lux {
                continue;
            }
            less = less.min(most_lux / here_lux);
            self.for_all_shown(given, asked.meter, |k, face, shown| {
                let [left, left_uneven] = given.bicubic.left_of(&shown.weights().of_nodes);
                let part = face.reflectance / (most_lux * looking.len() as f64);
                own[k] += part * left;
                uneven[k] += part * left_uneven;
                off[k] += part * shown.factor;
            });
        }
        let (first_uneven, first_off) = (uneven.clone(), off.clone());
        for _ in 0..ADJOINT_STEPS {
            let (mut next_uneven, mut next_off) = (first_uneven.clone(), first_off.clone());
            for (i, seen) in seen.iter().enumerate() {
                let [even_part, uneven_part] = by_chance[i];
                for seen in seen {
                    let k = seen.patch as usize;
                    next_off[k] += off[i] * reflectance[k] * seen.factor;
                    next_uneven[k] += reflectance[k]
                        * (off[i] * even_part * seen.uneven + uneven[i] * uneven_part * seen.worst_uneven);
                }
            }
            (uneven, off) = (next_uneven, next_off);
        }
        for (i, seen) in seen.iter().enumerate() {
            let [even_part, uneven_part] = by_chance[i];
            for seen in seen {
                let k = seen.patch as usize;
                own[k] += reflectance[k] * (off[i] * even_part * seen.left + uneven[i] * uneven_part * seen.worst_left);
            }
        }
        let adds: Vec<f64> = own.iter().zip(error_lux).map(|(own, error_lux)| own * error_lux).collect();
        // So much for each that all together come to what is wanted.
        let wanted = (WANTED * less).min(PROGRESS) * adds.iter().sum::<f64>();
        let (mut low, mut high) = (0.0, adds.iter().copied().fold(0.0, f64::max));
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            let sum: f64 = adds.iter().map(|add| add.min(middle)).sum();
            if sum > wanted { high = middle } else { low = middle }
        }
        adds.iter()
            .zip(error_lux)
            .map(|(add, error_lux)| if *add > 0.0 { error_lux * high / add } else { f64::INFINITY })
            .collect()
    }

    /// Halves every rectangle until it leaves out no more than its limit, which is the larger the smaller the parts.
    fn divide(&mut self, given: &Given, mut limits: Vec<f64>) -> Option<()> {
        let amplified = given.amplification();
        loop {
            let mut parts: Vec<(usize, Patch, f64)> = vec![];
            let mut count = self.patches.len();
            for (k, (patch, (tail, limit))) in self.patches.iter().zip(self.tails.iter().zip(&limits)).enumerate() {
                if tail.length() <= *limit || count >= given.most() {
                    continue;
                }
                // As far as can be told without a look.
                let mut open = vec![(*patch, *tail, *limit, 0)];
                let mut index = k;
                while let Some((patch, tail, limit, depth)) = open.pop() {
                    if tail.length() <= limit || depth == AT_ONCE || count >= given.most() {
                        parts.push((index, patch, limit));
                        index = count;
                        count += 1;
                        continue;
                    }
                    let axis = tail.max_position();
                    for half in self.cover.halves(&patch, axis) {
                        let part = half.size_m[axis] / patch.size_m[axis];
                        let mut tail = tail;
                        tail[axis] *= if part < 0.5 { part } else { part.powi(4) };
                        open.push((half, tail, limit / part, depth + 1));
                    }
                }
                count -= 1;
            }
            if parts.is_empty() {
                return Some(());
            }
            let rectangles: Vec<Patch> = parts.iter().map(|(_, patch, _)| *patch).collect();
            let once = given.once(&rectangles)?;
            self.patches.resize(count, rectangles[0]);
            self.once.resize(count, once[0]);
            self.tails.resize(count, DVec2::ZERO);
            limits.resize(count, 0.0);
            for ((k, patch, limit), once) in parts.into_iter().zip(once) {
                (self.patches[k], self.once[k], limits[k]) = (patch, once, limit);
                self.tails[k] = amplified * given.bicubic.left_out(&once.lux);
            }
        }
    }

    /// Goes through what a meter sees of all rectangles.
    fn for_all_shown(&self, given: &Given, meter: &Meter, mut each: impl FnMut(usize, &Face, &Shown)) {
        let view = given.view(meter);
        let before: Vec<Option<Before>> = given.faces().iter().map(|face| view.before(face)).collect();
        for (k, patch) in self.patches.iter().enumerate() {
            let shown = before[patch.face].as_ref().and_then(|before| before.of(patch.corner_m, patch.size_m));
            if let Some(shown) = shown {
                each(k, &given.faces()[patch.face], &shown);
            }
        }
    }

    pub(super) fn is_solved(&self) -> bool {
        self.grown > 0
    }

    /// Whether growing would not help any more.
    pub(super) fn is_spent(&self) -> bool {
        self.grown >= ROUNDS
    }

    /// What it is.
    pub(super) fn text(&self) -> String {
        format!("light balanced between {} rectangles, integrated over what shows of them", self.patches.len())
    }

    /// Reflected light at a meter.
    pub(super) fn at(&self, given: &Given, asked: &Asked) -> Bounded {
        if given.stop.is_due() {
            return Bounded::UNREAD;
        }
        let mut found = asked.once;
        let Solution { lux, error_lux, uneven_lux, off_lux, .. } = &self.solution;
        self.for_all_shown(given, asked.meter, |k, face, shown| {
            let weights = shown.weights();
            let most = lux[k].iter().fold(0.0_f64, |most, v| most.max(v.abs()));
            let [left, uneven] = given.bicubic.left_of(&weights.of_nodes);
            let left_lux = left * error_lux[k] + uneven * uneven_lux[k] + shown.factor * off_lux[k];
            found.value += face.reflectance * weights.of_nodes.iter().zip(&lux[k]).map(|(w, v)| w * v).sum::<f64>();
            found.bound += face.reflectance * (left_lux + weights.error * most);
        });
        found
    }

    fn solve(&self, given: &Given) -> Option<Solution> {
        let rows = self.rows(given)?;
        let reflectance: Vec<f64> = self.patches.iter().map(|patch| given.faces()[patch.face].reflectance).collect();
        let once: Vec<f64> = self.once.iter().flat_map(|once| once.lux).collect();
        let apply = |u: &[f64]| -> Vec<f64> {
            if given.stop.is_due() {
                return vec![0.0; u.len()];
            }
            let (u, _) = u.as_chunks::<NODES>();
            let of = |seen: &Seen| {
                let k = seen.patch as usize;
                reflectance[k] * seen.weights.iter().zip(&u[k]).map(|(w, v)| f64::from(*w) * v).sum::<f64>()
            };
            rows.par_iter().map(|row| row.iter().map(of).sum()).collect()
        };
        let lux = match given.bounces {
            Bounces::Converged => {
                let residual = RESIDUAL * given.accuracy.relative_error;
                gmres::solve(apply, &once, once.clone(), residual)
            }
            Bounces::AtMost(0 | 1) => vec![0.0; once.len()],
            Bounces::AtMost(most) => {
                let mut lux = once.clone();
                for _ in 2..most.min(MOST_REFLECTIONS) {
                    let next: Vec<f64> = once.iter().zip(apply(&lux)).map(|(once, more)| once + more).collect();
                    let change = next.iter().zip(&lux).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                    let scale = next.iter().copied().fold(0.0, f64::max);
                    lux = next;
                    if change <= CONVERGED * scale || given.stop.is_due() {
                        break;
                    }
                }
                lux
            }
        };
        if given.stop.is_due() {
            return None;
        }
        let lux = lux.as_chunks::<NODES>().0.to_vec();
        let error_lux: Vec<f64> = lux.iter().map(|lux| given.bicubic.left_out(lux).element_sum()).collect();
        let most: Vec<f64> = lux.iter().map(|lux| lux.iter().fold(0.0_f64, |most, v| most.max(v.abs()))).collect();
        let (by_patch, _) = rows.as_chunks::<NODES>();
        let all: Vec<Vec<Together>> = by_patch.par_iter().map(|rows| together(given.bicubic, rows)).collect();
        // What the polynomials of all others leave out comes to each rectangle's nodes: to some more, to others less, and on the mean.
        let residual_lux = RESIDUAL * given.accuracy.relative_error * given.mean_lux();
        let mut uneven_lux = vec![0.0; self.patches.len()];
        let mut off_lux = vec![0.0; self.patches.len()];
        let mut by_chance = vec![[1.0; 2]; self.patches.len()];
        for _ in 0..STEPS {
            if given.stop.is_due() {
                return None;
            }
            let of = |(once, seen): (&Once, &Vec<Together>)| {
                let (mut even, mut uneven, mut mean) = (Left::default(), Left::default(), 0.0);
                for seen in seen {
                    let k = seen.patch as usize;
                    let missed_lux = seen.missed * most[k];
                    even.add(reflectance[k] * (seen.left * error_lux[k] + seen.uneven * uneven_lux[k] + missed_lux));
                    uneven.add(reflectance[k] * (seen.worst_left * error_lux[k] + seen.worst_uneven * uneven_lux[k]));
                    mean += reflectance[k] * seen.factor * off_lux[k];
                }
                let own_lux = once.off_lux + residual_lux;
                let parts = [even, uneven].map(|left| left.by_chance() / left.sum.max(f64::MIN_POSITIVE));
                (own_lux + uneven.by_chance(), own_lux + even.by_chance() + mean, parts)
            };
            let next: Vec<(f64, f64, [f64; 2])> = self.once.iter().zip(&all).map(of).collect();
            let change = next.iter().zip(&off_lux).map(|((_, a, _), b)| (a - b).abs()).fold(0.0, f64::max);
            let scale = next.iter().map(|(_, off, _)| *off).fold(0.0, f64::max);
            for (k, next) in next.into_iter().enumerate() {
                (uneven_lux[k], off_lux[k], by_chance[k]) = next;
            }
            if change <= SETTLED * scale {
                break;
            }
        }
        Some(Solution { lux, error_lux, uneven_lux, off_lux, seen: all, by_chance })
    }

    /// What every node sees of all rectangles.
    fn rows(&self, given: &Given) -> Option<Vec<Vec<Seen>>> {
        let of_patch = |patch: &Patch| {
            let row = |meter: &Meter| -> Vec<Seen> {
                if given.stop.is_due() {
                    return vec![];
                }
                let view = given.view(meter);
                let before: Vec<Option<Before>> = given.faces().iter().map(|face| view.before(face)).collect();
                let seen = |(k, patch): (usize, &Patch)| {
                    let shown = before[patch.face].as_ref()?.of(patch.corner_m, patch.size_m)?;
                    let weights = shown.weights();
                    Some(Seen {
                        patch: k as u32,
                        weights: weights.of_nodes.map(|w| w as f32),
                        factor: shown.factor as f32,
                        missed: weights.error as f32,
                    })
                };
                self.patches.iter().enumerate().filter_map(seen).collect()
            };
            patch.nodes(given.faces(), given.bicubic).iter().map(row).collect::<Vec<_>>()
        };
        let rows: Vec<Vec<Vec<Seen>>> = self.patches.par_iter().map(of_patch).collect();
        (!given.stop.is_due()).then(|| rows.into_iter().flatten().collect())
    }
}

/// What the nodes of a rectangle see of another.
#[derive(Clone, Copy, Debug)]
struct Together {
    patch: u32,
    /// On the mean: its factor, and what is left of what has no terms up to degree 3, and of what has no mean.
    factor: f64,
    left: f64,
    uneven: f64,
    missed: f64,
    /// The same in the root mean square of all nodes.
    worst_left: f64,
    worst_uneven: f64,
}

fn together(bicubic: &Bicubic, rows: &[Vec<Seen>; NODES]) -> Vec<Together> {
    let mut all: Vec<&Seen> = rows.iter().flatten().collect();
    all.sort_by_key(|seen| seen.patch);
    let of = |same: &[&Seen]| {
        let part = 1.0 / NODES as f64;
        let mut weights = [0.0; NODES];
        let (mut factor, mut missed, mut squares) = (0.0, 0.0, [0.0; 2]);
        for seen in same {
            let own = seen.weights.map(f64::from);
            for (sum, own) in weights.iter_mut().zip(own) {
                *sum += part * own;
            }
            factor += part * f64::from(seen.factor);
            missed += part * f64::from(seen.missed);
            for (square, left) in squares.iter_mut().zip(bicubic.left_of(&own)) {
                *square += part * left * left;
            }
        }
        let [left, uneven] = bicubic.left_of(&weights);
        let [worst_left, worst_uneven] = squares.map(f64::sqrt);
        Together { patch: same[0].patch, factor, left, uneven, missed, worst_left, worst_uneven }
    };
    all.chunk_by(|a, b| a.patch == b.patch).map(of).collect()
}
