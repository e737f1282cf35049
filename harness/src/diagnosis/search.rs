//! The search for what explains failures: known faults first, each alone; then kinds with free parameters; then two
//! known faults.
//!
//! An explanation is held against everything that its engine read. It is admissible where it leaves no more than
//! chance in one failing sheet at least, and in every other sheet that it changes no more than an engine may be off.

use std::cell::Cell;
use std::collections::{BTreeMap, HashMap};

use itertools::Itertools;
use parking_lot::Mutex;

use super::cause::{Cause, Evidence};
use super::fault::{Fault, Parameter, shows};
use super::faults::{FACTOR, faults};
use super::fit::{Fitted, fit, sum_of_squares};
use super::kinds::kinds;
use super::sheet::{Sheet, Stand, is_chance};
use super::wrong::{Fidelity, Model};
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
/// Solutions of reflected light that fits and pairs may take for one engine: rough and fine.
const SOLUTIONS: [usize; 2] = [3000, 60];
/// Fits that are made with what the simulator has at the last one's parameters.
const REFINED: usize = 2;
/// Starts of a fit that are followed up, the best first.
const FOLLOWED: usize = 2;

/// What there is to be explained, and the explanations there are; what they predict is kept.
pub struct Bench {
    pub models: Vec<Model>,
    pub listed: Vec<Fault>,
    kinds: Vec<Fault>,
    /// By listed fault and model.
    predicted: Mutex<HashMap<(usize, usize, bool), Predicted>>,
}

type Predicted = Option<Vec<f64>>;

impl Bench {
    pub fn new(cases: &[&[Task]], models: Vec<Model>) -> Self {
        Self { models, listed: faults(cases), kinds: kinds(cases), predicted: Mutex::default() }
    }

    /// Without parameters, or with a free factor that is left out.
    fn of_listed(&self, fault: usize, model: usize, fidelity: Fidelity) -> Predicted {
        let key = (fault, model, fidelity == Fidelity::Fine && !self.models[model].is_cheap());
        if let Some(known) = self.predicted.lock().get(&key) {
            return known.clone();
        }
        let found = self.listed[fault].predicted(&self.models[model], &[], fidelity);
        self.predicted.lock().insert(key, found.clone());
        found
    }

    /// What explains the failing sheets of one engine, the best first, sheet by sheet.
    pub fn causes(&self, sheets: &[Sheet]) -> Vec<Vec<Cause>> {
        let rough: Vec<Sheet> = sheets.iter().map(Sheet::roughly).collect();
        Search { bench: self, sheets, rough: &rough, left: SOLUTIONS.map(Cell::new) }.causes()
    }
}

struct Search<'a> {
    bench: &'a Bench,
    sheets: &'a [Sheet],
    /// The same for rough predictions.
    rough: &'a [Sheet],
    /// Solutions of reflected light that are left: rough and fine.
    left: [Cell<usize>; 2],
}

/// What a sheet's task reads with a fault, where it shows.
type Predict<'a> = dyn Fn(usize, Fidelity) -> Option<Vec<f64>> + 'a;

/// A cause with the sheets that it explains.
struct Held {
    cause: Cause,
    explained: Vec<usize>,
    count_of_parameters: usize,
}

impl Search<'_> {
    fn causes(&self) -> Vec<Vec<Cause>> {
        let failing = |k: &usize| self.sheets[*k].fails;
        let mut open: Vec<usize> = (0..self.sheets.len()).filter(failing).collect();
        let mut causes = vec![vec![]; self.sheets.len()];
        if self.sheets.iter().all(|sheet| sheet.read.iter().all(|r| *r == 0.0)) {
            let dark = (0..self.bench.listed.len()).filter(|f| self.bench.listed[*f].id == "dark");
            Self::settle(&dark.filter_map(|f| self.of_listed(f)).collect::<Vec<_>>(), &mut open, &mut causes);
            return causes;
        }
        for stage in [Self::listed, Self::fitted, Self::with_factors, Self::pairs] {
            if open.is_empty() {
                break;
            }
            let found = stage(self, &open);
            Self::settle(&found, &mut open, &mut causes);
        }
        causes
    }

    /// Says of the open sheets that are explained by what.
    fn settle(found: &[Held], open: &mut Vec<usize>, causes: &mut [Vec<Cause>]) {
        for &sheet in open.iter() {
            let explain = found.iter().filter(|held| held.explained.contains(&sheet));
            causes[sheet] = rivals(explain.sorted_by(|a, b| a.cause.score.total_cmp(&b.cause.score)).collect());
        }
        open.retain(|sheet| !found.iter().any(|held| held.explained.contains(sheet)));
    }

    fn listed(&self, _open: &[usize]) -> Vec<Held> {
        (0..self.bench.listed.len()).filter_map(|fault| self.of_listed(fault)).collect()
    }

    fn of_listed(&self, index: usize) -> Option<Held> {
        let fault = &self.bench.listed[index];
        if !fault.parameters.is_empty() {
            return self.of_kind(fault);
        }
        let predict = |sheet: usize, fidelity| self.bench.of_listed(index, self.sheets[sheet].model, fidelity);
        self.weighed(fault, &predict)
    }

    fn fitted(&self, open: &[usize]) -> Vec<Held> {
        let concerns = |fault: &&Fault| fault.case.is_none_or(|case| open.iter().any(|k| self.sheets[*k].case == case));
        self.bench.kinds.iter().filter(concerns).filter_map(|fault| self.of_kind(fault)).collect()
    }

    /// A known fault that is as bright as it may be besides.
    fn with_factors(&self, _open: &[usize]) -> Vec<Held> {
        let is_shape = |f: &usize| self.bench.listed[*f].about != FACTOR && self.bench.listed[*f].is_plain();
        let scaled = |f: usize| {
            let fault = self.bench.listed[f].clone().as_bright_as_you_like();
            let predict = |sheet: usize, fidelity| {
                // A factor shows where the fault does not.
                let model = self.sheets[sheet].model;
                self.bench.of_listed(f, model, fidelity).or_else(|| Some(self.bench.models[model].right.clone()))
            };
            let mut held = self.weighed(&fault, &predict)?;
            let (factor, error) = *held.cause.parameters.last()?;
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
            let mut wrong = super::wrong::Wrong::new(&self.bench.models.first()?.task);
            (f.change)(&mut wrong, &[]);
            let near = (wrong.factor - factor).abs() <= SEEN * error + 1e-3 * factor;
            near.then(|| f.what.clone())
        };
        self.bench.listed.iter().find_map(one)
    }

    fn pairs(&self, _open: &[usize]) -> Vec<Held> {
        let is_alone = |f: &&Fault| f.about != FACTOR && f.is_plain();
        let alone: Vec<&Fault> = self.bench.listed.iter().filter(is_alone).collect();
        let two = |[one, other]: [&&Fault; 2]| {
            let differ = one.id != other.id && one.about != other.about;
            let meet = one.case.is_none_or(|c| other.case.is_none_or(|d| c == d));
            let both = (differ && meet).then(|| one.and(other))?;
            let mut held = self.weighed(&both, &|sheet, fidelity| self.anew(&both, &[], sheet, fidelity))?;
            held.cause.score += PAIR;
            Some(held)
        };
        alone.iter().array_combinations().filter_map(two).collect()
    }

    /// What a sheet's task reads with a fault, as long as there are solutions left.
    fn anew(&self, fault: &Fault, parameters: &[f64], sheet: usize, fidelity: Fidelity) -> Option<Vec<f64>> {
        let sheet = &self.sheets[sheet];
        if !sheet.is_cheap && fault.case.is_none_or(|case| case == sheet.case) {
            let left = &self.left[usize::from(fidelity == Fidelity::Fine)];
            left.set(left.get().saturating_sub(1));
            if left.get() == 0 {
                return None;
            }
        }
        fault.predicted(&self.bench.models[sheet.model], parameters, fidelity)
    }

    fn is_spent(&self) -> bool {
        process::is_interrupted() || self.left.iter().any(|left| left.get() == 0)
    }

    /// Fits the parameters of a fault, roughly first, and to what the simulator has where that does not rule it out.
    fn of_kind(&self, fault: &Fault) -> Option<Held> {
        let concerned = |k: &usize| fault.case.is_none_or(|case| self.sheets[*k].case == case);
        let order: Vec<usize> = self.order().into_iter().filter(concerned).collect();
        let mut starts = self.starts(fault);
        let cheap: Vec<usize> = order.iter().copied().filter(|k| self.sheets[*k].is_cheap).collect();
        for among in [&cheap, &order] {
            let touched = self.touched(fault, &starts[0], among);
            if !touched.iter().any(|k| self.sheets[*k].fails) {
                continue;
            }
            let fitted = self.best(fault, &starts, &touched, None)?;
            let values = fitted.values();
            let refuted = |k: &usize| {
                let predicted = self.anew(fault, &values, *k, Fidelity::Rough);
                predicted.is_none_or(|p| matches!(self.rough[*k].stand(&p), Stand::Contradicted(_)))
            };
            if touched.iter().any(refuted) {
                return None;
            }
            starts = vec![values];
        }
        let touched = self.touched(fault, &starts[0], &order);
        let mut fitted = self.best(fault, &starts, &touched, None)?;
        if touched.iter().any(|k| !self.sheets[*k].is_cheap) {
            for _ in 0..REFINED {
                let from = fitted.values();
                let corrections =
                    touched.iter().map(|k| self.correction(fault, &from, *k)).collect::<Option<Vec<_>>>()?;
                fitted = self.best(fault, &[from], &touched, Some(&corrections))?;
            }
        }
        let is_off = |((value, error), parameter): (&(f64, f64), &Parameter)| {
            let from = parameter.starts.first().map_or(f64::INFINITY, |s| (value - s).abs());
            from > SEEN * error || parameter.starts.len() > 1
        };
        if !fitted.parameters.iter().zip(&fault.parameters).any(is_off) {
            return None;
        }
        let values = fitted.values();
        let held = self.weighed(fault, &|sheet, fidelity| self.anew(fault, &values, sheet, fidelity))?;
        Some(Self::with_parameters(held, fault, fitted.parameters))
    }

    /// What the simulator has over the rough prediction, reading by reading.
    fn correction(&self, fault: &Fault, at: &[f64], sheet: usize) -> Option<Vec<f64>> {
        let fine = self.anew(fault, at, sheet, Fidelity::Fine)?;
        let rough = self.anew(fault, at, sheet, Fidelity::Rough)?;
        Some(fine.iter().zip(&rough).map(|(f, r)| if *r > 0.0 { f / r } else { 1.0 }).collect())
    }

    fn with_parameters(mut held: Held, fault: &Fault, mut parameters: Vec<(f64, f64)>) -> Held {
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
    fn touched(&self, fault: &Fault, at: &[f64], among: &[usize]) -> Vec<usize> {
        let beside: Vec<f64> = at
            .iter()
            .zip(&fault.parameters)
            .map(|(a, p)| {
                let up = a + p.step;
                if up <= p.range.1 { up } else { a - p.step }
            })
            .collect();
        let changes = |k: &usize| {
            let sheet = &self.sheets[*k];
            let wrong = self.anew(fault, &beside, *k, Fidelity::Rough);
            wrong.is_some_and(|w| w.iter().zip(&sheet.right).any(|(w, r)| (w - r).abs() > 1e-5 * r))
        };
        among.iter().copied().filter(changes).collect()
    }

    /// The best fit from any start.
    fn best(
        &self,
        fault: &Fault,
        starts: &[Vec<f64>],
        sheets: &[usize],
        corrections: Option<&[Vec<f64>]>,
    ) -> Option<Fitted> {
        let mut residuals = |parameters: &[f64]| self.residuals(fault, parameters, sheets, corrections);
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
        fault: &Fault,
        parameters: &[f64],
        sheets: &[usize],
        corrections: Option<&[Vec<f64>]>,
    ) -> Option<Vec<f64>> {
        let mut residuals = vec![];
        for (place, &k) in sheets.iter().enumerate() {
            let mut predicted = self.anew(fault, parameters, k, Fidelity::Rough)?;
            if let Some(corrections) = corrections {
                predicted.iter_mut().zip(&corrections[place]).for_each(|(p, c)| *p *= c);
            }
            residuals.extend(self.sheets[k].residuals(&predicted));
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
            let sheets = if fidelity == Fidelity::Fine { self.sheets } else { self.rough };
            for k in order.iter().copied().filter(|k| self.sheets[*k].is_cheap == is_cheap) {
                predicted.remove(&k);
                let Some(found) = predict(k, fidelity) else { continue };
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
            if self.is_spent() || (fault.has_factor && factor.0.is_finite() && predicted.iter().any(refuted)) {
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
        let (mut explained, mut score, mut left, mut telling) = (vec![], 0.0, 0.0, 0);
        for (k, sheet) in self.sheets.iter().enumerate() {
            let found = sheet.stand(predicted.get(&k).unwrap_or(&sheet.right));
            score += found.chi_squared();
            if let (Stand::Explained(chi_squared), Some(p), true) = (found, predicted.get(&k), sheet.fails) {
                left += chi_squared;
                telling += sheet.telling(p);
                explained.push(k);
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
        Some(Held { cause, explained, count_of_parameters })
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
            other.cause.about == held.cause.about && other.count_of_parameters != held.count_of_parameters
                || other.cause.what == held.cause.what
        };
        let is_worse = kept.first().is_some_and(|best| held.cause.score > best.cause.score + RIVAL);
        if !is_worse && !kept.iter().any(is_nested) {
            kept.push(held);
        }
    }
    if kept.len() > MAX_RIVALS { vec![] } else { kept.into_iter().map(|held| held.cause.clone()).collect() }
}
