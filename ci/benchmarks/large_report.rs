//! Writes a report of so many comparisons that nothing measured, with its page: `large_report corpus|grid COMPARISONS FOLDER`.
//!
//! A corpus is of many cases with 500 comparisons each, a grid one case of meters side by side. What is written is what a run would write, so that
//! `luxproof report FOLDER` reads it.

use std::collections::BTreeMap;
use std::error::Error;
use std::path::Path;
use std::time::Instant;

use luxproof_model::{CaseRecord, ReadingRecord, Report, SpecRecord};
use luxproof_model::{Comparison, Verdict};
use luxproof_model::{Estimate, MeterId, ProcedureId, Reading, ReadingKey, Recording};
use serde_json::json;

const ENGINES: [&str; 5] = ["simulator", "mitsuba", "radiance", "povray", "an-adapter"];
/// Meters of a case of a corpus in each of its procedures.
const METERS: usize = 50;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [shape, comparisons, folder] = &arguments[..] else {
        return Err("large_report corpus|grid COMPARISONS FOLDER".into());
    };
    let (comparisons, folder) = (comparisons.parse::<usize>()?, Path::new(folder));
    let (cases, procedures, meters) = match shape.as_str() {
        "corpus" => {
            let procedures = [ProcedureId::DirectIlluminance, ProcedureId::IndirectIlluminance].as_slice();
            (comparisons / (METERS * procedures.len() * ENGINES.len()), procedures, METERS)
        }
        "grid" => (1, [ProcedureId::DirectIlluminance].as_slice(), comparisons / ENGINES.len()),
        other => return Err(format!("{other} is neither `corpus` nor `grid`").into()),
    };
    let clock = Instant::now();
    let mut report = synthetic(cases, procedures, meters)?;
    let made_s = clock.elapsed().as_secs_f64();
    luxproof_report_file::keep_anew(&mut report, folder)?;
    let kept_s = clock.elapsed().as_secs_f64() - made_s;
    luxproof_report::keep_page(&report, &luxproof_report::page(&report, &[]), folder)?;
    let page_s = clock.elapsed().as_secs_f64() - made_s - kept_s;
    println!(
        "{} comparisons made in {made_s:.1} s, report.json and comparisons.jsonl written in {kept_s:.1} s, its pages in {page_s:.1} s",
        report.comparisons.len()
    );
    Ok(())
}

fn synthetic(cases: usize, procedures: &[ProcedureId], meters: usize) -> Result<Report, serde_json::Error> {
    let template: Comparison = serde_json::from_value(json!({
        "case": "", "procedure": "direct_illuminance", "engine": "", "model": "area", "meter": "plane[0]", "at_m": [0, 0, 0.8], "normal": [0, 0, 1],
        "gamma_deg": null, "c_deg": null, "quantity": "illuminance_lx", "value": 1, "std_error": 0.1234567,
        "reference": {"value": 1, "uncertainty": 0.001, "basis": "simulator", "source": "luxproof_simulator: hp collocation"},
        "deviation": 0, "relative_deviation": 0, "tolerance": {"relative": 0.02, "absolute": 0.01}, "verdict": "pass", "diagnosis": null,
        "budget": {"components": [{"source": "monte_carlo", "uncertainty": 0.1234567, "shape": "normal"},
            {"source": "reference", "uncertainty": 0.00123456, "shape": "normal"}],
            "combined": 0.1234629, "degrees_of_freedom": null, "coverage_factor": 2.0, "expanded": 0.2469},
        "p_value": 0.000123
    }))?;
    let columns = (meters as f64).sqrt().ceil() as usize;
    let mut report = Report {
        luxproof: 2,
        tool_version: "0.1.0".into(),
        started: "2026-01-01T00:00:00Z".into(),
        ..Report::default()
    };
    report.spec =
        SpecRecord { path: "corpus".into(), sha256: "00".repeat(32), title: "nothing that was measured".into() };
    for engine in ENGINES {
        report.engines.push(serde_json::from_value(
            json!({"id": engine, "version": "1.0", "status": "ran", "reason": null, "wall_s": 1.5}),
        )?);
    }
    let mut number = 0_u64;
    for case in 0..cases {
        let name = format!("corpus/case-{case:05}");
        report.cases.push(CaseRecord {
            plan: None,
            name: name.clone(),
            spec: report.spec.clone(),
            policy: None,
            decision_rule: String::new(),
            is_calibration: false,
            hidden_variant: None,
            has_bodies: false,
            luminaire_models: vec![],
        });
        for (procedure, engine) in procedures.iter().flat_map(|p| ENGINES.map(|e| (*p, e))) {
            let key = ReadingKey::new(name.clone(), procedure, engine);
            let recording: Recording = serde_json::from_value(json!({
                "case": name, "procedure": procedure, "engine": engine, "light": "direct", "version": "1.0", "input_sha256": "ab", "seed": 1,
                "settings": BTreeMap::<String, String>::new(), "approximation": null, "notes": [], "failure": null, "wall_s": 1.5}))?;
            report.recordings.push(recording);
            for meter in 0..meters {
                // Any numbers that do not repeat.
                number = number.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                let relative = 0.02 * ((number >> 11) as f64 / (1_u64 << 53) as f64 - 0.48);
                let at_m = [0.5 + (meter % columns) as f64, 0.5 + (meter / columns) as f64, 0.8];
                let value = 300.0 + 7.3 * at_m[0].sin() - 3.1 * at_m[1].cos();
                let mut c =
                    Comparison { key: key.clone(), meter: MeterId::new("plane", meter), at_m, ..template.clone() };
                c.value = Some(value * (1.0 + relative));
                c.deviation = Some(value * relative);
                c.relative_deviation = Some(relative);
                if let Some(reference) = &mut c.reference {
                    reference.value = value;
                }
                if relative > 0.0103 {
                    c.verdict = Verdict::Fail;
                    report.summary.fail += 1;
                    c.diagnosis = Some("its flux is 1 % too large".into());
                }
                let estimate = Estimate { value: value * (1.0 + relative), uncertainty: c.uncertainty };
                let reading = Reading::new(c.meter.clone(), c.quantity, estimate);
                report.readings.push(ReadingRecord { key: key.clone(), model: c.model.clone(), reading });
                report.comparisons.push(c);
            }
        }
    }
    report.summary.pass = report.comparisons.len() - report.summary.fail;
    Ok(report)
}
