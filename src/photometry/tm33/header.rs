//! The header: its elements and comments as keywords.

use roxmltree::Node;

use crate::photometry::text::harmless;
use crate::photometry::xml::child;

/// Header elements and the LM-63 keywords that say the same.
pub(super) const KEYWORDS: [(&str, &str); 6] = [
    ("Manufacturer", "MANUFAC"),
    ("CatalogNumber", "LUMCAT"),
    ("Description", "LUMINAIRE"),
    ("Laboratory", "TESTLAB"),
    ("ReportNumber", "TEST"),
    ("ReportDate", "ISSUEDATE"),
];

/// The keyword of a comment that names none.
pub(super) const COMMENTS: &str = "_Comments";

/// The keyword and text of a comment as this writer has it.
fn keyword_of(comment: &str) -> (String, String) {
    let bracketed = comment.strip_prefix('[').and_then(|rest| rest.split_once(']'));
    match bracketed {
        Some((key, value)) => (key.to_string(), value.strip_prefix(' ').unwrap_or(value).to_string()),
        None => (COMMENTS.into(), comment.to_string()),
    }
}

/// The header's texts in file order.
pub(super) fn keywords(root: Node) -> Vec<(String, String)> {
    let Some(header) = child(root, "Header") else { return vec![] };
    let keyword = |node: Node| {
        // A reference such as `&#13;` says what no line of a file can.
        let value = node.text().unwrap_or_default().trim().replace('\r', " ");
        let value = harmless(&value);
        let name = node.tag_name().name();
        if name == "Comments" && !value.is_empty() {
            return Some(keyword_of(&value));
        }
        let known = KEYWORDS.iter().find(|(element, _)| *element == name).map(|(_, key)| (*key).to_string());
        (!value.is_empty()).then(|| (known.unwrap_or_else(|| format!("_{name}")), value.to_string()))
    };
    header.children().filter(Node::is_element).filter_map(keyword).collect()
}
