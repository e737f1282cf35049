//! A task as a faulty engine takes it, with the readings that follow: other scenes, light, meters or readouts.
//!
//! Changes compose: two faults at once are two changes, one after the other.

use std::sync::{Arc, OnceLock};

use glam::DVec3;
use luxproof_photometry::TypeCLimits;
use luxproof_scene::geometry::Surface;
use luxproof_scene::{Bounces, Luminaire, LuminaireModel, Meter, Scene, Transport};
use luxproof_simulator::Accuracy;

use super::distance_law::DistanceLaw;
use super::edges;
use super::radiosity::PatchRadiosity;
use super::tables;
use luxproof_spec::procedures::{Target, Task};

/// Relative error that the simulator is asked for; what it reaches is a hundred times better.
const ACCURACY: f64 = 1e-2;
/// How far a corner reaches, as a part of the room's smallest side.
const CORNER_SHARE: f64 = 0.02;
/// Largest relative correction of a fine prediction: the reference knows the unchanged scene better.
const MAX_CORRECTION: f64 = 0.25;
/// Cost of a luminaire seen from a meter where a box may hide it. The unit of work is one that nothing hides.
const WORK_BEHIND_BOXES: u64 = 20;
/// Cost of a luminous opening seen from a meter: its integral takes milliseconds.
const WORK_OF_OPENING: u64 = 20_000;
/// Cost of the simulator's reflected light of a scene without its luminaires and meters.
const FINE_WORK_PER_SCENE: u64 = 1_000_000;
const FINE_WORK_PER_LUMINAIRE: u64 = 250_000;
const FINE_WORK_PER_METER: u64 = 4_000;
const FINE_WORK_PER_NODE: u64 = 50;
/// Steps from meter to meter of a grid agree to this many meters.
const MAX_STEP_DIFFERENCE_M: f64 = 1e-6;

/// A task as a faulty engine takes it.
#[derive(Clone)]
pub struct FaultyTask {
    task: Task,
    /// Whether scene, meters or light differ from the task's, so that light must be solved for.
    is_relit: bool,
    has_moved_meters: bool,
    /// How often single reflections count, where not once.
    reflection_weights: Vec<(u32, f64)>,
    /// How often each reflection after the first counts, relative to the one before.
    later_weight: f64,
    pub law: Law,
    /// Factor on every reading.
    pub factor: f64,
    pub readouts: Vec<Readout>,
}

/// What direct light depends on: powers of 1 are right, and the inverse square of the distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Law {
    pub intensity: i32,
    pub cosine: f64,
    pub distance: DistanceLaw,
    /// Power of the cosine at the luminaire; 0 is right.
    pub emission: f64,
    /// Whether only the brightest of several luminaires counts.
    pub counts_brightest_only: bool,
    /// Whether light from behind counts like light from the front.
    pub is_two_sided: bool,
}

/// What a faulty engine does to readings, one after the other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Readout {
    /// In lux.
    AtMost(f64),
    /// In lux.
    AtLeast(f64),
    /// In lux.
    Plus(f64),
    /// To a power of the value as a part of a level in lux.
    Power {
        exponent: f64,
        level: f64,
    },
    /// Multiples of a step in lux.
    Step(f64, Rounding),
    Order(Order, Sequence),
}

/// How readings become multiples of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rounding {
    Nearest,
    Down,
    Up,
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

/// Which meters are one sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sequence {
    Set,
    /// All meters of a job, whatever their sets.
    Job,
}

impl Law {
    pub const RIGHT: Self = Self {
        intensity: 1,
        cosine: 1.0,
        distance: DistanceLaw::RIGHT,
        emission: 0.0,
        counts_brightest_only: false,
        is_two_sided: false,
    };
}

impl FaultyTask {
    /// A task without any fault yet.
    pub fn new(task: &Task) -> Self {
        Self {
            task: task.clone(),
            is_relit: false,
            has_moved_meters: false,
            reflection_weights: vec![],
            later_weight: 1.0,
            law: Law::RIGHT,
            factor: 1.0,
            readouts: vec![],
        }
    }

    pub const fn task(&self) -> &Task {
        &self.task
    }

    /// The scene to change.
    pub fn scene_mut(&mut self) -> &mut Scene {
        self.is_relit = true;
        &mut self.task.scene
    }

    /// Changes luminaires; returns whether any changed.
    pub fn change_luminaires(&mut self, change: impl Fn(&mut Luminaire) -> bool) -> bool {
        let changed = self.task.scene.luminaires.iter_mut().map(change).fold(false, |any, one| any | one);
        self.is_relit |= changed;
        changed
    }

    /// Scales each luminaire by its factor, where it has one; returns whether any is scaled.
    pub fn scale_luminaires(&mut self, factor: impl Fn(&Luminaire) -> Option<f64>) -> bool {
        // The factor of a single luminaire is one of all readings, and needs no new light.
        if let [luminaire] = &self.task.scene.luminaires[..] {
            let factor = factor(luminaire);
            self.factor *= factor.unwrap_or(1.0);
            return factor.is_some();
        }
        self.change_luminaires(|l| {
            let factor = factor(l);
            l.flux_scale *= factor.unwrap_or(1.0);
            factor.is_some()
        })
    }

    pub fn set_transport(&mut self, transport: Transport) {
        self.is_relit = true;
        self.task.transport = transport;
    }

    /// Counts light of one reflection so many times; returns whether the task follows light so far.
    pub fn weight_reflection(&mut self, bounce: u32, weight: f64) -> bool {
        let is_followed = match self.task.transport {
            Transport::Direct => false,
            Transport::Indirect(bounces) | Transport::Total(bounces) => match bounces {
                Bounces::AtMost(most) => bounce <= most,
                Bounces::Converged => true,
            },
        };
        if is_followed {
            self.is_relit = true;
            self.reflection_weights.push((bounce, weight));
        }
        is_followed
    }

    /// Counts each reflection after the first so many times what the one before gives; returns whether there is any.
    pub fn weight_later_reflections(&mut self, weight: f64) -> bool {
        let is_followed = match self.task.transport {
            Transport::Direct => false,
            Transport::Indirect(bounces) | Transport::Total(bounces) => bounces != Bounces::AtMost(1),
        };
        self.is_relit |= is_followed;
        self.later_weight = weight;
        is_followed && self.task.scene.room.is_some()
    }

    /// How many times reflected light has to be solved for.
    fn count_reflected_solutions(&self) -> u64 {
        1 + 2 * self.reflection_weights.len() as u64 + if self.later_weight == 1.0 { 0 } else { 3 }
    }

    pub fn change_meters(&mut self, change: impl Fn(&mut Meter)) {
        self.is_relit = true;
        self.has_moved_meters = true;
        self.task.targets.iter_mut().flat_map(|t| &mut t.aspects).for_each(|a| change(&mut a.meter));
    }

    /// Whether light differs from the right light, so that it must be solved for.
    fn has_other_light(&self) -> bool {
        self.is_relit || self.law != Law::RIGHT
    }
}

/// How well reflected light is predicted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fidelity {
    /// By patch radiosity: a millisecond, good to percents.
    Rough,
    /// By the simulator.
    Fine,
}

/// Illuminance by sensor, in lux.
#[derive(Clone, Debug)]
struct Light {
    direct: Vec<f64>,
    reflected: Vec<f64>,
}

/// Right light by our own prediction, and its factors to the reference, by target.
struct CorrectedLight {
    light: Light,
    corrections: Vec<f64>,
}

/// The cost of a prediction, counted and never timed, so that a busy machine finds the same.
///
/// The unit is a luminaire seen from a meter: about a tenth of a microsecond.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// The cost of the right light, where it is needed; it is solved for once.
    pub right: u64,
    pub faulty: u64,
}

/// A task with its right readings.
pub struct Model {
    pub case: usize,
    pub task: Task,
    /// One reading a target, in its unit.
    pub right: Vec<f64>,
    /// Right light by rough and fine predictions; `None` where a prediction takes too long.
    light: [OnceLock<Option<CorrectedLight>>; 2],
    radiosity: OnceLock<Option<PatchRadiosity>>,
}

impl Model {
    /// A model with tables of type C, because engines get such tables and so do faults.
    pub fn new(case: usize, task: &Task, right: Vec<f64>) -> Self {
        let mut task = task.clone();
        task.scene.luminaires.iter_mut().for_each(|l| *l = l.in_type_c(TypeCLimits::default()));
        Self { case, task, right, light: [OnceLock::new(), OnceLock::new()], radiosity: OnceLock::new() }
    }

    /// The right light with its corrections, solved for once.
    fn right_light(&self, fidelity: Fidelity) -> Option<&CorrectedLight> {
        let cell = &self.light[usize::from(fidelity == Fidelity::Fine)];
        cell.get_or_init(|| {
            let light = self.solve_light(&self.task, Law::RIGHT, fidelity)?;
            let corrections = corrections(&self.task, &light, &self.right, fidelity);
            Some(CorrectedLight { light, corrections })
        })
        .as_ref()
    }

    fn solve_light(&self, task: &Task, law: Law, fidelity: Fidelity) -> Option<Light> {
        let radiosity = match fidelity {
            Fidelity::Rough => self
                .radiosity
                .get_or_init(|| Some(PatchRadiosity::new(task.scene.room.as_ref()?, &meters(&self.task))))
                .as_ref(),
            Fidelity::Fine => None,
        };
        solve_light(task, law, radiosity)
    }

    /// Whether a prediction takes negligible time.
    pub fn is_cheap(&self) -> bool {
        self.task.transport == Transport::Direct
    }

    /// The same task at some of its targets.
    #[must_use]
    pub fn select(&self, places: &[usize]) -> Self {
        let targets = places.iter().map(|k| self.task.targets[*k].clone()).collect();
        let task = Task { targets, ..self.task.clone() };
        Self::new(self.case, &task, places.iter().map(|k| self.right[*k]).collect())
    }

    fn has_single_aspects(&self) -> bool {
        self.task.targets.iter().all(|t| t.aspects.len() == 1)
    }

    /// Counts the cost of a prediction.
    pub fn count_work(&self, faulty: &FaultyTask, fidelity: Fidelity) -> Work {
        let sensors = self.task.targets.iter().map(|t| t.aspects.len() as u64).sum();
        let needs_right_light = faulty.has_other_light() || !self.has_single_aspects();
        let right = if needs_right_light { count_work(&self.task, sensors, fidelity, true) } else { 0 };
        if !faulty.has_other_light() {
            return Work { right, faulty: sensors };
        }
        let luminaires = faulty.task.scene.luminaires.iter().zip(&self.task.scene.luminaires);
        let changed_nodes: u64 = luminaires
            .filter(|(other, l)| !Arc::ptr_eq(&other.photometry, &l.photometry))
            .map(|(other, _)| count_nodes(other))
            .sum();
        let light =
            faulty.count_reflected_solutions() * count_work(&faulty.task, sensors, fidelity, faulty.has_moved_meters);
        let solutions = if self.may_have_edges(faulty) { edges::SOLUTIONS } else { 1 };
        Work { right, faulty: sensors + changed_nodes + solutions * light }
    }

    /// Whether a faulty task takes its direct light from other tables, which have edges where the right ones have none.
    fn may_have_edges(&self, faulty: &FaultyTask) -> bool {
        let mut luminaires = faulty.task.scene.luminaires.iter().zip(&self.task.scene.luminaires);
        let reads_other_tables = luminaires.any(|(other, l)| !Arc::ptr_eq(&other.photometry, &l.photometry));
        reads_other_tables && self.is_cheap() && is_bare(&faulty.task.scene) && faulty.readouts.is_empty()
    }

    /// Predicts the readings by target, and leaves those blank that it does not know: they are NaN.
    ///
    /// These are readings at the edges of a wrong look-up and, for a rough prediction, those in corners of the room.
    pub fn predict_with_blanks(&self, faulty: &FaultyTask, fidelity: Fidelity) -> Option<Vec<f64>> {
        let mut readings = self.predict(faulty, fidelity)?;
        let unknown = if self.may_have_edges(faulty) {
            edges::are_at_edges(&faulty.task, faulty.law)
        } else if fidelity == Fidelity::Rough && !self.is_cheap() {
            self.task.targets.iter().map(|t| self.is_in_a_corner(t)).collect()
        } else {
            return Some(readings);
        };
        for (reading, _) in readings.iter_mut().zip(unknown).filter(|(_, is_unknown)| *is_unknown) {
            *reading = f64::NAN;
        }
        Some(readings)
    }

    /// Whether a target is so close to two surfaces of the room that patches do not resolve their light.
    fn is_in_a_corner(&self, target: &Target) -> bool {
        let Some(room) = self.task.scene.room else { return false };
        let near_m = CORNER_SHARE * room.size_m.min_element();
        target.aspects.iter().any(|aspect| {
            let low_m = aspect.meter.position_m;
            let distances_m = [low_m, room.size_m - low_m].map(|distances_m| distances_m.to_array());
            distances_m.as_flattened().iter().filter(|distance_m| **distance_m < near_m).count() > 1
        })
    }

    /// Predicts the readings by target; `None` where they cannot be predicted.
    pub fn predict(&self, faulty: &FaultyTask, fidelity: Fidelity) -> Option<Vec<f64>> {
        let mut lux = if faulty.has_other_light() {
            self.predict_other_light(faulty, fidelity)?
        } else if self.has_single_aspects() {
            self.spread_evenly()
        } else {
            self.right_light(fidelity)
                .map_or_else(|| self.spread_evenly(), |right| self.correct(&right.light, &right.corrections))
        };
        for lux in &mut lux {
            *lux = faulty.readouts.iter().fold(*lux * faulty.factor, |lux, readout| readout.apply(lux));
        }
        let mut readings = sum_aspects(&self.task, &lux);
        for readout in &faulty.readouts {
            if let Readout::Order(order, of) = readout {
                readings = order.apply(*of, &self.task, &readings)?;
            }
        }
        readings.iter().all(|r| r.is_finite()).then_some(readings)
    }

    /// Solves for the light of a faulty task, with the corrections of the right one.
    fn predict_other_light(&self, faulty: &FaultyTask, fidelity: Fidelity) -> Option<Vec<f64>> {
        let corrections = &self.right_light(fidelity)?.corrections;
        let mut light = self.solve_light(&faulty.task, faulty.law, fidelity)?;
        if faulty.later_weight != 1.0 {
            light.reflected = self.reflect_with_weight(faulty, fidelity)?;
        }
        for &(bounce, weight) in &faulty.reflection_weights {
            let up_to = self.reflected_up_to(&faulty.task, bounce, faulty.law, fidelity)?;
            let before = match bounce {
                1 => vec![0.0; up_to.len()],
                _ => self.reflected_up_to(&faulty.task, bounce - 1, faulty.law, fidelity)?,
            };
            for ((all, up_to), before) in light.reflected.iter_mut().zip(up_to).zip(before) {
                *all += (weight - 1.0) * (up_to - before);
            }
        }
        Some(self.correct(&light, corrections))
    }

    /// Light of at most so many reflections, sensor by sensor.
    fn reflected_up_to(&self, task: &Task, bounces: u32, law: Law, fidelity: Fidelity) -> Option<Vec<f64>> {
        let cut = Task { transport: Transport::Indirect(Bounces::AtMost(bounces)), ..task.clone() };
        Some(self.solve_light(&cut, law, fidelity)?.reflected)
    }

    /// Reflected light in which each reflection after the first has a weight.
    ///
    /// With reflectances that are so many times as large, every reflection has the weight; the first one loses it again.
    fn reflect_with_weight(&self, faulty: &FaultyTask, fidelity: Fidelity) -> Option<Vec<f64>> {
        let once = self.reflected_up_to(&faulty.task, 1, faulty.law, fidelity)?;
        let weight = faulty.later_weight;
        if weight <= 0.0 {
            return Some(once);
        }
        let mut brighter = faulty.task.clone();
        let reflectance = &mut brighter.scene.room.as_mut()?.reflectance;
        for surface in Surface::ALL {
            let changed = weight * reflectance.of(surface);
            if changed >= 1.0 {
                return None;
            }
            *reflectance.of_mut(surface) = changed;
        }
        let all = self.solve_light(&brighter, faulty.law, fidelity)?.reflected;
        let first = self.reflected_up_to(&brighter, 1, faulty.law, fidelity)?;
        Some(once.iter().zip(all).zip(first).map(|((once, all), first)| once + (all - first) / weight).collect())
    }

    /// Corrects the light that the task asks for, sensor by sensor.
    fn correct(&self, light: &Light, corrections: &[f64]) -> Vec<f64> {
        let is_direct = self.task.transport == Transport::Direct;
        // The corrections come from the light asked for; a fault may add the other, which stays as solved for.
        let (asked, other) =
            if is_direct { (&light.direct, &light.reflected) } else { (&light.reflected, &light.direct) };
        let by_target = self.task.targets.iter().zip(corrections);
        let by_station = by_target.flat_map(|(target, factor)| std::iter::repeat_n(*factor, target.aspects.len()));
        asked.iter().zip(other).zip(by_station).map(|((asked, other), factor)| asked * factor + other).collect()
    }

    /// The illuminance of every sensor, were the sensors of a target equally lit.
    fn spread_evenly(&self) -> Vec<f64> {
        let mut lux = vec![];
        for (target, right) in self.task.targets.iter().zip(&self.right) {
            let weight: f64 = target.aspects.iter().map(|a| a.weight).sum();
            // The luminance of a black surface weighs nothing, and so does not show its light.
            let each = if weight > 0.0 { right / weight } else { 0.0 };
            lux.extend(std::iter::repeat_n(each, target.aspects.len()));
        }
        lux
    }
}

/// Sums the weighted illuminance of each target's sensors.
fn sum_aspects(task: &Task, lux: &[f64]) -> Vec<f64> {
    let mut lux = lux.iter();
    let mut sums = vec![];
    for target in &task.targets {
        sums.push(target.aspects.iter().zip(lux.by_ref()).map(|(aspect, lux)| aspect.weight * lux).sum());
    }
    sums
}

fn meters(task: &Task) -> Vec<Meter> {
    task.targets.iter().flat_map(|t| &t.aspects).map(|a| a.meter).collect()
}

fn count_nodes(luminaire: &Luminaire) -> u64 {
    let table = &luminaire.photometry.distribution;
    (table.c_deg().len() * table.gamma_deg().len()) as u64
}

/// Counts the cost of a task's light.
fn count_work(task: &Task, sensors: u64, fidelity: Fidelity, has_moved_meters: bool) -> u64 {
    let scene = &task.scene;
    let luminaires = scene.luminaires.len() as u64;
    let direct = sensors * scene.luminaires.iter().map(|l| direct_work(l, scene)).sum::<u64>();
    let reflected = match fidelity {
        _ if !is_bare(scene) => 0,
        Fidelity::Rough => PatchRadiosity::count_work(luminaires, if has_moved_meters { sensors } else { 0 }),
        Fidelity::Fine => {
            let nodes: u64 = scene.luminaires.iter().map(count_nodes).sum();
            FINE_WORK_PER_SCENE
                + FINE_WORK_PER_LUMINAIRE * luminaires
                + FINE_WORK_PER_METER * sensors
                + FINE_WORK_PER_NODE * nodes
        }
    };
    match task.transport {
        Transport::Direct => direct,
        Transport::Indirect(_) => reflected,
        Transport::Total(_) => direct + reflected,
    }
}

/// The cost of a luminaire seen from one meter.
fn direct_work(luminaire: &Luminaire, scene: &Scene) -> u64 {
    match luminaire.model {
        LuminaireModel::Point if scene.obstacles.is_empty() => 1,
        LuminaireModel::Point => WORK_BEHIND_BOXES,
        LuminaireModel::Area | LuminaireModel::Impostor => WORK_OF_OPENING,
    }
}

/// Factors from our right light to the reference, by target; 1 where the two have little in common.
fn corrections(task: &Task, light: &Light, right: &[f64], fidelity: Fidelity) -> Vec<f64> {
    let (direct, reflected) = (sum_aspects(task, &light.direct), sum_aspects(task, &light.reflected));
    let mut corrections = vec![];
    for (t, right) in right.iter().enumerate() {
        let factor = match task.transport {
            Transport::Direct => right / direct[t],
            _ => (right - direct[t]) / reflected[t],
        };
        let is_close = (factor - 1.0).abs() < MAX_CORRECTION || (fidelity == Fidelity::Rough && factor > 0.0);
        corrections.push(if is_close && factor.is_finite() { factor } else { 1.0 });
    }
    corrections
}

/// Solves for the right readings of a task by the simulator; `None` where that takes too long.
pub fn truth(task: &Task) -> Option<Vec<f64>> {
    let light = solve_light(task, Law::RIGHT, None)?;
    let lux: Vec<f64> = light.direct.iter().zip(&light.reflected).map(|(d, r)| d + r).collect();
    Some(sum_aspects(task, &lux))
}

fn solve_light(task: &Task, law: Law, radiosity: Option<&PatchRadiosity>) -> Option<Light> {
    let meters = meters(task);
    let none = vec![0.0; meters.len()];
    Some(match task.transport {
        Transport::Direct => Light { direct: solve_direct(&task.scene, &meters, law)?, reflected: none },
        Transport::Indirect(bounces) => {
            Light { direct: none, reflected: solve_reflected(&task.scene, bounces, &meters, law, radiosity)? }
        }
        // Reflected light comes first, because it fails early where there is no solution.
        Transport::Total(bounces) => Light {
            reflected: solve_reflected(&task.scene, bounces, &meters, law, radiosity)?,
            direct: solve_direct(&task.scene, &meters, law)?,
        },
    })
}

fn solve_direct(scene: &Scene, meters: &[Meter], law: Law) -> Option<Vec<f64>> {
    // The simulator searches a table's peak at every meter for its error bound; bare points do without.
    if is_bare(scene) {
        return is_valid(scene, meters).then(|| meters.iter().map(|m| law.sum(&scene.luminaires, m)).collect());
    }
    let right = simulate(scene, meters, Transport::Direct);
    if law == Law::RIGHT {
        return right;
    }
    if scene.luminaires.len() > 1 || scene.luminaires.iter().any(|l| l.model != LuminaireModel::Point) {
        return None;
    }
    let mut lux = vec![];
    for (meter, right) in meters.iter().zip(right?) {
        // What hides the single luminaire hides all light, whatever the law.
        lux.push(if right == 0.0 { 0.0 } else { law.sum(&scene.luminaires, meter) });
    }
    Some(lux)
}

/// Whether all luminaires are points and nothing hides them.
fn is_bare(scene: &Scene) -> bool {
    scene.obstacles.is_empty() && scene.luminaires.iter().all(|l| l.model == LuminaireModel::Point)
}

/// Whether the simulator accepts all luminaires and meters.
fn is_valid(scene: &Scene, meters: &[Meter]) -> bool {
    let luminaires = &scene.luminaires;
    luminaires.iter().all(|l| is_inside(scene, l.position_m) && l.flux_scale >= 0.0)
        && meters
            .iter()
            .all(|m| is_inside(scene, m.position_m) && luminaires.iter().all(|l| l.position_m != m.position_m))
}

/// Whether a point lies inside the room, where there is one.
fn is_inside(scene: &Scene, point: DVec3) -> bool {
    scene.room.is_none_or(|room| point.cmpgt(DVec3::ZERO).all() && point.cmplt(room.size_m).all())
}

fn solve_reflected(
    scene: &Scene,
    bounces: Bounces,
    meters: &[Meter],
    law: Law,
    radiosity: Option<&PatchRadiosity>,
) -> Option<Vec<f64>> {
    if !is_bare(scene) {
        return None;
    }
    let mut scene = scene.clone();
    for luminaire in &mut scene.luminaires {
        // Light on its way to a surface depends on no meter: of all laws only that of the intensity matters.
        if law == (Law { intensity: 2, ..Law::RIGHT }) {
            tables::square_candela(luminaire);
        } else if law != Law::RIGHT {
            return None;
        }
    }
    match (radiosity, scene.room) {
        (Some(radiosity), Some(room)) => {
            // The simulator refuses what lies outside, so patch radiosity must refuse it too.
            is_valid(&scene, meters).then(|| radiosity.illuminance(&room, &scene.luminaires, meters, bounces))
        }
        _ => simulate(&scene, meters, Transport::Indirect(bounces)),
    }
}

fn simulate(scene: &Scene, meters: &[Meter], transport: Transport) -> Option<Vec<f64>> {
    let accuracy = Accuracy { relative_error: ACCURACY, seed: 1 };
    let solution = luxproof_simulator::illuminance(scene, meters, transport, &accuracy).ok()?;
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
        let emission = (luminaire.orientation.z_axis.dot(towards) / distance).abs();
        let angles = power(emission, self.emission) * power(cosine.abs(), self.cosine);
        intensity.powi(self.intensity) * angles * self.distance.attenuation(distance)
    }

    /// Adds up the light of all luminaires.
    pub(super) fn sum(self, luminaires: &[Luminaire], meter: &Meter) -> f64 {
        let each = luminaires.iter().map(|l| self.illuminance(l, meter));
        if self.counts_brightest_only { each.fold(0.0, f64::max) } else { each.sum() }
    }
}

/// A power, without the rounding of a general one where it is 0 or 1.
fn power(base: f64, exponent: f64) -> f64 {
    match exponent {
        0.0 => 1.0,
        1.0 => base,
        _ => base.powf(exponent),
    }
}

impl Readout {
    /// Changes one illuminance; an order changes none.
    fn apply(self, lux: f64) -> f64 {
        match self {
            Self::AtMost(most) => lux.min(most),
            Self::AtLeast(least) => lux.max(least),
            // Light is not negative.
            Self::Plus(more) => (lux + more).max(0.0),
            Self::Power { exponent, level } => level * power(lux / level, exponent),
            Self::Step(step, Rounding::Nearest) => step * (lux / step).round(),
            Self::Step(step, Rounding::Down) => step * (lux / step).floor(),
            Self::Step(step, Rounding::Up) => step * (lux / step).ceil(),
            Self::Order(..) => lux,
        }
    }
}

impl Order {
    /// Reorders the readings within each sequence of meters; `None` where no sequence has such an order.
    fn apply(self, of: Sequence, task: &Task, readings: &[f64]) -> Option<Vec<f64>> {
        let mut reordered = vec![];
        let mut changes_any = false;
        let targets = &task.targets[..readings.len()];
        for set in targets.chunk_by(|a, b| of == Sequence::Job || set_name(a) == set_name(b)) {
            let first = reordered.len();
            let places: Vec<DVec3> = set.iter().map(|t| t.meter.position_m).collect();
            for k in 0..set.len() {
                let source = self.source(k, &places);
                changes_any |= source.is_some();
                reordered.push(readings[first + source.unwrap_or(k)]);
            }
        }
        changes_any.then_some(reordered)
    }

    /// Which reading is taken for that of the `k`-th meter.
    fn source(self, k: usize, places: &[DVec3]) -> Option<usize> {
        let count = places.len();
        match self {
            Self::Reversed => Some(count - 1 - k),
            Self::Next => Some((k + 1) % count),
            Self::Previous => Some((k + count - 1) % count),
            Self::Exchanged => {
                let step = *places.get(1)? - places[0];
                let steps = places.windows(2).map(|pair| pair[1] - pair[0]);
                let columns = 1 + steps.take_while(|other| other.distance(step) < MAX_STEP_DIFFERENCE_M).count();
                let rows = count / columns;
                (columns > 1 && rows > 1 && rows * columns == count).then(|| (k % rows) * columns + k / rows)
            }
        }
    }
}

/// The name of the set that a target belongs to.
fn set_name(target: &Target) -> &str {
    target.id.0.rsplit_once('[').map_or("", |(set, _)| set)
}

#[cfg(test)]
mod tests;
