//! Direct illuminance of point luminaires: the inverse-square law, exact for the bilinear table.

use super::Bounded;
use luxproof_scene::{Luminaire, Meter, Scene};

/// Direct illuminance in lux at a meter that nothing hides from any luminaire.
pub(super) fn illuminance(scene: &Scene, meter: &Meter) -> Bounded {
    scene.luminaires.iter().fold(Bounded::default(), |sum, luminaire| sum + point(luminaire, meter))
}

/// Direct illuminance in lux from one luminaire as a point.
pub(super) fn point(luminaire: &Luminaire, meter: &Meter) -> Bounded {
    Bounded { value: inverse_square(luminaire, meter), bound: rounding(luminaire, meter) }
}

/// Illuminance in lux at an unobstructed meter: E = I(C, gamma) cos ξ / d², zero behind the meter.
fn inverse_square(luminaire: &Luminaire, meter: &Meter) -> f64 {
    let away = meter.position_m - luminaire.position_m;
    let d2 = away.length_squared();
    let cosine = -away.dot(meter.normal) / d2.sqrt();
    if cosine <= 0.0 {
        return 0.0;
    }
    luminaire.intensity_towards(away).value() * cosine / d2
}

/// How far rounding may move that value, in lux.
///
/// The angles carry a few units in the last place, and over a cell of the table that turns into at most its steepest
/// slope times as much: 1e-13 of the peak covers cells down to a tenth of a degree.
fn rounding(luminaire: &Luminaire, meter: &Meter) -> f64 {
    let peak = luminaire.photometry.distribution.max_intensity().value() * luminaire.flux_scale;
    1e-13 * peak / (meter.position_m - luminaire.position_m).length_squared()
}
