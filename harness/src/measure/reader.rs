//! Takes readings: out of the cache where they were taken before, else by the engine; the one seam between the two.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Arc, PoisonError};
use std::time::{Duration, Instant};

use crate::engines::{EngineError, Job, Measurement, Site, Workbench, checked, share};
use crate::measure::cache::{Answer, Cache, Entry, Key, Lookup, key};
use crate::plan::Planned;
use crate::spec::Budget;
use crate::system::process;

use super::Machine;

/// Takes readings for a run: everything that measures goes through [`Reader::read`].
///
/// A reading is a function of its job: the job's seed chooses the block of random numbers, its budget says how far to go.
/// Whoever wants more of an engine asks it for further jobs, each with a seed block and a slice of the budget of its own, and combines
/// the estimates. Each such job is one entry of the cache, so that a larger budget only adds jobs to those of a smaller one, and what was
/// read before is never rendered again.
#[derive(Clone, Debug)]
pub struct Reader {
    /// Where engines are installed.
    pub site: Site,
    /// The folder of the run's files.
    pub out: PathBuf,
    /// Where earlier readings are; `None`: every reading is taken anew, and none is kept.
    pub cache: Option<Cache>,
    /// How much of the machine an engine may have.
    pub machine: Arc<Machine>,
}

/// Readings that were taken.
#[derive(Clone, Debug, PartialEq)]
pub struct Taken {
    /// What the engine gave.
    pub measurement: Measurement,
    /// Wall-clock seconds that it took the engine, now or when it was asked first.
    pub wall_s: f64,
    /// Who gave it.
    pub source: Source,
}

/// Who gave a reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// The engine, just now.
    Engine,
    /// The cache or this run, from an earlier answer of the engine.
    Cache,
    /// Nobody had to be asked.
    Nobody,
}

impl Reader {
    /// The engine's answer to a job; scene files and logs go under `place`, the procedure's name or a folder below it.
    pub fn read(&self, planned: &Planned, job: &Job, place: &str) -> Result<Taken, EngineError> {
        let engine = planned.engine.name();
        if process::is_interrupted() {
            return Err(process::ProcessError::Interrupted { program: engine.as_str().to_owned() }.into());
        }
        let mut bench = self.workbench(engine.as_str(), job, place)?;
        let key = key_of(planned, job)?;
        // Whoever asks the same at the same time waits for this answer.
        let answered = key.as_ref().and_then(|key| self.machine.answered(key));
        let mut answered = answered.as_ref().map(|a| a.lock().unwrap_or_else(PoisonError::into_inner));
        let known = answered.as_ref().and_then(|a| (**a).clone());
        let kept = self.cache.as_ref().zip(key);
        if let Some(entry) = known.or_else(|| kept.as_ref().and_then(|(cache, key)| find(cache, key))) {
            bench.write(&planned.engine.export(job)?)?;
            self.note(&bench, &format!("read in {:.3} s for {} {}", entry.wall_s, entry.case, entry.procedure))?;
            tidy(&bench);
            if let Some(answered) = &mut answered {
                **answered = Some(entry.clone());
            }
            return taken(planned, job, entry);
        }
        // Its seconds count from when it has what it needs.
        let slots = &self.machine.slots;
        let held = slots.take(share(planned.engine.as_ref(), job, slots));
        bench.jobs = held.threads();
        let start = Instant::now();
        let answer = match planned.engine.read(job, &bench).and_then(|m| checked(&engine, job, m)) {
            Ok(measurement) => Answer::Read(measurement),
            Err(EngineError::Declined { why, .. }) => Answer::Declined(why),
            Err(error) => return Err(error),
        };
        let wall_s = start.elapsed().as_secs_f64();
        drop(held);
        tidy(&bench);
        let entry = Entry {
            engine: engine.clone(),
            version: planned.version().unwrap_or_default(),
            case: job.case.clone(),
            procedure: job.procedure.clone(),
            wall_s,
            answer,
        };
        if let Some((cache, key)) = &kept
            && let Err(error) = cache.keep(key, &entry)
        {
            tracing::warn!("{engine}: a reading could not be kept in {}: {error}", cache.path(key).display());
        }
        if let Some(answered) = &mut answered {
            **answered = Some(entry.clone());
        }
        match entry.answer {
            Answer::Read(measurement) => Ok(Taken { measurement, wall_s, source: Source::Engine }),
            Answer::Declined(why) => Err(EngineError::Declined { engine, why }),
        }
    }

    fn workbench(&self, engine: &str, job: &Job, place: &str) -> Result<Workbench, EngineError> {
        let log = absolute(&self.out.join("logs").join(format!("{engine}.{}.log", place.replace('/', "."))))?;
        fs::remove_file(&log).or_else(ignore_absence).map_err(|e| EngineError::io(&log, e))?;
        Ok(Workbench {
            site: self.site.clone(),
            scene_dir: fresh(&self.out.join("scenes").join(engine).join(place))?,
            log,
            jobs: 1,
            limit: limit(job.budget),
            peak: process::PeakMemory::default(),
        })
    }

    fn note(&self, bench: &Workbench, text: &str) -> Result<(), EngineError> {
        let fail = |e| EngineError::io(&bench.log, e);
        fs::create_dir_all(self.out.join("logs")).map_err(fail)?;
        fs::write(&bench.log, format!("not run: {text}\n")).map_err(fail)
    }
}

/// The key of a job; `None` where nothing asks for one.
fn key_of(planned: &Planned, job: &Job) -> Result<Option<Key>, EngineError> {
    match &planned.found {
        Some(Ok(version)) => key(planned.engine.as_ref(), version, job).map(Some),
        _ => Ok(None),
    }
}

fn find(cache: &Cache, key: &Key) -> Option<Entry> {
    match cache.find(key) {
        Lookup::Found(entry) => Some(entry),
        Lookup::Unknown => None,
        Lookup::Damaged(what) => {
            tracing::warn!("{}: the cache's {what}; the reading is taken anew", key.engine());
            None
        }
    }
}

/// An entry as the engine's own answer, held to what every answer is held to.
fn taken(planned: &Planned, job: &Job, entry: Entry) -> Result<Taken, EngineError> {
    let engine = planned.engine.name();
    match entry.answer {
        Answer::Read(measurement) => {
            let measurement = checked(&engine, job, measurement)?;
            Ok(Taken { measurement, wall_s: entry.wall_s, source: Source::Cache })
        }
        Answer::Declined(why) => Err(EngineError::Declined { engine, why }),
    }
}

/// Our own solvers write no scene: an empty folder would only puzzle.
fn tidy(bench: &Workbench) {
    fs::remove_dir(&bench.scene_dir).ok();
}

/// Far beyond the budget, which engines keep by themselves: this is for those that hang.
fn limit(budget: Budget) -> Duration {
    Duration::from_secs_f64((2.0 * budget.seconds + 120.0).min(1e9))
}

/// An empty folder, absolute, so that programs can run inside it.
fn fresh(folder: &Path) -> Result<PathBuf, EngineError> {
    let fail = |e| EngineError::io(folder, e);
    let folder = absolute(folder)?;
    let parent = folder.parent().unwrap_or(&folder).to_owned();
    fs::create_dir_all(&parent).map_err(fail)?;
    // What was there is moved away before it is deleted: the engine of a run that was killed may still write into it.
    let old = tempfile::Builder::new().prefix(".old-").tempdir_in(&parent).map_err(fail)?;
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

fn ignore_absence(error: std::io::Error) -> std::io::Result<()> {
    if error.kind() == std::io::ErrorKind::NotFound { Ok(()) } else { Err(error) }
}
