//! Tests of the closed forms: each against a second derivation (quadrature, series), and the CIE-type values.

use std::f64::consts::TAU;

use super::*;
use approx::assert_relative_eq;

/// Configuration factor of a disc by the midpoint rule over its area; the part with x > beyond counts.
fn disc_by_area(radius: f64, beyond: f64, element: DVec3, normal: DVec3) -> f64 {
    let (rings, spokes) = (600, 1200);
    let mut sum = 0.0;
    for ring in 0..rings {
        let r = radius * (f64::from(ring) + 0.5) / f64::from(rings);
        for spoke in 0..spokes {
            let angle = TAU * (f64::from(spoke) + 0.5) / f64::from(spokes);
            let to = DVec3::new(r * angle.cos(), r * angle.sin(), 0.0);
            if to.x > beyond {
                let ray = to - element;
                let cosines = ray.dot(normal).max(0.0) * element.z / ray.length_squared();
                sum += cosines / (PI * ray.length_squared()) * r;
            }
        }
    }
    sum * radius / f64::from(rings) * TAU / f64::from(spokes)
}

#[test]
fn disc_factors_equal_area_quadrature_and_contour_integral() {
    for (radius, height, offset) in [(1.0, 2.0, 1.5), (2.0, 3.0, 2.5), (0.5, 0.7, 4.0)] {
        let element = DVec3::new(offset, 0.0, height);
        let above = disc_parallel(radius, height, offset);
        let beside = disc_perpendicular(radius, height, offset);
        for (closed, normal) in [(above, DVec3::NEG_Z), (beside, DVec3::NEG_X)] {
            assert_relative_eq!(closed, disc_by_area(radius, -radius, element, normal), max_relative = 1e-5);
            let contour = disc_segment(radius, -radius, element, normal);
            assert_relative_eq!(closed, contour, max_relative = 1e-7);
        }
    }
    assert_relative_eq!(disc_parallel(1.0, 1.0, 0.0), 0.5, epsilon = 1e-15);
    let element = DVec3::new(2.0, 0.3, 1.8);
    let half = disc_segment(1.5, 0.4, element, DVec3::NEG_X);
    assert_relative_eq!(half, disc_by_area(1.5, 0.4, element, DVec3::NEG_X), max_relative = 2e-3);
    assert_eq!(disc_segment(1.0, 1.0, DVec3::new(2.0, 0.0, 1.0), DVec3::NEG_X), 0.0);
}

#[test]
fn cie_5_2_point_source_values() {
    let expected = [111.111, 105.186, 90.000, 71.111, 99.723, 85.663, 68.053, 74.380, 59.975, 49.383];
    let offsets = [
        (0.0, 0.0),
        (0.5, 0.0),
        (1.0, 0.0),
        (1.5, 0.0),
        (0.5, 0.5),
        (1.0, 0.5),
        (1.5, 0.5),
        (1.0, 1.0),
        (1.5, 1.0),
        (1.5, 1.5),
    ];
    for ((x, y), expected) in offsets.into_iter().zip(expected) {
        let offset = f64::hypot(x, y);
        let closed = lambertian_point(Candela(1000.0), 3.0, offset).value();
        assert_relative_eq!(closed, expected, epsilon = 5e-4);
        // Second derivation: a small Lambertian patch of the same axial intensity, by Lambert's polygon formula.
        let side = 1e-3;
        let patch =
            [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)].map(|(u, v)| DVec3::new(u * side, v * side, 3.0));
        let factor = element_to_polygon(DVec3::new(x, y, 0.0), DVec3::Z, &patch);
        assert_relative_eq!(closed, PI * 1000.0 / (side * side) * factor, max_relative = 1e-6);
    }
}

#[test]
fn cie_5_3_area_source_values() {
    let exitance = lambertian_exitance(1000.0).value();
    let source = [(1.5, 1.5), (2.5, 1.5), (2.5, 2.5), (1.5, 2.5)].map(|(x, y)| DVec3::new(x, y, 3.0));
    let wall = [32.677, 75.194, 81.323, 69.061, 53.404, 40.002];
    let floor = [61.424, 79.255, 95.667, 105.778];
    let on_wall = wall.iter().enumerate().map(|(k, e)| (DVec3::new(2.0, 0.0, 2.75 - 0.5 * k as f64), DVec3::Y, *e));
    let on_floor = floor.iter().enumerate().map(|(k, e)| (DVec3::new(2.0, 0.25 + 0.5 * k as f64, 0.0), DVec3::Z, *e));
    for (point, normal, expected) in on_wall.chain(on_floor) {
        let closed = exitance * element_to_polygon(point, normal, &source);
        assert_relative_eq!(closed, expected, epsilon = 6e-4);
        // Second derivation: area quadrature.
        let n = 200;
        let mut sum = 0.0;
        for i in 0..n {
            for j in 0..n {
                let [x, y] = [i, j].map(|k| 1.5 + (f64::from(k) + 0.5) / f64::from(n));
                let ray = DVec3::new(x, y, 3.0) - point;
                sum += ray.dot(normal) * ray.z / ray.length_squared().powi(2);
            }
        }
        let area = f64::from(n * n).recip();
        assert_relative_eq!(closed, exitance / PI * sum * area, max_relative = 2e-4);
    }
}

#[test]
fn cie_5_8_interreflection_values() {
    let expected = [
        (0.05, 5.482),
        (0.1, 11.574),
        (0.2, 26.042),
        (0.3, 44.643),
        (0.5, 104.167),
        (0.8, 416.667),
        (0.9, 937.5),
        (0.95, 1979.17),
    ];
    for (rho, expected) in expected {
        let closed = closed_room_mean_indirect(Lumen(10_000.0), 96.0, rho).value();
        assert_relative_eq!(closed, expected, max_relative = 1e-5, epsilon = 5e-4);
        // Second derivation: the sum of the reflections.
        let series = closed_room_mean_indirect_up_to(Lumen(10_000.0), 96.0, rho, 2000).value();
        assert_relative_eq!(closed, series, max_relative = 1e-12);
    }
    let direct = closed_room_mean(Lumen(10_000.0), 96.0, 0.5) - closed_room_mean_indirect(Lumen(10_000.0), 96.0, 0.5);
    assert_relative_eq!(direct.value(), 10_000.0 / 96.0, max_relative = 1e-14);
}

#[test]
fn planes_and_spheres_equal_the_sum_of_their_reflections() {
    let (r1, r2) = (0.7, 0.4);
    let (mut e, mut wave) = ([100.0, 0.0], [100.0, 0.0]);
    for _ in 0..400 {
        wave = [r2 * wave[1], r1 * wave[0]];
        e = [e[0] + wave[0], e[1] + wave[1]];
    }
    let closed = infinite_parallel_planes(Lux(100.0), r1, r2);
    for k in 0..2 {
        assert_relative_eq!(closed[k].value(), e[k], max_relative = 1e-12);
    }
    let (inner, outer, s) = (1.0, 3.0, 1.0 / 9.0);
    let first = [20.0, 50.0];
    let (mut e, mut wave) = (first, first);
    for _ in 0..400 {
        wave = [r2 * wave[1], s * r1 * wave[0] + (1.0 - s) * r2 * wave[1]];
        e = [e[0] + wave[0], e[1] + wave[1]];
    }
    let closed = concentric_spheres(inner, outer, [Lux(20.0), Lux(50.0)], r1, r2);
    for k in 0..2 {
        assert_relative_eq!(closed[k].value(), e[k], max_relative = 1e-12);
    }
    // Without the inner sphere's size it is the integrating sphere; close together the two are planes.
    let alone = concentric_spheres(1e-9, 1.0, [Lux(0.0), Lux(10.0)], 0.5, 0.8)[1];
    assert_relative_eq!(alone.value(), 50.0, max_relative = 1e-12);
    let planes = infinite_parallel_planes(Lux(10.0), r1, r2);
    let near = concentric_spheres(1.0, 1.0 + 1e-12, [Lux(10.0), Lux(0.0)], r1, r2);
    assert_relative_eq!(near[0].value(), planes[0].value(), max_relative = 1e-9);
    assert_relative_eq!(near[1].value(), planes[1].value(), max_relative = 1e-9);
}

#[test]
fn an_even_spot_carries_the_flux_that_its_intensity_integrates_to() {
    let (height, half_angle) = (2.0_f64, 0.6_f64);
    let count = 20_000;
    let step = half_angle / f64::from(count);
    let integrated: f64 = (0..count)
        .map(|k| {
            let t = step * (f64::from(k) + 0.5);
            TAU * 100.0 * height * height / t.cos().powi(3) * t.sin() * step
        })
        .sum();
    assert_relative_eq!(even_spot_flux(Lux(100.0), height, half_angle).value(), integrated, max_relative = 1e-8);
}
