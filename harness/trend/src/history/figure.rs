//! A plot of an engine's trend in a procedure: its mean deviation over the nights.

use maud::{Markup, html};

use super::change::{Change, Course};
use super::series::{History, Series, VersionChange};
use luxproof_model::{EngineName, ProcedureId};

/// Size and margins of the plot, in user units.
const WIDTH: f64 = 480.0;
const HEIGHT: f64 = 170.0;
const LEFT: f64 = 62.0;
const TOP: f64 = 22.0;
const RIGHT: f64 = 8.0;
const BOTTOM: f64 = 22.0;
/// With more nights than this the curve has no dots.
const MAX_DOTS: usize = 40;
/// The least relative standard error of a series, for engines that state none.
const MIN_RELATIVE_ERROR: f64 = 1e-6;

/// The mean relative deviation of some series on each night, weighted by the inverse of the standard error.
///
/// With e the relative standard error of a series over all nights, this is sum(d / e) / sum(1 / e). Change points are found in the
/// same sum in other units. Series that miss more than a tenth of the nights are ignored if others do not.
pub(super) fn mean_deviation(members: &[&Series], nights: usize) -> Vec<f64> {
    let most = members.iter().map(|s| readings(s)).max().unwrap_or(0);
    let mut sums = vec![(0.0, 0.0); nights];
    for series in members.iter().filter(|s| 10 * readings(s) >= 9 * most) {
        let count = readings(series).max(1) as f64;
        let reference = (sum_of_squares(&series.reference) / count).sqrt();
        let error = ((sum_of_squares(&series.std_error) / count).sqrt() / reference).max(MIN_RELATIVE_ERROR);
        for ((sum, weight), deviation) in sums.iter_mut().zip(&series.deviation) {
            if deviation.is_finite() && reference > 0.0 {
                *sum += deviation / reference / error;
                *weight += 1.0 / error;
            }
        }
    }
    sums.into_iter().map(|(sum, weight)| if weight > 0.0 { sum / weight } else { f64::NAN }).collect()
}

/// On how many nights a series has a reading.
fn readings(series: &Series) -> usize {
    series.deviation.iter().filter(|d| d.is_finite()).count()
}

/// The sum of the squares of the finite values.
fn sum_of_squares(values: &[f64]) -> f64 {
    values.iter().filter(|v| v.is_finite()).map(|v| v * v).sum::<f64>()
}

/// The plot with its changes and versions, and a caption in words.
pub(super) fn figure(history: &History, engine: &EngineName, procedure: ProcedureId, changes: &[Change]) -> Markup {
    let members = history.of_engine(engine, procedure);
    let values = mean_deviation(&members, history.nights.len());
    let mine: Vec<&Change> = changes.iter().filter(|c| c.engine == *engine && c.procedure == procedure).collect();
    let versions: Vec<&VersionChange> = history.version_changes.iter().filter(|v| v.engine == *engine).collect();
    let id = format!("{engine}-{procedure}");
    let last = values.iter().rev().find(|v| v.is_finite());
    let frame = Frame::for_values(&values);
    html! {
        figure {
            h3 id={ (id) "-title" } { (engine) " · " (procedure) }
            @if let Some(last) = last {
                svg viewBox={ "0 0 " (WIDTH) " " (HEIGHT) } role="img" aria-labelledby={ (id) "-title " (id) "-caption" } {
                    (frame.axes(history))
                    @for version in &versions { (frame.vertical_line("version", version.night, &version.to)) }
                    (frame.curve(&values))
                    @for change in &mine {
                        (frame.vertical_line("change", change.night, ""))
                        (frame.mark(change.night))
                    }
                }
                figcaption id={ (id) "-caption" } {
                    "Mean deviation of " (members.len()) " comparisons, last " (percent(*last)) ". "
                    @if mine.is_empty() { "No change. " }
                    @for change in &mine { "It " (describe_course(history, change)) ". " }
                    @for version in &versions {
                        "Version " (version.to) " from " (history.nights[version.night]) ". "
                    }
                }
            } @else {
                p.soft id={ (id) "-caption" } { "No readings." }
            }
        }
    }
}

/// How and when a deviation changed: `drifts by +0.0500 % ± 0.0060 % a night since 2026-03-01`.
pub(super) fn describe_course(history: &History, change: &Change) -> String {
    let (first, size) = (date(history, change.night), describe_size(change.course));
    match change.course {
        Course::Step { .. } => format!("changed by {size} on {first}"),
        Course::Outlier { .. } if change.night + 1 == history.nights.len() => {
            format!("departs by {size} on the last night, {first}; the next night will show whether it lasts")
        }
        Course::Outlier { .. } => format!("had an outlier of {size} on {first}"),
        Course::Drift { until: None, .. } => format!("drifts by {size} since {first}"),
        Course::Drift { until: Some(end), .. } => {
            format!("drifted by {size} from {first} to {}", date(history, end.saturating_sub(1)))
        }
    }
}

/// The date of a night; empty beyond the history.
fn date(history: &History, night: usize) -> &str {
    history.nights.get(night).map_or("", String::as_str)
}

/// The size of a change, of a drift that of one night with its interval.
pub(super) fn describe_size(course: Course) -> String {
    match course {
        // References of zero have no per cent.
        Course::Step { relative: 0.0, standard_errors } | Course::Outlier { relative: 0.0, standard_errors } => {
            format!("{standard_errors:+.1} standard errors")
        }
        Course::Step { relative, .. } | Course::Outlier { relative, .. } => percent(relative),
        Course::Drift { a_night, half_width, .. } => {
            format!("{} ± {} a night", percent(a_night), percent(half_width).trim_start_matches('+'))
        }
    }
}

pub(super) fn percent(relative: f64) -> String {
    let percent = 100.0 * relative;
    match percent.abs() {
        0.0 => "0 %".to_owned(),
        a if a < 1e-3 => format!("{percent:+.1e} %"),
        a if a < 0.1 => format!("{percent:+.4} %"),
        a if a < 1.0 => format!("{percent:+.3} %"),
        _ => format!("{percent:+.1} %"),
    }
}

/// The plot's scales.
struct Frame {
    nights: usize,
    low: f64,
    high: f64,
}

impl Frame {
    fn for_values(values: &[f64]) -> Self {
        let finite: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
        let low = finite.iter().copied().fold(f64::INFINITY, f64::min);
        let high = finite.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        // The margin shows zero where it is near, and centres a deviation that repeats exactly.
        let margin = (0.15 * (high - low)).max(0.05 * high.abs().max(low.abs())).max(1e-9);
        Self { nights: values.len(), low: low - margin, high: high + margin }
    }

    fn x(&self, night: f64) -> f64 {
        round(LEFT + (WIDTH - LEFT - RIGHT) * night / (self.nights.max(2) - 1) as f64)
    }

    fn y(&self, value: f64) -> f64 {
        round(TOP + (HEIGHT - TOP - BOTTOM) * (self.high - value) / (self.high - self.low))
    }

    fn axes(&self, history: &History) -> Markup {
        let ends = [self.low, 0.5 * (self.low + self.high), self.high];
        let (first, last) = (history.nights.first(), history.nights.last());
        html! {
            @for value in ends {
                line.axis x1=(LEFT) x2=(WIDTH - RIGHT) y1=(self.y(value)) y2=(self.y(value)) {}
                text x=(LEFT - 6.0) y=(self.y(value) + 4.0) text-anchor="end" { (percent(value)) }
            }
            text x=(LEFT) y=(HEIGHT - 5.0) { (first.map_or("", String::as_str)) }
            @if self.nights > 1 {
                text x=(WIDTH - RIGHT) y=(HEIGHT - 5.0) text-anchor="end" { (last.map_or("", String::as_str)) }
            }
        }
    }

    fn curve(&self, values: &[f64]) -> Markup {
        let (mut path, mut pen) = (String::new(), 'M');
        for (night, value) in values.iter().enumerate() {
            if value.is_finite() {
                path += &format!("{pen}{} {}", self.x(night as f64), self.y(*value));
            }
            pen = if value.is_finite() { 'L' } else { 'M' };
        }
        html! {
            path.curve d=(path) {}
            @if self.nights <= MAX_DOTS {
                @for (night, value) in values.iter().enumerate().filter(|(_, v)| v.is_finite()) {
                    circle.dot cx=(self.x(night as f64)) cy=(self.y(*value)) r="2" {}
                }
            }
        }
    }

    /// A vertical line just before a night.
    fn vertical_line(&self, class: &str, night: usize, label: &str) -> Markup {
        let x = self.x(night as f64 - 0.5);
        let anchor = if x > 0.7 * WIDTH { "end" } else { "start" };
        html! {
            line class=(class) x1=(x) x2=(x) y1=(TOP - 6.0) y2=(HEIGHT - BOTTOM) {}
            @if !label.is_empty() { text x=(x) y=(TOP - 9.0) text-anchor=(anchor) { (label) } }
        }
    }

    /// A triangle that points at the line of a change, for readers who do not see its colour.
    fn mark(&self, night: usize) -> Markup {
        let (x, y) = (self.x(night as f64 - 0.5), HEIGHT - BOTTOM);
        html! { path.mark d=(format!("M{x} {}l-5 8h10z", y - 2.0)) {} }
    }
}

/// A tenth of a pixel is enough.
fn round(v: f64) -> f64 {
    (10.0 * v).round() / 10.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::history::change::{Level, Part};
    use crate::history::series::Key;
    use luxproof_model::{MeterId, ReadingKey};

    /// A number of a night; none where it has no deviation.
    fn of_read(value: f64, deviation: f64) -> f64 {
        if deviation.is_finite() { value } else { f64::NAN }
    }

    /// A series of an engine's indirect light.
    fn series(engine: &str, reference: f64, std_error: &[f64], deviation: &[f64]) -> Series {
        let key = Key {
            reading: ReadingKey::new("room", ProcedureId::IndirectIlluminance, engine),
            model: "point".to_owned(),
            meter: MeterId::new("desk", 0),
            basis: None,
            source: String::new(),
        };
        Series {
            key,
            deviation: deviation.to_vec(),
            std_error: std_error.iter().zip(deviation).map(|(e, d)| of_read(*e, *d)).collect(),
            reference: deviation.iter().map(|d| of_read(reference, *d)).collect(),
            verdicts: vec![None; deviation.len()],
        }
    }

    fn is_near(found: f64, expected: f64) -> bool {
        (found - expected).abs() < 1e-12 || (found.is_nan() && expected.is_nan())
    }

    #[test]
    fn the_mean_weighs_relative_deviations_by_the_inverse_of_their_errors() {
        // Errors of 1 % and of sqrt(17) / 200: the root of the mean of 9 and 25.
        let mut missing = [1.0; 10];
        missing[9] = f64::NAN;
        let one = series("mine", 100.0, &[1.0; 10], &missing);
        let other = series("mine", 200.0, &[3.0, 5.0].repeat(5), &[-2.0; 10]);
        let weight = 200.0 / 17f64.sqrt();
        let found = mean_deviation(&[&one, &other], 10);
        assert!(is_near(found[0], (100.0 * 0.01 - weight * 0.01) / (100.0 + weight)), "{found:?}");
        assert!(is_near(found[9], -0.01), "{found:?}");
        // A series without a tenth of the nights still counts, one without two tenths does not.
        missing[8] = f64::NAN;
        let sparse = series("mine", 100.0, &[1.0; 10], &missing);
        assert!(mean_deviation(&[&sparse, &other], 10).iter().all(|v| is_near(*v, -0.01)));
        let alone = mean_deviation(&[&sparse], 10);
        assert!(is_near(alone[0], 0.01) && alone[8].is_nan(), "{alone:?}");
    }

    #[test]
    fn an_engine_without_errors_has_one_of_a_millionth_and_darkness_has_no_relative_deviation() {
        let exact = series("mine", 100.0, &[0.0; 2], &[1.0; 2]);
        let noisy = series("mine", 100.0, &[1.0; 2], &[3.0; 2]);
        let found = mean_deviation(&[&exact, &noisy], 2)[0];
        assert!(is_near(found, (1e6 * 0.01 + 1e2 * 0.03) / (1e6 + 1e2)), "{found}");
        let dark = series("mine", 0.0, &[0.0; 2], &[1.0; 2]);
        assert!(is_near(mean_deviation(&[&dark, &noisy], 2)[1], 0.03));
        assert!(mean_deviation(&[&dark], 2)[0].is_nan() && mean_deviation(&[], 2)[1].is_nan());
    }

    #[test]
    fn percent_has_the_digits_that_its_size_needs() {
        for (relative, text) in [
            (0.0, "0 %"),
            (9.9e-6, "+9.9e-4 %"),
            (-9.9e-6, "-9.9e-4 %"),
            (1e-5, "+0.0010 %"),
            (9.9e-4, "+0.0990 %"),
            (1e-3, "+0.100 %"),
            (-9.9e-3, "-0.990 %"),
            (0.01, "+1.0 %"),
            (-0.1234, "-12.3 %"),
        ] {
            assert_eq!(percent(relative), text);
        }
    }

    fn nights(count: usize) -> Vec<String> {
        (1..=count).map(|day| format!("2026-01-{day:02}")).collect()
    }

    fn change(engine: &str, procedure: ProcedureId, night: usize, course: Course) -> Change {
        let (level, part) = (Level::EngineAndProcedure, Part::default());
        Change { level, engine: engine.into(), procedure, part, night, noticed: night, course, seen_in: vec![] }
    }

    #[test]
    fn a_course_names_its_size_and_its_nights() {
        let history = History { nights: nights(4), ..History::default() };
        let [standard_errors, relative] = [5.04, 0.02];
        let (a_night, half_width) = (-5e-4, 6e-5);
        for (night, course, text) in [
            (1, Course::Step { standard_errors, relative }, "changed by +2.0 % on 2026-01-02"),
            (1, Course::Step { standard_errors, relative: 0.0 }, "changed by +5.0 standard errors on 2026-01-02"),
            (2, Course::Outlier { standard_errors, relative: -0.02 }, "had an outlier of -2.0 % on 2026-01-03"),
            (
                3,
                Course::Outlier { standard_errors: -5.0, relative: 0.0 },
                "departs by -5.0 standard errors on the last night, 2026-01-04; the next night will show whether it lasts",
            ),
            (
                0,
                Course::Drift { a_night, half_width, until: None },
                "drifts by -0.0500 % ± 0.0060 % a night since 2026-01-01",
            ),
            (
                1,
                Course::Drift { a_night, half_width, until: Some(3) },
                "drifted by -0.0500 % ± 0.0060 % a night from 2026-01-02 to 2026-01-03",
            ),
            (9, Course::Step { standard_errors, relative }, "changed by +2.0 % on "),
        ] {
            let found = change("mine", ProcedureId::IndirectIlluminance, night, course);
            assert_eq!(describe_course(&history, &found), text);
        }
    }

    #[test]
    fn a_frame_has_a_margin_of_a_part_of_the_range_or_of_the_value() {
        for (values, low, high) in [
            (vec![0.0, f64::NAN, 0.01], -0.0015, 0.0115),
            (vec![0.9, 1.0], 0.85, 1.05),
            (vec![-1.0, -0.9], -1.05, -0.85),
            (vec![-0.04, -0.04], -0.042, -0.038),
            (vec![0.0], -1e-9, 1e-9),
        ] {
            let frame = Frame::for_values(&values);
            assert!(is_near(frame.low, low) && is_near(frame.high, high), "{values:?}: {} {}", frame.low, frame.high);
            assert_eq!(frame.nights, values.len());
        }
    }

    #[test]
    fn nights_and_values_have_their_places_in_the_plot() {
        // 410 units between the margins of 62 and 8, and 126 between 22 and 22.
        let frame = Frame { nights: 3, low: -0.0015, high: 0.0115 };
        assert_eq!([0.0, 0.5, 1.0, 2.0].map(|night| frame.x(night)), [62.0, 164.5, 267.0, 472.0]);
        assert_eq!([0.0115, 0.005, -0.0015].map(|value| frame.y(value)), [22.0, 85.0, 148.0]);
        assert_eq!(Frame { nights: 1, ..frame }.x(0.0), 62.0);
        assert_eq!([1.24, 1.26, -1.26].map(round), [1.2, 1.3, -1.3]);
        let history = History { nights: nights(3), ..History::default() };
        let axes = frame.axes(&history).into_string();
        for part in [
            "<line class=\"axis\" x1=\"62\" x2=\"472\" y1=\"148\" y2=\"148\">",
            "<text x=\"56\" y=\"152\" text-anchor=\"end\">-0.150 %</text>",
            "<line class=\"axis\" x1=\"62\" x2=\"472\" y1=\"85\" y2=\"85\">",
            "<text x=\"56\" y=\"89\" text-anchor=\"end\">+0.500 %</text>",
            "<text x=\"56\" y=\"26\" text-anchor=\"end\">+1.1 %</text>",
            "<text x=\"62\" y=\"165\">2026-01-01</text>",
            "<text x=\"472\" y=\"165\" text-anchor=\"end\">2026-01-03</text>",
        ] {
            assert!(axes.contains(part), "{part}: {axes}");
        }
        let one = Frame { nights: 1, ..frame }.axes(&History { nights: nights(1), ..History::default() }).into_string();
        assert_eq!(one.matches("2026-01-01").count(), 1, "{one}");
    }

    #[test]
    fn a_curve_is_broken_where_a_night_has_no_value_and_has_dots_on_few_nights() {
        let frame = Frame { nights: 5, low: 0.0, high: 1.0 };
        let curve = frame.curve(&[0.0, 1.0, f64::NAN, 0.5, 0.5]).into_string();
        assert!(curve.contains("d=\"M62 148L164.5 22M369.5 85L472 85\""), "{curve}");
        assert_eq!(curve.matches("<circle").count(), 4, "{curve}");
        assert!(curve.contains("cx=\"164.5\" cy=\"22\""), "{curve}");
        for (count, has_dots) in [(40, true), (41, false)] {
            let many = Frame { nights: count, ..Frame::for_values(&[0.0, 1.0]) }.curve(&vec![0.5; count]).into_string();
            assert_eq!(many.contains("<circle"), has_dots, "{count}");
        }
    }

    #[test]
    fn a_line_stands_before_its_night_with_its_label_inside_the_plot() {
        let frame = Frame { nights: 3, low: 0.0, high: 1.0 };
        let left = frame.vertical_line("version", 1, "1.1").into_string();
        assert!(left.contains("class=\"version\" x1=\"164.5\" x2=\"164.5\" y1=\"16\" y2=\"148\""), "{left}");
        assert!(left.contains("<text x=\"164.5\" y=\"13\" text-anchor=\"start\">1.1</text>"), "{left}");
        let right = frame.vertical_line("version", 2, "1.2").into_string();
        assert!(right.contains("<text x=\"369.5\" y=\"13\" text-anchor=\"end\">1.2</text>"), "{right}");
        assert!(!frame.vertical_line("change", 2, "").into_string().contains("<text"));
        assert!(frame.mark(1).into_string().contains("d=\"M164.5 146l-5 8h10z\""));
    }

    #[test]
    fn a_plot_shows_the_changes_and_versions_of_its_engine_and_procedure() {
        let procedure = ProcedureId::IndirectIlluminance;
        let (from, to) = ("1.0".to_owned(), "1.1".to_owned());
        let [mine, other] = ["mine", "other"].map(|engine| series(engine, 100.0, &[1.0; 3], &[1.0, 2.0, 3.0]));
        let history = History {
            nights: nights(3),
            series: vec![mine.clone(), mine, other],
            version_changes: vec![VersionChange { engine: "mine".into(), night: 1, from, to }],
            cut_short: None,
        };
        let step = Course::Step { standard_errors: 3.0, relative: 0.01 };
        let changes = [
            change("mine", procedure, 2, step),
            change("other", ProcedureId::TotalIlluminance, 2, step),
            change("mine", ProcedureId::TotalIlluminance, 1, step),
        ];
        let found = figure(&history, &"mine".into(), procedure, &changes).into_string();
        assert_eq!(found.matches("class=\"change\"").count(), 1, "{found}");
        let caption = "Mean deviation of 2 comparisons, last +3.0 %. It changed by +1.0 % on 2026-01-03. Version 1.1 from 2026-01-02. ";
        assert!(found.contains(caption), "{found}");
        let quiet = figure(&history, &"other".into(), procedure, &changes).into_string();
        assert!(quiet.contains("Mean deviation of 1 comparisons, last +3.0 %. No change. </figcaption>"), "{quiet}");
        assert!(!quiet.contains("class=\"version\"") && !quiet.contains("class=\"mark\""), "{quiet}");
    }
}
