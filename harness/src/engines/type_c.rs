//! Tables of types A and B for renderers, which read type C: made for each job, as fine as the renderer may hold, and what that leaves off
//! is in the bound of its readings.
//!
//! A point is turned so that its table keeps its own axis, and but for the ends of the table nothing is lost. What has a body, and
//! what is handed over together with the user's file, keeps its attitude and gets a stand-in.

use std::sync::{Arc, Mutex, PoisonError};

use glam::{DMat3, DVec3};
use luminaire::photometry::{Photometry, TypeCLimits};
use luminaire::scene::{Luminaire, LuminaireModel, Meter, Transport};

use super::Site;
use super::contract::{Absent, Answer, Engine, Entry, Job, Knob, Measurement, Support, Version, left_to_inner};
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
    known: Mutex<Vec<Arc<StandIn>>>,
}

/// What stands for a table of type A or B, and how far it is off.
struct StandIn {
    of: Arc<Photometry>,
    /// Whether its axis is the table's own, where a point is turned for it.
    is_turned: bool,
    photometry: Arc<Photometry>,
    /// From its frame to that of the luminaire.
    turn: DMat3,
    /// Over the full circle.
    planes: usize,
    /// Flux in lumens that it sends elsewhere, adds or loses, at a flux scale of 1.
    misled_lm: f64,
    /// Whether nothing is lost, but where rounding decides at the table's ends.
    is_kept: bool,
}

/// A job with tables of type C, and of each luminaire what stands for its table, if anything does.
struct Made {
    job: Job,
    stand_ins: Vec<Option<Arc<StandIn>>>,
}

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
    fn made(&self, job: &Job) -> Option<Made> {
        let is_native = |l: &Luminaire| l.photometry.distribution.is_native();
        if !job.scene.luminaires.iter().any(is_native) || self.inner.reads_files(job) && !self.keeps_attitude {
            return None;
        }
        let stand_ins = job.scene.luminaires.iter().map(|l| is_native(l).then(|| self.stand_in(l)));
        let stand_ins: Vec<Option<Arc<StandIn>>> = stand_ins.collect();
        let mut job = job.clone();
        for (luminaire, stand_in) in job.scene.luminaires.iter_mut().zip(&stand_ins) {
            if let Some(stand_in) = stand_in {
                *luminaire = stand_in.in_place_of(luminaire);
            }
        }
        Some(Made { job, stand_ins })
    }

    fn stand_in(&self, luminaire: &Luminaire) -> Arc<StandIn> {
        let is_turned = luminaire.model == LuminaireModel::Point && !self.keeps_attitude;
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        let is_it = |s: &&Arc<StandIn>| Arc::ptr_eq(&s.of, &luminaire.photometry) && s.is_turned == is_turned;
        if let Some(known) = known.iter().find(is_it) {
            return Arc::clone(known);
        }
        let made = Arc::new(StandIn::new(luminaire, is_turned, self.limits, self.keeps_attitude));
        if known.len() == MOST {
            known.remove(0);
        }
        known.push(Arc::clone(&made));
        made
    }
}

impl StandIn {
    fn new(luminaire: &Luminaire, is_turned: bool, limits: TypeCLimits, keeps_files: bool) -> Self {
        let of = &luminaire.photometry;
        let model = if is_turned { LuminaireModel::Point } else { LuminaireModel::Area };
        let upright = Luminaire { model, orientation: DMat3::IDENTITY, ..luminaire.clone() };
        let Luminaire { photometry, orientation: turn, .. } = upright.in_type_c(limits);
        let photometry = if keeps_files {
            let distribution = photometry.distribution.clone();
            Arc::new(Photometry { distribution, ..Photometry::clone(of) })
        } else {
            photometry
        };
        let (table, stand_in, back) = (&of.distribution, &photometry.distribution, turn.transpose());
        let nothing = 1e-9 * table.max_intensity().value();
        let off = |own: &DVec3| (table.intensity_towards(*own) - stand_in.intensity_towards(back * *own)).value();
        let mut sure = table.node_directions().filter(|own| table.jump_towards(*own).value() == 0.0);
        let is_kept = sure.all(|own| off(&own).abs() <= nothing);
        let misled_lm = table.misled_by(stand_in, back);
        let planes = stand_in.full_circle().c_deg().len();
        Self { of: Arc::clone(of), is_turned, photometry, turn, planes, misled_lm, is_kept }
    }

    fn in_place_of(&self, luminaire: &Luminaire) -> Luminaire {
        let (photometry, orientation) = (Arc::clone(&self.photometry), luminaire.orientation * self.turn);
        Luminaire { photometry, orientation, ..luminaire.clone() }
    }

    /// What a reader of the report is told of a table that is not the file's own.
    fn note(&self, id: &str) -> String {
        let (table, stand_in) = (&self.of.distribution, &self.photometry.distribution);
        let (kind, planes, gammas) = (table.goniometer(), self.planes, stand_in.gamma_deg().len());
        let begins =
            format!("{id}: its table of type {kind:?} was given as one of type C, {planes} planes of {gammas} angles");
        if self.is_kept {
            return begins + " about its own axis: nothing is lost but beside ends in light";
        }
        let share = self.misled_lm / table.flux().value().max(f64::MIN_POSITIVE);
        format!("{begins}, which mislead {share:.1e} of its flux: that is in the bound")
    }
}

impl Made {
    /// What was read of it, with what the tables may have put it off, and with words on them.
    fn judged(&self, asked: &Job, measurement: Measurement) -> Measurement {
        let luminaires = || asked.scene.luminaires.iter().zip(&self.job.scene.luminaires).zip(&self.stand_ins);
        let others = luminaires().filter_map(|((asked, made), stand_in)| Some((asked, made, stand_in.as_ref()?)));
        let others: Vec<(&Luminaire, &Luminaire, &Arc<StandIn>)> = others.collect();
        let misled: f64 = others.iter().map(|(asked, _, stand_in)| asked.flux_scale * stand_in.misled_lm).sum();
        let flux = |l: &Luminaire| l.photometry.distribution.flux().value() * l.flux_scale;
        let all: f64 = asked.scene.luminaires.iter().map(flux).sum();
        let share = if all > 0.0 && asked.transport != Transport::Direct { misled / all } else { 0.0 };
        let bound = |meter: &Meter, value: f64| {
            let direct = match asked.transport {
                Transport::Indirect(_) => 0.0,
                Transport::Direct | Transport::Total(_) => others.iter().map(|(a, b, _)| off_lx(a, b, meter)).sum(),
            };
            direct + share * value.abs()
        };
        let widened = |(estimate, station): (&Estimate, &super::Station)| Estimate {
            uncertainty: estimate.uncertainty.within(bound(&station.meter, estimate.value)),
            ..*estimate
        };
        let estimates = measurement.estimates.iter().zip(&asked.stations).map(widened).collect();
        let mut notes = measurement.notes;
        notes.extend(others.iter().map(|(asked, _, stand_in)| stand_in.note(&asked.id)));
        notes.dedup();
        Measurement { estimates, notes, ..measurement }
    }
}

/// The job as it is handed on.
fn given<'a>(asked: &'a Job, made: Option<&'a Made>) -> &'a Job {
    made.map_or(asked, |made| &made.job)
}

/// How far a stand-in leaves the direct illuminance of a meter off, in lux: exactly for a point, of a body by the places that its light comes from.
fn off_lx(asked: &Luminaire, made: &Luminaire, meter: &Meter) -> f64 {
    let places = places_m(asked);
    let of_place = |place_m: &DVec3| {
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

impl Engine for InTypeC {
    left_to_inner!();

    fn name(&self) -> EngineName {
        self.inner.name()
    }

    fn probe(&self, site: &Site) -> Result<Version, Absent> {
        self.inner.probe(site)
    }

    fn supports(&self, job: &Job) -> Support {
        self.inner.supports(given(job, self.made(job).as_ref()))
    }

    fn components(&self, job: &Job) -> Vec<String> {
        self.inner.components(job)
    }

    fn export(&self, job: &Job) -> Result<Vec<SceneFile>, EngineError> {
        self.inner.export(given(job, self.made(job).as_ref()))
    }

    fn command_by_hand(&self, job: &Job, site: &Site) -> Option<String> {
        self.inner.command_by_hand(given(job, self.made(job).as_ref()), site)
    }

    fn check_settings(&self, job: &Job) -> Result<(), EngineError> {
        self.inner.check_settings(job)
    }

    fn expected_s(&self, job: &Job) -> Option<f64> {
        self.inner.expected_s(given(job, self.made(job).as_ref()))
    }

    fn memory_mib(&self, job: &Job, threads: usize) -> u64 {
        self.inner.memory_mib(given(job, self.made(job).as_ref()), threads)
    }

    fn read(&self, job: &Job, workbench: &Workbench) -> Result<Measurement, EngineError> {
        match self.made(job) {
            Some(made) => self.inner.read(&made.job, workbench).map(|read| made.judged(job, read)),
            None => self.inner.read(job, workbench),
        }
    }

    fn read_all(&self, jobs: &[(&Job, &Workbench)], together: &Workbench) -> Result<Vec<Answer>, EngineError> {
        let made: Vec<Option<Made>> = jobs.iter().map(|(job, _)| self.made(job)).collect();
        let handed_on = jobs.iter().zip(&made).map(|((job, bench), made)| (given(job, made.as_ref()), *bench));
        let handed_on: Vec<(&Job, &Workbench)> = handed_on.collect();
        let answers = self.inner.read_all(&handed_on, together)?;
        let judged = |((answer, (job, _)), made): ((Answer, &(&Job, &Workbench)), &Option<Made>)| match made {
            Some(made) => answer.map(|read| made.judged(job, read)),
            None => answer,
        };
        Ok(answers.into_iter().zip(jobs).zip(&made).map(judged).collect())
    }
}

#[cfg(test)]
mod tests {
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
        let made = program.made(&asked).unwrap().job;
        let (before, after) = (&asked.scene.luminaires[0], &made.scene.luminaires[0]);
        assert!((before.orientation.z_axis - after.orientation.z_axis).length() < 1e-12);
        assert_eq!(before.photometry.source, after.photometry.source);
        assert_eq!(after.photometry.distribution.goniometer(), Goniometer::C);
        assert!(Arc::ptr_eq(&program.made(&asked).unwrap().job.scene.luminaires[0].photometry, &after.photometry));
    }
}
