//! A fingerprint of everything that turns a scene into a reading: a cache must not answer with the readings of another program.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};

/// Exporters, drivers and read-out of every engine, what they build on, and the physics behind our own solvers.
/// A package has only the first five; the rest comes from the registry in the one version that its manifest names.
const READ_OUT: [&str; 9] = [
    "src",
    "drivers",
    "engines.lock",
    "blender.lock",
    "luxcore.lock",
    "web",
    "../process/src",
    "../spec/src/procedures",
    "../../src",
];

fn main() -> std::io::Result<()> {
    let mut hasher = DefaultHasher::new();
    for source in READ_OUT.into_iter().filter(|source| Path::new(source).exists()) {
        println!("cargo:rerun-if-changed={source}");
        for file in files(Path::new(source))? {
            file.hash(&mut hasher);
            std::fs::read(&file)?.hash(&mut hasher);
        }
    }
    println!("cargo:rustc-env=LUXPROOF_READ_OUT={:016x}", hasher.finish());
    Ok(())
}

/// The files under a path, sorted; tests and their expected files read nothing.
fn files(path: &Path) -> std::io::Result<Vec<PathBuf>> {
    if path.is_file() {
        return Ok(vec![path.to_owned()]);
    }
    let mut entries: Vec<PathBuf> = path.read_dir()?.map(|entry| Ok(entry?.path())).collect::<std::io::Result<_>>()?;
    entries.retain(|entry| !is_of_tests(entry));
    entries.sort();
    let mut found = vec![];
    for entry in entries {
        found.extend(files(&entry)?);
    }
    Ok(found)
}

fn is_of_tests(path: &Path) -> bool {
    path.file_stem()
        .and_then(|stem| stem.to_str())
        .is_some_and(|stem| stem == "tests" || stem.ends_with("_tests") || stem == "snapshots")
}
