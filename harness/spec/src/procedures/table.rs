//! The table of procedures: what each is called, asks of a spec, reads and is judged by. A new procedure is a row here.

use luxproof_calculators::inverse_square;
use luxproof_scene::{Luminaire, LuminaireModel, Scene, Transport};

use super::form::{AnyLight, AtMeters, Form, ProcedureRequest};
use super::known;
use super::reads::Reads;
use super::task::{Sets, Target, Task, around, of_sets};
use luxproof_model::{Basis, EngineName, ProcedureId};

/// One procedure.
pub struct Procedure {
    pub id: ProcedureId,
    /// The keys that a spec gives it; none where it is a scene of the calibration.
    pub form: Option<Form>,
    /// Which light counts.
    pub transport: fn(&AtMeters) -> Transport,
    /// What of the light at a meter of the spec makes a reading.
    pub reads: Reads,
    /// What others are judged by.
    pub reference: fn(&Task) -> Reference,
}

/// What the readings of a task are judged by.
#[derive(Clone, Debug)]
pub enum Reference {
    /// The readings of one of our own engines.
    Engine { engine: EngineName, basis: Basis, source: &'static str },
    /// A closed form of the scene at a target, to a rounding in `f64`.
    Formula { of: fn(&Scene, &Target) -> f64, source: &'static str },
}

impl Reference {
    /// What they rest on.
    pub const fn basis(&self) -> Basis {
        match self {
            Self::Engine { basis, .. } => *basis,
            Self::Formula { .. } => Basis::ClosedForm,
        }
    }

    /// The engine that is the reference, where one is.
    pub fn engine(&self) -> Option<&EngineName> {
        match self {
            Self::Engine { engine, .. } => Some(engine),
            Self::Formula { .. } => None,
        }
    }
}

/// Every procedure, in the order of reports, and the scenes of the calibration. Tolerances stand under the same name in `reference/tolerances.yaml`.
pub static ALL: [Procedure; 17] = [
    Procedure {
        id: ProcedureId::LuminousIntensity,
        form: Some(Form::Angles),
        transport: |_| Transport::Direct,
        reads: Reads::Illuminance,
        reference: |task| closed_form(task, "photometric file, bilinear in (C, gamma)"),
    },
    Procedure {
        id: ProcedureId::DirectIlluminance,
        form: Some(Form::Meters),
        transport: |_| Transport::Direct,
        reads: Reads::Illuminance,
        reference: |task| closed_form(task, "inverse square"),
    },
    Procedure {
        id: ProcedureId::IndirectIlluminance,
        form: Some(Form::MetersAndBounces),
        transport: |asked| Transport::Indirect(asked.bounces),
        reads: Reads::Illuminance,
        reference: |_| EXACT,
    },
    Procedure {
        id: ProcedureId::TotalIlluminance,
        form: Some(Form::MetersAndBounces),
        transport: |asked| Transport::Total(asked.bounces),
        reads: Reads::Illuminance,
        reference: |_| EXACT,
    },
    Procedure {
        id: ProcedureId::CylindricalIlluminance,
        form: Some(Form::MetersAndLight),
        transport: chosen_light,
        reads: Reads::AllAround,
        reference: |task| mean_over_directions(task, cylindrical, "inverse square, mean over vertical directions"),
    },
    Procedure {
        id: ProcedureId::SemicylindricalIlluminance,
        form: Some(Form::MetersAndLight),
        transport: chosen_light,
        reads: Reads::Semicylinder,
        reference: |task| mean_over_directions(task, semicylindrical, "inverse square, mean over a half cylinder"),
    },
    Procedure {
        id: ProcedureId::HemisphericalIlluminance,
        form: Some(Form::MetersAndLight),
        transport: chosen_light,
        reads: Reads::Hemisphere,
        reference: |task| mean_over_directions(task, hemispherical, "inverse square, mean over a hemisphere"),
    },
    Procedure {
        id: ProcedureId::SphericalIlluminance,
        form: Some(Form::MetersAndLight),
        transport: chosen_light,
        reads: Reads::Sphere,
        reference: |task| mean_over_directions(task, spherical, "inverse square, mean over a sphere"),
    },
    Procedure {
        id: ProcedureId::Luminance,
        form: Some(Form::MetersAndBounces),
        transport: |asked| Transport::Total(asked.bounces),
        reads: Reads::Luminance,
        reference: |_| EXACT,
    },
    Procedure {
        id: ProcedureId::OpeningLuminance,
        form: Some(Form::Opening),
        transport: |_| Transport::Direct,
        reads: Reads::OpeningLuminance,
        reference: |task| {
            closed_form(task, "photometric file, bilinear in (C, gamma), over the projected luminous area")
        },
    },
    Procedure {
        id: ProcedureId::UnifiedGlareRating,
        form: Some(Form::MetersAndBounces),
        transport: |asked| Transport::Indirect(asked.bounces),
        reads: Reads::GlareRating,
        reference: |_| EXACT,
    },
    known(ProcedureId::Point, |_| STRAIGHT),
    known(ProcedureId::Asymmetric, |_| STRAIGHT),
    known(ProcedureId::Luminaires, |_| STRAIGHT),
    known(ProcedureId::Shadow, |_| STRAIGHT),
    known(ProcedureId::Furnace, |_| EVEN),
    known(ProcedureId::Reflectances, |_| EXACT),
];

/// The light that a spec chooses.
fn chosen_light(asked: &AtMeters) -> Transport {
    match asked.light {
        AnyLight::Total => Transport::Total(asked.bounces),
        AnyLight::Direct => Transport::Direct,
        AnyLight::Indirect => Transport::Indirect(asked.bounces),
    }
}

/// A mean over directions of direct light of points is a closed form; of other light it is what the simulator says.
fn mean_over_directions(task: &Task, of: fn(&Scene, &Target) -> f64, source: &'static str) -> Reference {
    match task.transport {
        Transport::Direct if is_inverse_square(&task.scene) => Reference::Formula { of, source },
        _ => EXACT,
    }
}

fn cylindrical(scene: &Scene, target: &Target) -> f64 {
    inverse_square::cylindrical_illuminance(scene, target.meter.position_m).value()
}

fn semicylindrical(scene: &Scene, target: &Target) -> f64 {
    inverse_square::semicylindrical_illuminance(scene, &target.meter).value()
}

fn hemispherical(scene: &Scene, target: &Target) -> f64 {
    inverse_square::hemispherical_illuminance(scene, &target.meter).value()
}

fn spherical(scene: &Scene, target: &Target) -> f64 {
    inverse_square::spherical_illuminance(scene, target.meter.position_m).value()
}

/// A scene of the calibration.
const fn known(id: ProcedureId, reference: fn(&Task) -> Reference) -> Procedure {
    Procedure { id, form: None, transport: |_| Transport::Direct, reads: Reads::Illuminance, reference }
}

const STRAIGHT: Reference = Reference::Formula { of: known::straight, source: "inverse square" };
const EVEN: Reference = Reference::Formula { of: known::even, source: "rho / (1 - rho) x flux / area" };

const EXACT: Reference =
    Reference::Engine { engine: EngineName::SIMULATOR, basis: Basis::Simulator, source: "simulator" };

/// Direct light of points that nothing hides is a closed form; other light is what the simulator says.
fn closed_form(task: &Task, source: &'static str) -> Reference {
    if is_inverse_square(&task.scene) {
        Reference::Engine { engine: EngineName::IESNA, basis: Basis::ClosedForm, source }
    } else {
        EXACT
    }
}

fn is_inverse_square(scene: &Scene) -> bool {
    scene.obstacles.is_empty() && scene.luminaires.iter().all(|l| l.model == LuminaireModel::Point)
}

/// The luminaire of an id.
fn find_luminaire<'a>(scene: &'a Scene, id: &str) -> Option<&'a Luminaire> {
    scene.luminaires.iter().find(|luminaire| luminaire.id == id)
}

/// A scene of one luminaire, without room or obstacles.
fn free_field(luminaire: &Luminaire) -> Scene {
    Scene { room: None, obstacles: vec![], luminaires: vec![luminaire.clone()] }
}

impl Procedure {
    /// What it measures in a scene, as asked; `None` where the luminaire that is named is not there.
    pub fn task(&self, asked: &ProcedureRequest, scene: &Scene, sets: &Sets<'_>) -> Option<Task> {
        let (scene, transport, targets) = match asked {
            ProcedureRequest::Angles(asked) => {
                let luminaire = find_luminaire(scene, &asked.luminaire)?;
                (free_field(luminaire), Transport::Direct, around(luminaire, asked))
            }
            ProcedureRequest::Opening(asked) => {
                let luminaire = find_luminaire(scene, &asked.luminaire)?;
                (free_field(luminaire), Transport::Direct, of_sets(sets, &asked.meters, self.reads))
            }
            ProcedureRequest::Meters(asked) => {
                (scene.clone(), (self.transport)(asked), of_sets(sets, &asked.meters, self.reads))
            }
        };
        Some(Task { procedure: self.id, scene, transport, quantity: self.id.quantity(), targets })
    }
}

impl Task {
    /// What its readings are judged by.
    pub fn reference(&self) -> Reference {
        (row(self.procedure).reference)(self)
    }
}

/// The row of a procedure.
pub fn row(id: ProcedureId) -> &'static Procedure {
    &ALL[id as usize]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_procedure_has_its_row_in_the_order_of_reports() {
        assert!(ALL.iter().map(|p| p.id).take(ProcedureId::ALL.len()).eq(ProcedureId::ALL.iter().copied()));
        for (k, procedure) in ALL.iter().enumerate() {
            assert_eq!(procedure.id as usize, k);
            assert_eq!(procedure.id.is_calibration(), k >= ProcedureId::ALL.len());
        }
    }
}
