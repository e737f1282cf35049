//! Procedure 1: the luminous intensity distribution read back, from illuminance at a distance in free field.
//!
//! I = E d² for a meter that faces the photometric centre (IES LM-41, CIE 121: inverse-square goniophotometry).

use luminaire::photometry::direction;
use luminaire::scene::{Meter, Scene, Transport};

use super::{Direction, Procedure, Target, Task};
use crate::record::{MeterId, ProcedureId, Quantity};
use crate::spec::{Angles, Case};

/// The luminaire alone, seen from a sphere of meters around it.
pub(super) struct LuminousIntensity;

impl Procedure for LuminousIntensity {
    fn id(&self) -> ProcedureId {
        ProcedureId::LuminousIntensity
    }

    fn task(&self, case: &Case) -> Option<Task> {
        let asked = case.procedures.luminous_intensity.as_ref()?;
        let luminaire = case.scene.luminaires.iter().find(|l| l.id == asked.luminaire)?;
        let distribution = &luminaire.photometry.distribution;
        let (c_deg, gamma_deg) = match &asked.angles {
            Angles::Photometry => (distribution.c_deg(), distribution.gamma_deg()),
            Angles::Listed(lists) => (lists.c_deg.as_slice(), lists.gamma_deg.as_slice()),
        };
        let target = |(k, (c_deg, gamma_deg)): (usize, (f64, f64))| {
            let outward = luminaire.orientation * direction(c_deg, gamma_deg);
            let position_m = luminaire.position_m + outward * asked.distance_m;
            Target {
                id: MeterId::new(&luminaire.id, k),
                meter: Meter { position_m, normal: -outward },
                direction: Some(Direction { c_deg, gamma_deg }),
                per_lux: asked.distance_m * asked.distance_m,
            }
        };
        let angles = c_deg.iter().flat_map(|&c| gamma_deg.iter().map(move |&g| (c, g)));
        Some(Task {
            procedure: self.id(),
            scene: Scene { room: None, obstacles: vec![], luminaires: vec![luminaire.clone()] },
            transport: Transport::Direct,
            quantity: Quantity::LuminousIntensity,
            targets: angles.enumerate().map(target).collect(),
        })
    }
}
