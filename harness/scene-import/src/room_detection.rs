//! What a scene's room is: its outermost surfaces where they are a box or close otherwise, else a black box around it.

use std::collections::{BTreeMap, BTreeSet};

use glam::DVec3;
use luxproof_scene::geometry::{Mesh, Reflectances, Room, obj};

use super::closed::{Closed, closed};
use super::place::{Place, Space};
use super::shell::{Shell, on_walls, shell};
use super::summaries::{GroupSummary, MeshSummary, RoomKind, RoomSummary};
use super::triangle_soup::{Facet, Soup};

/// The black box stands so far off everything, as a part of the largest extent: farther than any renderer's rounding.
const MARGIN: f64 = 0.05;

/// A group's name is no longer.
const MAX_NAME: usize = 60;

/// A room as a spec has it.
#[derive(Debug)]
pub enum Walls {
    /// The scene's own surfaces, or black ones around it.
    Box(Room),
    Mesh(RoomMesh),
}

/// Triangles that close a room and look into it, the lowest corner of the box around them at the origin.
#[derive(Debug)]
pub struct RoomMesh {
    pub size_m: DVec3,
    pub vertices_m: Vec<DVec3>,
    /// One a material.
    pub groups: Vec<Group>,
}

#[derive(Debug)]
pub struct Group {
    /// No two are alike, and nothing in them means something to a file.
    pub name: String,
    pub reflectance: f64,
    pub triangles: Vec<[u32; 3]>,
}

impl Group {
    fn summarize(&self) -> GroupSummary {
        GroupSummary { name: self.name.clone(), reflectance: self.reflectance, triangles: self.triangles.len() }
    }
}

impl RoomMesh {
    /// The name of its file.
    pub const FILE: &str = "room.obj";

    /// Its file: a Wavefront OBJ that reads back as the same numbers.
    pub fn obj(&self) -> String {
        let groups = self.groups.iter().map(|group| (group.name.as_str(), group.triangles.as_slice()));
        obj::write_groups("luxproof import: metres, z up; faces look into the room", &self.vertices_m, groups)
    }
}

/// The triangles of one reflectance.
#[derive(Debug)]
pub struct Part {
    /// The name of its file.
    pub file: String,
    pub reflectance: f64,
    pub mesh: Mesh,
}

impl Part {
    pub(super) fn summarize(&self) -> MeshSummary {
        MeshSummary {
            file: self.file.clone(),
            reflectance: self.reflectance,
            triangles: self.mesh.triangles.len(),
            vertices: self.mesh.vertices_m.len(),
        }
    }

    /// Its file: a Wavefront OBJ that reads back as the same numbers.
    pub fn obj(&self) -> String {
        let about = format!("luxproof import: metres, z up; reflectance {}", self.reflectance);
        obj::write(&about, &self.mesh.vertices_m, &self.mesh.triangles)
    }
}

/// The room and what stands in it.
#[derive(Debug)]
pub(super) struct Around {
    pub(super) walls: Walls,
    pub(super) origin_m: DVec3,
    pub(super) meshes: Vec<Part>,
    pub(super) place: Place,
    pub(super) summary: RoomSummary,
    pub(super) notes: Vec<String>,
}

/// Of a soup between two corners, its materials by name.
pub(super) fn around<'a>(soup: &Soup, name: impl Fn(u32) -> &'a str, low: DVec3, high: DVec3) -> Around {
    let no_box = match shell(soup, low, high) {
        Ok(shell) => return cuboid(soup, &shell, low, high),
        Err(why) => why,
    };
    let found = closed(soup, low, high).and_then(|closed| {
        let place = inside(soup, &closed);
        Ok((place.ok_or("what closes holds no place for a luminaire and meters that would lie within it")?, closed))
    });
    match found {
        Ok((place, closed)) => mesh(soup, name, closed, place, no_box),
        Err(not_closed) => black(soup, low, high, no_box, not_closed),
    }
}

fn cuboid(soup: &Soup, shell: &Shell, low: DVec3, high: DVec3) -> Around {
    let rest: Vec<Facet> =
        soup.facets.iter().zip(&shell.is_part).filter(|(_, is_part)| !**is_part).map(|(facet, _)| *facet).collect();
    // This is what its farthest corner is at.
    let (size_m, origin_m) = (high - low, DVec3::ZERO - low);
    let space = space(soup, &rest, origin_m, [low, high], true);
    Around {
        walls: Walls::Box(Room { size_m, reflectance: shell.reflectances }),
        origin_m,
        meshes: parts(&soup.vertices, &rest),
        place: space.anywhere(size_m.z),
        summary: RoomSummary::of(RoomKind::Box, size_m),
        notes: on_walls(shell.loose).into_iter().collect(),
    }
}

fn black(soup: &Soup, low: DVec3, high: DVec3, no_box: String, not_closed: String) -> Around {
    let margin_m = margin(low, high);
    let off = DVec3::splat(margin_m);
    let (room_low, room_high) = ((low - off).map(short), (high + off).map(short));
    let (size_m, origin_m) = ((room_high - room_low).map(short), DVec3::ZERO - room_low);
    let space = space(soup, &soup.facets, origin_m, [low, high], false);
    Around {
        walls: Walls::Box(Room { size_m, reflectance: Reflectances::with_equal_walls(0.0, 0.0, 0.0) }),
        origin_m,
        meshes: parts(&soup.vertices, &soup.facets),
        place: space.anywhere(size_m.z),
        summary: RoomSummary {
            why: Some(no_box),
            why_not_closed: Some(not_closed),
            margin_m,
            ..RoomSummary::of(RoomKind::Black, size_m)
        },
        notes: vec![],
    }
}

/// In the room, its lowest corner at the origin.
fn space(soup: &Soup, facets: &[Facet], origin_m: DVec3, [low, high]: [DVec3; 2], is_room: bool) -> Space {
    let triangles = facets.iter().map(|facet| soup.corners(facet).map(|p| p + origin_m)).collect();
    Space { low_m: low + origin_m, high_m: high + origin_m, triangles, is_room }
}

fn inside(soup: &Soup, closed: &Closed) -> Option<Place> {
    let space = space(soup, &soup.facets, DVec3::ZERO - closed.low, [closed.low, closed.high], false);
    space.within(&closed.enclosure)
}

fn mesh<'a>(soup: &Soup, name: impl Fn(u32) -> &'a str, closed: Closed, place: Place, no_box: String) -> Around {
    let origin_m = DVec3::ZERO - closed.low;
    let mut by_material: BTreeMap<u32, Vec<Facet>> = BTreeMap::new();
    for (vertices, facet) in &closed.walls {
        let facet = Facet { vertices: *vertices, ..soup.facets[*facet as usize] };
        by_material.entry(facet.material).or_default().push(facet);
    }
    let mut vertices = Vertices::default();
    let mut known = BTreeSet::new();
    let groups = by_material.into_iter().map(|(material, facets): (u32, Vec<Facet>)| Group {
        name: unique(name(material), &mut known),
        reflectance: facets[0].reflectance,
        triangles: facets.iter().map(|facet| facet.vertices.map(|v| vertices.place(v, &closed.places))).collect(),
    });
    let groups: Vec<Group> = groups.collect();
    let vertices_m = vertices.all.into_iter().map(|p| p + origin_m).collect();
    let size_m = closed.high + origin_m;
    let summary = RoomSummary {
        file: Some(RoomMesh::FILE),
        groups: groups.iter().map(Group::summarize).collect(),
        why: Some(no_box),
        ..RoomSummary::of(RoomKind::Mesh, size_m)
    };
    Around {
        walls: Walls::Mesh(RoomMesh { size_m, vertices_m, groups }),
        origin_m,
        meshes: parts(&closed.places, &closed.rest),
        place,
        summary,
        notes: closed.notes,
    }
}

/// A name of letters, digits, `-` and `_` that is not known yet.
fn unique(name: &str, known: &mut BTreeSet<String>) -> String {
    let name: String =
        name.chars().take(MAX_NAME).map(|c| if c.is_alphanumeric() || c == '-' { c } else { '_' }).collect();
    let name = if name.is_empty() { "unnamed".to_owned() } else { name };
    let mut all = std::iter::once(name.clone()).chain((2..).map(|k: usize| format!("{name}-{k}")));
    let found = all.find(|name| !known.contains(name)).unwrap_or(name.clone());
    known.insert(found.clone());
    found
}

/// To a nanometre: the box stands wherever it likes.
fn short(length_m: f64) -> f64 {
    (length_m * 1e9).round() / 1e9
}

fn margin(low: DVec3, high: DVec3) -> f64 {
    let margin = MARGIN * (high - low).max_element();
    // Two digits: nobody reads more.
    let digits = 10_f64.powf(1.0 - margin.log10().floor());
    (margin * digits).round() / digits
}

/// Vertices in the order of their first use.
#[derive(Debug, Default)]
struct Vertices {
    places: BTreeMap<u32, u32>,
    all: Vec<DVec3>,
}

impl Vertices {
    /// The place of one of some vertices.
    fn place(&mut self, vertex: u32, of: &[DVec3]) -> u32 {
        *self.places.entry(vertex).or_insert_with(|| {
            self.all.push(of[vertex as usize]);
            self.all.len() as u32 - 1
        })
    }
}

/// A mesh a reflectance, the least first.
fn parts(vertices: &[DVec3], facets: &[Facet]) -> Vec<Part> {
    let mut meshes: BTreeMap<u64, (f64, Vec<[u32; 3]>)> = BTreeMap::new();
    for facet in facets {
        // Bits of numbers from 0 are in the order of the numbers.
        let of = meshes.entry(facet.reflectance.to_bits()).or_insert((facet.reflectance, vec![]));
        of.1.push(facet.vertices);
    }
    let parts = meshes.into_values().map(|(reflectance, triangles): (f64, Vec<[u32; 3]>)| {
        let mut used = Vertices::default();
        let triangles = triangles.into_iter().map(|t| t.map(|v| used.place(v, vertices))).collect();
        let mesh = Mesh { vertices_m: used.all, triangles };
        Part { file: format!("reflectance-{reflectance}.obj"), reflectance, mesh }
    });
    parts.collect()
}
