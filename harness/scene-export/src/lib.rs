//! Scenes in the formats that people exchange: `UsdLux` (usda) and glTF 2.0 with `EXT_lights_ies`.
//!
//! Pure: a scene to files and a list of what the format cannot say. Coordinates stay in metres with z up; glTF gets a root
//! node that turns them to y up.

mod flat;
mod gltf;
mod soup;
#[cfg(test)]
mod tests;
mod usd;

use luxproof_photometry::lm63;
use luxproof_scene::{Luminaire, LuminaireModel, Scene};

/// A format of scenes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SceneFormat {
    /// `scene.usda` with the lights of `UsdLux`.
    Usd,
    /// `scene.gltf` with `EXT_lights_ies`.
    Gltf,
}

impl SceneFormat {
    /// All formats.
    pub const ALL: [Self; 2] = [Self::Usd, Self::Gltf];

    /// The name on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Usd => "usd",
            Self::Gltf => "gltf",
        }
    }
}

/// A file of a scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ExportedFile {
    /// Its name.
    pub name: String,
    /// All of it.
    pub bytes: Vec<u8>,
}

/// A scene as files.
#[derive(Clone, Debug)]
pub struct ExportedScene {
    /// The files; photometric files first.
    pub files: Vec<ExportedFile>,
    /// What the format cannot say, one sentence each.
    pub losses: Vec<String>,
}

/// Writes a scene.
pub fn export_scene(scene: &Scene, title: &str, format: SceneFormat) -> ExportedScene {
    let mut losses = vec!["points and procedures are no part of the scene".to_owned()];
    let mut files = vec![];
    let mut lights = vec![];
    for (k, luminaire) in scene.luminaires.iter().enumerate() {
        let lost = match format {
            SceneFormat::Usd => {
                let (of_luminaire, lost) = usd::lights(luminaire, k);
                files.extend(of_luminaire.iter().map(|light| light.profile.clone()));
                lights.extend(of_luminaire);
                lost
            }
            SceneFormat::Gltf => {
                let (bytes, mut lost) = photometric_file(luminaire);
                files.push(ExportedFile { name: profile_name(k), bytes });
                let has_extent = luminaire.model != LuminaireModel::Point;
                lost.extend(has_extent.then(|| "EXT_lights_ies has points alone: its luminous opening is lost".into()));
                lost
            }
        };
        losses.extend(lost.into_iter().map(|what| format!("`{}`: {what}", luminaire.id)));
    }
    let (name, text) = match format {
        SceneFormat::Usd => ("scene.usda", usd::text(scene, title, &lights)),
        SceneFormat::Gltf => ("scene.gltf", gltf::text(scene, title)),
    };
    files.push(ExportedFile { name: name.into(), bytes: text.into_bytes() });
    ExportedScene { files, losses }
}

/// The name of the photometric file of a luminaire.
fn profile_name(k: usize) -> String {
    format!("luminaire-{k}.ies")
}

/// The user's LM-63 file where it needs no other one, else LM-63-2002 with a list of losses.
fn photometric_file(luminaire: &Luminaire) -> (Vec<u8>, Vec<String>) {
    let photometry = &luminaire.photometry;
    if let Some(file) = photometry.lm63_file().filter(|_| photometry.source.len() == 1) {
        return (file.bytes.to_vec(), vec![]);
    }
    let written = lm63::write_2002(photometry);
    (written.text.into_bytes(), written.losses)
}
