//! `luxproof check`: the plan of specs, nothing started.

use luxproof_verdict::overruled;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

use miette::{IntoDiagnostic, Report as Diagnostic};

use super::Selected;
use super::run::out_folder;
use luxproof_audit::Options;
use luxproof_audit::plan::{Planner, Run, SelectionReason};
use luxproof_console::print;
use luxproof_console::{diagnose, warn};
use luxproof_engines::{Engine, EngineRoot};
use luxproof_model::EngineName;
use luxproof_model::Exit;
use luxproof_model::PolicyRecord;
use luxproof_model::numbers::plural;
use luxproof_process::printable::Quoted;
use luxproof_report::words::rounded;
use luxproof_spec::{Budget, Trust, find_lints};

pub(super) fn check(selected: &Selected, site: &EngineRoot, trust: Trust) -> Result<Exit, Diagnostic> {
    let selection = selected.choice.selection();
    let options = Options {
        selection: selection.clone(),
        filter: selected.choice.narrowed.filter.clone(),
        trust,
        policy: selected.choice.policy.clone(),
        ..super::audit_options(site.clone(), out_folder(selected))
    };
    let (cases, policies) = luxproof_audit::chosen(&selected.specs, &options).map_err(diagnose)?;
    warn(&find_lints(&cases));
    warn(&overruled(&cases, &policies, &options.policy));
    let published = luxproof_audit::published(&cases).map_err(diagnose)?;
    let mut out = String::new();
    let mut exit = Exit::Passed;
    let mut planned: BTreeMap<&PolicyRecord, BTreeSet<EngineName>> = BTreeMap::new();
    let mut planner = Planner::new(&selection, site, selected.choice.skipping());
    for ((case, policy), published) in cases.iter().zip(&policies).zip(&published) {
        let mut plan = planner.plan(case).map_err(diagnose)?;
        let sampling = policy.profile.sampling.unwrap_or_default();
        luxproof_audit::grant(sampling, policy, case, published.as_ref(), &mut plan);
        writeln!(out, "{} ({}): {}", case.name, case.path.display(), case.title).into_diagnostic()?;
        for model in case.grouped_models() {
            writeln!(out, "  model: {model}").into_diagnostic()?;
        }
        for (set, left_out) in &case.left_out {
            let used = case.meters.get(set).map_or(0, Vec::len);
            writeln!(out, "  {set}: {used} meters; {left_out} points of the surface are left out, outside the walls or in the margin")
                .into_diagnostic()?;
        }
        for task in &plan.tasks {
            writeln!(out, "  {} at {}", task.procedure, plural(task.targets.len(), "point")).into_diagnostic()?;
            for run in plan.runs.iter().filter(|r| plan.tasks[r.task].procedure == task.procedure) {
                let engine = &plan.engines[run.engine].engine;
                let note = run.approximation.as_ref().map(|a| format!(", approximate: {a}")).unwrap_or_default();
                let cost = cost(run, engine.as_ref(), case.budget);
                writeln!(out, "    run  {:<10} {cost}{note}", engine.name()).into_diagnostic()?;
            }
            for skip in plan.skips.iter().filter(|s| s.key.procedure == task.procedure) {
                if skip.scope.leaves_no_reading() {
                    writeln!(out, "    skip {:<10} {}", skip.key.engine, skip.reason).into_diagnostic()?;
                    continue;
                }
                let saved = skip.saved.as_ref().map(|s| format!(" (saves {s})")).unwrap_or_default();
                writeln!(out, "    less {:<10} {}{saved}", skip.key.engine, skip.reason).into_diagnostic()?;
            }
        }
        if let Some(record) = &policy.record {
            let engines = plan.runs.iter().map(|run| plan.engines[run.engine].engine.name());
            planned.entry(record).or_default().extend(engines);
        }
        let absent = plan.engines.iter().any(|p| p.asked == SelectionReason::ByName && p.is_absent());
        exit = exit.max(if absent { Exit::Engine } else { Exit::Passed });
        print(&std::mem::take(&mut out))?;
    }
    for (policy, engines) in planned {
        writeln!(out, "policy {}", policy.file).into_diagnostic()?;
        for engine in policy.required_engines.iter().filter(|engine| !engines.contains(*engine)) {
            writeln!(out, "REQUIRED by {} and not to run: {}", policy.file, Quoted(engine.as_str()))
                .into_diagnostic()?;
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
