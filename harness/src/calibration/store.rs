//! Where calibrations are kept: one file an engine version, settings and exported scenes, in the engines' folder.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

use super::Calibration;
use super::scenes::KnownScene;
use crate::engines::{EngineError, Site, Support};
use crate::measure::Instrument;
use crate::spec::hexadecimal;

/// The file of a calibration. Its name changes with everything that a reading may depend on: version, settings and the
/// scenes as they are exported, drivers included.
pub(super) fn path(
    Instrument { engine, version }: &Instrument,
    settings: &BTreeMap<String, serde_json::Value>,
    site: &Site,
    scenes: &[KnownScene],
) -> Result<PathBuf, EngineError> {
    let mut hash = Sha256::new();
    let mut part = |bytes: &[u8]| {
        hash.update((bytes.len() as u64).to_le_bytes());
        hash.update(bytes);
    };
    part(env!("CARGO_PKG_VERSION").as_bytes());
    part(version.0.as_bytes());
    for (key, value) in settings {
        part(key.as_bytes());
        part(value.to_string().as_bytes());
    }
    for scene in scenes {
        if matches!(engine.supports(&scene.job), Support::No(_)) {
            continue;
        }
        for file in engine.export(&scene.job)? {
            part(file.name.as_bytes());
            part(&file.bytes);
        }
    }
    let digits = hexadecimal(&hash.finalize()[..8]);
    Ok(site.root().join("calibration").join(format!("{}-{digits}.json", engine.name())))
}

/// A kept calibration; `None` where there is none or it cannot be read, which is reason to measure again.
pub(super) fn read(path: &Path) -> Option<Calibration> {
    let text = std::fs::read_to_string(path).ok()?;
    let calibration: Calibration = serde_json::from_str(&text).ok()?;
    let sound = |u: f64| u.is_finite() && u >= 0.0;
    calibration.parts.iter().all(|p| sound(p.uncertainty)).then_some(calibration)
}
