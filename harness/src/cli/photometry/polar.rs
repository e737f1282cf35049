//! The polar intensity diagram: C0-C180 solid, C90-C270 dashed, nadir down, rings of equal intensity.
//!
//! As in EN 13032-2 and every catalogue: C 0 and C 90 to the right, C 180 and C 270 to the left; cd/klm for relative
//! photometry, cd for absolute.

use luminaire::photometry::{LuminousIntensityDistribution, Photometry};
use maud::{Markup, html};

use crate::report::words::{round_step, trimmed};

const RADIUS: f64 = 200.0;
const MARGIN: f64 = 40.0;
/// Heights of the title above and the legend below.
const TITLE: f64 = 34.0;
const LEGEND: f64 = 44.0;
const MAX_RINGS: f64 = 6.0;
/// C0-C180 and C90-C270: the colours and dashes of the two curves.
const CURVES: [(f64, &str, &str, &str); 2] = [(0.0, "C0-C180", "#c0272d", ""), (90.0, "C90-C270", "#1f5fa8", "6 4")];

pub(super) fn diagram(file: &str, photometry: &Photometry) -> String {
    let distribution = &photometry.distribution;
    let scale = Scale::of(photometry);
    let upward = [0.0, 90.0, 180.0, 270.0]
        .iter()
        .any(|c| (91..=180).any(|g| distribution.intensity(*c, f64::from(g)).value() > 0.0));
    // A downlight is drawn to just above the horizon.
    let above = if upward { RADIUS } else { 0.0 };
    let (width, height) = (2.0 * (RADIUS + MARGIN), above + RADIUS + 2.0 * MARGIN + TITLE + LEGEND);
    let (x, y, legend) = (RADIUS + MARGIN, above + MARGIN + TITLE, height - LEGEND + 16.0);
    let title = photometry.keyword("LUMINAIRE").and_then(|name| name.lines().next()).unwrap_or(file);
    let title: String = title.chars().filter(|c| !c.is_control()).collect();
    let svg = html! {
        svg xmlns="http://www.w3.org/2000/svg" viewBox={ "0 0 " (width) " " (height) } font-family="sans-serif" font-size="11" {
            rect width=(width) height=(height) fill="#ffffff" {}
            (text([width / 2.0, 20.0], "middle", &format!("{title}, {:.0} lm", distribution.flux().value())))
            g transform={ "translate(" (x) " " (y) ")" } {
                (grid(&scale, upward))
                @for (c_deg, _, colour, dashes) in CURVES {
                    path d=(curve(distribution, &scale, c_deg)) fill="none" stroke=(colour) stroke-width="2" stroke-dasharray=(dashes) {}
                }
            }
            @for (k, (_, name, colour, dashes)) in CURVES.into_iter().enumerate() {
                @let x = MARGIN + 120.0 * k as f64;
                path d={ "M" (x) " " (legend) "h28" } stroke=(colour) stroke-width="2" stroke-dasharray=(dashes) {}
                (text([x + 34.0, legend + 4.0], "start", name))
            }
            (text([2.0 * RADIUS + MARGIN, legend + 4.0], "end", scale.unit))
        }
    };
    svg.into_string() + "\n"
}

struct Scale {
    unit: &'static str,
    /// Multiplies candelas into the unit.
    factor: f64,
    /// Step from ring to ring, in the unit.
    step: f64,
    rings: u32,
}

impl Scale {
    fn of(photometry: &Photometry) -> Self {
        let (unit, factor) = match photometry.lamp_lumens {
            Some(lumens) if lumens > 0.0 => ("cd/klm", 1000.0 / lumens),
            _ => ("cd", 1.0),
        };
        let largest = photometry.distribution.max_intensity().value() * factor;
        if largest <= 0.0 {
            return Self { unit, factor, step: 1.0, rings: 4 };
        }
        let step = round_step(largest / MAX_RINGS);
        Self { unit, factor, step, rings: (largest / step).ceil().clamp(1.0, MAX_RINGS) as u32 }
    }

    fn radius(&self, candela: f64) -> f64 {
        RADIUS * candela * self.factor / (self.step * f64::from(self.rings))
    }
}

/// Rings with their values, rays with their angles.
fn grid(scale: &Scale, upward: bool) -> Markup {
    let last = if upward { 180 } else { 90 };
    let radius = |ring: u32| RADIUS * f64::from(ring) / f64::from(scale.rings);
    html! {
        g fill="none" stroke="#c8c8c8" stroke-width="0.8" {
            @for r in (1..=scale.rings).map(radius) {
                @if upward { circle r=(digits(r)) {} } @else { path d=(format!("M{:.2} 0A{r:.2} {r:.2} 0 0 0 {r:.2} 0", -r)) {} }
            }
            @for [x, y] in (0..=last).step_by(15).map(|gamma| place(f64::from(gamma), RADIUS)) {
                path d=(format!("M{:.2} {y:.2}L0 0L{x:.2} {y:.2}", -x)) {}
            }
        }
        g fill="#555555" {
            @for gamma in (0..=last).step_by(30) {
                @let [x, y] = place(f64::from(gamma), RADIUS + 14.0);
                @for side in if gamma % 180 == 0 { &[1.0][..] } else { &[-1.0, 1.0] } {
                    (text([side * x, y + 4.0], "middle", &format!("{gamma}°")))
                }
            }
            @for ring in 1..=scale.rings {
                (text([3.0, radius(ring) - 3.0], "start", &trimmed(scale.step * f64::from(ring), 3)))
            }
        }
    }
}

/// The path of plane C and its opposite, from the zenith over the right to the nadir and up the left side.
fn curve(distribution: &LuminousIntensityDistribution, scale: &Scale, c_deg: f64) -> String {
    // Straight in (gamma, I) is bent here: whole degrees between the angles of the table.
    let mut gammas: Vec<f64> = (0..=180).map(f64::from).chain(distribution.gamma_deg().iter().copied()).collect();
    gammas.sort_by(f64::total_cmp);
    gammas.dedup();
    let at = |c: f64, gamma: f64, side: f64| {
        let [x, y] = place(gamma, scale.radius(distribution.intensity(c, gamma).value()));
        format!("{:.2} {y:.2}", side * x)
    };
    let right = gammas.iter().rev().map(|&gamma| at(c_deg, gamma, 1.0));
    let left = gammas.iter().map(|&gamma| at(c_deg + 180.0, gamma, -1.0));
    let points: Vec<String> = right.chain(left).collect();
    format!("M{}Z", points.join("L"))
}

/// Where a gamma angle and a radius lie: nadir down, y of SVG down too.
fn place(gamma_deg: f64, radius: f64) -> [f64; 2] {
    let (sin, cos) = gamma_deg.to_radians().sin_cos();
    [radius * sin, radius * cos]
}

fn text([x, y]: [f64; 2], anchor: &str, words: &str) -> Markup {
    html! { text x=(digits(x)) y=(digits(y)) text-anchor=(anchor) { (words) } }
}

fn digits(value: f64) -> String {
    format!("{value:.2}")
}
