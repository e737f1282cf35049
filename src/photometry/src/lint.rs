//! Lints: remarks of a reader on what it tolerated or found doubtful in a photometric file.

use std::borrow::Cow;

/// One remark about a file. The file is read nevertheless.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Lint {
    /// Stable code, e.g. `lm63/header`.
    pub code: &'static str,
    /// The severity.
    pub severity: Severity,
    /// Line, from 1; 0 where it concerns the file as a whole.
    pub line: usize,
    /// The finding and how the reader handled it.
    pub message: String,
}

/// The severity of a lint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// A deviation from the standard that changes no number.
    Note,
    /// A hint that the numbers differ from what their author intended.
    Warning,
}

/// The tolerance of a reader.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tolerance {
    /// Accept only what the standard can be read to allow.
    #[default]
    Strict,
    /// Accept damage that affects no intensity, or that the rest of the file allows to repair.
    ///
    /// Each is a warning with a code that begins with [`FORGIVEN`].
    Harmless,
}

/// The prefix of the codes of accepted damage.
pub const FORGIVEN: &str = "forgiven/";

/// Collects lints, one for each code: it stores the first place and counts repetitions.
#[derive(Debug, Default)]
pub(crate) struct Lints {
    found: Vec<(Lint, usize)>,
    tolerance: Tolerance,
}

impl Lints {
    pub(crate) fn new(tolerance: Tolerance) -> Self {
        Self { found: vec![], tolerance }
    }

    pub(crate) fn is_tolerant(&self) -> bool {
        self.tolerance == Tolerance::Harmless
    }

    /// Accepts damage with a warning; `false` where the tolerance does not allow it.
    pub(crate) fn accept_damage(
        &mut self,
        code: &'static str,
        line: usize,
        message: impl Into<Cow<'static, str>>,
    ) -> bool {
        if self.is_tolerant() {
            self.warn(code, line, message);
        }
        self.is_tolerant()
    }

    pub(crate) fn note(&mut self, code: &'static str, line: usize, message: impl Into<Cow<'static, str>>) {
        self.add(code, Severity::Note, line, message.into());
    }

    pub(crate) fn warn(&mut self, code: &'static str, line: usize, message: impl Into<Cow<'static, str>>) {
        self.add(code, Severity::Warning, line, message.into());
    }

    /// Counts a repetition of a code; `false` where the code is new.
    pub(crate) fn count_repetition(&mut self, code: &'static str) -> bool {
        let known = self.found.iter_mut().find(|(lint, _)| lint.code == code);
        known.map(|(_, count)| *count += 1).is_some()
    }

    fn add(&mut self, code: &'static str, severity: Severity, line: usize, message: Cow<'static, str>) {
        if !self.count_repetition(code) {
            self.found.push((Lint { code, severity, line, message: message.into_owned() }, 1));
        }
    }

    /// All lints in the order of their lines, those of the whole file last.
    pub(crate) fn into_sorted(self) -> Vec<Lint> {
        let mut lints = vec![];
        for (mut lint, count) in self.found {
            if count > 1 {
                lint.message = format!("{} ({count} times)", lint.message);
            }
            lints.push(lint);
        }
        // Line 0 wraps around to the largest number.
        lints.sort_by_key(|lint| (lint.line.wrapping_sub(1), lint.code));
        lints
    }
}
