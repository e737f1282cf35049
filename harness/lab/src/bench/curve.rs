//! Curves of error against time, the figures that follow from them, and the Pareto front.

use std::collections::BTreeMap;

use itertools::Itertools;
use serde::Serialize;

use super::Truth;
use super::fit;
use crate::{deviation, median};
use luxproof_audit::measure::CostedMeasurement;
use luxproof_model::{EngineName, ProcedureId, ReadingKey};

/// The relative errors to which times are reported.
pub(super) const TARGET_ERRORS: [f64; 4] = [0.1, 0.01, 1e-3, 1e-4];
/// The least net time, in parts of the whole time.
const MIN_NET_PART: f64 = 0.05;

/// The error of an engine with a solver and a preset against time.
#[derive(Clone, Debug, Serialize)]
pub struct Curve {
    #[serde(flatten)]
    pub key: ReadingKey,
    /// The solver; empty where the engine has only one.
    pub solver: String,
    /// The preset; empty where there are none.
    pub preset: String,
    /// The seconds of a job with almost no work.
    pub start_up_s: f64,
    /// The seconds of this job with the least effort of the engine.
    pub set_up_s: f64,
    /// The points by rising effort.
    pub points: Vec<BenchPoint>,
    /// The relative uncertainty of the reference; smaller errors are not reported.
    pub reference_floor: f64,
    /// The wall-clock seconds to a relative error; null where it was not reached or is below the
    /// uncertainty of the reference.
    pub time_to: BTreeMap<String, Option<f64>>,
    /// The same without the start-up.
    pub time_to_net: BTreeMap<String, Option<f64>>,
    /// The slope of the error over the time without start-up in a log-log plot.
    pub slope: Option<f64>,
    /// The error below which more time does not lead, where the curve leaves its slope.
    pub bias_floor: Option<f64>,
    /// One over relative variance times net time at the largest effort; null without variance.
    pub efficiency: Option<f64>,
}

/// The error of readings with one effort.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BenchPoint {
    /// The budget in seconds, or one over the requested relative error.
    pub effort: f64,
    /// The median of the wall-clock seconds.
    pub wall_s: f64,
    /// The median of the processor seconds.
    pub cpu_s: f64,
    pub peak_mib: Option<f64>,
    /// The root mean square over meters and repetitions.
    pub relative_error: f64,
    /// The lower end of its 95 % interval.
    pub relative_error_low: f64,
    /// The upper end of its 95 % interval.
    pub relative_error_high: f64,
    /// The largest error of any meter in any repetition.
    pub worst_error: f64,
    /// The mean relative variance between repetitions.
    pub variance: f64,
    pub repetitions: usize,
}

/// The relative errors of a reading, sensor by sensor.
fn relative_errors(taken: &CostedMeasurement, truth: &Truth) -> Vec<f64> {
    let brightest_lx = truth.brightest_lx();
    let pairs = taken.measurement.estimates.iter().zip(&truth.values_lx);
    pairs.map(|(e, v)| (e.value - v) / deviation::scale(*v, brightest_lx)).collect()
}

/// The variance of a sensor's errors between repetitions.
fn variance_at(errors: &[Vec<f64>], sensor: usize) -> f64 {
    let n = errors.len() as f64;
    let mean = errors.iter().map(|e| e[sensor]).sum::<f64>() / n;
    errors.iter().map(|e| (e[sensor] - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0)
}

impl BenchPoint {
    /// Summarises the repeated readings of one effort.
    pub(super) fn from_readings(effort: f64, taken: &[CostedMeasurement], truth: &Truth) -> Self {
        let sensors = truth.values_lx.len();
        let errors: Vec<Vec<f64>> = taken.iter().map(|taken| relative_errors(taken, truth)).collect();
        let squares = errors.iter().map(|e| e.iter().map(|x| x * x).sum::<f64>() / sensors as f64);
        let relative_error = (squares.sum::<f64>() / errors.len() as f64).sqrt();
        let variance = (0..sensors).map(|s| variance_at(&errors, s)).sum::<f64>() / sensors as f64;
        let reference_error = truth.floor();
        // Rounding varies as well, but it makes no interval.
        let is_random = variance > 1e-6 * relative_error * relative_error;
        let (low, high) = if is_random { fit::interval_of_rms(errors.len()) } else { (1.0, 1.0) };
        Self {
            effort,
            wall_s: median(taken.iter().map(|t| t.cost.wall_s)).unwrap_or(0.0),
            cpu_s: median(taken.iter().map(|t| t.cost.cpu_s)).unwrap_or(0.0),
            peak_mib: taken.iter().filter_map(|t| t.cost.peak_mib).reduce(f64::max),
            relative_error,
            relative_error_low: (low * relative_error - reference_error).max(0.0),
            relative_error_high: high * relative_error + reference_error,
            worst_error: errors.iter().flatten().fold(0.0, |w: f64, x| w.max(x.abs())),
            variance,
            repetitions: errors.len(),
        }
    }
}

/// The seconds of a point without the start-up. A small difference of two times is not known well,
/// so a part of the whole time stays.
fn net_seconds(point: &BenchPoint, start_up_s: f64) -> f64 {
    (point.wall_s - start_up_s).max(MIN_NET_PART * point.wall_s)
}

/// The times to all target errors, except for those below the uncertainty of the reference.
fn times_to_targets(points: &[(f64, f64)], reference_floor: f64) -> BTreeMap<String, Option<f64>> {
    let times = TARGET_ERRORS.map(|target| {
        let time = if target >= reference_floor { fit::time_to(points, target) } else { None };
        (target.to_string(), time)
    });
    times.into()
}

impl Curve {
    /// Computes the figures of a curve from its points.
    pub(super) fn new(
        key: ReadingKey,
        (solver, preset): (String, String),
        (start_up_s, set_up_s): (f64, f64),
        reference_floor: f64,
        points: Vec<BenchPoint>,
    ) -> Self {
        let timed: Vec<(f64, f64)> = points.iter().map(|p| (p.wall_s, p.relative_error)).collect();
        let net: Vec<(f64, f64)> = points.iter().map(|p| (net_seconds(p, start_up_s), p.relative_error)).collect();
        let fit = fit::fit_power_law(&net);
        let last = points.last().filter(|p| p.variance > 0.0);
        Self {
            key,
            solver,
            preset,
            start_up_s,
            set_up_s,
            reference_floor,
            time_to: times_to_targets(&timed, reference_floor),
            time_to_net: times_to_targets(&net, reference_floor),
            slope: fit.map(|f| f.slope),
            bias_floor: fit.and_then(|f| f.floor),
            efficiency: last.map(|p| 1.0 / (p.variance * net_seconds(p, start_up_s))),
            points,
        }
    }

    /// The name of the engine with its preset, and of our simulator with its solver.
    pub fn name(&self) -> String {
        let solver = if self.key.engine == EngineName::SIMULATOR { &self.solver } else { "" };
        let parts = [self.key.engine.as_str(), self.preset.as_str(), solver];
        parts.into_iter().filter(|p| !p.is_empty()).collect::<Vec<_>>().join(" ")
    }
}

/// The points of a case and procedure that no other point beats in both time and error.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Pareto {
    pub case: String,
    pub procedure: ProcedureId,
    /// Curve, wall-clock seconds and relative error by rising time. An error below the uncertainty
    /// of the reference counts as equal to it.
    pub front: Vec<(String, f64, f64)>,
}

impl Pareto {
    /// Selects the front from the points of all curves of a case and procedure.
    pub(super) fn from_curves(case: &str, procedure: ProcedureId, curves: &[Curve], floor: f64) -> Self {
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
