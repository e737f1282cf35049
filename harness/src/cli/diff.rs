//! `luxproof diff`: what changed between two runs, a mean shift told apart from noise.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use miette::{IntoDiagnostic, Report as Diagnostic};

use super::accept::read_run;
use super::print;
use crate::report::{BaselineCheck, BaselineLine, Exit};
use crate::trend::baseline::{Baseline, Changes, Comparability, EntryChange, MeterChange, State, compare};

#[derive(Debug, Args)]
pub(super) struct DiffArgs {
    /// The earlier run: its folder or report.json
    old: PathBuf,
    /// The later run: its folder or report.json
    new: PathBuf,
    /// View to print
    #[arg(long, value_enum, value_name = "FORMAT", default_value_t = DiffFormat::Terminal)]
    format: DiffFormat,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum DiffFormat {
    Terminal,
    Json,
}

pub(super) fn diff(args: &DiffArgs) -> Result<Exit, Diagnostic> {
    let [old, new] = [&args.old, &args.new].map(|run| read_run(run).map(|r| Baseline::candidate(&r)));
    let changes = compare(&old?.entries, &new?.entries, Comparability::SameSpec);
    let text = match args.format {
        DiffFormat::Terminal => text(&changes),
        DiffFormat::Json => serde_json::to_string_pretty(&changes).into_diagnostic()? + "\n",
    };
    print(&text)?;
    Ok(if changes.is_clean() { Exit::Passed } else { Exit::Failed })
}

/// Changes for people: a line an entry, the meters that moved below it.
pub(super) fn text(changes: &Changes) -> String {
    let mut text = String::new();
    for entry in &changes.entries {
        writeln!(
            text,
            "{:<9} {} {} {}{}",
            name(entry.state),
            entry.key.case,
            entry.key.procedure,
            entry.key.engine,
            mean(entry)
        )
        .ok();
        for detail in details(entry) {
            writeln!(text, "            {detail}").ok();
        }
    }
    let count = |state| changes.entries.iter().filter(|e| e.state == state).count();
    writeln!(
        text,
        "{} unchanged, {} shifted, {} changed, {} vanished, {} new, {} refused; {} tests, each at {:.1e}",
        count(State::Unchanged),
        count(State::Shifted),
        count(State::Changed),
        count(State::Vanished),
        count(State::New),
        count(State::Refused),
        changes.tests,
        changes.level
    )
    .ok();
    text
}

/// Changes as a report keeps them. Nothing that nobody accepted counts as accepted, be it new.
pub(super) fn check(changes: &Changes, file: &Path) -> BaselineCheck {
    let line = |entry: &EntryChange| {
        let mean = mean(entry);
        let mean = mean.strip_prefix(": ").map(str::to_owned);
        BaselineLine {
            key: entry.key.clone(),
            state: name(entry.state).to_owned(),
            is_as_accepted: entry.state == State::Unchanged,
            details: mean.into_iter().chain(details(entry)).collect(),
        }
    };
    BaselineCheck { file: file.display().to_string(), entries: changes.entries.iter().map(line).collect() }
}

/// What differs besides the readings, and the meters that moved, five at most.
fn details(entry: &EntryChange) -> Vec<String> {
    let moved = |m: &MeterChange| {
        let in_u =
            if m.uncertainty > 0.0 { format!(", {:+.1} u", (m.new - m.old) / m.uncertainty) } else { String::new() };
        let relative = 100.0 * (m.new - m.old) / m.old;
        format!("{} {:.6} -> {:.6} {}: {relative:+.4} %{in_u}", m.meter, m.old, m.new, m.quantity.unit())
    };
    let meters = entry.meters.iter().filter(|m| m.significant).take(5).map(moved);
    entry.notes.iter().cloned().chain(meters).collect()
}

fn mean(entry: &EntryChange) -> String {
    entry.mean.map_or_else(String::new, |m| {
        let in_u = m.relative / m.uncertainty;
        format!(": mean {:+.4} % +- {:.4} % ({in_u:+.1} u)", 100.0 * m.relative, 100.0 * m.uncertainty)
    })
}

const fn name(state: State) -> &'static str {
    match state {
        State::Unchanged => "unchanged",
        State::Shifted => "SHIFTED",
        State::Changed => "CHANGED",
        State::Vanished => "VANISHED",
        State::New => "new",
        State::Refused => "REFUSED",
    }
}
