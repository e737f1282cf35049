//! What explains readings, in words and numbers.

/// What of an engine a cause is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Aspect {
    /// How much a number is.
    Units,
    /// Where luminaires and their tables point, and where meters do.
    Orientation,
    /// Which reading is whose.
    Meters,
    /// How light goes: bodies, surfaces, reflections.
    Light,
    /// More than one of these.
    Several,
}

/// How well a cause explains readings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Evidence {
    /// How many.
    pub(super) readings: usize,
    /// How far they are off with it, in percent at most.
    pub(super) left: f64,
    /// How far they are off without.
    pub(super) before: f64,
    /// What all are times the reference, with its standard error, where that is all there is.
    pub(super) factor: Option<(f64, f64)>,
}

/// One explanation.
#[derive(Clone, Debug, PartialEq)]
pub struct Cause {
    pub id: &'static str,
    /// What it is a value of.
    pub about: String,
    /// What went wrong, with its parameters, without the evidence.
    pub what: String,
    /// What was fitted, each with its standard error, a free factor last.
    pub parameters: Vec<(f64, f64)>,
    pub(super) evidence: Evidence,
    /// Chi-squared of what it leaves, and what its free parameters cost.
    pub(super) score: f64,
}

impl Cause {
    /// What went wrong, with the evidence.
    pub fn text(&self) -> String {
        let Evidence { readings, left, before, factor } = self.evidence;
        match factor {
            Some((factor, error)) => {
                format!("{}: all {readings} readings are {factor:.4} ± {error:.4} times the reference", self.what)
            }
            None => format!(
                "{}: that explains all {readings} readings to {left:.2} %, which are up to {before:.1} % off otherwise",
                self.what
            ),
        }
    }

    pub fn aspect(&self) -> Aspect {
        match self.id {
            "two" => Aspect::Several,
            "scene-of" | "reversed" | "next" | "previous" | "exchanged" | "shifted" | "shifted-here" | "lifted" => {
                Aspect::Meters
            }
            "turned" | "isotropic" | "averaged" | "extrapolated" | "unrotated" | "rotated-back" | "area-as-point"
            | "meter-flipped" | "meters-up" | "two-sided" | "normals-ignored" | "cosine-missing" | "cosine-doubled"
            | "place" | "turn" | "tilt" | "one-table" | "one-table-scaled" | "one-plane" | "gamma-flipped"
            | "gamma-off" | "frame" | "axes" | "coordinates" | "normals" | "places" | "angles" | "lookup" | "nodes"
            | "emission" => Aspect::Orientation,
            id if id.starts_with("c-") => Aspect::Orientation,
            "upside-down"
            | "gamma-decoded"
            | "gamma-encoded"
            | "bounces-cut"
            | "bounces-uncut"
            | "direct-lost"
            | "direct-added"
            | "indirect-added"
            | "surface-lost"
            | "luminaire-lost"
            | "one-lit"
            | "reflectances"
            | "reflectance"
            | "power"
            | "mixed-up"
            | "some-lit"
            | "mean"
            | "brightest"
            | "bodies-lost"
            | "box-size"
            | "box-centre"
            | "reflected"
            | "first-reflection-lost"
            | "surfaces"
            | "same" => Aspect::Light,
            _ => Aspect::Units,
        }
    }

    pub(super) fn renamed(self, id: &'static str, what: String) -> Self {
        Self { id, about: what.clone(), what, ..self }
    }
}
