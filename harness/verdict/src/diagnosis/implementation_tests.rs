//! Faults of newly written renderers by hand: what each changes in small tasks.

#![allow(clippy::approx_constant, reason = "numbers by hand test the constants of the code")]

use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DMat3, DVec3};
use luxproof_engines::fixtures;
use luxproof_model::{MeterId, ProcedureId, Quantity};
use luxproof_photometry::{LuminousIntensityDistribution as Table, Photometry};
use luxproof_scene::geometry::Surface;
use luxproof_scene::{Bounces, Luminaire, Meter, Scene, Transport, orientation};
use luxproof_spec::procedures::{Target, Task};

use super::fault::Fault;
use super::faulty_task::{FaultyTask, Law, Model};
use super::implementation_faults::implementation_faults;

const AT_M: DVec3 = DVec3::new(1.0, 2.0, 2.5);

/// 100 cd everywhere downwards: a flux of 200 pi.
fn lamp(id: &str) -> Luminaire {
    fixtures::luminaire(id, AT_M, Table::axial(vec![0.0, 90.0], vec![100.0, 100.0]).unwrap())
}

fn task(luminaires: Vec<Luminaire>, transport: Transport) -> Task {
    let meter = Meter { position_m: DVec3::new(3.0, 4.0, 1.0), normal: DVec3::new(0.48, 0.6, 0.64) };
    let room = Some(fixtures::room(DVec3::new(4.0, 5.0, 3.0), 0.2, 0.5, 0.8));
    Task {
        procedure: ProcedureId::DirectIlluminance,
        scene: Scene { luminaires, room, ..Scene::default() },
        transport,
        quantity: Quantity::Illuminance,
        targets: vec![Target::of_one(MeterId::new("m", 0), meter, 1.0)],
    }
}

fn direct(luminaires: Vec<Luminaire>) -> Task {
    task(luminaires, Transport::Direct)
}

fn reflected() -> Task {
    task(vec![lamp("a")], Transport::Indirect(Bounces::Converged))
}

/// All faults with this beginning of their text.
fn named(task: &Task, text: &str) -> Vec<Fault> {
    implementation_faults(&[std::slice::from_ref(task)]).into_iter().filter(|f| f.what.starts_with(text)).collect()
}

#[track_caller]
fn apply(task: &Task, text: &str) -> Option<FaultyTask> {
    let all = named(task, text);
    assert_eq!(all.len(), 1, "{text}");
    all[0].apply(&Model::new(0, task, vec![1.0]), &[])
}

fn first(faulty: &FaultyTask) -> &Luminaire {
    &faulty.task().scene.luminaires[0]
}

#[track_caller]
fn assert_near(found: f64, expected: f64) {
    assert!((found - expected).abs() <= 1e-9 * expected.abs(), "{found} for {expected}");
}

/// A vector with its components taken as such names say, like "-y, x, z".
fn taken(names: &str, from: DVec3) -> DVec3 {
    let component = |name: &str| {
        let value = match name.trim_start_matches('-') {
            "x" => from.x,
            "y" => from.y,
            _ => from.z,
        };
        if name.starts_with('-') { -value } else { value }
    };
    let all: Vec<f64> = names.split(", ").map(component).collect();
    DVec3::from_slice(&all)
}

#[test]
fn axes_are_permuted_and_mirrored_in_every_way_but_the_right_one() {
    let mut turned = lamp("a");
    turned.orientation = orientation(20.0, 30.0, 40.0);
    let task = direct(vec![turned.clone()]);
    for text in ["x, y, z of meters", "x, y, z of normals", "x, y, z of luminaires' places"] {
        let all = named(&task, text);
        assert_eq!(all.len(), 47, "{text}");
        for fault in all {
            let (_, names) = fault.what.split_once(" taken as ").unwrap();
            let faulty = fault.apply(&Model::new(0, &task, vec![1.0]), &[]).unwrap();
            let meter = faulty.task().targets[0].aspects[0].meter;
            let right = task.targets[0].aspects[0].meter;
            let is_of_meters = fault.id == "coordinates";
            let expected_place = if is_of_meters { taken(names, right.position_m) } else { right.position_m };
            let expected_normal = if fault.id == "places" { right.normal } else { taken(names, right.normal) };
            assert_eq!((meter.position_m, meter.normal), (expected_place, expected_normal), "{}", fault.what);
            let expected = if fault.id == "places" { taken(names, AT_M) } else { AT_M };
            assert_eq!(first(&faulty).position_m, expected, "{}", fault.what);
        }
    }
    for fault in named(&task, "x, y, z of a luminaire's axes") {
        let (_, names) = fault.what.split_once(" taken as ").unwrap();
        let faulty = fault.apply(&Model::new(0, &task, vec![1.0]), &[]).unwrap();
        assert_eq!(first(&faulty).orientation.x_axis, taken(names, turned.orientation.x_axis), "{names}");
    }
    // In its own frame: what is along x there goes where the matrix sends it first.
    for fault in named(&task, "x, y, z of a luminaire's own frame") {
        let (_, names) = fault.what.split_once(" taken as ").unwrap();
        let faulty = fault.apply(&Model::new(0, &task, vec![1.0]), &[]).unwrap();
        let expected = turned.orientation * taken(names, DVec3::Y);
        assert!((first(&faulty).orientation.y_axis - expected).length() < 1e-12, "{names}");
    }
    assert_eq!(first(&apply(&task, "luminaires are taken to be at the origin").unwrap()).position_m, DVec3::ZERO);
    let at_origin = direct(vec![Luminaire { position_m: DVec3::ZERO, ..turned }]);
    assert!(apply(&at_origin, "luminaires are taken to be at the origin").is_none());
}

#[test]
fn azimuth_tilt_and_roll_are_taken_apart_and_put_together_wrongly() {
    let mut turned = lamp("a");
    turned.orientation = orientation(20.0, 30.0, 45.0);
    let task = direct(vec![turned]);
    for (text, [azimuth, tilt, roll]) in [
        ("azimuth of luminaires is left out", [0.0, 30.0, 45.0]),
        ("tilt of luminaires is left out", [20.0, 0.0, 45.0]),
        ("roll of luminaires is left out", [20.0, 30.0, 0.0]),
        ("azimuth of luminaires turns the wrong way round", [-20.0, 30.0, 45.0]),
        ("tilt of luminaires goes to the other side", [20.0, -30.0, 45.0]),
        ("roll of luminaires turns the wrong way round", [20.0, 30.0, -45.0]),
        ("azimuth and roll of luminaires are exchanged", [45.0, 30.0, 20.0]),
        ("azimuth and roll of luminaires turn the wrong way round", [-20.0, 30.0, -45.0]),
        ("roll of luminaires is about the vertical", [65.0, 30.0, 0.0]),
        ("tilt of luminaires is about y of the room", [0.0, 30.0, 65.0]),
        ("tilt of luminaires is about their x axis, not", [110.0, 30.0, -45.0]),
        ("tilt of luminaires is about their x axis, to the other side", [-70.0, 30.0, 135.0]),
    ] {
        let found = first(&apply(&task, text).unwrap()).orientation;
        let expected = orientation(azimuth, tilt, roll);
        assert!((found - expected).to_cols_array().iter().all(|x| x.abs() < 1e-12), "{text}: {found} for {expected}");
    }
    // Without tilt azimuth and roll are one rotation, by 65 degrees.
    let mut upright = lamp("a");
    upright.orientation = orientation(20.0, 0.0, 45.0);
    let upright = direct(vec![upright]);
    let found = first(&apply(&upright, "azimuth of luminaires turns the wrong way round").unwrap()).orientation;
    assert!((found - orientation(-65.0, 0.0, 0.0)).to_cols_array().iter().all(|x| x.abs() < 1e-12));
    let what = "of a luminaire's rotation only where its x axis points in plan counts";
    assert!(apply(&direct(vec![lamp("a")]), what).is_none());
    // The x axis of a tilt of 60 degrees and a roll of 90 is the y axis of the room.
    let mut rolled = lamp("a");
    rolled.orientation = orientation(0.0, 60.0, 90.0);
    let found = first(&apply(&direct(vec![rolled]), what).unwrap()).orientation;
    assert!((found - DMat3::from_rotation_z(PI / 2.0)).to_cols_array().iter().all(|x| x.abs() < 1e-12));
}

/// Four luminaires with scales of 1 to 4.
fn four() -> Task {
    direct((1..=4).map(|k| Luminaire { flux_scale: f64::from(k), ..lamp(&k.to_string()) }).collect())
}

#[test]
fn several_luminaires_are_mixed_up_lost_averaged_or_outshone() {
    for (other, expected) in [
        ("the first", [1.0; 4]),
        ("the last", [4.0; 4]),
        ("the next", [2.0, 3.0, 4.0, 1.0]),
        ("the one before", [4.0, 1.0, 2.0, 3.0]),
        ("that as far from the end of the list", [4.0, 3.0, 2.0, 1.0]),
    ] {
        let text = format!("of several luminaires each has the flux_scale of {other}");
        let found: Vec<f64> =
            apply(&four(), &text).unwrap().task().scene.luminaires.iter().map(|l| l.flux_scale).collect();
        assert_eq!(found, expected, "{other}");
    }
    let single = direct(vec![lamp("a")]);
    for (text, expected) in [
        ("of several luminaires the last alone gives light", &["4"][..]),
        ("of several luminaires the first gives no light", &["2", "3", "4"]),
        ("of several luminaires the last gives no light", &["1", "2", "3"]),
        ("of several luminaires the second alone gives light", &["2"]),
        ("of several luminaires the second gives no light", &["1", "3", "4"]),
    ] {
        let faulty = apply(&four(), text).unwrap();
        let lit: Vec<&str> = faulty.task().scene.luminaires.iter().map(|l| &l.id[..]).collect();
        assert_eq!(lit, expected, "{text}");
        assert!(apply(&single, text).is_none(), "{text}");
    }
    let mean = "the light of several luminaires is averaged";
    assert!(apply(&four(), mean).unwrap().factor == 0.25 && apply(&single, mean).is_none());
    let brightest = "of several luminaires the brightest alone counts at each meter";
    assert!(apply(&four(), brightest).unwrap().law.counts_brightest_only && apply(&single, brightest).is_none());
    assert!(apply(&single, "of several luminaires each has the table of the next").is_none());
}

#[test]
fn laws_and_bodies_are_wrong_in_the_ways_they_say() {
    let task = direct(vec![lamp("a")]);
    let law = |text: &str| apply(&task, text).unwrap().law;
    let emission = Law { emission: 1.0, ..Law::RIGHT };
    assert_eq!(law("the cosine at the luminaire is applied, too"), emission);
    let in_place = Law { cosine: 0.0, is_two_sided: true, ..emission };
    assert_eq!(law("the cosine at the luminaire is applied in place of"), in_place);
    let distances = [law("light falls with the third power of distance"), law("light does not fall with distance")];
    assert_eq!(distances.map(|law| law.distance.attenuation(2.0)), [0.125, 1.0]);
    let mut opening = lamp("a");
    opening.model = luxproof_scene::LuminaireModel::Area;
    assert!(apply(&direct(vec![opening]), "light does not fall with distance").is_none());

    let (through, too_large) = ("bodies hide nothing", "where there are bodies no light arrives");
    assert!(apply(&task, through).is_none() && apply(&task, too_large).is_none());
    let mut furnished = task;
    furnished.scene.obstacles = fixtures::s2(vec![], Transport::Direct).scene.obstacles;
    assert!(!furnished.scene.obstacles.is_empty());
    assert!(apply(&furnished, through).unwrap().task().scene.obstacles.is_empty());
    assert_eq!(apply(&furnished, too_large).unwrap().factor, 0.0);
}

#[test]
fn reflected_light_alone_has_a_factor() {
    let unlit = direct(vec![lamp("a")]);
    for (text, factor) in [
        ("factor pi in reflected light alone", 3.141592653589793),
        ("factor 1/pi in reflected light alone", 0.3183098861837907),
        ("factor 2 in reflected light alone", 2.0),
        ("factor 1/2 in reflected light alone", 0.5),
        ("reflected light is missing", 0.0),
    ] {
        assert_near(apply(&reflected(), text).unwrap().factor, factor);
        assert!(apply(&unlit, text).is_none(), "{text}");
    }
    let lost = "the first reflection is missing";
    assert!(apply(&reflected(), lost).is_some() && apply(&unlit, lost).is_none());
    let total = Task { transport: Transport::Total(Bounces::Converged), ..reflected() };
    assert!(apply(&total, lost).is_none());
}

#[test]
fn surfaces_reflect_nothing_or_what_others_should() {
    let of = |[floor, walls, ceiling]: [f64; 3]| {
        Surface::ALL.map(|s| match s {
            Surface::Floor => floor,
            Surface::Ceiling => ceiling,
            _ => walls,
        })
    };
    for (text, expected) in [
        ("the floor reflects nothing", [0.0, 0.5, 0.8]),
        ("the ceiling reflects nothing", [0.2, 0.5, 0.0]),
        ("the walls reflect nothing", [0.2, 0.0, 0.8]),
        // (.2 + 4 * .5 + .8) / 6.
        ("every surface reflects what all do on average", [0.5; 3]),
        ("every surface reflects what the floor should", [0.2; 3]),
        ("every surface reflects what the ceiling should", [0.8; 3]),
        ("every surface reflects what the walls should", [0.5; 3]),
    ] {
        let room = apply(&reflected(), text).unwrap().task().scene.room.unwrap();
        let found = Surface::ALL.map(|s| room.reflectance.of(s));
        assert!(found.iter().zip(of(expected)).all(|(f, e)| (f - e).abs() < 1e-12), "{text}: {found:?}");
    }
}

#[test]
fn jobs_are_read_with_the_luminaires_of_another_scene_of_known_answer() {
    let tasks: Vec<Task> = luxproof_spec::procedures::known::tasks();
    let scenes = implementation_faults(&[&tasks]).into_iter().filter(|f| f.id == "scene-of");
    let scenes: Vec<Fault> = scenes.collect();
    assert_eq!(scenes.len(), tasks.len());
    let own = direct(vec![lamp("a")]);
    let faulty = scenes[0].apply(&Model::new(0, &own, vec![1.0]), &[]).unwrap();
    assert_eq!(first(&faulty).id, tasks[0].scene.luminaires[0].id);
    assert!(named(&own, "every job is read").is_empty());
}

/// The factor on all readings of a task of one luminaire.
#[track_caller]
fn factor(task: &Task, text: &str) -> Option<f64> {
    let all: Vec<Fault> = named(task, text).into_iter().filter(|f| !f.what.contains("{0:}")).collect();
    let factors = all.iter().map(|f| Some(f.apply(&Model::new(0, task, vec![1.0]), &[])?.factor));
    let mut factors: Vec<Option<f64>> = factors.collect();
    // Of a table as it is in the file, and of one that is dimmed, which this one is not.
    factors.dedup();
    assert_eq!(factors.len(), 1, "{text}: {factors:?}");
    factors[0]
}

#[test]
fn normalised_tables_have_the_factors_that_they_say() {
    let mut table = Photometry::of(Table::axial(vec![0.0, 60.0, 90.0], vec![50.0, 80.0, 0.0]).unwrap());
    table.lamp_lumens = Some(2000.0);
    let (peak, nadir, flux) = (80.0, 50.0, table.distribution.flux().value());
    let task = direct(vec![Luminaire { photometry: Arc::new(table), ..lamp("a") }]);
    for (text, expected) in [
        ("the table is divided by its peak", 1.0 / peak),
        ("the table is divided by its flux", 1.0 / flux),
        ("the table is divided by its value at the nadir", 1.0 / nadir),
        ("the table is scaled by flux over peak", flux / peak),
        ("the table is scaled by peak over flux", peak / flux),
        ("the table is scaled by its flux", flux),
        ("the table is scaled by its peak", peak),
        ("the table is scaled by lamp lumens over its flux", 2000.0 / flux),
        ("the table is scaled to a flux of 1000 lm", 1000.0 / flux),
        ("the table is scaled to a peak of 1000 cd", 12.5),
        ("the table is divided by its mean intensity", 12.566370614359172 / flux),
        ("the table is scaled by flux/(pi peak)", flux / 251.32741228718345),
    ] {
        assert_near(factor(&task, text).unwrap(), expected);
    }
    // Of a luminaire dimmed to a quarter the table of the file, or the dimmed one, is divided by its peak.
    let dimmed = direct(vec![Luminaire { flux_scale: 0.25, ..task.scene.luminaires[0].clone() }]);
    let both = named(&dimmed, "the table is divided by its peak");
    let plain = both.iter().filter(|f| !f.has_factor);
    let factors: Vec<f64> = plain.map(|f| f.apply(&Model::new(0, &dimmed, vec![1.0]), &[]).unwrap().factor).collect();
    assert_near(factors[0], 0.0125);
    assert_near(factors[1], 0.05);
    assert_eq!((factors.len(), both.len()), (2, 4));
    // Without a value there is no factor.
    let dark = Photometry::of(Table::axial(vec![0.0, 90.0], vec![0.0, 0.0]).unwrap());
    let dark = direct(vec![Luminaire { photometry: Arc::new(dark), ..lamp("a") }]);
    for text in ["its peak", "its flux", "its value at the nadir"] {
        assert_eq!(factor(&dark, &format!("the table is divided by {text}")), None, "{text}");
    }
    assert_eq!(factor(&dark, "the table is scaled by lamp lumens over its flux"), None);
}

fn file(bytes: &[u8]) -> Photometry {
    luxproof_photometry::read_by(std::path::Path::new("a.ies"), &|_| Ok(bytes.to_vec())).unwrap()
}

#[test]
fn fields_of_a_file_are_left_out_or_applied_twice_where_they_are_not_one() {
    // Three lamps of 1000 lm; candela times 2, a ballast factor of .9 and a ballast-lamp factor of .5.
    let text = b"IESNA:LM-63-1995\nTILT=NONE\n3 1000 2 2 1 1 2 0 0 0\n0.9 0.5 100\n0 90\n0\n100 100\n";
    let photometry = file(text);
    let task = direct(vec![Luminaire { photometry: Arc::new(photometry), ..lamp("a") }]);
    for (field, value) in [
        ("the candela multiplier", 2.0),
        ("the ballast factor", 0.9),
        ("the ballast-lamp factor", 0.5),
        ("the number of lamps", 3.0),
        ("the product of all multipliers", 0.9),
    ] {
        assert_near(factor(&task, &format!("{field} of the file is left out")).unwrap(), 1.0 / value);
        assert_near(factor(&task, &format!("{field} of the file is applied twice")).unwrap(), value);
    }
    let plain = b"IESNA:LM-63-1995\nTILT=NONE\n1 1000 1 2 1 1 2 0 0 0\n1 1 100\n0 90\n0\n100 100\n";
    let photometry = file(plain);
    let plain = direct(vec![Luminaire { photometry: Arc::new(photometry), ..lamp("a") }]);
    assert!(named(&plain, "the number of lamps").is_empty() && named(&plain, "the candela multiplier").is_empty());
    // The other luminaire's field concerns this one as little as one that is not in any file.
    let other = named(&task, "the number of lamps of the file is left out");
    assert!(other[0].apply(&Model::new(0, &plain, vec![1.0]), &[]).is_none());
    assert!(named(&direct(vec![lamp("a")]), "the number of lamps").is_empty());
}
