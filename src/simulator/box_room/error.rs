//! How far off an effort may be at a meter, from what it and the two efforts before it have read there and at fixed places of the room.
//!
//! Errors fall by much from order to order where the light is smooth, and by little where a jump of a table crosses an edge of the
//! room; those of two meters of one room may be a hundred times apart. So a meter is judged by its own differences, and by those at
//! the probes, since its own may be small by chance: never by other meters, so that it reads the same in any company. Close in front of
//! a surface the error does not average out. The constants come from 119 random rooms of six kinds, 24 meters each, which
//! `benchmarks/simulator.md` tells more of.

use glam::DVec3;

use super::BoxField;
use crate::geometry::Room;
use crate::scene::Meter;
use crate::simulator::Bounded;
use crate::simulator::stop::Stop;

/// The weight of the difference of the two efforts before against that of the last two.
const EARLIER: f64 = 0.3;
/// The weight of the probes' median against the meter's own.
const ELSEWHERE: f64 = 0.5;
/// The part of the flux that interpolation lost and that scaling gave back which may still be in the wrong place.
const MISPLACED: f64 = 0.25;
/// All of that, times this, bounds the error: of 5,400 ordinary readings in rooms that it was not taken from .77 of it were the most.
const SAFETY: f64 = 1.5;
/// The same where two efforts alone are known, as where it was stopped.
const SAFETY_OF_TWO: f64 = 10.0;
/// Distance from a surface straight ahead, in shortest sides of the room, within which the error may hide in all efforts together: the bound
/// is wider there by the square of what the distance is shorter, at most so many times.
const CLOSE: f64 = 0.5;
const CLOSEST: f64 = 20.0;
/// The same of the edge of two surfaces, by its power of 1.5, anywhere and upon a surface.
const AT_AN_EDGE: f64 = 0.1;
const AT_AN_EDGE_UPON: f64 = 0.3;
/// As near as this to a surface is upon it.
const UPON: f64 = 0.02;
/// Rounding of sums over thousands of terms, relative.
const ROUNDING: f64 = 1e-12;
/// Places that are read besides the meters.
const PROBES: usize = 8;

/// What the efforts so far say of a room.
#[derive(Clone, Debug, Default)]
pub(super) struct History {
    /// Illuminances at each probe, effort by effort.
    probes: Vec<Vec<f64>>,
    /// The median of the probes' differences, the last one first.
    elsewhere: Vec<f64>,
    imbalance: f64,
}

impl History {
    /// Adds an effort; `None` where it was stopped.
    pub(super) fn add(&mut self, field: &BoxField, probes: &[Meter], stop: &Stop) -> Option<()> {
        let lux = field.probes(probes, stop)?;
        self.probes.resize(lux.len(), vec![]);
        self.probes.iter_mut().zip(lux).for_each(|(all, lux)| all.push(*lux));
        let each: Vec<_> = self.probes.iter().map(|lux| differences(lux)).collect();
        let median_of = |back: usize| median(each.iter().filter_map(|d| d.get(back).copied()).collect());
        self.elsewhere = (0..2).map_while(median_of).collect();
        self.imbalance = field.imbalance;
        Some(())
    }

    /// The last reading of a meter with its bound; `None` for fewer than two efforts.
    pub(super) fn bounded(&self, lux: &[f64], room: &Room, meter: &Meter) -> Option<Bounded> {
        let value = *lux.last()?;
        let both = differences(lux).into_iter().zip(&self.elsewhere).map(|(own, probes)| own + ELSEWHERE * probes);
        let both: Vec<f64> = both.collect();
        let (safety, difference) = match both[..] {
            [] => return None,
            [last] => (SAFETY_OF_TWO, last),
            [last, before, ..] => (SAFETY, last + EARLIER * before),
        };
        let close = (CLOSE / ahead(room, meter)).powi(2).max(at_an_edge(room, meter)).clamp(1.0, CLOSEST);
        let relative = safety * (close * difference + MISPLACED * self.imbalance) + ROUNDING;
        Some(Bounded { value, bound: value.abs() * relative })
    }
}

/// Differences of one effort from that before it, the last one first, relative to the last reading.
fn differences(lux: &[f64]) -> Vec<f64> {
    let value = lux.last().copied().unwrap_or(0.0);
    let relative = |pair: &[f64]| if value == 0.0 { 0.0 } else { ((pair[1] - pair[0]) / value).abs() };
    lux.windows(2).rev().map(relative).collect()
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let half = values.len() / 2;
    Some(0.5 * (values.get(half)? + values.get((values.len() - 1) / 2)?))
}

/// Places of which light with these mirrors makes no two alike: as many off every plane of symmetry as there are mirrors, by multiples of the
/// powers of a root of x⁴ = x + 1 (Roberts's sequence), with all their different images. The same in a room that is laid on its side.
pub(super) fn probes(size_m: DVec3, mirrors: &[u8]) -> Vec<Meter> {
    let step = DVec3::new(0.8191725133961645, 0.6710436067037893, 0.5497004779019703);
    let sign = |bits: u8| DVec3::from_array([0, 1, 2].map(|axis| if bits >> axis & 1 == 1 { -1.0 } else { 1.0 }));
    let mut longest_first = [0, 1, 2];
    longest_first.sort_by(|a, b| size_m[*b].total_cmp(&size_m[*a]));
    let along = |values: DVec3| {
        let mut all = DVec3::ZERO;
        longest_first.into_iter().enumerate().for_each(|(k, axis)| all[axis] = values[k]);
        all
    };
    let is_new = |image: &u8| mirrors.iter().all(|mirror| image ^ mirror >= *image);
    let place = |number: u8| {
        let from_middle = along(0.4 - 0.36 * (0.5 + step * f64::from(number + 1)).fract());
        let normal = along(sign(number) * DVec3::new(-0.48, -0.6, -0.64));
        let image = move |image: u8| Meter {
            position_m: size_m * (0.5 + sign(image) * from_middle),
            normal: sign(image) * normal,
        };
        (0..8).filter(is_new).map(image).collect::<Vec<_>>()
    };
    (0..8).flat_map(place).take(PROBES).collect()
}

/// How far away the nearest surface lies that a meter faces, along its normal, in shortest sides of the room.
fn ahead(room: &Room, meter: &Meter) -> f64 {
    let surfaces = (0..3).map(|k| {
        let (x, n) = (meter.position_m[k], meter.normal[k]);
        if n == 0.0 { f64::INFINITY } else { (if n > 0.0 { room.size_m[k] - x } else { x }) / n.abs() }
    });
    surfaces.fold(f64::INFINITY, f64::min) / room.size_m.min_element()
}

/// How many times wider a bound is for the edge that a meter may be at: none is nearer than the second nearest surface.
fn at_an_edge(room: &Room, meter: &Meter) -> f64 {
    let mut distances = [meter.position_m, room.size_m - meter.position_m].map(|d| d.to_array()).concat();
    distances.sort_by(f64::total_cmp);
    let [nearest, second] = [distances[0], distances[1]].map(|m| m / room.size_m.min_element());
    let reach = if nearest <= UPON { AT_AN_EDGE_UPON } else { AT_AN_EDGE };
    (reach / second).powf(1.5)
}
