//! The direct ratios of a EULUMDAT file, computed from its table.
//!
//! The format calls them "direct ratios for room indices k = 0.6 ... 5, for determination of luminaire numbers according to
//! the utilization factor method" (A. W. Stockmar, Licht '90). They are the share of a luminaire's flux that reaches the
//! working plane without a reflection (`LiTG` publication 3.5 (1988), CIE 52-1982). Both leave the arrangement of the
//! luminaires open, and files of manufacturers differ by some hundredths.
//!
//! Here luminaires are evenly spread in a square room of index k = a b / (h (a + b)) = a / 2 h. Light at gamma travels
//! h tan gamma sideways. It lands inside the room from the share
//! (1 - h tan gamma |cos C| / a) (1 - h tan gamma |sin C| / a) of all places.

use crate::LuminousIntensityDistribution;

/// The room indices of the ten ratios.
pub(super) const ROOM_INDICES: [f64; 10] = [0.6, 0.8, 1.0, 1.25, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0];

/// The largest step of the sum in degrees: ratios are within 1e-4.
const MAX_STEP_DEG: f64 = 1.0;

/// The ratio of each room index, to the four decimals of the field; `None` without light.
pub(super) fn direct_ratios(distribution: &LuminousIntensityDistribution) -> Option<[f64; 10]> {
    let flux = distribution.flux().value();
    if flux <= 0.0 {
        return None;
    }
    let full = distribution.full_circle();
    let planes = cells(full.c_deg(), 360.0);
    let zones = cells(full.gamma_deg(), 90.0);
    let c_deg: Vec<f64> = planes.iter().map(|(middle, _)| *middle).collect();
    let gamma_deg: Vec<f64> = zones.iter().map(|(middle, _)| *middle).collect();
    let candela = full.intensities(&c_deg, &gamma_deg);
    let sides: Vec<(f64, f64)> = c_deg.iter().map(|c| c.to_radians().sin_cos()).collect();
    let mut landed = [0.0; 10];
    for ((gamma, height), row) in zones.iter().zip(candela.chunks(c_deg.len())) {
        let (middle, half) = (gamma.to_radians(), 0.5 * height.to_radians());
        let (band, tan) = (2.0 * middle.sin() * half.sin(), middle.tan());
        for (((_, width), (sin, cos)), candela) in planes.iter().zip(&sides).zip(row) {
            let lumens = candela * band * width.to_radians();
            for (sum, k) in landed.iter_mut().zip(ROOM_INDICES) {
                let run = tan / (2.0 * k);
                *sum += lumens * (1.0 - run * cos.abs()).max(0.0) * (1.0 - run * sin.abs()).max(0.0);
            }
        }
    }
    Some(landed.map(|lumens| (1e4 * lumens / flux).round() / 1e4))
}

/// Middle and width of each cell between the angles of a table, up to `end`, divided into steps.
fn cells(angles: &[f64], end: f64) -> Vec<(f64, f64)> {
    let mut cells = vec![];
    for w in angles.windows(2) {
        let (from, to) = (w[0], w[1].min(end));
        let parts = ((to - from) / MAX_STEP_DEG).ceil().max(0.0);
        let width = (to - from) / parts;
        cells.extend((0..parts as u32).map(|k| (from + (f64::from(k) + 0.5) * width, width)));
    }
    cells
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The configuration factor of two opposed squares of side a at distance 1 (Howell C-11).
    fn opposed_squares(a: f64) -> f64 {
        let (square, root) = (1.0 + a * a, (1.0 + a * a).sqrt());
        let logarithm = 0.5 * (square * square / (1.0 + 2.0 * a * a)).ln();
        2.0 / (std::f64::consts::PI * a * a) * (logarithm + 2.0 * a * root * (a / root).atan() - 2.0 * a * a.atan())
    }

    #[test]
    fn ratios_of_a_lambertian_ceiling_are_its_configuration_factors() {
        let gamma_deg: Vec<f64> = (0..=36).map(|k| 2.5 * f64::from(k)).collect();
        let candela = gamma_deg.iter().map(|g| g.to_radians().cos().max(0.0)).collect();
        let lambert = LuminousIntensityDistribution::axial(gamma_deg, candela).unwrap();
        for (found, k) in direct_ratios(&lambert).unwrap().into_iter().zip(ROOM_INDICES) {
            assert!((found - opposed_squares(2.0 * k)).abs() < 3e-4, "{k}: {found} {}", opposed_squares(2.0 * k));
        }
    }

    /// An axial table of three angles.
    fn axial(gamma_deg: [f64; 3], candela: [f64; 3]) -> LuminousIntensityDistribution {
        LuminousIntensityDistribution::axial(gamma_deg.to_vec(), candela.to_vec()).unwrap()
    }

    #[test]
    fn a_pencil_reaches_the_floor_whole_an_uplight_not_at_all_and_darkness_has_none() {
        // Light within half a degree travels at most .0087 h sideways.
        assert!(direct_ratios(&axial([0.0, 0.25, 0.5], [1.0, 1.0, 0.0])).unwrap().iter().all(|ratio| *ratio > 0.99));
        assert_eq!(direct_ratios(&axial([90.0, 120.0, 180.0], [0.0, 1.0, 1.0])), Some([0.0; 10]));
        assert_eq!(direct_ratios(&axial([0.0, 45.0, 90.0], [0.0; 3])), None);
    }

    #[test]
    fn a_quarter_turn_changes_nothing_in_a_square_room() {
        let c_deg: Vec<f64> = (0..=12).map(|k| 30.0 * f64::from(k)).collect();
        let candela = c_deg.iter().flat_map(|c| [100.0, 60.0 + 40.0 * c.to_radians().cos(), 0.0]).collect();
        let table = LuminousIntensityDistribution::new(c_deg, vec![0.0, 60.0, 90.0], candela).unwrap();
        let (before, after) = (direct_ratios(&table).unwrap(), direct_ratios(&table.turned(90.0)).unwrap());
        assert!(before.iter().zip(after).all(|(a, b)| (a - b).abs() <= 1e-4), "{before:?} {after:?}");
        assert!(before.windows(2).all(|w| w[0] < w[1]));
    }
}
