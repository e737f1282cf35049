//! Places in a tree of YAML, by paths such as `meters.ceiling.points_m[2]`.

use serde_yaml::Value;

/// A path's next key.
pub(super) fn below(path: &str, key: &str) -> String {
    if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") }
}

pub(super) fn last_key(path: &str) -> &str {
    path.rsplit('.').next().unwrap_or(path)
}

pub(super) fn parent(path: &str) -> &str {
    path.rfind(['.', '[']).map_or("", |end| &path[..end])
}

/// The steps of a path: a key, or the index of an item.
fn steps(path: &str) -> impl Iterator<Item = &str> {
    path.split(['.', '[']).map(|step| step.trim_end_matches(']')).filter(|step| !step.is_empty())
}

pub(super) fn get<'a>(value: &'a Value, path: &str) -> Option<&'a Value> {
    steps(path).try_fold(value, |value, step| match value {
        Value::Sequence(items) => items.get(step.parse::<usize>().ok()?),
        other => other.get(step),
    })
}

fn get_mut<'a>(value: &'a mut Value, path: &str) -> Option<&'a mut Value> {
    steps(path).try_fold(value, |value, step| match value {
        Value::Sequence(items) => items.get_mut(step.parse::<usize>().ok()?),
        other => other.get_mut(step),
    })
}

pub(super) fn take(value: &mut Value, path: &str) -> Option<Value> {
    get_mut(value, parent(path))?.as_mapping_mut()?.remove(last_key(path))
}

/// Puts something at a place, or takes away what is there.
pub(super) fn put(value: &mut Value, path: &str, what: Option<Value>) -> bool {
    let Some(what) = what else { return take(value, path).is_some() };
    if path.is_empty() {
        *value = what;
        return true;
    }
    let Some(whole) = get_mut(value, parent(path)) else { return false };
    match whole {
        Value::Mapping(keys) => {
            keys.insert(last_key(path).into(), what);
            true
        }
        Value::Sequence(items) => {
            let item = steps(path).last().and_then(|k| items.get_mut(k.parse::<usize>().ok()?));
            item.map(|item| *item = what).is_some()
        }
        _ => false,
    }
}
