//! Which Mitsuba there is and which libLLVM its fast variants can use, found by trying in a child process.

use std::path::{Path, PathBuf};
use std::time::Duration;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::ID;
use super::settings::Settings;
use crate::dialogue::JOB_FILE;
use crate::job_dir::by_hand;
use crate::libraries::ATOMIC;
use crate::{Absent, EngineRoot, JobDir, Version, fingerprint};
use luxproof_process::digest::hexadecimal;
use luxproof_process::envelope::{self, Schema};
use luxproof_process::files;
use luxproof_process::process::Invocation;

const PROBE: &str = include_str!("../../drivers/mitsuba_probe.py");
const REMEDY: &str = "run `luxproof engines install mitsuba`";
/// The compiled variants, the best first; wheels before 3.6 have no mono.
const COMPILED: &str = "llvm_ad_mono,llvm_ad_rgb";
/// A probe takes about a second; a machine under load may need many.
const PROBE_LIMIT: Duration = Duration::from_secs(60);

#[derive(Clone, Debug, PartialEq)]
pub(super) struct Backend {
    root: PathBuf,
    python: PathBuf,
    /// The libLLVM that works; `None` leaves the scalar variants.
    llvm: Option<PathBuf>,
    versions: Versions,
    fingerprint: String,
}

/// What was found once, kept with the engines; it holds for the same files and the same libraries to try.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct CachedProbe {
    tried: Vec<PathBuf>,
    llvm: Option<PathBuf>,
    versions: Versions,
}

const SCHEMA: Schema = Schema { of: "probe of Mitsuba", version: 1 };

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Versions {
    mitsuba: String,
    drjit: String,
    llvm: Option<String>,
    /// The variant that was tried.
    variant: String,
}

impl Backend {
    /// What is known of these files, or else tries the libraries in order of preference until one traces paths.
    pub(super) fn find(site: &EngineRoot) -> Result<Self, Absent> {
        let absent = |reason: String| Absent { reason, remedy: REMEDY.into() };
        let python = site.python().ok_or_else(|| absent("there is no Python environment".into()))?;
        if site.python_package("mitsuba").is_none() {
            return Err(absent("the Python package `mitsuba` is missing".into()));
        }
        let libraries = site.llvms();
        if let Some(backend) = Self::load_cached(site, &python, &libraries) {
            return Ok(backend);
        }
        for library in &libraries {
            match probe(site, &python, COMPILED, Some(library)) {
                Ok(versions) => {
                    return Ok(Self::new(site, python, Some(library.clone()), versions).keep(site, libraries));
                }
                Err(reason) => tracing::debug!(library = %library.display(), reason, "unusable libLLVM"),
            }
        }
        let versions = probe(site, &python, "scalar_rgb", None).map_err(absent)?;
        Ok(Self::new(site, python, None, versions))
    }

    fn new(site: &EngineRoot, python: PathBuf, llvm: Option<PathBuf>, versions: Versions) -> Self {
        let packages = ["mitsuba", "drjit", "numpy"].iter().filter_map(|name| site.python_package(name));
        let files = packages.chain(llvm.clone()).chain(python.canonicalize());
        let fingerprint = fingerprint::of(&ID, site, files);
        Self { root: site.root().to_owned(), python, llvm, versions, fingerprint }
    }

    fn load_cached(site: &EngineRoot, python: &Path, libraries: &[PathBuf]) -> Option<Self> {
        let sealed = envelope::open::<CachedProbe>(SCHEMA, &files::read_stored(&Self::place(site)).ok()?).ok()?;
        let mut found = None;
        let kept = sealed.about_what(|kept| {
            let backend = Self::new(site, python.to_owned(), kept.llvm.clone(), kept.versions.clone());
            found.insert(backend).key()
        });
        let kept = kept.ok()?;
        found.filter(|_| kept.tried == libraries)
    }

    /// Where it cannot be kept, it is probed again next time.
    fn keep(self, site: &EngineRoot, tried: Vec<PathBuf>) -> Self {
        let kept = CachedProbe { tried, llvm: self.llvm.clone(), versions: self.versions.clone() };
        let text = envelope::seal(SCHEMA, &self.key(), &kept).map_err(std::io::Error::from);
        text.and_then(|text| files::replace(&Self::place(site), text.as_bytes())).ok();
        self
    }

    fn place(site: &EngineRoot) -> PathBuf {
        site.root().join("probes").join("mitsuba.json")
    }

    /// Which files, and how they were tried.
    fn key(&self) -> String {
        let how = hexadecimal(&Sha256::digest(PROBE));
        format!("{} {}", self.fingerprint, &how[..16])
    }

    pub(super) fn is_of(&self, site: &EngineRoot) -> bool {
        self.root == site.root()
    }

    #[cfg(test)]
    pub(super) fn without_llvm(self) -> Self {
        Self { llvm: None, ..self }
    }

    pub(super) fn version(&self) -> Version {
        let Versions { mitsuba, drjit, llvm, .. } = &self.versions;
        let llvm = llvm.as_ref().map_or("no usable LLVM".to_owned(), |v| format!("LLVM {v}"));
        let text = format!("{mitsuba} (Dr.Jit {drjit}, {llvm})");
        Version { text, fingerprint: self.fingerprint.clone() }
    }

    pub(super) fn command_by_hand(&self, site: &EngineRoot) -> String {
        let run = ATOMIC.add_to(by_hand(&self.python), site).args(["mitsuba_read.py", JOB_FILE]);
        match &self.llvm {
            Some(library) if self.versions.variant == "llvm_ad_rgb" => {
                run.args(["--variant", "llvm_ad_rgb"]).env("DRJIT_LIBLLVM_PATH", library)
            }
            Some(library) => run.env("DRJIT_LIBLLVM_PATH", library),
            None => run.args(["--variant", "scalar_rgb"]),
        }
        .command_line_with_env()
    }

    /// The command of a driver that waits for exported jobs, and a remark if it cannot use the variant asked for.
    pub(super) fn invocation(&self, workbench: &JobDir, settings: &Settings) -> (Invocation, Option<String>) {
        // Neither the user's Python nor its packages; scene folders stay as exported.
        let isolated = workbench.invoke(&self.python).args(["-I", "-B"]);
        let run = isolated.args(["mitsuba_read.py", "--serve"]);
        let run = with_kernels(run, &workbench.site);
        match &self.llvm {
            Some(library) => {
                let run = run.env("DRJIT_LIBLLVM_PATH", library);
                let tried = &self.versions.variant;
                if settings.variant == "llvm_ad_mono" && tried != settings.variant {
                    let remark =
                        format!("it has no {}, so {tried} ran, which is the same in grey scenes", settings.variant);
                    return (run.args(["--variant", tried]), Some(remark));
                }
                (run, None)
            }
            None if settings.variant.starts_with("llvm") => {
                let remark = format!(
                    "no libLLVM of version 17 or later works here, so scalar_rgb ran instead of {}, about 500 times slower",
                    settings.variant
                );
                (run.args(["--variant", "scalar_rgb"]), Some(remark))
            }
            None => (run, None),
        }
    }
}

/// With a place for the kernels that Dr.Jit compiles, so that each is compiled once.
fn with_kernels(run: Invocation, site: &EngineRoot) -> Invocation {
    let run = ATOMIC.add_to(run, site);
    let folder = site.kernels();
    // Where it cannot be made they are compiled each time, and Dr.Jit says so in the log.
    std::fs::create_dir_all(&folder).ok();
    // Releases of Dr.Jit before 1.5 know `~/.drjit` only, and end where they cannot make it.
    run.env("DRJIT_CACHE_DIR", &folder).env("HOME", &folder).may_write(folder)
}

fn probe(site: &EngineRoot, python: &Path, variant: &str, llvm: Option<&Path>) -> Result<Versions, String> {
    let folder = tempfile::tempdir().map_err(|e| format!("no temporary folder: {e}"))?;
    let mut run = Invocation::new(python, folder.path(), PROBE_LIMIT, folder.path().join("log"))
        .args(["-I", "-", variant])
        .stdin(PROBE.into());
    run = with_kernels(run, site);
    if let Some(library) = llvm {
        run = run.env("DRJIT_LIBLLVM_PATH", library);
    }
    let finished = run.run().map_err(|e| e.to_string())?;
    // Mitsuba may log to standard output first: the answer is the last line.
    let text = String::from_utf8_lossy(&finished.stdout);
    let answer = text.lines().last().unwrap_or_default();
    serde_json::from_str(answer).map_err(|e| format!("the probe of Mitsuba answered `{answer}`: {e}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_site_without_python_says_what_to_run() {
        let folder = tempfile::tempdir().unwrap();
        let absent = Backend::find(&EngineRoot::at(folder.path())).unwrap_err();
        assert!(absent.to_string().contains("luxproof engines install"), "{absent}");
    }

    #[test]
    fn every_release_of_dr_jit_finds_a_folder_for_its_kernels() {
        let folder = tempfile::tempdir().unwrap();
        let site = EngineRoot::at(folder.path());
        let run = with_kernels(Invocation::new("python", folder.path(), PROBE_LIMIT, folder.path().join("log")), &site);
        for variable in ["DRJIT_CACHE_DIR", "HOME"] {
            let value = run.env.iter().find(|(name, _)| name == variable).map(|(_, value)| PathBuf::from(value));
            assert_eq!(value, Some(site.kernels()), "{variable}");
        }
        assert!(site.kernels().is_dir());
    }

    #[test]
    fn what_a_probe_found_is_kept_and_holds_for_the_same_files_and_libraries_alone() {
        let folder = tempfile::tempdir().unwrap();
        let (site, python, library) =
            (EngineRoot::at(folder.path()), folder.path().join("python"), folder.path().join("llvm"));
        std::fs::write(&python, "one").unwrap();
        std::fs::write(&library, "one").unwrap();
        let versions = Versions {
            mitsuba: "3.9".to_owned(),
            drjit: "1.5".to_owned(),
            llvm: Some("19".to_owned()),
            variant: "scalar_rgb".to_owned(),
        };
        let found = Backend::new(&site, python.clone(), Some(library.clone()), versions);
        let tried = vec![library.clone()];
        let load = |tried: &[PathBuf]| Backend::load_cached(&site, &python, tried);
        assert_eq!(load(&tried), None);
        let found = found.keep(&site, tried.clone());
        assert_eq!(load(&tried), Some(found));
        assert_eq!(load(&[folder.path().join("better"), library.clone()]), None);
        std::fs::write(&library, "two").unwrap();
        assert_eq!(load(&tried), None, "another library in its place");
    }
}
