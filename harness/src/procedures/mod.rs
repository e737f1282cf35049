//! Procedures: what is measured in a case, each turned into stations, transport and a quantity; one file and one line each.

mod direct_illuminance;
mod indirect_illuminance;
mod luminous_intensity;
mod total_illuminance;

use luminaire::scene::{Meter, Scene, Transport};

use crate::record::{Light, MeterId, ProcedureId, Quantity};
use crate::spec::{Case, Names};

/// Every procedure, in the order of reports.
pub const ALL: [&dyn Procedure; 4] = [
    &luminous_intensity::LuminousIntensity,
    &direct_illuminance::DirectIlluminance,
    &indirect_illuminance::IndirectIlluminance,
    &total_illuminance::TotalIlluminance,
];

/// A way to put engines to the test.
pub trait Procedure: Sync {
    fn id(&self) -> ProcedureId;

    /// What is to be measured in this case; `None` where the spec does not ask for it.
    fn task(&self, case: &Case) -> Option<Task>;
}

/// What one procedure measures in one case.
#[derive(Clone, Debug)]
pub struct Task {
    pub procedure: ProcedureId,
    /// The scene with only what this procedure needs.
    pub scene: Scene,
    /// Which light counts.
    pub transport: Transport,
    /// What the readings are.
    pub quantity: Quantity,
    /// Where they are taken.
    pub targets: Vec<Target>,
}

impl Task {
    /// The luminaire model of the scene: point, area, impostor, or mixed.
    pub fn model(&self) -> String {
        let mut models: Vec<&str> = self.scene.luminaires.iter().map(|l| l.model.name()).collect();
        models.sort_unstable();
        models.dedup();
        if let [one] = models[..] { one.to_owned() } else { "mixed".to_owned() }
    }

    /// Which light counts.
    pub const fn light(&self) -> Light {
        Light(self.transport)
    }
}

/// One place of measurement and how its illuminance becomes a reading.
#[derive(Clone, Debug, PartialEq)]
pub struct Target {
    pub id: MeterId,
    /// Where illuminance is read.
    pub meter: Meter,
    /// The direction seen from the luminaire, for procedure 1.
    pub direction: Option<Direction>,
    /// The reading is the illuminance in lux times this: 1, or distance squared for an intensity.
    pub per_lux: f64,
}

/// A direction in a luminaire's own frame, in degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Direction {
    /// C plane.
    pub c_deg: f64,
    pub gamma_deg: f64,
}

/// The targets of named meter sets.
fn targets_of_sets(case: &Case, names: &Names) -> Vec<Target> {
    let of_set = |name: &str| {
        let meters = case.meters.get(name).into_iter().flatten();
        let target = |(k, meter): (usize, &Meter)| Target {
            id: MeterId::new(name, k),
            meter: *meter,
            direction: None,
            per_lux: 1.0,
        };
        meters.enumerate().map(target).collect::<Vec<_>>()
    };
    names.iter().flat_map(of_set).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_procedure_stands_in_the_order_of_reports() {
        assert_eq!(ALL.map(Procedure::id), ProcedureId::ALL);
    }
}
