//! Zonal flux of a luminaire in the position and orientation that it has in a room.

use std::collections::HashMap;
use std::f64::consts::TAU;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use glam::DVec3;
use rayon::prelude::*;

use super::zonal_cavity::ZonalFlux;
use luxproof_photometry::Photometry;
use luxproof_scene::geometry::{Room, Surface};
use luxproof_scene::{Luminaire, Scene, flush};

/// The number of planes over which the flux of a tilted luminaire is summed.
const PLANES: usize = 360;
/// The number of bands per zone of 10 degrees, likewise.
const BANDS_PER_ZONE: usize = 40;
/// The step to which the components of a direction are rounded.
const DIRECTION_STEP: f64 = 1e-12;
/// The largest number of stored fluxes.
const MAX_STORED_FLUXES: usize = 10_000;

/// Zonal flux of a luminaire in its orientation, flux scale included.
pub fn zonal_flux(luminaire: &Luminaire) -> ZonalFlux {
    let flux = match Attitude::from_luminaire(luminaire, None) {
        Some(attitude) => attitude.flux(&luminaire.photometry, None),
        None => ZonalFlux::of(&luminaire.photometry.distribution),
    };
    flux.scaled(luminaire.flux_scale)
}

/// Zonal fluxes of tilted luminaires, which take long to compute. Luminaires with one table and attitude share one.
#[derive(Debug, Default)]
pub struct RoomFluxes(Mutex<HashMap<Key, (Arc<Photometry>, ZonalFlux)>>);

/// The address of a table and the attitude of its luminaire.
///
/// The map holds the table, so that no other table gets its address.
type Key = (usize, Attitude);

impl RoomFluxes {
    /// Zonal flux of each luminaire. Light that a flush luminaire emits into its own surface does not count.
    ///
    /// `None` where `stop` became true.
    pub(super) fn entering(&self, room: &Room, scene: &Scene, stop: Option<&AtomicBool>) -> Option<Vec<ZonalFlux>> {
        let mounted: Vec<Mounted<'_>> = scene.luminaires.iter().map(|l| Mounted::new(room, l)).collect();
        let missing: HashMap<Key, &Arc<Photometry>> = {
            let known = self.known();
            let all = mounted.iter().filter_map(|m| Some((m.key()?, &m.luminaire.photometry)));
            all.filter(|(key, _)| !known.contains_key(key)).collect()
        };
        // The lock is free meanwhile: a thread of the pool that waited for it could wait for itself.
        let found: Vec<_> = missing
            .into_par_iter()
            .map(|(key, photometry)| (key, (Arc::clone(photometry), key.1.flux(photometry, stop))))
            .collect();
        if stop.is_some_and(|stop| stop.load(Ordering::Relaxed)) {
            return None;
        }
        let mut known = self.known();
        known.extend(found);
        let fluxes = mounted.iter().map(|m| m.flux(&known)).collect();
        if known.len() > MAX_STORED_FLUXES {
            known.clear();
        }
        Some(fluxes)
    }

    /// The stored fluxes; a thread that panicked leaves them valid.
    fn known(&self) -> MutexGuard<'_, HashMap<Key, (Arc<Photometry>, ZonalFlux)>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A luminaire, and the surface of the room that it is flush with.
struct Mounted<'a> {
    luminaire: &'a Luminaire,
    surface: Option<Surface>,
}

impl<'a> Mounted<'a> {
    fn new(room: &Room, luminaire: &'a Luminaire) -> Self {
        Self { luminaire, surface: flush::surface_of(room, luminaire) }
    }

    /// The key of the luminaire's flux; `None` where the table gives the flux directly.
    fn key(&self) -> Option<Key> {
        let attitude = Attitude::from_luminaire(self.luminaire, self.surface)?;
        Some((Arc::as_ptr(&self.luminaire.photometry).addr(), attitude))
    }

    /// The luminaire's flux, from the stored ones or from its table.
    fn flux(&self, known: &HashMap<Key, (Arc<Photometry>, ZonalFlux)>) -> ZonalFlux {
        let flux = match self.key().and_then(|key| known.get(&key)) {
            Some((_, flux)) => *flux,
            None => ZonalFlux::of(&self.luminaire.photometry.distribution),
        };
        let flux = flux.scaled(self.luminaire.flux_scale);
        if self.surface == Some(Surface::Ceiling) { flux.downward() } else { flux }
    }
}

/// The attitude of a luminaire that does not hang upright: what its zonal flux depends on, in addition to its table.
///
/// Directions are in the luminaire's frame, so that a turn about the vertical does not change them. They are in
/// multiples of [`DIRECTION_STEP`], so that equal ones compare as equal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct Attitude {
    /// The direction of the room's vertical.
    up: [i64; 3],
    /// The inward normal of the luminaire's surface, other than the ceiling.
    inward: Option<[i64; 3]>,
}

impl Attitude {
    /// The attitude of a luminaire; `None` where it hangs upright, free or in the ceiling.
    fn from_luminaire(luminaire: &Luminaire, surface: Option<Surface>) -> Option<Self> {
        let to_luminaire = luminaire.orientation.transpose();
        let surface = surface.filter(|s| *s != Surface::Ceiling);
        let inward = surface.map(|s| rounded_direction(to_luminaire * s.inward_normal()));
        let is_upright = (luminaire.orientation * DVec3::Z).dot(DVec3::Z) > 1.0 - 1e-12;
        (!is_upright || inward.is_some()).then(|| Self { up: rounded_direction(to_luminaire * DVec3::Z), inward })
    }

    /// Sums the flux over directions of the room; the sum is incomplete where `stop` became true.
    fn flux(&self, photometry: &Photometry, stop: Option<&AtomicBool>) -> ZonalFlux {
        let (up, inward) = (unit_vector(self.up), self.inward.map(unit_vector));
        // The planes are symmetric about the surface's normal, so that each side has the same number of them.
        let aside = inward.map(|n| n.reject_from_normalized(up)).filter(|n| n.length() > 0.5);
        let first = aside.unwrap_or_else(|| up.any_orthonormal_vector()).normalize();
        let second = up.cross(first);
        let around: [DVec3; PLANES] = std::array::from_fn(|k| {
            let (sin, cos) = (TAU * (k as f64 + 0.5) / PLANES as f64).sin_cos();
            cos * first + sin * second
        });
        let step_deg = 10.0 / BANDS_PER_ZONE as f64;
        ZonalFlux(std::array::from_fn(|zone| {
            if stop.is_some_and(|stop| stop.load(Ordering::Relaxed)) {
                return 0.0;
            }
            let mut flux = 0.0;
            for band in 0..BANDS_PER_ZONE {
                let low = 10.0 * zone as f64 + step_deg * band as f64;
                let solid = low.to_radians().cos() - (low + step_deg).to_radians().cos();
                let (sin, cos) = (low + 0.5 * step_deg).to_radians().sin_cos();
                let directions = around.iter().map(|a| sin * *a - cos * up);
                let inside = directions.filter(|d| inward.is_none_or(|n| d.dot(n) > 0.0));
                let sum: f64 = inside.map(|d| photometry.distribution.intensity_towards(d).value()).sum();
                flux += TAU * solid * sum / PLANES as f64;
            }
            flux
        }))
    }
}

/// A direction in multiples of [`DIRECTION_STEP`].
fn rounded_direction(direction: DVec3) -> [i64; 3] {
    direction.to_array().map(|x| (x / DIRECTION_STEP).round() as i64)
}

/// The unit vector of a rounded direction.
fn unit_vector(direction: [i64; 3]) -> DVec3 {
    DVec3::from_array(direction.map(|x| x as f64 * DIRECTION_STEP)).normalize_or(DVec3::Z)
}

#[cfg(test)]
mod tests {
    use std::time::Instant;

    use approx::assert_relative_eq;
    use glam::DMat3;

    use super::*;
    use luxproof_photometry::LuminousIntensityDistribution;
    use luxproof_scene::geometry::Reflectances;
    use luxproof_scene::{LuminaireModel, orientation};

    /// A table that no turn maps onto itself.
    fn lopsided() -> Arc<Photometry> {
        let nodes = (0..6).flat_map(|c| (0..4).map(move |g| (c, g)));
        let candela = nodes.map(|(c, g): (i32, i32)| 50.0 + f64::from(37 * (c % 5) % 90 + 23 * g % 70)).collect();
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
        let mut luminaires = vec![];
        for k in 0..200 {
            luminaires.push(hung(&table, orientation(7.0 * f64::from(k), 35.0, 20.0), 1.0 + f64::from(k)));
        }
        luminaires.push(hung(&table, orientation(0.0, 90.0, 5.0), 1.0));
        let (room, all) = scene(luminaires);
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
                let own = luxproof_photometry::direction(c, low + 0.5 * step);
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
    fn what_is_let_into_a_wall_keeps_the_light_that_leaves_the_wall() {
        // 100 cd along the axis' side and 40 cd behind it: 200 pi lm and 80 pi lm.
        let gamma = vec![0.0, 90.0, 90.0 + 1e-9, 180.0];
        let uneven = LuminousIntensityDistribution::axial(gamma, vec![100.0, 100.0, 40.0, 40.0]).unwrap();
        // A tilt of 90 degrees turns the axis towards -x: away from one wall, and into the other.
        let mut luminaire = hung(&Arc::new(Photometry::of(uneven)), orientation(0.0, 90.0, 0.0), 1.0);
        for (x_m, expected_lm) in [(4.0, 200.0), (0.0, 80.0)] {
            luminaire.position_m = DVec3::new(x_m, 2.0, 1.0);
            let (room, all) = scene(vec![luminaire.clone()]);
            assert!(flush::surface_of(&room, &all.luminaires[0]).is_some());
            let found = RoomFluxes::default().entering(&room, &all, None).unwrap()[0];
            let entering_lm = found.up_lm() + found.down_lm();
            assert_relative_eq!(entering_lm, expected_lm * std::f64::consts::PI, max_relative = 1e-6);
        }
    }

    #[test]
    fn what_is_let_into_the_ceiling_loses_its_upward_light() {
        // 100 cd downward and 40 cd upward: 200 pi lm and 80 pi lm, doubled by the flux scale.
        let gamma = vec![0.0, 90.0, 90.0 + 1e-9, 180.0];
        let uneven = LuminousIntensityDistribution::axial(gamma, vec![100.0, 100.0, 40.0, 40.0]).unwrap();
        let mut luminaire = hung(&Arc::new(Photometry::of(uneven)), orientation(20.0, 0.0, 0.0), 2.0);
        for (height_m, up_lm) in [(2.0, 160.0), (3.0, 0.0)] {
            luminaire.position_m.z = height_m;
            let (room, all) = scene(vec![luminaire.clone()]);
            let found = RoomFluxes::default().entering(&room, &all, None).unwrap()[0];
            assert_relative_eq!(found.down_lm(), 400.0 * std::f64::consts::PI, max_relative = 1e-6);
            assert_relative_eq!(found.up_lm(), up_lm * std::f64::consts::PI, max_relative = 1e-6);
        }
    }

    #[test]
    fn a_wish_to_stop_reaches_it_at_once() {
        let table = lopsided();
        let angles_deg = (0..5000).map(|k| 10.0 + 0.01 * f64::from(k));
        let tilted: Vec<Luminaire> = angles_deg.map(|deg| hung(&table, orientation(0.0, deg, 0.0), 1.0)).collect();
        let (room, few) = scene(tilted[..10].to_vec());
        let begun = Instant::now();
        assert!(RoomFluxes::default().entering(&room, &few, None).is_some());
        let of_few = begun.elapsed();
        // On a loaded machine both take longer, so that no number of seconds is a limit.
        let (room, all) = scene(tilted);
        let begun = Instant::now();
        assert_eq!(RoomFluxes::default().entering(&room, &all, Some(&AtomicBool::new(true))), None);
        let stopped = begun.elapsed();
        assert!(stopped < of_few, "stopped after {stopped:?}; ten of the luminaires take {of_few:?}");
    }
}
