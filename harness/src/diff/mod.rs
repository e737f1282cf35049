//! The diffing layer: readings against references that carry their own uncertainty; it sees nothing but readings.

mod known;
mod published;
mod split;
mod tolerance;
mod verdict;

use std::collections::BTreeMap;

use luminaire::scene::LuminaireModel;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::procedures::{Target, Task};
use crate::reading::{MeterId, Quantity, Reading, Recording};
use crate::spec::ToleranceOverride;

pub use known::{KnownDeviationError, KnownDeviations, Subject};
pub use published::{Cell, Published, PublishedColumn, PublishedError, PublishedRow, PublishedTable};
pub use split::Split;
pub use tolerance::{Tolerance, ToleranceError, Tolerances};
pub use verdict::{Verdict, judge};

/// What a reference rests on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Basis {
    /// A formula in closed form.
    ClosedForm,
    /// The simulator, with its error bound.
    Exact,
    /// An IESNA calculation method.
    Iesna,
    /// Printed values.
    Published,
    /// Another engine.
    Engine,
}

impl Basis {
    /// The name used in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::ClosedForm => "closed form",
            Self::Exact => "exact",
            Self::Iesna => "IESNA",
            Self::Published => "published",
            Self::Engine => "engine",
        }
    }
}

/// What a reading is held against.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Reference {
    /// The value, in the quantity's unit.
    pub value: f64,
    /// Its standard uncertainty, likewise.
    pub uncertainty: f64,
    /// What it rests on.
    pub basis: Basis,
    /// Formula, solver or paper.
    pub source: String,
}

/// One reading against one reference.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Comparison {
    /// The case.
    pub case: String,
    /// The procedure.
    pub procedure: String,
    /// The engine.
    pub engine: String,
    /// The luminaire model.
    pub model: String,
    /// The meter.
    pub meter: MeterId,
    /// Its position in metres.
    pub at_m: [f64; 3],
    /// Its normal.
    pub normal: [f64; 3],
    /// Direction seen from the luminaire, for procedure 1.
    pub gamma_deg: Option<f64>,
    /// Likewise.
    pub c_deg: Option<f64>,
    /// What was read.
    pub quantity: Quantity,
    /// The reading; null where it is missing.
    pub value: Option<f64>,
    /// Its standard error.
    pub std_error: Option<f64>,
    /// What it is held against; null where there is nothing.
    pub reference: Option<Reference>,
    /// Reading minus reference.
    pub deviation: Option<f64>,
    /// Deviation over reference.
    pub relative_deviation: Option<f64>,
    /// How far it may lie off.
    pub tolerance: Tolerance,
    /// What follows.
    pub verdict: Verdict,
    /// Why, where that is known.
    pub diagnosis: Option<String>,
}

/// What judging needs besides the readings.
pub struct Judge<'a> {
    /// Tolerances and coverage factor.
    pub tolerances: &'a Tolerances,
    /// Deviations on record.
    pub known: &'a KnownDeviations,
    /// The spec's own tolerances.
    pub overrides: &'a BTreeMap<String, ToleranceOverride>,
    /// Tables of a paper.
    pub published: Option<&'a Published>,
}

impl Judge<'_> {
    /// What of each deviation of an approximate method from a renderer is whose; `recordings` as for [`Self::compare`].
    pub fn split(&self, task: &Task, recordings: &[&Recording]) -> Vec<Split> {
        split::splits(task, recordings, self.tolerances.coverage_factor())
    }

    /// Holds every reading of one task against every reference there is for it.
    ///
    /// `recordings` are those of this task, one an engine. An engine that failed is `missing` at every meter.
    pub fn compare(&self, task: &Task, recordings: &[&Recording]) -> Vec<Comparison> {
        let mut comparisons = vec![];
        for recording in recordings {
            for (k, target) in task.targets.iter().enumerate() {
                let reading = recording.readings.get(k);
                let mut references = reference_from_witness(task, recordings, k, &recording.engine);
                references.extend(self.published.iter().flat_map(|p| p.references(task, target, &recording.engine)));
                if references.is_empty() && (reading.is_none() || !is_witness(&recording.engine)) {
                    // Nothing to hold it against, or nothing to hold: that is said, never passed over.
                    comparisons.push(self.comparison(task, recording, target, reading, None));
                }
                for reference in references {
                    comparisons.push(self.comparison(task, recording, target, reading, Some(reference)));
                }
            }
        }
        comparisons
    }

    fn comparison(
        &self,
        task: &Task,
        recording: &Recording,
        target: &Target,
        reading: Option<&Reading>,
        reference: Option<Reference>,
    ) -> Comparison {
        let basis = reference.as_ref().map(|r| r.basis);
        let tolerance = basis.map_or_else(Tolerance::default, |basis| {
            self.tolerances.of(task.procedure, basis, &recording.engine, task.quantity, self.overrides)
        });
        let pair = reading.zip(reference.as_ref());
        let deviation = pair.map(|(a, b)| a.value - b.value).filter(|d| d.is_finite());
        let relative_deviation = pair.map(|(a, b)| (a.value - b.value) / b.value).filter(|d| d.is_finite());
        let verdict = pair.map_or(Verdict::Missing, |(reading, reference)| {
            let instrument = recording.instrument_uncertainty * reading.value;
            let combined = standard_uncertainty(reading).hypot(reference.uncertainty).hypot(instrument);
            let sound = reading.value >= 0.0 && reference.value >= 0.0;
            let deviation = if sound { reading.value - reference.value } else { f64::NAN };
            judge(deviation, self.tolerances.coverage_factor() * combined, tolerance.around(reference.value))
        });
        let subject = basis.map(|basis| Subject {
            case: &recording.case,
            procedure: task.procedure,
            engine: &recording.engine,
            model: &recording.model,
            basis,
            relative_deviation,
        });
        let (verdict, cause) = subject.map_or((verdict, None), |s| self.known.revise(verdict, &s));
        let missing = match (reading, &reference) {
            (None, _) => recording.failure.clone().or_else(|| Some("no reading".to_owned())),
            (_, None) => Some("no reference".to_owned()),
            _ => None,
        };
        Comparison {
            case: recording.case.clone(),
            procedure: task.procedure.to_owned(),
            engine: recording.engine.clone(),
            model: recording.model.clone(),
            meter: target.id.clone(),
            at_m: target.meter.position_m.to_array(),
            normal: target.meter.normal.to_array(),
            gamma_deg: target.direction.map(|d| d.gamma_deg),
            c_deg: target.direction.map(|d| d.c_deg),
            quantity: task.quantity,
            value: reading.map(|r| r.value),
            std_error: reading.and_then(|r| r.std_error),
            reference,
            deviation,
            relative_deviation,
            tolerance,
            verdict,
            diagnosis: cause.or(missing),
        }
    }
}

/// Which of our own engines others are judged by in a procedure, and on what basis.
fn witness_of(task: &Task) -> (&'static str, Basis, &'static str) {
    let points_only = task.scene.luminaires.iter().all(|l| l.model == LuminaireModel::Point);
    match (task.procedure, points_only && task.scene.obstacles.is_empty()) {
        ("luminous_intensity", true) => ("iesna", Basis::ClosedForm, "photometric file, bilinear in (C, gamma)"),
        ("direct_illuminance", true) => ("iesna", Basis::ClosedForm, "inverse square"),
        _ => ("simulator", Basis::Exact, "luminaire::simulator"),
    }
}

fn is_witness(engine: &str) -> bool {
    crate::plan::REFERENCES.contains(&engine)
}

fn reference_from_witness(task: &Task, recordings: &[&Recording], k: usize, engine: &str) -> Vec<Reference> {
    let (witness, basis, source) = witness_of(task);
    if engine == witness {
        return vec![];
    }
    let recording = recordings.iter().find(|r| r.engine == witness);
    let reference = recording.and_then(|r| r.readings.get(k).map(|reading| (r, reading)));
    let reference = reference.map(|(recording, reading)| Reference {
        value: reading.value,
        uncertainty: standard_uncertainty(reading),
        basis,
        source: match recording.settings.get("solver") {
            Some(solver) if basis == Basis::Exact => format!("{source}: {solver}"),
            _ => source.to_owned(),
        },
    });
    reference.into_iter().collect()
}

/// Standard uncertainty of a reading: its standard error, or a bound taken as a rectangular distribution (GUM 4.3.7).
fn standard_uncertainty(reading: &Reading) -> f64 {
    let from_bound = reading.error_bound.map_or(0.0, |b| b / 3f64.sqrt());
    reading.std_error.unwrap_or(0.0).hypot(from_bound)
}
