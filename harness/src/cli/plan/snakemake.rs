//! A plan as a Snakemake workflow that runs unchanged on one machine or on Slurm.

use std::fs;
use std::io;
use std::path::{Component, Path, PathBuf};

use serde::Serialize;

use crate::cli::{Audited, Choice, Extent, Narrowed};
use crate::system::files::{self, FileError};
use crate::system::process::quoted;

const FILES: [(&str, &str); 4] = [
    ("Snakefile", include_str!("snakemake/Snakefile")),
    ("envs/luxproof.yaml", include_str!("snakemake/environment.yaml")),
    ("profiles/local/config.yaml", include_str!("snakemake/profiles/local.yaml")),
    ("profiles/slurm/config.yaml", include_str!("snakemake/profiles/slurm.yaml")),
];

/// What the workflow is told.
#[derive(Debug, Serialize)]
struct Config {
    /// Arguments of luxproof: specs, which count from the workflow's folder, and options.
    asked: String,
    /// Where readings go.
    cache: String,
    /// Short jobs are grouped until a group is expected to take so long.
    group_seconds: f64,
    /// Threads that one job may take.
    threads: usize,
}

/// Writes the workflow into a folder.
pub(super) fn emit(audited: &Audited, threads: usize, group_seconds: f64, folder: &Path) -> Result<(), FileError> {
    let fail = |e: io::Error| FileError::of(folder, e);
    fs::create_dir_all(folder).map_err(fail)?;
    let folder = folder.canonicalize().map_err(fail)?;
    let cache = "cache".to_owned();
    let config = Config { asked: arguments(audited, &folder).map_err(fail)?, cache, group_seconds, threads };
    for (name, text) in FILES {
        let file = folder.join(name);
        fs::create_dir_all(file.parent().unwrap_or(&folder)).map_err(fail)?;
        files::keep_shared(&file, text.as_bytes())?;
    }
    files::keep_json(&folder.join("config.json"), &config)
}

/// The arguments that ask the same, as a shell reads them in a folder.
fn arguments(audited: &Audited, folder: &Path) -> io::Result<String> {
    let Choice { engines, narrowed, no_skips, policy, out: _ } = &audited.selected.choice;
    let Narrowed { procedures, filter, seed } = narrowed;
    let Extent { sampling, no_calibration } = &audited.extent;
    let mut words: Vec<String> = vec![];
    for spec in &audited.selected.specs {
        words.push(from(folder, spec)?);
    }
    let mut option = |name: &str, value: String| words.extend([format!("--{name}"), value]);
    if !engines.is_empty() {
        option("engines", engines.join(","));
    }
    if !procedures.is_empty() {
        option("procedures", procedures.iter().map(ToString::to_string).collect::<Vec<_>>().join(","));
    }
    for pattern in filter {
        option("filter", pattern.clone());
    }
    option("seed", seed.to_string());
    if let Some(file) = &policy.file {
        option("policy", from(folder, file)?);
    }
    if let Some(profile) = &policy.profile {
        option("profile", profile.clone());
    }
    if let Some(class) = policy.tolerance_class {
        option("tolerance-class", class.to_string());
    }
    if let Some(sampling) = sampling {
        option("sampling", sampling.to_string());
    }
    words.extend(no_skips.then(|| "--no-skips".to_owned()));
    words.extend(no_calibration.then(|| "--no-calibration".to_owned()));
    Ok(words.iter().map(|word| quoted(word)).collect::<Vec<_>>().join(" "))
}

/// A path that leads to the same from a folder.
fn from(folder: &Path, path: &Path) -> io::Result<String> {
    // What is no path but a pattern counts from here.
    let there = path.canonicalize().or_else(|_| std::path::absolute(path))?;
    let shared = folder.components().zip(there.components()).take_while(|(a, b)| a == b).count();
    let up = folder.components().skip(shared).map(|_| Component::ParentDir);
    let whole: PathBuf = up.chain(there.components().skip(shared)).collect();
    whole.to_str().map(str::to_owned).ok_or_else(|| io::Error::other(format!("{}: no UTF-8", path.display())))
}
