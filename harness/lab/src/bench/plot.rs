//! A plot of error against time as SVG: log-log, a panel for each case and procedure, a colour for
//! each engine, and error bars.

use std::collections::BTreeMap;

use maud::{Markup, html};

use super::curve::{BenchPoint, Curve};
use super::{BenchReport, Pareto};
use luxproof_report::svg::{line, number, text};

/// The size of a panel, in the units of the drawing.
const PANEL_SIZE: [f64; 2] = [760.0, 380.0];
/// The plotted area of a panel; the legend is to the right of it.
const LEFT: f64 = 80.0;
const RIGHT: f64 = 520.0;
const TOP: f64 = 36.0;
const BOTTOM: f64 = 330.0;
/// Distances within the legend.
const LEGEND_LINE: f64 = 16.0;
const LEGEND_SWATCH: f64 = 20.0;
/// More characters of a curve's name do not fit into the legend.
const MAX_NAME_CHARS: usize = 34;
/// An axis with more decades labels only some of them.
const MAX_LABELLED_DECADES: i32 = 8;
/// The radius of a point, and half the width of an error bar's ends.
const POINT_RADIUS: f64 = 3.0;
/// The colours of Okabe & Ito, which people with any colour vision can distinguish.
const COLOURS: [&str; 7] = ["#000000", "#e69f00", "#0072b2", "#009e73", "#d55e00", "#cc79a7", "#56b4e9"];
/// The lengths of dashes and gaps; the first curve of an engine is unbroken.
const DASHES: [&str; 4] = ["none", "6 3", "2 3", "12 4"];
/// Smaller errors are drawn at this one, because zero has no place on a logarithmic axis.
const MIN_DRAWN_ERROR: f64 = 1e-9;
const STYLE: &str = ".title{font-size:14px}.grid{stroke:#d8d8d8;stroke-width:.8}.axis{fill:none;stroke:#555}.tick{fill:#555}\
                     .curve path{fill:none;stroke-width:2}.curve .bar{stroke-width:1}.curve circle{stroke:none}";

impl BenchReport {
    /// The plot of all panels.
    pub fn svg(&self) -> String {
        let [width, panel_height] = PANEL_SIZE;
        let height = panel_height * self.pareto.len() as f64;
        let svg = html! {
            svg xmlns="http://www.w3.org/2000/svg" viewBox={ "0 0 " (width) " " (height) } font-family="sans-serif" font-size="11" {
                style { (STYLE) }
                rect width=(width) height=(height) fill="#ffffff" {}
                @for (k, pareto) in self.pareto.iter().enumerate() {
                    g transform={ "translate(0 " (panel_height * k as f64) ")" } { (self.draw_panel(pareto)) }
                }
            }
        };
        svg.into_string() + "\n"
    }

    /// Draws the curves of a case and procedure.
    fn draw_panel(&self, pareto: &Pareto) -> Markup {
        let curves: Vec<&Curve> =
            self.curves.iter().filter(|c| c.key.case == pareto.case && c.key.procedure == pareto.procedure).collect();
        let points: Vec<&BenchPoint> = curves.iter().flat_map(|c| &c.points).collect();
        let times = LogAxis::new(points.iter().map(|p| p.wall_s), [LEFT, RIGHT]);
        let errors = LogAxis::new(points.iter().map(|p| drawn_error(p.relative_error)), [BOTTOM, TOP]);
        let title = format!("{}, {}", pareto.case, pareto.procedure.name().replace('_', " "));
        let mut curves_of_engine = BTreeMap::new();
        html! {
            (text("title", "middle", [PANEL_SIZE[0] / 2.0, 22.0], &title))
            @for exponent in times.ticks() {
                @let x = times.place(power_of_ten(exponent));
                (line("grid", [x, TOP], [x, BOTTOM]))
                (text("tick", "middle", [x, BOTTOM + 16.0], &format_label(power_of_ten(exponent))))
            }
            @for exponent in errors.ticks() {
                @let y = errors.place(power_of_ten(exponent));
                (line("grid", [LEFT, y], [RIGHT, y]))
                (text("tick", "end", [LEFT - 6.0, y + 4.0], &format!("{} %", format_label(power_of_ten(exponent + 2)))))
            }
            path.axis d={ "M" (LEFT) " " (TOP) "V" (BOTTOM) "H" (RIGHT) } {}
            (text("tick", "middle", [f64::midpoint(LEFT, RIGHT), BOTTOM + 36.0], "wall-clock seconds"))
            @for (row, curve) in curves.iter().enumerate() {
                @let engine = self.engines.keys().position(|e| curve.key.engine == *e).unwrap_or(0);
                @let nth = count_one_more(&mut curves_of_engine, engine);
                (draw_curve(curve, &times, &errors, COLOURS[engine % COLOURS.len()], DASHES[nth % DASHES.len()], row))
            }
        }
    }
}

/// Returns how many curves an engine had so far, and counts one more.
fn count_one_more(counts: &mut BTreeMap<usize, usize>, engine: usize) -> usize {
    let count = counts.entry(engine).or_default();
    *count += 1;
    *count - 1
}

/// Draws a curve with its error bars, and its row in the legend.
fn draw_curve(curve: &Curve, times: &LogAxis, errors: &LogAxis, colour: &str, dashes: &str, row: usize) -> Markup {
    let place = |time: f64, error: f64| [times.place(time), errors.place(drawn_error(error))];
    let path: Vec<String> = curve
        .points
        .iter()
        .map(|p| place(p.wall_s, p.relative_error))
        .map(|[x, y]| format!("{} {}", number(x), number(y)))
        .collect();
    let (legend_x, legend_y) = (RIGHT + 20.0, TOP + 8.0 + LEGEND_LINE * row as f64);
    let name: String = curve.name().chars().take(MAX_NAME_CHARS).collect();
    html! {
        g.curve stroke=(colour) fill=(colour) {
            path stroke-dasharray=(dashes) d={ "M" (path.join("L")) } {}
            @for point in &curve.points {
                @let [x, y] = place(point.wall_s, point.relative_error);
                @let [low, high] = [point.relative_error_low, point.relative_error_high].map(|e| place(point.wall_s, e)[1]);
                (line("bar", [x, low], [x, high]))
                @for end in [low, high] { (line("bar", [x - POINT_RADIUS, end], [x + POINT_RADIUS, end])) }
                circle cx=(number(x)) cy=(number(y)) r=(POINT_RADIUS) {}
            }
            path stroke-dasharray=(dashes) d={ "M" (legend_x) " " (legend_y) "h" (LEGEND_SWATCH) } {}
        }
        (text("tick", "start", [legend_x + LEGEND_SWATCH + 6.0, legend_y + 4.0], &name))
    }
}

/// A logarithmic axis over whole decades.
struct LogAxis {
    /// The exponents of ten at both ends.
    decades: [i32; 2],
    /// The coordinates of both ends.
    ends: [f64; 2],
}

impl LogAxis {
    /// Makes an axis that contains all positive values.
    fn new(values: impl Iterator<Item = f64>, ends: [f64; 2]) -> Self {
        let logs: Vec<f64> = values.filter(|v| *v > 0.0).map(f64::log10).collect();
        let low = logs.iter().copied().reduce(f64::min).map_or(-1, |log| log.floor() as i32);
        let high = logs.iter().copied().reduce(f64::max).map_or(0, |log| log.ceil() as i32);
        Self { decades: [low, high.max(low + 1)], ends }
    }

    /// Returns the coordinate of a value. Values beyond the axis are at its ends.
    fn place(&self, value: f64) -> f64 {
        let [low, high] = self.decades.map(f64::from);
        let part = ((value.log10() - low) / (high - low)).clamp(0.0, 1.0);
        self.ends[0] + part * (self.ends[1] - self.ends[0])
    }

    /// Returns the powers of ten with a label, as exponents.
    fn ticks(&self) -> Vec<i32> {
        let [low, high] = self.decades;
        let step = 1 + (high - low) / MAX_LABELLED_DECADES;
        (low..=high).step_by(step as usize).collect()
    }
}

/// Returns the number nearest to a power of ten, which `powi` is not.
fn power_of_ten(exponent: i32) -> f64 {
    format!("1e{exponent}").parse().unwrap_or(f64::NAN)
}

/// The error at which a point is drawn.
fn drawn_error(error: f64) -> f64 {
    error.max(MIN_DRAWN_ERROR)
}

/// A number as the label of an axis.
fn format_label(value: f64) -> String {
    if (1e-3..1e4).contains(&value) { format!("{value}") } else { format!("{value:e}") }
}
