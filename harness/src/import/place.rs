//! Where placeholders are: a luminaire in the open, not in a slab or outside of an L, and a desk of meters.

use glam::{DVec2, DVec3};
use luminaire::scene::enclosure::Enclosure;

/// Places along either side of the plan that are looked at.
const STEPS: usize = 9;

/// The same, for meters in a room that is no box.
const DESK_STEPS: usize = 16;

/// What is lower than this part of the scene's height is a slab, a shelf or a body.
const LOW: f64 = 0.25;

/// The largest triangles of walls above or below whose middle a luminaire is tried, if it is nowhere else.
const MAX_MIDDLES: usize = 64;

/// In so many places of a luminaire meters around it are tried.
const MAX_TRIES: usize = 8;

/// Where a luminaire hangs, and the box in which meters are to lie, in metres, in the room.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    pub lamp_m: DVec3,
    pub low_m: DVec3,
    pub high_m: DVec3,
}

/// A grid of meters at desk height in a box, half a metre and more to a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Desk {
    pub origin_m: DVec3,
    /// Along x and along y.
    pub step_m: [f64; 2],
    pub counts: [usize; 2],
}

impl Desk {
    pub fn within(low_m: DVec3, high_m: DVec3) -> Self {
        let extent = high_m - low_m;
        let counts = [extent.x, extent.y].map(|extent| extent.floor().clamp(3.0, 20.0));
        let step_m = [extent.x / counts[0], extent.y / counts[1]];
        let height = low_m.z + 0.75_f64.min(0.4 * extent.z);
        let origin_m = DVec3::new(low_m.x + step_m[0] / 2.0, low_m.y + step_m[1] / 2.0, height);
        Self { origin_m, step_m, counts: counts.map(|count| count as usize) }
    }

    /// Where its meters are once it is written.
    fn meters(self) -> impl Iterator<Item = DVec3> {
        let (origin, [dx, dy]) = (written(self.origin_m), self.step_m.map(to_written));
        let [nx, ny] = self.counts;
        (0..nx * ny).map(move |k| origin + DVec3::new(dx * (k % nx) as f64, dy * (k / nx) as f64, 0.0))
    }
}

/// A length as a spec has it, to a tenth of a millimetre.
fn to_written(length_m: f64) -> f64 {
    format!("{length_m:.4}").parse().unwrap_or(length_m)
}

fn written(at: DVec3) -> DVec3 {
    at.to_array().map(to_written).into()
}

/// What bounds the places: the box around them and the triangles in it.
#[derive(Debug)]
pub(super) struct Space {
    pub(super) low_m: DVec3,
    pub(super) high_m: DVec3,
    /// In the room.
    pub(super) triangles: Vec<[DVec3; 3]>,
    /// Whether the box itself is the room.
    pub(super) is_room: bool,
}

impl Space {
    /// The highest place near the middle that has surfaces above and below it; the middle of a room of some height
    /// where there is none.
    pub(super) fn anywhere(&self, height_m: f64) -> Place {
        let middle = ((self.low_m + self.high_m) / 2.0).truncate();
        let found = self.plan().iter().find_map(|at| Some((*at, *self.gaps(*at, self.least()).first()?)));
        let (at, gap) = found.unwrap_or((middle, (self.low_m.z, self.high_m.z)));
        let lamp_m = if gap.1 > gap.0 { hung(at, gap) } else { at.extend(height_m / 2.0) };
        Place { lamp_m, low_m: self.low_m, high_m: self.high_m }
    }

    /// The highest place near the middle that lies within walls, with meters around it that do; where nothing near
    /// the middle is high enough, wherever there is room.
    pub(super) fn within(&self, walls: &Enclosure) -> Option<Place> {
        let plan = self.plan();
        let is_in = |at: DVec2, gap: (f64, f64)| walls.contains(written(hung(at, gap)), 0.0);
        let high = plan.iter().filter_map(|at| {
            let gap = self.gaps(*at, self.least()).into_iter().find(|gap| is_in(*at, *gap))?;
            Some((*at, gap))
        });
        let middles = self.middles();
        let any = plan.iter().chain(&middles).filter_map(|at| {
            let height = |gap: &(f64, f64)| gap.1 - gap.0;
            let highest = self.gaps(*at, 0.0).into_iter().max_by(|a, b| height(a).total_cmp(&height(b)))?;
            is_in(*at, highest).then_some((*at, highest))
        });
        high.chain(any).take(MAX_TRIES).find_map(|(at, gap)| self.desk(walls, at, gap))
    }

    fn least(&self) -> f64 {
        LOW * (self.high_m - self.low_m).z
    }

    /// Places over the plan, those near the middle first; the middle itself is one.
    fn plan(&self) -> Vec<DVec2> {
        let (low, size) = (self.low_m.truncate(), (self.high_m - self.low_m).truncate());
        let middle = ((self.low_m + self.high_m) / 2.0).truncate();
        // Off the middle by less than a step, where edges of triangles are.
        let part = |k: usize| (k as f64 + 0.5137) / STEPS as f64;
        let places = (0..STEPS * STEPS).map(|k| low + size * DVec2::new(part(k % STEPS), part(k / STEPS)));
        let mut places: Vec<DVec2> = places.chain([middle]).collect();
        places.sort_by(|a, b| a.distance(middle).total_cmp(&b.distance(middle)));
        places
    }

    /// Below or above the middles of large triangles, the largest first.
    fn middles(&self) -> Vec<DVec2> {
        let plan_m2 = |[a, b, c]: &[DVec3; 3]| (*b - *a).cross(*c - *a).z.abs();
        let mut largest: Vec<&[DVec3; 3]> = self.triangles.iter().collect();
        largest.sort_by(|a, b| plan_m2(b).total_cmp(&plan_m2(a)));
        largest.iter().take(MAX_MIDDLES).map(|corners| (corners.iter().sum::<DVec3>() / 3.0).truncate()).collect()
    }

    /// From what to what there is nothing on a vertical line, the highest first, if it is so high at least.
    fn gaps(&self, at: DVec2, least_m: f64) -> Vec<(f64, f64)> {
        let heights = self.heights(at);
        let gaps = heights.windows(2).rev().map(|pair| (pair[0], pair[1]));
        gaps.filter(|(below, above)| above - below >= least_m && above > below).collect()
    }

    /// Where a vertical line meets surfaces, from below.
    fn heights(&self, at: DVec2) -> Vec<f64> {
        let mut heights = if self.is_room { vec![self.low_m.z, self.high_m.z] } else { vec![] };
        heights.extend(self.triangles.iter().filter_map(|[a, b, c]| {
            let flat = |p: &DVec3, q: &DVec3| (p.truncate() - at).perp_dot(q.truncate() - at);
            let weights = [flat(b, c), flat(c, a), flat(a, b)];
            let sum: f64 = weights.iter().sum();
            let is_met = sum != 0.0 && weights.iter().all(|w| w * sum >= 0.0);
            is_met.then(|| (weights[0] * a.z + weights[1] * b.z + weights[2] * c.z) / sum)
        }));
        heights.sort_by(f64::total_cmp);
        heights
    }

    /// The largest box of meters at the height of a desk below a place, as far as places over the plan tell, with the
    /// luminaire above its middle; or what there is around that place.
    fn desk(&self, walls: &Enclosure, at: DVec2, (below, above): (f64, f64)) -> Option<Place> {
        let (low, size) = (self.low_m.truncate(), (self.high_m - self.low_m).truncate());
        let step = size / DESK_STEPS as f64;
        let height = Desk::within(low.extend(below), (low + size).extend(above)).origin_m.z;
        let corner = |[i, j]: [usize; 2]| low + step * DVec2::new(i as f64, j as f64);
        let is_cell_in = |i, j| walls.contains((corner([i, j]) + 0.5 * step).extend(height), 0.0);
        let is_in: Vec<Vec<bool>> =
            (0..DESK_STEPS).map(|j| (0..DESK_STEPS).map(|i| is_cell_in(i, j)).collect()).collect();
        let large = largest(&is_in).map(|[from, to]| [corner(from), corner(to)]);
        let large = large.into_iter().flat_map(|[a, b]| {
            let about = (a + b) / 2.0;
            (0..8).map(move |k| (about, [a, b].map(|p| about.lerp(p, 1.0 - 0.08 * f64::from(k)))))
        });
        let small = (0..8).map(|k| 0.5_f64.powi(k) * step / 2.0).map(|half| (at, [at - half, at + half]));
        let place = |(at, [a, b]): (DVec2, [DVec2; 2])| {
            let gap = self.gaps(at, 0.0).into_iter().find(|gap| gap.0 <= height && height < hung(at, *gap).z)?;
            let place = Place { lamp_m: hung(at, gap), low_m: a.extend(below), high_m: b.extend(above) };
            let mut meters = Desk::within(place.low_m, place.high_m).meters();
            let is_in = |at: DVec3| walls.contains(at, 0.0);
            (is_in(written(place.lamp_m)) && meters.all(is_in)).then_some(place)
        };
        large.chain(small).find_map(place)
    }
}

/// A little below what is above.
fn hung(at: DVec2, (below, above): (f64, f64)) -> DVec3 {
    at.extend(above - (0.2 * (above - below)).min(0.3))
}

/// Of rectangles of cells that are all in the largest: its first column and row, and those behind its last.
fn largest(is_in: &[Vec<bool>]) -> Option<[[usize; 2]; 2]> {
    let n = is_in.len();
    let area = |[[i, j], [k, l]]: [[usize; 2]; 2]| (k - i) * (l - j);
    let mut best = None;
    for (from, to) in (0..n).flat_map(|from| (from + 1..=n).map(move |to| (from, to))) {
        let mut start = 0;
        for column in 0..n {
            if !is_in[from..to].iter().all(|row| row[column]) {
                start = column + 1;
                continue;
            }
            let found = [[start, from], [column + 1, to]];
            if best.is_none_or(|best| area(found) > area(best)) {
                best = Some(found);
            }
        }
    }
    best
}
