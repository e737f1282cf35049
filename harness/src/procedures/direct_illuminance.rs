//! Procedure 2: direct illuminance, against the inverse-square method.

use luminaire::scene::Transport;

use super::{Procedure, Task, targets_of_sets};
use crate::record::{ProcedureId, Quantity};
use crate::spec::Case;

/// Light straight from the luminaires at meters in the room.
pub(super) struct DirectIlluminance;

impl Procedure for DirectIlluminance {
    fn id(&self) -> ProcedureId {
        ProcedureId::DirectIlluminance
    }

    fn task(&self, case: &Case) -> Option<Task> {
        let asked = case.procedures.direct_illuminance.as_ref()?;
        Some(Task {
            procedure: self.id(),
            scene: case.scene.clone(),
            transport: Transport::Direct,
            quantity: Quantity::Illuminance,
            targets: targets_of_sets(case, &asked.meters),
        })
    }
}
