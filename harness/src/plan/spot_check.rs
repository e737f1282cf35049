//! Spot checks: a random part of what is not rendered is rendered all the same. Where it is not what the shortcut says, everything is.

use std::time::Duration;

use luminaire::scene::Transport;

use super::Run;
use crate::engines::{Job, Measurement};
use crate::record::Uncertainty;
use crate::spec::Budget;

/// The part of what a run does not render that is looked at, one reading at least.
const PART: f64 = 0.05;
/// Of a run's seconds: a renderer hardly reads few meters sooner than many.
const SHARE_OF_SECONDS: f64 = 0.25;
/// Standard errors that two readings of one quantity may be apart.
const COVERAGE: f64 = 5.0;
/// What renderers' single-precision coordinates make of two meters that mirror each other, relative to the brightest reading.
const ROUNDING: f64 = 2e-5;

/// Draws the stations to be looked at, for every run of a case by itself: what one engine reads says nothing of another. Witnesses
/// read every meter anyway.
pub(super) fn draw(runs: &mut [Run], is_witness: impl Fn(&Run) -> bool, seed: u64) {
    let mut random = fastrand::Rng::with_seed(seed);
    for run in runs.iter_mut().filter(|run| !is_witness(run)) {
        let mut drawn = run.shortcut.unseen(&run.job);
        random.shuffle(&mut drawn);
        drawn.truncate((PART * drawn.len() as f64).ceil() as usize);
        drawn.sort_unstable();
        run.spot_check = drawn;
        run.grant(run.job.budget);
    }
}

impl Run {
    /// Gives the run a budget, whose seconds what is rendered and the spot check share, where light is reflected: direct light takes next to none, and
    /// engines plan its detail by them.
    pub fn grant(&mut self, budget: Budget) {
        self.job.budget = budget;
        self.shortcut.job.budget = Budget { seconds: self.seconds(1.0 - self.share_of_spot_check()), ..budget };
    }

    fn seconds(&self, share: f64) -> f64 {
        if self.job.transport == Transport::Direct { self.job.budget.seconds } else { share * self.job.budget.seconds }
    }

    /// By the clock, how long what is rendered may be sampled, and the spot check.
    pub fn patience(&self) -> [Duration; 2] {
        let (all, share) = (self.job.budget.patience(), self.share_of_spot_check());
        [1.0 - share, share].map(|share| all.mul_f64(share))
    }

    /// The part of its seconds that the spot check has.
    fn share_of_spot_check(&self) -> f64 {
        match (self.spot_check.is_empty(), self.shortcut.job.stations.is_empty()) {
            (true, _) => 0.0,
            (false, false) => SHARE_OF_SECONDS,
            (false, true) => 1.0,
        }
    }

    /// The job of the spot check: what was asked, at the stations drawn; `None` where none was.
    pub fn spot_check_job(&self) -> Option<Job> {
        let stations: Vec<_> = self.spot_check.iter().map(|&s| self.job.stations[s].clone()).collect();
        let budget = Budget { seconds: self.seconds(self.share_of_spot_check()), ..self.job.budget };
        (!stations.is_empty()).then(|| Job { stations, budget, ..self.job.clone() })
    }

    /// Holds what a spot check read against what a shortcut says; the error names the first reading that is another.
    pub fn hold(&self, said: &Measurement, seen: &Measurement) -> Result<(), String> {
        let brightest = said.estimates.iter().chain(&seen.estimates).map(|e| e.value).fold(0.0, f64::max);
        for (&station, seen) in self.spot_check.iter().zip(&seen.estimates) {
            let said = &said.estimates[station];
            // Of what one of them did not see nothing follows.
            if [said, seen].iter().any(|e| e.uncertainty == Uncertainty::NotSeen) {
                continue;
            }
            let apart_by_chance = Uncertainty::of_sum([(1.0, said.uncertainty), (-1.0, seen.uncertainty)]);
            let noise = COVERAGE * apart_by_chance.standard_error().unwrap_or(0.0) + apart_by_chance.bound();
            let allowed = noise + self.declared * said.value.max(seen.value) + ROUNDING * brightest;
            let apart = (said.value - seen.value).abs();
            if apart.is_nan() || allowed.is_nan() || apart > allowed {
                return Err(format!(
                    "a spot check contradicts a shortcut: {} reads {} lx where {} lx follow ({}); everything was rendered instead",
                    self.job.stations[station].id,
                    seen.value,
                    said.value,
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
    use crate::engines::fixtures;
    use crate::plan::{Fill, Shortcut};
    use crate::record::Estimate;

    fn run(points: usize) -> Run {
        let points_m: Vec<[f64; 3]> = (0..points).map(|k| [k as f64, 1.0, 1.0]).collect();
        let mut job = fixtures::s1(luminaire::scene::Transport::Direct);
        job.stations = fixtures::stations(&points_m, DVec3::Z);
        let mut shortcut = Shortcut::none(&job);
        shortcut.job.stations.truncate(1);
        for fill in &mut shortcut.fill[1..] {
            *fill = Fill::Mirrors { station: 0, by: "a false claim".into() };
        }
        Run { engine: 0, task: 0, job, approximation: None, declared: 0.0, shortcut, spot_check: vec![] }
    }

    fn measurement(values: &[f64], std_error: Option<f64>) -> Measurement {
        let uncertainty = std_error.map_or(Uncertainty::Unstated, |e| Uncertainty::sampled(e, None));
        let estimate = |&value| Estimate { value, uncertainty };
        Measurement { estimates: values.iter().map(estimate).collect(), ..Measurement::default() }
    }

    #[test]
    fn a_twentieth_of_every_run_is_drawn_one_at_least_by_the_seed() {
        for (points, wanted) in [(1, 0), (2, 1), (21, 1), (22, 2), (401, 20)] {
            let mut runs = [run(points)];
            draw(&mut runs, |_| false, 1);
            assert_eq!(runs[0].spot_check.len(), wanted, "{points}");
            assert!(runs[0].spot_check.iter().all(|s| (1..points).contains(s)));
        }
        // A run with much to look at takes nothing from one with little, and a witness is left alone.
        let mut runs = [run(2), run(401), run(1), run(41), run(41)];
        runs[4].engine = 1;
        draw(&mut runs, |run| run.engine == 1, 1);
        assert_eq!(runs.map(|r| r.spot_check.len()), [1, 20, 0, 2, 0]);
        let drawn = |seed| {
            let mut runs = [run(401), run(401)];
            draw(&mut runs, |_| false, seed);
            runs.map(|r| r.spot_check)
        };
        assert_eq!(drawn(1), drawn(1));
        assert_ne!(drawn(1), drawn(2));
    }

    #[test]
    fn a_run_and_its_spot_check_take_no_more_seconds_than_the_run_was_given() {
        let budget = Budget { relative_error: 0.01, seconds: 60.0 };
        let seconds = |run: &Run| (run.shortcut.job.budget.seconds, run.spot_check_job().map(|j| j.budget.seconds));
        let mut runs = [run(1), run(21), run(21)];
        runs[2].shortcut.job.stations.clear();
        draw(&mut runs, |_| false, 1);
        for run in &mut runs {
            run.grant(budget);
            assert_eq!((run.job.budget, run.shortcut.job.budget.relative_error), (budget, 0.01));
        }
        for seconds in [5.0, 20.0, 30.0, 60.0, 600.0] {
            runs[1].grant(Budget { seconds, ..budget });
            let patience: Duration = runs[1].patience().iter().sum();
            assert!(
                patience <= runs[1].job.budget.patience() && patience.as_secs_f64() <= seconds.max(15.0),
                "{patience:?}"
            );
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
        assert_eq!(job.stations[0].id.to_string(), "m[2]");
        let said = |values: &[f64], e| run.shortcut.complete(measurement(values, e), &run.job);
        assert!(run.hold(&said(&[5.0], None), &measurement(&[5.0], None)).is_ok());
        assert!(run.hold(&said(&[5.0], Some(0.01)), &measurement(&[5.06], Some(0.01))).is_ok());
        for (wrong, e) in [(5.01, None), (5.08, Some(0.01)), (0.0, Some(0.01)), (f64::NAN, None)] {
            let error = run.hold(&said(&[5.0], e), &measurement(&[wrong], e)).unwrap_err();
            assert!(error.contains("m[2]"), "{error}");
        }
    }
}
