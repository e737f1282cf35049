//! How an adapter is asked: for what it is, and for readings of one job or of several at once.

use std::fmt;
use std::path::Path;
use std::time::Duration;

use super::json::{Protocol, chatter, from_json};
use super::photometry::Files;
use super::protocol::{Answer, Capability, ExternalProbe, ExternalRequest};
use super::readings::{ExternalAnswers, ExternalReadings};
use super::{External, ExternalJob, FOLDER_VARIABLE};
use crate::engines::{self, EngineError, Job, Site, Workbench};
use crate::system::printable;
use crate::system::process::{Finished, Invocation, ProcessError};

/// What does not say that it knows the question is not waited for as long as what does.
const UNSURE_S: f64 = 30.0;

/// A job with its files and the folder that they lie in.
pub(super) type Asked<'a> = (&'a Job, &'a Files, Option<&'a Path>);

/// What a program says of itself, and what is wrong with that.
#[derive(Clone, Debug, PartialEq)]
pub struct Introduction {
    command: String,
    said: Said,
}

#[derive(Clone, Debug, PartialEq)]
enum Said {
    Two(ExternalProbe),
    /// Why it counts as version 1.
    One(String),
    Wrong(String),
}

impl Introduction {
    pub fn can_batch(&self) -> bool {
        matches!(&self.said, Said::Two(said) if said.can(Capability::Batch))
    }

    /// What is wrong with it.
    pub fn remarks(&self) -> Vec<String> {
        match &self.said {
            Said::Two(said) => said.unknown_words().into_iter().collect(),
            Said::One(_) => vec![],
            Said::Wrong(why) => vec![why.clone()],
        }
    }

    /// Why it counts as version 1, if it does: what is wrong with it, where it reads nothing.
    pub fn why_version_one(&self) -> Option<String> {
        match &self.said {
            Said::One(why) => Some(format!("it counts as version 1, since it does not answer a probe: {why}")),
            Said::Two(_) | Said::Wrong(_) => None,
        }
    }
}

impl fmt::Display for Introduction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.said {
            Said::Two(said) => write!(f, "{} {}, protocol 2 ({})", said.name, said.version, said.words()),
            Said::One(_) => write!(f, "`{}`, version 1: it answers no probe", self.command),
            Said::Wrong(_) => write!(f, "`{}`", self.command),
        }
    }
}

impl External {
    /// What it says of itself, for whoever examines it.
    pub(in crate::engines) fn introduction(&self, site: &Site) -> Introduction {
        let said = match self.introduced(site) {
            Ok(Some(said)) => Said::Two(said.clone()),
            Ok(None) => Said::One(self.said.get().and_then(|said| said.as_ref().err()).cloned().unwrap_or_default()),
            Err(why) => Said::Wrong(why),
        };
        Introduction { command: self.command.join(" "), said }
    }

    pub(super) fn said(&self) -> Option<&ExternalProbe> {
        self.said.get()?.as_deref().ok()
    }

    pub(super) fn protocol(&self) -> Protocol {
        self.stated.unwrap_or(if self.said().is_some() { Protocol::Two } else { Protocol::One })
    }

    /// What it says of itself, asked once; nothing of version 1.
    pub(super) fn introduced(&self, site: &Site) -> Result<Option<&ExternalProbe>, String> {
        if self.said.get().is_none() {
            let said = match self.stated {
                Some(Protocol::One) => Err("`protocol: 1` is stated".to_owned()),
                _ => self.probed(site)?,
            };
            if let Some(unknown) = said.as_ref().ok().and_then(|said| said.unknown_words()) {
                tracing::warn!("{}: {unknown}", self.id);
            }
            self.said.get_or_init(|| said);
        }
        Ok(self.said())
    }

    /// Its answer to a probe; of what gives none, and need not, why.
    fn probed(&self, site: &Site) -> Result<Result<Box<ExternalProbe>, String>, String> {
        let is_sure = self.stated == Some(Protocol::Two);
        let limit_s = if is_sure { self.start_s } else { UNSURE_S.min(self.start_s) };
        let folder = tempfile::tempdir().map_err(|e| format!("no folder for its probe: {e}"))?;
        let request = ExternalRequest::Probe.to_json().map_err(|e| e.to_string())?;
        let run = self.invocation(site, request, Duration::from_secs_f64(limit_s), &folder.path().join("log"));
        let answer = match run.and_then(|run| Ok(run.env(FOLDER_VARIABLE, folder.path()).run()?)) {
            Ok(finished) => Answer::of(&finished.stdout),
            Err(error @ EngineError::Process(ProcessError::TimedOut { .. })) if !is_sure => {
                let id = &self.id;
                tracing::warn!(
                    "{id}: no answer to a probe within {limit_s} s, so that it counts as version 1; `protocol: 1` spares it the question, \
                     `protocol: 2` gives it time"
                );
                Answer::NotOne(error.to_string())
            }
            Err(error) => Answer::NotOne(without_log(&error)),
        };
        match answer {
            Answer::Two(said) => Ok(Ok(said)),
            Answer::NotOne(why) if !is_sure => Ok(Err(printable::lines(&why))),
            Answer::NotOne(why) => Err(format!("`protocol: 2` is stated, but it does not answer a probe: {why}")),
            Answer::Wrong(why) => Err(format!("its answer to a probe is wrong: {}", printable::lines(&why))),
        }
    }

    fn invocation(&self, site: &Site, stdin: Vec<u8>, limit: Duration, log: &Path) -> Result<Invocation, EngineError> {
        let program = self.program(site).ok_or_else(|| self.output(self.absence()))?;
        let run = Invocation::new(program, &self.folder, limit, log).of_user();
        Ok(run.args(&self.command[1..]).stdin(stdin))
    }

    /// The photometric files that it gets.
    pub(super) fn photometry(&self, job: &Job) -> Files {
        match self.protocol() {
            Protocol::One => Files::none(),
            Protocol::Two => Files::of(job),
        }
    }

    /// What it reads on its standard input.
    pub(super) fn request(&self, jobs: &[Asked<'_>], threads: usize) -> Result<Vec<u8>, EngineError> {
        let text = if let (Protocol::One, [(job, ..)]) = (self.protocol(), jobs) {
            ExternalJob::of(job).to_json()
        } else {
            let named = |(k, (job, files, folder)): (usize, &Asked<'_>)| {
                ExternalJob::of(job).named(name(job, k), job, files.forms(*folder))
            };
            ExternalRequest::Read { jobs: jobs.iter().enumerate().map(named).collect(), threads }.to_json()
        };
        text.map_err(|e| self.output(format!("the job is no JSON: {e}")))
    }

    /// One answer a job, by one process.
    pub(super) fn asked(
        &self,
        jobs: &[(&Job, &Workbench)],
        together: &Workbench,
    ) -> Result<Vec<engines::Answer>, EngineError> {
        let files: Vec<Files> = jobs.iter().map(|(job, _)| self.photometry(job)).collect();
        for (job, bench) in jobs {
            bench.write(&super::Engine::export(self, job)?)?;
            if bench.log != together.log {
                let text = format!("asked with others at once: its messages are in {}\n", together.log.display());
                let folder = bench.log.parent().map_or(Ok(()), std::fs::create_dir_all);
                folder.and_then(|()| std::fs::write(&bench.log, text)).map_err(|e| EngineError::io(&bench.log, e))?;
            }
        }
        let placed =
            jobs.iter().zip(&files).map(|((job, bench), files)| (*job, files, Some(bench.scene_dir.as_path())));
        let request = self.request(&placed.collect::<Vec<_>>(), together.jobs)?;
        let run = self.invocation(&together.site, request, together.limit, &together.log)?;
        let run = Invocation { peak: together.peak.clone(), ..run.env(FOLDER_VARIABLE, &together.scene_dir) };
        let mut answers = self.answers(&run.run()?, jobs)?;
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

    fn answers(&self, finished: &Finished, jobs: &[(&Job, &Workbench)]) -> Result<Vec<engines::Answer>, EngineError> {
        if let (Protocol::One, [(job, _)]) = (self.protocol(), jobs) {
            return Ok(vec![ExternalReadings::measured(&finished.stdout, job, &self.id)]);
        }
        let no_readings = |e| match chatter(&finished.stdout) {
            Some(why) => EngineError::garbled(self.id.clone(), why),
            None => EngineError::no_readings(self.id.clone(), &String::from_utf8_lossy(&finished.stdout), &e),
        };
        let mut answers = from_json::<ExternalAnswers>(&finished.stdout).map_err(no_readings)?.answers;
        let mut of = |(k, (job, _)): (usize, &(&Job, &Workbench))| {
            let name = name(job, k);
            let mine = answers.iter().position(|answer| answer.job.as_ref() == Some(&name));
            let mine = mine
                .ok_or_else(|| EngineError::garbled(self.id.clone(), format!("gave no answer to the job `{name}`")))?;
            answers.swap_remove(mine).measurement(job, &self.id, Protocol::Two)
        };
        let read: Vec<engines::Answer> = jobs.iter().enumerate().map(&mut of).collect();
        match answers.first().filter(|_| read.iter().all(Result::is_ok)) {
            None => Ok(read),
            Some(other) => {
                let job = other.job.as_deref().unwrap_or("of no name");
                let what = format!("answered a job `{job}` that it was not asked, or twice");
                Err(EngineError::garbled(self.id.clone(), what))
            }
        }
    }
}

/// Whether what failed with several jobs may do with one: neither what was stopped nor what used up the time of all.
pub(super) fn is_worth_asking_apart(error: &EngineError) -> bool {
    use ProcessError::{Interrupted, Start, TimedOut};
    !matches!(error, EngineError::Process(Interrupted { .. } | Start { .. } | TimedOut { .. }) | EngineError::Io { .. })
}

/// The name of a job among those that are asked at once.
fn name(job: &Job, place: usize) -> String {
    format!("{}/{}/{}", job.case, job.procedure, place + 1)
}

/// An error in words, without the log of a folder that is gone.
fn without_log(error: &EngineError) -> String {
    match error {
        EngineError::Process(ProcessError::Failed { status, tail, .. }) if tail.is_empty() => {
            format!("it ends with {status}")
        }
        EngineError::Process(ProcessError::Failed { status, tail, .. }) => format!("it ends with {status}: {tail}"),
        EngineError::Process(ProcessError::TimedOut { limit_s, .. }) => {
            format!("it takes longer than {limit_s:.0} s; `start_seconds` gives it more time")
        }
        other => other.to_string(),
    }
}
