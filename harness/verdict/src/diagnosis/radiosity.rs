//! Reflected light in a millisecond: radiosity of a few patches a surface.
//!
//! It is good to percents, and far better as the ratio of two similar scenes. The simulator confirms what it admits.

use glam::DVec3;
use luxproof_calculators::inverse_square::from_luminaire;
use luxproof_scene::geometry::configuration_factor::element_to_polygon;
use luxproof_scene::geometry::{Room, Surface};
use luxproof_scene::{Bounces, Luminaire, Meter};

/// Patches of a surface along each side.
const PATCHES_PER_SIDE: usize = 5;
/// Points of a patch along each side at which its direct light is sampled.
const POINTS_PER_SIDE: usize = 2;
/// Reflections that stand for endless ones.
const MAX_REFLECTIONS: u32 = 60;
/// Part of the brightest patch's light below which light is followed no further.
const NEGLIGIBLE_SHARE: f64 = 1e-4;

struct Patch {
    surface: Surface,
    corners_m: [DVec3; 4],
}

/// The patches of an empty room, with configuration factors between them and to the meters asked for.
pub(super) struct PatchRadiosity {
    patches: Vec<Patch>,
    /// Configuration factors to all patches, one list a patch.
    patch_factors: Vec<Vec<f64>>,
    meters: Vec<Meter>,
    /// Configuration factors to all patches, one list a meter.
    meter_factors: Vec<Vec<f64>>,
}

impl PatchRadiosity {
    pub(super) fn new(room: &Room, meters: &[Meter]) -> Self {
        let patches: Vec<Patch> = Surface::ALL.into_iter().flat_map(|s| split_into_patches(room, s)).collect();
        let patch_factors = patches.iter().map(|patch| factors_of_patch(patch, &patches)).collect();
        let meter_factors = meters.iter().map(|m| factors_of_meter(m, &patches)).collect();
        Self { patches, patch_factors, meters: meters.to_vec(), meter_factors }
    }

    /// Counts the cost, in luminaires seen from a meter. `meters` are those beyond the meters asked for.
    pub(super) const fn count_work(luminaires: u64, meters: u64) -> u64 {
        let patches = (Surface::ALL.len() * PATCHES_PER_SIDE * PATCHES_PER_SIDE) as u64;
        // Reflections between patches take half a millisecond, a fifth of the unit for each pair.
        patches * ((POINTS_PER_SIDE * POINTS_PER_SIDE) as u64 * luminaires + meters + patches / 5)
    }

    /// Reflected illuminance at meters, in lux.
    pub(super) fn illuminance(
        &self,
        room: &Room,
        luminaires: &[Luminaire],
        meters: &[Meter],
        bounces: Bounces,
    ) -> Vec<f64> {
        let exitance = self.solve_exitance(room, luminaires, bounces);
        if meters == self.meters {
            return self.meter_factors.iter().map(|factors| weighted_sum(factors, &exitance)).collect();
        }
        meters.iter().map(|m| weighted_sum(&factors_of_meter(m, &self.patches), &exitance)).collect()
    }

    /// The exitance of all patches, summed over the reflections.
    fn solve_exitance(&self, room: &Room, luminaires: &[Luminaire], bounces: Bounces) -> Vec<f64> {
        let most = if let Bounces::AtMost(most) = bounces { most.min(MAX_REFLECTIONS) } else { MAX_REFLECTIONS };
        let reflectances: Vec<f64> = self.patches.iter().map(|p| room.reflectance.of(p.surface)).collect();
        let mut illuminance: Vec<f64> = self.patches.iter().map(|p| p.mean_direct_illuminance(luminaires)).collect();
        let brightest = illuminance.iter().copied().fold(0.0, f64::max);
        let mut exitance = vec![0.0; illuminance.len()];
        for _ in 0..most {
            let leaving: Vec<f64> = illuminance.iter().zip(&reflectances).map(|(e, r)| e * r).collect();
            exitance.iter_mut().zip(&leaving).for_each(|(all, one)| *all += one);
            illuminance = self.patch_factors.iter().map(|factors| weighted_sum(factors, &leaving)).collect();
            if illuminance.iter().all(|e| *e <= NEGLIGIBLE_SHARE * brightest) {
                break;
            }
        }
        exitance
    }
}

fn weighted_sum(factors: &[f64], exitance: &[f64]) -> f64 {
    factors.iter().zip(exitance).map(|(f, m)| f * m).sum()
}

/// Configuration factors from a patch's centre, normalized to 1, because a closed room is all that a patch sees.
fn factors_of_patch(patch: &Patch, patches: &[Patch]) -> Vec<f64> {
    let (centre, normal) = (patch.at(0.5, 0.5), patch.surface.inward_normal());
    let factors: Vec<f64> = patches.iter().map(|other| element_to_polygon(centre, normal, &other.corners_m)).collect();
    let all: f64 = factors.iter().sum();
    factors.into_iter().map(|factor| factor / all).collect()
}

fn factors_of_meter(meter: &Meter, patches: &[Patch]) -> Vec<f64> {
    patches.iter().map(|patch| element_to_polygon(meter.position_m, meter.normal, &patch.corners_m)).collect()
}

impl Patch {
    /// The point at parts `u` and `v` of the two sides.
    fn at(&self, u: f64, v: f64) -> DVec3 {
        let [origin, along, _, across] = self.corners_m;
        origin + u * (along - origin) + v * (across - origin)
    }

    /// The mean illuminance by direct light.
    fn mean_direct_illuminance(&self, luminaires: &[Luminaire]) -> f64 {
        let normal = self.surface.inward_normal();
        let count = POINTS_PER_SIDE * POINTS_PER_SIDE;
        let mut sum = 0.0;
        for k in 0..count {
            let [u, v] = [k % POINTS_PER_SIDE, k / POINTS_PER_SIDE].map(|i| (i as f64 + 0.5) / POINTS_PER_SIDE as f64);
            let meter = Meter { position_m: self.at(u, v), normal };
            sum += luminaires.iter().map(|l| from_luminaire(l, &meter).value()).sum::<f64>();
        }
        sum / count as f64
    }
}

fn split_into_patches(room: &Room, surface: Surface) -> Vec<Patch> {
    let whole = Patch { surface, corners_m: room.corners(surface) };
    let mut patches = vec![];
    for k in 0..PATCHES_PER_SIDE * PATCHES_PER_SIDE {
        let (i, j) = (k % PATCHES_PER_SIDE, k / PATCHES_PER_SIDE);
        let corners_m = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
            .map(|(i, j)| whole.at(i as f64 / PATCHES_PER_SIDE as f64, j as f64 / PATCHES_PER_SIDE as f64));
        patches.push(Patch { surface, corners_m });
    }
    patches
}

#[cfg(test)]
mod tests {
    use super::*;
    use luxproof_engines::fixtures;
    use luxproof_photometry::LuminousIntensityDistribution;
    use luxproof_scene::geometry::Reflectances;

    /// A cube of 2 m with an isotropic luminaire of 100 cd in its middle.
    fn cube(reflectance: f64) -> (Room, Luminaire) {
        let even = LuminousIntensityDistribution::axial(vec![0.0, 180.0], vec![100.0, 100.0]).unwrap();
        let reflectance = Reflectances::with_equal_walls(reflectance, reflectance, reflectance);
        let room = Room { size_m: DVec3::splat(2.0), reflectance };
        (room, fixtures::luminaire("lamp", DVec3::splat(1.0), even))
    }

    #[test]
    fn the_cost_of_a_prediction_is_that_of_its_patches() {
        // 150 patches, each with four points by luminaire, the other meters, and a fifth of all pairs.
        assert_eq!(PatchRadiosity::count_work(2, 3), 150 * (4 * 2 + 3 + 30));
    }

    #[test]
    fn a_closed_room_has_the_reflected_light_of_its_flux() {
        // Phi = 400 pi on 24 m2: Phi rho / (A (1 - rho)) in the mean, and Phi rho / A of the first reflection alone.
        let meters = Surface::ALL.map(|surface| {
            let [a, b, c, d] = cube(0.5).0.corners(surface);
            Meter { position_m: 0.25 * (a + b + c + d), normal: surface.inward_normal() }
        });
        let first = 400.0 * std::f64::consts::PI / 24.0;
        for (reflectance, bounces, expected) in [
            (0.5, Bounces::Converged, first),
            (0.8, Bounces::Converged, 4.0 * first),
            (0.5, Bounces::AtMost(1), 0.5 * first),
            (0.5, Bounces::AtMost(2), 0.75 * first),
            (0.5, Bounces::AtMost(0), 0.0),
        ] {
            let (room, lamp) = cube(reflectance);
            let solver = PatchRadiosity::new(&room, &meters);
            let found = solver.illuminance(&room, std::slice::from_ref(&lamp), &meters, bounces);
            // In the middle of each side it is more than in the mean, by a tenth for one reflection.
            assert!(found.iter().all(|e| (e - expected).abs() <= 0.12 * expected), "{bounces:?}: {found:?} {expected}");
            assert!(found.iter().all(|e| (e - found[0]).abs() < 1e-9), "{found:?}");
            // The same for meters that were not asked for at first, and twice as much of two.
            let other = PatchRadiosity::new(&room, &meters[..1]).illuminance(
                &room,
                std::slice::from_ref(&lamp),
                &meters,
                bounces,
            );
            assert_eq!(found, other);
            let twice = solver.illuminance(&room, &[lamp.clone(), lamp], &meters, bounces);
            assert!(twice.iter().zip(&found).all(|(a, b)| (a - 2.0 * b).abs() < 1e-9 * a.max(1.0)));
        }
    }

    #[test]
    fn patches_cover_a_surface_and_see_the_whole_room() {
        let room = Room { size_m: DVec3::new(3.0, 5.0, 2.0), ..cube(0.5).0 };
        let patches = split_into_patches(&room, Surface::Floor);
        assert_eq!(patches.len(), 25);
        let areas = patches.iter().map(|p| {
            let [a, b, _, d] = p.corners_m;
            (b - a).cross(d - a).length()
        });
        assert!(areas.clone().all(|area| (area - 15.0 / 25.0).abs() < 1e-12));
        let middle = patches.iter().map(|p| p.at(0.5, 0.5)).sum::<DVec3>() / 25.0;
        assert!((middle - DVec3::new(1.5, 2.5, 0.0)).length() < 1e-12, "{middle}");
        let solver = PatchRadiosity::new(&room, &[]);
        assert!(solver.patch_factors.iter().all(|row| (row.iter().sum::<f64>() - 1.0).abs() < 1e-12));
        // No patch sees its own surface.
        assert!(solver.patch_factors[0][..25].iter().all(|factor| *factor == 0.0));
        // 150 patches with four points each; thirty units for the reflections of a patch.
        assert_eq!(PatchRadiosity::count_work(3, 7), 150 * (4 * 3 + 7 + 30));
    }
}
