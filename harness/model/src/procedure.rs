//! The names and meanings of the procedures.

use crate::{ProcedureId, Quantity};

/// The words of a procedure.
struct ProcedureText {
    /// For a heading.
    title: &'static str,
    /// For a navigation bar.
    short: &'static str,
    /// A sentence for users.
    meaning: &'static str,
    quantity: Quantity,
}

/// In the order of [`ProcedureId`].
const TEXTS: [ProcedureText; 17] = [
    // LuminousIntensity
    ProcedureText {
        title: "Luminous intensity",
        short: "Intensity",
        meaning: "The luminous intensity distribution read back from illuminance at a distance in free field, I = E d², over the curve of the photometric file.",
        quantity: Quantity::LuminousIntensity,
    },
    // DirectIlluminance
    ProcedureText {
        title: "Direct illuminance",
        short: "Direct",
        meaning: "Illuminance straight from the luminaires, without any reflected light.",
        quantity: Quantity::Illuminance,
    },
    // IndirectIlluminance
    ProcedureText {
        title: "Indirect illuminance",
        short: "Indirect",
        meaning: "Illuminance by light that was reflected at least once.",
        quantity: Quantity::Illuminance,
    },
    // TotalIlluminance
    ProcedureText {
        title: "Total illuminance",
        short: "Total",
        meaning: "Direct and reflected light together.",
        quantity: Quantity::Illuminance,
    },
    // CylindricalIlluminance
    ProcedureText {
        title: "Cylindrical illuminance",
        short: "Cylindrical",
        meaning: "Mean over all vertical directions of the illuminance at a point (EN 12464-1), wherever its meter looks: of all light, or of the part that the spec names.",
        quantity: Quantity::Illuminance,
    },
    // SemicylindricalIlluminance
    ProcedureText {
        title: "Semi-cylindrical illuminance",
        short: "Semi-cylindrical",
        meaning: "Mean illuminance of an upright half cylinder that faces as the meter does (EN 13201-3): of all light, or of the part that the spec names.",
        quantity: Quantity::Illuminance,
    },
    // HemisphericalIlluminance
    ProcedureText {
        title: "Hemispherical illuminance",
        short: "Hemispherical",
        meaning: "Mean illuminance of a hemisphere that faces as the meter does (EN 13201-3): of all light, or of the part that the spec names.",
        quantity: Quantity::Illuminance,
    },
    // SphericalIlluminance
    ProcedureText {
        title: "Mean spherical illuminance",
        short: "Spherical",
        meaning: "Mean illuminance of a small sphere (scalar illuminance), wherever its meter looks: of all light, or of the part that the spec names.",
        quantity: Quantity::Illuminance,
    },
    // Luminance
    ProcedureText {
        title: "Luminance",
        short: "Luminance",
        meaning: "Luminance of the diffuse surface on which each meter lies, L = rho E / pi, E being all light, direct and reflected.",
        quantity: Quantity::Luminance,
    },
    // OpeningLuminance
    ProcedureText {
        title: "Luminance of an opening",
        short: "Opening",
        meaning: "Mean luminance of a luminaire's luminous opening towards observers, alone in free field: the illuminance of an eye that is aimed at its centre over the opening's projected solid angle.",
        quantity: Quantity::Luminance,
    },
    // UnifiedGlareRating
    ProcedureText {
        title: "Unified glare rating",
        short: "Glare",
        meaning: "Unified glare rating (CIE 117) of observers who look as their meters do: 8 lg (.25 / Lb sum L² ω / p²) over the luminous openings in view, with Lb = E / pi of the indirect illuminance that is read at the eye.",
        quantity: Quantity::GlareRating,
    },
    // Point
    ProcedureText {
        title: "Calibration: point",
        short: "Calibration: point",
        meaning: "the inverse-square law from .5 to 10 m",
        quantity: Quantity::Illuminance,
    },
    // Asymmetric
    ProcedureText {
        title: "Calibration: asymmetric",
        short: "Calibration: asymmetric",
        meaning: "a table without symmetry, turned, all around",
        quantity: Quantity::Illuminance,
    },
    // Luminaires
    ProcedureText {
        title: "Calibration: luminaires",
        short: "Calibration: luminaires",
        meaning: "three luminaires that differ",
        quantity: Quantity::Illuminance,
    },
    // Shadow
    ProcedureText {
        title: "Calibration: shadow",
        short: "Calibration: shadow",
        meaning: "light that a box hides, and light that passes it",
        quantity: Quantity::Illuminance,
    },
    // Furnace
    ProcedureText {
        title: "Calibration: furnace",
        short: "Calibration: furnace",
        meaning: "reflected light that is the same everywhere, near surfaces too",
        quantity: Quantity::Illuminance,
    },
    // Reflectances
    ProcedureText {
        title: "Calibration: reflectances",
        short: "Calibration: reflectances",
        meaning: "floor, walls and ceiling that differ",
        quantity: Quantity::Illuminance,
    },
];

impl ProcedureId {
    const fn text(self) -> &'static ProcedureText {
        &TEXTS[self as usize]
    }

    /// Its name for a heading.
    pub const fn title(self) -> &'static str {
        self.text().title
    }

    /// Its name for a navigation bar.
    pub const fn short(self) -> &'static str {
        self.text().short
    }

    /// Its meaning, in a sentence for users.
    pub const fn meaning(self) -> &'static str {
        self.text().meaning
    }

    /// The quantity that it reads.
    pub const fn quantity(self) -> Quantity {
        self.text().quantity
    }

    /// Whether it is a calibration scene, which no spec requests.
    pub const fn is_calibration(self) -> bool {
        self as usize >= Self::ALL.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    #[test]
    fn every_procedure_has_its_words_and_its_quantity() {
        let (intensity, glare) = (ProcedureId::LuminousIntensity, ProcedureId::UnifiedGlareRating);
        assert_eq!((intensity.title(), intensity.short()), ("Luminous intensity", "Intensity"));
        assert!(glare.meaning().starts_with("Unified glare rating (CIE 117)"));
        assert_eq!(
            (ProcedureId::Point.title(), ProcedureId::Point.short()),
            ("Calibration: point", "Calibration: point")
        );
        assert_eq!(ProcedureId::Shadow.meaning(), "light that a box hides, and light that passes it");
        for (procedure, quantity) in [
            (intensity, Quantity::LuminousIntensity),
            (ProcedureId::SphericalIlluminance, Quantity::Illuminance),
            (ProcedureId::Luminance, Quantity::Luminance),
            (ProcedureId::OpeningLuminance, Quantity::Luminance),
            (glare, Quantity::GlareRating),
            (ProcedureId::Reflectances, Quantity::Illuminance),
        ] {
            assert_eq!(procedure.quantity(), quantity, "{procedure}");
        }
        assert!(!glare.is_calibration() && ProcedureId::Point.is_calibration());
        assert!(ProcedureId::ALL.iter().all(|procedure| !procedure.is_calibration()));
    }
}
