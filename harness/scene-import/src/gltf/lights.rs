//! Lights of `EXT_lights_ies`, and points and spots of `KHR_lights_punctual`.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

use glam::{DMat4, DVec3};
use luxproof_photometry::{LuminousIntensityDistribution, Photometry, lm63};
use luxproof_scene::LuminaireModel;

use super::Reader;
use super::buffers::uri_bytes;
use super::document::{LightOf, Node, Spot};
use crate::luminaires::{Profile, RawLight, axes};
use luxproof_spec::SpecError;

/// Between the cosines of a spot's cones, at least.
const MIN_SPOT_WIDTH: f64 = 1e-3;
/// Steps of a table between a spot's cones: straight between them it is off by 1e-4 of the largest intensity.
const SPOT_STEPS: u32 = 64;

impl Reader<'_, '_> {
    /// Takes the lights of a node, or says why not.
    pub(super) fn lights(&mut self, k: usize, node: &Node, transform: &DMat4) -> Result<(), SpecError> {
        let Some(extensions) = &node.extensions else { return Ok(()) };
        let found = extensions.profile.as_ref().map(|of| self.profile(k, of)).transpose()?.flatten();
        let punctual = extensions.light.as_ref().map(|of| self.punctual(k, of)).transpose()?.flatten();
        for (profile, flux_scale) in found.into_iter().chain(punctual) {
            let Some(axes) = axes(transform) else {
                self.raw.leave_out_light("lights that are mirrored or sheared", None);
                continue;
            };
            let position = transform.transform_point3(DVec3::ZERO);
            self.raw.light(
                RawLight {
                    name: node.name.clone(),
                    position,
                    axes,
                    profile,
                    flux_scale,
                    model: Some(LuminaireModel::Point),
                },
                None,
            )?;
        }
        Ok(())
    }

    /// The photometric file of a light of `EXT_lights_ies`, and the factor of its intensities.
    fn profile(&mut self, k: usize, of: &LightOf) -> Result<Option<(Profile, f64)>, SpecError> {
        let lights = self.document.extensions.as_ref().and_then(|all| all.profiles.as_ref());
        let light = lights.and_then(|lights| lights.lights.0.get(of.light));
        let light = light.ok_or_else(|| self.fault(&format!("nodes[{k}]: there is no light profile {}", of.light)))?;
        let Some(uri) = &light.uri else {
            self.raw.leave_out_light("light profiles in a buffer view (EXT_lights_ies)", None);
            return Ok(None);
        };
        let bytes = uri_bytes(self.raw.scene, uri)
            .map_err(|(why, help)| self.raw.scene.fault(None, format!("nodes[{k}]: its light profile: {why}"), help))?;
        let factor = of.multiplier.unwrap_or(1.0) * self.raw.primaries.luminous(of.color.unwrap_or([1.0; 3]));
        if !(factor.is_finite() && factor > 0.0) {
            self.raw.leave_out_light("lights without light", None);
            return Ok(None);
        }
        Ok(Some((Profile::File(bytes), factor)))
    }

    /// The intensity of a point of `KHR_lights_punctual`.
    fn punctual(&mut self, k: usize, of: &LightOf) -> Result<Option<(Profile, f64)>, SpecError> {
        let lights = self.document.extensions.as_ref().and_then(|all| all.punctual.as_ref());
        let light = lights.and_then(|lights| lights.lights.0.get(of.light));
        let light = light.ok_or_else(|| self.fault(&format!("nodes[{k}]: there is no light {}", of.light)))?;
        let candela = light.intensity.unwrap_or(1.0) * self.raw.primaries.luminous(light.color.unwrap_or([1.0; 3]));
        let is_local = matches!(light.kind.as_str(), "point" | "spot");
        if is_local && !(candela.is_finite() && candela > 0.0) {
            self.raw.leave_out_light("lights without light", None);
            return Ok(None);
        }
        match light.kind.as_str() {
            "point" => Ok(Some((Profile::Isotropic(candela), 1.0))),
            "spot" => {
                let file = spot_file(candela, light.spot);
                if file.is_none() {
                    self.raw.leave_out_light("spots without a cone of at most 90 degrees (KHR_lights_punctual)", None);
                }
                Ok(file.map(|bytes| (Profile::File(bytes), 1.0)))
            }
            "directional" => {
                self.raw.leave_out_light("directional lights, which are at no place (KHR_lights_punctual)", None);
                Ok(None)
            }
            _ => {
                self.raw.leave_out_light("lights of an unknown type (KHR_lights_punctual)", None);
                Ok(None)
            }
        }
    }
}

/// An LM-63 file of a spot: full inside the inner cone, none outside the outer one, and between them the square of a
/// straight line in the cosine, as the extension recommends.
fn spot_file(candela: f64, spot: Option<Spot>) -> Option<Vec<u8>> {
    let inner = spot.and_then(|spot| spot.inner_cone_angle).unwrap_or(0.0);
    let outer = spot.and_then(|spot| spot.outer_cone_angle).unwrap_or(FRAC_PI_4);
    if !(inner >= 0.0 && inner < outer && outer <= FRAC_PI_2 + 1e-6) {
        return None;
    }
    let width = (inner.cos() - outer.cos()).max(MIN_SPOT_WIDTH);
    let first = (outer.cos() + width).min(1.0).acos();
    let mut angles: Vec<f64> =
        (0..=SPOT_STEPS).map(|k| first + (outer - first) * f64::from(k) / f64::from(SPOT_STEPS)).collect();
    let shares = angles.iter().map(|angle| ((angle.cos() - outer.cos()) / width).clamp(0.0, 1.0).powi(2));
    let mut all_candela: Vec<f64> = shares.map(|share| candela * share).collect();
    if let Some(last) = all_candela.last_mut() {
        *last = 0.0;
    }
    if first > 0.0 {
        angles.insert(0, 0.0);
        all_candela.insert(0, candela);
    }
    angles.push(PI);
    all_candela.push(0.0);
    let gamma_deg = angles.into_iter().map(f64::to_degrees).collect();
    let distribution = LuminousIntensityDistribution::axial(gamma_deg, all_candela).ok()?;
    Some(lm63::write_2002(&Photometry::of(distribution)).text.into_bytes())
}
