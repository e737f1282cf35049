//! The request of a run: the options that, with its specs, determine readings and verdicts.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::ProcedureId;
use crate::{ForeignPath, Sampling, ToleranceClass};

/// The options of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct Request {
    /// Engines by name; empty for those of the specs, or all that are installed.
    pub engines: Vec<String>,
    /// Procedures; empty for all of the specs.
    pub procedures: Vec<ProcedureId>,
    /// Patterns of cases; empty for all.
    pub filter: Vec<String>,
    /// Seed of every random choice.
    pub seed: u64,
    /// Whether everything was rendered.
    pub no_skips: bool,
    /// Null for that of the policy's profile.
    pub sampling: Option<Sampling>,
    /// Whether the calibration scenes were omitted.
    pub no_calibration: bool,
    pub fail_fast: bool,
    /// The named policy; null for the nearest one of each spec.
    pub policy: Option<ForeignPath>,
    pub profile: Option<String>,
    pub tolerance_class: Option<ToleranceClass>,
    /// A relative error that replaces that of the budgets. It is used to reproduce a paper's tables, and `run` has no option for it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub relative_error: Option<f64>,
}

impl Request {
    /// The command for this request.
    pub fn command(&self, specs: &[String]) -> String {
        let mut words = vec!["luxproof".to_owned(), "run".to_owned()];
        words.extend(specs.iter().cloned());
        let procedures: Vec<String> = self.procedures.iter().map(ToString::to_string).collect();
        for (option, values) in [("--engines", &self.engines), ("--procedures", &procedures)] {
            if !values.is_empty() {
                words.extend([option.to_owned(), values.join(",")]);
            }
        }
        let filters = self.filter.iter().map(|pattern| ("--filter", Some(pattern.clone())));
        let valued = [
            ("--seed", Some(self.seed.to_string())),
            ("--sampling", self.sampling.map(|sampling| sampling.to_string())),
            ("--policy", self.policy.as_ref().map(ForeignPath::shown)),
            ("--profile", self.profile.clone()),
            ("--tolerance-class", self.tolerance_class.map(|class| class.to_string())),
        ];
        for (option, value) in filters.chain(valued) {
            words.extend(value.into_iter().flat_map(|value| [option.to_owned(), value]));
        }
        let switches =
            [(self.no_skips, "--no-skips"), (self.no_calibration, "--no-calibration"), (self.fail_fast, "--fail-fast")];
        words.extend(switches.into_iter().filter(|(is_on, _)| *is_on).map(|(_, name)| name.to_owned()));
        // Only a zero byte cannot be quoted, and no name or option contains one.
        let command = shlex::try_join(words.iter().map(String::as_str)).unwrap_or_default();
        self.relative_error.map_or(command.clone(), |error| format!("{command} # until a relative error of {error}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_asks_for_the_same() {
        let request = Request {
            engines: vec!["radiance".to_owned(), "mitsuba".to_owned()],
            filter: vec!["a b".to_owned()],
            seed: 7,
            no_skips: true,
            sampling: Some(Sampling::Accurate),
            ..Request::default()
        };
        let command =
            "luxproof run a.yaml --engines 'radiance,mitsuba' --filter 'a b' --seed 7 --sampling accurate --no-skips";
        assert_eq!(request.command(&["a.yaml".to_owned()]), command);
    }

    #[test]
    fn a_plain_request_is_a_plain_command() {
        let plain = Request { seed: 1, ..Request::default() };
        assert_eq!(
            plain.command(&["a.yaml".to_owned(), "b c.yaml".to_owned()]),
            "luxproof run a.yaml 'b c.yaml' --seed 1"
        );
        let full = Request {
            procedures: vec![ProcedureId::DirectIlluminance, ProcedureId::TotalIlluminance],
            policy: Some(std::path::PathBuf::from("p.yaml").into()),
            profile: Some("ci".to_owned()),
            tolerance_class: Some(ToleranceClass::Design),
            no_calibration: true,
            fail_fast: true,
            relative_error: Some(0.01),
            ..plain
        };
        assert_eq!(
            full.command(&[]),
            "luxproof run --procedures 'direct_illuminance,total_illuminance' --seed 1 --policy p.yaml --profile ci \
             --tolerance-class design --no-calibration --fail-fast # until a relative error of 0.01"
        );
    }
}
