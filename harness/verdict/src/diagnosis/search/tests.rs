//! Steps of the search, by hand.

use luxproof_engines::fixtures;
use luxproof_model::{Comparison, Estimate, Uncertainty};
use luxproof_scene::{Bounces, Transport};
use luxproof_spec::procedures::Target;

use super::*;
use crate::fixtures::{built_in, recording, task};

/// A sheet of a case: readings with a standard uncertainty of 1 %, where others are right.
fn sheet(model: usize, case: usize, read: &[f64], right: &[f64], fails: bool) -> EngineReadings {
    let task = task(read.len());
    let exact: Vec<Estimate> = right.iter().map(|value| Estimate::exact(*value)).collect();
    let sampled = |value: &f64| Estimate { value: *value, uncertainty: Uncertainty::sampled(0.01 * value, None) };
    let recordings =
        [recording("simulator", &exact), recording("radiance", &read.iter().map(sampled).collect::<Vec<_>>())];
    let comparisons = built_in().compare(&task, &[&recordings[0], &recordings[1]]);
    let members: Vec<&Comparison> = comparisons.iter().filter(|c| c.key.engine == "radiance").collect();
    EngineReadings::of(model, &Model::new(case, &task, right.to_vec()), &members, fails).unwrap()
}

/// A task of the room of case S1.
fn lit(transport: Transport) -> Task {
    let job = fixtures::s1(transport);
    let targets = job.sensors.iter().map(|s| Target::of_one(s.id.clone(), s.meter, 1.0)).collect();
    Task {
        procedure: job.procedure,
        scene: job.scene,
        transport,
        quantity: luxproof_model::Quantity::Illuminance,
        targets,
    }
}

/// Calls with a search over sheets of the models of one case.
fn with_search<T>(tasks: &[Task], sheets: &[EngineReadings], check: impl FnOnce(&Search<'_>) -> T) -> T {
    let models = tasks.iter().map(|task| Model::new(0, task, vec![1.0; task.targets.len()])).collect();
    let catalogue = FaultCatalogue::new(&[tasks], models);
    let full = EngineReadingsSet::new(&catalogue.models, sheets, true);
    check(&Search {
        catalogue: &catalogue,
        sheets,
        full: &full,
        sample: &full,
        work_left: Cell::new(MAX_WORK),
        is_exhausted: Cell::new(false),
        solved: RefCell::default(),
        paid: RefCell::default(),
        fit_cache: RefCell::default(),
    })
}

fn scored(what: &str, score: f64, explained: &[usize], tolerated: &[usize]) -> ScoredCause {
    let evidence = Evidence { readings: 2, left: 0.0, before: 10.0, factor: None };
    let cause =
        Cause { id: "x", about: format!("about {what}"), what: what.into(), parameters: vec![], evidence, score };
    ScoredCause {
        cause,
        case: None,
        explained: explained.to_vec(),
        tolerated: tolerated.to_vec(),
        count_of_parameters: 0,
    }
}

/// Two failing sheets of case 0, with two and three readings, one that passes, and a failing one of case 1.
fn four_sheets() -> [EngineReadings; 4] {
    [
        sheet(0, 0, &[2.0; 2], &[1.0; 2], true),
        sheet(0, 0, &[2.0; 3], &[1.0; 3], true),
        sheet(0, 0, &[1.0; 2], &[1.0; 2], false),
        sheet(0, 1, &[2.0; 2], &[1.0; 2], true),
    ]
}

/// The names of the causes that the sheets get, and the sheets that stay open.
fn assigned(found: Vec<ScoredCause>) -> (Vec<Vec<String>>, Vec<usize>) {
    with_search(&[], &four_sheets(), |search| {
        let (mut open, mut causes) = (vec![0, 1, 3], vec![vec![]; 4]);
        search.assign_causes(found, &mut open, &mut causes);
        (causes.into_iter().map(|of| of.into_iter().map(|cause| cause.what).collect()).collect(), open)
    })
}

#[test]
fn the_best_causes_are_assigned_to_what_they_explain() {
    let none: Vec<String> = vec![];
    let names = |all: &[&str]| -> Vec<String> { all.iter().map(|name| (*name).to_owned()).collect() };
    // The second is within 4 of the best, the third is not.
    let (causes, open) =
        assigned(vec![scored("c", 14.1, &[0], &[]), scored("b", 13.9, &[0], &[]), scored("a", 10.0, &[0], &[])]);
    assert_eq!((causes, open), (vec![names(&["a", "b"]), none.clone(), none.clone(), none.clone()], vec![1, 3]));
    // Too many rivals leave the cause open, and close the sheet.
    let four = ["a", "b", "c", "d"].map(|name| scored(name, 10.0, &[0], &[]));
    assert_eq!(assigned(four.into_iter().collect()), (vec![none.clone(); 4], vec![1, 3]));
    let three = ["a", "b", "c"].map(|name| scored(name, 10.0, &[0], &[]));
    assert_eq!(assigned(three.into_iter().collect()).0[0].len(), 3);
    // What one fault tolerates and fits better by more than 4 no other explains alone.
    let (causes, open) = assigned(vec![scored("a", 10.0, &[0], &[]), scored("b", 5.9, &[1], &[0])]);
    assert_eq!((causes, open), (vec![none.clone(), names(&["b"]), none.clone(), none.clone()], vec![3]));
    let (causes, _) = assigned(vec![scored("a", 10.0, &[0], &[]), scored("b", 6.1, &[1], &[0])]);
    assert_eq!(causes, [names(&["a"]), names(&["b"]), none.clone(), none.clone()]);
    // Two readings are explained and three are not.
    let (causes, open) = assigned(vec![scored("a", 10.0, &[0], &[1])]);
    assert_eq!((causes, open), (vec![none.clone(); 4], vec![3]));
    let (causes, _) = assigned(vec![scored("a", 10.0, &[1], &[0])]);
    assert_eq!(causes[1], names(&["a"]));
    let (causes, _) = assigned(vec![scored("a", 10.0, &[3], &[0])]);
    assert_eq!(causes[3], names(&["a"]), "as many readings as it leaves");
    // A cause within case 0 covers both of its open sheets, or is none.
    let within = |explained: &[usize]| ScoredCause { case: Some(0), ..scored("a", 1.0, explained, &[]) };
    assert_eq!(assigned(vec![within(&[0])]), (vec![none.clone(); 4], vec![0, 1, 3]));
    assert_eq!(assigned(vec![within(&[0, 1])]).1, [3]);
}

#[test]
fn a_cause_repeats_another_by_its_words_or_by_another_form_of_the_same_quantity() {
    let one = scored("a", 1.0, &[0], &[]);
    let with = |about: &str, what: &str, count_of_parameters: usize, case: Option<usize>| {
        let cause = Cause { about: about.into(), what: what.into(), ..one.cause.clone() };
        ScoredCause { cause, case, count_of_parameters, ..scored("", 1.0, &[0], &[]) }
    };
    assert!(one.repeats(&with("x", "a", 3, None)));
    assert!(!one.repeats(&with("about a", "b", 0, None)));
    assert!(one.repeats(&with("about a", "b", 1, None)) && one.repeats(&with("about a", "b", 0, Some(0))));
    assert!(!one.repeats(&with("x", "b", 1, Some(0))));
    let rivals = select_rivals(vec![&one, &with("about a", "b", 1, None), &with("x", "c", 0, None)]);
    assert_eq!(rivals.iter().map(|cause| &cause.what[..]).collect_vec(), ["a", "c"]);
    assert!(one.covers(0) && !one.covers(1) && scored("", 1.0, &[], &[1]).covers(1));
}

#[test]
fn pairs_are_of_different_faults_that_may_share_a_case() {
    let right = lit(Transport::Direct);
    let sheets = [sheet(0, 0, &[6.0; 4], &[1.0; 4], true)];
    let factor = |id: &'static str, factor: f64| {
        Fault::new(id, id, move |faulty, _| {
            faulty.factor *= factor;
            true
        })
    };
    with_search(&[right], &sheets, |search| {
        let pair = search.score_pair(&factor("two times", 2.0), &factor("three times", 3.0)).unwrap();
        // Exact readings: no chi-squared, no parameter, and the penalty of a pair.
        assert!((pair.cause.score - 12.0).abs() < 1e-9, "{}", pair.cause.score);
        assert_eq!(pair.cause.what, "two faults: two times, and three times");
        let same_id = factor("two times", 3.0).about("y");
        assert!(search.score_pair(&factor("two times", 2.0), &same_id).is_none());
        let same_quantity = factor("three times", 3.0).about("two times");
        assert!(search.score_pair(&factor("two times", 2.0), &same_quantity).is_none());
        for (one, other, is_possible) in
            [(Some(0), Some(0), true), (Some(0), None, true), (None, Some(0), true), (Some(0), Some(1), false)]
        {
            let [mut a, mut b] = [factor("two times", 2.0), factor("three times", 3.0)];
            (a.case, b.case) = (one, other);
            assert_eq!(search.score_pair(&a, &b).is_some(), is_possible, "{one:?} {other:?}");
        }
        // Six times is neither.
        assert!(search.score_unfitted(&factor("two times", 2.0)).is_none());
    });
}

#[test]
fn a_score_is_the_chi_squared_of_all_sheets_and_a_penalty_by_parameter() {
    // Two sheets of four and three readings; the prediction leaves one standard deviation in each of the first.
    let sheets = [sheet(0, 0, &[2.0; 4], &[1.0; 4], true), sheet(1, 0, &[1.0; 3], &[1.0; 3], false)];
    let tasks = [lit(Transport::Direct), lit(Transport::Direct)];
    let fault = Fault::new("x", "x", |_, _| true);
    let plain_score = 4.0 * (0.02f64 / 0.02f64.hypot(5e-4 * 1.98)).powi(2);
    with_search(&tasks, &sheets, |search| {
        let predicted = BTreeMap::from([(0, vec![1.98; 4])]);
        let plain = search.score_sheets(&fault, &predicted, (1.0, 0.0)).unwrap();
        assert!((plain.cause.score - plain_score).abs() < 1e-3, "{} {plain_score}", plain.cause.score);
        assert_eq!((plain.cause.evidence.readings, &plain.explained[..]), (4, &[0][..]));
        assert!((plain.cause.evidence.left - 100.0 * 0.02 / 1.98).abs() < 1e-9);
        assert!((plain.cause.evidence.before - 100.0).abs() < 1e-9 && plain.cause.evidence.factor.is_none());
        // ln 7 for each parameter.
        let parameters = [1.0, 2.0].map(|start| Parameter::new("", start, 0.1, (0.0, 9.0)));
        let fitted = fault.clone().with_parameters(parameters);
        let fitted = search.score_sheets(&fitted, &predicted, (1.0, 0.0)).unwrap();
        assert!((fitted.cause.score - plain.cause.score - 2.0 * 7f64.ln()).abs() < 1e-9);
        // Two telling readings do for no parameter, three for one; a clamp needs two with its one.
        let telling = |count: usize, fault: &Fault| {
            let sheets = [sheet(0, 0, &[2.0; 4], &[1.0; 4], true)];
            let mut read = vec![2.0; count];
            read.resize(4, 1.0);
            let mut sheets = sheets;
            sheets[0].read.clone_from(&read);
            with_search(&tasks, &sheets, |search| {
                search.score_sheets(fault, &BTreeMap::from([(0, read)]), (1.0, 0.0)).is_some()
            })
        };
        let one = fault.clone().with_parameters([Parameter::new("", 1.0, 0.1, (0.0, 9.0))]);
        assert!(telling(2, &fault) && !telling(1, &fault) && telling(3, &one) && !telling(2, &one));
        let clamp = Fault::new("clamp", "x", |_, _| true).with_parameters([Parameter::new("", 1.0, 0.1, (0.0, 9.0))]);
        assert!(telling(2, &clamp) && !telling(1, &clamp));
        // Two readings in all are enough for no parameter, and not for one.
        let few = [sheet(0, 0, &[2.0; 2], &[1.0; 2], true)];
        let enough = |fault: &Fault| {
            with_search(&tasks, &few, |search| {
                search.score_sheets(fault, &BTreeMap::from([(0, vec![2.0; 2])]), (1.0, 0.0)).is_some()
            })
        };
        assert!(enough(&fault) && !enough(&clamp));
        // A factor is stated with the error of all explained readings: 2 to root(4 / .02²) of them.
        let factor = fault.clone().about(FACTOR);
        let (value, error) =
            search.score_sheets(&factor, &predicted, (1.0, 0.0)).unwrap().cause.evidence.factor.unwrap();
        assert!((value - 2.0).abs() < 1e-9 && (error - 0.01).abs() < 1e-4, "{value} {error}");
    });
}

#[test]
fn fits_start_where_nothing_is_wrong_or_at_the_brightest_failing_reading() {
    let mut weighted = lit(Transport::Direct);
    weighted.targets[1].aspects[0].weight = 0.5;
    let sheets =
        [sheet(0, 0, &[3.0, 4.0, 2.0, 1.0], &[1.0; 4], true), sheet(0, 0, &[90.0, 1.0, 1.0, 1.0], &[1.0; 4], false)];
    with_search(&[weighted], &sheets, |search| {
        // 4 over a weight of a half; brighter readings that pass do not count.
        assert_eq!(search.brightest_failing_lux(), 8.0);
        let parameter =
            |starts: &[f64]| Parameter { starts: starts.to_vec(), ..Parameter::new("", 0.0, 0.1, (-9.0, 9.0)) };
        let fault = |parameters: Vec<Parameter>| Fault::new("x", "x", |_, _| true).with_parameters(parameters);
        assert_eq!(search.starts(&fault(vec![])), [Vec::<f64>::new()]);
        assert_eq!(search.starts(&fault(vec![parameter(&[])])), [[8.0]]);
        let starts = search.starts(&fault(vec![parameter(&[3.0, -1.0, 1.0]), parameter(&[5.0, 6.0]), parameter(&[])]));
        assert_eq!(starts, [[1.0, 5.0, 8.0], [-1.0, 5.0, 8.0], [3.0, 5.0, 8.0]]);
    });
}

#[test]
fn a_parameter_at_the_end_of_its_range_steps_back() {
    let sheets = [sheet(0, 0, &[2.0; 4], &[1.0; 4], true)];
    // Below its end of 1 it dims all light; beyond it nothing changes.
    let fault = Fault::new("x", "x", |faulty, p| {
        faulty.factor *= p[0].min(1.0);
        true
    });
    let fault = fault.with_parameters([Parameter::new("", 1.0, 0.1, (0.0, 1.0))]);
    with_search(&[lit(Transport::Direct)], &sheets, |search| {
        let changed = |start: f64| {
            search.fit_cache.borrow_mut().clear();
            search.find_changed_sheets(search.full, &fault, &[start], &[0])
        };
        assert_eq!(changed(1.0), [0]);
        // A step of .1 up from .9 ends where nothing is wrong.
        assert_eq!((changed(0.9), changed(0.95)), (vec![], vec![0]));
    });
}

#[test]
fn cheap_and_failing_sheets_come_first() {
    let mut sheets = [false, true, false, true].map(|fails| sheet(0, 0, &[1.0], &[1.0], fails));
    sheets[2..].iter_mut().for_each(|sheet| sheet.is_cheap = true);
    with_search(&[], &sheets, |search| {
        assert_eq!(search.sort_cheap_first(), [3, 2, 1, 0]);
        let reflects = Fault::new("x", "x", |_, _| true).with_reflections();
        let plain = Fault::new("x", "x", |_, _| true);
        assert!(search.is_cheap(&plain, 2) && !search.is_cheap(&reflects, 2) && !search.is_cheap(&plain, 0));
    });
}

#[test]
fn work_is_paid_for_until_the_budget_is_spent() {
    with_search(&[], &[], |search| {
        search.work_left.set(100);
        let work = Work { right: 30, faulty: 20 };
        assert!(search.pay(search.full, 0, true, work) && search.work_left.get() == 50);
        // The right light is solved for already, but not that of another fidelity or model.
        assert!(search.pay(search.full, 0, true, work) && search.work_left.get() == 30);
        assert!(search.pay(search.full, 1, true, Work { right: 10, faulty: 20 }) && search.work_left.get() == 0);
        assert!(search.pay(search.full, 1, true, Work::default()) && !search.is_spent());
        assert!(!search.pay(search.full, 1, true, Work { right: 0, faulty: 1 }) && search.is_spent());
        assert!(!search.pay(search.full, 1, true, Work::default()), "what is spent stays spent");
    });
}

#[test]
fn many_readings_are_sampled_evenly() {
    let task = Task { targets: vec![lit(Transport::Direct).targets[0].clone(); 80], ..lit(Transport::Direct) };
    let model = Model::new(0, &task, (0..80).map(f64::from).collect());
    let catalogue = FaultCatalogue::new(&[], vec![model]);
    let values: Vec<f64> = (1..=80).map(f64::from).collect();
    let (models, sheets) = catalogue.sample_sheets(&[sheet(0, 0, &values, &values, true)]);
    let expected: Vec<f64> = (0..40).map(|k| f64::from(2 * k)).collect();
    assert_eq!(models[0].right, expected);
    assert_eq!(sheets[0].read, expected.iter().map(|x| x + 1.0).collect_vec());
    let (models, sheets) = catalogue.sample_sheets(&[sheet(0, 0, &values[..40], &values[..40], true)]);
    assert!(models.is_empty() && sheets.is_empty());
    let both = [sheet(0, 0, &values[..41], &values[..41], true), sheet(0, 0, &values[..3], &values[..3], true)];
    let (_, sheets) = catalogue.sample_sheets(&both);
    assert_eq!(sheets.iter().map(|sheet| sheet.read.len()).collect_vec(), [40, 3]);
}

#[test]
fn a_known_factor_is_named_within_three_standard_errors_and_a_thousandth() {
    with_search(&[lit(Transport::Direct)], &[], |search| {
        let named = |factor: f64, error: f64| search.describe_known_factor(factor, error);
        assert!(named(2.0, 0.0).unwrap().starts_with("factor 2:"));
        assert!(named(2.0019, 0.0).is_some() && named(2.0022, 0.0).is_none());
        assert!(named(2.031, 0.01).is_some() && named(2.033, 0.01).is_none());
        assert!(named(1.37, 0.0).is_none());
    });
}

#[test]
fn a_shape_is_more_than_a_factor_where_its_ratios_differ() {
    let sheets = [sheet(0, 0, &[1.0; 2], &[1.0, 2.0], true), sheet(0, 0, &[1.0; 2], &[1.0, 2.0], false)];
    with_search(&[], &sheets, |search| {
        let is_uneven = |sheet: usize, p: [f64; 2]| search.is_uneven(&BTreeMap::from([(sheet, p.to_vec())]));
        assert!(!is_uneven(0, [3.0, 6.011]) && is_uneven(0, [3.0, 6.013]) && !is_uneven(1, [3.0, 7.0]));
        let shows = |sheet: usize, p: [f64; 2]| search.shows_in_a_failure(&BTreeMap::from([(sheet, p.to_vec())]));
        assert!(shows(0, [1.1, 2.0]) && !shows(0, [1.0, 2.0]) && !shows(1, [1.1, 2.0]));
    });
}

#[test]
fn a_fitted_value_differs_by_three_standard_errors_or_has_several_starts() {
    let one = Parameter::new("", 1.0, 0.1, (0.0, 9.0));
    assert!(differs_from_start((1.31, 0.1), &one) && !differs_from_start((1.29, 0.1), &one));
    assert!(differs_from_start((0.69, 0.1), &one) && !differs_from_start((0.71, 0.1), &one));
    let several = Parameter { starts: vec![1.0, 2.0], ..one.clone() };
    assert!(differs_from_start((1.0, 0.1), &several));
    assert!(differs_from_start((1.0, 0.1), &Parameter { starts: vec![], ..one }));
}

#[test]
fn fitted_parameters_come_before_a_factor_and_by_whole_periods() {
    let fault = Fault::new("x", "turned by {0}, factor {1}", |_, _| true)
        .with_parameters([Parameter { period: Some(360.0), ..Parameter::new("", 0.0, 1.0, (-999.0, 999.0)) }])
        .with_free_factor();
    let mut before = scored("", 1.0, &[0], &[]);
    before.cause.parameters = vec![(1.5, 0.1)];
    let found = with_parameters(before, &fault, vec![(350.0, 2.0)]);
    assert_eq!(found.cause.parameters, [(-10.0, 2.0), (1.5, 0.1)]);
    assert_eq!(found.cause.what, "turned by -10.0000 ± 2.0000, factor 1.5000 ± 0.1000");
}

#[test]
fn a_factor_is_the_quotient_of_sums_of_products() {
    // (6 + 20) / (3 + 10), with an error of one over the root of 13.
    let (factor, error) = fit_factor([(3.0, 6.0), (10.0, 20.0)].into_iter());
    assert_eq!((factor, error), (2.0, 13f64.sqrt().recip()));
    assert_eq!(scaled(&[1.0, 3.0], 2.0), [2.0, 6.0]);
}

#[test]
fn a_sheet_refutes_what_shows_there_and_contradicts_it() {
    let right = sheet(0, 0, &[1.0; 2], &[1.0; 2], false);
    assert!(is_refuted(&right, &[2.0; 2]) && !is_refuted(&right, &[1.0005, 1.0]) && !is_refuted(&right, &[1.02, 1.0]));
    // A contradiction that the fault does not change is no refutation.
    let wrong = sheet(0, 0, &[3.0; 2], &[1.0; 2], true);
    assert!(!is_refuted(&wrong, &[1.0; 2]) && is_refuted(&wrong, &[2.0; 2]));
}

#[test]
fn readings_that_are_all_dark_are_dark_and_nothing_else() {
    let tasks = [lit(Transport::Indirect(Bounces::Converged))];
    let mut dark = sheet(0, 0, &[0.0; 4], &[1.0; 4], true);
    dark.uncertainty = vec![0.0; 4];
    with_search(&tasks, &[dark], |search| {
        let causes = search.find_causes();
        assert_eq!(causes[0].iter().map(|cause| cause.id).collect_vec(), ["dark"]);
    });
}
