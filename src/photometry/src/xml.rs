//! Parsing of untrusted XML, with a cost bounded by its length.

use std::collections::HashSet;

use roxmltree::{Document, Node, ParsingOptions};

use super::error::{Problem, ReadError};
use super::text::Text;

/// Parses the XML document of a text.
pub(super) fn parse_document<'d>(text: &Text, decoded: &'d str) -> Result<Document<'d>, ReadError> {
    // Every node costs the parser memory. The shortest node is `<a/>`.
    let nodes_limit = u32::try_from(decoded.len()).unwrap_or(u32::MAX).max(16);
    let options = ParsingOptions { allow_dtd: false, nodes_limit, ..ParsingOptions::default() };
    if let Some(at) = find_excess(decoded) {
        let message =
            format!("a tag of more than {MAX_ATTRIBUTES} attributes, or more than {MAX_NAMESPACES} namespaces");
        return Err(text.error(at, Problem::Xml { message }));
    }
    Document::parse_with_options(decoded, options).map_err(|error| {
        let position = error.pos();
        let (line, column) = (position.row as usize, position.col as usize);
        ReadError { line, column, ..text.error(0, Problem::Xml { message: error.to_string() }) }
    })
}

/// The largest number of attributes of a tag. The parser compares each with all others; an angle has two.
const MAX_ATTRIBUTES: usize = 64;
/// The largest number of different namespace declarations. The parser compares each with all others.
const MAX_NAMESPACES: usize = 64;

/// Finds the offset of a tag with too many attributes, or of a namespace declaration too many.
fn find_excess(text: &str) -> Option<usize> {
    find_excess_namespace(text).or_else(|| find_excess_attributes(text))
}

/// Finds the offset at which the number of different namespace declarations becomes too large.
fn find_excess_namespace(text: &str) -> Option<usize> {
    let mut declarations = HashSet::new();
    for (at, _) in text.match_indices("xmlns") {
        declarations.insert(text[at..].split(|c: char| c.is_whitespace() || c == '>').next());
        if declarations.len() > MAX_NAMESPACES {
            return Some(at);
        }
    }
    None
}

/// Finds the offset of a tag with too many attributes.
fn find_excess_attributes(text: &str) -> Option<usize> {
    /// Markup other than tags: its begin and its end.
    const OTHER_MARKUP: [(&str, &str); 3] = [("<!--", "-->"), ("<![CDATA[", "]]>"), ("<?", "?>")];
    let mut rest = 0;
    while let Some(start) = text[rest..].find('<').map(|at| rest + at) {
        let tag = &text[start..];
        let (length, attributes) = match OTHER_MARKUP.iter().find(|(begin, _)| tag.starts_with(begin)) {
            Some((_, end)) => (tag.find(end).map_or(tag.len(), |at| at + end.len()), 0),
            None => measure_tag(tag),
        };
        if attributes > MAX_ATTRIBUTES {
            return Some(start);
        }
        rest = start + length;
    }
    None
}

/// The length of the tag at the begin of a text and its number of attributes. An equals sign in quotes is part of a value.
fn measure_tag(text: &str) -> (usize, usize) {
    let (mut quote, mut attributes) = (None, 0);
    for (at, byte) in text.bytes().enumerate() {
        match (quote, byte) {
            (Some(open), _) if open == byte => quote = None,
            (None, b'"' | b'\'') => quote = Some(byte),
            (None, b'=') => attributes += 1,
            (None, b'>') => return (at + 1, attributes),
            _ => {}
        }
    }
    (text.len(), attributes)
}

/// Whether a node is an element of this name in any namespace.
pub(super) fn is(node: Node, name: &str) -> bool {
    node.is_element() && node.tag_name().name() == name
}

/// The first child element of this name.
pub(super) fn child<'d>(parent: Node<'d, 'd>, name: &str) -> Option<Node<'d, 'd>> {
    parent.children().find(|node| is(*node, name))
}

/// Text of a child element, trimmed; `None` where it is absent or empty.
pub(super) fn content(parent: Node, name: &str) -> Option<String> {
    let text = child(parent, name)?.text().unwrap_or_default().trim();
    (!text.is_empty()).then(|| text.to_string())
}
