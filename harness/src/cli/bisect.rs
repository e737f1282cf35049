//! `luxproof bisect`: the release of an engine at which a verdict changed.

use std::path::{Path, PathBuf};

use clap::Args;
use miette::{IntoDiagnostic, Report as Diagnostic};

use super::diagnostic::{diagnose, not_audited};
use super::engines::report_installation;
use super::{Narrowed, TextOrJson, complain, json, print};
use crate::audit::{self, AuditError, Calibration, Diagnosis, Options};
use crate::engines::{self, Site};
use crate::experiments::bisect::{self, Found, Look, Refused};
use crate::judge::{PolicyChoice, Verdict};
use crate::measure::cache::Cache;
use crate::record::Release;
use crate::report::Exit;
use crate::spec::{Case, Trust};
use crate::system::claim::Claim;
use crate::system::process;

#[derive(Debug, Args)]
pub(super) struct BisectArgs {
    /// Spec files, folders of them or patterns
    #[arg(required = true, value_name = "SPEC")]
    specs: Vec<PathBuf>,
    /// The engine: one of ours, or a program of yours whose settings in the spec have `releases`
    #[arg(long, value_name = "NAME")]
    engine: String,
    /// A release at which comparisons pass
    #[arg(long, value_name = "RELEASE")]
    good: Release,
    /// A release at which some of them fail, later or earlier
    #[arg(long, value_name = "RELEASE")]
    bad: Release,
    /// The releases to look among [default: all that are known]
    #[arg(long, value_delimiter = ',', value_name = "RELEASES")]
    releases: Vec<Release>,
    /// Install releases that are looked at and not there; without it they are skipped
    #[arg(long)]
    install: bool,
    #[command(flatten)]
    narrowed: Narrowed,
    /// Folder of the runs' files, one a release [default: luxproof-out/bisect/<spec name>]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Threads or processes at a time [default: one a core]
    #[arg(long, value_name = "N", value_parser = super::at_least_one)]
    jobs: Option<usize>,
    /// View to print
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

pub(super) fn run(args: &BisectArgs, site: &Site, cache: &Cache, trust: Trust) -> Result<Exit, Diagnostic> {
    let name = args.specs.first().and_then(|spec| spec.file_stem()).unwrap_or("suite".as_ref());
    let out = args.out.clone().unwrap_or_else(|| Path::new("luxproof-out/bisect").join(name));
    let options = |release: &Release| Options {
        cache: Some(cache.clone()),
        jobs: args.jobs.unwrap_or_else(process::cores),
        selection: args.narrowed.selection(&[named(&args.engine, release)]),
        filter: args.narrowed.filter.clone(),
        trust,
        policy: args.policy.clone(),
        calibration: Calibration::LeftOut,
        diagnosis: Diagnosis::LeftOut,
        ..Options::new(site.clone(), out.join(release.as_str()))
    };
    let ours = known_of_ours(&args.engine)?;
    // Names are told before specs are read where they can be.
    let ours = ours.map(|known| range(args, &known)).transpose()?;
    let (cases, _) = audit::chosen(&args.specs, &options(&args.good)).map_err(diagnose)?;
    let is_ours = ours.is_some();
    let releases = ours.map_or_else(|| range(args, &known_of_program(&args.engine, &cases)?), Ok)?;
    let absent = |release: &Release| {
        let engine = engines::built_in(&named(&args.engine, release)).ok()?;
        engine.filter(|_| !args.install)?.probe(site).err().map(|absent| absent.to_string())
    };
    let _claim = Claim::of(&out).into_diagnostic()?;
    let ask = |release: &Release| -> Result<Look, Stopped> {
        let name = named(&args.engine, release);
        if args.install && is_ours && report_installation(site, std::slice::from_ref(&name)) != Exit::Passed {
            return Ok(Err("it could not be installed".to_owned()));
        }
        let report = audit::run(&args.specs, &options(release)).map_err(Stopped::Audit)?;
        if process::is_interrupted() {
            return Err(Stopped::Interrupted);
        }
        let look = bisect::look(&report, &name);
        let count = |passes| report.comparisons.iter().filter(|c| c.key.engine == *name && c.verdict == passes).count();
        let told = match &look {
            Ok(_) => format!("{} pass, {} fail", count(Verdict::Pass), count(Verdict::Fail)),
            Err(why) => format!("skipped: {why}"),
        };
        complain(&format!("{name}: {told}"));
        Ok(look)
    };
    match bisect::bisect(&args.engine, &releases, absent, ask) {
        Ok(found) => told(&found, args.format),
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

fn told(found: &Found, format: TextOrJson) -> Result<Exit, Diagnostic> {
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
    match engines::releases_of(engine) {
        none if none.is_empty() && engines::entry(engine).is_some() => Err(unknown(engine)),
        none if none.is_empty() => Ok(None),
        all => Ok(Some(all)),
    }
}

/// The releases that the settings of a program name, oldest first.
fn known_of_program(engine: &str, cases: &[Case]) -> Result<Vec<Release>, Diagnostic> {
    let settings = cases.iter().map(|case| case.settings_of(engine)).find(|settings| !settings.is_empty());
    let theirs = settings.map(|s| engines::releases_of_program(engine, &s)).transpose().into_diagnostic()?;
    theirs.filter(|known| !known.is_empty()).ok_or_else(|| unknown(engine))
}

fn unknown(engine: &str) -> Diagnostic {
    let has_some = |name: &&str| !engines::releases_of(name).is_empty();
    let have: Vec<&str> = engines::ALL.iter().map(|entry| entry.name.as_str()).filter(has_some).collect();
    let help = format!(
        "they are known of {}; a program of your own names them in the spec, `releases: {{\"1.0\": [program, arguments...]}}`",
        have.join(", ")
    );
    miette::miette!(help = help, "no releases are known of `{engine}`")
}

/// From the good end to the bad one.
fn range(args: &BisectArgs, known: &[Release]) -> Result<Vec<Release>, Diagnostic> {
    let listed = || known.iter().map(Release::as_str).collect::<Vec<_>>().join(", ");
    if let Some(strange) = [&args.good, &args.bad].into_iter().chain(&args.releases).find(|r| !known.contains(r)) {
        return Err(miette::miette!(help = format!("known: {}", listed()), "{} has no release {strange}", args.engine));
    }
    let (good, bad) = (&args.good, &args.bad);
    if good == bad {
        return Err(miette::miette!("--good and --bad are one release, {good}: there is nothing between"));
    }
    let (low, high) = (good.min(bad), good.max(bad));
    let is_end = |r: &Release| r == good || r == bad;
    let is_taken = |r: &Release| is_end(r) || args.releases.is_empty() || args.releases.contains(r);
    let mut all: Vec<Release> = known.iter().filter(|r| (low..=high).contains(r) && is_taken(r)).cloned().collect();
    if good > bad {
        all.reverse();
    }
    Ok(all)
}
