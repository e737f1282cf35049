//! Laws of the cache: a stored entry comes back to the last bit, and damaged or foreign ones do not.

use std::time::Duration;

use super::*;
use crate::measure::{Cost, Failure};
use luxproof_engines::{Blocks, Job, Measurement, NoiseSummary, Sensor};
use luxproof_model::FailureKind;
use luxproof_model::{Estimate, ProcedureId, ReadingKey, Uncertainty};
use luxproof_process::envelope::damaged;

fn sample() -> Entry {
    let estimates = [0.1 + 0.2, 1.0 / 3.0, 5e-324, 1.797_693_134_862_315_7e308, 9.007_199_254_740_993e15]
        .map(|value| Estimate { value, uncertainty: Uncertainty::sampled(value / 7.0, Some(7.0)) });
    let measurement = Measurement {
        estimates: estimates.into(),
        method: [("solver", "a")].into(),
        effort: [("seed", "1")].into(),
        notes: vec!["a note with \"quotes\" and µ".to_owned()],
        samples: vec![Blocks::new(vec![vec![1.0 / 3.0; 5], vec![0.1 + 0.2; 5]])],
        cut_to: Some(0.5),
        work_s: Some(1.1),
        forgotten: NoiseSummary::default(),
    };
    Entry {
        key: ReadingKey::new("case", ProcedureId::DirectIlluminance, "radiance"),
        version: "6.0a".into(),
        cost: Cost { wall_s: 1.234_567_890_123_456_7, cpu_s: 0.1, peak_mib: Some(20.3) },
        answer: Ok(measurement),
    }
}

fn a_key(digit: char) -> Key {
    Key { engine: "radiance".into(), digits: digit.to_string().repeat(64) }
}

#[test]
fn an_entry_comes_back_to_the_last_bit() {
    let folder = tempfile::tempdir().unwrap();
    let cache = Cache::at(folder.path().join("not there yet"));
    assert_eq!(cache.find(&a_key('a')), Lookup::Unknown);
    let mut random = fastrand::Rng::with_seed(3);
    for _ in 0..2000 {
        let mut entry = sample();
        entry.answer.as_mut().unwrap().estimates[0].value = f64::from_bits(random.u64(0..0x7ff0_0000_0000_0000));
        let text = entry::text(&entry, &a_key('a').digits).unwrap();
        assert_eq!(entry::parse(text.as_bytes(), &a_key('a').digits).unwrap(), entry);
    }
    cache.keep(&a_key('a'), &sample()).unwrap();
    assert_eq!(cache.find(&a_key('a')), Lookup::Found(Box::new(sample())));
    assert_eq!(cache.find(&a_key('b')), Lookup::Unknown);
    let hung = Entry { answer: Err(Failure::new(FailureKind::Hang, "past its limit")), ..sample() };
    cache.keep(&a_key('b'), &hung).unwrap();
    assert_eq!(cache.find(&a_key('b')), Lookup::Found(Box::new(hung)));
}

#[test]
fn whatever_is_cut_flipped_or_foreign_is_found_out() {
    let folder = tempfile::tempdir().unwrap();
    let cache = Cache::at(folder.path());
    cache.keep(&a_key('a'), &sample()).unwrap();
    let path = cache.path(&a_key('a'));
    let sound = std::fs::read(&path).unwrap();
    // What lacks the feed at its end only is whole.
    for bytes in damaged(sound.trim_ascii_end()) {
        assert!(entry::parse(&bytes, &a_key('a').digits).is_err(), "{}", String::from_utf8_lossy(&bytes));
    }
    for at in [0, 1, sound.len() / 2, sound.len() - 2] {
        std::fs::write(&path, &sound[..at]).unwrap();
        assert!(matches!(cache.find(&a_key('a')), Lookup::Damaged(why) if why.contains("cut short")), "{at}");
    }
    // Of an earlier form of this program.
    std::fs::write(&path, String::from_utf8_lossy(&sound).replace("entry 3", "entry 2")).unwrap();
    assert!(matches!(cache.find(&a_key('a')), Lookup::Damaged(why) if why.contains("`luxproof cache entry 2`")));
    std::fs::write(cache.path(&a_key('b')), &sound).unwrap();
    assert!(matches!(cache.find(&a_key('b')), Lookup::Damaged(why) if why.contains("moved or renamed")));
    cache.keep(&a_key('b'), &sample()).unwrap();
    assert_eq!(cache.find(&a_key('b')), Lookup::Found(Box::new(sample())));
}

#[test]
fn pruning_takes_damaged_and_unused_entries_and_leaves_a_live_writers_file() {
    let folder = tempfile::tempdir().unwrap();
    let cache = Cache::at(folder.path());
    cache.keep(&a_key('a'), &sample()).unwrap();
    std::fs::write(cache.path(&a_key('b')), "{").unwrap();
    let (live, left) = ("radiance/.unfinished-live", "radiance/.unfinished-left");
    std::fs::write(folder.path().join(live), "{").unwrap();
    let old = std::fs::File::create(folder.path().join(left)).unwrap();
    old.set_modified(std::time::SystemTime::now() - Duration::from_secs(7200)).unwrap();
    let contents = cache.contents().unwrap();
    assert_eq!((contents.engines["radiance"].0, contents.damaged.len(), contents.unfinished), (1, 1, 2));
    let pruned = cache.prune(Duration::from_secs(86_400)).unwrap();
    assert_eq!((pruned.unused, pruned.damaged, pruned.unfinished), (0, 1, 1));
    assert_eq!(cache.find(&a_key('a')), Lookup::Found(Box::new(sample())));
    assert!(folder.path().join(live).exists());
    // A list of meters is neither an entry nor damaged, and goes like an entry.
    cache.list(&a_key('c'), &[]).unwrap();
    assert!(cache.contents().unwrap().damaged.is_empty() && cache.listed(&a_key('c')) == [vec![]]);
    assert_eq!(cache.prune(Duration::from_secs(86_400)).unwrap(), Pruned::default());
    assert_eq!(cache.prune(Duration::ZERO).unwrap().unused, 1);
    assert!(cache.listed(&a_key('c')).is_empty());
    assert_eq!(cache.find(&a_key('a')), Lookup::Unknown);
}

#[test]
fn lists_of_meters_are_bounded_and_the_latest_is_first() {
    let folder = tempfile::tempdir().unwrap();
    let cache = Cache::at(folder.path());
    let job = luxproof_engines::fixtures::s1(luxproof_scene::Transport::Direct);
    let lists: Vec<Vec<Sensor>> = (0..20).map(|n| two_stations(&job, n)).collect();
    for list in &lists {
        cache.list(&a_key('a'), list).unwrap();
    }
    let mut latest = lists[12..].to_vec();
    latest.reverse();
    assert_eq!(cache.listed(&a_key('a')), latest);
    // A list with all of its meters among the new ones is dropped.
    cache.list(&a_key('a'), &[&lists[18][..], &lists[19], &lists[17]].concat()).unwrap();
    assert_eq!(cache.listed(&a_key('a')).len(), 6);
    // Too many meters are not listed; of many, only the latest list stays.
    cache.list(&a_key('a'), &vec![job.sensors[0].clone(); 50_001]).unwrap();
    assert_eq!(cache.listed(&a_key('a')).len(), 6);
    let many = vec![job.sensors[0].clone(); 49_999];
    cache.list(&a_key('a'), &many).unwrap();
    assert_eq!(cache.listed(&a_key('a')), [many]);
}

/// Two sensors of a job, moved by `n` meters.
fn two_stations(job: &Job, n: usize) -> Vec<Sensor> {
    let mut sensors = job.sensors[..2].to_vec();
    for sensor in &mut sensors {
        sensor.meter.position_m.x += n as f64;
    }
    sensors
}
