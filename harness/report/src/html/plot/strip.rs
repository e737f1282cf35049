//! Deviations of every meter on one line for each engine, over the tolerance: agreement and outliers at a glance.

use std::collections::BTreeSet;

use maud::{Markup, html};

use super::super::palette::Palette;
use super::Group;
use super::axis::DeviationScale;
use super::{Marks, WIDTH, figure};
use crate::svg::{label, line, number, text};
use crate::verdict_lines::is_relative;
use luxproof_model::Report;
use luxproof_model::{Basis, Comparison};

/// Space for the names of engines, in user units.
const LEFT: f64 = 82.0;
const RIGHT: f64 = 12.0;
const ROW: f64 = 24.0;
const HEAD: f64 = 22.0;
/// Offsets of marks within a row, in turn, so that marks of meters that agree stay visible.
const LANES: [f64; 5] = [0.0, -4.0, 4.0, -2.0, 2.0];
/// A shorter interval is hidden by its mark.
const MIN_INTERVAL_LENGTH: f64 = 3.0;

pub(super) fn panel(report: &Report, group: &Group<'_>, palette: &Palette, marks: Marks) -> Markup {
    // Ratings have no zero, and so no percent of it.
    let unit = group.comparisons.iter().find(|c| !c.quantity.has_zero()).map(|c| c.quantity.unit());
    let mut compared: Vec<&Comparison> = group.comparisons.clone();
    compared.retain(|c| drawn(c).is_some() && (unit.is_some() || is_relative(c)));
    let scale = scale(&compared);
    let mut y = 4.0;
    let mut blocks: Vec<Markup> = vec![];
    for basis in compared.iter().filter_map(|c| c.basis()).collect::<BTreeSet<Basis>>() {
        blocks.push(text("head", "start", [0.0, y + 14.0], &format!("against {}", basis.name())));
        y += HEAD;
        for engine in group.engines(palette) {
            let of_row = compared.iter().copied().filter(|c| c.key.engine == engine && c.basis() == Some(basis));
            let row = Row { comparisons: of_row.collect(), engine, y };
            if !row.comparisons.is_empty() {
                blocks.push(row.draw(&scale, palette, marks));
                y += ROW;
            }
        }
    }
    let bottom = y + 4.0;
    let drawing = html! {
        @for tick in scale.ticks() {
            (line(if tick == 0.0 { "zero" } else { "grid" }, [scale.x(tick), 4.0], [scale.x(tick), bottom]))
            (text("tick", "middle", [scale.x(tick), bottom + 14.0], &label(tick)))
        }
        (text("axis", "middle", [LEFT + 0.5 * (WIDTH - LEFT - RIGHT), bottom + 30.0], &format!("deviation from the reference [{}]", unit.unwrap_or("%"))))
        @for block in blocks { (block) }
    };
    let caption = html! { "One mark for each meter; bars: expanded uncertainty; shaded: the tolerance. Linear scale within ± 0.01, logarithmic beyond."
        @if marks == Marks::Seen { " Of marks at the same place one is drawn." }
    };
    figure(&group.title(report, "deviations"), bottom + 36.0, &drawing, &caption)
}

/// A scale that holds all deviations and tolerances.
fn scale(compared: &[&Comparison]) -> DeviationScale {
    let tolerances = compared.iter().filter_map(|c| allowed(c)).filter(|allowed| *allowed < 100.0);
    let deviations = compared.iter().filter_map(|c| drawn(c)).map(f64::abs);
    DeviationScale::new(deviations.chain(tolerances).fold(0.1, f64::max), LEFT, WIDTH - LEFT - RIGHT)
}

/// What a deviation is multiplied by: percent of the reference, and 1 for ratings.
fn factor(c: &Comparison) -> Option<f64> {
    if c.quantity.has_zero() { Some(100.0 / c.reference.as_ref()?.value) } else { Some(1.0) }
}

fn drawn(c: &Comparison) -> Option<f64> {
    Some(c.deviation? * factor(c)?).filter(|d| d.is_finite())
}

fn allowed(c: &Comparison) -> Option<f64> {
    Some(c.allowed() * factor(c)?).filter(|a| a.is_finite())
}

/// The line of one engine against one basis.
struct Row<'a> {
    comparisons: Vec<&'a Comparison>,
    engine: &'a str,
    /// The upper edge.
    y: f64,
}

impl Row<'_> {
    fn draw(&self, scale: &DeviationScale, palette: &Palette, marks: Marks) -> Markup {
        let Self { comparisons, engine, y } = self;
        // An absolute tolerance differs from meter to meter in percent; the narrowest is drawn.
        let narrowest = comparisons.iter().filter_map(|c| allowed(c)).fold(f64::INFINITY, f64::min);
        let (from, to) = (scale.x(-narrowest), scale.x(narrowest));
        let class = format!("line e{}", palette.index(engine));
        let mut places = BTreeSet::new();
        let mut shown: Vec<(usize, &Comparison)> = comparisons.iter().copied().enumerate().collect();
        if marks == Marks::Seen {
            shown.retain(|(_, c)| places.insert(mark_place(c, scale)));
        }
        html! {
            rect.band x=(number(from)) y=(number(y + 2.0)) width=(number((to - from).max(1.0))) height=(number(ROW - 4.0)) rx="2" {}
            (text("name", "end", [LEFT - 8.0, y + 0.5 * ROW + 4.0], engine))
            @for (k, c) in &shown {
                @if let Some([from, to]) = interval(c, scale) { (line(&class, [from, self.lane(*k)], [to, self.lane(*k)])) }
            }
            @for (k, c) in &shown {
                @if let Some(d) = drawn(c) { (palette.mark(engine, [scale.x(d), self.lane(*k)], 3.2)) }
            }
        }
    }

    /// The height of a mark within the row.
    fn lane(&self, k: usize) -> f64 {
        let offset = if self.comparisons.len() > 1 { LANES[k % LANES.len()] } else { 0.0 };
        self.y + 0.5 * ROW + offset
    }
}

/// The place of a mark in whole user units; marks at the same place hide one another.
fn mark_place(c: &Comparison, scale: &DeviationScale) -> Option<i64> {
    drawn(c).map(|d| scale.x(d).round() as i64)
}

/// The ends of a deviation's interval on the scale; `None` where it is too short to be seen.
fn interval(c: &Comparison, scale: &DeviationScale) -> Option<[f64; 2]> {
    let (d, u, factor) = (c.deviation?, c.budget.as_ref()?.expanded, factor(c)?);
    let ends = [d - u, d + u].map(|end| scale.x(factor * end));
    (ends[1] - ends[0] > MIN_INTERVAL_LENGTH).then_some(ends)
}
