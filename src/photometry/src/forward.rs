//! The forward plane of a luminaire in conversions between formats that define it differently.
//!
//! Forward, across the street or away from the wall, is C 0 in LM-63 (ANSI/IES LM-63-19, photometric horizontal) and in
//! TM-33, which uses the same coordinates. It is C 90 in EULUMDAT (Stockmar 1990), where C 0 faces the long side of a
//! luminaire. A conversion can keep the C angles or the forward direction, not both.

use super::{FileFormat, Lint, LuminousIntensityDistribution, Photometry, Severity};
use crate::units::Lumen;

/// The property that a conversion keeps where the formats have different forward planes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ForwardPolicy {
    /// Every intensity keeps its C angle.
    #[default]
    KeepAngles,
    /// Forward light stays forward light.
    KeepForward,
}

/// A photometry prepared for a format.
#[derive(Clone, Debug, PartialEq)]
pub struct Aimed {
    /// The photometry to write.
    pub photometry: Photometry,
    /// The consequence of different forward planes; a warning where the light changes.
    pub lint: Option<Lint>,
}

/// Tables with differences below this fraction of the largest intensity have equal light.
const EQUAL_LIGHT_FRACTION: f64 = 1e-9;

/// Zones with differences below this fraction of the total flux are equal.
const EQUAL_ZONE_FRACTION: f64 = 1e-4;

impl Photometry {
    /// Prepares the photometry for a format by a policy, with a lint about what turns.
    pub fn aimed_for(&self, format: FileFormat, policy: ForwardPolicy) -> Aimed {
        let (from_deg, to_deg) = (self.convention().forward_c_deg, format.forward_c_deg());
        if from_deg == to_deg {
            return Aimed { photometry: self.clone(), lint: None };
        }
        let turn_deg = to_deg - from_deg;
        // A turn by quarters leaves nothing behind.
        let (turned, _) = self.turned(turn_deg);
        let is_unchanged = is_equal_light(&self.distribution, &turned.distribution) && self.opening == turned.opening;
        let planes = format!("forward is C {from_deg} in {} and C {to_deg} in {}", self.format, format.name());
        let severity = if is_unchanged { Severity::Note } else { Severity::Warning };
        let consequence = match policy {
            _ if is_unchanged => "nothing turns: the light is the same a quarter turn further round".into(),
            ForwardPolicy::KeepAngles => self.describe_kept_angles(to_deg),
            ForwardPolicy::KeepForward => format!(
                "the table and its opening were turned by {turn_deg} degrees, C 0 towards C 90, so that BUG zones stay; every C \
                 angle is another, and in a room that places luminaires by C angles its wash turns with them"
            ),
        };
        let photometry = if policy == ForwardPolicy::KeepForward { turned } else { self.clone() };
        let lint = Lint { code: "convert/forward", severity, line: 0, message: format!("{planes}; {consequence}") };
        Aimed { photometry, lint: Some(lint) }
    }

    /// Describes the consequences of kept C angles, where forward becomes the plane `to_deg`.
    fn describe_kept_angles(&self, to_deg: f64) -> String {
        let from_deg = self.convention().forward_c_deg;
        let [before, after] = [from_deg, to_deg].map(|forward_c_deg| self.forward_and_back_lm(forward_c_deg));
        let allowed = EQUAL_ZONE_FRACTION * self.distribution.flux().value();
        let is_same = before.iter().flatten().zip(after.iter().flatten()).all(|(a, b)| (a - b).abs() <= allowed);
        let bug = if is_same {
            "BUG zones happen to be the same either way".to_owned()
        } else {
            let [forward, back] = before.map(list_lumens);
            let [now, back_now] = after.map(list_lumens);
            format!("BUG zones turn: forward {forward}, back {back} lm become forward {now}, back {back_now} lm")
        };
        format!(
            "C angles were kept, and what rests on forward turns by a quarter: {bug}, and who aims by the format's forward \
             washes another wall of the room. Where luminaires are placed by C angles nothing turns"
        )
    }
}

impl Photometry {
    /// Forward and back light in lumens in the zones below the horizontal.
    fn forward_and_back_lm(&self, forward_c_deg: f64) -> [[f64; 4]; 2] {
        let zones = self.distribution.classification_zones(forward_c_deg);
        [zones.forward, zones.back].map(|zones| zones.map(Lumen::value))
    }
}

/// Whole lumens of zones, separated by blanks.
fn list_lumens(zones: [f64; 4]) -> String {
    zones.map(|lumens| format!("{lumens:.0}")).join(" ")
}

/// Whether two tables have equal light. They are bilinear, so that they differ most at an angle of one of them.
fn is_equal_light(a: &LuminousIntensityDistribution, b: &LuminousIntensityDistribution) -> bool {
    let allowed = EQUAL_LIGHT_FRACTION * a.max_intensity().value();
    let (own, other) = (a.full_circle(), b.full_circle());
    let c_deg = [own.c_deg(), other.c_deg()].concat();
    let [a, b] = [a, b].map(|table| table.intensities(&c_deg, own.gamma_deg()));
    a.iter().zip(b).all(|(a, b)| (a - b).abs() <= allowed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lm63::Edition;
    use crate::{LuminousOpening, eulumdat, lm63};

    const IES: FileFormat = FileFormat::Lm63(Edition::Lm63_2019);

    /// A table of planes, each with another intensity at gamma 60.
    fn table(c_deg: &[f64]) -> LuminousIntensityDistribution {
        // The planes 0 and 360 are one.
        let candela = c_deg.iter().flat_map(|c| [300.0, 100.0 + c % 360.0, 0.0]).collect();
        LuminousIntensityDistribution::new(c_deg.to_vec(), vec![0.0, 60.0, 90.0], candela).unwrap()
    }

    /// The intensity at gamma 60.
    fn intensity_at(photometry: &Photometry, c: f64) -> f64 {
        photometry.distribution.intensity(c, 60.0).value()
    }

    /// Forward light by the convention of the format.
    fn forward_zones(photometry: &Photometry) -> [Lumen; 4] {
        photometry.distribution.classification_zones(photometry.convention().forward_c_deg).forward
    }

    fn ldt(distribution: LuminousIntensityDistribution, opening: LuminousOpening) -> Photometry {
        let plain = Photometry { lamp_lumens: Some(1000.0), opening, ..Photometry::of(distribution) };
        eulumdat::parse(eulumdat::write(&plain).text.as_bytes()).unwrap()
    }

    #[test]
    fn a_quarter_turn_is_exact_for_every_symmetry_and_undone_by_the_other() {
        for c_deg in [
            &[0.0][..],
            &[0.0, 30.0, 90.0],
            &[0.0, 22.5, 110.0, 180.0],
            &[90.0, 100.0, 190.0, 270.0],
            &[0.0, 90.0, 100.0, 180.0, 270.0, 300.0, 360.0],
        ] {
            let before = ldt(table(c_deg), LuminousOpening::Point);
            let turned = before.aimed_for(IES, ForwardPolicy::KeepForward).photometry;
            let ies = lm63::parse(IES.write(&turned).text.as_bytes()).unwrap();
            let back = ies.aimed_for(FileFormat::Eulumdat, ForwardPolicy::KeepForward).photometry;
            let (c_count, planes) = (before.distribution.c_deg().len(), turned.distribution.c_deg().len());
            assert!(planes <= c_count.max(3) + 1, "{c_deg:?} became {:?}", turned.distribution.c_deg());
            for k in 0..72 {
                let c = 5.0 * f64::from(k);
                let expected = intensity_at(&before, c);
                assert!((expected - intensity_at(&turned, c - 90.0)).abs() < 1e-10, "{c_deg:?} {c}");
                assert!((expected - intensity_at(&back, c)).abs() < 1e-10, "{c_deg:?} {c}");
            }
        }
    }

    /// Converts to LM-63 by a policy: what is read back, and the message of the lint.
    fn convert(photometry: &Photometry, policy: ForwardPolicy) -> (Photometry, String) {
        let aimed = photometry.aimed_for(IES, policy);
        let lint = aimed.lint.unwrap();
        assert_eq!(lint.severity, Severity::Warning, "{lint:?}");
        let again = lm63::parse(IES.write(&aimed.photometry).text.as_bytes()).unwrap();
        assert_eq!(again.distribution, aimed.photometry.distribution);
        (again, lint.message)
    }

    #[test]
    fn a_conversion_keeps_angles_or_forward_light_and_reports_what_turns() {
        let opening = LuminousOpening::Box { x_m: 0.2, y_m: 0.6, height_m: 0.0 };
        let street = ldt(table(&[90.0, 135.0, 180.0, 225.0, 270.0]), opening);
        let (unturned, message) = convert(&street, ForwardPolicy::KeepAngles);
        assert_eq!((&unturned.distribution, unturned.opening), (&street.distribution, opening));
        assert!(forward_zones(&unturned) != forward_zones(&street));
        let start = "forward is C 90 in EULUMDAT and C 0 in LM-63-2019; C angles were kept";
        assert!(message.starts_with(start), "{message}");
        assert!(message.contains("BUG zones turn") && message.contains("wall of the room"), "{message}");
        let (turned, message) = convert(&street, ForwardPolicy::KeepForward);
        for (a, b) in forward_zones(&turned).into_iter().zip(forward_zones(&street)) {
            assert!((a.value() - b.value()).abs() < 1e-9 * b.value());
        }
        assert_eq!(turned.opening, LuminousOpening::Box { x_m: 0.6, y_m: 0.2, height_m: 0.0 });
        assert!(message.contains("turned by -90 degrees") && message.contains("wash turns"), "{message}");
    }

    #[test]
    fn what_is_the_same_a_quarter_further_round_is_no_warning_and_one_format_is_no_turn() {
        let round = ldt(table(&[0.0]), LuminousOpening::Ellipse { x_m: 0.3, y_m: 0.3, height_m: 0.0 });
        let lint = round.aimed_for(IES, ForwardPolicy::KeepForward).lint.unwrap();
        assert!(lint.severity == Severity::Note && lint.message.contains("nothing turns"), "{lint:?}");
        let long = ldt(table(&[0.0]), LuminousOpening::Box { x_m: 0.3, y_m: 1.2, height_m: 0.0 });
        let lint = long.aimed_for(IES, ForwardPolicy::KeepAngles).lint.unwrap();
        assert!(
            lint.severity == Severity::Warning && lint.message.contains("BUG zones happen to be the same"),
            "{lint:?}"
        );
        let aimed = long.aimed_for(FileFormat::Eulumdat, ForwardPolicy::KeepForward);
        assert_eq!((aimed.photometry, aimed.lint), (long, None));
    }
}
