//! Hunt: random specs until engines, witnesses or laws disagree; what disagrees is confirmed, shrunk and kept as a folder to hand over.

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
use self::grammar::{Generated, Grammar, ROUND};
use self::oracle::{Look, Question, Sighting, Tribunal, Tried, panicked, sightings};
pub use self::oracle::{Oracle, Sign, Symptom};
use self::shrink::{Shrinker, Shrunk, level};
use crate::audit::{AuditError, Diagnosis};
use crate::engines::Site;
use crate::judge::Verdict;
use crate::record::{EngineName, ProcedureId};
use crate::report::Report;
use crate::spec::{Budget, EngineSettings, SpecError};
use crate::system::files::{self, FileError};
use crate::system::process;

pub struct Options<'a> {
    pub site: Site,
    /// Who is hunted, with the settings that specs give them.
    pub engines: BTreeMap<EngineName, EngineSettings>,
    /// Only these procedures; empty for all.
    pub procedures: Vec<ProcedureId>,
    pub seed: u64,
    /// No round begins after this.
    pub time: Duration,
    /// Nor after so many specs, where there is a limit.
    pub specs: Option<u64>,
    /// Nor after so many findings.
    pub findings: Option<usize>,
    /// How long one finding may be shrunk.
    pub shrink: Duration,
    pub jobs: usize,
    /// Of each spec: cheap, for most have nothing to tell.
    pub budget: Budget,
    pub out: PathBuf,
    /// Who is told how far it is.
    pub told: &'a (dyn Fn(&str) + Sync),
}

/// Why a hunt could not go on.
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

/// All that a hunt has come to; kept after every round, so that it goes on from there.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Hunt {
    pub seed: u64,
    pub engines: BTreeSet<EngineName>,
    /// The number of the next spec.
    pub next: u64,
    pub seconds: f64,
    /// Specs that were audited; others hold none of the procedures, or were refused by their reader.
    pub specs: usize,
    pub comparisons: usize,
    pub undecided: usize,
    /// What was seen once and not again.
    pub unconfirmed: usize,
    pub coverage: FeatureCoverage,
    pub findings: Vec<Finding>,
    /// Whether the user stopped it.
    #[serde(skip)]
    pub is_interrupted: bool,
}

impl Hunt {
    /// Findings that are not on record.
    pub fn new_findings(&self) -> impl Iterator<Item = &Finding> {
        self.findings.iter().filter(|f| f.known.is_none())
    }
}

const STATE: &str = "hunt.json";
/// Seeds of confirmations lie this far from those that found something.
const OTHER_SEED: u64 = 7919;
/// One spec of a round has its laws tried, too.
const WITH_LAWS: u64 = 3;
/// A finding of a cause that has been seen this often is shrunk again all the same, to see whether it is that cause.
const LOOKED_INTO: [usize; 3] = [8, 64, 512];

/// Hunts until time is up; what an earlier hunt in the same folder found is kept, and it goes on from there.
pub fn hunt(options: &Options<'_>) -> Result<Hunt, HuntError> {
    let state = resumed(options)?;
    let tribunal = Tribunal { site: &options.site, engines: &options.engines, jobs: options.jobs, limit: LIMIT };
    let known = KnownFinding::on_record()?;
    let before_s = state.seconds;
    let mut hunter = Hunter { options, tribunal, known, hunt: state, confirmed: 0 };
    let clock = Instant::now();
    let grammar = Grammar { seed: options.seed, engines: &options.engines, budget: options.budget };
    let end = clock + options.time;
    while Instant::now() < end && !process::is_interrupted() && !hunter.has_enough() {
        let before = hunter.hunt.clone();
        hunter.round(&grammar, end)?;
        if process::is_interrupted() {
            // The round is begun again another time; what it found by now stays.
            let findings = std::mem::take(&mut hunter.hunt.findings);
            hunter.hunt = Hunt { findings, ..before };
        }
        hunter.hunt.seconds = before_s + clock.elapsed().as_secs_f64();
        hunter.keep()?;
    }
    hunter.hunt.is_interrupted = process::is_interrupted();
    hunter.keep()?;
    Ok(hunter.hunt)
}

/// Past this a reading of a law hangs.
const LIMIT: Duration = Duration::from_secs(60);

fn resumed(options: &Options<'_>) -> Result<Hunt, HuntError> {
    let path = options.out.join(STATE);
    let engines: BTreeSet<EngineName> = options.engines.keys().cloned().collect();
    let fresh = Hunt { seed: options.seed, engines: engines.clone(), ..Hunt::default() };
    let bytes = match files::read_kept(&path) {
        Ok(bytes) => bytes,
        Err(error) if error.source.kind() == io::ErrorKind::NotFound => return Ok(fresh),
        Err(error) => return Err(error.into()),
    };
    let kept: Hunt = serde_json::from_slice(&bytes).map_err(|e| FileError::of(&path, e))?;
    if kept.seed != options.seed || kept.engines != engines {
        let engines = kept.engines.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
        return Err(HuntError::OfAnother { path, seed: kept.seed, engines });
    }
    Ok(kept)
}

struct Hunter<'a> {
    options: &'a Options<'a>,
    tribunal: Tribunal<'a>,
    known: Vec<KnownFinding>,
    hunt: Hunt,
    /// How many sightings were looked at again.
    confirmed: usize,
}

/// A spec in which something is wrong.
struct Suspicion<'a> {
    generated: &'a Generated,
    sighting: Sighting,
}

impl Hunter<'_> {
    fn has_enough(&self) -> bool {
        self.options.specs.is_some_and(|most| self.hunt.next >= most)
            || self.options.findings.is_some_and(|most| self.hunt.new_findings().count() >= most)
    }

    fn keep(&self) -> Result<(), HuntError> {
        files::keep_json(&self.options.out.join(STATE), &self.hunt)?;
        let path = self.options.out.join("index.md");
        files::keep_shared(&path, page::page(&self.hunt).as_bytes())?;
        Ok(())
    }

    /// One round of specs, and all that they show.
    fn round(&mut self, grammar: &Grammar<'_>, end: Instant) -> Result<(), HuntError> {
        let first = self.hunt.next;
        let last = (first / ROUND + 1) * ROUND;
        let last = self.options.specs.map_or(last, |most| last.min(most));
        let wanted = |g: &Generated| {
            let all = &self.options.procedures;
            all.is_empty() || all.iter().any(|p| g.case.task(*p).is_some())
        };
        let round: Vec<Generated> = (first..last).filter_map(|n| grammar.spec(n)).filter(wanted).collect();
        let folder = tempfile::tempdir().map_err(|e| FileError::of(&std::env::temp_dir(), e))?;
        let seen = self.seen(&round, folder.path())?;
        if process::is_interrupted() {
            return Ok(());
        }
        for (k, generated) in round.iter().enumerate() {
            self.hunt.coverage.add(&generated.features);
            let mut all = seen.get(k).cloned().unwrap_or_default();
            if k as u64 == WITH_LAWS && all.is_empty() {
                all = self.tribunal.broken(&generated.case, None, &[], self.options.seed);
            }
            for sighting in per_engine(all) {
                if process::is_interrupted() || self.has_enough() {
                    return Ok(());
                }
                self.follow(&Suspicion { generated, sighting }, end)?;
            }
        }
        self.hunt.next = last;
        let Hunt { next, comparisons, undecided, findings, .. } = &self.hunt;
        (self.options.told)(&format!(
            "{next} specs, {comparisons} comparisons, {undecided} undecided, {} findings",
            findings.len()
        ));
        Ok(())
    }

    /// What is wrong in each spec of a round.
    fn seen(&mut self, round: &[Generated], folder: &Path) -> Result<Vec<Vec<Sighting>>, HuntError> {
        if round.is_empty() {
            return Ok(vec![]);
        }
        let mut paths = vec![];
        for generated in round {
            let own = folder.join(&generated.name);
            paths.push(generated.draft.write(&own, &generated.name).map_err(|e| FileError::of(&own, e))?);
        }
        let question = Question {
            symptom: None,
            procedures: self.options.procedures.clone(),
            look: Look::with(self.options.seed),
        };
        match self.tribunal.audit(&paths, &question, &folder.join("out"))? {
            Tried::Report(report) => {
                self.count(&report, round.len());
                Ok(round.iter().map(|g| sightings(&report, &g.name, &self.options.engines)).collect())
            }
            Tried::NoSpec(error) if round.len() == 1 => {
                (self.options.told)(&format!("{}: no spec: {error}", round[0].name));
                Ok(vec![vec![]])
            }
            Tried::Panicked if round.len() == 1 => Ok(vec![vec![panicked()]]),
            // Which of them it was shows one by one.
            Tried::NoSpec(_) | Tried::Panicked => {
                let each = round.iter().map(|one| self.seen(std::slice::from_ref(one), &folder.join("apart")));
                Ok(each.collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect())
            }
        }
    }

    fn count(&mut self, report: &Report, specs: usize) {
        let hunted = |c: &&crate::judge::Comparison| self.options.engines.contains_key(&c.key.engine);
        let undecided = report.comparisons.iter().filter(hunted).filter(|c| c.verdict == Verdict::Inconclusive);
        for c in undecided {
            self.hunt.undecided += 1;
            let (key, meter, why) = (&c.key, &c.meter, c.diagnosis.as_deref().unwrap_or("no reason is told"));
            tracing::info!("{key} at {meter}: {why}");
        }
        self.hunt.comparisons += report.comparisons.iter().filter(hunted).count();
        self.hunt.specs += specs;
    }

    /// Confirms, shrinks and keeps what was seen, unless it is what has been found before.
    fn follow(&mut self, suspicion: &Suspicion<'_>, end: Instant) -> Result<(), HuntError> {
        let Suspicion { generated, sighting } = suspicion;
        if self.is_seen_before(suspicion) {
            return Ok(());
        }
        let Some(sighting) = self.confirmed(&generated.draft, sighting)? else {
            self.hunt.unconfirmed += usize::from(!process::is_interrupted());
            return Ok(());
        };
        (self.options.told)(&format!("{}: {}: shrinking", generated.name, sighting.symptom));
        let diagnosis = sighting.diagnosis();
        let until = (Instant::now() + self.options.shrink).min(end + self.options.shrink);
        let start = (generated.draft.clone(), sighting);
        let shrunk = Shrinker::new(&self.tribunal, start, self.options.seed + 3 * OTHER_SEED, until).run()?;
        self.add(generated, &shrunk, diagnosis)
    }

    /// Whether a known cause accounts for it: the same symptom, and all that the cause takes is there.
    fn is_seen_before(&mut self, suspicion: &Suspicion<'_>) -> bool {
        let Suspicion { generated, sighting } = suspicion;
        let Some(same) = self.hunt.findings.iter_mut().find(|f| f.accounts_for(&sighting.symptom, &generated.features))
        else {
            return false;
        };
        same.seen += 1;
        same.also.insert(sighting.symptom.procedure);
        !LOOKED_INTO.contains(&same.seen)
    }

    /// The same with two other seeds, the first of which asks for a diagnosis.
    fn confirmed(&mut self, draft: &Draft, sighting: &Sighting) -> Result<Option<Sighting>, HuntError> {
        self.confirmed += 1;
        let mut found = None;
        for (k, diagnosis) in [Diagnosis::Sought, Diagnosis::LeftOut].into_iter().enumerate() {
            let seed = self.options.seed + (k as u64 + 1) * OTHER_SEED;
            let look = Look { diagnosis, ..Look::with(seed) };
            let again = self.tribunal.shows(&[draft], &sighting.symptom, look)?.pop().flatten();
            let Some(again) = again.filter(|s| s.p_value <= level(self.confirmed)) else { return Ok(None) };
            found.get_or_insert(again);
        }
        Ok(found)
    }

    fn add(&mut self, generated: &Generated, shrunk: &Shrunk, diagnosis: Option<String>) -> Result<(), HuntError> {
        let Shrunk { draft, sighting, looks, is_minimal } = shrunk;
        let Some(case) = draft.case() else { return Ok(()) };
        let features = feature::features(draft, &case);
        if let Some(same) = self.hunt.findings.iter_mut().find(|f| f.is_same(&sighting.symptom, &features)) {
            same.seen += 1;
            same.also.insert(sighting.symptom.procedure);
            return Ok(());
        }
        let id = format!("{}-{}", sighting.symptom.engine, self.hunt.findings.len() + 1);
        let told =
            finding::Told { looks: *looks, is_minimal: *is_minimal, diagnosis, found_in: generated.name.clone() };
        let folder = self.options.out.join(&id);
        let mut finding = finding::write(&self.tribunal, draft, sighting, &told, &folder, self.options.seed)?;
        finding.id.clone_from(&id);
        finding.features = features;
        finding.known = self.known.iter().find(|k| k.accounts_for(&finding)).map(|k| k.cause.clone());
        let original = folder.join("original");
        generated.draft.write(&original, "spec").map_err(|e| FileError::of(&original, e))?;
        files::keep_json(&folder.join("finding.json"), &finding)?;
        (self.options.told)(&format!(
            "{id}: {} ({} lines, table {:?}, {looks} looks)",
            finding.symptom, finding.lines, finding.table
        ));
        self.hunt.findings.push(finding);
        self.keep()
    }
}

/// What an engine does wrong in a spec counts once: what the others show may be of the same cause.
fn per_engine(all: Vec<Sighting>) -> Vec<Sighting> {
    let mut first: BTreeMap<EngineName, Sighting> = BTreeMap::new();
    for sighting in all {
        first.entry(sighting.symptom.engine.clone()).or_insert(sighting);
    }
    first.into_values().collect()
}

/// What is asked of [`shrink`].
pub struct ShrinkOptions<'a> {
    pub site: Site,
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

/// What a shrinking found.
pub enum Shrinking {
    Found(Box<Finding>),
    /// Nothing is wrong with the engine there.
    Sound,
}

/// The smallest spec in which an engine still fails as it does in a spec of the user's.
pub fn shrink(options: &ShrinkOptions<'_>) -> Result<Shrinking, HuntError> {
    let mut drafts = Draft::read(options.spec)?;
    drafts.retain(|(name, _)| options.case.is_none_or(|case| name.ends_with(case)));
    let folder = options.spec.parent().unwrap_or(Path::new(""));
    for (_, draft) in &mut drafts {
        let settings = draft.spec.engines.get_or_insert_default().entry(options.engine.to_string()).or_default();
        run_in(settings, folder);
    }
    for (name, draft) in drafts {
        let of_engine = draft.spec.engines.as_ref().and_then(|e| e.get(options.engine.as_str())).cloned();
        let engines = BTreeMap::from([(options.engine.clone(), of_engine.unwrap_or_default())]);
        let tribunal = Tribunal { site: &options.site, engines: &engines, jobs: options.jobs, limit: LIMIT };
        let own = tempfile::tempdir().map_err(|e| FileError::of(&std::env::temp_dir(), e))?;
        let path = draft.write(own.path(), "c0").map_err(|e| FileError::of(own.path(), e))?;
        let question = Question {
            symptom: None,
            procedures: options.procedures.clone(),
            look: Look { diagnosis: Diagnosis::Sought, ..Look::with(options.seed) },
        };
        let all = match tribunal.audit(&[path], &question, &own.path().join("out"))? {
            Tried::Report(report) => sightings(&report, "c0", &engines),
            Tried::NoSpec(error) => return Err(error.into()),
            Tried::Panicked => vec![panicked()],
        };
        let Some(sighting) = all.into_iter().find(|s| s.p_value <= level(1)) else { continue };
        let diagnosis = sighting.diagnosis();
        let until = Instant::now() + options.time;
        let Shrunk { draft, sighting, looks, is_minimal } =
            Shrinker::new(&tribunal, (draft, sighting), options.seed + OTHER_SEED, until).run()?;
        let told = finding::Told { looks, is_minimal, diagnosis, found_in: name };
        let mut finding = finding::write(&tribunal, &draft, &sighting, &told, &options.out, options.seed)?;
        if let Some(case) = draft.case() {
            finding.features = feature::features(&draft, &case);
        }
        files::keep_json(&options.out.join("finding.json"), &finding)?;
        return Ok(Shrinking::Found(Box::new(finding)));
    }
    Ok(Shrinking::Sound)
}

/// Makes a program of a user's run where it is, whatever folder a spec lies in.
pub fn run_in(settings: &mut EngineSettings, folder: &Path) {
    if settings.0.contains_key("command") {
        let here = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
        let named = settings.0.get(crate::engines::RUN_IN).and_then(|f| f.as_str());
        let there = named.map_or(here.to_owned(), |f| here.join(f));
        let there = std::path::absolute(&there).unwrap_or(there);
        settings.0.insert(crate::engines::RUN_IN.to_owned(), there.display().to_string().into());
    }
}
