//! External adapters: a program that reads a job as JSON on its standard input and prints readings as JSON is an engine.
//!
//! A spec names it: `engines: {mine: {command: [python3, mine.py]}}`. It runs in the spec's folder, with the time limit, log
//! and checks of every other engine. Its first request is the probe, which asks for its name, version and capabilities.

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
use self::ask::may_succeed_alone;
use self::photometry::Files;
use self::protocol::Capability;

pub use self::form::ExternalJob;
pub use self::protocol::{ExternalProbe, ExternalRequest};
pub use self::readings::ExternalAnswers;
pub use self::releases::{named as releases, of_release};
use super::{
    Absent, Answer, Engine, EngineError, EngineRoot, FILE_READER, Job, JobDir, Measurement, SceneFile, Support,
    Version, fingerprint,
};
use luxproof_model::{EngineName, ProcedureId, UnknownProcedure};
use luxproof_process::process::Invocation;

/// The environment variable that names an empty folder for the adapter's own files. The run stores this folder.
const FOLDER_VARIABLE: &str = "LUXPROOF_SCENE_DIR";

const JOB_FILE: &str = "job.json";

/// The setting that names the folder in which the program runs, instead of the spec's. Its paths are relative to this folder.
pub const RUN_IN: &str = "run_in";

/// Default number of seconds that a program may take to start.
const START_S: f64 = 120.0;

/// The settings that luxproof reads and does not pass on to the program.
const OWN_SETTINGS: [&str; 5] = ["command", "procedures", RUN_IN, "start_seconds", releases::KEY];

/// Folders of unrelated programs, which are therefore no part of an adapter's code.
const INSTALLED: [&str; 6] = ["/bin", "/sbin", "/usr/bin", "/usr/sbin", "/usr/local/bin", "/usr/local/sbin"];

/// An adapter as the spec defines it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct External {
    id: EngineName,
    command: Vec<String>,
    /// The procedures that it supports; `None` for all.
    procedures: Option<Vec<ProcedureId>>,
    /// The setting `shares`: names of components that it has in common with other engines.
    shares: Vec<String>,
    /// The setting `depends_on`: further files and folders that affect its readings.
    depends_on: Vec<PathBuf>,
    /// The folder in which it runs.
    folder: PathBuf,
    /// The hash of its command and the contents of its files, whatever their names.
    contents: String,
    /// Hashes of the parts that make its readings. Two engines with a part in common are not independent.
    parts: BTreeSet<String>,
    /// Seconds that it may take to start.
    start_s: f64,
    /// Its answer to the probe, after the first probe.
    probe_answer: OnceLock<ExternalProbe>,
}

/// Returns whether a name is suitable for a folder.
fn is_plain_name(name: &str) -> bool {
    !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-')
}

/// The settings of an adapter in a spec, with the name for error messages.
struct AdapterSettings<'a> {
    id: &'a EngineName,
    settings: &'a BTreeMap<String, serde_json::Value>,
}

impl AdapterSettings<'_> {
    fn error(&self, key: &str, what: &str) -> EngineError {
        EngineError::Setting { engine: self.id.clone(), key: key.to_owned(), what: what.to_owned() }
    }

    /// Returns a setting as a list of words, or `None` if it is missing.
    fn words(&self, key: &str) -> Option<serde_json::Result<Vec<String>>> {
        self.settings.get(key).map(|value| serde_json::from_value(value.clone()))
    }

    /// Returns a setting as a list of names, which is empty if the setting is missing.
    fn names(&self, key: &str) -> Result<Vec<String>, EngineError> {
        match self.words(key) {
            None => Ok(vec![]),
            Some(names) => names.map_err(|_| self.error(key, "must be a list of names")),
        }
    }

    fn command(&self) -> Result<Vec<String>, EngineError> {
        match self.words("command") {
            Some(Ok(words)) if words.first().is_some_and(|w| !w.is_empty()) => Ok(words),
            _ => Err(self.error("command", "must be a list of a program and its arguments")),
        }
    }

    fn procedures(&self) -> Result<Option<Vec<ProcedureId>>, EngineError> {
        let Some(names) = self.words("procedures") else { return Ok(None) };
        let names = names.map_err(|_| self.error("procedures", "must be a list of procedures that it can do"))?;
        let procedures: Result<Vec<ProcedureId>, UnknownProcedure> = names.iter().map(|name| name.parse()).collect();
        procedures.map(Some).map_err(|unknown| self.error("procedures", &unknown.to_string()))
    }

    /// Returns the absolute path of the folder in which the program runs.
    fn folder(&self, spec_folder: &Path) -> Result<PathBuf, EngineError> {
        // A spec's path without a folder is relative to the working directory.
        let folder = if spec_folder.as_os_str().is_empty() { Path::new(".") } else { spec_folder };
        let folder = match self.settings.get(RUN_IN).map(serde_json::Value::as_str) {
            None => folder.to_owned(),
            Some(Some(other)) => folder.join(other),
            Some(None) => return Err(self.error(RUN_IN, "must be a folder")),
        };
        std::path::absolute(&folder).map_err(|e| EngineError::io(&folder, e))
    }

    /// Refuses a setting that chooses a protocol. The program must not get it either.
    fn refuse_protocol(&self) -> Result<(), EngineError> {
        match self.settings.get("protocol") {
            None => Ok(()),
            Some(_) => {
                Err(self.error("protocol", "is not a setting: the program's answer to the probe names its protocol"))
            }
        }
    }

    fn start_s(&self) -> Result<f64, EngineError> {
        match self.settings.get("start_seconds").map(serde_json::Value::as_f64) {
            None => Ok(START_S),
            Some(Some(seconds)) if (1.0..=86_400.0).contains(&seconds) => Ok(seconds),
            Some(_) => Err(self.error("start_seconds", "must be a number of seconds from 1 to 86400")),
        }
    }
}

impl External {
    pub(super) fn new(
        name: &str,
        settings: &BTreeMap<String, serde_json::Value>,
        folder: &Path,
    ) -> Result<Self, EngineError> {
        let id = EngineName::from(name);
        let adapter = AdapterSettings { id: &id, settings };
        let command = adapter.command()?;
        let procedures = adapter.procedures()?;
        // The run makes a folder of this name.
        if !is_plain_name(id.family()) || (name.contains('@') && id.release().is_none()) {
            return Err(adapter.error(
                "command",
                "an engine's name holds letters, digits, - and _ only, and behind an @ its release",
            ));
        }
        releases::all(name, settings)?;
        let folder = adapter.folder(folder)?;
        let depends_on = adapter.names("depends_on")?.into_iter().map(|file| folder.join(file)).collect();
        adapter.refuse_protocol()?;
        let start_s = adapter.start_s()?;
        let shares = adapter.names("shares")?;
        let (contents, parts) = (command::contents_of(&command, &folder), command::parts(&command, &folder));
        let (id, probe_answer) = (id.clone(), OnceLock::new());
        Ok(Self { id, command, procedures, shares, depends_on, folder, contents, parts, start_s, probe_answer })
    }

    /// Returns its files below the folder in which it runs. Files that are installed elsewhere do not count.
    pub(super) fn own_files(&self) -> Vec<PathBuf> {
        let named = command::files(&self.command, &self.folder).into_iter().map(|(path, _)| path);
        let all = named.chain(self.depends_on.iter().filter(|path| path.is_file()).cloned());
        all.filter(|path| path.starts_with(&self.folder)).collect()
    }

    /// Finds the program: a path is relative to the folder in which it runs, and a bare name is looked up on PATH.
    fn program(&self, site: &EngineRoot) -> Option<PathBuf> {
        let is_path = self.command[0].contains('/');
        if is_path { command::file(&self.folder, 0, &self.command[0]) } else { site.program(&self.command[0]) }
    }

    /// Returns folders that may contain its further code: the one in which it runs, and those of its files and of their link targets.
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

    fn has_trusted_error(&self) -> bool {
        false
    }

    /// An adapter's version text has the hash of its command.
    ///
    /// Its fingerprint covers more: the files that the command names, and all code in their folders and in the folder in which it
    /// runs, because it may load or start that code. It also covers what Python imports from elsewhere, and `depends_on`.
    fn probe(&self, site: &EngineRoot) -> Result<Version, Absent> {
        let absent = |reason| Absent { reason, remedy: format!("correct engines.{}", self.id) };
        let program = self.program(site).ok_or_else(|| absent(self.absence()))?;
        let answer = self.probe_once(site).map_err(absent)?;
        let listed: Vec<PathBuf> = answer.depends_on.iter().map(|file| self.folder.join(file)).collect();
        let depends_on: Vec<&PathBuf> = self.depends_on.iter().chain(&listed).collect();
        if let Some(gone) = depends_on.iter().find(|file| !file.exists()) {
            return Err(absent(format!("{}, which it depends on, is not there", gone.display())));
        }
        let own = command::own_files(&self.command, &self.folder);
        let code = code::below(&self.folders(&own), site.root());
        let mut text = format!("{} {}, {}", answer.name, answer.version, self.contents);
        if !code.is_all {
            tracing::warn!(
                "{}: its folder holds too much code to watch, so that some changes are not noticed; give it a folder without other programs",
                self.id
            );
            text += " (not all of its code)";
        }
        if depends_on.is_empty() && command::is_unknown(&self.command, &self.folder) {
            tracing::warn!(
                "{}: its command names no file, so that a change of the program is not noticed; list its files in `depends_on`",
                self.id
            );
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

    /// The components are the files that its command names, whatever the other words, and those that it declares as shared.
    fn components(&self, _job: &Job) -> Vec<String> {
        let declared = self.probe_answer().map_or(&[][..], |answer| &answer.shares);
        let parts = self.parts.iter().chain(&self.shares).chain(declared);
        std::iter::once(FILE_READER.to_owned()).chain(parts.cloned()).collect()
    }

    fn supports(&self, job: &Job) -> Support {
        match &self.procedures {
            Some(mine) if !mine.contains(&job.procedure) => {
                Support::No(format!("engines.{}.procedures does not name it", self.id))
            }
            // Its limits are unknown until the probe has asked it.
            _ => self.probe_answer().and_then(|answer| answer.objection(job)).map_or(Support::Yes, Support::No),
        }
    }

    /// `External::new` has checked luxproof's settings, and all others belong to the program.
    fn check_settings(&self, _job: &Job) -> Result<(), EngineError> {
        Ok(())
    }

    fn export(&self, job: &Job) -> Result<Vec<SceneFile>, EngineError> {
        let files = Files::of(job);
        let bytes = self.request(&[(job, &files, None)], 1)?;
        Ok(std::iter::once(SceneFile { name: JOB_FILE.to_owned(), bytes }).chain(files.files).collect())
    }

    fn command_by_hand(&self, _job: &Job, _site: &EngineRoot) -> Option<String> {
        let nothing = std::time::Duration::ZERO;
        let command = Invocation::new(&self.command[0], &self.folder, nothing, "").args(&self.command[1..]);
        let there = Invocation::new("cd", &self.folder, nothing, "").args([&self.folder]);
        // The job names its files relative to this folder.
        let scene = format!("{FOLDER_VARIABLE}=\"$PWD\"; export {FOLDER_VARIABLE}");
        Some(format!("({scene}; {} && {}) < {JOB_FILE}", there.command_line(), command.command_line()))
    }

    fn takes_batches(&self) -> bool {
        self.probe_answer().is_some_and(|answer| answer.can(Capability::Batch))
    }

    fn max_threads(&self) -> usize {
        let uses_threads = self.probe_answer().is_none_or(|answer| answer.can(Capability::Threads));
        if uses_threads { usize::MAX } else { 1 }
    }

    fn start_s(&self) -> f64 {
        self.start_s
    }

    /// A user's program gets the names of case and procedure, and may depend on them.
    fn cache_identity(&self, job: &Job) -> Job {
        job.clone()
    }

    fn read(&self, job: &Job, workbench: &JobDir) -> Result<Measurement, EngineError> {
        let answers = self.read_jobs(&[(job, workbench)], workbench)?;
        answers.into_iter().next().unwrap_or_else(|| Err(self.output("gave nothing".to_owned())))
    }

    fn read_all(&self, jobs: &[(&Job, &JobDir)], together: &JobDir) -> Result<Vec<Answer>, EngineError> {
        match self.read_jobs(jobs, together) {
            // One job may have caused the failure of all.
            Err(error) if may_succeed_alone(&error) => {
                tracing::warn!("{}: {error}; its {} jobs are asked one by one", self.id, jobs.len());
                Ok(jobs.iter().map(|(job, job_dir)| self.read(job, job_dir)).collect())
            }
            answers => answers,
        }
    }
}
