//! The engine's settings in a spec: `engines: {mitsuba: {variant: ..., preset: ..., recentre: ...}}`.

use super::ID;
use crate::settings::{Coordinates, JobSettings, Preset};
use crate::{EngineError, Job, Setting};

/// Variants whose single sample is a luminance; the spectral and polarised ones are not.
const VARIANTS: [&str; 5] = ["llvm_ad_mono", "llvm_ad_rgb", "scalar_rgb", "cuda_ad_mono", "cuda_ad_rgb"];

pub(super) const SETTINGS: &[Setting] = &[
    Preset::KNOB,
    Setting { key: "variant", values: &VARIANTS },
    Setting { key: INTEGRATOR, values: &["path", "volpath", "prb", "ptracer"] },
    Setting { key: "recentre", values: &["true", "false"] },
];

/// Blocks of the presets whose effort does not follow the budget, and the samples along their side.
pub(super) const FIXED_BLOCKS: usize = 8;
pub(super) const FIXED_SIDE: usize = 32;

const INTEGRATOR: &str = "integrator";

/// Mitsuba's integrators that compute irradiance. Each is another implementation of the same light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Integrator {
    /// The path tracer.
    Path,
    /// The path tracer of volumes.
    VolumePath,
    /// The path tracer of inverse rendering, path replay backpropagation; its forward pass.
    PathReplay,
    /// The particle tracer: light starts at the emitters.
    Particles,
}

impl Integrator {
    const ALL: [Self; 4] = [Self::Path, Self::VolumePath, Self::PathReplay, Self::Particles];

    /// The name of the plugin.
    pub(super) const fn plugin(self) -> &'static str {
        match self {
            Self::Path => "path",
            Self::VolumePath => "volpath",
            Self::PathReplay => "prb",
            Self::Particles => "ptracer",
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Settings {
    pub(super) variant: &'static str,
    /// `default` is the stock scene, without our emitters.
    pub(super) preset: Preset,
    pub(super) integrator: Integrator,
    pub(super) coordinates: Coordinates,
}

impl Settings {
    pub(super) fn of(job: &Job) -> Result<Self, EngineError> {
        let given = JobSettings::of(job, ID, SETTINGS)?;
        let integrators = Integrator::ALL.map(|integrator| (integrator.plugin(), integrator));
        let (preset, integrator) = (given.preset()?, given.one_of(INTEGRATOR, &integrators)?);
        // The sphere that shapes the light of the stock scene is an index-matched volume.
        let stock = if preset == Preset::Default { Integrator::VolumePath } else { Integrator::Path };
        let settings = Self {
            variant: given.one_of("variant", &VARIANTS.map(|v| (v, v)))?.unwrap_or(VARIANTS[0]),
            preset,
            integrator: integrator.unwrap_or(stock),
            coordinates: given.coordinates("recentre")?,
        };
        match settings.obstacle() {
            None => Ok(settings),
            Some(what) => Err(EngineError::Setting { engine: ID, key: INTEGRATOR.into(), what: what.into() }),
        }
    }

    /// Why the integrator does not go with the other settings, if so.
    fn obstacle(&self) -> Option<&'static str> {
        if self.preset == Preset::Default && self.integrator != Integrator::VolumePath {
            return Some("the preset `default` is a scene for `volpath`; leave out one of them");
        }
        if self.integrator == Integrator::PathReplay && self.variant.starts_with("scalar") {
            return Some("`prb` needs a variant with automatic differentiation, such as llvm_ad_mono");
        }
        None
    }

    /// Whether the variant runs on a GPU.
    pub(super) fn is_on_gpu(&self) -> bool {
        self.variant.starts_with("cuda")
    }
}
