//! Reader of EULUMDAT (.ldt) files.
//!
//! Source: A. W. Stockmar, *EULUMDAT - ein Leuchtendatenformat für den europäischen Beleuchtungsplaner*, Licht '90.
//! One value a line. Intensities stand in cd/klm: each is multiplied by the lamp flux in kilolumens and by the
//! conversion factor. The length of a luminaire lies along C90-C270, since C0 looks at its long side.

mod direct_ratios;
mod fields;
mod planes;
mod write;

#[cfg(test)]
mod tests;

use std::borrow::Cow;

use self::fields::Fields;
use super::error::{Problem, ReadError};
use super::lint::Lints;
use super::text::{Text, without_utf16};
use super::{Details, LuminousIntensityDistribution, LuminousOpening, Photometry, Tolerance};

pub(crate) use self::fields::looks_like;
pub use self::write::write;
pub use super::details::{EulumdatDetails, LampSet};

/// The header lines that become keywords: their names in LM-63.
pub(super) const COMPANY: &str = "MANUFAC";
pub(super) const REPORT: &str = "TEST";
pub(super) const NAME: &str = "LUMINAIRE";
pub(super) const NUMBER: &str = "LUMCAT";
pub(super) const FILE: &str = "_EULUMDAT_FILE";
pub(super) const DATE: &str = "ISSUEDATE";

/// Reads a EULUMDAT file.
pub fn parse(bytes: &[u8]) -> Result<Photometry, ReadError> {
    read(bytes, Tolerance::Strict)
}

pub(super) fn read(bytes: &[u8], tolerance: Tolerance) -> Result<Photometry, ReadError> {
    let unicode = without_utf16(bytes);
    let text = Text::new(&unicode);
    let mut lints = Lints::new(tolerance);
    if matches!(unicode, Cow::Owned(_)) {
        lints.note("ldt/utf-16", 1, "the file is UTF-16");
    }
    if text.has_byte_order_mark {
        lints.note("ldt/byte-order-mark", 1, "the file begins with a byte order mark");
    }
    let mut fields = Fields::new(&text, &mut lints);
    let (head, details) = read_head(&mut fields)?;
    let scale = intensity_scale(&details);
    let distribution = read_table(&mut fields, &head, scale)?;
    let repeated = (head.symmetry == 1).then(|| distribution.plane(0));
    fields.finish(distribution.gamma_deg(), repeated, scale)?;
    let set = &details.lamp_sets[0];
    let photometry = Photometry {
        format: "EULUMDAT".into(),
        distribution,
        lamp_lumens: (set.lamps > 0).then_some(set.lumens),
        opening: opening(&details, head.opening_mm),
        input_watts: (set.watts > 0.0).then_some(set.watts),
        keywords: head.keywords,
        details: Details::None,
        lints: vec![],
        source: vec![],
    };
    declared_ratios(&photometry, &details, &mut lints);
    Ok(Photometry { details: Details::Eulumdat(Box::new(details)), ..photometry }.with_lints(lints))
}

/// Candelas per unit of the table: lamp flux in kilolumens times conversion factor.
pub(super) fn intensity_scale(details: &EulumdatDetails) -> f64 {
    details.lamp_sets[0].lumens * details.conversion_factor / 1000.0
}

/// The opening that dimensions in millimetres (length, width) and the luminous heights mean.
fn opening(details: &EulumdatDetails, [length_mm, width_mm]: [f64; 2]) -> LuminousOpening {
    let height_m = details.luminous_heights_mm.into_iter().fold(0.0, f64::max) / 1000.0;
    let (length_m, width_m) = (length_mm / 1000.0, width_mm / 1000.0);
    if length_m == 0.0 && width_m == 0.0 && height_m == 0.0 {
        LuminousOpening::Point
    } else if width_m == 0.0 {
        LuminousOpening::Ellipse { x_m: length_m, y_m: length_m, height_m }
    } else {
        LuminousOpening::Box { x_m: width_m, y_m: length_m, height_m }
    }
}

/// What the head says that is neither kept in [`EulumdatDetails`] nor in the table.
struct Head {
    symmetry: u8,
    planes: usize,
    gammas: usize,
    keywords: Vec<(String, String)>,
    /// Length and width of the luminous area.
    opening_mm: [f64; 2],
}

fn read_head(fields: &mut Fields) -> Result<(Head, EulumdatDetails), ReadError> {
    let mut keywords = vec![];
    let mut keyword = |name: &str, value: String| {
        if !value.is_empty() {
            keywords.push((name.into(), value));
        }
    };
    keyword(COMPANY, fields.text("the company")?);
    let kind = fields.whole("the type indicator Ityp", 0, 3)? as u8;
    let symmetry = fields.whole("the symmetry indicator Isym", 0, 4)? as u8;
    let planes = fields.count("the number of C planes Mc", 1)?;
    fields.number_or("the distance between C planes Dc", 0.0)?;
    let gammas = fields.count("the number of gamma angles Ng", 2)?;
    fields.number_or("the distance between gamma angles Dg", 0.0)?;
    keyword(REPORT, fields.text("the report number")?);
    keyword(NAME, fields.text("the luminaire name")?);
    keyword(NUMBER, fields.text("the luminaire number")?);
    keyword(FILE, fields.text("the file name")?);
    keyword(DATE, fields.text("the date")?);
    let luminaire_mm = fields.zero_if_negative([
        "the length of the luminaire",
        "the width of the luminaire",
        "the height of the luminaire",
    ])?;
    let opening_mm = fields.not_negative(["the length of the luminous area", "the width of the luminous area"])?;
    let luminous_heights_mm = fields.not_negative([
        "the height of the luminous area at C0",
        "the height of the luminous area at C90",
        "the height of the luminous area at C180",
        "the height of the luminous area at C270",
    ])?;
    let [downward_flux_percent, output_ratio_percent] =
        fields.zero_if_negative(["the downward flux fraction DFF", "the light output ratio LORL"])?;
    let conversion_factor = fields.conversion_factor()?;
    let measured_tilt_deg = fields.number_or("the tilt during measurement", 0.0)?;
    let lamp_sets = read_lamp_sets(fields)?;
    let mut direct_ratios = [0.0; 10];
    for ratio in &mut direct_ratios {
        *ratio = fields.number_or("a direct ratio", 0.0)?;
    }
    let details = EulumdatDetails {
        kind,
        luminaire_mm,
        luminous_heights_mm,
        downward_flux_percent,
        output_ratio_percent,
        conversion_factor,
        measured_tilt_deg,
        lamp_sets,
        direct_ratios,
    };
    Ok((Head { symmetry, planes, gammas, keywords, opening_mm }, details))
}

fn read_lamp_sets(fields: &mut Fields) -> Result<Vec<LampSet>, ReadError> {
    let sets = fields.count("the number of lamp sets", 1)?;
    let mut lamp_sets = vec![];
    for _ in 0..sets {
        lamp_sets.push(read_lamp_set(fields)?);
    }
    if sets > 1 {
        let message = format!("{sets} lamp sets are alternatives; the first was taken");
        fields.warn("ldt/lamp-sets", message);
    }
    Ok(lamp_sets)
}

fn read_lamp_set(fields: &mut Fields) -> Result<LampSet, ReadError> {
    Ok(LampSet {
        lamps: fields.lamps()?,
        kind: fields.text("the type of lamps")?,
        lumens: fields.positive("the total flux of the lamps")?,
        colour: fields.text("the colour of the lamps")?,
        rendering: fields.text("the colour rendering of the lamps")?,
        watts: fields.zero_if_negative(["the watts of the lamps"])?[0],
    })
}

/// Angles and intensities, brought to the planes of a distribution.
fn read_table(fields: &mut Fields, head: &Head, scale: f64) -> Result<LuminousIntensityDistribution, ReadError> {
    let c_deg = fields.angles("C", head.planes)?;
    let gamma_deg = fields.angles("gamma", head.gammas)?;
    let stored = planes::stored(head.symmetry, &c_deg).map_err(|problem| fields.error_here(problem))?;
    if !planes::mirrored(head.symmetry, &c_deg) {
        let message = format!("the C planes are no mirror images of each other although Isym is {}", head.symmetry);
        fields.warn("ldt/mirror", message);
    }
    let gammas = gamma_deg.len();
    fields.room_for("the number of intensities", stored.len() * gammas)?;
    let table_line = fields.line();
    let mut candela = Vec::with_capacity((stored.len() + 1) * gammas);
    for &c in &stored {
        for &gamma in &gamma_deg {
            candela.push(fields.intensity(c, gamma, scale)?);
        }
    }
    let (c_deg, candela) = planes::arrange(head.symmetry, stored, candela, gammas);
    LuminousIntensityDistribution::new(c_deg, gamma_deg, candela)
        .map_err(|error| fields.error_at_line(table_line, Problem::Distribution(error)))
}

/// Compares what the file declares of its flux with what its table integrates to.
fn declared_ratios(photometry: &Photometry, details: &EulumdatDetails, lints: &mut Lints) {
    let flux = photometry.distribution.flux().value();
    if flux <= 0.0 {
        return;
    }
    let declared = details.output_ratio_percent;
    let integrated = 100.0 * flux / details.lamp_sets[0].lumens;
    // Files round these numbers to whole percents, and labs integrate by other rules than ours.
    if declared > 0.0 && (integrated - declared).abs() > 1.0 {
        let message =
            format!("the light output ratio is declared as {declared} %, the table integrates to {integrated:.2} %");
        lints.warn("ldt/output-ratio", 0, message);
    }
    let declared = details.downward_flux_percent;
    let integrated = 100.0 * photometry.distribution.flux_between(0.0, 90.0).value() / flux;
    if declared > 0.0 && (integrated - declared).abs() > 1.0 {
        let message = format!(
            "the downward flux fraction is declared as {declared} %, the table integrates to {integrated:.2} %"
        );
        lints.warn("ldt/downward-flux", 0, message);
    }
}
