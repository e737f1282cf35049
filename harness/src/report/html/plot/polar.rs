//! The polar candela diagram: the photometric file's curve, and over it what every engine read back.
//!
//! As in EN 13032-2: nadir down, C 0 and C 90 to the right, C 180 and C 270 to the left.

use std::collections::BTreeSet;

use maud::{Markup, html};

use super::super::palette::Palette;
use super::axis::label;
use super::{Group, WIDTH, figure, legend, line, number, text};
use crate::judge::Comparison;
use crate::report::words::round_step;
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
    let step = round_step(most / 5.0);
    let rings = (most / step).ceil().max(1.0);
    let lit = |up: bool| {
        let shines = |(g, i): (&f64, &f64)| *i > 0.005 * most && (*g > 90.0) == up && *g != 90.0;
        curves.iter().any(|c| c.gamma_deg.iter().zip(&c.intensity_cd).any(shines))
    };
    let (above, below) = (if lit(true) { RADIUS } else { 12.0 }, if lit(false) { RADIUS } else { 12.0 });
    let centre = [0.5 * WIDTH, above + MARGIN];
    let scale = Scale { centre, per_candela: RADIUS / (step * rings) };
    let height = above + below + 2.0 * MARGIN;
    let planes = [(first, "curve"), (first + 90.0, "curve dashed")];
    let engines = group.engines(palette);
    let drawing = html! {
        (rays(&scale, [above > 20.0, below > 20.0], step, rings as u32))
        @for (c_deg, class) in planes {
            @if let Some(right) = plane(c_deg) { (outline(right, plane((c_deg + 180.0).rem_euclid(360.0)), &scale, class)) }
        }
        @for (k, engine) in engines.iter().enumerate() {
            @for c in readings(group, engine, first) {
                @if let Some([x, y]) = scale.reading(c, first) { g.ring { (palette.mark(engine, [x, y], 2.6 + 1.5 * (engines.len() - 1 - k) as f64)) } }
            }
        }
    };
    let across = plane(first + 90.0)
        .map_or(String::new(), |_| format!(", dashed: C {}–{}", label(first + 90.0), label(first + 270.0)));
    let caption = html! {
        "Line: the photometric file, C " (label(first)) "–" (label(first + 180.0)) (across) "; marks: read back by " (legend(&engines, palette)) ". Rings in candela."
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

struct Scale {
    centre: [f64; 2],
    per_candela: f64,
}

impl Scale {
    /// Where an intensity at gamma lies; `side` is 1 to the right, -1 to the left.
    fn place(&self, gamma_deg: f64, candela: f64, side: f64) -> [f64; 2] {
        let (sin, cos) = gamma_deg.to_radians().sin_cos();
        let r = candela * self.per_candela;
        [self.centre[0] + side * r * sin, self.centre[1] + r * cos]
    }

    fn reading(&self, c: &Comparison, first: f64) -> Option<[f64; 2]> {
        let side = if (c.c_deg? - first).rem_euclid(360.0) < 179.0 { 1.0 } else { -1.0 };
        c.value.filter(|v| v.is_finite() && *v >= 0.0).zip(c.gamma_deg).map(|(v, gamma)| self.place(gamma, v, side))
    }
}

fn rays(scale: &Scale, [up, down]: [bool; 2], step: f64, rings: u32) -> Markup {
    let [x, y] = scale.centre;
    let ring = |k: u32| {
        let r = step * f64::from(k) * scale.per_candela;
        let half = |sweep: u32| {
            format!("M{} {}A{2} {2} 0 0 {sweep} {3} {1}", number(x - r), number(y), number(r), number(x + r))
        };
        [up.then(|| half(1)), down.then(|| half(0))].into_iter().flatten().collect::<String>()
    };
    let angles: Vec<f64> =
        (0..=12).map(|k| 15.0 * f64::from(k)).filter(|g| (*g >= 90.0 && up) || (*g <= 90.0 && down)).collect();
    let edge = |gamma: f64, r: f64, side: f64| scale.place(gamma, r / scale.per_candela, side);
    html! {
        @for k in 1..=rings { path.grid d=(ring(k)) {} }
        @for &gamma in &angles { @for side in [-1.0, 1.0] { (line("grid", scale.centre, edge(gamma, RADIUS, side))) } }
        @for &gamma in angles.iter().filter(|g| **g % 30.0 == 0.0) {
            @for &side in if gamma % 180.0 == 0.0 { &[1.0][..] } else { &[-1.0, 1.0] } {
                @let [tx, ty] = edge(gamma, RADIUS + 13.0, side);
                (text("tick", "middle", [tx, ty + 4.0], &format!("{}°", label(gamma))))
            }
        }
        @for k in 1..=rings {
            @let r = step * f64::from(k) * scale.per_candela;
            (text("tick halo", "middle", [x, if up { y - r + 11.0 } else { y + r - 4.0 }], &label(step * f64::from(k))))
        }
    }
}

/// The file's curve in a plane and the one across, straight in (gamma, I) between the angles of the table.
fn outline(right: &Curve, left: Option<&Curve>, scale: &Scale, class: &str) -> Markup {
    let points = |curve: &Curve, side: f64| {
        let mut points: Vec<[f64; 2]> = vec![];
        for (g, i) in curve.gamma_deg.windows(2).zip(curve.intensity_cd.windows(2)) {
            let steps = ((g[1] - g[0]).ceil().max(1.0)) as u32;
            let at = |k: u32| f64::from(k) / f64::from(steps);
            points.extend(
                (0..steps).map(|k| scale.place(g[0] + at(k) * (g[1] - g[0]), i[0] + at(k) * (i[1] - i[0]), side)),
            );
        }
        if let Some((g, i)) = curve.gamma_deg.last().zip(curve.intensity_cd.last()) {
            points.push(scale.place(*g, *i, side));
        }
        points
    };
    let mut all = left.map_or(vec![], |curve| points(curve, -1.0));
    all.reverse();
    all.extend(points(right, 1.0));
    let path: Vec<String> = all.iter().map(|[x, y]| format!("{} {}", number(*x), number(*y))).collect();
    html! { path class=(class) d={ "M" (path.join("L")) } {} }
}
