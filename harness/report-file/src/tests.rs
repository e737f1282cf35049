//! Reports that the tests of this crate share.

use luxproof_model::{Comparison, MeterId, ProcedureId, Quantity, ReadingKey, Report, Tolerance, Uncertainty, Verdict};

/// A report of so many synthetic comparisons.
pub(crate) fn long(comparisons: usize) -> Report {
    let comparison = Comparison {
        key: ReadingKey::new("room", ProcedureId::DirectIlluminance, "mitsuba"),
        model: "point".to_owned(),
        meter: MeterId::new("desk", 0),
        at_m: [0.0; 3],
        normal: [0.0, 0.0, 1.0],
        gamma_deg: None,
        c_deg: None,
        quantity: Quantity::Illuminance,
        value: Some(1.0),
        uncertainty: Uncertainty::Exact,
        reference: None,
        deviation: None,
        relative_deviation: None,
        tolerance: Tolerance::default(),
        tolerance_source: None,
        verdict: Verdict::Pass,
        diagnosis: None,
        budget: None,
        p_value: None,
    };
    Report {
        luxproof: luxproof_model::REPORT_VERSION,
        comparisons: (0..comparisons)
            .map(|k| Comparison { meter: MeterId::new("desk", k), ..comparison.clone() })
            .collect(),
        ..Report::default()
    }
}
