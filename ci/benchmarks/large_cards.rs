//! Writes a site of score cards that nothing measured: `large_cards RENDERERS RELEASES CAPABILITIES FOLDER`.
//!
//! It is as large as a site may become, and its names are those that strangers may send.

use std::error::Error;
use std::path::Path;

use luxproof_cards::{Capabilities, CardRun, Cards, Verification, site};
use luxproof_model::{
    CaseRecord, Comparison, HiddenVariant, ProcedureId, ReadingKey, Recording, Report, SpecRecord, Tool, Verdict,
};
use serde_json::json;

/// Points of a case.
const POINTS: usize = 6;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [renderers, releases, capabilities, folder] = &arguments[..] else {
        return Err("large_cards RENDERERS RELEASES CAPABILITIES FOLDER".into());
    };
    let (renderers, releases, count) =
        (renderers.parse::<usize>()?, releases.parse::<usize>()?, capabilities.parse::<usize>()?);
    let capabilities = capabilities_of(count)?;
    let mut reports = vec![];
    for renderer in 0..renderers {
        for release in 0..releases {
            reports.push(report(renderer, release, count)?);
        }
    }
    let runs: Vec<(CardRun, &Report)> = reports.iter().map(|r| (CardRun::of(r, Verification::Own), r)).collect();
    let tool = Tool { version: "0.1.0".into(), ..Tool::default() };
    let (cards, evidence) = Cards::of(&capabilities, &runs, tool)?;
    for file in site::files(&cards, &evidence)? {
        let path = Path::new(folder).join(&file.path);
        path.parent().map_or(Ok(()), std::fs::create_dir_all)?;
        std::fs::write(path, file.content)?;
    }
    Ok(())
}

fn capabilities_of(count: usize) -> Result<Capabilities, serde_json::Error> {
    let all: Vec<_> = (0..count)
        .map(|k| {
            json!({"id": format!("capability-{k}"), "group": format!("Group {} of what nothing measured", k / 6),
                "title": format!("Capability {k} with a name of usual length"), "question": "Is the light right & <b>bright</b>?",
                "cases": [{"case": format!("case-{k}"), "procedures": ["direct_illuminance"]}], "minimum_cases": 1})
        })
        .collect();
    serde_json::from_value(json!({"version": 1, "capabilities": all}))
}

fn engine(renderer: usize, release: usize) -> String {
    let name = match renderer {
        1 => "</script><img src=x onerror=alert(1)>".to_owned(),
        2 => "../../up".to_owned(),
        k => format!("renderer-{k}"),
    };
    format!("{name}@{}.{}.0", 1 + release / 10, release % 10)
}

/// A report of one release in which a number that does not repeat decides each case.
fn report(renderer: usize, release: usize, count: usize) -> Result<Report, serde_json::Error> {
    let engine = engine(renderer, release);
    let mut report = Report {
        luxproof: 2,
        started: format!("2026-01-{:02}T{:02}:00:00Z", 1 + release % 28, renderer),
        checksum: format!("{renderer:08x}{release:08x}"),
        ..Report::default()
    };
    report.spec.title = format!("A run of {engine}");
    report.engines.push(serde_json::from_value(
        json!({"id": engine, "version": engine, "status": "ran", "reason": null, "wall_s": 1.0}),
    )?);
    for k in 0..count {
        // What a release inherits from the ones before, so that most cells stay as they are.
        let mut number = (renderer * 1009 + k * 31 + release / 7 * 7919) as u64;
        number = (number + 1).wrapping_mul(6_364_136_223_846_793_005) ^ (number << 21);
        for hidden in [None, Some(HiddenVariant { of: format!("case-{k}"), seed: 20_260_101 })] {
            let prefix = if hidden.is_some() { "hidden-20260101-" } else { "" };
            let name = format!("{prefix}case-{k}");
            add_case(&mut report, &engine, &name, hidden, number)?;
        }
    }
    Ok(report)
}

fn add_case(
    report: &mut Report,
    engine: &str,
    name: &str,
    hidden: Option<HiddenVariant>,
    number: u64,
) -> Result<(), serde_json::Error> {
    let title = "A room with a title of usual length".to_owned();
    report.cases.push(CaseRecord {
        name: name.to_owned(),
        spec: SpecRecord { path: format!("{name}.yaml"), sha256: "00".repeat(32), title },
        policy: None,
        decision_rule: String::new(),
        is_calibration: false,
        hidden_variant: hidden,
        has_bodies: false,
        luminaire_models: vec![],
        plan: None,
    });
    let key = ReadingKey::new(name, ProcedureId::DirectIlluminance, engine.to_owned());
    if number.is_multiple_of(11) {
        let mut skip = serde_json::to_value(&key)?;
        skip["scope"] = json!("procedure");
        skip["reason"] = json!("it computes no such light");
        skip["saved"] = json!(null);
        skip["cause"] = json!(if number.is_multiple_of(2) { "unsupported" } else { "other" });
        report.skips.push(serde_json::from_value(skip)?);
        return Ok(());
    }
    let mut recording: Recording = serde_json::from_value(json!({
        "case": name, "procedure": "direct_illuminance", "engine": engine, "light": "direct", "version": engine, "input_sha256": "ab", "seed": 1,
        "settings": {}, "approximation": null, "notes": [], "failure": null, "wall_s": 1.5}))?;
    recording.command = Some("rtrace -I+ -ab 0 scene.oct < points.txt".into());
    report.recordings.push(recording);
    for point in 0..POINTS {
        let part = (number.rotate_left(7 * point as u32) >> 11) as f64 / (1_u64 << 53) as f64;
        let (deviation, expanded, verdict, diagnosis) = match number % 5 {
            0 => (
                0.4 * part + 0.02,
                0.004,
                Verdict::Fail,
                Some("beyond a gamma of 90 degrees C is turned by 180 degrees"),
            ),
            1 => (0.011 * part, 0.006, Verdict::Undecided, None),
            _ => (0.004 * (part - 0.5), 0.003, Verdict::Pass, None),
        };
        let c: Comparison = serde_json::from_value(json!({
            "case": name, "procedure": "direct_illuminance", "engine": engine, "model": "area", "meter": format!("floor[{point}]"),
            "at_m": [0, 0, 0.8], "normal": [0, 0, 1], "gamma_deg": null, "c_deg": null, "quantity": "illuminance_lx",
            "value": 300.0 * (1.0 + deviation), "std_error": 0.45,
            "reference": {"value": 300.0, "uncertainty": 0.01, "basis": "simulator", "source": "luxproof_simulator: hp collocation"},
            "deviation": 300.0 * deviation, "relative_deviation": deviation, "tolerance": {"relative": 0.01, "absolute": 0.001},
            "verdict": verdict, "diagnosis": diagnosis,
            "budget": {"components": [], "combined": 150.0 * expanded, "degrees_of_freedom": null, "coverage_factor": 2.0, "expanded": 300.0 * expanded}
        }))?;
        report.comparisons.push(c);
    }
    Ok(())
}
