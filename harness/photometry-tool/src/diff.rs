//! `luxproof photometry diff A B`: the difference of two files over all directions.

use std::path::{Path, PathBuf};

use clap::Args;
use luxproof_photometry::{Beam, Departure, Difference, Likeness, Photometry};
use maud::html;
use miette::Report as Diagnostic;
use serde::Serialize;

use super::figures::Figure;
use super::web::{STYLE, Web};
use super::{Deny, format_table, read_all, save};
use luxproof_console as console;
use luxproof_model::Exit;
use luxproof_report::svg::{line, number, text};
use luxproof_report::words::significant;
use luxproof_spec::Trust;

#[derive(Debug, Args)]
pub(super) struct DiffArgs {
    /// The first file
    first: PathBuf,
    /// The file to compare with it
    second: PathBuf,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Draw a map of the differences
    #[arg(long, value_name = "SVG")]
    svg: Option<PathBuf>,
    /// Print warnings, and exit with 1 if there are any
    #[arg(long, value_enum, value_name = "WHAT")]
    deny: Option<Deny>,
}

/// Changes when a key changes its meaning or goes.
const SCHEMA: &str = "luxproof-photometric-difference/1";

#[derive(Debug, Serialize)]
struct DifferenceRecord {
    schema: &'static str,
    files: [String; 2],
    /// `equal`, `equal within rounding` or `different`.
    verdict: &'static str,
    flux_lm: [f64; 2],
    flux_difference_lm: f64,
    peaks: [Figure<PeakRecord>; 2],
    largest_difference: Place,
    rms_difference_cd: f64,
    /// Relative to the larger of both largest intensities.
    rms_difference_percent: Option<f64>,
    /// Last printed digit of each table; `null` where it is unknown.
    printed_digit_cd: [Option<f64>; 2],
    /// Whether the largest difference is exact: every angle of one table was combined with every angle of the other.
    is_exhaustive: bool,
}

#[derive(Debug, Serialize)]
struct PeakRecord {
    c_deg: f64,
    gamma_deg: f64,
    peak_cd: f64,
}

#[derive(Debug, Serialize)]
struct Place {
    c_deg: f64,
    gamma_deg: f64,
    first_cd: f64,
    second_cd: f64,
    difference_cd: f64,
    difference_percent: Option<f64>,
}

/// Runs the command.
pub(super) fn run(args: &DiffArgs, trust: Trust) -> Result<Exit, Diagnostic> {
    let files = [args.first.as_path(), &args.second];
    let Some((pair, exit)) = read_all(files, args.deny, trust) else { return Ok(Exit::Usage) };
    let difference = Difference::between(&pair[0], &pair[1]);
    let record = DifferenceRecord::new(files, &pair, &difference);
    console::print(&if args.json { console::json(&record)? } else { record.text() })?;
    if let Some(out) = &args.svg {
        save(out, &draw_map(&pair, &difference), trust)?;
    }
    Ok(if difference.likeness == Likeness::Different { Exit::Failed } else { exit })
}

/// The name of a verdict.
const fn verdict(likeness: Likeness) -> &'static str {
    match likeness {
        Likeness::Equal => "equal",
        Likeness::WithinRounding => "equal within rounding",
        Likeness::Different => "different",
    }
}

impl From<Beam> for PeakRecord {
    fn from(beam: Beam) -> Self {
        Self { c_deg: beam.peak_deg[0], gamma_deg: beam.peak_deg[1], peak_cd: beam.peak.value() }
    }
}

impl DifferenceRecord {
    /// Computes the record.
    fn new(files: [&Path; 2], pair: &[Photometry; 2], difference: &Difference) -> Self {
        let flux_lm = pair.each_ref().map(|p| p.distribution.flux().value());
        let at: Departure = difference.largest;
        // Without light there is no peak to relate to.
        let [difference_percent, rms_difference_percent] = [at.change_cd(), difference.rms_cd]
            .map(|cd| (difference.peak_cd > 0.0).then(|| 100.0 * cd / difference.peak_cd));
        Self {
            schema: SCHEMA,
            files: files.map(|file| file.display().to_string()),
            verdict: verdict(difference.likeness),
            flux_lm,
            flux_difference_lm: flux_lm[1] - flux_lm[0],
            peaks: pair.each_ref().map(|p| p.distribution.beam().map(PeakRecord::from).into()),
            largest_difference: Place {
                c_deg: at.c_deg,
                gamma_deg: at.gamma_deg,
                first_cd: at.first_cd,
                second_cd: at.second_cd,
                difference_cd: at.change_cd(),
                difference_percent,
            },
            rms_difference_cd: difference.rms_cd,
            rms_difference_percent,
            printed_digit_cd: difference.steps_cd,
            is_exhaustive: difference.is_exhaustive,
        }
    }

    /// The record as a table.
    fn text(&self) -> String {
        let [first, second] = &self.files;
        let [first_peak, second_peak] = self.peaks.each_ref().map(|peak| peak.describe(describe_peak));
        let [first_digit, second_digit] = self.printed_digit_cd.map(describe_digit);
        let at = &self.largest_difference;
        let place = format!("at C {:.3}° gamma {:.3}°", at.c_deg, at.gamma_deg);
        let values = format!("{} -> {} cd", significant(at.first_cd), significant(at.second_cd));
        let largest_percent = describe_percent_of_peak(at.difference_percent);
        let rms_percent = describe_percent_of_peak(self.rms_difference_percent);
        let mut rows = vec![
            ("flux", describe_flux(self.flux_lm)),
            ("largest intensity", format!("{first_peak}; {second_peak}")),
            ("largest difference", format!("{values} {place}{largest_percent}")),
            ("rms difference", format!("{} cd{rms_percent}", significant(self.rms_difference_cd))),
            ("last printed digits", format!("{first_digit} and {second_digit}")),
        ];
        if !self.is_exhaustive {
            rows.push((
                "note",
                "the tables are too large, or of types A or B, to look at each angle of one with every angle of the other".to_owned(),
            ));
        }
        format_table(&format!("{first} and {second}: {}", self.verdict), &rows)
    }
}

/// Both fluxes and their relative difference.
fn describe_flux([first, second]: [f64; 2]) -> String {
    let percent = if first > 0.0 { format!(" ({:+.4} %)", 100.0 * (second - first) / first) } else { String::new() };
    format!("{first:.2} and {second:.2} lm{percent}")
}

/// The largest intensity of one file.
fn describe_peak(peak: &PeakRecord) -> String {
    format!("{} cd at C {:.2}° gamma {:.2}°", significant(peak.peak_cd), peak.c_deg, peak.gamma_deg)
}

/// A difference relative to the peak, as the end of a phrase.
fn describe_percent_of_peak(percent: Option<f64>) -> String {
    percent.map_or(String::new(), |percent| format!(", {percent:+.4} % of the peak"))
}

/// The last printed digit of one file.
fn describe_digit(digit_cd: Option<f64>) -> String {
    digit_cd.map_or("unknown".to_owned(), |cd| format!("{} cd", significant(cd)))
}

/// Side of a cell of the map in degrees.
const CELL_DEG: f64 = 3.0;
/// A difference below this fraction of the largest is white.
const WHITE_FRACTION: f64 = 1e-3;

/// The middles of cells between two angles.
fn cell_middles_deg(from: f64, to: f64) -> Vec<f64> {
    (0..((to - from) / CELL_DEG) as u32).map(|k| from + CELL_DEG * (f64::from(k) + 0.5)).collect()
}

/// The colour of a difference in parts of the largest one; `None` for white.
fn shade(part: f64) -> Option<String> {
    let (full, faded) = ((255.0 - 25.0 * part.abs()) as u8, (255.0 * (1.0 - part.abs())) as u8);
    if part.abs() <= WHITE_FRACTION {
        return None;
    }
    let [red, green, blue] = if part > 0.0 { [full, faded, faded] } else { [faded, faded, full] };
    Some(format!("#{red:02x}{green:02x}{blue:02x}"))
}

/// Draws a map of the differences: red where the second file has more, blue where it has less.
fn draw_map(pair: &[Photometry; 2], difference: &Difference) -> String {
    let [first, second] = pair.each_ref().map(|p| &p.distribution);
    let has_light_above = pair.iter().any(|p| p.distribution.flux_between(90.0, 180.0).value() > 0.0);
    let web = Web::new(has_light_above || difference.largest.gamma_deg > 90.0);
    let (c_deg, gamma_deg) = (cell_middles_deg(-180.0, 180.0), cell_middles_deg(0.0, web.gamma_end_deg()));
    let [a, b] = [first, second].map(|d| d.intensities(&c_deg, &gamma_deg));
    let most = difference.largest.change_cd().abs();
    let parts = a.iter().zip(&b).map(|(a, b)| if most > 0.0 { ((b - a) / most).clamp(-1.0, 1.0) } else { 0.0 });
    let colours: Vec<Option<String>> = parts.map(shade).collect();
    let [width, height] = web.size(30.0);
    let half = CELL_DEG / 2.0;
    let Departure { c_deg: worst_c, gamma_deg: worst_gamma, .. } = difference.largest;
    let [x, y] = web.place(if worst_c > 180.0 { worst_c - 360.0 } else { worst_c }, worst_gamma);
    let legend = format!(
        "red: the second has more, blue: less; full colour {} cd, at the cross (C {worst_c:.2}° gamma {worst_gamma:.2}°)",
        significant(most)
    );
    let svg = html! {
        svg xmlns="http://www.w3.org/2000/svg" viewBox={ "0 0 " (width) " " (height) } font-family="sans-serif" font-size="11" {
            style { (STYLE) ".cross{stroke:#000;stroke-width:1.5}" }
            rect width=(width) height=(height) fill="#ffffff" {}
            (text("title", "middle", [width / 2.0, 20.0], verdict(difference.likeness)))
            @for (j, gamma) in gamma_deg.iter().enumerate() { @for (i, c) in c_deg.iter().enumerate() {
                @if let Some(colour) = &colours[j * c_deg.len() + i] {
                    @let ([left, bottom], [right, top]) = (web.place(c - half, gamma - half), web.place(c + half, gamma + half));
                    rect x=(number(left)) y=(number(top)) width=(number(right - left)) height=(number(bottom - top)) fill=(colour) {}
                }
            } }
            (web.grid())
            @if most > 0.0 {
                (line("cross", [x - 5.0, y - 5.0], [x + 5.0, y + 5.0]))
                (line("cross", [x - 5.0, y + 5.0], [x + 5.0, y - 5.0]))
            }
            (text("tick", "middle", [width / 2.0, height - 12.0], &legend))
        }
    };
    svg.into_string() + "\n"
}
