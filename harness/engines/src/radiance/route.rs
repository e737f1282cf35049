//! By which way a luminaire becomes a light source of Radiance.

use luxproof_photometry::LuminousOpening;
use luxproof_scene::{Luminaire, LuminaireModel};

use super::settings::{Photometrist, Settings};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Route {
    Point,
    /// The luminous opening, with the table at full precision.
    Opening,
    /// ies2rad's surfaces, as light.
    Ies2radLight,
    /// ies2rad's surfaces, as an impostor (illum).
    Ies2radIllum,
}

impl Route {
    pub(super) const fn is_ies2rad(self) -> bool {
        matches!(self, Self::Ies2radLight | Self::Ies2radIllum)
    }
}

pub(super) fn route(luminaire: &Luminaire, settings: &Settings) -> Route {
    match (luminaire.model, settings.photometrist) {
        (LuminaireModel::Impostor, _) => Route::Ies2radIllum,
        (_, Photometrist::Ies2rad | Photometrist::Native) => Route::Ies2radLight,
        (LuminaireModel::Area, Photometrist::Exporter) if luminaire.photometry.opening != LuminousOpening::Point => {
            Route::Opening
        }
        (LuminaireModel::Area | LuminaireModel::Point, Photometrist::Exporter) => Route::Point,
    }
}
