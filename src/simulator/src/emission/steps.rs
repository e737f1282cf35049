//! Steps of a table: cells so narrow and steep that the nodes of a rule do not tell them from a jump.
//!
//! The horizon between sky and ground is one (`reference/cie171`): two planes a thousandth of a degree apart.

use luxproof_photometry::LuminousIntensityDistribution;

/// Cells narrower than so many degrees, and steeper than this part of the peak in a degree; a cosine has .0175.
const NARROW_DEG: f64 = 0.1;
const STEEP: f64 = 0.1;

/// Where a table has steps, and how large they are at most.
#[derive(Clone, Debug, Default)]
pub(super) struct Steps {
    c_deg: Vec<f64>,
    gamma_deg: Vec<f64>,
    largest_cd: f64,
}

/// Whether a cell of a table is a step, by its width and by what it changes, relative to the table's peak.
fn is_step(width_deg: f64, change: f64) -> bool {
    width_deg < NARROW_DEG && change > STEEP * width_deg
}

impl Steps {
    /// Those of a table of type C; in others' own angles none are looked for.
    pub(super) fn of(table: &LuminousIntensityDistribution) -> Self {
        let mut steps = Self::default();
        if table.is_native() {
            return steps;
        }
        let table = table.full_circle();
        let (c_deg, gamma_deg, peak_cd) = (table.c_deg(), table.gamma_deg(), table.max_intensity().value());
        for k in 1..c_deg.len() {
            let planes = table.plane(k - 1).iter().zip(table.plane(k));
            let apart_cd = planes.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            if is_step(c_deg[k] - c_deg[k - 1], apart_cd / peak_cd) {
                steps.c_deg.push(0.5 * (c_deg[k] + c_deg[k - 1]));
                steps.largest_cd = steps.largest_cd.max(apart_cd);
            }
        }
        for k in 1..gamma_deg.len() {
            let rows = (0..c_deg.len()).map(|c| (table.plane(c)[k] - table.plane(c)[k - 1]).abs());
            let apart_cd = rows.fold(0.0, f64::max);
            if is_step(gamma_deg[k] - gamma_deg[k - 1], apart_cd / peak_cd) {
                steps.gamma_deg.push(0.5 * (gamma_deg[k] + gamma_deg[k - 1]));
                steps.largest_cd = steps.largest_cd.max(apart_cd);
            }
        }
        steps
    }

    /// The largest of them in candela, if there is any.
    pub(super) fn largest_cd(&self) -> Option<f64> {
        (self.largest_cd > 0.0).then_some(self.largest_cd)
    }

    /// Whether an odd number of them lies before a direction, so that two directions differ where one step is between them.
    pub(super) fn is_beyond(&self, (c_deg, gamma_deg): (f64, f64)) -> bool {
        let pairs = [(&self.c_deg, c_deg.rem_euclid(360.0)), (&self.gamma_deg, gamma_deg)];
        let before = pairs.map(|(steps, angle)| steps.iter().filter(|step| **step < angle).count());
        (before[0] + before[1]) % 2 == 1
    }
}
