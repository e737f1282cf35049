//! `luxproof engines`: which there are, installing them, examining them.

use std::path::{Path, PathBuf};

use clap::Subcommand;
use miette::{IntoDiagnostic, Report as Diagnostic};

use super::not_audited;
use super::views::screen;
use luxproof_audit::plan::Skipping;
use luxproof_audit::{Options, Subjects};
use luxproof_console::{complain, print};
use luxproof_engines::{EngineRoot, InstallOutcome, InstallState, Soundness};
use luxproof_model::{EngineName, Status};
use luxproof_model::{Exit, Report};
use luxproof_process::process;
use luxproof_report::{Detail, Style, terminal};
use luxproof_spec::Trust;
use luxproof_verdict::PolicyChoice;

#[derive(Clone, Debug, Subcommand)]
pub(super) enum EnginesAction {
    /// List engines with their versions
    List,
    /// List the releases that can be installed next to each other
    Releases {
        /// Engines [default: all]
        names: Vec<String>,
    },
    /// Install missing engines
    Install {
        /// Engines or releases such as mitsuba@3.5.2 [default: mitsuba, radiance, povray]
        names: Vec<String>,
    },
    /// Compare installed files with their checksums
    Verify {
        /// Engines [default: mitsuba, radiance, povray]
        names: Vec<String>,
    },
    /// Install broken or missing parts again
    Repair {
        /// Engines [default: mitsuba, radiance, povray]
        names: Vec<String>,
    },
    /// Run test scenes with known results on engines or on your adapter
    Doctor {
        /// Engines [default: mitsuba, radiance, povray]
        names: Vec<String>,
        /// Also examine the engines and adapters of this spec
        #[arg(long, value_name = "FILE")]
        spec: Option<PathBuf>,
        /// Examine a program, with its arguments in quotes: its protocol, units, orientation, noise and claims
        #[arg(long, value_name = "CMD", conflicts_with = "spec")]
        adapter: Option<String>,
        /// Folder of scenes, values and logs [default: they are removed]
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
        #[command(flatten)]
        policy: PolicyChoice,
    },
}

pub(super) fn manage_engines(
    action: Option<EnginesAction>,
    site: &EngineRoot,
    trust: Trust,
) -> Result<Exit, Diagnostic> {
    match action.unwrap_or(EnginesAction::List) {
        EnginesAction::List => {
            for engine in luxproof_engines::all() {
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
            for engine in
                luxproof_engines::ALL.iter().filter(|e| names.is_empty() || names.iter().any(|n| e.name == *n))
            {
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
            Ok(report_outcomes(&luxproof_engines::repair(site, &wanted(&names), complain)))
        }
        EnginesAction::Doctor { names, spec, adapter, out, policy } => {
            let folder = tempfile::tempdir().into_diagnostic()?;
            let options = super::audit_options(site.clone(), out.clone().unwrap_or_else(|| folder.path().to_owned()));
            let mut options = Options { skipping: Skipping::Nothing, trust, policy, ..options };
            let (report, exit) = match adapter {
                None => {
                    options.selection.engines = names;
                    examine(spec.as_deref(), &options)?
                }
                Some(_) if trust == Trust::Stranger => {
                    return Err(miette::miette!(
                        "--adapter starts a program, and --untrusted or LUXPROOF_UNTRUSTED starts none"
                    ));
                }
                Some(command) if !names.is_empty() => {
                    let whole = [&[command][..], &names].concat().join(" ");
                    return Err(miette::miette!(
                        help = format!("write the command and its arguments in quotes: --adapter \"{whole}\""),
                        "--adapter takes one program, and `{}` follows it",
                        names.join(" ")
                    ));
                }
                Some(command) => examine_adapter(&command, options)?,
            };
            // Logs that were named stay where they are.
            if out.is_none() && report.engines.iter().any(|e| e.status == Status::Failed) {
                drop(folder.keep());
            }
            Ok(exit)
        }
    }
}

fn releases(engine: &EngineName, site: &EngineRoot) -> Result<(), Diagnostic> {
    for release in luxproof_engines::releases_of(engine) {
        let name = format!("{engine}@{release}");
        let Ok(Some(built_in)) = luxproof_engines::built_in(&name) else { continue };
        print(&match built_in.probe(site) {
            Ok(version) => format!("{name:<18} {}\n", version.text),
            Err(absent) => format!("{name:<18} absent: {absent}\n"),
        })?;
    }
    Ok(())
}

fn examine(spec: Option<&Path>, options: &Options<'_>) -> Result<(Report, Exit), Diagnostic> {
    let subjects = spec.map_or(Subjects::Ours, Subjects::OfSpec);
    let report = luxproof_audit::examine(subjects, options).map_err(not_audited)?;
    print(&terminal(&report, screen(Style::Plain, Detail::All), None))?;
    print(&format!("sandbox of engines: {}\n", process::sandbox_in_words()))?;
    print(&format!("memory of an engine: {} MiB at most\n", process::limit_mib()))?;
    let lacks_some = report.engines.iter().any(|engine| engine.status == Status::Absent);
    let exit = report.exit().max(if lacks_some { Exit::Engine } else { Exit::Passed });
    Ok((report, exit))
}

fn examine_adapter(command: &str, options: Options<'_>) -> Result<(Report, Exit), Diagnostic> {
    let command = if Path::new(command).is_file() {
        Some(vec![command.to_owned()])
    } else {
        shlex::split(command).filter(|words| !words.is_empty())
    };
    let command = command.ok_or_else(|| miette::miette!("--adapter must be a program and its arguments"))?;
    let folder = std::env::current_dir().into_diagnostic()?;
    let (report, conformance) = luxproof_audit::examine_adapter(&command, &folder, options).map_err(not_audited)?;
    print(&terminal(&report, screen(Style::Plain, Detail::All), None))?;
    print(&format!("\n{conformance}"))?;
    let exit = conformance.exit(&report);
    Ok((report, exit))
}

pub(super) fn known_engines(names: &[String]) -> Result<(), Diagnostic> {
    luxproof_engines::all_built_in(names).map_err(|unknown| miette::miette!(help = unknown.help, "{}", unknown.message))
}

/// What is broken fails; what is absent was not asked for.
fn verify(site: &EngineRoot, names: &[String]) -> Result<Exit, Diagnostic> {
    let mut exit = Exit::Passed;
    for (component, soundness) in luxproof_engines::verify(site, &wanted(names)) {
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

/// The engines that are named, or all that are not on request.
fn wanted(names: &[String]) -> Vec<EngineName> {
    if !names.is_empty() {
        return names.iter().map(EngineName::from).collect();
    }
    luxproof_engines::all().into_iter().map(|e| e.name()).filter(|e| luxproof_engines::is_chosen(e, names)).collect()
}

/// Installs the engines that are named, or all.
pub(super) fn report_installation(site: &EngineRoot, names: &[String]) -> Exit {
    report_outcomes(&luxproof_engines::install(site, &wanted(names), complain))
}

fn report_outcomes(outcomes: &[InstallOutcome]) -> Exit {
    for outcome in outcomes {
        complain(&format!("{}: {}", outcome.component, outcome.detail));
    }
    let failed = outcomes.iter().any(|o| o.state == InstallState::Failed);
    if failed { Exit::Engine } else { Exit::Passed }
}
