//! Imports of Python files from other folders. The interpreter of the command finds them, with its flags, folders and environment.

use std::path::{Path, PathBuf};
use std::time::Duration;

use serde::Deserialize;

use super::{EngineRoot, command};
use luxproof_process::process::Invocation;

const DRIVER: &str = include_str!("../../drivers/imports.py");
const LIMIT: Duration = Duration::from_secs(20);

/// The files of imported modules, and the imports that were not found.
#[derive(Default, Deserialize)]
pub(super) struct Imports {
    pub(super) roots: Vec<PathBuf>,
    pub(super) unknown: Vec<String>,
}

/// Returns the imports of a command's Python files; none if it has no such files.
pub(super) fn of(words: &[String], files: &[PathBuf], folder: &Path, site: &EngineRoot) -> Imports {
    let sources: Vec<&PathBuf> = files.iter().filter(|file| is_python_source(file)).collect();
    if sources.is_empty() {
        return Imports::default();
    }
    ask_interpreter(words, &sources, folder, site).unwrap_or_else(|why| {
        let why = why.lines().last().unwrap_or_default().to_owned();
        Imports { roots: vec![], unknown: vec![format!("what its files import ({why})")] }
    })
}

/// Asks the command's own interpreter for the imports of sources; `python3` if the command names none.
fn ask_interpreter(
    words: &[String],
    sources: &[&PathBuf],
    folder: &Path,
    site: &EngineRoot,
) -> Result<Imports, String> {
    let at = words.iter().position(|word| is_python(word));
    let word = at.map_or("python3", |at| &words[at]);
    let program = if word.contains('/') { command::file(folder, 0, word) } else { site.program(word) };
    let program = program.ok_or_else(|| format!("`{word}` is not there"))?;
    // Flags such as -I and -s change where Python looks.
    let after = at.map_or(&[][..], |at| &words[at + 1..]);
    let log = tempfile::tempdir().map_err(|e| e.to_string())?;
    let mut run = Invocation::new(program, folder, LIMIT, log.path().join("log"))
        .of_user()
        .args(after.iter().take_while(|word| is_flag(word)))
        .args(["-c", DRIVER])
        .args(sources);
    for (key, value) in words[..at.unwrap_or(0)].iter().filter_map(|word| word.split_once('=')) {
        run = run.env(key, value);
    }
    let finished = run.run().map_err(|e| e.to_string())?;
    serde_json::from_slice(&finished.stdout).map_err(|e| e.to_string())
}

/// Returns whether a word names a Python interpreter.
fn is_python(word: &str) -> bool {
    Path::new(word).file_name().is_some_and(|name| name.to_string_lossy().starts_with("python"))
}

/// Returns whether a word is a flag of the interpreter. The options -c, -m and - begin the program instead.
fn is_flag(word: &str) -> bool {
    word.starts_with('-') && !["-c", "-m", "-"].contains(&word)
}

/// Returns whether a file is a Python source, by its suffix or its first line.
fn is_python_source(file: &Path) -> bool {
    if file.extension().is_some_and(|suffix| suffix == "py") {
        return true;
    }
    let Ok(bytes) = std::fs::read(file) else { return false };
    let first_line = bytes.split(|b| *b == b'\n').next().unwrap_or_default();
    first_line.starts_with(b"#!") && String::from_utf8_lossy(first_line).contains("python")
}
