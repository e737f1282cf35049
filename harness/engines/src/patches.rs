//! Renderers with small white patches as meters: Cycles and LuxCore. A driver reads them in a separate environment of Python packages.

pub(super) mod ies_file;
pub(super) mod opening;
pub(super) mod placement;
pub(super) mod resampled;
pub(super) mod settings;
#[cfg(test)]
pub(super) mod tests;

use std::time::Duration;

use glam::DVec3;
use itertools::{Itertools, izip};
use luxproof_scene::{Bounces, Luminaire, Transport};
use serde::{Deserialize, Serialize};

use self::opening::Opening;
use self::placement::{Space, patch, sides};
use self::resampled::{Resampled, Spread};
use self::settings::Settings;
use super::dialogue::{self, Cost, Dialogue, JOB_FILE, MeterPlacement};
use super::float_error::{FloatError, Instrument};
use super::frame::Frame;
use super::job_dir::by_hand;
use super::libraries::Libraries;
use super::openings::places_m;
use super::settings::Preset;
use super::tables::Tables;
use super::{
    Absent, EngineError, EngineRoot, Entry, Job, JobDir, Measurement, SceneFile, Support, Version, effort, recess,
};
use luxproof_model::EngineName;
use luxproof_process::process::Invocation;

/// The most reflections that Blender allows. LuxCore's random numbers suffice for twice as many.
const MOST_REFLECTIONS: i64 = 1024;
/// Relative error of a film's sum in 32-bit floats. It adds up to 65,536 samples and rounds each sum.
const FILM_RELATIVE_ERROR: f64 = 1e-4;
/// Importing a renderer takes two seconds, and a machine under load may need many times as long.
const PROBE_LIMIT: Duration = Duration::from_secs(120);

/// A renderer that is installed as a Python package.
pub(super) struct Package {
    pub(super) engine: EngineName,
    /// The name as its makers write it.
    pub(super) name: &'static str,
    /// The module that Python imports.
    pub(super) module: &'static str,
    pub(super) site: fn(&EngineRoot) -> EngineRoot,
    /// The system's libraries that the package is linked with.
    pub(super) libraries: &'static Libraries,
    pub(super) probe: &'static str,
    pub(super) driver: &'static str,
    /// What a user does to install it.
    pub(super) remedy: &'static str,
    /// The Python version that it is made for, which a command names if none is installed.
    pub(super) python: &'static str,
    /// Counted seconds of a ray.
    pub(super) ray_s: f64,
    /// Distance from a meter's point to its reading where no surface is near, in parts of a patch's side.
    pub(super) patch_offset: f64,
    /// Whether light from below a patch's plane is lost. The rounding of its corners tilts that plane.
    pub(super) is_cut_by_its_plane: bool,
    /// How far surfaces step back from points on them, in parts of the distance that plates come forward.
    pub(super) apart: f64,
}

/// What a probe prints as its last line.
#[derive(Deserialize)]
struct ProbeReply {
    version: String,
}

impl Package {
    pub(super) fn probe(&self, site: &EngineRoot) -> Result<Version, Absent> {
        let package_site = (self.site)(site);
        let python = package_site
            .python()
            .ok_or_else(|| self.absent(format!("there is no Python environment for {}", self.name)))?;
        let package = package_site
            .python_package(self.module)
            .ok_or_else(|| self.absent(format!("the Python package `{}` is missing", self.module)))?;
        let folder = tempfile::tempdir().map_err(|e| self.absent(format!("no temporary folder: {e}")))?;
        let run = Invocation::new(&python, folder.path(), PROBE_LIMIT, folder.path().join("log"));
        let run = self.libraries.add_to(run, site);
        let probe = self.probe.as_bytes().to_vec();
        let finished = run.args(["-I", "-B", "-"]).stdin(probe).run().map_err(|e| self.absent(e.to_string()))?;
        // The module may print a greeting first, so the answer is the last line.
        let text = String::from_utf8_lossy(&finished.stdout);
        let answer = text.lines().last().unwrap_or_default();
        let reply: ProbeReply = serde_json::from_str(answer)
            .map_err(|e| self.absent(format!("the probe of {} answered `{answer}`: {e}", self.name)))?;
        // A wheel installs its own libraries in a folder next to the package.
        let companions = [format!("{}.libs", self.module), "numpy".into()];
        let companions = companions.iter().filter_map(|name| package_site.python_package(name));
        let files = [package].into_iter().chain(companions);
        Ok(Version::of(&self.engine, reply.version, site, files.chain(python.canonicalize())))
    }

    /// Returns why the package cannot be used, with the remedy.
    fn absent(&self, reason: String) -> Absent {
        Absent { reason, remedy: self.remedy.into() }
    }

    pub(super) fn command_by_hand(&self, site: &EngineRoot) -> String {
        let python = (self.site)(site).python().unwrap_or_else(|| self.python.into());
        self.libraries.add_to(by_hand(python), site).args([self.driver, JOB_FILE]).command_line_with_env()
    }

    /// Reads a job from its exported files.
    ///
    /// `look_up` gives a table as the renderer looks it up. It does not apply to settings that ask for plain tables, because
    /// their error is then what the user wants to know.
    pub(super) fn read<R: Resampled>(
        &self,
        files: &[SceneFile],
        job: &Job,
        settings: Settings,
        workbench: &JobDir,
        look_up: fn(&luxproof_photometry::LuminousIntensityDistribution) -> R,
        edge_deg: f64,
    ) -> Result<Measurement, EngineError> {
        workbench.write(files)?;
        let python = (self.site)(&workbench.site).python();
        let python = python
            .ok_or_else(|| EngineError::output(self.engine.clone(), format!("has no Python; {}", self.remedy)))?;
        // The flags exclude the user's Python settings and packages, and keep the scene folder as exported.
        let run = self.libraries.add_to(workbench.invoke(python), &workbench.site);
        let run = run.args(["-I", "-B", self.driver, "--serve"]);
        let tables = Tables::of(job);
        let resampled = tables.distinct.iter().filter(|_| !settings.has_plain_tables());
        let looked_up: Vec<R> = resampled.map(|d| look_up(d)).collect();
        let misled = looked_up.iter().map(Resampled::misled_share).fold(0.0, f64::max);
        let bounds = self.error_bounds(job, settings, &tables, looked_up, edge_deg);
        let dialogue = Dialogue {
            engine: self.engine.clone(),
            job,
            workbench,
            conversation: run.converse(workbench.idle.as_ref())?,
            until: workbench.until(),
            fixed: settings.fixed(),
            cost: &|_| Cost { ray_s: self.ray_s, trial_side: None },
            bound_lx: &|k, normal_off| bounds.at_lx(k, normal_off),
            relative_bound: FILM_RELATIVE_ERROR,
            misled,
        };
        let mut measurement = dialogue.measurement()?;
        measurement.effort.insert("command".into(), run.command_line());
        measurement.notes.extend(job.written_for_its_reader().filter(|_| settings.is_native()));
        super::checked(&self.engine, job, measurement)
    }

    /// Prepares the error bounds of a job's direct light. `looked_up` has no tables if the settings ask for plain ones.
    fn error_bounds<'a, R: Resampled>(
        &self,
        job: &'a Job,
        settings: Settings,
        tables: &'a Tables<'_>,
        looked_up: Vec<R>,
        edge_deg: f64,
    ) -> ErrorBounds<'a, R> {
        let frame = Frame::of(job, settings.coordinates);
        let side = patch(job, &frame, settings.preset);
        let side_m = side / frame.scale;
        let spaces = Space::of(&recess::behind_luminaires(job, self.apart), side_m);
        let offsets =
            spaces.iter().map(|space| if *space == Space::Tight { side } else { self.patch_offset * side }).collect();
        let instrument = Instrument { edge_deg, offsets, by_arc_cosine: true };
        ErrorBounds {
            job,
            tables,
            looked_up,
            rounding: FloatError::of(job, frame, instrument),
            places: job.scene.luminaires.iter().map(places_m).collect(),
            spaces,
            side_m,
            is_cut_by_its_plane: self.is_cut_by_its_plane,
        }
    }
}

/// Error bounds of a job's direct light at its sensors.
struct ErrorBounds<'a, R> {
    job: &'a Job,
    tables: &'a Tables<'a>,
    looked_up: Vec<R>,
    rounding: FloatError<'a>,
    /// Positions of each luminaire's light.
    places: Vec<Vec<DVec3>>,
    /// Space about each sensor's patch.
    spaces: Vec<Space>,
    side_m: f64,
    is_cut_by_its_plane: bool,
}

impl<R: Resampled> ErrorBounds<'_, R> {
    /// Returns the bound in lux at sensor `k` with a normal that is off by `normal_off`.
    fn at_lx(&self, k: usize, normal_off: f64) -> f64 {
        let normal_error_lx = normal_off * self.facing_lx(k, |_| 1.0);
        self.rounding.at_lx(k) + self.table_error_lx(k) + self.plane_loss_lx(k) + normal_error_lx
    }

    /// Returns the error that the renderer's look-up of tables makes at sensor `k`.
    fn table_error_lx(&self, k: usize) -> f64 {
        izip!(&self.job.scene.luminaires, &self.places, &self.tables.of_luminaire)
            .filter_map(|(luminaire, places, table)| Some((luminaire, places, self.looked_up.get(*table)?)))
            .map(|(luminaire, places, table)| {
                let meter = &self.job.sensors[k].meter;
                table.off_lx(luminaire, places, meter, |place_m| self.spread(luminaire, place_m, k))
            })
            .sum()
    }

    /// Returns the directions in which a place of a luminaire may see the patch of sensor `k`.
    fn spread(&self, luminaire: &Luminaire, place_m: DVec3, k: usize) -> Spread {
        let meter = &self.job.sensors[k].meter;
        let to_local = luminaire.orientation.transpose();
        let reach_deg = self.rounding.spread_deg(luminaire, place_m, k);
        let patch_sides = sides(meter.normal).map(|side| to_local * side);
        Spread::of(reach_deg, to_local * (meter.position_m - place_m), self.side_m, patch_sides)
    }

    /// Returns the light that the tilted plane of a patch may cut off at sensor `k`.
    fn plane_loss_lx(&self, k: usize) -> f64 {
        let tilt = self.spaces[k].tilt();
        let is_cut = self.is_cut_by_its_plane;
        self.facing_lx(k, |cosine| if is_cut && cosine > 0.0 && cosine < tilt { cosine } else { 0.0 })
    }

    /// Returns the illuminance of sensor `k` by all parts of all luminaires. `by_cosine` replaces the cosine of each part; with 1
    /// the meter faces every part.
    fn facing_lx(&self, k: usize, by_cosine: impl Fn(f64) -> f64) -> f64 {
        let meter = &self.job.sensors[k].meter;
        let luminaires = self.job.scene.luminaires.iter().zip(&self.places);
        let means_lx = luminaires.map(|(luminaire, places)| {
            let parts_lx = places.iter().map(|place_m| {
                let ray_m = meter.position_m - *place_m;
                let cosine = -ray_m.normalize_or_zero().dot(meter.normal);
                by_cosine(cosine) * luminaire.intensity_towards(ray_m).value() / ray_m.length_squared()
            });
            parts_lx.sum::<f64>() / places.len() as f64
        });
        means_lx.sum()
    }
}

/// Returns whether the engine supports a job. `stock` describes the error of a scene without settings, and its size.
pub(super) fn supports(entry: &Entry, job: &Job, stock: (&str, Option<f64>)) -> Support {
    // `check_settings` reports invalid settings, so this function ignores them.
    let settings = Settings::of(job, &entry.name).ok();
    let has_plain_tables = settings.is_some_and(Settings::has_plain_tables);
    let objection = entry.objection(job).or_else(|| opening::obstacle(entry.display_name, job, has_plain_tables));
    if let Some(why) = objection {
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

/// Finds two luminaires with the same table but different files.
fn two_files_of_a_table(job: &Job) -> Option<(&str, &str)> {
    let mut pairs = job.scene.luminaires.iter().array_combinations();
    let found = pairs.find(|[a, b]: &[&Luminaire; 2]| {
        a.photometry.distribution == b.photometry.distribution && a.photometry.source != b.photometry.source
    });
    found.map(|[a, b]| (a.id.as_str(), b.id.as_str()))
}

/// Returns the files of tables for a renderer's own reader.
///
/// They are the user's own bytes if the settings ask for those and they are LM-63, else what our writer makes of the table.
pub(super) fn plain_files<'a>(
    job: &'a Job,
    settings: Settings,
    tables: &'a Tables<'_>,
    name: fn(usize) -> String,
) -> impl Iterator<Item = SceneFile> + 'a {
    tables.distinct.iter().enumerate().map(move |(k, table)| {
        match users_file(job, tables, k).filter(|_| settings.is_native()) {
            Some(bytes) => SceneFile { name: name(k), bytes },
            None => SceneFile::text(&name(k), ies_file::of_table(table, "[MORE] the table as it is")),
        }
    })
}

/// Returns the bytes of the user's LM-63 file of a table, from the first luminaire that has it.
fn users_file(job: &Job, tables: &Tables<'_>, table: usize) -> Option<Vec<u8>> {
    let luminaire = tables.of_luminaire.iter().position(|t| *t == table)?;
    Some(job.scene.luminaires[luminaire].photometry.lm63_file()?.bytes.to_vec())
}

/// Returns how many diffuse reflections paths are followed for.
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

/// The job file that a driver reads.
#[derive(Serialize)]
struct DriverJob<'a> {
    case: &'a str,
    procedure: &'a str,
    transport: &'static str,
    reflections: i64,
    emitters: usize,
    extended: bool,
    /// Whether the driver reads direct light one luminaire after the other.
    apart: bool,
    tables: Vec<String>,
    /// Side of a meter's patch.
    patch: f64,
    /// Number of blocks that the driver reads without further requests.
    blocks: usize,
    /// Samples along the side of each of these blocks.
    side: usize,
    seed: u64,
    sensors: Vec<PatchPlacement<'a>>,
}

/// A meter's patch in the job file.
#[derive(Serialize)]
struct PatchPlacement<'a> {
    #[serde(flatten)]
    placement: MeterPlacement<'a>,
    /// Whether no surface is near, so that the patch may lie at the meter's exact point.
    free: bool,
    /// Whether there is space for a wide patch.
    wide: bool,
}

/// Returns `job.json` of a scene with this many lights and these files of tables.
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
        sensors: dialogue::placements(job, frame)
            .zip(spaces)
            .map(|(placement, space)| PatchPlacement {
                placement,
                free: space != Space::Tight,
                wide: space == Space::Wide,
            })
            .collect(),
    };
    let text = serde_json::to_string_pretty(&driver_job)
        .map_err(|e| EngineError::output(engine, format!("the job cannot be written: {e}")))?;
    Ok(SceneFile::text(JOB_FILE, text))
}
