//! The engine's settings in a spec: `engines: {mitsuba: {variant: ..., preset: ..., recentre: ...}}`.

use super::ID;
use crate::settings::{Coordinates, JobSettings, Preset};
use crate::{EngineError, Job, Setting};

/// Variants whose single sample is a luminance; the spectral and polarised ones are not.
const VARIANTS: [&str; 5] = ["llvm_ad_mono", "llvm_ad_rgb", "scalar_rgb", "cuda_ad_mono", "cuda_ad_rgb"];

pub(super) const SETTINGS: &[Setting] = &[
    Preset::KNOB,
    Setting { key: "variant", values: &["llvm_ad_mono", "llvm_ad_rgb", "scalar_rgb"] },
    Setting { key: "recentre", values: &["true", "false"] },
];

/// Blocks of the presets whose effort does not follow the budget, and the samples along their side.
pub(super) const FIXED_BLOCKS: usize = 8;
pub(super) const FIXED_SIDE: usize = 32;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Settings {
    pub(super) variant: &'static str,
    /// `default` is the stock scene, without our emitters.
    pub(super) preset: Preset,
    pub(super) coordinates: Coordinates,
}

impl Settings {
    pub(super) fn of(job: &Job) -> Result<Self, EngineError> {
        let given = JobSettings::of(job, ID, SETTINGS)?;
        Ok(Self {
            variant: given.one_of("variant", &VARIANTS.map(|v| (v, v)))?.unwrap_or(VARIANTS[0]),
            preset: given.preset()?,
            coordinates: given.coordinates("recentre")?,
        })
    }
}
