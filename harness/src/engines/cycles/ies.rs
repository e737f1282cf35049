//! Tables as Cycles' IES texture looks them up: resampled so finely that its cubic curves follow our straight lines.
//!
//! Between angles Cycles 4.5 lays a cubic through four neighbours by their numbers (`kernel/util/ies.h`), whatever the angles between
//! them: straight where neighbours are equally far apart and in line, bent at every kink. It takes the neighbour before the first plane and
//! behind the last one for dark, and is dark at the last angle itself. So kinks get close neighbours, planes begin and end with cells of
//! a hair's breadth, turned away from C 0, and a row lies behind gamma 180; values where nobody looks make straight lines of
//! the curves beside them. What is left is computed and stated, never taken off.

use luminaire::photometry::{LuminousIntensityDistribution, Symmetry};

use crate::engines::patches::ies_file;
use crate::engines::patches::resampled::Resampled;

/// Width of the cells that keep a jump, a begin or an end to itself.
pub(super) const EDGE_DEG: f64 = 1e-3;
/// Width of the first and the last cell of planes, where Cycles is up to 7 % off: as narrow as 32-bit floats tell apart.
const HAIR_DEG: f64 = 1e-4;
/// How far planes are turned (`SEAM_DEG` of `cycles_scene.py`), so that no direction that anyone asks for lies where they begin.
const SEAM_DEG: f64 = 0.01;
/// The row behind gamma 180, and those beside nadir. Nothing is looked up between the latter: an arc cosine of 32-bit floats is 0 or
/// .0198 degrees at least.
const BEHIND_DEG: f64 = 180.5;
const BESIDE_NADIR_DEG: [f64; 2] = [5e-3, 1e-2];
/// What a cubic is off at most beside a kink, in parts of what steps change there: x (1 - x)^2 / 2 at x = 1/3.
const KINK: f64 = 2.0 / 27.0;
/// What is left of it, in parts of the largest intensity, and the most steps that this may take.
const WANTED: f64 = 1e-4;
const MOST_GAMMAS: usize = 1500;
const MOST_PLANES: usize = 730;
const MOST_VALUES: usize = 250_000;

/// A row or a plane.
#[derive(Clone, Copy, Debug)]
struct Node {
    deg: f64,
    /// Where its values are not its own but what a straight line has one step before the first of two angles.
    between: Option<(f64, f64)>,
}

impl Node {
    const fn at(deg: f64) -> Self {
        Self { deg, between: None }
    }

    fn value(&self, of: impl Fn(f64) -> f64) -> f64 {
        self.between.map_or_else(|| of(self.deg), |(first, next)| 2.0 * of(first) - of(next))
    }
}

/// A table as it is handed over, with the look-up of Cycles.
pub(super) struct LookedUp {
    of: LuminousIntensityDistribution,
    /// Angles of planes as Cycles has them: C and `SEAM_DEG`.
    h_deg: Vec<f64>,
    v_deg: Vec<f64>,
    /// Plane by plane.
    candela: Vec<Vec<f64>>,
}

impl LookedUp {
    pub(super) fn of(distribution: &LuminousIntensityDistribution) -> Self {
        let table = distribution.padded(EDGE_DEG);
        let full = table.full_circle();
        let planes: Vec<&[f64]> = (0..full.c_deg().len()).map(|c| full.plane(c)).collect();
        let rows: Vec<Vec<f64>> =
            (0..full.gamma_deg().len()).map(|g| planes.iter().map(|plane| plane[g]).collect()).collect();
        let is_axial = table.symmetry() == Symmetry::Axial;
        let largest = distribution.max_intensity().value();
        let mut steps = [
            steps(full.gamma_deg(), &planes, largest, MOST_GAMMAS),
            if is_axial { 1 } else { steps(full.c_deg(), &rows, largest, MOST_PLANES) },
        ];
        while (steps[0] * planes.len().max(1)) * steps[1] * rows.len() > MOST_VALUES && steps.iter().any(|s| *s > 1) {
            let larger = usize::from(steps[1] > steps[0]);
            steps[larger] = (steps[larger] / 2).max(1);
        }
        // What lies at the place of another's, seen from the cells beside it, so that the cubic there is straight.
        let gamma = divided(&with_ends(full.gamma_deg(), distribution), steps[0]);
        let [beside, nadir] = BESIDE_NADIR_DEG;
        let first = *gamma.iter().find(|g| **g > nadir).unwrap_or(&180.0);
        let inner: Vec<f64> = gamma.into_iter().filter(|g| *g > nadir).collect();
        let last = inner.iter().rev().find(|g| **g < 180.0).copied().unwrap_or(nadir);
        let rows = [Node::at(0.0), Node { deg: beside, between: Some((nadir, first)) }, Node::at(nadir)];
        let behind = Node { deg: BEHIND_DEG, between: Some((180.0, last)) };
        let v: Vec<Node> = rows.into_iter().chain(inner.into_iter().map(Node::at)).chain([behind]).collect();

        let c = if is_axial { vec![0.0, 180.0] } else { divided(full.c_deg(), steps[1]) };
        let end = 360.0 - 5.0 * EDGE_DEG;
        let inner: Vec<f64> = c.iter().map(|c| c + SEAM_DEG).filter(|h| *h < end - EDGE_DEG).collect();
        let next = inner.get(1).copied().unwrap_or(end);
        let before = inner.last().copied().unwrap_or(0.0);
        let begins = [Node::at(0.0), Node::at(HAIR_DEG), Node { deg: SEAM_DEG / 2.0, between: Some((SEAM_DEG, next)) }];
        let ends = [Node::at(end), Node { deg: end + EDGE_DEG, between: Some((end, before)) }];
        let ends = ends.into_iter().chain([360.0 - HAIR_DEG, 360.0].map(Node::at));
        let h: Vec<Node> = begins.into_iter().chain(inner.into_iter().map(Node::at)).chain(ends).collect();

        let exact = |h: f64, v: f64| table.intensity(h - SEAM_DEG, v.min(180.0)).value();
        let at = |h: f64, v: &Node| v.value(|v| exact(h, v));
        let candela = h.iter().map(|h| v.iter().map(|v| h.value(|h| at(h, v))).collect()).collect();
        let degrees = |nodes: Vec<Node>| nodes.into_iter().map(|n| n.deg).collect();
        Self { of: distribution.clone(), h_deg: degrees(h), v_deg: degrees(v), candela }
    }

    /// As an LM-63 file.
    pub(super) fn file(&self, about: &str) -> String {
        let keywords = ["[MANUFAC] luxproof", about, &format!("[MORE] planes are turned by {SEAM_DEG} degrees")];
        ies_file::text(&keywords, &self.v_deg, &self.h_deg, self.candela.iter().map(Vec::as_slice))
    }
}

impl Resampled for LookedUp {
    fn table(&self) -> &LuminousIntensityDistribution {
        &self.of
    }

    fn intensity_cd(&self, c_deg: f64, gamma_deg: f64) -> f64 {
        let h = (c_deg + SEAM_DEG).rem_euclid(360.0);
        let (Some((k, x)), Some((j, y))) = (cell(&self.h_deg, h), cell(&self.v_deg, gamma_deg)) else { return 0.0 };
        let along_gamma = |plane: &Vec<f64>| {
            // Beyond nadir it takes the other side for the same.
            let before = if j == 0 { plane[1] } else { plane[j - 1] };
            cubic([before, plane[j], plane[j + 1], plane.get(j + 2).copied().unwrap_or(0.0)], y)
        };
        let of = |k: Option<usize>| k.and_then(|k| self.candela.get(k)).map_or(0.0, along_gamma);
        cubic([of(k.checked_sub(1)), of(Some(k)), of(Some(k + 1)), of(Some(k + 2))], x).max(0.0)
    }
}

/// Into how many steps every cell is divided, so that cubics keep to what is wanted.
fn steps<R: AsRef<[f64]>>(angles: &[f64], tables: &[R], largest: f64, most: usize) -> usize {
    let cells = angles.len().saturating_sub(1).max(1);
    let is_wide = |k: usize| k + 1 < angles.len() && angles[k + 1] - angles[k] > 2.0 * EDGE_DEG;
    let mut kink = 0.0_f64;
    for table in tables {
        let table = table.as_ref();
        let change = |k: usize| if is_wide(k) { table[k + 1] - table[k] } else { 0.0 };
        kink = (0..cells.saturating_sub(1)).fold(kink, |kink, k| kink.max((change(k + 1) - change(k)).abs()));
    }
    let wanted = KINK * kink / (WANTED * largest).max(f64::MIN_POSITIVE);
    (wanted.ceil() as usize).clamp(1, (most / cells).max(1))
}

/// The angles with others a hair inside a table's ends, where it jumps, and a hair behind the jump.
fn with_ends(angles: &[f64], distribution: &LuminousIntensityDistribution) -> Vec<f64> {
    let own = distribution.gamma_deg();
    let (first, last) = (own[0], own[own.len() - 1]);
    let mut all = angles.to_vec();
    if first > 0.0 {
        all.extend([first + EDGE_DEG, first - 2.0 * EDGE_DEG]);
    }
    if last < 180.0 {
        all.extend([last - EDGE_DEG, last + 2.0 * EDGE_DEG]);
    }
    all.retain(|g| (0.0..=180.0).contains(g));
    all.sort_by(f64::total_cmp);
    all.dedup();
    all
}

/// The angles with every wide cell in so many equal steps.
fn divided(angles: &[f64], steps: usize) -> Vec<f64> {
    let cell = |ends: &[f64]| {
        let (low, high) = (ends[0], ends[1]);
        let steps = if high - low > 2.0 * EDGE_DEG { steps } else { 1 };
        (0..steps).map(move |k| low + (high - low) * k as f64 / steps as f64).collect::<Vec<_>>()
    };
    angles.windows(2).flat_map(cell).chain(angles.last().copied()).collect()
}

/// The cell that an angle lies in, and where in it; the last angle lies in none.
fn cell(angles: &[f64], angle: f64) -> Option<(usize, f64)> {
    let after = angles.partition_point(|a| *a <= angle);
    let k = after.checked_sub(1).filter(|_| after < angles.len())?;
    Some((k, (angle - angles[k]) / (angles[k + 1] - angles[k])))
}

/// Cycles' cubic (Catmull & Rom 1974) between the second and the third of four values.
fn cubic([a, b, c, d]: [f64; 4], x: f64) -> f64 {
    0.5 * (((d + 3.0 * (b - c) - a) * x + (2.0 * a - 5.0 * b + 4.0 * c - d)) * x + (c - a)) * x + b
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engines::fixtures::{axial_uplight, lambertian, lopsided, quadrant, random_table};

    #[test]
    fn what_cycles_looks_up_is_the_table_but_for_little() {
        for distribution in [axial_uplight(), lopsided(), quadrant(), lambertian()] {
            let table = LookedUp::of(&distribution);
            let largest = distribution.max_intensity().value();
            let mut worst = 0.0_f64;
            for k in 0..360 {
                for j in 0..=360 {
                    let (c, gamma) = (f64::from(k), 0.5 * f64::from(j));
                    worst = worst.max((table.intensity_cd(c, gamma) - distribution.intensity(c, gamma).value()).abs());
                }
            }
            assert!(worst < 5e-4 * largest, "{worst} of {largest}");
            assert!(table.misled_share() < 3e-4, "{}", table.misled_share());
        }
    }

    #[test]
    fn any_table_is_a_file_of_bounded_size_that_keeps_most_of_its_flux() {
        let mut random = fastrand::Rng::with_seed(4);
        for _ in 0..20 {
            let table = LookedUp::of(&random_table(&mut random));
            assert!(table.h_deg.len() * table.v_deg.len() < 2 * MOST_VALUES);
            assert!(table.h_deg.is_sorted() && table.v_deg.is_sorted() && table.misled_share() < 0.01);
            assert_eq!((table.h_deg[0], table.v_deg[0], table.h_deg.last()), (0.0, 0.0, Some(&360.0)));
        }
    }
}
