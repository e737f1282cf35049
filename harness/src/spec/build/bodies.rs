//! What stands and hangs in the room: obstacles, luminaires, and the openings that are flush with a surface.

use std::collections::{BTreeMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::DVec3;
use luminaire::geometry::{Mesh, Room};
use luminaire::photometry::{self, Photometry};
use luminaire::scene::enclosure::Enclosure;
use luminaire::scene::{Luminaire, LuminaireModel, Obstacle, Shape, flush, orientation};

use super::super::model::{LuminaireSpec, ModelSpec, ObstacleSpec};
use super::super::mounting::unmountable;
use super::{BEYOND, Builder, within};
use crate::spec::SpecError;

/// No luminaire is so bright: the sun itself has some 3e27 cd. What is made of it stays a number below this.
const BRIGHTEST_CD: f64 = 1e30;

const TRIANGLES_OF_A_BOX: usize = 12;

/// More luminaires than this in an array are a slip of the pen.
const MAX_LUMINAIRES: usize = 100_000;

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
                let message = format!("the box from {min_m} to {max_m} has no volume");
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
                let path = self.beside(&mesh.file);
                let bytes = self.take_in(&place, &path)?;
                let read = match Mesh::parse_obj(&mut bytes.as_slice(), &path) {
                    Ok(read) => read,
                    Err(error) => {
                        let help = "give a Wavefront OBJ file of triangles or polygons, in metres, z up";
                        self.check(false, &place, error.to_string(), help);
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
            let message = format!("it reaches from {low} to {high}, outside the room");
            self.check(!outside, at, message, within(room));
        }
        Some(obstacle)
    }

    /// Each with its place in the spec.
    pub(super) fn luminaires(
        &mut self,
        specs: &[LuminaireSpec],
        enclosure: Option<&Enclosure>,
    ) -> Vec<(usize, Luminaire)> {
        self.check(!specs.is_empty(), "luminaires", "there are none", "give at least one luminaire");
        let mut ids = HashSet::new();
        let mut files: BTreeMap<PathBuf, Option<Arc<Photometry>>> = BTreeMap::new();
        let mut luminaires = vec![];
        for (k, spec) in specs.iter().enumerate() {
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
                let luminaire = self.luminaire(k, &LuminaireSpec { id, ..spec.clone() }, at_m, enclosure, &mut files);
                // Of an array the others would say the same.
                let Some(luminaire) = luminaire else { break };
                luminaires.push((k, luminaire));
            }
        }
        luminaires
    }

    /// Whether it is told where it is, and if it is many, that they lie apart.
    fn is_placed(&mut self, k: usize, spec: &LuminaireSpec) -> bool {
        let at = format!("luminaires[{k}]");
        let Some(array) = spec.array else {
            let help = "give `at_m`, or an `array` of many";
            return self.check(spec.at_m.is_some(), &at, "missing field `at_m`: it is nowhere", help);
        };
        let message = "it is in one place and an array at once";
        self.check(spec.at_m.is_none(), &at, message, "give exactly one of `at_m` and `array`");
        let count = (1..=MAX_LUMINAIRES).contains(&spec.len());
        let help = format!("give counts whose product lies between 1 and {MAX_LUMINAIRES}");
        let [nx, ny] = array.counts;
        let is_few = self.check(count, &format!("{at}.array.counts"), format!("{nx} x {ny} luminaires"), help);
        let apart = |n: usize, step: f64| step.is_finite() && (n < 2 || step != 0.0);
        let [dx, dy] = array.step_m;
        let help = "give the steps from one to the next along x and y, in metres";
        let is_apart = self.check(
            apart(nx, dx) && apart(ny, dy),
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
        let (place, which) = match spec.array {
            Some(_) => (at("array"), format!("`{}`: ", spec.id)),
            None => (at("at_m"), String::new()),
        };
        let (mut position_m, mut is_within) = (DVec3::from(at_m), false);
        if let Some(enclosure) = enclosure {
            let room = &enclosure.room;
            // What is nearly in the plane of a surface is meant to be recessed in it.
            position_m = flush::snapped(room, position_m);
            let is_in_box = position_m.is_finite() && room.contains(position_m, 0.0);
            let message = format!("{which}{position_m} lies outside the room");
            let beyond = format!("{message}'s walls");
            is_within = self.check(is_in_box, &place, message, within(room))
                && self.check(enclosure.reaches(position_m), &place, beyond, BEYOND);
        }
        let is_factor = spec.flux_scale.is_finite() && spec.flux_scale >= 0.0;
        let message = format!("{} is no factor", spec.flux_scale);
        self.check(is_factor, &at("flux_scale"), message, "give a number from 0");
        let turn = spec.rotate_deg;
        let finite = [turn.azimuth, turn.tilt, turn.roll].iter().all(|a| a.is_finite());
        self.check(finite, &at("rotate_deg"), "angles must be finite", "give degrees");
        let path = self.beside(&spec.photometry);
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
            model: match spec.model {
                ModelSpec::Point => LuminaireModel::Point,
                ModelSpec::Area => LuminaireModel::Area,
                ModelSpec::Impostor => LuminaireModel::Impostor,
            },
        };
        let brightest_cd = luminaire.photometry.distribution.max_intensity().value() * luminaire.flux_scale;
        let message = format!("it gives the luminaire {brightest_cd:e} cd, and nothing is so bright");
        let help = "correct the factor, or the candela of the photometric file";
        self.check(!is_factor || brightest_cd <= BRIGHTEST_CD, &at("flux_scale"), message, help);
        let room = enclosure.map(|e| &e.room).filter(|_| finite && is_within)?;
        if let Some((message, help)) = unmountable(&luminaire, room) {
            self.check(false, &place, which + &message, help);
            return None;
        }
        Some(luminaire)
    }

    fn photometry(&mut self, at: &str, path: &Path) -> Option<Arc<Photometry>> {
        if self.mended.touches(at) {
            return None;
        }
        self.take_in(at, &photometry::file_and_part(path).0)?;
        match photometry::read_by(path, &|path| self.read(path)) {
            Ok(read) => Some(Arc::new(read)),
            Err(error) => {
                self.fault(at, |_| SpecError {
                    file: path.to_owned(),
                    // The reader counts from 1; 0 is no place.
                    line: Some(error.line).filter(|l| *l > 0),
                    column: Some(error.column).filter(|c| *c > 0),
                    message: error.message(),
                    help: Some(error.help().to_owned()),
                });
                None
            }
        }
    }

    /// The pieces of surface that flush openings replace, which must not overlap.
    pub(super) fn recesses(&mut self, luminaires: &[(usize, Luminaire)], room: &Room) -> Vec<Obstacle> {
        let mut plates: Vec<(&str, Obstacle)> = vec![];
        for (k, luminaire) in luminaires {
            let Some(plate) = flush::plate(room, luminaire) else { continue };
            if let Some((other, _)) = plates.iter().find(|(_, other)| flush::overlap(room, other, &plate)) {
                let message = format!("its luminous opening overlaps that of `{other}` in the plane of the surface");
                let help = "move one of them: where one opening is, there is no room for another";
                self.check(false, &format!("luminaires[{k}].at_m"), message, help);
                continue;
            }
            plates.push((&luminaire.id, plate));
        }
        plates.into_iter().map(|(_, plate)| plate).collect()
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
