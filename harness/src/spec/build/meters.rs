//! Sets of meters: points or a grid, all of them in the room and out of what stands there.

use glam::DVec3;
use luminaire::geometry::Surface;
use luminaire::scene::enclosure::Enclosure;
use luminaire::scene::{Meter, Scene, Shape};

use super::super::model::{GridSpec, MeterSet, SurfaceGridSpec};
use super::{BEYOND, Builder, MAX_METERS, within};

/// Nearest a meter or a luminaire may come to a surface, relative to the room's largest extent.
///
/// On the surface itself a renderer's answer depends on rounding, and so would ours.
const SURFACE_MARGIN: f64 = 1e-9;

/// As many pairs of a point and a face of the room tell whether it lies within.
const MAX_LOOKS: usize = 20_000_000;

/// Below this sine two steps of a grid have one direction.
const FLAT: f64 = 1e-9;

impl Builder<'_> {
    pub(super) fn meter_set(
        &mut self,
        name: &str,
        set: &MeterSet,
        scene: &Scene,
        enclosure: Option<&Enclosure>,
    ) -> Option<Vec<Meter>> {
        let at = format!("meters.{name}");
        let normals = self.normals(&at, set);
        let directions = set.around.map_or(1, |around| around.count.min(MAX_METERS));
        let (mut points, written) = self.points(&at, set, directions, scene)?;
        let mut unseen = enclosure;
        if let (Some(grid), Some(enclosure)) = (set.surface, enclosure) {
            // Of the floor and ceiling of a room that is no box there is less than of the box's.
            let margin_m = grid.margin_m.max(SURFACE_MARGIN * enclosure.room.size_m.max_element());
            points.retain(|point| enclosure.contains(*point, margin_m));
            unseen = None;
        }
        self.check(!points.is_empty(), &at, "the set holds no points", "give at least one");
        self.places(name, &points, written, scene, unseen);
        let normals = normals?;
        let all = points.into_iter().flat_map(|position_m| normals.iter().map(move |n| (position_m, *n)));
        Some(all.map(|(position_m, normal)| Meter { position_m, normal }).collect())
    }

    /// Where a set's points are, and by which of its keys.
    fn points(&mut self, at: &str, set: &MeterSet, directions: usize, scene: &Scene) -> Option<(Vec<DVec3>, Written)> {
        let is_few = |this: &mut Self, count: usize| {
            let meters = count.saturating_mul(directions);
            let message = format!("{meters} meters");
            let sound = this.check(meters <= MAX_METERS, at, message, format!("a set has {MAX_METERS} meters at most"));
            sound && this.take(at, "meters", meters, |left| &mut left.meters)
        };
        match (&set.points_m, &set.grid, &set.line, &set.surface) {
            (Some(points), None, None, None) => {
                let points = is_few(self, points.len()).then(|| points.iter().map(|p| DVec3::from(*p)).collect())?;
                Some((points, Written::OneByOne))
            }
            (None, Some(grid), None, None) => {
                let count = self.count(at, grid)?;
                is_few(self, count).then(|| (points_of(grid), Written::By("grid")))
            }
            (None, None, Some(line), None) => {
                let help = format!("give from 2 to {MAX_METERS} points");
                let message = format!("{} points on a line", line.count);
                let sound = (2..=MAX_METERS).contains(&line.count);
                let sound = self.check(sound, &format!("{at}.line.count"), message, help);
                let (from, to) = (DVec3::from(line.from_m), DVec3::from(line.to_m));
                let help = "give two points that lie apart, in metres";
                let apart = self.check(from != to, &format!("{at}.line"), "the line has no length", help);
                let point = |k: usize| from.lerp(to, k as f64 / (line.count - 1) as f64);
                (sound && apart && is_few(self, line.count))
                    .then(|| ((0..line.count).map(point).collect(), Written::By("line")))
            }
            (None, None, None, Some(grid)) => {
                let cells = self.cells(at, grid, scene)?;
                is_few(self, cells.count()).then(|| (cells.middles(), Written::By("surface")))
            }
            _ => {
                let message = "a meter set is given in one way";
                self.check(false, at, message, "give exactly one of `points_m`, `grid`, `line` and `surface`");
                None
            }
        }
    }

    /// The directions that every point of a set faces.
    fn normals(&mut self, at: &str, set: &MeterSet) -> Option<Vec<DVec3>> {
        if let Some(around) = set.around {
            let message = "it faces one way and all around at once";
            let one = self.check(set.normal.is_none(), at, message, "give exactly one of `normal` and `around`");
            let axis = unit(around.axis);
            let help = "give a vector other than zero";
            self.check(axis.is_some(), &format!("{at}.around.axis"), "the axis has no direction", help);
            let sound = (1..=MAX_METERS).contains(&around.count);
            let (message, help) = (format!("{} directions", around.count), format!("give from 1 to {MAX_METERS}"));
            let sound = self.check(sound, &format!("{at}.around.count"), message, help);
            return axis.filter(|_| one && sound).map(|axis| about(axis, around.count));
        }
        let own = set.surface.map(|grid| Surface::from(grid.of).inward_normal().to_array());
        let Some(normal) = set.normal.or(own) else {
            let help = "give the direction that its meters face, or `around`";
            self.check(false, at, "missing field `normal`: its meters face nowhere", help);
            return None;
        };
        let normal = unit(normal);
        let message = "the normal has no direction";
        self.check(normal.is_some(), &format!("{at}.normal"), message, "give a vector other than zero");
        normal.map(|normal| vec![normal])
    }

    /// The cells of a grid over a surface.
    fn cells(&mut self, at: &str, grid: &SurfaceGridSpec, scene: &Scene) -> Option<Cells> {
        let room = scene.room.as_ref()?;
        let at = |field: &str| format!("{at}.surface.{field}");
        let surface = Surface::from(grid.of);
        let (axis, sides) = (surface.axis(), sides_of(surface));
        let depth_m = room.size_m[axis];
        let is_in = grid.distance_m > 0.0 && grid.distance_m < depth_m;
        let message = format!("{} m from the {} is not in the room", grid.distance_m, surface.name());
        let is_in = self.check(is_in, &at("distance_m"), message, format!("give metres between 0 and {depth_m}"));
        let lengths_m = sides.map(|side| room.size_m[side] - 2.0 * grid.margin_m);
        let is_left = grid.margin_m >= 0.0 && lengths_m.iter().all(|l| *l > 0.0);
        let message = format!("a margin of {} m leaves nothing of the {}", grid.margin_m, surface.name());
        let is_left = self.check(is_left, &at("margin_m"), message, "give metres from 0, less than half of each side");
        if !is_in || !is_left {
            return None;
        }
        let counts = grid.counts.unwrap_or_else(|| counts_of_en_12464(lengths_m));
        let product = counts[0].checked_mul(counts[1]).filter(|n| (1..=MAX_METERS).contains(n));
        let message = format!("{} x {} cells", counts[0], counts[1]);
        let help = format!("give counts whose product lies between 1 and {MAX_METERS}");
        self.check(product.is_some(), &at("counts"), message, help).then_some(())?;
        let mut corner_m = DVec3::ZERO;
        corner_m[axis] = if surface.is_far() { depth_m - grid.distance_m } else { grid.distance_m };
        let steps_m = [0, 1].map(|k| {
            corner_m[sides[k]] = grid.margin_m;
            let mut step = DVec3::ZERO;
            step[sides[k]] = lengths_m[k] / counts[k] as f64;
            step
        });
        Some(Cells { corner_m, steps_m, counts })
    }

    /// Tells the first meter that no light could be measured at, and how many more there are.
    fn places(&mut self, name: &str, points: &[DVec3], written: Written, scene: &Scene, enclosure: Option<&Enclosure>) {
        // Of a mesh of many faces each is looked at for each point.
        let stride = points.len().saturating_mul(enclosure.map_or(0, Enclosure::faces)).div_ceil(MAX_LOOKS).max(1);
        let around = |k: usize| enclosure.filter(|_| k.is_multiple_of(stride));
        let fault = |(k, point): (usize, &'_ DVec3)| Some((k, *point, misplaced(*point, scene, around(k))?));
        let mut wrong = points.iter().enumerate().filter_map(fault);
        let Some((k, point, (message, help))) = wrong.next() else { return };
        let others = others(wrong.count());
        let at = format!("meters.{name}");
        let (at, whole) = match (written, points.first().zip(points.last())) {
            (Written::By(key), Some((first, last))) => {
                (format!("{at}.{key}"), format!("; the {key} reaches from {first} to {last}"))
            }
            _ => (format!("{at}.points_m[{k}]"), String::new()),
        };
        self.check(false, &at, format!("{name}[{k}] at {point} {message}{others}{whole}"), help);
    }

    /// How many points a grid has.
    fn count(&mut self, at: &str, grid: &GridSpec) -> Option<usize> {
        let [nu, nv] = grid.counts;
        let count = nu.checked_mul(nv).filter(|n| (1..=MAX_METERS).contains(n));
        let help = format!("give counts whose product lies between 1 and {MAX_METERS}");
        self.check(count.is_some(), &format!("{at}.grid.counts"), format!("{nu} x {nv} points"), help);
        let (u, v) = (DVec3::from(grid.u_m), DVec3::from(grid.v_m));
        for (name, step, count) in [("u_m", u, nu), ("v_m", v, nv)] {
            let help = "give the step from one point to the next, in metres";
            let is_step = count < 2 || step != DVec3::ZERO;
            self.check(is_step, &format!("{at}.grid.{name}"), "no step: points of the grid lie in one place", help);
        }
        // What is too short to tell is told above.
        let (sine, whole) = (u.cross(v).length(), u.length() * v.length());
        let is_plane = nu < 2 || nv < 2 || whole == 0.0 || sine > FLAT * whole;
        let help = "give two directions that span a plane, or one count of 1 for a line";
        self.check(is_plane, &format!("{at}.grid.v_m"), "it runs along u_m: the grid is a line", help);
        count
    }
}

/// How many meters besides one are wrong.
pub(super) fn others(count: usize) -> String {
    match count {
        0 => String::new(),
        1 => ", and another is as wrong".to_owned(),
        n => format!(", and {n} others are as wrong"),
    }
}

/// How a spec gives points.
#[derive(Clone, Copy)]
enum Written {
    OneByOne,
    /// All together, under this key.
    By(&'static str),
}

/// Equal cells side by side.
struct Cells {
    corner_m: DVec3,
    steps_m: [DVec3; 2],
    counts: [usize; 2],
}

impl Cells {
    const fn count(&self) -> usize {
        self.counts[0] * self.counts[1]
    }

    /// The first axis fastest.
    fn middles(&self) -> Vec<DVec3> {
        let ([nu, nv], [u, v]) = (self.counts, self.steps_m);
        let middle = |i: usize, j: usize| self.corner_m + u * (i as f64 + 0.5) + v * (j as f64 + 0.5);
        (0..nv).flat_map(|j| (0..nu).map(move |i| (i, j))).map(|(i, j)| middle(i, j)).collect()
    }
}

/// The axes along a surface: x and y, or the horizontal one and z.
const fn sides_of(surface: Surface) -> [usize; 2] {
    match surface.axis() {
        0 => [1, 2],
        1 => [0, 2],
        _ => [0, 1],
    }
}

/// Points along both sides of an area by EN 12464-1:2021, 5.4: cells no larger than p = .2 x 5^log10(d) metres, d the longer side or, where it
/// is twice the shorter and more, the shorter one, and no more than twice as long as wide.
fn counts_of_en_12464([a, b]: [f64; 2]) -> [usize; 2] {
    let (longer, shorter) = (a.max(b), a.min(b));
    let d = if longer >= 2.0 * shorter { shorter } else { longer };
    let largest_m = (0.2 * 5_f64.powf(d.log10())).min(10.0);
    // Whole numbers stay what they are.
    let count = |side: f64| ((side / largest_m - 1e-9).ceil() as usize).max(1);
    let mut counts = [count(a), count(b)];
    let cell = |counts: [usize; 2]| [a / counts[0] as f64, b / counts[1] as f64];
    for k in [0, 1] {
        let [wide, long] = [cell(counts)[1 - k], cell(counts)[k]];
        if long > 2.0 * wide {
            counts[k] = (counts[k] as f64 * long / (2.0 * wide)).ceil() as usize;
        }
    }
    counts
}

fn unit(vector: [f64; 3]) -> Option<DVec3> {
    let vector = DVec3::from(vector);
    vector.try_normalize().filter(|_| vector.is_finite())
}

/// So many unit vectors perpendicular to a unit vector, at even steps about it; of an upright one the first is +x.
fn about(axis: DVec3, count: usize) -> Vec<DVec3> {
    let across = if axis.x.abs() < 0.9 { DVec3::X } else { DVec3::Y };
    let first = across.reject_from_normalized(axis).normalize();
    let second = axis.cross(first);
    let step = std::f64::consts::TAU / count as f64;
    (0..count).map(|k| step * k as f64).map(|turn| (first * turn.cos() + second * turn.sin()).normalize()).collect()
}

fn points_of(grid: &GridSpec) -> Vec<DVec3> {
    let [nu, nv] = grid.counts;
    let (origin, u, v) = (DVec3::from(grid.origin_m), DVec3::from(grid.u_m), DVec3::from(grid.v_m));
    (0..nv).flat_map(|j| (0..nu).map(move |i| origin + u * i as f64 + v * j as f64)).collect()
}

/// What is wrong with a meter at this point, and what to do.
fn misplaced(point: DVec3, scene: &Scene, enclosure: Option<&Enclosure>) -> Option<(&'static str, String)> {
    let room = scene.room.as_ref()?;
    let margin = SURFACE_MARGIN * room.size_m.max_element();
    if !point.is_finite() || !room.contains(point, -margin) {
        return Some(("lies outside the room", within(room)));
    }
    if !room.contains(point, margin) {
        let help = "a meter on a surface sees half of nothing: move it inwards, by 1e-6 m say".to_owned();
        return Some(("lies on a surface of the room", help));
    }
    if enclosure.is_some_and(|e| !e.contains(point, margin)) {
        return Some(("lies outside the room's walls, or on one", BEYOND.to_owned()));
    }
    let inside = |shape: &Shape| match shape {
        Shape::Box { min_m, max_m } => point.cmpge(*min_m).all() && point.cmple(*max_m).all(),
        Shape::Mesh { .. } => false,
    };
    if scene.obstacles.iter().any(|o| inside(&o.shape)) {
        return Some(("lies inside an obstacle or on its surface", "move it out, by 1e-6 m at least".to_owned()));
    }
    if scene.luminaires.iter().any(|l| l.position_m.distance(point) <= margin) {
        return Some(("lies in a luminaire's photometric centre", "move it away".to_owned()));
    }
    None
}
