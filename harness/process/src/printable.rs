//! Text of strangers and of programs, as a terminal, a log, a page or Markdown may show it.

use std::borrow::Cow;
use std::fmt;
use std::path::Path;

pub use luxproof_photometry::is_unprintable;

/// The most characters of a name or sentence that a message quotes.
const MAX_QUOTED_CHARS: usize = 200;

/// A text from outside within a message: one printable line of at most 200 characters.
#[derive(Clone, Copy, Debug)]
pub struct Quoted<'a>(pub &'a str);

impl fmt::Display for Quoted<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // `pad` keeps the width that a table asks for.
        f.pad(&quoted(self.0))
    }
}

/// The same as a text.
pub fn quoted(text: &str) -> String {
    cut(&line(text, usize::MAX), MAX_QUOTED_CHARS)
}

/// The same of a path: its names may be from outside.
pub fn quoted_path(path: &Path) -> String {
    quoted(&path.to_string_lossy())
}

/// At most so many characters of a text; an ellipsis ends one that is cut.
fn cut(text: &str, most: usize) -> String {
    match text.char_indices().nth(most) {
        Some((end, _)) => text[..end].to_owned() + "\u{2026}",
        None => text.to_owned(),
    }
}

/// The most characters of a line of a message, and the most lines.
const MAX_LINE_CHARS: usize = 2000;
const MAX_LINES: usize = 100;

/// The lines of a message, each of a length that a person can read.
pub fn short_lines(text: &str) -> Cow<'_, str> {
    if text.lines().all(|line| line.len() <= MAX_LINE_CHARS) {
        return text.into();
    }
    text.split('\n').map(|line| cut(line, MAX_LINE_CHARS)).collect::<Vec<_>>().join("\n").into()
}

/// A whole message: printable, and of a length that a person can read.
pub fn message(text: &str) -> String {
    let mut shown: Vec<String> =
        lines(text).split('\n').take(MAX_LINES + 1).map(|line| cut(line, MAX_LINE_CHARS)).collect();
    if shown.len() > MAX_LINES {
        shown.truncate(MAX_LINES);
        shown.push("\u{2026}".to_owned());
    }
    shown.join("\n")
}

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

/// The control sequences that a terminal gets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Styles {
    /// Nothing: the text may quote anything.
    None,
    /// Colours and weights, which luxproof set itself: what the text quotes is printable already.
    Own,
}

/// A text as a terminal or a log gets it, without commands in what it quotes.
pub fn inert(text: &str, styles: Styles) -> Cow<'_, str> {
    match without_log_commands(text) {
        Cow::Borrowed(text) => without_terminal_commands(text, styles),
        Cow::Owned(text) => without_terminal_commands(&text, styles).into_owned().into(),
    }
}

fn without_terminal_commands(text: &str, styles: Styles) -> Cow<'_, str> {
    if text.chars().all(is_plain) {
        return text.into();
    }
    let mut shown = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(c) = rest.chars().next() {
        let length = style(rest).filter(|_| styles == Styles::Own).unwrap_or(0);
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

/// Makes the texts of JSON printable: each is one line, except below the keys of longer texts.
///
/// Give it a file as a whole, or piece by piece where no piece ends within a text.
#[derive(Clone, Debug)]
pub struct JsonTexts {
    /// The keys of texts that may have several lines.
    of_lines: &'static [&'static str],
    /// Whether the last key is one of them.
    has_lines: bool,
}

impl JsonTexts {
    pub const fn new(of_lines: &'static [&'static str]) -> Self {
        Self { of_lines, has_lines: false }
    }

    /// A piece of JSON with printable texts.
    pub fn printable<'a>(&mut self, json: &'a str) -> Cow<'a, str> {
        if !json.contains('\\') && !json.chars().any(is_raw) {
            self.note_last_key(json);
            return json.into();
        }
        let mut shown = String::with_capacity(json.len());
        let mut rest = json;
        while let Some(start) = rest.find('"') {
            let text = &rest[start + 1..];
            let length = length_of_text(text);
            let (text, after) = text.split_at(length);
            push_inert(&rest[..=start], true, &mut shown);
            if is_key(after) {
                self.has_lines = self.of_lines.contains(&text);
                push_inert(text, false, &mut shown);
            } else {
                push_inert(text, self.has_lines, &mut shown);
            }
            let end = after.len().min(1);
            shown.push_str(&after[..end]);
            rest = &after[end..];
        }
        push_inert(rest, true, &mut shown);
        shown.into()
    }

    /// Remembers the last key of a piece without escapes.
    fn note_last_key(&mut self, json: &str) {
        // Every second part between quotes is a text.
        let mut parts = json.split('"').skip(1);
        while let (Some(text), Some(after)) = (parts.next(), parts.next()) {
            if after.trim_start().starts_with(':') {
                self.has_lines = self.of_lines.contains(&text);
            }
        }
    }
}

/// JSON of which every text is one printable line.
pub fn json(text: &str) -> Cow<'_, str> {
    JsonTexts::new(&[]).printable(text)
}

/// The bytes up to the quote that ends a text of JSON.
fn length_of_text(text: &str) -> usize {
    let mut is_escaped = false;
    for (at, byte) in text.bytes().enumerate() {
        if byte == b'"' && !is_escaped {
            return at;
        }
        is_escaped = byte == b'\\' && !is_escaped;
    }
    text.len()
}

/// Whether what follows a text of JSON, its quote first, makes it a key.
fn is_key(after: &str) -> bool {
    after.strip_prefix('"').is_some_and(|rest| rest.trim_start().starts_with(':'))
}

/// Appends a part of JSON with replacements for what must not be printed.
fn push_inert(part: &str, has_lines: bool, shown: &mut String) {
    let mut rest = part;
    while let Some(at) = rest.find(|c: char| c == '\\' || is_raw(c)) {
        shown.push_str(&rest[..at]);
        let found = &rest[at..];
        let (escaped, length) = escape(found);
        match escaped {
            Some('\n' | '\t' | '\r') if has_lines => shown.push_str(&found[..length]),
            Some(c) if is_unprintable(c) => shown.push(char::REPLACEMENT_CHARACTER),
            _ => shown.push_str(&found[..length]),
        }
        rest = &found[length..];
    }
    shown.push_str(rest);
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
        Some('n') => (Some('\n'), 2),
        Some('r') => (Some('\r'), 2),
        Some('t') => (Some('\t'), 2),
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
            assert_eq!(inert(text, Styles::Own), shown);
        }
        assert_eq!(inert("\u{1b}[1;31mred\u{1b}[0m", Styles::None), "\u{fffd}[1;31mred\u{fffd}[0m");
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
            assert_eq!(inert(text, Styles::None), shown);
        }
    }

    #[test]
    fn a_quoted_text_is_one_line_that_a_person_can_read() {
        assert_eq!(format!("`{}`", Quoted("a\u{1b}[31mb\r\nc")), "`a\u{fffd}[31mb\u{fffd}\u{fffd}c`");
        assert_eq!(format!("{:<4}|{:>4}", Quoted("ab"), Quoted("c")), "ab  |   c");
        let long = quoted(&"x".repeat(100_000));
        assert_eq!((long.chars().count(), long.ends_with("x\u{2026}")), (201, true));
        let whole = message(&format!("a\u{1b}[2J\n{}\n{}", "b".repeat(5000), "c\n".repeat(500)));
        assert!(whole.starts_with("a\u{fffd}[2J\nb") && whole.len() < 2500, "{whole}");
        assert_eq!(whole.lines().count(), 101);
    }

    #[test]
    fn texts_of_json_are_one_line_except_below_the_keys_of_longer_texts() {
        let mut texts = JsonTexts::new(&["failure"]);
        assert_eq!(
            texts.printable(r#"{"title":"a\nb\u000ac\td\"\n","failure":"a\n\tb\u001b","x\n":{"failure" : ["a\nb"]}}"#),
            "{\"title\":\"a\u{fffd}b\u{fffd}c\u{fffd}d\\\"\u{fffd}\",\"failure\":\"a\\n\\tb\u{fffd}\",\"x\u{fffd}\":{\"failure\" : [\"a\\nb\"]}}"
        );
        // The key stands in an earlier piece, with and without escapes in it.
        for key in ["\"failure\": [\n", "\"a\\n\": 1, \"failure\": [\n"] {
            texts.printable(key);
            assert_eq!(texts.printable("\"a\\nb\"\n"), "\"a\\nb\"\n");
            assert_eq!(texts.printable("], \"title\":\n"), "], \"title\":\n");
            assert_eq!(texts.printable("\"a\\nb\"\n"), "\"a\u{fffd}b\"\n");
        }
        // A value that looks like a key is none.
        assert_eq!(json(r#"["failure\":", "a\nb"]"#), "[\"failure\\\":\", \"a\u{fffd}b\"]");
    }

    #[test]
    fn json_keeps_its_form_and_loses_what_does_something() {
        for (text, shown) in [
            (r#"{"a":"b\\n\"c\\td"}"#, r#"{"a":"b\\n\"c\\td"}"#),
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
