//! Input uncertainty: what the last digit of a photometric file's candela table leaves open.
//!
//! It enters where the reference does not rest on that file: published tables and values derived from a formula. It does not
//! enter between engines, the simulator and the inverse-square method, which all read the same file: its rounding is the same
//! error in reading and reference and cancels.

use luminaire::photometry::Photometry;
use luminaire::scene::Transport;

use crate::procedures::{Aspect, Made, Target, Task};

/// Finer tables than this, in candela, are not written by photometers.
const FINEST_DECIMALS: i32 = 6;

pub(in crate::judge) struct Input<'a> {
    task: &'a Task,
    /// Half the last digit of each luminaire's table, in candela, dimming included.
    half_digits_cd: Vec<f64>,
}

impl<'a> Input<'a> {
    pub(in crate::judge) fn of(task: &'a Task) -> Self {
        let half = |l: &luminaire::scene::Luminaire| 0.5 * last_digit_cd(&l.photometry).unwrap_or(0.0) * l.flux_scale;
        Self { task, half_digits_cd: task.scene.luminaires.iter().map(half).collect() }
    }

    /// Half width of the interval that it leaves a reading, in the quantity's unit.
    ///
    /// Direct light: the intensity between nodes is as uncertain as theirs, and lies in one direction. Reflected light: as if
    /// all entries of a table were off together, which is more than they are.
    pub(in crate::judge) fn bound(&self, target: &Target, value: f64) -> f64 {
        let luminaires = || self.task.scene.luminaires.iter().zip(&self.half_digits_cd);
        if self.task.transport == Transport::Direct {
            let seen = luminaires().flat_map(|pair| target.aspects.iter().map(move |aspect| (pair, aspect)));
            let parts = seen.map(|((luminaire, half), Aspect { meter, weight })| {
                let towards = luminaire.position_m - meter.position_m;
                let cosine = (towards.dot(meter.normal) / towards.length()).max(0.0);
                if luminaire.intensity_towards(-towards).value() > 0.0 {
                    weight * half * cosine / towards.length_squared()
                } else {
                    0.0
                }
            });
            return parts.sum();
        }
        let flux: f64 = luminaires().map(|(l, _)| l.flux_scale * l.photometry.distribution.flux().value()).sum();
        // Of a rating intensities count twice and the background once: as if all that were of one sign.
        let value = if target.made == Made::Sum { value } else { 3.0 * 8.0 / std::f64::consts::LN_10 };
        let off: f64 = self.half_digits_cd.iter().map(|half| 4.0 * std::f64::consts::PI * half).sum();
        if flux > 0.0 { value.abs() * off / flux } else { 0.0 }
    }
}

/// The last digit of a table: the largest power of ten, one at most, of which all its candela are multiples.
///
/// `None` where there is none, as when a multiplier was applied: then the digits of the file are not known any more.
fn last_digit_cd(photometry: &Photometry) -> Option<f64> {
    let table = &photometry.distribution;
    let candela = || (0..table.c_deg().len()).flat_map(|c| table.plane(c));
    let is_multiple = |decimals: i32| {
        let scale = 10f64.powi(decimals);
        candela().all(|v| (v * scale - (v * scale).round()).abs() <= 1e-9 * (v * scale).abs().max(1.0))
    };
    (0..=FINEST_DECIMALS).find(|d| is_multiple(*d)).map(|d| 10f64.powi(-d))
}

#[cfg(test)]
mod tests {
    use super::*;
    use luminaire::photometry::LuminousIntensityDistribution;

    fn table(candela: Vec<f64>) -> Photometry {
        Photometry::of(LuminousIntensityDistribution::axial(vec![0.0, 90.0], candela).unwrap())
    }

    #[test]
    fn the_last_digit_is_that_of_the_finest_entry() {
        assert_eq!(last_digit_cd(&table(vec![120.0, 30.0])), Some(1.0));
        assert_eq!(last_digit_cd(&table(vec![664.4, 35.0])), Some(0.1));
        assert_eq!(last_digit_cd(&table(vec![664.4, 35.25])), Some(0.01));
        assert_eq!(last_digit_cd(&table(vec![1.0 / 3.0, 35.25])), None);
    }
}
