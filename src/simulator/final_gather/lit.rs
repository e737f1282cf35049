//! Light straight from the luminaires on the faces: polynomials on rectangles that are quartered until they agree with
//! it. What boxes hide is cut out of luminaires of some extent; luminaires without any have polynomials of their own, as if
//! nothing hid them, and their shadows are cut out of what is seen. Those that cannot be cut are asked at every place anew.

mod numbers;

use std::f64::consts::PI;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::bicubic::{Bicubic, NODES, ORDER};
use super::face::{Cover, Face, covering, mean_wall_m2};
use super::surroundings::Surroundings;
use super::view::{Cast, Left, LitPart, View};
use crate::scene::Meter;
use crate::simulator::emission::{Emitter, Precision};
use crate::simulator::quadrature::Gauss;
use crate::simulator::sampler::{mix, unit};
use crate::simulator::stop::Stop;
use crate::simulator::visibility::Occluder;

/// Where a rectangle's polynomial is held against the light, besides its nodes.
const CHECKS: [[f64; 2]; 6] = [[0.5, 0.5], [0.02, 0.02], [0.98, 0.98], [0.02, 0.98], [0.98, 0.02], [0.5, 0.02]];
/// Nodes along each side of the rule that tells what the mean of a leaf's polynomial is off: none of them is the polynomial's own, and kinks of
/// a table lie otherwise between them.
const FINER: usize = ORDER + 1;
/// What two rules differ by, times which either may miss.
const BY_CHANCE: f64 = 4.0;
/// Heights of luminaires nearer to an edge than this part of a rectangle do not part it.
const EDGE: f64 = 0.02;
/// Quarterings at most.
const DEEPEST: u32 = 9;
/// Quarterings at most that only part what bodies may hide from what they cannot.
const DEEPEST_FOR_SHADOW: u32 = 4;
/// Random places that tell how bright the walls are on the mean.
const PLACES: u64 = 64;
/// Luminaires times bodies beyond which cutting these out of those for every place takes longer than rays do.
const MOST_CUTS: usize = 100;
/// What a leaf is off, times its part of a wall, of what may be off where bodies are cut out of luminaires: some hundred lie along each shadow.
const OF_ALL: f64 = 3e-3;
/// Dim places need be known to this part of the wall's mean only.
const DIM: f64 = 0.1;

/// Direct illuminance on the faces of a room.
#[derive(Debug)]
pub(super) struct Lit {
    faces: Vec<Vec<Part>>,
    /// Shadows of luminaires without extent on each face, by luminaire; none where nothing is cut.
    casts: Vec<Vec<Option<Cast>>>,
    bicubic: Bicubic,
    /// Leaves of all faces by what they reflect, for drawing places where much light falls.
    bright: Vec<Bright>,
    /// All that is reflected, in lumens.
    reflected_lm: f64,
    /// Whether some place is so much brighter than the mean that rays would find it too seldom.
    pub(super) is_peaked: bool,
    /// Exitance of the brightest place in lm/m².
    pub(super) peak: f64,
    /// Whether no luminaire must be asked anywhere.
    pub(super) is_whole: bool,
}

#[derive(Debug)]
struct Part {
    corner_m: DVec2,
    size_m: DVec2,
    kind: Kind,
    /// Of four quarters the polynomial that comes closest to theirs, and how far off it is; where they are all that is known.
    joined: Option<Box<([f64; NODES], Off)>>,
}

/// How far off a polynomial is.
#[derive(Clone, Copy, Debug, Default)]
struct Off {
    /// Anywhere.
    lux: f64,
    /// In its mean or slopes: where a table has kinks the nodes' own rule misses some of these.
    mean_lux: f64,
}

impl Off {
    const NONE: Self = Self { lux: 0.0, mean_lux: 0.0 };

    /// Holds a polynomial against the light at the nodes of a rule, which finds its residue's mean and slopes. Of smooth light they are next to
    /// nothing; of kinks two rules miss as much as each other, and by chance the same, but no more than the residue is.
    fn look(&mut self, bicubic: &Bicubic, rule: &Gauss, lux: &[f64; NODES], lux_at: impl Fn(DVec2) -> f64) {
        let (mut moments, mut square) = ([0.0_f64; 3], 0.0);
        for (x, a) in rule.nodes.iter().zip(&rule.weights) {
            for (y, b) in rule.nodes.iter().zip(&rule.weights) {
                let t = DVec2::new(*x, *y);
                let residue = lux_at(t) - bicubic.at(lux, t);
                self.lux = self.lux.max(residue.abs());
                square += a * b * residue * residue;
                // Legendre's first, of a mean square of 1.
                let slopes = (t - 0.5) * 12.0_f64.sqrt();
                moments.iter_mut().zip([1.0, slopes.x, slopes.y]).for_each(|(m, p)| *m += a * b * residue * p);
            }
        }
        let largest = moments.iter().fold(0.0_f64, |most, m| most.max(m.abs()));
        self.mean_lux = (BY_CHANCE * largest).min(square.sqrt());
    }

    /// What is left of it where a part of what has no mean is.
    fn left_lux(&self, part: f64) -> f64 {
        part * self.lux + (1.0 - part) * self.mean_lux.min(self.lux)
    }
}

#[derive(Debug)]
enum Kind {
    /// Index of the first of four quarters, and where they meet.
    Quartered(usize, DVec2),
    Leaf(Box<Leaf>),
}

#[derive(Debug)]
struct Leaf {
    /// Illuminance at the nodes by the luminaires that nothing hides.
    lux: [f64; NODES],
    off: Off,
    /// Luminaires without extent that bodies hide from a part of it.
    shaded: Vec<Shaded>,
    /// Whether a body stands on a part of it, so that what shows of what is off may have a mean.
    is_covered: bool,
    /// Luminaires that may be hidden, or whose light is no polynomial here.
    asked: Vec<u32>,
    /// Mean exitance after one reflection in lm/m², as far as it is known beforehand.
    exitance: f64,
}

/// Light of one luminaire whose shadows have sharp edges.
#[derive(Debug)]
struct Shaded {
    emitter: u32,
    /// Illuminance at the nodes were nothing in its way.
    lux: [f64; NODES],
    off: Off,
    /// Which of its shadows meet the rectangle.
    shadows: Vec<u32>,
}

#[derive(Debug)]
struct Bright {
    up_to_lm: f64,
    face: usize,
    corner_m: DVec2,
    size_m: DVec2,
}

/// How well light is known on a rectangle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Known {
    /// How far off it may be; infinite where bodies cover a part.
    pub(super) error_lux: f64,
    /// How far off its mean may be.
    pub(super) mean_lux: f64,
    /// Standard error of its mean, which the replicates show in their scatter.
    pub(super) noise_lux: f64,
    pub(super) side_m: f64,
}

impl Known {
    const EXACT: Self = Self { error_lux: 0.0, mean_lux: 0.0, noise_lux: 0.0, side_m: 0.0 };

    /// The part of a polynomial's error that is left in what a place sees of its rectangle: but for its mean, what it leaves out has no
    /// slope, and from afar one sees no more of it.
    pub(super) fn left_lux(&self, distance_m: f64) -> f64 {
        Off { lux: self.error_lux, mean_lux: self.mean_lux }.left_lux(self.shows(distance_m))
    }

    /// Whether a ray may end on it: what is left out and its noise are below their limits.
    pub(super) fn is_enough(&self, distance_m: f64, limit: Limit) -> bool {
        let shows = self.shows(distance_m);
        self.left_lux(distance_m) <= limit.error_lux && self.noise_lux * shows <= limit.noise_lux
    }

    /// How much of a place's view it takes.
    fn shows(&self, distance_m: f64) -> f64 {
        (self.side_m / distance_m).powi(2).min(1.0)
    }
}

/// How well light must be known for a ray to end.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limit {
    pub(super) error_lux: f64,
    pub(super) noise_lux: f64,
}

impl Limit {
    /// Everything is known well enough.
    pub(super) const NONE: Self = Self { error_lux: 0.0, noise_lux: 0.0 };
}

/// Direct illuminance at a place, and how far off it may be besides chance.
#[derive(Clone, Copy, Debug)]
pub(super) struct Light {
    pub(super) lux: f64,
    pub(super) known: Known,
}

/// What it takes to light a place.
#[derive(Clone, Copy)]
pub(super) struct Lights<'a> {
    pub(super) surroundings: &'a Surroundings,
    pub(super) emitters: &'a [Emitter],
}

impl Lights<'_> {
    /// Light of one luminaire at a place, by one of its parts where it has any extent.
    pub(super) fn sample(&self, k: usize, meter: &Meter, start_m: DVec3, u: [f64; 2]) -> f64 {
        let (lux, from_m) = self.emitters[k].sample(meter, u);
        if lux > 0.0 && !self.surroundings.is_hidden(start_m, from_m) { lux } else { 0.0 }
    }

    fn may_be_hidden(&self, k: usize, from: [DVec3; 2]) -> bool {
        self.surroundings.may_hide(from, self.emitters[k].bounds_m())
    }
}

impl Lit {
    /// To a relative error at each place, dim ones apart, or as well as it is known when it is time to go on; and whether it is known to that error.
    pub(super) fn new(lights: &Lights, relative_error: f64, until: &Stop, stop: &Stop) -> (Self, bool) {
        let bicubic = Bicubic::new();
        let mean: f64 = mean_lux(lights, relative_error);
        let surroundings = lights.surroundings;
        let occluders = cut_out(lights);
        let casts = casts(lights, occluders.as_deref());
        let finer = Gauss::new(FINER);
        let one = |(face, casts): (&Face, &Vec<Option<Cast>>)| {
            let floor_lux = DIM * mean;
            let wall_m2 = surroundings.room.map_or(f64::INFINITY, |room| mean_wall_m2(room.size_m));
            let covers = surroundings.covers(face);
            let build = Build {
                lights,
                bicubic,
                face,
                covers,
                relative_error,
                floor_lux,
                wall_m2,
                occluders: &occluders,
                casts,
                finer: &finer,
                until,
                stop,
            };
            if face.reflectance > 0.0 { build.grow() } else { vec![] }
        };
        let faces: Vec<Vec<Part>> = surroundings.faces.par_iter().zip(&casts).map(one).collect();
        let is_done = !until.is_due();
        (Self::of_parts(lights, occluders.is_some(), casts, faces), is_done)
    }

    /// What follows from the rectangles of all faces.
    fn of_parts(lights: &Lights, cuts: bool, casts: Vec<Vec<Option<Cast>>>, mut faces: Vec<Vec<Part>>) -> Self {
        let bicubic = Bicubic::new();
        if cuts {
            faces.par_iter_mut().for_each(|parts| join(&bicubic, parts));
        }
        let all = &lights.surroundings.faces;
        let (mut bright, mut reflected_lm, mut peak, mut is_whole) = (vec![], 0.0, 0.0_f64, cuts);
        for (face, parts) in faces.iter().enumerate() {
            for part in parts {
                let Kind::Leaf(leaf) = &part.kind else { continue };
                reflected_lm += leaf.exitance * part.size_m.element_product();
                peak = peak.max(leaf.exitance);
                is_whole &= leaf.asked.is_empty();
                bright.push(Bright { up_to_lm: reflected_lm, face, corner_m: part.corner_m, size_m: part.size_m });
            }
        }
        let area_m2: f64 = all.iter().map(Face::area_m2).sum();
        let is_peaked = peak * area_m2 > super::PEAKED * reflected_lm;
        Self { faces, casts, bicubic, bright, reflected_lm, is_peaked, peak, is_whole }
    }

    /// Light reflected once by all faces to a meter, and what it may be off.
    pub(super) fn shown_of_all(&self, view: &View, faces: &[Face], tolerance_lux: f64) -> (f64, Left) {
        let (mut lux, mut left) = (0.0, Left::default());
        for face in faces.iter().enumerate() {
            self.add_shown(view, face, tolerance_lux, &mut |value, left_lux| {
                lux += value;
                left.add(left_lux);
            });
        }
        (lux, left)
    }

    /// The mean over all faces of light reflected once, in lm/m².
    pub(super) fn mean_exitance(&self, faces: &[Face]) -> f64 {
        self.reflected_lm / faces.iter().map(Face::area_m2).sum::<f64>()
    }

    /// Light reflected once by a face to a meter, rectangle by rectangle: from afar by polynomials of large ones, as far as what is off
    /// there is below a tolerance. To each belongs what its polynomial leaves out and the rule misses.
    fn add_shown(
        &self,
        view: &View,
        (index, face): (usize, &Face),
        tolerance_lux: f64,
        add: &mut impl FnMut(f64, f64),
    ) {
        let Some(before) = view.before(face) else { return };
        let mut open = vec![0];
        while let Some(k) = open.pop() {
            let Some(part) = self.faces[index].get(k) else { continue };
            let Some(shown) = before.of(part.corner_m, part.size_m) else { continue };
            let (values, off, shaded) = match (&part.kind, &part.joined) {
                (Kind::Leaf(leaf), _) => (&leaf.lux, leaf.off, leaf.shaded.as_slice()),
                (Kind::Quartered(first, _), joined) => match joined.as_deref() {
                    Some((values, off)) if shown.factor * off.left_lux(shown.left()) <= tolerance_lux => {
                        (values, *off, &[][..])
                    }
                    _ => {
                        open.extend(*first..first + 4);
                        continue;
                    }
                },
            };
            let (weights, factor, left) = (shown.weights(), shown.factor, shown.left());
            let all = LitPart { weights, factor, left };
            let (value, left_lux) = read(&all, values, off);
            add(face.reflectance * value, face.reflectance * left_lux);
            for shaded in shaded {
                let cast = self.casts[index][shaded.emitter as usize].as_ref();
                let Some(lit) = cast.and_then(|cast| shown.lit(&weights, cast, &shaded.shadows)) else { continue };
                let (value, left_lux) = read(&lit, &shaded.lux, shaded.off);
                add(face.reflectance * value, face.reflectance * left_lux);
            }
        }
    }

    /// Direct illuminance at a place on a face; `u` draws the parts of luminaires that must be asked.
    pub(super) fn at(&self, lights: &Lights, face: usize, meter: &Meter, u: impl FnOnce() -> [f64; 2]) -> Light {
        let at_m = lights.surroundings.faces[face].on(meter.position_m);
        let Some((part, leaf)) = self.leaf(face, at_m) else {
            return Light { lux: 0.0, known: Known::EXACT };
        };
        let t = (at_m - part.corner_m) / part.size_m;
        let is_smooth = !leaf.is_covered && leaf.shaded.is_empty();
        let side_m = if is_smooth { part.size_m.max_element() } else { f64::INFINITY };
        let mut light = Light {
            lux: self.bicubic.at(&leaf.lux, t),
            known: Known { error_lux: leaf.off.lux, mean_lux: leaf.off.mean_lux, noise_lux: 0.0, side_m },
        };
        for shaded in &leaf.shaded {
            if !lights.surroundings.is_hidden(meter.position_m, lights.emitters[shaded.emitter as usize].centre_m()) {
                light.lux += self.bicubic.at(&shaded.lux, t);
                light.known.error_lux += shaded.off.lux;
                light.known.mean_lux += shaded.off.mean_lux;
            }
        }
        if leaf.asked.is_empty() {
            return light;
        }
        let u = u();
        for k in &leaf.asked {
            light.lux += lights.sample(*k as usize, meter, meter.position_m, u);
        }
        light
    }

    /// A place drawn in proportion to what is reflected, and its density per square metre.
    pub(super) fn draw(&self, [u, v]: [f64; 2]) -> Option<(usize, DVec2, f64)> {
        let at = u * self.reflected_lm;
        let k = self.bright.partition_point(|b| b.up_to_lm <= at).min(self.bright.len().checked_sub(1)?);
        let below = if k == 0 { 0.0 } else { self.bright[k - 1].up_to_lm };
        let bright = &self.bright[k];
        let lumens = bright.up_to_lm - below;
        let across = ((at - below) / lumens).clamp(0.0, 1.0);
        let place = bright.corner_m + bright.size_m * DVec2::new(across, v);
        Some((bright.face, place, lumens / self.reflected_lm / bright.size_m.element_product()))
    }

    /// The most that a sample may bring to a place that is met by rays and drawn from the light, too: no more than the exitance where it
    /// comes from, nor than all light from its distance.
    pub(super) fn brightest(&self, faces: &[Face], from_m: DVec3) -> f64 {
        let mut below_lm = 0.0;
        let of = |bright: &Bright| {
            let lumens = bright.up_to_lm - below_lm;
            below_lm = bright.up_to_lm;
            let face = &faces[bright.face];
            if face.is_before_m(from_m) <= 0.0 {
                return 0.0;
            }
            let nearest_m = face.on(from_m).clamp(bright.corner_m, bright.corner_m + bright.size_m);
            let all_lux = self.reflected_lm / (PI * (face.off(nearest_m) - from_m).length_squared());
            all_lux.min(lumens / bright.size_m.element_product())
        };
        self.bright.iter().map(of).fold(0.0, f64::max)
    }

    /// The density of [`Self::draw`] at a place, per square metre.
    pub(super) fn density(&self, lights: &Lights, face: usize, point_m: DVec3) -> f64 {
        self.leaf(face, lights.surroundings.faces[face].on(point_m))
            .map_or(0.0, |(_, leaf)| leaf.exitance / self.reflected_lm)
    }

    fn leaf(&self, face: usize, at_m: DVec2) -> Option<(&Part, &Leaf)> {
        let parts = &self.faces[face];
        let mut part = parts.first()?;
        loop {
            match &part.kind {
                Kind::Leaf(leaf) => return Some((part, leaf)),
                Kind::Quartered(first, middle_m) => {
                    let far = at_m.cmpge(*middle_m);
                    part = &parts[first + usize::from(far.x) + 2 * usize::from(far.y)];
                }
            }
        }
    }
}

/// Shadows of luminaires without extent on each face, where bodies are cut out.
fn casts(lights: &Lights, occluders: Option<&[Occluder]>) -> Vec<Vec<Option<Cast>>> {
    let of = |face: &Face| {
        let Some(solid) = occluders else { return vec![] };
        let cast = |emitter: &Emitter| emitter.is_point().then(|| Cast::new(emitter.centre_m(), face, solid))?;
        lights.emitters.iter().map(cast).collect()
    };
    lights.surroundings.faces.iter().map(of).collect()
}

/// The bodies that are cut out of luminaires, perhaps none; nothing where that cannot be or takes too long, so that luminaires must be asked.
pub(super) fn cut_out(lights: &Lights) -> Option<Vec<Occluder>> {
    let bodies = lights.surroundings.bodies();
    let solid: Vec<Occluder> = bodies.map(|[min_m, max_m]| Occluder { min_m: *min_m, max_m: *max_m }).collect();
    let is_cut = |emitter: &Emitter| {
        let touches = |o: &Occluder| emitter.centre_m().clamp(o.min_m, o.max_m) == emitter.centre_m();
        emitter.is_polygonal() && !(emitter.is_point() && solid.iter().any(touches))
    };
    let can_cut = solid.is_empty() || lights.emitters.iter().all(is_cut);
    let cuts = solid.len() * lights.emitters.iter().filter(|emitter| !emitter.is_point()).count();
    lights.surroundings.hiding().filter(|_| can_cut && cuts <= MOST_CUTS)?;
    Some(solid)
}

/// Light of a polynomial on what shows of its rectangle, and what it may be off.
fn read(lit: &LitPart, values: &[f64; NODES], off: Off) -> (f64, f64) {
    let LitPart { weights, factor, left } = lit;
    let most = values.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
    let value = weights.of_nodes.iter().zip(values).map(|(w, v)| w * v).sum();
    (value, factor * off.left_lux(*left) + weights.error * most)
}

/// Finds for every part that is quartered the polynomial closest to those of its quarters, which lie behind it; none where luminaires
/// have shadows with edges on one of them.
fn join(bicubic: &Bicubic, parts: &mut [Part]) {
    for k in (0..parts.len()).rev() {
        let Kind::Quartered(first, _) = parts[k].kind else { continue };
        let (corner_m, size_m) = (parts[k].corner_m, parts[k].size_m);
        let of = |quarter: &Part| ((quarter.corner_m - corner_m) / size_m, quarter.size_m / size_m);
        let quarters = parts[first..first + 4].iter().map(|quarter| {
            let (corner, size) = of(quarter);
            match (&quarter.kind, &quarter.joined) {
                (Kind::Leaf(leaf), _) if leaf.shaded.is_empty() => Some((corner, size, &leaf.lux, leaf.off)),
                (_, Some(joined)) => Some((corner, size, &joined.0, joined.1)),
                (_, None) => None,
            }
        });
        let quarters: Option<Vec<_>> = quarters.collect();
        parts[k].joined = quarters.map(|quarters| {
            let mean_lux = quarters.iter().map(|(_, size, _, off)| size.element_product() * off.mean_lux).sum();
            let parts = quarters.into_iter().map(|(corner, size, lux, off)| (corner, size, lux, off.lux));
            let (joined, lux) = bicubic.joined(parts);
            Box::new((joined, Off { lux, mean_lux }))
        });
    }
}

/// The mean over random places on all walls, bodies left out.
fn mean_lux(lights: &Lights, relative_error: f64) -> f64 {
    let Some(walls) = lights.surroundings.room.map(|room| Face::walls(&room)) else { return 0.0 };
    let precision = Precision::relative(relative_error.max(1e-3));
    let one = |k: u64| {
        let wall = &walls[(k % 6) as usize];
        let at_m = wall.size_m() * DVec2::new(unit(mix(2 * k + 1)), unit(mix(2 * k + 2)));
        let meter = Meter { position_m: wall.off(at_m), normal: wall.normal };
        lights.emitters.iter().map(|e| e.illuminance(&meter, &[], precision).value).sum::<f64>()
    };
    (0..PLACES).map(one).sum::<f64>() / PLACES as f64
}

/// What becomes of a rectangle: a leaf, or quarters with what they are at first, and where these meet.
enum Grown {
    Leaf(Leaf),
    Quarters(DVec2, Vec<(DVec2, DVec2, Leaf)>),
}

struct Build<'a> {
    lights: &'a Lights<'a>,
    bicubic: Bicubic,
    face: &'a Face,
    /// Where bodies stand on it.
    covers: Vec<[DVec2; 2]>,
    relative_error: f64,
    floor_lux: f64,
    wall_m2: f64,
    /// Bodies, where they can be cut out of luminaires.
    occluders: &'a Option<Vec<Occluder>>,
    /// Shadows on the face of luminaires without extent.
    casts: &'a [Option<Cast>],
    finer: &'a Gauss,
    /// When no more is quartered.
    until: &'a Stop,
    stop: &'a Stop,
}

impl Build<'_> {
    /// A face in rectangles, each a leaf or quartered where that is not good enough, level by level, so that all of it is known about alike
    /// whenever time is up.
    fn grow(&self) -> Vec<Part> {
        let (corner_m, size_m) = (self.face.corners_m[0], self.face.size_m());
        let mut parts = vec![Self::part(corner_m, size_m)];
        let mut open = vec![(0, self.leaf(corner_m, size_m))];
        for depth in 0.. {
            let grown: Vec<(usize, Grown)> = std::mem::take(&mut open)
                .into_par_iter()
                .map(|(index, leaf): (usize, Leaf)| {
                    let part = &parts[index];
                    (index, self.grown(leaf, part.corner_m, part.size_m, depth))
                })
                .collect();
            for (index, grown) in grown {
                parts[index].kind = match grown {
                    Grown::Leaf(leaf) => Kind::Leaf(Box::new(leaf)),
                    Grown::Quarters(middle_m, quarters) => {
                        let first = parts.len();
                        for (k, (corner_m, size_m, leaf)) in quarters.into_iter().enumerate() {
                            parts.push(Self::part(corner_m, size_m));
                            open.push((first + k, leaf));
                        }
                        Kind::Quartered(first, middle_m)
                    }
                };
            }
            if open.is_empty() {
                break;
            }
        }
        parts
    }

    fn part(corner_m: DVec2, size_m: DVec2) -> Part {
        Part { corner_m, size_m, kind: Kind::Quartered(0, corner_m), joined: None }
    }

    fn grown(&self, mut leaf: Leaf, corner_m: DVec2, size_m: DVec2, depth: u32) -> Grown {
        let is_clear = leaf.asked.is_empty() || depth >= DEEPEST_FOR_SHADOW;
        let is_last = depth >= DEEPEST || self.until.is_due();
        if is_last || is_clear && !leaf.is_covered && self.is_good(&leaf, size_m) {
            leaf = self.looked_into(leaf, [corner_m, size_m]);
            if is_last || self.is_good(&leaf, size_m) {
                return Grown::Leaf(leaf);
            }
        }
        let middle_m = self.middle_m(corner_m, size_m);
        let (near_m, far_m) = (middle_m - corner_m, corner_m + size_m - middle_m);
        let quarters = [
            (corner_m, near_m),
            (DVec2::new(middle_m.x, corner_m.y), DVec2::new(far_m.x, near_m.y)),
            (DVec2::new(corner_m.x, middle_m.y), DVec2::new(near_m.x, far_m.y)),
            (middle_m, far_m),
        ];
        let quarter = |(corner_m, size_m): &(DVec2, DVec2)| (*corner_m, *size_m, self.leaf(*corner_m, *size_m));
        Grown::Quarters(middle_m, quarters.par_iter().map(quarter).collect())
    }

    /// Whether a leaf of so many metres is known as well as it has to be.
    fn is_good(&self, leaf: &Leaf, size_m: DVec2) -> bool {
        let shaded = || leaf.shaded.iter();
        let lux = leaf.lux.iter().chain(shaded().flat_map(|shaded| &shaded.lux));
        let mean = lux.map(|l| l.abs()).sum::<f64>() / NODES as f64;
        let limit_lux = self.relative_error * mean.max(self.floor_lux);
        let error_lux = leaf.off.lux + shaded().map(|shaded| shaded.off.lux).sum::<f64>();
        match self.occluders {
            // What is off on a small part is little of all: where shadows have edges no part is small enough for another measure.
            Some(occluders) if !occluders.is_empty() => {
                error_lux * size_m.element_product() / self.wall_m2 <= OF_ALL * limit_lux
            }
            _ => error_lux <= limit_lux,
        }
    }

    /// Where a rectangle is quartered: in its middle, where a body stands on a part of it, or at the height of a luminaire, above
    /// which it may send no light.
    fn middle_m(&self, corner_m: DVec2, size_m: DVec2) -> DVec2 {
        let up = self.face.on(DVec3::Z);
        let (low, high) = (corner_m + EDGE * size_m, corner_m + (1.0 - EDGE) * size_m);
        let mut middle_m = corner_m + 0.5 * size_m;
        if Cover::of(&self.covers, corner_m, size_m) == Cover::Part {
            for axis in 0..2 {
                let ends = covering(&self.covers, corner_m, size_m).flatten().map(|end| end[axis]);
                let inside = ends.filter(|at_m| *at_m > low[axis] && *at_m < high[axis]);
                let off = |at_m: &f64| (at_m - middle_m[axis]).abs();
                let nearest = inside.min_by(|a, b| off(a).total_cmp(&off(b)));
                middle_m[axis] = nearest.unwrap_or(middle_m[axis]);
            }
            return middle_m;
        }
        let heights = self.lights.emitters.iter().flat_map(Emitter::bounds_m).map(|b| self.face.on(b));
        let inside =
            heights.filter(|at_m| up != DVec2::ZERO && at_m.dot(up) > low.dot(up) && at_m.dot(up) < high.dot(up));
        let nearest = inside.map(|at_m| (at_m - middle_m).dot(up)).min_by(|a, b| a.abs().total_cmp(&b.abs()));
        middle_m += up * nearest.unwrap_or(0.0);
        middle_m
    }

    /// A rectangle with the luminaires that may be hidden from it told apart.
    fn leaf(&self, corner_m: DVec2, size_m: DVec2) -> Leaf {
        let cover = Cover::of(&self.covers, corner_m, size_m);
        let mut leaf = Leaf {
            lux: [0.0; NODES],
            off: Off::NONE,
            shaded: vec![],
            is_covered: cover == Cover::Part,
            asked: vec![],
            exitance: 0.0,
        };
        if cover == Cover::Whole {
            return leaf;
        }
        let Lighting { clear, cut, sharp, asked } = self.lighting(corner_m, size_m);
        leaf.asked = asked;
        let at = |t: DVec2| self.meter(corner_m + t * size_m);
        let polynomial = |lux_at: &dyn Fn(&Meter) -> f64| {
            let lux: [f64; NODES] = std::array::from_fn(|k| lux_at(&at(self.bicubic.node(k))));
            let off = |t: &[f64; 2]| {
                let t = DVec2::from_array(*t);
                (self.bicubic.at(&lux, t) - lux_at(&at(t))).abs()
            };
            (lux, Off { lux: CHECKS.iter().map(off).fold(0.0, f64::max), mean_lux: 0.0 })
        };
        (leaf.lux, leaf.off) = polynomial(&|meter| self.lux_of_all(&clear, &cut, meter));
        let shaded = |(k, shadows): (usize, Vec<u32>)| {
            let (lux, off) = polynomial(&|meter| self.lux_of(k, meter, &[]));
            Shaded { emitter: k as u32, lux, off, shadows }
        };
        leaf.shaded = sharp.into_iter().map(shaded).collect();
        // What may be hidden counts by half, so that no place that is lit is drawn never.
        let of_asked = |k: &u32| {
            let lux = std::array::from_fn(|node| self.lux_of(*k as usize, &at(self.bicubic.node(node)), &[]));
            self.mean(&lux)
        };
        let hidden: f64 = leaf.asked.iter().map(of_asked).chain(leaf.shaded.iter().map(|s| self.mean(&s.lux))).sum();
        let lux = (self.mean(&leaf.lux).max(0.0) + 0.5 * hidden.max(0.0)).max(0.02 * self.floor_lux);
        leaf.exitance = self.face.reflectance * lux;
        leaf
    }

    /// A leaf that may stay, held against the light at the nodes of another rule.
    fn looked_into(&self, mut leaf: Leaf, [corner_m, size_m]: [DVec2; 2]) -> Leaf {
        if self.stop.is_due() || leaf.off.lux == 0.0 && leaf.shaded.iter().all(|shaded| shaded.off.lux == 0.0) {
            return leaf;
        }
        let at = |t: DVec2| self.meter(corner_m + t * size_m);
        let Lighting { clear, cut, .. } = self.lighting(corner_m, size_m);
        leaf.off.look(&self.bicubic, self.finer, &leaf.lux, |t| self.lux_of_all(&clear, &cut, &at(t)));
        for shaded in &mut leaf.shaded {
            let k = shaded.emitter as usize;
            shaded.off.look(&self.bicubic, self.finer, &shaded.lux, |t| self.lux_of(k, &at(t), &[]));
        }
        leaf
    }

    fn meter(&self, at_m: DVec2) -> Meter {
        Meter { position_m: self.face.off(at_m), normal: self.face.normal }
    }

    /// The mean of a polynomial over its rectangle.
    fn mean(&self, lux: &[f64; NODES]) -> f64 {
        (0..NODES).map(|k| self.bicubic.weight(k) * lux[k]).sum()
    }

    fn lux_of(&self, k: usize, meter: &Meter, solid: &[Occluder]) -> f64 {
        // Two refinements agree far less well than the finer one is right.
        let relative_error = self.relative_error.min(1e-3);
        let precision = Precision { relative_error, error_lux: relative_error * self.floor_lux };
        self.lights.emitters[k].illuminance(meter, solid, precision).value
    }

    fn lux_of_all(&self, clear: &[usize], cut: &[usize], meter: &Meter) -> f64 {
        let solid = self.occluders.as_deref().unwrap_or_default();
        let clear = clear.iter().map(|k| self.lux_of(*k, meter, &[]));
        clear.chain(cut.iter().map(|k| self.lux_of(*k, meter, solid))).sum()
    }

    /// Which luminaires light a rectangle how.
    fn lighting(&self, corner_m: DVec2, size_m: DVec2) -> Lighting {
        let corners_m = [self.meter(corner_m).position_m, self.meter(corner_m + size_m).position_m];
        let mut found = Lighting::default();
        for (k, emitter) in self.lights.emitters.iter().enumerate() {
            if !self.lights.may_be_hidden(k, corners_m) {
                found.clear.push(k);
            } else if self.occluders.is_none() {
                found.asked.push(k as u32);
            } else if !emitter.is_point() {
                found.cut.push(k);
            } else if let Some(cast) = &self.casts[k] {
                match cast.on(corner_m, size_m) {
                    Some(shadows) if shadows.is_empty() => found.clear.push(k),
                    Some(shadows) => found.sharp.push((k, shadows)),
                    None => {}
                }
            }
        }
        found
    }
}

/// Luminaires by what stands between them and a rectangle.
#[derive(Default)]
struct Lighting {
    /// Nothing.
    clear: Vec<usize>,
    /// Bodies that are cut out of them.
    cut: Vec<usize>,
    /// Bodies whose shadows have edges, by their numbers.
    sharp: Vec<(usize, Vec<u32>)>,
    /// Bodies that cannot be cut.
    asked: Vec<u32>,
}
