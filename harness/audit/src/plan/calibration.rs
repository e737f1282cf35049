//! Plans the scenes of known answer: each engine reads them once for each of its settings.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use luxproof_scene::Transport;
use sha2::{Digest, Sha256};

use super::engine_selection::Chosen;
use super::{Plan, Planner, Selection, SelectionReason};
use luxproof_engines::{ExternalJob, Job};
use luxproof_model::EngineName;
use luxproof_process::digest::hexadecimal;
use luxproof_spec::procedures::{Task, known};
use luxproof_spec::{Budget, Case, EngineSettings, SpecError};

/// A standard error that decides at the tolerances of reflected light, and the seconds that slow engines need for it.
const BUDGET: Budget = Budget { relative_error: 4e-3, seconds: 60.0 };

/// An engine with its settings in a case.
struct Subject<'a> {
    chosen: Chosen,
    /// Its name, the hash of its files and its settings, which occur once in a run.
    key: (EngineName, Option<String>, BTreeMap<String, serde_json::Value>),
    case: &'a str,
}

impl Planner<'_> {
    /// Plans the scenes of known answer for every renderer that runs in the cases, and for the simulator.
    ///
    /// The scenes of reflected light are among them where a case requests reflected light. They have no shortcuts.
    pub fn calibrations(&mut self, cases: &[Case], plans: &[Plan]) -> Result<Vec<(Case, Plan)>, SpecError> {
        let (mut subjects, mut reflects) = (vec![], false);
        for (case, plan) in cases.iter().zip(plans) {
            let runs = plan.runs.iter().map(|run| (&plan.engines[run.engine], &run.job));
            for (planned, job) in runs.filter(|(planned, _)| !planned.engine.is_reference_engine()) {
                reflects |= job.transport != Transport::Direct;
                let fingerprint = planned.instrument().map(|i| i.version.fingerprint);
                let key = (planned.engine.name(), fingerprint, job.settings.clone());
                let chosen = (Arc::clone(&planned.engine), planned.asked);
                subjects.push(Subject { chosen, key, case: &case.name });
            }
        }
        self.plan_known_scenes(subjects, reflects)
    }

    /// Plans all scenes of known answer for the engines of cases.
    pub fn examinations(&mut self, cases: &[Case]) -> Result<Vec<(Case, Plan)>, SpecError> {
        let mut subjects = vec![];
        for case in cases {
            self.roster.check_settings(case)?;
            let chosen = self.roster.chosen(case, self.selection)?;
            for chosen in chosen.into_iter().filter(|(_, asked)| *asked != SelectionReason::AsReference) {
                let key = (chosen.0.name(), None, case.settings_of(&chosen.0.name()));
                subjects.push(Subject { chosen, key, case: &case.name });
            }
        }
        self.plan_known_scenes(subjects, true)
    }

    /// Plans the scenes of known answer for engines, in as few cases as their settings allow.
    fn plan_known_scenes(
        &mut self,
        subjects: Vec<Subject<'_>>,
        reflects: bool,
    ) -> Result<Vec<(Case, Plan)>, SpecError> {
        // An engine runs a procedure once in a case, so further settings of it need another case.
        let mut groups: Vec<Vec<Subject<'_>>> = vec![];
        for subject in subjects {
            if groups.iter().flatten().any(|other| other.key == subject.key) {
                continue;
            }
            match groups.iter_mut().find(|group| group.iter().all(|other| other.key.0 != subject.key.0)) {
                Some(group) => group.push(subject),
                None => groups.push(vec![subject]),
            }
        }
        let all = known::tasks();
        let mut hash = Sha256::new();
        for task in &all {
            hash.update(ExternalJob::of(&Job::of_task(&Case::default(), task)).to_json().unwrap_or_default());
        }
        let sha256 = hexadecimal(&hash.finalize());
        let scenes: Vec<Task> = all.into_iter().filter(|t| reflects || t.transport == Transport::Direct).collect();
        let simulator = self.roster.chosen(&Case::default(), &Selection::default())?;
        let simulator = simulator.into_iter().find(|(engine, _)| engine.name() == EngineName::SIMULATOR);
        let mut cases = vec![];
        for (k, group) in groups.into_iter().enumerate() {
            let settings = group.iter().map(|s| (s.key.0.to_string(), EngineSettings(s.key.2.clone()))).collect();
            let case = Case {
                name: if k == 0 { known::CASE.to_owned() } else { format!("{}/{}", known::CASE, group[0].case) },
                title: "Scenes of known answer".to_owned(),
                path: PathBuf::from("(built in)"),
                sha256: sha256.clone(),
                budget: BUDGET,
                engines: Some(settings),
                ..Case::default()
            };
            let is_asked = group.iter().any(|s| s.key.0 == EngineName::SIMULATOR);
            let others = simulator.clone().into_iter().filter(|_| !is_asked);
            let chosen = others.chain(group.into_iter().map(|s| s.chosen)).collect();
            let plan = self.plan_all(&case, scenes.clone(), chosen);
            cases.push((case, plan));
        }
        Ok(cases)
    }
}
