//! The laws of baselines: refused unless they match, noise distinguished from shifts, nothing accepted without a reason.

use std::fs;

use serde_json::json;

use super::*;
use luxproof_model::Summary;
use luxproof_model::{Estimate, MeterId, Method, ProcedureId, Quantity, Uncertainty};
use luxproof_process::envelope::damaged;
use luxproof_process::random::normal;

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

fn reviewed(old: &[Entry], new: &[Entry], answers: &str) -> (Decision, String) {
    let changes = compare(old, new, &References::default());
    let (mut output, review) = (vec![], Review { changes: &changes, accepted: old, candidates: new });
    let decision = review.ask("2026-11-21T00:00:00Z", &mut answers.as_bytes(), &mut output).unwrap();
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
fn a_review_of_another_task_shows_old_and_new_as_does_accepting_everything() {
    let (old, new) = (entry(&[100.0, 50.0], Some(1.0)), entry(&[120.0, 50.0], Some(1.0)));
    let other = Entry { content_sha256: "cd".repeat(32), ..new };
    let (old, new) = ([old], [other]);
    let (_, text) = reviewed(&old, &new, "n\n");
    assert!(text.contains("REFUSED") && text.contains("old 100.000000 new 120.000000 lx"), "{text}");
    let changes = compare(&old, &new, &References::default());
    let (mut output, review) = (vec![], Review { changes: &changes, accepted: &old, candidates: &new });
    let decision = review.accept_all("new room", "2026-11-21T00:00:00Z", &mut output).unwrap();
    assert_eq!((decision.accepted.len(), decision.accepted[0].reason.as_str()), (1, "new room"));
    assert!(String::from_utf8(output).unwrap().contains("old 100.000000 new 120.000000 lx"));
}

#[test]
fn what_is_unchanged_is_not_asked_about_and_an_ended_input_declines() {
    let old = [entry(&[100.0, 50.0], Some(1.0))];
    let (decision, text) = reviewed(&old, &old, "");
    assert_eq!((decision.accepted.len(), decision.declined, text.as_str()), (0, 0, ""));
    let (decision, _) = reviewed(&[], &old, "y\n");
    assert_eq!((decision.accepted.len(), decision.declined), (0, 1), "no reason was given");
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
