//! Whether the cases of a submission are the public ones, by content and tolerance: names prove nothing.

use std::fmt;

use luxproof_model::{Comparison, HiddenVariant, Report, Tolerance};

use crate::{Capabilities, Capability};

/// How a case of a submission differs from the site's.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CaseDifference {
    /// No run of the site has it.
    Unknown { case: String },
    /// It measures something else.
    Content { case: String, procedure: &'static str },
    /// It allows other deviations.
    Tolerance { case: String, procedure: &'static str, meter: String },
    /// It is a hidden variant: the publisher draws these.
    Hidden { case: String },
}

impl fmt::Display for CaseDifference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unknown { case } => {
                write!(f, "no run of the site has the case {case}, so nothing says that it is the public one")
            }
            Self::Content { case, procedure } => {
                write!(f, "{procedure} of {case} measures something else than the public case")
            }
            Self::Tolerance { case, procedure, meter } => {
                write!(f, "{procedure} of {case} has another tolerance than the public case at {meter}")
            }
            Self::Hidden { case } => write!(f, "{case} is a hidden variant, and those are drawn by the publisher"),
        }
    }
}

/// The content of a public case, as the runs of a site have it.
struct Published<'a> {
    content: &'a str,
    tolerances: Vec<(&'a str, Tolerance)>,
}

/// How the cases of a submission that count for cards differ from those of a site.
pub fn compare_cases(capabilities: &Capabilities, submitted: &Report, site: &[&Report]) -> Vec<CaseDifference> {
    let mut found = vec![];
    for case in submitted.cases.iter().filter(|case| !case.is_calibration) {
        if let Some(HiddenVariant { of, .. }) = &case.hidden_variant {
            found.push(CaseDifference::Hidden { case: of.clone() });
            continue;
        }
        let is_selected = |c: &Capability| c.cases.iter().any(|selector| selector.case == case.name);
        if !capabilities.capabilities.iter().any(is_selected) {
            continue;
        }
        for recording in submitted.recordings.iter().filter(|r| r.key.case == case.name && r.failure.is_none()) {
            let procedure = recording.key.procedure;
            let Some(published) = published(&case.name, recording.key.procedure, site) else {
                found.push(CaseDifference::Unknown { case: case.name.clone() });
                break;
            };
            if recording.content_sha256 != published.content {
                found.push(CaseDifference::Content { case: case.name.clone(), procedure: procedure.name() });
                break;
            }
            let comparisons = submitted.comparisons.iter().filter(|c| c.key == recording.key);
            let other = comparisons.into_iter().find(|c| !published.allows(c));
            if let Some(c) = other {
                let meter = c.meter.to_string();
                found.push(CaseDifference::Tolerance { case: case.name.clone(), procedure: procedure.name(), meter });
                break;
            }
        }
    }
    found
}

/// A procedure of a public case in the first run that has it.
fn published<'a>(case: &str, procedure: luxproof_model::ProcedureId, site: &[&'a Report]) -> Option<Published<'a>> {
    for report in site {
        let is_public = report.cases.iter().any(|c| c.name == case && c.hidden_variant.is_none());
        let mut recordings = report.recordings.iter().filter(|r| is_public && r.key.is_of(case, procedure));
        if let Some(recording) = recordings.find(|r| !r.content_sha256.is_empty()) {
            let comparisons = report.comparisons.iter().filter(|c| c.key.is_of(case, procedure));
            let tolerances = comparisons.map(|c| (c.meter.0.as_str(), c.tolerance)).collect();
            return Some(Published { content: &recording.content_sha256, tolerances });
        }
    }
    None
}

impl Published<'_> {
    /// Whether the public case has the tolerance of a comparison for any engine.
    fn allows(&self, c: &Comparison) -> bool {
        let mut known = self.tolerances.iter().filter(|(meter, _)| *meter == c.meter.0).peekable();
        known.peek().is_none() || known.any(|(_, tolerance)| *tolerance == c.tolerance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{MadeCase, capabilities, report};

    #[test]
    fn a_submission_is_compared_by_content_and_tolerance_and_not_by_name() {
        let site = report("rays", "1", &[MadeCase::new("a").off(0.0, 0.0), MadeCase::new("b").off(0.0, 0.0)]);
        let differences = |submitted: &Report| {
            let found = compare_cases(&capabilities(1), submitted, &[&site]);
            found.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ")
        };
        let same = report("mine", "1", &[MadeCase::new("a").off(0.3, 0.0), MadeCase::new("my-room").off(0.0, 0.0)]);
        assert_eq!(differences(&same), "");
        let mut easier = same.clone();
        easier.recordings[0].content_sha256 = "content of an easier room".to_owned();
        assert_eq!(differences(&easier), "direct_illuminance of a measures something else than the public case");
        let mut wider = same.clone();
        wider.comparisons[0].tolerance.relative = 0.5;
        assert_eq!(
            differences(&wider),
            "direct_illuminance of a has another tolerance than the public case at floor[0]"
        );
        let unknown = report("mine", "1", &[MadeCase::new("c").off(0.0, 0.0)]);
        assert!(differences(&unknown).starts_with("no run of the site has the case c"));
        let hidden = report("mine", "1", &[MadeCase::new("a").hidden(3).off(0.0, 0.0)]);
        assert!(differences(&hidden).starts_with("a is a hidden variant"));
    }
}
