//! What every view tells besides verdicts: what failed, was skipped, follows by a shortcut or is approximate; who departs; whose a
//! deviation is.

use std::collections::{BTreeMap, BTreeSet};

use itertools::Itertools as _;

use super::Report;
use super::words::{estimate, interval_in_percent, plural, significant};
use crate::judge::{Bias, FigureAgreement, Misfit, OnRecord, PolicyRecord, Ratios, Split, State, Statistics, Verdict};
use crate::plan::{EVERYONE, Skip};
use crate::record::{EngineName, ProcedureId, ReadingKey};

/// More meters than this are summarised instead of listed.
pub(super) const LISTED_METERS: usize = 8;

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, strum::Display)]
#[strum(serialize_all = "snake_case")]
pub(super) enum Kind {
    Failed,
    /// What is wrong with how an engine states its errors.
    Finding,
    /// A known deviation that is on record and excuses nothing here.
    Record,
    /// Not run: there is no reading.
    Skipped,
    /// Read with less work: meters that follow from others, light paths that carry nothing.
    Shortcut,
    Approximate,
    Note,
}

/// What holds of one engine in some jobs.
pub(super) struct Note<'a> {
    pub(super) kind: Kind,
    pub(super) engine: &'a EngineName,
    pub(super) text: String,
    pub(super) jobs: BTreeSet<Job<'a>>,
}

/// A case and a procedure.
type Job<'a> = (&'a str, ProcedureId);

/// Each once, whatever number of jobs it holds of; by kind, then by engine.
pub(super) fn notes(report: &Report) -> Vec<Note<'_>> {
    let mut notes: BTreeMap<_, BTreeSet<Job<'_>>> = BTreeMap::new();
    let on_record = report.known_deviations.iter().filter_map(|k| Some((Kind::Record, &k.key, idle(k)?)));
    let skipped = report.skips.iter().map(|s| (kind(s), &s.key, reason(s)));
    for (kind, key, text) in recorded(report).chain(on_record).chain(skipped) {
        notes.entry((kind, &key.engine, text)).or_default().insert((&key.case, key.procedure));
    }
    notes.into_iter().map(|((kind, engine, text), jobs)| Note { kind, engine, text, jobs }).collect()
}

fn recorded(report: &Report) -> impl Iterator<Item = (Kind, &ReadingKey, String)> {
    report.recordings.iter().flat_map(|r| {
        // What the approximation says already need not be said again.
        let said = |note: &&String| r.approximation.as_ref().is_some_and(|a| a.contains(note.as_str()));
        let approximate = r.approximation.iter().map(|a| (Kind::Approximate, a));
        let noted = r.notes.iter().filter(move |n| !said(n)).map(|n| (Kind::Note, n));
        let failed = r.failure.iter().map(|f| (Kind::Failed, f));
        let doubts =
            r.stated_errors.iter().filter(|s| s.doubt.is_some()).map(|s| (Kind::Finding, &r.key, s.to_string()));
        failed.chain(approximate).chain(noted).map(|(kind, text)| (kind, &r.key, text.clone())).chain(doubts)
    })
}

pub(super) const fn kind(skip: &Skip) -> Kind {
    if skip.scope.leaves_no_reading() { Kind::Skipped } else { Kind::Shortcut }
}

pub(super) fn reason(skip: &Skip) -> String {
    let saved = skip.saved.as_ref().map(|s| format!(" (saves {s})")).unwrap_or_default();
    format!("{}{saved}", skip.reason)
}

/// What is to be said of a known deviation that excuses nothing; nothing where it does.
fn idle(known: &OnRecord) -> Option<String> {
    let (entry, percent) = (&known.entry, 100.0 * known.entry.expected);
    let at = entry.meter.clone().map(|glob| format!(" at {}", String::from(glob))).unwrap_or_default();
    let what = match known.state {
        State::Seen => return None,
        State::NotSeen => "is not seen".to_owned(),
        State::Expired => entry.expires.as_ref().map(|last| format!("has expired on {last}"))?,
    };
    Some(format!("the known deviation of {percent:+.2} %{at} {what}: {}", entry.told()))
}

/// The mean deviation of each engine in a procedure, told even where everything passes.
pub(super) fn biases(report: &Report, procedure: ProcedureId) -> Vec<String> {
    let line =
        |b: &Bias| format!("{}{} against {}: {b}", report.of_suite(&b.key.case, ": "), b.key.engine, b.basis.name());
    report.bias.iter().filter(|b| b.key.procedure == procedure).map(line).collect()
}

/// What sets come to that are too large to be listed.
pub(super) fn large_sets(report: &Report, procedure: ProcedureId) -> impl Iterator<Item = &Statistics> {
    report.statistics.iter().filter(move |s| s.key.procedure == procedure && s.meters > LISTED_METERS)
}

/// How the figures of an engine agree with those of its reference: `radiance against simulator: mean +0.12 +- 0.31 % pass, ...`; nothing
/// where they are not judged.
pub(super) fn agreement(s: &Statistics) -> Option<String> {
    let agreement = s.agreement.as_ref()?;
    let figures = agreement.figures().map(|(name, figure)| format!("{name} {}", deviation(figure))).join(", ");
    Some(format!("{} against {}: {figures}", s.key.engine, agreement.basis.name()))
}

/// Relative where there is anything to be relative to, with its interval and what that comes to.
fn deviation(of: &FigureAgreement) -> String {
    let size = of.relative().map_or_else(
        || format!("off by {} +- {}", significant(of.deviation), significant(of.expanded)),
        |relative| interval_in_percent(relative, of.expanded / of.reference.value.abs()),
    );
    format!("{size} {}", of.verdict.name())
}

/// A line for each large set and engine whose figures are judged.
pub(super) fn agreements(report: &Report, procedure: ProcedureId) -> Vec<String> {
    let line = |s: &Statistics| {
        let place = format!("{}{} ({} meters)", report.of_suite(&s.key.case, ": "), s.set, s.meters);
        Some(format!("{place}, {}", agreement(s)?))
    };
    large_sets(report, procedure).filter_map(line).collect()
}

/// A line for each pair of cases that is compared, procedure, set and engine: the ratio of means, how it agrees, and the meters' verdicts.
pub(super) fn ratios(report: &Report) -> Vec<String> {
    let line = |r: &Ratios| {
        let mean = r.mean.ratio.as_ref().map_or("-".to_owned(), estimate);
        let one = r.meters.iter().filter(|m| m.of.cancels).count();
        let of = if one < r.meters.len() { format!(" at {one} of {} meters", r.meters.len()) } else { String::new() };
        let cancels = if one > 0 { format!(" (flux alone was changed: errors cancel{of})") } else { String::new() };
        let against = r.basis.map(|basis| format!(" against {}", basis.name())).unwrap_or_default();
        let judged = r.mean.agreement.as_ref().map(|a| format!("{against} {}", deviation(a))).unwrap_or_default();
        let verdicts = r.meters.iter().filter_map(|m| Some(m.of.agreement.as_ref()?.verdict)).counts();
        let counts =
            verdicts.into_iter().sorted().map(|(verdict, count)| format!("{count} {}", verdict.name())).join(", ");
        let counts = if counts.is_empty() { plural(r.meters.len(), "meter") } else { format!("meters: {counts}") };
        let place = format!("{} / {} {} {}", r.after, r.before, r.procedure, r.set);
        format!("{place}, {}: {mean}{judged}{cancels}; {counts}", r.engine)
    };
    report.ratios.iter().map(line).collect()
}

/// What verdicts are for and how often they are wrong.
pub(super) fn decision_rules(report: &Report) -> BTreeSet<&str> {
    report.cases.iter().map(|c| c.decision_rule.as_str()).filter(|rule| !rule.is_empty()).collect()
}

/// What of published tables is not to be relied on: a line for the cells of each, and one for each row and total.
pub(super) fn tables(report: &Report) -> Vec<String> {
    let cells = report.published.iter().filter(|table| !table.misfits.is_empty()).map(|table| {
        let cell = |m: &Misfit| format!("{} {} of row {}", m.column, m.printed, m.row + 1);
        let cells = table.misfits.iter().map(cell).collect::<Vec<_>>().join(", ");
        format!("{}: {} not fit the table: {cells}", table.name, count_do(table.misfits.len()))
    });
    cells.chain(report.published_findings.iter().cloned()).collect()
}

fn count_do(cells: usize) -> String {
    format!("{} {}", plural(cells, "printed cell"), if cells == 1 { "does" } else { "do" })
}

/// Which policy judged; nothing where there is none.
pub(super) fn policies(report: &Report) -> Vec<String> {
    let line = |p: &PolicyRecord| {
        let profile = p.profile.as_ref().map(|name| format!(", profile {name}")).unwrap_or_default();
        let digits: String = p.sha256.chars().take(12).collect();
        format!("policy {}{profile} (SHA-256 {digits}…)", p.file)
    };
    report.policies().into_iter().map(line).collect()
}

/// Engines that a policy requires in vain.
pub(super) fn lacking(report: &Report) -> Vec<String> {
    let line = |(policy, engine): (&PolicyRecord, &EngineName)| {
        format!("REQUIRED by {} and without any reading: {engine}", policy.file)
    };
    report.lacking().into_iter().map(line).collect()
}

impl Note<'_> {
    /// In one line: `skipped: radiance indirect_illuminance of 3 cases: it is not installed`.
    pub(super) fn line(&self, report: &Report) -> String {
        let who = if *self.engine == EVERYONE { String::new() } else { format!("{} ", self.engine) };
        let text = self.text.lines().next().unwrap_or_default();
        format!("{}: {who}{}: {text}", self.kind, self.place(report))
    }

    fn place(&self, report: &Report) -> String {
        let cases: BTreeSet<&str> = self.jobs.iter().map(|(case, _)| *case).collect();
        let procedures: BTreeSet<&str> = self.jobs.iter().map(|(_, procedure)| procedure.name()).collect();
        let procedures = Vec::from_iter(procedures).join(", ");
        match Vec::from_iter(cases)[..] {
            [one] if report.is_suite() => format!("{procedures} of {one}"),
            [_] => procedures,
            ref all => format!("{procedures} of {} cases", all.len()),
        }
    }
}

/// A line for each case and procedure whose witnesses differ by more than their tolerances.
pub(super) fn departures(report: &Report) -> Vec<String> {
    let differing = report.consensus.iter().filter(|c| c.differing > 0);
    differing.map(|c| format!("{}{}: {}", report.of_suite(&c.case, " "), c.procedure, c.text)).collect()
}

/// What explains failures, each cause once: who, how many procedures of how many cases, and why.
pub(super) fn diagnoses(report: &Report) -> Vec<String> {
    let mut causes: BTreeMap<(&EngineName, &str), BTreeSet<Job<'_>>> = BTreeMap::new();
    for c in report.comparisons.iter().filter(|c| c.verdict == Verdict::Fail) {
        let Some(why) = &c.diagnosis else { continue };
        causes.entry((&c.key.engine, why)).or_default().insert((&c.key.case, c.key.procedure));
    }
    let line = |((engine, why), jobs): (&(&EngineName, &str), &BTreeSet<Job<'_>>)| {
        format!("{engine} in {}: {why}", plural(jobs.len(), "procedure"))
    };
    causes.iter().map(line).collect()
}

/// The widest split of each case, procedure and engine, in their order: where it was read, and what it says.
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
    let place = |s: &Split| format!("{}{} {}", report.of_suite(&s.case, " "), s.procedure, s.meter);
    widest.into_iter().map(|s| (place(s), s.text.as_str())).collect()
}
