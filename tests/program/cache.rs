//! The cache in whole runs: a repeated run starts no engine and says the same, and no kill at any instant costs or falsifies a reading.

use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;
use std::process::Stdio;
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::support::{Answer, Folder, SKEW_LAMP, SKEW_ROOM, adapter_with_lines_before_readings, is_night};

struct Lab(Folder);

impl Lab {
    /// The example adapter, which first notes that it was started for a reading.
    fn new() -> Self {
        let spec = SKEW_ROOM.to_owned() + "engines:\n  mine: {command: [python3, '-I', '-S', adapter.py]}\n";
        let adapter = adapter_with_lines_before_readings("open('starts', 'a').write('started\\n')\n");
        Self(Folder::new(&[("spec.yaml", &spec), ("lamp.ies", SKEW_LAMP), ("adapter.py", &adapter)]))
    }

    fn run(&self, out: &str, more: &[&str]) -> Answer {
        let args = ["run", "spec.yaml", "--out", out, "--no-calibration", "--format", "json"];
        self.0.luxproof(&[&args, more].concat()).exits(0)
    }

    fn starts(&self) -> usize {
        if self.0.path("starts").exists() { self.0.read("starts").lines().count() } else { 0 }
    }

    /// Every file of readings, byte by byte, and the report without the times that a run has of its own.
    fn outputs(&self, out: &str) -> (BTreeMap<String, Vec<u8>>, String) {
        let folder = self.0.path(out).join("readings").read_dir().unwrap();
        let name = |f: &fs::DirEntry| f.file_name().into_string().unwrap();
        let files = folder.map(|f| f.unwrap()).map(|f| (name(&f), fs::read(f.path()).unwrap())).collect();
        let mut report = self.0.json(&format!("{out}/report.json"));
        let own = report.as_object_mut().unwrap();
        assert!(own.remove("started").is_some() && own.remove("wall_s").is_some());
        (files, serde_json::to_string_pretty(&report).unwrap())
    }

    /// The entries of the cache, each with its text; all of them sound.
    fn entries(&self) -> BTreeMap<PathBuf, String> {
        let info = self.0.luxproof(&["cache", "info"]).exits(0).stdout;
        assert!(!info.contains("damaged"), "{info}");
        let folders = self.0.path("cache").read_dir().map_or(vec![], |d| d.map(|f| f.unwrap().path()).collect());
        let files = folders.iter().flat_map(|f| f.read_dir().unwrap()).map(|f| f.unwrap().path());
        let entry = |f: &PathBuf| f.extension().is_some_and(|e| e == "json");
        files.filter(entry).map(|f| (f.clone(), fs::read_to_string(f).unwrap())).collect()
    }
}

/// What a run says of its readings, apart from times.
fn values(said: &BTreeMap<String, Vec<u8>>) -> BTreeMap<String, Value> {
    let timeless = |bytes: &[u8]| {
        let mut recordings: Value = serde_json::from_slice(bytes).unwrap();
        for recording in recordings.as_array_mut().unwrap() {
            assert!(recording.as_object_mut().unwrap().remove("wall_s").is_some());
        }
        recordings
    };
    said.iter().map(|(name, bytes)| (name.clone(), timeless(bytes))).collect()
}

/// How often the engine is started: for two procedures, and for a twentieth of what it claims of each.
const A_RUN: usize = 4;

#[test]
fn a_repeated_run_starts_no_engine_and_says_the_same_to_the_byte() {
    let lab = Lab::new();
    lab.run("first", &[]);
    let starts = lab.starts();
    assert_eq!(starts, A_RUN);
    lab.run("second", &[]).complains("from the cache");
    assert_eq!(lab.starts(), starts, "the engine was started again");
    assert!(lab.outputs("first") == lab.outputs("second"), "a repeated run says something else");
    // Without the cache it is started, a seed of its own is a reading of its own, and neither disturbs what is kept.
    lab.run("anew", &["--no-cache"]);
    assert_eq!(lab.starts(), starts + A_RUN);
    assert_eq!(values(&lab.outputs("first").0), values(&lab.outputs("anew").0));
    lab.run("seeded", &["--seed", "2"]);
    assert_eq!(lab.starts(), starts + 2 * A_RUN);
    lab.run("third", &[]);
    assert_eq!(lab.starts(), starts + 2 * A_RUN);
    assert!(lab.outputs("first") == lab.outputs("third"), "other seeds disturb what is kept");
}

#[test]
fn one_meter_more_only_adds_work() {
    let lab = Lab::new();
    let run = |out: &str, more: &[&str]| {
        lab.run(out, &[&["--engines", "simulator", "--procedures", "direct_illuminance"], more].concat());
        let recordings: Value = lab.0.json(&format!("{out}/readings/simulator.json"));
        let values: Vec<f64> =
            recordings[0]["readings"].as_array().unwrap().iter().map(|r| r["value"].as_f64().unwrap()).collect();
        (values, recordings[0]["effort"]["meters_read_before"].as_str().map(str::to_owned))
    };
    let (first, none) = run("first", &[]);
    let spec = lab.0.read("spec.yaml").replace("[[1, 1, 0.8], ", "[[2, 1, 0.8], [1, 1, 0.8], ");
    fs::write(lab.0.path("spec.yaml"), spec).unwrap();
    let (more, added) = run("more", &[]);
    assert_eq!((none, added.as_deref()), (None, Some("3 of 4; with a seed of their own plane[0]")));
    assert_eq!(first, more[1..]);
    assert_eq!(run("again", &[]), (more.clone(), added));
    assert!(lab.outputs("more") == lab.outputs("again"), "a repeated run says something else");
    // What is rendered anew knows nothing of it, and neither does another seed.
    assert_eq!(run("anew", &["--no-cache"]), (more, None));
    assert_eq!(run("seeded", &["--seed", "2"]).1, None);
    lab.0.luxproof(&["cache", "prune", "--unused", "0"]).exits(0);
    assert!(lab.0.path("cache/simulator").read_dir().unwrap().next().is_none(), "something stays for good");
}

#[test]
fn damaged_entries_are_named_and_read_anew() {
    let lab = Lab::new();
    lab.run("first", &[]);
    let entries = lab.entries();
    for (k, (path, text)) in entries.iter().enumerate() {
        match k % 3 {
            0 => fs::write(path, &text[..text.len() / 2]).unwrap(),
            // A wrong reading that is sound JSON.
            1 => fs::write(path, text.replacen("\"wall_s\":", "\"wall_s\":1", 1)).unwrap(),
            _ => fs::copy(entries.keys().next().unwrap(), path).map(drop).unwrap(),
        }
    }
    let starts = lab.starts();
    let messages = lab.run("second", &[]).stderr;
    assert_eq!(lab.starts(), starts + A_RUN);
    assert_eq!(messages.matches("the reading is taken anew").count(), entries.len(), "{messages}");
    assert_eq!(values(&lab.outputs("first").0), values(&lab.outputs("second").0));
    assert_eq!(lab.entries().keys().collect::<Vec<_>>(), entries.keys().collect::<Vec<_>>());
}

#[test]
fn kills_at_random_instants_lose_and_falsify_nothing() {
    let rounds = if is_night() { 200 } else { 50 };
    let lab = Lab::new();
    lab.run("right", &["--no-cache"]);
    let start = Instant::now();
    lab.run("right", &["--no-cache"]);
    let whole_s = start.elapsed().as_secs_f64();
    let mut random = fastrand::Rng::with_seed(17);
    let mut earlier = lab.entries();
    assert!(earlier.is_empty());
    let mut killed = 0;
    for round in 0..rounds {
        // Some runs start afresh, some go on where killed ones ended, sometimes two at once share the cache.
        let seed = (round / 2).to_string();
        let begin = |out: &str| {
            let args = ["run", "spec.yaml", "--out", out, "--no-calibration", "--format", "json", "--seed", &seed];
            let mut program = lab.0.command(&args);
            program.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
        };
        let mut running = vec![begin("killed")];
        if round % 4 == 0 {
            running.push(begin("beside"));
        }
        std::thread::sleep(Duration::from_secs_f64(whole_s * random.f64()));
        for child in &mut running {
            killed += usize::from(child.try_wait().unwrap().is_none());
            child.kill().unwrap();
            child.wait().unwrap();
        }
        // Nothing that was kept is gone, and what two runs read at once is equally good.
        let now = lab.entries();
        assert!(earlier.keys().all(|path| now.contains_key(path)), "round {round}");
        earlier = now;
    }
    assert!(killed >= rounds / 2, "only {killed} runs were still going when they were killed");
    let right = values(&lab.outputs("right").0);
    for seed in [0, 1, rounds / 4, rounds / 2 - 1] {
        lab.run("final", &["--seed", &seed.to_string()]);
        let found = values(&lab.outputs("final").0);
        let readings = |all: &BTreeMap<String, Value>| -> Vec<Value> {
            all.values().flat_map(|r| r.as_array().unwrap()).map(|r| r["readings"].clone()).collect()
        };
        assert_eq!(readings(&found), readings(&right), "seed {seed}");
    }
    // All that is kept of the adapter says the same readings, whatever the seed: of all meters, and of those that were read again.
    let mut by_procedure: BTreeMap<String, Vec<Vec<Value>>> = BTreeMap::new();
    for text in lab.entries().values() {
        let entry = serde_json::from_str::<Value>(text).unwrap()["body"].clone();
        if entry["engine"] == "mine" {
            let estimates = entry["answer"]["Ok"]["estimates"].as_array().unwrap().clone();
            by_procedure.entry(entry["procedure"].to_string()).or_default().push(estimates);
        }
    }
    assert_eq!(by_procedure.len(), 2);
    for (procedure, all) in &by_procedure {
        let whole = all.iter().max_by_key(|estimates| estimates.len()).unwrap();
        let is_right = |e: &Vec<Value>| e == whole || e.len() < whole.len() && e.iter().all(|e| whole.contains(e));
        assert!(all.iter().all(is_right), "{procedure}: {all:?}");
    }
}
