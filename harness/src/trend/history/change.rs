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

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ops::Range;

use strum::VariantArray;

use super::drift::{Line, Trend};
use super::innovation::{Innovation, MAX_SPREADS, MIN_LEARNED, RunningMean, Spread, spread_of_all};
use super::limits::{Limits, REFERENCE_VALUE, WINDOW};
use super::series::{History, Key, Series};
use crate::record::{EngineName, MeterId, ProcedureId};

/// Over all groups of a history together there is at most one false alarm in so many nights, in the mean.
pub const NIGHTS_PER_FALSE_ALARM: f64 = 40.0;
/// One night alone is no change: it takes a sum no further than this share of its limit.
const MAX_OF_ONE_NIGHT: f64 = 0.9;
/// Changes in the same direction of one engine and procedure dated so close together are one change seen several times ...
const SAME_CHANGE: usize = 3;
/// ... and what a single comparison shows so many nights after its group: it needs longer.
const SAME_CHANGE_OF_ONE: usize = 21;
/// So many nights after it is noticed a step may still turn out to be the beginning of a drift.
const SETTLED: usize = 14;

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

/// A deviation that has changed; nights are counted from the first of the history.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    pub level: Level,
    pub engine: EngineName,
    pub procedure: ProcedureId,
    pub part: Part,
    /// The first after the change, by estimate.
    pub night: usize,
    /// That on which it was first told as what it is told as.
    pub noticed: usize,
    pub course: Course,
    /// The cases and comparisons that show the same change by themselves.
    pub seen_in: Vec<Part>,
}

/// How a deviation changed, in the mean over the group.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Course {
    /// From one level to another, where it stayed: in standard errors of a reading, and relative to the reference.
    Step { standard_errors: f64, relative: f64 },
    /// Night after night by as much again, relative to the reference, plus or minus `half_width`; up to a night, or still.
    Drift { a_night: f64, half_width: f64, until: Option<usize> },
}

impl Course {
    const fn is_upwards(self) -> bool {
        match self {
            Self::Step { relative: by, .. } | Self::Drift { a_night: by, .. } => by > 0.0,
        }
    }
}

/// A case of an engine and procedure or one comparison of it; none is all.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Part {
    pub case: Option<String>,
    pub meter: Option<MeterId>,
}

/// The changes of a history, by night and level. What several levels see of one engine and procedure at once is one change;
/// what narrower ones see of a drift is taken out of them.
pub fn changes(history: &History) -> Vec<Change> {
    let (mut found, mut history): (Vec<Change>, _) = (vec![], Cow::Borrowed(history));
    for level in Level::VARIANTS.iter().copied() {
        let here = at_level(&history, level);
        for change in &here {
            if let Course::Drift { until, .. } = change.course {
                let ramp = change.night..until.unwrap_or(history.nights.len());
                let is_in_it = |s: &&mut Series| change.holds(&s.key);
                history.to_mut().series.iter_mut().filter(is_in_it).for_each(|s| level_out(s, &ramp));
            }
        }
        for change in here {
            let same = |c: &&mut Change| {
                let is_one_of_it = change.level == Level::Comparison && c.level < Level::Comparison;
                let after = if is_one_of_it { SAME_CHANGE_OF_ONE } else { SAME_CHANGE };
                let is_then = match change.course {
                    Course::Step { .. } => {
                        (c.night..=c.night + SAME_CHANGE + after).contains(&(change.night + SAME_CHANGE))
                    }
                    // A few uncertain readings may take a step for a drift, whose line then runs across it.
                    Course::Drift { .. } => (change.night..=change.noticed + after).contains(&(c.night + after)),
                };
                (&c.engine, c.procedure) == (&change.engine, change.procedure)
                    && is_then
                    && c.course.is_upwards() == change.course.is_upwards()
            };
            match found.iter_mut().find(same) {
                Some(wider) => wider.seen_in.push(change.part),
                None => found.push(change),
            }
        }
    }
    found.sort_by_key(|a| (a.night, a.level));
    found
}

impl Change {
    fn holds(&self, key: &Key) -> bool {
        (&self.engine, self.procedure) == (&key.reading.engine, key.reading.procedure)
            && self.part.case.as_ref().is_none_or(|case| *case == key.reading.case)
            && self.part.meter.as_ref().is_none_or(|meter| *meter == key.meter)
    }
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
            course: alarm.course,
            seen_in: alarm.seen_in,
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
    course: Course,
    /// Of a drift, the cases that show it by themselves.
    seen_in: Vec<Part>,
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
        let (mut start, mut first_step) = (0, None);
        while let Some((night, noticed)) = self.first_alarm(self.off_the_level(members, start..nights)) {
            let trend = Trend::of(members, start, night, nights);
            // With the step before it, this one may be part of a drift that is too slow for one alone to tell.
            let longer = first_step.map(|(start, night)| Trend::of(members, start, night, nights));
            let told = (noticed..nights.min(noticed + SETTLED)).find_map(|night| {
                let of_two = || longer.as_ref().and_then(|trend| Some((trend, night, trend.drift(night + 1, 2)?)));
                trend.drift(night + 1, 1).map(|drift| (&trend, night, drift)).or_else(of_two)
            });
            if let Some((trend, noticed, drift)) = told {
                found.truncate(found.len() - usize::from(trend.start < start));
                let end = self.first_alarm(trend.off_the_line(&drift, noticed + 1));
                (start, first_step) = (end.map_or(nights, |(_, noticed)| noticed + 1), None);
                let until = end.map(|(night, _)| night);
                let line = trend.line(until.unwrap_or(nights)).unwrap_or(drift);
                let [a_night, half_width] = [line.slope, line.half_width].map(|v| v * trend.relative);
                let night = line.night + 1;
                let shows_it = |members: &[&Series]| {
                    let drift = Trend::of(members, trend.start, night, nights).drift(until.unwrap_or(nights), 1);
                    drift.is_some_and(|own| own.slope * line.slope > 0.0)
                };
                let cases = members.chunk_by(|a, b| a.key.reading.case == b.key.reading.case);
                let cases = cases.filter(|case| case.len() < members.len() && shows_it(case));
                let part = |case: &[&Series]| Part { case: Some(case[0].key.reading.case.clone()), meter: None };
                let (seen_in, course) = (cases.map(part).collect(), Course::Drift { a_night, half_width, until });
                found.push(Alarm { night, noticed, course, seen_in });
            } else {
                (start, first_step) = (noticed + 1, Some((start, night)));
                let moved = trend.step(night..noticed + 1);
                let (standard_errors, relative) = (moved * trend.standard_errors, moved * trend.relative);
                let course = Course::Step { standard_errors, relative };
                found.push(Alarm { night, noticed, course, seen_in: vec![] });
            }
        }
        found
    }

    /// What each night of a segment brings that the mean of the nights before it did not predict, as normal deviates.
    fn off_the_level(&self, members: &[&Series], segment: Range<usize>) -> impl Iterator<Item = (usize, f64)> {
        let mut means = vec![RunningMean::default(); members.len()];
        let mut spread = Spread::default();
        segment.filter_map(move |night| {
            let updates = members.iter().zip(&mut means).filter_map(|(series, mean)| mean.update(series, night));
            let innovation = Innovation::of_group(updates)?;
            let known = self.peers.get(night).map_or(spread, |peers| spread.moderated_by(*peers));
            let is_learning = spread.count < MIN_LEARNED;
            spread.update(innovation);
            (!is_learning).then(|| (night, known.deviate(innovation)))
        })
    }

    /// The night of the first change of a segment, and that on which it is noticed.
    fn first_alarm(&self, nights: impl Iterator<Item = (usize, f64)>) -> Option<(usize, usize)> {
        let most = REFERENCE_VALUE + MAX_OF_ONE_NIGHT * self.limits.sum;
        let mut deviates = vec![];
        let (mut sums, mut zero) = ([0.0_f64; 2], [0; 2]);
        for (night, deviate) in nights {
            let deviate = deviate.clamp(-most, most);
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

/// Takes out of a series the line that it shows itself over the nights of a drift, so that what is left is its own.
fn level_out(series: &mut Series, ramp: &Range<usize>) {
    let along = |night: usize| (night + 1).clamp(ramp.start, ramp.end).saturating_sub(ramp.start) as f64;
    let before = ramp.start.saturating_sub(ramp.len())..ramp.end;
    let points: Vec<_> = before.map(|n| (along(n), series.deviation[n])).filter(|(_, d)| d.is_finite()).collect();
    if let Some(line) = Line::through(&points) {
        series.deviation.iter_mut().enumerate().for_each(|(night, d)| *d -= line.slope * along(night));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engines::fixtures::by_night;
    use crate::trend::history::synthetic::{Drift, Shift, Synthetic};

    /// Seeds of the simulations; each is a year of 2000 comparisons a night.
    fn seeds() -> Range<u64> {
        0..by_night(12, 4)
    }

    /// Of planted shifts of Mitsuba's indirect light, one a seed, seen at a level: how many are noticed within so many nights,
    /// and how many of these are dated to within two nights.
    fn found(base: &Synthetic, shift: Shift, level: Level, within: usize) -> (usize, usize) {
        let part = Part {
            case: (level != Level::EngineAndProcedure).then(|| "suite/case-0".to_owned()),
            meter: (level == Level::Comparison).then(|| MeterId::new("workplane", 0)),
        };
        let (mut noticed, mut dated) = (0, 0);
        for seed in seeds() {
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
        seeds().count()
    }

    #[test]
    fn three_hundred_nights_without_change_have_at_most_ten_alarms_over_all_series() {
        // Other seeds than the limits and the evidence of drifts were chosen with.
        let of = |first: u64, night: u64| first..first + by_night(night, night / 4);
        for (common, seeds) in [(0.0, of(1000, 16)), (1.0, of(2000, 8))] {
            let made = |seed| Synthetic { seed, common, nights: 300, ..Synthetic::default() }.history();
            let alarms: Vec<usize> = seeds.map(|seed| changes(&made(seed)).len()).collect();
            println!("{alarms:?} false alarms");
            assert!(alarms.iter().all(|count| *count <= 10), "{alarms:?}");
            // In the mean as many as promised.
            let nights = 300.0 * alarms.len() as f64;
            assert!(alarms.iter().sum::<usize>() as f64 <= nights / NIGHTS_PER_FALSE_ALARM * 1.3, "{alarms:?}");
        }
    }

    /// Of Mitsuba's indirect light, since a night: the changes that are told so many nights after a planted one.
    fn told(base: &Synthetic, since: usize) -> Vec<Change> {
        let is_mine = |c: &Change| is_of_shifted(c) && c.noticed >= since;
        changes(&base.history()).into_iter().filter(is_mine).collect()
    }

    #[test]
    fn a_drift_of_a_twentieth_of_a_percent_a_night_is_told_as_one_within_ten_nights_with_its_slope() {
        const A_NIGHT: f64 = 5e-4;
        let (mut as_drift, mut as_it_is, mut further) = (0, 0, 0);
        let seeds = 100..by_night(112, 106);
        for seed in seeds.clone() {
            let first = 60 + 7 * (seed as usize % 20);
            let drift = Some(Drift { nights: (first, usize::MAX), a_night: A_NIGHT, cases: 5 });
            let found = told(&Synthetic { seed, nights: first + 10, drift, ..Synthetic::default() }, first);
            let is_it = |c: &Change| match c.course {
                Course::Drift { a_night, half_width, until: None } => Some((a_night - A_NIGHT).abs() <= half_width),
                Course::Drift { .. } | Course::Step { .. } => None,
            };
            let [one] = &found[..] else {
                further += 1;
                continue;
            };
            as_drift += usize::from(is_it(one).is_some() && one.level == Level::EngineAndProcedure);
            as_it_is +=
                usize::from(is_it(one) == Some(true) && one.night.abs_diff(first) <= 2 && one.seen_in.len() == 5);
        }
        println!(
            "{as_drift} told as a drift and nothing else, {as_it_is} with slope, date and cases, {further} as more"
        );
        let all = seeds.count();
        assert!(12 * as_drift >= 11 * all && 12 * as_it_is >= 10 * all, "{as_drift} {as_it_is} {further}");
    }

    #[test]
    fn a_drift_that_ends_is_one_drift_with_both_dates_and_a_step_is_none() {
        let (mut ended, mut steps) = (0, 0);
        for seed in seeds() {
            let nights = (80, 110);
            let drift = Some(Drift { nights, a_night: 5e-4, cases: 5 });
            let found = told(&Synthetic { seed, nights: 160, drift, ..Synthetic::default() }, nights.0);
            let is_it = |c: &Change| {
                let Course::Drift { until: Some(end), .. } = c.course else { return false };
                c.night.abs_diff(nights.0) <= 2 && end.abs_diff(nights.1) <= 2
            };
            ended += usize::from(found.iter().any(is_it));
            let shift = Some(Shift { night: 80, ..SEEN });
            let found = told(&Synthetic { seed, nights: 110, shift, ..Synthetic::default() }, 80);
            let is_step = |c: &Change| matches!(c.course, Course::Step { .. }) && c.night.abs_diff(80) <= 2;
            let is_drift = |c: &Change| matches!(c.course, Course::Drift { .. });
            steps += usize::from(found.iter().any(is_step) && !found.iter().any(is_drift));
        }
        println!("{ended} drifts with both dates, {steps} steps told as steps alone, of {}", all());
        assert!(12 * ended >= 11 * all() && 12 * steps >= 11 * all(), "{ended} {steps}");
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
        // One reading in each of five cases, so that no group shows them; how many nights each took, if three weeks at most. Of much
        // fewer readings parts would say nothing.
        let mut delays: Vec<Option<usize>> = vec![];
        for seed in 0..by_night(12, 6) {
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
        assert!(
            matches!(found.course, Course::Step { standard_errors, relative }
            if (relative - 1e-5).abs() < 1e-12 && (standard_errors - 10.0).abs() < 1e-6),
            "{found:?}"
        );
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
