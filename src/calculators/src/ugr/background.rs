//! Background luminance of the standard room: the indirect luminance of its walls.
//!
//! CIE 190:2010 clause 4.2, equations 7 to 12: `E_WID = B F_UWID`, `L_b = E_WID / pi`. Of a luminaire's flux, `F_DF`
//! reaches the reference plane directly, `F_DW` the walls and `F_DC` the ceiling. `F_DF` follows from geometric
//! multipliers (table 4) of the flux within the cones of CIE 52. Transfer factors (table 5) give the indirect flux on
//! the walls. They are computed here from the balance of the three surfaces, of which the printed ones are the values
//! to three decimals.

use glam::{DMat3, DVec3};

use super::{Reflectances, Room};
use luxproof_photometry::LuminousIntensityDistribution;
use luxproof_scene::geometry::configuration_factor::opposed_rectangles;

/// Table 4: room index and multipliers of the flux within 41.4, 60, 75.5 and 90 degrees.
///
/// The spacing of the luminaires is their height above the eye.
const MULTIPLIERS: [(f64, [f64; 4]); 13] = [
    (1.00, [0.690, 0.109, 0.085, -0.016]),
    (1.20, [0.578, 0.200, 0.127, -0.018]),
    (1.33, [0.528, 0.218, 0.170, -0.017]),
    (1.50, [0.485, 0.215, 0.222, -0.012]),
    (1.60, [0.466, 0.207, 0.249, -0.006]),
    (1.71, [0.448, 0.198, 0.272, 0.005]),
    (2.00, [0.338, 0.257, 0.351, -0.018]),
    (2.40, [0.296, 0.203, 0.449, -0.006]),
    (2.67, [0.280, 0.165, 0.499, 0.006]),
    (3.00, [0.264, 0.125, 0.541, 0.027]),
    (3.43, [0.248, 0.058, 0.628, 0.032]),
    (4.00, [0.239, -0.012, 0.690, 0.058]),
    (4.80, [0.232, -0.084, 0.740, 0.098]),
];

/// A luminaire's direct flux on the surfaces, in lumens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FirstFlux {
    pub(super) plane: f64,
    pub(super) walls: f64,
    pub(super) ceiling: f64,
}

impl FirstFlux {
    /// Computes the flux by the geometric multipliers; `None` without downward flux.
    pub(super) fn of(distribution: &LuminousIntensityDistribution, room: Room) -> Option<Self> {
        let flux = distribution.flux();
        let [n1, n2, n3, down_percent, _] = distribution.cie_flux_code(flux)?;
        let down = 0.01 * down_percent * flux.value();
        let index = room.index();
        let nearest = MULTIPLIERS.iter().min_by(|(a, _), (b, _)| (a - index).abs().total_cmp(&(b - index).abs()));
        let (_, multipliers) = nearest?;
        let cones = [0.01 * n1, 0.01 * n2, 0.01 * n3, 1.0];
        let plane = down * multipliers.iter().zip(cones).map(|(g, n)| g * n).sum::<f64>();
        Some(Self { plane, walls: down - plane, ceiling: flux.value() - down })
    }
}

/// Indirect flux on the walls per direct lumen on the plane (`F_T,FW`), the walls (`F_T,WW - 1`) and the ceiling
/// (`F_T,CW`).
pub(super) fn transfer(room: Room, reflectances: Reflectances) -> [f64; 3] {
    let (x, y) = (f64::from(room.x), f64::from(room.y));
    let across = opposed_rectangles(x, y, 1.0);
    // A_w = 2 (X + Y), in units of H: reciprocity.
    let from_wall = (1.0 - across) * x * y / (2.0 * (x + y));
    // Column j has the destinations of the flux from plane, ceiling and walls.
    let exchange = DMat3::from_cols(
        DVec3::new(0.0, across, 1.0 - across),
        DVec3::new(across, 0.0, 1.0 - across),
        DVec3::new(from_wall, from_wall, 1.0 - 2.0 * from_wall),
    );
    let reflected = DMat3::from_diagonal(DVec3::new(reflectances.plane, reflectances.ceiling, reflectances.walls));
    let arrived = (DMat3::IDENTITY - exchange * reflected).inverse();
    [arrived.x_axis.z, arrived.z_axis.z - 1.0, arrived.y_axis.z]
}

/// Background luminance in cd/m2 from `count` luminaires in a room with sizes in units of `height_m`.
pub(super) fn luminance(room: Room, reflectances: Reflectances, first: FirstFlux, count: f64, height_m: f64) -> f64 {
    let [from_plane, from_walls, from_ceiling] = transfer(room, reflectances);
    let on_walls = first.plane * from_plane + first.walls * from_walls + first.ceiling * from_ceiling;
    let walls_m2 = 2.0 * f64::from(room.x + room.y) * height_m * height_m;
    count * on_walls / (walls_m2 * std::f64::consts::PI)
}
