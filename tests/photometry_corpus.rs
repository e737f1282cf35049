//! The readers over photometric files as found in the wild, where a corpus of them lies beside the checkout.

use std::path::{Path, PathBuf};

use luminaire::photometry;

/// The corpus, or `None` where it is absent.
fn corpus() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/corpus");
    if folder.is_dir() {
        return Some(folder);
    }
    eprintln!("no corpus at {}: nothing was read", folder.display());
    None
}

/// Every file below a folder with this extension, in order.
fn files(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let mut found = vec![];
    let mut folders = vec![folder.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).expect("the corpus can be listed") {
            let path = entry.expect("the corpus can be listed").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == extension) {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

#[test]
fn every_lm63_file_is_read() {
    let Some(corpus) = corpus() else { return };
    let files = files(&corpus, "ies");
    assert!(files.len() >= 34, "{} files", files.len());
    for file in files {
        let read = photometry::read_file(&file).unwrap_or_else(|error| panic!("{error}; {}", error.help()));
        let flux = read.distribution.flux().value();
        assert!(flux > 0.0 && flux.is_finite(), "{}", file.display());
        println!("{} {} {flux:.1} lm {:?} {:?}", file.display(), read.format, read.opening, read.lints);
    }
}

#[test]
fn the_ledalite_pendant_gives_5297_lm_and_69_percent_of_it_upward() {
    let Some(corpus) = corpus() else { return };
    let read = photometry::read_file(&corpus.join("radiance/examp1.ies")).expect("the pendant is legal");
    let (flux, up) = (read.distribution.flux(), read.distribution.flux_between(90.0, 180.0));
    assert!((flux.value() - 5297.0).abs() < 1.0, "{flux}");
    assert!((up / flux - 0.69).abs() < 0.005, "{}", up / flux);
}
