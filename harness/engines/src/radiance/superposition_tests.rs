//! Openings hide nothing, whatever rtrace makes of one illum before another.

use glam::DVec3;
use luxproof_photometry::{LuminousIntensityDistribution, LuminousOpening};
use luxproof_scene::{Bounces, Luminaire, Scene, Transport, orientation};

use super::superposition::scenes;
use super::tests::read;
use super::*;
use crate::fixtures::*;

const PANEL: LuminousOpening = LuminousOpening::Box { x_m: 0.6, y_m: 0.6, height_m: 0.0 };
const LARGE_PANEL: LuminousOpening = LuminousOpening::Box { x_m: 1.2, y_m: 1.2, height_m: 0.0 };

fn lamp(at_m: [f64; 3], opening: LuminousOpening) -> Luminaire {
    with_opening(luminaire("lamp", DVec3::from_array(at_m), lambertian()), opening)
}

fn of(luminaires: Vec<Luminaire>, points_m: &[[f64; 3]], transport: Transport) -> Job {
    let room = (transport != Transport::Direct).then(|| room(DVec3::new(4.0, 4.0, 3.0), 0.5, 0.5, 0.5));
    within(1e-3, job(Scene { room, luminaires, obstacles: vec![] }, sensors(points_m, DVec3::Z), transport))
}

fn grouped(luminaires: Vec<Luminaire>, points_m: &[[f64; 3]], transport: Transport) -> Vec<Vec<usize>> {
    let job = of(luminaires, points_m, transport);
    scenes(&job, &Settings::of(&job).unwrap())
}

#[test]
fn luminaires_are_read_apart_only_where_one_may_hide_another() {
    let (direct, reflected) = (Transport::Direct, CONVERGED);
    let meter = [[2.0, 2.0, 0.5]];
    // A ceiling of panels hides nothing, from wherever it is seen, nor does what is beside another one as seen from every meter.
    let ceiling: Vec<Luminaire> = (0..3).map(|k| lamp([0.8 + f64::from(k), 2.0, 2.9], PANEL)).collect();
    assert_eq!(grouped(ceiling.clone(), &meter, reflected), [vec![0, 1, 2]]);
    let beside = vec![lamp([1.0, 1.0, 2.9], PANEL), lamp([3.0, 3.0, 2.0], PANEL)];
    assert_eq!(grouped(beside.clone(), &meter, direct), [vec![0, 1]]);
    assert_eq!(grouped(beside, &meter, reflected), [vec![0], vec![1]]);
    // One below others is read apart, whatever comes first in the file, and points with any of them.
    let below = lamp([1.8, 2.0, 2.0], LARGE_PANEL);
    let all = [ceiling.clone(), vec![below.clone()], vec![luminaire("point", DVec3::new(2.0, 2.0, 2.5), lambertian())]];
    assert_eq!(grouped(all.concat(), &meter, direct), [vec![0, 1, 2, 4], vec![3]]);
    assert_eq!(grouped([vec![below.clone()], ceiling.clone()].concat(), &meter, direct), [vec![0], vec![1, 2, 3]]);
    // Nothing lies behind what shines up only, and what is seen from behind lets light pass.
    let mut up = below;
    up.orientation = orientation(0.0, 180.0, 0.0);
    assert_eq!(grouped([vec![up], ceiling].concat(), &meter, direct), [vec![0, 1, 2, 3]]);
    // A body hides in every direction.
    let cube = LuminousOpening::Box { x_m: 0.3, y_m: 0.3, height_m: 0.3 };
    assert_eq!(grouped(vec![lamp([2.0, 2.0, 2.0], cube), lamp([2.0, 2.0, 1.5], PANEL)], &meter, direct).len(), 2);
    assert_eq!(grouped(vec![], &meter, direct), [Vec::<usize>::new()]);
}

#[test]
fn light_of_another_opening_passes_through_an_opening() {
    let openings = [
        LARGE_PANEL,
        LuminousOpening::Box { x_m: 0.5, y_m: 0.5, height_m: 0.2 },
        LuminousOpening::Ellipse { x_m: 0.2, y_m: 0.2, height_m: 0.6 },
        LuminousOpening::Ellipsoid { x_m: 0.4, y_m: 0.4, z_m: 0.4 },
    ];
    let meters = [[0.1, 0.0, -2.0], [0.6, 0.3, -1.5], [3.0, 0.0, -2.0]];
    for opening in openings {
        let (below, above) = (lamp([0.0; 3], opening), lamp([-0.1, 0.0, 0.7], PANEL));
        let scenes = [vec![below.clone(), above.clone()], vec![below], vec![above]];
        let [both, first, second] =
            scenes.map(|luminaires| read(&of(luminaires, &meters, Transport::Direct)).estimates);
        let alone = [first, second];
        for (k, both) in both.iter().enumerate() {
            let sum = alone[0][k].plus(&alone[1][k]);
            let error = |e: &Estimate| e.uncertainty.standard_error().unwrap() + e.uncertainty.bound();
            let off = (both.value - sum.value).abs();
            assert!(off < 5.0 * (error(both) + error(&sum)), "{opening:?} {k}: {both:?} for {sum:?}");
            assert!(error(both) < 5e-3 * both.value && alone[1][k].value > 0.1 * both.value, "{both:?} {alone:?}");
        }
    }
}

#[test]
fn points_in_one_spot_and_angles_and_candela_that_single_precision_can_hardly_tell_are_read() {
    let spiked = [(0.0, 100.0), (60.0, 80.0), (90.0, 6.63e-62), (90.000_000_1, 0.0), (180.0, 0.0)];
    let (gamma_deg, candela) = spiked.into_iter().unzip();
    let table = LuminousIntensityDistribution::axial(gamma_deg, candela).unwrap();
    let lamp = luminaire("lamp", DVec3::ZERO, table);
    let job = of(vec![lamp.clone(), Luminaire { id: "other".into(), ..lamp }], &[[0.3, 0.2, -2.0]], Transport::Direct);
    let (found, right) = (read(&job).estimates[0], exact_direct_lx(&job)[0]);
    assert!((found.value - right).abs() < 1e-4 * right, "{found:?} for {right}");
}

#[test]
fn no_reflected_light_is_lost_either_nor_what_the_file_order_has_to_do_with_it() {
    let (below, above) = (lamp([2.0, 2.0, 1.5], LARGE_PANEL), lamp([2.0, 2.0, 2.8], PANEL));
    let of_first = Transport::Indirect(Bounces::AtMost(1));
    let value = |luminaires: Vec<Luminaire>| read(&of(luminaires, &[[0.5, 0.5, 0.2]], of_first)).estimates[0];
    let alone = value(vec![below.clone()]).plus(&value(vec![above.clone()]));
    for both in [value(vec![below.clone(), above.clone()]), value(vec![above, below])] {
        let error = |e: &Estimate| e.uncertainty.standard_error().unwrap() + e.uncertainty.bound();
        let (off, errors) = ((both.value - alone.value).abs(), error(&both) + error(&alone));
        assert!(off < 5.0 * errors && errors < 0.01 * both.value, "{both:?} for {alone:?}");
    }
}

#[test]
fn the_files_of_scenes_that_add_up_are_these() {
    let even = LuminousIntensityDistribution::axial(vec![0.0, 90.0], vec![100.0, 100.0]).unwrap();
    let panel = |z| with_opening(luminaire("lamp", DVec3::new(2.0, 2.0, z), even.clone()), PANEL);
    let job = of(vec![panel(2.8), panel(2.0)], &[[2.0, 2.0, 0.5]], CONVERGED);
    let files = Radiance.export(&job).unwrap();
    let text = |name: &str| String::from_utf8_lossy(&files.iter().find(|f| f.name == name).unwrap().bytes).into_owned();
    assert!(!text("scene.rad").contains("luminaire") && text("reflected-2.rad").contains("luminaire-1 polygon"));
    assert!(!text("reflected-1.rad").contains("luminaire-1 "));
    insta::assert_snapshot!(text("run.sh"));
}
