use std::sync::Arc;
use std::time::Duration;

use super::*;
use luxproof_audit::measure::Machine;
use luxproof_audit::measure::cache::Cache;
use luxproof_engines::fixtures::{Fake, exact_direct_lx};
use luxproof_engines::{EngineError, EngineRoot, Measurement, Support, Version};
use luxproof_laws::Place;
use luxproof_model::{EngineName, Estimate};

/// Reads the inverse-square law, and breaks in large, small and distant scenes.
fn fragile(job: &Job) -> Result<Measurement, EngineError> {
    let size_m = job.scene.room.map_or(0.0, |r| r.size_m.max_element());
    let far_m = job.scene.luminaires[0].position_m.max_element();
    let (engine, meter) = (EngineName::new("fragile"), job.sensors[0].id.clone());
    let factor = match (job.scene.room, size_m, far_m) {
        // The reading deviates by half a percent from 2e3 m, and by a fifth from 2e5 m.
        (Some(_), size, _) if size > 1e5 => 1.2,
        (Some(_), size, _) if size > 1e3 => 1.005,
        (Some(_), size, _) if size < 1e-3 => {
            return Err(EngineError::Output { engine, what: "gave 3 readings for 4 meters".into() });
        }
        (None, _, far) if far > 1e6 => {
            return Err(EngineError::NotFinite { engine, meter, value: f64::NAN, uncertainty: Uncertainty::Unstated });
        }
        (None, _, far) if far > 1e4 => 0.01,
        _ => 1.0,
    };
    let exact_lx = exact_direct_lx(job);
    let estimates = exact_lx.iter().map(|x| Estimate { value: factor * x, uncertainty: Uncertainty::Unstated });
    Ok(Measurement { estimates: estimates.collect(), ..Measurement::default() })
}

fn at_most_a_hundred(job: &Job) -> Support {
    if job.scene.luminaires.len() > 100 { Support::No("a hundred luminaires at most".into()) } else { Support::Yes }
}

fn axial() -> Case {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../reference/specs/axial.yaml");
    Case::load(&path).unwrap()
}

fn stressed(folder: &std::path::Path, laws: &[&str], time: Duration) -> StressReport {
    stressed_knowing(folder, laws, time, &[])
}

fn stressed_knowing(folder: &std::path::Path, laws: &[&str], time: Duration, known: &[KnownBreak]) -> StressReport {
    let laws: Vec<String> = laws.iter().map(|l| (*l).to_owned()).collect();
    let options = Options {
        reader: Reader {
            cache: Some(Cache::at(folder.join("readings"))),
            ..Reader::bare(&EngineRoot::at(folder.to_owned()), Machine::new(2))
        },
        time,
        budget: Budget { relative_error: 1e-3, seconds: 1.0 },
        limit: Duration::from_secs(10),
        laws: &laws,
        magnitudes: Magnitudes::All,
        seed: 1,
        coordinates: Coordinates::Fitted,
        known,
    };
    let engine = Arc::new(Fake { supports: at_most_a_hundred, ..Fake::new("fragile", fragile) });
    let subjects = [Instrument { engine, version: Version::without_fingerprint("1") }];
    stress(&axial(), &subjects, &options, &())
}

const LONG: Duration = Duration::from_secs(100);

/// The report of a law.
fn law<'a>(report: &'a StressReport, id: &str) -> &'a LawReport {
    report.laws.iter().find(|l| l.law == id).unwrap()
}

/// The magnitude and the break at the `k`-th point of direct illuminance.
fn direct_point(report: &StressReport, id: &str, k: usize) -> (f64, Option<LawBreach>) {
    let mut points = law(report, id).points.iter().filter(|p| p.procedure == ProcedureId::DirectIlluminance);
    points.nth(k).map(|p| (p.magnitude, p.finding.how)).unwrap()
}

/// A break on record.
fn known_break(law: &str, how: LawBreach, from: f64, relative: f64) -> KnownBreak {
    KnownBreak {
        engine: "fragile".into(),
        case: "axial".into(),
        law: law.into(),
        how,
        from,
        relative: Some(relative),
        cause: format!("{law} by {how}"),
        source: "this test".into(),
    }
}

#[test]
fn what_breaks_is_reported_at_its_magnitude_and_in_its_way() {
    let folder = tempfile::tempdir().unwrap();
    let all = ["scale_up", "scale_down", "translation", "many_luminaires", "mirror"];
    let report = stressed(folder.path(), &all, LONG);
    assert_eq!(law(&report, "scale_up").breaks_at["0.001"], 100.0);
    assert_eq!(law(&report, "scale_up").breaks_at["0.1"], 1e4);
    assert_eq!(law(&report, "scale_up").how, Some(LawBreach::Drift));
    assert!((law(&report, "scale_up").worst_deviation.unwrap() - 0.2).abs() < 1e-6);
    assert_eq!(direct_point(&report, "scale_down", 4), (1e-5, Some(LawBreach::SilentLoss)));
    assert_eq!(direct_point(&report, "scale_down", 3), (1e-4, None));
    assert_eq!(law(&report, "translation").breaks_at["0.1"], 1e4);
    assert_eq!(law(&report, "translation").how, Some(LawBreach::Nan));
    assert_eq!(direct_point(&report, "translation", 4), (1e5, Some(LawBreach::SilentLoss)));
    assert_eq!(law(&report, "many_luminaires").refused_at, Some(1000.0));
    assert_eq!(law(&report, "mirror").how, None);
    let text = report.terminal();
    assert!(text.contains("0.1 % @ 1e2, 1.0 % @ 1e4, 10 % @ 1e4") && text.contains("nan @ 1e6"), "{text}");
    assert!(report.markdown().lines().any(|l| l.starts_with("| mirror") && l.contains("ok")));
}

#[test]
fn breaks_on_record_are_reported_as_known_or_gone() {
    let folder = tempfile::tempdir().unwrap();
    let laws = ["scale_up", "scale_down", "mirror"];
    let up = known_break("scale_up", LawBreach::Drift, 100.0, 0.2);
    let record = [up.clone(), known_break("mirror", LawBreach::Drift, 1.0, 0.1)];
    let report = stressed_knowing(folder.path(), &laws, LONG, &record);
    assert_eq!(law(&report, "scale_up").known, ["scale_up by drift"]);
    assert_eq!(law(&report, "scale_down").known, [""; 0]);
    assert_eq!(law(&report, "mirror").gone, ["mirror by drift"]);
    let text = report.markdown();
    assert!(text.contains("10 % @ 1e4, known |") && text.contains(" Known: scale_up by drift."), "{text}");
    assert!(text.contains("- fragile mirror: on record, but seen no more: mirror by drift."), "{text}");

    // An entry does not explain a break that is earlier, larger, different, or of another engine or
    // case.
    for other in [
        KnownBreak { from: 1e4, ..up.clone() },
        KnownBreak { relative: Some(0.1), ..up.clone() },
        KnownBreak { how: LawBreach::Crash, ..up.clone() },
        KnownBreak { engine: "mitsuba".into(), ..up.clone() },
        KnownBreak { case: "cachet".into(), ..up },
    ] {
        let report = stressed_knowing(folder.path(), &laws, LONG, &[other]);
        assert_eq!(law(&report, "scale_up").known, [""; 0]);
    }
}

#[test]
fn the_record_names_laws_magnitudes_and_ways_that_there_are() {
    let record = luxproof_verdict::KnownDeviations::built_in().unwrap();
    assert!(!record.breaks().is_empty());
    let engines: Vec<EngineName> = luxproof_engines::all().iter().map(|e| e.name()).collect();
    for known in record.breaks() {
        let law = luxproof_laws::find(&known.law).unwrap_or_else(|| panic!("no law {}", known.law));
        assert!(law.magnitudes.contains(&known.from), "{known:?}");
        assert!(engines.contains(&known.engine), "{known:?}");
        assert_eq!(
            known.relative.is_none(),
            [LawBreach::Hang, LawBreach::Crash, LawBreach::Nan].contains(&known.how),
            "{known:?}"
        );
    }
}

#[test]
fn a_run_cut_short_goes_on_where_it_stopped() {
    let folder = tempfile::tempdir().unwrap();
    let nothing = stressed(folder.path(), &["mirror"], Duration::ZERO);
    assert!(nothing.laws.iter().all(|l| l.untried == l.points.len()));
    let whole = stressed(folder.path(), &["mirror"], LONG);
    assert!(whole.laws.iter().all(|l| l.untried == 0));
    let resumed = stressed(folder.path(), &["mirror"], Duration::ZERO);
    assert_eq!(serde_json::to_string(&resumed).unwrap(), serde_json::to_string(&whole).unwrap());
}

#[test]
fn a_place_leads_another_process_to_the_same_job() {
    let case = axial();
    let base = Job::of_task(&case, &case.task(ProcedureId::IndirectIlluminance).unwrap());
    let jobs = [0, 1, 2, 3]
        .map(|part| luxproof_laws::job(&base, &Place { law: "superposition".into(), magnitude: 2.0, part }));
    let luminaires = jobs.map(|job| job.map(|job| job.scene.luminaires.len()));
    assert_eq!(luminaires, [Some(2), Some(1), Some(1), None]);
}
