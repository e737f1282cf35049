//! Which of several independent witnesses departs from the others, the reference included.
//!
//! Each hypothesis says that one component departs, or that none does. A component is a witness's own code, or
//! something that several witnesses share, which then departs in all of them. Readings are normal about an unknown
//! truth with a flat prior, and with the covariance of the hypothesis. Bayes' rule gives the probabilities (Kass &
//! Raftery, J. Am. Statist. Assoc. 90, 1995).
//!
//! Witnesses that share a component therefore count once, and the reference has no privilege. Users' programs
//! share something too if their readings are closer than independent work comes, whatever they claim, or if their errors are
//! similar; see `is_copy` and `have_similar_errors`. Such programs may share a library that nothing names. So only our own
//! engines can show that a closed form or the simulator is wrong.

use itertools::Itertools;
use luxproof_model::Consensus;
use luxproof_model::Group;
use luxproof_model::Witness;
use luxproof_model::numbers::plural;

use super::{Judge, uncertainty_components};
use luxproof_engines::FILE_READER;
use luxproof_model::{Basis, EngineName, Reading, Recording, Role, Uncertainty};
use luxproof_model::{Component, Tolerance};
use luxproof_spec::procedures::{Target, Task};

/// Independent witnesses that a statement needs.
const MIN_INDEPENDENT: usize = 3;
/// Odds from which a departure is named: the alternatives have less than one chance in twenty.
const MIN_NAMED_ODDS: f64 = 19.0;
/// Odds are reported up to here: beyond, the assumptions are less certain than the odds.
const MAX_REPORTED_ODDS: f64 = 1e4;
/// Standard deviation between sound witnesses, as a part of their tolerance.
const SOUND_SHARE_OF_TOLERANCE: f64 = 1.0 / 3.0;
/// Part of the variance between sound witnesses that two with a common component share.
const SHARED_VARIANCE: f64 = 0.5;
/// The largest departure of a component, relative to the reading.
const MAX_DEPARTURE: f64 = 10.0;
/// The smallest departure that is tried, relative to the reading.
const MIN_DEPARTURE: f64 = 1e-6;
/// Independent wrong readings differ by more than this part of their stated standard uncertainty.
///
/// Without chance in them they differ by more than this part of the tolerance, because no two faults coincide closer.
const MAX_COPY_DISTANCE: f64 = 0.1;
/// Probability with which chance may bring sampled readings that close.
const MAX_COPY_CHANCE: f64 = 0.01;
/// Two errors are similar where they differ by less than this part of their size.
///
/// Sizes of faults range over three decades at least, so that two of one sign agree so closely in one of forty cases.
const MAX_SIMILAR_DIFFERENCE: f64 = 0.1;
/// Errors with more noise than this part of their size show no similarity.
const MAX_SIMILAR_NOISE: f64 = 0.2;
/// Differences within so many standard uncertainties are noise.
const NOISE_SIGMAS: f64 = 2.0;
/// Independent engines of our own that may show that a closed form or the simulator is wrong.
const MIN_OWN_ENGINES: usize = 2;
/// Relative rounding of readings: it keeps covariances regular where tolerance and uncertainty are zero.
const ROUNDING: f64 = 1e-12;
/// Probability from which a hypothesis is listed as likely.
const MIN_LISTED_PROBABILITY: f64 = 0.05;
/// The witness of values that are derived from a formula.
const DERIVED_VALUES: &str = "derived values";

const ASSUMPTIONS: &str = "at most one component is wrong, each as likely beforehand as none; sound witnesses differ by a third \
                           of their tolerance (standard deviation); all meters of a procedure count as one; a departure may \
                           be of any size from the tolerance to ten times the reading, evenly in its logarithm";

/// A value with its standard uncertainty.
type Value = (f64, f64);

struct WitnessReadings {
    name: String,
    /// Whether its program comes from a user: only its claims and readings show what it shares with others.
    is_users: bool,
    shares: Vec<String>,
    /// The reading at each target.
    readings: Vec<Option<Value>>,
    /// The tolerance at each target, in the quantity's unit.
    allowed: Vec<f64>,
    /// Whether its uncertainty is chance, by which its readings scatter about those of others.
    is_sampled: bool,
}

impl WitnessReadings {
    fn new(name: &str, shares: Vec<String>, readings: Vec<Option<Value>>, tolerance: Tolerance) -> Self {
        let allowed = readings.iter().map(|r| r.map_or(0.0, |(value, _)| tolerance.around(value))).collect();
        Self { name: name.to_owned(), is_users: false, shares, allowed, readings, is_sampled: false }
    }

    /// Whether it has a component that others name so; its name counts as one.
    fn has(&self, share: &str) -> bool {
        self.name == share || self.shares.iter().any(|s| s == share)
    }

    /// Whether its reading at a target deviates from the reference by more than the wider tolerance.
    fn is_wrong(&self, k: usize, value: f64, reference: Option<&Self>) -> bool {
        let Some(reference) = reference else { return true };
        let Some((right, _)) = reference.readings[k] else { return true };
        (value - right).abs() > reference.allowed[k].max(self.allowed[k])
    }
}

/// A component that may be wrong, and the witnesses that have it.
struct Hypothesis {
    name: String,
    holders: Vec<usize>,
}

impl Hypothesis {
    fn holds_both(&self, i: usize, j: usize) -> bool {
        self.holders.contains(&i) && self.holders.contains(&j)
    }
}

impl Judge<'_> {
    /// Finds which engine departs from the others; `recordings` as for [`Self::compare`].
    ///
    /// `None` where no engine read anything.
    pub fn consensus(&self, task: &Task, recordings: &[&Recording]) -> Option<Consensus> {
        let case = recordings.first()?.key.case.clone();
        let mut witnesses = collect_witnesses(self, task, recordings);
        if witnesses.is_empty() {
            return None;
        }
        let reference = task.reference();
        let reference = reference.engine();
        let differing: Vec<usize> = (0..task.targets.len()).filter(|k| do_differ(&witnesses, *k)).collect();
        mark_copies(&mut witnesses, reference.map(EngineName::as_str), &differing);
        let hypotheses = list_hypotheses(&witnesses);
        let groups = group_witnesses(&witnesses);
        let independent = groups.len();
        let probabilities = if differing.is_empty() || independent < MIN_INDEPENDENT {
            vec![0.0; hypotheses.len()]
        } else {
            Evidence { witnesses: &witnesses, hypotheses: &hypotheses, differing: &differing }.probabilities()
        };
        let mut shown = vec![];
        for (i, witness) in witnesses.iter().enumerate() {
            let own = hypotheses.iter().position(|s| s.name == witness.name);
            shown.push(Witness {
                name: witness.name.clone(),
                is_reference: reference.is_some_and(|r| *r == witness.name),
                shares: witness.shares.clone(),
                deviation: mean_deviation(&witnesses, i, &differing),
                probability: own.map_or(0.0, |own| probabilities[own]),
            });
        }
        let mut found = Consensus {
            case,
            procedure: task.procedure,
            witnesses: shown,
            independent,
            groups,
            differing: differing.len(),
            outliers: vec![],
            component: None,
            odds: None,
            text: String::new(),
            assumptions: describe_assumptions(&witnesses),
        };
        found.text = conclude(&mut found, &hypotheses, &probabilities, &witnesses);
        Some(found)
    }
}

fn collect_witnesses(judge: &Judge<'_>, task: &Task, recordings: &[&Recording]) -> Vec<WitnessReadings> {
    let reference = task.reference();
    let (reference, basis) = (reference.engine(), reference.basis());
    // The tolerance of the reference is the strictest of the others.
    let strictest = recordings
        .iter()
        .map(|r| judge.tolerance_with_source(task, basis, &r.key.engine).0)
        .min_by(|a, b| a.relative.total_cmp(&b.relative))
        .unwrap_or_default();
    let mut witnesses = vec![];
    // Recorded readings are judged by witnesses and are none: they cannot be taken again.
    for recording in recordings.iter().filter(|r| !r.readings.is_empty() && r.role != Role::Recorded) {
        let engine = &recording.key.engine;
        // A method that claims nothing here may depart, and would pass for the one wrong component.
        if judge.tolerances.not_claimed(task.procedure, basis, engine).is_some() {
            continue;
        }
        let is_reference = reference == Some(engine);
        let tolerance = if is_reference { strictest } else { judge.tolerance_with_source(task, basis, engine).0 };
        let readings = (0..task.targets.len()).map(|k| value_at(recording, task, k)).collect();
        witnesses.push(WitnessReadings {
            is_users: luxproof_engines::entry(engine).is_none(),
            is_sampled: recording.readings.iter().any(has_standard_error),
            ..WitnessReadings::new(engine, recording.components.clone(), readings, tolerance)
        });
    }
    witnesses.extend(derived_values(judge, task));
    witnesses
}

/// The reading at a target; `None` where it has no information.
fn value_at(recording: &Recording, task: &Task, k: usize) -> Option<Value> {
    let reading = recording.reading(k, &task.targets[k].id)?;
    if !reading.value.is_finite() || reading.uncertainty == Uncertainty::NotSeen {
        return None;
    }
    Some((reading.value, combined_uncertainty(&uncertainty_components(&reading.uncertainty))))
}

fn combined_uncertainty(components: &[Component]) -> f64 {
    components.iter().map(|c| c.uncertainty.powi(2)).sum::<f64>().sqrt()
}

fn has_standard_error(reading: &Reading) -> bool {
    reading.uncertainty.standard_error().is_some_and(|error| error > 0.0)
}

/// The witness of derived values, where the case has any: they rest on none of our code.
fn derived_values(judge: &Judge<'_>, task: &Task) -> Option<WitnessReadings> {
    let readings: Vec<_> = task.targets.iter().map(|target| derived_value(judge, task, target)).collect();
    let tolerance = judge.tolerance_with_source(task, Basis::ClosedForm, DERIVED_VALUES).0;
    let is_any = readings.iter().any(Option::is_some);
    is_any.then(|| WitnessReadings::new(DERIVED_VALUES, vec![], readings, tolerance))
}

fn derived_value(judge: &Judge<'_>, task: &Task, target: &Target) -> Option<Value> {
    let references = judge.published?.references(task, target, DERIVED_VALUES, &[]);
    references.into_iter().find(|r| r.basis != Basis::Published).map(|r| (r.value, r.uncertainty))
}

/// Lists each witness's own code, and what some of them share but not all.
///
/// What all share shifts no witness against another.
fn list_hypotheses(witnesses: &[WitnessReadings]) -> Vec<Hypothesis> {
    let own = witnesses.iter().enumerate().map(|(i, t)| Hypothesis { name: t.name.clone(), holders: vec![i] });
    let mut hypotheses: Vec<Hypothesis> = own.collect();
    for name in witnesses.iter().flat_map(|t| &t.shares) {
        let holders = find_holders(witnesses, name);
        // Another component of the same witnesses is the same hypothesis: two would divide the odds.
        if hypotheses.iter().all(|s| s.holders != holders) && holders.len() > 1 && holders.len() < witnesses.len() {
            hypotheses.push(Hypothesis { name: name.clone(), holders });
        }
    }
    hypotheses
}

fn find_holders(witnesses: &[WitnessReadings], share: &str) -> Vec<usize> {
    (0..witnesses.len()).filter(|i| witnesses[*i].has(share)).collect()
}

/// Groups witnesses that share something.
///
/// The reader of photometric files ties no witnesses, because nearly all have it. Its departure is a hypothesis,
/// or else a blind spot that the text names.
fn group_witnesses(witnesses: &[WitnessReadings]) -> Vec<Group> {
    let shares = witnesses.iter().flat_map(|w| &w.shares).map(String::as_str).unique();
    let ties: Vec<(&str, Vec<usize>)> = shares
        .filter(|share| *share != FILE_READER)
        .map(|share| (share, find_holders(witnesses, share)))
        .filter(|(_, holders)| holders.len() > 1)
        .collect();
    let mut group: Vec<usize> = (0..witnesses.len()).collect();
    for (_, holders) in &ties {
        let tied: Vec<usize> = holders.iter().map(|i| group[*i]).collect();
        group.iter_mut().filter(|g| tied.contains(g)).for_each(|g| *g = tied[0]);
    }
    let mut groups = vec![];
    for id in group.iter().unique() {
        let members = witnesses.iter().zip(&group).filter(|(_, g)| *g == id).map(|(w, _)| w.name.clone());
        let share = ties.iter().filter(|(_, holders)| group[holders[0]] == *id).map(|(share, _)| (*share).to_owned());
        groups.push(Group { witnesses: members.collect(), share: share.collect() });
    }
    groups
}

/// Adds to copies a common component, as if they had named it.
fn mark_copies(witnesses: &mut [WitnessReadings], reference: Option<&str>, differing: &[usize]) {
    let reference = witnesses.iter().position(|w| reference == Some(&w.name));
    // Each copy gets the first witness that it is tied to, directly or through others.
    let mut first: Vec<usize> = (0..witnesses.len()).collect();
    for [i, j] in (0..witnesses.len()).array_combinations() {
        let of_reference = reference.map(|r| &witnesses[r]);
        let has_similar_errors = of_reference.is_some_and(|r| have_similar_errors(witnesses, [i, j], r, differing));
        if has_similar_errors || is_copy(&witnesses[i], &witnesses[j], of_reference, differing) {
            let (to, from) = (first[i].min(first[j]), first[i].max(first[j]));
            first.iter_mut().filter(|of| **of == from).for_each(|of| *of = to);
        }
    }
    for (k, to) in first.iter().enumerate() {
        if first.iter().filter(|of| *of == to).count() > 1 {
            let share = format!("the readings of {}", witnesses[*to].name);
            witnesses[k].shares.push(share);
        }
    }
}

/// Whether two witnesses, one of them a user's program, have readings that only one program produces.
///
/// They agree to the last digit at every meter. Or they agree far closer than they state, or than two programs need,
/// where both deviate from the reference. Where they agree with the reference, the truth is reason enough.
fn is_copy(a: &WitnessReadings, b: &WitnessReadings, reference: Option<&WitnessReadings>, differing: &[usize]) -> bool {
    if !a.is_users && !b.is_users {
        return false;
    }
    let pairs: Vec<(Value, Value)> = a.readings.iter().zip(&b.readings).filter_map(|(a, b)| (*a).zip(*b)).collect();
    let distinct = pairs.iter().map(|((value, _), _)| value.to_bits()).filter(|bits| *bits != 0).unique().count();
    if distinct > 1 && pairs.iter().all(|((one, _), (other, _))| one.to_bits() == other.to_bits()) {
        return true;
    }
    let is_sampled = a.is_sampled || b.is_sampled;
    let mut squares = vec![];
    for &k in differing {
        let Some(((one, u), (other, v))) = a.readings[k].zip(b.readings[k]) else { continue };
        if a.is_wrong(k, one, reference) && b.is_wrong(k, other, reference) {
            let scale = if is_sampled { u.hypot(v) } else { a.allowed[k].min(b.allowed[k]) };
            squares.push(((one - other) / scale.max(ROUNDING * one.abs())).powi(2));
        }
    }
    let (n, mean) = (squares.len() as f64, squares.iter().sum::<f64>() / squares.len() as f64);
    // Chernoff's bound of the chance of a small mean of squares of normal values.
    let chance = (mean * (1.0 - mean).exp()).powf(0.5 * n);
    mean < MAX_COPY_DISTANCE.powi(2) && (!is_sampled || chance < MAX_COPY_CHANCE)
}

/// Whether two users' programs have similar errors beyond chance, so that they share more than they name.
///
/// Where an engine of our own reads the same as they do, the truth is reason enough.
fn have_similar_errors(
    witnesses: &[WitnessReadings],
    [i, j]: [usize; 2],
    reference: &WitnessReadings,
    differing: &[usize],
) -> bool {
    let (a, b) = (&witnesses[i], &witnesses[j]);
    if !a.is_users || !b.is_users || differing.is_empty() {
        return false;
    }
    let (mut difference, mut size, mut noise) = (0.0, 0.0, 0.0);
    for &k in differing {
        let (Some((one, u)), Some((other, v)), Some((right, w))) =
            (a.readings[k], b.readings[k], reference.readings[k])
        else {
            return false;
        };
        difference += (one - other).powi(2);
        size += 0.5 * ((one - right).powi(2) + (other - right).powi(2));
        noise += u.powi(2) + v.powi(2) + w.powi(2);
    }
    let limit = MAX_SIMILAR_DIFFERENCE * size.sqrt() + NOISE_SIGMAS * noise.sqrt();
    let are_similar = noise.sqrt() < MAX_SIMILAR_NOISE * size.sqrt() && difference.sqrt() < limit;
    are_similar
        && !witnesses.iter().any(|own| is_own_engine(own) && own.name != reference.name && agrees(own, a, differing))
}

/// Whether it is an engine of our own, and no derived values.
fn is_own_engine(witness: &WitnessReadings) -> bool {
    !witness.is_users && witness.name != DERIVED_VALUES
}

/// Whether two witnesses agree within their tolerance and noise at all of the targets.
fn agrees(a: &WitnessReadings, b: &WitnessReadings, targets: &[usize]) -> bool {
    targets.iter().all(|k| match (a.readings[*k], b.readings[*k]) {
        (Some((one, u)), Some((other, v))) => {
            (one - other).abs() <= a.allowed[*k].max(b.allowed[*k]) + NOISE_SIGMAS * u.hypot(v)
        }
        _ => false,
    })
}

/// Whether a hypothesis says that a closed form or the simulator is wrong, and too few engines of our own say so too.
fn rests_on_users_programs(found: &Consensus, hypothesis: &Hypothesis, witnesses: &[WitnessReadings]) -> bool {
    let is_base = |w: &WitnessReadings| {
        w.name == DERIVED_VALUES || [EngineName::SIMULATOR, EngineName::IESNA].iter().any(|engine| *engine == w.name)
    };
    if !hypothesis.holders.iter().any(|i| is_base(&witnesses[*i])) {
        return false;
    }
    let departs = |name: &String| hypothesis.holders.iter().any(|i| witnesses[*i].name == *name);
    let is_own = |name: &String| !departs(name) && witnesses.iter().any(|w| w.name == *name && is_own_engine(w));
    found.groups.iter().filter(|group| group.witnesses.iter().any(is_own)).count() < MIN_OWN_ENGINES
}

/// Whether any two witnesses differ at a target by more than the wider tolerance and twice their noise.
fn do_differ(witnesses: &[WitnessReadings], k: usize) -> bool {
    let present = witnesses.iter().filter_map(|t| Some((t.readings[k]?, t.allowed[k]))).collect_vec();
    present.iter().enumerate().any(|(i, ((a, u), allowed))| {
        present[..i].iter().any(|((b, v), other_allowed)| {
            (a - b).abs() > allowed.max(*other_allowed) + 2.0 * u.hypot(*v) + ROUNDING * a.abs()
        })
    })
}

/// The evidence of readings for each hypothesis.
struct Evidence<'a> {
    witnesses: &'a [WitnessReadings],
    hypotheses: &'a [Hypothesis],
    /// The targets at which witnesses differ.
    differing: &'a [usize],
}

/// The component that departs, and by how much relative to the reading.
type Departure<'a> = (&'a Hypothesis, f64);

impl Evidence<'_> {
    /// The probability of each hypothesis; the rest is the probability that no component departs.
    fn probabilities(&self) -> Vec<f64> {
        let mut logs = vec![self.mean_log_likelihood(None)];
        logs.extend(self.hypotheses.iter().map(|hypothesis| self.log_evidence(hypothesis)));
        let total = log_of_sum(&logs);
        // Readings so far apart that their evidence overflows support no hypothesis.
        logs[1..].iter().map(|l| (l - total).exp()).map(|p| if p.is_finite() { p } else { 0.0 }).collect()
    }

    /// The log-likelihood of a departing component, averaged over the sizes of its departure.
    fn log_evidence(&self, hypothesis: &Hypothesis) -> f64 {
        let allowances = self.differing.iter().map(|k| relative_allowance(self.witnesses, *k));
        let smallest = allowances.fold(f64::INFINITY, f64::min).clamp(MIN_DEPARTURE, MAX_DEPARTURE);
        let mut size = smallest;
        let mut logs = vec![self.mean_log_likelihood(Some((hypothesis, size)))];
        while size < MAX_DEPARTURE {
            size *= 2.0;
            logs.push(self.mean_log_likelihood(Some((hypothesis, size))));
        }
        log_of_sum(&logs) - (logs.len() as f64).ln()
    }

    /// The mean over targets, because all meters of a procedure count as one.
    fn mean_log_likelihood(&self, departure: Option<Departure<'_>>) -> f64 {
        self.differing.iter().map(|k| self.log_likelihood(departure, *k)).sum::<f64>() / self.differing.len() as f64
    }

    /// Logarithm of the likelihood of the readings at one target, with the truth integrated out.
    fn log_likelihood(&self, departure: Option<Departure<'_>>, k: usize) -> f64 {
        let scale = median_reading(self.witnesses, k);
        let (mut present, mut values) = (vec![], vec![]);
        for (i, witness) in self.witnesses.iter().enumerate() {
            if let Some((value, _)) = witness.readings[k] {
                present.push(i);
                values.push(value / scale - 1.0);
            }
        }
        let mut matrix = vec![];
        for &i in &present {
            matrix.push(present.iter().map(|j| self.covariance(departure, k, scale, [i, *j])).collect());
        }
        gaussian_log_likelihood(&matrix, &values).unwrap_or(f64::NEG_INFINITY)
    }

    /// Covariance of two witnesses at a target, relative to a scale.
    fn covariance(&self, departure: Option<Departure<'_>>, k: usize, scale: f64, [i, j]: [usize; 2]) -> f64 {
        let (a, b) = (&self.witnesses[i], &self.witnesses[j]);
        let mut sum = 0.0;
        if i == j {
            let noise = a.readings[k].map_or(0.0, |(_, u)| u);
            sum +=
                (noise / scale).powi(2) + (SOUND_SHARE_OF_TOLERANCE * a.allowed[k] / scale).powi(2) + ROUNDING.powi(2);
        } else if self.hypotheses.iter().any(|hypothesis| hypothesis.holds_both(i, j)) {
            sum += SHARED_VARIANCE * (SOUND_SHARE_OF_TOLERANCE * a.allowed[k].min(b.allowed[k]) / scale).powi(2);
        }
        if let Some((_, size)) = departure.filter(|(hypothesis, _)| hypothesis.holds_both(i, j)) {
            sum += size.powi(2);
        }
        sum
    }
}

fn log_of_sum(logs: &[f64]) -> f64 {
    let largest = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    largest + logs.iter().map(|l| (l - largest).exp()).sum::<f64>().ln()
}

/// The smallest tolerance at a target, relative to the median reading.
fn relative_allowance(witnesses: &[WitnessReadings], k: usize) -> f64 {
    let allowed = witnesses.iter().filter(|t| t.readings[k].is_some()).map(|t| t.allowed[k]);
    allowed.fold(f64::INFINITY, f64::min) / median_reading(witnesses, k)
}

/// The median of the readings at a target: a scale that one wrong witness does not move.
fn median_reading(witnesses: &[WitnessReadings], k: usize) -> f64 {
    let mut values: Vec<f64> = witnesses.iter().filter_map(|t| t.readings[k]).map(|(value, _)| value.abs()).collect();
    values.sort_by(f64::total_cmp);
    // Where the median is darkness, the largest reading is the scale.
    let largest = values.last().copied().unwrap_or(0.0);
    values.get(values.len() / 2).copied().filter(|m| *m > 0.0).unwrap_or(largest).max(f64::MIN_POSITIVE)
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// Log-likelihood of normal values about a common unknown mean with a flat prior, by Cholesky factors.
///
/// `None` where the matrix is not positive definite.
fn gaussian_log_likelihood(matrix: &[Vec<f64>], values: &[f64]) -> Option<f64> {
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

/// A witness's relative deviation from the others, averaged over the targets that differ, or over all where none do.
fn mean_deviation(witnesses: &[WitnessReadings], i: usize, differing: &[usize]) -> Option<f64> {
    let all: Vec<usize> = (0..witnesses[i].readings.len()).collect();
    let targets = if differing.is_empty() { &all } else { differing };
    let found: Vec<f64> = targets.iter().filter_map(|k| deviation_at(witnesses, i, *k)).collect();
    (!found.is_empty()).then(|| found.iter().sum::<f64>() / found.len() as f64)
}

/// A witness's relative deviation from the weighted mean of the others at a target.
fn deviation_at(witnesses: &[WitnessReadings], i: usize, k: usize) -> Option<f64> {
    let (reading, _) = witnesses[i].readings[k]?;
    let (mut sum, mut weights) = (0.0, 0.0);
    for (j, other) in witnesses.iter().enumerate().filter(|(j, _)| *j != i) {
        let Some((value, u)) = other.readings[k] else { continue };
        let variance =
            u.powi(2) + (SOUND_SHARE_OF_TOLERANCE * witnesses[j].allowed[k]).powi(2) + (ROUNDING * value).powi(2);
        let weight = variance.max(f64::MIN_POSITIVE).recip();
        sum += weight * value;
        weights += weight;
    }
    Some(reading * weights / sum - 1.0).filter(|d| d.is_finite())
}

/// Fills in which witnesses depart, where the odds suffice, and describes the result.
fn conclude(
    found: &mut Consensus,
    hypotheses: &[Hypothesis],
    probabilities: &[f64],
    witnesses: &[WitnessReadings],
) -> String {
    let (count, differing) = (witnesses.len(), found.differing);
    if differing == 0 {
        return format!("{count} witnesses, {} of them independent, agree", found.independent);
    }
    let independent = found.groups.iter().join(", ");
    if found.independent < MIN_INDEPENDENT {
        return format!(
            "engines differ at {}, and {}: a third independent engine would show which one is wrong; independent are {independent}",
            plural(differing, "meter"),
            if found.independent == 1 { "only one is independent" } else { "only two are independent" }
        );
    }
    let mut order: Vec<usize> = (0..hypotheses.len()).collect();
    order.sort_by(|a, b| probabilities[*b].total_cmp(&probabilities[*a]));
    let best = order[0];
    let smallest_rest = 0.1 / MAX_REPORTED_ODDS;
    let odds = (probabilities[best] / (1.0 - probabilities[best]).max(smallest_rest)).min(MAX_REPORTED_ODDS);
    if odds < MIN_NAMED_ODDS {
        let candidates = describe_candidates(&order, hypotheses, probabilities);
        return format!(
            "witnesses differ at {differing} meters, and it is open which is the outlier: {candidates}; independent are {independent}"
        );
    }
    let hypothesis = &hypotheses[best];
    if rests_on_users_programs(found, hypothesis, witnesses) {
        return format!(
            "witnesses differ at {differing} meters, and it is open which is the outlier: only users' programs contradict {}, and fewer than \
             {MIN_OWN_ENGINES} independent engines of luxproof; independent are {independent}",
            hypothesis.holders.iter().map(|i| witnesses[*i].name.as_str()).join(" and ")
        );
    }
    found.outliers = hypothesis.holders.iter().map(|i| witnesses[*i].name.clone()).collect();
    found.component = Some(hypothesis.name.clone());
    found.odds = Some(odds);
    describe_departure(found, hypothesis, odds, &independent)
}

/// The likely hypotheses with their probabilities.
fn describe_candidates(order: &[usize], hypotheses: &[Hypothesis], probabilities: &[f64]) -> String {
    let likely: Vec<String> = order
        .iter()
        .filter(|k| probabilities[**k] > MIN_LISTED_PROBABILITY)
        .map(|k| format!("{} ({:.0} %)", hypotheses[*k].name, 100.0 * probabilities[*k]))
        .collect();
    if likely.is_empty() { "no single one".to_owned() } else { likely.join(" or ") }
}

fn describe_departure(found: &Consensus, hypothesis: &Hypothesis, odds: f64, independent: &str) -> String {
    let is_reference = found.witnesses.iter().any(|w| w.is_reference && found.outliers.contains(&w.name));
    let are_several = found.outliers.len() > 1;
    let names = found.outliers.join(" and ");
    let shared = if are_several { format!(", by what they share: {}", hypothesis.name) } else { String::new() };
    let largest = hypothesis
        .holders
        .iter()
        .filter_map(|i| found.witnesses[*i].deviation)
        .max_by(|a, b| a.abs().total_cmp(&b.abs()));
    let by = largest.map_or(String::new(), |d| format!(" by {:+.1} %", 100.0 * d));
    let odds = if odds >= MAX_REPORTED_ODDS { "more than 10000".to_owned() } else { format!("{odds:.0}") };
    format!(
        "{}{names} depart{} from the others{by} at {} meters{shared}; odds {odds} to 1; independent are {independent}",
        if is_reference { "the reference itself: " } else { "" },
        if are_several { "" } else { "s" },
        found.differing,
    )
}

fn describe_assumptions(witnesses: &[WitnessReadings]) -> String {
    let shares = witnesses[0].shares.iter().map(String::as_str);
    let blind_spots =
        shares.filter(|s| witnesses.len() > 1 && witnesses.iter().all(|t| t.shares.iter().any(|o| o == s)));
    let blind_spots = blind_spots.collect_vec();
    if blind_spots.is_empty() {
        return ASSUMPTIONS.to_owned();
    }
    format!("{ASSUMPTIONS}; blind to what all have: {}", blind_spots.join(", "))
}

#[cfg(test)]
mod step_tests;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{built_in, recording, task};
    use luxproof_model::{Estimate, Uncertainty};

    const METERS: usize = 12;
    const LOOKUP: &str = "lookup";

    /// The consensus of witnesses with a factor each, with half a per mille of noise in the renderers.
    fn statement(factors: &[(&str, &[&str], f64)], seed: u64) -> Consensus {
        let mut random = fastrand::Rng::with_seed(seed);
        let mut recordings = vec![];
        for (engine, shares, factor) in factors {
            let noise = if ["simulator", "iesna"].contains(engine) { 0.0 } else { 5e-4 };
            let mut readings = vec![];
            for k in 0..METERS {
                let level = 10.0 + k as f64;
                let value = level * factor * (1.0 + noise * luxproof_process::random::normal(&mut random));
                readings.push(Estimate { value, uncertainty: Uncertainty::sampled(noise * level, None) });
            }
            let components = [FILE_READER].iter().chain(*shares).map(|s| (*s).to_owned()).collect();
            recordings.push(Recording { components, ..recording(engine, &readings) });
        }
        built_in().consensus(&task(METERS), &recordings.iter().collect::<Vec<_>>()).unwrap()
    }

    #[test]
    fn the_departing_engine_is_named_and_the_reference_has_no_privilege() {
        let engines = ["simulator", "mitsuba", "radiance", "povray"];
        for wrong in engines {
            for factor in [0.95, 1.06, std::f64::consts::PI, 0.1] {
                let all: Vec<(&str, &[&str], f64)> =
                    engines.iter().map(|e| (*e, &[][..], if *e == wrong { factor } else { 1.0 })).collect();
                let found = statement(&all, 1);
                assert_eq!(found.outliers, [wrong], "{factor}: {}", found.text);
                assert_eq!(found.text.starts_with("the reference itself"), wrong == "simulator", "{}", found.text);
                let deviation = found.witnesses.iter().find(|w| w.name == wrong).unwrap().deviation.unwrap();
                assert!((deviation - (factor - 1.0)).abs() < 0.02 * factor, "{deviation} {factor}");
            }
        }
    }

    #[test]
    fn three_are_enough_and_two_are_not() {
        let three = statement(&[("simulator", &[], 1.06), ("mitsuba", &[], 1.0), ("radiance", &[], 1.0)], 2);
        assert_eq!(three.outliers, ["simulator"], "{}", three.text);
        let two = statement(&[("simulator", &[], 1.06), ("mitsuba", &[], 1.0)], 2);
        assert!(two.outliers.is_empty() && two.text.contains("only two are independent"), "{}", two.text);
    }

    #[test]
    fn witnesses_that_share_a_component_do_not_outvote_the_others() {
        // Two of three share their lookup: they count once, so that it is open who is wrong.
        let of_three = statement(&[("simulator", &[LOOKUP], 1.1), ("a", &[LOOKUP], 1.1), ("b", &[], 1.0)], 3);
        assert_eq!((of_three.independent, of_three.outliers.len()), (2, 0), "{}", of_three.text);
        // With two others against them it is what they share that departs, not the others, and not one of the two.
        let of_four = statement(
            &[("simulator", &[LOOKUP], 1.1), ("a", &[LOOKUP], 1.1), ("mitsuba", &[], 1.0), ("radiance", &[], 1.0)],
            3,
        );
        assert_eq!(of_four.outliers, ["simulator", "a"], "{}", of_four.text);
        assert_eq!(of_four.component.as_deref(), Some(LOOKUP));
        // Without sharing it would be two against two.
        let split =
            statement(&[("simulator", &[], 1.1), ("a", &[], 1.1), ("mitsuba", &[], 1.0), ("radiance", &[], 1.0)], 3);
        assert!(split.outliers.is_empty(), "{}", split.text);
    }

    #[test]
    fn witnesses_with_two_common_components_are_named_as_with_one() {
        const TABLES: &str = "tables";
        let [one, two] = [&[LOOKUP][..], &[LOOKUP, TABLES]].map(|shared| {
            statement(&[("a", shared, 1.1), ("b", shared, 1.1), ("simulator", &[], 1.0), ("c", &[], 1.0)], 3)
        });
        assert_eq!((&two.outliers[..], two.odds), (&["a".to_owned(), "b".to_owned()][..], one.odds), "{}", two.text);
        assert_eq!(two.independent, 3);
    }

    #[test]
    fn three_starts_of_one_script_count_once() {
        let script = "the program sha256:0123456789ab";
        let found = statement(
            &[("a", &[script], 1.1), ("b", &[script], 1.1), ("c", &[script, "tables"], 1.1), ("simulator", &[], 1.0)],
            3,
        );
        assert_eq!((found.independent, found.outliers.len()), (2, 0), "{}", found.text);
    }

    /// The consensus of witnesses without noise, with a factor each and the uncertainty that they claim.
    fn exact(engines: &[(&str, f64)], claim: impl Fn(usize) -> Uncertainty) -> Consensus {
        let mut recordings = vec![];
        for (engine, factor) in engines {
            let mut readings = vec![];
            for k in 0..METERS {
                readings.push(Estimate { value: (10.0 + k as f64 * 0.37) * factor, uncertainty: claim(k) });
            }
            let components = vec![FILE_READER.to_owned()];
            recordings.push(Recording { components, ..recording(engine, &readings) });
        }
        built_in().consensus(&task(METERS), &recordings.iter().collect::<Vec<_>>()).unwrap()
    }

    #[test]
    fn copies_are_detected_by_their_readings_whatever_their_files_are() {
        let claim = |_: usize| Uncertainty::Bound(1e-12);
        for factor in [1.06, 1.06 * (1.0 + 1e-6), 1.06 * (1.0 + 5e-4)] {
            let found = exact(&[("simulator", 1.0), ("a", 1.06), ("b", factor), ("c", 1.06)], claim);
            assert_eq!((found.independent, found.outliers.len()), (2, 0), "{}", found.text);
            assert!(found.text.contains("a = b = c (the readings of a"), "{}", found.text);
        }
        // Against two of ours they are one that departs, not three that outvote.
        let engines = [("simulator", 1.0), ("mitsuba", 1.0), ("a", 1.06), ("b", 1.06), ("c", 1.06)];
        assert_eq!(exact(&engines, claim).outliers, ["a", "b", "c"]);
        // A copy of one of ours adds nothing to it; ours are known to be different programs.
        let found = exact(&[("simulator", 1.0), ("radiance", 1.06), ("a", 1.06)], claim);
        assert_eq!(found.independent, 2, "{}", found.text);
        let found = exact(&[("simulator", 1.0), ("radiance", 1.06), ("mitsuba", 1.06)], claim);
        assert_eq!(found.outliers, ["simulator"], "{}", found.text);
        // A right program agrees with the reference, and counts as independent.
        let found = exact(&[("simulator", 1.0), ("a", 1.0 + 1e-9), ("b", 1.06)], claim);
        assert_eq!((found.independent, &found.outliers[..]), (3, &["b".to_owned()][..]), "{}", found.text);
    }

    #[test]
    fn the_same_noise_is_one_program_and_independent_noise_is_not() {
        let claim = |k: usize| Uncertainty::sampled(5e-3 * (10.0 + k as f64), None);
        let found = exact(&[("simulator", 1.0), ("a", 1.1), ("b", 1.1 + 1e-5)], claim);
        assert_eq!(found.independent, 2, "{}", found.text);
        // Where an engine of our own reads the same, similarity is that of the truth, and independent noise counts.
        let engines: [(&str, &[&str], f64); 4] =
            [("simulator", &[], 1.1), ("mitsuba", &[], 1.0), ("a", &[], 1.0), ("b", &[], 1.0)];
        for seed in 0..50 {
            assert_eq!(statement(&engines, seed).independent, 4);
        }
    }

    #[test]
    fn programs_with_similar_errors_count_once_and_outvote_no_simulator() {
        // Three programs over one library that nothing names, each with its own noise.
        let like: [(&str, &[&str], f64); 4] =
            [("simulator", &[], 1.0), ("a", &[], 1.06), ("b", &[], 1.0605), ("c", &[], 1.0595)];
        for seed in 0..50 {
            let found = statement(&like, seed);
            assert_eq!((found.independent, found.outliers.len()), (2, 0), "{}", found.text);
        }
        let with_own = [&like[..], &[("mitsuba", &[], 1.0)]].concat();
        assert_eq!(statement(&with_own, 1).outliers, ["a", "b", "c"]);
        // Errors that differ by more than a tenth are independent.
        let unlike = statement(&[("simulator", &[], 1.0), ("a", &[], 1.06), ("b", &[], 1.09)], 1);
        assert_eq!(unlike.independent, 3, "{}", unlike.text);
    }

    #[test]
    fn the_simulator_is_called_wrong_only_by_engines_of_our_own() {
        for (one, other, is_named) in
            [("mitsuba", "radiance", true), ("mitsuba", "mine", false), ("mine", "theirs", false)]
        {
            let found = statement(&[("simulator", &[], 1.06), (one, &[], 1.0), (other, &[], 1.0)], 2);
            assert_eq!(found.outliers.contains(&"simulator".to_owned()), is_named, "{}", found.text);
        }
    }

    #[test]
    fn a_witness_that_names_an_engine_as_a_component_goes_with_it() {
        let found = statement(&[("simulator", &[], 1.0), ("radiance", &[], 1.1), ("a", &["radiance"], 1.1)], 3);
        assert_eq!((found.independent, found.outliers.len()), (2, 0), "{}", found.text);
        assert!(found.text.contains("radiance = a (radiance)"), "{}", found.text);
    }

    #[test]
    fn where_all_agree_within_their_tolerances_no_engine_is_named() {
        let engines = ["simulator", "mitsuba", "radiance", "povray"];
        for seed in 0..100 {
            let mut random = fastrand::Rng::with_seed(1000 + seed);
            let all: Vec<(&str, &[&str], f64)> =
                engines.iter().map(|e| (*e, &[][..], 1.0 + 0.01 * (2.0 * random.f64() - 1.0))).collect();
            let found = statement(&all, seed);
            assert!(found.outliers.is_empty(), "{}", found.text);
        }
    }

    #[test]
    fn what_all_share_is_reported_as_a_blind_spot() {
        let found = statement(&[("simulator", &[], 1.0), ("mitsuba", &[], 1.0), ("radiance", &[], 1.0)], 4);
        assert!(found.assumptions.contains(FILE_READER), "{}", found.assumptions);
    }
}
