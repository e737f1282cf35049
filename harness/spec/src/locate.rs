//! Finds line and column of a place in a YAML text by walking to it and failing there: the parser knows where it is.

use std::fmt;

use serde::de::{DeserializeSeed, Deserializer, Error, IgnoredAny, MapAccess, SeqAccess, Visitor};

/// What of a place is pointed at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlacePart {
    Value,
    /// The key before it.
    Key,
    /// The same key where it stands once more.
    SecondKey,
}

/// Line and column (from 1) of a path such as `meters.ceiling.points_m[2]`, or of its longest part that exists.
pub(super) fn locate(text: &str, path: &str, spot: PlacePart) -> Option<(usize, usize)> {
    let steps = steps(path);
    (0..=steps.len()).rev().find_map(|n| {
        let deserializer = serde_yaml::Deserializer::from_str(text);
        let spot = if n == steps.len() { spot } else { PlacePart::Value };
        let error = Walk(&steps[..n], spot).deserialize(deserializer).err()?;
        let location = error.location().filter(|_| error.to_string().contains(MARK))?;
        Some((location.line(), location.column()))
    })
}

const MARK: &str = "luxproof-was-here";

/// Keys and indices of a path, one after the other.
fn steps(path: &str) -> Vec<&str> {
    path.split(['.', '[']).map(|step| step.trim_end_matches(']')).filter(|step| !step.is_empty()).collect()
}

struct Walk<'a>(&'a [&'a str], PlacePart);

/// A key of a mapping; that which is looked for fails, and tells its place with that.
struct Key<'a> {
    wanted: &'a str,
    is_it: bool,
}

impl<'de> DeserializeSeed<'de> for Key<'_> {
    /// Whether it is the key that is wanted.
    type Value = bool;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<bool, D::Error> {
        deserializer.deserialize_str(self)
    }
}

impl Visitor<'_> for Key<'_> {
    type Value = bool;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a key")
    }

    fn visit_str<E: Error>(self, key: &str) -> Result<bool, E> {
        if key == self.wanted && self.is_it { Err(E::custom(MARK)) } else { Ok(key == self.wanted) }
    }
}

impl<'de> DeserializeSeed<'de> for Walk<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Walk<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(MARK)
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        let Some((wanted, rest)) = self.0.split_first() else { return Err(A::Error::custom(MARK)) };
        let mut before = match self.1 {
            PlacePart::Key if rest.is_empty() => Some(0),
            PlacePart::SecondKey if rest.is_empty() => Some(1),
            _ => None,
        };
        while let Some(is_wanted) = map.next_key_seed(Key { wanted, is_it: before == Some(0) })? {
            match &mut before {
                None if is_wanted => return map.next_value_seed(Walk(rest, self.1)),
                Some(before) if is_wanted => *before -= 1,
                _ => {}
            }
            map.next_value::<IgnoredAny>()?;
        }
        Ok(())
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<(), A::Error> {
        let step = self.0.split_first();
        let Some((wanted, rest)) = step.and_then(|(wanted, rest)| Some((wanted.parse().ok()?, rest))) else {
            return Err(A::Error::custom(MARK));
        };
        for _ in 0usize..wanted {
            seq.next_element::<IgnoredAny>()?;
        }
        seq.next_element_seed(Walk(rest, self.1)).map(|_| ())
    }
    // Scalars fall through to the default methods, which fail with "expected luxproof-was-here".
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_found_in_block_and_flow_style_and_for_what_is_absent_that_of_its_nearest_parent() {
        let text = "room:\n  size_m: [1, 2]\nmeters:\n  a:\n    points_m: [[1, 2, 3], [4, 5, 6]]\n";
        for (path, place) in [
            ("room.size_m", (2, 11)),
            ("meters.a.points_m[1]", (5, 27)),
            ("meters.a.points_m[1][2]", (5, 34)),
            ("room.size_m[1]", (2, 15)),
            ("room.reflectance.floor", (2, 3)),
        ] {
            assert_eq!(locate(text, path, PlacePart::Value), Some(place), "{path}");
        }
        let twice = "room: {size_m: 1, size_m: 2}\n";
        assert_eq!(locate(twice, "room.size_m", PlacePart::Key), Some((1, 8)));
        assert_eq!(locate(twice, "room.size_m", PlacePart::SecondKey), Some((1, 19)));
    }
}
