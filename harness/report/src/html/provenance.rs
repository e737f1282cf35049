//! The origin of every number: engine versions, settings, seeds, hashes, and the commands that repeat it.

use maud::{Markup, html};

use super::super::words::plural;
use super::palette::Palette;
use super::{Pages, duration, rest, shown, table};
use luxproof_model::Report;
use luxproof_model::{Recording, Status};

pub(super) fn section(report: &Report, palette: &Palette, pages: Option<&Pages<'_>>) -> Markup {
    html! {
        h2 id="provenance-title" { "Provenance" }
        p.lead { "To repeat the run, then one engine's part by hand:" }
        pre.commands tabindex="0" { code { (commands(report)) } }
        (table("Engines", &["engine", "version", "status", "number run time"], &html! {
            @for e in &report.engines {
                tr { th scope="row" { (palette.label(&e.id)) } td { (e.version.as_deref().unwrap_or("–")) }
                    td.wide { (status_name(e.status)) @if let Some(reason) = &e.reason { ": " (reason) } } td.number { (duration(e.wall_s)) } }
            }
        }))
        h3 { "Inputs" }
        (table("Inputs", &["case", "spec", "SHA-256 of the spec and all it names"], &html! {
            @for c in shown(&report.cases, pages) { tr { th scope="row" { (c.name) } td { code { (c.spec.path) } } td { code.hash { (c.spec.sha256) } } } }
        }))
        (rest(&report.cases, pages, "cases"))
        @for policy in report.policies() {
            p { "Judged by the policy " code { (policy.file) } @if let Some(name) = &policy.profile { ", profile " code { (name) } }
                ", SHA-256 " code.hash { (policy.sha256) } }
        }
        h3 { "Settings" }
        @for engine in &report.engines {
            @let mine: Vec<&Recording> = report.recordings.iter().filter(|r| r.key.engine == engine.id).collect();
            @if !mine.is_empty() {
                details { summary { (palette.label(&engine.id)) " " span.quiet { (plural(mine.len(), "run")) } }
                    (settings(&format!("Settings of {}", engine.id), shown(&mine, pages)))
                    (rest(&mine, pages, "recordings"))
                }
            }
        }
    }
}

/// The settings and the command of each recording.
fn settings(label: &str, recordings: &[&Recording]) -> Markup {
    let heads = ["case", "procedure", "luminaire, light", "number seed", "number run time"];
    let rows = html! {
        @for r in recordings {
            tr { th scope="row" { (r.key.case) } td { (r.key.procedure.title()) } td { (r.model) ", " (r.light) } td.number { (r.seed) }
                td.number { (duration(r.wall_s)) }
                td.wide { dl.settings {
                    @for (key, value) in r.method.iter().chain(r.effort.iter()) { div { dt { (key.replace('_', " ")) } dd { code { (value) } } } }
                    @if let Some(command) = &r.command { div { dt { "by hand" } dd { code { (command) } } } }
                } }
            }
        }
    };
    table(label, &[&heads[..], &["settings and command"]].concat(), &rows)
}

/// The command that repeats the run, and one for each engine that runs it by hand.
fn commands(report: &Report) -> String {
    let seed = report.recordings.first().map_or(1, |r| r.seed);
    let engines: Vec<&str> = report.engines.iter().filter(|e| e.status == Status::Ran).map(|e| e.id.as_str()).collect();
    let mut lines = vec![format!("luxproof run {} --engines {} --seed {seed}", report.spec.path, engines.join(","))];
    for engine in engines {
        let with_command = report.recordings.iter().find(|r| r.key.engine == engine && r.command.is_some());
        let Some((r, command)) = with_command.and_then(|r| r.command.as_ref().map(|c| (r, c))) else { continue };
        let path = report.cases.iter().find(|c| c.name == r.key.case).map_or(&report.spec.path, |c| &c.spec.path);
        let case = report.of_suite(&r.key.case, "/");
        lines.push(format!(
            "luxproof export {path} --engine {engine} --out by-hand && cd by-hand/{case}{} && {command}",
            r.key.procedure
        ));
    }
    lines.join("\n")
}

const fn status_name(status: Status) -> &'static str {
    match status {
        Status::Ran => "ran",
        Status::Absent => "absent",
        Status::Failed => "failed",
        Status::Skipped => "skipped",
    }
}
