//! Spec -> Case: reads the files that a spec names, checks what the shape alone cannot, and builds the scene.

use luxproof_process::files;
use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::path::{Path, PathBuf};

use luxproof_scene::enclosure::Enclosure;
use luxproof_scene::geometry::Room;
use luxproof_scene::{Meter, Scene};
use sha2::{Digest, Sha256};

use super::cases::{Variants, variants};
use super::length_unit::LengthUnit;
use super::model::{Budget, EngineSettings, LuminaireSpec, Spec, ToleranceOverride};
use super::recorded::{READINGS, RecordedError, RecordedReadings, RecordedSettings, SettingError};
use super::shape::{Mended, Shaped, Trials, shaped};
use super::similar_file;
use super::tree::tree;
use super::trust::Limits;
use super::{Faults, Source, SpecError, Trust};
use crate::procedures::{Aimed, Procedures, Sets, Task};
use luxproof_model::{HiddenVariant, LuminaireModelChoice, ProcedureId, family};
use luxproof_process::digest::hexadecimal;
use luxproof_process::printable;

mod bodies;
mod extents;
mod meters;
mod observers;
mod requests;
mod room;
mod surfaces;

pub use meters::en_12464_counts;

/// More meters than this are a slip of the pen.
const MAX_METERS: usize = 1_000_000;

/// What to do about a spec that is not trusted.
const IF_YOURS: &str = "run it without --untrusted if it is yours, or with --trusted if your bundle holds it";

/// The longest name, and the longest title, in characters.
pub(super) const MAX_NAME: usize = 100;
const MAX_TITLE: usize = 1000;

/// A spec, read, checked and built: all that the rest of the program needs.
#[derive(Clone, Debug, Default)]
pub struct Case {
    /// The spec's file stem, and behind a slash the name of one of its cases.
    pub name: String,
    /// The cases of the same spec that it is compared with, as what was before it.
    pub before: Vec<String>,
    /// The spec's title, or its name.
    pub title: String,
    /// The spec's path as given.
    pub path: PathBuf,
    /// SHA-256 over the spec and every file that it names, in hexadecimal.
    pub sha256: String,
    /// Room, obstacles and luminaires.
    pub scene: Scene,
    /// The model of the luminaires of each entry of the spec, and why.
    pub luminaire_models: Vec<LuminaireModelChoice>,
    /// The entries of `luminaires` whose `face_reflectance` has no face.
    pub idle_faces: Vec<usize>,
    /// Meters by set.
    pub meters: BTreeMap<String, Vec<Meter>>,
    /// By set, the points of a surface that lie outside the room's walls or in the margin, and are no meters.
    pub left_out: BTreeMap<String, usize>,
    /// Diffuse reflectance of the surface on which each meter lies, of the sets that luminance is asked of.
    pub reflectances: BTreeMap<String, Vec<f64>>,
    /// Sum of L² ω / p² over the luminous openings that each eye sees, of the sets that glare is asked of.
    pub glares: BTreeMap<String, Vec<f64>>,
    /// What each eye sees of the luminous opening whose luminance is asked for, of the sets where that is.
    pub openings: BTreeMap<String, Vec<Aimed>>,
    pub procedures: Procedures,
    /// The engines that the spec names, with settings; `None` where it names none.
    pub engines: Option<BTreeMap<String, EngineSettings>>,
    /// The recorded readings among its engines.
    pub recorded: BTreeMap<String, RecordedReadings>,
    /// The engines that a case of a suite is for, where its overrides name some; others are skipped.
    pub only_engines: Option<Vec<String>>,
    pub budget: Budget,
    /// The public case that it is a hidden variant of.
    pub hidden_variant: Option<HiddenVariant>,
    /// The published tables, absolute or relative to the working directory.
    pub published: Option<PathBuf>,
    /// The files that the spec names, and those that they name, each once; the published tables, too.
    pub files: BTreeSet<PathBuf>,
    /// Overrides of the default tolerances, by procedure.
    pub tolerances: BTreeMap<ProcedureId, ToleranceOverride>,
    /// The text, for the places of later errors.
    pub source: Source,
}

impl Case {
    /// The settings that the spec gives an engine; a release that it does not name has those of the engine that it is of.
    pub fn settings_of(&self, engine: &str) -> BTreeMap<String, serde_json::Value> {
        let of_engine = self.engines.as_ref().and_then(|all| all.get(engine).or_else(|| all.get(family(engine))));
        of_engine.map(|EngineSettings(settings)| settings.clone()).unwrap_or_default()
    }

    /// The models of its luminaires and their reasons, one entry for the same model.
    pub fn grouped_models(&self) -> Vec<LuminaireModelChoice> {
        let mut groups: Vec<LuminaireModelChoice> = vec![];
        for choice in &self.luminaire_models {
            match groups.iter_mut().find(|group| group.has_same_model(choice)) {
                Some(group) => group.join(choice.clone()),
                None => groups.push(choice.clone()),
            }
        }
        groups
    }

    /// Whether it holds scenes of known answer, for which no spec asks.
    pub fn is_calibration(&self) -> bool {
        self.procedures.0.is_empty()
    }

    /// What a procedure measures in it; `None` where the spec does not ask for it.
    pub fn task(&self, procedure: ProcedureId) -> Option<Task> {
        let Self { meters, reflectances, glares, openings, .. } = self;
        let sets = Sets { meters, reflectances, glares, openings };
        crate::procedures::row(procedure).task(self.procedures.0.get(&procedure)?, &self.scene, &sets)
    }

    /// What all procedures measure in it, in the order of reports.
    pub fn tasks(&self) -> impl Iterator<Item = Task> {
        ProcedureId::ALL.iter().copied().filter_map(|procedure| self.task(procedure))
    }

    /// Reads, checks and builds the case of a spec file of the user's own, without the overrides of its `cases`.
    pub fn load(path: &Path) -> Result<Self, SpecError> {
        let source = Source::read(path, Trust::Own)?;
        let spec: Spec = source.parse()?;
        let built = Builder::new(&source, &Mended::default(), &mut source.trust.limits()).build(spec);
        Faults::of(built.faults).map_or(Ok(built.case), |faults| Err(faults.first()))
    }

    /// All cases of a spec file: those of its `cases`, or the one that it is.
    pub fn load_all(path: &Path, trust: Trust) -> Result<Vec<Self>, Faults> {
        let Loaded { cases, faults } = Loaded::of(path, trust);
        Faults::of(faults).map_or(Ok(cases), Err)
    }
}

/// The cases of a spec file as far as they can be made, and all that is wrong with it.
#[derive(Debug, Default)]
pub(super) struct Loaded {
    pub(super) cases: Vec<Case>,
    pub(super) faults: Vec<SpecError>,
}

impl Loaded {
    pub(super) fn of(path: &Path, trust: Trust) -> Self {
        let source = match Source::read(path, trust) {
            Ok(source) => source,
            Err(fault) => return Self { cases: vec![], faults: vec![fault] },
        };
        let tree = tree(&source.text);
        let Shaped { read, mut faults, mended } = shaped::<Spec>(&source, tree.as_ref().ok());
        let variants = tree.map(|tree| variants(&source, &tree, &faults));
        let variants = variants.or_else(|error| unread(&source, read.as_ref(), &error));
        let Variants { all, pairs, faults: of_cases } =
            variants.unwrap_or_else(|fault| Variants { faults: vec![fault], ..Variants::default() });
        let has_cases = !all.is_empty() || !of_cases.is_empty();
        faults.extend(of_cases);
        let (mut left, mut cases) = (trust.limits(), vec![]);
        if let Some(spec) = read.filter(|_| !has_cases) {
            let built = Builder::new(&source, &mended, &mut left).build(spec);
            faults.extend(built.faults);
            cases.push(built.case);
        }
        for v in all {
            let mut builder = Builder::new(&v.source, &v.mended, &mut left);
            builder.hash.update(&v.name);
            let Built { case, faults: of_case } = builder.build(v.spec);
            let full = |name: &str| format!("{}/{name}", case.name);
            let before = pairs.iter().filter(|pair| pair.after == v.name).map(|pair| full(&pair.before)).collect();
            cases.push(Case { name: full(&v.name), before, only_engines: v.engines, ..case });
            faults.extend(of_case);
            // Another case would say the same, or what nobody waits for.
            if faults.len() >= Trials::of(&source.text).faults() {
                break;
            }
        }
        Self { cases, faults }
    }
}

/// Cases that are no tree (an alias of what it stands in, a tag) must not be passed over for the spec that lies below them.
pub(super) fn unread(source: &Source, spec: Option<&Spec>, error: &serde_yaml::Error) -> Result<Variants, SpecError> {
    let has_cases = spec.is_some_and(|spec| spec.cases.is_some() || spec.compare.is_some());
    let help = "write cases and comparisons without tags, and without an alias of what it stands in".to_owned();
    if has_cases { Err(SpecError { help: Some(help), ..source.misread(error) }) } else { Ok(Variants::default()) }
}

/// A case as far as it could be made, and why it is not whole.
struct Built {
    case: Case,
    faults: Vec<SpecError>,
}

struct Builder<'a> {
    source: &'a Source,
    folder: &'a Path,
    /// The unit in which messages speak of lengths.
    unit: LengthUnit,
    hash: Sha256,
    /// Those that were read.
    files: RefCell<BTreeSet<PathBuf>>,
    /// What the cases of the file may still ask for.
    left: &'a mut Limits,
    /// What nobody wrote is not judged.
    mended: &'a Mended,
    faults: Vec<SpecError>,
    most: usize,
}

impl<'a> Builder<'a> {
    fn new(source: &'a Source, mended: &'a Mended, left: &'a mut Limits) -> Self {
        let folder = source.path.parent().unwrap_or(Path::new(""));
        let most = Trials::of(&source.text).faults();
        let (hash, files) = (Sha256::new(), RefCell::default());
        Self { source, folder, unit: LengthUnit::default(), hash, files, left, mended, faults: vec![], most }
    }

    /// Notes what is wrong at a place, unless nobody wrote what stands there.
    fn fault(&mut self, at: &str, fault: impl FnOnce(&Source) -> SpecError) {
        if self.faults.len() < self.most && !self.mended.touches(at) {
            self.faults.push(fault(self.source));
        }
    }

    /// Notes a fault unless what stands at a place is sound; whether it is.
    fn check(&mut self, sound: bool, at: &str, message: impl Into<String>, help: impl Into<String>) -> bool {
        if !sound {
            self.fault(at, |source| source.error_at(at, message, help));
        }
        sound
    }

    /// Takes so many of what is left of something; whether there are as many.
    fn take(&mut self, at: &str, what: &str, count: usize, of: fn(&mut Limits) -> &mut usize) -> bool {
        let left = of(self.left);
        let (all, enough) = (*left, count <= *left);
        *left = left.saturating_sub(count);
        let message = format!("{count} {what} are more than the {all} that are left to a spec that is not trusted");
        self.check(enough, at, message, format!("make several of it, or {IF_YOURS}"))
    }

    fn build(mut self, spec: Spec) -> Built {
        self.unit = spec.unit;
        let mut spec = spec.in_metres();
        self.hash.update(self.source.text.as_bytes());
        self.programs(&spec);
        let count = spec.luminaires.iter().map(LuminaireSpec::count).fold(0, usize::saturating_add);
        let is_few = self.take("luminaires", "luminaires", count, |left| &mut left.luminaires);
        let enclosure = self.room(&spec.room);
        let mut obstacles = self.obstacles(&spec.obstacles, enclosure.as_ref().map(|e| &e.room));
        let listed_obstacles = obstacles.len();
        obstacles.extend(enclosure.iter().flat_map(|e| e.walls.clone()));
        let room = enclosure.as_ref().map(|e| e.room);
        let hung = if is_few { self.luminaires(&spec.luminaires, enclosure.as_ref()) } else { vec![] };
        let luminaires = hung.iter().flat_map(|entry| entry.luminaires.clone()).collect();
        let mut scene = Scene { room, obstacles, luminaires };
        let (mut meters, mut left_out) = (BTreeMap::new(), BTreeMap::new());
        for (name, set) in &spec.meters {
            self.name("meters", name);
            let Some(set) = self.meter_set(name, set, &scene, enclosure.as_ref()) else { continue };
            if set.left_out > 0 {
                left_out.insert(name.clone(), set.left_out);
            }
            meters.insert(name.clone(), set.meters);
        }
        let (luminaire_models, idle_faces) = self.place(&spec.luminaires, hung, &mut scene, listed_obstacles, &meters);
        let seen = meters.values().map(Vec::len).sum::<usize>().saturating_mul(count.saturating_mul(count));
        self.take("luminaires", "pairs of luminaires as meters see them", seen, |left| &mut left.sights);
        requests::resolve_arrays(&mut spec);
        self.procedures(&spec);
        self.limit_angles(&mut spec, &scene);
        let reflectances = self.surfaces(&spec, &scene, &meters);
        let glares = self.observers(&spec, &scene, &meters);
        self.semicylinders(&spec, &meters);
        let openings = self.openings(&spec, &scene, &meters);
        self.budget(spec.budget);
        let tolerances = self.tolerances(&spec.tolerances);
        let published = spec.published.map(|file| self.path_of(&file));
        if let Some(file) = published.as_ref().filter(|_| !self.mended.touches("published")) {
            self.take_in("published", file);
        }
        let recorded = if self.are_few_recorded(spec.engines.as_ref()) {
            self.recorded(spec.engines.as_ref())
        } else {
            BTreeMap::new()
        };
        let name = name_of(&self.source.path);
        let title = spec.title.as_deref().unwrap_or(&name);
        let help = format!("give a line of at most {MAX_TITLE} printable characters");
        self.check(is_line(title, MAX_TITLE), "title", "this is no title", help);
        if let Some(variant) = &spec.hidden_variant {
            self.name("hidden_variant.of", &variant.of);
        }
        let case = Case {
            before: vec![],
            title: title.to_owned(),
            name,
            path: self.source.path.clone(),
            sha256: hexadecimal(&self.hash.finalize()),
            scene,
            luminaire_models,
            idle_faces,
            meters,
            left_out,
            reflectances,
            glares,
            openings,
            procedures: spec.procedures,
            engines: spec.engines,
            recorded,
            only_engines: None,
            budget: spec.budget,
            hidden_variant: spec.hidden_variant,
            published,
            files: self.files.take(),
            tolerances,
            source: self.source.clone(),
        };
        Built { case, faults: self.faults }
    }

    /// Refuses more recorded readings than a stranger's spec may name: each is a column of every table. Whether there are few.
    fn are_few_recorded(&mut self, engines: Option<&BTreeMap<String, EngineSettings>>) -> bool {
        let all = engines.into_iter().flat_map(BTreeMap::values);
        let named = all.filter(|settings| settings.0.contains_key(READINGS)).count();
        let most = self.source.trust.limits().recorded;
        let message = format!("{named} recorded readings are more than the {most} of a spec that is not trusted");
        self.check(named <= most, "engines", message, IF_YOURS)
    }

    /// Reads the files of recorded readings that the spec names as engines.
    fn recorded(&mut self, engines: Option<&BTreeMap<String, EngineSettings>>) -> BTreeMap<String, RecordedReadings> {
        let mut all = BTreeMap::new();
        for (name, settings) in engines.into_iter().flatten() {
            let settings = match RecordedSettings::from_settings(settings) {
                None => continue,
                Some(Ok(settings)) => settings,
                Some(Err(SettingError { key, message })) => {
                    let help = "give `readings: FILE.csv`, and `version`, `source` and `rounding` where they are known";
                    self.check(false, &format!("engines.{name}.{key}"), message, help);
                    continue;
                }
            };
            let at = format!("engines.{name}.readings");
            let file = self.path_of(Path::new(&settings.file));
            let Some(bytes) = self.take_in(&at, &file) else { continue };
            match RecordedReadings::parse(&bytes, settings) {
                Ok(readings) => {
                    all.insert(name.clone(), readings);
                }
                Err(RecordedError { line, message, help }) => {
                    let help = Some(help);
                    let error = SpecError { file, line, column: None, message, help, is_withheld: false };
                    self.fault(&at, |source| error.withheld(source.trust));
                }
            }
        }
        all
    }

    /// Refuses programs that a stranger would have us run.
    fn programs(&mut self, spec: &Spec) {
        let mut engines = spec.engines.iter().flatten();
        let starts =
            |settings: &EngineSettings| ["command", "releases"].into_iter().find(|key| settings.0.contains_key(*key));
        let Some((name, key)) = engines.find_map(|(name, settings)| Some((name, starts(settings)?))) else { return };
        let message = "it would run a program, and the spec is not trusted";
        self.check(self.source.trust == Trust::Own, &format!("engines.{name}.{key}"), message, IF_YOURS);
    }

    /// Refuses what is no name: names stand in scenes, logs and views, where a line break begins something else.
    fn name(&mut self, at: &str, name: &str) {
        let is_name = is_line(name, MAX_NAME) && name.trim() == name && !name.is_empty();
        let message = format!("`{}` is no name", printable::line(name, MAX_NAME));
        let help = format!("give 1 to {MAX_NAME} printable characters, no blank at either end");
        self.check(is_name, at, message, help);
    }

    fn path_of(&self, file: &Path) -> PathBuf {
        self.folder.join(file)
    }

    /// The bytes of a file that the spec names, or that such a file does.
    fn read(&self, path: &Path) -> io::Result<Vec<u8>> {
        self.files.borrow_mut().insert(path.to_owned());
        self.source.trust.read_named(self.folder, path)
    }

    /// The bytes of a file that the spec names, which are part of what it is.
    fn take_in(&mut self, at: &str, path: &Path) -> Option<Vec<u8>> {
        match self.read(path) {
            Ok(bytes) => {
                let is_few = self.take(at, "bytes of files", bytes.len(), |left| &mut left.bytes);
                self.hash.update(&bytes);
                is_few.then_some(bytes)
            }
            Err(error) => {
                let message = format!("{} cannot be read: {error}", path.display());
                self.check(false, at, message, self.file_help(path));
                None
            }
        }
    }

    /// Where paths start, and the file that a path may mean.
    fn file_help(&self, path: &Path) -> String {
        let start = "paths are relative to the spec's folder";
        // Names of files next to an untrusted spec are not shown.
        let similar = (self.source.trust == Trust::Own).then(|| similar_file(&self.folder.join(path))).flatten();
        similar.map_or_else(
            || start.to_owned(),
            |name| format!("did you mean `{}`? {start}", path.with_file_name(name).display()),
        )
    }
}

/// A spec's name: its file's, as a line.
pub(super) fn name_of(path: &Path) -> String {
    // It becomes the name of a folder, and `...yaml` has none.
    let stem = files::stem(path).map_or_else(|| "spec".into(), Path::to_string_lossy);
    printable::line(&stem, MAX_NAME)
}

/// Whether a text is one line of so many characters at most: no control character, and none that breaks or turns a line.
fn is_line(text: &str, most: usize) -> bool {
    text.chars().count() <= most && !text.chars().any(printable::is_unprintable)
}

/// What to do about what lies within the box around a room and not in the room.
/// What to do about something beyond the walls of a room.
fn beyond_walls(enclosure: &Enclosure) -> String {
    let mesh =
        if enclosure.is_of_faces() { "; faces of a mesh must close the room, all turned to one side" } else { "" };
    format!("move it between the walls{mesh}")
}

/// From where to where a room reaches.
fn within(room: &Room, unit: LengthUnit) -> String {
    let metres = if unit == LengthUnit::M { " m" } else { "" };
    format!("the room reaches from [0, 0, 0] to {}{metres}", unit.point(room.size_m))
}
