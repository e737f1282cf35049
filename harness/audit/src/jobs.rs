//! Runs the jobs of a plan: one recording per run, written as soon as it is there, and no failure stops another engine.

use crate::plan::skip_of;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Add;
use std::path::Path;

use std::time::{Duration, Instant};

use super::observer::Observer;
use itertools::Itertools;
use parking_lot::Mutex;

use crate::measure::{AnswerSource, Cost, CostedMeasurement, Failure, Instrument, Question, Reader};
use crate::plan::{Plan, Planned, Run, SelectionReason};
use luxproof_engines::{CpuUse, EngineError, EngineRoot, Job, Measurement};
use luxproof_model::{
    EngineName, EngineStatus, FailureKind, ProcedureId, Reading, ReadingKey, Recording, StatedErrors, Status,
};
use luxproof_model::{Scope, Skip, SkipCause};
use luxproof_process::files::{self, FileError};
use luxproof_process::slots::side_by_side;
use luxproof_spec::{Case, SHORTEST_PATIENCE, content};

/// The largest number of sleeping jobs that run at a time, in addition to those that compute.
const MAX_SLEEPING_JOBS: usize = 8;

/// The run of one case, and what it needs.
pub struct Running<'a> {
    pub case: &'a Case,
    pub plan: &'a Plan,
    /// The folder of the case's files, which the reader shares; without one, only the cache stays.
    pub folder: Option<&'a Path>,
    /// Takes the readings; concurrent cases share its machine.
    pub reader: Reader,
    pub observer: &'a dyn Observer,
}

/// The findings on the errors that an engine states in a procedure.
pub(super) type ErrorFindings = BTreeMap<(EngineName, ProcedureId), Vec<StatedErrors>>;

/// The results of a case.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// One recording per run of the plan, failures included, in the plan's order.
    pub recordings: Vec<Recording>,
    /// One status per engine of the plan, in its order.
    pub engines: Vec<EngineStatus>,
    /// Runs that an engine declined after it had read the job.
    pub skips: Vec<Skip>,
    /// Where a spot check contradicted a shortcut, so that the engine rendered every sensor.
    pub contradicted: BTreeSet<(EngineName, ProcedureId)>,
    /// How many answers of engines came out of the cache.
    pub from_cache: usize,
}

/// The result of one run.
enum RunResult {
    Recorded { recording: Box<Recording>, source: Option<AnswerSource>, was_contradicted: bool },
    Declined(Skip),
}

impl Running<'_> {
    /// Runs every job of the plan, concurrently as far as the machine has room; the results are in the plan's order.
    pub fn run(&self) -> Result<Outcome, FileError> {
        let slots = self.reader.machine.slots.threads();
        // Jobs that mostly sleep leave their slot to others, so a few more run at a time.
        let sleeping = self.count_runs(CpuUse::Idle).min(MAX_SLEEPING_JOBS)
            + self.count_runs(CpuUse::Partial).div_ceil(2).min(slots);
        let recorded: Mutex<BTreeMap<usize, Recording>> = Mutex::default();
        let mut all = vec![];
        for results in side_by_side(slots + sleeping, &self.batches(), |places| self.run_batch(places, &recorded)) {
            all.extend(results?);
        }
        all.sort_by_key(|(place, _)| *place);
        let (mut recordings, mut skips, mut from_cache, mut contradicted) = (vec![], vec![], 0, BTreeSet::new());
        for (_, result) in all {
            match result {
                RunResult::Recorded { recording, source, was_contradicted } => {
                    from_cache += usize::from(source == Some(AnswerSource::Cache));
                    let ReadingKey { engine, procedure, .. } = &recording.key;
                    contradicted.extend(was_contradicted.then(|| (engine.clone(), *procedure)));
                    recordings.push(*recording);
                }
                RunResult::Declined(skip) => skips.push(skip),
            }
        }
        let engines =
            self.plan.engines.iter().map(|planned| status(planned, &recordings, Some(&self.reader.site))).collect();
        Ok(Outcome { recordings, engines, skips, contradicted, from_cache })
    }

    /// Measures the runs at these places of the plan; `recorded` collects the recordings of all batches by place.
    fn run_batch(
        &self,
        places: &[usize],
        recorded: &Mutex<BTreeMap<usize, Recording>>,
    ) -> Result<Vec<(usize, RunResult)>, FileError> {
        let runs: Vec<&Run> = places.iter().map(|k| &self.plan.runs[*k]).collect();
        let results: Vec<(usize, RunResult)> = places.iter().copied().zip(self.measure(&runs)).collect();
        for (k, result) in &results {
            let RunResult::Recorded { recording, .. } = result else { continue };
            let mut recorded = recorded.lock();
            recorded.insert(*k, (**recording).clone());
            // Written as each job finishes, so that an interruption loses only unfinished jobs.
            self.keep(&recording.key.engine, recorded.values())?;
        }
        Ok(results)
    }

    /// Writes the file of an engine's readings, chosen from all recordings, where the run has a folder.
    pub(super) fn keep<'r>(
        &self,
        engine: &EngineName,
        all: impl IntoIterator<Item = &'r Recording>,
    ) -> Result<(), FileError> {
        let Some(folder) = self.folder else { return Ok(()) };
        let mine: Vec<&Recording> = all.into_iter().filter(|r| r.key.engine == *engine).collect();
        files::keep_json(&folder.join("readings").join(format!("{engine}.json")), &mine)
    }

    /// How much of its time the engine of a run sleeps.
    fn cpu_use(&self, run: &Run) -> CpuUse {
        self.plan.engines[run.engine].engine.cpu_use(&run.job)
    }

    /// The number of runs on engines that sleep that much.
    fn count_runs(&self, waits: CpuUse) -> usize {
        self.plan.runs.iter().filter(|run| self.cpu_use(run) == waits).count()
    }

    /// The places of the plan's runs in the order in which they start: one each, or all of an engine that takes
    /// batches.
    fn batches(&self) -> Vec<Vec<usize>> {
        let mut batches: Vec<Vec<usize>> = vec![];
        for (k, run) in self.plan.runs.iter().enumerate() {
            let takes_batches = self.plan.engines[run.engine].engine.takes_batches();
            let same_engine = batches.iter_mut().find(|batch| self.plan.runs[batch[0]].engine == run.engine);
            match same_engine.filter(|_| takes_batches) {
                Some(batch) => batch.push(k),
                None => batches.push(vec![k]),
            }
        }
        batches.sort_by_key(|batch| self.cpu_use(&self.plan.runs[batch[0]]));
        batches
    }

    /// The engine and the procedure of a run.
    fn engine_and_procedure(&self, run: &Run) -> (&Planned, ProcedureId) {
        (&self.plan.engines[run.engine], self.plan.tasks[run.task].procedure)
    }

    /// Measures runs of one engine: the only place where answers of engines become recordings.
    fn measure(&self, runs: &[&Run]) -> Vec<RunResult> {
        let start = Instant::now();
        let answers = match runs {
            [run] => {
                let (planned, procedure) = self.engine_and_procedure(run);
                vec![answer(planned, run, &self.reader, procedure.name())]
            }
            _ => self.answer_batch(runs),
        };
        runs.iter().zip(answers).map(|(run, answer)| self.run_result(run, answer, start)).collect()
    }

    /// The answers of an engine that takes several jobs at once, without shortcuts.
    fn answer_batch(&self, runs: &[&Run]) -> Vec<Result<Answer, Failure>> {
        let Some(instrument) = runs.first().and_then(|run| self.plan.engines[run.engine].instrument()) else {
            return vec![];
        };
        let questions = runs.iter().map(|run| {
            let (_, procedure) = self.engine_and_procedure(run);
            Question::new(&instrument, &run.job, procedure.name())
        });
        let taken = self.reader.read_all(&questions.collect::<Vec<_>>()).into_iter();
        taken.map(|taken| taken.map(|taken| Answer { taken, was_contradicted: false })).collect()
    }

    /// Makes a result of an answer and reports the end of the run to the observer.
    fn run_result(&self, run: &Run, answer: Result<Answer, Failure>, start: Instant) -> RunResult {
        let (planned, task) = (&self.plan.engines[run.engine], &self.plan.tasks[run.task]);
        let engine = planned.engine.as_ref();
        let (taken, was_contradicted) = match answer {
            Ok(Answer { taken, was_contradicted }) => (Ok(taken), was_contradicted),
            Err(failure) => (Err(failure), false),
        };
        if let Err(Failure { kind: FailureKind::Declined, text: why, .. }) = &taken {
            self.observer.ended(self.case, engine, task.procedure, start.elapsed(), None);
            let reason = format!("it declines: {why}");
            let skip = skip_of(self.case, task, engine.name(), Scope::Procedure, reason);
            return RunResult::Declined(skip.because(SkipCause::Unsupported));
        }
        let source = taken.as_ref().ok().map(|taken| taken.source);
        let recording = self.record(run, taken, start.elapsed());
        let wall = Duration::try_from_secs_f64(recording.wall_s).unwrap_or_default();
        self.observer.ended(self.case, engine, task.procedure, wall, recording.failure.as_deref());
        RunResult::Recorded { recording: Box::new(recording), source, was_contradicted }
    }

    /// The recording of a measurement or of a failure.
    fn record(&self, run: &Run, taken: Result<CostedMeasurement, Failure>, wall: Duration) -> Recording {
        let (planned, task) = (&self.plan.engines[run.engine], &self.plan.tasks[run.task]);
        let engine = planned.engine.name();
        let failure_kind = taken.as_ref().err().map(|failure| failure.kind);
        let (measurement, wall_s, failure) = match taken {
            Ok(taken) => (taken.measurement, taken.cost.wall_s, None),
            Err(error) => {
                if error.kind != FailureKind::Unread {
                    tracing::error!(%engine, procedure = %task.procedure, "{error}");
                }
                (error.rest.map_or_else(Measurement::default, |rest| *rest), wall.as_secs_f64(), Some(error.text))
            }
        };
        let was_read = failure.is_none() || !measurement.estimates.is_empty();
        let estimates = if was_read { measurement.readings(&task.targets) } else { vec![] };
        let readings = estimates.into_iter().zip(measurement.quadratures(&task.targets)).zip(&task.targets);
        let readings = readings.map(|((estimate, quadrature), target)| Reading {
            quadrature,
            ..Reading::new(target.id.clone(), task.quantity, estimate)
        });
        // A failed engine may have lost single meters only: the others have values.
        let readings = readings.filter(|reading| failure.is_none() || reading.value.is_finite());
        Recording {
            version: planned.version().unwrap_or_default(),
            model: task.model(),
            input_sha256: self.case.sha256.clone(),
            content_sha256: content(task),
            seed: run.job.seed,
            skewness: measurement.skewness(),
            design_effect: measurement.design_effect(),
            correlations: if was_read { measurement.correlations(&task.targets) } else { BTreeMap::new() },
            work_s: measurement.work_s,
            cut_to: measurement.cut_to,
            method: measurement.method,
            effort: measurement.effort,
            role: planned.engine.role(),
            reads_files: planned.engine.reads_files(&run.job),
            approximation: run.approximation.clone(),
            declared_error: Some(run.declared).filter(|error| *error > 0.0),
            notes: measurement.notes,
            wall_s,
            components: planned.engine.components(&run.job),
            command: planned.engine.command_by_hand(&run.job, &self.reader.site),
            readings: readings.collect(),
            failure,
            failure_kind,
            ..Recording::of(ReadingKey::new(&self.case.name, task.procedure, engine), task.light())
        }
    }
}

/// An engine's answer to a run.
struct Answer {
    taken: CostedMeasurement,
    /// Whether the spot check contradicted the shortcut.
    was_contradicted: bool,
}

/// An engine's answer to a run: it renders what the shortcut leaves, and the other readings follow.
///
/// Where the spot check contradicts those, the engine renders every sensor.
fn answer(planned: &Planned, run: &Run, reader: &Reader, folder: &str) -> Result<Answer, Failure> {
    let instrument = planned
        .instrument()
        .ok_or_else(|| EngineError::Solver { engine: planned.engine.name(), what: "it is not there".to_owned() })?;
    let spot_check_folder = format!("{folder}-spot-check");
    let [patience, spot_check_patience] = run.patience();
    let rendered = if run.shortcut.job.sensors.is_empty() {
        CostedMeasurement { measurement: Measurement::default(), cost: Cost::default(), source: AnswerSource::Shortcut }
    } else {
        let question = Question { may_join: true, patience, ..Question::new(&instrument, &run.shortcut.job, folder) };
        let read = reader.read(&question);
        if let (Err(Failure { kind: FailureKind::Unread, .. }), Some(job)) = (&read, run.spot_check_job()) {
            // Requests the spot check as well, so that another process can take both at the same time.
            reader.read(&Question::new(&instrument, &job, &spot_check_folder)).ok();
        }
        read.map_err(|failure| failure.with_rest(|rest| Some(run.shortcut.complete(rest, &run.job))))?
    };
    let mut taken =
        CostedMeasurement { measurement: run.shortcut.complete(rendered.measurement, &run.job), ..rendered };
    if let Some(job) = run.spot_check_job() {
        let question = Question::new(&instrument, &job, &spot_check_folder);
        let spot_check = reader.read(&Question { patience: spot_check_patience, ..question });
        let spot_check = spot_check.map_err(|failure| failure.with_rest(|_| None))?;
        if let Err(contradiction) = run.hold(&taken.measurement, &spot_check.measurement) {
            tracing::warn!("{}: {contradiction}", planned.engine.name());
            let spent_s = taken.cost.wall_s + spot_check.cost.wall_s;
            let taken = render_everything(reader, run, &instrument, folder, spent_s, contradiction)?;
            return Ok(Answer { taken, was_contradicted: true });
        }
        add_spot_check(&mut taken, run, &job, spot_check);
    }
    Ok(Answer { taken, was_contradicted: false })
}

/// Renders every sensor of a run whose spot check contradicted the shortcut, in the time that is left.
fn render_everything(
    reader: &Reader,
    run: &Run,
    instrument: &Instrument,
    folder: &str,
    spent_s: f64,
    contradiction: String,
) -> Result<CostedMeasurement, Failure> {
    let question = Question::new(instrument, &run.job, folder);
    let patience = question.patience.saturating_sub(Duration::try_from_secs_f64(spent_s).unwrap_or_default());
    let mut taken = reader.read(&Question { patience: patience.max(SHORTEST_PATIENCE), ..question })?;
    taken.cost.wall_s += spent_s;
    taken.measurement.notes.push(contradiction);
    Ok(taken)
}

/// Puts the readings of a spot check in place of those that the shortcut filled in, and adds its cost and notes.
fn add_spot_check(taken: &mut CostedMeasurement, run: &Run, job: &Job, spot_check: CostedMeasurement) {
    taken.cost.wall_s += spot_check.cost.wall_s;
    let work_s = [taken.measurement.work_s, spot_check.measurement.work_s];
    taken.measurement.work_s = work_s.into_iter().flatten().reduce(f64::add);
    let cut_to = [taken.measurement.cut_to, spot_check.measurement.cut_to];
    taken.measurement.cut_to = cut_to.into_iter().flatten().reduce(f64::min);
    // The rendered samples say nothing about how the sensors of the spot check, another job, vary with them.
    taken.measurement.drop_samples();
    for (&sensor, estimate) in run.spot_check.iter().zip(spot_check.measurement.estimates) {
        taken.measurement.estimates[sensor] = estimate;
    }
    let names = job.sensors.iter().map(|s| s.id.to_string()).join(", ");
    let Measurement { notes, effort, .. } = &mut taken.measurement;
    let new_notes: Vec<String> =
        spot_check.measurement.notes.into_iter().filter(|note| !notes.contains(note)).collect();
    notes.extend(new_notes.iter().map(|note| format!("spot check of {names}: {note}")));
    let checked = spot_check.measurement.effort.iter();
    effort.extend(checked.map(|(key, value)| (format!("spot_check_{key}"), value.clone())));
    effort.insert("spot_checked".to_owned(), names);
    if taken.source == AnswerSource::Shortcut {
        taken.source = spot_check.source;
    }
}

/// The outcome of a case that does not run: a skip for every run of its plan, and engines with the given status.
pub fn not_run(case: &Case, plan: &Plan, status: Status, reason: &str) -> Outcome {
    let mut engines: Vec<EngineStatus> = plan.engines.iter().map(|planned| self::status(planned, &[], None)).collect();
    let mut skips = vec![];
    for run in &plan.runs {
        engines[run.engine].status = status;
        engines[run.engine].reason = Some(reason.to_owned());
        let (task, engine) = (&plan.tasks[run.task], plan.engines[run.engine].engine.name());
        skips.push(skip_of(case, task, engine, Scope::Procedure, reason).saving("the whole run"));
    }
    Outcome { recordings: vec![], engines, skips, contradicted: BTreeSet::new(), from_cache: 0 }
}

/// The status of an engine after its recordings.
fn status(planned: &Planned, recordings: &[Recording], site: Option<&EngineRoot>) -> EngineStatus {
    let id = planned.engine.name();
    let mine: Vec<&Recording> = recordings.iter().filter(|r| r.key.engine == id.as_str()).collect();
    let failures: Vec<&str> = mine.iter().filter_map(|r| r.failure.as_deref()).collect();
    let (status, reason) = match &planned.found {
        Some(Err(absent)) => (Status::Absent, Some(absent.to_string())),
        Some(Ok(_)) if !failures.is_empty() => (Status::Failed, Some(failures.join("; "))),
        None => (Status::Skipped, Some("it supports nothing that was asked: not started".to_owned())),
        Some(Ok(_)) if mine.is_empty() => (Status::Skipped, Some("it declined all that was asked".to_owned())),
        Some(Ok(_)) => (Status::Ran, None),
    };
    let wall_s = mine.iter().map(|r| r.wall_s).sum();
    let is_required = planned.asked == SelectionReason::ByName;
    let fingerprint = planned.instrument().map(|i| i.version.fingerprint);
    let role = planned.engine.role();
    let mark = luxproof_engines::ALL.iter().position(|entry| entry.name == id);
    let version = planned.version();
    let release = site.filter(|_| version.is_some()).and_then(|site| luxproof_engines::installed_release(&id, site));
    let release = release.map(|release| release.to_string());
    let package = site.filter(|_| version.is_some()).and_then(|site| luxproof_engines::installed_package(&id, site));
    EngineStatus { id, version, release, package, role, fingerprint, status, is_required, reason, wall_s, mark }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use luxproof_scene::Transport;

    use super::*;
    use crate::measure::Machine;
    use crate::plan::{Fill, Shortcut};
    use luxproof_engines::fixtures::{Fake, s1};
    use luxproof_engines::{Job, Version};
    use luxproof_model::{Estimate, Uncertainty};

    /// What an engine reads at a job: `slope` lx more per meter along x, with a note where it reads `m[2]` alone.
    fn read_slope(job: &Job, slope: f64) -> Measurement {
        let values = job.sensors.iter().map(|s| 1.0 + slope * s.meter.position_m.x);
        let is_cut = job.sensors.len() == 1 && job.sensors[0].id.to_string() == "m[2]";
        Measurement {
            estimates: values.map(|value| Estimate { value, uncertainty: Uncertainty::Bound(1e-9) }).collect(),
            work_s: Some(job.sensors.len() as f64),
            effort: [("blocks", if is_cut { "4" } else { "8" })].into(),
            notes: is_cut.then(|| "cut short".to_owned()).into_iter().collect(),
            ..Measurement::default()
        }
    }

    /// The answer of such an engine under a shortcut by which all meters read the same.
    fn answer_with_slope(slope: f64) -> Measurement {
        let job = s1(Transport::Direct);
        let mut shortcut = Shortcut::none(&job);
        shortcut.job.sensors.truncate(1);
        for fill in &mut shortcut.fill[1..] {
            *fill = Fill::Mirrors { sensor: 0, by: "a false claim".into() };
        }
        let run = Run { engine: 0, task: 0, job, approximation: None, declared: 0.0, shortcut, spot_check: vec![2] };
        let found = Some(Ok(Version::without_fingerprint("1")));
        let engine = Arc::new(Fake::new("fake", move |job: &Job| Ok(read_slope(job, slope))));
        let planned = Planned { engine, found, asked: SelectionReason::ByName };
        let folder = tempfile::tempdir().unwrap();
        let reader = Reader::bare(&EngineRoot::at(folder.path()), Machine::new(1));
        answer(&planned, &run, &reader, "direct_illuminance").unwrap().taken.measurement
    }

    fn values(measurement: &Measurement) -> Vec<f64> {
        measurement.estimates.iter().map(|e| e.value).collect()
    }

    #[test]
    fn what_a_spot_check_contradicts_is_rendered_whole_and_says_so() {
        let right = answer_with_slope(0.0);
        assert_eq!((values(&right), right.notes), (vec![1.0; 4], vec!["spot check of m[2]: cut short".to_owned()]));
        let effort = ["spot_checked", "blocks", "spot_check_blocks"].map(|key| right.effort[key].as_str());
        assert_eq!(effort, ["m[2]", "8", "4"]);
        // The work of the rendered sensor and of the spot check.
        assert_eq!(right.work_s, Some(2.0));
        let lopsided = answer_with_slope(0.5);
        assert_eq!(values(&lopsided), [2.0, 2.0, 6.0, 6.0]);
        let [note] = &lopsided.notes[..] else { panic!("{:?}", lopsided.notes) };
        assert!(
            note.contains("m[2] reads 6 lx where 2 lx follow") && note.contains("everything was rendered"),
            "{note}"
        );
        assert!(!lopsided.effort.contains_key("mirrored_meters"), "{:?}", lopsided.effort);
        assert_eq!(lopsided.work_s, Some(4.0));
    }
}
