//! Runs a program to its end, within its limits, and keeps what it said.

use std::fs;
use std::io::Write;
use std::os::unix::process::ExitStatusExt;
use std::process::ExitStatus;
use std::thread;
use std::time::Instant;

use super::interrupt::is_interrupted;
use super::invocation::{FailedEnd, Finished, Invocation, ProcessError};
use super::memory;
use super::output::{Answer, Messages};
use super::running::Running;
use crate::printable;

impl Invocation {
    pub fn run(&self) -> Result<Finished, ProcessError> {
        let start = Instant::now();
        tracing::debug!(command = %self.command_line(), cwd = %self.cwd.display(), "run");
        let mut running = Running::start(self).map_err(|source| self.start_error(source))?;
        if let Some(mut stdin) = running.child.stdin.take() {
            let input = self.stdin.clone();
            // A program that exits without reading its input closes the pipe: its own status tells why.
            thread::spawn(move || stdin.write_all(&input).ok());
        }
        let answer = Answer::of(running.child.stdout.take(), self.longest_answer);
        let messages = Messages::of(running.child.stderr.take());
        let too_much = || answer.is_too_long().then(|| self.too_much());
        let ended = self.wait(&mut running, start, too_much);
        // It may have ended because nobody took more.
        let ended = too_much().map_or(ended, Err);
        let stdout = answer.given();
        let stderr = self.conclude(&running, ended, &messages.into_text())?;
        Ok(Finished { stdout, stderr, wall: start.elapsed() })
    }

    /// Waits until it has ended; what goes beyond a limit, and what `objects` to, is ended.
    pub(super) fn wait(
        &self,
        running: &mut Running,
        start: Instant,
        objects: impl Fn() -> Option<ProcessError>,
    ) -> Result<ExitStatus, ProcessError> {
        loop {
            let overrun = self.overrun(running, start).or_else(&objects);
            if let Some(status) = running.ended().map_err(|source| self.start_error(source))? {
                return Ok(status);
            }
            if let Some(error) = overrun {
                running.stop();
                return Err(error);
            }
            running.pause();
        }
    }

    pub(super) fn overrun(&self, running: &mut Running, start: Instant) -> Option<ProcessError> {
        let (program, log) = (self.name(), self.log_name());
        if is_interrupted() {
            return Some(ProcessError::Interrupted { program });
        }
        if start.elapsed() >= self.limit {
            return Some(ProcessError::TimedOut { program, limit_s: self.limit.as_secs_f64(), log });
        }
        let mib = running.too_much_memory_mib()?;
        Some(ProcessError::Memory { program, mib, limit_mib: memory::limit_mib(), log })
    }

    fn too_much(&self) -> ProcessError {
        ProcessError::TooMuch { program: self.name(), bytes: self.longest_answer, log: self.log_name() }
    }

    /// Keeps what a program that ended said; an error where it did not end well.
    pub(super) fn conclude(
        &self,
        running: &Running,
        ended: Result<ExitStatus, ProcessError>,
        stderr: &str,
    ) -> Result<String, ProcessError> {
        self.keep_log(stderr)?;
        let status = ended?;
        if status.success() {
            return Ok(stderr.to_owned());
        }
        if running.is_unstarted(status) {
            return Err(self.start_error(std::io::Error::other(tail(stderr, 1))));
        }
        let end = match (status.code(), status.signal()) {
            (Some(code), _) => FailedEnd::ExitCode(code),
            (None, Some(signal)) => FailedEnd::Signal(signal),
            (None, None) => FailedEnd::Unknown,
        };
        Err(ProcessError::Failed { program: self.name(), end, tail: tail(stderr, LAST_WORDS), log: self.log_name() })
    }

    pub(super) fn keep_log(&self, stderr: &str) -> Result<(), ProcessError> {
        let above = self.log.parent().map_or(Ok(()), fs::create_dir_all);
        let log = above.and_then(|()| fs::OpenOptions::new().create(true).append(true).open(&self.log));
        // In one piece: programs side by side share a log.
        let entry = format!("$ {}\n{stderr}\n", self.command_line());
        let kept = log.and_then(|mut log| log.write_all(entry.as_bytes()));
        kept.map_err(|source| ProcessError::Log { program: self.name(), log: self.log_name(), source })
    }
}

/// Lines of a program's messages that an error repeats.
const LAST_WORDS: usize = 8;

fn tail(text: &str, lines: usize) -> String {
    let all: Vec<&str> = text.lines().filter(|l| !l.trim().is_empty()).collect();
    printable::lines(&all[all.len().saturating_sub(lines)..].join("\n"))
}
