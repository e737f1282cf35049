//! JSON for files too long to be read from end to end: an item of a list a line, so that a report of 1e5 meters is half as long.

use std::io::{self, Write};

use serde_json::ser::{CompactFormatter, Formatter, PrettyFormatter};

/// Levels that are laid out as for people: the document, and what it is made of.
const LAID_OUT: usize = 2;

/// Pretty down to the items of lists, which are a line each.
pub(super) struct Rows {
    pretty: PrettyFormatter<'static>,
    depth: usize,
}

impl Rows {
    pub(super) fn new() -> Self {
        Self { pretty: PrettyFormatter::new(), depth: 0 }
    }

    fn is_laid_out(&self) -> bool {
        self.depth <= LAID_OUT
    }
}

/// Opens a level, or closes one, by the layout that holds on it.
macro_rules! levels {
    ($($open:ident $close:ident),*) => {$(
        fn $open<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
            self.depth += 1;
            if self.is_laid_out() { self.pretty.$open(writer) } else { CompactFormatter.$open(writer) }
        }

        fn $close<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
            let is_laid_out = self.is_laid_out();
            self.depth -= 1;
            if is_laid_out { self.pretty.$close(writer) } else { CompactFormatter.$close(writer) }
        }
    )*};
}

impl Formatter for Rows {
    levels!(begin_array end_array, begin_object end_object);

    fn begin_array_value<W: ?Sized + Write>(&mut self, writer: &mut W, first: bool) -> io::Result<()> {
        if self.is_laid_out() {
            self.pretty.begin_array_value(writer, first)
        } else {
            CompactFormatter.begin_array_value(writer, first)
        }
    }

    fn end_array_value<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        if self.is_laid_out() { self.pretty.end_array_value(writer) } else { Ok(()) }
    }

    fn begin_object_key<W: ?Sized + Write>(&mut self, writer: &mut W, first: bool) -> io::Result<()> {
        if self.is_laid_out() {
            self.pretty.begin_object_key(writer, first)
        } else {
            CompactFormatter.begin_object_key(writer, first)
        }
    }

    fn begin_object_value<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        if self.is_laid_out() {
            self.pretty.begin_object_value(writer)
        } else {
            CompactFormatter.begin_object_value(writer)
        }
    }

    fn end_object_value<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        if self.is_laid_out() { self.pretty.end_object_value(writer) } else { Ok(()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Serialize;

    #[test]
    fn the_items_of_lists_are_a_line_each_and_say_the_same() {
        let value = serde_json::json!({"a": [{"x": [1, 2], "y": {}}, {"x": []}], "b": {"c": {"d": 1}}, "e": []});
        let mut text = vec![];
        value.serialize(&mut serde_json::Serializer::with_formatter(&mut text, Rows::new())).unwrap();
        assert_eq!(serde_json::from_slice::<serde_json::Value>(&text).unwrap(), value);
        let lines = [
            "{",
            "  \"a\": [",
            "    {\"x\":[1,2],\"y\":{}},",
            "    {\"x\":[]}",
            "  ],",
            "  \"b\": {",
            "    \"c\": {\"d\":1}",
            "  },",
            "  \"e\": []",
            "}",
        ];
        assert_eq!(String::from_utf8(text).unwrap().lines().collect::<Vec<_>>(), lines);
    }
}
