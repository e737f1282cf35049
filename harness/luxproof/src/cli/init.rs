//! `luxproof init`: writes a first spec with comments and a photometric file, from options or from answers to questions.

use std::io::{BufRead, IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::Args;
use glam::DVec3;
use miette::{IntoDiagnostic, Report as Diagnostic, WrapErr};

use super::spec_template::{DOWNLIGHT, DeskMeters, First, box_room, downlight, walls};
use luxproof_console::{complain, print};
use luxproof_console::{diagnose, warn};
use luxproof_model::Exit;
use luxproof_photometry::{Details, Photometry};
use luxproof_photometry_tool::spec_error;
use luxproof_report::words::trimmed;
use luxproof_scene_import::Place;
use luxproof_spec::{Case, Trust, find_lints, suite};

const ABOUT: &str = "A first spec of luxproof: a room, a luminaire, a plane of meters, and what is measured.";

const OBSTACLES: &str = "
# Bodies are opaque and diffuse: boxes, or meshes of Wavefront OBJ files.
# obstacles:
#   - box: {min_m: [1, 1, 0], max_m: [2.6, 1.8, 0.7], reflectance: 0.5}
";

const MOUNTING_QUESTION: &str =
    "Is the luminaire `recessed`, or how many metres below the ceiling (empty: by its file)?";

/// The height of desks in EN 12464-1.
const DESK_HEIGHT_M: f64 = 0.75;
/// Meters lie at most at this part of the room's height.
const MAX_DESK_PART: f64 = 0.4;
/// The margin along the walls that EN 12464-1 leaves out.
const MARGIN_M: f64 = 0.5;
/// A room narrower than this keeps its margin for the meters.
const MIN_SIDE_WITH_MARGIN_M: f64 = 4.0 * MARGIN_M;

/// A luminaire that sends more of its flux upwards hangs.
const MAX_UPWARD_FLUX_AT_CEILING: f64 = 0.05;
/// How far below the ceiling such a luminaire hangs.
const PENDANT_DROP_M: f64 = 0.5;
/// How far below the ceiling any other luminaire is, where its file states no height.
const CEILING_DROP_M: f64 = 0.1;
/// A luminaire is at most this part of the room's height below the ceiling.
const MAX_DROP_PART: f64 = 0.2;

#[derive(Debug, Args)]
pub(super) struct InitArgs {
    /// The spec to write
    #[arg(default_value = "first.yaml", value_name = "FILE")]
    spec: PathBuf,
    /// Title of the spec
    #[arg(long)]
    title: Option<String>,
    /// Length, width and height of the room in metres
    #[arg(long, value_name = "X,Y,Z")]
    size: Option<RoomSize>,
    /// Reflectances of floor, walls and ceiling, from 0 to 1
    #[arg(long, value_name = "F,W,C")]
    reflectance: Option<Reflectances>,
    /// Photometric file, copied next to the spec [default: a downlight]
    ///
    /// The mounting height, the model and the meters follow from the file and the room.
    #[arg(long, value_name = "FILE")]
    photometry: Option<PathBuf>,
    /// `recessed`, or metres below the ceiling [default: by the file]
    #[arg(long, value_name = "recessed|METRES")]
    mounting: Option<Mounting>,
    /// Ask no questions; use defaults
    #[arg(long)]
    yes: bool,
    /// Replace existing files
    #[arg(long)]
    force: bool,
}

/// Where the luminaire is.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Mounting {
    /// As the file suggests: a luminaire that shines upwards hangs, any other is below the ceiling.
    ByFile,
    /// In the plane of the ceiling.
    Recessed,
    /// So many metres below the ceiling.
    Below(f64),
}

impl FromStr for Mounting {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match (text, text.parse()) {
            ("", _) => Ok(Self::ByFile),
            ("recessed", _) => Ok(Self::Recessed),
            (_, Ok(drop_m)) if f64::is_finite(drop_m) && drop_m > 0.0 => Ok(Self::Below(drop_m)),
            _ => Err(format!("`{text}` is neither `recessed` nor metres below the ceiling, such as 0.5")),
        }
    }
}

/// The lengths of a room along x, y and z, in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
struct RoomSize([f64; 3]);

impl FromStr for RoomSize {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let size = three_numbers(text, "6,4,3")?;
        let is_room = size.iter().all(|length| *length > 0.0);
        if is_room { Ok(Self(size)) } else { Err(format!("`{text}` is no room: each length is greater than 0")) }
    }
}

/// The reflectances of floor, walls and ceiling.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Reflectances([f64; 3]);

impl FromStr for Reflectances {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let reflectances = three_numbers(text, "0.2,0.5,0.7")?;
        if reflectances.iter().all(|rho| (0.0..=1.0).contains(rho)) {
            return Ok(Self(reflectances));
        }
        let hint = if reflectances.iter().any(|rho| *rho > 1.0) { "; write 20 % as 0.2" } else { "" };
        Err(format!("`{text}`: reflectances lie between 0 and 1{hint}"))
    }
}

/// Three finite numbers with commas, spaces or `x` between them.
fn three_numbers(text: &str, example: &str) -> Result<[f64; 3], String> {
    let words = text.split([',', 'x', ' ']).filter(|word| !word.is_empty());
    let numbers: Result<Vec<f64>, _> = words.map(str::parse).collect();
    let three = numbers.ok().and_then(|numbers| <[f64; 3]>::try_from(numbers).ok());
    three
        .filter(|numbers| numbers.iter().all(|number| number.is_finite()))
        .ok_or_else(|| format!("`{text}` is not three numbers, such as {example}"))
}

/// The luminaire of the spec: its file, and where it is.
struct ChosenLuminaire {
    /// The file that is copied; none for the made-up downlight.
    source: Option<PathBuf>,
    /// The name next to the spec.
    name: PathBuf,
    bytes: Vec<u8>,
    photometry: Option<Photometry>,
}

pub(super) fn init(args: &InitArgs) -> Result<Exit, Diagnostic> {
    let asks = !args.yes && std::io::stdin().is_terminal();
    refuse_existing(&args.spec, args)?;
    check_folder(&args.spec)?;
    let given = match &args.photometry {
        Some(path) => Some(own_luminaire(path, args)?),
        None => None,
    };
    let title = answer(asks, args.title.clone(), "What is the case, in a line?", "a first room")?;
    let RoomSize(size) = answer(asks, args.size, "Length, width and height of the room in metres?", "6,4,3")?;
    let Reflectances(reflectance) =
        answer(asks, args.reflectance, "Reflectances of floor, walls and ceiling?", "0.2,0.5,0.7")?;
    let luminaire = match given {
        Some(luminaire) => luminaire,
        None if asks => ask_luminaire(args, size)?,
        None => made_up_luminaire(size, args)?,
    };
    fits(&luminaire, size).map_err(|error| miette::miette!("{error}"))?;
    let text = match args.mounting {
        None if asks => ask(MOUNTING_QUESTION, "", |mounting| {
            let text = spec(&args.spec, &title, (size, reflectance), &luminaire, mounting.parse()?);
            text.map_err(|error| format!("{error:?}"))
        })?,
        mounting => spec(&args.spec, &title, (size, reflectance), &luminaire, mounting.unwrap_or(Mounting::ByFile))?,
    };
    let folder = folder_of(&args.spec);
    if !folder.as_os_str().is_empty() {
        std::fs::create_dir_all(&folder).into_diagnostic().wrap_err_with(|| folder.display().to_string())?;
    }
    let lamp = folder.join(&luminaire.name);
    if !is_same_file(luminaire.source.as_deref(), &lamp) {
        write_file(&lamp, &luminaire.bytes)?;
    }
    write_file(&args.spec, text.as_bytes())?;
    let cases: Vec<Case> = suite(std::slice::from_ref(&args.spec), Trust::Own).map_err(diagnose)?;
    warn(&find_lints(&cases));
    print(&format!("{}\n{}\n", args.spec.display(), lamp.display()))?;
    complain(&format!("next: luxproof run {}", args.spec.display()));
    Ok(Exit::Passed)
}

/// The folder of the spec; empty for the current one.
fn folder_of(spec: &Path) -> PathBuf {
    spec.parent().unwrap_or(Path::new("")).to_owned()
}

/// Whether a file already lies where it would be copied to.
fn is_same_file(source: Option<&Path>, place: &Path) -> bool {
    source.is_some_and(|source| source.canonicalize().ok().is_some_and(|path| place.canonicalize().ok() == Some(path)))
}

/// Refuses to replace a file.
fn refuse_existing(path: &Path, args: &InitArgs) -> Result<(), Diagnostic> {
    if path.exists() && !args.force {
        let help = "name another file, or give --force";
        return Err(miette::miette!(help = help, "{} is there already", path.display()));
    }
    Ok(())
}

/// Fails where the spec cannot be written, before any question is asked.
fn check_folder(spec: &Path) -> Result<(), Diagnostic> {
    let folder = std::path::absolute(spec).into_diagnostic()?;
    let existing = folder.ancestors().skip(1).find(|above| above.exists()).unwrap_or(Path::new("/"));
    let written = tempfile::tempfile_in(existing).map(drop);
    written.into_diagnostic().wrap_err_with(|| format!("{} cannot be written", spec.display()))
}

/// Reads a user's photometric file, and checks the place that it is copied to.
fn own_luminaire(path: &Path, args: &InitArgs) -> Result<ChosenLuminaire, Diagnostic> {
    let photometry = luxproof_photometry::read_file(path).map_err(|error| diagnose(spec_error(&error)))?;
    let bytes = std::fs::read(path).into_diagnostic().wrap_err_with(|| path.display().to_string())?;
    let name = path.file_name().map(PathBuf::from).unwrap_or_default();
    let place = folder_of(&args.spec).join(&name);
    if !is_same_file(Some(path), &place) {
        refuse_existing(&place, args)?;
    }
    Ok(ChosenLuminaire { source: Some(path.to_owned()), name, bytes, photometry: Some(photometry) })
}

/// The made-up downlight.
fn made_up_luminaire([x, y, _]: [f64; 3], args: &InitArgs) -> Result<ChosenLuminaire, Diagnostic> {
    let name = PathBuf::from(DOWNLIGHT);
    refuse_existing(&folder_of(&args.spec).join(&name), args)?;
    Ok(ChosenLuminaire { source: None, name, bytes: downlight(0.5 * x.min(y)).into_bytes(), photometry: None })
}

/// Asks for a photometric file until one can be read and fits into the room.
fn ask_luminaire(args: &InitArgs, size: [f64; 3]) -> Result<ChosenLuminaire, Diagnostic> {
    ask("Photometric file of the luminaire (empty: one is made)?", "", |text| {
        let luminaire = match text {
            "" => made_up_luminaire(size, args),
            path => own_luminaire(Path::new(path), args),
        };
        let luminaire = luminaire.map_err(|error| format!("{error:?}"))?;
        fits(&luminaire, size).map(|()| luminaire)
    })
}

/// Checks that the luminous opening of a file fits into the plan of the room.
fn fits(luminaire: &ChosenLuminaire, [x, y, z]: [f64; 3]) -> Result<(), String> {
    let Some(photometry) = &luminaire.photometry else { return Ok(()) };
    let [width, length, height] = photometry.opening.bounding_box_m();
    if width < y && length < x && height < MAX_DROP_PART * z {
        return Ok(());
    }
    Err(format!(
        "{}: its luminous opening of {} x {} x {} m does not fit into a room of {x} x {y} x {z} m",
        luminaire.name.display(),
        trimmed(length, 3),
        trimmed(width, 3),
        trimmed(height, 3)
    ))
}

/// Writes a file; the error names it.
fn write_file(path: &Path, bytes: &[u8]) -> Result<(), Diagnostic> {
    std::fs::write(path, bytes).into_diagnostic().wrap_err_with(|| path.display().to_string())
}

/// The value of an option; without one the answer of the user, or else the usual value.
fn answer<T: FromStr<Err: std::fmt::Display>>(
    asks: bool,
    given: Option<T>,
    question: &str,
    usual: &str,
) -> Result<T, Diagnostic> {
    if let Some(given) = given {
        return Ok(given);
    }
    let parse = |text: &str| text.parse::<T>().map_err(|error| error.to_string());
    if asks { ask(question, usual, parse) } else { parse(usual).map_err(|error| miette::miette!("{error}")) }
}

/// Asks a question until its answer is valid. An empty answer is the usual one.
fn ask<T>(question: &str, usual: &str, check: impl Fn(&str) -> Result<T, String>) -> Result<T, Diagnostic> {
    let offered = if usual.is_empty() { String::new() } else { format!(" [{usual}]") };
    loop {
        let mut err = std::io::stderr().lock();
        write!(err, "{question}{offered} ").and_then(|()| err.flush()).into_diagnostic()?;
        drop(err);
        let mut line = String::new();
        let is_end = std::io::stdin().lock().read_line(&mut line).into_diagnostic()? == 0;
        let line = if line.trim().is_empty() { usual } else { line.trim() };
        match check(line) {
            Ok(value) => return Ok(value),
            Err(error) if is_end => return Err(miette::miette!("{error}")),
            Err(error) => complain(error.trim_end()),
        }
    }
}

/// How far below the ceiling the photometric centre of a luminaire is, in metres.
fn drop_m(photometry: &Photometry, height_m: f64) -> f64 {
    let [.., opening_m] = photometry.opening.bounding_box_m();
    let distribution = &photometry.distribution;
    let upwards = distribution.flux_between(90.0, 180.0).value() / distribution.flux().value();
    let stated_m = match &photometry.details {
        Details::Eulumdat(details) => details.luminaire_mm[2] / 1000.0,
        _ => 0.0,
    };
    let usual_m = if upwards > MAX_UPWARD_FLUX_AT_CEILING {
        PENDANT_DROP_M
    } else if stated_m > 0.0 {
        stated_m
    } else {
        CEILING_DROP_M
    };
    // The opening itself needs room.
    usual_m.min(MAX_DROP_PART * height_m).max(0.51 * opening_m)
}

/// The spec's text: one luminaire at the middle of the ceiling or below it.
fn spec(
    path: &Path,
    title: &str,
    ([x, y, z], [floor, each_wall, ceiling]): ([f64; 3], [f64; 3]),
    luminaire: &ChosenLuminaire,
    mounting: Mounting,
) -> Result<String, Diagnostic> {
    let size_m = DVec3::new(x, y, z);
    let room = box_room(
        size_m.to_array().map(|extent| trimmed(extent, 4)),
        [trimmed(floor, 4), walls([each_wall; 4], |rho| trimmed(rho, 4)), trimmed(ceiling, 4)],
    );
    let (usual_drop_m, desk) = match &luminaire.photometry {
        Some(photometry) => (drop_m(photometry, z), desk_by_en_12464([x, y, z])),
        None => ((MAX_DROP_PART * z).min(0.3), DeskMeters::Coarse),
    };
    let drop_m = match mounting {
        Mounting::ByFile => usual_drop_m,
        Mounting::Recessed => 0.0,
        Mounting::Below(drop_m) => drop_m,
    };
    if drop_m >= z {
        return Err(miette::miette!("--mounting {drop_m}: the room is only {z} m high"));
    }
    let lamp_m = DVec3::new(x / 2.0, y / 2.0, z - drop_m);
    let first = First {
        about: ABOUT,
        file: path,
        title,
        room: &room,
        obstacles: OBSTACLES,
        photometry: &luminaire.name,
        place: Place { lamp_m, low_m: DVec3::ZERO, high_m: size_m },
        model: None,
        is_recessed: mounting == Mounting::Recessed,
        desk,
    };
    // Whatever is wrong with the spec shows before a file is written.
    let model = model_by_file(&first, &luminaire.bytes)?;
    let model = luminaire.photometry.as_ref().map(|_| model);
    Ok(First { model, ..first }.text())
}

/// Meters at desk height as fine as EN 12464-1 requires, with its margin where the room is wide enough.
fn desk_by_en_12464([x, y, z]: [f64; 3]) -> DeskMeters {
    let margin_m = if x.min(y) < MIN_SIDE_WITH_MARGIN_M { 0.0 } else { MARGIN_M };
    DeskMeters::ByEn12464 { floor_m: [x, y], height_m: DESK_HEIGHT_M.min(MAX_DESK_PART * z), margin_m }
}

/// What `model: auto` chooses for the luminaire of a spec, and why.
fn model_by_file(first: &First<'_>, photometric_file: &[u8]) -> Result<String, Diagnostic> {
    let folder = tempfile::tempdir().into_diagnostic()?;
    let spec = folder.path().join("spec.yaml");
    write_file(&folder.path().join(first.photometry), photometric_file)?;
    write_file(&spec, first.text().as_bytes())?;
    let cases = suite(std::slice::from_ref(&spec), Trust::Own).map_err(diagnose)?;
    let choice = cases.first().and_then(|case| case.luminaire_models.first());
    Ok(choice.map(|choice| format!("{} here: {}", choice.model, choice.reason())).unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_are_three_numbers_in_their_ranges() {
        for size in ["6,4,3", "6 x 4 x 3", "6 4 3"] {
            assert_eq!(size.parse(), Ok(RoomSize([6.0, 4.0, 3.0])));
        }
        assert_eq!("6,4".parse::<RoomSize>().unwrap_err(), "`6,4` is not three numbers, such as 6,4,3");
        assert_eq!("6,4,0".parse::<RoomSize>().unwrap_err(), "`6,4,0` is no room: each length is greater than 0");
        assert_eq!("0.2,0.5,0.7".parse(), Ok(Reflectances([0.2, 0.5, 0.7])));
        let error = "20,50,70".parse::<Reflectances>().unwrap_err();
        assert_eq!(error, "`20,50,70`: reflectances lie between 0 and 1; write 20 % as 0.2");
    }

    #[test]
    fn margins_are_left_out_where_the_room_is_wide_enough() {
        let margin = |size| match desk_by_en_12464(size) {
            DeskMeters::ByEn12464 { margin_m, height_m, .. } => (margin_m, height_m),
            DeskMeters::Coarse | DeskMeters::Points(_) => (f64::NAN, f64::NAN),
        };
        assert_eq!(margin([5.0, 4.0, 2.8]), (0.5, 0.75));
        assert_eq!(margin([5.0, 1.9, 1.0]), (0.0, 0.4));
    }
}
