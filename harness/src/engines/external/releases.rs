//! Releases of a user's program: `releases: {"1.0": [python3, v1.py]}` in its settings, each an engine `mine@1.0`.

use std::collections::BTreeMap;

use serde_json::Value;

use super::EngineError;
use crate::record::{EngineName, Release, family};

/// The setting that names them.
pub(super) const KEY: &str = "releases";

/// How it is run, which its releases have in common; what else it is set to is each one's own.
const COMMON: [&str; 6] = ["procedures", super::RUN_IN, "protocol", "start_seconds", "shares", "depends_on"];

/// Release and command, oldest first.
pub(super) fn all(name: &str, settings: &BTreeMap<String, Value>) -> Result<BTreeMap<Release, Value>, EngineError> {
    let error = |what: String| EngineError::Setting { engine: name.into(), key: KEY.into(), what };
    let listed = match settings.get(KEY) {
        None => return Ok(BTreeMap::new()),
        Some(Value::Object(listed)) => listed,
        Some(_) => return Err(error("must be commands by release, {\"1.0\": [program, arguments...]}".into())),
    };
    let one = |(release, command): (&String, &Value)| {
        let shown: String = release.chars().take(30).collect();
        let parsed: Release = release.parse().map_err(|why| error(format!("`{shown}`: {why}")))?;
        Ok((
            parsed,
            command_of(command).ok_or_else(|| error(format!("`{shown}` must have a program and its arguments")))?,
        ))
    };
    listed.iter().map(one).collect()
}

/// A list of words, or a line as it is typed.
fn command_of(value: &Value) -> Option<Value> {
    let words = match value {
        Value::String(line) => shlex::split(line)?,
        other => serde_json::from_value::<Vec<String>>(other.clone()).ok()?,
    };
    words.first().is_some_and(|word| !word.is_empty()).then(|| words.into())
}

/// The settings of a release by its name; `of_family` are those of the program, `own` what a spec says of the release itself.
/// `Ok(None)` where that has no releases.
pub(crate) fn of_release(
    name: &str,
    of_family: &BTreeMap<String, Value>,
    own: &BTreeMap<String, Value>,
) -> Result<Option<BTreeMap<String, Value>>, EngineError> {
    let known = all(family(name), of_family)?;
    if known.is_empty() {
        return Ok(None);
    }
    let listed = || known.keys().map(|release| format!("{}@{release}", family(name))).collect::<Vec<_>>().join(", ");
    let command = EngineName::from(name).release().and_then(|release| known.get(&release)).ok_or_else(|| {
        let what = format!("there is no `{name}`; there are {}", listed());
        EngineError::Setting { engine: family(name).into(), key: KEY.into(), what }
    })?;
    let common = of_family.iter().filter(|(key, _)| COMMON.contains(&key.as_str()));
    let mut settings: BTreeMap<String, Value> = common.map(|(key, value)| (key.clone(), value.clone())).collect();
    settings.extend(own.clone());
    settings.insert("command".into(), command.clone());
    Ok(Some(settings))
}

/// The releases that the settings of a program name, oldest first.
pub(crate) fn named(name: &str, settings: &BTreeMap<String, Value>) -> Result<Vec<Release>, EngineError> {
    all(name, settings).map(|known| known.into_keys().collect())
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn settings(value: Value) -> BTreeMap<String, Value> {
        serde_json::from_value(value).unwrap()
    }

    #[test]
    fn a_release_has_its_own_command_and_how_its_program_is_run() {
        let program = settings(json!({
            "command": ["new"], "run_in": "code", "gain": 2, "releases": {"1.10": "python3 'a b.py'", "1.9": ["old", "-v"]}
        }));
        let of = |name: &str, own| of_release(name, &program, &settings(own)).unwrap().unwrap();
        assert_eq!(of("mine@1.10", json!({})), settings(json!({"command": ["python3", "a b.py"], "run_in": "code"})));
        assert_eq!(
            of("mine@1.9", json!({"gain": 3})),
            settings(json!({"command": ["old", "-v"], "run_in": "code", "gain": 3}))
        );
        let names: Vec<String> = named("mine", &program).unwrap().iter().map(Release::to_string).collect();
        assert_eq!(names, ["1.9", "1.10"]);
        let told = of_release("mine@2", &program, &BTreeMap::new()).unwrap_err().to_string();
        assert!(told.contains("engines.mine.releases") && told.contains("mine@1.9, mine@1.10"), "{told}");
        assert_eq!(of_release("mine@2", &settings(json!({"command": ["new"]})), &BTreeMap::new()).unwrap(), None);
    }

    #[test]
    fn releases_that_are_none_are_refused() {
        for releases in
            [json!(["1.0"]), json!({"../x": ["a"]}), json!({"1.0": []}), json!({"1.0": 3}), json!({"1.0": "'a"})]
        {
            let told = named("mine", &settings(json!({"releases": releases}))).unwrap_err().to_string();
            assert!(told.starts_with("engines.mine.releases: "), "{told}");
        }
    }
}
