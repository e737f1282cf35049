//! The trend of an engine in a procedure as a picture: its mean deviation over the nights.

use maud::{Markup, html};

use super::change::{Change, Course};
use super::series::{History, Series, VersionChange};
use crate::record::{EngineName, ProcedureId};

const WIDTH: f64 = 480.0;
const HEIGHT: f64 = 170.0;
const LEFT: f64 = 62.0;
const TOP: f64 = 22.0;
const BOTTOM: f64 = 22.0;

/// The mean relative deviation of some series on each night, a reading with a small standard error counting for more.
///
/// With e the relative standard error of a reading over all nights this is sum(d / e) / sum(1 / e): what change points are
/// found in, in units that mean something. Series that miss nights are left out of all if others do not.
pub(super) fn mean_deviation(members: &[&Series], nights: usize) -> Vec<f64> {
    let there = |s: &Series| s.deviation.iter().filter(|d| d.is_finite()).count();
    let most = members.iter().map(|s| there(s)).max().unwrap_or(0);
    let mut sums = vec![(0.0, 0.0); nights];
    for series in members.iter().filter(|s| 10 * there(s) >= 9 * most) {
        let count = there(series).max(1) as f64;
        let finite = |values: &[f64]| values.iter().filter(|v| v.is_finite()).map(|v| v * v).sum::<f64>();
        let reference = (finite(&series.reference) / count).sqrt();
        let error = ((finite(&series.std_error) / count).sqrt() / reference).max(1e-6);
        let is_there = |d: &f64| d.is_finite() && reference > 0.0;
        for (sum, deviation) in sums.iter_mut().zip(&series.deviation).filter(|(_, d)| is_there(d)) {
            *sum = (sum.0 + deviation / reference / error, sum.1 + 1.0 / error);
        }
    }
    sums.into_iter().map(|(sum, weight)| if weight > 0.0 { sum / weight } else { f64::NAN }).collect()
}

pub(super) fn figure(history: &History, engine: &EngineName, procedure: ProcedureId, changes: &[Change]) -> Markup {
    let members = history.of_engine(engine, procedure);
    let values = mean_deviation(&members, history.nights.len());
    let mine: Vec<&Change> = changes.iter().filter(|c| c.engine == *engine && c.procedure == procedure).collect();
    let versions: Vec<&VersionChange> = history.version_changes.iter().filter(|v| v.engine == *engine).collect();
    let id = format!("{engine}-{procedure}");
    let last = values.iter().rev().find(|v| v.is_finite());
    let frame = Frame::of(&values);
    html! {
        figure {
            h3 id={ (id) "-title" } { (engine) " · " (procedure) }
            @if let Some(last) = last {
                svg viewBox={ "0 0 " (WIDTH) " " (HEIGHT) } role="img" aria-labelledby={ (id) "-title " (id) "-caption" } {
                    (frame.axes(history))
                    @for version in &versions { (frame.upright("version", version.night, &version.to)) }
                    (frame.curve(&values))
                    @for change in &mine {
                        (frame.upright("change", change.night, ""))
                        (frame.mark(change.night))
                    }
                }
                figcaption id={ (id) "-caption" } {
                    "Mean deviation of " (members.len()) " comparisons, last " (percent(*last)) ". "
                    @if mine.is_empty() { "No change. " }
                    @for change in &mine { "It " (course(history, change)) ". " }
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

/// What a deviation did, and when: `drifts by +0.0500 % ± 0.0060 % a night since 2026-03-01`.
pub(super) fn course(history: &History, change: &Change) -> String {
    let (date, by) = (|night: usize| history.nights.get(night).map_or("", String::as_str), by(change.course));
    match change.course {
        Course::Step { .. } => format!("changed by {by} on {}", date(change.night)),
        Course::Drift { until: None, .. } => format!("drifts by {by} since {}", date(change.night)),
        Course::Drift { until: Some(end), .. } => {
            format!("drifted by {by} from {} to {}", date(change.night), date(end.saturating_sub(1)))
        }
    }
}

pub(super) fn by(course: Course) -> String {
    match course {
        Course::Step { relative, .. } => percent(relative),
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

struct Frame {
    nights: usize,
    low: f64,
    high: f64,
}

impl Frame {
    fn of(values: &[f64]) -> Self {
        let finite = || values.iter().copied().filter(|v| v.is_finite());
        let (low, high) = (finite().fold(f64::INFINITY, f64::min), finite().fold(f64::NEG_INFINITY, f64::max));
        // Zero is in sight where it is near; what repeats exactly lies in the middle.
        let margin = (0.15 * (high - low)).max(0.05 * high.abs().max(low.abs())).max(1e-9);
        Self { nights: values.len(), low: low - margin, high: high + margin }
    }

    fn x(&self, night: f64) -> f64 {
        round(LEFT + (WIDTH - LEFT - 8.0) * night / (self.nights.max(2) - 1) as f64)
    }

    fn y(&self, value: f64) -> f64 {
        round(TOP + (HEIGHT - TOP - BOTTOM) * (self.high - value) / (self.high - self.low))
    }

    fn axes(&self, history: &History) -> Markup {
        let ends = [self.low, 0.5 * (self.low + self.high), self.high];
        let (first, last) = (history.nights.first(), history.nights.last());
        html! {
            @for value in ends {
                line.axis x1=(LEFT) x2=(WIDTH - 8.0) y1=(self.y(value)) y2=(self.y(value)) {}
                text x=(LEFT - 6.0) y=(self.y(value) + 4.0) text-anchor="end" { (percent(value)) }
            }
            text x=(LEFT) y=(HEIGHT - 5.0) { (first.map_or("", String::as_str)) }
            @if self.nights > 1 {
                text x=(WIDTH - 8.0) y=(HEIGHT - 5.0) text-anchor="end" { (last.map_or("", String::as_str)) }
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
            @if self.nights <= 40 {
                @for (night, value) in values.iter().enumerate().filter(|(_, v)| v.is_finite()) {
                    circle.dot cx=(self.x(night as f64)) cy=(self.y(*value)) r="2" {}
                }
            }
        }
    }

    /// A vertical line just before a night.
    fn upright(&self, class: &str, night: usize, label: &str) -> Markup {
        let x = self.x(night as f64 - 0.5);
        let anchor = if x > 0.7 * WIDTH { "end" } else { "start" };
        html! {
            line class=(class) x1=(x) x2=(x) y1=(TOP - 6.0) y2=(HEIGHT - BOTTOM) {}
            @if !label.is_empty() { text x=(x) y=(TOP - 9.0) text-anchor=(anchor) { (label) } }
        }
    }

    /// A triangle that points at the line of a change: colour alone says nothing to everybody.
    fn mark(&self, night: usize) -> Markup {
        let (x, y) = (self.x(night as f64 - 0.5), HEIGHT - BOTTOM);
        html! { path.mark d=(format!("M{x} {}l-5 8h10z", y - 2.0)) {} }
    }
}

/// A tenth of a pixel is enough.
fn round(v: f64) -> f64 {
    (10.0 * v).round() / 10.0
}
