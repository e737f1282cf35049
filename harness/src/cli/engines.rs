//! `luxproof engines`: which there are, installing them, examining them.

use std::path::{Path, PathBuf};

use clap::Subcommand;
use miette::{IntoDiagnostic, Report as Diagnostic};

use super::diagnostic::not_audited;
use super::views::screen;
use super::{complain, print};
use crate::audit::{self, Options, Subjects};
use crate::engines::{self, InstallOutcome, InstallState, Site, Soundness};
use crate::judge::PolicyChoice;
use crate::plan::Skipping;
use crate::record::{EngineName, EngineStatus, Status};
use crate::report::{Detail, Exit, Report, Style, terminal};
use crate::spec::Trust;
use crate::system::process;

#[derive(Clone, Debug, Subcommand)]
pub(super) enum EnginesAction {
    /// Which engines there are, and their versions
    List,
    /// Which releases can be had side by side, a line each, with what is there of them
    Releases {
        /// Engines by name [default: all]
        names: Vec<String>,
    },
    /// Fetch missing engines into a folder of our own
    Install {
        /// Engines by name, or releases of them as mitsuba@3.5.2 [default: all but those on request: cycles, luxcore, three and babylon]
        names: Vec<String>,
    },
    /// Hold the files of installed engines against the sums that they were installed with
    Verify {
        /// Engines by name [default: all but those on request: cycles, luxcore, three and babylon]
        names: Vec<String>,
    },
    /// Install anew what is broken or absent
    Repair {
        /// Engines by name [default: all but those on request: cycles, luxcore, three and babylon]
        names: Vec<String>,
    },
    /// Let engines read scenes of known answer and judge what they read
    Doctor {
        /// Engines by name [default: all but those on request: cycles, luxcore, three and babylon]
        names: Vec<String>,
        /// The spec whose engines, adapters among them, are examined, too
        #[arg(long, value_name = "FILE")]
        spec: Option<PathBuf>,
        /// A program to examine before any spec names it: what is wrong with its protocol, units, orientation, noise and claims
        #[arg(long, value_name = "CMD", num_args = 1.., allow_hyphen_values = true, conflicts_with_all = ["names", "spec"])]
        adapter: Vec<String>,
        /// Where scenes, readings and logs stay [default: nowhere, unless a log is named]
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
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
        EnginesAction::Releases { names } => {
            known_engines(&names)?;
            for engine in engines::ALL.iter().filter(|e| names.is_empty() || names.iter().any(|n| e.name == *n)) {
                releases(&engine.name, site)?;
            }
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
        EnginesAction::Doctor { names, spec, adapter, out, policy } => {
            let folder = tempfile::tempdir().into_diagnostic()?;
            let options = Options::new(site.clone(), out.clone().unwrap_or_else(|| folder.path().to_owned()));
            let mut options = Options { skipping: Skipping::Nothing, trust, policy, ..options };
            options.selection.engines = names;
            let (report, exit) = match &adapter[..] {
                [] => examine(spec.as_deref(), &options)?,
                _ if trust == Trust::Stranger => {
                    return Err(miette::miette!(
                        "--adapter starts a program, and --untrusted or LUXPROOF_UNTRUSTED starts none"
                    ));
                }
                words => examine_adapter(words, options)?,
            };
            // Logs that were named stay where they are.
            if out.is_none() && report.engines.iter().any(|e| e.status == Status::Failed) {
                drop(folder.keep());
            }
            Ok(exit)
        }
    }
}

fn releases(engine: &EngineName, site: &Site) -> Result<(), Diagnostic> {
    for release in engines::releases_of(engine) {
        let name = format!("{engine}@{release}");
        let Ok(Some(built_in)) = engines::built_in(&name) else { continue };
        print(&match built_in.probe(site) {
            Ok(version) => format!("{name:<18} {}\n", version.text),
            Err(absent) => format!("{name:<18} absent: {absent}\n"),
        })?;
    }
    Ok(())
}

fn examine(spec: Option<&Path>, options: &Options<'_>) -> Result<(Report, Exit), Diagnostic> {
    let subjects = spec.map_or(Subjects::Ours, Subjects::OfSpec);
    let report = audit::examine(subjects, options).map_err(not_audited)?;
    print(&terminal(&report, screen(Style::Plain, Detail::Brief), None))?;
    print(&format!("sandbox of engines: {}\n", process::sandbox_in_words()))?;
    print(&format!("memory of an engine: {} MiB at most\n", process::limit_mib()))?;
    let is_absent = |e: &EngineStatus| e.status == Status::Absent;
    let exit = report.exit().max(if report.engines.iter().any(is_absent) { Exit::Engine } else { Exit::Passed });
    Ok((report, exit))
}

fn examine_adapter(words: &[String], options: Options<'_>) -> Result<(Report, Exit), Diagnostic> {
    let command = match words {
        // A command as it is typed.
        [line] if !Path::new(line).is_file() => shlex::split(line).filter(|words| !words.is_empty()),
        words => Some(words.to_vec()),
    };
    let command = command.ok_or_else(|| miette::miette!("--adapter must be a program and its arguments"))?;
    let folder = std::env::current_dir().into_diagnostic()?;
    let (report, conformance) = audit::examine_adapter(&command, &folder, options).map_err(not_audited)?;
    print(&terminal(&report, screen(Style::Plain, Detail::Brief), None))?;
    print(&format!("\n{conformance}"))?;
    let exit = conformance.exit(&report);
    Ok((report, exit))
}

pub(super) fn known_engines(names: &[String]) -> Result<(), Diagnostic> {
    engines::all_built_in(names).map_err(|unknown| miette::miette!(help = unknown.help, "{}", unknown.message))
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
                let repair = [&["luxproof engines repair".to_owned()], names].concat().join(" ");
                format!("broken; run `{repair}`\n    {}", faults.join("\n    "))
            }
        };
        print(&format!("{component}: {text}\n"))?;
    }
    Ok(exit)
}

/// The engines that are named, or all but those that want to be named.
fn wanted(names: &[String]) -> Vec<EngineName> {
    if !names.is_empty() {
        return names.iter().map(EngineName::from).collect();
    }
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
