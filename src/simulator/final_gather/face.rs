//! Rectangles that reflect and on which light is known: the walls of the room and the larger faces of boxes.

use glam::{DVec2, DVec3};

use crate::geometry::{Room, Surface};
use crate::simulator::visibility::Occluder;

/// The mean area of a room's walls.
pub(super) fn mean_wall_m2(size_m: DVec3) -> f64 {
    (size_m.x * size_m.y + size_m.y * size_m.z + size_m.z * size_m.x) / 3.0
}

/// An axis-aligned rectangle of uniform reflectance, seen from one side.
#[derive(Clone, Debug)]
pub(super) struct Face {
    axis: usize,
    plane_m: f64,
    /// Lower and upper corner along the two axes that follow its own.
    pub(super) corners_m: [DVec2; 2],
    pub(super) normal: DVec3,
    pub(super) reflectance: f64,
    /// What lies flat upon it and replaces it there.
    pub(super) holes: Vec<[DVec2; 2]>,
}

impl Face {
    /// The side of a box that one sees along an axis, from its far end or from its near one.
    fn new(axis: usize, far: bool, [min_m, max_m]: [DVec3; 2], normal: DVec3, reflectance: f64) -> Self {
        let along = |p: DVec3| DVec2::new(p[(axis + 1) % 3], p[(axis + 2) % 3]);
        let plane_m = if far { max_m[axis] } else { min_m[axis] };
        Self { axis, plane_m, corners_m: [along(min_m), along(max_m)], normal, reflectance, holes: vec![] }
    }

    /// The walls of a room, at twice the axis and one more at its far end.
    pub(super) fn walls(room: &Room) -> [Self; 6] {
        const WALLS: [Surface; 6] = [
            Surface::WallXMin,
            Surface::WallXMax,
            Surface::WallYMin,
            Surface::WallYMax,
            Surface::Floor,
            Surface::Ceiling,
        ];
        std::array::from_fn(|k| {
            let surface = WALLS[k];
            let reflectance = room.reflectance.of(surface);
            Self::new(k / 2, k % 2 == 1, [DVec3::ZERO, room.size_m], surface.inward_normal(), reflectance)
        })
    }

    /// The face of a box at an end of an axis, or `None` where it cannot be seen.
    pub(super) fn of_box(room: &Room, corners_m: [DVec3; 2], axis: usize, far: bool, reflectance: f64) -> Option<Self> {
        let s = room.size_m;
        let within = corners_m.map(|p| p.clamp(DVec3::ZERO, s));
        let face = Self::new(axis, far, within, DVec3::AXES[axis] * if far { 1.0 } else { -1.0 }, reflectance);
        let is_seen = Self::is_seen(room, corners_m, axis, far);
        (is_seen && reflectance > 0.0).then_some(face)
    }

    /// Whether the face of a box at an end of an axis looks into the room and has an area.
    pub(super) fn is_seen(room: &Room, corners_m: [DVec3; 2], axis: usize, far: bool) -> bool {
        let plane_m = corners_m[usize::from(far)][axis];
        let size_m = room.size_m[axis];
        let [low, high] = corners_m.map(|p| p.clamp(DVec3::ZERO, room.size_m));
        let has_area = (1..3).all(|k| high[(axis + k) % 3] > low[(axis + k) % 3]);
        has_area && if far { plane_m >= 0.0 && plane_m < size_m } else { plane_m > 0.0 && plane_m <= size_m }
    }

    pub(super) fn size_m(&self) -> DVec2 {
        self.corners_m[1] - self.corners_m[0]
    }

    pub(super) fn area_m2(&self) -> f64 {
        self.size_m().element_product()
    }

    /// Where on its plane a point lies, in metres.
    pub(super) fn on(&self, point_m: DVec3) -> DVec2 {
        DVec2::new(point_m[(self.axis + 1) % 3], point_m[(self.axis + 2) % 3])
    }

    /// The point in the room of a place on its plane.
    pub(super) fn off(&self, at_m: DVec2) -> DVec3 {
        let mut point_m = DVec3::ZERO;
        point_m[self.axis] = self.plane_m;
        (point_m[(self.axis + 1) % 3], point_m[(self.axis + 2) % 3]) = (at_m.x, at_m.y);
        point_m
    }

    /// How far before its plane a point lies.
    pub(super) fn is_before_m(&self, point_m: DVec3) -> f64 {
        let beyond_m = point_m[self.axis] - self.plane_m;
        if self.normal[self.axis] > 0.0 { beyond_m } else { -beyond_m }
    }

    /// What of a box lies before its plane.
    pub(super) fn before(&self, Occluder { mut min_m, mut max_m }: Occluder) -> Option<Occluder> {
        if self.normal[self.axis] > 0.0 {
            min_m[self.axis] = min_m[self.axis].max(self.plane_m);
        } else {
            max_m[self.axis] = max_m[self.axis].min(self.plane_m);
        }
        (min_m[self.axis] <= max_m[self.axis]).then_some(Occluder { min_m, max_m })
    }

    /// Where on its plane a plate lies that lies flat upon it and looks where it does.
    pub(super) fn under(&self, [min_m, max_m]: [DVec3; 2]) -> Option<[DVec2; 2]> {
        (min_m[self.axis] == self.plane_m && max_m[self.axis] == self.plane_m).then(|| [self.on(min_m), self.on(max_m)])
    }

    /// How far before it a box stands, where that is within a part of its own shorter side.
    pub(super) fn gap_m(&self, [min_m, max_m]: [DVec3; 2], part: f64) -> Option<f64> {
        let gap_m = if self.normal[self.axis] > 0.0 {
            min_m[self.axis] - self.plane_m
        } else {
            self.plane_m - max_m[self.axis]
        };
        let is_near = gap_m > 0.0 && gap_m < part * (self.on(max_m) - self.on(min_m)).min_element();
        is_near.then_some(gap_m)
    }

    /// What a box hides of it that stands on it or reaches through it, as corners on its plane.
    pub(super) fn covered_by(&self, [min_m, max_m]: [DVec3; 2]) -> Option<[DVec2; 2]> {
        let (low, high) = (min_m[self.axis], max_m[self.axis]);
        let before = if self.normal[self.axis] > 0.0 {
            low <= self.plane_m && high > self.plane_m
        } else {
            high >= self.plane_m && low < self.plane_m
        };
        before.then(|| [self.on(min_m), self.on(max_m)])
    }
}

/// How much of a rectangle of a face bodies cover that stand on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Cover {
    None,
    Part,
    Whole,
}

/// Parts of a side by which edges of bodies are told from those of a rectangle.
const SAME: f64 = 1e-9;

impl Cover {
    pub(super) fn of(covers: &[[DVec2; 2]], corner_m: DVec2, size_m: DVec2) -> Self {
        let [low, high] = inside(corner_m, size_m);
        let is_all = |c: &[DVec2; 2]| c[0].cmple(low).all() && c[1].cmpge(high).all();
        if covers.iter().any(is_all) {
            Self::Whole
        } else if covering(covers, corner_m, size_m).next().is_some() {
            Self::Part
        } else {
            Self::None
        }
    }
}

/// Those that cover a rectangle or a part of it.
pub(super) fn covering(covers: &[[DVec2; 2]], corner_m: DVec2, size_m: DVec2) -> impl Iterator<Item = &[DVec2; 2]> {
    let [low, high] = inside(corner_m, size_m);
    covers.iter().filter(move |c| c[0].cmplt(high).all() && c[1].cmpgt(low).all())
}

/// Both ends of a rectangle, a hair inside.
fn inside(corner_m: DVec2, size_m: DVec2) -> [DVec2; 2] {
    [corner_m + SAME * size_m, corner_m + (1.0 - SAME) * size_m]
}
