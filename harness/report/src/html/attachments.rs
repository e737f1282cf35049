//! Further measurements in a report: JSON of `luxproof bench` and `luxproof stress`.

use std::collections::BTreeMap;

use itertools::Itertools;
use maud::{Markup, html};
use serde::Deserialize;

use super::palette::Palette;
use luxproof_model::LawBreach;
use luxproof_model::{EngineName, ProcedureId};

/// A measurement to show with a report.
#[derive(Clone, Debug)]
pub enum AttachedReport {
    Bench(Vec<BenchCurve>),
    Stress(Vec<StressLaw>),
}

#[derive(Debug, thiserror::Error)]
pub enum AttachedReportError {
    #[error("it is no JSON: {0}")]
    Json(#[from] serde_json::Error),
    #[error(
        "it holds neither `curves` (of `luxproof bench --format json`) nor `laws` (of `luxproof stress --format json`)"
    )]
    Unknown,
}

/// The error of an engine by its run time.
#[derive(Clone, Debug, Deserialize)]
pub struct BenchCurve {
    pub engine: EngineName,
    pub procedure: ProcedureId,
    pub points: Vec<BenchPoint>,
}

#[derive(Clone, Copy, Debug, Deserialize)]
pub struct BenchPoint {
    pub wall_s: f64,
    pub relative_error: Option<f64>,
    pub relative_error_low: Option<f64>,
    pub relative_error_high: Option<f64>,
}

/// How well an engine obeys a law under stress.
#[derive(Clone, Debug, Deserialize)]
pub struct StressLaw {
    pub engine: EngineName,
    pub law: String,
    pub worst_deviation: Option<f64>,
    /// The magnitude at which the deviation first passes each fraction.
    #[serde(default)]
    pub breaks_at: BTreeMap<String, Option<f64>>,
    pub how: Option<LawBreach>,
    pub refused_at: Option<f64>,
    /// The causes on record where every break is known.
    #[serde(default)]
    pub known: Vec<String>,
}

/// A file of either kind.
#[derive(Deserialize)]
struct MeasurementFile {
    curves: Option<Vec<BenchCurve>>,
    laws: Option<Vec<StressLaw>>,
}

impl AttachedReport {
    /// Parses the JSON of either command.
    pub fn from_json(text: &str) -> Result<Self, AttachedReportError> {
        match serde_json::from_str::<MeasurementFile>(text)? {
            MeasurementFile { curves: Some(curves), .. } => Ok(Self::Bench(curves)),
            MeasurementFile { laws: Some(laws), .. } => Ok(Self::Stress(laws)),
            MeasurementFile { .. } => Err(AttachedReportError::Unknown),
        }
    }
}

/// The matrix of laws by engines; `None` where no stress was measured.
pub(super) fn stress_section(attachments: &[AttachedReport], palette: &Palette) -> Option<Markup> {
    let mut laws: Vec<&StressLaw> = vec![];
    for measurement in attachments {
        if let AttachedReport::Stress(more) = measurement {
            laws.extend(more);
        }
    }
    if laws.is_empty() {
        return None;
    }
    let names: Vec<_> = laws.iter().map(|l| l.law.as_str()).unique().collect();
    let engines = laws.iter().map(|l| l.engine.as_str()).unique().sorted_by_key(|e| palette.order(e)).collect_vec();
    let known: Vec<&StressLaw> = laws.iter().copied().filter(|l| !l.known.is_empty()).collect();
    Some(html! {
        h2 id="stress-title" { "Numerical stability" }
        p.lead { "The largest deviation from each law, and the magnitude at which it first passes 0.1 %, 1 % and 10 %." }
        div.scroll tabindex="0" role="region" aria-label="Stress matrix" {
            table.matrix.stress {
                thead { tr { th scope="col" { "law" } @for e in &engines { th scope="col" { (palette.label(e)) } } } }
                tbody { @for name in names { tr {
                    th scope="row" { (name.replace('_', " ")) }
                    @for e in &engines { (stress_cell(laws.iter().find(|l| l.law == name && l.engine == *e))) }
                } } }
            }
        }
        @if !known.is_empty() {
            h3 { "On record" }
            dl.facts { @for law in known {
                dt { (palette.label(&law.engine)) " " (law.law.replace('_', " ")) }
                dd { (law.known.join("; ")) }
            } }
        }
    })
}

/// Fractions in the file with their names in the table, the smallest first.
const BREAKS: [(&str, &str); 3] = [("0.001", "0.1 %"), ("0.01", "1 %"), ("0.1", "10 %")];

fn stress_cell(law: Option<&&StressLaw>) -> Markup {
    let Some(law) = law else { return html! { td.quiet { "–" } } };
    let first_break =
        BREAKS.into_iter().find_map(|(fraction, name)| Some((name, law.breaks_at.get(fraction).copied().flatten()?)));
    let class = match (law.worst_deviation, law.how) {
        (_, Some(_)) if !law.known.is_empty() => "v-known",
        (None, None) => "quiet",
        (_, Some(LawBreach::Nan | LawBreach::Crash | LawBreach::Hang | LawBreach::SilentLoss)) | (None, _) => "v-fail",
        (Some(d), _) if d.abs() >= 0.1 => "v-fail",
        (Some(d), _) if d.abs() >= 0.001 => "v-undecided",
        _ => "v-pass",
    };
    html! {
        td class=(class) {
            div { (describe_worst(law)) @if let Some(how) = &law.how { " " (how.to_string().replace('_', " ")) } }
            @if let Some((name, at)) = first_break { div.most { (name) " at " (format!("{at:e}")) } }
            @if let (Some(at), Some(_)) = (law.refused_at, law.worst_deviation) { div.most { "refuses at " (format!("{at:e}")) } }
            @if !law.known.is_empty() { div.most { "known deviation" } }
        }
    }
}

/// The largest deviation, or why there is none; nothing after a reading that failed, since the others say little.
fn describe_worst(law: &StressLaw) -> String {
    match (law.worst_deviation, law.how) {
        (_, Some(LawBreach::Nan | LawBreach::Crash | LawBreach::Hang)) => String::new(),
        (Some(deviation), _) => super::percent(deviation).trim_start_matches('+').to_owned(),
        (None, _) if law.refused_at.is_some() => "refuses".to_owned(),
        (None, _) => "not tried".to_owned(),
    }
}
