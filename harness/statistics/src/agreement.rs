//! Whether stated errors are right: the ratio of scatter to stated error, with its interval.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor};

use crate::design_effect::design_effect_of_squares;
use crate::scatter::{PooledScatter, UNSTATED_FREEDOM, pool_repeated};
use luxproof_model::Estimate;

/// The probability beyond either end of the interval of a ratio.
const INTERVAL_TAIL_P: f64 = 0.025;
/// The probability that few seeds show so little of the noise that meters share.
const UPPER_EFFECT_P: f64 = 0.05;

/// How readings scatter relative to their stated errors.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Agreement {
    /// Scatter over stated standard error, root of the mean square.
    pub ratio: f64,
    /// Lower end of the ratio's 95 % interval.
    pub low: f64,
    /// Upper end of the ratio's 95 % interval.
    pub high: f64,
    /// The probability of a ratio as far from 1 on either side if the stated errors are right.
    pub p_value: f64,
    /// Degrees of freedom of the scatter: readings minus meters, fewer where meters share their noise.
    pub degrees_of_freedom: f64,
    /// Degrees of freedom of the stated errors.
    pub of_stated: f64,
}

impl Agreement {
    /// Compares readings with different seeds, one list a meter, with their stated errors.
    ///
    /// `None` where too little is stated. `of_samples` is the design effect that the engine's own samples show, where it has any.
    /// Readings of few seeds show the design effect only roughly, so the larger of the two counts.
    ///
    /// The variance of a meter's readings over the mean of their stated variances is F. A sum over meters is nearly F, with the
    /// degrees of freedom of all of them above, and below those that match its variance. For a single meter this is exact, and also
    /// for meters with the same noise.
    pub fn of(meters: &[Vec<Estimate>], of_samples: Option<f64>) -> Option<Self> {
        let PooledScatter { sum, freedom, readings_freedom, deviates } = pool_repeated(meters)?;
        let observed = design_effect_of_squares(&deviates);
        let shared =
            of_samples.map_or_else(|| upper_design_effect(observed, deviates.len()), |known| known.max(observed));
        let above = readings_freedom / shared.min(meters.len() as f64);
        // The denominator's degrees of freedom that give F the variance of the pooled sum.
        let excess = readings_freedom / freedom - 1.0;
        let below = Some(4.0 + (above + 2.0) / excess)
            .filter(|below| (0.0..UNSTATED_FREEDOM).contains(below))
            .unwrap_or(UNSTATED_FREEDOM);
        let law = FisherSnedecor::new(above, below).ok()?;
        // The mean of F is a little above 1; the pooled sum has that bias removed.
        let bias = below / (below - 2.0);
        let (square, f) = (sum / freedom, bias * sum / freedom);
        let found = Self {
            ratio: square.sqrt(),
            low: (square * bias / law.inverse_cdf(1.0 - INTERVAL_TAIL_P)).sqrt(),
            high: (square * bias / law.inverse_cdf(INTERVAL_TAIL_P)).sqrt(),
            p_value: (2.0 * law.cdf(f).min(law.sf(f))).min(1.0),
            degrees_of_freedom: above,
            of_stated: below,
        };
        [found.low, found.high, found.p_value].into_iter().all(f64::is_finite).then_some(found)
    }
}

/// An upper limit of a design effect observed in so many draws: shared noise varies as chi-squared does.
fn upper_design_effect(observed: f64, draws: usize) -> f64 {
    let freedom = draws as f64 - 1.0;
    let least = ChiSquared::new(freedom).map_or(0.0, |chance| chance.inverse_cdf(UPPER_EFFECT_P));
    1.0 + (observed - 1.0) * freedom / least
}

#[cfg(test)]
mod tests {
    use super::*;
    use luxproof_model::Uncertainty;
    use luxproof_process::random::normal;

    const DRAWS: usize = 1000;
    const BLOCKS: usize = 8;

    /// A meter's noise: the amplitudes of a common part and of an independent part.
    type Noise = (f64, f64);

    /// One block of every meter.
    fn block(random: &mut fastrand::Rng, noises: &[Noise]) -> Vec<f64> {
        let common = normal(random);
        noises.iter().map(|(shared, independent)| 50.0 + shared * common + independent * normal(random)).collect()
    }

    /// The readings of meters with so many seeds, and the design effect of their blocks. `stated` scales the right errors.
    fn simulate(random: &mut fastrand::Rng, seeds: usize, stated: f64, noises: &[Noise]) -> (Vec<Vec<Estimate>>, f64) {
        let (mut meters, mut deviates) = (vec![vec![]; noises.len()], vec![]);
        for _ in 0..seeds {
            let blocks: Vec<Vec<f64>> = (0..BLOCKS).map(|_| block(random, noises)).collect();
            let mut means = vec![];
            for (k, readings) in meters.iter_mut().enumerate() {
                let mean = Estimate::of_samples(&blocks.iter().map(|b| b[k]).collect::<Vec<f64>>());
                means.push(mean.value);
                let error = stated * mean.uncertainty.standard_error().unwrap();
                let uncertainty = Uncertainty::sampled(error, Some(BLOCKS as f64 - 1.0));
                readings.push(Estimate { value: mean.value, uncertainty });
            }
            deviates.extend(blocks.iter().map(|b| b.iter().zip(&means).map(|(b, m)| b - m).collect::<Vec<f64>>()));
        }
        (meters, design_effect_of_squares(&deviates))
    }

    fn agreement(random: &mut fastrand::Rng, seeds: usize, stated: f64, noises: &[Noise]) -> Agreement {
        let (meters, shared) = simulate(random, seeds, stated, noises);
        Agreement::of(&meters, Some(shared)).unwrap()
    }

    /// How often of 1000 the p-value lies below each level.
    fn count_below<const N: usize>(seeds: usize, stated: f64, noises: &[Noise], levels: [f64; N]) -> [usize; N] {
        let mut random = fastrand::Rng::with_seed(7);
        let found: Vec<f64> = (0..DRAWS).map(|_| agreement(&mut random, seeds, stated, noises).p_value).collect();
        levels.map(|level| found.iter().filter(|p| **p < level).count())
    }

    #[test]
    fn right_errors_are_called_wrong_as_rarely_as_stated_whatever_noise_meters_share() {
        let half = 0.5_f64.sqrt();
        let independent = [1, 4, 24].map(|meters| vec![(0.0, 1.0); meters]);
        let opposite: Vec<Noise> = (0..12).map(|k| (if k % 2 == 0 { 1.0 } else { -1.0 }, 0.1)).collect();
        let shared = [vec![(1.0, 0.0); 12], vec![(half, half); 12], opposite];
        for seeds in [3, 10, 24] {
            for noises in independent.iter().chain(&shared) {
                let [five, one, rare] = count_below(seeds, 1.0, noises, [0.05, 0.01, 0.001]);
                assert!(five < 70 && one < 20 && rare < 5, "{seeds} {noises:?}: {five} {one} {rare}");
                assert!(seeds == 3 || five > 5, "{seeds} {noises:?}: {five} {one} {rare}");
            }
        }
    }

    #[test]
    fn errors_half_as_large_again_or_two_thirds_are_found_with_ten_seeds() {
        for stated in [1.5, 1.0 / 1.5] {
            let [found] = count_below(10, stated, &[(0.0, 1.0); 24], [1e-4]);
            assert!(found > 970, "{stated}: {found}");
        }
    }

    #[test]
    fn the_interval_holds_the_true_ratio() {
        let mut random = fastrand::Rng::with_seed(3);
        let mut count = 0;
        for _ in 0..DRAWS {
            let found = agreement(&mut random, 10, 0.5, &[(0.0, 1.0); 4]);
            count += usize::from(found.low < 2.0 && 2.0 < found.high);
        }
        assert!((940..990).contains(&count), "{count}");
        assert_eq!(Agreement::of(&[vec![Estimate::exact(1.0); 9]], None), None);
        let constant = Estimate { value: 1.0, uncertainty: Uncertainty::sampled(0.1, None) };
        assert_eq!(Agreement::of(&[vec![constant; 9]], None).map(|a| (a.ratio, a.p_value)), Some((0.0, 0.0)));
    }

    #[test]
    fn few_readings_may_underestimate_the_noise_that_meters_share() {
        assert!((upper_design_effect(3.0, 10) - 6.41).abs() < 0.01 && upper_design_effect(1.0, 3) == 1.0);
        let (meters, shared) = simulate(&mut fastrand::Rng::with_seed(1), 10, 1.0, &[(1.0, 1.0); 12]);
        assert!((2.5..5.5).contains(&shared), "{shared}");
        let [known, least, unknown] =
            [Some(12.0), Some(shared), None].map(|shared| Agreement::of(&meters, shared).unwrap().degrees_of_freedom);
        assert!(known < least && known <= unknown);
    }

    #[test]
    fn the_scatter_of_one_meter_is_f_with_its_own_degrees_of_freedom() {
        // Four readings of an error of 1 with 7 degrees of freedom: F of 3 and 28, by `tests/values.py`.
        let uncertainty = Uncertainty::sampled(1.0, Some(7.0));
        let readings = [98.0, 103.0, 99.5, 101.0].map(|value| Estimate { value, uncertainty });
        let found = Agreement::of(&[readings.to_vec()], Some(1.0)).unwrap();
        let expected = [2.058302005, 1.121664797, 8.018692805, 0.020106097];
        for (found, expected) in [found.ratio, found.low, found.high, found.p_value].into_iter().zip(expected) {
            assert!((found / expected - 1.0).abs() < 1e-5, "{found} {expected}");
        }
        assert!((found.degrees_of_freedom - 3.0).abs() < 1e-9 && (found.of_stated - 28.0).abs() < 1e-6, "{found:?}");
    }
}
