//! Whether the user asked to stop: a signal has nowhere else to go.

use std::sync::atomic::{AtomicBool, Ordering};

/// Set when the user asked to stop (Ctrl-C); every running program is then ended.
static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// The exit code of a program that the user has ended (Ctrl-C), as of a shell.
const ENDED_BY_USER: i32 = 130;

/// Asks all running and future processes to stop; asked again, this program ends at once, and with it all that it runs. Safe to
/// call from a signal handler's thread.
pub fn interrupt() {
    if INTERRUPTED.swap(true, Ordering::SeqCst) {
        // Supervisors see their parent gone.
        std::process::exit(ENDED_BY_USER);
    }
}

/// What [`interrupt`] raises, for solvers that look at it themselves.
pub fn interrupt_flag() -> &'static AtomicBool {
    &INTERRUPTED
}

pub fn is_interrupted() -> bool {
    INTERRUPTED.load(Ordering::SeqCst)
}
