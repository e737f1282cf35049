//! What really runs: a hash of the files of an engine, whatever version it tells.

use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::Site;
use crate::spec::hexadecimal;
use crate::system::files;

/// More files than this are no engine's.
const MAX_FILES: usize = 20_000;

/// Hashes of files that have not changed since, by path: size and time of change tell.
type Memo = BTreeMap<PathBuf, Known>;

#[derive(Clone, PartialEq, Serialize, Deserialize)]
struct Known {
    size: u64,
    changed_ns: u128,
    sha256: String,
}

/// SHA-256 of the contents of files and folders, 16 hexadecimal digits of it; what cannot be read is part of it as just that.
pub(super) fn of(site: &Site, paths: impl IntoIterator<Item = PathBuf>) -> String {
    // An engine each, so that probes side by side do not overwrite one another's.
    let paths: Vec<PathBuf> = paths.into_iter().collect();
    let name = hexadecimal(&Sha256::digest(format!("{paths:?}")));
    let place = site.root().join("fingerprints").join(format!("{}.json", &name[..16]));
    let memo: Memo = std::fs::read(&place).ok().and_then(|b| serde_json::from_slice(&b).ok()).unwrap_or_default();
    let (mut now, mut hash) = (Memo::default(), Sha256::new());
    for path in paths.iter().flat_map(|path| below(path)) {
        let known = seen(&path, memo.get(&path));
        hash.update(known.as_ref().map_or_else(ToString::to_string, |k| k.sha256.clone()));
        now.extend(known.map(|known| (path, known)));
    }
    if now != memo {
        // Where it cannot be kept, files are read again next time.
        files::keep_json(&place, &now).ok();
    }
    hexadecimal(&hash.finalize())[..16].to_owned()
}

fn seen(path: &Path, earlier: Option<&Known>) -> io::Result<Known> {
    let data = path.metadata()?;
    let changed_ns = data.modified()?.duration_since(UNIX_EPOCH).unwrap_or_default().as_nanos();
    let size = data.len();
    if let Some(known) = earlier.filter(|k| k.size == size && k.changed_ns == changed_ns) {
        return Ok(known.clone());
    }
    Ok(Known { size, changed_ns, sha256: hexadecimal(&Sha256::digest(std::fs::read(path)?)) })
}

/// The files at or below a path, sorted; what compilers leave beside sources is none.
fn below(path: &Path) -> Vec<PathBuf> {
    let (mut found, mut open) = (vec![], vec![path.to_owned()]);
    while let Some(path) = open.pop() {
        match path.read_dir() {
            Ok(entries) if found.len() < MAX_FILES => {
                let paths = entries.flatten().map(|e| e.path());
                open.extend(paths.filter(|p| !p.ends_with("__pycache__")));
            }
            Ok(_) => (),
            Err(_) => found.push(path),
        }
    }
    found.sort();
    found
}
