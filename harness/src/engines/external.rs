//! External adapters: any program that reads a job as JSON on its standard input and prints readings as JSON is an engine.
//!
//! A spec names it: `engines: {mine: {command: [python3, mine.py]}}`. It runs in the spec's folder, with the time limit, log
//! and checks of every other engine.

mod code;
mod command;
mod form;
mod imports;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

pub use self::form::{ExternalJob, ExternalReadings};
use super::{
    Absent, Engine, EngineError, FILE_READER, Job, Measurement, SceneFile, Site, Support, Version, Workbench,
    fingerprint,
};
use crate::record::{EngineName, ProcedureId, UnknownProcedure};
use crate::system::process::Invocation;

/// The environment variable that names an empty folder for the adapter's own files, kept with the run.
const FOLDER_VARIABLE: &str = "LUXPROOF_SCENE_DIR";

const JOB_FILE: &str = "job.json";

/// The setting that names the folder in which it runs and from which its paths count, in place of the spec's.
pub(crate) const RUN_IN: &str = "run_in";

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
        if name.is_empty() || !name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-') {
            return Err(error("command", "an engine's name holds letters, digits, - and _ only"));
        }
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
        let (contents, parts) = (command::contents_of(&command, &folder), command::parts(&command, &folder));
        Ok(Self { shares: list("shares")?, id: id.clone(), command, procedures, depends_on, folder, contents, parts })
    }

    /// The program: a path is relative to the spec's folder, a bare name is looked up on PATH.
    fn program(&self, site: &Site) -> Option<PathBuf> {
        let is_path = self.command[0].contains('/');
        if is_path { command::file(&self.folder, 0, &self.command[0]) } else { site.program(&self.command[0]) }
    }

    fn invocation(&self, job: &Job, workbench: &Workbench) -> Result<Invocation, EngineError> {
        let program = self.program(&workbench.site).ok_or_else(|| self.output(self.absence()))?;
        let input = ExternalJob::of(job).to_json().map_err(|e| self.output(format!("the job is no JSON: {e}")))?;
        let run = Invocation::new(program, &self.folder, workbench.limit, &workbench.log).of_user();
        let run = Invocation { peak: workbench.peak.clone(), ..run };
        Ok(run.args(&self.command[1..]).env(FOLDER_VARIABLE, &workbench.scene_dir).stdin(input))
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
        if let Some(gone) = self.depends_on.iter().find(|file| !file.exists()) {
            return Err(absent(format!("{}, which it depends on, is not there", gone.display())));
        }
        let own = command::own_files(&self.command, &self.folder);
        let code = code::below(&self.folders(&own), site.root());
        let mut text = self.contents.clone();
        if !code.is_all {
            tracing::warn!("{}: more code lies about it than is looked at: it needs a folder of its own", self.id);
            text += " (not all of its code)";
        }
        if self.depends_on.is_empty() && command::is_unknown(&self.command, &self.folder) {
            tracing::warn!("{}: no word of its command names a file of its own: name them in `depends_on`", self.id);
            text += " (its files are not known)";
        }
        let imports = imports::of(&self.command, &own, &self.folder, site);
        if self.depends_on.is_empty() && !imports.unknown.is_empty() {
            let unknown = imports.unknown.join(", ");
            tracing::warn!(
                "{}: not found, so that a change is not noticed: {unknown}; name its files in `depends_on`",
                self.id
            );
            text += " (not all of its imports)";
        }
        let named = fingerprint::listed(std::iter::once(program).chain(own));
        let others = fingerprint::listed(self.depends_on.iter().cloned().chain(imports.roots));
        let files = named.into_iter().chain(code.files).chain(others).collect();
        Ok(Version { text, fingerprint: fingerprint::of_files(&self.id, site, files) })
    }

    /// A file that two engines' commands name counts once, whatever the other words, and so does what it says that it shares.
    fn components(&self, _job: &Job) -> Vec<String> {
        let parts = self.parts.iter().chain(&self.shares);
        std::iter::once(FILE_READER.to_owned()).chain(parts.cloned()).collect()
    }

    fn supports(&self, job: &Job) -> Support {
        match &self.procedures {
            Some(mine) if !mine.contains(&job.procedure) => {
                Support::No(format!("engines.{}.procedures does not name it", self.id))
            }
            _ => Support::Yes,
        }
    }

    /// Its own are checked where it is made; all others are the program's.
    fn check_settings(&self, _job: &Job) -> Result<(), EngineError> {
        Ok(())
    }

    fn export(&self, job: &Job) -> Result<Vec<SceneFile>, EngineError> {
        let bytes = ExternalJob::of(job).to_json().map_err(|e| self.output(format!("the job is no JSON: {e}")))?;
        Ok(vec![SceneFile { name: JOB_FILE.to_owned(), bytes }])
    }

    fn command_by_hand(&self, _job: &Job, _site: &Site) -> Option<String> {
        let nothing = std::time::Duration::ZERO;
        let command = Invocation::new(&self.command[0], &self.folder, nothing, "").args(&self.command[1..]);
        let there = Invocation::new("cd", &self.folder, nothing, "").args([&self.folder]);
        Some(format!("({} && {}) < {JOB_FILE}", there.command_line(), command.command_line()))
    }

    /// A program of the user's is told the names of case and procedure, and may heed them.
    fn cache_identity(&self, job: &Job) -> Job {
        job.clone()
    }

    fn read(&self, job: &Job, workbench: &Workbench) -> Result<Measurement, EngineError> {
        workbench.write(&self.export(job)?)?;
        let run = self.invocation(job, workbench)?;
        let finished = run.run()?;
        let mut measured = ExternalReadings::measured(&finished.stdout, job, &self.id);
        let effort = match &mut measured {
            Ok(measurement) => Some(&mut measurement.effort),
            Err(EngineError::AtMeters { rest, .. }) => Some(&mut rest.effort),
            Err(_) => None,
        };
        effort.map(|effort| effort.insert("command".into(), run.command_line()));
        measured
    }
}
