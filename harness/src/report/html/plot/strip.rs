//! Deviations of every meter on one line an engine, over the tolerance: what agrees and what departs at a glance.

use std::collections::BTreeSet;

use maud::{Markup, html};

use super::super::palette::Palette;
use super::axis::Deviations;
use super::{Group, Marks, WIDTH, figure};
use crate::judge::{Basis, Comparison};
use crate::report::Report;
use crate::report::svg::{label, line, number, text};

const LEFT: f64 = 82.0;
const ROW: f64 = 24.0;
const HEAD: f64 = 22.0;

pub(super) fn panel(report: &Report, group: &Group<'_>, palette: &Palette, marks: Marks) -> Markup {
    let with_deviation: Vec<&Comparison> =
        group.comparisons.iter().copied().filter(|c| c.relative_deviation.is_some()).collect();
    let tolerances = with_deviation.iter().filter_map(|c| allowed_percent(c)).filter(|a| *a < 100.0);
    let most = with_deviation.iter().filter_map(|c| c.relative_deviation).map(|d| 100.0 * d.abs()).chain(tolerances);
    let scale = Deviations::new(most.fold(0.1, f64::max), LEFT, WIDTH - LEFT - 12.0);
    let mut y = 4.0;
    let mut blocks: Vec<Markup> = vec![];
    for basis in with_deviation.iter().filter_map(|c| c.basis()).collect::<BTreeSet<Basis>>() {
        blocks.push(text("head", "start", [0.0, y + 14.0], &format!("against {}", basis.name())));
        y += HEAD;
        for engine in group.engines(palette) {
            let is_mine = |c: &&Comparison| c.key.engine == engine && c.basis() == Some(basis);
            let mine: Vec<&Comparison> = with_deviation.iter().copied().filter(is_mine).collect();
            if !mine.is_empty() {
                blocks.push(row(&mine, engine, y, &scale, palette, marks));
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
        (text("axis", "middle", [LEFT + 0.5 * (WIDTH - LEFT - 12.0), bottom + 30.0], "deviation from the reference [%]"))
        @for block in blocks { (block) }
    };
    let caption = html! { "One mark a meter; bars: expanded uncertainty; shaded: the tolerance. Straight scale within ± 0.01 %, logarithmic beyond."
        @if marks == Marks::Seen { " Of marks that would lie upon one another one is drawn." }
    };
    figure(&group.title(report, "deviations"), bottom + 36.0, &drawing, &caption)
}

fn allowed_percent(c: &Comparison) -> Option<f64> {
    Some(100.0 * c.allowed() / c.reference.as_ref()?.value).filter(|a| a.is_finite())
}

fn row(mine: &[&Comparison], engine: &str, y: f64, scale: &Deviations, palette: &Palette, marks: Marks) -> Markup {
    let middle = y + 0.5 * ROW;
    // Where an absolute tolerance makes it differ from meter to meter, the narrowest is drawn.
    let allowed = mine.iter().filter_map(|c| allowed_percent(c)).fold(f64::INFINITY, f64::min);
    let (from, to) = (scale.x(-allowed), scale.x(allowed));
    let class = format!("line e{}", palette.index(engine));
    // Within the row by turns, so that meters that agree stay visible.
    let lane = |k: usize| middle + [0.0, -4.0, 4.0, -2.0, 2.0][k % 5] * if mine.len() > 1 { 1.0 } else { 0.0 };
    let interval = |k: usize, c: &Comparison| {
        let reference = c.reference.as_ref()?.value;
        let (d, u) = (c.deviation?, c.budget.as_ref()?.expanded);
        let ends = [100.0 * (d - u) / reference, 100.0 * (d + u) / reference].map(|p| scale.x(p));
        (ends[1] - ends[0] > 3.0).then(|| line(&class, [ends[0], lane(k)], [ends[1], lane(k)]))
    };
    let mut taken = BTreeSet::new();
    let x = |c: &Comparison| c.relative_deviation.map(|d| scale.x(100.0 * d).round() as i64);
    let shown: Vec<(usize, &Comparison)> =
        mine.iter().copied().enumerate().filter(|(_, c)| marks == Marks::Every || taken.insert(x(c))).collect();
    html! {
        rect.band x=(number(from)) y=(number(y + 2.0)) width=(number((to - from).max(1.0))) height=(number(ROW - 4.0)) rx="2" {}
        (text("name", "end", [LEFT - 8.0, middle + 4.0], engine))
        @for (k, c) in &shown { @if let Some(bar) = interval(*k, c) { (bar) } }
        @for (k, c) in &shown {
            @if let Some(d) = c.relative_deviation { (palette.mark(engine, [scale.x(100.0 * d), lane(*k)], 3.2)) }
        }
    }
}
