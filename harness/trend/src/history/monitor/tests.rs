use super::*;
use crate::history::synthetic::{is_near, series};

/// Limits that neither the moving sum nor single nights reach.
fn sum_alone(sum: f64) -> Limits {
    Limits { sum, window: 100.0, night: 100.0 }
}

/// The estimated night and the noticed night of the first signal of some deviates, from night 10 on.
fn first_signal_of(limits: Limits, firm: usize, deviates: &[f64]) -> Option<(usize, usize)> {
    let mut sums = Sums::new(limits, firm);
    let mut nights = (10..).zip(deviates);
    nights.find_map(|(night, deviate)| sums.add(night, *deviate)).map(|signal| (signal.night, signal.noticed))
}

#[test]
fn a_sum_adds_what_exceeds_one_on_either_side_and_dates_the_change_to_its_last_zero() {
    for sign in [1.0, -1.0] {
        // After the first night the sum is 0, then 1, 2, 3 and 4: the limit itself is not exceeded.
        let deviates = [-1.0, 2.0, 2.0, 2.0, 2.0].map(|deviate| sign * deviate);
        assert_eq!(first_signal_of(sum_alone(3.0), 0, &deviates), Some((11, 14)), "{sign}");
        assert_eq!(first_signal_of(sum_alone(2.9), 0, &deviates), Some((11, 13)), "{sign}");
        // One night counts for 3.4 at most.
        assert_eq!(first_signal_of(sum_alone(2.5), 0, &[sign * 100.0, 0.0, 0.0]), None, "{sign}");
        assert_eq!(first_signal_of(sum_alone(2.3), 0, &[sign * 100.0]), Some((10, 10)), "{sign}");
        // Below one a night nothing adds up.
        assert_eq!(first_signal_of(sum_alone(2.3), 0, &[sign; 20]), None, "{sign}");
    }
}

#[test]
fn an_unfirm_level_needs_a_quarter_more() {
    // The sum is 9 on night 18, and 11 on night 20; the limits are 8 and 10.
    for (firm, noticed) in [(0, 18), (18, 18), (19, 19), (20, 20), (1000, 20)] {
        assert_eq!(first_signal_of(sum_alone(8.0), firm, &[2.0; 12]), Some((10, noticed)), "{firm}");
    }
}

#[test]
fn the_last_five_nights_are_watched_once_the_level_is_firm() {
    // 5 * 0.9 = 4.5 exceeds 2 sqrt(5) = 4.472.
    let limits = Limits { sum: 100.0, window: 2.0, night: 100.0 };
    for sign in [1.0, -1.0] {
        let deviates = [0.0, 0.9, 0.9, 0.9, 0.9, 0.9, 0.9].map(|deviate| sign * deviate);
        assert_eq!(first_signal_of(limits, 0, &deviates), Some((11, 15)), "{sign}");
        assert_eq!(first_signal_of(limits, 16, &deviates), Some((12, 16)), "{sign}");
        assert_eq!(first_signal_of(limits, 17, &deviates), None, "{sign}");
    }
}

#[test]
fn sums_are_zero_where_neither_side_is_suspected() {
    let mut sums = Sums::new(sum_alone(10.0), 0);
    assert!(sums.are_zero());
    for (deviate, are_zero) in [(2.0, false), (-0.5, true), (-2.0, false), (0.5, true)] {
        sums.add(0, deviate);
        assert_eq!(sums.are_zero(), are_zero, "{deviate}: {:?}", sums.totals);
    }
}

#[test]
fn the_likeliest_night_is_that_with_the_largest_square_over_its_number_of_nights() {
    // From the last night on: 4 / 1, 16 / 2, 16 / 3.
    assert_eq!(likeliest_night(&[(3, 0.0), (4, 2.0), (5, 2.0)]), 4);
    assert_eq!(likeliest_night(&[(3, 0.0), (4, -2.0), (5, -2.0)]), 4);
    // 4, 2, 3 and 16 / 4: the later of two nights that are as likely.
    assert_eq!(likeliest_night(&[(1, 1.0), (2, 1.0), (3, 0.0), (4, 2.0)]), 4);
    // 1, .5, 9 / 3.
    assert_eq!(likeliest_night(&[(7, 2.0), (8, 0.0), (9, 1.0)]), 7);
}

/// Noise of many nights with a spread of 1, so that innovations and deviates are nearly the same.
fn known_noise(nights: usize) -> Noise {
    let mut noise = Noise::default();
    for night in 0..nights {
        noise.update(None, Innovation(if night % 2 == 0 { 1.0 } else { -1.0 }));
    }
    noise
}

/// The first signal of a series with a hundred nights of zero before these, and its outliers.
fn signal_after_quiet_nights(limits: Limits, last: &[f64]) -> (Option<(usize, usize)>, Vec<usize>) {
    let mut deviation = vec![0.0; 100];
    deviation.extend(last);
    let one = series(100.0, &vec![1.0; deviation.len()], &deviation);
    let monitor = GroupMonitor { limits, expected: &[] };
    let members = [&one];
    let mut segment = Segment::new(&monitor, &members, known_noise(20_000), Sums::new(limits, 0));
    let signal = segment.first_signal(0..deviation.len(), 0);
    (signal.map(|signal| (signal.night, signal.noticed)), segment.outliers)
}

#[test]
fn a_night_that_goes_far_waits_for_the_next() {
    let limits = Limits { sum: 4.0, window: 100.0, night: 4.0 };
    for (last, signal, outliers) in [
        // The next night confirms it: 2.4 and 2 exceed 4.
        (&[6.0, 3.0][..], Some((100, 101)), &[][..]),
        (&[-6.0, -3.0], Some((100, 101)), &[]),
        // A night without a reading lies between.
        (&[6.0, f64::NAN, 3.0], Some((100, 102)), &[]),
        // The next goes the same way, but neither far enough nor a third as far.
        (&[5.0, 1.9, 0.0], None, &[100]),
        (&[9.0, 2.8, 0.0], None, &[100]),
        // A third as far is enough.
        (&[8.4, 3.0, 0.0], Some((100, 101)), &[]),
        // The next goes the other way.
        (&[6.0, -6.0, 0.0], None, &[100]),
        // Nothing comes after it.
        (&[6.0], None, &[100]),
        (&[-6.0], None, &[100]),
        // Chance goes so far.
        (&[3.8, 0.0], None, &[]),
        (&[4.2, 0.0], None, &[100]),
        (&[3.8], None, &[]),
        // Nights that do not wait count at once.
        (&[3.2, 3.2], Some((100, 101)), &[]),
        (&[1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0], None, &[]),
    ] {
        assert_eq!(signal_after_quiet_nights(limits, last), (signal, outliers.to_vec()), "{last:?}");
    }
}

#[test]
fn nights_before_the_watched_ones_only_give_the_level() {
    let deviation = [0.0, 0.0, 9.0, 9.0, 9.0, 9.0];
    let one = series(100.0, &[1.0; 6], &deviation);
    let limits = Limits { sum: 3.0, window: 100.0, night: 4.0 };
    let monitor = GroupMonitor { limits, expected: &[] };
    let members = [&one];
    for (watched, is_found) in [(0, true), (4, false)] {
        let mut segment = Segment::new(&monitor, &members, known_noise(10_000), Sums::new(limits, 0));
        // From the fifth night on, 9 is 4.5 from the level of 0, 0, 9, 9; with 10 000 nights of noise that would wait.
        let signal = segment.first_signal(0..5, watched);
        assert_eq!(
            (signal.is_some(), segment.outliers),
            (is_found, if is_found { vec![] } else { vec![4] }),
            "{watched}"
        );
    }
}

#[test]
fn nights_that_may_belong_to_a_change_are_not_counted_as_noise() {
    // Nights 4 to 6 have the sums .2, 2.5 and 4.8, and night 5 is the likeliest: 6.6^2 / 2 against 7.8^2 / 3.
    let deviation = [0.0, 0.0, 0.0, 0.0, 1.2, 3.3, 3.3];
    let one = series(100.0, &[1.0; 7], &deviation);
    let (limits, members) = (sum_alone(4.0), [&one]);
    let monitor = GroupMonitor { limits, expected: &[] };
    let mut segment = Segment::new(&monitor, &members, known_noise(10), Sums::new(limits, 0));
    let mut expected = known_noise(10);
    let mut signal = None;
    for (night, deviate) in deviation.into_iter().enumerate().skip(1) {
        assert!(signal.is_none());
        let innovation = Innovation(deviate);
        signal = segment.watch(night, innovation, deviate);
        if night < 5 {
            expected.update(None, innovation);
        }
        // A quiet night is noise at once.
        assert_eq!(segment.unsettled.is_empty(), night < 4, "{night}");
    }
    let signal = signal.unwrap();
    assert_eq!((signal.night, signal.noticed), (5, 6));
    assert_eq!(segment.unsettled.iter().map(|(night, _)| *night).collect::<Vec<_>>(), [5, 6]);
    let [found, expected] = [&segment.noise, &expected].map(|noise| noise.deviate(None, Innovation(2.0)).unwrap());
    assert_eq!(found, expected);
}

/// Four comparisons of a case with the same deviations, which alternate by half a standard error about these levels.
fn group(levels: &[f64]) -> Vec<Series> {
    let deviation: Vec<f64> = levels.iter().enumerate().map(|(night, level)| level + [0.5, -0.5][night % 2]).collect();
    vec![series(100.0, &vec![1.0; levels.len()], &deviation); 4]
}

/// A level of 0 that moves by these amounts from these nights on.
fn with_steps(nights: usize, steps: &[(usize, f64)]) -> Vec<f64> {
    (0..nights).map(|night| steps.iter().filter(|(first, _)| *first <= night).map(|(_, by)| by).sum()).collect()
}

const LIMITS: Limits = Limits { sum: 4.0, window: 3.0, night: 4.0 };

fn alarms_of(members: &[Series]) -> Vec<Alarm> {
    let all: Vec<&Series> = members.iter().collect();
    GroupMonitor { limits: LIMITS, expected: &[] }.alarms(&all, members[0].deviation.len())
}

/// The night, the noticed night, and the size in standard errors of each step; `None` of an outlier or a drift.
fn steps_of(alarms: &[Alarm]) -> Vec<(usize, usize, Option<f64>)> {
    let mut steps = vec![];
    for Alarm { night, noticed, course, .. } in alarms {
        let size = if let Course::Step { standard_errors, .. } = course { Some(*standard_errors) } else { None };
        steps.push((*night, *noticed, size));
    }
    steps
}

#[test]
fn a_step_has_its_two_nights_and_its_size_by_the_nights_until_it_is_noticed() {
    // Two nights have a sum of 2 * 2.4, which exceeds 4. Fourteen nights after a step it must exceed 5, so three are needed.
    let found = alarms_of(&group(&with_steps(70, &[(8, 6.0), (30, -4.0), (40, 8.0)])));
    let steps = steps_of(&found);
    assert_eq!(steps.iter().map(|step| (step.0, step.1)).collect::<Vec<_>>(), [(8, 9), (30, 31), (40, 42)]);
    // Two nights have a mean noise of 0, and three one of .5 / 3; 100 is the reference.
    for (alarm, size) in found.iter().zip([6.0, -4.0, 8.0 + 0.5 / 3.0]) {
        let Course::Step { standard_errors, relative } = alarm.course else { panic!("no step on {}", alarm.night) };
        assert!(is_near(standard_errors, size) && is_near(relative, size / 100.0), "{standard_errors} {relative}");
        assert_eq!(alarm.seen_in, []);
    }
}

#[test]
fn an_outlier_has_the_size_of_its_night_and_leaves_the_level() {
    for by in [8.0, -8.0] {
        let found = alarms_of(&group(&with_steps(40, &[(20, by), (21, -by)])));
        let [Alarm { night: 20, noticed: 20, course: Course::Outlier { standard_errors, relative }, .. }] = found[..]
        else {
            panic!("{by}: {:?}", steps_of(&found))
        };
        // The noise of an even night is .5.
        assert!(is_near(standard_errors, by + 0.5) && is_near(relative, (by + 0.5) / 100.0), "{standard_errors}");
    }
    // Outliers come before the step that follows them.
    let found = alarms_of(&group(&with_steps(40, &[(20, 8.0), (21, -8.0), (30, 6.0)])));
    let steps = steps_of(&found);
    assert!(matches!(steps[..], [(20, 20, None), (30, 31, Some(_))]), "{steps:?}");
}

#[test]
fn a_quiet_group_has_no_alarm() {
    assert_eq!(steps_of(&alarms_of(&group(&[3.0; 60]))), []);
    assert!(GroupMonitor { limits: LIMITS, expected: &[] }.alarms(&[], 10).is_empty());
}

/// A level of 0 that grows by so much a night from `first` until `end`.
fn with_drift(nights: usize, first: usize, end: usize, by: f64) -> Vec<f64> {
    (0..nights).map(|night| by * (night + 1).clamp(first, end).saturating_sub(first) as f64).collect()
}

#[test]
fn a_drift_has_its_slope_and_its_first_and_last_night() {
    for by in [1.0, -1.0] {
        let found = alarms_of(&group(&with_drift(60, 20, usize::MAX, by)));
        let [Alarm { night, course: Course::Drift { a_night, half_width, until: None }, .. }] = found[..] else {
            panic!("{:?}", steps_of(&found))
        };
        assert!(night.abs_diff(20) <= 1 && (a_night - by / 100.0).abs() <= half_width, "{night} {a_night}");
        // Over all forty nights: 2 * .5 of noise over sqrt(5330), of 58 degrees of freedom.
        assert!(half_width < 4e-4, "{half_width}");
    }
    let found = alarms_of(&group(&with_drift(80, 20, 50, 1.0)));
    let [Alarm { night, course: Course::Drift { a_night, until: Some(end), .. }, .. }] = found[..] else {
        panic!("{:?}", steps_of(&found))
    };
    assert!(night.abs_diff(20) <= 1 && end.abs_diff(50) <= 1 && (a_night - 0.01).abs() < 5e-4, "{night} {end}");
}

#[test]
fn a_step_stays_one_where_a_drift_begins_after_its_settling_nights() {
    let mut levels = with_steps(100, &[(20, 6.0)]);
    for (level, drift) in levels.iter_mut().zip(with_drift(100, 60, usize::MAX, 1.0)) {
        *level += drift;
    }
    let found = alarms_of(&group(&levels));
    let steps = steps_of(&found);
    assert!(matches!(steps[..], [(20, 21, Some(_)), (_, _, None)]), "{steps:?}");
    let Alarm { night, course: Course::Drift { until: None, .. }, .. } = found[1] else { panic!("{steps:?}") };
    assert!(night.abs_diff(60) <= 1, "{night}");
}

#[test]
fn a_drift_is_seen_in_the_cases_that_drift_the_same_way_by_themselves() {
    for (of_other, also_seen) in [(1.0, true), (0.0, false), (-0.2, false)] {
        let mut members = group(&with_drift(60, 20, usize::MAX, 1.0));
        let mut others = group(&with_drift(60, 20, usize::MAX, of_other));
        for series in &mut others {
            series.key.reading.case = "hall".to_owned();
        }
        members.extend(others);
        let found = alarms_of(&members);
        let [Alarm { course: Course::Drift { a_night, .. }, ref seen_in, .. }] = found[..] else {
            panic!("{:?}", steps_of(&found))
        };
        assert!((a_night - (1.0 + of_other) / 200.0).abs() < 5e-4, "{a_night}");
        let cases: Vec<&str> = seen_in.iter().filter_map(|part| part.case.as_deref()).collect();
        assert_eq!(cases, if also_seen { &["room", "hall"][..] } else { &["room"] }, "{of_other}");
        assert!(seen_in.iter().all(|part| part.meter.is_none()));
    }
    // A group of one case has no cases of its own.
    let found = alarms_of(&group(&with_drift(60, 20, usize::MAX, 1.0)));
    assert!(found[0].seen_in.is_empty());
}

#[test]
fn the_last_step_is_removed_and_outliers_stay() {
    let (standard_errors, relative) = (3.0, 0.01);
    let step = Course::Step { standard_errors, relative };
    let outlier = Course::Outlier { standard_errors, relative };
    let mut found = vec![];
    for (night, course) in [(5, step), (9, step), (12, outlier)] {
        found.push(Alarm { night, noticed: night, course, seen_in: vec![] });
    }
    remove_last_step(&mut found);
    assert_eq!(found.iter().map(|alarm| alarm.night).collect::<Vec<_>>(), [5, 12]);
    remove_last_step(&mut found);
    remove_last_step(&mut found);
    assert_eq!(found.iter().map(|alarm| alarm.night).collect::<Vec<_>>(), [12]);
}

#[test]
fn a_drift_that_is_too_slow_to_be_found_from_its_last_step_replaces_the_step_before() {
    let members = group(&with_drift(44, 20, usize::MAX, 0.3));
    let all: Vec<&Series> = members.iter().collect();
    // From the step on night 32 the trend has a line from the first night on; from the step on night 24 it has a kink.
    let [longer, trend] = [(0, 24), (24, 32)].map(|(start, change)| Trend::new(&all, start, change, 44));
    let found = find_drift(&trend, Some(&longer), 34..44).unwrap();
    assert!(found.trend.start == 0 && found.kink.slope > 0.0, "{:?}", found.kink);
    assert!(find_drift(&trend, None, 34..34).is_none());
    // Each night is judged with those up to it.
    let alone = find_drift(&longer, None, 25..44).unwrap();
    let expected = (25..44).find(|night| longer.drift(night + 1, 1).is_some());
    assert_eq!(Some(alone.noticed), expected);
}
