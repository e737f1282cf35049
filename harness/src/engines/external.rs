//! External adapters: any program that reads a job as JSON on its standard input and prints readings as JSON is an engine.
//!
//! A spec names it: `engines: {mine: {command: [python3, mine.py]}}`. It runs in the spec's folder, with the time limit, log
//! and checks of every other engine. Of protocol 2 is what says so when it is probed; all else is of version 1, one job a process.

mod ask;
mod code;
mod command;
mod form;
mod imports;
mod json;
mod photometry;
mod protocol;
mod readings;
mod releases;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

pub use self::ask::Introduction;
use self::ask::is_worth_asking_apart;
use self::json::Protocol;
use self::protocol::Capability;

pub use self::form::ExternalJob;
pub use self::protocol::{ExternalProbe, ExternalRequest};
pub use self::readings::{ExternalAnswers, ExternalReadings};
pub(crate) use self::releases::{named as releases, of_release};
use super::{
    Absent, Answer, Engine, EngineError, FILE_READER, Job, Measurement, SceneFile, Site, Support, Version, Workbench,
    fingerprint,
};
use crate::record::{EngineName, ProcedureId, UnknownProcedure};
use crate::system::process::Invocation;

/// The environment variable that names an empty folder for the adapter's own files, kept with the run.
const FOLDER_VARIABLE: &str = "LUXPROOF_SCENE_DIR";

const JOB_FILE: &str = "job.json";

/// The setting that names the folder in which it runs and from which its paths count, in place of the spec's.
pub(crate) const RUN_IN: &str = "run_in";

/// Seconds that it may take before it begins to work, where nobody says.
const START_S: f64 = 120.0;

/// The settings that are no business of the program's.
const OWN_SETTINGS: [&str; 6] = ["command", "procedures", RUN_IN, "protocol", "start_seconds", releases::KEY];

/// Folders of programs that have nothing to do with each other.
const INSTALLED: [&str; 6] = ["/bin", "/sbin", "/usr/bin", "/usr/sbin", "/usr/local/bin", "/usr/local/sbin"];

#[derive(Clone, Debug, PartialEq)]
pub(super) struct External {
    id: EngineName,
    command: Vec<String>,
    /// The procedures that it takes part in; `None` for all.
    procedures: Option<Vec<ProcedureId>>,
    /// What it has in common with other engines, by name: `shares`.
    shares: Vec<String>,
    /// Files and folders besides those of its command that make its readings: `depends_on`.
    depends_on: Vec<PathBuf>,
    /// The spec's folder, in which it runs.
    folder: PathBuf,
    /// Its command by content, whatever its files are called.
    contents: String,
    /// What makes its readings, by content: who has one of these in common is no other program.
    parts: BTreeSet<String>,
    /// The protocol that its settings say; `None`: as its probe answers.
    stated: Option<Protocol>,
    /// Seconds that it may take before it begins to work.
    start_s: f64,
    /// What it says of itself, once it was asked; of version 1 why it counts as that.
    said: OnceLock<Result<Box<ExternalProbe>, String>>,
}

impl External {
    pub(super) fn new(
        name: &str,
        settings: &BTreeMap<String, serde_json::Value>,
        folder: &Path,
    ) -> Result<Self, EngineError> {
        let id = EngineName::from(name);
        let error = |key: &str, what: &str| EngineError::Setting {
            engine: id.clone(),
            key: key.to_owned(),
            what: what.to_owned(),
        };
        let words = |key: &str| settings.get(key).map(|v| serde_json::from_value::<Vec<String>>(v.clone()));
        let command = match words("command") {
            Some(Ok(words)) if words.first().is_some_and(|w| !w.is_empty()) => words,
            _ => return Err(error("command", "must be a list of a program and its arguments")),
        };
        let wrong = |what: &str| error("procedures", what);
        let procedures =
            words("procedures").transpose().map_err(|_| wrong("must be a list of procedures that it can do"))?;
        let parsed =
            |names: Vec<String>| names.iter().map(|name| name.parse()).collect::<Result<_, UnknownProcedure>>();
        let procedures = procedures.map(parsed).transpose().map_err(|unknown| wrong(&unknown.to_string()))?;
        // The name becomes a folder of the run.
        let is_plain =
            |name: &str| !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-');
        if !is_plain(id.family()) || (name.contains('@') && id.release().is_none()) {
            return Err(error(
                "command",
                "an engine's name holds letters, digits, - and _ only, and behind an @ its release",
            ));
        }
        releases::all(name, settings)?;
        // The folder of a spec that is named without one is the working directory.
        let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
        let folder = match settings.get(RUN_IN).map(serde_json::Value::as_str) {
            None => folder.to_owned(),
            Some(Some(other)) => folder.join(other),
            Some(None) => return Err(error(RUN_IN, "must be a folder")),
        };
        let folder = std::path::absolute(&folder).map_err(|e| EngineError::io(&folder, e))?;
        let list = |key: &str| match words(key) {
            None => Ok(vec![]),
            Some(list) => list.map_err(|_| error(key, "must be a list of names")),
        };
        let depends_on = list("depends_on")?.into_iter().map(|file| folder.join(file)).collect();
        let stated = match settings.get("protocol").map(serde_json::Value::as_u64) {
            None => None,
            Some(Some(1)) => Some(Protocol::One),
            Some(Some(2)) => Some(Protocol::Two),
            Some(_) => return Err(error("protocol", "must be 1 or 2")),
        };
        let start_s = match settings.get("start_seconds").map(serde_json::Value::as_f64) {
            None => START_S,
            Some(Some(seconds)) if (1.0..=86_400.0).contains(&seconds) => seconds,
            Some(_) => return Err(error("start_seconds", "must be a number of seconds from 1 to 86400")),
        };
        let (contents, parts) = (command::contents_of(&command, &folder), command::parts(&command, &folder));
        let (shares, id, said) = (list("shares")?, id.clone(), OnceLock::new());
        Ok(Self { id, command, procedures, shares, depends_on, folder, contents, parts, stated, start_s, said })
    }

    /// Its files in the folder that its paths count from, or that lead on from there: not what is installed elsewhere.
    pub(super) fn own_files(&self) -> Vec<PathBuf> {
        let named = command::files(&self.command, &self.folder).into_iter().map(|(path, _)| path);
        let all = named.chain(self.depends_on.iter().filter(|path| path.is_file()).cloned());
        all.filter(|path| path.starts_with(&self.folder)).collect()
    }

    /// The program: a path is relative to the spec's folder, a bare name is looked up on PATH.
    fn program(&self, site: &Site) -> Option<PathBuf> {
        let is_path = self.command[0].contains('/');
        if is_path { command::file(&self.folder, 0, &self.command[0]) } else { site.program(&self.command[0]) }
    }

    /// Where the code of it may lie that no word names: where it runs, and about each of its files, wherever links put them.
    fn folders(&self, files: &[PathBuf]) -> Vec<PathBuf> {
        let mut folders = vec![self.folder.clone()];
        let real = files.iter().filter_map(|file| file.canonicalize().ok());
        for folder in files.iter().cloned().chain(real).filter_map(|file| file.parent().map(Path::to_owned)) {
            if !folders.contains(&folder) && !INSTALLED.iter().any(|other| folder == Path::new(other)) {
                folders.push(folder);
            }
        }
        folders
    }

    fn absence(&self) -> String {
        format!("`{}` is neither beside the spec nor on PATH", self.command[0])
    }

    fn output(&self, what: String) -> EngineError {
        EngineError::Output { engine: self.id.clone(), what }
    }
}

impl Engine for External {
    fn name(&self) -> EngineName {
        self.id.clone()
    }

    fn is_vouched_for(&self) -> bool {
        false
    }

    /// The version of an adapter is the hash of what its command says. What runs is more: the files that it names, all code below the
    /// folders of these and below that in which it runs, which it may load or start, what Python would import from elsewhere, and what it
    /// depends on by `depends_on`.
    fn probe(&self, site: &Site) -> Result<Version, Absent> {
        let remedy = format!("correct engines.{}", self.id);
        let absent = |reason| Absent { reason, remedy: remedy.clone() };
        let program = self.program(site).ok_or_else(|| absent(self.absence()))?;
        let said = self.introduced(site).map_err(absent)?;
        let listed: Vec<PathBuf> = said.iter().flat_map(|s| &s.depends_on).map(|file| self.folder.join(file)).collect();
        let depends_on: Vec<&PathBuf> = self.depends_on.iter().chain(&listed).collect();
        if let Some(gone) = depends_on.iter().find(|file| !file.exists()) {
            return Err(absent(format!("{}, which it depends on, is not there", gone.display())));
        }
        let own = command::own_files(&self.command, &self.folder);
        let code = code::below(&self.folders(&own), site.root());
        let mut text = match said {
            Some(said) => format!("{} {}, {}", said.name, said.version, self.contents),
            None => self.contents.clone(),
        };
        if !code.is_all {
            tracing::warn!("{}: more code lies about it than is looked at: it needs a folder of its own", self.id);
            text += " (not all of its code)";
        }
        if depends_on.is_empty() && command::is_unknown(&self.command, &self.folder) {
            tracing::warn!("{}: no word of its command names a file of its own: name them in `depends_on`", self.id);
            text += " (its files are not known)";
        }
        let imports = imports::of(&self.command, &own, &self.folder, site);
        if depends_on.is_empty() && !imports.unknown.is_empty() {
            let unknown = imports.unknown.join(", ");
            tracing::warn!(
                "{}: not found, so that a change is not noticed: {unknown}; name its files in `depends_on`",
                self.id
            );
            text += " (not all of its imports)";
        }
        let named = fingerprint::listed(std::iter::once(program).chain(own));
        let others = fingerprint::listed(depends_on.into_iter().cloned().chain(imports.roots));
        let files = named.into_iter().chain(code.files).chain(others).collect();
        Ok(Version { text, fingerprint: fingerprint::of_files(&self.id, site, files) })
    }

    /// A file that two engines' commands name counts once, whatever the other words, and so does what it says that it shares.
    fn components(&self, _job: &Job) -> Vec<String> {
        let said = self.said().map_or(&[][..], |said| &said.shares);
        let parts = self.parts.iter().chain(&self.shares).chain(said);
        std::iter::once(FILE_READER.to_owned()).chain(parts.cloned()).collect()
    }

    fn supports(&self, job: &Job) -> Support {
        match &self.procedures {
            Some(mine) if !mine.contains(&job.procedure) => {
                Support::No(format!("engines.{}.procedures does not name it", self.id))
            }
            // Nothing is known of it before it was asked.
            _ => self.said().and_then(|said| said.objection(job)).map_or(Support::Yes, Support::No),
        }
    }

    /// Its own are checked where it is made; all others are the program's.
    fn check_settings(&self, _job: &Job) -> Result<(), EngineError> {
        Ok(())
    }

    fn export(&self, job: &Job) -> Result<Vec<SceneFile>, EngineError> {
        let files = self.photometry(job);
        let bytes = self.request(&[(job, &files, None)], 1)?;
        Ok(std::iter::once(SceneFile { name: JOB_FILE.to_owned(), bytes }).chain(files.files).collect())
    }

    fn command_by_hand(&self, _job: &Job, _site: &Site) -> Option<String> {
        let nothing = std::time::Duration::ZERO;
        let command = Invocation::new(&self.command[0], &self.folder, nothing, "").args(&self.command[1..]);
        let there = Invocation::new("cd", &self.folder, nothing, "").args([&self.folder]);
        // What the job names lies where it does.
        let scene = if self.protocol() == Protocol::Two {
            format!("{FOLDER_VARIABLE}=\"$PWD\"; export {FOLDER_VARIABLE}; ")
        } else {
            String::new()
        };
        Some(format!("({scene}{} && {}) < {JOB_FILE}", there.command_line(), command.command_line()))
    }

    fn takes_batches(&self) -> bool {
        self.said().is_some_and(|said| said.can(Capability::Batch))
    }

    fn max_threads(&self) -> usize {
        let uses = |said: &ExternalProbe| said.can(Capability::Threads);
        if self.said().is_none_or(uses) { usize::MAX } else { 1 }
    }

    fn start_s(&self) -> f64 {
        self.start_s
    }

    /// A program of the user's is told the names of case and procedure, and may heed them.
    fn cache_identity(&self, job: &Job) -> Job {
        job.clone()
    }

    fn read(&self, job: &Job, workbench: &Workbench) -> Result<Measurement, EngineError> {
        let answers = self.asked(&[(job, workbench)], workbench)?;
        answers.into_iter().next().unwrap_or_else(|| Err(self.output("gave nothing".to_owned())))
    }

    fn read_all(&self, jobs: &[(&Job, &Workbench)], together: &Workbench) -> Result<Vec<Answer>, EngineError> {
        match self.asked(jobs, together) {
            // What breaks all at once may be one of them.
            Err(error) if is_worth_asking_apart(&error) => {
                tracing::warn!("{}: {error}; its {} jobs are asked one by one", self.id, jobs.len());
                Ok(jobs.iter().map(|(job, bench)| self.read(job, bench)).collect())
            }
            answers => answers,
        }
    }
}
