//! `luxproof run`: audits specs, compares the readings with a baseline if one is named, and prints the report.

use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};

use miette::{IntoDiagnostic, Report as Diagnostic};

use super::engines::report_installation;
use super::last_run::RUNS;
use super::not_audited;
use super::progress::Progress;
use super::views::{ReportArgs, keep_page, print_report};
use super::{RunArgs, Selected};
use luxproof_audit::measure::CacheMissPolicy;
use luxproof_audit::measure::cache::Cache;
use luxproof_audit::{AfterFailure, Options};
use luxproof_console::complain;
use luxproof_console::diagnose;
use luxproof_engines::EngineRoot;
use luxproof_model::numbers::plural;
use luxproof_model::{BaselineCheck, Exit, Report};
use luxproof_process::files;
use luxproof_process::process;
use luxproof_report_file::subject_at;
use luxproof_spec::Trust;
use luxproof_trend::baseline::{self, Baseline, Entry, References};

pub(super) fn run(args: &RunArgs, site: &EngineRoot, cache: &Cache, trust: Trust) -> Result<Exit, Diagnostic> {
    let progress = Progress::new();
    let Selected { specs, choice } = &args.audited.selected;
    let options = Options {
        cache: Some(cache.clone()).filter(|_| !args.no_cache),
        jobs: args.jobs.unwrap_or_else(process::cores),
        after_failure: if args.fail_fast { AfterFailure::Stop } else { AfterFailure::GoOn },
        observer: &progress,
        ..args.audited.options(site, trust, out_folder(&args.audited.selected))
    };
    if args.install {
        // Every spec is read and checked before anything is fetched.
        let (cases, _) = luxproof_audit::chosen(specs, &options).map_err(diagnose)?;
        options.claim().into_diagnostic()?;
        let _under_way = process::UnderWay::begin();
        report_installation(site, &choice.engines);
        let named = cases.iter().flat_map(|case| case.engines.iter().flatten()).map(|(name, _)| name.clone());
        // A stranger's spec may not fill the disk with releases.
        let allowed = named.filter(|name| trust == Trust::Own || !name.contains('@'));
        let on_request: Vec<String> = allowed.filter(|name| luxproof_engines::is_on_request(name)).collect();
        if choice.engines.is_empty() && !on_request.is_empty() {
            report_installation(site, &on_request);
        }
    }
    let held = args.baseline.as_deref().map(|path| BaselineCheckInput::read(path, specs, &options)).transpose()?;
    let (mut report, _claim) = luxproof_audit::run_and_hold(specs, &options).map_err(not_audited)?;
    let root = options.out.clone();
    drop(progress);
    if let Some(held) = &held {
        report.baseline = Some(held.hold(&report, &root)?);
        luxproof_report_file::keep_anew(&mut report, &root).into_diagnostic()?;
    }
    if !args.views.has_page() {
        keep_page(&report, &root);
    }
    print_report(&report, &root, &args.views)?;
    Ok(report.exit())
}

/// The report of what a cache holds: that of a run, for which other processes have read.
pub(super) fn report_from(
    cache: &Path,
    args: &ReportArgs,
    site: &EngineRoot,
    trust: Trust,
) -> Result<Exit, Diagnostic> {
    let audited = args.audited();
    if audited.selected.specs.is_empty() {
        return Err(miette::miette!(help = "luxproof report --from CACHE SPEC...", "--from needs the specs to report"));
    }
    let options = Options {
        cache: Some(Cache::at(cache)),
        asking: CacheMissPolicy::LeaveOpen,
        ..audited.options(site, trust, out_folder(&audited.selected))
    };
    let (report, _claim) = luxproof_audit::run_and_hold(&audited.selected.specs, &options).map_err(not_audited)?;
    let open = options.asked.nodes().iter().filter(|node| !node.is_read).count();
    if !args.views.has_page() {
        keep_page(&report, &options.out);
    }
    print_report(&report, &options.out, &args.views)?;
    if open > 0 {
        complain(&format!(
            "exit 3: {} to be read: `luxproof plan` names them, `luxproof read` takes them into the cache",
            plural(open, "job")
        ));
    }
    // A repetition that is missing shows nowhere else.
    Ok(if open > 0 { report.exit().max(Exit::Engine) } else { report.exit() })
}

/// The baseline that a run is held against.
struct BaselineCheckInput {
    /// As it was named.
    named: PathBuf,
    place: PathBuf,
    kept: Vec<Entry>,
}

impl BaselineCheckInput {
    /// Reads and checks it before anything is measured; one that is not there yet holds nothing.
    fn read(path: &Path, specs: &[PathBuf], options: &Options<'_>) -> Result<Self, Diagnostic> {
        let (cases, _) = luxproof_audit::chosen(specs, options).map_err(diagnose)?;
        let place = Baseline::place(path, &luxproof_audit::subject(specs, &cases));
        let names = cases.iter().map(|case| case.name.as_str());
        let kept = if place.exists() { Baseline::of_run(&place, names).into_diagnostic()?.entries } else { vec![] };
        Ok(Self { named: path.to_owned(), place, kept })
    }

    /// Holds a run against it; what does not match it fails and is left as a candidate in the run's folder.
    fn hold(&self, report: &Report, root: &Path) -> Result<BaselineCheck, Diagnostic> {
        let candidate = Baseline::candidate(report);
        // What was not asked of this run is not missed in it.
        let skipped = report.skips.iter().map(|s| &s.key);
        let asked: Vec<_> = candidate.entries.iter().map(|e| &e.key).chain(skipped).collect();
        let kept: Vec<Entry> = self.kept.iter().filter(|e| asked.contains(&&e.key)).cloned().collect();
        let changes = baseline::compare(&kept, &candidate.entries, &References::of_report(report));
        files::keep_json(&root.join("baseline-changes.json"), &changes).into_diagnostic()?;
        let check = super::diff::check(&changes, report, &self.place);
        if !check.is_as_accepted() {
            let file = root.join("baseline-candidate.json");
            candidate.write(&file).into_diagnostic()?;
            let accept = format!("luxproof accept {} --baseline {}", root.display(), self.named.display());
            complain(&format!("baseline: left as a candidate: {}; to review it: {accept}", file.display()));
        }
        Ok(check)
    }
}

/// The folder of the run: by default that of the one spec or folder, or one for all where there are several. A spec whose namesake from
/// elsewhere has its report there takes the name of its own folder besides.
pub(super) fn out_folder(selected: &Selected) -> PathBuf {
    let one = match &selected.specs[..] {
        [one] if !one.display().to_string().contains('*') => Some(one),
        _ => None,
    };
    let name = one.and_then(|one| files::stem(one)).map_or("suite".as_ref(), Path::as_os_str);
    let usual = Path::new(RUNS).join(name);
    if let Some(out) = &selected.choice.out {
        return out.clone();
    }
    let Some(one) = one else { return usual };
    let earlier = subject_at(&usual.join(luxproof_model::REPORT_FILE));
    let is_taken = earlier.is_some_and(|earlier| !is_same(Path::new(&earlier), one));
    if !is_taken {
        return usual;
    }
    match name_with_folder(one, name) {
        Some(name) => usual.with_file_name(name),
        None => usual,
    }
}

/// The name of a spec with that of its folder, `name-folder`.
fn name_with_folder(spec: &Path, name: &OsStr) -> Option<OsString> {
    let whole = std::path::absolute(spec).ok()?;
    let folder = whole.parent()?.file_name()?;
    Some([name, folder].join("-".as_ref()))
}

/// Whether a spec of an earlier run is this one; whether one that is gone was is not known.
fn is_same(earlier: &Path, now: &Path) -> bool {
    match (earlier.canonicalize(), now.canonicalize()) {
        (Ok(earlier), Ok(now)) => earlier == now || now.is_dir(),
        _ => true,
    }
}
