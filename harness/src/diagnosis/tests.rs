//! What is named, and what is better left unsaid.

use itertools::Itertools;
use luminaire::scene::{Bounces, Transport};

use super::*;
use crate::engines::fixtures;
use crate::judge::tests::built_in;
use crate::procedures::{Target, known};
use crate::record::{MeterId, Quantity, Reading, ReadingKey, Recording, Uncertainty};

/// Four meters of case S1, of which more are wanted where something is fitted.
fn task(transport: Transport) -> Task {
    let job = fixtures::s1(transport);
    let target = |(k, s): (usize, &crate::engines::Station)| Target::of_one(MeterId::new("m", k), s.meter, 1.0);
    let targets = job.stations.iter().enumerate().map(target).collect();
    Task { procedure: job.procedure, scene: job.scene, transport, quantity: Quantity::Illuminance, targets }
}

/// Eight meters without symmetry, under a luminaire without symmetry.
fn skew(transport: Transport) -> Task {
    let mut task = task(transport);
    let lamp = &mut task.scene.luminaires[0];
    (lamp.photometry, lamp.position_m.x) = (fixtures::photometry(fixtures::lopsided()), 8.0);
    if let Some(room) = &mut task.scene.room {
        (room.reflectance.wall_x_min, room.reflectance.wall_y_max) = (0.3, 0.6);
    }
    let places =
        [(2.0, 3.0), (6.0, 4.0), (11.0, 3.0), (17.0, 5.0), (3.0, 12.0), (7.0, 16.0), (12.0, 13.0), (18.0, 17.0)];
    let target = |(k, (x, y)): (usize, &(f64, f64))| {
        let mut meter = task.targets[0].meter;
        meter.position_m = glam::DVec3::new(*x, *y, 1.0 + 0.3 * k as f64);
        meter.normal = if k % 3 == 2 { glam::DVec3::X } else { glam::DVec3::Z };
        Target::of_one(MeterId::new("m", k), meter, 1.0)
    };
    task.targets = places.iter().enumerate().map(target).collect();
    task
}

/// What an engine reads of tasks, judged.
fn judged(tasks: &[Task], read: &dyn Fn(&Model) -> Vec<f64>) -> Vec<Comparison> {
    tasks.iter().flat_map(|task| judged_to(1e-4, task, read)).collect()
}

/// The same of one task, to a relative error.
fn judged_to(error: f64, task: &Task, read: &dyn Fn(&Model) -> Vec<f64>) -> Vec<Comparison> {
    let right = truth(task).unwrap();
    let model = Model::new(0, task, right.clone());
    let recording = |engine: &str, values: Vec<f64>, error: f64| Recording {
        readings: task
            .targets
            .iter()
            .zip(values)
            .map(|(target, value)| Reading {
                meter: target.id.clone(),
                quantity: task.quantity,
                value,
                uncertainty: Uncertainty::sampled(error * value, None),
            })
            .collect(),
        ..Recording::of(ReadingKey::new("case", task.procedure, engine), task.light())
    };
    let all = [
        recording("iesna", right.clone(), 0.0),
        recording("simulator", right, 0.0),
        recording("radiance", read(&model), error),
    ];
    let mut comparisons = built_in().compare(task, &all.iter().collect::<Vec<_>>());
    comparisons.retain(|c| c.key.engine == "radiance");
    comparisons
}

fn found(tasks: &[Task], read: &dyn Fn(&Model) -> Vec<f64>) -> Vec<Vec<Cause>> {
    let mut comparisons = judged(tasks, read);
    explain(&mut [Examined::new(tasks, &mut comparisons)])
}

/// What is said of all that is explained, in one list.
fn causes(tasks: &[Task], read: &dyn Fn(&Model) -> Vec<f64>) -> Vec<Cause> {
    let all = found(tasks, read).concat();
    let mut each: Vec<Cause> = vec![];
    for cause in all {
        if !each.iter().any(|other| other.what == cause.what) {
            each.push(cause);
        }
    }
    each
}

/// What a fault of a kind reads, with parameters.
fn with(tasks: &[Task], id: &str, about: &str, parameters: &[f64]) -> impl Fn(&Model) -> Vec<f64> {
    let all = [faults(&[tasks]), kinds(&[tasks])].concat();
    let fault = all.into_iter().find(|f| f.id == id && f.about.contains(about)).unwrap();
    let parameters = parameters.to_vec();
    move |model| fault.readings(model, &parameters).unwrap_or_else(|| model.right.clone())
}

const BOTH: [Transport; 2] = [Transport::Direct, Transport::Indirect(Bounces::Converged)];

#[test]
fn a_factor_is_named_with_its_evidence_and_what_nothing_explains_is_left_unsaid() {
    let tasks = [task(Transport::Direct)];
    let found = |factors: [f64; 4]| causes(&tasks, &|m| m.right.iter().zip(factors).map(|(r, f)| r * f).collect());
    let pi = found([std::f64::consts::PI; 4]);
    assert_eq!(pi[0].id, "factor-pi");
    assert!(pi[0].text().contains(": all 4 readings are 3.1416 ± "), "{}", pi[0].text());
    let unknown = found([1.37; 4]);
    assert_eq!((unknown.len(), unknown[0].id), (1, "factor"));
    assert_eq!(found([1.1, 0.8, 1.3, 0.95]), []);
    assert_eq!(found([1.0; 4]), [], "right readings need no cause");
}

#[test]
fn a_factor_of_readings_that_share_their_noise_is_as_uncertain_as_of_fewer() {
    let tasks = [task(Transport::Direct)];
    let error = |shared: Option<f64>| {
        let mut comparisons = judged(&tasks, &|m| m.right.iter().map(|r| 1.37 * r).collect());
        let design_effects = shared.map(|d| (comparisons[0].key.clone(), d)).into_iter().collect();
        let mut case = [Examined { design_effects, ..Examined::new(&tasks, &mut comparisons) }];
        explain(&mut case)[0][0].evidence.factor.unwrap().1
    };
    assert!((error(Some(4.0)) / error(None) - 2.0).abs() < 1e-9);
}

#[test]
fn light_that_stops_early_is_told_by_the_number_of_its_reflections() {
    let tasks = [task(Transport::Indirect(Bounces::Converged))];
    // Case S1 cut at five reflections, as solved by two other methods.
    let read = vec![0.91170, 1.12222, 1.12222, 1.38492];
    assert_eq!(causes(&tasks, &|_| read.clone())[0].what, "light stops after 5 reflections");
}

#[test]
fn meters_that_face_the_other_way_are_named_and_readings_of_zero_are_dark_and_nothing_else() {
    let tasks = [task(Transport::Indirect(Bounces::Converged))];
    assert_eq!(causes(&tasks, &with(&tasks, "meter-flipped", "", &[]))[0].id, "meter-flipped");
    for tasks in [&tasks[..], &BOTH.map(skew)] {
        let dark = causes(tasks, &|m| vec![0.0; m.right.len()]);
        assert_eq!(dark.iter().map(|c| c.id).collect::<Vec<_>>(), ["dark"]);
    }
}

#[test]
fn kinds_with_parameters_are_fitted_over_all_procedures_at_once() {
    let tasks = BOTH.map(skew);
    for (id, about, parameters) in [
        ("reflectance", "the ceiling", &[0.6][..]),
        ("reflectances", "", &[0.8]),
        ("place", "", &[0.4, -0.3, 0.2]),
        ("turn", "turn", &[35.0]),
        ("tilt", "", &[6.0, -11.0]),
        ("lifted", "", &[0.3]),
    ] {
        let named = causes(&tasks, &with(&tasks, id, about, parameters));
        let is_meant = |c: &&Cause| c.id == id || (id == "turn" && c.about == "turn");
        let cause = named.iter().find(is_meant).unwrap_or_else(|| panic!("{id}: {named:?}"));
        assert!(named.len() <= 2, "{id}: {named:?}");
        for ((value, error), right) in cause.parameters.iter().zip(parameters) {
            assert!((value - right).abs() < 4.0 * error + 0.01 * right.abs(), "{id}: {}", cause.what);
        }
    }
}

#[test]
fn one_luminaire_of_two_is_told_by_its_flux() {
    let mut tasks = BOTH.map(skew);
    for task in &mut tasks {
        let other = luminaire::scene::Luminaire { id: "other".into(), ..task.scene.luminaires[0].clone() };
        task.scene.luminaires.push(other);
        task.scene.luminaires[1].position_m = glam::DVec3::new(14.0, 15.0, 12.0);
    }
    let named = causes(&tasks, &with(&tasks, "flux", "flux of other", &[1.3]));
    assert_eq!((named.len(), named[0].about.as_str()), (1, "flux of other"), "{named:?}");
}

#[test]
fn meters_in_another_order_are_named() {
    let tasks = BOTH.map(skew);
    for id in ["reversed", "next", "previous"] {
        assert_eq!(causes(&tasks, &with(&tasks, id, "", &[]))[0].id, id);
    }
}

#[test]
fn two_faults_at_once_are_named_both() {
    let tasks = BOTH.map(skew);
    let all = faults(&[&tasks]);
    let of = |id: &str| all.iter().find(|f| f.id == id).unwrap();
    for (one, other) in [("c-mirrored", "upside-down"), ("factor-pi", "gamma-flipped")] {
        let both = of(one).and(of(other));
        let named = causes(&tasks, &|m| both.readings(m, &[]).unwrap_or_else(|| m.right.clone()));
        let names = |c: &Cause| [one, other].iter().all(|id| c.what.contains(&of(id).what));
        assert!(named.iter().any(|c| c.id == "two" && names(c)), "{one}, {other}: {named:?}");
    }
}

#[test]
fn what_other_scenes_contradict_is_not_named() {
    // Squared lux look like squared candela on a sphere of meters, and nowhere else.
    let tasks: Vec<Task> = known::tasks().into_iter().filter(|t| t.transport == Transport::Direct).collect();
    let squared = |m: &Model| m.right.iter().map(|r| r * r).collect();
    assert_eq!(causes(&tasks, &squared), []);
    let candela = causes(&tasks, &with(&tasks, "candela-squared", "", &[]));
    assert_eq!(candela.len(), 1);
    assert_eq!(candela[0].id, "candela-squared");
}

/// What an adapter of a newcomer's does wrong is named by the scenes of known answer alone, as what it is about.
#[test]
fn scenes_of_known_answer_name_what_newcomers_do() {
    let tasks: Vec<Task> = known::tasks().into_iter().filter(|t| t.transport == Transport::Direct).collect();
    let of = |aspect: Aspect, ids: &[&'static str]| {
        for id in ids {
            let named = causes(&tasks, &with(&tasks, id, "", &[]));
            assert_eq!(named.iter().map(|c| (c.id, c.aspect())).collect_vec(), [(*id, aspect)], "{named:?}");
        }
    };
    of(Aspect::Units, &["factor-pi", "factor-2pi", "feet", "millimetres", "kilo", "flux-scale-twice", "distance"]);
    let rotated = ["unrotated", "rotated-back", "one-table", "one-table-scaled"];
    let in_c = ["c-mirrored", "c-mirrored-90", "c-turned-90", "c-turned-180", "one-plane", "gamma-flipped"];
    of(Aspect::Orientation, &[&rotated[..], &in_c].concat());
    of(Aspect::Orientation, &["cosine-missing", "two-sided", "normals-ignored", "meter-flipped", "meters-up"]);
    of(Aspect::Light, &["one-lit"]);
    let offset = causes(&tasks, &with(&tasks, "offset", "", &[0.5]));
    assert_eq!(offset.iter().map(|c| c.id).collect_vec(), ["offset"], "{offset:?}");
}

#[test]
fn what_no_fault_does_is_left_unsaid() {
    let tasks = BOTH.map(skew);
    let mean = |m: &Model| m.right.iter().sum::<f64>() / m.right.len() as f64;
    let power = |m: &Model| m.right.iter().map(|r| mean(m) * (r / mean(m)).powf(1.1)).collect();
    assert_eq!(causes(&tasks, &power), []);
}

#[test]
fn what_looks_like_a_fault_in_few_coarse_readings_and_not_in_most_is_left_unsaid() {
    let light = [Transport::Direct, Transport::Indirect(Bounces::Converged)];
    let (most, few) = (light.map(skew), light.map(task));
    // As if all surfaces reflected more, but for a part of a percent that only fine readings tell.
    let brighter = |m: &Model| -> Vec<f64> {
        let uneven = |k: usize| if k.is_multiple_of(2) { 1.083 } else { 1.077 };
        let factor = |k| if m.task.transport == Transport::Direct { 1.0 } else { uneven(k) };
        m.right.iter().enumerate().map(|(k, r)| factor(k) * r).collect()
    };
    let read = |error, tasks: &[Task]| tasks.iter().flat_map(|task| judged_to(error, task, &brighter)).collect_vec();
    let (mut fine, mut coarse) = (read(1e-4, &most), read(5e-3, &few));
    assert!(coarse.iter().any(|c| c.verdict == Verdict::Fail));
    assert_eq!(explain(&mut [Examined::new(&most, &mut fine), Examined::new(&few, &mut coarse)]).concat(), []);
}
