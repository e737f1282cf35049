//! The cards: renderers by releases by capabilities, collected from runs. What `cards.json` holds.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use itertools::Itertools;
use luxproof_model::{EngineName, HiddenVariant, ProcedureId, Report, Request, Role, Status, ToleranceClass, Tool};
use luxproof_process::process::quoted;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::evidence::ReportIndex;
use crate::{Capabilities, CapabilityId, CardsError, CaseEvidence, Cell, ReleaseLabel, judge, slug};

/// The version of `cards.json`.
const CARDS_VERSION: u32 = 1;
/// Digits of a report's checksum that name its run.
const RUN_DIGITS: usize = 16;

/// `cards.json`: every cell of the site.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Cards {
    /// Version of the format: 1.
    pub luxproof_cards: u32,
    pub tool: Tool,
    pub capabilities: Capabilities,
    /// By name, luxproof's own solvers last.
    pub renderers: Vec<RendererCard>,
    /// The runs behind the cells, the newest first.
    pub runs: Vec<CardRun>,
    /// The seeds of hidden variants.
    pub seeds: BTreeSet<u64>,
}

/// A renderer with its releases.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RendererCard {
    pub name: String,
    /// Its folder below `renderers/`.
    pub slug: String,
    /// Whether it is a solver of luxproof's own.
    pub is_own: bool,
    /// The newest first.
    pub releases: Vec<ReleaseCard>,
}

/// A release with its cells.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ReleaseCard {
    pub release: ReleaseLabel,
    /// Versions as the engine reports them.
    pub versions: BTreeSet<String>,
    /// The packages that it was installed from, such as `pyradiance 1.3.1`.
    #[serde(default, skip_serializing_if = "BTreeSet::is_empty")]
    pub packages: BTreeSet<String>,
    /// Whether its values are recorded ones, which cannot be run again.
    pub is_recorded: bool,
    pub runs: BTreeSet<RunId>,
    /// A cell for each capability, in their order.
    pub cells: Vec<CellCard>,
    /// The cells that differ from those of the release before.
    pub changes: Vec<Change>,
}

/// A cell with its place on the site.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CellCard {
    pub capability: CapabilityId,
    #[serde(flatten)]
    pub cell: Cell,
    /// The cell in a few words.
    pub headline: String,
    /// The fault, the limit or the reason.
    pub explanation: String,
    /// The earliest release since which the state is the same; null where that is the first one on the card.
    pub since: Option<ReleaseLabel>,
    /// The page with its evidence.
    pub page: String,
}

/// A cell that differs from that of the release before.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Change {
    pub capability: CapabilityId,
    pub before: ReleaseLabel,
    pub from: String,
    pub to: String,
}

/// The name of a run on the site: the first digits of its report's checksum.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "String", into = "String")]
#[schemars(with = "String")]
pub struct RunId(String);

impl TryFrom<String> for RunId {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        // It becomes the name of a folder.
        let is_id = text.len() <= RUN_DIGITS && text.bytes().all(|b| b.is_ascii_hexdigit());
        if is_id { Ok(Self(text)) } else { Err(format!("`{text}` is no run: give {RUN_DIGITS} hexadecimal digits")) }
    }
}

impl From<RunId> for String {
    fn from(id: RunId) -> Self {
        id.0
    }
}

impl RunId {
    pub fn of(report: &Report) -> Self {
        let digits = report.checksum.chars().filter(char::is_ascii_hexdigit).take(RUN_DIGITS);
        Self(digits.collect())
    }

    pub fn as_str(&self) -> &str {
        &self.0
    }
}

/// A run behind cells.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CardRun {
    pub id: RunId,
    pub title: String,
    pub started: String,
    pub tool: Tool,
    /// What it was asked for; with its specs it repeats the run.
    pub request: Option<Request>,
    /// Its HTML report on the site, relative to the root of the site.
    pub report: Option<String>,
    /// Its bundle on the site, likewise.
    pub bundle: Option<String>,
    /// Sizes of its `report.json` and of its bundle on the site, in bytes; null where unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub report_bytes: Option<u64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bundle_bytes: Option<u64>,
    /// The place of each spec in the bundle, by the path that the run was given.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub bundled_specs: BTreeMap<String, String>,
    pub verification: Verification,
}

/// Who ran it, and whether it came out again.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "verification", rename_all = "snake_case")]
pub enum Verification {
    /// The publisher of the site ran it.
    Own,
    /// It was submitted, and the publisher ran its bundle again.
    Reproduced {
        /// Procedures of engines that came out to the byte.
        same_bytes: usize,
        /// Procedures of engines that came out within their uncertainties.
        within: usize,
        /// SHA-256 of the bundle's list of hashes.
        bundle_sha256: String,
    },
    /// It came in a bundle, which was not run again here.
    Submitted {
        /// SHA-256 of the bundle's list of hashes.
        bundle_sha256: String,
    },
    /// It is a report of somebody else, which nothing supports.
    Unverified,
}

impl CardRun {
    /// The command that repeats these cases of specs with one engine, in the unpacked bundle.
    pub fn command(&self, specs: &[String], cases: &[String], engine: &EngineName) -> Option<String> {
        let bundled: Vec<String> = specs.iter().filter_map(|spec| self.bundled_specs.get(spec).cloned()).collect();
        let request = self.request.clone().filter(|_| !bundled.is_empty() && bundled.len() == specs.len())?;
        Some(
            Request { engines: vec![engine.to_string()], filter: cases.to_vec(), policy: None, ..request }
                .command(&bundled),
        )
    }

    /// The command that writes the scene of a case for a run by hand, in the unpacked bundle.
    pub fn export_command(&self, case: &CaseEvidence) -> Option<String> {
        let spec = self.bundled_specs.get(&case.spec).filter(|_| case.is_exportable)?;
        let [spec, engine] = [spec, case.engine.as_str()].map(quoted);
        Some(format!("luxproof export {spec} --engine {engine} --procedures {} --out by-hand", case.procedure.name()))
    }

    /// The record of a report.
    ///
    /// The caller adds what of it lies on the site.
    pub fn of(report: &Report, verification: Verification) -> Self {
        Self {
            id: RunId::of(report),
            title: report.spec.title.clone(),
            started: report.started.clone(),
            tool: report.tool.clone(),
            request: report.request.clone(),
            report: None,
            bundle: None,
            report_bytes: None,
            bundle_bytes: None,
            bundled_specs: BTreeMap::new(),
            verification,
        }
    }
}

/// The evidence of a renderer for a capability: the JSON behind one page.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CellEvidence {
    pub renderer: String,
    pub renderer_slug: String,
    pub capability: CapabilityId,
    /// The newest first.
    pub releases: Vec<ReleaseEvidence>,
}

/// The evidence of one release.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ReleaseEvidence {
    pub release: ReleaseLabel,
    pub is_recorded: bool,
    pub cell: Cell,
    pub cases: Vec<CaseEvidence>,
}

/// What is collected of a release before its cells are judged.
#[derive(Default)]
struct Release {
    versions: BTreeSet<String>,
    packages: BTreeSet<String>,
    is_recorded: bool,
    runs: BTreeSet<RunId>,
    /// By capability; of a case in several runs the newest counts.
    evidence: BTreeMap<CapabilityId, BTreeMap<EvidenceKey, CaseEvidence>>,
}

/// What a later run replaces.
type EvidenceKey = (String, Option<HiddenVariant>, ProcedureId, String);

impl Cards {
    /// The cards of runs, with the evidence behind them.
    pub fn of(
        capabilities: &Capabilities,
        runs: &[(CardRun, &Report)],
        tool: Tool,
    ) -> Result<(Self, Vec<CellEvidence>), CardsError> {
        let mut renderers: BTreeMap<String, BTreeMap<ReleaseLabel, Release>> = BTreeMap::new();
        let mut own = BTreeSet::new();
        for (run, report) in runs.iter().sorted_by(|(a, _), (b, _)| a.started.cmp(&b.started)) {
            check(report, run)?;
            let index = ReportIndex::new(report, capabilities);
            let mut has_case = false;
            for status in report.engines.iter().filter(|status| status.status != Status::Absent) {
                let label = ReleaseLabel::of(status);
                let mut evidence = index.evidence(&status.id, &run.id);
                evidence.retain(|_, cases| !cases.is_empty());
                if evidence.is_empty() {
                    continue;
                }
                has_case = true;
                if status.role == Role::Reference {
                    own.insert(status.id.family().to_owned());
                }
                let release = renderers.entry(status.id.family().to_owned()).or_default().entry(label).or_default();
                release.versions.extend(status.version.clone());
                release.packages.extend(status.package.clone());
                release.is_recorded |= status.role == Role::Recorded;
                release.add(evidence, &run.id, &status.id);
            }
            if !has_case {
                return Err(CardsError::NoCase { run: run.title.clone() });
            }
        }
        let mut pages = vec![];
        let cards = renderers.into_iter().map(|(name, releases)| {
            let is_own = own.contains(&name);
            renderer_card(name, is_own, releases, capabilities, &mut pages)
        });
        // Renderers before luxproof's own solvers, which judge them.
        let renderers = cards.sorted_by_key(|card: &RendererCard| card.is_own).collect();
        let runs: Vec<CardRun> =
            runs.iter().map(|(run, _)| run.clone()).sorted_by(|a, b| b.started.cmp(&a.started)).collect();
        let cases = runs_cases(&pages);
        Ok((
            Self {
                luxproof_cards: CARDS_VERSION,
                tool,
                capabilities: capabilities.clone(),
                renderers,
                runs,
                seeds: cases,
            },
            pages,
        ))
    }
}

/// The seeds of hidden variants among the evidence.
fn runs_cases(pages: &[CellEvidence]) -> BTreeSet<u64> {
    let cases = pages.iter().flat_map(|page| &page.releases).flat_map(|release| &release.cases);
    cases.filter_map(|case| case.hidden.as_ref()).map(|variant| variant.seed).collect()
}

/// Refuses runs that other tolerances judge.
fn check(report: &Report, run: &CardRun) -> Result<(), CardsError> {
    let class = report.request.as_ref().and_then(|request| request.tolerance_class);
    if let Some(class) = class.filter(|class| *class != ToleranceClass::Verification) {
        return Err(CardsError::Class { run: run.title.clone(), class: class.to_string() });
    }
    let policies = report.cases.iter().filter_map(|case| Some((case, case.policy.as_ref()?)));
    match policies.into_iter().next() {
        Some((case, policy)) => {
            Err(CardsError::Policy { run: run.title.clone(), case: case.name.clone(), policy: policy.file.clone() })
        }
        None => Ok(()),
    }
}

impl Release {
    fn add(&mut self, evidence: BTreeMap<&CapabilityId, Vec<CaseEvidence>>, run: &RunId, engine: &EngineName) {
        self.runs.insert(run.clone());
        for (capability, cases) in evidence {
            let known = self.evidence.entry(capability.clone()).or_default();
            for case in cases {
                // Calibration scenes under different settings are different cases.
                let reported_as = if case.case == case.reported_as { String::new() } else { case.reported_as.clone() };
                let key = (case.case.clone(), case.hidden.clone(), case.procedure, reported_as);
                // A later run that does not run a case does not take back what an earlier one found.
                let is_void = matches!(case.outcome, crate::Outcome::NotRun { .. });
                if !(is_void && known.contains_key(&key)) {
                    known.insert(key, CaseEvidence { engine: engine.clone(), ..case });
                }
            }
        }
    }
}

fn renderer_card(
    name: String,
    is_own: bool,
    releases: BTreeMap<ReleaseLabel, Release>,
    capabilities: &Capabilities,
    pages: &mut Vec<CellEvidence>,
) -> RendererCard {
    let folder = slug(&name);
    let mut cards: Vec<ReleaseCard> = vec![];
    let mut evidence: BTreeMap<CapabilityId, Vec<ReleaseEvidence>> = BTreeMap::new();
    // By capability the last release in which it was tested, with its cell. What was not tested has not changed.
    let mut tested: HashMap<CapabilityId, (ReleaseLabel, CellCard)> = HashMap::new();
    // The oldest first, so that each is compared with the one before.
    for (label, mut release) in releases {
        let mut cells = vec![];
        for capability in &capabilities.capabilities {
            let cases: Vec<CaseEvidence> =
                release.evidence.remove(&capability.id).map(|cases| cases.into_values().collect()).unwrap_or_default();
            let cell = judge(capability, &cases);
            let before = tested.get(&capability.id).map(|(_, cell)| cell);
            cells.push(cell_card(&folder, &label, capability.id.clone(), cell.clone(), before));
            let of_release = ReleaseEvidence { release: label.clone(), is_recorded: release.is_recorded, cell, cases };
            evidence.entry(capability.id.clone()).or_default().push(of_release);
        }
        let changes = changes(&tested, &cells);
        for cell in cells.iter().filter(|cell| !cell.cell.standing.is_untested()) {
            tested.insert(cell.capability.clone(), (label.clone(), cell.clone()));
        }
        let Release { versions, packages, is_recorded, runs, .. } = release;
        cards.push(ReleaseCard { release: label, versions, packages, is_recorded, runs, cells, changes });
    }
    cards.reverse();
    for (capability, mut releases) in evidence {
        releases.reverse();
        pages.push(CellEvidence { renderer: name.clone(), renderer_slug: folder.clone(), capability, releases });
    }
    RendererCard { name, slug: folder, is_own, releases: cards }
}

fn cell_card(
    folder: &str,
    label: &ReleaseLabel,
    capability: CapabilityId,
    cell: Cell,
    before: Option<&CellCard>,
) -> CellCard {
    let since = match before {
        None => None,
        Some(earlier) if earlier.cell.standing.key() == cell.standing.key() => earlier.since.clone(),
        Some(_) => Some(label.clone()).filter(|_| !cell.standing.is_untested()),
    };
    let page = format!("renderers/{folder}/{capability}.html#{}", anchor(label));
    let (headline, explanation) = (cell.standing.headline(), cell.standing.explanation());
    CellCard { capability, cell, headline, explanation, since, page }
}

/// The anchor of a release on pages.
pub(crate) fn anchor(label: &ReleaseLabel) -> String {
    format!("r-{}", slug(label.as_str()))
}

impl RendererCard {
    /// Since when its newest release is in the state of a cell; `None` where only one release was tested.
    pub fn since(&self, capability: &CapabilityId) -> Option<Since<'_>> {
        let tested = self.releases.iter().filter_map(|release| Some((release, release.cell(capability)?)));
        let tested: Vec<_> = tested.filter(|(_, cell)| !cell.cell.standing.is_untested()).collect();
        let ((newest, now), _) = tested.split_first().filter(|(_, earlier)| !earlier.is_empty())?;
        // What the newest release is not tested for has no state since when.
        if self.releases.first().is_none_or(|first| first.release != newest.release) {
            return None;
        }
        let state = now.cell.standing.key();
        Some(match tested.iter().position(|(_, cell)| cell.cell.standing.key() != state) {
            None => Since::All { releases: tested.len() },
            Some(k) => Since::Release { since: &tested[k - 1].0.release, before: tested[k].1 },
        })
    }
}

/// Since when a cell is in its state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Since<'a> {
    /// In every tested release.
    All { releases: usize },
    /// Since a release; the cell of the tested one before it.
    Release { since: &'a ReleaseLabel, before: &'a CellCard },
}

impl ReleaseCard {
    /// Its versions with the packages that it was installed from: `pyradiance 1.3.1, program 6.0a`.
    pub fn version_text(&self) -> String {
        let packages = self.packages.iter().join(", ");
        let programs = self.versions.iter().map(|version| self.program_version(version));
        let programs = programs.filter(|version| !version.is_empty()).join(", ");
        match (packages.is_empty(), programs.is_empty()) {
            (true, _) => programs,
            (false, true) => packages,
            (false, false) => format!("{packages}, program {programs}"),
        }
    }

    /// A version without the package that may stand before it, as in `pyradiance-1.0.0, 6.0a`.
    fn program_version<'a>(&self, version: &'a str) -> &'a str {
        let mut rests = self.packages.iter().filter_map(|package| version.strip_prefix(&package.replacen(' ', "-", 1)));
        rests.next().map_or(version, |rest| rest.trim_start_matches([',', ' ']))
    }

    /// Its cell of a capability.
    pub fn cell(&self, capability: &CapabilityId) -> Option<&CellCard> {
        self.cells.iter().find(|cell| cell.capability == *capability)
    }
}

/// A bound that grows or shrinks by more than this factor may be a change.
const CHANGED_BOUND: f64 = 2.0;

/// What differs from the last release in which it was tested.
fn changes(tested: &HashMap<CapabilityId, (ReleaseLabel, CellCard)>, cells: &[CellCard]) -> Vec<Change> {
    let mut found = vec![];
    for cell in cells.iter().filter(|cell| !cell.cell.standing.is_untested()) {
        let Some((release, before)) = tested.get(&cell.capability) else { continue };
        if has_changed(&before.cell, &cell.cell) {
            found.push(Change {
                capability: cell.capability.clone(),
                before: release.clone(),
                from: before.headline.clone(),
                to: cell.headline.clone(),
            });
        }
    }
    found
}

/// Whether two cells differ in their state, or their worst deviations by more than their uncertainties and by a factor of two.
fn has_changed(before: &Cell, after: &Cell) -> bool {
    if before.standing.key() != after.standing.key() {
        return true;
    }
    before.standing.worst().zip(after.standing.worst()).is_some_and(|(a, b)| {
        let (low, high) = (a.bound().min(b.bound()), a.bound().max(b.bound()));
        high > CHANGED_BOUND * low && (a.value - b.value).abs() > a.expanded + b.expanded
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{ENGINE, MadeCase, capabilities, report};
    use crate::{Measure, Standing};

    fn cards(reports: &[Report]) -> Result<(Cards, Vec<CellEvidence>), CardsError> {
        let runs: Vec<(CardRun, &Report)> = reports.iter().map(|r| (CardRun::of(r, Verification::Own), r)).collect();
        Cards::of(&capabilities(2), &runs, Tool::default())
    }

    fn release(engine: &str, started: &str, off: f64) -> Report {
        let given = [MadeCase::new("a").off(off, 0.001), MadeCase::new("b").off(off, 0.001)];
        Report { started: started.to_owned(), ..report(engine, "9", &given) }
    }

    #[test]
    fn releases_stand_in_order_and_changes_name_what_changed_and_since_when() {
        let reports = [
            release("mitsuba@3.10.0", "2026-03-01", 0.002),
            release("mitsuba@3.5.2", "2026-03-02", 0.002),
            release("mitsuba@3.9.1", "2026-03-03", 0.3),
            release("mitsuba@3.8.0", "2026-03-04", 0.3),
        ];
        let (cards, pages) = cards(&reports).unwrap();
        let mitsuba = &cards.renderers[0];
        let labels: Vec<&str> = mitsuba.releases.iter().map(|r| r.release.as_str()).collect();
        assert_eq!(labels, ["3.10.0", "3.9.1", "3.8.0", "3.5.2"]);
        let since: Vec<Option<&str>> =
            mitsuba.releases.iter().map(|r| r.cells[0].since.as_ref().map(ReleaseLabel::as_str)).collect();
        assert_eq!(since, [Some("3.10.0"), Some("3.8.0"), Some("3.8.0"), None]);
        let changed: Vec<usize> = mitsuba.releases.iter().map(|r| r.changes.len()).collect();
        assert_eq!(changed, [1, 0, 1, 0]);
        let Some(Since::Release { since, before }) = mitsuba.since(&mitsuba.releases[0].cells[0].capability) else {
            panic!("{mitsuba:?}")
        };
        assert_eq!((since.as_str(), before.headline.as_str()), ("3.10.0", "wrong, off by up to 31 %"));
        let change = &mitsuba.releases[2].changes[0];
        assert_eq!(
            (change.before.as_str(), change.from.as_str(), change.to.as_str()),
            ("3.5.2", "within 0.30 %", "wrong, off by up to 31 %")
        );
        assert_eq!(pages.len(), 1);
        assert_eq!(pages[0].releases.len(), 4);
    }

    #[test]
    fn a_release_that_was_not_tested_changes_nothing_and_hides_no_change() {
        let untested = report("mitsuba@3.6.4", "9", &[MadeCase::new("a").off(0.0, 0.0)]);
        let reports =
            [release("mitsuba@3.5.2", "2026-03-01", 0.002), untested, release("mitsuba@3.7.1", "2026-03-03", 0.3)];
        let (cards, _) = cards(&reports).unwrap();
        let [newest, middle, oldest] = &cards.renderers[0].releases[..] else { panic!("{cards:?}") };
        assert!(middle.cells[0].cell.standing.is_untested());
        assert_eq!((oldest.changes.len(), middle.changes.len(), newest.changes.len()), (0, 0, 1));
        assert_eq!(newest.changes[0].before.as_str(), "3.5.2");
        assert_eq!(
            (middle.cells[0].since.as_ref(), newest.cells[0].since.as_ref().map(ReleaseLabel::as_str)),
            (None, Some("3.7.1"))
        );
    }

    #[test]
    fn releases_of_one_program_version_differ_by_their_package() {
        let mut reports = [release("radiance@1.0.0", "2026-03-01", 0.0), release("radiance", "2026-03-02", 0.0)];
        let of_engines =
            [("pyradiance-1.0.0, 6.0a", "pyradiance 1.0.0", None), ("6.0a", "pyradiance 1.3.1", Some("1.3.1"))];
        for (report, (version, package, release)) in reports.iter_mut().zip(of_engines) {
            let status = &mut report.engines[0];
            status.version = Some(version.to_owned());
            status.package = Some(package.to_owned());
            status.release = release.map(str::to_owned);
        }
        let (cards, _) = cards(&reports).unwrap();
        let texts: Vec<String> = cards.renderers[0].releases.iter().map(ReleaseCard::version_text).collect();
        assert_eq!(texts, ["pyradiance 1.3.1, program 6.0a", "pyradiance 1.0.0, program 6.0a"]);
        let cell = &cards.renderers[0].releases[0].cells[0].capability;
        assert_eq!(cards.renderers[0].since(cell), Some(Since::All { releases: 2 }));
    }

    #[test]
    fn of_a_case_in_two_runs_the_newer_counts_and_a_run_without_it_takes_nothing_back() {
        let mut later = release(ENGINE, "2026-02-02", 0.001);
        let (now, _) = cards(&[later.clone(), release(ENGINE, "2026-01-01", 0.4)]).unwrap();
        assert!(matches!(now.renderers[0].releases[0].cells[0].cell.standing, Standing::Accurate { .. }));
        later.started = "2026-01-01".to_owned();
        let mut stopped = report(ENGINE, "9", &[MadeCase::new("a").not_run(), MadeCase::new("b").not_run()]);
        stopped.started = "2026-03-01".to_owned();
        let (now, _) = cards(&[later, stopped]).unwrap();
        let cell = &now.renderers[0].releases[0].cells[0].cell;
        assert_eq!(cell.standing.worst().map(|d| (d.value, d.measure)), Some((0.001, Measure::Relative)));
    }

    #[test]
    fn a_run_by_other_tolerances_or_without_a_case_gives_no_cards() {
        let mut loose = release(ENGINE, "2026-01-01", 0.0);
        loose.request = Some(luxproof_model::Request {
            tolerance_class: Some(ToleranceClass::Survey),
            ..luxproof_model::Request::default()
        });
        assert!(matches!(cards(&[loose]), Err(CardsError::Class { .. })));
        let other = report(ENGINE, "9", &[MadeCase::new("my-room").off(0.0, 0.0)]);
        assert!(matches!(cards(&[other]), Err(CardsError::NoCase { .. })));
        let mut judged = release(ENGINE, "2026-01-01", 0.0);
        judged.cases[0].policy = serde_json::from_value(
            serde_json::json!({"file": "luxproof.yaml", "sha256": "00", "required_engines": []}),
        )
        .ok();
        assert!(judged.cases[0].policy.is_some());
        assert!(matches!(cards(&[judged]), Err(CardsError::Policy { .. })));
    }
}
