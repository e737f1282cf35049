//! The engines' settings in a spec: `engines: {cycles: {preset: ..., photometry: ..., recentre: ...}}`.

use crate::settings::{Coordinates, JobSettings, Preset};
use crate::{EngineError, Job, Setting};
use luxproof_model::EngineName;

pub(crate) const SETTINGS: &[Setting] = &[
    Preset::KNOB,
    Setting { key: "photometry", values: &["exporter", "native"] },
    Setting { key: "recentre", values: &["true", "false"] },
];

/// Blocks of the presets whose effort does not follow the budget, and the samples along their side: a stock scene has Blender's own 4096.
const FIXED_BLOCKS: usize = 8;
const FAST_SIDE: usize = 32;
const STOCK_SIDE: usize = 64;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Settings {
    /// `default` leaves the renderer's own settings and what it makes of an IES file as they are.
    pub(crate) preset: Preset,
    pub(crate) coordinates: Coordinates,
    files: Files,
}

/// Which files its own reader gets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Files {
    /// Ours, of the table.
    Exported,
    /// The user's own, byte for byte, where they are LM-63.
    Native,
}

impl Settings {
    pub(crate) fn of(job: &Job, engine: &EngineName) -> Result<Self, EngineError> {
        let given = JobSettings::of(job, engine.clone(), SETTINGS)?;
        let files = given.one_of("photometry", &[("exporter", Files::Exported), ("native", Files::Native)])?;
        let files = files.unwrap_or(Files::Exported);
        Ok(Self { preset: given.preset()?, coordinates: given.coordinates("recentre")?, files })
    }

    /// Whether its own reader gets the user's own bytes.
    pub(crate) fn is_native(self) -> bool {
        self.files == Files::Native
    }

    /// Whether what becomes of a file is what one wants to know, so that nothing is done for it to be read well.
    pub(crate) fn has_plain_tables(self) -> bool {
        self.preset == Preset::Default || self.is_native()
    }

    /// Blocks and the samples along their side, where these do not follow the budget.
    pub(crate) const fn fixed(self) -> Option<(usize, usize)> {
        match self.preset {
            Preset::Audit => None,
            Preset::Fast => Some((FIXED_BLOCKS, FAST_SIDE)),
            Preset::Default => Some((FIXED_BLOCKS, STOCK_SIDE)),
        }
    }

    /// The same of a driver that reads by itself.
    pub(crate) fn by_itself(self) -> (usize, usize) {
        self.fixed().unwrap_or((2 * FIXED_BLOCKS, STOCK_SIDE))
    }
}
