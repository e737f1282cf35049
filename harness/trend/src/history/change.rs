//! Change points: sums over nights of the deviations that the nights before did not predict.
//!
//! The method is Page's (Continuous inspection schemes, Biometrika 41 (1954)) in Hawkins' self-starting form (Self-starting Cusum
//! charts for location and scale, The Statistician 36 (1987)). The mean of the nights before predicts each night. So neither the
//! true deviation nor its spread must be known, and no night counts twice.
//!
//! A series' innovation is its deviation less the mean of the nights before, in standard errors, times sqrt(n / (n + 1)). A group's
//! innovation is the sum over its series, over the square root of their number. Divided by its spread over the nights before it is
//! Student's t. That is converted to the normal deviate U (Wallace, Bounds on normal approximations to Student's and the chi-square
//! distributions, Ann. Math. Statist. 30 (1959)). The spread is moderated (Smyth, Linear models and empirical Bayes methods, Stat.
//! Appl. Genet. Mol. Biol. 3 (2004)): that of a comparison by its case, that of a group by what stated errors and the scatter among
//! its meters let expect. So the third night is judged already. Where noise has heavy tails, U is at most what the rank of the
//! innovation among those before allows (sequential normal scores: Conover, Tercero-Gomez and Cordero-Franco, Qual. Eng. 29 (2017)).
//!
//! Two statistics are watched, each with its share of the false alarms. The sums S = max(0, S +- U - 1) are quickest in the mean for
//! a shift of two standard errors. The sum of the last five nights most often finds such a shift within five nights. The change is
//! dated to the night that makes the later deviates most likely. Candidates are the nights since the sum was zero, or the five.
//! [`super::monitor`] has what happens with single nights and after a change.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ops::Range;

use strum::VariantArray;

use super::drift::StraightLine;
use super::innovation::{Noise, expected_noise, noise_of_comparisons};
use super::limits::Limits;
use super::monitor::{Alarm, GroupMonitor};
use super::series::{History, Key, Series};
use luxproof_model::{EngineName, MeterId, ProcedureId};

/// All groups of a history together have at most one false alarm in so many nights, in the mean.
pub const NIGHTS_PER_FALSE_ALARM: f64 = 60.0;
/// The limits are set for so many nights, because a false alarm is followed by others more often than chance has it.
const DESIGN_NIGHTS: f64 = 75.0;
/// Changes of one engine and procedure in the same direction are the same if at most so many nights lie between their dates.
const SAME_CHANGE_NIGHTS: usize = 3;
/// A single comparison may show the change of its group so many nights later, since it needs longer.
const SAME_COMPARISON_NIGHTS: usize = 21;

/// How many series are judged together.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, VariantArray)]
pub enum Level {
    EngineAndProcedure,
    Case,
    Comparison,
}

impl Level {
    /// The level's share of the false alarms.
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
    /// The estimated first night after the change.
    pub night: usize,
    /// The night on which the change was first recognised as a step or a drift.
    pub noticed: usize,
    pub course: Course,
    /// The cases and comparisons that show the same change independently.
    pub seen_in: Vec<Part>,
}

/// How a deviation changed, in the mean over the group.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Course {
    /// A change from one level to another: in standard errors of a reading, and relative to the reference.
    Step { standard_errors: f64, relative: f64 },
    /// The same change every night, relative to the reference, plus or minus `half_width`. It ends at `until`, or continues.
    Drift { a_night: f64, half_width: f64, until: Option<usize> },
    /// One night unlike those before and after, in the units of a step. The last night may turn out to be a step.
    Outlier { standard_errors: f64, relative: f64 },
}

impl Course {
    const fn is_upwards(self) -> bool {
        match self {
            Self::Step { standard_errors: by, .. }
            | Self::Outlier { standard_errors: by, .. }
            | Self::Drift { a_night: by, .. } => by > 0.0,
        }
    }
}

/// A case of an engine and procedure, or one comparison of it; all cases where both are `None`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Part {
    pub case: Option<String>,
    pub meter: Option<MeterId>,
}

/// Finds the changes of a history, sorted by night and level.
///
/// Changes that several levels show at once are one change. A drift is removed from the series before narrower levels are judged.
pub fn changes(history: &History) -> Vec<Change> {
    let (mut found, mut history): (Vec<Change>, _) = (vec![], Cow::Borrowed(history));
    for level in Level::VARIANTS.iter().copied() {
        let of_level = changes_at_level(&history, level);
        for change in &of_level {
            if let Course::Drift { until, .. } = change.course {
                let ramp = change.night..until.unwrap_or(history.nights.len());
                let drifting = history.to_mut().series.iter_mut().filter(|s| change.includes(&s.key));
                drifting.for_each(|series| remove_ramp(series, &ramp));
            }
        }
        for change in of_level {
            match found.iter_mut().find(|earlier| is_same_change(earlier, &change)) {
                Some(wider) => wider.seen_in.push(change.part),
                None => found.push(change),
            }
        }
    }
    found.sort_by_key(|change| (change.night, change.level));
    found
}

/// Whether a change shows an earlier found one again.
fn is_same_change(earlier: &Change, change: &Change) -> bool {
    let is_outlier = [earlier, change].map(|c| matches!(c.course, Course::Outlier { .. }));
    let is_slow = change.level == Level::Comparison && earlier.level < Level::Comparison;
    let after = if is_slow { SAME_COMPARISON_NIGHTS } else { SAME_CHANGE_NIGHTS };
    let is_at_same_time = match change.course {
        _ if is_outlier[0] => is_outlier[1] && earlier.night == change.night,
        Course::Step { .. } | Course::Outlier { .. } => {
            (earlier.night..=earlier.night + SAME_CHANGE_NIGHTS + after).contains(&(change.night + SAME_CHANGE_NIGHTS))
        }
        // With few uncertain readings a step may look like a drift with a line that crosses the step.
        Course::Drift { .. } => (change.night..=change.noticed + after).contains(&(earlier.night + after)),
    };
    (&earlier.engine, earlier.procedure) == (&change.engine, change.procedure)
        && is_at_same_time
        && earlier.course.is_upwards() == change.course.is_upwards()
}

impl Change {
    /// Whether a series belongs to the group that changed.
    fn includes(&self, key: &Key) -> bool {
        (&self.engine, self.procedure) == (&key.reading.engine, key.reading.procedure)
            && self.part.case.as_ref().is_none_or(|case| *case == key.reading.case)
            && self.part.meter.as_ref().is_none_or(|meter| *meter == key.meter)
    }
}

/// The changes of all groups at one level.
fn changes_at_level(history: &History, level: Level) -> Vec<Change> {
    let mut groups: BTreeMap<(Case<'_>, usize), Vec<&Series>> = BTreeMap::new();
    for (k, series) in history.series.iter().enumerate() {
        let (engine, procedure, case) = case_of(series);
        let case = if level == Level::EngineAndProcedure { "" } else { case };
        let number = if level == Level::Comparison { k } else { 0 };
        groups.entry(((engine, procedure, case), number)).or_default().push(series);
    }
    let limits = Limits::for_nights(nights_per_alarm(level, groups.len()));
    let of_cases = if level == Level::Comparison { noise_by_case(history) } else { BTreeMap::new() };
    let mut found = vec![];
    for ((case_key @ (engine, procedure, case), _), members) in groups {
        let part = Part {
            case: (level != Level::EngineAndProcedure).then(|| case.to_owned()),
            meter: (level == Level::Comparison).then(|| members[0].key.meter.clone()),
        };
        let nights = history.nights.len();
        let of_group = if level == Level::Comparison { vec![] } else { expected_noise(&members, nights) };
        let monitor = GroupMonitor { limits, expected: of_cases.get(&case_key).unwrap_or(&of_group) };
        for Alarm { night, noticed, course, seen_in } in monitor.alarms(&members, nights) {
            let (engine, part) = (engine.clone(), part.clone());
            found.push(Change { level, engine, procedure, part, night, noticed, course, seen_in });
        }
    }
    found
}

/// The nights between false alarms of each of so many groups, so that the level as a whole has its share.
fn nights_per_alarm(level: Level, groups: usize) -> f64 {
    groups as f64 * DESIGN_NIGHTS / level.share()
}

/// An engine, a procedure and a case.
type Case<'h> = (&'h EngineName, ProcedureId, &'h str);

fn case_of(series: &Series) -> Case<'_> {
    let reading = &series.key.reading;
    (&reading.engine, reading.procedure, &reading.case)
}

/// The noise that all comparisons of a case show together before each night.
fn noise_by_case(history: &History) -> BTreeMap<Case<'_>, Vec<Noise>> {
    let mut cases: BTreeMap<_, Vec<&Series>> = BTreeMap::new();
    for series in &history.series {
        cases.entry(case_of(series)).or_default().push(series);
    }
    cases.into_iter().map(|(case, members)| (case, noise_of_comparisons(&members, history.nights.len()))).collect()
}

/// Removes a drift from a series, by the line that the series shows over the nights of the drift.
fn remove_ramp(series: &mut Series, ramp: &Range<usize>) {
    // As many nights before the drift show the level.
    let fitted = ramp.start.saturating_sub(ramp.len())..ramp.end;
    let points: Vec<(f64, f64)> = fitted
        .map(|night| (nights_of_ramp(ramp, night), series.deviation[night]))
        .filter(|(_, deviation)| deviation.is_finite())
        .collect();
    if let Some(line) = StraightLine::through(&points) {
        for (night, deviation) in series.deviation.iter_mut().enumerate() {
            *deviation -= line.slope * nights_of_ramp(ramp, night);
        }
    }
}

/// How many nights of a drift have passed on a night.
fn nights_of_ramp(ramp: &Range<usize>, night: usize) -> f64 {
    (night + 1).clamp(ramp.start, ramp.end).saturating_sub(ramp.start) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::history::synthetic::{Distribution, Drift, Shift, Synthetic, is_near, series};
    use luxproof_engines::fixtures::by_night;

    fn step(standard_errors: f64) -> Course {
        Course::Step { standard_errors, relative: 0.01 * standard_errors }
    }

    fn outlier(standard_errors: f64) -> Course {
        Course::Outlier { standard_errors, relative: 0.01 * standard_errors }
    }

    fn drift(a_night: f64) -> Course {
        Course::Drift { a_night, half_width: 1e-4, until: None }
    }

    /// A change of Mitsuba's indirect light.
    fn change(level: Level, night: usize, noticed: usize, course: Course) -> Change {
        let (procedure, part) = (ProcedureId::IndirectIlluminance, Part::default());
        Change { level, engine: "mitsuba".into(), procedure, part, night, noticed, course, seen_in: vec![] }
    }

    #[test]
    fn a_course_goes_upwards_where_its_size_is_positive() {
        for (size, is_upwards) in [(0.5, true), (-0.5, false), (0.0, false)] {
            let courses = [step(size), outlier(size), drift(size)];
            assert_eq!(courses.map(Course::is_upwards), [is_upwards; 3], "{size}");
        }
    }

    #[test]
    fn the_shares_of_the_false_alarms_add_up_to_all() {
        let shares: Vec<f64> = Level::VARIANTS.iter().map(|level| level.share()).collect();
        assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-12 && shares.iter().all(|share| *share > 0.0));
        // 14 * 75 / .7 and 2 * 75 / .05.
        assert!((nights_per_alarm(Level::Comparison, 14) - 1500.0).abs() < 1e-9);
        assert!((nights_per_alarm(Level::Case, 2) - 3000.0).abs() < 1e-9);
    }

    /// A change of a wide group, noticed one night later.
    fn of_all(night: usize, course: Course) -> Change {
        change(Level::EngineAndProcedure, night, night + 1, course)
    }

    /// A change of a case, noticed eight nights later.
    fn of_case(night: usize, course: Course) -> Change {
        change(Level::Case, night, night + 8, course)
    }

    /// Likewise of a single comparison.
    fn of_comparison(night: usize, course: Course) -> Change {
        change(Level::Comparison, night, night + 8, course)
    }

    #[test]
    fn a_change_of_a_narrower_group_is_the_same_if_it_comes_with_that_of_the_wider_one() {
        let (up, down) = (step(3.0), step(-3.0));
        for (earlier, later, is_same) in [
            // A step of a case may come three nights before or after, and that of a comparison 21 after.
            (of_all(50, up), of_case(47, up), true),
            (of_all(50, up), of_case(46, up), false),
            (of_all(50, up), of_case(53, up), true),
            (of_all(50, up), of_case(54, up), false),
            (of_all(50, up), of_comparison(47, up), true),
            (of_all(50, up), of_comparison(46, up), false),
            (of_all(50, up), of_comparison(71, up), true),
            (of_all(50, up), of_comparison(72, up), false),
            (of_case(50, up), of_comparison(71, up), true),
            // Two comparisons need equally long.
            (of_comparison(50, up), of_comparison(53, up), true),
            (of_comparison(50, up), of_comparison(54, up), false),
            // The first nights have none before them.
            (of_all(2, up), of_case(0, up), true),
            (of_all(50, up), of_case(50, down), false),
            (of_all(50, down), of_case(50, down), true),
            // A drift is noticed eight nights after its first night. It may look like a step between.
            (of_all(50, up), of_case(53, drift(0.1)), true),
            (of_all(50, up), of_case(54, drift(0.1)), false),
            (of_all(50, up), of_case(42, drift(0.1)), true),
            (of_all(50, up), of_case(41, drift(0.1)), false),
            (of_all(50, up), of_comparison(71, drift(0.1)), true),
            (of_all(50, up), of_comparison(72, drift(0.1)), false),
            (of_all(50, drift(0.1)), of_case(52, up), true),
            (of_all(50, drift(0.1)), of_case(52, down), false),
            // An outlier is that of the same night alone.
            (of_all(50, outlier(3.0)), of_case(50, outlier(3.0)), true),
            (of_all(50, outlier(3.0)), of_case(51, outlier(3.0)), false),
            (of_all(50, outlier(3.0)), of_case(50, up), false),
            (of_all(50, outlier(3.0)), of_case(50, outlier(-3.0)), false),
            (of_all(50, up), of_case(51, outlier(3.0)), true),
        ] {
            assert_eq!(is_same_change(&earlier, &later), is_same, "{earlier:?} {later:?}");
        }
        let of_other_engine = Change { engine: "radiance".into(), ..of_case(50, up) };
        let of_other_procedure = Change { procedure: ProcedureId::TotalIlluminance, ..of_case(50, up) };
        for other in [of_other_engine, of_other_procedure] {
            assert!(!is_same_change(&of_all(50, up), &other), "{other:?}");
        }
    }

    #[test]
    fn a_change_includes_the_series_of_its_engine_procedure_case_and_meter() {
        let key = series(100.0, &[1.0], &[0.0]).key;
        let (case, meter) = (Some("room".to_owned()), Some(MeterId::new("desk", 0)));
        let (other_case, other_meter) = (Some("hall".to_owned()), Some(MeterId::new("desk", 1)));
        for (case, meter, is_included) in [
            (None, None, true),
            (case.clone(), None, true),
            (case.clone(), meter.clone(), true),
            (other_case.clone(), None, false),
            (other_case, meter, false),
            (case, other_meter, false),
        ] {
            let part = Part { case, meter };
            let change = Change { engine: "mine".into(), part, ..change(Level::Comparison, 5, 6, step(1.0)) };
            assert_eq!(change.includes(&key), is_included, "{change:?}");
        }
        let of_other_engine = of_all(5, step(1.0));
        let procedure = ProcedureId::TotalIlluminance;
        let of_other_procedure = Change { engine: "mine".into(), procedure, ..of_all(5, step(1.0)) };
        assert!(!of_other_engine.includes(&key) && !of_other_procedure.includes(&key));
    }

    #[test]
    fn a_ramp_grows_on_its_nights_alone() {
        let passed: Vec<f64> = (0..8).map(|night| nights_of_ramp(&(3..6), night)).collect();
        assert_eq!(passed, [0.0, 0.0, 0.0, 1.0, 2.0, 3.0, 3.0, 3.0]);
    }

    #[test]
    fn a_drift_is_removed_by_the_line_over_its_nights_and_as_many_before() {
        // Nights 4 to 6 drift by 0.5 each; nights 1 to 3 give the level of 2. Others do not count for the line.
        let deviation = [9.0, 2.0, f64::NAN, 2.0, 2.5, 3.0, 3.5, 3.5, 8.0];
        let mut drifting = series(100.0, &[1.0; 9], &deviation);
        remove_ramp(&mut drifting, &(4..7));
        let left = drifting.deviation;
        assert!(left[2].is_nan(), "{left:?}");
        for (night, expected) in [(0, 9.0), (1, 2.0), (3, 2.0), (4, 2.0), (5, 2.0), (6, 2.0), (7, 2.0), (8, 6.5)] {
            assert!(is_near(left[night], expected), "{night}: {left:?}");
        }
        // Without readings there is no line.
        let mut dark = series(100.0, &[1.0; 3], &[f64::NAN, f64::NAN, 7.0]);
        remove_ramp(&mut dark, &(1..2));
        assert_eq!(dark.deviation[2], 7.0);
    }

    /// A history of two cases with two meters each, of which some change by this on night 20.
    fn with_changed_meters(is_changed: impl Fn(&Key) -> bool) -> History {
        let mut made = vec![];
        for (case, meter) in [("a", 0), ("a", 1), ("b", 0), ("b", 1)] {
            let mut one = series(100.0, &[1.0; 40], &[0.0; 40]);
            (one.key.reading.case, one.key.meter) = (case.to_owned(), MeterId::new("desk", meter));
            let by = if is_changed(&one.key) { 20.0 } else { 0.0 };
            for (night, deviation) in one.deviation.iter_mut().enumerate() {
                *deviation = if night.is_multiple_of(2) { 1.0 } else { -1.0 } + if night < 20 { 0.0 } else { by };
            }
            made.push(one);
        }
        History { nights: vec![String::new(); 40], series: made, ..History::default() }
    }

    fn part(case: &str, meter: Option<usize>) -> Part {
        Part { case: Some(case.to_owned()), meter: meter.map(|k| MeterId::new("desk", k)) }
    }

    #[test]
    fn each_level_names_the_groups_that_changed() {
        let history = with_changed_meters(|key| key.reading.case == "b");
        for (level, parts) in [
            (Level::EngineAndProcedure, vec![Part::default()]),
            (Level::Case, vec![part("b", None)]),
            (Level::Comparison, vec![part("b", Some(0)), part("b", Some(1))]),
        ] {
            let found = changes_at_level(&history, level);
            assert_eq!(found.iter().map(|c| c.part.clone()).collect::<Vec<_>>(), parts, "{level:?}: {found:?}");
            assert!(found.iter().all(|c| (c.level, c.night, c.noticed) == (level, 20, 21)), "{found:?}");
        }
        // All levels together show one change, and where it was seen.
        let all = changes(&history);
        let [Change { level: Level::EngineAndProcedure, seen_in, .. }] = &all[..] else { panic!("{all:?}") };
        assert_eq!(*seen_in, [part("b", None), part("b", Some(0)), part("b", Some(1))]);
    }

    #[test]
    fn comparisons_share_the_noise_of_their_case() {
        let history = with_changed_meters(|_| false);
        let noise = noise_by_case(&history);
        let cases: Vec<(&str, usize)> = noise.iter().map(|((_, _, case), nights)| (*case, nights.len())).collect();
        assert_eq!(cases, [("a", 40), ("b", 40)]);
    }

    /// Seeds of the simulations; each is a year of 2000 comparisons a night.
    fn seeds() -> Range<u64> {
        0..by_night(12, 4)
    }

    /// Plants a shift of Mitsuba's indirect light for each seed, and counts those that a level shows within so many nights.
    ///
    /// The second count is that of shifts that are dated to within two nights.
    fn count_found(base: &Synthetic, shift: Shift, level: Level, within: usize) -> (usize, usize) {
        let part = Part {
            case: (level != Level::EngineAndProcedure).then(|| "suite/case-0".to_owned()),
            meter: (level == Level::Comparison).then(|| MeterId::new("workplane", 0)),
        };
        let (mut noticed, mut dated) = (0, 0);
        for seed in seeds() {
            let shift = Shift { night: 60 + 23 * seed as usize, ..shift };
            let made = Synthetic { seed, shift: Some(shift), nights: shift.night + within, ..base.clone() };
            let found = changes_since(&made, shift.night);
            if let Some(change) = found.iter().find(|c| c.part == part || c.seen_in.contains(&part)) {
                noticed += 1;
                dated += usize::from(change.night.abs_diff(shift.night) <= 2);
            }
        }
        (noticed, dated)
    }

    fn is_of_shifted(change: &Change) -> bool {
        change.engine == "mitsuba" && change.procedure == ProcedureId::IndirectIlluminance
    }

    const PLANTED: Shift = Shift { night: 0, until: usize::MAX, standard_errors: 2.0, cases: 5, meters: 20 };

    fn all() -> usize {
        seeds().count()
    }

    #[test]
    fn three_hundred_nights_without_change_have_at_most_ten_alarms_over_all_series() {
        // Other seeds than the limits and the evidence of drifts were chosen with.
        for (common, first, seeds) in [(0.0, 1000, by_night(16, 4)), (1.0, 2000, by_night(8, 2))] {
            let mut alarms: Vec<usize> = vec![];
            for seed in first..first + seeds {
                let made = Synthetic { seed, common, nights: 300, ..Synthetic::default() };
                alarms.push(changes(&made.history()).len());
            }
            println!("{alarms:?} false alarms");
            assert!(alarms.iter().all(|count| *count <= 10), "{alarms:?}");
            // In the mean as many as promised.
            let nights = 300.0 * alarms.len() as f64;
            assert!(alarms.iter().sum::<usize>() as f64 <= nights / NIGHTS_PER_FALSE_ALARM * 1.3, "{alarms:?}");
        }
    }

    /// Of Mitsuba's indirect light: the changes that are noticed so many nights after a planted one.
    fn changes_since(base: &Synthetic, since: usize) -> Vec<Change> {
        changes(&base.history()).into_iter().filter(|c| is_of_shifted(c) && c.noticed >= since).collect()
    }

    #[test]
    fn a_drift_of_a_twentieth_of_a_percent_a_night_is_recognised_within_ten_nights_with_its_slope() {
        const A_NIGHT: f64 = 5e-4;
        let (mut as_drift, mut as_it_is, mut further) = (0, 0, 0);
        let seeds = 100..by_night(112, 106);
        for seed in seeds.clone() {
            let first = 60 + 7 * (seed as usize % 20);
            let drift = Some(Drift { nights: (first, usize::MAX), a_night: A_NIGHT, cases: 5 });
            let found = changes_since(&Synthetic { seed, nights: first + 10, drift, ..Synthetic::default() }, first);
            let [change] = &found[..] else {
                further += 1;
                continue;
            };
            if let Course::Drift { a_night, half_width, until: None } = change.course {
                let is_slope_right = (a_night - A_NIGHT).abs() <= half_width;
                let is_date_right = change.night.abs_diff(first) <= 2;
                as_drift += usize::from(change.level == Level::EngineAndProcedure);
                as_it_is += usize::from(is_slope_right && is_date_right && change.seen_in.len() == 5);
            }
        }
        println!(
            "{as_drift} found as a drift and nothing else, {as_it_is} with slope, date and cases, {further} as more"
        );
        let all = seeds.count();
        assert!(12 * as_drift >= 11 * all && 12 * as_it_is >= 10 * all, "{as_drift} {as_it_is} {further}");
    }

    /// Whether a change is a drift with these first and last nights, each to within two nights.
    fn is_drift_of(change: &Change, (first, last): (usize, usize)) -> bool {
        let Course::Drift { until: Some(end), .. } = change.course else { return false };
        change.night.abs_diff(first) <= 2 && end.abs_diff(last) <= 2
    }

    #[test]
    fn a_drift_that_ends_is_one_drift_with_both_dates_and_a_step_is_none() {
        let (mut ended, mut steps) = (0, 0);
        for seed in seeds() {
            let nights = (80, 110);
            let drift = Some(Drift { nights, a_night: 5e-4, cases: 5 });
            let found = changes_since(&Synthetic { seed, nights: 160, drift, ..Synthetic::default() }, nights.0);
            ended += usize::from(found.iter().any(|c| is_drift_of(c, nights)));
            let shift = Some(Shift { night: 80, ..PLANTED });
            let found = changes_since(&Synthetic { seed, nights: 110, shift, ..Synthetic::default() }, 80);
            let has_drift = found.iter().any(|c| matches!(c.course, Course::Drift { .. }));
            let mut dated = found.iter().filter(|c| c.night.abs_diff(80) <= 2);
            let has_step = dated.any(|c| matches!(c.course, Course::Step { .. }));
            steps += usize::from(has_step && !has_drift);
        }
        println!("{ended} drifts with both dates, {steps} steps found as steps alone, of {}", all());
        assert!(12 * ended >= 11 * all() && 12 * steps >= 11 * all(), "{ended} {steps}");
    }

    #[test]
    fn a_shift_of_all_readings_of_an_engine_or_of_one_case_is_noticed_within_five_nights() {
        for (cases, level) in [(PLANTED.cases, Level::EngineAndProcedure), (1, Level::Case)] {
            assert_eq!(
                count_found(&Synthetic::default(), Shift { cases, ..PLANTED }, level, 5),
                (all(), all()),
                "{level:?}"
            );
        }
    }

    #[test]
    fn a_shift_is_mostly_noticed_within_five_nights_where_all_meters_share_their_noise() {
        // Nothing can be averaged away: the group is as uncertain as each of its readings.
        let seen =
            count_found(&Synthetic { common: 1.0, ..Synthetic::default() }, PLANTED, Level::EngineAndProcedure, 5);
        println!("{seen:?} of {}", all());
        assert!(3 * seen.0 >= 2 * all(), "{seen:?}");
    }

    #[test]
    fn a_shift_of_one_reading_among_two_thousand_is_noticed_half_the_time_within_five_nights_and_soon_otherwise() {
        // One reading in each of five cases, so that no group shows them, with the nights until each is noticed, at most three weeks.
        // Of much fewer readings the shares would mean nothing.
        let mut delays: Vec<Option<usize>> = vec![];
        for seed in 0..by_night(12, 6) {
            let shift = Shift { night: 60 + 23 * seed as usize, meters: 1, ..PLANTED };
            let made = Synthetic { seed, shift: Some(shift), nights: shift.night + 21, ..Synthetic::default() };
            let found = changes_at_level(&made.history(), Level::Comparison);
            for case in 0..shift.cases {
                let case = Some(format!("suite/case-{case}"));
                let part = Part { case, meter: Some(MeterId::new("workplane", 0)) };
                let mut of_part = found.iter().filter(|c| is_of_shifted(c) && c.part == part);
                let change = of_part.find(|c| c.noticed >= shift.night);
                delays.push(change.map(|change| change.noticed + 1 - shift.night));
            }
        }
        let within = [5, 10, 21].map(|nights| delays.iter().flatten().filter(|delay| **delay <= nights).count());
        println!("within 5, 10, 21 nights: {within:?} of {}", delays.len());
        assert!(20 * within[0] >= 7 * delays.len(), "{delays:?}");
        assert!(10 * within[1] >= 8 * delays.len(), "{delays:?}");
        assert!(20 * within[2] >= 19 * delays.len(), "{delays:?}");
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
        let found = exact(&nights);
        assert!(matches!(&found[..], [Change { night: 12, course: Course::Outlier { .. }, .. }]), "{found:?}");
        nights[20..].fill(1e-3);
        let found = exact(&nights);
        let of_all = found.iter().filter(|c| c.level == Level::EngineAndProcedure && c.night != 12);
        let dates: Vec<(usize, usize)> = of_all.map(|c| (c.night, c.noticed)).collect();
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
    fn an_engine_that_repeats_exactly_changes_on_any_night_from_the_third_on_and_back() {
        for first in 2..7 {
            let mut nights = [0.0; 16];
            nights[first..12].fill(0.5);
            for seen in [first + 2, 16] {
                let found = exact(&nights[..seen]);
                let of_all = found.iter().filter(|c| c.level == Level::EngineAndProcedure);
                let dates: Vec<(usize, usize, bool)> =
                    of_all.map(|c| (c.night, c.noticed, matches!(c.course, Course::Step { .. }))).collect();
                let expected = [(first, first + 1, true), (12, 13, true)];
                assert_eq!(dates, &expected[..if seen == 16 { 2 } else { 1 }], "{first} {seen}: {found:?}");
            }
        }
    }

    #[test]
    fn a_reading_where_the_reference_is_zero_changes_by_a_number() {
        let mut history = Synthetic { nights: 30, cases: 1, meters: 1, ..Synthetic::default() }.history();
        history.series.truncate(1);
        let series = &mut history.series[0];
        series.std_error.fill(0.0);
        series.reference.fill(0.0);
        series.deviation = (0..30).map(|night| if night < 20 { 0.0 } else { 5.0 }).collect();
        let found = changes(&history);
        assert_eq!(found[0].night, 20);
        let words = crate::history::in_words(&history, &found[0]);
        assert!(!words.contains("NaN") && words.contains("changed by +1000000.0 standard errors"), "{words}");
    }

    #[test]
    fn nights_without_readings_change_nothing() {
        let mut nights = vec![0.0; 40];
        nights[10..20].fill(f64::NAN);
        assert_eq!(exact(&nights), []);
        nights[25..].fill(-1e-3);
        assert_eq!(exact(&nights)[0].night, 25);
    }
    #[test]
    fn a_step_of_one_standard_error_is_found_within_five_nights_from_the_third_night_on_and_so_is_its_return() {
        let base = Synthetic { cases: 2, ..Synthetic::default() };
        let all = by_night(20, 4) as usize;
        for (night, lasts) in [(2, 40), (3, 40), (5, 40), (30, 3), (30, 5), (30, 8)] {
            let (mut steps, mut returns) = (0, 0);
            for seed in 0..all as u64 {
                let until = night + lasts;
                let shift = Some(Shift { night, until, standard_errors: 1.0, ..PLANTED });
                let made = Synthetic { seed: 300 + seed, shift, nights: until + 5, ..base.clone() };
                let found = changes_since(&made, night);
                let mut steps_found = found.iter().filter(|c| matches!(c.course, Course::Step { .. }));
                let is_step = |c: &&Change| c.course.is_upwards() && c.noticed < night + 5;
                steps += usize::from(steps_found.clone().any(|c| is_step(&c)));
                returns += usize::from(steps_found.any(|c| !c.course.is_upwards() && c.noticed >= until));
            }
            println!("from night {}, for {lasts}: {steps} steps and {returns} returns of {all}", night + 1);
            assert!(all - steps <= 1 && all - returns <= 1, "{night} {lasts}: {steps} {returns} of {all}");
        }
    }

    #[test]
    fn one_different_night_is_an_outlier_and_no_change() {
        let base = Synthetic { cases: 2, ..Synthetic::default() };
        let all = by_night(20, 4) as usize;
        for (night, standard_errors) in [(2, 5.0), (4, 5.0), (40, 5.0), (40, -5.0), (40, 20.0), (40, 2.0)] {
            let mut named = 0;
            for seed in 0..all as u64 {
                let shift = Some(Shift { night, until: night + 1, standard_errors, ..PLANTED });
                let made = Synthetic { seed: 400 + seed, shift, nights: night + 12, ..base.clone() };
                let found = changes_since(&made, night);
                let is_named =
                    matches!(&found[..], [Change { night: at, course: Course::Outlier { .. }, .. }] if *at == night);
                named += usize::from(is_named);
            }
            println!("night {} by {standard_errors}: {named} of {all}", night + 1);
            assert!(all - named <= 1, "{night} {standard_errors}: {named} of {all}");
        }
    }

    #[test]
    fn skewed_and_heavy_tailed_noise_has_no_more_false_alarms_than_normal_noise() {
        let nights = by_night(1000, 120) as usize;
        for distribution in [Distribution::Normal, Distribution::Skewed, Distribution::HeavyTailed] {
            let made = Synthetic { seed: 77, nights, cases: 2, distribution, ..Synthetic::default() };
            let found = changes(&made.history());
            println!("{distribution:?}: {} in {nights} nights", found.len());
            // Twice the standard deviation of Poisson's distribution above the promise.
            let promised = nights as f64 / NIGHTS_PER_FALSE_ALARM;
            assert!(found.len() as f64 <= promised + 2.0 * promised.sqrt(), "{distribution:?}");
        }
    }
}
