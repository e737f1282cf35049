//! Reports that are made by hand, with known answers.

use luxproof_model::{
    Basis, CaseRecord, Comparison, Estimate, HiddenVariant, ProcedureId, Reading, ReadingKey, Recording, Report,
    SpecRecord, Verdict,
};
use serde_json::{Value, json};

use crate::Capabilities;

pub(crate) const ENGINE: &str = "rays";
/// The relative tolerance of all comparisons.
pub(crate) const TOLERANCE: f64 = 0.01;

/// One capability, `direct`, by the cases `a`, `b` and `c`.
pub(crate) fn capabilities(minimum_cases: usize) -> Capabilities {
    let cases = ["a", "b", "c"].map(|case| json!({"case": case, "procedures": ["direct_illuminance"]}));
    let one = json!({"id": "direct", "group": "Light", "title": "Direct light", "question": "Is it right?", "cases": cases,
        "minimum_cases": minimum_cases});
    serde_json::from_value(json!({"version": 1, "capabilities": [one]})).unwrap()
}

/// A case of an engine, as a report has it.
#[derive(Clone, Debug)]
pub(crate) struct MadeCase {
    case: String,
    hidden: Option<HiddenVariant>,
    points: Vec<Comparison>,
    failure: Option<(&'static str, &'static str)>,
    skip: Option<&'static str>,
    cut_to: Option<f64>,
    pub(crate) title: String,
}

impl MadeCase {
    pub(crate) fn new(case: &str) -> Self {
        Self {
            case: case.to_owned(),
            hidden: None,
            points: vec![],
            failure: None,
            skip: None,
            cut_to: None,
            title: "a case".to_owned(),
        }
    }

    /// The same case as its hidden variant.
    pub(crate) fn hidden(mut self, seed: u64) -> Self {
        self.hidden = Some(HiddenVariant { of: self.case.clone(), seed });
        self.case = format!("hidden-{seed}-{}", self.case);
        self
    }

    /// A point of 100 lx with a relative deviation and its expanded uncertainty; the verdict follows from the interval.
    pub(crate) fn off(self, deviation: f64, expanded: f64) -> Self {
        let size = deviation.abs();
        let verdict = match () {
            () if size + expanded <= TOLERANCE => Verdict::Pass,
            () if size - expanded > TOLERANCE => Verdict::Fail,
            () => Verdict::Undecided,
        };
        self.judged(deviation, expanded, verdict, None)
    }

    pub(crate) fn judged(mut self, deviation: f64, expanded: f64, verdict: Verdict, diagnosis: Option<&str>) -> Self {
        let c: Comparison = serde_json::from_value(json!({
            "case": self.case, "procedure": "direct_illuminance", "engine": ENGINE, "model": "point",
            "meter": format!("floor[{}]", self.points.len()), "at_m": [0, 0, 0], "normal": [0, 0, 1], "gamma_deg": null, "c_deg": null,
            "quantity": "illuminance_lx", "value": 100.0 * (1.0 + deviation), "bound": 0.0,
            "reference": {"value": 100.0, "uncertainty": 0.0, "basis": "closed_form", "source": "inverse square"},
            "deviation": 100.0 * deviation, "relative_deviation": deviation, "tolerance": {"relative": TOLERANCE, "absolute": 0.0},
            "verdict": verdict, "diagnosis": diagnosis,
            "budget": {"components": [], "combined": 50.0 * expanded, "coverage_factor": 2.0, "expanded": 100.0 * expanded}
        }))
        .unwrap();
        self.points.push(c);
        self
    }

    /// The last point with the reference's expanded uncertainty, relative.
    pub(crate) fn with_reference(mut self, expanded: f64, basis: Basis) -> Self {
        let reference = self.points.last_mut().and_then(|c| c.reference.as_mut()).unwrap();
        (reference.uncertainty, reference.coverage_factor, reference.basis) = (50.0 * expanded, Some(2.0), basis);
        self
    }

    pub(crate) fn failing(mut self, kind: &'static str, text: &'static str) -> Self {
        self.failure = Some((kind, text));
        self
    }

    /// The clock cut its sampling to such a part.
    pub(crate) fn cut_to(mut self, part: f64) -> Self {
        self.cut_to = Some(part);
        self
    }

    pub(crate) fn unsupported(mut self) -> Self {
        self.skip = Some("unsupported");
        self
    }

    pub(crate) fn not_run(mut self) -> Self {
        self.skip = Some("other");
        self
    }
}

/// A report of one engine.
pub(crate) fn report(engine: &str, version: &str, given: &[MadeCase]) -> Report {
    let engines = json!([{"id": engine, "version": version, "status": "ran", "reason": null, "wall_s": 0}]);
    let mut report = Report {
        luxproof: 2,
        started: "2026-01-01T00:00:00Z".to_owned(),
        checksum: format!("{:016x}", engine.len() + given.len()),
        engines: serde_json::from_value(engines).unwrap(),
        ..Report::default()
    };
    for case in given {
        let spec = SpecRecord { path: format!("{}.yaml", case.case), sha256: String::new(), title: case.title.clone() };
        report.cases.push(CaseRecord {
            name: case.case.clone(),
            spec,
            policy: None,
            decision_rule: String::new(),
            is_calibration: false,
            hidden_variant: case.hidden.clone(),
            has_bodies: false,
            luminaire_models: vec![],
            plan: None,
        });
        let key = ReadingKey::new(case.case.clone(), ProcedureId::DirectIlluminance, engine);
        if let Some(cause) = case.skip {
            let mut skip = serde_json::to_value(&key).unwrap();
            let more = json!({"scope": "procedure", "reason": "only boxes", "saved": null, "cause": cause});
            skip.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
            report.skips.push(serde_json::from_value(skip).unwrap());
            continue;
        }
        let mut recording = Recording::of(key.clone(), "direct".to_owned().try_into().unwrap());
        recording.content_sha256 = format!("content of {}", case.case);
        recording.cut_to = case.cut_to;
        if let Some((kind, text)) = case.failure {
            recording.failure = Some(text.to_owned());
            recording.failure_kind = serde_json::from_value(Value::from(kind)).unwrap();
        }
        report.recordings.push(recording);
        for c in &case.points {
            let c = Comparison { key: key.clone(), ..c.clone() };
            let estimate = Estimate { value: c.value.unwrap_or(0.0), uncertainty: c.uncertainty };
            let reading = Reading::new(c.meter.clone(), c.quantity, estimate);
            report.readings.push(luxproof_model::ReadingRecord { key: key.clone(), model: c.model.clone(), reading });
            report.comparisons.push(c);
        }
    }
    report
}
