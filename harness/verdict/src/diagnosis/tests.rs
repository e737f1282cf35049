//! Which causes the diagnosis names, and which failures it leaves unnamed.

use itertools::Itertools;
use luxproof_scene::{Bounces, Transport};

use super::*;
use crate::fixtures::built_in;
use luxproof_engines::fixtures;
use luxproof_model::{Estimate, MeterId, Quantity, Reading, ReadingKey, Recording, Uncertainty};
use luxproof_spec::procedures::{Target, known};

/// Four meters of case S1; a fit needs more.
fn task(transport: Transport) -> Task {
    let job = fixtures::s1(transport);
    let mut targets = vec![];
    for (k, sensor) in job.sensors.iter().enumerate() {
        targets.push(Target::of_one(MeterId::new("m", k), sensor.meter, 1.0));
    }
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
    let mut targets = vec![];
    for (k, (x, y)) in places.into_iter().enumerate() {
        let mut meter = task.targets[0].meter;
        meter.position_m = glam::DVec3::new(x, y, 1.0 + 0.3 * k as f64);
        meter.normal = if k % 3 == 2 { glam::DVec3::X } else { glam::DVec3::Z };
        targets.push(Target::of_one(MeterId::new("m", k), meter, 1.0));
    }
    Task { targets, ..task }
}

/// What an engine reads of tasks, judged.
fn judged(tasks: &[Task], read: &dyn Fn(&Model) -> Vec<f64>) -> Vec<Comparison> {
    tasks.iter().flat_map(|task| judged_to(1e-4, task, read)).collect()
}

/// The same of one task, to a relative error.
fn judged_to(error: f64, task: &Task, read: &dyn Fn(&Model) -> Vec<f64>) -> Vec<Comparison> {
    let right = truth(task).unwrap();
    let model = Model::new(0, task, right.clone());
    let all = [
        recording(task, "iesna", &right, 0.0),
        recording(task, "simulator", &right, 0.0),
        recording(task, "radiance", &read(&model), error),
    ];
    let mut comparisons = built_in().compare(task, &all.iter().collect::<Vec<_>>());
    comparisons.retain(|c| c.key.engine == "radiance");
    comparisons
}

/// Readings of a task with a relative standard error.
fn recording(task: &Task, engine: &str, values: &[f64], error: f64) -> Recording {
    let mut readings = vec![];
    for (target, value) in task.targets.iter().zip(values) {
        let estimate = Estimate { value: *value, uncertainty: Uncertainty::sampled(error * value, None) };
        readings.push(Reading::new(target.id.clone(), task.quantity, estimate));
    }
    Recording { readings, ..Recording::of(ReadingKey::new("case", task.procedure, engine), task.light()) }
}

fn found(tasks: &[Task], read: &dyn Fn(&Model) -> Vec<f64>) -> Vec<Vec<Cause>> {
    let mut comparisons = judged(tasks, read);
    explain(&mut [Examined::new(tasks, &mut comparisons)])
}

/// All different causes, in one list.
pub(super) fn causes(tasks: &[Task], read: &dyn Fn(&Model) -> Vec<f64>) -> Vec<Cause> {
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

/// The causes where each meter has a factor.
fn causes_of_factors(tasks: &[Task], factors: [f64; 4]) -> Vec<Cause> {
    causes(tasks, &|m| m.right.iter().zip(factors).map(|(r, f)| r * f).collect())
}

#[test]
fn a_factor_is_named_with_its_evidence_and_what_nothing_explains_is_left_unnamed() {
    let tasks = [task(Transport::Direct)];
    let pi = causes_of_factors(&tasks, [std::f64::consts::PI; 4]);
    assert_eq!(pi[0].id, "factor-pi");
    assert!(pi[0].text().contains(": all 4 readings are 3.1416 ± "), "{}", pi[0].text());
    let unknown = causes_of_factors(&tasks, [1.37; 4]);
    assert_eq!((unknown.len(), unknown[0].id), (1, "factor"));
    assert_eq!(causes_of_factors(&tasks, [1.1, 0.8, 1.3, 0.95]), []);
    assert_eq!(causes_of_factors(&tasks, [1.0; 4]), [], "right readings need no cause");
}

#[test]
fn a_factor_of_readings_that_share_their_noise_is_as_uncertain_as_of_fewer() {
    let tasks = [task(Transport::Direct)];
    let errors = [None, Some(4.0)].map(|shared| {
        let mut comparisons = judged(&tasks, &|m| m.right.iter().map(|r| 1.37 * r).collect());
        let design_effects = shared.map(|d| (comparisons[0].key.clone(), d)).into_iter().collect();
        let mut case = [Examined { design_effects, ..Examined::new(&tasks, &mut comparisons) }];
        explain(&mut case)[0][0].evidence.factor.unwrap().1
    });
    assert!((errors[1] / errors[0] - 2.0).abs() < 1e-9);
}

#[test]
fn light_that_stops_early_is_named_by_the_number_of_its_reflections() {
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
        let mut matching = named.iter().filter(|c| c.id == id || (id == "turn" && c.about == "turn"));
        let cause = matching.next().unwrap_or_else(|| panic!("{id}: {named:?}"));
        assert!(named.len() <= 2, "{id}: {named:?}");
        for ((value, error), right) in cause.parameters.iter().zip(parameters) {
            assert!((value - right).abs() < 4.0 * error + 0.01 * right.abs(), "{id}: {}", cause.what);
        }
    }
}

#[test]
fn one_luminaire_of_two_is_named_by_its_flux() {
    let mut tasks = BOTH.map(skew);
    for task in &mut tasks {
        let other = luxproof_scene::Luminaire { id: "other".into(), ..task.scene.luminaires[0].clone() };
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
fn meters_in_the_reverse_order_of_a_job_of_several_sets_are_named() {
    let mut task = skew(Transport::Direct);
    for (k, target) in task.targets.iter_mut().enumerate() {
        target.id = MeterId::new(if k < 5 { "desk" } else { "wall" }, k);
    }
    let named = causes(&[task], &|m| m.right.iter().rev().copied().collect());
    assert_eq!((named.len(), named[0].what.as_str()), (1, "meters are read in the reverse order"), "{named:?}");
}

#[test]
fn readings_of_eight_bits_are_named_with_their_step_in_lux() {
    let mut task = skew(Transport::Direct);
    // Brighter than 255 lx in part; the intensities of the other task are far larger numbers.
    task.scene.luminaires[0].flux_scale = 60.0;
    let mut intensity = task.clone();
    intensity.procedure = ProcedureId::LuminousIntensity;
    intensity.quantity = Quantity::LuminousIntensity;
    intensity.targets.iter_mut().for_each(|t| t.aspects[0].weight = 100.0);
    let named = causes(&[task, intensity], &|m| {
        let weights = m.task.targets.iter().map(|t| t.aspects[0].weight);
        m.right.iter().zip(weights).map(|(right, weight)| (right / weight).min(255.0).round() * weight).collect()
    });
    assert!(named.len() == 1 && named[0].what.contains("multiples of 1.0000 lx, at most 255"), "{named:?}");
}

#[test]
fn two_faults_at_once_are_named_both() {
    let tasks = BOTH.map(skew);
    let all = faults(&[&tasks]);
    for (one, other) in [("c-mirrored", "upside-down"), ("factor-pi", "gamma-flipped")] {
        let [one, other] = [one, other].map(|id| all.iter().find(|f| f.id == id).unwrap());
        let both = one.and(other);
        let named = causes(&tasks, &|m| both.readings(m, &[]).unwrap_or_else(|| m.right.clone()));
        let is_named =
            named.iter().any(|c| c.id == "two" && [one, other].iter().all(|fault| c.what.contains(&fault.what)));
        assert!(is_named, "{}, {}: {named:?}", one.id, other.id);
    }
}

#[test]
fn what_other_scenes_contradict_is_not_named() {
    // Squared lux look like squared candela on a sphere of meters, and nowhere else.
    let tasks: Vec<Task> = known::tasks().into_iter().filter(|t| t.transport == Transport::Direct).collect();
    let squared = causes(&tasks, &|m| m.right.iter().map(|r| r * r).collect());
    let name = "readings in lux are raised to the power of 2.0000";
    assert!(squared.len() == 1 && squared[0].what.starts_with(name), "{squared:?}");
    let candela = causes(&tasks, &with(&tasks, "candela-squared", "", &[]));
    assert_eq!(candela.len(), 1);
    assert_eq!(candela[0].id, "candela-squared");
}

/// Each fault is named by the scenes of known answer alone, as one of this aspect.
fn assert_named(tasks: &[Task], aspect: Aspect, ids: &[&'static str]) {
    for id in ids {
        let named = causes(tasks, &with(tasks, id, "", &[]));
        assert_eq!(named.iter().map(|c| (c.id, c.aspect())).collect_vec(), [(*id, aspect)], "{named:?}");
    }
}

#[test]
fn scenes_of_known_answer_name_what_newcomers_do() {
    let tasks: Vec<Task> = known::tasks().into_iter().filter(|t| t.transport == Transport::Direct).collect();
    assert_named(
        &tasks,
        Aspect::Units,
        &["factor-pi", "factor-2pi", "feet", "millimetres", "kilo", "flux-scale-twice", "distance"],
    );
    let rotated = ["unrotated", "rotated-back", "one-table", "one-table-scaled"];
    let in_c = ["c-mirrored", "c-mirrored-90", "c-turned-90", "c-turned-180", "one-plane", "gamma-flipped"];
    assert_named(&tasks, Aspect::Orientation, &[&rotated[..], &in_c].concat());
    assert_named(
        &tasks,
        Aspect::Orientation,
        &["cosine-missing", "two-sided", "normals-ignored", "meter-flipped", "meters-up"],
    );
    assert_named(&tasks, Aspect::Light, &["one-lit"]);
    let offset = causes(&tasks, &with(&tasks, "offset", "", &[0.5]));
    assert_eq!(offset.iter().map(|c| c.id).collect_vec(), ["offset"], "{offset:?}");
}

#[test]
fn what_no_fault_does_is_left_unnamed() {
    let tasks = BOTH.map(skew);
    let found = causes(&tasks, &|m| {
        let mean = m.right.iter().sum::<f64>() / m.right.len() as f64;
        m.right.iter().map(|r| mean * (r / mean).powf(1.1)).collect()
    });
    assert_eq!(found, []);
}

#[test]
fn squared_lux_is_named_with_its_power() {
    let tasks = BOTH.map(skew);
    let named = causes(&tasks, &|m| m.right.iter().map(|r| r * r).collect());
    assert!(
        named.len() == 1 && named[0].what.starts_with("readings in lux are raised to the power of 2.0000"),
        "{named:?}"
    );
}

#[test]
fn readings_that_are_rightly_the_same_everywhere_show_no_shape() {
    let furnace: Vec<Task> = known::tasks().into_iter().filter(|t| t.procedure == ProcedureId::Furnace).collect();
    let squared = causes(&furnace, &|m| m.right.iter().map(|r| r * r).collect());
    assert!(squared.iter().all(|c| c.id != "same"), "{squared:?}");
    let tasks = [skew(Transport::Direct)];
    let same = causes(&tasks, &|m| vec![m.right[0]; m.right.len()]);
    assert_eq!(same.iter().map(|c| c.id).collect_vec(), ["same"], "{same:?}");
}

/// Readings as if all surfaces reflected more, except for a part of a percent that only fine readings show.
fn judged_brighter(error: f64, tasks: &[Task]) -> Vec<Comparison> {
    let brighter = |m: &Model| {
        let factors: [f64; 2] = if m.task.transport == Transport::Direct { [1.0, 1.0] } else { [1.083, 1.077] };
        m.right.iter().enumerate().map(|(k, r)| factors[k % 2] * r).collect()
    };
    tasks.iter().flat_map(|task| judged_to(error, task, &brighter)).collect()
}

#[test]
fn what_looks_like_a_fault_in_few_coarse_readings_and_not_in_most_is_left_unnamed() {
    let light = [Transport::Direct, Transport::Indirect(Bounces::Converged)];
    let (most, few) = (light.map(skew), light.map(task));
    let (mut fine, mut coarse) = (judged_brighter(1e-4, &most), judged_brighter(5e-3, &few));
    assert!(coarse.iter().any(|c| c.verdict == Verdict::Fail));
    assert_eq!(explain(&mut [Examined::new(&most, &mut fine), Examined::new(&few, &mut coarse)]).concat(), []);
}

/// The texts of failing ratings that are all off by so much.
fn rating_diagnoses(offset: f64) -> Vec<String> {
    let mut task = crate::fixtures::task(3);
    (task.procedure, task.quantity) = (ProcedureId::UnifiedGlareRating, luxproof_model::Quantity::GlareRating);
    let recordings = [("simulator", 0.0), ("radiance", offset)].map(|(engine, offset)| {
        let ratings = [14.0, 17.5, 21.0].map(|ugr| luxproof_model::Estimate::exact(ugr + offset));
        let mut recording = crate::fixtures::recording(engine, &ratings);
        recording.key.procedure = ProcedureId::UnifiedGlareRating;
        recording.readings.iter_mut().for_each(|r| r.quantity = luxproof_model::Quantity::GlareRating);
        recording
    });
    let mut comparisons = crate::fixtures::built_in().compare(&task, &[&recordings[0], &recordings[1]]);
    describe_unexplained(&mut [Examined::new(&[task], &mut comparisons)]);
    comparisons.into_iter().filter_map(|c| c.diagnosis).collect()
}

#[test]
fn ratings_that_are_all_off_by_the_same_have_a_factor_in_their_formula() {
    // UGR = 8 lg(0.25 / Lb x ...): pi in the background is 8 lg pi = 3.977.
    let texts = rating_diagnoses(-3.977);
    assert_eq!(texts.len(), 3);
    assert!(
        texts[0].starts_with("the background luminance is pi times too large") && texts[0].contains("-3.98"),
        "{texts:?}"
    );
    assert!(rating_diagnoses(1.0)[0].starts_with("factor 1.334 in the formula"), "{:?}", rating_diagnoses(1.0));
}

#[test]
fn a_failure_without_a_known_cause_says_what_its_deviations_go_along_with() {
    let tasks = [task(Transport::Direct)];
    let factors = [1.1, 0.8, 1.3, 0.95];
    let mut comparisons = judged(&tasks, &|m| m.right.iter().zip(factors).map(|(r, f)| r * f).collect());
    let mut case = [Examined::new(&tasks, &mut comparisons)];
    diagnose(&mut case);
    describe_unexplained(&mut case);
    for c in comparisons.iter().filter(|c| c.verdict == Verdict::Fail) {
        let text = c.diagnosis.as_deref().unwrap_or_default();
        assert!(text.starts_with("no known cause: -20.0 to +30.0 % at 4 of 4 readings"), "{text}");
    }
}

#[test]
fn light_by_another_law_of_distance_is_named_with_its_parameter() {
    let tasks = BOTH.map(skew);
    for (about, parameter) in [("power of distance", 1.7), ("softened", 3.0), ("shifted distance", 1.2)] {
        let named = causes(&tasks, &with(&tasks, "law", about, &[parameter]));
        assert!(named.iter().any(|c| c.about == about), "{about}: {named:?}");
    }
}
