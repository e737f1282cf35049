//! `compare: [before, after]`: which cases of a spec are held against each other, by the names of cases.

use serde_yaml::Value;

use super::shape::Trials;
use super::{Source, SpecError, suggestion};

const FORM: &str = "give two cases by name, [before, after], or a list of such pairs";

/// A case, and the one that it is compared with.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Pair {
    pub(super) before: String,
    pub(super) after: String,
}

/// The pairs that a spec compares; `names` are those of its cases.
pub(super) fn pairs(source: &Source, compare: &Value, names: &[&str]) -> Result<Vec<Pair>, Vec<SpecError>> {
    let Value::Sequence(items) = compare else {
        return Err(vec![source.error_at("compare", "this is no pair of cases", FORM)]);
    };
    // A pair of names, or else pairs.
    if items.iter().all(Value::is_string) {
        return pair(source, compare, "compare", names).map(|pair| vec![pair]).map_err(|fault| vec![fault]);
    }
    let most = source.trust.limits().cases;
    if items.len() > most {
        let message = format!("{} pairs", items.len());
        return Err(vec![source.error_at("compare", message, format!("a spec compares {most} pairs at most"))]);
    }
    let (mut pairs, mut faults, most) = (vec![], vec![], Trials::of(&source.text).faults());
    for (k, item) in items.iter().enumerate() {
        match pair(source, item, &format!("compare[{k}]"), names) {
            Ok(pair) => pairs.push(pair),
            Err(fault) => faults.push(fault),
        }
        // Every fault costs a walk through the text.
        if faults.len() >= most {
            break;
        }
    }
    if faults.is_empty() { Ok(pairs) } else { Err(faults) }
}

fn pair(source: &Source, value: &Value, place: &str, names: &[&str]) -> Result<Pair, SpecError> {
    let [before, after] = [0, 1].map(|k| value.get(k).and_then(Value::as_str));
    let (Some(before), Some(after), None) = (before, after, value.get(2)) else {
        return Err(source.error_at(place, "this is no pair of cases", FORM));
    };
    for (k, name) in [before, after].into_iter().enumerate() {
        let help = suggestion(name, names.iter().copied());
        source.require(names.contains(&name), &format!("{place}[{k}]"), format!("there is no case `{name}`"), help)?;
    }
    let message = format!("`{before}` is compared with itself");
    source.require(before != after, place, message, "name two cases, the one before first")?;
    Ok(Pair { before: before.to_owned(), after: after.to_owned() })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(compare: &str) -> Result<Vec<Pair>, Vec<SpecError>> {
        let text = format!("luxproof: 1\ncompare: {compare}\n");
        let value: Value = serde_yaml::from_str(&text).unwrap();
        let source = Source::new("spec.yaml".into(), text);
        pairs(&source, value.get("compare").unwrap(), &["plain", "shaded", "painted"])
    }

    #[test]
    fn two_names_are_a_pair_and_lists_of_two_are_pairs() {
        let of = |before: &str, after: &str| Pair { before: before.into(), after: after.into() };
        assert_eq!(found("[plain, shaded]"), Ok(vec![of("plain", "shaded")]));
        let both = Ok(vec![of("plain", "shaded"), of("shaded", "painted")]);
        assert_eq!(found("[[plain, shaded], [shaded, painted]]"), both);
    }

    #[test]
    fn what_names_no_case_is_refused_at_its_place_with_the_nearest() {
        let faults = found("[[plain, shade], [plian, painted]]").unwrap_err();
        let reported: Vec<_> = faults.iter().map(|f| (f.line, f.column, f.help.as_deref())).collect();
        let near = [Some("did you mean `shaded`?"), Some("did you mean `plain`?")];
        assert_eq!(reported, [(Some(2), Some(19), near[0]), (Some(2), Some(28), near[1])], "{faults:?}");
        for wrong in
            ["[plain]", "[plain, shaded, painted]", "plain", "{a: b}", "[[plain, [shaded]]]", "[]", "[plain, 3]"]
        {
            let faults = found(wrong).unwrap_err();
            assert!(faults[0].line == Some(2) && faults[0].message.contains("no pair of cases"), "{wrong}: {faults:?}");
        }
        assert!(found("[plain, plain]").unwrap_err()[0].message.contains("with itself"));
    }
}
