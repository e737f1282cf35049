//! Polygons as triangles: a fan where that covers them, ears cut off one by one where it does not.
//!
//! Ears: G. H. Meisters, *Polygons have ears*, American Mathematical Monthly 82 (1975).

use glam::{DVec2, DVec3};

/// How often corners may be looked at to find ears, besides `LOOKS_A_CORNER` for each corner: about a second.
const LOOKS: u64 = 200_000_000;
const LOOKS_A_CORNER: u64 = 64;

/// Twice an area below this part of the polygon's is none.
const FLAT: f64 = 1e-12;

/// What two sums of the same areas may differ by, relative to them.
const SAME_AREA: f64 = 1e-6;

/// Cuts polygons, all of a file together within bounded time.
#[derive(Debug)]
pub struct Triangulator {
    looks_left: u64,
}

/// Why a polygon gives no triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NotCut {
    /// Its edges cross, so that what is inside is not said.
    #[error("its edges cross each other")]
    Crossing,
    /// It, or what came before it, has too many corners.
    #[error("concave polygons of so many corners would take too long")]
    TooLarge,
}

impl Default for Triangulator {
    fn default() -> Self {
        Self { looks_left: LOOKS }
    }
}

impl Triangulator {
    /// The triangles of a polygon by the indices of its corners, which turn as it does.
    ///
    /// A corner may occur twice, as at the seam by which a hole is written; a polygon that is not flat is cut as seen
    /// along its mean normal (Newell's).
    pub fn triangles(&mut self, corners: &[DVec3]) -> Result<Vec<[usize; 3]>, NotCut> {
        let normal = newell(corners);
        let Some(up) = normal.try_normalize().filter(|_| corners.len() > 3) else { return Ok(fan(corners.len())) };
        let (u, v) = up.any_orthonormal_pair();
        let flat: Vec<DVec2> =
            corners.iter().map(|c| *c - corners[0]).map(|c| DVec2::new(c.dot(u), c.dot(v))).collect();
        let whole = normal.length();
        if (2..flat.len()).all(|k| twice(flat[0], flat[k - 1], flat[k]) >= -FLAT * whole) {
            return Ok(fan(corners.len()));
        }
        self.looks_left = self.looks_left.saturating_add(LOOKS_A_CORNER * corners.len() as u64);
        let cut = self.ears(&flat, FLAT * whole)?;
        let sum: f64 = cut.iter().map(|triangle| twice_at(&flat, *triangle).abs()).sum();
        let is_whole = (sum - whole).abs() <= SAME_AREA * whole;
        if is_whole { Ok(cut) } else { Err(NotCut::Crossing) }
    }

    fn look(&mut self, corners: usize) -> Result<(), NotCut> {
        self.looks_left = self.looks_left.checked_sub(1 + corners as u64).ok_or(NotCut::TooLarge)?;
        Ok(())
    }

    /// Cuts ears off a polygon that turns to the left until nothing is left; `flat` is twice an area that is none.
    fn ears(&mut self, at: &[DVec2], flat: f64) -> Result<Vec<[usize; 3]>, NotCut> {
        let mut left: Vec<usize> = (0..at.len()).collect();
        let mut cut = Vec::with_capacity(at.len());
        // From where the last ear was: its neighbours are the likely next ones, and no fan of slivers results.
        let mut k = 0;
        while left.len() > 3 {
            let n = left.len();
            let turn = |k: usize| twice_at(at, around(&left, k));
            let reflex: Vec<usize> = (0..n).filter(|k| turn(*k) <= flat).map(|k| left[k]).collect();
            self.look(n)?;
            let mut found = None;
            for step in 0..n {
                let place = (k + step) % n;
                self.look(reflex.len())?;
                if turn(place) > flat && is_empty(around(&left, place), &reflex, at) {
                    found = Some((place, true));
                    break;
                }
            }
            // Where there is no ear, a corner in line with its neighbours, or one that goes there and back, holds no
            // area.
            let found = found.or_else(|| (0..n).find(|k| turn(*k).abs() <= flat).map(|k| (k, false)));
            let (place, is_ear) = found.ok_or(NotCut::Crossing)?;
            if is_ear {
                cut.push(around(&left, place));
            }
            left.remove(place);
            k = place;
        }
        if let [a, b, c] = left[..] {
            cut.push([a, b, c]);
        }
        Ok(cut)
    }
}

/// The triangles of a convex polygon of so many corners.
fn fan(corners: usize) -> Vec<[usize; 3]> {
    (2..corners).map(|k| [0, k - 1, k]).collect()
}

/// The corner at a place of a ring of corners, between its neighbours.
fn around(ring: &[usize], place: usize) -> [usize; 3] {
    let n = ring.len();
    [ring[(place + n - 1) % n], ring[place % n], ring[(place + 1) % n]]
}

/// Whether none of these corners lies in a triangle that turns to the left; a corner at the very place of one of its
/// own does not.
fn is_empty([a, b, c]: [usize; 3], corners: &[usize], at: &[DVec2]) -> bool {
    let triangle = [at[a], at[b], at[c]];
    let mut others = corners.iter().map(|p| at[*p]).filter(|p| !triangle.contains(p));
    !others.any(|p| (0..3).all(|k| twice(triangle[k], triangle[(k + 1) % 3], p) >= 0.0))
}

/// Twice the area of a triangle by the places of its corners.
fn twice_at(at: &[DVec2], [a, b, c]: [usize; 3]) -> f64 {
    twice(at[a], at[b], at[c])
}

/// Twice the area of a triangle, positive where it turns to the left.
fn twice(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    (b - a).perp_dot(c - a)
}

/// The area of a polygon, positive where it turns to the left.
pub fn area(polygon: &[DVec2]) -> f64 {
    0.5 * (2..polygon.len()).map(|k| twice(polygon[0], polygon[k - 1], polygon[k])).sum::<f64>()
}

/// The mean normal of a polygon, as long as twice its area (M. E. Newell).
pub fn newell(corners: &[DVec3]) -> DVec3 {
    let Some(first) = corners.first() else { return DVec3::ZERO };
    corners.windows(2).map(|pair| (pair[0] - first).cross(pair[1] - first)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn polygon(points: &[[f64; 2]]) -> Vec<DVec3> {
        // In a plane that is no plane of the axes.
        let (u, v) = (DVec3::new(0.6, 0.0, 0.8), DVec3::new(0.0, 1.0, 0.0));
        points.iter().map(|[x, y]| DVec3::new(3.0, -2.0, 1.0) + *x * u + *y * v).collect()
    }

    fn area(corners: &[DVec3], triangles: &[[usize; 3]]) -> (f64, bool) {
        let normal = newell(corners).normalize();
        let areas = triangles.iter().map(|t| {
            let [a, b, c] = t.map(|k| corners[k]);
            0.5 * (b - a).cross(c - a).dot(normal)
        });
        let areas: Vec<f64> = areas.collect();
        (areas.iter().sum(), areas.iter().all(|a| *a > 0.0))
    }

    #[test]
    fn concave_polygons_are_covered_once_and_turn_as_they_did() {
        let comb: Vec<[f64; 2]> = (0..40)
            .map(|k| [f64::from(k / 2), if k % 4 == 1 || k % 4 == 2 { 5.0 } else { 1.0 }])
            .chain([[19.5, 0.0], [0.0, 0.0]])
            .rev()
            .collect();
        let hole = [
            [0.0, 0.0],
            [4.0, 0.0],
            [4.0, 4.0],
            [0.0, 4.0],
            [0.0, 0.0],
            [1.0, 1.0],
            [1.0, 3.0],
            [3.0, 3.0],
            [3.0, 1.0],
            [1.0, 1.0],
        ];
        for (name, points, expected) in [
            ("square", &[[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]][..], 4.0),
            ("L", &[[0.0, 0.0], [4.0, 0.0], [4.0, 1.0], [1.0, 1.0], [1.0, 3.0], [0.0, 3.0]][..], 6.0),
            ("L from elsewhere", &[[4.0, 0.0], [4.0, 1.0], [1.0, 1.0], [1.0, 3.0], [0.0, 3.0], [0.0, 0.0]][..], 6.0),
            ("in line", &[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 2.0], [1.0, 0.5], [0.0, 2.0]][..], 2.5),
            ("hole", &hole[..], 12.0),
            ("comb", &comb[..], newell(&polygon(&comb)).length() / 2.0),
        ] {
            let mut turned = points.to_vec();
            for _ in 0..points.len() {
                turned.rotate_left(1);
                for flip in [false, true] {
                    let mut corners = polygon(&turned);
                    if flip {
                        corners.reverse();
                    }
                    let triangles = Triangulator::default().triangles(&corners).unwrap();
                    let (found, is_turned_alike) = area(&corners, &triangles);
                    assert!((found - expected).abs() < 1e-9 * expected, "{name}: {found} for {expected}");
                    assert!(is_turned_alike || name == "in line" || name == "comb", "{name} {triangles:?}");
                }
            }
        }
    }

    #[test]
    fn a_polygon_that_crosses_itself_or_is_too_large_is_an_error() {
        let eight = polygon(&[[0.0, 0.0], [2.0, 2.0], [2.0, 0.0], [0.0, 1.0]]);
        assert_eq!(Triangulator::default().triangles(&eight), Err(NotCut::Crossing));
        // A star with a corner inwards after each outwards has no ear but there.
        let star: Vec<[f64; 2]> = (0..60_000)
            .map(|k| {
                let (sin, cos) = (std::f64::consts::TAU * f64::from(k) / 60_000.0).sin_cos();
                let r = if k % 2 == 0 { 1.0 } else { 0.9 };
                [r * cos + 2.0 * f64::from(k / 30_000), r * sin]
            })
            .collect();
        assert_eq!(Triangulator::default().triangles(&polygon(&star)), Err(NotCut::TooLarge));
        assert_eq!(Triangulator::default().triangles(&polygon(&[[0.0, 0.0], [1.0, 0.0]])), Ok(vec![]));
    }
}
