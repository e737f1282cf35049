//! Lights of a scene as luminaires of a spec: place, rotation, scale and a photometric file.

use std::collections::BTreeSet;

use glam::{DMat3, DMat4, DVec3};
use luxproof_photometry::{LuminousIntensityDistribution, Photometry, lm63};
use luxproof_process::printable;
use luxproof_scene::LuminaireModel;
use serde::Serialize;

use crate::Up;

/// A light as its reader found it, in the file's unit and axes.
#[derive(Clone, Debug)]
pub(super) struct RawLight {
    pub(super) name: Option<String>,
    pub(super) position: DVec3,
    /// The directions of the light's own x, y and z; it shines along -z.
    pub(super) axes: DMat3,
    pub(super) profile: Profile,
    pub(super) flux_scale: f64,
    /// How its light leaves it, where the scene says so, whatever opening its file states.
    pub(super) model: Option<LuminaireModel>,
}

/// Where the light of a scene goes.
#[derive(Clone, Debug)]
pub(super) enum Profile {
    /// The bytes of an LM-63 file.
    File(Vec<u8>),
    /// The same intensity in every direction, in candela.
    Isotropic(f64),
}

impl Profile {
    /// The bytes that the scene states.
    pub(super) fn bytes(&self) -> usize {
        match self {
            Self::File(bytes) => bytes.len(),
            Self::Isotropic(_) => 0,
        }
    }
}

/// A light as a luminaire of a spec.
#[derive(Clone, Debug)]
pub struct ImportedLuminaire {
    /// A name, once per scene.
    pub id: String,
    /// The name of its photometric file, and all of it.
    pub file: String,
    /// The bytes of that file.
    pub bytes: Vec<u8>,
    /// The photometric centre in the room.
    pub at_m: DVec3,
    /// Azimuth, tilt and roll.
    pub rotate_deg: [f64; 3],
    /// Factor on every intensity.
    pub flux_scale: f64,
    /// How its light leaves it, where the scene says so, whatever opening its file states.
    pub model: Option<LuminaireModel>,
}

/// A luminaire in the summary of an import.
#[derive(Debug, Serialize)]
pub struct LuminaireSummary {
    pub id: String,
    pub photometry: String,
    pub at_m: [f64; 3],
}

/// How far the axes of a light may be from a rotation, as a part of their length.
const SAME_AXES: f64 = 1e-6;

/// The rotation of a transform; a scale does not matter to a direction.
pub(super) fn axes(transform: &DMat4) -> Option<DMat3> {
    let scaled = DMat3::from_mat4(*transform);
    let axes = DMat3::from_cols(scaled.x_axis.normalize(), scaled.y_axis.normalize(), scaled.z_axis.normalize());
    let is_rotation = (axes.transpose() * axes).abs_diff_eq(DMat3::IDENTITY, SAME_AXES) && axes.determinant() > 0.0;
    is_rotation.then_some(axes)
}

/// The most characters of a name.
const MAX_NAME_CHARS: usize = 80;

/// Turns lights into luminaires; `origin_m` is where the scene's origin is in the room.
pub(super) fn luminaires(lights: Vec<RawLight>, up: Up, unit_m: f64, origin_m: DVec3) -> Vec<ImportedLuminaire> {
    let mut taken = BTreeSet::new();
    let upright = |v: DVec3| if up == Up::Y { DVec3::new(v.x, -v.z, v.y) } else { v };
    let convert = |(k, light): (usize, RawLight)| {
        let DMat3 { x_axis, y_axis, z_axis } = light.axes;
        let orientation = DMat3::from_cols(upright(x_axis), upright(y_axis), upright(z_axis));
        ImportedLuminaire {
            id: unique_name(light.name.as_deref().unwrap_or_default(), k, &mut taken),
            file: format!("luminaire-{k}.ies"),
            bytes: match light.profile {
                Profile::File(bytes) => bytes,
                Profile::Isotropic(candela) => isotropic(candela),
            },
            at_m: unit_m * upright(light.position) + origin_m,
            rotate_deg: rotation_deg(orientation),
            flux_scale: light.flux_scale,
            model: light.model,
        }
    };
    lights.into_iter().enumerate().map(convert).collect()
}

impl ImportedLuminaire {
    pub(super) fn summarize(&self) -> LuminaireSummary {
        LuminaireSummary { id: self.id.clone(), photometry: self.file.clone(), at_m: self.at_m.to_array() }
    }
}

/// A printable name that no other luminaire has.
fn unique_name(name: &str, k: usize, taken: &mut BTreeSet<String>) -> String {
    let name = printable::line(name.trim(), MAX_NAME_CHARS);
    let name = if name.is_empty() { format!("light-{k}") } else { name };
    let name = if taken.contains(&name) { format!("{name}-{k}") } else { name };
    taken.insert(name.clone());
    name
}

/// An LM-63 file of one intensity.
fn isotropic(candela: f64) -> Vec<u8> {
    match LuminousIntensityDistribution::axial(vec![0.0, 180.0], vec![candela; 2]) {
        Ok(distribution) => lm63::write_2002(&Photometry::of(distribution)).text.into_bytes(),
        // Readers of scenes refuse what is no intensity.
        Err(_) => vec![],
    }
}

/// Azimuth about z, then tilt about the turned y axis, then roll about the own axis, in degrees.
fn rotation_deg(orientation: DMat3) -> [f64; 3] {
    let DMat3 { x_axis, y_axis, z_axis } = orientation;
    let across = z_axis.x.hypot(z_axis.y);
    if across < 1e-12 {
        // Azimuth and roll turn about one axis: all of it is roll.
        let (tilt, side) = if z_axis.z > 0.0 { (0.0, 1.0) } else { (180.0, -1.0) };
        return [0.0, tilt, plain(x_axis.y.atan2(side * x_axis.x).to_degrees())];
    }
    let azimuth = z_axis.y.atan2(z_axis.x);
    [azimuth, across.atan2(z_axis.z), y_axis.z.atan2(-x_axis.z)].map(|angle| plain(angle.to_degrees()))
}

/// Minus zero as zero.
fn plain(value: f64) -> f64 {
    value + 0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use luxproof_scene::orientation;

    #[test]
    fn a_rotation_is_found_again() {
        let angles = [-170.0, -90.0, -30.0, 0.0, 45.0, 90.0, 180.0];
        for azimuth in angles {
            for tilt in [0.0, 1e-3, 20.0, 90.0, 150.0, 180.0] {
                for roll in angles {
                    let matrix = orientation(azimuth, tilt, roll);
                    let [a, t, r] = rotation_deg(matrix);
                    let again = orientation(a, t, r);
                    assert!(matrix.abs_diff_eq(again, 1e-12), "{azimuth} {tilt} {roll}: {a} {t} {r}");
                }
            }
        }
    }
}
