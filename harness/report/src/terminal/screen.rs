//! The screen that a report is printed on, and tables that fit it.

use std::ops::Range;

use comfy_table::{Attribute, Cell as TableCell, CellAlignment, ContentArrangement, Row, Table, presets};
use unicode_width::UnicodeWidthStr as _;

use crate::words::{abridged, cut, wrapped};

/// The narrowest and the widest layout, in letters.
const WIDTHS: std::ops::RangeInclusive<usize> = 80..=200;
/// Letters to a line where the width is unknown, as in a log.
const DEFAULT_WIDTH: usize = 160;
/// Letters outside ASCII that views use, with their replacements.
const REPLACEMENTS: [(char, &str); 10] = [
    ('±', "+-"),
    ('≤', "<="),
    ('×', "x"),
    ('·', "-"),
    ('…', "..."),
    ('−', "-"),
    ('°', " deg"),
    ('²', "2"),
    ('γ', "gamma"),
    ('→', "->"),
];

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Style {
    Plain,
    Colour,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Detail {
    /// One screen: verdicts, values, what is undecided or failed, the files and the exit code.
    Brief,
    /// Every table and note.
    All,
}

/// The letters that the terminal shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Letters {
    Unicode,
    Ascii,
}

/// The screen that a report is printed on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Screen {
    pub style: Style,
    pub detail: Detail,
    pub letters: Letters,
    /// Letters to a line.
    width: usize,
}

impl Screen {
    /// A screen of about so many letters to a line.
    pub fn new(style: Style, detail: Detail, letters: Letters, width: Option<usize>) -> Self {
        let width = width.unwrap_or(DEFAULT_WIDTH).clamp(*WIDTHS.start(), *WIDTHS.end());
        Self { style, detail, letters, width }
    }

    pub(super) fn width(self) -> usize {
        self.width
    }

    pub(super) fn is_full(self) -> bool {
        self.detail == Detail::All
    }

    /// Fits a line below a heading: cut at the screen's edge in a brief report, wrapped otherwise.
    pub(super) fn shorten(self, line: &str) -> String {
        // Headings indent the lines below them by two letters.
        if self.is_full() { self.indent(line) } else { cut(line, self.width - 2) }
    }

    /// Wraps a line below a heading.
    pub(super) fn indent(self, line: &str) -> String {
        wrapped(line, self.width - 2, "    ")
    }

    /// Shortens a name so that the rest of the line has room.
    pub(super) fn abridge_name(self, name: &str) -> String {
        abridged(name, self.width / 3)
    }

    /// Wraps a line at the screen's edge.
    pub(super) fn wrap(self, line: &str) -> String {
        wrapped(line, self.width, "  ")
    }

    /// Whether every line of a text fits the screen.
    pub(super) fn has_room_for(self, text: &str) -> bool {
        text.lines().all(|line| line.width() <= self.width)
    }

    /// Draws a table with a column for each engine; columns without room go into a further table below.
    pub(super) fn draw_in_blocks(self, engines: usize, draw: impl Fn(Range<usize>, Style) -> String) -> String {
        let (mut blocks, mut from) = (vec![], 0);
        while from < engines || blocks.is_empty() {
            let to = (from + 1..=engines)
                .rev()
                .find(|to| self.has_room_for(&draw(from..*to, Style::Plain)))
                .unwrap_or((from + 1).min(engines));
            blocks.push(draw(from..to, self.style));
            from = to.max(from + 1);
        }
        blocks.join("\n\n")
    }

    /// Replaces letters that the terminal does not show.
    pub(super) fn spell(self, text: &str) -> String {
        if self.letters == Letters::Unicode {
            return text.to_owned();
        }
        let mut spelled = text.to_owned();
        for (letter, replacement) in REPLACEMENTS {
            spelled = spelled.replace(letter, replacement);
        }
        spelled
    }
}

/// Draws a table without lines, with the columns of `right` aligned right.
///
/// The caller decides about colours; they are not guessed from the stream.
pub(crate) fn draw_table<R: Into<Row>>(
    head: impl IntoIterator<Item = impl ToString>,
    rows: impl IntoIterator<Item = R>,
    right: Range<usize>,
    style: Style,
) -> String {
    let mut table = Table::new();
    table.load_style(presets::NOTHING).set_content_arrangement(ContentArrangement::Disabled);
    table.set_header(head.into_iter().map(|word| TableCell::new(word).add_attribute(Attribute::Bold)));
    table.add_rows(rows);
    for (_, column) in table.column_iter_mut().enumerate().filter(|(k, _)| right.contains(k)) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    match style {
        Style::Plain => table.force_no_tty(),
        Style::Colour => table.enforce_styling(),
    };
    table.to_string().lines().map(str::trim_end).collect::<Vec<_>>().join("\n")
}
