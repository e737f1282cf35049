//! Bundles: a finished run with all that it takes to make it again, as an RO-Crate that lists the hash of every byte; and making it again.
//!
//! A bundle is a folder, or a zip of it that is packed in one way alone. `SHA256SUMS` lists every other file, so that `sha256sum --check` verifies it
//! where there is no luxproof. Inputs keep their places to one another: specs find their files as they did.

mod inputs;
mod make;
mod open;
mod pack;
mod rerun;
mod ro_crate;
mod sums;

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use luxproof_model::Request;
use luxproof_model::Tool;
use luxproof_model::{EngineStatus, Report};
use luxproof_process::files::FileError;
use luxproof_process::printable::quoted;
use luxproof_report_file::ReadError;
use luxproof_spec::Faults;

pub use make::{BundleSummary, make, spec_places};
pub use open::{MAX_FOREIGN_REPORT_BYTES, Opened, is_bundle};
pub use rerun::{Difference, EngineThen, Outcome, Reproduction, Row};

/// The file that lists the others with their hashes.
const SUMS: &str = "SHA256SUMS";
const LOCK: &str = "lock.json";
const INPUTS: &str = "inputs";
const RUN: &str = "run";

/// What made the run, to the byte where that is known.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Lock {
    /// Version of the format: 1.
    pub luxproof: u32,
    pub tool: Tool,
    /// What repeats the run at the bundle's root, its engines there.
    pub command: String,
    pub request: Request,
    /// The specs, by their places in the bundle.
    pub specs: Vec<String>,
    pub engines: Vec<EngineStatus>,
    /// The locks that Python's engines are installed from.
    pub python_locks: Vec<PythonLock>,
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PythonLock {
    pub name: String,
    pub sha256: String,
}

/// Why a run cannot be bundled, or a bundle not be used.
#[derive(Debug, thiserror::Error)]
pub enum BundleError {
    #[error(transparent)]
    File(#[from] FileError),
    #[error(transparent)]
    Report(#[from] ReadError),
    #[error(transparent)]
    Spec(#[from] Faults),
    #[error("{run} was made by a luxproof that did not note what it was asked: run its specs again")]
    NoRequest { run: String },
    #[error("{run} audits no spec: there is nothing to bundle")]
    NoSpec { run: String },
    #[error("{what} is not what it was when {run} was made: run it again, or bring it back")]
    Changed { what: String, run: String },
    #[error(
        "{spec} names {file}, which lies elsewhere in every place that it is brought to: name it by a path relative to the spec"
    )]
    Absolute { spec: String, file: String },
    #[error("{} cannot be the name of a file in a bundle: rename it, and run its spec again", .0.display())]
    Name(PathBuf),
    #[error("{folder} holds files and no bundle, such as {file}: name another folder with --out")]
    Occupied { folder: String, file: String },
    #[error(
        "{0} is no bundle: it holds no SHA256SUMS, nor the study.yaml of a study; of a paper name the file of its printed tables"
    )]
    NoBundle(String),
    #[error("{bundle} is not what was bundled:\n  {}", list(.faults))]
    Broken { bundle: String, faults: Vec<String> },
    #[error("{0} is of another format: this program reads version 1")]
    Version(String),
    #[error("{0}: {1}")]
    Zip(String, zip::result::ZipError),
    #[error("{bundle}: {file} cannot be read: {}", quoted(&.source.to_string()))]
    Json { bundle: String, file: String, source: serde_json::Error },
}

/// The most engines, patterns and procedures that a request of a stranger names: each is looked for among all.
const MAX_FOREIGN_NAMES: usize = 100;

/// The longest engine or pattern: patterns are compiled, which takes forty times as much memory.
const MAX_FOREIGN_NAME_BYTES: usize = 1000;

/// What a request of a stranger has too much of, in words.
pub fn excess(request: &Request) -> Option<String> {
    let lists = [
        ("engines", request.engines.len()),
        ("filters", request.filter.len()),
        ("procedures", request.procedures.len()),
    ];
    if let Some((what, count)) = lists.into_iter().find(|(_, count)| *count > MAX_FOREIGN_NAMES) {
        return Some(format!("names {count} {what}, and no request that is not trusted more than {MAX_FOREIGN_NAMES}"));
    }
    let longest = request.engines.iter().chain(&request.filter).map(String::len).max()?;
    let message = format!(
        "has a name of {longest} bytes, and no request that is not trusted one of more than {MAX_FOREIGN_NAME_BYTES}"
    );
    (longest > MAX_FOREIGN_NAME_BYTES).then_some(message)
}

/// What the lock of a stranger's bundle has too much of, in words: each spec is read, and each engine looked for.
fn excess_of_lock(lock: &Lock) -> Option<String> {
    let lists = [("specs", lock.specs.len()), ("engines", lock.engines.len())];
    let found = lists.into_iter().find(|(_, count)| *count > MAX_FOREIGN_NAMES);
    let in_words = found.map(|(what, count)| {
        format!("names {count} {what}, and no bundle that is not trusted more than {MAX_FOREIGN_NAMES}")
    });
    in_words.or_else(|| excess(&lock.request))
}

/// Why a report of a stranger is not used: each engine has files and pages.
pub fn excess_of_report(report: &Report) -> Option<String> {
    let count = report.engines.len();
    let message = format!("has {count} engines, and no report that is not trusted more than {MAX_FOREIGN_NAMES}");
    (count > MAX_FOREIGN_NAMES).then_some(message)
}

/// More of them are counted, not named.
const SHOWN: usize = 20;

fn list(faults: &[String]) -> String {
    let mut lines: Vec<String> = faults.iter().take(SHOWN).cloned().collect();
    if faults.len() > SHOWN {
        lines.push(format!("and {} more", faults.len() - SHOWN));
    }
    lines.join("\n  ")
}
