//! Radiance's programs in the Python package `pyradiance`, called without Python: oconv and rtrace.

use std::path::PathBuf;

use luxproof_scene::Luminaire;

use super::export::Light;
use super::route::{Route, route};
use super::settings::Settings;
use super::{ID, export};
use crate::job_dir::by_hand;
use crate::{Absent, EngineError, EngineRoot, JobDir, SceneFile, Version};
use luxproof_process::process::{self, Invocation};

/// Largest size in bytes of an octree, which contains the scene.
const MAX_OCTREE_BYTES: usize = 1 << 30;
/// Bytes of rtrace's output per row.
const ROW_BYTES: usize = 24;

/// Returns that a part of Radiance is missing.
fn absent(reason: String) -> Absent {
    Absent { reason, remedy: "run `luxproof engines install`".into() }
}

/// Returns that the installed Radiance does not work.
fn broken(reason: String) -> Absent {
    Absent { reason, remedy: "run `luxproof engines install` again".into() }
}

/// Radiance's programs and the library that gives rtrace a seed.
#[derive(Clone, Debug)]
pub(super) struct Tools {
    package: PathBuf,
    /// The library that stops the clock for rtrace, which takes the time as the seed of its random numbers.
    clock: PathBuf,
}

impl Tools {
    pub(super) fn find(site: &EngineRoot) -> Result<Self, Absent> {
        let package = site.python_package("pyradiance");
        let package = package.ok_or_else(|| absent("the package pyradiance is not installed".into()))?;
        for file in ["bin/rtrace", "bin/oconv", "bin/ies2rad", "lib/source.cal"] {
            if !package.join(file).is_file() {
                return Err(absent(format!("{} has no {file}", package.display())));
            }
        }
        let clock = site.libfaketime();
        let clock = clock.ok_or_else(|| absent("libfaketime, which lets rtrace have a seed, is not there".into()))?;
        Ok(Self { package, clock })
    }

    /// Returns the version from rtrace's output `RADIANCE 6.0a ...`.
    pub(super) fn version(&self, site: &EngineRoot) -> Result<Version, Absent> {
        let finished = process::ask(self.program("rtrace"), "-version", |run| self.prepared(run));
        let finished = finished.map_err(|error| broken(error.to_string()))?;
        let text = String::from_utf8_lossy(&finished.stdout).into_owned();
        let version = text.split_whitespace().nth(1).ok_or_else(|| broken(format!("rtrace -version says `{text}`")))?;
        Ok(Version::of(&ID, version, site, [self.package.clone(), self.clock.clone()]))
    }

    pub(super) fn compile(&self, workbench: &JobDir, lights: &[Light], scenes: usize) -> Result<(), EngineError> {
        for (light, scene) in lights.iter().flat_map(|light| (0..scenes).map(move |scene| (light, scene))) {
            let compiled = self.prepared(workbench.invoke(self.program("oconv"))).longest_answer(MAX_OCTREE_BYTES);
            let compiled = compiled.args(["-f".to_owned()]).args(light.parts(scene, scenes * lights.len())).run()?;
            workbench.write(&[SceneFile { name: light.octree(scene, scenes), bytes: compiled.stdout }])?;
        }
        Ok(())
    }

    /// Makes `luminaire-<k>.rad` with ies2rad if the luminaire's route uses it.
    pub(super) fn ies2rad(
        &self,
        workbench: &JobDir,
        k: usize,
        luminaire: &Luminaire,
        settings: &Settings,
    ) -> Result<(), EngineError> {
        let kind = match route(luminaire, settings) {
            Route::Point | Route::Opening => return Ok(()),
            Route::Ies2radLight => "' light '",
            Route::Ies2radIllum => "' illum '",
        };
        let options = export::ies2rad_options(k, luminaire, settings);
        self.prepared(workbench.invoke(self.program("ies2rad"))).args(options).run()?;
        let made = workbench.scene_dir.join(format!("ies2rad-{k}.rad"));
        let text = std::fs::read_to_string(&made).map_err(|source| EngineError::io(&made, source))?;
        // ies2rad cannot make a box of illum, so its light is replaced.
        if !text.contains("' light '") {
            return Err(EngineError::output(ID, format!("{} holds no light", made.display())));
        }
        workbench.write(&[SceneFile::text(&format!("luminaire-{k}.rad"), text.replace("' light '", kind))])
    }

    /// Returns the illuminance in lux of each row, with the random numbers of a seed.
    pub(super) fn rtrace(
        &self,
        workbench: &JobDir,
        options: &[String],
        octree: &str,
        seed: u32,
        rows: &[[f64; 6]],
    ) -> Result<Vec<f64>, EngineError> {
        let stdin = rows.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
        let run = self.seeded(workbench.invoke(self.program("rtrace")), seed);
        let run = run.args(["-h", "-fdd"]).args(options).args([octree]).stdin(stdin);
        // The limit is larger than the expected output, so that the error reports superfluous rows.
        let finished = run.longest_answer(4 * ROW_BYTES * rows.len()).run()?;
        parse(&finished.stdout, rows.len())
    }

    /// The script loads the library only for rtrace, because in a shell libfaketime leaves files behind.
    pub(super) fn command_by_hand(&self, seed: u32) -> String {
        self.with_fixed_time(by_hand("sh"), seed).env("CLOCK", &self.clock).args(["run.sh"]).command_line_with_env()
    }

    fn program(&self, name: &str) -> PathBuf {
        self.package.join("bin").join(name)
    }

    fn seeded(&self, run: Invocation, seed: u32) -> Invocation {
        self.with_fixed_time(run, seed).env("LD_PRELOAD", &self.clock)
    }

    /// rtrace calls `srandom(time(0))`. With [`Self::clock`] loaded, the seconds since 1970 always equal the seed.
    fn with_fixed_time(&self, run: Invocation, seed: u32) -> Invocation {
        let variables =
            [("FAKETIME", seed.to_string()), ("FAKETIME_FMT", "%s".into()), ("FAKETIME_DISABLE_SHM", "1".into())];
        variables.into_iter().fold(self.prepared(run), |run, (key, value)| run.env(key, value))
    }

    /// Adds the search paths that the programs need: for their library and for each other.
    fn prepared(&self, run: Invocation) -> Invocation {
        let raypath = format!(".:{}", self.package.join("lib").display());
        let path = format!("{}:/usr/bin:/bin", self.package.join("bin").display());
        run.env("RAYPATH", raypath).env("PATH", path)
    }
}

/// Converts red, green and blue as 64-bit floats, one triple per row, to lux.
///
/// It checks the number of rows, because rtrace ends successfully after a row that it could not read.
pub(super) fn parse(stdout: &[u8], rows: usize) -> Result<Vec<f64>, EngineError> {
    let (values, rest) = stdout.as_chunks::<8>();
    let values: Vec<f64> = values.iter().map(|b| f64::from_le_bytes(*b)).collect();
    if !rest.is_empty() || values.len() != 3 * rows {
        return Err(EngineError::output(ID, format!("rtrace gave {} bytes for {rows} rows of 24", stdout.len())));
    }
    let (triples, _) = values.as_chunks::<3>();
    let lux: Vec<f64> = triples
        .iter()
        .map(|rgb| export::EFFICACY * rgb.iter().zip(export::WEIGHTS).map(|(c, w)| c * w).sum::<f64>())
        .collect();
    match lux.iter().position(|e| !e.is_finite() || *e < 0.0) {
        Some(row) => Err(EngineError::output(ID, format!("rtrace read {} lx in row {row}", lux[row]))),
        None => Ok(lux),
    }
}
