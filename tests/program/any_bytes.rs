//! Readers of whatever lies in a file, on damaged seeds of the fuzzer: none panics. `LUXPROOF_FUZZ_SECONDS` says for how long each is tried.

use std::fs;
use std::panic::catch_unwind;
use std::time::{Duration, Instant};

use crate::support::root;

#[path = "../../fuzz/targets.rs"]
mod targets;

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
