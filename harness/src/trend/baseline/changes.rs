//! What changed between two sets of readings: a mean shift told apart from noise, single meters by their own z.
//!
//! Per engine and procedure the weighted mean of the relative changes is tested (weights 1/u²; the uncertainty widened by the
//! Birge ratio where meters scatter more than they say: Birge, Phys. Rev. 40 (1932) 207), then every meter. All tests
//! of a comparison together are wrong once in a hundred times where nothing changed (Šidák, JASA 62 (1967) 626); half of that is
//! for the means, which are few. Standard errors from few blocks have Student's t with the degrees of freedom of Welch and
//! Satterthwaite (GUM G.4.1); a mean has those of all its meters together, and a variance that is larger by what its weights are
//! uncertain by (Meier, Variance of a weighted mean, Biometrics 9 (1953) 59).

use std::collections::{BTreeSet, HashMap};
use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Entry;
use crate::judge::{SINGLE_PRECISION, WeightedMean, two_sided};
use crate::record::{MeterId, Quantity, Reading, ReadingKey, Uncertainty};

/// Probability that anything at all is called changed where nothing is.
const FAMILY: f64 = 0.01;
/// The part of it that the means have among them.
const SHARE_OF_MEANS: f64 = 0.5;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Comparability {
    /// A baseline: spec, version, luminaire model, light and settings.
    SameInstrument,
    /// Two runs: the spec; versions and settings may differ, which is said.
    SameSpec,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Changes {
    pub entries: Vec<EntryChange>,
    /// Of single meters.
    pub tests: usize,
    /// The level of each, so that all together keep theirs.
    pub level: f64,
    /// That of each mean.
    pub level_of_means: f64,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct EntryChange {
    #[serde(flatten)]
    pub key: ReadingKey,
    pub state: State,
    /// What differs besides the readings, or why they are not compared.
    pub notes: Vec<String>,
    pub mean: Option<MeanShift>,
    pub meters: Vec<MeterChange>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum State {
    Unchanged,
    /// All meters together moved.
    Shifted,
    /// Single meters moved.
    Changed,
    /// The new side lacks it, or lacks meters of it.
    Vanished,
    /// There is nothing to hold it against, or nothing for some of its meters.
    New,
    /// The two are not about the same thing.
    Refused,
}

/// The weighted mean of the relative changes, `+0.3000 % +- 0.1000 % (+3.0 u)`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MeanShift {
    pub relative: f64,
    /// Standard.
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
    /// Standard uncertainty of the change, likewise; zero where both are exact.
    pub uncertainty: f64,
    /// Of that uncertainty, where it is estimated from few samples.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub degrees_of_freedom: Option<f64>,
    pub p_value: f64,
    pub significant: bool,
}

impl fmt::Display for MeanShift {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (relative, uncertainty) = (100.0 * self.relative, 100.0 * self.uncertainty);
        write!(f, "{relative:+.4} % +- {uncertainty:.4} % ({:+.1} u)", self.relative / self.uncertainty)
    }
}

impl Changes {
    /// Whether nothing asks for attention; what is new on the new side alone does not.
    pub fn is_clean(&self) -> bool {
        self.entries.iter().all(|e| matches!(e.state, State::Unchanged | State::New))
    }
}

pub fn compare(old: &[Entry], new: &[Entry], comparability: Comparability) -> Changes {
    let of_old = old.iter().map(|a| match new.iter().find(|b| b.key == a.key) {
        None => bare(a, State::Vanished, vec!["there is no such run any more".to_owned()]),
        Some(b) => pair(a, b, comparability),
    });
    let added = new.iter().filter(|b| !old.iter().any(|a| a.key == b.key));
    let added = added.map(|b| bare(b, State::New, vec!["there is nothing to hold it against".to_owned()]));
    let mut entries: Vec<EntryChange> = of_old.chain(added).collect();
    let tests = entries.iter().map(|e| e.meters.len()).sum();
    let means = entries.iter().filter(|e| e.mean.is_some()).count();
    // 1 - (1 - family)^(1 / tests), without loss of digits.
    let each = |family: f64, tests: usize| -f64::exp_m1(f64::ln_1p(-family) / tests.max(1) as f64);
    let of_means = if means == 0 { 0.0 } else { SHARE_OF_MEANS * FAMILY };
    let (level, level_of_means) = (each(FAMILY - of_means, tests), each(of_means, means));
    for entry in &mut entries {
        decide(entry, level, level_of_means);
    }
    Changes { entries, tests, level, level_of_means }
}

fn decide(entry: &mut EntryChange, level: f64, level_of_means: f64) {
    for meter in &mut entry.meters {
        // A probability that is no number never counts as agreement.
        meter.significant = meter.p_value < level || meter.p_value.is_nan();
    }
    if matches!(entry.state, State::Unchanged | State::New) {
        if entry.mean.is_some_and(|m| m.p_value < level_of_means || m.p_value.is_nan()) {
            entry.state = State::Shifted;
        } else if entry.meters.iter().any(|m| m.significant) {
            entry.state = State::Changed;
        }
    }
}

fn bare(entry: &Entry, state: State, notes: Vec<String>) -> EntryChange {
    EntryChange { key: entry.key.clone(), state, notes, mean: None, meters: vec![] }
}

fn pair(a: &Entry, b: &Entry, comparability: Comparability) -> EntryChange {
    let differing = |name: &str, x: &str, y: &str| (x != y).then(|| format!("{name}: {x} before, {y} now"));
    let of_subject = [
        differing("spec", &short(&a.input_sha256), &short(&b.input_sha256)),
        differing("luminaire model", &a.model, &b.model),
        differing("light", &a.light.to_string(), &b.light.to_string()),
    ];
    let mut notes: Vec<String> = of_subject.into_iter().flatten().collect();
    let is_other_subject = !notes.is_empty();
    notes.extend(differing("version", &a.version, &b.version));
    for key in a.method.keys().chain(b.method.keys()).collect::<BTreeSet<_>>() {
        let of = |entry: &Entry| entry.said(key).unwrap_or("not set").to_owned();
        notes.extend(differing(&format!("setting {key}"), &of(a), &of(b)));
    }
    if is_other_subject || (comparability == Comparability::SameInstrument && !notes.is_empty()) {
        return bare(a, State::Refused, notes);
    }
    let mut change = bare(a, State::Unchanged, notes);
    let [by_meter_before, by_meter_now] = [a, b].map(by_meter);
    for before in &a.readings {
        if let Some(now) = by_meter_now.get(&(&before.meter, before.quantity)) {
            change.meters.push(meter(before, now));
        } else {
            change.state = State::Vanished;
            change.notes.push(format!("{} is not read any more", before.meter));
        }
    }
    for now in b.readings.iter().filter(|now| !by_meter_before.contains_key(&(&now.meter, now.quantity))) {
        if change.state == State::Unchanged {
            change.state = State::New;
        }
        change.notes.push(format!("there is nothing to hold {} against", now.meter));
    }
    change.mean = mean(&change.meters);
    change
}

/// Readings by what they are of; of one that stands there twice the first.
fn by_meter(entry: &Entry) -> HashMap<(&MeterId, Quantity), &Reading> {
    entry.readings.iter().rev().map(|r| ((&r.meter, r.quantity), r)).collect()
}

fn short(hash: &str) -> String {
    hash.chars().take(12).collect()
}

fn meter(before: &Reading, now: &Reading) -> MeterChange {
    let change = now.value - before.value;
    let apart = Uncertainty::of_sum([(-1.0, before.uncertainty), (1.0, now.uncertainty)]);
    let combined = before.uncertainty.standard().hypot(now.uncertainty.standard());
    let rounding = SINGLE_PRECISION * before.value.abs().max(now.value.abs());
    let p_value = match change.abs() {
        _ if [before, now].iter().any(|r| r.uncertainty == Uncertainty::NotSeen) => 1.0,
        size if !(size.is_finite() && combined.is_finite()) => 0.0,
        size if size <= rounding => 1.0,
        _ if combined > 0.0 => two_sided(change / combined, apart.degrees_of_freedom()),
        _ => 0.0,
    };
    MeterChange {
        meter: before.meter.clone(),
        quantity: before.quantity,
        old: before.value,
        new: now.value,
        uncertainty: combined,
        degrees_of_freedom: apart.degrees_of_freedom(),
        p_value,
        significant: false,
    }
}

/// The weighted mean shift of the meters that are sampled; `None` where fewer than two are.
fn mean(meters: &[MeterChange]) -> Option<MeanShift> {
    let sampled: Vec<_> = meters
        .iter()
        .filter(|m| m.uncertainty > 0.0 && m.old > 0.0 && m.uncertainty.is_finite() && m.new.is_finite())
        .map(|m| ((m.new - m.old) / m.old, m.uncertainty / m.old, m.degrees_of_freedom))
        .collect();
    let mean = WeightedMean::of(&sampled)?;
    Some(MeanShift { relative: mean.value, uncertainty: mean.uncertainty, p_value: mean.p_value() })
}
