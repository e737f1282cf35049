//! The photometric formats, as far as the pack writes them: fields around the table, and the factors of its numbers.

mod eulumdat;
mod gldf;
mod lm63;
mod tm33;

use zip::result::ZipError;

use crate::mistake::{Mistake, Variant};
use crate::pack_file::PackFile;
use crate::table::Table;

pub(crate) use eulumdat::{Eulumdat, LampSet};
pub(crate) use lm63::{Layout, Lm63, Tilt};
pub(crate) use luxproof_photometry::lm63::Edition;
pub(crate) use tm33::Tm33;

/// Square metres in a square foot.
const SQUARE_METRES_PER_SQUARE_FOOT: f64 = 0.3048 * 0.3048;

/// The fields of a file around its table.
#[derive(Clone, Debug)]
pub(crate) enum Document {
    Lm63(Lm63),
    Eulumdat(Eulumdat),
    Tm33(Tm33),
    /// A GLDF container with this file, and one that its product does not refer to.
    Gldf(Eulumdat),
}

impl Document {
    /// Candela per number of the table, as a reader with these mistakes takes it.
    pub(crate) fn factor(&self, table: &Table, mistakes: &[Mistake], variant: Option<Variant>) -> f64 {
        let mut factor = match self {
            Self::Lm63(lm63) => lm63.factor(mistakes, variant),
            Self::Eulumdat(eulumdat) | Self::Gldf(eulumdat) => eulumdat.factor(table, mistakes, variant),
            Self::Tm33(tm33) => tm33.factor(mistakes),
        };
        if mistakes.contains(&Mistake::UnlistedFileRead) && matches!(self, Self::Gldf(_)) {
            factor *= gldf::UNLISTED_FACTOR;
        }
        factor
    }

    /// Whether a mistake can be made in this format.
    pub(crate) fn allows(&self, mistake: Mistake) -> bool {
        match mistake {
            // The other formats label each number, or state one a line.
            Mistake::TableTransposed | Mistake::EvenStepsAssumed => matches!(self, Self::Lm63(_)),
            _ => true,
        }
    }

    /// The format as reports name it.
    pub(crate) fn format(&self) -> &'static str {
        match self {
            Self::Lm63(lm63) => lm63.edition.name(),
            Self::Eulumdat(_) => "EULUMDAT",
            Self::Tm33(_) => "TM-33-23",
            Self::Gldf(_) => "GLDF 1.0",
        }
    }

    /// Rated lumens by each way to count sets of lamps: the first, the last or all of them.
    pub(crate) fn lamp_lumens_of_sets(&self) -> Vec<f64> {
        match self {
            Self::Eulumdat(eulumdat) | Self::Gldf(eulumdat) if eulumdat.sets.len() > 1 => {
                let lumens = eulumdat.sets.iter().map(|set| set.lumens);
                let last = lumens.clone().next_back();
                last.into_iter().chain([lumens.sum()]).chain(self.lamp_lumens()).collect()
            }
            _ => self.lamp_lumens().into_iter().collect(),
        }
    }

    /// Rated lumens of all lamps, where the file has relative photometry.
    pub(crate) fn lamp_lumens(&self) -> Option<f64> {
        match self {
            Self::Lm63(lm63) => (lm63.lumens_per_lamp > 0.0).then_some(f64::from(lm63.lamps) * lm63.lumens_per_lamp),
            Self::Eulumdat(eulumdat) | Self::Gldf(eulumdat) => {
                (eulumdat.sets[0].lamps > 0).then_some(eulumdat.sets[0].lumens)
            }
            Self::Tm33(tm33) => tm33.rated_lumens,
        }
    }

    /// The number of lamps.
    pub(crate) fn lamps(&self) -> u32 {
        match self {
            Self::Lm63(lm63) => lm63.lamps,
            Self::Eulumdat(eulumdat) | Self::Gldf(eulumdat) => eulumdat.sets[0].lamps.unsigned_abs(),
            Self::Tm33(_) => 1,
        }
    }

    /// Whether dimensions are in feet.
    pub(crate) fn is_in_feet(&self) -> bool {
        matches!(self, Self::Lm63(lm63) if lm63.is_in_feet)
    }

    /// Extent of the luminous opening in metres along C 90, along C 0 and upwards.
    pub(crate) fn opening_m(&self) -> Option<[f64; 3]> {
        match self {
            Self::Lm63(lm63) => Some(lm63.opening_m()),
            Self::Eulumdat(_) | Self::Gldf(_) => Some(eulumdat::OPENING_M),
            Self::Tm33(_) => None,
        }
    }

    /// The bytes of the file.
    pub(crate) fn bytes(&self, file: &PackFile) -> Result<Vec<u8>, ZipError> {
        Ok(match self {
            Self::Lm63(lm63) => lm63.text(file).into_bytes(),
            Self::Eulumdat(eulumdat) => eulumdat.text(file, &file.table).into_bytes(),
            Self::Tm33(tm33) => tm33.text(file).into_bytes(),
            Self::Gldf(eulumdat) => gldf::container(eulumdat, file)?,
        })
    }
}

/// A number in its shortest form.
fn number(value: f64) -> String {
    value.to_string()
}

/// Numbers with blanks between them, in lines of at most 80 characters.
fn wrap(numbers: &[f64]) -> String {
    let (mut text, mut width) = (String::new(), 0);
    for value in numbers {
        let number = number(*value);
        if width > 0 && width + 1 + number.len() > 80 {
            text.push_str("\r\n");
            width = 0;
        }
        if width > 0 {
            text.push(' ');
            width += 1;
        }
        width += number.len();
        text.push_str(&number);
    }
    text + "\r\n"
}
