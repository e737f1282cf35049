//! Light, readings and costs of faulty tasks, by hand.

use std::f64::consts::FRAC_1_SQRT_2;

use luxproof_engines::fixtures;
use luxproof_model::{MeterId, ProcedureId, Quantity};
use luxproof_photometry::LuminousIntensityDistribution as Table;
use luxproof_spec::procedures::Aspect;

use super::*;

/// A luminaire 2 m above the origin, with candela that fall evenly from 100 at the nadir to 0 at the horizon.
fn lamp(id: &str) -> Luminaire {
    let table = Table::axial(vec![0.0, 90.0], vec![100.0, 0.0]).unwrap();
    fixtures::luminaire(id, DVec3::new(0.0, 0.0, 2.0), table)
}

fn meter(x: f64, normal: DVec3) -> Meter {
    Meter { position_m: DVec3::new(x, 0.0, 0.0), normal }
}

/// Direct light without a room: below the luminaire, 2 m beside that, and there facing down.
fn open(luminaires: Vec<Luminaire>) -> Task {
    let meters = [meter(0.0, DVec3::Z), meter(2.0, DVec3::Z), meter(2.0, DVec3::NEG_Z)];
    let targets = meters.into_iter().enumerate().map(|(k, m)| Target::of_one(MeterId::new("m", k), m, 1.0)).collect();
    let scene = Scene { luminaires, ..Scene::default() };
    Task {
        procedure: ProcedureId::DirectIlluminance,
        scene,
        transport: Transport::Direct,
        quantity: Quantity::Illuminance,
        targets,
    }
}

/// What the three meters rightly read: 100/4, and 50 cd at 45 degrees, a distance of root 8 and a cosine of .7071.
const RIGHT_LX: [f64; 3] = [25.0, 50.0 * FRAC_1_SQRT_2 / 8.0, 0.0];

#[track_caller]
fn assert_all_near(found: &[f64], expected: &[f64]) {
    let is_near = found.iter().zip(expected).all(|(f, e)| (f - e).abs() < 1e-9 * e.abs().max(1.0));
    assert!(found.len() == expected.len() && is_near, "{found:?} for {expected:?}");
}

fn model(task: &Task) -> Model {
    Model::new(0, task, truth(task).unwrap())
}

#[test]
fn each_law_changes_what_it_is_about() {
    let task = open(vec![lamp("a")]);
    assert_all_near(&truth(&task).unwrap(), &RIGHT_LX);
    let [near, far, _] = RIGHT_LX;
    let right = Law::RIGHT;
    for (law, expected) in [
        (right, RIGHT_LX),
        (Law { cosine: 0.0, ..right }, [near, 6.25, 0.0]),
        (Law { cosine: 2.0, ..right }, [near, 3.125, 0.0]),
        (Law { is_two_sided: true, ..right }, [near, far, far]),
        (Law { intensity: 2, ..right }, [2500.0, 50.0 * far, 0.0]),
        // The angle at the luminaire is 45 degrees, too.
        (Law { emission: 1.0, ..right }, [near, 3.125, 0.0]),
        (Law { emission: 3.0, ..right }, [near, 6.25 / 4.0, 0.0]),
        (Law { distance: DistanceLaw::Power(1.0), ..right }, [50.0, 12.5, 0.0]),
        // 2² + 1² and 8 + 1; 3 and root 8 at least; 1 more than 2 and root 8.
        (Law { distance: DistanceLaw::Softened(1.0), ..right }, [20.0, far * 8.0 / 9.0, 0.0]),
        (Law { distance: DistanceLaw::AtLeast(2.5), ..right }, [16.0, far, 0.0]),
        (
            Law { distance: DistanceLaw::Shifted { by_m: 1.0, power: 2.0 }, ..right },
            [100.0 / 9.0, far * 8.0 / (1.0 + 8f64.sqrt()).powi(2), 0.0],
        ),
        (Law { distance: DistanceLaw::CutOff(2.5), ..right }, [near, 0.0, 0.0]),
        // 1 - (2/4)² and 1 - 8/16, squared.
        (
            Law { distance: DistanceLaw::Window { range_m: 4.0, steepness: 2, power: 2 }, ..right },
            [near * 0.5625, far * 0.25, 0.0],
        ),
        (
            Law { distance: DistanceLaw::Window { range_m: 2.5, steepness: 3, power: 1 }, ..right },
            [near * (1.0 - 0.512), 0.0, 0.0],
        ),
    ] {
        let faulty = FaultyTask { law, ..FaultyTask::new(&task) };
        assert_all_near(&model(&task).predict(&faulty, Fidelity::Fine).unwrap(), &expected);
    }
}

#[test]
fn behind_bodies_another_law_is_known_for_one_point_alone() {
    let mut task = open(vec![lamp("a")]);
    task.scene.obstacles = fixtures::s2(vec![], Transport::Direct).scene.obstacles;
    let squared = Law { cosine: 2.0, ..Law::RIGHT };
    let solve = |luminaires: Vec<Luminaire>, law: Law| {
        solve_direct(&Scene { luminaires, ..task.scene.clone() }, &meters(&task), law)
    };
    let (right, other) = (solve(vec![lamp("a")], Law::RIGHT).unwrap(), solve(vec![lamp("a")], squared).unwrap());
    assert!(right.iter().zip(&other).all(|(right, other)| (*right == 0.0) == (*other == 0.0)), "{right:?} {other:?}");
    assert!(solve(vec![lamp("a"), lamp("b")], Law::RIGHT).is_some());
    assert!(solve(vec![lamp("a"), lamp("b")], squared).is_none());
    let opening = Luminaire { model: LuminaireModel::Area, ..lamp("a") };
    assert!(solve(vec![opening], squared).is_none());
}

#[test]
fn of_several_luminaires_all_count_or_the_brightest_alone() {
    let double = Luminaire { flux_scale: 2.0, ..lamp("b") };
    let task = open(vec![lamp("a"), double]);
    assert_all_near(&truth(&task).unwrap(), &RIGHT_LX.map(|x| 3.0 * x));
    let law = Law { counts_brightest_only: true, ..Law::RIGHT };
    let faulty = FaultyTask { law, ..FaultyTask::new(&task) };
    assert_all_near(&model(&task).predict(&faulty, Fidelity::Fine).unwrap(), &RIGHT_LX.map(|x| 2.0 * x));
}

#[test]
fn luminaires_are_scaled_one_by_one_where_they_have_a_factor() {
    let single = open(vec![lamp("a")]);
    let mut faulty = FaultyTask::new(&single);
    assert!(!faulty.scale_luminaires(|_| None) && faulty.factor == 1.0);
    assert!(faulty.scale_luminaires(|_| Some(0.5)) && faulty.scale_luminaires(|_| Some(3.0)));
    assert!(faulty.factor == 1.5 && !faulty.has_other_light());
    let both = open(vec![lamp("a"), Luminaire { flux_scale: 2.0, ..lamp("b") }]);
    let mut faulty = FaultyTask::new(&both);
    assert!(!faulty.scale_luminaires(|_| None) && !faulty.has_other_light());
    assert!(faulty.scale_luminaires(|l| (l.id == "b").then_some(0.25)));
    assert!(faulty.factor == 1.0 && faulty.has_other_light());
    // 1 + 2 / 4.
    assert_all_near(&model(&both).predict(&faulty, Fidelity::Fine).unwrap(), &RIGHT_LX.map(|x| 1.5 * x));
}

#[test]
fn readouts_follow_one_another() {
    for (readout, expected) in [
        (Readout::AtMost(3.0), 3.0),
        (Readout::AtMost(5.0), 4.0),
        (Readout::AtLeast(5.0), 5.0),
        (Readout::AtLeast(3.0), 4.0),
        (Readout::Plus(1.5), 5.5),
        (Readout::Plus(-5.0), 0.0),
        (Readout::Power { exponent: 2.0, level: 1.0 }, 16.0),
        (Readout::Power { exponent: 2.0, level: 8.0 }, 2.0),
        (Readout::Power { exponent: 0.0, level: 7.0 }, 7.0),
        (Readout::Step(1.5, Rounding::Nearest), 4.5),
        (Readout::Step(1.5, Rounding::Down), 3.0),
        (Readout::Step(3.0, Rounding::Nearest), 3.0),
        (Readout::Step(3.0, Rounding::Up), 6.0),
        (Readout::Order(Order::Next, Sequence::Set), 4.0),
    ] {
        assert_all_near(&[readout.apply(4.0)], &[expected]);
    }
    let task = open(vec![lamp("a")]);
    let mut faulty = FaultyTask { factor: 0.5, ..FaultyTask::new(&task) };
    faulty.readouts = vec![Readout::Plus(1.0), Readout::AtMost(5.0), Readout::Order(Order::Reversed, Sequence::Set)];
    assert_all_near(&model(&task).predict(&faulty, Fidelity::Fine).unwrap(), &[1.0, 1.0 + 0.5 * RIGHT_LX[1], 5.0]);
}

#[test]
fn meters_are_reordered_within_their_set_or_their_job() {
    let places = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [0.0, 1.0], [1.0, 1.0], [2.0, 1.0]];
    let grid = places.map(|[x, y]| DVec3::new(x, y, 0.0));
    let sources = |order: Order| -> Vec<Option<usize>> { (0..6).map(|k| order.source(k, &grid)).collect() };
    assert_eq!(sources(Order::Reversed), [5, 4, 3, 2, 1, 0].map(Some));
    assert_eq!(sources(Order::Next), [1, 2, 3, 4, 5, 0].map(Some));
    assert_eq!(sources(Order::Previous), [5, 0, 1, 2, 3, 4].map(Some));
    // Two rows of three, read by columns.
    assert_eq!(sources(Order::Exchanged), [0, 3, 1, 4, 2, 5].map(Some));
    assert_eq!(Order::Exchanged.source(1, &grid[..5]), None, "rows of three and of two");
    assert_eq!(Order::Exchanged.source(1, &grid[..3]), None, "one row");
    assert_eq!(Order::Exchanged.source(0, &grid[..1]), None);

    let mut task = open(vec![lamp("a")]);
    for (target, set) in task.targets.iter_mut().zip(["m", "n", "n"]) {
        target.id = MeterId::new(set, 0);
    }
    let read = [1.0, 2.0, 3.0];
    assert_eq!(Order::Reversed.apply(Sequence::Set, &task, &read), Some(vec![1.0, 3.0, 2.0]));
    assert_eq!(Order::Reversed.apply(Sequence::Job, &task, &read), Some(vec![3.0, 2.0, 1.0]));
    assert_eq!(Order::Exchanged.apply(Sequence::Job, &task, &read), None);
}

#[test]
fn right_light_is_spread_evenly_over_the_sensors_of_a_target() {
    let mut task = open(vec![lamp("a")]);
    let aspects = [0.5, 1.5].map(|weight| Aspect { meter: meter(0.0, DVec3::Z), weight });
    task.targets[0].aspects = aspects.to_vec();
    task.targets[1].aspects[0].weight = 0.0;
    let model = Model::new(0, &task, vec![50.0, 7.0, 3.0]);
    assert_all_near(&model.spread_evenly(), &[25.0, 25.0, 0.0, 3.0]);
    assert_all_near(&sum_aspects(&task, &[10.0, 20.0, 30.0, 40.0]), &[35.0, 0.0, 40.0]);
    // The corrections of the right light: 50 are read for 2 * 25, darkness has none.
    assert_all_near(&model.predict(&FaultyTask::new(&task), Fidelity::Fine).unwrap(), &[50.0, 0.0, 0.0]);
}

#[test]
fn predictions_are_corrected_by_the_reference_where_both_have_much_in_common() {
    let task = open(vec![lamp("a")]);
    let light = Light { direct: vec![100.0, 200.0, 0.0], reflected: vec![40.0, 80.0, 10.0] };
    for (right, fidelity, expected) in [
        ([110.0, 180.0, 5.0], Fidelity::Fine, [1.1, 0.9, 1.0]),
        ([124.0, 252.0, 0.0], Fidelity::Fine, [1.24, 1.0, 1.0]),
        ([150.0, -1.0, 0.0], Fidelity::Rough, [1.5, 1.0, 1.0]),
    ] {
        assert_all_near(&corrections(&task, &light, &right, fidelity), &expected);
    }
    let total = Task { transport: Transport::Total(Bounces::Converged), ..task };
    // (150 - 100) / 40 is too far; (150 - 100) / 40 counts where it is rough; (272 - 200) / 80 = .9.
    assert_all_near(&corrections(&total, &light, &[150.0, 272.0, 11.0], Fidelity::Fine), &[1.0, 0.9, 1.1]);
    assert_all_near(&corrections(&total, &light, &[150.0, 272.0, 11.0], Fidelity::Rough), &[1.25, 0.9, 1.1]);

    // Of light asked for the correction is, and none of what a fault adds.
    let light = Light { direct: vec![10.0, 20.0, 30.0], reflected: vec![1.0, 2.0, 3.0] };
    let direct = Model::new(0, &open(vec![lamp("a")]), vec![0.0; 3]);
    assert_all_near(&direct.correct(&light, &[2.0, 3.0, 0.5]), &[21.0, 62.0, 18.0]);
    assert_all_near(&Model::new(0, &total, vec![0.0; 3]).correct(&light, &[2.0, 3.0, 0.5]), &[12.0, 26.0, 31.5]);
}

/// Reflected light in the room of case S1.
fn reflected(bounces: Bounces) -> Task {
    let job = fixtures::s1(Transport::Indirect(bounces));
    let targets = job.sensors.iter().map(|s| Target::of_one(s.id.clone(), s.meter, 1.0)).collect();
    Task {
        procedure: job.procedure,
        scene: job.scene,
        transport: job.transport,
        quantity: Quantity::Illuminance,
        targets,
    }
}

#[test]
fn single_reflections_count_as_often_as_they_are_weighted() {
    let task = reflected(Bounces::Converged);
    let model = model(&task);
    // Light of so many reflections, by the simulator.
    let up_to: Vec<Vec<f64>> = (1..=24).map(|n| truth(&reflected(Bounces::AtMost(n))).unwrap()).collect();
    for (bounce, weight) in [(1, 0.5), (2, 0.0), (3, 2.5)] {
        let mut faulty = FaultyTask::new(&task);
        assert!(faulty.weight_reflection(bounce, weight));
        let found = model.predict(&faulty, Fidelity::Fine).unwrap();
        for (k, found) in found.iter().enumerate() {
            let before = if bounce == 1 { 0.0 } else { up_to[bounce as usize - 2][k] };
            let expected = model.right[k] + (weight - 1.0) * (up_to[bounce as usize - 1][k] - before);
            assert!((found / expected - 1.0).abs() < 1e-3, "{bounce} {weight} {k}: {found} for {expected}");
        }
    }
    for (weight, tolerance) in [(0.5, 1e-3), (0.0, 1e-3), (1.2, 4e-3)] {
        let mut faulty = FaultyTask::new(&task);
        assert!(faulty.weight_later_reflections(weight));
        let found = model.predict(&faulty, Fidelity::Fine).unwrap();
        for (k, found) in found.iter().enumerate() {
            let steps = up_to.windows(2).enumerate();
            let later: f64 = steps.map(|(n, pair)| weight.powi(n as i32 + 1) * (pair[1][k] - pair[0][k])).sum();
            let expected = up_to[0][k] + later;
            assert!((found / expected - 1.0).abs() < tolerance, "{weight} {k}: {found} for {expected}");
        }
    }
    // A ceiling of .8 would reflect all light.
    let mut faulty = FaultyTask::new(&task);
    assert!(faulty.weight_later_reflections(1.25) && model.predict(&faulty, Fidelity::Fine).is_none());
}

#[test]
fn reflections_are_weighted_where_a_task_follows_light_so_far() {
    for (transport, first, third, later) in [
        (Transport::Direct, false, false, false),
        (Transport::Indirect(Bounces::AtMost(1)), true, false, false),
        (Transport::Total(Bounces::AtMost(2)), true, false, true),
        (Transport::Total(Bounces::AtMost(3)), true, true, true),
        (Transport::Indirect(Bounces::Converged), true, true, true),
    ] {
        let task = Task { transport, ..reflected(Bounces::Converged) };
        assert_eq!(FaultyTask::new(&task).weight_reflection(1, 0.5), first, "{transport:?}");
        assert_eq!(FaultyTask::new(&task).weight_reflection(3, 0.5), third, "{transport:?}");
        assert_eq!(FaultyTask::new(&task).weight_later_reflections(0.5), later, "{transport:?}");
    }
    let without_room = Task { transport: Transport::Indirect(Bounces::Converged), ..open(vec![lamp("a")]) };
    assert!(!FaultyTask::new(&without_room).weight_later_reflections(0.5));
}

#[test]
fn targets_near_two_surfaces_are_blank_in_rough_predictions() {
    // Two per cent of 20 m.
    let at = |x: f64, y: f64, z: f64| {
        let mut task = reflected(Bounces::Converged);
        task.targets.truncate(1);
        task.targets[0].aspects[0].meter.position_m = DVec3::new(x, y, z);
        Model::new(0, &task, vec![1.0]).is_in_a_corner(&task.targets[0])
    };
    assert!(at(0.39, 10.0, 0.39) && at(19.61, 10.0, 19.61) && at(0.39, 19.61, 10.0));
    assert!(!at(0.39, 10.0, 0.41) && !at(19.59, 10.0, 19.61) && !at(10.0, 10.0, 0.1));

    let mut task = reflected(Bounces::Converged);
    task.targets[0].aspects[0].meter.position_m = DVec3::splat(0.3);
    let model = model(&task);
    let mut faulty = FaultyTask::new(&task);
    assert!(faulty.weight_reflection(1, 0.5));
    let blanks = |fidelity| -> Vec<bool> {
        model.predict_with_blanks(&faulty, fidelity).unwrap().iter().map(|x| x.is_nan()).collect()
    };
    assert_eq!(blanks(Fidelity::Rough), [true, false, false, false]);
    assert_eq!(blanks(Fidelity::Fine), [false; 4]);
}

#[test]
fn the_cost_of_a_prediction_is_counted() {
    let task = open(vec![lamp("a"), lamp("b")]);
    let direct = model(&task);
    assert_eq!(direct.count_work(&FaultyTask::new(&task), Fidelity::Fine), Work { right: 0, faulty: 3 });
    // Two luminaires at three meters, and the readings.
    let law = FaultyTask { law: Law { cosine: 2.0, ..Law::RIGHT }, ..FaultyTask::new(&task) };
    assert_eq!(direct.count_work(&law, Fidelity::Fine), Work { right: 6, faulty: 9 });
    // A new table of three nodes, which has edges.
    let mut tables = FaultyTask::new(&task);
    tables.scene_mut().luminaires[0].photometry =
        fixtures::photometry(Table::axial(vec![0.0, 10.0, 90.0], vec![1.0, 2.0, 0.0]).unwrap());
    let with_edges = 3 + 3 + edges::SOLUTIONS * 6;
    assert_eq!(direct.count_work(&tables, Fidelity::Fine), Work { right: 6, faulty: with_edges });
    tables.readouts.push(Readout::AtMost(1.0));
    assert_eq!(direct.count_work(&tables, Fidelity::Fine), Work { right: 6, faulty: 3 + 3 + 6 });

    // S1: one luminaire of nine nodes, four meters.
    let task = reflected(Bounces::Converged);
    let model = Model::new(0, &task, vec![1.0; 4]);
    let once = 1_000_000 + 250_000 + 4 * 4_000 + 9 * 50;
    let mut faulty = FaultyTask::new(&task);
    assert!(faulty.weight_reflection(2, 0.5));
    assert_eq!(model.count_work(&faulty, Fidelity::Fine), Work { right: once, faulty: 4 + 3 * once });
    assert!(faulty.weight_later_reflections(0.5));
    assert_eq!(model.count_work(&faulty, Fidelity::Fine), Work { right: once, faulty: 4 + 6 * once });
    let rough = [0, 4].map(|sensors| PatchRadiosity::count_work(1, sensors));
    assert_eq!(model.count_work(&faulty, Fidelity::Rough), Work { right: rough[1], faulty: 4 + 6 * rough[0] });
    faulty.change_meters(|m| m.normal = -m.normal);
    assert_eq!(model.count_work(&faulty, Fidelity::Rough), Work { right: rough[1], faulty: 4 + 6 * rough[1] });

    // Both lights, and a box that may hide a luminaire: only direct light is solved for.
    let mut total = Task { transport: Transport::Total(Bounces::Converged), ..reflected(Bounces::Converged) };
    assert_eq!(count_work(&total, 4, Fidelity::Fine, true), 4 + once);
    total.scene.obstacles = fixtures::s2(vec![], Transport::Direct).scene.obstacles;
    assert_eq!(count_work(&total, 4, Fidelity::Fine, true), 80);
    total.scene.luminaires[0].model = LuminaireModel::Area;
    assert_eq!(count_work(&total, 4, Fidelity::Fine, true), 80_000);
}

#[test]
fn tasks_outside_of_the_room_have_no_prediction() {
    let task = Task { transport: Transport::Direct, ..reflected(Bounces::Converged) };
    let outside = [DVec3::new(20.0, 5.0, 5.0), DVec3::new(5.0, 0.0, 5.0), DVec3::new(5.0, 5.0, 21.0)];
    for place in outside {
        let mut task = task.clone();
        task.targets[0].aspects[0].meter.position_m = place;
        assert!(truth(&task).is_none(), "{place}");
        let mut task = reflected(Bounces::Converged);
        task.scene.luminaires[0].position_m = place;
        assert!(truth(&Task { transport: Transport::Direct, ..task }).is_none(), "{place}");
    }
    let mut dark = task.clone();
    dark.scene.luminaires[0].flux_scale = -1.0;
    assert!(truth(&dark).is_none());
    dark.scene.luminaires[0].flux_scale = 0.0;
    assert_eq!(truth(&dark), Some(vec![0.0; 4]));
    let mut within = task;
    within.targets[0].aspects[0].meter.position_m = within.scene.luminaires[0].position_m;
    assert!(truth(&within).is_none());
}
