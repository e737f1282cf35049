//! Fingerprint of everything that turns a scene into a reading: a cache must not answer for another program's read-out.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};

/// Exporters, drivers and read-out of every engine, and the physics behind our own.
const SOURCES: [&str; 7] =
    ["src/engines", "src/system/process", "drivers", "engines.lock", "blender.lock", "web", "../src"];

fn main() -> std::io::Result<()> {
    let mut hasher = DefaultHasher::new();
    for source in SOURCES {
        println!("cargo:rerun-if-changed={source}");
        for file in files(Path::new(source))? {
            file.hash(&mut hasher);
            std::fs::read(&file)?.hash(&mut hasher);
        }
    }
    println!("cargo:rustc-env=LUXPROOF_READ_OUT={:016x}", hasher.finish());
    Ok(())
}

/// The files under a path, sorted; tests and what they compare with read nothing.
fn files(path: &Path) -> std::io::Result<Vec<PathBuf>> {
    if path.is_file() {
        return Ok(vec![path.to_owned()]);
    }
    let mut entries: Vec<PathBuf> = path.read_dir()?.map(|e| Ok(e?.path())).collect::<std::io::Result<_>>()?;
    let is_of_tests = |stem: &str| stem == "tests" || stem.ends_with("_tests") || stem == "snapshots";
    entries.retain(|e| !e.file_stem().and_then(|s| s.to_str()).is_some_and(is_of_tests));
    entries.sort();
    let mut found = vec![];
    for entry in entries {
        found.extend(files(&entry)?);
    }
    Ok(found)
}
