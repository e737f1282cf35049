//! Empty box rooms with point luminaires: hp collocation on the indirect irradiance, whose error falls exponentially.
//!
//! u(x) = g(x) + ∫ ρ u K dA: g is the first bounce, integrated in the luminaires' own directions; u is smooth where
//! the exitance is not. A final gather carries the solution to a meter with the exact kernel. After Atkinson, *The
//! Numerical Solution of Integral Equations of the Second Kind* (1997), chapters 3 (iterated collocation) and 9.

mod cells;
mod error;
mod first_bounce;
#[cfg(test)]
mod fresh_tests;
mod grid;
mod kernel;
mod many_lights;
mod operator;
mod patch;
mod symmetry;
#[cfg(test)]
mod tests;

use std::sync::{Arc, OnceLock};

use rayon::prelude::*;

use crate::stop::Stop;
use crate::{Bounded, SimulatorError, gmres};
use error::History;
use first_bounce::FirstBounce;
use grid::Grid;
use kernel::Receiver;
use luxproof_scene::geometry::Room;
use luxproof_scene::{Bounces, Luminaire, Meter};
use many_lights::ProjectedSources;
use operator::{Operator, balanced_row, receiver_at};
use symmetry::{Orbits, Symmetries};

/// How fine a solution is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Effort {
    /// Nodes along an element.
    pub(super) order: usize,
    /// Elements at an edge for one that there would be, smaller and smaller towards it.
    pub(super) at_edge: usize,
    /// Points of the rule on near elements.
    pub(super) near_points: usize,
    /// Points of the rule on a patch of the first bounce.
    pub(super) source_points: usize,
    /// Half-lengths at which such a patch need not be halved.
    pub(super) source_reach: f64,
    /// What a rule on a far patch may miss of it, relative.
    pub(super) source_tolerance: f64,
}

/// Entries of the operator at most: 256 MiB, which the finest effort needs in a cube whose light has no symmetry.
const MAX_ENTRIES: usize = 1 << 25;
/// Fewer meters than this are read sooner than another thread wakes.
const FEW: usize = 8;
/// Luminaires up to which each one's light is integrated for each node, where errors this small are asked for and where not.
const FEW_LUMINAIRES: [usize; 2] = [256, 32];
const PROJECTION_REACHES: f64 = 1e-3;
/// The largest relative error that each effort is the first choice for.
const FIRST_EFFORT: [f64; 5] = [f64::INFINITY, 9e-3, 9e-4, 9e-5, 5e-7];
/// The ladder of efforts; the rules of the first bounce grow with the order, or neighbours would share their errors.
pub(super) const EFFORTS: [Effort; 8] = [
    Effort { order: 3, at_edge: 1, near_points: 4, source_points: 3, source_reach: 0.8, source_tolerance: 3e-4 },
    Effort { order: 4, at_edge: 1, near_points: 4, source_points: 4, source_reach: 1.0, source_tolerance: 1e-4 },
    Effort { order: 5, at_edge: 1, near_points: 6, source_points: 5, source_reach: 1.0, source_tolerance: 1e-6 },
    Effort { order: 6, at_edge: 1, near_points: 8, source_points: 6, source_reach: 1.0, source_tolerance: 1e-7 },
    Effort { order: 8, at_edge: 1, near_points: 8, source_points: 8, source_reach: 1.2, source_tolerance: 1e-8 },
    Effort { order: 10, at_edge: 1, near_points: 10, source_points: 9, source_reach: 1.5, source_tolerance: 1e-9 },
    Effort { order: 12, at_edge: 1, near_points: 12, source_points: 10, source_reach: 1.5, source_tolerance: 1e-10 },
    Effort { order: 12, at_edge: 2, near_points: 12, source_points: 12, source_reach: 2.5, source_tolerance: 1e-12 },
];

/// Which light of an empty room is asked for, and how finely.
#[derive(Clone, Copy, Debug)]
pub(super) struct Request<'a> {
    pub(super) room: &'a Room,
    pub(super) luminaires: &'a [Luminaire],
    pub(super) bounces: Bounces,
    pub(super) meters: &'a [Meter],
    pub(super) relative_error: f64,
    pub(super) stop: &'a Stop,
}

/// An empty room with point luminaires, solved as finely as anyone has asked so far.
#[derive(Debug, Default)]
pub(super) struct EmptyRoom {
    symmetries: Option<Symmetries>,
    /// The luminaires, where they are many.
    many_lights: Option<Arc<ProjectedSources>>,
    /// By place in [`EFFORTS`].
    fields: Vec<(usize, BoxField)>,
}

impl EmptyRoom {
    /// Indirect illuminance at the meters, climbing the efforts until the bound meets the relative error; and in words how
    /// far that went and why no farther.
    pub(super) fn indirect(&mut self, request: &Request) -> Result<(Vec<Bounded>, String), SimulatorError> {
        // Entering the pool of threads once: each small job that is sent there on its own costs as much as it does. Where
        // a few meters read what is solved, even that costs as much as they do.
        let level = first_level(request.relative_error);
        let is_solved = [level, level + 1].iter().all(|level| self.fields.iter().any(|(at, _)| at == level));
        if is_solved && request.meters.len() < FEW {
            self.climb(request)
        } else {
            rayon::scope(|_| self.climb(request))
        }
    }

    fn climb(&mut self, request: &Request) -> Result<(Vec<Bounded>, String), SimulatorError> {
        let Request { room, luminaires, meters, relative_error, stop, .. } = *request;
        let few = FEW_LUMINAIRES[usize::from(relative_error >= PROJECTION_REACHES)];
        if luminaires.len() > few && self.many_lights.is_none() {
            self.many_lights = Some(Arc::new(ProjectedSources::new(room, luminaires)));
        }
        let mut level = first_level(relative_error);
        let symmetries = self.symmetries.take().or_else(|| Symmetries::of(room, luminaires, stop));
        let symmetries = self.symmetries.insert(symmetries.ok_or(SimulatorError::Stopped)?).clone();
        let probes = error::probes(room.size_m, &symmetries.mirrors_of_light());
        let mut history = History::default();
        let mut lux = vec![vec![]; meters.len()];
        let mut found: Vec<Option<Bounded>> = vec![None; meters.len()];
        loop {
            // Many lights are read once for all efforts, and so at all meters.
            let is_met = |k: usize| found[k].is_some_and(|v| v.is_within(relative_error));
            let open: Vec<usize> = (0..meters.len()).filter(|k| self.many_lights.is_some() || !is_met(*k)).collect();
            let asked: Vec<Meter> = open.iter().map(|k| meters[*k]).collect();
            let read = self.solved(request, &symmetries, level).and_then(|field| {
                history.add(field, &probes, stop)?;
                field.illuminance(&asked, stop)
            });
            let is_stopped = read.is_none();
            for (k, value) in open.into_iter().zip(read.into_iter().flatten()) {
                lux[k].push(value);
                found[k] = history.bounded(&lux[k], room, &meters[k]);
            }
            level += usize::from(!is_stopped);
            let values = match found.iter().copied().collect::<Option<Vec<_>>>() {
                Some(values) => values,
                None if is_stopped => return Err(SimulatorError::Stopped),
                None => continue,
            };
            let worst =
                values.iter().map(|v| if v.bound == 0.0 { 0.0 } else { v.bound / v.value.abs() }).fold(0.0, f64::max);
            let why = match EFFORTS.get(level) {
                _ if is_stopped => format!("stopped, its bound is {worst:.0e}"),
                _ if values.iter().all(|v| v.is_within(relative_error)) => {
                    format!("its bound of {worst:.0e} meets the {relative_error:.0e} asked for")
                }
                None => format!("the finest there is, its bound is {worst:.0e}"),
                Some(next) if symmetries.matrix_entries(room.size_m, next) > MAX_ENTRIES => {
                    format!("a finer matrix would not fit, its bound is {worst:.0e}")
                }
                Some(_) => continue,
            };
            let Effort { order, at_edge, .. } = EFFORTS[level - 1];
            let light = match &self.many_lights {
                Some(_) => format!("{} point luminaires projected on it", luminaires.len()),
                None => "point luminaires".to_owned(),
            };
            let text = format!(
                "hp collocation, order {order} with {at_edge} element(s) at an edge: empty box, {light}; {why}"
            );
            return Ok((values, text));
        }
    }

    /// The light at one effort, solved once; `None` where it was stopped.
    fn solved(&mut self, request: &Request, symmetries: &Symmetries, level: usize) -> Option<&BoxField> {
        let Request { room, luminaires, bounces, stop, .. } = *request;
        if self.fields.iter().all(|(at, _)| *at != level) {
            let first = match &self.many_lights {
                Some(many) => First::Many(Arc::clone(many)),
                None => First::Few(FirstBounce::new(room, luminaires, &EFFORTS[level])),
            };
            let field = BoxField::solve(room, first, symmetries, bounces, &EFFORTS[level], stop)?;
            self.fields.push((level, field));
        }
        self.fields.iter().find(|(at, _)| *at == level).map(|(_, field)| field)
    }
}

/// The effort to begin with.
fn first_level(relative_error: f64) -> usize {
    FIRST_EFFORT.iter().rposition(|error| relative_error <= *error).unwrap_or(0)
}

/// The solved light field of a room at one effort, ready for any meter.
#[derive(Debug)]
pub(super) struct BoxField {
    grid: Grid,
    first: First,
    /// Indirect exitance at the nodes in lm/m²: what is gathered on top of the first bounce.
    exitance: Vec<f64>,
    gathers: Gathers,
    /// Illuminances in lux at fixed places of the room, so that the error of one meter alone is not at the mercy of chance.
    probes: OnceLock<Vec<f64>>,
    /// Relative flux that interpolating the first bounce between the nodes would lose or gain.
    imbalance: f64,
}

/// Light that is reflected once.
#[derive(Debug)]
enum First {
    Few(FirstBounce),
    Many(Arc<ProjectedSources>),
}

impl First {
    fn irradiance(&self, receivers: &[Receiver], stop: &Stop) -> Vec<f64> {
        match self {
            Self::Few(few) => few.irradiance(receivers, stop),
            Self::Many(many) => many.irradiance(receivers, stop),
        }
    }
}

/// What a meter sums up.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Gathers {
    Nothing,
    FirstBounce,
    All,
}

impl BoxField {
    /// `None` where it was stopped: what is not done by then is zero, and worth nothing.
    fn solve(
        room: &Room,
        first: First,
        symmetries: &Symmetries,
        bounces: Bounces,
        effort: &Effort,
        stop: &Stop,
    ) -> Option<Self> {
        let grid = Grid::new(room.size_m, effort);
        let gathers = match bounces {
            Bounces::AtMost(0) => Gathers::Nothing,
            Bounces::AtMost(1) => Gathers::FirstBounce,
            Bounces::AtMost(_) | Bounces::Converged => Gathers::All,
        };
        if gathers != Gathers::All {
            let exitance = vec![0.0; grid.len()];
            return Some(Self { exitance, grid, first, gathers, probes: OnceLock::new(), imbalance: 0.0 });
        }
        let orbits = Orbits::new(&grid, &symmetries.of_room);
        let light = orbits.under(&symmetries.of_light);
        let operator = Operator::new(&grid, &orbits, &light, stop)?;
        let rho: Vec<f64> = (0..grid.len()).map(|node| symmetry::reflectance(room, grid.place(node).0)).collect();
        let rho_of_light: Vec<f64> = light.representatives.iter().map(|node| rho[*node]).collect();
        let reflected = |u: &[f64]| operator.apply(&exitance(u, &rho_of_light));
        let (known, imbalance) = match &first {
            First::Few(few) => known(&grid, few, &light, stop),
            First::Many(many) => {
                (reflected(&light.means(&many.projected(&grid, effort, stop))), many_lights::MISPLACED)
            }
        };
        let area_m2 = light.representatives.iter().zip(&light.sizes).map(|(node, n)| grid.node(*node).1 * n);
        let closed = Closed(area_m2.zip(rho_of_light.iter().copied()).collect());
        let irradiance = light.unfold(&interreflect(reflected, &known, &closed, bounces, stop));
        let exitance = exitance(&irradiance, &rho);
        let field = Self { exitance, grid, first, gathers, probes: OnceLock::new(), imbalance };
        (!stop.is_due()).then_some(field)
    }

    /// Illuminances in lux at fixed places of the room, which are read once.
    fn probes(&self, probes: &[Meter], stop: &Stop) -> Option<&[f64]> {
        if self.probes.get().is_none() {
            let lux = match &self.first {
                // Efforts do not differ in what is reflected once, which many lights takes its time to tell: differences are larger without it.
                First::Many(_) if self.gathers == Gathers::All => {
                    let mut lux = vec![0.0; probes.len()];
                    self.gather(&receivers(probes), &mut lux, stop);
                    (!stop.is_due()).then_some(lux)?
                }
                _ => self.illuminance(probes, stop)?,
            };
            // A thread that was first has found the same.
            let _ = self.probes.set(lux);
        }
        self.probes.get().map(Vec::as_slice)
    }

    /// Area-mean indirect exitance in lm/m².
    #[cfg(test)]
    fn mean_exitance(&self) -> f64 {
        let areas = || (0..self.grid.len()).map(|node| self.grid.node(node).1);
        areas().zip(&self.exitance).map(|(a, m)| a * m).sum::<f64>() / areas().sum::<f64>()
    }

    /// Indirect illuminance at meters inside the room, in lux; `None` where it was stopped.
    pub(super) fn illuminance(&self, meters: &[Meter], stop: &Stop) -> Option<Vec<f64>> {
        if self.gathers == Gathers::Nothing {
            return Some(vec![0.0; meters.len()]);
        }
        let receivers = receivers(meters);
        let mut lux = self.first.irradiance(&receivers, stop);
        if self.gathers == Gathers::All {
            self.gather(&receivers, &mut lux, stop);
        }
        (!stop.is_due()).then_some(lux)
    }

    /// Adds light that was reflected more than once, of what was done before it was stopped.
    fn gather(&self, receivers: &[Receiver], lux: &mut [f64], stop: &Stop) {
        if receivers.len() < FEW {
            lux.iter_mut().zip(receivers).for_each(|(lux, receiver)| *lux += self.gather_one(receiver, stop));
        } else {
            lux.par_iter_mut().zip(receivers).for_each(|(lux, receiver)| *lux += self.gather_one(receiver, stop));
        }
    }

    /// The same at one receiver; 0 where it was stopped.
    fn gather_one(&self, receiver: &Receiver, stop: &Stop) -> f64 {
        if stop.is_due() { 0.0 } else { gmres::dot(&balanced_row(&self.grid, receiver), &self.exitance) }
    }
}

fn receivers(meters: &[Meter]) -> Vec<Receiver> {
    meters.iter().map(|m| Receiver { position_m: m.position_m, normal: m.normal, face: None }).collect()
}

/// A room that loses no light: area in m² and reflectance by orbit.
///
/// Without it, the corners' singularities cost the whole room a few parts in 1e8 at any order, and more where hardly any
/// light is absorbed. Scaling what each node sends by itself moves more light than it saves.
struct Closed(Vec<(f64, f64)>);

impl Closed {
    /// What is reflected more than once, scaled so that as much is absorbed in all as fell on the surfaces first.
    fn converged(&self, known: &[f64], u: &[f64]) -> Vec<f64> {
        let each = self.0.iter().zip(known).zip(u);
        let (reflected, absorbed) = each.fold((0.0, 0.0), |(reflected, absorbed), (((area, rho), g), u)| {
            (reflected + area * rho * g, absorbed + area * (1.0 - rho) * (u - g))
        });
        let scale = if absorbed > 0.0 { reflected / absorbed } else { 1.0 };
        known.iter().zip(u).map(|(g, u)| g + scale * (u - g)).collect()
    }

    /// What one reflection more brings, scaled so that as much falls on the surfaces as left them.
    fn reflected(&self, u: &[f64], further: &[f64]) -> Vec<f64> {
        let each = self.0.iter().zip(u).zip(further);
        let (left, landed) =
            each.fold((0.0, 0.0), |(left, landed), (((area, rho), u), k)| (left + area * rho * u, landed + area * k));
        let scale = if landed > 0.0 { left / landed } else { 1.0 };
        further.iter().map(|k| scale * k).collect()
    }
}

/// Irradiance after all the reflections that count, from that after one and what a further one makes of it.
fn interreflect(
    step: impl Fn(&[f64]) -> Vec<f64>,
    known: &[f64],
    closed: &Closed,
    bounces: Bounces,
    stop: &Stop,
) -> Vec<f64> {
    match bounces {
        Bounces::Converged => closed.converged(known, &gmres::solve(step, known, known.to_vec(), 1e-14)),
        Bounces::AtMost(count) => {
            let mut u = known.to_vec();
            for _ in 2..count {
                let further = closed.reflected(&u, &step(&u));
                let further: Vec<f64> = known.iter().zip(&further).map(|(g, k)| g + k).collect();
                // What another reflection changes by rounding alone, no further one does.
                let is_settled = further.iter().zip(&u).all(|(f, u)| (f - u).abs() <= 4.0 * f64::EPSILON * f.abs());
                u = further;
                if is_settled || stop.is_due() {
                    break;
                }
            }
            u
        }
    }
}

/// The first bounce by orbit, and the relative flux that its values at the nodes would gain or lose.
///
/// Where a jump or a kink of a table crosses an edge of the room, interpolation between nodes misses some flux. A
/// closed room loses none, so the nodes are scaled to carry all of it, and the correction counts as an error.
fn known(grid: &Grid, first: &FirstBounce, orbits: &Orbits, stop: &Stop) -> (Vec<f64>, f64) {
    let receivers: Vec<_> = orbits.representatives.iter().map(|node| receiver_at(grid, *node)).collect();
    let mut known = first.irradiance(&receivers, stop);
    let at_nodes = orbits.orbit.iter().enumerate().map(|(node, orbit)| known[*orbit as usize] * grid.node(node).1);
    let (flux, landed) = (first.reflected_flux(), at_nodes.sum::<f64>());
    if landed == 0.0 {
        return (known, 0.0);
    }
    for value in &mut known {
        *value *= flux / landed;
    }
    (known, (flux / landed - 1.0).abs())
}

fn exitance(irradiance: &[f64], rho: &[f64]) -> Vec<f64> {
    irradiance.iter().zip(rho).map(|(u, rho)| u * rho).collect()
}
