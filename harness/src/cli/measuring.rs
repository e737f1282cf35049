//! What `bench` and `stress` share on the command line: engines to take, the laboratory, a bar with the time left.

use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};
use miette::{IntoDiagnostic, Report as Diagnostic};

use super::engines::known_engines;
use crate::engines::{self, Site};
use crate::measure::{self, Laboratory, OwnSolvers, Subject};
use crate::report::Exit;

/// The engines that were named, or all that are there; one that was named and is absent is an error.
pub(super) fn subjects(names: &[String], site: &Site) -> Result<Vec<Subject>, Diagnostic> {
    known_engines(names)?;
    let mut present = vec![];
    for engine in engines::all() {
        let is_named = names.iter().any(|n| engine.name() == *n);
        if !names.is_empty() && !is_named {
            continue;
        }
        match engine.probe(site) {
            Ok(version) => present.push(Subject { engine, version: version.0 }),
            Err(absent) if is_named => return Err(miette::miette!("{}: {absent}", engine.name())),
            Err(absent) => eprintln!("{}: {absent}", engine.name()),
        }
    }
    Ok(present)
}

/// A laboratory that runs our own solvers in processes of this program.
pub(super) fn laboratory(site: &Site) -> Result<Laboratory, Diagnostic> {
    let own_solvers = OwnSolvers::Apart(std::env::current_exe().into_diagnostic()?);
    Ok(Laboratory { site: site.clone(), own_solvers })
}

/// The folder of a measurement's files: the one given, or `luxproof-out/<command>/<spec name>`.
pub(super) fn folder(out: Option<&PathBuf>, command: &str, spec: &Path) -> PathBuf {
    let name = spec.file_stem().map_or(Path::new("suite"), Path::new);
    out.cloned().unwrap_or_else(|| Path::new("luxproof-out").join(command).join(name))
}

/// The hidden command that takes one reading for another process of this program.
pub(super) fn read_one(site: &Site) -> Result<Exit, Diagnostic> {
    let mut text = String::new();
    std::io::stdin().read_to_string(&mut text).into_diagnostic()?;
    let request = serde_json::from_str(&text).into_diagnostic()?;
    let outcome = measure::answer(&request, site).map_err(|e| miette::miette!("{e}"))?;
    super::print(&serde_json::to_string(&outcome).into_diagnostic()?)?;
    Ok(Exit::Passed)
}

/// A bar over things to do, with the time left by what they are expected to take.
pub(super) struct Bar {
    bar: ProgressBar,
    planned: AtomicU64,
}

impl Bar {
    pub(super) fn new() -> Self {
        let bar = ProgressBar::new(0);
        let style = "{bar:30} {pos}/{len} {msg} [{elapsed}, {eta} left]";
        if let Ok(style) = ProgressStyle::with_template(style) {
            bar.set_style(style);
        }
        bar.enable_steady_tick(Duration::from_millis(500));
        Self { bar, planned: AtomicU64::new(0) }
    }

    pub(super) fn planned(&self, things: usize) {
        self.planned.fetch_add(things as u64, Ordering::Relaxed);
        self.bar.set_length(self.planned.load(Ordering::Relaxed));
    }

    pub(super) fn ended(&self, what: String) {
        self.ended_part(what, 1);
    }

    pub(super) fn ended_part(&self, what: String, parts: u64) {
        self.bar.set_message(what);
        self.bar.inc(parts);
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
