//! Are stated standard errors honest? The scatter of readings of other seeds over what is stated, engine by engine and procedure by procedure.

use itertools::Itertools;
use serde::Serialize;

use super::Repeated;
use super::group::{Finding, Group, counts};
use crate::judge::rejected;
use crate::plan::{Scope, Skip};
use crate::record::{Agreement, EngineName, Estimate, FailureKind};

/// The chance of any false claim in all of a self-test (Holm).
pub(super) const LEVEL: f64 = 1e-3;
/// What readings of other seeds tell of stated errors.
#[derive(Clone, Debug, Serialize)]
pub struct Honesty {
    pub seeds: usize,
    /// Of the family of all claims.
    pub level: f64,
    /// Of an engine in a procedure of a case.
    pub groups: Vec<Group>,
    /// Of all that an engine read.
    pub engines: Vec<OfEngine>,
    /// What was not read, and why.
    pub skips: Vec<Skip>,
    /// Whether an engine that was asked for by name is not there.
    pub is_missed: bool,
}

#[derive(Clone, Debug, Serialize)]
pub struct OfEngine {
    pub engine: EngineName,
    pub version: String,
    pub counted: usize,
    pub all: Option<Agreement>,
    pub finding: Finding,
}

impl OfEngine {
    fn of(engine: &EngineName, read: &[&Repeated]) -> Self {
        let own: Vec<&Repeated> = read.iter().filter(|r| r.key.engine == *engine).copied().collect();
        // Jobs of several cases that are equal are one.
        let is_new = |k: &usize| own[..*k].iter().all(|earlier| earlier.readings != own[*k].readings);
        let (mut meters, mut shared) = (vec![], Some(0.0));
        for read in (0..own.len()).filter(is_new).map(|k| own[k]) {
            let counted: Vec<Vec<Estimate>> = read.readings.iter().filter(|m| counts(m)).cloned().collect();
            if !counted.is_empty() {
                shared = shared.zip(read.shared()).map(|(all, of_one)| all + of_one * counted.len() as f64);
                meters.extend(counted);
            }
        }
        let all = Agreement::of(&meters, shared.map(|all| all / meters.len() as f64));
        let version = own.first().map(|r| r.version.clone()).unwrap_or_default();
        Self { engine: engine.clone(), version, counted: meters.len(), all, finding: Finding::of(all.as_ref()) }
    }
}

impl Honesty {
    pub(super) fn of(seeds: usize, found: &[Repeated]) -> Self {
        let declined = |r: &&Repeated| r.failure.as_ref().is_some_and(|f| f.kind == FailureKind::Declined);
        let skip = |r: &Repeated| {
            let reason = r.failure.as_ref().map_or(String::new(), |f| format!("it declines: {f}"));
            Skip { key: r.key.clone(), scope: Scope::Procedure, reason, saved: None }
        };
        let skips = found.iter().filter(declined).map(skip).collect();
        let read: Vec<&Repeated> = found.iter().filter(|r| !declined(r)).collect();
        let groups = read.iter().map(|r| Group::of(r)).sorted_by(|a, b| a.key.engine.cmp(&b.key.engine)).collect();
        let engines =
            read.iter().map(|r| &r.key.engine).unique().sorted().map(|engine| OfEngine::of(engine, &read)).collect();
        let mut honesty = Self { seeds, level: LEVEL, groups, engines, skips, is_missed: false };
        honesty.decide();
        honesty
    }

    /// Claims that errors are dishonest hold together.
    fn decide(&mut self) {
        let mut claims: Vec<(f64, Agreement, &mut Finding)> = vec![];
        let engines = self.engines.iter_mut().filter_map(|e| Some((e.all?, &mut e.finding)));
        claims.extend(engines.map(|(all, finding)| (all.p_value, all, finding)));
        for Group { all, worst, finding, .. } in &mut self.groups {
            // The one of the two that is the less probable speaks for the group, for two.
            let of_all = all.map(|a| (a.p_value, a));
            let of_worst = worst.as_ref().map(|w| (w.p_value, w.agreement));
            let least = of_all.into_iter().chain(of_worst).min_by(|a, b| a.0.total_cmp(&b.0));
            if let Some((p, agreement)) = least.filter(|_| !finding.is_dishonest()) {
                claims.push((2.0 * p, agreement, finding));
            }
        }
        let p_values: Vec<f64> = claims.iter().map(|(p, ..)| *p).collect();
        for ((_, agreement, finding), rejected) in claims.into_iter().zip(rejected(&p_values, LEVEL)) {
            if rejected {
                *finding = Finding::wrong(&agreement);
            }
        }
    }

    /// Whether nothing is known to be dishonest; what was not read is no finding.
    pub fn is_good(&self) -> bool {
        !self.findings().any(Finding::is_dishonest)
    }

    /// Whether all that was asked for was read, and something was.
    pub fn is_complete(&self) -> bool {
        !(self.is_missed || self.groups.is_empty() || self.findings().any(|f| f == Finding::Failed))
    }

    fn findings(&self) -> impl Iterator<Item = Finding> {
        self.groups.iter().map(|g| g.finding).chain(self.engines.iter().map(|e| e.finding))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::{MeterId, ProcedureId, ReadingKey, Uncertainty};
    use crate::system::random::normal;

    /// What an engine reads of a procedure with ten seeds, eight blocks a reading; it states so many times their standard error.
    fn repeated(random: &mut fastrand::Rng, case: usize, stated: &[f64]) -> Repeated {
        let mut one = |stated: f64| {
            let blocks: Vec<f64> = (0..8).map(|_| 100.0 + normal(random)).collect();
            let Estimate { value, uncertainty } = Estimate::of_samples(&blocks);
            Estimate { value, uncertainty: uncertainty.times(stated) }
        };
        Repeated {
            key: ReadingKey::new(format!("case {case}"), ProcedureId::IndirectIlluminance, "engine"),
            version: "1".to_owned(),
            meters: (0..stated.len()).map(|k| MeterId::new("meter", k)).collect(),
            readings: stated.iter().map(|stated| (0..10).map(|_| one(*stated)).collect()).collect(),
            deviates: vec![],
            failure: None,
        }
    }

    fn honesty(seed: u64, stated: &[&[f64]]) -> Honesty {
        let mut random = fastrand::Rng::with_seed(seed);
        let found: Vec<Repeated> = stated.iter().enumerate().map(|(k, s)| repeated(&mut random, k, s)).collect();
        Honesty::of(10, &found)
    }

    #[test]
    fn honest_engines_are_hardly_ever_called_dishonest() {
        let honest: [&[f64]; 6] = [&[1.0; 4], &[1.0; 1], &[1.0; 12], &[1.0; 4], &[1.0; 2], &[1.0; 6]];
        let wrong = (0..500).filter(|seed| !honesty(*seed, &honest).is_good()).count();
        assert!(wrong <= 2, "{wrong} of 500");
    }

    #[test]
    fn errors_too_small_or_too_large_are_told_with_their_group_and_others_are_not() {
        for (stated, finding) in [(1.0 / 1.6, Finding::TooSmall), (1.6, Finding::TooLarge)] {
            let told = |seed: &u64| {
                let found = honesty(*seed, &[&[1.0; 24], &[stated; 24], &[1.0; 24]]);
                assert!(!found.groups[0].finding.is_dishonest() && !found.groups[2].finding.is_dishonest(), "{found}");
                found.groups[1].finding == finding
            };
            let told = (0..40).filter(told).count();
            assert!(told >= 38, "{finding:?}: {told} of 40");
        }
    }

    #[test]
    fn one_meter_among_many_is_found() {
        let mut stated = [1.0; 40];
        stated[7] = 0.15;
        let found = honesty(1, &[&stated]);
        assert_eq!(found.groups[0].finding, Finding::TooSmall, "{found}");
        assert_eq!(found.groups[0].worst.as_ref().unwrap().meter, MeterId::new("meter", 7));
    }

    #[test]
    fn what_states_no_error_of_sampling_does_not_count_unless_it_moves() {
        let mut read = repeated(&mut fastrand::Rng::with_seed(1), 0, &[1.0; 6]);
        read.readings[4] = vec![Estimate { value: 5.0, uncertainty: Uncertainty::Bound(0.1) }; 2];
        read.readings[5] = vec![Estimate { value: 5.0, uncertainty: Uncertainty::Unstated }; 2];
        read.readings[5][1].value = 6.0;
        let found = Honesty::of(10, std::slice::from_ref(&read));
        assert_eq!((found.groups[0].counted, found.groups[0].not_counted), (4, 2));
        assert!(found.is_good() && found.is_complete());
        read.readings[4][1].value = 5.3;
        let found = Honesty::of(10, &[read]);
        assert_eq!((found.groups[0].finding, found.groups[0].moving.len()), (Finding::Moves, 1));
        assert!(found.to_string().contains("claimed to be determined, and is not: meter[4]"), "{found}");
        assert!(!Honesty::of(10, &[]).is_complete());
    }
}
