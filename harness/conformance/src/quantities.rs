//! Numbers besides the intensities: flux, lamp lumens, opening.

use serde::Serialize;

use crate::expected::Flux;
use crate::pack_file::PackFile;
use crate::submission::FileAnswer;

/// How far a flux may be outside its bounds, and lumens from the file's, as a part of it.
const RELATIVE_TOLERANCE: f64 = 1e-3;
/// How far an extent may be off, in metres: files round feet.
const TOLERANCE_M: f64 = 1e-3;

/// A wrong number besides the intensities.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case", tag = "is")]
pub enum QuantityFault {
    /// The flux is that of the stored planes alone.
    FluxOfStoredPlanes,
    /// The flux is that of the lamps.
    FluxOfLamps,
    /// The flux is outside what any interpolation can give.
    Flux {
        /// The answer.
        answer_lm: f64,
        /// The bounds.
        expected_lm: [f64; 2],
    },
    /// The lamp lumens are those of one lamp.
    LumensOfOneLamp,
    /// Other lamp lumens than the file's.
    LampLumens {
        /// The answer.
        answer_lm: f64,
        /// The file's; none for absolute photometry.
        expected_lm: Option<f64>,
    },
    /// Feet were taken as metres.
    FeetAsMetres,
    /// Width and length are exchanged.
    WidthAndLengthSwapped,
    /// Another opening than the file's.
    Opening {
        /// The answer.
        answer_m: [f64; 3],
        /// The file's.
        expected_m: [f64; 3],
    },
}

impl QuantityFault {
    /// What is wrong, in one sentence.
    pub fn sentence(&self) -> String {
        match self {
            Self::FluxOfStoredPlanes => {
                "The flux is that of the stored planes alone: the mirrored ones have flux, too.".into()
            }
            Self::FluxOfLamps => "The flux is that of the lamps: integrate the table.".into(),
            Self::Flux { answer_lm, expected_lm: [least, most] } => {
                format!("The flux is {answer_lm} lm; every interpolation gives from {least:.1} to {most:.1} lm.")
            }
            Self::LumensOfOneLamp => "The lamp lumens are those of one lamp: multiply by the number of lamps.".into(),
            Self::LampLumens { answer_lm, expected_lm: Some(expected) } => {
                format!("The lamp lumens are {answer_lm}; the file says {expected}.")
            }
            Self::LampLumens { answer_lm, expected_lm: None } => {
                format!("The lamp lumens are {answer_lm}; absolute photometry has none.")
            }
            Self::FeetAsMetres => "The opening is in feet: units type 1 is feet, 0.3048 m each.".into(),
            Self::WidthAndLengthSwapped => {
                "Width and length of the opening are exchanged: in LM-63 the width lies along C 90, in EULUMDAT the length."
                    .into()
            }
            Self::Opening { answer_m, expected_m } => {
                format!("The opening is {answer_m:?} m; the file says {expected_m:?} m.")
            }
        }
    }
}

/// The wrong ones of the numbers that an answer states.
///
/// `flux_factor` is the flux of the reader's variant per expected flux; without it no flux is judged.
pub(crate) fn find_quantity_faults(
    file: &PackFile,
    answer: &FileAnswer,
    flux_factor: Option<f64>,
) -> Vec<QuantityFault> {
    let flux = answer.flux_lm.zip(flux_factor).and_then(|(flux, factor)| find_flux_fault(file, flux, factor));
    let lumens = answer.lamp_lumens.and_then(|lumens| find_lumens_fault(file, lumens));
    let opening = answer.opening_m.and_then(|opening| find_opening_fault(file, opening));
    [flux, lumens, opening].into_iter().flatten().collect()
}

/// Whether two numbers are equal up to rounding.
fn is_same(a: f64, b: f64) -> bool {
    (a - b).abs() <= RELATIVE_TOLERANCE * b.abs()
}

fn find_flux_fault(file: &PackFile, answer_lm: f64, factor: f64) -> Option<QuantityFault> {
    let [least, linear, most] = Flux::of(file).bounds().map(|lumens| factor * lumens);
    if (least * (1.0 - RELATIVE_TOLERANCE)..=most * (1.0 + RELATIVE_TOLERANCE)).contains(&answer_lm) {
        return None;
    }
    let copies = file.table.solid_integral().copies;
    if copies > 1.0 && is_same(answer_lm, linear / copies) {
        return Some(QuantityFault::FluxOfStoredPlanes);
    }
    if file.document.lamp_lumens().is_some_and(|lumens| is_same(answer_lm, lumens)) {
        return Some(QuantityFault::FluxOfLamps);
    }
    Some(QuantityFault::Flux { answer_lm, expected_lm: [least, most] })
}

fn find_lumens_fault(file: &PackFile, answer_lm: f64) -> Option<QuantityFault> {
    let expected_lm = file.document.lamp_lumens();
    if file.document.lamp_lumens_of_sets().into_iter().any(|expected| is_same(answer_lm, expected)) {
        return None;
    }
    let of_one = expected_lm.is_some_and(|expected| is_same(answer_lm * f64::from(file.document.lamps()), expected));
    Some(if of_one { QuantityFault::LumensOfOneLamp } else { QuantityFault::LampLumens { answer_lm, expected_lm } })
}

fn find_opening_fault(file: &PackFile, answer_m: [f64; 3]) -> Option<QuantityFault> {
    let expected_m = file.document.opening_m()?;
    let is_opening = |other: [f64; 3]| answer_m.iter().zip(other).all(|(a, b)| (a - b).abs() <= TOLERANCE_M);
    let [width, length, height] = expected_m;
    if is_opening(expected_m) {
        return None;
    }
    if file.document.is_in_feet() && is_opening(expected_m.map(|extent| extent / 0.3048)) {
        return Some(QuantityFault::FeetAsMetres);
    }
    if is_opening([length, width, height]) {
        return Some(QuantityFault::WidthAndLengthSwapped);
    }
    Some(QuantityFault::Opening { answer_m, expected_m })
}
