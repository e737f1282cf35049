//! Whether surfaces of a scene close around all else, whatever their shape: then they are the room.

use std::collections::HashMap;

use glam::{DVec2, DVec3};
use luxproof_scene::enclosure::{Enclosure, Face};

use super::half_edges::{Net, Sets, Side};
use super::hull::{Hull, Walk};
use super::shell::{loose, on_walls, overlap};
use super::triangle_soup::{Facet, Soup};

/// A room of more triangles is not taken: each is looked at for each place in it.
const MAX_FACES: usize = 200_000;

/// As many pairs of a piece in the room and a triangle of its walls are looked at.
const MAX_LOOKS: usize = 4_000_000;

/// In so many planes of walls sheets are looked for.
const MAX_PLANES: usize = 200;

/// A closed surface with the rest of the scene in it.
#[derive(Debug)]
pub(super) struct Closed {
    /// In metres, in the scene; those of the rest are in the box around the surface.
    pub(super) places: Vec<DVec3>,
    /// Triangles whose front is the inside, by places, with the soup's triangles that they are of.
    pub(super) walls: Vec<([u32; 3], u32)>,
    /// What is in it, by places.
    pub(super) rest: Vec<Facet>,
    /// The box around it.
    pub(super) low: DVec3,
    pub(super) high: DVec3,
    /// In its own place, the lowest corner at the origin.
    pub(super) enclosure: Enclosure,
    pub(super) notes: Vec<String>,
}

/// The closed surface around all of a soup, or why there is none.
pub(super) fn closed(soup: &Soup, low: DVec3, high: DVec3) -> Result<Closed, String> {
    let net = Net::of(soup, (high - low).max_element())?;
    around(soup, &net, low, high).map_err(|why| openings(&net).unwrap_or(why))
}

fn around(soup: &Soup, net: &Net, low: DVec3, high: DVec3) -> Result<Closed, String> {
    let walk = Hull::peeled(net).walk()?.ok_or("no triangles are joined at all their edges")?;
    check(net, &walk)?;
    let (own_low, own_high) = bounds(net, &walk);
    if (own_low - low).max((high - own_high).abs()).max_element() > net.near_m {
        return Err(format!("what closes reaches from {own_low} to {own_high} m only"));
    }
    if walk.shell.len() > MAX_FACES {
        return Err(format!("what closes has {} triangles, and a room has {MAX_FACES} at most", walk.shell.len()));
    }
    let walls: Vec<([u32; 3], u32)> = walk.shell.iter().map(|(piece, turned)| inwards(net, *piece, *turned)).collect();
    let (rest, lost) = rest(soup, net, &walk);
    // Rounding may place a corner that touches a wall beyond it.
    let places: Vec<DVec3> = net.places.iter().map(|p| p.clamp(own_low, own_high)).collect();
    let faces = walls.iter().map(|(corners, facet)| Face {
        corners_m: corners.map(|c| places[c as usize] - own_low),
        reflectance: soup.facets[*facet as usize].reflectance,
    });
    let enclosure = Enclosure::of_faces(faces.collect()).map_err(|why| why.to_string())?;
    let mut notes = vec![];
    let bodies = bodies(&rest, &walls, &places);
    let stride = (bodies.len() * walls.len()).div_ceil(MAX_LOOKS).max(1);
    if let Some(beyond) = bodies.iter().step_by(stride).find(|at| !enclosure.reaches(**at - own_low)) {
        return Err(format!("what closes leaves surfaces out of it, the first at {beyond} m"));
    }
    if stride > 1 {
        notes.push(format!("of {} bodies one in {stride} was looked at, and is within the room", bodies.len()));
    }
    if lost > 0 {
        notes.push(format!("{lost} triangles less than {} m wide are left out", net.near_m));
    }
    notes.extend(on_walls(sheets(soup, net, &walk)));
    Ok(Closed { places, walls, rest, low: own_low, high: own_high, enclosure, notes })
}

/// The lowest and the highest corner of the box around a shell.
fn bounds(net: &Net, walk: &Walk) -> (DVec3, DVec3) {
    let corners = walk.shell.iter().flat_map(|(piece, _)| net.corners(*piece));
    corners.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)))
}

/// Where surfaces that are seen from outside end.
fn openings(net: &Net) -> Option<String> {
    let walk = Hull::whole(net).walk().ok()??;
    let [a, b] = net.ends(*walk.open.first()?);
    Some(format!("open edges: {}, the first from {a} to {b} m", walk.open.len()))
}

/// Each edge is gone along as often one way as the other, and the outside is at one side of each triangle.
fn check(net: &Net, walk: &Walk) -> Result<(), String> {
    if let Some(piece) = walk.single {
        let [a, b, c] = net.corners(piece);
        return Err(format!("the outside is at both sides of the triangle {a}, {b}, {c} m"));
    }
    let mut sums = vec![0_i32; net.edges.len()];
    for (piece, turned) in &walk.shell {
        for k in 0..3 {
            let [a, b] = net.pieces[*piece as usize].ends(k);
            sums[net.edges.edge_of(Side::new(*piece as usize, k))] += if (a < b) == *turned { 1 } else { -1 };
        }
    }
    let wrong = sums.iter().position(|sum| *sum != 0);
    wrong.map_or(Ok(()), |edge| {
        let [a, b] = net.ends(net.edges.sides(edge)[0]);
        Err(format!("triangles lie in one another at the edge from {a} to {b} m"))
    })
}

fn inwards(net: &Net, piece: u32, turned: bool) -> ([u32; 3], u32) {
    let of = net.pieces[piece as usize];
    let [a, b, c] = of.corners;
    (if turned { [a, b, c] } else { [a, c, b] }, of.facet)
}

/// What the walls are not: whole triangles, or parts of those that are walls in part; and how many have no area left.
fn rest(soup: &Soup, net: &Net, walk: &Walk) -> (Vec<Facet>, usize) {
    let mut is_wall = vec![false; net.pieces.len()];
    let mut is_part = vec![false; soup.facets.len()];
    for (piece, _) in &walk.shell {
        is_wall[*piece as usize] = true;
        is_part[net.pieces[*piece as usize].facet as usize] = true;
    }
    let whole = soup.facets.iter().zip(&is_part).filter(|(_, is_part)| !**is_part);
    let whole = whole.map(|(facet, _)| Facet { vertices: facet.vertices.map(|v| net.corner_of[v as usize]), ..*facet });
    let parts = net.pieces.iter().zip(&is_wall).filter(|(piece, is_wall)| !**is_wall && is_part[piece.facet as usize]);
    let parts = parts.map(|(piece, _)| Facet { vertices: piece.corners, ..soup.facets[piece.facet as usize] });
    let all: Vec<Facet> = whole.chain(parts).collect();
    let count = all.len();
    let with_area: Vec<Facet> = all.into_iter().filter(|facet| has_area(net, facet)).collect();
    let lost = count - with_area.len();
    (with_area, lost)
}

/// Whether a triangle has an area after its corners were joined.
fn has_area(net: &Net, facet: &Facet) -> bool {
    let [a, b, c] = facet.vertices.map(|c| net.places[c as usize]);
    (b - a).cross(c - a) != DVec3::ZERO
}

/// The corners of a triangle that belong to no wall.
fn free_corners(facet: &Facet, is_of_wall: &[bool]) -> impl Iterator<Item = usize> {
    facet.vertices.map(|c| c as usize).into_iter().filter(|c| !is_of_wall[*c])
}

/// A point of each body, the middle of one of its triangles that is well off the box around the walls. What is joined
/// by corners of the walls alone is several.
fn bodies(rest: &[Facet], walls: &[([u32; 3], u32)], places: &[DVec3]) -> Vec<DVec3> {
    let mut is_of_wall = vec![false; places.len()];
    let mut box_m = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for corner in walls.iter().flat_map(|(corners, _)| corners).map(|c| *c as usize) {
        is_of_wall[corner] = true;
        box_m = (box_m.0.min(places[corner]), box_m.1.max(places[corner]));
    }
    let mut sets = Sets::new(places.len());
    for facet in rest {
        if let Some(first) = free_corners(facet, &is_of_wall).next() {
            free_corners(facet, &is_of_wall).for_each(|corner| sets.join(first, corner));
        }
    }
    let mut known: HashMap<usize, usize> = HashMap::new();
    let mut bodies: Vec<(f64, DVec3)> = vec![];
    for facet in rest {
        let at = facet.vertices.iter().map(|c| places[*c as usize]).sum::<DVec3>() / 3.0;
        let off = (at - box_m.0).min(box_m.1 - at).min_element();
        let set = free_corners(facet, &is_of_wall).next().map(|corner| sets.of(corner));
        let place = set.map_or(bodies.len(), |set| *known.entry(set).or_insert(bodies.len()));
        match bodies.get_mut(place) {
            Some(body) if body.0 >= off => {}
            Some(body) => *body = (off, at),
            None => bodies.push((off, at)),
        }
    }
    bodies.into_iter().map(|(_, at)| at).collect()
}

/// How many triangles lie on walls and belong to no body that stands there.
fn sheets(soup: &Soup, net: &Net, walk: &Walk) -> usize {
    let mut is_part = vec![false; soup.facets.len()];
    // Unit normal, distance from the scene's origin, and the pieces in it.
    let mut planes: Vec<(DVec3, f64, Vec<u32>)> = vec![];
    for (piece, _) in &walk.shell {
        is_part[net.pieces[*piece as usize].facet as usize] = true;
        let corners = net.corners(*piece);
        let known = planes.iter().position(|(normal, at, _)| {
            // All three corners lie in the plane.
            corners.iter().all(|p| (p.dot(*normal) - at).abs() <= net.near_m)
        });
        if let Some(known) = known {
            planes[known].2.push(*piece);
        } else if planes.len() < MAX_PLANES {
            let normal = net.normal(*piece).normalize_or_zero();
            planes.push((normal, normal.dot(corners[0]), vec![*piece]));
        }
    }
    let others: Vec<usize> = (0..is_part.len()).filter(|k| !is_part[*k]).collect();
    let mut looks = 0;
    let loose = loose(soup, &is_part, &others);
    let on_walls = loose.iter().filter(|facet| {
        let corners = soup.corners(&soup.facets[**facet]);
        planes.iter().any(|(normal, at, pieces)| {
            looks += 1;
            if looks > MAX_LOOKS || corners.iter().any(|p| (p.dot(*normal) - at).abs() > net.near_m) {
                return false;
            }
            let flat = flat_along(*normal);
            looks += pieces.len();
            pieces.iter().any(|piece| overlap(&flat(corners), &flat(net.corners(*piece)), net.near_m))
        })
    });
    on_walls.count()
}

/// Triangles as they are seen along the axis that a normal is nearest to, turning to the left.
fn flat_along(normal: DVec3) -> impl Fn([DVec3; 3]) -> [DVec2; 3] {
    let away = normal.abs();
    let axis = (0..3).max_by(|a, b| away[*a].total_cmp(&away[*b])).unwrap_or(2);
    move |corners| {
        let [a, b, c] = corners.map(|p| DVec2::new(p[(axis + 1) % 3], p[(axis + 2) % 3]));
        if (b - a).perp_dot(c - a) < 0.0 { [a, c, b] } else { [a, b, c] }
    }
}
