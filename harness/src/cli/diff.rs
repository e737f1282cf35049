//! `luxproof diff`: what changed between two runs, a mean shift told apart from noise.

use std::path::{Path, PathBuf};

use clap::Args;
use miette::Report as Diagnostic;

use super::views::read_report;
use super::{TextOrJson, json, print};
use crate::record::ReadingKey;
use crate::report::{BaselineCheck, BaselineLine, Exit};
use crate::trend::baseline::{Baseline, Changes, Comparability, EntryChange, MeterChange, State, compare};

#[derive(Debug, Args)]
pub(super) struct DiffArgs {
    /// The earlier run: its folder or report.json
    old: PathBuf,
    /// The later run: its folder or report.json
    new: PathBuf,
    /// View to print
    #[arg(long, value_enum, value_name = "FORMAT", default_value_t = TextOrJson::Terminal)]
    format: TextOrJson,
}

pub(super) fn diff(args: &DiffArgs) -> Result<Exit, Diagnostic> {
    let [old, new] = [&args.old, &args.new].map(|run| read_report(run).map(|r| Baseline::candidate(&r)));
    let changes = compare(&old?.entries, &new?.entries, Comparability::SameSpec);
    print(&match args.format {
        TextOrJson::Terminal => text(&changes),
        TextOrJson::Json => json(&changes)?,
    })?;
    Ok(if changes.is_clean() { Exit::Passed } else { Exit::Failed })
}

/// Changes for people: a line an entry, the meters that moved below it.
pub(super) fn text(changes: &Changes) -> String {
    let mut text = String::new();
    for entry in &changes.entries {
        let ReadingKey { case, procedure, engine } = &entry.key;
        let mean = entry.mean.map_or_else(String::new, |mean| format!(": mean {mean}"));
        text += &format!("{:<9} {case} {procedure} {engine}{mean}\n", name(entry.state));
        text.extend(details(entry).map(|detail| format!("            {detail}\n")));
    }
    let count = |state| changes.entries.iter().filter(|e| e.state == state).count();
    let counts = [State::Unchanged, State::Shifted, State::Changed, State::Vanished, State::New, State::Refused]
        .map(|state| format!("{} {}", count(state), name(state).to_lowercase()));
    let Changes { tests, level, level_of_means, .. } = changes;
    text + &format!(
        "{}; {tests} meters, each tested at {level:.1e}, means at {level_of_means:.1e}\n",
        counts.join(", ")
    )
}

/// Changes as a report keeps them. Nothing that nobody accepted counts as accepted, be it new.
pub(super) fn check(changes: &Changes, file: &Path) -> BaselineCheck {
    let line = |entry: &EntryChange| {
        let mean = entry.mean.map(|mean| format!("mean {mean}"));
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
fn details(entry: &EntryChange) -> impl Iterator<Item = String> {
    let moved = |m: &MeterChange| {
        let change = m.new - m.old;
        let in_u = if m.uncertainty > 0.0 { format!(", {:+.1} u", change / m.uncertainty) } else { String::new() };
        let relative = 100.0 * change / m.old;
        format!("{} {:.6} -> {:.6} {}: {relative:+.4} %{in_u}", m.meter, m.old, m.new, m.quantity.unit())
    };
    let meters = entry.meters.iter().filter(|m| m.significant).take(5).map(moved);
    entry.notes.iter().cloned().chain(meters)
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
