//! The comparison of all engines of one procedure with each other.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::ProcedureId;

/// How the engines and references of one procedure of a case agree with each other.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Consensus {
    pub case: String,
    pub procedure: ProcedureId,
    pub witnesses: Vec<Witness>,
    /// The number of independent witnesses: those that share a component count once.
    pub independent: usize,
    /// The independent groups, with the components that their members share.
    #[serde(default)]
    pub groups: Vec<Group>,
    /// The number of meters at which any two differ by more than their tolerances.
    pub differing: usize,
    /// The outliers, where the odds are high enough to name them; several where they share a component.
    pub outliers: Vec<String>,
    /// The code of one witness, or the component that several share.
    pub component: Option<String>,
    /// The odds of this explanation against all others.
    pub odds: Option<f64>,
    /// The same in a sentence.
    pub text: String,
    /// The assumptions, and the faults that cannot be found this way.
    pub assumptions: String,
}

/// Witnesses that share components and count once.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Group {
    pub witnesses: Vec<String>,
    /// The shared components.
    pub share: Vec<String>,
}

impl std::fmt::Display for Group {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let why = if self.share.is_empty() { String::new() } else { format!(" ({})", self.share.join(", ")) };
        write!(f, "{}{why}", self.witnesses.join(" = "))
    }
}

/// An engine or a reference.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Witness {
    /// The engine, or the source of the values.
    pub name: String,
    /// Whether it is the reference here.
    pub is_reference: bool,
    /// The components that it shares with others.
    pub shares: Vec<String>,
    /// Its deviation from the others' weighted mean where they differ most, relative.
    pub deviation: Option<f64>,
    /// The probability that its code is the outlier.
    pub probability: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    #[test]
    fn a_group_names_its_members_and_what_they_share() {
        let words = |words: &[&str]| words.iter().map(|word| (*word).to_owned()).collect();
        let tied = Group { witnesses: words(&["a", "b"]), share: words(&["tables", "lookup"]) };
        assert_eq!(tied.to_string(), "a = b (tables, lookup)");
        assert_eq!(Group { witnesses: words(&["a"]), share: vec![] }.to_string(), "a");
    }
}
