//! The engine `simulator`: our own solutions, read like any renderer.

use luxproof_scene::LuminaireModel;
use luxproof_simulator::{Accuracy, Limit, Prepared, REPLICATES, SolverKind, Stop};

use super::blocks::Blocks;
use super::settings::JobSettings;
use super::{
    Absent, Engine, EngineError, EngineRoot, Entry, Job, JobDir, Measurement, Setting, Support, Version, checked,
};
use luxproof_model::{EngineName, Estimate, Role, Uncertainty};
use luxproof_process::process;

pub struct Simulator;

const ID: EngineName = EngineName::SIMULATOR;

pub(super) static ENTRY: Entry = Entry {
    name: ID,
    display_name: "simulator",
    installs: &[],
    is_on_request: false,
    models: &[LuminaireModel::Point, LuminaireModel::Area, LuminaireModel::Impostor],
    fits_coordinates: None,
    make: || Box::new(Simulator),
};

const SETTINGS: &[Setting] = &[Setting { key: "relative_error", values: &["0.001", "0.1", "0.00001"] }];

/// The part of the budget's error that the simulator's bound or standard uncertainty may have: a test uncertainty ratio of 4 to 1
/// for bounds, about 2 to 1 for expanded uncertainties (ANSI/NCSL Z540.3, 5.3). Where that leaves a comparison undecided the
/// audit asks again, to a tenth.
const MARGIN: f64 = 0.25;

/// Seconds that a ray counts as. Rays are counted before they are cast, so that load changes nothing. Ordinary rooms take 1e-7 s a
/// ray (`docs/decisions/0001-sampled-solvers.md`).
const RAY_S: f64 = 2e-7;

/// Processor seconds of an ordinary room to this standard uncertainty, and the power by which finer ones take longer.
const SAMPLED_S: f64 = 1.0;
const SAMPLED_ERROR: f64 = 5e-3;
const SAMPLED_RATE: f64 = 1.5;

/// Standard uncertainties this much above what was asked for are reported: an error estimate is itself uncertain.
const NOTABLY_WIDE: f64 = 1.5;

fn relative_error(job: &Job) -> Result<f64, EngineError> {
    let asked = JobSettings::of(job, ID, SETTINGS)?.number("relative_error", 1e-12..=1.0)?;
    Ok(asked.unwrap_or(MARGIN * job.budget.relative_error))
}

/// Processor seconds of one core.
fn expected_s(job: &Job, kind: SolverKind, relative_error: f64) -> f64 {
    let (all, bodies, sensors) =
        (job.scene.luminaires.len() as f64, job.scene.obstacles.len() as f64, job.sensors.len() as f64);
    match kind {
        SolverKind::Direct => 2e-6 * sensors * all * (1.0 + bodies),
        SolverKind::Collocation => 0.1 * all.min(COLLOCATED),
        SolverKind::Sampled => SAMPLED_S * (SAMPLED_ERROR / relative_error).max(1.0).powf(SAMPLED_RATE),
    }
}

/// Luminaires from which on an empty room takes no longer, since their light is projected.
const COLLOCATED: f64 = 32.0;

impl Engine for Simulator {
    fn name(&self) -> EngineName {
        ID
    }

    fn role(&self) -> Role {
        Role::Reference
    }

    fn reads_meters_independently(&self) -> bool {
        true
    }

    fn probe(&self, _site: &EngineRoot) -> Result<Version, Absent> {
        Ok(Version::own())
    }

    fn supports(&self, _job: &Job) -> Support {
        Support::Yes
    }

    fn components(&self, _job: &Job) -> Vec<String> {
        [super::FILE_READER, super::OWN_LOOKUP].map(str::to_owned).to_vec()
    }

    fn samples(&self, job: &Job) -> bool {
        Prepared::is_sampled(&job.scene)
    }

    fn expected_s(&self, job: &Job) -> Option<f64> {
        let relative_error = relative_error(job).ok()?;
        Some(expected_s(job, Prepared::solver_kind(&job.scene, job.transport), relative_error))
    }

    fn settings(&self) -> &'static [Setting] {
        SETTINGS
    }

    fn check_settings(&self, job: &Job) -> Result<(), EngineError> {
        relative_error(job).map(drop)
    }

    /// An impostor is a way to sample an opening: to an exact solution it is the opening itself.
    fn cache_identity(&self, job: &Job) -> Job {
        let mut job = job.without_names();
        for luminaire in &mut job.scene.luminaires {
            if luminaire.model == LuminaireModel::Impostor {
                luminaire.model = LuminaireModel::Area;
            }
        }
        job
    }

    fn read(&self, job: &Job, workbench: &JobDir) -> Result<Measurement, EngineError> {
        let relative_error = relative_error(job)?;
        let meters: Vec<_> = job.sensors.iter().map(|s| s.meter).collect();
        let accuracy = Accuracy { relative_error, seed: job.seed };
        let stop = Stop {
            rays: Some((job.budget.seconds / RAY_S) as u64),
            flag: Some(process::interrupt_flag()),
            deadline: Some(workbench.until()),
        };
        let failed = |what: String| EngineError::Solver { engine: ID, what };
        // On its own threads only: other engines that run at the same time need the others.
        let threads = rayon::ThreadPoolBuilder::new().num_threads(workbench.jobs.max(1)).build();
        let solution = threads
            .map_err(|e| failed(e.to_string()))?
            .install(|| Prepared::new(&job.scene, job.transport, &accuracy)?.illuminance_until(&meters, &stop))
            .map_err(|e| failed(e.to_string()))?;
        let estimates: Vec<Estimate> = solution.estimates.iter().map(estimate).collect();
        let samples = blocks(&solution.replicates).into_iter().collect();
        let allowed = NOTABLY_WIDE * relative_error;
        let wide = estimates.iter().filter(|e| e.uncertainty.standard() > allowed * e.value.abs()).count();
        let limit = solution.limit.filter(|limit| wide > 0 || *limit == Limit::Time);
        let notes = limit.map(|limit| limit_note(limit, wide, estimates.len())).into_iter().collect();
        let cut_to =
            solution.limit.filter(|limit| *limit == Limit::Time).map(|_| share_of_samples(&estimates, relative_error));
        let method = [("solver", solution.solver)].into();
        let effort = [("relative_error", relative_error.to_string()), ("seed", job.seed.to_string())].into();
        checked(&ID, job, Measurement { estimates, method, effort, notes, samples, cut_to, ..Measurement::default() })
    }
}

/// The part of the required samples behind these estimates, by the worst of their errors: at most 1.
fn share_of_samples(estimates: &[Estimate], relative_error: f64) -> f64 {
    let shares = estimates.iter().filter(|e| e.uncertainty.standard() > 0.0);
    shares.map(|e| (relative_error * e.value / e.uncertainty.standard()).powi(2)).fold(1.0, f64::min)
}

/// What the simulator says of a limit that it met.
fn limit_note(limit: Limit, wide: usize, readings: usize) -> String {
    let what = match limit {
        Limit::Time => "time limit: another run may read otherwise",
        Limit::Rays => "ray limit",
    };
    format!("{what}; {wide} of {readings} readings are less certain than was asked for; give it more seconds")
}

/// The independent randomisations of what was sampled as blocks; `None` where nothing varies.
fn blocks(replicates: &[[f64; REPLICATES]]) -> Option<Blocks> {
    let varies = replicates.iter().any(|of_meter| of_meter.iter().any(|value| *value != of_meter[0]));
    let by_replicate = (0..REPLICATES).map(|r| replicates.iter().map(|of_meter| of_meter[r]).collect());
    varies.then(|| Blocks::new(by_replicate.collect()))
}

/// A value of the solver with its uncertainty, as readings write it.
fn estimate(found: &luxproof_simulator::Estimate) -> Estimate {
    let uncertainty = match found.uncertainty {
        luxproof_simulator::Uncertainty::Bound(bound) => Uncertainty::Bound(bound),
        luxproof_simulator::Uncertainty::StandardError { value, degrees_of_freedom } => {
            Uncertainty::sampled(value, Some(f64::from(degrees_of_freedom)))
        }
    };
    Estimate { value: found.illuminance.value(), uncertainty }
}
