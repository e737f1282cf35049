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
