//! Lints: valid but suspicious input, reported before a run.

use std::collections::HashMap;
use std::path::Path;

use glam::DVec3;
use luxproof_calculators::ugr::observer::{Glare, SOLID_ANGLES_SR};
use luxproof_scene::geometry::is_inside_closed;
use luxproof_scene::{Luminaire, LuminaireModel, Meter, Shape, Transport};

use super::{Case, SpecError};
use crate::procedures::{ProcedureRequest, Task};
use luxproof_model::numbers::trimmed;
use luxproof_model::{FIVE_TIMES, LuminaireModelChoice, ProcedureId};

/// A room is higher than this in no building but a stadium, and longer in none.
const HIGHEST_M: f64 = 60.0;
const LONGEST_M: f64 = 1000.0;
/// Heights of rooms that people work in, and of desks, in metres.
const ROOMS_M: std::ops::RangeInclusive<f64> = 2.0..=5.0;
const DESKS_M: std::ops::RangeInclusive<f64> = 0.7..=0.86;
const FOOT_M: f64 = 0.3048;
/// Higher than this, in metres, is a ceiling that may be in feet.
const LOFTY_M: f64 = 6.5;
/// Relative difference up to which two heights are the same.
const SAME_HEIGHT: f64 = 0.03;
/// Lower than this, in metres, no one stands in a room, and wider than this it is no model of one.
const DOOR_M: f64 = 1.9;
const WIDE_ROOM_M: f64 = 2.5;
/// No lamp is dimmed up so far.
const LARGE_FACTOR: f64 = 10.0;
/// A standard error of this part of a value says nothing.
const LARGE_ERROR: f64 = 0.5;
/// A tolerance that half of all wrong readings would pass.
const WIDE: f64 = 0.5;
/// Nearer before a surface than this a meter sees little else, in metres.
const BEFORE_A_SURFACE_M: f64 = 0.05;
/// Meters times luminaires, or triangles times luminaires, that are looked at.
const MAX_LOOKS: usize = 1_000_000;
/// How far from its centre an opening may reach, in metres; beyond that it is asked for light as if it were a point.
const OPENING_M: f64 = 2.0;

/// Each takes a look at the whole text for its place.
const MAX_LINTS: usize = 20;

/// A lint and its place in the spec.
#[derive(Clone, PartialEq, Eq, Hash)]
struct SpecLint {
    at: String,
    message: String,
    help: String,
}

impl SpecLint {
    fn new(at: impl Into<String>, message: String, help: impl Into<String>) -> Self {
        Self { at: at.into(), message, help: help.into() }
    }
}

/// The lints of valid cases, each at its place; once for all cases of a spec.
pub fn find_lints(cases: &[Case]) -> Vec<SpecError> {
    let mut found: Vec<(SpecLint, &Case, usize)> = vec![];
    let mut places: HashMap<(&Path, SpecLint), usize> = HashMap::new();
    for case in cases {
        for doubt in of_case(case) {
            let place = *places.entry((&case.path, doubt.clone())).or_insert(found.len());
            match found.get_mut(place) {
                Some((.., others)) => *others += 1,
                None => found.push((doubt, case, 0)),
            }
        }
    }
    let more = found.get(MAX_LINTS..).and_then(|more| Some((more.len(), &more.first()?.1.path)));
    let more = more.map(|(n, path)| SpecError::of(path, format!("{n} more lints"), "correct these first"));
    let reported = found.into_iter().take(MAX_LINTS).map(|(doubt, case, others)| {
        let message = match others {
            0 => doubt.message,
            n => format!("{} (in {} and {n} more)", doubt.message, case.name),
        };
        case.source.error_at(&doubt.at, message, doubt.help)
    });
    reported.chain(more).collect()
}

fn of_case(case: &Case) -> Vec<SpecLint> {
    let mut found: Vec<SpecLint> = size(case).into_iter().collect();
    found.extend(large_factors(case));
    found.extend(near_points(case));
    found.extend(idle_faces(case));
    found.extend(enclosed_luminaires(case));
    found.extend(enclosed_meters(case));
    found.extend(wide_tolerances(case));
    found.extend(facing_out(case));
    found.extend(case.tasks().filter_map(|task| dark(case, &task)));
    found.extend(case.task(ProcedureId::UnifiedGlareRating).and_then(|task| unrated(&task)));
    found
}

/// Sizes that are metres in no building, but would be usual in another unit.
fn size(case: &Case) -> Option<SpecLint> {
    let room = case.scene.room.as_ref()?;
    let [x, y, z] = room.size_m.to_array();
    let help = "lengths are metres unless the spec has a `unit` (mm, cm, ft or in)";
    if z > HIGHEST_M || x.max(y) > LONGEST_M {
        let units = [("millimetres", 1e-3), ("centimetres", 1e-2), ("inches", FOOT_M / 12.0)];
        let unit = units.iter().find(|(_, in_m)| ROOMS_M.contains(&(z * in_m)));
        let guess = unit.map(|(unit, _)| format!("; are these {unit}?")).unwrap_or_default();
        let message = format!("a room of {x} x {y} x {z} m is larger than buildings are{guess}");
        return Some(SpecLint::new("room.size_m", message, help));
    }
    // A room in feet is a possible one in metres; its desks are not.
    let up = case.meters.values().flatten().filter(|m| m.normal.z > 0.99);
    let heights: Vec<f64> = up.map(|m| m.position_m.z).collect();
    let in_feet = !heights.is_empty() && heights.iter().all(|h| DESKS_M.contains(&(h * FOOT_M)));
    if in_feet && ROOMS_M.contains(&(z * FOOT_M)) {
        let desk = heights[0];
        let message = format!("a room {z} m high whose desks are {desk} m high: are these feet?");
        return Some(SpecLint::new("room.size_m", message, help));
    }
    let are_desks_in_metres = !heights.is_empty() && heights.iter().all(|h| DESKS_M.contains(&(h / FOOT_M)));
    if are_desks_in_metres && ROOMS_M.contains(&(z / FOOT_M)) {
        let [height, desk] = [z, heights[0]].map(|length_m| (100.0 * length_m).round() / 100.0);
        let message = format!("a room {height} m high with desks at {desk} m: are its lengths metres, not feet?");
        return Some(SpecLint::new("room.size_m", message, "remove `unit: ft` where lengths are metres"));
    }
    // A ceiling that is as high in metres as its luminaires hang in feet was left in feet.
    let is_ceiling_in_feet = |l: &&Luminaire| (l.position_m.z / (z * FOOT_M) - 1.0).abs() < SAME_HEIGHT;
    let hung = case.scene.luminaires.iter().find(is_ceiling_in_feet);
    if let Some(luminaire) = hung.filter(|_| z > LOFTY_M && ROOMS_M.contains(&(z * FOOT_M))) {
        let (id, height) = (&luminaire.id, luminaire.position_m.z);
        let message = format!(
            "a room {z} m high in which `{id}` hangs at {height} m: is the room in feet? {z} ft are {:.2} m",
            z * FOOT_M
        );
        return Some(SpecLint::new("room.size_m", message, help));
    }
    if z < DOOR_M && x.min(y) > WIDE_ROOM_M {
        let message = format!("a room of {x} x {y} m is only {z} m high, lower than a door");
        return Some(SpecLint::new("room.size_m", message, help));
    }
    None
}

/// Factors that are a percentage.
fn large_factors(case: &Case) -> Vec<SpecLint> {
    let mut found = vec![];
    if let Some((k, luminaire)) = case.scene.luminaires.iter().enumerate().find(|(_, l)| l.flux_scale > LARGE_FACTOR) {
        let (id, factor) = (&luminaire.id, luminaire.flux_scale);
        let message = format!("`{id}` gives {factor} times the light of its file");
        let help = format!("a factor of 1 changes nothing; {factor} % is {}", factor / 100.0);
        found.push(SpecLint::new(format!("luminaires[{k}].flux_scale"), message, help));
    }
    if case.budget.relative_error >= LARGE_ERROR {
        let error = case.budget.relative_error;
        let message = format!("engines may stop at a standard error of {} %", 100.0 * error);
        found.push(SpecLint::new("budget.relative_error", message, format!("{error} % is {}", error / 100.0)));
    }
    found
}

/// Returns whether the spec makes a luminaire a point against the five-times rule.
fn is_near_point(choice: &LuminaireModelChoice) -> bool {
    !choice.is_automatic && choice.model == LuminaireModel::Point.name() && choice.too_near().is_some()
}

/// Returns the distance of the nearest place in largest dimensions of the luminaire; infinite if all keep the five-times rule.
fn distance_in_sizes(choice: &LuminaireModelChoice) -> f64 {
    choice.too_near().map_or(f64::INFINITY, |place| place.distance_m / choice.largest_dimension_m)
}

/// Luminaires that the spec makes points although a point or surface is nearer than the five-times rule allows.
fn near_points(case: &Case) -> Option<SpecLint> {
    let first = case.luminaire_models.iter().position(is_near_point)?;
    let violated = || case.luminaire_models.iter().filter(|choice| is_near_point(choice));
    let nearest = violated().min_by(|a, b| distance_in_sizes(a).total_cmp(&distance_in_sizes(b)))?;
    let place = nearest.too_near()?;
    let others = match violated().count() {
        1 => String::new(),
        n => format!(" (nearest of {n} such luminaires)"),
    };
    let error = place.point_error.map(|error| {
        format!("; for a Lambertian opening the direct light of a point is off by {:+.2} % there", 100.0 * error)
    });
    let message = format!(
        "`{}` is a point, but {}, and the five-times rule needs {FIVE_TIMES}{others}{}",
        nearest.names(),
        place.in_sizes(nearest.largest_dimension_m),
        error.unwrap_or_default()
    );
    let help = "leave `model` out, or give `model: area`";
    Some(SpecLint::new(format!("luminaires[{first}].model"), message, help))
}

/// Faces with a reflectance where the opening lies on no surface, so that there is no face.
fn idle_faces(case: &Case) -> Option<SpecLint> {
    let [first, ..] = case.idle_faces[..] else { return None };
    let message = "`face_reflectance` has no effect: the luminaire is a point or its opening lies on no surface";
    let help = "put its photometric centre into the plane of the surface and use `model: area`, or leave the key out";
    Some(SpecLint::new(format!("luminaires[{first}].face_reflectance"), message.to_owned(), help))
}

/// Luminaires inside opaque bodies, which no light leaves.
fn enclosed_luminaires(case: &Case) -> Vec<SpecLint> {
    let scene = &case.scene;
    let faults = scene.luminaires.iter().enumerate().filter_map(|(k, luminaire)| {
        let body =
            scene.obstacles.iter().position(|o| is_inside(&o.shape, luminaire.position_m, scene.luminaires.len()))?;
        let message = format!("`{}` hangs inside obstacles[{body}], which no light leaves", luminaire.id);
        let help = "move one of them, or leave the body out: its light is in the photometric file";
        Some(SpecLint::new(format!("luminaires[{k}].at_m"), message, help))
    });
    faults.collect()
}

/// Meters inside closed meshes, which no light enters. Those inside boxes are refused.
fn enclosed_meters(case: &Case) -> Vec<SpecLint> {
    let meshes: Vec<(usize, &Shape, [DVec3; 2])> = case
        .scene
        .obstacles
        .iter()
        .enumerate()
        .filter_map(|(k, o)| Some((k, &o.shape, mesh_bounds_m(&o.shape)?)))
        .collect();
    let faults = case.meters.iter().filter_map(|(name, meters)| {
        let mut found: Vec<(usize, usize)> = vec![];
        for (k, meter) in meters.iter().enumerate() {
            let at_m = meter.position_m;
            let mut near = meshes.iter().filter(|(.., [low, high])| at_m.cmpgt(*low).all() && at_m.cmplt(*high).all());
            found.extend(near.find(|(_, shape, _)| is_inside(shape, at_m, meters.len())).map(|(body, ..)| (k, *body)));
        }
        let (first, body) = *found.first()?;
        let others = match found.len() - 1 {
            0 => String::new(),
            more => format!(" (and {more} more of {})", meters.len()),
        };
        let message = format!("{name}[{first}] lies inside obstacles[{body}], which no light enters{others}");
        Some(SpecLint::new(format!("meters.{name}"), message, "move the points out of the body, or leave them out"))
    });
    faults.collect()
}

/// The corners of the box around a mesh; nothing for a box.
fn mesh_bounds_m(shape: &Shape) -> Option<[DVec3; 2]> {
    let Shape::Mesh { vertices_m, .. } = shape else { return None };
    let low = vertices_m.iter().copied().reduce(DVec3::min)?;
    let high = vertices_m.iter().copied().reduce(DVec3::max)?;
    Some([low, high])
}

/// Whether a point lies inside a body; not looked at where so many points would ask a mesh too often.
fn is_inside(shape: &Shape, point: DVec3, points: usize) -> bool {
    match shape {
        Shape::Box { min_m, max_m } => point.cmpgt(*min_m).all() && point.cmplt(*max_m).all(),
        Shape::Mesh { triangles, .. } if triangles.len().saturating_mul(points) > MAX_LOOKS => false,
        Shape::Mesh { vertices_m, triangles } => is_inside_closed(vertices_m, triangles, point),
    }
}

fn wide_tolerances(case: &Case) -> Vec<SpecLint> {
    let wide = case.tolerances.iter().filter(|(_, t)| t.relative >= WIDE);
    wide.map(|(procedure, tolerance)| {
        let message =
            format!("a tolerance of {} % lets nearly everything pass", trimmed(100.0 * tolerance.relative, 4));
        let (percent, share) = (tolerance.relative, trimmed(tolerance.relative / 100.0, 6));
        let help = format!("give it relative to the reference: {percent} % is {share}");
        SpecLint::new(format!("tolerances.{procedure}.relative"), message, help)
    })
    .collect()
}

/// The distance from a point in a box to the box's surface along a direction.
fn distance_to_surface(at: DVec3, direction: DVec3, size: DVec3) -> f64 {
    let distances = (0..3).map(|k| match direction[k] {
        d if d > 1e-9 => (size[k] - at[k]) / d,
        d if d < -1e-9 => -at[k] / d,
        _ => f64::INFINITY,
    });
    distances.fold(f64::INFINITY, f64::min)
}

/// The distance to a surface right before a meter that has the room behind it.
fn surface_before(meter: &Meter, size: DVec3) -> Option<f64> {
    let ahead = distance_to_surface(meter.position_m, meter.normal, size);
    let behind = distance_to_surface(meter.position_m, -meter.normal, size);
    (ahead < BEFORE_A_SURFACE_M && behind > 10.0 * BEFORE_A_SURFACE_M).then_some(ahead)
}

/// Meters that look at the next surface from nearby, their backs to the room.
fn facing_out(case: &Case) -> Vec<SpecLint> {
    let Some(room) = &case.scene.room else { return vec![] };
    let faults = case.meters.iter().filter_map(|(name, meters)| {
        let found: Vec<(usize, f64)> =
            meters.iter().enumerate().filter_map(|(k, meter)| Some((k, surface_before(meter, room.size_m)?))).collect();
        let (k, distance) = *found.first()?;
        let of = if found.len() == meters.len() {
            "all of them do".to_owned()
        } else {
            format!("{} of {} do", found.len(), meters.len())
        };
        let message = format!("{name}[{k}] turns its back to the room and faces a surface {distance:.4} m away ({of})");
        let help = "the normal points to where light comes from: [0, 0, 1] for a meter that lies on a desk";
        Some(SpecLint::new(format!("meters.{name}.normal"), message, help))
    });
    faults.collect()
}

/// A task of direct light that no luminaire sends any of to any of its meters, whatever stands in between.
fn dark(case: &Case, task: &Task) -> Option<SpecLint> {
    if task.transport != Transport::Direct || task.scene.room.is_none() {
        return None;
    }
    let ProcedureRequest::Meters(asked) = case.procedures.0.get(&task.procedure)? else { return None };
    let meters = || task.targets.iter().flat_map(|t| t.aspects.iter().map(|a| a.meter));
    let looks = meters().count().saturating_mul(task.scene.luminaires.len());
    if looks > MAX_LOOKS || meters().any(|meter| task.scene.luminaires.iter().any(|l| may_light(l, &meter))) {
        return None;
    }
    let sets: Vec<&str> = asked.meters.iter().collect();
    let message = format!("no luminaire sends light to any meter of {}: every reading is 0", sets.join(", "));
    let help = "look at the normals of the meters, the rotation of the luminaires, and flux_scale";
    Some(SpecLint::new(format!("procedures.{}", task.procedure), message, help))
}

/// Glare of openings that the rating is not of: CIE 117 has others for them, or none.
fn unrated(task: &Task) -> Option<SpecLint> {
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
    Some(SpecLint::new(format!("procedures.{}", task.procedure), message, help))
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
