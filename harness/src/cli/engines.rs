//! `luxproof engines`: which there are, installing them, examining them.

use std::path::{Path, PathBuf};

use clap::Subcommand;
use miette::{IntoDiagnostic, Report as Diagnostic};

use super::diagnostic::not_audited;
use super::views::screen;
use super::{complain, print};
use crate::audit::{self, Options};
use crate::engines::{self, InstallOutcome, InstallState, Site, Soundness};
use crate::judge::PolicyChoice;
use crate::plan::Skipping;
use crate::record::{EngineName, EngineStatus, Status};
use crate::report::{Detail, Exit, Style, terminal};
use crate::spec::{Trust, suggestion};
use crate::system::process;

#[derive(Clone, Debug, Subcommand)]
pub(super) enum EnginesAction {
    /// Which engines there are, and their versions
    List,
    /// Fetch missing engines into a folder of our own
    Install {
        /// Engines by name [default: all but cycles and luxcore]
        names: Vec<String>,
    },
    /// Hold the files of installed engines against the sums that they were installed with
    Verify {
        /// Engines by name [default: all but cycles and luxcore]
        names: Vec<String>,
    },
    /// Install anew what is broken or absent
    Repair {
        /// Engines by name [default: all but cycles and luxcore]
        names: Vec<String>,
    },
    /// Let engines read scenes of known answer and judge what they read
    Doctor {
        /// Engines by name [default: all but cycles and luxcore]
        names: Vec<String>,
        /// The spec whose engines, adapters among them, are examined, too
        #[arg(long, value_name = "FILE")]
        spec: Option<PathBuf>,
        #[command(flatten)]
        policy: PolicyChoice,
    },
}

pub(super) fn manage_engines(action: Option<EnginesAction>, site: &Site, trust: Trust) -> Result<Exit, Diagnostic> {
    match action.unwrap_or(EnginesAction::List) {
        EnginesAction::List => {
            for engine in engines::all() {
                print(&match engine.probe(site) {
                    Ok(version) => format!("{:<10} {}\n", engine.name(), version.text),
                    Err(absent) => format!("{:<10} absent: {absent}\n", engine.name()),
                })?;
            }
            print(&format!("engines are kept in {}\n", site.root().display()))?;
            Ok(Exit::Passed)
        }
        EnginesAction::Install { names } => {
            known_engines(&names)?;
            Ok(report_installation(site, &names))
        }
        EnginesAction::Verify { names } => {
            known_engines(&names)?;
            verify(site, &names)
        }
        EnginesAction::Repair { names } => {
            known_engines(&names)?;
            Ok(told(&engines::repair(site, &wanted(&names), complain)))
        }
        EnginesAction::Doctor { names, spec, policy } => {
            let folder = tempfile::tempdir().into_diagnostic()?;
            let options = Options::new(site.clone(), folder.path().to_owned());
            let mut options = Options { skipping: Skipping::Nothing, trust, policy, ..options };
            options.selection.engines = names;
            examine(spec.as_deref(), &options)
        }
    }
}

fn examine(spec: Option<&Path>, options: &Options<'_>) -> Result<Exit, Diagnostic> {
    let report = audit::examine(spec, options).map_err(not_audited)?;
    print(&terminal(&report, screen(Style::Plain, Detail::Brief), None))?;
    print(&format!("sandbox of engines: {}\n", process::sandbox_in_words()))?;
    print(&format!("memory of an engine: {} MiB at most\n", process::limit_mib()))?;
    let is_absent = |e: &EngineStatus| e.status == Status::Absent;
    Ok(report.exit().max(if report.engines.iter().any(is_absent) { Exit::Engine } else { Exit::Passed }))
}

pub(super) fn known_engines(names: &[String]) -> Result<(), Diagnostic> {
    let known: Vec<EngineName> = engines::all().iter().map(|e| e.name()).collect();
    let Some(name) = names.iter().find(|name| !known.iter().any(|k| k == *name)) else { return Ok(()) };
    let help = suggestion(name, known.iter().map(EngineName::as_str));
    Err(miette::miette!(help = help, "there is no engine `{name}`"))
}

/// What is broken fails; what is absent was not asked for.
fn verify(site: &Site, names: &[String]) -> Result<Exit, Diagnostic> {
    let mut exit = Exit::Passed;
    for (component, soundness) in engines::verify(site, &wanted(names)) {
        let text = match soundness {
            Soundness::Sound(files) => format!("sound, {files} files"),
            Soundness::Absent => "not installed".to_owned(),
            Soundness::Unknown(why) => format!("not known: {why}"),
            Soundness::Broken(faults) => {
                exit = Exit::Engine;
                format!("broken; run `luxproof engines repair`\n    {}", faults.join("\n    "))
            }
        };
        print(&format!("{component}: {text}\n"))?;
    }
    Ok(exit)
}

/// The engines that are named, or all but those that want to be named.
fn wanted(names: &[String]) -> Vec<EngineName> {
    engines::all().into_iter().map(|e| e.name()).filter(|e| engines::is_chosen(e, names)).collect()
}

/// Installs the engines that are named, or all.
pub(super) fn report_installation(site: &Site, names: &[String]) -> Exit {
    told(&engines::install(site, &wanted(names), complain))
}

fn told(outcomes: &[InstallOutcome]) -> Exit {
    for outcome in outcomes {
        complain(&format!("{}: {}", outcome.component, outcome.detail));
    }
    let failed = outcomes.iter().any(|o| o.state == InstallState::Failed);
    if failed { Exit::Engine } else { Exit::Passed }
}
