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
