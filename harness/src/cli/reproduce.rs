//! `luxproof reproduce`: a bundle verified and run again, or a paper's tables, and what of them comes out the same.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::Args;
use miette::{IntoDiagnostic, Report as Diagnostic, miette};

use super::bundle::refused;
use super::diagnostic::not_audited;
use super::progress::Progress;
use super::views::keep_page;
use super::{TextOrJson, at_least_one, complain, json, print};
use crate::audit::{self, Calibration, Options};
use crate::bundle::{self, Difference, EngineThen, Opened, Outcome, Reproduction, Row};
use crate::engines::Site;
use crate::judge::{Published, Sampling, Tolerances};
use crate::measure::cache::Cache;
use crate::record::ProcedureId;
use crate::report::{self, Cell, Exit, Report, Standing, words};
use crate::spec::{Case, Trust};
use crate::system::process;

#[derive(Debug, Args)]
pub(super) struct ReproduceArgs {
    /// A bundle of `luxproof bundle` (a folder or a .zip), or a paper's tables (YAML)
    what: PathBuf,
    /// Verify the bundle, and run nothing
    #[arg(long)]
    verify: bool,
    /// Take the bundle's specs for your own: they may run programs, and are of any size
    #[arg(long)]
    trusted: bool,
    /// Of a paper, only the tables of these procedures [default: all]
    #[arg(long, value_delimiter = ',', value_name = "NAMES")]
    procedures: Vec<ProcedureId>,
    /// Of a paper, sample until standard errors are so small, relative [default: as the spec says]
    #[arg(long, value_name = "ERROR", value_parser = positive)]
    relative_error: Option<f64>,
    /// Folder of the new run's files [default: luxproof-out/<name>-again, of a paper luxproof-out/<name>]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Threads or processes at a time [default: one a core]
    #[arg(long, value_name = "N", value_parser = at_least_one)]
    jobs: Option<usize>,
    /// View to print
    #[arg(long, value_enum, value_name = "FORMAT", default_value_t = TextOrJson::Terminal)]
    format: TextOrJson,
}

pub(super) fn reproduce(
    args: &ReproduceArgs,
    site: &Site,
    cache: impl FnOnce() -> Result<Cache, Diagnostic>,
    trust: Trust,
) -> Result<Exit, Diagnostic> {
    if bundle::is_bundle(&args.what) {
        return again(args, site, trust);
    }
    if args.verify || args.trusted {
        return Err(miette!("{} is no bundle, and --verify and --trusted are of bundles", args.what.display()));
    }
    paper(args, site, cache()?, trust)
}

/// A bundle's run, made again without any reading that is kept.
fn again(args: &ReproduceArgs, site: &Site, trust: Trust) -> Result<Exit, Diagnostic> {
    if !args.procedures.is_empty() || args.relative_error.is_some() {
        return Err(miette!("--procedures and --relative-error are of papers: a bundle's run is made again as it was"));
    }
    if args.trusted && trust != Trust::Own {
        return Err(miette!("--trusted and --untrusted (or LUXPROOF_UNTRUSTED) contradict each other"));
    }
    let opened = Opened::read(&args.what).map_err(refused)?;
    let whole = format!("{}: {} files, whole; SHA-256 {}", args.what.display(), opened.files, opened.sha256);
    if args.verify {
        print(&format!("{whole}\n"))?;
        return Ok(Exit::Passed);
    }
    complain(&whole);
    let progress = Progress::new();
    let trust = if args.trusted { Trust::Own } else { Trust::Bundled };
    let options = options(args, site, trust, "-again", &progress);
    let out = options.out.clone();
    let (reproduction, report) = opened.again(options).map_err(not_audited)?;
    drop(progress);
    keep_page(&report, &out);
    print(&match args.format {
        TextOrJson::Terminal => told(&reproduction),
        TextOrJson::Json => json(&reproduction)?,
    })?;
    Ok(reproduction.exit())
}

fn options<'a>(args: &ReproduceArgs, site: &Site, trust: Trust, after: &str, progress: &'a Progress) -> Options<'a> {
    let whole = std::path::absolute(&args.what).unwrap_or_default();
    let name = whole.file_stem().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let out = args.out.clone().unwrap_or_else(|| Path::new("luxproof-out").join(name + after));
    let jobs = args.jobs.unwrap_or_else(process::cores);
    Options { jobs, trust, observer: progress, ..Options::new(site.clone(), out) }
}

/// What came of it: a sentence, engines that are others now, and what differs.
fn told(reproduction: &Reproduction) -> String {
    let count = |outcome| reproduction.count(outcome);
    let [same, within, differs, unread] =
        [Outcome::SameBytes, Outcome::Within, Outcome::Differs, Outcome::NotRead].map(count);
    let rows = reproduction.rows.len();
    let mut parts = vec![format!("{same} to the byte")];
    let counted = [(within, "within uncertainties"), (differs, "differ"), (unread, "not read")];
    parts.extend(counted.into_iter().filter(|(n, _)| *n > 0).map(|(n, what)| format!("{n} {what}")));
    let verdict = if reproduction.exit() == Exit::Passed { "reproduced" } else { "not reproduced" };
    let comparisons: usize = reproduction.rows.iter().map(|row| row.comparisons).sum();
    let mut text = format!(
        "{}: {verdict}. Of {rows} procedures of engines ({comparisons} comparisons) {}\n",
        reproduction.title,
        parts.join(", ")
    );
    let (then, now) = (&reproduction.tool_then, &reproduction.tool_now);
    if then != now {
        text += &format!("  luxproof {then} then, {now} now\n");
    }
    reproduction.engines.iter().filter(|engine| !engine.is_the_same).for_each(|engine| text += &engine_told(engine));
    let what_differs = reproduction.rows.iter().filter(|row| row.outcome != Outcome::SameBytes);
    for row in what_differs {
        text += &row_told(row);
    }
    text
}

fn engine_told(engine: &EngineThen) -> String {
    let EngineThen { id, version_then, version_now, reason, .. } = engine;
    let then = version_then.as_deref().unwrap_or("no version");
    match version_now {
        Some(now) if now == then => format!("  {id}: {then} as then, of other bytes (its fingerprint differs)\n"),
        Some(now) => format!("  {id}: {then} then, {now} now\n"),
        None => format!("  {id}: {then} then, absent now ({})\n", reason.as_deref().unwrap_or("no reason given")),
    }
}

/// More differences of a row are counted, not told.
const SHOWN: usize = 5;

fn row_told(row: &Row) -> String {
    let outcome = match row.outcome {
        Outcome::SameBytes => "the same bytes",
        Outcome::Within => "within uncertainties",
        Outcome::Differs => "DIFFERS",
        Outcome::NotRead => "NOT READ",
    };
    let notes = row.notes.iter().fold(String::new(), |notes, note| notes + "; " + note);
    let mut text = format!("  {}: {outcome}{notes}\n", row.key);
    for Difference { meter, against, then, now, unit, verdict_then, verdict_now } in row.differences.iter().take(SHOWN)
    {
        let number = |value: &Option<f64>| value.map_or_else(|| "-".to_owned(), words::significant);
        let verdict = match verdict_now {
            Some(now) if now == verdict_then => now.name().to_owned(),
            now => format!("{} then, {} now", verdict_then.name(), now.map_or("none", |v| v.name())),
        };
        text +=
            &format!("    {meter}: {} then, {} {unit} now against {against}: {verdict}\n", number(then), number(now));
    }
    let more = row.differences.len().saturating_sub(SHOWN);
    if more > 0 {
        text += &format!("    and {more} more\n");
    }
    text
}

fn positive(text: &str) -> Result<f64, String> {
    let number: f64 = text.parse().map_err(|error| format!("{error}"))?;
    if number.is_finite() && number > 0.0 {
        Ok(number)
    } else {
        Err("give a number above 0, such as 0.0005".to_owned())
    }
}

/// A paper's tables: the spec that they name is run, and every printed cell held against what is read now.
fn paper(args: &ReproduceArgs, site: &Site, cache: Cache, trust: Trust) -> Result<Exit, Diagnostic> {
    let published = Published::read(&args.what).into_diagnostic()?;
    let Some(spec) = published.spec() else {
        return Err(miette!(
            help = "add the spec that has the geometry, relative to it: `spec: ../specs/name.yaml`",
            "{} names no spec",
            args.what.display()
        ));
    };
    let cases = Case::load_all(&spec, trust).map_err(super::diagnostic::diagnose)?;
    let is_its = |case: &Case| {
        let named = case.published.as_ref().and_then(|table| table.canonicalize().ok());
        named.is_some() && named == args.what.canonicalize().ok()
    };
    if !cases.iter().any(is_its) {
        return Err(miette!(
            help = format!("put `published: ...` with its path there, relative to {}", spec.display()),
            "{} is not held against {}",
            spec.display(),
            args.what.display()
        ));
    }
    let progress = Progress::new();
    let calibration = Calibration::LeftOut;
    let mut options = Options { cache: Some(cache), calibration, ..options(args, site, trust, "", &progress) };
    if args.relative_error.is_some() {
        options.sampling = Some(Sampling::Accurate);
        options.budget.relative_error = args.relative_error;
    }
    // Nobody else has a cell.
    options.selection.engines = published.engines().into_iter().map(str::to_owned).collect();
    options.selection.procedures.clone_from(&args.procedures);
    let (report, _claim) = audit::run_and_hold(&[spec], &options).map_err(not_audited)?;
    let out = options.out.clone();
    drop(progress);
    keep_page(&report, &out);
    let cells = report::cells(&report, Tolerances::built_in().map_err(super::diagnostic::diagnose)?.coverage_factor());
    print(&match args.format {
        TextOrJson::Terminal => cells_told(&report, &cells),
        TextOrJson::Json => json(&cells)?,
    })?;
    Ok(exit(&cells))
}

/// 0 where every cell comes out again, 1 where one does not, 4 where one is undecided, 3 where nothing was read for one.
fn exit(cells: &[Cell]) -> Exit {
    let of = |cell: &Cell| match cell.standing {
        Standing::Reproduced => Exit::Passed,
        Standing::Undecided => Exit::Undecided,
        Standing::NotReproduced => Exit::Failed,
        Standing::NotRead => Exit::Engine,
    };
    cells.iter().map(of).max().unwrap_or(Exit::Engine)
}

/// A sentence, and a line a cell.
fn cells_told(report: &Report, cells: &[Cell]) -> String {
    let count = |standing| cells.iter().filter(|cell| cell.standing == standing).count();
    let of = [Standing::NotReproduced, Standing::Undecided, Standing::NotRead].map(|s| (count(s), s));
    let rest: Vec<String> =
        of.into_iter().filter(|(n, _)| *n > 0).map(|(n, standing)| format!("{n} {standing}")).collect();
    let misfits = cells.iter().filter(|cell| cell.standing != Standing::Reproduced && cell.note.is_some()).count();
    let title = report.published.first().map_or(report.spec.title.as_str(), |table| &table.title);
    let mut text = format!(
        "{title}: {} of {} printed cells come out again within their rounding",
        count(Standing::Reproduced),
        cells.len()
    );
    text += &if rest.is_empty() { String::new() } else { format!("; {}", rest.join(", ")) };
    text += &if misfits == 0 { "\n".to_owned() } else { format!(" ({misfits} of them do not fit their own table)\n") };
    let mut tables: BTreeMap<&str, Vec<&Cell>> = BTreeMap::new();
    for cell in cells {
        tables.entry(&cell.table).or_default().push(cell);
    }
    for (table, cells) in tables {
        let unit = cells.first().map_or("", |cell| cell.unit);
        text += &format!("\n{table} [{unit}]\n");
        text += &rows(&cells);
    }
    text
}

fn rows(cells: &[&Cell]) -> String {
    let head = ["column", "place", "printed", "computed", "by", "verdict"].map(str::to_owned);
    let row = |cell: &&Cell| {
        let computed = cell.computed.zip(cell.uncertainty).map(|(value, u)| words::interval(value, u));
        let note = cell.note.as_ref().map_or_else(String::new, |note| format!(": {note}"));
        [
            cell.column.clone(),
            cell.place.clone(),
            format!("{} +- {}", cell.printed, words::trimmed(cell.rounding, 9)),
            computed.unwrap_or_else(|| "-".to_owned()),
            format!("{}, {}", cell.engine, cell.model),
            format!("{}{note}", cell.standing),
        ]
    };
    let rows: Vec<[String; 6]> = std::iter::once(head).chain(cells.iter().map(row)).collect();
    let width = |k: usize| rows.iter().map(|row| row[k].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..6).map(width).collect();
    let line = |row: &[String; 6]| {
        let padded = row.iter().zip(&widths).map(|(cell, width)| format!("{cell:<width$}")).collect::<Vec<_>>();
        format!("  {}\n", padded.join("  ").trim_end())
    };
    rows.iter().map(line).collect()
}
