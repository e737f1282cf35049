//! Text of strangers and of programs, as a terminal, a log, a page or Markdown may show it.

use std::borrow::Cow;

pub use luxproof_photometry::is_unprintable;

/// A text as a line of so many characters at most.
pub fn line(text: &str, most: usize) -> String {
    text.chars().take(most).map(|c| if is_unprintable(c) { char::REPLACEMENT_CHARACTER } else { c }).collect()
}

/// A text of several lines: what programs say may hold commands to terminals.
pub fn lines(text: &str) -> String {
    let shown = text.chars().filter_map(|c| match c {
        '\n' | '\t' => Some(c),
        '\r' => None,
        c if is_unprintable(c) => Some(char::REPLACEMENT_CHARACTER),
        c => Some(c),
    });
    shown.collect()
}

/// Whether a character of several lines does nothing but show.
fn is_plain(c: char) -> bool {
    !is_unprintable(c) || matches!(c, '\n' | '\t')
}

/// Whether a character must not stand in a JSON file as it is.
fn is_raw(c: char) -> bool {
    is_unprintable(c) && !matches!(c, '\n' | '\t' | '\r')
}

/// A text of ours as a terminal or a log gets it: its own colours and weights stay, other commands in what it quotes do not.
pub fn styled(text: &str) -> Cow<'_, str> {
    match without_log_commands(text) {
        Cow::Borrowed(text) => without_terminal_commands(text),
        Cow::Owned(text) => without_terminal_commands(&text).into_owned().into(),
    }
}

fn without_terminal_commands(text: &str) -> Cow<'_, str> {
    if text.chars().all(is_plain) {
        return text.into();
    }
    let mut shown = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(c) = rest.chars().next() {
        let length = style(rest).unwrap_or(0);
        let (part, after) = rest.split_at(length.max(c.len_utf8()));
        match c {
            _ if length > 0 || is_plain(c) => shown.push_str(part),
            // Ends of lines as elsewhere.
            '\r' if after.starts_with('\n') => {}
            _ => shown.push(char::REPLACEMENT_CHARACTER),
        }
        rest = after;
    }
    shown.into()
}

/// A text of a log without commands to the server that shows it: `::NAME::` where a line begins and `##[NAME]` (GitHub), `##vso[`
/// (Azure), `##teamcity[`. Strangers choose names of meters, cases and files, with which lines begin.
fn without_log_commands(text: &str) -> Cow<'_, str> {
    if !text.contains("::") && !text.contains("##") {
        return text.into();
    }
    let mut shown = String::with_capacity(text.len());
    for line in text.split_inclusive('\n') {
        // GitHub's runner looks behind blanks.
        let rest = line.trim_start();
        shown.push_str(&line[..line.len() - rest.len()]);
        let rest = match rest.strip_prefix("::") {
            Some(after) => {
                shown.extend([char::REPLACEMENT_CHARACTER, ':']);
                after
            }
            None => rest,
        };
        let mut before = ' ';
        for (at, c) in rest.char_indices() {
            let is_command = before == '#' && c == '#' && is_bracketed(&rest[at + 1..]);
            shown.push(if is_command { char::REPLACEMENT_CHARACTER } else { c });
            before = c;
        }
    }
    shown.into()
}

/// Whether a text begins with a word, or none, and a bracket.
fn is_bracketed(text: &str) -> bool {
    text.trim_start_matches(|c: char| c.is_ascii_alphabetic()).starts_with('[')
}

/// The length of the colour or weight that a text begins with (ECMA-48, SGR).
fn style(text: &str) -> Option<usize> {
    let sequence = text.strip_prefix("\u{1b}[")?;
    let end = sequence.find(|c: char| !c.is_ascii_digit() && c != ';')?;
    sequence[end..].starts_with('m').then_some(end + 3)
}

/// JSON whose texts hold nothing that does something: what lies in a file is shown wherever it is looked at.
pub fn json(text: &str) -> Cow<'_, str> {
    if !text.contains('\\') && !text.chars().any(is_raw) {
        return text.into();
    }
    let mut shown = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(at) = rest.find(|c: char| c == '\\' || is_raw(c)) {
        shown.push_str(&rest[..at]);
        let found = &rest[at..];
        let (escaped, length) = escape(found);
        match escaped {
            Some(c) if is_raw(c) => shown.push(char::REPLACEMENT_CHARACTER),
            _ => shown.push_str(&found[..length]),
        }
        rest = &found[length..];
    }
    shown.push_str(rest);
    shown.into()
}

/// The character that a text begins with, as it is or escaped as in JSON where that says one, and how many bytes say it.
fn escape(text: &str) -> (Option<char>, usize) {
    let mut chars = text.chars();
    let first = chars.next();
    if first != Some('\\') {
        return (first, first.map_or(0, char::len_utf8));
    }
    match chars.next() {
        Some('u') => {
            let digits = text.get(2..6).and_then(|digits| u32::from_str_radix(digits, 16).ok());
            (digits.and_then(char::from_u32), if digits.is_some() { 6 } else { 2 })
        }
        Some('b') => (Some('\u{8}'), 2),
        Some('f') => (Some('\u{c}'), 2),
        second => (None, 1 + second.map_or(0, char::len_utf8)),
    }
}

/// Text that is no markup in Markdown nor ends a cell of its tables: what people and programs wrote is shown as they wrote it.
pub fn markdown(text: &str) -> String {
    let mut shown = String::with_capacity(text.len());
    let mut before = ' ';
    let mut rest = text.trim_start().chars().peekable();
    while let Some(c) = rest.next() {
        let next = rest.peek().copied().unwrap_or(' ');
        match c {
            '&' => shown.push_str("&amp;"),
            '<' => shown.push_str("&lt;"),
            '>' => shown.push_str("&gt;"),
            '\n' | '\r' | '\t' => shown.push(' '),
            c if is_unprintable(c) => shown.push(char::REPLACEMENT_CHARACTER),
            '\\' | '`' | '*' | '|' | '~' | '$' => shown.extend(['\\', c]),
            // Between letters it is no emphasis, and names have many.
            '_' if !(before.is_alphanumeric() && next.is_alphanumeric()) => shown.push_str("\\_"),
            // What would make a link, a picture or a footnote of what stands in brackets.
            ']' if "([:".contains(next) => shown.push_str("\\]"),
            '[' if next == '^' => shown.push_str("\\["),
            // A bare address becomes a link.
            ':' if next == '/' => shown.push_str("\\:"),
            // An address without a scheme becomes a link, too, and a name behind `@` a message to that account.
            '.' if before == 'w' && shown.ends_with("www") => shown.push_str("\\."),
            '@' if !before.is_alphanumeric() && next.is_alphanumeric() => shown.push_str("@<!-- -->"),
            // A heading, a list or a box to tick, where a line begins with it.
            '#' | '[' if shown.is_empty() => shown.extend(['\\', c]),
            '+' | '-' if shown.is_empty() && rest.peek() == Some(&' ') => shown.extend(['\\', c]),
            c => shown.push(c),
        }
        before = c;
    }
    shown
}

/// What a spreadsheet takes for no formula: a text that begins like one has an apostrophe before it, and numbers stay numbers.
pub fn csv(text: String) -> String {
    let begins = text.starts_with(['=', '+', '-', '@', '\t', '\r']);
    if begins && text.parse::<f64>().is_err() { format!("'{text}") } else { text }
}

/// A block of code of Markdown, which nothing in it ends.
pub fn code_block(language: &str, text: &str) -> String {
    let longest = text.split(|c| c != '`').map(str::len).max().unwrap_or(0);
    let fence = "`".repeat(3.max(longest + 1));
    format!("{fence}{language}\n{}\n{fence}\n", lines(text).trim_end())
}

/// The signs that messages put around what they quote.
const QUOTES: [char; 3] = ['`', '"', '\''];

/// Whether a character that may be a quote is one: an apostrophe within a word is none.
fn is_quote(text: &str, at: usize) -> bool {
    let is_after_letter = text[..at].chars().next_back().is_some_and(char::is_alphanumeric);
    let is_before_letter = text[at..].chars().nth(1).is_some_and(char::is_alphanumeric);
    !(text[at..].starts_with('\'') && is_after_letter && is_before_letter)
}

/// A message without what it quotes: an ellipsis stands for all from the first quote to the last, since what is quoted may hold quotes itself.
pub fn without_quotes(text: &str) -> String {
    let quotes: Vec<usize> = text.match_indices(QUOTES).map(|(at, _)| at).filter(|at| is_quote(text, *at)).collect();
    let [first, others @ ..] = &quotes[..] else { return text.to_owned() };
    let (first, last) = (*first, others.last().copied().unwrap_or(text.len()));
    [&text[..=first], "\u{2026}", &text[last..]].concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_terminal_gets_colours_and_no_other_command() {
        for (text, shown) in [
            ("\u{1b}[1;31mred\u{1b}[0m \u{1b}[m", "\u{1b}[1;31mred\u{1b}[0m \u{1b}[m"),
            ("\u{1b}]0;x\u{7} \u{1b}[2J \u{1b}[31", "\u{fffd}]0;x\u{fffd} \u{fffd}[2J \u{fffd}[31"),
            ("a\r\nb\rc\u{9b}31m\u{202e}", "a\nb\u{fffd}c\u{fffd}31m\u{fffd}"),
        ] {
            assert_eq!(styled(text), shown);
        }
    }

    #[test]
    fn a_log_gets_no_command_to_its_server() {
        for (text, shown) in [
            ("::set-output name=a::b\n", "\u{fffd}:set-output name=a::b\n"),
            ("a\n \u{a0}::error::b ::c\n", "a\n \u{a0}\u{fffd}:error::b ::c\n"),
            ("a ##[add-mask]b ###vso[c]", "a #\u{fffd}[add-mask]b ##\u{fffd}vso[c]"),
            ("##teamcity[a]", "#\u{fffd}teamcity[a]"),
            ("## luxproof: a::b [c]\n", "## luxproof: a::b [c]\n"),
        ] {
            assert_eq!(styled(text), shown);
        }
    }

    #[test]
    fn json_keeps_its_form_and_loses_what_does_something() {
        for (text, shown) in [
            (r#"{"a":"b\\n\"c\td"}"#, r#"{"a":"b\\n\"c\td"}"#),
            (
                r#"["\u001b]0;\u0007", "\\u001b", "\b\u00e9\ud835\udd4f", "\u"]"#,
                "[\"\u{fffd}]0;\u{fffd}\", \"\\\\u001b\", \"\u{fffd}\\u00e9\\ud835\\udd4f\", \"\\u\"]",
            ),
            ("[\"\u{202e}\u{9b}31m\"]", "[\"\u{fffd}\u{fffd}31m\"]"),
        ] {
            assert_eq!(json(text), shown);
        }
    }

    #[test]
    fn markdown_shows_what_was_written_and_obeys_none_of_it() {
        for (text, shown) in [
            ("desk_a[0] at 2.5 m, -3 %", "desk_a[0] at 2.5 m, -3 %"),
            ("<img src=x> & `a`", "&lt;img src=x&gt; &amp; \\`a\\`"),
            ("![a](http://e) [b][c]", "![a\\](http\\://e) [b\\][c]"),
            ("a\\|b|c", "a\\\\\\|b\\|c"),
            ("_a_ **b** ~~c~~ $d$", "\\_a\\_ \\*\\*b\\*\\* \\~\\~c\\~\\~ \\$d\\$"),
            (" # head\n# next", "\\# head # next"),
            ("-3 %", "-3 %"),
            ("- item", "\\- item"),
            ("[x] done [^1]", "\\[x] done \\[^1]"),
            ("www.evil.example, mitsuba@3.5", "www\\.evil.example, mitsuba@3.5"),
            ("@octocat (@team)", "@<!-- -->octocat (@<!-- -->team)"),
        ] {
            assert_eq!(markdown(text), shown);
        }
        let text = "a\n````\n# b\u{1b}\n";
        assert_eq!(code_block("yaml", text), "`````yaml\na\n````\n# b\u{fffd}\n`````\n");
    }

    #[test]
    fn what_does_something_is_shown_as_what_it_is_not() {
        assert_eq!(lines("a\u{1b}]0;title\u{7}b\r\n\tc\u{202e}"), "a\u{fffd}]0;title\u{fffd}b\n\tc\u{fffd}");
        assert_eq!(line("a\nb\u{feff}cd", 4), "a\u{fffd}b\u{fffd}");
        assert_eq!(lines("Grüße, 4000 K, 𝕏"), "Grüße, 4000 K, 𝕏");
    }

    #[test]
    fn no_text_is_a_formula_and_every_number_stays_one() {
        for (text, shown) in [
            ("=HYPERLINK(1)[0]", "'=HYPERLINK(1)[0]"),
            ("@desk[0]", "'@desk[0]"),
            ("-1.5e-3", "-1.5e-3"),
            ("+12", "+12"),
            ("-a", "'-a"),
            ("desk[0]", "desk[0]"),
        ] {
            assert_eq!(csv(text.to_owned()), shown);
        }
    }
    #[test]
    fn what_a_message_quotes_is_left_out_and_the_rest_stays() {
        for (text, left) in [
            ("a number, not `SECRET=1`", "a number, not `\u{2026}`"),
            ("invalid type: string \"a \"b\" c\", expected a map", "invalid type: string \"\u{2026}\", expected a map"),
            ("unexpected close tag 'x' instead of 'y'", "unexpected close tag '\u{2026}'"),
            ("the file's line is long", "the file's line is long"),
            ("unknown field `a`, expected `b`", "unknown field `\u{2026}`"),
            ("`x` is no number: `a`SECRET`b`", "`\u{2026}`"),
            ("there is no column `a\"SECRET`, nor any other", "there is no column `\u{2026}`, nor any other"),
            ("not closed: `secret", "not closed: `\u{2026}"),
        ] {
            assert_eq!(without_quotes(text), left);
        }
    }
}
