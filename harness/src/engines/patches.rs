//! Renderers whose meters are small white patches, read by a driver in an environment of Python packages of their own: Cycles and
//! LuxCore.

pub(super) mod ies_file;
pub(super) mod opening;
pub(super) mod resampled;
pub(super) mod seats;
pub(super) mod settings;
#[cfg(test)]
pub(super) mod tests;

use std::time::Duration;

use glam::DVec3;
use itertools::{Itertools, izip};
use luminaire::scene::{Bounces, Luminaire, Meter, Transport};
use serde::{Deserialize, Serialize};

use self::opening::Opening;
use self::resampled::{Resampled, Spread};
use self::seats::{Space, patch, sides};
use self::settings::Settings;
use super::dialogue::{self, Cost, Dialogue, JOB_FILE, Seat};
use super::float_error::{FloatError, Instrument};
use super::frame::Frame;
use super::libraries::Libraries;
use super::openings::places_m;
use super::settings::Preset;
use super::tables::Tables;
use super::workbench::by_hand;
use super::{
    Absent, EngineError, Entry, Job, Measurement, SceneFile, Site, Support, Version, Workbench, effort, recess,
};
use crate::record::EngineName;
use crate::system::process::Invocation;

/// More reflections Blender does not let anyone ask for; LuxCore's random numbers would do for twice as many.
const MOST_REFLECTIONS: i64 = 1024;
/// What sums of 32-bit floats may be off, in parts of a reading: a film adds up to 65,536 samples, each sum rounded.
const FILM: f64 = 1e-4;
/// Importing a renderer takes two seconds; a machine under load may need many.
const PROBE_LIMIT: Duration = Duration::from_secs(120);

/// A renderer as such a package.
pub(super) struct Package {
    pub(super) engine: EngineName,
    /// As its makers write it.
    pub(super) name: &'static str,
    /// What Python imports.
    pub(super) module: &'static str,
    pub(super) site: fn(&Site) -> Site,
    /// Of the system, that it is linked with.
    pub(super) libraries: &'static Libraries,
    pub(super) probe: &'static str,
    pub(super) driver: &'static str,
    /// What has it installed.
    pub(super) remedy: &'static str,
    /// A Python of a version that it is made for, to be named where none is installed.
    pub(super) python: &'static str,
    /// Seconds that are counted for a ray.
    pub(super) ray_s: f64,
    /// How far off a meter's point it reads where no surface is beside it, in parts of a patch's side.
    pub(super) seat: f64,
    /// Whether light below a patch's own plane is lost, which its rounded corners tilt.
    pub(super) is_cut_by_its_plane: bool,
    /// How far surfaces step back from points on them, in parts of what plates come forward.
    pub(super) apart: f64,
}

#[derive(Deserialize)]
struct Told {
    version: String,
}

impl Package {
    pub(super) fn probe(&self, site: &Site) -> Result<Version, Absent> {
        let absent = |reason: String| Absent { reason, remedy: self.remedy.into() };
        let own = (self.site)(site);
        let python = own.python().ok_or_else(|| absent(format!("there is no Python environment for {}", self.name)))?;
        let package = own
            .python_package(self.module)
            .ok_or_else(|| absent(format!("the Python package `{}` is missing", self.module)))?;
        let folder = tempfile::tempdir().map_err(|e| absent(format!("no temporary folder: {e}")))?;
        let run = Invocation::new(&python, folder.path(), PROBE_LIMIT, folder.path().join("log"));
        let run = self.libraries.beside(run, site);
        let probe = self.probe.as_bytes().to_vec();
        let finished = run.args(["-I", "-B", "-"]).stdin(probe).run().map_err(|e| absent(e.to_string()))?;
        // It may greet first: the answer is the last line.
        let text = String::from_utf8_lossy(&finished.stdout);
        let answer = text.lines().last().unwrap_or_default();
        let told: Told = serde_json::from_str(answer)
            .map_err(|e| absent(format!("the probe of {} answered `{answer}`: {e}", self.name)))?;
        // Wheels keep the libraries of a package beside it.
        let beside = [format!("{}.libs", self.module), "numpy".into()];
        let files = [package].into_iter().chain(beside.iter().filter_map(|name| own.python_package(name)));
        Ok(Version::of(&self.engine, told.version, site, files.chain(python.canonicalize())))
    }

    pub(super) fn command_by_hand(&self, site: &Site) -> String {
        let python = (self.site)(site).python().unwrap_or_else(|| self.python.into());
        self.libraries.beside(by_hand(python), site).args([self.driver, JOB_FILE]).command_line_with_env()
    }

    /// What it reads of a job's files; `tables` are those that it looks up in a way of its own, none where that is what one wants to know.
    pub(super) fn read<R: Resampled>(
        &self,
        files: &[SceneFile],
        job: &Job,
        settings: Settings,
        workbench: &Workbench,
        look_up: fn(&luminaire::photometry::LuminousIntensityDistribution) -> R,
        edge_deg: f64,
    ) -> Result<Measurement, EngineError> {
        workbench.write(files)?;
        let python = (self.site)(&workbench.site).python();
        let python = python
            .ok_or_else(|| EngineError::output(self.engine.clone(), format!("has no Python; {}", self.remedy)))?;
        // Neither the user's Python nor its packages; scene folders stay as exported.
        let run = self.libraries.beside(workbench.invoke(python), &workbench.site);
        let run = run.args(["-I", "-B", self.driver, "--serve"]);
        let frame = Frame::of(job, settings.coordinates);
        let side = patch(job, &frame, settings.preset);
        let side_m = side / frame.scale;
        let spaces = Space::of(&recess::behind_luminaires(job, self.apart), side_m);
        let seat = |space: &Space| if *space == Space::Tight { side } else { self.seat * side };
        let seats = spaces.iter().map(seat).collect();
        let instrument = Instrument { edge_deg, seats, by_arc_cosine: true };
        let rounding = FloatError::of(job, frame, instrument);
        let tables = Tables::of(job);
        let resampled = tables.distinct.iter().filter(|_| !settings.has_plain_tables());
        let looked_up: Vec<R> = resampled.map(|d| look_up(d)).collect();
        let places: Vec<_> = job.scene.luminaires.iter().map(places_m).collect();
        let of_tables_lx = |k: usize| -> f64 {
            izip!(&job.scene.luminaires, &places, &tables.of_luminaire)
                .filter_map(|(luminaire, places, k_th)| Some((luminaire, places, looked_up.get(*k_th)?)))
                .map(|(luminaire, places, table)| {
                    let meter = &job.stations[k].meter;
                    let own = |world: DVec3| luminaire.orientation.transpose() * world;
                    let spread = |place_m| {
                        let reach_deg = rounding.spread_deg(luminaire, place_m, k);
                        Spread::of(reach_deg, own(meter.position_m - place_m), side_m, sides(meter.normal).map(own))
                    };
                    table.off_lx(luminaire, places, meter, spread)
                })
                .sum()
        };
        let misled = looked_up.iter().map(Resampled::misled_share).fold(0.0, f64::max);
        let of_plane_lx = |k: usize| {
            let is_lost = |cosine: f64| self.is_cut_by_its_plane && cosine > 0.0 && cosine < spaces[k].tilt();
            facing_lx(job, &places, &job.stations[k].meter, |cosine| if is_lost(cosine) { cosine } else { 0.0 })
        };
        let bound_lx = |k: usize, normal_off: f64| {
            let of_normals = normal_off * facing_lx(job, &places, &job.stations[k].meter, |_| 1.0);
            rounding.at_lx(k) + of_tables_lx(k) + of_plane_lx(k) + of_normals
        };
        let dialogue = Dialogue {
            engine: self.engine.clone(),
            job,
            workbench,
            conversation: run.converse(workbench.idle.as_ref())?,
            until: workbench.until(),
            fixed: settings.fixed(),
            cost: &|_| Cost { ray_s: self.ray_s, trial_side: None },
            bound_lx: &bound_lx,
            relative_bound: FILM,
            misled,
        };
        let mut measurement = dialogue.measurement()?;
        measurement.effort.insert("command".into(), run.command_line());
        measurement.notes.extend(job.written_for_its_reader().filter(|_| settings.is_native()));
        super::checked(&self.engine, job, measurement)
    }
}

/// Whether it can do a job, `stock` being what its scene without settings does to it, and by how much.
pub(super) fn supports(entry: &Entry, job: &Job, stock: (&str, Option<f64>)) -> Support {
    // What is wrong with settings is told by who reads them for good.
    let settings = Settings::of(job, &entry.name).ok();
    let has_plain_tables = settings.is_some_and(Settings::has_plain_tables);
    let obstacle = || opening::obstacle(entry.display_name, job, has_plain_tables);
    if let Some(why) = entry.objection(job).or_else(obstacle) {
        return Support::No(why);
    }
    if let Some((one, other)) = settings.filter(|s| s.is_native()).and_then(|_| two_files_of_a_table(job)) {
        return Support::No(format!(
            "`{one}` and `{other}` have files that differ and say the same table: an exported scene has a file a table"
        ));
    }
    if settings.is_some_and(|s| s.preset == Preset::Default) {
        let (why, size) = stock;
        return Support::Approximate { why: why.into(), size };
    }
    let close = super::mitsuba::luminaire_close_to_a_surface(job);
    if let (Some(id), Transport::Indirect(_) | Transport::Total(_)) = (close, job.transport) {
        let why = format!("paths seldom find the bright spot that `{id}` throws on a surface close by");
        return Support::Approximate { why, size: None };
    }
    let behind = job.scene.luminaires.iter().find(|l| recess::shines_behind(job, l));
    if let (Some(Luminaire { id, .. }), Transport::Indirect(_) | Transport::Total(_)) = (behind, job.transport) {
        let why = format!("what `{id}` sends into the surface that it is on is lost, and here reflected");
        return Support::Approximate { why, size: None };
    }
    if reflections(job) == MOST_REFLECTIONS && job.reflections() != Some(Bounces::AtMost(0)) {
        let why = format!("{} follows {MOST_REFLECTIONS} reflections at most", entry.display_name);
        return Support::Approximate { why, size: None };
    }
    Support::Yes
}

/// Luminaires whose own files differ, and say the same.
fn two_files_of_a_table(job: &Job) -> Option<(&str, &str)> {
    let differ = |[a, b]: &[&Luminaire; 2]| {
        a.photometry.distribution == b.photometry.distribution && a.photometry.source != b.photometry.source
    };
    let found = job.scene.luminaires.iter().array_combinations().find(differ);
    found.map(|[a, b]| (a.id.as_str(), b.id.as_str()))
}

/// The files of tables for a renderer's own reader: the user's own bytes where those are asked for and are LM-63, else what our writer
/// makes of the table as it is.
pub(super) fn plain_files<'a>(
    job: &'a Job,
    settings: Settings,
    tables: &'a Tables<'_>,
    name: fn(usize) -> String,
) -> impl Iterator<Item = SceneFile> + 'a {
    let own = move |k: usize| {
        let luminaire = tables.of_luminaire.iter().position(|t| *t == k).filter(|_| settings.is_native())?;
        Some(job.scene.luminaires[luminaire].photometry.lm63_file()?.bytes.to_vec())
    };
    tables.distinct.iter().enumerate().map(move |(k, table)| match own(k) {
        Some(bytes) => SceneFile { name: name(k), bytes },
        None => SceneFile::text(&name(k), ies_file::of_table(table, "[MORE] the table as it is")),
    })
}

/// Diffuse reflections that paths are followed for.
pub(super) fn reflections(job: &Job) -> i64 {
    match job.reflections() {
        None => 0,
        Some(Bounces::AtMost(n)) => i64::from(n).min(MOST_REFLECTIONS),
        Some(Bounces::Converged) => {
            let highest = job.scene.largest_reflectance();
            effort::reflections_until(highest, 0.1 * job.budget.relative_error).clamp(8, MOST_REFLECTIONS)
        }
    }
}

/// Illuminance of a meter by all parts of all luminaires, in lux, that each has by its cosine; 1 where the meter faced it.
fn facing_lx(job: &Job, places: &[Vec<DVec3>], meter: &Meter, by_cosine: impl Fn(f64) -> f64) -> f64 {
    let of_place = |luminaire: &Luminaire, place_m: &DVec3| {
        let ray_m = meter.position_m - *place_m;
        let cosine = -ray_m.normalize_or_zero().dot(meter.normal);
        by_cosine(cosine) * luminaire.intensity_towards(ray_m).value() / ray_m.length_squared()
    };
    let of = |(luminaire, places): (&Luminaire, &Vec<DVec3>)| {
        places.iter().map(|place_m| of_place(luminaire, place_m)).sum::<f64>() / places.len() as f64
    };
    job.scene.luminaires.iter().zip(places).map(of).sum()
}

#[derive(Serialize)]
struct DriverJob<'a> {
    case: &'a str,
    procedure: &'a str,
    transport: &'static str,
    reflections: i64,
    emitters: usize,
    extended: bool,
    /// Whether direct light is read one luminaire after the other.
    apart: bool,
    tables: Vec<String>,
    /// Side of a meter's patch.
    patch: f64,
    /// How many blocks it reads by itself, and how many samples along the side of each.
    blocks: usize,
    side: usize,
    seed: u64,
    stations: Vec<PatchSeat<'a>>,
}

#[derive(Serialize)]
struct PatchSeat<'a> {
    #[serde(flatten)]
    seat: Seat<'a>,
    /// Whether no surface is beside it, so that it may be read at its very point.
    free: bool,
    /// Whether there is space for a wide patch.
    wide: bool,
}

/// `job.json` of a scene with so many lights and these tables.
pub(super) fn job_json(
    engine: EngineName,
    job: &Job,
    settings: Settings,
    frame: &Frame,
    emitters: usize,
    tables: Vec<String>,
) -> Result<SceneFile, EngineError> {
    let (blocks, side) = settings.by_itself();
    let patch = patch(job, frame, settings.preset);
    let spaces = Space::of(job, patch / frame.scale);
    let driver_job = DriverJob {
        case: &job.case,
        procedure: job.procedure.name(),
        transport: dialogue::transport(job),
        reflections: reflections(job),
        emitters,
        extended: job.scene.luminaires.iter().any(|l| Opening::of(l) != Opening::None),
        apart: settings.preset != Preset::Default,
        tables,
        patch,
        blocks,
        side,
        seed: job.seed,
        stations: dialogue::seats(job, frame)
            .zip(spaces)
            .map(|(seat, space)| PatchSeat { seat, free: space != Space::Tight, wide: space == Space::Wide })
            .collect(),
    };
    let text = serde_json::to_string_pretty(&driver_job)
        .map_err(|e| EngineError::output(engine, format!("the job cannot be written: {e}")))?;
    Ok(SceneFile::text(JOB_FILE, text))
}
