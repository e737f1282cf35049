//! The doctor: every engine reads one meter of a scene of known answer, and its answer is judged.
//!
//! A cube of one reflectance with an isotropic point luminaire in its centre: the direct part is I cos / d² in closed form, the
//! indirect part comes from the simulator with its bound.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{DMat3, DVec3};
use luminaire::geometry::{Reflectances, Room};
use luminaire::photometry::{LuminousIntensityDistribution, Photometry};
use luminaire::scene::{Bounces, Luminaire, LuminaireModel, Meter, Scene, Transport};
use luminaire::simulator::{self, Accuracy};

use crate::engines::{Budget, Engine, EngineError, Job, Station};
use crate::judge::{Basis, Tolerances, Verdict, judge};
use crate::measure::{Failure, FailureKind, Instrument, Question, Reader};
use crate::record::{EngineName, MeterId, ProcedureId, Quantity};

/// What the doctor found of one engine.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    pub engine: EngineName,
    /// Whether it is there and reads the known answer.
    pub healthy: bool,
    /// What was read, or what is wrong.
    pub text: String,
}

/// Lets one engine read the known scene, in a folder that is thrown away.
pub fn examine(engine: &Arc<dyn Engine>, reader: &Reader, tolerances: &Tolerances) -> Finding {
    let finding = |healthy, text| Finding { engine: engine.name(), healthy, text };
    let version = match engine.probe(&reader.site) {
        Ok(version) => version,
        Err(absent) => return finding(false, format!("absent: {absent}")),
    };
    let instrument = Instrument { engine: Arc::clone(engine), version };
    let mut texts = vec![instrument.version.0.clone()];
    let mut healthy = true;
    for (procedure, transport) in [
        (ProcedureId::DirectIlluminance, Transport::Direct),
        (ProcedureId::IndirectIlluminance, Transport::Indirect(Bounces::Converged)),
    ] {
        match check(&instrument, reader, tolerances, &known_job(procedure, transport)) {
            Ok((well, text)) => {
                healthy &= well;
                texts.push(text);
            }
            Err(failure) if failure.kind == FailureKind::Declined => {
                texts.push(format!("{procedure} not supported: {failure}"));
            }
            Err(failure) => {
                healthy = false;
                texts.push(format!("{procedure}: {failure}"));
            }
        }
    }
    finding(healthy, texts.join("; "))
}

fn check(
    instrument: &Instrument,
    reader: &Reader,
    tolerances: &Tolerances,
    job: &Job,
) -> Result<(bool, String), Failure> {
    let (id, procedure) = (instrument.engine.name(), job.procedure);
    let measurement = reader.try_read(&Question::new(instrument, job, procedure.name()))?.measurement;
    let expected = expected(job).map_err(|what| EngineError::Solver { engine: id.clone(), what })?;
    let estimate = measurement.estimates[0];
    let tolerance = tolerances.of(procedure, Basis::Exact, id.as_str(), Quantity::Illuminance, &BTreeMap::new());
    let spread = tolerances.coverage_factor() * estimate.uncertainty.standard_error().unwrap_or(0.0);
    let deviation = estimate.value - expected;
    // Undecided is healthy here: the budget is small, and only gross faults are looked for.
    let well = matches!(judge(deviation, spread, tolerance.around(expected)), Verdict::Pass | Verdict::Inconclusive);
    let said = if well { "reads" } else { "WRONG: reads" };
    Ok((well, format!("{procedure} {said} {:.6} lx where {expected:.6} lx are right", estimate.value)))
}

fn known_job(procedure: ProcedureId, transport: Transport) -> Job {
    let reflectance = Reflectances::with_equal_walls(0.5, 0.5, 0.5);
    let table = LuminousIntensityDistribution::axial(vec![0.0, 90.0, 180.0], vec![100.0; 3]);
    let isotropic = table.unwrap_or_else(|e| unreachable!("a constant table is sound: {e}"));
    let luminaire = Luminaire {
        id: "isotropic".into(),
        photometry: Arc::new(Photometry::of(isotropic)),
        position_m: DVec3::splat(2.0),
        orientation: DMat3::IDENTITY,
        flux_scale: 1.0,
        model: LuminaireModel::Point,
    };
    let room = Some(Room { size_m: DVec3::splat(4.0), reflectance });
    let meter = Meter { position_m: DVec3::new(1.0, 2.5, 0.5), normal: DVec3::Z };
    Job {
        case: "doctor".into(),
        procedure,
        scene: Scene { room, obstacles: vec![], luminaires: vec![luminaire] },
        stations: vec![Station { id: MeterId::new("doctor", 0), meter }],
        transport,
        budget: Budget { relative_error: 0.003, seconds: 10.0 },
        seed: 1,
        settings: BTreeMap::new(),
    }
}

fn expected(job: &Job) -> Result<f64, String> {
    let (meter, luminaire) = (job.stations[0].meter, &job.scene.luminaires[0]);
    if job.transport == Transport::Direct {
        let to = luminaire.position_m - meter.position_m;
        return Ok(100.0 * to.normalize().dot(meter.normal) / to.length_squared());
    }
    let accuracy = Accuracy { relative_error: 1e-5, seed: job.seed };
    simulator::illuminance(&job.scene, &[meter], job.transport, &accuracy)
        .map(|s| s.estimates[0].illuminance.value())
        .map_err(|e| e.to_string())
}
