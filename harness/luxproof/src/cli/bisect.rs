//! `luxproof bisect`: the release of an engine at which a verdict changed.

use luxproof_process::files;
use std::path::{Path, PathBuf};

use clap::Args;
use miette::{IntoDiagnostic, Report as Diagnostic};

use super::engines::report_installation;
use super::not_audited;
use super::{Narrowed, TextOrJson};
use luxproof_audit::measure::cache::Cache;
use luxproof_audit::{AuditError, Calibration, Diagnosis, Options};
use luxproof_console::diagnose;
use luxproof_console::{complain, json, print};
use luxproof_engines::EngineRoot;
use luxproof_lab::bisect::{self, Bisection, Refused, ReleaseVerdicts};
use luxproof_model::Exit;
use luxproof_model::Release;
use luxproof_model::Verdict;
use luxproof_process::output_lock::OutputLock;
use luxproof_process::process;
use luxproof_spec::{Case, Trust};
use luxproof_verdict::PolicyChoice;

#[derive(Debug, Args)]
pub(super) struct BisectArgs {
    /// Spec files, folders of specs, or patterns
    #[arg(required = true, value_name = "SPEC")]
    specs: Vec<PathBuf>,
    /// The engine
    ///
    /// Your own program needs `releases` in its settings in the spec.
    #[arg(long, value_name = "NAME")]
    engine: String,
    /// A release that passes
    #[arg(long, value_name = "RELEASE")]
    good: Release,
    /// A release that fails, earlier or later
    #[arg(long, value_name = "RELEASE")]
    bad: Release,
    /// Search only these releases [default: all]
    #[arg(long, value_delimiter = ',', value_name = "RELEASES")]
    releases: Vec<Release>,
    /// Install missing releases instead of skipping them
    #[arg(long)]
    install: bool,
    #[command(flatten)]
    narrowed: Narrowed,
    /// Folder to write [default: luxproof-out/bisect/<spec>]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Threads or processes [default: one per core]
    #[arg(long, value_name = "N", value_parser = super::at_least_one)]
    jobs: Option<usize>,
    /// Format to print
    #[arg(long, value_enum, value_name = "FORMAT", default_value_t = TextOrJson::Terminal)]
    format: TextOrJson,
    #[command(flatten)]
    policy: PolicyChoice,
}

/// Why it came to no end.
enum Stopped {
    Refused(Refused),
    Audit(AuditError),
    Interrupted,
}

impl From<Refused> for Stopped {
    fn from(refused: Refused) -> Self {
        Self::Refused(refused)
    }
}

pub(super) fn run(args: &BisectArgs, site: &EngineRoot, cache: &Cache, trust: Trust) -> Result<Exit, Diagnostic> {
    let name = args.specs.first().and_then(|spec| files::stem(spec)).unwrap_or("suite".as_ref());
    let out = args.out.clone().unwrap_or_else(|| Path::new("luxproof-out/bisect").join(name));
    // The releases of an engine of ours are checked before the specs are read.
    let ours = known_of_ours(&args.engine)?.map(|known| range(args, &known)).transpose()?;
    let asked = BisectRun { args, site, cache, trust, out, is_ours: ours.is_some() };
    let (cases, _) = luxproof_audit::chosen(&args.specs, &asked.options(&args.good)).map_err(diagnose)?;
    let releases = ours.map_or_else(|| range(args, &known_of_program(&args.engine, &cases)?), Ok)?;
    let _claim = OutputLock::of(&asked.out).into_diagnostic()?;
    let found = bisect::bisect(
        &args.engine,
        &releases,
        |release: &Release| asked.absence(release),
        |release: &Release| asked.judge(release),
    );
    match found {
        Ok(found) => print_found(&found, args.format),
        Err(Stopped::Refused(refused @ Refused::Silent { .. })) => {
            complain(&format!("bisect: {refused}; take another release for this end, or --install"));
            Ok(Exit::Engine)
        }
        Err(Stopped::Refused(refused)) => {
            let help = match refused {
                Refused::Swapped { .. } => "name the ends the other way round: that finds what mended it",
                _ => "there is nothing to be found; `luxproof diff` of the two runs shows what else changed",
            };
            Err(miette::miette!(help = help, "{refused}"))
        }
        Err(Stopped::Audit(error)) => Err(not_audited(error)),
        Err(Stopped::Interrupted) => Ok(Exit::Engine),
    }
}

/// A search among an engine's releases.
struct BisectRun<'a> {
    args: &'a BisectArgs,
    site: &'a EngineRoot,
    cache: &'a Cache,
    trust: Trust,
    out: PathBuf,
    /// Whether the engine is one of ours, which can be installed.
    is_ours: bool,
}

impl BisectRun<'_> {
    /// The options of the audit of one release.
    fn options(&self, release: &Release) -> Options<'_> {
        let args = self.args;
        Options {
            cache: Some(self.cache.clone()),
            jobs: args.jobs.unwrap_or_else(process::cores),
            selection: args.narrowed.selection(&[named(&args.engine, release)]),
            filter: args.narrowed.filter.clone(),
            trust: self.trust,
            policy: args.policy.clone(),
            calibration: Calibration::LeftOut,
            diagnosis: Diagnosis::LeftOut,
            ..super::audit_options(self.site.clone(), self.out.join(release.as_str()))
        }
    }

    /// Why a release cannot be run, where it is absent and not to be installed.
    fn absence(&self, release: &Release) -> Option<String> {
        let engine = luxproof_engines::built_in(&named(&self.args.engine, release)).ok()?;
        engine.filter(|_| !self.args.install)?.probe(self.site).err().map(|absent| absent.to_string())
    }

    /// Runs the audit with one release, and reports its verdicts on standard error.
    fn judge(&self, release: &Release) -> Result<ReleaseVerdicts, Stopped> {
        let name = named(&self.args.engine, release);
        let installs = self.args.install && self.is_ours;
        if installs && report_installation(self.site, std::slice::from_ref(&name)) != Exit::Passed {
            return Ok(Err("it could not be installed".to_owned()));
        }
        let report = luxproof_audit::run(&self.args.specs, &self.options(release)).map_err(Stopped::Audit)?;
        if process::is_interrupted() {
            return Err(Stopped::Interrupted);
        }
        let answer = bisect::verdicts_on(&report, &name);
        let [pass, fail] = [Verdict::Pass, Verdict::Fail]
            .map(|verdict| report.comparisons.iter().filter(|c| c.key.engine == *name && c.verdict == verdict).count());
        let summary = match &answer {
            Ok(_) => format!("{pass} pass, {fail} fail"),
            Err(why) => format!("skipped: {why}"),
        };
        complain(&format!("{name}: {summary}"));
        Ok(answer)
    }
}

/// Prints the release that a search found.
fn print_found(found: &Bisection, format: TextOrJson) -> Result<Exit, Diagnostic> {
    print(&match format {
        TextOrJson::Terminal => found.to_string(),
        TextOrJson::Json => json(found)?,
    })?;
    Ok(if found.is_one() { Exit::Passed } else { Exit::Undecided })
}

fn named(engine: &str, release: &Release) -> String {
    format!("{engine}@{release}")
}

/// The releases of an engine of ours, oldest first; `None` where it is none.
fn known_of_ours(engine: &str) -> Result<Option<Vec<Release>>, Diagnostic> {
    match luxproof_engines::releases_of(engine) {
        none if none.is_empty() && luxproof_engines::entry(engine).is_some() => Err(unknown(engine)),
        none if none.is_empty() => Ok(None),
        all => Ok(Some(all)),
    }
}

/// The releases that the settings of a program name, oldest first.
fn known_of_program(engine: &str, cases: &[Case]) -> Result<Vec<Release>, Diagnostic> {
    let settings = cases.iter().map(|case| case.settings_of(engine)).find(|settings| !settings.is_empty());
    let theirs = settings.map(|s| luxproof_engines::releases_of_program(engine, &s)).transpose().into_diagnostic()?;
    theirs.filter(|known| !known.is_empty()).ok_or_else(|| unknown(engine))
}

fn unknown(engine: &str) -> Diagnostic {
    let names = luxproof_engines::ALL.iter().map(|entry| entry.name.as_str());
    let have: Vec<&str> = names.filter(|name| !luxproof_engines::releases_of(name).is_empty()).collect();
    let help = format!(
        "they are known of {}; a program of your own names them in the spec, `releases: {{\"1.0\": [program, arguments...]}}`",
        have.join(", ")
    );
    miette::miette!(help = help, "no releases are known of `{engine}`")
}

/// From the good end to the bad one.
fn range(args: &BisectArgs, known: &[Release]) -> Result<Vec<Release>, Diagnostic> {
    if let Some(strange) = [&args.good, &args.bad].into_iter().chain(&args.releases).find(|r| !known.contains(r)) {
        let listed = known.iter().map(Release::as_str).collect::<Vec<_>>().join(", ");
        return Err(miette::miette!(help = format!("known: {listed}"), "{} has no release {strange}", args.engine));
    }
    let (good, bad) = (&args.good, &args.bad);
    if good == bad {
        return Err(miette::miette!("--good and --bad are one release, {good}: there is nothing between"));
    }
    let (low, high) = (good.min(bad), good.max(bad));
    // Both ends take part, listed or not.
    let between = known.iter().filter(|release| (low..=high).contains(release));
    let taken = between
        .filter(|release| [good, bad].contains(release) || args.releases.is_empty() || args.releases.contains(release));
    let mut all: Vec<Release> = taken.cloned().collect();
    if good > bad {
        all.reverse();
    }
    Ok(all)
}
