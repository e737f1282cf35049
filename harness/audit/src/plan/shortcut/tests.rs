//! Laws of shortcuts: left-out readings agree with the exact simulation, and asymmetric scenes have no symmetry.

use glam::DVec3;
use luxproof_photometry::LuminousOpening;
use luxproof_scene::{Bounces, LuminaireModel, Obstacle, Scene, Shape, Transport, flush, orientation};
use luxproof_simulator::{Accuracy, illuminance};

use super::*;
use luxproof_engines::fixtures;
use luxproof_model::Uncertainty;

const CONVERGED: Transport = Transport::Indirect(Bounces::Converged);

fn grid(size_m: DVec3, z_m: f64) -> Vec<[f64; 3]> {
    let parts = [0.125, 0.375, 0.625, 0.875];
    parts.iter().flat_map(|x| parts.iter().map(move |y| [x * size_m.x, y * size_m.y, z_m])).collect()
}

fn symmetric_job(size_m: DVec3, transport: Transport) -> Job {
    let lamp = fixtures::luminaire("lamp", size_m * DVec3::new(0.5, 0.5, 0.8), fixtures::quadrant());
    let room = Some(fixtures::room(size_m, 0.2, 0.5, 0.7));
    let sensors = fixtures::sensors(&grid(size_m, 0.8), DVec3::Z);
    fixtures::job(Scene { room, obstacles: vec![], luminaires: vec![lamp] }, sensors, transport)
}

fn exact(job: &Job) -> Measurement {
    let meters: Vec<_> = job.sensors.iter().map(|s| s.meter).collect();
    let accuracy = Accuracy { relative_error: 1e-6, seed: 1 };
    let solution = illuminance(&job.scene, &meters, job.transport, &accuracy).unwrap();
    let values = solution.estimates.iter().map(|e| e.illuminance.value());
    let estimates = values.map(|value| Estimate { value, uncertainty: Uncertainty::Unstated }).collect();
    Measurement { estimates, ..Measurement::default() }
}

/// What a shortcut completes agrees with what the whole job reads.
#[track_caller]
fn holds(job: &Job) -> Shortcut {
    let shortcut = Shortcut::of(job);
    let whole = exact(job);
    let rendered = if shortcut.job.sensors.is_empty() { Measurement::default() } else { exact(&shortcut.job) };
    let completed = shortcut.complete(rendered, job);
    let brightest = whole.estimates.iter().map(|e| e.value).fold(0.0, f64::max);
    assert_eq!(completed.estimates.len(), job.sensors.len());
    for ((c, w), s) in completed.estimates.iter().zip(&whole.estimates).zip(&job.sensors) {
        assert!((c.value - w.value).abs() <= 1e-5 * brightest, "{}: {} for {}", s.id, c.value, w.value);
    }
    shortcut
}

#[test]
fn of_an_oblong_room_a_quarter_is_rendered_and_of_a_square_one_with_an_axial_lamp_an_eighth() {
    let oblong = symmetric_job(DVec3::new(6.0, 4.0, 3.0), CONVERGED);
    assert_eq!(holds(&oblong).job.sensors.len(), 4);
    let mut square = symmetric_job(DVec3::new(5.0, 5.0, 3.0), CONVERGED);
    // The lamp's planes are not exchanged with the axes.
    assert_eq!(holds(&square).job.sensors.len(), 4);
    let table =
        luxproof_photometry::LuminousIntensityDistribution::axial(vec![0.0, 60.0, 90.0], vec![900.0, 400.0, 0.0]);
    square.scene.luminaires[0].photometry = fixtures::photometry(table.unwrap());
    let shortcut = holds(&square);
    assert_eq!(shortcut.job.sensors.len(), 3);
    let settings = shortcut.complete(exact(&shortcut.job), &square).effort;
    // Every meter that is filled in is traced to the one that was rendered.
    assert_eq!(settings["mirrored_meters"].matches(" is ").count(), 13, "{settings:?}");
    assert!(shortcut.omissions.iter().all(|o| !o.reason.is_empty() && o.share > 0.0 && o.share <= 1.0));
}

#[test]
fn recessed_panels_are_as_symmetric_as_their_places() {
    let mut job = symmetric_job(DVec3::new(6.0, 4.0, 3.0), Transport::Direct);
    let opening = LuminousOpening::Box { x_m: 0.6, y_m: 0.4, height_m: 0.0 };
    for (last_x, expected) in [(4.5, 4), (4.4, 16)] {
        let panels = [(1.5, 1.0), (4.5, 1.0), (1.5, 3.0), (last_x, 3.0)].map(|(x, y)| {
            let lamp = fixtures::luminaire("panel", DVec3::new(x, y, 3.0), fixtures::lambertian());
            fixtures::with_opening(lamp, opening)
        });
        let room = job.scene.room.unwrap();
        job.scene.obstacles = panels.iter().filter_map(|l| flush::plate(&room, l)).collect();
        job.scene.luminaires = panels.into();
        assert_eq!(holds(&job).job.sensors.len(), expected);
    }
}

#[test]
fn whatever_breaks_the_symmetry_has_every_meter_rendered() {
    let whole = symmetric_job(DVec3::new(6.0, 4.0, 3.0), CONVERGED);
    let desk = Obstacle { shape: Shape::Box { min_m: DVec3::splat(0.2), max_m: DVec3::splat(0.6) }, reflectance: 0.5 };
    // One broken mirror leaves the other.
    assert_eq!(rendered_after(&whole, |job| job.scene.room.as_mut().unwrap().reflectance.wall_x_max = 0.4), 8);
    assert_eq!(rendered_after(&whole, |job| job.scene.luminaires[0].position_m.x += 0.01), 8);
    assert_eq!(rendered_after(&whole, |job| job.scene.luminaires[0].position_m += DVec3::new(0.01, 0.01, 0.0)), 16);
    // A lamp that is turned is still the same after half a turn.
    assert_eq!(rendered_after(&whole, |job| job.scene.luminaires[0].orientation = orientation(20.0, 0.0, 0.0)), 8);
    assert_eq!(
        rendered_after(&whole, |job| job.scene.luminaires[0].photometry = fixtures::photometry(fixtures::lopsided())),
        16
    );
    assert_eq!(rendered_after(&whole, |job| job.scene.obstacles.push(desk.clone())), 16);
    // In free field, where procedure 1 reads its angles, all are read: they are what it is about.
    let free = rendered_after(&whole, |job| (job.scene.room, job.transport) = (None, Transport::Direct));
    assert_eq!(free, 16);
    let with_twin = rendered_after(&whole, |job| {
        let mut twin = job.scene.luminaires[0].clone();
        twin.position_m.x = 1.0;
        job.scene.luminaires[0].position_m.x = 5.0;
        twin.flux_scale = 0.9;
        job.scene.luminaires.push(twin);
    });
    assert_eq!(with_twin, 8);
}

/// The number of sensors that are rendered after a change of a job.
fn rendered_after(job: &Job, change: impl FnOnce(&mut Job)) -> usize {
    let mut job = job.clone();
    change(&mut job);
    Shortcut::of(&job).job.sensors.len()
}

#[test]
fn bodies_and_several_lamps_in_symmetric_places_keep_the_symmetry() {
    let mut job = symmetric_job(DVec3::new(6.0, 4.0, 3.0), Transport::Direct);
    for x in [1.0, 4.4] {
        let shape = Shape::Box { min_m: DVec3::new(x, 1.7, 0.0), max_m: DVec3::new(x + 0.6, 2.3, 0.7) };
        job.scene.obstacles.push(Obstacle { shape, reflectance: 0.5 });
    }
    let mut twin = job.scene.luminaires[0].clone();
    job.scene.luminaires[0].position_m.x = 1.5;
    twin.position_m.x = 4.5;
    job.scene.luminaires.push(twin);
    assert_eq!(holds(&job).job.sensors.len(), 4);
    // What a body reflects is a part of its likeness.
    job.scene.obstacles[1].reflectance = 0.2;
    assert_eq!(Shortcut::of(&job).job.sensors.len(), 8);
}

#[test]
fn meters_without_direct_light_are_zero_without_a_ray() {
    let mut job = symmetric_job(DVec3::new(6.0, 4.0, 3.0), Transport::Direct);
    job.scene.luminaires[0].photometry = fixtures::photometry(fixtures::axial_uplight());
    let shortcut = holds(&job);
    assert!(shortcut.job.sensors.is_empty() && shortcut.fill.iter().all(|f| *f == Fill::Dark));
    job.scene.luminaires[0].model = LuminaireModel::Area;
    assert!(Shortcut::of(&job).job.sensors.is_empty());
    // A lamp tilted so that it lights a part of the meters, and one whose table ends just beside them.
    job.scene.luminaires[0].model = LuminaireModel::Point;
    job.scene.luminaires[0].orientation = orientation(0.0, 40.0, 0.0);
    let lit = holds(&job).job.sensors.len();
    assert!((1..16).contains(&lit), "{lit}");
    let mut back = symmetric_job(DVec3::new(6.0, 4.0, 3.0), Transport::Direct);
    back.sensors = fixtures::sensors(&grid(DVec3::new(6.0, 4.0, 3.0), 0.8), DVec3::NEG_Z);
    assert!(holds(&back).job.sensors.is_empty());
}

/// A table of type B that shines in a narrow band of vertical angles, at every horizontal angle or at few.
fn narrow_type_b(vertical_deg: [i32; 4], horizontal: &str) -> luxproof_photometry::LuminousIntensityDistribution {
    let vertical = vertical_deg.map(|v| v.to_string()).join(" ");
    let rows = if horizontal == "narrow" { ["0", "0", "300", "0", "0"] } else { ["300"; 5] };
    let rows = rows.map(|cd| format!("0 {cd} {cd} 0")).join("\n");
    let text =
        format!("IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 4 5 2 2 0 0 0\n1 1 0\n{vertical}\n-90 -20 0 20 90\n{rows}\n");
    luxproof_photometry::lm63::parse(text.as_bytes()).unwrap().distribution
}

#[test]
fn a_meter_that_a_narrow_flood_of_type_b_lights_is_not_dark() {
    let mut lit = 0;
    for vertical_deg in [[-90, -70, -40, 0], [-10, 0, 20, 40], [20, 50, 70, 90]] {
        for (horizontal, tilt_deg) in [("wide", 0.0), ("wide", 70.0), ("narrow", 0.0), ("narrow", -40.0)] {
            let mut job = symmetric_job(DVec3::new(6.0, 4.0, 3.0), Transport::Direct);
            job.scene.luminaires[0].photometry = fixtures::photometry(narrow_type_b(vertical_deg, horizontal));
            job.scene.luminaires[0].orientation = orientation(25.0, tilt_deg, 0.0);
            let lamp = &job.scene.luminaires[0];
            let fill = Shortcut::of(&job).fill;
            for (sensor, fill) in job.sensors.iter().zip(&fill) {
                let to_meter = sensor.meter.position_m - lamp.position_m;
                if lamp.intensity_towards(to_meter.normalize()).value() > 0.0 && to_meter.dot(sensor.meter.normal) < 0.0
                {
                    lit += 1;
                    assert_ne!(*fill, Fill::Dark, "{vertical_deg:?} {horizontal} {tilt_deg}: {}", sensor.id);
                }
            }
        }
    }
    assert!(lit >= 30, "{lit}");
}

#[test]
fn a_meter_close_above_an_uplight_is_lit_though_no_corner_lights_it() {
    let mut job = symmetric_job(DVec3::new(6.0, 4.0, 3.0), Transport::Direct);
    let table = luxproof_photometry::LuminousIntensityDistribution::axial(
        vec![0.0, 119.0, 120.0, 180.0],
        vec![0.0, 0.0, 500.0, 500.0],
    );
    let lamp = fixtures::luminaire("panel", DVec3::new(3.0, 2.0, 1.0), table.unwrap());
    job.scene.luminaires =
        vec![fixtures::with_opening(lamp, LuminousOpening::Box { x_m: 0.6, y_m: 0.6, height_m: 0.0 })];
    // The middle sees it straight above, the corners at 97 degrees, where the table is dark.
    job.sensors = fixtures::sensors(&[[3.0, 2.0, 1.05]], DVec3::NEG_Z);
    assert_eq!(Shortcut::of(&job).fill, [Fill::Rendered(0)]);
}

#[test]
fn a_meter_close_below_a_spot_is_lit_though_no_corner_lights_it() {
    // The middle sees it straight below, the corners at 83 degrees, where the table is dark.
    let mut job = symmetric_job(DVec3::new(6.0, 4.0, 3.0), Transport::Direct);
    let table =
        luxproof_photometry::LuminousIntensityDistribution::axial(vec![0.0, 30.0, 31.0], vec![500.0, 500.0, 0.0]);
    let lamp = fixtures::luminaire("panel", DVec3::new(3.0, 2.0, 2.0), table.unwrap());
    job.scene.luminaires =
        vec![fixtures::with_opening(lamp, LuminousOpening::Box { x_m: 0.6, y_m: 0.6, height_m: 0.0 })];
    job.sensors = fixtures::sensors(&[[3.0, 2.0, 1.95]], DVec3::Z);
    assert_eq!(Shortcut::of(&job).fill, [Fill::Rendered(0)]);
}

#[test]
fn a_meter_in_the_dark_cone_of_one_corner_is_lit_by_others() {
    // The table is dark below 30 degrees. The meter is straight below a corner, and 45 degrees from the next.
    let mut job = symmetric_job(DVec3::new(6.0, 4.0, 3.0), Transport::Direct);
    let table = luxproof_photometry::LuminousIntensityDistribution::axial(
        vec![0.0, 29.0, 30.0, 90.0],
        vec![0.0, 0.0, 500.0, 500.0],
    );
    let lamp = fixtures::luminaire("panel", DVec3::new(3.0, 2.0, 2.0), table.unwrap());
    job.scene.luminaires =
        vec![fixtures::with_opening(lamp, LuminousOpening::Box { x_m: 1.0, y_m: 1.0, height_m: 0.0 })];
    job.sensors = fixtures::sensors(&[[3.5, 2.5, 1.0]], DVec3::Z);
    assert_eq!(Shortcut::of(&job).fill, [Fill::Rendered(0)]);
}

#[test]
fn floor_and_ceiling_mirror_each_other_only_where_they_reflect_as_much() {
    let size_m = DVec3::new(6.0, 4.0, 3.0);
    let even = luxproof_photometry::LuminousIntensityDistribution::axial(vec![0.0, 180.0], vec![100.0; 2]).unwrap();
    for (ceiling, rendered) in [(0.7, 1), (0.2, 2)] {
        let mut job = symmetric_job(size_m, CONVERGED);
        job.scene.room = Some(fixtures::room(size_m, 0.7, 0.5, ceiling));
        job.scene.luminaires = vec![fixtures::luminaire("lamp", 0.5 * size_m, even.clone())];
        // Their places and normals have one symmetry, z to -z.
        job.sensors = fixtures::sensors(&[[1.0, 1.0, 0.4], [1.0, 1.0, 2.6]], DVec3::X);
        assert_eq!(holds(&job).job.sensors.len(), rendered, "{ceiling}");
    }
}

/// A table of type B that is even between these vertical angles and these horizontal ones, and dark beyond.
fn even_type_b(vertical_deg: [i32; 2], horizontal_deg: [i32; 2]) -> luxproof_photometry::LuminousIntensityDistribution {
    let [vertical, horizontal] = [vertical_deg, horizontal_deg].map(|[a, b]| format!("{a} {b}"));
    let text = format!(
        "IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 2 2 2 2 0 0 0\n1 1 0\n{vertical}\n{horizontal}\n300 300\n300 300\n"
    );
    luxproof_photometry::lm63::parse(text.as_bytes()).unwrap().distribution
}

#[test]
fn a_small_patch_of_light_of_type_b_breaks_the_symmetry() {
    for (vertical_deg, horizontal_deg, rendered) in [
        ([-30, 30], [-40, 40], 4),
        ([-30, 29], [-40, 40], 8),
        ([-30, 30], [-40, 39], 8),
        ([-30, 29], [-40, 39], 16),
        ([40, 42], [20, 22], 16),
        ([40, 42], [-1, 1], 8),
    ] {
        let table = even_type_b(vertical_deg, horizontal_deg);
        let mut job = symmetric_job(DVec3::new(6.0, 4.0, 3.0), CONVERGED);
        job.scene.luminaires[0].photometry = fixtures::photometry(table);
        let found = Shortcut::of(&job).job.sensors.len();
        assert_eq!(found, rendered, "{vertical_deg:?} {horizontal_deg:?}");
    }
}

#[test]
fn black_rooms_have_no_reflected_light_and_one_flat_surface_reflects_once() {
    let mut job = symmetric_job(DVec3::new(6.0, 4.0, 3.0), CONVERGED);
    job.scene.room = Some(fixtures::room(DVec3::new(6.0, 4.0, 3.0), 0.0, 0.0, 0.0));
    assert!(holds(&job).job.sensors.is_empty());
    job.transport = Transport::Total(Bounces::Converged);
    assert_eq!(holds(&job).job.transport, Transport::Direct);
    job.scene.room = Some(fixtures::room(DVec3::new(6.0, 4.0, 3.0), 0.6, 0.0, 0.0));
    job.transport = CONVERGED;
    assert_eq!(Shortcut::of(&job).job.transport, Transport::Indirect(Bounces::AtMost(1)));
    job.scene.room = Some(fixtures::room(DVec3::new(6.0, 4.0, 3.0), 0.6, 0.0, 0.1));
    assert_eq!(Shortcut::of(&job).job.transport, CONVERGED);
    job.scene.room = Some(fixtures::room(DVec3::new(6.0, 4.0, 3.0), 0.5, 0.5, 0.5));
    job.transport = Transport::Indirect(Bounces::AtMost(0));
    assert!(Shortcut::of(&job).job.sensors.is_empty());
}

#[test]
fn a_job_that_differs_in_flux_alone_is_rescaled_and_an_equal_one_is_rendered_once() {
    let engines = luxproof_engines::all();
    let radiance = engines.iter().find(|e| e.name() == "radiance").unwrap();
    let first = symmetric_job(DVec3::new(6.0, 4.0, 3.0), CONVERGED);
    let mut planned_jobs = PlannedJobs::default();
    let equal = Job { case: "other".into(), ..first.clone() };
    let mut dimmed = Job { case: "dimmed".into(), ..first.clone() };
    dimmed.scene.luminaires[0].flux_scale = 0.3;
    let other = Job { case: "seed".into(), seed: 2, ..first.clone() };
    let [planned, equal, rescaled, other] = [&first, &equal, &dimmed, &other].map(|job| {
        let mut shortcut = Shortcut::of(job);
        planned_jobs.shorten(&mut shortcut, radiance.as_ref());
        shortcut
    });
    assert_eq!((planned.factor, planned.omissions.len()), (1.0, 1));
    assert_eq!((equal.factor, equal.omissions.len()), (1.0, 2));
    assert!((rescaled.factor - 0.3).abs() < 1e-12);
    let (completed, whole) = (rescaled.complete(exact(&rescaled.job), &dimmed), exact(&dimmed));
    for (c, w) in completed.estimates.iter().zip(&whole.estimates) {
        assert!((c.value / w.value - 1.0).abs() < 1e-5, "{c:?} {w:?}");
    }
    assert_eq!(other.omissions.len(), 1);
}

#[test]
fn of_two_luminaires_both_must_be_dimmed_alike() {
    let engines = luxproof_engines::all();
    let radiance = engines.iter().find(|e| e.name() == "radiance").unwrap();
    let mut planned_jobs = PlannedJobs::default();
    let factors = [(2.0, 1.0), (0.6, 0.3), (0.6, 1.0)].map(|(first, second)| {
        let mut job = symmetric_job(DVec3::new(6.0, 4.0, 3.0), CONVERGED);
        let mut twin = job.scene.luminaires[0].clone();
        twin.position_m.x = 1.0;
        job.scene.luminaires.push(twin);
        (job.scene.luminaires[0].flux_scale, job.scene.luminaires[1].flux_scale) = (first, second);
        job.case = format!("{first} {second}");
        let mut shortcut = Shortcut::of(&job);
        let before = shortcut.omissions.len();
        planned_jobs.shorten(&mut shortcut, radiance.as_ref());
        (shortcut.factor, shortcut.omissions.len() - before)
    });
    assert_eq!(factors, [(1.0, 0), (0.3, 1), (1.0, 0)]);
}
