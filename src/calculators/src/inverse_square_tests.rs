//! Tests of the inverse-square method: Lambert's law, the five-times rule's own errors, shadows, refusals.

use std::sync::Arc;

use super::*;
use approx::assert_relative_eq;
use luxproof_photometry::{Details, LuminousIntensityDistribution, Photometry};
use luxproof_scene::orientation;

fn luminaire(
    distribution: LuminousIntensityDistribution,
    opening: LuminousOpening,
    model: LuminaireModel,
) -> Luminaire {
    let photometry = Photometry {
        format: "test".into(),
        distribution,
        lamp_lumens: None,
        opening,
        input_watts: None,
        keywords: vec![],
        details: Details::None,
        lints: vec![],
        source: vec![],
    };
    Luminaire {
        id: "l".into(),
        photometry: Arc::new(photometry),
        position_m: DVec3::ZERO,
        orientation: orientation(0.0, 0.0, 0.0),
        flux_scale: 1.0,
        model,
    }
}

fn isotropic() -> LuminousIntensityDistribution {
    LuminousIntensityDistribution::axial(vec![0.0, 180.0], vec![100.0, 100.0]).unwrap()
}

fn facing_up(x: f64, y: f64, z: f64) -> Meter {
    Meter { position_m: DVec3::new(x, y, z), normal: DVec3::Z }
}

/// The point formula's error for a flat Lambertian opening, at `k` sizes and `theta_deg` from its axis along x.
fn error(opening: LuminousOpening, k: f64, theta_deg: f64) -> f64 {
    let luminaire = luminaire(isotropic(), opening, LuminaireModel::Area);
    let distance = k * largest_dimension_m(&opening);
    let (sin, cos) = theta_deg.to_radians().sin_cos();
    lambertian_twin(&luminaire, &facing_up(distance * sin, 0.0, -distance * cos)).unwrap()
}

#[test]
fn five_times_rule_states_the_error_of_discs_squares_and_lines() {
    let disc = LuminousOpening::Ellipse { x_m: 1.0, y_m: 1.0, height_m: 0.0 };
    let square = LuminousOpening::Box { x_m: 1.0, y_m: 1.0, height_m: 0.0 };
    let line = LuminousOpening::Box { x_m: 1e-3, y_m: 1.0, height_m: 0.0 };
    // On axis a disc of diameter 1 gives pi L / (1 + 4 k^2) exactly, so the point formula is 1/(4 k^2) too high.
    for k in [1.0, 2.0, 5.0, 20.0] {
        assert_relative_eq!(error(disc, k, 0.0), 0.25 / (k * k), max_relative = 1e-4, epsilon = 1e-8);
    }
    // Second order in 1/k; the next order stays below 1/k^4.
    for k in [5.0_f64, 10.0, 40.0] {
        for theta in [0.0_f64, 30.0, 45.0, 60.0, 80.0] {
            let s2 = theta.to_radians().sin().powi(2);
            let fourth = 1.5 / k.powi(4);
            assert_relative_eq!(error(disc, k, theta), (0.25 - 0.75 * s2) / (k * k), epsilon = fourth);
            assert_relative_eq!(error(square, k, theta), (1.0 / 3.0 - s2) / (k * k), epsilon = fourth);
        }
        assert_relative_eq!(error(line, k, 0.0), 1.0 / (6.0 * k * k), epsilon = 0.5 / k.powi(4));
    }
    // The figures usually quoted at five sizes.
    for (theta, percent) in [(0.0, 1.33), (45.0, -0.65), (60.0, -1.64), (80.0, -2.5)] {
        assert_relative_eq!(100.0 * error(square, 5.0, theta), percent, epsilon = 0.05);
    }
}

/// Whether the formula holds at a height over a square of .6 m, below 0 in front of it.
fn read(model: LuminaireModel, z: f64) -> Validity {
    let square = LuminousOpening::Box { x_m: 0.6, y_m: 0.6, height_m: 0.0 };
    let scene = Scene { luminaires: vec![luminaire(isotropic(), square, model)], ..Scene::default() };
    Validity::of(&direct_illuminance(&scene, &facing_up(0.0, 0.0, z)))
}

#[test]
fn five_times_rule_is_said_only_of_extended_models() {
    assert_eq!(read(LuminaireModel::Point, -1.0), Validity::Supported);
    let Validity::Approximate(far) = read(LuminaireModel::Area, -6.0) else { panic!("not approximate") };
    assert!(far.contains("10.00 times") && far.contains("+0.33 %") && !far.contains("five-times"), "{far}");
    let Validity::No(near) = read(LuminaireModel::Area, -2.9) else { panic!("applies") };
    assert!(near.contains("4.83 times") && near.contains("five-times"), "{near}");
    assert!(matches!(read(LuminaireModel::Area, -3.1), Validity::Approximate(_)));
    // A meter that faces away is dark, however near.
    assert_eq!(read(LuminaireModel::Area, 1.0), Validity::Supported);
}

#[test]
fn a_near_luminaire_with_a_hidden_centre_is_no_case_for_the_method() {
    // A plate hides the centre and a tenth of a panel of 0.6 m; the exact value is not 0.
    let plate = |z: f64| Obstacle {
        shape: Shape::Box { min_m: DVec3::new(-0.1, -0.1, z), max_m: DVec3::new(0.1, 0.1, z + 0.01) },
        reflectance: 0.0,
    };
    let square = LuminousOpening::Box { x_m: 0.6, y_m: 0.6, height_m: 0.0 };
    let read = |model, meter_z: f64, plate_z: f64| {
        let luminaires = vec![luminaire(isotropic(), square, model)];
        let scene = Scene { luminaires, obstacles: vec![plate(plate_z)], ..Scene::default() };
        direct_illuminance(&scene, &facing_up(0.0, 0.0, meter_z))
    };
    assert!(matches!(Validity::of(&read(LuminaireModel::Area, -2.0, -0.1)), Validity::No(_)));
    assert!(matches!(Validity::of(&read(LuminaireModel::Area, -6.0, -0.1)), Validity::Approximate(_)));
    // A point is hidden or not, and behind the meter nothing is lost.
    let hidden = read(LuminaireModel::Point, -2.0, -0.1).unwrap();
    assert_eq!((hidden.illuminance, hidden.validity), (Lux(0.0), Validity::Supported));
    assert_eq!(read(LuminaireModel::Area, 2.0, 1.0).unwrap().validity, Validity::Supported);
}

#[test]
fn illuminance_falls_with_the_square_of_distance_and_the_cosine_of_incidence() {
    // Lambertian, 1000 cd on axis: E = I0 h^2 / d^4 at 3 m.
    let gamma: Vec<f64> = (0..=1800).map(|k| 0.05 * f64::from(k)).collect();
    let candela = gamma.iter().map(|g| 1000.0 * g.to_radians().cos().max(0.0)).collect();
    let lambertian = LuminousIntensityDistribution::axial(gamma, candela).unwrap();
    let source = luminaire(lambertian, LuminousOpening::Point, LuminaireModel::Point);
    let scene = Scene { luminaires: vec![source], ..Scene::default() };
    for (x, y, expected) in [(0.0, 0.0, 111.111), (1.5, 0.0, 71.111), (1.0, 1.0, 74.380), (1.5, 1.5, 49.383)] {
        let read = direct_illuminance(&scene, &facing_up(x, y, -3.0)).unwrap();
        assert_relative_eq!(read.illuminance.value(), expected, epsilon = 5e-4);
        assert_eq!(read.validity, Validity::Supported);
    }
}

#[test]
fn a_meter_that_faces_away_reads_nothing_and_flux_scale_scales() {
    let mut source = luminaire(isotropic(), LuminousOpening::Point, LuminaireModel::Point);
    let meter = facing_up(0.0, 0.0, 2.0);
    assert_eq!(from_luminaire(&source, &meter), Lux(0.0));
    source.flux_scale = 0.3;
    let meter = facing_up(0.0, 0.0, -2.0);
    assert_relative_eq!(from_luminaire(&source, &meter).value(), 7.5, max_relative = 1e-14);
}

#[test]
fn a_turned_luminaire_turns_its_distribution() {
    let spot = LuminousIntensityDistribution::axial(vec![0.0, 30.0, 180.0], vec![100.0, 0.0, 0.0]).unwrap();
    let mut source = luminaire(spot, LuminousOpening::Point, LuminaireModel::Point);
    source.orientation = orientation(0.0, 90.0, 0.0);
    let wall = Meter { position_m: DVec3::new(-2.0, 0.0, 0.0), normal: DVec3::X };
    assert_relative_eq!(from_luminaire(&source, &wall).value(), 25.0, max_relative = 1e-12);
    assert_eq!(from_luminaire(&source, &facing_up(0.0, 0.0, -2.0)), Lux(0.0));
}

#[test]
fn obstacles_hide_luminaires_only_when_they_stand_between() {
    let between = Shape::Box { min_m: DVec3::new(-0.5, -0.5, -1.2), max_m: DVec3::new(0.5, 0.5, -1.0) };
    let beside = Shape::Box { min_m: DVec3::new(0.1, 0.1, -1.2), max_m: DVec3::new(0.5, 0.5, -1.0) };
    let beneath = Shape::Box { min_m: DVec3::new(-0.5, -0.5, -3.0), max_m: DVec3::new(0.5, 0.5, -2.0) };
    let triangle = Shape::Mesh {
        vertices_m: vec![DVec3::new(-1.0, -1.0, -1.0), DVec3::new(1.0, -1.0, -1.0), DVec3::new(0.0, 2.0, -1.0)],
        triangles: vec![[0, 1, 2]],
    };
    assert_eq!(lux_behind(&between, 0.0), 0.0);
    assert_eq!(lux_behind(&triangle, 0.0), 0.0);
    for open in [lux_behind(&beside, 0.0), lux_behind(&beneath, 0.0)] {
        assert_relative_eq!(open, 25.0, max_relative = 1e-14);
    }
    assert!(lux_behind(&triangle, 3.0) > 0.0 && lux_behind(&between, 1.5) > 0.0);
}

#[test]
fn a_triangle_hides_half_of_its_parallelogram() {
    // The segment to the meter passes the plane of the triangle at x = .5, y = 0.
    let triangle_of = |corners: [[f64; 2]; 3]| Shape::Mesh {
        vertices_m: corners.map(|[x, y]| DVec3::new(x, y, -1.0)).to_vec(),
        triangles: vec![[0, 1, 2]],
    };
    for (corners, is_hidden) in [
        // Point (.5, 0) has the coordinates u = v = .4 and then .6 along the edges from the first corner.
        ([[-0.3, 0.0], [0.7, 1.0], [0.7, -1.0]], true),
        ([[-0.7, 0.0], [0.3, 1.0], [0.3, -1.0]], false),
        // Just inside and outside of the other two edges.
        ([[0.0, -0.01], [1.0, -0.01], [0.5, 1.0]], true),
        ([[0.0, 0.01], [1.0, 0.01], [0.5, 1.0]], false),
    ] {
        assert_eq!(lux_behind(&triangle_of(corners), 1.0) == 0.0, is_hidden, "{corners:?}");
    }
}

#[test]
fn the_luminaire_that_is_nearest_for_its_size_decides_the_validity() {
    let square = |side_m| LuminousOpening::Box { x_m: side_m, y_m: side_m, height_m: 0.0 };
    // Both are 3 m above the meter: 15 sizes of the small one, 4 of the large one.
    let [small, large] = [0.2, 0.75].map(|side_m| luminaire(isotropic(), square(side_m), LuminaireModel::Area));
    for luminaires in [[small.clone(), large.clone()], [large, small.clone()]] {
        let scene = Scene { luminaires: luminaires.to_vec(), ..Scene::default() };
        let Validity::No(reason) = Validity::of(&direct_illuminance(&scene, &facing_up(0.0, 0.0, -3.0))) else {
            panic!("applies")
        };
        assert!(reason.contains("4.00 times"), "{reason}");
    }
    let scene = Scene { luminaires: vec![small.clone(), small], ..Scene::default() };
    assert!(matches!(Validity::of(&direct_illuminance(&scene, &facing_up(0.0, 0.0, -3.0))), Validity::Approximate(_)));
}

#[test]
fn the_longest_extent_counts_whichever_way_it_lies() {
    // The height of a suspended luminaire is a luminous dimension, too.
    for (longest, [x_m, y_m, height_m]) in [(0.9, [0.9, 0.2, 0.1]), (0.8, [0.1, 0.8, 0.2]), (0.7, [0.2, 0.1, 0.7])] {
        let cylinder = LuminousOpening::Ellipse { x_m, y_m, height_m };
        let ellipsoid = LuminousOpening::Ellipsoid { x_m, y_m, z_m: height_m };
        for opening in [LuminousOpening::Box { x_m, y_m, height_m }, cylinder, ellipsoid] {
            assert_eq!(largest_dimension_m(&opening), longest, "{opening:?}");
        }
    }
    let axis = luxproof_photometry::HorizontalAxis::X;
    for (longest, [length_m, diameter_m]) in [(1.2, [1.2, 0.1]), (0.3, [0.2, 0.3])] {
        let lying = LuminousOpening::LyingCylinder { axis, length_m, diameter_m };
        assert_eq!(largest_dimension_m(&lying), longest, "{lying:?}");
    }
}

/// The illuminance 2 m below an isotropic luminaire and `x` meters to its side, with one obstacle in the scene.
fn lux_behind(shape: &Shape, x: f64) -> f64 {
    let source = luminaire(isotropic(), LuminousOpening::Point, LuminaireModel::Point);
    let obstacle = Obstacle { shape: shape.clone(), reflectance: 0.5 };
    let scene = Scene { obstacles: vec![obstacle], luminaires: vec![source], ..Scene::default() };
    direct_illuminance(&scene, &facing_up(x, 0.0, -2.0)).unwrap().illuminance.value()
}

#[test]
fn a_meter_at_the_photometric_centre_is_refused() {
    let source = luminaire(isotropic(), LuminousOpening::Point, LuminaireModel::Point);
    let scene = Scene { luminaires: vec![source], ..Scene::default() };
    let refused = direct_illuminance(&scene, &facing_up(0.0, 0.0, 0.0));
    assert!(matches!(Validity::of(&refused), Validity::No(_)));
}

#[test]
fn cylindrical_illuminance_is_the_mean_over_vertical_directions() {
    const DIRECTIONS: u32 = 100_000;
    let mut source = luminaire(isotropic(), LuminousOpening::Point, LuminaireModel::Point);
    source.flux_scale = 0.7;
    let mut other = source.clone();
    other.position_m = DVec3::new(3.0, -1.0, 0.5);
    let scene = Scene { luminaires: vec![source, other], ..Scene::default() };
    for position_m in [DVec3::new(1.0, 0.5, -2.0), DVec3::new(-2.0, 4.0, 1.0), DVec3::new(0.0, 0.0, -2.0)] {
        let mut sum = 0.0;
        for k in 0..DIRECTIONS {
            let azimuth = 2.0 * PI * f64::from(k) / f64::from(DIRECTIONS);
            let meter = Meter { position_m, normal: DVec3::new(azimuth.cos(), azimuth.sin(), 0.0) };
            sum += scene.luminaires.iter().map(|l| from_luminaire(l, &meter).value()).sum::<f64>();
        }
        let mean = sum / f64::from(DIRECTIONS);
        assert_relative_eq!(cylindrical_illuminance(&scene, position_m).value(), mean, max_relative = 1e-9);
    }
}

/// Two points of light and three places.
fn two_points() -> Scene {
    let source = luminaire(isotropic(), LuminousOpening::Point, LuminaireModel::Point);
    let mut other = source.clone();
    (other.position_m, other.flux_scale) = (DVec3::new(3.0, -1.0, 0.5), 0.7);
    Scene { luminaires: vec![source, other], ..Scene::default() }
}

/// The illuminance of a surface by a scene's luminaires.
fn lux_facing(scene: &Scene, position_m: DVec3, normal: DVec3) -> f64 {
    scene.luminaires.iter().map(|l| from_luminaire(l, &Meter { position_m, normal }).value()).sum()
}

#[test]
fn semicylindrical_illuminance_is_the_mean_over_its_half_circle() {
    const DIRECTIONS: u32 = 100_000;
    let scene = two_points();
    let normal = DVec3::new(0.6, 0.8, 0.0);
    for position_m in [DVec3::new(1.0, 0.5, -2.0), DVec3::new(-2.0, 4.0, 1.0)] {
        let turns = (0..DIRECTIONS).map(|k| PI * ((f64::from(k) + 0.5) / f64::from(DIRECTIONS) - 0.5));
        let sum: f64 =
            turns.map(|turn| lux_facing(&scene, position_m, glam::DMat3::from_rotation_z(turn) * normal)).sum();
        let found = semicylindrical_illuminance(&scene, &Meter { position_m, normal }).value();
        assert_relative_eq!(found, sum / f64::from(DIRECTIONS), max_relative = 1e-8);
    }
}

#[test]
fn hemispherical_and_spherical_illuminance_are_the_means_over_their_surfaces() {
    const HEIGHTS: u32 = 2000;
    let scene = two_points();
    let position_m = DVec3::new(1.0, 0.5, -2.0);
    // Equal areas: even steps of height, and a golden angle about the axis.
    let normals = (0..HEIGHTS * 100).map(|k| {
        let z = 1.0 - (2.0 * f64::from(k) + 1.0) / f64::from(HEIGHTS * 100);
        let azimuth = PI * (3.0 - 5f64.sqrt()) * f64::from(k);
        DVec3::new(azimuth.cos() * (1.0 - z * z).sqrt(), azimuth.sin() * (1.0 - z * z).sqrt(), z)
    });
    let lux: Vec<(f64, f64)> = normals.map(|n| (n.z, lux_facing(&scene, position_m, n))).collect();
    let sphere = lux.iter().map(|(_, lux)| lux).sum::<f64>() / lux.len() as f64;
    let above: Vec<f64> = lux.iter().filter(|(z, _)| *z > 0.0).map(|(_, lux)| *lux).collect();
    let hemisphere = above.iter().sum::<f64>() / above.len() as f64;
    assert_relative_eq!(spherical_illuminance(&scene, position_m).value(), sphere, max_relative = 1e-4);
    let found = hemispherical_illuminance(&scene, &Meter { position_m, normal: DVec3::Z }).value();
    assert_relative_eq!(found, hemisphere, max_relative = 1e-4);
}

/// The jump in candela of a luminaire at half its flux, seen from a place.
fn jump_cd(distribution: &LuminousIntensityDistribution, at: DVec3) -> f64 {
    let mut source = luminaire(distribution.clone(), LuminousOpening::Point, LuminaireModel::Point);
    source.flux_scale = 0.5;
    let meter = Meter { position_m: at, normal: -at.normalize() };
    let scene = Scene { luminaires: vec![source], ..Scene::default() };
    jump(&scene, &meter).value() * at.length_squared()
}

#[test]
fn where_rounding_decides_between_two_values_the_jump_is_their_distance() {
    let ends_bright = LuminousIntensityDistribution::axial(vec![10.0, 90.0], vec![200.0, 300.0]).unwrap();
    let torn = LuminousIntensityDistribution::new(
        vec![0.0, 90.0],
        vec![0.0, 90.0, 180.0],
        vec![100.0, 40.0, 0.0, 160.0, 40.0, 0.0],
    )
    .unwrap();
    let (below, level) = (DVec3::new(0.0, 0.0, -2.0), DVec3::new(0.0, 2.0, 0.0));
    let at_the_first = DVec3::new(0.0, 10f64.to_radians().sin(), -10f64.to_radians().cos());
    assert_relative_eq!(jump_cd(&ends_bright, level), 150.0, max_relative = 1e-12);
    assert_relative_eq!(jump_cd(&ends_bright, at_the_first), 100.0, max_relative = 1e-6);
    for at in [below, DVec3::new(0.0, 2.0, 1e-6), DVec3::new(0.0, 2.0, -1e-6)] {
        assert_eq!(jump_cd(&ends_bright, at), 0.0, "{at}");
    }
    assert_relative_eq!(jump_cd(&torn, below), 30.0, max_relative = 1e-12);
    assert_eq!([jump_cd(&torn, -below), jump_cd(&torn, level)], [0.0; 2]);
}

#[test]
fn an_opening_that_is_cut_seen_edge_on_or_not_flat_has_no_lambertian_twin() {
    let square = LuminousOpening::Box { x_m: 1.0, y_m: 1.0, height_m: 0.0 };
    let panel = luminaire(isotropic(), square, LuminaireModel::Area);
    let below = DVec3::new(0.0, 0.0, -10.0);
    assert!(lambertian_twin(&panel, &Meter { position_m: below, normal: DVec3::Z }).is_some());
    // The meter's plane passes through the panel: the corners at +x are before it, the others behind it.
    let aside = Meter { position_m: below, normal: DVec3::new(1.0, 0.0, 0.02).normalize() };
    assert_eq!(lambertian_twin(&panel, &aside), None);
    let level = Meter { position_m: DVec3::new(10.0, 0.0, 0.0), normal: DVec3::NEG_X };
    assert_eq!(lambertian_twin(&panel, &level), None);
    let high = LuminousOpening::Box { x_m: 1.0, y_m: 1.0, height_m: 0.1 };
    let body = luminaire(isotropic(), high, LuminaireModel::Area);
    assert_eq!(lambertian_twin(&body, &Meter { position_m: below, normal: DVec3::Z }), None);
    // Without a twin the text gives the largest error of a square, 2 / 3 over the squared distance in sizes.
    let scene = Scene { luminaires: vec![body], ..Scene::default() };
    let found = Validity::of(&direct_illuminance(&scene, &facing_up(0.0, 0.0, -10.0)));
    let Validity::Approximate(why) = found else { panic!("{found:?}") };
    assert!(why.contains("10.00 times") && why.contains("up to about 0.67 %"), "{why}");
}

#[test]
fn the_five_times_rule_holds_at_five_times() {
    let square = LuminousOpening::Box { x_m: 0.5, y_m: 0.25, height_m: 0.0 };
    let panel = luminaire(isotropic(), square, LuminaireModel::Area);
    let rules = [-2.5, -2.499].map(|z| FiveTimesRule::check(&panel, &facing_up(0.0, 0.0, z)));
    assert_eq!((rules[0].distance_over_size, rules.map(|rule| rule.holds())), (5.0, [true, false]));
    let point = luminaire(isotropic(), LuminousOpening::Point, LuminaireModel::Area);
    let scene = Scene { luminaires: vec![point], ..Scene::default() };
    assert_eq!(direct_illuminance(&scene, &facing_up(0.0, 0.0, -1.0)).unwrap().validity, Validity::Supported);
}

/// Whether a box cuts the segment from the origin.
fn is_cut(min_m: [f64; 3], max_m: [f64; 3], to_m: [f64; 3]) -> bool {
    let shape = Shape::Box { min_m: DVec3::from(min_m), max_m: DVec3::from(max_m) };
    blocks(&Obstacle { shape, reflectance: 0.5 }, DVec3::ZERO, DVec3::from(to_m))
}

#[test]
fn a_box_cuts_a_segment_that_passes_its_inside_and_none_that_touches_it() {
    let down = [0.0, 0.0, -2.0];
    assert!(is_cut([-1.0, -1.0, -1.5], [1.0, 1.0, -1.0], down));
    // The segment lies in a face, ends on one, begins on one.
    assert!(!is_cut([0.0, -1.0, -1.5], [1.0, 1.0, -1.0], down));
    assert!(!is_cut([-1.0, -1.0, -1.5], [0.0, 1.0, -1.0], down));
    assert!(!is_cut([-1.0, -1.0, -3.0], [1.0, 1.0, -2.0], down));
    assert!(!is_cut([-1.0, -1.0, 0.0], [1.0, 1.0, 1.0], down));
    assert!(is_cut([-1.0, -1.0, -0.5], [1.0, 1.0, 0.5], down));
    // A slanted one passes beside a box that it passes in each coordinate by itself.
    let slanted = [2.0, 2.0, 1.0];
    assert!(!is_cut([0.2, 1.0, 0.0], [0.4, 1.2, 1.0], slanted));
    assert!(is_cut([0.2, 0.3, 0.0], [0.4, 1.2, 1.0], slanted));
    assert!(!is_cut([0.2, 0.3, 0.2], [0.4, 1.2, 1.0], slanted));
}
