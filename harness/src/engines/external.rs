//! External adapters: any program that reads a job as JSON on its standard input and prints readings as JSON is an engine.
//!
//! A spec names it: `engines: {mine: {command: [python3, mine.py]}}`. It runs in the spec's folder, with the time limit, log
//! and checks of every other engine.

mod form;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

pub use self::form::{ExternalJob, ExternalReadings};
use super::{
    Absent, Engine, EngineError, FILE_READER, Job, Measurement, SceneFile, Site, Support, Version, Workbench, checked,
};
use crate::record::{EngineName, ProcedureId, UnknownProcedure};
use crate::system::digest::hexadecimal;
use crate::system::process::Invocation;

/// The environment variable that names an empty folder for the adapter's own files, kept with the run.
const FOLDER_VARIABLE: &str = "LUXPROOF_SCENE_DIR";

const JOB_FILE: &str = "job.json";

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
}

/// Suffixes of what runs as it stands and may fetch what lies beside it.
const SOURCES: [&str; 12] = ["jl", "js", "lua", "m", "mjs", "pl", "py", "r", "R", "rb", "sh", "ts"];

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
        let folder = std::path::absolute(folder).map_err(|e| EngineError::io(folder, e))?;
        let list = |key: &str| match words(key) {
            None => Ok(vec![]),
            Some(list) => list.map_err(|_| error(key, "must be a list of names")),
        };
        let depends_on = list("depends_on")?.into_iter().map(|file| folder.join(file)).collect();
        let contents = contents(&command, &folder);
        Ok(Self { shares: list("shares")?, id: id.clone(), command, procedures, depends_on, folder, contents })
    }

    /// The program: a path is relative to the spec's folder, a bare name is looked up on PATH.
    fn program(&self, site: &Site) -> Option<PathBuf> {
        let is_path = self.command[0].contains('/');
        if is_path { file(&self.folder, (0, &self.command[0])) } else { site.program(&self.command[0]) }
    }

    fn invocation(&self, job: &Job, workbench: &Workbench) -> Result<Invocation, EngineError> {
        let program = self.program(&workbench.site).ok_or_else(|| self.output(self.absence()))?;
        let input = ExternalJob::of(job).to_json().map_err(|e| self.output(format!("the job is no JSON: {e}")))?;
        let run = Invocation::new(program, &self.folder, workbench.limit, &workbench.log);
        let run = Invocation { peak: workbench.peak.clone(), ..run };
        Ok(run.args(&self.command[1..]).env(FOLDER_VARIABLE, &workbench.scene_dir).stdin(input))
    }

    fn absence(&self) -> String {
        format!("`{}` is neither beside the spec nor on PATH", self.command[0])
    }

    fn output(&self, what: String) -> EngineError {
        EngineError::Output { engine: self.id.clone(), what }
    }
}

/// The file that a word of a command names. A program without a folder is none: it is looked up on PATH.
fn file(folder: &Path, (k, word): (usize, &String)) -> Option<PathBuf> {
    Some(folder.join(word)).filter(|path| (k > 0 || word.contains('/')) && path.is_file())
}

fn contents(command: &[String], folder: &Path) -> String {
    let mut hash = Sha256::new();
    for (k, word) in command.iter().enumerate() {
        let read = file(folder, (k, word)).and_then(|path| std::fs::read(path).ok());
        let bytes = read.unwrap_or_else(|| word.clone().into_bytes());
        hash.update((bytes.len() as u64).to_le_bytes());
        hash.update(bytes);
    }
    format!("sha256:{}", &hexadecimal(&hash.finalize())[..12])
}

fn entries(folder: &Path) -> impl Iterator<Item = PathBuf> + use<> {
    folder.read_dir().into_iter().flatten().flatten().map(|entry| entry.path())
}

impl Engine for External {
    fn name(&self) -> EngineName {
        self.id.clone()
    }

    fn is_vouched_for(&self) -> bool {
        false
    }

    /// The version of an adapter is the hash of what its command says; what runs are the files that it names, the sources beside
    /// the first of these that is one, which that may import, and those that it depends on by `depends_on`.
    fn probe(&self, site: &Site) -> Result<Version, Absent> {
        let remedy = format!("correct engines.{}", self.id);
        let absent = |reason| Absent { reason, remedy: remedy.clone() };
        let program = self.program(site).ok_or_else(|| absent(self.absence()))?;
        let named: Vec<PathBuf> = self.command.iter().enumerate().filter_map(|word| file(&self.folder, word)).collect();
        let mut files = vec![program];
        if let Some(source) = named.iter().find(|f| f.extension().is_some_and(|e| SOURCES.iter().any(|s| e == *s))) {
            let is_kin = |p: PathBuf| p.extension() == source.extension() && p.is_file();
            let beside = source.parent().into_iter().flat_map(entries);
            files.extend(beside.filter(|p| is_kin(p.clone()) || entries(p).any(is_kin)));
        }
        files.extend(named);
        for file in &self.depends_on {
            if !file.exists() {
                return Err(absent(format!("{}, which it depends on, is not there", file.display())));
            }
            files.push(file.clone());
        }
        Ok(Version::of(&self.id, &self.contents, site, files))
    }

    /// A program that two engines run counts once, and so does what it says that it shares.
    fn components(&self, _job: &Job) -> Vec<String> {
        let program = format!("the program {}", self.contents);
        [FILE_READER.to_owned(), program].into_iter().chain(self.shares.clone()).collect()
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
        let mut measurement = form::measurement(&finished.stdout, job, &self.id)?;
        measurement.effort.insert("command".into(), run.command_line());
        checked(&self.id, job, measurement)
    }
}
