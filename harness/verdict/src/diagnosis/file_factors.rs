//! Kinds of wrong factors of a luminaire: those that follow from its table, and the fields of its file.

use std::f64::consts::PI;

use itertools::Itertools;
use luxproof_photometry::{Details, Photometry};
use luxproof_scene::Luminaire;

use super::fault::Fault;
use luxproof_spec::procedures::Task;

/// A factor on the light of a luminaire; `None` where there is none to get wrong.
type FactorOf = fn(&Luminaire) -> Option<f64>;

/// Factors that normalised tables have. A renderer that normalises has one of them, and all luminaires have their own.
const TABLE_FACTORS: [(&str, FactorOf); 12] = [
    ("the table is divided by its peak", |l| Some(peak_cd(l)?.recip())),
    ("the table is divided by its flux", |l| Some(flux_lm(l)?.recip())),
    ("the table is scaled to a flux of 1000 lm", |l| Some(1000.0 / flux_lm(l)?)),
    ("the table is scaled to a peak of 1000 cd", |l| Some(1000.0 / peak_cd(l)?)),
    ("the table is divided by its value at the nadir", |l| Some(nadir_cd(l)?.recip())),
    ("the table is scaled by flux over peak", |l| Some(flux_lm(l)? / peak_cd(l)?)),
    ("the table is scaled by peak over flux", |l| Some(peak_cd(l)? / flux_lm(l)?)),
    ("the table is scaled by its flux", flux_lm),
    ("the table is scaled by its peak", peak_cd),
    ("the table is divided by its mean intensity, flux/(4 pi)", |l| Some(4.0 * PI / flux_lm(l)?)),
    ("the table is scaled by lamp lumens over its flux", |l| Some(lamp_lumens(l)? / flux_lm(l)?)),
    ("the table is scaled by flux/(pi peak)", |l| Some(flux_lm(l)? / (PI * peak_cd(l)?))),
];

fn peak_cd(luminaire: &Luminaire) -> Option<f64> {
    Some(luminaire.photometry.distribution.max_intensity().value()).filter(|peak| *peak > 0.0)
}

fn flux_lm(luminaire: &Luminaire) -> Option<f64> {
    Some(luminaire.photometry.distribution.flux().value()).filter(|flux| *flux > 0.0)
}

fn nadir_cd(luminaire: &Luminaire) -> Option<f64> {
    Some(luminaire.photometry.distribution.intensity(0.0, 0.0).value()).filter(|candela| *candela > 0.0)
}

fn lamp_lumens(luminaire: &Luminaire) -> Option<f64> {
    luminaire.photometry.lamp_lumens.filter(|lumens| *lumens > 0.0)
}

/// Factors on luminaires that follow from their tables or their files.
pub(super) fn luminaire_factors(cases: &[&[Task]]) -> Vec<Fault> {
    let mut all = vec![];
    for (what, factor) in TABLE_FACTORS {
        all.push(factor_fault(what.to_owned(), factor));
        all.push(factor_fault(format!("{what}, and all by factor {{0:}}"), factor).with_free_factor());
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
