//! Parts of drawings in SVG: words, lines, and polar diagrams of luminous intensity.
//!
//! The diagrams follow EN 13032-2: nadir down, C 0 and C 90 to the right, C 180 and C 270 to the left.

use maud::{Markup, html};

use super::words::{round_step, trimmed};

pub fn text(class: &str, anchor: &str, [x, y]: [f64; 2], words: &str) -> Markup {
    html! { text class=(class) text-anchor=(anchor) x=(number(x)) y=(number(y)) { (words) } }
}

pub fn line(class: &str, [x1, y1]: [f64; 2], [x2, y2]: [f64; 2]) -> Markup {
    html! { path class=(class) d={ "M" (number(x1)) " " (number(y1)) "L" (number(x2)) " " (number(y2)) } {} }
}

pub fn number(value: f64) -> String {
    trimmed(value, 1)
}

/// A value at an axis, with a real minus.
pub fn label(value: f64) -> String {
    let decimals = (3.0 - value.abs().max(1e-9).log10().floor()).clamp(0.0, 6.0) as usize;
    trimmed(value, decimals).replace('-', "−")
}

/// More rings than any round step near a fifth of the scale gives.
const MAX_RINGS: f64 = 10.0;
/// The angle between two rays, in degrees.
const RAY_STEP_DEG: u32 = 15;

/// The paper of a polar diagram: rings of equal intensity, rays of equal gamma.
pub struct Polar {
    centre: [f64; 2],
    radius: f64,
    /// Intensity from ring to ring.
    step: f64,
    rings: u32,
    /// Whether the half above the horizon is drawn, and the half below it.
    halves: [bool; 2],
}

/// Gamma angles and the intensities there, linear in between.
type Curve<'a> = (&'a [f64], &'a [f64]);

impl Polar {
    /// Paper for intensities up to `most`.
    pub fn new(centre: [f64; 2], radius: f64, most: f64, halves: [bool; 2]) -> Self {
        // A fifth of zero or of the smallest numbers gives no step, so the scale ends at 1.
        let step = Some(most / 5.0).filter(|fifth| fifth.is_normal()).map_or(1.0, round_step);
        Self { centre, radius, step, rings: (most / step).ceil().clamp(1.0, MAX_RINGS) as u32, halves }
    }

    /// The place of an intensity at gamma; `side` is 1 to the right, -1 to the left.
    pub(super) fn place(&self, gamma_deg: f64, intensity: f64, side: f64) -> [f64; 2] {
        self.at(gamma_deg, intensity / (self.step * f64::from(self.rings)) * self.radius, side)
    }

    fn at(&self, gamma_deg: f64, r: f64, side: f64) -> [f64; 2] {
        let (sin, cos) = gamma_deg.to_radians().sin_cos();
        [self.centre[0] + side * r * sin, self.centre[1] + r * cos]
    }

    fn ring_radius(&self, ring: u32) -> f64 {
        self.radius * f64::from(ring) / f64::from(self.rings)
    }

    /// The path of a half circle; `sweep` is 1 above the horizon, 0 below it.
    fn half_circle(&self, r: f64, sweep: u32) -> String {
        let [x, y] = self.centre;
        format!("M{} {}A{2} {2} 0 0 {sweep} {3} {1}", number(x - r), number(y), number(r), number(x + r))
    }

    /// The gamma angles of the rays in the drawn halves, in degrees.
    fn ray_angles(&self) -> Vec<f64> {
        let [up, down] = self.halves;
        let all = (0..=180 / RAY_STEP_DEG).map(|k| f64::from(RAY_STEP_DEG * k));
        all.filter(|gamma| (*gamma >= 90.0 && up) || (*gamma <= 90.0 && down)).collect()
    }

    pub fn grid(&self) -> Markup {
        let ([x, y], [up, down]) = (self.centre, self.halves);
        let angles = self.ray_angles();
        html! {
            @for r in (1..=self.rings).map(|ring| self.ring_radius(ring)) {
                @if up { path.grid d=(self.half_circle(r, 1)) {} }
                @if down { path.grid d=(self.half_circle(r, 0)) {} }
            }
            @for &gamma in &angles { @for side in [-1.0, 1.0] { (line("grid", self.centre, self.at(gamma, self.radius, side))) } }
            @for &gamma in angles.iter().filter(|g| **g % 30.0 == 0.0) {
                @for &side in if gamma % 180.0 == 0.0 { &[1.0][..] } else { &[-1.0, 1.0] } {
                    @let [tx, ty] = self.at(gamma, self.radius + 13.0, side);
                    (text("tick", "middle", [tx, ty + 4.0], &format!("{}°", label(gamma))))
                }
            }
            @for ring in 1..=self.rings {
                @let (r, intensity) = (self.ring_radius(ring), self.step * f64::from(ring));
                (text("tick halo", "middle", [x, if up { y - r + 11.0 } else { y + r - 4.0 }], &label(intensity)))
            }
        }
    }

    /// A plane's curve to the right and that of the opposite plane to the left.
    pub fn outline(&self, class: &str, right: Curve<'_>, left: Option<Curve<'_>>) -> Markup {
        let mut all = left.map_or(vec![], |curve| self.curve_points(curve, -1.0));
        all.reverse();
        all.extend(self.curve_points(right, 1.0));
        let path: Vec<String> = all.iter().map(|[x, y]| format!("{} {}", number(*x), number(*y))).collect();
        html! { path class=(class) d={ "M" (path.join("L")) } {} }
    }

    /// The points of a curve, at most one degree from each other, because a line that is straight in gamma is curved in the diagram.
    fn curve_points(&self, (gamma_deg, intensity): Curve<'_>, side: f64) -> Vec<[f64; 2]> {
        let mut points: Vec<[f64; 2]> = vec![];
        for (g, i) in gamma_deg.windows(2).zip(intensity.windows(2)) {
            let steps = ((g[1] - g[0]).ceil().max(1.0)) as u32;
            for k in 0..steps {
                let t = f64::from(k) / f64::from(steps);
                points.push(self.place(g[0] + t * (g[1] - g[0]), i[0] + t * (i[1] - i[0]), side));
            }
        }
        let last = gamma_deg.last().zip(intensity.last());
        points.extend(last.map(|(g, i)| self.place(*g, *i, side)));
        points
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
