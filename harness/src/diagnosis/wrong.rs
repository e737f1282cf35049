//! What a wrong engine would read: the scene, light and meters that it takes for those asked for, and what it then
//! does to the readings. Changes compose, so that two faults at once are one after the other.

use std::sync::{Arc, OnceLock};

use glam::DVec3;
use luminaire::photometry::TypeCLimits;
use luminaire::scene::{Bounces, Luminaire, LuminaireModel, Meter, Scene, Transport};
use luminaire::simulator::{self, Accuracy};

use super::rough::Rough;
use super::tables;
use crate::procedures::{Target, Task};

/// Light is predicted to this relative error at least; it turns out a hundred times better.
const ACCURACY: f64 = 1e-2;
/// Half width of what a prediction's own error is corrected by: the reference knows the unchanged scene better.
const CORRECTED: f64 = 0.25;
/// What a luminaire seen from a meter costs where a box may hide it; where nothing does, that is the unit of work.
const BEHIND_BOXES: u64 = 20;
/// The same of a luminous opening, which is integrated over for milliseconds.
const OPENING: u64 = 20_000;
/// What the simulator's reflected light costs a luminaire, and more for every meter: many ask for finer solutions.
const FINE: [u64; 2] = [1_000_000, 10_000];

/// A task as a wrong engine takes it.
#[derive(Clone)]
pub struct Wrong {
    task: Task,
    /// Whether scene, meters or light are other than asked, so that they must be solved for.
    is_relit: bool,
    /// Whether that is so of the meters.
    are_moved: bool,
    /// Whether light counts from its second reflection on.
    is_without_first: bool,
    pub law: Law,
    /// On every reading.
    pub factor: f64,
    pub readouts: Vec<Readout>,
}

/// The powers of what straight light depends on: 1, 1 and 2 are right.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Law {
    pub intensity: i32,
    pub cosine: i32,
    pub distance: i32,
    /// Of the cosine at the luminaire, on which nothing depends.
    pub emission: i32,
    /// Whether of several luminaires the brightest alone counts.
    pub is_of_brightest: bool,
    /// Whether light from behind counts like light from the front.
    pub is_two_sided: bool,
}

/// What is done to readings, one after the other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Readout {
    /// In lux.
    AtMost(f64),
    /// In lux.
    Plus(f64),
    Order(Order),
}

/// In which order the meters of a set are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    Reversed,
    /// Each reads what the next should.
    Next,
    /// Each reads what the one before should.
    Previous,
    /// The columns of a grid are taken for its rows.
    Exchanged,
}

impl Law {
    pub const RIGHT: Self =
        Self { intensity: 1, cosine: 1, distance: 2, emission: 0, is_of_brightest: false, is_two_sided: false };
}

impl Wrong {
    /// Nothing is wrong yet.
    pub fn new(task: &Task) -> Self {
        let (is_relit, are_moved, is_without_first) = (false, false, false);
        Self {
            task: task.clone(),
            is_relit,
            are_moved,
            is_without_first,
            law: Law::RIGHT,
            factor: 1.0,
            readouts: vec![],
        }
    }

    pub const fn task(&self) -> &Task {
        &self.task
    }

    pub fn scene(&mut self) -> &mut Scene {
        self.is_relit = true;
        &mut self.task.scene
    }

    /// Changes luminaires; says whether any was.
    pub fn luminaires(&mut self, change: impl Fn(&mut Luminaire) -> bool) -> bool {
        let changed = self.task.scene.luminaires.iter_mut().map(change).fold(false, |any, one| any | one);
        self.is_relit |= changed;
        changed
    }

    /// Dims luminaires by a factor of their own, where it has one; says whether any is dimmed.
    pub fn dimmed(&mut self, factor: impl Fn(&Luminaire) -> Option<f64>) -> bool {
        if let [luminaire] = &self.task.scene.luminaires[..] {
            let factor = factor(luminaire);
            self.factor *= factor.unwrap_or(1.0);
            return factor.is_some();
        }
        self.luminaires(|l| {
            let factor = factor(l);
            l.flux_scale *= factor.unwrap_or(1.0);
            factor.is_some()
        })
    }

    pub fn transport(&mut self, transport: Transport) {
        self.is_relit = true;
        self.task.transport = transport;
    }

    /// Leaves light out that is reflected once.
    pub fn without_first(&mut self) {
        (self.is_relit, self.is_without_first) = (true, true);
    }

    pub fn meters(&mut self, change: impl Fn(&mut Meter)) {
        (self.is_relit, self.are_moved) = (true, true);
        self.task.targets.iter_mut().flat_map(|t| &mut t.aspects).for_each(|a| change(&mut a.meter));
    }
}

/// How well reflected light is predicted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fidelity {
    /// In a millisecond, to percents.
    Rough,
    /// By the simulator.
    Fine,
}

/// By station, in lux.
#[derive(Clone, Debug)]
struct Light {
    direct: Vec<f64>,
    reflected: Vec<f64>,
}

/// Right light, and what its reference has over it, by target.
type Base = (Light, Vec<f64>);

/// What a prediction costs, counted and never timed, so that the same seed says the same on a busy machine. One is a
/// luminaire seen from a meter: a tenth of a microsecond or two.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// What is right of the task, where that is needed; it is solved for once.
    pub right: u64,
    pub wrong: u64,
}

/// A task with what is right of it.
pub struct Model {
    pub case: usize,
    pub task: Task,
    /// One a target, in its unit.
    pub right: Vec<f64>,
    /// By our own rough and fine predictions, and what the reference has over them, by target; nothing where that
    /// cannot be had in a moment.
    light: [OnceLock<Option<Base>>; 2],
    rough: OnceLock<Option<Rough>>,
}

impl Model {
    /// Engines get tables of type C, and so do faults.
    pub fn new(case: usize, task: &Task, right: Vec<f64>) -> Self {
        let mut task = task.clone();
        task.scene.luminaires.iter_mut().for_each(|l| *l = l.in_type_c(TypeCLimits::default()));
        Self { case, task, right, light: [OnceLock::new(), OnceLock::new()], rough: OnceLock::new() }
    }

    /// What is right, and by how much that is corrected.
    fn light(&self, fidelity: Fidelity) -> Option<&Base> {
        let solved = || {
            let light = self.solved(&self.task, Law::RIGHT, fidelity)?;
            let corrections = corrections(&self.task, &light, &self.right, fidelity);
            Some((light, corrections))
        };
        self.light[usize::from(fidelity == Fidelity::Fine)].get_or_init(solved).as_ref()
    }

    fn solved(&self, task: &Task, law: Law, fidelity: Fidelity) -> Option<Light> {
        let rough = match fidelity {
            Fidelity::Rough => {
                self.rough.get_or_init(|| Some(Rough::new(task.scene.room.as_ref()?, &meters(&self.task)))).as_ref()
            }
            Fidelity::Fine => None,
        };
        light(task, law, rough)
    }

    /// Whether a prediction takes no time worth speaking of.
    pub fn is_cheap(&self) -> bool {
        self.task.transport == Transport::Direct
    }

    /// Whether predictions rest on thinned tables.
    pub fn is_thinned(&self) -> bool {
        !self.is_cheap() && self.task.scene.luminaires.iter().any(|l| tables::thinned(&mut l.clone()))
    }

    /// The same task at some of its targets.
    #[must_use]
    pub fn at(&self, places: &[usize]) -> Self {
        let task =
            Task { targets: places.iter().map(|k| self.task.targets[*k].clone()).collect(), ..self.task.clone() };
        Self::new(self.case, &task, places.iter().map(|k| self.right[*k]).collect())
    }

    /// Whether light is solved for and not known.
    fn is_other_light(wrong: &Wrong) -> bool {
        wrong.is_relit || wrong.law != Law::RIGHT
    }

    fn is_one_each(&self) -> bool {
        self.task.targets.iter().all(|t| t.aspects.len() == 1)
    }

    /// What it costs to say what is read.
    pub fn work(&self, wrong: &Wrong, fidelity: Fidelity) -> Work {
        let stations = self.task.targets.iter().map(|t| t.aspects.len() as u64).sum();
        let is_other = Self::is_other_light(wrong);
        let right = if is_other || !self.is_one_each() { work(&self.task, stations, fidelity, true) } else { 0 };
        if !is_other {
            return Work { right, wrong: stations };
        }
        let pairs = wrong.task.scene.luminaires.iter().zip(&self.task.scene.luminaires);
        let others = pairs.filter(|(other, l)| !Arc::ptr_eq(&other.photometry, &l.photometry));
        let nodes = |l: &Luminaire| {
            let table = &l.photometry.distribution;
            (table.c_deg().len() * table.gamma_deg().len()) as u64
        };
        let tables: u64 = others.map(|(other, _)| nodes(other)).sum();
        Work { right, wrong: stations + tables + work(&wrong.task, stations, fidelity, wrong.are_moved) }
    }

    /// What is read, by target; nothing where that cannot be said.
    pub fn readings(&self, wrong: &Wrong, fidelity: Fidelity) -> Option<Vec<f64>> {
        let lux = if Self::is_other_light(wrong) {
            let (_, corrections) = self.light(fidelity)?;
            let mut light = self.solved(&wrong.task, wrong.law, fidelity)?;
            if wrong.is_without_first {
                let once = Task { transport: Transport::Indirect(Bounces::AtMost(1)), ..wrong.task.clone() };
                let first = self.solved(&once, wrong.law, fidelity)?.reflected;
                light.reflected.iter_mut().zip(first).for_each(|(all, first)| *all -= first);
            }
            self.corrected(&light, corrections)
        } else if self.is_one_each() {
            self.evenly()
        } else {
            self.light(fidelity)
                .map_or_else(|| self.evenly(), |(light, corrections)| self.corrected(light, corrections))
        };
        let finish = |lux: f64| wrong.readouts.iter().fold(lux * wrong.factor, |lux, readout| readout.of_one(lux));
        let lux: Vec<f64> = lux.into_iter().map(finish).collect();
        let mut readings = summed(&self.task, &lux);
        for readout in &wrong.readouts {
            if let Readout::Order(order) = readout {
                readings = order.of_all(&self.task, &readings)?;
            }
        }
        readings.iter().all(|r| r.is_finite()).then_some(readings)
    }

    fn corrected(&self, light: &Light, corrections: &[f64]) -> Vec<f64> {
        let is_direct = self.task.transport == Transport::Direct;
        // Reflected light that nobody asked for is as it is solved for.
        let (all, some) = if is_direct { (&light.direct, &light.reflected) } else { (&light.reflected, &light.direct) };
        let of_target = |(target, by): (&Target, &f64)| std::iter::repeat_n(*by, target.aspects.len());
        let by = self.task.targets.iter().zip(corrections).flat_map(of_target);
        all.iter().zip(some).zip(by).map(|((all, some), by)| all * by + some).collect()
    }

    /// What every station of a target would read were they alike.
    fn evenly(&self) -> Vec<f64> {
        let of_target = |(target, right): (&Target, &f64)| {
            let weight: f64 = target.aspects.iter().map(|a| a.weight).sum();
            // What weighs nothing, the luminance of a black surface, tells nothing of its light.
            vec![if weight > 0.0 { right / weight } else { 0.0 }; target.aspects.len()]
        };
        self.task.targets.iter().zip(&self.right).flat_map(of_target).collect()
    }
}

fn summed(task: &Task, lux: &[f64]) -> Vec<f64> {
    let mut lux = lux.iter();
    let of_target = |t: &Target| t.aspects.iter().zip(lux.by_ref()).map(|(aspect, lux)| aspect.weight * lux).sum();
    task.targets.iter().map(of_target).collect()
}

fn meters(task: &Task) -> Vec<Meter> {
    task.targets.iter().flat_map(|t| &t.aspects).map(|a| a.meter).collect()
}

/// What the light of a task costs.
fn work(task: &Task, stations: u64, fidelity: Fidelity, are_moved: bool) -> u64 {
    let scene = &task.scene;
    let of_one = |l: &Luminaire| match l.model {
        LuminaireModel::Point if scene.obstacles.is_empty() => 1,
        LuminaireModel::Point => BEHIND_BOXES,
        LuminaireModel::Area | LuminaireModel::Impostor => OPENING,
    };
    let straight = stations * scene.luminaires.iter().map(of_one).sum::<u64>();
    let reflected = match fidelity {
        _ if !is_bare(scene) => 0,
        Fidelity::Rough => Rough::work(scene.luminaires.len() as u64, if are_moved { stations } else { 0 }),
        Fidelity::Fine => (FINE[0] + FINE[1] * stations) * scene.luminaires.len() as u64,
    };
    match task.transport {
        Transport::Direct => straight,
        Transport::Indirect(_) => reflected,
        Transport::Total(_) => straight + reflected,
    }
}

fn corrections(task: &Task, light: &Light, right: &[f64], fidelity: Fidelity) -> Vec<f64> {
    let (direct, reflected) = (summed(task, &light.direct), summed(task, &light.reflected));
    let of_target = |t: usize| {
        let share = match task.transport {
            Transport::Direct => right[t] / direct[t],
            _ => (right[t] - direct[t]) / reflected[t],
        };
        let is_like = (share - 1.0).abs() < CORRECTED || (fidelity == Fidelity::Rough && share > 0.0);
        if is_like && share.is_finite() { share } else { 1.0 }
    };
    (0..right.len()).map(of_target).collect()
}

/// The light of a task, by the simulator; nothing where it cannot be had in a moment.
pub fn truth(task: &Task) -> Option<Vec<f64>> {
    let light = light(task, Law::RIGHT, None)?;
    let lux: Vec<f64> = light.direct.iter().zip(&light.reflected).map(|(d, r)| d + r).collect();
    Some(summed(task, &lux))
}

fn light(task: &Task, law: Law, rough: Option<&Rough>) -> Option<Light> {
    let meters = meters(task);
    let reflected = |bounces| reflected(&task.scene, bounces, &meters, law, rough);
    let none = vec![0.0; meters.len()];
    let direct = || straight(&task.scene, &meters, law);
    Some(match task.transport {
        Transport::Direct => Light { direct: direct()?, reflected: none },
        Transport::Indirect(bounces) => Light { direct: none, reflected: reflected(bounces)? },
        // What cannot be said is soon known of reflected light.
        Transport::Total(bounces) => Light { reflected: reflected(bounces)?, direct: direct()? },
    })
}

fn straight(scene: &Scene, meters: &[Meter], law: Law) -> Option<Vec<f64>> {
    // The simulator bounds its error by a table's peak, which it looks for at every meter.
    if is_bare(scene) {
        return is_sound(scene, meters).then(|| meters.iter().map(|m| law.of_all(&scene.luminaires, m)).collect());
    }
    let right = solved(scene, meters, Transport::Direct);
    if law == Law::RIGHT {
        return right;
    }
    if scene.luminaires.len() > 1 || scene.luminaires.iter().any(|l| l.model != LuminaireModel::Point) {
        return None;
    }
    let of_meter = |(meter, right): (&Meter, f64)| {
        // What hides a single luminaire hides all.
        if right == 0.0 { 0.0 } else { law.of_all(&scene.luminaires, meter) }
    };
    Some(meters.iter().zip(right?).map(of_meter).collect())
}

/// Whether nothing hides its luminaires, which are points.
fn is_bare(scene: &Scene) -> bool {
    scene.obstacles.is_empty() && scene.luminaires.iter().all(|l| l.model == LuminaireModel::Point)
}

/// Whether all lies where the simulator takes it.
fn is_sound(scene: &Scene, meters: &[Meter]) -> bool {
    let is_inside = |p: DVec3| scene.room.is_none_or(|room| p.cmpgt(DVec3::ZERO).all() && p.cmplt(room.size_m).all());
    let is_apart = |m: &Meter| scene.luminaires.iter().all(|l| l.position_m != m.position_m);
    scene.luminaires.iter().all(|l| is_inside(l.position_m) && l.flux_scale >= 0.0)
        && meters.iter().all(|m| is_inside(m.position_m) && is_apart(m))
}

fn reflected(scene: &Scene, bounces: Bounces, meters: &[Meter], law: Law, rough: Option<&Rough>) -> Option<Vec<f64>> {
    if !is_bare(scene) {
        return None;
    }
    let mut scene = scene.clone();
    for luminaire in &mut scene.luminaires {
        if rough.is_none() {
            tables::thinned(luminaire);
        }
        // Light on its way to a surface depends on no meter.
        if law == (Law { intensity: 2, ..Law::RIGHT }) {
            tables::squared(luminaire);
        } else if law != Law::RIGHT {
            return None;
        }
    }
    match (rough, scene.room) {
        (Some(rough), Some(room)) => {
            // The simulator refuses what lies outside; so must this.
            is_sound(&scene, meters).then(|| rough.lux(&room, &scene.luminaires, meters, bounces))
        }
        _ => solved(&scene, meters, Transport::Indirect(bounces)),
    }
}

fn solved(scene: &Scene, meters: &[Meter], transport: Transport) -> Option<Vec<f64>> {
    let accuracy = Accuracy { relative_error: ACCURACY, seed: 1 };
    let solution = simulator::illuminance(scene, meters, transport, &accuracy).ok()?;
    Some(solution.estimates.iter().map(|e| e.illuminance.value()).collect())
}

impl Law {
    fn illuminance(self, luminaire: &Luminaire, meter: &Meter) -> f64 {
        let towards: DVec3 = luminaire.position_m - meter.position_m;
        let distance = towards.length();
        let cosine = towards.dot(meter.normal) / distance;
        if cosine <= 0.0 && !self.is_two_sided {
            return 0.0;
        }
        let intensity = luminaire.intensity_towards(-towards).value();
        let emission = (luminaire.orientation.z_axis.dot(towards) / distance).abs().powi(self.emission);
        intensity.powi(self.intensity) * emission * cosine.abs().powi(self.cosine) / distance.powi(self.distance)
    }

    /// Of all luminaires.
    fn of_all(self, luminaires: &[Luminaire], meter: &Meter) -> f64 {
        let each = luminaires.iter().map(|l| self.illuminance(l, meter));
        if self.is_of_brightest { each.fold(0.0, f64::max) } else { each.sum() }
    }
}

impl Readout {
    fn of_one(self, lux: f64) -> f64 {
        match self {
            Self::AtMost(most) => lux.min(most),
            Self::Plus(more) => lux + more,
            Self::Order(_) => lux,
        }
    }
}

impl Order {
    /// Within each set of meters; nothing where no set has such an order.
    fn of_all(self, task: &Task, readings: &[f64]) -> Option<Vec<f64>> {
        let set = |k: usize| task.targets[k].id.0.rsplit_once('[').map_or("", |(set, _)| set);
        let (mut all, mut any) = (vec![], false);
        while all.len() < readings.len() {
            let first = all.len();
            let count = (first..readings.len()).take_while(|k| set(*k) == set(first)).count();
            let places: Vec<DVec3> = task.targets[first..first + count].iter().map(|t| t.meter.position_m).collect();
            for k in 0..count {
                let source = self.source(k, &places);
                any |= source.is_some();
                all.push(readings[first + source.unwrap_or(k)]);
            }
        }
        any.then_some(all)
    }

    /// Whose reading is taken for that of the `k`-th.
    fn source(self, k: usize, places: &[DVec3]) -> Option<usize> {
        let count = places.len();
        match self {
            Self::Reversed => Some(count - 1 - k),
            Self::Next => Some((k + 1) % count),
            Self::Previous => Some((k + count - 1) % count),
            Self::Exchanged => {
                let step = *places.get(1)? - places[0];
                let goes_on = |k: &usize| (places[*k] - places[k - 1]).distance(step) < 1e-6;
                let columns = 1 + (1..count).take_while(goes_on).count();
                let rows = count / columns;
                (columns > 1 && rows > 1 && rows * columns == count).then(|| (k % rows) * columns + k / rows)
            }
        }
    }
}
