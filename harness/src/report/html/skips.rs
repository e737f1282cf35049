//! What was not run, why, and what that saved; what was only approximated; what the engines noted.

use std::collections::BTreeMap;

use maud::{Markup, html};

use super::super::{Report, split};
use super::{minus, plural, title};
use crate::plan::Scope;
use crate::record::EngineName;

pub(super) fn section(report: &Report) -> Markup {
    let groups = skips(report);
    let notes = notes(report);
    let splits = split::widest(report);
    html! {
        h2 id="skips-title" { "Not run, approximated, noted" }
        @if groups.is_empty() {
            p.lead { "Nothing was skipped: every engine ran every procedure of every case." }
        } @else {
            div.scroll tabindex="0" role="region" aria-label="What was not run" {
                table {
                    thead { tr { th scope="col" { "engine" } th scope="col" { "not run" } th scope="col" { "reason" } th scope="col" { "saved" } th scope="col" { "cases" } } }
                    tbody {
                        @for ((engine, what, reason, saved), cases) in &groups {
                            tr { th scope="row" { (engine) } td { (what) } td.wide { (reason) } td { (saved) }
                                td.wide { @if cases.len() > 3 { (plural(cases.len(), "case")) } @else { (cases.join(", ")) } } }
                        }
                    }
                }
            }
        }
        @if !splits.is_empty() {
            h3 { "Methods apart from renderers" }
            p.lead { "Where an approximate method differs from a renderer, what of it is the method's and what the renderer's; the widest of each." }
            ul.notes { @for s in splits { li { span.where { (split::place(report, s)) } " " (minus(&s.text)) } } }
        }
        @if !notes.is_empty() {
            h3 { "Approximations and notes" }
            ul.notes {
                @for (line, cases) in &notes {
                    li { @if report.is_suite() { span.where { @if cases.len() == 1 { (cases[0]) } @else { (plural(cases.len(), "case")) } } " " } (line) }
                }
            }
        }
    }
}

type Group = (EngineName, String, String, String);

fn skips(report: &Report) -> BTreeMap<Group, Vec<&str>> {
    let mut groups: BTreeMap<Group, Vec<&str>> = BTreeMap::new();
    for skip in &report.skips {
        let what = match skip.scope {
            Scope::Engine => "all of it".to_owned(),
            Scope::Procedure => title(skip.key.procedure),
            Scope::Meter => format!("{}, some meters", title(skip.key.procedure)),
            Scope::LightPath => format!("{}, some light paths", title(skip.key.procedure)),
        };
        let key = (skip.key.engine.clone(), what, skip.reason.clone(), skip.saved.clone().unwrap_or_default());
        let cases = groups.entry(key).or_default();
        if !cases.contains(&skip.key.case.as_str()) {
            cases.push(&skip.key.case);
        }
    }
    groups
}

fn notes(report: &Report) -> BTreeMap<String, Vec<&str>> {
    let mut lines: BTreeMap<String, Vec<&str>> = BTreeMap::new();
    for r in &report.recordings {
        let approximate =
            r.approximation.iter().map(|a| format!("{}, {}: approximate, {a}", r.key.engine, title(r.key.procedure)));
        let said = |note: &&String| r.approximation.as_ref().is_some_and(|a| a.contains(note.as_str()));
        let noted = r.notes.iter().filter(|n| !said(n)).map(|n| format!("{}: {n}", r.key.engine));
        let failed = r.failure.iter().map(|f| format!("{}, {} failed: {f}", r.key.engine, title(r.key.procedure)));
        for line in approximate.chain(noted).chain(failed) {
            let cases = lines.entry(line).or_default();
            if !cases.contains(&r.key.case.as_str()) {
                cases.push(&r.key.case);
            }
        }
    }
    lines
}
