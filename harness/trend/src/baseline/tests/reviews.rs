//! A review shows old and new values, and accepts nothing without a reason.

use std::slice::from_ref;

use super::*;

fn reviewed(old: &[Entry], new: &[Entry], answers: &str) -> (Decision, String) {
    let changes = compare(old, new, &References::default());
    let (mut output, review) = (vec![], Review { changes: &changes, accepted: old, candidates: new });
    let decision = review.ask("2026-11-21T00:00:00Z", &mut answers.as_bytes(), &mut output).unwrap();
    (decision, String::from_utf8(output).unwrap())
}

#[test]
fn a_review_shows_old_and_new_in_units_of_uncertainty_and_insists_on_a_reason() {
    let (old, new) = (entry(&[100.0, 50.0], Some(1.0)), entry(&[120.0, 50.0], Some(1.0)));
    let (decision, text) = reviewed(&[old], &[new], "perhaps\ny\n\nnew table\n");
    assert!(text.contains("old 100.000000 new 120.000000 lx, change +20.000000: +14.1 u  <- changed"), "{text}");
    assert!(text.contains("needs a reason"));
    assert_eq!(decision.accepted.len(), 1);
    assert_eq!((decision.accepted[0].reason.as_str(), decision.declined), ("new table", 0));
}

#[test]
fn a_review_of_another_task_shows_old_and_new_as_does_accepting_everything() {
    let (old, new) = (entry(&[100.0, 50.0], Some(1.0)), entry(&[120.0, 50.0], Some(1.0)));
    let other = Entry { content_sha256: "cd".repeat(32), ..new };
    let (old, new) = ([old], [other]);
    let (_, text) = reviewed(&old, &new, "n\n");
    assert!(text.contains("REFUSED") && text.contains("old 100.000000 new 120.000000 lx"), "{text}");
    let changes = compare(&old, &new, &References::default());
    let (mut output, review) = (vec![], Review { changes: &changes, accepted: &old, candidates: &new });
    let decision = review.accept_all("new room", "2026-11-21T00:00:00Z", &mut output).unwrap();
    assert_eq!((decision.accepted.len(), decision.accepted[0].reason.as_str()), (1, "new room"));
    assert!(String::from_utf8(output).unwrap().contains("old 100.000000 new 120.000000 lx"));
}

#[test]
fn what_is_unchanged_is_not_asked_about_and_an_ended_input_declines() {
    let old = [entry(&[100.0, 50.0], Some(1.0))];
    let (decision, text) = reviewed(&old, &old, "");
    assert_eq!((decision.accepted.len(), decision.declined, text.as_str()), (0, 0, ""));
    let (decision, _) = reviewed(&[], &old, "y\n");
    assert_eq!((decision.accepted.len(), decision.declined), (0, 1), "no reason was given");
}

/// Runs of one meter that are named by these letters.
fn named(cases: &str, value: f64) -> Vec<Entry> {
    let mut entries = vec![];
    for case in cases.chars() {
        let mut one = entry(&[value], Some(1.0));
        one.key.case = case.to_string();
        entries.push(one);
    }
    entries
}

#[test]
fn a_review_counts_what_is_declined_and_what_is_left_when_it_ends() {
    for (answers, accepted, declined) in [
        ("y\nright\nn\ny\nright too\n", &["a", "c"][..], 1),
        ("yes\nright\nno\nquit\n", &["a"], 2),
        ("n\nq\n", &[], 3),
        ("n\nn\nn\n", &[], 3),
        ("y\nright\n", &["a"], 2),
    ] {
        let (decision, text) = reviewed(&named("abc", 100.0), &named("abc", 130.0), answers);
        let cases: Vec<&str> = decision.accepted.iter().map(|e| e.key.case.as_str()).collect();
        assert_eq!((&cases[..], decision.declined), (accepted, declined), "{answers:?}");
        assert!(text.contains("[1/3] CHANGED a") && !text.contains("/3] CHANGED d"), "{text}");
        assert_eq!(text.contains("[2/3] CHANGED b"), answers.len() > 2, "{text}");
    }
    let (old, new) = (named("abc", 100.0), named("abc", 130.0));
    let changes = compare(&old, &new, &References::default());
    let (mut output, review) = (vec![], Review { changes: &changes, accepted: &old, candidates: &new });
    let decision = review.accept_all("right", "2026-11-21T00:00:00Z", &mut output).unwrap();
    assert_eq!((decision.accepted.len(), decision.declined), (3, 0));
    assert!(decision.accepted.iter().all(|e| e.accepted == "2026-11-21T00:00:00Z" && e.reason == "right"));
    let text = String::from_utf8(output).unwrap();
    assert!(text.contains("[1/3] CHANGED a") && text.contains("[3/3] CHANGED c"), "{text}");
}

#[test]
fn a_review_shows_the_twelve_most_changed_meters_and_counts_the_rest() {
    let old: Vec<f64> = (0..14).map(|_| 100.0).collect();
    let new: Vec<f64> = (0..14).map(|k| 100.0 + 10.0 * f64::from(k)).collect();
    for (count, rest) in [(12, None), (13, Some("and 1 more meters")), (14, Some("and 2 more meters"))] {
        let (before, now) = (entry(&old[..count], Some(1.0)), entry(&new[..count], Some(1.0)));
        let (_, text) = reviewed(from_ref(&before), from_ref(&now), "n\n");
        assert_eq!(text.matches("old 100.000000").count(), 12, "{text}");
        assert_eq!(text.contains("plane[0] "), count == 12, "{text}");
        assert_eq!(text.contains("more meters"), rest.is_some() && text.contains(rest.unwrap_or_default()), "{text}");
        // Of another task those of the run in their order.
        let (_, text) = reviewed(&[before], &[Entry { content_sha256: "cd".into(), ..now }], "n\n");
        assert_eq!(text.matches(" old ").count(), 12, "{text}");
        assert!(text.contains("old 100.000000 new 110.000000 lx") && text.contains("plane[0] "), "{text}");
        assert_eq!(text.contains("more meters"), rest.is_some(), "{text}");
    }
}

#[test]
fn a_review_finds_the_old_reading_by_its_meter_and_shows_exact_changes_without_an_uncertainty() {
    let old = entry(&[100.0, 50.0], None);
    let (_, text) = reviewed(from_ref(&old), &[entry(&[100.0, 47.5], None)], "n\n");
    assert!(text.contains("old 50.000000 new 47.500000 lx, change -2.500000: exact  <- changed"), "{text}");
    let mut other = entry(&[70.0, 80.0, 90.0], None);
    other.readings.swap(0, 1);
    other.content_sha256 = "cd".into();
    let (_, text) = reviewed(&[old], &[other], "n\n");
    for part in ["old 50.000000 new 80.000000", "old 100.000000 new 70.000000", "old none new 90.000000"] {
        assert!(text.contains(part), "{text}");
    }
}

#[test]
fn a_change_of_more_than_a_thousand_uncertainties_has_no_number() {
    for (change, text) in [
        (1000.0, "+1000.0 u"),
        (-1000.0, "-1000.0 u"),
        (1000.5, "more than 1000 u"),
        (-1000.5, "more than 1000 u"),
        (2.26, "+2.3 u"),
    ] {
        assert_eq!(review::in_uncertainties(change), text);
    }
}
