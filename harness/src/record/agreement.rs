//! Whether stated errors are right: how readings of other seeds scatter over what is stated of them, either way, with its interval.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor};

use super::Estimate;
use super::design_effect::design_effect_of_squares;
use super::scatter::{MANY, Scatter, of_repeated};

/// Of the interval of a ratio, on either side.
const BEYOND: f64 = 0.025;
/// That readings of few seeds show so little of what meters have in common.
const UNLIKELY: f64 = 0.05;

/// How readings scatter over what is stated of their errors.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Agreement {
    /// Scatter over stated standard error, root of the mean square.
    pub ratio: f64,
    /// Ends of its interval of 95 %.
    pub low: f64,
    pub high: f64,
    /// The probability of a ratio as far from 1 either way, were the stated errors right.
    pub p_value: f64,
    /// Of the scatter: readings less the meters that they were taken at, fewer where meters share their noise.
    pub degrees_of_freedom: f64,
    /// Of what is stated.
    pub of_stated: f64,
}

impl Agreement {
    /// Of readings of meters with other seeds, one list a meter; nothing where too little is stated. `of_samples` is how much of their
    /// noise the meters share, where their engine's own samples tell: readings of few seeds tell it only roughly, and the more is
    /// believed then.
    ///
    /// The variance of a meter's readings over the mean of the variances that they state is F. So nearly is a sum over meters, with the
    /// degrees of freedom of all of them above and those below that its variance has: of a single meter, and of meters that are all
    /// one, it is exactly that.
    pub fn of(meters: &[Vec<Estimate>], of_samples: Option<f64>) -> Option<Self> {
        let Scatter { sum, freedom, of_readings, deviates } = of_repeated(meters)?;
        let seen = design_effect_of_squares(&deviates);
        let shared = of_samples.map_or_else(|| at_most(seen, deviates.len()), |known| known.max(seen));
        let above = of_readings / shared.min(meters.len() as f64);
        let excess = of_readings / freedom - 1.0;
        let below = Some(4.0 + (above + 2.0) / excess).filter(|b| (0.0..MANY).contains(b)).unwrap_or(MANY);
        let law = FisherSnedecor::new(above, below).ok()?;
        // The mean of F is a little above 1, which the sum is less of.
        let bias = below / (below - 2.0);
        let (square, f) = (sum / freedom, bias * sum / freedom);
        let end = |p: f64| (square * bias / law.inverse_cdf(p)).sqrt();
        let found = Self {
            ratio: square.sqrt(),
            low: end(1.0 - BEYOND),
            high: end(BEYOND),
            p_value: (2.0 * law.cdf(f).min(law.sf(f))).min(1.0),
            degrees_of_freedom: above,
            of_stated: below,
        };
        [found.low, found.high, found.p_value].into_iter().all(f64::is_finite).then_some(found)
    }
}

/// What a design effect that was seen in so many draws may really be: what meters have in common varies as chi-squared does.
fn at_most(seen: f64, draws: usize) -> f64 {
    let freedom = draws as f64 - 1.0;
    let least = ChiSquared::new(freedom).map_or(0.0, |chance| chance.inverse_cdf(UNLIKELY));
    1.0 + (seen - 1.0) * freedom / least
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::Uncertainty;
    use crate::system::random::normal;

    const DRAWS: usize = 1000;
    const BLOCKS: usize = 8;

    /// What an engine reads at meters with so many seeds, and how much of their noise its blocks tell them to share; each meter's noise
    /// is made of a common one and its own.
    fn read(random: &mut fastrand::Rng, seeds: usize, stated: f64, mix: &[(f64, f64)]) -> (Vec<Vec<Estimate>>, f64) {
        let (mut meters, mut deviates) = (vec![vec![]; mix.len()], vec![]);
        for _ in 0..seeds {
            let mut block = || {
                let common = normal(random);
                mix.iter().map(|(shared, own)| 50.0 + shared * common + own * normal(random)).collect()
            };
            let blocks: Vec<Vec<f64>> = (0..BLOCKS).map(|_| block()).collect();
            let one = |k: usize| Estimate::of_samples(&blocks.iter().map(|b| b[k]).collect::<Vec<f64>>());
            let means: Vec<Estimate> = (0..mix.len()).map(one).collect();
            deviates
                .extend(blocks.iter().map(|b| b.iter().zip(&means).map(|(b, m)| b - m.value).collect::<Vec<f64>>()));
            for (readings, Estimate { value, uncertainty }) in meters.iter_mut().zip(means) {
                let error = stated * uncertainty.standard_error().unwrap();
                readings.push(Estimate { value, uncertainty: Uncertainty::sampled(error, Some(BLOCKS as f64 - 1.0)) });
            }
        }
        (meters, design_effect_of_squares(&deviates))
    }

    fn found(random: &mut fastrand::Rng, seeds: usize, stated: f64, mix: &[(f64, f64)]) -> Agreement {
        let (meters, shared) = read(random, seeds, stated, mix);
        Agreement::of(&meters, Some(shared)).unwrap()
    }

    /// How often of 1000 the p-value lies below each.
    fn below<const N: usize>(seeds: usize, stated: f64, mix: &[(f64, f64)], levels: [f64; N]) -> [usize; N] {
        let mut random = fastrand::Rng::with_seed(7);
        let found: Vec<f64> = (0..DRAWS).map(|_| found(&mut random, seeds, stated, mix).p_value).collect();
        levels.map(|level| found.iter().filter(|p| **p < level).count())
    }

    #[test]
    fn right_errors_are_called_wrong_as_rarely_as_is_said_whatever_noise_meters_share() {
        let half = 0.5_f64.sqrt();
        let alone = |n: usize| vec![(0.0, 1.0); n];
        let opposite: Vec<(f64, f64)> = (0..12).map(|k| (if k % 2 == 0 { 1.0 } else { -1.0 }, 0.1)).collect();
        let mixes = [alone(1), alone(4), alone(24), vec![(1.0, 0.0); 12], vec![(half, half); 12], opposite];
        for (seeds, mix) in [3, 10, 24].into_iter().flat_map(|n| mixes.iter().map(move |mix| (n, mix))) {
            let [five, one, rare] = below(seeds, 1.0, mix, [0.05, 0.01, 0.001]);
            assert!(five < 70 && one < 20 && rare < 5, "{seeds} {mix:?}: {five} {one} {rare}");
            assert!(seeds == 3 || five > 5, "{seeds} {mix:?}: {five} {one} {rare}");
        }
    }

    #[test]
    fn errors_half_as_large_again_or_two_thirds_are_seen_with_ten_seeds() {
        for stated in [1.5, 1.0 / 1.5] {
            let [seen] = below(10, stated, &[(0.0, 1.0); 24], [1e-4]);
            assert!(seen > 970, "{stated}: {seen}");
        }
    }

    #[test]
    fn the_interval_holds_the_true_ratio() {
        let mut random = fastrand::Rng::with_seed(3);
        let holds = |found: Agreement| found.low < 2.0 && 2.0 < found.high;
        let held = (0..DRAWS).filter(|_| holds(found(&mut random, 10, 0.5, &[(0.0, 1.0); 4]))).count();
        assert!((940..990).contains(&held), "{held}");
        assert_eq!(Agreement::of(&[vec![Estimate::exact(1.0); 9]], None), None);
        let same = Estimate { value: 1.0, uncertainty: Uncertainty::sampled(0.1, None) };
        assert_eq!(Agreement::of(&[vec![same; 9]], None).map(|a| (a.ratio, a.p_value)), Some((0.0, 0.0)));
    }

    #[test]
    fn what_few_readings_show_of_shared_noise_may_be_more() {
        assert!((at_most(3.0, 10) - 6.41).abs() < 0.01 && at_most(1.0, 3) == 1.0);
        let (meters, shared) = read(&mut fastrand::Rng::with_seed(1), 10, 1.0, &[(1.0, 1.0); 12]);
        assert!((2.5..5.5).contains(&shared), "{shared}");
        let freedom = |known| Agreement::of(&meters, known).unwrap().degrees_of_freedom;
        assert!(freedom(Some(12.0)) < freedom(Some(shared)) && freedom(Some(12.0)) <= freedom(None));
    }
}
