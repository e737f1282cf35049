//! Flux of tables of type B within zones of gamma, whose cones run askew through their cells.
//!
//! In the angles of type B, V about the axis and H from it, gamma is at most G where cos V cos H >= cos G: for each H a single
//! range of V, over which a bilinear table integrates in closed form. Over H what is left is smooth between the nodes and the
//! angles at which that range ends at a node; at its ends it may go with a root, for which the double exponential rule of
//! Takahasi and Mori (1974) is made.

use std::f64::consts::FRAC_PI_2;

use super::{LuminousIntensityDistribution, bracket};

/// Step of the double exponential rule and how many there are to either side: beyond, weights are below 1e-16.
const STEP: f64 = 0.125;
const STEPS: i32 = 26;

impl LuminousIntensityDistribution {
    /// Flux in lumens between two angles gamma of type C and within limits of the table's own angles, all in degrees, of type B.
    pub(in crate::photometry) fn flux_of_zone(&self, zone_deg: [f64; 2], c_deg: [f64; 2], gamma_deg: [f64; 2]) -> f64 {
        let below = Rows::of(self);
        let [from, to] = zone_deg.map(|limit| below.within_cone(limit.clamp(0.0, 180.0), c_deg, gamma_deg));
        (to - from).max(0.0)
    }
}

/// The rows of a table along its planes' angle, each with its integral up to every plane.
struct Rows<'a> {
    table: &'a LuminousIntensityDistribution,
    /// `[gamma][c]` in candela times degrees.
    below: Vec<Vec<f64>>,
}

impl<'a> Rows<'a> {
    fn of(table: &'a LuminousIntensityDistribution) -> Self {
        let of_row = |g: usize| {
            let mut below = vec![0.0];
            for (k, c) in table.c_deg.windows(2).enumerate() {
                below.push(below[k] + 0.5 * (c[1] - c[0]) * (table.plane(k)[g] + table.plane(k + 1)[g]));
            }
            below
        };
        Self { table, below: (0..table.gamma_deg.len()).map(of_row).collect() }
    }

    /// Integral of a row from the first plane to an angle, in candela times degrees.
    fn up_to(&self, g: usize, c_deg: f64) -> f64 {
        let planes = &self.table.c_deg;
        let (k, s) = bracket(planes, c_deg);
        let (a, b) = (self.table.plane(k)[g], self.table.plane(k + 1)[g]);
        self.below[g][k] + s * (planes[k + 1] - planes[k]) * (a + 0.5 * s * (b - a))
    }

    /// Flux in lumens within a cone about the nadir and limits of the table's own angles.
    fn within_cone(&self, cone_deg: f64, c_deg: [f64; 2], gamma_deg: [f64; 2]) -> f64 {
        let cosine = cone_deg.to_radians().cos();
        let cuts = self.cuts(cosine, c_deg, gamma_deg);
        let mut sum = 0.0;
        let angles = &self.table.gamma_deg;
        for piece in cuts.windows(2) {
            let middle = 0.5 * (piece[0] + piece[1]);
            let (j, _) = bracket(angles, middle);
            sum += double_exponential([piece[0], piece[1]], |gamma| {
                let sine = gamma.to_radians().sin();
                let reach = (cosine / sine.max(f64::MIN_POSITIVE)).clamp(-1.0, 1.0).acos().to_degrees();
                let [from, to] = [c_deg[0].max(-reach), c_deg[1].min(reach)];
                if to <= from {
                    return 0.0;
                }
                let [low, high] = [j, j + 1].map(|g| self.up_to(g, to) - self.up_to(g, from));
                let t = (gamma - angles[j]) / (angles[j + 1] - angles[j]);
                (low + t * (high - low)) * sine
            });
        }
        sum * (std::f64::consts::PI / 180.0).powi(2)
    }

    /// The table's own angles from its axis between which nothing bends, within limits.
    fn cuts(&self, cosine: f64, c_deg: [f64; 2], gamma_deg: [f64; 2]) -> Vec<f64> {
        let angles = &self.table.gamma_deg;
        let [low, high] = [angles[0].max(gamma_deg[0]), angles[angles.len() - 1].min(gamma_deg[1])];
        let ends = self.table.c_deg.iter().copied().chain(c_deg).chain([0.0, 180.0]);
        let meets = ends.map(|c| (cosine / c.to_radians().cos()).asin().to_degrees()).flat_map(|g| [g, 180.0 - g]);
        let mut cuts: Vec<f64> = angles.iter().copied().chain(meets).filter(|g| *g > low && *g < high).collect();
        cuts.extend([low, high]);
        cuts.sort_by(f64::total_cmp);
        cuts.dedup();
        if low < high { cuts } else { vec![] }
    }
}

/// Integral of what is smooth but at its ends.
fn double_exponential([from, to]: [f64; 2], f: impl Fn(f64) -> f64) -> f64 {
    let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
    let mut sum = 0.0;
    for k in -STEPS..=STEPS {
        let t = STEP * f64::from(k);
        let argument = FRAC_PI_2 * t.sinh();
        let weight = FRAC_PI_2 * t.cosh() / argument.cosh().powi(2);
        sum += weight * f(middle + half * argument.tanh());
    }
    half * STEP * sum
}
