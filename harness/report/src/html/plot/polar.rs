//! The polar candela diagram: the photometric file's curve with the readings of every engine.

use std::collections::BTreeSet;

use maud::{Markup, html};

use super::super::palette::Palette;
use super::Group;
use super::{WIDTH, figure, legend};
use crate::svg::{Polar, label};
use luxproof_model::Comparison;
use luxproof_model::{Curve, Report};

const RADIUS: f64 = 136.0;
const MARGIN: f64 = 22.0;
/// Height of a half of the diagram without light.
const DARK_HEIGHT: f64 = 12.0;
/// A half counts as dark if its intensities are all below this part of the largest.
const DARK_SHARE: f64 = 0.005;

/// The panel; `None` where the file's curves are unknown.
pub(super) fn panel(report: &Report, group: &Group<'_>, palette: &Palette) -> Option<Markup> {
    let curves: Vec<&Curve> =
        report.curves.iter().filter(|c| c.case == group.case && c.procedure == group.procedure).collect();
    let planes = group.comparisons.iter().filter_map(|c| c.c_deg);
    let first = planes.map(|c| c.rem_euclid(180.0)).min_by(f64::total_cmp)?;
    let read = group.comparisons.iter().filter(|c| c.gamma_deg.is_some()).filter_map(|c| c.value);
    let most = read.chain(curves.iter().flat_map(|c| &c.intensity_cd).copied()).fold(0.0, f64::max);
    if curves.is_empty() || most <= 0.0 || !most.is_finite() {
        return None;
    }
    let halves = [true, false].map(|is_up| is_half_lit(&curves, is_up, DARK_SHARE * most));
    let [above, below] = halves.map(|is_lit| if is_lit { RADIUS } else { DARK_HEIGHT });
    let paper = Polar::new([0.5 * WIDTH, above + MARGIN], RADIUS, most, halves);
    let height = above + below + 2.0 * MARGIN;
    let engines = group.engines(palette);
    let drawing = html! {
        (paper.grid())
        @for (c_deg, class) in [(first, "curve"), (first + 90.0, "curve dashed")] {
            @if let Some(right) = find_plane(&curves, c_deg) {
                (paper.outline(class, half(right), find_plane(&curves, (c_deg + 180.0).rem_euclid(360.0)).map(half)))
            }
        }
        @for (k, engine) in engines.iter().enumerate() {
            // Later marks are smaller, so that earlier ones show around them.
            @let radius = 2.6 + 1.5 * (engines.len() - 1 - k) as f64;
            @for c in readings(group, engine, first) {
                @if let Some(place) = place(&paper, c, first) { g.ring { (palette.mark(engine, place, radius)) } }
            }
        }
    };
    let dashed = match find_plane(&curves, first + 90.0) {
        Some(_) => format!(", dashed: C {}–{}", label(first + 90.0), label(first + 270.0)),
        None => String::new(),
    };
    let caption = html! {
        "Line: the photometric file, C " (label(first)) "–" (label(first + 180.0)) (dashed) "; rings in candela; marks: read back by " (legend(&engines, palette))
    };
    Some(figure(&group.title(report, "luminous intensity [cd]"), height, &drawing, &caption))
}

fn find_plane<'a>(curves: &[&'a Curve], c_deg: f64) -> Option<&'a Curve> {
    curves.iter().copied().find(|c| (c.c_deg - c_deg).abs() < 1e-9)
}

/// Whether any curve has more than a negligible intensity above the horizon, or below it.
fn is_half_lit(curves: &[&Curve], is_up: bool, negligible: f64) -> bool {
    let mut intensities = curves.iter().flat_map(|c| c.gamma_deg.iter().zip(&c.intensity_cd));
    intensities.any(|(gamma, intensity)| *intensity > negligible && (*gamma > 90.0) == is_up && *gamma != 90.0)
}

/// The readings of an engine in the solid plane and the one across it, each place once.
fn readings<'a>(group: &'a Group<'_>, engine: &str, first: f64) -> Vec<&'a Comparison> {
    let mut meters = BTreeSet::new();
    let in_planes = group
        .comparisons
        .iter()
        .copied()
        .filter(|c| c.key.engine == engine && c.c_deg.is_some_and(|plane| distance_to_planes(plane, first) < 1e-6));
    in_planes.filter(|c| meters.insert(c.meter.0.as_str())).collect()
}

/// The angle between a plane and the nearest drawn one, in degrees.
fn distance_to_planes(plane: f64, first: f64) -> f64 {
    (plane - first).rem_euclid(90.0).min((first - plane).rem_euclid(90.0))
}

fn half(curve: &Curve) -> (&[f64], &[f64]) {
    (&curve.gamma_deg, &curve.intensity_cd)
}

fn place(paper: &Polar, c: &Comparison, first: f64) -> Option<[f64; 2]> {
    let side = if (c.c_deg? - first).rem_euclid(360.0) < 179.0 { 1.0 } else { -1.0 };
    c.value.filter(|v| v.is_finite() && *v >= 0.0).zip(c.gamma_deg).map(|(v, gamma)| paper.place(gamma, v, side))
}
