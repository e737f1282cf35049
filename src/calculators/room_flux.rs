//! Zonal flux of a luminaire as it hangs in a room, tilted or in the plane of a surface.

use glam::DVec3;

use super::zonal_cavity::ZonalFlux;
use crate::geometry::{Room, Surface};
use crate::photometry::direction;
use crate::scene::{Luminaire, flush};

/// Zonal flux of a luminaire as it hangs, flux scale included.
pub fn zonal_flux(luminaire: &Luminaire) -> ZonalFlux {
    let distribution = &luminaire.photometry.distribution;
    if (luminaire.orientation * DVec3::Z).dot(DVec3::Z) > 1.0 - 1e-12 {
        return ZonalFlux::of(distribution).scaled(luminaire.flux_scale);
    }
    // Tilted: the luminaire's planes no longer fit the room's zones.
    by_directions(luminaire, |_| true)
}

/// Zonal flux of a luminaire without what one in the plane of a surface sends into that.
pub(super) fn entering(room: &Room, luminaire: &Luminaire) -> ZonalFlux {
    match flush::surface_of(room, luminaire) {
        None => zonal_flux(luminaire),
        Some(Surface::Ceiling) => zonal_flux(luminaire).downward(),
        Some(surface) => by_directions(luminaire, |towards| towards.dot(surface.inward_normal()) > 0.0),
    }
}

/// Sum over directions of the room.
fn by_directions(luminaire: &Luminaire, counts: impl Fn(DVec3) -> bool) -> ZonalFlux {
    let (planes, bands_a_zone) = (360, 40);
    ZonalFlux(std::array::from_fn(|zone| {
        let step = 10.0 / f64::from(bands_a_zone);
        (0..bands_a_zone)
            .map(|band| {
                let low = 10.0 * zone as f64 + step * f64::from(band);
                let solid = low.to_radians().cos() - (low + step).to_radians().cos();
                let towards = (0..planes).map(|plane| direction(f64::from(plane) + 0.5, low + 0.5 * step));
                let around = towards.filter(|d| counts(*d)).map(|d| luminaire.intensity_towards(d).value());
                std::f64::consts::TAU * solid * around.sum::<f64>() / f64::from(planes)
            })
            .sum()
    }))
}
