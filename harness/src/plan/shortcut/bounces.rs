//! Light that is reflected never, or once at most: rooms that are black, or of which one flat surface alone reflects; pure.

use luminaire::geometry::Surface;
use luminaire::scene::{Bounces, Scene, Transport};

use super::{Fill, Shortcut};
use crate::plan::Scope;

/// How often light can be reflected in a scene, where that is told by looking at it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Reflections {
    None,
    /// By one flat surface, which cannot light itself.
    Once,
    Many,
}

/// Leaves out reflections that there are none of.
pub(super) fn shorten(shortcut: &mut Shortcut) {
    let transport = shortcut.job.transport;
    let (Transport::Indirect(asked) | Transport::Total(asked)) = transport else { return };
    let most = reflections(&shortcut.job.scene);
    let nothing = asked == Bounces::AtMost(0) || most == Reflections::None;
    let why = if asked == Bounces::AtMost(0) { "no reflection was asked for" } else { "every surface is black" };
    match transport {
        Transport::Indirect(_) if nothing => {
            shortcut.render_only(&vec![false; shortcut.job.stations.len()], |_| Fill::Dark);
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

fn reflections(scene: &Scene) -> Reflections {
    let bodies = scene.obstacles.iter().any(|o| o.reflectance > 0.0);
    let surfaces =
        |r: &luminaire::geometry::Room| Surface::ALL.into_iter().filter(|s| r.reflectance.of(*s) > 0.0).count();
    match (bodies, scene.room.as_ref().map_or(0, surfaces)) {
        (false, 0) => Reflections::None,
        (false, 1) => Reflections::Once,
        _ => Reflections::Many,
    }
}
