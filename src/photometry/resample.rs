//! Rotation and resampling of a distribution, each with the largest error that it brings.

use glam::{DMat3, DVec3};

use super::{DistributionError, LuminousIntensityDistribution, angles_deg, direction};

/// A distribution on other nodes, and how far it is from the one that it stands for.
#[derive(Clone, Debug, PartialEq)]
pub struct Resampled {
    /// The new table.
    pub distribution: LuminousIntensityDistribution,
    /// Largest difference in candela; see the function that made it for whether it is a bound or was sampled.
    pub largest_error_cd: f64,
}

impl LuminousIntensityDistribution {
    /// The same table on other planes and angles, with the exact bound of the difference.
    ///
    /// The difference of two bilinear tables is bilinear between the angles of both together, so that it is largest at
    /// one of those. Where the new table ends before the old one, what it leaves out counts too. A table of type A or B stays one:
    /// its angles are its own.
    pub fn resampled(&self, c_deg: Vec<f64>, gamma_deg: Vec<f64>) -> Result<Resampled, DistributionError> {
        let at = |c: f64, g: f64| self.at(c, g).value();
        let candela = c_deg.iter().flat_map(|&c| gamma_deg.iter().map(move |&g| at(c, g))).collect();
        let distribution = self.with_table(c_deg, gamma_deg, candela)?;
        let circles = [self.own_planes(), distribution.own_planes()];
        let mut union_c: Vec<f64> = circles.iter().flat_map(|full| full.c_deg().to_vec()).collect();
        let mut union_gamma: Vec<f64> = [self, &distribution].iter().flat_map(|d| d.gamma_deg().to_vec()).collect();
        // A table jumps to zero at its ends: look at both sides of them.
        for ends in [self.gamma_deg(), distribution.gamma_deg()] {
            union_gamma.extend([ends[0].next_down(), ends[ends.len() - 1].next_up()]);
        }
        union_gamma.retain(|g| (0.0..=180.0).contains(g));
        for angles in [&mut union_c, &mut union_gamma] {
            angles.sort_by(f64::total_cmp);
            angles.dedup();
        }
        let difference = |c: f64, g: f64| (at(c, g) - distribution.at(c, g).value()).abs();
        let largest_error_cd =
            union_c.iter().flat_map(|&c| union_gamma.iter().map(move |&g| difference(c, g))).fold(0.0, f64::max);
        Ok(Resampled { distribution, largest_error_cd })
    }

    /// The luminaire turned by `turn_deg` about its vertical axis, from +x towards +y: the same function, exactly, but for tables of
    /// types A and B, of which the stand-in of type C is turned.
    #[must_use]
    pub fn turned(&self, turn_deg: f64) -> Self {
        let full = self.full_circle();
        let mut c_deg: Vec<f64> = full.c_deg().iter().map(|c| (c + turn_deg).rem_euclid(360.0)).collect();
        c_deg.extend([0.0, 360.0]);
        c_deg.sort_by(f64::total_cmp);
        c_deg.dedup();
        let gamma_deg = full.gamma_deg().to_vec();
        let at = |c: f64, g: f64| full.intensity(c - turn_deg, g).value();
        let mut candela: Vec<f64> = c_deg.iter().flat_map(|&c| gamma_deg.iter().map(move |&g| at(c, g))).collect();
        let first: Vec<f64> = candela[..gamma_deg.len()].to_vec();
        let end = candela.len() - gamma_deg.len();
        candela[end..].copy_from_slice(&first);
        Self::full_table(c_deg, gamma_deg, candela)
    }

    /// The luminaire turned by any rotation, tabulated every `step_deg` (which is made to divide 90).
    ///
    /// The error is sampled: at the nodes of this table, at the centres of its cells and at those of the new one.
    pub fn rotated(&self, rotation: DMat3, step_deg: f64) -> Resampled {
        let quarters = (90.0 / step_deg.clamp(0.05, 90.0)).ceil().max(1.0) as u32;
        let angle = |k: u32| 90.0 * f64::from(k) / f64::from(quarters);
        let c_deg: Vec<f64> = (0..=4 * quarters).map(angle).collect();
        let gamma_deg: Vec<f64> = (0..=2 * quarters).map(angle).collect();
        let back = rotation.transpose();
        let at = |d: DVec3| self.intensity_towards(back * d).value();
        let candela = c_deg.iter().flat_map(|&c| gamma_deg.iter().map(move |&g| at(direction(c % 360.0, g)))).collect();
        let distribution = Self::full_table(c_deg, gamma_deg, candela);
        let mut largest_error_cd = 0.0_f64;
        let full = self.full_circle();
        // Of another axis, the nodes of its stand-in are as good as any.
        for (table, turn) in [(&full, rotation), (&distribution, DMat3::IDENTITY)] {
            for (c, g) in table.nodes_and_centres() {
                let towards = turn * direction(c, g);
                let (c, g) = angles_deg(towards);
                largest_error_cd = largest_error_cd.max((distribution.intensity(c, g).value() - at(towards)).abs());
            }
        }
        Resampled { distribution, largest_error_cd }
    }

    /// The table's own angles of every node and of the centre of every cell.
    pub(super) fn nodes_and_centres(&self) -> impl Iterator<Item = (f64, f64)> + use<> {
        let with_centres = |angles: &[f64]| {
            let centres = angles.windows(2).map(|w| f64::midpoint(w[0], w[1]));
            angles.iter().copied().chain(centres).collect::<Vec<f64>>()
        };
        let gamma_deg = with_centres(self.gamma_deg());
        with_centres(self.c_deg()).into_iter().flat_map(move |c| gamma_deg.clone().into_iter().map(move |g| (c, g)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A table without symmetry, smooth at the poles.
    fn lopsided(step_deg: f64) -> LuminousIntensityDistribution {
        let angles = |last: f64| (0..=(last / step_deg) as u32).map(|k| f64::from(k) * step_deg).collect::<Vec<f64>>();
        let (c, gamma) = (angles(360.0), angles(180.0));
        let of = |c: f64, g: f64| 100.0 + 30.0 * direction(c, g).dot(DVec3::new(1.0, 0.5, -2.0));
        let candela = c.iter().flat_map(|&c| gamma.iter().map(move |&g| of(c % 360.0, g))).collect();
        LuminousIntensityDistribution::new(c, gamma, candela).unwrap()
    }

    #[test]
    fn resampling_on_a_finer_grid_changes_nothing_and_says_so() {
        let table = lopsided(30.0);
        let fine = |last: u32| (0..=last / 5).map(|k| 5.0 * f64::from(k)).collect::<Vec<f64>>();
        let same = table.resampled(fine(360), fine(180)).unwrap();
        assert!(same.largest_error_cd < 1e-12, "{}", same.largest_error_cd);
        let cut = table.resampled(fine(360), fine(90)).unwrap();
        assert!(cut.largest_error_cd > 100.0);
    }

    #[test]
    fn the_bound_of_resampling_is_reached_and_never_passed() {
        let table = lopsided(15.0);
        let coarse = table.resampled(vec![0.0, 90.0, 180.0, 270.0, 360.0], vec![0.0, 60.0, 120.0, 180.0]).unwrap();
        let difference =
            |c: f64, g: f64| (table.intensity(c, g).value() - coarse.distribution.intensity(c, g).value()).abs();
        let sampled = (0..360).flat_map(|c| (0..=180).map(move |g| (f64::from(c), f64::from(g))));
        let worst = sampled.map(|(c, g)| difference(c, g)).fold(0.0, f64::max);
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
