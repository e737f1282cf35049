//! Lights of `EXT_lights_ies`, and points of `KHR_lights_punctual`.

use glam::{DMat4, DVec3};

use super::Reader;
use super::buffers::uri_bytes;
use super::document::{LightOf, Node};
use crate::luminaires::{Profile, RawLight, axes};
use crate::raw::luminous;
use luxproof_spec::SpecError;

impl Reader<'_, '_> {
    /// Takes the lights of a node, or says why not.
    pub(super) fn lights(&mut self, k: usize, node: &Node, transform: &DMat4) -> Result<(), SpecError> {
        let Some(extensions) = &node.extensions else { return Ok(()) };
        let found = extensions.profile.as_ref().map(|of| self.profile(k, of)).transpose()?.flatten();
        let punctual = extensions.light.as_ref().map(|of| self.punctual(k, of)).transpose()?.flatten();
        for (profile, flux_scale) in found.into_iter().chain(punctual) {
            let Some(axes) = axes(transform) else {
                self.raw.leave_out("lights that are mirrored or sheared", 1, None);
                continue;
            };
            let position = transform.transform_point3(DVec3::ZERO);
            self.raw.light(
                RawLight { name: node.name.clone(), position, axes, profile, flux_scale, is_point: true },
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
            self.raw.leave_out("light profiles in a buffer view (EXT_lights_ies)", 1, None);
            return Ok(None);
        };
        let bytes = uri_bytes(self.raw.scene, uri)
            .map_err(|(why, help)| self.raw.scene.fault(None, format!("nodes[{k}]: its light profile: {why}"), help))?;
        let factor = of.multiplier.unwrap_or(1.0) * luminous(of.color.unwrap_or([1.0; 3]));
        if !(factor.is_finite() && factor > 0.0) {
            self.raw.leave_out("lights without light", 1, None);
            return Ok(None);
        }
        Ok(Some((Profile::File(bytes), factor)))
    }

    /// The intensity of a point of `KHR_lights_punctual`.
    fn punctual(&mut self, k: usize, of: &LightOf) -> Result<Option<(Profile, f64)>, SpecError> {
        let lights = self.document.extensions.as_ref().and_then(|all| all.punctual.as_ref());
        let light = lights.and_then(|lights| lights.lights.0.get(of.light));
        let light = light.ok_or_else(|| self.fault(&format!("nodes[{k}]: there is no light {}", of.light)))?;
        let candela = light.intensity.unwrap_or(1.0) * luminous(light.color.unwrap_or([1.0; 3]));
        match light.kind.as_str() {
            "point" if candela.is_finite() && candela > 0.0 => Ok(Some((Profile::Isotropic(candela), 1.0))),
            "point" => {
                self.raw.leave_out("lights without light", 1, None);
                Ok(None)
            }
            _ => {
                self.raw.leave_out("lights that are no points (KHR_lights_punctual)", 1, None);
                Ok(None)
            }
        }
    }
}
