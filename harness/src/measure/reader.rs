//! Takes readings: out of the cache where they were taken before, else by the engine; the one seam between the two.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use super::asking::{Asked, Asking};
use super::cache::{Cache, Entry, Key, Lookup, is_worth_keeping};
use super::machine::Machine;
use super::outcome::{Cost, Failure, Source, Taken};
use super::question::{Question, Trial};
use super::subprocess::{self, Isolation, Request};
use crate::engines::{
    Engine, EngineError, Groundwork, Job, Measurement, Site, Support, Workbench, checked, hold, share,
};
use crate::record::{EngineName, FailureKind, ReadingKey};
use crate::system::files::{ignore_absence, remedy};
use crate::system::process::{self, PeakMemory, ProcessError};
use crate::system::slots::{Held, Share};

/// Takes readings: everything that measures goes through [`Reader::read`].
///
/// A reading is a function of its job: the job's seed chooses the block of random numbers, its budget says how far to go.
/// Whoever wants more of an engine asks it for further jobs, each with a seed block and a slice of the budget of its own, and combines
/// the estimates. Each such job is one entry of the cache, so that a larger budget only adds jobs to those of a smaller one, and what was
/// read before is never rendered again.
#[derive(Clone, Debug)]
pub struct Reader {
    pub site: Site,
    /// The folder that scenes and logs stay in; `None`: they are thrown away.
    pub out: Option<PathBuf>,
    /// Where earlier readings are; `None`: every reading is taken anew, and none is kept.
    pub cache: Option<Cache>,
    pub machine: Arc<Machine>,
    pub isolation: Isolation,
    /// No reading starts after this; what is in the cache is still found.
    pub until: Option<Instant>,
    /// Whom it asks for what the cache does not hold.
    pub asking: Asking,
    /// What it was asked for.
    pub asked: Asked,
}

/// Of a question its key, and what the cache holds under it.
type Keyed = Result<(Key, Option<Entry>), Failure>;

/// An answer, and how it was come by.
struct Found {
    entry: Entry,
    source: Source,
    is_new: bool,
    /// What names its question whatever the meters, where it may be a part of other answers.
    unlisted: Option<Key>,
}

impl Reader {
    /// One that reads in this process, and keeps neither readings nor files.
    pub fn bare(site: &Site, machine: Arc<Machine>) -> Self {
        let (isolation, asking, asked) = (Isolation::InProcess, Asking::Engines, Asked::default());
        Self { site: site.clone(), out: None, cache: None, machine, isolation, until: None, asking, asked }
    }

    /// What no plan has asked the engine about: it may say beforehand that it cannot.
    pub fn try_read(&self, question: &Question<'_>) -> Result<Taken, Failure> {
        match question.instrument.engine.supports(question.job) {
            Support::No(why) => Err(Failure::new(FailureKind::Declined, why)),
            Support::Yes | Support::Approximate { .. } => self.read(question),
        }
    }

    pub fn read(&self, question: &Question<'_>) -> Result<Taken, Failure> {
        self.read_under(&question.key()?, question, None)
    }

    /// `found` is what the cache is known to hold.
    fn read_under(&self, key: &Key, question: &Question<'_>, found: Option<Entry>) -> Result<Taken, Failure> {
        // Whoever asks the same at the same time waits for this answer.
        let answered = self.machine.answered(key);
        let mut answered = answered.as_ref().map(|a| a.lock());
        let known = answered.as_ref().and_then(|a| (**a).clone());
        let found = known.or(found).or_else(|| self.find(key));
        let is_open = found.is_none() && !self.asking.admits(key);
        self.note(key, question, !is_open);
        let found = match found {
            Some(entry) => {
                self.lay_out(question, &entry)?;
                Found { entry, source: Source::Cache, is_new: false, unlisted: None }
            }
            None if is_open => return Err(Failure::new(FailureKind::Unread, "nobody has read it yet")),
            None => {
                let unlisted = self.cache.as_ref().and_then(|_| question.key_without_meters());
                // What others plan or take by its key is theirs to read.
                let unshared = unlisted.as_ref().filter(|_| !self.asking.is_shared());
                let (entry, source) = match unshared.and_then(|unlisted| self.joined(question, key, unlisted)) {
                    Some((entry, source)) => {
                        self.lay_out(question, &entry)?;
                        (entry, source)
                    }
                    None => (self.ask(question)?, Source::Engine),
                };
                Found { entry, source, is_new: true, unlisted }
            }
        };
        self.settle(key, question, found, answered.as_deref_mut())
    }

    /// For whoever plans what others read.
    fn note(&self, key: &Key, question: &Question<'_>, is_read: bool) {
        if self.asking.is_shared() {
            self.asked.note(key, question, &self.machine.slots, is_read);
        }
    }

    /// Keeps what is final where it is found again, and takes the reading from it.
    fn settle(
        &self,
        key: &Key,
        question: &Question<'_>,
        Found { entry, source, is_new, unlisted }: Found,
        answered: Option<&mut Option<Entry>>,
    ) -> Result<Taken, Failure> {
        if is_new && process::is_interrupted() {
            // What nobody waited for is what was known by then, and no answer for another time.
            self.note(key, question, false);
        } else if question.is_final(&entry) {
            if is_new {
                self.keep(key, &entry);
                if let Some(unlisted) = unlisted.filter(|_| entry.answer.is_ok()) {
                    self.list(key, &unlisted, question);
                }
            }
            if let Some(answered) = answered {
                *answered = Some(entry.clone());
            }
        } else if is_new
            && self.asking.keeps_failures()
            && entry.answer.as_ref().is_err_and(|failure| failure.kind.is_an_answer())
        {
            self.keep(&key.of_failure(), &entry);
        }
        let measurement = checked(&entry.key.engine, question.job, entry.answer?)?;
        Ok(Taken { measurement, cost: entry.cost, source })
    }

    /// Several questions to one engine, which takes those that were never answered at once; one answer a question, in their order.
    pub fn read_all(&self, questions: &[Question<'_>]) -> Vec<Result<Taken, Failure>> {
        let [first, _, ..] = questions else { return questions.iter().map(|q| self.read(q)).collect() };
        if !first.instrument.engine.takes_batches() {
            return questions.iter().map(|q| self.read(q)).collect();
        }
        let keyed = |question: &Question<'_>| -> Keyed {
            let key = question.key()?;
            let found = self.find(&key);
            Ok((key, found))
        };
        let keyed: Vec<Keyed> = questions.iter().map(keyed).collect();
        // No other place asks for these, since their names are of their case alone.
        let is_to_ask = |key: &Key, found: &Option<Entry>| found.is_none() && self.asking.admits(key);
        let pairs = questions.iter().zip(&keyed);
        let together: Vec<_> = pairs
            .filter(|(_, keyed)| keyed.as_ref().is_ok_and(|(key, found)| is_to_ask(key, found)))
            .map(|(q, _)| q)
            .collect();
        let mut answers = self.ask_together(&together).into_iter();
        let of = |(question, keyed): (&Question<'_>, Keyed)| {
            let (key, found) = keyed?;
            match is_to_ask(&key, &found).then(|| answers.next()).flatten() {
                None => self.read_under(&key, question, found),
                Some(entry) => {
                    self.note(&key, question, true);
                    let answered = self.machine.answered(&key);
                    let mut answered = answered.as_ref().map(|a| a.lock());
                    let found = Found { entry: entry?, source: Source::Engine, is_new: true, unlisted: None };
                    self.settle(&key, question, found, answered.as_deref_mut())
                }
            }
        };
        questions.iter().zip(keyed).map(of).collect()
    }

    /// What keeps an engine from being asked now.
    fn hindrance(&self, name: &EngineName) -> Result<(), Failure> {
        if process::is_interrupted() {
            return Err(EngineError::from(ProcessError::Interrupted { program: name.to_string() }).into());
        }
        if self.until.is_some_and(|until| Instant::now() >= until) {
            return Err(Failure::new(FailureKind::TimeUp, "no time was left for it"));
        }
        Ok(())
    }

    /// One process for all questions, which share its time evenly; nothing where it cannot even be begun.
    fn ask_together(&self, questions: &[&Question<'_>]) -> Vec<Result<Entry, Failure>> {
        let [first, _, ..] = questions else { return questions.iter().map(|q| self.ask(q)).collect() };
        let engine = first.instrument.engine.as_ref();
        let prepared = || -> Result<_, Failure> {
            self.hindrance(&engine.name())?;
            let places = questions.iter().map(|q| self.place(q)).collect::<Result<Vec<_>, _>>()?;
            let limit = questions.iter().map(|q| q.limit).sum();
            let together = self.place(&Question { folder: TOGETHER, limit, ..**first })?;
            Ok((places, together))
        };
        let (places, mut together) = match prepared() {
            Ok(prepared) => prepared,
            Err(failure) => return questions.iter().map(|_| Err(failure.clone())).collect(),
        };
        let shares = questions.iter().map(|q| share(engine, q.job, &self.machine.slots));
        let most = shares
            .reduce(|a, b| Share { threads: a.threads.max(b.threads), memory_mib: a.memory_mib.max(b.memory_mib) });
        let held = most.map(|share| self.machine.slots.take(share));
        together.bench.jobs = held.as_ref().map_or(1, Held::threads);
        let (clock, cpu) = (Instant::now(), process::cpu_time());
        let jobs: Vec<(&Job, &Workbench)> = questions.iter().zip(&places).map(|(q, p)| (q.job, &p.bench)).collect();
        let answers = engine.read_all(&jobs, &together.bench);
        let part = (questions.len() as f64).recip();
        let cost = Cost {
            wall_s: part * clock.elapsed().as_secs_f64(),
            cpu_s: part * process::cpu_time().saturating_sub(cpu).as_secs_f64(),
            peak_mib: together.bench.peak.mib(),
        };
        let entry = |question: &Question<'_>, answer: Result<Measurement, Failure>| {
            let key = ReadingKey::new(&question.job.case, question.job.procedure, engine.name());
            Ok(Entry { key, version: question.instrument.version.text.clone(), cost, answer })
        };
        match answers {
            Ok(answers) => {
                let pairs = questions.iter().zip(answers);
                pairs.map(|(q, answer)| entry(q, self.with_its_log(answer.map_err(Failure::from), &together))).collect()
            }
            Err(error) => {
                let failure = self.with_its_log(Err(error.into()), &together);
                questions.iter().map(|q| entry(q, failure.clone())).collect()
            }
        }
    }

    fn ask(&self, question: &Question<'_>) -> Result<Entry, Failure> {
        let Question { instrument, job, trial, .. } = *question;
        let engine = instrument.engine.as_ref();
        let name = engine.name();
        self.hindrance(&name)?;
        let mut place = self.place(question)?;
        let ground = question.key_of_groundwork().map(|key| (self.machine.ground(&key), key));
        // Whoever needs the same waits until it is found, and holds nothing meanwhile.
        let mut found = ground.as_ref().map(|(found, _)| found.lock());
        let slots = &self.machine.slots;
        let (used, _held) = if let Some(Trial { threads, .. }) = trial {
            let share = Share { threads: *threads, memory_mib: engine.memory_mib(job, *threads) };
            (share, slots.take(share))
        } else {
            let share = share(engine, job, slots);
            (share, hold(engine, job, share, slots))
        };
        place.bench.jobs = used.threads.clamp(1, slots.threads());
        let kept = || Arc::new(self.cache.as_ref()?.groundwork(&ground.as_ref()?.1)?).into();
        place.bench.groundwork.earlier = found.as_ref().and_then(|found| (**found).clone()).or_else(kept);
        // Its seconds count from when it has what it needs.
        let clock = Instant::now();
        let answer = match (&self.isolation, trial) {
            (Isolation::Subprocess(program), Some(trial)) if engine.is_witness() => {
                subprocess::read(program, &Request::of(question, trial), &place.bench).map(|t| (t.measurement, t.cost))
            }
            _ => in_process(engine, job, &place.bench),
        };
        let laid = place.bench.groundwork.laid.lock().take().map(Arc::new);
        if let (Some(cache), Some((_, key)), Some(laid)) = (&self.cache, &ground, &laid)
            && let Err(error) = cache.keep_groundwork(key, laid)
        {
            tracing::debug!(%error, "what was found of the scene is not kept, and found again");
        }
        if let Some(found) = &mut found
            && let Some(known) = laid.or(place.bench.groundwork.earlier.take()).filter(|known| is_worth_keeping(known))
        {
            **found = Some(known);
        }
        let (answer, cost) = match answer {
            Ok((measurement, cost)) => (Ok(measurement), cost),
            Err(failure) => (
                self.with_its_log(Err(failure), &place),
                Cost { wall_s: clock.elapsed().as_secs_f64(), ..Cost::default() },
            ),
        };
        let key = ReadingKey::new(&job.case, job.procedure, name);
        Ok(Entry { key, version: instrument.version.text.clone(), cost, answer })
    }

    /// What the cache holds of a key: a reading, or how it failed where nobody is to try again here.
    fn find(&self, key: &Key) -> Option<Entry> {
        let is_left = self.asking.is_shared() && !self.asking.admits(key);
        let failed = || is_left.then(|| self.look_up(&key.of_failure())).flatten();
        self.look_up(key).or_else(failed)
    }

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

    fn keep(&self, key: &Key, entry: &Entry) {
        if let Some(cache) = &self.cache
            && let Err(error) = cache.keep(key, entry)
        {
            let (engine, path, remedy) = (&entry.key.engine, cache.path(key), remedy(&error));
            tracing::warn!("{engine}: a reading could not be kept in {}: {error}{remedy}", path.display());
        }
    }

    /// Lists what was kept, so that it can be a part of another answer.
    fn list(&self, key: &Key, unlisted: &Key, question: &Question<'_>) {
        let Some(cache) = &self.cache else { return };
        self.machine.note_new(key);
        if let Err(error) = cache.list(unlisted, &question.job.stations) {
            tracing::debug!(%error, "what is kept is not listed, and no part of other answers");
        }
    }

    /// The files of a reading that was not run, where files stay.
    fn lay_out(&self, question: &Question<'_>, entry: &Entry) -> Result<(), EngineError> {
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

    /// A log that a failure names, and that would go with the folder that it lies in, is kept among the engines.
    fn with_its_log(&self, answer: Result<Measurement, Failure>, place: &WorkPlace) -> Result<Measurement, Failure> {
        let mut failure = match answer {
            Err(failure) if self.out.is_none() => failure,
            other => return other,
        };
        let (log, folder) = (&place.bench.log, self.site.root().join("logs"));
        let named = log.display().to_string();
        if let Some(name) = log.file_name().filter(|_| failure.text.contains(&named)) {
            let kept = folder.join(name);
            let moved = fs::create_dir_all(&folder).and_then(|()| fs::copy(log, &kept));
            let now =
                moved.map_or_else(|_| "no log, which could not be kept".to_owned(), |_| kept.display().to_string());
            failure.text = failure.text.replace(&named, &now);
        }
        Err(failure)
    }

    fn place(&self, question: &Question<'_>) -> Result<WorkPlace, EngineError> {
        let temporary = match &self.out {
            Some(_) => None,
            None => Some(tempfile::tempdir().map_err(|e| EngineError::io(&std::env::temp_dir(), e))?),
        };
        let out = self.out.as_deref().or(temporary.as_ref().map(tempfile::TempDir::path)).unwrap_or(Path::new("."));
        let (engine, folder) = (question.instrument.engine.name(), question.folder);
        let log = absolute(&out.join("logs").join(format!("{engine}.{}.log", folder.replace('/', "."))))?;
        fs::remove_file(&log).or_else(ignore_absence).map_err(|e| EngineError::io(&log, e))?;
        let bench = Workbench {
            site: self.site.clone(),
            scene_dir: fresh(&out.join("scenes").join(engine.as_str()).join(folder))?,
            log,
            jobs: 1,
            patience: question.patience,
            limit: question.limit,
            peak: PeakMemory::default(),
            groundwork: Groundwork::default(),
            // What is timed is timed with its start.
            idle: question.trial.is_none().then(|| self.machine.idle.clone()),
        };
        Ok(WorkPlace { bench, _temporary: temporary })
    }
}

fn in_process(engine: &dyn Engine, job: &Job, bench: &Workbench) -> Result<(Measurement, Cost), Failure> {
    let (clock, cpu) = (Instant::now(), process::cpu_time());
    let measurement = checked(&engine.name(), job, engine.read(job, bench)?)?;
    let (wall, cpu) = (clock.elapsed(), process::cpu_time().saturating_sub(cpu));
    if bench.peak.mib().is_none() {
        bench.peak.look_at_self();
    }
    let cost = Cost { wall_s: wall.as_secs_f64(), cpu_s: cpu.as_secs_f64(), peak_mib: bench.peak.mib() };
    Ok((measurement, cost))
}

struct WorkPlace {
    bench: Workbench,
    _temporary: Option<tempfile::TempDir>,
}

impl Drop for WorkPlace {
    /// Our own solvers write no scene: an empty folder would only puzzle.
    fn drop(&mut self) {
        fs::remove_dir(&self.bench.scene_dir).ok();
    }
}

/// The folder of what an engine is asked at once.
const TOGETHER: &str = "together";

/// How the names of folders begin that are about to be deleted.
const OLD: &str = ".old-";

/// Deletes what runs that were killed had begun to delete.
fn sweep(folder: &Path) {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    for old in entries.filter(|entry| entry.file_name().to_string_lossy().starts_with(OLD)) {
        fs::remove_dir_all(old.path()).ok();
    }
}

/// An empty folder, absolute, so that programs can run inside it.
fn fresh(folder: &Path) -> Result<PathBuf, EngineError> {
    let fail = |e| EngineError::io(folder, e);
    let folder = absolute(folder)?;
    let parent = folder.parent().unwrap_or(&folder).to_owned();
    fs::create_dir_all(&parent).map_err(fail)?;
    // What was there is moved away before it is deleted: the engine of a run that was killed may still write into it.
    sweep(&parent);
    let old = tempfile::Builder::new().prefix(OLD).tempdir_in(&parent).map_err(fail)?;
    fs::rename(&folder, old.path().join("scene")).or_else(ignore_absence).map_err(fail)?;
    if let Err(error) = old.close() {
        tracing::debug!(%error, "what an earlier run left is still in use");
    }
    fs::create_dir_all(&folder).map_err(fail)?;
    Ok(folder)
}

fn absolute(path: &Path) -> Result<PathBuf, EngineError> {
    std::path::absolute(path).map_err(|e| EngineError::io(path, e))
}
