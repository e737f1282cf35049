//! The total: direct and indirect illuminance together.

use luminaire::scene::Transport;

use super::{Procedure, Task, targets_of_sets};
use crate::record::{ProcedureId, Quantity};
use crate::spec::Case;

/// All light at meters in the room.
pub(super) struct TotalIlluminance;

impl Procedure for TotalIlluminance {
    fn id(&self) -> ProcedureId {
        ProcedureId::TotalIlluminance
    }

    fn task(&self, case: &Case) -> Option<Task> {
        let asked = case.procedures.total_illuminance.as_ref()?;
        Some(Task {
            procedure: self.id(),
            scene: case.scene.clone(),
            transport: Transport::Total(asked.bounces.into()),
            quantity: Quantity::Illuminance,
            targets: targets_of_sets(case, &asked.meters),
        })
    }
}
