//! Change points: sums over nights of what each brings that the nights before did not predict.
//!
//! Page, Continuous inspection schemes, Biometrika 41 (1954), with the self-starting form of Hawkins, Self-starting Cusum
//! charts for location and scale, The Statistician 36 (1987): every night is predicted by the mean of the nights before it, so
//! that neither the true deviation nor its spread need be known, and no night counts twice.
//!
//! A series' innovation is its deviation less the mean of the nights before, in standard errors, times sqrt(n / (n + 1)). The
//! innovations of a group of series are added over the square root of their number and divided by their own spread over the
//! nights before, which gives Student's t, and that the normal deviate U (Wallace, Bounds on normal approximations to
//! Student's and the chi-square distributions, Ann. Math. Statist. 30 (1959)). The spread of a single comparison is moderated by that
//! of its case (Smyth, Linear models and empirical Bayes methods, Stat. Appl. Genet. Mol. Biol. 3 (2004)).
//!
//! Two statistics are watched, each with its share of the false alarms: the sums S = max(0, S +- U - 1), quickest in the mean
//! for a shift of two standard errors, and the sum of the last five nights, likeliest to see one within five. A change is
//! dated, among the nights since the sum last was zero or among the five, to the one that makes what followed most likely.

use std::collections::BTreeMap;
use std::ops::Range;

use strum::VariantArray;

use super::innovation::{Innovation, MAX_SPREADS, MIN_ERROR, MIN_LEARNED, RunningMean, Spread, spread_of_all};
use super::limits::{Limits, REFERENCE_VALUE, WINDOW};
use super::series::{History, Series};
use crate::record::{EngineName, MeterId, ProcedureId};

/// Over all groups of a history together there is at most one false alarm in so many nights, in the mean.
pub const NIGHTS_PER_FALSE_ALARM: f64 = 30.0;
/// One night alone is no change: it takes a sum no further than this share of its limit.
const MAX_OF_ONE_NIGHT: f64 = 0.9;
/// Changes in the same direction of one engine and procedure dated so close together are one change seen several times ...
const SAME_CHANGE: usize = 3;
/// ... and what a single comparison shows so many nights after its group: it needs longer.
const SAME_CHANGE_OF_ONE: usize = 21;

/// How many series are judged together.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, VariantArray)]
pub enum Level {
    EngineAndProcedure,
    Case,
    Comparison,
}

impl Level {
    /// Of the false alarms.
    const fn share(self) -> f64 {
        match self {
            Self::EngineAndProcedure => 0.25,
            Self::Case => 0.05,
            Self::Comparison => 0.7,
        }
    }
}

/// A deviation that has changed and stayed; nights are counted from the first of the history.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    pub level: Level,
    pub engine: EngineName,
    pub procedure: ProcedureId,
    pub part: Part,
    /// The first after the change, by estimate.
    pub night: usize,
    pub noticed: usize,
    /// How far the deviation moved, in standard errors of a reading, in the mean over the group.
    pub standard_errors: f64,
    /// Likewise relative to the reference.
    pub relative: f64,
    /// The cases and comparisons that show the same change by themselves.
    pub seen_in: Vec<Part>,
}

/// A case of an engine and procedure or one comparison of it; none is all.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Part {
    pub case: Option<String>,
    pub meter: Option<MeterId>,
}

/// The changes of a history, by night and level. What several levels see of one engine and procedure at once is one change.
pub fn changes(history: &History) -> Vec<Change> {
    let mut found: Vec<Change> = vec![];
    for change in Level::VARIANTS.iter().copied().flat_map(|level| at_level(history, level)) {
        let same = |c: &&mut Change| {
            let is_one_of_it = change.level == Level::Comparison && c.level < Level::Comparison;
            let after = if is_one_of_it { SAME_CHANGE_OF_ONE } else { SAME_CHANGE };
            (&c.engine, c.procedure) == (&change.engine, change.procedure)
                && (c.night..=c.night + SAME_CHANGE + after).contains(&(change.night + SAME_CHANGE))
                && (c.standard_errors > 0.0) == (change.standard_errors > 0.0)
        };
        match found.iter_mut().find(same) {
            Some(wider) => wider.seen_in.push(change.part),
            None => found.push(change),
        }
    }
    found.sort_by_key(|a| (a.night, a.level));
    found
}

fn at_level(history: &History, level: Level) -> Vec<Change> {
    let mut groups: BTreeMap<(Case<'_>, usize), Vec<&Series>> = BTreeMap::new();
    for (k, series) in history.series.iter().enumerate() {
        let (engine, procedure, case) = case_of(series);
        let case = if level == Level::EngineAndProcedure { "" } else { case };
        let number = if level == Level::Comparison { k } else { 0 };
        groups.entry(((engine, procedure, case), number)).or_default().push(series);
    }
    let limits = Limits::of(groups.len() as f64 * NIGHTS_PER_FALSE_ALARM / level.share());
    let cases = if level == Level::Comparison { spreads_of_cases(history) } else { BTreeMap::new() };
    let mut found = vec![];
    for ((of @ (engine, procedure, case), _), members) in groups {
        let part = Part {
            case: (level != Level::EngineAndProcedure).then(|| case.to_owned()),
            meter: (level == Level::Comparison).then(|| members[0].key.meter.clone()),
        };
        let named = |alarm: Alarm| Change {
            level,
            engine: engine.clone(),
            procedure,
            part: part.clone(),
            night: alarm.night,
            noticed: alarm.noticed,
            standard_errors: alarm.shift.0,
            relative: alarm.shift.1,
            seen_in: vec![],
        };
        let watch = Watch { limits, peers: cases.get(&of).map_or(&[], Vec::as_slice) };
        found.extend(watch.alarms(&members, history.nights.len()).into_iter().map(named));
    }
    found
}

type Case<'h> = (&'h EngineName, ProcedureId, &'h str);

fn case_of(series: &Series) -> Case<'_> {
    let reading = &series.key.reading;
    (&reading.engine, reading.procedure, &reading.case)
}

/// The spread that all comparisons of a case show together before each night.
fn spreads_of_cases(history: &History) -> BTreeMap<Case<'_>, Vec<Spread>> {
    let mut cases: BTreeMap<_, Vec<&Series>> = BTreeMap::new();
    for series in &history.series {
        cases.entry(case_of(series)).or_default().push(series);
    }
    cases.into_iter().map(|(case, members)| (case, spread_of_all(&members, history.nights.len()))).collect()
}

struct Alarm {
    night: usize,
    noticed: usize,
    shift: (f64, f64),
}

struct Watch<'a> {
    limits: Limits,
    /// The spread of the comparisons that are like it, before each night; none for a group that is judged by its own alone.
    peers: &'a [Spread],
}

impl Watch<'_> {
    /// The changes of one group. After each the estimates start anew with the night after it was noticed: the nights since the
    /// change were picked for being unusual, and would predict the next ones wrong.
    fn alarms(&self, members: &[&Series], nights: usize) -> Vec<Alarm> {
        let mut found: Vec<Alarm> = vec![];
        let mut start = 0;
        while let Some((night, noticed)) = self.first_alarm(members, start..nights) {
            found.push(Alarm { night, noticed, shift: shift(members, start, night, noticed) });
            start = noticed + 1;
        }
        found
    }

    /// The night of the first change of a segment, and that on which it is noticed.
    fn first_alarm(&self, members: &[&Series], segment: Range<usize>) -> Option<(usize, usize)> {
        let most = REFERENCE_VALUE + MAX_OF_ONE_NIGHT * self.limits.sum;
        let mut means = vec![RunningMean::default(); members.len()];
        let mut spread = Spread::default();
        let mut deviates = vec![];
        let (mut sums, mut zero) = ([0.0_f64; 2], [0; 2]);
        for night in segment {
            let updates = members.iter().zip(&mut means).filter_map(|(series, mean)| mean.update(series, night));
            let Some(innovation) = Innovation::of_group(updates) else { continue };
            let known = self.peers.get(night).map_or(spread, |peers| spread.moderated_by(*peers));
            let deviate = known.deviate(innovation).clamp(-most, most);
            let is_learning = spread.count < MIN_LEARNED;
            spread.update(innovation);
            if is_learning {
                continue;
            }
            deviates.push((night, deviate));
            for (side, sign) in [1.0, -1.0].into_iter().enumerate() {
                sums[side] += sign * deviate - REFERENCE_VALUE;
                if sums[side] <= 0.0 {
                    (sums[side], zero[side]) = (0.0, deviates.len());
                } else if sums[side] > self.limits.sum {
                    return Some((most_likely(&deviates[zero[side]..]), night));
                }
            }
            let last = &deviates[deviates.len().saturating_sub(WINDOW)..];
            if self.limits.are_exceeded_by(last.iter().map(|(_, deviate)| deviate.clamp(-MAX_SPREADS, MAX_SPREADS))) {
                return Some((most_likely(last), night));
            }
        }
        None
    }
}

/// Of nights with their deviates: the night from which on the deviates are most unlike zero.
fn most_likely(deviates: &[(usize, f64)]) -> usize {
    let (mut best, mut sum) = ((0.0, 0), 0.0);
    for (count, (night, deviate)) in (1..).zip(deviates.iter().rev()) {
        sum += deviate;
        let evidence = sum * sum / f64::from(count);
        if evidence > best.0 {
            best = (evidence, *night);
        }
    }
    best.1
}

/// How far a group's deviations moved at a change: in standard errors and relative to the reference.
fn shift(members: &[&Series], start: usize, change: usize, noticed: usize) -> (f64, f64) {
    let (mut errors, mut relative, mut count) = (0.0, 0.0, 0.0);
    for series in members {
        let mean = |values: &[f64], nights: Range<usize>| {
            let there = nights.filter(|n| series.deviation[*n].is_finite()).map(|n| values[n]);
            let (sum, count) = there.fold((0.0, 0.0), |(sum, count), v| (sum + v, count + 1.0));
            sum / count
        };
        let moved = mean(&series.deviation, change..noticed + 1) - mean(&series.deviation, start..change);
        let reference = mean(&series.reference, start..noticed + 1).abs();
        let squares: Vec<f64> = series.std_error.iter().map(|e| e * e).collect();
        let error = mean(&squares, start..noticed + 1).sqrt().max(MIN_ERROR * reference).max(f64::MIN_POSITIVE);
        if moved.is_finite() {
            errors += moved / error;
            relative += if reference > 0.0 { moved / reference } else { 0.0 };
            count += 1.0;
        }
    }
    (errors / count, relative / count)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trend::history::synthetic::{Shift, Synthetic};

    /// Seeds of the simulations; each is a year of 2000 comparisons a night.
    const SEEDS: Range<u64> = 0..12;

    /// Of planted shifts of Mitsuba's indirect light, one a seed, seen at a level: how many are noticed within so many nights,
    /// and how many of these are dated to within two nights.
    fn found(base: &Synthetic, shift: Shift, level: Level, within: usize) -> (usize, usize) {
        let part = Part {
            case: (level != Level::EngineAndProcedure).then(|| "suite/case-0".to_owned()),
            meter: (level == Level::Comparison).then(|| MeterId::new("workplane", 0)),
        };
        let (mut noticed, mut dated) = (0, 0);
        for seed in SEEDS {
            let shift = Shift { night: 60 + 23 * seed as usize, ..shift };
            let made = Synthetic { seed, shift: Some(shift), nights: shift.night + within, ..base.clone() };
            let is_seen = |c: &Change| c.part == part || c.seen_in.contains(&part);
            let mine = |c: &&Change| is_of_shifted(c) && c.noticed >= shift.night && is_seen(c);
            if let Some(change) = changes(&made.history()).iter().find(mine) {
                noticed += 1;
                dated += usize::from(change.night.abs_diff(shift.night) <= 2);
            }
        }
        (noticed, dated)
    }

    fn is_of_shifted(change: &Change) -> bool {
        change.engine == "mitsuba" && change.procedure == ProcedureId::IndirectIlluminance
    }

    const SEEN: Shift = Shift { night: 0, standard_errors: 2.0, cases: 5, meters: 20 };

    fn all() -> usize {
        SEEDS.count()
    }

    #[test]
    fn a_year_without_change_has_at_most_one_false_alarm_a_month_over_all_series() {
        for common in [0.0, 1.0] {
            let made = |seed| Synthetic { seed, common, ..Synthetic::default() }.history();
            let alarms: usize = SEEDS.map(|seed| changes(&made(seed)).len()).sum();
            let months = 12.0 * all() as f64;
            println!("{alarms} false alarms in {months} months");
            assert!(alarms as f64 <= months, "{alarms} in {months} months");
        }
    }

    #[test]
    fn a_shift_of_all_readings_of_an_engine_or_of_one_case_is_noticed_within_five_nights() {
        for (cases, level) in [(SEEN.cases, Level::EngineAndProcedure), (1, Level::Case)] {
            assert_eq!(found(&Synthetic::default(), Shift { cases, ..SEEN }, level, 5), (all(), all()), "{level:?}");
        }
    }

    #[test]
    fn a_shift_is_mostly_noticed_within_five_nights_where_all_meters_share_their_noise() {
        // Nothing can be averaged away: the group is as uncertain as each of its readings.
        let seen = found(&Synthetic { common: 1.0, ..Synthetic::default() }, SEEN, Level::EngineAndProcedure, 5);
        println!("{seen:?} of {}", all());
        assert!(3 * seen.0 >= 2 * all(), "{seen:?}");
    }

    #[test]
    fn a_shift_of_one_reading_among_two_thousand_is_noticed_half_the_time_within_five_nights_and_soon_otherwise() {
        // One reading in each of five cases, so that no group shows them; how many nights each took, if three weeks at most.
        let mut delays: Vec<Option<usize>> = vec![];
        for seed in SEEDS {
            let shift = Shift { night: 60 + 23 * seed as usize, meters: 1, ..SEEN };
            let made = Synthetic { seed, shift: Some(shift), nights: shift.night + 21, ..Synthetic::default() };
            let found = at_level(&made.history(), Level::Comparison);
            delays.extend((0..shift.cases).map(|case| {
                let case = Some(format!("suite/case-{case}"));
                let part = Part { case, meter: Some(MeterId::new("workplane", 0)) };
                let mine = |c: &&Change| is_of_shifted(c) && c.noticed >= shift.night && c.part == part;
                found.iter().find(mine).map(|change| change.noticed + 1 - shift.night)
            }));
        }
        let within = |nights: usize| delays.iter().flatten().filter(|d| **d <= nights).count();
        println!("within 5, 7, 10, 21 nights: {:?} of {}", [5, 7, 10, 21].map(within), delays.len());
        assert!(20 * within(5) >= 7 * delays.len(), "{delays:?}");
        assert!(10 * within(10) >= 8 * delays.len(), "{delays:?}");
        assert!(20 * within(21) >= 19 * delays.len(), "{delays:?}");
    }

    fn exact(nights: &[f64]) -> Vec<Change> {
        let mut history = Synthetic { nights: nights.len(), cases: 1, meters: 1, ..Synthetic::default() }.history();
        history.series.truncate(1);
        let series = &mut history.series[0];
        series.std_error.fill(0.0);
        series.reference.fill(100.0);
        series.deviation = nights.iter().map(|d| -0.5 + d).collect();
        changes(&history)
    }

    #[test]
    fn an_engine_that_repeats_exactly_changes_where_it_changes_at_all_and_one_bad_night_is_no_change() {
        let mut nights = vec![0.0; 30];
        assert_eq!(exact(&nights), []);
        nights[12] = 3.0;
        assert_eq!(exact(&nights), []);
        nights[20..].fill(1e-3);
        let found = exact(&nights);
        let of_all = |c: &&Change| c.level == Level::EngineAndProcedure;
        let dates: Vec<(usize, usize)> = found.iter().filter(of_all).map(|c| (c.night, c.noticed)).collect();
        assert_eq!(dates, [(20, 21)]);
        nights[12] = 0.0;
        let found = &exact(&nights)[0];
        assert!((found.relative - 1e-5).abs() < 1e-12 && (found.standard_errors - 10.0).abs() < 1e-6, "{found:?}");
    }

    #[test]
    fn nights_without_readings_change_nothing() {
        let mut nights = vec![0.0; 40];
        nights[10..20].fill(f64::NAN);
        assert_eq!(exact(&nights), []);
        nights[25..].fill(-1e-3);
        assert_eq!(exact(&nights)[0].night, 25);
    }
}
