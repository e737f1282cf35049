//! A curve of error against time, what follows from it, and which points no other beats.

use std::collections::BTreeMap;

use itertools::Itertools;
use serde::Serialize;

use super::Truth;
use super::fit;
use crate::experiments::{deviation, median};
use crate::measure::Taken;
use crate::record::{EngineName, ProcedureId, ReadingKey};

/// Relative errors whose time is told.
pub(super) const TARGETS: [f64; 4] = [0.1, 0.01, 1e-3, 1e-4];
/// What is left of a time without the start-up at least, in parts of it.
const MIN_NET: f64 = 0.05;

#[derive(Clone, Debug, Serialize)]
pub struct Curve {
    #[serde(flatten)]
    pub key: ReadingKey,
    /// What solved it; empty where the engine has one solver only.
    pub solver: String,
    /// The preset; empty where there are none.
    pub preset: String,
    /// Seconds of a job of next to no work.
    pub start_up_s: f64,
    /// Seconds of this job with the least effort that the engine can do with.
    pub set_up_s: f64,
    /// By rising effort.
    pub points: Vec<BenchPoint>,
    /// How far off the reference may be, relative; errors below are not told from none.
    pub reference_floor: f64,
    /// Wall-clock seconds to a relative error; null where it was not reached or lies below the reference's floor.
    pub time_to: BTreeMap<String, Option<f64>>,
    /// The same, start-up apart.
    pub time_to_net: BTreeMap<String, Option<f64>>,
    /// Of the error over the time, start-up apart, in a log-log plot.
    pub slope: Option<f64>,
    /// The error that more time does not go below, where the curve leaves its slope.
    pub bias_floor: Option<f64>,
    /// One over variance (relative) and time, start-up apart, at the largest effort; null without variance.
    pub efficiency: Option<f64>,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BenchPoint {
    /// Seconds of budget, or one over the relative error asked for.
    pub effort: f64,
    /// Median wall-clock seconds.
    pub wall_s: f64,
    /// Median processor seconds.
    pub cpu_s: f64,
    pub peak_mib: Option<f64>,
    /// Root mean square over meters and repetitions.
    pub relative_error: f64,
    /// Lower end of its 95 % interval.
    pub relative_error_low: f64,
    /// Upper end of its 95 % interval.
    pub relative_error_high: f64,
    /// The largest at any meter in any repetition.
    pub worst_error: f64,
    /// Mean relative variance between repetitions.
    pub variance: f64,
    pub repetitions: usize,
}

impl BenchPoint {
    pub(super) fn of(effort: f64, taken: &[Taken], truth: &Truth) -> Self {
        let (stations, brightest_lx) = (truth.values_lx.len(), truth.brightest_lx());
        let relative = |taken: &Taken| -> Vec<f64> {
            let pairs = taken.measurement.estimates.iter().zip(&truth.values_lx);
            pairs.map(|(e, v)| (e.value - v) / deviation::scale(*v, brightest_lx)).collect()
        };
        let errors: Vec<Vec<f64>> = taken.iter().map(relative).collect();
        let n = errors.len() as f64;
        let square = |e: &Vec<f64>| e.iter().map(|x| x * x).sum::<f64>() / stations as f64;
        let relative_error = (errors.iter().map(square).sum::<f64>() / n).sqrt();
        let of_station = |s: usize| {
            let mean = errors.iter().map(|e| e[s]).sum::<f64>() / n;
            errors.iter().map(|e| (e[s] - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0)
        };
        let variance = (0..stations).map(of_station).sum::<f64>() / stations as f64;
        let known = truth.floor();
        let is_random = variance > 1e-6 * relative_error * relative_error;
        let (low, high) = if is_random { fit::interval_of_rms(errors.len()) } else { (1.0, 1.0) };
        Self {
            effort,
            wall_s: median(taken.iter().map(|t| t.cost.wall_s)).unwrap_or(0.0),
            cpu_s: median(taken.iter().map(|t| t.cost.cpu_s)).unwrap_or(0.0),
            peak_mib: taken.iter().filter_map(|t| t.cost.peak_mib).reduce(f64::max),
            relative_error,
            relative_error_low: (low * relative_error - known).max(0.0),
            relative_error_high: high * relative_error + known,
            worst_error: errors.iter().flatten().fold(0.0, |w: f64, x| w.max(x.abs())),
            variance,
            repetitions: errors.len(),
        }
    }
}

impl Curve {
    pub(super) fn of(
        key: ReadingKey,
        (solver, preset): (String, String),
        (start_up_s, set_up_s): (f64, f64),
        reference_floor: f64,
        points: Vec<BenchPoint>,
    ) -> Self {
        // A difference of two times that are nearly alike is not known better than that.
        let net = |p: &BenchPoint| (p.wall_s - start_up_s).max(MIN_NET * p.wall_s);
        let timed = |time: &dyn Fn(&BenchPoint) -> f64| -> Vec<(f64, f64)> {
            points.iter().map(|p| (time(p), p.relative_error)).collect()
        };
        let time = |points: &[(f64, f64)], t: f64| (t >= reference_floor).then(|| fit::time_to(points, t)).flatten();
        let times = |points: &[(f64, f64)]| TARGETS.map(|t| (t.to_string(), time(points, t))).into();
        let fit = fit::fit(&timed(&net));
        let last = points.last().filter(|p| p.variance > 0.0);
        Self {
            key,
            solver,
            preset,
            start_up_s,
            set_up_s,
            reference_floor,
            time_to: times(&timed(&|p| p.wall_s)),
            time_to_net: times(&timed(&net)),
            slope: fit.map(|f| f.slope),
            bias_floor: fit.and_then(|f| f.floor),
            efficiency: last.map(|p| 1.0 / (p.variance * net(p))),
            points,
        }
    }

    pub fn name(&self) -> String {
        let solver = if self.key.engine == EngineName::SIMULATOR { &self.solver } else { "" };
        let parts = [self.key.engine.as_str(), self.preset.as_str(), solver];
        parts.into_iter().filter(|p| !p.is_empty()).collect::<Vec<_>>().join(" ")
    }
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Pareto {
    pub case: String,
    pub procedure: ProcedureId,
    /// Curve, wall-clock seconds and relative error, by rising time; an error below the reference's floor counts as it.
    pub front: Vec<(String, f64, f64)>,
}

impl Pareto {
    pub(super) fn of(case: &str, procedure: ProcedureId, curves: &[Curve], floor: f64) -> Self {
        let mine = curves.iter().filter(|c| c.key.case == case && c.key.procedure == procedure);
        let all = mine.flat_map(|c| c.points.iter().map(|p| (c.name(), p.wall_s, p.relative_error.max(floor))));
        let mut front: Vec<(String, f64, f64)> = vec![];
        for point in all.sorted_by(|a, b| a.1.total_cmp(&b.1).then(a.2.total_cmp(&b.2))) {
            if front.last().is_none_or(|best| point.2 < best.2) {
                front.push(point);
            }
        }
        Self { case: case.to_owned(), procedure, front }
    }
}
