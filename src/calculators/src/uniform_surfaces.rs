//! The exact counterpart of the zonal cavity method: a room of six uniform surfaces, without fitted constants.
//!
//! Both methods assume that each surface reflects evenly. Here the first illuminance of each surface is integrated over
//! the luminaires' directions. Form factors are those of the box (Howell C-11, C-14), and illuminances use the
//! configuration factors of the surfaces. The difference from the zonal cavity values is the error of fitted constants
//! and cavities; the difference from the truth is the error of uniformity.

use glam::DVec3;

use super::NotApplicable;
use luxproof_photometry::direction;
use luxproof_photometry::units::{Lumen, LumenPerSquareMetre, Lux};
use luxproof_scene::geometry::configuration_factor::{adjacent_rectangles, element_to_polygon, opposed_rectangles};
use luxproof_scene::geometry::{Room, Surface};
use luxproof_scene::{Luminaire, Meter, Scene, flush};

/// The name of the method in errors.
const METHOD: &str = "balance of six uniform surfaces";

/// Mean exitances of the six surfaces of a room.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UniformSurfaces {
    room: Room,
    /// Mean exitance of each surface, in the order of [`Surface::ALL`].
    pub exitance: [LumenPerSquareMetre; 6],
    /// Flux that each surface receives directly from the luminaires, in the order of [`Surface::ALL`].
    pub first_flux: [Lumen; 6],
}

/// Solves the balance for a scene, without its obstacles.
///
/// It fails without a room, with a reflectance outside 0..1 and with a luminaire outside the room.
pub fn solve(scene: &Scene) -> Result<UniformSurfaces, NotApplicable> {
    let room = scene.room.ok_or_else(|| refuse("the scene has no room"))?;
    let rho = Surface::ALL.map(|surface| room.reflectance.of(surface));
    if !rho.iter().all(|rho| (0.0..1.0).contains(rho)) {
        return Err(refuse("every reflectance must be at least 0 and below 1"));
    }
    if !scene.luminaires.iter().all(|luminaire| room.contains(luminaire.position_m, 0.0)) {
        return Err(refuse("a luminaire lies outside the room"));
    }
    let mut first = [0.0; 6];
    for luminaire in &scene.luminaires {
        for (total, flux) in first.iter_mut().zip(first_flux(&room, luminaire)) {
            *total += flux;
        }
    }
    let factors = form_factors(&room);
    let area = Surface::ALL.map(|surface| room.area_m2(surface));
    let illuminance = solve_linear(
        std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j)) - factors[i][j] * rho[j])),
        std::array::from_fn(|i| first[i] / area[i]),
    );
    Ok(UniformSurfaces {
        room,
        exitance: std::array::from_fn(|i| LumenPerSquareMetre(illuminance[i] * rho[i])),
        first_flux: first.map(Lumen),
    })
}

/// The error of a scene that the balance cannot take.
fn refuse(reason: &str) -> NotApplicable {
    NotApplicable { method: METHOD, reason: reason.into() }
}

impl UniformSurfaces {
    /// Reflected light at a meter of any normal inside the room: sum of exitance times configuration factor.
    pub fn indirect_illuminance(&self, meter: &Meter) -> Lux {
        let seen = Surface::ALL.iter().zip(self.exitance).map(|(surface, exitance)| {
            exitance.value() * element_to_polygon(meter.position_m, meter.normal, &self.room.corners(*surface))
        });
        Lux(seen.sum())
    }
}

/// `F[i][j]`, the share of the light from surface i that reaches surface j, in the order of [`Surface::ALL`].
pub fn form_factors(room: &Room) -> [[f64; 6]; 6] {
    let size = room.size_m;
    std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            let (a, b) = (Surface::ALL[i].axis(), Surface::ALL[j].axis());
            if i == j {
                0.0
            } else if a == b {
                opposed_rectangles(size[(a + 1) % 3], size[(a + 2) % 3], size[a])
            } else {
                // Axes a and b are the normals; the surfaces share an edge along the third.
                adjacent_rectangles(size[3 - a - b], size[b], size[a])
            }
        })
    })
}

/// Flux from one luminaire onto each surface, in lumens, as a sum over directions.
fn first_flux(room: &Room, luminaire: &Luminaire) -> [f64; 6] {
    let (planes, bands) = (720, 720);
    let mut flux = [0.0; 6];
    let own_surface = flush::surface_of(room, luminaire);
    for band in 0..bands {
        let [upper, lower] = [band, band + 1].map(|k| (std::f64::consts::PI * f64::from(k) / f64::from(bands)).cos());
        let solid = std::f64::consts::TAU / f64::from(planes) * (upper - lower);
        let gamma_deg = 180.0 * (f64::from(band) + 0.5) / f64::from(bands);
        for plane in 0..planes {
            let c_deg = 360.0 * (f64::from(plane) + 0.5) / f64::from(planes);
            let towards = direction(c_deg, gamma_deg);
            let intensity = luminaire.intensity_towards(towards).value();
            if intensity > 0.0 {
                let surface = first_surface(room, luminaire.position_m, towards);
                // A flush luminaire loses the light that it emits into its own surface.
                if own_surface != Some(Surface::ALL[surface]) {
                    flux[surface] += intensity * solid;
                }
            }
        }
    }
    flux
}

/// Index into [`Surface::ALL`] of the surface that a ray from inside meets first.
fn first_surface(room: &Room, from_m: DVec3, towards: DVec3) -> usize {
    let mut nearest = (f64::INFINITY, 0);
    for (index, surface) in Surface::ALL.iter().enumerate() {
        let (axis, plane) = (surface.axis(), if surface.is_far() { room.size_m[surface.axis()] } else { 0.0 });
        let outward = if surface.is_far() { towards[axis] } else { -towards[axis] };
        if outward > 0.0 {
            let distance = (plane - from_m[axis]) / towards[axis];
            if distance < nearest.0 {
                nearest = (distance, index);
            }
        }
    }
    nearest.1
}

/// Solves a linear system by Gauss elimination.
///
/// The matrix is strictly diagonally dominant, so that no pivoting is needed.
fn solve_linear(mut a: [[f64; 6]; 6], mut b: [f64; 6]) -> [f64; 6] {
    for k in 0..6 {
        let pivot = a[k];
        for r in k + 1..6 {
            let factor = a[r][k] / pivot[k];
            for (value, above) in a[r].iter_mut().zip(pivot) {
                *value -= factor * above;
            }
            b[r] -= factor * b[k];
        }
    }
    for k in (0..6).rev() {
        b[k] = (b[k] - (k + 1..6).map(|c| a[k][c] * b[c]).sum::<f64>()) / a[k][k];
    }
    b
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exitance_difference::tests::{room, uplight_scene};
    use approx::assert_relative_eq;
    use luxproof_scene::geometry::Reflectances;

    #[test]
    fn form_factors_are_reciprocal_and_their_rows_sum_to_one() {
        let room = Room { size_m: DVec3::new(3.0, 7.0, 2.4), ..room() };
        let factors = form_factors(&room);
        let area = Surface::ALL.map(|surface| room.area_m2(surface));
        for (i, row) in factors.iter().enumerate() {
            assert_relative_eq!(row.iter().sum::<f64>(), 1.0, epsilon = 1e-14);
            for (j, factor) in row.iter().enumerate() {
                assert_relative_eq!(area[i] * factor, area[j] * factors[j][i], epsilon = 1e-13);
            }
        }
    }

    #[test]
    fn what_the_surfaces_absorb_is_what_the_luminaires_emit() {
        let mut scene = uplight_scene();
        scene.luminaires[0].position_m = DVec3::new(3.0, 12.0, 7.0);
        let solved = solve(&scene).unwrap();
        let emitted = scene.luminaires[0].photometry.distribution.flux().value();
        let first: f64 = solved.first_flux.iter().map(|flux| flux.value()).sum();
        assert_relative_eq!(first, emitted, max_relative = 2e-5);
        let absorbed: f64 = Surface::ALL
            .iter()
            .zip(solved.exitance)
            .map(|(surface, exitance)| {
                let rho = room().reflectance.of(*surface);
                exitance.value() / rho * (1.0 - rho) * room().area_m2(*surface)
            })
            .sum();
        assert_relative_eq!(absorbed, first, max_relative = 1e-12);
    }

    #[test]
    fn one_reflectance_in_a_cube_gives_the_closed_form_of_a_closed_room() {
        let mut scene = uplight_scene();
        for rho in [0.05, 0.5, 0.95] {
            scene.room = Some(Room { reflectance: Reflectances::with_equal_walls(rho, rho, rho), ..room() });
            let solved = solve(&scene).unwrap();
            let flux: f64 = solved.first_flux.iter().map(|flux| flux.value()).sum();
            let mean = solved.exitance.iter().map(|m| m.value()).sum::<f64>() / 6.0;
            assert_relative_eq!(mean, flux * rho / ((1.0 - rho) * 2400.0), max_relative = 1e-12);
        }
    }

    /// The solid angle of a room's surface from a point, as four rectangles with a corner at its foot.
    fn solid_angle(room: &Room, surface: Surface, from_m: DVec3) -> f64 {
        let axis = surface.axis();
        let plane = if surface.is_far() { room.size_m[axis] } else { 0.0 };
        let (u, v, distance) = ((axis + 1) % 3, (axis + 2) % 3, (plane - from_m[axis]).abs());
        let mut sum = 0.0;
        for a in [from_m[u], room.size_m[u] - from_m[u]] {
            for b in [from_m[v], room.size_m[v] - from_m[v]] {
                sum += (a * b / (distance * (a * a + b * b + distance * distance).sqrt())).atan();
            }
        }
        sum
    }

    /// A scene with an isotropic luminaire of 100 cd in a room of 3 m, 7 m and 2.4 m.
    fn isotropic_scene(position_m: DVec3) -> Scene {
        let even = luxproof_photometry::LuminousIntensityDistribution::axial(vec![0.0, 180.0], vec![100.0, 100.0]);
        let mut scene = uplight_scene();
        scene.room = Some(Room { size_m: DVec3::new(3.0, 7.0, 2.4), ..room() });
        let photometry = luxproof_photometry::Photometry::of(even.unwrap());
        scene.luminaires[0].photometry = std::sync::Arc::new(photometry);
        scene.luminaires[0].position_m = position_m;
        scene
    }

    #[test]
    fn even_light_falls_on_each_surface_by_its_solid_angle() {
        let position_m = DVec3::new(0.8, 4.5, 1.9);
        let mut scene = isotropic_scene(position_m);
        let room = scene.room.unwrap();
        for scale in [1.0, 3.0] {
            for (surface, flux) in Surface::ALL.iter().zip(solve(&scene).unwrap().first_flux) {
                let expected = scale * 100.0 * solid_angle(&room, *surface, position_m);
                // By directions half a degree from each other.
                assert_relative_eq!(flux.value(), expected, max_relative = 1e-2);
            }
            // A second luminaire at the same place, twice as bright.
            scene.luminaires.push(Luminaire { flux_scale: 2.0, ..scene.luminaires[0].clone() });
        }
    }

    #[test]
    fn a_luminaire_in_a_wall_lights_the_room_with_half_of_its_light() {
        let mut scene = isotropic_scene(DVec3::new(0.0, 2.0, 1.0));
        scene.luminaires[0].orientation = luxproof_scene::orientation(20.0, 90.0, 3.0);
        let solved = solve(&scene).unwrap();
        let total: f64 = solved.first_flux.iter().map(|flux| flux.value()).sum();
        assert_relative_eq!(total, std::f64::consts::TAU * 100.0, max_relative = 2e-3);
        for (surface, flux) in Surface::ALL.iter().zip(solved.first_flux) {
            assert_eq!(flux.value() == 0.0, surface.axis() == 0 && !surface.is_far(), "{surface:?}");
        }
    }

    #[test]
    fn scenes_without_a_room_with_a_mirror_or_a_luminaire_outside_are_refused() {
        let scene = uplight_scene();
        let mirror = Room { reflectance: Reflectances::with_equal_walls(0.2, 1.0, 0.8), ..room() };
        let mut outside = scene.clone();
        outside.luminaires[0].position_m = DVec3::new(3.0, 12.0, 20.1);
        for (wrong, part) in [
            (Scene { room: None, ..scene.clone() }, "no room"),
            (Scene { room: Some(mirror), ..scene.clone() }, "below 1"),
            (outside, "outside the room"),
        ] {
            let refused = solve(&wrong).unwrap_err().to_string();
            let begin = "the balance of six uniform surfaces does not apply: ";
            assert!(refused.starts_with(begin) && refused.contains(part), "{refused}");
        }
        let black = Room { reflectance: Reflectances::with_equal_walls(0.0, 0.0, 0.0), ..room() };
        assert!(solve(&Scene { room: Some(black), ..scene }).unwrap().exitance.iter().all(|m| m.value() == 0.0));
    }

    #[test]
    fn a_meter_reads_each_surface_by_its_configuration_factor() {
        let room = Room { size_m: DVec3::new(2.0, 2.0, 2.0), ..room() };
        let mut solved =
            UniformSurfaces { room, exitance: [LumenPerSquareMetre(100.0); 6], first_flux: [Lumen(0.0); 6] };
        // In a furnace every meter reads the exitance, wherever it looks.
        let turned = Meter { position_m: DVec3::new(0.3, 1.1, 0.7), normal: DVec3::new(0.6, 0.0, -0.8) };
        assert_relative_eq!(solved.indirect_illuminance(&turned).value(), 100.0, max_relative = 1e-12);
        let on_the_floor = Meter { position_m: DVec3::new(0.3, 1.1, 0.0), normal: DVec3::Z };
        assert_relative_eq!(solved.indirect_illuminance(&on_the_floor).value(), 100.0, max_relative = 1e-12);
        // A square of 2 m at 2 m, seen from its axis: four times a / sqrt(a^2 + h^2) atan(a / sqrt(a^2 + h^2)) / pi.
        let ceiling = Surface::ALL.iter().position(|s| *s == Surface::Ceiling).unwrap();
        solved.exitance = [LumenPerSquareMetre(0.0); 6];
        solved.exitance[ceiling] = LumenPerSquareMetre(100.0);
        let up = Meter { position_m: DVec3::new(1.0, 1.0, 0.0), normal: DVec3::Z };
        let sine = 5f64.sqrt().recip();
        let expected = 400.0 * sine * sine.atan() / std::f64::consts::PI;
        assert_relative_eq!(solved.indirect_illuminance(&up).value(), expected, max_relative = 1e-12);
        let down = Meter { normal: DVec3::NEG_Z, ..up };
        assert_eq!(solved.indirect_illuminance(&down).value(), 0.0);
    }
}
