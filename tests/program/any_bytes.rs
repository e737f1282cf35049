//! Readers of whatever lies in a file, on damaged seeds of the fuzzer: none panics. `LUXPROOF_FUZZ_SECONDS` says for how long each is tried.

use std::fs;
use std::panic::catch_unwind;
use std::path::Path;
use std::time::{Duration, Instant};

use arbitrary::Unstructured;
use luxproof_spec::{Case, Trust};

use crate::support::{Folder, LAMP, OWN, ROOM, TWO_METERS, root};

#[path = "../../fuzz/targets.rs"]
mod targets;
#[path = "../../fuzz/valid_files.rs"]
mod valid_files;

/// What numbers and names may become.
const WORDS: [&str; 22] = [
    "0",
    "-1",
    "1e308",
    "-1e308",
    "1e-320",
    "1e999",
    "NaN",
    "null",
    "true",
    "\"\"",
    "[]",
    "{}",
    "[[]]",
    "18446744073709551616",
    "\n",
    "\0",
    "\u{202e}",
    "&a",
    "*a",
    "9999999",
    "0.1",
    "- ",
];

fn damaged(seed: &[u8], random: &mut fastrand::Rng) -> Vec<u8> {
    let mut bytes = seed.to_vec();
    for _ in 0..random.usize(1..6) {
        let at = random.usize(0..=bytes.len());
        let end = (at + random.usize(1..40)).min(bytes.len());
        let word = WORDS[random.usize(0..WORDS.len())];
        match random.u8(0..6) {
            0 if at < bytes.len() => bytes[at] = random.u8(..),
            1 => drop(bytes.drain(at..end)),
            2 => {
                let twice = bytes[at..end].to_vec();
                bytes.splice(at..at, twice);
            }
            3 => bytes.truncate(at),
            // A number, or whatever stands between two marks, becomes another.
            4 => {
                let is_mark = |b: &u8| b" ,:[]{}\"\n".contains(b);
                let start = bytes[..at].iter().rposition(is_mark).map_or(0, |k| k + 1);
                let end = bytes[at..].iter().position(is_mark).map_or(bytes.len(), |k| at + k);
                bytes.splice(start..end, word.bytes());
            }
            _ => drop(bytes.splice(at..at, word.bytes())),
        }
    }
    bytes
}

#[test]
fn no_reader_panics_whatever_lies_in_a_file() {
    let seconds = std::env::var("LUXPROOF_FUZZ_SECONDS").ok().and_then(|text| text.parse().ok());
    // As many as take a few seconds.
    let is_over = |count: usize, start: Instant| match seconds {
        Some(seconds) => start.elapsed() > Duration::from_secs(seconds),
        None => count >= 300,
    };
    for (name, target) in targets::ALL {
        let folder = root().join("fuzz/seeds").join(name);
        let seeds: Vec<Vec<u8>> =
            folder.read_dir().unwrap().map(|seed| fs::read(seed.unwrap().path()).unwrap()).collect();
        for seed in &seeds {
            target(seed);
        }
        let mut random = fastrand::Rng::with_seed(seconds.map_or(1, |_| fastrand::u64(..)));
        let (start, mut count) = (Instant::now(), 0);
        while !is_over(count, start) {
            let bytes = damaged(&seeds[random.usize(0..seeds.len())], &mut random);
            if catch_unwind(|| target(&bytes)).is_err() {
                let kept = std::env::temp_dir().join(format!("luxproof-panic-{name}"));
                fs::write(&kept, &bytes).unwrap();
                panic!("{name} panics: {}", kept.display());
            }
            count += 1;
        }
        eprintln!("{name}: {count} files");
    }
}

/// The reader of a format; whether it accepts a file.
fn is_accepted(name: &str, bytes: &[u8]) -> bool {
    let photometry = |file: &str| luxproof_photometry::read_by(Path::new(file), &|_| Ok(bytes.to_vec())).is_ok();
    match name {
        "lm63" => luxproof_photometry::lm63::parse(bytes).is_ok(),
        "eulumdat" => luxproof_photometry::eulumdat::parse(bytes).is_ok(),
        "tm33" => luxproof_photometry::tm33::parse(bytes).is_ok(),
        "gldf" => ["any.gldf#a", "any.gldf#b", "any.gldf"].into_iter().any(photometry),
        "spec" => {
            let folder = Folder::new(&[("any.yaml", &String::from_utf8_lossy(bytes)), ("lamp.ies", LAMP)]);
            Case::load_all(&folder.path("any.yaml"), Trust::Own).is_ok()
        }
        "report" => luxproof_report_file::from_json(&String::from_utf8_lossy(bytes)).is_ok(),
        other => panic!("no reader of {other}"),
    }
}

/// Generated files of each format.
const FILES: usize = 100;

#[test]
fn readers_accept_generated_files_and_panic_at_none_that_is_damaged() {
    for (name, generate) in valid_files::ALL {
        let (_, target) = targets::ALL.into_iter().find(|(of, _)| *of == name).unwrap();
        let (mut random, mut accepted) = (fastrand::Rng::with_seed(5), 0);
        for _ in 0..FILES {
            let entropy: Vec<u8> = (0..4000).map(|_| random.u8(..)).collect();
            let file = generate(&mut Unstructured::new(&entropy)).unwrap();
            accepted += usize::from(is_accepted(name, &file));
            for bytes in [file.clone(), damaged(&file, &mut random), damaged(&file, &mut random)] {
                if catch_unwind(|| target(&bytes)).is_err() {
                    let kept = std::env::temp_dir().join(format!("luxproof-panic-{name}"));
                    fs::write(&kept, &bytes).unwrap();
                    panic!("{name} panics: {}", kept.display());
                }
            }
        }
        eprintln!("{name}: {accepted} of {FILES} are accepted");
        assert!(accepted >= FILES / 2, "{name}: {accepted}");
    }
}

#[test]
fn a_bundle_with_other_values_under_right_hashes_is_opened_or_refused() {
    let folder = Folder::new(&[(
        "spec.yaml",
        &[ROOM, TWO_METERS, "procedures:\n  direct_illuminance: {meters: plane}\n"].concat(),
    )]);
    folder.write("lamp.ies", LAMP);
    folder.run(&["--engines", OWN]);
    folder.luxproof(&["bundle", "out", "--out", "bundle"]).exits(0);
    let (mut random, mut opened) = (fastrand::Rng::with_seed(6), 0);
    let originals = ["lock.json", "run/report.json"].map(|name| (name, folder.read(&format!("bundle/{name}"))));
    for round in 0..60 {
        let entropy: Vec<u8> = (0..20_000).map(|_| random.u8(..)).collect();
        let mut choices = Unstructured::new(&entropy);
        // The report keeps its checksum, or it is another report.
        let (name, original) = &originals[usize::from(round % 3 == 2)];
        let mut value = serde_json::from_str(original).unwrap();
        valid_files::change_leaves(&mut value, &mut choices).unwrap();
        for (name, text) in &originals {
            folder.write(&format!("bundle/{name}"), text);
        }
        folder.write(&format!("bundle/{name}"), &value.to_string());
        crate::strangers::seal(&folder.path("bundle"));
        match catch_unwind(|| luxproof::bundle::Opened::read(&folder.path("bundle"), luxproof_spec::Trust::Bundled)) {
            Ok(Ok(bundle)) => {
                let specs = bundle.specs();
                assert!(specs.iter().all(|spec| spec.is_file()), "{specs:?}");
                opened += 1;
            }
            Ok(Err(refusal)) => assert!(!refusal.to_string().is_empty()),
            Err(panic) => panic!("round {round}: {panic:?} of {value}"),
        }
    }
    assert!(opened >= 5, "{opened}");
}
