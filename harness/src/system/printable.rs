//! Text of strangers and of programs, as a terminal, a log or a page may show it.

/// Whether a character shows nothing and does something: controls, and what breaks lines or turns their direction.
pub(crate) fn is_unprintable(c: char) -> bool {
    let breaks_or_turns = matches!(c, '\u{2028}' | '\u{2029}' | '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    c.is_control() || breaks_or_turns || c == '\u{feff}'
}

/// A text as a line of so many characters at most.
pub(crate) fn line(text: &str, most: usize) -> String {
    text.chars().take(most).map(|c| if is_unprintable(c) { char::REPLACEMENT_CHARACTER } else { c }).collect()
}

/// A text of several lines: what programs say may hold commands to terminals.
pub(crate) fn lines(text: &str) -> String {
    let shown = |c: char| match c {
        '\n' | '\t' => Some(c),
        '\r' => None,
        c if is_unprintable(c) => Some(char::REPLACEMENT_CHARACTER),
        c => Some(c),
    };
    text.chars().filter_map(shown).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_something_is_shown_as_what_it_is_not() {
        assert_eq!(lines("a\u{1b}]0;title\u{7}b\r\n\tc\u{202e}"), "a\u{fffd}]0;title\u{fffd}b\n\tc\u{fffd}");
        assert_eq!(line("a\nb\u{feff}cd", 4), "a\u{fffd}b\u{fffd}");
        assert_eq!(lines("Grüße, 4000 K, 𝕏"), "Grüße, 4000 K, 𝕏");
    }
}
