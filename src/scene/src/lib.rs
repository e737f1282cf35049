//! What is simulated and exported: a room (or none), obstacles, luminaires; and the meters that read it.

#![warn(missing_docs)]

pub mod contact;
pub mod enclosure;
pub mod flush;
pub mod geometry;
pub mod opening;
pub mod surface;

use std::sync::Arc;

use glam::{DMat3, DVec3};

use crate::geometry::{Room, Surface};
use luxproof_photometry::units::Candela;
use luxproof_photometry::{Photometry, TypeCLimits};

/// Everything that emits, blocks or reflects light.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// The closed room; `None` is free field: nothing reflects, nothing blocks.
    pub room: Option<Room>,
    /// Opaque diffuse bodies inside the room; without a room they block and reflect alone, in free field.
    pub obstacles: Vec<Obstacle>,
    /// The luminaires, each with its own photometry.
    pub luminaires: Vec<Luminaire>,
}

impl Scene {
    /// That of the brightest surface, of the room or of a body; 0 where nothing reflects.
    pub fn largest_reflectance(&self) -> f64 {
        let room = self.room.iter().flat_map(|r| Surface::ALL.map(|s| r.reflectance.of(s)));
        room.chain(self.obstacles.iter().map(|o| o.reflectance)).fold(0.0, f64::max)
    }
}

/// An opaque diffuse body.
#[derive(Clone, Debug)]
pub struct Obstacle {
    /// Its shape in world coordinates, metres.
    pub shape: Shape,
    /// Diffuse reflectance, 0..=1.
    pub reflectance: f64,
}

/// The shape of an obstacle.
#[derive(Clone, Debug)]
pub enum Shape {
    /// An axis-aligned box.
    Box {
        /// Lower corner.
        min_m: DVec3,
        /// Upper corner.
        max_m: DVec3,
    },
    /// A triangle mesh; both sides of every triangle reflect.
    Mesh {
        /// Vertices.
        vertices_m: Vec<DVec3>,
        /// Vertex indices, counter-clockwise seen from outside.
        triangles: Vec<[u32; 3]>,
    },
}

impl Shape {
    /// Triangles that its surface is made of.
    pub fn triangles(&self) -> usize {
        match self {
            Self::Box { .. } => 12,
            Self::Mesh { triangles, .. } => triangles.len(),
        }
    }

    /// The area of its surface in square metres, of a mesh counted on one side.
    pub fn area_m2(&self) -> f64 {
        match self {
            Self::Box { min_m, max_m } => {
                let s = *max_m - *min_m;
                2.0 * (s.x * s.y + s.y * s.z + s.z * s.x)
            }
            Self::Mesh { vertices_m, triangles } => {
                let corners_m = triangles.iter().map(|t| t.map(|v| vertices_m[v as usize]));
                corners_m.map(|[a, b, c]| 0.5 * (b - a).cross(c - a).length()).sum()
            }
        }
    }
}

impl From<geometry::Mesh> for Shape {
    fn from(mesh: geometry::Mesh) -> Self {
        Self::Mesh { vertices_m: mesh.vertices_m, triangles: mesh.triangles }
    }
}

/// A luminaire in its place.
#[derive(Clone, Debug)]
pub struct Luminaire {
    /// Its name in the spec.
    pub id: String,
    /// What its photometric file says.
    pub photometry: Arc<Photometry>,
    /// Photometric centre in metres.
    pub position_m: DVec3,
    /// Rotation from the luminaire's own frame (C0 = +x, nadir = -z) to the world.
    pub orientation: DMat3,
    /// Dimming or maintenance factor on every intensity.
    pub flux_scale: f64,
    /// How its extent is modelled.
    pub model: LuminaireModel,
}

/// How much of a luminaire's body is modelled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum LuminaireModel {
    /// All light from the photometric centre.
    Point,
    /// Light from the file's luminous opening. The opening itself neither blocks nor reflects: a body that does, such as
    /// the black back of a hanging panel, is an obstacle of its own; [`flush::plate`] makes that of a recessed one.
    Area,
    /// An impostor surface that a renderer samples for the light behind it (Radiance's illum).
    Impostor,
}

impl LuminaireModel {
    /// The name used in specs and reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Point => "point",
            Self::Area => "area",
            Self::Impostor => "impostor",
        }
    }
}

/// A point that reads illuminance on the side its normal points to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Meter {
    /// Position in metres.
    pub position_m: DVec3,
    /// Unit normal.
    pub normal: DVec3,
}

/// Which light a meter is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Transport {
    /// Straight from the luminaires.
    Direct,
    /// Reflected at least once.
    Indirect(Bounces),
    /// Both together.
    Total(Bounces),
}

/// How many diffuse reflections count.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Bounces {
    /// All of them.
    Converged,
    /// Light reflected at most this often.
    AtMost(u32),
}

/// Azimuth about z, then tilt about the turned y axis, then roll about the luminaire's own axis; right-handed, degrees.
///
/// The result takes directions of the luminaire's frame to the world: a positive tilt moves the nadir towards -x. Quarter turns are
/// exact in any notation: 270 degrees are -90.
pub fn orientation(azimuth_deg: f64, tilt_deg: f64, roll_deg: f64) -> DMat3 {
    about_z(azimuth_deg) * about_y(tilt_deg) * about_z(roll_deg)
}

fn about_z(angle_deg: f64) -> DMat3 {
    let [sin, cos] = sin_cos_deg(angle_deg);
    DMat3::from_cols(DVec3::new(cos, sin, 0.0), DVec3::new(-sin, cos, 0.0), DVec3::Z)
}

fn about_y(angle_deg: f64) -> DMat3 {
    let [sin, cos] = sin_cos_deg(angle_deg);
    DMat3::from_cols(DVec3::new(cos, 0.0, -sin), DVec3::Y, DVec3::new(sin, 0.0, cos))
}

/// Sine and cosine of an angle in degrees, those of quarter turns without rounding.
fn sin_cos_deg(angle_deg: f64) -> [f64; 2] {
    // The remainder is exact, so that the sum with a whole number of quarters is the angle.
    let quarters = (angle_deg / 90.0).round();
    let (sin, cos) = (angle_deg - 90.0 * quarters).to_radians().sin_cos();
    match quarters.rem_euclid(4.0) {
        1.0 => [cos, -sin],
        2.0 => [-sin, -cos],
        3.0 => [-cos, sin],
        _ => [sin, cos],
    }
}

impl Luminaire {
    /// Intensity towards a world direction of any length, flux scale included.
    pub fn intensity_towards(&self, direction: DVec3) -> Candela {
        self.photometry.distribution.intensity_towards(self.orientation.transpose() * direction) * self.flux_scale
    }

    /// Whether it sends light anywhere.
    pub fn is_on(&self) -> bool {
        self.flux_scale > 0.0 && self.photometry.distribution.max_intensity().value() > 0.0
    }

    /// How far apart the intensities are between which rounding decides towards a direction in the room:
    /// [`LuminousIntensityDistribution::jump_towards`](luxproof_photometry::LuminousIntensityDistribution::jump_towards).
    pub fn jump_towards(&self, direction: DVec3) -> Candela {
        self.photometry.distribution.jump_towards(self.orientation.transpose() * direction) * self.flux_scale
    }

    /// The luminaire by a table of type C within limits, for engines that read no other; itself where it has one.
    ///
    /// A point whose table is of type B is turned instead, so that the table's own axis is the one of type C: but for the ends of
    /// the table nothing is lost. What has a body keeps its attitude and gets a stand-in.
    #[must_use]
    pub fn in_type_c(&self, limits: TypeCLimits) -> Self {
        let table = &self.photometry.distribution;
        if !table.is_native() {
            return self.clone();
        }
        let (table, turn) = match self.model {
            LuminaireModel::Point => table.about_the_vertical(),
            LuminaireModel::Area | LuminaireModel::Impostor => (table.clone(), DMat3::IDENTITY),
        };
        let distribution = table.in_type_c_within(limits).distribution;
        let photometry = Arc::new(self.photometry.with_distribution(distribution));
        Self { photometry, orientation: self.orientation * turn, ..self.clone() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn rotations_are_right_handed_and_intrinsic() {
        let nadir = orientation(0.0, 90.0, 0.0) * DVec3::NEG_Z;
        assert_relative_eq!(nadir.x, -1.0, epsilon = 1e-15);
        let turned = orientation(90.0, 90.0, 0.0) * DVec3::NEG_Z;
        assert_relative_eq!(turned.y, -1.0, epsilon = 1e-15);
        let c0 = orientation(30.0, 0.0, 15.0) * DVec3::X;
        assert_relative_eq!(c0.y.atan2(c0.x).to_degrees(), 45.0, epsilon = 1e-12);
    }

    #[test]
    fn quarter_turns_are_exact_in_any_notation() {
        for quarters in -9..=9 {
            let turned = orientation(90.0 * f64::from(quarters), 90.0, 0.0) * DVec3::NEG_Z;
            assert_eq!(turned.abs().max_element() + turned.abs().min_element(), 1.0, "{quarters}");
            let again = orientation(90.0 * f64::from(quarters + 4), -270.0, 360.0) * DVec3::NEG_Z;
            assert_eq!(turned, again, "{quarters}");
        }
        let other = DMat3::from_rotation_z(0.7) * DMat3::from_rotation_y(-2.9) * DMat3::from_rotation_z(4.0);
        let same = orientation(0.7_f64.to_degrees(), -2.9_f64.to_degrees(), 4.0_f64.to_degrees());
        assert!(same.abs_diff_eq(other, 1e-14), "{same} {other}");
    }
}
