//! `luxproof bundle`: a finished run with all that it takes to make it again, in a folder or a zip.

use luxproof_spec::Trust;
use std::path::{Path, PathBuf};

use clap::Args;
use miette::{IntoDiagnostic, Report as Diagnostic, miette};

use crate::bundle::{self, BundleError};
use luxproof_console::diagnose;
use luxproof_console::{complain, print};
use luxproof_model::Exit;

#[derive(Debug, Args)]
pub(super) struct BundleArgs {
    /// Folder of a run; its specs must still be in place
    run: PathBuf,
    /// The folder or .zip to write [default: <folder of the run>-bundle]
    #[arg(long, value_name = "FILE|DIR")]
    out: Option<PathBuf>,
    /// Licence of the bundle, as a name or an address [default: none]
    #[arg(long, value_name = "TEXT|URL")]
    licence: Option<String>,
}

pub(super) fn bundle(args: &BundleArgs, trust: Trust) -> Result<Exit, Diagnostic> {
    let out = args.out.clone().unwrap_or_else(|| default_folder(&args.run));
    let made = bundle::make(&args.run, &out, args.licence.as_deref(), trust).map_err(refused)?;
    let bundle::BundleSummary { place, sha256, files, bytes, not_bundled, .. } = made;
    print(&format!("{}\n", place.display()))?;
    if !not_bundled.is_empty() {
        let mut names: Vec<String> = not_bundled.iter().take(SHOWN).map(|file| file.display().to_string()).collect();
        names.extend((not_bundled.len() > SHOWN).then(|| format!("and {} more", not_bundled.len() - SHOWN)));
        complain(&format!(
            "not bundled, as no command names them and no program imports them: {}; where a program needs one, name it in \
             `engines.NAME.depends_on` and run the spec again",
            names.join(", ")
        ));
    }
    complain(&format!("{files} files, {} kB, SHA-256 {sha256}", bytes.div_ceil(1000)));
    complain(&format!("next: luxproof reproduce {}", place.display()));
    Ok(Exit::Passed)
}

/// More files that are left out are counted, not named.
const SHOWN: usize = 20;

/// A folder beside the run's.
fn default_folder(run: &Path) -> PathBuf {
    let whole = std::path::absolute(run).unwrap_or_default();
    let name = whole.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    run.parent().unwrap_or(Path::new("")).join(format!("{name}-bundle"))
}

/// Why there is no bundle, or none that can be used.
pub(super) fn refused(error: BundleError) -> Diagnostic {
    match error {
        BundleError::Spec(faults) => diagnose(faults),
        BundleError::Broken { .. } => {
            miette!(help = "fetch it again: nothing of it was run", "{error}")
        }
        other => Err::<(), _>(other).into_diagnostic().err().unwrap_or_else(|| miette!("there is no bundle")),
    }
}
