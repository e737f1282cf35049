//! Triangles with common vertices: metres, z up, no two vertices in one place, no triangle of no area or twice.

use std::collections::HashMap;

use glam::DVec3;

/// A triangle by its vertices.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Facet {
    pub(super) vertices: [u32; 3],
    /// An index into the materials that were taken.
    pub(super) material: u32,
    pub(super) reflectance: f64,
}

#[derive(Clone, Debug, Default)]
pub(super) struct Soup {
    pub(super) vertices: Vec<DVec3>,
    pub(super) facets: Vec<Facet>,
    /// What coordinates are rounded to, in metres.
    pub(super) step_m: f64,
    /// Triangles of no area.
    pub(super) flat: usize,
    /// Triangles of the same corners and reflectance as another.
    pub(super) twice: usize,
    /// Triangles of the same corners as another, and another reflectance.
    pub(super) contrary: usize,
}

/// A triangle as it comes: corners, material, reflectance.
pub(super) type Corners = ([DVec3; 3], u32, f64);

impl Soup {
    /// Of triangles whose coordinates are known to a part of the extent.
    pub(super) fn of(triangles: &[Corners], precision: f64) -> Self {
        let (low, high) = extent(triangles.iter().flat_map(|(corners, ..)| corners));
        let grid = grid((high - low).max_element().max(low.abs().max(high.abs()).max_element()), precision);
        let mut soup = Self { step_m: 1.0 / grid, ..Self::default() };
        let mut places = HashMap::new();
        let mut known: HashMap<[u32; 3], f64> = HashMap::new();
        for (corners, material, reflectance) in triangles {
            let vertices = corners.map(|corner| {
                let at = rounded(corner, grid);
                *places.entry(at.to_array().map(f64::to_bits)).or_insert_with(|| {
                    soup.vertices.push(at);
                    soup.vertices.len() as u32 - 1
                })
            });
            let facet = Facet { vertices, material: *material, reflectance: *reflectance };
            if soup.area(&facet) == 0.0 {
                soup.flat += 1;
                continue;
            }
            let mut key = vertices;
            key.sort_unstable();
            match known.insert(key, *reflectance) {
                Some(other) if other == *reflectance => soup.twice += 1,
                Some(_) => {
                    soup.contrary += 1;
                    soup.facets.push(facet);
                }
                None => soup.facets.push(facet),
            }
        }
        soup
    }

    pub(super) fn corners(&self, facet: &Facet) -> [DVec3; 3] {
        facet.vertices.map(|v| self.vertices[v as usize])
    }

    /// In square metres, of one side.
    pub(super) fn area(&self, facet: &Facet) -> f64 {
        let [a, b, c] = self.corners(facet);
        0.5 * (b - a).cross(c - a).length()
    }

    /// The least box around the triangles.
    pub(super) fn extent(&self) -> (DVec3, DVec3) {
        let used = self.facets.iter().flat_map(|facet| facet.vertices).map(|v| &self.vertices[v as usize]);
        extent(used)
    }
}

fn extent<'a>(points: impl Iterator<Item = &'a DVec3>) -> (DVec3, DVec3) {
    points.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(*p), high.max(*p)))
}

/// How many steps a metre has, a power of ten, that are as fine as what is known.
fn grid(extent: f64, precision: f64) -> f64 {
    let digits = -(extent * precision).log10();
    if digits.is_finite() { 10_f64.powi(digits.floor().clamp(-300.0, 300.0) as i32) } else { 1.0 }
}

/// To the nearest step: what is meant as .1 is .1 again, and corners that are meant to be one are one.
fn rounded(point: DVec3, grid: f64) -> DVec3 {
    // Adding 0 makes -0 a 0.
    point.to_array().map(|c| (c * grid).round() / grid + 0.0).into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_of_short_floats_goes_and_corners_are_one() {
        let noisy = |x: f64| f64::from(x as f32);
        let t = |a: [f64; 3], b: [f64; 3], c: [f64; 3], rho| ([a, b, c].map(|p| DVec3::from(p.map(noisy))), 0, rho);
        let soup = Soup::of(
            &[
                t([0.1, 0.2, 0.0], [5.3, 0.2, 0.0], [5.3, 3.3, 0.0], 0.5),
                t([0.1, 0.2, -0.0], [5.3, 3.3, 0.0], [0.1, 3.3, 1e-9], 0.5),
                t([5.3, 0.2, 0.0], [0.1, 0.2, 0.0], [5.3, 3.3, 0.0], 0.5),
                t([5.3, 0.2, 0.0], [0.1, 0.2, 0.0], [5.3, 3.3, 0.0], 0.4),
                t([0.1, 0.2, 0.0], [0.2, 0.2, 0.0], [0.3, 0.2, 0.0], 0.5),
            ],
            1e-6,
        );
        assert_eq!((soup.facets.len(), soup.flat, soup.twice, soup.contrary), (3, 1, 1, 1));
        assert_eq!(
            soup.vertices[..4],
            [[0.1, 0.2, 0.0], [5.3, 0.2, 0.0], [5.3, 3.3, 0.0], [0.1, 3.3, 0.0]].map(DVec3::from)
        );
    }
}
