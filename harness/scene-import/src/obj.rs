//! Wavefront OBJ scenes with their material libraries (.mtl).

use std::collections::{HashMap, HashSet};
use std::path::Path;

use glam::DVec3;
use luxproof_scene::geometry::obj::Obj;

use super::raw::{Kind, NO_MATERIAL, Primaries, Raw, Scene};
use luxproof_process::printable::{Quoted, quoted_path};
use luxproof_spec::SpecError;

/// Decimals as they are written.
const PRECISION: f64 = 1e-12;

/// More libraries are none of a drawing program's.
const MAX_LIBRARIES: usize = 100;

/// What a library says of a material.
#[derive(Clone, Debug)]
struct Entry {
    line: usize,
    rgb: Option<[f64; 3]>,
    emission: f64,
    /// What `d` says, else what `Tr` does.
    opacity: Option<f64>,
    transparency: f64,
    /// The first statement that makes it other than plain.
    other: Option<String>,
    is_glossy: bool,
}

/// Reads a scene.
pub(super) fn read<'a>(scene: &'a Scene<'a>) -> Result<Raw<'a>, SpecError> {
    let bytes = scene.bytes()?;
    let help = "repair the file, or export it again as Wavefront OBJ";
    let obj = Obj::read(&mut bytes.as_slice()).map_err(|f| scene.fault(Some(f.line), f.message, help))?;
    let mut raw = Raw::new(scene, PRECISION, Primaries::Rec709);
    for (what, (count, line)) in &obj.others {
        raw.leave_out(what, *count, Some(*line));
    }
    let (mut known, mut libraries) = (HashMap::new(), Libraries::default());
    for (names, line) in &obj.libraries {
        libraries.read(&mut raw, names, *line, &mut known)?;
    }
    let mut places = vec![];
    for name in &obj.materials {
        places.push(known.get(name).copied().unwrap_or_else(|| raw.material(name, Kind::Unknown, scene.path, None)));
    }
    let mut nameless = None;
    for face in &obj.faces {
        let corners: Vec<DVec3> = obj.corners_of(face).iter().map(|v| obj.vertices[*v as usize]).collect();
        let material = match face.material {
            Some(place) => places[place],
            None => *nameless.get_or_insert_with(|| raw.material(NO_MATERIAL, Kind::Unknown, scene.path, None)),
        };
        raw.polygon(material, Some(face.line), &corners)?;
    }
    Ok(raw)
}

/// The material libraries of a scene, each read once however often it is named.
#[derive(Default)]
struct Libraries {
    named: HashSet<String>,
    bytes: usize,
}

impl Libraries {
    /// Reads what an `mtllib` names: a file whose name may have blanks, or several files.
    fn read(
        &mut self,
        raw: &mut Raw<'_>,
        names: &str,
        line: usize,
        known: &mut HashMap<String, u32>,
    ) -> Result<(), SpecError> {
        if self.named.contains(names) {
            return Ok(());
        }
        let scene = raw.scene;
        let whole = scene.path_of(names);
        let each: Vec<&str> = if whole.is_file() { vec![names] } else { names.split_whitespace().collect() };
        for name in each {
            if !self.named.insert(name.to_owned()) {
                continue;
            }
            if self.named.len() > MAX_LIBRARIES {
                return Err(scene.fault(Some(line), "too many material libraries", "put the materials into one"));
            }
            let path = scene.path_of(name);
            match scene.read(&path) {
                Ok(bytes) => {
                    self.bytes = self.bytes.saturating_add(bytes.len());
                    if self.bytes > scene.trust.max_named_bytes() {
                        let message = format!("the material libraries have {} bytes together", self.bytes);
                        let help = "leave out what no face uses, or import it without --untrusted if it is yours";
                        return Err(scene.fault(Some(line), message, help));
                    }
                    library(raw, &path, &String::from_utf8_lossy(&bytes), known)?;
                }
                Err(error) => raw.note(format!("{} is not read: {error}", quoted_path(&path))),
            }
        }
        Ok(())
    }
}

fn library(raw: &mut Raw<'_>, path: &Path, text: &str, known: &mut HashMap<String, u32>) -> Result<(), SpecError> {
    let trust = raw.scene.trust;
    let mut entries: Vec<(String, Entry)> = vec![];
    for (k, line) in text.lines().enumerate() {
        let line = line.trim();
        let (keyword, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        if keyword == "newmtl" {
            entries.push((rest.trim().to_owned(), Entry::new(k + 1)));
        } else if let Some((_, entry)) = entries.last_mut() {
            entry.take(keyword, rest).map_err(|message| {
                let fault = SpecError::of(path, message, "correct the line, or export the materials again");
                SpecError { line: Some(k + 1), ..fault }.withheld(trust)
            })?;
        }
    }
    let glossy = entries.iter().filter(|(_, entry)| entry.is_glossy).count();
    for (name, entry) in entries {
        let line = Some(entry.line);
        let kind = entry.kind().map_err(|why| {
            let fault = SpecError::of(path, format!("material `{}`: {why}", Quoted(&name)), "correct it");
            SpecError { line, ..fault }.withheld(trust)
        })?;
        let place = raw.material(&name, kind, path, line);
        // Of several of a name the first counts, as in the programs that write them.
        known.entry(name).or_insert(place);
    }
    if glossy > 0 {
        raw.note(format!(
            "gloss (Ks) of {glossy} materials of {} is left out: every surface is diffuse",
            quoted_path(path)
        ));
    }
    Ok(())
}

impl Entry {
    fn new(line: usize) -> Self {
        Self { line, rgb: None, emission: 0.0, opacity: None, transparency: 0.0, other: None, is_glossy: false }
    }

    /// Takes in a line.
    fn take(&mut self, keyword: &str, rest: &str) -> Result<(), String> {
        match keyword {
            "Kd" => self.rgb = colour(rest)?,
            "Ke" => self.emission = brightest(rest)?,
            "Ks" => self.is_glossy = brightest(rest)? > 0.0,
            "d" => self.opacity = Some(number(rest.trim().trim_start_matches("-halo"))?),
            "Tr" => self.transparency = number(rest)?,
            "illum" => {
                let is_mirror_or_glass = (3..=9).contains(&(number(rest)? as i64));
                if is_mirror_or_glass {
                    self.is_other("a mirror or glass (illum)".to_owned());
                }
            }
            "map_Kd" => self.is_other("textured (map_Kd)".to_owned()),
            "map_d" => self.is_other("transparent in places (map_d)".to_owned()),
            "map_Ke" => self.emission = 1.0,
            _ => {}
        }
        Ok(())
    }

    fn is_other(&mut self, what: String) {
        self.other.get_or_insert(what);
    }

    fn kind(&self) -> Result<Kind, String> {
        let opacity = self.opacity.unwrap_or(1.0 - self.transparency);
        if self.emission > 0.0 {
            return Ok(Kind::Light("Ke".to_owned()));
        }
        if opacity < 1.0 {
            return Ok(Kind::Other(format!("transparent (opacity {opacity})")));
        }
        match (&self.other, self.rgb) {
            (Some(what), _) => Ok(Kind::Other(what.clone())),
            (None, Some(rgb)) => Kind::of_colour(rgb),
            (None, None) => Ok(Kind::Unknown),
        }
    }
}

fn number(text: &str) -> Result<f64, String> {
    let word = text.split_whitespace().next().unwrap_or("");
    let number = word.parse::<f64>().ok().filter(|number| number.is_finite());
    number.ok_or_else(|| format!("`{}` is no number", word.chars().take(40).collect::<String>()))
}

/// Red, green and blue, or one number for all; `None` for what only some programs can read (`spectral`, `xyz`).
fn colour(text: &str) -> Result<Option<[f64; 3]>, String> {
    let words: Vec<&str> = text.split_whitespace().collect();
    match words[..] {
        ["spectral" | "xyz", ..] => Ok(None),
        [grey] => number(grey).map(|grey| Some([grey; 3])),
        [r, g, b, ..] => Ok(Some([number(r)?, number(g)?, number(b)?])),
        _ => Err("a colour of no three numbers".to_owned()),
    }
}

fn brightest(text: &str) -> Result<f64, String> {
    Ok(colour(text)?.map_or(1.0, |rgb| rgb.iter().fold(0.0, |most: f64, part| most.max(*part))))
}
