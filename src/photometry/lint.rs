//! Lints: what a reader tolerated in a photometric file, or found doubtful in it.

use std::borrow::Cow;

/// One remark about a file that was read nevertheless.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Lint {
    /// Stable code, e.g. `lm63/header`.
    pub code: &'static str,
    /// How much it matters.
    pub severity: Severity,
    /// Line, from 1; 0 where it concerns the file as a whole.
    pub line: usize,
    /// What was found and what was made of it.
    pub message: String,
}

/// How much a lint matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// A departure from the letter of the standard that changes no number.
    Note,
    /// Something that may mean that the numbers are not what their author meant.
    Warning,
}

/// What a reader lets pass.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tolerance {
    /// What its standard can be read to allow.
    #[default]
    Strict,
    /// Damage, too, that no intensity depends on or that the rest of the file tells how to mend. Each is a warning whose code
    /// begins with [`FORGIVEN`].
    Harmless,
}

/// How codes of lints begin that say what was forgiven.
pub const FORGIVEN: &str = "forgiven/";

/// Collects lints, one a code: the first place is kept, repetitions are counted.
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

    /// Says that damage was forgiven; `false` where it may not be.
    pub(crate) fn forgives(&mut self, code: &'static str, line: usize, message: impl Into<Cow<'static, str>>) -> bool {
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

    /// Counts one more of a code that is there already; `false` where it is new.
    pub(crate) fn again(&mut self, code: &'static str) -> bool {
        let known = self.found.iter_mut().find(|(lint, _)| lint.code == code);
        known.map(|(_, count)| *count += 1).is_some()
    }

    fn add(&mut self, code: &'static str, severity: Severity, line: usize, message: Cow<'static, str>) {
        if !self.again(code) {
            self.found.push((Lint { code, severity, line, message: message.into_owned() }, 1));
        }
    }

    /// All of them in the order of their lines, those of the whole file last.
    pub(crate) fn into_sorted(self) -> Vec<Lint> {
        let repeated = |(mut lint, count): (Lint, usize)| {
            if count > 1 {
                lint.message = format!("{} ({count} times)", lint.message);
            }
            lint
        };
        let mut lints: Vec<Lint> = self.found.into_iter().map(repeated).collect();
        lints.sort_by_key(|lint| (lint.line.wrapping_sub(1), lint.code));
        lints
    }
}
