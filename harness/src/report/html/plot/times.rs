//! Run time against error: what each engine's agreement costs, one panel a procedure.

use std::collections::{BTreeSet, HashMap};

use itertools::Itertools;
use maud::{Markup, html};

use super::super::beside::{BenchCurve, Beside};
use super::super::palette::Palette;
use super::super::{duration, percent};
use super::{Marks, WIDTH, figure, groups, legend};
use crate::judge::Comparison;
use crate::record::{ProcedureId, Recording};
use crate::report::Report;
use crate::report::svg::{label, line, number, text};
use crate::report::words::largest;

const LEFT: f64 = 52.0;
const TOP: f64 = 8.0;
const PLOT: f64 = 210.0;
/// Errors below this share the lowest line: 1e-6 %.
const MIN_ERROR: f64 = 1e-8;
/// Run times below this share the left edge.
const MIN_TIME_S: f64 = 0.01;

/// One run: how long it took and the largest deviation from its firmest reference.
struct Point {
    engine: String,
    words: String,
    wall_s: f64,
    error: f64,
}

pub(in super::super) fn section(report: &Report, beside: &[Beside], palette: &Palette, marks: Marks) -> Markup {
    let of = |procedure| panel(report, procedure, &curves(beside, procedure), palette, marks);
    let panels: Vec<Markup> = report.procedures().into_iter().filter_map(of).collect();
    html! {
        h2 id="time-title" { "Run time against error" }
        @if panels.is_empty() { p.lead { "No engine was held against another's readings." } } @else {
            p.lead { "One mark a run: the largest deviation over its meters from its firmest reference. Towards the lower left is better; start-up counts." }
            div.panels { @for panel in panels { (panel) } }
        }
    }
}

fn curves<'a>(beside: &'a [Beside], procedure: ProcedureId) -> Vec<&'a BenchCurve> {
    let of = |b: &'a Beside| if let Beside::Bench(curves) = b { &curves[..] } else { &[] };
    beside.iter().flat_map(of).filter(|c| c.procedure == procedure).collect()
}

fn points(report: &Report, procedure: ProcedureId) -> Vec<Point> {
    let mut points = vec![];
    let mut of_case: HashMap<&str, Vec<&Recording>> = HashMap::new();
    for recording in report.recordings.iter().filter(|r| r.key.procedure == procedure) {
        of_case.entry(&recording.key.case).or_default().push(recording);
    }
    for group in groups(report, procedure) {
        let Some(basis) = group.basis() else { continue };
        for recording in of_case.remove(group.case).unwrap_or_default() {
            let mine = |c: &&&Comparison| c.key.engine == recording.key.engine && c.basis() == Some(basis);
            let errors = group.comparisons.iter().filter(mine).filter_map(|c| c.relative_deviation);
            if let Some(error) = largest(errors).map(f64::abs) {
                let engine = recording.key.engine.to_string();
                let words = format!("{engine}, {}: {}, {}", group.case, duration(recording.wall_s), percent(error));
                points.push(Point { engine, words, wall_s: recording.wall_s, error });
            }
        }
    }
    points
}

fn panel(
    report: &Report,
    procedure: ProcedureId,
    curves: &[&BenchCurve],
    palette: &Palette,
    marks: Marks,
) -> Option<Markup> {
    let points = points(report, procedure);
    let rungs = curves.iter().flat_map(|c| &c.points).filter_map(|p| Some((p.wall_s, p.relative_error?)));
    let all: Vec<(f64, f64)> = points.iter().map(|p| (p.wall_s, p.error)).chain(rungs).collect();
    let span = |pick: fn(&(f64, f64)) -> f64, least: f64| {
        let (low, high) =
            all.iter().map(pick).map(|v| v.max(least)).fold((f64::INFINITY, 0.0_f64), |(l, h), v| (l.min(v), h.max(v)));
        let low = low.log10().floor() as i32;
        Decades { low, high: (high.log10().ceil() as i32).max(low + 1), least }
    };
    if all.is_empty() {
        return None;
    }
    let (time, error) = (span(|p| p.0, MIN_TIME_S), span(|p| p.1, MIN_ERROR));
    let width = WIDTH - LEFT - 12.0;
    let place = |wall_s: f64, e: f64| [LEFT + width * time.part(wall_s), TOP + PLOT * (1.0 - error.part(e))];
    let of_curves = curves.iter().map(|c| c.engine.as_str());
    let engines = palette.sorted(points.iter().map(|p| p.engine.as_str()).chain(of_curves));
    let labels = labels(&points, &engines, &place);
    let mut taken = BTreeSet::new();
    let at = |point: &Point| place(point.wall_s, point.error).map(|x| x.round() as i64);
    let seen = points.iter().filter(|p| marks == Marks::Every || taken.insert((&*p.engine, at(p)))).collect_vec();
    let drawing = html! {
        @for decade in time.low..=time.high {
            @let [x, _] = place(10f64.powi(decade), 1.0);
            (line("grid", [x, TOP], [x, TOP + PLOT])) (text("tick", "middle", [x, TOP + PLOT + 15.0], &power(decade)))
        }
        @for decade in (error.low..=error.high).filter(|d| error.high - error.low <= 5 || (d - error.low) % 2 == 0) {
            @let [_, y] = place(1.0, 10f64.powi(decade));
            (line("grid", [LEFT, y], [LEFT + width, y])) (text("tick", "end", [LEFT - 6.0, y + 4.0], &power(decade + 2)))
        }
        (text("axis", "middle", [LEFT + 0.5 * width, TOP + PLOT + 31.0], "run time [s]"))
        text.axis text-anchor="middle" transform={ "translate(11 " (TOP + 0.5 * PLOT) ") rotate(-90)" } { "largest deviation [%]" }
        @for curve in curves { (drawn(curve, palette, &place)) }
        @for (engine, [x, y]) in &labels { (text("direct halo", if *x > LEFT + 0.7 * width { "end" } else { "start" }, [if *x > LEFT + 0.7 * width { x - 8.0 } else { x + 8.0 }, y + 4.0], engine)) }
        @for point in &seen { g.ring { title { (point.words) } (palette.mark(&point.engine, place(point.wall_s, point.error), 4.4)) } }
    };
    let floor = points.iter().any(|p| p.error < MIN_ERROR);
    let caption = html! {
        (legend(&engines, palette)) @if floor { " At the lower edge: 10⁻⁶ % or less." } @if !curves.is_empty() { " Lines: the ladder of luxproof bench." }
        @if seen.len() < points.len() { " Drawn: " (seen.len()) " of " (points.len()) " runs; the others lie upon these." }
    };
    Some(figure(procedure.row().title, TOP + PLOT + 38.0, &drawing, &caption))
}

/// Where each engine is named: at its middle mark, pushed down until names do not meet.
fn labels<'a>(
    points: &[Point],
    engines: &[&'a str],
    place: &impl Fn(f64, f64) -> [f64; 2],
) -> Vec<(&'a str, [f64; 2])> {
    let middle = |engine: &&'a str| {
        let mine = points.iter().filter(|p| p.engine == *engine);
        let mine = mine.sorted_by(|a, b| a.error.total_cmp(&b.error)).collect_vec();
        mine.get(mine.len() / 2).map(|p| (*engine, place(p.wall_s, p.error)))
    };
    let mut labels = engines.iter().filter_map(middle).sorted_by(|a, b| a.1[1].total_cmp(&b.1[1])).collect_vec();
    for k in 1..labels.len() {
        let clear = |other: &(&str, [f64; 2])| (other.1[0] - labels[k].1[0]).abs() < 70.0;
        let above = labels[..k].iter().filter(|o| clear(o)).map(|o| o.1[1] + 12.0).fold(f64::NEG_INFINITY, f64::max);
        labels[k].1[1] = labels[k].1[1].max(above);
    }
    // What was pushed below the plot comes up again, and what it meets with it.
    let mut floor = TOP + PLOT - 4.0;
    for label in labels.iter_mut().rev() {
        if label.1[1] > floor {
            label.1[1] = floor;
            floor -= 12.0;
        }
    }
    labels
}

fn drawn(curve: &BenchCurve, palette: &Palette, place: &impl Fn(f64, f64) -> [f64; 2]) -> Markup {
    let rungs = curve.points.iter().filter_map(|p| Some((p, p.relative_error?)));
    let rungs = rungs.sorted_by(|a, b| a.0.wall_s.total_cmp(&b.0.wall_s)).collect_vec();
    let path: Vec<String> =
        rungs.iter().map(|(p, e)| place(p.wall_s, *e)).map(|[x, y]| format!("{} {}", number(x), number(y))).collect();
    let class = format!("line e{}", palette.index(&curve.engine));
    html! {
        @if path.len() > 1 { path class=(class) d={ "M" (path.join("L")) } {} }
        @for (p, e) in &rungs {
            @if let Some((low, high)) = p.relative_error_low.zip(p.relative_error_high) { (line(&class, place(p.wall_s, low), place(p.wall_s, high))) }
            g.ring { (palette.mark(&curve.engine, place(p.wall_s, *e), 2.4)) }
        }
    }
}

/// Whole decades of a logarithmic axis.
struct Decades {
    low: i32,
    high: i32,
    least: f64,
}

impl Decades {
    fn part(&self, value: f64) -> f64 {
        let log = value.max(self.least).log10();
        ((log - f64::from(self.low)) / f64::from(self.high - self.low)).clamp(0.0, 1.0)
    }
}

fn power(exponent: i32) -> String {
    if (-2..=3).contains(&exponent) { label(10f64.powi(exponent)) } else { super::super::power(exponent) }
}
