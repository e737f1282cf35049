//! What `bench` and `stress` share on the command line: engines to take, the reader, a bar with the time left.

use luxproof_process::files;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use miette::{IntoDiagnostic, Report as Diagnostic};

use super::engines::known_engines;
use super::last_run::RUNS;
use luxproof_audit::measure::cache::Cache;
use luxproof_audit::measure::{self, Instrument, Isolation, Machine, Reader};
use luxproof_engines::EngineRoot;
use luxproof_lab::Progress;
use luxproof_model::Exit;
use luxproof_process::output_lock::OutputLock;
use luxproof_process::process;
use luxproof_spec::Trust;

/// What is measured, by how much of the machine at a time, and where it is kept.
#[derive(Debug, Args)]
pub(super) struct MeasuringArgs {
    /// Spec files, folders of specs, or patterns
    #[arg(required = true, value_name = "SPEC")]
    pub(super) specs: Vec<PathBuf>,
    /// Measure only these engines [default: all installed]
    #[arg(long, value_delimiter = ',', value_name = "NAMES")]
    engines: Vec<String>,
    /// Threads or processes [default: one per core]
    #[arg(long, value_name = "N", value_parser = super::at_least_one)]
    jobs: Option<usize>,
    /// Seed of all random choices
    #[arg(long, default_value_t = 1)]
    pub(super) seed: u64,
    /// Folder to write [default: in luxproof-out]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

impl MeasuringArgs {
    /// The engines that were named, or all that are there; one that was named and is absent is an error.
    pub(super) fn subjects(&self, site: &EngineRoot) -> Result<Vec<Instrument>, Diagnostic> {
        known_engines(&self.engines)?;
        let mut present = vec![];
        let by_default =
            luxproof_engines::all().into_iter().filter(|e| luxproof_engines::is_chosen(&e.name(), &self.engines));
        let releases = self.engines.iter().filter(|name| name.contains('@'));
        let releases = releases.filter_map(|name| luxproof_engines::built_in(name).ok().flatten());
        for engine in by_default.chain(releases) {
            match engine.probe(site) {
                Ok(version) => present.push(Instrument { engine: engine.into(), version }),
                Err(absent) if !self.engines.is_empty() => return Err(miette::miette!("{}: {absent}", engine.name())),
                Err(absent) => super::complain(&format!("{}: {absent}", engine.name())),
            }
        }
        Ok(present)
    }

    /// Keeps readings in the measurement's own folder and runs our own solvers in processes of this program.
    pub(super) fn reader(&self, site: &EngineRoot, folder: &Path) -> Result<Reader, Diagnostic> {
        let machine = Machine::new(self.jobs.unwrap_or_else(process::cores));
        let isolation = Isolation::Subprocess(std::env::current_exe().into_diagnostic()?);
        let cache = Some(Cache::at(folder.join("readings")));
        cache.iter().for_each(Cache::sweep);
        Ok(Reader { cache, isolation, ..Reader::bare(site, machine) })
    }

    /// Locks the folder of a measurement. Where the specs are a stranger's, no link leads to it, nor lies in it.
    pub(super) fn claim(folder: &Path, trust: Trust) -> Result<OutputLock, Diagnostic> {
        let claim = if trust == Trust::Own { OutputLock::of } else { OutputLock::of_plain_folder };
        claim(folder).into_diagnostic()
    }

    /// The folder of a measurement's files: the one given, or `luxproof-out/<command>/<spec name>`.
    pub(super) fn folder(&self, command: &str, spec: &Path) -> PathBuf {
        let name = files::stem(spec).unwrap_or(Path::new("suite"));
        self.out.clone().unwrap_or_else(|| Path::new(RUNS).join(command).join(name))
    }
}

pub(super) fn read_one(site: &EngineRoot) -> Result<Exit, Diagnostic> {
    let mut text = String::new();
    std::io::stdin().read_to_string(&mut text).into_diagnostic()?;
    let request = serde_json::from_str(&text).into_diagnostic()?;
    let _under_way = process::UnderWay::begin();
    let taken = measure::answer(&request, site).map_err(|e| miette::miette!("{e}"))?;
    super::print(&serde_json::to_string(&taken).into_diagnostic()?)?;
    Ok(Exit::Passed)
}

/// A bar over things to do, with the time left by what they are expected to take.
pub(super) struct Bar(ProgressBar);

impl Bar {
    pub(super) fn new() -> Self {
        let bar = ProgressBar::new(0);
        if let Ok(style) = ProgressStyle::with_template("{bar:20} {pos}/{len} [{elapsed}, {eta} left] {wide_msg}") {
            bar.set_style(style);
        }
        bar.enable_steady_tick(Duration::from_millis(500));
        Self(bar)
    }
}

impl Progress for Bar {
    fn planned(&self, steps: u64) {
        self.0.inc_length(steps);
    }

    fn ended(&self, what: String, steps: u64) {
        self.0.set_message(what);
        self.0.inc(steps);
    }
}
