//! The writer of each format.

use super::{FileFormat, Photometry, Written, eulumdat, lm63, tm33};

impl FileFormat {
    /// Writes a photometry in this format.
    pub fn write(self, photometry: &Photometry) -> Written {
        match self {
            Self::Lm63(edition) => lm63::write(photometry, edition),
            Self::Eulumdat => eulumdat::write(photometry),
            Self::Tm33 => tm33::write(photometry),
        }
    }
}
