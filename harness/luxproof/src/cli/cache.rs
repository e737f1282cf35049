//! `luxproof cache`: what the cache of readings holds, and taking out what is damaged or long unused.

use std::path::PathBuf;
use std::time::Duration;

use clap::Subcommand;
use etcetera::BaseStrategy;
use indicatif::HumanBytes;
use miette::{IntoDiagnostic, Report as Diagnostic, WrapErr};

use luxproof_audit::measure::cache::Cache;
use luxproof_model::Exit;

#[derive(Clone, Copy, Debug, Subcommand)]
pub(super) enum Action {
    /// Show its folder, its size, the values per engine, and damage
    Info,
    /// Remove damaged, incomplete and long unused values
    Prune {
        /// Remove values unused for this many days; 0 removes all
        #[arg(long, default_value_t = 90, value_name = "DAYS")]
        unused: u32,
    },
}

pub(super) fn folder(chosen: Option<PathBuf>) -> Result<Cache, Diagnostic> {
    let folder = if let Some(folder) = chosen {
        folder
    } else {
        let help = "name a folder with --cache-dir";
        let user = etcetera::choose_base_strategy().into_diagnostic().wrap_err(help)?;
        user.cache_dir().join("luxproof").join("readings")
    };
    Ok(Cache::at(std::path::absolute(folder).into_diagnostic()?))
}

pub(super) fn manage(action: Option<Action>, cache: &Cache) -> Result<Exit, Diagnostic> {
    let text = match action.unwrap_or(Action::Info) {
        Action::Info => info(cache)?,
        Action::Prune { unused } => prune(cache, unused)?,
    };
    super::print(&text)?;
    Ok(Exit::Passed)
}

/// Damaged files that are named; an earlier luxproof may have left hundreds of another form.
const SHOWN: usize = 5;

fn info(cache: &Cache) -> Result<String, Diagnostic> {
    let contents = cache.contents().into_diagnostic().wrap_err_with(|| cache.root().display().to_string())?;
    let mut lines = vec![format!("readings are kept in {}", cache.root().display())];
    for (engine, (entries, bytes)) in &contents.engines {
        lines.push(format!("{engine:<10} {entries} entries, {}", HumanBytes(*bytes)));
    }
    if contents.engines.is_empty() {
        lines.push("it is empty".to_owned());
    }
    let shown = contents.damaged.iter().take(SHOWN);
    lines.extend(shown.map(|d| format!("damaged, read anew when it is asked for: {d}")));
    if let Some(more) = contents.damaged.len().checked_sub(SHOWN).filter(|more| *more > 0) {
        lines.push(format!("and {more} more; `luxproof cache prune` takes them out"));
    }
    if contents.unfinished > 0 {
        lines.push(format!("{} files that a run is writing, or was when it was killed", contents.unfinished));
    }
    Ok(lines.join("\n") + "\n")
}

fn prune(cache: &Cache, days: u32) -> Result<String, Diagnostic> {
    let pruned = cache.prune(Duration::from_secs(86_400 * u64::from(days))).into_diagnostic()?;
    let (unused, damaged, size) = (pruned.unused, pruned.damaged, HumanBytes(pruned.bytes));
    let unfinished = pruned.unfinished;
    Ok(format!("took out {unused} unused for {days} days, {damaged} damaged, {unfinished} half written: {size}\n"))
}
