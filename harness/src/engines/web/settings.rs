//! The engines' settings in a spec: `engines: {three: {release: "0.179"}}`.

use super::Library;
use crate::engines::settings::Given;
use crate::engines::{EngineError, Job, Knob};

/// The releases of three.js that are installed, the default first.
pub(super) const RELEASES: [&str; 2] = ["0.187", "0.179"];
/// What the table is kept in; the loader's own default first.
const TEXTURES: [&str; 2] = ["half", "float"];

pub(super) const THREE_KNOBS: &[Knob] =
    &[Knob { key: "release", values: &["\"0.187\"", "\"0.179\""] }, Knob { key: "texture", values: &TEXTURES }];

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Settings {
    pub(super) release: &'static str,
    pub(super) texture: &'static str,
}

impl Settings {
    pub(super) fn of(job: &Job, library: Library) -> Result<Self, EngineError> {
        let knobs = if library == Library::Three { THREE_KNOBS } else { &[] };
        let given = Given::of(job, library.entry().name.clone(), knobs)?;
        let named = |words: [&'static str; 2]| words.map(|word| (word, word));
        Ok(Self {
            release: given.one_of("release", &named(RELEASES))?.unwrap_or(RELEASES[0]),
            texture: given.one_of("texture", &named(TEXTURES))?.unwrap_or(TEXTURES[0]),
        })
    }
}
