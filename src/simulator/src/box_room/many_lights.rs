//! The first bounce of very many luminaires, in time that grows little with the nodes of the grid.
//!
//! Integrating each luminaire's light for each node takes 30 ms a luminaire. Here its flux is shared out among the nodes
//! once, as moments with their polynomials: the projection of the first bounce's exitance, which the operator then takes
//! on like any other exitance. What that misses is orthogonal to the polynomials, and the kernel nearly is one of them.
//! Meters read the first bounce as it is, once for all efforts. Luminaires are made a few at a time and forgotten.

use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;

use super::first_bounce::FirstBounce;
use super::grid::Grid;
use super::kernel::Receiver;
use super::{EFFORTS, Effort};
use crate::stop::Stop;
use luxproof_scene::Luminaire;
use luxproof_scene::geometry::Room;

/// Relative flux that may be in the wrong place at any effort: where steps of tables cross elements, no order helps.
pub(super) const MISPLACED: f64 = 4e-4;
/// How finely meters read the first bounce: to 3e-6 within 0.1 mm of a surface.
const FOR_METERS: Effort = EFFORTS[4];
/// Luminaires that are made together.
const TOGETHER: usize = 8;
/// Readings that are kept: of the meters last asked for.
const KEPT: usize = 4;

/// Many luminaires in a room.
#[derive(Debug)]
pub(super) struct ProjectedSources {
    room: Room,
    luminaires: Vec<Luminaire>,
    read: Mutex<Vec<(Vec<Receiver>, Vec<f64>)>>,
}

impl ProjectedSources {
    pub(super) fn new(room: &Room, luminaires: &[Luminaire]) -> Self {
        Self { room: *room, luminaires: luminaires.to_vec(), read: Mutex::default() }
    }

    /// Irradiance at receivers, in lux, of light reflected once.
    pub(super) fn irradiance(&self, receivers: &[Receiver], stop: &Stop) -> Vec<f64> {
        let read = || self.read.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, lux)) = read().iter().find(|(of, _)| of == receivers) {
            return lux.clone();
        }
        let lux = self.sum(&FOR_METERS, stop, |some| some.irradiance(receivers, stop));
        if stop.is_due() {
            return vec![0.0; receivers.len()];
        }
        let mut read = read();
        read.truncate(KEPT - 1);
        read.insert(0, (receivers.to_vec(), lux.clone()));
        lux
    }

    /// Direct irradiance in lux for the nodes to stand for: its moments with their polynomials are those of the light.
    pub(super) fn projected(&self, grid: &Grid, effort: &Effort, stop: &Stop) -> Vec<f64> {
        let mut lux = self.sum(effort, stop, |some| some.at_nodes(grid));
        lux.resize(grid.len(), 0.0);
        for (node, value) in lux.iter_mut().enumerate() {
            *value /= grid.node(node).1;
        }
        lux
    }

    /// Sums in the same order on any number of threads; of those alone that were done before it was stopped.
    fn sum(&self, effort: &Effort, stop: &Stop, of: impl Fn(&FirstBounce) -> Vec<f64> + Sync) -> Vec<f64> {
        let some = |some: &[Luminaire]| (!stop.is_due()).then(|| of(&FirstBounce::new(&self.room, some, effort)));
        let parts: Vec<_> = self.luminaires.par_chunks(TOGETHER).filter_map(some).collect();
        let mut parts = parts.into_iter();
        let mut total = parts.next().unwrap_or_default();
        for part in parts {
            total.iter_mut().zip(part).for_each(|(sum, value)| *sum += value);
        }
        total
    }
}
