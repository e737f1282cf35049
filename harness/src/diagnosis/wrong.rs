//! What a wrong engine would read: the scene, light and meters that it takes for those asked for, and what it then
//! does to the readings. Changes compose, so that two faults at once are one after the other.

use std::sync::OnceLock;

use glam::DVec3;
use luminaire::scene::{Bounces, Luminaire, LuminaireModel, Meter, Scene, Transport};
use luminaire::simulator::{self, Accuracy};

use super::rough::Rough;
use super::tables;
use crate::procedures::Task;

/// Light is predicted to this relative error at least; it turns out a hundred times better.
const ACCURACY: f64 = 1e-2;
/// Half width of what a prediction's own error is corrected by: the reference knows the unchanged scene better.
const CORRECTED: f64 = 0.25;

/// A task as a wrong engine takes it.
#[derive(Clone)]
pub struct Wrong {
    task: Task,
    /// Whether scene, meters or light are other than asked, so that they must be solved for.
    is_relit: bool,
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
    pub const RIGHT: Self = Self { intensity: 1, cosine: 1, distance: 2 };
}

impl Wrong {
    /// Nothing is wrong yet.
    pub fn new(task: &Task) -> Self {
        Self { task: task.clone(), is_relit: false, law: Law::RIGHT, factor: 1.0, readouts: vec![] }
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

    pub fn meters(&mut self, change: impl Fn(&mut Meter)) {
        self.is_relit = true;
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
    pub fn new(case: usize, task: &Task, right: Vec<f64>) -> Self {
        Self { case, task: task.clone(), right, light: [OnceLock::new(), OnceLock::new()], rough: OnceLock::new() }
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
            Fidelity::Rough => self.rough.get_or_init(|| task.scene.room.as_ref().map(Rough::new)).as_ref(),
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

    /// What is read, by target; nothing where that cannot be said.
    pub fn readings(&self, wrong: &Wrong, fidelity: Fidelity) -> Option<Vec<f64>> {
        let lux = if wrong.is_relit || wrong.law != Law::RIGHT {
            let (_, corrections) = self.light(fidelity)?;
            self.corrected(&self.solved(&wrong.task, wrong.law, fidelity)?, corrections)
        } else if self.task.targets.iter().all(|t| t.aspects.len() == 1) {
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
        Some(readings)
    }

    fn corrected(&self, light: &Light, corrections: &[f64]) -> Vec<f64> {
        let is_direct = self.task.transport == Transport::Direct;
        let of_target = |t: usize| self.task.stations_of(t).map(move |s| (t, s));
        let lux = |(t, s): (usize, usize)| {
            let (all, some) = if is_direct { (light.direct[s], 0.0) } else { (light.reflected[s], light.direct[s]) };
            all * corrections[t] + some
        };
        (0..self.task.targets.len()).flat_map(of_target).map(lux).collect()
    }

    /// What every station of a target would read were they alike.
    fn evenly(&self) -> Vec<f64> {
        let of_target = |(target, right): (&crate::procedures::Target, &f64)| {
            let weight: f64 = target.aspects.iter().map(|a| a.weight).sum();
            vec![right / weight; target.aspects.len()]
        };
        self.task.targets.iter().zip(&self.right).flat_map(of_target).collect()
    }
}

fn summed(task: &Task, lux: &[f64]) -> Vec<f64> {
    let of_target = |t: usize| {
        let stations = task.stations_of(t).zip(&task.targets[t].aspects);
        stations.map(|(s, aspect)| aspect.weight * lux[s]).sum()
    };
    (0..task.targets.len()).map(of_target).collect()
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
    let meters: Vec<Meter> = task.targets.iter().flat_map(|t| &t.aspects).map(|a| a.meter).collect();
    let reflected = |bounces| reflected(&task.scene, bounces, &meters, law, rough);
    let none = vec![0.0; meters.len()];
    let direct = || straight(&task.scene, &meters, law);
    Some(match task.transport {
        Transport::Direct => Light { direct: direct()?, reflected: none },
        Transport::Indirect(bounces) => Light { direct: none, reflected: reflected(bounces)? },
        Transport::Total(bounces) => Light { direct: direct()?, reflected: reflected(bounces)? },
    })
}

fn straight(scene: &Scene, meters: &[Meter], law: Law) -> Option<Vec<f64>> {
    let right = solved(scene, meters, Transport::Direct);
    if law == Law::RIGHT {
        return right;
    }
    let points_only = scene.luminaires.iter().all(|l| l.model == LuminaireModel::Point);
    if !points_only || (!scene.obstacles.is_empty() && scene.luminaires.len() > 1) {
        return None;
    }
    let of_meter = |(meter, right): (&Meter, f64)| {
        // What hides a single luminaire hides all.
        if right == 0.0 { 0.0 } else { scene.luminaires.iter().map(|l| law.illuminance(l, meter)).sum() }
    };
    Some(meters.iter().zip(right?).map(of_meter).collect())
}

fn reflected(scene: &Scene, bounces: Bounces, meters: &[Meter], law: Law, rough: Option<&Rough>) -> Option<Vec<f64>> {
    let is_bare = |l: &Luminaire| l.model == LuminaireModel::Point;
    if !scene.obstacles.is_empty() || !scene.luminaires.iter().all(is_bare) {
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
            let is_inside = |p: DVec3| p.cmpgt(DVec3::ZERO).all() && p.cmplt(room.size_m).all();
            let places = meters.iter().map(|m| m.position_m).chain(scene.luminaires.iter().map(|l| l.position_m));
            let lux = || rough.lux(&room, &scene.luminaires, meters, bounces);
            places.into_iter().all(is_inside).then(lux)
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
        if cosine <= 0.0 {
            return 0.0;
        }
        let intensity = luminaire.intensity_towards(-towards).value();
        intensity.powi(self.intensity) * cosine.powi(self.cosine) / distance.powi(self.distance)
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
