//! `luxproof init`: a first spec that runs, commented, with a photometric file beside it; made of options, or of answers.

use std::io::{BufRead, IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::Args;
use glam::DVec3;
use luminaire::photometry;
use miette::{IntoDiagnostic, Report as Diagnostic, WrapErr};

use super::diagnostic::{diagnose, warn};
use super::first::{First, box_room, downlight, walls};
use super::photometry::spec_error;
use super::{complain, print};
use crate::import::Place;
use crate::report::Exit;
use crate::report::words::trimmed;
use crate::spec::{Case, Trust, doubts, suite};

const ABOUT: &str = "A first spec of luxproof: a room, a luminaire, a plane of meters, and what is measured.";

const OBSTACLES: &str = "
# Bodies are opaque and diffuse: boxes, or meshes of Wavefront OBJ files.
# obstacles:
#   - box: {min_m: [1, 1, 0], max_m: [2.6, 1.8, 0.75], reflectance: 0.5}
";

#[derive(Debug, Args)]
pub(super) struct InitArgs {
    /// The spec to write
    #[arg(default_value = "first.yaml", value_name = "FILE")]
    spec: PathBuf,
    /// What the case is, in a line
    #[arg(long)]
    title: Option<String>,
    /// Length, width and height of the room in metres
    #[arg(long, value_name = "X,Y,Z")]
    size: Option<Numbers>,
    /// Reflectances of floor, walls and ceiling, from 0 to 1
    #[arg(long, value_name = "F,W,C")]
    reflectance: Option<Numbers>,
    /// Photometric file of the luminaire, which is copied beside the spec [default: one that is made for it]
    #[arg(long, value_name = "FILE")]
    photometry: Option<PathBuf>,
    /// Ask nothing: what is not given is as usual
    #[arg(long)]
    yes: bool,
    /// Replace files that are there
    #[arg(long)]
    force: bool,
}

/// Three numbers, comma by comma.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Numbers([f64; 3]);

impl FromStr for Numbers {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers: Result<Vec<f64>, _> =
            text.split([',', 'x', ' ']).filter(|w| !w.is_empty()).map(str::parse).collect();
        let numbers = numbers.map_err(|e| format!("`{text}` holds no three numbers: {e}"))?;
        let three: [f64; 3] =
            numbers.try_into().map_err(|_| format!("`{text}` holds no three numbers, such as 6,4,3"))?;
        let sound = three.iter().all(|n| n.is_finite() && *n >= 0.0);
        if sound { Ok(Self(three)) } else { Err(format!("`{text}` holds a number below 0")) }
    }
}

pub(super) fn init(args: &InitArgs) -> Result<Exit, Diagnostic> {
    let asks = !args.yes && std::io::stdin().is_terminal();
    let title = answer(asks, args.title.clone(), "What is the case, in a line?", "a first room")?;
    let size = answer(asks, args.size, "Length, width and height of the room in metres?", "6,4,3")?;
    let reflectance = answer(asks, args.reflectance, "Reflectances of floor, walls and ceiling?", "0.2,0.5,0.7")?;
    let own = match (&args.photometry, asks) {
        (None, true) => {
            let named = answer(true, None::<String>, "Photometric file of the luminaire (empty: one is made)?", "")?;
            Some(PathBuf::from(named)).filter(|path| !path.as_os_str().is_empty())
        }
        (named, _) => named.clone(),
    };
    let folder = args.spec.parent().unwrap_or(Path::new("")).to_owned();
    let (lamp, bytes) = match &own {
        Some(path) => {
            photometry::read_file(path).map_err(|error| diagnose(spec_error(&error)))?;
            let bytes = std::fs::read(path).into_diagnostic().wrap_err_with(|| path.display().to_string())?;
            (path.file_name().map(PathBuf::from).unwrap_or_default(), bytes)
        }
        None => (PathBuf::from(super::first::DOWNLIGHT), downlight().into_bytes()),
    };
    let text = spec(&args.spec, &title, size.0, reflectance.0, &lamp)?;
    let lamp = folder.join(lamp);
    let is_in_place = own.as_ref().is_some_and(|own| own.canonicalize().ok() == lamp.canonicalize().ok());
    for path in [&args.spec, &lamp].into_iter().filter(|path| path.exists() && !args.force) {
        if !(is_in_place && *path == lamp) {
            return Err(miette::miette!(
                help = "name another file, or give --force",
                "{} is there already",
                path.display()
            ));
        }
    }
    if !folder.as_os_str().is_empty() {
        std::fs::create_dir_all(&folder).into_diagnostic().wrap_err_with(|| folder.display().to_string())?;
    }
    let write = |path: &Path, bytes: &[u8]| {
        std::fs::write(path, bytes).into_diagnostic().wrap_err_with(|| path.display().to_string())
    };
    if !is_in_place {
        write(&lamp, &bytes)?;
    }
    write(&args.spec, text.as_bytes())?;
    let cases: Vec<Case> = suite(std::slice::from_ref(&args.spec), Trust::Own).map_err(diagnose)?;
    warn(&doubts(&cases));
    print(&format!("{}\n{}\n", args.spec.display(), lamp.display()))?;
    complain(&format!("next: luxproof run {}", args.spec.display()));
    Ok(Exit::Passed)
}

/// What was given, or is answered, or else is usual.
fn answer<T: FromStr<Err: std::fmt::Display>>(
    asks: bool,
    given: Option<T>,
    question: &str,
    usual: &str,
) -> Result<T, Diagnostic> {
    let read = |text: &str| text.parse::<T>().map_err(|error| miette::miette!("{error}"));
    if let Some(given) = given {
        return Ok(given);
    }
    if !asks {
        return read(usual);
    }
    let mut err = std::io::stderr().lock();
    loop {
        let offered = if usual.is_empty() { String::new() } else { format!(" [{usual}]") };
        write!(err, "{question}{offered} ").and_then(|()| err.flush()).into_diagnostic()?;
        let mut line = String::new();
        let is_end = std::io::stdin().lock().read_line(&mut line).into_diagnostic()? == 0;
        let line = if line.trim().is_empty() { usual } else { line.trim() };
        match read(line) {
            Err(error) if !is_end => writeln!(err, "{error}").into_diagnostic()?,
            read => return read,
        }
    }
}

/// The spec's text: one luminaire below the middle of the ceiling.
fn spec(
    path: &Path,
    title: &str,
    [x, y, z]: [f64; 3],
    [floor, each_wall, ceiling]: [f64; 3],
    lamp: &Path,
) -> Result<String, Diagnostic> {
    if x.min(y).min(z) <= 0.0 || floor.max(each_wall).max(ceiling) > 1.0 {
        return Err(miette::miette!("a room has an extent along every axis, and reflectances lie between 0 and 1"));
    }
    let size_m = DVec3::new(x, y, z);
    let room = box_room(
        size_m.to_array().map(|extent| trimmed(extent, 4)),
        [trimmed(floor, 4), walls([each_wall; 4], |rho| trimmed(rho, 4)), trimmed(ceiling, 4)],
    );
    let lamp_m = DVec3::new(x / 2.0, y / 2.0, z - (0.2 * z).min(0.3));
    let first = First {
        about: ABOUT,
        file: path,
        title,
        room: &room,
        obstacles: OBSTACLES,
        photometry: lamp,
        place: Place { lamp_m, low_m: DVec3::ZERO, high_m: size_m },
    };
    Ok(first.text())
}
