//! Runs external programs: time limit, own process group that is killed whole, stderr kept in a log file.
//!
//! The only file that spawns processes.

use std::ffi::OsString;
use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command as StdCommand, ExitStatus, Stdio};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, mpsc};
use std::thread;
use std::time::{Duration, Instant};

/// How long a pipe may stay open after the program behind it has ended.
const LEFT_BEHIND: Duration = Duration::from_secs(3);

/// Set when the user asked to stop (Ctrl-C); every running process group is then killed.
static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// Asks all running and future processes to stop; safe to call from a signal handler's thread.
pub fn interrupt() {
    INTERRUPTED.store(true, Ordering::SeqCst);
}

/// What [`interrupt`] raises, for solvers that look at it themselves.
pub fn interrupt_flag() -> &'static AtomicBool {
    &INTERRUPTED
}

pub fn is_interrupted() -> bool {
    INTERRUPTED.load(Ordering::SeqCst)
}

/// How many threads or processes run side by side where nobody says: one a core.
pub fn cores() -> usize {
    thread::available_parallelism().map_or(1, std::num::NonZero::get)
}

/// The largest resident memory of any process of a job so far; clones share it.
#[derive(Clone, Debug, Default)]
pub struct PeakMemory(Arc<AtomicU64>);

impl PeakMemory {
    /// In MiB; `None` where no process was seen, or the system does not tell.
    pub fn mib(&self) -> Option<f64> {
        let kib = self.0.load(Ordering::Relaxed);
        (kib > 0).then_some(kib as f64 / 1024.0)
    }

    /// Looks at a process that runs: a number, or `self`.
    pub fn look_at(&self, process: &str) {
        // rusage would do after the end, but counts what a fork shares with its parent as the child's own.
        let Ok(status) = fs::read_to_string(format!("/proc/{process}/status")) else { return };
        let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"));
        let kib = line.and_then(|l| l.split_whitespace().next()).and_then(|w| w.parse().ok());
        self.0.fetch_max(kib.unwrap_or(0), Ordering::Relaxed);
    }
}

/// Processor time of this process and of all its children that have ended.
pub fn cpu_time() -> Duration {
    use nix::sys::resource::{UsageWho, getrusage};
    use nix::sys::time::TimeValLike;
    let of = |who| getrusage(who).map_or(0, |usage| (usage.user_time() + usage.system_time()).num_microseconds());
    Duration::from_micros((of(UsageWho::RUSAGE_SELF) + of(UsageWho::RUSAGE_CHILDREN)).unsigned_abs())
}

/// Asks a program about itself, its version say, in a folder of its own: in a shared one another user's log could not
/// be written.
pub fn ask(
    program: PathBuf,
    question: &str,
    prepare: impl FnOnce(Invocation) -> Invocation,
) -> Result<Finished, ProcessError> {
    let name = program.display().to_string();
    let folder = tempfile::tempdir().map_err(|source| ProcessError::Start { program: name, source })?;
    let log = folder.path().join("log");
    prepare(Invocation::new(program, folder.path(), ANSWER_LIMIT, log)).args([question]).run()
}

/// A program that does not know its version by now hangs.
const ANSWER_LIMIT: Duration = Duration::from_secs(20);

#[derive(Clone, Debug)]
pub struct Invocation {
    pub program: PathBuf,
    pub args: Vec<OsString>,
    /// Environment variables set on top of ours.
    pub env: Vec<(OsString, OsString)>,
    pub cwd: PathBuf,
    pub stdin: Vec<u8>,
    /// Wall-clock limit; past it the whole process group is killed.
    pub limit: Duration,
    pub log: PathBuf,
    pub peak: PeakMemory,
}

/// What a program that exited with 0 gave.
#[derive(Clone, Debug)]
pub struct Finished {
    pub stdout: Vec<u8>,
    /// Its standard error, also kept in the log.
    pub stderr: String,
    pub wall: Duration,
}

#[derive(Debug, thiserror::Error)]
pub enum ProcessError {
    #[error("cannot run {program}: {source}")]
    Start { program: String, source: std::io::Error },
    #[error("cannot keep the messages of {program} in {log}: {source}")]
    Log { program: String, log: String, source: std::io::Error },
    #[error("{program} was killed after its limit of {limit_s:.1} s; its messages are in {log}")]
    TimedOut { program: String, limit_s: f64, log: String },
    #[error("{program} failed ({status}): {tail}\nall its messages are in {log}")]
    Failed { program: String, status: String, tail: String, log: String },
    #[error("{program} ended without an answer; its messages are in {log}")]
    Silent { program: String, log: String },
    #[error("{program} was stopped: interrupted")]
    Interrupted { program: String },
}

impl Invocation {
    pub fn new(program: impl Into<PathBuf>, cwd: &Path, limit: Duration, log: impl Into<PathBuf>) -> Self {
        let (args, env, stdin) = (vec![], vec![], vec![]);
        let peak = PeakMemory::default();
        Self { program: program.into(), args, env, cwd: cwd.to_owned(), stdin, limit, log: log.into(), peak }
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

    pub fn command_line(&self) -> String {
        let words = std::iter::once(self.program.as_os_str()).chain(self.args.iter().map(OsString::as_os_str));
        words.map(|w| quoted(&w.to_string_lossy())).collect::<Vec<_>>().join(" ")
    }

    pub fn command_line_with_env(&self) -> String {
        let set = |(key, value): &(OsString, OsString)| {
            format!("{}={} ", key.to_string_lossy(), quoted(&value.to_string_lossy()))
        };
        self.env.iter().map(set).collect::<String>() + &self.command_line()
    }

    pub fn run(&self) -> Result<Finished, ProcessError> {
        let start = Instant::now();
        tracing::debug!(command = %self.command_line(), cwd = %self.cwd.display(), "run");
        let mut child = self.spawn().map_err(|source| self.start_error(source))?;
        if let Some(mut stdin) = child.stdin.take() {
            let input = self.stdin.clone();
            // A program that exits without reading its input closes the pipe: its own status tells why.
            thread::spawn(move || stdin.write_all(&input).ok());
        }
        let (stdout, stderr) = (drain(child.stdout.take()), drain(child.stderr.take()));
        let ended = self.wait(&mut child, start);
        // Whatever the program started goes with it.
        kill_group(&child);
        let stdout = stdout.said();
        let stderr = self.conclude(ended, &stderr.said())?;
        Ok(Finished { stdout, stderr, wall: start.elapsed() })
    }

    pub fn converse(&self) -> Result<Conversation, ProcessError> {
        tracing::debug!(command = %self.command_line(), cwd = %self.cwd.display(), "converse");
        let mut child = self.spawn().map_err(|source| self.start_error(source))?;
        let stderr = Some(drain(child.stderr.take()));
        let (sender, lines) = mpsc::channel();
        if let Some(stdout) = child.stdout.take() {
            thread::spawn(move || {
                // Ends with the pipe, or when nobody listens any more.
                BufReader::new(stdout).lines().map_while(Result::ok).try_for_each(|line| sender.send(line)).ok();
            });
        }
        let stdin = child.stdin.take();
        Ok(Conversation { invocation: self.clone(), start: Instant::now(), child, stdin, lines, stderr })
    }

    /// Keeps what a program that ended said; an error where it did not end well.
    fn conclude(&self, ended: Result<ExitStatus, ProcessError>, stderr: &[u8]) -> Result<String, ProcessError> {
        let stderr = String::from_utf8_lossy(stderr).into_owned();
        let unkept = |source| ProcessError::Log { program: self.name(), log: self.log_name(), source };
        self.keep_log(&stderr).map_err(unkept)?;
        let status = ended?;
        if status.success() {
            return Ok(stderr);
        }
        let status = match (status.code(), status.signal()) {
            (Some(code), _) => format!("exit code {code}"),
            (None, Some(9)) => "killed by signal 9, out of memory perhaps".to_owned(),
            (None, Some(signal)) => format!("killed by signal {signal}"),
            (None, None) => "ended for an unknown reason".to_owned(),
        };
        Err(ProcessError::Failed { program: self.name(), status, tail: tail(&stderr), log: self.log_name() })
    }

    fn spawn(&self) -> std::io::Result<Child> {
        StdCommand::new(&self.program)
            .args(&self.args)
            .envs(self.env.iter().map(|(k, v)| (k, v)))
            .current_dir(&self.cwd)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .process_group(0)
            .spawn()
    }

    fn wait(&self, child: &mut Child, start: Instant) -> Result<ExitStatus, ProcessError> {
        let mut pause = Duration::from_micros(200);
        let process = child.id().to_string();
        loop {
            self.peak.look_at(&process);
            if let Some(status) = child.try_wait().map_err(|source| self.start_error(source))? {
                return Ok(status);
            }
            if let Some(error) = self.overrun(start) {
                kill_group(child);
                child.wait().map_err(|source| self.start_error(source))?;
                return Err(error);
            }
            thread::sleep(pause);
            pause = (pause * 2).min(Duration::from_millis(10));
        }
    }

    fn overrun(&self, start: Instant) -> Option<ProcessError> {
        if is_interrupted() {
            return Some(ProcessError::Interrupted { program: self.name() });
        }
        let limit_s = self.limit.as_secs_f64();
        let error = || ProcessError::TimedOut { program: self.name(), limit_s, log: self.log_name() };
        (start.elapsed() >= self.limit).then(error)
    }

    fn keep_log(&self, stderr: &str) -> std::io::Result<()> {
        if let Some(folder) = self.log.parent() {
            fs::create_dir_all(folder)?;
        }
        let mut log = fs::OpenOptions::new().create(true).append(true).open(&self.log)?;
        writeln!(log, "$ {}\n{stderr}", self.command_line())
    }

    fn name(&self) -> String {
        self.program.file_name().unwrap_or(self.program.as_os_str()).to_string_lossy().into_owned()
    }

    fn log_name(&self) -> String {
        self.log.display().to_string()
    }

    fn start_error(&self, source: std::io::Error) -> ProcessError {
        ProcessError::Start { program: self.program.display().to_string(), source }
    }
}

/// A program that answers each line on its standard input with a line on its standard output. Its limit is that of
/// [`Invocation`], from its start to its end; dropped before its end, it is killed.
pub struct Conversation {
    invocation: Invocation,
    start: Instant,
    child: Child,
    stdin: Option<ChildStdin>,
    lines: mpsc::Receiver<String>,
    /// Taken once its messages are in the log.
    stderr: Option<Drained>,
}

const LISTEN: Duration = Duration::from_millis(10);

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
            self.invocation.peak.look_at(&self.child.id().to_string());
            match self.lines.recv_timeout(LISTEN) {
                Ok(line) => return Ok(line),
                Err(mpsc::RecvTimeoutError::Timeout) => {}
                Err(mpsc::RecvTimeoutError::Disconnected) => {
                    self.end()?;
                    let (program, log) = (self.invocation.name(), self.invocation.log_name());
                    return Err(ProcessError::Silent { program, log });
                }
            }
            if let Some(error) = self.invocation.overrun(self.start) {
                return Err(error);
            }
        }
    }

    /// Says no more, and waits until the program has ended.
    pub fn end(&mut self) -> Result<(), ProcessError> {
        self.stdin = None;
        let ended = self.invocation.wait(&mut self.child, self.start);
        self.close(ended)
    }

    fn close(&mut self, ended: Result<ExitStatus, ProcessError>) -> Result<(), ProcessError> {
        kill_group(&self.child);
        let Some(stderr) = self.stderr.take() else { return Ok(()) };
        self.invocation.conclude(ended, &stderr.said()).map(|_| ())
    }
}

impl Drop for Conversation {
    fn drop(&mut self) {
        if self.stderr.is_some() {
            kill_group(&self.child);
            let ended = self.child.wait().map_err(|source| self.invocation.start_error(source));
            // Whoever drops it knows of an error already.
            self.close(ended).ok();
        }
    }
}

/// What a program writes, as a thread reads it, so that neither side can block the other.
#[derive(Debug)]
struct Drained(mpsc::Receiver<Vec<u8>>);

impl Drained {
    /// All of it, once the program has ended: something that it left behind may hold its pipe open for ever.
    fn said(self) -> Vec<u8> {
        let (until, mut said) = (Instant::now() + LEFT_BEHIND, vec![]);
        loop {
            match self.0.recv_timeout(until.saturating_duration_since(Instant::now())) {
                Ok(piece) => said.extend(piece),
                Err(mpsc::RecvTimeoutError::Disconnected) => return said,
                Err(mpsc::RecvTimeoutError::Timeout) => {
                    tracing::warn!(
                        "a program left something behind that holds its output open: what it said so far counts"
                    );
                    return said;
                }
            }
        }
    }
}

fn drain(pipe: Option<impl Read + Send + 'static>) -> Drained {
    let (sender, pieces) = mpsc::channel();
    thread::spawn(move || {
        let Some(mut pipe) = pipe else { return };
        let mut buffer = vec![0; 1 << 16];
        loop {
            match pipe.read(&mut buffer) {
                // Ends with the pipe, or when nobody listens any more.
                Ok(0) => return,
                Ok(count) if sender.send(buffer[..count].to_vec()).is_err() => return,
                Err(error) if error.kind() != std::io::ErrorKind::Interrupted => {
                    return tracing::warn!(%error, "output of a program cut short");
                }
                _ => (),
            }
        }
    });
    Drained(pieces)
}

fn kill_group(child: &Child) {
    let group = i32::try_from(child.id()).ok().and_then(rustix::process::Pid::from_raw);
    if let Some(group) = group {
        // The group is gone already in the ordinary case: that is no error.
        rustix::process::kill_process_group(group, rustix::process::Signal::KILL).ok();
    }
}

fn tail(text: &str) -> String {
    let lines: Vec<&str> = text.lines().filter(|l| !l.trim().is_empty()).collect();
    lines[lines.len().saturating_sub(8)..].join("\n")
}

fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=+,:@%".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shell(script: &str, limit_s: f64, folder: &Path) -> Result<Finished, ProcessError> {
        Invocation::new("sh", folder, Duration::from_secs_f64(limit_s), folder.join("log")).args(["-c", script]).run()
    }

    #[test]
    fn output_and_messages_are_kept_apart_and_stderr_is_logged() {
        let folder = tempfile::tempdir().unwrap();
        let done = shell("echo out; echo err >&2", 10.0, folder.path()).unwrap();
        assert_eq!(done.stdout, b"out\n");
        assert_eq!(done.stderr, "err\n");
        assert!(fs::read_to_string(folder.path().join("log")).unwrap().ends_with("err\n\n"));
    }

    #[test]
    fn a_failing_program_is_an_error_with_its_last_words() {
        let folder = tempfile::tempdir().unwrap();
        let error = shell("echo no such lamp >&2; exit 3", 10.0, folder.path()).unwrap_err();
        let text = error.to_string();
        assert!(matches!(error, ProcessError::Failed { .. }));
        assert!(text.contains("exit code 3") && text.contains("no such lamp"), "{text}");
    }

    #[test]
    fn a_timeout_kills_the_grandchildren_too() {
        let folder = tempfile::tempdir().unwrap();
        // The grandchild would write the file after 1 s if it lived.
        let script = "(sleep 1; touch survivor) & sleep 30";
        let error = shell(script, 0.2, folder.path()).unwrap_err();
        assert!(matches!(error, ProcessError::TimedOut { .. }), "{error}");
        thread::sleep(Duration::from_millis(1300));
        assert!(!folder.path().join("survivor").exists());
    }

    #[test]
    fn what_a_program_leaves_behind_does_not_hold_its_answer() {
        let folder = tempfile::tempdir().unwrap();
        let start = Instant::now();
        // A session of its own is out of the group's reach.
        let done = shell("setsid sleep 60 & echo answer", 30.0, folder.path()).unwrap();
        assert_eq!(done.stdout, b"answer\n");
        assert!(start.elapsed() < Duration::from_secs(30), "{:?}", start.elapsed());
    }

    fn conversation(script: &str, limit_s: f64, folder: &Path) -> Conversation {
        let limit = Duration::from_secs_f64(limit_s);
        Invocation::new("sh", folder, limit, folder.join("log")).args(["-c", script]).converse().unwrap()
    }

    #[test]
    fn a_conversation_answers_line_by_line_and_its_messages_are_logged() {
        let folder = tempfile::tempdir().unwrap();
        let mut echo =
            conversation("echo ready; while read x; do echo \"<$x>\"; done; echo bye >&2", 10.0, folder.path());
        assert_eq!(echo.listen().unwrap(), "ready");
        assert_eq!([echo.ask("one").unwrap(), echo.ask("two").unwrap()], ["<one>", "<two>"]);
        echo.end().unwrap();
        assert!(echo.invocation.peak.mib().is_some());
        assert!(fs::read_to_string(folder.path().join("log")).unwrap().ends_with("bye\n\n"));
    }

    #[test]
    fn a_conversation_with_no_answer_says_why() {
        let folder = tempfile::tempdir().unwrap();
        let error = |script, limit_s| conversation(script, limit_s, folder.path()).ask("?").unwrap_err();
        let failed = error("read x; echo no such lamp >&2; exit 3", 10.0).to_string();
        assert!(failed.contains("exit code 3") && failed.contains("no such lamp"), "{failed}");
        assert!(matches!(error("read x", 10.0), ProcessError::Silent { .. }));
        assert!(matches!(error("(sleep 1; touch survivor) & sleep 30", 0.2), ProcessError::TimedOut { .. }));
        thread::sleep(Duration::from_millis(1300));
        assert!(!folder.path().join("survivor").exists());
    }

    #[test]
    fn memory_and_processor_time_of_a_program_are_seen() {
        let folder = tempfile::tempdir().unwrap();
        let run = |script: &str| {
            let invocation = Invocation::new("sh", folder.path(), Duration::from_secs(20), folder.path().join("log"));
            let invocation = invocation.args(["-c", script]);
            invocation.run().unwrap();
            invocation.peak.mib().unwrap()
        };
        let before = cpu_time();
        let (small, large) = (run("sleep 0.1"), run("x=$(head -c 50000000 /dev/zero | tr '\\0' a); sleep 0.1"));
        assert!(small > 0.1 && large > small + 40.0, "{small} {large}");
        assert!(cpu_time() > before + Duration::from_millis(5));
    }

    #[test]
    fn a_program_that_is_not_there_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let run = Invocation::new("no-such-renderer", folder.path(), Duration::from_secs(1), folder.path().join("log"));
        assert!(run.run().unwrap_err().to_string().contains("no-such-renderer"));
    }

    #[test]
    fn command_lines_can_be_pasted_into_a_shell() {
        let run = Invocation::new("rtrace", Path::new("."), Duration::ZERO, "log").args(["-ab", "99", "it's.oct"]);
        assert_eq!(run.command_line(), r"rtrace -ab 99 'it'\''s.oct'");
        let run = run.env("RAYPATH", ".:/my lib");
        assert_eq!(run.command_line_with_env(), r"RAYPATH='.:/my lib' rtrace -ab 99 'it'\''s.oct'");
    }
}
