//! The nightly site: last night's verdicts, what changed and since when, and the trend of every engine in every procedure.

use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::change::{Change, Course, Level, NIGHTS_PER_FALSE_ALARM, Part};
use super::figure::{by, course, figure, mean_deviation, percent};
use super::series::History;
use crate::judge::Verdict;
use crate::record::{EngineName, ProcedureId};
use crate::report::table;

/// The page: one file that needs nothing else. `changes` are those of the history, `reports` are links to the reports of the last night, with what they are called.
pub fn site(history: &History, changes: &[Change], reports: &[(String, String)]) -> String {
    let last = history.nights.last().map_or("no night yet", String::as_str);
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { "luxproof nightly, " (last) }
                style { (PreEscaped(include_str!("site.css"))) }
            }
            body {
                main {
                    h1 { "luxproof nightly" }
                    p.soft { (last) ", the last of " (history.nights.len()) " nights" }
                    @if !reports.is_empty() {
                        p {
                            "Reports of this night: "
                            @for (k, (name, link)) in reports.iter().enumerate() {
                                @if k > 0 { ", " } a href=(link) { (name) }
                            }
                        }
                    }
                    (tonight(history))
                    (changed(history, changes))
                    h2 { "Trends" }
                    p.soft {
                        "A red line with a triangle is a change of the deviation or the beginning of a drift, a dashed line a new version of the engine. "
                        "The mean counts a reading by the inverse of its standard error."
                    }
                    div.trends {
                        @for (engine, procedure) in history.engines_and_procedures() {
                            (figure(history, engine, procedure, changes))
                        }
                    }
                }
            }
        }
    }
    .into_string()
}

fn tonight(history: &History) -> Markup {
    let Some(night) = history.nights.len().checked_sub(1) else { return html! {} };
    let row = |engine: &EngineName, procedure: ProcedureId| {
        let members = history.of_engine(engine, procedure);
        let verdicts: Vec<Verdict> = members.iter().filter_map(|s| s.verdicts[night]).collect();
        let count = |of: &[Verdict]| verdicts.iter().filter(|v| of.contains(v)).count();
        let failed = count(&[Verdict::Fail, Verdict::UnexpectedPass, Verdict::Missing]);
        let (undecided, known) = (count(&[Verdict::Inconclusive]), count(&[Verdict::KnownDeviation]));
        let mean = mean_deviation(&members, history.nights.len())[night];
        html! {
            tr {
                th scope="row" { (engine) } td { (procedure) }
                td.number { (count(&[Verdict::Pass])) }
                td.number.fail[failed > 0] { (failed) }
                td.number.undecided[undecided > 0] { (undecided) }
                td.number.known[known > 0] { (known) }
                td.number { @if mean.is_finite() { (percent(mean)) } @else { "–" } }
            }
        }
    };
    let numbers = ["number passed", "number failed", "number undecided", "number known", "number mean deviation"];
    let heads = [&["engine", "procedure"][..], &numbers].concat();
    html! {
        h2 { "Last night" }
        (table("Last night", &heads[..], &html! {
            @for (engine, procedure) in history.engines_and_procedures() { (row(engine, procedure)) }
        }))
    }
}

/// What changed, the latest first.
fn changed(history: &History, changes: &[Change]) -> Markup {
    const HEADS: [&str; 8] =
        ["since", "noticed", "engine", "procedure", "where", "by", "number standard errors", "new version"];
    html! {
        h2 { "Changes" }
        @if changes.is_empty() {
            p { "No deviation has changed." }
        } @else {
            (table("Changes", &HEADS, &html! {
                @for change in changes.iter().rev() {
                    tr {
                        td.date { (history.nights[change.night]) } td.date { (history.nights[change.noticed]) }
                        td { (change.engine) } td { (change.procedure) } td { (place(change)) }
                        td {
                            @match change.course {
                                Course::Step { .. } => (by(change.course)),
                                Course::Drift { .. } => (course(history, change)),
                            }
                        }
                        td.number {
                            @if let Course::Step { standard_errors, .. } = change.course { (format!("{standard_errors:+.1}")) }
                        }
                        td { (version(history, change).unwrap_or_default()) }
                    }
                }
            }))
        }
        p.soft {
            "Found by sums over nights; at most one false alarm in "
            (format!("{NIGHTS_PER_FALSE_ALARM:.0}")) " nights is to be expected over all series together. "
            "One bad night is no change. What goes further night after night is a drift: a line fits it better than steps do."
        }
    }
}

/// A change in one line of text.
pub fn in_words(history: &History, change: &Change) -> String {
    let Change { engine, procedure, noticed, .. } = change;
    let noticed = history.nights.get(*noticed).map_or("", String::as_str);
    format!("{engine} {procedure}, {}: {}, noticed on {noticed}", place(change), course(history, change))
}

fn place(change: &Change) -> String {
    let name = |part: &Part| match (&part.case, &part.meter) {
        (Some(case), Some(meter)) => format!("{case} {meter}"),
        (Some(case), None) => case.clone(),
        _ => "all cases together".to_owned(),
    };
    let cases: Vec<String> = change.seen_in.iter().filter(|p| p.meter.is_none()).map(name).collect();
    let meters = change.seen_in.iter().filter(|p| p.meter.is_some()).count();
    let mut text = name(&change.part);
    if change.level == Level::EngineAndProcedure && !cases.is_empty() {
        text += &format!("; by themselves {}", cases.join(", "));
    }
    if meters > 0 {
        text += &format!("; {meters} single comparisons");
    }
    text
}

fn version(history: &History, change: &Change) -> Option<String> {
    let near = |night: usize| night.abs_diff(change.night) <= 2;
    let found = history.version_changes.iter().find(|v| v.engine == change.engine && near(v.night))?;
    Some(format!("{} (was {})", found.to, found.from))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trend::history::changes;
    use crate::trend::history::synthetic::{Drift, Shift, Synthetic};

    const PROCEDURE: ProcedureId = ProcedureId::IndirectIlluminance;

    fn nights(shift: Option<Shift>) -> History {
        let base = Synthetic { nights: 60, cases: 2, meters: 4, new_version: Some(40), shift, ..Synthetic::default() };
        History::parse(base.text().as_bytes(), std::path::Path::new("history.jsonl")).unwrap()
    }

    #[test]
    fn a_change_and_the_new_version_beside_it_stand_in_the_table_and_in_the_trend() {
        let history = nights(Some(Shift { night: 40, standard_errors: 4.0, cases: 2, meters: 4 }));
        let changes = changes(&history);
        let page = site(&history, &changes, &[("suite".to_owned(), "suite/report.html".to_owned())]);
        let date = &history.nights[40];
        assert!(page.contains(&format!("<td class=\"date\">{date}</td>")), "no row for {date}");
        assert!(page.contains("1.1 (was 1.0)"));
        assert!(page.contains("href=\"suite/report.html\""));
        let figure_of = |engine: &str| {
            let behind = page.split(&format!("{engine}-indirect_illuminance-title\">")).nth(1).unwrap();
            behind.split("</figure>").next().unwrap()
        };
        // Of the others chance may have alarmed one.
        let changed = |engine: &&str| changes.iter().any(|c| c.engine == **engine && c.procedure == PROCEDURE);
        let quiet = ["radiance", "povray", "simulator"].into_iter().find(|engine| !changed(engine)).unwrap();
        let (figure, quiet) = (figure_of("mitsuba"), figure_of(quiet));
        assert!(figure.contains("class=\"change\"") && figure.contains("class=\"mark\""), "{figure}");
        assert!(figure.contains("class=\"version\""), "{figure}");
        assert!(figure.contains(&format!("Version 1.1 from {date}")), "{figure}");
        assert!(!quiet.contains("class=\"change\"") && !quiet.contains("class=\"version\""), "{quiet}");
        // Nothing is fetched from anywhere.
        assert!(!page.contains("http") && !page.contains("<script"));
    }

    #[test]
    fn a_drift_is_told_with_its_slope_its_interval_and_its_first_night() {
        let drift = Some(Drift { nights: (30, 100), a_night: 5e-4, cases: 2 });
        let made = Synthetic { nights: 45, cases: 2, meters: 20, drift, ..Synthetic::default() };
        let history = made.history();
        let changes = changes(&history);
        let is_it = |c: &&Change| c.engine == "mitsuba" && matches!(c.course, Course::Drift { .. });
        let words = in_words(&history, changes.iter().find(is_it).unwrap());
        let (slope, rest) = words.split_once("drifts by +0.0").unwrap().1.split_once(" % ± 0.00").unwrap();
        assert!(slope.starts_with("49") || slope.starts_with("50"), "{words}");
        assert!(rest.contains(&format!(" % a night since {}, noticed", history.nights[30])), "{words}");
        let page = site(&history, &changes, &[]);
        // In the table, and below the trend.
        assert_eq!(page.matches("drifts by +0.0").count(), 2, "{words}");
    }

    #[test]
    fn a_page_without_nights_or_without_readings_says_so() {
        assert!(site(&History::default(), &[], &[]).contains("no night yet"));
        let mut history = nights(None);
        history.series[0].deviation.fill(f64::NAN);
        history.series.truncate(1);
        assert!(site(&history, &changes(&history), &[]).contains("No readings."));
    }

    #[test]
    fn text_of_a_spec_cannot_become_markup() {
        let mut history = nights(None);
        history.series.iter_mut().for_each(|series| series.key.reading.engine = "<b>\"x".into());
        let page = site(&history, &changes(&history), &[]);
        assert!(page.contains("&lt;b&gt;") && !page.contains("<b>"));
    }
}
