//! Sets of meters: points or a grid, all of them in the room and out of what stands there.

use glam::DVec3;
use luminaire::scene::{Meter, Scene, Shape};

use super::super::model::{GridSpec, MeterSet};
use super::{Builder, MAX_METERS, within};

/// Nearest a meter or a luminaire may come to a surface, relative to the room's largest extent.
///
/// On the surface itself a renderer's answer depends on rounding, and so would ours.
const SURFACE_MARGIN: f64 = 1e-9;

/// Below this sine two steps of a grid have one direction.
const FLAT: f64 = 1e-9;

impl Builder<'_> {
    pub(super) fn meter_set(&mut self, name: &str, set: &MeterSet, scene: &Scene) -> Option<Vec<Meter>> {
        let at = format!("meters.{name}");
        let normal = DVec3::from(set.normal);
        let normal = normal.try_normalize().filter(|_| normal.is_finite());
        let message = "the normal has no direction";
        self.check(normal.is_some(), &format!("{at}.normal"), message, "give a vector other than zero");
        let points: Vec<DVec3> = match (&set.points_m, &set.grid) {
            (Some(points), None) => {
                let is_few = self.take(&at, "meters", points.len(), |left| &mut left.meters);
                is_few.then(|| points.iter().map(|p| DVec3::from(*p)).collect())?
            }
            (None, Some(grid)) => {
                let count = self.count(&at, grid)?;
                let is_few = self.take(&at, "meters", count, |left| &mut left.meters);
                is_few.then(|| points_of(grid))?
            }
            _ => {
                let message = "a meter set is either points or a grid";
                self.check(false, &at, message, "give exactly one of `points_m` and `grid`");
                return None;
            }
        };
        self.check(!points.is_empty(), &at, "the set holds no points", "give at least one");
        self.places(name, &points, set.grid.is_some(), scene);
        let normal = normal?;
        Some(points.into_iter().map(|position_m| Meter { position_m, normal }).collect())
    }

    /// Tells the first meter that no light could be measured at, and how many more there are.
    fn places(&mut self, name: &str, points: &[DVec3], is_grid: bool, scene: &Scene) {
        let mut wrong = points.iter().enumerate().filter_map(|(k, point)| Some((k, point, misplaced(*point, scene)?)));
        let Some((k, point, (message, help))) = wrong.next() else { return };
        let others = match wrong.count() {
            0 => String::new(),
            1 => ", and another is as wrong".to_owned(),
            n => format!(", and {n} others are as wrong"),
        };
        let at = format!("meters.{name}");
        let (at, whole) = match (is_grid, points.first().zip(points.last())) {
            (true, Some((first, last))) => (format!("{at}.grid"), format!("; the grid reaches from {first} to {last}")),
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

fn points_of(grid: &GridSpec) -> Vec<DVec3> {
    let [nu, nv] = grid.counts;
    let (origin, u, v) = (DVec3::from(grid.origin_m), DVec3::from(grid.u_m), DVec3::from(grid.v_m));
    (0..nv).flat_map(|j| (0..nu).map(move |i| origin + u * i as f64 + v * j as f64)).collect()
}

/// What is wrong with a meter at this point, and what to do.
fn misplaced(point: DVec3, scene: &Scene) -> Option<(&'static str, String)> {
    let room = scene.room.as_ref()?;
    let margin = SURFACE_MARGIN * room.size_m.max_element();
    if !point.is_finite() || !room.contains(point, -margin) {
        return Some(("lies outside the room", within(room)));
    }
    if !room.contains(point, margin) {
        let help = "a meter on a surface sees half of nothing: move it inwards, by 1e-6 m say".to_owned();
        return Some(("lies on a surface of the room", help));
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
