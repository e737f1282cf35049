//! How much of their noise meters have in common.

use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Noise of meters that is together by a smaller chance is shared.
const BY_CHANCE: f64 = 1e-3;

/// The design effect (L. Kish, Survey Sampling (1965)): how many times the variance of the mean over meters is what it would be were
/// their noise independent; 1 where chance alone may have brought together what is seen.
///
/// `deviates[draw][meter]` are deviations from each meter's own mean over all draws, in units of its standard error.
pub fn design_effect(deviates: &[Vec<f64>]) -> f64 {
    let squares: f64 = deviates.iter().flatten().map(|z| z * z).sum();
    let of_sums: f64 = deviates.iter().map(|draw| draw.iter().sum::<f64>().powi(2)).sum();
    let (effect, freedom) = (of_sums / squares, deviates.len() as f64 - 1.0);
    let is_shared = ChiSquared::new(freedom).is_ok_and(|chance| chance.sf(effect * freedom) < BY_CHANCE);
    if is_shared && effect.is_finite() { effect } else { 1.0 }
}

/// The same of the sum over meters of squared deviates: noise in opposite directions is as much one as noise in the same.
///
/// It is one more than the mean over meters of their squared correlations with all others, each less what chance makes of it; all of
/// them where draws are too few to tell.
pub fn design_effect_of_squares(deviates: &[Vec<f64>]) -> f64 {
    let (draws, all) = (deviates.len() as f64, deviates.first().map_or(0, Vec::len));
    let norm = |k: &usize| deviates.iter().map(|draw| draw[*k].powi(2)).sum::<f64>();
    let meters: Vec<(usize, f64)> = (0..all).map(|k| (k, norm(&k))).filter(|(_, norm)| *norm > 0.0).collect();
    let by_chance = 1.0 / (draws - 1.0);
    let square = |(a, b): (&(usize, f64), &(usize, f64))| {
        let product: f64 = deviates.iter().map(|draw| draw[a.0] * draw[b.0]).sum();
        (product * product / (a.1 * b.1) - by_chance) / (1.0 - by_chance)
    };
    let pairs = meters.iter().enumerate().flat_map(|(k, a)| meters[..k].iter().map(move |b| (a, b)));
    let count = meters.len().max(1) as f64;
    let effect = 1.0 + 2.0 * pairs.map(square).sum::<f64>() / count;
    if effect.is_finite() { effect.clamp(1.0, count) } else { count }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::system::random::normal;

    /// Of meters whose noise is together by this share, in so many draws.
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
    fn noise_that_is_one_counts_once_and_independent_noise_in_full() {
        for draws in [4, 16] {
            let alone = (0..1000).filter(|seed| effect(*seed, 0.0, draws, 24) > 1.0).count();
            assert!(alone <= 6, "{alone} of 1000");
            assert!((effect(1, 1.0, draws, 24) - 24.0).abs() < 1e-9);
        }
        // A half in common: 1 + 23 / 2.
        let mean = (0..200).map(|seed| effect(seed, 0.5, 16, 24)).sum::<f64>() / 200.0;
        assert!((mean / 12.5 - 1.0).abs() < 0.15, "{mean}");
        assert_eq!(design_effect(&[vec![0.0; 3], vec![0.0; 3]]), 1.0);
    }
}
