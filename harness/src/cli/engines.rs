//! `luxproof engines`: which there are, installing them, examining them.

use std::collections::BTreeMap;
use std::sync::Arc;

use clap::Subcommand;
use miette::{IntoDiagnostic, Report as Diagnostic};

use crate::audit::doctor;
use crate::calibration::{self, Calibrated, Earlier};
use crate::engines::{self, Engine, InstallState, Site};
use crate::judge::Tolerances;
use crate::measure::{Instrument, Machine, Reader};
use crate::record::EngineName;
use crate::report::Exit;
use crate::spec::suggestion;
use crate::system::process;

#[derive(Clone, Debug, Subcommand)]
pub(super) enum EnginesAction {
    /// Which engines there are, and their versions
    List,
    /// Fetch missing engines into a folder of our own
    Install {
        /// Engines by name [default: all]
        names: Vec<String>,
    },
    /// Let every engine read a scene of known answer
    Doctor {
        /// Engines by name [default: all]
        names: Vec<String>,
    },
}

pub(super) fn manage_engines(action: Option<EnginesAction>, site: &Site) -> Result<Exit, Diagnostic> {
    match action.unwrap_or(EnginesAction::List) {
        EnginesAction::List => {
            for engine in engines::all() {
                match engine.probe(site) {
                    Ok(version) => println!("{:<10} {}", engine.name(), version.0),
                    Err(absent) => println!("{:<10} absent: {absent}", engine.name()),
                }
            }
            println!("engines are kept in {}", site.root().display());
            Ok(Exit::Passed)
        }
        EnginesAction::Install { names } => {
            known_engines(&names)?;
            Ok(report_installation(site, &names))
        }
        EnginesAction::Doctor { names } => {
            known_engines(&names)?;
            examine(site, &names)
        }
    }
}

fn examine(site: &Site, names: &[String]) -> Result<Exit, Diagnostic> {
    let tolerances = Tolerances::built_in().into_diagnostic()?;
    let reader = Reader::bare(site, Machine::rendering_everything(process::cores()));
    let mut exit = Exit::Passed;
    for engine in engines::all() {
        let engine: Arc<dyn Engine> = engine.into();
        if names.is_empty() || names.iter().any(|n| engine.name() == *n) {
            let finding = doctor::examine(&engine, &reader, &tolerances);
            println!("{} {:<10} {}", if finding.healthy { "ok  " } else { "FAIL" }, finding.engine, finding.text);
            exit = exit.worse(if finding.healthy { Exit::Passed } else { Exit::Engine });
            exit = exit.worse(calibrate_anew(engine, &reader));
        }
    }
    Ok(exit)
}

fn calibrate_anew(engine: Arc<dyn Engine>, reader: &Reader) -> Exit {
    let version = match engine.probe(&reader.site) {
        Ok(version) if !engine.is_witness() => version,
        _ => return Exit::Passed,
    };
    let name = engine.name();
    match calibration::calibrate(&Instrument { engine, version }, &BTreeMap::new(), reader, Earlier::Ignored) {
        Ok(found) => {
            println!("     {name:<10} {}", calibration_line(&found));
            Exit::Passed
        }
        Err(error) => {
            println!("FAIL {name:<10} {error}");
            Exit::Engine
        }
    }
}

pub(super) fn known_engines(names: &[String]) -> Result<(), Diagnostic> {
    let known: Vec<EngineName> = engines::all().iter().map(|e| e.name()).collect();
    let Some(name) = names.iter().find(|name| !known.iter().any(|k| k == *name)) else { return Ok(()) };
    let help = suggestion(name, known.iter().map(EngineName::as_str));
    Err(miette::miette!(help = help, "there is no engine `{name}`"))
}

/// Installs the engines that are named, or all.
pub(super) fn report_installation(site: &Site, names: &[String]) -> Exit {
    let wanted = engines::all().into_iter().map(|e| e.name());
    let wanted: Vec<_> = wanted.filter(|e| names.is_empty() || names.iter().any(|n| e == n)).collect();
    let outcomes = engines::install(site, &wanted, |step| eprintln!("{step}"));
    for outcome in &outcomes {
        eprintln!("{}: {}", outcome.component, outcome.detail);
    }
    let failed = outcomes.iter().any(|o| o.state == InstallState::Failed);
    if failed { Exit::Engine } else { Exit::Passed }
}

pub(super) fn calibration_line(found: &Calibrated) -> String {
    let kept = match &found.kept {
        Ok(file) => format!("kept in {file}"),
        Err(why) => format!("not kept, so that it is measured again next time: {why}"),
    };
    format!("{}; {kept}", found.calibration.summary())
}
