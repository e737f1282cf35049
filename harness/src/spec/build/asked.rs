//! What is asked of a scene: procedures, the budget, tolerances.

use std::collections::{BTreeMap, HashSet};

use super::super::model::{Budget, LuminaireSpec, Spec, ToleranceOverride};
use super::{Builder, MAX_METERS};
use crate::procedures::{Angles, Asked, AtAngles, Names};
use crate::record::ProcedureId;
use crate::spec::{Spot, suggestion};

/// Of what is refused, its own.
fn ids_of(spec: &LuminaireSpec) -> Vec<String> {
    let ids: Vec<String> =
        if spec.len() > MAX_METERS { vec![] } else { spec.each().into_iter().map(|(id, _)| id).collect() };
    if ids.is_empty() { vec![spec.id.clone()] } else { ids }
}

impl Builder<'_> {
    pub(super) fn procedures(&mut self, spec: &Spec) {
        let procedures = &spec.procedures.0;
        self.check(!procedures.is_empty(), "procedures", "there are none", "give at least one procedure");
        for (procedure, asked) in procedures {
            match asked {
                Asked::Meters(asked) => self.meter_sets(*procedure, &asked.meters, spec),
                Asked::Angles(asked) => self.angles(*procedure, asked, spec),
                Asked::Opening(asked) => {
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
            let help = suggestion(name, spec.meters.keys().map(String::as_str));
            let is_there = spec.meters.contains_key(name) || self.mended.holds("meters");
            self.check(is_there, &at, format!("there is no meter set `{name}`"), help);
            self.check(known.insert(name), &at, format!("`{name}` stands there twice"), "name every set once");
        }
    }

    fn luminaire_of(&mut self, procedure: ProcedureId, luminaire: &str, spec: &Spec) {
        let all: Vec<String> = spec.luminaires.iter().flat_map(ids_of).collect();
        let ids = || all.iter().map(String::as_str);
        let is_there = ids().any(|id| id == luminaire) || self.mended.holds("luminaires");
        let is_mended = (0..spec.luminaires.len()).any(|k| self.mended.holds(&format!("luminaires[{k}].id")));
        let (at, help) = (format!("procedures.{procedure}.luminaire"), suggestion(luminaire, ids()));
        self.check(is_there || is_mended, &at, format!("there is no luminaire `{luminaire}`"), help);
    }

    fn angles(&mut self, procedure: ProcedureId, intensity: &AtAngles, spec: &Spec) {
        let at = |field: &str| format!("procedures.{procedure}.{field}");
        self.luminaire_of(procedure, &intensity.luminaire, spec);
        let is_distance = intensity.distance_m.is_finite() && intensity.distance_m > 0.0;
        let message = format!("{} m is no distance", intensity.distance_m);
        self.check(is_distance, &at("distance_m"), message, "give a positive number of metres");
        let Angles::Listed(lists) = &intensity.angles else { return };
        let all = |list: &[f64], sound: fn(&f64) -> bool| !list.is_empty() && list.iter().all(sound);
        let (gamma, c) = (all(&lists.gamma_deg, |g| (0.0..=180.0).contains(g)), all(&lists.c_deg, |c| c.is_finite()));
        let help = "list gamma angles from 0 (nadir) to 180 (zenith)";
        self.check(gamma, &at("angles.gamma_deg"), "not a list of gamma angles", help);
        self.check(c, &at("angles.c_deg"), "not a list of C angles", "list C planes in degrees");
        let count = lists.gamma_deg.len().saturating_mul(lists.c_deg.len());
        let help = format!("a procedure measures at {MAX_METERS} angles at most");
        self.check(count <= MAX_METERS, &at("angles"), format!("{count} angles"), help);
        self.take(&at("angles"), "angles", count, |left| &mut left.meters);
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
                self.fault(&at, |source| source.error_at_spot(Spot::Key, &at, message, help));
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
