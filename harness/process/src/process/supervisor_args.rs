//! The arguments of a supervisor, as its command line.

use std::ffi::{OsStr, OsString};
use std::os::unix::ffi::{OsStrExt, OsStringExt};
use std::path::PathBuf;

use clap::Parser;

/// The argument that makes this program a supervisor.
pub(super) const SUPERVISE: &str = "__supervise";
/// The exit code of a supervisor that failed itself, as of `env` and `timeout`; why is the last line of its messages.
pub(super) const FAILED: u8 = 125;

/// The arguments of a supervisor.
#[derive(Clone, Debug, PartialEq, Parser)]
#[command(name = SUPERVISE)]
pub(super) struct SupervisorArgs {
    /// Who starts it.
    #[arg(long)]
    pub(super) parent: u32,
    /// The program gets a temporary folder of its own, and writes below that and these alone.
    #[arg(long)]
    pub(super) confined: bool,
    #[arg(long)]
    pub(super) writable: Vec<PathBuf>,
    /// The program reads no file below these folders,
    #[arg(long)]
    pub(super) hidden: Vec<PathBuf>,
    /// except those below these.
    #[arg(long)]
    pub(super) visible: Vec<PathBuf>,
    /// Variables of the program alone, `KEY=VALUE`: one such as `LD_PRELOAD` must not change the supervisor.
    #[arg(long)]
    pub(super) set: Vec<OsString>,
    #[arg(last = true, required = true)]
    pub(super) command: Vec<OsString>,
}

/// An option with its value, as one argument.
fn option(name: &str, value: &OsStr) -> OsString {
    OsString::from_vec([name.as_bytes(), b"=", value.as_bytes()].concat())
}

impl SupervisorArgs {
    /// The arguments that tell it.
    pub(super) fn words(&self) -> Vec<OsString> {
        let mut words = vec![SUPERVISE.into(), option("--parent", self.parent.to_string().as_ref())];
        words.extend(self.confined.then(|| "--confined".into()));
        words.extend(self.writable.iter().map(|folder| option("--writable", folder.as_os_str())));
        words.extend(self.hidden.iter().map(|folder| option("--hidden", folder.as_os_str())));
        words.extend(self.visible.iter().map(|folder| option("--visible", folder.as_os_str())));
        words.extend(self.set.iter().map(|variable| option("--set", variable)));
        words.push("--".into());
        words.extend(self.command.iter().cloned());
        words
    }
}

/// What a variable is called, and what it says.
pub(super) fn variable_of(word: &OsStr) -> Option<(OsString, OsString)> {
    let (key, value) = word.as_bytes().split_at(word.as_bytes().iter().position(|b| *b == b'=')?);
    Some((OsString::from_vec(key.to_vec()), OsString::from_vec(value[1..].to_vec())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn supervisor_arguments_survive_a_round_trip() {
        let charge = SupervisorArgs {
            parent: 12,
            confined: true,
            writable: vec!["/a b".into(), "--c".into()],
            hidden: vec!["/out".into()],
            visible: vec!["/out/scenes".into(), "d".into()],
            set: vec!["A=--b".into(), OsString::from_vec(b"B=\xff=x".to_vec()), "C=".into()],
            command: vec!["sh".into(), "-c".into(), "--set=x -- y".into(), "--".into()],
        };
        assert_eq!(SupervisorArgs::parse_from(charge.words()), charge);
        assert_eq!(variable_of("A=b=c".as_ref()), Some(("A".into(), "b=c".into())));
    }
}
