//! The model of the luminaires of a case, and the reason for it.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A point may stand for a luminous opening from so many of its largest dimensions on (CIE 121-1996; IES Lighting Handbook).
pub const FIVE_TIMES: f64 = 5.0;

/// Luminaires that one line of a report lists by name.
const LISTED_LUMINAIRES: usize = 2;

/// How the extent of some luminaires of a case is modelled, and why.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LuminaireModelChoice {
    /// The `id`s in the spec.
    pub luminaires: Vec<String>,
    /// `point`, `area` or `impostor`.
    pub model: String,
    /// Whether luxproof chose the model (`model: auto`).
    pub is_automatic: bool,
    /// The largest dimension of the luminous opening in metres; 0 for a file without an opening.
    pub largest_dimension_m: f64,
    /// The point that is nearest to any of them; if that is far enough, the nearest point or lit surface.
    pub nearest: Option<NearestPlace>,
}

/// The point or lit surface that is nearest to a luminaire.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct NearestPlace {
    /// For example `desk[5]`, `floor` or `obstacles[0]`.
    pub name: String,
    /// From the photometric centre, in metres.
    pub distance_m: f64,
    /// What a point computes too much at this place, relative, if the opening is Lambertian; none for surfaces and where
    /// the place sees only a part of the opening.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub point_error: Option<f64>,
}

impl LuminaireModelChoice {
    /// The nearest place if it is nearer than [`FIVE_TIMES`] the opening.
    pub fn too_near(&self) -> Option<&NearestPlace> {
        self.nearest.as_ref().filter(|place| place.distance_m < FIVE_TIMES * self.largest_dimension_m)
    }

    /// Whether two choices differ in nothing but the luminaires and their nearest place.
    pub fn has_same_model(&self, other: &Self) -> bool {
        self.model == other.model
            && self.is_automatic == other.is_automatic
            && self.largest_dimension_m == other.largest_dimension_m
            && self.too_near().is_some() == other.too_near().is_some()
    }

    /// Adds the luminaires of a choice of the same model, and takes its nearest place if that is nearer.
    pub fn join(&mut self, other: Self) {
        self.luminaires.extend(other.luminaires);
        let distance_m = |place: &Option<NearestPlace>| place.as_ref().map_or(f64::INFINITY, |p| p.distance_m);
        if distance_m(&other.nearest) < distance_m(&self.nearest) {
            self.nearest = other.nearest;
        }
    }

    /// The names of the luminaires, the first few of many.
    pub fn names(&self) -> String {
        let (listed, rest) = self.luminaires.split_at(self.luminaires.len().min(LISTED_LUMINAIRES));
        match rest.len() {
            0 => listed.join(", "),
            n => format!("{} and {n} more", listed.join(", ")),
        }
    }

    /// The reason for the model, with the figure.
    pub fn reason(&self) -> String {
        let size_m = self.largest_dimension_m;
        if size_m == 0.0 {
            return "the file has no opening".to_owned();
        }
        match (&self.nearest, self.too_near()) {
            (Some(_), Some(place)) => {
                format!("{}, below {FIVE_TIMES}", place.in_times(size_m))
            }
            (Some(place), None) => {
                format!("{}, not below {FIVE_TIMES}", place.in_times(size_m))
            }
            (None, _) => "no point or lit surface is near".to_owned(),
        }
    }
}

impl NearestPlace {
    /// The distance in metres and as a multiple of the opening's size.
    fn in_times(&self, size_m: f64) -> String {
        let Self { name, distance_m, .. } = self;
        format!("{name} is {distance_m:.2} m away, {:.2} times its size", distance_m / size_m)
    }

    /// The distance in metres and in sizes of the opening.
    pub fn in_sizes(&self, largest_dimension_m: f64) -> String {
        let (distance_m, sizes) = (self.distance_m, self.distance_m / largest_dimension_m);
        format!("{} is {distance_m:.2} m = {sizes:.2} opening sizes ({largest_dimension_m} m) away", self.name)
    }
}

impl fmt::Display for LuminaireModelChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let by = if self.is_automatic { "auto" } else { "by spec" };
        write!(f, "{} ({by}) for {}: {}", self.model, self.names(), self.reason())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn panel(id: &str, distance_m: f64) -> LuminaireModelChoice {
        let nearest = Some(NearestPlace { name: "desk[5]".into(), distance_m, point_error: None });
        LuminaireModelChoice {
            luminaires: vec![id.into()],
            model: "area".into(),
            is_automatic: true,
            largest_dimension_m: 0.5,
            nearest,
        }
    }

    #[test]
    fn a_choice_states_the_distance_in_sizes() {
        assert_eq!(
            panel("p1", 2.0).to_string(),
            "area (auto) for p1: desk[5] is 2.00 m away, 4.00 times its size, below 5"
        );
        assert_eq!(panel("p1", 2.5).too_near(), None);
    }

    #[test]
    fn joined_choices_have_the_nearest_place_of_all() {
        let mut all = panel("p1", 2.0);
        for (k, distance_m) in [1.5, 1.0, 2.2].into_iter().enumerate() {
            all.join(panel(&format!("q{k}"), distance_m));
        }
        assert_eq!(all.names(), "p1, q0 and 2 more");
        assert_eq!(all.nearest.unwrap().distance_m, 1.0);
    }

    #[test]
    fn five_times_the_opening_is_far_enough() {
        let near = panel("p", 2.499);
        assert_eq!(near.too_near().map(|place| place.name.as_str()), Some("desk[5]"));
        assert_eq!(panel("p", 2.5).reason(), "desk[5] is 2.50 m away, 5.00 times its size, not below 5");
        let alone = LuminaireModelChoice { nearest: None, is_automatic: false, ..panel("p", 1.0) };
        assert_eq!(alone.to_string(), "area (by spec) for p: no point or lit surface is near");
        let bare = LuminaireModelChoice { largest_dimension_m: 0.0, ..panel("p", 1.0) };
        assert_eq!(bare.reason(), "the file has no opening");
        let sizes = near.nearest.unwrap().in_sizes(0.5);
        assert_eq!(sizes, "desk[5] is 2.50 m = 5.00 opening sizes (0.5 m) away");
    }

    #[test]
    fn choices_have_the_same_model_where_all_but_names_and_places_are_equal() {
        let first = panel("p", 2.0);
        assert!(first.has_same_model(&panel("q", 1.0)));
        for other in [
            LuminaireModelChoice { model: "point".into(), ..panel("p", 2.0) },
            LuminaireModelChoice { is_automatic: false, ..panel("p", 2.0) },
            LuminaireModelChoice { largest_dimension_m: 0.6, ..panel("p", 2.0) },
            panel("p", 3.0),
        ] {
            assert!(!first.has_same_model(&other) && !other.has_same_model(&first), "{other:?}");
        }
    }

    #[test]
    fn few_luminaires_are_all_named_and_a_place_replaces_none() {
        let mut all = LuminaireModelChoice { nearest: None, ..panel("p1", 1.0) };
        assert_eq!(all.names(), "p1");
        all.join(LuminaireModelChoice { nearest: None, ..panel("p2", 1.0) });
        assert_eq!((all.names().as_str(), &all.nearest), ("p1, p2", &None));
        all.join(panel("p3", 7.0));
        assert_eq!(
            (all.names().as_str(), all.nearest.as_ref().map(|p| p.distance_m)),
            ("p1, p2 and 1 more", Some(7.0))
        );
        // Of two at one distance the first stays.
        let mut other = panel("p4", 7.0);
        other.nearest.as_mut().unwrap().name = "wall".into();
        all.join(other);
        assert_eq!(all.nearest.unwrap().name, "desk[5]");
    }
}
