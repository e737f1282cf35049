//! Tables as goniometers measure them; those of type A and type B turned into type C on the sphere.
//!
//! Source of the frames: ANSI/IESNA LM-63-02 section 3. Photometric zero is the nadir: gamma 0 of type C, H 0 V 0 of
//! type B, V -90 of type A. Photometric horizontal is +x: C 0 gamma 90, H 0 V 90 of type B, H 0 V 0 of type A.
//! Horizontal angles turn counter-clockwise seen from above in type C and clockwise in types A and B. Hence
//! type A is type C with gamma = 90 + V and C = -H, and in type B a direction is
//! (cos H sin V, -sin H, -cos H cos V). Between its nodes the file's own table is bilinear in (H, V) in degrees.

use super::{DistributionError, LuminousIntensityDistribution, angles_deg};
use glam::DVec3;

/// How a luminaire was measured: the coordinates of its table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Goniometer {
    /// Vertical axis, angles from the horizon: automotive.
    A,
    /// Horizontal axis: floodlights.
    B,
    /// Vertical axis, angles from the nadir: everything else.
    C,
}

/// Angles in degrees and intensities in candela as a file has them, and where they stand in it.
pub(crate) struct Table {
    pub(crate) vertical_deg: Vec<f64>,
    pub(crate) vertical_at: usize,
    pub(crate) horizontal_deg: Vec<f64>,
    pub(crate) horizontal_at: usize,
    /// `candela[horizontal][vertical]`.
    pub(crate) candela: Vec<f64>,
    pub(crate) candela_at: usize,
}

/// A table of type C that stands for one of type A or B, and how far it is from it.
pub(super) struct Resampled {
    pub(super) distribution: LuminousIntensityDistribution,
    /// Largest difference at the nodes of the file, in candela.
    pub(super) node_error_cd: f64,
    /// Largest difference at the centres of the file's cells, in candela.
    pub(super) cell_error_cd: f64,
}

/// The most values that a resampled table may have: 8 MB.
const MAX_VALUES: usize = 1_000_000;
/// Angles that differ by less are one, in degrees.
const SAME_DEG: f64 = 1e-9;
/// Over how many degrees a type C table falls to zero beyond the last plane of a type A table.
const EDGE_DEG: f64 = 1e-6;

/// Resamples a table of type A or B.
pub(super) fn to_type_c(goniometer: Goniometer, table: &Table) -> Result<Resampled, DistributionError> {
    let native = Native { goniometer, table };
    let (c_deg, gamma_deg) = match goniometer {
        Goniometer::A => native.planes_of_type_a(),
        Goniometer::B | Goniometer::C => native.grid_of_type_b(),
    };
    let at = |c: f64, gamma: f64| native.intensity(native.angles_of(c, gamma));
    let candela = c_deg.iter().flat_map(|&c| gamma_deg.iter().map(move |&gamma| at(c, gamma))).collect();
    let distribution = LuminousIntensityDistribution::new(c_deg, gamma_deg, candela)?;
    let (node_error_cd, cell_error_cd) = native.errors(&distribution);
    Ok(Resampled { distribution, node_error_cd, cell_error_cd })
}

/// The file's own table and what it means between its nodes.
#[derive(Clone, Copy)]
struct Native<'a> {
    goniometer: Goniometer,
    table: &'a Table,
}

impl Native<'_> {
    /// Whether only one half is given, to be mirrored in the vertical plane of H 0.
    fn is_mirrored(&self) -> bool {
        self.table.horizontal_deg[0] == 0.0
    }

    /// Bilinear in (H, V), zero outside the table.
    fn intensity(&self, (h, v): (f64, f64)) -> f64 {
        let h = if self.is_mirrored() { h.abs() } else { h };
        let table = self.table;
        let (Some((i, s)), Some((j, t))) = (bracket(&table.horizontal_deg, h), bracket(&table.vertical_deg, v)) else {
            return 0.0;
        };
        let rows = table.vertical_deg.len();
        let last = table.horizontal_deg.len() - 1;
        let along = |i: usize| {
            let row = &table.candela[i * rows..][..rows];
            (1.0 - t) * row[j] + t * row[j + 1]
        };
        (1.0 - s) * along(i) + s * along((i + 1).min(last))
    }

    /// The file's angles (H, V) of a direction of type C, H in -180..=180.
    fn angles_of(&self, c_deg: f64, gamma_deg: f64) -> (f64, f64) {
        if self.goniometer == Goniometer::A {
            let h = (-c_deg).rem_euclid(360.0);
            return (if h > 180.0 { h - 360.0 } else { h }, gamma_deg - 90.0);
        }
        let d = super::direction(c_deg, gamma_deg);
        ((-d.y).atan2(d.x.hypot(d.z)).to_degrees(), d.x.atan2(-d.z).to_degrees())
    }

    /// The direction (C, gamma) of the file's angles.
    fn direction_of(&self, h_deg: f64, v_deg: f64) -> (f64, f64) {
        if self.goniometer == Goniometer::A {
            return ((-h_deg).rem_euclid(360.0), v_deg + 90.0);
        }
        let ((sin_h, cos_h), (sin_v, cos_v)) = (h_deg.to_radians().sin_cos(), v_deg.to_radians().sin_cos());
        angles_deg(DVec3::new(cos_h * sin_v, -sin_h, -cos_h * cos_v))
    }

    /// Every plane of a type A file is one of type C; beyond the last one an edge falls to zero.
    fn planes_of_type_a(&self) -> (Vec<f64>, Vec<f64>) {
        let h = &self.table.horizontal_deg;
        let gamma_deg = self.table.vertical_deg.iter().map(|v| v + 90.0).collect();
        if h.len() == 1 {
            return (vec![0.0], gamma_deg);
        }
        let last = h[h.len() - 1];
        if self.is_mirrored() {
            let edge = [last + EDGE_DEG, 180.0].into_iter().filter(|c| *c > last && *c <= 180.0);
            return (merged(h.iter().copied().chain(edge).collect()), gamma_deg);
        }
        let edges = if last - h[0] < 360.0 { vec![h[0] - EDGE_DEG, last + EDGE_DEG] } else { vec![] };
        let mut c_deg: Vec<f64> = h.iter().copied().chain(edges).map(|h| (-h).rem_euclid(360.0)).collect();
        c_deg.extend([0.0, 360.0]);
        (merged(c_deg), gamma_deg)
    }

    /// A grid through every node of a type B file, or an even one where that would be too large.
    fn grid_of_type_b(&self) -> (Vec<f64>, Vec<f64>) {
        let last_c = self.last_plane_of_type_b();
        let (mut c_deg, mut gamma_deg) = (vec![0.0, last_c], vec![0.0]);
        for &h in &self.table.horizontal_deg {
            for &v in &self.table.vertical_deg {
                let (c, gamma) = self.direction_of(h, v);
                let folds = match last_c {
                    90.0 => c.min(360.0 - c).min((180.0 - c).abs()),
                    180.0 => c.min(360.0 - c),
                    _ => c,
                };
                // At the poles every C is the same direction.
                if gamma > SAME_DEG && gamma < 180.0 - SAME_DEG {
                    c_deg.push(folds);
                }
                gamma_deg.push(gamma);
            }
        }
        let (c_deg, mut gamma_deg) = (merged(c_deg), merged(gamma_deg));
        if gamma_deg.len() < 2 {
            gamma_deg.push(180.0);
        }
        if c_deg.len().saturating_mul(gamma_deg.len()) <= MAX_VALUES {
            return (c_deg, gamma_deg);
        }
        let last_gamma = gamma_deg[gamma_deg.len() - 1];
        let finest = |angles: &[f64]| angles.windows(2).map(|w| w[1] - w[0]).fold(f64::INFINITY, f64::min);
        let step = 0.5 * finest(&self.table.horizontal_deg).min(finest(&self.table.vertical_deg));
        let least_step = (last_c * last_gamma / (0.9 * MAX_VALUES as f64)).sqrt();
        let even = |last: f64| {
            let count = (last / step.max(least_step)).ceil();
            (0..=count as usize).map(|k| last * k as f64 / count).collect::<Vec<f64>>()
        };
        (even(last_c), even(last_gamma))
    }

    /// 90, 180 or 360: how far the planes of type C must reach for the file's symmetry.
    fn last_plane_of_type_b(&self) -> f64 {
        let v = &self.table.vertical_deg;
        let rows = v.len();
        let upright = v.iter().zip(v.iter().rev()).all(|(a, b)| *a == -*b)
            && self.table.candela.chunks(rows).all(|row| row.iter().eq(row.iter().rev()));
        match (self.is_mirrored(), upright) {
            (true, true) => 90.0,
            (true, false) => 180.0,
            (false, _) => 360.0,
        }
    }

    /// Largest differences from a type C distribution at the nodes and at the centres of the cells.
    fn errors(&self, distribution: &LuminousIntensityDistribution) -> (f64, f64) {
        let difference = |h: f64, v: f64| {
            let (c, gamma) = self.direction_of(h, v);
            (distribution.intensity(c, gamma).value() - self.intensity((h, v))).abs()
        };
        let worst = |hs: &[f64], vs: &[f64]| {
            hs.iter().flat_map(|&h| vs.iter().map(move |&v| difference(h, v))).fold(0.0, f64::max)
        };
        let centres = |angles: &[f64]| angles.windows(2).map(|w| 0.5 * (w[0] + w[1])).collect::<Vec<f64>>();
        let (h, v) = (&self.table.horizontal_deg, &self.table.vertical_deg);
        (worst(h, v), worst(&centres(h), &centres(v)))
    }
}

/// Sorted, with angles that are the same to rounding made one; the ends of the range keep their exact value.
fn merged(mut angles: Vec<f64>) -> Vec<f64> {
    let exact = [0.0, 90.0, 180.0, 360.0];
    for angle in &mut angles {
        if let Some(end) = exact.iter().find(|end| (*angle - **end).abs() < SAME_DEG) {
            *angle = *end;
        }
    }
    angles.sort_by(f64::total_cmp);
    angles.dedup_by(|b, a| *b - *a < SAME_DEG);
    angles
}

/// The interval that holds `x` and the fraction along it; `None` outside.
fn bracket(nodes: &[f64], x: f64) -> Option<(usize, f64)> {
    let (first, last) = (nodes[0], nodes[nodes.len() - 1]);
    if x < first - SAME_DEG || x > last + SAME_DEG {
        return None;
    }
    if nodes.len() == 1 {
        return Some((0, 0.0));
    }
    let k = nodes.partition_point(|n| *n <= x).clamp(1, nodes.len() - 1) - 1;
    Some((k, ((x - nodes[k]) / (nodes[k + 1] - nodes[k])).clamp(0.0, 1.0)))
}
