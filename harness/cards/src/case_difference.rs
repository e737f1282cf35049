//! Whether the cases of a submission are the public ones, by content and tolerance: names prove nothing.

use std::collections::{HashMap, HashSet};
use std::fmt;

use itertools::Itertools;
use luxproof_model::{Comparison, HiddenVariant, ProcedureId, Recording, Report, Tolerance};
use luxproof_process::printable::Quoted;

use crate::Capabilities;

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
                let case = Quoted(case);
                write!(f, "no run of the site has the case {case}, so nothing says that it is the public one")
            }
            Self::Content { case, procedure } => {
                let case = Quoted(case);
                write!(f, "{procedure} of {case} measures something else than the public case")
            }
            Self::Tolerance { case, procedure, meter } => {
                let (case, meter) = (Quoted(case), Quoted(meter));
                write!(f, "{procedure} of {case} has another tolerance than the public case at {meter}")
            }
            Self::Hidden { case } => {
                write!(f, "{} is a hidden variant, and those are drawn by the publisher", Quoted(case))
            }
        }
    }
}

/// The content of a public case, as the runs of a site have it.
struct Published<'a> {
    content: &'a str,
    /// The tolerances by meter, each once.
    tolerances: HashMap<&'a str, Vec<Tolerance>>,
}

/// How the cases of a submission that count for cards differ from those of a site.
pub fn compare_cases(capabilities: &Capabilities, submitted: &Report, site: &[&Report]) -> Vec<CaseDifference> {
    let selectors = capabilities.capabilities.iter().flat_map(|capability| &capability.cases);
    let selected: HashSet<&str> = selectors.map(|selector| selector.case.as_str()).collect();
    let recordings = submitted.recordings.iter().filter(|recording| recording.failure.is_none());
    let recordings = recordings.map(|recording| (recording.key.case.as_str(), recording)).into_group_map();
    let comparisons = submitted.comparisons.iter().map(|c| (&c.key, c)).into_group_map();
    let published = published(site);
    let mut found = vec![];
    for case in submitted.cases.iter().filter(|case| !case.is_calibration) {
        if let Some(HiddenVariant { of, .. }) = &case.hidden_variant {
            found.push(CaseDifference::Hidden { case: of.clone() });
            continue;
        }
        let of_case = recordings.get(case.name.as_str()).filter(|_| selected.contains(case.name.as_str()));
        let mut differences = of_case.into_iter().flatten().filter_map(|recording| {
            let comparisons = comparisons.get(&recording.key).map_or(&[][..], |comparisons| comparisons);
            difference(recording, comparisons, &published)
        });
        // One is enough to refuse a case.
        found.extend(differences.next());
    }
    found
}

/// How a procedure of a submission differs from that of the public case; `None` if it does not.
fn difference(
    recording: &Recording,
    comparisons: &[&Comparison],
    published: &HashMap<(&str, ProcedureId), Published<'_>>,
) -> Option<CaseDifference> {
    let (case, procedure) = (recording.key.case.clone(), recording.key.procedure);
    let Some(public) = published.get(&(case.as_str(), procedure)) else {
        return Some(CaseDifference::Unknown { case });
    };
    if recording.content_sha256 != public.content {
        return Some(CaseDifference::Content { case, procedure: procedure.name() });
    }
    let other = comparisons.iter().find(|c| !public.allows(c))?;
    Some(CaseDifference::Tolerance { case, procedure: procedure.name(), meter: other.meter.to_string() })
}

/// The procedures of public cases, each in the first run that has it.
fn published<'a>(site: &[&'a Report]) -> HashMap<(&'a str, ProcedureId), Published<'a>> {
    let mut all: HashMap<(&str, ProcedureId), Published<'_>> = HashMap::new();
    for report in site {
        let public: HashSet<&str> =
            report.cases.iter().filter(|c| c.hidden_variant.is_none()).map(|c| c.name.as_str()).collect();
        let mut of_report: HashMap<(&str, ProcedureId), Published<'_>> = HashMap::new();
        for recording in report.recordings.iter().filter(|r| !r.content_sha256.is_empty()) {
            let key = (recording.key.case.as_str(), recording.key.procedure);
            if public.contains(key.0) && !all.contains_key(&key) {
                let content = recording.content_sha256.as_str();
                of_report.entry(key).or_insert_with(|| Published { content, tolerances: HashMap::new() });
            }
        }
        for c in &report.comparisons {
            if let Some(published) = of_report.get_mut(&(c.key.case.as_str(), c.key.procedure)) {
                let tolerances = published.tolerances.entry(&c.meter.0).or_default();
                if !tolerances.contains(&c.tolerance) {
                    tolerances.push(c.tolerance);
                }
            }
        }
        all.extend(of_report);
    }
    all
}

impl Published<'_> {
    /// Whether the public case has the tolerance of a comparison for any engine.
    fn allows(&self, c: &Comparison) -> bool {
        self.tolerances.get(c.meter.0.as_str()).is_none_or(|known| known.contains(&c.tolerance))
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
