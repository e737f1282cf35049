//! Expected answers against the closed forms and luxproof's readers; judgements of answers with planted mistakes.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use strum::IntoEnumIterator as _;

use super::*;
use crate::expected::mistakes_that_show;
use crate::model_reader::{ModelReader, Prediction};

/// The formulas of the expected files, evaluated.
fn evaluate(formula: &str, [x, y, z]: [f64; 3]) -> f64 {
    // A sum of products of numbers and powers of the components.
    let mut sum = 0.0;
    let mut sign = 1.0;
    let mut product: Option<f64> = None;
    for word in formula.split(' ') {
        let factor = match word {
            "+" | "-" => {
                sum += sign * product.take().unwrap();
                sign = if word == "-" { -1.0 } else { 1.0 };
                continue;
            }
            "x" => x,
            "y" => y,
            "z" => z,
            "x^2" => x * x,
            "y^2" => y * y,
            "z^2" => z * z,
            number => number.parse().unwrap(),
        };
        product = Some(product.unwrap_or(1.0) * factor);
    }
    sum + sign * product.unwrap()
}

/// Whether the table of a file has light in a direction, by the range of its angles.
fn is_lit(name: &str, [x, _, z]: [f64; 3]) -> bool {
    const SLACK: f64 = 1e-9;
    match name {
        // Gamma to 90; or V from -90 to 90 of type B, H from end to end of the axis.
        "ends-at-90.ies" | "uneven-steps.ies" | "type-b.ies" | "type-b-half.ies" | "tm33-type-b.xml" => z <= SLACK,
        "begins-at-90.ies" | "uplight.ldt" => z >= -SLACK,
        // H from -90 to 90, V from pole to pole.
        "type-a.ies" | "tm33-type-a.xml" => x >= -SLACK,
        _ => true,
    }
}

#[test]
fn expected_candela_are_the_closed_form_where_the_table_has_light() {
    for file in pack_files() {
        let expected = Expected::of(&file);
        // A number has three decimals, and the factor of the file multiplies its rounding.
        let rounding = 0.0005 * file.factor() + 1e-6;
        for (direction, answer) in expected.directions.iter().zip(&expected.candela) {
            let place = (&expected.file, direction.c_deg, direction.gamma_deg);
            let Some(answer) = answer else {
                assert_eq!(direction.place, Place::Between, "{place:?}");
                continue;
            };
            let is_lit = is_lit(file.name, direction.towards);
            let form = if is_lit { evaluate(&expected.closed_form, direction.towards) } else { 0.0 };
            assert!((answer - form).abs() <= rounding, "{place:?}: {answer} {form}");
        }
        assert!(expected.candela.iter().flatten().count() >= 16, "{}", file.name);
    }
}

#[test]
fn luxproofs_readers_answer_every_file_right() {
    let judgement = judge(&own_submission("test")).unwrap();
    assert!(judgement.is_passed(), "{judgement:#?}");
    let variants = judgement.variants();
    let of = |variant: Variant| variants.get(&variant).cloned().unwrap_or_default();
    assert_eq!(of(Variant::Linear), ["interpolation.ies"]);
    assert_eq!(of(Variant::ThirdNumberApplied), ["third-number-1995.ies"]);
    assert_eq!(of(Variant::TiltIgnored), ["tilt-include.ies"]);
    assert_eq!(of(Variant::FirstLampSet), ["lamp-sets.ldt"]);
    assert_eq!(of(Variant::AimedAtNadir), ["type-b.ies", "type-b-half.ies", "tm33-type-b.xml"]);
}

/// luxproof integrates each cell by another closed form.
#[test]
fn fluxes_are_those_of_luxproofs_readers() {
    let own = own_submission("test");
    for file in pack_files() {
        let flux = Expected::of(&file).flux_lm;
        assert!(flux.least < flux.linear && flux.linear < flux.most, "{}", file.name);
        // The 1995 file is read by the other variant.
        let factor = if file.name == "third-number-1995.ies" { 0.7 } else { 1.0 };
        let read = own.files[file.name].flux_lm.unwrap();
        assert!((read / (factor * flux.linear) - 1.0).abs() < 1e-6, "{}: {read} {}", file.name, flux.linear);
    }
}

fn committed() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../reference/conformance")
}

/// All files below a folder, with slashes.
fn list_below(folder: &Path, prefix: &str, found: &mut BTreeSet<String>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let entry = entry.unwrap();
        let name = format!("{prefix}{}", entry.file_name().to_str().unwrap());
        if entry.file_type().unwrap().is_dir() {
            list_below(&entry.path(), &format!("{name}/"), found);
        } else {
            found.insert(name);
        }
    }
}

#[test]
fn the_committed_pack_is_what_the_command_writes() {
    let written = written_files().unwrap();
    let mut found = BTreeSet::new();
    list_below(&committed(), "", &mut found);
    assert_eq!(found, written.iter().map(|file| file.path.clone()).collect());
    for file in &written {
        let bytes = std::fs::read(committed().join(&file.path)).unwrap();
        assert!(bytes == file.bytes, "{}: run `luxproof conformance --emit reference/conformance --force`", file.path);
    }
}

#[test]
fn expected_files_and_the_template_are_what_the_schemas_describe() {
    for file in written_files().unwrap() {
        if let Some(name) = file.path.strip_prefix("expected/") {
            let read: Expected = serde_json::from_slice(&file.bytes).unwrap_or_else(|e| panic!("{name}: {e}"));
            assert_eq!(format!("{}.json", read.file), name);
        }
        if file.path == "results-template.json" {
            let read: Submission = serde_json::from_slice(&file.bytes).unwrap();
            let judgement = judge(&read).unwrap();
            assert!(judgement.files.iter().all(|file| file.verdict == FileVerdict::Unanswered));
        }
    }
}

/// The answers of a reader with these mistakes, by the model of a reader.
fn submission(mistakes: &[Mistake], scale: impl Fn(&PackFile) -> f64) -> Submission {
    let answer = |file: &PackFile| {
        let predictions = ModelReader { mistakes, variant: None }.predict(file);
        let candela = predictions.iter().map(|prediction| prediction.exact().map(|candela| scale(file) * candela));
        (file.name.to_owned(), FileAnswer { candela: Some(candela.collect()), ..FileAnswer::default() })
    };
    Submission {
        pack: PACK_VERSION.into(),
        reader: ReaderName { name: "planted".into(), version: None },
        scale: Scale::Candela,
        relative_uncertainty: 0.0,
        files: pack_files().iter().map(answer).collect(),
    }
}

fn found(submission: &Submission) -> BTreeSet<Mistake> {
    judge(submission).unwrap().mistakes().into_keys().collect()
}

#[test]
fn every_mistake_shows_in_some_file_and_every_two_differ() {
    let mut shown: BTreeMap<Mistake, Vec<Vec<Option<f64>>>> = BTreeMap::new();
    let files = pack_files();
    for mistake in Mistake::iter() {
        let of = |file: &PackFile| {
            let predictions = ModelReader { mistakes: &[mistake], variant: None }.predict(file);
            predictions.into_iter().map(Prediction::exact).collect()
        };
        assert!(files.iter().any(|file| mistakes_that_show(file).contains(&mistake)), "{mistake:?}");
        shown.insert(mistake, files.iter().map(of).collect());
    }
    for (a, first) in &shown {
        for (b, second) in shown.range(..a) {
            assert_ne!(first, second, "{a:?} {b:?}");
        }
    }
}

#[test]
fn two_mistakes_at_once_are_both_named() {
    for pair in [
        [Mistake::MultiplierIgnored, Mistake::TurnedBy90],
        [Mistake::AzimuthReversed, Mistake::UpDownSwapped],
        [Mistake::ClampedBeyondEnd, Mistake::LumensNotScaled],
        [Mistake::PlanesAbout90From0, Mistake::TableTransposed],
        [Mistake::BallastFactorIgnored, Mistake::LampsMultiplied],
        [Mistake::MirrorMissing, Mistake::MinusOneMultiplied],
    ] {
        assert_eq!(found(&submission(&pair, |_| 1.0)), pair.into());
    }
}

/// A factor of all intensities of a file.
type Scaling<'a> = &'a dyn Fn(&PackFile) -> f64;

#[test]
fn normalised_intensities_are_a_variant_and_hide_no_mistake() {
    let normalisations: [(Variant, Scaling); 5] = [
        (Variant::NormalisedToPeak, &|file| 1.0 / file.peak_cd()),
        (Variant::NormalisedToFlux, &|file| 1.0 / Expected::of(file).flux_lm.linear),
        (Variant::NormalisedToMean, &|file| 4.0 * std::f64::consts::PI / Expected::of(file).flux_lm.linear),
        (Variant::RadiantBy683, &|_| 1.0 / 683.0),
        (Variant::RadiantBy179, &|_| 1.0 / 179.0),
    ];
    for (variant, scale) in normalisations {
        let judgement = judge(&submission(&[], scale)).unwrap();
        assert!(judgement.is_passed(), "{variant:?} {judgement:#?}");
        assert_eq!(judgement.variants()[&variant].len(), pack_files().len(), "{variant:?}");
        assert_eq!(
            found(&submission(&[Mistake::UpDownSwapped], scale)),
            [Mistake::UpDownSwapped].into(),
            "{variant:?}"
        );
    }
}

#[test]
fn relative_answers_hide_factors_and_nothing_else() {
    let relative = |mistakes: &[Mistake]| Submission {
        scale: Scale::Relative,
        ..submission(mistakes, |file| 3.0 + file.name.len() as f64)
    };
    assert!(judge(&relative(&[Mistake::MultiplierIgnored])).unwrap().is_passed());
    assert_eq!(found(&relative(&[Mistake::TypeAsC])), [Mistake::TypeAsC].into());
}

#[test]
fn answers_within_a_stated_uncertainty_are_right_and_mistakes_are_still_named() {
    for mistake in [None, Some(Mistake::AzimuthReversed), Some(Mistake::BallastFactorIgnored)] {
        let mistakes: Vec<Mistake> = mistake.into_iter().collect();
        let mut noisy = Submission { relative_uncertainty: 0.01, ..submission(&mistakes, |_| 1.0) };
        for (k, answer) in noisy.files.values_mut().flat_map(|file| file.candela.iter_mut().flatten()).enumerate() {
            // Up to a standard uncertainty either way.
            let sign = [0.01, -0.01, 0.004][k % 3];
            *answer = answer.map(|candela| candela * (1.0 + sign));
        }
        assert_eq!(found(&noisy), mistakes.iter().copied().collect());
        assert_eq!(judge(&noisy).unwrap().is_passed(), mistakes.is_empty());
        let precise = Submission { relative_uncertainty: 0.0, ..noisy };
        assert!(!judge(&precise).unwrap().is_passed());
    }
}

#[test]
fn each_interpolation_is_named_and_none_is_wrong() {
    let files = pack_files();
    let file = files.iter().find(|file| file.name == "interpolation.ies").unwrap();
    let between: Vec<usize> =
        (0..file.directions.len()).filter(|k| file.directions[*k].place == Place::Between).collect();
    for method in interpolation::METHODS {
        let mut answers = submission(&[], |_| 1.0);
        let candela = answers.files.get_mut(file.name).unwrap().candela.as_mut().unwrap();
        for (k, answer) in interpolation::answers_between(file, method).into_iter().enumerate() {
            candela[k] = answer.or(candela[k]);
        }
        let judgement = judge(&answers).unwrap();
        assert!(judgement.is_passed());
        assert_eq!(judgement.variants()[&method], [file.name], "{method:?}");
    }
    for (value, is_passed) in [(755.0, true), (5000.0, false)] {
        let mut answers = submission(&[], |_| 1.0);
        let candela = answers.files.get_mut(file.name).unwrap().candela.as_mut().unwrap();
        // Towards C 20, gamma 60: between the 748 cd of C 0 and the 793 cd of C 45.
        candela[between[2]] = Some(value);
        let judgement = judge(&answers).unwrap();
        assert_eq!(judgement.is_passed(), is_passed, "{value}");
        assert_eq!(judgement.variants().contains_key(&Variant::OtherInterpolation), is_passed, "{value}");
    }
}

#[test]
fn variants_of_a_file_are_named_and_not_wrong() {
    for file in pack_files() {
        for variant in &file.variants {
            let predictions = ModelReader { mistakes: &[], variant: Some(*variant) }.predict(&file);
            let candela = predictions.iter().map(|prediction| prediction.exact()).collect();
            let mut answers = submission(&[], |_| 1.0);
            answers.files.insert(file.name.into(), FileAnswer { candela: Some(candela), ..FileAnswer::default() });
            let judgement = judge(&answers).unwrap();
            assert!(judgement.is_passed(), "{} {variant:?}", file.name);
            assert!(judgement.variants()[variant].contains(&file.name), "{} {variant:?}", file.name);
        }
    }
}

/// The verdict on one file with a changed answer.
fn judge_changed(name: &str, change: impl FnOnce(&mut FileAnswer)) -> FileJudgement {
    let mut answers = own_submission("test");
    change(answers.files.get_mut(name).unwrap());
    let judgement = judge(&answers).unwrap();
    judgement.files.into_iter().find(|file| file.file == name).unwrap()
}

#[test]
fn wrong_numbers_besides_the_intensities_are_named() {
    let quantities = |name: &str, change: &dyn Fn(&mut FileAnswer)| judge_changed(name, change).quantities;
    let half = quantities("planes-0-180.ies", &|answer| answer.flux_lm = answer.flux_lm.map(|flux| 0.5 * flux));
    assert_eq!(half, [QuantityFault::FluxOfStoredPlanes]);
    let lamps = quantities("relative.ies", &|answer| answer.flux_lm = answer.lamp_lumens);
    assert_eq!(lamps, [QuantityFault::FluxOfLamps]);
    let one = quantities("relative.ies", &|answer| answer.lamp_lumens = Some(4000.0));
    assert_eq!(one, [QuantityFault::LumensOfOneLamp]);
    assert_eq!(
        quantities("feet.ies", &|answer| answer.opening_m = Some([1.0, 2.0, 0.0])),
        [QuantityFault::FeetAsMetres]
    );
    let swapped = quantities("isym-0.ldt", &|answer| answer.opening_m = Some([0.2, 0.5, 0.0]));
    assert_eq!(swapped, [QuantityFault::WidthAndLengthSwapped]);
    // Sets of lamps are counted by the reader's own variant.
    for lumens in [8000.0, 12000.0, 20000.0] {
        assert_eq!(quantities("lamp-sets.ldt", &|answer| answer.lamp_lumens = Some(lumens)), []);
    }
    let absolute = quantities("plain.ies", &|answer| answer.lamp_lumens = Some(1.0));
    assert_eq!(absolute, [QuantityFault::LampLumens { answer_lm: 1.0, expected_lm: None }]);
}

#[test]
fn answers_that_nothing_explains_are_shown_with_their_direction() {
    let judged = judge_changed("plain.ies", |answer| answer.candela.as_mut().unwrap()[1] = Some(0.5));
    let FileVerdict::Unknown { c_deg, gamma_deg, answer_cd, expected_cd, nearest } = judged.verdict else {
        panic!("{:?}", judged.verdict)
    };
    assert_eq!(nearest.map(|nearest| (nearest.mistakes, nearest.explained, nearest.answered)), Some((vec![], 25, 26)));
    assert_eq!((c_deg, gamma_deg, answer_cd), (0.0, 30.0, 0.5));
    // 500 + 200 sin 30 + 150 cos 30
    assert!((expected_cd[0] - (600.0 + 150.0 * 0.75_f64.sqrt())).abs() < 1e-3 && expected_cd[0] == expected_cd[1]);
    let judged = judge_changed("plain.ies", |answer| {
        answer.candela.iter_mut().flatten().for_each(|candela| *candela = candela.map(|candela| 1.7 * candela));
    });
    assert!(matches!(judged.verdict, FileVerdict::Factor { factor } if (factor - 1.7).abs() < 1e-6), "{judged:?}");
    let judged = judge_changed("plain.ies", |answer| {
        *answer = FileAnswer { refused: Some("no".into()), ..FileAnswer::default() };
    });
    assert!(judged.is_fault() && judged.verdict == FileVerdict::Refused { reason: "no".into() });
}

#[test]
fn mistakes_that_explain_most_answers_are_named() {
    let pair = [Mistake::AzimuthReversed, Mistake::TurnedBy90];
    for scale in [Scale::Candela, Scale::Relative] {
        let mut answers = Submission { scale, ..submission(&pair, |_| 1.0) };
        answers.files.retain(|name, _| name == "plain.ies");
        answers.files.get_mut("plain.ies").unwrap().candela.as_mut().unwrap()[25] = Some(0.0);
        let judgement = judge(&answers).unwrap();
        let verdict = &judgement.files[0].verdict;
        let FileVerdict::Unknown { gamma_deg, nearest: Some(nearest), .. } = verdict else { panic!("{verdict:?}") };
        // A mirror and a turn are a turn back and the mirror.
        assert!(nearest.mistakes.contains(&Mistake::AzimuthReversed) && nearest.mistakes.len() == 2, "{nearest:?}");
        assert_eq!((nearest.explained, nearest.answered, *gamma_deg), (25, 26, 180.0));
    }
}

#[test]
fn submissions_that_cannot_be_judged_are_refused_with_a_reason() {
    let of = |change: fn(&mut Submission)| {
        let mut answers = own_submission("test");
        change(&mut answers);
        judge(&answers).unwrap_err()
    };
    assert_eq!(of(|answers| answers.pack = "2.0.0".into()), SubmissionError::Version { found: "2.0.0".into() });
    assert_eq!(of(|answers| answers.relative_uncertainty = 0.5), SubmissionError::Uncertainty { found: 0.5 });
    assert_eq!(of(|answers| answers.files.clear()), SubmissionError::Empty);
    let unknown = of(|answers| drop(answers.files.insert("a.ies".into(), FileAnswer::default())));
    assert_eq!(unknown, SubmissionError::UnknownFile { name: "a.ies".into() });
    let neither = of(|answers| drop(answers.files.insert("plain.ies".into(), FileAnswer::default())));
    assert_eq!(neither, SubmissionError::NoAnswer { name: "plain.ies".into() });
    let short = of(|answers| {
        let answer = FileAnswer { candela: Some(vec![None]), ..FileAnswer::default() };
        answers.files.insert("plain.ies".into(), answer);
    });
    assert_eq!(short, SubmissionError::Count { name: "plain.ies".into(), found: 1, expected: 26 });
}
