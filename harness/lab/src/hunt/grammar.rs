//! Random specs: a typed grammar over everything that a spec can contain, biased towards edge
//! cases. A seed and a number give one spec.
//!
//! Each round leaves out a random half of all features (swarm testing: Groce et al., ISSTA 2012). A
//! feature that is always present hides faults that show only without it.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use fastrand::Rng;
use glam::{DMat3, DVec3};
use luxproof_calculators::inverse_square;
use luxproof_photometry::{
    Goniometer, HorizontalAxis, LuminousIntensityDistribution, LuminousOpening, Photometry, direction, eulumdat, lm63,
};
use luxproof_scene::{Bounces, orientation};
use strum::VariantArray;

use super::draft::{Draft, File};
use super::feature::{Feature, find_features};
use super::table;
use crate::draw::Draw;
use luxproof_model::{EngineName, ProcedureId};
use luxproof_process::random;
use luxproof_spec::model::{
    BoxSpec, FourWalls, Fraction, GridSpec, LengthUnit, LuminaireSpec, MeshSpec, MeterSet, ModelSpec, ObstacleSpec,
    ReflectanceSpec, RoomSpec, RotationSpec, Walls,
};
use luxproof_spec::procedures::{
    AngleLists, Angles, AnyLight, AtAngles, AtMeters, AtOpening, Names, ProcedureRequest, Procedures,
};
use luxproof_spec::{Budget, Case, EngineSettings, Spec};

/// The number of specs in a round; all of them leave out the same features.
pub(super) const SPECS_PER_ROUND: u64 = 8;
/// The rounds of eight that have reflected light, which costs ten times as much: one with openings,
/// one without.
const REFLECTED_ROUNDS: [u64; 2] = [2, 7];
/// How often a spec is drawn again that its reader refuses, for example because a meter is inside a
/// body.
const MAX_ATTEMPTS: u64 = 40;
/// One in this many specs may have a meter where a luminaire's table has two values. Either value
/// is right there, so the spec decides nothing.
const SPECS_PER_JUMP: u64 = 16;
/// The least distance of a meter from a luminaire, in parts of the reach. Closer, the patches of
/// renderers with 32-bit floats are as wide as what they look at, and the renderers say so.
const MIN_DISTANCE_REACHES: f64 = 1e-2;
/// The reach of special meters from a luminaire, in parts of the room's shortest side.
const REACH_SIDES: f64 = 0.3;
/// The marks of two independent random sequences.
const ROUND_STREAM: u64 = 0x1001;
const SPEC_STREAM: u64 = 0x1002;

/// The meter sets for luminance and for glare.
const ON_FLOOR: &str = "floor";
const EYES: &str = "eyes";

/// The shapes of luminous openings.
const OPENINGS: [Feature; 6] = [
    Feature::FlatOpening,
    Feature::BoxOpening,
    Feature::RoundOpening,
    Feature::UprightCylinder,
    Feature::Ellipsoid,
    Feature::LyingCylinder,
];

/// The hunted engines: names with the settings that specs give them.
pub(super) type Engines = BTreeMap<EngineName, EngineSettings>;

/// The inputs that determine every spec of a hunt.
pub(super) struct Grammar<'a> {
    pub(super) seed: u64,
    pub(super) engines: &'a Engines,
    /// The budget of each spec.
    pub(super) budget: Budget,
}

/// A spec of the sequence.
pub(super) struct Generated {
    pub(super) name: String,
    pub(super) draft: Draft,
    pub(super) case: Case,
    pub(super) features: BTreeSet<Feature>,
}

impl Grammar<'_> {
    /// Generates the `n`-th spec; `None` where the reader refuses every attempt.
    pub(super) fn generate(&self, n: u64) -> Option<Generated> {
        let allowed = self.allowed_features(n / SPECS_PER_ROUND);
        (0..MAX_ATTEMPTS).find_map(|attempt| {
            let seed = random::seed(&[SPEC_STREAM, self.seed, n, attempt]);
            let name = format!("h{}-{n}", self.seed);
            let draw = Draw(Rng::with_seed(u64::from(seed)));
            let generator = SpecGenerator { draw, allowed: &allowed, size_m: DVec3::ONE, files: BTreeMap::new() };
            let draft = generator.draw_spec(self, &name);
            let case = draft.case().filter(|case| n.is_multiple_of(SPECS_PER_JUMP) || !has_meter_at_jump(case))?;
            let features = find_features(&draft, &case);
            Some(Generated { name, draft, case, features })
        })
    }

    /// The features that a round does not leave out.
    fn allowed_features(&self, round: u64) -> BTreeSet<Feature> {
        let mut rng = Rng::with_seed(u64::from(random::seed(&[ROUND_STREAM, self.seed, round])));
        let mut allowed: BTreeSet<Feature> = Feature::VARIANTS.iter().copied().filter(|_| rng.bool()).collect();
        // Every other round has only point luminaires and boxes: every engine reads these, and
        // quickly.
        if round.is_multiple_of(2) {
            for costly in OPENINGS.iter().chain(&[Feature::MeshBody, Feature::SlantedWall]) {
                allowed.remove(costly);
            }
        }
        if !REFLECTED_ROUNDS.contains(&(round % 8)) {
            for reflected in [Feature::Indirect, Feature::Total, Feature::Luminance, Feature::Glare] {
                allowed.remove(&reflected);
            }
        }
        allowed
    }
}

/// Whether a meter is in a direction for which a luminaire's table has two values.
fn has_meter_at_jump(case: &Case) -> bool {
    case.meters.values().flatten().any(|meter| inverse_square::jump(&case.scene, meter).value() > 0.0)
}

/// The state while one spec is drawn.
struct SpecGenerator<'a> {
    draw: Draw,
    allowed: &'a BTreeSet<Feature>,
    size_m: DVec3,
    files: BTreeMap<PathBuf, File>,
}

/// Rounds to a tenth of a millimetre, or to four digits in a small room, as people write lengths.
fn round_length(x: f64) -> f64 {
    table::round_to_digits(x, if x.abs() < 1.0 { 4 } else { 5 })
}

/// Rounds the coordinates of a point to micrometres.
fn round_point(point: DVec3) -> [f64; 3] {
    point.to_array().map(|x| (x * 1e6).round() / 1e6)
}

/// Rounds the components of a normal to four decimals; adding zero turns a negative zero into zero.
fn round_normal(normal: DVec3) -> [f64; 3] {
    normal.to_array().map(|x| (x * 1e4).round() / 1e4 + 0.0)
}

/// The centre of a box.
fn center_of(body: &BoxSpec) -> DVec3 {
    0.5 * (DVec3::from(body.min_m) + DVec3::from(body.max_m))
}

/// The position and orientation of a luminaire.
#[derive(Clone, Copy)]
struct LuminairePose {
    at_m: DVec3,
    turn: DMat3,
}

impl LuminairePose {
    fn from_spec(luminaire: &LuminaireSpec) -> Self {
        let RotationSpec { azimuth, tilt, roll } = luminaire.rotate_deg;
        Self { at_m: DVec3::from(luminaire.at_m.unwrap_or_default()), turn: orientation(azimuth, tilt, roll) }
    }

    /// The point at a distance along a photometric direction of the luminaire.
    fn point_along(&self, c_deg: f64, gamma_deg: f64, distance_m: f64) -> DVec3 {
        self.at_m + distance_m * (self.turn * direction(c_deg, gamma_deg))
    }

    /// The rounded normal of a meter that faces the luminaire.
    fn normal_from(&self, point_m: DVec3) -> [f64; 3] {
        round_normal((self.at_m - point_m).normalize())
    }
}

/// How bright the surfaces of a room are.
#[derive(Clone, Copy)]
struct SurfaceStyle {
    is_bright: bool,
    is_reflecting: bool,
}

impl SurfaceStyle {
    /// Draws the reflectance of a surface. A black room draws it too, so that the sequence stays
    /// the same.
    fn draw_reflectance(self, draw: &mut Draw) -> Fraction {
        let rho = if self.is_bright { draw.within(0.9, 0.97) } else { draw.within(0.0, 0.85) };
        Fraction(if self.is_reflecting { (rho * 100.0).round() / 100.0 } else { 0.0 })
    }
}

/// Draws an angle up to a largest one: a multiple of 45 degrees, one with four decimals, or a whole
/// one.
fn draw_angle_deg(draw: &mut Draw, largest_deg: f64) -> f64 {
    match draw.0.usize(0..4) {
        0 => draw.one_of(&[90.0, 45.0, -90.0, 180.0, 270.0]),
        1 => (draw.within(-largest_deg, largest_deg) * 1e4).round() / 1e4,
        _ => draw.within(-largest_deg, largest_deg).round(),
    }
}

/// Whether all steps between angles are the same.
fn is_evenly_spaced(angles: &[f64]) -> bool {
    angles.windows(2).all(|w| ((w[1] - w[0]) - (angles[1] - angles[0])).abs() < 1e-9)
}

/// A wedge as an OBJ file: five faces, of which the slanted one is parallel to no axis.
fn wedge_obj([x, y, z]: [f64; 3]) -> Vec<u8> {
    let vertices = [[0.0, 0.0, 0.0], [x, 0.0, 0.0], [x, y, 0.0], [0.0, y, 0.0], [0.0, 0.0, z], [0.0, y, z]];
    let faces = "f 4 3 2 1\nf 1 2 5\nf 4 6 3\nf 1 5 6 4\nf 2 3 6 5\n";
    (vertices.map(|[x, y, z]| format!("v {x} {y} {z}\n")).concat() + faces).into_bytes()
}

/// The point at given parts of a box's extent from its lower corner.
fn point_at_parts(body: &BoxSpec, parts: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|k| round_length(body.min_m[k] + parts[k] * (body.max_m[k] - body.min_m[k])))
}

/// A box within another one; a lifted one sticks out at the top, but not through the ceiling.
fn nested_box(outer: &BoxSpec, is_lifted: bool, ceiling_m: f64) -> BoxSpec {
    let [x, y, z] = point_at_parts(outer, [0.7, 0.7, if is_lifted { 1.3 } else { 0.7 }]);
    BoxSpec { min_m: point_at_parts(outer, [0.3; 3]), max_m: [x, y, z.min(ceiling_m)], reflectance: Fraction(0.4) }
}

impl SpecGenerator<'_> {
    /// Draws whether the spec gets a feature: one time in `one_in`, unless the round leaves it out.
    fn draw_feature(&mut self, feature: Feature, one_in: usize) -> bool {
        self.allowed.contains(&feature) && self.draw.one_in(one_in)
    }

    /// Draws a point; each coordinate lies between two parts of the room's size.
    fn draw_point(&mut self, low: f64, high: f64) -> [f64; 3] {
        self.size_m.to_array().map(|size| round_length(size * self.draw.within(low, high)))
    }

    /// Draws the whole spec with its files.
    fn draw_spec(mut self, grammar: &Grammar<'_>, name: &str) -> Draft {
        let room = self.draw_room();
        let obstacles = self.draw_obstacles();
        let luminaires = self.draw_luminaires();
        let meters = self.draw_meters(&luminaires, &obstacles);
        let procedures = self.draw_procedures(&luminaires, &meters);
        let spec = Spec {
            unit: LengthUnit::M,
            luxproof: 1,
            title: Some(format!("{name} of a hunt")),
            room,
            obstacles,
            luminaires,
            meters,
            procedures,
            engines: Some(self.draw_engines(grammar.engines)),
            budget: grammar.budget,
            published: None,
            tolerances: BTreeMap::new(),
            hidden_variant: None,
            cases: None,
            compare: None,
        };
        Draft { spec, files: self.files }.without_unused_files()
    }

    /// Draws a room: a box or a polygon, with its reflectances.
    fn draw_room(&mut self) -> RoomSpec {
        let scale = if self.draw_feature(Feature::TinyRoom, 6) {
            self.draw.magnitude(0.01, 0.15)
        } else if self.draw_feature(Feature::HugeRoom, 6) {
            self.draw.magnitude(15.0, 300.0)
        } else {
            1.0
        };
        let size = [self.draw.within(2.5, 9.0), self.draw.within(2.5, 9.0), self.draw.within(2.2, 5.0)];
        let mut size = size.map(|x| round_length(scale * x));
        if self.draw_feature(Feature::FlatRoom, 6) {
            size[self.draw.0.usize(0..3)] *= 0.05;
            size = size.map(round_length);
        }
        self.size_m = DVec3::from(size);
        let is_bright = self.draw_feature(Feature::BrightRoom, 3);
        let is_reflecting = self.draw_feature(Feature::Reflecting, 1);
        let style = SurfaceStyle { is_bright, is_reflecting };
        let [floor, ceiling, all] = [(); 3].map(|()| style.draw_reflectance(&mut self.draw));
        if let Some(corners) = self.draw_floor() {
            let walls = if self.draw_feature(Feature::UnequalWalls, 2) {
                Walls::Listed(corners.iter().map(|_| style.draw_reflectance(&mut self.draw)).collect())
            } else {
                Walls::All(all)
            };
            let reflectance = Some(ReflectanceSpec { floor, walls, ceiling });
            return RoomSpec { floor_m: Some(corners), height_m: Some(size[2]), reflectance, ..RoomSpec::default() };
        }
        let walls = if self.draw_feature(Feature::UnequalWalls, 2) {
            let [x_min, x_max, y_min, y_max] = [(); 4].map(|()| style.draw_reflectance(&mut self.draw));
            Walls::Each(FourWalls { x_min, x_max, y_min, y_max })
        } else {
            Walls::All(all)
        };
        RoomSpec::cuboid(size, ReflectanceSpec { floor, walls, ceiling })
    }

    /// Draws the corners of an L, mirrored at random, or of a box with one corner cut off.
    fn draw_floor(&mut self) -> Option<Vec<[f64; 2]>> {
        if !self.draw_feature(Feature::PolygonRoom, 3) {
            return None;
        }
        let [x, y] = [self.size_m.x, self.size_m.y];
        let [a, b] = [x, y].map(|size| round_length(size * self.draw.within(0.3, 0.8)));
        let corner = if self.draw_feature(Feature::SlantedWall, 2) {
            vec![[x, b], [a, y]]
        } else {
            vec![[x, b], [a, b], [a, y]]
        };
        let floor = [[0.0, 0.0], [x, 0.0]].into_iter().chain(corner).chain([[0.0, y]]);
        let [over_x, over_y] = [(); 2].map(|()| self.draw.one_in(2));
        let turned =
            floor.map(|[p, q]| [if over_x { x - p } else { p }, if over_y { y - q } else { q }].map(round_length));
        Some(turned.collect())
    }

    /// Draws boxes, sometimes one within another, and a mesh.
    fn draw_obstacles(&mut self) -> Vec<ObstacleSpec> {
        let mut boxes: Vec<BoxSpec> = vec![];
        if self.draw_feature(Feature::BoxBody, 2) {
            let count = if self.draw_feature(Feature::ManyBodies, 2) { 6 } else { self.draw.0.usize(1..3) };
            boxes.extend((0..count).map(|_| self.draw_body()));
            if self.draw_feature(Feature::NestedBodies, 2) {
                let is_lifted = self.draw.one_in(2);
                boxes.push(nested_box(&boxes[0], is_lifted, self.size_m.z));
            }
        }
        let mut all: Vec<ObstacleSpec> =
            boxes.into_iter().map(|cuboid| ObstacleSpec { cuboid: Some(cuboid), mesh: None }).collect();
        if self.draw_feature(Feature::MeshBody, 3) {
            let size_m = (self.size_m * 0.2).to_array().map(round_length);
            self.files.insert("wedge.obj".into(), File { bytes: wedge_obj(size_m), photometry: None });
            let at_m = self.draw_point(0.05, 0.75);
            let mesh = MeshSpec { file: "wedge.obj".into(), at_m, reflectance: Fraction(0.3) };
            all.push(ObstacleSpec { cuboid: None, mesh: Some(mesh) });
        }
        all
    }

    /// Draws a box, sometimes a thin one or one that touches a surface of the room.
    fn draw_body(&mut self) -> BoxSpec {
        let mut low = self.draw_point(0.05, 0.65);
        let extent = DVec3::from(self.draw_point(0.05, 0.3));
        let mut high = (DVec3::from(low) + extent).to_array().map(round_length);
        if self.draw_feature(Feature::BodyOnSurface, 2) {
            let axis = self.draw.0.usize(0..3);
            [low[axis], high[axis]] = if self.draw.one_in(2) {
                [0.0, round_length(extent[axis])]
            } else {
                [round_length(self.size_m[axis] - extent[axis]), self.size_m[axis]]
            };
        }
        if self.draw_feature(Feature::ThinBody, 3) {
            let axis = self.draw.0.usize(0..3);
            let thick = round_length(self.size_m[axis] * self.draw.magnitude(1e-4, 2e-3));
            if high[axis] == self.size_m[axis] {
                low[axis] = high[axis] - thick;
            } else {
                high[axis] = low[axis] + thick;
            }
        }
        BoxSpec { min_m: low, max_m: high, reflectance: Fraction((self.draw.within(0.0, 0.8) * 100.0).round() / 100.0) }
    }

    /// Draws luminaires with their files, positions, rotations and fluxes.
    fn draw_luminaires(&mut self) -> Vec<LuminaireSpec> {
        let count = if self.draw_feature(Feature::ManyLuminaires, 4) {
            self.draw.0.usize(5..12)
        } else if self.draw_feature(Feature::SeveralLuminaires, 2) {
            self.draw.0.usize(2..4)
        } else {
            1
        };
        let mut all: Vec<LuminaireSpec> = vec![];
        for k in 0..count {
            let (photometry, model) = match all.last() {
                Some(last) if count >= 5 || self.draw_feature(Feature::SharedFile, 2) => {
                    (last.photometry.clone(), last.model)
                }
                _ => self.draw_photometric_file(k),
            };
            let mut at_m = self.draw_point(0.15, 0.85);
            let [low, high] = if self.draw_feature(Feature::LowLuminaire, 4) { [0.05, 0.5] } else { [0.55, 0.9] };
            at_m[2] = round_length(self.size_m.z * self.draw.within(low, high));
            let axis = self.draw.0.usize(0..3);
            if self.draw_feature(Feature::Recessed, 5) {
                at_m[2] = self.size_m.z;
            } else if self.draw_feature(Feature::LuminaireNearSurface, 4) && model == ModelSpec::Point {
                let gap_m = self.draw.magnitude(1e-3, 0.05) * self.size_m[axis].min(1.0);
                at_m[axis] = round_length(if self.draw.one_in(2) { gap_m } else { self.size_m[axis] - gap_m });
            } else if let Some(last) = all.last().filter(|_| self.allowed.contains(&Feature::SameSpot)).cloned()
                && self.draw.one_in(6)
            {
                at_m = last.at_m.unwrap_or(at_m);
            }
            let is_recessed = at_m[2] == self.size_m.z;
            let flux_scale = if self.draw_feature(Feature::Off, 8) {
                0.0
            } else if self.draw_feature(Feature::Dimmed, 2) {
                round_length(self.draw.magnitude(0.01, 3.0))
            } else {
                1.0
            };
            let rotate_deg = self.draw_rotation(is_recessed);
            all.push(LuminaireSpec {
                id: format!("l{k}"),
                photometry,
                at_m: Some(at_m),
                array: None,
                rotate_deg,
                flux_scale,
                model,
                face_reflectance: Fraction(0.0),
            });
        }
        all
    }

    /// Draws a rotation; a recessed luminaire has no tilt.
    fn draw_rotation(&mut self, is_recessed: bool) -> RotationSpec {
        let azimuth = if self.draw_feature(Feature::Azimuth, 2) { draw_angle_deg(&mut self.draw, 360.0) } else { 0.0 };
        let roll = if self.draw_feature(Feature::Roll, 2) { draw_angle_deg(&mut self.draw, 180.0) } else { 0.0 };
        let tilt = if is_recessed {
            0.0
        } else if self.draw_feature(Feature::UpsideDown, 4) {
            180.0
        } else if self.draw_feature(Feature::Tilt, 2) {
            draw_angle_deg(&mut self.draw, 120.0)
        } else {
            0.0
        };
        RotationSpec { azimuth, tilt, roll }
    }

    /// Draws a photometric file, and the model of the luminaires that use it.
    fn draw_photometric_file(&mut self, k: usize) -> (PathBuf, ModelSpec) {
        let opening = self.draw_opening();
        let model = if opening == LuminousOpening::Point { ModelSpec::Point } else { ModelSpec::Area };
        for (feature, kind) in [(Feature::TypeA, Goniometer::A), (Feature::TypeB, Goniometer::B)] {
            if model == ModelSpec::Point && self.allowed.contains(&feature) && self.draw.one_in(8) {
                let text = table::draw_lm63_of_type(&mut self.draw, kind);
                return (self.add_lm63(format!("l{k}.ies"), text), model);
            }
        }
        let distribution = table::draw_distribution(&mut self.draw, self.allowed);
        let opening = if opening == LuminousOpening::Point { self.draw_file_size() } else { opening };
        let photometry = Photometry { opening, ..Photometry::of(distribution) };
        let table = &photometry.distribution;
        // EULUMDAT knows only these openings, and one step between C planes.
        let suits = matches!(opening, LuminousOpening::Point | LuminousOpening::Box { .. });
        if suits && is_evenly_spaced(table.c_deg()) && self.draw_feature(Feature::Eulumdat, 2) {
            let bytes = eulumdat::write(&photometry).text.into_bytes();
            let name = PathBuf::from(format!("l{k}.ldt"));
            self.files.insert(name.clone(), File { photometry: eulumdat::parse(&bytes).ok(), bytes });
            return (name, model);
        }
        (self.add_lm63(format!("l{k}.ies"), lm63::write_2002(&photometry).text), model)
    }

    /// Adds an LM-63 file to the spec and returns its path.
    fn add_lm63(&mut self, name: String, text: String) -> PathBuf {
        self.files.insert(name.clone().into(), File::from_lm63(text.into_bytes()));
        name.into()
    }

    /// Draws the size in the file of a point luminaire, from which glare and luminance are
    /// computed.
    fn draw_file_size(&mut self) -> LuminousOpening {
        let is_looked_at = [Feature::OpeningLuminance, Feature::Glare].iter().any(|f| self.allowed.contains(f));
        if !is_looked_at || !self.draw.one_in(2) {
            return LuminousOpening::Point;
        }
        LuminousOpening::Box { x_m: self.draw_extent(), y_m: self.draw_extent(), height_m: 0.0 }
    }

    /// Draws one side of a luminous opening.
    fn draw_extent(&mut self) -> f64 {
        round_length(0.1 * self.size_m.min_element() * self.draw.magnitude(0.2, 2.5))
    }

    /// Draws the luminous opening of a file.
    fn draw_opening(&mut self) -> LuminousOpening {
        let allowed: Vec<Feature> = OPENINGS.into_iter().filter(|f| self.allowed.contains(f)).collect();
        if allowed.is_empty() || !self.draw.one_in(3) {
            return LuminousOpening::Point;
        }
        let (x_m, y_m, z_m) = (self.draw_extent(), self.draw_extent(), self.draw_extent());
        let draw = &mut self.draw;
        match draw.one_of(&allowed) {
            Feature::FlatOpening => LuminousOpening::Box { x_m, y_m, height_m: 0.0 },
            Feature::BoxOpening => LuminousOpening::Box { x_m, y_m, height_m: z_m },
            Feature::RoundOpening if draw.one_in(2) => LuminousOpening::Ellipse { x_m, y_m: x_m, height_m: 0.0 },
            Feature::RoundOpening => LuminousOpening::Ellipse { x_m, y_m, height_m: 0.0 },
            Feature::UprightCylinder => LuminousOpening::Ellipse { x_m, y_m: x_m, height_m: z_m },
            Feature::Ellipsoid if draw.one_in(2) => LuminousOpening::Ellipsoid { x_m, y_m, z_m },
            Feature::Ellipsoid => LuminousOpening::Ellipsoid { x_m, y_m: x_m, z_m: x_m },
            _ => {
                let axis = draw.one_of(&[HorizontalAxis::X, HorizontalAxis::Y]);
                LuminousOpening::LyingCylinder { axis, length_m: x_m, diameter_m: y_m }
            }
        }
    }

    /// Draws all sets of meters.
    fn draw_meters(&mut self, luminaires: &[LuminaireSpec], bodies: &[ObstacleSpec]) -> BTreeMap<String, MeterSet> {
        let mut sets = BTreeMap::new();
        let plane = self.draw_plain_meters();
        sets.insert("m0".to_owned(), plane);
        for k in 1..=self.draw.0.usize(1..4) {
            let (points, normal) = self.draw_special_meters(luminaires, bodies);
            sets.insert(
                format!("m{k}"),
                MeterSet { points_m: Some(points), normal: Some(normal), ..MeterSet::default() },
            );
        }
        if self.allowed.contains(&Feature::Luminance) {
            // A millimetre over the floor, or less in a small room.
            let [x, y, _] = self.draw_point(0.05, 0.95);
            let points_m = Some(vec![[x, y, 0.001_f64.min(1e-3 * self.size_m.z)]]);
            sets.insert(
                ON_FLOOR.to_owned(),
                MeterSet { points_m, normal: Some([0.0, 0.0, 1.0]), ..MeterSet::default() },
            );
        }
        if self.allowed.contains(&Feature::Glare) {
            let at = DVec3::from(luminaires[0].at_m.unwrap_or_default());
            let mut eye = self.draw_point(0.05, 0.95);
            eye[2] = round_length(0.4 * self.size_m.z);
            let ahead = (at - DVec3::from(eye)).truncate().normalize_or(glam::DVec2::X).extend(0.0);
            let normal = Some(round_normal(ahead));
            sets.insert(EYES.to_owned(), MeterSet { points_m: Some(vec![eye]), normal, ..MeterSet::default() });
        }
        sets
    }

    /// Draws a grid or a few points anywhere in the room.
    fn draw_plain_meters(&mut self) -> MeterSet {
        let normal = self.draw_normal();
        if self.draw_feature(Feature::Grid, 3) {
            let counts = if self.draw_feature(Feature::ManyMeters, 3) { [6, 5] } else { [3, 2] };
            let [x, y, z] = (self.size_m * 0.1).to_array();
            let (u, v) = (0.8 * self.size_m.x / counts[0] as f64, 0.8 * self.size_m.y / counts[1] as f64);
            let (u, v) = (round_length(u), round_length(v));
            let origin_m = [round_length(x), round_length(y), round_length(z * self.draw.within(0.5, 4.0))];
            let grid = GridSpec { origin_m, u_m: [u, 0.0, 0.0], v_m: [0.0, v, 0.0], counts };
            return MeterSet { grid: Some(grid), normal: Some(normal), ..MeterSet::default() };
        }
        let points = (0..self.draw.0.usize(2..6)).map(|_| self.draw_point(0.03, 0.97)).collect();
        MeterSet { points_m: Some(points), normal: Some(normal), ..MeterSet::default() }
    }

    /// Draws the normal of a set of meters.
    fn draw_normal(&mut self) -> [f64; 3] {
        let axis = self.draw.one_of(&DVec3::AXES);
        let towards = if self.draw.one_in(2) { axis } else { -axis };
        let normal = if self.draw_feature(Feature::SkewNormal, 3) {
            DVec3::from([(); 3].map(|()| (self.draw.within(-1.0, 1.0) * 100.0).round() / 100.0)) + 0.01 * towards
        } else if self.draw.one_in(2) {
            DVec3::Z
        } else {
            towards
        };
        (if self.draw_feature(Feature::LongNormal, 4) { normal * 7.0 } else { normal })
            .to_array()
            .map(|x| round_length(x) + 0.0)
    }

    /// Draws one or two points where something may go wrong, with their normal.
    fn draw_special_meters(
        &mut self,
        luminaires: &[LuminaireSpec],
        bodies: &[ObstacleSpec],
    ) -> (Vec<[f64; 3]>, [f64; 3]) {
        let lamp = &luminaires[self.draw.0.usize(0..luminaires.len())];
        let pose = LuminairePose::from_spec(lamp);
        let reach_m = REACH_SIDES * self.size_m.min_element();
        let close_m = self.draw.close_m() * self.size_m.min_element().min(1.0);
        let body = bodies.iter().find_map(|b| b.cuboid.as_ref());
        match self.draw.0.usize(0..9) {
            0 if self.allowed.contains(&Feature::OnAxis) => {
                let p = pose.point_along(0.0, 0.0, self.draw.within(0.3, 1.0) * reach_m);
                (vec![round_point(p)], pose.normal_from(p))
            }
            1 if self.allowed.contains(&Feature::OnPlaneOfTable) => {
                let c = self.draw.one_of(&[0.0, 90.0, 180.0, 270.0]);
                let gamma = self.draw.within(10.0, 85.0).round();
                let p = pose.point_along(c, gamma, reach_m);
                let opposite = pose.point_along(c + 180.0, gamma, 0.7 * reach_m);
                (vec![round_point(p), round_point(opposite)], pose.normal_from(p))
            }
            2 if self.allowed.contains(&Feature::Grazing) => {
                let p = pose.point_along(self.draw.within(0.0, 360.0), self.draw.within(60.0, 89.7), reach_m);
                let ray = (pose.at_m - p).normalize();
                let across = ray.cross(DVec3::new(0.36, 0.48, 0.8)).normalize();
                (vec![round_point(p)], round_normal(across + self.draw.magnitude(1e-3, 0.04) * ray))
            }
            3 if self.allowed.contains(&Feature::LooksAway) => {
                let p = self.draw_point(0.1, 0.9);
                (vec![p], round_normal((DVec3::from(p) - pose.at_m).normalize()))
            }
            4 if self.allowed.contains(&Feature::NearBody) => {
                let Some(body) = body else {
                    return (vec![self.draw_point(0.1, 0.9)], [0.0, 0.0, 1.0]);
                };
                let (max_m, center) = (body.max_m, center_of(body));
                let at_side = DVec3::new(max_m[0] + close_m, center.y, center.z);
                let on_top = DVec3::new(center.x, center.y, max_m[2] + close_m);
                (vec![round_point(at_side), round_point(on_top)], [0.0, 0.0, 1.0])
            }
            5 if self.allowed.contains(&Feature::NearSurface) => {
                let mut p = self.draw_point(0.1, 0.9);
                let axis = self.draw.0.usize(0..3);
                let mut normal = DVec3::ZERO;
                let is_far = self.draw.one_in(2);
                p[axis] = if is_far { self.size_m[axis] - close_m } else { close_m };
                normal[axis] = if is_far { -1.0 } else { 1.0 };
                (vec![round_point(p.into())], normal.to_array().map(|x| x + 0.0))
            }
            6 if self.allowed.contains(&Feature::NearLuminaire) && lamp.model == ModelSpec::Point => {
                let p = pose.point_along(
                    self.draw.within(0.0, 360.0),
                    self.draw.within(0.0, 90.0),
                    self.draw.magnitude(MIN_DISTANCE_REACHES, 0.2) * reach_m,
                );
                (vec![round_point(p)], pose.normal_from(p))
            }
            7 if self.allowed.contains(&Feature::BodyBehindLuminaire)
                || self.allowed.contains(&Feature::BodyBehindMeter) =>
            {
                let Some(body) = body else {
                    return (vec![self.draw_point(0.1, 0.9)], [0.0, 0.0, 1.0]);
                };
                let from_body = pose.at_m - center_of(body);
                // Both are drawn, whichever is used, so that the sequence does not depend on the
                // features.
                let beyond = pose.at_m + self.draw.within(0.3, 1.0) * reach_m * from_body.normalize_or(DVec3::Z);
                let between = pose.at_m - self.draw.within(0.2, 0.4) * from_body;
                let p = if self.allowed.contains(&Feature::BodyBehindLuminaire) { beyond } else { between };
                (vec![round_point(p)], pose.normal_from(p))
            }
            _ => {
                let p = self.draw_point(0.05, 0.95);
                (vec![p, self.draw_point(0.05, 0.95)], pose.normal_from(p.into()))
            }
        }
    }

    /// Whether the file of a luminaire gives its opening a size.
    fn has_opening_size(&self, luminaire: &LuminaireSpec) -> bool {
        let photometry = self.files.get(&luminaire.photometry).and_then(|file| file.photometry.as_ref());
        photometry.is_some_and(|p| p.opening != LuminousOpening::Point)
    }

    /// Draws the procedures. Direct illuminance is always one of them, because all laws apply to it.
    fn draw_procedures(&mut self, luminaires: &[LuminaireSpec], meters: &BTreeMap<String, MeterSet>) -> Procedures {
        let names = Names::Many(meters.keys().cloned().collect());
        let direct = ask_at_meters(names.clone(), Bounces::Converged, AnyLight::Total);
        let mut all = BTreeMap::from([(ProcedureId::DirectIlluminance, direct)]);
        if self.draw_feature(Feature::Intensity, 3) {
            let luminaire = luminaires[0].id.clone();
            let listed = AngleLists { gamma_deg: vec![0.0, 30.0, 62.5, 90.0], c_deg: vec![0.0, 45.0, 200.0] };
            let whole = self.files.get(&luminaires[0].photometry).and_then(|f| f.photometry.as_ref());
            let is_small = whole.is_some_and(|p| p.distribution.c_deg().len() * p.distribution.gamma_deg().len() < 200);
            let angles = if !is_small || self.draw_feature(Feature::ListedAngles, 2) {
                Angles::Listed(listed)
            } else {
                Angles::Photometry
            };
            let distance_m = round_length(self.draw.magnitude(0.5, 50.0));
            all.insert(
                ProcedureId::LuminousIntensity,
                ProcedureRequest::Angles(AtAngles { luminaire, distance_m, angles }),
            );
        }
        let few = self.draw_feature(Feature::FewBounces, 2);
        let bounces = if few { Bounces::AtMost(self.draw.one_of(&[1, 2, 3])) } else { Bounces::Converged };
        if self.draw_feature(Feature::Cylindrical, 4) {
            let direct = ask_at_meters(names.clone(), Bounces::Converged, AnyLight::Direct);
            all.insert(ProcedureId::CylindricalIlluminance, direct);
        }
        if self.allowed.contains(&Feature::Indirect) {
            all.insert(ProcedureId::IndirectIlluminance, ask_at_meters(names.clone(), bounces, AnyLight::Total));
        }
        if self.draw_feature(Feature::Total, 2) {
            all.insert(ProcedureId::TotalIlluminance, ask_at_meters(names.clone(), bounces, AnyLight::Total));
        }
        let has_first = self.has_opening_size(&luminaires[0]);
        // Glare needs the size of every luminaire.
        let has_each = luminaires.iter().all(|l| self.has_opening_size(l));
        for (procedure, set) in [(ProcedureId::Luminance, ON_FLOOR), (ProcedureId::UnifiedGlareRating, EYES)] {
            if meters.contains_key(set) && (has_each || procedure != ProcedureId::UnifiedGlareRating) {
                all.insert(procedure, ask_at_meters(Names::One(set.to_owned()), bounces, AnyLight::Total));
            }
        }
        if has_first && self.draw_feature(Feature::OpeningLuminance, 2) {
            let asked = AtOpening { luminaire: luminaires[0].id.clone(), meters: names };
            all.insert(ProcedureId::OpeningLuminance, ProcedureRequest::Opening(asked));
        }
        Procedures(all)
    }

    /// Returns the hunted engines, each sometimes with a random preset where its settings name
    /// none.
    fn draw_engines(&mut self, hunted: &Engines) -> BTreeMap<String, EngineSettings> {
        hunted.iter().map(|(name, settings)| (name.to_string(), self.draw_preset(name, settings))).collect()
    }

    /// Adds a random preset to the settings of an engine, sometimes, where the engine has presets
    /// and the settings name none.
    fn draw_preset(&mut self, name: &EngineName, settings: &EngineSettings) -> EngineSettings {
        let mut settings = settings.clone();
        let engine = luxproof_engines::entry(name).map(|entry| (entry.make)());
        let setting = engine.and_then(|engine| engine.settings().iter().find(|k| k.key == "preset"));
        if let Some(setting) = setting.filter(|setting| !settings.0.contains_key(setting.key))
            && self.draw_feature(Feature::Preset, 2)
        {
            settings.0.insert(setting.key.to_owned(), self.draw.one_of(setting.values).into());
        }
        settings
    }
}

/// A request for readings at sets of meters.
fn ask_at_meters(meters: Names, bounces: Bounces, light: AnyLight) -> ProcedureRequest {
    ProcedureRequest::Meters(AtMeters { meters, bounces, light })
}

/// A table with one luminous intensity in all directions between two angles.
pub(super) fn constant_table(gamma_deg: [f64; 2], candela: f64) -> Option<LuminousIntensityDistribution> {
    LuminousIntensityDistribution::axial(gamma_deg.to_vec(), vec![candela; 2]).ok()
}
