//! Kinds of wrong factors of a luminaire: those that follow from its table, and the fields of its file.

use std::f64::consts::PI;

use itertools::Itertools;
use luxproof_photometry::{Details, Photometry};
use luxproof_scene::Luminaire;

use super::fault::Fault;
use luxproof_spec::procedures::Task;

/// A factor on the light of a luminaire with candela dimmed so far; `None` where there is none to get wrong.
type FactorOf = fn(&Luminaire, f64) -> Option<f64>;

/// Factors that normalised tables have. A renderer that normalises has one of them, and all luminaires have their own.
const TABLE_FACTORS: [(&str, FactorOf); 8] = [
    ("the table is divided by its peak", |l, dimming| Some(peak_cd(l, dimming)?.recip())),
    ("the table is divided by its flux", |l, dimming| Some(flux_lm(l, dimming)?.recip())),
    ("the table is divided by its value at the nadir", |l, dimming| Some(nadir_cd(l, dimming)?.recip())),
    ("the table is scaled by flux over peak", |l, dimming| Some(flux_lm(l, dimming)? / peak_cd(l, dimming)?)),
    ("the table is scaled by peak over flux", |l, dimming| Some(peak_cd(l, dimming)? / flux_lm(l, dimming)?)),
    ("the table is scaled by its flux", flux_lm),
    ("the table is scaled by its peak", peak_cd),
    ("the table is scaled by lamp lumens over its flux", |l, dimming| Some(lamp_lumens(l)? / flux_lm(l, dimming)?)),
];
/// Multiples of these by numbers that programs use.
const TABLE_MULTIPLES: [(&str, FactorOf); 4] = [
    ("the table is scaled to a flux of 1000 lm", |l, dimming| Some(1000.0 / flux_lm(l, dimming)?)),
    ("the table is scaled to a peak of 1000 cd", |l, dimming| Some(1000.0 / peak_cd(l, dimming)?)),
    ("the table is divided by its mean intensity, flux/(4 pi)", |l, dimming| Some(4.0 * PI / flux_lm(l, dimming)?)),
    ("the table is scaled by flux/(pi peak)", |l, dimming| Some(flux_lm(l, dimming)? / (PI * peak_cd(l, dimming)?))),
];

fn peak_cd(luminaire: &Luminaire, dimming: f64) -> Option<f64> {
    Some(dimming * luminaire.photometry.distribution.max_intensity().value()).filter(|peak| *peak > 0.0)
}

fn flux_lm(luminaire: &Luminaire, dimming: f64) -> Option<f64> {
    Some(dimming * luminaire.photometry.distribution.flux().value()).filter(|flux| *flux > 0.0)
}

fn nadir_cd(luminaire: &Luminaire, dimming: f64) -> Option<f64> {
    Some(dimming * luminaire.photometry.distribution.intensity(0.0, 0.0).value()).filter(|candela| *candela > 0.0)
}

fn lamp_lumens(luminaire: &Luminaire) -> Option<f64> {
    luminaire.photometry.lamp_lumens.filter(|lumens| *lumens > 0.0)
}

/// Factors on luminaires that follow from their tables or their files.
pub(super) fn luminaire_factors(cases: &[&[Task]]) -> Vec<Fault> {
    let mut all = vec![];
    // Adapters get tables that are dimmed already.
    for is_dimmed in [false, true] {
        for (what, factor) in TABLE_FACTORS.into_iter().chain(TABLE_MULTIPLES) {
            all.push(factor_fault(what.to_owned(), dimmed(factor, is_dimmed)));
        }
        for (what, factor) in TABLE_FACTORS {
            let scaled = factor_fault(format!("{what}, and all by factor {{0:}}"), dimmed(factor, is_dimmed));
            all.push(scaled.with_free_factor());
        }
    }
    let luminaires = cases.iter().flat_map(|tasks| tasks.iter()).flat_map(|t| &t.scene.luminaires);
    let fields = luminaires.flat_map(|l| file_fields(&l.photometry)).map(|(field, _)| field).unique();
    for field in fields {
        let left_out = format!("{field} of the file is left out");
        all.push(factor_fault(left_out, move |l| Some(field_of(l, field)?.recip())));
        all.push(factor_fault(format!("{field} of the file is applied twice"), move |l| field_of(l, field)));
    }
    all
}

/// The factor of a table as it is in the file, or as dimmed as the luminaire is.
fn dimmed(factor: FactorOf, is_dimmed: bool) -> impl Fn(&Luminaire) -> Option<f64> + Send + Sync + Copy {
    move |l| factor(l, if is_dimmed { l.flux_scale } else { 1.0 })
}

fn factor_fault(what: String, factor: impl Fn(&Luminaire) -> Option<f64> + Send + Sync + Copy + 'static) -> Fault {
    Fault::new("luminaire-factor", what, move |faulty, _| faulty.scale_luminaires(factor)).about("factor of tables")
}

fn field_of(luminaire: &Luminaire, field: &str) -> Option<f64> {
    file_fields(&luminaire.photometry).into_iter().find(|(name, _)| *name == field).map(|(_, value)| value)
}

/// The factors in the header of a file, each with its name; those of 1 change nothing.
fn file_fields(photometry: &Photometry) -> Vec<(&'static str, f64)> {
    let mut fields = match &photometry.details {
        Details::Lm63(details) => {
            let [multiplier, ballast, third] = photometry.lm63_multipliers().unwrap_or([1.0; 3]);
            vec![
                ("the candela multiplier", multiplier),
                ("the ballast factor", ballast),
                ("the ballast-lamp factor", third),
                ("the number of lamps", f64::from(details.lamps)),
                ("the product of all multipliers", multiplier * ballast * third),
            ]
        }
        Details::Eulumdat(details) => vec![
            ("the conversion factor", details.conversion_factor),
            ("the light output ratio", 0.01 * details.output_ratio_percent),
            ("the number of lamps", details.lamp_sets.first().map_or(1.0, |set| f64::from(set.lamps).abs())),
        ],
        Details::None => vec![],
    };
    fields.retain(|(_, value)| value.is_normal() && *value > 0.0 && (value - 1.0).abs() > 1e-9);
    fields
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use glam::DVec3;
    use luxproof_engines::fixtures;
    use luxproof_photometry::LuminousIntensityDistribution;

    /// A luminaire with these candela at the nadir, at 90 degrees and above, dimmed to a half, with 2000 lamp lumens.
    fn lamp(nadir_cd: f64, other_cd: f64) -> Luminaire {
        let table = LuminousIntensityDistribution::axial(vec![0.0, 90.0, 180.0], vec![nadir_cd, other_cd, other_cd]);
        let mut lamp = fixtures::luminaire("lamp", DVec3::ZERO, table.unwrap());
        Arc::make_mut(&mut lamp.photometry).lamp_lumens = Some(2000.0);
        lamp.flux_scale = 0.5;
        lamp
    }

    fn is_near(found: Option<f64>, expected: f64) -> bool {
        found.is_some_and(|found| (found / expected - 1.0).abs() < 1e-9)
    }

    #[test]
    fn factors_of_a_table_follow_from_its_peak_nadir_flux_and_lamp_lumens() {
        // 100 cd on all sides, dimmed to a half: 50 cd and 200 pi lm.
        let even = lamp(100.0, 100.0);
        let expected = [
            1.0 / 50.0,
            1.0 / (200.0 * PI),
            1.0 / 50.0,
            4.0 * PI,
            1.0 / (4.0 * PI),
            200.0 * PI,
            50.0,
            10.0 / PI,
            5.0 / PI,
            20.0,
            0.02,
            4.0,
        ];
        for ((what, factor), expected) in TABLE_FACTORS.into_iter().chain(TABLE_MULTIPLES).zip(expected) {
            assert!(is_near(factor(&even, 0.5), expected), "{what}: {:?}", factor(&even, 0.5));
        }
        // The peak is not at the nadir.
        let uneven = lamp(100.0, 250.0);
        assert!(is_near(peak_cd(&uneven, 0.5), 125.0) && is_near(nadir_cd(&uneven, 0.5), 50.0));
        // As in the file, and as dimmed as the luminaire.
        assert!(is_near(dimmed(peak_cd, false)(&uneven), 250.0) && is_near(dimmed(peak_cd, true)(&uneven), 125.0));
    }

    #[test]
    fn what_is_zero_or_not_stated_has_no_factor() {
        let dark = lamp(0.0, 0.0);
        assert_eq!([peak_cd(&dark, 1.0), flux_lm(&dark, 1.0), nadir_cd(&dark, 1.0)], [None; 3]);
        let upwards = lamp(0.0, 100.0);
        assert!(nadir_cd(&upwards, 1.0).is_none() && peak_cd(&upwards, 1.0).is_some());
        for lumens in [None, Some(0.0), Some(-1.0)] {
            let mut unstated = lamp(100.0, 100.0);
            Arc::make_mut(&mut unstated.photometry).lamp_lumens = lumens;
            assert_eq!(lamp_lumens(&unstated), None);
        }
    }

    /// The photometry of a file.
    fn read(text: &str) -> Photometry {
        luxproof_photometry::read_by(std::path::Path::new("lamp.ies"), &|_| Ok(text.as_bytes().to_vec())).unwrap()
    }

    #[test]
    fn a_file_has_the_factors_that_are_not_one() {
        let text = "IESNA:LM-63-1995\nTILT=NONE\n3 1000 2 2 1 1 2 0 0 0\n0.9 0.8 100\n0 90\n0\n100 50\n";
        let fields = file_fields(&read(text));
        let expected = [
            ("the candela multiplier", 2.0),
            ("the ballast factor", 0.9),
            ("the ballast-lamp factor", 0.8),
            ("the number of lamps", 3.0),
            ("the product of all multipliers", 1.44),
        ];
        assert_eq!(fields.len(), expected.len(), "{fields:?}");
        for ((name, value), (expected_name, expected_value)) in fields.iter().zip(expected) {
            assert!(*name == expected_name && (value - expected_value).abs() < 1e-12, "{fields:?}");
        }
        let plain = file_fields(&read(&text.replace("3 1000 2 ", "1 1000 1 ").replace("0.9 0.8", "1 1")));
        assert_eq!(plain, []);
        assert_eq!(file_fields(&lamp(100.0, 100.0).photometry), []);
        let mut of_file = lamp(100.0, 100.0);
        of_file.photometry = Arc::new(read(text));
        assert!(is_near(field_of(&of_file, "the ballast factor"), 0.9));
        assert_eq!(field_of(&of_file, "the conversion factor"), None);
    }
}
