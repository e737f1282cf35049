//! The process that stands between this program and one that it runs, and outlives neither: it confines the program, adopts whatever
//! that leaves behind, and ends all of it when the program ends, when it is asked to, or when whoever started it is gone,
//! however that came about.

use std::io::Write;
use std::os::unix::net::UnixStream;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Command, ExitCode};
use std::thread;
use std::time::{Duration, Instant};

use clap::Parser;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fd::OwnedFd;
use rustix::process::{
    Pid, PidfdFlags, Resource, Rlimit, Signal, WaitOptions, WaitStatus, getpid, getppid, getrlimit, kill_process,
    pidfd_open, set_child_subreaper, setrlimit, wait,
};
use tempfile::TempDir;

use super::supervisor_args::{FAILED, SUPERVISE, SupervisorArgs, variable_of};
use super::{sandbox, tree};

/// The exit code of one that was asked to end what it supervises.
const ASKED: u8 = 143;
/// How often it looks for the dead that were left to it.
const ROUND: Timespec = Timespec { tv_sec: 0, tv_nsec: 100_000_000 };
/// A program that hangs in the system itself cannot be ended.
const PATIENCE: Duration = Duration::from_secs(10);

/// Lets this process have the children of those that end before them; whether it does.
pub(super) fn adopt() -> bool {
    set_child_subreaper(Some(getpid())).is_ok()
}

pub(super) fn sandbox_in_words() -> String {
    sandbox::in_words()
}

/// Supervises, where this process was started for it.
pub(super) fn supervise() -> Option<ExitCode> {
    std::env::args_os().nth(1).filter(|word| word == SUPERVISE)?;
    let charge = SupervisorArgs::parse_from(std::env::args_os().skip(1));
    let ended = Supervisor::begin(charge.parent).and_then(|supervisor| supervisor.run(&charge));
    Some(match ended {
        Ok(Some(status)) => ended_as(status),
        Ok(None) => ExitCode::from(ASKED),
        Err(error) => {
            // Where nobody listens any more, nobody has to know.
            writeln!(std::io::stderr(), "{error}").ok();
            ExitCode::from(FAILED)
        }
    })
}

struct Supervisor {
    /// Readable once the process that started this one is gone.
    parent: OwnedFd,
    /// Readable once it is asked to end.
    asked: UnixStream,
}

impl Supervisor {
    fn begin(parent: u32) -> std::io::Result<Self> {
        let (mut ask, asked) = UnixStream::pair()?;
        ctrlc::set_handler(move || drop(ask.write_all(b"!"))).map_err(std::io::Error::other)?;
        set_child_subreaper(Some(getpid()))?;
        // What a renderer leaves when it crashes may be as large as its memory.
        setrlimit(Resource::Core, Rlimit { current: Some(0), ..getrlimit(Resource::Core) })?;
        let pid = Pid::from_raw(parent.cast_signed()).ok_or(std::io::ErrorKind::InvalidInput)?;
        let parent = pidfd_open(pid, PidfdFlags::empty())?;
        // It may have ended before, and its number have become another's.
        if getppid() == Some(pid) { Ok(Self { parent, asked }) } else { Err(std::io::ErrorKind::NotFound.into()) }
    }

    /// How the program ended; nothing where it was made to.
    fn run(&self, charge: &SupervisorArgs) -> std::io::Result<Option<WaitStatus>> {
        let temporary = charge.confined.then(tempfile::tempdir).transpose()?;
        let started = start(charge, temporary.as_ref().map(TempDir::path));
        let ended = started.and_then(|program| self.watch(program));
        end_all();
        ended
    }

    fn watch(&self, program: Pid) -> std::io::Result<Option<WaitStatus>> {
        // It may be gone already; then it waits to be buried.
        let running = pidfd_open(program, PidfdFlags::empty())?;
        loop {
            let mut until = [
                PollFd::new(&running, PollFlags::IN),
                PollFd::new(&self.parent, PollFlags::IN),
                PollFd::new(&self.asked, PollFlags::IN),
            ];
            poll(&mut until, Some(&ROUND))
                .or_else(|error| if error == rustix::io::Errno::INTR { Ok(0) } else { Err(error) })?;
            let is_to_end = until[1..].iter().any(|fd| !fd.revents().is_empty());
            while let Ok(Some((dead, status))) = wait(WaitOptions::NOHANG) {
                if dead == program {
                    return Ok(Some(status));
                }
            }
            if is_to_end {
                return Ok(None);
            }
        }
    }
}

/// Starts the program in a thread that is confined, as the supervisor itself is not.
fn start(charge: &SupervisorArgs, temporary: Option<&Path>) -> std::io::Result<Pid> {
    let mut command = Command::new(&charge.command[0]);
    command.args(&charge.command[1..]).process_group(0);
    if charge.confined {
        // Its threads spin from the start and are given nothing to do by any of our drivers.
        command.env("OPENBLAS_NUM_THREADS", "1");
    }
    command.envs(charge.set.iter().filter_map(|variable| variable_of(variable)));
    let mut writable = charge.writable.clone();
    if let Some(folder) = temporary {
        command.env("TMPDIR", folder);
        writable.push(folder.to_owned());
    }
    let confined = charge.confined.then_some(writable);
    let (hidden, visible) = (charge.hidden.clone(), charge.visible.clone());
    let starting = thread::spawn(move || {
        // A kernel that cannot confine is no reason to measure nothing: `engines doctor` tells.
        if let Some(writable) = confined {
            drop(sandbox::enter(&writable));
        } else if !hidden.is_empty() {
            drop(sandbox::hide(&hidden, &visible));
        }
        command.spawn()
    });
    let child = starting.join().map_err(|_| std::io::Error::other("the program could not be started"))??;
    // What the program closes is closed: its pipes are not held open here.
    let nothing = std::fs::File::options().read(true).write(true).open("/dev/null")?;
    rustix::stdio::dup2_stdin(&nothing)?;
    rustix::stdio::dup2_stdout(&nothing)?;
    Ok(Pid::from_child(&child))
}

/// Ends all that descends from this process: what has lost its parent has become its own child, so that it is done when there is none.
fn end_all() {
    let start = Instant::now();
    while is_survived() && start.elapsed() < PATIENCE {
        for process in tree::descendants(std::process::id()) {
            tree::kill(process);
        }
        thread::sleep(Duration::from_millis(1));
    }
}

/// Whether any child is left once the dead are buried.
fn is_survived() -> bool {
    loop {
        match wait(WaitOptions::NOHANG) {
            Ok(Some(_)) => (),
            Ok(None) => return true,
            Err(_) => return false,
        }
    }
}

/// Ends as the program did.
fn ended_as(status: WaitStatus) -> ExitCode {
    if let Some(code) = status.exit_status() {
        return ExitCode::from(code as u8);
    }
    let signal = status.terminating_signal().unwrap_or(0);
    // Twice: what watches for a stack that overflows takes the first for one.
    for signal in [Signal::from_named_raw(signal); 2].into_iter().flatten() {
        kill_process(getpid(), signal).ok();
    }
    // One of those that it heeds itself.
    ExitCode::from(128 + signal as u8)
}
