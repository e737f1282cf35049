//! Specs at random: a typed grammar over what a spec can say, biased towards edges. Spec `n` of a seed is always the same one.
//!
//! Each round leaves out a random half of what there is (swarm testing: Groce et al., ISSTA 2012): what is always there hides what shows
//! without it alone.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use fastrand::Rng;
use glam::DVec3;
use luminaire::calculators::inverse_square;
use luminaire::photometry::{
    Goniometer, HorizontalAxis, LuminousIntensityDistribution, LuminousOpening, Photometry, direction, eulumdat, lm63,
};
use luminaire::scene::{Bounces, orientation};
use strum::VariantArray;

use super::draft::{Draft, File};
use super::feature::{Feature, features};
use super::table;
use crate::engines;
use crate::experiments::draw::Draw;
use crate::procedures::{AngleLists, Angles, AnyLight, Asked, AtAngles, AtMeters, AtOpening, Names, Procedures};
use crate::record::{EngineName, ProcedureId};
use crate::spec::model::{
    BoxSpec, FourWalls, Fraction, GridSpec, LuminaireSpec, MeshSpec, MeterSet, ModelSpec, ObstacleSpec,
    ReflectanceSpec, RoomSpec, RotationSpec, Walls,
};
use crate::spec::{Budget, Case, EngineSettings, Spec};
use crate::system::random;

/// Specs of a round, which leave out the same.
pub(super) const ROUND: u64 = 8;
/// Of eight rounds these have reflected light, which costs ten times as much: one with openings, one without.
const REFLECTED: [u64; 2] = [2, 7];
/// A spec that its reader refuses, a meter within a body say, is drawn anew this often.
const ATTEMPTS: u64 = 40;
/// One in so many specs may have a meter where a luminaire's table has two values, so that whoever reads either is right and nothing is decided.
const WITH_JUMPS: u64 = 16;
/// No meter is nearer to a luminaire than this part of .3 of the room's shortest side, a centimetre or less: nearer, the patches of renderers of
/// 32-bit floats are as wide as what they look at, and say so.
const NEAREST: f64 = 1e-2;
/// Marks of independent sequences of random numbers.
const OF_ROUNDS: u64 = 0x1001;
const OF_SPECS: u64 = 0x1002;

/// The sets of meters that luminance and glare are asked of.
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

/// What hunted engines are: by name, with the settings that specs give them.
pub(super) type Engines = BTreeMap<EngineName, EngineSettings>;

pub(super) struct Grammar<'a> {
    pub(super) seed: u64,
    pub(super) engines: &'a Engines,
    /// Of each spec.
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
    /// The `n`-th spec of the sequence; `None` where none of many attempts was one.
    pub(super) fn spec(&self, n: u64) -> Option<Generated> {
        let allowed = self.allowed(n / ROUND);
        (0..ATTEMPTS).find_map(|attempt| {
            let seed = random::seed(&[OF_SPECS, self.seed, n, attempt]);
            let name = format!("h{}-{n}", self.seed);
            let draw = Draw(Rng::with_seed(u64::from(seed)));
            let draft = One { draw, allowed: &allowed, size_m: DVec3::ONE, files: BTreeMap::new() }.spec(self, &name);
            let case = draft.case().filter(|case| n.is_multiple_of(WITH_JUMPS) || !meets_a_jump(case))?;
            let features = features(&draft, &case);
            Some(Generated { name, draft, case, features })
        })
    }

    /// What a round does not leave out.
    fn allowed(&self, round: u64) -> BTreeSet<Feature> {
        let mut rng = Rng::with_seed(u64::from(random::seed(&[OF_ROUNDS, self.seed, round])));
        let mut allowed: BTreeSet<Feature> = Feature::VARIANTS.iter().copied().filter(|_| rng.bool()).collect();
        // Every other round has points and boxes alone, which every engine reads, and quickly.
        if round.is_multiple_of(2) {
            for costly in OPENINGS.iter().chain(&[Feature::MeshBody, Feature::SlantedWall]) {
                allowed.remove(costly);
            }
        }
        if !REFLECTED.contains(&(round % 8)) {
            for reflected in [Feature::Indirect, Feature::Total, Feature::Luminance, Feature::Glare] {
                allowed.remove(&reflected);
            }
        }
        allowed
    }
}

fn meets_a_jump(case: &Case) -> bool {
    let meters = || case.meters.values().flatten();
    meters().any(|meter| inverse_square::jump(&case.scene, meter).value() > 0.0)
}

/// One spec in the making.
struct One<'a> {
    draw: Draw,
    allowed: &'a BTreeSet<Feature>,
    size_m: DVec3,
    files: BTreeMap<PathBuf, File>,
}

/// To a tenth of a millimetre, or to four digits in a small room: what people write.
fn rounded(x: f64) -> f64 {
    table::to_digits(x, if x.abs() < 1.0 { 4 } else { 5 })
}

impl One<'_> {
    /// Whether something is to be had here: in one of so many cases, unless the round leaves it out.
    fn has(&mut self, feature: Feature, one_in: usize) -> bool {
        self.allowed.contains(&feature) && self.draw.one_in(one_in)
    }

    fn point(&mut self, low: f64, high: f64) -> [f64; 3] {
        let mut along = |size: f64| rounded(size * self.draw.within(low, high));
        let DVec3 { x, y, z } = self.size_m;
        [along(x), along(y), along(z)]
    }

    fn spec(mut self, grammar: &Grammar<'_>, name: &str) -> Draft {
        let room = self.room();
        let obstacles = self.obstacles();
        let luminaires = self.luminaires();
        let meters = self.meters(&luminaires, &obstacles);
        let procedures = self.procedures(&luminaires, &meters);
        let spec = Spec {
            luxproof: 1,
            title: Some(format!("{name} of a hunt")),
            room,
            obstacles,
            luminaires,
            meters,
            procedures,
            engines: Some(self.engines(grammar.engines)),
            budget: grammar.budget,
            published: None,
            tolerances: BTreeMap::new(),
            cases: None,
            compare: None,
        };
        Draft { spec, files: self.files }.tidied()
    }

    fn room(&mut self) -> RoomSpec {
        let scale = if self.has(Feature::TinyRoom, 6) {
            self.draw.magnitude(0.01, 0.15)
        } else if self.has(Feature::HugeRoom, 6) {
            self.draw.magnitude(15.0, 300.0)
        } else {
            1.0
        };
        let size = [self.draw.within(2.5, 9.0), self.draw.within(2.5, 9.0), self.draw.within(2.2, 5.0)];
        let mut size = size.map(|x| rounded(scale * x));
        if self.has(Feature::FlatRoom, 6) {
            size[self.draw.0.usize(0..3)] *= 0.05;
            size = size.map(rounded);
        }
        self.size_m = DVec3::from(size);
        let bright = self.has(Feature::BrightRoom, 3);
        let reflects = self.has(Feature::Reflecting, 1);
        let rho = |draw: &mut Draw| {
            let rho = if bright { draw.within(0.9, 0.97) } else { draw.within(0.0, 0.85) };
            Fraction(if reflects { (rho * 100.0).round() / 100.0 } else { 0.0 })
        };
        let (floor, ceiling, all) = (rho(&mut self.draw), rho(&mut self.draw), rho(&mut self.draw));
        if let Some(corners) = self.floor() {
            let each = self.has(Feature::UnequalWalls, 2);
            let listed = |draw: &mut Draw| Walls::Listed(corners.iter().map(|_| rho(draw)).collect());
            let walls = if each { listed(&mut self.draw) } else { Walls::All(all) };
            let reflectance = Some(ReflectanceSpec { floor, walls, ceiling });
            return RoomSpec { floor_m: Some(corners), height_m: Some(size[2]), reflectance, ..RoomSpec::default() };
        }
        let walls = if self.has(Feature::UnequalWalls, 2) {
            let [x_min, x_max, y_min, y_max] = [(); 4].map(|()| rho(&mut self.draw));
            Walls::Each(FourWalls { x_min, x_max, y_min, y_max })
        } else {
            Walls::All(all)
        };
        RoomSpec::cuboid(size, ReflectanceSpec { floor, walls, ceiling })
    }

    /// Corners of an L within the size, turned any way, or of a box of which a corner is cut off.
    fn floor(&mut self) -> Option<Vec<[f64; 2]>> {
        if !self.has(Feature::PolygonRoom, 3) {
            return None;
        }
        let [x, y] = [self.size_m.x, self.size_m.y];
        let [a, b] = [x, y].map(|size| rounded(size * self.draw.within(0.3, 0.8)));
        let corner =
            if self.has(Feature::SlantedWall, 2) { vec![[x, b], [a, y]] } else { vec![[x, b], [a, b], [a, y]] };
        let floor = [[0.0, 0.0], [x, 0.0]].into_iter().chain(corner).chain([[0.0, y]]);
        let [over_x, over_y] = [(); 2].map(|()| self.draw.one_in(2));
        let turned = floor.map(|[p, q]| [if over_x { x - p } else { p }, if over_y { y - q } else { q }].map(rounded));
        Some(turned.collect())
    }

    fn obstacles(&mut self) -> Vec<ObstacleSpec> {
        let mut boxes: Vec<BoxSpec> = vec![];
        if self.has(Feature::BoxBody, 2) {
            let count = if self.has(Feature::ManyBodies, 2) { 6 } else { self.draw.0.usize(1..3) };
            boxes.extend((0..count).map(|_| self.body()));
            if self.has(Feature::NestedBodies, 2) {
                let BoxSpec { min_m: low, max_m: high, .. } = boxes[0];
                let inner = |k: usize, part: f64| rounded(low[k] + part * (high[k] - low[k]));
                let lifted = if self.draw.one_in(2) { 1.3 } else { 0.7 };
                let max_m = [inner(0, 0.7), inner(1, 0.7), inner(2, lifted).min(self.size_m.z)];
                boxes.push(BoxSpec {
                    min_m: [inner(0, 0.3), inner(1, 0.3), inner(2, 0.3)],
                    max_m,
                    reflectance: Fraction(0.4),
                });
            }
        }
        let mut all: Vec<ObstacleSpec> =
            boxes.into_iter().map(|cuboid| ObstacleSpec { cuboid: Some(cuboid), mesh: None }).collect();
        if self.has(Feature::MeshBody, 3) {
            // A wedge: five faces, of which the slanted one meets no axis.
            let [x, y, z] = (self.size_m * 0.2).to_array().map(rounded);
            let vertices = [[0.0, 0.0, 0.0], [x, 0.0, 0.0], [x, y, 0.0], [0.0, y, 0.0], [0.0, 0.0, z], [0.0, y, z]];
            let vertex = |[x, y, z]: [f64; 3]| format!("v {x} {y} {z}\n");
            let faces = "f 4 3 2 1\nf 1 2 5\nf 4 6 3\nf 1 5 6 4\nf 2 3 6 5\n";
            let bytes = (vertices.map(vertex).concat() + faces).into_bytes();
            self.files.insert("wedge.obj".into(), File { bytes, photometry: None });
            let at_m = self.point(0.05, 0.75);
            let mesh = MeshSpec { file: "wedge.obj".into(), at_m, reflectance: Fraction(0.3) };
            all.push(ObstacleSpec { cuboid: None, mesh: Some(mesh) });
        }
        all
    }

    fn body(&mut self) -> BoxSpec {
        let mut low = self.point(0.05, 0.65);
        let extent = DVec3::from(self.point(0.05, 0.3));
        let mut high = (DVec3::from(low) + extent).to_array().map(rounded);
        if self.has(Feature::BodyOnSurface, 2) {
            let axis = self.draw.0.usize(0..3);
            [low[axis], high[axis]] = if self.draw.one_in(2) {
                [0.0, rounded(extent[axis])]
            } else {
                [rounded(self.size_m[axis] - extent[axis]), self.size_m[axis]]
            };
        }
        if self.has(Feature::ThinBody, 3) {
            let axis = self.draw.0.usize(0..3);
            let thick = rounded(self.size_m[axis] * self.draw.magnitude(1e-4, 2e-3));
            if high[axis] == self.size_m[axis] {
                low[axis] = high[axis] - thick;
            } else {
                high[axis] = low[axis] + thick;
            }
        }
        BoxSpec { min_m: low, max_m: high, reflectance: Fraction((self.draw.within(0.0, 0.8) * 100.0).round() / 100.0) }
    }

    fn luminaires(&mut self) -> Vec<LuminaireSpec> {
        let count = if self.has(Feature::ManyLuminaires, 4) {
            self.draw.0.usize(5..12)
        } else if self.has(Feature::SeveralLuminaires, 2) {
            self.draw.0.usize(2..4)
        } else {
            1
        };
        let mut all: Vec<LuminaireSpec> = vec![];
        for k in 0..count {
            let (photometry, model) = match all.last() {
                Some(last) if count >= 5 || self.has(Feature::SharedFile, 2) => (last.photometry.clone(), last.model),
                _ => self.photometric_file(k),
            };
            let mut at_m = self.point(0.15, 0.85);
            let [low, high] = if self.has(Feature::LowLuminaire, 4) { [0.05, 0.5] } else { [0.55, 0.9] };
            at_m[2] = rounded(self.size_m.z * self.draw.within(low, high));
            let axis = self.draw.0.usize(0..3);
            if self.has(Feature::Recessed, 5) {
                at_m[2] = self.size_m.z;
            } else if self.has(Feature::LuminaireNearSurface, 4) && model == ModelSpec::Point {
                let off = self.draw.magnitude(1e-3, 0.05) * self.size_m[axis].min(1.0);
                at_m[axis] = rounded(if self.draw.one_in(2) { off } else { self.size_m[axis] - off });
            } else if let Some(last) = all.last().filter(|_| self.allowed.contains(&Feature::SameSpot)).cloned()
                && self.draw.one_in(6)
            {
                at_m = last.at_m.unwrap_or(at_m);
            }
            let is_recessed = at_m[2] == self.size_m.z;
            let flux_scale = if self.has(Feature::Off, 8) {
                0.0
            } else if self.has(Feature::Dimmed, 2) {
                rounded(self.draw.magnitude(0.01, 3.0))
            } else {
                1.0
            };
            let rotate_deg = self.rotation(is_recessed);
            all.push(LuminaireSpec {
                id: format!("l{k}"),
                photometry,
                at_m: Some(at_m),
                array: None,
                rotate_deg,
                flux_scale,
                model,
            });
        }
        all
    }

    fn rotation(&mut self, is_recessed: bool) -> RotationSpec {
        let angle = |draw: &mut Draw, all: f64| match draw.0.usize(0..4) {
            0 => draw.one_of(&[90.0, 45.0, -90.0, 180.0, 270.0]),
            1 => (draw.within(-all, all) * 1e4).round() / 1e4,
            _ => draw.within(-all, all).round(),
        };
        let azimuth = if self.has(Feature::Azimuth, 2) { angle(&mut self.draw, 360.0) } else { 0.0 };
        let roll = if self.has(Feature::Roll, 2) { angle(&mut self.draw, 180.0) } else { 0.0 };
        let tilt = if is_recessed {
            0.0
        } else if self.has(Feature::UpsideDown, 4) {
            180.0
        } else if self.has(Feature::Tilt, 2) {
            angle(&mut self.draw, 120.0)
        } else {
            0.0
        };
        RotationSpec { azimuth, tilt, roll }
    }

    fn photometric_file(&mut self, k: usize) -> (PathBuf, ModelSpec) {
        let opening = self.opening();
        let model = if opening == LuminousOpening::Point { ModelSpec::Point } else { ModelSpec::Area };
        for (feature, kind) in [(Feature::TypeA, Goniometer::A), (Feature::TypeB, Goniometer::B)] {
            if model == ModelSpec::Point && self.allowed.contains(&feature) && self.draw.one_in(8) {
                let text = table::of_type(&mut self.draw, kind);
                return (self.keep_lm63(format!("l{k}.ies"), text), model);
            }
        }
        let distribution = table::distribution(&mut self.draw, self.allowed);
        let opening = if opening == LuminousOpening::Point { self.size_alone() } else { opening };
        let photometry = Photometry { opening, ..Photometry::of(distribution) };
        let is_even =
            |angles: &[f64]| angles.windows(2).all(|w| ((w[1] - w[0]) - (angles[1] - angles[0])).abs() < 1e-9);
        let table = &photometry.distribution;
        let suits = matches!(opening, LuminousOpening::Point | LuminousOpening::Box { .. });
        if suits && is_even(table.c_deg()) && self.has(Feature::Eulumdat, 2) {
            let bytes = eulumdat::write(&photometry).text.into_bytes();
            let name = PathBuf::from(format!("l{k}.ldt"));
            self.files.insert(name.clone(), File { photometry: eulumdat::parse(&bytes).ok(), bytes });
            return (name, model);
        }
        (self.keep_lm63(format!("l{k}.ies"), lm63::write_2002(&photometry).text), model)
    }

    fn keep_lm63(&mut self, name: String, text: String) -> PathBuf {
        self.files.insert(name.clone().into(), File::of_lm63(text.into_bytes()));
        name.into()
    }

    /// The size of a luminaire that shines from a point, for the glare and the luminance that its file gives it.
    fn size_alone(&mut self) -> LuminousOpening {
        let is_looked_at = [Feature::OpeningLuminance, Feature::Glare].iter().any(|f| self.allowed.contains(f));
        if !is_looked_at || !self.draw.one_in(2) {
            return LuminousOpening::Point;
        }
        LuminousOpening::Box { x_m: self.extent(), y_m: self.extent(), height_m: 0.0 }
    }

    /// Of a luminous opening.
    fn extent(&mut self) -> f64 {
        rounded(0.1 * self.size_m.min_element() * self.draw.magnitude(0.2, 2.5))
    }

    fn opening(&mut self) -> LuminousOpening {
        let allowed: Vec<Feature> = OPENINGS.into_iter().filter(|f| self.allowed.contains(f)).collect();
        if allowed.is_empty() || !self.draw.one_in(3) {
            return LuminousOpening::Point;
        }
        let (x_m, y_m, z_m) = (self.extent(), self.extent(), self.extent());
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

    fn meters(&mut self, luminaires: &[LuminaireSpec], bodies: &[ObstacleSpec]) -> BTreeMap<String, MeterSet> {
        let mut sets = BTreeMap::new();
        let plane = self.plain_set();
        sets.insert("m0".to_owned(), plane);
        for k in 1..=self.draw.0.usize(1..4) {
            let (points, normal) = self.special(luminaires, bodies);
            sets.insert(
                format!("m{k}"),
                MeterSet { points_m: Some(points), normal: Some(normal), ..MeterSet::default() },
            );
        }
        if self.allowed.contains(&Feature::Luminance) {
            // A millimetre over the floor, or less in a small room.
            let [x, y, _] = self.point(0.05, 0.95);
            let points_m = Some(vec![[x, y, 0.001_f64.min(1e-3 * self.size_m.z)]]);
            sets.insert(
                ON_FLOOR.to_owned(),
                MeterSet { points_m, normal: Some([0.0, 0.0, 1.0]), ..MeterSet::default() },
            );
        }
        if self.allowed.contains(&Feature::Glare) {
            let at = DVec3::from(luminaires[0].at_m.unwrap_or_default());
            let mut eye = self.point(0.05, 0.95);
            eye[2] = rounded(0.4 * self.size_m.z);
            let ahead = (at - DVec3::from(eye)).truncate().normalize_or(glam::DVec2::X).extend(0.0);
            let normal = Some(ahead.to_array().map(|x| (x * 1e4).round() / 1e4 + 0.0));
            sets.insert(EYES.to_owned(), MeterSet { points_m: Some(vec![eye]), normal, ..MeterSet::default() });
        }
        sets
    }

    fn plain_set(&mut self) -> MeterSet {
        let normal = self.normal();
        if self.has(Feature::Grid, 3) {
            let counts = if self.has(Feature::ManyMeters, 3) { [6, 5] } else { [3, 2] };
            let [x, y, z] = (self.size_m * 0.1).to_array();
            let step = |size: f64, n: usize| rounded(0.8 * size / n as f64);
            let (u, v) = (step(self.size_m.x, counts[0]), step(self.size_m.y, counts[1]));
            let origin_m = [rounded(x), rounded(y), rounded(z * self.draw.within(0.5, 4.0))];
            let grid = GridSpec { origin_m, u_m: [u, 0.0, 0.0], v_m: [0.0, v, 0.0], counts };
            return MeterSet { grid: Some(grid), normal: Some(normal), ..MeterSet::default() };
        }
        let points = (0..self.draw.0.usize(2..6)).map(|_| self.point(0.03, 0.97)).collect();
        MeterSet { points_m: Some(points), normal: Some(normal), ..MeterSet::default() }
    }

    fn normal(&mut self) -> [f64; 3] {
        let axis = self.draw.one_of(&DVec3::AXES);
        let towards = if self.draw.one_in(2) { axis } else { -axis };
        let normal = if self.has(Feature::SkewNormal, 3) {
            DVec3::from([(); 3].map(|()| (self.draw.within(-1.0, 1.0) * 100.0).round() / 100.0)) + 0.01 * towards
        } else if self.draw.one_in(2) {
            DVec3::Z
        } else {
            towards
        };
        (if self.has(Feature::LongNormal, 4) { normal * 7.0 } else { normal }).to_array().map(|x| rounded(x) + 0.0)
    }

    /// A point or two where something may go wrong.
    fn special(&mut self, luminaires: &[LuminaireSpec], bodies: &[ObstacleSpec]) -> (Vec<[f64; 3]>, [f64; 3]) {
        let lamp = &luminaires[self.draw.0.usize(0..luminaires.len())];
        let (at, RotationSpec { azimuth, tilt, roll }) = (DVec3::from(lamp.at_m.unwrap_or_default()), lamp.rotate_deg);
        let turn = orientation(azimuth, tilt, roll);
        let reach_m = 0.3 * self.size_m.min_element();
        let along = |c: f64, gamma: f64, m: f64| at + m * (turn * direction(c, gamma));
        let written = |p: DVec3| p.to_array().map(|x| (x * 1e6).round() / 1e6);
        let unit = |p: DVec3| p.to_array().map(|x| (x * 1e4).round() / 1e4 + 0.0);
        let close = self.draw.close_m() * self.size_m.min_element().min(1.0);
        let body = bodies.iter().find_map(|b| b.cuboid.as_ref());
        let middle = |body: &BoxSpec| 0.5 * (DVec3::from(body.min_m) + DVec3::from(body.max_m));
        match self.draw.0.usize(0..9) {
            0 if self.allowed.contains(&Feature::OnAxis) => {
                let p = along(0.0, 0.0, self.draw.within(0.3, 1.0) * reach_m);
                (vec![written(p)], unit((at - p).normalize()))
            }
            1 if self.allowed.contains(&Feature::OnPlaneOfTable) => {
                let c = self.draw.one_of(&[0.0, 90.0, 180.0, 270.0]);
                let gamma = self.draw.within(10.0, 85.0).round();
                let p = along(c, gamma, reach_m);
                (vec![written(p), written(along(c + 180.0, gamma, 0.7 * reach_m))], unit((at - p).normalize()))
            }
            2 if self.allowed.contains(&Feature::Grazing) => {
                let p = along(self.draw.within(0.0, 360.0), self.draw.within(60.0, 89.7), reach_m);
                let ray = (at - p).normalize();
                let across = ray.cross(DVec3::new(0.36, 0.48, 0.8)).normalize();
                (vec![written(p)], unit(across + self.draw.magnitude(1e-3, 0.04) * ray))
            }
            3 if self.allowed.contains(&Feature::LooksAway) => {
                let p = self.point(0.1, 0.9);
                (vec![p], unit((DVec3::from(p) - at).normalize()))
            }
            4 if self.allowed.contains(&Feature::NearBody) => {
                let Some(body) = body else {
                    return (vec![self.point(0.1, 0.9)], [0.0, 0.0, 1.0]);
                };
                let (max_m, middle) = (body.max_m, middle(body));
                let beside = DVec3::new(max_m[0] + close, middle.y, middle.z);
                (vec![written(beside), written(DVec3::new(middle.x, middle.y, max_m[2] + close))], [0.0, 0.0, 1.0])
            }
            5 if self.allowed.contains(&Feature::NearSurface) => {
                let mut p = self.point(0.1, 0.9);
                let axis = self.draw.0.usize(0..3);
                let mut normal = DVec3::ZERO;
                let is_far = self.draw.one_in(2);
                p[axis] = if is_far { self.size_m[axis] - close } else { close };
                normal[axis] = if is_far { -1.0 } else { 1.0 };
                (vec![written(p.into())], normal.to_array().map(|x| x + 0.0))
            }
            6 if self.allowed.contains(&Feature::NearLuminaire) && lamp.model == ModelSpec::Point => {
                let p = along(
                    self.draw.within(0.0, 360.0),
                    self.draw.within(0.0, 90.0),
                    self.draw.magnitude(NEAREST, 0.2) * reach_m,
                );
                (vec![written(p)], unit((at - p).normalize()))
            }
            7 if self.allowed.contains(&Feature::BodyBehindLuminaire)
                || self.allowed.contains(&Feature::BodyBehindMeter) =>
            {
                let Some(body) = body else {
                    return (vec![self.point(0.1, 0.9)], [0.0, 0.0, 1.0]);
                };
                let away = (at - middle(body)).normalize_or(DVec3::Z);
                let beyond = at + self.draw.within(0.3, 1.0) * reach_m * away;
                let between = at - self.draw.within(0.2, 0.4) * (at - middle(body));
                let behind_luminaire = self.allowed.contains(&Feature::BodyBehindLuminaire);
                let p = if behind_luminaire { beyond } else { between };
                (vec![written(p)], unit((at - p).normalize()))
            }
            _ => {
                let p = self.point(0.05, 0.95);
                (vec![p, self.point(0.05, 0.95)], unit((at - DVec3::from(p)).normalize()))
            }
        }
    }

    fn procedures(&mut self, luminaires: &[LuminaireSpec], meters: &BTreeMap<String, MeterSet>) -> Procedures {
        let names = Names::Many(meters.keys().cloned().collect());
        let at = |bounces, light| Asked::Meters(AtMeters { meters: names.clone(), bounces, light });
        let mut all = BTreeMap::from([(ProcedureId::DirectIlluminance, at(Bounces::Converged, AnyLight::Total))]);
        if self.has(Feature::Intensity, 3) {
            let luminaire = luminaires[0].id.clone();
            let listed = AngleLists { gamma_deg: vec![0.0, 30.0, 62.5, 90.0], c_deg: vec![0.0, 45.0, 200.0] };
            let whole = self.files.get(&luminaires[0].photometry).and_then(|f| f.photometry.as_ref());
            let is_small = whole.is_some_and(|p| p.distribution.c_deg().len() * p.distribution.gamma_deg().len() < 200);
            let angles = if !is_small || self.has(Feature::ListedAngles, 2) {
                Angles::Listed(listed)
            } else {
                Angles::Photometry
            };
            let distance_m = rounded(self.draw.magnitude(0.5, 50.0));
            all.insert(ProcedureId::LuminousIntensity, Asked::Angles(AtAngles { luminaire, distance_m, angles }));
        }
        let few = self.has(Feature::FewBounces, 2);
        let bounces = if few { Bounces::AtMost(self.draw.one_of(&[1, 2, 3])) } else { Bounces::Converged };
        if self.has(Feature::Cylindrical, 4) {
            all.insert(ProcedureId::CylindricalIlluminance, at(Bounces::Converged, AnyLight::Direct));
        }
        if self.allowed.contains(&Feature::Indirect) {
            all.insert(ProcedureId::IndirectIlluminance, at(bounces, AnyLight::Total));
        }
        if self.has(Feature::Total, 2) {
            all.insert(ProcedureId::TotalIlluminance, at(bounces, AnyLight::Total));
        }
        let has_size = |l: &LuminaireSpec| {
            let photometry = self.files.get(&l.photometry).and_then(|file| file.photometry.as_ref());
            photometry.is_some_and(|p| p.opening != LuminousOpening::Point)
        };
        let [has_first, has_each] = [has_size(&luminaires[0]), luminaires.iter().all(has_size)];
        let of = |set: &str| meters.contains_key(set).then(|| Names::One(set.to_owned()));
        let on = |meters| Asked::Meters(AtMeters { meters, bounces, light: AnyLight::Total });
        all.extend(of(ON_FLOOR).map(|set| (ProcedureId::Luminance, on(set))));
        all.extend(of(EYES).filter(|_| has_each).map(|set| (ProcedureId::UnifiedGlareRating, on(set))));
        if has_first && self.has(Feature::OpeningLuminance, 2) {
            let asked = AtOpening { luminaire: luminaires[0].id.clone(), meters: names.clone() };
            all.insert(ProcedureId::OpeningLuminance, Asked::Opening(asked));
        }
        Procedures(all)
    }

    /// The hunted engines, now and then with a preset of theirs where their settings name none.
    fn engines(&mut self, hunted: &Engines) -> BTreeMap<String, EngineSettings> {
        let with_preset = |one: &mut Self, name: &EngineName, settings: &EngineSettings| {
            let mut settings = settings.clone();
            let made = engines::entry(name).map(|entry| (entry.make)());
            let knob = made.and_then(|engine| engine.knobs().iter().find(|k| k.key == "preset"));
            if let Some(knob) = knob.filter(|knob| !settings.0.contains_key(knob.key))
                && one.has(Feature::Preset, 2)
            {
                settings.0.insert(knob.key.to_owned(), one.draw.one_of(knob.values).into());
            }
            settings
        };
        hunted.iter().map(|(name, settings)| (name.to_string(), with_preset(self, name, settings))).collect()
    }
}

/// What luminous intensity is in all directions: even, or as a table says.
pub(super) fn constant(gamma_deg: [f64; 2], candela: f64) -> Option<LuminousIntensityDistribution> {
    LuminousIntensityDistribution::axial(gamma_deg.to_vec(), vec![candela; 2]).ok()
}
