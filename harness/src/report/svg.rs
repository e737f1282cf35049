//! Parts of drawings in SVG: words, lines, and polar diagrams of luminous intensity.
//!
//! The diagrams are as in EN 13032-2 and every catalogue: nadir down, C 0 and C 90 to the right, C 180 and C 270 to the left.

use maud::{Markup, html};

use super::words::{round_step, trimmed};

pub(crate) fn text(class: &str, anchor: &str, [x, y]: [f64; 2], words: &str) -> Markup {
    html! { text class=(class) text-anchor=(anchor) x=(number(x)) y=(number(y)) { (words) } }
}

pub(crate) fn line(class: &str, [x1, y1]: [f64; 2], [x2, y2]: [f64; 2]) -> Markup {
    html! { path class=(class) d={ "M" (number(x1)) " " (number(y1)) "L" (number(x2)) " " (number(y2)) } {} }
}

pub(crate) fn number(value: f64) -> String {
    trimmed(value, 1)
}

/// A value at an axis, with a real minus.
pub(crate) fn label(value: f64) -> String {
    let decimals = (3.0 - value.abs().max(1e-9).log10().floor()).clamp(0.0, 6.0) as usize;
    trimmed(value, decimals).replace('-', "−")
}

/// More than any round step near a fifth of the scale gives.
const MOST_RINGS: f64 = 10.0;

/// The paper of a polar diagram: rings of equal intensity, rays of equal gamma.
pub(crate) struct Polar {
    centre: [f64; 2],
    radius: f64,
    /// Intensity from ring to ring.
    step: f64,
    rings: u32,
    /// Whether the half above the horizon is drawn, and the one below it.
    halves: [bool; 2],
}

/// Gamma angles and the intensities there, straight in between.
type Curve<'a> = (&'a [f64], &'a [f64]);

impl Polar {
    /// For intensities up to `most`.
    pub(crate) fn new(centre: [f64; 2], radius: f64, most: f64, halves: [bool; 2]) -> Self {
        // Darkness has no rings, and neither has what is next to it: a fifth of the smallest number is none.
        let step = Some(most / 5.0).filter(|fifth| fifth.is_normal()).map_or(1.0, round_step);
        Self { centre, radius, step, rings: (most / step).ceil().clamp(1.0, MOST_RINGS) as u32, halves }
    }

    /// Where an intensity at gamma lies; `side` is 1 to the right, -1 to the left.
    pub(super) fn place(&self, gamma_deg: f64, intensity: f64, side: f64) -> [f64; 2] {
        self.at(gamma_deg, intensity / (self.step * f64::from(self.rings)) * self.radius, side)
    }

    fn at(&self, gamma_deg: f64, r: f64, side: f64) -> [f64; 2] {
        let (sin, cos) = gamma_deg.to_radians().sin_cos();
        [self.centre[0] + side * r * sin, self.centre[1] + r * cos]
    }

    pub(crate) fn grid(&self) -> Markup {
        let ([x, y], [up, down]) = (self.centre, self.halves);
        let radius = |ring: u32| self.radius * f64::from(ring) / f64::from(self.rings);
        let half = |r: f64, sweep: u32| {
            format!("M{} {}A{2} {2} 0 0 {sweep} {3} {1}", number(x - r), number(y), number(r), number(x + r))
        };
        let is_drawn = |g: &f64| (*g >= 90.0 && up) || (*g <= 90.0 && down);
        let angles: Vec<f64> = (0..=12).map(|k| 15.0 * f64::from(k)).filter(is_drawn).collect();
        html! {
            @for r in (1..=self.rings).map(radius) {
                @if up { path.grid d=(half(r, 1)) {} }
                @if down { path.grid d=(half(r, 0)) {} }
            }
            @for &gamma in &angles { @for side in [-1.0, 1.0] { (line("grid", self.centre, self.at(gamma, self.radius, side))) } }
            @for &gamma in angles.iter().filter(|g| **g % 30.0 == 0.0) {
                @for &side in if gamma % 180.0 == 0.0 { &[1.0][..] } else { &[-1.0, 1.0] } {
                    @let [tx, ty] = self.at(gamma, self.radius + 13.0, side);
                    (text("tick", "middle", [tx, ty + 4.0], &format!("{}°", label(gamma))))
                }
            }
            @for ring in 1..=self.rings {
                @let (r, intensity) = (radius(ring), self.step * f64::from(ring));
                (text("tick halo", "middle", [x, if up { y - r + 11.0 } else { y + r - 4.0 }], &label(intensity)))
            }
        }
    }

    /// A plane's curve to the right and that of the plane opposite to the left.
    pub(crate) fn outline(&self, class: &str, right: Curve<'_>, left: Option<Curve<'_>>) -> Markup {
        let points = |(gamma_deg, intensity): Curve<'_>, side: f64| {
            let mut points: Vec<[f64; 2]> = vec![];
            for (g, i) in gamma_deg.windows(2).zip(intensity.windows(2)) {
                // Straight in (gamma, I) is bent here.
                let steps = ((g[1] - g[0]).ceil().max(1.0)) as u32;
                let at = |k: u32| f64::from(k) / f64::from(steps);
                let between = (0..steps).map(|k| (g[0] + at(k) * (g[1] - g[0]), i[0] + at(k) * (i[1] - i[0])));
                points.extend(between.map(|(g, i)| self.place(g, i, side)));
            }
            let last = gamma_deg.last().zip(intensity.last());
            points.extend(last.map(|(g, i)| self.place(*g, *i, side)));
            points
        };
        let mut all = left.map_or(vec![], |curve| points(curve, -1.0));
        all.reverse();
        all.extend(points(right, 1.0));
        let path: Vec<String> = all.iter().map(|[x, y]| format!("{} {}", number(*x), number(*y))).collect();
        html! { path class=(class) d={ "M" (path.join("L")) } {} }
    }
}

#[cfg(test)]
mod tests {
    use super::label;

    #[test]
    fn labels_have_a_real_minus_and_no_trailing_zeros() {
        assert_eq!([label(-0.1), label(0.0), label(2.50), label(1200.0)], ["−0.1", "0", "2.5", "1200"]);
    }
}
