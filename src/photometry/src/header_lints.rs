//! Lints of headers that contradict the numbers of their file.
//!
//! A header is free text. Only texts that state a quantity with its unit, and keywords that name one, are compared.
//! Sources of the keywords: LM-63-1995 to 2019 and the user keywords (`[_TOTALLUMINAIRELUMENS]` and the like) of
//! common writers.

use crate::lint::Lints;
use crate::{LuminousIntensityDistribution, Symmetry};

/// A keyword that names a flux states it this exactly: laboratories integrate by other rules than we do.
const STATED_TOLERANCE: f64 = 0.02;
/// A product name or remark states a nominal flux.
const NOMINAL_TOLERANCE: f64 = 0.2;
/// Rated power against measured power.
const WATTS_TOLERANCE: f64 = 0.1;
/// No luminaire for lighting is more efficacious: the maximum of white light is about 350 lm/W (Murphy 2012).
const MAX_LM_PER_W: f64 = 350.0;
/// Planes that should be equal differ by less than this part of the peak.
const SYMMETRY_TOLERANCE: f64 = 0.05;
/// Less light than this part of the lamps' leaves no luminaire: the table is in other units than its multiplier says.
const MIN_OUTPUT_RATIO: f64 = 0.05;
/// A ballast factor outside this range is a misplaced number.
pub(crate) const BALLAST_FACTORS: std::ops::RangeInclusive<f64> = 0.2..=1.5;
/// Characters of a header text that a message quotes.
const QUOTED: usize = 60;

/// The texts of a header with their lines, and the numbers of the file that they may contradict.
pub(crate) struct Header<'a> {
    /// Keyword, text and line.
    pub(crate) texts: Vec<(&'a str, &'a str, usize)>,
    pub(crate) distribution: &'a LuminousIntensityDistribution,
    /// Lumens of all lamps together; `None` for absolute photometry.
    pub(crate) lamp_lumens: Option<f64>,
    pub(crate) watts: Option<f64>,
    /// The numbers of an LM-63 file.
    pub(crate) records: Option<LampNumbers>,
    /// The line of the numbers on lamps.
    pub(crate) lamp_line: usize,
}

/// Numbers of the two records of an LM-63 file.
#[derive(Clone, Copy)]
pub(crate) struct LampNumbers {
    pub(crate) lamps: u32,
    pub(crate) lumens_per_lamp: f64,
    pub(crate) multiplier: f64,
    pub(crate) ballast_factor: f64,
    pub(crate) ballast_line: usize,
}

/// What a text states a flux of.
#[derive(Clone, Copy, PartialEq, Eq)]
enum FluxOf {
    Luminaire,
    Lamp,
}

/// A number in a text with the word behind it, in lower case.
struct StatedNumber {
    value: f64,
    unit: String,
    /// Whether an `x` follows, as in `2 x 36 W`.
    is_count: bool,
}

impl StatedNumber {
    fn is_flux(&self) -> bool {
        matches!(self.unit.as_str(), "lm" | "lumen" | "lumens" | "klm")
    }
}

/// Reports all contradictions.
pub(crate) fn check(header: &Header<'_>, lints: &mut Lints) {
    let flux_lm = header.distribution.flux().value();
    for (key, text, line) in &header.texts {
        let name: String = key.chars().filter(char::is_ascii_alphanumeric).collect::<String>().to_ascii_uppercase();
        check_units(text, *line, lints);
        if name == "NEARFIELD" {
            let message = format!(
                "the photometry is near-field (`{}`): the inverse-square law does not apply to it at other distances",
                shorten(text)
            );
            lints.warn("header/near-field", *line, message);
        }
        if name == "DISTRIBUTION" {
            check_symmetry(header.distribution, text, *line, lints);
        }
        if flux_lm > 0.0 {
            check_lumens(header, flux_lm, &name, text, *line, lints);
            check_watts(header, flux_lm, &name, text, *line, lints);
        }
        check_records(header, &name, text, *line, lints);
    }
    if flux_lm > 0.0 {
        check_plausibility(header, flux_lm, lints);
    }
}

/// Warns of radiometric and other units: the formats know candela alone.
fn check_units(text: &str, line: usize, lints: &mut Lints) {
    let lower = text.to_lowercase();
    let units = ["w/sr", "watt/sr", "radiometric", "\u{b5}mol", "\u{3bc}mol", "umol/s", "w/m^2", "w/m2", "mw/cm"];
    if let Some(unit) = units.iter().find(|unit| lower.contains(**unit)) {
        let message = format!(
            "the header names `{unit}` (`{}`): these intensities are not candela, and no figure in lm, lx or cd applies",
            shorten(text)
        );
        lints.warn("header/units", line, message);
    }
}

/// Compares a stated symmetry with that of the table.
fn check_symmetry(distribution: &LuminousIntensityDistribution, text: &str, line: usize, lints: &mut Lints) {
    let lower = text.to_lowercase();
    let states = |words: &[&str]| words.iter().any(|word| lower.contains(word));
    let detected = distribution.detected_symmetry(SYMMETRY_TOLERANCE);
    let is_contradicted = if states(&["asymmetric", "no symmetry", "without symmetry"]) {
        // A luminaire without symmetry needs more than one plane.
        distribution.symmetry() == Symmetry::Axial
    } else if states(&["axial", "axially", "rotational", "radial"]) {
        detected != Symmetry::Axial
    } else if states(&["quad"]) {
        !matches!(detected, Symmetry::Axial | Symmetry::Quadrant)
    } else {
        states(&["bilateral"]) && detected == Symmetry::None
    };
    if is_contradicted {
        let message = format!(
            "the header states `{}`; the table is {} within {} % of its peak",
            shorten(text),
            symmetry_name(detected),
            100.0 * SYMMETRY_TOLERANCE
        );
        lints.warn("header/symmetry", line, message);
    }
}

const fn symmetry_name(symmetry: Symmetry) -> &'static str {
    match symmetry {
        Symmetry::Axial => "axially symmetric",
        Symmetry::Quadrant => "symmetric in quadrants",
        Symmetry::BilateralC0 | Symmetry::BilateralC90 => "bilaterally symmetric",
        Symmetry::None => "not symmetric",
    }
}

/// Compares stated lumens with the table and with the lamps.
fn check_lumens(header: &Header<'_>, flux_lm: f64, name: &str, text: &str, line: usize, lints: &mut Lints) {
    let is_flux_key =
        (name.contains("LUMEN") || name.contains("FLUX") || name.ends_with("LM")) && !name.contains("LUMENSPERW");
    let lower = text.to_lowercase();
    let is_lamp = name.contains("LAMP") || lower.contains("lamp") || lower.contains("bare");
    let of = if is_lamp { FluxOf::Lamp } else { FluxOf::Luminaire };
    let numbers = numbers(text);
    let stated = match numbers.iter().find(|number| number.is_flux()) {
        Some(number) if number.unit == "klm" => Some(1000.0 * number.value),
        Some(number) => Some(number.value),
        None if is_flux_key => numbers.first().map(|number| number.value),
        None => None,
    };
    let Some(stated) = stated.filter(|lm| *lm > 0.0) else { return };
    // A remark, a product or a catalogue number has a nominal flux.
    let is_nominal = !is_flux_key && of == FluxOf::Luminaire;
    let tolerance = if is_nominal { NOMINAL_TOLERANCE } else { STATED_TOLERANCE };
    let is_equal = |a: f64, b: f64| (a / b - 1.0).abs() <= tolerance;
    match of {
        FluxOf::Luminaire if !is_equal(flux_lm, stated) => {
            // A remark may mean the lamps.
            if is_nominal && header.lamp_lumens.is_some_and(|lamps| is_equal(lamps, stated)) {
                return;
            }
            let ratio = flux_lm / stated;
            let message = format!(
                "the header states {stated} lm of the luminaire, the table integrates to {flux_lm:.1} lm, {ratio:.3} times as much{}",
                explain(header, ratio)
            );
            lints.warn("header/stated-lumens", line, message);
        }
        FluxOf::Lamp => {
            let message = match (header.lamp_lumens, header.records) {
                (Some(all), records) => {
                    let each = records.map_or(all, |r| r.lumens_per_lamp);
                    let is_known = is_equal(all, stated) || is_equal(each, stated);
                    (!is_known).then(|| format!("the header states {stated} lm of the lamps, the lamp record {all} lm"))
                }
                (None, _) => (flux_lm > (1.0 + STATED_TOLERANCE) * stated).then(|| {
                    let ratio = flux_lm / stated;
                    format!(
                        "the header states {stated} lm of the lamps, the table integrates to {flux_lm:.1} lm, {ratio:.3} times as much{}",
                        explain(header, ratio)
                    )
                }),
            };
            if let Some(message) = message {
                lints.warn("header/lamp-lumens", line, message);
            }
        }
        FluxOf::Luminaire => (),
    }
}

/// Names the factor that a ratio is, if it is a usual one.
fn explain(header: &Header<'_>, ratio: f64) -> String {
    let records = header.records.map_or(vec![], |r| {
        vec![
            (r.multiplier, "the candela multiplier"),
            (r.ballast_factor, "the ballast factor"),
            (f64::from(r.lamps), "the number of lamps"),
        ]
    });
    let usual = [
        (2.0, "two, as of one half of the planes"),
        (4.0, "four, as of one quarter of the planes"),
        (1000.0, "a thousand, as of kilolumens"),
        (10.764, "10.76, as of footcandles"),
        (std::f64::consts::PI, "pi"),
    ];
    let is_it = |factor: f64| {
        factor != 1.0 && [factor, 1.0 / factor].iter().any(|f| (ratio / f - 1.0).abs() <= STATED_TOLERANCE)
    };
    let found = records.into_iter().chain(usual).find(|(factor, _)| is_it(*factor));
    found.map_or(String::new(), |(_, name)| format!("; the ratio is {name}"))
}

/// Compares stated power and efficacy with the input watts.
fn check_watts(header: &Header<'_>, flux_lm: f64, name: &str, text: &str, line: usize, lints: &mut Lints) {
    let Some(watts) = header.watts else { return };
    let numbers = numbers(text);
    let is_watt_key =
        (name.contains("WATT") || name.ends_with("POWER") || name == "INPUTPOWER") && !name.contains("PERWATT");
    let stated = numbers.iter().find(|number| number.unit == "w" || number.unit.starts_with("watt"));
    if let Some(number) = stated.or(numbers.first()).filter(|_| is_watt_key)
        && number.value > 0.0
        && (number.value / watts - 1.0).abs() > WATTS_TOLERANCE
    {
        let message =
            format!("the header states {} W, the file {watts} W; the efficacy follows the latter", number.value);
        lints.warn("header/stated-watts", line, message);
    }
    let is_efficacy_key = name.contains("EFFICACY") || name.contains("LUMENSPERW") || name.contains("PERWATT");
    let efficacy =
        numbers.iter().find(|number| ["lm/w", "lumens/w", "lumens/watt", "lpw"].contains(&number.unit.as_str()));
    if let Some(number) = efficacy.or(numbers.first().filter(|_| is_efficacy_key))
        && number.value > 0.0
        && (flux_lm / watts / number.value - 1.0).abs() > WATTS_TOLERANCE
    {
        let found = flux_lm / watts;
        let message = format!("the header states {} lm/W, flux over input watts is {found:.1} lm/W", number.value);
        lints.warn("header/stated-efficacy", line, message);
    }
}

/// Compares stated lamps and ballast factors with the records of an LM-63 file.
fn check_records(header: &Header<'_>, name: &str, text: &str, line: usize, lints: &mut Lints) {
    let Some(records) = header.records else { return };
    let numbers = numbers(text);
    let count = numbers.first().filter(|number| number.is_count && number.value.fract() == 0.0);
    if let Some(count) = count.filter(|_| name == "LAMP" && header.lamp_lumens.is_some())
        && count.value != f64::from(records.lamps)
    {
        let message = format!("the header states {} lamps, the lamp record {}", count.value, records.lamps);
        lints.warn("header/lamp-count", line, message);
    }
    let lower = text.to_lowercase();
    let is_named = name == "BALLASTFACTOR" || name == "BF";
    let behind = ["ballast factor", "bf=", "bf:", "bf "].iter().find_map(|word| Some(lower.split_once(word)?.1));
    let stated = if is_named {
        numbers.first().map(|n| n.value)
    } else {
        behind.and_then(|t| Some(self::numbers(t).first()?.value))
    };
    if let Some(stated) = stated.filter(|bf| BALLAST_FACTORS.contains(bf))
        && (stated / records.ballast_factor - 1.0).abs() > 0.005
    {
        let message = format!(
            "the header states a ballast factor of {stated}, the record {}, which multiplies every intensity",
            records.ballast_factor
        );
        lints.warn("header/ballast-factor", line, message);
    }
}

/// Checks the numbers of a file against each other.
fn check_plausibility(header: &Header<'_>, flux_lm: f64, lints: &mut Lints) {
    let line = header.lamp_line;
    if let Some(watts) = header.watts.filter(|watts| flux_lm / watts > MAX_LM_PER_W) {
        let message = format!(
            "{flux_lm:.1} lm of {watts} W are {:.0} lm/W; white light has at most about {MAX_LM_PER_W}",
            flux_lm / watts
        );
        lints.warn("header/efficacy", line, message);
    }
    let Some(LampNumbers { multiplier, ballast_factor, ballast_line, .. }) = header.records else { return };
    if let Some(ratio) = header.lamp_lumens.map(|lamps| flux_lm / lamps).filter(|ratio| *ratio < MIN_OUTPUT_RATIO) {
        let message = format!(
            "the intensities integrate to {flux_lm:.1} lm, {:.2} % of the lamps' flux: does a multiplier lack?",
            100.0 * ratio
        );
        lints.warn("header/output-ratio", line, message);
    }
    if header.lamp_lumens.is_none() && ballast_factor != 1.0 {
        let message = format!(
            "absolute photometry includes the ballast, and the ballast factor is {ballast_factor}; it multiplies every intensity"
        );
        lints.warn("header/ballast-factor", ballast_line, message);
    } else if !BALLAST_FACTORS.contains(&ballast_factor) {
        let message =
            format!("the ballast factor is {ballast_factor} and multiplies every intensity; usual are 0.7 to 1.2");
        lints.warn("header/ballast-factor", ballast_line, message);
    }
    let exceeds = header.lamp_lumens.filter(|lamps| flux_lm > 1.01 * lamps && flux_lm / multiplier <= 1.01 * lamps);
    if let Some(lamps) = exceeds {
        let message = format!(
            "with the candela multiplier {multiplier} the flux is {flux_lm:.1} lm, more than the lamps' {lamps} lm; without it {:.1} lm",
            flux_lm / multiplier
        );
        lints.warn("header/multiplier", line, message);
    }
}

/// The numbers of a text with their units.
fn numbers(text: &str) -> Vec<StatedNumber> {
    let chars: Vec<char> = text.chars().collect();
    let (mut found, mut k) = (vec![], 0);
    while k < chars.len() {
        let begins_word = k == 0 || !(chars[k - 1].is_alphanumeric() || ['-', '.', '/', '_'].contains(&chars[k - 1]));
        if !(chars[k].is_ascii_digit() && begins_word) {
            k += 1;
            continue;
        }
        let start = k;
        while k < chars.len()
            && (chars[k].is_ascii_digit()
                || ((chars[k] == '.' || chars[k] == ',') && chars.get(k + 1).is_some_and(char::is_ascii_digit)))
        {
            k += 1;
        }
        let Some(value) = parse_number(&chars[start..k].iter().collect::<String>()) else { continue };
        while k < chars.len() && chars[k] == ' ' {
            k += 1;
        }
        let unit_start = k;
        while k < chars.len() && (chars[k].is_alphabetic() || chars[k] == '/') {
            k += 1;
        }
        let unit = chars[unit_start..k].iter().collect::<String>().to_lowercase();
        let is_count = unit == "x" || unit == "\u{d7}" || chars.get(k) == Some(&'\u{d7}');
        found.push(StatedNumber { value, unit, is_count });
    }
    found
}

/// Parses a number with a decimal point or comma, or with commas between thousands.
fn parse_number(text: &str) -> Option<f64> {
    let parts: Vec<&str> = text.split(',').collect();
    let is_grouped =
        parts.len() > 1 && parts[1..].iter().all(|part| part.split('.').next().is_some_and(|p| p.len() == 3));
    let plain = if is_grouped { text.replace(',', "") } else { text.replacen(',', ".", 1) };
    plain.parse().ok().filter(|value: &f64| value.is_finite())
}

/// The first line of a text, shortened.
fn shorten(text: &str) -> String {
    let line = text.lines().next().unwrap_or_default();
    let short: String = line.chars().take(QUOTED).collect();
    if short.len() < line.len() { format!("{short}...") } else { short }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(text: &str) -> Vec<(f64, String)> {
        numbers(text).into_iter().map(|n| (n.value, n.unit)).collect()
    }

    #[test]
    fn numbers_of_a_text_have_their_units() {
        assert_eq!(found("1218 lm,14 W"), [(1218.0, "lm".into()), (14.0, "w".into())]);
        assert_eq!(found("3,200.5 lumens"), [(3200.5, "lumens".into())]);
        assert_eq!(found("1234,5lm 120 lm/W"), [(1234.5, "lm".into()), (120.0, "lm/w".into())]);
        assert_eq!(found("PNL-6060-36W LM79"), []);
        assert!(numbers("2 x 36 W")[0].is_count);
    }
}
