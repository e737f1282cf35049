//! Names of untrusted origin as parts of paths and links.

use luxproof_process::digest::hexadecimal;
use sha2::{Digest, Sha256};

/// Letters of a name that a slug keeps.
const MAX_LETTERS: usize = 48;

/// Whether a character may stand in a path as it is.
fn is_plain(c: char) -> bool {
    c.is_ascii_lowercase() || c.is_ascii_digit() || matches!(c, '.' | '-' | '_')
}

/// A name as a part of a path: lower-case letters, digits, dots, hyphens and underscores.
///
/// A name with anything else gets a part of its hash, so that two names never share a folder, whatever the file system ignores.
/// No slug begins with a dot, and none is empty.
pub fn slug(name: &str) -> String {
    let has_start = name.starts_with(|c: char| c.is_ascii_alphanumeric());
    if has_start && name.len() <= MAX_LETTERS && name.chars().all(is_plain) && !name.ends_with('.') && name != "index" {
        return name.to_owned();
    }
    let kept: String =
        name.to_lowercase().chars().map(|c| if is_plain(c) { c } else { '-' }).take(MAX_LETTERS).collect();
    let kept = kept.trim_matches(['.', '-', '_']);
    let hash = hexadecimal(&Sha256::digest(name));
    format!("{}{}{}", kept, if kept.is_empty() { "x" } else { "-" }, &hash[..8])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn usual_names_stay_and_no_name_leaves_its_folder() {
        for name in ["mitsuba", "iray-2016", "3.5.2", "a_b"] {
            assert_eq!(slug(name), name);
        }
        let long = "x".repeat(500);
        for name in
            ["../../etc/passwd", "..", ".", "", "/", "a/b", "C:\\x", "index", "Ä", "<b>", "a\u{202e}b", "CON ", &long]
        {
            let slug = slug(name);
            assert!(!slug.is_empty() && !slug.starts_with('.') && slug.len() < 70, "{name}: {slug}");
            assert!(
                slug.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b"._-".contains(&b)),
                "{slug}"
            );
        }
        assert_ne!(slug("A"), slug("a"));
        assert_ne!(slug("a b"), slug("a-b"));
        assert_ne!(slug("a b"), slug("a/b"));
    }
}
