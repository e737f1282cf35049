//! Making a bundle of a run's folder.

use std::collections::BTreeMap;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

use itertools::Itertools;
use sha2::{Digest, Sha256};
use walkdir::WalkDir;

use super::inputs::{Layout, Sources, clean, name};
use super::pack::pack;
use super::ro_crate::{Part, metadata};
use super::sums::{self, Sums};
use super::{BundleError, LOCK, Lock, PythonLock, RUN, SUMS};
use crate::engines;
use crate::report::{FILE, Report, Request};
use crate::spec::{BUNDLE_FILE, Case, Trust};
use crate::system::digest::{self, hexadecimal};
use crate::system::files::{self, FileError};

const README: &str = "README.md";

/// A bundle that was made.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Made {
    pub place: PathBuf,
    /// SHA-256 of its list of hashes, which is that of all its bytes.
    pub sha256: String,
    pub files: usize,
    pub bytes: u64,
}

/// Bundles the run in a folder, into another folder or, where its name ends so, into a `.zip`. Specs are looked for where the report says that they
/// were given.
pub fn make(run: &Path, out: &Path, licence: Option<&str>) -> Result<Made, BundleError> {
    let shown = run.display().to_string();
    let report = Report::read(&run.join(FILE))?.report;
    let request = report.request.clone().ok_or_else(|| BundleError::NoRequest { run: shown.clone() })?;
    let Layout { mut places, specs } = Layout::of(&sources(&report, &shown)?)?;
    if specs.is_empty() {
        return Err(BundleError::NoSpec { run: shown });
    }
    places.extend(of_run(run)?);
    let lock = lock(&report, request, specs);
    let failed = |e: io::Error| FileError::of(out, e);
    let stage = tempfile::tempdir().map_err(failed)?;
    let (sums, bytes) = fill(stage.path(), &places, &report, &lock, licence)?;
    finds_its_files(stage.path(), &lock, &report, &shown)?;
    let text = sums::text(&sums);
    files::replace(&stage.path().join(SUMS), text.as_bytes()).map_err(failed)?;
    if out.extension().is_some_and(|extension| extension == "zip") {
        let packed = |file: &mut File| pack(stage.path(), &sums, file).map_err(io::Error::other);
        files::replace_through(out, files::Care::Lasting, packed).map_err(failed)?;
    } else {
        let is_free =
            out.join(BUNDLE_FILE).is_file() || out.read_dir().is_ok_and(|mut entries| entries.next().is_none());
        if out.exists() && !is_free {
            return Err(BundleError::Occupied(out.display().to_string()));
        }
        let copied = |folder: &Path| -> io::Result<()> {
            for name in sums.keys().map(String::as_str).chain([SUMS]) {
                copy(&stage.path().join(name), &folder.join(name))?;
            }
            Ok(())
        };
        files::replace_folder(out, copied).map_err(failed)?;
    }
    let sha256 = hexadecimal(&Sha256::digest(text));
    Ok(Made { place: out.to_owned(), sha256, files: sums.len() + 1, bytes })
}

/// The specs of a run with what they take, each once; all must be what they were.
fn sources(report: &Report, run: &str) -> Result<Vec<Sources>, BundleError> {
    let changed = |what: &str| BundleError::Changed { what: what.to_owned(), run: run.to_owned() };
    let asked = report.cases.iter().filter(|case| !case.is_known);
    let mut all: Vec<Sources> = vec![];
    for (path, cases) in &asked.chunk_by(|case| case.spec.path.clone()) {
        let spec = PathBuf::from(&path);
        let loaded = Case::load_all(&spec, Trust::Own)?;
        let mut sources = Sources { spec: spec.clone(), ..Sources::default() };
        for record in cases {
            let case = loaded.iter().find(|case| case.name == record.name && case.sha256 == record.spec.sha256);
            let case = case.ok_or_else(|| changed(&path))?;
            sources.files.extend(case.files.iter().cloned());
            sources.files.extend(programs(case));
            if let Some(policy) = &record.policy {
                let file = PathBuf::from(&policy.file);
                let hash = digest::of_file(&file).map_err(|e| FileError::of(&file, e))?;
                if hash != policy.sha256 {
                    return Err(changed(&policy.file));
                }
                sources.policy = Some(file);
            }
        }
        all.push(sources);
    }
    Ok(all)
}

/// The files of the programs that a case names as engines.
fn programs(case: &Case) -> Vec<PathBuf> {
    let folder = case.path.parent().unwrap_or(Path::new(""));
    let named = case.engines.iter().flatten().filter(|(_, settings)| settings.0.contains_key("command"));
    // What is wrong with one the run has told.
    named
        .flat_map(|(name, settings)| engines::files_of_program(name, &settings.0, folder).unwrap_or_default())
        .collect()
}

/// Report and readings of a run, by their places in the bundle.
fn of_run(run: &Path) -> Result<BTreeMap<String, PathBuf>, BundleError> {
    let mut places = BTreeMap::new();
    for entry in WalkDir::new(run).sort_by_file_name() {
        let entry = entry.map_err(|e| FileError::of(run, e))?;
        let path = entry.path();
        let is_reading = path.extension().is_some_and(|extension| extension == "json")
            && path.parent().is_some_and(|folder| folder.ends_with("readings"));
        let is_wanted = entry.file_type().is_file() && (is_reading || path == run.join(FILE));
        if let Some(below) = path.strip_prefix(run).ok().filter(|_| is_wanted) {
            let name = name(below).ok_or_else(|| BundleError::Name(path.to_owned()))?;
            places.insert(format!("{RUN}/{name}"), path.to_owned());
        }
    }
    Ok(places)
}

fn lock(report: &Report, request: Request, specs: Vec<String>) -> Lock {
    // A named policy lies where it is found by itself.
    let request = Request { policy: None, ..request };
    let python_lock = |(name, text): (&str, &str)| {
        let sha256 = hexadecimal(&Sha256::digest(text));
        PythonLock { name: name.to_owned(), sha256 }
    };
    Lock {
        luxproof: 1,
        tool: report.tool.clone(),
        command: request.command(&specs),
        request,
        specs,
        engines: report.engines.clone(),
        python_locks: engines::locks().map(python_lock).to_vec(),
    }
}

/// Fills the bundle's folder but for its list of hashes, which is returned with how many bytes they are of.
fn fill(
    stage: &Path,
    places: &BTreeMap<String, PathBuf>,
    report: &Report,
    lock: &Lock,
    licence: Option<&str>,
) -> Result<(Sums, u64), BundleError> {
    let mut parts: BTreeMap<String, (String, u64)> = BTreeMap::new();
    for (name, from) in places {
        let copied = copy(from, &stage.join(name)).map_err(|e| FileError::of(from, e))?;
        parts.insert(name.clone(), copied);
    }
    let mut write = |name: &str, bytes: &[u8]| {
        let path = stage.join(name);
        files::replace(&path, bytes).map_err(|e| FileError::of(&path, e))?;
        parts.insert(name.to_owned(), (hexadecimal(&Sha256::digest(bytes)), bytes.len() as u64));
        Ok::<(), FileError>(())
    };
    let pretty = |value: &serde_json::Value| format!("{value:#}\n");
    write(LOCK, pretty(&serde_json::json!(lock)).as_bytes())?;
    write(README, readme(report, lock).as_bytes())?;
    let described: Vec<Part<'_>> =
        parts.iter().map(|(name, (sha256, bytes))| Part { name, sha256, bytes: *bytes }).collect();
    let description = pretty(&metadata(report, lock, licence, &described));
    let path = stage.join(BUNDLE_FILE);
    files::replace(&path, description.as_bytes()).map_err(|e| FileError::of(&path, e))?;
    parts.insert(BUNDLE_FILE.to_owned(), (hexadecimal(&Sha256::digest(&description)), description.len() as u64));
    let bytes = parts.values().map(|(_, bytes)| bytes).sum();
    Ok((parts.into_iter().map(|(name, (sha256, _))| (name, sha256)).collect(), bytes))
}

fn copy(from: &Path, to: &Path) -> io::Result<(String, u64)> {
    to.parent().map_or(Ok(()), std::fs::create_dir_all)?;
    digest::copy(&mut File::open(from)?, &mut File::create(to)?)
}

/// Reads the specs again where they lie in the bundle: they are what was run, and name nothing out of it.
fn finds_its_files(stage: &Path, lock: &Lock, report: &Report, run: &str) -> Result<(), BundleError> {
    let top = clean(stage);
    for spec in &lock.specs {
        for case in Case::load_all(&stage.join(spec), Trust::Own)? {
            if let Some(file) = case.files.iter().find(|file| !clean(file).starts_with(&top)) {
                return Err(BundleError::Absolute { spec: spec.clone(), file: file.display().to_string() });
            }
            let of_run = report.cases.iter().find(|record| record.name == case.name);
            if of_run.is_some_and(|record| record.spec.sha256 != case.sha256) {
                return Err(BundleError::Changed { what: spec.clone(), run: run.to_owned() });
            }
        }
    }
    Ok(())
}

fn readme(report: &Report, lock: &Lock) -> String {
    let told: Vec<String> = report.sentences.iter().map(|said| format!("- {}: {}\n", said.engine, said.text)).collect();
    format!(
        "# {title}\n\nA run of luxproof {tool} with all that it takes to make it again.\n\n{told}\n\
         | to | |\n|---|---|\n\
         | verify every byte | `sha256sum --check {SUMS}` |\n\
         | verify and run it again | `luxproof reproduce .` |\n\
         | run it as it was | `{command}` |\n\
         | see the report | `luxproof open {RUN}` |\n\n\
         `{BUNDLE_FILE}` describes it (RO-Crate 1.1), its licence, too; `{LOCK}` says which engines ran.\n",
        title = report.spec.title,
        tool = lock.tool,
        told = told.concat(),
        command = lock.command.replace('|', "\\|"),
    )
}
