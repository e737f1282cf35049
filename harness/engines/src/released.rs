//! A release as an engine: to the program it is one by its own name, with readings, keys in the cache, baselines and policies of its
//! own. What it is driven by is the same.

use std::cmp::Reverse;

use luxproof_scene::{LuminaireModel, Transport};

use super::EngineRoot;
use super::catalogue::ALL;
use super::contract::{Absent, Answer, Engine, Entry, Job, Measurement, Setting, Support, Version, left_to_inner};
use super::job_dir::{EngineError, JobDir, SceneFile};
use super::releases::{self, Cannot, KnownRelease};
use super::type_c::InTypeC;
use luxproof_model::{EngineName, Release, Role, family};
use luxproof_spec::suggestion;

/// What is wrong with a name that is none of an engine of ours, and what to do.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{message}; {help}")]
pub struct Unknown {
    pub message: String,
    pub help: String,
}

/// An engine of ours, or a release of it, by its name; `Ok(None)` where it is neither, but might be a program of the user's.
pub fn built_in(name: &str) -> Result<Option<Box<dyn Engine>>, Unknown> {
    let Some(entry) = ALL.iter().find(|entry| entry.name == *family(name)) else { return Ok(None) };
    if entry.name == *name {
        return Ok(Some(entry.engine()));
    }
    match releases::known(name) {
        Some(known) => Ok(Some(InTypeC::renderer(Box::new(Released { known, inner: (entry.make)() })))),
        None => Err(unknown(entry, name)),
    }
}

fn unknown(entry: &Entry, name: &str) -> Unknown {
    let engine = entry.name.as_str();
    let (releases, mut nearest) = (releases::releases_of(engine), None);
    if releases.is_empty() {
        let help = format!("there is only the one that is installed: name it `{engine}`");
        return Unknown { message: format!("{} has no releases here", entry.display_name), help };
    }
    let asked = name.split_once('@').map_or("", |(_, release)| release);
    let message = match asked.parse::<Release>() {
        Ok(release) => {
            // Of its two neighbours the one that shares more of its beginning, the older where they are alike.
            let alike =
                |r: &Release| r.as_str().bytes().zip(release.as_str().bytes()).take_while(|(a, b)| a == b).count();
            let older = releases.iter().rfind(|r| **r < release);
            let newer = releases.iter().find(|r| **r > release);
            nearest = older.into_iter().chain(newer).min_by_key(|r| Reverse(alike(r))).cloned();
            format!("there is no release `{release}` of {engine} here")
        }
        Err(why) => format!("`{}` names no release: {why}", short(asked)),
    };
    let listed: Vec<String> = releases::of(engine).map(|known| known.name.to_owned()).collect();
    let nearest = nearest.map_or_else(String::new, |r| format!("the nearest is `{engine}@{r}`; "));
    Unknown { message, help: format!("{nearest}known: {}", listed.join(", ")) }
}

/// Enough to know it by.
fn short(text: &str) -> String {
    let start: String = text.chars().take(30).collect();
    if start.len() < text.len() { start + "..." } else { start }
}

/// All names, or what is wrong with the first that is none of ours.
pub fn all_built_in(names: &[String]) -> Result<(), Unknown> {
    for name in names {
        if built_in(name)?.is_none() {
            let help = suggestion(name, ALL.iter().map(|entry| entry.name.as_str()));
            return Err(Unknown { message: format!("there is no engine `{name}`"), help });
        }
    }
    Ok(())
}

/// A release of one of our engines: the same driver, another renderer.
struct Released {
    known: &'static KnownRelease,
    inner: Box<dyn Engine>,
}

impl Released {
    fn bench(&self, workbench: &JobDir) -> JobDir {
        let is_reused = self.known.cannot != Some(Cannot::LoadSeveralScenes);
        let idle = workbench.idle.clone().filter(|_| is_reused);
        JobDir { site: self.known.site(&workbench.site), idle, ..workbench.clone() }
    }

    fn own(&self, error: EngineError) -> EngineError {
        error.of_engine(&self.name())
    }
}

/// Whether any of the light is read by samples; direct light of points is not.
fn is_sampled(job: &Job) -> bool {
    let is_open = job.scene.luminaires.iter().any(|l| l.model != LuminaireModel::Point);
    is_open || job.transport != Transport::Direct
}

impl Engine for Released {
    left_to_inner!();

    fn name(&self) -> EngineName {
        EngineName::new(self.known.name)
    }

    fn probe(&self, site: &EngineRoot) -> Result<Version, Absent> {
        let own = self.known.site(site);
        let remedy = || format!("run `luxproof engines install {}`", self.known.name);
        if !self.known.is_in(&own) {
            let reason = format!("there is no {} in {}", self.known.package, own.root().display());
            return Err(Absent { reason, remedy: remedy() });
        }
        let version = self.inner.probe(&own).map_err(|absent| Absent { remedy: remedy(), ..absent })?;
        // rtrace has reported 6.0a for years.
        Ok(Version { text: format!("{}, {}", self.known.package, version.text), ..version })
    }

    fn supports(&self, job: &Job) -> Support {
        match self.known.cannot {
            Some(Cannot::HaveASeed) if is_sampled(job) => {
                let package = self.known.package;
                let why =
                    format!("the rtrace of {package} is linked statically: nothing gives its random numbers a seed");
                Support::No(why)
            }
            _ => self.inner.supports(job),
        }
    }

    /// It is the engine that it is a release of, too: witnesses of one program count once.
    fn components(&self, job: &Job) -> Vec<String> {
        let mut all = self.inner.components(job);
        all.push(family(self.known.name).to_owned());
        all
    }

    fn export(&self, job: &Job) -> Result<Vec<SceneFile>, EngineError> {
        self.inner.export(job).map_err(|error| self.own(error))
    }

    fn command_by_hand(&self, job: &Job, site: &EngineRoot) -> Option<String> {
        self.inner.command_by_hand(job, &self.known.site(site))
    }

    fn check_settings(&self, job: &Job) -> Result<(), EngineError> {
        self.inner.check_settings(job).map_err(|error| self.own(error))
    }

    fn expected_s(&self, job: &Job) -> Option<f64> {
        self.inner.expected_s(job)
    }

    fn memory_mib(&self, job: &Job, threads: usize) -> u64 {
        self.inner.memory_mib(job, threads)
    }

    fn read(&self, job: &Job, workbench: &JobDir) -> Result<Measurement, EngineError> {
        let mut measurement = self.inner.read(job, &self.bench(workbench)).map_err(|error| self.own(error))?;
        if self.known.cannot == Some(Cannot::LookUpAsBefore) {
            let note = "beyond the ends of a table it looks up otherwise than the release that the bound was made for";
            measurement.notes.push(note.to_owned());
        }
        if self.known.cannot == Some(Cannot::LoadSeveralScenes) {
            let note = "each scene has its own process: with several in one process the values are wrong, and others each time";
            measurement.notes.push(note.to_owned());
        }
        Ok(measurement)
    }

    fn read_all(&self, jobs: &[(&Job, &JobDir)], together: &JobDir) -> Result<Vec<Answer>, EngineError> {
        let benches: Vec<JobDir> = jobs.iter().map(|(_, bench)| self.bench(bench)).collect();
        let jobs: Vec<(&Job, &JobDir)> = jobs.iter().map(|(job, _)| *job).zip(&benches).collect();
        let answers = self.inner.read_all(&jobs, &self.bench(together)).map_err(|error| self.own(error))?;
        Ok(answers.into_iter().map(|answer| answer.map_err(|error| self.own(error))).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_release_that_nobody_knows_is_refused_with_the_nearest_and_what_is_no_release_with_what_one_is() {
        let refused = |name: &str| built_in(name).err().unwrap().to_string();
        let reported = refused("mitsuba@3.7.0");
        assert!(
            reported.contains("no release `3.7.0` of mitsuba") && reported.contains("nearest is `mitsuba@3.7.1`"),
            "{reported}"
        );
        assert!(reported.contains("mitsuba@3.5.2"), "{reported}");
        for name in [
            "mitsuba@",
            "mitsuba@../../etc",
            "mitsuba@3.5.2@1",
            "cycles@4.2.0/x",
            &format!("luxcore@{}", "9".repeat(99)),
        ] {
            let reported = refused(name);
            assert!(reported.contains("names no release") && reported.len() < 300, "{reported}");
        }
        assert!(refused("radiance@9.9").contains("nearest is `radiance@1.3.1`"));
        assert!(refused("povray@3.8").contains("name it `povray`"));
        assert!(built_in("mine@1.0").unwrap().is_none());
        assert!(all_built_in(&["radiance@1.0.0".into(), "mine".into()]).is_err());
    }

    #[test]
    fn what_a_release_cannot_do_is_declined_and_the_rest_is_not() {
        let (old, new) = (built_in("radiance@1.0.0").unwrap().unwrap(), built_in("radiance@1.1.5").unwrap().unwrap());
        let sampled = crate::fixtures::s1(crate::fixtures::CONVERGED);
        let direct = Job { transport: Transport::Direct, ..sampled.clone() };
        assert!(matches!(old.supports(&sampled), Support::No(why) if why.contains("pyradiance-1.0.0")));
        assert_eq!(old.supports(&direct), new.supports(&direct));
        assert!(!matches!(new.supports(&sampled), Support::No(_)));
    }

    #[test]
    fn a_release_shares_its_code_with_its_engine_and_nothing_else() {
        let release = built_in("mitsuba@3.5.2").unwrap().unwrap();
        assert_eq!(release.name().as_str(), "mitsuba@3.5.2");
        let job = crate::fixtures::s1(crate::fixtures::CONVERGED);
        assert!(release.components(&job).contains(&"mitsuba".to_owned()));
        let absent = release.probe(&EngineRoot::at("/nowhere")).unwrap_err().to_string();
        assert!(absent.contains("mitsuba-3.5.2") && absent.contains("engines install mitsuba@3.5.2"), "{absent}");
    }
}
