//! Where keys belong, read off the schema: what stands at the wrong depth is answered with the right one.

use schemars::JsonSchema;
use serde_json::Value;

use super::place::below;

/// Types lie in one another less deep than this.
const MAX_DEPTH: usize = 8;

/// The places in a `T` that have a key of this name: `room`, the empty path for the whole, `luminaires[]` for any item of a list,
/// `meters.*` for any name.
pub(super) fn homes<T: JsonSchema>(key: &str) -> Vec<String> {
    let schema = schemars::schema_for!(T).to_value();
    let mut found = vec![];
    search(&schema, &schema, key, "", MAX_DEPTH, &mut found);
    found.sort();
    found.dedup();
    found
}

fn search(root: &Value, schema: &Value, key: &str, path: &str, depth: usize, found: &mut Vec<String>) {
    let Some(depth) = depth.checked_sub(1) else { return };
    if let Some(definition) = schema["$ref"].as_str().and_then(|r| root.pointer(r.trim_start_matches('#'))) {
        search(root, definition, key, path, depth, found);
    }
    for branch in ["anyOf", "oneOf", "allOf"].iter().filter_map(|b| schema[*b].as_array()).flatten() {
        search(root, branch, key, path, depth, found);
    }
    for (name, inner) in schema["properties"].as_object().into_iter().flatten() {
        if name == key {
            found.push(path.to_owned());
        }
        search(root, inner, key, &below(path, name), depth, found);
    }
    if schema["items"].is_object() {
        search(root, &schema["items"], key, &format!("{path}[]"), depth, found);
    }
    if schema["additionalProperties"].is_object() {
        search(root, &schema["additionalProperties"], key, &below(path, "*"), depth, found);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Spec;

    #[test]
    fn the_schema_tells_where_keys_belong() {
        for (key, home) in [
            ("reflectance", "room"),
            ("luminaires", ""),
            ("at_m", "luminaires[]"),
            ("counts", "meters.*.grid"),
            ("walls", "room.reflectance"),
        ] {
            assert!(homes::<Spec>(key).contains(&home.to_owned()), "{key}: {:?}", homes::<Spec>(key));
        }
        assert!(homes::<Spec>("nonsense").is_empty());
    }
}
