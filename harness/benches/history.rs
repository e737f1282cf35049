//! How long a year of nights takes to read and to search for changes: 365 nights of 2000 comparisons.
//!
//! `cargo bench -p luxproof --bench history`

#![allow(clippy::unwrap_used, missing_docs, reason = "a benchmark that cannot go on has failed")]

use std::io::Write;
use std::sync::OnceLock;

use divan::Bencher;
use luxproof::judge::{Basis, Verdict};
use luxproof::record::Quantity;
use luxproof::trend::history::{Entry, History, changes};

const NIGHTS: u64 = 365;
const COMPARISONS: u64 = 2000;

fn main() {
    divan::main();
}

/// The file, written once.
fn year() -> &'static tempfile::NamedTempFile {
    static FILE: OnceLock<tempfile::NamedTempFile> = OnceLock::new();
    FILE.get_or_init(|| {
        let file = tempfile::NamedTempFile::new().unwrap();
        let mut out = std::io::BufWriter::new(file.as_file());
        let mut random = fastrand::Rng::with_seed(1);
        for night in 0..NIGHTS {
            let day = std::time::UNIX_EPOCH + std::time::Duration::from_secs(86_400 * (20_454 + night));
            let date = humantime::format_rfc3339_seconds(day).to_string()[..10].to_owned();
            for k in 0..COMPARISONS {
                serde_json::to_writer(&mut out, &entry(k, &date, &mut random)).unwrap();
                out.write_all(b"\n").unwrap();
            }
        }
        out.flush().unwrap();
        drop(out);
        println!("{} MB", file.as_file().metadata().unwrap().len() / 1_000_000);
        file
    })
}

/// A comparison of five engines and four procedures, five cases of twenty meters each, with noise of sum of uniforms.
fn entry<'a>(k: u64, date: &'a str, random: &mut fastrand::Rng) -> Entry<'a> {
    let noise = 0.01 * ((0..12).map(|_| random.f64()).sum::<f64>() - 6.0);
    let rounded = |v: f64, digits: usize| format!("{v:.digits$e}").parse::<f64>().unwrap();
    let engines = ["iesna", "mitsuba", "povray", "radiance", "simulator"];
    let procedures = ["direct_illuminance", "indirect_illuminance", "luminous_intensity", "total_illuminance"];
    Entry {
        night: date.into(),
        case: format!("cachet/case-{}", k / 20 % 5).into(),
        procedure: procedures[(k / 100 % 4) as usize].into(),
        engine: engines[(k / 400) as usize].into(),
        version: "3.9.1 (Dr.Jit 1.5.0, LLVM 19.1.7)".into(),
        model: "point".into(),
        meter: format!("workplane[{}]", k % 20).into(),
        quantity: Quantity::Illuminance,
        basis: Some(Basis::Exact),
        source: "exact indirect light by radiosity, 7 reflections".into(),
        value: Some(rounded(2.5 + noise, 8)),
        std_error: Some(rounded(0.01 * (0.9 + 0.2 * random.f64()), 3)),
        reference: Some(2.5),
        deviation: Some(rounded(noise, 5)),
        u: Some(rounded(0.01, 3)),
        verdict: Verdict::Pass,
    }
}

#[divan::bench(sample_count = 5, sample_size = 1)]
fn read_a_year(bencher: Bencher) {
    let path = year().path();
    bencher.bench(|| History::read(path).unwrap());
}

#[divan::bench(sample_count = 5, sample_size = 1)]
fn read_a_year_and_find_its_changes(bencher: Bencher) {
    let path = year().path();
    bencher.bench(|| changes(&History::read(path).unwrap()));
}
