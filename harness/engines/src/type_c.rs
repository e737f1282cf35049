//! Tables of types A and B for renderers, which read type C. Each job gets tables as fine as the renderer supports, and the bound of
//! its readings covers the remaining error.
//!
//! A point luminaire turns with its table, so that the table keeps its own axis and nothing is lost except at its ends. A luminaire
//! with a body keeps its attitude and gets a resampled table. So does one that is passed on together with the user's file.

use std::sync::{Arc, Mutex, PoisonError};

use glam::{DMat3, DVec3};
use luxproof_photometry::{Photometry, TypeCLimits};
use luxproof_scene::{Luminaire, LuminaireModel, Meter, Transport};

use super::EngineRoot;
use super::contract::{Absent, Answer, Engine, Entry, Job, Measurement, Setting, Support, Version, left_to_inner};
use super::job_dir::{EngineError, JobDir, SceneFile};
use super::openings::places_m;
use luxproof_model::{EngineName, Role};

/// Largest number of cached tables.
const MAX_CACHED_TABLES: usize = 64;

impl Entry {
    /// Returns the engine, wrapped so that it gets tables of type C.
    pub(super) fn engine(&self) -> Box<dyn Engine> {
        InTypeC::renderer((self.make)())
    }
}

/// An engine that gets only tables of type C.
pub(super) struct InTypeC {
    inner: Box<dyn Engine>,
    limits: TypeCLimits,
    keeps_attitude: bool,
    known: Mutex<Vec<Arc<StandIn>>>,
}

/// A table of type C that replaces one of type A or B, and its error.
struct StandIn {
    original: Arc<Photometry>,
    /// Whether the point luminaire is turned, so that the new table has the original's axis.
    is_turned: bool,
    photometry: Arc<Photometry>,
    /// Rotation from the new table's frame to that of the luminaire.
    turn: DMat3,
    /// Number of planes over the full circle.
    planes: usize,
    /// Flux in lumens that the new table sends elsewhere, adds or loses, at a flux scale of 1.
    misled_lm: f64,
    /// Whether the new table is exact, except where rounding decides at the original's ends.
    is_exact: bool,
}

/// A job with tables of type C, and the stand-in of each luminaire that needs one.
struct ConvertedJob {
    job: Job,
    stand_ins: Vec<Option<Arc<StandIn>>>,
}

impl InTypeC {
    /// Wraps a renderer that gets scenes written by luxproof. A witness stays as it is.
    pub(super) fn renderer(inner: Box<dyn Engine>) -> Box<dyn Engine> {
        Self::boxed(inner, false)
    }

    /// Wraps a program that gets the user's files in addition to the tables.
    pub(super) fn program(inner: Box<dyn Engine>) -> Box<dyn Engine> {
        Self::boxed(inner, true)
    }

    fn boxed(inner: Box<dyn Engine>, keeps_attitude: bool) -> Box<dyn Engine> {
        if inner.is_reference_engine() {
            return inner;
        }
        let defaults = TypeCLimits::default();
        let limits = TypeCLimits { most_planes: inner.most_planes().unwrap_or(defaults.most_planes), ..defaults };
        Box::new(Self { inner, limits, keeps_attitude, known: Mutex::new(vec![]) })
    }

    /// Converts a job to tables of type C. Returns `None` if it has no others, or if the engine's own reader gets the user's files.
    fn convert(&self, job: &Job) -> Option<ConvertedJob> {
        if !job.scene.luminaires.iter().any(needs_conversion) || self.inner.reads_files(job) && !self.keeps_attitude {
            return None;
        }
        let stand_ins = job.scene.luminaires.iter().map(|l| needs_conversion(l).then(|| self.stand_in(l)));
        let stand_ins: Vec<Option<Arc<StandIn>>> = stand_ins.collect();
        let mut job = job.clone();
        for (luminaire, stand_in) in job.scene.luminaires.iter_mut().zip(&stand_ins) {
            if let Some(stand_in) = stand_in {
                *luminaire = stand_in.in_place_of(luminaire);
            }
        }
        Some(ConvertedJob { job, stand_ins })
    }

    /// Returns the stand-in of a luminaire's table, from the cache if possible.
    fn stand_in(&self, luminaire: &Luminaire) -> Arc<StandIn> {
        let is_turned = luminaire.model == LuminaireModel::Point && !self.keeps_attitude;
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        let mut cached = known.iter();
        if let Some(stand_in) =
            cached.find(|s| Arc::ptr_eq(&s.original, &luminaire.photometry) && s.is_turned == is_turned)
        {
            return Arc::clone(stand_in);
        }
        let made = Arc::new(StandIn::new(luminaire, is_turned, self.limits, self.keeps_attitude));
        if known.len() == MAX_CACHED_TABLES {
            known.remove(0);
        }
        known.push(Arc::clone(&made));
        made
    }
}

/// Returns whether a luminaire's table is of type A or B.
fn needs_conversion(luminaire: &Luminaire) -> bool {
    luminaire.photometry.distribution.is_native()
}

impl StandIn {
    fn new(luminaire: &Luminaire, is_turned: bool, limits: TypeCLimits, keeps_files: bool) -> Self {
        let original = &luminaire.photometry;
        let model = if is_turned { LuminaireModel::Point } else { LuminaireModel::Area };
        let upright = Luminaire { model, orientation: DMat3::IDENTITY, ..luminaire.clone() };
        let Luminaire { photometry, orientation: turn, .. } = upright.in_type_c(limits);
        let photometry = if keeps_files {
            let distribution = photometry.distribution.clone();
            Arc::new(Photometry { distribution, ..Photometry::clone(original) })
        } else {
            photometry
        };
        let (table, stand_in, back) = (&original.distribution, &photometry.distribution, turn.transpose());
        let negligible_cd = 1e-9 * table.max_intensity().value();
        // At a jump, rounding decides which side a direction belongs to, so such directions show no error.
        let mut without_jump = table.node_directions().filter(|own| table.jump_towards(*own).value() == 0.0);
        let is_exact = without_jump.all(|own| {
            let error = table.intensity_towards(own) - stand_in.intensity_towards(back * own);
            error.value().abs() <= negligible_cd
        });
        let misled_lm = table.misled_by(stand_in, back);
        let planes = stand_in.full_circle().c_deg().len();
        Self { original: Arc::clone(original), is_turned, photometry, turn, planes, misled_lm, is_exact }
    }

    /// Returns the luminaire with the stand-in instead of its table.
    fn in_place_of(&self, luminaire: &Luminaire) -> Luminaire {
        let (photometry, orientation) = (Arc::clone(&self.photometry), luminaire.orientation * self.turn);
        Luminaire { photometry, orientation, ..luminaire.clone() }
    }

    /// Returns the report's note about a table that is not the file's own.
    fn note(&self, id: &str) -> String {
        let (table, stand_in) = (&self.original.distribution, &self.photometry.distribution);
        let (kind, planes, gammas) = (table.goniometer(), self.planes, stand_in.gamma_deg().len());
        let begins =
            format!("{id}: its table of type {kind:?} was given as one of type C, {planes} planes of {gammas} angles");
        if self.is_exact {
            return begins + " about its own axis: nothing is lost but beside ends in light";
        }
        let share = self.misled_lm / table.flux().value().max(f64::MIN_POSITIVE);
        format!("{begins}, which mislead {share:.1e} of its flux: that is in the bound")
    }
}

impl ConvertedJob {
    /// Widens the readings of the converted job by the error of its tables, and adds notes about them.
    fn widen(&self, asked: &Job, measurement: Measurement) -> Measurement {
        let pairs = asked.scene.luminaires.iter().zip(&self.job.scene.luminaires).zip(&self.stand_ins);
        let replaced: Vec<Replaced<'_>> = pairs
            .filter_map(|((asked, converted), stand_in)| {
                Some(Replaced { asked, converted, stand_in: stand_in.as_ref()? })
            })
            .collect();
        let misled_share = misled_share(asked, &replaced);
        let mut estimates = measurement.estimates;
        for (estimate, sensor) in estimates.iter_mut().zip(&asked.sensors) {
            let direct_lx = match asked.transport {
                Transport::Indirect(_) => 0.0,
                Transport::Direct | Transport::Total(_) => {
                    replaced.iter().map(|r| off_lx(r.asked, r.converted, &sensor.meter)).sum()
                }
            };
            let bound_lx = direct_lx + misled_share * estimate.value.abs();
            estimate.uncertainty = estimate.uncertainty.within(bound_lx);
        }
        let mut notes = measurement.notes;
        notes.extend(replaced.iter().map(|r| r.stand_in.note(&r.asked.id)));
        notes.dedup();
        Measurement { estimates, notes, ..measurement }
    }
}

/// A luminaire with a replaced table, before and after.
struct Replaced<'a> {
    asked: &'a Luminaire,
    converted: &'a Luminaire,
    stand_in: &'a StandIn,
}

/// Returns the part of all flux that replaced tables mislead, for reflected light; 0 if the job reads only direct light.
fn misled_share(asked: &Job, replaced: &[Replaced<'_>]) -> f64 {
    let misled: f64 = replaced.iter().map(|r| r.asked.flux_scale * r.stand_in.misled_lm).sum();
    let luminaires = asked.scene.luminaires.iter();
    let all: f64 = luminaires.map(|l| l.photometry.distribution.flux().value() * l.flux_scale).sum();
    if all > 0.0 && asked.transport != Transport::Direct { misled / all } else { 0.0 }
}

/// Returns the job that the inner engine gets.
fn passed_on<'a>(asked: &'a Job, converted: Option<&'a ConvertedJob>) -> &'a Job {
    converted.map_or(asked, |converted| &converted.job)
}

/// Returns the error in lux that a stand-in makes of a meter's direct illuminance. It is exact for a point; for a body it is the mean
/// over the places of its light.
fn off_lx(asked: &Luminaire, made: &Luminaire, meter: &Meter) -> f64 {
    let places = places_m(asked);
    let rays_m = places.iter().map(|place_m| meter.position_m - *place_m);
    rays_m.map(|ray_m| off_along_lx(asked, made, ray_m, meter.normal)).sum::<f64>() / places.len() as f64
}

/// Returns the same for all light along a ray to the meter.
fn off_along_lx(asked: &Luminaire, made: &Luminaire, ray_m: DVec3, normal: DVec3) -> f64 {
    let cosine = -ray_m.normalize_or_zero().dot(normal);
    let off = asked.intensity_towards(ray_m).value() - made.intensity_towards(ray_m).value();
    // A smaller difference is only rounding from turning there and back.
    let rounding = 1e-12 * asked.photometry.distribution.max_intensity().value() * asked.flux_scale;
    let off = if off.abs() > rounding { off.abs() } else { 0.0 };
    if ray_m.length_squared() > 0.0 { off * cosine.max(0.0) / ray_m.length_squared() } else { 0.0 }
}

impl Engine for InTypeC {
    left_to_inner!();

    fn name(&self) -> EngineName {
        self.inner.name()
    }

    fn probe(&self, site: &EngineRoot) -> Result<Version, Absent> {
        self.inner.probe(site)
    }

    fn supports(&self, job: &Job) -> Support {
        self.inner.supports(passed_on(job, self.convert(job).as_ref()))
    }

    fn components(&self, job: &Job) -> Vec<String> {
        self.inner.components(job)
    }

    fn export(&self, job: &Job) -> Result<Vec<SceneFile>, EngineError> {
        self.inner.export(passed_on(job, self.convert(job).as_ref()))
    }

    fn command_by_hand(&self, job: &Job, site: &EngineRoot) -> Option<String> {
        self.inner.command_by_hand(passed_on(job, self.convert(job).as_ref()), site)
    }

    fn check_settings(&self, job: &Job) -> Result<(), EngineError> {
        self.inner.check_settings(job)
    }

    fn expected_s(&self, job: &Job) -> Option<f64> {
        self.inner.expected_s(passed_on(job, self.convert(job).as_ref()))
    }

    fn memory_mib(&self, job: &Job, threads: usize) -> u64 {
        self.inner.memory_mib(passed_on(job, self.convert(job).as_ref()), threads)
    }

    fn read(&self, job: &Job, workbench: &JobDir) -> Result<Measurement, EngineError> {
        match self.convert(job) {
            Some(converted) => self.inner.read(&converted.job, workbench).map(|read| converted.widen(job, read)),
            None => self.inner.read(job, workbench),
        }
    }

    fn read_all(&self, jobs: &[(&Job, &JobDir)], together: &JobDir) -> Result<Vec<Answer>, EngineError> {
        let converted: Vec<Option<ConvertedJob>> = jobs.iter().map(|(job, _)| self.convert(job)).collect();
        let passed_on: Vec<(&Job, &JobDir)> = jobs
            .iter()
            .zip(&converted)
            .map(|((job, workbench), converted)| (passed_on(job, converted.as_ref()), *workbench))
            .collect();
        let mut answers = self.inner.read_all(&passed_on, together)?;
        for ((answer, (job, _)), converted) in answers.iter_mut().zip(jobs).zip(&converted) {
            if let (Ok(read), Some(converted)) = (answer, converted) {
                *read = converted.widen(job, std::mem::take(read));
            }
        }
        Ok(answers)
    }
}

#[cfg(test)]
mod tests {
    use luxproof_photometry::{Goniometer, LuminousIntensityDistribution, LuminousOpening, lm63};
    use luxproof_scene::orientation;

    use super::*;
    use crate::fixtures::{exact_direct_lx, goniometer, job_dir, luminaire};
    use crate::{ALL, entry};
    use luxproof_model::{Estimate, Uncertainty};

    /// Reads direct light of points exactly, with the tables that it gets.
    struct ExactEngine(Option<usize>);

    impl Engine for ExactEngine {
        fn name(&self) -> EngineName {
            EngineName::new("exact")
        }

        fn probe(&self, _site: &EngineRoot) -> Result<Version, Absent> {
            Ok(Version { text: "1".into(), fingerprint: String::new() })
        }

        fn supports(&self, _job: &Job) -> Support {
            Support::Yes
        }

        fn most_planes(&self) -> Option<usize> {
            self.0
        }

        fn read(&self, job: &Job, _workbench: &JobDir) -> Result<Measurement, EngineError> {
            assert!(job.scene.luminaires.iter().all(|l| !l.photometry.distribution.is_native()));
            Ok(Measurement {
                estimates: exact_direct_lx(job)
                    .into_iter()
                    .map(|value| Estimate { value, uncertainty: Uncertainty::Bound(0.0) })
                    .collect(),
                ..Measurement::default()
            })
        }
    }

    /// Returns a floodlight of type B, without symmetry, with this many vertical angles. Its table ends in the dark.
    fn flood(verticals: u32) -> LuminousIntensityDistribution {
        let rows: Vec<String> = angles(20).iter().map(|h| words(&flood_row(*h, verticals))).collect();
        let text = format!(
            "IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 {} 21 2 2 0 0 0\n1 1 0\n{}\n{}\n{}\n",
            verticals + 1,
            words(&angles(verticals)),
            words(&angles(20)),
            rows.join("\n")
        );
        lm63::parse(text.as_bytes()).unwrap().distribution
    }

    /// Returns the floodlight's intensities at one horizontal angle.
    fn flood_row(h: f64, verticals: u32) -> Vec<f64> {
        let falls = |x: f64, power| 1.0 - (x / 60.0).powi(power);
        angles(verticals).iter().map(|v| (900.0 + 4.0 * h - 3.0 * v) * (falls(h, 2) * falls(*v, 4))).collect()
    }

    /// Returns equally spaced angles from -60 to 60 degrees.
    fn angles(intervals: u32) -> Vec<f64> {
        (0..=intervals).map(|k| -60.0 + 120.0 * f64::from(k) / f64::from(intervals)).collect()
    }

    fn words(values: &[f64]) -> String {
        values.iter().map(f64::to_string).collect::<Vec<_>>().join(" ")
    }

    fn job(verticals: u32, model: LuminaireModel) -> Job {
        let mut lamp = luminaire("lamp", DVec3::new(0.3, 0.1, 2.0), flood(verticals));
        lamp.orientation = orientation(25.0, 40.0, 10.0);
        lamp.model = model;
        let gamma: Vec<f64> = (0..30).map(|k| 3.1 * f64::from(k)).collect();
        goniometer(&lamp, 2.0, &[0.0, 40.0, 123.0, 301.0], &gamma)
    }

    #[test]
    fn the_error_of_a_table_of_type_c_is_in_the_bound_and_in_a_note() {
        for (verticals, model, most_planes, is_exact) in [
            (40, LuminaireModel::Point, None, true),
            (300, LuminaireModel::Point, Some(256), false),
            (40, LuminaireModel::Area, None, false),
        ] {
            let asked = job(verticals, model);
            let engine = InTypeC::renderer(Box::new(ExactEngine(most_planes)));
            let bench = job_dir(EngineRoot::at("/nowhere"), std::path::Path::new("/nowhere"));
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
            let has_note = read.notes.iter().any(|n| n.contains("about its own axis: nothing is lost"));
            assert!(read.notes.len() == 1 && has_note == is_exact, "{:?}", read.notes);
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
                assert_eq!(files.is_empty(), engine.is_reference_engine(), "{}", engine.name());
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
            vec![luxproof_photometry::SourceFile { name: "l.ies".into(), bytes: b"text".as_slice().into() }];
        asked.scene.luminaires[0].photometry = Arc::new(photometry);
        let program = InTypeC {
            inner: Box::new(ExactEngine(None)),
            limits: TypeCLimits::default(),
            keeps_attitude: true,
            known: Mutex::default(),
        };
        let made = program.convert(&asked).unwrap().job;
        let (before, after) = (&asked.scene.luminaires[0], &made.scene.luminaires[0]);
        assert!((before.orientation.z_axis - after.orientation.z_axis).length() < 1e-12);
        assert_eq!(before.photometry.source, after.photometry.source);
        assert_eq!(after.photometry.distribution.goniometer(), Goniometer::C);
        assert!(Arc::ptr_eq(&program.convert(&asked).unwrap().job.scene.luminaires[0].photometry, &after.photometry));
    }
}
