//! What observers see of luminous openings, for the glare that they are asked of.

use std::collections::BTreeMap;

use luminaire::calculators::ugr::observer::{Glare, NoGlare};
use luminaire::scene::{Meter, Obstacle, Scene, Shape};

use super::super::model::Spec;
use super::Builder;
use super::surfaces::{MAX_LOOKS, sets_of};
use crate::procedures::{Asked, Reads, sight};

/// What a sight of a luminaire may be hidden by is looked at one by one.
fn bodies(scene: &Scene) -> usize {
    let faces = |obstacle: &Obstacle| match &obstacle.shape {
        Shape::Box { .. } => 1,
        Shape::Mesh { triangles, .. } => triangles.len(),
    };
    scene.obstacles.iter().map(faces).sum::<usize>().max(1)
}

/// Why an opening has no luminance for an eye.
#[derive(Debug, thiserror::Error)]
#[error("sees no luminous area of `{0}`: it is a point by its file, edge on from here, or around the eye")]
struct NotSeen(String);

impl Builder<'_> {
    /// Refuses observers of an opening that they do not see.
    pub(super) fn sights(&mut self, spec: &Spec, scene: &Scene, meters: &BTreeMap<String, Vec<Meter>>) {
        if !self.faults.is_empty() {
            return;
        }
        let openings = spec.procedures.0.values().filter_map(|asked| match asked {
            Asked::Opening(asked) => Some(asked),
            Asked::Angles(_) | Asked::Meters(_) => None,
        });
        for asked in openings {
            let Some(luminaire) = scene.luminaires.iter().find(|l| l.id == asked.luminaire) else { continue };
            let seen = |meter: &Meter| sight(luminaire, meter).ok_or_else(|| NotSeen(asked.luminaire.clone()));
            let sets = asked.meters.iter().filter_map(|name| Some((name, &meters.get(name)?[..])));
            let found = sets.map(|(name, set)| (name, set, set.iter().map(seen).collect())).collect();
            self.at_each(spec, found, "an observer sees the luminous opening", |_| {
                "move it to where the opening shows, or take a photometric file whose opening has a size".to_owned()
            });
        }
    }

    /// Sum of L² ω / p² that each eye sees, of the sets that glare is asked of.
    pub(super) fn observers(
        &mut self,
        spec: &Spec,
        scene: &Scene,
        meters: &BTreeMap<String, Vec<Meter>>,
    ) -> BTreeMap<String, Vec<f64>> {
        let sets = sets_of(spec, meters, Reads::GlareRating);
        if sets.is_empty() || scene.room.is_none() || !self.faults.is_empty() {
            return BTreeMap::new();
        }
        let at = "procedures.unified_glare_rating";
        let message = "no surface reflects: there is no background, and no rating by it";
        let is_bright = self.check(scene.largest_reflectance() > 0.0, at, message, "give the room reflectances");
        let eyes = sets.iter().map(|(_, set)| set.len()).sum::<usize>();
        let sights = eyes.saturating_mul(scene.luminaires.len()).saturating_mul(bodies(scene));
        let message = format!("{sights} lines of sight past faces of bodies");
        if !self.check(sights <= MAX_LOOKS, at, message, format!("read it at fewer meters: {MAX_LOOKS} are looked at"))
        {
            return BTreeMap::new();
        }
        if !is_bright {
            return BTreeMap::new();
        }
        let seen = |eye: &Meter| Glare::seen(scene, eye).map(|glare| glare.sum);
        let found = sets.into_iter().map(|(name, set)| (name, set, set.iter().map(seen).collect())).collect();
        self.at_each(spec, found, "an eye sees luminous openings", |fault| match fault {
            NoGlare::Upright => "give the direction in which the observer looks, [1, 0, 0] say".to_owned(),
            NoGlare::NothingSeen => "turn its normal to where it looks, or leave it out".to_owned(),
            NoGlare::NoArea(_) => "take a photometric file whose luminous opening has a size".to_owned(),
        })
    }
}
