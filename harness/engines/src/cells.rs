//! The cells of a candela table about a direction: what a renderer's rounding of angles and values may make of an intensity.

use std::ops::RangeInclusive;

use glam::DVec3;
use luxproof_photometry::{LuminousIntensityDistribution, angles_deg};

/// How far a renderer's look-up of a table may be off.
#[derive(Clone, Copy, Debug)]
pub(super) struct LookUp {
    pub(super) gamma_deg: f64,
    pub(super) c_deg: f64,
    /// Width of the ramp that stands for the end of a table with light short of a pole.
    pub(super) edge_deg: f64,
    /// Rounding of interpolated values, in parts of the largest that they come from.
    pub(super) relative: f64,
}

/// A table over the full circle.
pub(super) struct Cells(LuminousIntensityDistribution);

impl Cells {
    pub(super) fn of(distribution: &LuminousIntensityDistribution) -> Self {
        Self(distribution.full_circle())
    }

    /// Bound on the error of the intensity towards a direction in the luminaire's frame, in candela: no more than the cells hold that
    /// the look-up may take for the right one, and nothing where these are dark.
    pub(super) fn error_cd(&self, own: DVec3, look_up: LookUp) -> f64 {
        let (c, gamma) = angles_deg(own);
        let angles = self.0.gamma_deg();
        let (first, last) = (angles[0], angles[angles.len() - 1]);
        let (reach, outside) = (look_up.gamma_deg, look_up.edge_deg + look_up.gamma_deg);
        if gamma < first - outside || gamma > last + outside {
            return 0.0;
        }
        let rows = about(angles, gamma, reach);
        // Where a table ends short of a pole, it falls from what its last row has.
        let begins = (first > 0.0 && gamma < first + reach).then_some(0);
        let ends_here = (last < 180.0 && gamma > last - reach).then_some(angles.len() - 1);
        // Between planes an intensity changes by what is linear in gamma from row to row.
        let ends = [gamma - reach, gamma + reach].map(|g| g.clamp(first, last));
        let inner = angles.iter().copied().filter(|g| (ends[0]..=ends[1]).contains(g));
        let about_gamma: Vec<f64> = ends.into_iter().chain(inner).collect();
        let (mut largest, mut fall, mut along_gamma, mut along_c) = (0.0_f64, 0.0_f64, 0.0_f64, 0.0_f64);
        let planes = self.0.c_deg();
        for k in 0..planes.len() - 1 {
            let mut angles_c = [c - 360.0, c, c + 360.0].into_iter();
            if !angles_c.any(|c| planes[k] <= c + look_up.c_deg && planes[k + 1] >= c - look_up.c_deg) {
                continue;
            }
            let (low, high) = (self.0.plane(k), self.0.plane(k + 1));
            for g in begins.into_iter().chain(ends_here) {
                fall = fall.max(low[g]).max(high[g]);
            }
            for g in rows.clone() {
                largest = largest.max(low[g]).max(high[g]);
                if g > *rows.start() {
                    let change = (low[g] - low[g - 1]).abs().max((high[g] - high[g - 1]).abs());
                    along_gamma = along_gamma.max(change / (angles[g] - angles[g - 1]));
                }
            }
            for g in &about_gamma {
                let change = self.0.intensity(planes[k + 1], *g).value() - self.0.intensity(planes[k], *g).value();
                along_c = along_c.max(change.abs() / (planes[k + 1] - planes[k]));
            }
        }
        let turned = (along_gamma * reach).min(largest) + (along_c * look_up.c_deg).min(largest);
        turned + look_up.relative * largest + fall
    }
}

/// The rows of the cells that an angle may fall into.
fn about(angles: &[f64], angle: f64, reach: f64) -> RangeInclusive<usize> {
    let last = angles.len() - 1;
    let first = angles.partition_point(|a| *a < angle - reach).saturating_sub(1).min(last - 1);
    first..=angles.partition_point(|a| *a <= angle + reach).clamp(first + 1, last)
}

#[cfg(test)]
mod tests {
    use luxproof_photometry::direction;

    use super::*;
    use crate::fixtures::random_table;

    #[test]
    fn whatever_the_look_up_does_within_its_reach_is_within_the_bound() {
        let mut random = fastrand::Rng::with_seed(1);
        let mut within = |reach: f64| reach * (2.0 * random.f64() - 1.0);
        let mut tables = fastrand::Rng::with_seed(2);
        let (mut dark, mut tight) = (0, 0);
        for _ in 0..20_000 {
            let distribution = random_table(&mut tables);
            let (c, gamma) = (180.0 + within(180.0), 90.0 + within(90.0));
            let look_up = LookUp { gamma_deg: 0.1, c_deg: 0.2, edge_deg: 0.0, relative: 0.0 };
            let bound = Cells::of(&distribution).error_cd(direction(c, gamma), look_up);
            let looked = (gamma + within(0.1)).clamp(0.0, 180.0);
            let off =
                (distribution.intensity(c + within(0.2), looked) - distribution.intensity(c, gamma)).value().abs();
            assert!(off <= bound + 1e-9, "{off} {bound} at {c} {gamma}: {distribution:?}");
            dark += usize::from(bound == 0.0);
            tight += usize::from(off > 0.5 * bound && off > 0.0);
        }
        // A bound that says nothing would pass, too.
        assert!(dark > 2_000 && tight > 1_000, "{dark} {tight}");
    }

    #[test]
    fn a_table_that_ends_dark_falls_from_nothing() {
        let look_up = LookUp { gamma_deg: 1e-4, c_deg: 1e-4, edge_deg: 1e-3, relative: 1e-6 };
        let [dark, lit] = [0.0, 50.0].map(|end| {
            let candela = (0..=9).map(|k| 1000.0 * (1.0 - f64::from(k) / 9.0) + end).collect();
            let gamma = (0..=9).map(|k| 10.0 * f64::from(k)).collect();
            let table = LuminousIntensityDistribution::axial(gamma, candela).unwrap();
            Cells::of(&table).error_cd(direction(0.0, 90.0), look_up)
        });
        assert!(dark < 0.01 && (lit - 50.0).abs() < 0.01, "{dark} {lit}");
    }

    #[test]
    fn dark_cells_owe_nothing_to_bright_ones_far_away() {
        let rows = [[0.0, 0.0, 0.0, 1e6], [0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1e6]];
        let gamma = vec![0.0, 60.0, 120.0, 180.0];
        let spike = LuminousIntensityDistribution::new(vec![0.0, 120.0, 240.0, 360.0], gamma, rows.concat()).unwrap();
        let look_up = LookUp { gamma_deg: 1e-5, c_deg: 1e-5, edge_deg: 1e-3, relative: 1e-6 };
        let error = |c, gamma| Cells::of(&spike).error_cd(direction(c, gamma), look_up);
        assert_eq!([error(0.0, 30.0), error(180.0, 150.0), error(180.0, 170.0), error(300.0, 119.9)], [0.0; 4]);
        assert!((error(0.0, 150.0) - 1.0).abs() < 0.5 && error(359.0, 179.0) < 2.0, "{}", error(0.0, 150.0));
    }
}
