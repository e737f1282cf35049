//! Runs external programs: under a supervisor that ends all that they start, with a limit of time, memory and output, their
//! messages kept in a log file.
//!
//! The only folder that spawns processes.

mod conversation;
mod interrupt;
mod invocation;
mod memory;
mod output;
mod run;
mod running;
#[cfg(target_os = "linux")]
mod sandbox;
#[cfg(target_os = "linux")]
mod supervisor;
mod supervisor_args;
#[cfg(test)]
mod tests;
mod tree;
#[cfg(not(target_os = "linux"))]
mod unsupervised;

use std::path::PathBuf;
use std::process::ExitCode;
use std::thread;
use std::time::Duration;

pub use conversation::{Conversation, ProcessPool};
pub use interrupt::{UnderWay, interrupt, interrupt_flag, is_interrupted};
pub use invocation::{FailedEnd, Finished, Freedom, Invocation, ProcessError, quoted};
pub use memory::{PeakMemory, limit_mib};
#[cfg(target_os = "linux")]
use supervisor as system;
#[cfg(not(target_os = "linux"))]
use unsupervised as system;

/// What `main` does before all else: where this process was started to supervise another, it does so and ends; otherwise what it starts from
/// now on is supervised by processes of this same program.
pub fn supervise() -> Option<ExitCode> {
    let ended = system::supervise();
    running::supervise_from_now_on();
    ended
}

/// Has a file that would grow beyond `ulimit -f` fail to be written, which is reported with its path, in place of ending this process
/// (SIGXFSZ). Programs that are started have the system's own way again.
pub fn take_file_limit_as_error() -> std::io::Result<()> {
    // That it came is known from the call that fails.
    let seen = std::sync::Arc::default();
    signal_hook::flag::register(signal_hook::consts::SIGXFSZ, seen).map(drop)
}

/// What confines engines on this machine, in words.
pub fn sandbox_in_words() -> String {
    system::sandbox_in_words()
}

/// How many threads or processes run side by side where nobody says: one a core.
pub fn cores() -> usize {
    thread::available_parallelism().map_or(1, std::num::NonZero::get)
}

/// Processor time of this process and of all its children that have ended.
pub fn cpu_time() -> Duration {
    use nix::sys::resource::{UsageWho, getrusage};
    use nix::sys::time::TimeValLike;
    let times = [UsageWho::RUSAGE_SELF, UsageWho::RUSAGE_CHILDREN]
        .map(|who| getrusage(who).map_or(0, |usage| (usage.user_time() + usage.system_time()).num_microseconds()));
    Duration::from_micros(times.iter().sum::<i64>().unsigned_abs())
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
