//! Cycles (Blender): its own lights, IES textures and path tracer, read by baking small white patches.
//!
//! Blender is GPL: it stays a program of its own behind our driver (`drivers/cycles_read.py`), and nothing of it is linked or kept here.

mod export;
mod ies;
mod settings;
#[cfg(test)]
pub(super) mod tests;

use std::time::Duration;

use luminaire::scene::{Bounces, Transport};
use serde::Deserialize;

use self::export::patch;
use self::ies::LookedUp;
use self::settings::{Files, Settings};
use super::dialogue::{Cost, Dialogue};
use super::float_error::{FloatError, Instrument};
use super::frame::Frame;
use super::settings::Preset;
use super::tables::Tables;
use super::workbench::by_hand;
use super::{
    Absent, Component, Engine, EngineError, Entry, Job, Knob, Measurement, SceneFile, Site, Support, Version, Workbench,
};
use crate::record::EngineName;
use crate::system::process::Invocation;

const ID: EngineName = EngineName::new("cycles");

pub(super) static ENTRY: Entry = Entry {
    name: ID,
    display_name: "Cycles",
    colour: ("#b4540a", "#f0995a"),
    installs: &[Component::Blender],
    is_on_request: true,
    models: &[luminaire::scene::LuminaireModel::Point, luminaire::scene::LuminaireModel::Area],
    fits_coordinates: Some("recentre"),
    make: || Box::new(Cycles),
};

const PROBE: &str = include_str!("../../drivers/cycles_probe.py");
const REMEDY: &str = "run `luxproof engines install cycles`";
/// Importing Blender takes two seconds; a machine under load may need many.
const PROBE_LIMIT: Duration = Duration::from_secs(120);

/// What sums of 32-bit floats may be off, in parts of a reading: a film adds up to 65,536 samples, each sum rounded.
const FILM: f64 = 1e-4;

pub(super) struct Cycles;

#[derive(Deserialize)]
struct Told {
    blender: String,
}

impl Engine for Cycles {
    fn name(&self) -> EngineName {
        ID
    }

    fn reads_files(&self, job: &Job) -> bool {
        Settings::of(job).is_ok_and(|settings| settings.photometry == Files::Native)
    }

    fn probe(&self, site: &Site) -> Result<Version, Absent> {
        let absent = |reason: String| Absent { reason, remedy: REMEDY.into() };
        let blender = site.blender();
        let python = blender.python().ok_or_else(|| absent("there is no Python environment for Blender".into()))?;
        let package =
            blender.python_package("bpy").ok_or_else(|| absent("the Python package `bpy` is missing".into()))?;
        let folder = tempfile::tempdir().map_err(|e| absent(format!("no temporary folder: {e}")))?;
        let run = Invocation::new(&python, folder.path(), PROBE_LIMIT, folder.path().join("log"));
        let finished = run.args(["-I", "-B", "-"]).stdin(PROBE.into()).run().map_err(|e| absent(e.to_string()))?;
        // Blender may greet first: the answer is the last line.
        let text = String::from_utf8_lossy(&finished.stdout);
        let answer = text.lines().last().unwrap_or_default();
        let told: Told = serde_json::from_str(answer)
            .map_err(|e| absent(format!("the probe of Blender answered `{answer}`: {e}")))?;
        let files = [package].into_iter().chain(blender.python_package("numpy")).chain(python.canonicalize());
        Ok(Version::of(&ID, told.blender, site, files))
    }

    fn supports(&self, job: &Job) -> Support {
        let settings = Settings::of(job);
        let is_stock = settings.is_ok_and(|s| s.preset == Preset::Default);
        if let Some(why) = ENTRY.objection(job).or_else(|| export::obstacle(job, is_stock)) {
            return Support::No(why);
        }
        if let Some((one, other)) = self.reads_files(job).then(|| export::two_files_of_a_table(job)).flatten() {
            return Support::No(format!(
                "`{one}` and `{other}` have files that differ and say the same table: its textures go by tables"
            ));
        }
        if is_stock {
            let why = "as installed, Cycles mirrors the C planes of IES files, bends between their angles, is up to an eighth off where \
                       planes begin and end, clamps reflected light and follows four reflections";
            return Support::Approximate { why: why.into(), size: None };
        }
        let close = super::mitsuba::luminaire_close_to_a_surface(job);
        if let (Some(id), Transport::Indirect(_) | Transport::Total(_)) = (close, job.transport) {
            let why = format!("paths seldom find the bright spot that `{id}` throws on a surface close by");
            return Support::Approximate { why, size: None };
        }
        if export::reflections(job) == export::MOST_REFLECTIONS && job.reflections() != Some(Bounces::AtMost(0)) {
            let why = format!("Cycles follows {} reflections at most", export::MOST_REFLECTIONS);
            return Support::Approximate { why, size: None };
        }
        Support::Yes
    }

    fn export(&self, job: &Job) -> Result<Vec<SceneFile>, EngineError> {
        export::files(job, Settings::of(job)?)
    }

    fn command_by_hand(&self, _job: &Job, site: &Site) -> Option<String> {
        let python = site.blender().python().unwrap_or_else(|| "python3.11".into());
        Some(by_hand(python).args(["cycles_read.py", "job.json"]).command_line_with_env())
    }

    fn knobs(&self) -> &'static [Knob] {
        settings::KNOBS
    }

    fn check_settings(&self, job: &Job) -> Result<(), EngineError> {
        Settings::of(job).map(drop)
    }

    /// One process, whatever its threads.
    fn memory_mib(&self, job: &Job, _threads: usize) -> u64 {
        768 + super::geometry_mib(job)
    }

    fn read(&self, job: &Job, workbench: &Workbench) -> Result<Measurement, EngineError> {
        let settings = Settings::of(job)?;
        read_files(&export::files(job, settings)?, job, settings, workbench)
    }
}

fn read_files(
    files: &[SceneFile],
    job: &Job,
    settings: Settings,
    workbench: &Workbench,
) -> Result<Measurement, EngineError> {
    workbench.write(files)?;
    let blender = workbench.site.blender();
    let python = blender.python().ok_or_else(|| EngineError::output(ID, format!("has no Python; {REMEDY}")))?;
    let threads = workbench.jobs.max(1).to_string();
    // Neither the user's Python nor its packages; scene folders stay as exported.
    let run =
        workbench.invoke(python).args(["-I", "-B", "cycles_read.py", "job.json", "--serve", "--threads", &threads]);
    let frame = Frame::of(job, settings.coordinates);
    let patch = patch(job, &frame);
    let instrument = Instrument { edge_deg: 2.0 * ies::EDGE_DEG, seat: patch, by_arc_cosine: true };
    let rounding = FloatError::of(job, frame, instrument);
    let tables = Tables::of(job);
    // A stock scene has the tables as they are, and what becomes of them is what one wants to know.
    let resampled = tables.distinct.iter().filter(|_| !settings.has_plain_tables());
    let looked_up: Vec<LookedUp> = resampled.map(|d| LookedUp::of(d)).collect();
    let of_tables_lx = |k: usize| -> f64 {
        let off = job.scene.luminaires.iter().zip(&tables.of_luminaire);
        off.filter_map(|(luminaire, k_th)| Some((luminaire, looked_up.get(*k_th)?)))
            .map(|(luminaire, table)| table.off_lx(luminaire, &job.stations[k].meter))
            .sum()
    };
    let misled = looked_up.iter().map(LookedUp::misled_share).fold(0.0, f64::max);
    let bound_lx = |k: usize| rounding.at_lx(k) + of_tables_lx(k);
    let dialogue = Dialogue {
        engine: ID,
        job,
        conversation: run.converse()?,
        fixed: settings.fixed(),
        cost: |_| Cost { ray_s: 1e-6, trial_side: None },
        bound_lx: &bound_lx,
        relative_bound: FILM + misled,
    };
    let mut measurement = dialogue.measurement()?;
    measurement.effort.insert("command".into(), run.command_line());
    super::checked(&ID, job, measurement)
}
