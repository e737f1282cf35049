//! Whether stated standard errors are honest: the scatter over seeds compared with the stated
//! errors, by engine and procedure.

use itertools::Itertools;
use serde::Serialize;

use super::RepeatedReadings;
use super::group::{Finding, Group, states_sampling_error};
use luxproof_model::{EngineName, Estimate, FailureKind, Scope, Skip, SkipCause};
use luxproof_statistics::{Agreement, rejected};

/// The probability of any false claim in a whole self-test (Holm).
pub(super) const FALSE_CLAIM_P: f64 = 1e-3;

/// The findings on stated errors.
#[derive(Clone, Debug, Serialize)]
pub struct Honesty {
    pub seeds: usize,
    /// The probability of any false claim.
    pub level: f64,
    /// The findings for each engine in each procedure of each case.
    pub groups: Vec<Group>,
    /// The findings for each engine over all of its readings.
    pub engines: Vec<EngineHonesty>,
    /// The readings that were skipped, with the reason.
    pub skips: Vec<Skip>,
    /// Whether an engine that was asked for by name is not installed.
    pub is_missed: bool,
}

/// The finding for one engine over all of its readings.
#[derive(Clone, Debug, Serialize)]
pub struct EngineHonesty {
    pub engine: EngineName,
    pub version: String,
    pub counted: usize,
    pub all: Option<Agreement>,
    pub finding: Finding,
}

impl EngineHonesty {
    fn from_readings(engine: &EngineName, read: &[&RepeatedReadings]) -> Self {
        let of_engine: Vec<&RepeatedReadings> = read.iter().filter(|r| r.key.engine == *engine).copied().collect();
        let (mut meters, mut shared) = (vec![], Some(0.0));
        for (k, read) in of_engine.iter().enumerate() {
            // Cases with equal jobs share their readings, which must not count twice.
            if of_engine[..k].iter().any(|earlier| earlier.readings == read.readings) {
                continue;
            }
            let counted: Vec<Vec<Estimate>> =
                read.readings.iter().filter(|m| states_sampling_error(m)).cloned().collect();
            if !counted.is_empty() {
                shared = shared.zip(read.shared_noise()).map(|(all, part)| all + part * counted.len() as f64);
                meters.extend(counted);
            }
        }
        let all = Agreement::of(&meters, shared.map(|all| all / meters.len() as f64));
        let version = of_engine.first().map(|r| r.version.clone()).unwrap_or_default();
        let finding = Finding::from_agreement(all.as_ref());
        Self { engine: engine.clone(), version, counted: meters.len(), all, finding }
    }
}

impl Honesty {
    /// Evaluates the readings of all engines with a number of seeds.
    pub(super) fn from_readings(seeds: usize, found: &[RepeatedReadings]) -> Self {
        let (declined, read): (Vec<&RepeatedReadings>, Vec<&RepeatedReadings>) =
            found.iter().partition(|r| r.failure.as_ref().is_some_and(|f| f.kind == FailureKind::Declined));
        let skips = declined.into_iter().map(make_skip).collect();
        let groups =
            read.iter().map(|r| Group::from_readings(r)).sorted_by(|a, b| a.key.engine.cmp(&b.key.engine)).collect();
        let names = read.iter().map(|r| &r.key.engine).unique().sorted();
        let engines = names.map(|engine| EngineHonesty::from_readings(engine, &read)).collect();
        let mut honesty = Self { seeds, level: FALSE_CLAIM_P, groups, engines, skips, is_missed: false };
        honesty.reject_dishonest();
        honesty
    }

    /// Sets the findings of errors that are proven wrong; all claims share one probability of
    /// error.
    fn reject_dishonest(&mut self) {
        let mut claims: Vec<(f64, Agreement, &mut Finding)> = vec![];
        let engines = self.engines.iter_mut().filter_map(|e| Some((e.all?, &mut e.finding)));
        claims.extend(engines.map(|(all, finding)| (all.p_value, all, finding)));
        for Group { all, worst, finding, .. } in &mut self.groups {
            // The less probable of two p-values counts twice, because it is chosen from two.
            let of_all = all.map(|a| (a.p_value, a));
            let of_worst = worst.as_ref().map(|w| (w.p_value, w.agreement));
            let least = of_all.into_iter().chain(of_worst).min_by(|a, b| a.0.total_cmp(&b.0));
            if let Some((p, agreement)) = least.filter(|_| !finding.is_dishonest()) {
                claims.push((2.0 * p, agreement, finding));
            }
        }
        let p_values: Vec<f64> = claims.iter().map(|(p, ..)| *p).collect();
        for ((_, agreement, finding), rejected) in claims.into_iter().zip(rejected(&p_values, FALSE_CLAIM_P)) {
            if rejected {
                *finding = Finding::from_rejected(&agreement);
            }
        }
    }

    /// Whether no stated error is proven wrong; an engine that was not read proves nothing.
    pub fn is_good(&self) -> bool {
        !self.findings().any(Finding::is_dishonest)
    }

    /// Whether everything that was asked for was read, and there was something.
    pub fn is_complete(&self) -> bool {
        !(self.is_missed || self.groups.is_empty() || self.findings().any(|f| f == Finding::Failed))
    }

    fn findings(&self) -> impl Iterator<Item = Finding> {
        self.groups.iter().map(|g| g.finding).chain(self.engines.iter().map(|e| e.finding))
    }
}

/// The skip of a procedure that an engine declines.
fn make_skip(read: &RepeatedReadings) -> Skip {
    let reason = read.failure.as_ref().map_or(String::new(), |f| format!("it declines: {f}"));
    Skip::new(read.key.clone(), Scope::Procedure, reason).because(SkipCause::Unsupported)
}

#[cfg(test)]
mod tests {
    use super::*;
    use luxproof_model::{MeterId, ProcedureId, ReadingKey, Uncertainty};
    use luxproof_process::random::normal;

    /// A reading of eight noisy blocks; it states a multiple of their standard error.
    fn read_blocks(random: &mut fastrand::Rng, stated: f64) -> Estimate {
        let blocks: Vec<f64> = (0..8).map(|_| 100.0 + normal(random)).collect();
        let Estimate { value, uncertainty } = Estimate::of_samples(&blocks);
        Estimate { value, uncertainty: uncertainty.times(stated) }
    }

    /// Readings of a procedure with ten seeds; each meter states another multiple of its standard
    /// error.
    fn repeat_readings(random: &mut fastrand::Rng, case: usize, stated: &[f64]) -> RepeatedReadings {
        RepeatedReadings {
            key: ReadingKey::new(format!("case {case}"), ProcedureId::IndirectIlluminance, "engine"),
            version: "1".to_owned(),
            meters: (0..stated.len()).map(|k| MeterId::new("meter", k)).collect(),
            readings: stated.iter().map(|stated| (0..10).map(|_| read_blocks(random, *stated)).collect()).collect(),
            deviates: vec![],
            failure: None,
        }
    }

    fn honesty(seed: u64, stated: &[&[f64]]) -> Honesty {
        let mut random = fastrand::Rng::with_seed(seed);
        let found: Vec<RepeatedReadings> =
            stated.iter().enumerate().map(|(k, s)| repeat_readings(&mut random, k, s)).collect();
        Honesty::from_readings(10, &found)
    }

    #[test]
    fn honest_engines_are_rarely_called_dishonest() {
        let honest: [&[f64]; 6] = [&[1.0; 4], &[1.0; 1], &[1.0; 12], &[1.0; 4], &[1.0; 2], &[1.0; 6]];
        let wrong = (0..500).filter(|seed| !honesty(*seed, &honest).is_good()).count();
        assert!(wrong <= 2, "{wrong} of 500");
    }

    #[test]
    fn errors_too_small_or_too_large_are_reported_for_their_group_only() {
        for (stated, finding) in [(1.0 / 1.6, Finding::TooSmall), (1.6, Finding::TooLarge)] {
            let mut detected = 0;
            for seed in 0..40 {
                let found = honesty(seed, &[&[1.0; 24], &[stated; 24], &[1.0; 24]]);
                assert!(!found.groups[0].finding.is_dishonest() && !found.groups[2].finding.is_dishonest(), "{found}");
                detected += usize::from(found.groups[1].finding == finding);
            }
            assert!(detected >= 38, "{finding:?}: {detected} of 40");
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
    fn readings_without_a_sampling_error_count_only_if_they_move() {
        let mut read = repeat_readings(&mut fastrand::Rng::with_seed(1), 0, &[1.0; 6]);
        read.readings[4] = vec![Estimate { value: 5.0, uncertainty: Uncertainty::Bound(0.1) }; 2];
        read.readings[5] = vec![Estimate { value: 5.0, uncertainty: Uncertainty::Unstated }; 2];
        read.readings[5][1].value = 6.0;
        let found = Honesty::from_readings(10, std::slice::from_ref(&read));
        assert_eq!((found.groups[0].counted, found.groups[0].not_counted), (4, 2));
        assert!(found.is_good() && found.is_complete());
        read.readings[4][1].value = 5.3;
        let found = Honesty::from_readings(10, &[read]);
        assert_eq!((found.groups[0].finding, found.groups[0].moving.len()), (Finding::Moves, 1));
        assert!(found.to_string().contains("claimed to be determined, and is not: meter[4]"), "{found}");
        assert!(!Honesty::from_readings(10, &[]).is_complete());
    }
}
