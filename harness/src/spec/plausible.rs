//! What is allowed in a spec and hardly meant: told before anything runs, and no error.

use std::collections::HashMap;
use std::f64::consts::PI;
use std::path::Path;

use glam::DVec3;
use luminaire::calculators::ugr::observer::{Glare, SOLID_ANGLES_SR};
use luminaire::geometry::solid_angle_sr;
use luminaire::scene::{Luminaire, LuminaireModel, Meter, Shape, Transport};

use super::{Case, SpecError};
use crate::procedures::{Asked, Task};
use crate::record::ProcedureId;

/// A room is higher than this in no building but a stadium, and longer in none.
const HIGHEST_M: f64 = 60.0;
const LONGEST_M: f64 = 1000.0;
/// Heights of rooms that people work in, and of desks, in metres.
const ROOMS_M: std::ops::RangeInclusive<f64> = 2.0..=5.0;
const DESKS_M: std::ops::RangeInclusive<f64> = 0.7..=0.86;
const FOOT_M: f64 = 0.3048;
/// A tolerance that half of all wrong readings would pass.
const WIDE: f64 = 0.5;
/// Nearer before a surface than this a meter sees little else, in metres.
const BEFORE_A_SURFACE_M: f64 = 0.05;
/// Meters times luminaires, or triangles times luminaires, that are looked at.
const MAX_LOOKS: usize = 1_000_000;
/// How far from its centre an opening may reach, in metres; beyond that it is asked for light as if it were a point.
const OPENING_M: f64 = 2.0;

/// Each takes a look at the whole text for its place.
const MAX_DOUBTS: usize = 20;

/// What is hardly meant, and where in the spec.
#[derive(Clone, PartialEq, Eq, Hash)]
struct Doubt {
    at: String,
    message: String,
    help: String,
}

impl Doubt {
    fn new(at: impl Into<String>, message: String, help: impl Into<String>) -> Self {
        Self { at: at.into(), message, help: help.into() }
    }
}

/// What is hardly meant in sound cases, each at its place: once, where many cases of a spec have it.
pub fn doubts(cases: &[Case]) -> Vec<SpecError> {
    let mut found: Vec<(Doubt, &Case, usize)> = vec![];
    let mut places: HashMap<(&Path, Doubt), usize> = HashMap::new();
    for case in cases {
        for doubt in of_case(case) {
            let place = *places.entry((&case.path, doubt.clone())).or_insert(found.len());
            match found.get_mut(place) {
                Some((.., others)) => *others += 1,
                None => found.push((doubt, case, 0)),
            }
        }
    }
    let more = found.get(MAX_DOUBTS..).and_then(|more| Some((more.len(), &more.first()?.1.path)));
    let more =
        more.map(|(n, path)| SpecError::of(path, format!("{n} more things are hardly meant"), "mend these first"));
    let told = found.into_iter().take(MAX_DOUBTS).map(|(doubt, case, others)| {
        let message = match others {
            0 => doubt.message,
            n => format!("{} (in {} and {n} more)", doubt.message, case.name),
        };
        case.source.error_at(&doubt.at, message, doubt.help)
    });
    told.chain(more).collect()
}

fn of_case(case: &Case) -> Vec<Doubt> {
    let mut found: Vec<Doubt> = size(case).into_iter().collect();
    found.extend(enclosed(case));
    found.extend(wide_tolerances(case));
    found.extend(facing_out(case));
    found.extend(case.tasks().filter_map(|task| dark(case, &task)));
    found.extend(case.task(ProcedureId::UnifiedGlareRating).and_then(|task| unrated(&task)));
    found
}

/// Sizes that are metres in no building, but would be usual in another unit.
fn size(case: &Case) -> Option<Doubt> {
    let room = case.scene.room.as_ref()?;
    let [x, y, z] = room.size_m.to_array();
    let fault = |message: String, help: &str| Some(Doubt::new("room.size_m", message, help));
    let help = "all lengths of a spec are metres";
    if z > HIGHEST_M || x.max(y) > LONGEST_M {
        let units = [("millimetres", 1e-3), ("centimetres", 1e-2), ("inches", FOOT_M / 12.0)];
        let unit = units.iter().find(|(_, in_m)| ROOMS_M.contains(&(z * in_m)));
        let guess = unit.map(|(unit, _)| format!("; are these {unit}?")).unwrap_or_default();
        return fault(format!("a room of {x} x {y} x {z} m is larger than buildings are{guess}"), help);
    }
    // A room in feet is a possible one in metres; its desks are not.
    let up = case.meters.values().flatten().filter(|m| m.normal.z > 0.99);
    let heights: Vec<f64> = up.map(|m| m.position_m.z).collect();
    let in_feet = !heights.is_empty() && heights.iter().all(|h| DESKS_M.contains(&(h * FOOT_M)));
    if in_feet && ROOMS_M.contains(&(z * FOOT_M)) {
        let desk = heights[0];
        return fault(format!("a room {z} m high whose desks are {desk} m high: are these feet?"), help);
    }
    None
}

/// Luminaires inside opaque bodies, which no light leaves.
fn enclosed(case: &Case) -> Vec<Doubt> {
    let scene = &case.scene;
    let faults = scene.luminaires.iter().enumerate().filter_map(|(k, luminaire)| {
        let body =
            scene.obstacles.iter().position(|o| is_inside(&o.shape, luminaire.position_m, scene.luminaires.len()))?;
        let message = format!("`{}` hangs inside obstacles[{body}], which no light leaves", luminaire.id);
        let help = "move one of them, or leave the body out: its light is in the photometric file";
        Some(Doubt::new(format!("luminaires[{k}].at_m"), message, help))
    });
    faults.collect()
}

fn is_inside(shape: &Shape, point: DVec3, luminaires: usize) -> bool {
    match shape {
        Shape::Box { min_m, max_m } => point.cmpgt(*min_m).all() && point.cmplt(*max_m).all(),
        Shape::Mesh { triangles, .. } if triangles.len().saturating_mul(luminaires) > MAX_LOOKS => false,
        Shape::Mesh { vertices_m, triangles } => {
            let corners = triangles.iter().map(|t| t.map(|k| vertices_m[k as usize] - point));
            // All around there is a body where its faces fill the whole sphere; what looks inwards is a room of its own, as imported scenes
            // have it.
            corners.map(solid_angle_sr).sum::<f64>() > 2.0 * PI
        }
    }
}

fn wide_tolerances(case: &Case) -> Vec<Doubt> {
    let wide = case.tolerances.iter().filter(|(_, t)| t.relative >= WIDE);
    let fault = |(procedure, tolerance): (&_, &super::ToleranceOverride)| {
        let message = format!("a tolerance of {} % lets nearly everything pass", 100.0 * tolerance.relative);
        let help = format!(
            "give it relative to the reference: 1 % is 0.01, {} % is {}",
            tolerance.relative,
            tolerance.relative / 100.0
        );
        Doubt::new(format!("tolerances.{procedure}.relative"), message, help)
    };
    wide.map(fault).collect()
}

/// Meters that look at the next surface from nearby, their backs to the room.
fn facing_out(case: &Case) -> Vec<Doubt> {
    let Some(room) = &case.scene.room else { return vec![] };
    let faults = case.meters.iter().filter_map(|(name, meters)| {
        let faces = |meter: &Meter| {
            let (at, n, size) = (meter.position_m.to_array(), meter.normal.to_array(), room.size_m.to_array());
            let ahead = |along: f64| {
                let to = |k: usize| match along * n[k] {
                    d if d > 1e-9 => (size[k] - at[k]) / d,
                    d if d < -1e-9 => -at[k] / d,
                    _ => f64::INFINITY,
                };
                (0..3).map(to).fold(f64::INFINITY, f64::min)
            };
            (ahead(1.0) < BEFORE_A_SURFACE_M && ahead(-1.0) > 10.0 * BEFORE_A_SURFACE_M).then(|| ahead(1.0))
        };
        let found: Vec<(usize, f64)> = meters.iter().enumerate().filter_map(|(k, m)| Some((k, faces(m)?))).collect();
        let (k, distance) = *found.first()?;
        let of = if found.len() == meters.len() {
            "all of them do".to_owned()
        } else {
            format!("{} of {} do", found.len(), meters.len())
        };
        let message = format!("{name}[{k}] turns its back to the room and faces a surface {distance:.4} m away ({of})");
        let help = "the normal points to where light comes from: [0, 0, 1] for a meter that lies on a desk";
        Some(Doubt::new(format!("meters.{name}.normal"), message, help))
    });
    faults.collect()
}

/// A task of direct light that no luminaire sends any of to any of its meters, whatever stands in between.
fn dark(case: &Case, task: &Task) -> Option<Doubt> {
    if task.transport != Transport::Direct || task.scene.room.is_none() {
        return None;
    }
    let Asked::Meters(asked) = case.procedures.0.get(&task.procedure)? else { return None };
    let meters = || task.targets.iter().flat_map(|t| t.aspects.iter().map(|a| a.meter));
    let looks = meters().count().saturating_mul(task.scene.luminaires.len());
    if looks > MAX_LOOKS || meters().any(|meter| task.scene.luminaires.iter().any(|l| may_light(l, &meter))) {
        return None;
    }
    let sets: Vec<&str> = asked.meters.iter().collect();
    let message = format!("no luminaire sends light to any meter of {}: every reading is 0", sets.join(", "));
    let help = "look at the normals of the meters, the rotation of the luminaires, and flux_scale";
    Some(Doubt::new(format!("procedures.{}", task.procedure), message, help))
}

/// Glare of openings that the rating is not of: CIE 117 has others for them, or none.
fn unrated(task: &Task) -> Option<Doubt> {
    if task.targets.len().saturating_mul(task.scene.luminaires.len()) > MAX_LOOKS {
        return None;
    }
    let seen = task.targets.iter().filter_map(|t| Some((&t.id, Glare::seen(&task.scene, &t.meter).ok()?)));
    let mut others =
        seen.filter(|(_, glare)| glare.solid_angles_sr.iter().any(|angle| !SOLID_ANGLES_SR.contains(angle)));
    let (eye, Glare { solid_angles_sr: [least, most], .. }) = others.next()?;
    let of = if least < most { format!("{least:.1e} to {most:.1e} sr") } else { format!("{most:.1e} sr") };
    let (from, to) = (SOLID_ANGLES_SR.start(), SOLID_ANGLES_SR.end());
    let message = format!("{eye} sees openings of {of}, and the rating is of {from} to {to} sr (CIE 117)");
    let help = "take what is read for a number that renderers may agree on, and for no rating of this glare";
    Some(Doubt::new(format!("procedures.{}", task.procedure), message, help))
}

fn may_light(luminaire: &Luminaire, meter: &Meter) -> bool {
    let way = meter.position_m - luminaire.position_m;
    if !luminaire.is_on() {
        return false;
    }
    match luminaire.model {
        LuminaireModel::Point => {
            -way.dot(meter.normal) > 0.0 && luminaire.intensity_towards(way.normalize_or_zero()).value() > 0.0
        }
        // Parts of an opening may be seen where its centre is not.
        LuminaireModel::Area | LuminaireModel::Impostor => -way.dot(meter.normal) > -OPENING_M,
    }
}
