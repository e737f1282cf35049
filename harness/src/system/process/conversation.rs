//! Programs that answer line by line.

use std::io::Write;
use std::process::{ChildStdin, ExitStatus};
use std::sync::mpsc;
use std::time::{Duration, Instant};

use super::invocation::{Invocation, ProcessError};
use super::output::{Messages, lines};
use super::running::Running;

/// A program that answers each line on its standard input with a line on its standard output. Its limit is that of
/// [`Invocation`], from its start to its end; dropped before its end, it is killed.
pub struct Conversation {
    invocation: Invocation,
    start: Instant,
    running: Running,
    stdin: Option<ChildStdin>,
    lines: mpsc::Receiver<String>,
    /// Taken once they are in the log.
    messages: Option<Messages>,
}

const LISTEN: Duration = Duration::from_millis(10);

impl Invocation {
    pub fn converse(&self) -> Result<Conversation, ProcessError> {
        tracing::debug!(command = %self.command_line(), cwd = %self.cwd.display(), "converse");
        let mut running = Running::start(self).map_err(|source| self.start_error(source))?;
        let messages = Some(Messages::of(running.child.stderr.take()));
        let lines = lines(running.child.stdout.take(), self.longest_answer);
        let stdin = running.child.stdin.take();
        Ok(Conversation { invocation: self.clone(), start: Instant::now(), running, stdin, lines, messages })
    }
}

impl Conversation {
    pub fn ask(&mut self, line: &str) -> Result<String, ProcessError> {
        if let Some(stdin) = &mut self.stdin {
            // A program that has ended has closed the pipe: its own status tells why.
            writeln!(stdin, "{line}").and_then(|()| stdin.flush()).ok();
        }
        self.listen()
    }

    pub fn listen(&mut self) -> Result<String, ProcessError> {
        loop {
            let overrun = self.invocation.overrun(&mut self.running, self.start);
            match self.lines.recv_timeout(LISTEN) {
                Ok(line) => return Ok(line),
                Err(mpsc::RecvTimeoutError::Timeout) => {}
                Err(mpsc::RecvTimeoutError::Disconnected) => {
                    self.end()?;
                    let (program, log) = (self.invocation.name(), self.invocation.log_name());
                    return Err(ProcessError::Silent { program, log });
                }
            }
            if let Some(error) = overrun {
                return Err(error);
            }
        }
    }

    /// Says no more, and waits until the program has ended.
    pub fn end(&mut self) -> Result<(), ProcessError> {
        self.stdin = None;
        let ended = self.invocation.wait(&mut self.running, self.start, || None);
        self.close(ended)
    }

    fn close(&mut self, ended: Result<ExitStatus, ProcessError>) -> Result<(), ProcessError> {
        let Some(messages) = self.messages.take() else { return Ok(()) };
        self.invocation.conclude(&self.running, ended, &messages.said()).map(|_| ())
    }

    #[cfg(test)]
    pub(super) fn peak_mib(&self) -> Option<f64> {
        self.invocation.peak.mib()
    }
}

impl Drop for Conversation {
    fn drop(&mut self) {
        if self.messages.is_some() {
            self.running.stop();
            // Whoever drops it knows of an error already.
            self.close(Err(ProcessError::Interrupted { program: self.invocation.name() })).ok();
        }
    }
}
