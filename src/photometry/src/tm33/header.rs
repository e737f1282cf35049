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

/// Reads the header as keywords in file order.
pub(super) fn read_keywords(root: Node) -> Vec<(String, String)> {
    let Some(header) = child(root, "Header") else { return vec![] };
    header.children().filter(Node::is_element).filter_map(read_keyword).collect()
}

/// Reads an element of the header as a keyword; `None` where it is empty.
fn read_keyword(node: Node) -> Option<(String, String)> {
    // A character reference such as `&#13;` can put a line end inside a line.
    let value = node.text().unwrap_or_default().trim().replace('\r', " ");
    let value = harmless(&value);
    if value.is_empty() {
        return None;
    }
    let name = node.tag_name().name();
    if name == "Comments" {
        return Some(split_comment(&value));
    }
    let keyword = KEYWORDS.iter().find(|(element, _)| *element == name).map(|(_, keyword)| (*keyword).to_string());
    Some((keyword.unwrap_or_else(|| format!("_{name}")), value.to_string()))
}
