//! `luxproof export`: an engine's scenes, runnable by hand, with the command beside them.

use std::path::{Path, PathBuf};

use clap::Args;
use miette::{IntoDiagnostic, Report as Diagnostic};

use super::diagnostic::diagnose;
use super::{complain, print};
use crate::engines::Site;
use crate::plan::{Export, NotExported, Selection, plan};
use crate::record::ProcedureId;
use crate::report::Exit;
use crate::spec::{Case, SpecError, Trust, suite};

#[derive(Debug, Args)]
pub(super) struct ExportArgs {
    /// Spec file
    spec: PathBuf,
    /// The engine whose scenes to write
    #[arg(long)]
    engine: String,
    /// Folder to write to; one folder a procedure is made in it
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Procedures to export, by name [default: all of the spec]
    #[arg(long, value_delimiter = ',', value_name = "NAMES")]
    procedures: Vec<ProcedureId>,
}

pub(super) fn export(args: &ExportArgs, site: &Site, trust: Trust) -> Result<Exit, Diagnostic> {
    let cases = suite(std::slice::from_ref(&args.spec), trust).map_err(diagnose)?;
    let mut exported = 0;
    for case in &cases {
        // One folder a case, where there are several.
        let folder = if cases.len() == 1 { args.out.clone() } else { args.out.join(&case.name) };
        exported += export_case(case, args, site, &folder)?;
    }
    if exported == 0 {
        complain(&format!("{} writes no scenes", args.engine));
    }
    Ok(Exit::Passed)
}

/// How many files it made.
fn export_case(case: &Case, args: &ExportArgs, site: &Site, out: &Path) -> Result<usize, Diagnostic> {
    let selection =
        Selection { engines: vec![args.engine.clone()], procedures: args.procedures.clone(), ..Selection::default() };
    let plan = plan(case, &selection, site).map_err(|fault| {
        // Its option is called otherwise here.
        let file = if fault.file == Path::new("--engines") { "--engine".into() } else { fault.file.clone() };
        diagnose(SpecError { file, ..fault })
    })?;
    let chosen = |e: usize| plan.engines[e].engine.name() == args.engine;
    let mut exported = 0;
    for e in (0..plan.engines.len()).filter(|e| chosen(*e)) {
        for task in &plan.tasks {
            let Export { files, command } = match plan.export(case, e, task, selection.seed, site) {
                Ok(export) => export,
                Err(NotExported::Unsupported(reason)) => {
                    complain(&format!("{}: {reason}", task.procedure));
                    continue;
                }
                Err(NotExported::Engine(error)) => return Err(error).into_diagnostic(),
            };
            let folder = out.join(task.procedure.name());
            std::fs::create_dir_all(&folder).into_diagnostic()?;
            for file in &files {
                let path = file.write_below(&folder).into_diagnostic()?;
                print(&format!("{}\n", path.display()))?;
            }
            if let Some(command) = command {
                print(&format!("  cd {} && {command}\n", folder.display()))?;
            }
            exported += files.len();
        }
    }
    Ok(exported)
}
