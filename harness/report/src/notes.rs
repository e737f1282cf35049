//! The text lines that several views share: notes, biases, agreements, ratios, departures, diagnoses and splits.
//!
//! A note is a failure, a skip, a shortcut or an approximation of one engine in some jobs.

use std::collections::{BTreeMap, BTreeSet};

use itertools::Itertools as _;

use super::words::{estimate, interval_in_percent, plural, significant};
use luxproof_model::EVERYONE;
use luxproof_model::Report;
use luxproof_model::Skip;
use luxproof_model::{
    Bias, Comparison, Consensus, FigureAgreement, KnownDeviationOutcome, Misfit, PolicyRecord, PublishedTable, Ratios,
    Recording, Split, State, Statistics, Verdict,
};
use luxproof_model::{EngineName, ProcedureId, ReadingKey};
use luxproof_process::printable::Quoted;

/// More meters than this are summarised instead of listed.
pub(super) const LISTED_METERS: usize = 8;
/// What to do about undecided comparisons.
const UNDECIDED_NEXT_STEP: &str = "next: change the spec's `budget` as each line says, then the same command; other remedies are in docs/undecided.md";
/// What to do where the time limit cut all that is undecided.
const NEXT_STEP_AFTER_TIME_LIMIT: &str =
    "next: the same command when the machine is idle, or a larger `budget`; other remedies are in docs/undecided.md";
/// Cases that a line lists by name.
const LISTED_CASES: usize = 3;
/// Digits of a checksum that a line shows.
const CHECKSUM_DIGITS: usize = 12;

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, strum::Display)]
#[strum(serialize_all = "snake_case")]
pub(super) enum Kind {
    Failed,
    /// A fault in how an engine states its errors.
    Finding,
    /// A known deviation on record that excuses nothing here.
    Record,
    /// Not run: there is no reading.
    Skipped,
    /// Read with less work: meters that follow from others, light paths that carry nothing.
    Shortcut,
    Approximate,
    Note,
}

impl Kind {
    /// The name of one note of this kind.
    pub(super) const fn noun(self) -> &'static str {
        match self {
            Self::Failed => "failure",
            Self::Finding => "finding",
            Self::Record => "known deviation",
            Self::Skipped => "skip",
            Self::Shortcut => "shortcut",
            Self::Approximate => "approximation",
            Self::Note => "note",
        }
    }
}

/// A remark about one engine in some jobs.
pub(super) struct Note<'a> {
    pub(super) kind: Kind,
    pub(super) engine: &'a EngineName,
    pub(super) text: String,
    pub(super) jobs: BTreeSet<Job<'a>>,
}

/// A case and a procedure.
type Job<'a> = (&'a str, ProcedureId);

/// All notes, each once with all its jobs, sorted by kind and engine.
pub(super) fn notes(report: &Report) -> Vec<Note<'_>> {
    let recorded = report.recordings.iter().flat_map(recording_notes);
    let on_record = report.known_deviations.iter().filter_map(|k| Some((Kind::Record, &k.key, describe_idle(k)?)));
    let skipped = report.skips.iter().map(|s| (kind(s), &s.key, reason(s)));
    let mut notes: BTreeMap<_, BTreeSet<Job<'_>>> = BTreeMap::new();
    for (kind, key, text) in recorded.chain(on_record).chain(skipped) {
        notes.entry((kind, &key.engine, text)).or_default().insert((&key.case, key.procedure));
    }
    notes.into_iter().map(|((kind, engine, text), jobs)| Note { kind, engine, text, jobs }).collect()
}

/// The failure, approximation, notes and findings of one recording.
fn recording_notes(recording: &Recording) -> Vec<(Kind, &ReadingKey, String)> {
    let key = &recording.key;
    let mut found = vec![];
    found.extend(recording.failure.iter().map(|text| (Kind::Failed, key, text.clone())));
    found.extend(recording.approximation.iter().map(|text| (Kind::Approximate, key, text.clone())));
    for note in &recording.notes {
        // A note that the approximation already contains is not repeated.
        let is_repeated = recording.approximation.as_ref().is_some_and(|text| text.contains(note.as_str()));
        if !is_repeated {
            found.push((Kind::Note, key, note.clone()));
        }
    }
    let findings = recording.stated_errors.iter().filter(|s| s.finding.is_some());
    found.extend(findings.map(|s| (Kind::Finding, key, s.to_string())));
    found
}

pub(super) const fn kind(skip: &Skip) -> Kind {
    if skip.scope.leaves_no_reading() { Kind::Skipped } else { Kind::Shortcut }
}

pub(super) fn reason(skip: &Skip) -> String {
    let saved = skip.saved.as_ref().map(|s| format!(" (saves {s})")).unwrap_or_default();
    format!("{}{saved}", skip.reason)
}

/// Describes a known deviation that excuses nothing; `None` where it does.
fn describe_idle(known: &KnownDeviationOutcome) -> Option<String> {
    let (entry, percent) = (&known.entry, 100.0 * known.entry.expected);
    let at = entry.meter.clone().map(|glob| format!(" at {}", String::from(glob))).unwrap_or_default();
    let what = match known.state {
        State::Seen => return None,
        State::NotSeen => "is not seen".to_owned(),
        State::Expired => entry.expires.as_ref().map(|last| format!("has expired on {last}"))?,
    };
    Some(format!("the known deviation of {percent:+.2} %{at} {what}: {}", entry.summary()))
}

/// A line for each group of luminaires with its model and the reason; the cases that share a line are named behind it.
pub(super) fn luminaire_models(report: &Report) -> Vec<String> {
    let mut lines: Vec<(String, Vec<&str>)> = vec![];
    for case in &report.cases {
        for line in case.luminaire_models.iter().map(ToString::to_string) {
            match lines.iter_mut().find(|(known, _)| *known == line) {
                Some((_, cases)) => cases.push(&case.name),
                None => lines.push((line, vec![&case.name])),
            }
        }
    }
    let is_of_every_case = |cases: &[&str]| cases.len() == report.asked();
    let describe = |(line, cases): (String, Vec<&str>)| match cases.len() {
        _ if is_of_every_case(&cases) => line,
        1..=LISTED_CASES => format!("{line} ({})", cases.join(", ")),
        n => format!("{line} ({n} cases)"),
    };
    lines.into_iter().map(describe).collect()
}

/// Valid but suspicious input of the specs.
pub(super) fn lints(report: &Report) -> Vec<String> {
    report.lints.iter().map(ToString::to_string).collect()
}

/// The mean deviation of each engine in a procedure, also where everything passes.
pub(super) fn biases(report: &Report, procedure: ProcedureId) -> Vec<String> {
    report.bias.iter().filter(|b| b.key.procedure == procedure).map(|b| describe_bias(report, b)).collect()
}

fn describe_bias(report: &Report, bias: &Bias) -> String {
    let case = report.of_suite(&bias.key.case, ": ");
    format!("{case}{} against {}: {bias}", bias.key.engine, bias.basis.name())
}

/// The statistics of sets that are too large to be listed.
pub(super) fn large_sets(report: &Report, procedure: ProcedureId) -> impl Iterator<Item = &Statistics> {
    report.statistics.iter().filter(move |s| s.key.procedure == procedure && s.meters > LISTED_METERS)
}

/// How the figures of an engine agree with those of its reference; `None` where they are not judged.
///
/// For example `radiance against simulator: mean +0.12 ± 0.31 % pass, ...`.
pub(super) fn agreement(s: &Statistics) -> Option<String> {
    let agreement = s.agreement.as_ref()?;
    let figures = agreement.figures().map(|(name, figure)| format!("{name} {}", describe_deviation(figure))).join(", ");
    Some(format!("{} against {}: {figures}", s.key.engine, agreement.basis.name()))
}

/// A figure's deviation with its interval and verdict, relative where its reference is not zero.
fn describe_deviation(of: &FigureAgreement) -> String {
    let size = of.relative().map_or_else(
        || format!("off by {} ± {}", significant(of.deviation), significant(of.expanded)),
        |relative| interval_in_percent(relative, of.expanded / of.reference.value.abs()),
    );
    format!("{size} {}", of.verdict.name())
}

/// A line for each large set and engine with judged figures.
pub(super) fn agreements(report: &Report, procedure: ProcedureId) -> Vec<String> {
    let mut lines = vec![];
    for s in large_sets(report, procedure) {
        if let Some(agreement) = agreement(s) {
            let case = report.of_suite(&s.key.case, ": ");
            lines.push(format!("{case}{} ({} meters), {agreement}", s.set, s.meters));
        }
    }
    lines
}

/// A line for each compared pair of cases, procedure, set and engine.
///
/// It has the ratio of means, its agreement with the reference, and the verdicts of the meters.
pub(super) fn ratios(report: &Report) -> Vec<String> {
    report.ratios.iter().map(describe_ratios).collect()
}

fn describe_ratios(r: &Ratios) -> String {
    let place = format!("{} / {} {} {}", r.after, r.before, r.procedure, r.set);
    let mean = r.mean.ratio.as_ref().map_or("-".to_owned(), estimate);
    let judged = r.mean.agreement.as_ref().map(|agreement| {
        let against = r.basis.map(|basis| format!(" against {}", basis.name())).unwrap_or_default();
        format!("{against} {}", describe_deviation(agreement))
    });
    format!(
        "{place}, {}: {mean}{}{}; {}",
        r.engine,
        judged.unwrap_or_default(),
        describe_cancelling(r),
        describe_verdicts(r)
    )
}

/// At how many meters only the flux was changed, so that errors of both cases cancel.
fn describe_cancelling(r: &Ratios) -> String {
    let cancelling = r.meters.iter().filter(|m| m.of.errors_cancel).count();
    match cancelling {
        0 => String::new(),
        n if n < r.meters.len() => {
            format!(" (flux alone was changed: errors cancel at {n} of {} meters)", r.meters.len())
        }
        _ => " (flux alone was changed: errors cancel)".to_owned(),
    }
}

/// How many meters have each verdict, or how many there are if none is judged.
fn describe_verdicts(r: &Ratios) -> String {
    let verdicts = r.meters.iter().filter_map(|m| Some(m.of.agreement.as_ref()?.verdict)).counts();
    if verdicts.is_empty() {
        return plural(r.meters.len(), "meter");
    }
    let counts = verdicts.into_iter().sorted().map(|(verdict, count)| format!("{count} {}", verdict.name()));
    format!("meters: {}", counts.collect::<Vec<_>>().join(", "))
}

/// What verdicts claim and how often they are wrong.
pub(super) fn decision_rules(report: &Report) -> BTreeSet<&str> {
    report.cases.iter().map(|c| c.decision_rule.as_str()).filter(|rule| !rule.is_empty()).collect()
}

/// The unreliable parts of published tables: a line for the cells of each table, and one for each row and total.
pub(super) fn tables(report: &Report) -> Vec<String> {
    let cells = report.published.iter().filter(|table| !table.misfits.is_empty()).map(describe_misfits);
    cells.chain(report.published_findings.iter().cloned()).collect()
}

fn describe_misfits(table: &PublishedTable) -> String {
    let cells: Vec<String> = table.misfits.iter().map(describe_misfit).collect();
    let verb = if cells.len() == 1 { "does" } else { "do" };
    let count = plural(cells.len(), "printed cell");
    format!("{}: {count} {verb} not fit the table: {}", table.name, cells.join(", "))
}

fn describe_misfit(m: &Misfit) -> String {
    format!("{} {} of row {}", m.column, m.printed, m.row + 1)
}

/// The policies that judged, a line each.
pub(super) fn policies(report: &Report) -> Vec<String> {
    report.policies().into_iter().map(describe_policy).collect()
}

fn describe_policy(p: &PolicyRecord) -> String {
    let profile = p.profile.as_ref().map(|name| format!(", profile {name}")).unwrap_or_default();
    let digits: String = p.sha256.chars().take(CHECKSUM_DIGITS).collect();
    format!("policy {}{profile} (SHA-256 {digits}…)", p.file)
}

/// Engines that a policy requires and that have no reading.
pub(super) fn lacking(report: &Report) -> Vec<String> {
    let lacking = report.lacking().into_iter();
    lacking
        .map(|(policy, engine)| {
            format!("REQUIRED by {} and without any reading: {}", policy.file, Quoted(engine.as_str()))
        })
        .collect()
}

impl Note<'_> {
    /// The note in one line: `skipped: radiance indirect_illuminance of 3 cases: it is not installed`.
    pub(super) fn line(&self, report: &Report) -> String {
        let who = if *self.engine == EVERYONE { String::new() } else { format!("{} ", self.engine) };
        let text = self.text.lines().next().unwrap_or_default();
        format!("{}: {who}{}: {text}", self.kind, self.describe_jobs(report))
    }

    /// Its procedures, and in a suite its case or the number of cases.
    fn describe_jobs(&self, report: &Report) -> String {
        let cases: BTreeSet<&str> = self.jobs.iter().map(|(case, _)| *case).collect();
        let procedures: BTreeSet<&str> = self.jobs.iter().map(|(_, procedure)| procedure.name()).collect();
        let procedures = Vec::from_iter(procedures).join(", ");
        match Vec::from_iter(cases)[..] {
            [case] if report.is_suite() => format!("{procedures} of {case}"),
            [_] => procedures,
            ref all => format!("{procedures} of {} cases", all.len()),
        }
    }
}

/// A line for each case and procedure in which engines differ by more than their tolerances.
///
/// Two engines cannot show which of them is wrong, so their line is only shown where a comparison fails.
pub(super) fn departures(report: &Report) -> Vec<String> {
    let differing =
        report.consensus.iter().filter(|c| c.differing > 0 && (c.independent > 2 || has_failure(report, c)));
    differing.map(|c| format!("{}{}: {}", report.of_suite(&c.case, " "), c.procedure, c.text)).collect()
}

/// Whether a comparison fails in the case and the procedure of a consensus.
fn has_failure(report: &Report, consensus: &Consensus) -> bool {
    let mut of_job =
        report.comparisons.iter().filter(|c| c.key.case == consensus.case && c.key.procedure == consensus.procedure);
    of_job.any(|c| c.verdict == Verdict::Fail)
}

/// A line for each engine that the time limit cut short: its values may differ in another run.
pub(super) fn time_limits(report: &Report) -> Vec<String> {
    let mut cut: BTreeMap<&EngineName, Vec<&Recording>> = BTreeMap::new();
    for recording in report.recordings.iter().filter(|r| r.cut_to.is_some()) {
        cut.entry(&recording.key.engine).or_default().push(recording);
    }
    cut.into_iter().map(|(engine, recordings)| describe_time_limit(engine, &recordings)).collect()
}

/// `time limit: mitsuba, total_illuminance: 35 s of work took 233 s, ...`.
fn describe_time_limit(engine: &EngineName, recordings: &[&Recording]) -> String {
    let procedures: BTreeSet<&str> = recordings.iter().map(|r| r.key.procedure.name()).collect();
    let (work_s, wall_s) =
        recordings.iter().fold((0.0, 0.0), |(work_s, wall_s), r| (work_s + r.work_s(), wall_s + r.wall_s));
    format!(
        "time limit: {engine}, {}: {work_s:.0} s of work took {wall_s:.0} s, because the machine was busy; another run may read otherwise",
        Vec::from_iter(procedures).join(", ")
    )
}

/// Which points of each engine and procedure are undecided, what the widest interval needs, and what to do next.
pub(super) fn undecided(report: &Report) -> Vec<String> {
    let mut jobs: BTreeMap<(&EngineName, ProcedureId), Vec<&Comparison>> = BTreeMap::new();
    for c in report.comparisons.iter().filter(|c| c.verdict == Verdict::Undecided) {
        jobs.entry((&c.key.engine, c.key.procedure)).or_default().push(c);
    }
    let mut lines: Vec<String> = jobs.iter().map(|(job, comparisons)| describe_undecided(*job, comparisons)).collect();
    if !lines.is_empty() {
        let cut: BTreeSet<(&EngineName, ProcedureId)> =
            report.recordings.iter().filter(|r| r.cut_to.is_some()).map(|r| (&r.key.engine, r.key.procedure)).collect();
        let next =
            if jobs.keys().all(|job| cut.contains(job)) { NEXT_STEP_AFTER_TIME_LIMIT } else { UNDECIDED_NEXT_STEP };
        lines.push(next.to_owned());
    }
    lines
}

fn describe_undecided((engine, procedure): (&EngineName, ProcedureId), comparisons: &[&Comparison]) -> String {
    let widest = comparisons.iter().max_by(|a, b| interval_over_tolerance(a).total_cmp(&interval_over_tolerance(b)));
    let why = widest.and_then(|c| c.diagnosis.as_deref()).map(|why| format!(": {why}")).unwrap_or_default();
    format!("{engine} {procedure}, {}{why}", plural(comparisons.len(), "comparison"))
}

/// The half width of the interval over the tolerance.
fn interval_over_tolerance(c: &Comparison) -> f64 {
    c.budget.as_ref().map_or(f64::INFINITY, |budget| budget.expanded / c.allowed().max(f64::MIN_POSITIVE))
}

/// What explains failures, each cause once: the engine, the number of jobs and the cause.
pub(super) fn diagnoses(report: &Report) -> Vec<String> {
    let mut causes: BTreeMap<(&EngineName, &str), BTreeSet<Job<'_>>> = BTreeMap::new();
    for c in report.comparisons.iter().filter(|c| c.verdict == Verdict::Fail) {
        let Some(why) = &c.diagnosis else { continue };
        causes.entry((&c.key.engine, why)).or_default().insert((&c.key.case, c.key.procedure));
    }
    let causes = causes.into_iter();
    let causes = causes.map(|((engine, why), jobs)| format!("{engine} in {}: {why}", plural(jobs.len(), "procedure")));
    let biases = report.failed_biases().map(|bias| {
        let case = report.of_suite(&bias.key.case, " ");
        format!("{} in {case}{}: fails by its bias, {bias}", bias.key.engine, bias.key.procedure)
    });
    causes.chain(biases).chain(failed_claims(report)).collect()
}

/// What engines state of their errors and repetition refutes, each claim once.
fn failed_claims(report: &Report) -> impl Iterator<Item = String> {
    let claims = report.failed_claims().map(|(r, stated)| format!("{}: a claim fails: {stated}", r.key.engine));
    claims.collect::<BTreeSet<String>>().into_iter()
}

/// The widest split of each case, procedure and engine, in their order, with the place where it was read.
pub(super) fn splits(report: &Report) -> Vec<(String, &str)> {
    let mut widest: Vec<&Split> = vec![];
    let mut places = BTreeMap::new();
    for split in &report.splits {
        let at = *places.entry((&split.case, split.procedure, &split.engine)).or_insert(widest.len());
        match widest.get_mut(at) {
            Some(found) if found.whole.abs() < split.whole.abs() => *found = split,
            Some(_) => {}
            None => widest.push(split),
        }
    }
    widest.into_iter().map(|s| (split_place(report, s), s.text.as_str())).collect()
}

fn split_place(report: &Report, s: &Split) -> String {
    format!("{}{} {}", report.of_suite(&s.case, " "), s.procedure, s.meter)
}
