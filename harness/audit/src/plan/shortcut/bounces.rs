//! Leaves out reflections that cannot occur: in black rooms, and in rooms where a single flat surface reflects.

use luxproof_scene::geometry::Surface;
use luxproof_scene::{Bounces, Scene, Transport};

use super::{Fill, Shortcut};
use luxproof_model::Scope;

/// How often light can be reflected in a scene, as its surfaces show.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Reflections {
    None,
    /// Once, by one flat surface, which cannot light itself.
    Once,
    Many,
}

/// Limits the transport of a job to the reflections that can occur.
pub(super) fn shorten(shortcut: &mut Shortcut) {
    let transport = shortcut.job.transport;
    let (Transport::Indirect(asked) | Transport::Total(asked)) = transport else { return };
    let most = reflections(&shortcut.job.scene);
    let nothing = asked == Bounces::AtMost(0) || most == Reflections::None;
    let why = if asked == Bounces::AtMost(0) { "no reflection was asked for" } else { "every surface is black" };
    match transport {
        Transport::Indirect(_) if nothing => {
            shortcut.render_only(&vec![false; shortcut.job.sensors.len()], |_| Fill::Dark);
            shortcut.omit(Scope::LightPath, 1.0, format!("{why}: reflected light is 0 everywhere, without a ray"));
        }
        Transport::Total(_) if nothing => {
            shortcut.job.transport = Transport::Direct;
            shortcut.omit(Scope::LightPath, 0.9, format!("{why}: all light is direct"));
        }
        _ if most == Reflections::Once && asked != Bounces::AtMost(1) => {
            let once = Bounces::AtMost(1);
            let is_total = matches!(transport, Transport::Total(_));
            shortcut.job.transport = if is_total { Transport::Total(once) } else { Transport::Indirect(once) };
            let reason = "one flat surface alone reflects, and cannot light itself: one reflection is all there is";
            shortcut.omit(Scope::LightPath, 0.3, reason.to_owned());
        }
        _ => {}
    }
}

/// How often light can be reflected in a scene.
fn reflections(scene: &Scene) -> Reflections {
    let bodies = scene.obstacles.iter().any(|o| o.reflectance > 0.0);
    let surfaces = scene.room.iter().flat_map(|room| Surface::ALL.into_iter().map(move |s| room.reflectance.of(s)));
    match (bodies, surfaces.filter(|reflectance| *reflectance > 0.0).count()) {
        (false, 0) => Reflections::None,
        (false, 1) => Reflections::Once,
        _ => Reflections::Many,
    }
}
