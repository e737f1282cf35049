//! The room: an axis-aligned closed box with one corner at the origin, z up, six diffuse surfaces.

use glam::DVec3;

/// A closed box room from the origin to `size_m`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Room {
    /// Extents along x, y, z in metres.
    pub size_m: DVec3,
    /// Diffuse reflectance of each surface.
    pub reflectance: Reflectances,
}

/// Diffuse reflectance of the six surfaces of a room, each within 0..=1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reflectances {
    /// z = 0.
    pub floor: f64,
    /// z = height.
    pub ceiling: f64,
    /// x = 0.
    pub wall_x_min: f64,
    /// x = length.
    pub wall_x_max: f64,
    /// y = 0.
    pub wall_y_min: f64,
    /// y = width.
    pub wall_y_max: f64,
}

/// One of the six surfaces of a room.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Surface {
    /// z = 0.
    Floor,
    /// z = height.
    Ceiling,
    /// x = 0.
    WallXMin,
    /// x = length.
    WallXMax,
    /// y = 0.
    WallYMin,
    /// y = width.
    WallYMax,
}

impl Surface {
    /// All six, in the order of [`Reflectances`].
    pub const ALL: [Self; 6] =
        [Self::Floor, Self::Ceiling, Self::WallXMin, Self::WallXMax, Self::WallYMin, Self::WallYMax];

    /// The axis (0, 1, 2) normal to the surface.
    pub const fn axis(self) -> usize {
        match self {
            Self::WallXMin | Self::WallXMax => 0,
            Self::WallYMin | Self::WallYMax => 1,
            Self::Floor | Self::Ceiling => 2,
        }
    }

    /// Whether it is the surface at the far end of its axis.
    pub const fn is_far(self) -> bool {
        matches!(self, Self::Ceiling | Self::WallXMax | Self::WallYMax)
    }

    /// The unit normal that points into the room.
    pub fn inward_normal(self) -> DVec3 {
        let axis = [DVec3::X, DVec3::Y, DVec3::Z][self.axis()];
        if self.is_far() { -axis } else { axis }
    }

    /// The name used in files and reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Floor => "floor",
            Self::Ceiling => "ceiling",
            Self::WallXMin => "wall x-",
            Self::WallXMax => "wall x+",
            Self::WallYMin => "wall y-",
            Self::WallYMax => "wall y+",
        }
    }
}

impl Reflectances {
    /// The same reflectance on all four walls.
    pub const fn with_equal_walls(floor: f64, walls: f64, ceiling: f64) -> Self {
        Self { floor, ceiling, wall_x_min: walls, wall_x_max: walls, wall_y_min: walls, wall_y_max: walls }
    }

    /// The reflectance of one surface, to be changed.
    pub const fn of_mut(&mut self, surface: Surface) -> &mut f64 {
        match surface {
            Surface::Floor => &mut self.floor,
            Surface::Ceiling => &mut self.ceiling,
            Surface::WallXMin => &mut self.wall_x_min,
            Surface::WallXMax => &mut self.wall_x_max,
            Surface::WallYMin => &mut self.wall_y_min,
            Surface::WallYMax => &mut self.wall_y_max,
        }
    }

    /// The reflectance of one surface.
    pub const fn of(&self, surface: Surface) -> f64 {
        match surface {
            Surface::Floor => self.floor,
            Surface::Ceiling => self.ceiling,
            Surface::WallXMin => self.wall_x_min,
            Surface::WallXMax => self.wall_x_max,
            Surface::WallYMin => self.wall_y_min,
            Surface::WallYMax => self.wall_y_max,
        }
    }
}

impl Room {
    /// Whether a point lies strictly inside, at least `margin_m` from every surface.
    pub fn contains(&self, point_m: DVec3, margin_m: f64) -> bool {
        point_m.cmpge(DVec3::splat(margin_m)).all() && point_m.cmple(self.size_m - margin_m).all()
    }

    /// The four corners of a surface in metres, counter-clockwise when seen from inside the room.
    pub fn corners(&self, surface: Surface) -> [DVec3; 4] {
        let axis = surface.axis();
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let (lu, lv) = (self.size_m[u], self.size_m[v]);
        let mut corners = [[0.0, 0.0], [lu, 0.0], [lu, lv], [0.0, lv]].map(|[at_u, at_v]| {
            let mut p = DVec3::ZERO;
            p[axis] = if surface.is_far() { self.size_m[axis] } else { 0.0 };
            p[u] = at_u;
            p[v] = at_v;
            p
        });
        if surface.is_far() {
            corners.reverse();
        }
        corners
    }

    /// Area of all six surfaces in square metres.
    pub fn whole_area_m2(&self) -> f64 {
        Surface::ALL.iter().map(|s| self.area_m2(*s)).sum()
    }

    /// Area of one surface in square metres.
    pub fn area_m2(&self, surface: Surface) -> f64 {
        let axis = surface.axis();
        self.size_m[(axis + 1) % 3] * self.size_m[(axis + 2) % 3]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_turn_counter_clockwise_seen_from_inside() {
        let reflectance = Reflectances::with_equal_walls(0.2, 0.5, 0.8);
        let room = Room { size_m: DVec3::new(2.0, 3.0, 4.0), reflectance };
        for surface in Surface::ALL {
            let [a, b, c, _] = room.corners(surface);
            let normal = (b - a).cross(c - b);
            assert_eq!(normal.normalize(), surface.inward_normal(), "{}", surface.name());
            assert_eq!(normal.length(), room.area_m2(surface), "{}", surface.name());
        }
    }
}
