//! Spec -> Case: reads the files that a spec names, checks what the shape alone cannot, and builds the scene.

use std::collections::{BTreeMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::DVec3;
use luminaire::geometry::{Mesh, Room};
use luminaire::photometry::{self, Photometry};
use luminaire::scene::{Luminaire, LuminaireModel, Meter, Obstacle, Scene, Shape, flush, orientation};
use sha2::{Digest, Sha256};

use super::cases::Variant;
use super::model::{
    Budget, EngineSettings, GridSpec, LuminaireSpec, MeterSet, ModelSpec, ObstacleSpec, Spec, ToleranceOverride,
};
use super::mounting::unmountable;
use super::trust::Limits;
use super::{Source, SpecError, Trust, suggestion};
use crate::procedures::{Angles, Asked, AtAngles, Names, Procedures, Task};
use crate::record::ProcedureId;
use crate::system::digest::hexadecimal;
use crate::system::printable;

/// Nearest a meter or a luminaire may come to a surface, relative to the room's largest extent.
///
/// On the surface itself a renderer's answer depends on rounding, and so would ours.
const SURFACE_MARGIN: f64 = 1e-9;

/// No luminaire is so bright: the sun itself has some 3e27 cd. What is made of it stays a number below this.
const BRIGHTEST_CD: f64 = 1e30;

/// More meters than this are a slip of the pen.
const MAX_METERS: usize = 1_000_000;

const TRIANGLES_OF_A_BOX: usize = 12;

/// The longest name, and the longest title, in characters.
const MAX_NAME: usize = 100;
const MAX_TITLE: usize = 1000;

/// A spec, read, checked and built: all that the rest of the program needs.
#[derive(Clone, Debug, Default)]
pub struct Case {
    /// The spec's file stem, and behind a slash the name of one of its cases.
    pub name: String,
    /// The spec's title, or its name.
    pub title: String,
    /// The spec's path as given.
    pub path: PathBuf,
    /// SHA-256 over the spec and every file that it names, in hexadecimal.
    pub sha256: String,
    /// Room, obstacles and luminaires.
    pub scene: Scene,
    /// Meters by set.
    pub meters: BTreeMap<String, Vec<Meter>>,
    pub procedures: Procedures,
    /// The engines that the spec names, with settings; `None` where it names none.
    pub engines: Option<BTreeMap<String, EngineSettings>>,
    /// The engines that a case of a suite is for, where its overrides name some; others are skipped.
    pub only_engines: Option<Vec<String>>,
    pub budget: Budget,
    /// The published tables, absolute or relative to the working directory.
    pub published: Option<PathBuf>,
    /// Overrides of the default tolerances, by procedure.
    pub tolerances: BTreeMap<ProcedureId, ToleranceOverride>,
    /// The text, for the places of later errors.
    pub source: Source,
}

impl Case {
    /// The settings that the spec gives an engine; none where it names none.
    pub fn settings_of(&self, engine: &str) -> BTreeMap<String, serde_json::Value> {
        let of_engine = self.engines.as_ref().and_then(|all| all.get(engine));
        of_engine.map(|EngineSettings(settings)| settings.clone()).unwrap_or_default()
    }

    /// Whether it holds scenes of known answer, for which no spec asks.
    pub fn is_known(&self) -> bool {
        self.procedures.0.is_empty()
    }

    /// What a procedure measures in it; `None` where the spec does not ask for it.
    pub fn task(&self, procedure: ProcedureId) -> Option<Task> {
        procedure.row().task(self.procedures.0.get(&procedure)?, &self.scene, &self.meters)
    }

    /// What all procedures measure in it, in the order of reports.
    pub fn tasks(&self) -> impl Iterator<Item = Task> {
        ProcedureId::ALL.iter().copied().filter_map(|procedure| self.task(procedure))
    }

    /// Reads, checks and builds the case of a spec file of the user's own, without the overrides of its `cases`.
    pub fn load(path: &Path) -> Result<Self, SpecError> {
        let source = Source::read(path, Trust::Own)?;
        let spec: Spec = source.parse()?;
        Builder::new(&source, &mut source.trust.limits()).build(spec)
    }

    /// All cases of a spec file: those of its `cases`, or the one that it is.
    pub fn load_all(path: &Path, trust: Trust) -> Result<Vec<Self>, SpecError> {
        let source = Source::read(path, trust)?;
        let spec: Spec = source.parse()?;
        let mut left = trust.limits();
        let Some(variants) = super::cases::variants(&source)? else {
            return Ok(vec![Builder::new(&source, &mut left).build(spec)?]);
        };
        let build = |v: Result<Variant, SpecError>| {
            let v = v?;
            let mut builder = Builder::new(&v.source, &mut left);
            builder.hash.update(&v.name);
            let case = builder.build(v.spec)?;
            Ok(Self { name: format!("{}/{}", case.name, v.name), only_engines: v.engines, ..case })
        };
        variants.map(build).collect()
    }
}

struct Builder<'a> {
    source: &'a Source,
    folder: &'a Path,
    hash: Sha256,
    /// What the cases of the file may still ask for.
    left: &'a mut Limits,
}

impl<'a> Builder<'a> {
    fn new(source: &'a Source, left: &'a mut Limits) -> Self {
        Self { source, folder: source.path.parent().unwrap_or(Path::new("")), hash: Sha256::new(), left }
    }

    /// Takes so many of what is left of something.
    fn take(&mut self, at: &str, what: &str, count: usize, of: fn(&mut Limits) -> &mut usize) -> Result<(), SpecError> {
        let left = of(self.left);
        let (all, enough) = (*left, count <= *left);
        *left = left.saturating_sub(count);
        let message = format!("{count} {what} are more than the {all} that are left to a spec that is not trusted");
        self.source.require(enough, at, message, "make several of it, or run it without --untrusted if it is yours")
    }

    fn build(mut self, spec: Spec) -> Result<Case, SpecError> {
        self.hash.update(&self.source.text);
        let message = format!("format version {} is not known", spec.luxproof);
        self.source.require(spec.luxproof == 1, "luxproof", message, "this program reads version 1")?;
        self.programs(&spec)?;
        self.take("luminaires", "luminaires", spec.luminaires.len(), |left| &mut left.luminaires)?;
        let room = self.room(&spec)?;
        let mut obstacles = self.obstacles(&spec.obstacles, &room)?;
        let luminaires = self.luminaires(&spec.luminaires, &room)?;
        obstacles.extend(self.recesses(&luminaires, &room)?);
        let scene = Scene { room: Some(room), obstacles, luminaires };
        let mut meters = BTreeMap::new();
        for (name, set) in &spec.meters {
            self.name("meters", name)?;
            let set = self.meter_set(name, set, &scene)?;
            meters.insert(name.clone(), set);
        }
        let seen = meters.values().map(Vec::len).sum::<usize>().saturating_mul(spec.luminaires.len().pow(2));
        self.take("luminaires", "pairs of luminaires as meters see them", seen, |left| &mut left.sights)?;
        self.procedures(&spec.procedures, &spec.luminaires, &meters)?;
        self.budget(spec.budget)?;
        let tolerances = self.tolerances(&spec.tolerances)?;
        let published = spec.published.map(|file| self.beside(&file));
        if let Some(file) = &published {
            self.take_in("published", file)?;
        }
        let name = name_of(&self.source.path);
        let title = spec.title.as_deref().unwrap_or(&name);
        let help = format!("give a line of at most {MAX_TITLE} printable characters");
        self.source.require(is_line(title, MAX_TITLE), "title", "this is no title", help)?;
        Ok(Case {
            title: title.to_owned(),
            name,
            path: self.source.path.clone(),
            sha256: hexadecimal(&self.hash.finalize()),
            scene,
            meters,
            procedures: spec.procedures,
            engines: spec.engines,
            only_engines: None,
            budget: spec.budget,
            published,
            tolerances,
            source: self.source.clone(),
        })
    }

    /// Refuses programs that a stranger would have us run.
    fn programs(&self, spec: &Spec) -> Result<(), SpecError> {
        let mut engines = spec.engines.iter().flatten();
        let Some((name, _)) = engines.find(|(_, settings)| settings.0.contains_key("command")) else { return Ok(()) };
        let message = "it would run a program, and the spec is not trusted";
        let help = "run it without --untrusted if it is yours";
        self.source.require(self.source.trust == Trust::Own, &format!("engines.{name}.command"), message, help)
    }

    fn room(&self, spec: &Spec) -> Result<Room, SpecError> {
        for (k, size) in spec.room.size_m.iter().enumerate() {
            let (at, message) = (format!("room.size_m[{k}]"), format!("{size} m is no extent"));
            self.source.require(size.is_finite() && *size > 0.0, &at, message, "give a positive number of metres")?;
        }
        Ok(Room { size_m: DVec3::from(spec.room.size_m), reflectance: spec.room.reflectance.build() })
    }

    fn obstacles(&mut self, specs: &[ObstacleSpec], room: &Room) -> Result<Vec<Obstacle>, SpecError> {
        let mut obstacles = vec![];
        for (k, spec) in specs.iter().enumerate() {
            let at = format!("obstacles[{k}]");
            let obstacle = match (&spec.cuboid, &spec.mesh) {
                (Some(cuboid), None) => {
                    let (min_m, max_m) = (DVec3::from(cuboid.min_m), DVec3::from(cuboid.max_m));
                    self.take(&at, "triangles", TRIANGLES_OF_A_BOX, |left| &mut left.triangles)?;
                    let sound = min_m.is_finite() && max_m.is_finite() && min_m.cmplt(max_m).all();
                    let message = format!("the box from {min_m} to {max_m} has no volume");
                    self.source.require(sound, &at, message, "give min_m below max_m on every axis")?;
                    Obstacle { shape: Shape::Box { min_m, max_m }, reflectance: cuboid.reflectance.0 }
                }
                (None, Some(mesh)) => {
                    let path = self.beside(&mesh.file);
                    let bytes = self.take_in(&format!("{at}.mesh.file"), &path)?;
                    let read = Mesh::parse_obj(&mut bytes.as_slice(), &path).map_err(|error| {
                        let help = "give a Wavefront OBJ file of triangles or polygons, in metres, z up";
                        self.source.error_at(&format!("{at}.mesh.file"), error.to_string(), help)
                    })?;
                    self.take(&at, "triangles", read.triangles.len(), |left| &mut left.triangles)?;
                    let Mesh { vertices_m, triangles } = read.moved(DVec3::from(mesh.at_m));
                    Obstacle { shape: Shape::Mesh { vertices_m, triangles }, reflectance: mesh.reflectance.0 }
                }
                _ => {
                    let message = "an obstacle is either a box or a mesh";
                    return Err(self.source.error_at(&at, message, "give exactly one of `box` and `mesh`"));
                }
            };
            let (low, high) = extent(&obstacle.shape);
            let outside = low.min_element() < 0.0 || high.cmpgt(room.size_m).any();
            let message = format!("it reaches from {low} to {high}, outside the room");
            self.source.require(!outside, &at, message, within(room))?;
            obstacles.push(obstacle);
        }
        Ok(obstacles)
    }

    fn luminaires(&mut self, specs: &[LuminaireSpec], room: &Room) -> Result<Vec<Luminaire>, SpecError> {
        self.source.require(!specs.is_empty(), "luminaires", "there are none", "give at least one luminaire")?;
        let mut ids = HashSet::new();
        let mut files: BTreeMap<PathBuf, Arc<Photometry>> = BTreeMap::new();
        let mut luminaires = vec![];
        for (k, spec) in specs.iter().enumerate() {
            let at = |field: &str| format!("luminaires[{k}].{field}");
            self.name(&at("id"), &spec.id)?;
            let message = format!("`{}` is no unique name", spec.id);
            self.source.require(ids.insert(&spec.id), &at("id"), message, "give every luminaire an id of its own")?;
            // What is nearly in the plane of a surface is meant to be recessed in it.
            let position_m = flush::snapped(room, DVec3::from(spec.at_m));
            let inside = position_m.is_finite() && room.contains(position_m, 0.0);
            let message = format!("{position_m} lies outside the room");
            self.source.require(inside, &at("at_m"), message, within(room))?;
            let is_factor = spec.flux_scale.is_finite() && spec.flux_scale >= 0.0;
            let message = format!("{} is no factor", spec.flux_scale);
            self.source.require(is_factor, &at("flux_scale"), message, "give a number from 0")?;
            let turn = spec.rotate_deg;
            let finite = [turn.azimuth, turn.tilt, turn.roll].iter().all(|a| a.is_finite());
            self.source.require(finite, &at("rotate_deg"), "angles must be finite", "give degrees")?;
            let path = self.beside(&spec.photometry);
            let photometry = match files.get(&path) {
                Some(read) => Arc::clone(read),
                None => Arc::clone(files.entry(path.clone()).or_insert(self.photometry(&at("photometry"), &path)?)),
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
            self.source.require(brightest_cd <= BRIGHTEST_CD, &at("flux_scale"), message, help)?;
            if let Some((message, help)) = unmountable(&luminaire, room) {
                return Err(self.source.error_at(&at("at_m"), message, help));
            }
            luminaires.push(luminaire);
        }
        Ok(luminaires)
    }

    /// The pieces of surface that flush openings replace, which must not overlap.
    fn recesses(&self, luminaires: &[Luminaire], room: &Room) -> Result<Vec<Obstacle>, SpecError> {
        let mut plates: Vec<(&str, Obstacle)> = vec![];
        for (k, luminaire) in luminaires.iter().enumerate() {
            let Some(plate) = flush::plate(room, luminaire) else { continue };
            if let Some((other, _)) = plates.iter().find(|(_, other)| flush::overlap(room, other, &plate)) {
                let message = format!("its luminous opening overlaps that of `{other}` in the plane of the surface");
                let help = "move one of them: where one opening is, there is no room for another";
                return Err(self.source.error_at(&format!("luminaires[{k}].at_m"), message, help));
            }
            plates.push((&luminaire.id, plate));
        }
        Ok(plates.into_iter().map(|(_, plate)| plate).collect())
    }

    /// Refuses what is no name: names stand in scenes, logs and views, where a line break begins something else.
    fn name(&self, at: &str, name: &str) -> Result<(), SpecError> {
        let is_name = is_line(name, MAX_NAME) && name.trim() == name && !name.is_empty();
        let message = format!("`{}` is no name", printable::line(name, MAX_NAME));
        let help = format!("give 1 to {MAX_NAME} printable characters, no blank at either end");
        self.source.require(is_name, at, message, help)
    }

    fn photometry(&mut self, at: &str, path: &Path) -> Result<Arc<Photometry>, SpecError> {
        self.take_in(at, path)?;
        let (trust, folder) = (self.source.trust, self.folder);
        let read = photometry::read_by(path, &|path| trust.read_named(folder, path));
        read.map(Arc::new).map_err(|error| SpecError {
            file: path.to_owned(),
            // The reader counts from 1; 0 is no place.
            line: Some(error.line).filter(|l| *l > 0),
            column: Some(error.column).filter(|c| *c > 0),
            message: error.message(),
            help: Some(error.help().to_owned()),
        })
    }

    fn meter_set(&mut self, name: &str, set: &MeterSet, scene: &Scene) -> Result<Vec<Meter>, SpecError> {
        let at = format!("meters.{name}");
        let normal = DVec3::from(set.normal);
        let Some(normal) = normal.try_normalize().filter(|_| normal.is_finite()) else {
            let message = "the normal has no direction";
            return Err(self.source.error_at(&format!("{at}.normal"), message, "give a vector other than zero"));
        };
        let points: Vec<DVec3> = match (&set.points_m, &set.grid) {
            (Some(points), None) => {
                self.take(&at, "meters", points.len(), |left| &mut left.meters)?;
                points.iter().map(|p| DVec3::from(*p)).collect()
            }
            (None, Some(grid)) => {
                self.take(&at, "meters", self.count(&at, grid)?, |left| &mut left.meters)?;
                points_of(grid)
            }
            _ => {
                let message = "a meter set is either points or a grid";
                return Err(self.source.error_at(&at, message, "give exactly one of `points_m` and `grid`"));
            }
        };
        self.source.require(!points.is_empty(), &at, "the set holds no points", "give at least one")?;
        for (k, &point) in points.iter().enumerate() {
            if let Some((message, help)) = misplaced(point, scene) {
                let path = if set.grid.is_some() { format!("{at}.grid") } else { format!("{at}.points_m[{k}]") };
                return Err(self.source.error_at(&path, format!("{name}[{k}] at {point} {message}"), help));
            }
        }
        Ok(points.into_iter().map(|position_m| Meter { position_m, normal }).collect())
    }

    /// How many points a grid has.
    fn count(&self, at: &str, grid: &GridSpec) -> Result<usize, SpecError> {
        let [nu, nv] = grid.counts;
        let count = nu.checked_mul(nv).filter(|n| (1..=MAX_METERS).contains(n));
        let help = format!("give counts whose product lies between 1 and {MAX_METERS}");
        let error = || self.source.error_at(&format!("{at}.grid.counts"), format!("{nu} x {nv} points"), help);
        count.ok_or_else(error)
    }

    fn procedures(
        &mut self,
        procedures: &Procedures,
        luminaires: &[LuminaireSpec],
        meters: &BTreeMap<String, Vec<Meter>>,
    ) -> Result<(), SpecError> {
        self.source.require(!procedures.0.is_empty(), "procedures", "there are none", "give at least one procedure")?;
        for (procedure, asked) in &procedures.0 {
            match asked {
                Asked::Meters(asked) => self.meter_sets(*procedure, &asked.meters, meters)?,
                Asked::Angles(asked) => self.angles(*procedure, asked, luminaires)?,
            }
        }
        Ok(())
    }

    fn meter_sets(
        &mut self,
        procedure: ProcedureId,
        names: &Names,
        meters: &BTreeMap<String, Vec<Meter>>,
    ) -> Result<(), SpecError> {
        let at = format!("procedures.{procedure}.meters");
        if let Some(name) = names.iter().find(|name| !meters.contains_key(*name)) {
            let message = format!("there is no meter set `{name}`");
            let help = suggestion(name, meters.keys().map(String::as_str));
            return Err(self.source.error_at(&at, message, help));
        }
        let mut known = HashSet::new();
        let twice = names.iter().find(|name| !known.insert(*name));
        let message = format!("`{}` stands there twice", twice.map_or("", |name| name));
        self.source.require(twice.is_none(), &at, message, "name every set once")
    }

    fn angles(
        &mut self,
        procedure: ProcedureId,
        intensity: &AtAngles,
        luminaires: &[LuminaireSpec],
    ) -> Result<(), SpecError> {
        let at = |field: &str| format!("procedures.{procedure}.{field}");
        let ids = || luminaires.iter().map(|l| l.id.as_str());
        let message = format!("there is no luminaire `{}`", intensity.luminaire);
        let help = suggestion(&intensity.luminaire, ids());
        self.source.require(ids().any(|id| id == intensity.luminaire), &at("luminaire"), message, help)?;
        let is_distance = intensity.distance_m.is_finite() && intensity.distance_m > 0.0;
        let message = format!("{} m is no distance", intensity.distance_m);
        self.source.require(is_distance, &at("distance_m"), message, "give a positive number of metres")?;
        let Angles::Listed(lists) = &intensity.angles else { return Ok(()) };
        let all = |list: &[f64], sound: fn(&f64) -> bool| !list.is_empty() && list.iter().all(sound);
        let (gamma, c) = (all(&lists.gamma_deg, |g| (0.0..=180.0).contains(g)), all(&lists.c_deg, |c| c.is_finite()));
        let help = "list gamma angles from 0 (nadir) to 180 (zenith)";
        self.source.require(gamma, &at("angles.gamma_deg"), "not a list of gamma angles", help)?;
        self.source.require(c, &at("angles.c_deg"), "not a list of C angles", "list C planes in degrees")?;
        let count = lists.gamma_deg.len().saturating_mul(lists.c_deg.len());
        let help = format!("a procedure measures at {MAX_METERS} angles at most");
        self.source.require(count <= MAX_METERS, &at("angles"), format!("{count} angles"), help)?;
        self.take(&at("angles"), "angles", count, |left| &mut left.meters)
    }

    fn budget(&self, budget: Budget) -> Result<(), SpecError> {
        for (field, value) in [("relative_error", budget.relative_error), ("seconds", budget.seconds)] {
            let (at, message) = (format!("budget.{field}"), format!("{value} is no budget"));
            self.source.require(value.is_finite() && value > 0.0, &at, message, "give a positive number")?;
        }
        Ok(())
    }

    fn tolerances(
        &self,
        tolerances: &BTreeMap<String, ToleranceOverride>,
    ) -> Result<BTreeMap<ProcedureId, ToleranceOverride>, SpecError> {
        let one = |(name, tolerance): (&String, &ToleranceOverride)| {
            let procedure = name.parse::<ProcedureId>().map_err(|_| {
                let help = suggestion(name, ProcedureId::NAMES.iter().copied());
                self.source.error_at("tolerances", format!("`{name}` is no procedure"), help)
            })?;
            let values = [tolerance.relative, tolerance.absolute_lx, tolerance.absolute_cd];
            let (at, sound) = (format!("tolerances.{name}"), values.iter().all(|v| v.is_finite() && *v >= 0.0));
            self.source.require(sound, &at, "a tolerance is a number from 0", "give positive numbers")?;
            Ok((procedure, *tolerance))
        };
        tolerances.iter().map(one).collect()
    }

    fn beside(&self, file: &Path) -> PathBuf {
        self.folder.join(file)
    }

    /// The bytes of a file that the spec names, which are part of what it is.
    fn take_in(&mut self, at: &str, path: &Path) -> Result<Vec<u8>, SpecError> {
        let bytes = self.source.trust.read_named(self.folder, path).map_err(|error| {
            let message = format!("{} cannot be read: {error}", path.display());
            self.source.error_at(at, message, "paths are relative to the spec's folder")
        })?;
        self.take(at, "bytes of files", bytes.len(), |left| &mut left.bytes)?;
        self.hash.update(&bytes);
        Ok(bytes)
    }
}

fn points_of(grid: &GridSpec) -> Vec<DVec3> {
    let [nu, nv] = grid.counts;
    let (origin, u, v) = (DVec3::from(grid.origin_m), DVec3::from(grid.u_m), DVec3::from(grid.v_m));
    (0..nv).flat_map(|j| (0..nu).map(move |i| origin + u * i as f64 + v * j as f64)).collect()
}

/// A spec's name: its file's, as a line.
pub(super) fn name_of(path: &Path) -> String {
    let stem = path.file_stem().map_or_else(|| "spec".into(), |s| s.to_string_lossy());
    printable::line(&stem, MAX_NAME)
}

/// Whether a text is one line of so many characters at most: no control character, and none that breaks or turns a line.
fn is_line(text: &str, most: usize) -> bool {
    text.chars().count() <= most && !text.chars().any(printable::is_unprintable)
}

/// What is wrong with a meter at this point, and what to do.
fn misplaced(point: DVec3, scene: &Scene) -> Option<(&'static str, String)> {
    let room = scene.room.as_ref()?;
    let margin = SURFACE_MARGIN * room.size_m.max_element();
    if !point.is_finite() || !room.contains(point, -margin) {
        return Some(("lies outside the room", within(room)));
    }
    if !room.contains(point, margin) {
        let help = "a meter on a surface sees half of nothing: move it inwards, by 1e-6 m say".to_owned();
        return Some(("lies on a surface of the room", help));
    }
    let inside = |shape: &Shape| match shape {
        Shape::Box { min_m, max_m } => point.cmpge(*min_m).all() && point.cmple(*max_m).all(),
        Shape::Mesh { .. } => false,
    };
    if scene.obstacles.iter().any(|o| inside(&o.shape)) {
        return Some(("lies inside an obstacle or on its surface", "move it out, by 1e-6 m at least".to_owned()));
    }
    if scene.luminaires.iter().any(|l| l.position_m.distance(point) <= margin) {
        return Some(("lies in a luminaire's photometric centre", "move it away".to_owned()));
    }
    None
}

fn extent(shape: &Shape) -> (DVec3, DVec3) {
    match shape {
        Shape::Box { min_m, max_m } => (*min_m, *max_m),
        Shape::Mesh { vertices_m, .. } => {
            vertices_m.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), v| (low.min(*v), high.max(*v)))
        }
    }
}

fn within(room: &Room) -> String {
    let [x, y, z] = room.size_m.to_array();
    format!("the room reaches from [0, 0, 0] to [{x}, {y}, {z}] m")
}
