//! `luxproof photometry diff A B`: how two files differ, direction by direction.

use std::path::{Path, PathBuf};

use clap::Args;
use luminaire::photometry::{Departure, Difference, Likeness, Photometry};
use maud::html;
use miette::Report as Diagnostic;
use serde::Serialize;

use super::figures::Figure;
use super::web::{STYLE, Web};
use super::{Deny, read_all, save};
use crate::cli;
use crate::report::Exit;
use crate::report::svg::{line, number, text};
use crate::report::words::significant;
use crate::spec::Trust;

#[derive(Debug, Args)]
pub(super) struct DiffArgs {
    /// The file that differences count from
    first: PathBuf,
    /// The file held against it
    second: PathBuf,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Draw a map of the differences
    #[arg(long, value_name = "SVG")]
    svg: Option<PathBuf>,
    /// Exit with 1 where a file has warnings, and print them
    #[arg(long, value_enum, value_name = "WHAT")]
    deny: Option<Deny>,
}

/// Changes when a key changes its meaning or goes.
const SCHEMA: &str = "luxproof-photometric-difference/1";

#[derive(Debug, Serialize)]
struct Record {
    schema: &'static str,
    files: [String; 2],
    /// `equal`, `equal within rounding` or `different`.
    verdict: &'static str,
    flux_lm: [f64; 2],
    flux_difference_lm: f64,
    peaks: [Figure<Highest>; 2],
    largest_difference: Place,
    rms_difference_cd: f64,
    /// Of the larger of both largest intensities.
    rms_difference_percent: Option<f64>,
    /// Last printed digit of each table; `null` where it cannot be told.
    printed_digit_cd: [Option<f64>; 2],
    /// Whether the largest difference is exact; else every angle of both was looked at, but not each with every other.
    is_exhaustive: bool,
}

#[derive(Debug, Serialize)]
struct Highest {
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

pub(super) fn run(args: &DiffArgs, trust: Trust) -> Result<Exit, Diagnostic> {
    let files = [args.first.as_path(), &args.second];
    let Some((pair, exit)) = read_all(files, args.deny, trust) else { return Ok(Exit::Usage) };
    let difference = Difference::between(&pair[0], &pair[1]);
    let record = Record::of(files, &pair, &difference);
    cli::print(&if args.json { cli::json(&record)? } else { record.text() })?;
    if let Some(out) = &args.svg {
        save(out, &map(&pair, &difference))?;
    }
    Ok(if difference.likeness == Likeness::Different { Exit::Failed } else { exit })
}

const fn verdict(likeness: Likeness) -> &'static str {
    match likeness {
        Likeness::Equal => "equal",
        Likeness::WithinRounding => "equal within rounding",
        Likeness::Different => "different",
    }
}

impl Record {
    fn of(files: [&Path; 2], pair: &[Photometry; 2], difference: &Difference) -> Self {
        let flux_lm = pair.each_ref().map(|p| p.distribution.flux().value());
        let peak = |p: &Photometry| {
            let beam = p.distribution.beam();
            Figure::from(beam.map(|b| Highest {
                c_deg: b.peak_deg[0],
                gamma_deg: b.peak_deg[1],
                peak_cd: b.peak.value(),
            }))
        };
        let percent = |cd: f64| (difference.peak_cd > 0.0).then(|| 100.0 * cd / difference.peak_cd);
        let at: Departure = difference.largest;
        Self {
            schema: SCHEMA,
            files: files.map(|file| file.display().to_string()),
            verdict: verdict(difference.likeness),
            flux_lm,
            flux_difference_lm: flux_lm[1] - flux_lm[0],
            peaks: pair.each_ref().map(peak),
            largest_difference: Place {
                c_deg: at.c_deg,
                gamma_deg: at.gamma_deg,
                first_cd: at.first_cd,
                second_cd: at.second_cd,
                difference_cd: at.change_cd(),
                difference_percent: percent(at.change_cd()),
            },
            rms_difference_cd: difference.rms_cd,
            rms_difference_percent: percent(difference.rms_cd),
            printed_digit_cd: difference.steps_cd,
            is_exhaustive: difference.is_exhaustive,
        }
    }

    fn text(&self) -> String {
        let [first, second] = &self.files;
        let mut text = format!("{first} and {second}: {}\n", self.verdict);
        let mut row = |name: &str, value: String| text.push_str(&format!("  {name:<20} {value}\n"));
        let relative = |part: f64, whole: f64| {
            if whole > 0.0 { format!(" ({:+.4} %)", 100.0 * part / whole) } else { String::new() }
        };
        let [a, b] = self.flux_lm;
        row("flux", format!("{a:.2} and {b:.2} lm{}", relative(b - a, a)));
        let peak = |peak: &Figure<Highest>| {
            peak.told(|p| format!("{} cd at C {:.2}° gamma {:.2}°", significant(p.peak_cd), p.c_deg, p.gamma_deg))
        };
        row("largest intensity", format!("{}; {}", peak(&self.peaks[0]), peak(&self.peaks[1])));
        let at = &self.largest_difference;
        let percent = |value: Option<f64>| value.map_or(String::new(), |p| format!(", {p:+.4} % of the peak"));
        let place = format!("at C {:.3}° gamma {:.3}°", at.c_deg, at.gamma_deg);
        let values = format!("{} -> {} cd", significant(at.first_cd), significant(at.second_cd));
        row("largest difference", format!("{values} {place}{}", percent(at.difference_percent)));
        row(
            "rms difference",
            format!("{} cd{}", significant(self.rms_difference_cd), percent(self.rms_difference_percent)),
        );
        let digit = |step: Option<f64>| step.map_or("unknown".to_owned(), |cd| format!("{} cd", significant(cd)));
        row(
            "last printed digits",
            format!("{} and {}", digit(self.printed_digit_cd[0]), digit(self.printed_digit_cd[1])),
        );
        if !self.is_exhaustive {
            row(
                "note",
                "the tables are too large, or of types A or B, to look at each angle of one with every angle of the other".to_owned(),
            );
        }
        text
    }
}

/// Side of a cell of the map in degrees.
const CELL_DEG: f64 = 3.0;
/// A difference of less than this part of the largest is white.
const WHITE: f64 = 1e-3;

/// Differences in percent of the largest one, red where the second file has more, blue where it has less.
fn map(pair: &[Photometry; 2], difference: &Difference) -> String {
    let [first, second] = pair.each_ref().map(|p| &p.distribution);
    let has_light_above = |p: &Photometry| p.distribution.flux_between(90.0, 180.0).value() > 0.0;
    let web = Web::new(pair.iter().any(has_light_above) || difference.largest.gamma_deg > 90.0);
    let middles = |from: f64, to: f64| -> Vec<f64> {
        (0..((to - from) / CELL_DEG) as u32).map(|k| from + CELL_DEG * (f64::from(k) + 0.5)).collect()
    };
    let (c_deg, gamma_deg) = (middles(-180.0, 180.0), middles(0.0, web.gamma_end_deg()));
    let [a, b] = [first, second].map(|d| d.intensities(&c_deg, &gamma_deg));
    let most = difference.largest.change_cd().abs();
    let shade = |k: usize| {
        let part = if most > 0.0 { ((b[k] - a[k]) / most).clamp(-1.0, 1.0) } else { 0.0 };
        let (full, faded) = ((255.0 - 25.0 * part.abs()) as u8, (255.0 * (1.0 - part.abs())) as u8);
        (part.abs() > WHITE).then(|| {
            if part > 0.0 {
                format!("#{full:02x}{faded:02x}{faded:02x}")
            } else {
                format!("#{faded:02x}{faded:02x}{full:02x}")
            }
        })
    };
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
                @if let Some(colour) = shade(j * c_deg.len() + i) {
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
