//! What shines of a luminaire where only points and flat openings are lights.

use luxproof_photometry::LuminousOpening;
use luxproof_scene::{Luminaire, LuminaireModel};

use crate::Job;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Opening {
    /// A point.
    None,
    /// Both sides in metres.
    Flat(Outline, [f64; 2]),
    /// There is no light for it.
    Solid,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Outline {
    Rectangle,
    Ellipse,
}

impl Opening {
    pub(crate) fn of(luminaire: &Luminaire) -> Self {
        if luminaire.model == LuminaireModel::Point {
            return Self::None;
        }
        match luminaire.photometry.opening {
            LuminousOpening::Point => Self::None,
            other if other.bounding_box_m() == [0.0; 3] => Self::None,
            LuminousOpening::Box { x_m, y_m, height_m: 0.0 } => Self::flat(Outline::Rectangle, x_m, y_m),
            LuminousOpening::Ellipse { x_m, y_m, height_m: 0.0 } => Self::flat(Outline::Ellipse, x_m, y_m),
            _ => Self::Solid,
        }
    }

    /// A flat opening, but for one without area.
    fn flat(outline: Outline, x_m: f64, y_m: f64) -> Self {
        if x_m > 0.0 && y_m > 0.0 { Self::Flat(outline, [x_m, y_m]) } else { Self::Solid }
    }
}

/// Why a luminaire cannot be had, if so.
pub(super) fn obstacle(renderer: &str, job: &Job, is_stock: bool) -> Option<String> {
    job.scene.luminaires.iter().filter(|l| l.model == LuminaireModel::Area).find_map(|l| match Opening::of(l) {
        Opening::None => None,
        _ if is_stock => Some(format!("{}: a stock scene of {renderer} has IES tables on points only", l.id)),
        Opening::Flat(..) => None,
        Opening::Solid => Some(format!("{}: only flat luminous openings are area lights in {renderer}", l.id)),
    })
}
