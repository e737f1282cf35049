//! The mean deviation of an engine from one kind of reference.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{Basis, ReadingKey};

/// The mean deviation of an engine's readings from one kind of reference, relative.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Bias {
    #[serde(flatten)]
    pub key: ReadingKey,
    pub basis: Basis,
    /// The number of readings.
    pub readings: usize,
    /// The mean deviation, weighted by 1/u²; unweighted where no reading has an uncertainty.
    pub mean: f64,
    /// Lower end of the mean's interval at the coverage of verdicts; without uncertainties, of the range of deviations.
    pub low: f64,
    /// Upper end, likewise.
    pub high: f64,
    /// The probability of a mean this far from zero if there is no bias; null without uncertainties.
    pub p_value: Option<f64>,
    /// Whether the true mean is beyond the tolerance, as sure as for a single reading: then the procedure fails, also where each reading
    /// by itself is undecided.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub fails: bool,
    /// How the deviations scatter over the meters; null without uncertainties.
    pub scatter: Option<Scatter>,
}

/// Scatter of deviations about their mean, relative to their stated uncertainties.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Scatter {
    /// The Birge ratio: root of the mean square of deviations in units of their uncertainties.
    pub ratio: f64,
    /// The probability of so large a ratio if the uncertainties are right and all meters have the same deviation. Null where
    /// uncertainties have four degrees of freedom or fewer.
    pub p_value: Option<f64>,
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ProcedureId;

    #[test]
    fn a_bias_is_written_in_percent_with_its_interval_probability_and_scatter() {
        let key = ReadingKey::new("room", ProcedureId::DirectIlluminance, "radiance");
        let scatter = Some(Scatter { ratio: 1.254, p_value: Some(0.4) });
        let (mean, low, high, p_value) = (0.0123, -0.01, 0.0346, Some(0.031));
        let bias = Bias { key, basis: Basis::Simulator, readings: 5, mean, low, high, p_value, fails: false, scatter };
        let text = "+1.230 % [-1.000, +3.460], p = 0.03; scatter 1.25 of what is stated, p = 0.40";
        assert_eq!(bias.to_string(), text);
        let plain = Bias { p_value: None, scatter: None, ..bias };
        assert_eq!(plain.to_string(), "+1.230 % [-1.000, +3.460], range of 5");
    }
}
