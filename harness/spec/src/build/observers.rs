//! What observers see of luminous openings, for the glare that they are asked of.

use std::collections::BTreeMap;

use luxproof_calculators::ugr::observer::{Glare, NoGlare};
use luxproof_scene::{Meter, Obstacle, Scene, Shape};

use super::super::model::Spec;
use super::Builder;
use super::surfaces::{MAX_LOOKS, sets_of};
use crate::procedures::{Aimed, Reads};
use luxproof_model::ProcedureId;

/// The number of bodies that are tested one by one for hiding a luminaire.
fn bodies(scene: &Scene) -> usize {
    scene.obstacles.iter().map(faces).sum::<usize>().max(1)
}

/// The number of bodies that an obstacle counts as: a box as one, a mesh by its triangles.
fn faces(obstacle: &Obstacle) -> usize {
    match &obstacle.shape {
        Shape::Box { .. } => 1,
        Shape::Mesh { triangles, .. } => triangles.len(),
    }
}

/// A round opening is integrated for each.
const MAX_EYES: usize = 20_000;

/// Why an opening has no luminance for an eye.
#[derive(Debug, thiserror::Error)]
#[error("sees no luminous area of `{0}`: it is a point by its file, edge on from here, or around the eye")]
struct NotSeen(String);

impl Builder<'_> {
    /// What each eye sees of the luminous opening whose luminance is asked for; refuses one that sees none of it.
    pub(super) fn openings(
        &mut self,
        spec: &Spec,
        scene: &Scene,
        meters: &BTreeMap<String, Vec<Meter>>,
    ) -> BTreeMap<String, Vec<Aimed>> {
        let id = spec.procedures.0.get(&ProcedureId::OpeningLuminance).and_then(|asked| asked.named().0);
        let luminaire = id.and_then(|id| scene.luminaires.iter().find(|l| l.id == id));
        let Some(luminaire) = luminaire.filter(|_| self.faults.is_empty()) else { return BTreeMap::new() };
        let sets = sets_of(spec, meters, Reads::OpeningLuminance);
        let eyes = sets.iter().map(|(_, set)| set.len()).sum::<usize>();
        let help = format!("read it at fewer meters: {MAX_EYES} are looked from");
        if !self.check(eyes <= MAX_EYES, "procedures.opening_luminance", format!("{eyes} observers"), help) {
            return BTreeMap::new();
        }
        let found = sets.into_iter().map(|(name, set)| {
            let aims = set.iter().map(|meter| Aimed::at(luminaire, meter));
            (name, set, aims.map(|aim| aim.ok_or_else(|| NotSeen(luminaire.id.clone()))).collect())
        });
        let found = found.collect();
        self.at_each(spec, found, "an observer sees the luminous opening", |_| {
            "move it to where the opening shows, or take a photometric file whose opening has a size".to_owned()
        })
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
        let found = sets.into_iter().map(|(name, set)| {
            let sums = set.iter().map(|eye| Glare::seen(scene, eye).map(|glare| glare.sum));
            (name, set, sums.collect())
        });
        let found = found.collect();
        self.at_each(spec, found, "an eye sees luminous openings", |fault| match fault {
            NoGlare::Upright => "give the direction in which the observer looks, [1, 0, 0] say".to_owned(),
            NoGlare::NothingSeen => "turn its normal to where it looks, or leave it out".to_owned(),
            NoGlare::NoArea(_) => "take a photometric file whose luminous opening has a size".to_owned(),
        })
    }
}
