//! The surfaces on which meters of luminance lie.

use std::collections::{BTreeMap, BTreeSet};

use luxproof_scene::surface::{NoSurface, REACH_M, Surfaces};
use luxproof_scene::{Meter, Scene};

use super::super::model::Spec;
use super::Builder;
use super::meters::others;
use crate::procedures::{Names, Reads};

/// As many pairs of a meter and what is looked at for it are looked at.
pub(super) const MAX_LOOKS: usize = 20_000_000;

/// Why a half cylinder faces nowhere.
#[derive(Debug, thiserror::Error)]
#[error("looks straight up or down")]
struct NoAzimuth;

/// What is found for each meter of some sets, or why there is nothing.
pub(super) type FoundAt<'m, T, E> = (&'m str, &'m [Meter], Vec<Result<T, E>>);

/// The sets that procedures are asked of that read this, each once.
pub(super) fn sets_of<'m>(
    spec: &'m Spec,
    meters: &'m BTreeMap<String, Vec<Meter>>,
    reads: Reads,
) -> Vec<(&'m str, &'m [Meter])> {
    let asked =
        spec.procedures.0.iter().filter(|(id, _)| crate::procedures::row(**id).reads == reads).map(|(_, asked)| asked);
    let names: BTreeSet<&str> = asked.filter_map(|asked| asked.named().1).flat_map(Names::iter).collect();
    names.into_iter().filter_map(|name| Some((name, &meters.get(name)?[..]))).collect()
}

impl Builder<'_> {
    /// The reflectance beneath each meter, of the sets that luminance is asked of.
    pub(super) fn surfaces(
        &mut self,
        spec: &Spec,
        scene: &Scene,
        meters: &BTreeMap<String, Vec<Meter>>,
    ) -> BTreeMap<String, Vec<f64>> {
        let sets = sets_of(spec, meters, Reads::Luminance);
        // What was reported already, an invalid room, leaves no surfaces to lie on.
        if sets.is_empty() || scene.room.is_none() || !self.faults.is_empty() {
            return BTreeMap::new();
        }
        let surfaces = match Surfaces::new(scene) {
            Ok(surfaces) => surfaces,
            Err(error) => {
                self.check(false, "obstacles", error.to_string(), "simplify or repair the mesh");
                return BTreeMap::new();
            }
        };
        let looks = sets.iter().map(|(_, set)| set.len()).sum::<usize>().saturating_mul(surfaces.reflectances());
        let message = format!("luminance at so many meters among {} reflectances", surfaces.reflectances());
        if !self.check(looks <= MAX_LOOKS, "procedures", message, "read it at fewer meters") {
            return BTreeMap::new();
        }
        let found = sets
            .into_iter()
            .map(|(name, set)| (name, set, set.iter().map(|meter| surfaces.under(meter)).collect()))
            .collect();
        self.at_each(spec, found, "a luminance meter lies on a surface", |fault| match fault {
            NoSurface::Far => {
                format!("put it up to {} mm off the surface, 1 mm say, facing as the surface does", 1e3 * REACH_M)
            }
            NoSurface::Turned { normal } => {
                let [x, y, z] = normal.to_array().map(|x| (x * 1e9).round() / 1e9 + 0.0);
                format!("give it the surface's own `normal: [{x}, {y}, {z}]`")
            }
            NoSurface::Several(..) => {
                "move it to where there is one; a recessed luminaire's opening is a surface of reflectance 0".to_owned()
            }
        })
    }

    /// Refuses half cylinders that face straight up or down.
    pub(super) fn semicylinders(&mut self, spec: &Spec, meters: &BTreeMap<String, Vec<Meter>>) {
        let sets = sets_of(spec, meters, Reads::Semicylinder);
        let find = |meter: &Meter| crate::procedures::horizontal(meter.normal).ok_or(NoAzimuth);
        let found = sets.into_iter().map(|(name, set)| (name, set, set.iter().map(find).collect())).collect();
        self.at_each(spec, found, "a half cylinder faces along the horizon", |_| {
            "give a normal with a horizontal part, [1, 0, 0] say".to_owned()
        });
    }

    /// What was found, set by set; of each the first meter that there is nothing for is reported, and how many more there are.
    pub(super) fn at_each<T, E: std::fmt::Display>(
        &mut self,
        spec: &Spec,
        found: Vec<FoundAt<'_, T, E>>,
        rule: &str,
        help: impl Fn(&E) -> String,
    ) -> BTreeMap<String, Vec<T>> {
        let mut all = BTreeMap::new();
        for (name, meters, found) in found {
            let mut wrong = found.iter().enumerate().filter_map(|(k, found)| Some((k, found.as_ref().err()?)));
            if let Some((k, fault)) = wrong.next() {
                let others = others(wrong.count());
                // A set by points has each of them for a place, or several meters `around` each.
                let points = spec.meters.get(name).and_then(|set| set.points_m.as_ref());
                let is_one_by_one = points.is_some_and(|points| points.len() == meters.len());
                let place = if is_one_by_one { format!(".points_m[{k}]") } else { String::new() };
                let message = format!("{rule}; {name}[{k}] at {} {fault}{others}", meters[k].position_m);
                self.check(false, &format!("meters.{name}{place}"), message, help(fault));
                continue;
            }
            all.insert(name.to_owned(), found.into_iter().filter_map(Result::ok).collect());
        }
        all
    }
}
