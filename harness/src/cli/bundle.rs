//! `luxproof bundle`: a finished run with all that it takes to make it again, in a folder or a zip.

use std::path::{Path, PathBuf};

use clap::Args;
use miette::{IntoDiagnostic, Report as Diagnostic, miette};

use super::diagnostic::diagnose;
use super::{complain, print};
use crate::bundle::{self, BundleError};
use crate::report::Exit;

#[derive(Debug, Args)]
pub(super) struct BundleArgs {
    /// Folder of a run; its specs are looked for where they were named, from here
    run: PathBuf,
    /// The folder to write, or a .zip [default: the run's folder with -bundle behind its name]
    #[arg(long, value_name = "FILE|DIR")]
    out: Option<PathBuf>,
    /// Under which licence it may be passed on, as a text or an address [default: none is given]
    #[arg(long, value_name = "TEXT|URL")]
    licence: Option<String>,
}

pub(super) fn bundle(args: &BundleArgs) -> Result<Exit, Diagnostic> {
    let out = args.out.clone().unwrap_or_else(|| beside(&args.run));
    let made = bundle::make(&args.run, &out, args.licence.as_deref()).map_err(refused)?;
    let bundle::Made { place, sha256, files, bytes } = made;
    print(&format!("{}\n", place.display()))?;
    complain(&format!("{files} files, {} kB, SHA-256 {sha256}", bytes.div_ceil(1000)));
    complain(&format!("next: luxproof reproduce {}", place.display()));
    Ok(Exit::Passed)
}

/// A folder beside the run's.
fn beside(run: &Path) -> PathBuf {
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
