//! `luxproof check`: the plan of specs, nothing started.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

use miette::{IntoDiagnostic, Report as Diagnostic};

use super::Selected;
use super::diagnostic::{diagnose, warn};
use super::print;
use super::run::out_folder;
use crate::audit::{self, Options};
use crate::engines::{Engine, Site};
use crate::judge::PolicyRecord;
use crate::plan::{Asked, Planner, Run};
use crate::record::EngineName;
use crate::report::Exit;
use crate::report::words::rounded;
use crate::spec::{Budget, Trust, doubts};

pub(super) fn check(selected: &Selected, site: &Site, trust: Trust) -> Result<Exit, Diagnostic> {
    let selection = selected.choice.selection();
    let options = Options {
        selection: selection.clone(),
        filter: selected.choice.narrowed.filter.clone(),
        trust,
        policy: selected.choice.policy.clone(),
        ..Options::new(site.clone(), out_folder(selected))
    };
    let (cases, policies) = audit::chosen(&selected.specs, &options).map_err(diagnose)?;
    warn(&doubts(&cases));
    let published = audit::published(&cases).map_err(diagnose)?;
    let mut out = String::new();
    let mut exit = Exit::Passed;
    let mut planned: BTreeMap<&PolicyRecord, BTreeSet<EngineName>> = BTreeMap::new();
    let mut planner = Planner::new(&selection, site, selected.choice.skipping());
    for ((case, policy), published) in cases.iter().zip(&policies).zip(&published) {
        let mut plan = planner.plan(case).map_err(diagnose)?;
        let sampling = policy.profile.sampling.unwrap_or_default();
        audit::grant(sampling, policy, case, published.as_ref(), &mut plan);
        writeln!(out, "{} ({}): {}", case.name, case.path.display(), case.title).into_diagnostic()?;
        for task in &plan.tasks {
            writeln!(out, "  {} at {} meters", task.procedure, task.targets.len()).into_diagnostic()?;
            for run in plan.runs.iter().filter(|r| plan.tasks[r.task].procedure == task.procedure) {
                let engine = &plan.engines[run.engine].engine;
                let note = run.approximation.as_ref().map(|a| format!(", approximate: {a}")).unwrap_or_default();
                let cost = cost(run, engine.as_ref(), case.budget);
                writeln!(out, "    run  {:<10} {cost}{note}", engine.name()).into_diagnostic()?;
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

/// What a run is expected to take, or what it may take at most where nobody knows.
fn cost(run: &Run, engine: &dyn Engine, whole: Budget) -> String {
    match engine.expected_s(&run.job).map(|all_s| left(run) * all_s) {
        // All looks together, not the first alone.
        None => format!("at most about {:.0} s", left(run) * whole.seconds),
        Some(..1.0) => "less than 1 processor s".to_owned(),
        Some(seconds) => format!("about {} processor s", rounded(seconds, 2).unwrap_or(seconds)),
    }
}

/// The part of a run's work that no shortcut saves.
fn left(run: &Run) -> f64 {
    run.shortcut.omissions.iter().map(|o| 1.0 - o.share).product()
}
