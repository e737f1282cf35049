//! Reader of EULUMDAT (.ldt) files.
//!
//! Source: A. W. Stockmar, *EULUMDAT - ein Leuchtendatenformat für den europäischen Beleuchtungsplaner*, Licht '90.
//! Each line has one value. Intensities are in cd/klm: the reader multiplies each by the lamp flux in kilolumens and by the
//! conversion factor. The length of a luminaire lies along C90-C270, since C0 faces its long side.

mod direct_ratios;
mod fields;
mod planes;
mod write;

#[cfg(test)]
mod tests;

use std::borrow::Cow;

use self::fields::Fields;
use super::error::{Problem, ReadError};
use super::header_lints::{self, Header};
use super::lint::Lints;
use super::planes::check_lit_ends;
use super::text::{Text, without_utf16};
use super::{Details, LuminousIntensityDistribution, LuminousOpening, Photometry, Tolerance};

pub(crate) use self::fields::looks_like;
pub use self::write::write;
pub use super::details::{EulumdatDetails, LampSet};

/// The LM-63 keywords of the header lines.
pub(super) const COMPANY: &str = "MANUFAC";
pub(super) const REPORT: &str = "TEST";
pub(super) const NAME: &str = "LUMINAIRE";
pub(super) const NUMBER: &str = "LUMCAT";
pub(super) const FILE: &str = "_EULUMDAT_FILE";
pub(super) const DATE: &str = "ISSUEDATE";

/// Direct ratios of manufacturers differ by some hundredths, because the method leaves the arrangement open.
const MAX_RATIO_DIFFERENCE: f64 = 0.1;
/// Files round their angles.
const MAX_STEP_DIFFERENCE_DEG: f64 = 0.06;

/// Reads a EULUMDAT file.
pub fn parse(bytes: &[u8]) -> Result<Photometry, ReadError> {
    read(bytes, Tolerance::Strict)
}

/// Reads a EULUMDAT file with a tolerance for damage.
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
    check_head(&head, &details, fields.lints());
    let scale = intensity_scale(&details);
    let distribution = read_table(&mut fields, &head, scale)?;
    let repeated = (head.symmetry == 1).then(|| distribution.plane(0));
    fields.finish(distribution.gamma_deg(), repeated, scale)?;
    let set = &details.lamp_sets[0];
    let photometry = Photometry {
        format: "EULUMDAT".into(),
        distribution,
        lamp_lumens: (set.lamps > 0).then_some(set.lumens),
        opening: build_opening(&details, head.opening_mm),
        input_watts: (set.watts > 0.0).then_some(set.watts),
        keywords: head.keywords.clone(),
        details: Details::None,
        lints: vec![],
        source: vec![],
    };
    check_declared_ratios(&photometry, &details, &head.lines, &mut lints);
    let header = Header {
        texts: photometry
            .keywords
            .iter()
            .zip(&head.keyword_lines)
            .map(|((k, t), line)| (&k[..], &t[..], *line))
            .collect(),
        distribution: &photometry.distribution,
        lamp_lumens: photometry.lamp_lumens,
        watts: photometry.input_watts,
        records: None,
        lamp_line: head.lines.lamps,
    };
    header_lints::check(&header, &mut lints);
    Ok(Photometry { details: Details::Eulumdat(Box::new(details)), ..photometry }.with_lints(lints))
}

/// Candelas per unit of the table: lamp flux in kilolumens times conversion factor.
pub(super) fn intensity_scale(details: &EulumdatDetails) -> f64 {
    details.lamp_sets[0].lumens * details.conversion_factor / 1000.0
}

/// Builds the opening from its length and width in millimetres and the luminous heights.
fn build_opening(details: &EulumdatDetails, [length_mm, width_mm]: [f64; 2]) -> LuminousOpening {
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

/// The fields of the head that are not in [`EulumdatDetails`].
struct Head {
    symmetry: u8,
    planes: usize,
    gammas: usize,
    keywords: Vec<(String, String)>,
    /// Length and width of the luminous area.
    opening_mm: [f64; 2],
    /// The distances between C planes and between gamma angles; 0 where they are not even.
    steps_deg: [f64; 2],
    /// The line of each keyword.
    keyword_lines: Vec<usize>,
    lines: HeadLines,
}

/// Lines of the head that lints name.
#[derive(Default)]
struct HeadLines {
    kind: usize,
    steps: [usize; 2],
    opening: usize,
    downward_flux: usize,
    output_ratio: usize,
    conversion_factor: usize,
    tilt: usize,
    /// The flux of the first lamp set.
    lamps: usize,
    direct_ratios: usize,
}

/// Reads all lines before the angles.
fn read_head(fields: &mut Fields) -> Result<(Head, EulumdatDetails), ReadError> {
    let mut lines = HeadLines::default();
    let mut keywords: Vec<(String, String)> = vec![(COMPANY.into(), fields.text("the company")?)];
    let mut keyword_lines = vec![fields.line()];
    let kind = fields.whole("the type indicator Ityp", 0, 3)? as u8;
    lines.kind = fields.line();
    let symmetry = fields.whole("the symmetry indicator Isym", 0, 4)? as u8;
    let planes = fields.count("the number of C planes Mc", 1)?;
    let c_step_deg = fields.number_or("the distance between C planes Dc", 0.0)?;
    lines.steps[0] = fields.line();
    let gammas = fields.count("the number of gamma angles Ng", 2)?;
    let gamma_step_deg = fields.number_or("the distance between gamma angles Dg", 0.0)?;
    lines.steps[1] = fields.line();
    for (keyword, what) in [
        (REPORT, "the report number"),
        (NAME, "the luminaire name"),
        (NUMBER, "the luminaire number"),
        (FILE, "the file name"),
        (DATE, "the date"),
    ] {
        keywords.push((keyword.into(), fields.text(what)?));
        keyword_lines.push(fields.line());
    }
    (keywords, keyword_lines) =
        keywords.into_iter().zip(keyword_lines).filter(|((_, text), _)| !text.is_empty()).unzip();
    let luminaire_mm = fields.zero_if_negative([
        "the length of the luminaire",
        "the width of the luminaire",
        "the height of the luminaire",
    ])?;
    let opening_mm = fields.not_negative(["the length of the luminous area", "the width of the luminous area"])?;
    lines.opening = fields.line() - 1;
    let luminous_heights_mm = fields.not_negative([
        "the height of the luminous area at C0",
        "the height of the luminous area at C90",
        "the height of the luminous area at C180",
        "the height of the luminous area at C270",
    ])?;
    let [downward_flux_percent, output_ratio_percent] =
        fields.zero_if_negative(["the downward flux fraction DFF", "the light output ratio LORL"])?;
    (lines.downward_flux, lines.output_ratio) = (fields.line() - 1, fields.line());
    let conversion_factor = fields.conversion_factor()?;
    lines.conversion_factor = fields.line();
    let measured_tilt_deg = fields.number_or("the tilt during measurement", 0.0)?;
    lines.tilt = fields.line();
    // The number of sets, then the number and the type of lamps.
    lines.lamps = fields.line() + 4;
    let lamp_sets = read_lamp_sets(fields)?;
    let mut direct_ratios = [0.0; 10];
    lines.direct_ratios = fields.line() + 1;
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
    let steps_deg = [c_step_deg, gamma_step_deg];
    Ok((Head { symmetry, planes, gammas, keywords, opening_mm, steps_deg, keyword_lines, lines }, details))
}

/// Reads all lamp sets.
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

/// Reads one lamp set.
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

/// Reads angles and intensities and arranges them as a distribution.
fn read_table(fields: &mut Fields, head: &Head, scale: f64) -> Result<LuminousIntensityDistribution, ReadError> {
    let c_deg = fields.angles("C", head.planes)?;
    let gamma_deg = fields.angles("gamma", head.gammas)?;
    let stored = planes::stored_planes(head.symmetry, &c_deg).map_err(|problem| fields.error_here(problem))?;
    if !planes::are_planes_mirrored(head.symmetry, &c_deg) {
        let message = format!("the C planes are no mirror images of each other although Isym is {}", head.symmetry);
        fields.warn("ldt/mirror", message);
    }
    let gammas = gamma_deg.len();
    fields.room_for("the number of intensities", stored.len() * gammas)?;
    check_steps(head, &c_deg, &gamma_deg, fields.lints());
    let table_line = fields.line();
    let mut candela = Vec::with_capacity((stored.len() + 1) * gammas);
    for &c in &stored {
        for &gamma in &gamma_deg {
            candela.push(fields.intensity(c, gamma, scale)?);
        }
    }
    check_lit_ends(&gamma_deg, &candela, table_line, fields.lints());
    let (c_deg, candela) = planes::arrange_planes(head.symmetry, stored, candela, gammas);
    LuminousIntensityDistribution::new(c_deg, gamma_deg, candela)
        .map_err(|error| fields.error_at_line(table_line, Problem::Distribution(error)))
}

/// Compares the declared flux ratios with those of the table.
fn check_declared_ratios(photometry: &Photometry, details: &EulumdatDetails, lines: &HeadLines, lints: &mut Lints) {
    let flux = photometry.distribution.flux().value();
    if flux <= 0.0 {
        return;
    }
    let declared = details.output_ratio_percent;
    let integrated = 100.0 * flux / details.lamp_sets[0].lumens;
    // Files round these numbers to whole percents, and laboratories integrate by other rules.
    if declared > 0.0 && (integrated - declared).abs() > 1.0 {
        let message =
            format!("the light output ratio is declared as {declared} %, the table integrates to {integrated:.2} %");
        lints.warn("ldt/output-ratio", lines.output_ratio, message);
    }
    let declared = details.downward_flux_percent;
    let integrated = 100.0 * photometry.distribution.flux_between(0.0, 90.0).value() / flux;
    if declared > 0.0 && (integrated - declared).abs() > 1.0 {
        let message = format!(
            "the downward flux fraction is declared as {declared} %, the table integrates to {integrated:.2} %"
        );
        lints.warn("ldt/downward-flux", lines.downward_flux, message);
    }
    let stated = details.direct_ratios;
    if stated.iter().all(|ratio| *ratio == 0.0) {
        return;
    }
    let Some(computed) = direct_ratios::direct_ratios(&photometry.distribution) else { return };
    let pairs = stated.iter().zip(computed).zip(direct_ratios::ROOM_INDICES);
    let worst = pairs.max_by(|a, b| (a.0.0 - a.0.1).abs().total_cmp(&(b.0.0 - b.0.1).abs()));
    if let Some(((stated, computed), k)) =
        worst.filter(|((stated, computed), _)| (*stated - computed).abs() > MAX_RATIO_DIFFERENCE)
    {
        let message = format!("the direct ratio for k = {k} is declared as {stated}, the table gives {computed:.3}");
        // No intensity depends on it.
        lints.note("ldt/direct-ratios", lines.direct_ratios, message);
    }
}

/// Reports numbers of the head that contradict each other, or that a reader may apply otherwise.
fn check_head(head: &Head, details: &EulumdatDetails, lints: &mut Lints) {
    let lines = &head.lines;
    if details.kind == 1 && head.symmetry != 1 {
        let message =
            format!("Ityp 1 is a source with symmetry about the vertical axis, and Isym is {}", head.symmetry);
        lints.note("ldt/type", lines.kind, message);
    }
    if details.conversion_factor != 1.0 {
        let factor = details.conversion_factor;
        let message = format!("the conversion factor {factor} multiplies every intensity; many programs ignore it");
        lints.warn("ldt/conversion-factor", lines.conversion_factor, message);
    }
    if details.measured_tilt_deg != 0.0 {
        let tilt = details.measured_tilt_deg;
        let message =
            format!("the luminaire was measured with a tilt of {tilt} degrees; the intensities are not turned back");
        lints.warn("ldt/measured-tilt", lines.tilt, message);
    }
    let [length_mm, width_mm, _] = details.luminaire_mm;
    let [long_mm, wide_mm] = head.opening_mm;
    // A round body has width 0.
    let body_mm = [length_mm, if width_mm == 0.0 { length_mm } else { width_mm }];
    let opening_mm = [long_mm, if wide_mm == 0.0 { long_mm } else { wide_mm }];
    let is_larger = |k: usize| body_mm[k] > 0.0 && opening_mm[k] > 1.01 * body_mm[k];
    if is_larger(0) || is_larger(1) {
        let message = format!(
            "the luminous area of {long_mm} x {wide_mm} mm is larger than the luminaire of {length_mm} x {width_mm} mm"
        );
        lints.warn("ldt/opening", lines.opening, message);
    }
}

/// Compares the distances between angles that the head declares with the angles.
fn check_steps(head: &Head, c_deg: &[f64], gamma_deg: &[f64], lints: &mut Lints) {
    let all = [("ldt/plane-step", "C planes Dc", c_deg), ("ldt/gamma-step", "gamma angles Dg", gamma_deg)];
    for (k, (code, what, angles)) in all.into_iter().enumerate() {
        let declared = head.steps_deg[k];
        let found =
            angles.windows(2).map(|w| w[1] - w[0]).find(|step| (step - declared).abs() > MAX_STEP_DIFFERENCE_DEG);
        if let Some(found) = found.filter(|_| declared > 0.0) {
            let message =
                format!("the distance between {what} is declared as {declared}, and angles are {found} apart");
            lints.warn(code, head.lines.steps[k], message);
        }
    }
}
