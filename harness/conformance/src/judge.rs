//! Judges a submission: file by file, then by what the files say together.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};

use itertools::Itertools as _;
use serde::Serialize;

use crate::catalogue::{PACK_VERSION, pack_files};
use crate::expected::mistakes_that_show;
use crate::explanation::{Answers, Explanation, PartialExplanation};
use crate::interpolation;
use crate::mistake::{Mistake, Variant};
use crate::model_reader::ModelReader;
use crate::pack_file::{PackFile, Place};
use crate::quantities::{QuantityFault, find_quantity_faults};
use crate::submission::{FileAnswer, Submission, SubmissionError};

/// The verdicts on a submission.
#[derive(Clone, Debug, Serialize)]
pub struct Judgement {
    /// Version of the pack.
    pub pack: &'static str,
    /// The reader and its version.
    pub reader: String,
    /// One verdict a file, in the order of the pack.
    pub files: Vec<FileJudgement>,
}

/// The verdict on a file.
#[derive(Clone, Debug, Serialize)]
pub struct FileJudgement {
    /// The name of the file.
    pub file: &'static str,
    /// What it provokes.
    pub feature: &'static str,
    /// The verdict on its intensities.
    pub verdict: FileVerdict,
    /// Choices of the reader where no standard decides.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub variants: Vec<Variant>,
    /// Wrong numbers besides the intensities.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub quantities: Vec<QuantityFault>,
}

/// The verdict on the intensities of a file.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case", tag = "is")]
pub enum FileVerdict {
    /// All answers are right, or follow a variant.
    Right,
    /// The answers are those of a reader with these mistakes.
    Mistakes {
        /// Sets of mistakes with the same answers; usually one.
        alternatives: Vec<Vec<Mistake>>,
        /// A factor of all answers besides.
        #[serde(skip_serializing_if = "Option::is_none")]
        factor: Option<f64>,
    },
    /// All answers have the same factor, which no known mistake gives.
    Factor {
        /// Answer per expected intensity.
        factor: f64,
    },
    /// Wrong answers that no known mistake gives.
    Unknown {
        /// C of the direction with the largest deviation.
        c_deg: f64,
        /// Its gamma.
        gamma_deg: f64,
        /// The answer there.
        answer_cd: f64,
        /// What it should be: the least and the most of the nodes around it.
        expected_cd: [f64; 2],
        /// Mistakes that give most answers, if there are such.
        #[serde(skip_serializing_if = "Option::is_none")]
        nearest: Option<PartialExplanation>,
    },
    /// The reader did not read the file.
    Refused {
        /// Its reason.
        reason: String,
    },
    /// The reader answered in no direction.
    Unanswered,
    /// The submission does not contain the file.
    NotSubmitted,
}

impl FileVerdict {
    /// Whether an implementer has to do something about it.
    pub const fn is_fault(&self) -> bool {
        !matches!(self, Self::Right | Self::NotSubmitted)
    }
}

impl FileJudgement {
    /// Whether an implementer has to do something about it.
    pub fn is_fault(&self) -> bool {
        self.verdict.is_fault() || !self.quantities.is_empty()
    }
}

/// Judges a submission.
pub fn judge(submission: &Submission) -> Result<Judgement, SubmissionError> {
    let files = pack_files();
    submission.check(&files)?;
    let examined: Vec<ExaminedFile> =
        files.iter().map(|file| ExaminedFile::of(file, submission.files.get(file.name), submission)).collect();
    let evidence = Evidence::of(&examined);
    let version = submission.reader.version.iter().map(|version| format!(" {version}"));
    Ok(Judgement {
        pack: PACK_VERSION,
        reader: [submission.reader.name.clone()].into_iter().chain(version).collect(),
        files: examined.iter().map(|file| file.judge(&evidence)).collect(),
    })
}

/// A file with the explanations of its answers.
struct ExaminedFile<'a> {
    file: &'a PackFile,
    answer: Option<&'a FileAnswer>,
    answers: Option<Answers<'a>>,
    shown: Vec<Mistake>,
    explanations: Vec<Explanation>,
}

/// What the files say together of each mistake.
struct Evidence {
    /// In how many files it may be the cause.
    possible: BTreeMap<Mistake, usize>,
    /// In how many files it would show and does not.
    refuted: BTreeMap<Mistake, usize>,
    /// Whether the answers to some file have no explanation without it.
    necessary: BTreeSet<Mistake>,
}

impl Evidence {
    fn of(files: &[ExaminedFile]) -> Self {
        let (mut possible, mut refuted, mut necessary) = (BTreeMap::new(), BTreeMap::new(), BTreeSet::new());
        for file in files.iter().filter(|file| !file.explanations.is_empty()) {
            for mistake in &file.shown {
                let mut explanations = file.explanations.iter();
                let count = explanations.clone().filter(|one| one.mistakes.contains(mistake)).count();
                let counts = if count > 0 { &mut possible } else { &mut refuted };
                *counts.entry(*mistake).or_insert(0) += 1;
                if explanations.all(|explanation| explanation.mistakes.contains(mistake)) {
                    necessary.insert(*mistake);
                }
            }
        }
        Self { possible, refuted, necessary }
    }

    /// Whether a mistake is the cause in some file for sure, and most files agree.
    fn is_established(&self, mistake: Mistake) -> bool {
        let count = |counts: &BTreeMap<Mistake, usize>| counts.get(&mistake).copied().unwrap_or(0);
        self.necessary.contains(&mistake) && count(&self.refuted) < count(&self.possible)
    }

    /// Less for fewer mistakes that nothing else establishes, then for what other files contradict less, then for what
    /// explains more.
    fn cost(&self, mistakes: &[Mistake]) -> (usize, usize, Reverse<usize>) {
        let sum = |counts: &BTreeMap<Mistake, usize>| -> usize {
            mistakes.iter().filter_map(|mistake| counts.get(mistake)).sum()
        };
        let open = mistakes.iter().filter(|mistake| !self.is_established(**mistake)).count();
        (open, sum(&self.refuted), Reverse(sum(&self.possible)))
    }
}

impl<'a> ExaminedFile<'a> {
    fn of(file: &'a PackFile, answer: Option<&'a FileAnswer>, submission: &Submission) -> Self {
        let candela = answer.and_then(|answer| answer.candela.as_deref());
        let answers = candela.filter(|candela| candela.iter().any(Option::is_some)).map(|candela| Answers {
            file,
            candela,
            relative_uncertainty: submission.relative_uncertainty,
            scale: submission.scale,
        });
        let shown = mistakes_that_show(file);
        let explanations = answers.map(|answers| answers.explain(&shown)).unwrap_or_default();
        Self { file, answer, answers, shown, explanations }
    }

    fn judge(&self, evidence: &Evidence) -> FileJudgement {
        let best: Vec<&Explanation> =
            self.explanations.iter().min_set_by_key(|explanation| evidence.cost(&explanation.mistakes));
        let mut variants: Vec<Variant> = vec![];
        if let Some(first) = best.first() {
            variants.extend(first.variant.into_iter().chain(first.normalisation));
        }
        let verdict = self.verdict(&best, &mut variants);
        let flux_factor =
            best.first().filter(|_| verdict == FileVerdict::Right).and_then(|first| self.flux_factor(first));
        let quantities =
            self.answer.map(|answer| find_quantity_faults(self.file, answer, flux_factor)).unwrap_or_default();
        FileJudgement { file: self.file.name, feature: self.file.feature, verdict, variants, quantities }
    }

    /// The flux of a reader per expected flux; none where its unit or its angles are others.
    fn flux_factor(&self, explanation: &Explanation) -> Option<f64> {
        let is_in_lumens = explanation.scale == 1.0 && explanation.variant != Some(Variant::UsdLuxAngleScale);
        let factor = self.file.document.factor(&self.file.table, &[], explanation.variant);
        is_in_lumens.then_some(factor / self.file.factor())
    }

    /// The verdict by the best explanations; adds the interpolation to the variants.
    fn verdict(&self, best: &[&Explanation], variants: &mut Vec<Variant>) -> FileVerdict {
        let Some(answer) = self.answer else { return FileVerdict::NotSubmitted };
        if let Some(reason) = &answer.refused {
            return FileVerdict::Refused { reason: reason.clone() };
        }
        let Some(answers) = self.answers else { return FileVerdict::Unanswered };
        let Some(first) = best.first() else { return self.worst_answer(answers, answers.explain_most(&self.shown)) };
        if !first.mistakes.is_empty() {
            let alternatives = best.iter().map(|explanation| explanation.mistakes.clone()).unique().collect();
            return FileVerdict::Mistakes { alternatives, factor: first.factor };
        }
        if let Some(factor) = first.factor {
            return FileVerdict::Factor { factor };
        }
        match self.name_interpolation(answers, first.scale) {
            Ok(method) => {
                variants.extend(method);
                FileVerdict::Right
            }
            Err(verdict) => verdict,
        }
    }

    /// The interpolation of the answers between nodes, if any; a fault where they leave the nodes around them.
    fn name_interpolation(&self, answers: Answers, scale: f64) -> Result<Option<Variant>, FileVerdict> {
        let between: Vec<(usize, f64)> = (0..self.file.directions.len())
            .filter(|k| self.file.directions[*k].place == Place::Between)
            .filter_map(|k| answers.candela[k].map(|answer| (k, answer / scale)))
            .collect();
        if between.is_empty() {
            return Ok(None);
        }
        let follows = |method: &Variant| {
            let expected = interpolation::answers_between(self.file, *method);
            between.iter().all(|(k, answer)| {
                expected[*k].is_some_and(|candela| (answer - candela).abs() <= answers.allowed_cd(candela))
            })
        };
        if let Some(method) = interpolation::METHODS.into_iter().find(follows) {
            return Ok(Some(method));
        }
        let predictions = ModelReader::RIGHT.predict(self.file);
        let is_near = |(k, answer): &(usize, f64)| {
            let (least, most) = (predictions[*k].least, predictions[*k].most);
            let room = MAX_OVERSHOOT * (most - least) + answers.allowed_cd(*answer);
            (least - room..=most + room).contains(answer)
        };
        if between.iter().all(is_near) {
            return Ok(Some(Variant::OtherInterpolation));
        }
        let scaled = PartialExplanation { mistakes: vec![], variant: None, explained: 0, answered: 0, scale };
        Err(self.worst_answer(answers, Some(scaled)))
    }

    /// The answer with the largest deviation from what is right.
    fn worst_answer(&self, answers: Answers, nearest: Option<PartialExplanation>) -> FileVerdict {
        let scale = nearest.as_ref().map_or(1.0, |nearest| nearest.scale);
        let variant = nearest.as_ref().and_then(|nearest| nearest.variant);
        let predictions = ModelReader { mistakes: &[], variant }.predict(self.file);
        let deviation = |k: usize, answer: f64| {
            let answer = answer / scale;
            (predictions[k].least - answer).max(answer - predictions[k].most)
        };
        let given = answers.candela.iter().enumerate().filter_map(|(k, answer)| answer.map(|answer| (k, answer)));
        let worst = given.max_by(|a, b| deviation(a.0, a.1).total_cmp(&deviation(b.0, b.1)));
        let Some((k, answer_cd)) = worst else { return FileVerdict::Unanswered };
        let asked = &self.file.directions[k];
        let expected_cd = [predictions[k].least, predictions[k].most].map(|candela| candela * scale);
        let nearest = nearest.filter(|nearest| nearest.explained > 0);
        FileVerdict::Unknown { c_deg: asked.c_deg, gamma_deg: asked.gamma_deg, answer_cd, expected_cd, nearest }
    }
}

/// How far a cubic may leave the nodes around it, in parts of their range.
const MAX_OVERSHOOT: f64 = 0.25;

impl Judgement {
    /// Whether nothing is wrong.
    pub fn is_passed(&self) -> bool {
        !self.files.iter().any(FileJudgement::is_fault)
    }

    /// The mistakes that were found, each with its files.
    pub fn mistakes(&self) -> BTreeMap<Mistake, Vec<&'static str>> {
        let mut found: BTreeMap<Mistake, Vec<&'static str>> = BTreeMap::new();
        for file in &self.files {
            if let FileVerdict::Mistakes { alternatives, .. } = &file.verdict {
                for mistake in alternatives.iter().flatten().unique() {
                    found.entry(*mistake).or_default().push(file.file);
                }
            }
        }
        found
    }

    /// The variants that the reader chose, each with its files.
    pub fn variants(&self) -> BTreeMap<Variant, Vec<&'static str>> {
        let mut found: BTreeMap<Variant, Vec<&'static str>> = BTreeMap::new();
        for file in &self.files {
            for variant in &file.variants {
                found.entry(*variant).or_default().push(file.file);
            }
        }
        found
    }
}
