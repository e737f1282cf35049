//! `luxproof check`: the plan of specs, nothing started.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

use miette::{IntoDiagnostic, Report as Diagnostic};

use super::Selected;
use super::diagnostic::diagnose;
use super::print;
use crate::audit;
use crate::engines::Site;
use crate::judge::PolicyRecord;
use crate::plan::{Asked, Planner, cost_s};
use crate::record::EngineName;
use crate::report::Exit;
use crate::spec::{Trust, filtered, suite};

pub(super) fn check(selected: &Selected, site: &Site, trust: Trust) -> Result<Exit, Diagnostic> {
    let mut cases = suite(&selected.specs, trust).and_then(|all| filtered(all, &selected.filter)).map_err(diagnose)?;
    let policies = selected.policy.of_cases(&cases).map_err(diagnose)?;
    audit::published(&cases).into_diagnostic()?;
    let mut out = String::new();
    let mut exit = Exit::Passed;
    let selection = selected.selection();
    let mut planned: BTreeMap<&PolicyRecord, BTreeSet<EngineName>> = BTreeMap::new();
    let mut planner = Planner::new(&selection, site, selected.skipping());
    for (case, policy) in cases.iter_mut().zip(&policies) {
        case.budget = policy.profile.budget.over(case.budget);
        let plan = planner.plan(case).map_err(diagnose)?;
        writeln!(out, "{} ({}): {}", case.name, case.path.display(), case.title).into_diagnostic()?;
        for task in &plan.tasks {
            writeln!(out, "  {} at {} meters", task.procedure, task.targets.len()).into_diagnostic()?;
            for run in plan.runs.iter().filter(|r| plan.tasks[r.task].procedure == task.procedure) {
                let engine = &plan.engines[run.engine].engine;
                let note = run.approximation.as_ref().map(|a| format!(", approximate: {a}")).unwrap_or_default();
                let cost_s = left(run) * cost_s(engine.as_ref(), &run.job);
                writeln!(out, "    run  {:<10} at most about {cost_s:.0} s{note}", engine.name()).into_diagnostic()?;
            }
            for skip in plan.skips.iter().filter(|s| s.key.procedure == task.procedure) {
                let saved = skip.saved.as_ref().map(|s| format!(" (saves {s})")).unwrap_or_default();
                writeln!(out, "    skip {:<10} {}{saved}", skip.key.engine, skip.reason).into_diagnostic()?;
            }
        }
        if let Some(record) = &policy.record {
            let engines = plan.runs.iter().map(|run| plan.engines[run.engine].engine.name());
            planned.entry(record).or_default().extend(engines);
        }
        let absent = plan.engines.iter().any(|p| p.asked == Asked::ByName && p.is_absent());
        exit = exit.max(if absent { Exit::Engine } else { Exit::Passed });
        print(&std::mem::take(&mut out))?;
    }
    for (policy, engines) in planned {
        writeln!(out, "policy {}", policy.file).into_diagnostic()?;
        for engine in policy.required_engines.iter().filter(|engine| !engines.contains(*engine)) {
            writeln!(out, "REQUIRED by {} and not to run: {engine}", policy.file).into_diagnostic()?;
            exit = Exit::Engine;
        }
    }
    print(&out)?;
    Ok(exit)
}

/// The part of a run's work that no shortcut saves.
fn left(run: &crate::plan::Run) -> f64 {
    run.shortcut.omissions.iter().map(|o| 1.0 - o.share).product()
}
