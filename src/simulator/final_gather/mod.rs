//! Rooms with bodies and luminaires of any form: one field of reflected light on walls and larger bodies, gathered at every meter.
//!
//! Light straight from the luminaires is integrated over what shows of them; reflected light along rays from the meter
//! that end there, where light reflected once is known from the luminaires and light reflected more often from
//! the field. Where nothing reflects but faces on which light is known, it is integrated over what shows of these, without
//! a ray, and solved for without chance ([`balance`]).
//!
//! Ward, Rubinstein and Clear, "A ray tracing solution for diffuse interreflection", SIGGRAPH 1988, and
//! M. Reichert, *A two-pass radiosity method driven by lights and viewer position* (1992) gather so; here all of it is
//! done in independent replicates, whose scatter bounds chance, and what polynomials leave out is added up along the rays.

mod balance;
mod bicubic;
mod close;
mod face;
mod field;
mod given;
mod grid;
mod lit;
mod patches;
mod rays;
mod seen;
mod solution;
mod surroundings;
#[cfg(test)]
mod tests;
mod trust;
mod view;

use glam::DVec3;
use rayon::prelude::*;

use self::balance::{Asked, Balance};
use self::bicubic::{Bicubic, NODES};
use self::face::Cover;
use self::field::Field;
use self::given::{FINE, Given};
use self::grid::Grid;
use self::lit::{Known, Lights, Limit, Lit};
use self::rays::Rays;
use self::surroundings::Surroundings;
use super::emission::{Emitter, Precision};
use super::sampler::{Sampler, mix};
use super::stop::Stop;
use super::visibility::Occluder;
use super::{Accuracy, Bounded, SimulatorError};
use crate::scene::{Bounces, Meter, Scene};

/// Independent solutions.
const REPLICATES: usize = 16;
/// Standard errors of the replicates' mean that a bound holds: Student's t with 15 degrees of freedom goes beyond it once in
/// a hundred thousand times.
const WIDTH: f64 = 6.5;
/// Samples that miss a part of all that they are drawn from, of which so many times one over their number may be unseen: by chance
/// it is more once in a hundred thousand times.
const UNSEEN: f64 = 11.5;
/// Bounds below this part of what luminaires would give that nothing hides need not be narrower.
const DARK: f64 = 1e-4;
/// Places so much brighter than the mean wall are drawn, since rays find them too seldom.
const PEAKED: f64 = 16.0;
/// Rays of a meter in each replicate at first, as a power of two.
const FIRST_RAYS_LOG2: u32 = 7;
/// Light straight from the luminaires is known on the faces to so many times the error asked for: of what a polynomial leaves
/// out little is left from afar.
const LIT: f64 = 1.0;
/// Rays of a node in each replicate: so many over the relative error asked for, a power of two.
const NODE_RAYS: f64 = 0.08;
/// Rays of a node in each replicate at least and at most.
const NODE_RAYS_LOG2: std::ops::RangeInclusive<u32> = 4..=10;
/// Where a rectangle's polynomial leaves out more than so many times the error asked for, rays go on.
const WELL_KNOWN: f64 = 4.0;
/// Parts of each luminaire that a meter asks in each replicate where bodies may hide it, as powers of two.
const PARTS_LOG2: std::ops::RangeInclusive<u32> = 6..=16;

/// Rays after which one looks whether it is time to stop.
const LOOK: u32 = 256;

/// A scene, with what is known of its light so far.
#[derive(Debug)]
pub(super) struct Enclosure {
    surroundings: Surroundings,
    /// Boxes as what cuts pieces out of luminaires; `None` where a mesh does, too.
    occluders: Option<Vec<Occluder>>,
    emitters: Vec<Emitter>,
    lit: Option<(f64, Lit)>,
    /// Whether light on the faces was found here, and nothing stopped it.
    found_light: bool,
    solved: Option<Solved>,
    /// Of how many reflections, how well, and how often rectangles were made smaller for it.
    balance: Option<(Bounces, f64, Balance)>,
}

/// Rays of a meter in each replicate at most, and times more than a look before, as powers of two.
const MOST_RAYS_LOG2: u32 = 17;
const MORE_RAYS_LOG2: u32 = 3;
/// Times more rays of a node than a look before, and than at first, at most, as powers of two.
const MORE_LOG2: f64 = 3.0;
const MOST_LOG2: u32 = 4;
/// The part of meters that do not decide that the field, or its rectangles, need more: hard ones have rays that go on.
const HARD: f64 = 0.3;
/// Where the field scatters too much at a meter its noise counts so many times, one after the other.
const WARY: [f64; 3] = [1.0, 8.0, 64.0];
/// What following a meter's ray costs, in rays of a node.
const RAY: usize = 2;
/// The power of the number of rays by which the field's variance falls.
const RATE: f64 = 1.6;
/// The part of a bound that the field's noise may have.
const FIELD_PART: f64 = 0.6;

/// A field with what it was made for.
#[derive(Debug)]
struct Solved {
    bounces: Bounces,
    accuracy: Accuracy,
    /// Times more rays of a node than at first, as a power of two.
    more_log2: u32,
    /// Rays of a node.
    count: u32,
    grid: Grid,
    field: Field,
    /// How well it is known, by rectangle.
    known: Vec<Known>,
}

/// Sums of one meter over the rays so far.
#[derive(Clone, Debug, Default)]
struct Sums {
    lux: [f64; REPLICATES],
    /// The part of it that is the field's chance.
    chance_lux: [f64; REPLICATES],
    error_lux: f64,
    rays_log2: u32,
    half_way: Option<f64>,
    /// What [`Self::field_needs_log2`] said of the first rays.
    needs_log2: f64,
    /// The most that a single ray may bring from a place that none has met.
    brightest_lux: f64,
}

impl Enclosure {
    pub(super) fn new(scene: &Scene) -> Result<Self, SimulatorError> {
        let reach_m = scene.luminaires.iter().map(|l| l.position_m.abs().max_element()).fold(0.0, f64::max);
        let surroundings = Surroundings::new(scene.room, &scene.obstacles, reach_m)
            .map_err(|e| SimulatorError::Unsupported { what: "a mesh of the scene".into(), instead: e.to_string() })?;
        let emitters = scene.luminaires.iter().map(Emitter::new).filter(Emitter::shines).collect();
        let solid = surroundings.bodies().map(|[min_m, max_m]| Occluder { min_m: *min_m, max_m: *max_m });
        let occluders = surroundings.cuts_exactly.then(|| solid.collect());
        Ok(Self { surroundings, occluders, emitters, lit: None, found_light: false, solved: None, balance: None })
    }

    /// Whether reflected light is solved for without chance, before rays read what that leaves open.
    pub(super) fn is_balanced(&self) -> bool {
        lit::cut_out(&Lights { surroundings: &self.surroundings, emitters: &self.emitters }).is_some()
    }

    /// Light on the faces as numbers, where it was found here as well as asked.
    pub(super) fn groundwork(&self) -> Option<Vec<f64>> {
        self.lit.as_ref().filter(|_| self.found_light).map(|(_, lit)| lit.numbers())
    }

    /// Takes light on the faces that was found before; whether it can be that of this scene.
    pub(super) fn lay(&mut self, numbers: &[f64], relative_error: f64) -> bool {
        let lights = Lights { surroundings: &self.surroundings, emitters: &self.emitters };
        let lit = Lit::of_numbers(&lights, numbers);
        self.lit = lit.map(|lit| (relative_error, lit));
        self.lit.is_some()
    }

    /// Takes light on the faces as the same scene has it already, which is as good as asked or better.
    pub(super) fn share_light(&mut self, other: &Self) {
        if let Some((error, lit)) = &other.lit {
            self.lay(&lit.numbers(), *error);
        }
    }

    /// Direct illuminance at the meters, each within a bound, as far as it comes before it is stopped.
    pub(super) fn direct(&self, meters: &[Meter], relative_error: f64, seed: u64, stop: &Stop) -> Vec<Bounded> {
        let lights = Lights { surroundings: &self.surroundings, emitters: &self.emitters };
        let one = |(index, meter): (usize, &Meter)| {
            let seed = mix(mix(seed ^ 0xd1).wrapping_add(index as u64));
            // Sampled ones share the error; what they must reach together is known once the others are.
            let seen = (0..self.emitters.len()).filter(|k| !self.is_all_hidden(*k, meter));
            let (sampled, exact): (Vec<usize>, Vec<usize>) = seen.partition(|k| self.is_sampled(*k, meter));
            let occluders = self.occluders.as_deref().unwrap_or(&[]);
            let error = relative_error.clamp(1e-10, 0.1);
            let precision = Precision::relative(0.2 * error);
            let light = |k: usize| {
                if stop.is_due() {
                    return Bounded::UNREAD;
                }
                let emitter = &self.emitters[k];
                if !emitter.is_point() {
                    return emitter.illuminance(meter, occluders, precision);
                }
                let hidden = self.surroundings.is_hidden(self.lifted(meter), emitter.centre_m());
                if hidden { Bounded::NONE } else { emitter.illuminance(meter, &[], precision) }
            };
            let known = exact.iter().fold(Bounded::NONE, |sum, k| sum + light(*k));
            if sampled.is_empty() {
                known
            } else {
                known + self.sampled(&lights, meter, &sampled, known, error, seed, stop)
            }
        };
        meters.par_iter().enumerate().map(one).collect()
    }

    /// Whether a luminaire's light must be sampled: something may hide what cannot be cut exactly.
    fn is_sampled(&self, k: usize, meter: &Meter) -> bool {
        let emitter = &self.emitters[k];
        let can_cut = emitter.is_point() || emitter.is_polygonal() && self.occluders.is_some();
        !can_cut && self.surroundings.may_hide([meter.position_m; 2], emitter.bounds_m())
    }

    /// Whether one box hides all of a luminaire, which no number of samples could prove: what a convex body hides from a point is convex,
    /// and so all that lies between corners that it hides.
    fn is_all_hidden(&self, k: usize, meter: &Meter) -> bool {
        let ends_m = self.emitters[k].bounds_m();
        let from_m = self.lifted(meter);
        let corner_m = |c: usize| DVec3::from_array([0, 1, 2].map(|axis| ends_m[c >> axis & 1][axis]));
        let hides = |occluder: &Occluder| (0..8).all(|c| occluder.blocks(from_m, corner_m(c)));
        self.occluders.iter().flatten().any(hides)
    }

    #[allow(clippy::too_many_arguments)]
    fn sampled(
        &self,
        lights: &Lights,
        meter: &Meter,
        which: &[usize],
        known: Bounded,
        relative_error: f64,
        seed: u64,
        stop: &Stop,
    ) -> Bounded {
        let start_m = self.lifted(meter);
        let bare = |k: &usize| self.emitters[*k].illuminance(meter, &[], Precision::relative(1e-2)).value;
        let bare_lux: f64 = which.iter().map(bare).sum();
        let mut sums = Sums { brightest_lux: bare_lux, ..Sums::default() };
        for log2 in PARTS_LOG2 {
            let from = if log2 == *PARTS_LOG2.start() { 0 } else { 1 << (log2 - 1) };
            let mut more = [More::default(); REPLICATES];
            for (replicate, more) in more.iter_mut().enumerate() {
                for index in (from..1 << log2).take_while(|k| !(k % LOOK == 0 && stop.is_due())) {
                    let mut sampler = Sampler::new(mix(seed.wrapping_add(replicate as u64 + 1)), index);
                    let parts = sampler.next_pair();
                    let parts = sampler.moved(parts);
                    more.lux += which.iter().map(|k| lights.sample(*k, meter, start_m, parts)).sum::<f64>();
                }
            }
            if stop.is_due() {
                break;
            }
            sums.add(&more, log2);
            let found = sums.bounded();
            let enough = 0.5 * relative_error * (found.value + known.value);
            if found.bound + known.bound <= enough.max(DARK * bare_lux) {
                break;
            }
        }
        sums.bounded()
    }

    fn lifted(&self, meter: &Meter) -> DVec3 {
        meter.position_m + meter.normal * self.surroundings.lift_m()
    }

    /// Indirect illuminance at the meters, each within a bound; the error asked for is relative to both with `direct`.
    pub(super) fn indirect(
        &mut self,
        meters: &[Meter],
        bounces: Bounces,
        direct: &[Bounded],
        accuracy: &Accuracy,
        stop: &Stop,
    ) -> Result<(Vec<Bounded>, String), SimulatorError> {
        if bounces == Bounces::AtMost(0) || self.emitters.is_empty() {
            return Ok((vec![Bounded::default(); meters.len()], "nothing is reflected".into()));
        }
        let lights = Lights { surroundings: &self.surroundings, emitters: &self.emitters };
        let error = accuracy.relative_error;
        if self.lit.as_ref().is_none_or(|(known, _)| *known > error) {
            // Without it nothing else is read.
            let (lit, is_done) = Lit::new(&lights, LIT * error, &stop.halfway(), stop);
            self.lit = Some((error, lit));
            self.found_light = is_done;
            self.solved = None;
            self.balance = None;
        }
        let taken_for_cosines = self.emitters.iter().map(Emitter::relative_error).fold(0.0, f64::max);
        let left = error - taken_for_cosines;
        let error = if left > 0.5 * error { left } else { error };
        let accuracy = &Accuracy { relative_error: error, ..*accuracy };
        let (mut found, text) = self.balanced(meters, bounces, direct, accuracy, stop);
        let is_met = |k: &usize| {
            found.get(*k).is_some_and(|f| f.bound + direct[*k].bound <= error * (f.value + direct[*k].value))
        };
        let open: Vec<usize> = (0..meters.len()).filter(|k| !is_met(k)).collect();
        let (mut found, text) = match text {
            Some(text) if open.is_empty() => (found, text),
            text => match self.gathered(meters, &open, bounces, direct, accuracy, stop) {
                Err(SimulatorError::Stopped) if !found.is_empty() => (found, text.unwrap_or_default()),
                Err(error) => return Err(error),
                Ok((sampled, how)) => {
                    found.resize(meters.len(), Bounded::UNREAD);
                    for (k, sampled) in open.iter().zip(sampled) {
                        if sampled.bound < found[*k].bound {
                            found[*k] = sampled;
                        }
                    }
                    (found, text.map_or(how.clone(), |text| format!("{text}; {how}")))
                }
            },
        };
        for one in &mut found {
            one.bound += taken_for_cosines * one.value.abs();
        }
        Ok((found, text))
    }

    /// Indirect illuminance at the meters without chance, for some perhaps not as well as asked, and how; nothing where that is not worth it
    /// or something reflects that is no known face.
    fn balanced(
        &mut self,
        meters: &[Meter],
        bounces: Bounces,
        direct: &[Bounded],
        accuracy: &Accuracy,
        stop: &Stop,
    ) -> (Vec<Bounded>, Option<String>) {
        let lights = Lights { surroundings: &self.surroundings, emitters: &self.emitters };
        let Some((_, lit)) = self.lit.as_ref().filter(|(_, lit)| lit.is_whole) else { return (vec![], None) };
        let Some(occluders) = self.surroundings.hiding() else { return (vec![], None) };
        let bicubic = Bicubic::new();
        let given = Given { lights, lit, occluders, bounces, accuracy: *accuracy, stop, bicubic: &bicubic };
        let asked: Vec<Asked> =
            meters.par_iter().zip(direct).map(|(meter, direct)| Asked::new(&given, meter, *direct)).collect();
        if self.balance.as_ref().is_none_or(|(of, error, _)| *of != bounces || *error > accuracy.relative_error) {
            self.balance = Balance::new(&given).map(|balance| (bounces, accuracy.relative_error, balance));
        }
        let Some((_, _, balance)) = &mut self.balance else { return (vec![], None) };
        let mut found = vec![Bounded::UNREAD; asked.len()];
        loop {
            let all = asked.iter().copied().zip(found.iter().copied());
            let open: Vec<(Asked, Bounded)> =
                all.filter(|(asked, found)| !balance.is_solved() || !asked.meets(&given, found)).collect();
            // What few meters need rays give them for less.
            // Where so little is asked for that rays take longer, none is left to them.
            let hard = if accuracy.relative_error < FINE { 0.0 } else { HARD };
            let is_enough = balance.is_spent() || open.len() as f64 <= hard * asked.len() as f64;
            if balance.is_solved() && is_enough {
                break;
            }
            if balance.grow(&given, &open).is_none() {
                // Halved, but not solved.
                let text = balance.text();
                self.balance = None;
                return (found, Some(text));
            }
            found = asked.par_iter().map(|asked| balance.at(&given, asked)).collect();
        }
        balance.rest();
        (found, Some(balance.text()))
    }

    /// Indirect illuminance at some of the meters by rays.
    fn gathered(
        &mut self,
        meters: &[Meter],
        which: &[usize],
        bounces: Bounces,
        direct: &[Bounded],
        accuracy: &Accuracy,
        stop: &Stop,
    ) -> Result<(Vec<Bounded>, String), SimulatorError> {
        let lights = Lights { surroundings: &self.surroundings, emitters: &self.emitters };
        let error = accuracy.relative_error;
        let Some((_, lit)) = &self.lit else { return Err(SimulatorError::Stopped) };
        let mut sums = vec![Sums::default(); meters.len()];
        let mut open = which.to_vec();
        let (mut more_log2, mut most_log2) = (0, FIRST_RAYS_LOG2);
        loop {
            if self.surroundings.room.is_some()
                && !self.solved.as_ref().is_some_and(|s| s.is_for(bounces, accuracy, more_log2))
            {
                match Solved::new(lights, lit, bounces, accuracy, more_log2, stop) {
                    None if self.solved.is_none() => return Err(SimulatorError::Stopped),
                    None => break,
                    solved => self.solved = solved,
                }
            }
            let affordable = stop.third_log2(REPLICATES * open.len()).max(FIRST_RAYS_LOG2);
            let gather = Gather::new(lights, lit, self.solved.as_ref(), bounces, accuracy, stop);
            let at = |k: &usize| gather.at(*k, &meters[*k], direct[*k], most_log2.min(affordable));
            let found: Vec<Sums> = open.par_iter().map(at).collect();
            let mut needs: Vec<f64> = found.iter().map(|sums| sums.needs_log2).collect();
            for (k, found) in open.iter().zip(found) {
                // A later look stopped short of its first rays knows nothing.
                if found.rays_log2 > 0 && (sums[*k].rays_log2 == 0 || found.bounded().bound < sums[*k].bounded().bound)
                {
                    sums[*k] = found;
                }
            }
            open.retain(|k| !sums[*k].meets(error, direct[*k]));
            if open.is_empty() || stop.is_due() || most_log2 > affordable {
                break;
            }
            needs.sort_by(f64::total_cmp);
            let needed = needs[((1.0 - HARD) * (needs.len() - 1) as f64) as usize].ceil().clamp(0.0, MORE_LOG2) as u32;
            let better_log2 = (more_log2 + needed).min(MOST_LOG2);
            let node_rays = self.solved.as_ref().map_or(0, |s| s.rays() << (better_log2 - more_log2));
            // What is cheaper comes first.
            if better_log2 > more_log2
                && (most_log2 == MOST_RAYS_LOG2 || node_rays < (RAY * open.len()) << (most_log2 + MORE_RAYS_LOG2))
            {
                more_log2 = better_log2;
            } else if most_log2 < MOST_RAYS_LOG2 {
                most_log2 = (most_log2 + MORE_RAYS_LOG2).min(MOST_RAYS_LOG2);
            } else {
                break;
            }
        }
        let sums: Vec<&Sums> = which.iter().map(|k| &sums[*k]).collect();
        let most = sums.iter().map(|s| s.rays_log2).max().unwrap_or(0);
        let text = match &self.solved {
            Some(s) => format!(
                "final gather, {REPLICATES} times up to 2^{most} rays a meter, over {} rectangles of reflected light: \
                 bodies or openings",
                s.grid.len()
            ),
            None => format!("{REPLICATES} times up to 2^{most} rays a meter between bodies in free field"),
        };
        Ok((sums.iter().map(|s| s.bounded()).collect(), text))
    }
}

impl Solved {
    fn new(
        lights: Lights,
        lit: &Lit,
        bounces: Bounces,
        accuracy: &Accuracy,
        more_log2: u32,
        stop: &Stop,
    ) -> Option<Self> {
        let grid = Grid::new(lights.surroundings);
        let known = |k: usize, error_lux: f64, noise_lux: f64| {
            let error_lux = if grid.cover(k) == Cover::None { error_lux } else { f64::INFINITY };
            Known { error_lux, mean_lux: 0.0, noise_lux, side_m: grid.longer_m(k) }
        };
        let open: Vec<Known> = (0..grid.len()).map(|k| known(k, 0.0, 0.0)).collect();
        let rays = Rays { lights, lit, grid: Some((&grid, &open)), draws: false };
        let log2 = (NODE_RAYS / accuracy.relative_error).log2().ceil().max(0.0) as u32;
        let affordable = stop.third_log2(REPLICATES * NODES * grid.len()).max(*NODE_RAYS_LOG2.start());
        let log2 = log2.clamp(*NODE_RAYS_LOG2.start(), *NODE_RAYS_LOG2.end()) + more_log2;
        let count: u32 = 1 << log2.min(affordable);
        let field = Field::solve(&grid, &rays, bounces, count, *accuracy, stop)?;
        let known = (0..grid.len()).map(|k| known(k, field.error_lux[k], field.noise_lux[k])).collect();
        Some(Self { bounces, accuracy: *accuracy, more_log2, count, grid, field, known })
    }

    /// Rays of all nodes in each replicate, about.
    fn rays(&self) -> usize {
        self.grid.len() * NODES * self.count as usize
    }

    fn is_for(&self, bounces: Bounces, accuracy: &Accuracy, more_log2: u32) -> bool {
        self.bounces == bounces && self.accuracy == *accuracy && self.more_log2 >= more_log2
    }
}

struct Gather<'a> {
    rays: Rays<'a>,
    solved: Option<&'a Solved>,
    bounces: Bounces,
    accuracy: &'a Accuracy,
    stop: &'a Stop,
}

impl<'a> Gather<'a> {
    fn new(
        lights: Lights<'a>,
        lit: &'a Lit,
        solved: Option<&'a Solved>,
        bounces: Bounces,
        accuracy: &'a Accuracy,
        stop: &'a Stop,
    ) -> Self {
        let grid = solved.map(|s| (&s.grid, s.known.as_slice()));
        let rays = Rays { lights, lit, grid, draws: lit.is_peaked };
        Self { rays, solved, bounces, accuracy, stop }
    }

    fn at(&self, index: usize, meter: &Meter, direct: Bounded, most_log2: u32) -> Sums {
        let Rays { lit, draws, lights, .. } = self.rays;
        let faces = &lights.surroundings.faces;
        let brightest_lux = if draws { lit.brightest(faces, meter.position_m) } else { lit.peak };
        let mut sums = Sums { brightest_lux, ..Sums::default() };
        // The first rays tell how bright it is here and what the field scatters, and so where rays may end.
        let mut limit = self.limit(self.solved.map_or(0.0, |s| s.field.mean_lux), 1.0);
        for log2 in FIRST_RAYS_LOG2..=most_log2 {
            if self.stop.is_due() {
                break;
            }
            let from = if log2 == FIRST_RAYS_LOG2 { 0 } else { 1 << (log2 - 1) };
            let Some(more) = self.replicates(index, meter, from..1 << log2, limit) else { break };
            sums.add(&more, log2);
            if sums.meets(self.accuracy.relative_error, direct) {
                break;
            }
            if log2 > FIRST_RAYS_LOG2 {
                continue;
            }
            let needs_log2 = |sums: &Sums| sums.field_needs_log2(self.accuracy.relative_error, direct);
            let first_needs_log2 = needs_log2(&sums);
            for wary in WARY {
                let here = self.limit(sums.bounded().value + direct.value, wary);
                if here.error_lux < 0.5 * limit.error_lux || wary > 1.0 && needs_log2(&sums) > 0.0 {
                    // Where some were not shot the first stand.
                    let Some(again) = self.replicates(index, meter, 0..1 << log2, here) else { break };
                    limit = here;
                    sums = Sums { brightest_lux, ..Sums::default() };
                    sums.add(&again, log2);
                }
            }
            sums.needs_log2 = first_needs_log2;
        }
        sums
    }

    fn limit(&self, lux: f64, wary: f64) -> Limit {
        let error_lux = WELL_KNOWN * self.accuracy.relative_error * lux;
        Limit { error_lux, noise_lux: error_lux / wary }
    }

    /// What rays of each replicate bring; nothing where it was stopped, since some may not have been shot.
    fn replicates(&self, index: usize, meter: &Meter, rays: std::ops::Range<u32>, limit: Limit) -> Option<Vec<More>> {
        let one = |replicate| self.replicate(index, meter, replicate, rays.clone(), limit);
        let all = (0..REPLICATES).into_par_iter().map(one).collect();
        (!self.stop.is_due()).then_some(all)
    }

    fn replicate(
        &self,
        index: usize,
        meter: &Meter,
        replicate: usize,
        rays: std::ops::Range<u32>,
        limit: Limit,
    ) -> More {
        let most = match self.bounces {
            Bounces::Converged => u32::MAX,
            Bounces::AtMost(n) => n,
        };
        let scramble = mix(mix(self.accuracy.seed).wrapping_add(((index as u64) << 8 | replicate as u64) + 1));
        let mut more = More::default();
        for ray in rays {
            // What is stopped halfway is thrown away.
            if ray % LOOK == 0 && self.stop.is_due() {
                break;
            }
            let found = self.rays.follow(meter, &mut Sampler::new(scramble, ray), most, limit);
            more.lux += found.lux.iter().map(|(_, lux)| lux).sum::<f64>();
            more.error_lux += found.error_lux;
            if let (Some(end), Some(solved)) = (&found.end, self.solved) {
                let (lux, chance_lux) = solved.field.at(&solved.grid, end, replicate, self.bounces);
                more.lux += lux;
                more.chance_lux += chance_lux;
            }
        }
        more
    }
}

/// What further rays of one replicate add up to.
#[derive(Clone, Copy, Debug, Default)]
struct More {
    lux: f64,
    /// The part of it that is the field's chance.
    chance_lux: f64,
    error_lux: f64,
}

impl Sums {
    fn add(&mut self, more: &[More], rays_log2: u32) {
        self.half_way = (self.rays_log2 > 0).then(|| self.mean_and_error().1);
        for (k, more) in more.iter().enumerate() {
            self.lux[k] += more.lux;
            self.chance_lux[k] += more.chance_lux;
            self.error_lux += more.error_lux;
        }
        self.rays_log2 = rays_log2;
    }

    /// How many times more rays the field's nodes need for a bound that is asked for, as a power of two.
    fn field_needs_log2(&self, relative_error: f64, direct: Bounded) -> f64 {
        let (n, rays) = (REPLICATES as f64, f64::from(1_u32 << self.rays_log2));
        let found = self.bounded();
        let noise = WIDTH * (self.chance_lux.iter().map(|c| (c / rays).powi(2)).sum::<f64>() / (n * (n - 1.0))).sqrt();
        let asked = relative_error * (found.value + direct.value) - direct.bound - self.error_lux / (n * rays);
        // Where something else is too large already the field cannot help.
        if asked <= 0.0 || noise == 0.0 { 0.0 } else { 2.0 / RATE * (noise / (FIELD_PART * asked)).log2() }
    }

    /// Mean and standard error of the replicates.
    fn mean_and_error(&self) -> (f64, f64) {
        let (n, rays) = (REPLICATES as f64, f64::from(1_u32 << self.rays_log2));
        let mean = self.lux.iter().sum::<f64>() / n / rays;
        let square = self.lux.iter().map(|s| (s / rays - mean).powi(2)).sum::<f64>();
        (mean, (square / (n * (n - 1.0))).sqrt())
    }

    fn meets(&self, relative_error: f64, direct: Bounded) -> bool {
        let found = self.bounded();
        self.rays_log2 > 0 && found.bound + direct.bound <= relative_error * (found.value + direct.value)
    }

    /// Stopping as soon as a noisy error is small prefers errors that are too small by chance: half of the one before counts.
    fn bounded(&self) -> Bounded {
        if self.rays_log2 == 0 {
            return Bounded::UNREAD;
        }
        let (mean, error) = self.mean_and_error();
        let error = error.max(0.5 * self.half_way.unwrap_or(0.0));
        let rays = REPLICATES as f64 * f64::from(1_u32 << self.rays_log2);
        Bounded { value: mean, bound: WIDTH * error + self.error_lux / rays + UNSEEN / rays * self.brightest_lux }
    }
}
