//! Radiance's programs in the Python package `pyradiance`, called without Python: oconv and rtrace.

use std::path::PathBuf;

use luminaire::scene::Luminaire;

use super::export::Light;
use super::route::{Route, route};
use super::settings::Settings;
use super::{ID, export};
use crate::engines::workbench::by_hand;
use crate::engines::{Absent, EngineError, SceneFile, Site, Version, Workbench};
use crate::system::process::{self, Invocation};

/// Bytes of an octree, which holds the scene, at most.
const LARGEST_OCTREE: usize = 1 << 30;
/// Bytes that rtrace gives for a row.
const ROW: usize = 24;

#[derive(Clone, Debug)]
pub(super) struct Tools {
    package: PathBuf,
    /// What makes the time stand still for rtrace, which takes it for the seed of its random numbers.
    clock: PathBuf,
}

impl Tools {
    pub(super) fn find(site: &Site) -> Result<Self, Absent> {
        let absent = |reason: String| Absent { reason, remedy: "run `luxproof engines install`".into() };
        let package = site.python_package("pyradiance");
        let package = package.ok_or_else(|| absent("the package pyradiance is not installed".into()))?;
        for file in ["bin/rtrace", "bin/oconv", "bin/ies2rad", "lib/source.cal"] {
            if !package.join(file).is_file() {
                return Err(absent(format!("{} has no {file}", package.display())));
            }
        }
        let absent = |reason: String| Absent { reason, ..absent(String::new()) };
        let clock = site.libfaketime();
        let clock = clock.ok_or_else(|| absent("libfaketime, which lets rtrace have a seed, is not there".into()))?;
        Ok(Self { package, clock })
    }

    /// The version that rtrace names: `RADIANCE 6.0a ...`, its first two words.
    pub(super) fn version(&self, site: &Site) -> Result<Version, Absent> {
        let absent = |reason: String| Absent { reason, remedy: "run `luxproof engines install` again".into() };
        let done = process::ask(self.program("rtrace"), "-version", |asked| self.prepared(asked));
        let done = done.map_err(|error| absent(error.to_string()))?;
        let text = String::from_utf8_lossy(&done.stdout).into_owned();
        let version = text.split_whitespace().nth(1).ok_or_else(|| absent(format!("rtrace -version says `{text}`")))?;
        Ok(Version::of(&ID, version, site, [self.package.clone(), self.clock.clone()]))
    }

    pub(super) fn compile(&self, workbench: &Workbench, lights: &[Light], scenes: usize) -> Result<(), EngineError> {
        for (light, scene) in lights.iter().flat_map(|light| (0..scenes).map(move |scene| (light, scene))) {
            let compiled = self.prepared(workbench.invoke(self.program("oconv"))).longest_answer(LARGEST_OCTREE);
            let compiled = compiled.args(["-f".to_owned()]).args(light.parts(scene, scenes * lights.len())).run()?;
            workbench.write(&[SceneFile { name: light.octree(scene, scenes), bytes: compiled.stdout }])?;
        }
        Ok(())
    }

    /// Lets ies2rad make `luminaire-<k>.rad`, where the luminaire goes that way.
    pub(super) fn ies2rad(
        &self,
        workbench: &Workbench,
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
        // ies2rad knows no box of illum; its light becomes one.
        if !text.contains("' light '") {
            return Err(EngineError::output(ID, format!("{} holds no light", made.display())));
        }
        workbench.write(&[SceneFile::text(&format!("luminaire-{k}.rad"), text.replace("' light '", kind))])
    }

    /// Illuminance in lux of each row, with the random numbers of a seed.
    pub(super) fn rtrace(
        &self,
        workbench: &Workbench,
        options: &[String],
        octree: &str,
        seed: u32,
        rows: &[[f64; 6]],
    ) -> Result<Vec<f64>, EngineError> {
        let stdin = rows.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
        let run = self.seeded(workbench.invoke(self.program("rtrace")), seed);
        let run = run.args(["-h", "-fdd"]).args(options).args([octree]).stdin(stdin);
        // Some more is read, so that rows too many are told as such.
        let finished = run.longest_answer(4 * ROW * rows.len()).run()?;
        parse(&finished.stdout, rows.len())
    }

    /// For rtrace alone in the script: in a shell, libfaketime leaves files behind.
    pub(super) fn command_by_hand(&self, seed: u32) -> String {
        self.held(by_hand("sh"), seed).env("CLOCK", &self.clock).args(["run.sh"]).command_line_with_env()
    }

    fn program(&self, name: &str) -> PathBuf {
        self.package.join("bin").join(name)
    }

    fn seeded(&self, run: Invocation, seed: u32) -> Invocation {
        self.held(run, seed).env("LD_PRELOAD", &self.clock)
    }

    /// rtrace calls `srandom(time(0))`: to whom [`Self::clock`] is loaded the seconds since 1970 stand still at the seed.
    fn held(&self, run: Invocation, seed: u32) -> Invocation {
        let held =
            [("FAKETIME", seed.to_string()), ("FAKETIME_FMT", "%s".into()), ("FAKETIME_DISABLE_SHM", "1".into())];
        held.into_iter().fold(self.prepared(run), |run, (key, value)| run.env(key, value))
    }

    /// With the search paths that the programs need: for their library and for one another.
    fn prepared(&self, run: Invocation) -> Invocation {
        let raypath = format!(".:{}", self.package.join("lib").display());
        let path = format!("{}:/usr/bin:/bin", self.package.join("bin").display());
        run.env("RAYPATH", raypath).env("PATH", path)
    }
}

/// Red, green and blue as 64-bit floats, one triple a row, to lux. rtrace ends well after fewer rows than it was given
/// where it could not read one.
pub(super) fn parse(stdout: &[u8], rows: usize) -> Result<Vec<f64>, EngineError> {
    let (values, rest) = stdout.as_chunks::<8>();
    let values: Vec<f64> = values.iter().map(|b| f64::from_le_bytes(*b)).collect();
    if !rest.is_empty() || values.len() != 3 * rows {
        return Err(EngineError::output(ID, format!("rtrace gave {} bytes for {rows} rows of 24", stdout.len())));
    }
    let (triples, _) = values.as_chunks::<3>();
    let lux = |rgb: &[f64; 3]| export::EFFICACY * rgb.iter().zip(export::WEIGHTS).map(|(c, w)| c * w).sum::<f64>();
    let lux: Vec<f64> = triples.iter().map(lux).collect();
    match lux.iter().position(|e| !e.is_finite() || *e < 0.0) {
        Some(row) => Err(EngineError::output(ID, format!("rtrace read {} lx in row {row}", lux[row]))),
        None => Ok(lux),
    }
}
