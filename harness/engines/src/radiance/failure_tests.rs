//! What happens when rtrace crashes, hangs or gives nonsense: an error each time, never a number.

use std::fs;
use std::path::Path;
use std::time::Duration;

use luxproof_scene::{Bounces, Transport};

use super::*;
use crate::fixtures::{job_dir, s1, write_program};
use crate::shared_tests;

/// A site whose rtrace is a shell script; the other programs do nothing.
fn fake_site(root: &Path, rtrace: &str) -> EngineRoot {
    let package = root.join("venv/lib/python3/site-packages/pyradiance");
    fs::create_dir_all(package.join("lib")).unwrap();
    fs::write(package.join("lib/source.cal"), "").unwrap();
    for (name, script) in [("rtrace", rtrace), ("oconv", "true"), ("ies2rad", "true")] {
        write_program(&package.join("bin").join(name), script);
    }
    EngineRoot::at(root)
}

fn failure(rtrace: &str, transport: Transport, limit_s: f64) -> EngineError {
    let folder = tempfile::tempdir().unwrap();
    let limit = Duration::from_secs_f64(limit_s);
    let bench = JobDir { limit, ..job_dir(fake_site(folder.path(), rtrace), folder.path()) };
    Radiance.read(&s1(transport), &bench).unwrap_err()
}

/// Prints `rows` triples of the 64-bit float whose bytes are given as octal escapes.
fn triples(rows: u32, float: &str) -> String {
    format!("cat > /dev/null; for i in $(seq {}); do printf '{float}'; done", 3 * rows)
}

const ONE: &str = r"\000\000\000\000\000\000\360\077";
const NAN: &str = r"\000\000\000\000\000\000\370\177";
const MINUS_ONE: &str = r"\000\000\000\000\000\000\360\277";

#[test]
fn a_crash_a_hang_and_an_out_of_memory_kill_are_distinguished() {
    shared_tests::crashes_hangs_and_kills_are_distinguished(|script, limit_s| {
        failure(script, Transport::Direct, limit_s)
    });
}

#[test]
fn other_rows_than_meters_nan_and_negative_light_are_no_readings_though_rtrace_exits_well() {
    let indirect = Transport::Indirect(Bounces::Converged);
    for (rows, float, transport) in [
        (3, ONE, Transport::Direct),
        (8, ONE, indirect),
        (4, NAN, Transport::Direct),
        (4, MINUS_ONE, Transport::Direct),
    ] {
        let error = failure(&triples(rows, float), transport, 20.0);
        assert!(matches!(error, EngineError::Output { .. }), "{error}");
    }
}

#[test]
fn a_wheel_without_its_programs_is_absent_with_the_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let absent = Radiance.probe(&EngineRoot::at(folder.path())).unwrap_err().to_string();
    assert!(absent.contains("luxproof engines install"), "{absent}");
    let site = fake_site(folder.path(), "true");
    fs::remove_file(site.python_package("pyradiance").unwrap().join("bin/oconv")).unwrap();
    assert!(Radiance.probe(&site).unwrap_err().reason.contains("bin/oconv"));
    assert!(Radiance.probe(&fake_site(folder.path(), "echo")).is_err());
}

#[test]
fn ies2rad_that_makes_no_light_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let bench = job_dir(fake_site(folder.path(), &triples(4, ONE)), folder.path());
    let mut job = s1(Transport::Direct);
    job.settings.insert("photometry".into(), "ies2rad".into());
    fs::write(folder.path().join("ies2rad-0.rad"), "# nothing\n").unwrap();
    let error = Radiance.read(&job, &bench).unwrap_err();
    assert!(matches!(error, EngineError::Output { .. }), "{error}");
}
