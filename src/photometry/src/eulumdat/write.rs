//! Writer of EULUMDAT files.

use super::direct_ratios::direct_ratios;
use super::{COMPANY, DATE, EulumdatDetails, FILE, LampSet, NAME, NUMBER, REPORT, intensity_scale, parse, planes};
use crate::write::{invert, number, one_line, write_in_type_c};
use crate::{Details, FileFormat, LuminousIntensityDistribution, LuminousOpening, Photometry, Symmetry, Written};

/// Writes EULUMDAT.
///
/// Intensities become cd/klm of the lamp flux, or of the luminaire's flux for absolute photometry. Where a number exists
/// that the reader takes back to the same candela, the file has that number.
pub fn write(photometry: &Photometry) -> Written {
    let details = choose_details(photometry);
    let scale = intensity_scale(&details);
    let text =
        write_in_type_c(photometry, scale, |distribution| format_file(photometry, &details, scale, distribution));
    let mut written = Written::checked(photometry, text, FileFormat::Eulumdat, parse);
    if !matches!(photometry.details, Details::Eulumdat(_)) {
        written.notes.extend(computed_field_notes(photometry));
    }
    written
}

/// Formats the whole file.
fn format_file(
    photometry: &Photometry,
    details: &EulumdatDetails,
    scale: f64,
    distribution: &LuminousIntensityDistribution,
) -> String {
    let table = StoredTable::from_distribution(distribution);
    let gamma_deg = table.stored.gamma_deg();
    let mut lines: Vec<String> = vec![];
    lines.push(keyword_line(photometry, COMPANY));
    lines.extend([details.kind.to_string(), table.symmetry.to_string()]);
    lines.extend([table.listed_deg.len().to_string(), number(spacing(&table.listed_deg, 360.0))]);
    lines.extend([gamma_deg.len().to_string(), number(spacing(gamma_deg, f64::NAN))]);
    lines.extend([REPORT, NAME, NUMBER, FILE, DATE].map(|name| keyword_line(photometry, name)));
    lines.extend(details.luminaire_mm.map(number));
    lines.extend(opening_mm(&photometry.opening).map(number));
    lines.extend(details.luminous_heights_mm.map(number));
    lines.extend([details.downward_flux_percent, details.output_ratio_percent].map(number));
    lines.extend([details.conversion_factor, details.measured_tilt_deg].map(number));
    lines.push(details.lamp_sets.len().to_string());
    for set in &details.lamp_sets {
        lines.extend([set.lamps.to_string(), one_line(&set.kind), number(set.lumens)]);
        lines.extend([one_line(&set.colour), one_line(&set.rendering), number(set.watts)]);
    }
    lines.extend(details.direct_ratios.map(number));
    lines.extend(table.listed_deg.iter().copied().map(number));
    lines.extend(gamma_deg.iter().copied().map(number));
    for &plane in &table.order {
        lines.extend(table.stored.plane(plane).iter().map(|i| number(invert(*i, i / scale, |x| x * scale))));
    }
    let mut text = lines.join("\r\n");
    text.push_str("\r\n");
    text
}

/// The line of a keyword, empty where the photometry lacks it.
fn keyword_line(photometry: &Photometry, name: &str) -> String {
    one_line(photometry.keyword(name).unwrap_or_default())
}

/// The planes in the order and selection of a EULUMDAT file.
struct StoredTable {
    symmetry: u8,
    /// All planes of the circle.
    listed_deg: Vec<f64>,
    stored: LuminousIntensityDistribution,
    /// The stored planes in the order of the file.
    order: Vec<usize>,
}

impl StoredTable {
    /// Chooses the symmetry indicator that stores the fewest planes.
    fn from_distribution(distribution: &LuminousIntensityDistribution) -> Self {
        let full = distribution.full_circle();
        let listed_deg: Vec<f64> = full.c_deg().iter().copied().filter(|c| *c < 360.0).collect();
        let planes = distribution.c_deg().len();
        let forward: Vec<usize> = (0..planes).collect();
        let (symmetry, order) = match distribution.symmetry() {
            Symmetry::Quadrant => (4, forward),
            Symmetry::BilateralC0 => (2, forward),
            // The file begins with C 270.
            Symmetry::BilateralC90 => (3, forward.into_iter().rev().collect()),
            Symmetry::None if planes > 2 => return Self::without_symmetry(full, listed_deg),
            Symmetry::Axial | Symmetry::None => {
                return Self { symmetry: 1, listed_deg: vec![0.0], stored: distribution.clone(), order: vec![0] };
            }
        };
        // The planes of some symmetric tables have no place in the format.
        match planes::stored_planes(symmetry, &listed_deg) {
            Ok(stored) if stored.len() == planes => Self { symmetry, listed_deg, stored: distribution.clone(), order },
            _ => Self::without_symmetry(full, listed_deg),
        }
    }

    /// All planes of the circle.
    fn without_symmetry(full: LuminousIntensityDistribution, listed_deg: Vec<f64>) -> Self {
        let order = (0..listed_deg.len()).collect();
        Self { symmetry: 0, listed_deg, stored: full, order }
    }
}

/// The distance between evenly spaced angles, or 0; `end` is the place of the angle after the last one.
fn spacing(angles: &[f64], end: f64) -> f64 {
    let [first, second, ..] = angles else { return 0.0 };
    let step = second - first;
    let even = angles.windows(2).all(|w| w[1] - w[0] == step);
    let closes = end.is_nan() || angles[angles.len() - 1] + step == end;
    if even && closes { step } else { 0.0 }
}

/// The millimetres that the reader takes back to exactly these metres.
fn millimetres(metres: f64) -> f64 {
    invert(metres, metres * 1000.0, |mm| mm / 1000.0)
}

/// Length and width of the luminous area; a round area has no width.
fn opening_mm(opening: &LuminousOpening) -> [f64; 2] {
    match *opening {
        LuminousOpening::Point => [0.0, 0.0],
        LuminousOpening::Ellipse { x_m, y_m, .. } | LuminousOpening::Ellipsoid { x_m, y_m, .. } if x_m == y_m => {
            [millimetres(x_m), 0.0]
        }
        ref other => {
            let [width_m, length_m, _] = other.bounding_box_m();
            // LM-63's width lies along C90, EULUMDAT's along C0.
            [millimetres(width_m), millimetres(length_m)]
        }
    }
}

/// The details of the source file where they still agree with the photometry, else computed ones.
fn choose_details(photometry: &Photometry) -> EulumdatDetails {
    let [.., height_m] = photometry.opening.bounding_box_m();
    let mut details = match &photometry.details {
        Details::Eulumdat(details) => details.as_ref().clone(),
        Details::None | Details::Lm63(_) => computed_details(photometry),
    };
    if details.luminous_heights_mm.into_iter().fold(0.0, f64::max) / 1000.0 != height_m {
        details.luminous_heights_mm = [millimetres(height_m); 4];
    }
    let watts = photometry.input_watts.unwrap_or(0.0);
    let flux = photometry.distribution.flux().value();
    let agrees = details.lamp_sets.first().is_some_and(|set| {
        set.watts == watts && photometry.lamp_lumens.map_or(set.lamps < 0, |l| set.lamps > 0 && set.lumens == l)
    });
    if !agrees {
        let lamps = match (&photometry.details, photometry.lamp_lumens) {
            (_, None) => -1,
            (Details::Lm63(details), Some(_)) => i32::try_from(details.lamps).unwrap_or(1),
            (_, Some(_)) => 1,
        };
        // The table of a dark luminaire needs a flux as a divisor too.
        let lumens = photometry.lamp_lumens.unwrap_or(if flux > 0.0 { flux } else { 1000.0 });
        let kind = photometry.keyword("LAMP").unwrap_or_default().to_string();
        let set = LampSet { lamps, kind, lumens, colour: String::new(), rendering: String::new(), watts };
        details.lamp_sets = vec![set];
    }
    details
}

/// A part in percent to two decimals; 0 of nothing.
fn percent(part: f64, whole: f64) -> f64 {
    if whole > 0.0 { (1e4 * part / whole).round() / 100.0 } else { 0.0 }
}

/// The details of a photometry that comes from no EULUMDAT file.
fn computed_details(photometry: &Photometry) -> EulumdatDetails {
    let distribution = &photometry.distribution;
    let flux = distribution.flux().value();
    let [width_m, length_m, height_m] = photometry.opening.bounding_box_m();
    let is_linear = width_m.max(length_m) > 4.0 * width_m.min(length_m);
    EulumdatDetails {
        kind: match distribution.symmetry() {
            Symmetry::Axial => 1,
            _ if is_linear => 2,
            _ => 3,
        },
        luminaire_mm: [width_m, length_m, height_m].map(|m| (m * 1000.0).round()),
        luminous_heights_mm: [0.0; 4],
        downward_flux_percent: percent(distribution.flux_between(0.0, 90.0).value(), flux),
        output_ratio_percent: percent(flux, photometry.lamp_lumens.unwrap_or(flux)),
        conversion_factor: 1.0,
        measured_tilt_deg: 0.0,
        lamp_sets: vec![],
        direct_ratios: direct_ratios(distribution).unwrap_or_default(),
    }
}

/// Notes on the fields that photometry from another format lacks.
fn computed_field_notes(photometry: &Photometry) -> Vec<String> {
    let ratios = if photometry.distribution.flux().value() > 0.0 {
        "downward flux fraction, light output ratio and direct ratios were computed from the table, the last for luminaires \
         evenly spread over a square room"
    } else {
        "downward flux fraction, light output ratio and direct ratios are 0: without light there are none"
    };
    let unknown = "the luminaire's own dimensions are not known (those of its opening were written), nor are its lamps' colour \
                   and colour rendering (left blank)";
    vec![ratios.into(), unknown.into()]
}
