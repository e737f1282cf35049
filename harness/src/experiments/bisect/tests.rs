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

fn found(n: usize, mut look: impl FnMut(usize) -> Look) -> Result<Found, Refused> {
    bisect("mine", &releases(n), |_| None, |release| Ok(look(number(release))))
}

fn from(first: usize) -> impl Fn(usize) -> Verdict {
    move |release| if release < first { Verdict::Pass } else { Verdict::Fail }
}

#[test]
fn a_regression_among_sixteen_releases_takes_four_runs_besides_the_ends_at_most() {
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
fn of_two_changes_the_first_is_found_and_the_other_is_said_to_come_later() {
    let found = found(16, |r| Ok(judged(|p, _| if p == DIRECT { from(12)(r) } else { from(5)(r) }))).unwrap();
    assert_eq!((found.good.as_str(), found.bad.as_str()), ("1.4", "1.5"));
    assert_eq!((found.changed[0].procedure, found.later[0].procedure), (INDIRECT, DIRECT));
    let told = found.to_string();
    assert!(told.contains("mine@1.5 is the first that is bad") && told.contains("--good 1.5"), "{told}");
}

#[test]
fn ends_that_are_alike_swapped_or_silent_are_refused() {
    let alike = found(8, |_| Ok(judged(|_, _| Verdict::Pass))).unwrap_err();
    assert!(matches!(alike, Refused::Alike { compared: 4, .. }), "{alike}");
    let swapped = found(8, |r| Ok(judged(|_, _| if r < 3 { Verdict::Fail } else { Verdict::Pass }))).unwrap_err();
    assert!(matches!(swapped, Refused::Swapped { count: 4, .. }), "{swapped}");
    let open = found(8, |r| Ok(judged(|_, _| if r == 8 { Verdict::Inconclusive } else { Verdict::Pass }))).unwrap_err();
    assert!(open.to_string().contains("4 are not decided"), "{open}");
    let silent =
        found(8, |r| if r == 8 { Err("it crashed".into()) } else { Ok(judged(|_, _| Verdict::Pass)) }).unwrap_err();
    assert_eq!(silent.to_string(), "1.8 says nothing: it crashed");
}

#[test]
fn what_crashes_or_is_undecided_is_skipped_and_named_where_it_hides_the_change() {
    let crashes = |silent: &'static [usize]| {
        found(16, move |r| if silent.contains(&r) { Err("it crashed".into()) } else { Ok(judged(|_, _| from(9)(r))) })
            .unwrap()
    };
    let beside = crashes(&[6, 7]);
    assert_eq!((beside.bad.as_str(), beside.is_one()), ("1.9", true));
    let hidden = crashes(&[8]);
    assert_eq!((hidden.good.as_str(), hidden.bad.as_str(), hidden.is_one()), ("1.7", "1.9", false));
    assert_eq!(hidden.unclear[0].why, "it crashed");
    assert!(hidden.to_string().contains("skipped  mine@1.8: it crashed"));
    let undecided =
        found(4, |r| Ok(judged(|_, k| if r == 2 && k == 1 { Verdict::Inconclusive } else { from(3)(r) }))).unwrap();
    assert!(undecided.unclear[0].why.contains("2 of 4 comparisons are undecided"), "{undecided:?}");
}

#[test]
fn what_is_not_there_costs_no_run() {
    let mut runs = 0;
    let absent = |r: &Release| (number(r) == 3).then(|| "it is not installed".to_owned());
    let found = bisect("mine", &releases(4), absent, |r| {
        runs += 1;
        Ok::<_, Refused>(Ok(judged(|_, _| from(2)(number(r)))))
    });
    let found = found.unwrap();
    assert_eq!((found.runs, runs, found.bad.as_str()), (3, 3, "1.2"));
}

#[test]
fn what_goes_back_and_forth_is_told() {
    // Direct light fails for good from 3 on; of reflected light one meter passes, fails from 5 on and passes at 9.
    let verdict = |p, k, r| match (p, k, r) {
        (INDIRECT, 0, 5..=8) => Verdict::Fail,
        (INDIRECT, ..) => Verdict::Pass,
        _ => from(3)(r),
    };
    let found = found(9, |r| Ok(judged(|p, k| verdict(p, k, r)))).unwrap();
    assert_eq!(found.bad, "1.3");
    assert_eq!(found.remarks.len(), 1, "{:?}", found.remarks);
    assert!(found.remarks[0].contains("passes at 1.1, fails at 1.5, passes at 1.9"), "{:?}", found.remarks);
}
