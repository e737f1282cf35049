//! The table of procedures: what each is called, asks of a spec, reads and is judged by. A new procedure is a row here.

use luminaire::calculators::inverse_square;
use luminaire::scene::{Luminaire, LuminaireModel, Scene, Transport};

use super::form::{AnyLight, Asked, AtMeters, Form};
use super::known;
use super::reads::Reads;
use super::task::{Sets, Target, Task, around, of_sets};
use crate::record::{Basis, EngineName, ProcedureId, Quantity};

/// One procedure.
pub struct Procedure {
    pub id: ProcedureId,
    /// As a heading.
    pub title: &'static str,
    /// In a navigation.
    pub short: &'static str,
    /// What it reads, in a sentence for users.
    pub meaning: &'static str,
    pub quantity: Quantity,
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
    Witness { engine: EngineName, basis: Basis, source: &'static str },
    /// A closed form of the scene at a target, to a rounding in `f64`.
    Formula { of: fn(&Scene, &Target) -> f64, source: &'static str },
}

impl Reference {
    /// What they rest on.
    pub const fn basis(&self) -> Basis {
        match self {
            Self::Witness { basis, .. } => *basis,
            Self::Formula { .. } => Basis::ClosedForm,
        }
    }

    /// The engine that is the reference, where one is.
    pub fn engine(&self) -> Option<&EngineName> {
        match self {
            Self::Witness { engine, .. } => Some(engine),
            Self::Formula { .. } => None,
        }
    }
}

/// Every procedure, in the order of reports, and the scenes of the calibration. Tolerances stand under the same name in `reference/tolerances.yaml`.
pub static ALL: [Procedure; 14] = [
    Procedure {
        id: ProcedureId::LuminousIntensity,
        title: "Luminous intensity",
        short: "Intensity",
        meaning: "The luminous intensity distribution read back from illuminance at a distance in free field, I = E d², over the curve of the photometric file.",
        quantity: Quantity::LuminousIntensity,
        form: Some(Form::Angles),
        transport: |_| Transport::Direct,
        reads: Reads::Illuminance,
        reference: |task| closed_form(task, "photometric file, bilinear in (C, gamma)"),
    },
    Procedure {
        id: ProcedureId::DirectIlluminance,
        title: "Direct illuminance",
        short: "Direct",
        meaning: "Illuminance straight from the luminaires, without any reflected light.",
        quantity: Quantity::Illuminance,
        form: Some(Form::Meters),
        transport: |_| Transport::Direct,
        reads: Reads::Illuminance,
        reference: |task| closed_form(task, "inverse square"),
    },
    Procedure {
        id: ProcedureId::IndirectIlluminance,
        title: "Indirect illuminance",
        short: "Indirect",
        meaning: "Illuminance by light that was reflected at least once.",
        quantity: Quantity::Illuminance,
        form: Some(Form::MetersAndBounces),
        transport: |asked| Transport::Indirect(asked.bounces),
        reads: Reads::Illuminance,
        reference: |_| EXACT,
    },
    Procedure {
        id: ProcedureId::TotalIlluminance,
        title: "Total illuminance",
        short: "Total",
        meaning: "Direct and reflected light together.",
        quantity: Quantity::Illuminance,
        form: Some(Form::MetersAndBounces),
        transport: |asked| Transport::Total(asked.bounces),
        reads: Reads::Illuminance,
        reference: |_| EXACT,
    },
    Procedure {
        id: ProcedureId::CylindricalIlluminance,
        title: "Cylindrical illuminance",
        short: "Cylindrical",
        meaning: "Mean over all vertical directions of the illuminance at a point (EN 12464-1), wherever its meter looks: of all light, or of the part that the spec names.",
        quantity: Quantity::Illuminance,
        form: Some(Form::MetersAndLight),
        transport: |asked| match asked.light {
            AnyLight::Total => Transport::Total(asked.bounces),
            AnyLight::Direct => Transport::Direct,
            AnyLight::Indirect => Transport::Indirect(asked.bounces),
        },
        reads: Reads::AllAround,
        reference: |task| match task.transport {
            Transport::Direct if is_inverse_square(&task.scene) => Reference::Formula {
                of: |scene, target| inverse_square::cylindrical_illuminance(scene, target.meter.position_m).value(),
                source: "inverse square, mean over vertical directions",
            },
            _ => EXACT,
        },
    },
    Procedure {
        id: ProcedureId::Luminance,
        title: "Luminance",
        short: "Luminance",
        meaning: "Luminance of the diffuse surface on which each meter lies, L = rho E / pi, E being all light, direct and reflected.",
        quantity: Quantity::Luminance,
        form: Some(Form::MetersAndBounces),
        transport: |asked| Transport::Total(asked.bounces),
        reads: Reads::Luminance,
        reference: |_| EXACT,
    },
    Procedure {
        id: ProcedureId::OpeningLuminance,
        title: "Luminance of an opening",
        short: "Opening",
        meaning: "Mean luminance of a luminaire's luminous opening towards observers, alone in free field: the illuminance of an eye that is aimed at its centre over the opening's projected solid angle.",
        quantity: Quantity::Luminance,
        form: Some(Form::Opening),
        transport: |_| Transport::Direct,
        reads: Reads::OpeningLuminance,
        reference: |task| {
            closed_form(task, "photometric file, bilinear in (C, gamma), over the projected luminous area")
        },
    },
    Procedure {
        id: ProcedureId::UnifiedGlareRating,
        title: "Unified glare rating",
        short: "Glare",
        meaning: "Unified glare rating (CIE 117) of observers who look as their meters do: 8 lg (.25 / Lb sum L² ω / p²) over the luminous openings in view, with Lb = E / pi of the indirect illuminance that is read at the eye.",
        quantity: Quantity::GlareRating,
        form: Some(Form::MetersAndBounces),
        transport: |asked| Transport::Indirect(asked.bounces),
        reads: Reads::GlareRating,
        reference: |_| EXACT,
    },
    known(ProcedureId::Point, "Calibration: point", "the inverse-square law from .5 to 10 m", |_| STRAIGHT),
    known(ProcedureId::Asymmetric, "Calibration: asymmetric", "a table without symmetry, turned, all around", |_| {
        STRAIGHT
    }),
    known(ProcedureId::Luminaires, "Calibration: luminaires", "three luminaires that differ", |_| STRAIGHT),
    known(ProcedureId::Shadow, "Calibration: shadow", "light that a box hides, and light that passes it", |_| STRAIGHT),
    known(
        ProcedureId::Furnace,
        "Calibration: furnace",
        "reflected light that is the same everywhere, near surfaces too",
        |_| EVEN,
    ),
    known(ProcedureId::Reflectances, "Calibration: reflectances", "floor, walls and ceiling that differ", |_| EXACT),
];

/// A scene of the calibration.
const fn known(
    id: ProcedureId,
    title: &'static str,
    meaning: &'static str,
    reference: fn(&Task) -> Reference,
) -> Procedure {
    Procedure {
        id,
        title,
        short: title,
        meaning,
        quantity: Quantity::Illuminance,
        form: None,
        transport: |_| Transport::Direct,
        reads: Reads::Illuminance,
        reference,
    }
}

const STRAIGHT: Reference = Reference::Formula { of: known::straight, source: "inverse square" };
const EVEN: Reference = Reference::Formula { of: known::even, source: "rho / (1 - rho) x flux / area" };

const EXACT: Reference =
    Reference::Witness { engine: EngineName::SIMULATOR, basis: Basis::Exact, source: "luminaire::simulator" };

/// Direct light of points that nothing hides is a closed form; other light is what the simulator says.
fn closed_form(task: &Task, source: &'static str) -> Reference {
    if is_inverse_square(&task.scene) {
        Reference::Witness { engine: EngineName::IESNA, basis: Basis::ClosedForm, source }
    } else {
        EXACT
    }
}

fn is_inverse_square(scene: &Scene) -> bool {
    scene.obstacles.is_empty() && scene.luminaires.iter().all(|l| l.model == LuminaireModel::Point)
}

impl Procedure {
    /// What it measures in a scene, as asked; `None` where the luminaire that is named is not there.
    pub fn task(&self, asked: &Asked, scene: &Scene, sets: &Sets<'_>) -> Option<Task> {
        let find = |id: &str| scene.luminaires.iter().find(|l| l.id == id);
        let alone = |l: &Luminaire| Scene { room: None, obstacles: vec![], luminaires: vec![l.clone()] };
        let (scene, transport, targets) = match asked {
            Asked::Angles(asked) => {
                let luminaire = find(&asked.luminaire)?;
                (alone(luminaire), Transport::Direct, around(luminaire, asked))
            }
            Asked::Opening(asked) => {
                let luminaire = find(&asked.luminaire)?;
                (alone(luminaire), Transport::Direct, of_sets(sets, &asked.meters, self.reads))
            }
            Asked::Meters(asked) => (scene.clone(), (self.transport)(asked), of_sets(sets, &asked.meters, self.reads)),
        };
        Some(Task { procedure: self.id, scene, transport, quantity: self.quantity, targets })
    }
}

impl Task {
    /// What its readings are judged by.
    pub fn reference(&self) -> Reference {
        (self.procedure.row().reference)(self)
    }
}

impl ProcedureId {
    /// Its row of the table.
    pub fn row(self) -> &'static Procedure {
        &ALL[self as usize]
    }

    /// Whether it is a scene of known answer, which no spec asks for.
    pub fn is_known(self) -> bool {
        self.row().form.is_none()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_procedure_has_its_row_in_the_order_of_reports() {
        assert!(ALL.iter().map(|p| p.id).take(ProcedureId::ALL.len()).eq(ProcedureId::ALL.iter().copied()));
        for (k, procedure) in ALL.iter().enumerate() {
            assert_eq!(procedure.id as usize, k);
            assert_eq!(procedure.id.is_known(), k >= ProcedureId::ALL.len());
        }
    }
}
