//! Flux of type B tables within zones of gamma. Their cones are oblique to the cells of the table.
//!
//! In the angles of type B, V about the axis and H from it, gamma is at most G where cos V cos H >= cos G. For each H that
//! is a single range of V, over which a bilinear table integrates in closed form. The remaining integrand over H is smooth
//! between the nodes and the angles at which that range ends at a node. At its ends it can vary with a square root: the
//! double exponential rule of Takahasi and Mori (1974) handles that.

use std::f64::consts::FRAC_PI_2;

use super::{LuminousIntensityDistribution, bracket};

/// Step of the double exponential rule.
const RULE_STEP: f64 = 0.125;
/// Steps of the rule to either side. The weights beyond are below 1e-16.
const RULE_STEPS_PER_SIDE: i32 = 26;

impl LuminousIntensityDistribution {
    /// Flux in lumens of a type B table between two type C gamma angles, within limits of its native angles, all in degrees.
    pub(crate) fn flux_of_zone(&self, zone_deg: [f64; 2], c_deg: [f64; 2], gamma_deg: [f64; 2]) -> f64 {
        let rows = RowIntegrals::new(self);
        let [from, to] = zone_deg.map(|limit| rows.flux_in_cone(limit.clamp(0.0, 180.0), c_deg, gamma_deg));
        (to - from).max(0.0)
    }
}

/// The integrals of the rows of a table over the angle of its planes.
struct RowIntegrals<'a> {
    table: &'a LuminousIntensityDistribution,
    /// `[gamma][c]`: the integral up to each plane, in candela times degrees.
    up_to_plane: Vec<Vec<f64>>,
}

impl<'a> RowIntegrals<'a> {
    /// Integrates every row by the trapezoid rule, which is exact for a bilinear table.
    fn new(table: &'a LuminousIntensityDistribution) -> Self {
        let mut up_to_plane = vec![];
        for g in 0..table.gamma_deg.len() {
            let mut sums = vec![0.0];
            for (k, c) in table.c_deg.windows(2).enumerate() {
                sums.push(sums[k] + 0.5 * (c[1] - c[0]) * (table.plane(k)[g] + table.plane(k + 1)[g]));
            }
            up_to_plane.push(sums);
        }
        Self { table, up_to_plane }
    }

    /// Integral of a row from the first plane to an angle, in candela times degrees.
    fn integral_to(&self, g: usize, c_deg: f64) -> f64 {
        let planes = &self.table.c_deg;
        let (k, s) = bracket(planes, c_deg);
        let (a, b) = (self.table.plane(k)[g], self.table.plane(k + 1)[g]);
        self.up_to_plane[g][k] + s * (planes[k + 1] - planes[k]) * (a + 0.5 * s * (b - a))
    }

    /// Flux in lumens within a cone about the nadir and limits of the native angles.
    fn flux_in_cone(&self, cone_deg: f64, c_deg: [f64; 2], gamma_deg: [f64; 2]) -> f64 {
        let cosine = cone_deg.to_radians().cos();
        let cuts = self.smooth_pieces(cosine, c_deg, gamma_deg);
        let mut sum = 0.0;
        let angles = &self.table.gamma_deg;
        for piece in cuts.windows(2) {
            let middle = 0.5 * (piece[0] + piece[1]);
            let (j, _) = bracket(angles, middle);
            sum += integrate([piece[0], piece[1]], |gamma| {
                let sine = gamma.to_radians().sin();
                let reach = (cosine / sine.max(f64::MIN_POSITIVE)).clamp(-1.0, 1.0).acos().to_degrees();
                let [from, to] = [c_deg[0].max(-reach), c_deg[1].min(reach)];
                if to <= from {
                    return 0.0;
                }
                let [low, high] = [j, j + 1].map(|g| self.integral_to(g, to) - self.integral_to(g, from));
                let t = (gamma - angles[j]) / (angles[j + 1] - angles[j]);
                (low + t * (high - low)) * sine
            });
        }
        sum * (std::f64::consts::PI / 180.0).powi(2)
    }

    /// The native gamma angles between which the integrand is smooth, within limits.
    fn smooth_pieces(&self, cosine: f64, c_deg: [f64; 2], gamma_deg: [f64; 2]) -> Vec<f64> {
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

/// Integrates a function by the double exponential rule, which allows a root at either end.
fn integrate([from, to]: [f64; 2], f: impl Fn(f64) -> f64) -> f64 {
    let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
    let mut sum = 0.0;
    for k in -RULE_STEPS_PER_SIDE..=RULE_STEPS_PER_SIDE {
        let t = RULE_STEP * f64::from(k);
        let argument = FRAC_PI_2 * t.sinh();
        let weight = FRAC_PI_2 * t.cosh() / argument.cosh().powi(2);
        sum += weight * f(middle + half * argument.tanh());
    }
    half * RULE_STEP * sum
}
