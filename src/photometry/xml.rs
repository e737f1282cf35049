//! XML of anybody's, whose cost is bounded by its length.

use std::collections::HashSet;

use roxmltree::{Document, Node, ParsingOptions};

use super::error::{Problem, ReadError};
use super::text::Text;

/// The document that a text holds.
pub(super) fn document<'d>(text: &Text, decoded: &'d str) -> Result<Document<'d>, ReadError> {
    // Every node costs the reader memory; none is shorter than `<a/>`.
    let nodes_limit = u32::try_from(decoded.len()).unwrap_or(u32::MAX).max(16);
    let options = ParsingOptions { allow_dtd: false, nodes_limit, ..ParsingOptions::default() };
    if let Some(at) = crowded(decoded) {
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

/// The most attributes of a tag, and different declarations of namespaces in a file: the reader holds each against all others. An angle
/// has two attributes.
const MAX_ATTRIBUTES: usize = 64;
const MAX_NAMESPACES: usize = 64;

/// Where a tag has too many attributes, or namespaces become too many.
fn crowded(text: &str) -> Option<usize> {
    let mut known = HashSet::new();
    let mut is_one_more = |at: usize| {
        known.insert(text[at..].split(|c: char| c.is_whitespace() || c == '>').next());
        known.len() > MAX_NAMESPACES
    };
    let namespace = text.match_indices("xmlns").map(|(at, _)| at).find(|at| is_one_more(*at));
    namespace.or_else(|| {
        let mut rest = 0;
        while let Some(start) = text[rest..].find('<').map(|at| rest + at) {
            let tag = &text[start..];
            // What is no tag has an end of its own.
            let other = [("<!--", "-->"), ("<![CDATA[", "]]>"), ("<?", "?>")]
                .into_iter()
                .find(|(begin, _)| tag.starts_with(begin));
            let (length, attributes) = match other {
                Some((_, end)) => (tag.find(end).map_or(tag.len(), |at| at + end.len()), 0),
                None => tag_of(tag),
            };
            if attributes > MAX_ATTRIBUTES {
                return Some(start);
            }
            rest = start + length;
        }
        None
    })
}

/// The length of the tag that a text begins with, and how many attributes it has: what stands in quotes is a value.
fn tag_of(text: &str) -> (usize, usize) {
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

/// Whether a node is an element of this name, whatever its namespace.
pub(super) fn is(node: Node, name: &str) -> bool {
    node.is_element() && node.tag_name().name() == name
}

pub(super) fn child<'d>(parent: Node<'d, 'd>, name: &str) -> Option<Node<'d, 'd>> {
    parent.children().find(|node| is(*node, name))
}

/// Text of a child element, trimmed; `None` where it is absent or empty.
pub(super) fn content(parent: Node, name: &str) -> Option<String> {
    let text = child(parent, name)?.text().unwrap_or_default().trim();
    (!text.is_empty()).then(|| text.to_string())
}
