//! The formats that photometry is written in, and what they differ in.

use super::details::Edition;
use super::{Photometry, Written, eulumdat, lm63, tm33};

/// A format to write.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileFormat {
    /// LM-63 of an edition.
    Lm63(Edition),
    /// EULUMDAT.
    Eulumdat,
    /// TM-33-23.
    Tm33,
}

impl FileFormat {
    /// The name used in messages, e.g. `LM-63-2002`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Lm63(edition) => edition.name(),
            Self::Eulumdat => "EULUMDAT",
            Self::Tm33 => "TM-33-23",
        }
    }

    /// Writes a photometry in this format.
    pub fn write(self, photometry: &Photometry) -> Written {
        match self {
            Self::Lm63(edition) => lm63::write(photometry, edition),
            Self::Eulumdat => eulumdat::write(photometry),
            Self::Tm33 => tm33::write(photometry),
        }
    }
}
