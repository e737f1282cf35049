//! The words of a Radiance scene, each with its line.

use crate::raw::Scene;
use luxproof_process::printable::Quoted;
use luxproof_spec::SpecError;

pub(super) struct Words<'a> {
    scene: &'a Scene<'a>,
    rest: &'a str,
    line: usize,
}

/// What begins.
pub(super) enum Next<'a> {
    Primitive { modifier: &'a str, line: usize },
    Command(Command<'a>),
}

/// What stands behind a `!`.
pub(super) struct Command<'a> {
    pub(super) text: &'a str,
    pub(super) line: usize,
}

const CUT_SHORT: &str = "the file seems to be cut short: copy or export it again";

impl<'a> Words<'a> {
    pub(super) fn new(scene: &'a Scene<'a>, text: &'a str) -> Self {
        Self { scene, rest: text, line: 1 }
    }

    fn take(&mut self, bytes: usize) -> &'a str {
        let (taken, rest) = self.rest.split_at(bytes);
        self.line += taken.bytes().filter(|b| *b == b'\n').count();
        self.rest = rest;
        taken
    }

    fn skip_blanks(&mut self) {
        self.take(self.rest.len() - self.rest.trim_ascii_start().len());
    }

    /// The next primitive or command; comments stand between them alone.
    pub(super) fn next(&mut self) -> Result<Option<Next<'a>>, SpecError> {
        loop {
            self.skip_blanks();
            let line = self.line;
            match self.rest.as_bytes().first() {
                None => return Ok(None),
                Some(b'#') => {
                    self.take(self.rest.find('\n').unwrap_or(self.rest.len()));
                }
                Some(b'!') => {
                    self.take(1);
                    let text = self.take(end_of_command(self.rest));
                    return Ok(Some(Next::Command(Command { text, line })));
                }
                Some(_) => return Ok(Some(Next::Primitive { modifier: self.word("a modifier")?, line })),
            }
        }
    }

    /// A word up to a blank, or what stands between quotes.
    pub(super) fn word(&mut self, what: &str) -> Result<&'a str, SpecError> {
        self.skip_blanks();
        match self.rest.chars().next() {
            None => Err(self.scene.fault(Some(self.line), format!("{what} is missing"), CUT_SHORT)),
            Some(quote @ ('"' | '\'')) => {
                let line = self.line;
                self.take(1);
                let end = self
                    .rest
                    .find(quote)
                    .ok_or_else(|| self.scene.fault(Some(line), "a quote is not closed", CUT_SHORT))?;
                let word = self.take(end);
                self.take(1);
                Ok(word)
            }
            Some(_) => Ok(self.take(self.rest.find(|c: char| c.is_ascii_whitespace()).unwrap_or(self.rest.len()))),
        }
    }

    /// Strings and integers, which no surface has, and real numbers.
    pub(super) fn arguments(&mut self) -> Result<Vec<f64>, SpecError> {
        for what in ["a string", "an integer"] {
            for _ in 0..self.count()? {
                self.word(what)?;
            }
        }
        let count = self.count()?;
        // A number takes two bytes: what is said is not believed.
        let mut numbers = Vec::with_capacity(count.min(self.rest.len() / 2));
        for _ in 0..count {
            let word = self.word("a number")?;
            let number = word.parse::<f64>().ok().filter(|number| number.is_finite());
            numbers.push(number.ok_or_else(|| self.no("a number", word))?);
        }
        Ok(numbers)
    }

    fn count(&mut self) -> Result<usize, SpecError> {
        let word = self.word("a count of arguments")?;
        word.parse().map_err(|_| self.no("a count of arguments", word))
    }

    fn no(&self, what: &str, word: &str) -> SpecError {
        let word = Quoted(word);
        let help = "a primitive is `modifier type name`, then how many strings, integers and numbers follow, each list with its count";
        self.scene.fault(Some(self.line), format!("`{word}` is not {what}"), help)
    }
}

/// Where a line ends that goes on behind a `\`.
fn end_of_command(text: &str) -> usize {
    let mut ends = text.match_indices('\n').map(|(at, _)| at);
    ends.find(|at| !text[..*at].trim_end_matches('\r').ends_with('\\')).unwrap_or(text.len())
}
