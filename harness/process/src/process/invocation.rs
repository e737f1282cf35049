//! What is run, where, and what it may do and take.

use std::ffi::OsString;
use std::fmt;
use std::path::{Path, PathBuf};
use std::time::Duration;

use super::memory::PeakMemory;

#[derive(Clone, Debug)]
pub struct Invocation {
    pub program: PathBuf,
    pub args: Vec<OsString>,
    /// Environment variables set on top of ours.
    pub env: Vec<(OsString, OsString)>,
    pub cwd: PathBuf,
    pub stdin: Vec<u8>,
    /// Wall-clock limit; past it the program is ended, and all that it started.
    pub limit: Duration,
    pub log: PathBuf,
    pub peak: PeakMemory,
    pub freedom: Freedom,
    /// Bytes of its answer, or of a line of it where it gives many; a program that says more is ended.
    pub longest_answer: usize,
}

/// What a program may do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Freedom {
    /// What the user may, with all of the user's environment: a program of the user's own, or one that installs. On Linux it cannot read
    /// the files below `hidden`, except those below `visible`.
    OfUser { hidden: Vec<PathBuf>, visible: Vec<PathBuf> },
    /// It reads what the user may, writes below the folder that it runs in and these, has no network, and gets of the environment what
    /// every program needs.
    Confined { writable: Vec<PathBuf> },
}

/// Bytes of an answer that nobody expects to be long.
const LONGEST_ANSWER: usize = 64 << 20;

/// What a program that exited with 0 gave.
#[derive(Clone, Debug)]
pub struct Finished {
    pub stdout: Vec<u8>,
    /// Its standard error, also kept in the log.
    pub stderr: String,
    pub wall: Duration,
}

/// How a program ended that did not end well.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FailedEnd {
    ExitCode(i32),
    Signal(i32),
    Unknown,
}

impl fmt::Display for FailedEnd {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::ExitCode(code) => write!(f, "exit code {code}"),
            Self::Signal(9) => f.write_str("killed by signal 9, out of memory perhaps"),
            Self::Signal(signal) => write!(f, "killed by signal {signal}"),
            Self::Unknown => f.write_str("ended for an unknown reason"),
        }
    }
}

/// The first exit code by which a shell reports that a signal killed the program.
const FIRST_SIGNAL_CODE: i32 = 128;

impl ProcessError {
    /// Whether the program ended by itself, with an error code and a message that says why.
    pub fn has_stated_reason(&self) -> bool {
        match self {
            Self::Failed { end: FailedEnd::ExitCode(code), tail, .. } => {
                *code < FIRST_SIGNAL_CODE && !tail.trim().is_empty()
            }
            _ => false,
        }
    }
}

#[derive(Debug, thiserror::Error)]
pub enum ProcessError {
    #[error("cannot run {program}: {source}")]
    Start { program: String, source: std::io::Error },
    #[error("cannot keep the messages of {program} in {log}: {source}")]
    Log { program: String, log: String, source: std::io::Error },
    #[error("{program} was killed after its limit of {limit_s:.1} s; its messages are in {log}")]
    TimedOut { program: String, limit_s: f64, log: String },
    #[error("{program} failed ({end}): {tail}\nall its messages are in {log}")]
    Failed { program: String, end: FailedEnd, tail: String, log: String },
    #[error("{program} ended without an answer; its messages are in {log}")]
    Silent { program: String, log: String },
    #[error(
        "{program} and what it started took {mib} MiB of memory, where {limit_mib} are allowed; its messages are in {log}"
    )]
    Memory { program: String, mib: u64, limit_mib: u64, log: String },
    #[error("{program} was ended: it gave more than {bytes} bytes of answer; its messages are in {log}")]
    TooMuch { program: String, bytes: usize, log: String },
    #[error("{program} was stopped: interrupted")]
    Interrupted { program: String },
}

impl Invocation {
    pub fn new(program: impl Into<PathBuf>, cwd: &Path, limit: Duration, log: impl Into<PathBuf>) -> Self {
        let (args, env, stdin) = (vec![], vec![], vec![]);
        let (program, cwd, log) = (program.into(), cwd.to_owned(), log.into());
        let (peak, freedom) = (PeakMemory::default(), Freedom::Confined { writable: vec![] });
        Self { program, args, env, cwd, stdin, limit, log, peak, freedom, longest_answer: LONGEST_ANSWER }
    }

    #[must_use]
    pub fn args<A: Into<OsString>>(mut self, args: impl IntoIterator<Item = A>) -> Self {
        self.args.extend(args.into_iter().map(Into::into));
        self
    }

    #[must_use]
    pub fn env(mut self, key: &str, value: impl Into<OsString>) -> Self {
        self.env.push((key.into(), value.into()));
        self
    }

    #[must_use]
    pub fn stdin(mut self, bytes: Vec<u8>) -> Self {
        self.stdin = bytes;
        self
    }

    /// As a program of the user's own, or one that installs.
    #[must_use]
    pub fn of_user(self) -> Self {
        Self { freedom: Freedom::OfUser { hidden: vec![], visible: vec![] }, ..self }
    }

    /// As a program of the user's own that must not read the results of a run: those below `hidden`, except what is below `visible`.
    #[must_use]
    pub fn of_user_without(self, hidden: Vec<PathBuf>, visible: Vec<PathBuf>) -> Self {
        Self { freedom: Freedom::OfUser { hidden, visible }, ..self }
    }

    /// Confined, but that it writes below this folder, too.
    #[must_use]
    pub fn may_write(mut self, folder: impl Into<PathBuf>) -> Self {
        if let Freedom::Confined { writable } = &mut self.freedom {
            writable.push(folder.into());
        }
        self
    }

    #[must_use]
    pub fn longest_answer(self, bytes: usize) -> Self {
        Self { longest_answer: bytes, ..self }
    }

    pub fn command_line(&self) -> String {
        let words = std::iter::once(self.program.as_os_str()).chain(self.args.iter().map(OsString::as_os_str));
        words.map(|w| quoted(&w.to_string_lossy())).collect::<Vec<_>>().join(" ")
    }

    pub fn command_line_with_env(&self) -> String {
        let variables = self.env.iter();
        let variables =
            variables.map(|(key, value)| format!("{}={} ", key.to_string_lossy(), quoted(&value.to_string_lossy())));
        variables.collect::<String>() + &self.command_line()
    }

    pub(super) fn name(&self) -> String {
        self.program.file_name().unwrap_or(self.program.as_os_str()).to_string_lossy().into_owned()
    }

    pub(super) fn log_name(&self) -> String {
        self.log.display().to_string()
    }

    pub(super) fn start_error(&self, source: std::io::Error) -> ProcessError {
        ProcessError::Start { program: self.program.display().to_string(), source }
    }
}

/// A word as a shell takes it for one.
pub fn quoted(word: &str) -> String {
    if !word.is_empty() && word.chars().all(|c| c.is_ascii_alphanumeric() || "-_./=+,:@%".contains(c)) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}
