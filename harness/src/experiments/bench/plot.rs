//! Error against time as SVG: log-log, one panel a case and procedure, one colour an engine, error bars.

use std::collections::BTreeMap;
use std::ops::Range;

use plotters::coord::Shift;
use plotters::element::DashedPathElement;
use plotters::prelude::*;

use super::curve::{BenchPoint, Curve};
use super::{BenchReport, Pareto};

/// Pixels of a panel, and of those beside it that its legend takes.
const PANEL: (u32, u32) = (760, 380);
const LEGEND: i32 = 230;
/// Okabe & Ito's colours, told apart by everybody.
const COLOURS: [RGBColor; 7] = [
    BLACK,
    RGBColor(230, 159, 0),
    RGBColor(0, 114, 178),
    RGBColor(0, 158, 115),
    RGBColor(213, 94, 0),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
];
/// Length of dashes and of the gaps between them; the first curve of an engine is unbroken.
const DASHES: [(i32, i32); 4] = [(10_000, 1), (6, 3), (2, 3), (12, 4)];
/// Errors below this are drawn at it: none at all has no place on a logarithmic axis.
const LEAST: f64 = 1e-9;

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

impl BenchReport {
    pub fn svg(&self) -> String {
        let (mut text, count) = (String::new(), self.pareto.len());
        let root = SVGBackend::with_string(&mut text, (PANEL.0, PANEL.1 * count as u32)).into_drawing_area();
        // Drawing into memory fails on no condition that a report can meet; an empty file would be noticed at once.
        root.fill(&WHITE).ok();
        for (area, pareto) in root.split_evenly((count.max(1), 1)).iter().zip(&self.pareto) {
            self.panel(area, pareto).ok();
        }
        drop(root);
        text
    }

    fn panel(&self, area: &Area<'_>, pareto: &Pareto) -> Result<(), Box<dyn std::error::Error>> {
        let mine = |c: &&Curve| c.key.case == pareto.case && c.key.procedure == pareto.procedure;
        let curves: Vec<&Curve> = self.curves.iter().filter(mine).collect();
        let points = || curves.iter().flat_map(|c| &c.points);
        let (times, errors) =
            (decades(points().map(|p| p.wall_s)), decades(points().map(|p| at_least(p.relative_error))));
        let title = format!("{}, {}", pareto.case, pareto.procedure.name().replace('_', " "));
        let mut chart = ChartBuilder::on(area)
            .caption(title, ("sans-serif", 14))
            .margin(10)
            .margin_right(LEGEND)
            .x_label_area_size(40)
            .y_label_area_size(70)
            .build_cartesian_2d(times.log_scale(), errors.log_scale())?;
        let mut mesh = chart.configure_mesh();
        mesh.x_desc("wall-clock seconds").y_label_formatter(&|error| format!("{} %", short(100.0 * error)));
        mesh.x_label_formatter(&|time| short(*time)).light_line_style(TRANSPARENT).draw()?;
        let mut of_engine = BTreeMap::new();
        for curve in curves {
            let engine = self.engines.keys().position(|e| curve.key.engine == *e).unwrap_or(0);
            let nth: &mut usize = of_engine.entry(engine).or_default();
            let (style, (dash, gap)) = (COLOURS[engine % COLOURS.len()].stroke_width(2), DASHES[*nth % DASHES.len()]);
            *nth += 1;
            let line = curve.points.iter().map(|p| (p.wall_s, at_least(p.relative_error)));
            let line = DashedPathElement::new(line.collect::<Vec<_>>(), dash, gap, style);
            let name: String = curve.name().chars().take(30).collect();
            let key = move |(x, y)| DashedPathElement::new([(x, y), (x + 20, y)], dash, gap, style);
            chart.draw_series([line])?.label(name).legend(key);
            let bar = |p: &BenchPoint| {
                let [low, middle, high] = [p.relative_error_low, p.relative_error, p.relative_error_high].map(at_least);
                ErrorBar::new_vertical(p.wall_s, low, middle, high, style.filled(), 6)
            };
            chart.draw_series(curve.points.iter().map(bar))?;
        }
        let beside = SeriesLabelPosition::Coordinate(PANEL.0 as i32 - LEGEND - 40, 0);
        chart.configure_series_labels().position(beside).label_font(("sans-serif", 10)).draw()?;
        Ok(())
    }
}

fn at_least(error: f64) -> f64 {
    error.max(LEAST)
}

/// Whole decades that hold all values.
fn decades(values: impl Iterator<Item = f64>) -> Range<f64> {
    let logs: Vec<f64> = values.filter(|v| *v > 0.0).map(f64::log10).collect();
    let low = logs.iter().copied().reduce(f64::min).map_or(-1.0, f64::floor);
    let high = logs.iter().copied().reduce(f64::max).map_or(0.0, f64::ceil);
    10f64.powf(low)..10f64.powf(high.max(low + 1.0))
}

fn short(value: f64) -> String {
    if (1e-3..1e4).contains(&value) { format!("{value}") } else { format!("{value:e}") }
}
