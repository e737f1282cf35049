//! The closed forms against the simulator, and what becomes of an instrument that is off by a known amount.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use luminaire::scene::Bounces;

use super::*;
use crate::engines::fixtures::Fake;
use crate::engines::simulator::Simulator;
use crate::engines::{Engine, EngineError, Job, Measurement, Site, Version};
use crate::measure::Machine;
use crate::record::Uncertainty;

const VERSION: &str = "1";
const INDIRECT: Transport = Transport::Indirect(Bounces::Converged);

/// The right answers behind a fault: every reading passes through it.
fn faulty(
    fault: impl Fn(&Job, usize, Estimate) -> Estimate + Send + Sync + 'static,
) -> Fake<impl Fn(&Job) -> Result<Measurement, EngineError> + Send + Sync + 'static> {
    Fake::new("faulty", move |job: &Job| {
        let scenes = scenes::all(&BTreeMap::new());
        let scene = scenes.iter().find(|s| s.job.stations == job.stations).unwrap();
        let right = |known: &scenes::Known| Estimate { value: known.exact_lx, uncertainty: Uncertainty::Unstated };
        let estimates = scene.known.iter().map(right).enumerate().map(|(k, e)| fault(job, k, e));
        Ok(Measurement { estimates: estimates.collect(), ..Measurement::default() })
    })
}

fn scaled(factor: f64) -> impl Fn(&Job, usize, Estimate) -> Estimate + Send + Sync + 'static {
    move |_, _, e| Estimate { value: e.value * factor, ..e }
}

fn read(
    engine: Arc<dyn Engine>,
    version: &str,
    settings: &Settings,
    site: &Site,
) -> Result<Calibrated, CalibrationError> {
    let instrument = Instrument { engine, version: Version(version.into()) };
    calibrate(&instrument, settings, &Reader::bare(site, Machine::new(1)), Earlier::Counts)
}

type Settings = BTreeMap<String, serde_json::Value>;

fn found(engine: impl Engine + 'static) -> Result<Calibrated, CalibrationError> {
    let folder = tempfile::tempdir().unwrap();
    read(Arc::new(engine), VERSION, &Settings::new(), &Site::at(folder.path()))
}

#[test]
fn the_closed_forms_are_what_the_simulator_has() {
    let calibration = found(Simulator).unwrap().calibration;
    let names: Vec<&str> = calibration.parts.iter().map(|p| p.scene.as_str()).collect();
    assert_eq!(names, ["point", "asymmetric", "shadow", "furnace"]);
    for part in &calibration.parts {
        assert_eq!(part.left_out, None);
        // The furnace's table is linear between nodes 3 degrees apart, so that its light is even to a few parts in 1e4 only,
        // and the simulator itself works to 2e-4.
        let limit = if part.reflected { 6e-4 } else { 1e-12 };
        assert!(part.deviation < limit, "{part:?}");
    }
}

#[test]
fn a_small_bias_becomes_the_uncertainty_and_a_large_one_a_failure_with_its_scene() {
    let calibration = found(faulty(scaled(1.003))).unwrap().calibration;
    assert!((calibration.uncertainty(Transport::Direct) - 0.003 / 3f64.sqrt()).abs() < 1e-9, "{calibration:?}");
    let error = found(faulty(scaled(0.9))).unwrap_err().to_string();
    assert!(error.contains("`point`") && error.contains("-10.0 %"), "{error}");
    let leak = |job: &Job, k: usize, e: Estimate| {
        let leaks = !job.scene.obstacles.is_empty() && k == 0;
        Estimate { value: if leaks { 2.0 } else { e.value }, ..e }
    };
    let error = found(faulty(leak)).unwrap_err().to_string();
    assert!(error.contains("`shadow`"), "{error}");
    let loses = |job: &Job, _: usize, e: Estimate| {
        let factor = if job.transport == Transport::Direct { 1.0 } else { 0.75 };
        Estimate { value: factor * e.value, ..e }
    };
    let error = found(faulty(loses)).unwrap_err().to_string();
    assert!(error.contains("`furnace`"), "{error}");
    // What an engine declares of its method is no fault of the instrument, and no excuse for its readings either.
    let mut declared = faulty(loses);
    declared.supports = |_| Support::Approximate { why: "it knows two bounces".into(), size: Some(0.26) };
    assert_eq!(found(declared).unwrap().calibration.uncertainty(INDIRECT), 0.0);
}

#[test]
fn noise_is_an_uncertainty_of_its_own_and_hides_no_bias_beyond_it() {
    let noisy = |_: &Job, _: usize, e: Estimate| Estimate {
        value: 1.001 * e.value,
        uncertainty: Uncertainty::sampled(0.002 * e.value, None),
    };
    let calibration = found(faulty(noisy)).unwrap().calibration;
    let furnace = &calibration.parts[3];
    assert!((furnace.uncertainty - 0.001).abs() < 2e-6, "four meters, each within .2 %: {furnace:?}");
    let hidden = |_: &Job, _: usize, e: Estimate| Estimate { uncertainty: Uncertainty::sampled(e.value, None), ..e };
    assert!(found(faulty(hidden)).is_err());
}

#[test]
fn what_cannot_be_read_is_left_out_with_its_reason() {
    let mut engine = faulty(scaled(1.0));
    engine.supports = |_| Support::No("not today".into());
    let calibration = found(engine).unwrap().calibration;
    assert!(calibration.parts.iter().all(|p| p.left_out.as_deref() == Some("not today")));
    assert!(calibration.summary().contains("not today"));
}

#[test]
fn a_calibration_is_measured_once_a_version_and_settings() {
    let folder = tempfile::tempdir().unwrap();
    let site = Site::at(folder.path());
    let reads = Arc::new(AtomicUsize::new(0));
    let counter = Arc::clone(&reads);
    let engine = Arc::new(faulty(move |_: &Job, meter: usize, e: Estimate| {
        counter.fetch_add(usize::from(meter == 0), Ordering::SeqCst);
        e
    }));
    let read = |version: &str, settings: &Settings| self::read(engine.clone(), version, settings, &site).unwrap();
    let plain = BTreeMap::new();
    let first = read("1", &plain);
    assert_eq!((first.origin, reads.load(Ordering::SeqCst)), (Origin::Measured, 4));
    let second = read("1", &plain);
    assert_eq!((second.origin, reads.load(Ordering::SeqCst)), (Origin::Kept, 4));
    assert_eq!(first.calibration, second.calibration);
    assert_eq!(read("2", &plain).origin, Origin::Measured);
    let settings = BTreeMap::from([("preset".to_owned(), "fast".into())]);
    assert_eq!(read("1", &settings).origin, Origin::Measured);
    // Half a file is measured again.
    std::fs::write(first.kept.unwrap(), "{").unwrap();
    assert_eq!(read("1", &plain).origin, Origin::Measured);
}

#[test]
fn where_nothing_can_be_kept_the_calibration_still_counts() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    std::fs::write(&file, "").unwrap();
    let found = read(Arc::new(faulty(scaled(1.0))), VERSION, &Settings::new(), &Site::at(file)).unwrap();
    assert!(found.kept.is_err());
}
