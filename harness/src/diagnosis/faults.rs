//! Faults that renderers and exporters are known to have, each as what a task's readings would be with it.
//!
//! The diagnosis looks for them in readings that failed, the self-test puts them in.

use std::sync::Arc;

use glam::{DMat3, DVec3};
use luminaire::geometry::{Room, Surface};
use luminaire::photometry::{LuminousIntensityDistribution, Photometry};
use luminaire::scene::{Bounces, Luminaire, LuminaireModel, Transport};
use luminaire::simulator::{self, Accuracy};

use crate::engines::Measurement;
use crate::procedures::Task;
use crate::record::Estimate;

/// Readings are predicted to this relative error at least; they turn out a hundred times better.
const ACCURACY: f64 = 1e-2;
/// A fault that changes no reading by more than this share of the largest is not there in this task.
const INVISIBLE: f64 = 1e-3;
/// Reflections after which truncation is looked for no more: it hardly shows then.
const MAX_BOUNCES: u32 = 8;
const HALF_MAX: f64 = 65504.0;

pub struct Fault {
    /// A short name, the same in every task.
    pub id: &'static str,
    pub what: String,
    pub effect: Effect,
}

pub enum Effect {
    Factor(f64),
    /// Multiplies each by a number of its own, and all by one that is not known beforehand.
    Shape(Vec<f64>),
    Values(Vec<f64>),
    Clamp,
    Offset,
}

/// The light of a task, by the simulator; `None` where that cannot be had in a moment.
pub fn truth(task: &Task) -> Option<Vec<f64>> {
    let meters: Vec<_> = task.stations().map(|(_, meter)| meter).collect();
    let bare =
        task.scene.obstacles.is_empty() && task.scene.luminaires.iter().all(|l| l.model == LuminaireModel::Point);
    if !bare && task.transport != Transport::Direct {
        return None;
    }
    let accuracy = Accuracy { relative_error: ACCURACY, seed: 1 };
    let solution = simulator::illuminance(&task.scene, &meters, task.transport, &accuracy).ok()?;
    let estimates = solution.estimates.iter().map(|e| Estimate::exact(e.illuminance.value())).collect();
    let measurement = Measurement { estimates, ..Measurement::default() };
    Some(measurement.readings(&task.targets).iter().map(|reading| reading.value).collect())
}

pub fn faults(task: &Task, right: &[f64]) -> Vec<Fault> {
    let mut all = factors(task);
    all.extend(arithmetic(task, right));
    all.extend(of_luminaires(task));
    all.extend(of_room(task));
    all.extend(of_transport(task));
    all.retain(|fault| fault.shows(right));
    all
}

impl Fault {
    fn new(id: &'static str, what: impl Into<String>, effect: Effect) -> Self {
        Self { id, what: what.into(), effect }
    }

    /// What is read with the fault instead of `right`, where the fault alone says so.
    pub fn readings(&self, right: &[f64]) -> Option<Vec<f64>> {
        match &self.effect {
            Effect::Factor(factor) => Some(right.iter().map(|r| r * factor).collect()),
            Effect::Shape(shape) => Some(right.iter().zip(shape).map(|(r, s)| r * s).collect()),
            Effect::Values(values) => Some(values.clone()),
            Effect::Clamp | Effect::Offset => None,
        }
    }

    fn shows(&self, right: &[f64]) -> bool {
        let largest = right.iter().copied().fold(0.0, f64::max);
        let differs = |wrong: Vec<f64>| wrong.iter().zip(right).any(|(w, r)| (w - r).abs() > INVISIBLE * largest);
        self.readings(right).is_none_or(differs)
    }
}

fn factors(task: &Task) -> Vec<Fault> {
    use std::f64::consts::PI;
    let constant = [
        ("factor-pi", "factor pi: exitance taken for luminance", PI),
        ("factor-1/pi", "factor 1/pi: luminance taken for exitance", 1.0 / PI),
        ("factor-4pi", "factor 4 pi: intensity taken for flux", 4.0 * PI),
        ("factor-1/4pi", "factor 1/(4 pi): flux taken for intensity", 1.0 / (4.0 * PI)),
        ("factor-2", "factor 2: something counted twice, or half a sphere for a whole one", 2.0),
        ("factor-1/2", "factor 1/2: half of something lost, or a whole sphere for half a one", 0.5),
        ("factor-179", "factor 179: Radiance's lumens a watt applied once too often", 179.0),
        ("factor-1/179", "factor 1/179: Radiance's lumens a watt left out", 1.0 / 179.0),
        ("factor-683", "factor 683: lumens a watt applied once too often", 683.0),
        ("factor-1/683", "factor 1/683: lumens a watt left out", 1.0 / 683.0),
        ("factor-177.83", "factor 177.83: the lumens a watt of equal-energy white", 177.83),
        ("factor-1/177.83", "factor 1/177.83: the lumens a watt of equal-energy white left out", 1.0 / 177.83),
        ("feet", "factor 10.764: feet taken for metres, or lux for footcandles", 1.0 / (0.3048 * 0.3048)),
        ("metres", "factor 0.0929: metres taken for feet, or footcandles for lux", 0.3048 * 0.3048),
        ("kilo", "factor 1000: candela a kilolumen taken for candela, or lux for kilolux", 1000.0),
        ("milli", "factor 1/1000: candela taken for candela a kilolumen", 1e-3),
    ];
    let mut faults: Vec<Fault> =
        constant.into_iter().map(|(id, what, factor)| Fault::new(id, what, Effect::Factor(factor))).collect();
    if let [luminaire] = &task.scene.luminaires[..] {
        if luminaire.flux_scale > 0.0 {
            let what = "the spec's flux_scale is left out".to_owned();
            faults.push(Fault::new("flux-scale", what, Effect::Factor(1.0 / luminaire.flux_scale)));
        }
        if let Some(lumens) = luminaire.photometry.lamp_lumens.filter(|lumens| *lumens > 0.0) {
            let per = format!("factor 1000/lamp lumens: scaled to a kilolumen of its {lumens} lm");
            faults.push(Fault::new("per-kilolumen", per, Effect::Factor(1000.0 / lumens)));
            let twice = format!("factor lamp lumens/1000: its {lumens} lm applied once too often");
            faults.push(Fault::new("lumens-twice", twice, Effect::Factor(lumens / 1000.0)));
        }
    }
    faults
}

fn arithmetic(task: &Task, right: &[f64]) -> Vec<Fault> {
    let half: Vec<f64> = right.iter().map(|r| r.min(HALF_MAX)).collect();
    let mut faults = vec![
        Fault::new("clamp", "highlights are cut off", Effect::Clamp),
        Fault::new("half-float", "half-precision numbers: what is above 65504 is lost", Effect::Values(half)),
        Fault::new("offset", "the same is added to every reading", Effect::Offset),
    ];
    let [luminaire] = &task.scene.luminaires[..] else { return faults };
    if task.transport != Transport::Direct || luminaire.model != LuminaireModel::Point {
        return faults;
    }
    let towards: Vec<DVec3> = task.targets.iter().map(|t| luminaire.position_m - t.meter.position_m).collect();
    let cosines: Vec<f64> =
        towards.iter().zip(&task.targets).map(|(d, t)| (d.dot(t.meter.normal) / d.length()).max(0.0)).collect();
    let intensities: Vec<f64> = towards.iter().map(|d| luminaire.intensity_towards(-*d).value()).collect();
    let distances: Vec<f64> = towards.iter().map(|d| d.length()).collect();
    let inverse = cosines.iter().map(|c| if *c > 0.0 { 1.0 / c } else { 0.0 }).collect();
    let uneven = |values: &[f64]| values.iter().any(|v| (v - values[0]).abs() > INVISIBLE * values[0]);
    let mut add = |id, what: &str, effect| faults.push(Fault::new(id, what, effect));
    if uneven(&cosines) {
        add("cosine-missing", "the cosine at the meter is left out", Effect::Values(times(right, inverse)));
        add("cosine-doubled", "the cosine at the meter is applied twice", Effect::Values(times(right, cosines)));
    }
    if uneven(&distances) {
        add("distance", "light falls with distance, not with its square", Effect::Shape(distances));
    }
    // What is the same everywhere is a factor like any other.
    if uneven(&intensities) {
        add("candela-squared", "the candela are squared: the filter is applied to itself", Effect::Shape(intensities));
    }
    faults
}

fn times(right: &[f64], factors: Vec<f64>) -> Vec<f64> {
    right.iter().zip(factors).map(|(r, f)| r * f).collect()
}

fn of_luminaires(task: &Task) -> Vec<Fault> {
    let mut faults = vec![];
    let mut of_each = |id, what: &str, change: &dyn Fn(&mut Luminaire)| {
        let mut wrong = task.clone();
        wrong.scene.luminaires.iter_mut().for_each(change);
        faults.extend(scene(id, what, &wrong));
    };
    for (id, turn) in [("c-turned-90", 90.0), ("c-turned-180", 180.0), ("c-turned-270", 270.0)] {
        let what = format!("the distribution is turned by {turn} degrees in C");
        of_each(id, &what, &|l| replace(l, Some(l.photometry.distribution.turned(turn))));
    }
    of_each("c-mirrored", "C runs the other way round: 90 and 270 degrees are exchanged", &|l| {
        remap(l, |c, g| (-c, g));
    });
    of_each("c-mirrored-90", "C 0 and C 180 are exchanged", &|l| remap(l, |c, g| (180.0 - c, g)));
    of_each("gamma-flipped", "gamma is counted from the zenith: up and down are exchanged", &|l| {
        remap(l, |c, g| (c, 180.0 - g));
    });
    of_each("isotropic", "the distribution is replaced by the same intensity everywhere", &isotropic);
    of_each("averaged", "the distribution is averaged over C", &averaged);
    of_each("extrapolated", "the table goes on beyond its last angle", &extrapolated);
    of_each("unrotated", "the luminaire's rotation is left out", &|l| l.orientation = DMat3::IDENTITY);
    of_each("rotated-back", "the luminaire's rotation is applied the wrong way round", &|l| {
        l.orientation = l.orientation.transpose();
    });
    of_each("area-as-point", "the luminous opening is shrunk to a point", &|l| l.model = LuminaireModel::Point);
    for k in 0..task.scene.luminaires.len().min(if task.scene.luminaires.len() > 1 { 8 } else { 0 }) {
        let mut wrong = task.clone();
        let lost = wrong.scene.luminaires.remove(k);
        faults.extend(scene("luminaire-lost", &format!("{} gives no light", lost.id), &wrong));
    }
    faults
}

fn of_room(task: &Task) -> Vec<Fault> {
    let Some(room) = task.scene.room else { return vec![] };
    let with = |id, what: &str, change: &dyn Fn(&mut Room)| {
        let (mut wrong, mut changed) = (task.clone(), room);
        change(&mut changed);
        wrong.scene.room = Some(changed);
        scene(id, what, &wrong)
    };
    let mut faults = vec![];
    for surface in Surface::ALL {
        let what = format!("{} reflects nothing: dropped, or its normal points outwards", name(surface));
        faults.extend(with("surface-lost", &what, &|r| *reflectance(r, surface) = 0.0));
    }
    faults.extend(with("upside-down", "ceiling and floor are exchanged", &|r| {
        std::mem::swap(&mut r.reflectance.floor, &mut r.reflectance.ceiling);
    }));
    // The exponent of display gamma, as an RGB colour would be decoded.
    let raised = |r: &mut Room, power: f64| {
        for s in Surface::ALL {
            *reflectance(r, s) = room.reflectance.of(s).powf(power);
        }
    };
    faults
        .extend(with("gamma-decoded", "reflectances are decoded as colours, to the power of 2.2", &|r| raised(r, 2.2)));
    faults.extend(with("gamma-encoded", "reflectances are encoded as colours, to the power of 1/2.2", &|r| {
        raised(r, 1.0 / 2.2);
    }));
    faults
}

fn of_transport(task: &Task) -> Vec<Fault> {
    let mut faults = vec![];
    let mut light = |id, what: &str, transport| faults.extend(scene(id, what, &Task { transport, ..task.clone() }));
    if let Transport::Indirect(bounces) | Transport::Total(bounces) = task.transport {
        let total = matches!(task.transport, Transport::Total(_));
        let of = |bounces| if total { Transport::Total(bounces) } else { Transport::Indirect(bounces) };
        let most = if let Bounces::AtMost(n) = bounces { n.min(MAX_BOUNCES) } else { MAX_BOUNCES };
        for n in 0..most {
            let what = format!("light stops after {n} reflection{}", if n == 1 { "" } else { "s" });
            light("bounces-cut", &what, of(Bounces::AtMost(n)));
        }
        if total {
            light("direct-lost", "direct light is missing", Transport::Indirect(bounces));
        } else {
            light("direct-added", "direct light is counted too", Transport::Total(bounces));
        }
        if bounces != Bounces::Converged {
            light("bounces-uncut", "light is followed beyond the reflections asked for", of(Bounces::Converged));
        }
    } else if task.scene.room.is_some() {
        light("indirect-added", "reflected light is counted too", Transport::Total(Bounces::Converged));
    }
    let mut flipped = task.clone();
    flipped.targets.iter_mut().flat_map(|t| &mut t.aspects).for_each(|a| a.meter.normal = -a.meter.normal);
    faults.extend(scene("meter-flipped", "meters face the other way", &flipped));
    faults
}

fn scene(id: &'static str, what: &str, wrong: &Task) -> Option<Fault> {
    truth(wrong).map(|values| Fault::new(id, what, Effect::Values(values)))
}

/// Leaves the luminaire as it is where a table's angles allow no other.
fn replace(luminaire: &mut Luminaire, distribution: Option<LuminousIntensityDistribution>) {
    if let Some(distribution) = distribution {
        luminaire.photometry = Arc::new(Photometry { distribution, ..(*luminaire.photometry).clone() });
    }
}

/// Reads the table at other angles: at its own nodes and their images, so that nothing is lost between them.
fn remap(luminaire: &mut Luminaire, source: impl Fn(f64, f64) -> (f64, f64)) {
    let table = luminaire.photometry.distribution.full_circle();
    // Every map is its own inverse: nodes of C go to their mirror images about C 0 or C 90.
    let images = |c: &f64| [*c, (-c).rem_euclid(360.0), (180.0 - c).rem_euclid(360.0)];
    let mut c_deg: Vec<f64> = table.c_deg().iter().flat_map(images).chain([0.0, 360.0]).collect();
    let mut gamma_deg: Vec<f64> = table.gamma_deg().iter().flat_map(|g| [*g, source(0.0, *g).1]).collect();
    for angles in [&mut c_deg, &mut gamma_deg] {
        angles.sort_by(f64::total_cmp);
        angles.dedup_by(|a, b| (*a - *b).abs() < 1e-9);
    }
    let at = |c: f64| gamma_deg.iter().map(move |g| (c, *g));
    let value = |(c, g): (f64, f64)| {
        let (c, g) = source(c, g);
        table.intensity(c, g).value()
    };
    let candela = c_deg.iter().flat_map(|c| at(*c)).map(value).collect();
    replace(luminaire, LuminousIntensityDistribution::new(c_deg, gamma_deg, candela).ok());
}

fn isotropic(luminaire: &mut Luminaire) {
    let mean = luminaire.photometry.distribution.flux().value() / (4.0 * std::f64::consts::PI);
    replace(luminaire, LuminousIntensityDistribution::axial(vec![0.0, 180.0], vec![mean; 2]).ok());
}

fn averaged(luminaire: &mut Luminaire) {
    let table = &luminaire.photometry.distribution;
    let axial = LuminousIntensityDistribution::axial(table.gamma_deg().to_vec(), table.azimuth_average());
    replace(luminaire, axial.ok());
}

fn extrapolated(luminaire: &mut Luminaire) {
    let table = &luminaire.photometry.distribution;
    let gamma = table.gamma_deg();
    let (first, last) = (gamma[0], gamma[gamma.len() - 1]);
    let mut gamma_deg = gamma.to_vec();
    gamma_deg.splice(0..0, (first > 0.0).then_some(0.0));
    gamma_deg.extend((last < 180.0).then_some(180.0));
    let row = |c: &f64| {
        let held = |g: &f64| table.intensity(*c, g.clamp(first, last)).value();
        gamma_deg.iter().map(held).collect::<Vec<_>>()
    };
    let candela = table.c_deg().iter().flat_map(row).collect();
    replace(luminaire, LuminousIntensityDistribution::new(table.c_deg().to_vec(), gamma_deg, candela).ok());
}

fn reflectance(room: &mut Room, surface: Surface) -> &mut f64 {
    let r = &mut room.reflectance;
    match surface {
        Surface::Floor => &mut r.floor,
        Surface::Ceiling => &mut r.ceiling,
        Surface::WallXMin => &mut r.wall_x_min,
        Surface::WallXMax => &mut r.wall_x_max,
        Surface::WallYMin => &mut r.wall_y_min,
        Surface::WallYMax => &mut r.wall_y_max,
    }
}

const fn name(surface: Surface) -> &'static str {
    match surface {
        Surface::Floor => "the floor",
        Surface::Ceiling => "the ceiling",
        Surface::WallXMin => "the wall at x = 0",
        Surface::WallXMax => "the wall at the largest x",
        Surface::WallYMin => "the wall at y = 0",
        Surface::WallYMax => "the wall at the largest y",
    }
}
