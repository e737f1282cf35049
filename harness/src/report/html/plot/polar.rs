//! The polar candela diagram: the photometric file's curve, and over it what every engine read back.

use std::collections::BTreeSet;

use maud::{Markup, html};

use super::super::palette::Palette;
use super::{Group, WIDTH, figure, legend};
use crate::judge::Comparison;
use crate::report::svg::{Polar, label};
use crate::report::{Curve, Report};

const RADIUS: f64 = 136.0;
const MARGIN: f64 = 22.0;

/// The panel, where the file's curves are known.
pub(super) fn panel(report: &Report, group: &Group<'_>, palette: &Palette) -> Option<Markup> {
    let mine = |c: &&Curve| c.case == group.case && c.procedure == group.procedure;
    let curves: Vec<&Curve> = report.curves.iter().filter(mine).collect();
    let plane = |c_deg: f64| curves.iter().copied().find(|c| (c.c_deg - c_deg).abs() < 1e-9);
    let first = group.comparisons.iter().filter_map(|c| c.c_deg).map(|c| c.rem_euclid(180.0)).min_by(f64::total_cmp)?;
    let read = group.comparisons.iter().filter(|c| c.gamma_deg.is_some());
    let most = curves.iter().flat_map(|c| &c.intensity_cd).copied();
    let most = read.clone().filter_map(|c| c.value).chain(most).fold(0.0, f64::max);
    if curves.is_empty() || most <= 0.0 || !most.is_finite() {
        return None;
    }
    let lit = |up: bool| {
        let shines = |(g, i): (&f64, &f64)| *i > 0.005 * most && (*g > 90.0) == up && *g != 90.0;
        curves.iter().any(|c| c.gamma_deg.iter().zip(&c.intensity_cd).any(shines))
    };
    let (above, below) = (if lit(true) { RADIUS } else { 12.0 }, if lit(false) { RADIUS } else { 12.0 });
    let paper = Polar::new([0.5 * WIDTH, above + MARGIN], RADIUS, most, [true, false].map(lit));
    let height = above + below + 2.0 * MARGIN;
    let planes = [(first, "curve"), (first + 90.0, "curve dashed")];
    let engines = group.engines(palette);
    let drawing = html! {
        (paper.grid())
        @for (c_deg, class) in planes {
            @if let Some(right) = plane(c_deg) { (paper.outline(class, half(right), plane((c_deg + 180.0).rem_euclid(360.0)).map(half))) }
        }
        @for (k, engine) in engines.iter().enumerate() {
            @for c in readings(group, engine, first) {
                @if let Some([x, y]) = place(&paper, c, first) { g.ring { (palette.mark(engine, [x, y], 2.6 + 1.5 * (engines.len() - 1 - k) as f64)) } }
            }
        }
    };
    let across = plane(first + 90.0)
        .map_or(String::new(), |_| format!(", dashed: C {}–{}", label(first + 90.0), label(first + 270.0)));
    let caption = html! {
        "Line: the photometric file, C " (label(first)) "–" (label(first + 180.0)) (across) "; rings in candela; marks: read back by " (legend(&engines, palette))
    };
    Some(figure(&group.title(report, "luminous intensity [cd]"), height, &drawing, &caption))
}

/// The readings of an engine in the plane that is drawn solid and the one across it, each place once.
fn readings<'a>(group: &'a Group<'_>, engine: &str, first: f64) -> Vec<&'a Comparison> {
    let in_planes = |c: &&Comparison| {
        let off = |plane: f64| (plane - first).rem_euclid(90.0).min((first - plane).rem_euclid(90.0));
        c.key.engine == engine && c.c_deg.is_some_and(|plane| off(plane) < 1e-6)
    };
    let mut seen = BTreeSet::new();
    group.comparisons.iter().copied().filter(in_planes).filter(|c| seen.insert(c.meter.0.as_str())).collect()
}

fn half(curve: &Curve) -> (&[f64], &[f64]) {
    (&curve.gamma_deg, &curve.intensity_cd)
}

fn place(paper: &Polar, c: &Comparison, first: f64) -> Option<[f64; 2]> {
    let side = if (c.c_deg? - first).rem_euclid(360.0) < 179.0 { 1.0 } else { -1.0 };
    c.value.filter(|v| v.is_finite() && *v >= 0.0).zip(c.gamma_deg).map(|(v, gamma)| paper.place(gamma, v, side))
}
