//! What people wrote, as a comment of a scene: one line that no format takes for anything else.

use std::fmt;

use luxproof_process::printable::is_unprintable;

/// A text as it may stand in a comment of any engine's scene, of a script, or of XML.
///
/// It stays on its line, since what begins a line of a Radiance scene may be a command, and ends no comment of XML.
#[derive(Clone, Copy, Debug)]
pub(super) struct Comment<'a>(pub(super) &'a str);

impl fmt::Display for Comment<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut before = ' ';
        for c in self.0.chars() {
            match c {
                c if is_unprintable(c) => write!(f, " ")?,
                // Two hyphens end a comment of XML, a backslash at the end of a line joins it to the next.
                '-' if before == '-' => write!(f, " -")?,
                '\\' => write!(f, "/")?,
                _ => write!(f, "{c}")?,
            }
            before = c;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_comment_is_one_line_and_ends_nothing() {
        for (text, shown) in [
            ("desk lamp, 4000 K", "desk lamp, 4000 K"),
            ("a\n!id -un > pwned\n#", "a !id -un > pwned #"),
            ("a\r\n\u{2028}\u{85}b\0", "a    b "),
            ("-->----", "- ->- - - -"),
            ("joined \\", "joined /"),
        ] {
            assert_eq!(Comment(text).to_string(), shown);
        }
    }
}
