//! Spec -> YAML: a line a part of the file, as a person writes it; what is read again is the same spec.

use serde_yaml::{Mapping, Value};

use super::model::Spec;

/// A part is written in one line up to this many characters, and one entry a line beyond.
const WIDE: usize = 110;

/// The spec as a file, but for its `cases`.
pub fn yaml(spec: &Spec) -> String {
    match serde_yaml::to_value(spec) {
        Ok(Value::Mapping(parts)) => parts.iter().map(|(key, value)| part(&flow(key), value)).collect(),
        // A spec is a mapping of strings to numbers, strings, lists and mappings of them.
        Ok(other) => flow(&other),
        Err(error) => unreachable!("a spec is YAML: {error}"),
    }
}

fn part(key: &str, value: &Value) -> String {
    match value {
        Value::Sequence(items) => {
            items.iter().fold(format!("{key}:\n"), |text, item| text + &format!("  - {}\n", flow(item)))
        }
        Value::Mapping(entries) if flow(value).len() > WIDE => entries
            .iter()
            .fold(format!("{key}:\n"), |text, (key, value)| text + &format!("  {}: {}\n", flow(key), flow(value))),
        _ => format!("{key}: {}\n", flow(value)),
    }
}

/// Everything in one line.
fn flow(value: &Value) -> String {
    match value {
        Value::Mapping(entries) => format!("{{{}}}", pairs(entries)),
        Value::Sequence(items) => format!("[{}]", items.iter().map(flow).collect::<Vec<_>>().join(", ")),
        Value::Number(number) => number.as_f64().filter(|_| number.is_f64()).map_or(number.to_string(), decimal),
        Value::String(text) => quoted(text),
        Value::Bool(yes) => yes.to_string(),
        Value::Null | Value::Tagged(_) => "null".to_owned(),
    }
}

fn pairs(entries: &Mapping) -> String {
    entries.iter().map(|(key, value)| format!("{}: {}", flow(key), flow(value))).collect::<Vec<_>>().join(", ")
}

/// The shortest decimals that read back as the same number.
fn decimal(x: f64) -> String {
    let plain = x.to_string();
    // Very large and very small ones are longer so than with an exponent, whose mantissa YAML wants with a point.
    if plain.len() <= 20 { plain } else { format!("{x:?}") }
}

/// Plain where a word is no more than letters, digits and what stands in names of files, and double quotes elsewhere.
fn quoted(text: &str) -> String {
    let is_plain = text.starts_with(|c: char| c.is_ascii_alphabetic() || c == '/')
        && text.chars().all(|c| c.is_ascii_alphanumeric() || "-_./+".contains(c))
        && serde_yaml::from_str::<Value>(text).is_ok_and(|read| read == Value::String(text.to_owned()));
    // JSON's strings are YAML's.
    if is_plain { text.to_owned() } else { serde_json::Value::from(text).to_string() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Source;
    use crate::tests::MINIMAL;

    #[test]
    fn a_spec_that_is_written_reads_as_itself_in_few_lines() {
        let all = MINIMAL.replace("procedures:\n", "obstacles:\n  - {box: {min_m: [0, 0, 0], max_m: [1, 1, 1e-20], reflectance: 0.25}}\n\
            engines: {mine: {command: [python3, \"a b.py\"], on: \"yes\"}}\ntolerances: {total_illuminance: {relative: 0.5}}\nprocedures:\n  \
            luminous_intensity: {luminaire: a, distance_m: 5, angles: {gamma_deg: [0], c_deg: [90]}}\n  \
            cylindrical_illuminance: {meters: [plane], bounces: 3, light: indirect}\n")
            .replace("at_m: [10, 10, 10]", "at_m: [10, 10, 1e-7], model: area, rotate_deg: {tilt: 30.5}, flux_scale: 0");
        for text in [MINIMAL, &all] {
            let spec: Spec = Source::new("spec.yaml".into(), text.to_owned()).parse().unwrap();
            let written = yaml(&spec);
            let again: Spec =
                Source::new("again.yaml".into(), written.clone()).parse().unwrap_or_else(|e| panic!("{e}\n{written}"));
            assert_eq!(format!("{again:?}"), format!("{spec:?}"), "{written}");
            assert_eq!(yaml(&again), written);
        }
        let spec: Spec = Source::new("spec.yaml".into(), MINIMAL.to_owned()).parse().unwrap();
        assert!(yaml(&spec).lines().count() <= 6, "{}", yaml(&spec));
    }
}
