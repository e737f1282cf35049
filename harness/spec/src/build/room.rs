//! The room: a box, upright walls over a polygon, or the faces of a mesh.

use std::collections::BTreeMap;
use std::path::Path;

use glam::{DVec2, DVec3};
use luxproof_scene::enclosure::{Enclosure, Face, NoRoom};
use luxproof_scene::geometry::{Mesh, Room};

use super::super::model::{Fraction, ReflectanceSpec, RoomSpec};
use super::Builder;
use crate::suggestion;

/// More corners of a floor than this are a slip of the pen: each wall is held against each other.
const MAX_CORNERS: usize = 1000;

impl Builder<'_> {
    /// `None` where its shape is not known: nothing lies in it or out of it.
    pub(super) fn room(&mut self, room: &RoomSpec) -> Option<Enclosure> {
        match (&room.size_m, &room.floor_m, &room.mesh) {
            (Some(size_m), None, None) => self.cuboid(*size_m, room),
            (None, Some(floor_m), None) => self.prism(floor_m, room),
            (None, None, Some(file)) => self.of_mesh(file, room),
            _ => {
                let help = "give exactly one of `size_m` (a box), `floor_m` with `height_m` (a polygon), and `mesh`";
                let given = room.size_m.is_some() || room.floor_m.is_some() || room.mesh.is_some();
                let message = if given { "a room has one shape" } else { "missing field `size_m`: it has no shape" };
                self.check(false, "room", message, help);
                None
            }
        }
    }

    fn cuboid(&mut self, size_m: [f64; 3], room: &RoomSpec) -> Option<Enclosure> {
        let mut is_sized = !self.mended.touches("room.size_m");
        for (k, size) in size_m.iter().enumerate() {
            let (at, message) = (format!("room.size_m[{k}]"), format!("{} is no extent", self.unit.length(*size)));
            let sound = size.is_finite() && *size > 0.0;
            is_sized &= self.check(sound, &at, message, "give a positive number of metres");
        }
        self.alone("height_m", room.height_m.is_some(), "a box has its height in `size_m`");
        self.alone("groups", room.groups.is_some(), "a box has `reflectance`");
        let reflectance = self.reflectance(room)?.build();
        let help = "give one number for all walls, or {x-: , x+: , y-: , y+: }";
        self.check(reflectance.is_some(), "room.reflectance.walls", "a box has no list of walls", help);
        is_sized.then_some(Enclosure::cuboid(Room { size_m: DVec3::from(size_m), reflectance: reflectance? }))
    }

    fn prism(&mut self, floor_m: &[[f64; 2]], room: &RoomSpec) -> Option<Enclosure> {
        self.alone("groups", room.groups.is_some(), "walls over a polygon have `reflectance`");
        let unit = self.unit;
        let height = room.height_m.filter(|h| h.is_finite() && *h > 0.0);
        let message = room
            .height_m
            .map_or_else(|| "missing field `height_m`".to_owned(), |h| format!("{} is no height", unit.length(h)));
        self.check(height.is_some(), "room.height_m", message, "give a positive number of metres");
        let help = format!("give 3 to {MAX_CORNERS} corners");
        let message = format!("{} corners", floor_m.len());
        let is_few = self.check(floor_m.len() <= MAX_CORNERS, "room.floor_m", message, help);
        let reflectance = self.reflectance(room)?;
        let walls = reflectance.of_walls(floor_m.len());
        let help = "give one number for all walls, or a list of as many as the floor has corners";
        self.check(walls.is_some(), "room.reflectance.walls", "walls over a polygon are not those of a box", help);
        let corners: Vec<DVec2> = floor_m.iter().map(|corner| DVec2::from(*corner)).collect();
        let (height, walls) = (height.filter(|_| is_few)?, walls?);
        let ends = [reflectance.floor.0, reflectance.ceiling.0];
        match Enclosure::prism(&corners, height, ends, &walls) {
            Ok(room) => self.bounded(room),
            Err(error @ NoRoom::Reflectances { .. }) => {
                self.check(false, "room.reflectance.walls", error.to_string(), "give one for each side of the floor");
                None
            }
            Err(error) => {
                let help =
                    "list the corners of a simple polygon in order, in metres from an origin below and left of it";
                self.check(false, "room.floor_m", error.to_string(), help);
                None
            }
        }
    }

    fn of_mesh(&mut self, file: &Path, room: &RoomSpec) -> Option<Enclosure> {
        self.alone("height_m", room.height_m.is_some(), "a mesh has its own");
        self.alone("reflectance", room.reflectance.is_some(), "a mesh has `groups`, each with its reflectance");
        let path = self.path_of(file);
        let bytes = self.take_in("room.mesh", &path)?;
        let groups = match Mesh::groups_of_obj(&mut bytes.as_slice(), &path) {
            Ok(groups) => groups,
            Err(error) => {
                let help = "give a Wavefront OBJ file whose faces close the room, in metres, z up";
                let message = self.source.trust.shown(&error.to_string());
                self.check(false, "room.mesh", message, help);
                return None;
            }
        };
        let named = room.groups.clone().unwrap_or_default();
        let faces = self.faces(&groups, &named)?;
        match Enclosure::of_faces(faces) {
            Ok(room) => self.bounded(room),
            Err(error) => {
                self.check(false, "room.mesh", error.to_string(), "move or repair the mesh");
                None
            }
        }
    }

    /// The faces of all groups, each of which needs a reflectance.
    fn faces(&mut self, groups: &[(String, Mesh)], named: &BTreeMap<String, Fraction>) -> Option<Vec<Face>> {
        let mut is_whole = true;
        for (name, _) in groups.iter().filter(|(name, _)| !named.contains_key(name)) {
            let message = format!("group `{name}` of the mesh has no reflectance");
            is_whole &= self.check(false, "room.groups", message, format!("add `{name}: ` and a number from 0 to 1"));
        }
        for name in named.keys().filter(|name| !groups.iter().any(|(group, _)| group == *name)) {
            let at = format!("room.groups.{name}");
            let help = suggestion(name, groups.iter().map(|(group, _)| group.as_str()));
            is_whole &= self.check(false, &at, format!("the mesh has no group `{name}`"), help);
        }
        let mut faces = vec![];
        for (name, mesh) in groups {
            let reflectance = named.get(name).map_or(0.0, |rho| rho.0);
            faces.extend(
                mesh.triangles
                    .iter()
                    .map(|triangle| Face { corners_m: triangle.map(|k| mesh.vertices_m[k as usize]), reflectance }),
            );
        }
        is_whole.then_some(faces)
    }

    /// Within what a spec that is not trusted may ask for.
    fn bounded(&mut self, room: Enclosure) -> Option<Enclosure> {
        self.take("room", "triangles", room.faces(), |left| &mut left.triangles).then_some(room)
    }

    fn reflectance<'a>(&mut self, room: &'a RoomSpec) -> Option<&'a ReflectanceSpec> {
        let help = "give `reflectance: {floor: , walls: , ceiling: }`";
        self.check(room.reflectance.is_some(), "room", "missing field `reflectance`", help);
        room.reflectance.as_ref()
    }

    fn alone(&mut self, key: &str, is_there: bool, help: &str) {
        self.check(!is_there, &format!("room.{key}"), format!("`{key}` does not go with this shape"), help);
    }
}
