//! Where the light of a luminaire comes from.

use glam::DVec3;
use luxproof_photometry::LuminousOpening;
use luxproof_scene::{Luminaire, LuminaireModel};

/// Places along each side of an opening, an even number: none of them is its middle.
const ALONG: usize = 12;
/// The same for heights.
const LAYERS: usize = 4;

/// The centre of a point; of an opening places that stand for equal parts of it, in metres.
pub(super) fn places_m(luminaire: &Luminaire) -> Vec<DVec3> {
    let [width, length, height] = match luminaire.model {
        LuminaireModel::Area => luminaire.photometry.opening.bounding_box_m(),
        LuminaireModel::Point | LuminaireModel::Impostor => [0.0; 3],
    };
    let is_round =
        matches!(luminaire.photometry.opening, LuminousOpening::Ellipse { .. } | LuminousOpening::Ellipsoid { .. });
    let [x, y, z] = [(length, ALONG), (width, ALONG), (height, LAYERS)].map(|(side, count)| halves(side, count));
    let mut places = vec![];
    for (&x, &y) in x.iter().flat_map(|x| y.iter().map(move |y| (x, y))) {
        // Both are parts of half a side.
        if !is_round || x * x + y * y <= 1.0 {
            places.extend(z.iter().map(|z| 0.5 * DVec3::new(x * length, y * width, z * height)));
        }
    }
    places.into_iter().map(|place| luminaire.position_m + luminaire.orientation * place).collect()
}

/// The middles of equal parts of a side, in halves of it.
fn halves(side: f64, count: usize) -> Vec<f64> {
    let count = if side > 0.0 { count } else { 1 };
    (0..count).map(|k| (2.0 * k as f64 + 1.0) / count as f64 - 1.0).collect()
}
