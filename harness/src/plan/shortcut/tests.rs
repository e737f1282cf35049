//! Laws of shortcuts: what they leave out is what the exact simulation says it is, and what is not symmetric is left alone.

use glam::DVec3;
use luminaire::photometry::LuminousOpening;
use luminaire::scene::{Bounces, Luminaire, LuminaireModel, Obstacle, Scene, Shape, Transport, flush, orientation};
use luminaire::simulator::{Accuracy, illuminance};

use super::*;
use crate::engines::fixtures;
use crate::record::Uncertainty;

const CONVERGED: Transport = Transport::Indirect(Bounces::Converged);

fn grid(size_m: DVec3, z_m: f64) -> Vec<[f64; 3]> {
    let at = |k: usize, size: f64| (k as f64 + 0.5) / 4.0 * size;
    (0..4).flat_map(|i| (0..4).map(move |j| [at(i, size_m.x), at(j, size_m.y), z_m])).collect()
}

fn symmetric_job(size_m: DVec3, transport: Transport) -> Job {
    let lamp = fixtures::luminaire("lamp", size_m * DVec3::new(0.5, 0.5, 0.8), fixtures::quadrant());
    let room = Some(fixtures::room(size_m, 0.2, 0.5, 0.7));
    let stations = fixtures::stations(&grid(size_m, 0.8), DVec3::Z);
    fixtures::job(Scene { room, obstacles: vec![], luminaires: vec![lamp] }, stations, transport)
}

fn exact(job: &Job) -> Measurement {
    let meters: Vec<_> = job.stations.iter().map(|s| s.meter).collect();
    let accuracy = Accuracy { relative_error: 1e-6, seed: 1 };
    let solution = illuminance(&job.scene, &meters, job.transport, &accuracy).unwrap();
    let estimate = |e: &luminaire::simulator::Estimate| Estimate {
        value: e.illuminance.value(),
        uncertainty: Uncertainty::Unstated,
    };
    Measurement { estimates: solution.estimates.iter().map(estimate).collect(), ..Measurement::default() }
}

/// What a shortcut completes agrees with what the whole job reads.
#[track_caller]
fn holds(job: &Job) -> Shortcut {
    let shortcut = Shortcut::of(job);
    let whole = exact(job);
    let rendered = if shortcut.job.stations.is_empty() { Measurement::default() } else { exact(&shortcut.job) };
    let completed = shortcut.complete(rendered, job);
    let brightest = whole.estimates.iter().map(|e| e.value).fold(0.0, f64::max);
    assert_eq!(completed.estimates.len(), job.stations.len());
    for ((c, w), s) in completed.estimates.iter().zip(&whole.estimates).zip(&job.stations) {
        assert!((c.value - w.value).abs() <= 1e-5 * brightest, "{}: {} for {}", s.id, c.value, w.value);
    }
    shortcut
}

#[test]
fn of_an_oblong_room_a_quarter_is_rendered_and_of_a_square_one_with_an_axial_lamp_an_eighth() {
    let oblong = symmetric_job(DVec3::new(6.0, 4.0, 3.0), CONVERGED);
    assert_eq!(holds(&oblong).job.stations.len(), 4);
    let mut square = symmetric_job(DVec3::new(5.0, 5.0, 3.0), CONVERGED);
    // The lamp's planes are not exchanged with the axes.
    assert_eq!(holds(&square).job.stations.len(), 4);
    let table =
        luminaire::photometry::LuminousIntensityDistribution::axial(vec![0.0, 60.0, 90.0], vec![900.0, 400.0, 0.0]);
    square.scene.luminaires[0].photometry = fixtures::photometry(table.unwrap());
    let shortcut = holds(&square);
    assert_eq!(shortcut.job.stations.len(), 3);
    let settings = shortcut.complete(exact(&shortcut.job), &square).effort;
    // Every meter that is filled in is traced to the one that was rendered.
    assert_eq!(settings["mirrored_meters"].matches(" is ").count(), 13, "{settings:?}");
    assert!(shortcut.omissions.iter().all(|o| !o.reason.is_empty() && o.share > 0.0 && o.share <= 1.0));
}

#[test]
fn recessed_panels_are_as_symmetric_as_their_places() {
    let mut job = symmetric_job(DVec3::new(6.0, 4.0, 3.0), Transport::Direct);
    let opening = LuminousOpening::Box { x_m: 0.6, y_m: 0.4, height_m: 0.0 };
    let panel = |x, y| {
        let lamp = fixtures::luminaire("panel", DVec3::new(x, y, 3.0), fixtures::lambertian());
        fixtures::with_opening(lamp, opening)
    };
    let mount = |job: &mut Job, panels: Vec<Luminaire>| {
        let room = job.scene.room.unwrap();
        job.scene.obstacles = panels.iter().filter_map(|l| flush::plate(&room, l)).collect();
        job.scene.luminaires = panels;
    };
    mount(&mut job, vec![panel(1.5, 1.0), panel(4.5, 1.0), panel(1.5, 3.0), panel(4.5, 3.0)]);
    assert_eq!(holds(&job).job.stations.len(), 4);
    mount(&mut job, vec![panel(1.5, 1.0), panel(4.5, 1.0), panel(1.5, 3.0), panel(4.4, 3.0)]);
    assert_eq!(holds(&job).job.stations.len(), 16);
}

#[test]
fn whatever_breaks_the_symmetry_has_every_meter_rendered() {
    let whole = symmetric_job(DVec3::new(6.0, 4.0, 3.0), CONVERGED);
    let broken = |change: &dyn Fn(&mut Job)| {
        let mut job = whole.clone();
        change(&mut job);
        Shortcut::of(&job).job.stations.len()
    };
    let wall = |job: &mut Job| job.scene.room.as_mut().unwrap().reflectance.wall_x_max = 0.4;
    let desk = Obstacle { shape: Shape::Box { min_m: DVec3::splat(0.2), max_m: DVec3::splat(0.6) }, reflectance: 0.5 };
    // One broken mirror leaves the other.
    assert_eq!(broken(&wall), 8);
    assert_eq!(broken(&|job| job.scene.luminaires[0].position_m.x += 0.01), 8);
    assert_eq!(broken(&|job| job.scene.luminaires[0].position_m += DVec3::new(0.01, 0.01, 0.0)), 16);
    // A lamp that is turned is still the same after half a turn.
    assert_eq!(broken(&|job| job.scene.luminaires[0].orientation = orientation(20.0, 0.0, 0.0)), 8);
    assert_eq!(broken(&|job| job.scene.luminaires[0].photometry = fixtures::photometry(fixtures::lopsided())), 16);
    assert_eq!(broken(&|job| job.scene.obstacles.push(desk.clone())), 16);
    // In free field, where procedure 1 reads its angles, all are read: they are what it is about.
    let free = |job: &mut Job| (job.scene.room, job.transport) = (None, Transport::Direct);
    assert_eq!(broken(&free), 16);
    let twin = |job: &mut Job| {
        let mut twin = job.scene.luminaires[0].clone();
        twin.position_m.x = 1.0;
        job.scene.luminaires[0].position_m.x = 5.0;
        twin.flux_scale = 0.9;
        job.scene.luminaires.push(twin);
    };
    assert_eq!(broken(&twin), 8);
}

#[test]
fn bodies_and_several_lamps_in_symmetric_places_keep_the_symmetry() {
    let mut job = symmetric_job(DVec3::new(6.0, 4.0, 3.0), Transport::Direct);
    let table = |x: f64| Obstacle {
        shape: Shape::Box { min_m: DVec3::new(x, 1.7, 0.0), max_m: DVec3::new(x + 0.6, 2.3, 0.7) },
        reflectance: 0.5,
    };
    job.scene.obstacles = vec![table(1.0), table(4.4)];
    let mut twin = job.scene.luminaires[0].clone();
    job.scene.luminaires[0].position_m.x = 1.5;
    twin.position_m.x = 4.5;
    job.scene.luminaires.push(twin);
    assert_eq!(holds(&job).job.stations.len(), 4);
}

#[test]
fn meters_without_direct_light_are_zero_without_a_ray() {
    let mut job = symmetric_job(DVec3::new(6.0, 4.0, 3.0), Transport::Direct);
    job.scene.luminaires[0].photometry = fixtures::photometry(fixtures::axial_uplight());
    let shortcut = holds(&job);
    assert!(shortcut.job.stations.is_empty() && shortcut.fill.iter().all(|f| *f == Fill::Dark));
    job.scene.luminaires[0].model = LuminaireModel::Area;
    assert!(Shortcut::of(&job).job.stations.is_empty());
    // A lamp tilted so that it lights a part of the meters, and one whose table ends just beside them.
    job.scene.luminaires[0].model = LuminaireModel::Point;
    job.scene.luminaires[0].orientation = orientation(0.0, 40.0, 0.0);
    let lit = holds(&job).job.stations.len();
    assert!((1..16).contains(&lit), "{lit}");
    let mut back = symmetric_job(DVec3::new(6.0, 4.0, 3.0), Transport::Direct);
    back.stations = fixtures::stations(&grid(DVec3::new(6.0, 4.0, 3.0), 0.8), DVec3::NEG_Z);
    assert!(holds(&back).job.stations.is_empty());
}

#[test]
fn black_rooms_have_no_reflected_light_and_one_flat_surface_reflects_once() {
    let mut job = symmetric_job(DVec3::new(6.0, 4.0, 3.0), CONVERGED);
    job.scene.room = Some(fixtures::room(DVec3::new(6.0, 4.0, 3.0), 0.0, 0.0, 0.0));
    assert!(holds(&job).job.stations.is_empty());
    job.transport = Transport::Total(Bounces::Converged);
    assert_eq!(holds(&job).job.transport, Transport::Direct);
    job.scene.room = Some(fixtures::room(DVec3::new(6.0, 4.0, 3.0), 0.6, 0.0, 0.0));
    job.transport = CONVERGED;
    assert_eq!(Shortcut::of(&job).job.transport, Transport::Indirect(Bounces::AtMost(1)));
    job.scene.room = Some(fixtures::room(DVec3::new(6.0, 4.0, 3.0), 0.6, 0.0, 0.1));
    assert_eq!(Shortcut::of(&job).job.transport, CONVERGED);
    job.scene.room = Some(fixtures::room(DVec3::new(6.0, 4.0, 3.0), 0.5, 0.5, 0.5));
    job.transport = Transport::Indirect(Bounces::AtMost(0));
    assert!(Shortcut::of(&job).job.stations.is_empty());
}

#[test]
fn a_job_that_differs_in_flux_alone_is_rescaled_and_an_equal_one_is_rendered_once() {
    let engines = crate::engines::all();
    let radiance = engines.iter().find(|e| e.name() == "radiance").unwrap();
    let first = symmetric_job(DVec3::new(6.0, 4.0, 3.0), CONVERGED);
    let mut repeated = Repeated::default();
    let mut of = |job: &Job| {
        let mut shortcut = Shortcut::of(job);
        repeated.shorten(&mut shortcut, radiance.as_ref());
        shortcut
    };
    let planned = of(&first);
    assert_eq!((planned.factor, planned.omissions.len()), (1.0, 1));
    let equal = of(&Job { case: "other".into(), ..first.clone() });
    assert_eq!((equal.factor, equal.omissions.len()), (1.0, 2));
    let mut dimmed = Job { case: "dimmed".into(), ..first.clone() };
    dimmed.scene.luminaires[0].flux_scale = 0.3;
    let rescaled = of(&dimmed);
    assert!((rescaled.factor - 0.3).abs() < 1e-12);
    let (completed, whole) = (rescaled.complete(exact(&rescaled.job), &dimmed), exact(&dimmed));
    for (c, w) in completed.estimates.iter().zip(&whole.estimates) {
        assert!((c.value / w.value - 1.0).abs() < 1e-5, "{c:?} {w:?}");
    }
    let other = of(&Job { case: "seed".into(), seed: 2, ..first.clone() });
    assert_eq!(other.omissions.len(), 1);
}
