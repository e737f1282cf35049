//! Zonal flux of a luminaire as it hangs in a room, tilted or in the plane of a surface.

use std::collections::HashMap;
use std::f64::consts::TAU;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use glam::DVec3;
use rayon::prelude::*;

use super::zonal_cavity::ZonalFlux;
use crate::geometry::{Room, Surface};
use crate::photometry::Photometry;
use crate::scene::{Luminaire, Scene, flush};

/// Planes and bands a zone of the directions that the flux of a tilted luminaire is summed over.
const PLANES: usize = 360;
const BANDS: usize = 40;
/// Directions that differ by less are one.
const SAME: f64 = 1e-12;
/// Tables and attitudes that are remembered.
const MOST: usize = 10_000;

/// Zonal flux of a luminaire as it hangs, flux scale included.
pub fn zonal_flux(luminaire: &Luminaire) -> ZonalFlux {
    Attitude::of(luminaire, None)
        .map_or_else(
            || ZonalFlux::of(&luminaire.photometry.distribution),
            |attitude| attitude.flux(&luminaire.photometry, None),
        )
        .scaled(luminaire.flux_scale)
}

/// Zonal fluxes of luminaires that hang tilted, which take long: those of one table that hang alike share one.
#[derive(Debug, Default)]
pub struct RoomFluxes(Mutex<HashMap<Key, (Arc<Photometry>, ZonalFlux)>>);

/// Where a table lies, which is held so that nothing else comes to lie there, and how it hangs.
type Key = (usize, Attitude);

impl RoomFluxes {
    /// Zonal flux of each luminaire without what one in the plane of a surface sends into that; `None` where it was stopped.
    pub(super) fn entering(&self, room: &Room, scene: &Scene, stop: Option<&AtomicBool>) -> Option<Vec<ZonalFlux>> {
        let hung: Vec<_> = scene.luminaires.iter().map(|l| (l, flush::surface_of(room, l))).collect();
        let key = |(l, surface): &(&Luminaire, Option<Surface>)| {
            Attitude::of(l, *surface).map(|attitude| (Arc::as_ptr(&l.photometry).addr(), attitude))
        };
        let missing: HashMap<Key, &Arc<Photometry>> = {
            let known = self.known();
            let all = hung.iter().filter_map(|one| Some((key(one)?, &one.0.photometry)));
            all.filter(|(key, _)| !known.contains_key(key)).collect()
        };
        // Nobody waits for the lock meanwhile: a thread of the pool that did would wait for itself.
        let found: Vec<_> = missing
            .into_par_iter()
            .map(|(key, photometry)| (key, (Arc::clone(photometry), key.1.flux(photometry, stop))))
            .collect();
        if stop.is_some_and(|stop| stop.load(Ordering::Relaxed)) {
            return None;
        }
        let mut known = self.known();
        known.extend(found);
        let of = |one: &(&Luminaire, Option<Surface>)| {
            let table = || ZonalFlux::of(&one.0.photometry.distribution);
            let flux = key(one).and_then(|key| known.get(&key)).map_or_else(table, |(_, flux)| *flux);
            let flux = flux.scaled(one.0.flux_scale);
            if one.1 == Some(Surface::Ceiling) { flux.downward() } else { flux }
        };
        let fluxes = hung.iter().map(of).collect();
        if known.len() > MOST {
            known.clear();
        }
        Some(fluxes)
    }

    fn known(&self) -> MutexGuard<'_, HashMap<Key, (Arc<Photometry>, ZonalFlux)>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// How a luminaire hangs whose planes do not fit the room's zones: what its zonal flux depends on besides its table.
///
/// Directions are in its own frame, in whole multiples of [`SAME`], so that what is turned about the vertical alone hangs alike.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct Attitude {
    up: [i64; 3],
    /// The side of a surface, other than the ceiling, that all its light must go to.
    inward: Option<[i64; 3]>,
}

impl Attitude {
    /// Nothing where it hangs upright, free or in the ceiling.
    fn of(luminaire: &Luminaire, surface: Option<Surface>) -> Option<Self> {
        let own = |v: DVec3| (luminaire.orientation.transpose() * v).to_array().map(|x| (x / SAME).round() as i64);
        let inward = surface.filter(|s| *s != Surface::Ceiling).map(|s| own(s.inward_normal()));
        let is_upright = (luminaire.orientation * DVec3::Z).dot(DVec3::Z) > 1.0 - 1e-12;
        (!is_upright || inward.is_some()).then(|| Self { up: own(DVec3::Z), inward })
    }

    /// Sum over directions of the room; worth nothing where it was stopped.
    fn flux(&self, photometry: &Photometry, stop: Option<&AtomicBool>) -> ZonalFlux {
        let vector = |v: [i64; 3]| DVec3::from_array(v.map(|x| x as f64 * SAME)).normalize_or(DVec3::Z);
        let (up, inward) = (vector(self.up), self.inward.map(vector));
        // Planes lie evenly about a vertical surface's normal, so that as many as should lie on each side of it.
        let aside = inward.map(|n| n.reject_from_normalized(up)).filter(|n| n.length() > 0.5);
        let first = aside.unwrap_or_else(|| up.any_orthonormal_vector()).normalize();
        let second = up.cross(first);
        let around: [DVec3; PLANES] = std::array::from_fn(|k| {
            let (sin, cos) = (TAU * (k as f64 + 0.5) / PLANES as f64).sin_cos();
            cos * first + sin * second
        });
        let step = 10.0 / BANDS as f64;
        let of_band = |low: f64| {
            let solid = low.to_radians().cos() - (low + step).to_radians().cos();
            let (sin, cos) = (low + 0.5 * step).to_radians().sin_cos();
            let towards = around.iter().map(|a| sin * *a - cos * up);
            let counts = |d: &DVec3| inward.is_none_or(|n| d.dot(n) > 0.0);
            let sum: f64 = towards.filter(counts).map(|d| photometry.distribution.intensity_towards(d).value()).sum();
            TAU * solid * sum / PLANES as f64
        };
        ZonalFlux(std::array::from_fn(|zone| {
            if stop.is_some_and(|stop| stop.load(Ordering::Relaxed)) {
                return 0.0;
            }
            (0..BANDS).map(|band| of_band(10.0 * zone as f64 + step * band as f64)).sum()
        }))
    }
}

#[cfg(test)]
mod tests {
    use std::time::Instant;

    use approx::assert_relative_eq;
    use glam::DMat3;

    use super::*;
    use crate::geometry::Reflectances;
    use crate::photometry::LuminousIntensityDistribution;
    use crate::scene::{LuminaireModel, orientation};

    /// A table that no turn maps onto itself.
    fn lopsided() -> Arc<Photometry> {
        let of = |c: i32, g: i32| 50.0 + f64::from(37 * (c % 5) % 90 + 23 * g % 70);
        let candela = (0..6).flat_map(|c| (0..4).map(move |g| of(c, g))).collect();
        let (c, gamma) = (vec![0.0, 70.0, 130.0, 200.0, 310.0, 360.0], vec![0.0, 40.0, 95.0, 180.0]);
        Arc::new(Photometry::of(LuminousIntensityDistribution::new(c, gamma, candela).unwrap()))
    }

    fn hung(photometry: &Arc<Photometry>, orientation: DMat3, flux_scale: f64) -> Luminaire {
        let (photometry, position_m) = (Arc::clone(photometry), DVec3::new(1.0, 2.0, 2.0));
        Luminaire { id: "a".into(), photometry, position_m, orientation, flux_scale, model: LuminaireModel::Point }
    }

    fn scene(luminaires: Vec<Luminaire>) -> (Room, Scene) {
        let reflectance = Reflectances::with_equal_walls(0.2, 0.5, 0.7);
        let room = Room { size_m: DVec3::new(4.0, 5.0, 3.0), reflectance };
        (room, Scene { room: Some(room), obstacles: vec![], luminaires })
    }

    #[test]
    fn what_hangs_alike_shares_its_flux_and_reads_what_it_reads_alone() {
        let table = lopsided();
        let turned = |k: u32| hung(&table, orientation(7.0 * f64::from(k), 35.0, 20.0), 1.0 + f64::from(k));
        let (room, all) = scene((0..200).map(turned).chain([hung(&table, orientation(0.0, 90.0, 5.0), 1.0)]).collect());
        let fluxes = RoomFluxes::default();
        let found = fluxes.entering(&room, &all, None).unwrap();
        // Rounding of 200 orientations may part a few of them.
        assert!(fluxes.0.lock().unwrap().len() < 20, "{}", fluxes.0.lock().unwrap().len());
        for (luminaire, found) in all.luminaires.iter().zip(&found) {
            let alone = zonal_flux(luminaire);
            for (found, alone) in found.0.iter().zip(&alone.0) {
                assert_relative_eq!(found, alone, max_relative = 1e-9);
            }
            assert_eq!(
                RoomFluxes::default().entering(&room, &scene(vec![luminaire.clone()]).1, None).unwrap()[0],
                *found
            );
        }
    }

    /// Flux by zones of the room, over the luminaire's own directions: no frame of the room's is drawn.
    #[test]
    fn zones_hold_the_light_that_goes_there() {
        let table = lopsided();
        let luminaire = hung(&table, orientation(33.0, 55.0, 80.0), 1.0);
        let (mut zones, (bands, planes)) = ([0.0; 18], (1800, 3600));
        for band in 0..bands {
            let (low, step) = (180.0 * f64::from(band) / f64::from(bands), 180.0 / f64::from(bands));
            let solid = low.to_radians().cos() - (low + step).to_radians().cos();
            for plane in 0..planes {
                let c = 360.0 * (f64::from(plane) + 0.5) / f64::from(planes);
                let own = crate::photometry::direction(c, low + 0.5 * step);
                let room_gamma = (-(luminaire.orientation * own).z).clamp(-1.0, 1.0).acos().to_degrees();
                zones[(room_gamma / 10.0) as usize % 18] +=
                    TAU * solid / f64::from(planes) * table.distribution.intensity_towards(own).value();
            }
        }
        for (found, expected) in zonal_flux(&luminaire).0.iter().zip(&zones) {
            assert_relative_eq!(found, expected, max_relative = 3e-3);
        }
    }

    #[test]
    fn what_is_let_into_a_wall_sends_half_of_even_light_into_the_room() {
        let even = LuminousIntensityDistribution::axial(vec![0.0, 180.0], vec![100.0, 100.0]).unwrap();
        let mut luminaire = hung(&Arc::new(Photometry::of(even)), orientation(20.0, 90.0, 3.0), 2.0);
        luminaire.position_m = DVec3::new(0.0, 2.0, 1.0);
        let (room, all) = scene(vec![luminaire]);
        let found = RoomFluxes::default().entering(&room, &all, None).unwrap()[0];
        let is_flush = flush::surface_of(&room, &all.luminaires[0]).is_some();
        let half = if is_flush { 0.5 } else { 1.0 };
        assert_relative_eq!(found.up_lm() + found.down_lm(), half * 2.0 * 2.0 * TAU * 100.0, max_relative = 1e-9);
        assert!(is_flush);
    }

    #[test]
    fn a_wish_to_stop_reaches_it_at_once() {
        let table = lopsided();
        let tilted = |k: u32| hung(&table, orientation(0.0, 10.0 + 0.01 * f64::from(k), 0.0), 1.0);
        let (room, all) = scene((0..5000).map(tilted).collect());
        let begun = Instant::now();
        assert_eq!(RoomFluxes::default().entering(&room, &all, Some(&AtomicBool::new(true))), None);
        assert!(begun.elapsed().as_secs_f64() < 1.0);
    }
}
