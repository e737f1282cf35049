//! All that is wrong with specs, policies and options, reported at once, so that an author can mend all of them.

use std::fmt;
use std::path::{Path, PathBuf};

use super::SpecError;

/// More are not listed for one file: an author with so many mends these first.
pub const MAX_FAULTS: usize = 50;

/// One fault or more.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Faults(Vec<SpecError>);

impl Faults {
    /// What there is to tell, each once and file by file in the order of places; `None` where that is nothing.
    pub fn of(faults: impl IntoIterator<Item = SpecError>) -> Option<Self> {
        let mut reported: Vec<SpecError> = vec![];
        for fault in faults {
            if of_file(&reported, &fault.file) < MAX_FAULTS && !reported.contains(&fault) {
                reported.push(fault);
            }
        }
        let files: Vec<PathBuf> = reported.iter().map(|fault| fault.file.clone()).collect();
        // Files stay in the order in which their first faults were found.
        reported.sort_by_key(|fault| (files.iter().position(|file| *file == fault.file), fault.line, fault.column));
        (!reported.is_empty()).then_some(Self(reported))
    }

    pub fn all(&self) -> &[SpecError] {
        &self.0
    }

    /// Whether a file may have more than are listed.
    pub fn may_be_more(&self) -> bool {
        self.0.iter().any(|fault| of_file(&self.0, &fault.file) == MAX_FAULTS)
    }

    /// For who tells one alone.
    #[must_use]
    pub fn first(mut self) -> SpecError {
        self.0.swap_remove(0)
    }
}

fn of_file(faults: &[SpecError], file: &Path) -> usize {
    faults.iter().filter(|fault| fault.file == file).count()
}

impl From<SpecError> for Faults {
    fn from(fault: SpecError) -> Self {
        Self(vec![fault])
    }
}

impl fmt::Display for Faults {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let lines: Vec<String> = self.0.iter().map(ToString::to_string).collect();
        f.write_str(&lines.join("\n"))
    }
}

impl std::error::Error for Faults {}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Source;

    #[test]
    fn of_many_faults_the_first_are_reported_and_the_search_for_places_is_bounded() {
        let lines: Vec<String> = (0..300).map(|k| format!("e{k}: {}\n", "x".repeat(10_000))).collect();
        let source = Source::new("spec.yaml".into(), lines.concat());
        let same_text = source.clone();
        let sources = [&source, &same_text].into_iter().cycle();
        let fault = |(k, source): (usize, &Source)| source.error_at(&format!("e{k}"), "strange", "");
        let all: Vec<SpecError> = sources.enumerate().take(300).map(fault).collect();
        let placed = all.iter().take_while(|fault| fault.line.is_some()).count();
        // Three times three megabytes.
        assert_eq!((placed, all.iter().filter(|fault| fault.line.is_some()).count()), (3, 3));
        assert_eq!((all[2].line, all[3].message.as_str()), (Some(3), "e3: strange"));
        let other = SpecError::of(Path::new("other.yaml"), "strange", "");
        let reported = Faults::of(all.iter().chain(&all).chain([&other]).cloned()).unwrap();
        assert!(reported.all().len() == MAX_FAULTS + 1 && reported.may_be_more() && !Faults::from(other).may_be_more());
        assert!(reported.all().contains(&all[3]) && !reported.all().contains(&all[60]));
    }
}
