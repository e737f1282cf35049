//! The engine `iesna`: inverse-square method and infinite plane - exitance difference, read like any renderer.

use luxproof_calculators::exitance_difference::{Layers, RoomFluxes};
use luxproof_calculators::{Calculated, NotApplicable, Validity, inverse_square};
use luxproof_scene::{Bounces, LuminaireModel, Meter, Scene, Transport};

use super::{Absent, Engine, EngineError, EngineRoot, Entry, Job, JobDir, Measurement, Support, Version, checked};
use luxproof_model::{EngineName, Estimate, Role, Uncertainty};
use luxproof_process::process::{self, ProcessError};

#[derive(Default)]
pub(super) struct Iesna {
    /// What planning works out is there when it is read.
    fluxes: RoomFluxes,
}

const ID: EngineName = EngineName::IESNA;

pub(super) static ENTRY: Entry = Entry {
    name: ID,
    display_name: "iesna",
    installs: &[],
    is_on_request: false,
    models: &[LuminaireModel::Point, LuminaireModel::Area, LuminaireModel::Impostor],
    fits_coordinates: None,
    make: || Box::<Iesna>::default(),
};

/// Rounding of the inverse-square method in `f64`, relative: a few operations and two arctangents.
const ROUNDING: f64 = 1e-13;

impl Engine for Iesna {
    fn name(&self) -> EngineName {
        ID
    }

    fn role(&self) -> Role {
        Role::Reference
    }

    fn probe(&self, _site: &EngineRoot) -> Result<Version, Absent> {
        Ok(Version::own())
    }

    fn supports(&self, job: &Job) -> Support {
        let mut objections = vec![];
        let calculator = Calculator::of(job, &self.fluxes);
        for sensor in &job.sensors {
            match Validity::of(&calculator.calculate(&sensor.meter)) {
                Validity::Supported => {}
                Validity::Approximate(why) => objections.push(why),
                Validity::No(why) => return Support::No(format!("{}: {why}", sensor.id)),
            }
        }
        let mut objections = in_short(objections);
        objections.extend(cut(job.transport).map(str::to_owned));
        if objections.is_empty() {
            return Support::Yes;
        }
        Support::Approximate { why: objections.join("; "), size: None }
    }

    fn components(&self, _job: &Job) -> Vec<String> {
        [super::FILE_READER, super::OWN_LOOKUP].map(str::to_owned).to_vec()
    }

    /// What takes long, the flux of luminaires that hang tilted, planning has worked out.
    fn expected_s(&self, _job: &Job) -> Option<f64> {
        Some(0.0)
    }

    fn read(&self, job: &Job, _workbench: &JobDir) -> Result<Measurement, EngineError> {
        let mut measurement = Measurement::default();
        measurement.method.insert("method".into(), method(job.transport).into());
        let mut notes = vec![];
        let calculator = Calculator::of(job, &self.fluxes);
        for sensor in &job.sensors {
            if process::is_interrupted() {
                return Err(ProcessError::Interrupted { program: ID.to_string() }.into());
            }
            let calculated = calculator
                .calculate(&sensor.meter)
                .map_err(|error| EngineError::Solver { engine: ID, what: format!("{}: {error}", sensor.id) })?;
            let value = calculated.illuminance.value();
            // The inverse-square method is exact for what it is meant for; the others know no bound.
            let exact = job.transport == Transport::Direct && calculated.validity == Validity::Supported;
            let uncertainty = if exact { Uncertainty::Bound(ROUNDING * value) } else { Uncertainty::Unstated };
            measurement.estimates.push(Estimate { value, uncertainty });
            if let Validity::Approximate(why) = calculated.validity {
                notes.push(why);
            }
        }
        measurement.notes = in_short(notes);
        measurement.notes.extend(cut(job.transport).map(str::to_owned));
        checked(&ID, job, measurement)
    }
}

/// The first of many objections that differ only in their figures, and how many more there are.
fn in_short(mut objections: Vec<String>) -> Vec<String> {
    objections.dedup();
    if objections.len() > 2 {
        let more = objections.len() - 1;
        objections = vec![format!("{} (and the like at {more} more meters)", objections[0])];
    }
    objections
}

/// A job's scene, the zonal flux of its luminaires worked out once for all meters where reflected light is asked for.
struct Calculator<'a> {
    scene: &'a Scene,
    transport: Transport,
    layers: Option<Result<Layers, NotApplicable>>,
}

impl<'a> Calculator<'a> {
    fn of(job: &'a Job, fluxes: &RoomFluxes) -> Self {
        let (scene, transport) = (&job.scene, job.transport);
        let stop = Some(process::interrupt_flag());
        let layers = (transport != Transport::Direct).then(|| Layers::with(fluxes, scene, stop));
        Self { scene, transport, layers }
    }

    fn calculate(&self, meter: &Meter) -> Result<Calculated, NotApplicable> {
        let Some(layers) = &self.layers else { return inverse_square::direct_illuminance(self.scene, meter) };
        let layers = layers.as_ref().map_err(Clone::clone)?;
        match self.transport {
            Transport::Total(_) => layers.total_illuminance(self.scene, meter),
            _ => layers.indirect_illuminance(meter),
        }
    }
}

pub const fn method(transport: Transport) -> &'static str {
    match transport {
        Transport::Direct => "inverse square",
        Transport::Indirect(_) => "IP-ED",
        Transport::Total(_) => "inverse square + IP-ED",
    }
}

const fn cut(transport: Transport) -> Option<&'static str> {
    match transport {
        Transport::Indirect(Bounces::AtMost(_)) | Transport::Total(Bounces::AtMost(_)) => {
            Some("the zonal cavity method counts all bounces; the limit is not applied")
        }
        _ => None,
    }
}
