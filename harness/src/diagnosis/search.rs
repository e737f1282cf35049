//! The search for what explains failures: known faults first, each alone; then kinds with free parameters and slips of
//! programs that are written anew; then two known faults.
//!
//! An explanation is held against everything that its engine read. It is admissible where it leaves no more than
//! chance in one failing sheet at least, and in every other sheet that it changes no more than an engine may be off.
//!
//! What may be spent on a search is limited, in work that is counted. What is left untried might explain readings as
//! well as what was found: where the limit is reached, the stage that reached it says nothing, nor do those after it.

use std::cell::{Cell, RefCell};
use std::collections::{BTreeMap, HashMap, HashSet};

use itertools::Itertools;
use parking_lot::Mutex;

use super::cause::{Cause, Evidence};
use super::fault::{Fault, Parameter, shows};
use super::faults::{FACTOR, faults};
use super::fit::{Fitted, fit, sum_of_squares};
use super::kinds::kinds;
use super::shape;
use super::sheet::{Sheet, Stand, is_chance};
use super::slips::slips;
use super::wrong::{Fidelity, Model, Work, Wrong};
use crate::procedures::Task;
use crate::system::process;

/// Explanations that are this much worse than the best, in chi-squared, are no rivals of it.
const RIVAL: f64 = 4.0;
/// Where more explain failures equally well, nobody knows.
const MAX_RIVALS: usize = 3;
/// What a free parameter must be off its right value by, in standard errors.
const SEEN: f64 = 3.0;
/// What two faults cost besides their parameters: twice the logarithm of how many pairs there are, about.
const PAIR: f64 = 12.0;
/// What explaining one engine may cost: ten seconds of a core or so.
const LIMIT: u64 = 60_000_000;
/// Readings of a sheet that kinds are fitted to at first: more tell hardly more of a few parameters.
const FEW: usize = 40;
/// Fits that are made with what the simulator has at the last one's parameters.
const REFINED: usize = 2;
/// Starts of a fit that are followed up, the best first.
const FOLLOWED: usize = 2;

/// What there is to be explained, and the explanations there are; what they predict is kept.
pub struct Bench {
    pub models: Vec<Model>,
    pub listed: Vec<Fault>,
    kinds: Vec<Fault>,
    slips: Vec<Fault>,
    /// By listed fault and model, with what it cost.
    predicted: Mutex<HashMap<OfListed, (Work, Predicted)>>,
}

type Predicted = Option<Vec<f64>>;
/// A listed fault, a model, and whether its reflected light is the simulator's.
type OfListed = (usize, usize, bool);
/// A place in a search, whether all its readings count, whether reflected light is the simulator's, and parameters.
type OfKind = (usize, bool, bool, Vec<u64>);

impl Bench {
    pub fn new(cases: &[&[Task]], models: Vec<Model>) -> Self {
        Self { models, listed: faults(cases), kinds: kinds(cases), slips: slips(cases), predicted: Mutex::default() }
    }

    /// What explains the failing sheets of one engine, the best first, sheet by sheet.
    pub fn causes(&self, sheets: &[Sheet]) -> Vec<Vec<Cause>> {
        let (models, few) = self.at_few(sheets);
        let rough = |sheets: &[Sheet]| sheets.iter().map(Sheet::roughly).collect();
        let all = Desk { models: &self.models, sheets, rough: rough(sheets), is_all: true };
        let few = Desk { models: &models, sheets: &few, rough: rough(&few), is_all: false };
        let few = if few.sheets.is_empty() { &all } else { &few };
        let (solved, asked, known) = Default::default();
        Search {
            bench: self,
            sheets,
            all: &all,
            few,
            left: Cell::new(LIMIT),
            is_out: Cell::new(false),
            solved,
            asked,
            known,
        }
        .causes()
    }

    /// Sheets of few readings each, from end to end of what there are, with their models; none where that leaves none out.
    fn at_few(&self, sheets: &[Sheet]) -> (Vec<Model>, Vec<Sheet>) {
        if sheets.iter().all(|sheet| sheet.read.len() <= FEW) {
            return Default::default();
        }
        let some = |(k, sheet): (usize, &Sheet)| {
            let (count, kept) = (sheet.read.len(), sheet.read.len().min(FEW));
            let places: Vec<usize> = (0..kept).map(|place| place * count / kept).collect();
            (self.models[sheet.model].at(&places), sheet.at(&places, k))
        };
        sheets.iter().enumerate().map(some).unzip()
    }
}

/// Sheets with their models.
struct Desk<'a> {
    models: &'a [Model],
    sheets: &'a [Sheet],
    /// The same for rough predictions.
    rough: Vec<Sheet>,
    /// Whether all readings are on it.
    is_all: bool,
}

struct Search<'a> {
    bench: &'a Bench,
    sheets: &'a [Sheet],
    all: &'a Desk<'a>,
    /// What fits are made with first.
    few: &'a Desk<'a>,
    /// Work that is left.
    left: Cell<u64>,
    is_out: Cell<bool>,
    /// What is right and solved for already, by model, whether all its readings count, and fidelity.
    solved: RefCell<HashSet<(usize, bool, bool)>>,
    /// Predictions that are paid for, whoever had them made before: the same search always ends at the same place.
    asked: RefCell<HashSet<OfListed>>,
    /// What the fault predicts that is being fitted.
    known: RefCell<HashMap<OfKind, Predicted>>,
}

/// What a sheet's task reads with a fault, where it shows.
type Predict<'a> = dyn Fn(usize, Fidelity) -> Option<Vec<f64>> + 'a;

/// A cause with the sheets that it explains.
struct Held {
    cause: Cause,
    /// The one case that it is of.
    case: Option<usize>,
    explained: Vec<usize>,
    /// Failing sheets in which it shows, and leaves no more than an engine may be off, but more than chance.
    borne: Vec<usize>,
    count_of_parameters: usize,
}

impl Search<'_> {
    fn causes(&self) -> Vec<Vec<Cause>> {
        let failing = |k: &usize| self.sheets[*k].fails;
        let mut open: Vec<usize> = (0..self.sheets.len()).filter(failing).collect();
        let mut causes = vec![vec![]; self.sheets.len()];
        if self.sheets.iter().all(|sheet| sheet.read.iter().all(|r| *r == 0.0)) {
            let dark = (0..self.bench.listed.len()).filter(|f| self.bench.listed[*f].id == "dark");
            self.settle(dark.filter_map(|f| self.of_listed(f)).collect(), &mut open, &mut causes);
            return causes;
        }
        for stage in [Self::listed, Self::fitted, Self::with_factors, Self::pairs, Self::shapes] {
            if open.is_empty() {
                break;
            }
            let found = stage(self, &open);
            if self.is_spent() {
                break;
            }
            self.settle(found, &mut open, &mut causes);
        }
        causes
    }

    /// Says of the open sheets that are explained by what. What is of one case alone must account for all that is open there, or
    /// is one of several things that are wrong with it; and where a fault of the engine shows without explaining everything, nothing
    /// explains the rest alone. What leaves more than chance in most of what fails only looks like it in the rest: it has no name.
    fn settle(&self, mut found: Vec<Held>, open: &mut Vec<usize>, causes: &mut [Vec<Cause>]) {
        let accounts = |held: &Held| {
            let of_case = |k: &&usize| held.case.is_some_and(|case| self.sheets[**k].case == case);
            open.iter().filter(of_case).all(|k| held.explained.contains(k) || held.borne.contains(k))
        };
        found.retain(accounts);
        for &sheet in open.iter() {
            let explain = found.iter().filter(|held| held.explained.contains(&sheet));
            let explain = explain.sorted_by(|a, b| a.cause.score.total_cmp(&b.cause.score)).collect_vec();
            let is_better = |held: &Held| explain.first().is_some_and(|e| held.cause.score + RIVAL < e.cause.score);
            let is_alike = explain.first().is_some_and(|best| !self.carries(best));
            if !is_alike && !found.iter().any(|held| held.borne.contains(&sheet) && is_better(held)) {
                causes[sheet] = rivals(explain);
            }
        }
        let is_settled = |sheet: &usize| found.iter().any(|h| h.explained.contains(sheet) || h.borne.contains(sheet));
        open.retain(|sheet| !is_settled(sheet));
    }

    /// Whether at least half of the failing readings that a cause changes are as it says but for chance.
    fn carries(&self, held: &Held) -> bool {
        let readings = |sheets: &[usize]| sheets.iter().map(|k| self.sheets[*k].count()).sum::<usize>();
        readings(&held.explained) >= readings(&held.borne)
    }

    fn listed(&self, _open: &[usize]) -> Vec<Held> {
        (0..self.bench.listed.len()).filter_map(|fault| self.of_listed(fault)).collect()
    }

    fn of_listed(&self, index: usize) -> Option<Held> {
        let fault = &self.bench.listed[index];
        if !fault.parameters.is_empty() {
            // Of the readings that are cut off none may be among a few.
            return self.of_kind(fault, self.all);
        }
        let predict = |sheet: usize, fidelity| self.listed_at(index, sheet, fidelity);
        self.weighed(fault, &predict)
    }

    fn fitted(&self, open: &[usize]) -> Vec<Held> {
        let concerns = |fault: &&Fault| fault.case.is_none_or(|case| open.iter().any(|k| self.sheets[*k].case == case));
        let kinds = self.bench.kinds.iter().filter(concerns).filter_map(|fault| self.of_kind(fault, self.few));
        // What has no parameter may explain the same, and then better.
        let slip =
            |fault: &Fault| self.weighed(fault, &|sheet, fidelity| self.anew(self.all, fault, &[], sheet, fidelity));
        kinds.chain(self.bench.slips.iter().filter_map(slip)).collect()
    }

    /// A known fault that is as bright as it may be besides.
    fn with_factors(&self, _open: &[usize]) -> Vec<Held> {
        let is_shape = |f: &usize| self.bench.listed[*f].about != FACTOR && self.bench.listed[*f].is_plain();
        let scaled = |f: usize| {
            let fault = self.bench.listed[f].clone().as_bright_as_you_like();
            let predict = |sheet: usize, fidelity| {
                // A factor shows where the fault does not.
                let right = || Some(self.bench.models[self.sheets[sheet].model].right.clone());
                self.listed_at(f, sheet, fidelity).or_else(right)
            };
            let mut held = self.weighed(&fault, &predict)?;
            let (factor, error) = *held.cause.parameters.last()?;
            if !held.explained.iter().any(|k| self.sheets[*k].would_fail(factor)) {
                return None;
            }
            let named = self.named_factor(factor, error);
            let other = named.unwrap_or_else(|| format!("factor {factor:.4}, none of those known"));
            held.cause = held.cause.renamed("two", format!("two faults: {}, and {other}", fault.what));
            held.cause.score += PAIR;
            Some(held)
        };
        (0..self.bench.listed.len()).filter(is_shape).filter_map(scaled).collect()
    }

    fn named_factor(&self, factor: f64, error: f64) -> Option<String> {
        let one = |f: &Fault| {
            if f.about != FACTOR || f.has_factor {
                return None;
            }
            let mut wrong = Wrong::new(&self.bench.models.first()?.task);
            (f.change)(&mut wrong, &[]);
            let near = (wrong.factor - factor).abs() <= SEEN * error + 1e-3 * factor;
            near.then(|| f.what.clone())
        };
        self.bench.listed.iter().find_map(one)
    }

    fn pairs(&self, _open: &[usize]) -> Vec<Held> {
        let is_alone = |f: &&Fault| f.about != FACTOR && f.is_plain() && !f.reflects;
        let alone: Vec<&Fault> = self.bench.listed.iter().filter(is_alone).collect();
        let two = |[one, other]: [&&Fault; 2]| {
            let differ = one.id != other.id && one.about != other.about;
            let meet = one.case.is_none_or(|c| other.case.is_none_or(|d| c == d));
            let both = (differ && meet).then(|| one.and(other))?;
            let mut held = self.weighed(&both, &|sheet, fidelity| self.anew(self.all, &both, &[], sheet, fidelity))?;
            held.cause.score += PAIR;
            Some(held)
        };
        alone.iter().array_combinations().filter_map(two).collect()
    }

    /// What readings have in common, whatever else is wrong with them.
    fn shapes(&self, open: &[usize]) -> Vec<Held> {
        let of = |k: &usize| {
            let sheet = &self.sheets[*k];
            let task = &self.bench.models[sheet.model].task;
            let found = shape::axial(task, sheet).or_else(|| shape::of_nodes(task, sheet));
            let (cause, count_of_parameters) = found.or_else(|| shape::same_everywhere(sheet))?;
            Some(Held { cause, case: None, explained: vec![*k], borne: vec![], count_of_parameters })
        };
        open.iter().filter_map(of).collect()
    }

    /// What a sheet's task reads with a listed fault: without parameters, or with a free factor that is left out.
    fn listed_at(&self, fault: usize, sheet: usize, fidelity: Fidelity) -> Predicted {
        let (bench, model) = (self.bench, self.sheets[sheet].model);
        let is_fine = fidelity == Fidelity::Fine && !self.is_cheap(&bench.listed[fault], sheet);
        let key = (fault, model, is_fine);
        let is_new = self.asked.borrow_mut().insert(key);
        let known = bench.predicted.lock().get(&key).cloned();
        if let Some((work, found)) = known {
            return if is_new && !self.takes(self.all, model, is_fine, work) { None } else { found };
        }
        let wrong = bench.listed[fault].wrong(&bench.models[model], &[]);
        let work = wrong.as_ref().map_or_else(Work::default, |w| bench.models[model].work(w, fidelity));
        if !self.takes(self.all, model, is_fine, work) {
            return None;
        }
        let found = wrong.and_then(|w| bench.models[model].readings(&w, fidelity));
        bench.predicted.lock().insert(key, (work, found.clone()));
        found
    }

    /// What a sheet's task reads with a fault.
    fn anew(&self, desk: &Desk<'_>, fault: &Fault, parameters: &[f64], sheet: usize, fidelity: Fidelity) -> Predicted {
        let place = desk.sheets[sheet].model;
        let model = &desk.models[place];
        let wrong = fault.wrong(model, parameters)?;
        let is_fine = fidelity == Fidelity::Fine && !self.is_cheap(fault, sheet);
        let may = self.takes(desk, place, is_fine, model.work(&wrong, fidelity));
        if may { model.readings(&wrong, fidelity) } else { None }
    }

    /// The same of the fault that is being fitted, which is asked for again and again.
    fn fitting(
        &self,
        desk: &Desk<'_>,
        fault: &Fault,
        parameters: &[f64],
        sheet: usize,
        fidelity: Fidelity,
    ) -> Predicted {
        let is_fine = fidelity == Fidelity::Fine && !self.is_cheap(fault, sheet);
        let key = (sheet, desk.is_all, is_fine, parameters.iter().map(|p| p.to_bits()).collect());
        if let Some(found) = self.known.borrow().get(&key) {
            return found.clone();
        }
        let found = self.anew(desk, fault, parameters, sheet, fidelity);
        self.known.borrow_mut().insert(key, found.clone());
        found
    }

    /// Whether a prediction takes no time worth speaking of.
    fn is_cheap(&self, fault: &Fault, sheet: usize) -> bool {
        self.sheets[sheet].is_cheap && !fault.reflects
    }

    /// Pays for a prediction; says whether it can be paid for.
    fn takes(&self, desk: &Desk<'_>, model: usize, is_fine: bool, work: Work) -> bool {
        let is_new = work.right > 0 && self.solved.borrow_mut().insert((model, desk.is_all, is_fine));
        let cost = work.wrong + if is_new { work.right } else { 0 };
        if self.is_spent() || cost > self.left.get() {
            self.is_out.set(true);
            return false;
        }
        self.left.set(self.left.get() - cost);
        true
    }

    fn is_spent(&self) -> bool {
        self.is_out.get() || process::is_interrupted()
    }

    /// Fits the parameters of a fault, roughly first, and to what the simulator has where that does not rule it out.
    fn of_kind(&self, fault: &Fault, first: &Desk<'_>) -> Option<Held> {
        self.known.borrow_mut().clear();
        let concerned = |k: &usize| fault.case.is_none_or(|case| self.sheets[*k].case == case);
        let order: Vec<usize> = self.order().into_iter().filter(concerned).collect();
        let mut starts = self.starts(fault);
        let cheap: Vec<usize> = order.iter().copied().filter(|k| self.sheets[*k].is_cheap).collect();
        let mut fitted_to = None;
        for among in [&cheap, &order] {
            let touched = self.touched(first, fault, &starts[0], among);
            if !touched.iter().any(|k| self.sheets[*k].fails) || fitted_to.as_ref() == Some(&touched) {
                continue;
            }
            let values = self.best(first, fault, &starts, &touched, None)?.values();
            let refuted = |k: &usize| {
                let predicted = self.fitting(first, fault, &values, *k, Fidelity::Rough);
                let sheets = if self.sheets[*k].is_cheap { first.sheets } else { &first.rough };
                predicted.is_none_or(|p| matches!(sheets[*k].stand(&p), Stand::Contradicted(_)))
            };
            if touched.iter().any(refuted) {
                return None;
            }
            starts = vec![values];
            fitted_to = Some(touched);
        }
        // What changes nothing that fails explains nothing.
        fitted_to?;
        let touched = self.touched(self.all, fault, &starts[0], &order);
        let mut fitted = self.best(self.all, fault, &starts, &touched, None)?;
        if touched.iter().any(|k| !self.sheets[*k].is_cheap) {
            for _ in 0..REFINED {
                let from = fitted.values();
                let corrections =
                    touched.iter().map(|k| self.correction(fault, &from, *k)).collect::<Option<Vec<_>>>()?;
                fitted = self.best(self.all, fault, &[from], &touched, Some(&corrections))?;
            }
        }
        // Noise that readings share moves parameters as if there were fewer of them.
        let shared = touched.iter().map(|k| self.sheets[*k].design_effect).fold(1.0, f64::max);
        fitted.parameters.iter_mut().for_each(|(_, error)| *error *= shared.sqrt());
        let is_off = |((value, error), parameter): (&(f64, f64), &Parameter)| {
            let from = parameter.starts.first().map_or(f64::INFINITY, |s| (value - s).abs());
            from > SEEN * error || parameter.starts.len() > 1
        };
        if !fitted.parameters.iter().zip(&fault.parameters).any(is_off) {
            return None;
        }
        let values = fitted.values();
        let predict = |sheet: usize, fidelity| self.fitting(self.all, fault, &values, sheet, fidelity);
        let held = self.weighed(fault, &predict)?;
        Some(Self::with_parameters(held, fault, fitted.parameters))
    }

    /// What the simulator has over the rough prediction, reading by reading.
    fn correction(&self, fault: &Fault, at: &[f64], sheet: usize) -> Option<Vec<f64>> {
        let fine = self.fitting(self.all, fault, at, sheet, Fidelity::Fine)?;
        let rough = self.fitting(self.all, fault, at, sheet, Fidelity::Rough)?;
        Some(fine.iter().zip(&rough).map(|(f, r)| if *r > 0.0 { f / r } else { 1.0 }).collect())
    }

    fn with_parameters(mut held: Held, fault: &Fault, mut parameters: Vec<(f64, f64)>) -> Held {
        for (found, parameter) in parameters.iter_mut().zip(&fault.parameters) {
            found.0 = parameter.least(found.0);
        }
        parameters.extend(held.cause.parameters);
        held.cause.parameters = parameters;
        held.cause = Cause { what: fault.said(&held.cause.parameters), ..held.cause };
        held
    }

    fn starts(&self, fault: &Fault) -> Vec<Vec<f64>> {
        let brightest = || {
            let lux = |s: &Sheet| {
                let weights = self.bench.models[s.model].task.targets.iter().map(|t| t.aspects[0].weight);
                s.read.iter().zip(weights).map(|(r, w)| r / w).fold(0.0, f64::max)
            };
            self.sheets.iter().filter(|s| s.fails).map(lux).fold(0.0, f64::max)
        };
        let first = |p: &Parameter| p.starts.first().copied().unwrap_or_else(brightest);
        let others = fault.parameters.iter().skip(1).map(first).collect_vec();
        let Some(parameter) = fault.parameters.first() else { return vec![vec![]] };
        let mut all = if parameter.starts.is_empty() { vec![brightest()] } else { parameter.starts.clone() };
        // The first is where nothing is wrong.
        all.sort_by(|a, b| a.abs().total_cmp(&b.abs()).then(b.total_cmp(a)));
        all.into_iter().map(|start| std::iter::once(start).chain(others.iter().copied()).collect()).collect()
    }

    /// The sheets that parameters beside `at` change.
    fn touched(&self, desk: &Desk<'_>, fault: &Fault, at: &[f64], among: &[usize]) -> Vec<usize> {
        let beside: Vec<f64> = at
            .iter()
            .zip(&fault.parameters)
            .map(|(a, p)| {
                let up = a + p.step;
                if up <= p.range.1 { up } else { a - p.step }
            })
            .collect();
        let changes = |k: &usize| {
            let wrong = self.fitting(desk, fault, &beside, *k, Fidelity::Rough);
            wrong.is_some_and(|w| w.iter().zip(&desk.sheets[*k].right).any(|(w, r)| (w - r).abs() > 1e-5 * r))
        };
        among.iter().copied().filter(changes).collect()
    }

    /// The best fit from any start.
    fn best(
        &self,
        desk: &Desk<'_>,
        fault: &Fault,
        starts: &[Vec<f64>],
        sheets: &[usize],
        corrections: Option<&[Vec<f64>]>,
    ) -> Option<Fitted> {
        let mut residuals = |parameters: &[f64]| self.residuals(desk, fault, parameters, sheets, corrections);
        let mut tried: Vec<(f64, &Vec<f64>)> = match starts {
            [one] => vec![(0.0, one)],
            _ => starts.iter().filter_map(|s| Some((sum_of_squares(&residuals(s)?), s))).collect(),
        };
        tried.sort_by(|a, b| a.0.total_cmp(&b.0));
        let fits = tried.iter().take(FOLLOWED).filter_map(|(_, start)| fit(&fault.parameters, start, &mut residuals));
        fits.min_by(|a, b| a.chi_squared.total_cmp(&b.chi_squared))
    }

    fn residuals(
        &self,
        desk: &Desk<'_>,
        fault: &Fault,
        parameters: &[f64],
        sheets: &[usize],
        corrections: Option<&[Vec<f64>]>,
    ) -> Option<Vec<f64>> {
        let mut residuals = vec![];
        for (place, &k) in sheets.iter().enumerate() {
            let mut predicted = self.fitting(desk, fault, parameters, k, Fidelity::Rough)?;
            if let Some(corrections) = corrections {
                predicted.iter_mut().zip(&corrections[place]).for_each(|(p, c)| *p *= c);
            }
            residuals.extend(desk.sheets[k].residuals(&predicted));
        }
        Some(residuals)
    }

    /// What costs nothing first, and of that what fails.
    fn order(&self) -> Vec<usize> {
        (0..self.sheets.len()).sorted_by_key(|k| (!self.sheets[*k].is_cheap, !self.sheets[*k].fails)).collect()
    }

    /// Holds what is predicted against every sheet, what costs nothing and what is rough first; nothing where any
    /// contradicts it or none needs it.
    fn weighed(&self, fault: &Fault, predict: &Predict<'_>) -> Option<Held> {
        let order = self.order();
        let mut predicted: BTreeMap<usize, Vec<f64>> = BTreeMap::new();
        let mut factor = (1.0, 0.0);
        for (is_cheap, fidelity) in [(true, Fidelity::Fine), (false, Fidelity::Rough), (false, Fidelity::Fine)] {
            let sheets = if fidelity == Fidelity::Fine { self.sheets } else { &self.all.rough };
            for k in order.iter().copied().filter(|k| self.is_cheap(fault, *k) == is_cheap) {
                predicted.remove(&k);
                let found = predict(k, fidelity);
                // What cannot be paid for is not what does not show.
                if self.is_spent() {
                    return None;
                }
                let Some(found) = found else { continue };
                if !fault.has_factor && Self::refutes(&sheets[k], &found) {
                    return None;
                }
                predicted.insert(k, found);
            }
            if fault.has_factor {
                let failing = predicted.iter().filter(|(k, _)| self.sheets[**k].fails);
                factor = likeliest_factor(failing.map(|(k, p)| sheets[*k].products(p)));
            }
            let refuted = |(k, p): (&usize, &Vec<f64>)| {
                let p: Vec<f64> = p.iter().map(|x| factor.0 * x).collect();
                Self::refutes(&sheets[*k], &p)
            };
            // Without a failing sheet no factor is known yet.
            if fault.has_factor && factor.0.is_finite() && predicted.iter().any(refuted) {
                return None;
            }
            let fails = |(k, p): (&usize, &Vec<f64>)| self.sheets[*k].fails && shows(p, &self.sheets[*k].right);
            if fidelity == Fidelity::Rough && !fault.has_factor && !predicted.iter().any(fails) {
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
            for x in p.iter_mut() {
                *x *= factor.0;
            }
        }
        predicted.retain(|k, p| shows(p, &self.sheets[*k].right));
        self.held(fault, &predicted, factor)
    }

    fn refutes(sheet: &Sheet, predicted: &[f64]) -> bool {
        shows(predicted, &sheet.right) && matches!(sheet.stand(predicted), Stand::Contradicted(_))
    }

    /// Whether a shape is more than a factor.
    fn is_uneven(&self, predicted: &BTreeMap<usize, Vec<f64>>) -> bool {
        let failing = || predicted.iter().filter(|(k, _)| self.sheets[**k].fails);
        let ratios = failing().flat_map(|(k, p)| p.iter().zip(&self.sheets[*k].right).map(|(p, r)| p / r));
        let extremes = ratios.filter(|r| r.is_finite()).minmax().into_option();
        extremes.is_some_and(|(least, most)| most > least * 1.002)
    }

    fn held(&self, fault: &Fault, predicted: &BTreeMap<usize, Vec<f64>>, factor: (f64, f64)) -> Option<Held> {
        let count_of_parameters = fault.count_of_parameters();
        let (mut explained, mut borne, mut score, mut left, mut telling) = (vec![], vec![], 0.0, 0.0, 0);
        for (k, sheet) in self.sheets.iter().enumerate() {
            let found = sheet.stand(predicted.get(&k).unwrap_or(&sheet.right));
            score += found.chi_squared();
            match (found, predicted.get(&k)) {
                (Stand::Explained(chi_squared), Some(p)) if sheet.fails => {
                    left += chi_squared;
                    telling += sheet.telling(p);
                    explained.push(k);
                }
                (Stand::Borne(_), Some(_)) if sheet.fails => borne.push(k),
                _ => {}
            }
        }
        let all: usize = explained.iter().map(|k| self.sheets[*k].count()).sum();
        // Of a fault on the list one reading less need tell, where others tell that they are as they should be.
        let needed = if fault.id == "clamp" { 2 } else { 2 + count_of_parameters };
        if telling < needed || all < 2 + count_of_parameters || !is_chance(left, all - count_of_parameters) {
            return None;
        }
        let told: usize = self.sheets.iter().map(Sheet::count).sum();
        let parameters = if fault.has_factor { vec![factor] } else { vec![] };
        let what = fault.said(&parameters);
        let off = |of: &dyn Fn(usize) -> f64| explained.iter().map(|k| of(*k)).fold(0.0, f64::max);
        let evidence = Evidence {
            readings: all,
            left: off(&|k| self.sheets[k].worst_percent(&predicted[&k])),
            before: off(&|k| self.sheets[k].worst_percent(&self.sheets[k].right)),
            factor: (fault.about == FACTOR).then(|| self.factor(&explained)),
        };
        score += count_of_parameters as f64 * (told as f64).ln().max(1.0);
        let (id, about) = (fault.id, fault.about.clone());
        let cause = Cause { id, about, what, parameters, evidence, score };
        Some(Held { cause, case: fault.case, explained, borne, count_of_parameters })
    }

    /// What readings are times the reference.
    fn factor(&self, explained: &[usize]) -> (f64, f64) {
        likeliest_factor(explained.iter().map(|k| self.sheets[*k].products(&self.sheets[*k].right)))
    }
}

/// By least squares, with its standard error, from sums of products.
fn likeliest_factor(products: impl Iterator<Item = (f64, f64)>) -> (f64, f64) {
    let (square, product) = products.fold((0.0, 0.0), |(s, q), (a, b)| (s + a, q + b));
    (product / square, square.sqrt().recip())
}

/// Those that explain a sheet about as well as the best; of the same thing the best alone, of too many none.
fn rivals(sorted: Vec<&Held>) -> Vec<Cause> {
    let mut kept: Vec<&Held> = vec![];
    for held in sorted {
        let is_nested = |other: &&Held| {
            let is_alike = other.count_of_parameters == held.count_of_parameters && other.case == held.case;
            other.cause.about == held.cause.about && !is_alike || other.cause.what == held.cause.what
        };
        let is_worse = kept.first().is_some_and(|best| held.cause.score > best.cause.score + RIVAL);
        if !is_worse && !kept.iter().any(is_nested) {
            kept.push(held);
        }
    }
    if kept.len() > MAX_RIVALS { vec![] } else { kept.into_iter().map(|held| held.cause.clone()).collect() }
}
