//! `luxproof cards`: the site of score cards, submissions to it, and hidden variants.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use miette::{IntoDiagnostic, Report as Diagnostic, miette};

use super::bundle::refused;
use super::progress::Progress;
use super::views::{read_report, report_file};
use super::{at_least_one, not_audited};
use crate::bundle::{self, Opened, Outcome, Reproduction};
use luxproof_audit::Options;
use luxproof_cards::{
    Capabilities, CardRun, Cards, CaseDifference, RunId, SiteFolder, Verification, compare_cases, site,
};
use luxproof_console::{complain, diagnose, print};
use luxproof_engines::EngineRoot;
use luxproof_lab::variants::{VariantError, draw_variants};
use luxproof_model::numbers::plural;
use luxproof_model::{Exit, REPORT_FILE, Report, Role};
use luxproof_process::files::{self, FileError};
use luxproof_process::foreign_json;
use luxproof_process::printable::quoted;
use luxproof_process::process;
use luxproof_spec::Trust;
use luxproof_verdict::{PolicyChoice, PolicySearch};

/// The folder of runs on a site.
const RUNS: &str = "runs";
const BUNDLE: &str = "bundle.zip";

#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true)]
pub(super) struct CardsArgs {
    #[command(subcommand)]
    action: Option<CardsAction>,
    /// Runs (folder or report.json) and bundles
    #[arg(value_name = "RUN|BUNDLE")]
    from: Vec<PathBuf>,
    /// Folder of the site; a site there is replaced
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Capabilities of your own [default: built in]
    #[arg(long, value_name = "FILE")]
    capabilities: Option<PathBuf>,
    /// Do not pack the runs into bundles on the site
    #[arg(long)]
    no_bundles: bool,
}

#[derive(Debug, Subcommand)]
enum CardsAction {
    /// Run a submitted bundle again and add it to a site if it comes out the same
    Add(AddArgs),
    /// Draw hidden variants of public cases, to run next to them
    Vary(VaryArgs),
}

#[derive(Debug, Args)]
struct AddArgs {
    /// The bundle: a folder or .zip
    bundle: PathBuf,
    /// Folder of the site
    #[arg(long, value_name = "DIR")]
    site: PathBuf,
    /// Seed of the hidden variants [default: that of the site, else by the bundle's hash]
    #[arg(long)]
    seed: Option<u64>,
    /// Trust the specs of the bundle: they may run programs
    #[arg(long)]
    trusted: bool,
    /// Threads or processes [default: one per core]
    #[arg(long, value_name = "N", value_parser = at_least_one)]
    jobs: Option<usize>,
}

#[derive(Debug, Args)]
struct VaryArgs {
    /// Spec files, folders of specs, or patterns
    #[arg(required = true, value_name = "SPEC")]
    specs: Vec<PathBuf>,
    /// Seed of the draw; publish it with the cards
    #[arg(long)]
    seed: u64,
    /// Folder to write the variants to
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

pub(super) fn cards(args: &CardsArgs, engines: &EngineRoot, trust: Trust) -> Result<Exit, Diagnostic> {
    match &args.action {
        Some(CardsAction::Add(add)) => self::add(add, engines, trust),
        Some(CardsAction::Vary(vary)) => self::vary(vary, trust),
        None => draw(args, trust),
    }
}

/// A run for the site.
struct Source {
    run: CardRun,
    report: Report,
    /// The file of its report.
    file: PathBuf,
    bundle: BundleSource,
}

/// Where the bundle of a run comes from.
enum BundleSource {
    /// It is packed from the run's folder.
    Run(PathBuf),
    /// It was read.
    Opened(Box<Opened>),
    /// It lies on the site already.
    Site(PathBuf),
    None,
}

fn draw(args: &CardsArgs, trust: Trust) -> Result<Exit, Diagnostic> {
    let Some(out) = args.out.as_deref().filter(|_| !args.from.is_empty()) else {
        return Err(miette!(
            help = "luxproof cards luxproof-out/analytic --out site",
            "give runs or bundles, and the folder of the site with --out"
        ));
    };
    let capabilities = match &args.capabilities {
        Some(file) => Capabilities::read(file, trust).map_err(diagnose)?,
        None => Capabilities::built_in().map_err(diagnose)?,
    };
    let sources = args.from.iter().map(|path| source(path, args.no_bundles, trust)).collect::<Result<Vec<_>, _>>()?;
    let cards = write_site(out, &capabilities, sources, trust)?;
    print_site(out, &cards)?;
    Ok(Exit::Passed)
}

/// A run or a bundle that the command line names.
fn source(path: &Path, no_bundle: bool, trust: Trust) -> Result<Source, Diagnostic> {
    let is_folder_of_run = path.is_dir() && report_file(path).is_file() && !path.join("SHA256SUMS").is_file();
    if !is_folder_of_run && bundle::is_bundle(path) {
        let opened = Opened::read(path, Trust::Bundled).map_err(refused)?;
        let (report, file) = (opened.report.clone(), opened.report_file());
        // A bundle may be a stranger's: only `cards add` runs it again.
        let run = CardRun::of(&report, Verification::Submitted { bundle_sha256: opened.sha256.clone() });
        let bundle = if no_bundle { BundleSource::None } else { BundleSource::Opened(Box::new(opened)) };
        return Ok(Source { run, report, file, bundle });
    }
    trust.check_given(&report_file(path)).map_err(|e| FileError::of(&report_file(path), e)).into_diagnostic()?;
    let bytes = fs::metadata(report_file(path)).map_or(0, |metadata| metadata.len());
    if trust != Trust::Own && bytes > bundle::MAX_FOREIGN_REPORT_BYTES {
        let most = bundle::MAX_FOREIGN_REPORT_BYTES >> 20;
        return Err(miette!(
            help = "use it without --untrusted if it is yours",
            "{} has more than {most} MB, and is not trusted",
            path.display()
        ));
    }
    let report = read_report(path)?;
    if let Some(excess) = bundle::excess_of_report(&report).filter(|_| trust != Trust::Own) {
        return Err(miette!(help = "use it without --untrusted if it is yours", "{} {excess}", path.display()));
    }
    let file = report_file(path);
    let folder = file.parent().unwrap_or(Path::new("")).to_owned();
    let bundle = if no_bundle || trust != Trust::Own { BundleSource::None } else { BundleSource::Run(folder) };
    let verification = if trust == Trust::Own { Verification::Own } else { Verification::Unverified };
    Ok(Source { run: CardRun::of(&report, verification), report, file, bundle })
}

/// Writes the whole site in place of the one that is there.
fn write_site(
    out: &Path,
    capabilities: &Capabilities,
    sources: Vec<Source>,
    trust: Trust,
) -> Result<Cards, Diagnostic> {
    super::refuse_links(out, trust)?;
    let earlier = SiteFolder::open(out).into_diagnostic()?;
    let mut seen: BTreeSet<RunId> = BTreeSet::new();
    let mut sources: Vec<Source> = sources.into_iter().filter(|source| seen.insert(source.run.id.clone())).collect();
    // Bundles are packed first: they may be many MB, and the site names only those that exist.
    let stage = tempfile::tempdir().into_diagnostic()?;
    let mut packed: BTreeMap<RunId, PathBuf> = BTreeMap::new();
    for source in &mut sources {
        let folder = format!("{RUNS}/{}", source.run.id.as_str());
        source.run.report = Some(format!("{folder}/{}", luxproof_report::PAGE));
        source.run.report_bytes = fs::metadata(&source.file).ok().map(|metadata| metadata.len());
        let zip = stage.path().join(format!("{}.zip", source.run.id.as_str()));
        if let Some(specs) = pack(source, &zip, trust)? {
            source.run.bundle = Some(format!("{folder}/{BUNDLE}"));
            source.run.bundle_bytes = fs::metadata(&zip).ok().map(|metadata| metadata.len());
            source.run.bundled_specs = specs;
            packed.insert(source.run.id.clone(), zip);
        }
    }
    let runs: Vec<(CardRun, &Report)> = sources.iter().map(|source| (source.run.clone(), &source.report)).collect();
    let (cards, evidence) = Cards::of(capabilities, &runs, crate::running_tool()).into_diagnostic()?;
    let pages = site::files(&cards, &evidence).into_diagnostic()?;
    let fill = |folder: &Path| -> io::Result<()> {
        for page in &pages {
            write_shared(&folder.join(&page.path), page.content.as_bytes())?;
        }
        for source in &sources {
            let place = folder.join(RUNS).join(source.run.id.as_str());
            fs::create_dir_all(&place)?;
            copy_shared(&source.file, &place.join(REPORT_FILE))?;
            let page = luxproof_report::page(&source.report, &[]);
            luxproof_report::keep_page(&source.report, &page, &place).map_err(io::Error::other)?;
            if let Some(zip) = packed.get(&source.run.id) {
                copy_shared(zip, &place.join(BUNDLE))?;
            }
        }
        Ok(())
    };
    earlier.replace(fill).into_diagnostic()?;
    Ok(cards)
}

/// Writes a file of a new folder.
fn write_shared(path: &Path, bytes: &[u8]) -> io::Result<()> {
    path.parent().map_or(Ok(()), fs::create_dir_all)?;
    fs::write(path, bytes)
}

/// Copies a file and lets all users read the copy.
fn copy_shared(from: &Path, to: &Path) -> io::Result<()> {
    io::copy(&mut File::open(from)?, &mut File::create(to)?).map(drop)
}

/// Packs the bundle of a run and returns the places of its specs. A run that cannot be packed is on the site without a bundle.
fn pack(source: &Source, zip: &Path, trust: Trust) -> Result<Option<BTreeMap<String, String>>, Diagnostic> {
    match &source.bundle {
        BundleSource::None => Ok(None),
        BundleSource::Opened(opened) => {
            opened.write_zip(zip).map_err(refused)?;
            Ok(Some(bundle::spec_places(&source.report, &opened.lock.specs)))
        }
        BundleSource::Site(file) => {
            fs::copy(file, zip).map_err(|e| FileError::of(file, e)).into_diagnostic()?;
            Ok(Some(source.run.bundled_specs.clone()))
        }
        BundleSource::Run(folder) => match bundle::make(folder, zip, None, trust) {
            Ok(made) => Ok(Some(bundle::spec_places(&source.report, &made.specs))),
            Err(error) => {
                complain(&format!("{}: no bundle on the site: {error}", folder.display()));
                Ok(None)
            }
        },
    }
}

fn print_site(out: &Path, cards: &Cards) -> Result<(), Diagnostic> {
    let releases: usize = cards.renderers.iter().map(|renderer| renderer.releases.len()).sum();
    let counts = [
        plural(cards.renderers.len(), "renderer"),
        plural(releases, "release"),
        format!("{} capabilities", cards.capabilities.capabilities.len()),
        plural(cards.runs.len(), "run"),
    ];
    print(&format!("{}: {}\n", out.join("index.html").display(), counts.join(", ")))
}

fn vary(args: &VaryArgs, trust: Trust) -> Result<Exit, Diagnostic> {
    super::refuse_links(&args.out, trust)?;
    let drawn = draw_variants(&args.specs, args.seed, &args.out, trust).map_err(not_drawn)?;
    for variant in &drawn {
        print(&format!("{} of {}\n", variant.file.display(), variant.of))?;
    }
    let specs = args.specs.iter().map(|spec| spec.display().to_string()).collect::<Vec<_>>().join(" ");
    complain(&format!("next: luxproof run {specs} {} --out RUN; luxproof cards RUN --out SITE", args.out.display()));
    Ok(Exit::Passed)
}

fn not_drawn(error: VariantError) -> Diagnostic {
    match error {
        VariantError::Spec(faults) => diagnose(faults),
        other => Diagnostic::from_err(other),
    }
}

fn add(args: &AddArgs, engines: &EngineRoot, trust: Trust) -> Result<Exit, Diagnostic> {
    if args.trusted && trust != Trust::Own {
        return Err(miette!("--trusted and --untrusted (or LUXPROOF_UNTRUSTED) contradict each other"));
    }
    let of_bundle = if args.trusted { Trust::Own } else { Trust::Bundled };
    super::refuse_links(&args.site, trust)?;
    SiteFolder::open(&args.site).into_diagnostic()?;
    let (published, mut sources) = read_site(&args.site)?;
    let opened = Opened::read(&args.bundle, of_bundle).map_err(refused)?;
    complain(&format!("{}: {} files, whole; SHA-256 {}", args.bundle.display(), opened.files, opened.sha256));
    let reports: Vec<&Report> = sources.iter().map(|source| &source.report).collect();
    if let Some(reason) = foreign(&published.capabilities, &opened.report, &reports) {
        return Ok(refuse(args, &reason));
    }
    let _under_way = process::UnderWay::begin();
    let jobs = args.jobs.unwrap_or_else(process::cores);
    let scratch = tempfile::tempdir().into_diagnostic()?;
    let progress = Progress::new();
    let options = || Options {
        jobs,
        trust: of_bundle,
        observer: &progress,
        ..super::audit_options(engines.clone(), scratch.path().join("again"))
    };
    let (reproduction, again) = opened.again(options()).map_err(not_audited)?;
    if let Some(reason) = not_reproduced(&reproduction, &opened.report) {
        return Ok(refuse(args, &reason));
    }
    let hidden = hidden_run(args, &opened, &published, of_bundle, scratch.path(), options)?;
    drop(progress);
    let verification = Verification::Reproduced {
        same_bytes: reproduction.count(Outcome::SameBytes),
        within: reproduction.count(Outcome::Within),
        bundle_sha256: opened.sha256.clone(),
    };
    // The page shows what was read here: a stranger's report may say anything but its readings.
    let run = CardRun { id: RunId::of(&opened.report), ..CardRun::of(&again, verification) };
    let file = scratch.path().join("again").join(REPORT_FILE);
    let added = format!(
        "{}: {} to the byte, {} within uncertainties",
        run.title,
        reproduction.count(Outcome::SameBytes),
        reproduction.count(Outcome::Within)
    );
    sources.retain(|source| source.run.id != run.id);
    sources.push(Source { run, report: again, file, bundle: BundleSource::Opened(Box::new(opened)) });
    sources.extend(hidden);
    let cards = write_site(&args.site, &published.capabilities, sources, trust)?;
    print(&format!("added {added}\n"))?;
    print_site(&args.site, &cards)?;
    Ok(Exit::Passed)
}

/// The exit code of a submission that is not added, and why.
fn refuse(args: &AddArgs, reason: &str) -> Exit {
    complain(&format!("not added: {}: {reason}", args.bundle.display()));
    Exit::Failed
}

/// A site with the runs behind it.
fn read_site(folder: &Path) -> Result<(Cards, Vec<Source>), Diagnostic> {
    let file = folder.join(site::CARDS_FILE);
    let bytes = files::read_stored(&file).into_diagnostic()?;
    let cards: Cards = foreign_json::from_slice(&bytes).map_err(|e| {
        let why = quoted(&e.to_string());
        miette!(
            help = "luxproof cards RUN... --out DIR makes one",
            "{} is no site of score cards: {why}",
            file.display()
        )
    })?;
    let mut sources = vec![];
    for run in &cards.runs {
        let place = folder.join(RUNS).join(run.id.as_str());
        let file = place.join(REPORT_FILE);
        let report = luxproof_report_file::read(&file).into_diagnostic()?;
        let zip = place.join(BUNDLE);
        let bundle = if zip.is_file() { BundleSource::Site(zip) } else { BundleSource::None };
        sources.push(Source { run: run.clone(), report, file, bundle });
    }
    Ok((cards, sources))
}

/// Why the cases of a submission are not those of the site; `None` if they are.
fn foreign(capabilities: &Capabilities, submitted: &Report, site: &[&Report]) -> Option<String> {
    let differences = compare_cases(capabilities, submitted, site);
    let reasons: Vec<String> = differences.iter().map(CaseDifference::to_string).take(5).collect();
    (!reasons.is_empty()).then(|| reasons.join("; "))
}

/// Why a submission did not come out the same; `None` if it did.
fn not_reproduced(reproduction: &Reproduction, submitted: &Report) -> Option<String> {
    let judged: BTreeSet<&str> = submitted
        .engines
        .iter()
        .filter(|engine| engine.role == Role::Renderer)
        .map(|engine| engine.id.as_str())
        .collect();
    let version =
        |engine: &&bundle::EngineThen| judged.contains(engine.id.as_str()) && engine.version_now != engine.version_then;
    if let Some(engine) = reproduction.engines.iter().find(version) {
        let [then, now] =
            [&engine.version_then, &engine.version_now].map(|v| v.clone().unwrap_or_else(|| "absent".to_owned()));
        return Some(format!(
            "{} is {now} here and was {then}: install that release, or nothing is verified",
            engine.id
        ));
    }
    let failed = reproduction.rows.iter().find(|row| row.outcome > Outcome::Within);
    if let Some(row) = failed {
        let first = row.differences.first().map(|difference| {
            let [then, now] = [difference.then, difference.now]
                .map(|v| v.map_or_else(|| "nothing".to_owned(), luxproof_report::words::significant));
            format!(", {}: {then} {} then, {now} now", difference.meter, difference.unit)
        });
        let count = reproduction.count(Outcome::Differs) + reproduction.count(Outcome::NotRead);
        let what = if row.outcome == Outcome::NotRead { "gives no values" } else { "comes out otherwise" };
        return Some(format!(
            "{} of {} procedures do not reproduce; {} {what}{}",
            count,
            reproduction.rows.len(),
            row.key,
            first.unwrap_or_default()
        ));
    }
    reproduction.rows.is_empty().then(|| "it has no values".to_owned())
}

/// Runs hidden variants of the bundle's cases with its engines. Recorded values have no engine to run.
fn hidden_run<'a>(
    args: &AddArgs,
    opened: &Opened,
    published: &Cards,
    trust: Trust,
    scratch: &Path,
    options: impl Fn() -> Options<'a>,
) -> Result<Option<Source>, Diagnostic> {
    let has_engine = opened.report.engines.iter().any(|engine| engine.role == Role::Renderer);
    let public: Vec<PathBuf> = opened.specs();
    let is_varied = opened.report.cases.iter().any(|case| case.hidden_variant.is_some());
    if !has_engine || is_varied {
        return Ok(None);
    }
    let by_hash = u64::from_str_radix(opened.sha256.get(..8).unwrap_or_default(), 16).unwrap_or(1);
    let seed = args.seed.or_else(|| published.seeds.first().copied()).unwrap_or(by_hash);
    let folder = scratch.join("hidden");
    let specs: Vec<PathBuf> = draw_variants(&public, seed, &folder, trust)
        .map_err(not_drawn)?
        .into_iter()
        .map(|variant| variant.file)
        .collect();
    let out = scratch.join("hidden-run");
    let request = opened.lock.request.clone();
    let request = luxproof_model::Request { filter: vec![], no_calibration: true, ..request };
    // The variants lie outside of the bundle. Their text is luxproof's own, and their inputs were checked. A policy
    // around the temporary folder is not ours.
    let mut options = Options { trust: Trust::Own, out: out.clone(), ..options().with_request(&request) };
    options.policy = PolicyChoice { search: PolicySearch::Nowhere, ..PolicyChoice::default() };
    let report = luxproof_audit::run(&specs, &options).map_err(not_audited)?;
    complain(&format!("hidden variants: {}, seed {seed}", plural(specs.len(), "case")));
    let run = CardRun::of(&report, Verification::Own);
    Ok(Some(Source { run, report, file: out.join(REPORT_FILE), bundle: BundleSource::Run(out) }))
}
