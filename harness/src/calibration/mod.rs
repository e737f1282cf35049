//! Self-calibration: before an engine version is first used with some settings, it reads four scenes whose answers are closed
//! forms; what it is off becomes the instrument uncertainty that its later verdicts carry (JCGM 100:2008, 4.3).
//!
//! - **Point**: one candle power at .5, 1, 2 and 10 m: inverse-square law; shows the bias of a falloff or of a read-out.
//! - **Asymmetric**: a table without symmetry, turned, over nodes, mid-nodes and both poles; shows mirrored or wrapped tables.
//! - **Shadow**: a box between luminaire and meters in a black room; shows light that leaks or meters that are missed.
//! - **Furnace**: a cube that its luminaire lights evenly, so that reflected light is the same everywhere in every direction,
//!   E = rho / (1 - rho) x flux / area, to 5e-4; shows what a method of reflected light loses or gains.
//!
//! What an engine declares of its method ([`Support::Approximate`]) is not the instrument's and stays in its readings.

mod calibrations;
pub(crate) mod scenes;
mod store;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::time::Duration;

use luminaire::scene::Transport;
use serde::{Deserialize, Serialize};

pub use self::calibrations::Calibrations;
use self::scenes::KnownScene;
use crate::engines::Support;
use crate::measure::{Failure, FailureKind, Instrument, Question, Reader};
use crate::record::{EngineName, Estimate};
use crate::system::files;
use crate::system::slots::side_by_side;

/// A deviation beyond this, noise and declared approximations apart, is no uncertainty but a broken instrument.
const IMPLAUSIBLE: f64 = 0.05;
/// Standard errors within which a deviation counts as noise.
const COVERAGE: f64 = 2.0;
/// Past this a calibration scene hangs.
const LIMIT: Duration = Duration::from_secs(60);

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Calibration {
    pub engine: EngineName,
    pub version: String,
    /// The version of this program, whose read-out it is.
    pub tool_version: String,
    pub settings: BTreeMap<String, serde_json::Value>,
    pub parts: Vec<Part>,
}

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Part {
    /// The scene: point, asymmetric, shadow or furnace.
    pub scene: String,
    pub reflected: bool,
    /// The largest deviation from the closed form, relative.
    pub deviation: f64,
    /// Standard error of the readings' mean, relative.
    pub std_error: f64,
    /// What the engine declares of its method, relative.
    pub declared: f64,
    /// The instrument's standard uncertainty that follows, relative.
    pub uncertainty: f64,
    pub left_out: Option<String>,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Calibrated {
    pub calibration: Calibration,
    pub origin: Origin,
    /// The file that keeps it, or why none does.
    pub kept: Result<String, String>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    Kept,
    Measured,
}

#[derive(Debug, thiserror::Error)]
pub enum CalibrationError {
    #[error(
        "calibration: {engine} reads the scene `{scene}` {:.1} % off its closed form at {meter} ({value_lx} lx for {exact_lx} \
         lx), which is no uncertainty but a fault; see `luxproof engines doctor`",
        100.0 * deviation
    )]
    Implausible { engine: EngineName, scene: &'static str, meter: String, value_lx: f64, exact_lx: f64, deviation: f64 },
    #[error("calibration: {0}")]
    Failed(#[from] Failure),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Earlier {
    Counts,
    Ignored,
}

/// The calibration of an instrument with some settings: kept from an earlier one, else measured and kept.
pub fn calibrate(
    instrument: &Instrument,
    settings: &BTreeMap<String, serde_json::Value>,
    reader: &Reader,
    earlier: Earlier,
) -> Result<Calibrated, CalibrationError> {
    let scenes = scenes::all(settings);
    let path = store::path(instrument, settings, &reader.site, &scenes).map_err(Failure::from)?;
    let kept = if earlier == Earlier::Counts { store::read(&path) } else { None };
    if let Some(calibration) = kept {
        return Ok(Calibrated { calibration, origin: Origin::Kept, kept: Ok(path.display().to_string()) });
    }
    // What it read before says nothing of what it reads now.
    let reader = Reader { out: None, cache: None, ..reader.clone() };
    let parts = side_by_side(scenes.len(), &scenes, |scene| part(instrument, scene, &reader));
    let calibration = Calibration {
        engine: instrument.engine.name(),
        version: instrument.version.0.clone(),
        tool_version: env!("CARGO_PKG_VERSION").to_owned(),
        settings: settings.clone(),
        parts: parts.into_iter().collect::<Result<_, _>>()?,
    };
    let noise = calibration.parts.iter().map(|p| p.std_error).fold(0.0, f64::max);
    let kept = if noise > scenes::BUDGET.relative_error {
        Err(format!("noise of {noise:.1e}, as on a machine with other work"))
    } else {
        let file = path.display().to_string();
        files::replace_json(&path, &calibration).map_err(|e| format!("{file}: {e}")).map(|()| file)
    };
    Ok(Calibrated { calibration, origin: Origin::Measured, kept })
}

impl Calibration {
    /// Relative standard uncertainty of the instrument for a kind of light: the worst of its scenes.
    pub fn uncertainty(&self, transport: Transport) -> f64 {
        let counts = |p: &&Part| !p.reflected || transport != Transport::Direct;
        self.parts.iter().filter(counts).map(|p| p.uncertainty).fold(0.0, f64::max)
    }

    pub fn summary(&self) -> String {
        let part = |p: &Part| match &p.left_out {
            Some(why) => format!("{} left out ({why})", p.scene),
            None if p.std_error > 0.0 => format!("{} {:.1e} (noise {:.1e})", p.scene, p.deviation, p.std_error),
            None => format!("{} {:.1e}", p.scene, p.deviation),
        };
        let direct = self.uncertainty(Transport::Direct);
        let all = self.uncertainty(Transport::Indirect(luminaire::scene::Bounces::Converged));
        let parts = self.parts.iter().map(part).collect::<Vec<_>>().join(", ");
        format!("instrument uncertainty {direct:.1e} direct, {all:.1e} reflected; worst deviations: {parts}")
    }
}

fn part(instrument: &Instrument, scene: &KnownScene, reader: &Reader) -> Result<Part, CalibrationError> {
    let question = Question { limit: LIMIT, ..Question::new(instrument, &scene.job, scene.name) };
    match reader.try_read(&question) {
        Ok(taken) => {
            let declared = match instrument.engine.supports(&scene.job) {
                Support::Approximate { size, .. } => size.unwrap_or(0.0),
                Support::Yes | Support::No(_) => 0.0,
            };
            judge(instrument.engine.name(), scene, declared, &taken.measurement.estimates)
        }
        Err(Failure { kind: FailureKind::Declined, text }) => Ok(Part {
            scene: scene.name.to_owned(),
            reflected: scene.is_reflected(),
            left_out: Some(text),
            ..Part::default()
        }),
        Err(failure) => Err(failure.into()),
    }
}

fn judge(
    engine: EngineName,
    scene: &KnownScene,
    declared: f64,
    estimates: &[Estimate],
) -> Result<Part, CalibrationError> {
    let (mut worst, mut excess, mut noise) = (0.0_f64, 0.0_f64, 0.0_f64);
    for ((estimate, known), station) in estimates.iter().zip(&scene.known).zip(&scene.job.stations) {
        let deviation = (estimate.value - known.exact_lx) / known.scale_lx;
        let std_error = estimate.uncertainty.standard_error().unwrap_or(0.0) / known.scale_lx;
        let unexplained = (deviation.abs() - declared - COVERAGE * std_error).max(0.0);
        // Written so that NaN, too, is implausible.
        if !(unexplained <= IMPLAUSIBLE && std_error <= IMPLAUSIBLE) {
            let (scene, meter) = (scene.name, station.id.to_string());
            let (value_lx, exact_lx) = (estimate.value, known.exact_lx);
            return Err(CalibrationError::Implausible { engine, scene, meter, value_lx, exact_lx, deviation });
        }
        worst = worst.max(deviation.abs());
        excess = excess.max(unexplained);
        noise += std_error * std_error;
    }
    let std_error = noise.sqrt() / estimates.len() as f64;
    // A bound is a rectangular distribution (GUM 4.3.7); what the noise hides may be as large as the noise.
    let uncertainty = (excess / 3f64.sqrt()).hypot(std_error);
    let (scene, reflected) = (scene.name.to_owned(), scene.is_reflected());
    Ok(Part { scene, reflected, deviation: worst, std_error, declared, uncertainty, left_out: None })
}
