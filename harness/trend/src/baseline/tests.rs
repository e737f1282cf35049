//! The laws of baselines: refused unless they match, noise distinguished from shifts, nothing accepted without a reason.

use std::fs;

use serde_json::json;

use super::*;
use luxproof_model::Summary;
use luxproof_model::{Estimate, MeterId, Method, ProcedureId, Quantity, Uncertainty};
use luxproof_process::envelope::damaged;
use luxproof_process::random::normal;

mod reviews;

fn entry(values: &[f64], std_error: Option<f64>) -> Entry {
    let mut readings = vec![];
    for (k, value) in values.iter().enumerate() {
        let uncertainty = std_error.map_or(Uncertainty::Exact, |e| Uncertainty::sampled(e, None));
        let estimate = Estimate { value: *value, uncertainty };
        readings.push(Reading::new(MeterId::new("plane", k), Quantity::Illuminance, estimate));
    }
    Entry {
        key: ReadingKey::new("room", ProcedureId::IndirectIlluminance, "radiance"),
        version: "6.0a".into(),
        model: "point".into(),
        light: "indirect, 7 bounces".to_owned().try_into().unwrap(),
        content_sha256: "ab".repeat(32),
        method: [("preset", "audit")].into(),
        accepted: "2026-01-01T00:00:00Z".into(),
        reason: "first look".into(),
        readings,
    }
}

fn noisy(rng: &mut fastrand::Rng, meters: usize, std_error: f64, shift: f64) -> Vec<f64> {
    (0..meters).map(|k| (100.0 + k as f64) * (1.0 + shift) + std_error * normal(rng)).collect()
}

fn compared(old: &[&Entry], new: &[&Entry]) -> Changes {
    let [old, new] = [old, new].map(|side| side.iter().map(|e| (*e).clone()).collect::<Vec<_>>());
    compare(&old, &new, &References::default())
}

fn state(old: &Entry, new: &Entry) -> State {
    compared(&[old], &[new]).entries[0].state
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

/// The standard error of a meter.
fn sigma(k: usize) -> f64 {
    0.1 * (1.0 + k as f64 % 5.0)
}

/// The size of a simulated run.
#[derive(Clone, Copy)]
struct RunSize {
    entries: usize,
    meters: usize,
    blocks: usize,
}

/// A run with means of blocks as readings, all shifted by this relative amount.
fn simulate_run(rng: &mut fastrand::Rng, RunSize { entries, meters, blocks }: RunSize, shift: f64) -> Vec<Entry> {
    let truth: Vec<f64> = (0..meters).map(|k| (100.0 + k as f64) * (1.0 + shift)).collect();
    let mut run = vec![];
    for n in 0..entries {
        let mut entry = Entry { version: n.to_string(), ..entry(&truth, None) };
        entry.key.case = format!("room {n}");
        for (k, reading) in entry.readings.iter_mut().enumerate() {
            let spread = sigma(k) * (blocks as f64).sqrt();
            let samples: Vec<f64> = (0..blocks).map(|_| reading.value + spread * normal(rng)).collect();
            let estimate = Estimate::of_samples(&samples);
            (reading.value, reading.uncertainty) = (estimate.value, estimate.uncertainty);
        }
        run.push(entry);
    }
    run
}

/// Two runs with means that differ by so many standard errors of the mean.
fn of_blocks(rng: &mut fastrand::Rng, entries: usize, meters: usize, blocks: usize, shift: f64) -> [Vec<Entry>; 2] {
    let size = RunSize { entries, meters, blocks };
    let weights: f64 = (0..meters).map(|k| ((100.0 + k as f64) / sigma(k)).powi(2) / 2.0).sum();
    [0.0, shift / weights.sqrt()].map(|relative| simulate_run(rng, size, relative))
}

#[test]
fn nothing_at_all_changes_in_99_of_100_comparisons_of_runs_with_few_blocks() {
    let mut rng = fastrand::Rng::with_seed(21);
    for (entries, meters, blocks, runs) in [(4, 14, 8, 1500), (1, 100, 8, 800), (3, 4, 16, 1500), (4, 14, 4, 1500)] {
        let mut alarms = 0;
        for _ in 0..runs {
            let [a, b] = of_blocks(&mut rng, entries, meters, blocks, 0.0);
            alarms += usize::from(!compare(&a, &b, &References::default()).is_clean());
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
            shifted += usize::from(compare(&a, &b, &References::default()).entries[0].state == State::Shifted);
        }
        println!("{shifted} of 200 with {entries} entries of {meters} meters and {blocks} blocks");
        assert!(shifted >= 180, "{shifted} of 200 with {entries} entries of {meters} meters and {blocks} blocks");
    }
}

/// The candidate of a run with one reading, which took this effort and so many stages.
fn candidate_of(effort: &serde_json::Value, stages: u32) -> Vec<Entry> {
    let report: Report = serde_json::from_value(json!({"luxproof": 2, "tool_version": "1", "started": "", "wall_s": 1,
        "spec": {"path": "", "sha256": "", "title": ""}, "engines": [], "comparisons": [], "skips": [], "summary": Summary::default(),
        "recordings": [{"case": "room", "procedure": "indirect_illuminance", "engine": "mitsuba", "version": "1",
            "light": "direct", "input_sha256": "ab", "content_sha256": "cd", "seed": 1, "method": {"preset": "audit"}, "effort": effort,
            "stages": [stages], "approximation": null, "notes": [], "failure": null, "wall_s": 1}],
        "readings": [{"case": "room", "procedure": "indirect_illuminance", "engine": "mitsuba", "model": "point",
            "meter": "plane[0]", "quantity": "illuminance_lx", "value": 100, "std_error": 1}]}))
    .unwrap();
    Baseline::candidate(&report).entries
}

#[test]
fn more_stages_of_the_same_instrument_are_no_other_instrument() {
    let once = candidate_of(&json!({"seed": "1", "mirrored_meters": "plane[1] is plane[0]"}), 1);
    let twice = candidate_of(&json!({"seed": "2", "stage2_command": "again", "blocks": "32"}), 2);
    let change = &compare(&once, &twice, &References::default()).entries[0];
    assert!(change.state == State::Unchanged && change.meters.len() == 1, "{change:?}");
}

#[test]
fn a_shift_has_the_sign_of_new_less_old_and_the_weighted_mean_of_relative_changes() {
    let up = compared(&[&entry(&[100.0, 200.0], Some(1.0))], &[&entry(&[102.0, 202.0], Some(1.0))]);
    // Changes of 2 % and 1 % with weights of 1 to 4: 1.2 %; their variances are 2 / 100^2 and 2 / 200^2.
    let shift = up.entries[0].mean.unwrap();
    assert!((shift.relative - 0.012).abs() < 1e-12, "{shift}");
    assert!((shift.uncertainty - 25_000_f64.sqrt().recip()).abs() < 1e-12, "{shift}");
    // Beyond 1.897367 standard errors on either side of a normal distribution.
    assert!((shift.p_value - 0.0577796).abs() < 1e-6, "{}", shift.p_value);
    assert_eq!(shift.to_string(), "+1.2000 % ± 0.6325 % (+1.9 u)");
    let meter = &up.entries[0].meters[0];
    assert_eq!((meter.old, meter.new), (100.0, 102.0));
    assert!((meter.uncertainty - 2f64.sqrt()).abs() < 1e-12, "{meter:?}");
    // Half of one in a hundred for two meters, and half for one mean: 1 - .995^(1/2) and 1 - .995.
    assert!((up.level - 0.002503132).abs() < 1e-9 && (up.level_of_means - 0.005).abs() < 1e-12);
    let down = compared(&[&entry(&[102.0, 202.0], Some(1.0))], &[&entry(&[100.0, 200.0], Some(1.0))]);
    assert!(down.entries[0].mean.unwrap().relative < -0.0118);
}

#[test]
fn one_meter_that_moved_is_named_and_the_mean_is_not_blamed() {
    let mut rng = fastrand::Rng::with_seed(9);
    let a = entry(&noisy(&mut rng, 100, 0.5, 0.0), Some(0.5));
    let mut b = entry(&noisy(&mut rng, 100, 0.5, 0.0), Some(0.5));
    b.readings[17].value += 8.0;
    let changes = compare(&[a], &[b], &References::default());
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
fn exact_values_may_differ_by_single_precision_of_the_larger() {
    // A millionth of the larger value is 1.0000010000005e-6.
    let [small, large] = [1.0, 1.000_001_000_000_5].map(|value| entry(&[value, 50.0], None));
    assert_eq!((state(&small, &large), state(&large, &small)), (State::Unchanged, State::Unchanged));
}

#[test]
fn a_change_has_the_error_and_the_degrees_of_freedom_of_both_sides() {
    let [mut before, mut now] = [entry(&[100.0], None), entry(&[101.0], None)];
    before.readings[0].uncertainty = Uncertainty::sampled(1.0, Some(2.0));
    now.readings[0].uncertainty = Uncertainty::sampled(3.0, Some(18.0));
    let meter = &compared(&[&before], &[&now]).entries[0].meters[0];
    // GUM G.2b: (1 + 9)^2 / (1^2 / 2 + 9^2 / 18).
    assert!((meter.uncertainty - 10.0_f64.sqrt()).abs() < 1e-12, "{meter:?}");
    assert!((meter.degrees_of_freedom.unwrap() - 20.0).abs() < 1e-9, "{meter:?}");
}

#[test]
fn a_baseline_of_another_task_is_refused_and_that_of_another_version_or_setting_is_compared() {
    let a = entry(&[100.0, 50.0], Some(1.0));
    let other_tasks = [
        Entry { content_sha256: "cd".repeat(32), ..a.clone() },
        Entry { model: "area".into(), ..a.clone() },
        Entry { light: "indirect, all bounces".to_owned().try_into().unwrap(), ..a.clone() },
    ];
    for other in &other_tasks {
        let change = compared(&[&a], &[other]);
        assert_eq!(change.entries[0].state, State::Refused);
        assert!(!change.is_clean() && change.entries[0].notes.len() == 1, "{change:?}");
    }
    for (other, note) in [
        (Entry { version: "6.1".into(), ..a.clone() }, "version: 6.0a before, 6.1 now"),
        (Entry { method: Method::default(), ..a.clone() }, "setting preset: audit before, not set now"),
    ] {
        let change = compared(&[&a], &[&other]);
        assert_eq!((change.entries[0].state, change.is_clean()), (State::Unchanged, true));
        assert_eq!(change.entries[0].instrument, [note]);
        let moved = Entry { readings: entry(&[120.0, 50.0], Some(1.0)).readings, ..other };
        assert_eq!(state(&a, &moved), State::Changed);
    }
}

#[test]
fn a_factor_of_exact_readings_is_a_shift_by_this_factor_with_its_sign() {
    let a = entry(&[100.0, 50.0, 20.0], None);
    for factor in [1.004, 0.996] {
        let change = &compared(&[&a], &[&entry(&[100.0 * factor, 50.0 * factor, 20.0 * factor], None)]).entries[0];
        assert_eq!(change.state, State::Shifted);
        let relative = change.mean.unwrap().relative;
        assert!((relative - (factor - 1.0)).abs() < 1e-12, "{relative}");
    }
}

#[test]
fn several_meters_that_rise_are_a_shift_and_meters_that_rise_and_fall_are_not() {
    let a = entry(&[100.0, 50.0, 20.0, 10.0], None);
    assert_eq!(state(&a, &entry(&[100.0, 95.0, 22.0, 10.0], None)), State::Shifted);
    assert_eq!(state(&a, &entry(&[100.0, 95.0, 18.0, 10.0], None)), State::Changed);
}

/// How readings changed in a run with one reference of 100 for each meter.
fn state_with_references(old: &[f64], new: &[f64]) -> State {
    let [old, new] = [old, new].map(|values| entry(values, None));
    let mut references = References::default();
    for reading in &old.readings {
        references.0.insert((&old.key, &reading.meter, reading.quantity), vec![100.0]);
    }
    compare(std::slice::from_ref(&old), std::slice::from_ref(&new), &references).entries[0].state
}

#[test]
fn what_comes_nearer_to_the_reference_is_improved_and_what_leaves_it_is_not() {
    assert_eq!(state_with_references(&[102.0, 103.0], &[101.0, 101.0]), State::Improved);
    assert_eq!(state_with_references(&[102.0, 100.0], &[100.0, 100.0]), State::Improved);
    // Beyond the reference, further than before.
    assert_eq!(state_with_references(&[102.0, 102.0], &[97.0, 97.0]), State::Shifted);
    // One nearer, one further.
    assert_eq!(state_with_references(&[102.0, 101.0], &[101.0, 102.0]), State::Changed);
}

#[test]
fn what_vanished_fails_and_what_is_new_is_said() {
    let a = entry(&[100.0, 50.0], Some(1.0));
    let gone = compared(&[&a], &[]);
    assert_eq!((gone.entries[0].state, gone.is_clean()), (State::Vanished, false));
    let new = compared(&[], &[&a]);
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
    let change = &compared(&[&few], &[&all]).entries[0];
    assert_eq!((change.state, change.notes.len()), (State::New, 2), "{change:?}");
    assert!(change.notes[0].contains("plane[1]"), "{change:?}");
    // Moved meters come before missing ones.
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
    for bytes in damaged(sound.trim_ascii_end()) {
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

#[test]
fn a_baseline_in_a_folder_is_named_after_its_spec() {
    let folder = tempfile::tempdir().unwrap();
    let run = SpecRecord { path: "specs/office.yaml other.yaml".to_owned(), ..SpecRecord::default() };
    let named = folder.path().join("accepted.json");
    assert_eq!(Baseline::place(&named, &run), named);
    // A folder is one whatever it is called, and a name without an ending is that of a folder.
    fs::create_dir(&named).unwrap();
    assert_eq!(Baseline::place(&named, &run), named.join("office.json"));
    assert_eq!(Baseline::place(folder.path(), &run), folder.path().join("office.json"));
    assert_eq!(Baseline::place(folder.path(), &SpecRecord::default()), folder.path().join("suite.json"));
}

/// Two runs of one meter for each of these, with old value, new value, standard error and reference.
fn state_of(meters: &[[f64; 4]]) -> State {
    let [mut old, mut new] = [0, 1].map(|side| entry(&meters.iter().map(|m| m[side]).collect::<Vec<_>>(), None));
    for side in [&mut old, &mut new] {
        for (reading, [.., error, _]) in side.readings.iter_mut().zip(meters) {
            reading.uncertainty = Uncertainty::sampled(*error, None);
        }
    }
    let mut references = References::default();
    for (reading, [.., reference]) in old.readings.iter().zip(meters) {
        references.0.insert((&old.key, &reading.meter, reading.quantity), vec![*reference]);
    }
    compare(std::slice::from_ref(&old), &[new], &references).entries[0].state
}

#[test]
fn what_stays_equally_far_from_its_reference_is_not_improved() {
    assert_eq!(state_with_references(&[102.0, 100.0], &[98.0, 100.0]), State::Changed);
    assert_eq!(state_with_references(&[102.0, 100.0], &[98.5, 100.0]), State::Improved);
    assert_eq!(state_with_references(&[102.0, 100.0], &[97.5, 100.0]), State::Changed);
    // A meter that differs by rounding alone has not moved away.
    assert_eq!(state_with_references(&[102.0, 100.0], &[101.0, 100.000_05]), State::Improved);
}

#[test]
fn a_mean_that_moved_is_improved_if_it_came_nearer_in_relative_deviations() {
    // No single change is beyond 1.5 standard errors; the mean of a hundred meters is.
    for (new, state) in
        [(100.0, State::Improved), (99.0, State::Shifted), (98.9, State::Shifted), (99.1, State::Improved)]
    {
        assert_eq!(state_of(&[[101.0, new, 1.0, 100.0]; 100]), state, "{new}");
    }
    // Forty meters of 50 lx come from 2 % to 0, and forty of 1000 lx go from 0 to -0.1 %.
    let mut mixed = vec![[51.0, 50.0, 1.0, 50.0]; 40];
    mixed.extend([[1000.0, 999.0, 1.0, 1000.0]; 40]);
    assert_eq!(state_of(&mixed), State::Improved);
    let reversed: Vec<[f64; 4]> = mixed.iter().map(|[old, new, rest @ ..]| [*new, *old, rest[0], rest[1]]).collect();
    assert_eq!(state_of(&reversed), State::Shifted);
    // A reference of zero has no relative deviation. Its meter came nearer, by too little to count.
    mixed.push([0.3, 0.2, 1.0, 0.0]);
    assert_eq!(state_of(&mixed), State::Improved);
}

#[test]
fn nothing_is_improved_without_a_reference_or_away_from_one_of_several() {
    let (old, new) = (entry(&[102.0, 100.0], None), entry(&[101.0, 100.0], None));
    for (of_first, of_second, state) in [
        (vec![100.0], vec![100.0], State::Improved),
        (vec![], vec![100.0], State::Changed),
        (vec![100.0], vec![], State::Changed),
        (vec![100.0, 100.9], vec![100.0], State::Improved),
        (vec![100.0, 101.9], vec![100.0], State::Changed),
    ] {
        let mut references = References::default();
        for (reading, values) in old.readings.iter().zip([of_first, of_second]) {
            references.0.insert((&old.key, &reading.meter, reading.quantity), values);
        }
        let found = compare(std::slice::from_ref(&old), std::slice::from_ref(&new), &references);
        assert_eq!(found.entries[0].state, state, "{references:?}");
    }
}

#[test]
fn a_run_with_meters_that_nobody_accepted_is_not_called_improved() {
    let (old, new) = (entry(&[102.0], None), entry(&[101.0, 100.0], None));
    let mut references = References::default();
    references.0.insert((&old.key, &old.readings[0].meter, Quantity::Illuminance), vec![100.0]);
    let found = compare(std::slice::from_ref(&old), &[new], &references);
    assert_eq!(found.entries[0].state, State::Changed);
}

#[test]
fn references_are_those_of_all_comparisons_of_a_report() {
    let mut report = Report::default();
    for (meter, reference) in [("plane[0]", 100.0), ("plane[1]", 50.0), ("plane[0]", 101.0)] {
        let comparison = json!({"case": "room", "procedure": "indirect_illuminance", "engine": "radiance", "model": "point",
            "meter": meter, "at_m": [0, 0, 0], "normal": [0, 0, 1], "gamma_deg": null, "c_deg": null,
            "quantity": "illuminance_lx", "value": 104, "deviation": null, "relative_deviation": null,
            "reference": {"value": reference, "uncertainty": 1, "basis": "simulator", "source": ""},
            "tolerance": {"relative": 0.01, "absolute": 0}, "verdict": "pass", "diagnosis": null});
        report.comparisons.push(serde_json::from_value(comparison).unwrap());
    }
    report.comparisons.push(luxproof_model::Comparison { reference: None, ..report.comparisons[1].clone() });
    let references = References::of_report(&report);
    let key = ReadingKey::new("room", ProcedureId::IndirectIlluminance, "radiance");
    for (k, values) in [(0, vec![100.0, 101.0]), (1, vec![50.0])] {
        assert_eq!(references.0.get(&(&key, &MeterId::new("plane", k), Quantity::Illuminance)), Some(&values));
    }
}

#[test]
fn a_lone_meter_has_the_whole_level_and_no_mean() {
    let found = compared(&[&entry(&[100.0], Some(1.0))], &[&entry(&[102.0], Some(1.0))]);
    assert!((found.level - 0.01).abs() < 1e-12 && found.level_of_means == 0.0, "{found:?}");
    assert!(found.entries[0].mean.is_none() && found.tests == 1);
    // 2 over sqrt(2): 15.7299 % of a normal distribution lie beyond 1.41421 on either side.
    assert!((found.entries[0].meters[0].p_value - 0.157299).abs() < 1e-6);
}

#[test]
fn several_meters_that_fall_are_a_shift() {
    let a = entry(&[100.0, 50.0, 20.0, 10.0], None);
    assert_eq!(state(&a, &entry(&[100.0, 5.0, 18.0, 10.0], None)), State::Shifted);
    assert_eq!(state(&a, &entry(&[100.0, 50.0, 18.0, 10.0], None)), State::Changed);
}

#[test]
fn a_mean_ignores_what_has_no_relative_change_and_exact_values_among_sampled_ones() {
    for (old, new, uncertainty) in [
        (0.0, 3.0, Uncertainty::sampled(1.0, None)),
        (300.0, f64::INFINITY, Uncertainty::sampled(1.0, None)),
        (300.0, 330.0, Uncertainty::sampled(f64::INFINITY, None)),
        (300.0, 330.0, Uncertainty::Exact),
    ] {
        let (mut before, mut now) = (entry(&[100.0, 200.0, old], Some(1.0)), entry(&[102.0, 202.0, new], Some(1.0)));
        (before.readings[2].uncertainty, now.readings[2].uncertainty) = (uncertainty, uncertainty);
        // 2 % and 1 % with weights of 1 to 4.
        let shift = compared(&[&before], &[&now]).entries[0].mean.unwrap();
        assert!((shift.relative - 0.012).abs() < 1e-12, "{old} {new}: {shift}");
    }
}

#[test]
fn an_unknown_error_is_no_change_and_an_infinite_one_is() {
    for (uncertainty, p_value) in
        [(Uncertainty::NotSeen, 1.0), (Uncertainty::sampled(f64::INFINITY, None), 0.0), (Uncertainty::Exact, 0.0)]
    {
        let (before, mut now) = (entry(&[100.0], None), entry(&[130.0], None));
        now.readings[0].uncertainty = uncertainty;
        assert_eq!(compared(&[&before], &[&now]).entries[0].meters[0].p_value, p_value, "{uncertainty:?}");
        assert_eq!(compared(&[&now], &[&before]).entries[0].meters[0].p_value, p_value, "{uncertainty:?}");
    }
    // A millionth of the larger value is rounding.
    for (new, p_value) in [(100.000_09, 1.0), (99.999_91, 1.0), (100.000_11, 0.0), (99.999_89, 0.0)] {
        let found = compared(&[&entry(&[100.0], None)], &[&entry(&[new], None)]);
        assert_eq!(found.entries[0].meters[0].p_value, p_value, "{new}");
    }
}

#[test]
fn another_task_is_named_by_the_beginning_of_its_checksum() {
    let a = entry(&[100.0], None);
    let found = compared(&[&a], &[&Entry { content_sha256: "cd".repeat(32), ..a.clone() }]);
    assert_eq!(found.entries[0].notes, ["task: abababababab before, cdcdcdcdcdcd now"]);
}

#[test]
fn the_first_of_two_readings_of_a_meter_counts() {
    let a = entry(&[100.0], None);
    let mut twice = a.clone();
    twice.readings.push(entry(&[500.0], None).readings[0].clone());
    assert_eq!(compared(&[&a], &[&twice]).entries[0].meters[0].new, 100.0);
    assert_eq!(compared(&[&a], &[&a, &entry(&[500.0], None)]).entries[0].meters[0].new, 100.0);
}

#[test]
fn a_sound_entry_has_finite_readings_that_are_not_negative() {
    for (values, is_sound) in [
        (&[1.0, 0.0][..], true),
        (&[], false),
        (&[1.0, -0.5], false),
        (&[1.0, f64::INFINITY], false),
        (&[f64::NAN], false),
    ] {
        assert_eq!(entry(values, None).is_sound(), is_sound, "{values:?}");
    }
}

#[test]
fn a_candidate_has_no_calibration_and_a_failed_or_recorded_engine_no_readings() {
    let mut report = Report::default();
    for (case, procedure, role, failure) in [
        ("b", "indirect_illuminance", "renderer", None),
        ("a", "indirect_illuminance", "reference", None),
        ("c", "point", "renderer", None),
        ("d", "indirect_illuminance", "renderer", Some("crashed")),
        ("e", "indirect_illuminance", "recorded", None),
    ] {
        let key = json!({"case": case, "procedure": procedure, "engine": "mitsuba"});
        let mut recording = json!({"version": "1", "role": role, "model": "point", "light": "direct", "input_sha256": "",
            "content_sha256": "cd", "seed": 1, "method": {}, "approximation": null, "notes": [], "failure": failure,
            "wall_s": 1});
        let mut reading = json!({"model": "point", "meter": "plane[0]", "quantity": "illuminance_lx", "value": 100});
        for part in [&mut recording, &mut reading] {
            part.as_object_mut().unwrap().extend(key.as_object().unwrap().clone());
        }
        report.recordings.push(serde_json::from_value(recording).unwrap());
        report.readings.push(serde_json::from_value(reading).unwrap());
    }
    for (baseline, cases) in [
        (Baseline::candidate(&report), vec![("a", 1), ("b", 1), ("d", 0)]),
        (Baseline::whole(&report), vec![("a", 1), ("b", 1), ("c", 1), ("d", 0)]),
    ] {
        let found: Vec<_> = baseline.entries.iter().map(|e| (e.key.case.as_str(), e.readings.len())).collect();
        assert_eq!(found, cases);
        assert!(baseline.entries.iter().all(|e| e.accepted.is_empty() && e.reason.is_empty()));
    }
}

#[test]
fn an_accepted_entry_replaces_that_of_its_key_in_order() {
    let [a, b, c] = ["a", "b", "c"].map(|case| {
        let mut entry = entry(&[1.0], None);
        entry.key.case = case.to_owned();
        entry
    });
    let mut baseline = Baseline { entries: vec![a.clone(), c.clone()] };
    let newer = Entry { reason: "newer".into(), ..a };
    baseline.accept(vec![b.clone(), newer.clone()]);
    assert_eq!(baseline.entries, [newer, b, c]);
}

#[test]
fn an_empty_baseline_is_that_of_any_run_and_specs_are_named_once() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("room.json");
    Baseline::default().write(&path).unwrap();
    assert!(Baseline::of_run(&path, ["office"]).unwrap().entries.is_empty());
    let mut entries = vec![];
    for case in ["room/light", "hall", "room/dark"] {
        let mut one = entry(&[1.0], None);
        one.key.case = case.to_owned();
        entries.push(one);
    }
    assert_eq!(Baseline { entries }.subject(), "hall, room");
}
