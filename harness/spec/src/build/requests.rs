//! What is asked of a scene: procedures, the budget, tolerances.

use std::collections::{BTreeMap, HashSet};

use super::super::model::{Budget, LuminaireSpec, Spec, ToleranceOverride};
use super::{Builder, MAX_METERS};
use crate::procedures::{AngleLists, Angles, AtAngles, AtOpening, Names, ProcedureRequest};
use crate::{PlacePart, suggestion};
use luxproof_model::ProcedureId;
use luxproof_scene::Scene;

/// Of what is refused, its own.
fn ids_of(spec: &LuminaireSpec) -> Vec<String> {
    let ids: Vec<String> =
        if spec.count() > MAX_METERS { vec![] } else { spec.each().into_iter().map(|(id, _)| id).collect() };
    if ids.is_empty() { vec![spec.id.clone()] } else { ids }
}

/// Lets a procedure of one luminaire name an array by its id: it means the first, since all have one file and rotation.
pub(super) fn resolve_arrays(spec: &mut Spec) {
    for asked in spec.procedures.0.values_mut() {
        let (ProcedureRequest::Angles(AtAngles { luminaire, .. })
        | ProcedureRequest::Opening(AtOpening { luminaire, .. })) = asked
        else {
            continue;
        };
        if spec.luminaires.iter().any(|l| l.id == *luminaire && l.array.is_some()) {
            luminaire.push_str("[0,0]");
        }
    }
}

impl Builder<'_> {
    pub(super) fn procedures(&mut self, spec: &Spec) {
        let procedures = &spec.procedures.0;
        self.check(!procedures.is_empty(), "procedures", "there are none", "give at least one procedure");
        for (procedure, asked) in procedures {
            match asked {
                ProcedureRequest::Meters(asked) => self.meter_sets(*procedure, &asked.meters, spec),
                ProcedureRequest::Angles(asked) => self.angles(*procedure, asked, spec),
                ProcedureRequest::Opening(asked) => {
                    self.meter_sets(*procedure, &asked.meters, spec);
                    self.luminaire_of(*procedure, &asked.luminaire, spec);
                }
            }
        }
    }

    fn meter_sets(&mut self, procedure: ProcedureId, names: &Names, spec: &Spec) {
        let at = format!("procedures.{procedure}.meters");
        let mut known = HashSet::new();
        for name in names.iter() {
            if !spec.meters.contains_key(name) && !self.mended.holds("meters") {
                // What is like the name is looked for among all sets, and so for no name that is there.
                self.fault(&at, |source| {
                    let help = suggestion(name, spec.meters.keys().map(String::as_str));
                    source.error_at(&at, format!("there is no meter set `{name}`"), help)
                });
            }
            self.check(known.insert(name), &at, format!("`{name}` stands there twice"), "name every set once");
        }
    }

    fn luminaire_of(&mut self, procedure: ProcedureId, luminaire: &str, spec: &Spec) {
        let all: Vec<String> = spec.luminaires.iter().flat_map(ids_of).collect();
        let is_there = all.iter().any(|id| id == luminaire) || self.mended.holds("luminaires");
        let is_mended = (0..spec.luminaires.len()).any(|k| self.mended.holds(&format!("luminaires[{k}].id")));
        // Of an array its name is suggested, not one of its luminaires.
        let arrays = spec.luminaires.iter().map(|l| l.id.as_str());
        let names: Vec<&str> =
            if luminaire.contains('[') { all.iter().map(String::as_str).collect() } else { arrays.collect() };
        let (at, help) = (format!("procedures.{procedure}.luminaire"), suggestion(luminaire, names.into_iter()));
        self.check(is_there || is_mended, &at, format!("there is no luminaire `{luminaire}`"), help);
    }

    fn angles(&mut self, procedure: ProcedureId, intensity: &AtAngles, spec: &Spec) {
        let at = format!("procedures.{procedure}");
        self.luminaire_of(procedure, &intensity.luminaire, spec);
        let is_distance = intensity.distance_m.is_finite() && intensity.distance_m > 0.0;
        let message = format!("{} is no distance", self.unit.length(intensity.distance_m));
        self.check(is_distance, &format!("{at}.distance_m"), message, "give a positive number of metres");
        let Angles::Listed(lists) = &intensity.angles else { return };
        let gamma = !lists.gamma_deg.is_empty() && lists.gamma_deg.iter().all(|gamma| (0.0..=180.0).contains(gamma));
        let c = !lists.c_deg.is_empty() && lists.c_deg.iter().all(|c| c.is_finite());
        let help = "list gamma angles from 0 (nadir) to 180 (zenith)";
        self.check(gamma, &format!("{at}.angles.gamma_deg"), "not a list of gamma angles", help);
        self.check(c, &format!("{at}.angles.c_deg"), "not a list of C angles", "list C planes in degrees");
    }

    /// Counts the angles of procedures, those of a photometric file too, and leaves none to a procedure that has too many: what is
    /// refused must not be laid out.
    pub(super) fn limit_angles(&mut self, spec: &mut Spec, scene: &Scene) {
        for (procedure, asked) in &mut spec.procedures.0 {
            let ProcedureRequest::Angles(asked) = asked else { continue };
            let count = match &asked.angles {
                Angles::Listed(lists) => lists.gamma_deg.len().saturating_mul(lists.c_deg.len()),
                Angles::Photometry => {
                    let luminaire = scene.luminaires.iter().find(|luminaire| luminaire.id == asked.luminaire);
                    luminaire.map_or(0, |luminaire| luminaire.photometry.distribution.nodes_deg().len())
                }
            };
            let at = format!("procedures.{procedure}.angles");
            let help = format!("a procedure measures at {MAX_METERS} angles at most");
            let is_bounded = self.check(count <= MAX_METERS, &at, format!("{count} angles"), help);
            if !(is_bounded && self.take(&at, "angles", count, |left| &mut left.meters)) {
                asked.angles = Angles::Listed(AngleLists { gamma_deg: vec![], c_deg: vec![] });
            }
        }
    }

    pub(super) fn budget(&mut self, budget: Budget) {
        for (field, value) in [("relative_error", budget.relative_error), ("seconds", budget.seconds)] {
            let (at, message) = (format!("budget.{field}"), format!("{value} is no budget"));
            self.check(value.is_finite() && value > 0.0, &at, message, "give a positive number");
        }
    }

    pub(super) fn tolerances(
        &mut self,
        tolerances: &BTreeMap<String, ToleranceOverride>,
    ) -> BTreeMap<ProcedureId, ToleranceOverride> {
        let mut known = BTreeMap::new();
        for (name, tolerance) in tolerances {
            let at = format!("tolerances.{name}");
            let Ok(procedure) = name.parse::<ProcedureId>() else {
                let help = suggestion(name, ProcedureId::NAMES.iter().copied());
                let message = format!("tolerances: `{name}` is no procedure");
                self.fault(&at, |source| source.error_at_part(PlacePart::Key, &at, message, help));
                continue;
            };
            let t = tolerance;
            let values = [t.relative, t.absolute_lx, t.absolute_cd, t.absolute_cd_m2, t.absolute_ugr];
            let sound = values.iter().all(|v| v.is_finite() && *v >= 0.0);
            self.check(sound, &at, "a tolerance is a number from 0", "give positive numbers");
            known.insert(procedure, *tolerance);
        }
        known
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::Case;
    use luxproof_model::ProcedureId;

    #[test]
    fn an_array_names_its_first_luminaire() {
        let lamp = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../reference/luminaires/isotropic.ies");
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("spec.yaml");
        let spec = format!(
            "luxproof: 1\nroom: {{size_m: [6, 5, 3], reflectance: {{floor: 0.2, walls: 0.5, ceiling: 0.7}}}}\n\
             luminaires: [{{id: bay, photometry: {}, array: {{counts: [2, 2], origin_m: [1, 1, 2.5], step_m: [2, 2]}}}}]\n\
             procedures: {{luminous_intensity: {{luminaire: bay, distance_m: 10, angles: photometry}}}}\n",
            lamp.display()
        );
        std::fs::write(&path, &spec).unwrap();
        let case = Case::load(&path).unwrap();
        let task = case.task(ProcedureId::LuminousIntensity).unwrap();
        assert_eq!(task.scene.luminaires.iter().map(|l| l.id.as_str()).collect::<Vec<_>>(), ["bay[0,0]"]);
        std::fs::write(&path, spec.replace("luminaire: bay", "luminaire: bax")).unwrap();
        assert!(Case::load(&path).unwrap_err().to_string().contains("there is no luminaire `bax`"));
    }
}
