//! The outline of a flat luminous opening, as the corners of a polygon in the luminaire's own frame.

use glam::DVec3;

use super::LuminousOpening;

impl LuminousOpening {
    /// The corners of a flat horizontal opening in metres, counter-clockwise seen from above; an ellipse as a polygon of so many
    /// corners and of its area. `None` where it has a height or no area.
    pub fn flat_outline_m(&self, of_an_ellipse: u32) -> Option<Vec<DVec3>> {
        match *self {
            Self::Box { x_m, y_m, height_m: 0.0 } if x_m > 0.0 && y_m > 0.0 => {
                let corner = |u: f64, v: f64| DVec3::new(u * x_m, v * y_m, 0.0);
                Some(vec![corner(-0.5, -0.5), corner(0.5, -0.5), corner(0.5, 0.5), corner(-0.5, 0.5)])
            }
            Self::Ellipse { x_m, y_m, height_m: 0.0 } if x_m > 0.0 && y_m > 0.0 => {
                let step = std::f64::consts::TAU / f64::from(of_an_ellipse);
                let swell = 0.5 * (step / step.sin()).sqrt();
                let corner = |k: u32| {
                    let (sin, cos) = (f64::from(k) * step).sin_cos();
                    DVec3::new(swell * x_m * cos, swell * y_m * sin, 0.0)
                };
                Some((0..of_an_ellipse).map(corner).collect())
            }
            _ => None,
        }
    }
}
