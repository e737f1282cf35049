//! Outlines of flat luminous openings and of the flat faces of others, as the corners of polygons in the luminaire's own frame.

use glam::DVec3;

use super::{HorizontalAxis, LuminousOpening};

impl LuminousOpening {
    /// The flat faces of an opening in metres, each counter-clockwise seen from outside, ellipses as by [`Self::flat_outline_m`]. A flat
    /// opening is one face; what is round all over has none.
    pub fn flat_faces_m(&self, of_an_ellipse: u32) -> Vec<Vec<DVec3>> {
        match *self {
            Self::Point => vec![],
            Self::Box { x_m, y_m, height_m } => {
                let extent_m = DVec3::new(x_m, y_m, height_m);
                (0..3).flat_map(|axis| ends(extent_m, axis, rectangle(extent_m, axis))).collect()
            }
            Self::Ellipse { x_m, y_m, height_m } => {
                let extent_m = DVec3::new(x_m, y_m, height_m);
                ends(extent_m, 2, ellipse(extent_m, 2, of_an_ellipse))
            }
            Self::Ellipsoid { x_m, y_m, z_m } => {
                let extent_m = DVec3::new(x_m, y_m, z_m);
                let flat = (0..3).find(|axis| extent_m[*axis] == 0.0);
                flat.map_or(vec![], |axis| ends(extent_m, axis, ellipse(extent_m, axis, of_an_ellipse)))
            }
            Self::LyingCylinder { axis, length_m, diameter_m } => {
                let (axis, extent_m) = match axis {
                    HorizontalAxis::X => (0, DVec3::new(length_m, diameter_m, diameter_m)),
                    HorizontalAxis::Y => (1, DVec3::new(diameter_m, length_m, diameter_m)),
                };
                ends(extent_m, axis, ellipse(extent_m, axis, of_an_ellipse))
            }
        }
    }

    /// The corners of a flat horizontal opening in metres, counter-clockwise seen from above; an ellipse as a polygon of so many
    /// corners and of its area. `None` where it has a height or no area.
    pub fn flat_outline_m(&self, of_an_ellipse: u32) -> Option<Vec<DVec3>> {
        match *self {
            Self::Box { height_m: 0.0, .. } | Self::Ellipse { height_m: 0.0, .. } => {
                self.flat_faces_m(of_an_ellipse).into_iter().next()
            }
            _ => None,
        }
    }
}

/// A cross-section of a body at both of its ends along an axis; once where they are in one place, and nowhere if it has no area.
fn ends(extent_m: DVec3, axis: usize, section_m: Vec<DVec3>) -> Vec<Vec<DVec3>> {
    if extent_m[(axis + 1) % 3] <= 0.0 || extent_m[(axis + 2) % 3] <= 0.0 {
        return vec![];
    }
    if extent_m[axis] <= 0.0 {
        return vec![section_m];
    }
    let half_m = 0.5 * extent_m[axis] * DVec3::AXES[axis];
    let far = section_m.iter().map(|p| *p + half_m).collect();
    let near = section_m.iter().rev().map(|p| *p - half_m).collect();
    vec![far, near]
}

fn rectangle(extent_m: DVec3, axis: usize) -> Vec<DVec3> {
    [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]].map(|[u, v]| across(extent_m, axis, u, v)).to_vec()
}

fn ellipse(extent_m: DVec3, axis: usize, corners: u32) -> Vec<DVec3> {
    let step = std::f64::consts::TAU / f64::from(corners);
    let swell = 0.5 * (step / step.sin()).sqrt();
    let directions = (0..corners).map(|k| (f64::from(k) * step).sin_cos());
    directions.map(|(sin, cos)| across(extent_m, axis, swell * cos, swell * sin)).collect()
}

/// The point at parts of a body's extent along the two axes that follow one.
fn across(extent_m: DVec3, axis: usize, u: f64, v: f64) -> DVec3 {
    let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
    u * extent_m[a] * DVec3::AXES[a] + v * extent_m[b] * DVec3::AXES[b]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The mean normal of a polygon, as long as twice its area (M. E. Newell).
    fn newell(corners: &[DVec3]) -> DVec3 {
        corners.windows(2).map(|pair| (pair[0] - corners[0]).cross(pair[1] - corners[0])).sum()
    }

    #[test]
    fn faces_look_outwards_and_have_the_area_of_the_opening() {
        let disc = std::f64::consts::PI * 0.25;
        for (opening, faces, area_m2) in [
            (LuminousOpening::Point, 0, 0.0),
            (LuminousOpening::Box { x_m: 2.0, y_m: 1.0, height_m: 0.0 }, 1, 2.0),
            (LuminousOpening::Box { x_m: 0.0, y_m: 1.0, height_m: 3.0 }, 1, 3.0),
            (LuminousOpening::Box { x_m: 2.0, y_m: 1.0, height_m: 3.0 }, 6, 22.0),
            (LuminousOpening::Ellipse { x_m: 1.0, y_m: 1.0, height_m: 0.0 }, 1, disc),
            (LuminousOpening::Ellipse { x_m: 1.0, y_m: 1.0, height_m: 2.0 }, 2, 2.0 * disc),
            (LuminousOpening::Ellipsoid { x_m: 0.0, y_m: 1.0, z_m: 1.0 }, 1, disc),
            (LuminousOpening::Ellipsoid { x_m: 1.0, y_m: 1.0, z_m: 1.0 }, 0, 0.0),
            (LuminousOpening::LyingCylinder { axis: HorizontalAxis::Y, length_m: 2.0, diameter_m: 1.0 }, 2, 2.0 * disc),
        ] {
            let found = opening.flat_faces_m(64);
            assert_eq!(found.len(), faces, "{opening:?}");
            let sum_m2: f64 = found.iter().map(|face| 0.5 * newell(face).length()).sum();
            assert!((sum_m2 - area_m2).abs() < 1e-12, "{opening:?}");
            let mut outward = found.iter().map(|face| newell(face).dot(face[0] + face[1] + face[2]));
            assert!(faces < 2 || outward.all(|along| along > 0.0), "{opening:?}");
        }
        let flat = LuminousOpening::Ellipse { x_m: 1.0, y_m: 0.5, height_m: 0.0 };
        assert_eq!(flat.flat_outline_m(64).as_ref(), flat.flat_faces_m(64).first());
    }
}
