//! Deviations of cases with their uncertainty, as SVG on a scale that shows both 0.01 % and 1000 %.

use maud::{Markup, html};

use crate::{CaseEvidence, Deviation, Measure};

const WIDTH: f64 = 640.0;
/// Room for names at the left.
const LEFT: f64 = 190.0;
const RIGHT: f64 = 16.0;
const ROW: f64 = 20.0;
const TOP: f64 = 26.0;
/// More rows make no plot but a wall.
const MAX_ROWS: usize = 40;
/// Letters of a name.
const NAME_LETTERS: usize = 26;

/// The horizontal scale: linear near zero, logarithmic beyond.
struct Scale {
    linear: f64,
    most: f64,
}

impl Scale {
    fn new(measure: Measure, rows: &[Row<'_>]) -> Self {
        let linear = match measure {
            Measure::Relative => 0.001,
            Measure::Rating => 0.1,
        };
        let ends = rows.iter().map(|row| row.deviation.bound());
        Self { linear, most: ends.fold(3.0 * linear, f64::max) }
    }

    fn x(&self, value: f64) -> f64 {
        let part = (value / self.linear).asinh() / (self.most / self.linear).asinh();
        LEFT + (WIDTH - LEFT - RIGHT) * 0.5 * (1.0 + part.clamp(-1.0, 1.0))
    }

    /// The ticks above zero.
    fn ticks(&self) -> Vec<f64> {
        let decades = (0..6).map(|k| self.linear * 10f64.powi(k));
        decades.filter(|tick| *tick <= 1.001 * self.most).collect()
    }
}

/// A row of the plot.
struct Row<'a> {
    case: &'a CaseEvidence,
    deviation: Deviation,
}

/// The worst deviation of each case; nothing without values.
pub(super) fn deviations(cases: &[CaseEvidence]) -> Markup {
    let with_values = cases.iter().filter_map(|case| Some(Row { case, deviation: case.measurement()?.worst? }));
    let rows: Vec<Row<'_>> = with_values.take(MAX_ROWS).collect();
    let Some(first) = rows.first() else { return html! {} };
    let measure = first.deviation.measure;
    let scale = Scale::new(measure, &rows);
    let height = TOP + ROW * rows.len() as f64 + 8.0;
    let label = "The worst deviation of each case with its expanded uncertainty; the table below has the same values";
    html! {
        figure.deviations {
            figcaption { "Worst deviation of each case, with its expanded uncertainty" }
            svg viewBox={ "0 0 " (WIDTH) " " (height) } role="img" aria-label=(label) {
                @for tick in scale.ticks() { @for signed in [-tick, tick] {
                    line.grid x1=(place(scale.x(signed))) x2=(place(scale.x(signed))) y1=(TOP - 6.0) y2=(height) {}
                    text.tick x=(place(scale.x(signed))) y="14" text-anchor="middle" { (tick_text(signed, measure)) }
                } }
                line.zero x1=(place(scale.x(0.0))) x2=(place(scale.x(0.0))) y1=(TOP - 6.0) y2=(height) {}
                text.tick x=(place(scale.x(0.0))) y="14" text-anchor="middle" { "0" }
                @for (k, Row { case, deviation }) in rows.iter().enumerate() {
                    @let y = TOP + ROW * (k as f64 + 0.5);
                    text.name x=(LEFT - 8.0) y=(place(y + 4.0)) text-anchor="end" { (name(case)) }
                    line.interval x1=(place(scale.x(deviation.value - deviation.expanded))) x2=(place(scale.x(deviation.value + deviation.expanded))) y1=(place(y)) y2=(place(y)) {}
                    @if case.hidden.is_some() {
                        rect.point x=(place(scale.x(deviation.value) - 3.0)) y=(place(y - 3.0)) width="6" height="6" {}
                    } @else {
                        circle.point cx=(place(scale.x(deviation.value))) cy=(place(y)) r="3.4" {}
                    }
                }
            }
            @if rows.iter().any(|row| row.case.hidden.is_some()) { p.where { "Circles are public cases, squares hidden variants." } }
        }
    }
}

/// A coordinate with two decimals.
fn place(x: f64) -> String {
    luxproof_model::numbers::trimmed(x, 2)
}

fn tick_text(value: f64, measure: Measure) -> String {
    let sign = if value < 0.0 { "−" } else { "+" };
    let (size, unit) = match measure {
        Measure::Relative => (100.0 * value.abs(), " %"),
        Measure::Rating => (value.abs(), ""),
    };
    format!("{sign}{}{unit}", luxproof_model::numbers::trimmed(size, 2))
}

fn name(case: &CaseEvidence) -> String {
    if case.procedure.is_calibration() {
        return super::shortened(case.procedure.short(), NAME_LETTERS);
    }
    let hidden = if case.hidden.is_some() { ", hidden" } else { "" };
    super::shortened(&format!("{}{hidden}", case.case), NAME_LETTERS)
}
