//! All that is wrong with specs, policies and options, told at once: who mends one fault wants to know of the next.

use std::fmt;
use std::path::{Path, PathBuf};

use super::SpecError;

/// More are not told of one file: whoever has made so many mends these first.
pub(crate) const MAX_FAULTS: usize = 50;

/// One fault or more.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Faults(Vec<SpecError>);

impl Faults {
    /// What there is to tell, each once and file by file in the order of places; `None` where that is nothing.
    pub fn of(faults: impl IntoIterator<Item = SpecError>) -> Option<Self> {
        let mut told: Vec<SpecError> = vec![];
        for fault in faults {
            if of_file(&told, &fault.file) < MAX_FAULTS && !told.contains(&fault) {
                told.push(fault);
            }
        }
        let files: Vec<PathBuf> = told.iter().map(|fault| fault.file.clone()).collect();
        let file = |fault: &SpecError| files.iter().position(|file| *file == fault.file);
        told.sort_by_key(|fault| (file(fault), fault.line, fault.column));
        (!told.is_empty()).then_some(Self(told))
    }

    pub fn all(&self) -> &[SpecError] {
        &self.0
    }

    /// Whether a file may have more than is told of it.
    pub(crate) fn may_be_more(&self) -> bool {
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
    use crate::spec::Source;

    #[test]
    fn of_many_faults_the_first_are_told_and_their_places_looked_for_in_so_much_text() {
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
        let told = Faults::of(all.iter().chain(&all).chain([&other]).cloned()).unwrap();
        assert!(told.all().len() == MAX_FAULTS + 1 && told.may_be_more() && !Faults::from(other).may_be_more());
        assert!(told.all().contains(&all[3]) && !told.all().contains(&all[60]));
    }
}
