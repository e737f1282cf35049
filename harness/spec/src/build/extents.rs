//! The model of each luminaire: `model: auto` becomes `area` or `point` by the five-times rule.

use std::collections::BTreeMap;

use glam::DVec3;
use luxproof_calculators::inverse_square::{lambertian_twin, largest_dimension_m};
use luxproof_model::{FIVE_TIMES, LuminaireModelChoice, NearestPlace};
use luxproof_scene::contact::SNAP_M;
use luxproof_scene::geometry::{Mesh, Surface};
use luxproof_scene::{Luminaire, LuminaireModel, Meter, Scene, Shape, flush};

use super::super::model::ModelSpec;

/// The most pairs of a luminaire and a point or triangle that are measured one by one. Beyond that, boxes around sets and
/// meshes are measured, which are never farther away.
const MAX_PAIRS: usize = 20_000_000;

/// A place near a luminaire, before its name is written.
struct Place<'a> {
    distance_m: f64,
    kind: PlaceKind<'a>,
}

enum PlaceKind<'a> {
    Meter { set: &'a str, index: usize, meter: Meter },
    Set(&'a str),
    Surface(Surface),
    Obstacle(usize),
    Wall,
}

/// What the distances of luminaires are measured to.
pub(super) struct Surroundings<'a> {
    pub(super) scene: &'a Scene,
    /// How many of the scene's obstacles the spec lists as such; the rest are inner walls.
    pub(super) listed_obstacles: usize,
    pub(super) meters: &'a BTreeMap<String, Vec<Meter>>,
}

impl Surroundings<'_> {
    /// Chooses the model of the luminaires of one entry of the spec, one for all of them, and sets it.
    pub(super) fn choose_model(
        &self,
        id: &str,
        model: ModelSpec,
        luminaires: &mut [Luminaire],
    ) -> LuminaireModelChoice {
        let size_m = luminaires.first().map_or(0.0, |l| largest_dimension_m(&l.photometry.opening));
        let nearest = if size_m > 0.0 { self.nearest_to_any(luminaires) } else { None };
        let is_near = nearest.as_ref().is_some_and(|place| place.distance_m < FIVE_TIMES * size_m);
        let chosen = match model {
            ModelSpec::Auto if is_near => LuminaireModel::Area,
            ModelSpec::Auto | ModelSpec::Point => LuminaireModel::Point,
            ModelSpec::Area => LuminaireModel::Area,
            ModelSpec::Impostor => LuminaireModel::Impostor,
        };
        for luminaire in luminaires.iter_mut() {
            luminaire.model = chosen;
        }
        LuminaireModelChoice {
            luminaires: vec![id.to_owned()],
            model: chosen.name().to_owned(),
            is_automatic: model == ModelSpec::Auto,
            largest_dimension_m: size_m,
            nearest,
        }
    }

    /// The place that is nearest to any of some luminaires of one file and orientation.
    fn nearest_to_any(&self, luminaires: &[Luminaire]) -> Option<NearestPlace> {
        let lit: Vec<Surface> = match luminaires {
            [first, ..] => {
                Surface::ALL.into_iter().filter(|s| flush::shines_along(-s.inward_normal(), first)).collect()
            }
            [] => vec![],
        };
        let is_exact = self.pairs_per_luminaire().saturating_mul(self.scene.luminaires.len()) <= MAX_PAIRS;
        let points = luminaires.iter().filter_map(|l| Some((l, self.nearest_point(l, is_exact)?)));
        let point = nearest_pair(points);
        let limit_m = FIVE_TIMES * largest_dimension_m(&luminaires.first()?.photometry.opening);
        // A point decides before any surface, because its error is known.
        let (luminaire, place) = match point {
            Some((luminaire, place)) if place.distance_m < limit_m => (luminaire, place),
            point => {
                let surfaces = luminaires.iter().filter_map(|l| Some((l, self.nearest_surface(l, &lit, is_exact)?)));
                nearest_pair(point.into_iter().chain(surfaces))?
            }
        };
        let (name, point_error) = match place.kind {
            PlaceKind::Meter { set, index, meter } => (format!("{set}[{index}]"), lambertian_twin(luminaire, &meter)),
            PlaceKind::Set(set) => (set.to_owned(), None),
            PlaceKind::Surface(surface) => (surface.name().to_owned(), None),
            PlaceKind::Obstacle(k) => (format!("obstacles[{k}]"), None),
            PlaceKind::Wall => ("a wall".to_owned(), None),
        };
        Some(NearestPlace { name, distance_m: place.distance_m, point_error })
    }

    /// The points and triangles that are measured for one luminaire.
    fn pairs_per_luminaire(&self) -> usize {
        let triangles = self.scene.obstacles.iter().map(|o| match &o.shape {
            Shape::Box { .. } => 1,
            Shape::Mesh { triangles, .. } => triangles.len(),
        });
        self.meters.values().map(Vec::len).chain(triangles).sum()
    }

    /// The point that is nearest to a luminaire.
    fn nearest_point(&self, luminaire: &Luminaire, is_exact: bool) -> Option<Place<'_>> {
        let at_m = luminaire.position_m;
        let find = if is_exact { nearest_meter } else { nearest_of_set };
        let places = self.meters.iter().filter_map(|(set, meters)| find(set, meters, at_m));
        places.min_by(|a, b| a.distance_m.total_cmp(&b.distance_m))
    }

    /// The lit surface that is nearest to a luminaire; `lit` are the surfaces of the room's box that it shines at.
    fn nearest_surface(&self, luminaire: &Luminaire, lit: &[Surface], is_exact: bool) -> Option<Place<'_>> {
        let at_m = luminaire.position_m;
        let mut nearest: Option<Place<'_>> = None;
        for (surface, room) in lit.iter().filter_map(|s| self.scene.room.as_ref().map(|room| (*s, room))) {
            let distance_m = (at_m - room.corners(surface)[0]).dot(surface.inward_normal());
            if distance_m > 2.0 * SNAP_M && nearest.as_ref().is_none_or(|n| distance_m < n.distance_m) {
                nearest = Some(Place { distance_m, kind: PlaceKind::Surface(surface) });
            }
        }
        for (k, obstacle) in self.scene.obstacles.iter().enumerate() {
            let closest_m = closest_on_shape(&obstacle.shape, at_m, is_exact);
            let distance_m = closest_m.distance(at_m);
            // The surface that it lies on gets no light, and a body that is farther decides nothing.
            let is_nearer = nearest.as_ref().is_none_or(|n| distance_m < n.distance_m);
            if is_nearer && distance_m > 2.0 * SNAP_M && flush::shines_along((closest_m - at_m) / distance_m, luminaire)
            {
                let kind = if k < self.listed_obstacles { PlaceKind::Obstacle(k) } else { PlaceKind::Wall };
                nearest = Some(Place { distance_m, kind });
            }
        }
        nearest
    }
}

/// The luminaire and place that are nearest to each other.
fn nearest_pair<'a>(pairs: impl Iterator<Item = (&'a Luminaire, Place<'a>)>) -> Option<(&'a Luminaire, Place<'a>)> {
    pairs.min_by(|a, b| a.1.distance_m.total_cmp(&b.1.distance_m))
}

/// The nearest meter of a set.
fn nearest_meter<'a>(set: &'a str, meters: &[Meter], at_m: DVec3) -> Option<Place<'a>> {
    let squared_m2 = |meter: &Meter| meter.position_m.distance_squared(at_m);
    let (index, meter) = meters.iter().enumerate().min_by(|a, b| squared_m2(a.1).total_cmp(&squared_m2(b.1)))?;
    let kind = PlaceKind::Meter { set, index, meter: *meter };
    Some(Place { distance_m: meter.position_m.distance(at_m), kind })
}

/// The box around a set of meters.
fn nearest_of_set<'a>(set: &'a str, meters: &[Meter], at_m: DVec3) -> Option<Place<'a>> {
    let corners = || meters.iter().map(|meter| meter.position_m);
    let (low_m, high_m) = (corners().reduce(DVec3::min)?, corners().reduce(DVec3::max)?);
    Some(Place { distance_m: at_m.clamp(low_m, high_m).distance(at_m), kind: PlaceKind::Set(set) })
}

/// The point of a shape that is closest to a point; of a mesh that is not measured exactly, of the box around it.
fn closest_on_shape(shape: &Shape, at_m: DVec3, is_exact: bool) -> DVec3 {
    match shape {
        Shape::Box { min_m, max_m } => at_m.clamp(*min_m, *max_m),
        Shape::Mesh { vertices_m, .. } if !is_exact => {
            let (low_m, high_m) = vertices_m
                .iter()
                .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), v| (low.min(*v), high.max(*v)));
            if low_m.cmple(high_m).all() { at_m.clamp(low_m, high_m) } else { DVec3::INFINITY }
        }
        Shape::Mesh { vertices_m, triangles } => Mesh::closest_point_m(vertices_m, triangles, at_m),
    }
}

#[cfg(test)]
mod tests {
    use std::path::{Path, PathBuf};

    use luxproof_model::LuminaireModelChoice;

    use crate::model::ModelSpec;
    use crate::{Case, find_lints, specs};

    fn reference() -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../reference")
    }

    /// A case of one luminaire 0.6 m wide in the middle of a room of this size, over a point so far below it.
    fn case(keys: &str, size_m: f64, below_m: f64) -> Case {
        let (middle, folder) = (size_m / 2.0, tempfile::tempdir().unwrap());
        let file = reference().join("luminaires/lambertian-06m.ies");
        let spec = format!(
            "luxproof: 1
room: {{size_m: [{size_m}, {size_m}, {size_m}], reflectance: {{floor: 0.2, walls: 0.5, ceiling: 0.8}}}}
luminaires: [{{id: a, photometry: {}, at_m: [{middle}, {middle}, {middle}]{keys}}}]
meters: {{plane: {{points_m: [[{middle}, {middle}, {}]], normal: [0, 0, 1]}}}}
procedures: {{direct_illuminance: {{meters: plane}}}}
",
            file.display(),
            middle - below_m
        );
        let path = folder.path().join("spec.yaml");
        std::fs::write(&path, spec).unwrap();
        Case::load(&path).unwrap()
    }

    fn choice(of: &Case) -> (&str, &str) {
        let LuminaireModelChoice { model, nearest, .. } = &of.luminaire_models[0];
        (model, nearest.as_ref().map_or("", |place| &place.name))
    }

    #[test]
    fn an_opening_is_an_area_where_a_point_or_a_lit_surface_is_nearer_than_five_sizes() {
        assert_eq!(choice(&case("", 20.0, 2.99)), ("area", "plane[0]"));
        assert_eq!(choice(&case("", 20.0, 3.0)), ("point", "plane[0]"));
        // Walls 2.9 m away; the ceiling is as near and gets no light from a table that ends at 90 degrees.
        assert_eq!(choice(&case("", 5.8, 2.8)), ("area", "plane[0]"));
        let (narrow, wide) = (case(", rotate_deg: {tilt: 180}", 5.9, 2.94), case("", 6.0, 2.99));
        assert_eq!((choice(&narrow).0, choice(&wide).0), ("area", "area"));
    }

    #[test]
    fn a_point_where_the_rule_is_violated_is_a_lint_with_its_figure() {
        // A Lambertian square at k sides: the point is (1/3)/k^2 too bright below it, to the next order 1/15/k^4.
        let near = case(", model: point", 20.0, 1.8);
        let lints = find_lints(std::slice::from_ref(&near));
        assert_eq!(lints.len(), 1, "{lints:?}");
        assert!(lints[0].message.contains("1.80 m = 3.00 opening sizes (0.6 m)"), "{}", lints[0].message);
        let error = near.luminaire_models[0].nearest.as_ref().unwrap().point_error.unwrap();
        assert!((error - 1.0 / 27.0).abs() < 0.002, "{error}");
        assert!(find_lints(&[case(", model: point", 20.0, 3.0)]).is_empty());
        assert!(find_lints(&[case(", model: area", 20.0, 1.8)]).is_empty());
    }

    #[test]
    fn a_face_has_the_reflectance_of_its_luminaire_and_one_without_a_face_is_a_lint() {
        let folder = case(", model: area, face_reflectance: 0.6", 20.0, 1.8);
        assert!(find_lints(&[folder])[0].message.starts_with("luminaires[0].face_reflectance"));
    }

    #[test]
    fn every_reference_spec_states_the_models_of_its_luminaires() {
        let pattern = reference().join("**/*.yaml");
        let mut read = 0;
        for path in glob::glob(pattern.to_str().unwrap()).unwrap().map(Result::unwrap) {
            if !std::fs::read_to_string(&path).unwrap().lines().any(|line| line.starts_with("luxproof:")) {
                continue;
            }
            for (name, spec) in specs(&path).unwrap() {
                read += 1;
                assert!(spec.luminaires.iter().all(|l| l.model != ModelSpec::Auto), "{name}");
            }
        }
        assert!(read > 40, "{read}");
    }
}
