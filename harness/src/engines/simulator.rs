//! The engine `simulator`: our own exact solutions, read like any renderer.

use std::collections::BTreeMap;
use std::time::Instant;

use luminaire::scene::{Bounces, LuminaireModel, Transport};
use luminaire::simulator::{self, Accuracy, Prepared, Stop, Way};

use super::settings::Given;
use super::{
    Absent, Budget, Engine, EngineError, Entry, Job, Knob, Measurement, Site, Support, Version, Workbench, checked,
};
use crate::record::{EngineName, Estimate, Role};
use crate::system::process;

pub(crate) struct Simulator;

const ID: EngineName = EngineName::SIMULATOR;

pub(super) static ENTRY: Entry = Entry {
    name: ID,
    display_name: "simulator",
    colour: ("#3d4148", "#d5d8dd"),
    installs: &[],
    is_on_request: false,
    models: &[LuminaireModel::Point, LuminaireModel::Area, LuminaireModel::Impostor],
    fits_coordinates: None,
    make: || Box::new(Simulator),
};

const KNOBS: &[Knob] = &[Knob { key: "relative_error", values: &["0.001", "0.1", "0.00001"] }];

/// How much finer than the budget's error the simulator works: a test uncertainty ratio of 4 to 1 (ANSI/NCSL Z540.3, 5.3).
/// Where that leaves a comparison undecided the audit asks again, to a tenth.
const MARGIN: f64 = 0.25;

/// Fewer numbers of groundwork are found again in no time.
const WORTH_KEEPING: usize = 10_000;

/// Seconds that a ray of the final gather is counted as, on one of two cores.
const RAY_S: f64 = 5e-7;

fn relative_error(job: &Job) -> Result<f64, EngineError> {
    let asked = Given::of(job, ID, KNOBS)?.number("relative_error", 1e-12..=1.0)?;
    Ok(asked.unwrap_or(MARGIN * job.budget.relative_error))
}

/// Processor seconds of one core: what solvers took in the mean of random rooms, by their logarithms (`benchmarks/planning.md`).
fn expected_s(job: &Job, way: Way) -> f64 {
    let luminaires = &job.scene.luminaires;
    let points = luminaires.iter().filter(|l| l.model == LuminaireModel::Point).count() as f64;
    let (all, bodies, stations) =
        (luminaires.len() as f64, job.scene.obstacles.len() as f64, job.stations.len() as f64);
    match way {
        Way::Direct => 2e-6 * stations * all * (1.0 + bodies),
        Way::Once => 1e-3 * stations * all * (1.0 + bodies),
        Way::Collocation => 0.1 * all.min(COLLOCATED),
        Way::Balance => 2.2 * (1.0 + points * bodies / MANY_SHADOWS).powf(0.7),
        Way::Rays => 5.0,
    }
}

/// Shadows of points from which on balance takes longer.
const MANY_SHADOWS: f64 = 50.0;
/// Luminaires from which on an empty room takes no longer, since their light is projected.
const COLLOCATED: f64 = 32.0;

impl Engine for Simulator {
    fn name(&self) -> EngineName {
        ID
    }

    fn role(&self) -> Role {
        Role::Witness
    }

    fn reads_meters_apart(&self) -> bool {
        true
    }

    fn probe(&self, _site: &Site) -> Result<Version, Absent> {
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
        let accuracy = Accuracy { relative_error: relative_error(job).ok()?, seed: job.seed };
        let way = Prepared::new(&job.scene, job.transport, &accuracy).ok()?.way();
        Some(expected_s(job, way))
    }

    fn knobs(&self) -> &'static [Knob] {
        KNOBS
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

    /// Light straight from luminaires on what reflects: the same however often it is reflected, and whatever chance does after it.
    fn groundwork(&self, job: &Job) -> Option<Job> {
        let reflects = job.reflections().is_some() && Prepared::is_sampled(&job.scene);
        let budget = Budget { relative_error: relative_error(job).ok()?, seconds: 0.0 };
        let (transport, settings) = (Transport::Indirect(Bounces::Converged), BTreeMap::new());
        reflects.then(|| Job { stations: vec![], seed: 0, transport, settings, budget, ..job.clone() })
    }

    fn read(&self, job: &Job, workbench: &Workbench) -> Result<Measurement, EngineError> {
        let relative_error = relative_error(job)?;
        let meters: Vec<_> = job.stations.iter().map(|s| s.meter).collect();
        let accuracy = Accuracy { relative_error, seed: job.seed };
        let begun = Instant::now();
        let stop = Stop {
            rays: Some((job.budget.seconds / RAY_S) as u64),
            flag: Some(process::interrupt_flag()),
            deadline: Some(workbench.until()),
        };
        let failed = |what: String| EngineError::Solver { engine: ID, what };
        // On its own threads and no more: what runs beside it counts on the others.
        let threads = rayon::ThreadPoolBuilder::new().num_threads(workbench.jobs.max(1)).build();
        let solution = threads
            .map_err(|e| failed(e.to_string()))?
            .install(|| {
                let mut prepared = Prepared::new(&job.scene, job.transport, &accuracy)?;
                if let Some(earlier) = &workbench.groundwork.earlier {
                    prepared.lay(earlier);
                }
                let solution = prepared.illuminance_until(&meters, &stop);
                *workbench.groundwork.laid.lock() =
                    prepared.groundwork().filter(|numbers| numbers.len() >= WORTH_KEEPING);
                solution
            })
            .map_err(|e| failed(e.to_string()))?;
        let method = [("solver", solution.solver)].into();
        let effort = [("relative_error", relative_error.to_string()), ("seed", job.seed.to_string())].into();
        let estimates: Vec<Estimate> = solution.estimates.iter().map(estimate).collect();
        // Light on surfaces has half of the time.
        let is_late = begun.elapsed() > workbench.patience / 2;
        let is_wide = |e: &Estimate| e.uncertainty.bound() > relative_error * e.value.abs();
        let late =
            "out of time: what is read has larger bounds than were asked for, and another run may read otherwise";
        let notes = (is_late && estimates.iter().any(is_wide)).then(|| late.to_owned()).into_iter().collect();
        checked(&ID, job, Measurement { estimates, method, effort, notes, ..Measurement::default() })
    }
}

fn estimate(found: &simulator::Estimate) -> Estimate {
    Estimate { value: found.illuminance.value(), uncertainty: found.uncertainty.into() }
}
