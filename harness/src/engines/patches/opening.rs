//! What shines of a luminaire where only points and flat openings are lights.

use luminaire::photometry::LuminousOpening;
use luminaire::scene::{Luminaire, LuminaireModel};

use crate::engines::Job;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::engines) enum Opening {
    /// A point.
    None,
    /// Both sides in metres.
    Flat(Outline, [f64; 2]),
    /// There is no light for it.
    Solid,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::engines) enum Outline {
    Rectangle,
    Ellipse,
}

impl Opening {
    pub(in crate::engines) fn of(luminaire: &Luminaire) -> Self {
        if luminaire.model == LuminaireModel::Point {
            return Self::None;
        }
        let flat = |outline, x_m: f64, y_m: f64| {
            if x_m > 0.0 && y_m > 0.0 { Self::Flat(outline, [x_m, y_m]) } else { Self::Solid }
        };
        match luminaire.photometry.opening {
            LuminousOpening::Point => Self::None,
            other if other.bounding_box_m() == [0.0; 3] => Self::None,
            LuminousOpening::Box { x_m, y_m, height_m: 0.0 } => flat(Outline::Rectangle, x_m, y_m),
            LuminousOpening::Ellipse { x_m, y_m, height_m: 0.0 } => flat(Outline::Ellipse, x_m, y_m),
            _ => Self::Solid,
        }
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
