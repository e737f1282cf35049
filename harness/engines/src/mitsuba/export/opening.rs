//! The luminous opening of an area luminaire, as the goniometric emitter takes it.

use luxproof_photometry::{HorizontalAxis, LuminousOpening};
use luxproof_scene::{Luminaire, LuminaireModel};

use crate::frame::Frame;

/// Whether light comes from more than a point, so that it must be sampled.
pub(super) fn is_extended(luminaire: &Luminaire) -> bool {
    kind_and_size_m(luminaire).is_some_and(|(_, size)| size.iter().any(|s| *s != 0.0))
}

/// The emitter's parameters for the opening; nothing for a point.
pub(super) fn xml(luminaire: &Luminaire, frame: &Frame) -> String {
    let Some((kind, size)) = kind_and_size_m(luminaire).filter(|_| is_extended(luminaire)) else {
        return String::new();
    };
    let [x, y, z] = size.map(|s| s * frame.scale);
    format!(
        r#"
        <string name="opening" value="{kind}"/>
        <vector name="size" value="{x}, {y}, {z}"/>"#
    )
}

fn kind_and_size_m(luminaire: &Luminaire) -> Option<(&'static str, [f64; 3])> {
    if luminaire.model == LuminaireModel::Point {
        return None;
    }
    match luminaire.photometry.opening {
        LuminousOpening::Point => None,
        LuminousOpening::Box { x_m, y_m, height_m } => Some(("box", [x_m, y_m, height_m])),
        LuminousOpening::Ellipse { x_m, y_m, height_m } => Some(("ellipse", [x_m, y_m, height_m])),
        LuminousOpening::Ellipsoid { x_m, y_m, z_m } => Some(("ellipsoid", [x_m, y_m, z_m])),
        LuminousOpening::LyingCylinder { axis: HorizontalAxis::X, length_m, diameter_m } => {
            Some(("cylinder_x", [length_m, diameter_m, diameter_m]))
        }
        LuminousOpening::LyingCylinder { axis: HorizontalAxis::Y, length_m, diameter_m } => {
            Some(("cylinder_y", [diameter_m, length_m, diameter_m]))
        }
    }
}
