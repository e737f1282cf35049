//! Why a luminaire cannot be where a spec puts it: an opening that sticks out of the room, light that goes out of it.

use luxproof_scene::contact::Placed;
use luxproof_scene::geometry::{Room, Surface};
use luxproof_scene::{Luminaire, LuminaireModel, flush};

use crate::length_unit::LengthUnit;

/// Lower than this, in metres, is no room.
const LOWEST_ROOM_M: f64 = 0.1;

/// What is wrong with a luminaire's place, and what to do.
pub(super) fn unmountable(placed: &Placed, room: &Room, unit: LengthUnit) -> Option<(String, String)> {
    let luminaire = &placed.luminaire;
    sticks_out(luminaire, room, unit).or_else(|| shines_out(luminaire, room)).or_else(|| shines_into(placed))
}

/// How far the luminous opening reaches beyond a surface of the room, in metres; negative where it does not.
fn excess_m(luminaire: &Luminaire, room: &Room, surface: Surface) -> f64 {
    let outward = -surface.inward_normal();
    let plane_m = if surface.is_far() { room.size_m[surface.axis()] } else { 0.0 };
    let reach_m = luminaire.photometry.opening.reach_m(luminaire.orientation.transpose() * outward);
    luminaire.position_m.dot(outward) + reach_m - plane_m
}

/// How far the luminous opening sticks out of the room, where it does: renderers treat light from behind a surface differently.
fn sticks_out(luminaire: &Luminaire, room: &Room, unit: LengthUnit) -> Option<(String, String)> {
    if luminaire.model == LuminaireModel::Point {
        return None;
    }
    let farthest = Surface::ALL
        .into_iter()
        .map(|surface| (excess_m(luminaire, room, surface), surface))
        .max_by(|a, b| a.0.total_cmp(&b.0));
    let (beyond_m, surface) = farthest.filter(|(m, _)| *m > flush::IN_PLANE * room.size_m.max_element())?;
    let beyond = unit.length(beyond_m);
    let message = format!("its luminous opening sticks out of the room by {beyond} through the {}", surface.name());
    let moved = match surface {
        Surface::Ceiling => "lower it",
        Surface::Floor => "raise it",
        _ => "move it inwards",
    };
    let height = room.size_m.z;
    if unit != LengthUnit::M && height < LOWEST_ROOM_M {
        return Some((
            message,
            format!("the room is only {} high: remove `unit` if its lengths are metres", unit.length(height)),
        ));
    }
    let flat = "a flat opening that is not tilted against a surface may lie in its plane";
    Some((message, format!("{moved} by {beyond}, or read it as `model: point`; {flat}")))
}

/// Whether all light of a luminaire in the plane of a surface goes out of the room.
fn shines_out(luminaire: &Luminaire, room: &Room) -> Option<(String, String)> {
    let surface = flush::surface_of(room, luminaire).filter(|s| !flush::shines_from(*s, luminaire))?;
    let message = format!("it lies in the plane of the {} and sends all its light out of the room", surface.name());
    Some((message, "turn it to face into the room (tilt: 180 turns it over), or move it inwards".to_owned()))
}

/// Whether all light of a flat opening on the face of a body goes into that body.
fn shines_into(placed: &Placed) -> Option<(String, String)> {
    let is_flat = placed.luminaire.photometry.opening.flat_faces_m(4).len() == 1;
    let [normal] = placed.normals[..] else { return None };
    if !is_flat || flush::shines_along(normal, &placed.luminaire) {
        return None;
    }
    let message = "it lies on the face of a body or of an inner wall and sends all its light into that".to_owned();
    Some((message, "turn it to face away from it (tilt: 180 turns it over), or move it off".to_owned()))
}
