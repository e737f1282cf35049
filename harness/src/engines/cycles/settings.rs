//! The engine's settings in a spec: `engines: {cycles: {preset: ..., photometry: ..., recentre: ...}}`.

use super::ID;
use crate::engines::settings::{Coordinates, Given, Preset};
use crate::engines::{EngineError, Job, Knob};

pub(super) const KNOBS: &[Knob] = &[
    Preset::KNOB,
    Knob { key: "photometry", values: &["exporter", "native"] },
    Knob { key: "recentre", values: &["true", "false"] },
];

/// Blocks of the presets whose effort does not follow the budget, and the samples along their side: Blender's own 4096 samples.
const FIXED_BLOCKS: usize = 8;
const FAST_SIDE: usize = 32;
const STOCK_SIDE: usize = 64;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Settings {
    /// `default` leaves Blender's own settings and its texture's own planes as they are.
    pub(super) preset: Preset,
    pub(super) coordinates: Coordinates,
    pub(super) photometry: Files,
}

/// Which files its IES textures get.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Files {
    /// Ours, of the table.
    Exported,
    /// The user's own, byte for byte, where they are LM-63.
    Native,
}

impl Settings {
    pub(super) fn of(job: &Job) -> Result<Self, EngineError> {
        let given = Given::of(job, ID, KNOBS)?;
        let photometry = given.one_of("photometry", &[("exporter", Files::Exported), ("native", Files::Native)])?;
        let photometry = photometry.unwrap_or(Files::Exported);
        Ok(Self { preset: given.preset()?, coordinates: given.coordinates("recentre")?, photometry })
    }

    /// Whether tables are as they are, and what becomes of them is what one wants to know.
    pub(super) fn has_plain_tables(self) -> bool {
        self.preset == Preset::Default || self.photometry == Files::Native
    }

    /// Blocks and the samples along their side, where these do not follow the budget.
    pub(super) const fn fixed(self) -> Option<(usize, usize)> {
        match self.preset {
            Preset::Audit => None,
            Preset::Fast => Some((FIXED_BLOCKS, FAST_SIDE)),
            Preset::Default => Some((FIXED_BLOCKS, STOCK_SIDE)),
        }
    }

    /// The same of a driver that reads by itself.
    pub(super) fn by_itself(self) -> (usize, usize) {
        self.fixed().unwrap_or((2 * FIXED_BLOCKS, STOCK_SIDE))
    }
}
