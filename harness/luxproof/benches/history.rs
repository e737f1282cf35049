//! How long a year of nights takes to read and to search for changes: 365 nights of 2000 comparisons.
//!
//! `cargo bench -p luxproof --bench history`

#![allow(clippy::unwrap_used, missing_docs, reason = "a benchmark that cannot go on has failed")]

use std::io::Write;
use std::sync::OnceLock;

use divan::Bencher;
use luxproof_model::{Basis, Verdict};
use luxproof_model::{MeterId, ProcedureId, Quantity, ReadingKey};
use luxproof_trend::history::{History, Line, Numbers, changes};

const NIGHTS: u64 = 365;
const METERS: usize = 20;

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
        let (readings, meters) = (readings(), (0..METERS).map(|k| MeterId::new("workplane", k)).collect::<Vec<_>>());
        for night in 0..NIGHTS {
            let day = std::time::UNIX_EPOCH + std::time::Duration::from_secs(86_400 * (20_454 + night));
            let date = humantime::format_rfc3339_seconds(day).to_string()[..10].to_owned();
            for reading in &readings {
                out.write_all(line(&date, reading, &meters, &mut random).text().unwrap().as_bytes()).unwrap();
                out.write_all(b"\n").unwrap();
            }
        }
        out.flush().unwrap();
        drop(out);
        println!("{} MB", file.as_file().metadata().unwrap().len() / 1_000_000);
        file
    })
}

/// Of five engines in four procedures of five cases.
fn readings() -> Vec<ReadingKey> {
    let engines = ["iesna", "mitsuba", "povray", "radiance", "simulator"];
    let procedures =
        || engines.iter().flat_map(|engine| ProcedureId::ALL.iter().map(|procedure| (*engine, *procedure)));
    let case = |k| procedures().map(move |(e, p)| ReadingKey::new(format!("cachet/case-{k}"), p, e));
    (0..5).flat_map(case).collect()
}

/// What is read on a night, with noise of sums of uniforms.
fn line<'a>(date: &'a str, of: &'a ReadingKey, meters: &'a [MeterId], random: &mut fastrand::Rng) -> Line<'a> {
    let rounded = |v: f64, digits: usize| format!("{v:.digits$e}").parse::<f64>().unwrap();
    let mut line = Line::new(date, of, Quantity::Illuminance, Verdict::Pass);
    line.version = "3.9.1 (Dr.Jit 1.5.0, LLVM 19.1.7)".into();
    line.model = "point".into();
    line.basis = Some(Basis::Simulator);
    line.source = "exact indirect light by radiosity, 7 reflections".into();
    for (k, meter) in meters.iter().enumerate() {
        let noise = 0.01 * ((0..12).map(|_| random.f64()).sum::<f64>() - 6.0);
        let numbers = Numbers {
            reference: rounded(2.5 + (k as f64).sqrt(), 8),
            deviation: rounded(noise, 5),
            std_error: rounded(0.01 * (0.9 + 0.2 * random.f64()), 3),
            u: rounded(0.01 * (1.0 + 0.2 * random.f64()), 3),
        };
        line.push(meter, numbers);
    }
    line
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
