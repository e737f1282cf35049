//! The cache in whole runs: a repeated run starts no engine and says the same, and no kill at any instant costs or falsifies a reading.

#![allow(clippy::unwrap_used, missing_docs, reason = "a test that cannot go on has failed")]

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

const SPEC: &str = "luxproof: 1
room:
  size_m: [6, 4, 3]
  reflectance: {floor: 0.2, walls: 0.5, ceiling: 0.7}
luminaires:
  - {id: lamp, photometry: lamp.ies, at_m: [3, 2, 2.5], rotate_deg: {azimuth: 30, tilt: 20}, flux_scale: 0.8}
meters:
  plane: {points_m: [[1, 1, 0.8], [3, 2, 0.8], [5, 3.5, 0.1]], normal: [0, 0, 1]}
procedures:
  luminous_intensity: {luminaire: lamp, distance_m: 5, angles: photometry}
  direct_illuminance: {meters: plane}
engines:
  mine: {command: [python3, '-I', '-S', adapter.py]}
";

/// Without any symmetry.
const LAMP: &str = "IESNA:LM-63-2002
TILT=NONE
1 -1 1 4 5 1 2 0 0 0
1 1 0
0 60 90 180
0 45 90 180 360
100 80 10 5
100 70 20 5
100 40 30 5
100 90 12 5
100 80 10 5
";

struct Lab {
    folder: tempfile::TempDir,
}

impl Lab {
    /// The example adapter, which first notes that it was started.
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/examples/inverse_square.py");
        let counting = "open('starts', 'a').write('started\\n')\n";
        let adapter = counting.to_owned() + &fs::read_to_string(example).unwrap();
        for (name, text) in [("spec.yaml", SPEC), ("lamp.ies", LAMP), ("adapter.py", &adapter)] {
            fs::write(folder.path().join(name), text).unwrap();
        }
        Self { folder }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn luxproof(&self, args: &[&str]) -> Command {
        let mut program = Command::new(env!("CARGO_BIN_EXE_luxproof"));
        program.args(args).current_dir(self.folder.path()).env("NO_COLOR", "1");
        program.env("LUXPROOF_ENGINES", self.path("engines")).env("LUXPROOF_CACHE", self.path("cache"));
        program
    }

    fn run(&self, out: &str, more: &[&str]) -> Output {
        let args = ["run", "spec.yaml", "--out", out, "--format", "json"];
        let output = self.luxproof(&[&args, more].concat()).output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
        output
    }

    fn starts(&self) -> usize {
        fs::read_to_string(self.path("starts")).map_or(0, |t| t.lines().count())
    }

    /// Every file of readings, byte by byte, and the report without the times that a run has of its own.
    fn said(&self, out: &str) -> (BTreeMap<String, Vec<u8>>, String) {
        let folder = self.path(out).join("readings").read_dir().unwrap();
        let name = |f: &fs::DirEntry| f.file_name().into_string().unwrap();
        let files = folder.map(|f| f.unwrap()).map(|f| (name(&f), fs::read(f.path()).unwrap())).collect();
        let text = fs::read_to_string(self.path(out).join("report.json")).unwrap();
        let mut report: Value = serde_json::from_str(&text).unwrap();
        let own = report.as_object_mut().unwrap();
        assert!(own.remove("started").is_some() && own.remove("wall_s").is_some());
        (files, serde_json::to_string_pretty(&report).unwrap())
    }

    /// The entries of the cache, each with its text; all of them sound.
    fn entries(&self) -> BTreeMap<PathBuf, String> {
        let info = self.luxproof(&["cache", "info"]).output().unwrap();
        let text = String::from_utf8(info.stdout).unwrap();
        assert!(info.status.success() && !text.contains("damaged"), "{text}");
        let folders = self.path("cache").read_dir().map_or(vec![], |d| d.map(|f| f.unwrap().path()).collect());
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

#[test]
fn a_repeated_run_starts_no_engine_and_says_the_same_to_the_byte() {
    let lab = Lab::new();
    lab.run("first", &[]);
    // Point, asymmetric, shadow and furnace of the calibration, and two procedures.
    let starts = lab.starts();
    assert!(starts >= 5, "{starts}");
    let again = lab.run("second", &[]);
    assert_eq!(lab.starts(), starts, "the engine was started again");
    assert!(String::from_utf8_lossy(&again.stderr).contains("from the cache"));
    assert!(lab.said("first") == lab.said("second"), "a repeated run says something else");
    // Without the cache it is started, a seed of its own is a reading of its own, and neither disturbs what is kept.
    lab.run("anew", &["--no-cache"]);
    assert_eq!(lab.starts(), starts + 2);
    assert_eq!(values(&lab.said("first").0), values(&lab.said("anew").0));
    lab.run("seeded", &["--seed", "2"]);
    assert_eq!(lab.starts(), starts + 4);
    lab.run("third", &[]);
    assert_eq!(lab.starts(), starts + 4);
    assert!(lab.said("first") == lab.said("third"), "other seeds disturb what is kept");
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
            1 => fs::write(path, text.replacen("\"wall_s\": ", "\"wall_s\": 1", 1)).unwrap(),
            _ => fs::copy(entries.keys().next().unwrap(), path).map(drop).unwrap(),
        }
    }
    let starts = lab.starts();
    let again = lab.run("second", &[]);
    let messages = String::from_utf8_lossy(&again.stderr).into_owned();
    assert_eq!(lab.starts(), starts + 2);
    assert_eq!(messages.matches("the reading is taken anew").count(), entries.len(), "{messages}");
    assert_eq!(values(&lab.said("first").0), values(&lab.said("second").0));
    assert_eq!(lab.entries().keys().collect::<Vec<_>>(), entries.keys().collect::<Vec<_>>());
}

#[test]
fn two_hundred_kills_at_random_instants_lose_and_falsify_nothing() {
    let lab = Lab::new();
    // Calibrated, and with what each seed reads when nothing happens.
    lab.run("right", &["--no-cache"]);
    let start = Instant::now();
    lab.run("right", &["--no-cache"]);
    let whole_s = start.elapsed().as_secs_f64();
    let mut random = fastrand::Rng::with_seed(17);
    let mut earlier = lab.entries();
    assert!(earlier.is_empty());
    let mut killed = 0;
    for round in 0..200 {
        // Some runs start afresh, some go on where killed ones ended, sometimes two at once share the cache.
        let seed = (round / 2).to_string();
        let begin = |out: &str| {
            let args = ["run", "spec.yaml", "--out", out, "--format", "json", "--seed", &seed];
            let mut program = lab.luxproof(&args);
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
    assert!(killed >= 100, "only {killed} runs were still going when they were killed");
    let right = values(&lab.said("right").0);
    for seed in ["0", "1", "50", "99"] {
        lab.run("final", &["--seed", seed]);
        let found = values(&lab.said("final").0);
        let readings = |all: &BTreeMap<String, Value>| -> Vec<Value> {
            all.values().flat_map(|r| r.as_array().unwrap()).map(|r| r["readings"].clone()).collect()
        };
        assert_eq!(readings(&found), readings(&right), "seed {seed}");
    }
    // All that is kept of the adapter says the same readings, whatever the seed.
    let mut by_procedure: BTreeMap<String, Value> = BTreeMap::new();
    for text in lab.entries().values() {
        let entry = serde_json::from_str::<Value>(text).unwrap()["entry"].clone();
        if entry["engine"] == "mine" {
            let procedure = entry["procedure"].as_str().unwrap().to_owned();
            assert_eq!(*by_procedure.entry(procedure).or_insert(entry["answer"].clone()), entry["answer"]);
        }
    }
    assert_eq!(by_procedure.len(), 2);
}
