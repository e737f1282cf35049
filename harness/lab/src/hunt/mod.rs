//! Hunt: random specs until engines, reference engines or laws disagree. Each disagreement is
//! confirmed, shrunk and saved as a folder.

mod draft;
mod feature;
mod finding;
mod grammar;
mod oracle;
mod page;
mod shrink;
mod steps;
mod table;

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use self::draft::Draft;
pub use self::feature::{Feature, FeatureCoverage};
pub use self::finding::{Finding, KnownFinding};
use self::grammar::{Generated, Grammar, SPECS_PER_ROUND};
use self::oracle::{AuditOutcome, AuditRequest, AuditSettings, OracleRunner, Sighting, find_sightings, panic_sighting};
pub use self::oracle::{Oracle, Sign, Symptom};
use self::shrink::{ShrinkResult, Shrinker, allowed_p_value};
use luxproof_audit::{AuditError, Diagnosis};
use luxproof_engines::EngineRoot;
use luxproof_model::Report;
use luxproof_model::Verdict;
use luxproof_model::{EngineName, ProcedureId};
use luxproof_process::files::{self, FileError};
use luxproof_process::process;
use luxproof_spec::{Budget, EngineSettings, SpecError};

/// The input of [`hunt`].
pub struct Options<'a> {
    pub site: EngineRoot,
    /// The hunted engines, with the settings that specs give them.
    pub engines: BTreeMap<EngineName, EngineSettings>,
    /// Only these procedures; empty for all.
    pub procedures: Vec<ProcedureId>,
    pub seed: u64,
    /// No round starts after this time.
    pub time: Duration,
    /// No round starts after this number of specs, where there is a limit.
    pub specs: Option<u64>,
    /// No round starts after this number of findings.
    pub findings: Option<usize>,
    /// The longest time to shrink one finding.
    pub shrink: Duration,
    pub jobs: usize,
    /// The budget of each spec; a cheap one, because most specs show nothing.
    pub budget: Budget,
    pub out: PathBuf,
    /// Receives a line of progress.
    pub log: &'a (dyn Fn(&str) + Sync),
}

/// Why a hunt cannot continue.
#[derive(Debug, thiserror::Error)]
pub enum HuntError {
    #[error(transparent)]
    Audit(#[from] AuditError),
    #[error(transparent)]
    Spec(#[from] SpecError),
    #[error(transparent)]
    File(#[from] FileError),
    #[error("{path} is of a hunt with seed {seed} of {engines}; give --out another folder, or the same --seed and --engines", path = path.display())]
    OfAnother { path: PathBuf, seed: u64, engines: String },
}

/// The state and result of a hunt. It is saved after every round, so that a later run continues
/// from there.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Hunt {
    pub seed: u64,
    pub engines: BTreeSet<EngineName>,
    /// The number of the next spec.
    pub next: u64,
    pub seconds: f64,
    /// The number of audited specs; the others had none of the procedures, or their reader refused
    /// them.
    pub specs: usize,
    pub comparisons: usize,
    pub undecided: usize,
    /// The number of sightings that did not show again.
    pub unconfirmed: usize,
    pub coverage: FeatureCoverage,
    pub findings: Vec<Finding>,
    /// Whether the user stopped it.
    #[serde(skip)]
    pub is_interrupted: bool,
}

impl Hunt {
    /// The findings that are not on record.
    pub fn new_findings(&self) -> impl Iterator<Item = &Finding> {
        self.findings.iter().filter(|f| f.known.is_none())
    }
}

/// The file of a hunt's state within its folder.
const STATE_FILE: &str = "hunt.json";
/// The distance between the seeds of a sighting, of its confirmations and of its shrinking.
const SEED_STEP: u64 = 7919;
/// The index of the one spec in each round that laws are also tried on.
const LAW_SPEC_INDEX: u64 = 3;
/// How often a cause has to be seen before its next sighting is shrunk again, to check that it is
/// that cause.
const RECHECKED_COUNTS: [usize; 3] = [8, 64, 512];
/// A reading of a law that takes longer hangs.
const LAW_TIME_LIMIT: Duration = Duration::from_secs(60);

/// Hunts until time is up. It continues from an earlier hunt in the same folder.
pub fn hunt(options: &Options<'_>) -> Result<Hunt, HuntError> {
    let state = load_state(options)?;
    let runner =
        OracleRunner { site: &options.site, engines: &options.engines, jobs: options.jobs, limit: LAW_TIME_LIMIT };
    let known = KnownFinding::on_record()?;
    let before_s = state.seconds;
    let mut hunter = Hunter { options, runner, known, hunt: state, confirmations: 0 };
    let clock = Instant::now();
    let grammar = Grammar { seed: options.seed, engines: &options.engines, budget: options.budget };
    let end = clock + options.time;
    while Instant::now() < end && !process::is_interrupted() && !hunter.has_enough() {
        let before = hunter.hunt.clone();
        hunter.run_round(&grammar, end)?;
        if process::is_interrupted() {
            // A later hunt repeats this round; the findings of the interrupted one stay.
            let findings = std::mem::take(&mut hunter.hunt.findings);
            hunter.hunt = Hunt { findings, ..before };
        }
        hunter.hunt.seconds = before_s + clock.elapsed().as_secs_f64();
        hunter.save()?;
    }
    hunter.hunt.is_interrupted = process::is_interrupted();
    hunter.save()?;
    Ok(hunter.hunt)
}

/// Loads the state of an earlier hunt in the same folder, or starts a new one.
fn load_state(options: &Options<'_>) -> Result<Hunt, HuntError> {
    let path = options.out.join(STATE_FILE);
    let engines: BTreeSet<EngineName> = options.engines.keys().cloned().collect();
    let new_hunt = Hunt { seed: options.seed, engines: engines.clone(), ..Hunt::default() };
    let bytes = match files::read_stored(&path) {
        Ok(bytes) => bytes,
        Err(error) if error.source.kind() == io::ErrorKind::NotFound => return Ok(new_hunt),
        Err(error) => return Err(error.into()),
    };
    let saved: Hunt = serde_json::from_slice(&bytes).map_err(|e| FileError::of(&path, e))?;
    if saved.seed != options.seed || saved.engines != engines {
        let engines = saved.engines.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
        return Err(HuntError::OfAnother { path, seed: saved.seed, engines });
    }
    Ok(saved)
}

/// A running hunt.
struct Hunter<'a> {
    options: &'a Options<'a>,
    runner: OracleRunner<'a>,
    known: Vec<KnownFinding>,
    hunt: Hunt,
    /// The number of sightings that were repeated to confirm them.
    confirmations: usize,
}

/// A spec with a sighting that is not confirmed yet.
struct Suspicion<'a> {
    generated: &'a Generated,
    sighting: Sighting,
}

impl Hunter<'_> {
    /// Whether the hunt reached its limit of specs or findings.
    fn has_enough(&self) -> bool {
        self.options.specs.is_some_and(|most| self.hunt.next >= most)
            || self.options.findings.is_some_and(|most| self.hunt.new_findings().count() >= most)
    }

    /// Saves the state and the page that lists the findings.
    fn save(&self) -> Result<(), HuntError> {
        files::keep_json(&self.options.out.join(STATE_FILE), &self.hunt)?;
        let path = self.options.out.join("index.md");
        files::keep_shared(&path, page::write_page(&self.hunt).as_bytes())?;
        Ok(())
    }

    /// Whether a spec has one of the hunted procedures.
    fn has_hunted_procedure(&self, generated: &Generated) -> bool {
        let procedures = &self.options.procedures;
        procedures.is_empty() || procedures.iter().any(|p| generated.case.task(*p).is_some())
    }

    /// Runs one round of specs and follows up all sightings.
    fn run_round(&mut self, grammar: &Grammar<'_>, end: Instant) -> Result<(), HuntError> {
        let first = self.hunt.next;
        let last = (first / SPECS_PER_ROUND + 1) * SPECS_PER_ROUND;
        let last = self.options.specs.map_or(last, |most| last.min(most));
        let generated = (first..last).filter_map(|n| grammar.generate(n));
        let round: Vec<Generated> = generated.filter(|g| self.has_hunted_procedure(g)).collect();
        let folder = tempfile::tempdir().map_err(|e| FileError::of(&std::env::temp_dir(), e))?;
        let sightings = self.audit_round(&round, folder.path())?;
        if process::is_interrupted() {
            return Ok(());
        }
        for (k, generated) in round.iter().enumerate() {
            self.hunt.coverage.add(&generated.features);
            let mut all = sightings.get(k).cloned().unwrap_or_default();
            // Laws cost many readings, and a spec with a sighting is followed up anyway.
            if k as u64 == LAW_SPEC_INDEX && all.is_empty() {
                all = self.runner.find_broken_laws(&generated.case, None, &[], self.options.seed);
            }
            for sighting in first_per_engine(all) {
                if process::is_interrupted() || self.has_enough() {
                    return Ok(());
                }
                self.follow_up(&Suspicion { generated, sighting }, end)?;
            }
        }
        self.hunt.next = last;
        let Hunt { next, comparisons, undecided, findings, .. } = &self.hunt;
        (self.options.log)(&format!(
            "{next} specs, {comparisons} comparisons, {undecided} undecided, {} findings",
            findings.len()
        ));
        Ok(())
    }

    /// Audits a round and returns the sightings in each spec.
    fn audit_round(&mut self, round: &[Generated], folder: &Path) -> Result<Vec<Vec<Sighting>>, HuntError> {
        if round.is_empty() {
            return Ok(vec![]);
        }
        let mut paths = vec![];
        for generated in round {
            let spec_folder = folder.join(&generated.name);
            let path = generated.draft.write(&spec_folder, &generated.name);
            paths.push(path.map_err(|e| FileError::of(&spec_folder, e))?);
        }
        let request = AuditRequest {
            symptom: None,
            procedures: self.options.procedures.clone(),
            settings: AuditSettings::for_verdict(self.options.seed),
        };
        match self.runner.audit(&paths, &request, &folder.join("out"))? {
            AuditOutcome::Report(report) => {
                self.count_comparisons(&report, round.len());
                let engines = &self.options.engines;
                Ok(round.iter().map(|g| find_sightings(&report, &g.name, engines)).collect())
            }
            AuditOutcome::NoSpec(error) if round.len() == 1 => {
                (self.options.log)(&format!("{}: no spec: {error}", round[0].name));
                Ok(vec![vec![]])
            }
            AuditOutcome::Panicked if round.len() == 1 => Ok(vec![vec![panic_sighting()]]),
            // One bad spec spoils the audit of all, so each is audited on its own to find it.
            AuditOutcome::NoSpec(_) | AuditOutcome::Panicked => {
                let mut all = vec![];
                for generated in round {
                    all.extend(self.audit_round(std::slice::from_ref(generated), &folder.join("single"))?);
                }
                Ok(all)
            }
        }
    }

    /// Counts the comparisons of hunted engines, and logs the undecided ones.
    fn count_comparisons(&mut self, report: &Report, specs: usize) {
        for c in report.comparisons.iter().filter(|c| self.options.engines.contains_key(&c.key.engine)) {
            self.hunt.comparisons += 1;
            if c.verdict == Verdict::Undecided {
                self.hunt.undecided += 1;
                let (key, meter, why) = (&c.key, &c.meter, c.diagnosis.as_deref().unwrap_or("no reason is given"));
                tracing::info!("{key} at {meter}: {why}");
            }
        }
        self.hunt.specs += specs;
    }

    /// Confirms, shrinks and saves a sighting, unless a known cause accounts for it.
    fn follow_up(&mut self, suspicion: &Suspicion<'_>, end: Instant) -> Result<(), HuntError> {
        let Suspicion { generated, sighting } = suspicion;
        if self.count_known_cause(suspicion) {
            return Ok(());
        }
        let Some(sighting) = self.confirm(&generated.draft, sighting)? else {
            self.hunt.unconfirmed += usize::from(!process::is_interrupted());
            return Ok(());
        };
        (self.options.log)(&format!("{}: {}: shrinking", generated.name, sighting.symptom));
        let diagnosis = sighting.diagnosis();
        let until = (Instant::now() + self.options.shrink).min(end + self.options.shrink);
        let start = (generated.draft.clone(), sighting);
        let shrunk = Shrinker::new(&self.runner, start, self.options.seed + 3 * SEED_STEP, until).run()?;
        self.add_finding(generated, &shrunk, diagnosis)
    }

    /// Counts a sighting for the finding that accounts for it: the same symptom, and all features
    /// of the cause are present. Returns whether that settles the sighting; sometimes it is shrunk
    /// again as a check.
    fn count_known_cause(&mut self, suspicion: &Suspicion<'_>) -> bool {
        let Suspicion { generated, sighting } = suspicion;
        let Some(same) = self.hunt.findings.iter_mut().find(|f| f.accounts_for(&sighting.symptom, &generated.features))
        else {
            return false;
        };
        same.seen += 1;
        same.also.insert(sighting.symptom.procedure);
        !RECHECKED_COUNTS.contains(&same.seen)
    }

    /// Repeats a sighting with two other seeds, of which the first asks for a diagnosis; `None`
    /// where it does not show again.
    fn confirm(&mut self, draft: &Draft, sighting: &Sighting) -> Result<Option<Sighting>, HuntError> {
        self.confirmations += 1;
        let mut found = None;
        for (k, diagnosis) in [Diagnosis::Sought, Diagnosis::LeftOut].into_iter().enumerate() {
            let seed = self.options.seed + (k as u64 + 1) * SEED_STEP;
            let settings = AuditSettings { diagnosis, ..AuditSettings::for_verdict(seed) };
            let repeated = self.runner.find_symptom(&[draft], &sighting.symptom, settings)?.pop().flatten();
            // Each confirmation may take chance for a fault less often than the last, so that all
            // of them stay rare.
            let level = allowed_p_value(self.confirmations);
            let Some(again) = repeated.filter(|s| s.p_value <= level) else { return Ok(None) };
            found.get_or_insert(again);
        }
        Ok(found)
    }

    /// Writes the folder of a shrunk finding and adds it to the hunt, unless an earlier finding is
    /// the same.
    fn add_finding(
        &mut self,
        generated: &Generated,
        shrunk: &ShrinkResult,
        diagnosis: Option<String>,
    ) -> Result<(), HuntError> {
        let ShrinkResult { draft, sighting, attempts, is_minimal } = shrunk;
        let Some(case) = draft.case() else { return Ok(()) };
        let features = feature::find_features(draft, &case);
        if let Some(same) = self.hunt.findings.iter_mut().find(|f| f.is_same(&sighting.symptom, &features)) {
            same.seen += 1;
            same.also.insert(sighting.symptom.procedure);
            return Ok(());
        }
        let id = format!("{}-{}", sighting.symptom.engine, self.hunt.findings.len() + 1);
        let found_in = generated.name.clone();
        let summary = finding::ShrinkSummary { attempts: *attempts, is_minimal: *is_minimal, diagnosis, found_in };
        let folder = self.options.out.join(&id);
        let mut finding = finding::write_folder(&self.runner, draft, sighting, &summary, &folder, self.options.seed)?;
        finding.id.clone_from(&id);
        finding.features = features;
        finding.known = self.known.iter().find(|k| k.accounts_for(&finding)).map(|k| k.cause.clone());
        let original = folder.join("original");
        generated.draft.write(&original, "spec").map_err(|e| FileError::of(&original, e))?;
        files::keep_json(&folder.join("finding.json"), &finding)?;
        (self.options.log)(&format!(
            "{id}: {} ({} lines, table {:?}, {attempts} attempts)",
            finding.symptom, finding.lines, finding.table
        ));
        self.hunt.findings.push(finding);
        self.save()
    }
}

/// The first sighting of each engine: further ones in the same spec may have the same cause.
fn first_per_engine(all: Vec<Sighting>) -> Vec<Sighting> {
    let mut first: BTreeMap<EngineName, Sighting> = BTreeMap::new();
    for sighting in all {
        first.entry(sighting.symptom.engine.clone()).or_insert(sighting);
    }
    first.into_values().collect()
}

/// The input of [`shrink`].
pub struct ShrinkOptions<'a> {
    pub site: EngineRoot,
    pub spec: &'a Path,
    /// The case, where the spec has several.
    pub case: Option<&'a str>,
    pub engine: EngineName,
    pub procedures: Vec<ProcedureId>,
    pub seed: u64,
    pub time: Duration,
    pub jobs: usize,
    pub out: PathBuf,
}

/// The result of [`shrink`].
pub enum Shrinking {
    Found(Box<Finding>),
    /// The engine has no fault in the spec.
    Sound,
}

/// Finds the smallest spec in which an engine still fails as in the user's spec.
pub fn shrink(options: &ShrinkOptions<'_>) -> Result<Shrinking, HuntError> {
    let mut drafts = Draft::load(options.spec)?;
    drafts.retain(|(name, _)| options.case.is_none_or(|case| name.ends_with(case)));
    let folder = options.spec.parent().unwrap_or(Path::new(""));
    for (_, draft) in &mut drafts {
        let settings = draft.spec.engines.get_or_insert_default().entry(options.engine.to_string()).or_default();
        run_in(settings, folder);
    }
    for (name, draft) in drafts {
        let of_engine = draft.spec.engines.as_ref().and_then(|e| e.get(options.engine.as_str())).cloned();
        let engines = BTreeMap::from([(options.engine.clone(), of_engine.unwrap_or_default())]);
        let runner = OracleRunner { site: &options.site, engines: &engines, jobs: options.jobs, limit: LAW_TIME_LIMIT };
        let temporary = tempfile::tempdir().map_err(|e| FileError::of(&std::env::temp_dir(), e))?;
        let path = draft.write(temporary.path(), "c0").map_err(|e| FileError::of(temporary.path(), e))?;
        let request = AuditRequest {
            symptom: None,
            procedures: options.procedures.clone(),
            settings: AuditSettings { diagnosis: Diagnosis::Sought, ..AuditSettings::for_verdict(options.seed) },
        };
        let all = match runner.audit(&[path], &request, &temporary.path().join("out"))? {
            AuditOutcome::Report(report) => find_sightings(&report, "c0", &engines),
            AuditOutcome::NoSpec(error) => return Err(error.into()),
            AuditOutcome::Panicked => vec![panic_sighting()],
        };
        let Some(sighting) = all.into_iter().find(|s| s.p_value <= allowed_p_value(1)) else { continue };
        let diagnosis = sighting.diagnosis();
        let until = Instant::now() + options.time;
        let ShrinkResult { draft, sighting, attempts, is_minimal } =
            Shrinker::new(&runner, (draft, sighting), options.seed + SEED_STEP, until).run()?;
        let summary = finding::ShrinkSummary { attempts, is_minimal, diagnosis, found_in: name };
        let mut finding = finding::write_folder(&runner, &draft, &sighting, &summary, &options.out, options.seed)?;
        if let Some(case) = draft.case() {
            finding.features = feature::find_features(&draft, &case);
        }
        files::keep_json(&options.out.join("finding.json"), &finding)?;
        return Ok(Shrinking::Found(Box::new(finding)));
    }
    Ok(Shrinking::Sound)
}

/// Sets the folder in which a user's program runs, so that it does not depend on where a spec is
/// written.
pub fn run_in(settings: &mut EngineSettings, folder: &Path) {
    if settings.0.contains_key("command") {
        let here = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
        let named = settings.0.get(luxproof_engines::RUN_IN).and_then(|f| f.as_str());
        let there = named.map_or(here.to_owned(), |f| here.join(f));
        let there = std::path::absolute(&there).unwrap_or(there);
        settings.0.insert(luxproof_engines::RUN_IN.to_owned(), there.display().to_string().into());
    }
}
