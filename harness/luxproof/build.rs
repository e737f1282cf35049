//! The commit of the program's sources, for `--version` and reports.

use std::path::{Path, PathBuf};
use std::process::Command;

/// What the program is built of, as paths of its repository: a change of anything else makes no other program.
const SOURCES: [&str; 5] = ["src", "harness", "reference", "Cargo.toml", "Cargo.lock"];

fn main() {
    let (commit, is_dirty) = checkout().or_else(package).unwrap_or_default();
    println!("cargo:rustc-env=LUXPROOF_COMMIT={commit}");
    println!("cargo:rustc-env=LUXPROOF_DIRTY={is_dirty}");
    let version = std::env::var("CARGO_PKG_VERSION").unwrap_or_default();
    let of = match (commit.get(..12), is_dirty) {
        (None, _) => String::new(),
        (Some(short), false) => format!(" ({short})"),
        (Some(short), true) => format!(" ({short}, with changes)"),
    };
    println!("cargo:rustc-env=LUXPROOF_VERSION={version}{of}");
}

/// The commit of the checkout that this is the harness of, and whether its sources have changed since; `None` elsewhere, also
/// where an unpacked archive lies in somebody else's repository.
fn checkout() -> Option<(String, bool)> {
    let root = Path::new("../..").canonicalize().ok()?;
    let top = PathBuf::from(git(&["rev-parse", "--show-toplevel"])?).canonicalize().ok()?;
    if top != root || git(&["ls-files", "--", "build.rs"])?.is_empty() {
        return None;
    }
    for name in ["HEAD", "logs/HEAD"] {
        let file = git(&["rev-parse", "--git-path", name])?;
        if Path::new(&file).exists() {
            println!("cargo:rerun-if-changed={file}");
        }
    }
    for source in ["..", "../../src", "../../Cargo.toml", "../../Cargo.lock", "../../reference"] {
        println!("cargo:rerun-if-changed={source}");
    }
    let above = SOURCES.map(|source| format!(":/{source}"));
    let status = [&["status", "--porcelain", "--"][..], &above.each_ref().map(String::as_str)].concat();
    Some((git(&["rev-parse", "HEAD"])?, !git(&status)?.is_empty()))
}

/// What cargo notes in a package: `{"git": {"sha1": "...", "dirty": true}, ...}`.
fn package() -> Option<(String, bool)> {
    let text = std::fs::read_to_string(".cargo_vcs_info.json").ok()?;
    let after = text.split("\"sha1\"").nth(1)?;
    let commit =
        after.split('"').nth(1).filter(|hash| hash.len() >= 40 && hash.bytes().all(|b| b.is_ascii_hexdigit()))?;
    Some((commit.to_owned(), text.contains("\"dirty\": true")))
}

/// What git prints; `None` where there is none or it refuses.
fn git(args: &[&str]) -> Option<String> {
    let answer = Command::new("git").args(args).output().ok().filter(|answer| answer.status.success())?;
    Some(String::from_utf8(answer.stdout).ok()?.trim().to_owned())
}
