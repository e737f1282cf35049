//! Where there is no supervisor: it needs Linux.

use std::process::ExitCode;

pub(super) fn supervise() -> Option<ExitCode> {
    None
}

pub(super) fn adopt() -> bool {
    false
}

pub(super) fn sandbox_in_words() -> String {
    "off: it needs Linux, from 5.13 on".to_owned()
}
