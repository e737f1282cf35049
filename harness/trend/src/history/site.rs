//! The nightly site: the verdicts of the last night, changes with their dates, and the trend of every engine in every procedure.

use std::collections::BTreeSet;

use itertools::Itertools;
use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::change::{Change, Course, Level, NIGHTS_PER_FALSE_ALARM, Part};
use super::figure::{describe_course, describe_size, figure, mean_deviation, percent};
use super::series::History;
use luxproof_model::Verdict;
use luxproof_model::numbers::plural;
use luxproof_model::{EngineName, ProcedureId};
use luxproof_report::table;

/// The page as one file that needs nothing else.
///
/// `changes` are those of the history; `reports` are the names of the last night's reports and links to them.
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
                    (verdict_table(history))
                    (change_table(history, changes))
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

/// The verdicts of the last night, a row for each engine and procedure.
fn verdict_table(history: &History) -> Markup {
    let Some(night) = history.nights.len().checked_sub(1) else { return html! {} };
    let numbers = ["number passed", "number failed", "number undecided", "number known", "number mean deviation"];
    let heads = [&["engine", "procedure"][..], &numbers].concat();
    html! {
        h2 { "Last night" }
        (table("Last night", &heads[..], &html! {
            @for (engine, procedure) in history.engines_and_procedures() { (verdict_row(history, night, engine, procedure)) }
        }))
    }
}

fn verdict_row(history: &History, night: usize, engine: &EngineName, procedure: ProcedureId) -> Markup {
    let members = history.of_engine(engine, procedure);
    let verdicts: Vec<Verdict> = members.iter().filter_map(|s| s.verdicts[night]).collect();
    let passed = count(&verdicts, &[Verdict::Pass]);
    let failed = count(&verdicts, &[Verdict::Fail, Verdict::UnexpectedPass, Verdict::Missing]);
    let undecided = count(&verdicts, &[Verdict::Undecided]);
    let known = count(&verdicts, &[Verdict::KnownDeviation]);
    let mean = mean_deviation(&members, history.nights.len())[night];
    html! {
        tr {
            th scope="row" { (engine) } td { (procedure) }
            td.number { (passed) }
            td.number.fail[failed > 0] { (failed) }
            td.number.undecided[undecided > 0] { (undecided) }
            td.number.known[known > 0] { (known) }
            td.number { @if mean.is_finite() { (percent(mean)) } @else { "–" } }
        }
    }
}

/// How many verdicts are among the wanted ones.
fn count(verdicts: &[Verdict], wanted: &[Verdict]) -> usize {
    verdicts.iter().filter(|verdict| wanted.contains(verdict)).count()
}

/// The changes, the latest first.
fn change_table(history: &History, changes: &[Change]) -> Markup {
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
                        td { (change.engine) } td { (change.procedure) } td { (describe_place(change)) }
                        td {
                            @match change.course {
                                Course::Step { .. } => (describe_size(change.course)),
                                Course::Drift { .. } | Course::Outlier { .. } => (describe_course(history, change)),
                            }
                        }
                        td.number {
                            @if let Course::Step { standard_errors, .. } = change.course { (format!("{standard_errors:+.1}")) }
                        }
                        td { (describe_version(history, change).unwrap_or_default()) }
                    }
                }
            }))
        }
        p.soft {
            "Found by sums over nights; at most one false alarm in "
            (format!("{NIGHTS_PER_FALSE_ALARM:.0}")) " nights is expected over all series together. "
            "One bad night is no change. A drift continues night after night: a line fits it better than steps."
        }
    }
}

/// A change in one line of text.
pub fn in_words(history: &History, change: &Change) -> String {
    let Change { engine, procedure, noticed, .. } = change;
    let noticed = history.nights.get(*noticed).map_or("", String::as_str);
    let (place, course) = (describe_place(change), describe_course(history, change));
    match change.course {
        Course::Outlier { .. } => format!("{engine} {procedure}, {place}: {course}"),
        _ => format!("{engine} {procedure}, {place}: {course}, noticed on {noticed}"),
    }
}

/// The group that changed, and the cases and comparisons that show the same.
fn describe_place(change: &Change) -> String {
    let cases: BTreeSet<String> = change.seen_in.iter().filter(|p| p.meter.is_none()).map(part_name).collect();
    let meters: BTreeSet<String> = change.seen_in.iter().filter(|p| p.meter.is_some()).map(part_name).collect();
    let mut text = part_name(&change.part);
    if change.level == Level::EngineAndProcedure && !cases.is_empty() {
        text += &format!("; by themselves {}", cases.iter().join(", "));
    }
    if !meters.is_empty() {
        text += &format!("; {}", plural(meters.len(), "single comparison"));
    }
    text
}

fn part_name(part: &Part) -> String {
    match (&part.case, &part.meter) {
        (Some(case), Some(meter)) => format!("{case} {meter}"),
        (Some(case), None) => case.clone(),
        _ => "all cases together".to_owned(),
    }
}

/// The new version of the engine within two nights of a change.
fn describe_version(history: &History, change: &Change) -> Option<String> {
    let mut versions = history.version_changes.iter();
    let found = versions.find(|v| v.engine == change.engine && v.night.abs_diff(change.night) <= 2)?;
    Some(format!("{} (was {})", found.to, found.from))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::history::changes;
    use crate::history::synthetic::{Drift, Shift, Synthetic};

    const PROCEDURE: ProcedureId = ProcedureId::IndirectIlluminance;

    fn nights(shift: Option<Shift>) -> History {
        let base = Synthetic { nights: 60, cases: 2, meters: 4, new_version: Some(40), shift, ..Synthetic::default() };
        History::parse(base.text().as_bytes(), std::path::Path::new("history.jsonl")).unwrap()
    }

    /// The plot of an engine in the page.
    fn figure_of<'p>(page: &'p str, engine: &str) -> &'p str {
        let rest = page.split(&format!("{engine}-indirect_illuminance-title\">")).nth(1).unwrap();
        rest.split("</figure>").next().unwrap()
    }

    #[test]
    fn a_change_and_the_new_version_are_in_the_table_and_in_the_trend() {
        let history = nights(Some(Shift { night: 40, until: usize::MAX, standard_errors: 4.0, cases: 2, meters: 4 }));
        let changes = changes(&history);
        let page = site(&history, &changes, &[("suite".to_owned(), "suite/report.html".to_owned())]);
        let date = &history.nights[40];
        assert!(page.contains(&format!("<td class=\"date\">{date}</td>")), "no row for {date}");
        assert!(page.contains("1.1 (was 1.0)"));
        assert!(page.contains("href=\"suite/report.html\""));
        // One of the other engines may have a false alarm.
        let mut others = ["radiance", "povray", "simulator"].into_iter();
        let quiet = others.find(|e| !changes.iter().any(|c| c.engine == **e && c.procedure == PROCEDURE)).unwrap();
        let (figure, quiet) = (figure_of(&page, "mitsuba"), figure_of(&page, quiet));
        assert!(figure.contains("class=\"change\"") && figure.contains("class=\"mark\""), "{figure}");
        assert!(figure.contains("class=\"version\""), "{figure}");
        assert!(figure.contains(&format!("Version 1.1 from {date}")), "{figure}");
        assert!(!quiet.contains("class=\"change\"") && !quiet.contains("class=\"version\""), "{quiet}");
        // Nothing is fetched from anywhere.
        assert!(!page.contains("http") && !page.contains("<script"));
    }

    #[test]
    fn a_drift_is_described_with_its_slope_its_interval_and_its_first_night() {
        let drift = Some(Drift { nights: (30, 100), a_night: 5e-4, cases: 2 });
        let made = Synthetic { nights: 45, cases: 2, meters: 20, drift, ..Synthetic::default() };
        let history = made.history();
        let changes = changes(&history);
        let mut of_mitsuba = changes.iter().filter(|c| c.engine == "mitsuba");
        let found = of_mitsuba.find(|c| matches!(c.course, Course::Drift { .. })).unwrap();
        let words = in_words(&history, found);
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

    /// A history of a night on which Mitsuba's meters have these verdicts.
    fn night_of(verdicts: &[Verdict]) -> History {
        let mut history = Synthetic { nights: 1, cases: 1, meters: verdicts.len(), ..Synthetic::default() }.history();
        history.series.retain(|s| s.key.reading.engine == "mitsuba" && s.key.reading.procedure == PROCEDURE);
        for (series, verdict) in history.series.iter_mut().zip(verdicts) {
            series.verdicts = vec![Some(*verdict)];
        }
        history
    }

    #[test]
    fn the_last_night_is_counted_by_verdict() {
        let counts = [
            (Verdict::Pass, 4),
            (Verdict::Fail, 1),
            (Verdict::UnexpectedPass, 1),
            (Verdict::Missing, 1),
            (Verdict::Undecided, 2),
            (Verdict::KnownDeviation, 1),
        ];
        let verdicts: Vec<Verdict> = counts.iter().flat_map(|(verdict, n)| vec![*verdict; *n]).collect();
        let row = verdict_table(&night_of(&verdicts)).into_string();
        let cells = "<td class=\"number\">4</td><td class=\"number fail\">3</td><td class=\"number undecided\">2</td>\
                     <td class=\"number known\">1</td>";
        assert!(row.contains(cells), "{row}");
        let quiet = verdict_table(&night_of(&[Verdict::Pass])).into_string();
        assert!(!quiet.contains("number fail") && !quiet.contains("number undecided"), "{quiet}");
        assert!(!quiet.contains("number known") && quiet.contains("<td class=\"number\">1</td>"), "{quiet}");
        let mut dark = night_of(&[Verdict::Missing]);
        dark.series[0].deviation[0] = f64::NAN;
        assert!(verdict_table(&dark).into_string().contains("<td class=\"number\">–</td>"));
        assert_eq!(verdict_table(&History::default()).into_string(), "");
    }

    fn change(level: Level, part: Part, seen_in: Vec<Part>, course: Course) -> Change {
        let engine = "mitsuba".into();
        Change { level, engine, procedure: PROCEDURE, part, night: 1, noticed: 2, course, seen_in }
    }

    fn part(case: &str, meter: Option<usize>) -> Part {
        Part { case: Some(case.to_owned()), meter: meter.map(|k| luxproof_model::MeterId::new("desk", k)) }
    }

    const STEP: Course = Course::Step { standard_errors: 3.0, relative: 0.01 };

    #[test]
    fn a_change_names_its_group_and_the_groups_that_show_it_too() {
        let seen = vec![part("b", None), part("a", None), part("a", Some(1)), part("a", Some(2)), part("b", None)];
        let all = change(Level::EngineAndProcedure, Part::default(), seen.clone(), STEP);
        assert_eq!(describe_place(&all), "all cases together; by themselves a, b; 2 single comparisons");
        let alone = change(Level::EngineAndProcedure, Part::default(), vec![], STEP);
        assert_eq!(describe_place(&alone), "all cases together");
        // Within a case its name says enough.
        let case = change(Level::Case, part("a", None), seen[..3].to_vec(), STEP);
        assert_eq!(describe_place(&case), "a; 1 single comparison");
        assert_eq!(describe_place(&change(Level::Comparison, part("a", Some(3)), vec![], STEP)), "a desk[3]");
    }

    #[test]
    fn a_change_in_words_has_the_night_on_which_it_was_noticed_and_an_outlier_has_none() {
        let history = History { nights: ["n0", "n1", "n2"].map(str::to_owned).to_vec(), ..History::default() };
        let step = change(Level::Case, part("a", None), vec![], STEP);
        assert_eq!(
            in_words(&history, &step),
            "mitsuba indirect_illuminance, a: changed by +1.0 % on n1, noticed on n2"
        );
        let course = Course::Outlier { standard_errors: 3.0, relative: 0.01 };
        let outlier = Change { course, ..step };
        assert_eq!(in_words(&history, &outlier), "mitsuba indirect_illuminance, a: had an outlier of +1.0 % on n1");
    }

    #[test]
    fn a_version_belongs_to_a_change_of_its_engine_within_two_nights() {
        let mut history = History::default();
        let (from, to) = ("1.0".to_owned(), "1.1".to_owned());
        let step = change(Level::Case, part("a", None), vec![], STEP);
        for (engine, night, is_near) in [("mitsuba", 3, true), ("mitsuba", 4, false), ("other", 1, false)] {
            let (from, to) = (from.clone(), to.clone());
            history.version_changes =
                vec![crate::history::series::VersionChange { engine: engine.into(), night, from, to }];
            let text = is_near.then(|| "1.1 (was 1.0)".to_owned());
            assert_eq!(describe_version(&history, &step), text, "{engine} {night}");
        }
    }
}
