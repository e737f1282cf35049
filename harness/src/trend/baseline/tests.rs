//! The laws of baselines: refused unless they match, noise told apart from shifts, nothing accepted without a reason.

use std::fs;

use serde_json::json;

use super::*;
use crate::record::{Estimate, MeterId, Method, ProcedureId, Quantity, Uncertainty};
use crate::report::Summary;
use crate::system::envelope::tests::planted;
use crate::system::random::normal;

fn entry(values: &[f64], std_error: Option<f64>) -> Entry {
    let reading = |(k, value): (usize, &f64)| Reading {
        meter: MeterId::new("plane", k),
        quantity: Quantity::Illuminance,
        value: *value,
        uncertainty: std_error.map_or(Uncertainty::Exact, |e| Uncertainty::sampled(e, None)),
    };
    Entry {
        key: ReadingKey::new("room", ProcedureId::IndirectIlluminance, "radiance"),
        version: "6.0a".into(),
        model: "point".into(),
        light: "indirect, 7 bounces".to_owned().try_into().unwrap(),
        input_sha256: "ab".repeat(32),
        method: [("preset", "audit")].into(),
        accepted: "2026-01-01T00:00:00Z".into(),
        reason: "first look".into(),
        readings: values.iter().enumerate().map(reading).collect(),
    }
}

fn noisy(rng: &mut fastrand::Rng, meters: usize, std_error: f64, shift: f64) -> Vec<f64> {
    (0..meters).map(|k| (100.0 + k as f64) * (1.0 + shift) + std_error * normal(rng)).collect()
}

fn compared(old: &[&Entry], new: &[&Entry], comparability: Comparability) -> Changes {
    let [old, new] = [old, new].map(|side| side.iter().map(|e| (*e).clone()).collect::<Vec<_>>());
    compare(&old, &new, comparability)
}

fn state(old: &Entry, new: &Entry) -> State {
    compared(&[old], &[new], Comparability::SameInstrument).entries[0].state
}

#[test]
fn noise_alone_is_called_a_change_at_most_once_in_a_hundred_runs() {
    let mut rng = fastrand::Rng::with_seed(7);
    let runs = 2000;
    let alarms = (0..runs)
        .filter(|_| {
            let [a, b] = [0, 1].map(|_| entry(&noisy(&mut rng, 192, 0.5, 0.0), Some(0.5)));
            state(&a, &b) != State::Unchanged
        })
        .count();
    // 20 expected; 36 is three and a half standard deviations above.
    assert!(alarms <= 36, "{alarms} of {runs}");
}

#[test]
fn a_shift_far_below_the_noise_of_one_meter_is_found_in_the_mean() {
    let mut rng = fastrand::Rng::with_seed(8);
    let found = (0..100)
        .filter(|_| {
            let a = entry(&noisy(&mut rng, 192, 0.5, 0.0), Some(0.5));
            let b = entry(&noisy(&mut rng, 192, 0.5, 0.003), Some(0.5));
            state(&a, &b) == State::Shifted
        })
        .count();
    // .3 % of some 195 lx is .6 lx, 0.8 of the noise of one difference, but 11 of that of their mean.
    assert!(found == 100, "{found}");
}

/// Two runs of so many entries, as blocks would state their standard errors, the second one's means shifted by so many of theirs.
fn of_blocks(rng: &mut fastrand::Rng, entries: usize, meters: usize, blocks: usize, shift: f64) -> [Vec<Entry>; 2] {
    let sigma = |k: usize| 0.1 * (1.0 + k as f64 % 5.0);
    let weights: f64 = (0..meters).map(|k| ((100.0 + k as f64) / sigma(k)).powi(2) / 2.0).sum();
    let mut side = |relative: f64| -> Vec<Entry> {
        let mut one = |n: usize| {
            let truth: Vec<f64> = (0..meters).map(|k| (100.0 + k as f64) * (1.0 + relative)).collect();
            let mut entry = Entry { version: n.to_string(), ..entry(&truth, None) };
            entry.key.case = format!("room {n}");
            for (k, reading) in entry.readings.iter_mut().enumerate() {
                let spread = sigma(k) * (blocks as f64).sqrt();
                let samples: Vec<f64> = (0..blocks).map(|_| reading.value + spread * normal(rng)).collect();
                let estimate = Estimate::of_samples(&samples);
                (reading.value, reading.uncertainty) = (estimate.value, estimate.uncertainty);
            }
            entry
        };
        (0..entries).map(&mut one).collect()
    };
    [side(0.0), side(shift / weights.sqrt())]
}

#[test]
fn nothing_at_all_changes_in_99_of_100_comparisons_of_runs_with_few_blocks() {
    let mut rng = fastrand::Rng::with_seed(21);
    for (entries, meters, blocks, runs) in [(4, 14, 8, 1500), (1, 100, 8, 800), (3, 4, 16, 1500), (4, 14, 4, 1500)] {
        let mut alarms = 0;
        for _ in 0..runs {
            let [a, b] = of_blocks(&mut rng, entries, meters, blocks, 0.0);
            alarms += usize::from(!compare(&a, &b, Comparability::SameInstrument).is_clean());
        }
        println!("{alarms} of {runs} with {entries} entries of {meters} meters and {blocks} blocks");
        // One in a hundred, and three standard deviations of the count.
        let expected = 0.01 * f64::from(runs);
        assert!(alarms as f64 <= expected + 3.0 * expected.sqrt(), "{alarms} of {runs}");
    }
}

#[test]
fn a_shift_of_5_3_standard_errors_of_the_mean_is_called_shifted() {
    let mut rng = fastrand::Rng::with_seed(22);
    for (entries, meters, blocks) in [(4, 14, 8), (4, 14, 16), (1, 100, 8)] {
        let mut shifted = 0;
        for _ in 0..200 {
            let [a, b] = of_blocks(&mut rng, entries, meters, blocks, 5.3);
            shifted += usize::from(compare(&a, &b, Comparability::SameInstrument).entries[0].state == State::Shifted);
        }
        println!("{shifted} of 200 with {entries} entries of {meters} meters and {blocks} blocks");
        assert!(shifted >= 180, "{shifted} of 200 with {entries} entries of {meters} meters and {blocks} blocks");
    }
}

#[test]
fn more_looks_at_the_same_instrument_are_no_other_instrument() {
    let run = |effort: serde_json::Value, looks: [u32; 1]| {
        let key = json!({"case": "room", "procedure": "indirect_illuminance", "engine": "mitsuba"});
        let with = |more: serde_json::Value| {
            let both = [&key, &more].map(|part| part.as_object().unwrap().clone());
            both.into_iter().flatten().collect::<serde_json::Map<_, _>>()
        };
        let recording = with(
            json!({"version": "1", "light": "direct", "input_sha256": "ab", "seed": 1, "method": {"preset": "audit"},
            "effort": effort, "looks": looks, "approximation": null, "notes": [], "failure": null, "wall_s": 1}),
        );
        let reading = with(
            json!({"model": "point", "meter": "plane[0]", "quantity": "illuminance_lx", "value": 100, "std_error": 1}),
        );
        let report: Report = serde_json::from_value(json!({"luxproof": 1, "tool_version": "1", "started": "", "wall_s": 1,
            "spec": {"path": "", "sha256": "", "title": ""}, "engines": [], "comparisons": [], "skips": [], "summary": Summary::default(),
            "recordings": [recording], "readings": [reading]}))
        .unwrap();
        Baseline::candidate(&report).entries
    };
    let once = run(json!({"seed": "1", "mirrored_meters": "plane[1] is plane[0]"}), [1]);
    let twice = run(json!({"seed": "2", "look2_command": "again", "blocks": "32"}), [2]);
    let change = &compare(&once, &twice, Comparability::SameInstrument).entries[0];
    assert!(change.state == State::Unchanged && change.meters.len() == 1, "{change:?}");
}

#[test]
fn one_meter_that_moved_is_named_and_the_mean_is_not_blamed() {
    let mut rng = fastrand::Rng::with_seed(9);
    let a = entry(&noisy(&mut rng, 100, 0.5, 0.0), Some(0.5));
    let mut b = entry(&noisy(&mut rng, 100, 0.5, 0.0), Some(0.5));
    b.readings[17].value += 8.0;
    let changes = compare(&[a], &[b], Comparability::SameInstrument);
    assert_eq!(changes.entries[0].state, State::Changed);
    let moved: Vec<_> = changes.entries[0].meters.iter().filter(|m| m.significant).map(|m| &m.meter.0).collect();
    assert_eq!(moved, ["plane[17]"]);
}

#[test]
fn few_blocks_are_granted_the_wide_tails_of_student() {
    let (a, b) = (entry(&[100.0, 100.0], Some(1.0)), entry(&[107.0, 100.0], Some(1.0)));
    assert_eq!(state(&a, &b), State::Changed, "4.9 u of a normal distribution");
    let few = [a, b].map(|mut entry| {
        entry.readings[0].uncertainty = Uncertainty::sampled(1.0, Some(2.0));
        entry
    });
    assert_eq!(state(&few[0], &few[1]), State::Unchanged, "4.9 u with four degrees of freedom");
}

#[test]
fn exact_values_may_differ_by_single_precision_only_and_what_is_no_number_is_a_change() {
    for (value, std_error, expected) in [
        (100.000_05, None, State::Unchanged),
        (100.001, None, State::Changed),
        (f64::NAN, Some(1.0), State::Changed),
        (f64::INFINITY, Some(1.0), State::Changed),
    ] {
        assert_eq!(state(&entry(&[100.0, 50.0], std_error), &entry(&[value, 50.0], std_error)), expected, "{value}");
    }
}

#[test]
fn a_baseline_of_another_spec_version_model_light_or_setting_is_refused() {
    let a = entry(&[100.0, 50.0], Some(1.0));
    let others = [
        Entry { input_sha256: "cd".repeat(32), ..a.clone() },
        Entry { version: "6.1".into(), ..a.clone() },
        Entry { model: "area".into(), ..a.clone() },
        Entry { light: "indirect, all bounces".to_owned().try_into().unwrap(), ..a.clone() },
        Entry { method: Method::default(), ..a.clone() },
    ];
    for other in &others {
        let change = compared(&[&a], &[other], Comparability::SameInstrument);
        assert_eq!(change.entries[0].state, State::Refused);
        assert!(!change.is_clean() && change.entries[0].notes.len() == 1, "{change:?}");
    }
    // Between two runs a new version is what one wants to know about; another spec is still another thing.
    let of_runs = |other: &Entry| compared(&[&a], &[other], Comparability::SameSpec).entries[0].state;
    let expected = [State::Refused, State::Unchanged, State::Refused, State::Refused, State::Unchanged];
    assert_eq!(others.each_ref().map(of_runs), expected);
}

#[test]
fn what_vanished_fails_and_what_is_new_is_said() {
    let a = entry(&[100.0, 50.0], Some(1.0));
    let gone = compared(&[&a], &[], Comparability::SameSpec);
    assert_eq!((gone.entries[0].state, gone.is_clean()), (State::Vanished, false));
    let new = compared(&[], &[&a], Comparability::SameSpec);
    assert_eq!((new.entries[0].state, new.is_clean()), (State::New, true));
    let meter_gone = entry(&[100.0], Some(1.0));
    assert_eq!(state(&a, &meter_gone), State::Vanished);
}

#[test]
fn a_file_comes_back_as_it_was_with_one_reading_a_line() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("kept/room.json");
    let baseline = Baseline { entries: vec![entry(&[0.1, 1.0 / 3.0, 1e-300], Some(0.1))] };
    baseline.write(&path).unwrap();
    assert_eq!(Baseline::read(&path).unwrap(), baseline);
    let text = fs::read_to_string(&path).unwrap();
    assert_eq!(text.lines().filter(|l| l.contains("\"meter\"")).count(), 3, "{text}");
}

/// What is wrong with a file of these entries.
fn refused(entries: Vec<Entry>) -> BaselineError {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("room.json");
    Baseline { entries }.write(&path).unwrap();
    Baseline::read(&path).unwrap_err()
}

#[test]
fn a_candidate_and_what_is_no_single_sound_reading_are_refused_as_baselines() {
    let sound = entry(&[1.0, 2.0], Some(0.1));
    let not_accepted = refused(vec![Entry { reason: " ".into(), ..sound.clone() }]);
    assert!(matches!(not_accepted, BaselineError::NotAccepted { .. }), "{not_accepted}");
    for bad in [entry(&[-1.0], None), entry(&[], None)] {
        assert!(matches!(refused(vec![bad]), BaselineError::Unsound { .. }));
    }
    let mut twice = sound.clone();
    twice.readings.push(sound.readings[0].clone());
    assert!(refused(vec![twice]).to_string().contains(" at plane[0] stands there twice"));
    assert!(matches!(refused(vec![sound.clone(), sound.clone()]), BaselineError::Twice { meter: None, .. }));
    for freedom in [0.0, -1.0] {
        let mut senseless = sound.clone();
        senseless.readings[1].uncertainty = Uncertainty::sampled(0.1, Some(freedom));
        assert!(refused(vec![senseless]).to_string().contains("positive degrees of freedom"), "{freedom}");
    }
}

#[test]
fn meters_that_nobody_accepted_are_no_baseline_for_any() {
    let (few, all) = (entry(&[100.0], Some(1.0)), entry(&[100.0, 50.0, 20.0], Some(1.0)));
    let change = &compared(&[&few], &[&all], Comparability::SameInstrument).entries[0];
    assert_eq!((change.state, change.notes.len()), (State::New, 2), "{change:?}");
    assert!(change.notes[0].contains("plane[1]"), "{change:?}");
    // What moved is told before what is missing.
    assert_eq!(state(&few, &entry(&[200.0, 50.0], Some(1.0))), State::Changed);
}

#[test]
fn absurd_numbers_are_changes_and_no_panic() {
    for (old, new, error) in [(1e-300, 1e308, 1e-200), (1e308, 1e-300, 1e300), (5e-324, 1.0, 5e-324)] {
        let sides = [old, new].map(|value| entry(&[value, value], Some(error)));
        assert_ne!(state(&sides[0], &sides[1]), State::Unchanged, "{old} {new} {error}");
    }
}

#[test]
fn an_edited_torn_moved_or_older_file_is_no_baseline_and_the_error_says_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("room.json");
    Baseline { entries: vec![entry(&[0.5], None)] }.write(&path).unwrap();
    let sound = fs::read(&path).unwrap();
    for bytes in planted(sound.trim_ascii_end()) {
        fs::write(&path, &bytes).unwrap();
        // White space between the parts may be another.
        let read = Baseline::read(&path).map(|b| b.entries);
        assert!(read.is_err() || read.unwrap() == [entry(&[0.5], None)], "{}", String::from_utf8_lossy(&bytes));
    }
    fs::write(&path, r#"{"luxproof_baseline": 1, "entries": []}"#).unwrap();
    let error = Baseline::read(&path).unwrap_err().to_string();
    assert!(error.contains("room.json is cut short") && error.contains("luxproof accept"), "{error}");
    fs::write(&path, &sound).unwrap();
    assert!(Baseline::of_run(&path, ["hall", "room/dark"]).is_ok());
    let error = Baseline::of_run(&path, ["office/dark", "office/light"]).unwrap_err().to_string();
    assert!(error.contains("is about room, and this run about office"), "{error}");
}

fn reviewed(old: &[Entry], new: &[Entry], says: &str) -> (Decision, String) {
    let changes = compare(old, new, Comparability::SameInstrument);
    let mut output = vec![];
    let decision = review(&changes, new, "2026-11-21T00:00:00Z", &mut says.as_bytes(), &mut output).unwrap();
    (decision, String::from_utf8(output).unwrap())
}

#[test]
fn a_review_shows_old_and_new_in_units_of_uncertainty_and_insists_on_a_reason() {
    let (old, new) = (entry(&[100.0, 50.0], Some(1.0)), entry(&[120.0, 50.0], Some(1.0)));
    let (decision, text) = reviewed(&[old], &[new], "perhaps\ny\n\nnew table\n");
    assert!(text.contains("old 100.000000 new 120.000000 lx, change +20.000000: +14.1 u  <- changed"), "{text}");
    assert!(text.contains("needs a reason"));
    assert_eq!(decision.accepted.len(), 1);
    assert_eq!((decision.accepted[0].reason.as_str(), decision.declined), ("new table", 0));
}

#[test]
fn what_is_unchanged_is_not_asked_about_and_an_ended_input_declines() {
    let old = [entry(&[100.0, 50.0], Some(1.0))];
    let (decision, text) = reviewed(&old, &old, "");
    assert_eq!((decision.accepted.len(), decision.declined, text.as_str()), (0, 0, ""));
    let (decision, _) = reviewed(&[], &old, "y\n");
    assert_eq!((decision.accepted.len(), decision.declined), (0, 1), "no reason was given");
}
