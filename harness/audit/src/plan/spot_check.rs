//! Spot checks: a random part of the sensors that a shortcut leaves out is rendered, to check the shortcut.

use std::time::Duration;

use luxproof_scene::Transport;

use super::Run;
use luxproof_engines::{Job, Measurement};
use luxproof_model::Uncertainty;
use luxproof_spec::Budget;

/// The share of the left-out sensors that is checked, at least one sensor.
const CHECKED_SHARE: f64 = 0.05;
/// The share of a run's seconds: most renderers need as long for few meters as for many.
const SHARE_OF_SECONDS: f64 = 0.25;
/// The largest difference of two readings of one quantity, in standard errors.
const MAX_SIGMAS: f64 = 5.0;
/// The largest difference of two mirrored meters by single-precision coordinates, relative to the brightest reading.
const MAX_ROUNDING: f64 = 2e-5;

/// Draws the checked sensors of each run separately, since one engine's readings say nothing about another's.
///
/// Reference engines have no spot check: they read every meter.
pub(super) fn draw(runs: &mut [Run], is_reference_engine: impl Fn(&Run) -> bool, seed: u64) {
    let mut random = fastrand::Rng::with_seed(seed);
    for run in runs.iter_mut().filter(|run| !is_reference_engine(run)) {
        let mut drawn = run.shortcut.unseen(&run.job);
        random.shuffle(&mut drawn);
        drawn.truncate((CHECKED_SHARE * drawn.len() as f64).ceil() as usize);
        drawn.sort_unstable();
        run.spot_check = drawn;
        run.grant(run.job.budget);
    }
}

impl Run {
    /// Sets the budget of the run. The rendered job and the spot check share its seconds.
    ///
    /// Both get all seconds of direct light, which takes little time; engines choose its detail by the seconds.
    pub fn grant(&mut self, budget: Budget) {
        self.job.budget = budget;
        self.shortcut.job.budget = Budget { seconds: self.seconds(1.0 - self.share_of_spot_check()), ..budget };
    }

    /// The seconds of a job that has this share of the run.
    fn seconds(&self, share: f64) -> f64 {
        if self.job.transport == Transport::Direct { self.job.budget.seconds } else { share * self.job.budget.seconds }
    }

    /// How long the rendered job and the spot check may be sampled, by the clock.
    pub fn patience(&self) -> [Duration; 2] {
        let (all, share) = (self.job.budget.patience(), self.share_of_spot_check());
        [1.0 - share, share].map(|share| all.mul_f64(share))
    }

    /// The spot check's share of the seconds.
    fn share_of_spot_check(&self) -> f64 {
        match (self.spot_check.is_empty(), self.shortcut.job.sensors.is_empty()) {
            (true, _) => 0.0,
            (false, false) => SHARE_OF_SECONDS,
            (false, true) => 1.0,
        }
    }

    /// The job of the spot check, at the drawn sensors; `None` where there are none.
    pub fn spot_check_job(&self) -> Option<Job> {
        let sensors: Vec<_> = self.spot_check.iter().map(|&s| self.job.sensors[s].clone()).collect();
        let budget = Budget { seconds: self.seconds(self.share_of_spot_check()), ..self.job.budget };
        (!sensors.is_empty()).then(|| Job { sensors, budget, ..self.job.clone() })
    }

    /// Compares a spot check with the readings that a shortcut filled in; the error names the first one that differs.
    pub fn hold(&self, filled: &Measurement, checked: &Measurement) -> Result<(), String> {
        let brightest = filled.estimates.iter().chain(&checked.estimates).map(|e| e.value).fold(0.0, f64::max);
        for (&sensor, checked) in self.spot_check.iter().zip(&checked.estimates) {
            let filled = &filled.estimates[sensor];
            // A reading that met no light supports no conclusion.
            if [filled, checked].iter().any(|e| e.uncertainty == Uncertainty::NotSeen) {
                continue;
            }
            let of_difference = Uncertainty::of_sum([(1.0, filled.uncertainty), (-1.0, checked.uncertainty)]);
            let noise = MAX_SIGMAS * of_difference.standard_error().unwrap_or(0.0) + of_difference.bound();
            let allowed = noise + self.declared * filled.value.max(checked.value) + MAX_ROUNDING * brightest;
            let difference = (filled.value - checked.value).abs();
            if difference.is_nan() || allowed.is_nan() || difference > allowed {
                return Err(format!(
                    "a spot check contradicts a shortcut: {} reads {} lx where {} lx follow ({}); everything was rendered instead",
                    self.job.sensors[sensor].id,
                    checked.value,
                    filled.value,
                    self.shortcut.omissions.iter().map(|o| o.reason.as_str()).collect::<Vec<_>>().join("; ")
                ));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::plan::{Fill, Shortcut};
    use luxproof_engines::fixtures;
    use luxproof_model::Estimate;

    fn run(points: usize) -> Run {
        let points_m: Vec<[f64; 3]> = (0..points).map(|k| [k as f64, 1.0, 1.0]).collect();
        let mut job = fixtures::s1(luxproof_scene::Transport::Direct);
        job.sensors = fixtures::sensors(&points_m, DVec3::Z);
        let mut shortcut = Shortcut::none(&job);
        shortcut.job.sensors.truncate(1);
        for fill in &mut shortcut.fill[1..] {
            *fill = Fill::Mirrors { sensor: 0, by: "a false claim".into() };
        }
        Run { engine: 0, task: 0, job, approximation: None, declared: 0.0, shortcut, spot_check: vec![] }
    }

    fn measurement(values: &[f64], std_error: Option<f64>) -> Measurement {
        let uncertainty = std_error.map_or(Uncertainty::Unstated, |e| Uncertainty::sampled(e, None));
        let estimates = values.iter().map(|&value| Estimate { value, uncertainty }).collect();
        Measurement { estimates, ..Measurement::default() }
    }

    #[test]
    fn a_twentieth_of_every_run_is_drawn_one_at_least_by_the_seed() {
        for (points, wanted) in [(1, 0), (2, 1), (21, 1), (22, 2), (401, 20)] {
            let mut runs = [run(points)];
            draw(&mut runs, |_| false, 1);
            assert_eq!(runs[0].spot_check.len(), wanted, "{points}");
            assert!(runs[0].spot_check.iter().all(|s| (1..points).contains(s)));
        }
        // Each run draws its own sensors, and a reference engine has no spot check.
        let mut runs = [run(2), run(401), run(1), run(41), run(41)];
        runs[4].engine = 1;
        draw(&mut runs, |run| run.engine == 1, 1);
        assert_eq!(runs.map(|r| r.spot_check.len()), [1, 20, 0, 2, 0]);
        assert_eq!(drawn_stations(1), drawn_stations(1));
        assert_ne!(drawn_stations(1), drawn_stations(2));
    }

    fn drawn_stations(seed: u64) -> [Vec<usize>; 2] {
        let mut runs = [run(401), run(401)];
        draw(&mut runs, |_| false, seed);
        runs.map(|r| r.spot_check)
    }

    #[test]
    fn a_run_and_its_spot_check_take_no_more_seconds_than_the_run_was_given() {
        let budget = Budget { relative_error: 0.01, seconds: 60.0 };
        let seconds = |run: &Run| (run.shortcut.job.budget.seconds, run.spot_check_job().map(|j| j.budget.seconds));
        let mut runs = [run(1), run(21), run(21)];
        runs[2].shortcut.job.sensors.clear();
        draw(&mut runs, |_| false, 1);
        for run in &mut runs {
            run.grant(budget);
            assert_eq!((run.job.budget, run.shortcut.job.budget.relative_error), (budget, 0.01));
        }
        for seconds in [5.0, 20.0, 30.0, 60.0, 600.0] {
            runs[1].grant(Budget { seconds, ..budget });
            let patience: Duration = runs[1].patience().iter().sum();
            assert!(patience <= runs[1].job.budget.patience(), "{patience:?}");
        }
        runs[1].grant(budget);
        // Straight from the luminaires all is detail.
        assert_eq!(runs.each_ref().map(seconds), [(60.0, None), (60.0, Some(60.0)), (60.0, Some(60.0))]);
        for run in &mut runs {
            run.job.transport = fixtures::CONVERGED;
            run.grant(budget);
        }
        assert_eq!(runs.each_ref().map(seconds), [(60.0, None), (45.0, Some(15.0)), (0.0, Some(60.0))]);
    }

    #[test]
    fn a_false_claim_disagrees_and_noise_does_not() {
        let mut run = run(3);
        run.spot_check = vec![2];
        let job = run.spot_check_job().unwrap();
        assert_eq!(job.sensors[0].id.to_string(), "m[2]");
        let filled = |values: &[f64], e| run.shortcut.complete(measurement(values, e), &run.job);
        assert!(run.hold(&filled(&[5.0], None), &measurement(&[5.0], None)).is_ok());
        assert!(run.hold(&filled(&[5.0], Some(0.01)), &measurement(&[5.06], Some(0.01))).is_ok());
        for (wrong, e) in [(5.01, None), (5.08, Some(0.01)), (0.0, Some(0.01)), (f64::NAN, None)] {
            let error = run.hold(&filled(&[5.0], e), &measurement(&[wrong], e)).unwrap_err();
            assert!(error.contains("m[2]"), "{error}");
        }
    }
    /// A measurement of one value within a bound, filled in or checked.
    fn bounded(value: f64, bound: f64) -> Measurement {
        let estimate = Estimate { value, uncertainty: Uncertainty::Bound(bound) };
        Measurement { estimates: vec![estimate; 2], ..Measurement::default() }
    }

    #[test]
    fn bounds_of_both_readings_and_the_declared_part_of_the_larger_are_allowed() {
        let mut run = run(2);
        run.spot_check = vec![1];
        // Bounds of .1 and .2 lx, and rounding of a ten-thousandth.
        for (checked, is_allowed) in [(5.29, true), (4.71, true), (5.31, false), (4.69, false)] {
            assert_eq!(run.hold(&bounded(5.0, 0.1), &bounded(checked, 0.2)).is_ok(), is_allowed, "{checked}");
        }
        // A tenth of 5.54 lx is .554 lx, and of 5.57 lx it is .557 lx.
        run.declared = 0.1;
        for (other, is_allowed) in [(5.54, true), (5.57, false)] {
            assert_eq!(run.hold(&bounded(5.0, 0.0), &bounded(other, 0.0)).is_ok(), is_allowed, "{other}");
            assert_eq!(run.hold(&bounded(other, 0.0), &bounded(5.0, 0.0)).is_ok(), is_allowed, "{other}");
        }
    }
}
