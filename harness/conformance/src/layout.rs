//! JSON for people: what fits a line is one line, and so is a list of numbers.

use serde_json::Value;

/// The longest line of a value with parts.
const MAX_COLUMNS: usize = 110;

/// A value as text, a line feed at its end.
pub(crate) fn format_json(value: &Value) -> String {
    let mut text = String::new();
    push(value, 0, &mut text);
    text + "\n"
}

fn push(value: &Value, indent: usize, text: &mut String) {
    let line = value.to_string();
    let inner = "  ".repeat(indent + 1);
    match value {
        Value::Array(items) if items.iter().any(|item| item.is_object() || item.is_array()) => {
            text.push('[');
            for (k, item) in items.iter().enumerate() {
                text.push_str(if k > 0 { ",\n" } else { "\n" });
                text.push_str(&inner);
                push(item, indent + 1, text);
            }
            text.push_str(&format!("\n{}]", "  ".repeat(indent)));
        }
        Value::Object(members) if line.len() > MAX_COLUMNS || indent == 0 => {
            text.push('{');
            for (k, (name, member)) in members.iter().enumerate() {
                text.push_str(if k > 0 { ",\n" } else { "\n" });
                text.push_str(&format!("{inner}{}: ", Value::from(name.as_str())));
                push(member, indent + 1, text);
            }
            text.push_str(&format!("\n{}}}", "  ".repeat(indent)));
        }
        _ => text.push_str(&line),
    }
}
