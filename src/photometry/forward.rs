//! Which plane points forward, and what becomes of that when a file is written in a format that has another one.
//!
//! Forward, across the street or away from the wall, is C 0 in LM-63 (ANSI/IES LM-63-19, photometric horizontal) and in TM-33,
//! which takes over its coordinates, and C 90 in EULUMDAT (Stockmar 1990), whose C 0 looks at a luminaire's long side. A
//! conversion can keep each C angle or the forward direction, and not both.

use super::{FileFormat, Lint, LuminousIntensityDistribution, Photometry, Severity};
use crate::units::Lumen;

/// What a conversion keeps where forward is another plane in the new format.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ForwardPolicy {
    /// Every intensity its C angle.
    #[default]
    KeepAngles,
    /// Light that is thrown forward is thrown forward.
    KeepForward,
}

/// A photometry on its way into a format.
#[derive(Clone, Debug, PartialEq)]
pub struct Aimed {
    /// What to write.
    pub photometry: Photometry,
    /// What turns, where the formats differ in their forward planes; a warning where that changes the light.
    pub lint: Option<Lint>,
}

/// Differences of less than this part of the largest intensity are none.
const SAME_LIGHT: f64 = 1e-9;

/// Fluxes of zones that differ by less than this part of all flux are one.
const SAME_ZONE: f64 = 1e-4;

impl Photometry {
    /// The photometry as a format is to have it by a policy, and in words what turns.
    pub fn aimed_for(&self, format: FileFormat, policy: ForwardPolicy) -> Aimed {
        let (from_deg, to_deg) = (self.convention().forward_c_deg, format.forward_c_deg());
        if from_deg == to_deg {
            return Aimed { photometry: self.clone(), lint: None };
        }
        // By quarters everything turns.
        let (turned, _) = self.turned(to_deg - from_deg);
        let same_light = is_same_light(&self.distribution, &turned.distribution);
        let same_opening = self.opening == turned.opening;
        let turn_deg = to_deg - from_deg;
        let planes = format!("forward is C {from_deg} in {} and C {to_deg} in {}", self.format, format.name());
        let severity = if same_light && same_opening { Severity::Note } else { Severity::Warning };
        let told = match policy {
            _ if same_light && same_opening => {
                "nothing turns: the light is the same a quarter turn further round".into()
            }
            ForwardPolicy::KeepAngles => self.told_of_kept_angles(to_deg),
            ForwardPolicy::KeepForward => format!(
                "the table and its opening were turned by {turn_deg} degrees, C 0 towards C 90, so that BUG zones stay; every C \
                 angle is another, and in a room that places luminaires by C angles its wash turns with them"
            ),
        };
        let photometry = if policy == ForwardPolicy::KeepForward { turned } else { self.clone() };
        let lint = Lint { code: "convert/forward", severity, line: 0, message: format!("{planes}; {told}") };
        Aimed { photometry, lint: Some(lint) }
    }

    fn told_of_kept_angles(&self, to_deg: f64) -> String {
        let zones = |forward_c_deg: f64| {
            let zones = self.distribution.classification_zones(forward_c_deg);
            [zones.forward, zones.back].map(|zones| zones.map(Lumen::value))
        };
        let (before, after) = (zones(self.convention().forward_c_deg), zones(to_deg));
        let allowed = SAME_ZONE * self.distribution.flux().value();
        let same = before.iter().flatten().zip(after.iter().flatten()).all(|(a, b)| (a - b).abs() <= allowed);
        let bug = if same {
            "BUG zones happen to be the same either way".to_owned()
        } else {
            let list = |zones: &[f64; 4]| zones.map(|lumens| format!("{lumens:.0}")).join(" ");
            let [forward, back, now, back_now] = [&before[0], &before[1], &after[0], &after[1]].map(list);
            format!("BUG zones turn: forward {forward}, back {back} lm become forward {now}, back {back_now} lm")
        };
        format!(
            "C angles were kept, and what rests on forward turns by a quarter: {bug}, and who aims by the format's forward \
             washes another wall of the room. Where luminaires are placed by C angles nothing turns"
        )
    }
}

/// Whether two tables shine alike: they are bilinear, so that they differ most at an angle of one of them.
fn is_same_light(a: &LuminousIntensityDistribution, b: &LuminousIntensityDistribution) -> bool {
    let allowed = SAME_LIGHT * a.max_intensity().value();
    let (own, other) = (a.full_circle(), b.full_circle());
    let c_deg = [own.c_deg(), other.c_deg()].concat();
    let [a, b] = [a, b].map(|table| table.intensities(&c_deg, own.gamma_deg()));
    a.iter().zip(b).all(|(a, b)| (a - b).abs() <= allowed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::photometry::lm63::Edition;
    use crate::photometry::{LuminousOpening, eulumdat, lm63};

    const IES: FileFormat = FileFormat::Lm63(Edition::Lm63_2019);

    /// Planes of this range whose intensity at gamma 60 says which plane it is.
    fn table(c_deg: &[f64]) -> LuminousIntensityDistribution {
        let wraps = c_deg.last() == Some(&360.0);
        let row = |c: &f64| [300.0, 100.0 + if wraps && *c == 360.0 { 0.0 } else { *c }, 0.0];
        LuminousIntensityDistribution::new(c_deg.to_vec(), vec![0.0, 60.0, 90.0], c_deg.iter().flat_map(row).collect())
            .unwrap()
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
                let at = |p: &Photometry, c: f64| p.distribution.intensity(c, 60.0).value();
                assert!((at(&before, c) - at(&turned, c - 90.0)).abs() < 1e-10, "{c_deg:?} {c}");
                assert!((at(&before, c) - at(&back, c)).abs() < 1e-10, "{c_deg:?} {c}");
            }
        }
    }

    #[test]
    fn a_conversion_keeps_angles_or_forward_light_and_says_what_turns() {
        let opening = LuminousOpening::Box { x_m: 0.2, y_m: 0.6, height_m: 0.0 };
        let street = ldt(table(&[90.0, 135.0, 180.0, 225.0, 270.0]), opening);
        let forward = |p: &Photometry| p.distribution.classification_zones(p.convention().forward_c_deg).forward;
        let written = |policy| {
            let aimed = street.aimed_for(IES, policy);
            let lint = aimed.lint.unwrap();
            assert_eq!(lint.severity, Severity::Warning, "{lint:?}");
            let again = lm63::parse(IES.write(&aimed.photometry).text.as_bytes()).unwrap();
            assert_eq!(again.distribution, aimed.photometry.distribution);
            (again, lint.message)
        };
        let (kept, told) = written(ForwardPolicy::KeepAngles);
        assert_eq!((&kept.distribution, kept.opening), (&street.distribution, opening));
        assert!(forward(&kept) != forward(&street));
        assert!(told.starts_with("forward is C 90 in EULUMDAT and C 0 in LM-63-2019; C angles were kept"), "{told}");
        assert!(told.contains("BUG zones turn") && told.contains("wall of the room"), "{told}");
        let (turned, told) = written(ForwardPolicy::KeepForward);
        for (a, b) in forward(&turned).into_iter().zip(forward(&street)) {
            assert!((a.value() - b.value()).abs() < 1e-9 * b.value());
        }
        assert_eq!(turned.opening, LuminousOpening::Box { x_m: 0.6, y_m: 0.2, height_m: 0.0 });
        assert!(told.contains("turned by -90 degrees") && told.contains("wash turns"), "{told}");
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
