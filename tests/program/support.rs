//! What the tests of the whole program share: folders to run luxproof in, its answers, a room, lamps and an adapter.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use serde_json::Value;
use sha2::{Digest, Sha256};

/// Our own solvers.
pub(crate) const OWN: &str = "simulator,iesna";

/// Our own solvers and every renderer that is installed for the tests.
pub(crate) const ENGINES: [&str; 5] = ["simulator", "iesna", "mitsuba", "povray", "radiance"];

/// Case S1, converged by two independent methods: direct at `ceiling`, indirect at `workplane`.
pub(crate) const S1_DIRECT_LX: [f64; 4] = [0.852757462813, 2.230931614869, 2.230931614869, 13.559183673469];
pub(crate) const S1_INDIRECT_LX: [f64; 4] = [0.94314714, 1.15551735, 1.15551735, 1.42062868];

/// Whether studies take their long form, as `ci/nightly` asks.
pub(crate) fn is_night() -> bool {
    std::env::var_os("LUXPROOF_NIGHTLY").is_some()
}

/// A temporary folder that luxproof is run in, with a cache of its own.
pub(crate) struct Folder {
    kept: tempfile::TempDir,
    engines: Option<PathBuf>,
}

impl Folder {
    /// For our own solvers and adapters: no renderer is installed.
    pub(crate) fn new(files: &[(&str, &str)]) -> Self {
        let folder = Self::for_renderers(files);
        Self { engines: Some(folder.path("engines")), ..folder }
    }

    /// For the renderers that the user has installed.
    pub(crate) fn for_renderers(files: &[(&str, &str)]) -> Self {
        let folder = Self { kept: tempfile::tempdir().unwrap(), engines: None };
        for (name, text) in files {
            folder.write(name, text);
        }
        folder
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.kept.path().join(name)
    }

    pub(crate) fn read(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    pub(crate) fn write(&self, name: &str, text: &str) {
        fs::write(self.path(name), text).unwrap();
    }

    /// Replaces a part of a file, which must be there.
    pub(crate) fn edit(&self, name: &str, from: &str, to: &str) {
        let text = self.read(name);
        assert!(text.contains(from), "no `{from}` in {text}");
        self.write(name, &text.replace(from, to));
    }

    /// Replaces a part of a file in an envelope, and makes its checksum right again as nobody does by accident.
    pub(crate) fn forge(&self, name: &str, from: &str, to: &str) {
        self.edit(name, from, to);
        let text = self.read(name);
        let (head, body) = text.split_once("\"body\":").unwrap();
        let (mut is_string, mut bare) = (false, String::new());
        for c in body.trim_end().strip_suffix('}').unwrap().chars() {
            is_string ^= c == '"';
            bare.extend(Some(c).filter(|c| is_string || !c.is_ascii_whitespace()));
        }
        let checksum = Sha256::digest(bare).iter().fold(String::new(), |hash, byte| hash + &format!("{byte:02x}"));
        let old = head.split("\"checksum\":\"").nth(1).and_then(|rest| rest.split('"').next()).unwrap();
        self.write(name, &text.replace(old, &checksum));
    }

    pub(crate) fn json(&self, name: &str) -> Value {
        serde_json::from_str(&self.read(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    /// What `run` has left.
    pub(crate) fn report(&self) -> Value {
        self.json("out/report.json")
    }

    pub(crate) fn command(&self, args: &[&str]) -> Command {
        let mut program = Command::new(env!("CARGO_BIN_EXE_luxproof"));
        program.args(args).current_dir(self.kept.path()).stdin(Stdio::null());
        program.env("NO_COLOR", "1").env("LUXPROOF_CACHE", self.path("cache")).env_remove("RUST_BACKTRACE");
        if let Some(engines) = &self.engines {
            program.env("LUXPROOF_ENGINES", engines);
        }
        program
    }

    pub(crate) fn luxproof(&self, args: &[&str]) -> Answer {
        Answer::of(&mut self.command(args))
    }

    /// Audits `spec.yaml` into `out`; `calibration.rs` looks at scenes of known answer.
    pub(crate) fn run(&self, more: &[&str]) -> Answer {
        self.luxproof(&[&["run", "spec.yaml", "--out", "out", "--no-calibration"][..], more].concat())
    }
}

/// What a program said and its exit code.
#[derive(Debug)]
pub(crate) struct Answer {
    pub(crate) code: Option<i32>,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

impl Answer {
    pub(crate) fn of(program: &mut Command) -> Self {
        program.output().unwrap().into()
    }

    /// Asserts the exit code.
    #[track_caller]
    pub(crate) fn exits(self, code: i32) -> Self {
        assert_eq!(self.code, Some(code), "{}\n{}", self.stdout, self.stderr);
        self
    }

    /// Asserts that something stands on standard output.
    #[track_caller]
    pub(crate) fn prints(self, text: &str) -> Self {
        assert!(self.stdout.contains(text), "no `{text}` in {}\n{}", self.stdout, self.stderr);
        self
    }

    /// Asserts that something stands on standard error.
    #[track_caller]
    pub(crate) fn complains(self, text: &str) -> Self {
        assert!(self.stderr.contains(text), "no `{text}` in {}", self.stderr);
        self
    }

    /// The words of standard error, without the frames of messages and however long lines were broken.
    pub(crate) fn message(&self) -> String {
        self.stderr.split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" ")
    }

    /// The report on standard output, or another document.
    #[track_caller]
    pub(crate) fn json(&self) -> Value {
        serde_json::from_str(&self.stdout)
            .unwrap_or_else(|e| panic!("no document ({e}); run `luxproof engines install`? {}", self.stderr))
    }

    /// The report and the exit code.
    #[track_caller]
    pub(crate) fn report(&self) -> (Value, Option<i32>) {
        (self.json(), self.code)
    }
}

impl From<std::process::Output> for Answer {
    fn from(output: std::process::Output) -> Self {
        let stdout = String::from_utf8(output.stdout).unwrap();
        Self { code: output.status.code(), stdout, stderr: String::from_utf8_lossy(&output.stderr).into_owned() }
    }
}

/// Of a list in a report what an engine says of one meter in a procedure.
#[track_caller]
pub(crate) fn at_meter<'a>(report: &'a Value, list: &str, engine: &str, procedure: &str, meter: &str) -> &'a Value {
    let found = among(report, list, &[("engine", engine), ("procedure", procedure), ("meter", meter)]);
    found.first().unwrap_or_else(|| panic!("{list}: nothing of {engine}, {procedure}, {meter}"))
}

/// Audits specs of this repository with the user's renderers, from its root.
pub(crate) fn run_reference(args: &[&str]) -> (Value, Option<i32>) {
    let (_, report, code) = run_reference_in_folder(args);
    (report, code)
}

/// The same, and the folder with its `out`.
pub(crate) fn run_reference_in_folder(args: &[&str]) -> (Folder, Value, Option<i32>) {
    let folder = Folder::for_renderers(&[]);
    let out = folder.path("out");
    let args =
        [&["run"][..], args, &["--no-cache", "--no-calibration", "--format", "json", "--out", out.to_str().unwrap()]]
            .concat();
    let (printed, code) = Answer::of(folder.command(&args).current_dir(root())).report();
    assert_eq!(printed, folder.report());
    (folder, printed, code)
}

/// The root of this repository.
pub(crate) fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap()
}

/// Those entries of a report's list whose keys have these values.
pub(crate) fn among<'a>(report: &'a Value, list: &str, are: &[(&str, &str)]) -> Vec<&'a Value> {
    let all = report[list].as_array().unwrap_or_else(|| panic!("no list `{list}` in {report}"));
    all.iter().filter(|entry| are.iter().all(|(key, value)| entry[key] == *value)).collect()
}

/// A room with one lamp, `lamp.ies`; a test adds meters and procedures.
pub(crate) const ROOM: &str = "luxproof: 1
title: a test room
room:
  size_m: [6, 4, 3]
  reflectance: {floor: 0.2, walls: 0.5, ceiling: 0.7}
luminaires:
  - {id: lamp, photometry: lamp.ies, at_m: [3, 2, 2.5]}
";

pub(crate) const TWO_METERS: &str = "meters:
  plane: {points_m: [[1, 1, 0.8], [3, 2, 0.8]], normal: [0, 0, 1]}
";

/// The same room where nothing mirrors anything: the lamp is turned and dimmed, and three meters lie anywhere. Ends in procedures.
pub(crate) const SKEW_ROOM: &str = "luxproof: 1
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
";

/// The adapter as an engine, `adapter.py`.
pub(crate) const MINE: &str = "engines:
  mine: {command: [python3, -S, adapter.py]}
";

/// Lights downward, the same in every C plane.
pub(crate) const LAMP: &str = "IESNA:LM-63-2002
[TEST] made for this test
TILT=NONE
1 -1 1 3 1 1 2 0 0 0
1 1 0
0 60 90
0
100 80 0
";

/// Without any symmetry.
pub(crate) const SKEW_LAMP: &str = "IESNA:LM-63-2002
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

/// The example adapter of the guide.
pub(crate) fn adapter() -> String {
    fs::read_to_string(root().join("docs/examples/inverse_square.py")).unwrap()
}

/// The example adapter with one job per process. It runs these lines of Python before it answers a request for readings.
pub(crate) fn adapter_with_lines_before_readings(lines: &str) -> String {
    let readings = "    return {\"answers\"";
    let mut inserted = String::new();
    for line in lines.lines() {
        inserted += &format!("    {line}\n");
    }
    let example = adapter().replace("[\"batch\"]", "[]");
    assert_eq!(example.matches(readings).count(), 1);
    example.replace(readings, &(inserted + readings))
}

/// A report as luxproof would have written it: times and the checksum itself do not count.
pub(crate) fn sealed(mut report: Value) -> String {
    report["checksum"] = "".into();
    let mut counted = report.to_string();
    for name in ["\"checksum\"", "\"started\"", "\"wall_s\""] {
        let mut parts = counted.split(name);
        let first = parts.next().unwrap_or_default().to_owned();
        counted = parts.fold(first, |before, part| before + name + &part[part.find([',', '}']).unwrap()..]);
    }
    let checksum = Sha256::digest(counted);
    report["checksum"] = checksum.iter().map(|byte| format!("{byte:02x}")).collect::<Vec<_>>().concat().into();
    report.to_string()
}
