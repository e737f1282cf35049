//! Why a luminaire cannot be where a spec puts it: an opening that sticks out of the room, light that goes out of it.

use luminaire::geometry::{Room, Surface};
use luminaire::scene::{Luminaire, LuminaireModel, flush};

/// What is wrong with a luminaire's place, and what to do.
pub(super) fn unmountable(luminaire: &Luminaire, room: &Room) -> Option<(String, String)> {
    sticks_out(luminaire, room).or_else(|| shines_out(luminaire, room))
}

/// How far the luminous opening sticks out of the room, where it does: light from behind a surface is the simulator's alone.
fn sticks_out(luminaire: &Luminaire, room: &Room) -> Option<(String, String)> {
    if luminaire.model == LuminaireModel::Point {
        return None;
    }
    let to_own = luminaire.orientation.transpose();
    let beyond_m = |surface: Surface| {
        let outward = -surface.inward_normal();
        let plane_m = if surface.is_far() { room.size_m[surface.axis()] } else { 0.0 };
        let reach_m = luminaire.photometry.opening.reach_m(to_own * outward);
        luminaire.position_m.dot(outward) + reach_m - plane_m
    };
    let by = Surface::ALL.into_iter().map(|s| (beyond_m(s), s)).max_by(|a, b| a.0.total_cmp(&b.0));
    let (beyond_m, surface) = by.filter(|(m, _)| *m > flush::IN_PLANE * room.size_m.max_element())?;
    // Whole nanometres: further digits are rounding.
    let beyond_m = (beyond_m * 1e9).round() / 1e9;
    let message = format!("its luminous opening sticks out of the room by {beyond_m} m through the {}", surface.name());
    let moved = match surface {
        Surface::Ceiling => "lower it",
        Surface::Floor => "raise it",
        _ => "move it inwards",
    };
    let flat = "a flat opening that is not tilted against a surface may lie in its plane";
    Some((message, format!("{moved} by {beyond_m} m, or read it as `model: point`; {flat}")))
}

/// Whether all light of a luminaire in the plane of a surface goes out of the room.
fn shines_out(luminaire: &Luminaire, room: &Room) -> Option<(String, String)> {
    let surface = flush::surface_of(room, luminaire).filter(|s| !flush::shines_from(*s, luminaire))?;
    let message = format!("it lies in the plane of the {} and sends all its light out of the room", surface.name());
    Some((message, "turn it to face into the room (tilt: 180 turns it over), or move it inwards".to_owned()))
}
