//! `luxproof run`: an audit of the specs, folders and patterns given, held against a baseline where one is named, and printed.

use std::path::{Path, PathBuf};

use miette::{IntoDiagnostic, Report as Diagnostic};

use super::diagnostic::{diagnose, not_audited};
use super::engines::report_installation;
use super::progress::Progress;
use super::views::{ReportArgs, keep_page, print_report};
use super::{RunArgs, Selected, complain};
use crate::audit::{self, AfterFailure, Options};
use crate::engines::{self, Site};
use crate::measure::Asking;
use crate::measure::cache::Cache;
use crate::report::earlier::subject_at;
use crate::report::{self, BaselineCheck, Exit, Report};
use crate::spec::Trust;
use crate::system::claim::Claim;
use crate::system::files;
use crate::system::process;
use crate::trend::baseline::{self, Baseline, Comparability, Entry};

pub(super) fn run(args: &RunArgs, site: &Site, cache: &Cache, trust: Trust) -> Result<Exit, Diagnostic> {
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
        let (cases, _) = audit::chosen(specs, &options).map_err(diagnose)?;
        Claim::of(&options.out).into_diagnostic()?;
        let _under_way = process::UnderWay::begin();
        report_installation(site, &choice.engines);
        let named = cases.iter().flat_map(|case| case.engines.iter().flatten()).map(|(name, _)| name.clone());
        // A stranger's spec may not fill the disk with releases.
        let may = |name: &String| trust == Trust::Own || !name.contains('@');
        let on_request: Vec<String> = named.filter(|name| engines::is_on_request(name) && may(name)).collect();
        if choice.engines.is_empty() && !on_request.is_empty() {
            report_installation(site, &on_request);
        }
    }
    let held = args.baseline.as_deref().map(|path| Held::read(path, specs, &options)).transpose()?;
    let (mut report, _claim) = audit::run_and_hold(specs, &options).map_err(not_audited)?;
    let root = options.out.clone();
    drop(progress);
    if let Some(held) = &held {
        report.baseline = Some(held.hold(&report, &root)?);
        report.keep_anew(&root).into_diagnostic()?;
    }
    if !args.views.has_page() {
        keep_page(&report, &root);
    }
    print_report(&report, &root, &args.views)?;
    Ok(report.exit())
}

/// The report of what a cache holds: that of a run, for which other processes have read.
pub(super) fn report_from(cache: &Path, args: &ReportArgs, site: &Site, trust: Trust) -> Result<Exit, Diagnostic> {
    let audited = args.audited();
    let options = Options {
        cache: Some(Cache::at(cache)),
        asking: Asking::Nobody,
        ..audited.options(site, trust, out_folder(&audited.selected))
    };
    let (report, _claim) = audit::run_and_hold(&audited.selected.specs, &options).map_err(not_audited)?;
    let open = options.asked.nodes().iter().filter(|node| !node.is_read).count();
    if open > 0 {
        complain(&format!(
            "{open} job(s) are not read yet: `luxproof plan` names them, `luxproof read` takes them into the cache"
        ));
    }
    if !args.views.has_page() {
        keep_page(&report, &options.out);
    }
    print_report(&report, &options.out, &args.views)?;
    // A repetition that is missing shows nowhere else.
    Ok(if open > 0 { report.exit().max(Exit::Engine) } else { report.exit() })
}

/// The baseline that a run is held against.
struct Held {
    /// As it was named.
    named: PathBuf,
    place: PathBuf,
    kept: Vec<Entry>,
}

impl Held {
    /// Reads and checks it before anything is measured; one that is not there yet holds nothing.
    fn read(path: &Path, specs: &[PathBuf], options: &Options<'_>) -> Result<Self, Diagnostic> {
        let (cases, _) = audit::chosen(specs, options).map_err(diagnose)?;
        let place = Baseline::place(path, &audit::subject(specs, &cases));
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
        let changes = baseline::compare(&kept, &candidate.entries, Comparability::SameInstrument);
        files::keep_json(&root.join("baseline-changes.json"), &changes).into_diagnostic()?;
        let check = super::diff::check(&changes, &self.place);
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
    let name = one.and_then(|one| one.file_stem()).unwrap_or("suite".as_ref());
    let usual = Path::new("luxproof-out").join(name);
    let is_namesake = |earlier: &String| one.is_some_and(|one| !is_same(Path::new(earlier), one));
    let besides = || {
        let whole = std::path::absolute(one?).ok()?;
        let folder = whole.parent()?.file_name()?;
        Some(usual.with_file_name([name, folder].join("-".as_ref())))
    };
    let chosen = || match subject_at(&usual.join(report::FILE)).filter(is_namesake).and_then(|_| besides()) {
        Some(other) => other,
        None => usual.clone(),
    };
    selected.choice.out.clone().unwrap_or_else(chosen)
}

/// Whether a spec of an earlier run is this one; whether one that is gone was is not known.
fn is_same(earlier: &Path, now: &Path) -> bool {
    match (earlier.canonicalize(), now.canonicalize()) {
        (Ok(earlier), Ok(now)) => earlier == now || now.is_dir(),
        _ => true,
    }
}
