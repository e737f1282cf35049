//! `luxproof photometry orient FILE`: the orientation of a luminaire by its format and by its light, and turned files.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use luxproof_photometry::lm63::Edition;
use luxproof_photometry::{Lean, Photometry};
use miette::{Report as Diagnostic, miette};
use serde::Serialize;

use super::convert::format_by_extension;
use super::figures::Figure;
use super::{Deny, format_table, read_all, save};
use luxproof_console as console;
use luxproof_model::Exit;
use luxproof_report::words::trimmed;
use luxproof_spec::Trust;

#[derive(Debug, Args)]
pub(super) struct OrientArgs {
    /// A photometric file
    file: PathBuf,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Turn it until its forward direction points to this plane
    #[arg(long, value_enum, value_name = "WHERE", requires = "out", conflicts_with = "turn")]
    to: Option<ForwardTarget>,
    /// Turn it by degrees about its vertical axis, from C 0 towards C 90
    #[arg(long, value_name = "DEG", requires = "out", allow_negative_numbers = true, value_parser = parse_degrees)]
    turn: Option<f64>,
    /// Write the turned luminaire, as .ldt or .ies (LM-63-2019)
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Print warnings, and exit with 1 if there are any
    #[arg(long, value_enum, value_name = "WHAT")]
    deny: Option<Deny>,
}

/// The plane to which forward turns.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum ForwardTarget {
    /// As LM-63 has roadway luminaires
    ForwardC0,
    /// As EULUMDAT has them
    ForwardC90,
    ForwardC180,
    ForwardC270,
}

impl ForwardTarget {
    /// C of the plane in degrees.
    const fn c_deg(self) -> f64 {
        match self {
            Self::ForwardC0 => 0.0,
            Self::ForwardC90 => 90.0,
            Self::ForwardC180 => 180.0,
            Self::ForwardC270 => 270.0,
        }
    }
}

/// Parses an angle up to a full turn.
fn parse_degrees(text: &str) -> Result<f64, String> {
    let degrees: f64 = text.parse().map_err(|_| "it must be a number of degrees".to_owned())?;
    if degrees.abs() <= 360.0 { Ok(degrees) } else { Err("it must lie within -360 and 360".to_owned()) }
}

/// Changes when a key changes its meaning or goes.
const SCHEMA: &str = "luxproof-photometric-orientation/1";

#[derive(Debug, Serialize)]
struct OrientationRecord {
    schema: &'static str,
    file: String,
    format: String,
    forward_c_deg: f64,
    lamp_axis_c_deg: f64,
    source: &'static str,
    lean: Figure<LeanRecord>,
    turned_deg: Option<f64>,
}

#[derive(Debug, Serialize)]
struct LeanRecord {
    /// Of the flux-weighted mean direction; `null` where that is vertical.
    c_deg: Option<f64>,
    gamma_deg: f64,
    /// 1 for a ray, 0 for uniform light.
    strength: f64,
    flux_about_c0_percent: f64,
    flux_about_c90_percent: f64,
    flux_about_c180_percent: f64,
    flux_about_c270_percent: f64,
    flux_up_percent: f64,
}

impl From<Lean> for LeanRecord {
    fn from(lean: Lean) -> Self {
        let [c0, c90, c180, c270] = lean.halves.map(|part| 100.0 * part);
        Self {
            c_deg: lean.c_deg,
            gamma_deg: lean.gamma_deg,
            strength: lean.strength,
            flux_about_c0_percent: c0,
            flux_about_c90_percent: c90,
            flux_about_c180_percent: c180,
            flux_about_c270_percent: c270,
            flux_up_percent: 100.0 * lean.up,
        }
    }
}

/// Runs the command.
pub(super) fn run(args: &OrientArgs, trust: Trust) -> Result<Exit, Diagnostic> {
    let Some(([photometry], exit)) = read_all([&args.file], args.deny, trust) else { return Ok(Exit::Usage) };
    let forward_c_deg = photometry.convention().forward_c_deg;
    let turn_deg = args.to.map(|to| to.c_deg() - forward_c_deg).or(args.turn);
    if args.out.is_some() && turn_deg.is_none() {
        return Err(miette!(
            help = "add --to forward-c0, --to forward-c90 or --turn DEG",
            "--out does not say how to turn"
        ));
    }
    // An unknown output format is refused before anything is printed.
    let written = match (&args.out, turn_deg) {
        (Some(out), Some(turn_deg)) => {
            let (turned, remark) = photometry.turned(turn_deg);
            Some((out, format_by_extension(out, Edition::Lm63_2019)?.write(&turned), remark))
        }
        _ => None,
    };
    let record = OrientationRecord::new(args, &photometry, turn_deg);
    console::print(&if args.json { console::json(&record)? } else { record.text() })?;
    if let Some((out, written, remark)) = written {
        save(out, &written.text, trust)?;
        for loss in remark.iter().chain(&written.losses) {
            console::complain(&format!("{}: {loss}", out.display()));
        }
    }
    Ok(exit)
}

impl OrientationRecord {
    /// Computes the record.
    fn new(args: &OrientArgs, photometry: &Photometry, turned_deg: Option<f64>) -> Self {
        let convention = photometry.convention();
        let lean = photometry.distribution.lean().ok_or("every intensity is zero");
        Self {
            schema: SCHEMA,
            file: args.file.display().to_string(),
            format: photometry.format.clone(),
            forward_c_deg: convention.forward_c_deg,
            lamp_axis_c_deg: convention.lamp_axis_c_deg,
            source: convention.source,
            lean: lean.map(LeanRecord::from).into(),
            turned_deg,
        }
    }

    /// The record as a table.
    fn text(&self) -> String {
        let mut rows = vec![
            ("format", self.format.clone()),
            ("forward", format!("C {}°, across the street and away from houses", self.forward_c_deg)),
            ("lamp axis", format!("C {}°", self.lamp_axis_c_deg)),
            ("source", self.source.to_owned()),
            ("light leans to", self.lean.describe(describe_mean_direction)),
            ("flux about a plane", self.lean.describe(describe_halves)),
        ];
        if let Some(turn) = self.turned_deg {
            rows.push(("turned by", format!("{turn}°, C 0 towards C 90")));
        }
        format_table(&self.file, &rows)
    }
}

/// The flux in the halves about the four planes.
fn describe_halves(lean: &LeanRecord) -> String {
    let [c0, c90] = [lean.flux_about_c0_percent, lean.flux_about_c90_percent].map(|p| format!("{p:.1}"));
    let [c180, c270] = [lean.flux_about_c180_percent, lean.flux_about_c270_percent].map(|p| format!("{p:.1}"));
    format!("C0 {c0} %, C180 {c180} %; C90 {c90} %, C270 {c270} %; up {:.1} %", lean.flux_up_percent)
}

/// The mean direction of the light.
fn describe_mean_direction(lean: &LeanRecord) -> String {
    let (gamma, strength) = (trimmed(lean.gamma_deg, 1), trimmed(lean.strength, 3));
    match lean.c_deg {
        Some(c) => format!("C {}° gamma {gamma}° (mean direction, {strength} of a ray)", trimmed(c, 1)),
        None if lean.strength < 1e-6 => "nowhere: it is the same in all directions".to_owned(),
        None if lean.gamma_deg > 90.0 => format!("straight up (mean direction, {strength} of a ray)"),
        None => format!("straight down (mean direction, {strength} of a ray)"),
    }
}
