use glam::DVec3;
use luxproof_scene::{Bounces, Transport, orientation};

use super::{Against, all, error_of_mean, find};
use luxproof_engines::Job;
use luxproof_engines::fixtures::{CONVERGED, lopsided, luminaire, s1, simulated_lx};

fn exact(job: &Job) -> Vec<f64> {
    simulated_lx(job, 1e-4)
}

/// A lopsided luminaire off the middle of a room of no symmetry.
fn awkward(transport: Transport) -> Job {
    let mut job = s1(transport);
    let room = job.scene.room.as_mut().unwrap();
    room.size_m = glam::DVec3::new(20.0, 18.5, 19.0);
    room.reflectance.wall_x_max = 0.3;
    room.reflectance.wall_y_min = 0.7;
    let mut lamp = luminaire("lopsided", glam::DVec3::new(7.0, 11.0, 9.5), lopsided());
    lamp.orientation = luxproof_scene::orientation(20.0, 35.0, 50.0);
    job.scene.luminaires = vec![lamp];
    job
}

fn holds(id: &str, magnitude: f64, base: &Job, within: f64) {
    let variant = (find(id).unwrap().variant)(base, magnitude).unwrap();
    let (read, before) = (exact(&variant.job), exact(base));
    let right: Vec<f64> = match variant.against {
        Against::Base(factor) => before.iter().map(|x| factor * x).collect(),
        Against::Sum(parts) => {
            let parts: Vec<Vec<f64>> = parts.iter().map(exact).collect();
            (0..read.len()).map(|k| parts.iter().map(|p| p[k]).sum()).collect()
        }
        Against::Known(known) => known,
        Against::Mean { .. } | Against::Witness => panic!("{id} has no value at each sensor"),
    };
    for (a, b) in read.iter().zip(&right) {
        assert!((a - b).abs() <= within * b.max(1e-12), "{id} at {magnitude}: {a} for {b}");
    }
}

#[test]
fn similar_scenes_read_alike_whatever_the_luminaire_and_the_walls() {
    for transport in [Transport::Direct, CONVERGED] {
        let (job, within) = (awkward(transport), if transport == Transport::Direct { 1e-9 } else { 3e-4 });
        for (law, magnitude) in [
            ("scale_up", 10.0),
            ("scale_down", 1e-3),
            ("turned_room", 1.0),
            ("turned_room", 3.0),
            ("room_on_its_side", 1.0),
            ("room_on_its_side", 2.0),
            ("turned_luminaire", 45.0),
            ("mirror", 1.0),
            ("mirror", 2.0),
            ("mirror", 3.0),
            ("flux_up", 1e9),
            ("superposition", 2.0),
            ("fine_table", 1.0),
        ] {
            holds(law, magnitude, &job, within);
        }
    }
    // Of openings what is integrated is, as asked.
    holds("mixed_luminaires", 2.0, &awkward(CONVERGED), 3e-4);
    holds("mixed_luminaires", 6.0, &awkward(Transport::Direct), 3e-4);
    holds("translation", 1e3, &awkward(Transport::Direct), 1e-9);
    holds("meter_near_luminaire", 1e-3, &awkward(Transport::Direct), 1e-9);
    holds("needle_beam", 0.1, &awkward(Transport::Direct), 1e-9);
    holds("one_gamma", 1e-3, &awkward(Transport::Direct), 1e-9);
    holds("dark", 0.0, &awkward(CONVERGED), 1e-9);
}

#[test]
fn a_furnace_gives_back_all_light_to_the_quadrature_stated() {
    let few = |n| Transport::Indirect(Bounces::AtMost(n));
    for (law, magnitude, transport) in [
        ("reflectance", 0.5, CONVERGED),
        ("reflectance", 0.5, few(1)),
        ("reflectance", 0.5, few(2)),
        ("reflectance", 0.9, CONVERGED),
        ("reflectance", 0.9, few(3)),
        ("reflectance", 0.999, CONVERGED),
        ("near_ceiling", 1e-3, CONVERGED),
        ("near_ceiling", 1e-3, few(2)),
        ("needle_beam", 1.0, CONVERGED),
        ("one_gamma", 1.0, CONVERGED),
        ("many_luminaires", 1.0, CONVERGED),
    ] {
        let variant = (find(law).unwrap().variant)(&s1(transport), magnitude).unwrap();
        let Against::Mean { weights, value_lx } = variant.against else { panic!("{law}") };
        let quadrature = error_of_mean(&variant.job, &weights);
        assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-9);
        let mean: f64 = exact(&variant.job).iter().zip(&weights).map(|(x, w)| x * w).sum();
        println!("{law} {magnitude} {transport:?}: {:e}", mean / value_lx - 1.0);
        assert!((mean / value_lx - 1.0).abs() < quadrature, "{law} {magnitude}: {mean} for {value_lx}");
    }
}

/// Rooms as hunts draw them: long, flat, with light of any table near any surface.
#[test]
fn the_quadrature_of_a_furnace_is_what_is_stated_in_rooms_of_all_kinds() {
    let mut rng = fastrand::Rng::with_seed(4711);
    let mut within = |low: f64, high: f64| low + (high - low) * rng.f64();
    for k in 0..6 {
        let mut job = s1(Transport::Indirect(if k % 2 == 0 { Bounces::AtMost(1) } else { Bounces::Converged }));
        let size_m = DVec3::new(within(2.5, 12.0), within(2.5, 9.0), within(1.0, 5.0));
        job.scene.room.as_mut().unwrap().size_m = size_m;
        let luminaire = &mut job.scene.luminaires[0];
        luminaire.position_m = size_m * DVec3::new(within(0.1, 0.9), within(0.1, 0.9), within(0.3, 0.95));
        luminaire.orientation = orientation(within(0.0, 360.0), within(0.0, 180.0), 0.0);
        let variant = (find("reflectance").unwrap().variant)(&job, [0.5, 0.9, 0.98][k / 2 % 3]).unwrap();
        let Against::Mean { weights, value_lx } = variant.against else { panic!() };
        let quadrature = error_of_mean(&variant.job, &weights);
        let mean: f64 = simulated_lx(&variant.job, 1e-3).iter().zip(&weights).map(|(x, w)| x * w).sum();
        let off = (mean / value_lx - 1.0).abs();
        println!("{size_m} {}: {off:.2e} of {quadrature:.2e}", variant.job.scene.luminaires[0].position_m);
        assert!(off < quadrature, "{size_m}: {off:e} {quadrature:e}");
    }
}

#[test]
fn every_law_has_a_name_of_its_own_and_says_something_of_the_plain_case() {
    for (k, law) in all().enumerate() {
        assert!(all().take(k).all(|l| l.id != law.id), "{}", law.id);
        let says = [Transport::Direct, CONVERGED].iter().any(|&transport| {
            law.light.concerns(transport) && law.magnitudes.iter().all(|m| (law.variant)(&s1(transport), *m).is_some())
        });
        assert!(says, "{}", law.id);
    }
}
