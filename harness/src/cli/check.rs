//! `luxproof check`: the plan of specs, nothing started.

use std::io::Write;

use miette::{IntoDiagnostic, Report as Diagnostic};

use super::Selected;
use super::diagnostic::diagnose;
use crate::audit;
use crate::engines::Site;
use crate::plan::{Asked, Planner, cost_s};
use crate::report::Exit;
use crate::spec::{filtered, suite};

pub(super) fn check(selected: &Selected, site: &Site) -> Result<Exit, Diagnostic> {
    let cases = suite(&selected.specs).and_then(|all| filtered(all, &selected.filter)).map_err(diagnose)?;
    audit::published(&cases).into_diagnostic()?;
    let mut out = std::io::stdout().lock();
    let mut exit = Exit::Passed;
    let selection = selected.selection();
    let mut planner = Planner::new(&selection, site, selected.skipping());
    for case in &cases {
        let plan = planner.plan(case).map_err(diagnose)?;
        writeln!(out, "{} ({}): {}", case.name, case.path.display(), case.title).into_diagnostic()?;
        for task in &plan.tasks {
            writeln!(out, "  {} at {} meters", task.procedure, task.targets.len()).into_diagnostic()?;
            for run in plan.runs.iter().filter(|r| plan.tasks[r.task].procedure == task.procedure) {
                let engine = &plan.engines[run.engine].engine;
                let note = run.approximation.as_ref().map(|a| format!(", approximate: {a}")).unwrap_or_default();
                let cost_s = left(run) * cost_s(engine.as_ref(), case.budget);
                writeln!(out, "    run  {:<10} at most about {cost_s:.0} s{note}", engine.name()).into_diagnostic()?;
            }
            for skip in plan.skips.iter().filter(|s| s.key.procedure == task.procedure) {
                let saved = skip.saved.as_ref().map(|s| format!(" (saves {s})")).unwrap_or_default();
                writeln!(out, "    skip {:<10} {}{saved}", skip.key.engine, skip.reason).into_diagnostic()?;
            }
        }
        let absent = plan.engines.iter().any(|p| p.asked == Asked::ByName && p.is_absent());
        exit = exit.max(if absent { Exit::Engine } else { Exit::Passed });
    }
    Ok(exit)
}

/// The part of a run's work that no shortcut saves.
fn left(run: &crate::plan::Run) -> f64 {
    run.shortcut.omissions.iter().map(|o| 1.0 - o.share).product()
}
