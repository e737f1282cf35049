//! A plan as a Snakemake workflow that runs unchanged on one machine or on Slurm.

use luxproof_spec::Trust;
use std::fs;
use std::io;
use std::path::{Component, Path, PathBuf};

use serde::Serialize;

use crate::cli::{Audited, Choice, Extent, Narrowed};
use luxproof_process::files::{self, FileError};
use luxproof_process::process::quoted;

const FILES: [(&str, &str); 4] = [
    ("Snakefile", include_str!("snakemake/Snakefile")),
    ("envs/luxproof.yaml", include_str!("snakemake/environment.yaml")),
    ("profiles/local/config.yaml", include_str!("snakemake/profiles/local.yaml")),
    ("profiles/slurm/config.yaml", include_str!("snakemake/profiles/slurm.yaml")),
];

/// The configuration of the workflow.
#[derive(Debug, Serialize)]
struct Config {
    /// Arguments of luxproof: specs, which count from the workflow's folder, and options.
    asked: String,
    /// Options of `luxproof read`: whose the specs are, and where they and the policy lie.
    reading: String,
    /// Where readings go.
    cache: String,
    /// Short jobs are grouped until a group is expected to take so long.
    group_seconds: f64,
    /// Threads that one job may take.
    threads: usize,
}

/// Writes the workflow into a folder.
pub(super) fn emit(
    audited: &Audited,
    trust: Trust,
    threads: usize,
    group_seconds: f64,
    folder: &Path,
) -> Result<(), FileError> {
    let fail = |e: io::Error| FileError::of(folder, e);
    fs::create_dir_all(folder).map_err(fail)?;
    let folder = folder.canonicalize().map_err(fail)?;
    let cache = "cache".to_owned();
    let asked = arguments(audited, trust, &folder).map_err(fail)?;
    let reading = reading(audited, trust, &folder).map_err(fail)?;
    let config = Config { asked, reading, cache, group_seconds, threads };
    for (name, text) in FILES {
        let file = folder.join(name);
        fs::create_dir_all(file.parent().unwrap_or(&folder)).map_err(fail)?;
        files::keep_shared(&file, text.as_bytes())?;
    }
    files::keep_json(&folder.join("config.json"), &config)
}

/// The arguments that ask the same, as a shell reads them in a folder.
fn arguments(audited: &Audited, trust: Trust, folder: &Path) -> io::Result<String> {
    let Choice { engines, narrowed, no_skips, policy, out: _ } = &audited.selected.choice;
    let Narrowed { procedures, filter, seed } = narrowed;
    let Extent { sampling, no_calibration } = &audited.extent;
    let mut words: Vec<String> = mode(trust);
    for spec in &audited.selected.specs {
        words.push(from(folder, spec)?);
    }
    let mut options: Vec<(&str, String)> = vec![];
    if !engines.is_empty() {
        options.push(("engines", engines.join(",")));
    }
    if !procedures.is_empty() {
        options.push(("procedures", procedures.iter().map(ToString::to_string).collect::<Vec<_>>().join(",")));
    }
    options.extend(filter.iter().map(|pattern| ("filter", pattern.clone())));
    options.push(("seed", seed.to_string()));
    if let Some(file) = &policy.file {
        options.push(("policy", from(folder, file)?));
    }
    options.extend(policy.profile.iter().map(|profile| ("profile", profile.clone())));
    options.extend(policy.tolerance_class.map(|class| ("tolerance-class", class.to_string())));
    if let Some(sampling) = sampling {
        options.push(("sampling", sampling.to_string()));
    }
    words.extend(options.into_iter().flat_map(|(name, value)| [format!("--{name}"), value]));
    words.extend(no_skips.then(|| "--no-skips".to_owned()));
    words.extend(no_calibration.then(|| "--no-calibration".to_owned()));
    Ok(words.iter().map(|word| quoted(word)).collect::<Vec<_>>().join(" "))
}

/// Whose the specs are: every command of the workflow says it again.
fn mode(trust: Trust) -> Vec<String> {
    match trust {
        Trust::Own => vec![],
        Trust::Stranger | Trust::Bundled => vec!["--untrusted".to_owned()],
    }
}

/// The options of `luxproof read`: a plan that is not trusted names neither a policy nor files anywhere.
fn reading(audited: &Audited, trust: Trust, folder: &Path) -> io::Result<String> {
    let mut words = mode(trust);
    if trust != Trust::Own {
        words.extend(["--below".to_owned(), from(folder, &common(&audited.selected.specs)?)?]);
        if let Some(file) = &audited.selected.choice.policy.file {
            words.extend(["--policy".to_owned(), from(folder, file)?]);
        }
    }
    Ok(words.iter().map(|word| quoted(word)).collect::<Vec<_>>().join(" "))
}

/// The nearest folder that all specs lie below.
fn common(specs: &[PathBuf]) -> io::Result<PathBuf> {
    let folders = specs.iter().map(|spec| spec_folder(spec)).collect::<io::Result<Vec<_>>>()?;
    let common = folders
        .into_iter()
        .reduce(|a, b| a.ancestors().find(|up| b.starts_with(up)).map(Path::to_owned).unwrap_or_default());
    Ok(common.unwrap_or_default())
}

/// The folder of a spec, of a folder of specs or of a pattern: of a pattern, the part before its first wildcard.
fn spec_folder(spec: &Path) -> io::Result<PathBuf> {
    if spec.is_dir() {
        return spec.canonicalize();
    }
    let parent = spec.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let fixed: PathBuf = parent.components().take_while(is_without_wildcard).collect();
    if fixed.as_os_str().is_empty() { Path::new(".").canonicalize() } else { fixed.canonicalize() }
}

/// Whether a part of a path has no wildcard.
fn is_without_wildcard(part: &Component<'_>) -> bool {
    !part.as_os_str().to_string_lossy().contains(['*', '?', '['])
}

/// A path that leads to the same from a folder.
fn from(folder: &Path, path: &Path) -> io::Result<String> {
    // What is no path but a pattern counts from here.
    let there = path.canonicalize().or_else(|_| std::path::absolute(path))?;
    let shared = folder.components().zip(there.components()).take_while(|(a, b)| a == b).count();
    let up = folder.components().skip(shared).map(|_| Component::ParentDir);
    let whole: PathBuf = up.chain(there.components().skip(shared)).collect();
    let whole = if whole.as_os_str().is_empty() { PathBuf::from(".") } else { whole };
    whole.to_str().map(str::to_owned).ok_or_else(|| io::Error::other(format!("{}: no UTF-8", path.display())))
}
