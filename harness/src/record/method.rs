//! What was done to take a reading, apart from how much of it: the one makes readings comparable, the other repeats them.

use std::collections::BTreeMap;
use std::ops::{Deref, DerefMut};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What was done: solver, preset, options. Readings of one instrument by one method are comparable.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct Method(BTreeMap<String, String>);

/// How much was done, by which random numbers and where: blocks, samples, seeds, commands. It differs from run to run.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct Effort(BTreeMap<String, String>);

macro_rules! of_words {
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

of_words!(Method);
of_words!(Effort);
