//! The page of a renderer and a capability: for each release the cases, their worst points, and how to repeat them.

use itertools::Itertools;
use luxproof_model::REPORT_FILE;
use luxproof_model::numbers::{plural, significant, trimmed};
use luxproof_report::{minus, table};
use maud::{Markup, html};

use super::renderer_page::{crumb, crumb_link};
use super::{frame, plot, sign};
use crate::cards::anchor;
use crate::{
    Capability, CardRun, Cards, CaseEvidence, CellEvidence, Measurement, Outcome, ReleaseEvidence, Remark, Spread,
    Verification, WorstPoint,
};

const ROOT: &str = "../../";
/// Notes of engines that a release lists.
const LISTED_NOTES: usize = 4;
/// What reports give as the spec of scenes of known answer.
const BUILT_IN: &str = "(built in)";

pub(super) fn page(cards: &Cards, capability: &Capability, of: &CellEvidence) -> Markup {
    let heading = format!("{}: {}", of.renderer, capability.title);
    let content = html! {
        header {
            h1 { (heading) }
            p.lead { (capability.question) " " a href={ (ROOT) "capabilities.html#" (capability.id) } { "Which cases show it" } }
            @if of.releases.len() > 1 {
                ul.jump aria-label="Releases" {
                    @for release in &of.releases {
                        li class={ "s-" (release.cell.standing.key()) } {
                            a href={ "#" (anchor(&release.release)) } { (sign(&release.cell.standing)) " " (release.release) }
                        }
                    }
                }
            }
        }
        @for (k, release) in of.releases.iter().enumerate() { (release_section(cards, &of.renderer, release, k == 0)) }
        p.where { "The same as JSON: " a href={ (capability.id) ".json" } { code { (capability.id) ".json" } } }
    };
    let link = crumb_link(&of.renderer_slug);
    frame(cards, &heading, ROOT, &[crumb(&link, &of.renderer)], &content, Some(SCRIPT))
}

/// Opens the release that a link names.
const SCRIPT: &str = "const reveal=()=>{const s=document.getElementById(decodeURIComponent(location.hash.slice(1)));\
const d=s&&(s.closest('details')||s.querySelector('details'));if(d){d.open=true;s.scrollIntoView()}};addEventListener('hashchange',reveal);reveal();";

/// The version of a release, where it says more than its name.
fn version_text(cards: &Cards, renderer: &str, release: &ReleaseEvidence) -> Option<String> {
    let card = cards.renderers.iter().find(|card| card.name == renderer)?;
    let card = card.releases.iter().find(|card| card.release == release.release)?;
    Some(card.version_text()).filter(|text| !text.is_empty())
}

fn release_section(cards: &Cards, renderer: &str, release: &ReleaseEvidence, is_newest: bool) -> Markup {
    let standing = &release.cell.standing;
    let version = version_text(cards, renderer, release);
    html! {
        section.evidence id=(anchor(&release.release)) {
            h2 class={ "s-" (standing.key()) } { (release.release) ": " span.badge { (sign(standing)) " " (standing.headline()) } }
            p.lead { (minus(&standing.explanation())) }
            @if let Some(version) = version { p.where { "Version: " (version) } }
            p.where {
                @if !release.cases.is_empty() { a href={ "#" (check_anchor(release)) } { "Commands to check it" } ". " }
                (release.cell.tested_cases) " of " (plural(release.cell.all_cases, "case")) ", "
                (plural(release.cell.hidden_variants, "hidden variant")) ", " (plural(release.cell.points, "comparison"))
                @if !release.cell.missing.is_empty() { "; in no run: " (release.cell.missing.join(", ")) }
            }
            (tolerance_line(cards, renderer, release))
            @if let Some(spread) = &release.cell.spread { (spread_line(spread, release.cell.worst_without_variant())) }
            @let notes = release.cases.iter().flat_map(|case| &case.notes).unique().take(LISTED_NOTES).collect_vec();
            @if !notes.is_empty() { ul.changes aria-label={ "Notes on " (release.release) } { @for note in notes { li { (note) } } } }
            @if release.is_recorded { p.where { "These are recorded values. This release cannot be run again here, so they are not verified." } }
            @if !release.cases.is_empty() {
                details open[is_newest] {
                    summary { "Evidence of " (release.release) }
                    (plot::deviations(&release.cases))
                    (case_table(release))
                    details {
                        summary { "Worst points and scenes, case by case" }
                        @for case in &release.cases { (points(cards, release, case)) }
                    }
                    (repeat(cards, release))
                }
            }
        }
    }
}

/// How far points may be from their references.
fn tolerance_line(cards: &Cards, renderer: &str, release: &ReleaseEvidence) -> Markup {
    let tolerances = release.cell.tolerances.iter().map(ToString::to_string).join("; ");
    let is_own = cards.renderers.iter().any(|card| card.name == renderer && card.is_own);
    html! {
        @if !tolerances.is_empty() {
            p.where {
                strong { "Tolerance" } ": " (tolerances) " (the larger of both). A point passes if its deviation with its expanded uncertainty stays within it."
                @if is_own { " luxproof's own hand methods (iesna) are judged by the accuracy that they claim, in public cases and in hidden variants. What they do not claim is not judged, and limits the cell." }
            }
        }
    }
}

fn spread_line(spread: &Spread, without_variant: Option<&WorstPoint>) -> Markup {
    let seeds: Vec<String> = spread.seeds.iter().map(u64::to_string).collect();
    html! {
        p.where {
            "The same cases, public: " (bound(spread.public.as_ref())) "; hidden (seed " (seeds.join(", ")) "): "
            (bound(spread.hidden.as_ref())) "."
            @if let Some(worst) = without_variant {
                " The worst point, " (worst.at) " (" (worst.deviation) "), is in neither: its case has no hidden variant."
            }
        }
    }
}

/// The bound of a deviation, where there is one.
fn bound(worst: Option<&WorstPoint>) -> String {
    worst.map_or_else(
        || "nothing measured".to_owned(),
        |worst| format!("largest error {}, at {}", worst.deviation.bound_text(), worst.at),
    )
}

fn case_table(release: &ReleaseEvidence) -> Markup {
    html! {
        div.scroll tabindex="0" role="region" aria-label={ "Cases of " (release.release) } {
            table.evidence {
                thead { tr { th scope="col" { "case" } th scope="col" { "what" } th.number scope="col" { "points" } th.number scope="col" { "worst deviation" } th scope="col" { "result" } } }
                tbody {
                    @for case in &release.cases {
                        tr {
                            th scope="row" {
                                (case.case)
                                @if let Some(variant) = &case.hidden { " " span.tag { "hidden, seed " (variant.seed) } } @else { span.title { (case.title) } }
                            }
                            td { (case.procedure.title()) }
                            (outcome_cells(case))
                        }
                    }
                }
            }
        }
    }
}

fn outcome_cells(case: &CaseEvidence) -> Markup {
    html! {
        @match &case.outcome {
            Outcome::Measured(measurement) => {
                td.number { (measurement.verdicts.all) }
                td.number { @if let Some(worst) = &measurement.worst { (worst) } @else { "–" } }
                td { (result(measurement)) }
            }
            Outcome::Unsupported { reason } => { td.number { "0" } td.number { "–" } td { "not supported: " (reason) } }
            Outcome::NotRun { reason } => { td.number { "0" } td.number { "–" } td { "not run: " (reason) } }
            Outcome::Failed { reason, .. } => { td.number { "0" } td.number { "–" } td.bad { "failed: " (reason) } }
        }
    }
}

fn result(measurement: &Measurement) -> Markup {
    let counts = &measurement.verdicts;
    html! {
        (counts.passed) " of " (counts.all) " pass"
        @for remark in &measurement.remarks {
            br;
            @match remark {
                Remark::Fault { text, points, .. } => span.bad { (points) " wrong: " (if text.is_empty() { "no known cause" } else { text }) },
                Remark::Limit { text, points, .. } => { (points) " limited: " (text) },
                Remark::Undecided { points, .. } => { (points) " undecided: more samples would decide" },
            }
        }
    }
}

/// The points of a case with the largest bounds, and the command that runs it by hand.
fn points(cards: &Cards, release: &ReleaseEvidence, case: &CaseEvidence) -> Markup {
    const HEADS: [&str; 6] =
        ["point", "number value", "number reference", "number deviation", "verdict", "reference by"];
    let points = case.measurement().map(|measurement| &measurement.points[..]).unwrap_or_default();
    let command = cards.runs.iter().find(|run| run.id == case.run).and_then(|run| run.export_command(case));
    let hidden = case.hidden.as_ref().map(|variant| format!(" (hidden, seed {})", variant.seed)).unwrap_or_default();
    let label = format!("{}{hidden}, {}", case.case, case.procedure.title().to_lowercase());
    html! {
        @if !points.is_empty() || command.is_some() {
            h3 { (label) }
        }
        @if !points.is_empty() {
            (table(&format!("{}: {label}, {}", release.release, case.reported_as), &HEADS, &html! {
                @for point in points {
                    tr {
                        th scope="row" { (point.meter) }
                        td.number { (significant(point.value)) " " (point.unit) }
                        td.number { (significant(point.reference)) " " (point.unit) }
                        td.number { (point.deviation) }
                        td { (point.verdict.name()) }
                        td { (point.source) }
                    }
                }
            }))
        }
        @if let Some(command) = command {
            p { "By hand, in the unpacked bundle; this writes the scene and prints the command that runs it:" }
            pre.commands tabindex="0" { code { (command) } }
        }
    }
}

/// The anchor of the commands of a release.
fn check_anchor(release: &ReleaseEvidence) -> String {
    format!("check-{}", anchor(&release.release))
}

/// The runs behind a release, with commands, reports and bundles.
fn repeat(cards: &Cards, release: &ReleaseEvidence) -> Markup {
    let ids = release.cases.iter().map(|case| &case.run).unique().collect_vec();
    html! {
        h3 id=(check_anchor(release)) { "Check it" }
        @for run in cards.runs.iter().filter(|run| ids.contains(&&run.id)) { (run_entry(run, release)) }
    }
}

fn run_entry(run: &CardRun, release: &ReleaseEvidence) -> Markup {
    let cases = release.cases.iter().filter(|case| case.run == run.id).collect_vec();
    // Scenes of known answer have no spec: every run has them.
    let specs = cases.iter().filter(|case| case.spec != BUILT_IN).map(|case| case.spec.clone()).unique().collect_vec();
    let names =
        cases.iter().filter(|case| case.spec != BUILT_IN).map(|case| case.reported_as.clone()).unique().collect_vec();
    let command = cases.first().and_then(|case| run.command(&specs, &names, &case.engine));
    html! {
        p {
            "Run of " (run.started.replace('T', " ").replace('Z', " UTC")) " by luxproof " (run.tool) ". "
            @match &run.verification {
                Verification::Own => {},
                Verification::Submitted { .. } => { "Submitted as a bundle, and not run again by the publisher. " },
                Verification::Unverified => { "A report of somebody else, without its inputs. " },
                Verification::Reproduced { same_bytes, within, .. } => {
                    "Submitted, and run again by the publisher: " (same_bytes) " to the byte, " (within) " within uncertainties. "
                }
            }
            @if let Some(report) = &run.report {
                a href={ (ROOT) (report) } { "Full report with every point and plan" } ", "
                a href={ (ROOT) (folder(report)) (REPORT_FILE) } { "the same as " code { (REPORT_FILE) } } (size(run.report_bytes)) ". "
            }
            @if let Some(bundle) = &run.bundle {
                a href={ (ROOT) (bundle) } { "Bundle" } (size(run.bundle_bytes)) " with all inputs; "
                code { "luxproof reproduce " (file_name(bundle)) } " repeats the whole run and compares every value."
            } @else {
                "It has no bundle on this site."
            }
        }
        @if let Some(command) = command {
            p { "These cases with this renderer, where the bundle lies:" }
            pre.commands tabindex="0" { code { "unzip -q " (run.bundle.as_deref().map_or("bundle.zip", file_name)) " -d bundle && cd bundle\n" (command) } }
        }
    }
}

/// The size of a file in parentheses.
fn size(bytes: Option<u64>) -> String {
    // Of a million bytes each; a small file counts as a tenth.
    bytes.map(|bytes| format!(" ({} MB)", trimmed((bytes as f64 / 1e6).max(0.1), 1))).unwrap_or_default()
}

/// A path on the site up to its last part.
fn folder(path: &str) -> &str {
    &path[..path.len() - file_name(path).len()]
}

/// The last part of a path on the site.
fn file_name(path: &str) -> &str {
    path.rsplit('/').next().unwrap_or(path)
}
