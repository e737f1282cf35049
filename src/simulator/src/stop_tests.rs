//! Whatever solves a scene, it may be stopped anywhere: what it then says holds, and what it says next time is as if nothing had been.

use std::sync::atomic::{AtomicBool, AtomicI64};

use glam::DVec3;

use super::path_tracing::test_scenes::{luminaire, s1, s1_meters, s2, s2_meters};
use super::{Accuracy, Limit, Prepared, Solution, Stop, Uncertainty};
use luxproof_photometry::{LuminousIntensityDistribution, LuminousOpening};
use luxproof_scene::{Bounces, Meter, Scene, Transport};

/// Numbers of looks after which it is time.
const LOOKS: [i64; 5] = [0, 1, 30, 1000, 30_000];

/// S2 with points in place of its panels, and with balls, which boxes cannot be cut out of.
fn s2_lit_by(opening: LuminousOpening) -> Scene {
    let gamma_deg: Vec<f64> = (0..=18).map(|k| 10.0 * f64::from(k)).collect();
    let candela = vec![800.0; gamma_deg.len()];
    let even = LuminousIntensityDistribution::axial(gamma_deg, candela).unwrap();
    let mut scene = s2();
    for lamp in &mut scene.luminaires {
        *lamp = luminaire(even.clone(), opening, lamp.position_m - 0.5 * DVec3::Z);
    }
    scene
}

/// Values with how far off they may be: a bound, or what the t-interval of 15 degrees of freedom passes once in 10,000 times.
fn bounds(solution: &Solution) -> Vec<[f64; 2]> {
    let bound = |u| match u {
        Uncertainty::Bound(bound) => bound,
        Uncertainty::StandardError { value, .. } => 5.2 * value,
    };
    solution.estimates.iter().map(|e| [e.illuminance.value(), bound(e.uncertainty)]).collect()
}

/// Each reading that was stopped lies within its bound of the one that was not, which the same scene gives afterwards.
fn holds_wherever_it_stops(scene: &Scene, meters: &[Meter], transport: Transport, relative_error: f64) {
    let accuracy = Accuracy { relative_error, seed: 5 };
    let whole = bounds(&Prepared::new(scene, transport, &accuracy).unwrap().illuminance(meters).unwrap());
    let mut narrowest = f64::INFINITY;
    for looks in LOOKS {
        let left: &'static AtomicI64 = Box::leak(Box::new(AtomicI64::new(looks)));
        let mut prepared = Prepared::new(scene, transport, &accuracy).unwrap();
        let found = prepared.illuminance_until(meters, &Stop { looks: Some(left), ..Stop::NEVER }).unwrap();
        let is_stopped = left.load(std::sync::atomic::Ordering::Relaxed) <= 0;
        assert_eq!(is_stopped, found.limit == Some(Limit::Time), "{found:?}");
        let found = bounds(&found);
        for ([value, bound], [truth, off]) in found.iter().zip(&whole) {
            assert!((value - truth).abs() <= bound + off, "{looks} looks: {value} +- {bound} for {truth} +- {off}");
        }
        let widest = found.iter().map(|[_, bound]| *bound).fold(0.0, f64::max);
        narrowest = narrowest.min(widest);
        assert!(looks > 0 || widest > 0.0);
        if looks != LOOKS[3] {
            continue;
        }
        let again = bounds(&prepared.illuminance(meters).unwrap());
        for ([value, bound], [truth, off]) in again.iter().zip(&whole) {
            assert!((value - truth).abs() <= bound + off && bound.is_finite(), "{looks} looks before");
        }
    }
    assert!(narrowest.is_finite());
}

#[test]
fn collocation_may_be_stopped_anywhere() {
    for bounces in [Bounces::Converged, Bounces::AtMost(1_000_000)] {
        holds_wherever_it_stops(&s1(), &s1_meters(), Transport::Total(bounces), 1e-6);
    }
}

#[test]
fn light_of_points_between_bodies_may_be_stopped_anywhere() {
    let scene = s2_lit_by(LuminousOpening::Point);
    holds_wherever_it_stops(&scene, &s2_meters()[..2], Transport::Indirect(Bounces::AtMost(1)), 1e-2);
}

#[test]
fn reflected_and_direct_light_may_be_stopped_anywhere() {
    holds_wherever_it_stops(&s2(), &s2_meters()[..2], Transport::Total(Bounces::Converged), 0.01);
}

#[test]
fn sampled_openings_may_be_stopped_anywhere() {
    let ball = LuminousOpening::Ellipsoid { x_m: 0.3, y_m: 0.3, z_m: 0.3 };
    holds_wherever_it_stops(&s2_lit_by(ball), &s2_meters()[..2], Transport::Total(Bounces::AtMost(3)), 0.1);
}

#[test]
fn the_ray_limit_changes_nothing_but_the_error_and_the_same_seed_gives_the_same_bytes() {
    let accuracy = Accuracy { relative_error: 1e-4, seed: 5 };
    let stop = Stop { rays: Some(1_000_000), ..Stop::NEVER };
    let on_threads = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let mut prepared = Prepared::new(&s2(), Transport::Total(Bounces::Converged), &accuracy).unwrap();
        pool.install(|| prepared.illuminance_until(&s2_meters(), &stop)).unwrap()
    };
    let [one, three] = [1, 3].map(on_threads);
    assert_eq!(one.limit, Some(Limit::Rays));
    assert_eq!((one.estimates, one.replicates, one.solver), (three.estimates, three.replicates, three.solver));
}

#[test]
fn a_raised_flag_leaves_what_luminaires_can_give_at_most() {
    static RAISED: AtomicBool = AtomicBool::new(true);
    let stop = Stop { flag: Some(&RAISED), ..Stop::NEVER };
    let accuracy = Accuracy { relative_error: 1e-3, seed: 5 };
    let mut prepared = Prepared::new(&s2(), Transport::Total(Bounces::Converged), &accuracy).unwrap();
    let found = prepared.illuminance_until(&s2_meters(), &stop).unwrap();
    assert!(found.solver.contains("stopped: of 6 of 6 meters"), "{}", found.solver);
    assert!(bounds(&found).iter().all(|[value, bound]| bound == value && *value > 0.0));
}
