//! Programs that answer line by line.

use std::io::Write;
use std::process::ChildStdin;
use std::sync::{Arc, mpsc};
use std::time::{Duration, Instant};

use parking_lot::Mutex;

use super::invocation::{Invocation, ProcessError};
use super::output::{Messages, lines};
use super::running::Running;

/// A program that answers each line on its standard input with a line on its standard output. Its limit is that of
/// [`Invocation`], from its start to its end; dropped before its end, it is killed.
pub struct Conversation {
    invocation: Invocation,
    start: Instant,
    /// Where the program waits afterwards.
    idle: Option<ProcessPool>,
    /// Nobody, once it has ended.
    partner: Option<Partner>,
}

/// A program, and what one hears of it.
#[derive(Debug)]
struct Partner {
    running: Running,
    stdin: Option<ChildStdin>,
    lines: mpsc::Receiver<String>,
    messages: Messages,
}

/// Programs that have answered what they were asked and wait to be asked more, with how they were run last; with the last clone of this they
/// are killed.
#[derive(Clone, Debug, Default)]
pub struct ProcessPool(Arc<Mutex<Vec<(Invocation, Partner)>>>);

impl ProcessPool {
    /// How many processes wait.
    pub fn count(&self) -> usize {
        self.0.lock().len()
    }

    /// One that still lives.
    fn take(&self, run: &Invocation) -> Option<Partner> {
        loop {
            let mut waiting = self.0.lock();
            let place = waiting.iter().position(|(other, _)| {
                (&other.program, &other.args, &other.env) == (&run.program, &run.args, &run.env)
            })?;
            let (_, mut partner) = waiting.swap_remove(place);
            drop(waiting);
            if matches!(partner.running.ended(), Ok(None)) {
                partner.running.go_on(run);
                return Some(partner);
            }
        }
    }
}

const LISTEN: Duration = Duration::from_millis(10);

impl Invocation {
    /// Talks with a program that ends with the conversation; with `idle`, with one that waits there where the same has run before, and that
    /// waits there again afterwards.
    pub fn converse(&self, idle: Option<&ProcessPool>) -> Result<Conversation, ProcessError> {
        let partner = match idle.and_then(|idle| idle.take(self)) {
            Some(partner) => partner,
            None => Partner::of(self).map_err(|source| self.start_error(source))?,
        };
        let (invocation, start) = (self.clone(), Instant::now());
        Ok(Conversation { invocation, start, idle: idle.cloned(), partner: Some(partner) })
    }
}

impl Partner {
    fn of(run: &Invocation) -> std::io::Result<Self> {
        tracing::debug!(command = %run.command_line(), cwd = %run.cwd.display(), "converse");
        let mut running = Running::start(run)?;
        let messages = Messages::of(running.child.stderr.take());
        let lines = lines(running.child.stdout.take(), run.longest_answer);
        let stdin = running.child.stdin.take();
        Ok(Self { running, stdin, lines, messages })
    }
}

impl Conversation {
    pub fn ask(&mut self, line: &str) -> Result<String, ProcessError> {
        if let Some(stdin) = self.partner.as_mut().and_then(|partner| partner.stdin.as_mut()) {
            // A program that has ended has closed the pipe: its own status tells why.
            writeln!(stdin, "{line}").and_then(|()| stdin.flush()).ok();
        }
        self.listen()
    }

    pub fn listen(&mut self) -> Result<String, ProcessError> {
        while let Some(partner) = &mut self.partner {
            let overrun = self.invocation.overrun(&mut partner.running, self.start);
            match partner.lines.recv_timeout(LISTEN) {
                Ok(line) => return Ok(line),
                Err(mpsc::RecvTimeoutError::Timeout) => overrun.map_or(Ok(()), Err)?,
                Err(mpsc::RecvTimeoutError::Disconnected) => self.close()?,
            }
        }
        Err(ProcessError::Silent { program: self.invocation.name(), log: self.invocation.log_name() })
    }

    /// Says no more, and waits until the program has ended, or leaves it to wait; messages that it still has on the way are then in the log of the
    /// next.
    pub fn end(&mut self) -> Result<(), ProcessError> {
        let Some(idle) = self.idle.take() else { return self.close() };
        let Some(partner) = self.partner.take() else { return Ok(()) };
        self.invocation.keep_log(&partner.messages.so_far())?;
        idle.0.lock().push((self.invocation.clone(), partner));
        Ok(())
    }

    fn close(&mut self) -> Result<(), ProcessError> {
        let Some(Partner { mut running, stdin, messages, .. }) = self.partner.take() else { return Ok(()) };
        drop(stdin);
        let ended = self.invocation.wait(&mut running, self.start, || None);
        self.invocation.conclude(&running, ended, &messages.into_text()).map(|_| ())
    }

    #[cfg(test)]
    pub(super) fn peak_mib(&self) -> Option<f64> {
        self.invocation.peak.mib()
    }
}

impl Drop for Conversation {
    fn drop(&mut self) {
        if let Some(Partner { mut running, messages, .. }) = self.partner.take() {
            running.stop();
            let stopped = Err(ProcessError::Interrupted { program: self.invocation.name() });
            // Whoever drops it knows of an error already.
            self.invocation.conclude(&running, stopped, &messages.into_text()).ok();
        }
    }
}
