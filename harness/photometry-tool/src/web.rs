//! The paper of a diagram over all directions: C from left to right, gamma from the nadir at the bottom to the zenith.

use maud::{Markup, html};

use luxproof_report::svg::{line, number, text};

/// Lengths of the drawing in its own units.
const WIDTH: f64 = 540.0;
const PER_DEGREE: f64 = 1.5;
const LEFT: f64 = 52.0;
const TOP: f64 = 44.0;

pub(super) const STYLE: &str =
    ".grid{fill:none;stroke:#c8c8c8;stroke-width:.8}.tick{fill:#555}.frame{fill:none;stroke:#333}";

/// A rectangular map of directions.
pub(super) struct Web {
    /// Gamma at the top.
    gamma_end_deg: f64,
}

impl Web {
    /// A map up to the horizon, or to the zenith for light above.
    pub(super) fn new(has_light_above: bool) -> Self {
        Self { gamma_end_deg: if has_light_above { 180.0 } else { 90.0 } }
    }

    pub(super) fn gamma_end_deg(&self) -> f64 {
        self.gamma_end_deg
    }

    /// Width and height of a drawing with an additional height below the map.
    pub(super) fn size(&self, below: f64) -> [f64; 2] {
        [LEFT + WIDTH + 20.0, TOP + self.height() + 26.0 + below]
    }

    fn height(&self) -> f64 {
        PER_DEGREE * self.gamma_end_deg
    }

    /// The place of C (-180 to 180) and gamma.
    pub(super) fn place(&self, c_deg: f64, gamma_deg: f64) -> [f64; 2] {
        [LEFT + WIDTH * (c_deg + 180.0) / 360.0, TOP + self.height() * (1.0 - gamma_deg / self.gamma_end_deg)]
    }

    /// Draws the grid with its labels and frame.
    pub(super) fn grid(&self) -> Markup {
        let rows: Vec<f64> = (0..=6).map(|k| 30.0 * f64::from(k)).filter(|g| *g <= self.gamma_end_deg).collect();
        let [x, y] = self.place(-180.0, self.gamma_end_deg);
        html! {
            @for c in (-6..=6).map(|k| 30.0 * f64::from(k)) {
                (line("grid", self.place(c, 0.0), self.place(c, self.gamma_end_deg)))
                @if c % 60.0 == 0.0 {
                    @let [x, y] = self.place(c, 0.0);
                    (text("tick", "middle", [x, y + 16.0], &format!("{}°", if c < 0.0 { c + 360.0 } else { c })))
                }
            }
            @for gamma in rows {
                (line("grid", self.place(-180.0, gamma), self.place(180.0, gamma)))
                @let [x, y] = self.place(-180.0, gamma);
                (text("tick", "end", [x - 6.0, y + 4.0], &format!("{gamma}°")))
            }
            rect.frame x=(number(x)) y=(number(y)) width=(number(WIDTH)) height=(number(self.height())) {}
        }
    }
}
