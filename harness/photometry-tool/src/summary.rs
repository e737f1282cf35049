//! The summary of a photometric file as text and as JSON.

use std::fmt;
use std::path::Path;

use luxproof_photometry::units::Lumen;
use luxproof_photometry::{Lint, LuminousOpening, Photometry, Symmetry};
use luxproof_process::printable::quoted;
use serde::Serialize;
use serde_json::json;

use super::figures::{BeamRecord, Figure, SpacingRecord, Width, beam_record, flux_code, spacing_record};
use super::{format_table, severity_name};

/// The main numbers of a photometric file.
#[derive(Debug, Serialize)]
pub(super) struct Summary {
    file: String,
    format: String,
    luminaire: Option<String>,
    flux_lm: f64,
    flux_up_lm: f64,
    flux_down_lm: f64,
    max_cd: f64,
    symmetry: &'static str,
    /// The symmetry of the values.
    detected_symmetry: &'static str,
    /// For types A and B, the two fields below are the horizontal and vertical angles of the file.
    #[serde(rename = "type")]
    goniometer: String,
    c_planes: Angles,
    gamma: Angles,
    lamp_lumens: Option<f64>,
    /// Luminaire flux over lamp flux.
    output_ratio: Option<f64>,
    input_watts: Option<f64>,
    /// Luminaire flux over input power.
    efficacy_lm_per_w: Option<f64>,
    opening: String,
    /// Width (along C90), length (along C0), height.
    opening_m: [f64; 3],
    /// In the vertical plane through the beam axis and across it.
    beam_angle_deg: [Figure<f64>; 2],
    field_angle_deg: [Figure<f64>; 2],
    spacing_criterion: Figure<SpacingRecord>,
    cie_flux_code: Figure<[f64; 5]>,
    bug_zones_lm: BugZones,
    lint: Vec<serde_json::Value>,
}

/// Flux in the zones of the Luminaire Classification System (TM-15), from low to very high.
#[derive(Debug, Serialize)]
struct BugZones {
    back: [f64; 4],
    up: [f64; 2],
    forward: [f64; 4],
}

#[derive(Debug, Serialize)]
struct Angles {
    count: usize,
    first_deg: f64,
    last_deg: f64,
    /// `null` where they are not evenly spaced.
    step_deg: Option<f64>,
}

impl Summary {
    pub(super) fn of(file: &Path, photometry: &Photometry) -> Self {
        let distribution = &photometry.distribution;
        let (flux, max) = (distribution.flux(), distribution.max_intensity());
        let (beam_angle_deg, field_angle_deg) = full_angles_deg(&beam_record(distribution));
        let [horizontal, vertical] = distribution.file_angles_deg();
        Self {
            file: file.display().to_string(),
            format: photometry.format.clone(),
            luminaire: photometry.keyword("LUMINAIRE").or(photometry.keyword("LUMCAT")).map(str::to_owned),
            flux_lm: flux.value(),
            flux_up_lm: distribution.flux_between(90.0, 180.0).value(),
            flux_down_lm: distribution.flux_between(0.0, 90.0).value(),
            max_cd: max.value(),
            symmetry: name(distribution.symmetry()),
            detected_symmetry: name(distribution.detected_symmetry(1e-9)),
            goniometer: format!("{:?}", distribution.goniometer()),
            c_planes: Angles::of(&horizontal),
            gamma: Angles::of(&vertical),
            lamp_lumens: photometry.lamp_lumens,
            output_ratio: photometry.lamp_lumens.map(|lumens| flux.value() / lumens),
            input_watts: photometry.input_watts,
            efficacy_lm_per_w: photometry.input_watts.map(|watts| flux.value() / watts),
            opening: describe_opening(&photometry.opening),
            opening_m: photometry.opening.bounding_box_m(),
            beam_angle_deg,
            field_angle_deg,
            spacing_criterion: spacing_record(distribution),
            cie_flux_code: flux_code(photometry),
            bug_zones_lm: BugZones::of(photometry),
            lint: photometry.lints.iter().map(lint_record).collect(),
        }
    }
}

/// A lint as JSON.
fn lint_record(lint: &Lint) -> serde_json::Value {
    json!({"code": lint.code, "severity": severity_name(lint.severity), "line": lint.line, "message": lint.message})
}

/// The full beam and field angles, in the vertical plane through the beam axis and across it.
fn full_angles_deg(beam: &Figure<BeamRecord>) -> ([Figure<f64>; 2], [Figure<f64>; 2]) {
    let full_deg = |select: fn(&BeamRecord) -> &Figure<Width>| {
        beam.and_then(|beam| select(beam).and_then(|width| Figure::Is(width.full_deg)))
    };
    let beam_angles = [full_deg(|b| &b.vertical_plane.beam_angle), full_deg(|b| &b.plane_across.beam_angle)];
    let field_angles = [full_deg(|b| &b.vertical_plane.field_angle), full_deg(|b| &b.plane_across.field_angle)];
    (beam_angles, field_angles)
}

impl BugZones {
    fn of(photometry: &Photometry) -> Self {
        let zones = photometry.distribution.classification_zones(photometry.convention().forward_c_deg);
        let [back, forward] = [zones.back, zones.forward].map(|zones| zones.map(Lumen::value));
        Self { back, up: zones.up.map(Lumen::value), forward }
    }
}

impl fmt::Display for BugZones {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [back, up, forward] = [&self.back[..], &self.up, &self.forward].map(list_whole);
        write!(f, "back {back}, up {up}, forward {forward} lm")
    }
}

/// Whole numbers separated by blanks.
fn list_whole(numbers: &[f64]) -> String {
    numbers.iter().map(|n| format!("{n:.0}")).collect::<Vec<_>>().join(" ")
}

impl Angles {
    fn of(angles: &[f64]) -> Self {
        let steps: Vec<f64> = angles.windows(2).map(|w| w[1] - w[0]).collect();
        // No file states angles to a millionth of a degree.
        let step_deg = steps.first().copied().filter(|step| steps.iter().all(|s| (s - step).abs() < 1e-6));
        let (first_deg, last_deg) = (angles[0], angles[angles.len() - 1]);
        Self { count: angles.len(), first_deg, last_deg, step_deg }
    }
}

impl fmt::Display for Angles {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.count == 1 {
            return f.write_str("1");
        }
        write!(f, "{} from {} to {}°", self.count, self.first_deg, self.last_deg)?;
        match self.step_deg {
            // Rounding removes the error of the difference of two angles.
            Some(step) => write!(f, " every {}°", (step * 1e9).round() / 1e9),
            None => f.write_str(", unevenly spaced"),
        }
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut rows = vec![("format", self.format.clone())];
        if let Some(luminaire) = &self.luminaire {
            rows.push(("luminaire", quoted(luminaire.lines().next().unwrap_or_default())));
        }
        let up = if self.flux_lm > 0.0 { 100.0 * self.flux_up_lm / self.flux_lm } else { 0.0 };
        let (lm, up_lm, down_lm) = (self.flux_lm, self.flux_up_lm, self.flux_down_lm);
        rows.push(("flux", format!("{lm:.1} lm: {up_lm:.1} up ({up:.1} %), {down_lm:.1} down")));
        rows.push(("largest intensity", format!("{:.1} cd", self.max_cd)));
        let (symmetry, detected) = (self.symmetry, self.detected_symmetry);
        let hidden = if symmetry == detected { String::new() } else { format!(" (the values are {detected})") };
        rows.push(("symmetry", format!("{symmetry}{hidden}")));
        let [horizontal, vertical] = match self.goniometer.as_str() {
            "C" => ["C planes", "gamma angles"].map(str::to_owned),
            kind => ["horizontal", "vertical"].map(|axis| format!("{axis}, type {kind}")),
        };
        rows.push((horizontal.as_str(), self.c_planes.to_string()));
        rows.push((vertical.as_str(), self.gamma.to_string()));
        rows.push(("luminous opening", self.opening.clone()));
        let lamps = match (self.lamp_lumens, self.output_ratio) {
            (Some(lumens), Some(ratio)) => format!("{lumens} lm, light output ratio {:.1} %", 100.0 * ratio),
            _ => "absolute photometry".to_owned(),
        };
        rows.push(("lamps", lamps));
        if let (Some(watts), Some(efficacy)) = (self.input_watts, self.efficacy_lm_per_w) {
            rows.push(("power", format!("{watts} W, {efficacy:.1} lm/W")));
        }
        rows.push(("beam angle (50 %)", describe_angles(&self.beam_angle_deg)));
        rows.push(("field angle (10 %)", describe_angles(&self.field_angle_deg)));
        rows.push(("spacing criterion", self.spacing_criterion.describe(SpacingRecord::describe)));
        rows.push(("CIE flux code", self.cie_flux_code.describe(|code| list_whole(code))));
        rows.push(("BUG zones", self.bug_zones_lm.to_string()));
        if !self.lint.is_empty() {
            rows.push(("lints", format!("{} (--lint prints them)", self.lint.len())));
        }
        f.write_str(&format_table(&self.file, &rows))
    }
}

/// The angles of both planes; a reason that both share once.
fn describe_angles(angles: &[Figure<f64>; 2]) -> String {
    let [vertical, across] = [&angles[0], &angles[1]].map(|angle| angle.describe(|degrees| format!("{degrees:.1}°")));
    if vertical == across { vertical } else { format!("vertical {vertical}, across {across}") }
}

/// The name of a symmetry.
fn name(symmetry: Symmetry) -> &'static str {
    match symmetry {
        Symmetry::Axial => "axial",
        Symmetry::Quadrant => "quadrant",
        Symmetry::BilateralC0 => "bilateral_c0",
        Symmetry::BilateralC90 => "bilateral_c90",
        Symmetry::None => "none",
    }
}

/// Shape and dimensions of an opening.
fn describe_opening(opening: &LuminousOpening) -> String {
    let [width, length, height] = opening.bounding_box_m();
    let shape = match opening {
        LuminousOpening::Point => return "point".to_owned(),
        LuminousOpening::Box { height_m: 0.0, .. } => "rectangle",
        LuminousOpening::Box { .. } => "box",
        LuminousOpening::Ellipse { x_m, y_m, height_m: 0.0 } if x_m == y_m => "circle",
        LuminousOpening::Ellipse { height_m: 0.0, .. } => "ellipse",
        LuminousOpening::Ellipse { .. } => "upright cylinder",
        LuminousOpening::Ellipsoid { x_m, y_m, z_m } if x_m == y_m && y_m == z_m => "sphere",
        LuminousOpening::Ellipsoid { .. } => "ellipsoid",
        LuminousOpening::LyingCylinder { .. } => "lying cylinder",
    };
    format!("{shape}, {length:.3} m along C0, {width:.3} m along C90, {height:.3} m high")
}
