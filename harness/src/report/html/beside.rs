//! Further measurements shown with a report: JSON of `luxproof bench` and `luxproof stress`.

use std::collections::BTreeMap;

use itertools::Itertools;
use maud::{Markup, html};
use serde::Deserialize;

use super::palette::Palette;
use crate::judge::How;
use crate::record::{EngineName, ProcedureId};

#[derive(Clone, Debug)]
pub enum Beside {
    Bench(Vec<BenchCurve>),
    Stress(Vec<StressLaw>),
}

#[derive(Debug, thiserror::Error)]
pub enum BesideError {
    #[error("it is no JSON: {0}")]
    Json(#[from] serde_json::Error),
    #[error(
        "it holds neither `curves` (of `luxproof bench --format json`) nor `laws` (of `luxproof stress --format json`)"
    )]
    Unknown,
}

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

#[derive(Clone, Debug, Deserialize)]
pub struct StressLaw {
    pub engine: EngineName,
    pub law: String,
    pub worst_deviation: Option<f64>,
    /// Magnitude at which the deviation first passes the fraction.
    #[serde(default)]
    pub breaks_at: BTreeMap<String, Option<f64>>,
    pub how: Option<How>,
    pub refused_at: Option<f64>,
    /// The causes on record, where all that breaks is known.
    #[serde(default)]
    pub known: Vec<String>,
}

#[derive(Deserialize)]
struct File {
    curves: Option<Vec<BenchCurve>>,
    laws: Option<Vec<StressLaw>>,
}

impl Beside {
    pub fn from_json(text: &str) -> Result<Self, BesideError> {
        match serde_json::from_str::<File>(text)? {
            File { curves: Some(curves), .. } => Ok(Self::Bench(curves)),
            File { laws: Some(laws), .. } => Ok(Self::Stress(laws)),
            File { .. } => Err(BesideError::Unknown),
        }
    }
}

pub(super) fn stress_section(beside: &[Beside], palette: &Palette) -> Option<Markup> {
    let laws: Vec<&StressLaw> =
        beside.iter().filter_map(|b| if let Beside::Stress(laws) = b { Some(laws) } else { None }).flatten().collect();
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

fn stress_cell(law: Option<&&StressLaw>) -> Markup {
    let Some(law) = law else { return html! { td.quiet { "–" } } };
    let at = |(key, name): (&str, &'static str)| Some((name, law.breaks_at.get(key).copied().flatten()?));
    let first_break = [("0.001", "0.1 %"), ("0.01", "1 %"), ("0.1", "10 %")].into_iter().find_map(at);
    let class = match (law.worst_deviation, law.how) {
        (_, Some(_)) if !law.known.is_empty() => "v-known",
        (None, None) => "quiet",
        (_, Some(How::Nan | How::Crash | How::Hang | How::SilentLoss)) | (None, _) => "v-fail",
        (Some(d), _) if d.abs() >= 0.1 => "v-fail",
        (Some(d), _) if d.abs() >= 0.001 => "v-undecided",
        _ => "v-pass",
    };
    html! {
        td class=(class) {
            div { (worst(law)) @if let Some(how) = &law.how { " " (how.to_string().replace('_', " ")) } }
            @if let Some((name, at)) = first_break { div.most { (name) " at " (format!("{at:e}")) } }
            @if let (Some(at), Some(_)) = (law.refused_at, law.worst_deviation) { div.most { "refuses at " (format!("{at:e}")) } }
            @if !law.known.is_empty() { div.most { "known deviation" } }
        }
    }
}

/// The largest deviation, or why there is none; where nothing came of a reading, what others deviate by says little.
fn worst(law: &StressLaw) -> String {
    match (law.worst_deviation, law.how) {
        (_, Some(How::Nan | How::Crash | How::Hang)) => String::new(),
        (Some(deviation), _) => super::percent(deviation).trim_start_matches('+').to_owned(),
        (None, _) if law.refused_at.is_some() => "refuses".to_owned(),
        (None, _) => "not tried".to_owned(),
    }
}
