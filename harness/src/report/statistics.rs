//! What a set of meters says as a whole: mean, minimum and uniformity (minimum over mean, EN 12464-1), each with its uncertainty.

use itertools::Itertools;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::ReadingRecord;
use crate::record::{Estimate, Quantity, ReadingKey, Uncertainty};

/// Of one set of meters, as one engine read it. Errors of meters add up, since they may share what makes them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Statistics {
    #[serde(flatten)]
    pub key: ReadingKey,
    /// The set of meters.
    pub set: String,
    pub meters: usize,
    /// In lux, of luminances in cd/m².
    pub mean: Estimate,
    /// In lux, of luminances in cd/m².
    pub minimum: Estimate,
    /// Minimum over mean; null where the mean is none.
    pub uniformity: Option<Estimate>,
}

/// Of every set of two meters and more of illuminances or luminances, in the order of readings.
pub(super) fn statistics(readings: &[ReadingRecord]) -> Vec<Statistics> {
    let lit = |r: &&ReadingRecord| {
        matches!(r.reading.quantity, Quantity::Illuminance | Quantity::Luminance)
            && !r.key.procedure.is_known()
            && r.reading.value.is_finite()
    };
    let of_set = |r: &&ReadingRecord| (r.key.clone(), set(&r.reading.meter.0).to_owned());
    let sets = readings.iter().filter(lit).chunk_by(of_set);
    sets.into_iter().filter_map(|((key, set), readings)| of(key, set, &readings.collect_vec())).collect()
}

/// The set of a meter.
fn set(meter: &str) -> &str {
    meter.rsplit_once('[').map_or(meter, |(set, _)| set)
}

fn of(key: ReadingKey, set: String, readings: &[&ReadingRecord]) -> Option<Statistics> {
    let count = readings.len() as f64;
    let lowest = readings.iter().min_by(|a, b| a.reading.value.total_cmp(&b.reading.value)).filter(|_| count > 1.0)?;
    let mean = Estimate {
        value: readings.iter().map(|r| r.reading.value).sum::<f64>() / count,
        uncertainty: Uncertainty::of_dependent_sum(readings.iter().map(|r| (1.0 / count, r.reading.uncertainty))),
    };
    let minimum = Estimate { value: lowest.reading.value, uncertainty: lowest.reading.uncertainty };
    let uniformity = (mean.value > 0.0).then(|| Estimate {
        value: minimum.value / mean.value,
        uncertainty: Uncertainty::of_dependent_sum([
            (1.0 / mean.value, minimum.uncertainty),
            (minimum.value / mean.value.powi(2), mean.uncertainty),
        ]),
    });
    let is_number = |e: &Estimate| e.value.is_finite() && e.uncertainty.standard().is_finite();
    let uniformity = uniformity.filter(is_number);
    let all_are = is_number(&mean) && is_number(&minimum);
    all_are.then_some(Statistics { key, set, meters: readings.len(), mean, minimum, uniformity })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::{EngineName, MeterId, ProcedureId, Reading};

    #[test]
    fn mean_minimum_and_uniformity_carry_the_errors_of_their_meters() {
        let reading = |k, value, error| ReadingRecord {
            key: ReadingKey::new("office", ProcedureId::DirectIlluminance, EngineName::new("mitsuba")),
            model: "point".into(),
            reading: Reading {
                meter: MeterId::new("desk", k),
                quantity: Quantity::Illuminance,
                value,
                uncertainty: Uncertainty::Bound(error),
            },
        };
        let [s] = &statistics(&[reading(0, 100.0, 1.0), reading(1, 300.0, 3.0)])[..] else { panic!("one set") };
        assert_eq!((s.meters, s.mean.value, s.minimum.value), (2, 200.0, 100.0));
        assert_eq!((s.mean.uncertainty, s.minimum.uncertainty), (Uncertainty::Bound(2.0), Uncertainty::Bound(1.0)));
        let uniformity = s.uniformity.unwrap();
        assert_eq!(uniformity.value, 0.5);
        // 1 / 200 + 100 * 2 / 200^2
        assert!((uniformity.uncertainty.bound() - 0.01).abs() < 1e-12, "{uniformity:?}");
        assert!(statistics(&[reading(0, 1.0, 0.0)]).is_empty());
    }
}
