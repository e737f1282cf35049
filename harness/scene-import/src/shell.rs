//! Whether a scene's outermost surfaces are a box: then they are the room.

use std::collections::HashMap;

use glam::{DVec2, DVec3};
use luxproof_scene::geometry::Reflectances;

use super::triangle_soup::{Facet, Soup};

/// A face of more triangles is not looked at: each is held against each.
const MAX_TILES: usize = 2000;

/// How far a corner may be off a plane, and an area off another, relative to the extent.
const OFF: f64 = 1e-6;

const NAMES: [[&str; 2]; 3] = [["wall at x-", "wall at x+"], ["wall at y-", "wall at y+"], ["floor", "ceiling"]];

/// A box of surfaces.
#[derive(Debug)]
pub(super) struct Shell {
    pub(super) reflectances: Reflectances,
    /// Of each triangle whether it is part of the box.
    pub(super) is_part: Vec<bool>,
    /// Triangles in the plane of a face that belong to no body which stands on it.
    pub(super) loose: usize,
}

/// The box, or why there is none.
pub(super) fn shell(soup: &Soup, low: DVec3, high: DVec3) -> Result<Shell, String> {
    let size = high - low;
    let off = OFF * size.max_element();
    if size.min_element() <= off {
        return Err("all surfaces lie in one plane".to_owned());
    }
    let mut is_part = vec![false; soup.facets.len()];
    let mut beside = vec![];
    let mut rho = [[0.0; 2]; 3];
    for axis in 0..3 {
        for side in 0..2 {
            let name = NAMES[axis][side];
            let face = Face { axis, is_high: side == 1, low, high, off };
            let tiles = face.tiles(soup);
            let found = [true, false].iter().find_map(|by_side| face.tiling(&tiles, *by_side));
            let chosen = found.ok_or_else(|| face.gap(&tiles, name))?;
            let reflectances = chosen.iter().map(|k| soup.facets[*k].reflectance);
            let (least, most) = reflectances.fold((1.0_f64, 0.0_f64), |(a, b), r| (a.min(r), b.max(r)));
            if least < most {
                return Err(format!("the {name} has several reflectances, from {least} to {most}"));
            }
            rho[axis][side] = least;
            for k in &chosen {
                is_part[*k] = true;
            }
            beside.extend(tiles.iter().map(|tile| tile.facet));
        }
    }
    beside.retain(|k| !is_part[*k]);
    let loose = loose(soup, &is_part, &beside).len();
    let [[wall_x_min, wall_x_max], [wall_y_min, wall_y_max], [floor, ceiling]] = rho;
    let reflectances = Reflectances { floor, ceiling, wall_x_min, wall_x_max, wall_y_min, wall_y_max };
    Ok(Shell { reflectances, is_part, loose })
}

/// A face of the box.
struct Face {
    axis: usize,
    is_high: bool,
    low: DVec3,
    high: DVec3,
    off: f64,
}

/// A triangle in the plane of a face.
struct Tile {
    facet: usize,
    /// Turning to the left.
    corners: [DVec2; 3],
    area: f64,
    looks_inwards: bool,
}

impl Face {
    fn flat(&self, p: DVec3) -> DVec2 {
        DVec2::new(p[(self.axis + 1) % 3], p[(self.axis + 2) % 3])
    }

    fn area(&self) -> f64 {
        let size = self.flat(self.high - self.low);
        size.x * size.y
    }

    fn tiles(&self, soup: &Soup) -> Vec<Tile> {
        let plane = if self.is_high { self.high } else { self.low }[self.axis];
        let corners = soup.facets.iter().enumerate().map(|(facet, of)| (facet, soup.corners(of)));
        let in_plane = corners.filter(|(_, corners)| corners.iter().all(|c| (c[self.axis] - plane).abs() <= self.off));
        in_plane.map(|(facet, corners)| self.tile(facet, corners)).collect()
    }

    /// A triangle as it lies in the face, turning to the left.
    fn tile(&self, facet: usize, corners: [DVec3; 3]) -> Tile {
        let [a, b, c] = corners.map(|c| self.flat(c));
        let twice = (b - a).perp_dot(c - a);
        let corners = if twice < 0.0 { [a, c, b] } else { [a, b, c] };
        Tile { facet, corners, area: 0.5 * twice.abs(), looks_inwards: (twice > 0.0) != self.is_high }
    }

    /// Triangles that cover the face once, the largest taken first, and before them those that look inwards if sides
    /// are to count; `None`
    /// where they do not. The bottoms of what stands on a floor lie in its plane, and are left.
    fn tiling(&self, tiles: &[Tile], by_side: bool) -> Option<Vec<usize>> {
        if tiles.len() > MAX_TILES {
            return None;
        }
        let mut order: Vec<&Tile> = tiles.iter().collect();
        order.sort_by(|a, b| {
            let sides = b.looks_inwards.cmp(&a.looks_inwards);
            let areas = b.area.total_cmp(&a.area);
            if by_side { sides.then(areas) } else { areas }
        });
        let mut chosen: Vec<&Tile> = vec![];
        for tile in order {
            if chosen.iter().all(|other| !overlap(&tile.corners, &other.corners, self.off)) {
                chosen.push(tile);
            }
        }
        let covered: f64 = chosen.iter().map(|tile| tile.area).sum();
        let is_whole = (covered - self.area()).abs() <= 4.0 * OFF * self.area();
        is_whole.then(|| chosen.iter().map(|tile| tile.facet).collect())
    }

    fn gap(&self, tiles: &[Tile], name: &str) -> String {
        if tiles.len() > MAX_TILES {
            return format!("the {name} has more than {MAX_TILES} triangles");
        }
        // An empty sum of floats is -0.
        let percent = 100.0 * tiles.iter().fold(0.0, |sum, tile| sum + tile.area) / self.area();
        format!("the {name} is not covered once: what lies in its plane has {percent:.1} % of its area")
    }
}

/// Whether two triangles have more than an edge in common, by the theorem of separating axes.
pub(super) fn overlap(a: &[DVec2; 3], b: &[DVec2; 3], off: f64) -> bool {
    !an_edge_separates(a, b, off) && !an_edge_separates(b, a, off)
}

/// Whether another triangle lies outside an edge of a triangle.
fn an_edge_separates(of: &[DVec2; 3], other: &[DVec2; 3], off: f64) -> bool {
    (0..3).any(|k| {
        let edge = (of[(k + 1) % 3] - of[k]).normalize_or_zero();
        other.iter().all(|p| edge.perp_dot(*p - of[k]) <= off)
    })
}

/// The note about sheets that lie on the room's surfaces.
pub(super) fn on_walls(triangles: usize) -> Option<String> {
    let summary = format!(
        "{triangles} triangles lie free in the plane of a surface of the room: renderers differ in which of both they see; lift them"
    );
    (triangles > 0).then_some(summary)
}

/// Which of some triangles have an edge that no other triangle has, the room left out.
pub(super) fn loose(soup: &Soup, is_part: &[bool], among: &[usize]) -> Vec<usize> {
    if among.is_empty() {
        return vec![];
    }
    let mut count: HashMap<(u32, u32), usize> = HashMap::new();
    for (facet, _) in soup.facets.iter().zip(is_part).filter(|(_, is_part)| !**is_part) {
        for edge in edges(facet) {
            *count.entry(edge).or_default() += 1;
        }
    }
    let facets = among.iter().copied();
    facets.filter(|k| edges(&soup.facets[*k]).iter().any(|edge| count.get(edge) == Some(&1))).collect()
}

/// The edges of a triangle, each with its lower corner first.
fn edges(facet: &Facet) -> [(u32, u32); 3] {
    let [a, b, c] = facet.vertices;
    [(a, b), (b, c), (c, a)].map(|(a, b)| (a.min(b), a.max(b)))
}
