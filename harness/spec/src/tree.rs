//! A YAML text as a tree, whatever it is meant to be; keys that stand twice are noted, the first of them counts.

use std::collections::HashSet;
use std::fmt;

use serde::de::{DeserializeSeed, Deserializer, Error, MapAccess, SeqAccess, Visitor};
use serde_yaml::{Mapping, Value};

use super::place::below;

pub(super) struct Tree {
    pub(super) value: Value,
    /// The paths of keys that stand there once more.
    pub(super) twice: Vec<String>,
}

pub(super) fn tree(text: &str) -> Result<Tree, serde_yaml::Error> {
    let mut twice = vec![];
    let value = Node { at: String::new(), twice: &mut twice }.deserialize(serde_yaml::Deserializer::from_str(text))?;
    Ok(Tree { value, twice })
}

struct Node<'a> {
    at: String,
    twice: &'a mut Vec<String>,
}

impl<'de> DeserializeSeed<'de> for Node<'_> {
    type Value = Value;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Value, D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Node<'_> {
    type Value = Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("YAML without tags")
    }

    fn visit_bool<E: Error>(self, value: bool) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_u64<E: Error>(self, value: u64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_str<E: Error>(self, value: &str) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_unit<E: Error>(self) -> Result<Value, E> {
        Ok(Value::Null)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Value, A::Error> {
        let mut items = vec![];
        while let Some(item) =
            seq.next_element_seed(Node { at: format!("{}[{}]", self.at, items.len()), twice: &mut *self.twice })?
        {
            items.push(item);
        }
        Ok(Value::Sequence(items))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Value, A::Error> {
        let (mut mapping, mut known) = (Mapping::new(), HashSet::new());
        while let Some(key) = map.next_key::<Value>()? {
            let name = match &key {
                Value::String(name) => name.clone(),
                other => serde_yaml::to_string(other).unwrap_or_default().trim_end().to_owned(),
            };
            let at = below(&self.at, &name);
            let value = map.next_value_seed(Node { at: at.clone(), twice: &mut *self.twice })?;
            if known.insert(name) {
                mapping.insert(key, value);
            } else {
                self.twice.push(at);
            }
        }
        Ok(Value::Mapping(mapping))
    }
}
