//! The odds of a consensus and its limits, against `tests/consensus.py`, which computes them by another method.

use std::collections::BTreeMap;

use luxproof_model::{Consensus, Estimate, ProcedureId, Recording, Uncertainty};
use luxproof_spec::ToleranceOverride;

use crate::Judge;
use crate::fixtures::{built_in, recording, task};

/// An engine with its readings, their standard error at the first meter, and its components.
type WitnessCase<'a> = (&'a str, &'a [f64], f64, &'a [&'a str]);

/// The readings of `radiance`, what it shares with `povray`, the odds and who departs.
type OddsCase<'a> = (&'a [f64], &'a [&'a str], f64, &'a [&'a str]);

/// The consensus of witnesses at a tolerance of 2 %.
fn consensus(witnesses: &[WitnessCase<'_>]) -> Consensus {
    let relative = ToleranceOverride { relative: 0.02, ..ToleranceOverride::default() };
    let overrides = BTreeMap::from([(ProcedureId::IndirectIlluminance, relative)]);
    let mut recordings = vec![];
    for (engine, values, error, components) in witnesses {
        let mut readings = vec![];
        // The second meter has half of the light, and half of the error.
        for (value, share) in values.iter().zip([1.0, 0.5]) {
            let sampled = Uncertainty::sampled(error * share, None);
            let uncertainty = if *error == 0.0 { Uncertainty::Exact } else { sampled };
            readings.push(Estimate { value: *value, uncertainty });
        }
        let components = components.iter().map(|c| (*c).to_owned()).collect();
        recordings.push(Recording { components, ..recording(engine, &readings) });
    }
    let judge = Judge { overrides: &overrides, ..built_in() };
    judge.consensus(&task(witnesses[0].1.len()), &recordings.iter().collect::<Vec<_>>()).unwrap()
}

#[test]
fn odds_are_those_of_a_second_implementation() {
    const SHARED: &[&str] = &["lookup"];
    let sound: [WitnessCase<'_>; 2] = [("simulator", &[100.0, 50.0], 0.0, &[]), ("mitsuba", &[100.4, 49.9], 0.5, &[])];
    let [right, wrong, also_wrong]: [&[f64]; 3] = [&[99.8, 50.1], &[103.6, 51.8], &[103.8, 51.7]];
    let cases: [OddsCase<'_>; 3] = [
        (right, &[], 245.424204318, &["povray"]),
        (right, SHARED, 1699.138174329, &["povray"]),
        (also_wrong, SHARED, 114.222375265, &["radiance", "povray"]),
    ];
    for (of_radiance, shares, odds, departing) in cases {
        let pair = [("radiance", of_radiance, 0.3, shares), ("povray", wrong, 0.2, shares)];
        let found = consensus(&[&sound[..], &pair].concat());
        assert_eq!(found.differing, 2, "{}", found.text);
        assert_eq!(found.outliers, departing, "{}", found.text);
        assert!((found.odds.unwrap() / odds - 1.0).abs() < 1e-6, "{:?} {odds}", found.odds);
    }
}

#[test]
fn witnesses_differ_by_more_than_the_wider_tolerance_and_twice_their_noise() {
    // Errors of .3 and .4 combine to .5: the readings differ from 2 % of the larger and 1 lx on.
    for (value, differing) in [(103.0, 0), (103.1, 1)] {
        assert_eq!(value - 100.0 > 0.02 * value + 1.0, differing == 1);
        let found = consensus(&[("simulator", &[100.0], 0.3, &[]), ("mitsuba", &[value], 0.4, &[])]);
        assert_eq!(found.differing, differing, "{value}: {}", found.text);
    }
}

#[test]
fn wrong_programs_of_users_count_once_where_their_errors_differ_by_less_than_a_tenth() {
    // Errors of 10 lx and of .9 lx more are similar; of 10 lx and of 1.2 lx more they are not.
    for (distance, independent) in [(0.9, 2), (1.2, 3)] {
        let witnesses: [WitnessCase<'_>; 3] =
            [("simulator", &[100.0], 0.0, &[]), ("a", &[110.0], 0.0, &[]), ("b", &[110.0 + distance], 0.0, &[])];
        assert_eq!(consensus(&witnesses).independent, independent, "{distance}");
    }
}

#[test]
fn a_users_program_is_a_copy_where_it_shares_wrong_readings_to_a_tenth_of_the_tolerance() {
    // A tenth of 2 % of 110 lx is .22 lx.
    for (distance, independent) in [(0.21, 2), (0.23, 3)] {
        let witnesses: [WitnessCase<'_>; 3] =
            [("simulator", &[100.0], 0.0, &[]), ("mitsuba", &[110.0], 0.0, &[]), ("a", &[110.0 + distance], 0.0, &[])];
        assert_eq!(consensus(&witnesses).independent, independent, "{distance}");
    }
}

#[test]
fn sampled_readings_are_copies_where_chance_brings_them_so_close_once_in_a_hundred_times() {
    // Errors of .3 and .4 combine to .5. Two squares of mean m have a chance of m e^(1 - m) at most, which is .01 at .003692.
    let farthest = 0.5 * 0.003692_f64.sqrt();
    for (distance, independent) in [(0.99 * farthest, 2), (1.01 * farthest, 3)] {
        let wrong = [110.0 + distance, 55.0 + 0.5 * distance];
        let witnesses: [WitnessCase<'_>; 3] =
            [("simulator", &[100.0, 50.0], 0.0, &[]), ("mitsuba", &[110.0, 55.0], 0.3, &[]), ("a", &wrong, 0.4, &[])];
        assert_eq!(consensus(&witnesses).independent, independent, "{distance}");
    }
}
