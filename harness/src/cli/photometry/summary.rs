//! The numbers that a photometric file is known by, for people and for programs.

use std::fmt;
use std::path::Path;

use luminaire::photometry::{Lint, LuminousOpening, Photometry, Symmetry};
use luminaire::units::{Candela, Lumen};
use serde::Serialize;
use serde_json::json;

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
    /// Of the values themselves.
    detected_symmetry: &'static str,
    /// Of types A and B the two below are the file's horizontal and vertical angles.
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
    /// Full angles to half of the largest intensity, planes C0-C180 and C90-C270.
    beam_angle_deg: [Option<f64>; 2],
    /// Full angles to a tenth of the largest intensity.
    field_angle_deg: [Option<f64>; 2],
    spacing_criterion: [Option<f64>; 2],
    cie_flux_code: Option<[f64; 5]>,
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
        let within = |fraction: f64| [0.0, 90.0].map(|c| distribution.angle_within(c, fraction, max));
        let lit = max > Candela(0.0);
        let [horizontal, vertical] = distribution.file_angles_deg();
        let record = |l: &Lint| json!({"code": l.code, "line": l.line, "message": l.message});
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
            opening: opening(&photometry.opening),
            opening_m: photometry.opening.bounding_box_m(),
            beam_angle_deg: if lit { within(0.5) } else { [None; 2] },
            field_angle_deg: if lit { within(0.1) } else { [None; 2] },
            spacing_criterion: [0.0, 90.0].map(|c| distribution.spacing_criterion(c)),
            cie_flux_code: distribution.cie_flux_code(Lumen(photometry.lamp_lumens.unwrap_or(flux.value()))),
            bug_zones_lm: BugZones::of(photometry),
            lint: photometry.lints.iter().map(record).collect(),
        }
    }
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
        let list = |zones: &[f64]| zones.iter().map(|lm| format!("{lm:.0}")).collect::<Vec<_>>().join(" ");
        write!(f, "back {}, up {}, forward {} lm", list(&self.back), list(&self.up), list(&self.forward))
    }
}

impl Angles {
    fn of(angles: &[f64]) -> Self {
        let steps = || angles.windows(2).map(|w| w[1] - w[0]);
        // A millionth of a degree is beyond what any file means.
        let even = |step: &f64| steps().all(|s| (s - step).abs() < 1e-6);
        let (first_deg, last_deg) = (angles[0], angles[angles.len() - 1]);
        Self { count: angles.len(), first_deg, last_deg, step_deg: steps().next().filter(even) }
    }
}

impl fmt::Display for Angles {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.count == 1 {
            return f.write_str("1");
        }
        write!(f, "{} from {} to {}°", self.count, self.first_deg, self.last_deg)?;
        match self.step_deg {
            // As files have them, not as their differences are rounded.
            Some(step) => write!(f, " every {}°", (step * 1e9).round() / 1e9),
            None => f.write_str(", unevenly spaced"),
        }
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", self.file)?;
        let mut row = |name: &str, value: String| writeln!(f, "  {name:<20} {value}");
        row("format", self.format.clone())?;
        if let Some(luminaire) = &self.luminaire {
            row("luminaire", luminaire.lines().next().unwrap_or_default().to_owned())?;
        }
        let up = if self.flux_lm > 0.0 { 100.0 * self.flux_up_lm / self.flux_lm } else { 0.0 };
        let (lm, up_lm, down_lm) = (self.flux_lm, self.flux_up_lm, self.flux_down_lm);
        row("flux", format!("{lm:.1} lm: {up_lm:.1} up ({up:.1} %), {down_lm:.1} down"))?;
        row("largest intensity", format!("{:.1} cd", self.max_cd))?;
        let (symmetry, detected) = (self.symmetry, self.detected_symmetry);
        let hidden = if symmetry == detected { String::new() } else { format!(" (the values are {detected})") };
        row("symmetry", format!("{symmetry}{hidden}"))?;
        let [horizontal, vertical] = match self.goniometer.as_str() {
            "C" => ["C planes", "gamma angles"].map(str::to_owned),
            kind => ["horizontal", "vertical"].map(|axis| format!("{axis}, type {kind}")),
        };
        row(&horizontal, self.c_planes.to_string())?;
        row(&vertical, self.gamma.to_string())?;
        row("luminous opening", self.opening.clone())?;
        let lamps = match (self.lamp_lumens, self.output_ratio) {
            (Some(lumens), Some(ratio)) => format!("{lumens} lm, light output ratio {:.1} %", 100.0 * ratio),
            _ => "absolute photometry".to_owned(),
        };
        row("lamps", lamps)?;
        if let (Some(watts), Some(efficacy)) = (self.input_watts, self.efficacy_lm_per_w) {
            row("power", format!("{watts} W, {efficacy:.1} lm/W"))?;
        }
        let pair = |[c0, c90]: [Option<f64>; 2], digits: usize, unit: &str| {
            let one = |v: Option<f64>| v.map_or("-".to_owned(), |v| format!("{v:.digits$}{unit}"));
            format!("C0 {}, C90 {}", one(c0), one(c90))
        };
        row("beam angle (50 %)", pair(self.beam_angle_deg, 1, "°"))?;
        row("field angle (10 %)", pair(self.field_angle_deg, 1, "°"))?;
        row("spacing criterion", pair(self.spacing_criterion, 2, ""))?;
        if let Some(code) = self.cie_flux_code {
            row("CIE flux code", code.map(|n| format!("{n:.0}")).join(" "))?;
        }
        row("BUG zones", self.bug_zones_lm.to_string())?;
        if !self.lint.is_empty() {
            row("lints", format!("{} (--lint prints them)", self.lint.len()))?;
        }
        Ok(())
    }
}

fn name(symmetry: Symmetry) -> &'static str {
    match symmetry {
        Symmetry::Axial => "axial",
        Symmetry::Quadrant => "quadrant",
        Symmetry::BilateralC0 => "bilateral_c0",
        Symmetry::BilateralC90 => "bilateral_c90",
        Symmetry::None => "none",
    }
}

fn opening(opening: &LuminousOpening) -> String {
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
