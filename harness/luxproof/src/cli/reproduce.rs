//! `luxproof reproduce`: a bundle verified and run again, a paper's tables, a standard's printed tables, or a study.

use luxproof_process::files;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::Args;
use miette::{Report as Diagnostic, miette};

use super::bundle::refused;
use super::not_audited;
use super::progress::Progress;
use super::views::keep_page;
use super::{TextOrJson, at_least_one};
use crate::bundle::{self, Difference, EngineThen, Opened, Outcome, Reproduction, Row};
use crate::standard_tables::{self, CopyJudgement};
use crate::study::{self, Explanation};
use luxproof_audit::measure::cache::Cache;
use luxproof_audit::{Calibration, Options};
use luxproof_console::{complain, json, print};
use luxproof_engines::EngineRoot;
use luxproof_model::ProcedureId;
use luxproof_model::Sampling;
use luxproof_model::{Exit, Report};
use luxproof_process::printable::{Quoted, quoted};
use luxproof_process::process;
use luxproof_report::words;
use luxproof_spec::{Case, Trust};
use luxproof_verdict::{Cell, Standing};
use luxproof_verdict::{Published, Tolerances};

#[derive(Debug, Args)]
pub(super) struct ReproduceArgs {
    /// A bundle (folder or .zip), published tables (YAML), a study (folder), or `cie171`
    what: PathBuf,
    /// Only verify the files of the bundle
    #[arg(long)]
    verify: bool,
    /// Trust the specs of the bundle: they may run programs
    #[arg(long)]
    trusted: bool,
    /// Tables only: use these procedures
    #[arg(long, value_delimiter = ',', value_name = "NAMES")]
    procedures: Vec<ProcedureId>,
    /// Tables only: relative standard error to reach [default: that of the spec]
    #[arg(long, value_name = "ERROR", value_parser = positive)]
    relative_error: Option<f64>,
    /// Folder of the results [default: luxproof-out/<name>-again; for tables luxproof-out/<name>]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Threads or processes [default: one per core]
    #[arg(long, value_name = "N", value_parser = at_least_one)]
    jobs: Option<usize>,
    /// Format to print
    #[arg(long, value_enum, value_name = "FORMAT", default_value_t = TextOrJson::Terminal)]
    format: TextOrJson,
    /// With `cie171`: your copy of its printed tables [default: print the template to fill in]
    #[arg(long, value_name = "FILE")]
    printed: Option<PathBuf>,
}

pub(super) fn reproduce(
    args: &ReproduceArgs,
    site: &EngineRoot,
    cache: impl FnOnce() -> Result<Cache, Diagnostic>,
    trust: Trust,
) -> Result<Exit, Diagnostic> {
    let is_standard = args.what.as_os_str() == STANDARD && !args.what.exists();
    if let Some(copy) = &args.printed {
        if !is_standard {
            return Err(miette!("--printed is of `cie171`, and this is {}", args.what.display()));
        }
        return judge_copy(copy, trust, args.format);
    }
    if is_standard {
        print(standard_tables::TEMPLATE)?;
        return Ok(Exit::Passed);
    }
    if let Some(file) = study::study_file(&args.what) {
        return explain_study(&file, trust, args.format);
    }
    if bundle::is_bundle(&args.what) {
        return again(args, site, trust);
    }
    if args.verify || args.trusted {
        return Err(miette!("{} is no bundle, and --verify and --trusted are of bundles", args.what.display()));
    }
    paper(args, site, cache()?, trust)
}

/// The name of the standard with printed tables.
const STANDARD: &str = "cie171";

/// Judges a user's copy of the standard's printed tables; exit 1 if a cell is wrong.
fn judge_copy(copy: &Path, trust: Trust, format: TextOrJson) -> Result<Exit, Diagnostic> {
    let judgement = standard_tables::judge_copy(copy, trust).map_err(luxproof_console::diagnose)?;
    print(&match format {
        TextOrJson::Terminal => copy_text(&judgement),
        TextOrJson::Json => json(&judgement)?,
    })?;
    Ok(if judgement.wrong.is_empty() { Exit::Passed } else { Exit::Failed })
}

/// A sentence on all cells, and two lines per wrong one.
fn copy_text(judgement: &CopyJudgement) -> String {
    let filled = judgement.agree + judgement.wrong.len();
    let mut text = format!("CIE 171:2006: {} of {filled} printed cells agree within rounding", judgement.agree);
    if judgement.left_out > 0 {
        text += &format!("; {} left out", judgement.left_out);
    }
    text += "\n";
    for cell in &judgement.wrong {
        text += &format!(
            "  {} {} {}: {} % printed, {} % derived, {:+.2} %\n    {}\n",
            cell.table,
            cell.sky,
            cell.point,
            cell.printed,
            words::significant(cell.derived),
            cell.deviation_percent,
            cell.contradicted_by
        );
    }
    text
}

/// Explains the published deviations of a study; exit 4 if some stay open.
fn explain_study(file: &Path, trust: Trust, format: TextOrJson) -> Result<Exit, Diagnostic> {
    let explanation = study::explain(file, trust).map_err(luxproof_console::diagnose)?;
    print(&match format {
        TextOrJson::Terminal => study_text(&explanation),
        TextOrJson::Json => json(&explanation)?,
    })?;
    let is_open = explanation.deviations.iter().any(|deviation| !deviation.is_explained);
    Ok(if is_open { Exit::Undecided } else { Exit::Passed })
}

/// A sentence on all deviations, one line each, and what their causes mean.
fn study_text(explanation: &Explanation) -> String {
    let all = explanation.deviations.len();
    let explained = explanation.deviations.iter().filter(|d| d.is_explained).count();
    let scatter = explanation.deviations.iter().filter(|d| d.is_explained && d.is_scatter).count();
    let mut text = format!("{}: {explained} of {all} published deviations are explained", explanation.title);
    if scatter > 0 {
        text += &format!(": {} by causes, {scatter} as scatter alone", explained - scatter);
    }
    text += ".\nNo engine runs: shares and rests are computed from the numbers of the study's file.\n\n";
    for deviation in &explanation.deviations {
        let causes: Vec<String> = deviation.contributions.iter().map(contribution_text).collect();
        let verdict = match (deviation.is_explained, deviation.is_scatter) {
            (true, true) => "within scatter",
            (true, false) => "explained",
            (false, _) => "open",
        };
        text += &format!(
            "  {:<18} {:<4} {:>+7.2} %  {}; rest {:+.2} ± {:.2} %: {verdict}\n",
            deviation.case,
            deviation.point,
            deviation.published_percent,
            if causes.is_empty() { "no known cause".to_owned() } else { causes.join(", ") },
            deviation.rest_percent,
            deviation.uncertainty_percent
        );
    }
    text += "\n";
    for (name, meaning) in &explanation.causes {
        text += &format!("  {name}: {meaning}\n");
    }
    text += &format!("source: {}\n", explanation.source);
    text
}

/// A cause with its deviation and its share of the published one.
fn contribution_text(contribution: &study::Contribution) -> String {
    let study::Contribution { cause, percent, uncertainty_percent, share } = contribution;
    if *percent == 0.0 {
        return format!("{cause} ± {uncertainty_percent:.2} %");
    }
    format!("{cause} {percent:+.2} % (share {:.0} %)", 100.0 * share)
}

/// A bundle's run, made again without any reading that is kept.
fn again(args: &ReproduceArgs, site: &EngineRoot, trust: Trust) -> Result<Exit, Diagnostic> {
    if !args.procedures.is_empty() || args.relative_error.is_some() {
        return Err(miette!("--procedures and --relative-error are of papers: a bundle's run is made again as it was"));
    }
    if args.trusted && trust != Trust::Own {
        return Err(miette!("--trusted and --untrusted (or LUXPROOF_UNTRUSTED) contradict each other"));
    }
    let of_bundle = if args.trusted { Trust::Own } else { Trust::Bundled };
    let opened = Opened::read(&args.what, of_bundle).map_err(refused)?;
    let whole = format!("{}: {} files, whole; SHA-256 {}", args.what.display(), opened.files, opened.sha256);
    if args.verify {
        print(&format!("{whole}\n"))?;
        return Ok(Exit::Passed);
    }
    complain(&whole);
    let progress = Progress::new();
    let options = options(args, site, of_bundle, "-again", &progress);
    let out = options.out.clone();
    let (reproduction, report) = opened.again(options).map_err(not_audited)?;
    drop(progress);
    keep_page(&report, &out);
    print(&match args.format {
        TextOrJson::Terminal => reproduction_text(&reproduction),
        TextOrJson::Json => json(&reproduction)?,
    })?;
    Ok(reproduction.exit())
}

fn options<'a>(
    args: &ReproduceArgs,
    site: &EngineRoot,
    trust: Trust,
    after: &str,
    progress: &'a Progress,
) -> Options<'a> {
    let whole = std::path::absolute(&args.what).unwrap_or_default();
    let name = files::stem(&whole).map_or_else(|| "run".to_owned(), |name| name.to_string_lossy().into_owned());
    let out = args.out.clone().unwrap_or_else(|| Path::new(super::last_run::RUNS).join(name + after));
    let jobs = args.jobs.unwrap_or_else(process::cores);
    Options { jobs, trust, observer: progress, ..super::audit_options(site.clone(), out) }
}

/// The text of a reproduction: a sentence, engines that changed, and rows that differ.
fn reproduction_text(reproduction: &Reproduction) -> String {
    let [same, within, differs, unread] = [Outcome::SameBytes, Outcome::Within, Outcome::Differs, Outcome::NotRead]
        .map(|outcome| reproduction.count(outcome));
    let rows = reproduction.rows.len();
    let mut parts = vec![format!("{same} to the byte")];
    let counted = [(within, "within uncertainties"), (differs, "differ"), (unread, "not read")];
    parts.extend(counted.into_iter().filter(|(n, _)| *n > 0).map(|(n, what)| format!("{n} {what}")));
    let verdict = if reproduction.exit() == Exit::Passed { "reproduced" } else { "not reproduced" };
    let comparisons: usize = reproduction.rows.iter().map(|row| row.comparisons).sum();
    let mut text = format!(
        "{}: {verdict}. Of {rows} procedures of engines ({comparisons} comparisons) {}\n",
        Quoted(&reproduction.title),
        parts.join(", ")
    );
    let (then, now) = (&reproduction.tool_then, &reproduction.tool_now);
    if then != now {
        text += &format!("  luxproof {} then, {now} now\n", Quoted(&then.to_string()));
    }
    reproduction.engines.iter().filter(|engine| !engine.is_the_same).for_each(|engine| text += &engine_text(engine));
    let other: Vec<&Row> = reproduction.rows.iter().filter(|row| row.outcome != Outcome::SameBytes).collect();
    for row in other.iter().take(MAX_ROWS) {
        text += &row_text(row);
    }
    if other.len() > MAX_ROWS {
        text += &format!("  and {} more: --format json\n", other.len() - MAX_ROWS);
    }
    text
}

/// A line on an engine that is not what it was.
fn engine_text(engine: &EngineThen) -> String {
    let EngineThen { id, version_then, version_now, reason, .. } = engine;
    let id = Quoted(id.as_str());
    let then = Quoted(version_then.as_deref().unwrap_or("no version"));
    match version_now {
        Some(now) if now == then.0 => format!("  {id}: {then} as then, of other bytes (its fingerprint differs)\n"),
        Some(now) => format!("  {id}: {then} then, {now} now\n"),
        None => {
            format!("  {id}: {then} then, absent now ({})\n", Quoted(reason.as_deref().unwrap_or("no reason given")))
        }
    }
}

/// The most rows that are printed; the rest are counted.
const MAX_ROWS: usize = 100;

/// The most differences of a row that are printed; the rest are counted.
const MAX_DIFFERENCES: usize = 5;

/// The lines on a row: its outcome and its first differences.
fn row_text(row: &Row) -> String {
    let outcome = match row.outcome {
        Outcome::SameBytes => "the same bytes",
        Outcome::Within => "within uncertainties",
        Outcome::Differs => "DIFFERS",
        Outcome::NotRead => "NOT READ",
    };
    let notes = row.notes.iter().fold(String::new(), |notes, note| notes + "; " + &quoted(note));
    let mut text = format!("  {}: {outcome}{notes}\n", row.key);
    for Difference { meter, against, then, now, unit, verdict_then, verdict_now } in
        row.differences.iter().take(MAX_DIFFERENCES)
    {
        let [then, now] = [then, now].map(|value| value.map_or_else(|| "-".to_owned(), words::significant));
        let verdict = match verdict_now {
            Some(now) if now == verdict_then => now.name().to_owned(),
            now => format!("{} then, {} now", verdict_then.name(), now.map_or("none", |v| v.name())),
        };
        text += &format!("    {meter}: {then} then, {now} {unit} now against {against}: {verdict}\n");
    }
    let more = row.differences.len().saturating_sub(MAX_DIFFERENCES);
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

/// Whether a case names this file as its published tables.
fn names_tables(case: &Case, tables: &Path) -> bool {
    let named = case.published.as_ref().and_then(|table| table.canonicalize().ok());
    named.is_some() && named == tables.canonicalize().ok()
}

/// Runs the spec that a paper's tables name, and compares every printed cell with the new readings.
fn paper(args: &ReproduceArgs, site: &EngineRoot, cache: Cache, trust: Trust) -> Result<Exit, Diagnostic> {
    let published = Published::read_named(&args.what, trust).map_err(luxproof_console::diagnose)?;
    let Some(spec) = published.spec(trust) else {
        return Err(miette!(
            help = "add the spec that has the geometry, relative to it: `spec: ../specs/name.yaml`",
            "{} names no spec",
            args.what.display()
        ));
    };
    let spec = spec.map_err(luxproof_console::diagnose)?;
    let cases = Case::load_all(&spec, trust).map_err(luxproof_console::diagnose)?;
    if !cases.iter().any(|case| names_tables(case, &args.what)) {
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
    // Other engines have no cell in the tables.
    options.selection.engines = published.engines().into_iter().map(str::to_owned).collect();
    options.selection.procedures.clone_from(&args.procedures);
    let (report, _claim) = luxproof_audit::run_and_hold(&[spec], &options).map_err(not_audited)?;
    let out = options.out.clone();
    drop(progress);
    keep_page(&report, &out);
    let cells =
        luxproof_verdict::cells(&report, Tolerances::built_in().map_err(luxproof_console::diagnose)?.coverage_factor());
    print(&match args.format {
        TextOrJson::Terminal => cells_text(&report, &cells),
        TextOrJson::Json => json(&cells)?,
    })?;
    Ok(exit(&cells))
}

/// The exit code of one cell.
const fn cell_exit(standing: Standing) -> Exit {
    match standing {
        Standing::Reproduced => Exit::Passed,
        Standing::Undecided => Exit::Undecided,
        Standing::NotReproduced => Exit::Failed,
        Standing::NotRead => Exit::Engine,
    }
}

/// The gravest of the cells' exit codes; cells without any are an engine's failure.
fn exit(cells: &[Cell]) -> Exit {
    cells.iter().map(|cell| cell_exit(cell.standing)).max().unwrap_or(Exit::Engine)
}

/// The number of cells of a standing.
fn count_cells(cells: &[Cell], standing: Standing) -> usize {
    cells.iter().filter(|cell| cell.standing == standing).count()
}

/// A sentence on all cells, and one line per cell.
fn cells_text(report: &Report, cells: &[Cell]) -> String {
    let of = [Standing::NotReproduced, Standing::Undecided, Standing::NotRead].map(|s| (count_cells(cells, s), s));
    let rest: Vec<String> =
        of.into_iter().filter(|(n, _)| *n > 0).map(|(n, standing)| format!("{n} {standing}")).collect();
    let title = report.published.first().map_or(report.spec.title.as_str(), |table| &table.title);
    let mut text = format!(
        "{title}: {} of {} printed cells come out again within their rounding",
        count_cells(cells, Standing::Reproduced),
        cells.len()
    );
    text += &if rest.is_empty() { "\n".to_owned() } else { format!("; {}\n", rest.join(", ")) };
    text += &misfits_text(cells);
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

/// A line on the cells that do not fit the other columns of their own table, by their standings; empty without any.
fn misfits_text(cells: &[Cell]) -> String {
    let misfits: Vec<&Cell> = cells.iter().filter(|cell| !cell.fits_table).collect();
    if misfits.is_empty() {
        return String::new();
    }
    let standings = [Standing::Reproduced, Standing::NotReproduced, Standing::Undecided, Standing::NotRead];
    let counts = standings.map(|standing| (misfits.iter().filter(|cell| cell.standing == standing).count(), standing));
    let counts: Vec<String> =
        counts.into_iter().filter(|(n, _)| *n > 0).map(|(n, standing)| format!("{n} {standing}")).collect();
    let count = misfits.len();
    let misfit = if count == 1 { "does not fit its" } else { "do not fit their" };
    format!("of all {} cells {count} {misfit} own table: {}\n", cells.len(), counts.join(", "))
}

/// The columns of a cell's line.
fn columns(cell: &Cell) -> [String; 6] {
    let computed = cell.computed.zip(cell.uncertainty).map(|(value, u)| words::interval(value, u));
    let note = cell.note.as_ref().map_or_else(String::new, |note| format!(": {note}"));
    [
        cell.column.clone(),
        cell.place.clone(),
        format!("{} ± {}", cell.printed, words::trimmed(cell.rounding, 9)),
        computed.unwrap_or_else(|| "-".to_owned()),
        format!("{}, {}", cell.engine, cell.model),
        format!("{}{note}", cell.standing),
    ]
}

/// A row's line, with every column padded to its width.
fn padded_line(row: &[String; 6], widths: &[usize; 6]) -> String {
    let padded: Vec<String> = row.iter().zip(widths).map(|(cell, width)| format!("{cell:<width$}")).collect();
    format!("  {}\n", padded.join("  ").trim_end())
}

/// A head and the cells' lines, in aligned columns.
fn rows(cells: &[&Cell]) -> String {
    let head = ["column", "place", "printed", "computed", "by", "verdict"].map(str::to_owned);
    let rows: Vec<[String; 6]> = std::iter::once(head).chain(cells.iter().map(|cell| columns(cell))).collect();
    let widths = std::array::from_fn(|k| rows.iter().map(|row| row[k].chars().count()).max().unwrap_or(0));
    rows.iter().map(|row| padded_line(row, &widths)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cell(standing: Standing, fits_table: bool) -> Cell {
        Cell {
            table: "Table 1".into(),
            column: "lum2".into(),
            place: "(2, 2, 2)".into(),
            printed: "1.99".into(),
            rounding: 0.01,
            unit: "lx",
            engine: "radiance".into(),
            model: "area".into(),
            computed: Some(2.0),
            uncertainty: Some(0.01),
            standing,
            fits_table,
            // A note alone, such as why nothing was read, is no misfit.
            note: Some("a note".into()),
        }
    }

    #[test]
    fn cells_that_do_not_fit_their_table_are_counted_of_all_cells_whatever_their_standing() {
        let (same, open, none) = (Standing::Reproduced, Standing::Undecided, Standing::NotRead);
        let cells = [cell(same, false), cell(same, true), cell(open, false), cell(open, false), cell(none, true)];
        let text = misfits_text(&cells);
        assert_eq!(text, "of all 5 cells 3 do not fit their own table: 1 within rounding, 2 undecided\n");
        assert_eq!(misfits_text(&cells[..2]), "of all 2 cells 1 does not fit its own table: 1 within rounding\n");
        assert_eq!(misfits_text(&cells[1..2]), "");
    }
}
