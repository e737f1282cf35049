//! The engine's settings in a spec: `engines: {radiance: {preset: ..., photometry: ...}}` and more.

use super::ID;
use crate::settings::{Coordinates, JobSettings, Preset};
use crate::{EngineError, Job, Setting};

pub(super) const SETTINGS: &[Setting] = &[
    Preset::KNOB,
    Setting { key: "ambient_divisions", values: &["16384", "1024"] },
    Setting { key: "photometry", values: &["exporter", "ies2rad", "native"] },
    Setting { key: "impostor_height_m", values: &["0.057", "0.2"] },
    Setting { key: "rescale", values: &["true", "false"] },
];

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Settings {
    /// `default` are rtrace's own defaults, but for the number of bounces, which is 0 there.
    pub(super) preset: Preset,
    /// Ambient divisions of one block (`-ad`); `None`: as the budget asks for.
    pub(super) ambient_divisions: Option<u32>,
    pub(super) photometrist: Photometrist,
    /// Height given to a flat opening that is modelled as an impostor, in metres.
    pub(super) impostor_height_m: f64,
    pub(super) coordinates: Coordinates,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Photometrist {
    /// We do, at full precision.
    Exporter,
    /// Radiance's own ies2rad, of a file that we write: the whole sphere, as edition 2002.
    Ies2rad,
    /// Radiance's own ies2rad, of the user's own file, as its users do.
    Native,
}

/// The box of the published impostor, "lum2" of *Simulation of Luminaires in Radiance: Verification Method*, is 57 mm high.
const IMPOSTOR_HEIGHT_M: f64 = 0.057;
/// Up to 1 mm ies2rad makes a flat source of it.
const MIN_IMPOSTOR_HEIGHT_M: f64 = 0.002;

impl Settings {
    /// Whether ies2rad gets the user's own bytes.
    pub(super) fn is_native(&self) -> bool {
        self.photometrist == Photometrist::Native
    }

    pub(super) fn of(job: &Job) -> Result<Self, EngineError> {
        let given = JobSettings::of(job, ID, SETTINGS)?;
        let photometrists = [
            ("exporter", Photometrist::Exporter),
            ("ies2rad", Photometrist::Ies2rad),
            ("native", Photometrist::Native),
        ];
        let height_m = given.number("impostor_height_m", MIN_IMPOSTOR_HEIGHT_M..=10.0)?;
        Ok(Self {
            preset: given.preset()?,
            ambient_divisions: given.whole_number("ambient_divisions", 1..=1_000_000)?,
            photometrist: given.one_of("photometry", &photometrists)?.unwrap_or(Photometrist::Exporter),
            impostor_height_m: height_m.unwrap_or(IMPOSTOR_HEIGHT_M),
            coordinates: given.coordinates("rescale")?,
        })
    }
}
