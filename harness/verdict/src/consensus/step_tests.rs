//! The steps of a consensus, each by examples that were worked out by hand.

use super::*;
use crate::fixtures::{built_in, recording, task};
use luxproof_model::{Estimate, ProcedureId};

/// A program of a user, with its values, their standard uncertainties and what is allowed at each target.
fn users(name: &str, readings: &[Value], allowed: &[f64]) -> WitnessReadings {
    WitnessReadings {
        name: name.to_owned(),
        is_users: true,
        shares: vec![],
        readings: readings.iter().copied().map(Some).collect(),
        allowed: allowed.to_vec(),
        is_sampled: false,
    }
}

/// The same of an engine of ours.
fn ours(name: &str, readings: &[Value], allowed: &[f64]) -> WitnessReadings {
    WitnessReadings { is_users: false, ..users(name, readings, allowed) }
}

/// A witness with these components, and with readings that do not matter.
fn sharing(name: &str, shares: &[&str]) -> WitnessReadings {
    let shares = shares.iter().map(|share| (*share).to_owned()).collect();
    WitnessReadings { shares, ..users(name, &[], &[]) }
}

fn hypothesis(name: &str, holders: &[usize]) -> Hypothesis {
    Hypothesis { name: name.to_owned(), holders: holders.to_vec() }
}

fn are_close(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-9 * b.abs()
}

#[test]
fn a_witness_allows_its_tolerance_about_each_reading_and_nothing_without_one() {
    let tolerance = Tolerance { relative: 0.02, absolute: 1.0 };
    let shares = vec!["lookup".to_owned()];
    let found = WitnessReadings::new("a", shares, vec![Some((100.0, 0.0)), Some((10.0, 0.0)), None], tolerance);
    assert_eq!(found.allowed, [2.0, 1.0, 0.0]);
    assert!(found.has("a") && found.has("lookup") && !found.has("b"));
}

#[test]
fn a_reading_is_wrong_beyond_the_wider_tolerance_on_either_side_or_without_a_reference() {
    let witness = users("a", &[(0.0, 0.0)], &[9.0]);
    for (allowed_of_reference, value, is_wrong) in [
        (5.0, 109.0, false),
        (5.0, 109.5, true),
        (5.0, 91.0, false),
        (5.0, 90.5, true),
        (11.0, 111.0, false),
        (11.0, 111.5, true),
    ] {
        let reference = ours("simulator", &[(100.0, 0.0)], &[allowed_of_reference]);
        assert_eq!(witness.is_wrong(0, value, Some(&reference)), is_wrong, "{allowed_of_reference} {value}");
    }
    let unread = WitnessReadings { readings: vec![None], ..ours("simulator", &[], &[5.0]) };
    assert!(witness.is_wrong(0, 100.0, Some(&unread)) && witness.is_wrong(0, 100.0, None));
}

#[test]
fn a_hypothesis_is_about_two_witnesses_only_where_both_have_the_component() {
    let component = hypothesis("lookup", &[0, 2]);
    for (i, j, holds) in [(0, 2, true), (2, 2, true), (0, 1, false), (1, 0, false), (1, 1, false)] {
        assert_eq!(component.holds_both(i, j), holds, "{i} {j}");
    }
}

/// An estimate of 100 lx.
fn hundred(uncertainty: Uncertainty) -> Estimate {
    Estimate { value: 100.0, uncertainty }
}

#[test]
fn the_value_at_a_target_has_its_combined_uncertainty_and_none_where_nothing_was_learnt() {
    let bounded = Uncertainty::StandardError { value: 3.0, degrees_of_freedom: None, bound: 4.0 * 3f64.sqrt() };
    let read =
        [hundred(bounded), hundred(Uncertainty::NotSeen), Estimate::exact(f64::NAN), hundred(Uncertainty::Exact)];
    let (recording, task) = (recording("radiance", &read), task(5));
    // 3² + 4², JCGM 100:2008, 4.3.7 and 5.1.2.
    let (value, uncertainty) = value_at(&recording, &task, 0).unwrap();
    assert!(value == 100.0 && are_close(uncertainty, 5.0), "{uncertainty}");
    assert_eq!([1, 2, 4].map(|k| value_at(&recording, &task, k)), [None; 3]);
    assert_eq!(value_at(&recording, &task, 3), Some((100.0, 0.0)));
}

#[test]
fn readings_scatter_where_they_state_a_standard_error_above_zero() {
    for (uncertainty, scatters) in [
        (Uncertainty::sampled(0.1, None), true),
        (Uncertainty::sampled(0.0, None), false),
        (Uncertainty::Bound(0.1), false),
        (Uncertainty::Exact, false),
    ] {
        let recording = recording("radiance", &[Estimate { value: 1.0, uncertainty }]);
        assert_eq!(has_standard_error(&recording.readings[0]), scatters, "{uncertainty:?}");
    }
}

#[test]
fn witnesses_are_readings_of_this_run_that_claim_something() {
    let read = [Estimate { value: 100.0, uncertainty: Uncertainty::sampled(0.1, None) }];
    let exact = [Estimate::exact(100.0)];
    let mut recorded = recording("dialux", &exact);
    recorded.role = Role::Recorded;
    let components = vec!["lookup".to_owned()];
    let radiance = Recording { components, ..recording("radiance", &read) };
    let all = [recording("simulator", &exact), radiance, recording("mine", &exact), recording("povray", &[]), recorded];
    let found = collect_witnesses(&built_in(), &task(1), &all.iter().collect_vec());
    assert_eq!(found.iter().map(|w| w.name.as_str()).collect_vec(), ["simulator", "radiance", "mine"]);
    assert_eq!(found.iter().map(|w| w.is_users).collect_vec(), [false, false, true]);
    assert_eq!(found.iter().map(|w| w.is_sampled).collect_vec(), [false, true, false]);
    assert_eq!(found[1].shares, ["lookup"]);
    // The IESNA method may deviate by a tenth, radiance by a fiftieth: the reference has the strictest tolerance.
    let all = [recording("iesna", &exact), recording("radiance", &exact), recording("simulator", &exact)];
    let found = collect_witnesses(&built_in(), &task(1), &all.iter().collect_vec());
    let allowed = |name| found.iter().find(|w| w.name == name).map(|w| w.allowed[0]);
    assert_eq!((allowed("simulator"), allowed("radiance")), (Some(2.0), Some(2.0)));
}

#[test]
fn hypotheses_are_each_witness_and_what_some_of_them_share_but_not_all() {
    let witnesses = [
        sharing("a", &["all", "pair", "same pair", "alone"]),
        sharing("b", &["all", "pair", "same pair"]),
        sharing("c", &["all", "b"]),
    ];
    let found = list_hypotheses(&witnesses);
    let named = found.iter().map(|h| (h.name.as_str(), &h.holders[..])).collect_vec();
    assert_eq!(named, [("a", &[0][..]), ("b", &[1]), ("c", &[2]), ("pair", &[0, 1]), ("b", &[1, 2])]);
    assert_eq!(find_holders(&witnesses, "b"), [1, 2]);
}

#[test]
fn witnesses_that_share_something_are_one_group_also_through_others() {
    let witnesses = [
        sharing("a", &[FILE_READER, "x"]),
        sharing("b", &[FILE_READER, "y"]),
        sharing("c", &[FILE_READER, "x", "y"]),
        sharing("d", &[FILE_READER, "alone"]),
        sharing("e", &["z"]),
        sharing("f", &["z"]),
    ];
    let found = group_witnesses(&witnesses).iter().map(Group::to_string).collect_vec();
    assert_eq!(found, ["a = b = c (x, y)", "d", "e = f (z)"]);
}

#[test]
fn copies_of_copies_are_one_program_and_others_are_not() {
    // With 2.5 allowed, readings within .25 of each other are copies: the last ties the first two.
    let mut witnesses = [
        ours("simulator", &[(100.0, 0.0)], &[2.5]),
        ours("mitsuba", &[(110.0, 0.0)], &[2.5]),
        ours("radiance", &[(110.4, 0.0)], &[2.5]),
        ours("povray", &[(120.0, 0.0)], &[2.5]),
        users("mine", &[(110.2, 0.0)], &[2.5]),
    ];
    mark_copies(&mut witnesses, Some("simulator"), &[0]);
    let copy = &["the readings of mitsuba"][..];
    let shares = witnesses.iter().map(|w| w.shares.iter().map(String::as_str).collect_vec()).collect_vec();
    assert_eq!(shares, [&[][..], copy, copy, &[], copy]);
}

#[test]
fn two_pairs_of_copies_are_two_programs() {
    let mut witnesses = [
        ours("mitsuba", &[(110.0, 0.0)], &[2.5]),
        ours("radiance", &[(130.0, 0.0)], &[2.5]),
        users("mine", &[(130.1, 0.0)], &[2.5]),
        users("theirs", &[(110.1, 0.0)], &[2.5]),
    ];
    // Without a reference every reading may be wrong.
    mark_copies(&mut witnesses, None, &[0]);
    let shares = witnesses.iter().map(|w| w.shares.join(", ")).collect_vec();
    let [first, second] = ["the readings of mitsuba", "the readings of radiance"];
    assert_eq!(shares, [first, second, second, first]);
}

#[test]
fn equal_digits_are_a_copy_where_there_are_two_values_and_one_program_is_a_users() {
    const TWO: &[Value] = &[(110.0, 0.0), (55.0, 0.0)];
    for (one, other, is_one_program) in [
        (TWO, TWO, true),
        (TWO, &[(110.0, 0.0), (55.5, 0.0)][..], false),
        (TWO, &[(110.5, 0.0), (55.0, 0.0)], false),
        // A single value, or one besides darkness, may be a coincidence.
        (&[(110.0, 0.0); 2], &[(110.0, 0.0); 2], false),
        (&[(0.0, 0.0), (55.0, 0.0)], &[(0.0, 0.0), (55.0, 0.0)], false),
    ] {
        let [a, b] = [users("a", one, &[1.0; 2]), users("b", other, &[1.0; 2])];
        let [own, other_own] = [ours("mitsuba", one, &[1.0; 2]), ours("radiance", other, &[1.0; 2])];
        assert_eq!(is_copy(&a, &b, None, &[]), is_one_program, "{one:?} {other:?}");
        assert_eq!(is_copy(&own, &b, None, &[]), is_one_program, "{one:?} {other:?}");
        assert_eq!(is_copy(&a, &other_own, None, &[]), is_one_program, "{one:?} {other:?}");
        assert!(!is_copy(&own, &other_own, None, &[]));
    }
}

#[test]
fn wrong_readings_without_chance_are_copies_within_a_tenth_of_the_narrower_tolerance() {
    let reference = ours("simulator", &[(100.0, 0.0)], &[2.0]);
    for (one, other, allowed, is_one_program) in [
        (110.0, 110.19, [2.0, 3.0], true),
        (110.0, 110.21, [2.0, 3.0], false),
        (110.0, 109.81, [3.0, 2.0], true),
        (110.0, 109.79, [3.0, 2.0], false),
        // One of them is right: 102 and less are within the tolerance.
        (102.05, 101.95, [2.0, 2.0], false),
        (101.95, 102.05, [2.0, 2.0], false),
        // Without a tolerance rounding counts: 1.1e-10, of which a tenth is allowed.
        (110.0, 110.0 + 5e-12, [0.0, 0.0], true),
        (110.0, 110.0 + 2e-11, [0.0, 0.0], false),
        (110.0, 110.1, [0.0, 0.0], false),
    ] {
        let (a, b) = (users("a", &[(one, 9.0)], &allowed[..1]), users("b", &[(other, 9.0)], &allowed[1..]));
        assert_eq!(is_copy(&a, &b, Some(&reference), &[0]), is_one_program, "{one} {other} {allowed:?}");
    }
    // Two distances, of 0 and .28, have a root mean square of .198, which is less than .2.
    let reference = ours("simulator", &[(100.0, 0.0); 2], &[2.0; 2]);
    for (distance, is_one_program) in [(0.28, true), (0.285, false)] {
        let a = users("a", &[(110.0, 0.0); 2], &[2.0; 2]);
        let b = users("b", &[(110.0, 0.0), (110.0 + distance, 0.0)], &[2.0; 2]);
        assert_eq!(is_copy(&a, &b, Some(&reference), &[0, 1]), is_one_program, "{distance}");
    }
}

#[test]
fn sampled_wrong_readings_are_copies_within_a_tenth_of_their_noise_and_beyond_chance() {
    // Errors of 3 and 4 combine to 5. At 4 meters a tenth of it decides. A single meter has a chance of
    // (m e^(1 - m))^(1/2) for the square m of the distance, which is .01 at m = 3.67893e-5, a distance of .030327.
    for (meters, distance, is_one_program) in [(4, 0.49, true), (4, 0.51, false), (1, 0.0303, true), (1, 0.0304, false)]
    {
        for sampled in [[true, false], [false, true], [true, true]] {
            let readings = |value: f64, error: f64| vec![(value, error); meters];
            let reference = ours("simulator", &readings(100.0, 0.0), &[1.0; 4]);
            let a = WitnessReadings { is_sampled: sampled[0], ..users("a", &readings(150.0, 3.0), &[1.0; 4]) };
            let b =
                WitnessReadings { is_sampled: sampled[1], ..users("b", &readings(150.0 - distance, 4.0), &[1.0; 4]) };
            let targets = (0..meters).collect_vec();
            let found = is_copy(&a, &b, Some(&reference), &targets);
            assert_eq!(found, is_one_program, "{meters} {distance} {sampled:?}");
        }
    }
}

/// Whether two users' programs have similar errors, against a reference of 100 at each meter with this uncertainty.
fn are_similar(a: &[Value], b: &[Value], uncertainty: f64) -> bool {
    let reference = ours("simulator", &vec![(100.0, uncertainty); a.len()], &vec![1.0; a.len()]);
    let (a, b) = (users("a", a, &vec![1.0; a.len()]), users("b", b, &vec![1.0; b.len()]));
    let targets = (0..a.readings.len()).collect_vec();
    let witnesses = [reference, a, b];
    have_similar_errors(&witnesses, [1, 2], &witnesses[0], &targets)
}

#[test]
fn errors_are_similar_within_a_tenth_of_their_size_and_their_noise() {
    // Errors (3, 4) and (3, 4 + d) have a size of (25 + d (8 + d) / 2)^(1/2): 5.17 for d = .4, and 5.26 for d = .6.
    for (d, are_alike) in [(0.4, true), (0.6, false)] {
        let (a, b) = ([(103.0, 0.0), (104.0, 0.0)], [(103.0, 0.0), (104.0 + d, 0.0)]);
        assert_eq!(are_similar(&a, &b, 0.0), are_alike, "{d}");
        assert_eq!(are_similar(&b, &a, 0.0), are_alike, "{d}");
    }
    // Errors of opposite sign are not similar.
    assert!(!are_similar(&[(110.0, 0.0)], &[(90.0, 0.0)], 0.0));
    // Noise of 1, 2 and 2 combines to 3, which is a fifth of 15.
    assert!(are_similar(&[(115.1, 1.0)], &[(115.1, 2.0)], 2.0));
    assert!(!are_similar(&[(114.9, 1.0)], &[(114.9, 2.0)], 2.0));
    // Errors of 16 and 24 have a size of 20.4: a tenth of it and twice the noise are 8.04.
    assert!(are_similar(&[(116.0, 1.0)], &[(124.0, 2.0)], 2.0));
    assert!(!are_similar(&[(115.9, 1.0)], &[(124.1, 2.0)], 2.0));
    // At two meters the noise is that of both: (2 * 9)^(1/2) = 4.24, a fifth of 21.2, which is 15 at each meter.
    assert!(are_similar(&[(115.1, 1.0); 2], &[(115.1, 2.0); 2], 2.0));
    assert!(!are_similar(&[(114.9, 1.0); 2], &[(114.9, 2.0); 2], 2.0));
}

const WRONG: &[Value] = &[(110.0, 0.0)];

/// A reference of 100 lx that allows 50 lx.
fn wide_reference() -> WitnessReadings {
    ours("simulator", &[(100.0, 0.0)], &[50.0])
}

/// The reference and two users' programs that read the same wrong value.
fn wrong_users() -> [WitnessReadings; 3] {
    [wide_reference(), users("a", WRONG, &[1.0]), users("b", WRONG, &[1.0])]
}

/// Whether the two witnesses after the reference have similar errors.
fn first_are_similar(witnesses: &[WitnessReadings], targets: &[usize]) -> bool {
    have_similar_errors(witnesses, [1, 2], &witnesses[0], targets)
}

#[test]
fn only_users_programs_have_similar_errors_where_no_engine_of_ours_reads_the_same() {
    // The reference allows 50 lx, so that it agrees with them. It is no further engine.
    assert!(first_are_similar(&wrong_users(), &[0]));
    assert!(!first_are_similar(&wrong_users(), &[]));
    assert!(!first_are_similar(&[wide_reference(), ours("mitsuba", WRONG, &[1.0]), users("b", WRONG, &[1.0])], &[0]));
    assert!(!first_are_similar(&[wide_reference(), users("a", WRONG, &[1.0]), ours("mitsuba", WRONG, &[1.0])], &[0]));
    for (further, are_alike) in [
        (ours("mitsuba", WRONG, &[1.0]), false),
        (ours("mitsuba", &[(120.0, 0.0)], &[1.0]), true),
        (users("c", WRONG, &[1.0]), true),
        (ours(DERIVED_VALUES, WRONG, &[1.0]), true),
    ] {
        let name = further.name.clone();
        let witnesses = wrong_users().into_iter().chain([further]).collect_vec();
        assert_eq!(first_are_similar(&witnesses, &[0]), are_alike, "{name}");
    }
    // Each of the three must have a reading.
    for missing in 0..3 {
        let mut witnesses = wrong_users();
        witnesses[missing].readings[0] = None;
        assert!(!first_are_similar(&witnesses, &[0]), "{missing}");
    }
}

#[test]
fn witnesses_agree_within_the_wider_tolerance_and_twice_their_noise_at_every_target() {
    let a = users("a", &[(100.0, 3.0), (50.0, 0.0)], &[1.0, 1.0]);
    // Errors of 3 and 4 combine to 5: 2 + 10.
    for (value, agree) in [(112.0, true), (112.5, false), (88.0, true), (87.5, false)] {
        let b = users("b", &[(value, 4.0), (50.0, 0.0)], &[2.0, 1.0]);
        assert_eq!((agrees(&a, &b, &[0, 1]), agrees(&b, &a, &[0, 1])), (agree, agree), "{value}");
        assert!(agrees(&a, &b, &[1]));
    }
    let unread = WitnessReadings { readings: vec![None, Some((50.0, 0.0))], ..users("b", &[], &[2.0, 1.0]) };
    assert!(!agrees(&a, &unread, &[0, 1]) && !agrees(&unread, &a, &[0, 1]) && agrees(&a, &unread, &[1]));
}

#[test]
fn readings_differ_beyond_the_wider_tolerance_twice_their_noise_and_rounding() {
    // Errors of .75 and 1 combine to 1.25.
    for (one, other, allowed, errors, differ) in [
        (100.0, 104.5, [1.0, 2.0], [0.75, 1.0], false),
        (100.0, 104.6, [1.0, 2.0], [0.75, 1.0], true),
        (100.0, 95.5, [2.0, 1.0], [0.75, 1.0], false),
        (100.0, 95.4, [2.0, 1.0], [0.75, 1.0], true),
        // Rounding of 1e-10.
        (100.0, 100.0 + 5e-11, [0.0; 2], [0.0; 2], false),
        (100.0, 100.0 + 2e-10, [0.0; 2], [0.0; 2], true),
    ] {
        let witnesses = [
            WitnessReadings { readings: vec![None], ..users("unread", &[], &[0.0]) },
            users("a", &[(one, errors[0])], &allowed[..1]),
            users("b", &[(other, errors[1])], &allowed[1..]),
        ];
        assert_eq!(do_differ(&witnesses, 0), differ, "{one} {other}");
    }
}

/// A consensus with one group for each list of names.
fn consensus_of(groups: &[&[&str]], differing: usize) -> Consensus {
    let mut found = Consensus {
        case: "c".to_owned(),
        procedure: ProcedureId::IndirectIlluminance,
        witnesses: vec![],
        independent: groups.len(),
        groups: vec![],
        differing,
        outliers: vec![],
        component: None,
        odds: None,
        text: String::new(),
        assumptions: String::new(),
    };
    for names in groups {
        let names = names.iter().map(|name| (*name).to_owned()).collect_vec();
        for name in &names {
            let is_reference = name == "simulator";
            found.witnesses.push(Witness {
                name: name.clone(),
                is_reference,
                shares: vec![],
                deviation: None,
                probability: 0.0,
            });
        }
        found.groups.push(Group { witnesses: names, share: vec![] });
    }
    found
}

/// Readings that do not matter of these witnesses.
fn unread_witnesses(names: &[&str]) -> Vec<WitnessReadings> {
    let mut witnesses = vec![];
    for name in names {
        let is_users = luxproof_engines::entry(name).is_none() && *name != DERIVED_VALUES;
        witnesses.push(WitnessReadings { is_users, ..users(name, &[], &[]) });
    }
    witnesses
}

#[test]
fn two_independent_engines_of_ours_show_that_a_reference_is_wrong() {
    for (groups, departing, rests_on_users) in [
        (&[&["simulator"][..], &["mitsuba"], &["radiance"]][..], &[0][..], false),
        (&[&["simulator"], &["mitsuba"], &["mine"]], &[0], true),
        (&[&["simulator"], &["mitsuba", "radiance"], &["mine"]], &[0], true),
        (&[&["simulator"], &["mitsuba", "mine"], &["radiance"]], &[0], false),
        (&[&["iesna"], &["mitsuba"], &["mine"]], &[0], true),
        (&[&[DERIVED_VALUES], &["mitsuba"], &["mine"]], &[0], true),
        (&[&["simulator"], &["mitsuba"], &[DERIVED_VALUES]], &[0], true),
        // An engine that departs with the simulator does not show it.
        (&[&["simulator", "mitsuba"], &["radiance"], &["mine"]], &[0, 1], true),
        // What is no reference may be called wrong by anyone.
        (&[&["mitsuba"], &["mine"], &["theirs"]], &[0], false),
    ] {
        let found = consensus_of(groups, 1);
        let witnesses = unread_witnesses(&groups.concat());
        let rests = rests_on_users_programs(&found, &hypothesis("x", departing), &witnesses);
        assert_eq!(rests, rests_on_users, "{groups:?}");
    }
}

#[test]
fn values_about_an_unknown_mean_have_the_likelihood_of_their_contrasts() {
    const LN_TAU: f64 = 1.837_877_066_409_345_5;
    // The difference of two values has the variance 2 + 3 - 2 * .5 = 4.
    let two = gaussian_log_likelihood(&[vec![2.0, 0.5], vec![0.5, 3.0]], &[1.0, 7.0]).unwrap();
    assert!(are_close(two, -0.5 * (4f64.ln() + 36.0 / 4.0 + LN_TAU)), "{two}");
    // Variances of 1, 4 and 9 have weights of 49/36 in all and the determinant 36. The mean of 1, 2 and 4 is 10/7, about which the
    // weighted squares are (9 + 4 + 36)/49. What all share by addition shifts the mean alone.
    for common in [0.0, 0.5, 3.0] {
        let variances = [1.0, 4.0, 9.0];
        let row = |i: usize| (0..3).map(|j| common + if i == j { variances[i] } else { 0.0 }).collect_vec();
        let three = gaussian_log_likelihood(&[row(0), row(1), row(2)], &[1.0, 2.0, 4.0]).unwrap();
        assert!(are_close(three, -0.5 * (49f64.ln() + 1.0 + 2.0 * LN_TAU)), "{common} {three}");
    }
    for matrix in [[[1.0, 2.0], [2.0, 1.0]], [[0.0, 0.0], [0.0, 1.0]], [[1.0, 1.0], [1.0, 1.0]]] {
        assert_eq!(gaussian_log_likelihood(&matrix.map(|row| row.to_vec()), &[1.0, 2.0]), None, "{matrix:?}");
    }
}

#[test]
fn logarithms_add_up_as_their_numbers_do() {
    for shift in [0.0, -1000.0, 1000.0] {
        let logs = [1f64, 2.0, 5.0].map(|number| number.ln() + shift);
        assert!((log_of_sum(&logs) - 8f64.ln() - shift).abs() < 1e-9, "{shift}");
    }
}

#[test]
fn the_scale_of_a_target_is_its_median_or_else_its_largest_reading() {
    for (values, scale) in [
        (&[1.0, 2.0, 3.0, 40.0, 50.0][..], 3.0),
        (&[1.0, -2.0, 30.0], 2.0),
        (&[1.0, 4.0], 4.0),
        (&[0.0, 0.0, 5.0], 5.0),
        (&[0.0, 0.0], f64::MIN_POSITIVE),
        (&[], f64::MIN_POSITIVE),
    ] {
        let witnesses = values.iter().map(|value| users("a", &[(*value, 0.0)], &[1.0])).collect_vec();
        assert_eq!(median_reading(&witnesses, 0), scale, "{values:?}");
    }
}

#[test]
fn the_smallest_tolerance_is_that_of_witnesses_with_a_reading() {
    let unread = WitnessReadings { readings: vec![None], ..users("c", &[], &[0.1]) };
    let witnesses = [users("a", &[(50.0, 0.0)], &[3.0]), users("b", &[(50.0, 0.0)], &[2.0]), unread];
    assert!(are_close(relative_allowance(&witnesses, 0), 0.04));
}

#[test]
fn covariances_are_noise_a_third_of_tolerances_and_what_departs() {
    let witnesses =
        [users("a", &[(100.0, 2.0)], &[3.0]), users("b", &[(100.0, 0.0)], &[6.0]), users("c", &[(100.0, 0.0)], &[0.0])];
    let hypotheses = [hypothesis("a", &[0]), hypothesis("lookup", &[0, 1])];
    let evidence = Evidence { witnesses: &witnesses, hypotheses: &hypotheses, differing: &[0] };
    for (departure, pair, covariance) in [
        // (2/100)² + (3/3/100)², (6/3/100)² and rounding.
        (None, [0, 0], 5e-4),
        (None, [1, 1], 4e-4),
        (None, [2, 2], 1e-24),
        // Half of the smaller third's square, where two share something.
        (None, [0, 1], 0.5e-4),
        (None, [1, 0], 0.5e-4),
        (None, [0, 2], 0.0),
        // A departure of a tenth has a variance of .01 in all that hold the component.
        (Some(0), [0, 0], 1.05e-2),
        (Some(0), [1, 1], 4e-4),
        (Some(0), [0, 1], 0.5e-4),
        (Some(1), [0, 1], 1.005e-2),
        (Some(1), [1, 1], 1.04e-2),
        (Some(1), [1, 2], 0.0),
    ] {
        let departure = departure.map(|k: usize| (&hypotheses[k], 0.1));
        let found = evidence.covariance(departure, 0, 100.0, pair);
        assert!(are_close(found, covariance), "{pair:?}: {found} {covariance}");
    }
}

/// The density of a normal deviation with this variance.
fn normal_density(deviation: f64, variance: f64) -> f64 {
    (-0.5 * deviation.powi(2) / variance).exp() / (std::f64::consts::TAU * variance).sqrt()
}

#[test]
fn the_evidence_of_a_departure_is_the_mean_over_its_sizes() {
    // Two readings differ by 10 of 110. Sound ones differ by a third of a tolerance each. Sizes double from the tolerance to beyond ten.
    for (allowed, smallest, sizes) in [(1.1, 0.01, 11), (0.0, 1e-6, 25), (550.0, 5.0, 2), (1100.0, 10.0, 1)] {
        let witnesses = [users("a", &[(100.0, 0.0)], &[allowed]), users("b", &[(110.0, 0.0)], &[allowed])];
        let hypotheses = [hypothesis("a", &[0])];
        let evidence = Evidence { witnesses: &witnesses, hypotheses: &hypotheses, differing: &[0] };
        let sound = 2.0 * (allowed / 330.0).powi(2) + 2e-24;
        let mean =
            (0..sizes).map(|k| normal_density(1.0 / 11.0, sound + (smallest * 2f64.powi(k)).powi(2))).sum::<f64>()
                / f64::from(sizes);
        let found = evidence.log_evidence(&hypotheses[0]);
        assert!(are_close(found, mean.ln()), "{allowed}: {found} {}", mean.ln());
        // One hypothesis and none share the probability.
        let none = normal_density(1.0 / 11.0, sound);
        let probability = evidence.probabilities()[0];
        assert!(are_close(probability, mean / (mean + none)), "{allowed}: {probability}");
    }
}

#[test]
fn all_meters_count_as_one_and_a_missing_reading_is_no_evidence() {
    let witnesses = [
        WitnessReadings {
            readings: vec![Some((100.0, 0.0)), Some((100.0, 0.0)), Some((7.0, 0.0))],
            ..users("a", &[], &[33.0, 66.0, 1.0])
        },
        WitnessReadings {
            readings: vec![Some((110.0, 0.0)), Some((110.0, 0.0)), None],
            ..users("b", &[], &[33.0, 66.0, 1.0])
        },
    ];
    let hypotheses = [];
    let at = |differing: &[usize]| {
        Evidence { witnesses: &witnesses, hypotheses: &hypotheses, differing }.mean_log_likelihood(None)
    };
    // Variances are 2 (11/110)² = .02 and 2 (22/110)² = .08.
    let logs = [0.02, 0.08].map(|variance| normal_density(1.0 / 11.0, variance).ln());
    assert!(are_close(at(&[0]), logs[0]) && are_close(at(&[1]), logs[1]));
    assert!(are_close(at(&[0, 1]), 0.5 * (logs[0] + logs[1])));
    // One reading about an unknown mean has the likelihood 1.
    assert!(at(&[2]).abs() < 1e-9);
}

#[test]
fn readings_too_far_apart_for_numbers_support_no_hypothesis() {
    let witnesses = [users("a", &[(0.0, 0.0)], &[0.0]), users("b", &[(f64::MAX, 0.0)], &[0.0])];
    let hypotheses = [hypothesis("a", &[0])];
    let evidence = Evidence { witnesses: &witnesses, hypotheses: &hypotheses, differing: &[0] };
    assert!(evidence.probabilities().iter().all(|p| p.is_finite()));
}

/// A witness without a reading at the one target.
fn unread(name: &str) -> WitnessReadings {
    WitnessReadings { readings: vec![None], ..users(name, &[], &[1.0]) }
}

#[test]
fn a_deviation_is_from_the_weighted_mean_of_the_others() {
    // Variances of (3/3)² and of 3 + (3/3)²: weights of 1 and 1/4 give 126.5/1.25.
    let witnesses = [
        users("a", &[(110.0, 7.0)], &[9.0]),
        users("b", &[(100.0, 0.0)], &[3.0]),
        users("c", &[(106.0, 3f64.sqrt())], &[3.0]),
        unread("d"),
    ];
    assert!(are_close(deviation_at(&witnesses, 0, 0).unwrap(), 110.0 / 101.2 - 1.0));
    assert_eq!(deviation_at(&witnesses, 3, 0), None);
    // Without errors and tolerances weights are those of rounding: 4 to 1 at 100 and 200.
    let exact = [110.0, 100.0, 200.0].map(|value| users("a", &[(value, 0.0)], &[0.0]));
    assert!(are_close(deviation_at(&exact, 0, 0).unwrap(), 110.0 / 120.0 - 1.0));
    // There are no others, or they read darkness.
    assert_eq!(deviation_at(&[users("a", &[(1.0, 0.0)], &[1.0]), unread("b")], 0, 0), None);
    assert_eq!(deviation_at(&[1.0, 0.0].map(|value| users("a", &[(value, 0.0)], &[1.0])), 0, 0), None);
}

#[test]
fn the_mean_deviation_is_that_of_targets_that_differ_or_else_of_all() {
    let unread = WitnessReadings { readings: vec![None; 3], ..users("c", &[], &[1.0; 3]) };
    let witnesses = [
        users("a", &[(101.0, 0.0), (104.0, 0.0), (110.0, 0.0)], &[1.0; 3]),
        users("b", &[(100.0, 0.0); 3], &[1.0; 3]),
        unread,
    ];
    for (differing, mean) in [(&[][..], 0.05), (&[1, 2], 0.07), (&[2], 0.1)] {
        assert!(are_close(mean_deviation(&witnesses, 0, differing).unwrap(), mean), "{differing:?}");
    }
    assert_eq!(mean_deviation(&witnesses, 2, &[]), None);
}

#[test]
fn an_outlier_is_named_from_odds_of_nineteen_on() {
    const GROUPS: &[&[&str]] = &[&["simulator"], &["mitsuba"], &["radiance"]];
    const WITH_USERS: &[&[&str]] = &[&["simulator"], &["mine"], &["radiance"]];
    let hypotheses = [hypothesis("simulator", &[0]), hypothesis("mitsuba", &[1]), hypothesis("radiance", &[2])];
    let witnesses = unread_witnesses(&GROUPS.concat());
    for (probability, odds) in [
        (0.949, None),
        (0.951, Some(0.951 / 0.049)),
        (0.99, Some(99.0)),
        (0.99995, Some(1e4)),
        (1.0, Some(1e4)),
        (0.0, None),
    ] {
        let mut found = consensus_of(GROUPS, 3);
        found.text = conclude(&mut found, &hypotheses, &[0.001, probability, 0.002], &witnesses);
        assert_eq!(found.odds.is_some(), odds.is_some(), "{}", found.text);
        assert_eq!(found.outliers.first().map(String::as_str), odds.map(|_| "mitsuba"), "{}", found.text);
        assert_eq!(found.component, found.outliers.first().cloned());
        assert!(found.odds.zip(odds).is_none_or(|(found, odds)| are_close(found, odds)), "{:?}", found.odds);
    }
    // Without a difference, or with two, none is named.
    for (groups, differing) in [(GROUPS, 0), (&GROUPS[..2], 3)] {
        let mut found = consensus_of(groups, differing);
        let text = conclude(&mut found, &hypotheses, &[0.001, 0.999, 0.0], &witnesses);
        assert!(found.outliers.is_empty() && found.odds.is_none(), "{text}");
        assert_eq!(text.contains("agree"), differing == 0, "{text}");
    }
    // Only users' programs contradict the simulator.
    let mut found = consensus_of(WITH_USERS, 3);
    let text = conclude(&mut found, &hypotheses, &[0.999, 0.0, 0.0], &unread_witnesses(&WITH_USERS.concat()));
    assert!(found.outliers.is_empty() && text.contains("only users' programs contradict simulator"), "{text}");
}

#[test]
fn likely_candidates_have_more_than_one_chance_in_twenty() {
    let hypotheses = ["a", "b", "c", "d"].map(|name| hypothesis(name, &[0]));
    let shown = |probabilities: &[f64]| describe_candidates(&[1, 2, 0, 3], &hypotheses, probabilities);
    assert_eq!(shown(&[0.05, 0.5, 0.06, 0.04]), "b (50 %) or c (6 %)");
    assert_eq!(shown(&[0.05, 0.05, 0.01, 0.04]), "no single one");
}

#[test]
fn a_departure_is_described_by_who_departs_by_how_much_and_how_certainly() {
    let mut found = consensus_of(&[&["simulator"], &["mitsuba"], &["radiance"]], 7);
    found.witnesses[0].deviation = Some(0.02);
    found.witnesses[1].deviation = Some(-0.05);
    let describe = |outliers: &[&str], holders: &[usize], odds: f64| {
        let outliers = outliers.iter().map(|name| (*name).to_owned()).collect();
        let found = Consensus { outliers, ..found.clone() };
        describe_departure(&found, &hypothesis("lookup", holders), odds, "all")
    };
    for (text, expected) in [
        (
            describe(&["simulator"], &[0], 20.4),
            "the reference itself: simulator departs from the others by +2.0 % at 7 meters; odds 20 to 1; independent are all",
        ),
        (
            describe(&["mitsuba"], &[1], 1e4),
            "mitsuba departs from the others by -5.0 % at 7 meters; odds more than 10000 to 1; independent are all",
        ),
        (
            describe(&["radiance"], &[2], 9999.0),
            "radiance departs from the others at 7 meters; odds 9999 to 1; independent are all",
        ),
        (
            describe(&["mitsuba", "simulator"], &[1, 0], 30.0),
            "the reference itself: mitsuba and simulator depart from the others by -5.0 % at 7 meters, by what they share: lookup; \
             odds 30 to 1; independent are all",
        ),
    ] {
        assert_eq!(text, expected);
    }
}

/// A witness for each list of components.
fn with_shares(of: &[&[&str]]) -> Vec<WitnessReadings> {
    of.iter().map(|shares| sharing("w", shares)).collect()
}

#[test]
fn blind_spots_are_what_all_of_several_witnesses_have() {
    for (witnesses, blind_spots) in [
        (with_shares(&[&["x", "y", "z"], &["x", "z"], &["z", "x"]]), Some("x, z")),
        (with_shares(&[&["x"], &["y"]]), None),
        (with_shares(&[&["x"]]), None),
    ] {
        let text = describe_assumptions(&witnesses);
        let found = text.split_once("; blind to what all have: ").map(|(_, spots)| spots);
        assert_eq!((text.starts_with(ASSUMPTIONS), found), (true, blind_spots));
    }
}

/// The consensus of engines that read a multiple of 100 lx without noise.
fn consensus_by_factor(engines: &[(&str, f64)]) -> Consensus {
    let all =
        engines.iter().map(|(engine, factor)| recording(engine, &[Estimate::exact(100.0 * factor)])).collect_vec();
    built_in().consensus(&task(1), &all.iter().collect_vec()).unwrap()
}

#[test]
fn witnesses_have_the_probability_of_their_own_code_where_three_differ() {
    let three = consensus_by_factor(&[("simulator", 1.0), ("mitsuba", 1.1), ("radiance", 1.0)]);
    let of = |name: &str| three.witnesses.iter().find(|w| w.name == name).unwrap();
    assert_eq!(three.witnesses.iter().map(|w| w.is_reference).collect_vec(), [true, false, false]);
    assert!(of("mitsuba").probability > 0.9 && of("radiance").probability < 0.05, "{three:?}");
    assert!(are_close(of("mitsuba").deviation.unwrap(), 0.1));
    for engines in
        [&[("simulator", 1.0), ("mitsuba", 1.1)][..], &[("simulator", 1.0), ("mitsuba", 1.0), ("radiance", 1.0)]]
    {
        assert!(consensus_by_factor(engines).witnesses.iter().all(|w| w.probability == 0.0));
    }
    let unread = recording("radiance", &[]);
    assert_eq!(built_in().consensus(&task(1), &[&unread]), None);
    assert_eq!(built_in().consensus(&task(1), &[]), None);
}
