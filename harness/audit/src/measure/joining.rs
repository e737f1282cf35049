//! Joins answers: the cache has some meters of a question, and the engine reads only the others.
//!
//! Each part is an answer to the same question except for its meters. The new part has another seed, so that no two
//! parts share random numbers. Only answers from before the run are joined, so that results do not depend on the order
//! of the run's cases.

use std::collections::HashMap;

use super::cache::{Entry, Key, bits, key};
use super::outcome::{AnswerSource, Cost};
use super::question::Question;
use super::reader::{Reader, entry_of};
use luxproof_engines::{Job, Measurement, Sensor};
use luxproof_process::random::seed;

/// Suffix of the folder where the engine reads the missing meters.
const MISSING_FOLDER_SUFFIX: &str = "-added";

/// The key of a recording's effort that says which meters came from the cache.
const READ_BEFORE: &str = "meters_read_before";

/// An entry of the cache that has some sensors of a question.
struct CachedPart {
    entry: Entry,
    /// For each sensor of the question its index in the entry.
    indices: Vec<Option<usize>>,
}

impl Reader {
    /// The answer to a question of which the cache has some meters, and whether the engine had to read the others.
    ///
    /// `None` where the cache has none of them, or where the engine cannot read the others separately.
    pub(super) fn joined(
        &self,
        question: &Question<'_>,
        question_key: &Key,
        key_without_meters: &Key,
    ) -> Option<(Entry, AnswerSource)> {
        let CachedPart { entry, indices } = self.largest_cached_part(question, question_key, key_without_meters)?;
        let job = question.job;
        let sensors = job.sensors.iter().zip(&indices);
        let missing: Vec<Sensor> = sensors.filter(|(_, index)| index.is_none()).map(|(s, _)| s.clone()).collect();
        let missing_count = missing.len();
        let source = if missing.is_empty() { AnswerSource::Cache } else { AnswerSource::Engine };
        let description = describe_parts(indices.len(), &missing);
        let mut parts = vec![entry];
        if !missing.is_empty() {
            let rest = Job { seed: seed_of_part(job.seed, &missing), sensors: missing, ..job.clone() };
            let folder = format!("{}{MISSING_FOLDER_SUFFIX}", question.folder);
            let request = Question { job: &rest, folder: &folder, may_join: false, ..*question };
            // Where this part fails, the caller asks the whole question.
            let taken = self.read(&request).ok()?;
            parts.push(entry_of(question, taken.cost, Ok(taken.measurement)));
        }
        let mut missing_indices = 0..missing_count;
        let places: Vec<(usize, usize)> = indices
            .into_iter()
            .filter_map(|index| index.map(|k| (0, k)).or_else(|| Some((1, missing_indices.next()?))))
            .collect();
        let cost = parts.iter().map(|part| part.cost).reduce(Cost::plus)?;
        let readings: Vec<Measurement> = parts.into_iter().filter_map(|part| part.answer.ok()).collect();
        let mut measurement = Measurement::side_by_side(&readings, &places);
        measurement.effort.insert(READ_BEFORE.to_owned(), description);
        Some((entry_of(question, cost, Ok(measurement)), source))
    }

    /// The entry of the cache that has the most meters of a question, the latest of several.
    ///
    /// One part only: all entries have the same seed, and parts that share random numbers are not independent.
    fn largest_cached_part(
        &self,
        question: &Question<'_>,
        question_key: &Key,
        key_without_meters: &Key,
    ) -> Option<CachedPart> {
        let wanted: Vec<[u64; 6]> = question.job.sensors.iter().map(bits).collect();
        let listed = self.machine.listed(self.cache.as_ref()?, key_without_meters);
        let mut candidates: Vec<(&[Sensor], Vec<Option<usize>>)> =
            listed.iter().map(|list| (list.as_slice(), indices_in(list, &wanted))).collect();
        candidates.retain(|(_, indices)| indices.iter().any(Option::is_some));
        // The sort is stable, so the latest of several equal ones stays first.
        candidates.sort_by_key(|(_, indices)| indices.iter().filter(|index| index.is_none()).count());
        candidates.into_iter().find_map(|(list, indices)| {
            let entry = self.entry_from_before(question, question_key, list)?;
            Some(CachedPart { entry, indices })
        })
    }

    /// The cache's entry for these sensors, where it is complete and from before this run.
    fn entry_from_before(&self, question: &Question<'_>, question_key: &Key, list: &[Sensor]) -> Option<Entry> {
        let instrument = question.instrument;
        let earlier = Job { sensors: list.to_vec(), ..question.job.clone() };
        let key = key(instrument.engine.as_ref(), &instrument.version, &earlier).ok()?;
        if key == *question_key || self.machine.is_new(&key) {
            return None;
        }
        let entry = self.look_up(&key).filter(|entry| self.may_serve(question, entry))?;
        let is_complete = entry.answer.as_ref().is_ok_and(|measurement| measurement.is_of(list.len()));
        is_complete.then_some(entry)
    }
}

/// For each wanted meter its index in a list of sensors.
fn indices_in(list: &[Sensor], wanted: &[[u64; 6]]) -> Vec<Option<usize>> {
    let index: HashMap<[u64; 6], usize> = list.iter().map(bits).zip(0..).collect();
    wanted.iter().map(|meter| index.get(meter).copied()).collect()
}

/// How many meters come from the cache, and which ones the engine reads.
fn describe_parts(all: usize, missing: &[Sensor]) -> String {
    if missing.is_empty() {
        return format!("all {all}");
    }
    let names: Vec<&str> = missing.iter().map(|s| s.id.0.as_str()).collect();
    format!("{} of {all}; with a seed of their own {}", all - missing.len(), names.join(", "))
}

/// The seed of a part, which depends on its meters so that equal parts are equal jobs.
///
/// No other part of the question has it, nor any of its stages.
fn seed_of_part(asked: u64, sensors: &[Sensor]) -> u64 {
    let meters: Vec<u64> = sensors.iter().flat_map(bits).collect();
    let [high, low] = [1, 2].map(|half| u64::from(seed(&[vec![asked, half], meters.clone()].concat())));
    high << 31 | low
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use luxproof_scene::{Bounces, Transport};
    use parking_lot::Mutex;

    use super::*;
    use crate::measure::cache::Cache;
    use crate::measure::{CacheMissPolicy, CostedMeasurement, Instrument, Machine};
    use luxproof_engines::fixtures::{Fake, s1};
    use luxproof_engines::{Absent, Engine, EngineError, EngineRoot, JobDir, Support, Version};
    use luxproof_model::{EngineName, Estimate, MeterId, Uncertainty};

    /// With this seed the engine is cut short by the clock.
    const CUT_SEED: u64 = 77;

    /// The seeds and names of meters that an engine was asked.
    type AskedJobs = Arc<Mutex<Vec<(u64, String)>>>;

    /// An engine that reads the seed at every meter, in a cache that stays from run to run.
    struct Lab {
        folder: tempfile::TempDir,
        instrument: Instrument,
        heard: AskedJobs,
    }

    impl Lab {
        fn new(reads_meters_independently: bool, reads: fn(&Job) -> bool) -> Self {
            let heard = AskedJobs::default();
            let read = {
                let heard = Arc::clone(&heard);
                move |job: &Job| {
                    heard.lock().push((job.seed, names(&job.sensors)));
                    if !reads(job) {
                        let what = "it cannot".to_owned();
                        return Err(EngineError::Solver { engine: "fake".into(), what });
                    }
                    let estimate = Estimate { value: job.seed as f64, uncertainty: Uncertainty::Bound(0.5) };
                    let cut_to = (job.seed == CUT_SEED).then_some(0.3);
                    Ok(Measurement { estimates: vec![estimate; job.sensors.len()], cut_to, ..Measurement::default() })
                }
            };
            let engine = Arc::new(Fake { reads_meters_independently, ..Fake::new("fake", read) });
            let instrument = Instrument { engine, version: Version::without_fingerprint("1") };
            Self { folder: tempfile::tempdir().unwrap(), instrument, heard }
        }

        fn reader(&self) -> Reader {
            let cache = Some(Cache::at(self.folder.path().join("cache")));
            Reader { cache, ..Reader::bare(&EngineRoot::at(self.folder.path()), Machine::new(1)) }
        }

        fn question<'a>(&'a self, job: &'a Job) -> Question<'a> {
            Question { may_join: true, ..Question::new(&self.instrument, job, "direct_illuminance") }
        }

        /// The answer in a new run, and what the run asked of the engine.
        fn read(&self, job: &Job) -> (CostedMeasurement, Vec<(u64, String)>) {
            self.read_in(&self.reader(), job)
        }

        fn read_in(&self, reader: &Reader, job: &Job) -> (CostedMeasurement, Vec<(u64, String)>) {
            let taken = reader.read(&self.question(job)).unwrap();
            (taken, std::mem::take(&mut *self.heard.lock()))
        }

        /// One whose cache has the first two meters.
        fn with_two_meters() -> Self {
            let lab = Self::new(true, |_| true);
            lab.read(&of(&[0, 1]));
            lab
        }

        /// Changes the text of the only file with this extension.
        fn damage(&self, extension: &str, change: impl Fn(String) -> String) {
            let [file] = &self.files(extension)[..] else { panic!("{:?}", self.files(extension)) };
            std::fs::write(file, change(std::fs::read_to_string(file).unwrap())).unwrap();
        }

        /// What the engine reads with the cache.
        fn estimates(&self, job: &Job) -> Vec<Estimate> {
            self.reader().read(&self.question(job)).unwrap().measurement.estimates
        }

        /// What the engine reads without the cache.
        fn estimates_without_cache(&self, job: &Job) -> Vec<Estimate> {
            let reader = Reader { cache: None, ..self.reader() };
            reader.read(&self.question(job)).unwrap().measurement.estimates
        }

        fn files(&self, extension: &str) -> Vec<std::path::PathBuf> {
            let engine = self.instrument.engine.name();
            let all =
                self.folder.path().join("cache").join(engine.as_str()).read_dir().unwrap().map(|f| f.unwrap().path());
            all.filter(|f| f.extension().is_some_and(|e| e == extension)).collect()
        }
    }

    fn names(sensors: &[Sensor]) -> String {
        sensors.iter().map(|s| s.id.0.as_str()).collect::<Vec<_>>().join(" ")
    }

    /// The job of some of four meters.
    fn of(meters: &[usize]) -> Job {
        let job = s1(Transport::Direct);
        Job { sensors: meters.iter().map(|k| job.sensors[*k].clone()).collect(), ..job }
    }

    fn meters_of(asked: Vec<(u64, String)>) -> Vec<String> {
        asked.into_iter().map(|(_, meters)| meters).collect()
    }

    fn values(taken: &CostedMeasurement) -> Vec<f64> {
        taken.measurement.estimates.iter().map(|e| e.value).collect()
    }

    #[test]
    fn one_meter_more_asks_for_it_alone_with_a_seed_of_its_own() {
        let lab = Lab::new(true, |_| true);
        assert_eq!(lab.read(&of(&[0, 1])).1, [(1, "m[0] m[1]".to_owned())]);
        let (joined, asked) = lab.read(&of(&[2, 0, 1]));
        let [(seed, meters)] = &asked[..] else { panic!("{asked:?}") };
        assert_eq!((meters.as_str(), joined.source), ("m[2]", AnswerSource::Engine));
        assert!(*seed != 1 && values(&joined) == [*seed as f64, 1.0, 1.0]);
        assert_eq!(joined.measurement.effort[READ_BEFORE], "2 of 3; with a seed of their own m[2]");
        // It is kept, and what it was made of is not needed for it any more.
        let (again, asked) = lab.read(&of(&[2, 0, 1]));
        assert_eq!((&again.measurement, again.cost, asked.len()), (&joined.measurement, joined.cost, 0));
        // The next one is asked for with another seed again.
        let (more, asked) = lab.read(&of(&[0, 1, 2, 3]));
        assert!(asked.len() == 1 && asked[0].1 == "m[3]" && ![1, *seed].contains(&asked[0].0), "{asked:?}");
        assert_eq!(values(&more), [1.0, 1.0, *seed as f64, asked[0].0 as f64]);
    }

    #[test]
    fn what_is_all_kept_needs_nobody_whatever_meters_are_called() {
        let lab = Lab::new(true, |_| true);
        lab.read(&of(&[0, 1]));
        lab.read(&of(&[1, 2]));
        let mut job = of(&[1, 2, 1]);
        job.case = "another".into();
        job.sensors[0].id = MeterId::new("desk", 7);
        let (joined, asked) = lab.read(&job);
        assert_eq!((joined.source, asked.len(), values(&joined).len()), (AnswerSource::Cache, 0, 3));
        assert_eq!(joined.measurement.effort[READ_BEFORE], "all 3");
    }

    #[test]
    fn what_was_asked_with_one_seed_is_not_put_side_by_side() {
        let lab = Lab::new(true, |_| true);
        lab.read(&of(&[0]));
        lab.read(&of(&[1, 2]));
        let (joined, asked) = lab.read(&of(&[0, 1, 2]));
        let [(seed, meters)] = &asked[..] else { panic!("{asked:?}") };
        assert!(meters == "m[0]" && *seed != 1, "{asked:?}");
        assert_eq!(values(&joined), [*seed as f64, 1.0, 1.0]);
    }

    #[test]
    fn what_the_clock_cut_short_is_asked_again_in_the_next_run_and_is_no_part() {
        let lab = Lab::new(true, |_| true);
        let (job, larger) = (Job { seed: CUT_SEED, ..of(&[0]) }, Job { seed: CUT_SEED, ..of(&[0, 1]) });
        let reader = lab.reader();
        assert_eq!(lab.read_in(&reader, &job).1.len(), 1);
        assert!(lab.read_in(&reader, &job).1.is_empty(), "a run asks once");
        assert_eq!(lab.read(&job).1.len(), 1);
        assert_eq!(meters_of(lab.read(&larger).1), ["m[0] m[1]"]);
        // Processes that share the work take what the others found.
        let shared = Reader { asking: CacheMissPolicy::LeaveOpen, ..lab.reader() };
        assert!(lab.read_in(&shared, &job).1.is_empty());
    }

    #[test]
    fn what_differs_in_anything_but_its_meters_is_no_part() {
        let lab = Lab::new(true, |_| true);
        lab.read(&of(&[0, 1]));
        let changes: [fn(&mut Job); 6] = [
            |job| job.seed = 2,
            |job| job.budget.seconds += 1.0,
            |job| job.budget.relative_error /= 2.0,
            |job| job.transport = luxproof_engines::fixtures::CONVERGED,
            |job| job.scene.luminaires[0].flux_scale = 0.5,
            |job| drop(job.settings.insert("preset".into(), "fast".into())),
        ];
        for change in changes {
            let mut job = of(&[0, 1, 2]);
            change(&mut job);
            assert_eq!(lab.read(&job).1, [(job.seed, "m[0] m[1] m[2]".to_owned())]);
        }
        let newer = Instrument { version: Version::without_fingerprint("2"), ..lab.instrument.clone() };
        let job = of(&[0, 1, 2]);
        let whole = Question { instrument: &newer, ..lab.question(&job) };
        lab.reader().read(&whole).unwrap();
        // Nor does it join anything where it is not asked to, or where nothing is to be left out.
        lab.reader().read(&Question { may_join: false, ..lab.question(&of(&[1, 0])) }).unwrap();
        let everything = Reader { machine: Machine::rendering_everything(1), ..lab.reader() };
        everything.read(&lab.question(&of(&[1, 0, 2]))).unwrap();
        let heard: Vec<String> = lab.heard.lock().drain(..).map(|(_, meters)| meters).collect();
        assert_eq!(heard, ["m[0] m[1] m[2]", "m[1] m[0]", "m[1] m[0] m[2]"]);
    }

    #[test]
    fn only_engines_that_say_so_are_asked_for_a_part() {
        let lab = Lab::new(false, |_| true);
        lab.read(&of(&[0, 1]));
        assert_eq!(lab.read(&of(&[0, 1, 2])).1, [(1, "m[0] m[1] m[2]".to_owned())]);
        assert!(lab.files("meters").is_empty());
    }

    #[test]
    fn what_fails_by_itself_is_asked_whole() {
        let lab = Lab::new(true, |job| job.sensors.len() > 1);
        lab.read(&of(&[0, 1]));
        assert_eq!(meters_of(lab.read(&of(&[0, 1, 2])).1), ["m[2]", "m[0] m[1] m[2]"]);
    }

    #[test]
    fn what_a_run_reads_itself_is_no_part_of_what_it_reads() {
        // Else it would depend on which of its cases comes first.
        let lab = Lab::new(true, |_| true);
        let reader = lab.reader();
        lab.read_in(&reader, &of(&[0, 1]));
        assert_eq!(lab.read_in(&reader, &of(&[0, 1, 2])).1, [(1, "m[0] m[1] m[2]".to_owned())]);
        let reader = lab.reader();
        assert_eq!(meters_of(lab.read_in(&reader, &of(&[0, 1, 2, 3])).1), ["m[3]"]);
        assert!(meters_of(lab.read_in(&reader, &of(&[2, 1])).1).is_empty());
        // The same meter by itself is the same job.
        assert!(meters_of(lab.read_in(&reader, &of(&[3, 2])).1).is_empty());
    }

    #[test]
    fn what_is_damaged_or_foreign_is_read_anew() {
        let whole = [(1, "m[0] m[1] m[2]".to_owned())];
        for extension in ["json", "meters"] {
            let lab = Lab::with_two_meters();
            lab.damage(extension, |text| text[..text.len() / 2].to_owned());
            assert_eq!(lab.read(&of(&[0, 1, 2])).1, whole, "{extension}");
            let lab = Lab::with_two_meters();
            lab.damage(extension, |text| text.replace("m[0]", "m[2]").replace("1.0", "3.0"));
            assert_eq!(lab.read(&of(&[0, 1, 2])).1, whole, "{extension}");
        }
        // A whole list that says of other meters that they were read finds no entry of theirs.
        let (lab, lying) = (Lab::with_two_meters(), Lab::with_two_meters());
        let unlisted = lab.question(&of(&[0])).key_without_meters().unwrap();
        lying.reader().cache.unwrap().list(&unlisted, &of(&[2]).sensors).unwrap();
        std::fs::copy(&lying.files("meters")[0], &lab.files("meters")[0]).unwrap();
        let (taken, asked) = lab.read(&of(&[0, 1, 2]));
        assert!(asked.len() == 1 && asked[0].1 == "m[2]", "{asked:?}");
        assert_eq!(values(&taken)[..2], [1.0, 1.0]);
    }

    /// An engine that finds numbers of a scene and reads the first of them everywhere.
    struct Finder;

    impl Engine for Finder {
        fn name(&self) -> EngineName {
            EngineName::new("finder")
        }

        fn probe(&self, _site: &EngineRoot) -> Result<Version, Absent> {
            Ok(Version::without_fingerprint("1"))
        }

        fn supports(&self, _job: &Job) -> Support {
            Support::Yes
        }

        fn shared_precompute(&self, job: &Job) -> Option<Job> {
            let transport = Transport::Indirect(Bounces::Converged);
            (job.transport != Transport::Direct).then(|| Job { sensors: vec![], seed: 0, transport, ..job.clone() })
        }

        fn read(&self, job: &Job, workbench: &JobDir) -> Result<Measurement, EngineError> {
            let found = || Arc::new(vec![10.0 * job.scene.luminaires[0].flux_scale; 20_000]);
            let numbers = workbench.shared_precompute.earlier.clone().unwrap_or_else(found);
            *workbench.shared_precompute.precomputed.lock() = Some(numbers.to_vec());
            let one = Estimate { value: numbers[0], uncertainty: Uncertainty::Exact };
            Ok(Measurement { estimates: vec![one; job.sensors.len()], ..Measurement::default() })
        }
    }

    #[test]
    fn what_is_found_of_a_scene_is_found_once_and_changes_no_reading() {
        let whole = s1(luxproof_engines::fixtures::CONVERGED);
        let at = |k: usize| Job { sensors: vec![whole.sensors[k].clone()], ..whole.clone() };
        let engine: Arc<dyn Engine> = Arc::new(Finder);
        let version = Version::without_fingerprint("1");
        let lab = Lab { instrument: Instrument { engine, version }, ..Lab::new(true, |_| true) };
        lab.estimates(&at(0));
        let seven = Job { transport: Transport::Indirect(Bounces::AtMost(7)), seed: 9, ..at(1) };
        assert_eq!(lab.estimates(&seven), lab.estimates_without_cache(&seven));
        // One of both jobs, which is what is read with: were it other light, it would read otherwise.
        let files = lab.files("precompute");
        let [file] = &files[..] else { panic!("{files:?}") };
        let key = lab.question(&at(0)).precompute_key().unwrap();
        let cache = lab.reader().cache.unwrap();
        let numbers = cache.shared_precompute(&key).unwrap();
        cache.store_precompute(&key, &numbers.iter().map(|n| 1.01 * n).collect::<Vec<_>>()).unwrap();
        assert_ne!(lab.estimates(&at(2)), lab.estimates_without_cache(&at(2)));
        // What is damaged is found anew, and so is that of another error or another scene.
        std::fs::write(file, &std::fs::read(file).unwrap()[..5000]).unwrap();
        assert_eq!(lab.estimates(&at(3)), lab.estimates_without_cache(&at(3)));
        assert_eq!(cache.shared_precompute(&key), Some(numbers));
        let mut finer = at(0);
        finer.budget.relative_error *= 0.9;
        let mut darker = at(0);
        darker.scene.luminaires[0].flux_scale = 0.5;
        for other in [finer, darker] {
            assert_ne!(lab.question(&other).precompute_key().unwrap(), key);
        }
        assert_eq!(lab.question(&Job { transport: Transport::Direct, ..at(0) }).precompute_key(), None);
    }
}
