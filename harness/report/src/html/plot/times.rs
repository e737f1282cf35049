//! Run time against error: the cost of each engine's agreement, one panel for each procedure.

use std::collections::{BTreeSet, HashMap};

use itertools::Itertools;
use maud::{Markup, html};

use super::super::attachments::{AttachedReport, BenchCurve, BenchPoint};
use super::super::palette::Palette;
use super::super::{duration, percent};
use super::{Group, Marks, WIDTH, figure, groups, legend};
use crate::svg::{label, line, number, text};
use crate::verdict_lines::is_relative;
use crate::words::largest;
use luxproof_model::Basis;
use luxproof_model::Report;
use luxproof_model::{ProcedureId, Recording};

/// Space for the labels of the error axis, in user units.
const LEFT: f64 = 52.0;
const RIGHT: f64 = 12.0;
const TOP: f64 = 8.0;
const PLOT_HEIGHT: f64 = 210.0;
const PLOT_WIDTH: f64 = WIDTH - LEFT - RIGHT;
/// Errors below this share the lowest line: 1e-6 %.
const MIN_ERROR: f64 = 1e-8;
/// Run times below this share the left edge.
const MIN_TIME_S: f64 = 0.01;
/// Names of marks that are closer than this, in user units, would meet.
const NAME_WIDTH: f64 = 70.0;
const NAME_HEIGHT: f64 = 12.0;
/// Names of marks right of this part of the plot stand to the left of their mark.
const RIGHT_PART: f64 = 0.7;

/// One run: its time and the largest deviation from its firmest reference.
struct Run {
    engine: String,
    words: String,
    wall_s: f64,
    error: f64,
}

pub(in super::super) fn section(
    report: &Report,
    attachments: &[AttachedReport],
    palette: &Palette,
    marks: Marks,
) -> Markup {
    let mut panels: Vec<Markup> = vec![];
    for procedure in report.procedures() {
        panels.extend(panel(report, procedure, &curves(attachments, procedure), palette, marks));
    }
    html! {
        h2 id="time-title" { "Run time against error" }
        @if panels.is_empty() { p.lead { "No engine was compared with another's readings." } } @else {
            p.lead { "One mark for each run: the largest deviation over its meters from its firmest reference. Lower left is better; start-up counts." }
            div.panels { @for panel in panels { (panel) } }
        }
    }
}

/// The cost curves of a procedure among the attached measurements.
fn curves(attachments: &[AttachedReport], procedure: ProcedureId) -> Vec<&BenchCurve> {
    let mut found = vec![];
    for attachment in attachments {
        if let AttachedReport::Bench(curves) = attachment {
            found.extend(curves.iter().filter(|c| c.procedure == procedure));
        }
    }
    found
}

/// The runs of a procedure that have a reference.
fn runs(report: &Report, procedure: ProcedureId) -> Vec<Run> {
    let mut runs = vec![];
    let mut by_case: HashMap<&str, Vec<&Recording>> = HashMap::new();
    for recording in report.recordings.iter().filter(|r| r.key.procedure == procedure) {
        by_case.entry(&recording.key.case).or_default().push(recording);
    }
    for group in groups(report, procedure) {
        let Some(basis) = group.basis() else { continue };
        for recording in by_case.remove(group.case).unwrap_or_default() {
            if let Some(error) = largest_error(&group, recording, basis) {
                let engine = recording.key.engine.to_string();
                let words = format!("{engine}, {}: {}, {}", group.case, duration(recording.wall_s), percent(error));
                runs.push(Run { engine, words, wall_s: recording.wall_s, error });
            }
        }
    }
    runs
}

/// The size of a recording's largest deviation from references of one basis.
fn largest_error(group: &Group<'_>, recording: &Recording, basis: Basis) -> Option<f64> {
    let compared =
        group.comparisons.iter().filter(|c| c.key.engine == recording.key.engine && c.basis() == Some(basis));
    largest(compared.filter(|c| is_relative(c)).filter_map(|c| c.relative_deviation)).map(f64::abs)
}

fn panel(
    report: &Report,
    procedure: ProcedureId,
    curves: &[&BenchCurve],
    palette: &Palette,
    marks: Marks,
) -> Option<Markup> {
    let runs = runs(report, procedure);
    let axes = Axes::for_points(&runs, curves)?;
    let of_curves = curves.iter().map(|c| c.engine.as_str());
    let engines = palette.sorted(runs.iter().map(|run| run.engine.as_str()).chain(of_curves));
    let names = place_names(&runs, &engines, &axes);
    let mut places = BTreeSet::new();
    let mut shown: Vec<&Run> = runs.iter().collect();
    if marks == Marks::Seen {
        // Marks of one engine at the same place hide one another.
        shown.retain(|run| places.insert((&*run.engine, axes.place(run.wall_s, run.error).map(|x| x.round() as i64))));
    }
    let drawing = html! {
        (axes.grid())
        @for curve in curves { (draw_curve(curve, palette, &axes)) }
        @for (engine, place) in &names { (draw_name(engine, *place)) }
        @for run in &shown { g.ring { title { (run.words) } (palette.mark(&run.engine, axes.place(run.wall_s, run.error), 4.4)) } }
    };
    let has_least = runs.iter().any(|run| run.error < MIN_ERROR);
    let caption = html! {
        (legend(&engines, palette)) @if has_least { " At the lower edge: 10⁻⁶ % or less." } @if !curves.is_empty() { " Lines: the ladder of luxproof bench." }
        @if shown.len() < runs.len() { " Drawn: " (shown.len()) " of " (runs.len()) " runs; the others are at the same places." }
    };
    Some(figure(procedure.title(), TOP + PLOT_HEIGHT + 38.0, &drawing, &caption))
}

/// The logarithmic axes of a panel.
struct Axes {
    time: Decades,
    error: Decades,
}

impl Axes {
    /// Axes that hold all runs and curves; `None` where there are none.
    fn for_points(runs: &[Run], curves: &[&BenchCurve]) -> Option<Self> {
        let mut times: Vec<f64> = runs.iter().map(|run| run.wall_s).collect();
        let mut errors: Vec<f64> = runs.iter().map(|run| run.error).collect();
        for (point, error) in curves.iter().flat_map(|curve| measured_points(curve)) {
            times.push(point.wall_s);
            errors.push(error);
        }
        if times.is_empty() {
            return None;
        }
        Some(Self { time: Decades::for_values(&times, MIN_TIME_S), error: Decades::for_values(&errors, MIN_ERROR) })
    }

    fn place(&self, wall_s: f64, error: f64) -> [f64; 2] {
        [LEFT + PLOT_WIDTH * self.time.part(wall_s), TOP + PLOT_HEIGHT * (1.0 - self.error.part(error))]
    }

    /// The decades of the error axis that have a line: every second one where there are many.
    fn error_decades(&self) -> impl Iterator<Item = i32> {
        let Decades { low, high, .. } = self.error;
        (low..=high).step_by(if high - low <= 5 { 1 } else { 2 })
    }

    fn grid(&self) -> Markup {
        html! {
            @for decade in self.time.low..=self.time.high {
                @let [x, _] = self.place(10f64.powi(decade), 1.0);
                (line("grid", [x, TOP], [x, TOP + PLOT_HEIGHT]))
                (text("tick", "middle", [x, TOP + PLOT_HEIGHT + 15.0], &power_label(decade)))
            }
            @for decade in self.error_decades() {
                @let [_, y] = self.place(1.0, 10f64.powi(decade));
                (line("grid", [LEFT, y], [LEFT + PLOT_WIDTH, y]))
                // The axis is in percent.
                (text("tick", "end", [LEFT - 6.0, y + 4.0], &power_label(decade + 2)))
            }
            (text("axis", "middle", [LEFT + 0.5 * PLOT_WIDTH, TOP + PLOT_HEIGHT + 31.0], "run time [s]"))
            text.axis text-anchor="middle" transform={ "translate(11 " (TOP + 0.5 * PLOT_HEIGHT) ") rotate(-90)" } { "largest deviation [%]" }
        }
    }
}

/// The points of a curve with a known error.
fn measured_points(curve: &BenchCurve) -> impl Iterator<Item = (&BenchPoint, f64)> {
    curve.points.iter().filter_map(|p| Some((p, p.relative_error?)))
}

/// Draws the name of an engine next to its mark.
fn draw_name(engine: &str, [x, y]: [f64; 2]) -> Markup {
    if x > LEFT + RIGHT_PART * PLOT_WIDTH {
        text("direct halo", "end", [x - 8.0, y + 4.0], engine)
    } else {
        text("direct halo", "start", [x + 8.0, y + 4.0], engine)
    }
}

/// Places the name of each engine at its middle mark, and moves names down until they do not meet.
fn place_names<'a>(runs: &[Run], engines: &[&'a str], axes: &Axes) -> Vec<(&'a str, [f64; 2])> {
    let mut names: Vec<(&'a str, [f64; 2])> = vec![];
    for engine in engines {
        let of_engine = runs.iter().filter(|run| run.engine == *engine);
        let by_error = of_engine.sorted_by(|a, b| a.error.total_cmp(&b.error)).collect_vec();
        if let Some(run) = by_error.get(by_error.len() / 2) {
            names.push((*engine, axes.place(run.wall_s, run.error)));
        }
    }
    names.sort_by(|a, b| a.1[1].total_cmp(&b.1[1]));
    for k in 1..names.len() {
        let [x, y] = names[k].1;
        let near = names[..k].iter().filter(|(_, place)| (place[0] - x).abs() < NAME_WIDTH);
        let lowest = near.map(|(_, place)| place[1] + NAME_HEIGHT).fold(f64::NEG_INFINITY, f64::max);
        names[k].1[1] = y.max(lowest);
    }
    // Names below the plot move up again, and push up those that they meet.
    let mut floor = TOP + PLOT_HEIGHT - 4.0;
    for (_, place) in names.iter_mut().rev() {
        if place[1] > floor {
            place[1] = floor;
            floor -= NAME_HEIGHT;
        }
    }
    names
}

/// Draws a cost curve with the intervals of its errors.
fn draw_curve(curve: &BenchCurve, palette: &Palette, axes: &Axes) -> Markup {
    let points = measured_points(curve).sorted_by(|a, b| a.0.wall_s.total_cmp(&b.0.wall_s)).collect_vec();
    let places = points.iter().map(|(p, error)| axes.place(p.wall_s, *error));
    let path: Vec<String> = places.map(|[x, y]| format!("{} {}", number(x), number(y))).collect();
    let class = format!("line e{}", palette.index(&curve.engine));
    html! {
        @if path.len() > 1 { path class=(class) d={ "M" (path.join("L")) } {} }
        @for (p, error) in &points {
            @if let Some((low, high)) = p.relative_error_low.zip(p.relative_error_high) {
                (line(&class, axes.place(p.wall_s, low), axes.place(p.wall_s, high)))
            }
            g.ring { (palette.mark(&curve.engine, axes.place(p.wall_s, *error), 2.4)) }
        }
    }
}

/// Whole decades of a logarithmic axis.
struct Decades {
    low: i32,
    high: i32,
    /// Smaller values lie at this one.
    least: f64,
}

impl Decades {
    /// The decades that hold all values.
    fn for_values(values: &[f64], least: f64) -> Self {
        let raised = values.iter().map(|value| value.max(least));
        let (low, high) = raised.fold((f64::INFINITY, 0.0_f64), |(low, high), v| (low.min(v), high.max(v)));
        let low = low.log10().floor() as i32;
        Self { low, high: (high.log10().ceil() as i32).max(low + 1), least }
    }

    /// Where a value lies on the axis, from 0 to 1.
    fn part(&self, value: f64) -> f64 {
        let log = value.max(self.least).log10();
        ((log - f64::from(self.low)) / f64::from(self.high - self.low)).clamp(0.0, 1.0)
    }
}

/// A power of ten, as a plain number where that is short.
fn power_label(exponent: i32) -> String {
    if (-2..=3).contains(&exponent) { label(10f64.powi(exponent)) } else { super::super::power(exponent) }
}
