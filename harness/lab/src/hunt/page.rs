//! The page that lists the findings of a hunt and how much of the grammar it covered.

use strum::VariantArray;

use super::{Feature, Finding, Hunt};
use crate::tables;
use luxproof_process::printable::markdown;

/// Writes the page as Markdown.
pub(super) fn write_page(hunt: &Hunt) -> String {
    let Hunt { seed, specs, comparisons, undecided, unconfirmed, seconds, coverage, .. } = hunt;
    let engines: Vec<String> = hunt.engines.iter().map(ToString::to_string).collect();
    let new = hunt.new_findings().count();
    let mut text = format!("# Hunt of {}, seed {seed}\n\n", engines.join(", "));
    text += &format!(
        "{new} new findings, {} known; {specs} specs, {comparisons} comparisons in {:.1} minutes, {undecided} undecided ({:.2} %), {unconfirmed} sightings that did not show again.\n\n",
        hunt.findings.len() - new,
        seconds / 60.0,
        100.0 * *undecided as f64 / (*comparisons).max(1) as f64,
    );
    if hunt.is_interrupted {
        text += "It was interrupted; run it again to go on.\n\n";
    }
    if !hunt.findings.is_empty() {
        let head = ["finding", "what", "off", "where", "explained by", "seen in", "lines", "table", "known"];
        let rows = hunt.findings.iter().map(finding_row).collect();
        text += &tables::format_markdown(head.map(str::to_owned).into(), rows);
    }
    let [met, all] = coverage.pairs();
    let (found, possible) = (coverage.features.len(), Feature::VARIANTS.len());
    text += &format!(
        "\n## What was searched\n\n{found} of {possible} features, {met} of {all} pairs of them (some exclude each other).\n\n"
    );
    let counted: Vec<String> = coverage.features.iter().map(|(feature, n)| format!("{feature} {n}")).collect();
    text += &(counted.join(", ") + "\n");
    let missing: Vec<String> = coverage.missing().iter().map(ToString::to_string).collect();
    if !missing.is_empty() {
        text += &format!("\nNot met: {}.\n", missing.join(", "));
    }
    text
}

/// The row of a finding.
fn finding_row(finding: &Finding) -> Vec<String> {
    let features: Vec<String> = finding.features.iter().filter(|f| !f.is_plain()).map(ToString::to_string).collect();
    let [planes, gammas] = finding.table;
    let also: Vec<String> =
        finding.also.iter().filter(|p| **p != finding.symptom.procedure).map(|p| p.name().to_owned()).collect();
    let what = if also.is_empty() {
        finding.symptom.to_string()
    } else {
        format!("{}, also {}", finding.symptom, also.join(", "))
    };
    let mut row = [
        what,
        finding.deviation.map(|d| format!("{:+.2} %", 100.0 * d)).unwrap_or_default(),
        if features.is_empty() { "anywhere".to_owned() } else { features.join(", ") },
        finding.diagnosis.clone().unwrap_or_else(|| "unexplained".to_owned()),
        finding.seen.to_string(),
        finding.lines.to_string(),
        format!("{planes} x {gammas}"),
        finding.known.clone().unwrap_or_default(),
    ]
    .map(|cell| markdown(&cell))
    .to_vec();
    row.insert(0, format!("[{0}]({0}/issue.md)", finding.id));
    row
}
