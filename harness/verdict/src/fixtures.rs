//! Tasks and recordings that are made up, for tests here and in the crates above.

#![allow(clippy::unwrap_used, reason = "only tests call this")]

use std::collections::BTreeMap;
use std::sync::LazyLock;

use glam::DVec3;
use luxproof_model::{Estimate, Light, MeterId, ProcedureId, Quantity, Reading, ReadingKey, Recording, Role};
use luxproof_scene::{Bounces, Meter, Scene, Transport};
use luxproof_spec::ToleranceOverride;
use luxproof_spec::procedures::{Target, Task};

use crate::{Judge, Policy};

/// Who judges by the built-in policy.
pub fn built_in() -> Judge<'static> {
    static POLICY: LazyLock<Policy> = LazyLock::new(|| Policy::built_in().unwrap());
    const NONE: &BTreeMap<ProcedureId, ToleranceOverride> = &BTreeMap::new();
    Judge {
        tolerances: &POLICY.tolerances,
        known: &POLICY.known,
        overrides: NONE,
        trust: luxproof_spec::Trust::Own,
        published: None,
    }
}

/// A task of so many meters of indirect light in an empty scene; what is read there is made up.
pub fn task(meters: usize) -> Task {
    let target = |k| Target::of_one(MeterId::new("grid", k), Meter { position_m: DVec3::ZERO, normal: DVec3::Z }, 1.0);
    Task {
        procedure: ProcedureId::IndirectIlluminance,
        scene: Scene::default(),
        transport: Transport::Indirect(Bounces::Converged),
        quantity: Quantity::Illuminance,
        targets: (0..meters).map(target).collect(),
    }
}

/// What an engine says of such a task.
pub fn recording(engine: &str, estimates: &[Estimate]) -> Recording {
    let role = if ["simulator", "iesna"].contains(&engine) { Role::Reference } else { Role::Renderer };
    let key = ReadingKey::new("c", ProcedureId::IndirectIlluminance, engine);
    let light = Light(Transport::Indirect(Bounces::Converged));
    let readings = estimates.iter().enumerate();
    let readings =
        readings.map(|(k, estimate)| Reading::new(MeterId::new("grid", k), Quantity::Illuminance, *estimate)).collect();
    Recording { role, model: "point".into(), readings, ..Recording::of(key, light) }
}
