//! The steps of a comparison, each by examples that were worked out by hand.

use glam::DVec3;
use luxproof_model::{ErrorFinding, Estimate, MeterId, Quantity, Shape, StatedErrors};
use luxproof_photometry::LuminousIntensityDistribution;
use luxproof_scene::Meter;
use luxproof_spec::procedures::Aspect;

use super::*;
use crate::fixtures::{built_in, recording, task};
use luxproof_engines::fixtures::luminaire;

const fn sampled(value: f64, error: f64) -> Estimate {
    Estimate { value, uncertainty: Uncertainty::sampled(error, None) }
}

fn are_close(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-9 * b.abs()
}

/// The comparison of a reading with an exact reference.
fn comparison(reference: f64, read: Estimate) -> Comparison {
    let (exact, subject) = (recording("simulator", &[Estimate::exact(reference)]), recording("radiance", &[read]));
    built_in().compare_one(&task(1), &subject, &[&exact, &subject]).remove(0)
}

const fn error(error: f64) -> Uncertainty {
    Uncertainty::sampled(error, None)
}

#[test]
fn a_sampled_value_fails_nothing_with_a_heavy_tail_unseen_or_with_an_error_beyond_a_quarter() {
    for (uncertainty, value, is_heavy_tailed, begins) in [
        (error(0.1), 4.0, true, Some("a heavy tail")),
        (error(0.0), 4.0, true, None),
        (error(0.1), 4.0, false, None),
        (error(1.0), 4.0, false, None),
        (error(1.01), 4.0, false, Some("too few samples")),
        (error(1.0), 0.0, false, None),
        (error(1.0), -1.0, false, None),
        (Uncertainty::NotSeen, 0.0, false, Some("not seen")),
        (Uncertainty::Bound(9.0), 4.0, true, None),
    ] {
        let why = why_unreliable(uncertainty, value, is_heavy_tailed);
        let is_expected = begins.is_none_or(|begins| why.is_some_and(|why| why.starts_with(begins)));
        assert!(why.is_some() == begins.is_some() && is_expected, "{uncertainty:?} {value}: {why:?}");
    }
}

#[test]
fn skewed_blocks_explain_up_to_a_hundred_standard_errors() {
    let compared = comparison(100.0, sampled(100.0, 0.5));
    for (skewness, deviation, is_heavy) in [
        (Some(2.34), 49.9, true),
        (Some(2.34), -49.9, true),
        (Some(2.34), 50.0, false),
        (Some(2.34), -50.1, false),
        (Some(2.33), 49.9, false),
        (None, 49.9, false),
    ] {
        let recording = Recording { skewness, ..recording("radiance", &[]) };
        assert_eq!(is_heavy_tailed(&recording, &compared, deviation, 0.0), is_heavy, "{skewness:?} {deviation}");
    }
    // Without a standard error nothing is near.
    let recording = Recording { skewness: Some(9.0), ..recording("radiance", &[]) };
    assert!(!is_heavy_tailed(&recording, &comparison(100.0, Estimate::exact(100.0)), 0.1, 0.0));
}

#[test]
fn errors_that_vary_between_seeds_explain_what_is_no_less_probable_than_once_in_a_thousand() {
    let compared = comparison(100.0, sampled(100.0, 0.5));
    for (freedom, p_value, is_heavy) in
        [(Some(2.0), 1.1e-3, true), (Some(2.0), 1e-3, false), (Some(2.0), 9e-4, false), (None, 1.1e-3, false)]
    {
        let found = StatedErrors {
            observed_degrees_of_freedom: freedom,
            ..StatedErrors::from_finding(ErrorFinding::HeavyTail)
        };
        let recording = Recording { stated_errors: vec![found], ..recording("radiance", &[]) };
        assert_eq!(is_heavy_tailed(&recording, &compared, 1.0, p_value), is_heavy, "{freedom:?} {p_value}");
    }
}

/// A task of one meter level with a lamp of 200 cd at 2 m, whose table ends with this light. The jump there is 50 lx.
fn task_at_a_jump(weights: &[f64], z_m: f64) -> Task {
    let ends_bright = LuminousIntensityDistribution::axial(vec![0.0, 90.0], vec![400.0, 400.0]).unwrap();
    let mut lamp = luminaire("lamp", DVec3::new(1.0, 1.0, 1.0), ends_bright);
    lamp.flux_scale = 0.5;
    let mut task = task(1);
    task.transport = Transport::Direct;
    task.scene.luminaires = vec![lamp];
    let meter = Meter { position_m: DVec3::new(3.0, 1.0, z_m), normal: DVec3::NEG_X };
    task.targets[0].aspects = weights.iter().map(|weight| Aspect { meter, weight: *weight }).collect();
    task
}

#[test]
fn rounding_explains_up_to_the_jump_of_all_aspects_and_the_tolerance() {
    for (weights, deviation, is_within) in [
        (&[1.0][..], 50.9, true),
        (&[1.0], -50.9, true),
        (&[1.0], 51.1, false),
        (&[-2.0, 1.0], 150.9, true),
        (&[-2.0, 1.0], 151.1, false),
    ] {
        let found = is_within_jump(&task_at_a_jump(weights, 1.0), 0, deviation, 1.0);
        assert_eq!(found, is_within, "{weights:?} {deviation}");
    }
    // Beside the jump, and in reflected light, there is none.
    assert!(!is_within_jump(&task_at_a_jump(&[1.0], 0.9), 0, 0.0, 1.0));
    let reflected = Task { transport: task(1).transport, ..task_at_a_jump(&[1.0], 1.0) };
    assert!(!is_within_jump(&reflected, 0, 0.0, 1.0));
}

#[test]
fn the_largest_portion_is_the_largest_variance_over_its_value() {
    let portion = |read: &[Estimate]| largest_portion(&recording("radiance", read));
    let [small, large] = [sampled(100.0, 10.0), sampled(50.0, 10.0)];
    assert_eq!(portion(&[small, large]), Some(2.0));
    assert_eq!(portion(&[large, small]), Some(2.0));
    // Darkness has no portion, and what is not sampled none either.
    assert_eq!(portion(&[sampled(0.0, 10.0), small, Estimate::exact(1.0)]), Some(1.0));
    assert_eq!(portion(&[sampled(100.0, 0.0)]), None);
    assert_eq!(portion(&[Estimate::exact(100.0)]), None);
}

#[test]
fn unseen_light_has_the_error_of_portions_a_hundred_times_as_large_where_that_is_below_a_quarter() {
    const UNSEEN: Uncertainty = Uncertainty::NotSeen;
    // Portions of .01, a hundred times, of 17: the error is the root of 17, 4.12. Of 16 it is 4, a quarter.
    let root = Uncertainty::sampled(17f64.sqrt(), None);
    for (stated, portion, missing, uncertainty) in [
        (UNSEEN, Some(0.01), Some(17.0), root),
        (UNSEEN, Some(0.01), Some(16.0), UNSEEN),
        (UNSEEN, Some(0.01), None, UNSEEN),
        (UNSEEN, None, Some(17.0), UNSEEN),
        (Uncertainty::Exact, Some(0.01), Some(17.0), Uncertainty::Exact),
    ] {
        assert_eq!(with_unseen_light(stated, portion, missing), uncertainty, "{stated:?} {portion:?} {missing:?}");
    }
    let read = Estimate { value: 91.0, uncertainty: UNSEEN };
    let recording = recording("radiance", &[read]);
    let judged = |truth| effective_uncertainty(&recording, &recording.readings[0], Some(0.01), truth);
    assert_eq!((judged(Some(108.0)), judged(Some(74.0)), judged(None)), (root, root, UNSEEN));
}

#[test]
fn light_of_few_samples_that_are_still_to_come_widens_an_error() {
    let portion = StatedErrors { largest_portion: Some(0.04), ..StatedErrors::from_finding(ErrorFinding::HeavyTail) };
    let recording = Recording { stated_errors: vec![portion], ..recording("radiance", &[sampled(91.0, 1.0)]) };
    let judged = |truth| effective_uncertainty(&recording, &recording.readings[0], None, truth).standard_error();
    // The root of .04 * 100 * 9. None is missing where the reading is above the truth.
    assert!(are_close(judged(Some(100.0)).unwrap(), 6.0));
    assert_eq!((judged(Some(90.0)), judged(None)), (Some(1.0), Some(1.0)));
}

#[test]
fn a_reference_has_a_coverage_factor_where_it_has_an_uncertainty() {
    let tail = upper_tail_of_normal(2.0);
    let reading = |uncertainty| {
        let mut reading = recording("simulator", &[Estimate { value: 100.0, uncertainty }]).readings.remove(0);
        reading.quadrature = 0.5;
        ScoredReference::from_reading(&reading, Basis::Simulator, "it".to_owned())
    };
    let bounded = Uncertainty::StandardError { value: 0.2, degrees_of_freedom: Some(7.0), bound: 0.3 };
    let scored = reading(bounded);
    assert!(scored.components.iter().all(|c| c.source == Source::Reference));
    assert_eq!(scored.components.iter().map(|c| c.shape).collect::<Vec<_>>(), [Shape::Normal, Shape::Rectangular]);
    assert_eq!((scored.quadrature, scored.reference.value), (0.5, 100.0));
    let factor = |uncertainty| reading(uncertainty).with_coverage_factor(tail).coverage_factor;
    assert!(are_close(factor(Uncertainty::sampled(0.2, None)).unwrap(), 2.0));
    assert_eq!(factor(Uncertainty::Exact), None);
}

#[test]
fn a_closed_form_has_the_rounding_of_its_value_and_a_printed_cell_that_of_its_digits() {
    let formula = ScoredReference::from_formula(-100.0, "a formula");
    assert!(are_close(formula.reference.uncertainty, 1e-11 / 3f64.sqrt()));
    assert!(are_close(formula.components[0].uncertainty, 1e-11 / 3f64.sqrt()));
    assert_eq!((formula.reference.value, formula.reference.basis), (-100.0, Basis::ClosedForm));
    let printed = Reference::of(5.0, &Uncertainty::Bound(0.3), Basis::Published, "a paper".to_owned());
    let task = task(1);
    let scored = ScoredReference::from_published(printed, None, &task.targets[0], None);
    let [rounding] = &scored.components[..] else { panic!("rounding alone") };
    assert_eq!((rounding.source, rounding.shape), (Source::Rounding, Shape::Rectangular));
    assert!(are_close(rounding.uncertainty, 0.3 / 3f64.sqrt()));
}

#[test]
fn a_sampled_reading_spends_a_share_of_its_error_where_stages_were_planned() {
    let read = [sampled(1.0, 0.1), Estimate::exact(1.0), sampled(1.0, 0.1)];
    let staged = Recording { stages: vec![1, 1], ..recording("radiance", &read) };
    assert_eq!([0, 1, 2, 3].map(|k| share_of_reading(&staged, k)), [0.25, 1.0, 1.0, 1.0]);
    assert_eq!(share_of_reading(&recording("radiance", &read), 0), 1.0);
}

#[test]
fn the_reference_of_a_task_is_that_of_another_engine_with_its_solver() {
    let (task, exact) = (task(2), recording("simulator", &[Estimate::exact(3.0)]));
    let mut solved = exact.clone();
    solved.method.insert("solver".to_owned(), "radiosity".to_owned());
    let find = |recordings: &[&Recording], k, engine: &str| {
        let found = reference_of_task(&task, recordings, k, &EngineName::from(engine))?;
        Some((found.reference.value, found.reference.source.ends_with(": radiosity")))
    };
    let other = recording("radiance", &[Estimate::exact(7.0)]);
    assert_eq!(find(&[&other, &exact], 0, "radiance"), Some((3.0, false)));
    assert_eq!(find(&[&other, &solved], 0, "radiance"), Some((3.0, true)));
    assert_eq!(find(&[&other, &exact], 1, "radiance"), None);
    assert_eq!(find(&[&other], 0, "radiance"), None);
    assert_eq!(find(&[&other, &exact], 0, "simulator"), None);
}

/// A missing comparison with its reason.
fn missing_at(k: usize, why: &str) -> (MeterId, Verdict, String) {
    (MeterId::new("grid", k), Verdict::Missing, why.to_owned())
}

#[test]
fn what_is_missing_is_a_comparison_of_a_renderer_and_of_a_reference_that_failed() {
    let judge = built_in();
    let full = [Estimate::exact(1.0); 2];
    let missing = |recordings: &[Recording], k: usize| {
        let all: Vec<&Recording> = recordings.iter().collect();
        let found = judge.compare_one(&task(2), all[k], &all);
        found.into_iter().map(|c| (c.meter, c.verdict, c.diagnosis.unwrap_or_default())).collect::<Vec<_>>()
    };
    // Without the simulator a renderer has no reference.
    let alone = [recording("radiance", &full)];
    assert_eq!(missing(&alone, 0), [missing_at(0, "no reference"), missing_at(1, "no reference")]);
    // The simulator has none, and needs none where it has a reading.
    let half = [recording("simulator", &full[..1])];
    assert_eq!(missing(&half, 0), [missing_at(1, "no reading")]);
    let failed = Recording { failure: Some("out of memory".to_owned()), ..recording("radiance", &full[..1]) };
    let found = missing(&[recording("simulator", &full), failed], 1);
    assert_eq!((found[0].1, &found[1]), (Verdict::Pass, &missing_at(1, "out of memory")));
}

#[test]
fn darkness_keeps_a_tolerance_that_is_given_for_it() {
    let exact = recording("simulator", &[Estimate::exact(100.0), Estimate::exact(0.0)]);
    let subject = recording("radiance", &[Estimate::exact(100.0), Estimate::exact(5e-4)]);
    let found = &built_in().compare_one(&task(2), &subject, &[&exact, &subject])[1];
    assert_eq!((found.verdict, found.tolerance.absolute, found.relative_deviation), (Verdict::Pass, 1e-3, None));
    assert_eq!(found.deviation, Some(5e-4));
    // Bright references keep a tolerance of zero.
    let none = luxproof_spec::ToleranceOverride::default();
    let overrides = BTreeMap::from([(ProcedureId::IndirectIlluminance, none)]);
    let judge = Judge { overrides: &overrides, ..built_in() };
    let found = judge.compare_one(&task(2), &subject, &[&exact, &subject]);
    assert_eq!(found.iter().map(|c| c.tolerance.absolute).collect::<Vec<_>>(), [0.0, 1e-10]);
    assert_eq!(found.iter().map(|c| c.verdict).collect::<Vec<_>>(), [Verdict::Pass, Verdict::Fail]);
}

/// The verdicts of meters with errors of 1e-3 that lie so many errors beyond a tolerance of 2 % of 1 lx.
fn verdicts_beyond(sigmas: &[f64]) -> Vec<Verdict> {
    let readings: Vec<Estimate> = sigmas.iter().map(|sigmas| sampled(1.02 + 1e-3 * sigmas, 1e-3)).collect();
    let exact = recording("simulator", &vec![Estimate::exact(1.0); sigmas.len()]);
    let subject = recording("radiance", &readings);
    let found = built_in().compare_one(&task(sigmas.len()), &subject, &[&exact, &subject]);
    found.into_iter().map(|c| c.verdict).collect()
}

#[test]
fn a_failure_holds_at_the_level_of_all_comparisons_of_its_engine() {
    use Verdict::{Fail, Pass, Undecided};
    // Beyond 3.2 standard deviations lie 6.9e-4 of a normal distribution, beyond 3.4 3.4e-4 and beyond 3.0 1.35e-3. By Holm's method the
    // smallest of n may be .001 / n.
    for (sigmas, verdicts) in [
        (&[3.2][..], &[Fail][..]),
        (&[3.0], &[Undecided]),
        (&[3.2, -20.0], &[Undecided, Pass]),
        (&[3.4, -20.0], &[Fail, Pass]),
        // The first is rejected, and one remains at .001.
        (&[3.2, 3.4], &[Fail, Fail]),
        (&[1.9], &[Undecided]),
    ] {
        assert_eq!(verdicts_beyond(sigmas), verdicts, "{sigmas:?}");
    }
}

#[test]
fn light_below_zero_is_no_reference_and_a_rating_below_zero_is_one() {
    for (quantity, verdict, p_value) in
        [(Quantity::Illuminance, Verdict::Missing, None), (Quantity::GlareRating, Verdict::Pass, Some(1.0))]
    {
        let task = Task { quantity, ..task(1) };
        let exact = recording("simulator", &[Estimate::exact(-5.0)]);
        let subject = recording("radiance", &[Estimate::exact(-5.0)]);
        let found = &built_in().compare_one(&task, &subject, &[&exact, &subject])[0];
        assert_eq!((found.verdict, found.p_value), (verdict, p_value), "{quantity:?}");
    }
    let task = Task { quantity: Quantity::GlareRating, ..task(1) };
    let exact = recording("simulator", &[Estimate::exact(10.0)]);
    let subject = recording("radiance", &[Estimate::exact(12.0)]);
    let found = &built_in().compare_one(&task, &subject, &[&exact, &subject])[0];
    assert_eq!((found.deviation, found.relative_deviation), (Some(2.0), None));
    assert_eq!(comparison(10.0, Estimate::exact(12.0)).relative_deviation, Some(0.2));
}

#[test]
fn an_unreliable_failure_is_undecided_with_its_reason_and_without_a_probability() {
    // 4 lx with an error of 1.2 are 96 lx off.
    let few = comparison(100.0, sampled(4.0, 1.2));
    assert_eq!((few.verdict, few.p_value), (Verdict::Undecided, None));
    assert!(few.diagnosis.unwrap().starts_with("too few samples"));
    let many = comparison(100.0, sampled(4.0, 0.9));
    assert_eq!((many.verdict, many.diagnosis), (Verdict::Fail, None));
    assert!(many.p_value.unwrap() < 1e-9);
}

#[test]
fn a_doubtful_reference_excuses_what_does_not_pass() {
    use Verdict::{Fail, KnownDeviation, Missing, NotJudged, Pass, Undecided};
    let compared = comparison(100.0, Estimate::exact(101.0));
    let excused = |verdict, caveat: Option<&str>, engine: &str| {
        let mut comparison = Comparison { verdict, ..compared.clone() };
        comparison.key.engine = engine.into();
        comparison.reference.as_mut().unwrap().caveat = caveat.map(str::to_owned);
        built_in().excuse(&mut comparison);
        comparison.verdict
    };
    for verdict in [Fail, Undecided] {
        assert_eq!(excused(verdict, Some("a misprint"), "radiance"), KnownDeviation);
        assert_eq!(excused(verdict, None, "radiance"), verdict);
        assert_eq!(excused(verdict, None, "iesna"), NotJudged);
    }
    for verdict in [Pass, Missing] {
        assert_eq!(excused(verdict, Some("a misprint"), "iesna"), verdict);
    }
}
