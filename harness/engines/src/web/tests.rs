//! What is exported, what a page answers, and how it fails.

use super::*;
use crate::fixtures::{self, lopsided};
use crate::shared_tests;

fn job() -> Job {
    fixtures::s1(Transport::Direct)
}

fn exported_table(job: &Job) -> Vec<u8> {
    let files = Web(Library::Three).export(job).unwrap();
    files.into_iter().find(|file| file.name == "luminaire-0.ies").unwrap().bytes
}

#[test]
fn the_page_gets_the_users_own_bytes_and_else_what_our_writer_makes_of_the_table() {
    let mut job = job();
    let bytes: &[u8] = b"IESNA:LM-63-1995\nTILT=NONE\n1 -1 1 2 1 1 2 0 0 0\n1 1 0\n0 90\n0\n7 7\n";
    let mut photometry = lm63::parse(bytes).unwrap();
    photometry.source = vec![luxproof_photometry::SourceFile { name: "a.ies".into(), bytes: bytes.into() }];
    job.scene.luminaires[0].photometry = photometry.into();
    assert_eq!(exported_table(&job), bytes);
    let turned = job.scene.luminaires[0].photometry.distribution.scaled(2.0);
    job.scene.luminaires[0].photometry = job.scene.luminaires[0].photometry.with_distribution(turned).into();
    assert!(String::from_utf8(exported_table(&job)).unwrap().starts_with("IESNA:LM-63-2002"));
    assert!(job.written_for_its_reader().is_some());
}

#[test]
fn what_a_page_answers_is_read_and_its_troubles_are_failures() {
    let web = Web(Library::Babylon);
    let sound = br#"{"lux": [1, 2, 3, 4.5], "version": "9", "backend": "WebGL 2", "troubles": []}"#;
    let found = web.parsed(sound, &job()).unwrap();
    assert_eq!(found.estimates.iter().map(|e| e.value).collect::<Vec<_>>(), [1.0, 2.0, 3.0, 4.5]);
    let troubled = br#"{"lux": [], "version": "9", "backend": "WebGL 2", "troubles": ["no WebGL"]}"#;
    let error = web.parsed(troubled, &job()).unwrap_err().to_string();
    assert!(error.contains("its page says: no WebGL"), "{error}");
    let missed = br#"{"lux": [1, null, 3, 4], "version": "9", "backend": "WebGL 2", "troubles": []}"#;
    let missed = web.parsed(missed, &job()).unwrap();
    assert!(checked(&web.name(), &job(), missed).is_err());
    assert!(web.parsed(b"Segmentation fault", &job()).is_err());
}

#[test]
fn reflected_light_bodies_and_openings_are_declined() {
    let mut area = job();
    area.scene.luminaires[0].model = LuminaireModel::Area;
    for job in [fixtures::s1(fixtures::CONVERGED), area] {
        assert!(matches!(Web(Library::Three).supports(&job), Support::No(_)));
    }
    assert_eq!(Web(Library::Three).supports(&job()), Support::Yes);
}

#[test]
fn a_page_that_takes_jobs_one_after_the_other_reads_as_many_do() {
    let mut other = job();
    other.scene.luminaires[0].photometry = other.scene.luminaires[0].photometry.with_distribution(lopsided()).into();
    // More of them than one page takes.
    let order = (0..10).map(|k| k % 2);
    let engine = Web(Library::Three);
    shared_tests::one_process_that_takes_jobs_one_after_the_other_reads_as_many_do(&engine, &[job(), other], order);
}

/// A browser that opens pages and answers nothing but an error, as Babylon's loader does at files with tilt tables.
const BROKEN_BROWSER: &str = r#"
const page = {
  on() {}, async route() {}, async goto() {}, async waitForFunction() {}, async close() {},
  async evaluate(_, about) { if (about) throw new Error("its loader takes no tilt tables\nat page.js:1"); return false; },
};
exports.chromium = { launch: async () => ({ on() {}, newPage: async () => page, close: async () => {} }) };
"#;

/// The driver once waited for its standard input to close, which the run keeps open: each such job took its whole time limit.
#[test]
fn a_page_that_throws_ends_its_driver_at_once_though_more_jobs_may_come() {
    use std::io::{Read as _, Write as _};
    use std::process::{Command, Stdio};
    use std::time::{Duration, Instant};
    let folder = tempfile::tempdir().unwrap();
    let modules = folder.path().join("packages/node_modules");
    for (file, text) in [
        (folder.path().join("packages/package.json"), "{}"),
        (modules.join("playwright-core/index.js"), BROKEN_BROWSER),
        (modules.join("babylon/package.json"), r#"{"version": "9"}"#),
        (folder.path().join(DRIVER.0), DRIVER.1),
        (folder.path().join("job.json"), r#"{"package": "babylon", "page": "page.js", "imports": {}, "lamps": []}"#),
    ] {
        fs::create_dir_all(file.parent().unwrap()).unwrap();
        fs::write(file, text).unwrap();
    }
    let node = fixtures::test_root_of(&Web(Library::Babylon)).node().unwrap_or_else(|| "node".into());
    let mut driver = Command::new(node)
        .args([DRIVER.0, "--serve", "packages", "no-browser"])
        .current_dir(folder.path())
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // Held open, as a run does that has more jobs.
    let mut input = driver.stdin.take().unwrap();
    input.write_all(b"{\"job\": \"job.json\"}\n").unwrap();
    input.flush().unwrap();
    let begun = Instant::now();
    let ended = loop {
        if let Some(status) = driver.try_wait().unwrap() {
            break Some(status);
        }
        if begun.elapsed() > Duration::from_secs(60) {
            driver.kill().unwrap();
            break None;
        }
        std::thread::sleep(Duration::from_millis(20));
    };
    let mut said = String::new();
    driver.stderr.take().unwrap().read_to_string(&mut said).unwrap();
    assert_eq!(ended.and_then(|status| status.code()), Some(1), "{said}");
    assert_eq!(said.trim(), "its loader takes no tilt tables");
    drop(input);
}
