//! Reflected light where all that reflects is a known face, without chance: light comes to the nodes of rectangles from what they
//! see of all others, exactly cut, and the rectangles are halved until what their polynomials leave out is little at the meters.
//!
//! Irradiance by reflected light u obeys u = T (D + u), D the light straight from the luminaires, T reflection and transport.
//! Collocation at Gauss's nodes solves that for a u of polynomials; what they leave out comes back to all other nodes, and is solved
//! for with the same kernel ([`super::solution`]). How much of that they are off is measured by the solution before ([`super::trust`]), and what is left
//! out close to a meter at the meter ([`super::close`]), so that a bound holds of all of it.

use glam::DVec2;

use super::given::{FINE, Given, Once};
use super::patches::{Cover, Patch};
use super::seen::{Rows, for_all_shown};
use super::solution::Solution;
use super::trust::{self, Trust};
use crate::scene::Meter;
use crate::simulator::Bounded;

/// What large rectangles may be off of light reflected once at a meter, each, of the error asked for.
const OF_LIT: f64 = 3e-3;
/// What a rectangle of a wall's size may leave out at first, of the error asked for; or of a coarse one where less than [`FINE`] is, since
/// they are halved again then anyway.
const ANYWHERE: f64 = 0.05;
const COARSE: f64 = 1e-2;
/// What is left of what is wanted, since rectangles once halved leave out less than their share; what is left at most each time; and how often rectangles are made smaller for it.
const WANTED: f64 = 1.2;
const PROGRESS: f64 = 0.6;
const ROUNDS: usize = 5;
/// Halvings of a rectangle before anyone looks again.
const AT_ONCE: u32 = 4;
/// Steps by which what nodes are off is followed back, and of a bisection.
const ADJOINT_STEPS: usize = 12;
const HALVINGS: usize = 40;
/// The part of what nodes may be off that will count once it is measured, where that is not known yet.
const GUESS: f64 = 0.1;
/// The sides of rectangles at first, of the mean wall.
const SIDE: f64 = 0.6;
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
    /// Which rectangle of the solution before each is a part of.
    parents: Vec<usize>,
    /// How often shares were made smaller.
    grown: usize,
    /// What nodes see of rectangles, as long as these may be halved again.
    rows: Rows,
    solution: Solution,
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
        let (rows, solution) = Default::default();
        Some(Self { cover, patches, once, tails, parents: vec![], grown: 0, rows, solution })
    }

    /// Halves rectangles that leave out too much, and solves: at first where it is too much for any meter, then where it is for
    /// those that were asked and found like this.
    pub(super) fn grow(&mut self, given: &Given, asked: &[(Asked, Bounded)]) -> Option<()> {
        let limits = if self.is_solved() { self.shares(given, asked) } else { self.even_shares(given) };
        let coarse = self.patches.clone();
        self.parents = (0..coarse.len()).collect();
        self.divide(given, limits)?;
        if self.is_solved() && self.patches.len() == coarse.len() {
            self.grown = ROUNDS;
            return Some(());
        }
        self.rows = Rows::of(given, &self.patches, std::mem::take(&mut self.rows))?;
        let solution = Solution::new(given, &self.patches, &self.once, &self.rows)?;
        let before = std::mem::replace(&mut self.solution, solution);
        if self.is_solved() {
            let coarse = trust::Solved { patches: &coarse, lux: &before.lux, off: &before.left };
            let fine = trust::Solved { patches: &self.patches, lux: &self.solution.lux, off: &self.solution.left };
            self.solution.trust = Trust::measured(given.bicubic, &coarse, &fine, &self.parents, &before.trust);
        }
        self.grown += 1;
        self.tails = self.solution.lux.iter().map(|lux| given.bicubic.left_out(lux)).collect();
        Some(())
    }

    /// What rectangles may leave out where nobody has looked yet: the more, the smaller they are.
    fn even_shares(&self, given: &Given) -> Vec<f64> {
        let error = given.accuracy.relative_error;
        let error = if error < FINE { COARSE } else { error };
        let of = |patch: &Patch| {
            let part = (patch.area_m2() / given.wall_m2()).sqrt();
            ANYWHERE * error * given.mean_lux() * given.amplification() / (given.faces()[patch.face].reflectance * part)
        };
        self.patches.iter().map(of).collect()
    }

    /// What rectangles may leave out lest it be too much at some meters: what each adds to their bounds, by itself and by what all
    /// nodes are off because of it, becomes the same for all.
    fn shares(&self, given: &Given, asked: &[(Asked, Bounded)]) -> Vec<f64> {
        let Solution { error_lux, seen, by_chance, trust, .. } = &self.solution;
        let count = self.patches.len();
        let reflectance: Vec<f64> = self.patches.iter().map(|patch| given.faces()[patch.face].reflectance).collect();
        // What is not measured yet will be by the next solution.
        let guess = |part: f64| if self.grown > 1 { part } else { GUESS };
        let step = asked.len().div_ceil(LOOKED_AT).max(1);
        let looking: Vec<&(Asked, Bounded)> = asked.iter().step_by(step).collect();
        let (mut less, mut own, mut uneven, mut off) = (1.0_f64, vec![0.0; count], vec![0.0; count], vec![0.0; count]);
        for (asked, found) in looking.iter().take_while(|_| !given.stop.is_due()) {
            let error = given.accuracy.relative_error;
            let mut most_lux = error * (found.value + asked.direct.value) - asked.direct.bound - asked.once.bound;
            let (mut here_lux, mut parts) = (0.0, vec![]);
            for_all_shown(given, &self.patches, asked.meter, |k, face, shown| {
                let weights = shown.weights().of_nodes;
                let [left, left_uneven] = given.bicubic.left_of(&weights).map(|left| face.reflectance * left);
                let left_uneven = left_uneven * guess(trust.uneven[k]);
                let left_off = face.reflectance * shown.factor * guess(trust.mean[k]);
                here_lux += left * error_lux[k]
                    + left_uneven * self.solution.left.uneven_lux[k]
                    + left_off * self.solution.left.mean_lux[k];
                most_lux -= face.reflectance * shown.factor * self.solution.given.mean_lux[k];
                parts.push((k, [left, left_uneven, left_off]));
            });
            for (k, close_lux) in self.solution.close(given, &self.patches, asked.meter) {
                here_lux += close_lux;
                if error_lux[k] > 0.0 {
                    parts.push((k, [close_lux / error_lux[k], 0.0, 0.0]));
                }
            }
            if most_lux <= 0.0 || here_lux == 0.0 {
                continue;
            }
            less = less.min(most_lux / here_lux);
            for (k, part) in parts {
                let [left, left_uneven, left_off] = part.map(|part| part / (most_lux * looking.len() as f64));
                own[k] += left;
                uneven[k] += left_uneven;
                off[k] += left_off;
            }
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
            let mut parts: Vec<(usize, Patch, f64, usize)> = vec![];
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
                        parts.push((index, patch, limit, self.parents[k]));
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
            let rectangles: Vec<Patch> = parts.iter().map(|(_, patch, ..)| *patch).collect();
            let once = given.once(&rectangles)?;
            self.patches.resize(count, rectangles[0]);
            self.once.resize(count, once[0]);
            self.tails.resize(count, DVec2::ZERO);
            self.parents.resize(count, 0);
            limits.resize(count, 0.0);
            for ((k, patch, limit, parent), once) in parts.into_iter().zip(once) {
                (self.patches[k], self.once[k], limits[k], self.parents[k]) = (patch, once, limit, parent);
                self.tails[k] = amplified * given.bicubic.left_out(&once.lux);
            }
        }
    }

    /// Lets go of what only growing needs, which is the most of it.
    pub(super) fn rest(&mut self) {
        self.rows = Rows::default();
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
        let Solution { lux, error_lux, .. } = &self.solution;
        for_all_shown(given, &self.patches, asked.meter, |k, face, shown| {
            let [uneven_lux, mean_lux] = self.solution.off_lux(k);
            let weights = shown.weights();
            let most = lux[k].iter().fold(0.0_f64, |most, v| most.max(v.abs()));
            let [left, uneven] = given.bicubic.left_of(&weights.of_nodes);
            let left_lux = left * error_lux[k] + uneven * uneven_lux + shown.factor * mean_lux;
            found.value += face.reflectance * weights.of_nodes.iter().zip(&lux[k]).map(|(w, v)| w * v).sum::<f64>();
            found.bound += face.reflectance * (left_lux + weights.error * most);
        });
        found.bound += self.solution.close(given, &self.patches, asked.meter).iter().map(|(_, lux)| lux).sum::<f64>();
        found
    }
}
