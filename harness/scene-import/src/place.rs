//! Where placeholders are: a luminaire in the open, not in a slab or outside of an L, and a desk of meters.

use glam::{DVec2, DVec3};
use luxproof_scene::enclosure::Enclosure;

/// Candidate places along each side of the plan.
const STEPS: usize = 9;

/// Candidate cells along each side of the plan, for meters in a room that is no box.
const DESK_STEPS: usize = 16;

/// A gap below this fraction of the scene's height belongs to a slab, a shelf or a body.
const MIN_GAP_FRACTION: f64 = 0.25;

/// The number of large triangles at which a luminaire is tried if no other place is found.
const MAX_MIDDLES: usize = 64;

/// The number of luminaire places around which meters are tried.
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
pub struct MeterGrid {
    pub origin_m: DVec3,
    /// Along x and along y.
    pub step_m: [f64; 2],
    pub counts: [usize; 2],
}

impl MeterGrid {
    pub fn within(low_m: DVec3, high_m: DVec3) -> Self {
        let extent = high_m - low_m;
        let counts = [extent.x, extent.y].map(|extent| extent.floor().clamp(3.0, 20.0));
        let step_m = [extent.x / counts[0], extent.y / counts[1]];
        let height = low_m.z + 0.75_f64.min(0.4 * extent.z);
        let origin_m = DVec3::new(low_m.x + step_m[0] / 2.0, low_m.y + step_m[1] / 2.0, height);
        Self { origin_m, step_m, counts: counts.map(|count| count as usize) }
    }

    /// Where its meters are once it is written.
    pub fn meters(self) -> impl Iterator<Item = DVec3> {
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
        let found = self.plan().iter().find_map(|at| Some((*at, *self.gaps(*at, self.min_gap_m()).first()?)));
        let (at, gap) = found.unwrap_or((middle, (self.low_m.z, self.high_m.z)));
        let lamp_m = if gap.1 > gap.0 { lamp_position(at, gap) } else { at.extend(height_m / 2.0) };
        Place { lamp_m, low_m: self.low_m, high_m: self.high_m }
    }

    /// The highest place near the middle that lies within walls, with meters around it that do; where nothing near
    /// the middle is high enough, wherever there is room.
    pub(super) fn within(&self, walls: &Enclosure) -> Option<Place> {
        let plan = self.plan();
        let high = plan.iter().filter_map(|at| {
            let gap = self.gaps(*at, self.min_gap_m()).into_iter().find(|gap| hangs_within(walls, *at, *gap))?;
            Some((*at, gap))
        });
        let middles = self.middles();
        let any = plan.iter().chain(&middles).filter_map(|at| {
            let highest = self.gaps(*at, 0.0).into_iter().max_by(|a, b| (a.1 - a.0).total_cmp(&(b.1 - b.0)))?;
            hangs_within(walls, *at, highest).then_some((*at, highest))
        });
        high.chain(any).take(MAX_TRIES).find_map(|(at, gap)| self.desk(walls, at, gap))
    }

    /// The least height between two surfaces that counts as part of the room.
    fn min_gap_m(&self) -> f64 {
        MIN_GAP_FRACTION * (self.high_m - self.low_m).z
    }

    /// Places over the plan, those near the middle first; the middle itself is one.
    fn plan(&self) -> Vec<DVec2> {
        let (low, size) = (self.low_m.truncate(), (self.high_m - self.low_m).truncate());
        let middle = ((self.low_m + self.high_m) / 2.0).truncate();
        let places =
            (0..STEPS * STEPS).map(|k| low + size * DVec2::new(step_fraction(k % STEPS), step_fraction(k / STEPS)));
        let mut places: Vec<DVec2> = places.chain([middle]).collect();
        places.sort_by(|a, b| a.distance(middle).total_cmp(&b.distance(middle)));
        places
    }

    /// Below or above the middles of large triangles, the largest first.
    fn middles(&self) -> Vec<DVec2> {
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
            // Barycentric weights in the plan: all of one sign where the line meets the triangle.
            let weights = [[b, c], [c, a], [a, b]].map(|[p, q]| (p.truncate() - at).perp_dot(q.truncate() - at));
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
        let height = MeterGrid::within(low.extend(below), (low + size).extend(above)).origin_m.z;
        let cells = Cells { low, step };
        let is_in: Vec<Vec<bool>> = (0..DESK_STEPS)
            .map(|j| (0..DESK_STEPS).map(|i| walls.contains(cells.middle([i, j]).extend(height), 0.0)).collect())
            .collect();
        let rectangle = largest_rectangle(&is_in).map(|corners| corners.map(|cell| cells.corner(cell)));
        // From the rectangle inwards, since its edges may touch a wall.
        let large = rectangle.into_iter().flat_map(|[a, b]| {
            let about = (a + b) / 2.0;
            (0..8).map(move |k| (about, [a, b].map(|p| about.lerp(p, 1.0 - 0.08 * f64::from(k)))))
        });
        let small = (0..8).map(|k| 0.5_f64.powi(k) * step / 2.0).map(|half| (at, [at - half, at + half]));
        large.chain(small).find_map(|(at, [a, b])| {
            let gap =
                self.gaps(at, 0.0).into_iter().find(|gap| gap.0 <= height && height < lamp_position(at, *gap).z)?;
            let place = Place { lamp_m: lamp_position(at, gap), low_m: a.extend(below), high_m: b.extend(above) };
            lies_within(walls, place).then_some(place)
        })
    }
}

/// Equal cells over the plan, in metres.
struct Cells {
    low: DVec2,
    step: DVec2,
}

impl Cells {
    /// The corner of a cell nearest to the origin of the plan.
    fn corner(&self, [i, j]: [usize; 2]) -> DVec2 {
        self.low + self.step * DVec2::new(i as f64, j as f64)
    }

    /// The middle of a cell.
    fn middle(&self, cell: [usize; 2]) -> DVec2 {
        self.corner(cell) + 0.5 * self.step
    }
}

/// The middle of a step as a fraction of the whole, shifted a little: edges of triangles often run through middles.
fn step_fraction(k: usize) -> f64 {
    (k as f64 + 0.5137) / STEPS as f64
}

/// Twice the area of a triangle as seen from above, in square metres.
fn plan_m2([a, b, c]: &[DVec3; 3]) -> f64 {
    (*b - *a).cross(*c - *a).z.abs()
}

/// Whether the luminaire of a gap lies within the walls.
fn hangs_within(walls: &Enclosure, at: DVec2, gap: (f64, f64)) -> bool {
    walls.contains(written(lamp_position(at, gap)), 0.0)
}

/// Whether a place's luminaire and all its meters lie within the walls.
fn lies_within(walls: &Enclosure, place: Place) -> bool {
    let mut meters = MeterGrid::within(place.low_m, place.high_m).meters();
    walls.contains(written(place.lamp_m), 0.0) && meters.all(|at| walls.contains(at, 0.0))
}

/// The position of a luminaire in a gap: a little below the upper surface.
fn lamp_position(at: DVec2, (below, above): (f64, f64)) -> DVec3 {
    at.extend(above - (0.2 * (above - below)).min(0.3))
}

/// The number of cells in a rectangle.
const fn cell_count([[i, j], [k, l]]: [[usize; 2]; 2]) -> usize {
    (k - i) * (l - j)
}

/// The largest rectangle of cells that are all in: its first column and row, and those behind its last.
fn largest_rectangle(is_in: &[Vec<bool>]) -> Option<[[usize; 2]; 2]> {
    let n = is_in.len();
    let mut best = None;
    for (from, to) in (0..n).flat_map(|from| (from + 1..=n).map(move |to| (from, to))) {
        let mut start = 0;
        for column in 0..n {
            if !is_in[from..to].iter().all(|row| row[column]) {
                start = column + 1;
                continue;
            }
            let found = [[start, from], [column + 1, to]];
            if best.is_none_or(|best| cell_count(found) > cell_count(best)) {
                best = Some(found);
            }
        }
    }
    best
}
