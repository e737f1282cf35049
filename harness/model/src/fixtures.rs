//! Small records for the tests of this crate.

use luxproof_scene::Transport;

use crate::{
    Basis, Comparison, EngineStatus, Light, MeterId, ProcedureId, Quantity, ReadingKey, Recording, Reference, Role,
    Status, Tolerance, Uncertainty, Verdict,
};

/// A reading of 102 lx that fails against a reference of 100 lx, at a tolerance of 1 %.
pub(crate) fn comparison() -> Comparison {
    let source = "simulator".to_owned();
    Comparison {
        key: ReadingKey::new("suite/room", ProcedureId::DirectIlluminance, "radiance"),
        model: "point".to_owned(),
        meter: MeterId::new("desk", 3),
        at_m: [1.0, 2.0, 0.75],
        normal: [0.0, 0.0, 1.0],
        gamma_deg: None,
        c_deg: None,
        quantity: Quantity::Illuminance,
        value: Some(102.0),
        uncertainty: Uncertainty::sampled(0.5, None),
        reference: Some(Reference::of(100.0, &Uncertainty::Exact, Basis::Simulator, source)),
        deviation: Some(2.0),
        relative_deviation: Some(0.02),
        tolerance: Tolerance { relative: 0.01, absolute: 0.5 },
        tolerance_source: None,
        verdict: Verdict::Fail,
        diagnosis: None,
        budget: None,
        p_value: None,
    }
}

/// The recording of [`comparison`], without readings.
pub(crate) fn recording() -> Recording {
    Recording::of(comparison().key, Light(Transport::Direct))
}

/// A renderer that took a second.
pub(crate) fn engine(name: &str, status: Status) -> EngineStatus {
    EngineStatus {
        id: name.into(),
        version: None,
        release: None,
        package: None,
        role: Role::Renderer,
        fingerprint: None,
        status,
        is_required: false,
        reason: None,
        wall_s: 1.0,
        mark: None,
    }
}
