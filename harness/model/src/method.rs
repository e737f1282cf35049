//! How a reading was taken: the method makes readings comparable, the effort repeats them.

use std::collections::BTreeMap;
use std::ops::{Deref, DerefMut};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::MeterId;

/// Solver, preset and options. Readings of one instrument by one method are comparable.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct Method(BTreeMap<String, String>);

/// Blocks, samples, seeds and commands, which differ from run to run.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct Effort(BTreeMap<String, String>);

impl Effort {
    /// The entry that lists the points that follow by symmetry.
    const MIRRORED: &str = "mirrored_meters";

    /// The entry for points that follow by symmetry: each point, the rendered point that it mirrors, and the motion.
    pub fn mirrored_entry<'a>(points: impl Iterator<Item = (&'a MeterId, &'a MeterId, &'a str)>) -> (String, String) {
        let points: Vec<String> = points.map(|(point, source, by)| format!("{point} is {source} ({by})")).collect();
        (Self::MIRRORED.to_owned(), points.join(", "))
    }

    /// The points that follow by symmetry, each with the rendered point that it mirrors.
    pub fn mirrored(&self) -> BTreeMap<&str, &str> {
        let entries =
            self.get(Self::MIRRORED).map(|text| text.trim_end_matches(')').split("), ")).into_iter().flatten();
        let pairs = entries.filter_map(|entry| entry.rsplit_once(" (")?.0.split_once(" is "));
        pairs.collect()
    }
}

/// Implements a map from words to words.
macro_rules! impl_word_map {
    ($name:ident) => {
        impl Deref for $name {
            type Target = BTreeMap<String, String>;

            fn deref(&self) -> &Self::Target {
                &self.0
            }
        }

        impl DerefMut for $name {
            fn deref_mut(&mut self) -> &mut Self::Target {
                &mut self.0
            }
        }

        impl<K: Into<String>, V: ToString> FromIterator<(K, V)> for $name {
            fn from_iter<I: IntoIterator<Item = (K, V)>>(words: I) -> Self {
                Self(words.into_iter().map(|(key, value)| (key.into(), value.to_string())).collect())
            }
        }

        impl<const N: usize, K: Into<String>, V: ToString> From<[(K, V); N]> for $name {
            fn from(words: [(K, V); N]) -> Self {
                words.into_iter().collect()
            }
        }
    };
}

impl_word_map!(Method);
impl_word_map!(Effort);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_that_follow_by_symmetry_are_found_again() {
        let meters = [MeterId::new("desk", 0), MeterId::new("desk", 4), MeterId::new("wall (left)", 2)];
        let points = [(&meters[1], &meters[0], "x -> -x, y -> -y"), (&meters[2], &meters[0], "x -> -x")];
        let effort: Effort = [Effort::mirrored_entry(points.into_iter())].into_iter().collect();
        let expected = BTreeMap::from([("desk[4]", "desk[0]"), ("wall (left)[2]", "desk[0]")]);
        assert_eq!(effort.mirrored(), expected);
        assert!(Effort::default().mirrored().is_empty());
    }

    #[test]
    fn settings_are_words_by_name() {
        let mut method = Method::from([("preset", "audit")]);
        method.insert("samples".to_owned(), 32.to_string());
        assert_eq!(method.get("samples").map(String::as_str), Some("32"));
        assert_eq!(method, Method::from_iter([("samples", "32"), ("preset", "audit")]));
        let mut effort = Effort::from([("blocks", 8)]);
        effort.remove("blocks");
        assert!(effort.is_empty());
    }
}
