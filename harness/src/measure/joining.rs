//! Answers put together: what is kept of some meters of a question, and the engine's answer for the others alone.
//!
//! Each part is an answer of its own, to this question but for its meters; the new one has a seed of its own, so that no two parts share
//! random numbers. What was there before a run is joined, and nothing that the run reads itself, so that it does not depend on which of
//! its cases comes first.

use std::collections::HashMap;

use super::cache::{Entry, Key, bits, key};
use super::outcome::{Cost, Source};
use super::question::Question;
use super::reader::Reader;
use crate::engines::{Job, Measurement, Station};
use crate::record::ReadingKey;
use crate::system::random::seed;

/// Where scene files and log of the part go that an engine was asked for.
const ADDED: &str = "-added";

/// Where the effort says which meters were not asked for.
const READ_BEFORE: &str = "meters_read_before";

/// What is kept of a question at some of its stations.
struct Kept {
    part: Entry,
    /// Where it has each station of the question.
    places: Vec<Option<usize>>,
}

impl Reader {
    /// The answer to a question of which others were kept before for some of its meters, and whether the engine had to be asked for the
    /// rest; `None` where nothing of it is kept, or the rest cannot be read by itself.
    pub(super) fn joined(&self, question: &Question<'_>, own: &Key, unlisted: &Key) -> Option<(Entry, Source)> {
        let Kept { part, places } = self.kept(question, own, unlisted)?;
        let job = question.job;
        let missing: Vec<Station> =
            job.stations.iter().zip(&places).filter(|(_, place)| place.is_none()).map(|(s, _)| s.clone()).collect();
        let (all, added) = (places.len(), missing.len());
        let source = if added == 0 { Source::Cache } else { Source::Engine };
        let names: Vec<&str> = missing.iter().map(|s| s.id.0.as_str()).collect();
        let told = match added {
            0 => format!("all {all}"),
            _ => format!("{} of {all}; with a seed of their own {}", all - added, names.join(", ")),
        };
        let mut parts = vec![part];
        if added > 0 {
            let rest = Job { seed: seed_of(job.seed, &missing), stations: missing, ..job.clone() };
            let folder = format!("{}{ADDED}", question.folder);
            let asked = Question { job: &rest, folder: &folder, may_join: false, ..*question };
            // What fails by itself is asked as a whole, like anything else.
            let taken = self.read(&asked).ok()?;
            parts.push(entry(question, taken.cost, taken.measurement));
        }
        let mut new = 0..added;
        let part_and_place = |kept: Option<usize>| kept.map(|k| (0, k)).or_else(|| Some((1, new.next()?)));
        let places: Vec<(usize, usize)> = places.into_iter().filter_map(part_and_place).collect();
        let cost = parts.iter().map(|part| part.cost).reduce(Cost::plus)?;
        let readings: Vec<Measurement> = parts.into_iter().filter_map(|part| part.answer.ok()).collect();
        let mut measurement = Measurement::side_by_side(&readings, &places);
        measurement.effort.insert(READ_BEFORE.to_owned(), told);
        Some((entry(question, cost, measurement), source))
    }

    /// Of answers that are kept the one that has the most meters, the latest of several; `None` where none has any. No second one: all were asked
    /// with the same seed, and what shares random numbers is not independent.
    fn kept(&self, question: &Question<'_>, own: &Key, unlisted: &Key) -> Option<Kept> {
        let (instrument, job) = (question.instrument, question.job);
        let wanted: Vec<[u64; 6]> = job.stations.iter().map(bits).collect();
        let places = |list: &Vec<Station>| -> Vec<Option<usize>> {
            let has: HashMap<[u64; 6], usize> = list.iter().map(bits).zip(0..).collect();
            wanted.iter().map(|meter| has.get(meter).copied()).collect()
        };
        let listed = self.machine.listed(self.cache.as_ref()?, unlisted);
        let mut open: Vec<_> = listed.iter().map(|list| (list, places(list))).collect();
        // Sorting keeps the order of those that have as many.
        open.sort_by_key(|(_, places)| places.iter().filter(|place| place.is_none()).count());
        open.into_iter().filter(|(_, places)| places.iter().any(Option::is_some)).find_map(|(list, places)| {
            let earlier = Job { stations: list.clone(), ..job.clone() };
            let key = key(instrument.engine.as_ref(), &instrument.version, &earlier).ok()?;
            let entry =
                Some(key).filter(|key| key != own && !self.machine.is_new(key)).and_then(|key| self.look_up(&key))?;
            let is_whole = entry.answer.as_ref().is_ok_and(|measurement| measurement.is_of(list.len()));
            is_whole.then_some(Kept { part: entry, places })
        })
    }
}

fn entry(question: &Question<'_>, cost: Cost, measurement: Measurement) -> Entry {
    let Question { instrument, job, .. } = question;
    let key = ReadingKey::new(&job.case, job.procedure, instrument.engine.name());
    Entry { key, version: instrument.version.text.clone(), cost, answer: Ok(measurement) }
}

/// A seed that no other stations of a question have, nor any of its looks: by the meters, so that the same ones are the same job.
fn seed_of(asked: u64, stations: &[Station]) -> u64 {
    let half = |n: u64| u64::from(seed(&[vec![asked, n], stations.iter().flat_map(bits).collect()].concat()));
    half(1) << 31 | half(2)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::path::Path;
    use std::sync::Arc;

    use luminaire::photometry::LuminousOpening;
    use luminaire::scene::{Bounces, Transport};
    use parking_lot::Mutex;

    use super::*;
    use crate::engines::fixtures::{Fake, s1, with_opening};
    use crate::engines::{Budget, EngineError, Site, Version};
    use crate::measure::cache::Cache;
    use crate::measure::{Instrument, Machine, Taken};
    use crate::record::{Estimate, MeterId, Uncertainty};

    /// What an engine was asked: seeds, and names of meters.
    type Heard = Arc<Mutex<Vec<(u64, String)>>>;

    /// An engine that reads the seed at every meter, in a cache that stays from run to run.
    struct Lab {
        folder: tempfile::TempDir,
        instrument: Instrument,
        heard: Heard,
    }

    impl Lab {
        fn new(reads_meters_apart: bool, reads: fn(&Job) -> bool) -> Self {
            let heard = Heard::default();
            let read = {
                let heard = Arc::clone(&heard);
                move |job: &Job| {
                    heard.lock().push((job.seed, names(&job.stations)));
                    if !reads(job) {
                        let what = "it cannot".to_owned();
                        return Err(EngineError::Solver { engine: "fake".into(), what });
                    }
                    let estimate = Estimate { value: job.seed as f64, uncertainty: Uncertainty::Bound(0.5) };
                    Ok(Measurement { estimates: vec![estimate; job.stations.len()], ..Measurement::default() })
                }
            };
            let engine = Arc::new(Fake { reads_meters_apart, ..Fake::new("fake", read) });
            let instrument = Instrument { engine, version: Version::told("1") };
            Self { folder: tempfile::tempdir().unwrap(), instrument, heard }
        }

        fn reader(&self) -> Reader {
            let cache = Some(Cache::at(self.folder.path().join("cache")));
            Reader { cache, ..Reader::bare(&Site::at(self.folder.path()), Machine::new(1)) }
        }

        fn question<'a>(&'a self, job: &'a Job) -> Question<'a> {
            Question { may_join: true, ..Question::new(&self.instrument, job, "direct_illuminance") }
        }

        /// In a run of its own, the answer and what it asked of the engine.
        fn read(&self, job: &Job) -> (Taken, Vec<(u64, String)>) {
            self.read_in(&self.reader(), job)
        }

        fn read_in(&self, reader: &Reader, job: &Job) -> (Taken, Vec<(u64, String)>) {
            let taken = reader.read(&self.question(job)).unwrap();
            (taken, std::mem::take(&mut *self.heard.lock()))
        }

        fn files(&self, extension: &str) -> Vec<std::path::PathBuf> {
            let all = self.folder.path().join("cache/fake").read_dir().unwrap().map(|f| f.unwrap().path());
            all.filter(|f| f.extension().is_some_and(|e| e == extension)).collect()
        }
    }

    fn names(stations: &[Station]) -> String {
        stations.iter().map(|s| s.id.0.as_str()).collect::<Vec<_>>().join(" ")
    }

    /// The job of some of four meters.
    fn of(meters: &[usize]) -> Job {
        let job = s1(Transport::Direct);
        Job { stations: meters.iter().map(|k| job.stations[*k].clone()).collect(), ..job }
    }

    fn values(taken: &Taken) -> Vec<f64> {
        taken.measurement.estimates.iter().map(|e| e.value).collect()
    }

    #[test]
    fn one_meter_more_asks_for_it_alone_with_a_seed_of_its_own() {
        let lab = Lab::new(true, |_| true);
        assert_eq!(lab.read(&of(&[0, 1])).1, [(1, "m[0] m[1]".to_owned())]);
        let (joined, asked) = lab.read(&of(&[2, 0, 1]));
        let [(seed, meters)] = &asked[..] else { panic!("{asked:?}") };
        assert_eq!((meters.as_str(), joined.source), ("m[2]", Source::Engine));
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
        job.stations[0].id = MeterId::new("desk", 7);
        let (joined, asked) = lab.read(&job);
        assert_eq!((joined.source, asked.len(), values(&joined).len()), (Source::Cache, 0, 3));
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
    fn what_differs_in_anything_but_its_meters_is_no_part() {
        let lab = Lab::new(true, |_| true);
        lab.read(&of(&[0, 1]));
        let changes: [fn(&mut Job); 6] = [
            |job| job.seed = 2,
            |job| job.budget.seconds += 1.0,
            |job| job.budget.relative_error /= 2.0,
            |job| job.transport = crate::engines::fixtures::CONVERGED,
            |job| job.scene.luminaires[0].flux_scale = 0.5,
            |job| drop(job.settings.insert("preset".into(), "fast".into())),
        ];
        for change in changes {
            let mut job = of(&[0, 1, 2]);
            change(&mut job);
            assert_eq!(lab.read(&job).1, [(job.seed, "m[0] m[1] m[2]".to_owned())]);
        }
        let newer = Instrument { version: Version::told("2"), ..lab.instrument.clone() };
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
        let lab = Lab::new(true, |job| job.stations.len() > 1);
        lab.read(&of(&[0, 1]));
        let heard: Vec<String> = lab.read(&of(&[0, 1, 2])).1.into_iter().map(|(_, meters)| meters).collect();
        assert_eq!(heard, ["m[2]", "m[0] m[1] m[2]"]);
    }

    #[test]
    fn what_a_run_reads_itself_is_no_part_of_what_it_reads() {
        // Else it would depend on which of its cases comes first.
        let lab = Lab::new(true, |_| true);
        let reader = lab.reader();
        lab.read_in(&reader, &of(&[0, 1]));
        assert_eq!(lab.read_in(&reader, &of(&[0, 1, 2])).1, [(1, "m[0] m[1] m[2]".to_owned())]);
        let reader = lab.reader();
        let meters = |asked: Vec<(u64, String)>| asked.into_iter().map(|(_, m)| m).collect::<Vec<_>>();
        assert_eq!(meters(lab.read_in(&reader, &of(&[0, 1, 2, 3])).1), ["m[3]"]);
        assert!(meters(lab.read_in(&reader, &of(&[2, 1])).1).is_empty());
        // The same meter by itself is the same job.
        assert!(meters(lab.read_in(&reader, &of(&[3, 2])).1).is_empty());
    }

    #[test]
    fn what_is_damaged_or_foreign_is_read_anew() {
        let sound = || {
            let lab = Lab::new(true, |_| true);
            lab.read(&of(&[0, 1]));
            lab
        };
        let whole = [(1, "m[0] m[1] m[2]".to_owned())];
        let damage = |lab: &Lab, extension: &str, change: &dyn Fn(String) -> String| {
            let [file] = &lab.files(extension)[..] else { panic!("{:?}", lab.files(extension)) };
            std::fs::write(file, change(std::fs::read_to_string(file).unwrap())).unwrap();
        };
        for extension in ["json", "meters"] {
            let lab = sound();
            damage(&lab, extension, &|text| text[..text.len() / 2].to_owned());
            assert_eq!(lab.read(&of(&[0, 1, 2])).1, whole, "{extension}");
            let lab = sound();
            damage(&lab, extension, &|text| text.replace("m[0]", "m[2]").replace("1.0", "3.0"));
            assert_eq!(lab.read(&of(&[0, 1, 2])).1, whole, "{extension}");
        }
        // A whole list that says of other meters that they were read finds no entry of theirs.
        let (lab, lying) = (sound(), sound());
        let unlisted = lab.question(&of(&[0])).key_without_meters().unwrap();
        lying.reader().cache.unwrap().list(&unlisted, &of(&[2]).stations).unwrap();
        std::fs::copy(&lying.files("meters")[0], &lab.files("meters")[0]).unwrap();
        let (taken, asked) = lab.read(&of(&[0, 1, 2]));
        assert!(asked.len() == 1 && asked[0].1 == "m[2]", "{asked:?}");
        assert_eq!(values(&taken)[..2], [1.0, 1.0]);
    }

    #[test]
    fn what_is_found_of_a_scene_is_found_once_and_changes_no_reading() {
        let panel = LuminousOpening::Box { x_m: 0.6, y_m: 0.6, height_m: 0.0 };
        let whole = s1(crate::engines::fixtures::CONVERGED);
        let mut whole = Job { budget: Budget { relative_error: 0.05, ..whole.budget }, ..whole };
        whole.scene.luminaires = vec![with_opening(whole.scene.luminaires[0].clone(), panel)];
        let at = |k: usize| Job { stations: vec![whole.stations[k].clone()], ..whole.clone() };
        let engine = Arc::from(crate::engines::named("simulator", &BTreeMap::new(), Path::new(".")).unwrap());
        let lab = Lab { instrument: Instrument { engine, version: Version::own() }, ..Lab::new(true, |_| true) };
        let files = || {
            let all = lab.folder.path().join("cache/simulator").read_dir().unwrap().map(|f| f.unwrap().path());
            all.filter(|f| f.extension().is_some_and(|e| e == "groundwork")).collect::<Vec<_>>()
        };
        let read = |job: &Job| lab.reader().read(&lab.question(job)).unwrap().measurement.estimates;
        let bare = Reader { cache: None, ..lab.reader() };
        let anew = |job: &Job| bare.read(&lab.question(job)).unwrap().measurement.estimates;
        read(&at(0));
        let seven = Job { transport: Transport::Indirect(Bounces::AtMost(7)), seed: 9, ..at(1) };
        assert_eq!(read(&seven), anew(&seven));
        // One of both jobs, which is what is read with: were it other light, it would read otherwise.
        let [file] = &files()[..] else { panic!("{:?}", files()) };
        let key = lab.question(&at(0)).key_of_groundwork().unwrap();
        let cache = lab.reader().cache.unwrap();
        let numbers = cache.groundwork(&key).unwrap();
        cache
            .keep_groundwork(
                &key,
                &numbers.iter().map(|n| if *n > 3.0 && n.fract() != 0.0 { 1.01 * n } else { *n }).collect::<Vec<_>>(),
            )
            .unwrap();
        assert_ne!(read(&at(2)), anew(&at(2)));
        // What is damaged is found anew, and so is that of another error or another scene.
        std::fs::write(file, &std::fs::read(file).unwrap()[..5000]).unwrap();
        assert_eq!(read(&at(3)), anew(&at(3)));
        assert_eq!(cache.groundwork(&key), Some(numbers));
        let mut finer = at(0);
        finer.budget.relative_error = 0.045;
        let mut darker = at(0);
        darker.scene.luminaires[0].flux_scale = 0.5;
        for other in [finer, darker] {
            assert_ne!(lab.question(&other).key_of_groundwork().unwrap(), key);
        }
        assert_eq!(lab.question(&Job { transport: Transport::Direct, ..at(0) }).key_of_groundwork(), None);
    }
}
