//! Asks an adapter: sends the probe, and requests for the readings of one job or several.

use std::fmt;
use std::path::{Path, PathBuf};
use std::time::Duration;

use super::photometry::Files;
use super::protocol::{Capability, ExternalProbe, ExternalRequest, PROTOCOL};
use super::readings::{ExternalAnswers, job_name};
use super::{External, ExternalJob, FOLDER_VARIABLE};
use crate::{EngineError, EngineRoot, Job, JobDir};
use luxproof_process::printable;
use luxproof_process::process::{Invocation, ProcessError};

/// A job with its files and the folder that they lie in.
pub(super) type JobWithFiles<'a> = (&'a Job, &'a Files, Option<&'a Path>);

/// What an adapter answered to its probe, or what is wrong with that answer.
#[derive(Clone, Debug, PartialEq)]
pub struct Introduction {
    command: String,
    answer: Result<ExternalProbe, String>,
}

/// Where a run leaves results in its folder.
const RESULTS: [&str; 4] = ["readings", "scenes", "logs", "report.json"];

impl Introduction {
    /// Returns whether it takes several jobs at once.
    pub fn can_batch(&self) -> bool {
        self.answer.as_ref().is_ok_and(|answer| answer.can(Capability::Batch))
    }

    /// Returns what is wrong with the answer, or `None`.
    pub fn fault(&self) -> Option<String> {
        match &self.answer {
            Ok(answer) => answer.unknown_words(),
            Err(why) => Some(why.clone()),
        }
    }
}

impl fmt::Display for Introduction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.answer {
            Ok(answer) => {
                write!(f, "{} {}, protocol {PROTOCOL} ({})", answer.name, answer.version, answer.words())
            }
            Err(_) => write!(f, "`{}`", self.command),
        }
    }
}

impl External {
    /// Probes the program for its examination.
    pub(crate) fn introduction(&self, site: &EngineRoot) -> Introduction {
        Introduction { command: self.command.join(" "), answer: self.probe_once(site).cloned() }
    }

    /// Returns the answer to the probe, or `None` before the first probe.
    pub(super) fn probe_answer(&self) -> Option<&ExternalProbe> {
        self.probe_answer.get()
    }

    /// Returns the answer to the probe, which is sent the first time only.
    pub(super) fn probe_once(&self, site: &EngineRoot) -> Result<&ExternalProbe, String> {
        if let Some(answer) = self.probe_answer.get() {
            return Ok(answer);
        }
        let answer = self.send_probe(site)?;
        if let Some(unknown) = answer.unknown_words() {
            tracing::warn!("{}: {unknown}", self.id);
        }
        Ok(self.probe_answer.get_or_init(|| answer))
    }

    fn send_probe(&self, site: &EngineRoot) -> Result<ExternalProbe, String> {
        let folder = tempfile::tempdir().map_err(|e| format!("no folder for its probe: {e}"))?;
        let request = ExternalRequest::Probe.to_json().map_err(|e| e.to_string())?;
        let limit = Duration::from_secs_f64(self.start_s);
        let run = self.invocation(site, request, limit, &folder.path().join("log"));
        let finished = run.and_then(|run| Ok(run.env(FOLDER_VARIABLE, folder.path()).run()?));
        let answer = finished.map_err(|error| without_log(&error)).and_then(|run| ExternalProbe::parse(&run.stdout));
        answer.map_err(|why| {
            format!(
                "no valid answer to the request `{{\"verb\": \"probe\"}}`: {}; luxproof speaks protocol {PROTOCOL} alone, see \
                 docs/adapter-protocol.md and `luxproof schema probe`",
                printable::lines(&why)
            )
        })
    }

    fn invocation(
        &self,
        site: &EngineRoot,
        stdin: Vec<u8>,
        limit: Duration,
        log: &Path,
    ) -> Result<Invocation, EngineError> {
        let program = self.program(site).ok_or_else(|| self.output(self.absence()))?;
        let run = Invocation::new(program, &self.folder, limit, log).of_user();
        Ok(run.args(&self.command[1..]).stdin(stdin))
    }

    /// The folders that it must not read. Of a folder that holds its own files these are the places where a run leaves results.
    fn hidden(&self, job_dir: &JobDir) -> Vec<PathBuf> {
        let own = self.folder.canonicalize().unwrap_or_else(|_| self.folder.clone());
        let mut hidden = vec![];
        for folder in &*job_dir.hidden {
            if own.starts_with(folder.canonicalize().unwrap_or_else(|_| folder.clone())) {
                hidden.extend(RESULTS.iter().map(|name| folder.join(name)));
            } else {
                hidden.push(folder.clone());
            }
        }
        hidden
    }

    /// Returns the text of a request for readings.
    pub(super) fn request(&self, jobs: &[JobWithFiles<'_>], threads: usize) -> Result<Vec<u8>, EngineError> {
        let forms = jobs.iter().enumerate().map(|(place, (job, files, folder))| {
            ExternalJob::for_request(job_name(job, place), job, files.forms(*folder))
        });
        let request = ExternalRequest::Read { jobs: forms.collect(), threads };
        request.to_json().map_err(|e| self.output(format!("the job is no JSON: {e}")))
    }

    /// Runs one process for all jobs. Returns one answer per job.
    pub(super) fn read_jobs(
        &self,
        jobs: &[(&Job, &JobDir)],
        together: &JobDir,
    ) -> Result<Vec<crate::Answer>, EngineError> {
        let files: Vec<Files> = jobs.iter().map(|(job, _)| Files::of(job)).collect();
        for (job, job_dir) in jobs {
            job_dir.write(&super::Engine::export(self, job)?)?;
            if job_dir.log != together.log {
                let log = &job_dir.log;
                let text = format!("asked with others at once: its messages are in {}\n", together.log.display());
                let folder = log.parent().map_or(Ok(()), std::fs::create_dir_all);
                folder.and_then(|()| std::fs::write(log, text)).map_err(|e| EngineError::io(log, e))?;
            }
        }
        let placed =
            jobs.iter().zip(&files).map(|((job, job_dir), files)| (*job, files, Some(job_dir.scene_dir.as_path())));
        let request = self.request(&placed.collect::<Vec<_>>(), together.jobs)?;
        let run = self.invocation(&together.site, request, together.limit, &together.log)?;
        // Its answers must be its own: it sees its scenes, and nothing else of the run.
        let own_scenes =
            jobs.iter().map(|(_, job_dir)| job_dir.scene_dir.clone()).chain([together.scene_dir.clone()]).collect();
        let run = run.of_user_without(self.hidden(together), own_scenes).env(FOLDER_VARIABLE, &together.scene_dir);
        let run = Invocation { peak: together.peak.clone(), ..run };
        let asked: Vec<&Job> = jobs.iter().map(|(job, _)| *job).collect();
        let mut answers = ExternalAnswers::measurements(&run.run()?.stdout, &asked, &self.id)?;
        for answer in &mut answers {
            let effort = match answer {
                Ok(measurement) => Some(&mut measurement.effort),
                Err(EngineError::AtMeters { rest, .. }) => Some(&mut rest.effort),
                Err(_) => None,
            };
            if let Some(effort) = effort {
                effort.insert("command".into(), run.command_line());
                if jobs.len() > 1 {
                    effort.insert("jobs_at_once".into(), jobs.len().to_string());
                }
            }
        }
        Ok(answers)
    }
}

/// Whether what failed with several jobs may do with one: neither what was stopped nor what used up the time of all.
pub(super) fn may_succeed_alone(error: &EngineError) -> bool {
    use ProcessError::{Interrupted, Start, TimedOut};
    !matches!(error, EngineError::Process(Interrupted { .. } | Start { .. } | TimedOut { .. }) | EngineError::Io { .. })
}

/// An error in words, without the log of a folder that is gone.
fn without_log(error: &EngineError) -> String {
    match error {
        EngineError::Process(ProcessError::Failed { end, tail, .. }) if tail.is_empty() => {
            format!("it ends with {end}")
        }
        EngineError::Process(ProcessError::Failed { end, tail, .. }) => format!("it ends with {end}: {tail}"),
        EngineError::Process(ProcessError::TimedOut { limit_s, .. }) => {
            format!("it takes longer than {limit_s:.0} s; `start_seconds` gives it more time")
        }
        other => other.to_string(),
    }
}
