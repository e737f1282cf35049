//! A cause that explains readings, in words and numbers.

/// The part of an engine that a cause is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Aspect {
    /// Units and factors.
    Units,
    /// Directions of luminaires, their tables, and meters.
    Orientation,
    /// Which reading belongs to which meter.
    Meters,
    /// Paths of light: bodies, surfaces, reflections.
    Light,
    /// More than one of these.
    Several,
}

/// How well a cause explains readings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Evidence {
    /// Readings that the cause explains.
    pub(super) readings: usize,
    /// The largest deviation with the cause, in percent.
    pub(super) left: f64,
    /// The largest deviation without it, in percent.
    pub(super) before: f64,
    /// The quotient of all readings and the reference, with its standard error, where the cause is a factor.
    pub(super) factor: Option<(f64, f64)>,
}

/// Larger deviations are not stated in percent.
const MAX_PERCENT: f64 = 1000.0;

/// An explanation of failing readings.
#[derive(Clone, Debug, PartialEq)]
pub struct Cause {
    pub id: &'static str,
    /// The quantity that is wrong.
    pub about: String,
    /// What went wrong, with its parameters, without the evidence.
    pub what: String,
    /// Fitted values with their standard errors; a free factor comes last.
    pub parameters: Vec<(f64, f64)>,
    pub(super) evidence: Evidence,
    /// Chi-squared of the residuals, and the penalty of the free parameters.
    pub(super) score: f64,
}

/// A deviation in percent; as a multiple of the reference where percent are no measure any more.
fn off_by(percent: f64) -> String {
    if percent <= MAX_PERCENT {
        format!("{percent:.1} %")
    } else {
        format!("{:.0} times the reference", percent / 100.0)
    }
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
                "{}: that explains all {readings} wrong values to {left:.2} % (without it: up to {})",
                self.what,
                off_by(before)
            ),
        }
    }

    /// The part of an engine that the cause is about, by its id.
    pub fn aspect(&self) -> Aspect {
        match self.id {
            "two" => Aspect::Several,
            "scene-of" | "reversed" | "next" | "previous" | "exchanged" | "shifted" | "shifted-here" | "lifted" => {
                Aspect::Meters
            }
            "turned" | "isotropic" | "averaged" | "extrapolated" | "unrotated" | "rotated-back" | "area-as-point"
            | "meter-flipped" | "meters-up" | "two-sided" | "normals-ignored" | "cosine-missing" | "cosine-doubled"
            | "place" | "turn" | "tilt" | "one-table" | "one-table-scaled" | "one-plane" | "gamma-flipped"
            | "gamma-off" | "frame" | "axes" | "coordinates" | "normals" | "places" | "angles" | "lookup"
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

    /// How likely it is, relative to the best: by the difference of Schwarz's criterion (Kass and Raftery, J. Am. Statist. Assoc. 90, 1995).
    fn likelihood(&self, best_score: f64) -> f64 {
        (-0.5 * (self.score - best_score)).exp()
    }

    pub(super) fn rename(self, id: &'static str, what: String) -> Self {
        Self { id, about: what.clone(), what, ..self }
    }
}

/// Describes all causes that explain the same readings, each with its probability where there are several.
pub(super) fn describe_all(causes: &[Cause]) -> String {
    let best = causes.iter().map(|cause| cause.score).fold(f64::INFINITY, f64::min);
    let total: f64 = causes.iter().map(|cause| cause.likelihood(best)).sum();
    let mut texts = vec![];
    for cause in causes {
        let percent = 100.0 * cause.likelihood(best) / total;
        texts.push(if causes.len() > 1 { format!("{} ({percent:.0} % likely)", cause.text()) } else { cause.text() });
    }
    texts.join("; or ")
}
