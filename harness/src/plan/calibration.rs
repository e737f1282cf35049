//! Calibration: who reads the scenes of known answer besides what specs ask, each engine once for each of its settings.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use luminaire::scene::Transport;
use sha2::{Digest, Sha256};

use super::roster::Chosen;
use super::{Asked, Plan, Planner, Selection};
use crate::engines::{ExternalJob, Job};
use crate::procedures::{Task, known};
use crate::record::EngineName;
use crate::spec::{Budget, Case, EngineSettings, SpecError};
use crate::system::digest::hexadecimal;

/// A standard error that decides at the tolerances of reflected light, and the time that slow engines need for it.
const BUDGET: Budget = Budget { relative_error: 4e-3, seconds: 60.0 };

/// An engine as it is set in a case.
struct Subject<'a> {
    chosen: Chosen,
    /// Its name, what really runs, its settings: once in a run.
    key: (EngineName, Option<String>, BTreeMap<String, serde_json::Value>),
    case: &'a str,
}

impl Planner<'_> {
    /// The scenes of known answer for every renderer that reads something in the cases, and for the simulator; those of
    /// reflected light where any is asked for. Nothing in them follows from other readings.
    pub fn calibrations(&mut self, cases: &[Case], plans: &[Plan]) -> Result<Vec<(Case, Plan)>, SpecError> {
        let (mut subjects, mut reflects) = (vec![], false);
        for (case, plan) in cases.iter().zip(plans) {
            let runs = plan.runs.iter().map(|run| (&plan.engines[run.engine], &run.job));
            for (planned, job) in runs.filter(|(planned, _)| !planned.engine.is_witness()) {
                reflects |= job.transport != Transport::Direct;
                let fingerprint = planned.instrument().map(|i| i.version.fingerprint);
                let key = (planned.engine.name(), fingerprint, job.settings.clone());
                let chosen = (Arc::clone(&planned.engine), planned.asked);
                subjects.push(Subject { chosen, key, case: &case.name });
            }
        }
        self.known(subjects, reflects)
    }

    /// All of them, for the engines of cases.
    pub fn examinations(&mut self, cases: &[Case]) -> Result<Vec<(Case, Plan)>, SpecError> {
        let mut subjects = vec![];
        for case in cases {
            self.roster.check_settings(case)?;
            let chosen = self.roster.chosen(case, self.selection)?;
            for chosen in chosen.into_iter().filter(|(_, asked)| *asked != Asked::AsReference) {
                let key = (chosen.0.name(), None, case.settings_of(&chosen.0.name()));
                subjects.push(Subject { chosen, key, case: &case.name });
            }
        }
        self.known(subjects, true)
    }

    fn known(&mut self, subjects: Vec<Subject<'_>>, reflects: bool) -> Result<Vec<(Case, Plan)>, SpecError> {
        // An engine has one line a procedure in a case: further settings of it make a case of their own.
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
            let set = |s: &Subject<'_>| (s.key.0.to_string(), EngineSettings(s.key.2.clone()));
            let case = Case {
                name: if k == 0 { known::CASE.to_owned() } else { format!("{}/{}", known::CASE, group[0].case) },
                title: "Scenes of known answer".to_owned(),
                path: PathBuf::from("(built in)"),
                sha256: sha256.clone(),
                budget: BUDGET,
                engines: Some(group.iter().map(set).collect()),
                ..Case::default()
            };
            let is_asked = group.iter().any(|s| s.key.0 == EngineName::SIMULATOR);
            let others = simulator.clone().into_iter().filter(|_| !is_asked);
            let chosen = others.chain(group.into_iter().map(|s| s.chosen)).collect();
            let plan = self.whole(&case, scenes.clone(), chosen);
            cases.push((case, plan));
        }
        Ok(cases)
    }
}
