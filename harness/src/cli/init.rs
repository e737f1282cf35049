//! `luxproof init`: a first spec that runs, commented, with a photometric file beside it; made of options, or of answers.

use std::io::{BufRead, IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::Args;
use luminaire::photometry;
use miette::{IntoDiagnostic, Report as Diagnostic, WrapErr};

use super::diagnostic::{diagnose, warn};
use super::photometry::spec_error;
use super::{complain, print};
use crate::report::Exit;
use crate::spec::{Case, Trust, doubts, suite};

/// The spec, its values in braces.
const SPEC: &str = include_str!("first.yaml");

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
        None => (PathBuf::from("downlight.ies"), downlight().into_bytes()),
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

/// The spec's text: one luminaire below the middle of the ceiling, desks of half a metre and more to a step.
fn spec(
    path: &Path,
    title: &str,
    [x, y, z]: [f64; 3],
    [floor, walls, ceiling]: [f64; 3],
    lamp: &Path,
) -> Result<String, Diagnostic> {
    if x.min(y).min(z) <= 0.0 || floor.max(walls).max(ceiling) > 1.0 {
        return Err(miette::miette!("a room has an extent along every axis, and reflectances lie between 0 and 1"));
    }
    let counts = [x, y].map(|extent| extent.floor().clamp(3.0, 20.0));
    let step = [x / counts[0], y / counts[1]];
    let number = |value: f64| crate::report::words::trimmed(value, 4);
    let height = z - (0.2 * z).min(0.3);
    let desk = 0.75_f64.min(0.4 * z);
    let quoted = |text: &str| serde_json::to_string(text).unwrap_or_default();
    let file = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let values = [
        ("file", file),
        ("title", quoted(title)),
        ("photometry", quoted(&lamp.to_string_lossy())),
        ("x", number(x)),
        ("y", number(y)),
        ("z", number(z)),
        ("floor", number(floor)),
        ("walls", number(walls)),
        ("ceiling", number(ceiling)),
        ("cx", number(x / 2.0)),
        ("cy", number(y / 2.0)),
        ("cz", number(height)),
        ("ox", number(step[0] / 2.0)),
        ("oy", number(step[1] / 2.0)),
        ("dx", number(step[0])),
        ("dy", number(step[1])),
        ("nx", number(counts[0])),
        ("ny", number(counts[1])),
        ("desk", number(desk)),
        ("distance", "10".to_owned()),
    ];
    Ok(values.iter().fold(SPEC.to_owned(), |text, (name, value)| text.replace(&format!("{{{name}}}"), value)))
}

/// A Lambertian downlight of 1000 cd straight down: 3141.6 lm in an opening of 0.6 m by 0.6 m.
fn downlight() -> String {
    let gammas: Vec<f64> = (0..=36).map(|k| 2.5 * f64::from(k)).collect();
    let list = |values: &mut dyn Iterator<Item = f64>| {
        values
            .map(|v| crate::report::words::trimmed(v, 4))
            .collect::<Vec<_>>()
            .chunks(10)
            .map(|c| c.join(" "))
            .collect::<Vec<_>>()
            .join("\n")
    };
    let candela = list(&mut gammas.iter().map(|gamma| 1000.0 * gamma.to_radians().cos()));
    format!(
        "IESNA:LM-63-2002\n[TEST] none: made by luxproof init\n[MANUFAC] nobody\n[LUMINAIRE] Lambertian downlight, 1000 cd\nTILT=NONE\n\
         1 -1 1 {} 1 1 2 0.6 0.6 0\n1 1 0\n{}\n0\n{candela}\n",
        gammas.len(),
        list(&mut gammas.iter().copied())
    )
}
