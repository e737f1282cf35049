//! Procedure 3: indirect illuminance, against an exact radiosity and the zonal cavity method with IP-ED.

use luminaire::scene::Transport;

use super::{Procedure, Task, targets_of_sets};
use crate::record::{ProcedureId, Quantity};
use crate::spec::Case;

/// Light that was reflected at least once, at meters in the room.
pub(super) struct IndirectIlluminance;

impl Procedure for IndirectIlluminance {
    fn id(&self) -> ProcedureId {
        ProcedureId::IndirectIlluminance
    }

    fn task(&self, case: &Case) -> Option<Task> {
        let asked = case.procedures.indirect_illuminance.as_ref()?;
        Some(Task {
            procedure: self.id(),
            scene: case.scene.clone(),
            transport: Transport::Indirect(asked.bounces.into()),
            quantity: Quantity::Illuminance,
            targets: targets_of_sets(case, &asked.meters),
        })
    }
}
