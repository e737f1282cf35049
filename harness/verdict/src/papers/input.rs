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

    use crate::fixtures;
    use glam::DVec3;
    use luxproof_engines::fixtures::luminaire;
    use luxproof_scene::Meter;

    fn are_close(a: f64, b: f64) -> bool {
        (a - b).abs() <= 1e-6 * b.abs()
    }

    /// A luminaire with the same intensity in all directions, at 2 m above the origin.
    fn sphere(candela: f64, flux_scale: f64) -> Luminaire {
        let table = LuminousIntensityDistribution::axial(vec![0.0, 180.0], vec![candela; 2]).unwrap();
        Luminaire { flux_scale, ..luminaire("sphere", DVec3::new(0.0, 0.0, 2.0), table) }
    }

    /// A task of one meter under two spheres: 100 cd to 1 cd, doubled, and 50.5 cd to .1 cd, trebled.
    fn task_below_spheres(transport: Transport) -> Task {
        let mut task = Task { transport, ..fixtures::task(1) };
        task.scene.luminaires = vec![sphere(100.0, 2.0), sphere(50.5, 3.0)];
        task
    }

    #[test]
    fn reflected_light_is_as_uncertain_as_all_flux_together() {
        let mut task = task_below_spheres(fixtures::task(0).transport);
        // Half digits of 1 cd and .15 cd, of 200 cd and 151.5 cd.
        assert_eq!(Input::of(&task).half_digits_cd, [1.0, 0.5 * 0.1 * 3.0]);
        let relative = 1.15 / 351.5;
        for value in [10.0, -10.0] {
            let found = Input::of(&task).bound(&task.targets[0], value);
            assert!(are_close(found, 10.0 * relative), "{value} {found}");
        }
        // A rating is eight times a decimal logarithm, of intensities twice and of the background once.
        let rating = Target { made: ReadingKind::Rating { glare: 1.0 }, ..task.targets[0].clone() };
        let found = Input::of(&task).bound(&rating, 10.0);
        assert!(are_close(found, 24.0 / 10f64.ln() * relative), "{found}");
        task.scene.luminaires.clear();
        assert_eq!(Input::of(&task).bound(&task.targets[0], 10.0), 0.0);
    }

    #[test]
    fn direct_light_is_as_uncertain_as_each_intensity_at_its_distance() {
        let mut task = task_below_spheres(Transport::Direct);
        let up = Meter { position_m: DVec3::ZERO, normal: DVec3::Z };
        let tilted = Meter { normal: DVec3::new(0.75f64.sqrt(), 0.0, 0.5), ..up };
        // 1.15 cd at 2 m, straight and at 60 degrees, with weights of 3 and 5.
        task.targets[0].aspects = vec![Aspect { meter: up, weight: 3.0 }, Aspect { meter: tilted, weight: 5.0 }];
        let found = Input::of(&task).bound(&task.targets[0], 10.0);
        assert!(are_close(found, (3.0 + 2.5) * 1.15 / 4.0), "{found}");
        let away = Meter { normal: DVec3::NEG_Z, ..up };
        task.targets[0].aspects = vec![Aspect { meter: away, weight: 3.0 }];
        assert_eq!(Input::of(&task).bound(&task.targets[0], 10.0), 0.0);
        // A luminaire without light in this direction has no digit there.
        let dark = Luminaire { photometry: table(vec![100.0, 100.0]).into(), ..sphere(1.0, 1.0) };
        let above = Meter { position_m: DVec3::new(0.0, 0.0, 4.0), normal: DVec3::NEG_Z };
        assert_eq!(direct_light_error(&dark, 0.5, &Aspect { meter: above, weight: 1.0 }), 0.0);
        assert!(direct_light_error(&dark, 0.5, &Aspect { meter: up, weight: 1.0 }) > 0.0);
    }
}
