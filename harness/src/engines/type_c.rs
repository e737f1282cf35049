//! Tables of types A and B for renderers, which read type C: made for each job, as fine as the renderer may hold, and what that leaves off
//! is in the bound of its readings.
//!
//! A point is turned so that its table keeps its own axis, and but for the ends of the table nothing is lost. What has a body, and
//! what is handed over together with the user's file, keeps its attitude and gets a stand-in.

use std::sync::{Arc, Mutex, PoisonError};

use luminaire::photometry::{Photometry, TypeCLimits};
use luminaire::scene::{Luminaire, LuminaireModel, Meter, Transport};

use super::Site;
use super::contract::{Absent, Answer, Engine, Entry, Job, Knob, Measurement, Support, Version};
use super::openings::places_m;
use super::workbench::{EngineError, SceneFile, Workbench};
use crate::record::{EngineName, Estimate, Role};

/// Tables that are remembered.
const MOST: usize = 64;

impl Entry {
    /// The engine, which gets its tables in type C.
    pub(super) fn engine(&self) -> Box<dyn Engine> {
        InTypeC::renderer((self.make)())
    }
}

/// An engine that gets tables of type C alone.
pub(super) struct InTypeC {
    inner: Box<dyn Engine>,
    limits: TypeCLimits,
    keeps_attitude: bool,
    /// Stand-ins by what they stand for, of points or of bodies.
    known: Mutex<Vec<(Known, Luminaire)>>,
}

type Known = (Arc<Photometry>, bool);

impl InTypeC {
    /// A renderer that gets scenes of its own; a witness of ours as it is.
    pub(super) fn renderer(inner: Box<dyn Engine>) -> Box<dyn Engine> {
        Self::boxed(inner, false)
    }

    /// A program that gets the user's files beside the tables.
    pub(super) fn program(inner: Box<dyn Engine>) -> Box<dyn Engine> {
        Self::boxed(inner, true)
    }

    fn boxed(inner: Box<dyn Engine>, keeps_attitude: bool) -> Box<dyn Engine> {
        if inner.is_witness() {
            return inner;
        }
        let own = TypeCLimits::default();
        let limits = TypeCLimits { most_planes: inner.most_planes().unwrap_or(own.most_planes), ..own };
        Box::new(Self { inner, limits, keeps_attitude, known: Mutex::new(vec![]) })
    }

    /// The job with tables of type C; `None` where it has no others, or the engine's own reader gets the user's files.
    fn made(&self, job: &Job) -> Option<Job> {
        let is_native = |l: &Luminaire| l.photometry.distribution.is_native();
        if !job.scene.luminaires.iter().any(is_native) || self.inner.reads_files(job) && !self.keeps_attitude {
            return None;
        }
        let mut made = job.clone();
        made.scene.luminaires.iter_mut().filter(|l| is_native(l)).for_each(|l| *l = self.luminaire(l));
        Some(made)
    }

    fn luminaire(&self, luminaire: &Luminaire) -> Luminaire {
        let is_turned = luminaire.model == LuminaireModel::Point && !self.keeps_attitude;
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        let is_it =
            |((of, turned), _): &&(Known, Luminaire)| Arc::ptr_eq(of, &luminaire.photometry) && *turned == is_turned;
        let made = known.iter().find(is_it).map(|(_, made)| made.clone());
        let made = made.unwrap_or_else(|| {
            let model = if is_turned { LuminaireModel::Point } else { LuminaireModel::Area };
            let mut made =
                Luminaire { model, orientation: glam::DMat3::IDENTITY, ..luminaire.clone() }.in_type_c(self.limits);
            if self.keeps_attitude {
                let distribution = made.photometry.distribution.clone();
                made.photometry = Arc::new(Photometry { distribution, ..Photometry::clone(&luminaire.photometry) });
            }
            if known.len() == MOST {
                known.remove(0);
            }
            known.push(((Arc::clone(&luminaire.photometry), is_turned), made.clone()));
            made
        });
        let orientation = luminaire.orientation * made.orientation;
        Luminaire { photometry: made.photometry, orientation, ..luminaire.clone() }
    }

    /// The same reading with what the tables may have put it off, and with words on it.
    fn judged(job: &Job, made: &Job, measurement: Measurement) -> Measurement {
        let pairs: Vec<(&Luminaire, &Luminaire)> = job.scene.luminaires.iter().zip(&made.scene.luminaires).collect();
        let flux = |l: &Luminaire| l.photometry.distribution.flux().value() * l.flux_scale;
        let misled: f64 = pairs.iter().map(|(asked, made)| misled_lm(asked, made)).sum();
        let all: f64 = pairs.iter().map(|(asked, _)| flux(asked)).sum();
        let share = if all > 0.0 && job.transport != Transport::Direct { misled / all } else { 0.0 };
        let bound = |meter: &Meter, value: f64| {
            let direct = match job.transport {
                Transport::Indirect(_) => 0.0,
                Transport::Direct | Transport::Total(_) => pairs.iter().map(|(a, b)| off_lx(a, b, meter)).sum::<f64>(),
            };
            direct + share * value.abs()
        };
        let widened = |(estimate, station): (&Estimate, &super::Station)| Estimate {
            uncertainty: estimate.uncertainty.within(bound(&station.meter, estimate.value)),
            ..*estimate
        };
        let estimates = measurement.estimates.iter().zip(&job.stations).map(widened).collect();
        let mut notes = measurement.notes;
        notes.extend(pairs.iter().filter_map(|(asked, made)| note(asked, made)));
        notes.dedup();
        Measurement { estimates, notes, ..measurement }
    }
}

/// How far a stand-in leaves the direct illuminance of a meter off, in lux: exactly for a point, of a body by the places that its light comes from.
fn off_lx(asked: &Luminaire, made: &Luminaire, meter: &Meter) -> f64 {
    if Arc::ptr_eq(&asked.photometry, &made.photometry) {
        return 0.0;
    }
    let places = places_m(asked);
    let of_place = |place_m: &glam::DVec3| {
        let ray_m = meter.position_m - *place_m;
        let cosine = -ray_m.normalize_or_zero().dot(meter.normal);
        let off = asked.intensity_towards(ray_m).value() - made.intensity_towards(ray_m).value();
        // What is left of turning there and back is rounding.
        let rounding = 1e-12 * asked.photometry.distribution.max_intensity().value() * asked.flux_scale;
        let off = if off.abs() > rounding { off.abs() } else { 0.0 };
        if ray_m.length_squared() > 0.0 { off * cosine.max(0.0) / ray_m.length_squared() } else { 0.0 }
    };
    places.iter().map(of_place).sum::<f64>() / places.len() as f64
}

/// Flux in lumens that a stand-in sends elsewhere, adds or loses.
fn misled_lm(asked: &Luminaire, made: &Luminaire) -> f64 {
    if Arc::ptr_eq(&asked.photometry, &made.photometry) {
        return 0.0;
    }
    let turn = made.orientation.transpose() * asked.orientation;
    asked.flux_scale * asked.photometry.distribution.misled_by(&made.photometry.distribution, turn)
}

/// What a reader of the report is told of a table that is not the file's own.
fn note(asked: &Luminaire, made: &Luminaire) -> Option<String> {
    let (table, stand_in) = (&asked.photometry.distribution, &made.photometry.distribution);
    if Arc::ptr_eq(&asked.photometry, &made.photometry) {
        return None;
    }
    let (kind, planes, gammas) = (table.goniometer(), stand_in.full_circle().c_deg().len(), stand_in.gamma_deg().len());
    let begins = format!(
        "{}: its table of type {kind:?} was given as one of type C, {planes} planes of {gammas} angles",
        asked.id
    );
    if is_kept(asked, made) {
        return Some(begins + " about its own axis: nothing is lost but beside ends in light");
    }
    let share = misled_lm(asked, made) / (table.flux().value() * asked.flux_scale).max(f64::MIN_POSITIVE);
    Some(format!("{begins}, which mislead {share:.1e} of its flux: that is in the bound"))
}

/// Whether a stand-in is the same at every node of a table and in every cell, but where rounding decides at its ends.
fn is_kept(asked: &Luminaire, made: &Luminaire) -> bool {
    let table = &asked.photometry.distribution;
    let nothing = 1e-9 * table.max_intensity().value() * asked.flux_scale;
    table.node_directions().filter(|own| table.jump_towards(*own).value() == 0.0).all(|own| {
        let towards = asked.orientation * own;
        (asked.intensity_towards(towards) - made.intensity_towards(towards)).value().abs() <= nothing
    })
}

impl Engine for InTypeC {
    fn name(&self) -> EngineName {
        self.inner.name()
    }

    fn role(&self) -> Role {
        self.inner.role()
    }

    fn samples(&self, job: &Job) -> bool {
        self.inner.samples(job)
    }

    fn is_vouched_for(&self) -> bool {
        self.inner.is_vouched_for()
    }

    fn reads_files(&self, job: &Job) -> bool {
        self.inner.reads_files(job)
    }

    fn probe(&self, site: &Site) -> Result<Version, Absent> {
        self.inner.probe(site)
    }

    fn supports(&self, job: &Job) -> Support {
        self.inner.supports(self.made(job).as_ref().unwrap_or(job))
    }

    fn components(&self, job: &Job) -> Vec<String> {
        self.inner.components(job)
    }

    fn export(&self, job: &Job) -> Result<Vec<SceneFile>, EngineError> {
        self.inner.export(self.made(job).as_ref().unwrap_or(job))
    }

    fn command_by_hand(&self, job: &Job, site: &Site) -> Option<String> {
        self.inner.command_by_hand(self.made(job).as_ref().unwrap_or(job), site)
    }

    fn knobs(&self) -> &'static [Knob] {
        self.inner.knobs()
    }

    fn check_settings(&self, job: &Job) -> Result<(), EngineError> {
        self.inner.check_settings(job)
    }

    fn expected_s(&self, job: &Job) -> Option<f64> {
        self.inner.expected_s(self.made(job).as_ref().unwrap_or(job))
    }

    fn most_planes(&self) -> Option<usize> {
        self.inner.most_planes()
    }

    fn memory_mib(&self, job: &Job, threads: usize) -> u64 {
        self.inner.memory_mib(self.made(job).as_ref().unwrap_or(job), threads)
    }

    fn cache_identity(&self, job: &Job) -> Job {
        self.inner.cache_identity(job)
    }

    fn read(&self, job: &Job, workbench: &Workbench) -> Result<Measurement, EngineError> {
        match self.made(job) {
            Some(made) => self.inner.read(&made, workbench).map(|read| Self::judged(job, &made, read)),
            None => self.inner.read(job, workbench),
        }
    }

    fn takes_batches(&self) -> bool {
        self.inner.takes_batches()
    }

    fn read_all(&self, jobs: &[(&Job, &Workbench)], together: &Workbench) -> Result<Vec<Answer>, EngineError> {
        let made: Vec<Option<Job>> = jobs.iter().map(|(job, _)| self.made(job)).collect();
        let given: Vec<(&Job, &Workbench)> =
            jobs.iter().zip(&made).map(|((job, bench), made)| (made.as_ref().unwrap_or(job), *bench)).collect();
        let answers = self.inner.read_all(&given, together)?;
        let judged = |((answer, (job, _)), made): ((Answer, &(&Job, &Workbench)), &Option<Job>)| match made {
            Some(made) => answer.map(|read| Self::judged(job, made, read)),
            None => answer,
        };
        Ok(answers.into_iter().zip(jobs).zip(&made).map(judged).collect())
    }

    fn max_threads(&self) -> usize {
        self.inner.max_threads()
    }

    fn start_s(&self) -> f64 {
        self.inner.start_s()
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use luminaire::photometry::{Goniometer, LuminousIntensityDistribution, LuminousOpening, lm63};
    use luminaire::scene::orientation;

    use super::*;
    use crate::engines::fixtures::{exact_direct_lx, goniometer, luminaire, workbench};
    use crate::engines::{ALL, entry};
    use crate::record::Uncertainty;

    /// Reads direct light of points exactly, of whatever tables it is given.
    struct Exact(Option<usize>);

    impl Engine for Exact {
        fn name(&self) -> EngineName {
            EngineName::new("exact")
        }

        fn probe(&self, _site: &Site) -> Result<Version, Absent> {
            Ok(Version { text: "1".into(), fingerprint: String::new() })
        }

        fn supports(&self, _job: &Job) -> Support {
            Support::Yes
        }

        fn most_planes(&self) -> Option<usize> {
            self.0
        }

        fn read(&self, job: &Job, _workbench: &Workbench) -> Result<Measurement, EngineError> {
            let exact = |value| Estimate { value, uncertainty: Uncertainty::Bound(0.0) };
            assert!(job.scene.luminaires.iter().all(|l| !l.photometry.distribution.is_native()));
            Ok(Measurement {
                estimates: exact_direct_lx(job).into_iter().map(exact).collect(),
                ..Measurement::default()
            })
        }
    }

    /// A floodlight of type B, without symmetry, of so many vertical angles; it ends in the dark.
    fn flood(verticals: u32) -> LuminousIntensityDistribution {
        let angles = |count: u32| (0..=count).map(move |k| -60.0 + 120.0 * f64::from(k) / f64::from(count));
        let words = |all: &mut dyn Iterator<Item = f64>| all.map(|x| x.to_string()).collect::<Vec<_>>().join(" ");
        let value =
            |h: f64, v: f64| (900.0 + 4.0 * h - 3.0 * v) * (1.0 - (h / 60.0).powi(2)) * (1.0 - (v / 60.0).powi(4));
        let rows = angles(20).map(|h| words(&mut angles(verticals).map(move |v| value(h, v)))).collect::<Vec<_>>();
        let text = format!(
            "IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 {} 21 2 2 0 0 0\n1 1 0\n{}\n{}\n{}\n",
            verticals + 1,
            words(&mut angles(verticals)),
            words(&mut angles(20)),
            rows.join("\n")
        );
        lm63::parse(text.as_bytes()).unwrap().distribution
    }

    fn job(verticals: u32, model: LuminaireModel) -> Job {
        let mut lamp = luminaire("lamp", DVec3::new(0.3, 0.1, 2.0), flood(verticals));
        lamp.orientation = orientation(25.0, 40.0, 10.0);
        lamp.model = model;
        let gamma: Vec<f64> = (0..30).map(|k| 3.1 * f64::from(k)).collect();
        goniometer(&lamp, 2.0, &[0.0, 40.0, 123.0, 301.0], &gamma)
    }

    #[test]
    fn what_a_table_of_type_c_is_off_is_in_the_bound_and_told() {
        for (verticals, model, most_planes, is_exact) in [
            (40, LuminaireModel::Point, None, true),
            (300, LuminaireModel::Point, Some(256), false),
            (40, LuminaireModel::Area, None, false),
        ] {
            let asked = job(verticals, model);
            let engine = InTypeC::renderer(Box::new(Exact(most_planes)));
            let bench = workbench(Site::at("/nowhere"), std::path::Path::new("/nowhere"));
            let read = engine.read(&asked, &bench).unwrap();
            let (mut bounded, mut lit) = (0, 0);
            for (estimate, truth) in read.estimates.iter().zip(exact_direct_lx(&asked)) {
                let bound = estimate.uncertainty.bound();
                assert!(
                    (estimate.value - truth).abs() <= 1.001 * bound + 1e-10 * truth.max(1.0),
                    "{estimate:?} {truth}"
                );
                assert!(bound <= 0.02 * 250.0, "{bound}");
                bounded += usize::from(bound > 0.0);
                lit += usize::from(truth > 0.0);
            }
            assert!(lit > 30 && (bounded == 0) == is_exact, "{verticals} {model:?}: {bounded} of {lit}");
            let told = read.notes.iter().any(|n| n.contains("about its own axis: nothing is lost"));
            assert!(read.notes.len() == 1 && told == is_exact, "{:?}", read.notes);
        }
    }

    #[test]
    fn every_renderer_of_ours_exports_tables_of_type_b() {
        for (verticals, most) in [(40, usize::MAX), (300, 256)] {
            let asked = job(verticals, LuminaireModel::Point);
            for known in ALL {
                let engine = known.engine();
                if matches!(engine.supports(&asked), Support::No(_)) {
                    continue;
                }
                let files = engine.export(&asked).unwrap();
                assert_eq!(files.is_empty(), engine.is_witness(), "{}", engine.name());
                if known.name.as_str() == "povray" {
                    let scene =
                        files.iter().map(|f| String::from_utf8_lossy(&f.bytes).into_owned()).collect::<String>();
                    let planes = scene.matches("/720 ").count();
                    assert!(planes > 30 && planes <= most, "{planes}");
                }
            }
        }
        let povray = entry("povray").unwrap().engine();
        assert!(!matches!(povray.supports(&job(300, LuminaireModel::Point)), Support::No(_)));
    }

    #[test]
    fn a_program_gets_the_attitude_and_the_file_that_were_asked_for() {
        let mut asked = job(40, LuminaireModel::Point);
        let mut photometry = Photometry::clone(&asked.scene.luminaires[0].photometry);
        photometry.opening = LuminousOpening::Box { x_m: 0.1, y_m: 0.1, height_m: 0.0 };
        photometry.source =
            vec![luminaire::photometry::SourceFile { name: "l.ies".into(), bytes: b"text".as_slice().into() }];
        asked.scene.luminaires[0].photometry = Arc::new(photometry);
        let program = InTypeC {
            inner: Box::new(Exact(None)),
            limits: TypeCLimits::default(),
            keeps_attitude: true,
            known: Mutex::default(),
        };
        let made = program.made(&asked).unwrap();
        let (before, after) = (&asked.scene.luminaires[0], &made.scene.luminaires[0]);
        assert!((before.orientation.z_axis - after.orientation.z_axis).length() < 1e-12);
        assert_eq!(before.photometry.source, after.photometry.source);
        assert_eq!(after.photometry.distribution.goniometer(), Goniometer::C);
        assert!(Arc::ptr_eq(&program.made(&asked).unwrap().scene.luminaires[0].photometry, &after.photometry));
    }
}
