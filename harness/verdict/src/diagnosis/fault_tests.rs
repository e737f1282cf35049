//! Faults by hand: what each of them changes in small tasks, and which tasks it does not concern.

#![allow(clippy::approx_constant, reason = "numbers by hand test the constants of the code")]

use glam::DVec3;
use luxproof_engines::fixtures;
use luxproof_model::{MeterId, ProcedureId, Quantity};
use luxproof_photometry::LuminousIntensityDistribution as Table;
use luxproof_scene::geometry::Surface;
use luxproof_scene::{Bounces, Luminaire, Meter, Scene, Transport};
use luxproof_spec::procedures::{Target, Task};

use super::cause::{Cause, Evidence, describe_all};
use super::fault::{Fault, Parameter, shows};
use super::faults::*;
use super::faulty_task::{FaultyTask, Law, Model};
use super::{Aspect, bounces, truth};

/// A luminaire 2 m above the floor's corner region, with the same 100 cd downwards everywhere.
fn lamp(id: &str) -> Luminaire {
    let table = Table::axial(vec![0.0, 90.0], vec![100.0, 100.0]).unwrap();
    fixtures::luminaire(id, DVec3::new(1.0, 1.0, 2.0), table)
}

/// One meter below the luminaires, facing up, in a room that reflects 20, 50 and 80 %.
fn task(luminaires: Vec<Luminaire>, transport: Transport) -> Task {
    let meter = Meter { position_m: DVec3::new(1.0, 1.0, 1.0), normal: DVec3::Z };
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

fn model(task: &Task) -> Model {
    Model::new(0, task, truth(task).unwrap())
}

fn fault(task: &Task, id: &str) -> Fault {
    faults(&[std::slice::from_ref(task)]).into_iter().find(|fault| fault.id == id).unwrap()
}

/// The factor by which a fault changes the one reading; `None` where it does not concern the task.
fn factor(task: &Task, id: &str) -> Option<f64> {
    let model = model(task);
    Some(fault(task, id).readings(&model, &[])?[0] / model.right[0])
}

#[track_caller]
fn assert_near(found: Option<f64>, expected: f64) {
    assert!(found.is_some_and(|found| (found / expected - 1.0).abs() < 1e-9), "{found:?} for {expected}");
}

#[test]
fn each_named_factor_is_the_number_that_it_says() {
    let task = direct(vec![lamp("a")]);
    let model = model(&task);
    assert!((model.right[0] - 100.0).abs() < 1e-9);
    // To six digits, by a pocket calculator.
    let expected = [
        ("factor pi:", 3.141593),
        ("factor 1/pi:", 0.3183099),
        ("factor 4 pi:", 12.56637),
        ("factor 1/(4 pi):", 0.07957747),
        ("factor 2 pi:", 6.283185),
        ("factor 1/(2 pi):", 0.1591549),
        ("factor 2:", 2.0),
        ("factor 1/2:", 0.5),
        ("factor 179:", 179.0),
        ("factor 1/179:", 0.005586592),
        ("factor 683:", 683.0),
        ("factor 1/683:", 0.001464129),
        ("factor 177.83:", 177.83),
        ("factor 1/177.83:", 0.005623348),
        ("factor 683/(4 pi):", 54.35141),
        ("factor 4 pi/683:", 0.01839878),
        ("factor 683/pi:", 217.4057),
        ("factor pi/683:", 0.004599697),
        ("factor 179/pi:", 56.97747),
        ("factor pi/179:", 0.0175508),
        ("factor 179/(4 pi):", 14.24437),
        ("factor 4 pi/179:", 0.07020319),
        ("factor 683/179:", 3.815642),
        ("factor 179/683:", 0.2620791),
        ("factor 179/177.83:", 1.006579),
        ("factor 177.83/179:", 0.9934637),
        ("factor 683/177.83:", 3.840747),
        ("factor pi^2:", 9.869604),
        ("factor 1/pi^2:", 0.1013212),
        ("factor pi/2:", 1.570796),
        ("factor 2/pi:", 0.6366198),
        ("factor 4:", 4.0),
        ("factor 1/4:", 0.25),
        ("factor 10.764:", 10.76391),
        ("factor 0.0929:", 0.09290304),
        ("factor 1000000:", 1e6),
        ("factor 10000:", 1e4),
        ("factor 1/10000:", 1e-4),
        ("factor 1/1000000:", 1e-6),
        ("factor 1550:", 1550.003),
        ("factor 1/1550:", 0.00064516),
        ("factor 1000:", 1000.0),
        ("factor 1/1000:", 1e-3),
    ];
    let all = faults(&[std::slice::from_ref(&task)]);
    for (text, factor) in expected {
        let fault = all.iter().find(|fault| fault.what.starts_with(text)).unwrap_or_else(|| panic!("{text}"));
        let found = fault.readings(&model, &[]).unwrap()[0] / model.right[0];
        assert!((found / factor - 1.0).abs() < 1e-6, "{text} {found}");
    }
    let about = all.iter().filter(|fault| fault.about == FACTOR).count();
    assert_eq!(about, expected.len() + 1, "and one that is free");
}

#[test]
fn flux_scales_and_lamp_lumens_are_left_out_or_applied_twice() {
    let mut lamp = lamp("a");
    for (id, with_nothing) in [("flux-scale", None), ("flux-scale-twice", None), ("per-kilolumen", None)] {
        assert_eq!(factor(&direct(vec![lamp.clone()]), id), with_nothing, "{id}");
    }
    lamp.flux_scale = 0.8;
    let mut table = (*lamp.photometry).clone();
    table.lamp_lumens = Some(2000.0);
    lamp.photometry = std::sync::Arc::new(table);
    let task = direct(vec![lamp.clone()]);
    assert_near(factor(&task, "flux-scale"), 1.25);
    assert_near(factor(&task, "flux-scale-twice"), 0.8);
    assert_near(factor(&task, "per-kilolumen"), 0.5);
    assert_near(factor(&task, "lumens-twice"), 2.0);
    lamp.flux_scale = 0.0;
    assert!(fault(&task, "flux-scale").apply(&model(&direct(vec![lamp.clone()])), &[]).is_none());
    let mut table = (*lamp.photometry).clone();
    table.lamp_lumens = Some(0.0);
    lamp = Luminaire { photometry: std::sync::Arc::new(table), flux_scale: 1.0, ..lamp };
    assert_eq!(factor(&direct(vec![lamp.clone()]), "lumens-twice"), None);
}

/// Two luminaires that differ in table and scale: of 100 cd and of 3 x 50 cd, 1 m above the meter.
fn two() -> Task {
    let table = Table::axial(vec![0.0, 90.0], vec![50.0, 50.0]).unwrap();
    let other = Luminaire { photometry: fixtures::photometry(table), flux_scale: 3.0, ..lamp("b") };
    direct(vec![lamp("a"), other])
}

#[test]
fn of_several_luminaires_some_are_lost_or_take_anothers_table() {
    // 250 lx.
    assert_near(factor(&two(), "one-lit"), 100.0 / 250.0);
    assert_near(factor(&two(), "one-table"), (100.0 + 300.0) / 250.0);
    assert_near(factor(&two(), "one-table-scaled"), 200.0 / 250.0);
    let lost: Vec<Fault> = faults(&[&[two()]]).into_iter().filter(|f| f.id == "luminaire-lost").collect();
    assert_eq!(lost.iter().map(|f| &f.about[..]).collect::<Vec<_>>(), ["flux of a", "flux of b"]);
    assert_eq!(lost[0].readings(&model(&two()), &[]).unwrap()[0], 150.0);
    assert_eq!(lost[1].readings(&model(&two()), &[]).unwrap()[0], 100.0);
    // A scene of the one luminaire is dark, that of another one is not concerned, nor is another case.
    let single = direct(vec![lamp("a")]);
    assert_eq!(lost[0].readings(&model(&single), &[]), Some(vec![0.0]));
    assert_eq!(lost[1].readings(&model(&single), &[]), None);
    assert_eq!(lost[1].readings(&model(&direct(vec![lamp("a"), lamp("c")])), &[]), None);
    assert_eq!(lost[0].readings(&Model::new(1, &two(), vec![250.0]), &[]), None);
    for id in ["one-lit", "one-table", "one-table-scaled"] {
        assert_eq!(factor(&single, id), None, "{id}");
    }
    assert!(faults(&[&[single]]).iter().all(|f| f.id != "luminaire-lost"));
    assert_eq!(luminaire_ids(&[two(), direct(vec![lamp("b"), lamp("c")])]), ["a", "b", "c"]);
}

#[test]
fn rotations_are_left_out_or_undone_where_there_are_any() {
    let task = direct(vec![lamp("a")]);
    assert_eq!((factor(&task, "unrotated"), factor(&task, "rotated-back")), (None, None));
    // About the vertical the light of an even table stays, and the matrix changes.
    let mut turned = lamp("a");
    turned.orientation = glam::DMat3::from_rotation_z(0.5) * turned.orientation;
    let turned = direct(vec![turned]);
    assert_near(factor(&turned, "unrotated").map(|f| f + 1.0), 2.0);
    assert!(fault(&turned, "rotated-back").apply(&model(&turned), &[]).is_some());
}

/// The light that a fault leaves of a task's; `None` where it does not concern the task.
fn transport_of(id: &str, transport: Transport) -> Option<Transport> {
    let task = task(vec![lamp("a")], transport);
    let faulty = fault(&task, id).apply(&Model::new(0, &task, vec![1.0]), &[])?;
    Some(faulty.task().transport)
}

#[test]
fn light_is_cut_lost_and_added() {
    use Transport::{Direct, Indirect, Total};
    let (converged, three) = (Bounces::Converged, Bounces::AtMost(3));
    for (id, from, to) in [
        ("bounces-cut", Direct, None),
        ("bounces-cut", Indirect(converged), Some(Indirect(Bounces::AtMost(0)))),
        ("bounces-cut", Total(converged), Some(Total(Bounces::AtMost(0)))),
        ("bounces-uncut", Direct, None),
        ("bounces-uncut", Total(converged), None),
        ("bounces-uncut", Total(three), Some(Total(converged))),
        ("bounces-uncut", Indirect(three), Some(Indirect(converged))),
        ("direct-lost", Total(three), Some(Indirect(three))),
        ("direct-lost", Indirect(three), None),
        ("direct-lost", Direct, None),
        ("direct-added", Indirect(three), Some(Total(three))),
        ("direct-added", Total(three), None),
        ("indirect-added", Direct, Some(Total(converged))),
        ("indirect-added", Indirect(three), None),
    ] {
        assert_eq!(transport_of(id, from), to, "{id} {from:?}");
    }
    let mut outside = direct(vec![lamp("a")]);
    outside.scene.room = None;
    assert!(fault(&outside, "indirect-added").apply(&model(&outside), &[]).is_none());
    // Eight numbers of reflections; fewer than the task follows are a cut.
    let task = task(vec![lamp("a")], Indirect(three));
    let model = Model::new(0, &task, vec![1.0]);
    let cuts: Vec<Fault> = faults(&[&[task]]).into_iter().filter(|f| f.id == "bounces-cut").collect();
    let texts: Vec<&str> = cuts[..3].iter().map(|f| &f.what[..]).collect();
    assert_eq!(
        texts,
        ["light stops after 0 reflections", "light stops after 1 reflection", "light stops after 2 reflections"]
    );
    let possible: Vec<bool> = cuts.iter().map(|f| f.apply(&model, &[]).is_some()).collect();
    assert_eq!(possible, [true, true, true, false, false, false, false, false]);
}

#[test]
fn surfaces_are_lost_exchanged_and_raised_to_a_power() {
    let lit = task(vec![lamp("a")], Transport::Indirect(Bounces::Converged));
    let model = Model::new(0, &lit, vec![1.0]);
    let reflectances = |fault: &Fault| {
        let faulty = fault.apply(&model, &[]).unwrap();
        Surface::ALL.map(|s| (1e4 * faulty.task().scene.room.unwrap().reflectance.of(s)).round() / 1e4)
    };
    let of = |floor: f64, walls: f64, ceiling: f64| {
        Surface::ALL.map(|s| match s {
            Surface::Floor => floor,
            Surface::Ceiling => ceiling,
            _ => walls,
        })
    };
    assert_eq!(reflectances(&fault(&lit, "upside-down")), of(0.8, 0.5, 0.2));
    // .2, .5 and .8 to the power of 2.2 and of 1/2.2.
    assert_eq!(reflectances(&fault(&lit, "gamma-decoded")), of(0.029, 0.2176, 0.6121));
    assert_eq!(reflectances(&fault(&lit, "gamma-encoded")), of(0.4812, 0.7297, 0.9035));
    let lost: Vec<Fault> =
        faults(&[std::slice::from_ref(&lit)]).into_iter().filter(|f| f.id == "surface-lost").collect();
    assert_eq!(lost.len(), 6);
    for fault in lost {
        let dark = Surface::ALL.into_iter().find(|s| surface_name(*s) == fault.about).unwrap();
        let right = of(0.2, 0.5, 0.8);
        let expected = std::array::from_fn(|k| if Surface::ALL[k] == dark { 0.0 } else { right[k] });
        assert_eq!(reflectances(&fault), expected, "{}", fault.about);
    }
    let unlit = direct(vec![lamp("a")]);
    assert!(faults(&[std::slice::from_ref(&unlit)]).iter().all(|f| f.id != "surface-lost"));
    assert!(fault(&unlit, "upside-down").apply(&self::model(&unlit), &[]).is_none());
    let mut outside = lit;
    outside.scene.room = None;
    assert!(faults(&[std::slice::from_ref(&outside)]).iter().all(|f| f.id != "surface-lost"));
}

#[test]
fn laws_are_about_points_alone() {
    let task = two();
    let faulty = |id: &str, task: &Task| fault(task, id).apply(&Model::new(0, task, vec![1.0]), &[]);
    let law = |id: &str| faulty(id, &task).unwrap().law;
    assert_eq!(law("cosine-missing"), Law { cosine: 0.0, ..Law::RIGHT });
    assert_eq!(law("cosine-doubled"), Law { cosine: 2.0, ..Law::RIGHT });
    assert_eq!(law("two-sided"), Law { is_two_sided: true, ..Law::RIGHT });
    assert_eq!(law("normals-ignored"), Law { cosine: 0.0, is_two_sided: true, ..Law::RIGHT });
    assert_eq!(law("candela-squared"), Law { intensity: 2, ..Law::RIGHT });
    let mut opening = task.clone();
    opening.scene.luminaires[1].model = luxproof_scene::LuminaireModel::Area;
    assert!(are_all_points(&task) && !are_all_points(&opening) && faulty("two-sided", &opening).is_none());
    assert!(faulty("area-as-point", &opening).is_some() && faulty("area-as-point", &task).is_none());
    let meter = |id: &str| faulty(id, &task).unwrap().task().targets[0].aspects[0].meter.normal;
    assert_eq!((meter("meter-flipped"), meter("meters-up")), (DVec3::NEG_Z, DVec3::Z));
}

#[test]
fn there_are_twelve_kinds_of_reflections() {
    let lit = task(vec![lamp("a")], Transport::Total(Bounces::AtMost(2)));
    let model = Model::new(0, &lit, vec![1.0]);
    let all = bounces::bounce_kinds();
    let texts: Vec<String> = all.iter().map(|f| f.what.replace("reflection ", "").replace(" is", "")).collect();
    assert_eq!(
        texts[..11],
        ["1 counted twice", "1 counts half", "1 counts {0} times", "2 lost", "2 counted twice", "2 counts half"]
            .into_iter()
            .chain(["2 counts {0} times", "3 lost", "3 counted twice", "3 counts half", "3 counts {0} times"])
            .collect::<Vec<_>>()
    );
    assert!(all.len() == 12 && all[11].about == "weight of later reflections");
    let possible: Vec<bool> = all.iter().map(|f| f.apply(&model, &[0.7]).is_some()).collect();
    assert_eq!(possible, [vec![true; 7], vec![false; 4], vec![true]].concat());
    let unlit = Model::new(0, &direct(vec![lamp("a")]), vec![1.0]);
    assert!(all.iter().all(|f| f.apply(&unlit, &[0.7]).is_none()));
}

#[test]
fn a_fault_shows_where_it_changes_a_reading_by_a_thousandth_of_the_largest() {
    assert!(!shows(&[1000.9, 10.0], &[1000.0, 10.9]) && shows(&[1001.1, 10.0], &[1000.0, 10.0]));
    assert!(shows(&[1000.0, 8.9], &[1000.0, 10.0]));
    let plain = Fault::new("x", "a fault", |_, _| true);
    assert!(plain.is_plain() && plain.count_of_parameters() == 0);
    assert!(!Fault::new("dark", "", |_, _| true).is_plain());
    let fitted = plain.with_parameters([Parameter::new(" m", 0.0, 1.0, (0.0, 1.0))]);
    assert!(!fitted.is_plain() && fitted.count_of_parameters() == 1);
    assert!(fitted.clone().with_free_factor().count_of_parameters() == 2 && fitted.with_reflections().reflects);
    let turn = Parameter { period: Some(360.0), ..Parameter::new("", 0.0, 1.0, (0.0, 1.0)) };
    assert_eq!([190.0, 170.0, -190.0, 730.0].map(|deg| turn.reduce(deg)), [-170.0, 170.0, 170.0, 10.0]);
    assert_eq!(Parameter::new("", 0.0, 1.0, (0.0, 1.0)).reduce(730.0), 730.0);
}

#[test]
fn a_description_has_its_fitted_values() {
    let fault = Fault::new("x", "off by {0}, factor {1:}", |_, _| true).with_parameters([Parameter::new(
        " m",
        0.0,
        1.0,
        (0.0, 1.0),
    )]);
    assert_eq!(fault.describe(&[(0.25, 0.01), (1.5, 0.1)]), "off by 0.2500 ± 0.0100 m, factor 1.5000");
    assert_eq!(fault.describe(&[(0.25, 0.01), (0.0099, 0.1)]), "off by 0.2500 ± 0.0100 m, factor 9.900e-3");
    assert_eq!(fault.describe(&[(0.25, 0.01), (0.01, 0.1)]), "off by 0.2500 ± 0.0100 m, factor 0.0100");
}

#[test]
fn two_faults_concern_a_task_that_one_of_them_concerns() {
    let task = direct(vec![lamp("a")]);
    let both = fault(&task, "factor-2").and(&fault(&task, "one-lit"));
    assert_eq!(both.readings(&model(&task), &[]), Some(vec![200.0]));
    let both = fault(&task, "one-lit").and(&fault(&task, "factor-2"));
    assert_eq!(both.readings(&model(&task), &[]), Some(vec![200.0]));
    let none = fault(&task, "one-lit").and(&fault(&task, "one-table"));
    assert_eq!(none.readings(&model(&task), &[]), None);
    let of_case = fault(&two(), "luminaire-lost").and(&fault(&task, "distance"));
    assert!(of_case.case == Some(0) && of_case.has_factor && !of_case.reflects);
    let added = fault(&task, "distance").and(&fault(&task, "indirect-added"));
    assert!(added.case.is_none() && added.has_factor && added.reflects);
    let _: &FaultyTask = &added.apply(&model(&task), &[]).unwrap();
}

fn cause(score: f64, factor: Option<(f64, f64)>, before: f64) -> Cause {
    let evidence = Evidence { readings: 4, left: 0.25, before, factor };
    Cause { id: "feet", about: "x".into(), what: "feet".into(), parameters: vec![], evidence, score }
}

#[test]
fn causes_are_likely_by_their_scores() {
    let one = cause(10.0, None, 1000.0);
    assert_eq!(
        describe_all(std::slice::from_ref(&one)),
        "feet: that explains all 4 wrong values to 0.25 % (without it: up to 1000.0 %)"
    );
    // exp(-1) = .3679 to 1: 73 and 27 %.
    let two = describe_all(&[one, cause(12.0, Some((1.25, 0.01)), 0.0)]);
    assert!(two.contains("up to 1000.0 %) (73 % likely); or feet: all 4 readings are 1.2500 ± 0.0100 times"), "{two}");
    assert!(two.ends_with("the reference (27 % likely)"), "{two}");
    let far = describe_all(&[cause(0.0, None, 1040.0)]);
    assert!(far.ends_with("(without it: up to 10 times the reference)"), "{far}");
    assert_eq!(cause(0.0, None, 0.0).aspect(), Aspect::Units);
    let named = |id| Cause { id, ..cause(0.0, None, 0.0) }.aspect();
    assert_eq!(
        ["two", "next", "c-turned-90", "tilt", "power"].map(named),
        [Aspect::Several, Aspect::Meters, Aspect::Orientation, Aspect::Orientation, Aspect::Light]
    );
}
