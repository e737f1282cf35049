//! The command `luxproof conformance`.

use std::path::{Path, PathBuf};

use clap::{Args, Subcommand, ValueEnum};
use itertools::Itertools as _;
use luxproof_console::{json, print};
use luxproof_model::Exit;
use luxproof_process::printable::{Quoted, quoted};
use luxproof_process::{files, foreign_json};
use miette::{IntoDiagnostic, Report as Diagnostic, miette};

use crate::catalogue::PACK_VERSION;
use crate::explanation::PartialExplanation;
use crate::judge::{FileJudgement, FileVerdict, Judgement, judge};
use crate::mistake::Mistake;
use crate::own_answers::own_submission;
use crate::pack::written_files;
use crate::submission::Submission;

/// Arguments of `luxproof conformance`.
#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub struct ConformanceArgs {
    #[command(subcommand)]
    action: Option<Action>,
    /// Write the pack to this folder
    #[arg(long, required = true, value_name = "DIR")]
    emit: Option<PathBuf>,
    /// Write into a folder that is not empty
    #[arg(long)]
    force: bool,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Judge the answers of a reader, and name its mistakes
    Check(CheckArgs),
    /// Print the answers of luxproof's own readers, as an example
    Answer,
}

#[derive(Debug, Args)]
struct CheckArgs {
    /// The answers; README.md of the pack explains the file
    #[arg(value_name = "RESULTS.json")]
    results: PathBuf,
    /// Format to print
    #[arg(long, value_enum, value_name = "FORMAT", default_value_t = Format::Terminal)]
    format: Format,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Format {
    Terminal,
    Json,
}

/// The largest submission: that of the pack has some 50 kB. In memory it takes up to forty times as much.
const MAX_RESULTS_BYTES: u64 = 2 << 20;

/// Writes the pack, or does what its subcommand says.
pub fn run(args: &ConformanceArgs, version: &str) -> Result<Exit, Diagnostic> {
    match (&args.action, &args.emit) {
        (Some(Action::Check(args)), _) => check(args),
        (Some(Action::Answer), _) => {
            print(&json(&own_submission(version))?)?;
            Ok(Exit::Passed)
        }
        (None, Some(folder)) => emit(folder, args.force),
        (None, None) => Err(miette!(help = "name a folder with --emit", "there is nothing to do")),
    }
}

/// Writes the pack.
fn emit(folder: &Path, is_forced: bool) -> Result<Exit, Diagnostic> {
    let is_filled = std::fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_some());
    if is_filled && !is_forced {
        return Err(miette!(help = "name another folder, or add --force", "{} is not empty", folder.display()));
    }
    let written = written_files().into_diagnostic()?;
    for file in &written {
        files::keep_shared(&folder.join(&file.path), &file.bytes).into_diagnostic()?;
    }
    print(&format!(
        "{}: conformance pack {PACK_VERSION}, {} files; begin with README.md\n",
        folder.display(),
        written.len()
    ))?;
    Ok(Exit::Passed)
}

/// Refuses a file of answers.
fn refuse(path: &Path, error: &str, help: &str) -> Diagnostic {
    miette!(help = help.to_owned(), "{}: {error}", path.display())
}

/// Judges a submission.
fn check(args: &CheckArgs) -> Result<Exit, Diagnostic> {
    let path = &args.results;
    let bytes = files::read_bounded(path, MAX_RESULTS_BYTES)
        .map_err(|error| refuse(path, &error.to_string(), "name the file with the answers of your reader"))?;
    let submission: Submission = foreign_json::from_slice(&bytes).map_err(|error| {
        refuse(path, &quoted(&error.to_string()), "results.schema.json of the pack describes the file")
    })?;
    let judgement = judge(&submission).map_err(|error| refuse(path, &error.to_string(), error.help()))?;
    match args.format {
        Format::Json => print(&json(&judgement)?)?,
        Format::Terminal => print(&format_judgement(&judgement))?,
    }
    Ok(if judgement.is_passed() { Exit::Passed } else { Exit::Failed })
}

/// The verdicts as text: a line a file that needs one, then each mistake with what to do.
pub(crate) fn format_judgement(judgement: &Judgement) -> String {
    let count = |is: fn(&FileJudgement) -> bool| judgement.files.iter().filter(|file| is(file)).count();
    let right = count(|file| file.verdict == FileVerdict::Right && !file.is_fault());
    let refused = count(|file| matches!(file.verdict, FileVerdict::Refused { .. }));
    let faults = count(FileJudgement::is_fault) - refused;
    let absent = count(|file| file.verdict == FileVerdict::NotSubmitted);
    let reader = Quoted(&judgement.reader);
    let mut text = format!(
        "{reader}, conformance pack {}: {right} right, {faults} wrong, {refused} not read, {absent} not submitted\n",
        judgement.pack
    );
    for file in judgement.files.iter().filter(|file| file.is_fault()) {
        text += &format!("\n{:<30} {}\n", file.file, describe(&file.verdict));
        text += &format!("  tests: {}\n", file.feature);
        for fault in &file.quantities {
            text += &format!("  {}\n", fault.sentence());
        }
    }
    let mistakes = judgement.mistakes();
    if !mistakes.is_empty() {
        text += "\nMistakes:\n";
    }
    for (mistake, names) in mistakes {
        text += &format!("  {} ({})\n    {}\n", mistake.id(), list(&names), mistake.sentence());
    }
    let variants = judgement.variants();
    if !variants.is_empty() {
        text += "\nVariants, none of which is wrong:\n";
    }
    for (variant, names) in variants {
        text += &format!("  {} ({})\n    {}\n", variant.id(), list(&names), variant.sentence());
    }
    text
}

/// The first names, and how many more there are.
fn list(names: &[&str]) -> String {
    const MOST: usize = 4;
    let shown = names.iter().take(MOST).join(", ");
    if names.len() > MOST { format!("{shown} and {} more", names.len() - MOST) } else { shown }
}

/// A verdict in words.
fn describe(verdict: &FileVerdict) -> String {
    match verdict {
        FileVerdict::Right => "intensities right".into(),
        FileVerdict::Mistakes { alternatives, factor } => {
            let factor = factor.map(|factor| format!(", and {factor:.4} times that")).unwrap_or_default();
            format!(
                "WRONG: {}{factor}",
                alternatives
                    .iter()
                    .map(|mistakes| mistakes.iter().copied().map(Mistake::id).join(" and "))
                    .join(", or ")
            )
        }
        FileVerdict::Factor { factor } => {
            format!("WRONG: all answers are {factor:.4} times the expected, which no known mistake gives")
        }
        FileVerdict::Unknown { c_deg, gamma_deg, answer_cd, expected_cd: [least, most], nearest } => {
            let expected =
                if most - least <= 1e-6 * most { format!("{least:.3}") } else { format!("{least:.3} to {most:.3}") };
            let known = match nearest {
                None => "no known mistake gives these answers".to_owned(),
                Some(PartialExplanation { mistakes, explained, answered, .. }) if mistakes.is_empty() => {
                    format!("{explained} of {answered} answers are right")
                }
                Some(PartialExplanation { mistakes, explained, answered, .. }) => {
                    let names = mistakes.iter().map(|mistake| mistake.id()).join(" and ");
                    format!("{explained} of {answered} answers are those of {names}")
                }
            };
            format!("WRONG: {answer_cd:.3} cd at C {c_deg:.1} gamma {gamma_deg:.1}, expected {expected}; {known}")
        }
        FileVerdict::Refused { reason } => format!("not read: {}", Quoted(reason)),
        FileVerdict::Unanswered => "no answer".into(),
        FileVerdict::NotSubmitted => "not submitted".into(),
    }
}
