//! Which light counts, as files write it: `direct`, `indirect, 7 bounces`, `total, all bounces`.

use std::fmt;

use luxproof_scene::{Bounces, Transport};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Which light counts, and how many reflections of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "String", into = "String")]
#[schemars(with = "String")]
pub struct Light(pub Transport);

impl Light {
    /// The number of reflections; `None` of direct light.
    pub const fn bounces(self) -> Option<Bounces> {
        match self.0 {
            Transport::Direct => None,
            Transport::Indirect(bounces) | Transport::Total(bounces) => Some(bounces),
        }
    }
}

impl fmt::Display for Light {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (kind, bounces) = match self.0 {
            Transport::Direct => return f.write_str("direct"),
            Transport::Indirect(bounces) => ("indirect", bounces),
            Transport::Total(bounces) => ("total", bounces),
        };
        match bounces {
            Bounces::Converged => write!(f, "{kind}, all bounces"),
            Bounces::AtMost(n) => write!(f, "{kind}, {n} bounces"),
        }
    }
}

/// A text that names no light.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is no light; expected `direct`, `indirect, all bounces` or `total, 7 bounces`, say")]
pub struct UnknownLight(String);

impl TryFrom<String> for Light {
    type Error = UnknownLight;

    fn try_from(text: String) -> Result<Self, UnknownLight> {
        parse_transport(&text).map(Self).ok_or(UnknownLight(text))
    }
}

/// Parses the form of [`Light`] in files.
fn parse_transport(text: &str) -> Option<Transport> {
    if text == "direct" {
        return Some(Transport::Direct);
    }
    let (kind, count) = text.strip_suffix(" bounces")?.split_once(", ")?;
    let bounces = match count {
        "all" => Bounces::Converged,
        n => Bounces::AtMost(n.parse().ok()?),
    };
    match kind {
        "indirect" => Some(Transport::Indirect(bounces)),
        "total" => Some(Transport::Total(bounces)),
        _ => None,
    }
}

impl From<Light> for String {
    fn from(light: Light) -> Self {
        light.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_and_seven_are_not_seventeen() {
        for transport in [
            Transport::Direct,
            Transport::Indirect(Bounces::AtMost(7)),
            Transport::Indirect(Bounces::AtMost(17)),
            Transport::Total(Bounces::Converged),
        ] {
            assert_eq!(Light::try_from(Light(transport).to_string()), Ok(Light(transport)));
        }
        for wrong in ["", "indirect", "indirect, many bounces", "light, 7 bounces"] {
            assert!(Light::try_from(wrong.to_owned()).is_err(), "{wrong}");
        }
    }

    #[test]
    fn direct_light_has_no_bounces() {
        assert_eq!(Light(Transport::Direct).bounces(), None);
        assert_eq!(Light(Transport::Indirect(Bounces::AtMost(7))).bounces(), Some(Bounces::AtMost(7)));
        assert_eq!(Light(Transport::Total(Bounces::Converged)).bounces(), Some(Bounces::Converged));
        assert_eq!(Light(Transport::Total(Bounces::AtMost(7))).to_string(), "total, 7 bounces");
        assert_eq!(String::from(Light(Transport::Indirect(Bounces::Converged))), "indirect, all bounces");
    }
}
