//! What holds for every renderer that follows each reading's light by itself; each calls these from tests of its own.

use std::f64::consts::PI;

use glam::DVec3;
use luminaire::geometry::Reflectances;
use luminaire::scene::{Bounces, Obstacle, Shape, Transport, orientation};

use super::fixtures::*;
use super::{Job, Measurement};

/// Direct light of S1 within its bound, which is less than `relative`.
pub(super) fn bounds_are_small_and_hold(found: &Measurement, relative: f64) {
    for (estimate, exact) in found.estimates.iter().zip(S1_DIRECT_LX) {
        let bound = estimate.uncertainty.bound();
        assert!((estimate.value - exact).abs() <= bound && bound < relative * exact, "{estimate:?} for {exact}");
    }
}

/// The difference to the converged value, .6 %, is seen as more than `z` standard errors.
pub(super) fn n_bounces_are_n_reflections(read: impl Fn(&Job) -> Measurement, relative_error: f64, z: f64) {
    let mut seven = s1(Transport::Indirect(Bounces::AtMost(7)));
    seven.budget.relative_error = relative_error;
    let found = read(&seven);
    assert!(worst_z(&found, &S1_SEVEN_LX) < 4.0, "{found:?}");
    assert!(worst_z(&found, &S1_INDIRECT_LX) > z, "{found:?}");
    let none = read(&s1(Transport::Indirect(Bounces::AtMost(0))));
    assert!(none.estimates.iter().all(|e| e.value == 0.0), "{none:?}");
}

pub(super) fn total_is_direct_plus_indirect(read: impl Fn(Job) -> Measurement) {
    let mut total = s1(Transport::Total(Bounces::Converged));
    for station in &mut total.stations {
        station.meter.normal = DVec3::NEG_Z;
        station.meter.position_m.z = 17.0;
    }
    let direct = exact_direct_lx(&total);
    let indirect = read(Job { transport: CONVERGED, ..total.clone() });
    for ((total, indirect), direct) in read(total).estimates.iter().zip(&indirect.estimates).zip(direct) {
        let sum = direct + indirect.value;
        let error = total.uncertainty.standard_error().unwrap().hypot(indirect.uncertainty.standard_error().unwrap());
        assert!((total.value - sum).abs() < 4.0 * error + 1e-5 * sum, "{total:?} {indirect:?} {direct}");
    }
}

pub(super) fn turned_luminaires_read_their_own_table(read: impl Fn(&Job) -> Measurement) {
    for distribution in [lopsided(), quadrant()] {
        let every = |step: u32, end: u32| (0..=end / step).map(|k| f64::from(k * step)).collect::<Vec<_>>();
        let job = goniometer(&turned(distribution), 10.0, &every(15, 345), &every(5, 180));
        let (found, exact) = (read(&job), exact_direct_lx(&job));
        let scale = exact.iter().copied().fold(0.0, f64::max);
        for (estimate, exact) in found.estimates.iter().zip(exact) {
            let bound = estimate.uncertainty.bound();
            assert!((estimate.value - exact).abs() < 1e-4 * exact + 1e-5 * scale, "{estimate:?} for {exact}");
            assert!((estimate.value - exact).abs() <= bound, "{estimate:?} for {exact}");
        }
    }
}

pub(super) fn luminaires_add_up_and_obstacles_throw_shadows(read: impl Fn(&Job) -> Measurement) {
    let mut scene = s1(Transport::Direct).scene;
    scene.luminaires.push(luminaire("lopsided", DVec3::new(4.0, 5.0, 12.0), lopsided()));
    scene.luminaires.push(luminaire("second of its kind", DVec3::new(15.0, 5.0, 12.0), lopsided()));
    let points = [[3.0, 4.0, 5.0], [12.0, 12.0, 6.0], [18.0, 1.0, 1.0]];
    let free = job(scene, stations(&points, DVec3::Z), Transport::Direct);
    assert!(worst_relative(&read(&free), &exact_direct_lx(&free)) < 1e-5);

    // A plate right above the first meter, once as a box and once as a mesh, hides every luminaire from it alone.
    let (min_m, max_m) = (DVec3::new(2.0, 3.0, 5.5), DVec3::new(4.0, 5.0, 5.6));
    let vertices_m = vec![min_m, max_m.with_y(min_m.y), max_m, min_m.with_y(max_m.y)];
    let mesh = Shape::Mesh { vertices_m, triangles: vec![[0, 1, 2], [0, 2, 3]] };
    for shape in [Shape::Box { min_m, max_m }, mesh] {
        let mut shaded = free.clone();
        shaded.scene.obstacles = vec![Obstacle { shape, reflectance: 0.3 }];
        shaded.stations[0].meter.position_m = DVec3::new(3.0, 4.0, 5.4);
        let found = read(&shaded);
        assert_eq!(found.estimates[0].value, 0.0);
        assert!(worst(&relative_deviations(&found, &exact_direct_lx(&shaded))[1..]) < 1e-5, "{found:?}");
    }
}

/// Replaced texts of `file`: one by itself, then what makes a factor pi, drops the multiplier .7 and turns by 90 degrees.
pub(super) fn wrong_exports_are_seen(
    file: &str,
    right: f64,
    replaced: [(&str, &str); 4],
    read: impl Fn(&Job, &dyn Fn(&str, String) -> String) -> Measurement,
) {
    let mut lamp = luminaire("turned", DVec3::ZERO, lopsided());
    lamp.flux_scale = 0.7;
    let job = goniometer(&lamp, 10.0, &[0.0, 60.0, 200.0], &[30.0, 80.0]);
    let exact = exact_direct_lx(&job);
    let [unchanged, factor_pi, multiplier_dropped, turned_by_90] = replaced.map(|(from, to)| {
        let tampered = |name: &str, text: String| {
            if name != file {
                return text;
            }
            assert!(text.contains(from), "{text}");
            text.replace(from, to)
        };
        worst_relative(&read(&job, &tampered), &exact)
    });
    assert!(unchanged < right);
    assert!((factor_pi - (PI - 1.0)).abs() < 1e-4 && (multiplier_dropped - 1.0 / 0.7 + 1.0).abs() < 1e-4);
    assert!(turned_by_90 > 0.1, "{turned_by_90}");
}

/// Six reflectances, a turned luminaire whose name would end a comment, a box and a mesh: everything that an export writes.
pub(super) fn furnished() -> Job {
    let mut job = s1(Transport::Total(Bounces::AtMost(3)));
    let room = job.scene.room.as_mut().unwrap();
    room.size_m = DVec3::new(8.0, 6.0, 3.0);
    room.reflectance =
        Reflectances { floor: 0.2, ceiling: 0.8, wall_x_min: 0.5, wall_x_max: 0.4, wall_y_min: 0.3, wall_y_max: 0.6 };
    let mut turned = luminaire("desk -- left", DVec3::new(2.0, 3.0, 1.5), quadrant());
    turned.orientation = orientation(90.0, 0.0, 0.0);
    turned.flux_scale = 0.5;
    job.scene.luminaires[0].position_m = DVec3::new(4.0, 3.0, 2.0);
    job.scene.luminaires.push(turned);
    let vertices_m = vec![DVec3::new(5.0, 1.0, 0.0), DVec3::new(6.0, 1.0, 0.0), DVec3::new(5.5, 1.0, 1.0)];
    let mesh = Shape::Mesh { vertices_m, triangles: vec![[0, 1, 2]] };
    let desk = cuboid([1.0, 1.0, 0.0], [2.6, 1.8, 0.75], 0.5);
    job.scene.obstacles = vec![desk, Obstacle { shape: mesh, reflectance: 0.25 }];
    job.stations.truncate(2);
    job
}
