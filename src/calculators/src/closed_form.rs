//! Closed forms of lighting: exact illuminances of rooms, spheres, planes and simple sources.
//!
//! They follow from conservation of flux and from Lambert's law (*Photometria*, 1760). They are the references of cases
//! like those of CIE 171:2006, which prints tables with known errors (Ashdown, errata to case 5.7).

use std::f64::consts::{FRAC_PI_2, PI};

use glam::DVec3;

use luxproof_photometry::units::{Candela, Lumen, LumenPerSquareMetre, Lux};
use luxproof_scene::geometry::configuration_factor::element_to_polygon;

/// Illuminance under a Lambertian point source that faces a parallel plane `height_m` away, `offset_m` to its side.
///
/// I = I0 h/d, cos xi = h/d: E = I0 h^2 / d^4.
pub fn lambertian_point(axial: Candela, height_m: f64, offset_m: f64) -> Lux {
    let d2 = height_m * height_m + offset_m * offset_m;
    Lux(axial.value() * height_m * height_m / (d2 * d2))
}

/// Area-mean illuminance, direct and reflected, of any closed room of one reflectance below 1: Phi / (A (1 - rho)).
pub fn closed_room_mean(flux: Lumen, area_m2: f64, reflectance: f64) -> Lux {
    Lux(flux.value() / (area_m2 * (1.0 - reflectance)))
}

/// The part of [`closed_room_mean`] that is reflected at least once: Phi rho / (A (1 - rho)).
///
/// In an evenly lit sphere it is uniform.
pub fn closed_room_mean_indirect(flux: Lumen, area_m2: f64, reflectance: f64) -> Lux {
    closed_room_mean(flux, area_m2, reflectance) * reflectance
}

/// The part of [`closed_room_mean`] that is reflected at least once and at most `bounces` times: a geometric series.
pub fn closed_room_mean_indirect_up_to(flux: Lumen, area_m2: f64, reflectance: f64, bounces: u32) -> Lux {
    let series: f64 = (1..=bounces).map(|n| reflectance.powf(f64::from(n))).sum();
    Lux(flux.value() / area_m2 * series)
}

/// Total illuminances of two infinite parallel planes, `first` falling on plane 1 alone.
///
/// E1 = E0 / (1 - r1 r2), E2 = r1 E1.
pub fn infinite_parallel_planes(first: Lux, reflectance_1: f64, reflectance_2: f64) -> [Lux; 2] {
    let one = first / (1.0 - reflectance_1 * reflectance_2);
    [one, one * reflectance_1]
}

/// Total illuminances of the surfaces between two concentric spheres, from the first illuminance of each.
///
/// All that leaves the inner sphere reaches the outer; of what leaves the outer, (r/R)^2 reaches the inner.
pub fn concentric_spheres(
    radius_inner_m: f64,
    radius_outer_m: f64,
    first: [Lux; 2],
    reflectance_inner: f64,
    reflectance_outer: f64,
) -> [Lux; 2] {
    let s = (radius_inner_m / radius_outer_m).powi(2);
    // E_in = first_in + rho_out E_out;  E_out = first_out + s rho_in E_in + (1 - s) rho_out E_out.
    let outer_balance = 1.0 - (1.0 - s) * reflectance_outer;
    let inner = (first[0].value() * outer_balance + reflectance_outer * first[1].value())
        / (outer_balance - s * reflectance_inner * reflectance_outer);
    let outer = (first[1].value() + s * reflectance_inner * inner) / outer_balance;
    [Lux(inner), Lux(outer)]
}

/// Configuration factor of a disc seen from a parallel element `height_m` away and `offset_m` from its axis.
///
/// Howell B-12: 1/2 (1 - (z - 2 r^2) / sqrt(z^2 - 4 r^2 a^2)), z = a^2 + h^2 + r^2.
pub fn disc_parallel(radius_m: f64, height_m: f64, offset_m: f64) -> f64 {
    let (r2, h2, a2) = (radius_m * radius_m, height_m * height_m, offset_m * offset_m);
    let z = a2 + h2 + r2;
    0.5 * (1.0 - (z - 2.0 * r2) / (z * z - 4.0 * r2 * a2).sqrt())
}

/// Configuration factor of a disc seen from a perpendicular element that faces its axis, `height_m` above the disc's
/// plane and `offset_m`, more than the radius, from its axis.
///
/// Howell B-13: h / (2 a) (z / sqrt(z^2 - 4 r^2 a^2) - 1), z = a^2 + h^2 + r^2.
pub fn disc_perpendicular(radius_m: f64, height_m: f64, offset_m: f64) -> f64 {
    let (r2, h2, a2) = (radius_m * radius_m, height_m * height_m, offset_m * offset_m);
    let z = a2 + h2 + r2;
    height_m / (2.0 * offset_m) * (z / (z * z - 4.0 * r2 * a2).sqrt() - 1.0)
}

/// Configuration factor of the part of a disc beyond a straight edge, by Lambert's contour integral.
///
/// The disc lies in the plane z = 0 around the origin, and its part with x > `beyond_m` counts. The arc has 20 000
/// corners, with an error of about 1e-8.
pub fn disc_segment(radius_m: f64, beyond_m: f64, element_m: DVec3, normal: DVec3) -> f64 {
    if beyond_m >= radius_m {
        return 0.0;
    }
    let half_angle = if beyond_m <= -radius_m { PI } else { (beyond_m / radius_m).acos() };
    let count: u32 = 20_000;
    let mut outline = vec![];
    for k in 0..=count {
        let (sin, cos) = (half_angle * (2.0 * f64::from(k) / f64::from(count) - 1.0)).sin_cos();
        outline.push(DVec3::new(radius_m * cos, radius_m * sin, 0.0));
    }
    element_to_polygon(element_m, normal, &outline)
}

/// Exitance of a Lambertian surface of the given luminance \[cd/m²\]: M = pi L.
pub fn lambertian_exitance(luminance_cd_m2: f64) -> LumenPerSquareMetre {
    LumenPerSquareMetre(PI * luminance_cd_m2)
}

/// Flux of an axially symmetric intensity that lights a plane evenly up to an angle (radians).
///
/// I = E h^2 / cos^3, Phi = pi (h tan)^2 E.
pub fn even_spot_flux(illuminance: Lux, height_m: f64, half_angle: f64) -> Lumen {
    debug_assert!(half_angle < FRAC_PI_2);
    let radius = height_m * half_angle.tan();
    Lumen(PI * radius * radius * illuminance.value())
}

#[cfg(test)]
#[path = "closed_form_tests.rs"]
mod tests;
