//! The reader takes every reading: out of the cache where it is there, else from the engine.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use super::cache::{Cache, Entry, Key, Lookup, is_worth_keeping};
use super::cache_miss::{CacheMissPolicy, RequestedReadings};
use super::machine::{Ground, Machine};
use super::outcome::{AnswerSource, Cost, CostedMeasurement, Failure};
use super::question::{Question, Trial};
use super::subprocess::{self, Isolation, Request};
use luxproof_engines::{
    Engine, EngineError, EngineRoot, Job, JobDir, Measurement, SharedPrecompute, Support, checked, hold, share,
};
use luxproof_model::{EngineName, FailureKind, ReadingKey};
use luxproof_process::files::{ignore_absence, remedy};
use luxproof_process::process::{self, PeakMemory, ProcessError};
use luxproof_process::slots::{Share, SlotGuard};

/// Takes readings: everything that measures goes through [`Reader::read`].
///
/// A reading is a function of its job: the seed chooses the block of random numbers, the budget says how far to go.
/// A caller that wants more of an engine requests further jobs, each with another seed and a slice of the budget, and
/// combines the estimates. Each such job is one entry of the cache. A larger budget thus only adds jobs to those of a
/// smaller one, and nothing is rendered twice.
#[derive(Clone, Debug)]
pub struct Reader {
    pub site: EngineRoot,
    /// The folder of scenes and logs; without one, they are deleted.
    pub out: Option<PathBuf>,
    /// The store of earlier readings; without one, engines take every reading again and nothing is stored.
    pub cache: Option<Cache>,
    pub machine: Arc<Machine>,
    pub isolation: Isolation,
    /// No engine starts after this; readings in the cache are still found.
    pub until: Option<Instant>,
    /// Who reads what the cache does not have.
    pub asking: CacheMissPolicy,
    /// Collects the readings that were requested.
    pub asked: RequestedReadings,
    /// Folders with results of the run or of earlier ones, which a program of the user's must not read.
    pub hidden: Arc<[PathBuf]>,
}

/// The key of a question, and the cache's entry under it.
type KeyedQuestion = Result<(Key, Option<Entry>), Failure>;

/// An answer and where it comes from.
struct FoundAnswer {
    entry: Entry,
    source: AnswerSource,
    is_new: bool,
    /// The key of the question without its meters, where the answer may become a part of other answers.
    key_without_meters: Option<Key>,
}

impl Reader {
    /// A reader that works in this process and stores neither readings nor files.
    pub fn bare(site: &EngineRoot, machine: Arc<Machine>) -> Self {
        let (isolation, asking, asked) =
            (Isolation::InProcess, CacheMissPolicy::AskEngine, RequestedReadings::default());
        Self {
            site: site.clone(),
            out: None,
            cache: None,
            machine,
            isolation,
            until: None,
            asking,
            asked,
            hidden: [].into(),
        }
    }

    /// Reads a job that no plan has checked: the engine may declare that it does not support the job.
    pub fn try_read(&self, question: &Question<'_>) -> Result<CostedMeasurement, Failure> {
        match question.instrument.engine.supports(question.job) {
            Support::No(why) => Err(Failure::new(FailureKind::Declined, why)),
            Support::Yes | Support::Approximate { .. } => self.read(question),
        }
    }

    /// Takes a reading, out of the cache or from the engine.
    pub fn read(&self, question: &Question<'_>) -> Result<CostedMeasurement, Failure> {
        self.read_under(&question.key()?, question, None)
    }

    /// Takes a reading by its key; `cached` is the cache's entry where the caller has already found it.
    fn read_under(
        &self,
        key: &Key,
        question: &Question<'_>,
        cached: Option<Entry>,
    ) -> Result<CostedMeasurement, Failure> {
        // Another thread with the same question waits for this answer.
        let answered = self.machine.answered(key);
        let mut answered = answered.as_ref().map(|a| a.lock());
        let known = answered.as_ref().and_then(|a| (**a).clone());
        let known = known.or(cached).or_else(|| self.find(key, question));
        let stays_open = known.is_none() && !self.asking.admits(key);
        self.note_request(key, question, !stays_open);
        let found = match known {
            Some(entry) => {
                self.write_scene_files(question, &entry)?;
                FoundAnswer { entry, source: AnswerSource::Cache, is_new: false, key_without_meters: None }
            }
            None if stays_open => return Err(Failure::new(FailureKind::Unread, "it has not been read yet")),
            None => self.take(key, question)?,
        };
        self.finish(key, question, found, answered.as_deref_mut())
    }

    /// Takes a new answer: from parts in the cache and the engine, or from the engine alone.
    fn take(&self, key: &Key, question: &Question<'_>) -> Result<FoundAnswer, Failure> {
        let key_without_meters = self.cache.as_ref().and_then(|_| question.key_without_meters());
        // Where processes share the work, each job is planned by its own key and must not depend on parts.
        let joinable = key_without_meters.as_ref().filter(|_| !self.asking.is_shared());
        let (entry, source) = match joinable.and_then(|parts_key| self.joined(question, key, parts_key)) {
            Some((entry, source)) => {
                self.write_scene_files(question, &entry)?;
                (entry, source)
            }
            None => (self.ask(question)?, AnswerSource::Engine),
        };
        Ok(FoundAnswer { entry, source, is_new: true, key_without_meters })
    }

    /// Records a request for a caller that distributes the readings.
    fn note_request(&self, key: &Key, question: &Question<'_>, is_read: bool) {
        if self.asking.is_shared() {
            self.asked.note(key, question, &self.machine.slots, is_read);
        }
    }

    /// Stores a new answer that is final, passes it to waiting threads and checks its measurement.
    fn finish(
        &self,
        key: &Key,
        question: &Question<'_>,
        found: FoundAnswer,
        answered: Option<&mut Option<Entry>>,
    ) -> Result<CostedMeasurement, Failure> {
        let FoundAnswer { entry, source, is_new, key_without_meters } = found;
        if is_new && process::is_interrupted() {
            // An interrupted answer has only a part of its samples and must not serve another run.
            self.note_request(key, question, false);
        } else if question.is_final(&entry) {
            if is_new {
                self.store(key, &entry);
                if let Some(parts_key) = key_without_meters.filter(|_| entry.answer.is_ok()) {
                    self.store_meter_list(key, &parts_key, question);
                }
            }
            if let Some(answered) = answered {
                *answered = Some(entry.clone());
            }
        } else if is_new
            && self.asking.keeps_failures()
            && entry.answer.as_ref().is_err_and(|failure| failure.kind.is_an_answer())
        {
            self.store(&key.of_failure(), &entry);
        }
        let measurement = checked(&entry.key.engine, question.job, entry.answer?)?;
        Ok(CostedMeasurement { measurement, cost: entry.cost, source })
    }

    /// Answers several questions to one engine, in their order; an engine that takes batches gets the new ones at once.
    pub fn read_all(&self, questions: &[Question<'_>]) -> Vec<Result<CostedMeasurement, Failure>> {
        let [first, _, ..] = questions else { return questions.iter().map(|q| self.read(q)).collect() };
        if !first.instrument.engine.takes_batches() {
            return questions.iter().map(|q| self.read(q)).collect();
        }
        let keyed: Vec<KeyedQuestion> = questions.iter().map(|q| self.look_up_question(q)).collect();
        // No other case requests these at the same time: the names in such jobs belong to this case.
        let new: Vec<_> =
            questions.iter().zip(&keyed).filter(|(_, keyed)| self.is_new(keyed)).map(|(q, _)| q).collect();
        let mut answers = self.ask_together(&new).into_iter();
        let mut taken = vec![];
        for (question, keyed) in questions.iter().zip(keyed) {
            let answer = if self.is_new(&keyed) { answers.next() } else { None };
            taken.push(self.finish_batched(question, keyed, answer));
        }
        taken
    }

    /// The key of a question, and the cache's entry under it.
    fn look_up_question(&self, question: &Question<'_>) -> KeyedQuestion {
        let key = question.key()?;
        let cached = self.find(&key, question);
        Ok((key, cached))
    }

    /// Whether the engine has to answer a question now.
    fn is_new(&self, keyed: &KeyedQuestion) -> bool {
        keyed.as_ref().is_ok_and(|(key, cached)| cached.is_none() && self.asking.admits(key))
    }

    /// Finishes one question of a batch, with the engine's answer where the batch had to ask for it.
    fn finish_batched(
        &self,
        question: &Question<'_>,
        keyed: KeyedQuestion,
        answer: Option<Result<Entry, Failure>>,
    ) -> Result<CostedMeasurement, Failure> {
        let (key, cached) = keyed?;
        let Some(entry) = answer else { return self.read_under(&key, question, cached) };
        self.note_request(&key, question, true);
        let answered = self.machine.answered(&key);
        let mut answered = answered.as_ref().map(|a| a.lock());
        let found = FoundAnswer { entry: entry?, source: AnswerSource::Engine, is_new: true, key_without_meters: None };
        self.finish(&key, question, found, answered.as_deref_mut())
    }

    /// Fails where the engine must not start: after an interruption, or when the time is over.
    fn check_may_start(&self, name: &EngineName) -> Result<(), Failure> {
        if process::is_interrupted() {
            return Err(EngineError::from(ProcessError::Interrupted { program: name.to_string() }).into());
        }
        if self.until.is_some_and(|until| Instant::now() >= until) {
            return Err(Failure::new(FailureKind::TimeUp, "no time was left for it"));
        }
        Ok(())
    }

    /// Asks one process all questions, which share its time evenly.
    fn ask_together(&self, questions: &[&Question<'_>]) -> Vec<Result<Entry, Failure>> {
        let [first, _, ..] = questions else { return questions.iter().map(|q| self.ask(q)).collect() };
        let engine = first.instrument.engine.as_ref();
        let (places, mut together) = match self.batch_places(first, questions) {
            Ok(places) => places,
            Err(failure) => return questions.iter().map(|_| Err(failure.clone())).collect(),
        };
        let shares = questions.iter().map(|q| share(engine, q.job, &self.machine.slots));
        let largest = shares
            .reduce(|a, b| Share { threads: a.threads.max(b.threads), memory_mib: a.memory_mib.max(b.memory_mib) });
        let held = largest.map(|share| self.machine.slots.take(share));
        together.bench.jobs = held.as_ref().map_or(1, SlotGuard::threads);
        let _running: Vec<_> = questions.iter().map(|question| self.machine.running.begin(question)).collect();
        let (clock, cpu) = (Instant::now(), process::cpu_time());
        let jobs: Vec<(&Job, &JobDir)> = questions.iter().zip(&places).map(|(q, p)| (q.job, &p.bench)).collect();
        let answers = engine.read_all(&jobs, &together.bench);
        let part = (questions.len() as f64).recip();
        let cost = Cost {
            wall_s: part * clock.elapsed().as_secs_f64(),
            cpu_s: part * process::cpu_time().saturating_sub(cpu).as_secs_f64(),
            peak_mib: together.bench.peak.mib(),
        };
        let answers: Vec<Result<Measurement, Failure>> = match answers {
            Ok(answers) => {
                answers.into_iter().map(|a| self.with_its_log(a.map_err(Failure::from), &together)).collect()
            }
            Err(error) => {
                let failure = self.with_its_log(Err(error.into()), &together);
                vec![failure; questions.len()]
            }
        };
        questions.iter().zip(answers).map(|(question, answer)| Ok(entry_of(question, cost, answer))).collect()
    }

    /// The places of a batch's questions, and that of the process for all of them.
    fn batch_places(
        &self,
        first: &Question<'_>,
        questions: &[&Question<'_>],
    ) -> Result<(Vec<WorkPlace>, WorkPlace), Failure> {
        self.check_may_start(&first.instrument.engine.name())?;
        let places = questions.iter().map(|q| self.place(q)).collect::<Result<Vec<_>, _>>()?;
        let limit = questions.iter().map(|q| q.limit).sum();
        let together = self.place(&Question { folder: BATCH_FOLDER, limit, ..*first })?;
        Ok((places, together))
    }

    /// Asks the engine one question, within the machine's slots.
    fn ask(&self, question: &Question<'_>) -> Result<Entry, Failure> {
        let Question { instrument, job, trial, .. } = *question;
        let engine = instrument.engine.as_ref();
        self.check_may_start(&engine.name())?;
        let mut place = self.place(question)?;
        let ground_key = question.precompute_key();
        let ground: Option<Arc<Ground>> = ground_key.as_ref().map(|key| self.machine.ground(key));
        // Other jobs that need the same precomputed data wait for it here, before they take a slot.
        let mut shared = ground.as_ref().map(|ground| ground.lock());
        let slots = &self.machine.slots;
        let (used, _held) = if let Some(Trial { threads, .. }) = trial {
            let share = Share { threads: *threads, memory_mib: engine.memory_mib(job, *threads) };
            (share, slots.take(share))
        } else {
            let share = share(engine, job, slots);
            (share, hold(engine, job, share, slots))
        };
        place.bench.jobs = used.threads.clamp(1, slots.threads());
        let of_run = shared.as_ref().and_then(|shared| (**shared).clone());
        place.bench.shared_precompute.earlier = of_run.or_else(|| self.cached_precompute(ground_key.as_ref()?));
        let _running = self.machine.running.begin(question);
        // The job's seconds count from here, when it has everything that it needs.
        let clock = Instant::now();
        let answer = match (&self.isolation, trial) {
            (Isolation::Subprocess(program), Some(trial)) if engine.is_reference_engine() => {
                subprocess::read(program, &Request::from_question(question, trial), &place.bench)
                    .map(|t| (t.measurement, t.cost))
            }
            _ => in_process(engine, job, &place.bench),
        };
        let computed = place.bench.shared_precompute.precomputed.lock().take().map(Arc::new);
        if let (Some(key), Some(numbers)) = (&ground_key, &computed) {
            self.store_precompute(key, numbers);
        }
        if let Some(shared) = &mut shared
            && let Some(numbers) = computed.or(place.bench.shared_precompute.earlier.take())
            && is_worth_keeping(&numbers)
        {
            **shared = Some(numbers);
        }
        let (answer, cost) = match answer {
            Ok((measurement, cost)) => (Ok(measurement), cost),
            Err(failure) => (
                self.with_its_log(Err(failure), &place),
                Cost { wall_s: clock.elapsed().as_secs_f64(), ..Cost::default() },
            ),
        };
        Ok(entry_of(question, cost, answer))
    }

    /// The cache's precomputed data of a scene.
    fn cached_precompute(&self, key: &Key) -> Option<Arc<Vec<f64>>> {
        self.cache.as_ref()?.shared_precompute(key).map(Arc::new)
    }

    /// Stores precomputed data of a scene, where there is a cache.
    fn store_precompute(&self, key: &Key, numbers: &[f64]) {
        if let Some(cache) = &self.cache
            && let Err(error) = cache.store_precompute(key, numbers)
        {
            tracing::debug!(%error, "precomputed data of the scene could not be stored, and will be computed again");
        }
    }

    /// The cache's entry of a key: a reading, or its failure where this process must not try again.
    fn find(&self, key: &Key, question: &Question<'_>) -> Option<Entry> {
        let entry = self.look_up(key).filter(|entry| self.may_serve(question, entry));
        if entry.is_some() || self.asking.admits(key) || !self.asking.is_shared() {
            return entry;
        }
        self.look_up(&key.of_failure())
    }

    /// Whether a cached entry may serve this run. One that the time limit cut may not: now the machine may have time.
    ///
    /// In a trial the limit is a part of the result, and processes that share the work cannot ask again.
    pub(super) fn may_serve(&self, question: &Question<'_>, entry: &Entry) -> bool {
        let is_cut = entry.answer.as_ref().is_ok_and(|measurement| measurement.cut_to.is_some());
        !is_cut || question.trial.is_some() || self.asking.is_shared()
    }

    /// The cache's entry under a key; warns of a damaged one.
    pub(super) fn look_up(&self, key: &Key) -> Option<Entry> {
        match self.cache.as_ref()?.find(key) {
            Lookup::Found(entry) => Some(*entry),
            Lookup::Unknown => None,
            Lookup::Damaged(what) => {
                let outcome =
                    if self.asking.admits(key) { "the reading is taken anew" } else { "it counts as not read" };
                tracing::warn!("{}: the cache's {what}; {outcome}", key.engine);
                None
            }
        }
    }

    /// Stores an entry; a cache that cannot be written costs a rendering, and no reading.
    fn store(&self, key: &Key, entry: &Entry) {
        if let Some(cache) = &self.cache
            && let Err(error) = cache.keep(key, entry)
        {
            let (engine, path, remedy) = (&entry.key.engine, cache.path(key), remedy(&error));
            tracing::warn!("{engine}: a reading could not be kept in {}: {error}{remedy}", path.display());
        }
    }

    /// Stores the meters of an answer, so that it can be a part of other answers.
    fn store_meter_list(&self, key: &Key, key_without_meters: &Key, question: &Question<'_>) {
        let Some(cache) = &self.cache else { return };
        self.machine.note_new(key);
        if let Err(error) = cache.list(key_without_meters, &question.job.sensors) {
            tracing::debug!(%error, "the meters of a reading could not be stored, so it is no part of other answers");
        }
    }

    /// Writes the scene files and a log of a reading that did not run, where the reader has a folder.
    fn write_scene_files(&self, question: &Question<'_>, entry: &Entry) -> Result<(), EngineError> {
        if self.out.is_none() {
            return Ok(());
        }
        let place = self.place(question)?;
        let bench = &place.bench;
        bench.write(&question.instrument.engine.export(question.job)?)?;
        let text =
            format!("not run: read in {:.3} s for {} {}\n", entry.cost.wall_s, entry.key.case, entry.key.procedure);
        let logs = bench.log.parent().map_or(Ok(()), fs::create_dir_all);
        logs.and_then(|()| fs::write(&bench.log, text)).map_err(|e| EngineError::io(&bench.log, e))
    }

    /// Copies a log that a failure names to the engines' folder, where the log's own folder is temporary.
    fn with_its_log(&self, answer: Result<Measurement, Failure>, place: &WorkPlace) -> Result<Measurement, Failure> {
        let mut failure = match answer {
            Err(failure) if self.out.is_none() => failure,
            other => return other,
        };
        let (log, folder) = (&place.bench.log, self.site.root().join("logs"));
        let named = log.display().to_string();
        if let Some(name) = log.file_name().filter(|_| failure.text.contains(&named)) {
            let copy = folder.join(name);
            let copied = fs::create_dir_all(&folder).and_then(|()| fs::copy(log, &copy));
            let now =
                copied.map_or_else(|_| "no log, which could not be kept".to_owned(), |_| copy.display().to_string());
            failure.text = failure.text.replace(&named, &now);
        }
        Err(failure)
    }

    /// The place where an engine answers a question: an empty scene folder, a log and limits.
    fn place(&self, question: &Question<'_>) -> Result<WorkPlace, EngineError> {
        let temporary = match &self.out {
            Some(_) => None,
            None => Some(tempfile::tempdir().map_err(|e| EngineError::io(&std::env::temp_dir(), e))?),
        };
        let out = self.out.as_deref().or(temporary.as_ref().map(tempfile::TempDir::path)).unwrap_or(Path::new("."));
        let (engine, folder) = (question.instrument.engine.name(), question.folder);
        let log = absolute(&out.join("logs").join(format!("{engine}.{}.log", folder.replace('/', "."))))?;
        fs::remove_file(&log).or_else(ignore_absence).map_err(|e| EngineError::io(&log, e))?;
        let bench = JobDir {
            site: self.site.clone(),
            scene_dir: empty_folder(&out.join("scenes").join(engine.as_str()).join(folder))?,
            log,
            jobs: 1,
            patience: question.patience,
            limit: question.limit,
            peak: PeakMemory::default(),
            shared_precompute: SharedPrecompute::default(),
            // A trial measures the time with the start of the process, so it must not reuse one.
            idle: question.trial.is_none().then(|| self.machine.idle.clone()),
            hidden: Arc::clone(&self.hidden),
        };
        Ok(WorkPlace { bench, _temporary: temporary })
    }
}

/// The cache entry of an answer.
pub(super) fn entry_of(question: &Question<'_>, cost: Cost, answer: Result<Measurement, Failure>) -> Entry {
    let Question { instrument, job, .. } = question;
    let key = ReadingKey::new(&job.case, job.procedure, instrument.engine.name());
    Entry { key, version: instrument.version.text.clone(), cost, answer }
}

/// Runs the engine from this process and measures its cost.
fn in_process(engine: &dyn Engine, job: &Job, bench: &JobDir) -> Result<(Measurement, Cost), Failure> {
    let (clock, cpu) = (Instant::now(), process::cpu_time());
    let measurement = checked(&engine.name(), job, engine.read(job, bench)?)?;
    let (wall, cpu) = (clock.elapsed(), process::cpu_time().saturating_sub(cpu));
    if bench.peak.mib().is_none() {
        bench.peak.look_at_self();
    }
    let cost = Cost { wall_s: wall.as_secs_f64(), cpu_s: cpu.as_secs_f64(), peak_mib: bench.peak.mib() };
    Ok((measurement, cost))
}

/// Where an engine answers a question; a temporary folder lives as long.
struct WorkPlace {
    bench: JobDir,
    _temporary: Option<tempfile::TempDir>,
}

impl Drop for WorkPlace {
    /// Removes the scene folder where it is empty: our own solvers write no scene files.
    fn drop(&mut self) {
        fs::remove_dir(&self.bench.scene_dir).ok();
    }
}

/// The folder of a process that answers several questions.
const BATCH_FOLDER: &str = "together";

/// The prefix of folders that are about to be deleted.
const OLD_PREFIX: &str = ".old-";

/// Deletes the folders that a killed run had begun to delete.
fn delete_old_folders(parent: &Path) {
    let entries = fs::read_dir(parent).into_iter().flatten().flatten();
    for old in entries.filter(|entry| entry.file_name().to_string_lossy().starts_with(OLD_PREFIX)) {
        fs::remove_dir_all(old.path()).ok();
    }
}

/// Makes an empty folder; its path is absolute, so that programs can run inside it.
fn empty_folder(folder: &Path) -> Result<PathBuf, EngineError> {
    let fail = |e| EngineError::io(folder, e);
    let folder = absolute(folder)?;
    let parent = folder.parent().unwrap_or(&folder).to_owned();
    fs::create_dir_all(&parent).map_err(fail)?;
    // The old folder is moved away before it is deleted: the engine of a killed run may still write into it.
    delete_old_folders(&parent);
    let old = tempfile::Builder::new().prefix(OLD_PREFIX).tempdir_in(&parent).map_err(fail)?;
    fs::rename(&folder, old.path().join("scene")).or_else(ignore_absence).map_err(fail)?;
    if let Err(error) = old.close() {
        tracing::debug!(%error, "a folder of an earlier run is still in use");
    }
    fs::create_dir_all(&folder).map_err(fail)?;
    Ok(folder)
}

/// The absolute form of a path.
fn absolute(path: &Path) -> Result<PathBuf, EngineError> {
    std::path::absolute(path).map_err(|e| EngineError::io(path, e))
}
