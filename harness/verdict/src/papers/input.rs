//! Input uncertainty by the last digit of a photometric file's candela table.
//!
//! It counts where the reference does not rest on that file: for published tables and values derived from a formula.
//! Engines, the simulator and the inverse-square method all read the same file. Its rounding is the same error in
//! reading and reference there, and cancels.

use luxproof_photometry::Photometry;
use luxproof_scene::Transport;

use luxproof_scene::Luminaire;
use luxproof_spec::procedures::{Aspect, ReadingKind, Target, Task};

/// Photometers write no more decimals of a candela.
const MAX_DECIMALS: i32 = 6;

pub(crate) struct Input<'a> {
    task: &'a Task,
    /// Half the last digit of each luminaire's table, in candela, dimming included.
    half_digits_cd: Vec<f64>,
}

impl<'a> Input<'a> {
    pub(crate) fn of(task: &'a Task) -> Self {
        let luminaires = task.scene.luminaires.iter();
        let half_digits = luminaires.map(|l| 0.5 * last_digit_cd(&l.photometry).unwrap_or(0.0) * l.flux_scale);
        Self { task, half_digits_cd: half_digits.collect() }
    }

    /// Half width of a reading's interval by the input, in the quantity's unit.
    ///
    /// In direct light an intensity between nodes is as uncertain as theirs. In reflected light all entries of a table
    /// count as if they deviated together, which is more than they do.
    pub(crate) fn bound(&self, target: &Target, value: f64) -> f64 {
        if self.task.transport == Transport::Direct {
            return self.direct_bound(target);
        }
        let luminaires = &self.task.scene.luminaires;
        let flux: f64 = luminaires.iter().map(|l| l.flux_scale * l.photometry.distribution.flux().value()).sum();
        // In a rating intensities count twice and the background once: as if all had one sign.
        let value = if target.made == ReadingKind::Sum { value } else { 3.0 * 8.0 / std::f64::consts::LN_10 };
        let flux_error: f64 = self.half_digits_cd.iter().map(|half| 4.0 * std::f64::consts::PI * half).sum();
        if flux > 0.0 { value.abs() * flux_error / flux } else { 0.0 }
    }

    fn direct_bound(&self, target: &Target) -> f64 {
        let mut bound = 0.0;
        for (luminaire, half_digit_cd) in self.task.scene.luminaires.iter().zip(&self.half_digits_cd) {
            for aspect in &target.aspects {
                bound += direct_light_error(luminaire, *half_digit_cd, aspect);
            }
        }
        bound
    }
}

/// The error of a luminaire's direct light by half a digit of its table; zero where the luminaire gives no light.
fn direct_light_error(luminaire: &Luminaire, half_digit_cd: f64, Aspect { meter, weight }: &Aspect) -> f64 {
    let towards = luminaire.position_m - meter.position_m;
    let cosine = (towards.dot(meter.normal) / towards.length()).max(0.0);
    if luminaire.intensity_towards(-towards).value() > 0.0 {
        weight * half_digit_cd * cosine / towards.length_squared()
    } else {
        0.0
    }
}

/// The last digit of a table: the largest power of ten, at most 1, that divides all its candela.
///
/// `None` where there is none: a multiplier hides the digits of the file.
fn last_digit_cd(photometry: &Photometry) -> Option<f64> {
    (0..=MAX_DECIMALS).find(|decimals| has_decimals(photometry, *decimals)).map(|d| 10f64.powi(-d))
}

/// Whether all candela of a table have at most so many decimals.
fn has_decimals(photometry: &Photometry, decimals: i32) -> bool {
    let table = &photometry.distribution;
    let scale = 10f64.powi(decimals);
    let mut candela = (0..table.c_deg().len()).flat_map(|c| table.plane(c));
    candela.all(|v| (v * scale - (v * scale).round()).abs() <= 1e-9 * (v * scale).abs().max(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use luxproof_photometry::LuminousIntensityDistribution;

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
