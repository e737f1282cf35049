//! The key of a reading: a hash of everything that the reading depends on.

use std::fmt;
use std::str::FromStr;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use luxproof_engines::{Engine, EngineError, ExternalJob, Job, SceneFile, Version};
use luxproof_process::digest::hexadecimal;

/// The key of a reading; as text it is `engine/digits`.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "String", into = "String")]
#[schemars(with = "String")]
pub struct Key {
    pub engine: String,
    /// 64 hexadecimal digits.
    pub digits: String,
}

impl Key {
    /// The key of a stored failure. It differs from the reading's key, so that a normal run tries again.
    pub(in crate::measure) fn of_failure(&self) -> Self {
        self.under("failed")
    }

    /// The key of the same reading under further conditions.
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

/// The error of a text that is no key.
#[derive(Clone, Copy, Debug, thiserror::Error)]
#[error("no id of a job: it is an engine's name, a slash and {DIGIT_COUNT} hexadecimal digits")]
pub struct NoKey;

const DIGIT_COUNT: usize = 64;

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
        // Both become file names, so the engine's name must not lead out of the cache's folder.
        let is_name = !engine.is_empty() && engine.bytes().all(|b| b.is_ascii_alphanumeric() || b"-_@.".contains(&b));
        if digits.len() != DIGIT_COUNT || !is_hexadecimal || !is_name || engine.starts_with('.') {
            return Err(NoKey);
        }
        Ok(Self { engine: engine.to_owned(), digits: digits.to_owned() })
    }
}

/// The key of an engine's reading of a job.
///
/// It depends on the files that the engine exports, drivers included, and on its version and settings. It depends on
/// scene, sensors, transport, budget and seed of the job, and on this program's read-out. It does not depend on the
/// names of case and procedure (see [`Engine::cache_identity`]), so that equal jobs of different cases share an entry.
/// Nor does it depend on the number of threads, since a reading is valid on any number.
pub fn key(engine: &dyn Engine, version: &Version, job: &Job) -> Result<Key, EngineError> {
    let job = engine.cache_identity(job);
    let files = engine.export(&job)?;
    hash_job(engine, version, &job, &files)
}

/// The key of a job without its meters.
///
/// Readings depend on more than this, so that only lists of meters may be stored under it.
pub(in crate::measure) fn key_without_meters(
    engine: &dyn Engine,
    version: &Version,
    job: &Job,
) -> Result<Key, EngineError> {
    let job = Job { sensors: vec![], ..engine.cache_identity(job) };
    Ok(hash_job(engine, version, &job, &[])?.under("any meters"))
}

/// The hash of an engine, a job and the engine's files.
fn hash_job(engine: &dyn Engine, version: &Version, job: &Job, files: &[SceneFile]) -> Result<Key, EngineError> {
    let id = engine.name();
    let unwritable = |e: serde_json::Error| EngineError::Solver { engine: id.clone(), what: format!("its job: {e}") };
    let mut hash = Sha256::new();
    hash_part(&mut hash, luxproof_engines::READ_OUT.as_bytes());
    hash_part(&mut hash, env!("CARGO_PKG_VERSION").as_bytes());
    hash_part(&mut hash, id.as_str().as_bytes());
    hash_part(&mut hash, version.text.as_bytes());
    hash_part(&mut hash, version.fingerprint.as_bytes());
    hash_part(&mut hash, &ExternalJob::of(job).to_json().map_err(unwritable)?);
    hash_part(&mut hash, &serde_json::to_vec(&job.settings).map_err(unwritable)?);
    for luminaire in job.scene.luminaires.iter().filter(|l| l.photometry.distribution.is_native()) {
        let goniometer = luminaire.photometry.distribution.goniometer();
        hash_part(&mut hash, format!("{}: type {goniometer:?}", luminaire.id).as_bytes());
    }
    for file in files {
        hash_part(&mut hash, file.name.as_bytes());
        hash_part(&mut hash, &file.bytes);
    }
    Ok(Key { engine: id.as_str().to_owned(), digits: hexadecimal(&hash.finalize()) })
}

/// Adds bytes with their length, so that no two lists of parts have the same hash.
fn hash_part(hash: &mut Sha256, bytes: &[u8]) {
    hash.update((bytes.len() as u64).to_le_bytes());
    hash.update(bytes);
}

#[cfg(test)]
mod tests {
    use super::*;
    use luxproof_engines::{all, fixtures};
    use luxproof_model::ProcedureId;
    use luxproof_photometry::TypeCLimits;
    use luxproof_scene::{LuminaireModel, Transport};

    fn key_of(engine: &dyn Engine, job: &Job) -> Key {
        key(engine, &Version::without_fingerprint("1"), job).unwrap()
    }

    #[test]
    fn whatever_may_change_a_reading_changes_the_key_and_names_do_not() {
        let job = fixtures::s1(Transport::Total(luxproof_scene::Bounces::Converged));
        for engine in all() {
            let plain = key_of(engine.as_ref(), &job);
            let renamed = Job { case: "other".into(), procedure: ProcedureId::DirectIlluminance, ..job.clone() };
            assert_eq!(plain, key_of(engine.as_ref(), &renamed));
            assert_ne!(plain, key(engine.as_ref(), &Version::without_fingerprint("2"), &job).unwrap());
            assert!(plain != plain.under("2 threads") && plain.under("1 thread") != plain.under("2 threads"));
            let changes: [fn(&mut Job); 6] = [
                |job| job.seed = 2,
                |job| job.transport = Transport::Direct,
                |job| drop(job.sensors.remove(0)),
                |job| job.budget.seconds = 1.5,
                |job| job.scene.luminaires[0].flux_scale *= 1.0 + 1e-15,
                |job| job.sensors[0].meter.position_m.x += 1e-12,
            ];
            for (k, change) in changes.iter().enumerate() {
                let mut other = job.clone();
                change(&mut other);
                assert_ne!(plain, key_of(engine.as_ref(), &other), "{} {k}", engine.name());
            }
        }
    }

    #[test]
    fn a_fingerprint_changes_the_key() {
        let job = fixtures::s1(Transport::Direct);
        let version = |text: &str, fingerprint: &str| Version {
            fingerprint: fingerprint.to_owned(),
            ..Version::without_fingerprint(text)
        };
        for engine in all() {
            let of = |version: &Version, job: &Job| key(engine.as_ref(), version, job).unwrap();
            let plain = of(&version("1", "ab"), &job);
            assert_eq!(plain, of(&version("1", "ab"), &job), "{}", engine.name());
            assert_ne!(plain, of(&version("1", "ac"), &job), "{}", engine.name());
            // Nothing moves from one part to the next.
            assert_ne!(of(&version("1a", "b"), &job), of(&version("1", "ab"), &job), "{}", engine.name());
            let without_meters = |version: &Version| key_without_meters(engine.as_ref(), version, &job).unwrap();
            assert_ne!(without_meters(&version("1", "ab")), without_meters(&version("1", "ac")), "{}", engine.name());
            assert_eq!(plain.engine, engine.name().as_str());
            let failed = plain.of_failure();
            assert!(failed != plain && failed.engine == plain.engine && failed.digits.len() == DIGIT_COUNT);
        }
    }

    /// The digits of a job of one luminaire without the files of its engine.
    fn digits(engine: &dyn Engine, job: &Job, files: &[SceneFile]) -> String {
        hash_job(engine, &Version::without_fingerprint("1"), job, files).unwrap().digits
    }

    #[test]
    fn a_setting_the_type_of_a_table_and_each_name_and_content_of_a_file_are_parts_of_a_key() {
        let engines = all();
        let radiance = engines.iter().find(|e| e.name() == "radiance").unwrap().as_ref();
        let job = fixtures::s1(Transport::Direct);
        // The form of a job leaves out the first two.
        for setting in ["command", "procedures", "preset"] {
            let mut other = job.clone();
            other.settings.insert(setting.to_owned(), "draft".into());
            assert_ne!(digits(radiance, &job, &[]), digits(radiance, &other, &[]), "{setting}");
        }
        // The form has type C alone. So a table of type B has that of its approximation in type C, which reads otherwise.
        let text =
            "IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 3 3 2 2 0 0 0\n1 1 0\n-90 0 90\n-90 0 90\n0 0 0\n0 90 40\n0 0 0\n";
        let photometry = luxproof_photometry::lm63::parse(text.as_bytes()).unwrap();
        let mut of_type_b = job.clone();
        of_type_b.scene.luminaires[0].photometry = fixtures::photometry(photometry.distribution);
        let mut of_type_c = of_type_b.clone();
        of_type_c.scene.luminaires[0] = of_type_b.scene.luminaires[0].in_type_c(TypeCLimits::default());
        assert_eq!(ExternalJob::of(&of_type_b).to_json().unwrap(), ExternalJob::of(&of_type_c).to_json().unwrap());
        assert_ne!(digits(radiance, &of_type_b, &[]), digits(radiance, &of_type_c, &[]));
        let [plain, renamed, changed, moved] = [("a", "bc"), ("b", "bc"), ("a", "bd"), ("ab", "c")]
            .map(|(name, content)| digits(radiance, &job, &[SceneFile::text(name, content)]));
        assert!(plain != renamed && plain != changed && plain != moved);
        // Zeros between the parts of two files are no part of one file.
        let two = [SceneFile::text("a", "b"), SceneFile::text("c", "d")];
        let zeros = "\0".repeat(8);
        let one = [SceneFile::text("a", format!("b{zeros}c{zeros}d"))];
        assert_ne!(digits(radiance, &job, &two), digits(radiance, &job, &one));
    }

    #[test]
    fn the_text_of_a_key_names_a_file_in_the_cache_or_is_refused() {
        let digits = "0a".repeat(32);
        let text = format!("radiance@1.0/{digits}");
        assert_eq!(text.parse::<Key>().unwrap().to_string(), text);
        for wrong in [
            digits.clone(),
            format!("/{digits}"),
            format!("../{digits}"),
            format!(".hidden/{digits}"),
            format!("a b/{digits}"),
            format!("radiance/{}", &digits[1..]),
            format!("radiance/{digits}0"),
            format!("radiance/{}", digits.to_uppercase()),
        ] {
            assert!(wrong.parse::<Key>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn an_impostor_is_its_opening_to_the_simulator_alone() {
        let mut area = fixtures::s1(Transport::Direct);
        area.scene.luminaires[0].model = LuminaireModel::Area;
        let mut impostor = area.clone();
        impostor.scene.luminaires[0].model = LuminaireModel::Impostor;
        for engine in all().iter().filter(|e| ["simulator", "radiance"].contains(&e.name().as_str())) {
            let is_equal = key_of(engine.as_ref(), &area) == key_of(engine.as_ref(), &impostor);
            assert_eq!(is_equal, engine.name() == "simulator");
        }
    }
}
