//! The header of a TM-33 file: its elements and comments as keywords.

use roxmltree::Node;

use crate::text::harmless;
use crate::xml::child;

/// Header elements and the LM-63 keywords of the same meaning.
pub(super) const KEYWORDS: [(&str, &str); 6] = [
    ("Manufacturer", "MANUFAC"),
    ("CatalogNumber", "LUMCAT"),
    ("Description", "LUMINAIRE"),
    ("Laboratory", "TESTLAB"),
    ("ReportNumber", "TEST"),
    ("ReportDate", "ISSUEDATE"),
];

/// The keyword of a comment without one.
pub(super) const COMMENTS: &str = "_Comments";

/// Splits a comment, `[KEYWORD] text`, into keyword and text.
fn split_comment(comment: &str) -> (String, String) {
    let bracketed = comment.strip_prefix('[').and_then(|rest| rest.split_once(']'));
    match bracketed {
        Some((key, value)) => (key.to_string(), value.strip_prefix(' ').unwrap_or(value).to_string()),
        None => (COMMENTS.into(), comment.to_string()),
    }
}

/// An element of the header.
pub(super) struct Keyword {
    pub(super) key: String,
    pub(super) text: String,
    /// Where the element begins in the document.
    pub(super) at: usize,
}

/// Reads the header as keywords in file order.
pub(super) fn read_keywords(root: Node) -> Vec<Keyword> {
    let Some(header) = child(root, "Header") else { return vec![] };
    header.children().filter(Node::is_element).filter_map(read_keyword).collect()
}

/// The lines of ascending places of a text, from 1, in one pass over it.
pub(super) fn lines_of(text: &str, places: impl Iterator<Item = usize>) -> Vec<usize> {
    let (mut line, mut counted) = (1, 0);
    let mut lines = vec![];
    for at in places {
        line += text.get(counted..at).map_or(0, |passed| passed.matches('\n').count());
        counted = at;
        lines.push(line);
    }
    lines
}

/// Reads an element of the header as a keyword; `None` where it is empty.
fn read_keyword(node: Node) -> Option<Keyword> {
    // A character reference such as `&#13;` can put a line end inside a line.
    let value = node.text().unwrap_or_default().trim().replace('\r', " ");
    let value = harmless(&value);
    if value.is_empty() {
        return None;
    }
    let name = node.tag_name().name();
    let (key, text) = if name == "Comments" {
        split_comment(&value)
    } else {
        let keyword = KEYWORDS.iter().find(|(element, _)| *element == name).map(|(_, keyword)| (*keyword).to_string());
        (keyword.unwrap_or_else(|| format!("_{name}")), value.to_string())
    };
    Some(Keyword { key, text, at: node.range().start })
}
