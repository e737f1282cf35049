//! Who is wrong: which of several independent witnesses departs from the others, the reference included.
//!
//! Each hypothesis says that one component departs: a witness's own code, or something that several witnesses share, which
//! then departs in all of them at once; or that none does. Readings are normal about an unknown truth (flat prior), with the
//! covariance that the hypothesis gives them; its probability follows by Bayes' rule (Kass & Raftery, J. Am. Statist. Assoc. 90,
//! 1995). So witnesses that share a component count once, and the reference has no privilege. Programs of users' whose readings
//! are closer to another's than independent work comes share something too, whatever they say, see `is_copy`.

use itertools::Itertools;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Component, Judge, Tolerance, of_reading};
use crate::engines::{self, FILE_READER};
use crate::procedures::Task;
use crate::record::{Basis, EngineName, ProcedureId, Reading, Recording, Uncertainty};

/// Independent witnesses that a statement takes.
const FEWEST: usize = 3;
/// Odds from which a departure is named: what is left is less than one in twenty.
const NAMED: f64 = 19.0;
/// Odds are told up to here: beyond, the assumptions are less sure than they are.
const HIGHEST_ODDS: f64 = 1e4;
/// Sound witnesses differ by a standard deviation of this share of their tolerance.
const ALLOWANCE: f64 = 1.0 / 3.0;
/// Of the variance by which sound witnesses differ, what two that share a component have in common.
const SHARED: f64 = 0.5;
/// A component that departs does so by up to this many times the reading.
const LARGEST_DEPARTURE: f64 = 10.0;
/// Independent readings that are off lie apart by a tenth of what they state of their chance; where they state none, by a tenth of the
/// tolerance, which no two programs with a fault each come to meet.
const CLOSE: f64 = 0.1;
/// How often chance may bring sampled readings that close.
const BY_CHANCE: f64 = 0.01;
/// Rounding of readings: keeps covariances regular where tolerance and uncertainty are zero.
const ROUNDING: f64 = 1e-12;

const ASSUMPTIONS: &str = "at most one component is wrong, each as likely beforehand as none; sound witnesses differ by a third \
                           of their tolerance (standard deviation); all meters of a procedure count as one; a departure may \
                           be of any size from the tolerance to ten times the reading, evenly in its logarithm";

/// What the witnesses of one procedure of a case say of each other.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Consensus {
    pub case: String,
    pub procedure: ProcedureId,
    pub witnesses: Vec<Witness>,
    /// How many of them are independent: those that share a component count once.
    pub independent: usize,
    /// Those that count once, together, and what ties them; one witness each where nothing does.
    #[serde(default)]
    pub groups: Vec<Group>,
    /// At how many meters any two differ by more than their tolerances.
    pub differing: usize,
    /// Who departs, where the odds are good enough to name them; several where it is what they share.
    pub departs: Vec<String>,
    /// What departs: a witness's own code, or what several share.
    pub component: Option<String>,
    /// Odds of that against everything else.
    pub odds: Option<f64>,
    /// The same as a sentence.
    pub text: String,
    /// What it assumes, and what it is blind to.
    pub assumptions: String,
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Group {
    pub witnesses: Vec<String>,
    pub share: Vec<String>,
}

impl std::fmt::Display for Group {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let why = if self.share.is_empty() { String::new() } else { format!(" ({})", self.share.join(", ")) };
        write!(f, "{}{why}", self.witnesses.join(" = "))
    }
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Witness {
    /// The engine, or where values were derived.
    pub name: String,
    /// Whether others are judged by it here.
    pub is_reference: bool,
    pub shares: Vec<String>,
    /// Its deviation from the others' weighted mean where they differ most, relative.
    pub deviation: Option<f64>,
    /// The probability that its own code departs.
    pub probability: f64,
}

struct WitnessReadings {
    name: String,
    /// Whether its program is none of ours: what it has in common with others is known from what it says and does only.
    is_users: bool,
    shares: Vec<String>,
    /// Value and standard uncertainty at each target.
    readings: Vec<Option<(f64, f64)>>,
    /// What its tolerance allows at each target, in the quantity's unit.
    allowed: Vec<f64>,
    /// Whether its uncertainty is chance, by which its readings scatter about those of others.
    is_sampled: bool,
}

impl WitnessReadings {
    fn new(name: &str, shares: Vec<String>, readings: Vec<Option<(f64, f64)>>, tolerance: Tolerance) -> Self {
        let around = |r: &Option<(f64, f64)>| r.map_or(0.0, |(value, _)| tolerance.around(value));
        let allowed = readings.iter().map(around).collect();
        Self { name: name.to_owned(), is_users: false, shares, allowed, readings, is_sampled: false }
    }

    /// Whether it has something that others name so: itself, too.
    fn has(&self, share: &str) -> bool {
        self.name == share || self.shares.iter().any(|s| s == share)
    }
}

/// Something that may be wrong, and which of the witnesses have it.
struct Hypothesis {
    name: String,
    holders: Vec<usize>,
}

impl Judge<'_> {
    /// Who of the engines departs from the others, the reference included; `recordings` as for [`Self::compare`]. `None` where
    /// nobody read anything.
    pub fn consensus(&self, task: &Task, recordings: &[&Recording]) -> Option<Consensus> {
        let case = recordings.first()?.key.case.clone();
        let mut witnesses = witnesses(self, task, recordings);
        if witnesses.is_empty() {
            return None;
        }
        let reference = task.reference();
        let reference = reference.engine();
        let telling: Vec<usize> = (0..task.targets.len()).filter(|k| differ(&witnesses, *k)).collect();
        tie_copies(&mut witnesses, reference.map(EngineName::as_str), &telling);
        let hypotheses = hypotheses(&witnesses);
        let groups = groups(&witnesses);
        let independent = groups.len();
        let probabilities = if telling.is_empty() || independent < FEWEST {
            vec![0.0; hypotheses.len()]
        } else {
            probabilities(&witnesses, &hypotheses, &telling)
        };
        let shown = witnesses.iter().enumerate().map(|(i, t)| Witness {
            name: t.name.clone(),
            is_reference: reference.is_some_and(|r| *r == t.name),
            shares: t.shares.clone(),
            deviation: deviation(&witnesses, i, &telling),
            probability: hypotheses.iter().zip(&probabilities).find(|(s, _)| s.name == t.name).map_or(0.0, |(_, p)| *p),
        });
        let mut found = Consensus {
            case,
            procedure: task.procedure,
            witnesses: shown.collect(),
            independent,
            groups,
            differing: telling.len(),
            departs: vec![],
            component: None,
            odds: None,
            text: String::new(),
            assumptions: assumptions(&witnesses),
        };
        found.text = told(&mut found, &hypotheses, &probabilities, &witnesses);
        Some(found)
    }
}

fn witnesses(judge: &Judge<'_>, task: &Task, recordings: &[&Recording]) -> Vec<WitnessReadings> {
    let reference = task.reference();
    let (reference, basis) = (reference.engine(), reference.basis());
    let tolerance = |engine: &str| judge.held_to(task, basis, engine).0;
    // The reference is as good as what the best of the others is held to.
    let strictest =
        recordings.iter().map(|r| tolerance(&r.key.engine)).min_by(|a, b| a.relative.total_cmp(&b.relative));
    let combined = |components: &[Component]| components.iter().map(|c| c.uncertainty.powi(2)).sum::<f64>().sqrt();
    let of_engine = |recording: &&Recording| {
        let allowed = if reference == Some(&recording.key.engine) {
            strictest.unwrap_or_default()
        } else {
            tolerance(&recording.key.engine)
        };
        let read = |k: usize| {
            let is_told = |r: &&Reading| r.value.is_finite() && r.uncertainty != Uncertainty::NotSeen;
            let reading = recording.reading(k, &task.targets[k].id).filter(is_told)?;
            Some((reading.value, combined(&of_reading(&reading.uncertainty))))
        };
        let readings = (0..task.targets.len()).map(read).collect();
        let is_chance = |r: &Reading| r.uncertainty.standard_error().is_some_and(|error| error > 0.0);
        WitnessReadings {
            is_users: engines::entry(&recording.key.engine).is_none(),
            is_sampled: recording.readings.iter().any(is_chance),
            ..WitnessReadings::new(&recording.key.engine, recording.components.clone(), readings, allowed)
        }
    };
    // A method that claims nothing here departs as it may, and would stand for the one component that is wrong.
    let claims = |r: &&&Recording| judge.tolerances.not_claimed(task.procedure, basis, &r.key.engine).is_none();
    let mut witnesses: Vec<WitnessReadings> =
        recordings.iter().filter(|r| !r.readings.is_empty()).filter(claims).map(of_engine).collect();
    witnesses.extend(derived(judge, task));
    witnesses
}

/// Values derived from a formula, where the case has any: they rest on none of our code.
fn derived(judge: &Judge<'_>, task: &Task) -> Option<WitnessReadings> {
    const NAME: &str = "derived values";
    let published = judge.published?;
    let read = |target| {
        let mut references = published.references(task, target, NAME, &[]).into_iter();
        references.find(|r| r.basis != Basis::Published).map(|r| (r.value, r.uncertainty))
    };
    let readings: Vec<_> = task.targets.iter().map(read).collect();
    let tolerance = judge.held_to(task, Basis::ClosedForm, NAME).0;
    readings.iter().any(Option::is_some).then(|| WitnessReadings::new(NAME, vec![], readings, tolerance))
}

/// Each witness's own code, and what some of them share but not all: what all share shifts nobody against another.
fn hypotheses(witnesses: &[WitnessReadings]) -> Vec<Hypothesis> {
    let own = witnesses.iter().enumerate().map(|(i, t)| Hypothesis { name: t.name.clone(), holders: vec![i] });
    let mut hypotheses: Vec<Hypothesis> = own.collect();
    for name in witnesses.iter().flat_map(|t| &t.shares) {
        let holders: Vec<usize> = (0..witnesses.len()).filter(|i| witnesses[*i].has(name)).collect();
        // What the same witnesses share besides is the same hypothesis: two of them would take each other's odds.
        if hypotheses.iter().all(|s| s.holders != holders) && holders.len() > 1 && holders.len() < witnesses.len() {
            hypotheses.push(Hypothesis { name: name.clone(), holders });
        }
    }
    hypotheses
}

/// What is left when witnesses that share something go together. The reader of photometric files, which nearly
/// all have, does not tie them: that it departs is a hypothesis of its own, or else a blind spot that is told.
fn groups(witnesses: &[WitnessReadings]) -> Vec<Group> {
    let all: Vec<&str> = witnesses.iter().flat_map(|w| &w.shares).map(String::as_str).unique().collect();
    let ties = all.into_iter().filter(|share| *share != FILE_READER);
    let ties = ties.map(|share| (share, (0..witnesses.len()).filter(|i| witnesses[*i].has(share)).collect_vec()));
    let ties: Vec<(&str, Vec<usize>)> = ties.filter(|(_, holders)| holders.len() > 1).collect();
    let mut group: Vec<usize> = (0..witnesses.len()).collect();
    for (_, holders) in &ties {
        let tied: Vec<usize> = holders.iter().map(|i| group[*i]).collect();
        group.iter_mut().filter(|g| tied.contains(g)).for_each(|g| *g = tied[0]);
    }
    let made = group.iter().unique().map(|of| {
        let members = || (0..witnesses.len()).filter(|i| group[*i] == *of);
        let share = ties.iter().filter(|(_, holders)| group[holders[0]] == *of).map(|(share, _)| (*share).to_owned());
        Group { witnesses: members().map(|i| witnesses[i].name.clone()).collect(), share: share.collect() }
    });
    made.collect()
}

/// Writes what copies have in common among what they share, as if they had said it.
fn tie_copies(witnesses: &mut [WitnessReadings], reference: Option<&str>, telling: &[usize]) {
    let reference = witnesses.iter().position(|w| reference == Some(&w.name));
    let are_one =
        |[i, j]: &[usize; 2]| is_copy([&witnesses[*i], &witnesses[*j]], reference.map(|r| &witnesses[r]), telling);
    let copies: Vec<[usize; 2]> = (0..witnesses.len()).array_combinations().filter(are_one).collect();
    // Each goes with the first of those that it is tied to, however many are between them.
    let mut first: Vec<usize> = (0..witnesses.len()).collect();
    for [i, j] in copies {
        let (to, from) = (first[i].min(first[j]), first[i].max(first[j]));
        first.iter_mut().filter(|of| **of == from).for_each(|of| *of = to);
    }
    for (k, to) in first.iter().enumerate().filter(|(_, to)| first.iter().filter(|of| of == to).count() > 1) {
        let share = format!("the readings of {}", witnesses[*to].name);
        witnesses[k].shares.push(share);
    }
}

/// Whether two witnesses, a program of a user's among them, read alike as only one program does: to the last digit at every
/// meter, or far closer than they state or any two need come, where both are off the reference. Where they agree with
/// it, the truth is reason enough.
fn is_copy(two: [&WitnessReadings; 2], reference: Option<&WitnessReadings>, telling: &[usize]) -> bool {
    let [a, b] = two;
    if !a.is_users && !b.is_users {
        return false;
    }
    let both = |k: usize| Some((a.readings[k]?, b.readings[k]?));
    let common = || (0..a.readings.len()).filter_map(both);
    let distinct = common().map(|((value, _), _)| value.to_bits()).filter(|bits| *bits != 0).unique().count();
    if distinct > 1 && common().all(|((one, _), (other, _))| one.to_bits() == other.to_bits()) {
        return true;
    }
    let is_off = |k: usize, w: &WitnessReadings, (value, _): (f64, f64)| {
        let held = reference.and_then(|r| Some((r.readings[k]?.0, r.allowed[k])));
        held.is_none_or(|(right, allowed)| (value - right).abs() > allowed.max(w.allowed[k]))
    };
    let off = telling.iter().filter_map(|k| both(*k).map(|two| (*k, two)));
    let off = off.filter(|(k, (one, other))| is_off(*k, a, *one) && is_off(*k, b, *other));
    let is_sampled = a.is_sampled || b.is_sampled;
    let squares: Vec<f64> = off
        .map(|(k, ((one, u), (other, v)))| {
            let scale = if is_sampled { u.hypot(v) } else { a.allowed[k].min(b.allowed[k]) };
            ((one - other) / scale.max(ROUNDING * one.abs())).powi(2)
        })
        .collect();
    let (n, mean) = (squares.len() as f64, squares.iter().sum::<f64>() / squares.len() as f64);
    // Chernoff's bound of what chance does to a mean of squares of normal values.
    let chance = (mean * (1.0 - mean).exp()).powf(0.5 * n);
    mean < CLOSE.powi(2) && (!is_sampled || chance < BY_CHANCE)
}

/// Whether any two witnesses are further apart at a target than the wider of their tolerances and twice their noise.
fn differ(witnesses: &[WitnessReadings], k: usize) -> bool {
    let at = |t: &WitnessReadings| t.readings[k].map(|(value, u)| (value, u, t.allowed[k]));
    let all: Vec<(f64, f64, f64)> = witnesses.iter().filter_map(at).collect();
    all.iter().enumerate().any(|(i, a)| {
        all[..i].iter().any(|b| (a.0 - b.0).abs() > a.2.max(b.2) + 2.0 * a.1.hypot(b.1) + ROUNDING * a.0.abs())
    })
}

/// The probability of each hypothesis; what is missing to one is that nobody departs.
fn probabilities(witnesses: &[WitnessReadings], hypotheses: &[Hypothesis], telling: &[usize]) -> Vec<f64> {
    let evidence = |hypothesis: Option<&Hypothesis>| -> f64 {
        let mean = |departure: Option<f64>| {
            let at = |k: &usize| log_likelihood(witnesses, hypotheses, hypothesis, departure, *k);
            telling.iter().map(at).sum::<f64>() / telling.len() as f64
        };
        let Some(_) = hypothesis else { return mean(None) };
        let smallest = telling.iter().map(|k| relative_allowance(witnesses, *k)).fold(f64::INFINITY, f64::min);
        let mut sizes = vec![smallest.clamp(1e-6, LARGEST_DEPARTURE)];
        while let Some(last) = sizes.last().copied().filter(|s| *s < LARGEST_DEPARTURE) {
            sizes.push(2.0 * last);
        }
        let logs: Vec<f64> = sizes.iter().map(|size| mean(Some(*size))).collect();
        log_of_sum(&logs) - (logs.len() as f64).ln()
    };
    let mut logs = vec![evidence(None)];
    logs.extend(hypotheses.iter().map(|s| evidence(Some(s))));
    let total = log_of_sum(&logs);
    // Readings so far apart that their evidence is no number speak for nobody.
    logs[1..].iter().map(|l| (l - total).exp()).map(|p| if p.is_finite() { p } else { 0.0 }).collect()
}

fn log_of_sum(logs: &[f64]) -> f64 {
    let largest = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    largest + logs.iter().map(|l| (l - largest).exp()).sum::<f64>().ln()
}

/// The smallest tolerance at a target, relative to the middle reading.
fn relative_allowance(witnesses: &[WitnessReadings], k: usize) -> f64 {
    let allowed = witnesses.iter().filter(|t| t.readings[k].is_some()).map(|t| t.allowed[k]);
    allowed.fold(f64::INFINITY, f64::min) / middle(witnesses, k)
}

/// The median of the readings at a target: a scale that one wrong witness does not move.
fn middle(witnesses: &[WitnessReadings], k: usize) -> f64 {
    let mut values: Vec<f64> = witnesses.iter().filter_map(|t| t.readings[k]).map(|(value, _)| value.abs()).collect();
    values.sort_by(f64::total_cmp);
    // Darkness has no scale of its own: the largest reading there is one.
    let largest = values.last().copied().unwrap_or(0.0);
    values.get(values.len() / 2).copied().filter(|m| *m > 0.0).unwrap_or(largest).max(f64::MIN_POSITIVE)
}

/// Logarithm of the likelihood of the readings at one target, the truth integrated out.
fn log_likelihood(
    witnesses: &[WitnessReadings],
    hypotheses: &[Hypothesis],
    departing: Option<&Hypothesis>,
    departure: Option<f64>,
    k: usize,
) -> f64 {
    let scale = middle(witnesses, k);
    let present: Vec<usize> = (0..witnesses.len()).filter(|i| witnesses[*i].readings[k].is_some()).collect();
    let values: Vec<f64> =
        present.iter().filter_map(|i| witnesses[*i].readings[k]).map(|(value, _)| value / scale - 1.0).collect();
    let covariance = |i: usize, j: usize| -> f64 {
        let (a, b) = (&witnesses[i], &witnesses[j]);
        let both = |s: &Hypothesis| s.holders.contains(&i) && s.holders.contains(&j);
        let mut sum = 0.0;
        if i == j {
            let noise = a.readings[k].map_or(0.0, |(_, u)| u);
            sum += (noise / scale).powi(2) + (ALLOWANCE * a.allowed[k] / scale).powi(2) + ROUNDING.powi(2);
        } else if hypotheses.iter().any(both) {
            sum += SHARED * (ALLOWANCE * a.allowed[k].min(b.allowed[k]) / scale).powi(2);
        }
        if departing.is_some_and(both) {
            sum += departure.unwrap_or(0.0).powi(2);
        }
        sum
    };
    let matrix: Vec<Vec<f64>> = present.iter().map(|i| present.iter().map(|j| covariance(*i, *j)).collect()).collect();
    gaussian(&matrix, &values).unwrap_or(f64::NEG_INFINITY)
}

/// Log-likelihood of normal values about a common unknown mean, which has a flat prior; by Cholesky's factors.
fn gaussian(matrix: &[Vec<f64>], values: &[f64]) -> Option<f64> {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    let (mut lower, mut ones, mut independent, mut log_determinant) = (Vec::<Vec<f64>>::new(), vec![], vec![], 0.0);
    for (i, value) in values.iter().enumerate() {
        let mut row = vec![];
        for (j, above) in lower.iter().enumerate() {
            row.push((matrix[i][j] - dot(&row, above)) / above[j]);
        }
        let diagonal = Some(matrix[i][i] - dot(&row, &row)).filter(|d| *d > 0.0)?.sqrt();
        log_determinant += 2.0 * diagonal.ln();
        ones.push((1.0 - dot(&row, &ones)) / diagonal);
        independent.push((value - dot(&row, &independent)) / diagonal);
        row.push(diagonal);
        lower.push(row);
    }
    let weight = dot(&ones, &ones);
    let mean = dot(&ones, &independent) / weight;
    let residual: f64 = independent.iter().zip(&ones).map(|(v, o)| (v - mean * o).powi(2)).sum();
    Some(-0.5 * (log_determinant + weight.ln() + residual + (values.len() as f64 - 1.0) * std::f64::consts::TAU.ln()))
}

/// A witness's deviation from the weighted mean of the others, averaged over the telling targets, relative.
fn deviation(witnesses: &[WitnessReadings], i: usize, telling: &[usize]) -> Option<f64> {
    let all: Vec<usize> = (0..witnesses[i].readings.len()).collect();
    let targets = if telling.is_empty() { &all } else { telling };
    let at = |k: &usize| {
        let (mine, _) = witnesses[i].readings[*k]?;
        let (mut sum, mut weights) = (0.0, 0.0);
        for (j, other) in witnesses.iter().enumerate().filter(|(j, _)| *j != i) {
            let Some((value, u)) = other.readings[*k] else { continue };
            let variance = u.powi(2) + (ALLOWANCE * witnesses[j].allowed[*k]).powi(2) + (ROUNDING * value).powi(2);
            let weight = variance.max(f64::MIN_POSITIVE).recip();
            (sum, weights) = (sum + weight * value, weights + weight);
        }
        Some(mine * weights / sum - 1.0).filter(|d| d.is_finite())
    };
    let found: Vec<f64> = targets.iter().filter_map(at).collect();
    (!found.is_empty()).then(|| found.iter().sum::<f64>() / found.len() as f64)
}

/// Fills in who departs, and tells it.
fn told(
    found: &mut Consensus,
    hypotheses: &[Hypothesis],
    probabilities: &[f64],
    witnesses: &[WitnessReadings],
) -> String {
    let (count, telling) = (witnesses.len(), found.differing);
    if telling == 0 {
        return format!("{count} witnesses, {} of them independent, agree", found.independent);
    }
    let independent = found.groups.iter().join(", ");
    if found.independent < FEWEST {
        return format!(
            "witnesses differ, but only {} of {count} are independent: three could tell who departs; independent are {independent}",
            found.independent
        );
    }
    let mut order: Vec<usize> = (0..hypotheses.len()).collect();
    order.sort_by(|a, b| probabilities[*b].total_cmp(&probabilities[*a]));
    let best = order[0];
    let odds = (probabilities[best] / (1.0 - probabilities[best]).max(0.1 / HIGHEST_ODDS)).min(HIGHEST_ODDS);
    if odds < NAMED {
        let likely = order.iter().filter(|k| probabilities[**k] > 0.05);
        let likely: Vec<String> =
            likely.map(|k| format!("{} ({:.0} %)", hypotheses[*k].name, 100.0 * probabilities[*k])).collect();
        let whom = if likely.is_empty() { "nobody in particular".to_owned() } else { likely.join(" or ") };
        return format!(
            "witnesses differ at {telling} meters, and it is open who departs: {whom}; independent are {independent}"
        );
    }
    let hypothesis = &hypotheses[best];
    let names: Vec<&str> = hypothesis.holders.iter().map(|i| witnesses[*i].name.as_str()).collect();
    found.departs = names.iter().map(|n| (*n).to_owned()).collect();
    found.component = Some(hypothesis.name.clone());
    found.odds = Some(odds);
    let is_reference = found.witnesses.iter().any(|w| w.is_reference && found.departs.contains(&w.name));
    let who = names.join(" and ");
    let shared = if names.len() > 1 { format!(", by what they share: {}", hypothesis.name) } else { String::new() };
    let by = hypothesis.holders.iter().filter_map(|i| found.witnesses[*i].deviation);
    let by =
        by.max_by(|a, b| a.abs().total_cmp(&b.abs())).map_or(String::new(), |d| format!(" by {:+.1} %", 100.0 * d));
    let at = if odds >= HIGHEST_ODDS { "more than 10000".to_owned() } else { format!("{odds:.0}") };
    format!(
        "{}{who} depart{} from the others{by} at {telling} meters{shared}; odds {at} to 1; independent are {independent}",
        if is_reference { "the reference itself: " } else { "" },
        if names.len() > 1 { "" } else { "s" },
    )
}

fn assumptions(witnesses: &[WitnessReadings]) -> String {
    let of_all = |s: &&String| witnesses.len() > 1 && witnesses.iter().all(|t| t.shares.contains(s));
    let blind: Vec<&str> = witnesses[0].shares.iter().filter(of_all).map(String::as_str).collect();
    if blind.is_empty() {
        return ASSUMPTIONS.to_owned();
    }
    format!("{ASSUMPTIONS}; blind to what all have: {}", blind.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::judge::tests::{built_in, recording, task};
    use crate::record::{Estimate, Uncertainty};

    const METERS: usize = 12;
    const LOOKUP: &str = "lookup";

    /// Readings of witnesses that are off by a factor each, with half a per mille of noise in the renderers.
    fn statement(factors: &[(&str, &[&str], f64)], seed: u64) -> Consensus {
        let mut random = fastrand::Rng::with_seed(seed);
        let witness = |(engine, shares, factor): &(&str, &[&str], f64)| {
            let noise = if ["simulator", "iesna"].contains(engine) { 0.0 } else { 5e-4 };
            let estimate = |k: usize| Estimate {
                value: (10.0 + k as f64) * factor * (1.0 + noise * crate::system::random::normal(&mut random)),
                uncertainty: Uncertainty::sampled(noise * (10.0 + k as f64), None),
            };
            let components = [FILE_READER].iter().chain(*shares).map(|s| (*s).to_owned()).collect();
            Recording { components, ..recording(engine, &(0..METERS).map(estimate).collect::<Vec<_>>()) }
        };
        let recordings: Vec<Recording> = factors.iter().map(witness).collect();
        built_in().consensus(&task(METERS), &recordings.iter().collect::<Vec<_>>()).unwrap()
    }

    #[test]
    fn whoever_departs_is_named_and_the_reference_has_no_privilege() {
        let engines = ["simulator", "mitsuba", "radiance", "povray"];
        for wrong in engines {
            for factor in [0.95, 1.06, std::f64::consts::PI, 0.1] {
                let all: Vec<(&str, &[&str], f64)> =
                    engines.iter().map(|e| (*e, &[][..], if *e == wrong { factor } else { 1.0 })).collect();
                let found = statement(&all, 1);
                assert_eq!(found.departs, [wrong], "{factor}: {}", found.text);
                assert_eq!(found.text.starts_with("the reference itself"), wrong == "simulator", "{}", found.text);
                let told = found.witnesses.iter().find(|w| w.name == wrong).unwrap().deviation.unwrap();
                assert!((told - (factor - 1.0)).abs() < 0.02 * factor, "{told} {factor}");
            }
        }
    }

    #[test]
    fn three_are_enough_and_two_are_not() {
        let three = statement(&[("simulator", &[], 1.06), ("mitsuba", &[], 1.0), ("radiance", &[], 1.0)], 2);
        assert_eq!(three.departs, ["simulator"], "{}", three.text);
        let two = statement(&[("simulator", &[], 1.06), ("mitsuba", &[], 1.0)], 2);
        assert!(two.departs.is_empty() && two.text.contains("only 2 of 2 are independent"), "{}", two.text);
    }

    #[test]
    fn witnesses_that_share_a_component_do_not_outvote_the_others() {
        // Two of three share their lookup: they count once, so that nobody can say who is wrong.
        let of_three = statement(&[("simulator", &[LOOKUP], 1.1), ("a", &[LOOKUP], 1.1), ("b", &[], 1.0)], 3);
        assert_eq!((of_three.independent, of_three.departs.len()), (2, 0), "{}", of_three.text);
        // With two others against them it is what they share that departs, not the others, and not one of the two.
        let of_four =
            statement(&[("simulator", &[LOOKUP], 1.1), ("a", &[LOOKUP], 1.1), ("b", &[], 1.0), ("c", &[], 1.0)], 3);
        assert_eq!(of_four.departs, ["simulator", "a"], "{}", of_four.text);
        assert_eq!(of_four.component.as_deref(), Some(LOOKUP));
        // Without sharing it would be two against two.
        let split = statement(&[("simulator", &[], 1.1), ("a", &[], 1.1), ("b", &[], 1.0), ("c", &[], 1.0)], 3);
        assert!(split.departs.is_empty(), "{}", split.text);
    }

    #[test]
    fn whoever_shares_two_components_is_named_as_whoever_shares_one() {
        const TABLES: &str = "tables";
        let twins = |shared: &[&str]| {
            statement(&[("a", shared, 1.1), ("b", shared, 1.1), ("simulator", &[], 1.0), ("c", &[], 1.0)], 3)
        };
        let (one, two) = (twins(&[LOOKUP]), twins(&[LOOKUP, TABLES]));
        assert_eq!((&two.departs[..], two.odds), (&["a".to_owned(), "b".to_owned()][..], one.odds), "{}", two.text);
        assert_eq!(two.independent, 3);
    }

    #[test]
    fn three_starts_of_one_script_count_once() {
        let script = "the program sha256:0123456789ab";
        let found = statement(
            &[("a", &[script], 1.1), ("b", &[script], 1.1), ("c", &[script, "tables"], 1.1), ("simulator", &[], 1.0)],
            3,
        );
        assert_eq!((found.independent, found.departs.len()), (2, 0), "{}", found.text);
    }

    /// Readings of meters by their factors, with a claim of what they are good to.
    fn exact(engines: &[(&str, f64)], claim: impl Fn(usize) -> Uncertainty) -> Consensus {
        let witness = |(engine, factor): &(&str, f64)| {
            let value = |k: usize| (10.0 + k as f64 * 0.37) * factor;
            let read: Vec<_> = (0..METERS).map(|k| Estimate { value: value(k), uncertainty: claim(k) }).collect();
            Recording { components: vec![FILE_READER.to_owned()], ..recording(engine, &read) }
        };
        let recordings: Vec<Recording> = engines.iter().map(witness).collect();
        built_in().consensus(&task(METERS), &recordings.iter().collect::<Vec<_>>()).unwrap()
    }

    #[test]
    fn copies_are_told_by_their_readings_whatever_their_files_are() {
        let claim = |_: usize| Uncertainty::Bound(1e-12);
        for factor in [1.06, 1.06 * (1.0 + 1e-6), 1.06 * (1.0 + 5e-4)] {
            let found = exact(&[("simulator", 1.0), ("a", 1.06), ("b", factor), ("c", 1.06)], claim);
            assert_eq!((found.independent, found.departs.len()), (2, 0), "{}", found.text);
            assert!(found.text.contains("a = b = c (the readings of a"), "{}", found.text);
        }
        // Against two of ours they are one that departs, not three that outvote.
        let engines = [("simulator", 1.0), ("mitsuba", 1.0), ("a", 1.06), ("b", 1.06), ("c", 1.06)];
        assert_eq!(exact(&engines, claim).departs, ["a", "b", "c"]);
        // A copy of one of ours adds nothing to it; ours are known to be different programs.
        let found = exact(&[("simulator", 1.0), ("radiance", 1.06), ("a", 1.06)], claim);
        assert_eq!(found.independent, 2, "{}", found.text);
        let found = exact(&[("simulator", 1.0), ("radiance", 1.06), ("mitsuba", 1.06)], claim);
        assert_eq!(found.departs, ["simulator"], "{}", found.text);
        // Whoever is right agrees with the reference, and may be believed about a third.
        let found = exact(&[("simulator", 1.0), ("a", 1.0 + 1e-9), ("b", 1.06)], claim);
        assert_eq!((found.independent, &found.departs[..]), (3, &["b".to_owned()][..]), "{}", found.text);
    }

    #[test]
    fn the_same_noise_is_one_program_and_noise_of_its_own_is_not() {
        let claim = |k: usize| Uncertainty::sampled(5e-3 * (10.0 + k as f64), None);
        let found = exact(&[("simulator", 1.0), ("a", 1.1), ("b", 1.1 + 1e-5)], claim);
        assert_eq!(found.independent, 2, "{}", found.text);
        let engines: [(&str, &[&str], f64); 3] = [("simulator", &[], 1.1), ("a", &[], 1.0), ("b", &[], 1.0)];
        for seed in 0..50 {
            assert_eq!(statement(&engines, seed).independent, 3);
        }
    }

    #[test]
    fn whoever_names_an_engine_among_what_it_shares_goes_with_it() {
        let found = statement(&[("simulator", &[], 1.0), ("radiance", &[], 1.1), ("a", &["radiance"], 1.1)], 3);
        assert_eq!((found.independent, found.departs.len()), (2, 0), "{}", found.text);
        assert!(found.text.contains("radiance = a (radiance)"), "{}", found.text);
    }

    #[test]
    fn where_all_agree_within_their_tolerances_nobody_is_named() {
        let engines = ["simulator", "mitsuba", "radiance", "povray"];
        for seed in 0..100 {
            let mut random = fastrand::Rng::with_seed(1000 + seed);
            let all: Vec<(&str, &[&str], f64)> =
                engines.iter().map(|e| (*e, &[][..], 1.0 + 0.01 * (2.0 * random.f64() - 1.0))).collect();
            let found = statement(&all, seed);
            assert!(found.departs.is_empty(), "{}", found.text);
        }
    }

    #[test]
    fn what_all_share_is_told_as_a_blind_spot() {
        let found = statement(&[("simulator", &[], 1.0), ("mitsuba", &[], 1.0), ("radiance", &[], 1.0)], 4);
        assert!(found.assumptions.contains(FILE_READER), "{}", found.assumptions);
    }
}
