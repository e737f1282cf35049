//! Changes between two sets of readings: mean shifts and changes of single meters, distinguished from noise.
//!
//! For each engine and procedure the weighted mean of the relative changes is tested, and then every meter. The weights are 1/u². Where
//! meters scatter more than stated, the Birge ratio widens the uncertainty (Birge, Phys. Rev. 40 (1932) 207). All tests of a comparison
//! together are wrong once in a hundred times where nothing changed (Šidák, JASA 62 (1967) 626). Half of that is for the means, which
//! are few.
//!
//! Standard errors from few blocks have Student's t with the degrees of freedom of Welch and Satterthwaite (GUM G.4.1). A mean has
//! those of all its meters together. Its variance is larger because its weights are uncertain (Meier, Variance of a weighted mean,
//! Biometrics 9 (1953) 59).

use std::collections::{BTreeSet, HashMap, HashSet};
use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use strum::VariantArray;

use super::Entry;
use luxproof_model::{MeterId, Quantity, Reading, ReadingKey, Report, Uncertainty};
use luxproof_statistics::{SINGLE_PRECISION, WeightedMean, two_sided};

/// Probability that any change is found where nothing changed.
const FAMILY_P: f64 = 0.01;
/// The share of it for the means.
const SHARE_OF_MEANS: f64 = 0.5;
/// Digits of a checksum that a note shows.
const CHECKSUM_DIGITS: usize = 12;

/// The reference values of a run: they decide whether a change is an improvement.
#[derive(Clone, Debug, Default)]
pub struct References<'r>(pub(super) HashMap<(&'r ReadingKey, &'r MeterId, Quantity), Vec<f64>>);

impl<'r> References<'r> {
    /// The references of all comparisons of a report.
    pub fn of_report(report: &'r Report) -> Self {
        let mut references = Self::default();
        for c in &report.comparisons {
            let values = c.reference.iter().map(|reference| reference.value);
            references.0.entry((&c.key, &c.meter, c.quantity)).or_default().extend(values);
        }
        references
    }

    /// The references of a meter; none where there is nothing to compare with.
    fn at(&self, key: &ReadingKey, meter: &MeterChange) -> Vec<f64> {
        self.0.get(&(key, &meter.meter, meter.quantity)).cloned().unwrap_or_default()
    }
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Changes {
    pub entries: Vec<EntryChange>,
    /// Number of tests of single meters.
    pub tests: usize,
    /// The level of each test of a meter, so that all tests together have theirs.
    pub level: f64,
    /// The level of each test of a mean.
    pub level_of_means: f64,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct EntryChange {
    #[serde(flatten)]
    pub key: ReadingKey,
    pub state: State,
    /// Meters of one side alone, or why the two are not compared.
    pub notes: Vec<String>,
    /// Differences of version and settings.
    #[serde(default)]
    pub instrument: Vec<String>,
    pub mean: Option<MeanShift>,
    pub meters: Vec<MeterChange>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema, VariantArray)]
#[serde(rename_all = "snake_case")]
pub enum State {
    Unchanged,
    /// The mean moved, or several meters in the same direction.
    Shifted,
    /// One meter moved, or several in different directions.
    Changed,
    /// What moved is nearer to every reference than before.
    Improved,
    /// The new side lacks the entry, or meters of it.
    Vanished,
    /// The old side lacks the entry, or meters of it.
    New,
    /// The tasks are different.
    Refused,
}

impl State {
    /// Its name in every view; capitals need attention.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Unchanged => "unchanged",
            Self::Shifted => "SHIFTED",
            Self::Changed => "CHANGED",
            Self::Improved => "IMPROVED",
            Self::Vanished => "VANISHED",
            Self::New => "new",
            Self::Refused => "REFUSED",
        }
    }
}

/// The weighted mean of the relative changes, `+0.3000 % ± 0.1000 % (+3.0 u)`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MeanShift {
    pub relative: f64,
    /// Standard uncertainty.
    pub uncertainty: f64,
    pub p_value: f64,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MeterChange {
    pub meter: MeterId,
    pub quantity: Quantity,
    /// The old value, in the quantity's unit.
    pub old: f64,
    pub new: f64,
    /// Standard uncertainty of the change, likewise; zero where both values are exact.
    pub uncertainty: f64,
    /// Degrees of freedom of that uncertainty, where it is estimated from few samples.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub degrees_of_freedom: Option<f64>,
    pub p_value: f64,
    pub significant: bool,
}

impl fmt::Display for MeanShift {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (relative, uncertainty) = (100.0 * self.relative, 100.0 * self.uncertainty);
        let in_u = super::review::in_uncertainties(self.relative / self.uncertainty);
        write!(f, "{relative:+.4} % ± {uncertainty:.4} % ({in_u})")
    }
}

impl Changes {
    /// Whether nothing needs attention; entries that are only new do not.
    pub fn is_clean(&self) -> bool {
        self.entries.iter().all(|e| matches!(e.state, State::Unchanged | State::New))
    }
}

/// Compares two sets of readings, entry by entry.
///
/// Other versions and settings are compared and noted; another task is refused.
pub fn compare(old: &[Entry], new: &[Entry], references: &References<'_>) -> Changes {
    let mut entries = vec![];
    let known: HashSet<&ReadingKey> = old.iter().map(|before| &before.key).collect();
    // Of several of one key the first counts.
    let found: HashMap<&ReadingKey, &Entry> = new.iter().rev().map(|now| (&now.key, now)).collect();
    for before in old {
        entries.push(match found.get(&before.key) {
            Some(now) => compare_entry(before, now),
            None => EntryChange::without_meters(before, State::Vanished, vec!["this run no longer exists".to_owned()]),
        });
    }
    for now in new.iter().filter(|now| !known.contains(&now.key)) {
        let note = "no baseline yet: review the run with `luxproof accept`".to_owned();
        entries.push(EntryChange::without_meters(now, State::New, vec![note]));
    }
    let tests = entries.iter().map(|e| e.meters.len()).sum();
    let means = entries.iter().filter(|e| e.mean.is_some()).count();
    let family_of_means = if means == 0 { 0.0 } else { SHARE_OF_MEANS * FAMILY_P };
    let level = level_of_each(FAMILY_P - family_of_means, tests);
    let level_of_means = level_of_each(family_of_means, means);
    for entry in &mut entries {
        decide(entry, level, level_of_means, references);
    }
    Changes { entries, tests, level, level_of_means }
}

/// The level of each of so many tests that are wrong together with this probability: 1 - (1 - family)^(1 / tests).
fn level_of_each(family: f64, tests: usize) -> f64 {
    // In a form that loses no digits of small probabilities.
    -f64::exp_m1(f64::ln_1p(-family) / tests.max(1) as f64)
}

/// Decides which meters changed, whether the mean did, and in which way.
fn decide(entry: &mut EntryChange, level: f64, level_of_means: f64, references: &References<'_>) {
    for meter in &mut entry.meters {
        // NaN never counts as agreement.
        meter.significant = meter.p_value < level || meter.p_value.is_nan();
    }
    if matches!(entry.state, State::Unchanged | State::New) {
        let is_mean_moved = entry.mean.is_some_and(|m| m.p_value < level_of_means || m.p_value.is_nan());
        let moves: Vec<f64> = entry.meters.iter().filter(|m| m.significant).map(|m| m.new - m.old).collect();
        if !is_mean_moved && moves.is_empty() {
            return;
        }
        let is_one_direction = moves.iter().all(|by| *by > 0.0) || moves.iter().all(|by| *by < 0.0);
        entry.state = if entry.state == State::Unchanged && is_improved(entry, is_mean_moved, references) {
            State::Improved
        } else if is_mean_moved || (moves.len() > 1 && is_one_direction) {
            State::Shifted
        } else {
            State::Changed
        };
    }
}

/// Whether everything that moved came nearer to every reference.
fn is_improved(entry: &EntryChange, is_mean_moved: bool, references: &References<'_>) -> bool {
    // The sums of relative deviations from the references, before and now: their mean decides where the mean moved.
    let (mut before, mut now) = (0.0, 0.0);
    for meter in &entry.meters {
        let values = references.at(&entry.key, meter);
        let is_nearer = values.iter().all(|r| (meter.new - r).abs() < (meter.old - r).abs());
        if values.is_empty() || (meter.significant && !is_nearer) {
            return false;
        }
        for reference in values.iter().filter(|reference| **reference != 0.0) {
            before += (meter.old - reference) / reference;
            now += (meter.new - reference) / reference;
        }
    }
    !is_mean_moved || now.abs() < before.abs()
}

impl EntryChange {
    /// An entry without compared readings.
    fn without_meters(entry: &Entry, state: State, notes: Vec<String>) -> Self {
        Self { key: entry.key.clone(), state, notes, instrument: vec![], mean: None, meters: vec![] }
    }
}

/// A note on a property that differs; `None` where both sides agree.
fn describe_difference(name: &str, before: &str, now: &str) -> Option<String> {
    (before != now).then(|| format!("{name}: {before} before, {now} now"))
}

/// The differences of the tasks, which make two entries incomparable.
fn task_differences(before: &Entry, now: &Entry) -> Vec<String> {
    let differences = [
        describe_difference("task", &short(&before.content_sha256), &short(&now.content_sha256)),
        describe_difference("luminaire model", &before.model, &now.model),
        describe_difference("light", &before.light.to_string(), &now.light.to_string()),
    ];
    differences.into_iter().flatten().collect()
}

/// The differences of version and settings.
fn instrument_differences(before: &Entry, now: &Entry) -> Vec<String> {
    let mut differences = vec![];
    differences.extend(describe_difference("version", &before.version, &now.version));
    for key in before.method.keys().chain(now.method.keys()).collect::<BTreeSet<_>>() {
        let [old, new] = [before, now].map(|entry| entry.setting(key).unwrap_or("not set"));
        differences.extend(describe_difference(&format!("setting {key}"), old, new));
    }
    differences
}

fn compare_entry(before: &Entry, now: &Entry) -> EntryChange {
    let notes = task_differences(before, now);
    let state = if notes.is_empty() { State::Unchanged } else { State::Refused };
    let instrument = instrument_differences(before, now);
    let mut change = EntryChange { instrument, ..EntryChange::without_meters(before, state, notes) };
    if state == State::Refused {
        return change;
    }
    let [old_readings, new_readings] = [before, now].map(readings_by_meter);
    for old in &before.readings {
        if let Some(new) = new_readings.get(&(&old.meter, old.quantity)) {
            change.meters.push(compare_meter(old, new));
        } else {
            change.state = State::Vanished;
            change.notes.push(format!("{} is no longer read", old.meter));
        }
    }
    for new in now.readings.iter().filter(|new| !old_readings.contains_key(&(&new.meter, new.quantity))) {
        if change.state == State::Unchanged {
            change.state = State::New;
        }
        change.notes.push(format!("no baseline yet for {}: review the run with `luxproof accept`", new.meter));
    }
    change.mean = mean_shift(&change.meters);
    change
}

/// Readings by meter and quantity; the first of several.
fn readings_by_meter(entry: &Entry) -> HashMap<(&MeterId, Quantity), &Reading> {
    // In reverse order the first reading replaces the later ones.
    entry.readings.iter().rev().map(|r| ((&r.meter, r.quantity), r)).collect()
}

fn short(hash: &str) -> String {
    hash.chars().take(CHECKSUM_DIGITS).collect()
}

fn compare_meter(before: &Reading, now: &Reading) -> MeterChange {
    let change = now.value - before.value;
    let difference = Uncertainty::of_sum([(-1.0, before.uncertainty), (1.0, now.uncertainty)]);
    let combined = before.uncertainty.standard().hypot(now.uncertainty.standard());
    let rounding = SINGLE_PRECISION * before.value.abs().max(now.value.abs());
    let p_value = match change.abs() {
        _ if [before, now].iter().any(|r| r.uncertainty == Uncertainty::NotSeen) => 1.0,
        size if !(size.is_finite() && combined.is_finite()) => 0.0,
        size if size <= rounding => 1.0,
        _ if combined > 0.0 => two_sided(change / combined, difference.degrees_of_freedom()),
        _ => 0.0,
    };
    MeterChange {
        meter: before.meter.clone(),
        quantity: before.quantity,
        old: before.value,
        new: now.value,
        uncertainty: combined,
        degrees_of_freedom: difference.degrees_of_freedom(),
        p_value,
        significant: false,
    }
}

/// The weighted mean shift; `None` of fewer than two meters.
///
/// Where some meters are sampled, they alone count. Where none is, every meter counts with the rounding of single precision.
fn mean_shift(meters: &[MeterChange]) -> Option<MeanShift> {
    let is_sampled = meters.iter().any(|m| m.uncertainty > 0.0);
    let usable = meters.iter().filter(|m| m.old > 0.0 && m.new.is_finite() && m.uncertainty.is_finite());
    let counted = usable.filter(|m| m.uncertainty > 0.0 || !is_sampled);
    let values: Vec<_> = counted
        .map(|m| ((m.new - m.old) / m.old, (m.uncertainty / m.old).max(SINGLE_PRECISION), m.degrees_of_freedom))
        .collect();
    let mean = WeightedMean::of(&values)?;
    Some(MeanShift { relative: mean.value, uncertainty: mean.uncertainty, p_value: mean.p_value() })
}
