//! Rotation and resampling of a distribution, each with the largest error that it causes.

use glam::DMat3;

use super::distribution::tabulate;
use super::{DistributionError, LuminousIntensityDistribution, angles_deg, direction};

/// A distribution on other nodes, and its error.
#[derive(Clone, Debug, PartialEq)]
pub struct Resampled {
    /// The new table.
    pub distribution: LuminousIntensityDistribution,
    /// Largest difference from the original in candela: a bound or a sampled value, depending on the function.
    pub largest_error_cd: f64,
}

impl LuminousIntensityDistribution {
    /// The same table on other planes and angles, with the exact bound of the difference.
    ///
    /// The difference of two bilinear tables is bilinear between the angles of both together, so that it is largest at
    /// one of those. Light beyond the ends of the new table counts too. A table of type A or B keeps its type and is
    /// resampled in its native angles.
    pub fn resampled(&self, c_deg: Vec<f64>, gamma_deg: Vec<f64>) -> Result<Resampled, DistributionError> {
        let candela = tabulate(&c_deg, &gamma_deg, |c, g| self.own_intensity(c, g).value());
        let distribution = self.with_table(c_deg, gamma_deg, candela)?;
        let circles = [self.own_planes(), distribution.own_planes()];
        let mut union_c: Vec<f64> = circles.iter().flat_map(|full| full.c_deg().to_vec()).collect();
        let mut union_gamma: Vec<f64> = [self, &distribution].iter().flat_map(|d| d.gamma_deg().to_vec()).collect();
        // A table jumps to zero at its ends: compare on both sides of them.
        for ends in [self.gamma_deg(), distribution.gamma_deg()] {
            union_gamma.extend([ends[0].next_down(), ends[ends.len() - 1].next_up()]);
        }
        union_gamma.retain(|g| (0.0..=180.0).contains(g));
        for angles in [&mut union_c, &mut union_gamma] {
            angles.sort_by(f64::total_cmp);
            angles.dedup();
        }
        let mut largest_error_cd = 0.0_f64;
        for &c in &union_c {
            for &g in &union_gamma {
                let error = (self.own_intensity(c, g).value() - distribution.own_intensity(c, g).value()).abs();
                largest_error_cd = largest_error_cd.max(error);
            }
        }
        Ok(Resampled { distribution, largest_error_cd })
    }

    /// The luminaire turned by `turn_deg` about its vertical axis, from +x towards +y.
    ///
    /// The result is exact for type C. For types A and B it is the type C approximation, turned.
    #[must_use]
    pub fn turned(&self, turn_deg: f64) -> Self {
        let full = self.full_circle();
        let mut c_deg: Vec<f64> = full.c_deg().iter().map(|c| (c + turn_deg).rem_euclid(360.0)).collect();
        c_deg.extend([0.0, 360.0]);
        c_deg.sort_by(f64::total_cmp);
        c_deg.dedup();
        let gamma_deg = full.gamma_deg().to_vec();
        let mut candela = tabulate(&c_deg, &gamma_deg, |c, g| full.intensity(c - turn_deg, g).value());
        // The plane 360 repeats the plane 0 exactly, whatever rounding does to the turned angles.
        let first: Vec<f64> = candela[..gamma_deg.len()].to_vec();
        let end = candela.len() - gamma_deg.len();
        candela[end..].copy_from_slice(&first);
        Self::full_table(c_deg, gamma_deg, candela)
    }

    /// The luminaire turned by any rotation, tabulated every `step_deg`, rounded down to a divisor of 90.
    ///
    /// The error is sampled at the nodes and cell centres of both tables.
    pub fn rotated(&self, rotation: DMat3, step_deg: f64) -> Resampled {
        let parts = (90.0 / step_deg.clamp(0.05, 90.0)).ceil().max(1.0) as u32;
        let (c_deg, gamma_deg) = (parts_of_right_angles(4, parts), parts_of_right_angles(2, parts));
        let back = rotation.transpose();
        let candela =
            tabulate(&c_deg, &gamma_deg, |c, g| self.intensity_towards(back * direction(c % 360.0, g)).value());
        let distribution = Self::full_table(c_deg, gamma_deg, candela);
        let mut largest_error_cd = 0.0_f64;
        // For types A and B, the nodes of the type C approximation serve as sampling points.
        let full = self.full_circle();
        for (table, turn) in [(&full, rotation), (&distribution, DMat3::IDENTITY)] {
            for (c, g) in table.nodes_and_centres() {
                let towards = turn * direction(c, g);
                let (c, g) = angles_deg(towards);
                let exact = self.intensity_towards(back * towards).value();
                largest_error_cd = largest_error_cd.max((distribution.intensity(c, g).value() - exact).abs());
            }
        }
        Resampled { distribution, largest_error_cd }
    }

    /// The native angles of every node and of the centre of every cell.
    pub(super) fn nodes_and_centres(&self) -> impl Iterator<Item = (f64, f64)> + use<> {
        let (c_deg, gamma_deg) = (with_centres(self.c_deg()), with_centres(self.gamma_deg()));
        c_deg.into_iter().flat_map(move |c| gamma_deg.clone().into_iter().map(move |g| (c, g)))
    }
}

/// Angles in degrees from 0 to `count` right angles, each divided into equal parts.
fn parts_of_right_angles(count: u32, parts: u32) -> Vec<f64> {
    (0..=count * parts).map(|k| 90.0 * f64::from(k) / f64::from(parts)).collect()
}

/// Angles, then the centres between neighbours.
fn with_centres(angles: &[f64]) -> Vec<f64> {
    let centres = angles.windows(2).map(|w| f64::midpoint(w[0], w[1]));
    angles.iter().copied().chain(centres).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use proptest::prelude::*;

    /// Angles from 0 to `last` in even steps.
    fn angles(last: f64, step_deg: f64) -> Vec<f64> {
        (0..=(last / step_deg) as u32).map(|k| f64::from(k) * step_deg).collect()
    }

    /// A table without symmetry, smooth at the poles.
    fn lopsided(step_deg: f64) -> LuminousIntensityDistribution {
        let (c, gamma) = (angles(360.0, step_deg), angles(180.0, step_deg));
        let candela =
            tabulate(&c, &gamma, |c, g| 100.0 + 30.0 * direction(c % 360.0, g).dot(DVec3::new(1.0, 0.5, -2.0)));
        LuminousIntensityDistribution::new(c, gamma, candela).unwrap()
    }

    #[test]
    fn resampling_on_a_finer_grid_has_no_error() {
        let table = lopsided(30.0);
        let same = table.resampled(angles(360.0, 5.0), angles(180.0, 5.0)).unwrap();
        assert!(same.largest_error_cd < 1e-12, "{}", same.largest_error_cd);
        let cut = table.resampled(angles(360.0, 5.0), angles(90.0, 5.0)).unwrap();
        assert!(cut.largest_error_cd > 100.0);
    }

    #[test]
    fn the_bound_of_resampling_is_reached_and_never_passed() {
        let table = lopsided(15.0);
        let coarse = table.resampled(vec![0.0, 90.0, 180.0, 270.0, 360.0], vec![0.0, 60.0, 120.0, 180.0]).unwrap();
        let mut worst = 0.0_f64;
        for c in angles(359.0, 1.0) {
            for g in angles(180.0, 1.0) {
                let [exact, found] = [&table, &coarse.distribution].map(|table| table.intensity(c, g).value());
                worst = worst.max((exact - found).abs());
            }
        }
        assert!(worst <= coarse.largest_error_cd + 1e-12);
        assert!(worst >= 0.999 * coarse.largest_error_cd, "{worst} {}", coarse.largest_error_cd);
    }

    proptest! {
        #[test]
        fn flux_and_intensity_survive_a_turn_exactly(turn in -720.0..720.0, c in 0.0..360.0, g in 0.0..180.0) {
            let table = lopsided(20.0);
            let turned = table.turned(turn);
            let (before, after) = (table.flux().value(), turned.flux().value());
            prop_assert!((before - after).abs() < 1e-12 * before);
            let (before, after) = (table.intensity(c, g).value(), turned.intensity(c + turn, g).value());
            prop_assert!((before - after).abs() < 1e-9 * before, "{} {}", before, after);
        }

        #[test]
        fn flux_survives_any_rotation_within_the_stated_error(axis in (-1.0..1.0, -1.0..1.0, -1.0..1.0), angle in 0.0..6.3) {
            let axis = DVec3::new(axis.0, axis.1, axis.2);
            prop_assume!(axis.length() > 0.1);
            let table = lopsided(10.0);
            let rotated = table.rotated(DMat3::from_axis_angle(axis.normalize(), angle), 6.0);
            let (before, after) = (table.flux().value(), rotated.distribution.flux().value());
            let allowed = 4.0 * std::f64::consts::PI * rotated.largest_error_cd;
            prop_assert!((before - after).abs() <= allowed, "{} {} {}", before, after, allowed);
            prop_assert!(rotated.largest_error_cd < 1.0, "{}", rotated.largest_error_cd);
        }
    }
}
