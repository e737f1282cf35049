//! What a meter reads, as independent replicates: their mean is its value and their scatter its standard uncertainty.

use crate::Bounded;

/// Independent randomisations of everything that is sampled.
pub const REPLICATES: usize = 16;

/// One value for each randomisation.
pub(crate) type Replicates = [f64; REPLICATES];

/// Light at a meter: a known part, and a sampled part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Reading {
    pub(crate) known: Bounded,
    pub(crate) sampled: Replicates,
}

impl From<Bounded> for Reading {
    fn from(known: Bounded) -> Self {
        Self { known, sampled: [0.0; REPLICATES] }
    }
}

impl std::ops::Add for Reading {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        let sampled = std::array::from_fn(|r| self.sampled[r] + other.sampled[r]);
        Self { known: self.known + other.known, sampled }
    }
}

impl Reading {
    pub(crate) fn value(&self) -> f64 {
        self.known.value + mean_and_error(&self.sampled).0
    }

    /// Standard error of the sampled part; 0 where nothing was sampled.
    pub(crate) fn standard_error(&self) -> f64 {
        mean_and_error(&self.sampled).1
    }
}

/// Mean of replicates and its standard error, which has one degree of freedom less than there are replicates.
pub(crate) fn mean_and_error(values: &Replicates) -> (f64, f64) {
    let n = REPLICATES as f64;
    let mean = values.iter().sum::<f64>() / n;
    let square: f64 = values.iter().map(|v| (v - mean) * (v - mean)).sum();
    (mean, (square / (n * (n - 1.0))).sqrt())
}
