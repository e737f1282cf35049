//! The key of a reading: a hash of everything that the reading depends on; pure.

use std::fmt;
use std::str::FromStr;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::engines::{Engine, EngineError, ExternalJob, Job, SceneFile, Version};
use crate::system::digest::hexadecimal;

/// As text it is `engine/digits`.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "String", into = "String")]
#[schemars(with = "String")]
pub struct Key {
    pub engine: String,
    /// 64 hexadecimal digits.
    pub digits: String,
}

impl Key {
    /// Where it is kept that there is no reading, apart from readings: a run of its own tries again.
    pub(in crate::measure) fn of_failure(&self) -> Self {
        self.under("failed")
    }

    /// The key of the same where these conditions matter as well.
    #[must_use]
    pub fn under(&self, conditions: &str) -> Self {
        let digits = hexadecimal(&Sha256::digest(format!("{} {conditions}", self.digits)));
        Self { engine: self.engine.clone(), digits }
    }
}

impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.engine, self.digits)
    }
}

#[derive(Clone, Copy, Debug, thiserror::Error)]
#[error("no id of a job: it is an engine's name, a slash and {DIGITS} hexadecimal digits")]
pub struct NoKey;

const DIGITS: usize = 64;

impl From<Key> for String {
    fn from(key: Key) -> Self {
        key.to_string()
    }
}

impl TryFrom<String> for Key {
    type Error = NoKey;

    fn try_from(text: String) -> Result<Self, NoKey> {
        text.parse()
    }
}

impl FromStr for Key {
    type Err = NoKey;

    fn from_str(text: &str) -> Result<Self, NoKey> {
        let (engine, digits) = text.split_once('/').ok_or(NoKey)?;
        let is_hexadecimal = digits.bytes().all(|b| matches!(b, b'0'..=b'9' | b'a'..=b'f'));
        // Both become names of files.
        let is_name = !engine.is_empty() && engine.bytes().all(|b| b.is_ascii_alphanumeric() || b"-_@.".contains(&b));
        if digits.len() != DIGITS || !is_hexadecimal || !is_name || engine.starts_with('.') {
            return Err(NoKey);
        }
        Ok(Self { engine: engine.to_owned(), digits: digits.to_owned() })
    }
}

/// The key of what an engine reads of a job.
///
/// In it go the files that the engine exports, drivers included; its version and settings; scene, stations, transport, budget and seed of
/// the job; and this program's read-out. The names of case and procedure do not (see [`Engine::cache_identity`]): equal jobs of
/// different cases share an entry. Nor does the number of threads: a reading is as good on any number.
pub fn key(engine: &dyn Engine, version: &Version, job: &Job) -> Result<Key, EngineError> {
    let job = engine.cache_identity(job);
    let files = engine.export(&job)?;
    hashed(engine, version, &job, &files)
}

/// What names a job whatever meters it has: less than all that its readings depend on, so that nothing may be kept under it but where to look.
pub(in crate::measure) fn key_without_meters(
    engine: &dyn Engine,
    version: &Version,
    job: &Job,
) -> Result<Key, EngineError> {
    let job = Job { stations: vec![], ..engine.cache_identity(job) };
    Ok(hashed(engine, version, &job, &[])?.under("any meters"))
}

fn hashed(engine: &dyn Engine, version: &Version, job: &Job, files: &[SceneFile]) -> Result<Key, EngineError> {
    let id = engine.name();
    let unwritable = |e: serde_json::Error| EngineError::Solver { engine: id.clone(), what: format!("its job: {e}") };
    let mut hash = Sha256::new();
    let mut part = |bytes: &[u8]| {
        hash.update((bytes.len() as u64).to_le_bytes());
        hash.update(bytes);
    };
    part(env!("LUXPROOF_READ_OUT").as_bytes());
    part(env!("CARGO_PKG_VERSION").as_bytes());
    part(id.as_str().as_bytes());
    part(version.text.as_bytes());
    part(version.fingerprint.as_bytes());
    part(&ExternalJob::of(job).to_json().map_err(unwritable)?);
    part(&serde_json::to_vec(&job.settings).map_err(unwritable)?);
    for luminaire in job.scene.luminaires.iter().filter(|l| l.photometry.distribution.is_native()) {
        part(format!("{}: type {:?}", luminaire.id, luminaire.photometry.distribution.goniometer()).as_bytes());
    }
    for file in files {
        part(file.name.as_bytes());
        part(&file.bytes);
    }
    Ok(Key { engine: id.as_str().to_owned(), digits: hexadecimal(&hash.finalize()) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engines::{all, fixtures};
    use crate::record::ProcedureId;
    use luminaire::scene::{LuminaireModel, Transport};

    #[test]
    fn whatever_may_change_a_reading_changes_the_key_and_names_do_not() {
        let job = fixtures::s1(Transport::Total(luminaire::scene::Bounces::Converged));
        for engine in all() {
            let of = |job: &Job| key(engine.as_ref(), &Version::told("1"), job).unwrap();
            let plain = of(&job);
            let renamed = Job { case: "other".into(), procedure: ProcedureId::DirectIlluminance, ..job.clone() };
            assert_eq!(plain, of(&renamed));
            assert_ne!(plain, key(engine.as_ref(), &Version::told("2"), &job).unwrap());
            assert!(plain != plain.under("2 threads") && plain.under("1 thread") != plain.under("2 threads"));
            let changes: [fn(&mut Job); 6] = [
                |job| job.seed = 2,
                |job| job.transport = Transport::Direct,
                |job| drop(job.stations.remove(0)),
                |job| job.budget.seconds = 1.5,
                |job| job.scene.luminaires[0].flux_scale *= 1.0 + 1e-15,
                |job| job.stations[0].meter.position_m.x += 1e-12,
            ];
            for (k, change) in changes.iter().enumerate() {
                let mut other = job.clone();
                change(&mut other);
                assert_ne!(plain, of(&other), "{} {k}", engine.name());
            }
        }
    }

    #[test]
    fn an_impostor_is_its_opening_to_the_simulator_alone() {
        let mut area = fixtures::s1(Transport::Direct);
        area.scene.luminaires[0].model = LuminaireModel::Area;
        let mut impostor = area.clone();
        impostor.scene.luminaires[0].model = LuminaireModel::Impostor;
        for engine in all().iter().filter(|e| ["simulator", "radiance"].contains(&e.name().as_str())) {
            let of = |job: &Job| key(engine.as_ref(), &Version::told("1"), job).unwrap();
            assert_eq!(of(&area) == of(&impostor), engine.name() == "simulator");
        }
    }
}
