//! The design effect: how much of their noise meters share.

use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Meters share their noise where a smaller probability than this makes it coincide by chance.
const SHARED_NOISE_P: f64 = 1e-3;

/// The design effect: the variance of the mean over meters, relative to that of meters with independent noise.
///
/// After L. Kish, Survey Sampling (1965). The result is 1 where chance alone explains what is observed.
/// `deviates[draw][meter]` are deviations from each meter's mean over all draws, in units of its standard error.
pub fn design_effect(deviates: &[Vec<f64>]) -> f64 {
    let squares: f64 = deviates.iter().flatten().map(|z| z * z).sum();
    let squares_of_sums: f64 = deviates.iter().map(|draw| draw.iter().sum::<f64>().powi(2)).sum();
    let (effect, freedom) = (squares_of_sums / squares, deviates.len() as f64 - 1.0);
    let is_shared = ChiSquared::new(freedom).is_ok_and(|chance| chance.sf(effect * freedom) < SHARED_NOISE_P);
    if is_shared && effect.is_finite() { effect } else { 1.0 }
}

/// The mean correlation of meters' noise, from 0 to 1, by the variance of the meters' mean.
///
/// `parts[part][draw][meter]` are sums that add up over independent parts. The variance of the mean is that of independent meters and
/// that of fully correlated ones, in the parts 1 - correlation and correlation. `None` where no two meters vary.
pub fn mean_correlation(parts: &[Vec<Vec<f64>>]) -> Option<f64> {
    let count = parts.iter().flatten().map(Vec::len).max()? as f64;
    let mut of_mean = 0.0;
    let mut of_meters = vec![0.0; count as usize];
    for draws in parts {
        let means: Vec<f64> = draws.iter().map(|draw| draw.iter().sum::<f64>() / count).collect();
        of_mean += variance_of_mean(means.iter().copied());
        for (meter, sum) in of_meters.iter_mut().enumerate() {
            *sum += variance_of_mean(draws.iter().map(|draw| draw[meter]));
        }
    }
    let independent = of_meters.iter().sum::<f64>() / (count * count);
    let dependent = (of_meters.iter().map(|variance| variance.sqrt()).sum::<f64>() / count).powi(2);
    let correlation = (of_mean - independent) / (dependent - independent);
    (dependent > (1.0 + 1e-9) * independent).then_some(correlation.clamp(0.0, 1.0)).filter(|c| c.is_finite())
}

/// The variance of the mean of independent draws.
fn variance_of_mean(draws: impl ExactSizeIterator<Item = f64> + Clone) -> f64 {
    let count = draws.len() as f64;
    let mean = draws.clone().sum::<f64>() / count;
    draws.map(|x| (x - mean) * (x - mean)).sum::<f64>() / (count * (count - 1.0))
}

/// A meter with noise.
struct NoisyMeter {
    index: usize,
    /// The sum of its squared deviates over all draws.
    squares: f64,
}

/// The design effect of the sum of squared deviates; noise in opposite directions is shared noise here.
///
/// It is 1 plus the mean over meters of their squared correlations with all others, each less its expected value under
/// independence. Where draws are too few to decide, it is the number of meters.
pub fn design_effect_of_squares(deviates: &[Vec<f64>]) -> f64 {
    let (draws, all) = (deviates.len() as f64, deviates.first().map_or(0, Vec::len));
    let meters: Vec<NoisyMeter> = (0..all)
        .map(|index| NoisyMeter { index, squares: deviates.iter().map(|draw| draw[index].powi(2)).sum() })
        .filter(|meter| meter.squares > 0.0)
        .collect();
    // The mean squared correlation of independent noise.
    let by_chance = 1.0 / (draws - 1.0);
    let mut correlations = 0.0;
    for (k, a) in meters.iter().enumerate() {
        for b in &meters[..k] {
            correlations += (squared_correlation(deviates, a, b) - by_chance) / (1.0 - by_chance);
        }
    }
    let count = meters.len().max(1) as f64;
    let effect = 1.0 + 2.0 * correlations / count;
    if effect.is_finite() { effect.clamp(1.0, count) } else { count }
}

/// The squared correlation of two meters' noise over all draws.
fn squared_correlation(deviates: &[Vec<f64>], a: &NoisyMeter, b: &NoisyMeter) -> f64 {
    let product: f64 = deviates.iter().map(|draw| draw[a.index] * draw[b.index]).sum();
    product * product / (a.squares * b.squares)
}

#[cfg(test)]
mod tests {
    use super::*;
    use luxproof_process::random::normal;

    #[test]
    fn the_correlation_of_meters_is_found_whatever_their_errors() {
        let mut random = fastrand::Rng::with_seed(65);
        for expected in [0.0_f64, 0.3, 0.8, 1.0] {
            let mut found = 0.0;
            for _ in 0..100 {
                let draws = (0..16).map(|_| {
                    let common = normal(&mut random);
                    let one = |k: u32, own: f64| {
                        f64::from(1 + k % 3) * (expected.sqrt() * common + (1.0 - expected).sqrt() * own)
                    };
                    (0..40).map(|k| one(k, normal(&mut random))).collect()
                });
                let draws = draws.collect();
                found += mean_correlation(&[draws]).unwrap() / 100.0;
            }
            // Negative results count as 0.
            assert!((found - expected).abs() < 0.03 + 0.05 * expected, "{found} for {expected}");
        }
        assert_eq!(mean_correlation(&[vec![vec![1.0, 1.0]; 8]]), None);
        assert_eq!(mean_correlation(&[vec![vec![1.0], vec![2.0], vec![4.0]]]), None);
        assert_eq!(mean_correlation(&[]), None);
    }

    /// The design effect of meters that share this part of their noise, in so many draws.
    fn effect(seed: u64, shared: f64, draws: usize, meters: usize) -> f64 {
        let mut random = fastrand::Rng::with_seed(seed);
        let mut drawn: Vec<Vec<f64>> = (0..draws)
            .map(|_| {
                let common = normal(&mut random);
                (0..meters).map(|_| shared.sqrt() * common + (1.0 - shared).sqrt() * normal(&mut random)).collect()
            })
            .collect();
        for meter in 0..meters {
            let mean = drawn.iter().map(|d| d[meter]).sum::<f64>() / draws as f64;
            for draw in &mut drawn {
                draw[meter] -= mean;
            }
        }
        design_effect(&drawn)
    }

    #[test]
    fn equal_noise_counts_once_and_independent_noise_in_full() {
        for draws in [4, 16] {
            let independent = (0..1000).filter(|seed| effect(*seed, 0.0, draws, 24) > 1.0).count();
            assert!(independent <= 6, "{independent} of 1000");
            assert!((effect(1, 1.0, draws, 24) - 24.0).abs() < 1e-9);
        }
        // Half of the noise is shared: 1 + 23 / 2.
        let mean = (0..200).map(|seed| effect(seed, 0.5, 16, 24)).sum::<f64>() / 200.0;
        assert!((mean / 12.5 - 1.0).abs() < 0.15, "{mean}");
        assert_eq!(design_effect(&[vec![0.0; 3], vec![0.0; 3]]), 1.0);
    }

    #[test]
    fn the_design_effect_of_squares_is_one_plus_the_squared_correlations() {
        // Three draws of two meters: by hand, the squared correlation of (1, -1, 0) and (1, 0, -1) is 1/4. Chance explains 1/2.
        let drawn = [vec![1.0, 1.0], vec![-1.0, 0.0], vec![0.0, -1.0]];
        assert_eq!(design_effect_of_squares(&drawn), 1.0);
        // Five draws of (2, -1, -1, 0, 0) and (1, -1, 0, 0, 0): 3^2 / (6 * 2) = 3/4, of which chance explains 1/4.
        let drawn = [vec![2.0, 1.0], vec![-1.0, -1.0], vec![-1.0, 0.0], vec![0.0, 0.0], vec![0.0, 0.0]];
        let effect = design_effect_of_squares(&drawn);
        assert!((effect - (1.0 + (0.75 - 0.25) / 0.75)).abs() < 1e-12, "{effect}");
        // The sign of a correlation does not matter here.
        let opposite: Vec<Vec<f64>> = drawn.iter().map(|draw| vec![draw[0], -draw[1]]).collect();
        assert_eq!(design_effect_of_squares(&opposite), effect);
    }
}
