//! The validity of a method for a scene and a meter.

use luxproof_photometry::units::Lux;

/// How far the assumptions of a method hold.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Validity {
    /// Every assumption holds.
    Supported,
    /// A value outside the assumptions; the text says which one fails and, where known, by how much.
    Approximate(String),
    /// The method does not apply; the text says why, and which method does.
    No(String),
}

/// A value by one of the methods.
#[derive(Clone, Debug, PartialEq)]
pub struct Calculated {
    /// The value.
    pub illuminance: Lux,
    /// [`Validity::Supported`] or [`Validity::Approximate`].
    pub validity: Validity,
}

/// Why a method has no value for a scene and a meter.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the {method} does not apply: {reason}")]
pub struct NotApplicable {
    /// The method's name.
    pub method: &'static str,
    /// What rules it out, and what to use instead.
    pub reason: String,
}

impl Validity {
    /// The validity of a calculation that may have failed.
    pub fn of(calculated: &Result<Calculated, NotApplicable>) -> Self {
        match calculated {
            Ok(calculated) => calculated.validity.clone(),
            Err(error) => Self::No(error.reason.clone()),
        }
    }

    /// Supported without objections, approximate with them.
    pub(super) fn from_objections(objections: &[String]) -> Self {
        if objections.is_empty() { Self::Supported } else { Self::Approximate(objections.join("; ")) }
    }
}
