//! Releases: the part of an engine's name after the `@`.

use std::cmp::Ordering;
use std::fmt;
use std::str::FromStr;

/// A release of an engine, such as `3.5.2`: numbers and words between single dots.
///
/// Nothing else is allowed, because it becomes part of a folder's name and may come from an untrusted spec.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Release(String);

/// No release has more letters.
const MAX_LETTERS: usize = 24;

#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a release is of letters and digits with single dots between, {MAX_LETTERS} at most, such as 3.5.2")]
pub struct NoRelease;

impl Release {
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl FromStr for Release {
    type Err = NoRelease;

    fn from_str(text: &str) -> Result<Self, NoRelease> {
        let is_release = text.len() <= MAX_LETTERS && text.split('.').all(is_part);
        is_release.then(|| Self(text.to_owned())).ok_or(NoRelease)
    }
}

/// Whether a text may be a part between dots.
fn is_part(text: &str) -> bool {
    !text.is_empty() && text.bytes().all(|b| b.is_ascii_alphanumeric())
}

impl fmt::Display for Release {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(&self.0, f)
    }
}

/// A run of digits or letters. A word sorts before the end, since `1.0rc1` precedes `1.0`.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
enum Stretch<'a> {
    Word(&'a str),
    End,
    /// The number of digits and the digits without leading zeros, so that it sorts by size.
    Number(usize, &'a str),
}

/// The runs of digits and letters of a release.
fn stretches(text: &str) -> Vec<Stretch<'_>> {
    let mut all = vec![];
    for part in text.split('.') {
        let mut rest = part;
        while let Some(first) = rest.chars().next() {
            let is_digit = first.is_ascii_digit();
            let end = rest.find(|c: char| c.is_ascii_digit() != is_digit).unwrap_or(rest.len());
            let (stretch, after) = rest.split_at(end);
            let digits = stretch.trim_start_matches('0');
            all.push(if is_digit { Stretch::Number(digits.len(), digits) } else { Stretch::Word(stretch) });
            rest = after;
        }
    }
    all.push(Stretch::End);
    all
}

/// In the order of publication: 1.9 before 1.10.
impl Ord for Release {
    fn cmp(&self, other: &Self) -> Ordering {
        stretches(&self.0).cmp(&stretches(&other.0)).then_with(|| self.0.cmp(&other.0))
    }
}

impl PartialOrd for Release {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_leads_elsewhere_or_is_no_number_is_no_release() {
        for text in ["3.5.2", "6.0a", "1.0rc1", "2026", "a"] {
            assert_eq!(text.parse::<Release>().map(|r| r.to_string()), Ok(text.to_owned()));
        }
        let long = "1.".repeat(12) + "1";
        for text in ["", ".", "..", "../..", "1..2", "1.", ".1", "1/2", "1 2", "-1", "1\n", "1;ls", "$HOME", "é", &long]
        {
            assert_eq!(text.parse::<Release>(), Err(NoRelease), "{text}");
        }
    }

    #[test]
    fn releases_stand_in_the_order_in_which_they_were_made() {
        let ordered =
            ["0.5.3", "1.0a1", "1.0rc1", "1.0", "1.0.0", "1.2", "1.9.9", "1.10", "2", "10.0", "99999999999999999999"];
        let releases: Vec<Release> = ordered.iter().map(|r| r.parse().unwrap()).collect();
        assert!(releases.is_sorted(), "{releases:?}");
        let mut turned: Vec<Release> = releases.iter().rev().cloned().collect();
        turned.sort();
        assert_eq!(turned, releases);
    }

    #[test]
    fn a_release_may_have_24_letters() {
        let longest = "1".repeat(MAX_LETTERS);
        assert_eq!(longest.parse::<Release>().unwrap().as_str(), longest);
        assert_eq!((longest + "1").parse::<Release>(), Err(NoRelease));
        let [one, other] = ["1.0", "1.00"].map(|text| text.parse::<Release>().unwrap());
        // Of equal numbers the text decides.
        assert_eq!((one.cmp(&other), one.partial_cmp(&one)), (Ordering::Less, Some(Ordering::Equal)));
    }
}
