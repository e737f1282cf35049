//! Values of a spec with one of several shapes: a number or a mapping, a word or a list.
//!
//! A value is checked inside the visitor, because only there does the parser know its place in the file.

use std::fmt;

use serde::Deserialize;
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{Error, IgnoredAny, MapAccess, SeqAccess, Unexpected, Visitor};

/// A value as it was found: a list of `L`, a mapping of the keys of `M`, or something simpler.
pub enum ShapedValue<'a, L = IgnoredAny, M = IgnoredAny> {
    Word(&'a str),
    /// A whole number from 0.
    Count(u64),
    Number(f64),
    List(L),
    Keys(M),
}

impl<L, M> ShapedValue<'_, L, M> {
    pub fn number(&self) -> Option<f64> {
        match self {
            Self::Count(n) => Some(*n as f64),
            Self::Number(x) => Some(*x),
            _ => None,
        }
    }
}

/// `None` where a value has another shape; the error says why a value of the right shape is wrong.
pub type ShapeResult<T> = Option<Result<T, String>>;

/// How a value is read, depending on its shape.
pub struct Shapes<T, L = IgnoredAny, M = IgnoredAny> {
    /// The expected shapes, as the user reads them in an error.
    pub expected: &'static str,
    pub read: fn(ShapedValue<L, M>) -> ShapeResult<T>,
}

impl<T, L, M> Shapes<T, L, M> {
    fn take<E: Error>(self, found: ShapedValue<L, M>, shape: Unexpected<'_>) -> Result<T, E> {
        (self.read)(found).ok_or_else(|| E::invalid_type(shape, &self.expected))?.map_err(E::custom)
    }
}

impl<'de, T, L: Deserialize<'de>, M: Deserialize<'de>> Visitor<'de> for Shapes<T, L, M> {
    type Value = T;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.expected)
    }

    fn visit_str<E: Error>(self, word: &str) -> Result<T, E> {
        self.take(ShapedValue::Word(word), Unexpected::Str(word))
    }

    fn visit_u64<E: Error>(self, n: u64) -> Result<T, E> {
        self.take(ShapedValue::Count(n), Unexpected::Unsigned(n))
    }

    fn visit_i64<E: Error>(self, n: i64) -> Result<T, E> {
        self.take(ShapedValue::Number(n as f64), Unexpected::Signed(n))
    }

    fn visit_f64<E: Error>(self, x: f64) -> Result<T, E> {
        self.take(ShapedValue::Number(x), Unexpected::Float(x))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<T, A::Error> {
        let list = L::deserialize(SeqAccessDeserializer::new(seq))?;
        self.take(ShapedValue::List(list), Unexpected::Seq)
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<T, A::Error> {
        let keys = M::deserialize(MapAccessDeserializer::new(map))?;
        self.take(ShapedValue::Keys(keys), Unexpected::Map)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::de::Deserializer;

    /// What was found, in words.
    #[derive(Debug, PartialEq)]
    struct Description(String);

    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Pair {
        a: u32,
    }

    impl<'de> Deserialize<'de> for Description {
        fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
            deserializer.deserialize_any(Shapes { expected: "a shape", read: describe })
        }
    }

    #[allow(clippy::needless_pass_by_value, reason = "the form of all visitors of shapes")]
    fn describe(found: ShapedValue<'_, Vec<u32>, Pair>) -> ShapeResult<Description> {
        let number = found.number();
        let text = match found {
            ShapedValue::Word("no") => return None,
            ShapedValue::Word("wrong") => return Some(Err("it is wrong".to_owned())),
            ShapedValue::Word(word) => format!("word {word}"),
            ShapedValue::Count(n) => format!("count {n}"),
            ShapedValue::Number(x) => format!("number {x}"),
            ShapedValue::List(list) => format!("list {list:?}"),
            ShapedValue::Keys(Pair { a }) => format!("keys {a}"),
        };
        Some(Ok(Description(number.map_or(text.clone(), |number| format!("{text} = {number:?}")))))
    }

    #[test]
    fn a_value_is_read_in_the_shape_that_it_has() {
        for (text, expected) in [
            ("\"x\"", "word x"),
            ("7", "count 7 = 7.0"),
            ("-7", "number -7 = -7.0"),
            ("2.5", "number 2.5 = 2.5"),
            ("[1, 2]", "list [1, 2]"),
            ("{\"a\": 3}", "keys 3"),
        ] {
            assert_eq!(serde_json::from_str::<Description>(text).unwrap(), Description(expected.to_owned()));
        }
        for (text, says) in [
            ("\"no\"", "invalid type: string \"no\", expected a shape"),
            ("\"wrong\"", "it is wrong"),
            ("true", "expected a shape"),
            ("[\"x\"]", "expected u32"),
        ] {
            let error = serde_json::from_str::<Description>(text).unwrap_err().to_string();
            assert!(error.contains(says), "{text}: {error}");
        }
    }
}
