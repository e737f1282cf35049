//! Values that a spec writes in one of several shapes: a number or a mapping, a word or a list.
//!
//! What is found is checked inside the visitor: only there does the parser still know the place.

use std::fmt;

use serde::Deserialize;
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{Error, IgnoredAny, MapAccess, SeqAccess, Unexpected, Visitor};

/// What stands where a value is read: a list of `L`, a mapping of the keys of `M`, or something simpler.
pub(crate) enum Found<'a, L = IgnoredAny, M = IgnoredAny> {
    Word(&'a str),
    /// A whole number from 0.
    Count(u64),
    Number(f64),
    List(L),
    Keys(M),
}

impl<L, M> Found<'_, L, M> {
    pub(crate) fn number(&self) -> Option<f64> {
        match self {
            Self::Count(n) => Some(*n as f64),
            Self::Number(x) => Some(*x),
            _ => None,
        }
    }
}

/// `None` where a value has no such shape; the error says why it is none of that shape.
pub(crate) type Read<T> = Option<Result<T, String>>;

/// How a value is read by the shape of what is found.
pub(crate) struct Shapes<T, L = IgnoredAny, M = IgnoredAny> {
    /// As the user is told what should have stood there.
    pub(crate) expected: &'static str,
    pub(crate) read: fn(Found<L, M>) -> Read<T>,
}

impl<T, L, M> Shapes<T, L, M> {
    fn take<E: Error>(self, found: Found<L, M>, shape: Unexpected<'_>) -> Result<T, E> {
        (self.read)(found).ok_or_else(|| E::invalid_type(shape, &self.expected))?.map_err(E::custom)
    }
}

impl<'de, T, L: Deserialize<'de>, M: Deserialize<'de>> Visitor<'de> for Shapes<T, L, M> {
    type Value = T;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.expected)
    }

    fn visit_str<E: Error>(self, word: &str) -> Result<T, E> {
        self.take(Found::Word(word), Unexpected::Str(word))
    }

    fn visit_u64<E: Error>(self, n: u64) -> Result<T, E> {
        self.take(Found::Count(n), Unexpected::Unsigned(n))
    }

    fn visit_i64<E: Error>(self, n: i64) -> Result<T, E> {
        self.take(Found::Number(n as f64), Unexpected::Signed(n))
    }

    fn visit_f64<E: Error>(self, x: f64) -> Result<T, E> {
        self.take(Found::Number(x), Unexpected::Float(x))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<T, A::Error> {
        let list = L::deserialize(SeqAccessDeserializer::new(seq))?;
        self.take(Found::List(list), Unexpected::Seq)
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<T, A::Error> {
        let keys = M::deserialize(MapAccessDeserializer::new(map))?;
        self.take(Found::Keys(keys), Unexpected::Map)
    }
}
