//! What Python files import from elsewhere: asked of the interpreter of the command, with its flags, folders and environment.

use std::path::{Path, PathBuf};
use std::time::Duration;

use serde::Deserialize;

use super::{Site, command};
use crate::system::process::Invocation;

const DRIVER: &str = include_str!("../../../drivers/imports.py");
const LIMIT: Duration = Duration::from_secs(20);

/// What modules are made of, and what of them is not known.
#[derive(Default, Deserialize)]
pub(super) struct Imports {
    pub(super) roots: Vec<PathBuf>,
    pub(super) unknown: Vec<String>,
}

/// Of those files of a command that are Python's; nothing where none is.
pub(super) fn of(words: &[String], files: &[PathBuf], folder: &Path, site: &Site) -> Imports {
    let named = |word: &String| Path::new(word).file_name().is_some_and(|n| n.to_string_lossy().starts_with("python"));
    let at = words.iter().position(named);
    let is_source = |file: &&PathBuf| {
        let by_name = file.extension().is_some_and(|suffix| suffix == "py");
        let first = || std::fs::read(file).ok()?.split(|b| *b == b'\n').next().map(<[u8]>::to_vec);
        by_name
            || first().is_some_and(|line| line.starts_with(b"#!") && String::from_utf8_lossy(&line).contains("python"))
    };
    let sources: Vec<&PathBuf> = files.iter().filter(is_source).collect();
    if sources.is_empty() {
        return Imports::default();
    }
    let word = at.map_or("python3", |at| &words[at]);
    let program = if word.contains('/') { command::file(folder, 0, word) } else { site.program(word) };
    let asked = program.ok_or_else(|| format!("`{word}` is not there")).and_then(|program| {
        // Flags such as -I and -s say where Python looks.
        let after = at.map_or(&[][..], |at| &words[at + 1..]);
        let is_flag = |w: &&String| w.starts_with('-') && !["-c", "-m", "-"].contains(&w.as_str());
        let log = tempfile::tempdir().map_err(|e| e.to_string())?;
        let mut run = Invocation::new(program, folder, LIMIT, log.path().join("log"))
            .of_user()
            .args(after.iter().take_while(is_flag))
            .args(["-c", DRIVER])
            .args(sources);
        for (key, value) in words[..at.unwrap_or(0)].iter().filter_map(|word| word.split_once('=')) {
            run = run.env(key, value);
        }
        let finished = run.run().map_err(|e| e.to_string())?;
        serde_json::from_slice(&finished.stdout).map_err(|e| e.to_string())
    });
    asked.unwrap_or_else(|why: String| {
        let why = why.lines().last().unwrap_or_default().to_owned();
        Imports { roots: vec![], unknown: vec![format!("what its files import ({why})")] }
    })
}
