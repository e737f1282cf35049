//! The search for causes of failures: known faults, then kinds with free parameters and implementation faults, then
//! pairs of known faults.
//!
//! An explanation is compared with everything that its engine read. It is admissible where it explains at least one
//! failing sheet up to chance. In every other sheet that it changes, its residuals stay within the tolerance.
//!
//! A search has a budget of counted work, so that it ends at the same place on every machine. Untried explanations
//! might fit as well as those found. A stage that exceeds the budget therefore reports nothing, nor do later stages.

use std::cell::{Cell, RefCell};
use std::collections::{BTreeMap, HashMap, HashSet};

use itertools::Itertools;
use parking_lot::Mutex;

use super::cause::{Cause, Evidence};
use super::engine_readings::{Agreement, EngineReadings, is_chance};
use super::fault::{Fault, Parameter, shows};
use super::faults::{FACTOR, faults};
use super::faulty_task::{FaultyTask, Fidelity, Model, Work};
use super::fit::{Fitted, fit, sum_of_squares};
use super::implementation_faults::implementation_faults;
use super::kinds::kinds;
use super::readouts::step_faults;
use super::shape;
use luxproof_process::process;
use luxproof_spec::procedures::Task;

/// An explanation is no rival of the best where its chi-squared exceeds it by more than this.
const MAX_RIVAL_CHI_SQUARED: f64 = 4.0;
/// More rivals than this leave the cause open.
const MAX_RIVALS: usize = 3;
/// Distance of a free parameter from its right value, in standard errors, from which it differs.
const MIN_PARAMETER_SIGMAS: f64 = 3.0;
/// Penalty of a pair of faults in chi-squared: about twice the logarithm of the number of pairs.
const PAIR_PENALTY: f64 = 12.0;
/// Work that a search for one engine may spend: about half a minute of a core, which rooms of several luminaires may need.
const MAX_WORK: u64 = 200_000_000;
/// Readings of a sheet in a first fit: more readings add little to a few parameters.
const SAMPLE_READINGS: usize = 40;
/// Fits that repeat the last one with the simulator's corrections at its parameters.
const REFINEMENTS: usize = 2;
/// Starts from which a fit is made, the best first.
const MAX_STARTS_FITTED: usize = 2;
/// A reading that changes by more than this part is changed by a parameter.
const MIN_RELATIVE_CHANGE: f64 = 1e-5;
/// A fault is a mere factor where its ratios to the right readings spread by less than this.
const MIN_RATIO_SPREAD: f64 = 1.002;

/// The models of a case and all explanations, with a cache of predictions.
pub struct FaultCatalogue {
    pub models: Vec<Model>,
    pub listed: Vec<Fault>,
    kinds: Vec<Fault>,
    implementation_faults: Vec<Fault>,
    /// Predictions by listed fault and model, with their cost.
    predicted: Mutex<HashMap<ListedKey, (Work, Prediction)>>,
}

/// The readings of a task with a fault, or `None` where the fault does not show.
type Prediction = Option<Vec<f64>>;
/// A listed fault, a model, and whether the simulator computes the reflected light.
type ListedKey = (usize, usize, bool);
/// A sheet, whether all its readings count, whether the simulator computes reflected light, and the parameters.
type FitKey = (usize, bool, bool, Vec<u64>);

impl FaultCatalogue {
    pub fn new(cases: &[&[Task]], models: Vec<Model>) -> Self {
        Self {
            models,
            listed: faults(cases),
            kinds: kinds(cases),
            implementation_faults: implementation_faults(cases),
            predicted: Mutex::default(),
        }
    }

    /// Finds what explains the failing sheets of one engine, the best first, sheet by sheet.
    pub fn causes(&self, sheets: &[EngineReadings]) -> Vec<Vec<Cause>> {
        let (sample_models, sample_sheets) = self.sample_sheets(sheets);
        let full = EngineReadingsSet::new(&self.models, sheets, true);
        let sample = EngineReadingsSet::new(&sample_models, &sample_sheets, false);
        let sample = if sample.sheets.is_empty() { &full } else { &sample };
        Search {
            catalogue: self,
            sheets,
            full: &full,
            sample,
            work_left: Cell::new(MAX_WORK),
            is_exhausted: Cell::new(false),
            solved: RefCell::default(),
            paid: RefCell::default(),
            fit_cache: RefCell::default(),
        }
        .find_causes()
    }

    /// Selects a few evenly spread readings of each sheet, with their models; nothing where all sheets are short.
    fn sample_sheets(&self, sheets: &[EngineReadings]) -> (Vec<Model>, Vec<EngineReadings>) {
        if sheets.iter().all(|sheet| sheet.read.len() <= SAMPLE_READINGS) {
            return Default::default();
        }
        let mut models = vec![];
        let mut samples = vec![];
        for (k, sheet) in sheets.iter().enumerate() {
            let count = sheet.read.len();
            let sampled = count.min(SAMPLE_READINGS);
            let places: Vec<usize> = (0..sampled).map(|place| place * count / sampled).collect();
            models.push(self.models[sheet.model].select(&places));
            samples.push(sheet.select(&places, k));
        }
        (models, samples)
    }
}

/// Sheets with their models.
struct EngineReadingsSet<'a> {
    models: &'a [Model],
    sheets: &'a [EngineReadings],
    /// The same sheets for rough predictions.
    rough_sheets: Vec<EngineReadings>,
    has_all_readings: bool,
}

impl<'a> EngineReadingsSet<'a> {
    fn new(models: &'a [Model], sheets: &'a [EngineReadings], has_all_readings: bool) -> Self {
        let rough_sheets = sheets.iter().map(EngineReadings::with_rough_slack).collect();
        Self { models, sheets, rough_sheets, has_all_readings }
    }
}

struct Search<'a> {
    catalogue: &'a FaultCatalogue,
    sheets: &'a [EngineReadings],
    full: &'a EngineReadingsSet<'a>,
    /// The readings of first fits.
    sample: &'a EngineReadingsSet<'a>,
    work_left: Cell<u64>,
    is_exhausted: Cell<bool>,
    /// Right light that is solved already, by model, whether all its readings count, and fidelity.
    solved: RefCell<HashSet<(usize, bool, bool)>>,
    /// Predictions that this search has paid for. Another search may have cached them already, but each search pays,
    /// so that it always ends at the same place.
    paid: RefCell<HashSet<ListedKey>>,
    /// Predictions of the fault that is being fitted.
    fit_cache: RefCell<HashMap<FitKey, Prediction>>,
}

/// Predicts the readings of a sheet's task with a fault, where it shows.
type Predictor<'a> = dyn Fn(usize, Fidelity) -> Option<Vec<f64>> + 'a;

/// A cause with the sheets that it explains.
struct ScoredCause {
    cause: Cause,
    /// The one case that the cause belongs to.
    case: Option<usize>,
    explained: Vec<usize>,
    /// Failing sheets in which it shows and leaves more than chance, but no more than the tolerance.
    tolerated: Vec<usize>,
    count_of_parameters: usize,
}

impl ScoredCause {
    /// Whether the cause shows in a sheet without a contradiction.
    fn covers(&self, sheet: usize) -> bool {
        self.explained.contains(&sheet) || self.tolerated.contains(&sheet)
    }

    /// Whether both name the same thing, so that the better one alone counts.
    fn repeats(&self, other: &Self) -> bool {
        let has_same_form = other.count_of_parameters == self.count_of_parameters && other.case == self.case;
        other.cause.about == self.cause.about && !has_same_form || other.cause.what == self.cause.what
    }
}

/// One fit: the fault, and the sheets that it is fitted to.
struct FitInput<'a> {
    set: &'a EngineReadingsSet<'a>,
    fault: &'a Fault,
    sheets: &'a [usize],
    /// Factors on the rough predictions, sheet by sheet.
    corrections: Option<&'a [Vec<f64>]>,
}

impl Search<'_> {
    fn find_causes(&self) -> Vec<Vec<Cause>> {
        let mut open: Vec<usize> = (0..self.sheets.len()).filter(|k| self.sheets[*k].fails).collect();
        let mut causes = vec![vec![]; self.sheets.len()];
        // Any fault with a factor of zero explains readings of zero: only "dark" says no more than is known.
        if self.sheets.iter().all(|sheet| sheet.read.iter().all(|r| *r == 0.0)) {
            let dark = (0..self.catalogue.listed.len()).filter(|f| self.catalogue.listed[*f].id == "dark");
            self.assign_causes(dark.filter_map(|f| self.score_listed(f)).collect(), &mut open, &mut causes);
            return causes;
        }
        let stages =
            [Self::try_listed, Self::try_kinds, Self::try_scaled_faults, Self::try_pairs, Self::find_shared_shapes];
        for stage in stages {
            if open.is_empty() {
                break;
            }
            let found = stage(self, &open);
            if self.is_spent() {
                break;
            }
            self.assign_causes(found, &mut open, &mut causes);
        }
        causes
    }

    /// Assigns causes to the open sheets that they explain, and closes these.
    ///
    /// A cause within one case must cover all open sheets of that case; otherwise several things are wrong there.
    /// Where an engine's fault shows in a sheet and fits it better, no other cause explains that sheet alone.
    /// A cause that leaves more than chance in most failing readings only resembles the rest: it gets no name.
    fn assign_causes(&self, mut found: Vec<ScoredCause>, open: &mut Vec<usize>, causes: &mut [Vec<Cause>]) {
        found.retain(|scored| self.covers_its_case(scored, open));
        for &sheet in open.iter() {
            let explain = found.iter().filter(|scored| scored.explained.contains(&sheet));
            let explain = explain.sorted_by(|a, b| a.cause.score.total_cmp(&b.cause.score)).collect_vec();
            let Some(best) = explain.first() else { continue };
            let is_outdone = found.iter().any(|scored| {
                scored.tolerated.contains(&sheet) && scored.cause.score + MAX_RIVAL_CHI_SQUARED < best.cause.score
            });
            if self.explains_most(best) && !is_outdone {
                causes[sheet] = select_rivals(explain);
            }
        }
        open.retain(|sheet| !found.iter().any(|scored| scored.covers(*sheet)));
    }

    /// Whether a cause within one case covers all sheets of that case that are open.
    fn covers_its_case(&self, scored: &ScoredCause, open: &[usize]) -> bool {
        let Some(case) = scored.case else { return true };
        open.iter().filter(|k| self.sheets[**k].case == case).all(|k| scored.covers(*k))
    }

    /// Whether a cause explains at least half of the failing readings that it changes up to chance.
    fn explains_most(&self, scored: &ScoredCause) -> bool {
        self.count_readings(&scored.explained) >= self.count_readings(&scored.tolerated)
    }

    fn count_readings(&self, sheets: &[usize]) -> usize {
        sheets.iter().map(|k| self.sheets[*k].count()).sum()
    }

    fn try_listed(&self, _open: &[usize]) -> Vec<ScoredCause> {
        (0..self.catalogue.listed.len()).filter_map(|fault| self.score_listed(fault)).collect()
    }

    fn score_listed(&self, index: usize) -> Option<ScoredCause> {
        let fault = &self.catalogue.listed[index];
        if !fault.parameters.is_empty() {
            // A sample may contain none of the readings that a clamp cuts off.
            return self.fit_kind(fault, self.full);
        }
        self.score_fault(fault, &|sheet, fidelity| self.predict_listed(index, sheet, fidelity))
    }

    fn try_kinds(&self, open: &[usize]) -> Vec<ScoredCause> {
        let mut found = vec![];
        for fault in &self.catalogue.kinds {
            let is_relevant = fault.case.is_none_or(|case| open.iter().any(|k| self.sheets[*k].case == case));
            if is_relevant {
                found.extend(self.fit_kind(fault, self.sample));
            }
        }
        // A fault without parameters may explain the same readings, and is then the better explanation.
        for fault in &self.catalogue.implementation_faults {
            found.extend(self.score_unfitted(fault));
        }
        found.extend(
            step_faults(self.sheets, &self.catalogue.models).iter().filter_map(|fault| self.score_unfitted(fault)),
        );
        found
    }

    /// Scores a fault without parameters that is in no list.
    fn score_unfitted(&self, fault: &Fault) -> Option<ScoredCause> {
        self.score_fault(fault, &|sheet, fidelity| self.predict(self.full, fault, &[], sheet, fidelity))
    }

    /// Tries each known fault together with a free factor.
    fn try_scaled_faults(&self, _open: &[usize]) -> Vec<ScoredCause> {
        let listed = &self.catalogue.listed;
        (0..listed.len())
            .filter(|f| listed[*f].about != FACTOR && listed[*f].is_plain())
            .filter_map(|f| self.score_scaled_fault(f))
            .collect()
    }

    fn score_scaled_fault(&self, index: usize) -> Option<ScoredCause> {
        let fault = self.catalogue.listed[index].clone().with_free_factor();
        let mut scored = self.score_fault(&fault, &|sheet, fidelity| {
            // A factor shows where the fault does not.
            self.predict_listed(index, sheet, fidelity)
                .or_else(|| Some(self.catalogue.models[self.sheets[sheet].model].right.clone()))
        })?;
        let (factor, error) = *scored.cause.parameters.last()?;
        if !scored.explained.iter().any(|k| self.sheets[*k].would_fail(factor)) {
            return None;
        }
        let other = self
            .describe_known_factor(factor, error)
            .unwrap_or_else(|| format!("factor {factor:.4}, none of those known"));
        scored.cause = scored.cause.rename("two", format!("two faults: {}, and {other}", fault.what));
        scored.cause.score += PAIR_PENALTY;
        Some(scored)
    }

    /// The words for a known factor that is near a fitted one.
    fn describe_known_factor(&self, factor: f64, error: f64) -> Option<String> {
        let task = &self.catalogue.models.first()?.task;
        let tolerance = MIN_PARAMETER_SIGMAS * error + 1e-3 * factor;
        let known = self.catalogue.listed.iter().filter(|f| f.about == FACTOR && !f.has_factor).find(|f| {
            let mut faulty = FaultyTask::new(task);
            (f.change)(&mut faulty, &[]);
            (faulty.factor - factor).abs() <= tolerance
        })?;
        Some(known.what.clone())
    }

    fn try_pairs(&self, _open: &[usize]) -> Vec<ScoredCause> {
        let single =
            self.catalogue.listed.iter().filter(|f| f.about != FACTOR && f.is_plain() && !f.reflects).collect_vec();
        single.iter().array_combinations().filter_map(|[one, other]| self.score_pair(one, other)).collect()
    }

    fn score_pair(&self, one: &Fault, other: &Fault) -> Option<ScoredCause> {
        let differ = one.id != other.id && one.about != other.about;
        let may_share_a_case = one.case.is_none_or(|c| other.case.is_none_or(|d| c == d));
        if !differ || !may_share_a_case {
            return None;
        }
        let mut scored = self.score_unfitted(&one.and(other))?;
        scored.cause.score += PAIR_PENALTY;
        Some(scored)
    }

    /// Finds what the readings of a sheet have in common, whatever else is wrong with them.
    fn find_shared_shapes(&self, open: &[usize]) -> Vec<ScoredCause> {
        let mut found = vec![];
        for &k in open {
            let sheet = &self.sheets[k];
            let task = &self.catalogue.models[sheet.model].task;
            let shape = shape::find_one_plane(task, sheet).or_else(|| shape::find_same_everywhere(sheet));
            if let Some((cause, count_of_parameters)) = shape {
                found.push(ScoredCause {
                    cause,
                    case: None,
                    explained: vec![k],
                    tolerated: vec![],
                    count_of_parameters,
                });
            }
        }
        found
    }

    /// Predicts the readings of a sheet with a listed fault that has no parameters, or only a factor that is left out.
    fn predict_listed(&self, fault: usize, sheet: usize, fidelity: Fidelity) -> Prediction {
        let catalogue = self.catalogue;
        let model = self.sheets[sheet].model;
        let is_fine = fidelity == Fidelity::Fine && !self.is_cheap(&catalogue.listed[fault], sheet);
        let key = (fault, model, is_fine);
        let is_unpaid = self.paid.borrow_mut().insert(key);
        let cached = catalogue.predicted.lock().get(&key).cloned();
        if let Some((work, prediction)) = cached {
            if is_unpaid && !self.pay(self.full, model, is_fine, work) {
                return None;
            }
            return prediction;
        }
        let faulty = catalogue.listed[fault].apply(&catalogue.models[model], &[]);
        let work = faulty.as_ref().map_or_else(Work::default, |f| catalogue.models[model].count_work(f, fidelity));
        if !self.pay(self.full, model, is_fine, work) {
            return None;
        }
        let prediction = faulty.and_then(|f| catalogue.models[model].predict_with_blanks(&f, fidelity));
        catalogue.predicted.lock().insert(key, (work, prediction.clone()));
        prediction
    }

    /// Predicts the readings of a sheet with a fault.
    fn predict(
        &self,
        set: &EngineReadingsSet<'_>,
        fault: &Fault,
        parameters: &[f64],
        sheet: usize,
        fidelity: Fidelity,
    ) -> Prediction {
        let place = set.sheets[sheet].model;
        let model = &set.models[place];
        let faulty = fault.apply(model, parameters)?;
        let is_fine = fidelity == Fidelity::Fine && !self.is_cheap(fault, sheet);
        let is_paid = self.pay(set, place, is_fine, model.count_work(&faulty, fidelity));
        if is_paid { model.predict_with_blanks(&faulty, fidelity) } else { None }
    }

    /// Predicts with the fault that is being fitted, which a fit asks for many times.
    fn predict_cached(
        &self,
        set: &EngineReadingsSet<'_>,
        fault: &Fault,
        parameters: &[f64],
        sheet: usize,
        fidelity: Fidelity,
    ) -> Prediction {
        let is_fine = fidelity == Fidelity::Fine && !self.is_cheap(fault, sheet);
        let key = (sheet, set.has_all_readings, is_fine, parameters.iter().map(|p| p.to_bits()).collect());
        if let Some(prediction) = self.fit_cache.borrow().get(&key) {
            return prediction.clone();
        }
        let prediction = self.predict(set, fault, parameters, sheet, fidelity);
        self.fit_cache.borrow_mut().insert(key, prediction.clone());
        prediction
    }

    /// Whether a prediction takes negligible time.
    fn is_cheap(&self, fault: &Fault, sheet: usize) -> bool {
        self.sheets[sheet].is_cheap && !fault.reflects
    }

    /// Pays for a prediction; returns whether the budget covers it.
    fn pay(&self, set: &EngineReadingsSet<'_>, model: usize, is_fine: bool, work: Work) -> bool {
        let is_unsolved = work.right > 0 && self.solved.borrow_mut().insert((model, set.has_all_readings, is_fine));
        let cost = work.faulty + if is_unsolved { work.right } else { 0 };
        if self.is_spent() || cost > self.work_left.get() {
            self.is_exhausted.set(true);
            return false;
        }
        self.work_left.set(self.work_left.get() - cost);
        true
    }

    fn is_spent(&self) -> bool {
        self.is_exhausted.get() || process::is_interrupted()
    }

    /// Fits the parameters of a fault: first roughly, then with the simulator where the rough fit does not refute it.
    fn fit_kind(&self, fault: &Fault, first: &EngineReadingsSet<'_>) -> Option<ScoredCause> {
        self.fit_cache.borrow_mut().clear();
        let mut order = self.sort_cheap_first();
        order.retain(|k| fault.case.is_none_or(|case| self.sheets[*k].case == case));
        let starts = self.fit_roughly(fault, first, &order)?;
        let sheets = self.find_changed_sheets(self.full, fault, &starts[0], &order);
        let mut fitted = self.find_best_fit(&self.fit_input(fault, &sheets), &starts)?;
        if sheets.iter().any(|k| !self.sheets[*k].is_cheap) {
            for _ in 0..REFINEMENTS {
                let from = fitted.values();
                let corrections: Option<Vec<_>> = sheets.iter().map(|k| self.correction(fault, &from, *k)).collect();
                let input = FitInput { corrections: Some(&corrections?), ..self.fit_input(fault, &sheets) };
                fitted = self.find_best_fit(&input, &[from])?;
            }
        }
        // Noise that readings share moves parameters as if there were fewer readings.
        let shared = sheets.iter().map(|k| self.sheets[*k].design_effect).fold(1.0, f64::max);
        for (_, error) in &mut fitted.parameters {
            *error *= shared.sqrt();
        }
        if !fitted
            .parameters
            .iter()
            .zip(&fault.parameters)
            .any(|(found, parameter)| differs_from_start(*found, parameter))
        {
            return None;
        }
        let values = fitted.values();
        let scored = self
            .score_fault(fault, &|sheet, fidelity| self.predict_cached(self.full, fault, &values, sheet, fidelity))?;
        Some(with_parameters(scored, fault, fitted.parameters))
    }

    /// A fit of the full sheets without corrections.
    fn fit_input<'f>(&'f self, fault: &'f Fault, sheets: &'f [usize]) -> FitInput<'f> {
        FitInput { set: self.full, fault, sheets, corrections: None }
    }

    /// Fits roughly, cheap sheets first; returns the start of the final fit.
    ///
    /// `None` where a sheet refutes the fit, or where the fault changes nothing that fails and so explains nothing.
    fn fit_roughly(&self, fault: &Fault, set: &EngineReadingsSet<'_>, order: &[usize]) -> Option<Vec<Vec<f64>>> {
        let mut starts = self.starts(fault);
        let cheap: Vec<usize> = order.iter().copied().filter(|k| self.sheets[*k].is_cheap).collect();
        let mut fitted_to = None;
        for candidates in [&cheap[..], order] {
            let sheets = self.find_changed_sheets(set, fault, &starts[0], candidates);
            if !sheets.iter().any(|k| self.sheets[*k].fails) || fitted_to.as_ref() == Some(&sheets) {
                continue;
            }
            let input = FitInput { set, fault, sheets: &sheets, corrections: None };
            let values = self.find_best_fit(&input, &starts)?.values();
            if sheets.iter().any(|k| self.is_refuted_roughly(set, fault, &values, *k)) {
                return None;
            }
            starts = vec![values];
            fitted_to = Some(sheets);
        }
        fitted_to.is_some().then_some(starts)
    }

    /// Whether a sheet contradicts a rough prediction.
    fn is_refuted_roughly(&self, set: &EngineReadingsSet<'_>, fault: &Fault, parameters: &[f64], sheet: usize) -> bool {
        let predicted = self.predict_cached(set, fault, parameters, sheet, Fidelity::Rough);
        let sheets = if self.sheets[sheet].is_cheap { set.sheets } else { &set.rough_sheets };
        predicted.is_none_or(|p| matches!(sheets[sheet].assess(&p), Agreement::Contradicted(_)))
    }

    /// The quotient of the simulator's prediction and the rough one, reading by reading.
    fn correction(&self, fault: &Fault, parameters: &[f64], sheet: usize) -> Option<Vec<f64>> {
        let fine = self.predict_cached(self.full, fault, parameters, sheet, Fidelity::Fine)?;
        let rough = self.predict_cached(self.full, fault, parameters, sheet, Fidelity::Rough)?;
        Some(fine.iter().zip(&rough).map(|(f, r)| if *r > 0.0 { f / r } else { 1.0 }).collect())
    }

    /// Where fits of a fault start; the first start is the one where nothing is wrong.
    fn starts(&self, fault: &Fault) -> Vec<Vec<f64>> {
        let others = fault
            .parameters
            .iter()
            .skip(1)
            .map(|p| p.starts.first().copied().unwrap_or_else(|| self.brightest_failing_lux()))
            .collect_vec();
        let Some(parameter) = fault.parameters.first() else { return vec![vec![]] };
        let mut first = parameter.starts.clone();
        if first.is_empty() {
            first.push(self.brightest_failing_lux());
        }
        first.sort_by(|a, b| a.abs().total_cmp(&b.abs()).then(b.total_cmp(a)));
        first.into_iter().map(|start| std::iter::once(start).chain(others.iter().copied()).collect()).collect()
    }

    fn brightest_failing_lux(&self) -> f64 {
        let mut brightest = 0.0;
        for sheet in self.sheets.iter().filter(|sheet| sheet.fails) {
            let targets = &self.catalogue.models[sheet.model].task.targets;
            for (read, target) in sheet.read.iter().zip(targets) {
                brightest = f64::max(brightest, read / target.aspects[0].weight);
            }
        }
        brightest
    }

    /// Finds the sheets that a small step of all parameters changes.
    fn find_changed_sheets(
        &self,
        set: &EngineReadingsSet<'_>,
        fault: &Fault,
        parameters: &[f64],
        candidates: &[usize],
    ) -> Vec<usize> {
        let mut stepped = parameters.to_vec();
        for (value, parameter) in stepped.iter_mut().zip(&fault.parameters) {
            let up = *value + parameter.step;
            *value = if up <= parameter.range.1 { up } else { *value - parameter.step };
        }
        let mut changed = vec![];
        for &k in candidates {
            let Some(readings) = self.predict_cached(set, fault, &stepped, k, Fidelity::Rough) else { continue };
            let mut pairs = readings.iter().zip(&set.sheets[k].right);
            if pairs.any(|(reading, right)| (reading - right).abs() > MIN_RELATIVE_CHANGE * right) {
                changed.push(k);
            }
        }
        changed
    }

    /// Finds the best fit from any start.
    fn find_best_fit(&self, input: &FitInput<'_>, starts: &[Vec<f64>]) -> Option<Fitted> {
        let mut ranked: Vec<(f64, &Vec<f64>)> = match starts {
            [one] => vec![(0.0, one)],
            _ => starts.iter().filter_map(|s| Some((sum_of_squares(&self.residuals(input, s)?), s))).collect(),
        };
        ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
        ranked
            .iter()
            .take(MAX_STARTS_FITTED)
            .filter_map(|(_, start)| fit(&input.fault.parameters, start, &mut |p| self.residuals(input, p)))
            .min_by(|a, b| a.chi_squared.total_cmp(&b.chi_squared))
    }

    fn residuals(&self, input: &FitInput<'_>, parameters: &[f64]) -> Option<Vec<f64>> {
        let mut residuals = vec![];
        for (place, &k) in input.sheets.iter().enumerate() {
            let mut predicted = self.predict_cached(input.set, input.fault, parameters, k, Fidelity::Rough)?;
            if let Some(corrections) = input.corrections {
                predicted.iter_mut().zip(&corrections[place]).for_each(|(p, c)| *p *= c);
            }
            residuals.extend(input.set.sheets[k].residuals(&predicted));
        }
        Some(residuals)
    }

    /// The sheets in the order of their cost, failing ones first among equals.
    fn sort_cheap_first(&self) -> Vec<usize> {
        (0..self.sheets.len()).sorted_by_key(|k| (!self.sheets[*k].is_cheap, !self.sheets[*k].fails)).collect()
    }

    /// Compares a prediction with every sheet, and scores it; `None` where a sheet contradicts it or none needs it.
    ///
    /// Cheap and rough predictions come first, because they refute most faults.
    fn score_fault(&self, fault: &Fault, predict: &Predictor<'_>) -> Option<ScoredCause> {
        let order = self.sort_cheap_first();
        let mut predicted: BTreeMap<usize, Vec<f64>> = BTreeMap::new();
        let mut factor = (1.0, 0.0);
        for (is_cheap, fidelity) in [(true, Fidelity::Fine), (false, Fidelity::Rough), (false, Fidelity::Fine)] {
            let sheets = if fidelity == Fidelity::Fine { self.sheets } else { &self.full.rough_sheets };
            for k in order.iter().copied().filter(|k| self.is_cheap(fault, *k) == is_cheap) {
                predicted.remove(&k);
                let found = predict(k, fidelity);
                // A prediction that the budget does not cover is not one of a fault that does not show.
                if self.is_spent() {
                    return None;
                }
                let Some(found) = found else { continue };
                if !fault.has_factor && is_refuted(&sheets[k], &found) {
                    return None;
                }
                predicted.insert(k, found);
            }
            if fault.has_factor {
                let failing = predicted.iter().filter(|(k, _)| self.sheets[**k].fails);
                factor = fit_factor(failing.map(|(k, p)| sheets[*k].products(p)));
                // The factor is not finite before a failing sheet is predicted.
                let is_known = factor.0.is_finite();
                if is_known && predicted.iter().any(|(k, p)| is_refuted(&sheets[*k], &scaled(p, factor.0))) {
                    return None;
                }
            } else if fidelity == Fidelity::Rough && !self.shows_in_a_failure(&predicted) {
                return None;
            }
        }
        if !(factor.0.is_finite() && factor.0 >= 0.0) {
            return None;
        }
        if fault.has_factor && fault.about != FACTOR && !self.is_uneven(&predicted) {
            return None;
        }
        for p in predicted.values_mut() {
            *p = scaled(p, factor.0);
        }
        predicted.retain(|k, p| shows(p, &self.sheets[*k].right));
        self.score_sheets(fault, &predicted, factor)
    }

    /// Whether a prediction changes any sheet that fails.
    fn shows_in_a_failure(&self, predicted: &BTreeMap<usize, Vec<f64>>) -> bool {
        predicted.iter().any(|(k, p)| self.sheets[*k].fails && shows(p, &self.sheets[*k].right))
    }

    /// Whether a shape is more than a factor.
    fn is_uneven(&self, predicted: &BTreeMap<usize, Vec<f64>>) -> bool {
        let failing = predicted.iter().filter(|(k, _)| self.sheets[**k].fails);
        let ratios = failing.flat_map(|(k, p)| p.iter().zip(&self.sheets[*k].right).map(|(p, r)| p / r));
        let extremes = ratios.filter(|r| r.is_finite()).minmax().into_option();
        extremes.is_some_and(|(least, most)| most > least * MIN_RATIO_SPREAD)
    }

    /// Scores a prediction by Schwarz's criterion; `None` where too few readings support it.
    fn score_sheets(
        &self,
        fault: &Fault,
        predicted: &BTreeMap<usize, Vec<f64>>,
        factor: (f64, f64),
    ) -> Option<ScoredCause> {
        let count_of_parameters = fault.count_of_parameters();
        let (mut explained, mut tolerated) = (vec![], vec![]);
        let (mut score, mut explained_chi_squared, mut telling) = (0.0, 0.0, 0);
        for (k, sheet) in self.sheets.iter().enumerate() {
            let agreement = sheet.assess(predicted.get(&k).unwrap_or(&sheet.right));
            score += agreement.chi_squared();
            match (agreement, predicted.get(&k)) {
                (Agreement::Explained(chi_squared), Some(p)) if sheet.fails => {
                    explained_chi_squared += chi_squared;
                    telling += sheet.count_telling(p);
                    explained.push(k);
                }
                (Agreement::Tolerated(_), Some(_)) if sheet.fails => tolerated.push(k),
                _ => {}
            }
        }
        let readings = self.count_readings(&explained);
        // Readings below a clamp support it too, because they are as they should be: it needs one less.
        let needed = if fault.id == "clamp" { 2 } else { 2 + count_of_parameters };
        if telling < needed
            || readings < 2 + count_of_parameters
            || !is_chance(explained_chi_squared, readings - count_of_parameters)
        {
            return None;
        }
        let parameters = if fault.has_factor { vec![factor] } else { vec![] };
        let (mut left, mut before) = (0.0, 0.0);
        for k in &explained {
            let sheet = &self.sheets[*k];
            left = f64::max(left, sheet.worst_percent(&predicted[k]));
            before = f64::max(before, sheet.worst_percent(&sheet.right));
        }
        let common_factor = (fault.about == FACTOR).then(|| self.common_factor(&explained));
        let all_readings: usize = self.sheets.iter().map(EngineReadings::count).sum();
        score += count_of_parameters as f64 * (all_readings as f64).ln().max(1.0);
        let cause = Cause {
            id: fault.id,
            about: fault.about.clone(),
            what: fault.describe(&parameters),
            parameters,
            evidence: Evidence { readings, left, before, factor: common_factor },
            score,
        };
        Some(ScoredCause { cause, case: fault.case, explained, tolerated, count_of_parameters })
    }

    /// The quotient of readings and their reference.
    fn common_factor(&self, explained: &[usize]) -> (f64, f64) {
        fit_factor(explained.iter().map(|k| self.sheets[*k].products(&self.sheets[*k].right)))
    }
}

/// Whether a fitted value, with its standard error, differs from where the fit started.
fn differs_from_start((value, error): (f64, f64), parameter: &Parameter) -> bool {
    let distance = parameter.starts.first().map_or(f64::INFINITY, |start| (value - start).abs());
    distance > MIN_PARAMETER_SIGMAS * error || parameter.starts.len() > 1
}

/// Adds fitted parameters to a cause and its words, in front of a factor.
fn with_parameters(mut scored: ScoredCause, fault: &Fault, mut parameters: Vec<(f64, f64)>) -> ScoredCause {
    for (found, parameter) in parameters.iter_mut().zip(&fault.parameters) {
        found.0 = parameter.reduce(found.0);
    }
    parameters.extend(scored.cause.parameters);
    scored.cause.parameters = parameters;
    scored.cause = Cause { what: fault.describe(&scored.cause.parameters), ..scored.cause };
    scored
}

/// Whether a fault shows in a sheet that contradicts it.
fn is_refuted(sheet: &EngineReadings, predicted: &[f64]) -> bool {
    shows(predicted, &sheet.right) && matches!(sheet.assess(predicted), Agreement::Contradicted(_))
}

fn scaled(values: &[f64], factor: f64) -> Vec<f64> {
    values.iter().map(|x| factor * x).collect()
}

/// Fits a factor by least squares from sums of products; returns it with its standard error.
fn fit_factor(products: impl Iterator<Item = (f64, f64)>) -> (f64, f64) {
    let (square, product) = products.fold((0.0, 0.0), |(s, q), (a, b)| (s + a, q + b));
    (product / square, square.sqrt().recip())
}

/// Selects the causes close to the best one: of repeated causes the best, of too many none.
fn select_rivals(sorted: Vec<&ScoredCause>) -> Vec<Cause> {
    let mut rivals: Vec<&ScoredCause> = vec![];
    for scored in sorted {
        let is_worse = rivals.first().is_some_and(|best| scored.cause.score > best.cause.score + MAX_RIVAL_CHI_SQUARED);
        if !is_worse && !rivals.iter().any(|rival| scored.repeats(rival)) {
            rivals.push(scored);
        }
    }
    if rivals.len() > MAX_RIVALS { vec![] } else { rivals.into_iter().map(|scored| scored.cause.clone()).collect() }
}

#[cfg(test)]
mod tests;
