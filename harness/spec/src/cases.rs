//! The cases of a spec: overrides of its text, as a list or as a matrix.
//!
//! A mapping overrides a mapping key by key, and a list of items with an `id` item by item.
//! Every other value replaces the value that was there.

use std::collections::{HashMap, HashSet};

use serde_yaml::{Mapping, Value};

use super::build::MAX_NAME;
use super::compare::{Pair, pairs};
use super::model::{EngineSettings, Spec};
use super::shape::{self, Mended, Shaped, Trials};
use super::tree::Tree;
use super::{Source, SpecError};
use luxproof_process::printable::Quoted;

/// One case of a spec: its text with overrides laid over it.
#[derive(Clone, Debug)]
pub(super) struct Variant {
    /// Its name; the parts of a matrix are joined by hyphens.
    pub(super) name: String,
    pub(super) spec: Spec,
    /// Where something was put that nobody wrote.
    pub(super) mended: Mended,
    /// The engines that its overrides name: the case is for these alone.
    pub(super) engines: Option<Vec<String>>,
    /// The spec's text, knowing which overrides lie over it.
    pub(super) source: Source,
}

/// The cases of a spec, in its order, as far as they can be read; none for a spec without `cases`.
#[derive(Debug, Default)]
pub(super) struct Variants {
    pub(super) all: Vec<Variant>,
    /// Those of them that are compared.
    pub(super) pairs: Vec<Pair>,
    pub(super) faults: Vec<SpecError>,
}

/// An override: its name, its place in the spec, and what it says.
#[derive(Clone, Debug)]
struct Override {
    name: String,
    place: String,
    says: Mapping,
}

/// Builds the cases of a spec; `of_base` are the faults of the spec itself, which the cases do not repeat.
pub(super) fn variants(source: &Source, tree: &Tree, of_base: &[SpecError]) -> Variants {
    let Value::Mapping(mut base) = tree.value.clone() else { return Variants::default() };
    let (cases, compare) = (base.remove("cases"), base.remove("compare"));
    let mut found = Variants::default();
    let Some(cases) = cases else {
        if compare.is_some() {
            found.faults.push(source.error_at("compare", "there are no cases to compare", "give them as `cases`"));
        }
        return found;
    };
    let combinations = match cases {
        Value::Sequence(list) => Ok(parse_list(source, list, &mut found.faults).into_iter().map(|o| vec![o]).collect()),
        Value::Mapping(axes) => matrix(source, axes),
        _ => Err(source.error_at("cases", "neither a list nor a matrix", FORM)),
    };
    let checked = combinations.and_then(|combinations: Vec<_>| {
        check_count(source, combinations.len(), !found.faults.is_empty())?;
        Ok(combinations)
    });
    let combinations = checked.unwrap_or_else(|fault| {
        found.faults.push(fault);
        vec![]
    });
    let (mut names, trials) = (HashSet::new(), Trials::of(&source.text));
    let most_faults = trials.faults();
    for overrides in combinations {
        match build_variant(source, &base, &overrides, of_base, &trials, &mut found.faults) {
            Ok(Some(variant)) => {
                let message = format!("two cases are named `{}`", variant.name);
                let is_new = names.insert(variant.name.clone());
                let help = "give every case a name of its own";
                match source.require(is_new, &overrides[0].place, message, help) {
                    Ok(()) => found.all.push(variant),
                    Err(fault) => found.faults.push(fault),
                }
            }
            Ok(None) => {}
            Err(fault) => found.faults.push(fault),
        }
        if found.faults.len() >= most_faults {
            break;
        }
    }
    // Where a case has a fault, its name may be what is missing here.
    if let Some(compare) = compare.filter(|_| found.faults.is_empty()) {
        let names: Vec<&str> = found.all.iter().map(|v| v.name.as_str()).collect();
        match pairs(source, &compare, &names) {
            Ok(pairs) => found.pairs = pairs,
            Err(faults) => found.faults.extend(faults),
        }
    }
    found
}

/// Checks that a spec has cases, and not too many; a spec with faulty cases has some.
fn check_count(source: &Source, count: usize, has_faults: bool) -> Result<(), SpecError> {
    let limits = source.trust.limits();
    let most = limits.cases.min(limits.values / source.values.max(1));
    let so_large = if most < limits.cases { " so large" } else { "" };
    let help = format!("a spec{so_large} holds {most} cases at most: make several of it");
    source.require(count <= most, "cases", format!("{count} cases"), help)?;
    source.require(count > 0 || has_faults, "cases", "there are none", "give at least one, or leave `cases` out")
}

const FORM: &str = "give a list of overrides, each with a `name`, or a matrix {axis: {name: override, ...}, ...}";

/// Parses one item of a list of cases.
fn parse_listed(source: &Source, k: usize, value: Value) -> Result<Override, SpecError> {
    let place = format!("cases[{k}]");
    let Value::Mapping(mut says) = value else {
        return Err(source.error_at(&place, "this is no override", FORM));
    };
    let Some(Value::String(name)) = says.remove("name") else {
        return Err(source.error_at(&place, "the case has no name", "give it one: `name: ...`"));
    };
    check_name(source, &place, &name)?;
    Ok(Override { name, place, says })
}

/// Parses a list of cases; adds faults until there are as many as a spec reports.
fn parse_list(source: &Source, list: Vec<Value>, faults: &mut Vec<SpecError>) -> Vec<Override> {
    let (mut overrides, most) = (vec![], Trials::of(&source.text).faults());
    for (k, value) in list.into_iter().enumerate() {
        match parse_listed(source, k, value) {
            Ok(found) => overrides.push(found),
            Err(fault) if faults.len() < most => faults.push(fault),
            Err(_) => break,
        }
    }
    overrides
}

/// The most axes of a matrix: each combination has an override of each.
const MAX_AXES: usize = 20;

/// Every combination of one override an axis, the last axis fastest.
fn matrix(source: &Source, axes: Mapping) -> Result<Vec<Vec<Override>>, SpecError> {
    let mut combinations: Vec<Vec<Override>> = vec![vec![]];
    let message = format!("{} axes", axes.len());
    source.require(axes.len() <= MAX_AXES, "cases", message, format!("a matrix has at most {MAX_AXES} axes"))?;
    for (axis, choices) in axes {
        let axis = axis.as_str().unwrap_or_default().to_owned();
        let Value::Mapping(choices) = choices else {
            return Err(source.error_at(&format!("cases.{axis}"), "this is no axis of a matrix", FORM));
        };
        let mut overrides = vec![];
        for (name, says) in choices {
            let name = name.as_str().unwrap_or_default().to_owned();
            let place = format!("cases.{axis}.{name}");
            check_name(source, &place, &name)?;
            let says = match says {
                Value::Mapping(says) => says,
                Value::Null => Mapping::new(),
                _ => return Err(source.error_at(&place, "this is no override", FORM)),
            };
            overrides.push(Override { name, place, says });
        }
        let count = combinations.len().saturating_mul(overrides.len());
        let message = format!("{count} combinations and more");
        let most = source.trust.limits().cases;
        let help = format!("a spec holds {most} cases at most: make several of it");
        source.require(count <= most, &format!("cases.{axis}"), message, help)?;
        combinations = combinations.iter().flat_map(|head| with_each(head, &overrides)).collect();
    }
    Ok(combinations.into_iter().filter(|c| !c.is_empty()).collect())
}

/// A combination with each of an axis's overrides added.
fn with_each(head: &[Override], overrides: &[Override]) -> Vec<Vec<Override>> {
    overrides.iter().map(|o| [head, std::slice::from_ref(o)].concat()).collect()
}

/// Whether a character may stand in a case's name.
fn is_name_character(c: char) -> bool {
    c.is_ascii_alphanumeric() || "-_.".contains(c)
}

/// Checks a case's name, since it becomes a folder's name.
fn check_name(source: &Source, place: &str, name: &str) -> Result<(), SpecError> {
    let is_short = (1..=MAX_NAME).contains(&name.len());
    let is_name = is_short && !name.starts_with('.') && name.chars().all(is_name_character);
    let help = format!(
        "use at most {MAX_NAME} letters, digits, hyphens, underscores and points; put a name of digits alone in quotes"
    );
    source.require(is_name, place, format!("`{}` is no name of a case", Quoted(name)), help)
}

/// Lays overrides over a spec; `None` where the faults leave no case to build.
fn build_variant(
    source: &Source,
    base: &Mapping,
    overrides: &[Override],
    of_base: &[SpecError],
    trials: &Trials,
    faults: &mut Vec<SpecError>,
) -> Result<Option<Variant>, SpecError> {
    let names: Vec<&str> = overrides.iter().map(|o| o.name.as_str()).collect();
    let name = names.join("-");
    let mut text = Value::Mapping(base.clone());
    let mut engines: Option<Vec<String>> = None;
    for o in overrides {
        let sound = ["cases", "compare", "luxproof"].iter().all(|key| !o.says.contains_key(*key));
        let message = "a case has neither cases nor comparisons nor a format version of its own";
        source.require(sound, &o.place, message, FORM)?;
        lay(&mut text, &Value::Mapping(o.says.clone())).map_err(|missing| {
            let message = format!("there is no `{missing}` to override");
            source.error_at(&o.place, message, "name an item by its `id`")
        })?;
        if let Some(Value::Mapping(named)) = o.says.get("engines") {
            engines = Some(named.keys().filter_map(Value::as_str).map(str::to_owned).collect());
        }
    }
    let places = overrides.iter().map(|o| o.place.clone()).collect();
    let case_source = Source { overrides: places, ..source.clone() };
    let Shaped { read, faults: of_shape, mended } = shape::mended::<Spec>(&case_source, text, trials);
    // The base reports its faults once, not again for each case.
    let new_faults = of_shape.into_iter().filter(|fault| of_base.iter().all(|base| base.message != fault.message));
    faults.extend(new_faults.map(|fault| {
        let message = format!("with the overrides of case `{name}`: {}", fault.message);
        SpecError { message, help: fault.help.or_else(|| Some(FORM.to_owned())), ..fault }
    }));
    let Some(mut spec) = read else { return Ok(None) };
    if let (Some(named), Some(all)) = (&engines, &mut spec.engines) {
        all.retain(|id, _: &mut EngineSettings| named.contains(id));
    }
    Ok(Some(Variant { name, spec, mended, engines, source: case_source }))
}

/// Lays an override over a value; the error is the id of an item that is not there.
fn lay(base: &mut Value, over: &Value) -> Result<(), String> {
    match (base, over) {
        (Value::Mapping(base), Value::Mapping(over)) => {
            for (key, value) in over {
                match base.get_mut(key) {
                    Some(below) => lay(below, value)?,
                    None => drop(base.insert(key.clone(), value.clone())),
                }
            }
        }
        (Value::Sequence(items), Value::Mapping(over)) if items.iter().all(|i| i.get("id").is_some()) => {
            let mut places: HashMap<Value, usize> = HashMap::new();
            for (place, id) in items.iter().enumerate().filter_map(|(place, item)| Some((place, item.get("id")?))) {
                // Of several items with one id the first is meant.
                places.entry(id.clone()).or_insert(place);
            }
            for (id, value) in over {
                let item = places.get(id).and_then(|place| items.get_mut(*place));
                lay(item.ok_or_else(|| id.as_str().unwrap_or("?").to_owned())?, value)?;
            }
        }
        (base, over) => *base = over.clone(),
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::ModelSpec;
    use crate::tests::MINIMAL;
    use luxproof_model::ProcedureId;

    fn of(cases: &str) -> Result<Vec<Variant>, SpecError> {
        let second = "  - {id: b, photometry: a.ies, at_m: [2, 2, 2]}\nmeters:\n";
        let base = MINIMAL.replace("meters:\n", second) + "  indirect_illuminance: {meters: plane}\n";
        let source = Source::new("spec.yaml".into(), base + cases);
        let Variants { all, faults, .. } = variants(&source, &crate::tree::tree(&source.text).unwrap(), &[]);
        faults.into_iter().next().map_or(Ok(all), Err)
    }

    #[test]
    fn a_list_overrides_key_by_key_and_items_by_their_id() {
        let cases = of("cases:\n  - name: one\n  - name: two\n    room: {reflectance: {walls: 0.1}}\n    \
                        luminaires: {b: {model: area}}\n    engines: {radiance: {preset: fast}}\n")
        .unwrap();
        assert_eq!(cases.iter().map(|c| c.name.as_str()).collect::<Vec<_>>(), ["one", "two"]);
        assert_eq!(cases[0].spec.luminaires[1].model, ModelSpec::Auto);
        assert_eq!(
            cases[1].spec.luminaires.iter().map(|l| l.model).collect::<Vec<_>>(),
            [ModelSpec::Auto, ModelSpec::Area]
        );
        let reflectance = cases[1].spec.room.reflectance.as_ref().unwrap().build().unwrap();
        assert_eq!((reflectance.floor, reflectance.wall_x_min), (0.2, 0.1));
        assert_eq!((cases[0].engines.clone(), cases[1].engines.clone()), (None, Some(vec!["radiance".to_owned()])));
    }

    #[test]
    fn a_matrix_is_every_combination_and_null_removes_a_procedure() {
        let cases = of("cases:\n  model: {point: {}, area: {luminaires: {a: {model: area}}}}\n  \
                        light: {seven: {procedures: {indirect_illuminance: {bounces: 7}}}, \
                        all: {procedures: {direct_illuminance: null}}}\n")
        .unwrap();
        let names: Vec<&str> = cases.iter().map(|c| c.name.as_str()).collect();
        assert_eq!(names, ["point-seven", "point-all", "area-seven", "area-all"]);
        assert!(cases[2].spec.procedures.0.contains_key(&ProcedureId::DirectIlluminance));
        assert!(!cases[3].spec.procedures.0.contains_key(&ProcedureId::DirectIlluminance));
        assert_eq!(cases[3].spec.luminaires[0].model, ModelSpec::Area);
    }

    #[test]
    fn cases_that_cannot_be_followed_are_refused_and_not_passed_over() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("spec.yaml");
        for cases in ["cases: [!odd {name: one}]", "cases: [{name: a}, {name: b}]\ncompare: &x [*x, *x]"] {
            std::fs::write(&path, format!("{MINIMAL}{cases}\n")).unwrap();
            let faults = crate::Case::load_all(&path, crate::Trust::Own).unwrap_err();
            assert!(faults.all().iter().any(|f| f.line >= Some(11)), "{cases}: {faults:?}");
            assert!(crate::specs(&path).is_err(), "{cases}");
        }
    }

    #[test]
    fn errors_of_an_override_are_placed_at_it() {
        for (cases, line) in [
            ("cases:\n  - name: one\n  - {name: two, rooom: {}}\n", 15),
            ("cases:\n  - {name: one, luminaires: {c: {model: area}}}\n", 14),
            ("cases:\n  - {name: one}\n  - {name: one}\n", 15),
            ("cases:\n  - {name: ../one}\n", 14),
            ("cases: []\n", 13),
        ] {
            assert_eq!(of(cases).unwrap_err().line, Some(line), "{cases}");
        }
        let error = of("cases:\n  - {name: two, room: {sise_m: 3}}\n").unwrap_err();
        assert_eq!(error.help.as_deref(), Some("did you mean `size_m`?"), "{error}");
    }
}
