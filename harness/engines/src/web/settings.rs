//! The engines' settings in a spec: `engines: {three: {release: "0.179"}}`.

use super::Library;
use crate::settings::JobSettings;
use crate::{EngineError, Job, Setting};

/// The releases of three.js that are installed, the default first.
pub(super) const RELEASES: [&str; 2] = ["0.187", "0.179"];
/// What the table is kept in; the loader's own default first.
const TEXTURES: [&str; 2] = ["half", "float"];

pub(super) const THREE_KNOBS: &[Setting] =
    &[Setting { key: "release", values: &["\"0.187\"", "\"0.179\""] }, Setting { key: "texture", values: &TEXTURES }];

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Settings {
    pub(super) release: &'static str,
    pub(super) texture: &'static str,
}

impl Settings {
    pub(super) fn of(job: &Job, library: Library) -> Result<Self, EngineError> {
        let settings = if library == Library::Three { THREE_KNOBS } else { &[] };
        let given = JobSettings::of(job, library.entry().name.clone(), settings)?;
        Ok(Self {
            release: given.one_of("release", &RELEASES.map(|release| (release, release)))?.unwrap_or(RELEASES[0]),
            texture: given.one_of("texture", &TEXTURES.map(|texture| (texture, texture)))?.unwrap_or(TEXTURES[0]),
        })
    }
}
