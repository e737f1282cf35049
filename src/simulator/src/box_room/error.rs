//! How far off an effort may be at a meter, from what it and the two efforts before it have read there and at fixed places of the room.
//!
//! Errors fall by much from order to order where the light is smooth, and by little where a jump of a table crosses an edge of the
//! room; those of two meters of one room may be a hundred times apart. So a meter is judged by its own differences, and by those at
//! the probes, since its own may be small by chance: never by other meters, so that it reads the same in any company. Close in front of
//! a surface the error does not average out. The constants come from 119 random rooms of six kinds, 24 meters each, which
//! `benchmarks/simulator.md` tells more of.

use glam::DVec3;

use super::BoxField;
use crate::Bounded;
use crate::stop::Stop;
use luxproof_scene::Meter;
use luxproof_scene::geometry::Room;

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
        self.elsewhere =
            (0..2).map_while(|back| median(each.iter().filter_map(|d| d.get(back).copied()).collect())).collect();
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
    let pairs = lux.windows(2).rev();
    pairs.map(|pair| if value == 0.0 { 0.0 } else { ((pair[1] - pair[0]) / value).abs() }).collect()
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
    let mut longest_first = [0, 1, 2];
    longest_first.sort_by(|a, b| size_m[*b].total_cmp(&size_m[*a]));
    let mut probes = vec![];
    for number in 0..8 {
        let from_middle = along_axes(longest_first, 0.4 - 0.36 * (0.5 + step * f64::from(number + 1)).fract());
        let normal = along_axes(longest_first, signs(number) * DVec3::new(-0.48, -0.6, -0.64));
        for image in (0..8_u8).filter(|image| mirrors.iter().all(|mirror| image ^ mirror >= *image)) {
            let position_m = size_m * (0.5 + signs(image) * from_middle);
            probes.push(Meter { position_m, normal: signs(image) * normal });
        }
    }
    probes.truncate(PROBES);
    probes
}

/// -1 along the axes whose bit is set, else 1.
fn signs(bits: u8) -> DVec3 {
    DVec3::from_array([0, 1, 2].map(|axis| if bits >> axis & 1 == 1 { -1.0 } else { 1.0 }))
}

/// A vector with its k-th value along the k-th of these axes.
fn along_axes(axes: [usize; 3], values: DVec3) -> DVec3 {
    let mut all = DVec3::ZERO;
    for (k, axis) in axes.into_iter().enumerate() {
        all[axis] = values[k];
    }
    all
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

#[cfg(test)]
mod tests {
    use super::*;
    use luxproof_scene::geometry::Reflectances;

    /// The bound of a meter in a room of 4 m by 5 m by 2 m, from these readings; elsewhere efforts differ by 1 % and 2 %.
    fn bound(lux: &[f64], position_m: [f64; 3], normal: DVec3) -> f64 {
        let room =
            Room { size_m: DVec3::new(4.0, 5.0, 2.0), reflectance: Reflectances::with_equal_walls(0.2, 0.5, 0.7) };
        let history = History { probes: vec![], elsewhere: vec![0.01, 0.02], imbalance: 0.004 };
        history.bounded(lux, &room, &Meter { position_m: position_m.into(), normal }).unwrap().bound
    }

    #[test]
    fn a_bound_rests_on_the_differences_of_three_efforts_here_and_elsewhere() {
        // In the middle of the room, 1 m = half of its shortest side from the ceiling ahead and from the floor.
        let found = bound(&[96.0, 98.0, 100.0], [2.0, 2.5, 1.0], DVec3::Z);
        // Own differences of 2 % each, half of those elsewhere, and a quarter of the imbalance.
        let [last, before] = [0.02 + 0.5 * 0.01, 0.02 + 0.5 * 0.02];
        let expected = 100.0 * 1.5 * (last + 0.3 * before + 0.25 * 0.004);
        assert!((found - expected).abs() < 1e-9, "{found} {expected}");
        // Of two efforts less is known.
        let found = bound(&[98.0, 100.0], [2.0, 2.5, 1.0], DVec3::Z);
        assert!((found - 100.0 * 10.0 * (last + 0.25 * 0.004)).abs() < 1e-9, "{found}");
    }

    #[test]
    fn close_in_front_of_a_surface_a_bound_is_wider_by_the_square_of_the_distance() {
        let difference = 0.025 + 0.3 * 0.03;
        // A quarter of the shortest side ahead, then a tenth, then so near that the factor ends at 20.
        for (distance_m, factor) in [(0.5, 4.0), (0.2, 20.0), (0.25, 16.0), (0.01, 20.0)] {
            let found = bound(&[96.0, 98.0, 100.0], [2.0, 2.5, 2.0 - distance_m], DVec3::Z);
            let expected = 100.0 * 1.5 * (factor * difference + 0.25 * 0.004);
            assert!((found - expected).abs() < 1e-9, "{distance_m}: {found} {expected}");
            // A meter that turns its back to the surface is not close to it.
            let away = bound(&[96.0, 98.0, 100.0], [2.0, 2.5, 2.0 - distance_m], DVec3::NEG_Z);
            assert!(away < found, "{distance_m}: {away} {found}");
        }
    }

    #[test]
    fn near_an_edge_a_bound_is_wider_by_the_power_of_one_and_a_half() {
        // Free of surfaces: .05 of the shortest side from the second nearest. Upon one, three times as far counts.
        for (position_m, reach) in [([0.08, 0.1, 1.0], 0.1), ([0.02, 0.1, 1.0], 0.3)] {
            let found = bound(&[96.0, 98.0, 100.0], position_m, DVec3::X);
            let factor = f64::powf(reach / 0.05, 1.5);
            let expected = 100.0 * 1.5 * (factor * (0.025 + 0.3 * 0.03) + 0.25 * 0.004);
            assert!((found - expected).abs() < 1e-9, "{position_m:?}: {found} {expected}");
        }
    }
}
