//! `luxproof export`: an engine's scenes, runnable by hand, with the command beside them.

use std::path::{Path, PathBuf};

use clap::Args;
use miette::{IntoDiagnostic, Report as Diagnostic};

use luxproof_audit::plan::{Export, NotExported, Selection, plan};
use luxproof_console::diagnose;
use luxproof_console::{complain, print};
use luxproof_engines::EngineRoot;
use luxproof_model::Exit;
use luxproof_model::ProcedureId;
use luxproof_process::files::keep_shared;
use luxproof_scene_export::{ExportedScene, SceneFormat, export_scene};
use luxproof_spec::{Case, SpecError, Trust, suite};

#[derive(Debug, Args)]
pub(super) struct ExportArgs {
    /// Spec file
    spec: PathBuf,
    /// The engine; or `usd` or `gltf` for a scene that other programs read
    #[arg(long)]
    engine: String,
    /// Folder to write to; it gets one folder per procedure
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Export only these procedures
    #[arg(long, value_delimiter = ',', value_name = "NAMES")]
    procedures: Vec<ProcedureId>,
}

pub(super) fn export(args: &ExportArgs, site: &EngineRoot, trust: Trust) -> Result<Exit, Diagnostic> {
    let cases = suite(std::slice::from_ref(&args.spec), trust).map_err(diagnose)?;
    super::refuse_links(&args.out, trust)?;
    if let Some(format) = SceneFormat::ALL.into_iter().find(|format| format.name() == args.engine) {
        for case in &cases {
            let folder = if cases.len() == 1 { args.out.clone() } else { args.out.join(&case.name) };
            export_as(case, format, &folder)?;
        }
        return Ok(Exit::Passed);
    }
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

/// Writes a case in a format of scenes, and says what is lost.
fn export_as(case: &Case, format: SceneFormat, out: &Path) -> Result<(), Diagnostic> {
    let ExportedScene { files, losses } = export_scene(&case.scene, &case.title, format);
    for file in &files {
        let path = out.join(&file.name);
        keep_shared(&path, &file.bytes).into_diagnostic()?;
        print(&format!("{}\n", path.display()))?;
    }
    for loss in losses {
        complain(&format!("{}: {loss}", format.name()));
    }
    Ok(())
}

/// How many files it made.
fn export_case(case: &Case, args: &ExportArgs, site: &EngineRoot, out: &Path) -> Result<usize, Diagnostic> {
    let selection =
        Selection { engines: vec![args.engine.clone()], procedures: args.procedures.clone(), ..Selection::default() };
    let plan = plan(case, &selection, site).map_err(|fault| {
        // Its option is called otherwise here.
        let file = if fault.file == Path::new("--engines") { "--engine".into() } else { fault.file.clone() };
        diagnose(SpecError { file, ..fault })
    })?;
    let mut exported = 0;
    for e in (0..plan.engines.len()).filter(|e| plan.engines[*e].engine.name() == args.engine) {
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
