//! Error against time as SVG: log-log, one panel a case and procedure, one colour an engine, error bars.

use super::curve::{BenchPoint, Curve};
use super::{BenchReport, Pareto};
use crate::record::EngineName;

const WIDTH: f64 = 760.0;
const PANEL: f64 = 380.0;
const LEFT: f64 = 70.0;
const RIGHT: f64 = 200.0;
const TOP: f64 = 34.0;
const BOTTOM: f64 = 46.0;
/// Okabe & Ito's colours, told apart by everybody.
const COLOURS: [&str; 7] = ["#000000", "#e69f00", "#0072b2", "#009e73", "#d55e00", "#cc79a7", "#56b4e9"];
const DASHES: [&str; 4] = ["none", "6 3", "2 3", "8 3 2 3"];
/// Errors below this are drawn at it: none at all has no place on a logarithmic axis.
const LEAST: f64 = 1e-9;

impl BenchReport {
    pub fn svg(&self) -> String {
        let height = PANEL * self.pareto.len() as f64;
        let mut text = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{WIDTH}\" height=\"{height}\" viewBox=\"0 0 {WIDTH} {height}\" \
             font-family=\"sans-serif\" font-size=\"12\">\n<rect width=\"{WIDTH}\" height=\"{height}\" fill=\"white\"/>\n"
        );
        let engines: Vec<&EngineName> = self.engines.keys().collect();
        for (k, pareto) in self.pareto.iter().enumerate() {
            text.push_str(&self.panel(pareto, k as f64 * PANEL, &engines));
        }
        text.push_str("</svg>\n");
        text
    }

    fn panel(&self, pareto: &Pareto, top: f64, engines: &[&EngineName]) -> String {
        let mine = |c: &&Curve| c.key.case == pareto.case && c.key.procedure == pareto.procedure;
        let curves: Vec<&Curve> = self.curves.iter().filter(mine).collect();
        let points = || curves.iter().flat_map(|c| &c.points);
        let x = Axis::of(points().map(|p| p.wall_s), LEFT, WIDTH - RIGHT);
        let y = Axis::of(points().map(|p| p.relative_error.max(LEAST)), top + PANEL - BOTTOM, top + TOP);
        let title = format!("{}, {}", escaped(&pareto.case), escaped(&pareto.procedure.name().replace('_', " ")));
        let mut text = format!("<text x=\"{LEFT}\" y=\"{}\" font-weight=\"bold\">{title}</text>\n", top + 22.0);
        text.push_str(&grid(&x, &y));
        let mut of_engine = std::collections::BTreeMap::new();
        for (k, curve) in curves.iter().enumerate() {
            let engine = engines.iter().position(|e| curve.key.engine == **e).unwrap_or(0);
            let n: &mut usize = of_engine.entry(engine).or_default();
            let (colour, dash) = (COLOURS[engine % COLOURS.len()], DASHES[*n % DASHES.len()]);
            *n += 1;
            text.push_str(&drawn(curve, &x, &y, colour, dash));
            let (at, line) = (WIDTH - RIGHT + 14.0, top + TOP + 18.0 * k as f64 + 8.0);
            text.push_str(&format!(
                "<line x1=\"{at}\" y1=\"{line}\" x2=\"{}\" y2=\"{line}\" stroke=\"{colour}\" stroke-dasharray=\"{dash}\" stroke-width=\"2\"/>\
                 <text x=\"{}\" y=\"{}\" font-size=\"10\">{}</text>\n",
                at + 22.0,
                at + 28.0,
                line + 4.0,
                escaped(&curve.name().chars().take(30).collect::<String>())
            ));
        }
        text
    }
}

/// A logarithmic axis over whole decades.
struct Axis {
    low: i32,
    high: i32,
    from: f64,
    to: f64,
}

impl Axis {
    fn of(values: impl Iterator<Item = f64>, from: f64, to: f64) -> Self {
        let logs: Vec<f64> = values.filter(|v| *v > 0.0).map(f64::log10).collect();
        let low = logs.iter().copied().fold(f64::INFINITY, f64::min).floor();
        let high = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max).ceil();
        let (low, high) = if low.is_finite() { (low as i32, high as i32) } else { (-1, 0) };
        Self { low, high: high.max(low + 1), from, to }
    }

    fn place(&self, value: f64) -> f64 {
        let part = (value.max(1e-300).log10() - f64::from(self.low)) / f64::from(self.high - self.low);
        self.from + part.clamp(0.0, 1.0) * (self.to - self.from)
    }
}

fn grid(x: &Axis, y: &Axis) -> String {
    let line = |x1: f64, y1: f64, x2: f64, y2: f64| {
        format!("<line x1=\"{x1:.1}\" y1=\"{y1:.1}\" x2=\"{x2:.1}\" y2=\"{y2:.1}\" stroke=\"#ddd\"/>")
    };
    let words = |x: f64, y: f64, anchor: &str, words: &str| {
        format!("<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\">{words}</text>\n")
    };
    let mut text = String::new();
    for decade in x.low..=x.high {
        let at = x.place(10f64.powi(decade));
        text += &line(at, y.from, at, y.to);
        text += &words(at, y.from + 16.0, "middle", &label(decade));
    }
    for decade in y.low..=y.high {
        let at = y.place(10f64.powi(decade));
        text += &line(x.from, at, x.to, at);
        text += &words(x.from - 6.0, at + 4.0, "end", &format!("{} %", label(decade + 2)));
    }
    text + &words(0.5 * (x.from + x.to), y.from + 34.0, "middle", "wall-clock seconds")
}

fn label(decade: i32) -> String {
    if (-3..=3).contains(&decade) { format!("{}", 10f64.powi(decade)) } else { format!("1e{decade}") }
}

fn drawn(curve: &Curve, x: &Axis, y: &Axis, colour: &str, dash: &str) -> String {
    let at = |p: &BenchPoint| (x.place(p.wall_s), y.place(p.relative_error.max(LEAST)));
    let line: Vec<String> = curve.points.iter().map(at).map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
    let mut text = format!(
        "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.5\" stroke-dasharray=\"{dash}\"/>\n",
        line.join(" ")
    );
    for p in &curve.points {
        let (cx, cy) = at(p);
        let (low, high) = (y.place(p.relative_error_low.max(LEAST)), y.place(p.relative_error_high.max(LEAST)));
        text.push_str(&format!(
            "<line x1=\"{cx:.1}\" y1=\"{low:.1}\" x2=\"{cx:.1}\" y2=\"{high:.1}\" stroke=\"{colour}\"/><circle cx=\"{cx:.1}\" cy=\"{cy:.1}\" r=\"3\" fill=\"{colour}\"/>\n"
        ));
    }
    text
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
