//! Builds sets of meters and checks that every meter lies in the room and outside obstacles.

use glam::DVec3;
use luxproof_scene::enclosure::Enclosure;
use luxproof_scene::geometry::Surface;
use luxproof_scene::{Meter, Scene, Shape};

use super::super::model::{GridSpec, MeterSet, SurfaceGridSpec};
use super::{Builder, MAX_METERS, beyond_walls, within};
use crate::length_unit::LengthUnit;

/// The least distance of a meter or luminaire from a surface, relative to the room's largest extent.
///
/// On the surface itself every renderer's answer depends on rounding.
const SURFACE_MARGIN: f64 = 1e-9;
/// How far messages advise to move a meter off a surface, in metres.
const LEAST_MOVE_M: f64 = 1e-3;

/// The most pairs of a point and a face of the room that one set's check tests.
const MAX_LOOKS: usize = 20_000_000;

/// Below this sine two steps of a grid have one direction.
const MIN_SINE: f64 = 1e-9;

/// The meters of a set.
pub(super) struct BuiltSet {
    pub(super) meters: Vec<Meter>,
    /// Points of a surface of the box around the room that lie outside the room's walls, or in the margin.
    pub(super) left_out: usize,
}

impl Builder<'_> {
    pub(super) fn meter_set(
        &mut self,
        name: &str,
        set: &MeterSet,
        scene: &Scene,
        enclosure: Option<&Enclosure>,
    ) -> Option<BuiltSet> {
        let at = format!("meters.{name}");
        let normals = self.normals(&at, set);
        let directions = set.around.map_or(1, |around| around.count.min(MAX_METERS));
        let (mut points, written) = self.points(&at, set, directions, scene)?;
        let mut unseen = enclosure;
        let asked = points.len();
        if let (Some(grid), Some(enclosure)) = (set.surface, enclosure) {
            // Of a surface of a room that is no box there is less than of the box's.
            let rounding_m = SURFACE_MARGIN * enclosure.room.size_m.max_element();
            let margin_m = (grid.margin_m - rounding_m).max(rounding_m);
            let surface = Surface::from(grid.of);
            points.retain(|point| enclosure.contains_beside(*point, margin_m, surface));
            unseen = None;
        }
        let left_out = asked - points.len();
        let (message, help) = if left_out > 0 {
            let message = format!("all {left_out} points of the surface lie outside the room's walls or in the margin");
            (message, "give a smaller `margin_m`, another surface, or a `grid`")
        } else {
            ("the set holds no points".to_owned(), "give at least one")
        };
        self.check(!points.is_empty(), &at, message, help);
        self.places(name, &points, written, scene, unseen);
        let normals = normals?;
        let all = points.into_iter().flat_map(|position_m| normals.iter().map(move |n| (position_m, *n)));
        Some(BuiltSet { meters: all.map(|(position_m, normal)| Meter { position_m, normal }).collect(), left_out })
    }

    /// Where a set's points are, and by which of its keys.
    fn points(&mut self, at: &str, set: &MeterSet, directions: usize, scene: &Scene) -> Option<(Vec<DVec3>, Written)> {
        match (&set.points_m, &set.grid, &set.line, &set.surface) {
            (Some(points), None, None, None) => {
                let points = self
                    .allows_meters(at, points.len(), directions)
                    .then(|| points.iter().map(|p| DVec3::from(*p)).collect())?;
                Some((points, Written::OneByOne))
            }
            (None, Some(grid), None, None) => {
                let count = self.count(at, grid)?;
                self.allows_meters(at, count, directions).then(|| (grid_points(grid), Written::By("grid")))
            }
            (None, None, Some(line), None) => {
                let help = format!("give from 2 to {MAX_METERS} points");
                let message = format!("{} points on a line", line.count);
                let sound = (2..=MAX_METERS).contains(&line.count);
                let sound = self.check(sound, &format!("{at}.line.count"), message, help);
                let (from, to) = (DVec3::from(line.from_m), DVec3::from(line.to_m));
                let help = "give two points that lie apart, in metres";
                let has_length = self.check(from != to, &format!("{at}.line"), "the line has no length", help);
                (sound && has_length && self.allows_meters(at, line.count, directions)).then(|| {
                    let last = (line.count - 1) as f64;
                    ((0..line.count).map(|k| from.lerp(to, k as f64 / last)).collect(), Written::By("line"))
                })
            }
            (None, None, None, Some(grid)) => {
                let cells = self.cells(at, grid, scene)?;
                self.allows_meters(at, cells.count(), directions).then(|| (cells.middles(), Written::By("surface")))
            }
            _ => {
                let message = "a meter set is given in one way";
                self.check(false, at, message, "give exactly one of `points_m`, `grid`, `line` and `surface`");
                None
            }
        }
    }

    /// Checks the number of a set's meters, and takes it from what the whole spec may have.
    fn allows_meters(&mut self, at: &str, points: usize, directions: usize) -> bool {
        let meters = points.saturating_mul(directions);
        let message = format!("{meters} meters");
        let is_few = self.check(meters <= MAX_METERS, at, message, format!("a set has {MAX_METERS} meters at most"));
        is_few && self.take(at, "meters", meters, |left| &mut left.meters)
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
            return axis.filter(|_| one && sound).map(|axis| directions_around(axis, around.count));
        }
        let of_surface = set.surface.map(|grid| Surface::from(grid.of).inward_normal().to_array());
        let Some(normal) = set.normal.or(of_surface) else {
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
        let at = format!("{at}.surface");
        let surface = Surface::from(grid.of);
        let (axis, sides) = (surface.axis(), sides_of(surface));
        let depth_m = room.size_m[axis];
        let is_in = grid.distance_m > 0.0 && grid.distance_m < depth_m;
        let message = format!("{} from the {} is not in the room", self.unit.length(grid.distance_m), surface.name());
        let help = format!("give more than 0 and less than {}", self.unit.length(depth_m));
        let is_in = self.check(is_in, &format!("{at}.distance_m"), message, help);
        let lengths_m = sides.map(|side| room.size_m[side] - 2.0 * grid.margin_m);
        let is_left = grid.margin_m >= 0.0 && lengths_m.iter().all(|l| *l > 0.0);
        let message =
            format!("a margin of {} leaves nothing of the {}", self.unit.length(grid.margin_m), surface.name());
        let help = "give a length from 0, less than half of each side";
        let is_left = self.check(is_left, &format!("{at}.margin_m"), message, help);
        if !is_in || !is_left {
            return None;
        }
        let counts = grid.counts.unwrap_or_else(|| en_12464_counts(lengths_m));
        let product = counts[0].checked_mul(counts[1]).filter(|n| (1..=MAX_METERS).contains(n));
        let message = format!("{} x {} cells", counts[0], counts[1]);
        let help = format!("give counts whose product lies between 1 and {MAX_METERS}");
        self.check(product.is_some(), &format!("{at}.counts"), message, help).then_some(())?;
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

    /// Reports the first meter at which no light can be measured, and the number of others.
    fn places(&mut self, name: &str, points: &[DVec3], written: Written, scene: &Scene, enclosure: Option<&Enclosure>) {
        // Each point is tested against each face of a mesh: of a large mesh only some points are.
        let stride = points.len().saturating_mul(enclosure.map_or(0, Enclosure::faces)).div_ceil(MAX_LOOKS).max(1);
        let mut wrong = points.iter().enumerate().filter_map(|(k, point)| {
            let walls = enclosure.filter(|_| k.is_multiple_of(stride));
            Some((k, *point, misplaced(*point, scene, walls, self.unit)?))
        });
        let Some((k, point, (message, help))) = wrong.next() else { return };
        let others = others(wrong.count());
        let at = format!("meters.{name}");
        let corners_m = points.iter().copied().reduce(DVec3::min).zip(points.iter().copied().reduce(DVec3::max));
        let (at, whole) = match (written, corners_m) {
            (Written::By(key), Some((low_m, high_m))) => (
                format!("{at}.{key}"),
                format!("; the {key} reaches from {} to {}", self.unit.point(low_m), self.unit.point(high_m)),
            ),
            _ => (format!("{at}.points_m[{k}]"), String::new()),
        };
        let point = self.unit.point(point);
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
        // The loop above reports a step without length.
        let (sine, whole) = (u.cross(v).length(), u.length() * v.length());
        let is_plane = nu < 2 || nv < 2 || whole == 0.0 || sine > MIN_SINE * whole;
        let help = "give two directions that span a plane, or one count of 1 for a line";
        self.check(is_plane, &format!("{at}.grid.v_m"), "it runs along u_m: the grid is a line", help);
        count
    }
}

/// The clause on how many other meters are wrong.
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
        let cells = (0..nv).flat_map(|j| (0..nu).map(move |i| (i, j)));
        cells.map(|(i, j)| self.corner_m + u * (i as f64 + 0.5) + v * (j as f64 + 0.5)).collect()
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
pub fn en_12464_counts([a, b]: [f64; 2]) -> [usize; 2] {
    let (longer, shorter) = (a.max(b), a.min(b));
    let d = if longer >= 2.0 * shorter { shorter } else { longer };
    let largest_m = (0.2 * 5_f64.powf(d.log10())).min(10.0);
    // Subtracting 1e-9 protects whole quotients from rounding up.
    let mut counts = [a, b].map(|side| ((side / largest_m - 1e-9).ceil() as usize).max(1));
    for k in [0, 1] {
        let cell = [a / counts[0] as f64, b / counts[1] as f64];
        let [wide, long] = [cell[1 - k], cell[k]];
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

/// Unit vectors perpendicular to a unit vector, at even steps around it; around an upright one the first is +x.
fn directions_around(axis: DVec3, count: usize) -> Vec<DVec3> {
    let across = if axis.x.abs() < 0.9 { DVec3::X } else { DVec3::Y };
    let first = across.reject_from_normalized(axis).normalize();
    let second = axis.cross(first);
    let step = std::f64::consts::TAU / count as f64;
    (0..count).map(|k| step * k as f64).map(|turn| (first * turn.cos() + second * turn.sin()).normalize()).collect()
}

/// The points of a grid, u fastest.
fn grid_points(grid: &GridSpec) -> Vec<DVec3> {
    let [nu, nv] = grid.counts;
    let (origin, u, v) = (DVec3::from(grid.origin_m), DVec3::from(grid.u_m), DVec3::from(grid.v_m));
    (0..nv).flat_map(|j| (0..nu).map(move |i| origin + u * i as f64 + v * j as f64)).collect()
}

/// Whether a point lies in a box or on it; no point lies in a mesh, which need not be closed.
fn is_in_box(point: DVec3, shape: &Shape) -> bool {
    match shape {
        Shape::Box { min_m, max_m } => point.cmpge(*min_m).all() && point.cmple(*max_m).all(),
        Shape::Mesh { .. } => false,
    }
}

/// What is wrong with a meter at this point, and what to do.
fn misplaced(
    point: DVec3,
    scene: &Scene,
    enclosure: Option<&Enclosure>,
    unit: LengthUnit,
) -> Option<(&'static str, String)> {
    let room = scene.room.as_ref()?;
    let margin = SURFACE_MARGIN * room.size_m.max_element();
    if !point.is_finite() || !room.contains(point, -margin) {
        return Some(("lies outside the room", within(room, unit)));
    }
    if !room.contains(point, margin) {
        let help = format!("move it into the room, by {} at least", unit.length(LEAST_MOVE_M));
        return Some(("lies on a surface of the room", help));
    }
    if let Some(enclosure) = enclosure.filter(|e| !e.contains(point, margin)) {
        return Some(("lies outside the room's walls, or on one", beyond_walls(enclosure)));
    }
    if scene.obstacles.iter().any(|obstacle| is_in_box(point, &obstacle.shape)) {
        let least = unit.length(LEAST_MOVE_M);
        let help = format!(
            "move it out, by {least} at least: a work plane lies above its desks; `distance_m` moves a `surface`"
        );
        return Some(("lies inside an obstacle or on its surface", help));
    }
    if scene.luminaires.iter().any(|l| l.position_m.distance(point) <= margin) {
        return Some(("lies in a luminaire's photometric centre", "move it away".to_owned()));
    }
    None
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::{Case, SpecError};

    const BOX: &str = "size_m: [6, 5, 3]";
    /// An L: the arm along x is 2 m wide, that along y 3 m.
    const L: &str = "floor_m: [[0, 0], [6, 0], [6, 2], [3, 2], [3, 5], [0, 5]], height_m: 3";
    /// The case of a room with this set of meters.
    fn case(room: &str, set: &str) -> Result<Case, SpecError> {
        let folder = tempfile::tempdir().unwrap();
        let lamp = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../reference/luminaires/isotropic.ies");
        let spec = format!(
            "luxproof: 1\nroom: {{{room}, reflectance: {{floor: 0.2, walls: 0.5, ceiling: 0.7}}}}\n\
             luminaires: [{{id: a, photometry: {}, at_m: [1, 1, 2.5]}}]\nmeters: {{set: {{{set}}}}}\n\
             procedures: {{direct_illuminance: {{meters: set}}}}\n",
            lamp.display()
        );
        let path = folder.path().join("spec.yaml");
        std::fs::write(&path, spec).unwrap();
        Case::load(&path)
    }

    /// How many meters a surface grid has, and how many of its points are left out.
    fn meters_of_surface(room: &str, surface: &str) -> [usize; 2] {
        let case = case(room, &format!("surface: {{{surface}}}")).unwrap();
        [case.meters["set"].len(), case.left_out.get("set").copied().unwrap_or(0)]
    }

    #[test]
    fn the_margin_of_a_surface_is_to_other_walls_than_its_own() {
        for distance in ["0.003", "0.4"] {
            let on_wall = |of: &str| format!("of: {of}, distance_m: {distance}, margin_m: 0.5, counts: [4, 3]");
            for of in ["x-", "y-"] {
                assert_eq!(meters_of_surface(L, &on_wall(of)), meters_of_surface(BOX, &on_wall(of)), "{of} {distance}");
            }
            // The wall at x = 6 ends at y = 2: of cells in the middle of which y is 1, 2, 3 and 4 only the first is next to it.
            assert_eq!(meters_of_surface(L, &on_wall("x+")), [3, 9], "{distance}");
        }
    }

    #[test]
    fn points_of_a_surface_outside_the_walls_are_counted_and_those_at_the_margin_are_in() {
        // Cells of 1 m: the margin of .5 m to the inner walls ends at the middles of cells next to them.
        assert_eq!(meters_of_surface(L, "of: floor, distance_m: 0.8, counts: [6, 5]"), [21, 9]);
        assert_eq!(meters_of_surface(L, "of: floor, distance_m: 0.8, margin_m: 0.25, counts: [6, 5]")[1], 9);
        let feet = |length: f64| length * 0.3048;
        let l = format!(
            "floor_m: [[0, 0], [{0}, 0], [{0}, {1}], [{2}, {1}], [{2}, {3}], [0, {3}]], height_m: 3",
            feet(24.0),
            feet(8.0),
            feet(14.0),
            feet(18.0)
        );
        // Twelve feet from x = 0, two feet from the wall at 14: the point is in.
        let surface = format!("of: floor, distance_m: 0.8, margin_m: {}, counts: [5, 7]", feet(2.0));
        let case = case(&l, &format!("surface: {{{surface}}}")).unwrap();
        let at_12 = case.meters["set"].iter().filter(|m| (m.position_m.x - feet(12.0)).abs() < 1e-9).count();
        assert_eq!(at_12, 7);
    }

    #[test]
    fn a_set_of_which_all_points_are_outside_says_so() {
        let error = case(L, "surface: {of: y+, distance_m: 0.1, margin_m: 1.4, counts: [2, 1]}").unwrap_err();
        assert!(error.to_string().contains("all 2 points of the surface lie outside"), "{error}");
    }
}
