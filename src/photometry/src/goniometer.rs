//! The photometric types A, B and C: the angles of measured tables and the frames of types A and B.
//!
//! Source of the frames: ANSI/IESNA LM-63-02 section 3. Photometric zero is the nadir: gamma 0 of type C, H 0 V 0 of
//! type B, V -90 of type A. Photometric horizontal is +x: C 0 gamma 90, H 0 V 90 of type B, H 0 V 0 of type A.
//! Horizontal angles turn counter-clockwise seen from above in type C and clockwise in types A and B. Hence
//! type A is type C with gamma = 90 + V and C = -H, and in type B a direction is
//! (cos H sin V, -sin H, -cos H cos V): type C about an axis that lies along -y, with C = V and gamma = 90 + H.
//! Between its nodes the table of the file is bilinear in (H, V) in degrees, and hence in its native angles. Beyond its
//! first and last angles it is dark.

use glam::{DMat3, DVec3};

/// The photometric type of a measurement, which decides on the coordinates of its table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Goniometer {
    /// Vertical axis, angles from the horizon: automotive.
    A,
    /// Horizontal axis: floodlights.
    B,
    /// Vertical axis, angles from the nadir: everything else.
    C,
}

/// An angle within this distance of the edge of a type A or B table is on the edge, in degrees.
pub(super) const SAME_DEG: f64 = 1e-9;

/// The frame of type B: axes along -z, x and -y of the luminaire.
pub(super) const LYING: DMat3 = DMat3::from_cols(DVec3::NEG_Z, DVec3::X, DVec3::NEG_Y);

/// Converts a direction from the luminaire's frame to the frame of type B.
pub(super) fn to_lying_frame(direction: DVec3) -> DVec3 {
    DVec3::new(-direction.z, direction.x, -direction.y)
}

/// Angles in degrees and intensities in candela of a file, with their byte offsets.
pub(crate) struct Table {
    pub(crate) vertical_deg: Vec<f64>,
    pub(crate) vertical_at: usize,
    pub(crate) horizontal_deg: Vec<f64>,
    pub(crate) horizontal_at: usize,
    /// `candela[horizontal][vertical]`.
    pub(crate) candela: Vec<f64>,
    pub(crate) candela_at: usize,
}

/// The angle within a sector of planes that equals this angle up to whole turns; `None` beyond its ends.
pub(super) fn within_sector(planes_deg: &[f64], c_deg: f64) -> Option<f64> {
    let (first, last) = (planes_deg[0], planes_deg[planes_deg.len() - 1]);
    let is_there = (first - SAME_DEG..=last + SAME_DEG).contains(&c_deg);
    let turned = if is_there { c_deg } else { first + (c_deg - first).rem_euclid(360.0) };
    if turned <= last + SAME_DEG {
        return Some(turned);
    }
    (turned >= first + 360.0 - SAME_DEG).then_some(first)
}
