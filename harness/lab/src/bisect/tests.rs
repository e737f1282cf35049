use super::*;

fn releases(n: usize) -> Vec<Release> {
    (1..=n).map(|k| format!("1.{k}").parse().unwrap()).collect()
}

fn place(procedure: ProcedureId, k: usize) -> Place {
    ("room".into(), procedure, MeterId::new("plane", k), "exact".into())
}

const DIRECT: ProcedureId = ProcedureId::DirectIlluminance;
const INDIRECT: ProcedureId = ProcedureId::IndirectIlluminance;

fn number(release: &Release) -> usize {
    release.as_str()[2..].parse().unwrap()
}

/// The verdict on a meter of a procedure, at a release.
fn judged(at: impl Fn(ProcedureId, usize) -> Verdict) -> BTreeMap<Place, Verdict> {
    let places = [DIRECT, INDIRECT].into_iter().flat_map(|p| (0..2).map(move |k| (p, k)));
    places.map(|(p, k)| (place(p, k), at(p, k))).collect()
}

fn found(n: usize, mut answer: impl FnMut(usize) -> ReleaseVerdicts) -> Result<Bisection, Refused> {
    bisect("mine", &releases(n), |_| None, |release| Ok(answer(number(release))))
}

fn from(first: usize) -> impl Fn(usize) -> Verdict {
    move |release| if release < first { Verdict::Pass } else { Verdict::Fail }
}

#[test]
fn a_regression_among_sixteen_releases_takes_at_most_four_runs_and_the_ends() {
    for first in 2..=16 {
        let found = found(16, |r| Ok(judged(|p, _| if p == DIRECT { from(first)(r) } else { Verdict::Pass }))).unwrap();
        assert_eq!((found.good, found.bad), (format!("1.{}", first - 1), format!("1.{first}")));
        assert!(found.runs <= 6, "{}", found.runs);
        assert_eq!(found.changed.len(), 1);
        assert_eq!((found.changed[0].procedure, found.changed[0].meters.len()), (DIRECT, 2));
        assert!(found.later.is_empty() && found.remarks.is_empty() && found.unclear.is_empty());
    }
}

#[test]
fn of_two_changes_the_first_is_found_and_the_other_is_reported_as_later() {
    let found = found(16, |r| Ok(judged(|p, _| if p == DIRECT { from(12)(r) } else { from(5)(r) }))).unwrap();
    assert_eq!((found.good.as_str(), found.bad.as_str()), ("1.4", "1.5"));
    assert_eq!((found.changed[0].procedure, found.later[0].procedure), (INDIRECT, DIRECT));
    let text = found.to_string();
    assert!(text.contains("mine@1.5 is the first that is bad") && text.contains("--good 1.5"), "{text}");
}

#[test]
fn ends_that_are_alike_swapped_or_silent_are_refused() {
    let same = found(8, |_| Ok(judged(|_, _| Verdict::Pass))).unwrap_err();
    assert!(matches!(same, Refused::Alike { compared: 4, .. }), "{same}");
    let swapped = found(8, |r| Ok(judged(|_, _| if r < 3 { Verdict::Fail } else { Verdict::Pass }))).unwrap_err();
    assert!(matches!(swapped, Refused::Swapped { count: 4, .. }), "{swapped}");
    let open = found(8, |r| Ok(judged(|_, _| if r == 8 { Verdict::Undecided } else { Verdict::Pass }))).unwrap_err();
    assert!(open.to_string().contains("4 are not decided"), "{open}");
    let silent =
        found(8, |r| if r == 8 { Err("it crashed".into()) } else { Ok(judged(|_, _| Verdict::Pass)) }).unwrap_err();
    assert_eq!(silent.to_string(), "1.8 says nothing: it crashed");
}

/// A bisection of sixteen releases that change at 9, some of which crash.
fn found_with_crashes(crashing: &[usize]) -> Bisection {
    found(16, |r| if crashing.contains(&r) { Err("it crashed".into()) } else { Ok(judged(|_, _| from(9)(r))) }).unwrap()
}

#[test]
fn what_crashes_or_is_undecided_is_skipped_and_named_where_it_hides_the_change() {
    let elsewhere = found_with_crashes(&[6, 7]);
    assert_eq!((elsewhere.bad.as_str(), elsewhere.is_one()), ("1.9", true));
    let hidden = found_with_crashes(&[8]);
    assert_eq!((hidden.good.as_str(), hidden.bad.as_str(), hidden.is_one()), ("1.7", "1.9", false));
    assert_eq!(hidden.unclear[0].why, "it crashed");
    assert!(hidden.to_string().contains("skipped  mine@1.8: it crashed"));
    let undecided =
        found(4, |r| Ok(judged(|_, k| if r == 2 && k == 1 { Verdict::Undecided } else { from(3)(r) }))).unwrap();
    assert!(undecided.unclear[0].why.contains("2 of 4 comparisons are undecided"), "{undecided:?}");
}

#[test]
fn what_is_not_there_costs_no_run() {
    let mut runs = 0;
    let found = bisect(
        "mine",
        &releases(4),
        |r| (number(r) == 3).then(|| "it is not installed".to_owned()),
        |r| {
            runs += 1;
            Ok::<_, Refused>(Ok(judged(|_, _| from(2)(number(r)))))
        },
    );
    let found = found.unwrap();
    assert_eq!((found.runs, runs, found.bad.as_str()), (3, 3, "1.2"));
}

/// Direct light fails from 3 on. One meter of reflected light passes, fails from 5 on and passes
/// again at 9.
fn back_and_forth(procedure: ProcedureId, meter: usize, release: usize) -> Verdict {
    match (procedure, meter, release) {
        (INDIRECT, 0, 5..=8) => Verdict::Fail,
        (INDIRECT, ..) => Verdict::Pass,
        _ => from(3)(release),
    }
}

#[test]
fn what_goes_back_and_forth_is_reported() {
    let found = found(9, |r| Ok(judged(|p, k| back_and_forth(p, k, r)))).unwrap();
    assert_eq!(found.bad, "1.3");
    assert_eq!(found.remarks.len(), 1, "{:?}", found.remarks);
    assert!(found.remarks[0].contains("passes at 1.1, fails at 1.5, passes at 1.9"), "{:?}", found.remarks);
}
