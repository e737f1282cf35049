//! Whether the user asked to stop: a signal has nowhere else to go.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Set when the user asked to stop (Ctrl-C); every running program is then ended.
static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// How much is under way that ends in order.
static UNDER_WAY: AtomicUsize = AtomicUsize::new(0);

/// The exit code of a program that the user has ended (Ctrl-C), as of a shell.
const ENDED_BY_USER: i32 = 130;

/// What looks at [`interrupt_flag`] and ends in order, as long as this lives: readings that are taken, steps of an installation. While
/// there is none, as when specs are read and planned or views are drawn, a wish to stop ends this program at once: nothing is lost.
#[derive(Debug)]
pub struct UnderWay(());

impl UnderWay {
    #[must_use]
    pub fn begin() -> Self {
        UNDER_WAY.fetch_add(1, Ordering::SeqCst);
        Self(())
    }
}

impl Drop for UnderWay {
    fn drop(&mut self) {
        UNDER_WAY.fetch_sub(1, Ordering::SeqCst);
    }
}

/// Asks all running and future processes to stop; asked again, or where nothing is under way, this program ends at once, and with it
/// all that it runs. Safe to call from a signal handler's thread.
pub fn interrupt() {
    if INTERRUPTED.swap(true, Ordering::SeqCst) || UNDER_WAY.load(Ordering::SeqCst) == 0 {
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
