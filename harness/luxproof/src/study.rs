//! Studies: deviations that somebody published, explained by causes with shares and uncertainty.
//!
//! A study is a folder with a `study.yaml`, such as `reference/studies/cycles-cie171-2026`. Factors of causes multiply.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use luxproof_spec::{Source, SpecError, Trust, from_yaml};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The file of a study in its folder.
pub const STUDY_FILE: &str = "study.yaml";
/// A remainder within so many standard uncertainties is explained: GUM 6.3.3, about 95 %.
const COVERAGE_FACTOR: f64 = 2.0;
const HELP: &str = "see reference/studies/cycles-cie171-2026/study.yaml";

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct StudyFile {
    luxproof_study: u32,
    title: String,
    source: String,
    causes: BTreeMap<String, Cause>,
    deviations: Vec<PublishedDeviation>,
}

#[derive(Debug, Deserialize)]
struct Cause {
    #[serde(flatten)]
    kind: CauseKind,
    meaning: String,
}

/// What a cause does to a value.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
enum CauseKind {
    /// The value was compared with a printed one that deviates by the given percentage.
    Reference,
    /// The quotient of two unit constants.
    UnitRatio { numerator: f64, denominator: f64 },
    /// Light stops after so many reflections: 1 - rho^n of the indirect light is left.
    Reflections { reflections: f64, uncertainty: f64 },
    /// The percentage is given with the deviation.
    Given,
}

/// A published deviation and the parameters of its causes.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct PublishedDeviation {
    case: String,
    point: String,
    /// In percent.
    published: f64,
    /// Half width of the interval that rounding leaves, in percent.
    rounding: f64,
    causes: BTreeMap<String, Parameters>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct Parameters {
    percent: Option<f64>,
    /// Standard uncertainty, in percent.
    #[serde(default)]
    uncertainty: f64,
    reflectance: Option<f64>,
}

/// The share of a cause in a deviation.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Contribution {
    pub cause: String,
    /// Deviation by this cause alone.
    pub percent: f64,
    pub uncertainty_percent: f64,
    /// Of the published deviation, in logarithms; negative where the cause acts against it.
    pub share: f64,
}

/// A published deviation with its explanation.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct ExplainedDeviation {
    pub case: String,
    pub point: String,
    pub published_percent: f64,
    pub contributions: Vec<Contribution>,
    /// What no cause explains.
    pub rest_percent: f64,
    /// Expanded uncertainty of the rest.
    pub uncertainty_percent: f64,
    /// Whether the rest lies within its uncertainty.
    pub is_explained: bool,
    /// Whether rounding and scatter cover the published deviation without any cause: it then tests none.
    pub is_scatter: bool,
}

/// A study with all of its deviations.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Explanation {
    pub title: String,
    pub source: String,
    /// The meaning of every cause.
    pub causes: BTreeMap<String, String>,
    pub deviations: Vec<ExplainedDeviation>,
}

/// The file of a study: `what` itself, or in it.
#[must_use]
pub fn study_file(what: &Path) -> Option<PathBuf> {
    let file = if what.is_dir() { what.join(STUDY_FILE) } else { what.to_owned() };
    let is_study = file.file_name().is_some_and(|name| name == STUDY_FILE) && file.is_file();
    is_study.then_some(file)
}

/// Explains the deviations of a study. One that is not trusted is no link, and none of its words is shown.
///
/// # Errors
/// If the file is unreadable, or a deviation names an unknown cause or lacks a parameter.
pub fn explain(path: &Path, trust: Trust) -> Result<Explanation, SpecError> {
    Source::read(path, trust).and_then(|source| explain_source(&source)).map_err(|error| error.withheld(trust))
}

fn explain_source(source: &Source) -> Result<Explanation, SpecError> {
    let file: StudyFile = from_yaml(&source.text).map_err(|error| source.error_at("", error, HELP))?;
    if file.luxproof_study != 1 {
        let message = format!("version {} is not known", file.luxproof_study);
        return Err(source.error_at("luxproof_study", message, "this program reads 1"));
    }
    let deviations = file.deviations.iter().enumerate();
    let deviations = deviations.map(|(k, deviation)| {
        explain_deviation(deviation, &file.causes)
            .map_err(|message| source.error_at(&format!("deviations[{k}]"), message, HELP))
    });
    Ok(Explanation {
        deviations: deviations.collect::<Result<_, _>>()?,
        causes: file.causes.iter().map(|(name, cause)| (name.clone(), cause.meaning.clone())).collect(),
        title: file.title,
        source: file.source,
    })
}

fn explain_deviation(
    deviation: &PublishedDeviation,
    causes: &BTreeMap<String, Cause>,
) -> Result<ExplainedDeviation, String> {
    let published = logarithm(deviation.published).ok_or("`published` is no percentage above -100")?;
    let mut contributions = vec![];
    // The rounding interval is a rectangular distribution.
    let mut scatter_variance = (deviation.rounding / 3_f64.sqrt()).powi(2);
    let mut cause_variance = 0.0;
    let mut sum = 0.0;
    for (name, parameters) in &deviation.causes {
        let cause = causes.get(name).ok_or_else(|| format!("`{name}` is no cause of this study"))?;
        let (percent, uncertainty) =
            effect(cause.kind, parameters).ok_or_else(|| format!("`{name}` lacks a parameter, or has a wrong one"))?;
        let log = logarithm(percent).ok_or_else(|| format!("`{name}` is no percentage above -100"))?;
        // A cause that shifts nothing is scatter.
        let part = if percent == 0.0 { &mut scatter_variance } else { &mut cause_variance };
        *part += uncertainty * uncertainty;
        sum += log;
        let share = if published == 0.0 { 0.0 } else { log / published };
        contributions.push(Contribution { cause: name.clone(), percent, uncertainty_percent: uncertainty, share });
    }
    let rest_percent = 100.0 * (published - sum).exp_m1();
    let uncertainty_percent = COVERAGE_FACTOR * (scatter_variance + cause_variance).sqrt();
    let has_scatter = contributions.iter().any(|c| c.percent == 0.0);
    if !rest_percent.is_finite() || !uncertainty_percent.is_finite() {
        return Err("a number is not finite".to_owned());
    }
    Ok(ExplainedDeviation {
        case: deviation.case.clone(),
        point: deviation.point.clone(),
        published_percent: deviation.published,
        rest_percent,
        uncertainty_percent,
        is_explained: !contributions.is_empty() && rest_percent.abs() <= uncertainty_percent,
        is_scatter: has_scatter && deviation.published.abs() <= COVERAGE_FACTOR * scatter_variance.sqrt(),
        contributions,
    })
}

/// The effect of a cause on a value and its standard uncertainty, both in percent.
fn effect(kind: CauseKind, parameters: &Parameters) -> Option<(f64, f64)> {
    let found = match kind {
        CauseKind::Given => (parameters.percent?, parameters.uncertainty),
        CauseKind::Reference => {
            let factor = 1.0 / (1.0 + parameters.percent? / 100.0);
            (100.0 * (factor - 1.0), parameters.uncertainty * factor)
        }
        CauseKind::UnitRatio { numerator, denominator } => (100.0 * (numerator / denominator - 1.0), 0.0),
        CauseKind::Reflections { reflections, uncertainty } => {
            let reflectance = parameters.reflectance.filter(|rho| *rho > 0.0 && *rho < 1.0)?;
            let lost = 100.0 * reflectance.powf(reflections);
            (-lost, -lost * reflectance.ln() * uncertainty)
        }
    };
    (found.0.is_finite() && found.1.is_finite() && found.1 >= 0.0).then_some(found)
}

/// The logarithm of the factor that a percentage stands for.
fn logarithm(percent: f64) -> Option<f64> {
    (percent > -100.0).then(|| (percent / 100.0).ln_1p())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cycles() -> Explanation {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../reference/studies/cycles-cie171-2026");
        explain(&study_file(&folder).unwrap(), Trust::Own).unwrap()
    }

    fn deviation_at<'a>(study: &'a Explanation, case: &str, point: &str) -> &'a ExplainedDeviation {
        study.deviations.iter().find(|d| d.case == case && d.point == point).unwrap()
    }

    #[test]
    fn the_study_of_cycles_leaves_eight_deviations_open() {
        let study = cycles();
        assert!(study.deviations.iter().all(|d| d.published_percent.abs() > 1.0));
        let open = study.deviations.iter().filter(|d| !d.is_explained);
        let open: Vec<String> = open.map(|d| format!("{} {}", d.case, d.point)).collect();
        let expected = [
            "5.9 1m-sky-2 A",
            "5.9 1m-sky-2 K",
            "5.9 1m-sky-12 A",
            "5.9 4m-sky-1 A",
            "5.9 4m-sky-5 A",
            "5.3 A",
            "5.3 B",
            "5.3 D",
        ];
        assert_eq!((open.as_slice(), study.deviations.len()), (expected.map(str::to_owned).as_slice(), 38));
    }

    #[test]
    fn a_printed_cell_that_is_too_high_explains_a_reading_that_seems_too_low() {
        let study = cycles();
        let at = deviation_at(&study, "5.9 4m-sky-1", "A");
        assert_eq!(at.contributions[0].cause, "standard");
        assert!((at.contributions[0].percent + 5.303).abs() < 0.001, "{at:?}");
        // The rest is what luxproof finds at this point itself.
        assert!((at.rest_percent + 0.39).abs() < 0.02, "{at:?}");
    }

    #[test]
    fn a_deviation_within_its_scatter_credits_no_cause() {
        let study = cycles();
        // The pane predicts 1.8 times the published deviation; what is left is within the scatter, as is the deviation.
        let small = deviation_at(&study, "5.10 1m-sky-1", "B");
        assert!(small.contributions.iter().map(|c| c.share).sum::<f64>() > 1.7, "{small:?}");
        assert!(small.is_explained && small.is_scatter, "{small:?}");
        // Scatter alone does not cover this one.
        let large = deviation_at(&study, "5.10 1m-sky-12", "A");
        assert!(large.is_explained && !large.is_scatter, "{large:?}");
        let explained: Vec<&ExplainedDeviation> = study.deviations.iter().filter(|d| d.is_explained).collect();
        assert_eq!((explained.iter().filter(|d| d.is_scatter).count(), explained.len()), (17, 30));
    }

    #[test]
    fn a_cause_of_another_size_leaves_a_rest() {
        let causes = BTreeMap::from([(
            "unit".to_owned(),
            Cause { kind: CauseKind::UnitRatio { numerator: 179.0, denominator: 177.83 }, meaning: String::new() },
        )]);
        let explained = |published: f64| {
            let causes_of_it = BTreeMap::from([("unit".to_owned(), Parameters::default())]);
            let (case, point) = (String::new(), String::new());
            let deviation = PublishedDeviation { case, point, published, rounding: 0.01, causes: causes_of_it };
            explain_deviation(&deviation, &causes).unwrap()
        };
        assert!(explained(0.66).is_explained);
        assert!(!explained(0.70).is_explained);
        assert!((explained(0.66).contributions[0].share - 1.0).abs() < 0.01);
    }
}
