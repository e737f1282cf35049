//! `luxproof diff`: what changed between two runs, a mean shift distinguished from noise.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use clap::Args;
use miette::Report as Diagnostic;
use strum::VariantArray;

use super::TextOrJson;
use super::last_run::pair;
use super::views::read_report;
use luxproof_console::{json, print};
use luxproof_model::{BaselineCheck, BaselineLine, Exit, ReadingKey, Report, Verdict};
use luxproof_statistics::SINGLE_PRECISION;
use luxproof_trend::baseline::{Baseline, Changes, EntryChange, MeterChange, References, State, compare};

/// A reading within so many standard uncertainties of the common factor has it. Few of ten thousand readings are further by chance.
const COMMON_FACTOR_SIGMAS: f64 = 4.0;

/// Changes of more standard uncertainties are shown in per cent alone.
const MAX_SHOWN_SIGMAS: f64 = 1e4;

#[derive(Debug, Args)]
pub(super) struct DiffArgs {
    /// The earlier run: folder or report.json [default: the run before the last]
    old: Option<PathBuf>,
    /// The later run: folder or report.json [default: the last run]
    new: Option<PathBuf>,
    /// Format to print
    #[arg(long, value_enum, value_name = "FORMAT", default_value_t = TextOrJson::Terminal)]
    format: TextOrJson,
}

pub(super) fn diff(args: &DiffArgs) -> Result<Exit, Diagnostic> {
    let runs = pair(args.old.as_deref(), args.new.as_deref())?;
    let [old, new] = runs.map(|run| read_report(&run));
    let (old, new) = (old?, new?);
    let [before, now] = [&old, &new].map(|report| Baseline::candidate(report).entries);
    let changes = compare(&before, &now, &References::of_report(&new));
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
        text += &format!("{:<9} {case} {procedure} {engine}{mean}\n", entry.state.name());
        text.extend(
            details(entry).chain(entry.instrument.iter().cloned()).map(|detail| format!("            {detail}\n")),
        );
    }
    let counts = State::VARIANTS.iter().map(|state| {
        let count = changes.entries.iter().filter(|entry| entry.state == *state).count();
        format!("{count} {}", state.name().to_lowercase())
    });
    let Changes { tests, level, level_of_means, .. } = changes;
    text + &format!(
        "{}; {tests} meters, each tested at {level:.1e}, means at {level_of_means:.1e}\n",
        counts.collect::<Vec<_>>().join(", ")
    )
}

/// The comparison of a run with its baseline, as its report states it. Readings without accepted ones are not as accepted.
pub(super) fn check(changes: &Changes, report: &Report, file: &Path) -> BaselineCheck {
    let entries = changes.entries.iter().map(|entry| baseline_line(entry, report)).collect();
    BaselineCheck { file: file.display().to_string(), entries }
}

/// A line of a report on one change.
fn baseline_line(entry: &EntryChange, report: &Report) -> BaselineLine {
    let is_as_accepted = entry.state == State::Unchanged;
    let mean = entry.mean.map(|mean| format!("mean {mean}"));
    let cause = if is_as_accepted { None } else { describe_cause(entry, report) };
    BaselineLine {
        key: entry.key.clone(),
        state: entry.state.name().to_owned(),
        is_as_accepted,
        details: mean.into_iter().chain(cause).chain(details(entry)).collect(),
        instrument: entry.instrument.clone(),
    }
}

/// The causes that the run names for failures of the entry, or else the factor that all its readings share.
fn describe_cause(entry: &EntryChange, report: &Report) -> Option<String> {
    // Of an undecided reading it says why it is undecided, which is no cause of a change.
    let failures = report.comparisons.iter().filter(|c| c.key == entry.key && c.verdict == Verdict::Fail);
    let named: BTreeSet<&str> = failures.filter_map(|c| c.diagnosis.as_deref()).collect();
    if !named.is_empty() {
        return Some(format!("cause: {}", named.into_iter().collect::<Vec<_>>().join("; ")));
    }
    let mean = entry.mean.filter(|_| entry.state == State::Shifted)?;
    let is_common = |m: &MeterChange| {
        let spread = m.uncertainty.max(SINGLE_PRECISION * m.new.abs());
        (m.new - m.old * (1.0 + mean.relative)).abs() <= COMMON_FACTOR_SIGMAS * spread
    };
    if entry.meters.iter().all(is_common) {
        return Some(format!("cause: every reading times {:.5}", 1.0 + mean.relative));
    }
    let moved = entry.meters.iter().filter(|m| m.significant).count();
    Some(format!("cause: no common factor; {moved} of {} readings moved", entry.meters.len()))
}

/// The change at one meter, in words.
fn meter_text(m: &MeterChange) -> String {
    let change = m.new - m.old;
    // A bound of rounding alone is no scale for a change.
    let is_scale = change.abs() < MAX_SHOWN_SIGMAS * m.uncertainty;
    let in_u = if is_scale { format!(", {:+.1} u", change / m.uncertainty) } else { String::new() };
    let relative = if m.old == 0.0 { "from zero".to_owned() } else { format!("{:+.4} %", 100.0 * change / m.old) };
    format!("{} {:.6} -> {:.6} {}: {relative}{in_u}", m.meter, m.old, m.new, m.quantity.unit())
}

/// The notes on an entry and the meters that moved, five at most.
fn details(entry: &EntryChange) -> impl Iterator<Item = String> {
    let meters = entry.meters.iter().filter(|m| m.significant).take(5).map(meter_text);
    entry.notes.iter().cloned().chain(meters)
}
