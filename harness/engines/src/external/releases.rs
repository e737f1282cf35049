//! Releases of a user's program. The setting `releases: {"1.0": [python3, v1.py]}` makes an engine `mine@1.0` of each.

use std::collections::BTreeMap;

use serde_json::Value;

use super::EngineError;
use luxproof_model::{EngineName, Release, family};

/// The setting that lists the releases.
pub(super) const KEY: &str = "releases";

/// The settings that all releases share: how the program runs. All other settings belong to one release.
const COMMON: [&str; 5] = ["procedures", super::RUN_IN, "start_seconds", "shares", "depends_on"];

/// Returns all releases with their commands, oldest first.
pub(super) fn all(name: &str, settings: &BTreeMap<String, Value>) -> Result<BTreeMap<Release, Value>, EngineError> {
    let listed = match settings.get(KEY) {
        None => return Ok(BTreeMap::new()),
        Some(Value::Object(listed)) => listed,
        Some(_) => {
            let what = "must be commands by release, {\"1.0\": [program, arguments...]}".to_owned();
            return Err(releases_error(name, what));
        }
    };
    let mut all = BTreeMap::new();
    for (release, command) in listed {
        // A spec may contain a very long text, and a message should not.
        let shown: String = release.chars().take(30).collect();
        let parsed: Release = release.parse().map_err(|why| releases_error(name, format!("`{shown}`: {why}")))?;
        let command = command_of(command)
            .ok_or_else(|| releases_error(name, format!("`{shown}` must have a program and its arguments")))?;
        all.insert(parsed, command);
    }
    Ok(all)
}

/// Returns an error about the setting that lists the releases.
fn releases_error(name: &str, what: String) -> EngineError {
    EngineError::Setting { engine: name.into(), key: KEY.into(), what }
}

/// Returns a command as a list of words. The value is such a list, or a line as typed in a shell.
fn command_of(value: &Value) -> Option<Value> {
    let words = match value {
        Value::String(line) => shlex::split(line)?,
        other => serde_json::from_value::<Vec<String>>(other.clone()).ok()?,
    };
    words.first().is_some_and(|word| !word.is_empty()).then(|| words.into())
}

/// Returns the settings of a release by its name, or `None` if the program has no releases.
///
/// `of_family` are the settings of the program, `own` those that a spec has for the release itself.
pub fn of_release(
    name: &str,
    of_family: &BTreeMap<String, Value>,
    own: &BTreeMap<String, Value>,
) -> Result<Option<BTreeMap<String, Value>>, EngineError> {
    let known = all(family(name), of_family)?;
    if known.is_empty() {
        return Ok(None);
    }
    let Some(command) = EngineName::from(name).release().and_then(|release| known.get(&release)) else {
        let listed: Vec<String> = known.keys().map(|release| format!("{}@{release}", family(name))).collect();
        return Err(releases_error(family(name), format!("there is no `{name}`; there are {}", listed.join(", "))));
    };
    let common = of_family.iter().filter(|(key, _)| COMMON.contains(&key.as_str()));
    let mut settings: BTreeMap<String, Value> = common.map(|(key, value)| (key.clone(), value.clone())).collect();
    settings.extend(own.clone());
    settings.insert("command".into(), command.clone());
    Ok(Some(settings))
}

/// Returns the releases in the settings of a program, oldest first.
pub fn named(name: &str, settings: &BTreeMap<String, Value>) -> Result<Vec<Release>, EngineError> {
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
        let message = of_release("mine@2", &program, &BTreeMap::new()).unwrap_err().to_string();
        assert!(message.contains("engines.mine.releases") && message.contains("mine@1.9, mine@1.10"), "{message}");
        assert_eq!(of_release("mine@2", &settings(json!({"command": ["new"]})), &BTreeMap::new()).unwrap(), None);
    }

    #[test]
    fn releases_that_are_none_are_refused() {
        for releases in
            [json!(["1.0"]), json!({"../x": ["a"]}), json!({"1.0": []}), json!({"1.0": 3}), json!({"1.0": "'a"})]
        {
            let message = named("mine", &settings(json!({"releases": releases}))).unwrap_err().to_string();
            assert!(message.starts_with("engines.mine.releases: "), "{message}");
        }
    }
}
