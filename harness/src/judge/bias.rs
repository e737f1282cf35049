//! Bias: whether an engine's readings lie off their references together, below any tolerance.
//!
//! The weighted mean of the relative deviations (weights 1/u²), its uncertainty widened by the Birge ratio where they scatter more than
//! they say (Birge, Phys. Rev. 40 (1932) 207) and for weights that are themselves estimated (Meier, Biometrics 9 (1953) 59), and the
//! probability of a mean so far off, were there no bias.

use std::collections::BTreeMap;
use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, Gamma};

use super::uncertainty::{Component, ErrorBudget, Source, Standard, upper_tail_of_normal};
use super::{Basis, Comparison, Judge};
use crate::record::{ReadingKey, Recording, Uncertainty};

/// Values without uncertainty may differ by the rounding of single precision, which renderers compute in.
pub const SINGLE_PRECISION: f64 = 1e-6;

/// The mean deviation of an engine's readings from one kind of reference, relative.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Bias {
    #[serde(flatten)]
    pub key: ReadingKey,
    pub basis: Basis,
    /// How many readings it is the mean of.
    pub readings: usize,
    /// Weighted by 1/u²; plain where no reading has an uncertainty.
    pub mean: f64,
    /// The interval of the mean at the coverage of verdicts; without uncertainties the range of the deviations.
    pub low: f64,
    pub high: f64,
    /// How probable a mean this far off is where there is no bias; null without uncertainties.
    pub p_value: Option<f64>,
    /// How the deviations scatter over the meters; null without uncertainties.
    pub scatter: Option<Scatter>,
}

/// Scatter of deviations about their mean, against the uncertainties that are stated of them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Scatter {
    /// Root of the mean square of deviations in units of their uncertainties, the Birge ratio.
    pub ratio: f64,
    /// How probable so large a ratio is where the uncertainties are right and the deviation is one for all meters; null where
    /// uncertainties are known by four degrees of freedom or fewer.
    pub p_value: Option<f64>,
}

impl Scatter {
    /// Of a sum of squares that are so many freely, each of a deviation over its uncertainty. Where uncertainties are known by few
    /// degrees of freedom the squares are those of Student's t, whose sum has about a gamma distribution of the same mean and variance.
    fn of(squares: f64, free: f64, degrees_of_freedom: impl Iterator<Item = Option<f64>>) -> Self {
        let (mut mean, mut variance, mut count) = (0.0, 0.0, 0.0);
        for freedom in degrees_of_freedom {
            let n = freedom.unwrap_or(f64::INFINITY).min(MANY);
            mean += n / (n - 2.0);
            variance += if n > 4.0 { 2.0 * n * n * (n - 1.0) / ((n - 2.0).powi(2) * (n - 4.0)) } else { f64::NAN };
            count += 1.0;
        }
        let (mean, variance) = (mean * free / count, variance * free / count);
        let gamma = Gamma::new(mean * mean / variance, mean / variance);
        Self { ratio: (squares / free).sqrt(), p_value: gamma.ok().map(|g| g.sf(squares)).filter(|p| p.is_finite()) }
    }
}

impl fmt::Display for Bias {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [mean, low, high] = [self.mean, self.low, self.high].map(|x| 100.0 * x);
        write!(f, "{mean:+.3} % [{low:+.3}, {high:+.3}]")?;
        match self.p_value {
            Some(p) => write!(f, ", p = {p:.2}")?,
            None => write!(f, ", range of {}", self.readings)?,
        }
        match self.scatter {
            Some(Scatter { ratio, p_value: Some(p) }) => {
                write!(f, "; scatter {ratio:.2} of what is stated, p = {p:.2}")
            }
            _ => Ok(()),
        }
    }
}

/// The weighted mean of values that state uncertainties, widened where they scatter more than they say.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WeightedMean {
    pub value: f64,
    /// Standard.
    pub uncertainty: f64,
    pub degrees_of_freedom: Option<f64>,
    pub scatter: Scatter,
}

/// From so many degrees of freedom on, Student's t is the normal distribution.
const MANY: f64 = 1e6;
/// Meier's term is the first of a series in 1 / degrees of freedom: simulated up to 192 meters, it is too small for fewer than these.
const FEWEST_FOR_WEIGHTS: f64 = 7.0;

impl WeightedMean {
    /// Of values with their standard uncertainties, all positive, and the degrees of freedom of these; `None` of fewer than two, and
    /// where weights or scatter are beyond all numbers.
    pub fn of(values: &[(f64, f64, Option<f64>)]) -> Option<Self> {
        if values.len() < 2 {
            return None;
        }
        let weights: f64 = values.iter().map(|(_, u, _)| u.powi(-2)).sum();
        let value = values.iter().map(|(d, u, _)| d * u.powi(-2)).sum::<f64>() / weights;
        let squares = values.iter().map(|(d, u, _)| ((d - value) / u).powi(2)).sum::<f64>();
        let scatter = Scatter::of(squares, (values.len() - 1) as f64, values.iter().map(|(_, _, freedom)| *freedom));
        // Shares of the mean with the degrees of freedom that each is known by.
        let shares = || values.iter().filter_map(|(_, u, freedom)| Some((u.powi(-2) / weights, (*freedom)?)));
        let fewest = shares().map(|(_, freedom)| freedom).reduce(f64::min);
        let meier = 1.0 + 4.0 * shares().map(|(share, freedom)| share * (1.0 - share) / freedom).sum::<f64>();
        let all = shares().map(|(share, freedom)| share * share / freedom).sum::<f64>().recip();
        let degrees_of_freedom = fewest.map(|fewest| if fewest < FEWEST_FOR_WEIGHTS { fewest } else { all });
        let mean = Self {
            value,
            uncertainty: (scatter.ratio.powi(2).max(meier) / weights).sqrt(),
            degrees_of_freedom,
            scatter,
        };
        let is_number = value.is_finite() && mean.uncertainty.is_finite() && mean.uncertainty > 0.0;
        is_number.then_some(mean)
    }

    /// Where meters share noise: their mean is as uncertain as that of so many times fewer, and its uncertainty is known by as many
    /// times fewer blocks, but no fewer than those of the meter that has the fewest.
    fn sharing(self, design_effect: f64, fewest: Option<f64>) -> Self {
        let of_fewer = |all: f64| (all / design_effect).max(fewest.unwrap_or(0.0).min(all));
        Self {
            uncertainty: design_effect.sqrt() * self.uncertainty,
            degrees_of_freedom: self.degrees_of_freedom.map(of_fewer),
            ..self
        }
    }

    /// The probability of a mean at least this far from nothing, were there nothing.
    pub fn p_value(&self) -> f64 {
        if self.value.abs() <= SINGLE_PRECISION {
            1.0
        } else {
            two_sided(self.value / self.uncertainty, self.degrees_of_freedom)
        }
    }
}

/// Probability of a standardised deviation at least this large, either way; what is no number agrees with nothing.
pub fn two_sided(z: f64, degrees_of_freedom: Option<f64>) -> f64 {
    if !z.is_finite() {
        return 0.0;
    }
    2.0 * Standard::of(degrees_of_freedom).tail(z.abs())
}

impl Judge<'_> {
    /// The bias of every engine of a task, against each kind of reference; comparisons without a relative deviation tell nothing.
    pub fn bias(&self, comparisons: &[Comparison], recordings: &[Recording]) -> Vec<Bias> {
        let shared = |key: &ReadingKey| recordings.iter().find(|r| r.key == *key).and_then(|r| r.design_effect);
        let mut groups: BTreeMap<(&ReadingKey, Basis), Vec<Deviation>> = BTreeMap::new();
        for c in comparisons.iter().filter(|c| c.uncertainty != Uncertainty::NotSeen) {
            let (Some(reference), Some(budget)) = (&c.reference, &c.budget) else { continue };
            let Some(relative) = c.relative_deviation else { continue };
            let uncertainty = budget.combined / reference.value.abs();
            let deviation = Deviation { relative, uncertainty, degrees_of_freedom: budget.degrees_of_freedom };
            groups.entry((&c.key, reference.basis)).or_default().push(deviation);
        }
        let tail = upper_tail_of_normal(self.tolerances.coverage_factor());
        let of = |((key, basis), all): ((&ReadingKey, Basis), Vec<Deviation>)| {
            of_group(key, basis, &all, shared(key).unwrap_or(1.0), tail)
        };
        groups.into_iter().filter_map(of).collect()
    }
}

/// How far a reading lies off its reference, relative to it.
struct Deviation {
    relative: f64,
    /// Standard.
    uncertainty: f64,
    degrees_of_freedom: Option<f64>,
}

/// `None` where the deviations are so absurd that their mean is no number.
fn of_group(key: &ReadingKey, basis: Basis, all: &[Deviation], design_effect: f64, tail: f64) -> Option<Bias> {
    // What states no uncertainty would outweigh everything.
    let stated = all.iter().filter(|d| d.uncertainty > SINGLE_PRECISION);
    let stated: Vec<_> = stated.map(|d| (d.relative, d.uncertainty, d.degrees_of_freedom)).collect();
    let fewest = stated.iter().filter_map(|(.., freedom)| *freedom).reduce(f64::min);
    let (mean, low, high, of_stated) = match WeightedMean::of(&stated).map(|mean| mean.sharing(design_effect, fewest)) {
        Some(mean) if stated.len() == all.len() => {
            let spread = Component::normal(Source::MonteCarlo, mean.uncertainty, mean.degrees_of_freedom);
            let expanded = ErrorBudget::new(vec![spread], tail).expanded;
            (mean.value, mean.value - expanded, mean.value + expanded, Some((mean.p_value(), mean.scatter)))
        }
        _ => {
            let deviations = || all.iter().map(|d| d.relative);
            let mean = deviations().sum::<f64>() / all.len() as f64;
            (mean, deviations().fold(f64::INFINITY, f64::min), deviations().fold(f64::NEG_INFINITY, f64::max), None)
        }
    };
    let are_numbers = [mean, low, high].iter().all(|v| v.is_finite());
    let (p_value, scatter) = of_stated.unzip();
    are_numbers.then(|| Bias { key: key.clone(), basis, readings: all.len(), mean, low, high, p_value, scatter })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::judge::tests::{built_in, recording, task};
    use crate::record::Estimate;
    use crate::system::random::normal;

    fn bias(readings: &[Estimate]) -> Bias {
        let exact = recording("simulator", &vec![Estimate::exact(1.0); readings.len()]);
        let (judge, task) = (built_in(), task(readings.len()));
        let comparisons = judge.compare(&task, &[&exact, &recording("radiance", readings)]);
        judge.bias(&comparisons, &[]).into_iter().find(|b| b.key.engine == "radiance").unwrap()
    }

    fn noisy(deviation: f64, stated: f64, seed: u64) -> Vec<Estimate> {
        let mut random = fastrand::Rng::with_seed(seed);
        let uncertainty = Uncertainty::sampled(stated, None);
        (0..50).map(|_| Estimate { value: 1.0 + deviation + 0.004 * normal(&mut random), uncertainty }).collect()
    }

    #[test]
    fn a_bias_below_the_tolerance_is_found_and_none_is_not() {
        let found = bias(&noisy(0.003, 0.004, 1));
        assert!(found.low > 0.0 && found.low < 0.003 && found.high > 0.003, "{found}");
        assert!(found.p_value.unwrap() < 1e-4 && found.readings == 50, "{found}");
        let p_values: Vec<f64> = (0..200).map(|seed| bias(&noisy(0.0, 0.004, seed)).p_value.unwrap()).collect();
        let small = p_values.iter().filter(|p| **p < 0.05).count();
        assert!((2..=20).contains(&small), "{small} of 200 below .05, of which 10 are expected");
    }

    #[test]
    fn scatter_beyond_what_is_stated_widens_the_interval() {
        let (honest, bold) = (bias(&noisy(0.003, 0.004, 1)), bias(&noisy(0.003, 0.0004, 1)));
        let width = |b: &Bias| b.high - b.low;
        assert!((width(&bold) / width(&honest) - 1.0).abs() < 0.3, "{honest} {bold}");
    }

    /// How often, of 2,000 times, the scatter of so many right readings is called this improbable.
    fn alarms(readings: usize, blocks: usize, below: f64) -> usize {
        let mut random = fastrand::Rng::with_seed(3);
        let mut improbable = || {
            let mut block = || 1.0 + 0.02 * normal(&mut random);
            let mut reading = || Estimate::of_samples(&(0..blocks).map(|_| block()).collect::<Vec<f64>>());
            let values: Vec<_> = (0..readings)
                .map(|_| reading())
                .filter_map(|e| Some((e.value, e.uncertainty.standard_error()?, e.uncertainty.degrees_of_freedom())))
                .collect();
            WeightedMean::of(&values).and_then(|m| m.scatter.p_value).is_some_and(|p| p < below)
        };
        (0..2000).filter(|_| improbable()).count()
    }

    #[test]
    fn scatter_over_meters_is_improbable_as_rarely_as_it_says_and_too_small_errors_show() {
        for (readings, blocks) in [(4, 8), (14, 8), (77, 8), (4, 16), (14, 16), (77, 16), (14, 200)] {
            let found = [0.05, 0.01, 0.001].map(|below| alarms(readings, blocks, below));
            eprintln!("{readings} {blocks} {found:?}");
            assert!(found[0] <= 150 && found[1] <= 40, "{readings} readings of {blocks} blocks: {found:?}");
        }
        let scatter = |stated| bias(&noisy(0.003, stated, 1)).scatter.unwrap();
        let (honest, bold) = (scatter(0.004), scatter(0.004 / 3.0));
        assert!((honest.ratio - 1.0).abs() < 0.2 && honest.p_value.unwrap() > 0.01, "{honest:?}");
        assert!((bold.ratio - 3.0).abs() < 0.6 && bold.p_value.unwrap() < 1e-6, "{bold:?}");
    }

    #[test]
    fn noise_that_meters_share_is_no_bias() {
        let p_value = |seed: u64, design_effect: Option<f64>| {
            let common = 0.004 * normal(&mut fastrand::Rng::with_seed(seed));
            let one = Estimate { value: 1.0 + common, uncertainty: Uncertainty::sampled(0.004, None) };
            let exact = recording("simulator", &[Estimate::exact(1.0); 24]);
            let (judge, subject) = (built_in(), Recording { design_effect, ..recording("radiance", &[one; 24]) });
            let comparisons = judge.compare(&task(24), &[&exact, &subject]);
            let found = judge.bias(&comparisons, &[subject]);
            found.into_iter().find(|b| b.key.engine == "radiance").and_then(|b| b.p_value).unwrap()
        };
        let small = |design_effect| (0..200).filter(|seed| p_value(*seed, design_effect) < 0.05).count();
        assert!((2..=20).contains(&small(Some(24.0))), "{}", small(Some(24.0)));
        assert!(small(None) > 100, "the negative control: {}", small(None));
        // Eight blocks that all meters share are no more than eight.
        let of_blocks = |seed: u64| {
            let mut random = fastrand::Rng::with_seed(seed);
            let one = Estimate::of_samples(&(0..8).map(|_| 1.0 + 0.01 * normal(&mut random)).collect::<Vec<f64>>());
            let stated = |e: Estimate| {
                Some((e.value - 1.0, e.uncertainty.standard_error()?, e.uncertainty.degrees_of_freedom()))
            };
            let mean = WeightedMean::of(&vec![stated(one).unwrap(); 24]).unwrap();
            mean.sharing(24.0, Some(7.0)).p_value()
        };
        let small = (0..2000).filter(|seed| of_blocks(*seed) < 0.001).count();
        assert!(small <= 4, "{small} of 2000");
    }

    #[test]
    fn readings_without_uncertainty_have_mean_and_range_and_no_probability() {
        let found = bias(&[Estimate::exact(1.01), Estimate::exact(0.99), Estimate::exact(1.03)]);
        assert!((found.mean - 0.01).abs() < 1e-12 && (found.low + 0.01).abs() < 1e-12, "{found}");
        assert_eq!((found.p_value, found.to_string()), (None, "+1.000 % [-1.000, +3.000], range of 3".to_owned()));
    }
}
