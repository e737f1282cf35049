use std::sync::Arc;
use std::time::Duration;

use super::*;
use crate::engines::fixtures::{Fake, exact_direct_lx};
use crate::engines::{EngineError, Measurement, Site, Support, Version};
use crate::laws::Place;
use crate::measure::Machine;
use crate::measure::cache::Cache;
use crate::record::{EngineName, Estimate};

/// Reads the inverse-square law, and breaks where it is told to.
fn fragile(job: &Job) -> Result<Measurement, EngineError> {
    let size_m = job.scene.room.map_or(0.0, |r| r.size_m.max_element());
    let far_m = job.scene.luminaires[0].position_m.max_element();
    let (engine, meter) = (EngineName::new("fragile"), job.stations[0].id.clone());
    let factor = match (job.scene.room, size_m, far_m) {
        // Off by half a percent from 2e3 m, a fifth from 2e5 m.
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
    let estimate = |x: &f64| Estimate { value: factor * x, uncertainty: Uncertainty::Unstated };
    Ok(Measurement { estimates: exact_direct_lx(job).iter().map(estimate).collect(), ..Measurement::default() })
}

fn at_most_a_hundred(job: &Job) -> Support {
    let mirrored = job.scene.luminaires.len() > 100;
    if mirrored { Support::No("a hundred luminaires at most".into()) } else { Support::Yes }
}

fn axial() -> Case {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../reference/specs/axial.yaml");
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
            ..Reader::bare(&Site::at(folder.to_owned()), Machine::new(2))
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
    let subjects = [Instrument { engine, version: Version::told("1") }];
    stress(&axial(), &subjects, &options, &())
}

const LONG: Duration = Duration::from_secs(100);

#[test]
fn what_breaks_is_reported_at_its_magnitude_and_in_its_way() {
    let folder = tempfile::tempdir().unwrap();
    let all = ["scale_up", "scale_down", "translation", "many_luminaires", "mirror"];
    let report = stressed(folder.path(), &all, LONG);
    let law = |id: &str| report.laws.iter().find(|l| l.law == id).unwrap();
    let direct = |id: &str| -> Vec<(f64, Option<How>)> {
        let points = law(id).points.iter().filter(|p| p.procedure == ProcedureId::DirectIlluminance);
        points.map(|p| (p.magnitude, p.finding.how)).collect()
    };
    assert_eq!(law("scale_up").breaks_at["0.001"], 100.0);
    assert_eq!(law("scale_up").breaks_at["0.1"], 1e4);
    assert_eq!(law("scale_up").how, Some(How::Drift));
    assert!((law("scale_up").worst_deviation.unwrap() - 0.2).abs() < 1e-6);
    assert_eq!(direct("scale_down")[4], (1e-5, Some(How::SilentLoss)));
    assert_eq!(direct("scale_down")[3], (1e-4, None));
    assert_eq!(law("translation").breaks_at["0.1"], 1e4);
    assert_eq!(law("translation").how, Some(How::Nan));
    assert_eq!(direct("translation")[4], (1e5, Some(How::SilentLoss)));
    assert_eq!(law("many_luminaires").refused_at, Some(1000.0));
    assert_eq!(law("mirror").how, None);
    let text = report.terminal();
    assert!(text.contains("0.1 % @ 1e2, 1.0 % @ 1e4, 10 % @ 1e4") && text.contains("nan @ 1e6"), "{text}");
    assert!(report.markdown().lines().any(|l| l.starts_with("| mirror") && l.contains("ok")));
}

#[test]
fn what_is_on_record_is_told_as_known_and_what_is_gone_as_gone() {
    let folder = tempfile::tempdir().unwrap();
    let known = |law: &str, how: How, from: f64, relative: Option<f64>| KnownBreak {
        engine: "fragile".into(),
        case: "axial".into(),
        law: law.into(),
        how,
        from,
        relative,
        cause: format!("{law} by {how}"),
        source: "this test".into(),
    };
    let all = ["scale_up", "scale_down", "mirror"];
    let read = |record: &[KnownBreak]| stressed_knowing(folder.path(), &all, LONG, record);
    let law = |report: &StressReport, id: &str| report.laws.iter().find(|l| l.law == id).unwrap().clone();

    let up = known("scale_up", How::Drift, 100.0, Some(0.2));
    let report = read(&[up.clone(), known("mirror", How::Drift, 1.0, Some(0.1))]);
    assert_eq!(law(&report, "scale_up").known, ["scale_up by drift"]);
    assert_eq!(law(&report, "scale_down").known, [""; 0]);
    assert_eq!(law(&report, "mirror").gone, ["mirror by drift"]);
    let text = report.markdown();
    assert!(text.contains("10 % @ 1e4, known |") && text.contains(" Known: scale_up by drift."), "{text}");
    assert!(text.contains("- fragile mirror: on record, but seen no more: mirror by drift."), "{text}");

    // Too early, too large, in another way, of another engine or case: no excuse.
    for other in [
        KnownBreak { from: 1e4, ..up.clone() },
        KnownBreak { relative: Some(0.1), ..up.clone() },
        KnownBreak { how: How::Crash, ..up.clone() },
        KnownBreak { engine: "mitsuba".into(), ..up.clone() },
        KnownBreak { case: "cachet".into(), ..up },
    ] {
        assert_eq!(law(&read(&[other]), "scale_up").known, [""; 0]);
    }
}

#[test]
fn the_record_names_laws_magnitudes_and_ways_that_there_are() {
    let record = crate::judge::KnownDeviations::built_in().unwrap();
    assert!(!record.breaks().is_empty());
    let engines: Vec<EngineName> = crate::engines::all().iter().map(|e| e.name()).collect();
    for known in record.breaks() {
        let law = laws::find(&known.law).unwrap_or_else(|| panic!("no law {}", known.law));
        assert!(law.magnitudes.contains(&known.from), "{known:?}");
        assert!(engines.contains(&known.engine), "{known:?}");
        assert_eq!(known.relative.is_none(), [How::Hang, How::Crash, How::Nan].contains(&known.how), "{known:?}");
    }
}

#[test]
fn a_run_cut_short_goes_on_where_it_stopped() {
    let folder = tempfile::tempdir().unwrap();
    let nothing = stressed(folder.path(), &["mirror"], Duration::ZERO);
    assert!(nothing.laws.iter().all(|l| l.untried == l.points.len()));
    let whole = stressed(folder.path(), &["mirror"], LONG);
    assert!(whole.laws.iter().all(|l| l.untried == 0));
    let again = stressed(folder.path(), &["mirror"], Duration::ZERO);
    assert_eq!(serde_json::to_string(&again).unwrap(), serde_json::to_string(&whole).unwrap());
}

#[test]
fn a_place_leads_another_process_to_the_same_job() {
    let case = axial();
    let base = Job::of_task(&case, &case.task(ProcedureId::IndirectIlluminance).unwrap());
    let place = |part| Place { law: "superposition".into(), magnitude: 2.0, part };
    let luminaires = |part| laws::job(&base, &place(part)).unwrap().scene.luminaires.len();
    assert_eq!((luminaires(0), luminaires(1), luminaires(2)), (2, 1, 1));
    assert!(laws::job(&base, &place(3)).is_none());
}
