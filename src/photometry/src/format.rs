//! The formats that photometry is written in.

use super::details::Edition;

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

    /// The C plane that points forward, in degrees.
    pub const fn forward_c_deg(self) -> f64 {
        match self {
            Self::Lm63(_) | Self::Tm33 => 0.0,
            Self::Eulumdat => 90.0,
        }
    }
}
