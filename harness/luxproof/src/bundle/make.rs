//! Making a bundle of a run's folder.

use luxproof_model::ForeignPath;
use luxproof_process::files::clean;
use luxproof_spec::Faults;
use std::collections::{BTreeMap, BTreeSet};
use std::fs::{File, Permissions};
use std::io;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

use itertools::Itertools;
use sha2::{Digest, Sha256};
use walkdir::WalkDir;

use super::inputs::{Layout, Sources, name};
use super::pack::{is_program, pack};
use super::ro_crate::{Part, metadata};
use super::sums::{self, Sums};
use super::{BundleError, LOCK, Lock, PythonLock, RUN, SUMS};
use luxproof_model::REPORT_FILE;
use luxproof_model::{Report, Request};
use luxproof_process::digest::{self, hexadecimal};
use luxproof_process::files::{self, FileError, MAX_KEPT_BYTES, read_bounded};
use luxproof_process::printable::quoted_path;
use luxproof_spec::Resolve;
use luxproof_spec::{BUNDLE_FILE, Case, Trust};

const README: &str = "README.md";

/// A bundle that was made.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BundleSummary {
    pub place: PathBuf,
    /// SHA-256 of its list of hashes, which is that of all its bytes.
    pub sha256: String,
    pub files: usize,
    pub bytes: u64,
    /// The places of the specs in the bundle, in the order of the report.
    pub specs: Vec<String>,
    /// Files beside those of programs that no command names and no program imports: whether these need them is not known.
    pub not_bundled: Vec<PathBuf>,
}

/// Bundles the run in a folder, into another folder or, where its name ends so, into a `.zip`. Specs are looked for where the report says that they
/// were given.
///
/// A report of a stranger names specs and policies below the current folder alone.
pub fn make(run: &Path, out: &Path, licence: Option<&str>, trust: Trust) -> Result<BundleSummary, BundleError> {
    let shown = run.display().to_string();
    let file = run.join(REPORT_FILE);
    trust.check_given(&file).map_err(|e| FileError::of(&file, e))?;
    let report = luxproof_report_file::read(&file)?;
    let request = report.request.clone().ok_or_else(|| BundleError::NoRequest { run: shown.clone() })?;
    let sources = sources(&report, &shown, trust)?;
    let Layout { mut places, specs } = Layout::of(&sources)?;
    let not_bundled = not_bundled(&sources, &places);
    if specs.is_empty() {
        return Err(BundleError::NoSpec { run: shown });
    }
    places.extend(of_run(run)?);
    let lock = lock(&report, request, specs);
    let failed = |e: io::Error| FileError::of(out, e);
    let stage = tempfile::tempdir().map_err(failed)?;
    let (sums, bytes) = fill(stage.path(), &places, &report, &lock, licence)?;
    finds_its_files(stage.path(), &lock, &report, &shown, trust)?;
    let text = sums::text(&sums);
    files::replace(&stage.path().join(SUMS), text.as_bytes()).map_err(failed)?;
    if out.extension().is_some_and(|extension| extension == "zip") {
        files::replace_through(out, files::Durability::Lasting, |file: &mut File| {
            pack(stage.path(), &sums, file).map_err(io::Error::other)
        })
        .map_err(failed)?;
    } else {
        refuse_other_files(out)?;
        files::replace_folder(out, |folder| copy_all(stage.path(), &sums, folder)).map_err(failed)?;
    }
    let sha256 = hexadecimal(&Sha256::digest(text));
    Ok(BundleSummary { place: out.to_owned(), sha256, files: sums.len() + 1, bytes, specs: lock.specs, not_bundled })
}

/// Refuses a folder with any file that no list of hashes there names: only a bundle is replaced.
fn refuse_other_files(folder: &Path) -> Result<(), BundleError> {
    if folder.exists() && !folder.is_dir() {
        return Err(FileError::of(folder, io::Error::from(io::ErrorKind::NotADirectory)).into());
    }
    let listed = read_bounded(&folder.join(SUMS), MAX_KEPT_BYTES).ok().and_then(|text| String::from_utf8(text).ok());
    let listed = listed.and_then(|text| sums::parse(&text)).unwrap_or_default();
    for entry in WalkDir::new(folder).min_depth(1).into_iter().flatten().filter(|entry| !entry.file_type().is_dir()) {
        let name = entry.path().strip_prefix(folder).ok().and_then(name);
        let is_listed = name.is_some_and(|name| listed.contains_key(&name) || (name == SUMS && !listed.is_empty()));
        if !is_listed {
            let file = quoted_path(entry.path().strip_prefix(folder).unwrap_or(entry.path()));
            return Err(BundleError::Occupied { folder: quoted_path(folder), file });
        }
    }
    Ok(())
}

/// Copies every file of a bundle, its list of hashes included, to a folder.
fn copy_all(stage: &Path, sums: &Sums, folder: &Path) -> io::Result<()> {
    for name in sums.keys().map(String::as_str).chain([SUMS]) {
        copy(&stage.join(name), &folder.join(name))?;
    }
    Ok(())
}

/// Resolves a path that a report names, below the current folder where the report is a stranger's.
fn resolve_named(path: &str, trust: Trust) -> Result<PathBuf, Faults> {
    ForeignPath::from(PathBuf::from(path)).resolve(trust, Path::new("")).map_err(Faults::from)
}

/// The place of each spec of a report in its bundle, by the path that the run was given. `places` are in the order of the report.
pub fn spec_places(report: &Report, places: &[String]) -> BTreeMap<String, String> {
    let asked = report.cases.iter().filter(|case| !case.is_calibration);
    asked.map(|case| case.spec.path.clone()).dedup().zip(places.iter().cloned()).collect()
}

/// The specs of a run with what they take, each once; all must be what they were.
fn sources(report: &Report, run: &str, trust: Trust) -> Result<Vec<Sources>, BundleError> {
    let changed = |what: &str| BundleError::Changed { what: what.to_owned(), run: run.to_owned() };
    let asked = report.cases.iter().filter(|case| !case.is_calibration);
    let mut all: Vec<Sources> = vec![];
    for (path, cases) in &asked.chunk_by(|case| case.spec.path.clone()) {
        let spec = resolve_named(&path, trust)?;
        let loaded = Case::load_all(&spec, trust)?;
        let mut sources = Sources { spec: spec.clone(), ..Sources::default() };
        for record in cases {
            let case = loaded.iter().find(|case| case.name == record.name && case.sha256 == record.spec.sha256);
            let case = case.ok_or_else(|| changed(&path))?;
            sources.files.extend(case.files.iter().cloned());
            let programs = programs(case);
            sources.files.extend(programs.iter().cloned());
            sources.programs.extend(programs);
            if let Some(policy) = &record.policy {
                let file = resolve_named(&policy.file, trust)?;
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

/// Regular files in the folders of programs that are not bundled: a program may need them, and nothing says so.
fn not_bundled(sources: &[Sources], places: &BTreeMap<String, PathBuf>) -> Vec<PathBuf> {
    let bundled: BTreeSet<PathBuf> = places.values().map(|path| clean(path)).collect();
    let programs = sources.iter().flat_map(|sources| &sources.programs);
    let folders: BTreeSet<PathBuf> = programs.filter_map(|file| clean(file).parent().map(Path::to_owned)).collect();
    let files = folders.iter().flat_map(|folder| folder.read_dir().into_iter().flatten().flatten());
    let files = files.filter(|entry| entry.file_type().is_ok_and(|kind| kind.is_file())).map(|entry| entry.path());
    let others: BTreeSet<PathBuf> = files.filter(|file| !bundled.contains(file)).collect();
    others.into_iter().collect()
}

/// The files of the programs that a case names as engines.
fn programs(case: &Case) -> Vec<PathBuf> {
    let folder = case.path.parent().unwrap_or(Path::new(""));
    let named = case.engines.iter().flatten().filter(|(_, settings)| settings.0.contains_key("command"));
    // The run has reported a faulty program.
    named
        .flat_map(|(name, settings)| luxproof_engines::files_of_program(name, &settings.0, folder).unwrap_or_default())
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
        let is_wanted = entry.file_type().is_file() && (is_reading || path == run.join(REPORT_FILE));
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
    let python_locks = luxproof_engines::locks()
        .map(|(name, text)| PythonLock { name: name.to_owned(), sha256: hexadecimal(&Sha256::digest(text)) });
    Lock {
        luxproof: 1,
        tool: report.tool.clone(),
        command: request.command(&specs),
        request,
        specs,
        engines: report.engines.clone(),
        python_locks: python_locks.to_vec(),
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
    let lock_text = format!("{:#}\n", serde_json::json!(lock));
    parts.insert(LOCK.to_owned(), write_part(stage, LOCK, &lock_text)?);
    parts.insert(README.to_owned(), write_part(stage, README, &readme(report, lock))?);
    let described: Vec<Part<'_>> =
        parts.iter().map(|(name, (sha256, bytes))| Part { name, sha256, bytes: *bytes }).collect();
    let description = format!("{:#}\n", metadata(report, lock, licence, &described));
    let description = write_part(stage, BUNDLE_FILE, &description)?;
    parts.insert(BUNDLE_FILE.to_owned(), description);
    let bytes = parts.values().map(|(_, bytes)| bytes).sum();
    Ok((parts.into_iter().map(|(name, (sha256, _))| (name, sha256)).collect(), bytes))
}

/// Writes a file of the bundle; its hash and its size.
fn write_part(stage: &Path, name: &str, text: &str) -> Result<(String, u64), FileError> {
    let path = stage.join(name);
    files::replace(&path, text.as_bytes()).map_err(|e| FileError::of(&path, e))?;
    Ok((hexadecimal(&Sha256::digest(text)), text.len() as u64))
}

/// Copies a file and its right to be executed.
fn copy(from: &Path, to: &Path) -> io::Result<(String, u64)> {
    to.parent().map_or(Ok(()), std::fs::create_dir_all)?;
    let (mut from, mut to) = (File::open(from)?, File::create(to)?);
    let copied = digest::copy(&mut from, &mut to)?;
    if is_program(from.metadata()?.permissions().mode()) {
        // All who may read it may run it, as the user's mask has it.
        let mode = to.metadata()?.permissions().mode();
        to.set_permissions(Permissions::from_mode(mode | ((mode & 0o444) >> 2)))?;
    }
    Ok(copied)
}

/// Reads the specs again where they lie in the bundle: they are what was run, and name nothing out of it.
fn finds_its_files(stage: &Path, lock: &Lock, report: &Report, run: &str, trust: Trust) -> Result<(), BundleError> {
    let (top, trust) = (clean(stage), if trust == Trust::Own { trust } else { Trust::Bundled });
    for spec in &lock.specs {
        for case in Case::load_all(&stage.join(spec), trust)? {
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
    let sentences: Vec<String> =
        report.sentences.iter().map(|sentence| format!("- {}: {}\n", sentence.engine, sentence.text)).collect();
    format!(
        "# {title}\n\nA run of luxproof {tool} with all that it takes to make it again.\n\n{sentences}\n\
         | to | |\n|---|---|\n\
         | verify every byte | `sha256sum --check {SUMS}` |\n\
         | verify and run it again | `luxproof reproduce .` |\n\
         | run it as it was | `{command}` |\n\
         | see the report | `luxproof open {RUN}` |\n\n\
         `{BUNDLE_FILE}` describes it (RO-Crate 1.1), its licence, too; `{LOCK}` says which engines ran.\n",
        title = report.spec.title,
        tool = lock.tool,
        sentences = sentences.concat(),
        command = lock.command.replace('|', "\\|"),
    )
}
