//! three.js, Babylon.js and three-gpu-pathtracer: the IES loaders of the web, with the renderers that use them, in headless Chromium.
//!
//! Their own code loads the file and shades: what is audited is what a page of theirs shows, in WebGL 2 by software (`SwiftShader`), which is
//! the same on every machine. three.js and Babylon.js have direct light of points alone: their shadows are maps of so many texels, and
//! reflected light they have none. The path tracer has both.

mod pathtracer;
mod settings;
#[cfg(test)]
pub(super) mod tests;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use luxproof_photometry::{Photometry, lm63};
use luxproof_scene::{Luminaire, LuminaireModel, Meter, Transport};
use serde::{Deserialize, Serialize};

use self::settings::Settings;
use super::dialogue::JOB_FILE;
use super::frame::Frame;
use super::job_dir::by_hand;
use super::{
    Absent, Component, Engine, EngineError, EngineRoot, Entry, Job, JobDir, Measurement, SceneFile, Sensor, Setting,
    Support, Version, checked,
};
use luxproof_model::{EngineName, Estimate, Uncertainty};
use luxproof_process::process::{self, Invocation};

pub(super) use pathtracer::ENTRY as THREE_GPU_PATHTRACER;

const INSTALLS: &[Component] = &[Component::WebPackages, Component::Chromium];

pub(super) static THREE: Entry = Entry {
    name: EngineName::new("three"),
    display_name: "three.js",
    installs: INSTALLS,
    is_on_request: true,
    models: &[LuminaireModel::Point],
    fits_coordinates: None,
    make: || Box::new(Web(Library::Three)),
};

pub(super) static BABYLON: Entry = Entry {
    name: EngineName::new("babylon"),
    display_name: "Babylon.js",
    installs: INSTALLS,
    is_on_request: true,
    models: &[LuminaireModel::Point],
    fits_coordinates: None,
    make: || Box::new(Web(Library::Babylon)),
};

const DRIVER: (&str, &str) = ("web_read.mjs", include_str!("../drivers/web_read.mjs"));

/// What sums of 32-bit floats in a fragment shader may be off, in parts of a reading: some ten operations, each rounded.
const FLOATS: f64 = 1e-6;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Library {
    Three,
    Babylon,
}

impl Library {
    const fn entry(self) -> &'static Entry {
        match self {
            Self::Three => &THREE,
            Self::Babylon => &BABYLON,
        }
    }

    /// What runs in the page.
    const fn page(self) -> (&'static str, &'static str) {
        match self {
            Self::Three => ("web_three.js", include_str!("../drivers/web_three.js")),
            Self::Babylon => ("web_babylon.js", include_str!("../drivers/web_babylon.js")),
        }
    }

    /// The folder of a release among the packages. The newest three.js has its own name, by which other packages find it.
    fn package(self, release: &str) -> String {
        match self {
            Self::Three if release == settings::RELEASES[0] => "three".to_owned(),
            Self::Three => format!("three-{release}"),
            Self::Babylon => "@babylonjs/core".to_owned(),
        }
    }
}

pub(super) struct Web(Library);

/// The modules that scripts of a page name, each with its place below the page.
type Imports = BTreeMap<&'static str, &'static str>;

/// What the driver reads.
#[derive(Serialize)]
struct PageJob<'a> {
    case: &'a str,
    procedure: &'a str,
    page: &'a str,
    package: String,
    imports: Imports,
    texture: &'a str,
    lamps: Vec<Lamp>,
    meters: Vec<PageMeter<'a>>,
}

#[derive(Serialize)]
struct Lamp {
    file: String,
    /// The largest intensity: the loaders keep parts of it.
    candela: f64,
    position: [f64; 3],
    axes: [[f64; 3]; 3],
}

#[derive(Serialize)]
struct PageMeter<'a> {
    id: &'a str,
    position: [f64; 3],
    normal: [f64; 3],
}

impl<'a> PageMeter<'a> {
    fn of(sensor: &'a Sensor) -> Self {
        let Meter { position_m, normal } = sensor.meter;
        Self { id: &sensor.id.0, position: position_m.to_array(), normal: normal.to_array() }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PageAnswer {
    lux: Vec<Option<f64>>,
    version: String,
    backend: String,
    /// Errors that the page logged.
    troubles: Vec<String>,
}

impl Web {
    fn error(&self, what: impl Into<String>) -> EngineError {
        EngineError::output(self.name(), what)
    }

    fn parsed(&self, stdout: &[u8], job: &Job) -> Result<Measurement, EngineError> {
        let answer: PageAnswer = serde_json::from_slice(stdout)
            .map_err(|e| EngineError::no_readings(self.name(), &String::from_utf8_lossy(stdout), &e))?;
        if let Some(trouble) = answer.troubles.first() {
            return Err(self.error(format!("its page says: {trouble}")));
        }
        let values = answer.lux.into_iter().map(|lux| lux.unwrap_or(f64::NAN));
        let estimates = values.map(|value| Estimate { value, uncertainty: Uncertainty::Bound(FLOATS * value.abs()) });
        let method = BTreeMap::from([("version", answer.version), ("backend", answer.backend)]);
        Ok(Measurement {
            estimates: estimates.collect(),
            method: method.into_iter().map(|(k, v)| (k.to_owned(), v)).collect(),
            notes: job.written_for_its_reader().into_iter().collect(),
            ..Measurement::default()
        })
    }
}

impl Lamp {
    /// Returns luminaire `k` as the page reads it.
    fn of(k: usize, luminaire: &Luminaire) -> Self {
        Self {
            file: file_name(k),
            candela: luminaire.photometry.distribution.max_intensity().value() * luminaire.flux_scale,
            position: luminaire.position_m.to_array(),
            axes: luminaire.orientation.to_cols_array_2d(),
        }
    }

    /// Returns it in the coordinates of a scene.
    fn in_frame(self, frame: &Frame) -> Self {
        let position = frame.to_scene(self.position.into()).to_array();
        Self { candela: self.candela * frame.scale * frame.scale, position, ..self }
    }
}

/// Returns the version in the manifest of an npm package.
fn packaged_version(folder: &Path) -> Option<String> {
    let manifest: serde_json::Value = serde_json::from_slice(&fs::read(folder.join("package.json")).ok()?).ok()?;
    Some(manifest["version"].as_str()?.to_owned())
}

impl Engine for Web {
    fn name(&self) -> EngineName {
        self.0.entry().name.clone()
    }

    fn reads_files(&self, _job: &Job) -> bool {
        true
    }

    fn probe(&self, site: &EngineRoot) -> Result<Version, Absent> {
        let packages = match self.0 {
            Library::Three => settings::RELEASES.iter().map(|release| self.0.package(release)).collect(),
            Library::Babylon => vec![self.0.package("")],
        };
        probe(&self.name(), site, &packages)
    }

    fn supports(&self, job: &Job) -> Support {
        if job.transport != Transport::Direct {
            return Support::No("renderers of the web have no reflected light".to_owned());
        }
        if !job.scene.obstacles.is_empty() {
            return Support::No("its shadows are maps of so many texels, which are not audited".to_owned());
        }
        self.0.entry().objection(job).map_or(Support::Yes, Support::No)
    }

    fn export(&self, job: &Job) -> Result<Vec<SceneFile>, EngineError> {
        let settings = Settings::of(job, self.0)?;
        let (page, source) = self.0.page();
        let asked = PageJob {
            case: &job.case,
            procedure: job.procedure.name(),
            page,
            package: self.0.package(settings.release),
            imports: ["three", "three/webgpu"].map(|module| (module, "/package/build/three.webgpu.js")).into(),
            texture: settings.texture,
            lamps: job.scene.luminaires.iter().enumerate().map(|(k, l)| Lamp::of(k, l)).collect(),
            meters: job.sensors.iter().map(PageMeter::of).collect(),
        };
        let bytes = serde_json::to_vec_pretty(&asked).map_err(|e| self.error(format!("the job is no JSON: {e}")))?;
        let files = job.scene.luminaires.iter().enumerate();
        let files = files.map(|(k, l)| SceneFile { name: file_name(k), bytes: native(&l.photometry) });
        let ours = [
            SceneFile { name: JOB_FILE.to_owned(), bytes },
            SceneFile::text(page, source),
            SceneFile::text(DRIVER.0, DRIVER.1),
        ];
        Ok(ours.into_iter().chain(files).collect())
    }

    fn command_by_hand(&self, _job: &Job, site: &EngineRoot) -> Option<String> {
        Some(command_by_hand(site))
    }

    fn settings(&self) -> &'static [Setting] {
        match self.0 {
            Library::Three => settings::THREE_KNOBS,
            Library::Babylon => &[],
        }
    }

    fn check_settings(&self, job: &Job) -> Result<(), EngineError> {
        Settings::of(job, self.0).map(drop)
    }

    /// The estimate covers all of Chromium's processes.
    fn memory_mib(&self, job: &Job, _threads: usize) -> u64 {
        1536 + super::geometry_mib(job)
    }

    fn read(&self, job: &Job, workbench: &JobDir) -> Result<Measurement, EngineError> {
        workbench.write(&self.export(job)?)?;
        let run = driver(&self.name(), workbench)?;
        let mut driver = run.converse(workbench.idle.as_ref())?;
        let asked = serde_json::json!({ "job": workbench.scene_dir.join(JOB_FILE) });
        let answer = driver.ask(&asked.to_string())?;
        let mut measurement = self.parsed(answer.as_bytes(), job)?;
        measurement.effort.insert("command".into(), run.command_line());
        let measurement = checked(&self.name(), job, measurement)?;
        // Every failure above drops the driver, which ends it, too.
        driver.end()?;
        Ok(measurement)
    }
}

/// Returns the driver in a workbench, which answers what it is asked on its standard input.
fn driver(engine: &EngineName, workbench: &JobDir) -> Result<Invocation, EngineError> {
    let site = &workbench.site;
    match (site.node(), site.web_packages(), site.chromium()) {
        (Some(node), Some(packages), Some(chromium)) => {
            Ok(workbench.invoke(node).args([DRIVER.0.into(), "--serve".into(), packages, chromium]))
        }
        _ => Err(EngineError::output(engine.clone(), "is no longer there")),
    }
}

fn command_by_hand(site: &EngineRoot) -> String {
    let node = site.node().unwrap_or_else(|| "node".into());
    let packages = site.web_packages().unwrap_or_else(|| "packages".into());
    let chromium = site.chromium().unwrap_or_else(|| "chromium".into());
    by_hand(node).args([DRIVER.0.into(), JOB_FILE.into(), packages, chromium]).command_line_with_env()
}

/// Returns the version of an engine of these npm packages, with that of the browser.
fn probe(engine: &EngineName, site: &EngineRoot, packages: &[String]) -> Result<Version, Absent> {
    let node = site.node().ok_or_else(|| absent(engine, "there is no Node.js for it"))?;
    let folder = site.web_packages().ok_or_else(|| absent(engine, "its packages of npm are not there"))?;
    let chromium = site.chromium().ok_or_else(|| absent(engine, "there is no Chromium to run it in"))?;
    let asked = process::ask(chromium.clone(), "--version", |run| run);
    let finished = asked.map_err(|e| absent(engine, &e.to_string()))?;
    let chromium_version = String::from_utf8_lossy(&finished.stdout).trim().to_owned();
    let modules = folder.join("node_modules");
    let releases: Vec<PathBuf> = packages.iter().map(|package| modules.join(package)).collect();
    let mut versions = vec![];
    for folder in &releases {
        let Some(version) = packaged_version(folder) else {
            return Err(absent(engine, &format!("{} is missing or of no version", folder.display())));
        };
        versions.push(version);
    }
    let text = format!("{} in {chromium_version}", versions.join(" and "));
    let files = [node, chromium, modules.join("playwright-core")].into_iter().chain(releases);
    Ok(Version::of(engine, text, site, files))
}

fn absent(engine: &EngineName, reason: &str) -> Absent {
    Absent { reason: reason.to_owned(), remedy: format!("run `luxproof engines install {engine}`") }
}

fn file_name(k: usize) -> String {
    format!("luminaire-{k}.ies")
}

/// Returns the bytes of the user's own file if it is LM-63, the only format of the loaders. Otherwise it writes the table as LM-63.
fn native(photometry: &Photometry) -> Vec<u8> {
    let own = photometry.lm63_file().map(|file| file.bytes.to_vec());
    own.unwrap_or_else(|| lm63::write_2002(photometry).text.into_bytes())
}
