//! The surfaces on which meters of luminance lie.

use std::collections::{BTreeMap, BTreeSet};

use luminaire::scene::surface::{NoSurface, REACH_M, Surfaces};
use luminaire::scene::{Meter, Scene};

use super::super::model::{MeterSet, Spec};
use super::Builder;
use crate::procedures::{Asked, Reads};

/// As many pairs of a meter and a reflectance are looked at.
const MAX_LOOKS: usize = 20_000_000;

impl Builder<'_> {
    /// The reflectance beneath each meter, of the sets that luminance is asked of.
    pub(super) fn surfaces(
        &mut self,
        spec: &Spec,
        scene: &Scene,
        meters: &BTreeMap<String, Vec<Meter>>,
    ) -> BTreeMap<String, Vec<f64>> {
        let of_surfaces = spec.procedures.0.iter().filter(|(id, _)| id.row().reads == Reads::Luminance);
        let names: BTreeSet<&str> = of_surfaces
            .flat_map(|(_, asked)| match asked {
                Asked::Meters(asked) => asked.meters.iter().collect(),
                Asked::Angles(_) => vec![],
            })
            .collect();
        let sets: Vec<(&str, &Vec<Meter>)> = names.iter().filter_map(|n| Some((*n, meters.get(*n)?))).collect();
        // What is no room, or was mended, has no surfaces to lie on.
        let is_whole = scene.room.is_some() && self.faults.is_empty();
        if !is_whole || sets.is_empty() {
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
        let of_set = |(name, set): (&str, &Vec<Meter>)| {
            let found: Vec<Result<f64, NoSurface>> = set.iter().map(|meter| surfaces.under(meter)).collect();
            self.on_no_surface(name, spec.meters.get(name)?, set, &found);
            Some((name.to_owned(), found.into_iter().collect::<Result<_, _>>().ok()?))
        };
        sets.into_iter().filter_map(of_set).collect()
    }

    /// Tells the first meter that lies on no surface, and how many more there are.
    fn on_no_surface(&mut self, name: &str, set: &MeterSet, meters: &[Meter], found: &[Result<f64, NoSurface>]) {
        let mut wrong = found.iter().enumerate().filter_map(|(k, found)| Some((k, found.err()?)));
        let Some((k, fault)) = wrong.next() else { return };
        let others = match wrong.count() {
            0 => String::new(),
            n => format!(", and {n} more do not lie on theirs"),
        };
        let help = match fault {
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
        };
        // A set by points has each of them for a place, or several meters `around` each.
        let at = match &set.points_m {
            Some(points) if points.len() == meters.len() => format!("meters.{name}.points_m[{k}]"),
            _ => format!("meters.{name}"),
        };
        let position_m = meters[k].position_m;
        let message = format!("a luminance meter lies on a surface; {name}[{k}] at {position_m} {fault}{others}");
        self.check(false, &at, message, help);
    }
}
