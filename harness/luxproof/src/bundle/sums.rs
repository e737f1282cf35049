//! `SHA256SUMS`: a line a file, as `sha256sum` writes and checks it, sorted; no other bytes make the same list.

use std::collections::BTreeMap;

/// Files by their places in the bundle, with their hashes.
pub(super) type Sums = BTreeMap<String, String>;

const DIGITS: usize = 64;

pub(super) fn text(sums: &Sums) -> String {
    sums.iter().fold(String::new(), |text, (name, hash)| text + &format!("{hash}  {name}\n"))
}

/// What a text lists; `None` where it is not as it is written.
pub(super) fn parse(written: &str) -> Option<Sums> {
    let sums: Sums = written.lines().map(parse_line).collect::<Option<_>>()?;
    (text(&sums) == written).then_some(sums)
}

/// The name and the hash of a line.
fn parse_line(line: &str) -> Option<(String, String)> {
    let (hash, name) = line.split_once("  ")?;
    let is_hash = hash.len() == DIGITS && hash.bytes().all(|b| b.is_ascii_digit() || (b'a'..=b'f').contains(&b));
    is_hash.then(|| (name.to_owned(), hash.to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_reads_back_and_no_other_bytes_make_it() {
        let sums = Sums::from([("a b".to_owned(), "0".repeat(DIGITS)), ("c/d".to_owned(), "f".repeat(DIGITS))]);
        let written = text(&sums);
        assert_eq!(parse(&written), Some(sums));
        for other in [
            written.replace('f', "F"),
            written.replace("  ", " "),
            written.trim_end().to_owned(),
            written.clone() + &written,
            written.lines().rev().fold(String::new(), |text, line| text + line + "\n"),
            format!("{written}\n"),
            written.replace('\n', "\r\n"),
        ] {
            assert_eq!(parse(&other), None, "{other}");
        }
    }
}
