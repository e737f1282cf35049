//! What stands and hangs in the room: obstacles, luminaires, and the openings that are flush with a surface.

use luxproof_scene::contact::Placed;
use luxproof_scene::contact::Surfaces;
use std::collections::{BTreeMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::DVec3;
use luxproof_model::LuminaireModelChoice;
use luxproof_photometry::Photometry;
use luxproof_scene::enclosure::Enclosure;
use luxproof_scene::geometry::{Mesh, Room};
use luxproof_scene::{Luminaire, LuminaireModel, Meter, Obstacle, Scene, Shape, flush, orientation};

use super::super::model::{LuminaireSpec, ObstacleSpec};
use super::super::mounting::unmountable;
use super::extents::Surroundings;
use super::{Builder, beyond_walls, within};
use crate::SpecError;

/// No luminaire is so bright: the sun itself has some 3e27 cd. What is made of it stays a number below this.
const BRIGHTEST_CD: f64 = 1e30;

const TRIANGLES_OF_A_BOX: usize = 12;

/// More luminaires than this in an array are a slip of the pen.
const MAX_LUMINAIRES: usize = 100_000;

/// The luminaires of one entry of the spec's list.
pub(super) struct HungEntry {
    /// Its place in the list.
    k: usize,
    pub(super) luminaires: Vec<Luminaire>,
}

/// The key that puts a luminaire where it is, and the beginning of a message on it.
fn place_of(k: usize, spec: &LuminaireSpec, id: &str) -> (String, String) {
    match spec.array {
        Some(_) => (format!("luminaires[{k}].array"), format!("`{id}`: ")),
        None => (format!("luminaires[{k}].at_m"), String::new()),
    }
}

/// Whether this step separates the luminaires of a row.
fn separates(count: usize, step_m: f64) -> bool {
    step_m.is_finite() && (count < 2 || step_m != 0.0)
}

impl Builder<'_> {
    pub(super) fn obstacles(&mut self, specs: &[ObstacleSpec], room: Option<&Room>) -> Vec<Obstacle> {
        specs.iter().enumerate().filter_map(|(k, spec)| self.obstacle(&format!("obstacles[{k}]"), spec, room)).collect()
    }

    fn obstacle(&mut self, at: &str, spec: &ObstacleSpec, room: Option<&Room>) -> Option<Obstacle> {
        let obstacle = match (&spec.cuboid, &spec.mesh) {
            (Some(cuboid), None) => {
                let (min_m, max_m) = (DVec3::from(cuboid.min_m), DVec3::from(cuboid.max_m));
                if !self.take(at, "triangles", TRIANGLES_OF_A_BOX, |left| &mut left.triangles) {
                    return None;
                }
                let sound = min_m.is_finite() && max_m.is_finite() && min_m.cmplt(max_m).all();
                let message =
                    format!("the box from {} to {} has no volume", self.unit.point(min_m), self.unit.point(max_m));
                if !self.check(sound, at, message, "give min_m below max_m on every axis") {
                    return None;
                }
                Obstacle { shape: Shape::Box { min_m, max_m }, reflectance: cuboid.reflectance.0 }
            }
            (None, Some(mesh)) => {
                let place = format!("{at}.mesh.file");
                if self.mended.touches(&place) {
                    return None;
                }
                let path = self.path_of(&mesh.file);
                let bytes = self.take_in(&place, &path)?;
                let read = match Mesh::parse_obj(&mut bytes.as_slice(), &path) {
                    Ok(read) => read,
                    Err(error) => {
                        let help = "give a Wavefront OBJ file of triangles or polygons, in metres, z up";
                        let message = self.source.trust.shown(&error.to_string());
                        self.check(false, &place, message, help);
                        return None;
                    }
                };
                if !self.take(at, "triangles", read.triangles.len(), |left| &mut left.triangles) {
                    return None;
                }
                let Mesh { vertices_m, triangles } = read.moved(DVec3::from(mesh.at_m));
                Obstacle { shape: Shape::Mesh { vertices_m, triangles }, reflectance: mesh.reflectance.0 }
            }
            _ => {
                let message = "an obstacle is either a box or a mesh";
                self.check(false, at, message, "give exactly one of `box` and `mesh`");
                return None;
            }
        };
        if let Some(room) = room {
            let (low, high) = extent(&obstacle.shape);
            let outside = low.min_element() < 0.0 || high.cmpgt(room.size_m).any();
            let message =
                format!("it reaches from {} to {}, outside the room", self.unit.point(low), self.unit.point(high));
            let of_mesh = if matches!(obstacle.shape, Shape::Mesh { .. }) {
                "; a mesh is in metres, whatever `unit` the spec has"
            } else {
                ""
            };
            let help = format!("{}{of_mesh}", within(room, self.unit));
            self.check(!outside, at, message, help);
        }
        Some(obstacle)
    }

    /// The luminaires of each entry of the spec in their places, before their models are chosen.
    pub(super) fn luminaires(&mut self, specs: &[LuminaireSpec], enclosure: Option<&Enclosure>) -> Vec<HungEntry> {
        self.check(!specs.is_empty(), "luminaires", "there are none", "give at least one luminaire");
        let mut ids = HashSet::new();
        let mut files: BTreeMap<PathBuf, Option<Arc<Photometry>>> = BTreeMap::new();
        let mut entries = vec![];
        for (k, spec) in specs.iter().enumerate() {
            let mut entry = HungEntry { k, luminaires: vec![] };
            let at = format!("luminaires[{k}].id");
            self.name(&at, &spec.id);
            if !self.is_placed(k, spec) {
                continue;
            }
            for (id, at_m) in spec.each() {
                let message = format!("`{id}` is no unique name");
                if !self.check(ids.insert(id.clone()), &at, message, "give every luminaire an id of its own") {
                    break;
                }
                let spec = LuminaireSpec { id, ..spec.clone() };
                let hung = self.luminaire(k, &spec, at_m, enclosure, &mut files);
                // Of an array the others would say the same.
                let Some(luminaire) = hung else { break };
                entry.luminaires.push(luminaire);
            }
            entries.push(entry);
        }
        entries
    }

    /// Chooses the models of luminaires and puts them onto the surfaces that they lie on; completes the scene with them and with
    /// what they cover. Returns the choices, and the entries that set the reflectance of a face that they do not have.
    pub(super) fn place(
        &mut self,
        specs: &[LuminaireSpec],
        hung: Vec<HungEntry>,
        scene: &mut Scene,
        listed_obstacles: usize,
        meters: &BTreeMap<String, Vec<Meter>>,
    ) -> (Vec<LuminaireModelChoice>, Vec<usize>) {
        let surroundings = Surroundings { scene, listed_obstacles, meters };
        let surfaces = Surfaces::new(scene.room, &scene.obstacles);
        let (mut choices, mut placed, mut idle_faces) = (vec![], vec![], vec![]);
        for HungEntry { k, mut luminaires } in hung {
            let spec = &specs[k];
            choices.push(surroundings.choose_model(&spec.id, spec.model, &mut luminaires));
            let (placed_before, mut has_face) = (placed.len(), false);
            for luminaire in luminaires {
                let mut found = surfaces.place(&luminaire);
                for plate in &mut found.plates {
                    plate.reflectance = spec.face_reflectance.0;
                }
                if let Some((message, help)) = scene.room.as_ref().and_then(|room| unmountable(&found, room, self.unit))
                {
                    let (place, which) = place_of(k, spec, &luminaire.id);
                    self.check(false, &place, which + &message, help);
                    // Of an array the others would say the same.
                    break;
                }
                has_face |= !found.plates.is_empty();
                placed.push((k, found));
            }
            if spec.face_reflectance.0 > 0.0 && !has_face && placed.len() > placed_before {
                idle_faces.push(k);
            }
        }
        let plates = self.plates(&placed);
        scene.obstacles.splice(listed_obstacles..listed_obstacles, plates);
        scene.luminaires = placed.into_iter().map(|(_, placed)| placed.luminaire).collect();
        (choices, idle_faces)
    }

    /// Whether its place is reported, and if it is many, that they lie apart.
    fn is_placed(&mut self, k: usize, spec: &LuminaireSpec) -> bool {
        let at = format!("luminaires[{k}]");
        let Some(array) = spec.array else {
            let help = "give `at_m`, or an `array` of many";
            return self.check(spec.at_m.is_some(), &at, "missing field `at_m`: it is nowhere", help);
        };
        let message = "it is in one place and an array at once";
        self.check(spec.at_m.is_none(), &at, message, "give exactly one of `at_m` and `array`");
        let count = (1..=MAX_LUMINAIRES).contains(&spec.count());
        let help = format!("give counts whose product lies between 1 and {MAX_LUMINAIRES}");
        let [nx, ny] = array.counts;
        let is_few = self.check(count, &format!("{at}.array.counts"), format!("{nx} x {ny} luminaires"), help);
        let [dx, dy] = array.step_m;
        let help = "give the steps from one to the next along x and y, in metres";
        let is_apart = self.check(
            separates(nx, dx) && separates(ny, dy),
            &format!("{at}.array.step_m"),
            "no step: luminaires of the array lie in one place",
            help,
        );
        is_few && is_apart && spec.at_m.is_none()
    }

    fn luminaire(
        &mut self,
        k: usize,
        spec: &LuminaireSpec,
        at_m: [f64; 3],
        enclosure: Option<&Enclosure>,
        files: &mut BTreeMap<PathBuf, Option<Arc<Photometry>>>,
    ) -> Option<Luminaire> {
        let at = |field: &str| format!("luminaires[{k}].{field}");
        let (place, which) = place_of(k, spec, &spec.id);
        let (mut position_m, mut is_within) = (DVec3::from(at_m), false);
        if let Some(enclosure) = enclosure {
            let room = &enclosure.room;
            // What is nearly in the plane of a surface lies on it.
            position_m = flush::snapped(room, position_m);
            let is_in_box = position_m.is_finite() && room.contains(position_m, 0.0);
            let message = format!("{which}{} lies outside the room", self.unit.point(position_m));
            let beyond = format!("{message}'s walls");
            is_within = self.check(is_in_box, &place, message, within(room, self.unit))
                && self.check(enclosure.reaches(position_m), &place, beyond, beyond_walls(enclosure));
        }
        let is_factor = spec.flux_scale.is_finite() && spec.flux_scale >= 0.0;
        let message = format!("{} is no factor", spec.flux_scale);
        self.check(is_factor, &at("flux_scale"), message, "give a number from 0");
        let turn = spec.rotate_deg;
        let finite = [turn.azimuth, turn.tilt, turn.roll].iter().all(|a| a.is_finite());
        self.check(finite, &at("rotate_deg"), "angles must be finite", "give degrees");
        let path = self.path_of(&spec.photometry);
        let photometry = if let Some(read) = files.get(&path) {
            read.clone()?
        } else {
            let read = self.photometry(&at("photometry"), &path);
            files.entry(path).or_insert(read).clone()?
        };
        let luminaire = Luminaire {
            id: spec.id.clone(),
            photometry,
            position_m,
            orientation: orientation(turn.azimuth, turn.tilt, turn.roll),
            flux_scale: spec.flux_scale,
            // The model is chosen when all places are known.
            model: LuminaireModel::Point,
        };
        let brightest_cd = luminaire.photometry.distribution.max_intensity().value() * luminaire.flux_scale;
        let message = format!("it gives the luminaire {brightest_cd:e} cd, and nothing is so bright");
        let help = "correct the factor, or the candela of the photometric file";
        self.check(!is_factor || brightest_cd <= BRIGHTEST_CD, &at("flux_scale"), message, help);
        (finite && is_within).then_some(luminaire)
    }

    fn photometry(&mut self, at: &str, path: &Path) -> Option<Arc<Photometry>> {
        if self.mended.touches(at) {
            return None;
        }
        self.take_in(at, &luxproof_photometry::file_and_part(path).0)?;
        match luxproof_photometry::read_by(path, &|path| self.read(path)) {
            Ok(read) => Some(Arc::new(read)),
            Err(error) => {
                self.fault(at, |source| {
                    let fault = SpecError {
                        // The reader counts from 1; 0 is no place.
                        line: Some(error.line).filter(|l| *l > 0),
                        column: Some(error.column).filter(|c| *c > 0),
                        ..SpecError::of(path, error.message(), error.help())
                    };
                    fault.withheld(source.trust)
                });
                None
            }
        }
    }

    /// What openings cover of the surfaces that they lie on, which must not overlap.
    pub(super) fn plates(&mut self, luminaires: &[(usize, Placed)]) -> Vec<Obstacle> {
        let mut plates: Vec<(&str, &Obstacle)> = vec![];
        for (k, Placed { luminaire, plates: own, .. }) in luminaires {
            let other = own
                .iter()
                .find_map(|plate| plates.iter().find(|(_, other)| flush::overlap(other, plate)).map(|(id, _)| *id));
            if let Some(other) = other {
                let message = format!("its luminous opening overlaps that of `{other}` in the plane of the surface");
                let help = "move one of them: where one opening is, there is no room for another";
                self.check(false, &format!("luminaires[{k}].at_m"), message, help);
                continue;
            }
            plates.extend(own.iter().map(|plate| (luminaire.id.as_str(), plate)));
        }
        plates.into_iter().map(|(_, plate)| plate.clone()).collect()
    }
}

fn extent(shape: &Shape) -> (DVec3, DVec3) {
    match shape {
        Shape::Box { min_m, max_m } => (*min_m, *max_m),
        Shape::Mesh { vertices_m, .. } => {
            vertices_m.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), v| (low.min(*v), high.max(*v)))
        }
    }
}
