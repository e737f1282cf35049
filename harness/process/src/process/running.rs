//! A program that runs, with all that it has started: under a supervisor where there is one, else in a process group of its own.

use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::io;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use parking_lot::Mutex;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fd::OwnedFd;
use rustix::process::{Pid, PidfdFlags, Signal, WaitOptions, kill_process, kill_process_group, pidfd_open, waitpid};

use super::invocation::{Freedom, Invocation};
use super::memory::PeakMemory;
use super::supervisor_args::{FAILED, SupervisorArgs};
use super::system::adopt;
use super::tree;

/// Set by the program that can be its own supervisor.
static SUPERVISED: AtomicBool = AtomicBool::new(false);

/// What was started and has not ended yet, as far as is known here; held while another starts.
static STARTED: Mutex<BTreeSet<u32>> = Mutex::new(BTreeSet::new());

/// What a program that is not the user's own gets of the user's environment; so are `LC_...` and `LUXPROOF_...`.
const PASSED_ON: [&str; 8] = ["PATH", "HOME", "USER", "LOGNAME", "LANG", "TMPDIR", "TZ", "CUDA_VISIBLE_DEVICES"];
/// How long a supervisor may take to end what it supervises.
const PATIENCE: Duration = Duration::from_secs(5);
const SHORTEST_PAUSE: Duration = Duration::from_millis(1);
/// How often memory is looked at in the long run.
const LOOK: Duration = Duration::from_millis(100);

pub(super) fn supervise_from_now_on() {
    SUPERVISED.store(adopt(), Ordering::Relaxed);
}

#[derive(Debug)]
pub(super) struct Running {
    pub(super) child: Child,
    is_supervised: bool,
    has_ended: bool,
    /// Readable once it has ended.
    end: Option<OwnedFd>,
    peak: PeakMemory,
    start: Instant,
    next_look: Instant,
}

impl Running {
    pub(super) fn start(invocation: &Invocation) -> io::Result<Self> {
        let is_supervised = SUPERVISED.load(Ordering::Relaxed);
        let mut command = if is_supervised { supervised(invocation) } else { Command::new(&invocation.program) };
        if matches!(invocation.freedom, Freedom::Confined { .. }) {
            command.env_clear().envs(std::env::vars_os().filter(|(key, _)| is_passed_on(key)));
        } else if matches!(&invocation.freedom, Freedom::OfUser { hidden, .. } if !hidden.is_empty()) {
            // It names a folder of results.
            command.env_remove("LUXPROOF_CACHE");
        }
        if !is_supervised {
            command.args(&invocation.args).envs(invocation.env.iter().map(|(key, value)| (key, value)));
        }
        command.current_dir(&invocation.cwd).process_group(0);
        let mut started = STARTED.lock();
        let child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn()?;
        started.insert(child.id());
        let end = Pid::from_raw(child.id().cast_signed()).and_then(|pid| pidfd_open(pid, PidfdFlags::empty()).ok());
        let (peak, start) = (invocation.peak.clone(), Instant::now());
        Ok(Self { child, is_supervised, has_ended: false, end, peak, start, next_look: start })
    }

    /// Serves another run from now on, whose peak of memory is at least what it took before.
    pub(super) fn go_on(&mut self, invocation: &Invocation) {
        self.peak = invocation.peak.clone();
        self.start = Instant::now();
        self.next_look = self.start;
    }

    /// Waits until it has ended or its memory is to be looked at, a tenth of a second at most.
    pub(super) fn pause(&self) {
        let wait = self.next_look.saturating_duration_since(Instant::now()).clamp(SHORTEST_PAUSE, LOOK);
        let timeout = Timespec { tv_sec: 0, tv_nsec: wait.subsec_nanos().into() };
        let end = self.end.as_ref().map(|end| PollFd::new(end, PollFlags::IN));
        if end.is_none_or(|end| poll(&mut [end], Some(&timeout)).is_err()) {
            thread::sleep(SHORTEST_PAUSE);
        }
    }

    /// How it ended, if it has; what it left behind is ended, too.
    pub(super) fn ended(&mut self) -> io::Result<Option<ExitStatus>> {
        let status = self.child.try_wait()?;
        if let Some(status) = status {
            self.bury(status);
        }
        Ok(status)
    }

    fn bury(&mut self, status: ExitStatus) {
        self.has_ended = true;
        STARTED.lock().remove(&self.child.id());
        if !self.is_supervised {
            kill_group(self.child.id());
        } else if status.signal().is_some() {
            // Perhaps it was the supervisor that was killed.
            end_orphans();
        }
    }

    /// Whether the supervisor failed in place of the program.
    pub(super) fn is_unstarted(&self, status: ExitStatus) -> bool {
        self.is_supervised && status.code() == Some(i32::from(FAILED))
    }

    /// MiB that it has, where these are too many.
    pub(super) fn too_much_memory_mib(&mut self) -> Option<u64> {
        let now = Instant::now();
        if now < self.next_look {
            return None;
        }
        // Many a program ends soon: at first it is looked at often.
        self.next_look = now + (self.start.elapsed() / 4).min(LOOK);
        self.peak.look_at(&self.processes())
    }

    fn processes(&self) -> Vec<u32> {
        let itself = (!self.is_supervised).then(|| self.child.id());
        tree::descendants(self.child.id()).into_iter().chain(itself).collect()
    }

    /// Ends it and all that it started.
    pub(super) fn stop(&mut self) {
        if self.is_supervised {
            self.ask_supervisor();
        }
        let start = Instant::now();
        while self.is_supervised && start.elapsed() < PATIENCE {
            if matches!(self.ended(), Ok(Some(_)) | Err(_)) {
                return;
            }
            thread::sleep(Duration::from_millis(1));
        }
        // There is no supervisor, or somebody has stopped it.
        for process in tree::descendants(self.child.id()) {
            tree::kill(process);
        }
        kill_group(self.child.id());
        if let Ok(status) = self.child.wait() {
            self.bury(status);
        }
    }

    fn ask_supervisor(&self) {
        for signal in [Signal::TERM, Signal::CONT] {
            Pid::from_raw(self.child.id().cast_signed()).map(|pid| kill_process(pid, signal));
        }
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        if !self.has_ended {
            self.stop();
        }
    }
}

/// This program itself, wherever it was moved meanwhile, as the supervisor of another.
fn supervised(invocation: &Invocation) -> Command {
    let (confined, writable, hidden, visible) = match &invocation.freedom {
        Freedom::OfUser { hidden, visible } => (false, vec![], hidden.clone(), visible.clone()),
        Freedom::Confined { writable } => {
            (true, [std::slice::from_ref(&invocation.cwd), writable].concat(), vec![], vec![])
        }
    };
    let variables = invocation.env.iter().map(|(key, value)| [key.as_os_str(), value].join(OsStr::new("=")));
    let charge = SupervisorArgs {
        parent: std::process::id(),
        confined,
        writable,
        hidden,
        visible,
        set: variables.collect(),
        command: std::iter::once(invocation.program.clone().into()).chain(invocation.args.clone()).collect(),
    };
    let mut command = Command::new("/proc/self/exe");
    command.arg0("luxproof").args(charge.words());
    command
}

/// Ends what supervisors that were killed have left to this process: all its children that it has not started.
fn end_orphans() {
    let (started, start) = (STARTED.lock(), Instant::now());
    while start.elapsed() < PATIENCE {
        let children = tree::children(std::process::id());
        let orphans: Vec<u32> = children.into_iter().filter(|child| !started.contains(child)).collect();
        if orphans.is_empty() {
            return;
        }
        for orphan in orphans {
            tree::descendants(orphan).into_iter().chain([orphan]).for_each(tree::kill);
            waitpid(Pid::from_raw(orphan.cast_signed()), WaitOptions::NOHANG).ok();
        }
        thread::sleep(Duration::from_millis(1));
    }
}

fn is_passed_on(key: &OsStr) -> bool {
    let key = key.to_string_lossy();
    PASSED_ON.contains(&key.as_ref()) || ["LC_", "LUXPROOF_"].iter().any(|prefix| key.starts_with(prefix))
}

fn kill_group(process: u32) {
    // The group is gone already in the ordinary case: that is no error.
    Pid::from_raw(process.cast_signed()).map(|pid| kill_process_group(pid, Signal::KILL));
}
