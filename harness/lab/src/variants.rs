//! Hidden variants: public cases drawn anew by a seed, so that an engine that is tuned to the public ones shows.
//!
//! A variant has another size of room, other positions and another table, and asks the same procedures. What makes the case stays:
//! the bodies, the form of the photometric file, the settings of engines. Published values are left out, since they are of the
//! public case; the simulator and closed forms judge a variant.

use std::fs;
use std::path::{Component, Path, PathBuf};

use fastrand::Rng;
use itertools::Itertools;
use luxproof_model::HiddenVariant;
use luxproof_process::files::{self, FileError, clean};
use luxproof_spec::model::{LuminaireSpec, MeterSet, ModelSpec};
use luxproof_spec::{Case, EngineSettings, Faults, Spec, SpecError, Trust, suite, yaml};
use sha2::{Digest, Sha256};

use crate::draw::Draw;

/// The folder of the tables next to the variants.
const TABLES: &str = "tables";
/// Draws of a variant before the case is given up.
const MAX_DRAWS: usize = 12;
/// How much larger a room becomes. It never shrinks: openings keep their size and must fit.
const ROOM_FACTOR: (f64, f64) = (1.04, 1.25);
/// How much its axes differ in that.
const AXIS_FACTOR: (f64, f64) = (0.97, 1.03);
/// How far points move towards the middle of the room, as a part of the way.
const MAX_MOVE: f64 = 0.12;
/// The range of the factor on all candela of a table.
const TABLE_FACTOR: (f64, f64) = (0.7, 1.4);
/// How far the form of a table changes: over gamma and over C.
const TABLE_WAVES: (f64, f64) = (0.2, 0.15);

/// A variant that was written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DrawnVariant {
    /// The name of the public case.
    pub of: String,
    pub file: PathBuf,
}

/// Why there are no variants.
#[derive(Debug, thiserror::Error)]
pub enum VariantError {
    #[error(transparent)]
    Spec(#[from] Faults),
    #[error(transparent)]
    File(#[from] FileError),
    #[error("{case}: none of {MAX_DRAWS} draws is a valid spec; the last one: {fault}")]
    NoValidDraw { case: String, fault: String },
}

impl From<SpecError> for VariantError {
    fn from(error: SpecError) -> Self {
        Self::Spec(error.into())
    }
}

/// Writes a variant of every case of specs to a folder. The same seed gives the same bytes.
pub fn draw_variants(
    specs: &[PathBuf],
    seed: u64,
    out: &Path,
    trust: Trust,
) -> Result<Vec<DrawnVariant>, VariantError> {
    let cases = suite(specs, trust)?;
    let mut drawn = vec![];
    for path in cases.iter().map(|case| case.path.clone()).unique() {
        for (name, spec) in luxproof_spec::specs(&path)? {
            if spec.hidden_variant.is_some() {
                continue;
            }
            let only = cases.iter().find(|case| case.name == name).and_then(|case| case.only_engines.clone());
            let public = PublicCase { name, spec, folder: path.parent().unwrap_or(Path::new("")), only, trust };
            drawn.push(public.draw(seed, out)?);
        }
    }
    Ok(drawn)
}

/// A case that variants are drawn of.
struct PublicCase<'a> {
    name: String,
    spec: Spec,
    /// The folder that its paths are relative to.
    folder: &'a Path,
    /// The engines that the case is for; empty for all.
    only: Option<Vec<String>>,
    trust: Trust,
}

impl PublicCase<'_> {
    fn draw(&self, seed: u64, out: &Path) -> Result<DrawnVariant, VariantError> {
        let hash = Sha256::digest(format!("{seed} {}", self.name));
        let start = hash.iter().take(8).fold(0_u64, |number, byte| number << 8 | u64::from(*byte));
        let mut draw = Draw(Rng::with_seed(start));
        let stem = format!("hidden-{seed}-{}", self.name.replace(['/', '\\'], "-"));
        let file = out.join(format!("{stem}.yaml"));
        let mut fault = String::new();
        for attempt in 0..MAX_DRAWS {
            // Points that move may come to lie in a body; the last draws leave them.
            let moves = if 2 * attempt < MAX_DRAWS { MAX_MOVE } else { 0.0 };
            let text = self.variant(&mut draw, seed, &stem, out, moves)?;
            files::replace(&file, text.as_bytes()).map_err(|e| FileError::of(&file, e))?;
            match Case::load_all(&file, Trust::Own) {
                Ok(_) => return Ok(DrawnVariant { of: self.name.clone(), file }),
                Err(faults) => fault = faults.first().to_string(),
            }
        }
        fs::remove_file(&file).map_err(|e| FileError::of(&file, e))?;
        Err(VariantError::NoValidDraw { case: self.name.clone(), fault })
    }

    /// The text of one draw; its tables are written.
    fn variant(&self, draw: &mut Draw, seed: u64, stem: &str, out: &Path, moves: f64) -> Result<String, VariantError> {
        let mut spec = self.spec.clone();
        spec.published = None;
        spec.hidden_variant = Some(HiddenVariant { of: self.name.clone(), seed });
        let title = spec.title.take().unwrap_or_else(|| self.name.clone());
        spec.title = Some(format!("{title}, hidden variant"));
        resize(&mut spec, draw);
        let middle = spec.room.size_m.map(|size| size.map(|length| 0.5 * length));
        if let Some(middle) = middle {
            spec.meters.values_mut().for_each(|set| move_points(set, middle, moves, draw));
        }
        for luminaire in &mut spec.luminaires {
            turn(luminaire, draw);
            self.redraw_table(luminaire, draw, stem, out)?;
        }
        self.relocate(&mut spec, out);
        let only = self.only.as_ref().map(|engines| only_for(engines, spec.engines.as_ref()));
        Ok(yaml(&spec) + &only.unwrap_or_default())
    }

    /// Gives a luminaire a table of the same form with other candela. What is no LM-63 keeps its table.
    fn redraw_table(
        &self,
        luminaire: &mut LuminaireSpec,
        draw: &mut Draw,
        stem: &str,
        out: &Path,
    ) -> Result<(), VariantError> {
        let path = self.folder.join(&luminaire.photometry);
        let redrawn = self.trust.read_named(self.folder, &path).ok().and_then(|bytes| {
            // Every byte is a letter of Latin-1, so that whatever stands in keywords stays.
            let text: String = bytes.iter().map(|byte| char::from(*byte)).collect();
            redraw_candela(&text, draw)
        });
        let Some(text) = redrawn else {
            luminaire.photometry = relative(out, &path);
            return Ok(());
        };
        let letters = luminaire.id.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' });
        let place = Path::new(TABLES).join(format!("{stem}-{}.ies", letters.collect::<String>()));
        let file = out.join(&place);
        let bytes: Vec<u8> = text.chars().map(|letter| u8::try_from(u32::from(letter)).unwrap_or(b'?')).collect();
        files::replace(&file, &bytes).map_err(|e| FileError::of(&file, e))?;
        luminaire.photometry = place;
        Ok(())
    }

    /// Leads what the spec names elsewhere from the folder of variants to its place.
    fn relocate(&self, spec: &mut Spec, out: &Path) {
        if let Some(mesh) = &mut spec.room.mesh {
            *mesh = relative(out, &self.folder.join(&*mesh));
        }
        for mesh in spec.obstacles.iter_mut().filter_map(|obstacle| obstacle.mesh.as_mut()) {
            mesh.file = relative(out, &self.folder.join(&mesh.file));
        }
        for settings in spec.engines.iter_mut().flat_map(|engines| engines.values_mut()) {
            settings.0.values_mut().for_each(|value| self.relocate_words(value, out));
        }
        // Recorded values are of the public case.
        if let Some(engines) = &mut spec.engines {
            engines.retain(|_, settings| !settings.0.contains_key(luxproof_spec::READINGS));
        }
    }

    /// Words of commands that name files next to the spec.
    fn relocate_words(&self, value: &mut serde_json::Value, out: &Path) {
        match value {
            serde_json::Value::Array(items) => items.iter_mut().for_each(|item| self.relocate_words(item, out)),
            serde_json::Value::Object(entries) => {
                entries.values_mut().for_each(|entry| self.relocate_words(entry, out));
            }
            serde_json::Value::String(word) if !word.is_empty() && self.folder.join(&*word).is_file() => {
                *word = relative(out, &self.folder.join(&*word)).display().to_string();
            }
            _ => {}
        }
    }
}

/// Enlarges a box with everything in it, each axis by a little more or less. Other rooms and meshes keep their size.
fn resize(spec: &mut Spec, draw: &mut Draw) {
    let has_mesh = spec.obstacles.iter().any(|obstacle| obstacle.mesh.is_some());
    let all = draw.within(ROOM_FACTOR.0, ROOM_FACTOR.1);
    let factors = [0; 3].map(|_| all * draw.within(AXIS_FACTOR.0, AXIS_FACTOR.1));
    let Some(size) = spec.room.size_m.as_mut().filter(|_| !has_mesh) else { return };
    let scale = |point: &mut [f64; 3]| point.iter_mut().zip(factors).for_each(|(x, factor)| *x = rounded(*x * factor));
    scale(size);
    for cuboid in spec.obstacles.iter_mut().filter_map(|obstacle| obstacle.cuboid.as_mut()) {
        scale(&mut cuboid.min_m);
        scale(&mut cuboid.max_m);
    }
    for luminaire in &mut spec.luminaires {
        luminaire.at_m.iter_mut().for_each(scale);
        if let Some(array) = &mut luminaire.array {
            scale(&mut array.origin_m);
            array.step_m.iter_mut().zip(factors).for_each(|(step, factor)| *step = rounded(*step * factor));
        }
    }
    for set in spec.meters.values_mut() {
        set.points_m.iter_mut().flatten().for_each(scale);
        if let Some(grid) = &mut set.grid {
            [&mut grid.origin_m, &mut grid.u_m, &mut grid.v_m].into_iter().for_each(scale);
        }
        if let Some(line) = &mut set.line {
            scale(&mut line.from_m);
            scale(&mut line.to_m);
        }
    }
}

/// Moves points towards the middle of the room, along their surface where they face along an axis.
fn move_points(set: &mut MeterSet, middle: [f64; 3], most: f64, draw: &mut Draw) {
    let normal = set.normal.unwrap_or([0.0, 0.0, 1.0]);
    let is_axis = |k: usize| (0..3).all(|other| other == k || normal[other] == 0.0);
    let fixed = (0..3).find(|k| is_axis(*k));
    for point in set.points_m.iter_mut().flatten() {
        for k in 0..3 {
            let part = draw.within(0.0, most);
            if fixed.is_some_and(|fixed| fixed != k) {
                point[k] = rounded(point[k] + part * (middle[k] - point[k]));
            }
        }
    }
}

/// Turns a point that hangs upright about the vertical.
fn turn(luminaire: &mut LuminaireSpec, draw: &mut Draw) {
    let angle = draw.within(5.0, 85.0).round();
    let rotation = &mut luminaire.rotate_deg;
    if luminaire.model == ModelSpec::Point && rotation.tilt == 0.0 && rotation.roll == 0.0 {
        rotation.azimuth += angle;
    }
}

/// A length to a tenth of a micrometer.
fn rounded(length: f64) -> f64 {
    (length * 1e7).round() / 1e7
}

/// A number in the text of a file: where it stands, and its value.
struct Word {
    start: usize,
    end: usize,
    value: f64,
}

/// An LM-63 file with other candela, and with everything else as it is; `None` where the text is none, or has its tilt elsewhere.
///
/// The candela are the last numbers. They change by a factor and by smooth waves over gamma and C, which vanish over C at both ends
/// of gamma and close around the circle.
fn redraw_candela(text: &str, draw: &mut Draw) -> Option<String> {
    let (factor, wave) = (draw.within(TABLE_FACTOR.0, TABLE_FACTOR.1), draw.within(0.3, 0.8));
    let phases = [draw.within(0.0, std::f64::consts::TAU), draw.within(0.0, std::f64::consts::TAU)];
    let at = text.find("TILT=")?;
    let line = text[at..].lines().next()?;
    let start = at + line.len();
    let words = words(text, start)?;
    let first = match line.trim_end().strip_prefix("TILT=")?.trim() {
        "NONE" => 0,
        // Position, count, and as many angles and factors.
        "INCLUDE" => 2 + 2 * count(&words, 1)?,
        _ => return None,
    };
    let (gammas, planes) = (count(&words, first + 3)?, count(&words, first + 4)?);
    let before = first + 13 + gammas + planes;
    if words.len() != before + gammas.checked_mul(planes)? {
        return None;
    }
    let mut redrawn = text[..words.get(before)?.start].to_owned();
    for (k, word) in words[before..].iter().enumerate() {
        let part = |index: usize, of: usize| index as f64 / (of.max(2) - 1) as f64;
        let (g, c) = (part(k % gammas, gammas), part(k / gammas, planes));
        let over_gamma = 1.0 + TABLE_WAVES.0 * (phases[0] + std::f64::consts::TAU * wave * g).sin();
        let over_c =
            1.0 + TABLE_WAVES.1 * (std::f64::consts::PI * g).sin() * (phases[1] + std::f64::consts::TAU * c).cos();
        redrawn += &luxproof_model::numbers::trimmed(word.value * factor * over_gamma * over_c, 4);
        let next = words.get(before + k + 1).map_or(text.len(), |next| next.start);
        redrawn += &text[word.end..next];
    }
    Some(redrawn)
}

/// The numbers of a text from a place on; `None` where something else stands among them.
fn words(text: &str, start: usize) -> Option<Vec<Word>> {
    let mut words = vec![];
    let mut at = start;
    for part in text[start..].split(|c: char| c.is_ascii_whitespace() || c == ',') {
        if !part.is_empty() {
            words.push(Word { start: at, end: at + part.len(), value: part.parse().ok()? });
        }
        at += part.len() + 1;
    }
    Some(words)
}

/// A number of a header that counts something.
fn count(words: &[Word], k: usize) -> Option<usize> {
    let value = words.get(k)?.value;
    ((1.0..=1e5).contains(&value) && value.fract() == 0.0).then_some(value as usize)
}

/// A case for these engines only, with the settings that the spec gives them.
fn only_for(names: &[String], engines: Option<&std::collections::BTreeMap<String, EngineSettings>>) -> String {
    let settings = |name: &String| {
        let of_engine = engines.and_then(|all| all.get(name)).map(|settings| serde_json::json!(settings.0));
        // JSON is YAML.
        format!("{}: {}", serde_json::json!(name), of_engine.unwrap_or_else(|| serde_json::json!({})))
    };
    format!("cases:\n  - {{name: only, engines: {{{}}}}}\n", names.iter().map(settings).join(", "))
}

/// The way from a folder to a file.
fn relative(folder: &Path, file: &Path) -> PathBuf {
    let (folder, file) = (clean(folder), clean(file));
    let (from, to): (Vec<Component<'_>>, Vec<Component<'_>>) =
        (folder.components().collect(), file.components().collect());
    let common = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
    let up = std::iter::repeat_n(Component::ParentDir, from.len() - common);
    up.chain(to[common..].iter().copied()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reference(name: &str) -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../reference").join(name)
    }

    fn drawn(spec: &str, seed: u64) -> (tempfile::TempDir, Vec<Case>) {
        let folder = tempfile::tempdir().unwrap();
        let variants = draw_variants(&[reference(spec)], seed, folder.path(), Trust::Own).unwrap();
        let files: Vec<PathBuf> = variants.into_iter().map(|variant| variant.file).collect();
        let cases = suite(&files, Trust::Own).unwrap();
        (folder, cases)
    }

    fn texts(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
        let all = walk(folder).into_iter().sorted();
        all.map(|path| (path.strip_prefix(folder).unwrap().to_owned(), fs::read(path).unwrap())).collect()
    }

    fn walk(folder: &Path) -> Vec<PathBuf> {
        let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
        entries.flat_map(|path| if path.is_dir() { walk(&path) } else { vec![path] }).collect()
    }

    #[test]
    fn every_public_case_has_a_valid_variant_with_another_room_other_points_and_other_candela() {
        let of_cie171 = ["cie171/5.[2-8]*.yaml", "cie171/*-aside.yaml", "cie171/*-far.yaml"];
        for spec in ["analytic", "readers"].into_iter().chain(of_cie171) {
            let public = suite(&[reference(spec)], Trust::Own).unwrap();
            let (_folder, hidden) = drawn(spec, 7);
            assert_eq!(hidden.len(), public.len());
            for case in &public {
                let variant = hidden.iter().find(|v| v.hidden_variant.as_ref().is_some_and(|h| h.of == case.name));
                let variant = variant.unwrap_or_else(|| panic!("no variant of {}", case.name));
                assert_eq!(variant.hidden_variant.as_ref().map(|h| h.seed), Some(7));
                assert!(variant.published.is_none());
                let [a, b] = [case, variant].map(|c| c.scene.room.as_ref().unwrap().size_m);
                assert!(a.x < b.x && a.y < b.y && a.z < b.z, "{}", case.name);
                assert!(case.procedures.0.keys().eq(variant.procedures.0.keys()), "{}", case.name);
                let [a, b] = [case, variant].map(|c| &c.scene.luminaires[0].photometry);
                assert_eq!(a.opening, b.opening, "{}", case.name);
                let [a, b] = [a, b].map(|photometry| photometry.distribution.flux().0);
                assert!((a / b - 1.0).abs() > 1e-4, "{}", case.name);
                assert_eq!(case.only_engines, variant.only_engines, "{}", case.name);
            }
        }
    }

    #[test]
    fn one_seed_gives_the_same_bytes_and_another_seed_others() {
        let [a, b, c] = [7, 7, 8].map(|seed| drawn("cie171/5.2-point.yaml", seed).0);
        assert_eq!(texts(a.path()), texts(b.path()));
        assert_ne!(texts(a.path())[0].1, texts(c.path())[0].1);
    }

    #[test]
    fn only_the_candela_of_a_file_change() {
        let text = "IESNA:LM-63-2002\n[LAMP] 4, 5\nTILT=INCLUDE\n1\n2\n0 90\n1 .8\n1 -1 1 3,2 1 2\n0 0 0\n1 1 0\n0 60 90\n0, 90\n100 80 0\n90,70 0\n";
        let changed = redraw_candela(text, &mut Draw(Rng::with_seed(1))).unwrap();
        let candela = text.find("100 80 0").unwrap();
        assert_eq!(changed[..candela], text[..candela]);
        let [before, after] = [text, &changed]
            .map(|text| words(text, candela).unwrap().iter().map(|word| word.value).collect::<Vec<_>>());
        assert_eq!(after.len(), 6);
        assert!(before.iter().zip(&after).all(|(b, a)| (*b == 0.0) == (*a == 0.0)));
        assert!(before[0] != after[0] && changed.ends_with('\n') && changed.contains(','));
        for other in ["TILT=lamp.tlt\n1 1 1", "no table", "TILT=NONE\n1 1 1 2 2 1 1 0 0 0 1 1 0 0 90 0 90 1 2 3"] {
            assert_eq!(redraw_candela(other, &mut Draw(Rng::with_seed(1))), None, "{other}");
        }
    }

    #[test]
    fn a_path_leads_from_one_folder_to_another() {
        assert_eq!(relative(Path::new("/a/b/c"), Path::new("/a/d/e.ies")), Path::new("../../d/e.ies"));
        assert_eq!(relative(Path::new("/a/b"), Path::new("/a/b/c/e.ies")), Path::new("c/e.ies"));
    }
}
